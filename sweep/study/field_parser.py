"""One entry of a study: a quantity, or the values of an axis or coordinate, brought to the unit of its field."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels.interface import Field
from sweep.study import spacing as axes
from sweep.study.mistakes import Mistakes, did_you_mean, exact_float, listed, quoted, show
from sweep.study.model import Axis, frozen
from sweep.study.units import UnitMistake, scale

Floats = NDArray[np.float64]

SPACINGS = {"linear": axes.linear, "log": axes.logarithmic}
SPACING_KEYS = ("start", "stop", "num")
FORMS = ("spacing", "values", "file")
"""An axis is given in one of these forms."""

EXAMPLE = '{ spacing = "log", start = 0.1, stop = 10, num = 21 }'
SAMPLED_KEYS = ("spacing", "start", "stop")
SAMPLED_EXAMPLE = '{ spacing = "log", start = 0.1, stop = 10 }'
MOST_BAD_VALUES = 3
"""Bad values reported of one list."""

NONE: Floats = np.empty(0)
"""Values of an axis that has a mistake."""


@dataclass
class FieldParser:
    """Reads the entries of one study, each for a field of the kernel.

    What is wrong goes to `mistakes`, and NaN or no values come back.

    A field of None is one that is not known: then only the shape of the entry is checked.
    """

    mistakes: Mistakes
    folder: Path

    def quantity(self, entry: Any, field: Field | None, where: str) -> float | Floats:
        """A number, a table { value, unit }, or a word of the field, as the number in the kernel's column.

        Of an array parameter also a list, or a table { file, unit }; one number stands for all its values.
        """
        if field is not None and field.dims:
            return self._array(entry, field, where)
        factor = None
        if isinstance(entry, Mapping):
            entry = self.mistakes.keys(entry, ("value", *(("file",) if field is None else ()), "unit"), where)
            if field is None and "file" in entry:
                return math.nan
            factor = self._factor(entry, field, where)
            entry, where = entry.get("value"), f"{where}.value"
        if isinstance(entry, list | tuple):
            if field is not None:
                name = where.split(".")[1]
                self.mistakes.add(where, f"expected a number, found a list; to sweep it, write it under [axes.{name}]")
            return math.nan
        values = self._numbers([entry], lambda item: _number(item, field), lambda _: (where, ""))
        return float(axes.scaled(values, factor)[0]) if len(values) else math.nan

    def _array(self, entry: Any, field: Field, where: str) -> float | Floats:
        table = entry if isinstance(entry, Mapping) else {"value": entry}
        table = self.mistakes.keys(table, ("value", "file", "unit"), where)
        factor = self._factor(table, field, where)
        if "file" in table:
            if "value" in table:
                self.mistakes.add(where, "value and file exclude each other; keep one")
            return frozen(axes.scaled(self._file(table["file"], field.name, field, f"{where}.file"), factor))
        found, at = table.get("value"), f"{where}.value" if isinstance(entry, Mapping) else where
        if hasattr(found, "__array__"):
            found = np.asarray(found).tolist()
        if not isinstance(found, list | tuple):
            return float(axes.scaled(np.array([self.mistakes.number(found, at)]), factor)[0])
        return frozen(axes.scaled(self._list(found, field, at), factor))

    def axis(self, name: str, given: Any, field: Field | None, where: str) -> Axis:
        """An axis or coordinate: a list of values, or a table with `spacing`, `values` or `file`.

        Of an array parameter a list of lists, or a csv file with a column for each value: J_1, J_2, ...
        """
        table, form = self._form(given if isinstance(given, Mapping) else {"values": given}, where)
        factor = self._factor(table, field, where)
        values, kind = NONE, form
        if form == "spacing" and field and field.dims:
            self.mistakes.add(f"{where}.spacing", f"{name} has a value for each {field.dims[0]}; give values or a file")
        elif form == "spacing":
            values, kind = self._spaced(table, field, where, factor), str(table["spacing"])
        elif form == "values":
            read = self._rows if field and field.dims else self._list
            values = axes.scaled(
                read(table["values"], field, f"{where}.values" if isinstance(given, Mapping) else where), factor
            )
        elif form == "file" and field is not None:
            from_file = self._row_file if field and field.dims else self._file
            values = axes.scaled(from_file(table["file"], name, field, f"{where}.file"), factor)
        entry = _entry(table) if form == "spacing" and len(values) else None
        return Axis(name, frozen(values), kind, _words(values, field), entry)

    def _form(self, given: Mapping[str, Any], where: str) -> tuple[Mapping[str, Any], str]:
        """The table, and which of the `FORMS` it is; "" where it is none or several."""
        before = len(self.mistakes)
        table = self.mistakes.keys(given, (*FORMS, *SPACING_KEYS, "unit"), where)
        forms = [form for form in FORMS if form in table]
        if len(forms) > 1:
            self.mistakes.add(where, f"{listed(forms, word='and')} exclude each other; keep one")
        elif not forms and len(self.mistakes) == before:
            cure = 'spacing = "linear" or "log"' if set(table) & set(SPACING_KEYS) else EXAMPLE
            self.mistakes.add(where, f"has neither spacing, values nor file; write {cure}")
        if len(forms) != 1:
            return table, ""
        for key in SPACING_KEYS:
            if (key in table) and forms != ["spacing"]:
                self.mistakes.add(f"{where}.{key}", f"does not go with {forms[0]}; leave it out")
        return table, forms[0]

    def _factor(self, table: Mapping[str, Any], field: Field | None, where: str) -> Decimal | None:
        """What the numbers of an entry are multiplied by, to be in the field's unit."""
        if "unit" not in table:
            return None
        unit = self.mistakes.text(table["unit"], f"{where}.unit")
        if field is None or not isinstance(table["unit"], str):
            return None
        try:
            if field.choices:
                raise UnitMistake(f"{field.name} takes words, which have no unit; leave it out")
            return scale(unit, field.unit, field.name)
        except UnitMistake as error:
            self.mistakes.add(f"{where}.unit", str(error))
            return None

    def _spaced(self, table: Mapping[str, Any], field: Field | None, where: str, factor: Decimal | None) -> Floats:
        before = len(self.mistakes)
        spacing = self._spacing(table, field, where)
        start, stop = self._bounds(table, spacing, where)
        cure = "; for a single value write values = [...]"
        num = self.mistakes.count(table.get("num", 2), f"{where}.num", axes.LARGEST_AXIS, cure)
        if "num" not in table:
            self.mistakes.add(f"{where}.num", f"missing; write e.g. {EXAMPLE}")
        if start == stop and len(self.mistakes) == before:
            self.mistakes.add(f"{where}.stop", f"equals start; for a single value write values = [{start:g}]")
        if spacing is None or num is None or len(self.mistakes) > before:
            return NONE
        return self._in_range(SPACINGS[spacing](start, stop, num, factor), spacing, start, stop, where)

    def _spacing(self, table: Mapping[str, Any], field: Field | None, where: str) -> str | None:
        if field and field.choices:
            self.mistakes.add(where, f"{field.name} takes words; write e.g. values = [{quoted(field.choices)}]")
            return None
        if "spacing" not in table:
            self.mistakes.add(f"{where}.spacing", 'missing; write spacing = "linear" or "log"')
            return None
        return self.mistakes.word(table["spacing"], f"{where}.spacing", SPACINGS)

    def _bounds(self, table: Mapping[str, Any], spacing: str | None, where: str) -> tuple[float, float]:
        """From where to where an axis runs; mistakes where one is missing or no axis of that spacing has it."""
        found = []
        for key, bound in (("start", 1), ("stop", 2)):
            if key not in table:
                self.mistakes.add(f"{where}.{key}", f"missing; write e.g. {EXAMPLE}")
            value = self.mistakes.finite(table.get(key, bound), f"{where}.{key}")
            if spacing == "log" and value <= 0:
                self.mistakes.add(f"{where}.{key}", f"a log axis needs {key} > 0, found {value:g}")
            found.append(value)
        return found[0], found[1]

    def _in_range(self, values: Floats, spacing: str, start: float, stop: float, where: str) -> Floats:
        ends = np.abs([values.min(), values.max()])
        if (ends < math.inf).all() and (spacing != "log" or ends.all()):
            return values
        self.mistakes.add(
            where, f"{start:g} to {stop:g} leaves the range of float64 once converted to the kernel's unit"
        )
        return NONE

    def sampled(self, name: str, entry: Any, field: Field | None, where: str, shares: Floats) -> Axis:
        """An axis of a sampled design: a table with spacing, start and stop; values lie at `shares` of the way."""
        before = len(self.mistakes)
        table = self.mistakes.table(entry, where, SAMPLED_EXAMPLE)
        factor, spacing, bounds = None, None, (math.nan, math.nan)
        table = self.mistakes.keys(table, (*SAMPLED_KEYS, "unit"), where)
        if field and (field.dims or field.integer):
            kind = "an array" if field.dims else "a whole number"
            self.mistakes.add(where, f"{name} is {kind}, which is not sampled; sweep it in a block of its own")
        if len(self.mistakes) == before:
            factor = self._factor(table, field, where)
            spacing = self._spacing(table, field, where)
            bounds = self._bounds(table, spacing, where)
        if len(self.mistakes) > before or spacing is None:
            return Axis(name, NONE, "values")
        values = self._in_range(axes.spread(spacing, *bounds, shares, factor), spacing, *bounds, where)
        return Axis(name, frozen(values), spacing, entry=_entry(table) if len(values) else None)

    def _list(self, found: Any, field: Field | None, where: str) -> Floats:
        if hasattr(found, "__array__"):
            found = np.asarray(found)
            if found.ndim == 1 and found.dtype == np.float64 and not (field and field.choices):
                return found if self._allowed_length(len(found), where) else NONE
            found = found.tolist()
        if isinstance(found, str | bytes) or not isinstance(found, Sequence):
            self.mistakes.add(where, f"expected a list, found {show(found)}; write e.g. [1.0, 2.0]")
            return NONE
        if not self._allowed_length(len(found), where):
            return NONE
        return self._numbers(found, lambda item: _number(item, field), lambda i: (f"{where}[{i}]", ""))

    def _rows(self, found: Any, field: Field | None, where: str) -> Floats:
        """A list of lists of equal length: a row for each value of the axis."""
        if hasattr(found, "__array__"):
            found = np.asarray(found, np.float64) if np.ndim(found) == 2 else np.asarray(found).tolist()
            if isinstance(found, np.ndarray):
                return found if self._allowed_length(len(found), where) else NONE
        if not isinstance(found, list | tuple) or not all(isinstance(row, list | tuple) for row in found):
            self.mistakes.add(where, "expected a list of lists, one for each cell; write e.g. [[1.0, 2.0], [1.5, 2.0]]")
            return NONE
        if not self._allowed_length(len(found), where):
            return NONE
        rows = [self._list(row, field, f"{where}[{i}]") for i, row in enumerate(found)]
        return self._stacked(rows, where)

    def _stacked(self, rows: list[Floats], where: str) -> Floats:
        lengths = sorted({len(row) for row in rows})
        if len(lengths) > 1 and lengths[0]:
            self.mistakes.add(where, f"expected lists of equal length, found {lengths[0]} and {lengths[-1]} values")
        return np.array(rows) if len(lengths) == 1 and lengths[0] else NONE

    def _row_file(self, found: Any, name: str, field: Field | None, where: str) -> Floats:
        """Columns name_1, name_2, ... of a csv file, a row for each value of the axis."""
        if not isinstance(found, str | Path):
            return self._file(found, name, field, where)
        try:
            count = axes.numbered_columns(self._path(found), name)
        except ValueError as error:
            self.mistakes.add(where, str(error))
            return NONE
        columns = [self._file(found, f"{name}_{i}", field, where) for i in range(1, count + 1)]
        return self._stacked(columns, where).T.copy() if columns else NONE

    def _file(self, found: Any, name: str, field: Field | None, where: str) -> Floats:
        if not isinstance(found, str | Path):
            self.mistakes.add(where, f'expected the name of a csv file, found {show(found)}; write e.g. "points.csv"')
            return NONE
        try:
            path = self._path(found)
            cells = axes.read_column(path, name)
        except ValueError as error:
            self.mistakes.add(where, str(error))
            return NONE
        if len(cells) > axes.LARGEST_AXIS:
            self.mistakes.add(where, f"expected at most {axes.LARGEST_AXIS} values, found more")
            return NONE
        texts = [text for _, text in cells]
        return self._numbers(
            texts, lambda text: _csv_number(text, field), lambda i: (where, f"{path}, line {cells[i][0]}: ")
        )

    def _path(self, found: str | Path) -> Path:
        """A text names a file in the study's folder or below; a `Path`, which a file cannot hold, any. ValueError."""
        path = self.folder / found
        try:
            path.exists()
            inside = path.resolve().is_relative_to(self.folder.resolve())
        except (OSError, RuntimeError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise ValueError(f"{show(found)} cannot be read: {reason}") from None
        if isinstance(found, str) and not inside:
            raise ValueError(f"{show(found)} cannot be read: it is outside of the study's folder; put a copy beside it")
        return path

    def _allowed_length(self, length: int, where: str) -> bool:
        if length == 0:
            self.mistakes.add(where, "has no values; give at least one")
        if length > axes.LARGEST_AXIS:
            self.mistakes.add(where, f"expected at most {axes.LARGEST_AXIS} values, found {length}")
        return 0 < length <= axes.LARGEST_AXIS

    def _numbers(
        self, items: Sequence[Any], read: Callable[[Any], float], place: Callable[[int], tuple[str, str]]
    ) -> Floats:
        """Every item read; none if one is bad. `place` says where an item stands, and how its message begins."""
        values, bad = np.empty(len(items)), 0
        for i, item in enumerate(items):
            try:
                values[i] = read(item)
            except ValueError as error:
                bad += 1
                if bad <= MOST_BAD_VALUES:
                    where, beginning = place(i)
                    self.mistakes.add(where, f"{beginning}{error}")
        if bad > MOST_BAD_VALUES:
            self.mistakes.add(where, f"and {bad - MOST_BAD_VALUES} more like these")
        return NONE if bad else values


def _entry(table: Mapping[str, Any]) -> dict[str, Any]:
    """What a study says of an axis that it does not list: words as they are, numbers as float64."""
    kinds: dict[str, Callable[[Any], Any]] = {"spacing": str, "unit": str, "num": int, "start": float, "stop": float}
    return {key: kinds[key](value) for key, value in table.items() if key in kinds}


def _number(found: Any, field: Field | None) -> float:
    """Number of a word or of a TOML value. Raises ValueError with the text for the user."""
    if field is None and isinstance(found, str | list | tuple):
        return math.nan
    return _choice(found, field) if field and field.choices else exact_float(found)


def _csv_number(found: str, field: Field | None) -> float:
    if field and field.choices:
        return _choice(found, field)
    if "_" not in found:  # 1_0 is 10 in Python alone
        with contextlib.suppress(ValueError):
            return float(found)
    if field is None:
        return math.nan
    raise ValueError(f"expected a number, found {show(found)}")


def _choice(found: Any, field: Field) -> float:
    if isinstance(found, str) and found in field.choices:
        return float(field.choices[found])
    raise ValueError(
        f"expected {listed(field.choices, quote=True)}, found {show(found)}{did_you_mean(found, field.choices)}"
    )


def _words(values: Floats, field: Field | None) -> tuple[str, ...] | None:
    if field is None or not field.choices:
        return None
    words = {float(number): word for word, number in field.choices.items()}
    return tuple(words[value] for value in values.tolist())
