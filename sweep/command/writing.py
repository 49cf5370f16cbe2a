"""Commands that write results anew: export, join."""

from __future__ import annotations

import argparse

from sweep.command.files import check_target_of, in_units_of, opened, result_of, say
from sweep.command.options import FORCE, OTHER, RESULT, UNFINISHED, UNITS, Command, option, output, switch


def _export(arguments: argparse.Namespace) -> None:
    from sweep.results.export import export
    from sweep.results.filter import where

    check_target_of(arguments, arguments.output)
    with result_of(arguments) as dataset:
        chosen = dataset if arguments.where is None else where(dataset, arguments.where)
        keys = {name: getattr(arguments, name) for name in ("force", "compress", "float32")}
        say(export(in_units_of(chosen, arguments.unit), arguments.output, **keys))


def _join(arguments: argparse.Namespace) -> None:
    from sweep.explore.join import join
    from sweep.results.statuses import summary_text

    paths = [arguments.result, arguments.other]
    check_target_of(arguments, arguments.output, force=True)
    labels = arguments.labels or [path.stem if len({p.stem for p in paths}) > 1 else str(path) for path in paths]
    with opened(paths[0]) as a, opened(paths[1]) as b:
        found = join(a, b, arguments.output, axis=arguments.axis, labels=labels, force=arguments.force)
    with found:
        say(f"{arguments.output}: {summary_text(found)}")


COMMANDS = {
    "export": Command(
        "write a result as csv, parquet, netCDF4 or zarr",
        _export,
        RESULT,
        output("FILE.csv|.parquet|.nc|.zarr", required=True),
        FORCE,
        option("--where", "only cells for which this holds, e.g. \"status == 'OK' and R < 0.1\"", metavar="CONDITION"),
        switch("--compress", "of netCDF4 and zarr: smaller, every bit kept"),
        switch("--float32", "of netCDF4 and zarr: outputs with 24 bits of precision"),
        *(UNITS, UNFINISHED),
    ),
    "join": Command(
        "two results of one kernel as one, longer along an axis or along a new one",
        _join,
        *(RESULT, OTHER),
        output("JOINED.h5", required=True),
        FORCE,
        option("--axis", 'name of a new axis, e.g. "version"', metavar="NAME"),
        option("--labels", "its values; default: the names of the files", metavar="LABEL", nargs=2),
    ),
}
