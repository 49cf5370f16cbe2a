"""Which statuses a result holds, with a cell of each to look at."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import astuple, dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from kernels.interface import KINDS, Status
from sweep.cells.reduce import BY_METHOD, BY_STATUS
from sweep.cells.schema import METHOD_USED, STATUS

if TYPE_CHECKING:
    import xarray as xr

    from sweep.file.reading import Numbers
    from sweep.file.stored import Stored, StoredColumn

    Cells: TypeAlias = xr.Dataset | Stored

CELLS_AT_ONCE = 1 << 22


@dataclass(frozen=True)
class Account:
    """What became of all cells: each is counted under one of the words of `kernels.interface.KINDS`.

    `failed` are those that FAILED, and those of a status that this version does not know.
    """

    ok: int = 0
    remarked: int = 0
    refused: int = 0
    unsolved: int = 0
    failed: int = 0
    pending: int = 0
    not_asked: int = 0

    @property
    def total(self) -> int:
        """All cells."""
        return sum(self.by_kind.values())

    @property
    def by_kind(self) -> dict[str, int]:
        """Cells under each of the words."""
        return dict(zip(KINDS, astuple(self), strict=True))

    def __str__(self) -> str:
        counts = self.by_kind
        if not self.not_asked:
            del counts["not asked"]
        return f"{self.total:,} cells: " + ", ".join(f"{cells:,} {kind}" for kind, cells in counts.items())


def account(dataset: Cells) -> Account:
    """What became of the cells of a result, of a summary too."""
    counts = dict.fromkeys(KINDS, 0)
    for name, cells in tally(dataset).items():
        counts[kind_of(name)] += cells
    return Account(*counts.values())


def kind_of(name: str) -> str:
    """The word under which a status is counted."""
    return (Status[name] if name in Status.__members__ else Status.FAILED).kind


def tally(dataset: Cells) -> dict[str, int]:
    """How many cells have each status that occurs."""
    if is_summary(dataset):
        return summed(dataset, BY_STATUS)
    return {count.name: count.cells for count in count_statuses(dataset)}


def is_summary(dataset: Cells) -> bool:
    """Whether a result holds reductions, not cells."""
    return BY_STATUS in dataset and STATUS not in dataset


def flag_words(variable: xr.DataArray) -> dict[int, str]:
    """What the codes of a flag variable mean, {} for others; -1 is "none" where the flags do not say."""
    values = np.atleast_1d(variable.attrs.get("flag_values", ())).tolist()
    words = dict(zip(values, str(variable.attrs.get("flag_meanings", "")).split(), strict=False))
    return {-1: "none", **words} if words else {}


def summed(dataset: Cells, name: str) -> dict[str, int]:
    """Cells of each status or method of a summary, over all it keeps; those that do not occur are left out."""
    counts = dataset[name]
    words = dataset[str(counts.dims[-1])].values
    total = counts.values.reshape(-1, len(words)).sum(axis=0)
    return {str(word): int(n) for word, n in zip(words, total, strict=True) if n}


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


def count_statuses(dataset: Cells) -> list[StatusCount]:
    """Every status that occurs, in the order of its number, with its first cell; OK without one, a summary without any.

    Reads a few million cells at a time.
    """
    if is_summary(dataset):
        found = summed(dataset, BY_STATUS)
        return [StatusCount(name, cells, sum(found.values())) for name, cells in found.items()]
    counts, first = _tally(dataset[STATUS])
    total = int(counts.sum())
    return [
        StatusCount(_name(n), int(counts[n]), total, {} if n == Status.OK else cell_values(dataset, first[n]))
        for n in range(len(counts))
        if counts[n]
    ]


def failures(dataset: Cells) -> list[StatusCount]:
    """The statuses that are not OK."""
    return [count for count in count_statuses(dataset) if count.name != Status.OK.name]


def count_methods(dataset: Cells) -> dict[str, int]:
    """How many cells each method solved; those that none did are left out."""
    if is_summary(dataset):
        return {name: n for name, n in summed(dataset, BY_METHOD).items() if name != "none"}
    counts, _ = _tally(dataset[METHOD_USED], lowest=-1)
    names = str(dataset[METHOD_USED].attrs["flag_meanings"]).split()
    return {name: int(n) for name, n in zip(names[1:], counts[1:], strict=False) if n}


def summary_text(dataset: Cells) -> str:
    """After a run: what the cells were solved with, and what became of those that are not OK."""
    used = ", ".join(f"{name} {cells:,}" for name, cells in count_methods(dataset).items())
    lines = [f"{account(dataset)}" + (f"; solved by {used}" if used else "")]
    return "\n".join([*lines, *map(str, failures(dataset))])


def _tally(column: xr.DataArray | StoredColumn, lowest: int = 0) -> tuple[Any, dict[int, int]]:
    """Cells of each number from `lowest` on, and the flat index of the first of each (both counted from `lowest`)."""
    counts = np.zeros(256, np.int64)
    first: dict[int, int] = {}
    done = 0
    for piece in flat_pieces(column):
        values = (piece.astype(np.int16) - lowest) & 255
        found = np.bincount(values, minlength=256)
        for number in np.flatnonzero(found):
            if int(number) not in first:
                first[int(number)] = done + int(np.argmax(values == number))
        counts += found
        done += len(values)
    return counts, first


def flat_pieces(column: xr.DataArray | StoredColumn | Numbers, at: tuple[int, ...] = ()) -> Iterator[Any]:
    """The cells in C order, some at a time; `at` are indices along the first dimensions."""
    shape = column.shape[len(at) :]
    row = math.prod(shape[1:])
    if not shape:
        yield np.asarray(column[at]).reshape(1)
    elif row > CELLS_AT_ONCE:
        for index in range(shape[0]):
            yield from flat_pieces(column, (*at, index))
    else:
        rows = max(1, CELLS_AT_ONCE // max(1, row))
        for start in range(0, shape[0], rows):
            yield np.asarray(column[(*at, slice(start, start + rows))]).reshape(-1)


def failed_cells(dataset: Cells, most: int) -> list[int]:
    """Numbers of the first cells that FAILED."""
    found: list[int] = []
    done = 0
    for piece in flat_pieces(dataset[STATUS]):
        if len(found) >= most:
            break
        found += (done + np.flatnonzero(piece == Status.FAILED)).tolist()
        done += len(piece)
    return found[:most]


def _name(number: int) -> str:
    return next((status.name for status in Status if status == number), f"status {number}")


def cell_values(dataset: Cells, index: int) -> dict[str, str]:
    """Coordinates of a cell, as people write them."""
    column = dataset[STATUS]
    at = dict(zip(map(str, column.dims), np.unravel_index(index, column.shape), strict=True))
    cell = {}
    for name, coordinate in dataset.coords.items():
        if coordinate.dims and set(coordinate.dims) <= set(column.dims):
            value = coordinate.values[tuple(at[str(d)] for d in coordinate.dims)].item()
            cell[str(name)] = value if isinstance(value, str) else repr(float(f"{value:.6g}"))
    return cell
