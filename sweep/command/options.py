"""How a command is declared: what it is for, what may stand behind its name, how it ended."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from sweep.command.outcome import Outcome


class Option(NamedTuple):
    """What argparse's `add_argument` takes."""

    names: tuple[str, ...]
    keys: dict[str, Any]


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


class Command:
    """One command: what it is for, what does it, and what may stand behind its name."""

    def __init__(self, text: str, function: Callable[[argparse.Namespace], Outcome | None], *options: Option) -> None:
        self.text, self.function, self.options = text, function, options


STUDY = option("study", metavar="STUDY.toml", type=Path)
RESULT = option("result", metavar="OUT.h5", type=Path)
OUTPUT_Y = option("--y", "default: the first output; of a scene of one's own its interval", metavar="OUTPUT")
OTHER = option("other", metavar="OTHER.h5", type=Path)
WORKERS = option("--workers", "cores to use; default: all", metavar="N", type=int)
ALLOW_IMPORT = switch("--allow-import", 'allow a kernel "module:NAME" of your own')
ISOLATE = option(
    "--isolate",
    "solve cells in processes of their own, so that one that crashes or never ends costs only itself; "
    'default: for a kernel "module:NAME"',
    action=argparse.BooleanOptionalAction,
)
CELL_TIMEOUT = option(
    "--cell-timeout", "what a cell may take, e.g. 90s or 1h; default: 60s, longer where cells do", metavar="TIME"
)
FORCE = switch("--force", "overwrite what is there")
UNFINISHED = switch("--unfinished", "take what there is of a result that is not complete yet")
ALL = switch("--all", "all columns of the table")
AT = several("--at", "pick one value of another axis", "AXIS=VALUE")
UNITS = several("--unit", "give a variable in another unit, e.g. A0=degree e=mm wear=mm/hour", "NAME=UNIT")
