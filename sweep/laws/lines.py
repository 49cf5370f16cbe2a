"""The exponent of a power law, from a straight line in log-log, or asymptotically, from a correction to scaling.

    y = A x^p,   y = A x^p (1 + B x^-D)                                                             (1)

D > 0 where p holds at large x, D < 0 where it holds at small x. B and D are strongly correlated, so the interval of p
is the union over every D that the points do not rule out.
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
from sweep.laws.loglog import FEWEST, LINES, Array, alike, once, slope_bounds, slopes, tends
from sweep.laws.noise import BEYOND_DOUBT, RARE, Noise, apart, inliers, regress, roughness, rounding, scatters, shaped
from sweep.laws.shapes import FADING, LOG_CORRECTION, ONE, Number
from sweep.words import a_name

AS_WELL, HARDER = 13.0, 5.0
"""Difference of AICc up to which another D is not ruled out, and up to which one law and a logarithmic correction are
not, whose exponent is far harder to tell."""
FADES = np.exp([0, -6, -5, -4, -3, -2, -1, 1, 2, 3, 4, 5, 6]), 0.3, 80.0
"""How fast a correction may fade, per window: those tried about the best, to the power of its relative error, and the
least and largest."""
SAME = 1e-6
"""Largest relative deviation at which a curve without noise counts as the fitted law."""
VERDICTS = (
    "a power law with a correction",
    "no power law with a correction",
    "no law at this end",
    "one power law",
)


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
    """Fit the power law y = prefactor dim^exponent, a straight line in log-log, over a window.

    The interval of the exponent depends on the residuals of the points, `kind`:

    - *exact*, *bounded*: rounding, or errors within stated bounds; the interval is the largest effect of such errors.
    - *weighted*: `sigma` is given; the normal distribution, if chi-squared allows it and the residuals have no trend.
    - *noise*: noise of unknown kind. It may be autocorrelated, larger at one end, at both or in the middle, and have
      outliers; the interval is that of a mixture of such noise models, and therefore wider where points are few.
    - *even*, *uneven*, *correlated*, *outliers*: only if `noise` says so. For *even* noise the interval is that of
      ordinary least squares, which residuals with a trend contradict.
    - *curved*, *bent*: not a power law, without and with noise. `fits` is 0 and the interval is the range of the local
      exponent in the window.

    Parameters
    ----------
    y : DataArray
        Of any shape; missing points are left out. The `kind` of a line says if a value is not positive.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and monotone. Equal values are repeated measurements.
    window : (low, high), optional
        Ends in the unit of `dim`, both included; None leaves an end open.
    confidence : float
        Of the interval, where there is noise.
    noise : bool or "even", "uneven", "correlated", "outliers", optional
        Whether there is noise, or of which kind. Default: decided from the points.
    sigma : number or DataArray, optional
        Standard errors of the values, in the unit of y; excludes `noise`.
    bound : number, DataArray or Dataset, optional
        Largest relative error of the values, apart from noise; for a Dataset of a sweep, the error stated for each
        cell. Default: the `rtol` in the attributes of y. Rounding to single precision is allowed for; for values with
        fewer digits, as from a text file, give half a unit of the last digit.

    Returns
    -------
    Dataset
        `exponent` with its interval and standard error, `verdict`, `kind` and more, each with a `long_name`. The
        dimensions are those of `y` without `dim`. NaN where there is no exponent. `attrs["summary"]` is a table.

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
    law, keys = "{y} = prefactor {x}^exponent", {"confidence": confidence, "noise": noise}
    return fit_lines(fit_line, law, y, dim, window, sigma, bound=stated_bound(y, bound), **keys)


def fit_line(
    t: Array, z: Array, bound: Array, sigma: Array | None = None, confidence: float = 0.95, noise: Noise = None
) -> dict[str, Any]:
    """Of lines z (m, n) without gaps, t rising: least squares, and then by what the distances are."""
    weight = np.ones_like(z) if sigma is None else sigma**-2.0
    share, n, sums = weight / weight.mean(axis=1, keepdims=True), t.size, weight.sum(axis=1)
    centre, level = (share * t).mean(axis=1), (share * z).mean(axis=1)
    u = t - centre[:, None]
    spread = (share * u * u).sum(axis=1)
    slope = (share * u * (z - level[:, None])).sum(axis=1) / spread
    off = z - level[:, None] - slope[:, None] * u
    # the parabola that fits best, beside the line
    bow = u * u - spread[:, None] / n - (share * u**3).sum(axis=1, keepdims=True) / spread[:, None] * u
    drift = 2 * (share * bow * off).sum(axis=1) / (share * bow * bow).sum(axis=1) * (t[-1] - t[0])
    size = np.sqrt((share * off * off).sum(axis=1) / max(n - 2, 1)) if sigma is None else np.sqrt(n / sums)
    error, unknown = size / np.sqrt(spread), ("exponent_low", "exponent_high", "limit_low", "limit_high")
    fit: dict[str, Any] = {"exponent": slope, "exponent_error": error, "level": level, "level_error": size / n**0.5}
    fit |= {name: np.full(len(z), np.nan) for name in unknown} | {"drift": drift, "centre": np.exp(centre)}
    fit |= {"kind": np.full(len(z), "weighted", "U10"), "fits": np.ones(len(z)), "noisy": np.ones(len(z))}
    fit |= {"low": np.exp(t[0]), "high": np.exp(t[-1]), "start": np.exp(z[:, 0]), "stop": np.exp(z[:, -1])}
    if sigma is not None:
        reach = ndtri((1 + confidence) / 2) * error
        chance = gammaincc(max(n - 2, 1) / 2, (weight * off**2).sum(axis=1) / 2)
        fit |= {"exponent_low": slope - reach, "exponent_high": slope + reach}
        fit["fits"] = (chance > RARE) & ~(shaped(t, off) & apart(t, z, off))
    else:
        noisy = scatters(t, z, off, 2, noise) & (n > FEWEST)
        if noise is None:
            noisy &= ~(bound.any(axis=1) & (abs(off) <= moved(t, bound)).all(axis=1))
        word = noise if isinstance(noise, str) else "noise"
        for which, of in ((noisy, functools.partial(_noisy, word=word, confidence=confidence)), (~noisy, _exact)):
            if which.any():
                for name, values in of(t, *(part[which] for part in (z, off, bound, slope))).items():
                    fit[name][which] = values
    slope, level = fit["exponent"], fit["level"]
    fit |= {"exponent_low": np.fmin(fit["exponent_low"], slope), "exponent_high": np.fmax(fit["exponent_high"], slope)}
    prefactor = np.exp(level - slope * centre)
    fit |= {"prefactor_error": prefactor * np.hypot(fit["level_error"], centre * fit["exponent_error"])}
    residual = np.expm1(np.minimum(abs(z - level[:, None] - slope[:, None] * u).max(axis=1), 700))
    fit |= {"residual": residual, "prefactor": prefactor, "level": np.exp(level)}
    return fit | {"verdict": np.where(fit["fits"] == 1, "one power law", "no power law")}


def _noisy(t: Array, z: Array, *_: Array, word: str, confidence: float) -> dict[str, Any]:
    """Lines beside noise: their numbers, or the range of the slope where they bend."""
    u, half = 2 * (t - t[0]) / (t[-1] - t[0]) - 1, (t[-1] - t[0]) / 2
    columns = np.stack([np.ones_like(t), t - t.mean(), u**2, u**3], axis=1)
    # the numbers of a cubic that are its slopes at the middle and at the ends
    ends = half * np.stack([u - u**3 / 3, u**3 / 6 - u**2 / 4, u**3 / 6 + u**2 / 4], axis=1)
    bends = word == "noise" and t.size >= 8  # fewer do not tell bends from noise
    columns = columns if bends else columns[:, :2]
    inside = inliers(t, columns[:, :2], z) if word in ("noise", "outliers") else np.ones(z.shape, bool)
    kind, fits, numbers = np.full(len(z), word, "U10"), np.ones(len(z)), np.empty((6, len(z)))
    for pattern, rows in alike(inside, len(z) if word == "even" else LINES):
        line = regress(t[pattern], columns[pattern], z[rows][:, pattern], word, 2)
        # a point that is left out counts as one that is not known
        wider = t.size / pattern.sum()
        value, error = (part.T for part in line.mean())
        reach = value[1] + wider * (line.interval([1], confidence)[:, 0] - value[1])
        numbers[:, rows], fits[rows] = np.concatenate([value, wider * error, reach]), ~line.denied
        if bends and (bent := rows[line.denied]).size:
            cubic = regress(t[pattern], np.column_stack([columns[:, 0], ends])[pattern], z[bent][:, pattern], word)
            low, high = cubic.interval([1, 2, 3], confidence)
            kind[bent], numbers[4:, bent] = "bent", (low.min(axis=0), high.max(axis=0))
    names = ("level", "exponent", "level_error", "exponent_error", "exponent_low", "exponent_high", "fits", "kind")
    return dict(zip(names, (*numbers, fits, kind), strict=True))


def _exact(t: Array, z: Array, off: Array, bound: Array, slope: Array) -> dict[str, Any]:
    """Where there is no noise: bounds for what rounding and stated errors do, or the range of the local exponent."""
    t, z, off, bound = once(t, z, off, bound)
    u, least = t - t.mean(), rounding(t, z)
    error = bound + least[:, None]
    reach = (abs(u) * error).sum(axis=1) / (u @ u) + least / np.ptp(t)
    straight = (abs(off) <= moved(t, bound) + 8 * least[:, None]).all(axis=1)
    kind = np.where(straight, np.where(bound.any(axis=1), "bounded", "exact"), "curved")
    low, high, *limits = slope - reach, slope + reach, slope.copy(), slope.copy()
    for i in np.flatnonzero(~straight & (t.size >= FEWEST)):
        local, by_error = slopes(t, z[i], 5), slope_bounds(t, error[i], 5)
        doubt = (abs(local - slopes(t, z[i], 7)) + by_error).max()
        low[i], high[i] = local.min() - doubt, local.max() + doubt
        limits[0][i], limits[1][i] = (limit for _, limit, _ in tends(t, local, by_error[[0, -1]]))
    names = ("exponent_low", "exponent_high", "limit_low", "limit_high", "fits", "kind", "noisy")
    return dict(zip(names, (low, high, *limits, straight, kind, 0.0), strict=True))


def moved(t: Array, bound: Array) -> Array:
    """How far errors up to `bound` (m, n) can move points from the straight line that is fitted to them."""
    u = abs(t - t.mean())
    return np.asarray(bound + bound.mean(axis=1, keepdims=True) + u * (bound @ u / (u @ u))[:, None])


def far_out(t: Array, z: Array) -> tuple[Array, Array, Array, Array, list[tuple[float, float, bool]]]:
    """A line without noise, each point once, its local exponents, their errors at both ends, and what they tend to."""
    t, z = once(t, z)
    local = slopes(t, z, 5)
    # what noise there is moves the local exponents at the ends, each of which depends on five points
    alone = [slopes(few, np.eye(few.size), 5)[:, end] for few, end in ((t[:5], 0), (t[-5:], -1))]
    doubts = 2.5 * roughness(t, z)[0] * np.linalg.norm(alone, axis=1)
    return t, z, local, doubts, tends(t, local, doubts)


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
    """Asymptotic exponent from a correction to scaling, equation (1), and whether the points follow it.

    With noise, the interval is that of a mixture of noise models as in `fit_exponent`; it is the union over all D, a
    logarithmic correction (1 + B ln x)^c and a single law, as far as the points do not rule them out. Without noise, it
    is three times the change of the exponent when only the outer half of the window is fitted; for a curve other than
    (1), it extends to the limit of the local exponent, and where there is no such limit there is no law. There is no
    interval where the points contradict (1): where added polynomials fit far better; with `noise="even"` or `sigma`,
    where the residuals have a trend; with `sigma`, by chi-squared.

    Parameters
    ----------
    y, dim, window, confidence, noise, sigma
        As in `fit_exponent`.
    end : "high" or "low"
        End of the window towards which (1) tends to a power law.

    Returns
    -------
    Dataset
        `exponent` with its interval; `verdict`, in words; `correction_exponent` (D), `correction`, B x^-D at the outer
        end, and more. For a power law without a correction D is NaN and B is 0. The dimensions are those of `y` without
        `dim`. NaN for fewer than eight points.

    Raises
    ------
    SweepError
        If `dim` or `end` is unknown or unsuitable, y is nowhere positive in the window, or no line has eight points.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", fixed={"phi0": 1.0, "a": 1.0}, axes={"mu": np.geomspace(10, 1e5, 41)})
    >>> print(f"{float(sweep.fit_correction(ds.period, 'mu').exponent):.4f}")
    -0.3334
    """
    if a_name("end", end) not in ("low", "high"):
        raise SweepError(f'end: expected "low" or "high", found {end!r}')
    law, each = f"{{y}} = A {{x}}^p (1 + B {{x}}^-D), {end} end", functools.partial(_corrected, low=end == "low")
    return fit_lines(each, law, y, dim, window, sigma, confidence=confidence, noise=noise)


def _corrected(
    t: Array, z: Array, sigma: Array | None = None, *, low: bool, confidence: float, noise: Noise
) -> list[dict[str, Any]]:
    """Numbers of each line; at the low end by (1) of 1/x."""
    if low:
        t, z, sigma = -t[::-1], z[:, ::-1], None if sigma is None else sigma[:, ::-1]
    every, sign, span = [], -1.0 if low else 1.0, float(t[-1] - t[0])
    word = noise if isinstance(noise, str) else "noise"
    bows = np.polynomial.chebyshev.chebvander(2 * (t - t[0]) / span - 1, 4)[:, 2:]
    independent = word == "even" or sigma is not None
    for row, tried in zip(z, fitted((ONE, FADING, LOG_CORRECTION), t, z, sigma), strict=True):
        fit, one, fits, tended, ends = tried[FADING.name], tried[ONE.name], True, True, [math.nan, math.nan]
        strength, fade, _, exponent = fit.numbers.tolist()
        exponent, fade, left = exponent / span, fade / span, math.expm1(strength) * math.exp(-fade)
        if abs(left) >= 1 and one.aicc <= fit.aicc + BEYOND_DOUBT:  # a correction that is none
            exponent, fade, left = float(one.numbers[1] / span), math.nan, 0.0
        if noisy := sigma is not None or bool(scatters(t, row[None], fit.off[None], 4, noise)[0]):
            about, _, denied = fit.beside(t, word, confidence, None if independent else bows)
            if fits := not denied:
                steps, least, most = FADES
                best = float(np.clip(abs(fit.numbers[1]), least, most))
                far = np.clip(np.nan_to_num(0.5 * np.ptp(about[:, 1]), posinf=most) / best, 0.02, 0.6)
                fades = np.clip(best * steps**far, least, most).tolist()
                laws = [FADING._replace(name=str(d), q=(FADING.q[0], Number(d, d, (d,)))) for d in fades]
                errors = None if fit.sigma is None else fit.sigma[None]
                own, *others = fitted(laws, t, row[None], errors)[0].values()
                others += [law for law in (one, tried[LOG_CORRECTION.name]) if law.aicc < fit.aicc + HARDER]
                ends = [*union(t, own, others, [-1], word, confidence, AS_WELL)[1][:, 0] / span, exponent]
        else:
            # three times as far as the outer half of the points, and six at least, moves the exponent
            s, line, *_, (_, (_, limit, slows)) = far_out(t, row)
            outer, rounded = slice(-max(6, s.size // 2), None), np.full(s.size, 8 * rounding(s, line))
            half = fitted((FADING,), s[outer], line[None, outer])[0][FADING.name].numbers[-1] / np.ptp(s[outer])
            reach = 3 * abs(float(half) - exponent) + float(slope_bounds(s, rounded, 5)[-1])
            ends = [exponent - reach, exponent + reach]
            if abs((one if math.isnan(fade) else fit).off).max() > SAME:
                ends, tended = [*ends, limit], slows
        tended &= abs(left) < 1
        verdict = VERDICTS[1 if not fits else 2 if not tended else 3 if math.isnan(fade) else 0]
        of = {"exponent": sign * exponent, "correction_exponent": sign * fade, "correction": left, "verdict": verdict}
        of |= {"exponent_low": min(sign * end for end in ends), "exponent_high": max(sign * end for end in ends)}
        every.append(of | {"residual": fit.residual, "noisy": noisy, "fits": fits and tended})
    return every
