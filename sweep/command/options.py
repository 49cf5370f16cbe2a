"""Declaration of a command: a function whose docstring is its help, an example, and its options."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from sweep.command.reading import Outcome, say

Function = Callable[[argparse.Namespace], Outcome | None]


class Option(NamedTuple):
    """What argparse's `add_argument` takes; of a target also how its default ends, and whether it may be there."""

    names: tuple[str, ...]
    keys: dict[str, Any]
    ending: str | None = None
    checked: bool = False


class Command(NamedTuple):
    """One command: what it does, an example of it, and what may stand behind its name."""

    function: Function
    example: str
    options: tuple[Option, ...]

    def run(self, arguments: argparse.Namespace) -> Outcome | None:
        """Does it, unless it would overwrite what is there without --force, or what it reads; says what it has written.

        Raises SweepError.
        """
        from sweep.file.disk import check_target

        target = next((option for option in self.options if option.ending is not None), None)
        if target is not None:
            read = [getattr(arguments, name) for name in ("result", "other", "study") if name in arguments]
            given = arguments.output
            arguments.output = given or (Path(f"{read[0].stem}{target.ending}") if target.ending else None)
            if given or (target.ending and target.checked):
                check_target(arguments.output, force=arguments.force or not target.checked, read=read)
        outcome = self.function(arguments)
        if target is not None and target.checked and arguments.output is not None:
            say(arguments.output, sys.stderr if getattr(arguments, "json", False) else None)
        return outcome


def command(example: str, *options: Option) -> Callable[[Function], Command]:
    """Make a command of a function."""
    return lambda function: Command(function, example, options)


def option(name: str, text: str | None = None, **keys: Any) -> Option:
    """An option, or an argument where the name has no dash."""
    return Option(tuple(name.split()), {"help": text, **keys})


def switch(name: str, text: str) -> Option:
    """An option without a value."""
    return option(name, text, action="store_true")


def output(metavar: str, text: str | None = None, ending: str = "", checked: bool = True, **keys: Any) -> Option:
    """Where a command writes: by default here, under the name of what it reads and an ending, if there is one.

    What is there already is overwritten with --force alone; where it is not `checked`, the command itself looks at it.
    """
    return Option(("-o", "--output"), {"help": text, "metavar": metavar, "type": Path, **keys}, ending, checked)


STUDY = option("study", metavar="STUDY.toml", type=Path)
RESULT = option("result", metavar="OUT.h5", type=Path)
OTHER = option("other", metavar="OTHER.h5", type=Path)
OUTPUT_Y = option(
    "--y",
    "default: the first output other than time; for a section, the first state that varies",
    metavar="OUTPUT",
)
ALLOW_IMPORT = switch("--allow-import", 'allow a kernel "module:NAME" of your own')
FORCE = switch("--force", "overwrite an existing file")
UNFINISHED = switch("--unfinished", "accept a result that is not complete yet")
ALL = switch("--all", "all columns of the table")
JSON = switch("--json", "print JSON, with null for NaN")
SEVERAL: dict[str, Any] = {"nargs": "+", "action": "extend", "default": []}
AT = option("--at", 'select one value of another axis, e.g. "A0=3 degree"', metavar="AXIS=VALUE", **SEVERAL)
UNIT_TEXT = "convert a variable to another unit, e.g. A0=degree e=mm wear=mm/hour"
UNITS = option("--unit", UNIT_TEXT, metavar="NAME=UNIT", **SEVERAL)
SOLVING = (
    option("--workers", "cores to use; default: all", metavar="N", type=int),
    ALLOW_IMPORT,
    option(
        "--isolate",
        "solve cells in separate processes, so that a crash or endless loop costs one cell; "
        'default: for a kernel "module:NAME"',
        action=argparse.BooleanOptionalAction,
    ),
    option(
        "--cell-timeout",
        "time limit per cell, e.g. 90s or 1h; default: 60s, more for slow cells",
        metavar="TIME",
    ),
)
"""Options of every command that solves cells."""
