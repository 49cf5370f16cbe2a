"""The values of one axis: evenly or geometrically spaced, or in the columns of a csv file.

Spacing and units are computed in decimals of 50 digits and rounded once, so that a value is the float64 nearest to
what the study says (0.3, 0.001, the endpoints), on every machine.
"""

from __future__ import annotations

import csv
import itertools
import operator
from collections.abc import Iterable, Iterator
from decimal import Context, Decimal, localcontext
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

LARGEST_AXIS = 10_000_000
SPACINGS = ("linear", "log")
DIGITS = Context(prec=50)
Floats = NDArray[np.float64]


def spaced(spacing: str, start: float, stop: float, num: int, factor: Decimal | None = None) -> Floats:
    """`num` >= 2 values from `start` to `stop`, both included, times `factor`; ratios are equal if "log"."""
    with localcontext(DIGITS):
        first, last = (_decimal(end) * (factor or 1) for end in (start, stop))
        if spacing == "linear":
            values: Iterable[Decimal] = ((first * (num - 1 - i) + last * i) / (num - 1) for i in range(num))
        else:
            ratio = (last / first) ** (1 / Decimal(num - 1))
            inner = itertools.accumulate(itertools.repeat(ratio, num - 2), operator.mul, initial=first)
            values = itertools.chain(inner, [last])
        return np.fromiter(map(float, values), np.float64, num)


def spread(spacing: str, start: float, stop: float, shares: Floats, factor: Decimal | None = None) -> Floats:
    """The values at `shares` of the way from `start` to `stop`, times `factor`."""
    with localcontext(DIGITS):
        first, last = (_decimal(end) * (factor or 1) for end in (start, stop))
        logarithm = (last / first).ln() if spacing == "log" else Decimal(0)
        values = (
            first * (share * logarithm).exp() if spacing == "log" else first + (last - first) * share
            for share in map(Decimal, shares.tolist())
        )
        return np.fromiter(map(float, values), np.float64, len(shares))


def scaled(values: Floats, factor: Decimal | None) -> Floats:
    """`values` times `factor`, each rounded once."""
    if factor is None:
        return values
    with localcontext(DIGITS):
        return np.array([float(_decimal(v) * factor) for v in values.ravel().tolist()]).reshape(values.shape)


def _decimal(value: float) -> Decimal:
    """The shortest decimal that is this float64: what the user wrote."""
    return Decimal(repr(value))


def read_columns(path: Path, name: str, numbered: bool = False) -> list[tuple[int, list[str]]]:
    """Line numbers, and the texts of the column `name`, of the only column, or of `name_1`, `name_2`, ...

    Empty lines and lines that start with "#" are left out.

    Raises
    ------
    ValueError
        With the text for the user.
    """
    rows = _rows(path)
    first = next(rows, (1, []))
    headings = [cell.strip() for cell in first[1]]
    known = {heading: i for i, heading in enumerate(headings)}
    wanted = [name]
    if numbered:
        wanted = list(itertools.takewhile(known.__contains__, (f"{name}_{i + 1}" for i in range(len(headings)))))
    line = ",".join(headings)[:60]
    if not wanted:
        raise ValueError(f"{path} has no columns {name}_1, {name}_2, ...; its first line is {line}")
    if name not in known and len(headings) > 1 and not numbered:
        raise ValueError(f'{path} has no column "{name}"; its first line is {line}')
    places = [known.get(heading, 0) for heading in wanted]
    if headings and wanted[0] not in known:
        rows = itertools.chain([first], rows)
    cells = []
    for number, row in rows:
        if len(row) != len(headings):
            raise ValueError(f"{path}, line {number}: expected {len(headings)} columns, found {len(row)}")
        cells.append((number, [row[place].strip() for place in places]))
    if not cells:
        raise ValueError(f"{path} holds no values")
    if len(cells) > LARGEST_AXIS:
        raise ValueError(f"expected at most {LARGEST_AXIS} values, found more")
    return cells


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Numbers and cells of the lines that are no comments. Raises ValueError with the text for the user."""
    try:
        if path.exists() and not path.is_file():
            raise ValueError(f"{path} cannot be read: it is no regular file")
        with path.open(newline="", encoding="utf-8-sig") as file:
            # a comment becomes an empty line before csv sees it, since a quotation mark in it would open a field
            reader = csv.reader(("\n" if line.startswith("#") else line for line in file), skipinitialspace=True)
            rows = ((reader.line_num, row) for row in reader if any(cell.strip() for cell in row))
            # a heading and one value too many suffice to know that there are too many
            yield from itertools.islice(rows, LARGEST_AXIS + 2)
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path} is not a csv file: {error}") from None
