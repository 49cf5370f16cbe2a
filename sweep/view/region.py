"""The part of a result that is looked at: an output over one or two axes, the others held; read, clicked and saved.

No more than that is read.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sweep.cells.schema import STATUS
from sweep.errors import SweepError
from sweep.laws.exponents import local_exponent
from sweep.laws.loglog import is_logarithmic
from sweep.results.export import export
from sweep.results.statuses import flag_words
from sweep.show.view import ANCILLARY, View, coordinate, edges, is_number_axis, view
from sweep.study.model import SETTINGS, Axis, Study
from sweep.study.toml import to_toml

PLACE = "place along "
"""Coordinates of a slice that say where its cells are in the result."""
MOST_ROWS = 1_000_000
"""Cells that are sent to a browser as a table."""
POINTS = 101
"""Points of an axis of the refined study, at least."""

Range = tuple[float, float]


@dataclass(frozen=True)
class Choice:
    """What is looked at: an output, or its local exponent in x, over an axis, or a coordinate along the cells of a zip.

    `across` is the other axis of a map or of a family of lines, `held` the place of every further one; the ranges are
    what of x and across is in view, None: all.
    """

    output: str
    x: str
    across: str | None = None
    held: Mapping[str, int] = field(default_factory=dict)
    exponent: bool = False
    x_range: Range | None = None
    y_range: Range | None = None


def number_axes(dataset: xr.Dataset, output: str) -> list[str]:
    """What a picture of the output can run along: axes first, the longest of them first."""
    lines = [str(n) for n, c in dataset[output].coords.items() if c.ndim == 1 and c.dtype.kind in "fiu"]
    return sorted(lines, key=lambda name: (name not in dataset.dims, -dataset[name].size))


def outputs(dataset: xr.Dataset) -> list[str]:
    """The outputs that run along an axis of numbers."""
    numbers = (str(n) for n, v in dataset.data_vars.items() if v.dtype.kind in "fiu" and n not in ANCILLARY)
    return [name for name in numbers if number_axes(dataset, name)]


def along(dataset: xr.Dataset, x: str) -> str:
    """The dimension of a coordinate."""
    return str(dataset[x].dims[0])


def other_axes(dataset: xr.Dataset, choice: Choice) -> list[str]:
    """The axes of an output that x does not run along, the longest of numbers first."""
    column = dataset[choice.output]
    others = [str(dim) for dim in column.dims if dim != along(dataset, choice.x)]
    return sorted(others, key=lambda dim: (not is_number_axis(column, dim), -dataset.sizes[dim]))


def part(dataset: xr.Dataset, choice: Choice) -> xr.Dataset:
    """The cells within the ranges of both axes, with all outputs; lazy as the dataset is.

    Two more cells on both sides show the spacing. An axis that is not in order is not cut.
    """
    wanted = {along(dataset, choice.x): None, **({choice.across: choice.y_range} if choice.across else {})}
    if choice.x in wanted:
        wanted[choice.x] = choice.x_range
    held = {dim: choice.held.get(dim, 0) for dim in other_axes(dataset, choice) if dim != choice.across}
    places = {PLACE + dim: (dim, np.arange(dataset.sizes[dim])) for dim in wanted}
    found = dataset.assign_coords(places).isel(held)
    for dim, ends in wanted.items():
        grid = coordinate(found[choice.output], dim).values
        if ends is not None and grid.dtype.kind in "fiu" and (np.diff(grid) > 0).all():
            first, last = np.searchsorted(grid, sorted(ends))
            found = found.isel({dim: slice(max(0, int(first) - 3), min(grid.size, int(last) + 3))})
    return found


def shown(dataset: xr.Dataset, choice: Choice) -> View:
    """The slice, read; of long axes every second, third ... cell, as many as a picture can show.

    Raises
    ------
    SweepError
        The exponent is asked for along what is no positive axis.
    """
    names = [choice.output, *([STATUS] if STATUS in dataset else [])]
    found = view(part(dataset[names], choice), choice.output, choice.x)
    if not choice.exponent:
        return found
    if not found.joined:
        raise SweepError(f"{choice.x} is no axis of the study; a local exponent needs neighbours along one")
    return replace(found, y=local_exponent(found.y, choice.x))


def cell_numbers(grid: NDArray[Any], at: NDArray[np.float64]) -> NDArray[np.intp]:
    """Which cell of a rising axis each of some points is in; -1 beside all of them."""
    borders = edges(grid.astype(np.float64))
    found = np.searchsorted(borders, at, side="right") - 1
    return np.where((at < borders[0]) | (at > borders[-1]), -1, np.minimum(found, grid.size - 1))


def nearest(found: View, x: float, y: float, logarithmic: tuple[bool, bool]) -> dict[str, int] | None:
    """Where in the result the cell is that a point of the picture belongs to; None beside the map.

    Parameters
    ----------
    logarithmic : two bool
        How the axes of the picture are drawn; of lines the nearest point is taken as the eye sees it.
    """
    if found.mapped:
        grids = (str(found.across), y), (found.x, x)
        row, column = (int(cell_numbers(found.values(name), np.array([at]))[0]) for name, at in grids)
        if min(row, column) < 0:
            return None
    else:
        heights = np.atleast_2d(found.y.values)
        beside = np.broadcast_to(_distance(found.values(found.x), x, logarithmic[0]), heights.shape)
        if found.joined:  # above or below its point, a click means the nearest line
            column = int(np.nanargmin(beside[0]))
            off = np.full(heights.shape, np.nan)
            off[:, column] = _distance(heights[:, column], y, logarithmic[1])
        else:
            off, column = np.hypot(beside, _distance(heights, y, logarithmic[1])), 0
        best = int(np.nanargmin(off)) if np.isfinite(off).any() else column
        row, column = divmod(best, heights.shape[1])
    dims = {found.along: column, **({found.across: row} if found.across else {})}
    return {dim: int(found.y[PLACE + dim].values[i]) for dim, i in dims.items()}


def _distance(values: NDArray[Any], at: float, logarithmic: bool) -> NDArray[np.float64]:
    """Distances as a picture shows them: shares of its width."""
    with np.errstate(invalid="ignore", divide="ignore"):
        numbers, place = (np.log(np.asarray(v, np.float64)) if logarithmic else np.asarray(v) for v in (values, at))
    numbers = np.where(np.isfinite(numbers), numbers, np.nan)
    width = np.nanmax(numbers) - np.nanmin(numbers) if np.isfinite(numbers).any() else 1.0
    away: NDArray[np.float64] = abs(numbers - place) / (width or 1.0)
    return away


def row(dataset: xr.Dataset, places: Mapping[str, int]) -> list[tuple[str, ...]]:
    """All about one cell, of a trace at one place: name, value, unit, meaning; outputs first, then parameters."""
    cell = dataset.isel(places)
    single = cell[[name for name, column in cell.variables.items() if not column.dims]].load()
    rows: list[tuple[str, ...]] = []
    for name in (name for name in (*single.data_vars, *single.coords) if not str(name).startswith(PLACE)):
        column, value = single[name], single[name].item()
        text = flag_words(column).get(value) or (f"{value:.6g}" if column.dtype.kind == "f" else str(value))
        unit = str(column.attrs.get("units", ""))
        rows.append((str(name), text, "" if unit == "1" else unit, str(column.attrs.get("long_name", ""))))
    return rows


def picture(dataset: xr.Dataset, choice: Choice) -> BytesIO:
    """The shown slice as a PNG fit for print. Raises SweepError, also where matplotlib is missing."""
    from sweep.show.charts import plot

    found = shown(dataset, choice)
    name = str(found.y.name or choice.output)
    columns = {name: found.y}
    if STATUS in dataset:
        columns[STATUS] = found.y.copy(data=found.status).assign_attrs(dataset[STATUS].attrs)
    return _bytes(".png", lambda path: plot(xr.Dataset(columns, attrs=dataset.attrs), path, y=name, x=choice.x))


def table(dataset: xr.Dataset, choice: Choice) -> BytesIO:
    """All outputs of the shown cells, every one of them, as csv. Raises SweepError where they are too many."""
    count, cells = rows(dataset, choice), part(dataset, choice)
    if count > MOST_ROWS:
        raise SweepError(f"{count:,} cells are too many for a page; zoom in, or take sweep export, which has no limit")
    dims = {along(dataset, choice.x), choice.across}
    cells = cells[[name for name, column in cells.data_vars.items() if set(column.dims) <= dims]]
    cells = cells.drop_vars([name for name in cells.coords if str(name).startswith(PLACE)])
    return _bytes(".csv", lambda path: export(cells, path))


def rows(dataset: xr.Dataset, choice: Choice) -> int:
    """Lines that the table has."""
    sizes = part(dataset, choice).sizes
    return math.prod(sizes[dim] for dim in {along(dataset, choice.x), choice.across} if dim)


def _bytes(suffix: str, write: Callable[[Path], Any]) -> BytesIO:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"shown{suffix}")
        write(path)
        return BytesIO(path.read_bytes())


def study_text(dataset: xr.Dataset, choice: Choice) -> str:
    """A study, in TOML, of the shown region alone: as many points on a smaller part of each axis.

    Axes that are held become parameters at their value. Numbers are in the units of the kernel's fields.

    Raises
    ------
    SweepError
        The result does not say which study it came from, or that is no grid.
    """
    if "study_json" not in dataset.attrs:
        raise SweepError("the result does not say which study it came from")
    study = Study.from_json(str(dataset.attrs["study_json"]), declared=True)
    if study.design != "product":
        raise SweepError("only a product of axes has regions; this study is a list of cells")
    ranges = {choice.x: choice.x_range, choice.across: choice.y_range}
    axes = {name: _narrowed(study, axis, ranges[name]) for name, axis in study.axes.items() if name in ranges}
    held: dict[str, Any] = {}
    for name, axis in study.axes.items():
        if name not in axes:  # of methods the word, of parameters the number
            place = choice.held.get(name, 0)
            held[name] = axis.words[place] if axis.words and name in SETTINGS else axis.values[place]
    settings = {name: held.pop(name) for name in SETTINGS if name in held}
    question = f"{study.question or study.title}, in the region shown by sweep view"
    fixed = {**study.fixed, **held}
    return to_toml(replace(study, question=question, axes=axes, fixed=fixed, summary=None, **settings))


def _narrowed(study: Study, axis: Axis, wanted: Range | None) -> Axis:
    """The part of an axis within a range, with more points; words, whole numbers and lists of lists as they are."""
    fields = {parameter.name: parameter for parameter in study.kernel.parameters}
    if axis.words is not None or axis.values.ndim > 1:
        return replace(axis, entry=None)
    low, high = float(axis.values.min()), float(axis.values.max())
    first, last = sorted(wanted) if wanted else (low, high)
    if first < high and last > low:  # what is shown beyond the last cell is nothing
        low, high = max(low, float(first)), min(high, float(last))
    spec = fields.get(axis.name)
    if low == high or (spec is not None and spec.integer):
        return replace(axis, entry=None, values=axis.values[(axis.values >= low) & (axis.values <= high)])
    spacing = "log" if is_logarithmic(axis.values) else "linear"
    entry: dict[str, Any] = {"spacing": spacing, "start": low, "stop": high, "num": max(POINTS, len(axis))}
    return replace(axis, spacing=spacing, entry=entry | ({"unit": spec.unit} if spec is not None else {}))
