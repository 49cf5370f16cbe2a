"""What the page shows of a result: an output over one or two axes, the others held. No more than that is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sweep.cells.schema import STATUS
from sweep.errors import SweepError
from sweep.laws.exponents import local_exponent
from sweep.results.statuses import flag_words
from sweep.show.view import ANCILLARY, View, coordinate, edges, is_number_axis, view

PLACE = "place along "
"""Coordinates of a slice that say where its cells are in the result."""

Range = tuple[float, float]


@dataclass(frozen=True)
class Choice:
    """What is looked at.

    Attributes
    ----------
    output : str
    x : str
        Axis, or coordinate along the cells of a zip design, that the picture runs along.
    across : str, optional
        The other axis of a map or of a family of lines; None: one line.
    held : dict of str to int
        Place of every other axis.
    exponent : bool
        Show the local exponent of the output in x instead of the output.
    """

    output: str
    x: str
    across: str | None = None
    held: Mapping[str, int] = field(default_factory=dict)
    exponent: bool = False


def outputs(dataset: xr.Dataset) -> list[str]:
    """The outputs that run along an axis of numbers."""
    numbers = (str(n) for n, v in dataset.data_vars.items() if v.dtype.kind in "fiu" and n not in ANCILLARY)
    return [name for name in numbers if number_axes(dataset, name)]


def number_axes(dataset: xr.Dataset, output: str) -> list[str]:
    """What a picture of the output can run along: axes first, the longest of them first."""
    lines = [str(n) for n, c in dataset[output].coords.items() if c.ndim == 1 and c.dtype.kind in "fiu"]
    return sorted(lines, key=lambda name: (name not in dataset.dims, -dataset[name].size))


def along(dataset: xr.Dataset, x: str) -> str:
    """The dimension of a coordinate."""
    return str(dataset[x].dims[0])


def other_axes(dataset: xr.Dataset, choice: Choice) -> list[str]:
    """The axes of an output that x does not run along, the longest of numbers first."""
    column = dataset[choice.output]
    others = [str(dim) for dim in column.dims if dim != along(dataset, choice.x)]
    return sorted(others, key=lambda dim: (not is_number_axis(column, dim), -dataset.sizes[dim]))


def part(dataset: xr.Dataset, choice: Choice, x_range: Range | None = None, y_range: Range | None = None) -> xr.Dataset:
    """The cells within the ranges of both axes, with all outputs; lazy as the dataset is.

    An axis that is not in order is not cut.
    """
    dims = [along(dataset, choice.x), *([choice.across] if choice.across else [])]
    places = {PLACE + dim: (dim, np.arange(dataset.sizes[dim])) for dim in dims}
    held = dataset.assign_coords(places).isel({dim: choice.held.get(dim, 0) for dim in _held_dims(dataset, choice)})
    wanted = {choice.x: x_range, choice.across: y_range}
    cuts = {dim: _cut(coordinate(held[choice.output], dim).values, wanted[dim]) for dim in dims if wanted.get(dim)}
    return held.isel(cuts)


def _held_dims(dataset: xr.Dataset, choice: Choice) -> list[str]:
    return [dim for dim in other_axes(dataset, choice) if dim != choice.across]


def _cut(grid: NDArray[Any], wanted: Range | None) -> slice:
    """The cells of an axis that reach into a range, and two more on both sides, which show the spacing."""
    if wanted is None or grid.dtype.kind not in "fiu" or not (np.diff(grid) > 0).all():
        return slice(None)
    first, last = np.searchsorted(grid, sorted(wanted))
    return slice(max(0, int(first) - 3), min(grid.size, int(last) + 3))


def shown(dataset: xr.Dataset, choice: Choice, x_range: Range | None = None, y_range: Range | None = None) -> View:
    """The slice, read; of long axes every second, third ... cell, as many as a picture can show.

    Raises
    ------
    SweepError
        The exponent is asked for along what is no positive axis.
    """
    names = [choice.output, *([STATUS] if STATUS in dataset else [])]
    found = view(part(dataset[names], choice, x_range, y_range), choice.output, choice.x)
    if not choice.exponent:
        return found
    if found.x != found.along:
        raise SweepError(f"{choice.x} is no axis of the study; a local exponent needs neighbours along one")
    return replace(found, y=local_exponent(found.y, choice.x))


def nearest(found: View, x: float, y: float, mapped: bool, logarithmic: tuple[bool, bool]) -> dict[str, int] | None:
    """Where in the result the cell is that a point of the picture belongs to; None beside the map.

    Parameters
    ----------
    mapped : bool
        Whether the picture is a map, of cells with edges, or has lines.
    logarithmic : two bool
        How the axes of the picture are drawn; of lines the nearest point is taken as the eye sees it.
    """
    if mapped:
        column, row = (int(cell_numbers(found.values(name), np.array([at]))[0]) for name, at in _map_axes(found, x, y))
        return None if min(row, column) < 0 else _places(found, row, column)
    away = _distance(found.values(found.x), x, logarithmic[0])
    if found.joined:  # above or below its point, a click means the nearest line
        column = int(np.nanargmin(away))
        heights = np.atleast_2d(found.y.values)[:, column]
        off = _distance(heights, y, logarithmic[1])
        return _places(found, int(np.nanargmin(off)) if np.isfinite(off).any() else 0, column)
    off = np.hypot(away, _distance(np.atleast_2d(found.y.values), y, logarithmic[1]))
    best = int(np.nanargmin(off)) if np.isfinite(off).any() else 0
    return _places(found, *divmod(best, away.size))


def _map_axes(found: View, x: float, y: float) -> list[tuple[str, float]]:
    return [(found.x, x), (str(found.across), y)]


def _distance(values: NDArray[Any], at: float, logarithmic: bool) -> NDArray[np.float64]:
    """Distances as a picture shows them: shares of its width."""
    with np.errstate(invalid="ignore", divide="ignore"):
        numbers = np.log(np.append(values, at)) if logarithmic else np.append(values, at).astype(np.float64)
    numbers = np.where(np.isfinite(numbers), numbers, np.nan)
    width = np.nanmax(numbers[:-1]) - np.nanmin(numbers[:-1]) if np.isfinite(numbers[:-1]).any() else 1.0
    away: NDArray[np.float64] = (abs(numbers[:-1] - numbers[-1]) / (width or 1.0)).reshape(np.shape(values))
    return away


def _places(found: View, row: int, column: int) -> dict[str, int]:
    dims = {found.along: column, **({found.across: row} if found.across else {})}
    return {dim: int(found.y[PLACE + dim].values[i]) for dim, i in dims.items()}


def cell_numbers(grid: NDArray[Any], at: NDArray[np.float64]) -> NDArray[np.intp]:
    """Which cell of a rising axis each of some points is in; -1 beside all of them."""
    borders = edges(grid.astype(np.float64))
    found = np.searchsorted(borders, at, side="right") - 1
    return np.where((at < borders[0]) | (at > borders[-1]), -1, np.minimum(found, grid.size - 1))


@dataclass(frozen=True)
class Entry:
    """One number of a cell: a line of the table beside the picture."""

    name: str
    value: str
    unit: str
    meaning: str


def row(dataset: xr.Dataset, places: Mapping[str, int]) -> list[Entry]:
    """All that is known of one cell, of a trace at one place: parameters, outputs, status, method."""
    cell = dataset.isel(places)
    single = cell[[name for name, column in cell.variables.items() if not column.dims]].load()
    return [_entry(single[name]) for name in (*single.coords, *single.data_vars) if not str(name).startswith(PLACE)]


def _entry(column: xr.DataArray) -> Entry:
    words, value = flag_words(column), column.item()
    text = words.get(value, str(value)) if words else f"{value:.17g}" if column.dtype.kind == "f" else str(value)
    unit = str(column.attrs.get("units", ""))
    return Entry(str(column.name), text, "" if unit == "1" else unit, str(column.attrs.get("long_name", "")))
