"""The exponent far out, by a correction to scaling.

    y = A x^p (1 + B x^-D)                                                                          (1)

D > 0 where p holds at large x, D < 0 where it holds at small x. Intervals are by profile likelihood: those by standard
errors are too narrow where B and D are hardly told apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import xarray as xr

from sweep.errors import SweepError
from sweep.laws.correlated import student
from sweep.laws.curves import Window, check_confidence, check_end, numbers_along, title, window_logs
from sweep.laws.fits import Found, fitted
from sweep.laws.loglog import Array, slope_bounds, slopes
from sweep.laws.scatter import noise_size
from sweep.laws.shapes import CORRECTION

FEWEST_POINTS = 8

SCATTERS = 0.3
"""Share of the distances from (1) that is noise between neighbours, from which on they are scatter."""

INTERVAL = ("exponent", "exponent_low", "exponent_high")
NUMBERS = (*INTERVAL, "correction_exponent", "correction", "residual", "noisy", "fits")

NAMES = {
    "exponent": "exponent far out",
    "exponent_low": "lower end of its interval",
    "exponent_high": "upper end of its interval",
    "correction_exponent": "D: how fast the correction fades",
    "correction": "B x^-D at the outer end of the window",
    "residual": "largest relative distance of a point from the curve",
    "noisy": "1 where the interval is of scatter, 0 where of what a smaller window says otherwise",
    "fits": "1 where the correction fades towards the end and is less than 1 there",
}


def fit_correction(
    y: xr.DataArray, dim: str, window: Window | None = None, *, end: str = "high", confidence: float = 0.95
) -> xr.Dataset:
    """Asymptotic exponent by a correction to scaling, equation (1).

    Where points scatter, the interval is by profile likelihood, of independent noise of one size; without an end
    where no exponent can be ruled out. Where they do not, it is three times as far as the fit to the outer half of
    the window moves the exponent.

    Parameters
    ----------
    y : DataArray
        Any shape; missing points are left out.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and strictly monotone.
    window : (low, high), optional
        Ends in the unit of `dim`.
    end : "high" or "low"
        Where (1) tends to a power law.
    confidence : float
        Of the intervals.

    Returns
    -------
    Dataset
        `exponent` with `exponent_low`, `exponent_high`, `correction_exponent` (D) [1]; `correction`, B x^-D at the
        outer end; `residual`; `noisy`; `fits`. The dimensions are those of `y` but `dim`. NaN of fewer than eight
        points.

    Raises
    ------
    SweepError
        If `dim` or `end` is unknown or unfit, or y is not positive in the window.

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
    dimension, t, logs = window_logs(y, dim, window)
    sign = 1.0 if end == "high" else -1.0

    def each(z: Array) -> Array:
        rows = [_one(sign * t, row, sign, confidence) for row in z.reshape(math.prod(z.shape[:-1]), t.size)]
        return np.array(rows).reshape(*z.shape[:-1], len(NUMBERS))

    found = numbers_along(NUMBERS, each, logs, dimension)
    if not bool(found.exponent.notnull().any()):
        raise SweepError(
            f"a correction to scaling needs at least {FEWEST_POINTS} points of {title(y)}; widen the window"
        )
    for name, text in NAMES.items():
        found[name].attrs = {"units": "1", "long_name": text}
    found.attrs = {"y": title(y), "x": dim, "law": f"{title(y)} = A {dim}^p (1 + B {dim}^-D), {end} end"}
    return found


@np.errstate(all="ignore")  # what overflows is infinite
def _one(t: Array, z: Array, sign: float, confidence: float) -> Array:
    """One line; t runs towards the end where (1) is a power law, and exponents take `sign`."""
    present = np.flatnonzero(np.isfinite(z))
    present = present[np.argsort(t[present])]
    t, z = t[present], z[present]
    found = fitted(CORRECTION, t, z)
    if found is None or t.size < FEWEST_POINTS:
        return np.full(len(NUMBERS), np.nan)
    exponent, fade, left = _outer(found, t)
    beyond_rounding = abs(found.off).max() > 1e-12 * (1 + abs(z).max())
    noisy = bool(beyond_rounding and noise_size(t, found.off) > SCATTERS * float(np.sqrt(np.mean(found.off**2))))
    ends = _profile(t, z, found, confidence) if noisy else _by_half(t, z, exponent)
    # of a D that is not within FADES the profile does not know
    reached = [sign * end for end in (*ends, exponent)]
    residual = float(np.expm1(abs(found.off).max()))
    return np.array([sign * exponent, min(reached), max(reached), sign * fade, left, residual, noisy, abs(left) < 1])


def _outer(found: Found, t: Array) -> tuple[float, float, float]:
    """p and D of the law that is left at the last point, and the correction there.

    (1) is a sum of two powers; whichever is larger there is the law, and the other one the correction.
    """
    strength, fade, _, exponent = found.numbers
    span = float(t[-1] - t[0])
    last = float(strength * math.exp(min(-fade / 2, 300.0)))
    if fade > 0:
        return exponent / span, fade / span, last
    return (exponent - fade) / span, -fade / span, 1 / last if last else math.inf


def _by_half(t: Array, z: Array, exponent: float) -> tuple[float, float]:
    """Ends of an interval three times as far as the outer half of the window moves the exponent."""
    half = t >= (t[0] + t[-1]) / 2
    other = fitted(CORRECTION, t[half], z[half])
    local = slopes(t, z, 5)[-1] if other is None else _outer(other, t[half])[0]
    rounding = float(slope_bounds(t, np.full(t.size, 1e-15 * (1 + abs(z).max())), 5)[-1])
    reach = 3 * abs(float(local) - exponent) + rounding
    return exponent - reach, exponent + reach


def _profile(t: Array, z: Array, found: Found, confidence: float) -> tuple[float, float]:
    """Exponents at which the least sum of squares, all else fitted anew, is as far up as noise takes it.

    The threshold is Student's t squared, which is F's of one and n - 4 degrees of freedom.
    """
    span = float(t[-1] - t[0])
    s = (t - t[0]) / span
    strength, fade, _, slope = found.numbers
    if fade < 0:  # the other of the two powers is the law
        strength, fade, slope = 1 / strength if strength else 0.0, -fade, slope - fade
    share = math.log(min(max(fade, FADES[0]), FADES[1]) / FADES[0]) / math.log(FADES[1] / FADES[0])
    start = np.array([strength, math.asin(0.999 * (2 * share - 1)), slope])
    best = _least(lambda p: _beside(s, z, p[:2], p[2]), start)
    least = float((_beside(s, z, best[:2], best[2]) ** 2).sum())
    wanted = least * (1 + student(t.size - 4, confidence) ** 2 / (t.size - 4))
    first = max(float(np.nan_to_num(found.errors[-1], posinf=2.0)), 0.3 * math.sqrt(least / (t.size - 4)))
    ends = [_edge(s, z, best, sign * min(first, 2.0), wanted) for sign in (-1, 1)]
    return ends[0] / span, ends[1] / span


FADES = (0.3, 80.0)
"""How fast a correction may fade, per window."""


def _beside(s: Array, z: Array, bent: Array, slope: float) -> Array:
    """Distances from (1) at its best level; `bent`: B at the middle, and an angle that keeps D within FADES."""
    fade = FADES[0] * (FADES[1] / FADES[0]) ** (0.5 + 0.5 * math.sin(bent[1]))
    factor = 1 + bent[0] * np.exp(-fade * (s - 0.5))
    off: Array = slope * s + np.log(np.maximum(factor, 1e-300)) - z
    return np.where(factor > 0, off - off[factor > 0].mean(), 10.0) if (factor > 0).any() else np.full(s.size, 10.0)


def _least(off: Callable[[Array], Array], start: Array) -> Array:
    from scipy.optimize import leastsq

    best: Array = leastsq(off, start, xtol=1e-7, ftol=1e-7, maxfev=400, full_output=True)[0]
    return best


def _edge(s: Array, z: Array, best: Array, step: float, wanted: float) -> float:
    """Where the profile of the sum of squares passes a value, walking from the best; inf after 40 steps."""
    inside, here = float(best[2]), best[:2]

    def held(slope: float) -> tuple[float, Array]:
        bent = _least(lambda q: _beside(s, z, q, slope), here)
        return float((_beside(s, z, bent, slope) ** 2).sum()), bent

    for _ in range(40):
        outside = inside + step
        square, bent = held(outside)
        if square > wanted:
            break
        inside, here, step = outside, bent, 1.4 * step
    else:
        return math.copysign(math.inf, step)
    for _ in range(12):
        middle = (inside + outside) / 2
        square, bent = held(middle)
        if square > wanted:
            outside = middle
        else:
            inside, here = middle, bent
    return outside
