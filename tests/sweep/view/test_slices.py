"""What is shown is what is in the result, and no more than that is read."""

import numpy as np
import pytest
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

import sweep
from kernels.interface import Status
from sweep.show.view import view
from sweep.view import slices
from sweep.view.slices import PLACE, Choice, cell_numbers, nearest, number_axes, other_axes, outputs, row, shown


class Counting(BackendArray):
    """Zeros of any shape that count how many numbers are read."""

    def __init__(self, shape, dtype):
        self.shape, self.dtype, self.read = shape, np.dtype(dtype), 0

    def __getitem__(self, key):
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._zeros)

    def _zeros(self, key):
        lengths = [len(range(n)[k]) for n, k in zip(self.shape, key, strict=True) if isinstance(k, slice)]
        self.read += int(np.prod(lengths))
        return np.zeros(lengths, self.dtype)


def large():
    """1e9 cells that nobody could read, and what counts."""
    shape, dims = (4000, 2500, 100), ("u", "v", "w")
    columns = {"y": Counting(shape, np.float64), "z": Counting(shape, np.float64), "status": Counting(shape, np.int8)}
    coords = {d: np.arange(1.0, n + 1) for d, n in zip(dims, shape, strict=True)}
    lazy = {name: (dims, indexing.LazilyIndexedArray(c)) for name, c in columns.items()}
    return xr.Dataset(lazy, coords), columns


def test_of_a_billion_cells_the_slice_alone_is_read():
    dataset, columns = large()
    shown(dataset, Choice("y", "u", None, {"v": 7, "w": 3}))
    assert (columns["y"].read, columns["status"].read, columns["z"].read) == (4000, 4000, 0)


def test_of_a_long_map_as_many_cells_as_a_picture_can_show_are_read_and_in_a_region_all():
    dataset, columns = large()
    found = shown(dataset, Choice("y", "u", "v", {"w": 3}))
    assert found.y.shape == (1250, 2000)
    assert columns["y"].read == 1250 * 2000
    near = shown(dataset, Choice("y", "u", "v", {"w": 3}), (1000.0, 1099.0), (500.0, 519.0))
    assert near.values("u").tolist() == list(range(997, 1102))
    assert near.values("v").tolist() == list(range(497, 522))


def test_a_slice_has_the_numbers_of_the_result(dataset):
    found = shown(dataset, Choice("period", "mu", "R", {"a": 2}))
    assert found.mapped
    assert np.array_equal(found.y.values, dataset.period.isel(a=2).values.T, equal_nan=True)
    assert np.array_equal(found.status, dataset.status.isel(a=2).values.T)
    assert found.y[PLACE + "R"].values.tolist() == list(range(21))


def test_the_exponent_is_that_of_the_analysis(dataset):
    found = shown(dataset, Choice("period", "mu", None, {"a": 1, "R": 0}, exponent=True))
    assert np.array_equal(found.y.values, sweep.local_exponent(dataset.period.isel(a=1, R=0).load(), "mu").values)


def test_what_is_no_axis_has_no_exponent():
    study = sweep.study(
        kernel="foliot", design="zip", axes={"mu": [1.0, 3.0, 2.0], "a": [1.0, 2.0, 3.0]}, fixed={"phi0": 1.0}
    )
    dataset = sweep.run(study, progress=False)
    assert shown(dataset, Choice("period", "mu")).y.size == 3
    with pytest.raises(sweep.SweepError, match="mu is no axis"):
        shown(dataset, Choice("period", "mu", exponent=True))


def test_axes_come_in_the_order_of_their_lengths(dataset):
    assert outputs(dataset) == ["period", "amplitude"]
    assert other_axes(dataset, Choice("period", "R")) == ["mu", "a"]


@pytest.mark.parametrize("cell", [(0, 0), (40, 20), (17, 5)])
def test_the_cell_of_a_point_is_the_one_whose_edges_surround_it(dataset, cell):
    found = shown(dataset, Choice("period", "mu", "R", {"a": 1}))
    mu, R = float(dataset.mu[cell[0]]), float(dataset.R[cell[1]])
    for step in (0.99, 1.01):  # of 1.122 to the next edge
        assert nearest(found, mu * step**10, R + 0.049 * np.sign(step - 1), True, (True, False)) == {
            "mu": cell[0],
            "R": cell[1],
        }
    assert nearest(found, 1e3, R, True, (True, False)) is None


def test_the_cell_of_a_point_beside_a_line_is_the_one_below_it(dataset):
    found = shown(dataset, Choice("period", "mu", "a", {"R": 0}))
    assert not found.mapped
    values = dataset.period.isel(R=0).load()
    assert nearest(found, float(dataset.mu[9]) * 1.05, float(values[9, 2]), False, (True, True)) == {"mu": 9, "a": 2}
    assert nearest(found, float(dataset.mu[9]) * 0.95, float(values[9, 0]), False, (True, True)) == {"mu": 9, "a": 0}


def test_cells_of_a_logarithmic_axis_meet_at_their_geometric_mean():
    grid = np.array([1.0, 10.0, 100.0, 1000.0])
    edge = np.sqrt(10.0)
    assert cell_numbers(grid, np.array([edge * 0.999, edge * 1.001, 0.3, 4000.0])).tolist() == [0, 1, -1, -1]


def test_a_row_has_all_of_a_cell(dataset):
    entries = {entry.name: entry for entry in row(dataset, {"mu": 3, "R": 20, "a": 0})}
    assert float(entries["mu"].value) == float(dataset.mu[3])
    assert entries["phi0"].value == "1"
    assert (entries["period"].value, entries["period"].unit) == ("nan", "s")
    assert entries["status"].value == Status.NEVER_STARTS.name


@pytest.mark.parametrize(
    ("wanted", "cells"),
    [
        ((10.0, 12.0), slice(7, 15)),
        ((12.0, 10.0), slice(7, 15)),
        ((10.5, 11.5), slice(8, 15)),
        ((2.0, 18.0), slice(0, 20)),
        ((-9.0, -8.0), slice(0, 3)),
        ((90.0, 91.0), slice(17, 20)),
        (None, slice(None)),
    ],
)
def test_a_range_cuts_an_axis_with_two_cells_more_on_both_sides(wanted, cells):
    assert slices._cut(np.arange(20.0), wanted) == cells


def test_an_axis_that_does_not_rise_is_not_cut():
    for grid in (np.arange(20.0)[::-1], np.array([1.0, 1.0, 2.0]), np.array(["a", "b"])):
        assert slices._cut(grid, (1.0, 2.0)) == slice(None)


def test_distances_are_shares_of_the_picture():
    np.testing.assert_allclose(slices._distance(np.array([1.0, 3.0, 5.0]), 2.0, False), [0.25, 0.25, 0.75])
    np.testing.assert_allclose(slices._distance(np.array([1.0, 10.0, 100.0]), 10.0, True), [0.5, 0.0, 0.5])
    np.testing.assert_allclose(
        slices._distance(np.array([[1.0, np.nan], [0.0, 100.0]]), 10.0, True), [[0.5, np.nan], [np.nan, 0.5]]
    )
    np.testing.assert_allclose(slices._distance(np.array([2.0, 2.0]), 5.0, False), [3.0, 3.0])


def points(x, y):
    """Points of a zip, along x."""
    places = {PLACE + "cell": ("cell", np.arange(len(x)))}
    return view(xr.Dataset({"y": ("cell", y)}, {"x": ("cell", x), **places}), x="x")


def test_of_points_the_nearest_as_the_eye_sees_it_is_clicked():
    found = points([1.0, 2.0, 3.0], [10.0, 30.0, 20.0])
    assert nearest(found, 2.4, 21.0, False, (False, False)) == {"cell": 2}
    assert nearest(found, 2.4, 29.0, False, (False, False)) == {"cell": 1}
    assert nearest(points([1.0, 2.0], [np.nan, np.nan]), 2.0, 1.0, False, (False, False)) == {"cell": 0}


def test_of_lines_without_a_value_the_first_is_clicked():
    found = xr.Dataset({"y": (("a", "x"), np.full((2, 3), np.nan))}, {"a": [1.0, 2.0], "x": [1.0, 2.0, 3.0]})
    places = {PLACE + d: (d, np.arange(found.sizes[d]) + 5) for d in ("a", "x")}
    shown_lines = view(found.assign_coords(places), x="x")
    assert nearest(shown_lines, 2.9, 1.0, False, (False, False)) == {"x": 7, "a": 5}


def test_the_outermost_edges_belong_to_the_outermost_cells():
    grid = np.array([1.0, 2.0, 3.0])
    at = np.array([0.5, 1.5, 2.5, 3.5, 0.4999, 3.5001])
    assert cell_numbers(grid, at).tolist() == [0, 1, 2, 2, -1, -1]


def test_axes_stand_before_other_coordinates_and_the_longest_first():
    coords = {"a": [1.0, 2.0], "b": [1.0, 2.0, 3.0], "c": ("b", [3, 2, 1]), "w": ["x", "y", "z", "u"]}
    ds = xr.Dataset({"y": (("a", "b", "w"), np.zeros((2, 3, 4))), "word": ("a", ["p", "q"]), "one": 1.0}, coords)
    assert number_axes(ds, "y") == ["b", "a", "c"]
    assert other_axes(ds, Choice("y", "c")) == ["a", "w"]
    assert outputs(ds) == ["y"]


def test_numbers_of_a_row_have_all_their_digits_and_flags_are_words():
    attrs = {"flag_values": [0, 1], "flag_meanings": "OK BAD"}
    columns = {
        "y": ("x", [0.1], {"units": "s", "long_name": "way"}),
        "n": ("x", [3], {"units": "1"}),
        "s": ("x", [1], attrs),
    }
    entries = row(xr.Dataset(columns, {"x": [2.0], PLACE + "x": ("x", [0])}), {"x": 0})
    assert [(e.name, e.value, e.unit, e.meaning) for e in entries] == [
        ("x", "2", "", ""), ("y", "0.10000000000000001", "s", "way"), ("n", "3", "", ""), ("s", "BAD", "", ""),
    ]  # fmt: skip
