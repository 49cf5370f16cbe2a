"""How a run ends early: by Ctrl-C, SIGTERM, or the time that is up; and the cores that it may use."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta
from datetime import time as day_time
from typing import Any

import numpy as np

from sweep.errors import SweepError


class TimeUp(Exception):
    """A run is to end before it is complete; the text says why."""


class Terminated(SystemExit):
    """The system, or somebody, asked this process to end (SIGTERM); it does, with the usual exit status 143."""

    def __init__(self) -> None:
        super().__init__(128 + signal.SIGTERM)


@contextlib.contextmanager
def signals_held() -> Iterator[Callable[[], None]]:
    """Holds Ctrl-C and SIGTERM back, for Python's locks are left in disorder where they strike in them.

    What it gives raises KeyboardInterrupt or Terminated after one of them, and is called at the end. The second one
    strikes at once. Other handlers than Python's own are left alone.
    """
    pressed: list[int] = []
    here = threading.current_thread() is threading.main_thread()
    python: dict[int, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    own = {number: handler for number, handler in python.items() if here and signal.getsignal(number) is handler}

    def give_back(*press: Any) -> None:
        pressed.extend(press[:1])
        for number, handler in own.items():
            signal.signal(number, handler)

    def check() -> None:
        if pressed:
            raise Terminated if pressed[0] == signal.SIGTERM else KeyboardInterrupt

    for number in own:
        signal.signal(number, give_back)
    try:
        yield check
    finally:
        give_back()
    check()


endless = threading.Event()
"""Set where a thread was given up whose kernel does not end: Python would wait for it when the program ends."""


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def whole_number(name: str, number: int) -> int:
    """The number, if it is a whole one from 1 on. Raises SweepError."""
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < 1:
        raise SweepError(f"{name}: expected a whole number from 1 on, found {number!r}")
    return int(number)


def deadline(text: str | datetime | None, now: datetime | None = None) -> datetime | None:
    """The time that is meant, with a time zone: "07:00" is the next time it is seven, here. Raises SweepError."""
    if text is None or isinstance(text, datetime):
        return text and text.astimezone()
    here = (now or datetime.now()).astimezone()
    try:
        clock = day_time.fromisoformat(text.strip())
    except (ValueError, AttributeError):
        try:
            return datetime.fromisoformat(str(text).strip()).astimezone()
        except ValueError:
            raise SweepError(f'until: expected a time like "07:00" or "2027-01-31 07:00", found {text!r}') from None
    if clock.tzinfo is not None:
        here = here.astimezone(clock.tzinfo)
    days = (here.date(), here.date() + timedelta(days=1))  # by their dates, for days of 23 and 25 hours
    today, tomorrow = (datetime.combine(day, clock).astimezone() for day in days)
    return today if today > here else tomorrow


def passed(until: datetime | None) -> bool:
    """Whether it is time to stop."""
    return until is not None and datetime.now().astimezone() >= until
