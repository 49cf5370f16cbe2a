"""Cells that lie anywhere in a box: joined, interpolated, found on lines."""

import itertools

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import LinearNDInterpolator

from sweep.analysis import scattered
from sweep.analysis.mesh import simplices
from sweep.analysis.metric import stretch
from sweep.analysis.scattered import Box, axes_of, heights, interpolated, on_lines
from sweep.system.errors import SweepError


def cells(axes=2, inside=60, seed=0):
    """A grid of 5 values an axis, from 1 to 100, with more cells anywhere inside."""
    rng = np.random.default_rng(seed)
    grid = [m.ravel() for m in np.meshgrid(*[np.geomspace(1, 100, 5)] * axes, indexing="ij")]
    values = {n: np.concatenate([g, 100 ** rng.random(inside)]) for n, g in zip("abc", grid, strict=False)}
    y = 2.0 * np.prod([v**p for v, p in zip(values.values(), (0.5, -1, 2), strict=False)], axis=0)
    columns = {"y": ("cell", y, {"units": "s"}), "status": ("cell", np.zeros(y.size, np.int8))}
    return xr.Dataset(columns, {n: ("cell", v, {"units": "1"}) for n, v in values.items()})


@pytest.mark.parametrize("axes", [1, 2, 3, 4])
def test_simplices_fill_the_box_and_overlap_nowhere(axes):
    grid = np.meshgrid(*[np.linspace(0, 1, 4)] * axes)
    points = np.stack([g.ravel() for g in grid], axis=1)
    corners = points[simplices(points)]
    volume = abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / np.prod(np.arange(1, axes + 1))
    assert volume.sum() == pytest.approx(1.0, rel=1e-9)
    assert volume.min() > 0.9 * volume.mean()  # no slivers where corners lie on one sphere


def test_a_power_law_is_straight_and_so_interpolated_exactly():
    ds = cells()
    at = {"a": np.geomspace(1, 100, 7), "b": [2.0, 50.0]}
    found = interpolated(ds, at)
    assert found.y.dims == ("a", "b")
    np.testing.assert_allclose(found.y, 2 * at["a"][:, None] ** 0.5 / np.array(at["b"]), rtol=1e-12)
    assert found.y.attrs == {"units": "s"}


def test_between_cells_values_are_those_of_scipy():
    ds = cells(inside=200)
    ds["y"] = ("cell", np.sin(ds.a.values) + 0.1 * ds.b.values * np.cos(ds.b.values))
    x = {"a": np.geomspace(1.1, 90, 8), "b": np.geomspace(1.2, 95, 9)}
    found = interpolated(ds, x)
    places = np.log(np.stack([ds.a, ds.b], axis=1))
    rows = np.log(np.stack(np.meshgrid(x["a"], x["b"], indexing="ij"), axis=-1))
    tilt = stretch(places / np.log(100), heights(ds.y.values)) @ np.array([[1.0, 0.0], [0.013, 1.0]])
    truth = LinearNDInterpolator(places @ tilt, ds.y.values)(rows @ tilt)
    np.testing.assert_allclose(found.y, truth, rtol=1e-9, atol=1e-9)


def test_outside_and_beside_missing_cells_there_is_nothing():
    ds = cells()
    assert np.isnan(interpolated(ds, {"a": [0.5], "b": [2.0]}).y).all()
    ds["y"][0] = np.nan  # at 1, 1
    found = interpolated(ds, {"a": [1.001, 100.0], "b": [1.001, 100.0]})
    assert np.isnan(found.y[0, 0])
    assert np.isfinite(found.y[1, 1])


def test_only_cells_that_fill_a_box_are_taken_for_such():
    ds = cells()
    assert axes_of(ds) == ["a", "b"]
    assert axes_of(ds.isel(cell=slice(1, None))) == []  # a corner is missing
    assert axes_of(ds.assign_coords(b=("cell", ds.a.values))) == []  # a curve
    assert axes_of(ds.assign_coords(cell=np.arange(ds.sizes["cell"]))) == []  # the values of an axis
    with pytest.raises(SweepError, match="fill a box"):
        interpolated(ds.isel(cell=slice(1, None)), {"a": [1.0], "b": [1.0]})
    with pytest.raises(SweepError, match="expected values of a, b"):
        interpolated(ds, {"a": [1.0]})


def test_lines_hold_what_was_computed_and_nothing_else():
    ds = cells()
    found = on_lines(ds, "a")
    assert found.y.dims == ("b", "a")
    assert (found.sizes["b"], found.sizes["a"]) == (5, 5)
    np.testing.assert_array_equal(found.y.values.ravel(), ds.y.values[:25].reshape(5, 5).T.ravel())
    three = on_lines(cells(3), "c")
    assert three.y.dims == ("line", "c")
    assert str(three.line[1].item()) == "a = 1, b = 3.16228"
    assert on_lines(ds, "y") is ds
    with pytest.raises(SweepError, match=r"no 5 cells .* e.g. --at b=1.0 \(2 cells\)"):
        on_lines(ds.isel(cell=np.r_[0, 4, 20, 24, 30:85]), "a")


def test_lines_say_how_many_cells_lie_on_them_and_how_to_ask_for_others():
    ds = cells()
    assert on_lines(ds, "a").attrs["lines"] == (
        "25 of 85 cells lie on 5 lines from end to end of a; take one by --at, e.g. --at b=1.0 (5 cells); "
        "no shorter line has 5."
    )
    short = xr.concat(
        [ds.isel(cell=slice(0, 25)), ds.isel(cell=slice(30, 36)).assign(b=("cell", np.full(6, 7.0)))], "cell"
    )
    assert "or a shorter one, e.g. --at b=7.0 (6 cells)." in on_lines(short, "a").attrs["lines"]


def test_places_and_values_are_each_others_inverse():
    values = {"a": np.array([1.0, 10.0, 100.0]), "b": np.array([-1.0, 0.0, 1.0]), "c": np.array([2.0, 2.5, 3.0])}
    box = Box.of(values)
    assert box.logarithmic.tolist() == [True, False, False]
    points = box.points(values)
    np.testing.assert_allclose(points, np.array([[0, 0, 0], [0.5, 0.5, 0.5], [1, 1, 1]]), atol=1e-15)
    for k, column in enumerate(values.values()):
        np.testing.assert_allclose(box.values(k, points[:, k]), column, rtol=1e-14, atol=1e-15)


def test_heights_are_logarithms_or_shares():
    np.testing.assert_allclose(heights(np.array([1.0, np.e, np.nan])), [0, 1, np.nan])
    np.testing.assert_allclose(heights(np.array([-1.0, 4.0, 0.0])), [-0.25, 1, 0])
    np.testing.assert_allclose(heights(np.zeros(2)), 0)


# the pieces, each against its formula written another way


@pytest.mark.parametrize(
    ("low", "high", "logarithmic"),
    [(1.0, 1.999, True), (1.0, 1.9989, False), (0.0, 10.0, False), (1e-9, 1.0, True), (-2.0, -1.0, False)],
)
def test_a_positive_axis_to_twice_its_start_is_logarithmic(low, high, logarithmic):
    box = Box.of({"a": np.array([low, high])})
    assert box.logarithmic.tolist() == [logarithmic]
    middle = np.sqrt(low * high) if logarithmic else (low + high) / 2
    assert box.points({"a": np.array([middle])})[0, 0] == pytest.approx(0.5, rel=1e-9)
    assert box.values(0, np.array([0.5]))[0] == pytest.approx(middle, rel=1e-9)


def test_shares_of_corners_are_barycentric_coordinates():
    rng = np.random.default_rng(3)
    points, at = rng.random((30, 2)), rng.uniform(0.3, 0.7, (20, 2))
    corners, shares = scattered.located(points, at)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=1e-12)
    assert (shares >= 0).all()
    np.testing.assert_allclose(np.einsum("nk,nkd->nd", shares, points[corners]), at, atol=1e-12)
    assert np.isnan(scattered.located(points, np.array([[2.0, 0.5]]))[1]).all()


def test_points_out_of_a_simplex_by_rounding_are_in_it():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    near, far = scattered.located(square, np.array([[0.5, -0.5e-9], [0.5, -1e-7]]))[1]
    assert near.tolist() == [share if share == 0 else pytest.approx(0.5, abs=0.01) for share in near]
    assert (near == 0).sum() == 1  # what is less than rounding is none
    assert np.isnan(far).all()


@pytest.mark.parametrize(("axes", "taken"), [(1, False), (2, True), (5, True), (6, False)])
def test_boxes_have_two_to_five_axes(axes, taken):
    corners = np.array(list(itertools.product([1.0, 3.0], repeat=axes)))
    names = list("abcdef"[:axes])
    coords = {name: ("cell", column) for name, column in zip(names, corners.T, strict=True)}
    ds = xr.Dataset({"status": ("cell", np.zeros(len(corners), np.int8))}, coords)
    assert axes_of(ds) == (names if taken else [])
    assert axes_of(ds.assign_coords(fixed=("cell", np.ones(len(corners))))) == (names if taken else [])
    assert axes_of(ds.drop_vars("status")) == []


@pytest.mark.parametrize(("number", "lines"), [(4, 0), (5, 3)])
def test_lines_have_five_cells_and_reach_from_end_to_end(number, lines):
    """Three lines of so many cells, one that stops short of each end, and one cell beside."""
    whole = np.geomspace(1, 100, number)
    a = np.concatenate([np.tile(whole, 3), np.linspace(1, 99, 6), np.linspace(2, 100, 6), [5.0]])
    b = np.concatenate([np.repeat([1.0, 3.0, 100.0], number), np.full(6, 5.0), np.full(6, 7.0), [9.0]])
    ds = xr.Dataset(
        {"y": ("cell", a * b), "status": ("cell", np.zeros(a.size, np.int8))}, {"a": ("cell", a), "b": ("cell", b)}
    )
    if not lines:
        with pytest.raises(SweepError, match=r"no 5 cells lie on one line from end to end of it; .* \(6 cells\)"):
            on_lines(ds, "a")
        return
    found = on_lines(ds, "a")
    assert found.b.values.tolist() == [1.0, 3.0, 100.0]
    np.testing.assert_array_equal(found.y, whole * np.array([[1.0], [3.0], [100.0]]))
    assert found.attrs["lines"].startswith("15 of 28 cells lie on 3 lines")
