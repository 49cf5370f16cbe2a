"""What lies between cells: borders on maps, values inside a box of scattered cells, lines in it, and their errors."""

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import LinearNDInterpolator

import sweep
from sweep.explore.mesh import stretch
from sweep.explore.scattered import axes_of, heights, on_lines

MU, A = np.geomspace(1e-3, 1e3, 121), np.geomspace(0.1, 10, 41)


def period():
    """1/x + x^(-1/3) of x = mu/a: regimes meet along straight lines mu ~ a."""
    x = MU[:, None] / A
    coords = {"mu": ("mu", MU, {"units": "rad/s^2"}), "a": ("a", A, {"units": "1/s"})}
    return xr.DataArray(1 / x + x ** (-1 / 3), coords, ("mu", "a"), name="period")


# borders on maps


def test_lines_of_an_exponent_are_where_theory_has_them():
    """The exponent -(1/x + x^(-1/3)/3)/(1/x + x^(-1/3)) is -1/2 where x^(2/3) = 3; -1 and -1/3 are only tended to."""
    found = sweep.exponent_map(period(), "mu")
    assert found.exponent.dims == ("mu", "a")
    np.testing.assert_allclose(np.unique(found.level), [-0.5], rtol=1e-12)
    assert sweep.exponent_map(period(), "mu", -0.5).sizes["point"] == found.sizes["point"]
    np.testing.assert_allclose(found.mu_on_border / found.a_on_border, 3**1.5, rtol=2e-3)
    assert set(found.line.values) == {0}
    assert (float(found.a_on_border.min()), float(found.a_on_border.max())) == pytest.approx((0.1, 10))
    assert found.mu_on_border.attrs["units"] == "rad/s^2"


@pytest.mark.parametrize("logarithmic", [(True, False), (False, False), (True, True), (False, True)])
def test_each_axis_is_interpolated_as_its_grid_is_spaced(logarithmic):
    """The exponent of exp(u^2/2) is u where u = ln x, and that of exp(x) is x."""
    grids = [np.geomspace(1, 1e4, 9) if take else np.linspace(3, 9, 40) for take in logarithmic]
    u, v = (np.log(g) if take else g for g, take in zip(grids, logarithmic, strict=True))
    z = (u**2 / 2 if logarithmic[0] else u)[:, None] - 0.7 * v * np.log(grids[0])[:, None]
    y = xr.DataArray(np.exp(z), dict(zip("xy", grids, strict=True)), ("x", "y"))
    found = sweep.exponent_map(y, "x", (0.3, 1.4, 1e9))
    assert set(found.level.values) == {0.3, 1.4}
    borders = ("x_on_border", "y_on_border")
    x, y = (np.log(found[n]) if take else found[n] for n, take in zip(borders, logarithmic, strict=True))
    np.testing.assert_allclose(x - 0.7 * y, found.level, atol=1e-9 if logarithmic[0] else 1e-4)
    np.testing.assert_array_equal(found.line == 0, found.level == 0.3)


def test_no_line_crosses_what_has_no_value():
    found = sweep.exponent_map(period().where(abs(np.log(period().a)) > 0.5), "mu", (-0.5,))
    assert len(set(found.line.values)) == 2
    assert not ((found.a_on_border > 0.7) & (found.a_on_border < 1.4)).any()
    assert sweep.exponent_map(period(), "mu", (1e9,)).sizes["point"] == 0


def test_what_is_no_map_is_refused():
    y = period()[:9, :2]
    sweep.exponent_map(y, "mu")  # two values of the other axis are enough
    for wrong, message in (
        (y[:, 0], "1 dimensions"),
        (y.expand_dims("t"), "3 dimensions"),
        (y[:, :1], "a has no two numbers"),
        (y.assign_coords(a=["a", "b"]), "a has no two numbers"),
        (y.drop_vars("a"), "a has no two numbers"),
    ):
        with pytest.raises(sweep.SweepError, match=message):
            sweep.exponent_map(wrong, "mu")


# values inside a box


def cells(axes=2, inside=60, seed=0):
    """A grid of 5 values an axis, from 1 to 100, with more cells anywhere inside; y is a power law."""
    rng = np.random.default_rng(seed)
    grid = [m.ravel() for m in np.meshgrid(*[np.geomspace(1, 100, 5)] * axes, indexing="ij")]
    values = {n: np.concatenate([g, 100 ** rng.random(inside)]) for n, g in zip("abc", grid, strict=False)}
    y = 2.0 * np.prod([v**p for v, p in zip(values.values(), (0.5, -1, 2), strict=False)], axis=0)
    columns = {"y": ("cell", y, {"units": "s"}), "status": ("cell", np.zeros(y.size, np.int8))}
    return xr.Dataset(columns, {n: ("cell", v, {"units": "1"}) for n, v in values.items()})


def test_a_power_law_is_straight_and_so_interpolated_exactly():
    at = {"a": np.geomspace(1, 100, 7), "b": [2.0, 50.0]}
    found = sweep.interpolated(cells(), at)
    assert found.y.dims == ("a", "b")
    np.testing.assert_allclose(found.y, 2 * at["a"][:, None] ** 0.5 / np.array(at["b"]), rtol=1e-12)
    assert found.y.attrs == {"units": "s"}
    ds, in_mm = cells(), xr.DataArray(1000.0 * at["a"], attrs={"units": "mm"})
    ds.a.attrs["units"] = "m"
    np.testing.assert_allclose(sweep.interpolated(ds, {**at, "a": in_mm}).y, found.y, rtol=1e-12)
    for values, word in ((["x"], "numbers"), ([np.nan], "finite"), ([-1.0], "above 0"), (2.0, "a list")):
        with pytest.raises(sweep.SweepError, match=f"at: expected .*{word}"):
            sweep.interpolated(ds, {**at, "a": values})


def test_between_cells_values_are_those_of_scipy():
    ds = cells(inside=200)
    ds["y"] = ("cell", np.sin(ds.a.values) + 0.1 * ds.b.values * np.cos(ds.b.values))
    x = {"a": np.geomspace(1.1, 90, 8), "b": np.geomspace(1.2, 95, 9)}
    places = np.log(np.stack([ds.a, ds.b], axis=1))
    rows = np.log(np.stack(np.meshgrid(x["a"], x["b"], indexing="ij"), axis=-1))
    tilt = stretch(places / np.log(100), heights(ds.y.values)) @ np.array([[1.0, 0.0], [0.013, 1.0]])
    truth = LinearNDInterpolator(places @ tilt, ds.y.values)(rows @ tilt)
    np.testing.assert_allclose(sweep.interpolated(ds, x).y, truth, rtol=1e-9, atol=1e-9)


def test_outside_and_beside_missing_cells_there_is_nothing_and_at_cells_their_value():
    ds = cells()
    assert np.isnan(sweep.interpolated(ds, {"a": [0.5], "b": [2.0]}).y).all()
    edge = sweep.interpolated(ds, {"a": [1.0 - 1e-12, 1.0 - 1e-3], "b": [2.0]}).y  # out by rounding, and by more
    assert np.isfinite(edge[0, 0])
    assert np.isnan(edge[1, 0])
    ds["y"][0] = np.nan  # at 1, 1
    found = sweep.interpolated(ds, {"a": [1.001, 100.0], "b": [1.001, 100.0]})
    assert np.isnan(found.y[0, 0])
    assert float(found.y[1, 1]) == pytest.approx(float(ds.y[24]), rel=1e-12, abs=0.0)
    # a cell has its value also in a simplex with the missing one
    ds, grid = cells(inside=0), np.geomspace(1, 100, 5)
    ds["y"][12] = np.nan
    np.testing.assert_allclose(sweep.interpolated(ds, {"a": grid, "b": grid}).y.values.ravel(), ds.y, rtol=1e-12)


def test_only_cells_that_fill_a_box_are_taken_for_such():
    ds = cells()
    without_corner, curve = ds.isel(cell=slice(1, None)), ds.assign_coords(b=("cell", ds.a.values))
    for wrong in (without_corner, curve, ds.assign_coords(cell=np.arange(ds.sizes["cell"]))):
        assert axes_of(wrong) == []
        with pytest.raises(sweep.SweepError, match="fill a box"):
            sweep.interpolated(wrong, {"a": [1.0], "b": [1.0]})
    with pytest.raises(sweep.SweepError, match="of a, b"):
        sweep.interpolated(ds, {"a": [1.0]})


def test_lines_hold_what_was_computed_and_say_how_to_ask_for_others():
    ds = cells()
    found = on_lines(ds, "a")
    assert (found.y.dims, found.sizes["b"], found.sizes["a"]) == (("b", "a"), 5, 5)
    np.testing.assert_array_equal(found.y.values.ravel(), ds.y.values[:25].reshape(5, 5).T.ravel())
    assert "25 of 85 cells lie on 5 lines" in found.attrs["lines"]
    assert "--at b=1.0 (5 cells)" in found.attrs["lines"]
    # of the first line the ends alone are there
    later = ds.isel(cell=np.flatnonzero((ds.b > 1) | (ds.a == 1) | (ds.a == 100)))
    xr.testing.assert_equal(on_lines(later, "a").y, found.y[1:])
    three = on_lines(cells(3), "c")
    assert three.y.dims == ("line", "c")
    assert str(three.line[1].item()) == "a = 1, b = 3.16228"
    assert on_lines(ds, "y") is ds
    short = xr.concat(
        [ds.isel(cell=slice(0, 25)), ds.isel(cell=slice(30, 36)).assign(b=("cell", np.full(6, 7.0)))], "cell"
    )
    assert "--at b=7.0 (6 cells)" in on_lines(short, "a").attrs["lines"]
    for ends in ((1.0, 99.0), (2.0, 100.0)):  # a line that stops short of an end
        one_end = short.assign(a=("cell", np.r_[short.a[:25], np.linspace(*ends, 6)]))
        assert on_lines(one_end, "a").sizes["b"] == 5
    with pytest.raises(sweep.SweepError, match=r"b=1.0 \(2 cells"):
        on_lines(ds.isel(cell=np.r_[0, 4, 20, 24, 30:85]), "a")
