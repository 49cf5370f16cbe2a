"""Straight lines in log-log: exponents whose intervals are of what the points have, noise, error bounds or a bend."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from numpy.polynomial import chebyshev
from scipy.special import gammaincc, ndtri, stdtrit

from sweep.laws.curves import Window, fit_lines, stated_bound
from sweep.laws.loglog import EPSILON, FEWEST, Array, alike, slope_bounds, slopes, tends
from sweep.laws.noise import RARE, corrected, inliers, regress, roughness, shaped

SMOOTH = 0.12
"""Share of the distances from a line that is noise, below which they are a bend and no noise."""
FEWEST_FOR_BEND = 8
"""Points from which on a bend is looked for among noise."""


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
        for each cell. Default: the `rtol` in the attributes of y.

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
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(1e5, 1e7, 9)})
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
    fit |= {
        "level_error": size / n**0.5,
        "kind": np.full(len(z), "weighted", "U10"),
        "fits": np.ones(len(z)),
        "noisy": np.ones(len(z)),
    }
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
    powers = 4 if word == "noise" and t.size >= FEWEST_FOR_BEND else 2
    columns = chebyshev.chebvander(2 * (t - t[0]) / (t[-1] - t[0]) - 1, powers - 1)
    columns[:, 1] = t - centre[0]
    inside = inliers(t, columns[:, :2], z) if word in ("noise", "outliers") else np.ones(z.shape, bool)
    kind, fits, numbers = np.full(len(z), word, "U10"), np.ones(len(z)), np.empty((6, len(z)))
    for pattern, rows in alike(inside, plain=word == "even"):
        line = regress(t[pattern], columns[pattern], z[rows][:, pattern], word, 2)
        # a point that is left out counts as one that is not known
        wider = t.size / pattern.sum()
        value, error = (part.T for part in line.mean())
        ends = value[1] + wider * (line.interval(1, confidence) - value[1])
        numbers[:, rows], fits[rows] = np.concatenate([value, wider * error, ends]), ~line.denied
        for row in rows[line.denied] if powers > 2 else ():
            kind[row], numbers[4:, row] = "bent", _range(t[pattern], z[row, pattern], confidence)
    names = ("level", "exponent", "level_error", "exponent_error", "exponent_low", "exponent_high", "fits", "kind")
    return dict(zip(names, (*numbers, fits, kind), strict=True))


def _range(t: Array, z: Array, confidence: float) -> tuple[float, float]:
    """Least and largest slope of a curve among noise, with its interval, by the best polynomial up to degree six."""
    u, n, most = 2 * (t - t[0]) / (t[-1] - t[0]) - 1, t.size, min(6, t.size - 4)
    basis, back = np.linalg.qr(chebyshev.chebvander(u, most))
    along = basis.T @ z
    squares = {k: float(((z - basis[:, :k] @ along[:k]) ** 2).sum()) for k in range(3, most + 2)}
    k = min(squares, key=lambda k: float(corrected(n * math.log(squares[k]), n, k + 1)))
    steep = np.linalg.solve(back[:k, :k].T, chebyshev.chebval(u, chebyshev.chebder(np.eye(k)))) * 2 / (t[-1] - t[0])
    slope = along[:k] @ steep
    reach = stdtrit(n - k, (1 + confidence) / 2) * np.sqrt((steep**2).sum(axis=0) * squares[k] / (n - k))
    return float((slope - reach).min()), float((slope + reach).max())


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
            limits[0][row] = tends(t, local[i], by_error[i, 0])[1]
            limits[1][row] = tends(-t[::-1], local[i, ::-1], by_error[i, -1])[1]
    names = ("exponent_low", "exponent_high", "limit_low", "limit_high", "fits", "kind", "noisy")
    return dict(zip(names, (low, high, *limits, straight, kind, 0.0), strict=True))
