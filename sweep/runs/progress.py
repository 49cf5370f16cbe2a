"""How far a run has come and how long it will take: a bar on a terminal or in a notebook, plain lines in a log.

The time left comes from the blocks that are done. They are taken from all over the grid at any time, so they stand for
those to come; the timed sample of the grid tells by how much these are dearer or cheaper.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterable
from typing import Any, TextIO

import numpy as np

from sweep.runs.log import log
from sweep.words import SHORTEST, duration, one_digit, printable, speed

QUIET_SECONDS = 1.0
"""A run that ends sooner says nothing."""
REDRAW_SECONDS, LINE_SECONDS, LOG_SECONDS = 0.1, 30.0, 60.0
"""How often a bar is drawn, a line is told elsewhere, and one is logged;"""
LINE_SHARE = 0.05
"""lines also whenever so much more is done, but not more often than every few seconds."""
GOLDEN = 0.6180339887498949
"""Multiples of it, modulo 1, fill an interval evenly and fall into step with the length of no axis."""
ROUNDS = 3
"""Blocks each core has done when its first one, in which kernels are loaded, need not count any more."""

Clock = Callable[[], float]


def from_everywhere(jobs: Iterable[int]) -> list[int]:
    """Numbers of blocks in an order in which those of any beginning come from all over the grid."""
    found = np.array(list(jobs), int)
    return list(map(int, found[np.argsort(np.arange(found.size) * GOLDEN % 1.0)]))


class Forecast:
    """What the blocks to come will take.

    Parameters
    ----------
    weights : ndarray
        Seconds of every block of the grid, as the timed sample has them.
    jobs : iterable of int
        Blocks that are to be computed.
    cores : int
        Blocks that are computed at a time.
    clock : callable
        Seconds.
    """

    def __init__(self, weights: Any, jobs: Iterable[int], cores: int = 1, clock: Clock = time.monotonic) -> None:
        self.weights, self._cores, self._clock = np.maximum(weights, 1e-9), max(1, cores), clock
        self._to_do = float(self.weights[list(jobs)].sum())
        self._running: dict[int, float] = {}
        self._number = 0
        self._now = clock(), 0.0, 0.0
        """When a block ended last, the weights of all that are done, and their seconds;"""
        self._first = self._since = self._now
        """the same at the end of the first round, and where what is measured begins."""

    def begin(self, jobs: Iterable[int]) -> None:
        """Cores have begun with some blocks, now or before."""
        for job in jobs:
            self._running.setdefault(job, self._clock())

    def end(self, job: int) -> None:
        """A block is done."""
        weight, now, (_, done, seconds) = float(self.weights[job]), self._clock(), self._now
        self._to_do -= weight
        self._now = now, done + weight, seconds + now - self._running.pop(job, now)
        self._number += 1
        if self._number == self._cores:
            self._first = self._now
        if self._number == ROUNDS * self._cores:
            self._since = self._first

    def again(self, job: int) -> None:
        """A block has to be computed once more."""
        self._to_do += self.weights[job]

    @property
    def left(self) -> float | None:
        """Seconds until all blocks are done, None before the first one is."""
        if not self._number or (self._to_do < 1e-9 and not self._running):
            return 0.0 if self._number else None
        done, spent = self._now[1] - self._since[1], max(self._now[2] - self._since[2], 1e-9)
        elapsed = max(self._clock() - self._since[0], 1e-9)
        pace = min(done / spent, done / elapsed)  # of one core, which is not faster than all are
        tasks = self.weights[list(self._running)]
        reached = pace * (self._clock() - np.array(list(self._running.values())))
        rate = (done + np.minimum(reached, tasks).sum()) / elapsed
        # one that has taken longer than it should takes as long again: what it should take says nothing any more
        to_come = np.where(reached < tasks, tasks - reached, reached)
        total = max(self._to_do - tasks.sum(), 0.0) + to_come.sum()
        return float(max(total / rate, max(to_come, default=0.0) / pace))


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
        clock: Clock = time.monotonic,
    ) -> None:
        self.total, self.done, self.computed = total, done, 0
        self._stream, self._name, self._clock, self._forecast = stream, printable(name), clock, forecast
        self._bar: Any = None
        self._live = stream is not None and (stream.isatty() or (stream is sys.stderr and _in_notebook()))
        self._begun = self._logged = clock()
        self._told: float | None = None
        self._told_share = 0.0

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return self._clock() - self._begun

    @property
    def rate(self) -> float:
        """Cells per second computed here."""
        return self.computed / max(self.seconds, 1e-9)

    @property
    def left(self) -> float | None:
        """Seconds that are left; None where nothing is known yet."""
        cells = self.total - self.done
        if self._forecast is not None:
            left = self._forecast.left
        else:
            left = self.seconds * cells / self.computed if self.computed else None
        return max(left, SHORTEST) if left is not None and cells else left

    def add(self, cells: int) -> None:
        """Counts cells as done; as many less than none have to be computed once more."""
        self.done += cells
        self.computed += max(cells, 0)
        self.tick()

    def tick(self) -> None:
        """Says something if it is time to."""
        now = self._clock()
        if now - self._logged >= LOG_SECONDS:
            self._logged = now
            log(self.line(), "progress", **self._fields())
        if self._stream is None or self.seconds < QUIET_SECONDS:
            return
        quiet = float("inf") if self._told is None else now - self._told
        more = not self._live and self.done / max(self.total, 1) - self._told_share >= LINE_SHARE
        if quiet >= (REDRAW_SECONDS if self._live else LINE_SECONDS / 6 if more else LINE_SECONDS):
            self._say(self.line())

    def note(self, text: str) -> None:
        """Says something out of turn."""
        log(text)
        self.tell(text)

    def tell(self, text: str) -> None:
        """The same, but not in the log."""
        line = f"{self._name}: {text}"
        if self._bar is not None:
            self._bar.clear()
        self._write((line if self._live else f"{time.strftime('%Y-%m-%d %H:%M:%S')}  {line}") + "\n")

    def end(self) -> None:
        """Says how it ended, where anything was said before."""
        text = f"{self._counts()}, {speed(self.rate)}, took {duration(self.seconds)}"
        log(text, "progress", **self._fields(), seconds=round(self.seconds, 1))
        if self._told is not None:
            self._say(text)
        self.stop()

    def stop(self) -> None:
        """Leaves the bar as it is and begins a new line."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def line(self) -> str:
        """What is told now: `12,300/1,000,000 cells (1.2 %), 5,100 cells/s, 3 min left`."""
        left = self.left
        return self._counts() + ("" if left is None else f", {speed(self.rate)}, {one_digit(left)} left")

    def _fields(self) -> dict[str, Any]:
        left, rate = self.left, round(self.rate, 3)
        left = None if left is None else round(left, 1)
        return {"cells": self.done, "of": self.total, "cells_per_second": rate, "seconds_left": left}

    def _counts(self) -> str:
        share = 100 * self.done / self.total if self.total else 100.0
        # 100 % only when all is done
        shown = f"{min(share, 99.9):.1f}" if self.done < self.total else "100"
        return f"{self.done:,}/{self.total:,} cells ({shown} %)"

    def _say(self, text: str) -> None:
        self._told, self._told_share = self._clock(), self.done / max(self.total, 1)
        if not self._live:
            self.tell(text)
            return
        if self._bar is None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of a notebook without widgets, which gets a bar of text
                from tqdm.auto import tqdm
            form = "{percentage:3.0f} %|{bar:20}| {desc}"
            self._bar = tqdm(total=self.total, initial=self.done, file=self._stream, bar_format=form)
        self._bar.n = self.done
        self._bar.set_description_str(f"{self._name}: {text}")

    def _write(self, text: str) -> None:
        """Tells; a reader who has gone, or a full disk behind the log, does not stop the run."""
        if self._stream is None:
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):
            self._stream = None


def _in_notebook() -> bool:
    """Whether this runs in the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ == "ZMQInteractiveShell"


def stream_of(progress: bool | TextIO | None) -> TextIO | None:
    """Where to tell: None or True is stderr, False nowhere."""
    if progress is None or progress is True:
        return sys.stderr
    return None if progress is False else progress
