"""A timed sample spread over the grid, and blocks of a size that follows from it."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.cells.partition import Partition, RowBlocks, boxes
from sweep.cells.schema import Column, cells_of
from sweep.errors import SweepError

if TYPE_CHECKING:
    from sweep.cells.guard import SolveCells

POSITIONS = 64
BUDGET = 0.003, 0.03
"""Seconds a sample may take in any run, unless one call takes longer; and in one that takes 100 times as long;"""
SHARE = 0.005
"""or this share of the run, where that is more."""
PROBE_SECONDS = 5e-4
"""A probe as long as this sees past the cost of a call, and 64 of them take a few hundredths of a second."""
TWICE = 1e-3
"""Seconds of a probe that is made once: what is met for the first time matters little in it."""
DEAR = 2e-3
"""Seconds of a probe that counts among those of the sample, wherever it was made."""
PLACES = 8
"""Places that are tried in turn where a probe of the middle fails."""
MOST_FAILED = 16
"""A kernel that fails in so many probes, and in no other, is given up."""
LANES = 32
"""Cells that a lane kernel solves at once: it takes as long for one of them."""
BLOCK_SECONDS = (0.05, 1.0)
CALLS = 400
"""Times that a block's cells cost what a call does beside them, by probes of few cells; of many, which cost less each
and wait less for the last ones, it is enough for calls to take less than 2 % of a run,"""
LEAST_BLOCKS = 8
"""where so many blocks are left for each of several workers."""
BLOCK_BYTES = 8 << 20
MOST_BLOCKS = 100_000


@dataclass(frozen=True)
class Sample:
    """Timed probes: cell each starts at (ascending), its seconds per cell, and how many cells each has.

    `lanes`: whether one cell takes as long as 32; None where that was not asked. `call`: what a call costs beside the
    share of its cells, in seconds: what one cell alone takes beyond it. Where cells are solved in lanes, that is also
    about what the last ones of a call wait for each other.
    """

    positions: Any
    costs: Any
    cells: int
    lanes: bool | None = None
    call: float = 0.0

    @property
    def cost(self) -> float:
        """Mean seconds per cell over the grid."""
        return float(np.mean(self.costs))

    def weights(self, partition: Partition, first: Callable[[Any], Any] | None = None) -> Any:
        """Estimated seconds of every block; `first` tells the first cells of rows where a row is more than a cell."""
        edges = partition.edges
        starts, stops = (found := edges if first is None else first(edges))[:-1], found[1:]
        return np.interp((starts + stops) / 2, self.positions, self.costs) * (stops - starts)


UNSAMPLED = Sample(np.zeros(1), np.ones(1), 1)
"""Stands in where no cell is left to compute: every block weighs its cells."""


Clock = Callable[[], float]
FAILED_PROBE = max(BUDGET) / 16
"""Seconds that a probe counts for which fails."""


def take_sample(solver: SolveCells, columns: Sequence[Column], size: int, clock: Clock | None = None) -> Sample:
    """Times a few cells at up to 64 places of the grid, in a few hundredths of a second or a hundredth of the run.

    Probes that fail are left out. Raises what the kernel does where all fail.
    """
    probing = _Probing(solver, clock or time.perf_counter)
    cells, lanes = _probe_cells(probing, columns, size)
    probes = _probes(probing, columns, size, cells)
    if not probes and cells > 1:
        # a bad cell spoils a probe of many
        cells, lanes = 1, None
        probes = _probes(probing, columns, size, cells)
    if not probes:
        raise probing.fault
    places = sorted(probes)
    costs = np.array([probes[place] / cells for place in places])
    call = max(0.0, probing.alone - float(np.min(costs)))
    return Sample(np.array(places), costs, cells, lanes, call)


def _probes(probing: _Probing, columns: Sequence[Column], size: int, cells: int) -> dict[int, float]:
    """Seconds of probes of so many cells, by their first cell; a dear one that was made before is among them."""
    count = max(1, min(POSITIONS, size // (4 * cells)))
    probes = dict(probing.dear.get(cells, {}))
    spent = sum(probes.values())
    # where all of these fail, others are looked at until one does not
    places = [_place(index, number, cells, size) for number in (count, PLACES) for index in _scattered(number)]
    for turn, start in enumerate(places):
        if probes and (turn >= count or spent > _affordable(spent / (len(probes) * cells) * size)):
            break
        seconds = probing.probe(start, columns, cells)
        if seconds is not None:
            probes[start] = seconds
        spent += FAILED_PROBE if seconds is None else seconds
    return probes


def _affordable(seconds: float) -> float:
    """Seconds that the sample of a run of so many may take."""
    least, most = BUDGET
    return max(least, min(most, seconds / 100), SHARE * seconds)


def partition(sample: Sample, size: int, cell_bytes: float, workers: int) -> Partition:
    """Blocks of about 1/200 of each worker's share, within bounds of time, bytes and number."""
    cost = max(sample.cost, 1e-12)
    shortest, longest = BLOCK_SECONDS
    seconds = max(cost * size / (200 * workers), shortest)
    # by the cheapest probe: on a busy machine some take ten times as long as they should, and blocks would be short
    worth_a_call = CALLS * sample.call / max(float(np.min(sample.costs)), 1e-12)
    share = size / (1 if workers == 1 else LEAST_BLOCKS * workers)
    cells = min(max(seconds / cost, min(worth_a_call, share)), longest / cost, BLOCK_BYTES / cell_bytes, size)
    if sample.lanes:
        cells = max(cells, min(LANES, math.ceil(size / workers)))
    elif sample.cells < LANES and sample.lanes is None:
        cells = max(cells, min(LANES, size / (4 * workers)))
    cells = max(1, math.floor(cells), -(-size // MOST_BLOCKS))
    whole_lanes = cells if cells < LANES else -(-cells // LANES) * LANES
    return Partition(size, min(whole_lanes, size))


def row_partition(sample: Sample, rows: RowBlocks, shape: tuple[int, ...], row_bytes: float, workers: int) -> Partition:
    """The same of rows, which stand in a box of this shape."""
    blocks = partition(sample, rows.size, row_bytes / rows.mean, workers)
    return boxes(shape, math.ceil(blocks.cells / rows.mean), LANES if rows.mean == 1 else 1)


def _probe_cells(probing: _Probing, columns: Sequence[Column], size: int) -> tuple[int, bool | None]:
    """Cells a probe: few enough for 64 probes in the budget, enough to see past the cost of a call.

    Where single cells are dear and few, also whether two take as long as one: then 32 will.
    """
    cells = 1
    while True:
        seconds = _probe(probing, columns, size, cells)
        more = LANES if cells == 1 else 4 * cells
        dear = seconds > PROBE_SECONDS
        worth_a_look = cells == 1 and (seconds < max(BUDGET) / 4 or more * 50 < size)
        few = size < (4 if cells == 1 else POSITIONS) * more
        if cells == 1 and dear and (few or not worth_a_look) and size > 1:
            lanes = _probe(probing, columns, size, 2) < 1.5 * seconds
            return (max(1, min(LANES, size // 4)), True) if lanes else (1, False)
        if few or (dear and not worth_a_look):
            return cells, None
        cells = more


def _probe(probing: _Probing, columns: Sequence[Column], size: int, cells: int) -> float:
    """Seconds that some cells in the middle of the grid take together, or elsewhere, where these fail."""
    for start in [_place(0, 1, cells, size), *(_place(index, PLACES, cells, size) for index in _scattered(PLACES))]:
        seconds = probing.probe(start, columns, cells)
        if seconds is not None and cells == 1 and seconds < TWICE:
            seconds = probing.probe(start, columns, cells) or seconds
        if seconds is not None:
            return seconds
    return math.inf


class _Probing:
    """Makes probes.

    Attributes
    ----------
    dear : dict
        Seconds of the last dear one of so many cells, by the cell that it begins with.
    alone : float
        The least that a probe of one cell took.
    fault : Exception
        Why the last one that failed did.
    """

    def __init__(self, solver: SolveCells, clock: Clock) -> None:
        self._solver, self._clock = solver, clock
        self._good, self._failed, self.alone = False, 0, math.inf
        self.dear: dict[int, dict[int, float]] = {}
        self.fault: Exception = RuntimeError("no cell was tried")

    def probe(self, start: int, columns: Sequence[Column], cells: int) -> float | None:
        """Seconds of so many cells; None where the kernel fails. Raises what it does where it always fails."""
        arrays = {column.name: column.empty(cells) for column in columns}
        begun = self._clock()
        with tolerated() as faults:
            self._solver.solve(start, cells_of(arrays))
            seconds = self._clock() - begun
            self._good = True
            if cells == 1:
                self.alone = min(self.alone, seconds)
            if seconds >= DEAR:
                self.dear[cells] = {start: seconds}
            return seconds
        self.fault, self._failed = faults[0], self._failed + 1
        if not self._good and self._failed >= MOST_FAILED:
            raise self.fault
        return None


@contextlib.contextmanager
def tolerated() -> Iterator[list[Exception]]:
    """What a kernel raises goes no further, but into the list."""
    faults: list[Exception] = []
    try:
        yield faults
    except (SweepError, MemoryError):
        raise
    except Exception as fault:
        faults.append(fault)


def _place(index: int, count: int, cells: int, size: int) -> int:
    middle = (2 * index + 1) * size // (2 * count)
    return min(max(middle - cells // 2, 0), size - cells)


def _scattered(count: int) -> list[int]:
    """0 .. count-1 from the middle on, so that every beginning of the list is spread over all of it (bits reversed)."""
    bits = max(1, (count - 1).bit_length())
    turned = (int(f"{i:0{bits}b}"[::-1], 2) for i in range(1 << bits))
    return [(i + count // 2) % count for i in turned if i < count]
