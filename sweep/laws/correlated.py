"""A straight line through points whose noise remembers that of the point before.

statsmodels estimates the correlation; from few points estimates are too small, and intervals that take them for true
hold 60 to 85 % instead of 95. So it is averaged over here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sweep.laws.loglog import Array


class Scatter(NamedTuple):
    """A line through points that scatter: weights of the points, standard error and interval of the slope."""

    kind: str
    weights: Array
    error: float
    low: float
    high: float


def student(left: int, confidence: float) -> float:
    """Standard errors to each side of an interval, for `left` degrees of freedom."""
    from scipy.special import stdtrit

    return float(stdtrit(max(left, 1), (1 + confidence) / 2))


def criterion(columns: Array, z: Array, weights: Array) -> float:
    """AICc of least squares with noise that remembers, the best of all correlations; less n (1 + ln 2 pi)."""
    return corrected(deviance(columns, z, weights), z.size, columns.shape[1] + 2)


def deviance(columns: Array, z: Array, weights: Array) -> float:
    """Minus twice the logarithm of the same likelihood."""
    logs = _by_correlation(columns, z, weights, restricted=False)[0]
    return -2 * float(logs.max()) - z.size * math.log(z.size)


def corrected(deviance: float, points: int, numbers: int) -> float:
    """AICc from minus twice the logarithm of the likelihood; inf where there are too few points for so many numbers."""
    left = points - numbers - 1
    return deviance + 2 * numbers + 2 * numbers * (numbers + 1) / left if left > 0 else math.inf


CORRELATIONS = np.concatenate([np.linspace(-0.4, 0.9, 14), [0.93, 0.96, 0.98, 0.99, 0.995]])
"""Correlations of neighbours that are tried."""

TOWARDS_ONE = 0.85
"""Power of 1/(1 - correlation) in their prior: 95 % intervals of 12 points at .9 need it."""


class Averaged(NamedTuple):
    """Numbers of a least-squares fit (k,), averaged over all correlations: standard errors and intervals."""

    value: Array
    error: Array
    low: Array
    high: Array


def correlated(t: Array, z: Array, confidence: float, weights: Array | None = None) -> Scatter:
    """The line through points whose noise remembers that of the point before."""
    weights = np.ones(t.size) if weights is None else weights
    found = averaged(np.stack([np.ones(t.size), t - t.mean()], axis=1), z, confidence, weights)
    plain = float(np.polyfit(t - t.mean(), z, 1, w=np.sqrt(weights))[0])
    low, high = float(found.low[1]), float(found.high[1])
    return Scatter("correlated", weights, float(found.error[1]), min(low, plain), max(high, plain))


def averaged(columns: Array, z: Array, confidence: float, weights: Array) -> Averaged:
    """Least squares with noise that remembers that of the point before, z_i = phi z_(i-1) + new.

    phi is not estimated: intervals are those of Student's t, averaged over all phi by restricted likelihood.
    """
    logs, values, errors = _by_correlation(columns, z, weights)
    logs = logs - TOWARDS_ONE * np.log(1 - CORRELATIONS) + np.log(np.gradient(CORRELATIONS))
    share = np.exp(logs - logs.max())
    share /= share.sum()
    middle = share @ values
    spread: Array = np.sqrt(share @ (errors**2 + (values - middle) ** 2))
    left = z.size - columns.shape[1]
    low, high = (
        [_quantile(share, v, e, left, (1 + sign * confidence) / 2) for v, e in zip(values.T, errors.T, strict=True)]
        for sign in (-1, 1)
    )
    return Averaged(middle, spread, np.minimum(low, middle), np.maximum(high, middle))


def _by_correlation(columns: Array, z: Array, weights: Array, restricted: bool = True) -> tuple[Array, Array, Array]:
    """Logarithm of the likelihood for each of CORRELATIONS, the numbers and their standard errors (correlations,
    numbers), by generalised least squares."""
    n, k, phi = *columns.shape, CORRELATIONS
    both = np.column_stack([columns, z]) * np.sqrt(weights)[:, None]
    before = np.concatenate([np.zeros((1, k + 1)), both[:-1]])
    white = both - phi[:, None, None] * before
    white[:, 0] *= np.sqrt(1 - phi**2)[:, None]
    products = white.transpose(0, 2, 1) @ white
    inverse = np.linalg.inv(products[:, :k, :k])
    numbers = np.einsum("gij,gj->gi", inverse, products[:, :k, k])
    off = white[:, :, k] - np.einsum("gni,gi->gn", white[:, :, :k], numbers)
    square = np.maximum((off**2).sum(axis=1), 1e-300)
    logs = 0.5 * np.log(1 - phi**2) - (n - k * restricted) / 2 * np.log(square)
    if restricted:
        logs += 0.5 * np.log(np.linalg.det(inverse))
    return logs, numbers, np.sqrt(square[:, None] / (n - k) * np.einsum("gii->gi", inverse))


def _quantile(share: Array, middle: Array, error: Array, left: int, chance: float) -> float:
    """Of a mixture of Student's t distributions."""
    from scipy.optimize import brentq
    from scipy.special import stdtr, stdtrit

    ends = middle + error * stdtrit(left, chance)
    low, high = float(ends.min()), float(ends.max())
    if not high > low:
        return low
    return float(brentq(lambda x: float(share @ stdtr(left, (x - middle) / error)) - chance, low, high))
