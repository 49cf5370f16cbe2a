"""How a command ended: exit status, and what is said of it."""

from __future__ import annotations

from typing import NamedTuple

from sweep.errors import FAULT, INCOMPLETE, INTERRUPTED, MISTAKE, Incomplete, SweepError

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
            return Outcome(MISTAKE, f"{error.filename or 'the system'}: {error.strerror or error}")
    said = "Please report it; with SWEEP_TRACEBACK=1 in the environment the same command says where."
    return Outcome(FAULT, f"a fault in foliot: {type(error).__name__}: {error}\n{said}")
