"""The values of one axis: evenly or geometrically spaced, listed, or from a file.

Spacing and units are computed in decimals of 50 digits and rounded once, so that a value is the float64 nearest to
what the study says (0.3, 0.001, the endpoints), on every machine.
"""

from __future__ import annotations

import csv
import itertools
from collections.abc import Iterator
from decimal import Context, Decimal, localcontext
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

LARGEST_AXIS = 10_000_000
LONGEST_LINE = 1_000_000
"""Characters of a line of a csv file."""
DIGITS = Context(prec=50)


def linear(start: float, stop: float, num: int, factor: Decimal | None = None) -> NDArray[np.float64]:
    """`num` >= 2 values from `start` to `stop`, both included, times `factor`."""

    def values() -> Iterator[float]:
        first, last, scale = _decimal(start), _decimal(stop), factor or Decimal(1)
        for i in range(num):
            yield float((first * (num - 1 - i) + last * i) / (num - 1) * scale)

    return _collect(values(), num)


def logarithmic(start: float, stop: float, num: int, factor: Decimal | None = None) -> NDArray[np.float64]:
    """`num` >= 2 values in equal ratios from `start` > 0 to `stop` > 0, both included, times `factor`."""

    def values() -> Iterator[float]:
        value, last = _decimal(start) * (factor or 1), _decimal(stop) * (factor or 1)
        ratio = (last / value) ** (1 / Decimal(num - 1))
        for _ in range(num - 1):
            yield float(value)
            value *= ratio
        yield float(last)

    return _collect(values(), num)


def spread(
    spacing: str, start: float, stop: float, shares: NDArray[np.float64], factor: Decimal | None = None
) -> NDArray[np.float64]:
    """The values at `shares` of the way from `start` to `stop`, "linear" or "log" > 0, times `factor`.

    In decimals like the others, so that a sampled point is the same on every machine.
    """

    def values() -> Iterator[float]:
        first, last = _decimal(start) * (factor or 1), _decimal(stop) * (factor or 1)
        logarithm = (last / first).ln() if spacing == "log" else Decimal(0)
        for share in map(Decimal, shares.tolist()):
            yield float(first * (share * logarithm).exp() if spacing == "log" else first + (last - first) * share)

    return _collect(values(), len(shares))


def scaled(values: NDArray[np.float64], factor: Decimal | None) -> NDArray[np.float64]:
    """`values` times `factor`, each rounded once."""
    if factor is None:
        return values
    return _collect((float(_decimal(v) * factor) for v in values.ravel().tolist()), values.size).reshape(values.shape)


def _decimal(value: float) -> Decimal:
    """The shortest decimal that is this float64: what the user wrote."""
    return Decimal(repr(value))


def _collect(values: Iterator[float], num: int) -> NDArray[np.float64]:
    with localcontext(DIGITS):
        return np.fromiter(values, np.float64, count=num)


def read_column(path: Path, name: str) -> list[tuple[int, str]]:
    """Line numbers and texts of the column `name` of a csv file with a heading, or of a file's only column.

    Empty lines and lines that start with "#" are left out.

    Raises
    ------
    ValueError
        With the text for the user.
    """
    rows = _rows(path)
    first = next(rows, (1, []))
    headings = [cell.strip() for cell in first[1]]
    if name not in headings and len(headings) > 1:
        raise ValueError(f'{path} has no column "{name}"; its first line is {",".join(headings)[:60]}')
    column = headings.index(name) if name in headings else 0
    cells = []
    for line, row in rows if name in headings or not headings else itertools.chain([first], rows):
        if len(row) != len(headings):
            raise ValueError(f"{path}, line {line}: expected {len(headings)} columns, found {len(row)}")
        cells.append((line, row[column].strip()))
    if not cells:
        raise ValueError(f"{path} holds no values")
    return cells


def numbered_columns(path: Path, name: str) -> int:
    """How many columns `name_1`, `name_2`, ... a csv file has.

    Raises
    ------
    ValueError
        With the text for the user.
    """
    headings = [cell.strip() for cell in next(_rows(path), (1, []))[1]]
    count = next(i for i in itertools.count() if f"{name}_{i + 1}" not in headings)
    if not count:
        raise ValueError(f"{path} has no columns {name}_1, {name}_2, ...; its first line is {','.join(headings)[:60]}")
    return count


def _lines(file: TextIO) -> Iterator[str]:
    """Lines of a text, none of which fills the memory. Raises ValueError."""
    while line := file.readline(LONGEST_LINE + 1):
        if len(line) > LONGEST_LINE:
            raise ValueError(f"a line is longer than {LONGEST_LINE:,} characters")
        yield line


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Numbers and cells of the lines that are no comments. Raises ValueError with the text for the user."""
    if path.exists() and not path.is_file():
        raise ValueError(f"{path} cannot be read: it is no regular file")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            # a comment becomes an empty line before csv sees it, since a quotation mark in it would open a field
            lines = ("\n" if line.startswith("#") else line for line in _lines(file))
            reader = csv.reader(lines, skipinitialspace=True)
            rows = ((reader.line_num, row) for row in reader if any(cell.strip() for cell in row))
            # a heading and one value too many suffice to know that there are too many
            yield from itertools.islice(rows, LARGEST_AXIS + 2)
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error, ValueError) as error:
        raise ValueError(f"{path} is not a csv file: {error}") from None
