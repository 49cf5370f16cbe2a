"""How a grid is cut: into blocks that are computed and kept as a whole, and into rows.

A block holds a line of numbers for each row: a cell; or, of a study with a summary, a row block, whose cells are
reduced to one. Row blocks depend on the study alone, so that a summary has the same bits for any blocks, workers and
interruptions. The axes that are kept come first, so a group (the cells that are reduced to one number in the end) is
one run of flat cell numbers; it is cut into row blocks of equal length, the last one shorter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from sweep.study.model import Study

FINENESS = 1024
"""Row blocks a study is cut into, about: enough for many workers, and few to merge in the end."""
LARGEST = 1 << 22
"""Cells of a row block, so that a block of dear cells stays short."""

PADDED = 1.1
"""Cells that the boxes of a grid may hold, for each one that it has."""
MOST_TRIED = 4096
"""Lengths of a box that are looked at."""
UNNOTICED = 1.01
"""Share of idle lanes below which fewer are not worth a smaller box."""


@dataclass(frozen=True)
class Partition:
    """Blocks of `cells` flat cells in C order, the last one of every `row` cells shorter (0: of all)."""

    size: int
    cells: int
    row: int = 0

    @property
    def count(self) -> int:
        """Number of blocks."""
        row = self.row or self.size
        return self.size // row * -(-row // self.cells)

    def bounds(self, index: int) -> tuple[int, int]:
        """Flat range `start, stop` of a block."""
        row = self.row or self.size
        before, place = divmod(index, -(-row // self.cells))
        start = before * row + place * self.cells
        return start, min(start + self.cells, (before + 1) * row)

    def index(self, cell: Any) -> Any:
        """The block that a cell is in, or each of an array of cells."""
        row = self.row or self.size
        return cell // row * -(-row // self.cells) + cell % row // self.cells

    @property
    def edges(self) -> Any:
        """Where each block starts, and the last one stops."""
        row = self.row or self.size
        before, place = np.divmod(np.arange(self.count, dtype=np.int64), -(-row // self.cells))
        return np.append(before * row + place * self.cells, self.size)


def boxes(shape: tuple[int, ...], wanted: int, unit: int = 1) -> Partition:
    """Blocks of about so many cells that are boxes of a grid: whole trailing axes, a run of one, single places before.

    The boxes of one grid of equal boxes hold at most a tenth more than the grid. Blocks of less than some hundred
    cells have few idle lanes where `unit` cells are solved at once.
    """
    inner = 1
    for length in reversed(shape):
        if inner * length > wanted:
            return Partition(
                math.prod(shape), inner * _run(length, inner, max(1, wanted // inner), unit), inner * length
            )
        inner *= length
    return Partition(math.prod(shape), math.prod(shape))


def _run(length: int, inner: int, most: int, unit: int) -> int:
    """How much of an axis a box takes; each place of it has `inner` cells."""
    fewer = np.arange(most, max(most // 2, most - MOST_TRIED), -1)
    fewer = fewer[-(-length // fewer) * fewer <= PADDED * length]
    if not fewer.size:
        more = np.arange(most + 1, length + 1)
        return int(more[-(-length // more) * more <= PADDED * length][0])
    lanes = -(-fewer * inner // unit) * unit / (fewer * inner)
    return int(fewer[np.argmin(np.maximum(lanes, UNNOTICED))])


def box_shape(shape: tuple[int, ...], cells: int) -> tuple[int, ...]:
    """The lengths of the boxes of so many cells that `boxes` makes of a grid."""
    found, inner = [], 1
    for length in reversed(shape):
        found.append(max(1, min(length, cells // inner)))
        inner *= length
    return tuple(reversed(found))


def box_slices(shape: tuple[int, ...], start: int, stop: int) -> tuple[slice, ...]:
    """Where the box of the cells `start` to `stop` of a grid lies."""
    first, last = (np.unravel_index(cell, shape) for cell in (start, stop - 1))
    return tuple(slice(int(a), int(b) + 1) for a, b in zip(first, last, strict=True))


class RowStrip(NamedTuple):
    """Rows from `row` on, of `cells` cells each, from cell number `cell` on."""

    row: int
    rows: int
    cell: int
    cells: int


@dataclass(frozen=True)
class RowBlocks:
    """`groups` groups of `group` cells, in row blocks of `length` cells."""

    groups: int
    group: int
    length: int

    @property
    def per_group(self) -> int:
        """Row blocks of a group."""
        return -(-self.group // self.length)

    @property
    def count(self) -> int:
        """Number of rows."""
        return self.groups * self.per_group

    @property
    def size(self) -> int:
        """Number of cells."""
        return self.groups * self.group

    @property
    def mean(self) -> float:
        """Cells of a row, on average."""
        return self.size / self.count

    def first(self, row: Any) -> Any:
        """Number of the first cell of a row, or of an array of rows; of the row behind the last one: all cells."""
        group, place = row // self.per_group, row % self.per_group
        return group * self.group + place * self.length

    def cells(self, start: int, stop: int) -> tuple[int, int]:
        """The cells of the rows `start` to `stop`."""
        return int(self.first(start)), int(self.first(stop))

    def strips(self, start: int, stop: int, capacity: int) -> Iterator[RowStrip]:
        """Cut the rows `start` to `stop` into strips of at most `capacity` cells, or one row.

        A row block longer than that comes in several strips, cut at the same places always.
        """
        row = start
        while row < stop:
            cell, end = self.cells(row, row + 1)
            cells = end - cell
            if cells > capacity:
                for first in range(cell, end, capacity):
                    yield RowStrip(row, 1, first, min(capacity, end - first))
                row += 1
                continue
            rows = min(stop - row, capacity // cells, self._alike(row))
            yield RowStrip(row, rows, cell, cells)
            row += rows

    def _alike(self, row: int) -> int:
        """Rows from this one on that are of equal length and follow each other."""
        if self.per_group == 1:
            return self.groups
        place = row % self.per_group
        whole = self.group // self.length
        return whole - place if place < whole else 1


def row_blocks(study: Study) -> RowBlocks:
    """How the cells of a study make rows."""
    lengths = study.grid_shape
    size = math.prod(lengths.values())
    if study.summary is None:
        return RowBlocks(size, 1, 1)
    over = study.summary.over
    groups = math.prod(lengths[dim] for dim, names in study.dims.items() if names[0] not in over)
    group = size // groups
    wanted = min(1 << max(0, (size // FINENESS).bit_length() - 1), LARGEST)
    return RowBlocks(groups, group, group if group <= 4 * wanted else wanted)
