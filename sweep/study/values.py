"""Converts quantities, and values of axes and coordinates, to the unit of their field.

Spacing and units are computed in decimals of 50 digits and rounded once, so that a value is the float64 nearest to
the study's text (0.3, 0.001, the endpoints), on every machine. Mistakes are added to the entry; NaN or no values are
then returned.
"""

from __future__ import annotations

import csv
import itertools
import math
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Context, Decimal, localcontext
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels.interface import Field
from sweep.errors import Mistake, reason
from sweep.study.mistakes import Entry, exact_float, finite, limits, one_of, show, text, whole
from sweep.study.model import Axis, frozen
from sweep.units import scale
from sweep.words import listed, quoted

LARGEST_AXIS = 10_000_000
DIGITS = Context(prec=50)
MOST_BAD_VALUES = 3
"""Largest number of bad values reported for one list or file."""
KEPT: dict[str, Callable[[Any], Any]] = {"spacing": str, "unit": str, "num": int, "start": float, "stop": float}
"""Values of an axis that a study does not list: words unchanged, numbers as float64."""
ENDS = ("start", "stop", "num")
SAMPLED_EXAMPLE = '{ spacing = "log", start = 0.1, stop = 10 }'
EXAMPLE = '{ spacing = "log", start = 0.1, stop = 10, num = 21 }'
Floats = NDArray[np.float64]
NONE: Floats = np.empty(0)
"""Values of an axis that has a mistake."""


def quantity(entry: Entry, field: Field) -> float | Floats:
    """A number, a table { value, unit }, or a word of the field, as the number in the kernel's column.

    Of an array parameter also a list, or a table { file, unit }; one number stands for all its values.
    """
    array, given, factor = bool(field.dims), entry, _own_factor(entry, field)
    if isinstance(entry.value, Mapping):
        entry = entry.keys("value", "unit", *["file"] * array)
        given = entry["value"]
        factor = _factor(entry, field, given)
        if array and "file" in entry:
            if "value" in entry:
                entry.wrong("value and file exclude each other; keep one")
            return frozen(_scaled(entry["file"].read(NONE, _columns, entry.folder, field, False), factor))
    if isinstance(given.value, list | tuple | np.ndarray):
        if array:
            return frozen(_scaled(_list(given, field), factor))
        given.wrong(f"expected a number, found a list; to sweep it, write it under [axes.{field.name}]")
        return math.nan
    return float(_scaled(np.array([given.read(math.nan, _number, field)]), factor)[0])


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
    form, factor, values = forms[0] if len(forms) == 1 else "", _factor(entry, field, listing), NONE
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
        values = _scaled(_list(listing, field, array), factor)
    elif form == "file":
        values = _scaled(entry["file"].read(NONE, _columns, entry.folder, field, array), factor)
    for key in (key for key in ends if key in entry and form in ("values", "file")):
        entry[key].wrong(f"cannot be combined with {form}; leave it out")
    if form == "spacing" and len(values):
        kept = {key: KEPT[key](value) for key, value in entry.value.items() if key in KEPT}
        return Axis(field.name, frozen(values), kept["spacing"], None, kept)
    words = {float(number): word for word, number in field.choices.items()}
    return Axis(field.name, frozen(values), form, tuple(words[v] for v in values.tolist()) if words else None)


def _own_factor(given: Entry, field: Field) -> Decimal | None:
    """What numbers that have a unit themselves are multiplied by, to be in the field's; None: they are in it."""
    return replace(given, value=given.unit).read(None, scale, field.unit, field.name) if given.unit else None


def _factor(entry: Entry, field: Field, given: Entry) -> Decimal | None:
    """What the numbers `given` in an entry are multiplied by, to be in the field's unit; None: they are in it."""
    if given.unit and not field.choices:
        if "unit" in entry:
            entry["unit"].wrong(f'the numbers have the unit "{given.unit}" themselves; leave it out')
        return _own_factor(given, field)

    def factor(value: Any) -> Decimal | None:
        unit = text(value)
        if field.choices:
            raise ValueError(f"{field.name} takes words, which have no unit; leave it out")
        return scale(unit, field.unit, field.name)

    return entry.get("unit", None, factor)


def _scaled(values: Floats, factor: Decimal | None) -> Floats:
    """`values` times `factor`, each rounded once."""
    if factor is None:
        return values
    with localcontext(DIGITS):
        return np.array([float(_decimal(v) * factor) for v in values.ravel().tolist()]).reshape(values.shape)


def _decimal(value: float) -> Decimal:
    """The shortest decimal that is this float64: what the user wrote."""
    return Decimal(repr(value))


def _spaced(entry: Entry, field: Field, factor: Decimal | None, shares: Floats | None) -> Floats:
    """Values between start and stop, with equal differences or ratios: `num`, or at the shares of a sampled design."""
    before, spacing, found = len(entry.mistakes), None, {"start": 1.0, "stop": 2.0, "num": math.inf}
    if field.choices:
        entry.wrong(f"{field.name} takes words; write e.g. values = [{quoted(field.choices)}]")
    elif "spacing" in entry:
        spacing = entry["spacing"].read(None, one_of, ("linear", "log"))
    else:
        entry["spacing"].wrong('missing; write spacing = "linear" or "log"')
    for key in ENDS if shares is None else ENDS[:2]:
        if key not in entry:
            entry[key].wrong(f"missing; write e.g. {EXAMPLE if shares is None else SAMPLED_EXAMPLE}")
        elif key == "num":
            cure = "; for a single value write values = [...]"
            found[key] = entry[key].read(math.nan, whole, 2, LARGEST_AXIS, cure)
        elif (own := entry[key].unit) and (own != field.unit or "unit" in entry):
            entry[key].wrong(f'has the unit "{own}" itself; give a number, and write unit = "{own}" beside it')
        else:
            found[key] = entry[key].read(math.nan, finite)
            if spacing == "log" and found[key] <= 0:
                entry[key].wrong(f"a log axis needs {key} > 0, found {found[key]:g}")
    start, stop, num = found.values()
    if shares is None and start == stop and len(entry.mistakes) == before:
        entry["stop"].wrong(f"equals start; for a single value write values = [{start:g}]")
    if spacing is None or len(entry.mistakes) > before:
        return NONE
    exact: Iterable[Decimal | float]
    with localcontext(DIGITS):
        first, last = (_decimal(end) * (factor or 1) for end in (start, stop))
        ends = float(first), float(last)
        if not all(math.isfinite(end) and (end or spacing == "linear") for end in ends):
            entry.wrong(f"{start:g} to {stop:g} leaves the range of float64 once converted to the kernel's unit")
            return NONE
        steps = 0 if shares is not None else int(num) - 1
        if shares is not None and spacing == "linear":
            exact = (first + (last - first) * Decimal(share) for share in shares.tolist())
        elif shares is not None:
            logarithm = (last / first).ln()
            exact = (first * (Decimal(share) * logarithm).exp() for share in shares.tolist())
        elif spacing == "linear":
            # whole numbers over a common denominator, a division of which is rounded once
            low, high = Fraction(first), Fraction(last)
            denominator = math.lcm(low.denominator, high.denominator)
            begin, step, below = int(low * denominator) * steps, int((high - low) * denominator), denominator * steps
            exact = ((begin + step * i) / below for i in range(steps + 1))
        else:
            ratios = itertools.repeat((last / first) ** (1 / Decimal(steps)), steps - 1)
            exact = itertools.chain(itertools.accumulate(ratios, operator.mul, initial=first), [last])
        return np.fromiter(map(float, exact), np.float64)


def _list(entry: Entry, field: Field, rows: bool = False) -> Floats:
    """A list of numbers or words, or of `rows` of equal length, one for each value; nothing if one is bad."""
    found, bad = entry.value, list[Mistake]()
    if isinstance(found, str | bytes) or not isinstance(found, Sequence | np.ndarray):
        entry.wrong(f"expected a list, found {show(found)}; write e.g. [1.0, 2.0]")
        return NONE
    if not 0 < len(found) <= LARGEST_AXIS:
        many = f"expected at most {LARGEST_AXIS} values, found {len(found)}"
        entry.wrong(many if len(found) else "has no values; give at least one")
        return NONE
    if rows and not all(isinstance(row, list | tuple | np.ndarray) for row in found):
        entry.wrong("expected a list of lists, one for each cell; write e.g. [[1.0, 2.0], [1.5, 2.0]]")
        return NONE
    if rows:
        lists = [_list(entry[i], field) for i in range(len(found))]
        lengths = sorted({len(row) for row in lists})
        if len(lengths) > 1 and lengths[0]:
            entry.wrong(f"expected lists of equal length, found {lengths[0]} and {lengths[-1]} values")
        return np.array(lists) if len(lengths) == 1 and lengths[0] else NONE
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


def _columns(file: Any, folder: Path, field: Field, numbered: bool) -> Floats:
    """Numbers of a csv file: of the column of the field's name, or the only one; `numbered`: of name_1, name_2, ...

    A text names a file in the study's folder or below; a `Path`, which a study file cannot hold, any. Empty lines and
    lines that start with "#" are left out. Raises ValueError with the text for the user.
    """
    if not isinstance(file, str | Path) or "\0" in str(file):
        raise ValueError(f'expected the name of a csv file, found {show(file)}; write e.g. "points.csv"')
    path, name, values, bad = folder / file, field.name, list[list[float]](), list[str]()
    try:
        if isinstance(file, str) and not path.resolve().is_relative_to(folder.resolve()):
            raise OSError(None, "it is outside of the study's folder; put a copy beside it")
        if path.exists() and not path.is_file():
            raise OSError(None, "it is no regular file")
        with path.open(newline="", encoding="utf-8-sig") as lines:
            # a comment becomes an empty line before csv sees it, since a quotation mark in it would open a field
            reader = csv.reader(("\n" if line.startswith("#") else line for line in lines), skipinitialspace=True)
            stripped = ([cell.strip() for cell in row] for row in reader)
            rows: Iterator[list[str]] = (row for row in stripped if any(row))
            headings = next(rows, [])
            names = [f"{name}_{i + 1}" for i in range(len(headings))] if numbered else [name]
            places = [headings.index(n) for n in itertools.takewhile(headings.__contains__, names)]
            if any(headings.count(n) > 1 for n in names):
                raise ValueError(f"{path} has two columns of one name; its first line is {','.join(headings)[:60]}")
            if not places and (numbered or len(headings) > 1):
                columns = f"columns {name}_1, {name}_2, ..." if numbered else f'column "{name}"'
                raise ValueError(f"{path} has no {columns}; its first line is {','.join(headings)[:60]}")
            if headings and not places:  # a column of numbers alone
                rows, places = itertools.chain([headings], rows), [0]
            # one value too many suffices to know that there are too many
            for row in itertools.islice(rows, LARGEST_AXIS + 1):
                line = f"line {reader.line_num}: "
                if len(row) != len(headings):
                    raise ValueError(f"{path}, {line}expected {len(headings)} columns, found {len(row)}")
                try:
                    values.append([_written(row[place], field) for place in places])
                except ValueError as error:
                    bad.append(f"{line}{error}")
    except (OSError, RuntimeError) as error:  # a link to itself is a RuntimeError
        raise ValueError(f"{path} cannot be read: {reason(error)}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path} is not a csv file: {error}") from None
    if bad:
        more = "; and more like these" * (len(bad) > MOST_BAD_VALUES)
        raise ValueError(f"{path}, {'; '.join(bad[:MOST_BAD_VALUES])}{more}")
    if not 0 < len(values) <= LARGEST_AXIS:
        raise ValueError(f"expected at most {LARGEST_AXIS} values, found more" if values else f"{path} holds no values")
    return np.array(values) if numbered else np.array(values)[:, 0]


def _written(found: str, field: Field) -> float:
    """The number of a text in a csv file."""
    try:
        return _number(found, field) if field.choices else float("" if "_" in found else found)  # 1_0 is Python's
    except ValueError:
        raise ValueError(f"expected {limits(field) if field.choices else 'a number'}, found {show(found)}") from None


def _number(found: Any, field: Field) -> float:
    """The number of a field's word, or of a number. Raises ValueError with the text for the user."""
    return float(field.choices[one_of(found, field.choices)]) if field.choices else exact_float(found)
