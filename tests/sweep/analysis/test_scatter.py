"""What kind of scatter a line has: the likelihood of each."""

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import null_space

from sweep.analysis import scatter
from sweep.analysis.correlated import correlated


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


# a bend among noise


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


# the deviance of one line
