"""How far a sweep has come, one line on a terminal and plain lines in a log; and when it is to stop (`--until`)."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from datetime import time as day_time
from typing import TYPE_CHECKING, Any, TextIO

from sweep.errors import SweepError
from sweep.runs.bar import notebook_bar
from sweep.runs.log import log
from sweep.words import SHORTEST, duration, one_digit, printable, speed

if TYPE_CHECKING:
    from sweep.runs.forecast import Forecast

QUIET_SECONDS = 1.0
"""A run that ends sooner says nothing."""
LINE_SECONDS = 30.0
LINE_SHARE = 0.05
REDRAW_SECONDS = 0.1
LOG_SECONDS = 60.0


class Progress:
    """Tells how many cells are done, how fast, and how long it will take.

    Parameters
    ----------
    total : int
        Cells of the grid.
    stream : text stream, optional
        None: say nothing.
    name : str
        Begins every line.
    done : int
        Cells that were there before.
    forecast : Forecast, optional
        Of the blocks to come; None: every cell takes as long.
    clock : callable
        Seconds.
    """

    def __init__(
        self,
        total: int,
        stream: TextIO | None,
        name: str = "sweep",
        done: int = 0,
        forecast: Forecast | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.total, self.done, self.computed = total, done, 0
        self._stream, self._name, self._clock = stream, printable(name), clock
        self._forecast = forecast
        self._bar = notebook_bar(stream, self._name, total, done)
        self._live = stream is not None and (stream.isatty() or self._bar is not None)
        self._pause = REDRAW_SECONDS if self._live else LINE_SECONDS
        self._begun = self._logged = clock()
        self._told: float | None = None
        self._told_share = 0.0
        self._width = 0

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return self._clock() - self._begun

    @property
    def rate(self) -> float:
        """Cells per second computed here."""
        return self.computed / max(self.seconds, 1e-9)

    def add(self, cells: int) -> None:
        """Counts cells as done."""
        self.done += cells
        self.computed += cells
        self.tick()

    def again(self, cells: int) -> None:
        """Takes back cells that have to be computed once more."""
        self.done -= cells

    @property
    def left(self) -> float | None:
        """Seconds that are left; None where nothing is known yet."""
        cells = self.total - self.done
        if self._forecast is not None:
            left = self._forecast.left
        else:
            left = self.seconds * cells / self.computed if self.computed else None
        return max(left, SHORTEST) if left is not None and cells else left

    def tick(self) -> None:
        """Says something if it is time to."""
        self._log_line(self.line)
        if self._stream is not None and self.seconds >= QUIET_SECONDS and self._due():
            self._say(self.line())

    def note(self, text: str) -> None:
        """Says something out of turn."""
        log(text)
        self.tell(text)

    def tell(self, text: str) -> None:
        """The same, but not in the log."""
        if self._stream is not None:
            if self._bar is not None:
                self._bar.note(f"{self._name}: {text}")
                return
            self._end_line()
            self._write(self._stamp() + f"{self._name}: {text}\n")

    def end(self) -> None:
        """Says how it ended, where anything was said before."""
        text = f"{self._counts()}, {speed(self.rate)}, took {duration(self.seconds)}"
        log(text, "progress", **self._fields(), seconds=round(self.seconds, 1))
        if self._told is not None:
            self._say(text)
        self._end_line()

    def stop(self) -> None:
        """Leaves the terminal's line, or the bar, as it is and begins a new one."""
        self._end_line()
        if self._bar is not None:
            self._bar.close()

    def line(self) -> str:
        """What is told now: `12,300/1,000,000 cells (1.2 %), 5,100 cells/s, 3 min left`."""
        left = self.left
        return self._counts() + ("" if left is None else f", {speed(self.rate)}, {one_digit(left)} left")

    def _fields(self) -> dict[str, Any]:
        left = self.left
        return {
            "cells": self.done,
            "of": self.total,
            "cells_per_second": round(self.rate, 3),
            "seconds_left": None if left is None else round(left, 1),
        }

    def _log_line(self, line: Callable[[], str]) -> None:
        """Logs how far it is, once a minute."""
        if self._clock() - self._logged >= LOG_SECONDS:
            self._logged = self._clock()
            log(line(), "progress", **self._fields())

    def _counts(self) -> str:
        share = 100 * self.done / self.total if self.total else 100.0
        # 100 % only when all is done
        shown = f"{min(share, 99.9):.1f}" if self.done < self.total else "100"
        return f"{self.done:,}/{self.total:,} cells ({shown} %)"

    def _due(self) -> bool:
        now = self._clock()
        if self._told is None:
            return True
        if self._live:
            return now - self._told >= self._pause
        share = self.done / max(self.total, 1)
        # lines by share no oftener than every few seconds, or a short run would be all lines
        by_share = share - self._told_share >= LINE_SHARE and now - self._told >= LINE_SECONDS / 6
        return now - self._told >= self._pause or by_share

    def _say(self, text: str) -> None:
        line = f"{self._name}: {text}"
        if self._bar is not None:
            self._bar.show(self.done, text)
        elif self._live:
            self._write("\r" + line.ljust(self._width))
            self._width = len(line)
        else:
            self._write(self._stamp() + line + "\n")
        self._told, self._told_share = self._clock(), self.done / max(self.total, 1)

    def _stamp(self) -> str:
        return "" if self._live else time.strftime("%Y-%m-%d %H:%M:%S  ")

    def _end_line(self) -> None:
        if self._live and self._width and self._stream is not None:
            self._write("\n")
            self._width = 0

    def _write(self, text: str) -> None:
        """Tells; a reader who has gone, or a full disk behind the log, does not stop the run."""
        if self._stream is None:
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):
            self._stream = None


def stream_of(progress: bool | TextIO | None) -> TextIO | None:
    """Where to tell: None or True is stderr, False nowhere."""
    if progress is None or progress is True:
        return sys.stderr
    return None if progress is False else progress


class TimeUp(Exception):
    """A run is to end before it is complete; the text says why."""


def deadline(text: str | datetime | None, now: datetime | None = None) -> datetime | None:
    """The time that is meant, with a time zone.

    Parameters
    ----------
    text : str, datetime or None
        "07:00" is the next time it is seven, here; "2027-01-31 07:00" is that moment.

    Raises
    ------
    SweepError
        It is no time.
    """
    if text is None:
        return None
    if isinstance(text, datetime):
        return text.astimezone()
    here = (now or datetime.now()).astimezone()
    try:
        clock = day_time.fromisoformat(text.strip())
    except (ValueError, AttributeError):
        return _moment(text)
    if clock.tzinfo is not None:
        here = here.astimezone(clock.tzinfo)
    at = datetime.combine(here.date(), clock).astimezone()
    # the next day by its date, for days of 23 and 25 hours
    return at if at > here else datetime.combine(here.date() + timedelta(days=1), clock).astimezone()


def _moment(text: object) -> datetime:
    try:
        if not isinstance(text, str):
            raise ValueError
        return datetime.fromisoformat(text.strip()).astimezone()
    except ValueError:
        raise SweepError(f'until: expected a time like "07:00" or "2027-01-31 07:00", found {text!r}') from None


def passed(until: datetime | None) -> bool:
    """Whether it is time to stop."""
    return until is not None and datetime.now().astimezone() >= until
