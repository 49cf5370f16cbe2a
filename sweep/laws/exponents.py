"""Scaling laws in results: local exponents, straight lines in log-log, where two laws meet.

Everything here works on plain `xarray` objects along one dimension and keeps all others. `dim` may also name a
coordinate along a dimension, such as an axis of a zip design: `local_exponent(ds.period, "mu")`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, overload

import numpy as np
import xarray as xr

from sweep.errors import SweepError
from sweep.laws.curves import (
    Window,
    along,
    inside_window,
    log_of,
    missing_is_nan,
    numbers_along,
    positive_axis,
    stated_bound,
    title,
)
from sweep.laws.lines import crossover as crossover
from sweep.laws.lines import fit_exponent as fit_exponent
from sweep.laws.loglog import EPSILON, Array, brackets, root, slope_errors, slopes

Finder = Callable[[Array, Array, int], tuple[float, float]]


@overload
def local_exponent(y: xr.DataArray, dim: str) -> xr.DataArray: ...
@overload
def local_exponent(y: xr.DataArray, dim: str, *, error: Literal[True], bound: Any = None) -> xr.Dataset: ...
def local_exponent(y: xr.DataArray, dim: str, *, error: bool = False, bound: Any = None) -> xr.DataArray | xr.Dataset:
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
    error : bool
        Whether to add an error bar, which takes longer. Where the values carry noise, it is half an interval that
        holds the truth in 94 % and more of the cases, be the noise even, uneven or autocorrelated up to 0.9 (of even
        noise in 98 %). Where they do not, it is more than the error that the spacing leaves, typically 100 times as
        much; but no points show a feature that is narrower than their spacing. What errors up to `bound` can do is
        added.
    bound : number, DataArray or Dataset, optional
        Largest relative error of the values, for the error bar. Default: as of `fit_exponent`.

    Returns
    -------
    DataArray, or with `error` a Dataset
        Shape, dimensions and coordinates of `y`; the Dataset has `exponent` and `exponent_error`.

    Raises
    ------
    SweepError
        If `dim` is unknown, not positive, not monotone, or shorter than three; `bound` is negative or does not fit.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(1e5, 1e7, 9)})
    >>> sweep.local_exponent(ds.period, "mu").values[[0, -1]].round(3)
    array([-0.333, -0.333])
    >>> bool((sweep.local_exponent(ds.period, "mu", error=True).exponent_error < 1e-3).all())
    True
    """
    found = _local(y, dim, lambda t, z: slopes(t, z, 5), "exponent", "local exponent")
    if not error:
        return found
    return xr.Dataset({"exponent": found, "exponent_error": local_exponent_error(y, dim, bound)})


def local_exponent_error(y: xr.DataArray, dim: str, bound: Any = None) -> xr.DataArray:
    """Error bar of the local exponent [1], which knows the sampling and the stated errors, and finds noise by itself.

    It is that of `local_exponent` with `error`: the local exponent by five points is tried by that through seven, and
    where a bend is within a step, by the slopes of the steps beside it; next to a pole by all steps it is made of.

    Parameters
    ----------
    y, dim
        As of `local_exponent`.
    bound : number or DataArray, optional
        Largest relative error of the values. Default: as of `fit_exponent`.

    Raises
    ------
    SweepError
        As `local_exponent`, or `bound` is negative or of another shape.
    """
    bounds = stated_bound(y, bound)
    return _local(y, dim, slope_errors, "exponent_error", "error of the local exponent", bounds)


def _local(
    y: xr.DataArray, dim: str, function: Callable[..., Array], name: str, words: str, *others: xr.DataArray
) -> xr.DataArray:
    dimension, x = positive_axis(y, dim)
    found = along(lambda *lines: function(np.log(x), *lines), log_of(y), dimension, None, *others)
    found.name = name if y.name is None else f"{y.name}_{name}"
    found.attrs = {"units": "1", "long_name": f"{words} of {title(y)} in {dim}"}
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

    return _where(missing_is_nan(curve), dim, value, window, lambda t, c: c, find)


def where_exponent(
    y: xr.DataArray, dim: str, value: float, window: Window | None = None, *, values: bool = False
) -> xr.Dataset:
    """Where the local exponent of y, or y itself, passes a value: `abscissa` and `abscissa_error`.

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
    values : bool
        Whether the values of y themselves are to pass `value`, as for an output that is an exponent already
        (`sensitivity`). The place is then the root of the polynomial through six neighbours, and its error the
        distance to that through four.

    Raises
    ------
    SweepError
        If the exponent does not pass the value, or does so more than once. Along further dimensions such lines are
        NaN, and it is raised only if all are.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(1e-2, 1e4, 61)})
    >>> print(f"{float(sweep.where_exponent(ds.period, 'mu', -0.5).abscissa):.2f}")
    1.46
    >>> print(f"{float(sweep.where_exponent(ds.period, 'mu', 2.0, values=True).abscissa):.2f}")
    26.40
    """
    if values:
        return where_value(y, dim, value, window)

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

    numbers = numbers_along(("place", "error"), all_lines, curve, dimension)
    place, error = numbers.place, numbers.error
    if not bool(place.notnull().any()):
        count = int(error.max())
        said = f"passes {value:g} {count} times" if count else f"does not pass {value:g}"
        raise SweepError(f"{title(curve)} {said} along {dim} in the window; choose another window")
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
