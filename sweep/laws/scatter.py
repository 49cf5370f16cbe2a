"""Error bars of a straight line whose points scatter, and what kind of scatter that is.

statsmodels does the regressions (extra `fit`).
"""

from __future__ import annotations

import math
import warnings
from importlib import import_module
from typing import Any

import numpy as np

from sweep.errors import missing
from sweep.laws.correlated import Scatter, corrected, correlated, criterion, deviance, student
from sweep.laws.loglog import EPSILON, Array, interpolation_errors

KINDS = ("independent", "uneven", "correlated", "outliers")
"""Kinds of scatter that may be asked for by name."""

SMOOTH = 0.12
"""Share of the distances from a line that is noise, below which they are a bend and no scatter."""

BEYOND_DOUBT = 10.0
"""Difference of AICc from which on a model is taken instead of a simpler one."""

FEWEST_FOR_BEND = 8
"""Points from which on a bend is looked for among noise."""

UNEVEN, OUTLYING = 0.02, 0.005
"""Chances of even noise at which it is called uneven, and of normal noise at which it is said to have outliers."""

RARE = 1e-3
"""Probability below which a test denies."""


def library(name: str) -> Any:
    """A module of statsmodels or lmfit. Raises SweepError that names the extra."""
    try:
        return import_module(name)
    except ImportError:
        raise missing(f"error bars of values that scatter need {name.partition('.')[0]}", "fit") from None


def noise_size(t: Array, z: Array) -> float:
    """Size of independent noise on a smooth curve without gaps: the least of what points are off their neighbours.

    A point is tried by the polynomials through two, four, six and eight neighbours: noise leaves the same in all, a
    bend ever less.
    """
    counts = [count for count in (2, 4, 6, 8) if t.size > count + 2]
    return min((float(np.sqrt(np.mean(interpolation_errors(t, z, count) ** 2))) for count in counts), default=math.inf)


def rounding(t: Array, z: Array) -> float:
    """What rounding of both coordinates leaves of a line."""
    slope = abs(z[-1] - z[0]) / abs(t[-1] - t[0])
    return float(EPSILON * (1.0 + abs(z).max() + slope * abs(t).max()))


def is_scatter(t: Array, off: Array, z: Array, bound: Array) -> bool:
    """Whether distances `off` of points from a line are scatter, and not a bend, rounding or the stated error
    bounds."""
    size = math.sqrt(float(off @ off) / max(1, off.size - 2))
    if size <= 8 * rounding(t, z) or (bound.any() and (abs(off) <= 2 * bound).all()):
        return False
    return noise_size(t, off) > SMOOTH * size


def bend(t: Array, z: Array, confidence: float, weights: Array) -> tuple[float, float] | None:
    """Least and largest slope of a curve among noise, with its confidence interval; None where a line does as well.

    Parabola and cubic are tried against the line, all with noise that may be correlated and uneven, since correlated
    noise resembles a bend; the slope is that of the best polynomial up to the sixth degree.
    """
    if t.size < FEWEST_FOR_BEND:
        return None
    u = 2 * (t - t[0]) / (t[-1] - t[0]) - 1
    columns = [np.polynomial.chebyshev.chebvander(u, degree).astype(np.float64) for degree in (1, 2, 3)]
    straight, *bent = (criterion(of_degree, z, weights) for of_degree in columns)
    if not min(bent) < straight - BEYOND_DOUBT:
        return None
    sm, degrees = library("statsmodels.api"), range(2, min(6, t.size - 3) + 1)
    tries = [sm.WLS(z, np.polynomial.chebyshev.chebvander(u, d), weights=weights).fit() for d in degrees]
    found = min(tries, key=lambda fit: corrected(-2 * fit.llf, t.size, fit.params.size + 1))
    degree = found.params.size - 1
    derivatives = [np.polynomial.chebyshev.chebder(one) for one in np.eye(degree + 1)]
    slope_columns = np.stack([np.polynomial.chebyshev.chebval(u, d) * np.ones_like(u) for d in derivatives], axis=1)
    slope_columns = slope_columns * 2 / (t[-1] - t[0])
    error = np.sqrt(np.einsum("ni,ij,nj->n", slope_columns, found.cov_params(), slope_columns))
    reach, slope = student(t.size - degree - 1, confidence) * error, slope_columns @ found.params
    return float((slope - reach).min()), float((slope + reach).max())


def scattered(t: Array, z: Array, confidence: float, kind: str | None = None) -> Scatter:
    """The line through points that scatter, with an interval that holds for the kind of scatter.

    Parameters
    ----------
    kind : one of KINDS, optional
        Default: what tests find. An interval is then never less than that for correlated noise of any size that the
        points allow, nor than that by heteroscedasticity-consistent errors: tests take uneven noise for outliers.
    """
    sm = library("statsmodels.api")
    columns = sm.add_constant(t - t.mean())
    plain = sm.OLS(z, columns).fit()
    found = kind or _kind(t, plain, columns)
    if kind == "outliers":
        return _robust(sm, columns, z, confidence)
    if found == "independent":
        return _weighted(sm, columns, z, np.ones(t.size), found, confidence)
    weights = 1 / _variance(plain.resid, columns) if found == "uneven" else np.ones(t.size)
    if kind == "correlated":
        return correlated(t, z, confidence)
    sandwich = _weighted(sm, columns, z, weights, found, confidence, cov_type="HC3")
    if kind == "uneven":
        return sandwich
    tried = [sandwich, correlated(t, z, confidence, weights)]
    if found == "outliers":
        tried.append(_robust(sm, columns, z, confidence))
    error, low, high = max(s.error for s in tried), min(s.low for s in tried), max(s.high for s in tried)
    return Scatter(found, tried[-1].weights, error, low, high)


def weighted(t: Array, z: Array, sigma: Array, confidence: float) -> tuple[Scatter, bool]:
    """The line through points of known standard errors, by the normal distribution, and whether it fits.

    It does unless chi-squared or the runs of signs are such that one set of noise in a thousand has.
    """
    from scipy.special import gdtrc, ndtri

    sm = library("statsmodels.api")
    fit = sm.WLS(z, sm.add_constant(t - t.mean()), weights=sigma**-2.0).fit(cov_type="fixed scale")
    off = fit.resid / sigma
    slope, error = float(fit.params[1]), float(fit.bse[1])
    reach = float(ndtri((1 + confidence) / 2)) * error
    fits = gdtrc(0.5, (off.size - 2) / 2, float(off @ off)) > RARE and not runs_deny(off)
    return Scatter("weighted", sigma**-2.0, error, slope - reach, slope + reach), bool(fits)


def line_deviance(t: Array, z: Array, floor: float = 0.0) -> tuple[float, int]:
    """Deviance of a line under the noise that suits it best, and how many numbers it has: slope, level and one of
    noise.

    Noise is correlated, uneven or of Student's t with three degrees of freedom, which has outliers.
    """
    columns = np.stack([np.ones(t.size), t - t.mean()], axis=1)
    off = z - columns @ np.linalg.lstsq(columns, z, rcond=None)[0]
    if float(off @ off) / t.size <= floor:
        return t.size * math.log(floor), 2
    memory = deviance(columns, z, np.ones(t.size))
    weights = 1 / _variance(off, columns)
    tries = [memory, deviance(columns, z, weights) - float(np.log(weights).sum()), _outlying_deviance(columns, z)]
    return min(tries), 3


def _outlying_deviance(columns: Array, z: Array, freedom: float = 3.0) -> float:
    """Deviance under Student's t, by reweighting until nothing changes."""
    weights, scale = np.ones(z.size), 1.0
    off = z
    for _ in range(50):
        root = np.sqrt(weights)
        off = z - columns @ np.linalg.lstsq(columns * root[:, None], z * root, rcond=None)[0]
        scale = float(np.mean(weights * off**2))
        weights = (freedom + 1) / (freedom + off**2 / max(scale, 1e-300))
    logs = -0.5 * (freedom + 1) * np.log1p(off**2 / (freedom * max(scale, 1e-300))).sum()
    constant = math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2) - 0.5 * math.log(freedom * math.pi)
    both = -2 * (logs + z.size * (constant - 0.5 * math.log(max(scale, 1e-300))))
    return float(both - z.size * (1 + math.log(2 * math.pi)))


def runs_deny(off: Array) -> bool:
    """Whether signs of distances come in too few runs for independent noise, by statsmodels' runs test."""
    if off.size < 12 or not 1 < (off > 0).sum() < off.size - 1:
        return False
    statistic, chance = library("statsmodels.sandbox.stats.runs").runstest_1samp(off, cutoff=0.0, correction=True)
    return bool(statistic < 0 and chance < RARE)


def _kind(t: Array, plain: Any, columns: Array) -> str:
    """What scatter is: uneven by Harvey's test, outliers by studentized distances, or any, with an unknown
    correlation."""
    from scipy.special import stdtr

    if t.size >= 12:
        sm = library("statsmodels.api")
        logs = np.log(np.maximum(plain.resid**2, 1e-6 * float(np.mean(plain.resid**2))))
        if sm.OLS(logs, columns).fit().pvalues[1] < UNEVEN:
            return "uneven"
    # the largest externally studentized distance; statsmodels, to find it, fits anew without each point
    left, inside = plain.df_resid, float(np.nanmax(plain.get_influence().resid_studentized_internal ** 2))
    farthest = math.sqrt(inside * (left - 1) / max(left - inside, 1e-300))
    alone = 2 * t.size * stdtr(max(1, t.size - 3), -farthest) < OUTLYING
    return "outliers" if t.size >= 8 and alone else "any"


def _weighted(sm: Any, columns: Array, z: Array, weights: Array, kind: str, confidence: float, **keys: Any) -> Scatter:
    fit = sm.WLS(z, columns, weights=weights).fit(use_t=True, **keys)
    low, high = fit.conf_int(1 - confidence)[1]
    return Scatter(kind, weights, float(fit.bse[1]), float(low), float(high))


def _variance(off: Array, columns: Array) -> Array:
    """Variance of each point where its logarithm changes evenly along the line."""
    logs = np.log(np.maximum(off**2, 1e-6 * float(np.mean(off**2))))
    level = columns @ np.linalg.lstsq(columns, logs, rcond=None)[0]
    found: Array = np.exp(level - level.max())
    return found


def _robust(sm: Any, columns: Array, z: Array, confidence: float) -> Scatter:
    """Tukey's biweight, from Huber's start."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):  # points that are on one line leave a scale of 0
        warnings.simplefilter("ignore")
        fit = sm.RLM(z, columns, M=sm.robust.norms.TukeyBiweight()).fit()
    slope, error = float(fit.params[1]), float(fit.bse[1])
    reach = student(z.size - 2, confidence) * error
    return Scatter("outliers", fit.weights, error, slope - reach, slope + reach)
