"""Two power laws and the smooth bend between them, fitted at once, and whether one law would do.

    ln y = c + p1 u + (p2 - p1) w ln(1 + exp(u/w)),   u = ln(x/x0)                                  (1)

p1 holds far below x0 and p2 far above; w is the width of the bend in ln x.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import xarray as xr

from sweep.errors import SweepError
from sweep.laws.correlated import averaged, corrected, student
from sweep.laws.curves import Window, along, check_confidence, noise_of, scatter_is_noise, title, window_logs
from sweep.laws.fits import Found, fitted
from sweep.laws.lines import check_noise, crossover, fit_exponent
from sweep.laws.loglog import EPSILON, Array, slopes, tends
from sweep.laws.scatter import BEYOND_DOUBT, line_deviance, noise_size, rounding
from sweep.laws.shapes import BENDS, LOGARITHM, POWERS, STRETCHED, TWO

FEWEST_POINTS = 8
"""Points for the five numbers of (1) and an error bar."""

TELLING = 16
"""Points from which independent noise is told from the misfit of a smooth truth,"""
TELLING_MEMORY, ROUGH = 40, 0.15
"""and points and share of the distances that neighbours do not tell, from which on noise that remembers is: smooth
bends have 0.08 at most, correlations of 0.95 at least 0.19."""
SMOOTH_TO = 1e-5
"""Share up to which the points are smooth, and no noise moves the limits to which local exponents tend."""

OTHER_SHAPES = 20.0
"""Difference of AICc from which on a bend of another shape is ruled out; more than for a second law, since the truth
may be between the shapes that are tried."""
BEYOND_SHAPES = 0.5
"""Share of what other shapes add to where the laws meet, added again: the true one may be none of them."""
ALIKE = 1e6
"""Condition of the five numbers of (1) beyond which points do not tell them apart, as those of a single law."""

LAWS = ("low", "high")
EXPONENTS = ("exponent", "exponent_low", "exponent_high")
"""Numbers of each law,"""
OTHERS = (
    *("crossover", "crossover_low", "crossover_high", "width", "level"),
    *("residual", "points", "regimes", "evidence", "noisy"),
)
"""and those of both, which stand behind them in the result of one line."""

NAMES = {
    "exponent": "exponent of the power law",
    "exponent_low": "lower end of the confidence interval of the exponent",
    "exponent_high": "upper end of the confidence interval of the exponent",
    "crossover": "where the two laws meet",
    "crossover_low": "lower end of the confidence interval of the crossover",
    "crossover_high": "upper end of the confidence interval of the crossover",
    "width": "width of the bend, in decades",
    "level": "y where the two laws meet",
    "residual": "largest relative distance of a point from the curve",
    "points": "points in the fit",
    "regimes": "2 where two laws are beyond doubt: evidence above 10",
    "evidence": "by how much AICc and BIC prefer two laws to one, whatever its noise, and to a logarithm",
    "noisy": "1 where the intervals are of noise, 0 where of the curvature of noise-free values",
}


def fit_two_laws(
    y: xr.DataArray,
    dim: str,
    window: Window | None = None,
    *,
    confidence: float = 0.95,
    noise: bool | str | None = None,
    windows: tuple[Window, Window] | None = None,
) -> xr.Dataset:
    """Two power laws with a smooth crossover, equation (1), and whether one law would do.

    Intervals: where the points scatter about the curve (`noise`), those of least squares, by Student's t. Where they
    do not, as in a simulation, there is no noise to speak of and the uncertainty is how far the truth is from (1):
    the interval of an exponent then also reaches to the local exponent at its end of the window and, three times over,
    to the limit to which that tends; that of the crossover to where the local exponent is half-way between the
    two, and to where the tangents at the ends meet. What noise there is beneath is added.

    Where there is noise, though it be far less than the truth is from (1), the intervals also reach over those of bends
    of other shapes that the points do not rule out (AICc within 20): hyperbolic, asymmetric, of two widths, stretched.
    They are wider than 95 % for a truth like (1), and no promise for a truth like none of them.

    Parameters
    ----------
    y : DataArray
        Any shape; missing points are left out.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and strictly monotone.
    window : (low, high), optional
        Ends in the unit of `dim`, both included.
    confidence : float
        Of the intervals.
    noise : bool or "independent", "uneven", "correlated", "outliers", optional
        Whether the values scatter; intervals then hold for noise that remembers the point before, too, unless it is
        said to be independent. Default: as the scatter of neighbours about the curve shows; with fewer than 16 points,
        where it shows nothing, intervals are wide enough for both.
    windows : pair of (low, high), optional
        Fit a straight line in each of two windows, which share at most an end point, and say where the two lines
        meet; nothing is fitted between them.

    Returns
    -------
    Dataset
        `exponent`, `exponent_low`, `exponent_high` along `law` ("low", "high"); `crossover` with its interval, in
        the unit of `dim`; `width` [decades], `level` (y where the laws meet), `residual`, `points`, `regimes` (1 or
        2), `evidence` (difference of BIC), `noisy`. NaN where fewer than eight points are left.

        With `windows`: `exponent`, `exponent_low`, `exponent_high` along `law`; `crossover`, `crossover_error`,
        `level`. Where points scatter, the error is a standard error, from those of the two lines. Where they do not, it
        is a bound: how far the place moves if a law is not the line through its window but goes through the outer end
        of it with the exponent to which the local one tends there.

    Raises
    ------
    SweepError
        If `dim` is unknown or unfit, y is not positive in the window, or no line has eight points.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(1e-3, 1e6, 91)})
    >>> found = sweep.fit_two_laws(ds.period, "mu")
    >>> [f"{e:.2f}" for e in found.exponent.values]
    ['-1.00', '-0.34']
    >>> met = sweep.fit_two_laws(ds.period, "mu", windows=((1e-3, 1e-2), (1e5, 1e6)))
    >>> print(f"{float(met.crossover):.1f}")
    0.6
    """
    check_confidence(confidence)
    check_noise(noise)
    if windows is not None:
        if window is not None:
            raise SweepError("window does not go with windows, which say where the two lines are")
        return _in_windows(y, dim, windows, confidence, noise)
    dimension, t, logs = window_logs(y, dim, window)

    def each(z: Array) -> Array:
        rows = [_one(t, row, confidence, noise) for row in z.reshape(-1, t.size)]
        return np.array(rows).reshape(*z.shape[:-1], -1)

    numbers = along(each, logs, dimension, "number")
    if not np.isfinite(numbers.isel(number=slice(len(LAWS) * len(EXPONENTS))).values).any():
        raise SweepError(f"two laws need at least {FEWEST_POINTS} points of {title(y)}, found fewer; widen the window")
    return _described(numbers, y, dim, confidence)


def _in_windows(
    y: xr.DataArray, dim: str, windows: tuple[Window, Window], confidence: float, noise: bool | str | None
) -> xr.Dataset:
    """Two straight lines, and where they meet."""
    try:
        low, high = windows
    except (TypeError, ValueError):
        raise SweepError(f"windows: expected two, ((low, high), (low, high)); found {windows!r}") from None
    fits = [fit_exponent(y, dim, one, confidence=confidence, noise=noise) for one in (low, high)]
    met = crossover(*fits)
    law = xr.DataArray(list(LAWS), dims="law", name="law")
    found = xr.concat([fit[list(EXPONENTS)] for fit in fits], dim=law, combine_attrs="override")
    found["crossover"], found["crossover_error"], found["level"] = met.abscissa, met.abscissa_error, met.ordinate
    found.attrs = {**met.attrs, "confidence": confidence}
    return found


@np.errstate(all="ignore")  # what overflows is infinite; a crossover that is not determined reaches there
def _one(t: Array, z: Array, confidence: float, noise: bool | str | None) -> Array:
    present = np.isfinite(z)
    t, z = t[present], z[present]
    if t.size < FEWEST_POINTS:
        return np.full(len(LAWS) * len(EXPONENTS) + len(OTHERS), np.nan)
    order = np.argsort(t)
    t, z = t[order], z[order]
    best, off, jacobian = _fit(t, z)
    noisy = _is_noise(t, z, off) if noise is None else bool(noise)
    reach = _reach(off, jacobian, confidence)
    low, high = best - reach, best + reach
    if noisy or noise_size(t, off) > SMOOTH_TO * math.sqrt(float(off @ off) / off.size):
        remembers = noisy and noise != "independent"
        more = _by_memory(off, jacobian, confidence, reach) if remembers else np.ones(reach.size)
        low, high = _of_other_bends(t, z, off, best, more * reach, more, confidence)
    if not noisy:
        low, high = _widened(t, z, off, best, low, high)
    evidence = _evidence(t, z, off)
    _, *exponents, places, _ = np.stack([best, low, high], axis=1)
    places, bend = np.exp(places), [math.exp(best[WIDTH]) / math.log(10), float(np.exp(best[LEVEL]))]
    if evidence <= 0 and not noisy:  # straight to rounding: nothing meets anywhere
        places, bend = np.array([np.nan, 0.0, np.inf]), [np.nan, np.nan]
    rest = [float(np.expm1(abs(off).max())), t.size, 2 if evidence > BEYOND_DOUBT else 1, evidence, noisy]
    return np.array([*np.concatenate(exponents), *places, *bend, *rest])


def _is_noise(t: Array, z: Array, off: Array) -> bool:
    """Whether the distances are noise: they scatter, and the points themselves are as rough; or, of many points,
    neighbours differ by more than a smooth truth would.

    A curve of five numbers swings about few points of a smooth truth in a way that looks like scatter; then nothing is
    told, and the intervals are those of both.
    """
    size = math.sqrt(float(off @ off) / (off.size - 5))
    if off.size >= TELLING and bool(scatter_is_noise(off, z)) and size < 3 * noise_of(z):
        return True
    return off.size >= TELLING_MEMORY and size > 8 * rounding(t, z) and noise_size(t, off) > ROUGH * size


LEVEL, LOW, HIGH, PLACE, WIDTH = range(5)
"""Positions of c, p1, p2, ln x0, ln w among the five numbers of (1)."""


def _curve(numbers: Array, t: Array) -> Array:
    """(1)."""
    level, low, high, place, log_width = numbers
    width, u = math.exp(log_width), t - place
    found: Array = level + low * u + (high - low) * width * np.logaddexp(0, u / width)
    return found


def _slopes_of_curve(numbers: Array, t: Array) -> Array:
    """Derivatives of (1) by its five numbers."""
    _, low, high, place, log_width = numbers
    width, u = math.exp(log_width), t - place
    share = 0.5 * (1 + np.tanh(0.5 * u / width))
    bend = width * np.logaddexp(0, u / width)
    by_place = -low - (high - low) * share
    return np.stack([np.ones_like(t), u - bend, bend, by_place, (high - low) * (bend - u * share)], axis=1)


def _fit(t: Array, z: Array) -> tuple[Array, Array, Array]:
    """The five numbers, the distances of the points from the curve, and the Jacobian there."""
    from scipy.optimize import leastsq

    narrowest = math.log(float(np.diff(t).min()) / 30)  # a sharper bend looks the same at these points

    def held(q: Array) -> Array:
        return np.array([*q[:WIDTH], min(max(q[WIDTH], narrowest), math.log(t[-1] - t[0]))])

    found = leastsq(
        lambda q: _curve(held(q), t) - z,
        _start(t, z),
        Dfun=lambda q: _slopes_of_curve(held(q), t),
        xtol=1e-12,
        ftol=1e-14,
        full_output=True,
    )
    best = held(found[0])
    return best, z - _curve(best, t), _slopes_of_curve(best, t)


def _start(t: Array, z: Array) -> Array:
    """The numbers of (1) by variable projection, turned from parts of the window."""
    found, span = fitted(TWO, t, z), float(t[-1] - t[0])
    assert found is not None  # FEWEST_POINTS are enough
    place, log_width, level, low, high = found.numbers
    return np.array([level, low / span, high / span, t[0] + place * span, log_width + math.log(span)])


def _reach(off: Array, jacobian: Array, confidence: float) -> Array:
    """Half the confidence interval of each number, by Student's t."""
    from scipy.special import stdtrit

    left = off.size - jacobian.shape[1]
    size = np.sqrt((jacobian**2).sum(axis=0))
    size[size == 0] = 1.0
    inverse = np.linalg.pinv(jacobian / size) / size[:, None]  # of columns alike in size, and never squared
    error = np.sqrt((inverse**2).sum(axis=1) * (off @ off) / left)
    found: Array = stdtrit(left, (1 + confidence) / 2) * error
    return found


def _widened(t: Array, z: Array, off: Array, best: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Intervals that reach to where the local exponents tend; of the crossover, to where they are half-way between the
    laws and to where the tangents at the ends of the window meet."""
    local, mirrored = slopes(t, z, 5), -t[::-1]
    half = np.flatnonzero(np.diff(np.sign(local - (best[LOW] + best[HIGH]) / 2)))
    place = t[half[np.argmin(abs(t[half] - best[PLACE]))]] if half.size else best[PLACE]
    doubt = 2.5 * noise_of(off) * np.array([_amplified(t), _amplified(mirrored)])
    ends = np.array([tends(t, local, doubt[0]), tends(mirrored, local[::-1], doubt[1])])
    low, high = low.copy(), high.copy()
    laws = slice(LOW, HIGH + 1)
    low[laws] = np.minimum(low[laws], ends.min(axis=1) - doubt)
    high[laws] = np.maximum(high[laws], ends.max(axis=1) + doubt)
    steep = np.concatenate([ends, (ends[:, 0] - doubt)[:, None], (ends[:, 0] + doubt)[:, None]], axis=1)
    # where lines of these slopes through the first and the last point meet
    pairs = [pair for pair in itertools.product(*steep) if pair[0] != pair[1]]
    meetings = [float((z[-1] - z[0] + p * t[0] - q * t[-1]) / (p - q)) for p, q in pairs]
    low[PLACE], high[PLACE] = min(low[PLACE], place, *meetings), max(high[PLACE], place, *meetings)
    return low, high


def _amplified(t: Array) -> float:
    """Standard error of the local exponent at the start of a window, for values with errors of size 1."""
    near = t[:5]
    return float(np.sqrt((slopes(near, np.eye(near.size), 5)[:, 0] ** 2).sum()))


def _by_memory(off: Array, jacobian: Array, confidence: float, reach: Array) -> Array:
    """How many times further each interval reaches where the noise may remember that of the point before."""
    size = np.maximum(np.sqrt((jacobian**2).sum(axis=0)), 1e-300)
    columns = jacobian / size
    if np.linalg.cond(columns) > ALIKE:
        return np.ones(reach.size)
    memory = averaged(columns, off, confidence, np.ones(off.size))
    found: Array = np.maximum(1.0, np.maximum(memory.high, -memory.low) / size / np.maximum(reach, 1e-300))
    return found


def _of_other_bends(
    t: Array, z: Array, off: Array, numbers: Array, reach: Array, more: Array, confidence: float
) -> tuple[Array, Array]:
    """Intervals that reach over those of every bend of another shape that the points do not rule out.

    Where noise remembers, intervals reach `more` times as far, and points rule out less by the square of that.
    """
    tried = [(found, 1.0) for law in BENDS[1:] if (found := fitted(law, t, z)) is not None]
    own = corrected(off.size * math.log(float(off @ off) / off.size + 1e-300), off.size, 6)
    best = min([own, *(found.aicc for found, _ in tried)])
    stretched = [_other_powers(t, z, found, confidence) for found, _ in tried if found.law is STRETCHED]
    low, high = numbers - reach, numbers + reach
    own_low, own_high, span = low.copy(), high.copy(), t[-1] - t[0]
    which = [LOW, HIGH, PLACE]
    allowed = OTHER_SHAPES * float(more[which[:2]].max()) ** 2
    for found, share in itertools.chain(tried, *stretched):
        if found.aicc > best + allowed:
            continue
        count = len(found.law.grids)
        q, slopes_there = found.numbers[0], found.numbers[count + 1 : count + 3]
        wide = student(t.size - found.law.numbers, confidence) * found.errors[[count + 1, count + 2, 0]] * more[which]
        middle = np.array([*slopes_there / span, t[0] + q * span])
        wide = wide * share * np.array([1 / span, 1 / span, span])
        low[which], high[which] = np.fmin(low[which], middle - wide), np.fmax(high[which], middle + wide)
    further = BEYOND_SHAPES * np.array([own_low[PLACE] - low[PLACE], high[PLACE] - own_high[PLACE]])
    low[PLACE], high[PLACE] = low[PLACE] - further.max(), high[PLACE] + further.max()
    return low, high


def _other_powers(t: Array, z: Array, best: Found, confidence: float) -> list[tuple[Found, float]]:
    """Bends stretched by other powers that the points allow, and the share of its interval that this leaves to each.

    Errors of exponents grow as the power falls, so that those at the best one do not tell how far it may be from there:
    the profile likelihood does.
    """
    left = t.size - STRETCHED.numbers
    doubt = t.size * math.log1p(student(left, confidence) ** 2 / left)
    allowed = []
    for falls in (True, False):
        powers = [power for power in POWERS if (power < best.numbers[2]) == falls]
        for power in sorted(powers, reverse=falls):
            found = fitted(POWERS[power], t, z)
            if found is None or found.deviance >= best.deviance + doubt:
                break
            allowed.append((found, math.sqrt(min(1.0, 1 - (found.deviance - best.deviance) / doubt))))
    return allowed


def _evidence(t: Array, z: Array, off: Array) -> float:
    """By how much (1) is better than a line and than a logarithm, whatever the noise of the line: AICc, and BIC for
    many points, of even, uneven, correlated noise and of noise with outliers."""
    floor = (4 * EPSILON * (1 + abs(z).max())) ** 2  # what rounding leaves
    bent = off.size * math.log(float(off @ off) / off.size + floor)
    rivals = [
        line_deviance(t, z, floor),
        *((found.deviance, 3) for law in (LOGARITHM,) if (found := fitted(law, t, z))),
    ]
    gains = [
        min(
            corrected(deviance, t.size, k + 1) - corrected(bent, t.size, 6),
            deviance - bent + (k - 5) * math.log(t.size),
        )
        for deviance, k in rivals
    ]
    return float(min(gains))


def _described(numbers: xr.DataArray, y: xr.DataArray, dim: str, confidence: float) -> xr.Dataset:
    labels = [f"{name} {law}" for law in LAWS for name in EXPONENTS] + list(OTHERS)
    numbers = numbers.assign_coords(number=labels)
    found = xr.Dataset()
    for name in EXPONENTS:
        pair = [numbers.sel(number=f"{name} {law}", drop=True) for law in LAWS]
        found[name] = xr.concat(pair, dim=xr.DataArray(list(LAWS), dims="law", name="law"))
    for name in OTHERS:
        found[name] = numbers.sel(number=name, drop=True)
    place, units = (str(c.attrs.get("units", "1")) for c in (y.coords[dim], y))
    of: dict[str, Any] = {"crossover": place, "crossover_low": place, "crossover_high": place, "level": units}
    for name in (*EXPONENTS, *OTHERS):
        found[name].attrs = {"units": of.get(name, "1"), "long_name": NAMES[name]}
    found.attrs = {"y": title(y), "x": dim, "confidence": confidence, "law": "equation (1) of sweep.laws.two_laws"}
    return found
