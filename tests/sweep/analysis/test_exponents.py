"""Exponents, lines, crossovers and passages, on curves whose answers are known in closed form."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from sweep.analysis.exponents import (
    crossover,
    fit_exponent,
    local_exponent,
    local_exponent_error,
    where_exponent,
    where_value,
)
from sweep.analysis.lines import KIND_WORDS
from sweep.system.errors import SweepError

PER_DECADE = 40


def curve(x, y, dim="mu", **attrs):
    return xr.DataArray(y, dims=dim, coords={dim: (dim, x, {"units": "rad/s^2"})}, name="period", attrs=attrs)


def bend(x):
    """y = 1/x + x^(-1/3): exponent sliding from -1 to -1/3, known exactly, the two laws meeting at x = 1."""
    return 1 / x + x ** (-1 / 3)


def bend_exponent(x):
    return -(1 / x + x ** (-1 / 3) / 3) / bend(x)


def grid(low=-6, high=6, per_decade=PER_DECADE):
    return np.logspace(low, high, (high - low) * per_decade + 1)


# local exponent


@given(st.floats(-5, 5), st.floats(1e-5, 1e5), st.integers(3, 30))
def test_a_power_law_has_its_exponent_everywhere(power, prefactor, points):
    x = np.geomspace(1e-3, 1e3, points)
    found = local_exponent(curve(x, prefactor * x**power), "mu")
    np.testing.assert_allclose(found, power, atol=1e-11)


def test_the_sliding_exponent_is_right_at_the_study_spacing_ends_included():
    x = grid()
    off = abs(local_exponent(curve(x, bend(x)), "mu") - bend_exponent(x))
    assert off.max() < 2e-7
    assert off[[0, 1, -2, -1]].max() < 1e-9


@pytest.mark.parametrize("part", [slice(2, -2), slice(0, 1), slice(1, 2), slice(-1, None)])
def test_error_falls_as_the_fourth_power_of_the_spacing_inside_and_at_the_ends(part):
    errors = []
    for n in (20, 40):
        x = np.geomspace(0.3, 3, n + 1)
        errors.append(float(abs(local_exponent(curve(x, bend(x)), "mu") - bend_exponent(x))[part].max()))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.4)


def test_an_uneven_grid_is_differentiated_as_well_as_an_even_one():
    t = np.linspace(-1, 1, 81)
    x = np.exp(t + 0.3 * t**2)
    off = abs(local_exponent(curve(x, bend(x)), "mu") - bend_exponent(x))
    assert off.max() < 1e-6


def test_five_points_give_a_polynomial_of_degree_four_in_the_logarithms_exactly():
    t = np.array([0.0, 0.3, 1.0, 1.1, 2.0])
    p = np.polynomial.Polynomial([0.5, -1, 0.3, 0.2, -0.1])
    found = local_exponent(curve(np.exp(t), np.exp(p(t))), "mu")
    np.testing.assert_allclose(found, p.deriv()(t), atol=1e-13)


def test_missing_zero_and_negative_points_are_nan_and_nothing_reaches_across_them():
    x = grid(-1, 1, 10)
    y = bend(x)
    y[5], y[12], y[13] = np.nan, 0.0, -1.0
    y[14:] *= 1000  # a stencil across the gap would see this jump
    found = local_exponent(curve(x, y), "mu")
    assert np.flatnonzero(np.isnan(found)).tolist() == [5, 12, 13]
    present = np.isfinite(found.values)
    np.testing.assert_allclose(found.values[present], bend_exponent(x)[present], atol=3e-3)


def test_runs_of_fewer_than_three_points_are_nan():
    y = np.array([1, 2, np.nan, 1, 2, 3, np.nan, 5.0])
    found = local_exponent(curve(np.geomspace(1, 2, 8), y), "mu")
    assert np.isfinite(found).values.tolist() == [False, False, False, True, True, True, False, False]


def test_other_dimensions_stay_in_place_each_with_its_own_gaps():
    x = grid(-1, 1, 10)
    power = xr.DataArray([-1.0, -0.5, 2.0], dims="law", coords={"law": ["a", "b", "c"]})
    y = (curve(x, x) ** power).rename("period").transpose("law", "mu").expand_dims(R=[1.0, 2.0], axis=2).copy()
    y[{"law": 1, "mu": 3, "R": 0}] = np.nan
    found = local_exponent(y, "mu")
    assert found.dims == ("law", "mu", "R")
    assert int(found.isnull().sum()) == 1
    for i in range(3):
        np.testing.assert_allclose(found[i].fillna(power[i]), power[i], atol=1e-12)


def test_the_exponent_says_what_it_is():
    found = local_exponent(curve(grid(0, 1), bend(grid(0, 1)), units="s"), "mu")
    assert found.attrs == {"units": "1", "long_name": "local exponent of period in mu"}
    assert found.name == "period_exponent"
    assert found.mu.attrs["units"] == "rad/s^2"


def test_a_coordinate_along_the_cells_of_a_zip_design_will_do():
    x = grid(-1, 1)
    y = xr.DataArray(x**-0.5, dims="cell", coords={"mu": ("cell", x), "a": ("cell", x**2)}, name="period")
    np.testing.assert_allclose(local_exponent(y, "mu"), -0.5, atol=1e-12)
    np.testing.assert_allclose(local_exponent(y, "a"), -0.25, atol=1e-12)
    assert local_exponent(y, "a").dims == ("cell",)


def test_an_array_in_pieces_gives_the_same_as_one_in_memory():
    x = grid(-1, 1)
    y = curve(x, bend(x))
    np.testing.assert_array_equal(local_exponent(y.chunk({"mu": 7}), "mu"), local_exponent(y, "mu"))


@pytest.mark.parametrize(
    ("x", "dim", "message"),
    [
        ([1.0, 2.0, 3.0], "mu_", "period has no axis 'mu_'; did you mean mu?"),
        ([1.0, 2.0, 3.0], "phase", "period has no axis 'phase'; period runs along mu"),
        ([0.0, 2.0, 3.0], "mu", "mu must be positive and finite to take logarithms; found 0"),
        ([-1.0, 2.0, 3.0], "mu", "mu must be positive and finite to take logarithms; found -1"),
        ([1.0, np.inf, 3.0], "mu", "mu must be positive and finite"),
        ([1.0, 3.0, 2.0], "mu", r"mu neither rises nor falls throughout; sort first, e.g. ds.sortby\('mu'\)"),
        ([1.0, 1.0, 2.0], "mu", "mu neither rises nor falls throughout"),
        ([1.0, 2.0], "mu", "mu has 2 of the at least 3 points"),
        (["map", "closed", "auto"], "mu", "mu holds words, not numbers"),
    ],
)
@pytest.mark.parametrize("function", [local_exponent, fit_exponent, lambda y, dim: where_value(y, dim, 1.5)])
def test_an_axis_that_has_no_logarithms_is_refused_with_the_reason(x, dim, message, function):
    with pytest.raises(SweepError, match=message):
        function(curve(x, np.arange(1.0, len(x) + 1)), dim)


def test_a_fixed_parameter_is_no_axis():
    y = curve(grid(0, 1), grid(0, 1)).assign_coords(a=1.0)
    with pytest.raises(SweepError, match="a has one value here"):
        local_exponent(y, "a")


def test_a_dimension_without_values_is_refused():
    with pytest.raises(SweepError, match=r"period runs along no axis with values"):
        local_exponent(xr.DataArray(np.ones(5), dims="cell", name="period"), "cell")


def test_further_axes_keep_their_units():
    x = grid(-1, 1)
    y = curve(x, bend(x)) * xr.DataArray([1.0, 2.0], dims="R", coords={"R": ("R", [1.0, 2.0], {"units": "rad/s^2"})})
    y = y.rename("period").assign_attrs(units="s")
    fit = fit_exponent(y, "mu", (None, 0.5))
    met = crossover(fit, fit_exponent(y, "mu", (2, None)))
    for found in (local_exponent(y, "mu"), fit, met, where_exponent(y, "mu", -0.5)):
        assert found.R.attrs == {"units": "rad/s^2"}


# its error bar


def slopes_off_and_told(x, y, truth):
    y = xr.DataArray(y, dims=("mu",) if y.ndim == 1 else ("set", "mu"), coords={"mu": x}, name="period")
    return abs(local_exponent(y, "mu") - truth).values, local_exponent_error(y, "mu").values


@pytest.mark.parametrize("points", [4, 5, 6, 7, 13, 25, 61, 241])
def test_the_error_bar_is_above_what_the_sampling_leaves_and_falls_with_it(points):
    x = np.geomspace(1e-3, 1e3, points)
    off, told = slopes_off_and_told(x, bend(x), bend_exponent(x))
    assert (off <= told).all()
    assert told.max() < 2.0 * (12 / points) ** 3


@pytest.mark.parametrize("place", [0.15, 0.4, 0.9, 2.3])
@pytest.mark.parametrize("points", [13, 25, 41])
def test_a_kink_between_two_points_is_in_the_error_bar(points, place):
    x = np.geomspace(1e-3, 1e3, points)
    off, told = slopes_off_and_told(
        x, np.where(x < place, place / x, (place / x) ** (1 / 3)), np.where(x < place, -1, -1 / 3)
    )
    assert (off <= told + 1e-13).all()


@pytest.mark.parametrize(("x", "least", "most"), [(grid(-3, 3, 10), 0.94, 0.96), (grid(-3, 3, 4), 0.92, 0.96)])
@pytest.mark.parametrize("size", [1e-2, 1e-4])
def test_the_error_bar_holds_the_truth_as_often_as_it_says_where_there_is_noise(x, least, most, size):
    """61 and 25 points a set, 1000 sets; neighbours share points, so a share is good to about 0.3 %."""
    noise = np.exp(size * np.random.default_rng(2).standard_normal((1000, x.size)))
    off, told = slopes_off_and_told(x, 3 * x**-0.5 * noise, -0.5)
    assert least < (off <= told).mean() < most


def test_a_kink_among_noise_is_in_the_error_bars_beside_it():
    x, place = grid(-3, 3, 10), 1.17
    y = np.where(x < place, place / x, (place / x) ** (1 / 3))
    y = y * np.exp(1e-4 * np.random.default_rng(3).standard_normal((200, x.size)))
    off, told = slopes_off_and_told(x, y, np.where(x < place, -1, -1 / 3))
    near = abs(np.log10(x / place)) < 0.15
    assert (off <= told)[:, near].all()
    assert told[:, ~near].min() < 1e-3  # and not elsewhere


def test_the_error_bar_of_a_constant_is_of_rounding_and_gaps_stay_gaps():
    x = grid(-1, 1, 10)
    assert local_exponent_error(curve(x, np.full(x.size, 7.3)), "mu").max() < 1e-13
    y = bend(x)
    y[[4, 9, 11]] = np.nan
    found = local_exponent_error(curve(x, y), "mu")
    assert np.flatnonzero(np.isnan(found)).tolist() == [4, 9, 10, 11]
    assert found.attrs["units"] == "1"


# straight lines


def test_the_fit_agrees_with_polyfit_and_its_covariance():
    rng = np.random.default_rng(3)
    x = grid(-1, 2, 10)
    y = 3 * x**-0.7 * np.exp(0.1 * rng.standard_normal(x.size))
    fit = fit_exponent(curve(x, y), "mu", noise="independent")
    (slope, intercept), covariance = np.polyfit(np.log(x), np.log(y), 1, cov=True)
    assert float(fit.exponent) == pytest.approx(slope, rel=1e-12)
    assert float(fit.exponent_error) == pytest.approx(covariance[0, 0] ** 0.5, rel=1e-10)
    assert float(fit.prefactor) == pytest.approx(np.exp(intercept), rel=1e-12)
    assert float(fit.prefactor_error) == pytest.approx(np.exp(intercept) * covariance[1, 1] ** 0.5, rel=1e-10)
    off = np.log(y) - np.polyval([slope, intercept], np.log(x))
    assert float(fit.residual) == pytest.approx(np.expm1(abs(off).max()), rel=1e-10)
    assert float(fit.level_error) == pytest.approx((off @ off / (x.size - 2) / x.size) ** 0.5, rel=1e-10)


def test_standard_errors_are_those_of_repeated_noise():
    rng = np.random.default_rng(11)
    x, trials = grid(0, 1, 20), 4000
    noisy = x**-0.5 * np.exp(0.05 * rng.standard_normal((trials, x.size)))
    y = xr.DataArray(noisy, dims=("trial", "mu"), coords={"mu": x}, name="period")
    fit = fit_exponent(y, "mu", noise="independent")
    # the scatter of a standard deviation over 4000 trials is 1.1 %
    assert float(fit.exponent.std()) == pytest.approx(float(fit.exponent_error.mean()), rel=0.05)
    assert float(np.log(fit.level).std()) == pytest.approx(float(fit.level_error.mean()), rel=0.05)


@pytest.mark.parametrize("points", [101, 401])
def test_drift_is_the_change_of_a_parabolas_slope_whatever_the_number_of_points(points):
    t = np.linspace(1, 3, points) ** 1.3
    y = curve(np.exp(t), np.exp(0.5 - t + 0.07 * t**2))
    fit = fit_exponent(y, "mu")
    assert float(fit.drift) == pytest.approx(2 * 0.07 * (t[-1] - t[0]), rel=1e-9)


def test_without_noise_the_standard_error_shrinks_with_the_points_and_the_drift_does_not():
    coarse, fine = (fit_exponent(curve(grid(0, 1, n), bend(grid(0, 1, n))), "mu") for n in (50, 800))
    assert float(fine.exponent_error) < 0.3 * float(coarse.exponent_error)
    assert float(fine.drift) == pytest.approx(float(coarse.drift), rel=0.02)
    assert KIND_WORDS[int(fine.kind)] == "curved"


def test_a_window_holds_both_its_ends_though_they_be_off_by_a_rounding():
    x = grid(-2, 2, 10)
    fit = fit_exponent(curve(x, x), "mu", (np.nextafter(0.1, 1), np.nextafter(10.0, 0)))
    assert int(fit.points) == 21
    assert float(fit.low) == pytest.approx(0.1, rel=1e-12)
    assert float(fit.high) == pytest.approx(10, rel=1e-12)


@pytest.mark.parametrize(("window", "points"), [((None, 1.0), 21), ((1.0, None), 21), ((None, None), 41), (None, 41)])
def test_a_window_may_be_open(window, points):
    assert int(fit_exponent(curve(grid(-2, 2, 10), grid(-2, 2, 10)), "mu", window).points) == points


def test_the_window_decides_what_is_seen():
    x = grid()
    low, high = (float(fit_exponent(curve(x, bend(x)), "mu", w).exponent) for w in ((1e-6, 1e-5), (1e5, 1e6)))
    assert low == pytest.approx(-1, abs=1e-3)
    assert high == pytest.approx(-1 / 3, abs=1e-3)


def test_missing_points_are_left_out_of_a_line_and_lines_without_three_are_nan():
    x = grid(0, 1, 10)
    y = xr.DataArray([x**2, x**2, x**2], dims=("law", "mu"), coords={"mu": x}, name="period")
    y[0, ::2] = np.nan
    y[1, 2:] = np.nan
    fit = fit_exponent(y, "mu")
    assert fit.points.values.tolist() == [5, 2, 11]
    np.testing.assert_allclose(fit.exponent, [2, np.nan, 2], rtol=1e-12)
    assert float(fit.low[0]) == pytest.approx(x[1])


@pytest.mark.parametrize(
    ("window", "message"),
    [
        ((20, 30), "a line needs at least 3 points, found 0 of period in the window 20 to 30 of mu; choose a wider"),
        ((1, 1.2), "found 1 of period"),
        ((5, 1), r"the window 5 to 1 of mu is empty; give \(low, high\)"),
        ((1, np.nan), "is empty"),
        ((1, 2, 3), r"a window of mu is a pair \(low, high\)"),
        (("one", 2), r"a window of mu is a pair \(low, high\)"),
        (5.0, r"a window of mu is a pair \(low, high\)"),
    ],
)
def test_a_bad_window_is_refused_with_the_reason(window, message):
    with pytest.raises(SweepError, match=message):
        fit_exponent(curve(grid(0, 1, 10), grid(0, 1, 10)), "mu", window)


def test_values_that_are_not_positive_are_shown_with_their_place():
    y = curve(np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, -0.25, 3.0, 0.0]))
    with pytest.raises(SweepError, match=r"2 of 4 of period in the window are not, e.g. -0.25 at mu = 2; choose"):
        fit_exponent(y, "mu")
    assert int(fit_exponent(curve(np.arange(1.0, 7), np.array([-1.0, 2, 3, 4, 5, 6])), "mu", (2, 6)).points) == 5


def test_units_follow_the_values():
    fit = fit_exponent(curve(grid(0, 1), bend(grid(0, 1)), units="s"), "mu")
    assert fit.level.attrs["units"] == "s"
    assert fit.low.attrs["units"] == "rad/s^2"
    assert fit.exponent.attrs["units"] == "1"
    assert fit.points.dtype == np.int64
    assert all(variable.attrs["long_name"] for variable in fit.data_vars.values())


# where two laws meet


def test_two_power_laws_meet_where_they_are_equal():
    x = grid()
    y = curve(x, np.where(x < 1, 8 / x, 5 * x ** (-1 / 3)), units="s")
    found = crossover(fit_exponent(y, "mu", (None, 0.1)), fit_exponent(y, "mu", (10, None)))
    assert float(found.abscissa) == pytest.approx(1.6**1.5, rel=1e-11)
    assert float(found.ordinate) == pytest.approx(8 / 1.6**1.5, rel=1e-11)
    assert float(found.abscissa_error) < 1e-11
    assert found.abscissa.attrs["units"] == "rad/s^2"
    assert found.ordinate.attrs["units"] == "s"


def test_the_standard_error_of_a_crossover_is_that_of_repeated_noise():
    rng = np.random.default_rng(5)
    x, trials = grid(-3, 3, 8), 4000
    noise = np.exp(0.05 * rng.standard_normal((trials, x.size)))
    y = xr.DataArray(np.where(x < 1, 1 / x, x ** (-1 / 3)) * noise, dims=("trial", "mu"), coords={"mu": x}, name="P")
    fits = (fit_exponent(y, "mu", window, noise="independent") for window in ((1e-2, 0.1), (10, 1e3)))
    found = crossover(*fits)
    scatter = np.log(found.abscissa).std()
    assert float(scatter) == pytest.approx(float((found.abscissa_error / found.abscissa).mean()), rel=0.06)


def test_laws_that_do_not_meet_and_windows_that_overlap_are_refused():
    x = grid(-2, 2)
    y = curve(x, np.where(x < 1, 1, 2) * x**-0.5)
    low, high = fit_exponent(y, "mu", (None, 0.5)), fit_exponent(y, "mu", (2, None))
    with pytest.raises(SweepError, match="the two laws have the same exponent within their errors"):
        crossover(low, high)
    with pytest.raises(SweepError, match="windows of the two fits overlap"):
        crossover(fit_exponent(y, "mu", (None, 1)), fit_exponent(y, "mu", (0.5, None)))
    with pytest.raises(SweepError, match="the fits are of different y: period, amplitude"):
        crossover(low, fit_exponent(y.rename("amplitude"), "mu", (2, None)))


def test_windows_may_share_an_end_point_in_either_order():
    x = grid(-2, 2)
    y = curve(x, np.where(x < 1, 1 / x, x))
    fits = fit_exponent(y, "mu", (None, 1)), fit_exponent(y, "mu", (1, None))
    assert float(crossover(fits[1], fits[0]).abscissa) == pytest.approx(1)
    assert float(
        crossover(fit_exponent(y, "mu", (None, 1)), fit_exponent(y, "mu", (1, None))).abscissa
    ) == pytest.approx(1)


# where a curve passes a value


def test_a_curve_passes_a_value_where_it_should():
    x = grid(-2, 2)
    c = curve(x, np.log(x) ** 3 + np.log(x))
    found = where_value(c, "mu", 0.3)
    t = np.log(float(found.abscissa))
    assert t**3 + t == pytest.approx(0.3, abs=1e-13)
    assert 0 <= float(found.abscissa_error) < 1e-10


def test_the_estimated_error_covers_the_distance_to_the_true_place():
    x = grid(-3, 3, 8)
    for value in (-0.9, -0.7, -0.5, -0.4):
        found = where_value(curve(x, bend_exponent(x)), "mu", value)
        truth = ((value + 1) / (-1 / 3 - value)) ** 1.5  # (1/x + x^(-1/3)/3) = -value (1/x + x^(-1/3))
        assert abs(float(found.abscissa) - truth) < float(found.abscissa_error) < 0.02 * truth


@pytest.mark.parametrize("value", [-0.9, -0.7, -0.5, -0.4])
def test_the_exponent_passes_a_value_within_the_estimated_error(value):
    x = grid(-3, 3)
    found = where_exponent(curve(x, bend(x)), "mu", value)
    truth = ((value + 1) / (-1 / 3 - value)) ** 1.5
    assert abs(float(found.abscissa) - truth) < float(found.abscissa_error) < 1e-5 * truth


def test_a_grid_point_on_the_value_is_found_exactly_and_once():
    x = grid(-1, 1, 10)
    c = curve(x, x.copy())
    c[7] = x[7]
    assert float(where_value(c, "mu", float(x[7])).abscissa) == pytest.approx(x[7], rel=1e-14)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("end", [0, -1])
def test_a_value_met_just_at_the_end_is_found(sign, end):
    x = grid(-1, 1, 10)
    assert float(where_value(curve(x, sign * x), "mu", sign * float(x[end])).abscissa) == pytest.approx(
        x[end], rel=1e-14
    )


def test_a_curve_that_stays_on_a_value_passes_it_nowhere():
    with pytest.raises(SweepError, match="passes 1 2 times"):
        where_value(curve(grid(-1, 1, 10), np.ones(21)), "mu", 1.0)


def test_a_place_next_to_the_end_is_as_good_as_five_intervals_allow():
    x = np.geomspace(1, 10, 21)
    for bracket in (0, 19):
        truth = float((x[bracket] * x[bracket + 1]) ** 0.5)
        t = np.log(x / truth)
        found = where_value(
            curve(x, t - 0.3 * t**2 + 0.05 * t**3 - 0.01 * t**4 + 0.002 * t**5), "mu", 0.0, (x[bracket], x[bracket + 1])
        )
        assert float(found.abscissa) == pytest.approx(truth, rel=1e-13)  # exact for degree five


def test_an_infinite_value_elsewhere_does_no_harm():
    x = grid(-1, 1)
    c = x.copy()
    c[-1] = np.inf
    found = where_value(curve(x, c), "mu", 0.5)
    assert float(found.abscissa_error) < 1e-7


def test_a_window_limits_where_one_looks_and_not_what_is_differentiated():
    x = grid(-3, 3)
    y = curve(x, bend(x))
    whole = where_exponent(y, "mu", -0.5)
    place = float(whole.abscissa)
    part = where_exponent(y, "mu", -0.5, (x[x < place][-1], x[x > place][0]))
    assert float(part.abscissa) == place
    assert float(part.abscissa_error) == float(whole.abscissa_error)


def test_each_line_has_its_own_place_and_those_without_one_are_nan():
    x = grid(-1, 1)
    c = xr.DataArray([x, 2 * x, 0 * x, abs(np.log(x))], dims=("law", "mu"), coords={"mu": x}, name="period")
    found = where_value(c, "mu", 0.5)
    np.testing.assert_allclose(found.abscissa, [0.5, 0.25, np.nan, np.nan], rtol=1e-8)
    assert np.isnan(found.abscissa_error).values.tolist() == [False, False, True, True]


def test_a_window_picks_one_of_two_places():
    x = grid(-1, 1)
    c = curve(x, np.log(x) ** 2)
    with pytest.raises(SweepError, match=r"period passes 0\.5 2 times along mu in the window; choose another window"):
        where_value(c, "mu", 0.5)
    assert float(where_value(c, "mu", 0.5, (1, None)).abscissa) == pytest.approx(np.exp(0.5**0.5), rel=1e-6)
    assert float(where_value(c, "mu", 0.5, (None, 1)).abscissa) == pytest.approx(np.exp(-(0.5**0.5)), rel=1e-6)


def test_a_value_that_is_never_reached_is_said_so():
    with pytest.raises(SweepError, match="period does not pass 200 along mu in the window"):
        where_value(curve(grid(-1, 1), grid(-1, 1)), "mu", 200)
    with pytest.raises(SweepError, match="period does not pass -2"):
        where_exponent(curve(grid(-1, 1), bend(grid(-1, 1))), "mu", -2)


def test_places_say_what_they_are():
    x = grid(-2, 2)
    for found, what in (
        (where_value(curve(x, x, units="s"), "mu", 0.5), "where period is 0.5"),
        (where_exponent(curve(x, bend(x)), "mu", -0.5), "where the exponent of period is -0.5"),
    ):
        assert found.abscissa.attrs == {"units": "rad/s^2", "long_name": what}
        assert found.abscissa_error.attrs == {"units": "rad/s^2", "long_name": "estimated error of the place"}


def test_a_passage_inside_a_gap_is_not_made_up():
    x = grid(-1, 1, 10)
    c = curve(x, x.copy())
    c[(x > 0.7) & (x < 1.4)] = np.nan
    with pytest.raises(SweepError, match="does not pass 1 "):
        where_value(c, "mu", 1.0)


def test_a_passage_at_the_very_end_uses_the_points_there_are():
    x = grid(-1, 1)
    value = float((x[0] * x[1]) ** 0.5)
    assert float(where_value(curve(x, x), "mu", value).abscissa) == pytest.approx(value, rel=1e-7)
