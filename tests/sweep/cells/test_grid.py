"""Cells from axes: against numpy's own meshgrid, for any range of cells."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_studies import build, build_rich

from sweep.cells.grid import Grid, empty_cells


def grid_of(lengths, design="product"):
    """A grid over the toy's three parameters, in an order that is not the kernel's; every value is unique."""
    names = ["g", "height", "v0"]
    axes = {name: (10.0**k * np.arange(1, n + 1)) for k, (name, n) in enumerate(zip(names, lengths, strict=False))}
    fixed = {} if len(lengths) > 1 else {"height": 2.0}
    return Grid(build(axes=axes, fixed=fixed, design=design))


def columns_of(grid, start, stop):
    out = [np.full(stop - start + 3, -1.0) for _ in grid.study.kernel.parameters]
    grid.columns(start, stop, out)
    for k, value in grid.constants().items():
        out[k][: stop - start] = value
    assert all((column[stop - start :] == -1).all() for column in out), "cells beyond the range were written"
    return {p.name: column[: stop - start] for p, column in zip(grid.study.kernel.parameters, out, strict=True)}


def expected_columns(grid):
    axes = grid.study.axes
    full = np.meshgrid(*(a.values for a in axes.values()), indexing="ij")
    columns = {name: array.ravel() for name, array in zip(axes, full, strict=True)}
    return {
        p.name: columns.get(p.name, np.full(grid.size, grid.study.fixed.get(p.name)))
        for p in grid.study.kernel.parameters
    }


@st.composite
def grids_and_ranges(draw):
    lengths = draw(st.lists(st.sampled_from([1, 2, 3, 5, 16, 17, 40]), min_size=1, max_size=3))
    size = math.prod(lengths)
    start = draw(st.integers(0, size))
    return lengths, start, draw(st.integers(start, size))


@given(grids_and_ranges())
def test_columns_are_the_mesh_of_the_axes_in_c_order(case):
    lengths, start, stop = case
    grid = grid_of(lengths)
    assert grid.size == math.prod(lengths)
    found, expected = columns_of(grid, start, stop), expected_columns(grid)
    for name in found:
        np.testing.assert_array_equal(found[name], expected[name][start:stop])


@given(grids_and_ranges())
def test_pieces_are_hyperslabs_that_fill_the_range_and_nothing_else(case):
    lengths, start, stop = case
    grid = grid_of(lengths)
    pieces = grid.pieces(start, stop)
    assert len(pieces) <= max(2 * len(lengths) - 1, 1)
    written = np.full(grid.shape, -1)
    block = np.arange(start, stop)
    for slices, sub_start, sub_stop in pieces:
        assert (written[slices] == -1).all()
        written[slices] = block[sub_start:sub_stop].reshape(written[slices].shape)
    expected = np.full(grid.size, -1)
    expected[start:stop] = block
    np.testing.assert_array_equal(written.ravel(), expected)


def test_a_range_across_two_rows_of_a_deep_grid_takes_all_five_pieces():
    pieces = grid_of([3, 4, 5]).pieces(7, 53)
    assert len(pieces) == 5
    assert [(a, b) for _, a, b in pieces] == [(0, 3), (3, 13), (13, 33), (33, 43), (43, 46)]


def test_dims_and_shape_of_a_product_follow_the_study():
    grid = grid_of([3, 4, 5])
    assert (grid.dims, grid.shape, grid.size) == (("g", "height", "v0"), (3, 4, 5), 60)


def test_a_zip_has_one_dimension_of_cells():
    grid = grid_of([7, 7, 7], "zip")
    assert (grid.dims, grid.shape, grid.size) == (("cell",), (7,), 7)
    found = columns_of(grid, 2, 6)
    np.testing.assert_array_equal(found["g"], [3, 4, 5, 6])
    np.testing.assert_array_equal(found["v0"], [300, 400, 500, 600])
    assert grid.pieces(2, 6) == [((slice(2, 6),), 0, 4)]


def test_constants_are_the_columns_that_no_axis_fills():
    grid = Grid(build(axes={"height": [1.0, 2.0]}, fixed={"v0": 0.5}))
    assert grid.constants() == {1: 0.5, 2: 9.80665}


def test_settings_are_one_number_where_no_axis_varies_them():
    study = build(axes={"height": [1.0, 2.0]}, method="exact", rtol=1e-5)
    assert Grid(study).settings(0, 2) == (1, 1e-5)
    assert Grid(build(axes={"height": [1.0]})).settings(0, 1) == (-1, 1e-9)


def test_settings_of_axes_come_per_cell_or_as_one_number_where_all_cells_agree():
    grid = Grid(build(axes={"method": ["exact", "auto", "rough"], "rtol": [1e-3, 1e-6], "height": [1.0, 2.0]}))
    method, rtol = grid.settings(0, 12)
    assert method.dtype == np.int8
    np.testing.assert_array_equal(method, [1] * 4 + [-1] * 4 + [0] * 4)
    np.testing.assert_array_equal(rtol, [1e-3, 1e-3, 1e-6, 1e-6] * 3)
    assert grid.settings(4, 6) == (-1, 1e-3)
    method, rtol = grid.settings(6, 9)
    np.testing.assert_array_equal(method, [-1, -1, 0])
    np.testing.assert_array_equal(rtol, [1e-6, 1e-6, 1e-3])


def test_a_cell_is_told_by_its_values():
    grid = Grid(build(axes={"method": ["exact", "auto"], "height": [1.0, 0.1, 1 / 3]}))
    assert grid.cell(5) == {"method": "auto", "height": "0.333333"}
    assert grid.cell(1) == {"method": "exact", "height": "0.1"}


def test_an_empty_range_has_no_pieces_and_writes_nothing():
    grid = grid_of([3, 4])
    assert grid.pieces(5, 5) == []
    columns_of(grid, 5, 5)


@pytest.mark.parametrize("lengths", [[10**6, 10**6], [3, 10**6, 100]])
def test_a_far_range_of_a_huge_grid_is_found_without_making_the_grid(lengths):
    grid = grid_of(lengths)
    start = grid.size - 5
    found = columns_of(grid, start, grid.size)
    index = np.unravel_index(np.arange(start, grid.size), grid.shape)
    for name, positions in zip(grid.study.axes, index, strict=True):
        np.testing.assert_array_equal(found[name], grid.study.axes[name].values[positions])


def test_cells_are_asked_for_where_the_condition_holds():
    axes, some = {"height": [1.0, 2.0, 3.0], "v0": [0.0, 1.0]}, np.array([5, 0, 3, 2])
    assert Grid(build(axes=axes)).asked(some).tolist() == [True] * 4
    assert Grid(build(axes=axes, where="height > 1.5 and v0 < 0.5")).asked(some).tolist() == [False, False, False, True]
    # of a parameter that is the same in all cells, and of a setting
    assert Grid(build(axes=axes, where="g > 9")).asked(some).tolist() == [True] * 4
    assert Grid(build(axes=axes, where="g < 9")).asked(some).tolist() == [False] * 4


def test_a_parameter_that_follows_an_axis_has_its_values():
    grid = Grid(build_rich(axes={"load": [1.0, 2.0, 3.0]}))
    out = [np.full(3, -1.0) for _ in grid.study.kernel.parameters]
    grid.columns(0, 3, out)
    names = [p.name for p in grid.study.kernel.parameters]
    for name in ("load", "grip", "hold"):
        assert out[names.index(name)].tolist() == [1.0, 2.0, 3.0]
    assert grid.constants() == {names.index("shape"): 0.0, names.index("drag"): 0.0}
    assert grid.values("load", np.array([2, 0])).tolist() == [3.0, 1.0]


def test_rows_of_cells_are_views_of_them():
    cells = empty_cells(build(axes={"height": [1.0]}, outputs=["drop"], along={"phase": [0.0, 1.0]}), 5)
    assert (cells.number, cells.outputs["drop"].shape, cells.status.dtype, cells.used.dtype) == (5, (5, 2), "i1", "i1")
    some = cells._replace(error=np.zeros(5, "f4")).rows(slice(1, 3))
    some.status[:], some.used[:], some.outputs["drop"][:] = 7, 8, 9.0
    assert (some.number, some.error.shape) == (2, (2,))
    assert cells.status[1:3].tolist() == [7, 7]
    assert cells.outputs["drop"][1:3].tolist() == [[9.0, 9.0]] * 2
    assert cells.rows(slice(0, 1)).error is None


def test_an_axis_of_arrays_gives_each_cell_its_own():
    masses = np.arange(1.0, 7.0).reshape(3, 2)
    grid = Grid(
        build(kernel="beads:KERNEL", outputs=["total"], axes={"mass": masses, "g": [1.0, 2.0, 3.0]}, design="zip")
    )
    out = [np.full((4, 2), -1.0), np.full((4, 2), -1.0), np.full(4, -1.0)]
    grid.columns(1, 3, out)
    assert out[0].tolist() == [[3.0, 4.0], [5.0, 6.0], [-1.0, -1.0], [-1.0, -1.0]]
    assert out[2].tolist() == [2.0, 3.0, -1.0, -1.0]
