"""The values of one axis: evenly or geometrically spaced, or in the columns of a csv file.

Spacing and units are computed in decimals of 50 digits and rounded once, so that a value is the float64 nearest to
what the study says (0.3, 0.001, the endpoints), on every machine.
"""

from __future__ import annotations

import csv
import itertools
import operator
from collections.abc import Callable, Iterable, Iterator
from decimal import Context, Decimal, localcontext
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

LARGEST_AXIS = 10_000_000
SPACINGS = ("linear", "log")
DIGITS = Context(prec=50)
MOST_BAD_VALUES = 3
"""Bad values reported of one list or file."""
Floats = NDArray[np.float64]


def spaced(spacing: str, start: float, stop: float, places: int | Floats, factor: Decimal | None = None) -> Floats:
    """Values from `start` to `stop`, times `factor`; ratios are equal if "log".

    Parameters
    ----------
    places : int or ndarray
        How many, at least 2, both ends included; or at which shares of the way, from 0 to 1.
    """
    values: Iterable[Decimal]
    with localcontext(DIGITS):
        first, last = (_decimal(end) * (factor or 1) for end in (start, stop))
        if isinstance(places, int):
            steps = places - 1
            if spacing == "linear":
                values = ((first * (steps - i) + last * i) / steps for i in range(places))
            else:
                ratio = (last / first) ** (1 / Decimal(steps))
                inner = itertools.accumulate(itertools.repeat(ratio, steps - 1), operator.mul, initial=first)
                values = itertools.chain(inner, [last])
        elif spacing == "linear":
            values = (first + (last - first) * Decimal(share) for share in places.tolist())
        else:
            logarithm = (last / first).ln()
            values = (first * (Decimal(share) * logarithm).exp() for share in places.tolist())
        return np.fromiter(map(float, values), np.float64)


def scaled(values: Floats, factor: Decimal | None) -> Floats:
    """`values` times `factor`, each rounded once."""
    if factor is None:
        return values
    with localcontext(DIGITS):
        return np.array([float(_decimal(v) * factor) for v in values.ravel().tolist()]).reshape(values.shape)


def _decimal(value: float) -> Decimal:
    """The shortest decimal that is this float64: what the user wrote."""
    return Decimal(repr(value))


def read_columns(path: Path, name: str, numbered: bool, number: Callable[[str], float]) -> Floats:
    """Numbers of the column `name`, or of the only one; if `numbered` of `name_1`, `name_2`, ..., shape (n, columns).

    Empty lines and lines that start with "#" are left out.

    Parameters
    ----------
    number : callable
        The number of a text. Raises ValueError.

    Raises
    ------
    ValueError
        With the text for the user.
    """
    values: list[list[float]] = []
    bad: list[str] = []
    try:
        if path.exists() and not path.is_file():
            raise ValueError(f"{path} cannot be read: it is no regular file")
        with path.open(newline="", encoding="utf-8-sig") as file:
            # a comment becomes an empty line before csv sees it, since a quotation mark in it would open a field
            reader = csv.reader(("\n" if line.startswith("#") else line for line in file), skipinitialspace=True)
            stripped = ([cell.strip() for cell in row] for row in reader)
            rows: Iterator[list[str]] = (row for row in stripped if any(row))
            headings = next(rows, [])
            names = [f"{name}_{i + 1}" for i in range(len(headings))] if numbered else [name]
            places = [headings.index(n) for n in itertools.takewhile(headings.__contains__, names)]
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
                    values.append([number(row[place]) for place in places])
                except ValueError as error:
                    bad.append(f"{line}{error}")
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path} is not a csv file: {error}") from None
    if bad:
        raise ValueError(
            f"{path}, {'; '.join(bad[:MOST_BAD_VALUES])}" + "; and more like these" * (len(bad) > MOST_BAD_VALUES)
        )
    if not 0 < len(values) <= LARGEST_AXIS:
        raise ValueError(f"expected at most {LARGEST_AXIS} values, found more" if values else f"{path} holds no values")
    return np.array(values) if numbered else np.array(values)[:, 0]
