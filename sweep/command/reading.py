"""Input of commands, opened and checked; their output, as text or with --json as JSON; their exit status."""

from __future__ import annotations

import argparse
import contextlib
import enum
import json
import math
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO

import sweep
from sweep.errors import FAULT, INCOMPLETE, INTERRUPTED, MISTAKE, Incomplete, SweepError, reason
from sweep.words import paragraph, printable

if TYPE_CHECKING:
    import xarray as xr

    from sweep.study.model import Study

DIFFERENT = 1
"""Exit status of commands that compare, as `diff` of files says it."""


class Outcome(NamedTuple):
    """How a command ended: its exit status, and what is said of it."""

    code: int
    text: str


def explained(error: BaseException) -> Outcome:
    """The exit status and the message of a fault."""
    match error:
        case SweepError():
            return Outcome(INCOMPLETE if isinstance(error, Incomplete) else MISTAKE, str(error))
        case KeyboardInterrupt():
            return Outcome(INTERRUPTED, "stopped")
        case SystemExit(code=code):
            return Outcome(code if isinstance(code, int) else FAULT, "stopped")
        case MemoryError():
            return Outcome(MISTAKE, "out of memory; choose fewer cells, fewer outputs or fewer workers")
        case OSError():
            return Outcome(MISTAKE, f"{error.filename or 'the system'}: {reason(error)}")
    said = "Please report it; with SWEEP_TRACEBACK=1 in the environment the same command says where."
    return Outcome(FAULT, f"a fault in foliot: {type(error).__name__}: {error}\n{said}")


def study_from(arguments: argparse.Namespace, given: Any = None) -> Study:
    """The study that is named, or that of a result that is given."""
    from sweep.study.read import study

    return study(arguments.study if given is None else given, allow_import=arguments.allow_import)


def solving(arguments: argparse.Namespace, study: Study) -> dict[str, Any]:
    """How cells are solved; those of a user's own kernel in processes of their own, unless it is said."""
    isolate = ":" in study.kernel_name if arguments.isolate is None else bool(arguments.isolate)
    workers = {"workers": arguments.workers} if "workers" in arguments else {}
    return {**workers, "isolate": isolate, "cell_timeout": arguments.cell_timeout}


@contextlib.contextmanager
def opened(arguments: argparse.Namespace, name: str = "result") -> Iterator[xr.Dataset]:
    """A result that is named, with --at, --where and --unit; one that is not complete where the command takes it."""
    options = vars(arguments)
    path: Path = options[name]
    if path.suffix == ".toml":
        raise SweepError(f"{path} is a study, not a result; compute it with: sweep run {path}")
    if not path.exists() and path.with_name(path.name + ".unfinished").exists():
        say(f"{path}: unfinished; cells that are not computed yet are NaN and PENDING", file=sys.stderr)
    with sweep.open_result(path) as found:
        if "end" not in found.attrs and not options.get("unfinished", True):
            raise SweepError(f"{path}: unfinished; continue it with sweep run, or use it as it is with --unfinished")
        if options.get("at"):
            from sweep.show.laws import pick

            found = pick(found, arguments.at)
        if options.get("where"):
            found = sweep.where(found, arguments.where)
        units = {text: text.partition("=") for text in options.get("unit", ())}
        for text, pair in units.items():
            if not all(pair):
                raise SweepError(f'--unit: expected NAME=UNIT, found "{text}"; write e.g. --unit A0=degree')
        yield sweep.in_units(found, {name: unit for name, _, unit in units.values()}) if units else found


def say(text: object, file: TextIO | None = None, wide: bool = False) -> None:
    """Prints, to stdout unless said otherwise, what may hold text of other people; no wider than the terminal.

    A path is printed as it is, in one line, for others to take.
    """
    shown = printable(str(text))
    print(shown if wide or isinstance(text, Path) else paragraph(shown), file=file)


def tell(arguments: argparse.Namespace, found: Any, text: object = None) -> None:
    """Prints what was found: as people read it, or with --json all of it."""
    if arguments.json:
        print(json.dumps(plain(found), ensure_ascii=False, indent=1))
    else:
        say(found if text is None else text, wide=getattr(arguments, "all", False))


def plain(value: Any) -> Any:
    """A finding as JSON has it: records and Datasets are objects, statuses words, and what is not finite null."""
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    for method in ("to_dict", "tolist", "_asdict"):
        if hasattr(value, method):
            return plain(getattr(value, method)())
    if isinstance(value, Mapping):
        return {str(name): plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple | set):
        return [plain(one) for one in value]
    return plain(vars(value)) if hasattr(value, "__dict__") else str(value)
