"""Noise that remembers, against the full normal likelihood with its covariance matrix written out."""

import math

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import toeplitz

from sweep.analysis.correlated import averaged, criterion, deviance, student

PHI = [-0.4, -0.3, -0.2, -0.1, 0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.93, 0.96, 0.98, 0.99, 0.995]


def example(n=14):
    t, rng = np.linspace(-1.0, 2.0, n), np.random.default_rng(7)
    columns = np.column_stack([np.ones(n), t])
    return columns, columns @ [0.5, -0.3] + 0.1 * rng.standard_normal(n), rng.uniform(0.5, 2.0, n)


def squares(columns, z, weights, phi):
    """Generalised least squares: numbers, their covariance for noise of size 1, and the sum of squares."""
    root = np.sqrt(weights)
    matrix, values = columns * root[:, None], z * root
    covariance = toeplitz(phi ** np.arange(z.size)) / (1 - phi**2)
    inverse = np.linalg.inv(covariance)
    normal = np.linalg.inv(matrix.T @ inverse @ matrix)
    numbers = normal @ matrix.T @ inverse @ values
    off = values - matrix @ numbers
    return numbers, normal, off @ inverse @ off, covariance


@pytest.mark.parametrize(("left", "freedom"), [(5, 5), (1, 1), (0, 1), (-3, 1)])
def test_the_reach_is_students(left, freedom):
    assert student(left, 0.9) == pytest.approx(stats.t.ppf(0.95, freedom), rel=1e-10)


@pytest.mark.parametrize("even", [True, False])
def test_the_deviance_is_of_the_greatest_normal_likelihood(even):
    columns, z, weights = example()
    weights = np.ones(z.size) if even else weights
    least = math.inf
    for phi in PHI:
        numbers, _, square, covariance = squares(columns, z, weights, phi)
        root = np.sqrt(weights)
        normal = stats.multivariate_normal(root * (columns @ numbers), square / z.size * covariance)
        least = min(least, -2 * normal.logpdf(root * z))
    expected = least - z.size * (1 + math.log(2 * math.pi))
    assert deviance(columns, z, weights) == pytest.approx(expected, abs=1e-9)
    k, n = 4, z.size
    assert criterion(columns, z, weights) == pytest.approx(expected + 2 * k + 2 * k * (k + 1) / (n - k - 1), abs=1e-9)


def mixture(columns, z, weights):
    """Shares of all correlations by restricted likelihood and prior, numbers and errors."""
    n, k = columns.shape
    logs, values, errors = [], [], []
    # each correlation stands for half the way to both neighbours
    wide = np.gradient(np.array(PHI))
    for phi, width in zip(PHI, wide, strict=True):
        numbers, normal, square, covariance = squares(columns, z, weights, phi)
        log = -0.5 * np.linalg.slogdet(covariance)[1] + 0.5 * np.linalg.slogdet(normal)[1]
        logs.append(log - (n - k) / 2 * math.log(square) + math.log(width / (1 - phi) ** 0.85))
        values.append(numbers)
        errors.append(np.sqrt(square / (n - k) * np.diag(normal)))
    share = np.exp(np.array(logs) - max(logs))
    return share / share.sum(), np.array(values), np.array(errors)


@pytest.mark.parametrize("even", [True, False])
def test_numbers_are_averaged_over_all_correlations(even):
    columns, z, weights = example()
    weights = np.ones(z.size) if even else weights
    share, values, errors = mixture(columns, z, weights)
    found = averaged(columns, z, 0.9, weights)
    for k in (0, 1):
        mean = (share * values[:, k]).sum()
        second = (share * (errors[:, k] ** 2 + values[:, k] ** 2)).sum()
        assert found.value[k] == pytest.approx(mean, rel=1e-9)
        assert found.error[k] == pytest.approx(math.sqrt(second - mean**2), rel=1e-9)
        for end, chance in ((found.low[k], 0.05), (found.high[k], 0.95)):
            below = (share * stats.t.cdf((end - values[:, k]) / errors[:, k], z.size - 2)).sum()
            assert below == pytest.approx(chance, abs=1e-9)


def test_points_that_leave_nothing_have_no_error():
    """Their logarithm is held above that of nothing."""
    columns = np.column_stack([np.ones(6), np.arange(6) % 2])
    found = averaged(columns, np.zeros(6), 0.95, np.ones(6))
    np.testing.assert_allclose([found.value, found.low, found.high], 0.0, atol=1e-140)
    assert np.isfinite(deviance(columns, np.zeros(6), np.ones(6)))
