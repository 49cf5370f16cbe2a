"""What kind of scatter a line has: the likelihood of each."""

import importlib

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import null_space
from scipy.optimize import minimize

from sweep.analysis import scatter
from sweep.analysis.correlated import correlated, criterion, deviance


@pytest.mark.parametrize("seed", range(3))
def test_outliers_are_judged_by_the_greatest_likelihood_of_students_t(seed):
    rng = np.random.default_rng(seed)
    t = np.linspace(-1.0, 1.0, 40)
    columns = np.stack([np.ones(t.size), t], axis=1)
    z = 0.3 - 0.5 * t + 0.02 * rng.standard_t(3.0, t.size)

    def deviance(numbers):
        return -2 * stats.t.logpdf(z, 3.0, columns @ numbers[:2], np.exp(numbers[2])).sum()

    least = minimize(deviance, [0.3, -0.5, np.log(0.02)], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-9})
    # as a normal scatter's, of which n (1 + ln 2 pi) is left out
    expected = least.fun - t.size * (1 + np.log(2 * np.pi))
    assert scatter._outlying_deviance(columns, z) == pytest.approx(expected, abs=1e-5)


def unlike(n, size=1.0):
    """Distances as good as noise."""
    return size * np.sin(17.0 * np.arange(n) ** 2 + 0.3)


def grid(n):
    return np.linspace(-1.0, 1.0, n) + 0.02 * np.sin(5.0 * np.arange(n))


def least_squares(columns, z, weights):
    """Numbers, the inverse of the normal matrix, and distances."""
    normal = np.linalg.inv(columns.T @ (columns * weights[:, None]))
    numbers = normal @ columns.T @ (weights * z)
    return numbers, normal, z - columns @ numbers


# is it scatter?


@pytest.mark.parametrize("n", [3, 4, 5, 6, 7, 9, 11, 20])
def test_the_size_of_noise_is_the_least_that_polynomials_through_neighbours_leave(n):
    t = grid(n)
    for z in (unlike(n), np.exp(4 * t)):
        sizes = [np.inf]
        for count in (2, 4, 6, 8):
            if n > count + 2:
                parts = [slice(i, i + count + 1) for i in range(n - count)]
                off = [null_space(np.vander(t[p], count).T)[:, 0] @ z[p] for p in parts]
                sizes.append(np.sqrt(np.mean(np.square(off))))
        assert scatter.noise_size(t, z) == pytest.approx(min(sizes), rel=1e-6)


def test_rounding_is_of_both_coordinates():
    t, z = np.array([-8.0, 0.0, 2.0]), np.array([1.0, -30.0, 6.0])
    assert scatter.rounding(t, z) == pytest.approx(2.0**-52 * (1 + 30 + 0.5 * 8), abs=0)


def test_what_rounding_or_stated_errors_leave_is_no_scatter():
    t, z, nothing = np.linspace(0, 1, 12), np.full(12, 1e6), np.zeros(12)
    wave = np.resize([1.0, -1.0], 12) * np.sqrt(10 / 12)  # of size 1 with ten degrees of freedom
    least = 8 * 2.0**-52 * (1 + 1e6)
    assert not scatter.is_scatter(t, 0.999 * least * wave, z, nothing)
    assert scatter.is_scatter(t, 1.001 * least * wave, z, nothing)
    bound = np.full(12, abs(wave[0]) / 2)
    assert not scatter.is_scatter(t, wave, z, bound)
    assert scatter.is_scatter(t, wave, z, 0.999 * bound)
    bound[3] *= 0.999
    assert scatter.is_scatter(t, wave, z, bound)


@pytest.mark.parametrize(("share", "expected"), [(0.119, False), (0.121, True)])
def test_distances_of_which_little_is_noise_are_a_bend(monkeypatch, share, expected):
    off = np.array([1.0, -2.0, 3.0, 1.0, -1.0])
    monkeypatch.setattr(scatter, "noise_size", lambda t, z: share * np.sqrt(16 / 3))
    assert scatter.is_scatter(np.arange(5.0), off, off, np.zeros(5)) == expected


# a bend among noise


def best_polynomial(t, z, weights, confidence):
    """Range of its slope with the interval, by numpy, the degree by AICc."""
    tries = []
    for degree in range(2, min(6, t.size - 3) + 1):
        columns = np.vander(t, degree + 1, increasing=True)
        numbers, normal, off = least_squares(columns, z, weights)
        square, n, k = weights @ off**2, t.size, degree + 2
        aicc = n * np.log(square / n) + 2 * k + (2 * k * (k + 1) / (n - k - 1) if n > k + 1 else np.inf)
        slopes = columns[:, :-1] * np.arange(1, degree + 1)
        error = np.sqrt(np.einsum("ni,ij,nj->n", slopes, normal[1:, 1:], slopes) * square / (n - degree - 1))
        tries.append((aicc, slopes @ numbers[1:], stats.t.ppf((1 + confidence) / 2, n - degree - 1) * error))
    _, slope, reach = min(tries, key=lambda one: one[0])
    return (slope - reach).min(), (slope + reach).max()


@pytest.mark.parametrize("n", [8, 9, 25])
@pytest.mark.parametrize("numbers", [(0.3, -1.0, 0.4), (0.3, -1.0, -0.3, 0.5), (0, 1, 0, 0.5, 0, 0, 0.4)])
def test_the_slope_of_a_bend_is_that_of_the_best_polynomial(n, numbers, monkeypatch):
    monkeypatch.setattr(scatter, "_polynomial_criterion", lambda u, z, degree, weights: -11.0 * (degree > 1))
    t, weights = grid(n), np.linspace(0.5, 2.0, n)
    z = np.polynomial.Polynomial(numbers)(t) + unlike(n, 0.01)
    assert scatter.bend(t, z, 0.9, weights) == pytest.approx(best_polynomial(t, z, weights, 0.9), rel=1e-6)


@pytest.mark.parametrize(
    ("criteria", "bends"),
    [((10.01, 0.0, 5.0), True), ((10.0, 0.0, 5.0), False), ((10.01, 5.0, 0.0), True), ((10.0, 5.0, 0.0), False)],
)
def test_a_bend_is_believed_where_a_parabola_or_cubic_is_better_by_ten(monkeypatch, criteria, bends):
    monkeypatch.setattr(scatter, "_polynomial_criterion", lambda u, z, degree, weights: criteria[degree - 1])
    found = scatter.bend(grid(8), unlike(8), 0.95, np.ones(8))
    assert (found is not None) is bends
    assert scatter.bend(grid(7), unlike(7), 0.95, np.ones(7)) is None


def test_the_criterion_of_a_polynomial_is_that_of_its_powers():
    t, z, weights = grid(15), unlike(15), np.linspace(1.0, 3.0, 15)
    for degree in (1, 2, 3):
        expected = criterion(np.vander(t, degree + 1), z, weights)
        assert scatter._polynomial_criterion(t, z, degree, weights) == pytest.approx(expected, abs=1e-8)


# intervals


def sandwich(t, z, weights, confidence):
    """Slope's standard error by HC3, distances over 1 - leverage, and its interval."""
    columns = np.column_stack([np.ones(t.size), t])
    numbers, normal, off = least_squares(columns, z, weights)
    leverage = weights * np.einsum("ni,ij,nj->n", columns, normal, columns)
    score = columns * (weights * off / (1 - leverage))[:, None]
    error = np.sqrt((normal @ score.T @ score @ normal)[1, 1])
    reach = stats.t.ppf((1 + confidence) / 2, t.size - 2) * error
    return error, numbers[1] - reach, numbers[1] + reach


def fading(t, off):
    """Variance of distances by the line through the logarithms of their squares."""
    logs = np.log(np.maximum(off**2, 1e-6 * np.mean(off**2)))
    level = np.polyval(np.polyfit(t, logs, 1), t)
    return np.exp(level - level.max())


def numbers_of(found):
    return found.error, found.low, found.high


def test_the_variance_is_that_of_a_line_through_logarithms():
    t = grid(10) + 3.0
    columns = np.column_stack([np.ones(10), t - t.mean()])
    off = np.exp(0.7 * t) * np.resize([1.0, -1.0], 10)
    np.testing.assert_allclose(scatter._variance(off, columns), np.exp(1.4 * (t - t.max())), rtol=1e-9)
    off[4] = 0.0
    np.testing.assert_allclose(scatter._variance(off, columns), fading(t, off), rtol=1e-9)


def test_each_kind_of_scatter_that_is_asked_for_has_its_interval():
    import statsmodels.api as sm

    n, confidence = 14, 0.9
    t = grid(n) + 2.0
    z = 1.0 - 0.5 * t + unlike(n, 0.1) * np.exp(t)
    plain = stats.linregress(t, z)
    found = scatter.scattered(t, z, confidence, "independent")
    reach = stats.t.ppf(0.95, n - 2) * plain.stderr
    assert numbers_of(found) == pytest.approx((plain.stderr, plain.slope - reach, plain.slope + reach))
    assert (found.kind, found.weights.tolist()) == ("independent", [1.0] * n)

    variance = fading(t, z - plain.intercept - plain.slope * t)
    found = scatter.scattered(t, z, confidence, "uneven")
    np.testing.assert_allclose(found.weights, 1 / variance, rtol=1e-9)
    assert numbers_of(found) == pytest.approx(sandwich(t, z, 1 / variance, confidence))
    assert found.kind == "uneven"

    found = scatter.scattered(t, z, confidence, "correlated")
    assert numbers_of(found) == pytest.approx(numbers_of(correlated(t, z, confidence)))
    assert found.kind == "correlated"

    z[3] += 5.0
    found = scatter.scattered(t, z, confidence, "outliers")
    robust = sm.RLM(z, sm.add_constant(t), M=sm.robust.norms.TukeyBiweight()).fit()
    reach = stats.t.ppf(0.95, n - 2) * robust.bse[1]
    expected = robust.bse[1], robust.params[1] - reach, robust.params[1] + reach
    assert numbers_of(found) == pytest.approx(expected, rel=1e-5)
    np.testing.assert_allclose(found.weights, robust.weights, atol=1e-5)
    assert found.weights[3] == 0
    assert found.kind == "outliers"


@pytest.mark.parametrize("kind", ["any", "uneven"])
@pytest.mark.parametrize("wave", [1.0, -1.0])
def test_an_unknown_scatter_has_the_wider_of_two_intervals(monkeypatch, kind, wave):
    """Of neighbours that differ the interval of noise that remembers is narrow, of those that do not it is wide."""
    n = 16
    t = grid(n)
    z = -0.5 * t + np.cumprod(np.full(n, -wave)) * 0.1 + np.sin(3 * t) * 0.02 * (wave < 0)
    monkeypatch.setattr(scatter, "_kind", lambda *_: kind)
    off = z - np.polyval(np.polyfit(t, z, 1), t)
    weights = 1 / fading(t, off) if kind == "uneven" else np.ones(n)
    one, other = sandwich(t, z, weights, 0.9), numbers_of(correlated(t, z, 0.9, weights))
    expected = max(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2])
    found = scatter.scattered(t, z, 0.9)
    assert numbers_of(found) == pytest.approx(expected, rel=1e-7)
    assert found.kind == kind
    np.testing.assert_allclose(found.weights, weights, rtol=1e-8)


def test_the_line_of_known_errors_and_where_chance_denies_it(monkeypatch):
    n = 11
    t, sigma = grid(n) + 1.0, np.linspace(0.1, 0.4, n)
    z = 2.0 - 0.3 * t + unlike(n) * sigma
    columns = np.column_stack([np.ones(n), t])
    numbers, normal, off = least_squares(columns, z, sigma**-2)
    error = np.sqrt(normal[1, 1])
    reach = stats.norm.ppf(0.95) * error
    found, _ = scatter.weighted(t, z, sigma, 0.9)
    assert numbers_of(found) == pytest.approx((error, numbers[1] - reach, numbers[1] + reach))
    np.testing.assert_allclose(found.weights, sigma**-2)
    square = ((off / sigma) ** 2).sum()
    for chance, fits in ((1.02e-3, True), (0.98e-3, False)):
        scale = np.sqrt(square / stats.chi2.isf(chance, n - 2))
        assert scatter.weighted(t, z, scale * sigma, 0.9)[1] is fits
    monkeypatch.setattr(scatter, "runs_deny", lambda _: True)
    assert scatter.weighted(t, z, 10 * sigma, 0.9)[1] is False


# what kind


def farthest(t, z):
    """Largest distance from the line through all others, in standard errors of the two together."""
    found = []
    for i in range(t.size):
        others = np.arange(t.size) != i
        columns = np.column_stack([np.ones(t.size), t])
        numbers, normal, off = least_squares(columns[others], z[others], np.ones(t.size - 1))
        size = np.sqrt(off @ off / (t.size - 3) * (1 + columns[i] @ normal @ columns[i]))
        found.append(abs(z[i] - columns[i] @ numbers) / size)
    return max(found)


def kind_of(t, z):
    import statsmodels.api as sm

    columns = sm.add_constant(t - t.mean())
    return scatter._kind(t, sm.OLS(z, columns).fit(), columns)


@pytest.mark.parametrize("n", [7, 8, 9, 11, 12, 13, 30])
def test_the_kind_of_scatter_is_told_by_two_tests(n):
    rng, t = np.random.default_rng(n), grid(n)
    told = set()
    for growth in np.linspace(0, 4, 12):
        for far in (0.0, 4.0, 8.0, 30.0):
            z = np.exp(growth * t) * rng.standard_normal(n)
            z[n // 2] += far * (growth < 1)
            fit = stats.linregress(t, z)
            off = z - fit.intercept - fit.slope * t
            uneven = stats.linregress(t, np.log(np.maximum(off**2, 1e-6 * np.mean(off**2)))).pvalue < 0.02
            alone = 2 * n * stats.t.sf(farthest(t, z), n - 3) < 0.005
            expected = "uneven" if uneven and n >= 12 else "outliers" if alone and n >= 8 else "any"
            assert kind_of(t, z) == expected
            told.add(expected)
    assert told == {"any"} | ({"outliers"} if n >= 8 else set()) | ({"uneven"} if n >= 12 else set())


def denied(off):
    """Wald's and Wolfowitz's normal distribution, half a run nearer where there are fewer than 50 points."""
    n, above = off.size, int((off > 0).sum())
    count = 1 + np.count_nonzero(np.diff(np.sign(off)))
    mean = 1 + 2 * above * (n - above) / n
    size = np.sqrt((mean - 1) * (mean - 2) / (n - 1))
    away = count - mean + (0.5 if n < 50 and count < mean else 0.0)
    return count < mean and 2 * stats.norm.sf(abs(away) / size) < 1e-3


@pytest.mark.parametrize("n", [12, 16, 20, 24, 60])
def test_too_few_runs_of_signs_deny_independent_noise(n):
    told = set()
    for length in range(1, n // 2 + 1):
        off = np.where(np.arange(n) // length % 2, 1.0, -2.0)
        assert scatter.runs_deny(off) == denied(off)
        told.add(denied(off))
    assert told == ({False} if n < 16 else {True, False})


def test_runs_of_few_points_or_a_single_one_of_a_sign_deny_nothing(monkeypatch):
    two = np.r_[np.full(58, -1.0), 1.0, 1.0]
    assert scatter.runs_deny(two)
    assert scatter.runs_deny(-two)
    one = np.r_[np.full(59, -1.0), 1.0]
    assert not scatter.runs_deny(one)
    assert not scatter.runs_deny(-one)
    runs = importlib.import_module("statsmodels.sandbox.stats.runs")
    monkeypatch.setattr(runs, "runstest_1samp", lambda off, cutoff, correction: (-9.0, 1e-9))
    assert scatter.runs_deny(np.resize([1.0, -1.0], 12))
    assert not scatter.runs_deny(np.resize([1.0, -1.0], 11))


# the deviance of one line


def test_the_deviance_of_a_line_is_that_of_the_noise_that_suits_it_best():
    n, rng = 60, np.random.default_rng(1)
    t = grid(n)
    columns = np.column_stack([np.ones(n), t])
    outlying = 0.1 * rng.standard_normal(n)
    outlying[[20, 40]] = 5.0, -4.0
    best = []
    for noise in (np.cumsum(rng.standard_normal(n)), rng.standard_normal(n) * np.exp(2 * t), outlying):
        z = 1.0 - 0.5 * t + noise
        off = least_squares(columns, z, np.ones(n))[2]
        variance = fading(t, off)
        tries = [
            deviance(columns, z, np.ones(n)),
            deviance(columns, z, 1 / variance) + np.log(variance).sum(),  # the density of z, not of z over its size
            scatter._outlying_deviance(columns, z),
        ]
        best.append(int(np.argmin(tries)))
        found = scatter.line_deviance(t, z)
        assert found == (pytest.approx(min(tries), abs=1e-6), 3)
        square = off @ off / n
        assert scatter.line_deviance(t, z, 1.001 * square) == (pytest.approx(n * np.log(1.001 * square)), 2)
        assert scatter.line_deviance(t, z, 0.999 * square) == found
    assert best == [0, 1, 2]
