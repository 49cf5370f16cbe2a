"""How a command is declared: a function whose docstring is its help, what may stand behind its name, an example."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from sweep.command.outcome import Outcome

Function = Callable[[argparse.Namespace], Outcome | None]


class Option(NamedTuple):
    """What argparse's `add_argument` takes."""

    names: tuple[str, ...]
    keys: dict[str, Any]


class Command(NamedTuple):
    """One command: what it does, an example of it, and what may stand behind its name."""

    function: Function
    example: str
    options: tuple[Option, ...]


def command(example: str, *options: Option) -> Callable[[Function], Command]:
    """Make a command of a function."""
    return lambda function: Command(function, example, options)


def option(name: str, text: str | None = None, **keys: Any) -> Option:
    """An option, or an argument where the name has no dash."""
    return Option(tuple(name.split()), {"help": text, **keys})


def switch(name: str, text: str) -> Option:
    """An option without a value."""
    return option(name, text, action="store_true")


def several(name: str, text: str, metavar: str) -> Option:
    """An option with values, which may be given again."""
    return option(name, text, metavar=metavar, nargs="+", action="extend", default=[])


def output(metavar: str, text: str | None = None, required: bool = False) -> Option:
    """Where a command writes."""
    return option("-o --output", text, metavar=metavar, type=Path, required=required)


STUDY = option("study", metavar="STUDY.toml", type=Path)
RESULT = option("result", metavar="OUT.h5", type=Path)
OUTPUT_Y = option("--y", "default: the first output; of a scene of one's own its interval", metavar="OUTPUT")
OTHER = option("other", metavar="OTHER.h5", type=Path)
ALLOW_IMPORT = switch("--allow-import", 'allow a kernel "module:NAME" of your own')
FORCE = switch("--force", "overwrite what is there")
UNFINISHED = switch("--unfinished", "take what there is of a result that is not complete yet")
ALL = switch("--all", "all columns of the table")
AT = several("--at", "pick one value of another axis", "AXIS=VALUE")
UNITS = several("--unit", "give a variable in another unit, e.g. A0=degree e=mm wear=mm/hour", "NAME=UNIT")
SOLVING = (
    option("--workers", "cores to use; default: all", metavar="N", type=int),
    ALLOW_IMPORT,
    option(
        "--isolate",
        "solve cells in processes of their own, so that one that crashes or never ends costs only itself; "
        'default: for a kernel "module:NAME"',
        action=argparse.BooleanOptionalAction,
    ),
    option(
        "--cell-timeout",
        "time limit of a cell, e.g. 90s or 1h; default: 60s, longer if cells take long",
        metavar="TIME",
    ),
)
"""Options of every command that solves cells."""
