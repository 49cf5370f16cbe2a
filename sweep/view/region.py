"""The selected slice of a result: an output over one or two axes, the others held; only this slice is read."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from sweep.cells.schema import STATUS
from sweep.errors import SweepError
from sweep.laws.exponents import local_exponent
from sweep.laws.loglog import is_logarithmic
from sweep.results.export import export
from sweep.results.statuses import flag_words
from sweep.show.view import View, coordinate, is_number_axis, lines_of
from sweep.study.model import SETTINGS, Axis, Study
from sweep.study.read import to_toml

PLACE = "place along "
"""Coordinates of a slice that say where its cells are in the result."""
POINTS = 101
"""Least number of points on an axis of the refined study."""

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
    return sorted(lines_of(dataset[output]), key=lambda name: (name not in dataset.dims, -dataset[name].size))


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
    ranges = {along(dataset, choice.x): choice.x_range if choice.x in dataset.dims else None}
    if choice.across:
        ranges[choice.across] = choice.y_range
    found = dataset.isel({dim: choice.held.get(dim, 0) for dim in other_axes(dataset, choice) if dim not in ranges})
    for dim, ends in ranges.items():
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
    columns = dataset[[choice.output, *([STATUS] if STATUS in dataset else [])]]
    places = {PLACE + str(dim): (dim, np.arange(size)) for dim, size in columns.sizes.items()}
    found = View(part(columns.assign_coords(places), choice), choice.output, choice.x)
    if not choice.exponent:
        return found
    if not found.joined:
        raise SweepError(f"{choice.x} is not an axis of the study; a local exponent needs neighbours along one")
    found.y = local_exponent(found.y, choice.x)
    return found


def row(dataset: xr.Dataset, places: Mapping[str, int]) -> list[tuple[str, ...]]:
    """All about one cell, of a trace at one place: name, value, unit, meaning; outputs first, then parameters."""
    cell = dataset.isel(places)
    single = cell[[name for name, column in cell.variables.items() if not column.dims]].load()
    rows: list[tuple[str, ...]] = []
    for name in (*single.data_vars, *single.coords):
        column, value = single[name], single[name].item()
        text = flag_words(column).get(value) or (f"{value:.6g}" if column.dtype.kind == "f" else str(value))
        unit = str(column.attrs.get("units", ""))
        rows.append((str(name), text, "" if unit == "1" else unit, str(column.attrs.get("long_name", ""))))
    return rows


def picture(dataset: xr.Dataset, choice: Choice) -> BytesIO:
    """The shown slice as a PNG fit for print. Raises SweepError, also where matplotlib is missing."""
    from sweep.show.charts import png
    from sweep.show.figures import view_figure

    return BytesIO(png(view_figure(shown(dataset, choice), dataset.attrs.get("title", ""))))


def table(dataset: xr.Dataset, choice: Choice) -> BytesIO:
    """All outputs of the shown cells, every one of them, as csv."""
    cells, dims = part(dataset, choice), {along(dataset, choice.x), choice.across}
    cells = cells[[name for name, column in cells.data_vars.items() if set(column.dims) <= dims]]
    with tempfile.TemporaryDirectory() as folder:
        return BytesIO(export(cells, Path(folder, "shown.csv")).read_bytes())


def study_text(dataset: xr.Dataset, choice: Choice) -> str:
    """A study, in TOML, of the shown region alone: as many points on a smaller part of each axis.

    Axes that are held become parameters at their value. Numbers are in the units of the kernel's fields.

    Raises
    ------
    SweepError
        The result does not say which study it came from, or that is no grid.
    """
    study = Study.of(dataset, declared=True)
    if study.design != "product":
        raise SweepError("only a product of axes has regions; this study is a list of cells")
    known = {*SETTINGS, *(parameter.name for parameter in study.kernel.parameters)}
    if joined := study.axes.keys() - known:
        raise SweepError(f"no study has the axis {joined.pop()}, along which results were joined; view one of them")
    ranges = {choice.x: choice.x_range, choice.across: choice.y_range}
    axes: dict[str, Axis] = {}
    fixed: dict[str, Any] = dict(study.fixed)
    for name, axis in study.axes.items():
        if name in ranges:
            axes[name] = _narrowed(study, axis, ranges[name])
        else:  # of methods the word, of parameters the number
            values = axis.words if axis.words and name in SETTINGS else axis.values
            fixed[name] = values[choice.held.get(name, 0)]
    settings: dict[str, Any] = {name: fixed.pop(name) for name in SETTINGS if name in fixed}
    question = f"{study.question or study.title}, in the region shown by sweep view"
    return to_toml(replace(study, question=question, axes=axes, fixed=fixed, summary=None, **settings))


def _narrowed(study: Study, axis: Axis, wanted: Range | None) -> Axis:
    """The part of an axis within a range, with more points; words, whole numbers and lists of lists as they are."""
    if axis.words is not None or axis.values.ndim > 1:
        return replace(axis, entry=None)
    low, high = float(axis.values.min()), float(axis.values.max())
    first, last = sorted(wanted) if wanted else (low, high)
    if first < high and last > low:  # what is shown beyond the last cell is nothing
        low, high = max(low, float(first)), min(high, float(last))
    spec = next((parameter for parameter in study.kernel.parameters if parameter.name == axis.name), None)
    if low == high or (spec is not None and spec.integer):
        return replace(axis, entry=None, values=axis.values[(axis.values >= low) & (axis.values <= high)])
    spacing = "log" if is_logarithmic(axis.values) else "linear"
    entry: dict[str, Any] = {"spacing": spacing, "start": low, "stop": high, "num": max(POINTS, len(axis))}
    return replace(axis, spacing=spacing, entry=entry | ({"unit": spec.unit} if spec is not None else {}))
