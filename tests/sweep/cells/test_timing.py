"""The timed sample, step by step: how many cells a probe has, where probes lie, when there are enough of them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sweep.cells import timing
from sweep.cells.partition import Partition, RowBlocks, box_shape, boxes, row_blocks
from sweep.cells.schema import Column
from sweep.cells.timing import BLOCK_BYTES, Probe, Sample, partition, row_partition, take_sample, tolerated
from sweep.system.errors import SweepError

COLUMNS = tuple(Column(name, "i1", (), (), {}) for name in ("status", "method_used"))


def sample(cost, cells=32, lanes=None):
    return Sample(np.zeros(1), np.full(1, cost), cells, np.zeros(1, "i1"), np.zeros(1, "i1"), lanes)


@pytest.mark.parametrize(
    ("cost", "size", "cell_bytes", "workers", "cells"),
    [
        (1e-3, 100_000, 1, 2, 256),  # a 400th of 100 s, in whole lanes
        (1e-3, 100_000, 1, 1, 512),
        (1e-3, 1000, 1, 1, 64),  # not shorter than 0.05 s
        (1e-3, 10_000_000, 1, 1, 1024),  # nor longer than 1 s
        (1e-6, 10**6, BLOCK_BYTES / 100, 1, 128),  # nor of more than 8 MiB
        (10.0, 100_000, 1, 1, 1),
        (10.0, 100_001, 1, 1, 2),  # nor more than 100,000 blocks
        (0.05, 10_000, 1, 1, 20),  # below a lane's cells as they are
        (1 / 31.5, 10_000, 1, 1, 31),
        (1 / 32.5, 10_000, 1, 1, 32),
        (1 / 33.5, 10_000, 1, 1, 64),
        (0.0, 5000, 1, 2, 5000),
    ],
)
def test_blocks_have_the_cells_that_follow_from_time_bytes_and_number(cost, size, cell_bytes, workers, cells):
    assert partition(sample(cost), size, cell_bytes, workers) == Partition(size, cells)


@pytest.mark.parametrize(
    ("cells", "lanes", "size", "workers", "found"),
    [
        (1, True, 40, 3, 14),
        (1, True, 10**4, 2, 32),
        (1, False, 10**4, 2, 1),
        (1, None, 80, 2, 10),
        (31, None, 10**4, 2, 32),
        (32, None, 10**4, 2, 1),
    ],
)
def test_dear_blocks_have_a_lane_where_single_cells_may_be_as_dear_as_one(cells, lanes, size, workers, found):
    assert partition(sample(3.0, cells, lanes), size, 42, workers).cells == found


def test_rows_are_blocks_of_as_many_cells():
    rows = RowBlocks(groups=100, group=50, length=50)
    assert row_partition(sample(1e-3), rows, (100,), 8.0, 1) == boxes((100,), 2)  # 64 cells, of 50 each
    cells = RowBlocks(groups=10_000, group=1, length=1)
    assert row_partition(sample(1e-3), cells, (10_000,), 8.0, 1) == boxes((10_000,), 64, 32)
    narrow = row_partition(sample(1e-6), rows, (100,), 50 * BLOCK_BYTES / 500, 1)  # 500 cells, in whole lanes 512
    assert narrow == boxes((100,), 11)


def test_weights_are_the_costs_between_places_times_the_cells():
    found = Sample(np.array([10.0, 30.0]), np.array([1.0, 3.0]), 1, None, None)
    assert found.weights(Partition(40, 20)).tolist() == [20.0, 60.0]
    assert found.weights(Partition(40, 10)).tolist() == [10.0, 15.0, 25.0, 30.0]
    assert found.weights(Partition(20, 10), lambda row: 2 * row).tolist() == [20.0, 60.0]
    assert found.cost == 2.0


@pytest.mark.parametrize(
    ("index", "count", "cells", "size", "start"),
    [(0, 1, 1, 100, 50), (0, 4, 10, 100, 7), (3, 4, 10, 100, 82), (0, 64, 10, 100, 0), (63, 64, 10, 100, 90)],
)
def test_a_probe_lies_in_the_middle_of_its_share_of_the_grid(index, count, cells, size, start):
    assert timing._place(index, count, cells, size) == start


def test_places_are_taken_from_all_over_the_grid():
    assert timing._scattered(1) == [0]
    assert timing._scattered(5) == [2, 1, 4, 3, 0]
    assert timing._scattered(8) == [4, 0, 6, 2, 5, 1, 7, 3]


class Made:
    """Makes probes that take as it is told, None where they fail; notes where and of how many cells."""

    def __init__(self, seconds, dear=None):
        self.seconds, self.dear, self.made = seconds, dear or {}, []

    def probe(self, start, columns, cells):
        self.made.append((start, cells))
        found = self.seconds(cells)
        return None if found is None else Probe(found, {})


def lanes_of(one):
    return lambda cells: one * -(-cells // 32)


@pytest.mark.parametrize(
    ("seconds", "size", "found"),
    [
        (lambda n: 1e-5 * n, 127, (1, None)),
        (lambda n: 1e-5 * n, 128, (32, None)),
        (lambda n: 1e-5 * n, 10**6, (32, None)),
        (lambda n: 9e-6 * n, 10**6, (128, None)),  # 2.9e-4 s do not see past the cost of a call
        (lambda n: 1e-9 * n, 2**21 - 1, (8192, None)),
        (lambda n: 1e-9 * n, 2**21, (32768, None)),
        (lanes_of(5e-3), 10**5, (32, None)),
        (lanes_of(0.1), 1601, (32, None)),
        (lanes_of(0.1), 1600, (32, True)),
        (lambda n: 0.1 * n, 1600, (1, False)),
        (lanes_of(0.1), 100, (25, True)),
        (lanes_of(0.1), 2, (1, True)),
        (lanes_of(0.1), 1, (1, None)),
        (lanes_of(3e-4), 100, (1, None)),
        (lanes_of(3.1e-4), 100, (25, True)),
        (lanes_of(7.4e-3), 1000, (32, None)),
        (lanes_of(7.5e-3), 1000, (32, True)),
        (lambda n: 0.1 if n == 1 else 0.149, 100, (25, True)),
        (lambda n: 0.1 if n == 1 else 0.151, 100, (1, False)),
    ],
)
def test_a_probe_has_cells_enough_to_see_past_the_cost_of_a_call_and_few_enough_to_be_soon_over(seconds, size, found):
    assert timing._probe_cells(Made(seconds), COLUMNS, size) == found


def test_where_the_middle_fails_eight_other_places_are_tried():
    made = Made(lambda cells: None)
    assert timing._probe(made, COLUMNS, 160, 1) == math.inf
    assert [start for start, _ in made.made] == [80, 90, 10, 130, 50, 110, 30, 150, 70]
    told = iter([None, 0.5])
    assert timing._probe(Made(lambda cells: next(told)), COLUMNS, 160, 1) == 0.5


@pytest.mark.parametrize(
    ("seconds", "size", "cells", "number"),
    [
        (0.02, 6500, 1, 33),  # a 200th of 6500 cells is 32.5 of them
        (1e-9, 10**6, 1, 64),
        (1e-9, 400, 10, 10),
        (1e-9, 7, 1, 1),
        (0.0101, 400, 1, 3),  # 0.03 s are over
        (0.0099, 400, 1, 4),
        (0.0101, 100, 1, 2),  # a hundredth of the run
        (0.0011, 40, 1, 3),  # 0.003 s are over
    ],
)
def test_probes_end_with_the_budget_or_a_share_of_the_run(seconds, size, cells, number):
    made = Made(lambda cells: seconds)
    found = timing._probes(made, COLUMNS, size, cells)
    assert len(found) == len(made.made) == number
    assert {cells for _, cells in made.made} == {cells}


def test_a_dear_probe_of_as_many_cells_that_was_made_before_is_among_them():
    before = Probe(0.05, {})
    made = Made(lambda cells: 0.05, {1: {5: before}})
    assert timing._probes(made, COLUMNS, 8, 1) == {5: before}
    assert made.made == []
    assert 5 not in timing._probes(made, COLUMNS, 16, 2)


def failing(when):
    """A solver that fails when it is told to, on a clock that counts a hundredth of a second a cell."""

    def solve(start, cells):
        made.solved.append((start, cells.number))
        made.now += 0.01 * cells.number
        if when(start, cells.number):
            raise ValueError(f"cell {start}")
        cells.status[:], cells.used[:] = 0, 1

    made = SimpleNamespace(solve=solve, solved=[], now=0.0)
    return made


def test_a_kernel_that_fails_sixteen_times_and_never_succeeds_is_given_up():
    solver = failing(lambda start, number: True)
    probing = timing._Probing(solver, lambda: solver.now)
    for _ in range(15):
        assert probing.probe(3, COLUMNS, 1) is None
    with pytest.raises(ValueError, match="cell 3"):
        probing.probe(3, COLUMNS, 1)
    solver = failing(lambda start, number: start > 0)
    probing = timing._Probing(solver, lambda: solver.now)
    assert probing.probe(0, COLUMNS, 1).seconds == 0.01
    assert [probing.probe(k, COLUMNS, 1) for k in range(1, 40)] == [None] * 39
    assert str(probing.fault) == "cell 39"


def test_the_last_dear_probe_is_kept_by_its_cells():
    solver = failing(lambda start, number: False)
    probing = timing._Probing(solver, lambda: solver.now)
    made = [probing.probe(start, COLUMNS, 2) for start in (4, 6)]
    assert probing.dear == {2: {6: made[1]}}
    quick = timing._Probing(solver, lambda: 0.0)
    quick.probe(4, COLUMNS, 2)
    assert quick.dear == {}


def test_where_probes_of_many_cells_all_fail_single_ones_are_timed():
    solver = failing(lambda start, number: number > 1)
    solver.clock = lambda: solver.now / 1e4
    found = take_sample(solver, COLUMNS, 1000, solver.clock)
    assert (found.cells, found.lanes) == (1, None)
    np.testing.assert_allclose(found.costs, 1e-6)
    assert len(found.positions) == len(found.status) == len(found.method_used) == 64
    assert (found.method_used == 1).all()


def test_what_stops_a_run_is_not_tolerated():
    for fault in (SweepError("no"), MemoryError(), KeyboardInterrupt()):
        with pytest.raises(type(fault)), tolerated():
            raise fault
    with tolerated() as faults:
        raise ValueError("seven")
    assert str(faults) == "[ValueError('seven')]"


def test_blocks_within_rows():
    found = Partition(24, 5, 12)
    bounds = [(0, 5), (5, 10), (10, 12), (12, 17), (17, 22), (22, 24)]
    assert found.count == 6
    assert [found.bounds(k) for k in range(6)] == bounds
    assert found.edges.tolist() == [0, 5, 10, 12, 17, 22, 24]
    assert found.index(np.arange(24)).tolist() == [k for k, (a, b) in enumerate(bounds) for _ in range(a, b)]


@pytest.mark.parametrize(
    ("shape", "wanted", "unit", "found"),
    [
        ((100,), 30, 1, Partition(100, 27, 100)),  # 28 leave 12 of 112 idle
        ((100,), 23, 1, Partition(100, 22, 100)),  # 110 are just a tenth more
        ((7,), 3, 1, Partition(7, 7, 7)),  # neither 3 nor 2 fit, nor 4 to 6
        ((7,), 7, 1, Partition(7, 7)),
        ((6, 4), 9, 1, Partition(24, 8, 24)),
        ((6, 4), 3, 1, Partition(24, 2, 4)),
        ((6, 4), 0, 1, Partition(24, 1, 4)),
        ((3, 4, 5), 20, 1, Partition(60, 20, 60)),
        ((3, 4, 5), 19, 1, Partition(60, 10, 20)),
        ((1000,), 70, 32, Partition(1000, 64, 1000)),
    ],
)
def test_boxes_of_a_grid(shape, wanted, unit, found):
    assert boxes(shape, wanted, unit) == found


def test_boxes_are_whole_axes_behind_a_run_of_one():
    assert box_shape((4, 6, 5), 30) == (1, 6, 5)
    assert box_shape((4, 6, 5), 10) == (1, 2, 5)
    assert box_shape((4, 6, 5), 3) == (1, 1, 3)
    assert box_shape((4, 6, 5), 1000) == (4, 6, 5)


def summed(over, **shape):
    dims = {name: [name] for name in shape}
    return SimpleNamespace(grid_shape=shape, dims=dims, summary=SimpleNamespace(over=over))


def test_row_blocks_are_a_thousandth_of_a_study_or_a_group():
    # 3 * 2^20 cells over 1024: the power of two below 3072
    assert row_blocks(summed(["b"], a=3 << 7, b=1 << 13)) == RowBlocks(384, 8192, 8192)
    assert row_blocks(summed(["b"], a=3 << 6, b=1 << 14)) == RowBlocks(192, 1 << 14, 2048)
    assert row_blocks(summed(["a", "b"], a=3, b=1 << 40)) == RowBlocks(1, 3 << 40, 1 << 22)
    assert row_blocks(summed(["b"], a=5, b=4)) == RowBlocks(5, 4, 4)
    assert row_blocks(summed(["b"], a=2, b=5)) == RowBlocks(2, 5, 1)
    assert row_blocks(SimpleNamespace(grid_shape={"a": 6, "b": 7}, summary=None)) == RowBlocks(42, 1, 1)


def strips(blocks, *given):
    return [tuple(strip) for strip in blocks.strips(*given)]


def test_strips_of_rows_by_hand():
    blocks = RowBlocks(groups=3, group=10, length=4)
    assert (blocks.per_group, blocks.count, blocks.size) == (3, 9, 30)
    assert blocks.mean == 30 / 9
    assert blocks.first(np.arange(10)).tolist() == [0, 4, 8, 10, 14, 18, 20, 24, 28, 30]
    assert blocks.cells(1, 4) == (4, 14)
    group = [(0, 2, 0, 4), (2, 1, 8, 2)]  # row, rows, cell, cells
    assert strips(blocks, 0, 3, 8) == strips(blocks, 0, 3, 100) == group
    assert strips(blocks, 1, 5, 8) == [(1, 1, 4, 4), (2, 1, 8, 2), (3, 2, 10, 4)]
    assert strips(blocks, 0, 2, 7) == [(0, 1, 0, 4), (1, 1, 4, 4)]
    assert strips(blocks, 0, 2, 4) == [(0, 1, 0, 4), (1, 1, 4, 4)]
    assert strips(blocks, 1, 3, 3) == [(1, 1, 4, 3), (1, 1, 7, 1), (2, 1, 8, 2)]
    assert strips(RowBlocks(5, 4, 4), 0, 5, 8) == [(0, 2, 0, 4), (2, 2, 8, 4), (4, 1, 16, 4)]
    assert strips(RowBlocks(5, 4, 4), 1, 3, 100) == [(1, 2, 4, 4)]
    assert strips(RowBlocks(1, 20, 4), 1, 4, 100) == [(1, 3, 4, 4)]
