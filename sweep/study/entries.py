"""One entry of a study: a quantity, or the values of an axis or coordinate, brought to the unit of its field.

What is wrong goes to the entry's mistakes, and NaN or no values come back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from kernels.interface import Field
from sweep.errors import Mistake
from sweep.study.mistakes import Entry, exact_float, finite, limits, one_of, show, text, whole
from sweep.study.model import Axis, frozen
from sweep.study.spacing import LARGEST_AXIS, MOST_BAD_VALUES, SPACINGS, Floats, read_columns, scaled, spaced
from sweep.study.units import scale
from sweep.words import listed, quoted

KEPT: dict[str, Callable[[Any], Any]] = {"spacing": str, "unit": str, "num": int, "start": float, "stop": float}
"""What a study keeps of an axis that it does not list: words as they are, numbers as float64."""
ENDS = ("start", "stop", "num")
SAMPLED_EXAMPLE = '{ spacing = "log", start = 0.1, stop = 10 }'
EXAMPLE = '{ spacing = "log", start = 0.1, stop = 10, num = 21 }'
NONE: Floats = np.empty(0)
"""Values of an axis that has a mistake."""


def quantity(entry: Entry, field: Field) -> float | Floats:
    """A number, a table { value, unit }, or a word of the field, as the number in the kernel's column.

    Of an array parameter also a list, or a table { file, unit }; one number stands for all its values.
    """
    array, given, factor = bool(field.dims), entry, None
    if isinstance(entry.value, Mapping):
        entry = entry.keys("value", "file", "unit") if array else entry.keys("value", "unit")
        given, factor = entry["value"], _factor(entry, field)
        if array and "file" in entry:
            if "value" in entry:
                entry.wrong("value and file exclude each other; keep one")
            return frozen(scaled(_columns(entry["file"], field, numbered=False), factor))
    if array and isinstance(given.value, list | tuple | np.ndarray):
        return frozen(scaled(_list(given, field), factor))
    if isinstance(given.value, list | tuple):
        given.wrong(f"expected a number, found a list; to sweep it, write it under [axes.{field.name}]")
        return math.nan
    return float(scaled(np.array([given.read(math.nan, _number, field)]), factor)[0])


def axis(entry: Entry, field: Field, shares: Floats | None = None) -> Axis:
    """An axis or coordinate: a list of values, or a table with `spacing`, `values` or `file`.

    Of an array parameter a list of lists, or a csv file with a column for each value: J_1, J_2, ... Of a sampled
    design a table with spacing, start and stop, between which the values lie at `shares` of the way.
    """
    array, before, listing = bool(field.dims), len(entry.mistakes), entry
    forms, ends = (["spacing", "values", "file"], ENDS) if shares is None else (["spacing"], ENDS[:2])
    if isinstance(entry.value, Mapping):
        entry = entry.keys(*forms, *ends, "unit")
        listing, forms = entry["values"], [form for form in forms if form in entry or shares is not None]
    else:
        entry, forms = replace(entry, value={}), ["values"]
    unclear = not forms and len(entry.mistakes) == before
    form, factor, values = forms[0] if len(forms) == 1 else "", _factor(entry, field), NONE
    if len(forms) > 1:
        entry.wrong(f"{listed(forms, word='and')} exclude each other; keep one")
    elif unclear:
        cure = 'spacing = "linear" or "log"' if set(entry.value) & set(ends) else EXAMPLE
        entry.wrong(f"has neither spacing, values nor file; write {cure}")
    elif shares is not None and (array or field.integer):
        kind = "an array" if array else "a whole number"
        entry.wrong(f"{field.name} is {kind}, which is not sampled; sweep it in a block of its own")
    elif form == "spacing" and array:
        entry["spacing"].wrong(f"{field.name} has a value for each {field.dims[0]}; give values or a file")
    elif form == "spacing":
        values = _spaced(entry, field, factor, shares)
    elif form == "values":
        values = scaled((_rows if array else _list)(listing, field), factor)
    elif form == "file":
        values = scaled(_columns(entry["file"], field, numbered=array), factor)
    for key in (key for key in ends if key in entry and form in ("values", "file")):
        entry[key].wrong(f"does not go with {form}; leave it out")
    if form == "spacing" and len(values):
        kept = {key: KEPT[key](value) for key, value in entry.value.items() if key in KEPT}
        return Axis(field.name, frozen(values), kept["spacing"], None, kept)
    words = {float(number): word for word, number in field.choices.items()}
    return Axis(field.name, frozen(values), form, tuple(words[v] for v in values.tolist()) if words else None)


def _factor(entry: Entry, field: Field) -> Decimal | None:
    """What the numbers of an entry are multiplied by, to be in the field's unit."""

    def factor(value: Any) -> Decimal | None:
        unit = text(value)
        if field.choices:
            raise ValueError(f"{field.name} takes words, which have no unit; leave it out")
        return scale(unit, field.unit, field.name)

    return entry["unit"].read(None, factor) if "unit" in entry else None


def _spaced(entry: Entry, field: Field, factor: Decimal | None, shares: Floats | None) -> Floats:
    """Values between start and stop: `num` of them, or at the shares of a sampled design."""
    before, spacing, found = len(entry.mistakes), None, {"start": 1.0, "stop": 2.0, "num": math.inf}
    if field.choices:
        entry.wrong(f"{field.name} takes words; write e.g. values = [{quoted(field.choices)}]")
    elif "spacing" in entry:
        spacing = entry["spacing"].read(None, one_of, SPACINGS)
    else:
        entry["spacing"].wrong('missing; write spacing = "linear" or "log"')
    for key in ENDS if shares is None else ENDS[:2]:
        if key not in entry:
            entry[key].wrong(f"missing; write e.g. {EXAMPLE if shares is None else SAMPLED_EXAMPLE}")
        elif key == "num":
            cure = "; for a single value write values = [...]"
            found[key] = entry[key].read(math.nan, whole, 2, LARGEST_AXIS, cure)
        else:
            found[key] = entry[key].read(math.nan, finite)
            if spacing == "log" and found[key] <= 0:
                entry[key].wrong(f"a log axis needs {key} > 0, found {found[key]:g}")
    start, stop, num = found.values()
    if shares is None and start == stop and len(entry.mistakes) == before:
        entry["stop"].wrong(f"equals start; for a single value write values = [{start:g}]")
    if spacing is None or len(entry.mistakes) > before:
        return NONE
    values = spaced(spacing, start, stop, int(num) if shares is None else shares, factor)
    if np.isfinite(values).all() and (spacing == "linear" or values.all()):
        return values
    entry.wrong(f"{start:g} to {stop:g} leaves the range of float64 once converted to the kernel's unit")
    return NONE


def _list(entry: Entry, field: Field) -> Floats:
    """A list of numbers or words; none of them if one is bad."""
    found, bad = entry.value, list[Mistake]()
    if isinstance(found, str | bytes) or not isinstance(found, Sequence | np.ndarray):
        entry.wrong(f"expected a list, found {show(found)}; write e.g. [1.0, 2.0]")
        return NONE
    if not _allowed_length(entry):
        return NONE
    if not field.choices and (isinstance(found, np.ndarray) or all(type(item) is float for item in found)):
        return np.asarray(found)
    values = np.empty(len(found))
    for i, item in enumerate(found):
        try:
            values[i] = _number(item, field)
        except ValueError as error:
            bad.append(Mistake(f"{entry.where}[{i}]", str(error)))
    entry.mistakes.extend(bad[:MOST_BAD_VALUES])
    if len(bad) > MOST_BAD_VALUES:
        entry.wrong(f"and {len(bad) - MOST_BAD_VALUES} more like these")
    return NONE if bad else values


def _rows(entry: Entry, field: Field) -> Floats:
    """A list of lists of equal length: a row for each value of the axis."""
    found = entry.value
    if not isinstance(found, list | tuple) or not all(isinstance(row, list | tuple | np.ndarray) for row in found):
        entry.wrong("expected a list of lists, one for each cell; write e.g. [[1.0, 2.0], [1.5, 2.0]]")
        return NONE
    rows = [_list(entry[i], field) for i in range(len(found))] if _allowed_length(entry) else []
    lengths = sorted({len(row) for row in rows})
    if len(lengths) > 1 and lengths[0]:
        entry.wrong(f"expected lists of equal length, found {lengths[0]} and {lengths[-1]} values")
    return np.array(rows) if len(lengths) == 1 and lengths[0] else NONE


def _allowed_length(entry: Entry) -> bool:
    length = len(entry.value)
    if not 0 < length <= LARGEST_AXIS:
        entry.wrong(
            f"expected at most {LARGEST_AXIS} values, found {length}" if length else "has no values; give at least one"
        )
    return 0 < length <= LARGEST_AXIS


def _columns(entry: Entry, field: Field, numbered: bool) -> Floats:
    """A column of a csv file, or those that are `numbered`: a row for each value of the axis.

    A text names a file in the study's folder or below; a `Path`, which a study file cannot hold, any.
    """

    def number(text: str) -> float:
        try:
            return _number(text, field) if field.choices else float("" if "_" in text else text)  # 1_0 is Python's
        except ValueError:
            raise ValueError(f"expected {limits(field) if field.choices else 'a number'}, found {show(text)}") from None

    def columns(name: Any) -> Floats:
        if not isinstance(name, str | Path):
            raise ValueError(f'expected the name of a csv file, found {show(name)}; write e.g. "points.csv"')
        try:
            inside = (entry.folder / name).resolve().is_relative_to(entry.folder.resolve())
        except (OSError, RuntimeError, ValueError) as error:
            raise ValueError(f"{show(name)} cannot be read: {getattr(error, 'strerror', None) or error}") from None
        if isinstance(name, str) and not inside:
            raise ValueError(f"{show(name)} cannot be read: it is outside of the study's folder; put a copy beside it")
        return read_columns(entry.folder / name, field.name, numbered, number)

    return entry.read(NONE, columns)


def _number(found: Any, field: Field) -> float:
    """The number of a field's word, or of a number. Raises ValueError with the text for the user."""
    return float(field.choices[one_of(found, field.choices)]) if field.choices else exact_float(found)
