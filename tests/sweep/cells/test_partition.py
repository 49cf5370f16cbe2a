import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sweep.cells.partition import Partition, boxes
from sweep.cells.schema import Column
from sweep.cells.timing import BLOCK_BYTES, LANES, MOST_BLOCKS, Sample, block_cells, take_sample

COLUMNS = tuple(Column(name, "i1", (), (), {}) for name in ("status", "method_used"))


def sample(costs, size):
    costs = np.atleast_1d(np.asarray(costs, float))
    places = (np.arange(len(costs)) + 0.5) * size / len(costs)
    return Sample(places, costs)


@given(
    cost=st.floats(1e-10, 1e3),
    size=st.integers(1, 10**11),
    cell_bytes=st.integers(10, 10**5),
    workers=st.integers(1, 64),
)
@example(cost=1e-3, size=51, cell_bytes=10, workers=1)
def test_blocks_keep_their_bounds_in_time_bytes_and_number(cost, size, cell_bytes, workers):
    cells = block_cells(sample(cost, size), size, cell_bytes, workers)
    assert 1 <= cells <= size
    assert -(-size // cells) <= MOST_BLOCKS
    if cells > max(LANES, 1.001 * size / MOST_BLOCKS + LANES):
        assert (cells - LANES) * cell_bytes <= BLOCK_BYTES
        assert (cells - LANES) * cost <= 1.0001


@pytest.mark.parametrize("length", range(2, 40))
def test_boxes_waste_a_tenth_at_most_whatever_is_wanted(length):
    for wanted in range(1, length + 1):
        cells = boxes((length,), wanted).cells
        assert -(-length // cells) * cells <= 1.1 * length


@given(st.integers(1, 9), st.integers(1, 60), st.integers(1, 70), st.integers(1, 80))
def test_strips_of_a_summary_fit_their_room_and_leave_no_cell_out(groups, group, length, room):
    blocks, covered = Partition(groups * group, min(length, group), group), []
    for _, rows, cell, cells in blocks.strips(0, blocks.count, room):
        assert rows * cells <= room
        covered += range(cell, cell + rows * cells)
    assert covered == list(range(groups * group))


class Uneven:
    """A solver whose cells cost as it is told, on a clock of its own."""

    def __init__(self, seconds):
        self.seconds, self.ranges, self.now = seconds, [], 0.0

    def solve(self, start, cells):
        stop = start + len(cells["status"])
        self.ranges.append((start, stop))  # to be looked at later: a sample tolerates what is raised here
        cells["status"][:], cells["method_used"][:] = 0, 1
        self.now += max(self.seconds(k) for k in range(start, stop))


@pytest.mark.parametrize("seconds", [0.0, 0.02])
@pytest.mark.parametrize("size", [1, 2, 3, 5, 31, 32, 33, 127, 128, 129, 5000])
def test_a_sample_of_a_small_grid_stays_inside_it(size, seconds):
    """Of cells that take no time, or as long together as one alone."""
    solver = Uneven(lambda k: seconds)
    found = take_sample(solver, COLUMNS, size, lambda: solver.now)
    assert all(0 <= start < stop <= size for start, stop in solver.ranges)
    assert sum(stop - start for start, stop in solver.ranges) <= size + 3
    assert (np.diff(found.positions) > 0).all()


@pytest.mark.parametrize("call", range(1, 13))
def test_a_call_during_which_other_processes_run_changes_a_sample_little(call):
    """A cell takes 0.2 us, a call 30 us beside them, and one call of the sample 8 ms longer, wherever that is."""
    solver = Uneven(lambda k: 3e-5)
    solve = solver.solve

    def busy(start, cells):
        solve(start, cells)
        solver.now += 2e-7 * len(cells["status"]) + 8e-3 * (len(solver.ranges) == call)

    solver.solve = busy
    assert take_sample(solver, COLUMNS, 10**8, lambda: solver.now).cost == pytest.approx(2e-7, rel=1.0)
