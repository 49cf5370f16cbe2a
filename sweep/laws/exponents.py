"""Local exponents, where they or the curves themselves pass a value, and maps of exponents over two parameters.

Everything here works on plain `xarray` objects along one dimension and keeps all others. `dim` may also name a
coordinate along a dimension, such as an axis of a zip design: `local_exponent(ds.period, "mu")`.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, Literal, overload

import numpy as np
import xarray as xr

from sweep.errors import SweepError, missing
from sweep.laws import curves
from sweep.laws.curves import Window, check_names, log_of, positive_axis, title
from sweep.laws.loglog import EPSILON, Array, brackets, by_runs, is_logarithmic, root, slope_errors, slopes
from sweep.words import flag, number, several

BORDERS = (-1.0, -0.5, -1 / 3)
"""Exponents of a period in the drive: weak drive, losses that scale with it, strong drive."""


@overload
def local_exponent(y: xr.DataArray, dim: str) -> xr.DataArray: ...
@overload
def local_exponent(y: xr.DataArray, dim: str, *, error: Literal[True], bound: Any = None) -> xr.Dataset: ...
def local_exponent(y: xr.DataArray, dim: str, *, error: bool = False, bound: Any = None) -> xr.DataArray | xr.Dataset:
    """Local exponent d ln y / d ln dim [1], of fourth order in the spacing on any grid, ends included.

    Each value is the slope, at a grid point, of the polynomial through five neighbours in log-log (centred inside,
    one-sided at the ends). On a smooth curve the error is at most h^4/5 times the fifth derivative, h the spacing
    of ln dim: a few 1e-8 at 50 points a decade. A run of three or four neighbours gives order two or three.

    Parameters
    ----------
    y : DataArray
        Of any shape. A point that is missing or not positive is NaN in the result, and no stencil extends across it;
        runs of fewer than three points are NaN too.
    dim : str
        Dimension of `y`, or 1-D coordinate along one; positive and strictly monotone.
    error : bool
        Whether to add an error bar, which takes longer. With noisy values, it is half the width of an interval that
        contains the truth in at least 94 % of the cases, for homogeneous, heteroscedastic and autocorrelated (up to
        0.9) noise. Without noise, it exceeds the discretisation error, typically by a factor of 100, unless there is
        a feature narrower than the spacing. The effect of errors up to `bound` is added.
    bound : number, DataArray or Dataset, optional
        Largest relative error of the values, for the error bar. Default: as in `fit_exponent`.

    Returns
    -------
    DataArray, or with `error` a Dataset
        With the dimensions and coordinates of `y`; the Dataset has `exponent` and `exponent_error`.

    Raises
    ------
    SweepError
        If `dim` is unknown, not positive, not monotone, or shorter than three; `bound` is negative or misshapen.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", fixed={"phi0": 1.0, "a": 1.0}, axes={"mu": np.geomspace(1e5, 1e7, 9)})
    >>> sweep.local_exponent(ds.period, "mu").values[[0, -1]].round(3)
    array([-0.333, -0.333])
    >>> bool((sweep.local_exponent(ds.period, "mu", error=True).exponent_error < 1e-3).all())
    True
    """
    dimension, x = positive_axis(y, dim)
    error = flag("error", error)
    t, logs = np.log(x), log_of(y).transpose(..., dimension).compute()
    name = "exponent" if y.name is None else f"{y.name}_exponent"
    exponent = logs.copy(data=slopes(t, logs.values, 5)).transpose(*y.dims).rename(name)
    exponent.attrs = {"units": "1", "long_name": f"local exponent of {title(y)} in {dim}"}
    if not error:
        return exponent
    check_names(y, {*y.coords, *y.dims} & {"exponent", "exponent_error"})
    bounds = curves.stated_bound(y, bound).transpose(*logs.dims).values
    errors = logs.copy(data=by_runs(t, slope_errors, logs.values, bounds)).transpose(*y.dims)
    errors.attrs = {"units": "1", "long_name": f"error of the local exponent of {title(y)} in {dim}"}
    return xr.Dataset({"exponent": exponent, "exponent_error": errors})


def where_exponent(
    y: xr.DataArray, dim: str, value: float, window: Window | None = None, *, values: bool = False
) -> xr.Dataset:
    """Where the local exponent of y, or y itself, passes a value: `abscissa` and `abscissa_error`.

    The exponent is computed by differences of sixth order and interpolated through six points. The error is the
    difference from the same with fourth order and four points, plus rounding: an estimate, not a bound.

    Parameters
    ----------
    y, dim
        As in `local_exponent`.
    value : float
        The exponent to find, with its sign: -0.5 for y ~ dim^(-1/2).
    window : (low, high), optional
        Part of `dim` to search; differences at its ends also use the points beyond.
    values : bool
        Find where y itself passes `value`, for an output that is an exponent already (`sensitivity`). The place is the
        root of the polynomial through six neighbours, and its error the difference from that through four.

    Raises
    ------
    SweepError
        If the exponent does not pass the value, or does so more than once. Along further dimensions such lines are
        NaN, and it is raised only if all are.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", fixed={"phi0": 1.0, "a": 1.0}, axes={"mu": np.geomspace(1e-2, 1e4, 61)})
    >>> print(f"{float(sweep.where_exponent(ds.period, 'mu', -0.5).abscissa):.2f}")
    1.46
    >>> print(f"{float(sweep.where_exponent(ds.period, 'mu', 2.0, values=True).abscissa):.2f}")
    26.40
    """
    dimension, x = positive_axis(y, dim)
    values = flag("values", values)
    check_names(y, {*y.coords, *y.dims} & {"abscissa", "abscissa_error"})
    if not y.size:
        raise SweepError(f"{title(y)} has no line along {dim}; an axis of it is empty: {dict(y.sizes)}")
    low, high = curves.limits(window, y.coords[dim])
    t, inside = np.log(x), (x >= low) & (x <= high)
    value = number("value", curves.converted("value", value, y) if values else value)
    orders = ((6, 0), (4, 0)) if values else ((6, 7), (4, 5))  # points of the interpolation and of the slopes
    reach = 0.0 if values else abs(value) * abs(t).max()  # of what rounding of the abscissae does
    spacing = 1.0 if values else abs(np.diff(t)).min()

    def one(z: Array) -> tuple[float, float]:
        """The place in ln dim and its error; NaN and the number of places where that is not one."""
        fine, coarse = ((points, slopes(t, z, stencil) if stencil else z) for points, stencil in orders)
        noise = EPSILON * (np.nanmax(abs(z), initial=0.0) + reach) / spacing
        places = brackets(np.where(inside, fine[1], np.nan), value)
        if not (abs(fine[1] - value)[inside] > 8 * noise).any():  # what is the value throughout passes it nowhere
            places = []
        if len(places) != 1:
            return np.nan, float(len(places))
        at = places[0]
        step, rise = float(abs(t[at + 1] - t[at])), float(abs(fine[1][at + 1] - fine[1][at]))
        passage = root(t, fine[1], at, value, fine[0])
        near = [i for i in brackets(coarse[1], value) if abs(i - at) <= 1]
        apart = min((abs(passage - root(t, coarse[1], i, value, coarse[0])) for i in near), default=step)
        return passage, apart + noise * step / rise + EPSILON * abs(float(t[at]))

    keys: dict[str, Any] = {"input_core_dims": [[dimension]], "output_core_dims": [[], []], "keep_attrs": True}
    place, error = xr.apply_ufunc(one, log_of(y, values).compute(), vectorize=True, **keys)
    if not bool(place.notnull().any()):
        count = int(error.max())
        said = f"passes {value:g} {count} times" if count else f"does not pass {value:g}"
        raise SweepError(f"{title(y)} {said} along {dim} in the window; choose another window")
    result = xr.Dataset({"abscissa": np.exp(place), "abscissa_error": (np.exp(place) * error).where(place.notnull())})
    units, what = str(y.coords[dim].attrs.get("units", "1")), title(y) if values else f"the exponent of {title(y)}"
    result.abscissa.attrs = {"units": units, "long_name": f"where {what} is {value:g}"}
    result.abscissa_error.attrs = {"units": units, "long_name": "estimated error of the place"}
    return result


def exponent_map(y: xr.DataArray, dim: str, levels: Sequence[float] = BORDERS) -> xr.Dataset:
    """Map of the local exponent of y in `dim` over two parameters, and its contour lines.

    Parameters
    ----------
    y : DataArray
        With two dimensions, both with coordinates of numbers; one of them is `dim`.
    dim : str
        Positive and strictly monotone.
    levels : sequence of float
        Exponents of the contour lines, with their sign: -1/3 for y ~ dim^(-1/3).

    Returns
    -------
    Dataset
        `exponent` and its `exponent_error`, with the shape of y, and the contour lines along `point`: both coordinates,
        named after the dimensions with the suffix `_on_border`, `level`, and `line`, the number of the line, from 0.
        Lines are straight between grid points (in logarithms on logarithmic axes), and avoid points that are NaN.

    Raises
    ------
    SweepError
        y does not have two dimensions, or an axis is unsuitable.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> axes = {"mu": np.geomspace(1e-2, 1e4, 25), "R": [1e-4, 1e-3, 1e-2, 1e-1]}
    >>> ds = sweep.run(kernel="foliot", fixed={"phi0": 1.0, "a": 1.0}, axes=axes)
    >>> sweep.exponent_map(ds.period, "mu").exponent.dims
    ('mu', 'R')
    """
    local = local_exponent(y, dim, error=True)
    check_names(y, {*y.dims} & {"point", "level", "line"})
    if y.ndim != 2:
        raise SweepError(f"{title(y)} has {y.ndim} dimensions; a map needs two; select with .sel")
    for name in y.dims:
        if name not in y.coords or y[name].dtype.kind not in "fiu" or y.sizes[name] < 2:
            raise SweepError(f"{name} has no two numbers to draw a map over")
        steps = np.diff(y[name].values.astype(np.float64))
        if not (np.isfinite(steps).all() and ((steps > 0).all() or (steps < 0).all())):
            raise SweepError(f"{name} is not monotone, so no map can be drawn over it; sort first")
    try:
        import contourpy
    except ImportError:
        raise missing("lines on maps need contourpy", "plot") from None
    names = [str(y.dims[1]), str(y.dims[0])]  # across, down
    logarithmic = [is_logarithmic(y[name].values) for name in names]
    across, down = (np.log(y[n].values) if take else y[n].values for n, take in zip(names, logarithmic, strict=True))
    generator = contourpy.contour_generator(across, down, np.ma.masked_invalid(local.exponent.values))
    numbers = [number("levels", level) for level in several("levels", levels)]
    # where the exponent is a level throughout, within its error, rounding would draw lines
    apart = [bool((abs(local.exponent - level) > local.exponent_error).any()) for level in numbers]
    by_level = ((level, line) for level in itertools.compress(numbers, apart) for line in generator.lines(level))
    lines = [np.insert(np.array(line, np.float64), 2, level, axis=1) for level, line in by_level]
    points = np.concatenate([np.empty((0, 3)), *lines])
    points[:, :2][:, logarithmic] = np.exp(points[:, :2][:, logarithmic])
    about = [*(dict(y[name].attrs) for name in names), {"units": "1", "long_name": "exponent on the line"}]
    names = [f"{name}_on_border" for name in names]
    borders = {n: ("point", points[:, k], about[k]) for k, n in enumerate((*names, "level"))}
    of_line = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    borders["line"] = "point", of_line, {"units": "1", "long_name": "number of the line"}
    return local.assign(borders).assign_attrs(y=title(y), x=dim)
