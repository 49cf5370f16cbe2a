"""How a grid is cut: into blocks that are computed and kept as a whole, and into rows.

A part holds a line of numbers for each row: a cell; or, of a study with a summary, a row block, whose cells are reduced
to one. Row blocks depend on the study alone, so that a summary has the same bits for any blocks, workers and
interruptions. The axes that are kept come first, so a group (the cells that are reduced to one number in the end) is
one run of flat cell numbers; it is cut into row blocks of equal length, the last one shorter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from sweep.study.model import Study

FINENESS = 1024
"""Row blocks a study is cut into, about: enough for many workers, and few to merge in the end."""
LARGEST = 1 << 22
"""Cells of a row block, so that a block of dear cells stays short."""


@dataclass(frozen=True)
class Partition:
    """Blocks of `cells` flat cells in C order, the last one shorter."""

    size: int
    cells: int

    @property
    def count(self) -> int:
        """Number of blocks."""
        return -(-self.size // self.cells)

    def bounds(self, index: int) -> tuple[int, int]:
        """Flat range `start, stop` of a block."""
        start = index * self.cells
        return start, min(start + self.cells, self.size)

    def holds(self, start: int, stop: int) -> bool:
        """Whether there is a block of just these cells."""
        return 0 <= start < stop and self.bounds(start // self.cells) == (start, stop)


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
            rows = min(stop - row, max(1, capacity // cells), self._alike(row))
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
