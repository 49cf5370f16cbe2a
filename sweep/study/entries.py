"""One entry of a study: a quantity, or the values of an axis or coordinate, brought to the unit of its field."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from kernels.interface import Field
from sweep.study.mistakes import Mistakes, exact_float, one_of, show
from sweep.study.model import Axis, frozen
from sweep.study.spacing import LARGEST_AXIS, SPACINGS, Floats, read_columns, scaled, spaced, spread
from sweep.study.units import scale
from sweep.words import listed, quoted

FORMS = ("spacing", "values", "file")
"""An axis is given in one of these forms."""
SPACING_KEYS = ("start", "stop", "num")
ENTRY: dict[str, Callable[[Any], Any]] = {"spacing": str, "unit": str, "num": int, "start": float, "stop": float}
"""What a study keeps of an axis that it does not list: words as they are, numbers as float64."""

EXAMPLE = '{ spacing = "log", start = 0.1, stop = 10, num = 21 }'
SAMPLED_EXAMPLE = '{ spacing = "log", start = 0.1, stop = 10 }'
MOST_BAD_VALUES = 3
"""Bad values reported of one list."""
NONE: Floats = np.empty(0)
"""Values of an axis that has a mistake."""


@dataclass
class Entries:
    """Reads the entries of one study, each for a field of the kernel.

    What is wrong goes to `mistakes`, and NaN or no values come back. Files are named relative to `folder`.
    """

    mistakes: Mistakes
    folder: Path

    def quantity(self, entry: Any, field: Field, where: str) -> float | Floats:
        """A number, a table { value, unit }, or a word of the field, as the number in the kernel's column.

        Of an array parameter also a list, or a table { file, unit }; one number stands for all its values.
        """
        array, factor, at = bool(field.dims), None, where
        if isinstance(entry, Mapping):
            forms = ("value", "file") if array else ("value",)
            table = self.mistakes.keys(entry, (*forms, "unit"), where)
            factor = self._factor(table, field, where)
            if "file" in table and "file" in forms:
                if "value" in table:
                    self.mistakes.add(where, "value and file exclude each other; keep one")
                return frozen(scaled(self._file(table, field, where), factor))
            entry, at = table.get("value"), f"{where}.value"
        if array and hasattr(entry, "__array__"):
            entry = np.asarray(entry).tolist()
        if not isinstance(entry, list | tuple):
            values = self._numbers([entry], field, lambda _: (at, ""))
            return float(scaled(values, factor)[0]) if len(values) else math.nan
        if array:
            return frozen(scaled(self._list(entry, field, at), factor))
        self.mistakes.add(at, f"expected a number, found a list; to sweep it, write it under [axes.{field.name}]")
        return math.nan

    def axis(self, name: str, given: Any, field: Field, where: str, shares: Floats | None = None) -> Axis:
        """An axis or coordinate: a list of values, or a table with `spacing`, `values` or `file`.

        Of an array parameter a list of lists, or a csv file with a column for each value: J_1, J_2, ... Of a sampled
        design a table with spacing, start and stop, between which the values lie at `shares` of the way.
        """
        mistakes, before, array = self.mistakes, len(self.mistakes), bool(field.dims)
        table, at = (given, f"{where}.values") if isinstance(given, Mapping) else ({"values": given}, where)
        allowed = (*FORMS, *SPACING_KEYS) if shares is None else ("spacing", "start", "stop")
        table = mistakes.keys(table, (*allowed, "unit"), where)
        forms = [form for form in FORMS if form in table] if shares is None else ["spacing"]
        if len(forms) > 1:
            mistakes.add(where, f"{listed(forms, word='and')} exclude each other; keep one")
        elif not forms and len(mistakes) == before:
            cure = 'spacing = "linear" or "log"' if set(table) & set(SPACING_KEYS) else EXAMPLE
            mistakes.add(where, f"has neither spacing, values nor file; write {cure}")
        form = forms[0] if len(forms) == 1 else ""
        for key in (key for key in SPACING_KEYS if key in table and form in ("values", "file")):
            mistakes.add(f"{where}.{key}", f"does not go with {form}; leave it out")
        factor, values, kind = self._factor(table, field, where), NONE, form
        if shares is not None and (array or field.integer):
            kind = "an array" if array else "a whole number"
            mistakes.add(where, f"{name} is {kind}, which is not sampled; sweep it in a block of its own")
        elif form == "spacing" and array:
            mistakes.add(f"{where}.spacing", f"{name} has a value for each {field.dims[0]}; give values or a file")
        elif form == "spacing":
            values, kind = self._spaced(table, field, where, factor, shares), str(table.get("spacing"))
        elif form == "values":
            values = scaled((self._rows if array else self._list)(table["values"], field, at), factor)
        elif form == "file":
            values = scaled(self._file(table, field, where, numbered=array), factor)
        words = {float(number): word for word, number in field.choices.items()}
        entry = None
        if form == "spacing" and len(values):
            entry = {key: ENTRY[key](value) for key, value in table.items() if key in ENTRY}
        said = tuple(words[value] for value in values.tolist()) if words else None
        return Axis(name, frozen(values), kind, said, entry)

    def _factor(self, table: Mapping[str, Any], field: Field, where: str) -> Decimal | None:
        """What the numbers of an entry are multiplied by, to be in the field's unit."""
        if "unit" not in table:
            return None
        unit, at = self.mistakes.text(table["unit"], f"{where}.unit"), f"{where}.unit"
        if not isinstance(table["unit"], str):
            return None
        if field.choices:
            self.mistakes.add(at, f"{field.name} takes words, which have no unit; leave it out")
            return None
        return self.mistakes.tried(at, lambda: scale(unit, field.unit, field.name), None)

    def _spaced(
        self, table: Mapping[str, Any], field: Field, where: str, factor: Decimal | None, shares: Floats | None
    ) -> Floats:
        """Values between start and stop: `num` of them, or at the shares of a sampled design."""
        mistakes, before, spacing, num = self.mistakes, len(self.mistakes), None, 2
        if field.choices:
            mistakes.add(where, f"{field.name} takes words; write e.g. values = [{quoted(field.choices)}]")
        elif "spacing" not in table:
            mistakes.add(f"{where}.spacing", 'missing; write spacing = "linear" or "log"')
        else:
            spacing = mistakes.word(table["spacing"], f"{where}.spacing", SPACINGS)
        ends, example = [], EXAMPLE if shares is None else SAMPLED_EXAMPLE
        for key, default in (("start", 1), ("stop", 2)):
            if key not in table:
                mistakes.add(f"{where}.{key}", f"missing; write e.g. {example}")
            ends.append(mistakes.finite(table.get(key, default), f"{where}.{key}"))
            if spacing == "log" and ends[-1] <= 0:
                mistakes.add(f"{where}.{key}", f"a log axis needs {key} > 0, found {ends[-1]:g}")
        start, stop = ends
        if shares is None:
            cure = "; for a single value write values = [...]"
            num = mistakes.whole(table.get("num", 2), f"{where}.num", 2, LARGEST_AXIS, cure)
            if "num" not in table:
                mistakes.add(f"{where}.num", f"missing; write e.g. {EXAMPLE}")
            if start == stop and len(mistakes) == before:
                mistakes.add(f"{where}.stop", f"equals start; for a single value write values = [{start:g}]")
        if spacing is None or len(mistakes) > before:
            return NONE
        if shares is None:
            values = spaced(spacing, start, stop, num, factor)
        else:
            values = spread(spacing, start, stop, shares, factor)
        if not np.isfinite(values).all() or (spacing == "log" and not values.all()):
            text = f"{start:g} to {stop:g} leaves the range of float64 once converted to the kernel's unit"
            mistakes.add(where, text)
            return NONE
        return values

    def _list(self, found: Any, field: Field, where: str) -> Floats:
        """A list of numbers or words."""
        if hasattr(found, "__array__"):
            found = np.asarray(found)
            if found.ndim != 1 or found.dtype != np.float64 or field.choices:
                found = found.tolist()
        if isinstance(found, str | bytes) or not isinstance(found, Sequence | np.ndarray):
            self.mistakes.add(where, f"expected a list, found {show(found)}; write e.g. [1.0, 2.0]")
            return NONE
        if not self._allowed_length(len(found), where):
            return NONE
        if not isinstance(found, np.ndarray) and all(type(item) is float for item in found):
            found = np.array(found) if not field.choices else found
        return found if isinstance(found, np.ndarray) else self._numbers(found, field, lambda i: (f"{where}[{i}]", ""))

    def _rows(self, found: Any, field: Field, where: str) -> Floats:
        """A list of lists of equal length: a row for each value of the axis."""
        if hasattr(found, "__array__"):
            found = list(map(np.asarray, found)) if np.ndim(found) == 2 else np.asarray(found).tolist()
        if not isinstance(found, list | tuple) or not all(isinstance(row, list | tuple | np.ndarray) for row in found):
            self.mistakes.add(where, "expected a list of lists, one for each cell; write e.g. [[1.0, 2.0], [1.5, 2.0]]")
            return NONE
        if not self._allowed_length(len(found), where):
            return NONE
        rows = [self._list(row, field, f"{where}[{i}]") for i, row in enumerate(found)]
        lengths = sorted({len(row) for row in rows})
        if len(lengths) > 1 and lengths[0]:
            self.mistakes.add(where, f"expected lists of equal length, found {lengths[0]} and {lengths[-1]} values")
        return np.array(rows) if len(lengths) == 1 and lengths[0] else NONE

    def _file(self, table: Mapping[str, Any], field: Field, where: str, numbered: bool = False) -> Floats:
        """A column of a csv file, or those that are `numbered`: a row for each value of the axis."""
        found, where = table["file"], f"{where}.file"
        if not isinstance(found, str | Path):
            self.mistakes.add(where, f'expected the name of a csv file, found {show(found)}; write e.g. "points.csv"')
            return NONE
        path = self.folder / found
        name = field.name
        cells = self.mistakes.tried(where, lambda: read_columns(self._allowed(path, found), name, numbered), None)
        if cells is None:
            return NONE
        width = len(cells[0][1])
        texts = [text for _, row in cells for text in row]
        values = self._numbers(
            texts, field, lambda i: (where, f"{path}, line {cells[i // width][0]}: "), from_file=True
        )
        return values.reshape(-1, width) if numbered and len(values) else values

    def _allowed(self, path: Path, found: str | Path) -> Path:
        """A text names a file in the study's folder or below; a `Path`, which a file cannot hold, any. ValueError."""
        try:
            path.exists()
            inside = path.resolve().is_relative_to(self.folder.resolve())
        except (OSError, RuntimeError, ValueError) as error:
            raise ValueError(f"{show(found)} cannot be read: {getattr(error, 'strerror', None) or error}") from None
        if isinstance(found, str) and not inside:
            raise ValueError(f"{show(found)} cannot be read: it is outside of the study's folder; put a copy beside it")
        return path

    def _allowed_length(self, length: int, where: str) -> bool:
        if length == 0:
            self.mistakes.add(where, "has no values; give at least one")
        if length > LARGEST_AXIS:
            self.mistakes.add(where, f"expected at most {LARGEST_AXIS} values, found {length}")
        return 0 < length <= LARGEST_AXIS

    def _numbers(
        self,
        items: Sequence[Any],
        field: Field,
        place: Callable[[int], tuple[str, str]],
        from_file: bool = False,
    ) -> Floats:
        """Every item read; none if one is bad. `place` says where an item stands, and how its message begins."""
        values, bad = np.empty(len(items)), 0
        for i, item in enumerate(items):
            try:
                values[i] = _number(item, field, from_file)
            except ValueError as error:
                bad += 1
                if bad <= MOST_BAD_VALUES:
                    where, beginning = place(i)
                    self.mistakes.add(where, f"{beginning}{error}")
        if bad > MOST_BAD_VALUES:
            self.mistakes.add(where, f"and {bad - MOST_BAD_VALUES} more like these")
        return NONE if bad else values


def _number(found: Any, field: Field, from_file: bool) -> float:
    """Number of a word, of a TOML value, or of a text of a csv file. Raises ValueError with the text for the user."""
    if field.choices:
        return float(field.choices[one_of(found, list(field.choices))])
    if from_file:
        try:
            return float(found if "_" not in found else "")  # 1_0 is 10 in Python alone
        except ValueError:
            raise ValueError(f"expected a number, found {show(found)}") from None
    return exact_float(found)
