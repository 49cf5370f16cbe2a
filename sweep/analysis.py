"""Scaling laws in results: local exponents, straight lines in log-log, where two laws meet.

Everything here works on plain `xarray` objects along one dimension and keeps all others. `dim` may also name a
coordinate along a dimension, such as an axis of a zip design: `local_exponent(ds.period, "mu")`.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sweep._loglog import EPSILON, FEWEST, LINE, Array, brackets, line, root, slopes
from sweep.errors import SweepError

Window = tuple[float | None, float | None]
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
    """
    dimension, x = _abscissa(y, dim)
    found = _along(lambda z: slopes(np.log(x), z, 5), _log(y), dimension)
    found.name = f"{y.name}_exponent" if y.name is not None else "exponent"
    found.attrs = {"units": "1", "long_name": f"local exponent of {_title(y)} in {dim}"}
    return found


exponent = local_exponent


def fit_exponent(y: xr.DataArray, dim: str, window: Window | None = None) -> xr.Dataset:
    """Power law y = prefactor dim^exponent by a straight line in log-log over a window.

    Standard errors are those of ordinary least squares: the scatter about the line is taken as independent noise.
    A deterministic model has none; there they measure the curvature of the truth inside the window, and they
    shrink as 1/sqrt(points) although the curvature does not. `drift` does not shrink.

    Parameters
    ----------
    y : DataArray
        Any shape; missing points are left out.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and strictly monotone.
    window : (low, high), optional
        Ends in the unit of `dim`, both included; None leaves an end open.

    Returns
    -------
    Dataset
        `exponent`, `exponent_error` [1]; `prefactor`, `prefactor_error` (y at dim = 1, in the unit of y); `drift`
        [1], the change of the exponent from one end of the window to the other by a parabola through the same
        points; `residual` [1], the largest relative distance of a point from the line; `points`; `low`, `high`,
        the first and last abscissa used; `centre`, `level`, `level_error`, the geometric means of dim and y, where
        the line is known best, and the relative standard error there. The dimensions are those of `y` but `dim`.

    Raises
    ------
    SweepError
        If `dim` is unknown or unfit, if y is not positive somewhere in the window, or if no line has three points.
    """
    dimension, x = _abscissa(y, dim)
    inside = np.flatnonzero(_inside(x, window, dim))
    part = y.isel({dimension: inside})
    _require_fit_for_logarithms(part, dim)
    numbers = _along(lambda z: line(np.log(x[inside]), z), _log(part), dimension, "number")
    fit = xr.Dataset({name: numbers.isel(number=k, drop=True) for k, name in enumerate(LINE)})
    if not bool(fit.exponent.notnull().any()):
        raise SweepError(
            f"a line needs at least {FEWEST} points, found {int(fit.points.max())} of {_title(y)} in the window "
            f"{_ends(window, dim)[0]:g} to {_ends(window, dim)[1]:g} of {dim}; choose a wider one"
        )
    fit["points"] = fit.points.astype(np.int64)
    return _describe_fit(fit, y, dim)


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
    """

    def find(t: Array, c: Array, bracket: int) -> tuple[float, float]:
        fine, coarse = (root(t, c, bracket, value, points) for points in (6, 4))
        return fine, abs(fine - coarse) + _rounding(t, c, bracket, EPSILON * _largest(c))

    return _where(_missing_is_nan(curve), dim, value, window, (lambda t, c: c, find))


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
    """

    def find(t: Array, z: Array, bracket: int) -> tuple[float, float]:
        sixth, fourth = slopes(t, z, 7), slopes(t, z, 5)
        fine = root(t, sixth, bracket, value, 6)
        coarse = [root(t, fourth, i, value, 4) for i in brackets(fourth, value) if abs(i - bracket) <= 1]
        apart = min((abs(fine - place) for place in coarse), default=float(abs(t[bracket + 1] - t[bracket])))
        noise = EPSILON * _largest(z) / float(abs(np.diff(t)).min())
        return fine, apart + _rounding(t, sixth, bracket, noise)

    found = _where(_log(y), dim, value, window, (lambda t, z: slopes(t, z, 7), find))
    found.abscissa.attrs["long_name"] = f"where the exponent of {_title(y)} is {value:g}"
    return found


def _abscissa(y: xr.DataArray, dim: str) -> tuple[str, Array]:
    """Dimension that `dim` runs along, and its values, fit to take logarithms of."""
    dimension, values = _coordinate(y, dim)
    if values.dtype.kind not in "fiu":
        raise SweepError(f"{dim} holds words, not numbers; a power law needs a number axis")
    x = values.astype(np.float64)
    fit = np.isfinite(x) & (x > 0)
    if not fit.all():
        raise SweepError(f"{dim} must be positive and finite to take logarithms; found {x[~fit][0]:g}, select a part")
    if x.size < FEWEST:
        raise SweepError(f"{dim} has {x.size} of the at least {FEWEST} points that an exponent needs")
    rises = np.diff(x) > 0
    if not ((rises.all() or not rises.any()) and np.diff(x).all()):
        raise SweepError(f"{dim} neither rises nor falls throughout; sort first, e.g. ds.sortby({dim!r})")
    return dimension, x


def _coordinate(y: xr.DataArray, dim: str) -> tuple[str, NDArray[Any]]:
    if not isinstance(y, xr.DataArray):
        raise SweepError(f"expected one output, e.g. ds.period; found a {type(y).__name__}")
    known = [str(name) for name, coordinate in y.coords.items() if coordinate.ndim == 1]
    if dim in known:
        return str(y.coords[dim].dims[0]), y.coords[dim].values
    there = f"{_title(y)} runs along {', '.join(known)}" if known else f"{_title(y)} runs along no axis with values"
    if dim in y.coords:
        raise SweepError(f"{dim} has one value here, so nothing can be fitted along it; {there}")
    close = difflib.get_close_matches(str(dim), known, 1)
    raise SweepError(f"{_title(y)} has no axis {dim!r}; " + (f"did you mean {close[0]}?" if close else there))


def _inside(x: Array, window: Window | None, dim: str) -> NDArray[np.bool_]:
    low, high = _ends(window, dim)
    # an end that is a grid point up to rounding is meant to be in
    return (x >= low * (1 - 8 * EPSILON)) & (x <= high * (1 + 8 * EPSILON))


def _ends(window: Window | None, dim: str) -> tuple[float, float]:
    try:
        low, high = (None, None) if window is None else window
        ends = 0.0 if low is None else float(low), math.inf if high is None else float(high)
    except (TypeError, ValueError):
        raise SweepError(f"a window of {dim} is a pair (low, high) of numbers or None; found {window!r}") from None
    if not ends[0] < ends[1]:
        raise SweepError(f"the window {ends[0]:g} to {ends[1]:g} of {dim} is empty; give (low, high) with low < high")
    return ends


def _title(y: xr.DataArray) -> str:
    return str(y.name) if y.name is not None else "the array"


def _missing_is_nan(y: xr.DataArray) -> xr.DataArray:
    numbers = y.astype(np.float64)
    return numbers.where(np.isfinite(numbers))


def _log(y: xr.DataArray) -> xr.DataArray:
    """Natural logarithm, NaN where there is none."""
    numbers = _missing_is_nan(y)
    logs: xr.DataArray = xr.apply_ufunc(np.log, numbers.where(numbers > 0), dask="allowed", keep_attrs=True)
    return logs.rename(y.name)


def _along(function: Callable[[Array], Array], y: xr.DataArray, dimension: str, to: str | None = None) -> xr.DataArray:
    """`function` of the last axis, put along `dimension`: in its place, or as a new last dimension `to`."""
    found: xr.DataArray = xr.apply_ufunc(
        function,
        y.compute(),
        input_core_dims=[[dimension]],
        output_core_dims=[[to or dimension]],
        exclude_dims={dimension} if to else set(),
        keep_attrs=True,  # those of the coordinates; the caller writes those of the result
    )
    return found if to else found.transpose(*y.dims)


def _require_fit_for_logarithms(part: xr.DataArray, dim: str) -> None:
    cells = np.argwhere(np.asarray(part.values <= 0))
    count = len(cells)
    if count:
        first = part[tuple(cells[0])]
        raise SweepError(
            f"a power law needs positive values; {count} of {part.size} of {_title(part)} in the window are not, "
            f"e.g. {float(first):g} at {dim} = {float(first.coords[dim]):g}; choose a window without them"
        )


def _describe_fit(fit: xr.Dataset, y: xr.DataArray, dim: str) -> xr.Dataset:
    units, place = str(y.attrs.get("units", "1")), str(y.coords[dim].attrs.get("units", "1"))
    of = {"prefactor": units, "prefactor_error": units, "level": units, "low": place, "high": place, "centre": place}
    for name, variable in fit.data_vars.items():
        variable.attrs = {"units": of.get(str(name), "1"), "long_name": FIT_NAMES[str(name)]}
    fit.attrs = {"law": f"{_title(y)} = prefactor {dim}^exponent", "y": _title(y), "x": dim, "method": LEAST_SQUARES}
    return fit


def _require_apart(low_fit: xr.Dataset, high_fit: xr.Dataset) -> None:
    for name in ("y", "x"):
        if low_fit.attrs.get(name) != high_fit.attrs.get(name):
            raise SweepError(f"the fits are of different {name}: {low_fit.attrs.get(name)}, {high_fit.attrs.get(name)}")
    if bool(((low_fit.low < high_fit.high) & (high_fit.low < low_fit.high)).any()):
        raise SweepError("the windows of the two fits overlap, so their errors are not independent; take them apart")


def _where(
    curve: xr.DataArray, dim: str, value: float, window: Window | None, ways: tuple[Callable[..., Array], Finder]
) -> xr.Dataset:
    """The one passage of each line: ways[0] gives what passes `value`, ways[1] the place and its error in ln dim."""
    dimension, x = _abscissa(curve, dim)
    inside, t = _inside(x, window, dim), np.log(x)
    seen, find = ways

    def one(z: Array) -> tuple[float, float]:
        places = brackets(np.where(inside, seen(t, z), np.nan), value)
        return find(t, z, places[0]) if len(places) == 1 else (np.nan, len(places))

    def all_lines(values: Array) -> Array:
        lines = np.array([one(z) for z in values.reshape(-1, t.size)])
        return lines.reshape(*values.shape[:-1], 2)

    numbers = _along(all_lines, curve, dimension, "number")
    place, error = numbers.isel(number=0, drop=True), numbers.isel(number=1, drop=True)
    if not bool(place.notnull().any()):
        count = int(error.max())
        said = f"passes {value:g} {count} times" if count else f"does not pass {value:g}"
        raise SweepError(f"{_title(curve)} {said} along {dim} in the window; choose another window")
    abscissa: xr.DataArray = xr.apply_ufunc(np.exp, place, keep_attrs=True)
    found = xr.Dataset({"abscissa": abscissa, "abscissa_error": (abscissa * error).where(place.notnull())})
    units = str(curve.coords[dim].attrs.get("units", "1"))
    found.abscissa.attrs = {"units": units, "long_name": f"where {_title(curve)} is {value:g}"}
    found.abscissa_error.attrs = {"units": units, "long_name": "estimated error of the place"}
    return found


def _largest(values: Array) -> float:
    return float(np.nanmax(abs(values)))


def _rounding(t: Array, c: Array, bracket: int, noise: float) -> float:
    """Error in t of a root near `bracket` where the curve carries `noise`."""
    step, rise = abs(t[bracket + 1] - t[bracket]), abs(c[bracket + 1] - c[bracket])
    return float(noise * step / rise + EPSILON * abs(t[bracket]))
