"""Which cells of an extended grid are known, by counting; and what keeps a result from being extended."""

import itertools
import math
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from running import quiet
from toy_studies import build

from sweep.cells.grid import Box
from sweep.runs import extend
from sweep.runs.extend import Retried, Reused, has_failed, is_of_another_version, obstacle
from sweep.study.model import Axis, frozen
from sweep.system.errors import SweepError

POSITIONS = ([0, -1, 1], [-1, 0, 1, -1], [0, 1, -1, 2, 3])


def reused(kind=Reused):
    """Of a grid of 3 x 4 x 5, some of whose values are new."""
    made = object.__new__(kind)
    made._positions = [np.array(p) for p in POSITIONS]
    made._grid = Box(("a", "b", "c"), (3, 4, 5))
    return made


def known():
    """Which of the cells have no new value."""
    return np.array([all(p >= 0 for p in place) for place in itertools.product(*POSITIONS)])


def test_known_cells_are_counted():
    assert reused().cells == known().sum() == 16
    before = [int(known()[:cell].sum()) for cell in range(61)]
    assert reused().known_before(np.arange(61)).tolist() == before


@pytest.mark.parametrize(("start", "stop"), [(0, 60), (7, 53), (5, 6), (6, 7), (20, 40), (12, 12)])
def test_missing_cells_are_those_with_a_new_value(start, stop):
    assert reused().missing(start, stop).tolist() == (~known()[start:stop]).tolist()


def test_known_cells_are_filled_in_and_others_left():
    old = np.arange(16.0).reshape(2, 2, 4)
    made = reused()
    made._columns = (extend.Column("x", "f8", (), (), {}),)
    made._numbers, made._output = {"x": old}, "out.h5"
    for start, stop in ((0, 60), (7, 53), (43, 60)):
        found = {"x": np.full(stop - start, -1.0)}
        made.fill(start, stop, found)
        expected = np.full(60, -1.0)
        expected[known()] = np.arange(16.0)
        np.testing.assert_array_equal(found["x"], expected[start:stop])


def test_cells_that_failed_are_missing_and_not_counted():
    made = reused(Retried)
    made.__dict__["_failed"] = np.array([3, 7])
    assert made.known_before(np.array([0, 3, 4, 7, 8, 60])).tolist() == [0, 3, 3, 6, 6, 58]


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({}, "nothing differs but words"),
        ({"study": "x"}, "nothing differs but words"),
        ({"axes.mu": "2"}, ""),
        ({"numpy": "2"}, ""),
        ({"source kernels/a.py": "2"}, ""),
        ({"axes.mu": "2", "rtol": "2", "kernel": "b"}, "kernel differs, too"),
        ({"design": "zip"}, "design differs, too"),
        ({"fixed.g": None}, "fixed.g differs, too"),
    ],
)
def test_what_keeps_a_result_from_being_extended(changed, why):
    old = {"study": "a", "axes.mu": "1", "numpy": "1", "source kernels/a.py": "1", "rtol": "1", "kernel": "a"}
    old |= {"design": "product", "fixed.g": "1"}
    new = {name: value for name, value in (old | changed).items() if value is not None}
    assert obstacle(old, new) == why
    assert is_of_another_version(old, new) is bool({"numpy", "source kernels/a.py"} & set(changed))


def test_only_cells_of_a_product_are_extended():
    old = {"design": "zip", "axes.mu": "1"}
    assert obstacle(old, old | {"axes.mu": "2"}) == 'its design is not "product"'
    old = {"design": "product", "summary.over": "1", "axes.mu": "1"}
    assert obstacle(old, old | {"axes.mu": "2"}) == "it holds a summary, not cells"


def axis(*values):
    return Axis("mu", frozen(np.array(values)), "values")


def test_places_of_values_that_were_there_before():
    assert extend._positions(axis(1.0, 3.0), axis(1.0, 2.0, 3.0, 4.0)).tolist() == [0, -1, 1, -1]
    assert extend._positions(axis(2.0), axis(2.0)).tolist() == [0]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ((1.0, 2.0, 3.0), (1.0, 4.0), "axes.mu: 2 of its 3 values so far are not among the new ones, e.g. 2 is not"),
        ((1.0, 3.0), (3.0, 1.0), "axes.mu: its values so far stand in another order now"),
        ((0.0,), (-0.0, 1.0), "axes.mu: 1 of its 1 values so far are not"),
    ],
)
def test_an_axis_keeps_every_value_to_the_last_digit_and_their_order(old, new, said):
    with pytest.raises(SweepError, match=said):
        extend._positions(axis(*old), axis(*new))


def test_eight_cells_of_a_kind_are_taken_evenly():
    cells = 10 * np.arange(100)
    assert extend._spread(cells).tolist() == [0, 140, 280, 420, 560, 700, 840, 990]
    assert extend._spread(cells[:8]).tolist() == cells[:8].tolist()
    assert extend._spread(cells[:1]).tolist() == [0]


@pytest.fixture
def pieces(monkeypatch):
    """Columns are read in three pieces."""
    monkeypatch.setattr(extend, "flat_pieces", lambda column: np.array_split(column.ravel(), 3))


def test_what_failed_is_computed_again_and_the_rest_is_kept(pieces):
    made = object.__new__(Retried)
    made._positions, made._grid = [np.arange(4), np.arange(5)], Box(("a", "b"), (4, 5))
    status = np.zeros((4, 5), np.int8)
    status.ravel()[[1, 8, 9, 19]] = extend.Status.FAILED
    made._columns = tuple(extend.Column(name, "f8", (), (), {}) for name in ("x", "status"))
    made._numbers = {"x": np.arange(20.0).reshape(4, 5), "status": status}
    assert made._failed.tolist() == [1, 8, 9, 19]
    for start, stop in ((0, 20), (7, 13)):
        again = np.isin(np.arange(start, stop), [1, 8, 9, 19])
        assert made.missing(start, stop).tolist() == again.tolist()
        arrays = {"x": np.full(stop - start, -1.0), "status": np.full(stop - start, 5.0)}
        made.fill(start, stop, arrays)
        assert arrays["x"].tolist() == np.where(again, -1.0, np.arange(start, stop)).tolist()
        assert arrays["status"].tolist() == np.where(again, 5.0, 0.0).tolist()


def test_a_sample_has_cells_of_every_status_and_method(pieces):
    made = reused()
    status, used = np.zeros((2, 2, 4), np.int8), np.ones((2, 2, 4), np.int8)
    status.ravel()[[3, 12]], used.ravel()[[5, 12]] = 64, 0
    made._numbers = {"status": status, "method_used": used}
    numbers = {int(cell): old for old, cell in enumerate(np.flatnonzero(known()))}
    old = [numbers[cell] for cell in made._sample()]
    assert {3, 5, 12} < set(old)
    plain = sorted(set(old) - {3, 5, 12})
    assert len(plain) == 8
    assert (plain[0], plain[-1]) == (0, 15)
    assert len(old) == 11


def sampled(monkeypatch, old, new, **numbers):
    """Of a result of four cells with values `old`, that come out as `new` now."""
    made = object.__new__(Reused)
    made._positions, made._grid, made._output = [np.arange(4)], Box(("a",), (4,)), Path("out.h5")
    status = np.array([0, 0, 0, extend.Status.INACCURATE], np.int8)
    columns = {"x": np.array(old), "status": status, "method_used": np.zeros(4, np.int8), **numbers}
    made._numbers, made.taken_over = columns, ""
    made._columns = tuple(extend.Column(name, values.dtype.str, (), (), {}) for name, values in columns.items())

    def solve(start, stop, arrays, wanted):
        assert (stop, wanted) == (start + 1, None)
        for name, values in {**columns, "x": np.array(new)}.items():
            arrays[name][...] = values[start:stop]

    monkeypatch.setattr(extend, "block_solver", lambda study: solve)
    made._study = None
    return made


BOUND = np.zeros(4, np.float32)


def test_what_another_version_has_computed_is_taken_over_where_its_bits_come_out_again(monkeypatch):
    values = [1.0, math.nan, 3.0, 4.0]
    made = sampled(monkeypatch, values, values, error_bound=BOUND)
    made.check_sample()
    said = "4 cells of another version, 4 of which came out with the same bits again"
    assert made.taken_over == said
    made.taken_over = "0.1"
    made.check_sample()
    assert made.taken_over == f"0.1\n{said}"


@pytest.mark.parametrize(
    ("now", "said"), [(2.5, "was 2.0, and comes out as 2.5"), (1.5, "was 2.0, and comes out as 1.5")]
)
def test_what_comes_out_with_other_bits_is_refused(monkeypatch, now, said):
    made = sampled(monkeypatch, [1.0, 2.0, 3.0, 4.0], [1.0, now, 3.0, 4.0], error_bound=BOUND)
    with pytest.raises(SweepError) as fault:
        made.check_sample()
    assert str(fault.value) == (
        "out.h5: cannot be extended, for another version has computed it: x of a cell was 2.0, and comes out as "
        f"{now} now; choose another name, or overwrite it with --force"
    )
    assert made.taken_over == ""


def test_inaccurate_cells_without_error_bounds_are_refused(monkeypatch):
    made = sampled(monkeypatch, [1.0] * 4, [1.0] * 4)
    with pytest.raises(SweepError, match="it does not say what its INACCURATE values are right to"):
        made.check_sample()
    made._numbers["status"] = np.zeros(4, np.int8)
    made.check_sample()
    assert made.taken_over.startswith("4 cells of another version")


def test_error_bounds_that_are_not_there_are_nan_and_other_columns_are_a_fault(monkeypatch):
    made = sampled(monkeypatch, [1.0] * 4, [1.0] * 4)
    assert math.isnan(made._values("error_bound", (slice(1, 3),)))
    with pytest.raises(SweepError, match=r"^out\.h5"):
        made._values("y", (slice(1, 3),))


def test_a_result_is_taken_up_with_its_places_and_who_has_computed_it(tmp_path):
    path = tmp_path / "out.h5"
    quiet(build(axes={"height": [1.0, 3.0], "v0": [0.0, 1.0]}), path)
    study = build(axes={"height": [1.0, 2.0, 3.0], "v0": [0.0, 1.0]})
    with Reused(path, study) as found:
        assert (found.taken_over, found.cells) == ("", 4)
        assert found.missing(0, 6).tolist() == [False, False, True, True, False, False]
        assert set(found._numbers) == {"fall_time", "status", "method_used", "error_bound"}
        arrays = {column.name: column.empty(1) for column in found._columns}
        found.fill(5, 6, arrays)
    # 3 = t + g t^2 / 2
    assert arrays["fall_time"] == pytest.approx([(math.sqrt(1 + 6 * 9.80665) - 1) / 9.80665], rel=1e-14)
    assert not found._file
    path.write_bytes(b"no HDF5")
    with pytest.raises(SweepError, match=r"out\.h5"):
        Reused(path, study)


@pytest.mark.parametrize(("stored", "failed"), [([0, 127, 65], False), ([0, 126, 0], True), ([126, 0, 0], True)])
def test_whether_a_cell_of_a_result_failed(tmp_path, monkeypatch, stored, failed):
    monkeypatch.setattr(extend, "flat_pieces", lambda column: np.array_split(column[:], 3))
    path = tmp_path / "out.h5"
    with h5py.File(path, "w") as file:
        file["status"] = np.array(stored, np.int8)
    assert has_failed(path) is failed


def test_a_summary_keeps_no_cells_that_failed(tmp_path):
    path = tmp_path / "out.h5"
    h5py.File(path, "w").close()
    said = f"{path}: a summary does not keep the cells that FAILED; compute it anew with --force"
    with pytest.raises(SweepError, match=f"^{re.escape(said)}$"):
        has_failed(path)
