"""The exponent of a power law: by a straight line in log-log, or far out, by a correction to scaling.

    y = A x^p,   y = A x^p (1 + B x^-D)                                                             (1)

D > 0 where p holds at large x, D < 0 where it holds at small x. B and D are hardly told apart, so the interval reaches
over those of every D that the points do not rule out.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import gammaincc, ndtri

from sweep.errors import SweepError
from sweep.laws.curves import Window, fit_lines, stated_bound
from sweep.laws.fits import fitted, union
from sweep.laws.loglog import EPSILON, FEWEST, Array, alike, slope_bounds, slopes, tends
from sweep.laws.noise import BEYOND_DOUBT, RARE, inliers, regress, roughness, shaped
from sweep.laws.shapes import FADING, LOG_CORRECTION, ONE, Number

SMOOTH = 0.12
"""Share of the distances from a line that is noise, below which they are a bend and no noise."""
FEWEST_FOR_BEND = 8
"""Points from which on a bend is looked for among noise."""
SCATTERS = 0.3
"""Share of the distances from a corrected law that is noise between neighbours, from which on they are noise."""
AS_WELL, HARDER = 13.0, 5.0
"""Difference of AICc up to which another D is not ruled out, and up to which one law and a logarithmic correction are
not, whose exponent is far harder to tell."""
FADES = np.exp([0, -6, -5, -4, -3, -2, -1, 1, 2, 3, 4, 5, 6]), 0.3, 80.0
"""How fast a correction may fade, per window: those tried about the best, to the power of its relative error, and the
least and largest."""
VERDICTS = ("a power law with a correction", "no power law with a correction", "no law at this end")


def fit_exponent(
    y: xr.DataArray,
    dim: str,
    window: Window | None = None,
    *,
    confidence: float = 0.95,
    noise: bool | str | None = None,
    sigma: Any = None,
    bound: Any = None,
) -> xr.Dataset:
    """Power law y = prefactor dim^exponent by a straight line in log-log over a window.

    What the interval of the exponent is depends on what the distances of the points from the line are, `kind`:

    - *exact*, *bounded*: rounding, or within stated error bounds; all that such errors can do to the exponent.
    - *weighted*: `sigma` is given; by the normal distribution, if chi-squared allows it and distances have no shape.
    - *noise*: noise of which nothing is known. It may be autocorrelated, louder at one end, at both or in the middle,
      and have outliers; the interval is over a mixture of such noises. The price is a wider interval beside few points.
    - *even*, *uneven*, *correlated*, *outliers*: only if `noise` says so. Of *even* noise the interval is that of
      ordinary least squares, and distances with a shape deny it.
    - *curved*, *bent*: no power law, without and among noise. `fits` is 0 and the interval is the range of the local
      exponent in the window.

    Parameters
    ----------
    y : DataArray
        Any shape; missing points are left out. The `kind` of a line with a value that is not positive says so.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and monotone. Equal values are repeated measurements.
    window : (low, high), optional
        Ends in the unit of `dim`, both included; None leaves an end open.
    confidence : float
        Of the interval, where there is noise.
    noise : bool or "even", "uneven", "correlated", "outliers", optional
        Whether there is noise, or of which kind. Default: as the points show.
    sigma : number or DataArray, optional
        Standard errors of the values, in the unit of y; they say all of the noise, so `noise` is not given.
    bound : number, DataArray or Dataset, optional
        Largest relative error of the values, which is not noise; of the result that y is an output of, what it states
        for each cell. Default: the `rtol` in the attributes of y. Rounding to single precision is added; of values
        that are rounded to fewer digits otherwise, such as those of a text, give half of the last one.

    Returns
    -------
    Dataset
        `exponent` with its interval and standard error, `verdict`, `kind` and more, each with a `long_name`. The
        dimensions are those of `y` but `dim`. NaN where there is no exponent. `attrs["summary"]` is a table.

    Raises
    ------
    SweepError
        If `dim` is unknown or unfit, or no line has three points, all positive.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", fixed={"phi0": 1.0, "a": 1.0}, axes={"mu": np.geomspace(1e5, 1e7, 9)})
    >>> print(f"{float(sweep.fit_exponent(ds.period, 'mu').exponent):.4f}")
    -0.3334
    """
    law, more = "{y} = prefactor {x}^exponent", (sigma, stated_bound(y, bound), FEWEST)
    return fit_lines(fit_line, law, y, dim, window, *more, confidence=confidence, noise=noise)


def rounding(t: Array, z: Array) -> Array:
    """What rounding of both coordinates leaves of lines (..., n)."""
    slope = abs(z[..., -1] - z[..., 0]) / abs(t[-1] - t[0])
    found: Array = EPSILON * (1.0 + abs(z).max(axis=-1) + slope * abs(t).max())
    return found


def fit_line(
    t: Array, z: Array, sigma: Array | None, bound: Array, *, confidence: float = 0.95, noise: bool | str | None = None
) -> dict[str, Any]:
    """Of lines z (m, n) without gaps, t rising: least squares, and then by what the distances are."""
    weight = np.ones_like(z) if sigma is None else sigma**-2.0
    share, n, least = weight / weight.mean(axis=1, keepdims=True), t.size, 8 * rounding(t, z)
    centre, level = (share * t).mean(axis=1), (share * z).mean(axis=1)
    u = t - centre[:, None]
    spread = (share * u * u).sum(axis=1)
    slope = (share * u * (z - level[:, None])).sum(axis=1) / spread
    off = z - level[:, None] - slope[:, None] * u
    size = np.sqrt((share * off * off).sum(axis=1) / max(n - 2, 1))
    # the parabola that fits best, beside the line
    bow = u * u - spread[:, None] / n - (share * u**3).sum(axis=1, keepdims=True) / spread[:, None] * u
    drift = 2 * (share * bow * off).sum(axis=1) / (share * bow * bow).sum(axis=1) * (t[-1] - t[0])
    fit: dict[str, Any] = {"exponent": slope, "exponent_error": size / np.sqrt(spread), "level": level}
    fit |= {"level_error": size / n**0.5, "kind": np.full(len(z), "weighted", "U10")}
    fit |= {name: np.ones(len(z)) for name in ("fits", "noisy")}
    fit |= {f"{name}_{end}": np.full(len(z), np.nan) for name in ("exponent", "limit") for end in ("low", "high")}
    if sigma is not None:
        error = 1 / np.sqrt((weight * u * u).sum(axis=1))
        reach = ndtri((1 + confidence) / 2) * error
        chance = gammaincc((n - 2) / 2, (weight * off**2).sum(axis=1) / 2) if n > 2 else np.ones(len(z))
        fit |= {"exponent_error": error, "level_error": weight.sum(axis=1) ** -0.5}
        fit |= {"exponent_low": slope - reach, "exponent_high": slope + reach}
        fit["fits"] = (chance > RARE) & ~shaped(t, off)
    else:
        noisy = (abs(off).max(axis=1) > least) & (n > FEWEST) & (noise is None or bool(noise))
        if noise is None:
            within = bound.any(axis=1) & (abs(off) <= 2 * bound).all(axis=1)
            noisy &= (size > least) & ~within & (roughness(t, off)[1] > SMOOTH)
        if (which := np.flatnonzero(noisy)).size:
            word = noise if isinstance(noise, str) else "noise"
            for name, values in _noisy(t, z[which], centre[which], word, confidence).items():
                fit[name][which] = values
        if (which := np.flatnonzero(~noisy)).size:
            for name, values in _exact(t, *(part[which] for part in (z, off, bound, slope))).items():
                fit[name][which] = values
    slope, level = fit["exponent"], fit["level"]
    fit |= {"exponent_low": np.fmin(fit["exponent_low"], slope), "exponent_high": np.fmax(fit["exponent_high"], slope)}
    prefactor = np.exp(level - slope * centre)
    fit |= {"prefactor_error": prefactor * np.hypot(fit["level_error"], centre * fit["exponent_error"])}
    residual = np.expm1(np.minimum(abs(z - level[:, None] - slope[:, None] * u).max(axis=1), 700))
    fit |= {"drift": drift, "residual": residual, "prefactor": prefactor, "level": np.exp(level)}
    fit |= {"low": np.exp(t[0]), "high": np.exp(t[-1]), "centre": np.exp(centre)}
    fit |= {"start": np.exp(z[:, 0]), "stop": np.exp(z[:, -1])}
    return fit | {"verdict": np.where(fit["fits"] == 1, "one power law", "no power law")}


def _noisy(t: Array, z: Array, centre: Array, word: str, confidence: float) -> dict[str, Any]:
    """Lines beside noise: their numbers, or the range of the slope where they bend."""
    u, half = 2 * (t - t[0]) / (t[-1] - t[0]) - 1, (t[-1] - t[0]) / 2
    columns = np.stack([np.ones_like(t), t - centre[0], u**2, u**3], axis=1)
    # the numbers of a cubic that are its slopes at the middle and at the ends
    ends = half * np.stack([u - u**3 / 3, u**3 / 6 - u**2 / 4, u**3 / 6 + u**2 / 4], axis=1)
    bends = word == "noise" and t.size >= FEWEST_FOR_BEND
    columns = columns if bends else columns[:, :2]
    inside = inliers(t, columns[:, :2], z) if word in ("noise", "outliers") else np.ones(z.shape, bool)
    kind, fits, numbers = np.full(len(z), word, "U10"), np.ones(len(z)), np.empty((6, len(z)))
    for pattern, rows in alike(inside, plain=word == "even"):
        line = regress(t[pattern], columns[pattern], z[rows][:, pattern], word, 2)
        # a point that is left out counts as one that is not known
        wider = t.size / pattern.sum()
        value, error = (part.T for part in line.mean())
        reach = value[1] + wider * (line.interval([1], confidence)[:, 0] - value[1])
        numbers[:, rows], fits[rows] = np.concatenate([value, wider * error, reach]), ~line.denied
        if bends and (bent := rows[line.denied]).size:
            cubic = regress(t[pattern], np.column_stack([columns[:, 0], ends])[pattern], z[bent][:, pattern], word)
            low, high = cubic.interval([1, 2, 3], confidence)
            kind[bent], numbers[4, bent], numbers[5, bent] = "bent", low.min(axis=0), high.max(axis=0)
    names = ("level", "exponent", "level_error", "exponent_error", "exponent_low", "exponent_high", "fits", "kind")
    return dict(zip(names, (*numbers, fits, kind), strict=True))


def _exact(t: Array, z: Array, off: Array, bound: Array, slope: Array) -> dict[str, Any]:
    """Where there is no noise: bounds for what rounding and stated errors do, or the range of the local exponent."""
    first = np.append(True, np.diff(t) > 0)  # repetitions are alike
    t, z, off, bound = t[first], z[:, first], off[:, first], bound[:, first]
    u, least = t - t.mean(), rounding(t, z)
    error = bound + least[:, None]
    reach = (abs(u) * error).sum(axis=1) / (u @ u) + least / np.ptp(t)
    straight = (abs(off) <= 2 * bound + 8 * least[:, None]).all(axis=1)
    kind = np.where(straight, np.where(bound.any(axis=1), "bounded", "exact"), "curved")
    low, high, *limits = slope - reach, slope + reach, slope.copy(), slope.copy()
    if t.size >= FEWEST:
        bent = np.flatnonzero(~straight)
        local, rough, by_error = slopes(t, z[bent], 5), slopes(t, z[bent], 7), slope_bounds(t, error[bent], 5)
        doubt = (abs(local - rough) + by_error).max(axis=1)
        low[bent], high[bent] = local.min(axis=1) - doubt, local.max(axis=1) + doubt
        for i, row in enumerate(bent):
            (_, limits[0][row]), (_, limits[1][row]) = tends(t, local[i], by_error[i, [0, -1]])
    names = ("exponent_low", "exponent_high", "limit_low", "limit_high", "fits", "kind", "noisy")
    return dict(zip(names, (low, high, *limits, straight, kind, 0.0), strict=True))


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

    Where there is noise, the interval is that of a mixture of noises as of `fit_exponent`, and reaches over those of
    all D, of a logarithmic correction (1 + B ln x)^c and of one law that the points do not rule out. Where there is no
    noise, it is three times as far as the fit to the outer half of the window moves the
    exponent. There is no interval where the points deny (1): by polynomials beside it that describe them far better;
    where `noise="even"` or `sigma` is given, by a shape of the distances; where `sigma` is, by chi-squared.

    Parameters
    ----------
    y, dim, window, confidence, noise, sigma
        As of `fit_exponent`.
    end : "high" or "low"
        Where (1) tends to a power law.

    Returns
    -------
    Dataset
        `exponent` with its interval; `verdict`, words; `correction_exponent` (D), `correction`, B x^-D at the outer
        end, and more. The dimensions are those of `y` but `dim`. NaN of fewer than eight points.

    Raises
    ------
    SweepError
        If `dim` or `end` is unknown or unfit, y is nowhere positive in the window, or no line has eight points.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", fixed={"phi0": 1.0, "a": 1.0}, axes={"mu": np.geomspace(10, 1e5, 41)})
    >>> print(f"{float(sweep.fit_correction(ds.period, 'mu').exponent):.4f}")
    -0.3334
    """
    if end not in ("low", "high"):
        raise SweepError(f'end: expected "low" or "high", found {end!r}')
    law, each = f"{{y}} = A {{x}}^p (1 + B {{x}}^-D), {end} end", functools.partial(_corrected, low=end == "low")
    return fit_lines(each, law, y, dim, window, sigma, confidence=confidence, noise=noise)


def _corrected(
    t: Array, z: Array, sigma: Array | None, bound: None, low: bool, confidence: float, noise: bool | str | None
) -> list[dict[str, Any]]:
    """Numbers of each line; at the low end by (1) of 1/x."""
    if low:
        t, z, sigma = -t[::-1], z[:, ::-1], None if sigma is None else sigma[:, ::-1]
    every, sign, span = [], -1.0 if low else 1.0, float(t[-1] - t[0])
    word = noise if isinstance(noise, str) else "noise"
    for row, tried in zip(z, fitted((ONE, FADING, LOG_CORRECTION), t, z, sigma, FADING), strict=True):
        found, one, fits, ends = tried[FADING.name], tried[ONE.name], True, [math.nan, math.nan]
        strength, fade, _, exponent = found.numbers.tolist()
        exponent, fade, left = exponent / span, fade / span, math.expm1(strength) * math.exp(-fade)
        if abs(left) >= 1 and one.aicc <= found.aicc + BEYOND_DOUBT:  # a correction that is none
            exponent, fade, left = float(one.numbers[1] / span), math.nan, 0.0
        size = float(np.sqrt(np.mean(found.off**2)))
        scatters = bool(roughness(t, found.off)[0] > SCATTERS * size if noise is None else noise)
        if not (noisy := sigma is not None or (scatters and size > float(8 * rounding(t, row)))):
            reach = _by_half(t, row, exponent)
            ends = [exponent - reach, exponent + reach]
        elif fits := not found.denied(t, word):
            steps, least, most = FADES
            best, known = float(np.clip(abs(found.numbers[1]), least, most)), found.sigma
            doubt = 0.5 * np.ptp(found.beside(t, word, confidence)[0][:, 1])
            far = np.clip(np.nan_to_num(doubt, posinf=most) / best, 0.02, 0.6)
            fades = np.clip(best * steps**far, least, most).tolist()
            laws = [FADING._replace(name=str(d), q=(FADING.q[0], Number(d, d, (d,)))) for d in fades]
            own, *others = fitted(laws, t, row[None], None if known is None else known[None])[0].values()
            others += [law for law in (one, tried[LOG_CORRECTION.name]) if law.aicc < found.aicc + HARDER]
            ends = [*union(t, own, others, [-1], word, confidence, AS_WELL)[1][:, 0] / span, exponent]
        verdict = VERDICTS[1 if not fits else 0 if abs(left) < 1 else 2]
        of = {"exponent": sign * exponent, "correction_exponent": sign * fade, "correction": left, "verdict": verdict}
        of |= {"exponent_low": min(sign * end for end in ends), "exponent_high": max(sign * end for end in ends)}
        every.append(of | {"residual": found.residual, "noisy": noisy, "fits": verdict == VERDICTS[0]})
    return every


def _by_half(t: Array, z: Array, exponent: float) -> float:
    """Three times as far as the outer half of the window moves the exponent."""
    first = np.append(True, np.diff(t) > 0)
    t, z = t[first], z[first]
    half = t >= (t[0] + t[-1]) / 2
    other = fitted((FADING,), t[half], z[None, half])[0]
    local = other[FADING.name].numbers[-1] / np.ptp(t[half]) if other else slopes(t, z, 5)[-1]
    return 3 * abs(float(local) - exponent) + float(slope_bounds(t, np.full(t.size, 8 * rounding(t, z)), 5)[-1])
