"""Exponents over a second parameter, against scipy."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats
from scipy.optimize import curve_fit

import sweep
from sweep.system.errors import SweepError


def powers(noise=0.01):
    """P ~ mu^(-1/(n + 1)) with scatter."""
    mu, n = np.geomspace(1, 1e3, 30), np.linspace(0.5, 3, 9)
    y = mu[:, None] ** (-1 / (n + 1)) * np.exp(noise * np.random.default_rng(2).standard_normal((30, 9)))
    return xr.DataArray(y, {"mu": mu, "n": n}, ("mu", "n"), name="P")


def test_a_formula_for_the_exponents_is_fitted_by_their_bars():
    fits = sweep.fit_exponent(powers(), "mu")
    found = sweep.fit_over(fits, "n", "-1/(a + b*n)")
    assert found.attrs["fits"] == 1
    for name in ("a", "b"):
        one = found.sel(number=name)
        assert float(one.low) <= 1 <= float(one.high)
        assert float(one.high - one.low) < 0.2


def test_a_formula_that_misses_the_bars_has_no_intervals():
    found = sweep.fit_over(sweep.fit_exponent(powers(), "mu"), "n", "a + b*n")
    assert found.attrs["fits"] == 0
    assert np.isnan(found.low).all()
    assert "misses the bars" in found.attrs["verdict"]


@pytest.mark.parametrize(
    ("dim", "formula", "message"),
    [("m", "a*m", "exponents run along n, expected m"), ("n", "a +* n", "formula: expected one of n")],
)
def test_what_is_no_formula_is_said(dim, formula, message):
    with pytest.raises(SweepError, match=message):
        sweep.fit_over(sweep.fit_exponent(powers(), "mu"), dim, formula)


def exponents(value, bar):
    """As `fit_exponent` returns them over n = 1, 2, ..."""
    value = np.asarray(value, dtype=np.float64)
    columns = {"exponent": value, "exponent_low": value - bar, "exponent_high": value + bar}
    coords = {"n": np.arange(1.0, value.size + 1)}
    return xr.Dataset({name: ("n", column) for name, column in columns.items()}, coords)


def test_intervals_of_a_formula_are_those_of_scipy():
    n, bar = np.arange(1.0, 11.0), np.linspace(0.01, 0.03, 10)
    value = -1 / (1.2 + 0.7 * n) + 0.3 * bar * np.cos(5 * n)
    found = sweep.fit_over(exponents(value, bar), "n", "-1/(a + b*n)", confidence=0.8)
    best, covariance = curve_fit(
        lambda n, a, b: -1 / (a + b * n), n, value, [1, 1], bar / stats.norm.ppf(0.975), absolute_sigma=True
    )
    np.testing.assert_allclose(found.value, best, rtol=1e-4)
    reach = stats.norm.ppf(0.9) * np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(found.high - found.value, reach, rtol=1e-3)
    np.testing.assert_allclose(found.value - found.low, reach, rtol=1e-3)
    np.testing.assert_allclose(found.fitted, -1 / (best[0] + best[1] * n), rtol=1e-4)
    np.testing.assert_array_equal(found.exponent, value)


@pytest.mark.parametrize(
    ("count", "far", "by", "fits"),
    [(20, 3, 1.05, 1), (20, 4, 1.05, 0), (6, 1, 1.05, 1), (6, 2, 1.05, 0), (20, 3, 1.99, 1), (20, 3, 2.01, 0)],
)
def test_a_formula_fits_where_few_exponents_are_off_by_a_bar_and_none_by_two(count, far, by, fits):
    off = np.where(np.arange(count) < far, by, -by * far / (count - far))
    found = sweep.fit_over(exponents(3 + 0.1 * off, 0.1), "n", "a + 0*n")
    assert found.attrs["fits"] == fits
    assert float(found.value[0]) == pytest.approx(3.0, abs=1e-6)


@pytest.mark.parametrize(("times", "fits"), [(0.9, 1), (2.2, 0)])
def test_exponents_without_bars_have_those_of_rounding(times, fits):
    off = np.where(np.arange(40) % 2, 1.0, -1.0) * times * 1e-14 * 101
    assert sweep.fit_over(exponents(100 + off, 0.0), "n", "a + 0*n", {"a": 100.0}).attrs["fits"] == fits


def test_a_formula_of_two_numbers_needs_three_exponents_with_bars():
    given = exponents([1.0, 2.0, 3.1, 4.0], 0.1)
    given["exponent_high"][0] = np.inf
    assert sweep.fit_over(given, "n", "a + b*n").sizes["n"] == 3
    given["exponent"][1] = np.nan
    with pytest.raises(SweepError, match="2 numbers need more than 2 exponents"):
        sweep.fit_over(given, "n", "a + b*n")
