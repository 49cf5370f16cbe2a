"""Stencils, lines and roots of plain arrays, against numpy's polynomials, statsmodels and hand-made cases."""

import numpy as np
import pytest
from neighbours import derivative
from numpy.polynomial import Polynomial
from scipy.linalg import null_space
from scipy.ndimage import maximum_filter1d
from scipy.stats import norm

from sweep.analysis import loglog
from sweep.analysis.loglog import brackets, interpolation_errors, is_logarithmic, root, spans_decades, tends

EPSILON = 2.0**-52


def uneven(n):
    return np.linspace(-1.0, 1.0, n) + 0.02 * np.sin(5.0 * np.arange(n))


def norms(matrix):
    return np.sqrt((matrix**2).sum(axis=1))


def near(values):
    return maximum_filter1d(values, 5, mode="nearest")


# slopes and their errors


def test_each_unbroken_run_of_three_and_more_stands_for_itself():
    t = uneven(14)
    z = np.random.default_rng(5).standard_normal((3, 14))
    z[0, [2, 6, 8]], z[2, [2, 6, 8]] = np.nan, np.nan  # runs of 2, 3, 1 and 5
    expected = z @ derivative(t, 5).T
    for row in (0, 2):
        expected[row] = np.nan
        for here in (slice(3, 6), slice(9, 14)):
            expected[row, here] = derivative(t[here], 5) @ z[row, here]
    np.testing.assert_allclose(loglog.slopes(t, z, 5), expected, rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("points", [2, 3, 4, 5, 7])
@pytest.mark.parametrize("n", [3, 4, 5, 6, 9])
def test_slopes_are_those_of_polynomials_through_neighbours(points, n):
    t = uneven(n)
    z = np.random.default_rng(n).standard_normal((2, n))
    np.testing.assert_allclose(loglog.slopes(t, z, points), z @ derivative(t, points).T, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize(
    ("n", "orders"), [(3, (3, 2, 2)), (4, (4, 2, 2)), (5, (5, 3, 2)), (6, (7, 5, 3)), (19, (7, 5, 3))]
)
def test_the_error_of_a_slope_among_few_points_is_the_most_that_orders_noise_and_steps_say(n, orders):
    t, rng = uneven(n), np.random.default_rng(n)
    fine, middle, rough = (derivative(t, points) for points in orders)
    for z in (rng.standard_normal(n), np.exp(t), np.where(t < 0.1, 0.0, t - 0.1)):
        apart, coarse = abs((fine - middle) @ z), abs((rough - middle) @ z)
        steps = np.diff(z) / np.diff(t)
        beside = np.maximum(abs(np.r_[steps[0], steps] - middle @ z), abs(np.r_[steps, steps[-1]] - middle @ z))
        sharp = 4 * apart > coarse
        bend = near(np.maximum(apart, np.where(sharp, beside, coarse)))
        noise = np.median(apart / norms(fine - middle)) / norm.ppf(0.75) * norms(middle)
        expected = 2.05 * np.maximum(noise, bend) + EPSILON * (1 + abs(z).max()) * norms(middle)
        np.testing.assert_allclose(loglog.slope_errors(t, z), expected, rtol=1e-4, atol=1e-11)


@pytest.mark.parametrize("n", [20, 41])
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_the_error_of_a_slope_among_many_points_is_of_noise_except_near_a_bend(n, scale):
    t = uneven(n)
    z = scale * np.sin(17.0 * np.arange(n) ** 2)  # as good as noise
    for bump in (0.0, 30.0 * scale):
        z = z + bump * (np.arange(n) == n // 2)
        fine, middle, rough = (derivative(t, points) for points in (7, 5, 3))
        apart, coarse = abs((fine - middle) @ z), abs((rough - middle) @ z)
        steps = np.diff(z) / np.diff(t)
        beside = np.maximum(abs(np.r_[steps[0], steps] - middle @ z), abs(np.r_[steps, steps[-1]] - middle @ z))
        each = apart / norms(fine - middle)
        size = np.median(each) / norm.ppf(0.75)
        bend = near(np.where(4 * apart > coarse, np.maximum(apart, beside), apart))
        by_noise = size * norms(middle)
        error = np.where(near(each) > 4 * size, np.maximum(by_noise, bend), by_noise)
        expected = 2.05 * error + EPSILON * (1 + abs(z).max()) * norms(middle)
        np.testing.assert_allclose(loglog.slope_errors(t, z), expected, rtol=1e-4)
        assert (near(each) > 4 * size).any() == (bump > 0)


def test_the_slope_of_a_constant_is_known_to_rounding():
    t = uneven(9)
    expected = EPSILON * 8.5 * norms(derivative(t, 5))
    np.testing.assert_allclose(loglog.slope_errors(t, np.full(9, -7.5)), expected, rtol=1e-8)


def test_stated_errors_of_the_values_are_added_to_the_error_of_a_slope():
    t = uneven(9)
    z, bound = np.exp(t), 1e-3 * (1 + t**2)
    z[0] = np.nan
    added = loglog.slope_errors(t, z, bound) - loglog.slope_errors(t, z)
    np.testing.assert_allclose(added[1:], abs(derivative(t[1:], 5)) @ bound[1:], rtol=1e-8)
    np.testing.assert_array_equal(loglog.slope_errors(t, z, 0 * bound), loglog.slope_errors(t, z))


def test_beside_a_pole_the_slope_is_not_known():
    t = np.linspace(-1, 1, 41) + 0.01
    found = loglog.slope_errors(t, np.log(abs(t)))
    assert np.flatnonzero(np.isinf(found)).tolist() == [19, 20, 21]


def test_bounds_of_slopes_are_sums_of_the_sizes_of_all_weights():
    t, bound = uneven(8), np.random.default_rng(3).random((2, 8))
    for points in (3, 5):
        expected = bound @ abs(derivative(t, points)).T
        np.testing.assert_allclose(loglog.slope_bounds(t, bound, points), expected, rtol=1e-9)


@pytest.mark.parametrize("count", [1, 2, 4])
def test_points_are_off_their_neighbours_by_what_no_polynomial_has(count):
    """The one direction of count + 1 values, of size 1, that polynomials of degree below count have nothing of."""
    t, z = uneven(9), np.random.default_rng(2).standard_normal(9)
    expected = []
    for i in range(9 - count):
        here = slice(i, i + count + 1)
        expected.append(abs(null_space(np.vander(t[here], count).T)[:, 0] @ z[here]))
    np.testing.assert_allclose(abs(interpolation_errors(t, z, count)), expected, rtol=1e-9)


# where an exponent tends


@pytest.mark.parametrize(("span", "step"), [(8.0, 1.0), (80.0, np.log(10))])
@pytest.mark.parametrize("amplitude", [0.3, -0.3])
def test_a_change_that_fades_geometrically_is_gone_through_three_times(span, step, amplitude):
    """Its limit L is amplitude below: three times over it is at L - 2 amplitude."""
    t = 5.0 + np.concatenate([step * np.arange(3), [span]])
    local = -1.0 + amplitude * np.array([1.0, 2.0, 4.0, 0.0])
    assert tends(t, local, 0.0) == pytest.approx((-1.0 + amplitude, -1.0 - 2 * amplitude), abs=1e-12)


@pytest.mark.parametrize("local", [[0.0, 1.0, 2.0], [0.0, 2.0, 3.0], [0.0, 1.0, -1.0], [0.0, 1.0, 1.0]])
def test_a_change_that_does_not_slow_down_goes_on_thirty_times(local):
    t = np.array([0.0, 1.0, 2.0, 8.0])
    first, limit = tends(t, np.array([*local, 0.0]), 0.0)
    assert (first, limit) == pytest.approx((local[0], local[0] + 30 * (local[0] - local[1])))


def test_what_is_within_doubt_is_no_change():
    t, local = np.array([0.0, 1.0, 2.0, 8.0]), np.array([0.0, 0.5, 1.5, 0.0])
    assert tends(t, local, 0.5) == (0.0, 0.0)
    assert tends(t, local, 0.49)[1] == pytest.approx(3 * 0.25 / (-1.0 + 0.5))
    np.testing.assert_allclose(tends(t[::-1] * -1.0 - 3.0, local[::-1], 0.5)[0], 0.0)


# a line


# passages


@pytest.mark.parametrize(
    ("c", "expected"),
    [
        ([0, 2], [0]),
        ([2, 0], [0]),
        ([0, 1, 2], [0]),  # met at a point: once
        ([2, 1, 0], [1]),
        ([1, 2, 3], [0]),  # met at the ends
        ([1, 0, -1], [0]),
        ([3, 2, 1], [1]),
        ([-1, 0, 1], [1]),
        ([2, 1, 2], []),  # touched from above
        ([0, 1, 0], [0, 1]),
        ([np.nan, 1, 2], [1]),
        ([2, 1, np.nan], [0]),
        ([0, np.nan, 2], []),
        ([0, 2, 0, 2], [0, 1, 2]),
        ([2, 3, 4], []),
        ([0, 0, 0], []),
    ],
)
def test_a_curve_passes_a_value_between_these_points(c, expected):
    assert brackets(np.array(c, dtype=float), 1.0) == expected


@pytest.mark.parametrize("bracket", range(7))
@pytest.mark.parametrize("points", [2, 3, 4, 6])
def test_a_root_is_that_of_the_polynomial_through_neighbours(bracket, points):
    t = uneven(8)
    c = np.exp(t)
    for sign in (1.0, -1.0):
        value = 0.7 * c[bracket] + 0.3 * c[bracket + 1]
        first = min(max(bracket - points // 2 + 1, 0), 8 - points)
        here = slice(first, first + points)
        roots = (Polynomial.fit(t[here], c[here], points - 1) - value).roots()
        expected = [r.real for r in roots if abs(r.imag) < 1e-9 and t[bracket] <= r.real <= t[bracket + 1]]
        assert root(t, sign * c, bracket, sign * value, points) == pytest.approx(expected[0], abs=1e-12)


def test_a_root_takes_points_of_its_own_run_alone():
    t = uneven(9)
    c = np.array([np.nan, 1e6, np.nan, 1.0, 2.0, 4.0, np.nan, 1e6, 1e6])
    parabola = Polynomial.fit(t[3:6], c[3:6], 2) - 1.4
    expected = [r for r in parabola.roots() if t[3] < r < t[4]]
    assert root(t, c, 3, 1.4, 6) == pytest.approx(expected[0], abs=1e-13)


# axes in logarithms


@pytest.mark.parametrize(
    ("grid", "expected"),
    [
        (np.geomspace(1, 3, 4), True),
        (np.geomspace(3, 1, 4), True),
        (np.geomspace(1, 3, 4) * [1, 1, 1 + 1e-7, 1], True),
        (np.geomspace(1, 3, 4) * [1, 1, 1 + 1e-6, 1], False),
        (np.linspace(1, 3, 4), False),
        (np.linspace(1, 99.9, 9), True),
        (np.linspace(1, 99.8, 9), False),
        ([1.0, 2.0], False),
        ([1.0, 100.0], True),
        ([0.0, 1.0, 1000.0], False),
        ([1.0, np.inf, 50.0], False),
        ([1.0, np.nan, 500.0], True),
        ([], False),
    ],
)
def test_an_axis_is_logarithmic_by_equal_ratios_or_two_decades(grid, expected):
    assert is_logarithmic(grid) is expected


@pytest.mark.parametrize(("values", "expected"), [([0.0, 5e3], False), ([-1.0, 5e3], False), ([2.0, 199.8], True)])
def test_decades_are_those_of_positive_values(values, expected):
    assert spans_decades(values) is expected
