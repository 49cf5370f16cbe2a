"""Commands that write results anew: export, join."""

from __future__ import annotations

import argparse

from sweep.command import options as o
from sweep.command.options import command, option
from sweep.command.reading import check_target_of, in_units_of, opened, result_of, say


@command(
    "sweep export foliot.h5 -o foliot.csv --where \"status == 'OK' and mu < 1\"",
    o.RESULT,
    o.output("FILE.csv|.parquet|.nc|.zarr", required=True),
    o.FORCE,
    option("--where", "only cells for which this holds, e.g. \"status == 'OK' and R < 0.1\"", metavar="CONDITION"),
    o.switch("--compress", "of netCDF4 and zarr: smaller, every bit kept"),
    o.switch("--float32", "of netCDF4 and zarr: outputs with 24 bits of precision"),
    *(o.UNITS, o.UNFINISHED),
)
def export(arguments: argparse.Namespace) -> None:
    """Write a result as csv, parquet, netCDF4 or zarr."""
    from sweep.results.export import export
    from sweep.results.filter import where

    check_target_of(arguments, arguments.output)
    with result_of(arguments) as dataset:
        chosen = dataset if arguments.where is None else where(dataset, arguments.where)
        keys = {name: getattr(arguments, name) for name in ("force", "compress", "float32")}
        say(export(in_units_of(chosen, arguments.unit), arguments.output, **keys))


@command(
    "sweep join low.h5 high.h5 -o both.h5",
    *(o.RESULT, o.OTHER),
    o.output("JOINED.h5", required=True),
    o.FORCE,
    option("--axis", 'name of a new axis, e.g. "version"', metavar="NAME"),
    option("--labels", "its values; default: the names of the files", metavar="LABEL", nargs=2),
)
def join(arguments: argparse.Namespace) -> None:
    """Two results of one kernel as one, longer along an axis or along a new one."""
    from sweep.explore.join import join
    from sweep.results.statuses import summary_text

    paths = [arguments.result, arguments.other]
    check_target_of(arguments, arguments.output, force=True)
    labels = arguments.labels or [path.stem if len({p.stem for p in paths}) > 1 else str(path) for path in paths]
    with opened(paths[0]) as a, opened(paths[1]) as b:
        found = join(a, b, arguments.output, axis=arguments.axis, labels=labels, force=arguments.force)
    with found:
        say(f"{arguments.output}: {summary_text(found)}")
