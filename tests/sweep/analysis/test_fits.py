"""Fits of laws to points, against those of scipy and numpy, and their errors, against the exact normal matrix."""

import math

import numpy as np
import pytest
from scipy.optimize import curve_fit

from sweep.analysis import fits, shapes


def noisy(seed=1, points=30):
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(2.0, 7.0, points))
    return t, 1.3 - 0.4 * t + 0.05 * rng.standard_normal(points), rng.uniform(0.3, 3.0, points)


@pytest.mark.parametrize("known", [False, True])
def test_a_line_and_what_it_costs_are_those_of_textbooks(known):
    t, z, weights = noisy()
    weights = weights / 0.05**2
    found = fits.fitted(shapes.ONE, t, z, weights, known)
    span, n = np.ptp(t), t.size
    (slope, level), covariance = np.polyfit(t, z, 1, w=np.sqrt(weights), cov="unscaled")
    off = z - level - slope * t
    square = float((weights * off**2).sum())
    error = np.sqrt(np.diag(covariance)[0] * (1 if known else square / (n - 2)))
    np.testing.assert_allclose(found.numbers, [level + slope * t[0], slope * span], rtol=1e-10)
    np.testing.assert_allclose(found.errors[1], error * span, rtol=1e-6)
    np.testing.assert_allclose(found.off, off, atol=1e-12)
    # -2 ln L but for n (1 + ln 2 pi), with the size of the noise at its best where it is not known
    relative = weights / weights.mean()
    unknown = n * math.log((relative * off**2).sum() / n) - np.log(relative).sum()
    deviance, k = (square, 2) if known else (unknown, 3)
    assert found.deviance == pytest.approx(deviance, rel=1e-9)
    assert found.bic == pytest.approx(deviance + k * math.log(n), rel=1e-9)
    assert found.aicc == pytest.approx(deviance + 2 * k + 2 * k * (k + 1) / (n - k - 1), rel=1e-9)


def test_without_weights_all_points_weigh_alike():
    t, z, _ = noisy()
    plain, even = fits.fitted(shapes.ONE, t, z), fits.fitted(shapes.ONE, t, z, np.full(t.size, 7.0))
    np.testing.assert_allclose(plain.numbers, even.numbers, rtol=1e-12)
    assert plain.deviance == pytest.approx(even.deviance, rel=1e-12)


@pytest.mark.parametrize("law", [shapes.ONE, shapes.CORRECTION, shapes.TWO], ids=str)
def test_a_law_needs_two_points_more_than_numbers(law):
    t, z, _ = noisy(points=law.numbers + 2)
    assert fits.fitted(law, t, z) is not None
    assert fits.fitted(law, t[1:], z[1:]) is None


def test_what_rounding_leaves_of_an_exact_line_is_in_its_deviance():
    t = np.linspace(0.0, 4.0, 9)
    found = fits.fitted(shapes.ONE, t, np.full(9, 3.0))
    assert found.deviance == pytest.approx(2 * 9 * math.log(4 * 2.0**-52 * 4), abs=1.0)


def test_two_laws_and_their_errors_are_those_of_scipy():
    t = np.linspace(-3.0, 5.0, 41)

    def curve(t, place, log_width, level, low, high):
        w = math.exp(log_width)
        return level + low * (t - place) + (high - low) * w * np.logaddexp(0, (t - place) / w)

    truth = (0.8, -0.2, 1.5, -1.0, -0.3)
    z = curve(t, *truth) + 0.01 * np.random.default_rng(3).standard_normal(t.size)
    found = fits.fitted(shapes.TWO, t, z)
    best, covariance = curve_fit(curve, t, z, truth, xtol=1e-12, ftol=1e-12)
    scale = np.array([1 / 8, 1, 1, 8, 8])
    start = np.array([-t[0] / 8, -math.log(8), 0, 0, 0])
    np.testing.assert_allclose(found.numbers, best * scale + start, rtol=1e-4)
    np.testing.assert_allclose(found.errors, np.sqrt(np.diag(covariance)) * scale, rtol=1e-2)
    at = np.array([-4.0, 0.3, 9.0])
    np.testing.assert_allclose(fits.curve(found, at, t[0], t[-1]), curve(at, *best), rtol=1e-5)
