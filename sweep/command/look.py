"""Commands that look at results and write what they show: show, verify, list, diff, plot, view, report, fit, exponent,
sensitivity, export.

Also those that have no result yet: kernels and studies that come with foliot.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import sweep
from sweep.command import options as o
from sweep.command.options import command, option, switch
from sweep.command.reading import DIFFERENT, Outcome, opened, say, tell
from sweep.errors import COMPLETE, SweepError


@command(
    "sweep kernels foliot --study foliot.toml",
    option("name", "describe this one", metavar="NAME", nargs="?"),
    option("--study", "write a study of this kernel to start from", metavar="FILE.toml", type=Path),
    *(o.FORCE, o.ALLOW_IMPORT, switch("--all", "parameters, outputs and methods of all kernels, and all statuses")),
)
def kernels(arguments: argparse.Namespace) -> None:
    """The kernels that can be swept: parameters, units, outputs, methods."""
    from sweep.show.kernels import catalogue_text, write_starter

    name, path = arguments.name, arguments.study
    if path and not name:
        raise SweepError("--study: name a kernel as well, e.g. sweep kernels foliot --study foliot.toml")
    if path:
        write_starter(name, path, arguments.allow_import, arguments.force)
    say(path or (sweep.kernels(name, arguments.allow_import) if name else catalogue_text(arguments.all)))


@command(
    "sweep studies foliot_scaling",
    option("name", "the study to copy; default: list all", metavar="NAME", nargs="?"),
    o.FORCE,
)
def studies(arguments: argparse.Namespace) -> None:
    """The studies that come with foliot; with a name: copy it here to work on."""
    from sweep.show.studies import copy_study, studies_text

    name = arguments.name
    for text in copy_study(name, force=arguments.force) if name else [studies_text()]:
        say(text)


@command("sweep show foliot.h5", o.RESULT)
def show(arguments: argparse.Namespace) -> None:
    """Contents of a result, how much is computed, and a count of statuses."""
    from sweep.show.text import result_text

    with opened(arguments) as dataset:
        say(result_text(arguments.result, dataset))


@command("sweep verify foliot.h5", o.RESULT, o.JSON)
def verify(arguments: argparse.Namespace) -> None:
    """Check a result's checksums, finished or not."""
    verdict = sweep.verify(arguments.result)
    if not verdict.whole:
        raise SweepError(str(verdict))
    tell(arguments, {**vars(verdict), "whole": verdict.whole}, verdict)


@command(
    "sweep list results",
    option("folder", "default: here", metavar="FOLDER", type=Path, nargs="?", default=Path()),
    *(o.ALL, o.JSON),
)
def list_(arguments: argparse.Namespace) -> None:
    """The results in a folder: cells, how much is computed, statuses, question."""
    found = sweep.list_results(arguments.folder)
    tell(arguments, found, found.table(arguments.all))


@command(
    "sweep diff foliot.h5 foliot_before.h5 --rtol 1e-12",
    *(o.RESULT, o.OTHER),
    option(
        "--rtol", "relative differences up to this count as equal; default: 0", metavar="SHARE", type=float, default=0.0
    ),
    o.JSON,
)
def diff(arguments: argparse.Namespace) -> Outcome:
    """Differences between two results, by cell and status; exit status 1 if there are any."""
    with opened(arguments) as a, opened(arguments, "other") as b:
        found = sweep.diff(a, b, arguments.rtol)
    tell(arguments, found)
    return Outcome(COMPLETE if found.same else DIFFERENT, str(found))


@command(
    "sweep plot foliot.h5 --y period --unit period=hour",
    o.RESULT,
    o.output("FILE.png", "default: the result's name with _plot.png, here; or .svg, .pdf", "_plot.png"),
    *(o.FORCE, o.OUTPUT_Y, option("--x", "default: the longest axis", metavar="AXIS"), o.AT, o.UNITS),
)
def plot(arguments: argparse.Namespace) -> None:
    """A figure of one output."""
    with opened(arguments) as dataset:
        sweep.plot(dataset, arguments.output, y=arguments.y, x=arguments.x, force=True)


@command(
    "sweep view foliot.h5",
    o.RESULT,
    option("--port", "of this machine; default: a free one", metavar="N", type=int, default=0),
    switch("--no-browser", "only print the address of the page"),
)
def view(arguments: argparse.Namespace) -> None:
    """Look at a result in the browser: any two axes, sliders for the others."""
    from sweep.view.page import serve

    with opened(arguments):
        serve(arguments.result, arguments.port, not arguments.no_browser)


@command(
    "sweep report foliot.h5",
    o.RESULT,
    o.output("FILE.html", "default: the result's name with .html, here", ".html"),
    *(o.FORCE, o.UNITS, o.UNFINISHED),
)
def report(arguments: argparse.Namespace) -> None:
    """One self-contained page of HTML: figures, exponents, provenance."""
    from sweep.show.page import write_page

    with opened(arguments) as dataset:
        write_page(dataset, arguments.result, arguments.output)


@command(
    "sweep fit foliot.h5 --x mu --y period --window 1e-3 1e-1",
    o.RESULT,
    o.OUTPUT_Y,
    option("--x", "the axis of the power law", metavar="AXIS", required=True),
    option(
        "--window",
        "part of the axis to fit over; if given twice, also where the two laws meet",
        nargs=2,
        type=float,
        metavar=("LO", "HI"),
        action="append",
        default=[],
    ),
    option("--confidence", "of the intervals; default: 0.95", type=float, default=0.95, metavar="SHARE"),
    option(
        "--noise",
        "whether the values scatter, or how; default: as tests find",
        choices=("yes", "no", "even", "uneven", "correlated", "outliers"),
    ),
    switch("--compare", "which law: one, two or three power laws, an offset, a correction, an exponential ..."),
    o.output("FILE.csv|.png", "also write the table; with --compare a picture of all laws, .png, .svg or .pdf"),
    *(o.FORCE, o.AT, o.UNFINISHED, switch("--all", "all columns, and what they mean"), o.JSON),
)
def fit(arguments: argparse.Namespace) -> None:
    """Exponent of a power law with its interval, and where two laws meet."""
    from sweep.explore.scattered import on_lines
    from sweep.show import laws

    target, windows = arguments.output, arguments.window
    with opened(arguments) as dataset:
        part = on_lines(dataset, arguments.x)
        if not arguments.compare:
            noise = {"yes": True, "no": False}.get(arguments.noise, arguments.noise)
            found = laws.laws(part, arguments.y, arguments.x, windows, arguments.confidence, noise)
            tell(arguments, found, laws.laws_text(found, arguments.all))
            if target:
                laws.write_laws(found, target)
            return
        compared = laws.comparison(part, arguments.y, arguments.x, windows)
    tell(arguments, compared, laws.comparison_text(compared, arguments.all))
    if target:
        sweep.plot(compared, target, force=True)


@command(
    "sweep exponent foliot.h5 --x mu --y period",
    *(o.RESULT, o.OUTPUT_Y, option("--x", "the axis of the power law", metavar="AXIS", required=True)),
    o.output("FILE.png", "also a picture; or .svg, .pdf"),
    *(o.FORCE, o.AT, o.UNFINISHED, switch("--all", "every point, not a dozen of each line"), o.JSON),
)
def exponent(arguments: argparse.Namespace) -> None:
    """The local exponent of an output along an axis, with its error."""
    from sweep.explore.scattered import on_lines
    from sweep.show import laws

    with opened(arguments) as dataset:
        y = laws.output_of(dataset, arguments.y)
        found = sweep.local_exponent(on_lines(dataset, arguments.x)[y], arguments.x, error=True)
    tell(arguments, found, laws.exponents_text(found, arguments.x, arguments.all))
    if arguments.output:
        sweep.plot(found, arguments.output, y="exponent", x=arguments.x, force=True)


@command("sweep sensitivity saltelli.h5 --y period", o.RESULT, o.OUTPUT_Y, o.JSON)
def sensitivity(arguments: argparse.Namespace) -> None:
    """Influence of each axis on an output, from a design "saltelli" or "morris"."""
    from sweep.show import laws

    with opened(arguments) as dataset:
        found = sweep.sensitivity(dataset, laws.output_of(dataset, arguments.y))
    tell(arguments, found, laws.sensitivity_text(found))


@command(
    "sweep export foliot.h5 -o foliot.csv --where \"status == 'OK' and mu < 1\"",
    o.RESULT,
    o.output("FILE.csv|.parquet|.nc|.zarr", required=True),
    o.FORCE,
    option(
        "--where",
        "only cells for which this holds; a number is SI or has a unit: \"status == 'OK' and R < '5 degree/s^2'\"",
        metavar="CONDITION",
    ),
    switch("--compress", "of netCDF4 and zarr: smaller, every bit kept"),
    *(o.UNITS, o.UNFINISHED),
)
def export(arguments: argparse.Namespace) -> None:
    """Write a result as csv, parquet, netCDF4 or zarr."""
    with opened(arguments) as dataset:
        sweep.export(dataset, arguments.output, force=arguments.force, compress=arguments.compress)


@command(
    "sweep join low.h5 high.h5 -o both.h5",
    *(o.RESULT, o.OTHER),
    o.output("JOINED.h5", checked=False, required=True),
    o.FORCE,
    option("--axis", 'name of a new axis, e.g. "version"', metavar="NAME"),
    option("--labels", "its values; default: the names of the files", metavar="LABEL", nargs=2),
)
def join(arguments: argparse.Namespace) -> None:
    """Join two results of one kernel along an axis, or along a new one."""
    from sweep.results.statuses import summary_text

    paths = [arguments.result, arguments.other]
    labels = arguments.labels or [path.stem if len({p.stem for p in paths}) > 1 else str(path) for path in paths]
    with opened(arguments) as a, opened(arguments, "other") as b:
        found = sweep.join(a, b, arguments.output, axis=arguments.axis, labels=labels, force=arguments.force)
    with found:
        say(f"{arguments.output}: {summary_text(found)}")
