"""Which statuses a result holds, with a cell of each to look at."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Status
from sweep.layout import METHOD_USED, STATUS

if TYPE_CHECKING:
    import xarray as xr

CELLS_AT_ONCE = 1 << 22


@dataclass(frozen=True)
class StatusCount:
    """How many cells have a status, and the coordinates of the first of them."""

    name: str
    cells: int
    total: int
    example: dict[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        text = f"{self.cells} of {self.total} cells: {self.name}"
        cell = " ".join(f"{k}={v}" for k, v in self.example.items())
        return f"{text}, e.g. {cell}" if cell else text


def count_statuses(dataset: xr.Dataset) -> list[StatusCount]:
    """Every status that occurs, in the order of its number, with its first cell; OK without one.

    Reads a few million cells at a time.
    """
    counts, first = _tally(dataset[STATUS])
    total = int(counts.sum())
    return [
        StatusCount(
            _name(number), int(counts[number]), total, {} if number == Status.OK else _cell(dataset, first[number])
        )
        for number in range(len(counts))
        if counts[number]
    ]


def failures(dataset: xr.Dataset) -> list[StatusCount]:
    """The statuses that are not OK."""
    return [count for count in count_statuses(dataset) if count.name != Status.OK.name]


def count_methods(dataset: xr.Dataset) -> dict[str, int]:
    """How many cells each method solved; those that none did are left out."""
    counts, _ = _tally(dataset[METHOD_USED], lowest=-1)
    names = dataset[METHOD_USED].attrs["flag_meanings"].split()
    return {name: int(n) for name, n in zip(names[1:], counts[1:], strict=False) if n}


def _tally(column: xr.DataArray, lowest: int = 0) -> tuple[Any, dict[int, int]]:
    """Cells of each number from `lowest` on, and the flat index of the first of each (both counted from `lowest`)."""
    counts = np.zeros(128, np.int64)
    first: dict[int, int] = {}
    done = 0
    for piece in _flat_pieces(column):
        values = piece.astype(np.int16) - lowest
        found = np.bincount(values, minlength=128)
        for number in np.flatnonzero(found):
            if int(number) not in first:
                first[int(number)] = done + int(np.argmax(values == number))
        counts += found
        done += len(values)
    return counts, first


def _flat_pieces(column: xr.DataArray) -> Iterator[Any]:
    """The cells in C order, some at a time."""
    if not column.dims:
        yield np.atleast_1d(np.asarray(column.values))
        return
    row = max(1, math.prod(column.shape[1:]))
    if row > CELLS_AT_ONCE:
        for index in range(column.shape[0]):
            yield from _flat_pieces(column[index])
        return
    rows = max(1, CELLS_AT_ONCE // row)
    for start in range(0, column.shape[0], rows):
        yield np.asarray(column[start : start + rows].values).reshape(-1)


def _name(number: int) -> str:
    return next((status.name for status in Status if status == number), f"status {number}")


def _cell(dataset: xr.Dataset, index: int) -> dict[str, str]:
    """Coordinates of a cell, as people write them."""
    column = dataset[STATUS]
    at = dict(zip(column.dims, np.unravel_index(index, column.shape), strict=True))
    cell = {}
    for name, coordinate in dataset.coords.items():
        if coordinate.dims and set(coordinate.dims) <= set(column.dims):
            value = coordinate.isel({d: at[d] for d in coordinate.dims}).item()
            cell[str(name)] = value if isinstance(value, str) else repr(float(f"{value:.6g}"))
    return cell
