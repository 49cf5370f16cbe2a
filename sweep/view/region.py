"""What is shown, to keep: the picture for print, the numbers as a table, the region as a study of its own."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from kernels.interface import Field
from sweep.analysis.loglog import is_logarithmic
from sweep.results.export import export
from sweep.study.model import Axis, Study
from sweep.system.errors import SweepError
from sweep.view.slices import PLACE, Choice, Range, along, part, shown

MOST_ROWS = 1_000_000
"""Cells that are sent to a browser as a table."""

POINTS = 101
"""Points of an axis of the refined study, at least."""


def picture(dataset: xr.Dataset, choice: Choice, x_range: Range | None, y_range: Range | None) -> BytesIO:
    """The shown slice as a PNG fit for print. Raises SweepError, also where matplotlib is missing."""
    from sweep.show.charts import plot

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
    wanted = {choice.x: x_range, choice.across: y_range}
    shown_axes = {name: axis for name, axis in study.axes.items() if name in wanted}
    tables = [line for name, axis in shown_axes.items() for line in _axis(study, axis, wanted[name])]
    held = {name: axis for name, axis in study.axes.items() if name not in wanted}
    place = {name: choice.held.get(name, 0) for name in held}
    return "\n".join([*_head(study, held, place), *tables, *_fixed(study, held, place), *_along(study)]) + "\n"


def _head(study: Study, held: dict[str, Axis], place: dict[str, int]) -> Iterator[str]:
    yield f"# {study.question or study.title or study.kernel_name}"
    yield "# The region shown by sweep view."
    yield f"title = {_word(study.title)}"
    yield f"kernel = {_word(study.kernel_name)}"
    given = {"method": study.method, "rtol": study.rtol}
    given |= {name: _held_value(axis, place[name]) for name, axis in held.items() if name in given}
    yield from (f"{name} = {_value(value)}" for name, value in given.items() if name not in study.axes or name in held)
    yield f"outputs = {_value(list(study.outputs))}"


def _axis(study: Study, axis: Axis, wanted: Range | None) -> Iterator[str]:
    yield from ("", f"[axes.{axis.name}]")
    if axis.words is not None:
        yield f"values = {_value(list(axis.words))}"
        return
    low, high = _clipped(axis.values, wanted)
    integer = axis.name in _fields(study) and _fields(study)[axis.name].integer
    if axis.values.ndim > 1 or integer or low == high:
        near = axis.values if axis.values.ndim > 1 or low == high else axis.values[_within(axis.values, low, high)]
        yield f"values = {_value(near.tolist())}"
    else:
        yield f"spacing = {_word('log' if is_logarithmic(axis.values) else 'linear')}"
        yield f"start = {low!r}"
        yield f"stop = {high!r}"
        yield f"num = {max(POINTS, len(axis))}"
    yield from _unit(study, axis.name)


def _within(values: Any, low: float, high: float) -> Any:
    return (values >= low) & (values <= high)


def _clipped(values: Any, wanted: Range | None) -> Range:
    """The part of an axis within a range; what is shown beyond the last cell is nothing."""
    low, high = float(values.min()), float(values.max())
    first, last = sorted(wanted) if wanted else (low, high)
    return (max(low, float(first)), min(high, float(last))) if first < high and last > low else (low, high)


def _fixed(study: Study, held: dict[str, Axis], place: dict[str, int]) -> Iterator[str]:
    fields = _fields(study)
    values: dict[str, Any] = {name: _chosen(fields[name], value) for name, value in study.fixed.items()}
    values |= {name: _held_value(axis, place[name]) for name, axis in held.items() if name in fields}
    if values:
        yield from ("", "[fixed]")
    for name, value in values.items():
        unit = "" if isinstance(value, str) else f", unit = {_word(fields[name].unit)}"
        yield f"{name} = {{ value = {_value(value)}{unit} }}" if unit else f"{name} = {_value(value)}"


def _chosen(field: Field, value: Any) -> Any:
    """The word of a parameter with choices; other values as they are."""
    return {number: word for word, number in field.choices.items()}[int(value)] if field.choices else value


def _along(study: Study) -> Iterator[str]:
    units = {field.name: field.unit for field in study.kernel.along}
    for name, values in study.along.items():
        if len(values):
            yield from ("", f"[along.{name}]", f"values = {_value(values.tolist())}", f"unit = {_word(units[name])}")


def _unit(study: Study, name: str) -> Iterator[str]:
    if name in _fields(study):
        yield f"unit = {_word(_fields(study)[name].unit)}"


def _fields(study: Study) -> dict[str, Field]:
    return {field.name: field for field in study.kernel.parameters}


def _held_value(axis: Axis, place: int) -> Any:
    return axis.words[place] if axis.words else axis.values[place].tolist()


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _word(value)
    if isinstance(value, (list, np.ndarray)):
        return f"[{', '.join(_value(entry) for entry in value)}]"
    return repr(float(value))


def _word(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
