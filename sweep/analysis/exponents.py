"""Scaling laws in results: local exponents, straight lines in log-log, where two laws meet.

Everything here works on plain `xarray` objects along one dimension and keeps all others. `dim` may also name a
coordinate along a dimension, such as an axis of a zip design: `local_exponent(ds.period, "mu")`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import xarray as xr

from sweep.analysis.curves import (
    Window,
    along,
    check_confidence,
    ends,
    inside_window,
    log_of,
    missing_is_nan,
    positive_axis,
    scatter_is_noise,
    title,
    window_logs,
)
from sweep.analysis.loglog import EPSILON, FEWEST, Array, Line, brackets, line, root, slope_errors, slopes
from sweep.system.errors import SweepError

Finder = Callable[[Array, Array, int], tuple[float, float]]

LEAST_SQUARES = (
    "ordinary least squares in log-log; standard errors take the scatter about the line as independent noise. "
    "Where the values carry no noise they measure the curvature of the truth inside the window, and shrink with "
    "the number of points although the curvature does not: drift is then the fairer measure"
)

FIT_NAMES = {
    "exponent": "exponent of the power law",
    "exponent_error": "standard error of the exponent",
    "prefactor": "y at x = 1 on the line",
    "prefactor_error": "standard error of the prefactor",
    "exponent_low": "lower end of the confidence interval of the exponent",
    "exponent_high": "upper end of the confidence interval of the exponent",
    "noisy": "1 where the interval is of noise, 0 where of the curvature of noise-free values",
    "drift": "change of the exponent across the window, by a parabola",
    "residual": "largest relative distance of a point from the line",
    "points": "points in the fit",
    "low": "first abscissa in the fit",
    "high": "last abscissa in the fit",
    "centre": "geometric mean of the abscissae",
    "level": "geometric mean of y, on the line at the centre",
    "level_error": "relative standard error of the level",
}


def local_exponent(y: xr.DataArray, dim: str) -> xr.DataArray:
    """Local exponent d ln y / d ln dim [1], of fourth order in the spacing on any grid, ends included.

    Each value is the slope at a grid point of the polynomial through five neighbours in log-log (centred inside,
    one-sided at the ends). On a smooth curve the error is at most h^4/5 times the fifth derivative, h the spacing
    of ln dim: a few 1e-8 at 50 points a decade. A run of three or four neighbours gives order two or three.

    Parameters
    ----------
    y : DataArray
        Any shape. A point that is missing or not positive is NaN in the result, and no stencil reaches across it;
        so are runs of fewer than three points.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and strictly monotone.

    Returns
    -------
    DataArray
        Shape, dimensions and coordinates of `y`.

    Raises
    ------
    SweepError
        If `dim` is unknown, not positive, not monotone, or shorter than three.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(1e5, 1e7, 9)})
    >>> sweep.local_exponent(ds.period, "mu").values[[0, -1]].round(3)
    array([-0.333, -0.333])
    """
    return _local(y, dim, lambda t, z: slopes(t, z, 5), "exponent", "local exponent")


def local_exponent_error(y: xr.DataArray, dim: str) -> xr.DataArray:
    """Error bar of `local_exponent` [1], which knows the sampling and finds noise by itself.

    Where the values carry independent noise, it is half the interval of 95 % confidence, wider for runs of fewer than
    20 points (`benchmarks/honesty/intervals.py` measures it). Where they do not, it is more than the error that the
    spacing leaves, typically 20 times as much: the local exponent by five points is tried by that through seven, and
    where a bend is within a step, by the slopes of the steps beside it.

    Parameters
    ----------
    y, dim
        As of `local_exponent`.

    Raises
    ------
    SweepError
        As `local_exponent`.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(1e5, 1e7, 9)})
    >>> bool((sweep.local_exponent_error(ds.period, "mu") < 1e-3).all())
    True
    """
    return _local(y, dim, slope_errors, "exponent_error", "error of the local exponent")


def _local(y: xr.DataArray, dim: str, function: Callable[[Array, Array], Array], name: str, words: str) -> xr.DataArray:
    dimension, x = positive_axis(y, dim)
    found = along(lambda z: function(np.log(x), z), log_of(y), dimension)
    found.name = name if y.name is None else f"{y.name}_{name}"
    found.attrs = {"units": "1", "long_name": f"{words} of {title(y)} in {dim}"}
    return found


exponent = local_exponent


def fit_exponent(
    y: xr.DataArray, dim: str, window: Window | None = None, *, confidence: float = 0.95, noise: bool | None = None
) -> xr.Dataset:
    """Power law y = prefactor dim^exponent by a straight line in log-log over a window.

    Standard errors are those of ordinary least squares: the scatter about the line is taken as independent noise.
    A deterministic model has none; there they measure the curvature of the truth inside the window, and they
    shrink as 1/sqrt(points) although the curvature does not. `drift` does not shrink.

    The confidence interval of the exponent knows the difference. With noise it is that of least squares, by Student's
    t. Without, the exponent itself varies over the window, and the interval is the range of the local exponent there,
    in which the exponent of every window inside lies.

    Parameters
    ----------
    y : DataArray
        Any shape; missing points are left out.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and strictly monotone.
    window : (low, high), optional
        Ends in the unit of `dim`, both included; None leaves an end open.
    confidence : float
        Of the interval, where there is noise.
    noise : bool, optional
        Whether the values carry independent noise. Default: as the scatter of neighbours about the line shows.

    Returns
    -------
    Dataset
        `exponent`, `exponent_error`, `exponent_low`, `exponent_high` [1]; `noisy`, 1 where the interval is of noise;
        `prefactor`, `prefactor_error` (y at dim = 1, in the unit of y); `drift`
        [1], the change of the exponent from one end of the window to the other by a parabola through the same
        points; `residual` [1], the largest relative distance of a point from the line; `points`; `low`, `high`,
        the first and last abscissa used; `centre`, `level`, `level_error`, the geometric means of dim and y, where
        the line is known best, and the relative standard error there. The dimensions are those of `y` but `dim`.

    Raises
    ------
    SweepError
        If `dim` is unknown or unfit, if y is not positive somewhere in the window, or if no line has three points.

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
    check_confidence(confidence)
    dimension, t, logs = window_logs(y, dim, window)
    fit = _numbers(Line._fields, lambda z: np.stack(line(t, z), axis=-1), logs, dimension)
    if not bool(fit.exponent.notnull().any()):
        raise SweepError(
            f"a line needs at least {FEWEST} points, found {int(fit.points.max())} of {title(y)} in the window "
            f"{ends(window, dim)[0]:g} to {ends(window, dim)[1]:g} of {dim}; choose a wider one"
        )
    fit["points"] = fit.points.astype(np.int64)
    names = ("exponent_low", "exponent_high", "noisy")
    fit = fit.assign(_numbers(names, lambda z: _interval(t, z, confidence, noise), logs, dimension).data_vars)
    return _describe_fit(fit, y, dim)


def _numbers(names: Sequence[str], function: Callable[[Array], Array], y: xr.DataArray, dimension: str) -> xr.Dataset:
    """Numbers that a function puts in place of the points of each line, under these names."""
    numbers = along(function, y, dimension, "number")
    return xr.Dataset({name: numbers.isel(number=k, drop=True) for k, name in enumerate(names)})


def crossover(low_fit: xr.Dataset, high_fit: xr.Dataset) -> xr.Dataset:
    """Where two power laws meet: `abscissa`, `abscissa_error`, `ordinate`.

    The standard error follows from those of the two fits, taken as independent; in noise-free data it is, as they
    are, a measure of curvature and not of noise.

    Parameters
    ----------
    low_fit, high_fit : Dataset
        From `fit_exponent`, over windows that share at most an end point.

    Raises
    ------
    SweepError
        If the windows overlap or the two lines are parallel within their errors.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(1e-3, 1e6, 91)})
    >>> weak, strong = (sweep.fit_exponent(ds.period, "mu", window) for window in ((1e-3, 1e-2), (1e5, 1e6)))
    >>> print(f"{float(sweep.crossover(weak, strong).abscissa):.1f}")
    0.6
    """
    _require_apart(low_fit, high_fit)
    first, second = np.log(low_fit.centre), np.log(high_fit.centre)
    middle = (first + second) / 2  # logarithms counted from here keep their digits
    slope = high_fit.exponent - low_fit.exponent
    slope_error = np.hypot(low_fit.exponent_error, high_fit.exponent_error)
    slope = slope.where(abs(slope) > slope_error)
    if not slope.notnull().any():
        raise SweepError("the two laws have the same exponent within their errors, so they meet nowhere")
    gap = np.log(low_fit.level) - np.log(high_fit.level)
    gap = gap + low_fit.exponent * (middle - first) - high_fit.exponent * (middle - second)
    place = middle + gap / slope
    variance = low_fit.level_error**2 + high_fit.level_error**2
    variance = variance + ((place - first) * low_fit.exponent_error) ** 2
    variance = variance + ((place - second) * high_fit.exponent_error) ** 2
    abscissa = np.exp(place)
    ordinate = np.exp(np.log(low_fit.level) + low_fit.exponent * (place - first))
    found = xr.Dataset({"abscissa": abscissa, "abscissa_error": abscissa * np.sqrt(variance) / abs(slope)})
    found["ordinate"] = ordinate
    for name, like in (("abscissa", "centre"), ("abscissa_error", "centre"), ("ordinate", "level")):
        found[name].attrs = {"units": low_fit[like].attrs["units"], "long_name": f"{name} where the two laws meet"}
    found.attrs = {"y": low_fit.attrs["y"], "x": low_fit.attrs["x"], "method": low_fit.attrs["method"]}
    return found


def where_value(curve: xr.DataArray, dim: str, value: float, window: Window | None = None) -> xr.Dataset:
    """Where a curve passes a value: `abscissa` and `abscissa_error`, by interpolation in ln dim.

    The place is the root, between the two points that bracket it, of the polynomial through six neighbours. Its
    error is the distance to the root with four, plus rounding: an estimate, not a bound.

    Parameters
    ----------
    curve : DataArray
        Any shape, for instance an output `sensitivity`; missing points are left out.
    dim : str
        Dimension of `curve`, or 1-D coordinate along one; positive and strictly monotone.
    value : float
        In the unit of `curve`.
    window : (low, high), optional
        Part of `dim` to look in.

    Raises
    ------
    SweepError
        If the curve does not pass the value, or does so more than once. Along further dimensions such lines are
        NaN, and it is raised only if all are.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(1e-2, 1e4, 61)})
    >>> print(f"{float(sweep.where_value(ds.period, 'mu', 2.0).abscissa):.2f}")
    26.40
    """

    def find(t: Array, c: Array, bracket: int) -> tuple[float, float]:
        fine, coarse = (root(t, c, bracket, value, points) for points in (6, 4))
        return fine, abs(fine - coarse) + _rounding(t, c, bracket, EPSILON * _largest(c))

    return _where(missing_is_nan(curve), dim, value, window, lambda t, c: c, find)


def where_exponent(y: xr.DataArray, dim: str, value: float, window: Window | None = None) -> xr.Dataset:
    """Where the local exponent of y passes a value: `abscissa` and `abscissa_error`.

    The exponent is taken by differences of sixth order and interpolated through six points. The error is the
    distance to the same by fourth order and four points, plus rounding: an estimate, not a bound.

    Parameters
    ----------
    y : DataArray
        Any shape; points that are missing or not positive are left out.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and strictly monotone.
    value : float
        The exponent looked for, with its sign: -0.5 for y ~ dim^(-1/2).
    window : (low, high), optional
        Part of `dim` to look in; differences at its ends still use the points beyond.

    Raises
    ------
    SweepError
        As `where_value`.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(1e-2, 1e4, 61)})
    >>> print(f"{float(sweep.where_exponent(ds.period, 'mu', -0.5).abscissa):.2f}")
    1.46
    """

    def find(t: Array, z: Array, bracket: int) -> tuple[float, float]:
        sixth, fourth = slopes(t, z, 7), slopes(t, z, 5)
        fine = root(t, sixth, bracket, value, 6)
        coarse = [root(t, fourth, i, value, 4) for i in brackets(fourth, value) if abs(i - bracket) <= 1]
        apart = min((abs(fine - place) for place in coarse), default=float(abs(t[bracket + 1] - t[bracket])))
        noise = EPSILON * _largest(z) / float(abs(np.diff(t)).min())
        return fine, apart + _rounding(t, sixth, bracket, noise)

    found = _where(log_of(y), dim, value, window, lambda t, z: slopes(t, z, 7), find)
    found.abscissa.attrs["long_name"] = f"where the exponent of {title(y)} is {value:g}"
    return found


def _interval(t: Array, z: Array, confidence: float, noise: bool | None) -> Array:
    """Ends of the confidence interval of a line's slope, and 1 where it is of noise; (..., n) to (..., 3)."""
    from scipy.special import stdtrit

    fit = line(t, z)
    slope, level, centre = fit.exponent, np.log(fit.level)[..., None], np.log(fit.centre)[..., None]
    noisy = scatter_is_noise(z - level - slope[..., None] * (t - centre), z) if noise is None else np.array(noise)
    rounding = EPSILON * (1.0 + np.nanmax(abs(z), axis=-1, initial=0.0)) / abs(t[-1] - t[0])
    reach = stdtrit(np.maximum(fit.points - 2, 1), (1 + confidence) / 2) * fit.exponent_error + rounding
    local, doubt = _range_of_slopes(t, z)
    low, high = np.fmin(local[..., 0] - doubt, slope), np.fmax(local[..., 1] + doubt, slope)
    ends = np.where(noisy, slope - reach, low), np.where(noisy, slope + reach, high)
    return np.stack([*ends, np.broadcast_to(noisy, slope.shape).astype(float)], axis=-1)


def _range_of_slopes(t: Array, z: Array) -> tuple[Array, Array]:
    """Least and largest local exponent of each line, missing points passed over, and the doubt about both."""
    rows = z.reshape(-1, t.size)
    found = np.full((len(rows), 3), np.nan)
    for row, into in zip(rows, found, strict=True):
        present = np.isfinite(row)
        if present.sum() >= FEWEST:
            s, y = t[present], row[present]
            local, rough = slopes(s, y, 5), slopes(s, y, 7)
            rounding = EPSILON * max(1.0, abs(y).max()) / abs(np.diff(s)).min()
            into[:] = local.min(), local.max(), abs(local - rough).max() + rounding
    found = found.reshape(*z.shape[:-1], 3)
    return found[..., :2], found[..., 2]


def _describe_fit(fit: xr.Dataset, y: xr.DataArray, dim: str) -> xr.Dataset:
    units, place = str(y.attrs.get("units", "1")), str(y.coords[dim].attrs.get("units", "1"))
    of = {"prefactor": units, "prefactor_error": units, "level": units, "low": place, "high": place, "centre": place}
    for name, variable in fit.data_vars.items():
        variable.attrs = {"units": of.get(str(name), "1"), "long_name": FIT_NAMES[str(name)]}
    fit.attrs = {"law": f"{title(y)} = prefactor {dim}^exponent", "y": title(y), "x": dim, "method": LEAST_SQUARES}
    return fit


def _require_apart(low_fit: xr.Dataset, high_fit: xr.Dataset) -> None:
    for name in ("y", "x"):
        if low_fit.attrs.get(name) != high_fit.attrs.get(name):
            raise SweepError(f"the fits are of different {name}: {low_fit.attrs.get(name)}, {high_fit.attrs.get(name)}")
    if bool(((low_fit.low < high_fit.high) & (high_fit.low < low_fit.high)).any()):
        raise SweepError("the windows of the two fits overlap, so their errors are not independent; take them apart")


def _where(
    curve: xr.DataArray,
    dim: str,
    value: float,
    window: Window | None,
    seen: Callable[[Array, Array], Array],
    find: Finder,
) -> xr.Dataset:
    """The one passage of each line: `seen` gives what passes `value`, `find` the place and its error in ln dim."""
    dimension, x = positive_axis(curve, dim)
    inside, t = inside_window(x, window, dim), np.log(x)

    def one(z: Array) -> tuple[float, float]:
        """The place and its error; NaN and the number of places where that is not one."""
        places = brackets(np.where(inside, seen(t, z), np.nan), value)
        return find(t, z, places[0]) if len(places) == 1 else (np.nan, len(places))

    def all_lines(values: Array) -> Array:
        lines = np.array([one(z) for z in values.reshape(-1, t.size)])
        return lines.reshape(*values.shape[:-1], 2)

    numbers = _numbers(("place", "error"), all_lines, curve, dimension)
    place, error = numbers.place, numbers.error
    if not bool(place.notnull().any()):
        count = int(error.max())
        said = f"passes {value:g} {count} times" if count else f"does not pass {value:g}"
        raise SweepError(f"{title(curve)} {said} along {dim} in the window; choose another window")
    return _describe_place(curve, dim, value, place, error)


def _describe_place(
    curve: xr.DataArray, dim: str, value: float, place: xr.DataArray, error: xr.DataArray
) -> xr.Dataset:
    """From `place` and `error` in ln dim."""
    abscissa: xr.DataArray = xr.apply_ufunc(np.exp, place, keep_attrs=True)
    found = xr.Dataset({"abscissa": abscissa, "abscissa_error": (abscissa * error).where(place.notnull())})
    units = str(curve.coords[dim].attrs.get("units", "1"))
    found.abscissa.attrs = {"units": units, "long_name": f"where {title(curve)} is {value:g}"}
    found.abscissa_error.attrs = {"units": units, "long_name": "estimated error of the place"}
    return found


def _largest(values: Array) -> float:
    return float(np.nanmax(abs(values)))


def _rounding(t: Array, c: Array, bracket: int, noise: float) -> float:
    """Error in t of a root near `bracket` where the curve carries `noise`."""
    step, rise = abs(t[bracket + 1] - t[bracket]), abs(c[bracket + 1] - c[bracket])
    return float(noise * step / rise + EPSILON * abs(t[bracket]))
