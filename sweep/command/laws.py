"""The command that finds laws: fit."""

from __future__ import annotations

import argparse

from sweep.command.files import check_target_of, result_of, say
from sweep.command.options import AT, FORCE, OUTPUT_Y, RESULT, UNFINISHED, Command, option, output, switch


def _fit(arguments: argparse.Namespace) -> None:
    from sweep.explore.scattered import on_lines
    from sweep.show.laws import laws, laws_text, pick, write_laws

    if arguments.compare:
        _compare(arguments)
        return
    if arguments.output:
        check_target_of(arguments, arguments.output)
    with result_of(arguments) as dataset:
        part = on_lines(pick(dataset, arguments.at), arguments.x)
        noise = {"yes": True, "no": False}.get(arguments.noise, arguments.noise)
        found = laws(part, arguments.y, arguments.x, arguments.window or [], arguments.confidence, noise)
    say(laws_text(found))
    if arguments.output:
        write_laws(found, arguments.output)
        say(arguments.output)


def _compare(arguments: argparse.Namespace) -> None:
    """`sweep fit --compare`: a table, and a picture or csv of it."""
    from sweep.explore.scattered import on_lines
    from sweep.show.compare import comparison, comparison_text, write_comparison
    from sweep.show.laws import pick

    target = arguments.output
    drawn = target is not None and target.suffix.lower() != ".csv"
    if target:
        check_target_of(arguments, target)
    with result_of(arguments) as dataset:
        part = on_lines(pick(dataset, arguments.at), arguments.x)
        found = comparison(part, arguments.y, arguments.x, arguments.window or [])
    say(comparison_text(found))
    if drawn:
        from sweep.show.charts import save
        from sweep.show.plot import plot

        save(plot(found), target)
    elif target:
        write_comparison(found, target)
    if target:
        say(target)


COMMANDS = {
    "fit": Command(
        "exponent of a power law, and where two laws meet",
        _fit,
        RESULT,
        OUTPUT_Y,
        option("--x", metavar="AXIS", required=True),
        option(
            "--window",
            "part of the axis to fit over; given twice, also tells where the two laws meet",
            nargs=2,
            type=float,
            metavar=("LO", "HI"),
            action="append",
        ),
        option("--confidence", "of the intervals; default: 0.95", type=float, default=0.95, metavar="SHARE"),
        option(
            "--noise",
            "whether the values scatter, or how; default: as tests find",
            choices=("yes", "no", "even", "uneven", "correlated", "outliers"),
        ),
        switch("--compare", "which law: one, two or three power laws, an offset, a correction, an exponential ..."),
        output("FILE.csv|.png", "also write the table; with --compare, .png, .svg or .pdf is a picture of all laws"),
        *(FORCE, AT, UNFINISHED),
    ),
}
