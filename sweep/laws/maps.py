"""Exponents as fields over two parameters, and the borders between regimes as lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from sweep.errors import SweepError, missing
from sweep.laws.curves import check_output, title
from sweep.laws.exponents import local_exponent
from sweep.laws.loglog import is_logarithmic

BORDERS = (-1.0, -0.5, -1 / 3)
"""Exponents of a period in the drive: weak drive, losses that scale with it, strong drive."""


def exponent_map(y: xr.DataArray, dim: str, levels: Sequence[float] = BORDERS) -> xr.Dataset:
    """The local exponent of y in `dim` over two parameters, and the lines where it has given values.

    Parameters
    ----------
    y : DataArray
        Two dimensions, both with number coordinates; one of them is `dim`.
    dim : str
        Positive and strictly monotone.
    levels : sequence of float
        Exponents, with their sign: -1/3 for y ~ dim^(-1/3).

    Returns
    -------
    Dataset
        `exponent` and its `exponent_error`, of the shape of y, and the lines along `point`: both
        coordinates under the names of the dimensions with `_on_border` behind, `level`, and `line`, the number of the
        line that the point belongs to, from 0 on.

    Raises
    ------
    SweepError
        y has not two dimensions, or an axis is unfit.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> axes = {"mu": np.geomspace(1e-2, 1e4, 25), "R": [1e-4, 1e-3, 1e-2, 1e-1]}
    >>> ds = sweep.run(**foliot, axes=axes)
    >>> sweep.exponent_map(ds.period, "mu").exponent.dims
    ('mu', 'R')
    """
    local = local_exponent(y, dim, error=True)
    lines = contours(local.exponent, levels).rename({str(d): f"{d}_on_border" for d in y.dims})
    return local.assign(lines.data_vars).assign_attrs(y=title(y), x=dim)


def contours(field: xr.DataArray, levels: Sequence[float]) -> xr.Dataset:
    """Lines on which a field over two parameters has given values, by linear interpolation between its cells.

    Along `point`: both coordinates under the names of the dimensions, `level`, and `line`, the number of the line, from
    0 on; no points where no level is met. Logarithms are taken of an axis whose grid is logarithmic. Where the field is
    NaN no line goes. Raises SweepError where it has not two dimensions, each with numbers and two and more of them.
    """
    check_output(field)
    if field.ndim != 2:
        raise SweepError(f"{title(field)} has {field.ndim} dimensions; a map needs two, choose with .sel or --at")
    for name in field.dims:
        if name not in field.coords or field[name].dtype.kind not in "fiu" or field.sizes[name] < 2:
            raise SweepError(f"{name} has no two numbers to draw a map over")
    try:
        import contourpy
    except ImportError:
        raise missing("lines on maps need contourpy", "plot") from None
    down, across = map(str, field.dims)
    values = [field[name].values for name in (across, down)]
    logarithmic = [is_logarithmic(grid) for grid in values]
    x, y = (np.log(g) if take else g.astype(np.float64) for g, take in zip(values, logarithmic, strict=True))
    generator = contourpy.contour_generator(x, y, np.ma.masked_invalid(field.values.astype(np.float64)))
    lines = [(level, np.array(line)) for level in levels for line in generator.lines(float(level))]
    points = np.concatenate([line for _, line in lines]) if lines else np.empty((0, 2))
    points[:, logarithmic] = np.exp(points[:, logarithmic])
    count = [len(line) for _, line in lines]
    columns = {
        across: points[:, 0],
        down: points[:, 1],
        "level": np.repeat(np.array([level for level, _ in lines], np.float64), count),
        "line": np.repeat(np.arange(len(lines)), count),
    }
    found = xr.Dataset({name: ("point", values) for name, values in columns.items()})
    for name in (across, down):
        found[name].attrs = dict(field[name].attrs)
    found.level.attrs = {"units": str(field.attrs.get("units", "1")), "long_name": f"{title(field)} on the line"}
    found.line.attrs = {"units": "1", "long_name": "number of the line"}
    return found
