"""Commands that look at results: show, verify, list, diff, plot, view, report."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sweep.command.files import check_target_of, in_units_of, opened, result_of, say
from sweep.command.options import (
    ALL,
    AT,
    FORCE,
    OTHER,
    OUTPUT_Y,
    RESULT,
    UNFINISHED,
    UNITS,
    Command,
    option,
    output,
    switch,
)
from sweep.command.outcome import Outcome
from sweep.errors import COMPLETE, SweepError

DIFFERENT = 1
"""As `diff` of files says it."""


def _show(arguments: argparse.Namespace) -> None:
    from sweep.show.follow import follow
    from sweep.show.text import result_text

    with result_of(arguments) as dataset:
        say(result_text(arguments.result, dataset))
    if arguments.follow:
        for line in follow(arguments.result):
            say(line)
            sys.stdout.flush()


def _verify(arguments: argparse.Namespace) -> None:
    from sweep.file.verify import verify

    verdict = verify(arguments.result)
    if not verdict.whole:
        raise SweepError(str(verdict))
    say(verdict)


def _list(arguments: argparse.Namespace) -> None:
    from sweep.results.listing import list_results

    say(list_results(arguments.folder).table(arguments.all))


def _diff(arguments: argparse.Namespace) -> Outcome:
    from sweep.results.diff import diff

    with opened(arguments.result) as a, opened(arguments.other) as b:
        found = diff(a, b, arguments.rtol)
    say(found)
    return Outcome(COMPLETE if found.same else DIFFERENT, str(found))


def _plot(arguments: argparse.Namespace) -> None:
    from sweep.show.charts import save
    from sweep.show.laws import pick
    from sweep.show.plot import plot

    output = arguments.output or Path(f"{arguments.result.stem}_plot.png")
    check_target_of(arguments, output)
    with result_of(arguments) as dataset:
        figure = plot(in_units_of(pick(dataset, arguments.at), arguments.unit), y=arguments.y, x=arguments.x)
    save(figure, output)
    say(output)


def _view(arguments: argparse.Namespace) -> None:
    from sweep.view.server import serve

    with result_of(arguments):
        serve(arguments.result, arguments.port, not arguments.no_browser)


def _report(arguments: argparse.Namespace) -> None:
    from sweep.show.page import write_page

    output = arguments.output or Path(f"{arguments.result.stem}.html")
    check_target_of(arguments, output)
    with result_of(arguments) as dataset:
        say(write_page(in_units_of(dataset, arguments.unit), arguments.result, output))


COMMANDS = {
    "show": Command(
        "what is in a result, how much is done, what became of its cells",
        _show,
        RESULT,
        switch("--follow", "then tell how the run goes on until it ends, from its log, on any machine that sees it"),
    ),
    "verify": Command("whether a result, finished or not, is what was written", _verify, RESULT),
    "list": Command(
        "the results in a folder: cells, how much is done, statuses, question",
        _list,
        option("folder", "default: here", metavar="FOLDER", type=Path, nargs="?", default=Path()),
        ALL,
    ),
    "diff": Command(
        "in what two results differ: cells, statuses, how far; exit status 1 where they do",
        _diff,
        *(RESULT, OTHER),
        option("--rtol", "relative distance that is none; default: 0", metavar="SHARE", type=float, default=0.0),
    ),
    "plot": Command(
        "a figure of one output",
        _plot,
        RESULT,
        output("FILE.png", "default: the result's name with _plot.png, here"),
        FORCE,
        OUTPUT_Y,
        option("--x", "default: the first axis", metavar="AXIS"),
        *(AT, UNITS),
    ),
    "view": Command(
        "look at a result in the browser: any two axes, sliders for the others",
        _view,
        RESULT,
        option("--port", "of this machine; default: a free one", metavar="N", type=int, default=0),
        switch("--no-browser", "only say where the page is"),
    ),
    "report": Command(
        "one self-contained page of HTML: figures, exponents, provenance",
        _report,
        RESULT,
        output("FILE.html", "default: the result's name with .html, here"),
        *(FORCE, UNITS, UNFINISHED),
    ),
}
