"""What is known of rows, by hand: counts, extremes, sums of two rows, histograms, and how much is reduced at a time."""

import math

import numpy as np
import pytest
from toy_studies import build

from kernels.interface import Status
from sweep.cells import reduce
from sweep.cells.reduce import NO_CELL, OTHER, STATUSES, Reducer, merge, nothing, pending, row_columns, strip_bytes

NAN, INF = math.nan, math.inf
EVERYTHING = ["min", "argmax", "mean", "histogram"]


def stone(reductions=EVERYTHING, cells=40, **keys):
    edges = {"edges": {"fall_time": [0.5, 1.0]}} if "histogram" in reductions else {}
    summary = {"outputs": {"fall_time": reductions}, **edges}
    return build(axes={"height": np.arange(1.0, cells + 1)}, summary=summary, **keys)


def test_the_columns_of_rows():
    found = {c.name: (c.dtype, c.shape) for c in row_columns(stone())}
    assert found == {
        "cells_by_status": ("i8", (len(Status) + 1,)),
        "cells_by_method": ("i8", (3,)),
        "fall_time count": ("i8", ()),
        "fall_time min": ("f8", ()),
        "fall_time min at": ("i8", ()),
        "fall_time min status": ("i1", ()),
        "fall_time max": ("f8", ()),
        "fall_time max at": ("i8", ()),
        "fall_time max status": ("i1", ()),
        "fall_time sum": ("f8", ()),
        "fall_time rest": ("f8", ()),
        "fall_time histogram": ("i8", (3,)),
    }
    assert [c.name for c in row_columns(stone(["argmin"]))[3:]] == [f"fall_time min{k}" for k in ("", " at", " status")]


def test_rows_of_nothing_and_rows_to_come():
    rows = nothing(stone(), 2)
    assert rows["fall_time min"].tolist() == [INF, INF]
    assert rows["fall_time max"].tolist() == [-INF, -INF]
    assert rows["fall_time max at"].tolist() == [NO_CELL, NO_CELL] == [-1, -1]
    assert not any(rows[name].any() for name in ("cells_by_status", "fall_time sum", "fall_time min status"))
    found = pending(stone(cells=40), 0, 1)["cells_by_status"]
    assert found.sum() == found[0, STATUSES.index("PENDING")]


def test_codes_are_counted_by_kind():
    status = np.array([0, Status.BAD_INPUT, 0, 0, 99, Status.PENDING], np.int8)
    counts = reduce._counted(status, 2, len(STATUSES), reduce._status_number)
    names = [{name: int(n) for name, n in zip(STATUSES, row, strict=True) if n} for row in counts]
    assert names == [{"OK": 2, "BAD_INPUT": 1}, {"OK": 1, OTHER: 1, "PENDING": 1}]
    used = np.array([-1, 1, 1, 0, 0, 0], np.int8)
    assert reduce._counted(used, 2, 3, reduce._method_number).tolist() == [[1, 0, 2], [0, 3, 0]]
    assert reduce._counted(used[:0:-5], 1, 3, reduce._method_number).tolist() == [[0, 1, 0]]
    assert reduce._counted(np.ones(6, np.int8), 2, 3, reduce._method_number).tolist() == [[0, 0, 3]] * 2


@pytest.mark.parametrize(
    ("values", "least", "most"),
    [
        ([3.0, 1.0, 1.0, 3.0], (1.0, 1), (3.0, 0)),
        ([NAN, 1.0, 2.0, NAN], (1.0, 1), (2.0, 2)),
        ([NAN, NAN, NAN, NAN], (INF, -1), (-INF, -1)),
        ([NAN, INF, INF, NAN], (INF, 1), (INF, 1)),
        ([NAN, -INF, NAN, -INF], (-INF, 1), (-INF, 1)),
        ([NAN, INF, -INF, NAN], (-INF, 2), (INF, 1)),
    ],
)
def test_extremes_are_the_first_of_equals_and_never_a_missing_one(values, least, most):
    row = np.array([values])
    for end, wanted in (("min", least), ("max", most)):
        best, place = reduce._extreme(row, np.isnan(row) if np.isnan(row).any() else None, end)
        assert (best[0], place[0]) == wanted


def test_values_are_counted_in_bins_of_which_the_last_holds_its_edge():
    edges = np.array([0.0, 1.0, 2.0])
    values = np.array([[[-1.0, 0.0], [0.0, 1.0], [2.0, 2.1]], [[NAN, 1.5], [INF, -INF], [1.0, NAN]]])
    found = reduce._histogram(values, np.isnan(values), edges)
    assert found.tolist() == [[[1, 1, 1, 0], [0, 1, 1, 1]], [[0, 0, 1, 1], [1, 0, 1, 0]]]
    plain = np.array([[0.5, 3.0]])
    assert reduce._histogram(plain, np.isnan(plain), edges).tolist() == [[0, 1, 0, 1]]


def merged(left, right):
    left, right = ({k: np.array([v]) for k, v in row.items()} for row in (left, right))
    merge(left, right)
    return {k: v[0].item() for k, v in left.items()}


def extreme(end, value, at, status=0):
    return {f"x {end}": value, f"x {end} at": at, f"x {end} status": status}


@pytest.mark.parametrize(
    ("end", "left", "right", "first"),
    [
        ("min", (1.0, 4, 0), (2.0, 7, 1), True),
        ("min", (2.0, 4, 0), (1.0, 7, 1), False),
        ("min", (1.0, 4, 0), (1.0, 7, 1), True),
        ("max", (1.0, 4, 0), (2.0, 7, 1), False),
        ("max", (2.0, 4, 0), (2.0, 7, 1), True),
        ("min", (INF, -1, 0), (INF, 7, 1), False),
        ("max", (-INF, -1, 0), (-INF, 7, 1), False),
        ("min", (INF, 4, 0), (INF, -1, 0), True),
    ],
)
def test_of_two_rows_the_better_extreme_or_the_earlier_is_taken(end, left, right, first):
    assert merged(extreme(end, *left), extreme(end, *right)) == extreme(end, *(left if first else right))


def test_of_two_rows_counts_add_up_and_sums_keep_what_rounding_takes():
    left = {"x count": 3, "x histogram": 2, "cells_by_status": 4, "cells_by_method": 5, "x sum": 1e16, "x rest": 0.25}
    right = {"x count": 1, "x histogram": 1, "cells_by_status": 1, "cells_by_method": 1, "x sum": 1.0, "x rest": 0.5}
    found = merged(left, right)
    assert found == {
        "x count": 4, "x histogram": 3, "cells_by_status": 5, "cells_by_method": 6, "x sum": 1e16, "x rest": 1.75,
    }  # fmt: skip
    assert merged({"x sum": INF, "x rest": 0.0}, {"x sum": 1.0, "x rest": 0.5}) == {"x sum": INF, "x rest": 0.0}


@pytest.mark.parametrize("length", [1, 2, 3, 5, 8, 13])
def test_a_sum_keeps_what_its_rounding_takes(length):
    values = np.random.default_rng(length).normal(size=(3, length, 2)) * 10.0 ** np.arange(length)[:, None]
    total, rest = reduce.tree_sum(values)
    for row, column in np.ndindex(3, 2):
        assert total[row, column] + rest[row, column] == pytest.approx(math.fsum(values[row, :, column]), rel=1e-16)
    assert [part.tolist() for part in reduce.tree_sum(np.array([[1e16, 1.0, 1.0]]))] == [[1e16], [2.0]]
    assert [part.tolist() for part in reduce.tree_sum(np.array([[INF, 1.0, 2.0]]))] == [[INF], [0.0]]


def test_as_many_cells_are_reduced_at_a_time_as_their_traces_leave_room_for():
    assert strip_bytes(build(axes={"height": [1.0]})) == 0
    assert strip_bytes(stone(cells=9)) == 65536 * (8 + 2)
    traces = build(
        axes={"height": [1.0]}, along={"phase": {"num": 200}}, outputs=["drop"], summary={"outputs": {"drop": ["min"]}}
    )
    assert strip_bytes(traces) == 8192 * (1600 + 2)  # 16 MiB hold 10,485 of 1600 bytes


def test_what_reducing_a_cell_takes_is_the_least_of_three(monkeypatch):
    times = iter([0.0, 5.0, 10.0, 12.0, 20.0, 29.0])
    monkeypatch.setattr(reduce.time, "perf_counter", lambda: next(times))
    assert Reducer(stone(cells=40)).seconds() == 2.0 / 40
    assert next(times, None) is None


def test_places_of_extremes_are_numbers_of_cells():
    reducer = Reducer(stone(["argmin", "argmax"], cells=6))
    cells = reducer._cells.rows(slice(6))
    cells.outputs["fall_time"][:] = [3.0, 1.0, 2.0, NAN, 7.0, 7.0]
    cells.status[:], cells.used[:] = np.arange(6), 1
    found = reducer.reduce(100, 2, cells)
    assert found["fall_time min at"].tolist() == [101, 104]
    assert found["fall_time max at"].tolist() == [100, 104]
    assert found["fall_time min status"].tolist() == [1, 4]
    assert found["fall_time count"].tolist() == [3, 2]
    cells.outputs["fall_time"][3:] = NAN
    found = reducer.reduce(100, 2, cells)
    assert (found["fall_time min at"][1], found["fall_time min status"][1]) == (NO_CELL, 0)
