"""Which block is computed next, and how long those to come will take, from what those that are done took.

Blocks come from all over the grid at any time, so those that are done stand for those to come; the timed sample of the
grid tells by how much these are dearer or cheaper.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

GOLDEN = 0.6180339887498949
"""Multiples of it, modulo 1, fill an interval evenly and fall into step with the length of no axis."""
ENOUGH = 4
"""So many blocks that are no worker's first tell more than all together."""
SHORTEST = 1e-9
"""Seconds that a block takes at least."""


class Forecast:
    """What the blocks to come will take. Blocks may begin and end in any thread.

    Parameters
    ----------
    weights : ndarray
        Seconds of every block of the grid, as the timed sample has them.
    jobs : iterable of int
        Blocks that are to be computed.
    clock : callable
        Seconds.
    """

    def __init__(self, weights: Any, jobs: Iterable[int], clock: Callable[[], float] = time.monotonic) -> None:
        self._weights, self._clock = np.maximum(weights, SHORTEST), clock
        self._begun = np.full(self._weights.size, np.nan)
        self._left = np.zeros(self._weights.size, bool)
        self._left[np.fromiter(jobs, np.intp)] = True
        self._start: float | None = None
        self._first_end, self._away = math.inf, 0.0
        self._all, self._later = np.zeros((2, 3))
        """Number, seconds and weights of the blocks that are done, and of those that are no worker's first."""
        self._turn = threading.Lock()

    def order(self) -> Iterator[int]:
        """The blocks to compute, from all over the grid."""
        self._start = self._clock() if self._start is None else self._start
        jobs = np.flatnonzero(self._left)
        yield from map(int, jobs[np.argsort(np.arange(jobs.size) * GOLDEN % 1.0)])

    def begin(self, job: int) -> None:
        """A core has begun with a block."""
        self._begun[job] = self._clock()

    def end(self, job: int, seconds: float | None = None, ago: float = 0.0) -> None:
        """A block is done; it took so long, by default since it was begun.

        Elsewhere, it was begun so many seconds `ago`, with those that came together with it. Cores are at work only
        shortly before the first block comes back: until then they load and compile.
        """
        now = self._clock()
        if seconds is None:
            seconds = now - self._begun[job]
        else:
            self._begun[job] = now - max(ago, seconds)
            self._start = self._start if self._away else self._begun[job]
            self._away = max(ago, seconds) or self._away
        with self._turn:
            self._first_end = min(self._first_end, now)
            row = np.array([1.0, max(seconds, SHORTEST), self._weights[job]])
            self._all += row
            if self._begun[job] >= self._first_end:
                self._later += row
            self._left[job] = False

    def again(self, job: int) -> None:
        """A block has to be computed once more."""
        self._begun[job], self._left[job] = np.nan, True

    @property
    def blocks(self) -> int:
        """How many are left."""
        return int(self._left.sum())

    def seconds(self, job: int) -> float:
        """What a block is thought to take."""
        return float(self._weights[job] * self._measure())

    @property
    def left(self) -> float | None:
        """Seconds until all blocks are done, None before the first one is."""
        left, now = np.flatnonzero(self._left), self._clock()
        if self._start is None or not self._all[0]:
            return None
        if not left.size:
            return 0.0
        running = np.maximum(np.nan_to_num(now - self._begun[left]), 0.0)
        expected = self._weights[left] * self._measure()
        # one that has taken longer than that takes as long again: what it was thought to take says nothing any more
        to_come = np.where(running < expected, expected - running, running)
        # elsewhere all but the one that came last have half of a block done, of which nothing is told
        untold = 0.5 * self._away
        done = self._all[1] + running.sum() - untold
        cores = max(done, SHORTEST) / max(now - self._start - untold, SHORTEST)
        return max(float(to_come.sum() / cores), float(to_come.max()))

    def _measure(self) -> float:
        """How many times what the sample says blocks take; a worker's first one, in which it loads, tells little."""
        number, seconds, weights = self._later if self._later[0] >= ENOUGH else self._all
        return float(seconds / weights) if number else 1.0
