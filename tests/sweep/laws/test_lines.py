"""Straight lines in log-log against numpy, scipy and statsmodels: numbers, windows, kinds of scatter, two windows."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats
from scipy.linalg import toeplitz

import sweep

N = 14
T = np.linspace(-1.0, 1.0, N) + 0.02 * np.sin(5.0 * np.arange(N)) + 2.0
WAVE = np.sin(17.0 * np.arange(N) ** 2 + 0.3)
"""As good as noise."""


def curve(z, t=T, **attrs):
    """y = e^z at x = e^t"""
    coords = {"x": ("x", np.exp(t), {"units": "m"})}
    return xr.DataArray(np.exp(z), coords, ("set", "x")[-np.ndim(z) :], name="y", attrs={"units": "s", **attrs})


def kind(found):
    return str(found.kind.values)


# numbers of a fit


def test_values_of_another_precision_are_fitted_in_double_precision():
    t = np.linspace(0.0, 5.0, 37)
    single = curve(np.log(3.0) - 0.7 * t, t).astype(np.float32)
    for fit in (sweep.fit_exponent, sweep.fit_two_laws, sweep.fit_correction, sweep.compare_laws):
        rounded = {"bound": 2.0**-24} if fit == sweep.fit_exponent else {}
        xr.testing.assert_identical(fit(single, "x"), fit(single.astype(np.float64), "x", **rounded))
    assert int(sweep.fit_exponent(single.astype(np.longdouble), "x", sigma=0.1 * single).points) == 37


def test_a_slope_that_changes_evenly_tends_to_no_limit_that_rounding_decides():
    for shift in np.linspace(0.0, 3.0, 12):
        t = np.linspace(-1.0, 1.0, 31) + shift
        fit = sweep.fit_exponent(curve(-0.1 * t**2, t), "x")
        steps = -0.2 * np.array([t[0] - 7.5, t[-1] + 7.5])  # 30 times the change over an eighth of the window
        assert [float(fit.limit_low), float(fit.limit_high)] == pytest.approx(steps, abs=1e-6), shift


def test_a_line_is_that_of_polyfit_with_its_covariance():
    rng, t = np.random.default_rng(3), np.linspace(-2.0, 5.0, 31)
    z = np.log(3) - 0.7 * t + 0.1 * rng.standard_normal(31)
    fit = sweep.fit_exponent(curve(z, t), "x", noise="even")
    (slope, intercept), covariance = np.polyfit(t, z, 1, cov=True)
    off = z - slope * t - intercept
    expected = {
        "exponent": slope,
        "exponent_error": covariance[0, 0] ** 0.5,
        "prefactor": np.exp(intercept),
        "prefactor_error": np.exp(intercept) * covariance[1, 1] ** 0.5,
        "residual": np.expm1(abs(off).max()),
        "level": np.exp(z.mean()),
        "centre": np.exp(t.mean()),
        "level_error": (off @ off / (t.size - 2) / t.size) ** 0.5,
        "drift": 2 * np.polyfit(t, z, 2)[0] * np.ptp(t),
        "points": 31,
        "low": np.exp(t[0]),
        "high": np.exp(t[-1]),
        "start": np.exp(z[0]),
        "stop": np.exp(z[-1]),
    }
    assert {name: float(fit[name]) for name in expected} == pytest.approx(expected, rel=1e-9)
    assert fit.points.dtype == np.int64


FITS_WITH_SIGMA = sweep.fit_exponent, sweep.fit_two_laws, sweep.fit_correction


def test_known_errors_weigh_the_points_and_make_all_errors_of_a_fit():
    sigma = np.linspace(0.05, 0.2, N)
    z = 0.3 - 0.7 * T + 0.5 * sigma * WAVE
    fit = sweep.fit_exponent(curve(z), "x", sigma=sigma * curve(z))
    (slope, level), covariance = np.polyfit(T, z, 1, w=1 / sigma, cov="unscaled")
    reach = stats.norm.ppf(0.975) * covariance[0, 0] ** 0.5
    expected = {
        "exponent": slope,
        "exponent_error": covariance[0, 0] ** 0.5,
        "exponent_low": slope - reach,
        "exponent_high": slope + reach,
        "prefactor_error": np.exp(level) * covariance[1, 1] ** 0.5,
        "level_error": (sigma**-2).sum() ** -0.5,
        "centre": np.exp(np.average(T, weights=sigma**-2)),
    }
    assert {name: float(fit[name]) for name in expected} == pytest.approx(expected)
    assert (kind(fit), int(fit.fits)) == ("weighted", 1)
    assert int(sweep.fit_exponent(curve(z), "x", sigma=0.1 * sigma * curve(z)).fits) == 0
    # no more than rounding denies nothing, and errors of what is missing are none
    exact = curve(np.stack([0.3 - 0.7 * T, 0.3 - 0.0 * T, T])).where(T[0] < T, np.inf)
    exact[2, 5] = 0.0
    verdicts = [fit(exact, "x", sigma=0.1).verdict.values.tolist() for fit in FITS_WITH_SIGMA]
    assert verdicts == [[law, law, "not positive"] for law in ("one power law", "one law", "one power law")]
    # signs in too few runs deny a line that chi-squared allows
    bent = -0.5 * T[0] * np.ones(40) + 0.5 * np.cos(np.linspace(0, np.pi, 40)) ** 2
    assert int(sweep.fit_exponent(curve(bent, np.arange(40.0)), "x", sigma=0.3 * np.exp(bent[0])).fits) == 0


@pytest.mark.parametrize("size", [0.0, 1e-3])
def test_the_interval_within_error_bounds_is_all_that_they_can_do_to_a_slope(size):
    bound = size * np.linspace(0.5, 1.0, N)
    fit = sweep.fit_exponent(curve(0.3 - 0.7 * T), "x", bound=xr.DataArray(bound, dims="x"))
    u = T - T.mean()
    reach = (abs(u) * bound).sum() / (u**2).sum()
    assert kind(fit) == ("bounded" if size else "exact")
    assert float(fit.exponent_high + fit.exponent_low) == pytest.approx(-1.4)
    assert float(fit.exponent_high - fit.exponent_low) == pytest.approx(2 * reach, rel=0.01, abs=1e-13)
    # values with three digits, of which the bounds differ tenfold, are a law
    y = np.exp(np.random.default_rng(1).uniform(0, 2.3, (300, 1)) - 0.5 * np.linspace(0, 4.6, N))
    last = 10 ** (np.floor(np.log10(y)) - 2)
    digits = curve(np.log(np.round(y / last) * last), np.linspace(0, 4.6, N))
    fit = sweep.fit_exponent(digits, "x", bound=0.505 * last / digits)
    assert (fit.kind == "bounded").all()
    assert (abs(fit.exponent + 0.5) <= fit.exponent_high - fit.exponent).all()


# kinds of noise


PHIS = np.array([-0.2, 0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.96])
TRENDS, ENDS = np.linspace(-1.6, 1.6, 5), np.array([0, 1.6, 3.2])


def mixture(columns, z, phis, trends, ends, confidence):
    """The slope, its error, its density over noises and the density at the ends of its interval, by dense matrices."""
    from statsmodels.regression.linear_model import GLS  # every worker reads this file, and one of them needs it

    (n, k), u = columns.shape, np.interp(T, [T[0], T[-1]], [-1, 1])
    logs, values, errors = np.empty((3, len(phis), len(trends) * len(ends)))
    weight = np.gradient(phis) * (1 - phis) ** -(1.7 + 4.5 / n) if len(phis) > 1 else np.ones(1)
    weight = weight / weight.sum() * (1 - 1.1 / n) + 1.1 / n * (phis == 0)
    for i, phi in enumerate(phis):
        for j, (a, c) in enumerate((a, c) for a in trends for c in ends):
            size = np.exp(a * u + c * abs(u) - np.mean(a * u + c * abs(u)))
            fit = GLS(z, columns, sigma=np.outer(size, size) * toeplitz(phi ** np.arange(n)) / (1 - phi**2)).fit()
            log = -n / 2 * np.log(1 / (1 - phi**2)) + (n - 1) / -2 * np.log(1 - phi**2)
            log += 0.5 * np.linalg.slogdet(fit.normalized_cov_params)[1] - (n - k) / 2 * np.log(fit.scale)
            logs[i, j] = log + np.log(weight[i]) - 0.5 * (a**2 + c**2) / 1.6**2
            values[i, j], errors[i, j] = fit.params[1], fit.bse[1]
    share = np.exp(logs - logs.max()) / np.exp(logs - logs.max()).sum()
    slope, by_phi = (share * values).sum(), share.sum(axis=1)
    middle = (share * values).sum(axis=1) / by_phi
    one = ((share * (errors**2 + (values - middle[:, None]) ** 2)).sum(axis=1) / by_phi) ** 0.5
    error = (share * (errors**2 + (values - slope) ** 2)).sum() ** 0.5
    end = stats.t.pdf(stats.t.ppf((1 + confidence) / 2, n - k), n - k)
    level = (by_phi * end / one).sum()
    return slope, error, lambda x: (by_phi * stats.t.pdf((x - middle) / one, n - k) / one).sum(), level


@pytest.mark.parametrize(
    ("noise", "phis", "trends", "ends"),
    [
        ("even", [0.0], [0.0], [0.0]),
        ("uneven", [0.0], TRENDS, ENDS),
        ("correlated", PHIS, [0.0], [0.0]),
        (True, PHIS, TRENDS, ENDS),
    ],
)
def test_the_interval_holds_the_densest_values_over_the_noises_that_the_word_allows(noise, phis, trends, ends):
    z = 1.0 - 0.5 * T + 0.1 * WAVE * np.exp(T - 2.0)
    found = sweep.fit_exponent(curve(z), "x", noise=noise, confidence=0.9)
    slope, error, density, level = mixture(np.transpose([T**0, T]), z, np.asarray(phis), trends, ends, 0.9)
    assert (float(found.exponent), float(found.exponent_error)) == pytest.approx((slope, error), rel=1e-8)
    assert [density(float(end)) for end in (found.exponent_low, found.exponent_high)] == pytest.approx([level] * 2)
    assert (kind(found), found.attrs["confidence"]) == ("noise" if noise is True else noise, 0.9)


def test_a_point_far_off_the_others_is_left_out_and_widens_the_interval():
    z = 1.0 - 0.5 * T + 0.02 * WAVE
    off = z.copy()
    off[5] += 1.0
    found = sweep.fit_exponent(curve(off), "x", noise=True)
    others = sweep.fit_exponent(curve(np.delete(z, 5), np.delete(T, 5)), "x", noise=True)
    assert float(found.exponent) == pytest.approx(float(others.exponent), rel=1e-9)
    assert float(found.exponent_error) == pytest.approx(float(others.exponent_error) * N / (N - 1), rel=1e-6)
    assert int(found.points) == N


def test_repeated_measurements_are_fitted_and_tell_the_noise():
    rng, t = np.random.default_rng(2), np.repeat(np.linspace(0.0, 4.0, 5), 4)
    z = 1.0 - 0.5 * t + 0.02 * rng.standard_normal(20)
    found = sweep.fit_exponent(curve(z, t), "x")
    assert (kind(found), int(found.points)) == ("noise", 20)
    assert float(found.exponent_low) <= -0.5 <= float(found.exponent_high)
    even = sweep.fit_exponent(curve(z, t), "x", noise="even")
    assert float(even.exponent) == pytest.approx(np.polyfit(t, z, 1)[0], rel=1e-12, abs=0.0)
    exact = sweep.fit_exponent(curve(1.0 - 0.5 * t, t), "x")
    assert (kind(exact), float(exact.exponent)) == ("exact", pytest.approx(-0.5, abs=1e-12))


def test_a_line_that_is_not_positive_or_too_short_is_left_out_and_named():
    y = curve(np.stack([1.0 - 0.5 * T + 0.02 * WAVE] * 3))
    y[1, 3], y[2, 2:] = -1.0, np.nan
    found = sweep.fit_exponent(y, "x")
    assert found.kind.values.tolist() == ["noise", "not positive", "too few points"]
    assert found.verdict.values.tolist() == ["one power law", "not positive", "too few points"]
    assert found.exponent.isnull().values.tolist() == found.fits.isnull().values.tolist() == [False, True, True]
    assert found.attrs["summary"].splitlines()[1].split()[1].startswith(f"{float(found.exponent[0]):.6g}"[:6])


def test_stacked_axes_are_fitted_as_those_that_they_are_of():
    y = curve((1.0 - 0.5 * T + 0.02 * WAVE) * np.ones((2, 3, 1)).reshape(6, 1))
    y = y.assign_coords(set=np.arange(6)).assign_coords(a=("set", [1, 1, 1, 2, 2, 2]), b=("set", [1, 2, 3] * 2))
    stacked = sweep.fit_exponent(y.set_index(set=["a", "b"]), "x")
    np.testing.assert_array_equal(stacked.exponent, sweep.fit_exponent(y, "x").exponent)
    assert stacked.attrs["summary"].split()[:2] == ["a", "b"]
    with pytest.raises(sweep.SweepError, match=r"such as \(1, 1\)"):
        sweep.fit_exponent(y.set_index(set=["a", "b"]), "set")


# windows


@pytest.mark.parametrize(
    ("window", "points"),
    [
        ((np.nextafter(0.1, 1), np.nextafter(10.0, 0)), 21), ((None, 1.0), 21), ((1.0, None), 21), ((-1.0, None), 41),
        (None, 41), ((1.0 + 1e-12, None), 20),
    ],
)  # fmt: skip
def test_a_window_holds_its_ends_to_rounding_and_may_be_open(window, points):
    t = np.linspace(-2, 2, 41) * np.log(10)
    assert int(sweep.fit_exponent(curve(t, t), "x", window).points) == points


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"window": (200, 300)}, "found 0 at 0 in the window"),
        ({"window": (8, 10)}, "found 1 at 1"),
        ({"window": (5, 1)}, "is empty"),
        ({"window": (2, 2)}, "is empty"),
        ({"window": (1, np.nan)}, "is empty"),
        ({"window": (1, 2, 3)}, "is a pair"),
        ({"window": ("one", 2)}, "is a pair"),
        ({"noise": np.ones(2)}, "noise: expected True"),
        ({"window": 5.0}, "is a pair"),
        ({"noise": "pink"}, "noise: expected True, False or one of even"),
        ({"sigma": 0.1, "noise": "even"}, "noise and sigma"),
        ({"sigma": -1.0}, "sigma: errors are not negative"),
        ({"sigma": xr.DataArray(np.ones(3), dims="other")}, "sigma: expected a number, or an array"),
        ({"bound": "much"}, "bound: expected a number"),
        ({"bound": [0.1, 0.2]}, "bound: expected a number"),
        ({"confidence": 95}, "confidence"),
        ({"confidence": 0.0}, "confidence"),
        ({"confidence": np.nan}, "confidence"),
        ({"confidence": "a"}, "confidence: expected a number"),
    ],
)
def test_what_a_line_cannot_be_fitted_with_is_refused(keys, message):
    with pytest.raises(sweep.SweepError, match=message):
        sweep.fit_exponent(curve(T), "x", **keys)


def test_values_that_are_not_positive_are_shown_with_their_place():
    y = curve(np.zeros(4), np.log([1.0, 2.0, 3.0, 4.0])).copy(data=[1.0, -0.25, 3.0, 0.0])
    with pytest.raises(sweep.SweepError, match=r"2 of 4.*-0\.25.*2"):
        sweep.fit_exponent(y, "x")


def test_a_result_states_the_errors_of_its_cells_by_cell_or_as_a_whole():
    mu = {"spacing": "log", "start": 1e4, "stop": 1e9, "num": 13}
    ds = sweep.run(kernel="foliot", axes={"mu": mu}, fixed={"a": 1.0, "phi0": 1.0}, rtol=1e-7, progress=False)
    worse = ds.assign(error_bound=ds.error_bound.copy(data=np.where(np.arange(13) == 4, 1e-3, np.nan)))
    each = ds.assign_coords(rtol=("mu", np.full(13, 1e-5)))
    unknown = ds.assign(error_bound=ds.error_bound.copy(data=np.full(13, np.inf)))
    told = [sweep.local_exponent(ds.period, "mu", error=True, bound=b).exponent_error for b in (0.0, 1e-7, 1e-5, 1.0)]
    for bound, expected in ((ds, told[1]), (None, told[1]), (each, told[2]), (unknown, told[3])):
        found = sweep.local_exponent(ds.period, "mu", error=True, bound=bound).exponent_error
        np.testing.assert_allclose(found, expected)
    found = sweep.local_exponent(ds.period, "mu", error=True, bound=worse).exponent_error
    assert {2, 3, 5, 6} <= set(np.flatnonzero(found > told[1] + 1e-6)) <= {0, 1, 2, 3, 4, 5, 6}  # its neighbours


# where the lines of two windows meet


def test_two_power_laws_meet_where_they_are_equal_in_either_order():
    t = np.linspace(-14, 14, 481)
    y = curve(np.where(t < 0, np.log(8) - t, np.log(5) - t / 3), t)
    for windows in (((None, 0.1), (10, None)), ((10, None), (None, 0.1)), ((None, 0.9), (2, None))):
        met = sweep.fit_two_laws(y, "x", windows=windows)
        assert float(met.crossover) == pytest.approx(1.6**1.5, rel=1e-11)
        assert float(met.level) == pytest.approx(8 / 1.6**1.5, rel=1e-11)
        assert float(met.crossover_error) < 1e-10
        slopes = [-1, -1 / 3] if windows[0][0] is None else [-1 / 3, -1]
        np.testing.assert_allclose(met.exponent, slopes, rtol=1e-12)
        np.testing.assert_allclose(met.exponent.sel(law=["low", "high"]), [-1, -1 / 3], rtol=1e-12)


@pytest.mark.parametrize(
    ("slopes", "windows", "message"),
    [
        *(((p, p), ((None, 0.5), (2, None)), "the same exponent") for p in (-0.6, -0.5, 0.5, 1.2)),
        ((-1.0, -0.5), ((None, 1), (0.5, None)), "overlap"),
        ((-1.0, -0.5), ((0.5, None), (None, 1)), "overlap"),
        ((-1.0, -0.5), (1, 2, 3), "windows"),
        ((-1.0, -0.5), ((None, 1), (1, None)), None),  # an end may be shared
    ],
)
def test_laws_that_do_not_meet_and_windows_that_overlap_are_refused(slopes, windows, message):
    t = np.linspace(-2, 2, 41)
    y = curve(np.where(t < 0, slopes[0], slopes[1]) * t, t)
    if message is None:
        assert float(sweep.fit_two_laws(y, "x", windows=windows).crossover) == pytest.approx(1)
        return
    with pytest.raises(sweep.SweepError, match=message):
        sweep.fit_two_laws(y, "x", windows=windows)
