"""Division of a grid into blocks, each computed and stored as a whole, and into rows.

A block has a line of numbers for each row. A row is a cell, or in a study with a summary a row block, whose cells are
reduced to one line. Row blocks depend on the study alone, so the bits of a summary do not depend on blocks, workers
and interruptions. The axes that are kept come first, so a group (cells that are finally reduced to one number) is a run
of flat cell numbers; it is divided into row blocks of equal length, the last one shorter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from sweep.study.model import Study

FINENESS = 1024
"""Approximate number of row blocks of a study: enough for many workers, and few to merge in the end."""
LARGEST = 1 << 22
"""Largest number of cells in a row block, so that a block of slow cells stays short."""
PADDED = 1.1
"""Largest ratio of the cells in the boxes of a grid to its own cells."""
MOST_TRIED = 4096
"""Lengths of a box that are tried."""
UNNOTICED = 1.01
"""Share of idle lanes that is accepted for a larger box."""


@dataclass(frozen=True)
class Partition:
    """Blocks of `cells` of `size` flat cells in C order, the last one of every `row` cells shorter (0: of all).

    The rows of a study with a summary are such blocks, too.
    """

    size: int
    cells: int
    row: int = 0

    @property
    def per_row(self) -> int:
        """Blocks of a row."""
        return -(-(self.row or self.size) // self.cells)

    @property
    def count(self) -> int:
        """Number of blocks."""
        return self.size // (self.row or self.size) * self.per_row

    @property
    def mean(self) -> float:
        """Cells of a block, on average."""
        return self.size / self.count

    def first(self, index: Any) -> Any:
        """The first cell of a block, or of each of an array of blocks; of the one behind the last: `size`."""
        return index // self.per_row * (self.row or self.size) + index % self.per_row * self.cells

    def bounds(self, start: int, stop: int | None = None) -> tuple[int, int]:
        """Flat range of a block, or of the blocks from `start` to `stop`."""
        return self.first(start), self.first(start + 1 if stop is None else stop)

    def strips(self, start: int, stop: int, capacity: int) -> Iterator[tuple[int, int, int, int]]:
        """Cut the blocks `start` to `stop`, which are rows, into strips of at most `capacity` cells, or one row.

        Yields its first row, its rows, its first cell and the cells of each row. A row that is longer comes in several
        strips, cut at the same places always.
        """
        place = start
        while place < stop:
            cell, end = self.bounds(place)
            # as many as are of equal length and follow each other
            whole = (self.row or self.size) // self.cells - place % self.per_row if self.per_row > 1 else self.count
            rows = max(1, min(stop - place, capacity // (end - cell), whole))
            for first in range(cell, end, capacity):
                yield place, rows, first, min(capacity, end - first)
            place += rows


def boxes(shape: tuple[int, ...], wanted: int, unit: int = 1) -> Partition:
    """Blocks of about so many cells that are boxes of a grid: whole trailing axes, a run of one, single places before.

    The boxes of one grid of equal boxes hold at most a tenth more than the grid. Blocks of less than some hundred
    cells have few idle lanes where `unit` cells are solved at once.
    """
    size, inner = math.prod(shape), 1
    for length in reversed(shape):
        if inner * length > wanted:
            break
        inner *= length
    else:
        return Partition(size, size)
    most = max(1, wanted // inner)

    def padded_little(runs: Any) -> Any:
        return runs[-(-length // runs) * runs <= PADDED * length]

    fewer = padded_little(np.arange(most, max(most // 2, most - MOST_TRIED), -1))
    if fewer.size:
        lanes = -(-fewer * inner // unit) * unit / (fewer * inner)
        run = fewer[np.argmin(np.maximum(lanes, UNNOTICED))]
    else:
        run = padded_little(np.arange(most + 1, length + 1))[0]
    return Partition(size, inner * int(run), inner * length)


def box_shape(shape: tuple[int, ...], cells: int) -> tuple[int, ...]:
    """The lengths of the boxes of so many cells that `boxes` makes of a grid."""
    inner = [math.prod(shape[k + 1 :]) for k in range(len(shape))]
    return tuple(max(1, min(length, cells // n)) for length, n in zip(shape, inner, strict=True))


def box_slices(shape: tuple[int, ...], start: int, stop: int) -> tuple[slice, ...]:
    """Where the box of the cells `start` to `stop` of a grid lies."""
    first, last = (np.unravel_index(cell, shape) for cell in (start, stop - 1))
    return tuple(slice(int(a), int(b) + 1) for a, b in zip(first, last, strict=True))


def row_blocks(study: Study) -> Partition:
    """The rows of a study, each a block of cells."""
    lengths = study.grid_shape
    size = math.prod(lengths.values())
    if study.summary is None:
        return Partition(size, 1)
    over = study.summary.over
    groups = math.prod(lengths[dim] for dim, names in study.dims.items() if names[0] not in over)
    group = size // groups
    wanted = min(1 << max(0, (size // FINENESS).bit_length() - 1), LARGEST)
    return Partition(size, group if group <= 4 * wanted else wanted, group)
