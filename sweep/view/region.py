"""What is shown, to keep: the picture for print, the numbers as a table, the region as a study of its own."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import xarray as xr

from sweep.errors import SweepError
from sweep.laws.loglog import is_logarithmic
from sweep.results.export import export
from sweep.study.model import SETTINGS, Axis, Study
from sweep.study.toml import to_toml
from sweep.view.slices import PLACE, Choice, Range, along, part, shown

MOST_ROWS = 1_000_000
"""Cells that are sent to a browser as a table."""

POINTS = 101
"""Points of an axis of the refined study, at least."""


def picture(dataset: xr.Dataset, choice: Choice, x_range: Range | None, y_range: Range | None) -> BytesIO:
    """The shown slice as a PNG fit for print. Raises SweepError, also where matplotlib is missing."""
    from sweep.show.plot import plot

    found = shown(dataset, choice, x_range, y_range)
    name = str(found.y.name or choice.output)
    columns = {name: found.y, **({"status": _status(dataset, found)} if "status" in dataset else {})}
    return _bytes(".png", lambda path: plot(xr.Dataset(columns, attrs=dataset.attrs), path, y=name, x=choice.x))


def _status(dataset: xr.Dataset, found: Any) -> xr.DataArray:
    status: xr.DataArray = found.y.copy(data=found.status)
    return status.assign_attrs(dataset["status"].attrs)


def table(dataset: xr.Dataset, choice: Choice, x_range: Range | None, y_range: Range | None) -> BytesIO:
    """All outputs of the shown cells, every one of them, as csv. Raises SweepError where they are too many."""
    count = rows(dataset, choice, x_range, y_range)
    if count > MOST_ROWS:
        raise SweepError(f"{count:,} cells are too many for a page; zoom in, or take sweep export, which has no limit")
    cells = _cells(dataset, choice, x_range, y_range)
    return _bytes(".csv", lambda path: export(cells, path))


def rows(dataset: xr.Dataset, choice: Choice, x_range: Range | None, y_range: Range | None) -> int:
    """Lines that the table would have."""
    return math.prod(_cells(dataset, choice, x_range, y_range).sizes.values())


def _cells(dataset: xr.Dataset, choice: Choice, x_range: Range | None, y_range: Range | None) -> xr.Dataset:
    cells = part(dataset, choice, x_range, y_range)
    cells = cells[[name for name, column in cells.data_vars.items() if set(column.dims) <= _dims(dataset, choice)]]
    return cells.drop_vars([name for name in cells.coords if str(name).startswith(PLACE)])


def _dims(dataset: xr.Dataset, choice: Choice) -> set[str]:
    return {along(dataset, choice.x), *([choice.across] if choice.across else [])}


def _bytes(suffix: str, write: Callable[[Path], Any]) -> BytesIO:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"shown{suffix}")
        write(path)
        return BytesIO(path.read_bytes())


def study_text(dataset: xr.Dataset, choice: Choice, x_range: Range | None, y_range: Range | None) -> str:
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
    ranges = {choice.x: x_range, choice.across: y_range}
    axes = {name: _narrowed(study, axis, ranges[name]) for name, axis in study.axes.items() if name in ranges}
    held = {name: _held_value(axis, choice.held.get(name, 0)) for name, axis in study.axes.items() if name not in axes}
    settings = {name: held.pop(name) for name in SETTINGS if name in held}
    question = f"{study.question or study.title}, in the region shown by sweep view"
    return to_toml(
        replace(study, question=question, axes=axes, fixed={**study.fixed, **held}, summary=None, **settings)
    )


def _narrowed(study: Study, axis: Axis, wanted: Range | None) -> Axis:
    """The part of an axis within a range, with more points; words, whole numbers and lists of lists as they are."""
    field = {parameter.name: parameter for parameter in study.kernel.parameters}.get(axis.name)
    low, high = _clipped(axis.values, wanted)
    if axis.words is not None or axis.values.ndim > 1 or low == high or (field is not None and field.integer):
        near = (axis.values >= low) & (axis.values <= high) if axis.words is None and axis.values.ndim == 1 else None
        return replace(axis, entry=None, values=axis.values if near is None else axis.values[near])
    spacing = "log" if is_logarithmic(axis.values) else "linear"
    entry: dict[str, Any] = {"spacing": spacing, "start": low, "stop": high, "num": max(POINTS, len(axis))}
    entry |= {"unit": field.unit} if field is not None else {}
    return replace(axis, spacing=spacing, entry=entry)


def _clipped(values: Any, wanted: Range | None) -> Range:
    """The part of an axis within a range; what is shown beyond the last cell is nothing."""
    low, high = float(values.min()), float(values.max())
    first, last = sorted(wanted) if wanted else (low, high)
    return (max(low, float(first)), min(high, float(last))) if first < high and last > low else (low, high)


def _held_value(axis: Axis, place: int) -> Any:
    """The value of an axis that is held: of methods the word, of parameters the number."""
    return axis.words[place] if axis.words and axis.name in SETTINGS else axis.values[place]
