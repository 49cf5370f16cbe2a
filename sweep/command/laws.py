"""The command that finds laws: fit."""

from __future__ import annotations

import argparse

from sweep.command import options as o
from sweep.command.options import command, option
from sweep.command.reading import check_target_of, result_of, say


@command(
    "sweep fit foliot.h5 --x mu --y period --window 1e-3 1e-1",
    o.RESULT,
    o.OUTPUT_Y,
    option("--x", metavar="AXIS", required=True),
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
    o.switch("--compare", "which law: one, two or three power laws, an offset, a correction, an exponential ..."),
    o.output("FILE.csv|.png", "also write the table; with --compare, .png, .svg or .pdf is a picture of all laws"),
    *(o.FORCE, o.AT, o.UNFINISHED, o.switch("--all", "all columns, and what they mean")),
)
def fit(arguments: argparse.Namespace) -> None:
    """Exponent of a power law with its interval, and where two laws meet."""
    from sweep.explore.scattered import on_lines
    from sweep.show import laws
    from sweep.show.plot import plot

    target, windows = arguments.output, arguments.window
    if target:
        check_target_of(arguments, target)
    with result_of(arguments) as dataset:
        part = on_lines(laws.pick(dataset, arguments.at), arguments.x)
        if arguments.compare:
            compared = laws.comparison(part, arguments.y, arguments.x, windows)
        else:
            noise = {"yes": True, "no": False}.get(arguments.noise, arguments.noise)
            found = laws.laws(part, arguments.y, arguments.x, windows, arguments.confidence, noise)
    say(laws.comparison_text(compared, arguments.all) if arguments.compare else laws.laws_text(found, arguments.all))
    if target:
        if not arguments.compare:
            laws.write_laws(found, target)
        elif target.suffix.lower() == ".csv":
            laws.write_comparison(compared, target)
        else:
            plot(compared, target)
        say(target)
