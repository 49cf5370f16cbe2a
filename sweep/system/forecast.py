"""Which block is computed next, and how long those to come will take, from what those that are done took.

The timed sample of the grid tells a first guess of every block's seconds. Blocks from all over the grid come first;
by what each took, the guesses around it are corrected. Then dear blocks come first, lest a worker be left alone with
one at the end, and now and then one from anywhere, so that cheap ones are known as well.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

GOLDEN = 0.6180339887498949
"""Multiples of it, modulo 1, fill an interval evenly and fall into step with the length of no axis."""
LEAD = 16
"""One block of so many is computed in the lead,"""
LEAST_LEAD = 8
"""or so many blocks, where that is more,"""
MOST_LEAD = 4
"""but no more than one of so many."""
ANYWHERE = 4
"""After the lead, one block of so many is not chosen by what it takes."""
AGAIN = 32
"""At least one of so many is chosen before all are looked at again."""
EVEN = 1.5
"""Blocks of which the dearest is not so many times the median come in no order of cost."""
ALIKE = 6
"""Blocks on either side, in the order of what was thought, whose error tells that of a block."""
FEW = 16
"""Of so many measured blocks, how far each was off its guess counts half for those around it."""
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
        self._begun, self._seconds = np.full((2, self._weights.size), np.nan)
        self._left = np.zeros(self._weights.size, bool)
        self._left[np.fromiter(jobs, np.intp)] = True
        self._start: float | None = None
        self._thought = self._weights
        self._first_end = math.inf
        self._away = 0.0

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
        self._first_end = min(self._first_end, now)
        self._seconds[job] = max(seconds, SHORTEST)
        self._left[job] = False

    def again(self, job: int) -> None:
        """A block has to be computed once more."""
        self._begun[job], self._left[job] = np.nan, True

    @property
    def blocks(self) -> int:
        """How many are left."""
        return int(self._left.sum())

    def seconds(self, job: int) -> float:
        """What a block was thought to take when `order` looked last."""
        return float(self._thought[job])

    @property
    def left(self) -> float | None:
        """Seconds until all blocks are done, None before the first one is."""
        measured, left, now = self._measured(), np.flatnonzero(self._left), self._clock()
        if self._start is None or not measured.size:
            return None
        if not left.size:
            return 0.0
        running = np.maximum(np.nan_to_num(now - self._begun[left]), 0.0)
        expected = self._expected(self._settled(measured))[left]
        # one that has taken longer than that takes as long again: what it was thought to take says nothing any more
        to_come = np.where(running < expected, expected - running, running)
        return max(float(to_come.sum() / self._cores(measured, running, now)), float(to_come.max()))

    def _cores(self, measured: Any, running: Any, now: float) -> float:
        """How many blocks are worked on at once."""
        assert self._start is not None
        # elsewhere all but the one that came last have half of a block done, of which nothing is told
        untold = 0.5 * self._away
        done = self._seconds[measured].sum() + running.sum() - untold
        return float(max(done, SHORTEST) / max(now - self._start - untold, SHORTEST))

    def order(self) -> Iterator[int]:
        """The blocks to compute, each chosen when it is asked for."""
        self._start = self._clock() if self._start is None else self._start
        jobs = np.flatnonzero(self._left)
        count = jobs.size
        anywhere = jobs[np.argsort(np.arange(count) * GOLDEN % 1.0)]
        lead = max(count // LEAD, min(LEAST_LEAD, count // MOST_LEAD))
        yield from map(int, anywhere[:lead])
        waiting = anywhere[lead:]
        while waiting.size:
            dear = self._dear_first(waiting)
            some = max(LEAST_LEAD, self._measured().size // 4, waiting.size // AGAIN)
            chosen = list(dict.fromkeys(map(int, [*waiting[: some // ANYWHERE], *dear[:some]])))[:some]
            yield from chosen
            waiting = waiting[~np.isin(waiting, chosen)]

    def _measured(self) -> Any:
        """Numbers of the blocks of which it is known what they took."""
        return np.flatnonzero(~np.isnan(self._seconds))

    def _settled(self, measured: Any) -> Any:
        """Those of the measured blocks that tell of others: a worker's first one is left out, in which it loads."""
        later = measured[self._begun[measured] >= self._first_end]
        return later if later.size >= ENOUGH else measured

    def _dear_first(self, jobs: Any) -> Any:
        """Sorted by powers of two of what they will take; as they are where all take about as long."""
        self._thought = self._expected(self._settled(self._measured()))
        seconds = self._thought[jobs]
        if seconds.max() < EVEN * np.median(seconds):
            return jobs
        return jobs[np.argsort(-np.round(np.log2(seconds)), kind="stable")]

    def _expected(self, measured: Any) -> Any:
        """Seconds of every block."""
        if not measured.size:
            return self._weights
        thought = self._weights * np.interp(np.arange(self._weights.size), measured, self._ratios(measured))
        if measured.size < LEAST_LEAD:
            return thought
        return thought * self._error(measured, thought)

    def _without(self, measured: Any, ratios: Any) -> Any:
        """What measured blocks would be thought to take by their neighbours alone."""
        return self._weights[measured] * _between(measured, ratios)

    def _ratios(self, measured: Any) -> Any:
        """How many times its guess each measured block took; of few, rather as many times as all together."""
        seconds, weights = self._seconds[measured], self._weights[measured]
        own = measured.size / (measured.size + FEW)
        return own * seconds / weights + (1 - own) * seconds.sum() / weights.sum()

    def _error(self, measured: Any, thought: Any) -> Any:
        """How many times what is thought blocks take: as measured ones, if they were thought of by their neighbours."""
        without = self._without(measured, self._ratios(measured))
        rank = np.argsort(without)
        sums = np.cumsum(np.vstack([np.zeros(2), np.stack([self._seconds[measured], without], axis=1)[rank]]), axis=0)
        middle = np.searchsorted(without[rank], thought)
        low = np.clip(middle - ALIKE, 0, max(0, rank.size - 2 * ALIKE))
        high = np.minimum(low + 2 * ALIKE, rank.size)
        took, guessed = (sums[high] - sums[low]).T
        return took / guessed


def _between(places: Any, values: Any) -> Any:
    """What each of the values would be taken for, from those on both sides of it."""
    share = (places[1:-1] - places[:-2]) / (places[2:] - places[:-2])
    inside = values[:-2] + share * (values[2:] - values[:-2])
    return np.concatenate([values[1:2], inside, values[-2:-1]])
