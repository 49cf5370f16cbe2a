"""Small parts of solving: runs of cells side by side, statuses that are none, and errors as they are told."""

import numpy as np
import pytest

from kernels.interface import Status
from sweep.cells.solve import GIVEN_UP, _count, _pick, _rows, _tell_errors, among, fail


def chosen(cells):
    return list(range(cells.start, cells.stop)) if isinstance(cells, slice) else cells.tolist()


@pytest.mark.parametrize("given", [slice(10, 16), np.array([2, 3, 5, 8, 9, 20])])
@pytest.mark.parametrize("hits", [[], [0], [5], [0, 1, 2], [2, 3], [1, 3], [0, 1, 2, 3, 5], [0, 1, 2, 3, 4, 5]])
def test_cells_side_by_side_stay_a_slice(given, hits):
    condition = np.zeros(6, bool)
    condition[hits] = True
    found = _pick(given, condition)
    assert chosen(found) == [chosen(given)[k] for k in hits]
    assert _count(found) == len(hits)
    if len(hits) == 6:
        assert found is given
    elif isinstance(given, slice):
        assert isinstance(found, slice) is (not hits or hits[-1] - hits[0] + 1 == len(hits))


def test_rows_are_the_cells_or_as_many():
    column = np.arange(10.0)
    assert _rows([column], slice(3, 6))[0].tolist() == [3.0, 4.0, 5.0]
    assert _rows([column], np.array([7, 9]))[0].tolist() == [0.0, 1.0]


def test_statuses_among_some():
    every = np.array([int(s) for s in Status], np.int8)
    found = {Status(s).name for s in every[among(every, GIVEN_UP)]}
    assert found == {"NO_METHOD", "NO_CYCLE", "NOT_CONVERGED", "STEP_LIMIT", "INACCURATE", "UNSTABLE", "FAILED"}


def test_ok_without_a_number_and_what_is_no_status_of_a_kernel_failed():
    status = np.array([0, 0, 1, 0, Status.NOT_ASKED, Status.PENDING, -1, Status.NOT_ASKED - 1], np.int8)
    numbers = np.zeros(8)
    numbers[[0, 2]] = np.nan
    traces = np.zeros((8, 2))
    traces[3, 1] = np.inf
    fail(status, [numbers, traces])
    failed = int(Status.FAILED)
    assert status.tolist() == [failed, 0, 1, failed, failed, failed, failed, int(Status.NOT_ASKED) - 1]
    fail(status[:0], [numbers[:0]])


def test_errors_are_told_of_inaccurate_cells_alone_and_rounded_up():
    error = np.array([1e-3, 1e-3, 1 / 3, 1e300, np.inf])
    column, status = np.zeros(5, np.float32), np.array([0, 1, 1, 1, 1], np.int8)
    _tell_errors(column, error, status)
    assert np.isnan(column).tolist() == [True, False, False, False, False]
    assert (column[1:].astype(float) >= error[1:]).all()
    np.testing.assert_allclose(column[1:3], error[1:3], rtol=4e-7)
    assert np.isinf(column[3:]).all()
