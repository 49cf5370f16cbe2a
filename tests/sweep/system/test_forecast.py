"""Forecasts of runs on a simulated clock, with blocks that take what they are told to take."""

import heapq
from itertools import islice

import numpy as np
import pytest

from sweep.cells.partition import Partition
from sweep.cells.timing import Sample
from sweep.system.forecast import Forecast

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
    """Workers that take blocks in the forecast's order; probes of 32 cells at 64 places, each off by up to a half."""

    def __init__(self, costs, blocks, workers, waste=0.0, seed=0, slow=1.0):
        partition = Partition(CELLS, CELLS // blocks)
        edges = np.arange(partition.count + 1) * partition.cells
        self.costs = np.add.reduceat(costs, edges[:-1]) + waste
        places = (2 * np.arange(64) + 1) * CELLS // 128
        noise = np.random.default_rng(seed).uniform(0.5, 1.5, 64)
        probed = noise * [costs[p : p + 32].mean() for p in places]
        self.weights = Sample(places, probed, 32, np.zeros(1), np.zeros(1)).weights(partition)
        self.now, self.workers, self.slow = 0.0, workers, slow
        self.forecast = Forecast(self.weights, range(partition.count), lambda: self.now)

    def ends(self, blocks=None):
        """The number of blocks that are done, each time it grows; as the pool does, blocks are taken ahead of time."""
        jobs, busy = self.forecast.order(), []
        queue = list(islice(jobs, 4 * self.workers))
        for count in range(1, (blocks or len(self.costs)) + 1):
            while queue and len(busy) < self.workers:
                job = queue.pop(0)
                self.forecast.begin(job)
                slow = self.slow if count <= 1 else 1.0
                heapq.heappush(busy, (self.now + slow * self.costs[job], job))
            self.now, job = heapq.heappop(busy)
            self.forecast.end(job)
            queue += islice(jobs, 1)
            yield count

    def forecasts(self, blocks=None):
        """Share of the blocks that are done, the time, and how much is forecast to be left, after each block."""
        count = blocks or len(self.costs)
        return [(done / count, self.now, self.forecast.left) for done in self.ends(blocks)]


NOISE = ("few dear cells", "every other known")
"""Blocks that tell nothing of their neighbours."""


@pytest.mark.parametrize("workers", [1, 8])
@pytest.mark.parametrize(("name", "slow"), [*((name, 1.0) for name in COSTS), ("even", 10.0), ("two methods", 10.0)])
def test_from_a_tenth_on_the_time_left_is_within_30_percent(name, slow, workers):
    """Also where the first block takes ten times as long as it would later, as where kernels are still loaded."""
    told = Run(COSTS[name], 512, workers, seed=workers, slow=slow).forecasts()
    end, off = told[-1][1], 0.6 if name in NOISE else 0.3
    for least in (0.10, 0.25, 0.50):
        share, now, left = next(row for row in told if row[0] >= least)
        assert left >= (1 - off) * (end - now) - 0.03 * end, (share, left, end - now)
        assert left <= max((1 + off) * (end - now), end - now + 0.2 * end), (share, left, end - now)


def stored(costs, seed):
    """Two cores compute a block in a tenth of the time that the one disk takes to write it; four threads."""
    now, disk, count, threads = 0.0, 0.0, 400, 4
    forecast = Forecast(np.ones(count), range(count), lambda: now)
    jobs, ends, told = forecast.order(), [], []
    for done in range(1 - threads, count + 1):
        if done > 0:
            now, job = heapq.heappop(ends)
            forecast.end(job)
            told.append((done / count, now, forecast.left))
        if (job := next(jobs, None)) is not None:
            forecast.begin(job)
            disk = max(disk, now + 0.1) + 1.0
            heapq.heappush(ends, (disk, job))
    return told


def clustered(costs, seed, workers=4, start=5.0, overhead=0.02):
    """Workers that load for seconds, then take batches of half a second and give back all of one at once."""
    rng, blocks = np.random.default_rng(seed), 800
    costs = np.add.reduceat(costs, np.arange(blocks) * (CELLS // blocks))[:blocks]
    costs = 60.0 * costs / costs.sum()
    now, told, done, busy, batches = 0.0, [], 0, [], 0
    forecast = Forecast(costs * rng.uniform(0.8, 1.25, blocks), range(blocks), lambda: now)
    jobs = forecast.order()

    def taken():
        batch, seconds = [], 0.0
        for job in islice(jobs, max(1, min(1 + batches, (blocks - done) // (2 * workers)))):
            batch.append(job)
            seconds += forecast.seconds(job)
            if seconds > 0.5:
                break
        return batch

    queue = [taken() for _ in range(2 + workers)]
    for worker in range(workers):
        batch = queue.pop(0)
        heapq.heappush(busy, (start + costs[batch].sum() + overhead, worker, batch))
    while busy:
        now, worker, batch = heapq.heappop(busy)
        for job in batch:
            forecast.end(job, costs[job], costs[batch].sum())
        done, batches = done + len(batch), batches + 1
        told.append((done / blocks, now, forecast.left))
        queue += [found] if (found := taken()) else []
        if queue:
            batch = queue.pop(0)
            heapq.heappush(busy, (now + costs[batch].sum() + overhead, worker, batch))
    assert done == blocks
    return told


def known(costs, seed):
    """A third of the cells is read, not computed, and the forecast is told which."""
    third = flat(0) < 1 / 3
    run = Run(np.where(third, 0.01 * costs, costs), 400, 2, seed=seed)
    probed = Run(costs, 400, 2, seed=seed).weights
    edges = np.arange(0, CELLS + 1, CELLS // 400)
    share = np.add.reduceat(third.astype(float), edges[: probed.size]) / (CELLS // 400)
    run.forecast = Forecast(probed * (1 - 0.95 * share), range(probed.size), lambda: run.now)
    return run.forecasts()


def continued(costs, seed):
    """A third of the blocks, from all over the grid, is done before."""
    run = Run(costs, 400, 2, seed=seed)
    left = np.flatnonzero(np.random.default_rng(seed).random(run.weights.size) > 1 / 3)
    run.forecast = Forecast(run.weights, left, lambda: run.now)
    return run.forecasts(len(left))


MIXED = np.array([1.0, 20.0, 400.0])[np.minimum(3 * flat(0), 2).astype(int)]
RARE = np.where(flat(0) < 62 / 64, 1.0, 60.0)
UNEVEN = 1 + 20 * flat(0) ** 3
KINDS = {
    "even": lambda seed: Run(COSTS["even"], 400, 2, seed=seed).forecasts(),
    "dear last": lambda seed: Run(COSTS["dear last"], 400, 2, seed=seed).forecasts(),
    "mixed methods": lambda seed: Run(MIXED, 400, 2, seed=seed).forecasts(),
    "few dear": lambda seed: Run(RARE, 400, 2, seed=seed).forecasts(),
    "storage-bound": lambda seed: stored(COSTS["even"], seed),
    "summary": lambda seed: Run(UNEVEN, 1024, 2, seed=seed).forecasts(),
    "own scene": lambda seed: Run(UNEVEN, 400, 2, seed=seed, slow=30.0).forecasts(),
    "cluster": lambda seed: clustered(UNEVEN, seed),
    "continued": lambda seed: continued(UNEVEN, seed),
    "extended": lambda seed: known(UNEVEN, seed),
}


@pytest.mark.parametrize("kind", KINDS)
def test_ten_kinds_of_grids_are_forecast_within_30_percent_from_a_tenth_on(kind):
    """At every block that ends, until a twentieth of the run is left; and nine in ten are not too short."""
    ratios = []
    for seed in range(4):
        told = KINDS[kind](seed)
        end = told[-1][1]
        ratios += [left / (end - now) for share, now, left in told if share >= 0.1 and end - now > 0.05 * end]
    assert np.mean(np.abs(np.array(ratios) - 1) > 0.3) < 0.02, (min(ratios), max(ratios))
    assert np.mean(np.array(ratios) < 0.9) < 0.1


def test_every_block_comes_once_also_one_that_comes_again():
    run = Run(COSTS["dear last"], 100, 3)
    assert len(list(run.ends())) == len(run.costs)
    assert (run.forecast.left, run.forecast.blocks) == (0.0, 0)
    run.forecast.again(2)
    assert run.forecast.left > 0
    assert list(run.forecast.order()) == [2]


def test_dear_blocks_come_first_once_some_from_all_over_are_known():
    forecast = Forecast(np.geomspace(1.0, 1e3, 64), range(64))
    first = list(forecast.order())
    assert sorted(first) == list(range(64))
    assert np.mean(first[8:24]) > 48
    assert np.mean(first[-16:]) < 16


def test_what_was_measured_counts_and_not_what_was_thought():
    """The sample takes the second half for cheap; the lead finds that it is the dear one."""
    costs = np.repeat([1.0, 100.0], 256)
    forecast = Forecast(costs[::-1], range(512))
    jobs = forecast.order()
    for job in islice(jobs, 32):
        forecast.end(job, costs[job])
    assert np.mean(list(islice(jobs, 12))) > 200


def test_a_block_that_takes_far_longer_than_thought_is_not_done_at_any_moment():
    """The last one of a hundred takes a minute, not the second that the others did: it was never 0 s to its end."""
    now = 0.0
    forecast = Forecast(np.ones(100), range(100), lambda: now)
    for job in sorted(forecast.order())[:99]:
        forecast.begin(job)
        now += 1.0
        forecast.end(job)
    forecast.begin(99)
    before = forecast.left
    now += 0.75
    assert forecast.left == pytest.approx(before - 0.75)
    for waited in (2.0, 10.0, 30.0, 50.0):
        now = 99.0 + waited
        assert forecast.left > 0.5 * min(waited, 60.0 - waited)


def test_what_workers_elsewhere_have_half_done_counts():
    """Four of them, each of which has just given a block back or is on its way with one: 96 more take 192 seconds."""
    now, costs = 0.0, np.r_[2.0, 4.0, 6.0, np.full(97, 8.0)]
    forecast = Forecast(costs, range(100), lambda: now)
    for job in range(4):
        now = costs[job]
        forecast.end(job, costs[job])
    assert 192.0 <= forecast.left < 1.3 * 192.0


def test_what_the_disk_still_takes_is_waited_for():
    forecast = Forecast(np.ones(2), range(2), lambda: now)
    now, jobs = 0.0, forecast.order()
    for job in jobs:
        forecast.begin(job)
        now += 1.0
        forecast.end(job)
        forecast.ending = lambda: (0.0, 0.0)
        computing = forecast.left
        forecast.ending = lambda: (0.5, 0.5)
        assert forecast.left == computing + 0.5
    forecast.again(1)
    forecast.ending = lambda: (0.5, 60.0)
    assert forecast.left == 60.0
