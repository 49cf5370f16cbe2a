"""Commands that look at results and write what they show: show, verify, list, diff, plot, view, report, fit, exponent,
sensitivity, export.

Also the commands that need no result: kernels and studies.
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
    option("name", "describe this kernel", metavar="NAME", nargs="?"),
    option("--study", "write an example study of this kernel", metavar="FILE.toml", type=Path),
    *(o.FORCE, o.ALLOW_IMPORT, switch("--all", "parameters, outputs and methods of all kernels, and all statuses")),
)
def kernels(arguments: argparse.Namespace) -> None:
    """List the kernels, or describe one: parameters, units, outputs, methods."""
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
    """List the studies that come with foliot, or copy one here to work on."""
    from sweep.show.studies import copy_study, studies_text

    name = arguments.name
    for text in copy_study(name, force=arguments.force) if name else [studies_text()]:
        say(text)


@command("sweep show foliot.h5", o.RESULT)
def show(arguments: argparse.Namespace) -> None:
    """Show what a result contains, how much of it is computed, and its statuses."""
    from sweep.show.text import result_text

    with opened(arguments) as dataset:
        say(result_text(arguments.result, dataset))


@command("sweep verify foliot.h5", o.RESULT, o.JSON)
def verify(arguments: argparse.Namespace) -> None:
    """Verify the checksums of a result, complete or not."""
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
    """List the results in a folder: cells, share computed, statuses, question."""
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
    """Compare two results, cell by cell; exit status 1 if they differ."""
    with opened(arguments) as a, opened(arguments, "other") as b:
        found = sweep.diff(a, b, arguments.rtol)
    tell(arguments, found)
    return Outcome(COMPLETE if found.same else DIFFERENT, str(found))


@command(
    "sweep plot foliot.h5 --y period --unit period=hour",
    o.RESULT,
    o.output("FILE.png", ".png, .svg or .pdf; default: the result's name with _plot.png, here", "_plot.png"),
    *(o.FORCE, o.OUTPUT_Y, option("--x", "default: the longest axis", metavar="AXIS"), o.AT, o.UNITS),
)
def plot(arguments: argparse.Namespace) -> None:
    """Plot one output."""
    with opened(arguments) as dataset:
        sweep.plot(dataset, arguments.output, y=arguments.y, x=arguments.x, force=True)


@command(
    "sweep view foliot.h5",
    o.RESULT,
    option("--port", "port to serve the page on; default: a free one", metavar="N", type=int, default=0),
    switch("--no-browser", "do not open a browser, only print the address"),
)
def view(arguments: argparse.Namespace) -> None:
    """View a result in the browser: any two axes, sliders for the others."""
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
    """Write a self-contained HTML page: figures, exponents, provenance."""
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
    option("--confidence", "confidence of the intervals; default: 0.95", type=float, default=0.95, metavar="SHARE"),
    option(
        "--noise",
        "whether, or how, the values scatter; default: decided by tests",
        choices=("yes", "no", "even", "uneven", "correlated", "outliers"),
    ),
    switch("--compare", "compare laws: one, two or three power laws, an offset, a correction, an exponential ..."),
    o.output("FILE.csv|.png", "also save the table; with --compare a figure of all laws, .png, .svg or .pdf"),
    *(o.FORCE, o.AT, o.UNFINISHED, switch("--all", "all columns, with their meaning"), o.JSON),
)
def fit(arguments: argparse.Namespace) -> None:
    """Fit a power law: its exponent with an interval, and where two laws meet."""
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
    o.output("FILE.png", "also save a figure, .png, .svg or .pdf"),
    *(o.FORCE, o.AT, o.UNFINISHED, switch("--all", "all points, instead of a dozen per line"), o.JSON),
)
def exponent(arguments: argparse.Namespace) -> None:
    """Print the local exponent of an output along an axis, with its error."""
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
    """Print sensitivity indices of an output, from a design "saltelli" or "morris"."""
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
        "only cells that satisfy this; numbers are SI or have a unit: \"status == 'OK' and R < '5 degree/s^2'\"",
        metavar="CONDITION",
    ),
    switch("--compress", "compress netCDF4 or zarr, without loss"),
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
