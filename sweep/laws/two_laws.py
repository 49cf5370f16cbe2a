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
from sweep.laws.curves import Window, check_confidence, described, fit_lines, title
from sweep.laws.fits import Found, fitted
from sweep.laws.lines import check_noise, crossover, fit_exponent, rounding
from sweep.laws.loglog import Array, slopes, tends
from sweep.laws.noise import BEYOND_DOUBT, roughness
from sweep.laws.shapes import BENDS, ONE, OTHER_FUNCTIONS, THREE, TWO

TELLING = 16
"""Points from which noise is told from the misfit of a smooth truth,"""
TELLING_MEMORY, ROUGH = 40, 0.15
"""and points and share of the distances that neighbours do not tell, from which on autocorrelated noise is: smooth
bends have 0.08 at most, correlations of 0.95 at least 0.19."""
SCATTERED = 0.5
"""Share that independent noise leaves at least."""
SMOOTH_TO = 1e-5
"""Share up to which the points are smooth, and no noise moves the limits to which local exponents tend."""
SMALLER = 0.2
"""Share of the distances from two laws that three must leave, where there is no noise, to be believed."""

OTHER_SHAPES = 20.0
"""Difference of AICc from which on a bend of another shape is ruled out; more than for a second law, since the truth
may be between the shapes that are tried."""
BEYOND_SHAPES = 0.5
"""Share of what other shapes add to where the laws meet, added again: the true one may be none of them."""

LAWS = ("low", "high")
VERDICTS = ("one law", "two laws", "three laws", "no power law", "no meeting in the window")
REGIMES = (1, 2, 3, 0, 0)
"""Numbers of laws, by verdict."""

EXPONENTS = ("exponent", "exponent_low", "exponent_high")
"""Numbers of each law,"""
OTHERS = (
    *("crossover", "crossover_low", "crossover_high", "verdict", "regimes", "evidence"),
    *("width", "level", "residual", "noisy"),
)
"""and those of both, which stand behind them in the result of one line."""

NAMES = {
    "exponent": "exponent of the power law",
    "crossover": "where the two laws meet",
    "verdict": "how many laws are beyond doubt, or what speaks against it",
    "regimes": "2 where two laws are beyond doubt: evidence above 10, meeting in the window; 0 where none is a law",
    "evidence": "by how much AICc and BIC prefer two laws to one, whatever its noise, and to functions that are none",
    "width": "width of the bend, in decades",
    "level": "y where the two laws meet",
    "residual": "largest relative distance of a point from the curve",
    "points": "points in the fit",
    "noisy": "1 where the intervals are of noise, 0 where of the curvature of noise-free values",
}


def fit_two_laws(
    y: xr.DataArray,
    dim: str,
    window: Window | None = None,
    *,
    confidence: float = 0.95,
    noise: bool | str | None = None,
    sigma: Any = None,
    windows: tuple[Window, Window] | None = None,
) -> xr.Dataset:
    """Two power laws with a smooth crossover, equation (1), and whether one law would do.

    Intervals: where there is noise, those of the same mixture of noises as of `fit_exponent`, and they also reach over
    those of bends of other shapes that the points do not rule out (AICc within 20): hyperbolic, asymmetric, of two
    widths, stretched. They are wider than 95 % for a truth like (1), and no promise for a truth like none of them.

    Where there is none, as in a simulation, the uncertainty is how far the truth is from (1): the interval of an
    exponent then also reaches to the local exponent at its end of the window and, three times over, to the limit to
    which that tends; that of the crossover to where the local exponent is half-way between the two, and to where the
    tangents at the ends meet. What noise there is beneath is added.

    Parameters
    ----------
    y, dim, window, confidence, sigma
        As of `fit_exponent`.
    noise : bool or "even", "uneven", "correlated", "outliers", optional
        Whether there is noise, or of which kind. Default: as the points show; fewer than 16 show nothing, and intervals
        are then wide enough for both.
    windows : pair of (low, high), optional
        Fit a straight line in each of two windows, which share at most an end point, and say where the two lines
        meet; nothing is fitted between them.

    Returns
    -------
    Dataset
        `exponent`, `exponent_low`, `exponent_high` along `law` ("low", "high"); `crossover` with its interval, in
        the unit of `dim`; `verdict`: "two laws" where they are beyond doubt, "one law" where one does as well, "three
        laws", "no power law" where a logarithm, an exponential, stretched or not, a cut-off or a lognormal does as well
        and one law does not, "no meeting in the window"; `regimes`, how many laws; `evidence` (difference of AICc or
        BIC); `width` [decades], `level` (y where the laws meet), `residual`, `points`, `noisy`. There are no exponents
        and intervals where the verdict is "three laws" or "no power law", and where fewer than eight points are left.

        With `windows`: `exponent`, `exponent_low`, `exponent_high` along `law`; `crossover`, `crossover_low`,
        `crossover_high`, `crossover_error` (half the interval), `level`. Where there is noise, the interval follows
        from those of the two lines. Where there is none, it is a bound: how far the place moves if a law is not the
        line through its window but goes through the outer end of it with the exponent to which the local one tends.

    Raises
    ------
    SweepError
        If `dim` is unknown or unfit, y is nowhere positive in the window, or no line has eight points.

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
    check_noise(noise, sigma)
    if windows is not None:
        if window is not None:
            raise SweepError("window does not go with windows, which say where the two lines are")
        return _in_windows(y, dim, windows, confidence=confidence, noise=noise, sigma=sigma)
    names = [f"{name} {law}" for law in LAWS for name in EXPONENTS] + list(OTHERS)

    def each(t: Array, z: Array, errors: Array | None, bounds: Array | None) -> list[list[float]]:
        tried = fitted((ONE, *BENDS, *OTHER_FUNCTIONS, THREE), t, z, errors)
        return [_one(t, row, laws, confidence, noise) for row, laws in zip(z, tried, strict=True)]

    found = fit_lines(names, ("verdict", VERDICTS), each, y, dim, window, sigma)
    axis = xr.DataArray(list(LAWS), dims="law", name="law")
    both: dict[str, Any] = {name: xr.concat([found[f"{name} {law}"] for law in LAWS], axis) for name in EXPONENTS}
    both |= {name: found[name] for name in (*OTHERS, "points")}
    units = {"crossover": str(y.coords[dim].attrs.get("units", "1")), "level": str(y.attrs.get("units", "1"))}
    attrs = {"y": title(y), "x": dim, "law": "equation (1) of sweep.laws.two_laws"}
    return described(xr.Dataset(both), NAMES, units, attrs, confidence)


def _in_windows(y: xr.DataArray, dim: str, windows: tuple[Window, Window], **keys: Any) -> xr.Dataset:
    """Two straight lines, and where they meet."""
    try:
        low, high = windows
    except (TypeError, ValueError):
        raise SweepError(f"windows: expected two, ((low, high), (low, high)); found {windows!r}") from None
    fits = [fit_exponent(y, dim, one, **keys) for one in (low, high)]
    met = crossover(*fits)
    law = xr.DataArray(list(LAWS), dims="law", name="law")
    found = xr.concat([fit[list(EXPONENTS)] for fit in fits], dim=law, combine_attrs="override")
    for end in ("", "_low", "_high", "_error"):
        found[f"crossover{end}"] = met[f"abscissa{end}"]
    return found.assign(level=met.ordinate).assign_attrs(met.attrs)


def _one(t: Array, z: Array, tried: dict[str, Found], confidence: float, noise: bool | str | None) -> list[float]:
    """EXPONENTS of both laws and OTHERS of one line."""
    two = tried[TWO.name]
    size = math.sqrt(float(two.off @ two.off) / (t.size - 5))
    noisy = two.weights is not None or (_is_noise(t, z, two.off, size) if noise is None else bool(noise))
    word = noise if isinstance(noise, str) else "noise" if noisy else "even"
    ends, aicc = _ends(two, t, word, confidence)  # the numbers, and the ends of their intervals
    if noisy or roughness(t, two.off)[0] > SMOOTH_TO * size:
        # over those of every bend of another shape that the points do not rule out
        shaped = [_ends(tried[law.name], t, word, confidence) for law in BENDS[1:] if law.name in tried]
        least = min(aicc, *(one for _, one in shaped)) + OTHER_SHAPES
        bends = np.array([ends, *(one for one, of_shape in shaped if of_shape <= least)])
        low, high = np.fmin.reduce(bends[:, 1]), np.fmax.reduce(bends[:, 2])
        further = BEYOND_SHAPES * max(ends[1, 2] - low[2], high[2] - ends[2, 2])
        low[2], high[2] = low[2] - further, high[2] + further
        ends[1:] = low, high
    if not noisy:
        ends[1:] = _widened(t, z, *ends)
    ends[1:] = np.where(np.isnan(ends[1:]), [[-np.inf], [np.inf]], ends[1:])  # not determined
    verdict, evidence = _verdict(t, tried, noisy)
    p_low, p_high, places = ends.T
    level, places = float(np.exp(two.numbers[2])), np.exp(places)
    width = math.exp(two.numbers[1]) * float(t[-1] - t[0]) / math.log(10)
    if evidence <= 0 and not noisy:  # straight to rounding: nothing meets anywhere
        places, width, level = np.array([np.nan, 0.0, np.inf]), math.nan, math.nan
    if verdict in ("three laws", "no power law"):
        p_low, p_high, places = np.full((3, 3), np.nan)
        width = level = math.nan
    if verdict == "no meeting in the window":
        places[0] = np.nan
    residual, code = math.expm1(min(float(abs(two.off).max()), 700.0)), VERDICTS.index(verdict)
    return [*p_low, *p_high, *places, code, REGIMES[code], evidence, width, level, residual, noisy]


def _is_noise(t: Array, z: Array, off: Array, size: float) -> bool:
    """Whether the distances are noise: neighbours do not tell the points themselves any better; or, of many points,
    differ by more than a smooth truth would.

    A curve of five numbers swings about few points of a smooth truth in a way that looks like noise; then nothing is
    told, and the intervals are those of both.
    """
    if off.size < TELLING or size <= 8 * rounding(t, z):
        return False
    share = float(roughness(t, off)[0]) / size
    return bool((share > SCATTERED and size < 3 * roughness(t, z)[0]) or (off.size >= TELLING_MEMORY and share > ROUGH))


def _ends(found: Found, t: Array, word: str, confidence: float) -> tuple[Array, float]:
    """Exponents of both laws and ln of where they meet, and the ends of their intervals, (3, 3); `aicc_under`."""
    span, which = float(t[-1] - t[0]), [len(found.law.starts) + 1, len(found.law.starts) + 2, 0]
    low, high, aicc = found.interval(t, which, word, confidence)
    about = np.stack([np.zeros(3), low, high])
    return (found.numbers[which] + about) * [1 / span, 1 / span, span] + [0.0, 0.0, t[0]], aicc


def _widened(t: Array, z: Array, best: Array, low: Array, high: Array) -> Array:
    """Intervals that reach to where the local exponents tend; of the crossover, to where they are half-way between the
    laws and to where the tangents at the ends of the window meet."""
    first = np.append(True, np.diff(t) > 0)
    t, z = t[first], z[first]
    local, mirrored = slopes(t, z, 5), -t[::-1]
    half = np.flatnonzero(np.diff(np.sign(local - (best[0] + best[1]) / 2)))
    place = t[half[np.argmin(abs(t[half] - best[2]))]] if half.size else best[2]
    doubt = 2.5 * float(roughness(t, z)[0]) * np.array([_amplified(t), _amplified(mirrored)])
    ends = np.array([tends(t, local, doubt[0]), tends(mirrored, local[::-1], doubt[1])])
    low, high = low.copy(), high.copy()
    low[:2], high[:2] = np.minimum(low[:2], ends.min(axis=1) - doubt), np.maximum(high[:2], ends.max(axis=1) + doubt)
    steep = np.concatenate([ends, (ends[:, 0] - doubt)[:, None], (ends[:, 0] + doubt)[:, None]], axis=1)
    # where lines of these slopes through the first and the last point meet
    pairs = [pair for pair in itertools.product(*steep) if pair[0] != pair[1]]
    meetings = [float((z[-1] - z[0] + p * t[0] - q * t[-1]) / (p - q)) for p, q in pairs]
    low[2], high[2] = min(low[2], place, *meetings), max(high[2], place, *meetings)
    return np.stack([low, high])


def _amplified(t: Array) -> float:
    """Standard error of the local exponent at the start of a window, for values with errors of size 1."""
    near = t[:5]
    return float(np.sqrt((slopes(near, np.eye(near.size), 5)[:, 0] ** 2).sum()))


def _verdict(t: Array, tried: dict[str, Found], noisy: bool) -> tuple[str, float]:
    """One of VERDICTS, and by how much two laws are better than a line and than other functions.

    By AICc, and BIC for many points. The noise of the line may be of any kind, that of all others is even.
    """
    two, line, three = tried[TWO.name], tried[ONE.name], tried.get(THREE.name)
    bends, others = ([tried[law.name] for law in laws if law.name in tried] for laws in (BENDS, OTHER_FUNCTIONS))

    def gain(simple: Found, better: Found) -> float:
        return min(simple.aicc - better.aicc, simple.bic - better.bic)

    evidence = min(gain(one, two) for one in (line, *others))
    nearest = min((*bends, *others), key=lambda fit: fit.aicc)
    if three and three.aicc < nearest.aicc - OTHER_SHAPES and gain(line, three) > BEYOND_DOUBT:
        if not noisy:
            better = float(three.off @ three.off) < SMALLER**2 * min(float(fit.off @ fit.off) for fit in bends)
        else:  # nor with noise of any kind beside two
            better = three.aicc < nearest.aicc_under(t, "noise") - BEYOND_DOUBT
        if better:
            return "three laws", evidence
    if evidence > BEYOND_DOUBT:
        return "two laws" if 0 <= two.numbers[0] <= 1 else "no meeting in the window", evidence
    return "no power law" if max(gain(line, one) for one in others) > BEYOND_DOUBT else "one law", evidence
