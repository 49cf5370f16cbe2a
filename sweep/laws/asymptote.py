"""The exponent far out, by a correction to scaling.

    y = A x^p (1 + B x^-D)                                                                          (1)

D > 0 where p holds at large x, D < 0 where it holds at small x. B and D are hardly told apart, so D is not estimated
for the interval: each of a grid has its weight, by restricted likelihood, as each noise has.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import gammaincc

from sweep.errors import SweepError
from sweep.laws.curves import (
    Window,
    check_confidence,
    check_end,
    described,
    numbers_by_line,
    relative_sigma,
    title,
    window_logs,
)
from sweep.laws.fits import Found, errors, fitted
from sweep.laws.lines import check_noise, rounding
from sweep.laws.loglog import Array, slope_bounds, slopes
from sweep.laws.noise import RARE, UNLIKELY, noise_size, regress, runs_chance
from sweep.laws.shapes import CORRECTION, LOG_CORRECTION, Law, Parts

FEWEST_POINTS = 8
SCATTERS = 0.3
"""Share of the distances from (1) that is noise between neighbours, from which on they are noise."""
AS_WELL = 4.0
"""Difference of AICc up to which a logarithmic correction, whose exponent is far harder to tell, is not ruled out."""
MORE = 3
"""Polynomials beside (1) that must not describe the points better by far."""

VERDICTS = ("a power law with a correction", "no power law with a correction", "no law at this end")
NAMES = {
    "exponent": "exponent far out",
    "exponent_low": "lower end of its interval",
    "exponent_high": "upper end of its interval",
    "verdict": "whether the points are a power law with a correction that fades",
    "correction_exponent": "D: how fast the correction fades",
    "correction": "B x^-D at the outer end of the window",
    "residual": "largest relative distance of a point from the curve",
    "noisy": "1 where the interval is of noise, 0 where of what a smaller window says otherwise",
    "fits": "1 where (1) describes the points, and its correction is less than 1 at the end",
}


def fit_correction(
    y: xr.DataArray,
    dim: str,
    window: Window | None = None,
    *,
    end: str = "high",
    confidence: float = 0.95,
    noise: bool | str | None = None,
    sigma: Any = None,
) -> xr.Dataset:
    """Asymptotic exponent by a correction to scaling, equation (1), and whether the points follow it.

    Where there is noise, the interval is that of a mixture over all D and over the noises of `fit_exponent`, and
    reaches over that of a logarithmic correction (1 + B ln x)^c where the points do not tell it from (1). Where
    there is none, it is three times as far as the fit to the outer half of the window moves the exponent. There is no
    interval where the points deny (1): by polynomials beside it that describe them far better, by too few runs of
    signs where `noise="even"` or `sigma` is given, by chi-squared where `sigma` is.

    Parameters
    ----------
    y : DataArray
        Any shape; missing points are left out, and lines with a value that is not positive.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and monotone.
    window : (low, high), optional
        Ends in the unit of `dim`.
    end : "high" or "low"
        Where (1) tends to a power law.
    confidence : float
        Of the intervals.
    noise : bool or "even", "uneven", "correlated", "outliers", optional
        Whether there is noise, or of which kind. Default: as the points show.
    sigma : number or DataArray, optional
        Standard errors of the values, in the unit of y; then `noise` is not given.

    Returns
    -------
    Dataset
        `exponent` with `exponent_low`, `exponent_high`; `verdict`, words; `correction_exponent` (D) [1];
        `correction`, B x^-D at the outer end; `residual`; `noisy`; `fits`. The dimensions are those of `y` but `dim`.
        NaN of fewer than eight points.

    Raises
    ------
    SweepError
        If `dim` or `end` is unknown or unfit, y is nowhere positive in the window, or no line has eight points.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(10, 1e5, 41)})
    >>> print(f"{float(sweep.fit_correction(ds.period, 'mu').exponent):.4f}")
    -0.3334
    """
    check_confidence(confidence)
    check_end("end", end)
    check_noise(noise, sigma)
    here, t, logs, _ = window_logs(y, dim, window, repeated=True)
    ((dimension, _),) = here.items()
    sign = 1.0 if end == "high" else -1.0
    sigmas = relative_sigma(y, sigma).isel(here)
    found = numbers_by_line(
        tuple(NAMES), lambda z, s: _one(sign * t, z, s, sign, confidence, noise), logs, dimension, sigmas
    )
    if not bool(found.residual.notnull().any()):
        raise SweepError(
            f"a correction to scaling needs at least {FEWEST_POINTS} points of {title(y)}; widen the window"
        )
    words = np.array([*VERDICTS, "too few points"])
    found["verdict"] = found.verdict.dims, words[found.verdict.fillna(-1).astype(np.int64)]
    law = f"{title(y)} = A {dim}^p (1 + B {dim}^-D), {end} end"
    return described(found, NAMES, {}, {"y": title(y), "x": dim, "law": law}, confidence)


@np.errstate(all="ignore")  # what overflows is infinite
def _one(t: Array, z: Array, sigma: Array, sign: float, confidence: float, noise: bool | str | None) -> Array:
    """NAMES of one line; t runs towards the end where (1) is a power law, and exponents take `sign`."""
    known = bool(np.isfinite(sigma).any())
    present = np.flatnonzero(np.isfinite(z) & (np.isfinite(sigma) | (not known)))
    present = present[np.argsort(t[present], kind="stable")]
    t, z, weights = t[present], z[present], sigma[present] ** -2.0 if known else None
    found = fitted(CORRECTION, t, z, weights, known) if t.size >= FEWEST_POINTS and np.ptp(t) > 0 else None
    if found is None:
        return np.full(len(NAMES), np.nan)
    exponent, fade, left = _outer(found, t)
    size = float(np.sqrt(np.mean(found.off**2)))
    beyond_rounding = size > 8 * rounding(t, z)
    noisy = known or bool(beyond_rounding and (noise_size(t, found.off) > SCATTERS * size if noise is None else noise))
    word = noise if isinstance(noise, str) else "noise"
    fits = True
    if not noisy:
        low, high = _by_half(t, z, exponent)
    else:
        fits = not _denied(t, found, word, weights)
        low, high = _mixture(t, z, found, word, confidence, weights) if fits else (math.nan, math.nan)
    reached = [sign * one for one in (low, high, exponent)] if fits else [math.nan, math.nan]
    verdict = 1 if not fits else 0 if abs(left) < 1 else 2
    residual = float(np.expm1(min(abs(found.off).max(), 700.0)))
    ends = sign * exponent, min(reached), max(reached)
    return np.array([*ends, verdict, sign * fade, left, residual, noisy, verdict == 0])


def _outer(found: Found, t: Array) -> tuple[float, float, float]:
    """p and D of the law that is left at the last point, and the correction there.

    (1) is a sum of two powers; whichever is larger there is the law, and the other one the correction.
    """
    log_strength, fade, _, exponent = found.numbers
    span = float(t[-1] - t[0])
    last = math.expm1(log_strength) * math.exp(min(-fade, 0.0))
    if fade > 0:
        return exponent / span, fade / span, last
    return (exponent - fade) / span, -fade / span, 1 / last if last else math.inf


def _by_half(t: Array, z: Array, exponent: float) -> tuple[float, float]:
    """Ends of an interval three times as far as the outer half of the window moves the exponent."""
    first = np.append(True, np.diff(t) > 0)
    t, z = t[first], z[first]
    half = t >= (t[0] + t[-1]) / 2
    other = fitted(CORRECTION, t[half], z[half])
    local = slopes(t, z, 5)[-1] if other is None else _outer(other, t[half])[0]
    doubt = float(slope_bounds(t, np.full(t.size, 1e-15 * (1 + abs(z).max())), 5)[-1])
    reach = 3 * abs(float(local) - exponent) + doubt
    return exponent - reach, exponent + reach


def _denied(t: Array, found: Found, word: str, weights: Array | None) -> bool:
    """Whether the points are not (1) and noise."""
    if weights is not None:
        square = float((found.off**2 * weights).sum())
        return bool(gammaincc((t.size - 4) / 2, square / 2) < RARE or runs_chance(found.off) < RARE)
    if word == "even" and runs_chance(found.off) < RARE:
        return True
    u = 2 * (t - t[0]) / (t[-1] - t[0]) - 1
    columns = found.jacobian[:, np.isfinite(errors(found))]
    every = np.concatenate([columns, np.polynomial.chebyshev.chebvander(u, 1 + MORE)[:, 2:]], axis=1)
    return bool(regress(t, every, found.off[None], word, columns.shape[1]).chance[0] < UNLIKELY)


def _mixture(
    t: Array, z: Array, found: Found, word: str, confidence: float, weights: Array | None
) -> tuple[float, float]:
    """Ends of the interval of the exponent, over all D and noises."""
    span, parts, evidence = float(t[-1] - t[0]), [], []
    best = float(np.clip(abs(found.numbers[1]), *FADES))
    doubt = float(np.nan_to_num(errors(found, weights)[1], posinf=best)) / best
    tried = best * np.exp(np.linspace(-6.0, 6.0, 25) * np.clip(doubt, 0.01, 0.5))
    for fade in tried[(tried >= FADES[0]) & (tried <= FADES[1])]:
        one = fitted(_of_fade(float(fade)), t, z, weights, weights is not None)
        if one is None or not np.isfinite(one.jacobian).all() or not np.isfinite(errors(one)).all():
            continue
        part = regress(t, one.jacobian, one.off[None], "even" if weights is not None else word)
        log = float(part.evidence[0])
        if weights is not None:
            part = part._replace(error=errors(one, weights)[None, :, None], left=MANY)
            log = -0.5 * float((one.off**2 * weights).sum())
        parts.append(part._replace(value=part.value + one.numbers[:, None]))
        evidence.append(log)
    shares = np.exp(np.array(evidence) - max(evidence))
    both = parts[0]._replace(
        weight=np.concatenate([one.weight * share for one, share in zip(parts, shares / shares.sum(), strict=True)]),
        **{name: np.concatenate([getattr(one, name) for one in parts]) for name in ("value", "error", "share")},
    )
    ends = [float(end[0]) for end in both.interval(2, confidence)]
    slow = fitted(LOG_CORRECTION, t, z, weights, weights is not None)
    if slow is not None and slow.aicc < found.aicc + AS_WELL and np.isfinite(errors(slow)).all():
        line = regress(t, slow.jacobian, slow.off[None], "even" if weights is not None else word)
        ends += [float(slow.numbers[3] + end[0]) for end in line.interval(3, confidence)]
    return min(ends) / span, max(ends) / span


@functools.lru_cache(maxsize=256)
def _of_fade(fade: float) -> Law:
    """(1) of one D."""

    def parts(q: Array, s: Array, span: float) -> Parts:
        every = CORRECTION.parts(np.array([q[0], fade]), s, span)
        return every._replace(shift_by_q=every.shift_by_q[:, :1], columns_by_q=every.columns_by_q[:, :1])

    return CORRECTION._replace(parts=parts, starts=CORRECTION.starts[:1], limits=CORRECTION.limits[:1], numbers=3)


FADES = (0.3, 80.0)
"""How fast a correction may fade, per window."""
MANY = 10**7
"""Degrees of freedom of a normal distribution."""
