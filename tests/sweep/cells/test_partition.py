from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sweep.cells.partition import Partition, boxes
from sweep.cells.schema import Column
from sweep.cells.timing import BLOCK_BYTES, LANES, MOST_BLOCKS, Sample, partition, take_sample

COLUMNS = tuple(Column(name, "i1", (), (), {}) for name in ("status", "method_used"))


def sample(costs, size, cells=LANES):
    costs = np.atleast_1d(np.asarray(costs, float))
    places = (np.arange(len(costs)) + 0.5) * size / len(costs)
    return Sample(places, costs, cells, np.zeros(1, "i1"), np.zeros(1, "i1"))


@given(size=st.integers(1, 10**12), cells=st.integers(1, 10**9))
def test_blocks_cover_the_grid_without_gap_or_overlap(size, cells):
    blocks = Partition(size, cells)
    for index in {0, min(1, blocks.count - 1), blocks.count // 2, max(blocks.count - 2, 0), blocks.count - 1}:
        start, stop = blocks.bounds(index)
        assert 0 < stop - start <= cells
        assert start == (0 if index == 0 else blocks.bounds(index - 1)[1])
    assert blocks.bounds(blocks.count - 1)[1] == size


@given(
    cost=st.floats(1e-10, 1e3),
    size=st.integers(1, 10**11),
    cell_bytes=st.integers(10, 10**5),
    workers=st.integers(1, 64),
)
@example(cost=1e-3, size=51, cell_bytes=10, workers=1)
def test_blocks_keep_their_bounds_in_time_bytes_and_number(cost, size, cell_bytes, workers):
    blocks = partition(sample(cost, size), size, cell_bytes, workers)
    assert 1 <= blocks.cells <= size
    assert blocks.count <= MOST_BLOCKS
    if blocks.cells > max(LANES, 1.001 * size / MOST_BLOCKS + LANES):
        assert (blocks.cells - LANES) * cell_bytes <= BLOCK_BYTES
        assert (blocks.cells - LANES) * cost <= 1.0001


def test_a_long_run_has_blocks_of_a_second():
    # 10^9 cells of 1 us on 2 cores: a 400th of 1000 s would be 2.5 s
    blocks = partition(sample(1e-6, 10**9), 10**9, 1, 2)
    assert blocks.cells == pytest.approx(10**6, rel=1e-3)


def test_a_tiny_run_is_one_block():
    assert partition(sample(1e-6, 5000), 5000, 42, 2).count == 1


def test_a_cell_that_takes_long_is_a_block_of_its_own():
    assert partition(sample(3.0, 1000), 1000, 42, 2).cells == 1


def test_a_dear_single_cell_is_taken_for_one_of_thirty_two_lanes():
    """One cell costs a lane kernel as much as 32; blocks of one cell would cost 32 times too much."""
    assert partition(sample(3.0, 10**5, cells=1), 10**5, 42, 2).cells == LANES
    assert partition(sample(3.0, 80, cells=1), 80, 42, 2).cells == 10


@pytest.mark.parametrize("length", range(2, 40))
def test_boxes_waste_a_tenth_at_most_whatever_is_wanted(length):
    for wanted in range(1, length + 1):
        cells = boxes((length,), wanted).cells
        assert -(-length // cells) * cells <= 1.1 * length


def test_short_boxes_fill_whole_lanes():
    assert boxes((10_007,), 100, 32).cells == 96
    assert boxes((10_007,), 100, 1).cells == 100
    assert boxes((10_000, 3), 100, 32).cells == 96


def test_the_last_block_weighs_less_for_it_is_shorter():
    weights = sample(2.0, 25).weights(Partition(25, 10))
    assert weights.tolist() == [20.0, 20.0, 10.0]


class Uneven:
    """A solver whose cells cost as it is told, on a clock of its own."""

    def __init__(self, seconds, monkeypatch):
        self.seconds, self.ranges, self.now = seconds, [], 0.0
        monkeypatch.setattr("sweep.cells.timing.time", SimpleNamespace(perf_counter=lambda: self.now))

    def solve(self, start, cells):
        stop = start + cells.number
        assert 0 <= start < stop
        self.ranges.append((start, stop))
        cells.status[:], cells.used[:] = 0, 1
        self.now += sum(self.seconds(k) for k in range(start, stop))


def test_a_sample_finds_mean_and_slope_of_the_cost(monkeypatch):
    solver = Uneven(lambda k: 3.2e-11 * k, monkeypatch)
    found = take_sample(solver, COLUMNS, 1_000_000)
    assert found.cost == pytest.approx(1.6e-5, rel=0.02)
    np.testing.assert_allclose(found.costs, 3.2e-11 * (found.positions + (found.cells - 1) / 2))
    assert len(found.costs) > 30


def test_a_sample_that_is_cut_short_is_still_spread_over_the_grid(monkeypatch):
    solver = Uneven(lambda k: 0.004 * (1 + (k > 50_000)), monkeypatch)
    found = take_sample(solver, COLUMNS, 100_000)
    assert found.cost == pytest.approx(0.006, rel=0.1)
    # of 600 s
    assert solver.now < 6


@pytest.mark.parametrize("size", [1, 2, 3, 5, 31, 32, 33, 127, 128, 129, 5000])
def test_a_sample_of_a_small_grid_stays_inside_it(monkeypatch, size):
    solver = Uneven(lambda k: 0.0, monkeypatch)
    found = take_sample(solver, COLUMNS, size)
    assert max(stop for _, stop in solver.ranges) <= size
    assert sum(stop - start for start, stop in solver.ranges) <= size + 3
    assert (np.diff(found.positions) > 0).all()


@pytest.mark.parametrize("seconds", [1e-8, 1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize("size", [10**4, 10**6])
def test_a_sample_is_soon_over(monkeypatch, seconds, size):
    solver = Uneven(lambda k: seconds, monkeypatch)
    take_sample(solver, COLUMNS, size)
    assert solver.now < 0.15 + 0.02 * seconds * size


def test_lanes_are_told_from_single_cells(monkeypatch):
    """A kernel that takes 1 ms for up to 32 cells costs 31 us a cell."""
    solver = Uneven(lambda k: 0.0, monkeypatch)
    real = solver.solve

    def solve(start, cells):
        real(start, cells)
        solver.now += 1e-3 * -(-cells.number // 32)

    solver.solve = solve
    assert take_sample(solver, COLUMNS, 10**5).cost == pytest.approx(1e-3 / 32, rel=0.01)


def calls(seconds, lanes, monkeypatch):
    """A solver that takes so long for up to 32 cells, or for each."""
    made = Uneven(lambda k: 0.0, monkeypatch)
    real = made.solve

    def solve(start, cells):
        real(start, cells)
        made.now += seconds * (-(-cells.number // 32) if lanes else cells.number)

    made.solve = solve
    return made


@pytest.mark.parametrize("size", [2, 5, 100, 1500])
@pytest.mark.parametrize("lanes", [True, False])
def test_few_dear_cells_are_told_from_lanes_by_two_of_them(monkeypatch, size, lanes):
    solver = calls(0.05, lanes, monkeypatch)
    found = take_sample(solver, COLUMNS, size)
    assert found.lanes is lanes
    assert max(stop for _, stop in solver.ranges) <= size
    blocks = partition(found, size, 42, 2)
    if lanes:
        assert blocks.cells >= min(32, -(-size // 2))
        assert blocks.cells <= 32 or blocks.count >= 16
    else:
        assert blocks.cells == max(1, min(20, size // 400))
        assert solver.now < 0.05 * 10.5


@pytest.mark.parametrize(("lanes", "probes"), [(True, 2), (False, 1 + 32)])
def test_dear_cells_are_not_solved_twice_for_the_sample(monkeypatch, lanes, probes):
    solver = calls(0.15, lanes, monkeypatch)
    found = take_sample(solver, COLUMNS, 2048)
    assert solver.now == pytest.approx(0.15 * probes)
    assert found.cost == pytest.approx(0.15 / (32 if lanes else 1))
