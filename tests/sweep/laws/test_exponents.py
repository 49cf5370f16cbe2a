"""Local exponents, and where a curve or its exponent passes a value, on curves whose answers are known."""

import functools

import numpy as np
import pytest
import xarray as xr
from numpy.polynomial import Polynomial

import sweep


def curve(x, y, dim="mu", **attrs):
    return xr.DataArray(y, dims=dim, coords={dim: (dim, x, {"units": "rad/s^2"})}, name="period", attrs=attrs)


def bend(x):
    """y = 1/x + x^(-1/3): exponent sliding from -1 to -1/3, known exactly."""
    return 1 / x + x ** (-1 / 3)


def bend_exponent(x):
    return -(1 / x + x ** (-1 / 3) / 3) / bend(x)


def grid(low=-6, high=6, per_decade=40):
    return np.logspace(low, high, (high - low) * per_decade + 1)


# local exponents


def derivative(t, points):
    """Matrix that takes values to slopes of polynomials through `points` neighbours, half of them before."""
    points = min(points, t.size)
    found = np.zeros((t.size, t.size))
    for i, here in enumerate(t):
        first = min(max(i - points // 2, 0), t.size - points)
        near = slice(first, first + points)
        powers = (t[near, None] - here) ** np.arange(points)
        found[i, near] = np.linalg.inv(powers)[1]
    return found


def test_the_sliding_exponent_is_right_at_the_study_spacing_ends_included():
    off = abs(sweep.local_exponent(curve(grid(), bend(grid())), "mu") - bend_exponent(grid()))
    assert off.max() < 2e-7
    assert off[[0, 1, -2, -1]].max() < 1e-9


def test_on_any_grid_slopes_are_those_of_polynomials_through_five_neighbours_of_an_unbroken_run():
    """Runs of 2, 3, 1 and 5 points: fewer than three have no slope, and no stencil reaches across a gap."""
    t = np.linspace(-1.0, 1.0, 14) + 0.02 * np.sin(5.0 * np.arange(14))
    z = np.random.default_rng(5).standard_normal((3, 14))
    z[0, [2, 6, 8]], z[2, [2, 6, 8]] = np.nan, np.nan
    expected = z @ derivative(t, 5).T
    for row in (0, 2):
        expected[row] = np.nan
        for here in (slice(3, 6), slice(9, 14)):
            expected[row, here] = derivative(t[here], 5) @ z[row, here]
    y = xr.DataArray(np.exp(z), {"mu": np.exp(t)}, ("set", "mu"), name="period")
    y[1, 3] *= -1
    found = sweep.local_exponent(y.transpose("mu", "set"), "mu", error=True)
    assert found.exponent.dims == ("mu", "set")
    np.testing.assert_allclose(found.exponent.T[::2], expected[::2], rtol=1e-8, atol=1e-10)
    assert np.flatnonzero(found.exponent[:, 1].isnull()).tolist() == [3]
    np.testing.assert_array_equal(found.exponent.isnull(), found.exponent_error.isnull())


def test_a_coordinate_along_the_cells_of_a_zip_design_and_an_array_in_pieces_will_do():
    x = grid(-1, 1)
    y = xr.DataArray(x**-0.5, dims="cell", coords={"mu": ("cell", x), "a": ("cell", x**2)}, name="period")
    np.testing.assert_allclose(sweep.local_exponent(y, "mu"), -0.5, atol=1e-12)
    np.testing.assert_allclose(sweep.local_exponent(y, "a"), -0.25, atol=1e-12)
    assert sweep.local_exponent(y, "a").dims == ("cell",)
    y = curve(x, bend(x))
    np.testing.assert_array_equal(sweep.local_exponent(y.chunk({"mu": 7}), "mu"), sweep.local_exponent(y, "mu"))


@pytest.mark.parametrize(
    ("x", "dim", "message"),
    [
        ([1.0, 2.0, 3.0], "mu_", "did you mean mu?"),
        ([1.0, 2.0, 3.0], "phase", "runs along mu"),
        ([1.0, 2.0, 3.0], np.ones(3), "expected a name"),
        ([0.0, 2.0, 3.0], "mu", "found 0"),
        ([-1.0, 2.0, 3.0], "mu", "found -1"),
        ([1.0, np.inf, 3.0], "mu", "finite"),
        ([1.0, 3.0, 2.0], "mu", "sort first"),
        ([1.0, 1.0, 2.0], "mu", "1 stands there more than once"),
        ([1.0, 2.0], "mu", "at least 3 points"),
        (["map", "closed", "auto"], "mu", "words"),
        ([False, True, True], "mu", "bool values such as False"),
        (xr.date_range("2026", periods=3, use_cftime=True).values, "mu", "holds times"),
        (np.array(["2026-01-01", "2026-01-02", "2026-01-03"], "M8[ns]"), "mu", "holds times"),
    ],
)
def test_an_axis_that_has_no_logarithms_is_refused_with_the_reason(x, dim, message):
    y = curve(x, np.arange(1.0, len(x) + 1))
    repeated = list(x) == [1.0, 1.0, 2.0]  # which a line may have
    passes = functools.partial(sweep.where_exponent, value=1.5, values=True)
    for fit in (sweep.local_exponent, sweep.fit_exponent, passes)[:: 1 + repeated]:
        with pytest.raises(sweep.SweepError, match=message.replace("?", r"\?")):
            fit(y, dim)


def test_numbers_have_units_and_names_and_further_axes_keep_theirs():
    x = grid(-2, 2)
    y = curve(x, bend(x)) * xr.DataArray([1.0, 2.0], dims="R", coords={"R": ("R", [1.0, 2.0], {"units": "m"})})
    y = y.rename("period").assign_attrs(units="s")
    met = sweep.fit_two_laws(y, "mu", windows=((None, 0.5), (2, None)))
    fit, place = sweep.fit_exponent(y, "mu", (None, 0.5)), sweep.where_exponent(y, "mu", -0.5)
    local = sweep.local_exponent(y, "mu")
    for found in (local, fit, met, place, sweep.fit_two_laws(y[::8], "mu")):
        assert found.R.attrs == {"units": "m"}
    units = {"exponent": "1", "low": "rad/s^2", "start": "s", "level": "s", "centre": "rad/s^2"}
    assert {name: fit[name].attrs["units"] for name in units} == units
    assert all(variable.attrs["long_name"] for variable in fit.data_vars.values())
    assert [fit[f"exponent_{end}"].attrs["long_name"].split()[0] for end in ("low", "high")] == ["low", "high"]
    assert {"exponent_high", "crossover_high"} < set(met.attrs["summary"].split())
    assert sweep.fit_two_laws(y[::8], "mu").attrs["summary"].splitlines()[1].split()[:2] == ["low", "1"]
    for found in (fit, met, sweep.fit_two_laws(y[::8], "mu"), sweep.compare_laws(y[::8, 0], "mu")):
        assert len(found.to_netcdf())  # attributes are such as files can hold
    assert (local.attrs["units"], local.mu.attrs["units"], local.name) == ("1", "rad/s^2", "period_exponent")
    assert {place.abscissa.attrs["units"], place.abscissa_error.attrs["units"]} == {"rad/s^2"}
    # what is given in another unit is converted
    half, two = (xr.DataArray(of, attrs={"units": "mrad/s^2"}) for of in (500.0, 2000.0))
    second, passed = xr.DataArray(1500.0, attrs={"units": "ms"}), functools.partial(sweep.where_exponent, y, "mu")
    xr.testing.assert_identical(sweep.fit_two_laws(y, "mu", windows=((None, half), (two, None))), met)
    xr.testing.assert_identical(passed(second, values=True), passed(1.5, values=True))
    xr.testing.assert_identical(sweep.fit_exponent(y, "mu", sigma=second), sweep.fit_exponent(y, "mu", sigma=1.5))
    with pytest.raises(sweep.SweepError, match='window: "ms" is a time'):
        passed(-0.5, (second, None))
    assert (met.crossover.attrs["units"], met.level.attrs["units"]) == ("rad/s^2", "s")


# where a curve passes a value


def passing(x, y, value, window=None):
    return sweep.where_exponent(curve(x, y), "mu", value, window, values=True)


@pytest.mark.parametrize("value", [-0.9, -0.7, -0.5, -0.4])
def test_a_curve_and_an_exponent_pass_a_value_within_the_estimated_error(value):
    truth = ((value + 1) / (-1 / 3 - value)) ** 1.5  # (1/x + x^(-1/3)/3) = -value (1/x + x^(-1/3))
    x = grid(-3, 3, 8)
    found = passing(x, bend_exponent(x), value)
    assert abs(float(found.abscissa) - truth) < float(found.abscissa_error) < 0.02 * truth
    x = grid(-3, 3)
    found = sweep.where_exponent(curve(x, bend(x)), "mu", value)
    assert abs(float(found.abscissa) - truth) < float(found.abscissa_error) < 1e-5 * truth


@pytest.mark.parametrize("bracket", range(9))
def test_the_place_is_that_of_the_polynomial_through_six_neighbours_of_its_run(bracket):
    """A polynomial of degree five is passed exactly, next to the ends too; of fewer points the degree is lower."""
    t = np.linspace(-1.0, 1.0, 10) + 0.02 * np.sin(5.0 * np.arange(10))
    rise = Polynomial([0.1, 1.0, 0.3, 0.2, -0.05, 0.1])
    place = 0.7 * t[bracket] + 0.3 * t[bracket + 1]
    for sign in (1, -1):
        found = passing(np.exp(t), sign * rise(t), sign * rise(place))
        assert np.log(float(found.abscissa)) == pytest.approx(place, abs=1e-12)
    line = rise(t)
    line[[0, 2, 6]] = np.nan  # a run of three points beside a run of one
    line[1], line[7:] = 50.0, 60.0
    parabola = Polynomial.fit(t[3:6], line[3:6], 2) - line[3:5].mean()
    (expected,) = (r for r in parabola.roots() if t[3] < r < t[4])
    assert np.log(float(passing(np.exp(t), line, line[3:5].mean()).abscissa)) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("c", "expected"),
    [
        ([0, 2, 3], [0.5]),
        ([2, 0, -1], [0.5]),
        ([0, 1, 2], [1]),  # met at a point: once
        ([1, 2, 3], [0]),  # met at the ends
        ([1, 0, -1], [0]),
        ([3, 2, 1], [2]),
        ([-1, 0, 1], [2]),
        ([2, 1, 2], []),  # touched from above
        ([2, 3, 4], []),
        ([0, 0, 0], []),
        ([1, 1, 0], [1]),  # level where it is met: no place at the end that it stays at
        ([0.5, 1, 1], [1]),
        ([1, 1, 2], []),
        ([1, 1, np.nan, 2], []),
        ([1, 1, np.nan, 0, 2], [3.5]),
        ([np.nan, 1, 2], [1]),
        ([0, np.nan, 2], []),  # a passage inside a gap is not made up
        ([0, 2, 0, 2], [0, 1, 2]),
        ([0, 2, np.inf], [0.5]),
    ],
)
def test_a_curve_that_passes_a_value_nowhere_or_more_than_once_is_refused_with_the_count(c, expected):
    x = np.exp(np.arange(len(c), dtype=float))
    if len(expected) == 1:
        assert abs(np.log(float(passing(x, np.array(c, float), 1.0).abscissa)) - expected[0]) < 0.2
        return
    with pytest.raises(sweep.SweepError, match=f"{len(expected)} times" if expected else "does not pass 1"):
        passing(x, np.array(c, float), 1.0)


def test_a_window_picks_one_of_two_places_and_limits_not_what_is_differentiated():
    x = grid(-1, 1)
    for window, sign in (((1, None), 1), ((None, 1), -1)):
        place = float(passing(x, np.log(x) ** 2, 0.5, window).abscissa)
        assert place == pytest.approx(np.exp(sign * 0.5**0.5), rel=1e-6)
    whole = sweep.where_exponent(curve(x, bend(x)), "mu", -0.6)
    place = float(whole.abscissa)
    part = sweep.where_exponent(curve(x, bend(x)), "mu", -0.6, (x[x < place][-1], x[x > place][0]))
    assert (float(part.abscissa), part.abscissa_error.item()) == (place, whole.abscissa_error.item())


def test_each_line_has_its_own_place_and_those_without_one_are_nan():
    x = grid(-1, 1)
    c = xr.DataArray([x, 2 * x, 0 * x, abs(np.log(x))], dims=("law", "mu"), coords={"mu": x}, name="period")
    found = sweep.where_exponent(c, "mu", 0.5, values=True)
    np.testing.assert_allclose(found.abscissa, [0.5, 0.25, np.nan, np.nan], rtol=1e-8)
    assert np.isnan(found.abscissa_error).values.tolist() == [False, False, True, True]
    xr.testing.assert_identical(found, sweep.where_exponent(c, "mu", xr.DataArray(0.5), values=True))
    assert float(passing(x, x, float(x[7])).abscissa) == pytest.approx(x[7], rel=1e-14, abs=0.0)
