"""Forecasts of runs on a simulated clock, with blocks that take what they are told to take."""

import heapq

import numpy as np
import pytest

from sweep.cells.partition import Partition
from sweep.cells.timing import Sample
from sweep.runs.loop import from_everywhere
from sweep.runs.progress import Progress

CELLS = 2**18


def flat(axis):
    """Where each cell lies on the first (0 to 1) or second axis of a grid of 512 by 512."""
    place = np.arange(CELLS) // 512 if axis == 0 else np.arange(CELLS) % 512
    return place / 511


def scattered(share, dear):
    """A share of the cells, anywhere, that is so many times as dear."""
    return np.where(np.random.default_rng(1).random(CELLS) < share, dear, 1.0)


COSTS = {
    "even": np.ones(CELLS),
    "dear last": 10.0 ** (3 * flat(0)),
    "dear first": 10.0 ** (-3 * flat(0)),
    "dear along the inner axis": 10.0 ** (3 * flat(1)),
    "dear in the middle": 1 + 200 * np.exp(-(((flat(0) - 0.43) / 0.05) ** 2)),
    "a narrow ridge": 1 + 100 * (abs(flat(0) - 0.7) < 0.02),
    "a border across": 1 + 100 * (abs(flat(0) - flat(1)) < 0.03),
    "two methods": np.where(flat(0) < 0.35, 1.0, 40.0),
    "few dear cells": scattered(0.001, 3000.0),
    "a quarter known": np.where(flat(0) < 0.25, 1e-3, 1.0),
    "every other known": np.where(np.arange(CELLS) // 512 % 2, 1e-3, 1.0),
    "in steps": 4.0 ** np.floor(6 * flat(0)),
}


class Run:
    """Workers that take blocks in the forecast's order; probes of 16 cells at 64 places, each off by up to a half."""

    def __init__(self, costs, blocks, workers, waste=0.0, seed=0, slow=1.0):
        partition = Partition(CELLS, CELLS // blocks)
        edges = np.arange(partition.count + 1) * partition.cells
        self.costs = np.add.reduceat(costs, edges[:-1]) + waste
        places = (2 * np.arange(64) + 1) * CELLS // 128
        noise = np.random.default_rng(seed).uniform(0.5, 1.5, 64)
        probed = noise * [costs[p : p + 16].mean() for p in places]
        self.weights = Sample(places, probed).weights(partition, lambda cells: cells)
        self.now, self.workers, self.slow = 0.0, workers, slow
        work = float(self.weights.sum())
        self.progress = Progress(partition.count, False, work=work, clock=lambda: self.now)
        self.progress.crew = workers

    def ends(self):
        """The number of blocks that are done, each time it grows."""
        queue, busy = from_everywhere(range(len(self.costs))), []
        for count in range(1, len(self.costs) + 1):
            while queue and len(busy) < self.workers:
                job = queue.pop(0)
                seconds = self.costs[job] * (self.slow if count <= 1 else 1.0)
                heapq.heappush(busy, (self.now + seconds, job, seconds))
            self.now, job, seconds = heapq.heappop(busy)
            self.progress.add(1, self.weights[job], seconds)
            yield count

    def forecasts(self):
        """Share of the blocks that are done, the time, and how much is forecast to be left, after each block."""
        return [(done / len(self.costs), self.now, self.progress.left) for done in self.ends()]


@pytest.mark.parametrize("workers", [1, 8])
@pytest.mark.parametrize(("name", "slow"), [*((name, 1.0) for name in COSTS), ("even", 10.0), ("two methods", 10.0)])
def test_from_a_tenth_on_the_time_left_is_within_a_factor_of_two(name, slow, workers):
    """Also where the first block takes ten times as long as it would later, as where kernels are still loaded."""
    told = Run(COSTS[name], 512, workers, seed=workers, slow=slow).forecasts()
    end = told[-1][1]
    for least in (0.10, 0.25, 0.50, 0.75):
        share, now, left = next(row for row in told if row[0] >= least)
        assert 0.5 * (end - now) - 0.03 * end <= left <= 2.0 * (end - now) + 0.03 * end, (share, left, end - now)


def test_a_block_that_takes_far_longer_than_thought_is_not_done_at_any_moment():
    """The last one of a hundred takes a minute, not the second that the others did: it was never 0 s to its end."""
    now = 0.0
    progress = Progress(100, False, work=100.0, clock=lambda: now)
    for _ in range(99):
        now += 1.0
        progress.add(1, 1.0, 1.0)
    before = progress.left
    now += 0.2
    assert progress.left == pytest.approx(before - 0.2, rel=0.05)
    for waited in (2.0, 10.0, 30.0, 50.0):
        now = 99.0 + waited
        assert progress.left > 0.5 * min(waited, 60.0 - waited)
