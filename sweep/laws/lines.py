"""Straight lines in log-log: exponents whose intervals are of what the points have, scatter, error bounds or a bend."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from sweep.errors import SweepError
from sweep.laws.curves import (
    Window,
    check_confidence,
    check_dataset,
    check_end,
    check_output,
    ends,
    log_of,
    numbers_along,
    relative_sigma,
    stated_bound,
    title,
    window_logs,
    window_of,
)
from sweep.laws.loglog import FEWEST, Array, Line, line, slope_bounds, slopes, tends
from sweep.laws.scatter import KINDS, bend, is_scatter, rounding, runs_deny, scattered, weighted

METHOD = (
    "least squares in log-log, weighted where sigma is given or the scatter is uneven or has outliers; the interval is "
    "of the kind that `kind` says"
)

KIND_WORDS = ("exact", "bounded", "curved", "bent", "weighted", "any", *KINDS)
"""What distances from a line are; `kind` of a fit is a position in this list."""

FIT_NAMES = {
    "exponent": "exponent of the power law",
    "exponent_error": "standard error of the exponent",
    "prefactor": "y at x = 1 on the line",
    "prefactor_error": "standard error of the prefactor",
    "exponent_low": "lower end of the interval of the exponent",
    "exponent_high": "upper end of the interval of the exponent",
    "noisy": "1 where the interval is of scatter, 0 where of error bounds or a bend",
    "fits": "1 where one power law describes the points, 0 where the interval is only the range of its slope",
    "kind": f"what the distances from the line are: {', '.join(f'{i} {w}' for i, w in enumerate(KIND_WORDS))}",
    "drift": "change of the exponent across the window, by a parabola",
    "residual": "largest relative distance of a point from the line",
    "points": "points in the fit",
    "low": "first abscissa in the fit",
    "high": "last abscissa in the fit",
    "centre": "geometric mean of the abscissae",
    "level": "geometric mean of y, on the line at the centre",
    "level_error": "relative standard error of the level",
    "start": "y at the first abscissa",
    "stop": "y at the last abscissa",
    "limit_low": "to where the local exponent tends below the window; no end of an interval; NaN where points scatter",
    "limit_high": "to where the local exponent tends above the window; no end of an interval; NaN where points scatter",
}

JUDGED = (
    *("error", "exponent_low", "exponent_high", "kind", "fits"),
    *("start", "stop", "limit_low", "limit_high"),
)


class Given(NamedTuple):
    """What is known of a fit beforehand."""

    confidence: float
    noise: bool | str | None
    sigma: bool


def fit_exponent(
    y: xr.DataArray,
    dim: str,
    window: Window | None = None,
    *,
    confidence: float = 0.95,
    noise: bool | str | None = None,
    sigma: Any = None,
    bound: Any = None,
    towards: str | None = None,
) -> xr.Dataset:
    """Power law y = prefactor dim^exponent by a straight line in log-log over a window.

    What the interval of the exponent is depends on what the distances of the points from the line are, `kind`:

    - *exact*, *bounded*: rounding, or within stated error bounds; all that such errors can do to the exponent.
    - *weighted*: `sigma` is given; by the normal distribution, if chi-squared and the runs test allow it.
    - *any*, *uneven*, *outliers*: scatter, told apart by tests. The interval is then never less than that for noise
      that remembers the point before, as strongly as the points allow, and than that by heteroscedasticity-consistent
      errors: wider than that of independent noise, twice as wide for a dozen points. Of outliers the exponent is that
      of Tukey's biweight; its own interval, which `noise="outliers"` asks for, is far narrower beside few points.
    - *independent*, *correlated*: only if `noise` says so.
    - *curved*, *bent*: no power law, without and among scatter. `fits` is 0 and the interval is the range of the local
      exponent in the window, in which the exponent of every window inside lies.

    Parameters
    ----------
    y : DataArray
        Any shape; missing points, and those whose sigma is NaN, are left out.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and strictly monotone.
    window : (low, high), optional
        Ends in the unit of `dim`, both included; None leaves an end open.
    confidence : float
        Of the interval, where there is noise.
    noise : bool or "independent", "uneven", "correlated", "outliers", optional
        Whether the values scatter, or how. Default: as tests find.
    sigma : number or DataArray, optional
        Standard errors of the values, in the unit of y.
    bound : number, DataArray or Dataset, optional
        Largest relative error of the values, which is not noise; of a Dataset, the result that y is an output of, what
        it states for each cell: `rtol`, or `error_bound` where that is INACCURATE. Default: the `rtol` in the
        attributes of y.
    towards : "high" or "low", optional
        Fit ever smaller windows that all reach to this end, 1, 1/1.5, 1/1.5^2 ... of the range of ln dim, to see
        whether the exponent comes to rest: y has one dimension, `window` is not given.

    Returns
    -------
    Dataset
        `exponent`, `exponent_error`, `exponent_low`, `exponent_high` [1]; `kind`, a position in `KIND_WORDS`; `fits`;
        `noisy`, 1 where points scatter; `prefactor`, `prefactor_error` (y at dim = 1, in the unit of y); `drift`
        [1], the change of the exponent from one end of the window to the other by a parabola through the same
        points; `residual` [1], the largest relative distance of a point from the line; `points`; `low`, `high`,
        the first and last abscissa used, `start`, `stop`, y there; `centre`, `level`, `level_error`, the geometric
        means of dim and y, where the line is known best, and the relative standard error there; `limit_low`,
        `limit_high`, to where the local exponent tends below and above the window, as far as `crossover` allows for:
        they are no interval of the exponent. The dimensions are those of `y` but `dim`.

        With `towards` all of these run along `window`, the widest first. The exponent has a *plateau* where, from some
        window on, one power law describes each of at least three, and their intervals have exponents in common: the
        attributes are `plateau` (1 found, 0 denied), if found `exponent`, `exponent_low`, `exponent_high` of its widest
        window, and `verdict`, a sentence.

    Raises
    ------
    SweepError
        If `dim` is unknown or unfit, if y is not positive somewhere in the window, if no line has three points, or if
        points scatter and statsmodels (extra `fit`) is not installed.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(1e5, 1e7, 9)})
    >>> found = sweep.fit_exponent(ds.period, "mu")
    >>> print(f"{float(found.exponent):.4f}")
    -0.3334
    """
    if towards is not None:
        return _by_window(y, dim, window, towards, confidence=confidence, noise=noise, sigma=sigma, bound=bound)
    check_confidence(confidence)
    check_noise(noise)
    dimension, t, logs = window_logs(y, dim, window)
    here = window_of(y, dim, window)
    errors = relative_sigma(y, sigma).isel(here)
    if sigma is not None:
        logs = logs.where(np.isfinite(errors))
    bounds = stated_bound(y, bound).isel(here)
    given = Given(confidence, noise, sigma is not None)
    names = (*Line._fields, *JUDGED)
    fit = numbers_along(names, lambda z, s, b: _lines(t, z, s, b, given), logs, dimension, errors, bounds)
    if not bool(fit.exponent.notnull().any()):
        raise SweepError(
            f"a line needs at least {FEWEST} points, found {int(fit.points.max())} of {title(y)} in the window "
            f"{ends(window, dim)[0]:g} to {ends(window, dim)[1]:g} of {dim}; choose a wider one"
        )
    return _describe_fit(fit, y, dim)


FEWEST_IN_WINDOW, MOST_WINDOWS = 8, 8


def _by_window(y: xr.DataArray, dim: str, window: Window | None, end: str, **keys: Any) -> xr.Dataset:
    """Fits over ever smaller windows that reach to one end, and whether their exponents come to rest."""
    check_end("towards", end)
    check_output(y)
    if window is not None:
        raise SweepError("window does not go with towards, which chooses the windows")
    if y.ndim != 1:
        raise SweepError(f"{title(y)} runs along {', '.join(map(str, y.dims))}; take one line, choose with .sel")
    x = y[dim].values[np.isfinite(log_of(y).values)]
    if x.size < FEWEST_IN_WINDOW:
        raise SweepError(f"an exponent against the window needs at least {FEWEST_IN_WINDOW} points, found {x.size}")
    low, high = float(x.min()), float(x.max())
    fits = []
    for share in 1.5 ** -np.arange(float(MOST_WINDOWS)):
        reach = (high / low) ** share
        smaller = (high / reach, high) if end == "high" else (low, low * reach)
        if ((x >= smaller[0]) & (x <= smaller[1])).sum() < FEWEST_IN_WINDOW:
            break
        fits.append(fit_exponent(y, dim, smaller, **keys))
    found = xr.concat(fits, dim="window")
    found.attrs = {**fits[0].attrs, **_plateau(found, dim, end)}
    return found


def _plateau(found: xr.Dataset, dim: str, end: str) -> dict[str, Any]:
    p, low, high = (found[name].values for name in ("exponent", "exponent_low", "exponent_high"))
    for first in range(p.size - 2):
        one = (found.fits.values[first:] == 1).all()
        if one and low[first:].max() <= high[first:].min():
            here = {"exponent": float(p[first]), "exponent_low": float(low[first]), "exponent_high": float(high[first])}
            place = float((found.low if end == "high" else found.high).values[first])
            side = "above" if end == "high" else "below"
            text = f"plateau: {here['exponent_low']:.6g} to {here['exponent_high']:.6g}"
            text += f" in every window {side} {dim} = {place:.4g}"
            return {"plateau": 1, **here, "verdict": text}
    text = f"no plateau: the exponent still goes from {p[0]:.6g} to {p[-1]:.6g} as the window shrinks to the {end} end"
    return {"plateau": 0, "verdict": text}


def check_noise(noise: bool | str | None) -> None:
    """Raises SweepError where it is none of the words."""
    if not (noise is None or isinstance(noise, bool) or noise in KINDS):
        raise SweepError(f"noise: expected True, False or one of {', '.join(KINDS)}; found {noise!r}")


class Judged(NamedTuple):
    """What the distances of points from a line are, and what follows for its slope."""

    kind: str
    weights: Array
    error: float
    low: float
    high: float
    fits: bool = True
    ends: tuple[float, float] = (np.nan, np.nan)
    """Exponents to which the local one tends."""


def _lines(t: Array, z: Array, sigma: Array, bound: Array, given: Given) -> Array:
    """Numbers of `Line` and `JUDGED` for each line (..., n) of `z`."""
    count = math.prod(z.shape[:-1])
    rows = [np.broadcast_to(part, z.shape).reshape(count, t.size) for part in (z, sigma, bound)]
    judged, weights = np.full((len(rows[0]), len(JUDGED)), np.nan), np.ones(rows[0].shape)
    for i, (row, s, b) in enumerate(zip(*rows, strict=True)):
        present = np.flatnonzero(np.isfinite(row))
        present = present[np.argsort(t[present])]
        if present.size >= FEWEST:
            found = judge(t[present], row[present], s[present], b[present], given)
            weights[i, present] = found.weights
            start, stop = np.exp(row[present[[0, -1]]])
            numbers = (found.error, found.low, found.high, KIND_WORDS.index(found.kind), found.fits)
            judged[i] = *numbers, start, stop, *found.ends
    fitted = np.stack(line(t, z, weights.reshape(z.shape)), axis=-1)
    return np.concatenate([fitted, judged.reshape(*z.shape[:-1], len(JUDGED))], axis=-1)


def judge(t: Array, z: Array, sigma: Array, bound: Array, given: Given) -> Judged:
    """One line without gaps, t rising."""
    if given.sigma:
        told, fits = weighted(t, z, sigma, given.confidence)
        return Judged(told.kind, told.weights, told.error, told.low, told.high, fits)
    fit = line(t, z)
    off = z - np.log(fit.level) - fit.exponent * (t - np.log(fit.centre))
    noisy = is_scatter(t, off, z, bound) if given.noise is None else bool(given.noise)
    if not noisy or t.size <= FEWEST or abs(off).max() <= 8 * rounding(t, z):
        exact = _exact(t, z, off, bound, fit)
        return exact._replace(kind="any") if noisy else exact
    kind, even = given.noise if isinstance(given.noise, str) else None, np.ones(t.size)
    found = scattered(t, z, given.confidence, kind)
    bent = bend(t, z, given.confidence, found.weights if found.kind == "uneven" else even) if kind is None else None
    if bent is not None:
        return Judged("bent", even, found.error, *bent, fits=False)
    denied = kind == "independent" and runs_deny(off)
    return Judged(found.kind, found.weights, found.error, found.low, found.high, not denied)


def _exact(t: Array, z: Array, off: Array, bound: Array, fit: Line) -> Judged:
    """Where nothing scatters: bounds for what rounding and stated errors do, or the range of the local exponent."""
    slope, even = float(fit.exponent), np.ones(t.size)
    least = rounding(t, z)
    if (abs(off) <= 2 * bound + 8 * least).all():
        u = t - t.mean()
        reach = float((abs(u) * (bound + least)).sum() / (u @ u)) + least / float(np.ptp(t))
        kind = "bounded" if bound.any() else "exact"
        return Judged(kind, even, float(fit.exponent_error), slope - reach, slope + reach, True, (slope, slope))
    local, rough = slopes(t, z, 5), slopes(t, z, 7)
    doubt = float((abs(local - rough) + slope_bounds(t, bound + least, 5)).max())
    low, high = min(float(local.min()) - doubt, slope), max(float(local.max()) + doubt, slope)
    at_ends = slope_bounds(t, bound + least, 5)[[0, -1]]
    limits = tends(t, local, at_ends[0])[1], tends(-t[::-1], local[::-1], at_ends[1])[1]
    return Judged("curved", even, float(fit.exponent_error), low, high, False, limits)


def _describe_fit(fit: xr.Dataset, y: xr.DataArray, dim: str) -> xr.Dataset:
    wider = (fit.error / fit.exponent_error).where(fit.exponent_error > 0, 1.0)
    for name in ("exponent_error", "prefactor_error", "level_error"):
        fit[name] = fit[name] * wider
    fit = fit.drop_vars("error")
    fit["points"], fit["kind"] = fit.points.astype(np.int64), fit.kind.fillna(-1).astype(np.int64)
    scatters = [word not in ("exact", "bounded", "curved") for word in KIND_WORDS]
    fit["noisy"] = fit.kind.isin(np.flatnonzero(scatters)).astype(np.float64).where(fit.kind >= 0)
    units, place = str(y.attrs.get("units", "1")), str(y.coords[dim].attrs.get("units", "1"))
    of = dict.fromkeys(("prefactor", "prefactor_error", "level", "start", "stop"), units)
    of |= dict.fromkeys(("low", "high", "centre"), place)
    for key, variable in fit.data_vars.items():
        variable.attrs = {"units": of.get(str(key), "1"), "long_name": FIT_NAMES[str(key)]}
    fit.attrs = {"law": f"{title(y)} = prefactor {dim}^exponent", "y": title(y), "x": dim, "method": METHOD}
    return fit


def crossover(low_fit: xr.Dataset, high_fit: xr.Dataset) -> xr.Dataset:
    """Where two power laws meet: `abscissa`, `abscissa_error`, `ordinate`.

    Where points scatter, the error follows from the standard errors of the two fits, taken as independent. Where they
    do not, it is a bound: how far the place moves if a law is not the line through its window but goes through the
    outer end of it with the exponent to which the local one tends there. It does not shrink with the number of
    points.

    Parameters
    ----------
    low_fit, high_fit : Dataset
        From `fit_exponent`, over windows that share at most an end point.

    Raises
    ------
    SweepError
        If the windows overlap or the two lines are parallel within their errors.
    """
    for fit in (low_fit, high_fit):
        check_dataset("crossover", fit, "fit_exponent", ["exponent", "level", "limit_low"])
    for name in ("y", "x"):
        if low_fit.attrs.get(name) != high_fit.attrs.get(name):
            raise SweepError(f"the fits are of different {name}: {low_fit.attrs.get(name)}, {high_fit.attrs.get(name)}")
    if bool(((low_fit.low < high_fit.high) & (high_fit.low < low_fit.high)).any()):
        raise SweepError("the windows of the two fits overlap, so their errors are not independent; take them apart")
    first, second = np.log(low_fit.centre), np.log(high_fit.centre)
    middle = (first + second) / 2  # logarithms counted from here keep their digits
    slope = high_fit.exponent - low_fit.exponent
    slope_error = np.hypot(low_fit.exponent_error, high_fit.exponent_error)
    slope = slope.where(abs(slope) > slope_error)
    if not slope.notnull().any():
        raise SweepError("the two laws have the same exponent within their errors, so they meet nowhere")
    lines = [(fit.exponent, np.log(fit.level), np.log(fit.centre) - middle) for fit in (low_fit, high_fit)]
    place = middle + _meeting(*lines)
    variance = low_fit.level_error**2 + high_fit.level_error**2
    variance = variance + ((place - first) * low_fit.exponent_error) ** 2
    variance = variance + ((place - second) * high_fit.exponent_error) ** 2
    error = np.sqrt(variance / slope**2 + _systematic(low_fit, high_fit, lines, middle) ** 2)
    abscissa = np.exp(place)
    ordinate = np.exp(np.log(low_fit.level) + low_fit.exponent * (place - first))
    found = xr.Dataset({"abscissa": abscissa, "abscissa_error": abscissa * error, "ordinate": ordinate})
    for name, as_of in (("abscissa", "centre"), ("abscissa_error", "centre"), ("ordinate", "level")):
        found[name].attrs = {"units": low_fit[as_of].attrs["units"], "long_name": f"{name} where the two laws meet"}
    found.attrs = {"y": low_fit.attrs["y"], "x": low_fit.attrs["x"], "method": low_fit.attrs["method"]}
    return found


def _meeting(low: Any, high: Any) -> xr.DataArray:
    """Where two lines (slope, level, place of that level) meet."""
    gap: xr.DataArray = low[1] - low[0] * low[2] - high[1] + high[0] * high[2]
    found: xr.DataArray = gap / (high[0] - low[0])
    return found


def _systematic(low_fit: xr.Dataset, high_fit: xr.Dataset, lines: list[Any], middle: xr.DataArray) -> xr.DataArray:
    """How far the meeting moves for lines through the outer ends, towards where the exponents tend."""
    swapped = bool((low_fit.centre > high_fit.centre).all())
    names = [("limit_low", "start", "low"), ("limit_high", "stop", "high")]
    outer = []
    for fit, (limit, value, end) in zip((low_fit, high_fit), names[::-1] if swapped else names, strict=True):
        outer.append((fit[limit], np.log(fit[value]), np.log(fit[end]) - middle))
    there = _meeting(*lines)
    places = [_meeting(a, b) for a in (lines[0], outer[0]) for b in (lines[1], outer[1])]
    moved = [abs(place - there).fillna(0.0) for place in places]
    found: xr.DataArray = xr.concat(moved, dim="which").max("which")
    return found
