"""Cells at which a kernel raises are found by halving, and cost nothing else."""

from types import SimpleNamespace

import numpy as np
import pytest

from kernels.interface import Status
from sweep.cells.grid import Cells
from sweep.cells.guard import BadCell, Guard, Unsolved, told
from sweep.system.errors import SweepError


def cells_of(number, error=True):
    columns = {"x": np.zeros(number), "trace": np.zeros((number, 2))}
    status, used = np.full(number, 77, np.int8), np.full(number, 9, np.int8)
    return Cells(columns, status, used, np.zeros(number, np.float32) if error else None)


def solver(*bad):
    """Fails where one of its cells is bad; what it was asked for is kept."""

    def solve(start, cells, wanted=None):
        made.asked.append((start, cells.number))
        if any(start <= k < start + cells.number for k in bad):
            raise ValueError("no\n  such ")
        cells.outputs["x"][:] = np.arange(start, start + cells.number)
        cells.status[:], cells.used[:] = 0, 1

    grid = SimpleNamespace(cell=lambda cell: {"height": str(cell)})
    made = SimpleNamespace(solve=solve, asked=[], grid=grid)
    return made


def test_halves_are_tried_until_a_bad_cell_is_alone():
    made, reported, cells = solver(13), [], cells_of(5)
    Guard(made, reported.append).solve(10, cells)
    assert made.asked == [(10, 5), (10, 2), (12, 3), (12, 1), (13, 2), (13, 1), (14, 1)]
    assert reported == [BadCell(13, {"height": "13"}, "ValueError: no such")]
    assert str(reported[0]) == "cell 13 FAILED (height=13): ValueError: no such"
    np.testing.assert_array_equal(cells.outputs["x"], [10, 11, 12, np.nan, 14])
    assert np.isnan(cells.outputs["trace"][3]).all()
    assert np.isnan(cells.error).tolist() == [False, False, False, True, False]
    assert cells.status.tolist() == [0, 0, 0, Status.FAILED, 0]
    assert cells.used.tolist() == [1, 1, 1, -1, 1]


def test_halves_none_of_whose_cells_is_wanted_are_not_tried():
    made, wanted = solver(10), np.array([True, False, False, False])
    Guard(made, lambda cell: None).solve(10, cells_of(4, error=False), wanted)
    assert made.asked == [(10, 4), (10, 2), (10, 1)]
    Guard(made, lambda cell: None).solve(10, cells_of(4), np.zeros(4, bool))
    assert len(made.asked) == 3


@pytest.mark.parametrize("fault", [SweepError("stop"), MemoryError()])
def test_what_stops_a_run_goes_on(fault):
    def solve(start, cells, wanted=None):
        raise fault

    with pytest.raises(type(fault)):
        Guard(SimpleNamespace(solve=solve, grid=None), lambda cell: None).solve(0, cells_of(2))


def test_what_a_fault_says_in_a_line():
    assert told(KeyError()) == "KeyError"
    assert told(ValueError("a\n  b")) == "ValueError: a b"
    assert told(Unsolved("took longer")) == "took longer"
