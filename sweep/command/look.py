"""Commands that look at results: show, cell, check, verify, list, diff, plot, view, report."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sweep.command import options as o
from sweep.command.options import command, option
from sweep.command.outcome import Outcome
from sweep.command.reading import check_target_of, in_units_of, opened, result_of, say
from sweep.errors import COMPLETE, SweepError
from sweep.words import paragraph

DIFFERENT = 1
"""As `diff` of files says it."""


@command(
    "sweep show foliot.h5",
    o.RESULT,
    o.switch("--follow", "then print the run's log until it ends, on any machine that sees it"),
)
def show(arguments: argparse.Namespace) -> None:
    """What is in a result, how much is done, what became of its cells."""
    from sweep.show.follow import follow
    from sweep.show.text import result_text

    with result_of(arguments) as dataset:
        say(result_text(arguments.result, dataset))
    for line in follow(arguments.result) if arguments.follow else ():
        say(line)
        sys.stdout.flush()


@command("sweep verify foliot.h5", o.RESULT)
def verify(arguments: argparse.Namespace) -> None:
    """Check a result's checksums, whether it is finished or not."""
    from sweep.file.verify import verify

    verdict = verify(arguments.result)
    if not verdict.whole:
        raise SweepError(str(verdict))
    say(verdict)


@command(
    "sweep check foliot.h5 --sample 200",
    o.RESULT,
    option("--sample", "cells at most; default: 200", metavar="N", type=int, default=200),
    option("--seed", "draws other cells; default: 0", metavar="N", type=int, default=0),
    *(o.UNFINISHED, o.ALLOW_IMPORT),
)
def check(arguments: argparse.Namespace) -> Outcome:
    """Solve some OK cells again by another method and compare; exit status 1 if one is beyond its rtol."""
    from sweep.explore.recheck import check
    from sweep.study.read import study

    with result_of(arguments) as dataset:
        found = check(dataset, study(dataset, allow_import=arguments.allow_import), arguments.sample, arguments.seed)
    say(paragraph(str(found)))
    return Outcome(DIFFERENT if found.beyond else COMPLETE, str(found))


@command("sweep cell foliot.h5 mu=0.1", o.RESULT, option("at", metavar="AXIS=VALUE", nargs="*"), o.ALLOW_IMPORT)
def cell(arguments: argparse.Namespace) -> None:
    """One cell: its values, what its status means, and what each method says of it."""
    from sweep.explore.one_cell import report_cell
    from sweep.show.laws import pick
    from sweep.study.read import study

    with result_of(arguments) as dataset:
        found = report_cell(pick(dataset, arguments.at), study(dataset, allow_import=arguments.allow_import))
    say(found)


@command(
    "sweep list results",
    option("folder", "default: here", metavar="FOLDER", type=Path, nargs="?", default=Path()),
    o.ALL,
)
def list_(arguments: argparse.Namespace) -> None:
    """The results in a folder: cells, how much is done, statuses, question."""
    from sweep.results.listing import list_results

    say(list_results(arguments.folder).table(arguments.all))


@command(
    "sweep diff foliot.h5 foliot_before.h5 --rtol 1e-12",
    *(o.RESULT, o.OTHER),
    option(
        "--rtol", "relative differences up to this count as equal; default: 0", metavar="SHARE", type=float, default=0.0
    ),
)
def diff(arguments: argparse.Namespace) -> Outcome:
    """In what two results differ: cells, statuses, how far; exit status 1 if they do."""
    from sweep.results.diff import diff

    with opened(arguments.result) as a, opened(arguments.other) as b:
        found = diff(a, b, arguments.rtol)
    say(found)
    return Outcome(COMPLETE if found.same else DIFFERENT, str(found))


@command(
    "sweep plot foliot.h5 --y period --unit period=hour",
    o.RESULT,
    o.output("FILE.png", "default: the result's name with _plot.png, here; or .svg, .pdf"),
    *(o.FORCE, o.OUTPUT_Y, option("--x", "default: the longest axis", metavar="AXIS"), o.AT, o.UNITS),
)
def plot(arguments: argparse.Namespace) -> None:
    """A figure of one output."""
    from sweep.show.laws import pick
    from sweep.show.plot import plot

    target = arguments.output or Path(f"{arguments.result.stem}_plot.png")
    check_target_of(arguments, target)
    with result_of(arguments) as dataset:
        plot(in_units_of(pick(dataset, arguments.at), arguments.unit), target, y=arguments.y, x=arguments.x)
    say(target)


@command(
    "sweep view foliot.h5",
    o.RESULT,
    option("--port", "of this machine; default: a free one", metavar="N", type=int, default=0),
    o.switch("--no-browser", "only print the address of the page"),
)
def view(arguments: argparse.Namespace) -> None:
    """Look at a result in the browser: any two axes, sliders for the others."""
    from sweep.view.page import serve

    with result_of(arguments):
        serve(arguments.result, arguments.port, not arguments.no_browser)


@command(
    "sweep report foliot.h5",
    o.RESULT,
    o.output("FILE.html", "default: the result's name with .html, here"),
    *(o.FORCE, o.UNITS, o.UNFINISHED),
)
def report(arguments: argparse.Namespace) -> None:
    """One self-contained page of HTML: figures, exponents, provenance."""
    from sweep.show.page import write_page

    target = arguments.output or Path(f"{arguments.result.stem}.html")
    check_target_of(arguments, target)
    with result_of(arguments) as dataset:
        say(write_page(in_units_of(dataset, arguments.unit), arguments.result, target))
