"""Two power laws with a smooth crossover, fitted together, and whether one law, or another one, describes the points.

    ln y = c + p1 u + (p2 - p1) w ln(1 + exp(u/w)),   u = ln(x/x0)                                  (1)

p1 holds far below x0 and p2 far above; w is the width of the crossover in ln x.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import gammaincc

from sweep.errors import SweepError
from sweep.laws.curves import Window, check_names, check_output, described, fit_lines, title
from sweep.laws.fits import Fit, fitted, union
from sweep.laws.lines import far_out, fit_exponent, fit_line
from sweep.laws.loglog import Array
from sweep.laws.noise import BEYOND_DOUBT, Noise, scatters
from sweep.laws.shapes import BENDS, LAWS, ONE, OTHER_FUNCTIONS, THREE, TWO

OTHER_SHAPES = 20.0
"""Difference of AICc from which on a bend of another shape is ruled out; more than for a second law, since the truth
may be between the shapes that are tried."""
BEYOND_SHAPES = 0.5
"""Share of what other shapes add to where the laws meet, added again: the true one may be none of them."""

VERDICTS = {"one law": 1, "two laws": 2, "three laws": 3}
"""Number of laws, by verdict; other verdicts have none."""


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
    """Fit two power laws with a smooth crossover, equation (1), and decide whether one law suffices.

    With noise, intervals are those of the mixture of noise models of `fit_exponent`, and include crossovers of other
    shapes that the points do not rule out (AICc within 20): hyperbolic, with two widths, with three scales. They need
    not hold for other shapes. Without noise, the uncertainty is the deviation of the curve from (1): the interval of an
    exponent then extends to the limit of the local exponent at its end of the window; that of the crossover to where
    the local exponent is half-way between the two, and to where the tangents at the ends meet.

    Parameters
    ----------
    y, dim, window, confidence, sigma
        As in `fit_exponent`.
    noise : bool or "even", "uneven", "correlated", "outliers", optional
        Whether there is noise, or of which kind. Default: decided from the points; fewer than about 16 do not decide
        it, and intervals are then wide enough for both.
    windows : pair of (low, high), optional
        Fit a straight line in each of two windows, which share at most an end point, and find where the two lines
        meet, without a fit between them. The results are in the order of the windows.

    Returns
    -------
    Dataset
        `exponent`, `exponent_low`, `exponent_high` along `law` ("low", "high"); `crossover` with its interval, in the
        unit of `dim`; `verdict`: "two laws" where two are significant, "one law" where one fits as well and is not
        contradicted as in `fit_exponent`, "three laws", "no power law" where one is contradicted, and AICc and BIC
        prefer other laws to one and to two by more than 10 or do not rule out a function other than power laws, "no
        meeting in the window", "undecided"; and more, each with a `long_name`. NaN where the verdict is "three laws" or
        "no power law", and for fewer than eight points.

        With `windows`, without noise, the interval of `crossover` is a bound: how far it moves if a law is not the line
        fitted in its window but passes through the window's outer end with the limiting local exponent.

    Raises
    ------
    SweepError
        If `dim` is unknown or unfit, y is nowhere positive in the window, or no line has eight points.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", fixed={"phi0": 1.0, "a": 1.0}, axes={"mu": np.geomspace(1e-3, 1e6, 91)})
    >>> [f"{e:.2f}" for e in sweep.fit_two_laws(ds.period, "mu").exponent.values]
    ['-1.00', '-0.34']
    >>> met = sweep.fit_two_laws(ds.period, "mu", windows=((1e-3, 1e-2), (1e5, 1e6)))
    >>> print(f"{float(met.crossover):.1f}")
    0.6
    """
    check_output(y)
    check_names(y, {*y.dims} & {"law"} - {str(dim)})
    keys: dict[str, Any] = {"confidence": confidence, "noise": noise}
    if windows is None:
        law = "equation (1) of sweep.laws.two_laws"
        return fit_lines(_each, law, y, dim, window, sigma, **keys)
    if window is not None:
        raise SweepError("window and windows exclude each other; give one of them")
    try:
        low, high = windows
    except (TypeError, ValueError):
        raise SweepError(f"windows: expected two, ((low, high), (low, high)); found {windows!r}") from None
    return crossover(*(fit_exponent(y, dim, one, sigma=sigma, **keys) for one in (low, high)))


def _each(t: Array, z: Array, sigma: Array | None = None, *, confidence: float, noise: Noise) -> list[dict[str, Any]]:
    """Numbers of each line."""
    every, span = [], float(t[-1] - t[0])
    # both exponents, and where the laws meet
    which, units, zero = [-2, -1, 0], np.array([1 / span, 1 / span, span]), np.array([0.0, 0.0, t[0]])
    tried, straight = fitted((ONE, *BENDS, *OTHER_FUNCTIONS, THREE), t, z, sigma), fit_line(t, z, 0 * z, sigma)["fits"]
    for row, laws, line in zip(z, tried, straight, strict=True):
        two, (verdict, evidence) = laws[TWO.name], _verdict(t, laws)
        if verdict == ("no power law" if line else "one law"):
            verdict = "undecided"
        noisy = sigma is not None or bool(scatters(t, row[None], two.off[None], 5, noise)[0])
        word = noise if isinstance(noise, str) else "noise" if noisy else "even"
        best = two.numbers[which] * units + zero
        width, level = math.exp(two.numbers[1]) * span / math.log(10), np.exp(two.numbers[2])
        if verdict in ("three laws", "no power law"):
            best, low, high, width, level = *np.full((3, 3), math.nan), math.nan, math.nan
        else:
            others = [laws[law.name] for law in BENDS[1:] if law.name in laws]
            own, (low, high) = union(t, two, others, which, word, confidence, OTHER_SHAPES) * units + zero
            further = BEYOND_SHAPES * np.nan_to_num(max(own[0, 2] - low[2], high[2] - own[1, 2]))
            low[2], high[2] = low[2] - further, high[2] + further
            if not noisy:
                low, high = _widened(t, row, best, low, high)
            if evidence <= 0 and not noisy:  # straight to rounding: nothing meets anywhere
                best[2], low[2], high[2], width, level = math.nan, -np.inf, np.inf, math.nan, math.nan
        if verdict == "no meeting in the window":
            best[2] = math.nan
        numbers = {"verdict": verdict, "regimes": VERDICTS.get(verdict, 0), "evidence": evidence, "width": width}
        numbers |= {"residual": two.residual, "noisy": noisy, "level": level}
        for name, of in (("", best), ("_low", low), ("_high", high)):
            numbers |= {f"exponent{name}": of[:2], f"crossover{name}": np.exp(of[2])}
        every.append(numbers)
    return every


def _widened(t: Array, z: Array, best: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Intervals that reach to where the local exponents tend; of the crossover, to where they are half-way between the
    laws and to where the tangents at the ends of the window meet."""
    t, z, local, doubts, tended = far_out(t, z)
    half = np.flatnonzero(np.diff(np.sign(local - (best[0] + best[1]) / 2)))
    places = [t[half[np.argmin(abs(t[half] - best[2]))]] if half.size else best[2]]
    ends = [np.add.outer(two, (0, -by, by)) for (*two, _), by in zip(tended, doubts, strict=True)]
    # where lines of these slopes through the first and the last point meet
    steep = itertools.product(*([*one[:, 0], *one[0, 1:]] for one in ends))
    places += [(z[-1] - z[0] + p * t[0] - q * t[-1]) / (p - q) for p, q in steep if p != q]
    reach = np.array([(np.min(one), np.max(one)) for one in (*ends, places)]).T
    return np.minimum(low, reach[0]), np.maximum(high, reach[1])


def _above(tried: Iterable[Fit]) -> Array:
    """AICc and BIC of laws above the least (laws, 2). A law is ruled out if both are beyond BEYOND_DOUBT."""
    criteria = np.array([law.criteria for law in tried])
    return np.asarray(criteria - criteria.min(axis=0))


def _verdict(t: Array, tried: dict[str, Fit]) -> tuple[str, float]:
    """What the points say of the law, and by how much two are better than one and than functions.

    The noise of the line may be of any kind, that of all others is even.
    """
    few = [fit for fit in tried.values() if fit.law is not THREE]
    three, one, nearest = tried.get(THREE.name), tried[ONE.name], min(few, key=lambda fit: fit.aicc)
    above, two = _above(few), np.array([fit.law in BENDS for fit in few])
    evidence = float((above[~two].min(axis=0) - above[two].min(axis=0)).min())
    # three, if BIC, which of many points asks for more, prefers them to one; and if with a bend more even beside what
    # noise of any kind leaves of fewer
    ahead = nearest.aicc - three.aicc if three and three.criteria[1] < one.criteria[1] - BEYOND_DOUBT else 0.0
    if three and ahead > OTHER_SHAPES and three.aicc < nearest.beside(t, "noise")[1] - BEYOND_DOUBT:
        return "three laws", evidence
    if evidence > BEYOND_DOUBT:
        return "two laws" if 0 <= tried[TWO.name].numbers[0] <= 1 else "no meeting in the window", evidence
    alive, function = above <= BEYOND_DOUBT, np.array([not fit.law.power for fit in few])
    if alive[few.index(one)].any():
        return "one law", evidence
    bent = alive[two].any() or 0 < ahead <= OTHER_SHAPES
    return "undecided" if bent and not alive[function].all(axis=1).any() else "no power law", evidence


def crossover(low_fit: xr.Dataset, high_fit: xr.Dataset) -> xr.Dataset:
    """Where two power laws, from `fit_exponent` over two windows, meet: `crossover` with its interval,
    `crossover_error`, half of that, and `level`; and both exponents.

    Where there is noise, the place is where the laws are equal within their errors. Where there is none, the bound is
    how far the place moves as either law is not the line through its window but through the outer end of it, with the
    exponent to which the local ones tend there. Raises SweepError where the windows share more than an end, or the
    lines are parallel within their errors.
    """
    if bool(((low_fit.low < high_fit.high) & (high_fit.low < low_fit.high)).any()):
        raise SweepError("the windows of the two fits overlap, so their errors are not independent; separate them")
    names = ["high", "low"] if bool((low_fit.centre > high_fit.centre).all()) else ["low", "high"]
    both = xr.concat([low_fit, high_fit], xr.Variable("law", names), combine_attrs="override")
    middle = np.log(both.centre).mean("law")  # logarithms counted from here keep their digits
    lines = []  # slope and level at the middle: through the window's centre; through its outer end, as the laws tend
    for side, end in (("low", "start"), ("high", "stop")):
        fit = both.sel(law=side, drop=True)
        through = (fit.exponent, fit.level, fit.centre), (fit[f"limit_{side}"], fit[end], fit[side])
        lines.append([(slope, np.log(level) - slope * (np.log(place) - middle)) for slope, level, place in through])
    (slope, level), steeper = lines[0][0], lines[1][0][0] - lines[0][0][0]
    meeting, *others = ((low[1] - high[1]) / (high[0] - low[0]) for low, high in itertools.product(*lines))
    moved = xr.concat([abs(other - meeting).fillna(0.0) for other in others], "which").max("which")
    # (slope (x - meeting))^2 = sum of (level error)^2 + (slope error (x - centre))^2, a quadratic in x - meeting
    told = (both.noisy == 1) | (both.fits == 1)  # else the interval is the range of the local exponent
    reach = ((both.exponent_high - both.exponent_low) / 2).where(told, both.exponent_error)
    level_reach = both.level_error * (reach / both.exponent_error).where(both.exponent_error > 0, 1.0)
    square = steeper**2 - (reach**2).sum("law")
    square = square.where(square > 0)
    if not square.notnull().any():
        raise SweepError("the two laws have the same exponent within their errors, so they do not meet")
    off = reach * (meeting + middle - np.log(both.centre))
    linear = (reach * off).sum("law")
    root = np.sqrt(linear**2 + square * (level_reach**2 + off**2).sum("law"))
    place = meeting.where(square.notnull())
    result = both[["exponent", "exponent_low", "exponent_high"]].assign(level=np.exp(level + slope * place))
    ends = {"": 0.0, "_low": (linear - root) / square - moved, "_high": (linear + root) / square + moved}
    for name, by in ends.items():
        result[f"crossover{name}"] = np.exp(middle + place + by)
    result["crossover_error"] = (result.crossover_high - result.crossover_low) / 2
    result.attrs = {name: low_fit.attrs[name] for name in ("law", "y", "x", "confidence")}
    return described(result, low_fit.centre, low_fit.level)


def compare_laws(y: xr.DataArray, dim: str, window: Window | None = None, *, sigma: Any = None) -> xr.Dataset:
    """Fit many laws to one line, and find which are ruled out and the simplest that is not.

    A law with more parameters is accepted only where AICc and BIC prefer it by more than 10 to every law with fewer (a
    likelihood ratio of e^5), also to a single power law with correlated, uneven or outlying noise. A power law that is
    not ruled out precedes other functions with as many parameters. The laws are one, two (with crossovers of four
    shapes) and three power laws, an offset, a correction to scaling, a peak or a step on a power law; and other
    functions: logarithm, exponential, stretched exponential, a cut-off at one end or at both, lognormal, two
    exponentials.

    Parameters
    ----------
    y, dim, window, sigma
        As in `fit_exponent`; y has one dimension. Without `sigma` all points have the same relative error.

    Returns
    -------
    Dataset
        Along `law`, the best first: `aicc`, `bic`, `worse` (AICc or BIC above the smallest), `numbers` (parameters),
        `scatter`, `residual`, `chi_squared`, `formula`, `exponents`; `fitted` (law, point), the law at the points `x`,
        whose values are `y` (10,000 of them where there are more than 20,000 without noise). Attributes `chosen`,
        `margin` (AICc to the next law; negative if a law with more parameters fits better), and `verdict`, a sentence.

    Raises
    ------
    SweepError
        y has several dimensions, fewer than 8 points, or values that are not positive in the window.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> import xarray as xr
    >>> x = np.geomspace(1, 1e4, 41)
    >>> y = xr.DataArray(1 / x + 0.01, {"x": x}, "x", name="y")
    >>> sweep.compare_laws(y, "x").attrs["chosen"]
    'offset'
    """
    check_output(y)
    if y.ndim != 1:
        raise SweepError(
            f"{title(y)} runs along {', '.join(map(str, y.dims))}; laws are compared for one line; select with .sel"
        )
    return fit_lines(_table, "", y, dim, window, sigma)


def _table(t: Array, z: Array, sigma: Array | None = None) -> xr.Dataset:
    """All that `compare_laws` says of laws, the best first."""
    tried = sorted(fitted(LAWS, t, z, sigma)[0].values(), key=lambda fit: fit.aicc)
    off, worse, span, rows = np.stack([f.off for f in tried]), _above(tried).min(axis=1), t[-1] - t[0], []
    for f, by in zip(tried, worse, strict=True):
        texts = [f"{name} = {f.numbers[k] / span:.4g} +- {f.errors[k] / span:.1g}" for name, k in f.law.exponents]
        chance = math.nan if sigma is None else gammaincc((t.size - f.law.numbers) / 2, f.deviance / 2)
        row = {"aicc": f.aicc, "bic": f.criteria[1], "worse": by, "numbers": f.law.numbers, "formula": f.law.formula}
        row |= {"residual": f.residual, "chi_squared": chance, "exponents": ", ".join(texts) or "none"}
        rows.append(row | {"scatter": np.sqrt(np.mean(f.off**2))})
    alive = [f for f, by in zip(tried, worse, strict=True) if by <= BEYOND_DOUBT]
    chosen = min(alive, key=lambda f: (f.law.numbers, not f.law.power, f.aicc))
    margin = min((f.aicc for f in tried if f is not chosen), default=math.inf) - chosen.aicc
    text = f"{chosen.law.name} ({chosen.law.formula}): " + "no power law; " * (not any(f.law.power for f in alive))
    if rivals := [f'"{f.law.name}"' for f in alive if f is not chosen]:
        text += f"not ruled out beside it: {', '.join(rivals)}"
    else:
        text += f"all others are ruled out, the next by {margin:.3g} in AICc"
    if chosen.beside(t, "even")[2]:
        text += "; but what it leaves has a shape, so that none of them is the law"
    variables: dict[str, Any] = {name: ("law", [row[name] for row in rows]) for name in rows[0]}
    variables |= {
        "x": ("point", np.exp(t)),
        "y": ("point", np.exp(z[0])),
        "fitted": (("law", "point"), np.exp(z - off)),
    }
    attrs = {"chosen": chosen.law.name, "margin": margin, "verdict": text}
    return xr.Dataset(variables, {"law": [f.law.name for f in tried]}, attrs)
