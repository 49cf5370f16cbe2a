"""Linear interpolation between scattered cells, as figures of refined results use it.

Neighbours are the corners of the simplices (intervals, triangles, tetrahedra) of Delaunay's triangulation of the cells,
in coordinates in which each axis reaches from 0 to 1, in logarithms where it reaches from a positive value to twice
that. Outputs that are positive everywhere are taken in logarithms too. For each output the box is first stretched to
where it bends (`mesh`), so that cells are joined along what it does not depend on.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells.schema import ERROR_BOUND, STATUS
from sweep.errors import SweepError
from sweep.explore.mesh import Array, Indices, Mesh
from sweep.units import in_unit
from sweep.words import require_dataset

LOGARITHMIC = 1.999
"""Least ratio of the ends of a positive axis for logarithms; below it they make no difference."""
FEWEST_ON_A_LINE = 5
MOST_AXES = 5
REFINED_TO = "refined_to"
"""Attribute of a refined result: JSON, the tolerance of each output that was refined."""


@dataclass(frozen=True)
class Box:
    """Coordinates in which each axis of some cells reaches from 0 to 1."""

    names: tuple[str, ...]
    low: Array
    high: Array
    logarithmic: NDArray[np.bool_]

    @classmethod
    def of(cls, cells: Mapping[Any, Any], names: Collection[str]) -> Box:
        """The box of cells, such as those of a Dataset, over some axes."""
        low, high = np.array([(float(cells[name].min()), float(cells[name].max())) for name in names]).T
        return cls(tuple(names), low, high, (low > 0) & (high >= LOGARITHMIC * low))

    def points(self, values: Mapping[Any, Any]) -> Array:
        """Places (n, axes) of axis values."""
        columns = np.stack([np.asarray(values[name], dtype=np.float64) for name in self.names], axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.log(columns / self.low) / np.log(self.high / self.low)
            found: Array = np.where(self.logarithmic, ratio, (columns - self.low) / (self.high - self.low))
        return found

    def values(self, k: int, places: Array) -> Array:
        """Values of axis k at places."""
        low, high = self.low[k], self.high[k]
        found: Array = low * (high / low) ** places if self.logarithmic[k] else low + places * (high - low)
        return found


def heights(values: Array) -> Array:
    """An output as it is interpolated: in logarithms where it is positive everywhere, else over its largest size."""
    size = _size(values)
    with np.errstate(invalid="ignore"):
        found: Array = values / size if size else np.log(values)
    return found


def _size(values: Array) -> float:
    """The largest size of values, to which errors are relative; 0 of positive ones, which are taken in logarithms."""
    finite = values[np.isfinite(values)]
    return 0.0 if finite.size and finite.min() > 0 else float(abs(finite).max(initial=0.0)) or 1.0


def axes_of(dataset: xr.Dataset) -> list[str]:
    """Number axes of cells that lie anywhere in a box, all corners of which are cells; [] of any other dataset."""
    if STATUS not in dataset or dataset[STATUS].ndim != 1 or dataset[STATUS].dims[0] in dataset.coords:
        return []
    dim = dataset[STATUS].dims[0]
    names = [str(n) for n, c in dataset.coords.items() if c.dims == (dim,) and c.dtype.kind == "f"]
    names = [name for name in names if np.ptp(dataset[name].values) > 0]
    if not 2 <= len(names) <= MOST_AXES:
        return []
    places = Box.of(dataset, names).points(dataset)
    corners = np.unique(places[((places == 0) | (places == 1)).all(axis=1)], axis=0)
    return names if len(corners) == 2 ** len(names) else []


def interpolated(dataset: xr.Dataset, at: Mapping[str, Sequence[float] | Array]) -> xr.Dataset:
    """Interpolate the outputs of a refined result on a grid of values.

    Parameters
    ----------
    dataset : Dataset
        From `refine`, with two or more axes.
    at : mapping of axis to values
        Values for every axis.

    Returns
    -------
    Dataset
        Outputs with one value per cell, and the status of the nearest cell, over the axes in the order of `at`. NaN
        outside the range of the cells, and beside cells without a value. INACCURATE, with `error_bound`, where the
        estimated error of linear interpolation exceeds the tolerance of the refinement, and across borders of statuses,
        where the error is unknown.

    Raises
    ------
    SweepError
        The cells do not fill a box, values for an axis are missing, or there is no such axis.

    Examples
    --------
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": [0.1, 1.0, 10.0], "a": [0.5, 1.0, 2.0]})
    >>> fine = sweep.refine(ds, "period", 1e-2)
    >>> sweep.interpolated(fine.dataset, {"mu": [0.3, 3.0], "a": [0.7]}).sizes["mu"]
    2
    """
    require_dataset("interpolated", dataset, "refine")
    names = axes_of(dataset)
    if not names:
        raise SweepError("only cells that fill a box of two axes and more, as those of `refine`, can be interpolated")
    if set(at) != set(names):
        raise SweepError(f"at: expected values of {', '.join(names)}, found {', '.join(at) or 'none'}")
    units = {name: str(dataset[name].attrs.get("units", "1")) for name in names}
    try:
        grids = {name: np.asarray(in_unit(values, units[name], name), np.float64) for name, values in at.items()}
    except (TypeError, ValueError) as fault:
        raise SweepError(f"at: expected numbers: {fault}") from None
    whole = np.meshgrid(*grids.values(), indexing="ij")
    box, status, shape = Box.of(dataset, names), dataset[STATUS], whole[0].shape
    points = box.points(dataset)
    places = box.points({name: column.ravel() for name, column in zip(grids, whole, strict=True)})
    if any(grid.ndim != 1 for grid in grids.values()) or not np.isfinite(places).all():
        raise SweepError("at: expected a list of finite values for each axis, above 0 where the axis is logarithmic")
    nearest = dataset.isel({status.dims[0]: cKDTree(points).query(places)[1]})
    valued, refined = nearest[STATUS].values < FIRST_REFUSAL, json.loads(dataset.attrs.get(REFINED_TO, "{}"))
    columns, error = dict[Any, Any](), np.zeros(len(places))
    inaccurate = nearest[STATUS].values == Status.INACCURATE
    for name, variable in dataset.data_vars.items():
        if variable.dims == status.dims and variable.dtype.kind == "f" and name != ERROR_BOUND:
            height, size = heights(variable.values), _size(variable.values)
            kind = kinds(status.values, np.isfinite(height))
            between, off = Mesh(points, height, kind).between(places)
            between = between * size if size else np.exp(between)
            columns[name] = np.where(nearest[name].isnull(), np.nan, between)
            if name in refined or not refined:
                error = np.maximum(error, off)
                inaccurate |= ~(off <= refined.get(name, sys.float_info.max))
    columns[STATUS] = np.where(inaccurate & valued, np.int8(Status.INACCURATE), nearest[STATUS])
    if ERROR_BOUND in dataset:
        columns[ERROR_BOUND] = np.where(valued, np.fmax(error, nearest[ERROR_BOUND]), np.nan)
    found = {name: (tuple(grids), values.reshape(shape), dataset[name].attrs) for name, values in columns.items()}
    return xr.Dataset(found, {name: (name, v, dataset[name].attrs) for name, v in grids.items()}, dataset.attrs)


def kinds(status: Indices, valued: NDArray[np.bool_]) -> Indices:
    """Statuses, with those that rounding decides alike; -1 without a value."""
    kind = np.where(status == Status.INACCURATE, int(Status.OK), status.astype(np.intp))
    return np.where((status < FIRST_REFUSAL) & valued, kind, -1)


def on_lines(dataset: xr.Dataset, x: str) -> xr.Dataset:
    """Outputs in cells of a refined result that lie on lines along an axis, each line a row; the rest is NaN.

    Lines are those with five cells and more from one end of the axis to the other, as all of the first grid are. What
    is computed is taken, nothing is interpolated. A dataset whose cells do not fill a box is returned as it is.

    Returns
    -------
    Dataset
        Over x and the other axis; where there are several others, over x and `line`, which names their values. The
        attribute `lines` tells how many cells lie on them, and of which other line most do.

    Raises
    ------
    SweepError
        There is no such line.
    """
    names = axes_of(dataset)
    if x not in names:
        return dataset
    others, values, (cell,) = [name for name in names if name != x], dataset[x].values, dataset[STATUS].dims
    places = np.stack([dataset[name].values for name in others], axis=1)
    lines, line, count = np.unique(places, axis=0, return_inverse=True, return_counts=True)
    line = line.ravel()
    ends = (np.isin(np.arange(len(lines)), line[values == end]) for end in (values.min(), values.max()))
    long = np.logical_and.reduce([count >= FEWEST_ON_A_LINE, *ends])
    at = " ".join(f"--at {n}={float(v)!r}" for n, v in zip(others, lines[count.argmax()], strict=True))
    longest = f"e.g. {at} ({count.max()} cells)"
    if not long.any():
        raise SweepError(
            f"{x}: no {FEWEST_ON_A_LINE} cells lie on one line from end to end of it; pick another axis, or {longest}"
        )
    across, labels = others[0], lines[:, 0]
    if len(others) > 1:
        across = "line"
        labels = np.array([", ".join(f"{n} = {v:.6g}" for n, v in zip(others, place, strict=True)) for place in lines])
    outputs = [name for name, v in dataset.data_vars.items() if v.dims == (cell,) and v.dtype == np.float64]
    cells = dataset[outputs].reset_coords(drop=True).assign_coords({across: (cell, line), x: (cell, values)})
    both: Any = {cell: [across, x]}
    found = cells.isel({cell: long[line]}).set_index(both).unstack(str(cell))
    told = f"{count[long].sum()} of {count.sum()} cells lie on {long.sum()} lines from end to end of {x}"
    found = found.assign_coords({across: labels[long], x: found[x].assign_attrs(dataset[x].attrs)})
    return found.assign_attrs(lines=f"{told}; take any line by --at, {longest}.")
