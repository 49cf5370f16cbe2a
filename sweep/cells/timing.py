"""Times a sample spread over the grid, which decides the size of blocks.

The first call of a function compiles it, which takes seconds and is not counted. Compile times are those that numba
reports.
"""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from sweep.cells.block import Guard, faults_reported
from sweep.cells.grid import Grid, SolveCells
from sweep.cells.partition import Partition, boxes, row_blocks
from sweep.cells.reduce import part_columns, seconds_a_cell
from sweep.cells.schema import Column, columns, empty, empty_cells
from sweep.cells.solve import Solver
from sweep.errors import SweepError
from sweep.study.model import Study

LANES = 16
"""Cells that a vectorised kernel solves at once, within a factor of 2; one cell takes as long."""
POSITIONS, PLACES = 64, 16
"""Positions in the grid of the probes; and the number tried in turn if one in the middle fails."""
BUDGET = 0.003, 0.03
"""Seconds a sample may take in any run, unless one call takes longer; and in one that takes 100 times as long;"""
SHARE = 0.005
"""or this share of the run, where that is more."""
PROBE_SECONDS = 5e-4
"""Least duration of a probe, so that the cost of a call is small; 64 probes take a few hundredths of a second."""
STALL = 0.02
"""A probe longer than this is repeated, because other processes may have delayed it."""
DEAR = 2e-3
"""Seconds of a probe that counts among those of the sample, wherever it was made; one that fails counts as many."""
BLOCK_SECONDS = (0.05, 1.0)
CALLS = 400
"""Times that a block's cells cost what a call does beside them, by probes of few cells; of many, which cost less each
and wait less for the last ones, it is enough for calls to take less than 2 % of a run,"""
LEAST_BLOCKS = 8
"""where so many blocks are left for each of several workers."""
BLOCK_BYTES, MOST_BLOCKS = 8 << 20, 100_000
GOLDEN = 0.6180339887498949
"""Its multiples modulo 1 fill an interval evenly, and are not commensurate with the length of any axis."""


@dataclass(frozen=True)
class Sample:
    """Timed probes: cell each starts at (ascending), and its seconds per cell.

    `lanes`: whether one cell takes as long as LANES, where cells are so dear that it matters. `call`: what a call costs
    beside the share of its cells, in seconds: what one cell alone takes beyond it. Where cells are solved in lanes,
    that is also about what the last ones of a call wait for each other.
    """

    positions: Any
    costs: Any
    lanes: bool = False
    call: float = 0.0

    @property
    def cost(self) -> float:
        """Mean seconds per cell over the grid."""
        return float(np.mean(self.costs))

    def weights(self, partition: Partition, first: Callable[[Any], Any]) -> Any:
        """Estimated seconds of every block; `first` gives the first cells of rows."""
        edges = first(partition.first(np.arange(partition.count + 1, dtype=np.int64)))
        return np.interp((edges[:-1] + edges[1:]) / 2, self.positions, self.costs) * np.diff(edges)


def sampled_study(study: Study, apart: SolveCells | None = None, clock: Callable[[], float] | None = None) -> Sample:
    """Compiles the kernel and times a sample of the grid, here or `apart`, by a clock of its own.

    Raises SweepError where the kernel always fails.
    """
    solver, clock, last = apart or Solver(study), clock or work_clock, Grid(study).size - 1
    clock()  # it counts what is compiled from now on
    with faults_reported(f"{study.kernel_name}: the kernel failed"):
        # what several methods need is compiled before threads start; corners come last, where cells are bad most often
        several = study.method == "auto" or "method" in study.axes
        for index in dict.fromkeys((last // 2, 0, last) if several else (last // 2,)):
            Guard(solver).solve(index, empty_cells(study, 1))
        sample = take_sample(solver, columns(study), last + 1, clock)
        return sample if study.summary is None else replace(sample, costs=sample.costs + seconds_a_cell(study))


def take_sample(solver: SolveCells, columns: Sequence[Column], size: int, clock: Callable[[], float]) -> Sample:
    """Times a few cells at up to 64 places of the grid, in a few hundredths of a second or a hundredth of the run.

    A probe has few enough cells for 64 of them in the budget, and enough to see past the cost of a call. Probes that
    fail are left out. Raises what the kernel does where single cells fail all over the grid.
    """
    faults, made = list[Exception](), dict[tuple[int, int], float]()

    def probe(start: int, cells: int) -> float:
        """Seconds of so many cells, the least so far; infinity where the kernel fails. What is dear is done once."""
        before = made.get((start, cells))
        if before is None or before < STALL:
            arrays, begun = empty(columns, cells), clock()
            try:
                solver.solve(start, arrays)
                made[start, cells] = min(before or math.inf, clock() - begun)
            except (SweepError, MemoryError):
                raise
            except Exception as fault:
                faults.append(fault)
                made[start, cells] = math.inf
        return made[start, cells]

    def anywhere(cells: int) -> float:
        """Seconds that some cells in the middle of the grid take, or elsewhere where these fail."""
        found = (probe(start, cells) for start in _places(size, PLACES, cells))
        return next((seconds for seconds in found if seconds < math.inf), math.inf)

    alone = anywhere(1)
    if alone == math.inf:
        raise faults[-1]
    if alone < STALL:  # what is met for the first time matters in it
        alone = anywhere(1)
    cells, lanes = 1, False
    if size > 1 and alone > PROBE_SECONDS:
        # where two cells take as long as one, as many as lanes will
        lanes = anywhere(2) < 1.5 * alone
        cells = max(1, min(LANES, size // 4)) if lanes else 1
    else:
        taken, more = alone, LANES
        while (cells == 1 or taken <= PROBE_SECONDS) and size >= (4 if cells == 1 else POSITIONS) * more:
            cells, taken, more = more, anywhere(more), 4 * more
            if taken > PROBE_SECONDS:
                taken = anywhere(cells)
    probes = {start: seconds for (start, n), seconds in made.items() if n == cells and DEAR <= seconds < math.inf}
    spent = sum(probes.values())
    for start in _places(size, max(1, min(POSITIONS, size // (4 * cells))), cells):
        run = spent / (len(probes) * cells) * size if probes else math.inf
        if start in probes or (probes and spent > max(BUDGET[0], min(BUDGET[1], run / 100), SHARE * run)):
            continue
        seconds = probe(start, cells)
        spent += DEAR if seconds == math.inf else seconds
        probes |= {start: seconds} if seconds < math.inf else {}
    probes = probes or {0: alone * cells}
    costs = np.array([probes[start] / cells for start in sorted(probes)])
    return Sample(np.array(sorted(probes)), costs, lanes, max(0.0, alone - float(np.min(costs))))


def _places(size: int, count: int, cells: int) -> list[int]:
    """First cells of probes, from the middle on, so that every beginning of the list is spread over the grid."""
    order = np.argsort((np.arange(count) - count // 2) * GOLDEN % 1.0)
    middles = (2 * order + 1) * size // (2 * count)
    return list(map(int, np.clip(middles - cells // 2, 0, size - cells)))


def block_cells(sample: Sample, size: int, cell_bytes: float, workers: int, least: float = 0.0) -> int:
    """Cells of a block: 1/200 of each worker's share, within bounds of time (`least` seconds), bytes and number."""
    cost, (shortest, longest) = max(sample.cost, 1e-12), BLOCK_SECONDS
    seconds = max(cost * size / (200 * workers), shortest, least)
    # by the cheapest probe: on a busy machine some take ten times as long as they should, and blocks would be short
    worth_a_call = CALLS * sample.call / max(float(np.min(sample.costs)), 1e-12)
    share = size / (1 if workers == 1 else LEAST_BLOCKS * workers)
    cells = min(max(seconds / cost, min(worth_a_call, share)), longest / cost, BLOCK_BYTES / cell_bytes, size)
    if sample.lanes:
        cells = max(cells, min(LANES, math.ceil(size / workers)))
    cells = max(1, math.floor(cells), -(-size // MOST_BLOCKS))
    return min(cells if cells < LANES else -(-cells // LANES) * LANES, size)


def cut(study: Study, workers: int, sample: Sample, wanted: int | None = None, least: float = 0.0) -> Partition:
    """Blocks of about so many cells; by default of what a timed sample tells for so many workers, `least` seconds."""
    rows, lanes = row_blocks(study), 1
    shape = Grid(study).shape if study.summary is None else (rows.count,)
    if wanted is None:
        row_bytes = sum(column.cell_bytes for column in part_columns(study))
        wanted = block_cells(sample, rows.size, row_bytes / rows.mean, workers, least)
        lanes = LANES if rows.mean == 1 else 1
    return boxes(shape, math.ceil(wanted / rows.mean), lanes)


class WorkClock:
    """Seconds of this process in which numba neither compiled, nor loaded what it has compiled before, in any thread.

    Attributes
    ----------
    flag : number with a `value`
        How many compilations, one for another, are going on; others may look at it.
    compiled : float
        Seconds that were spent on those.
    """

    def __init__(self) -> None:
        self.flag: Any = SimpleNamespace(value=0)
        self.compiled, self._begun, self._lock, self._watched = 0.0, 0.0, threading.Lock(), False

    def __call__(self) -> float:
        event: Any = sys.modules.get("numba.core.event")
        if event is not None and not self._watched:
            steps = {"on_start": lambda *_: self._step(1), "on_end": lambda *_: self._step(-1)}
            event.register("numba:compiler_lock", type("Listener", (event.Listener,), steps)())
            self._watched = True
        with self._lock:
            return (self._begun if self.flag.value else time.perf_counter()) - self.compiled

    def _step(self, by: int) -> None:
        """A compilation begins, or ends."""
        with self._lock:
            now = time.perf_counter()
            self._begun = self._begun if self.flag.value else now
            self.flag.value = max(0, self.flag.value + by)  # one may end that began before it was watched
            self.compiled += 0.0 if self.flag.value else now - self._begun


work_clock = WorkClock()
"""CPU clock of this process."""
