"""Errors that a user can act on: one clear line each, never a traceback.

Also deferral of Ctrl-C and SIGTERM.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn


class SweepError(Exception):
    """An error that the user can act on; its text is the complete message. The command line prints it and exits with 2.

    Examples
    --------
    >>> import sweep
    >>> try:
    ...     sweep.kernels("folio")
    ... except sweep.SweepError as error:
    ...     print(error)
    no kernel "folio"; did you mean foliot? there are ...
    """


class Incomplete(SweepError):
    """A run that ended early, without a mistake in the study; the command line exits with 3."""


def reason(fault: BaseException) -> str:
    """What a fault says, or its kind; of HDF5's account, which has several lines, the system's words for its number."""
    text = (isinstance(fault, OSError) and fault.strerror) or str(fault)
    if isinstance(fault, OSError) and fault.errno and ("\n" in text or not fault.strerror):
        return os.strerror(fault.errno)
    return text.partition("\n")[0] or type(fault).__name__


def missing(what: str, extra: str) -> SweepError:
    """The fault that a library is not installed: what needs which, and the extra that brings it."""
    commands = f"in a checkout pip install -e '.[{extra}]', elsewhere pip install 'foliot[{extra}]'"
    return SweepError(f'{what}, from the extra "{extra}"; install it: {commands}')


class Terminated(SystemExit):
    """The system, or somebody, asked this process to end (SIGTERM); it does, with the usual exit status 143."""


def terminate(*struck: object) -> NoReturn:
    """What SIGTERM does where a run is to end in its own words."""
    raise Terminated(TERMINATED)


@contextlib.contextmanager
def signals_held() -> Iterator[Callable[[], None]]:
    """Holds Ctrl-C and SIGTERM back, for Python's locks are left in disorder where they strike in them.

    What it gives raises KeyboardInterrupt or Terminated after one of them, and is called at the end, also where
    something fails then: the second one strikes at once, maybe in an import. Other handlers than Python's own, and
    `terminate`, are left alone.
    """
    pressed: list[int] = []
    here = threading.current_thread() is threading.main_thread()
    known = signal.default_int_handler, signal.SIG_DFL, terminate
    found = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM) if here}
    own = {number: handler for number, handler in found.items() if handler in known}

    def give_back(*press: Any) -> None:
        pressed.extend(press[:1])
        for number, handler in own.items():
            signal.signal(number, handler)

    def check() -> None:
        if pressed:
            (terminate if pressed[0] == signal.SIGTERM else signal.default_int_handler)(pressed[0], None)

    for number in own:
        signal.signal(number, give_back)
    try:
        yield check
    except Exception:
        check()
        raise
    finally:
        give_back()
    check()


COMPLETE, FAULT, MISTAKE, INCOMPLETE, CELLS_FAILED, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 4, 130, 143
EXIT_CODES = {
    COMPLETE: "complete",
    FAULT: "a fault in foliot",
    MISTAKE: "a mistake in the study or command, or too little disk space or memory",
    INCOMPLETE: "not complete (--until, lost cluster, output); the same command continues",
    CELLS_FAILED: "complete, but some cells FAILED; sweep show names them",
    INTERRUPTED: "stopped by Ctrl-C; the same command continues",
    TERMINATED: "stopped by SIGTERM; the same command continues",
}
"""What the exit status of `sweep` means."""


@dataclass(frozen=True)
class Mistake:
    """One thing wrong in a study: where it stands, and what was found, what is allowed, what to do."""

    where: str
    message: str


class StudyError(SweepError):
    """All mistakes in a study, in one message.

    Examples
    --------
    >>> import sweep
    >>> try:
    ...     sweep.study(kernel="foliot", axes={"mu": ["1.0"]}, fixed={"phi0": 1.0, "a": 1.0})
    ... except sweep.StudyError as error:
    ...     print(error)
    study: 1 mistake
      axes.mu[0]  expected a number, found "1.0"; drop the quotes
    """

    def __init__(self, source: str, mistakes: Sequence[Mistake]) -> None:
        self.source, self.mistakes = source, tuple(mistakes)
        width = max(len(m.where) for m in mistakes)
        count = "1 mistake" if len(mistakes) == 1 else f"{len(mistakes)} mistakes"
        super().__init__(
            "\n".join([f"{source}: {count}", *(f"  {m.where:{width}}  {m.message}" for m in self.mistakes)])
        )
