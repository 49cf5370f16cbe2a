"""Intervals of the exponent of one line by other tools, which `interval_coverage.py` prints beside ours."""

from __future__ import annotations

from collections.abc import Callable

import lmfit
import numpy as np
import scipy.stats
import statsmodels.api as sm

RIVAL_SETS = 200
"""Lines at most, of tools that take one line after the other."""

Ends = tuple[np.ndarray, np.ndarray]
Line = tuple[np.ndarray, np.ndarray]
"""Exponents and their standard errors."""


def student(rule: Callable[[np.ndarray, np.ndarray], Line]) -> Callable[[np.ndarray, np.ndarray], Ends]:
    """Exponents and standard errors as intervals by Student's t."""

    def rival(t: np.ndarray, z: np.ndarray) -> Ends:
        slope, error = rule(t, z)
        reach = scipy.stats.t.ppf(0.975, t.size - 2) * error
        return slope - reach, slope + reach

    return rival


def each(fit: Callable[[np.ndarray, np.ndarray], tuple[float, float]]) -> Callable[[np.ndarray, np.ndarray], Ends]:
    """Of one line after the other; the first RIVAL_SETS."""
    return student(lambda t, z: tuple(np.array([fit(t, row) for row in z[:RIVAL_SETS]]).T))


def weighted(t: np.ndarray, z: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Exponents, distances from the lines, and the weights of the values in the exponents."""
    share = weight / weight.sum(axis=1, keepdims=True)
    u = t - (share * t).sum(axis=1, keepdims=True)
    of_value = share * u / (share * u * u).sum(axis=1, keepdims=True)
    slope = (of_value * z).sum(axis=1)
    return slope, z - (share * z).sum(axis=1, keepdims=True) - slope[:, None] * u, of_value


def least_squares(t: np.ndarray, z: np.ndarray, weight: np.ndarray | None = None) -> Line:
    weight = np.ones_like(z) if weight is None else weight
    slope, off, of_value = weighted(t, z, weight)
    size = (weight * off**2).sum(axis=1) / (t.size - 2)
    return slope, np.sqrt(size * (of_value**2 / weight).sum(axis=1))


def wls(t: np.ndarray, z: np.ndarray) -> Line:
    square = np.pad(weighted(t, z, np.ones_like(z))[1] ** 2, [(0, 0), (3, 3)], mode="reflect")
    return least_squares(t, z, 1 / np.lib.stride_tricks.sliding_window_view(square, 7, axis=1).mean(axis=2))


def hac(t: np.ndarray, z: np.ndarray) -> Line:
    """Newey and West (1987), Bartlett's kernel."""
    lags = max(1, int(4 * (t.size / 100) ** (2 / 9)))
    slope, off, of_value = weighted(t, z, np.ones_like(z))
    score = off * of_value
    square = (score**2).sum(axis=1)
    for k in range(1, lags + 1):
        square += 2 * (1 - k / (lags + 1)) * (score[:, k:] * score[:, :-k]).sum(axis=1)
    return slope, np.sqrt(square)


def gls(t: np.ndarray, z: np.ndarray) -> Line:
    apart = abs(np.subtract.outer(np.arange(t.size), np.arange(t.size)))
    root = np.linalg.cholesky(0.5**apart)
    columns, lines = np.linalg.solve(root, np.stack([np.ones_like(t), t], axis=1)), np.linalg.solve(root, z.T)
    numbers = np.linalg.lstsq(columns, lines, rcond=None)[0]
    size = ((lines - columns @ numbers) ** 2).sum(axis=0) / (t.size - 2)
    return numbers[1], np.sqrt(size * np.linalg.inv(columns.T @ columns)[1, 1])


def kvb(t: np.ndarray, z: np.ndarray) -> Ends:
    """Critical value 4.771 of Kiefer and Vogelsang (2002), Bartlett's kernel."""
    slope, off, of_value = weighted(t, z, np.ones_like(z))
    reach = 4.771 * np.sqrt(2 * (np.cumsum(off * of_value, axis=1) ** 2).sum(axis=1) / t.size)
    return slope - reach, slope + reach


def rlm(t: np.ndarray, z: np.ndarray) -> tuple[float, float]:
    fit = sm.RLM(z, sm.add_constant(t)).fit()
    return fit.params[1], fit.bse[1]


def by_lmfit(t: np.ndarray, z: np.ndarray) -> tuple[float, float]:
    fit = lmfit.models.LinearModel().fit(z, x=t, slope=-0.5, intercept=0.0)
    return fit.params["slope"].value, fit.params["slope"].stderr


def bootstrap(t: np.ndarray, z: np.ndarray) -> Ends:
    """Of points, 400 times; percentiles."""
    draws = np.random.default_rng(0).integers(t.size, size=(400, t.size))
    u = t[draws] - t[draws].mean(axis=1, keepdims=True)
    slopes = np.stack([(u * row[draws]).sum(axis=1) / (u * u).sum(axis=1) for row in z[:RIVAL_SETS]])
    low, high = np.quantile(slopes, [0.025, 0.975], axis=1)
    return low, high


RIVALS = {
    "OLS": student(least_squares),
    "WLS": student(wls),
    "HAC": student(hac),
    "KVB": kvb,
    "GLS": student(gls),
    "RLM": each(rlm),
    "lmfit": each(by_lmfit),
    "boot": bootstrap,
}
SINGLE = ("OLS", "WLS", "HAC", "KVB", "GLS")
