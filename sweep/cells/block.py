"""A study cut into blocks of rows, how one of them is computed, and what a timed sample says of all.

A bad cell costs one cell: what makes a kernel raise, die or run for ever is found by halving, and FAILED.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kernels.interface import Status
from sweep.cells.grid import Cells, Grid, SolveCells, empty_cells
from sweep.cells.partition import Partition, boxes, row_blocks
from sweep.cells.reduce import Reducer, part_columns, seconds_a_cell
from sweep.cells.schema import cells_of, columns
from sweep.cells.solve import NONE, Solver
from sweep.cells.timing import LANES, Sample, block_cells, take_sample, work_clock
from sweep.errors import SweepError
from sweep.study.model import Study


def cut(study: Study, workers: int, sample: Sample, wanted: int | None = None, least: float = 0.0) -> Partition:
    """Blocks of about so many cells; by default of what a timed sample tells for so many workers, `least` seconds."""
    rows, lanes = row_blocks(study), 1
    shape = Grid(study).shape if study.summary is None else (rows.count,)
    if wanted is None:
        row_bytes = sum(column.cell_bytes for column in part_columns(study))
        wanted = block_cells(sample, rows.size, row_bytes / rows.mean, workers, least)
        lanes = LANES if rows.mean == 1 else 1
    return boxes(shape, math.ceil(wanted / rows.mean), lanes)


def sampled_study(study: Study, apart: SolveCells | None = None, clock: Callable[[], float] | None = None) -> Sample:
    """Compiles the kernel and times a sample of the grid, here or `apart`, by a clock of its own.

    Raises SweepError where the kernel always fails.
    """
    solver, clock = apart or Solver(study), clock or work_clock
    clock()  # it counts what is compiled from now on
    with faults_reported(f"{study.kernel_name}: the kernel failed"):
        warm(solver, study)
        sample = take_sample(solver, columns(study), Grid(study).size, clock)
        return sample if study.summary is None else replace(sample, costs=sample.costs + seconds_a_cell(study))


def warm(solver: SolveCells, study: Study) -> None:
    """Solves a cell, or by several methods some spread over the grid: what they need is compiled before threads start.

    Corners come last, where cells are bad most often.
    """
    last = Grid(study).size - 1
    several = study.method == "auto" or "method" in study.axes
    for index in dict.fromkeys((last // 2, 0, last) if several else (last // 2,)):
        Guard(solver, lambda cell: None).solve(index, empty_cells(study, 1))


@contextlib.contextmanager
def faults_reported(what: str) -> Iterator[None]:
    """Every fault as a SweepError of one line."""
    try:
        yield
    except SweepError:
        raise
    except MemoryError as fault:
        raise SweepError("out of memory; fewer workers need less; what is finished is kept") from fault
    except Exception as fault:
        raise SweepError(f"{what} ({told(fault)}); what is finished is kept") from fault


class Unsolved(Exception):
    """What became of cells; its text is the whole reason."""


@dataclass(frozen=True)
class BadCell:
    """A cell that FAILED: its number, its values on the axes, and what the kernel did."""

    cell: int
    values: Mapping[str, str]
    reason: str

    def __str__(self) -> str:
        values = " ".join(f"{name}={value}" for name, value in self.values.items())
        return f"cell {self.cell} FAILED ({values}): {self.reason}"


class Guard:
    """Solves cells as a solver does, but never fails because of one.

    Parameters
    ----------
    solver : SolveCells
    report : callable
        Told of every cell that FAILED.
    """

    def __init__(self, solver: SolveCells, report: Callable[[BadCell], None]) -> None:
        self._solver, self._report, self.grid = solver, report, solver.grid

    def solve(self, start: int, cells: Cells, wanted: Any = None) -> None:
        """As `Solver.solve`; of cells with which it raises, each half is tried. Raises SweepError, MemoryError."""
        if wanted is not None and not wanted.any():
            return
        try:
            self._solver.solve(start, cells, wanted)
            return
        except (SweepError, MemoryError):
            raise
        except Exception as fault:
            reason = told(fault)
        if cells.number > 1:
            middle = cells.number // 2
            for rows in (slice(0, middle), slice(middle, cells.number)):
                self.solve(start + rows.start, cells.rows(rows), None if wanted is None else wanted[rows])
            return
        for column in cells.columns:
            if column.dtype.kind == "f":
                column.fill(np.nan)
        cells.status.fill(Status.FAILED)
        cells.used.fill(NONE)
        self._report(BadCell(start, self.grid.cell(start), reason))


Found = bytes | Mapping[str, Any] | None
"""A block that is still to be put where those of the run go: digests of what a worker has written, or its numbers."""


@dataclass(frozen=True)
class Done:
    """A block that is computed, the seconds it took, its cells that FAILED, and what is still to be put."""

    block: int
    seconds: float
    bad: Sequence[BadCell] = ()
    found: Found = None


class Bench:
    """A study cut into blocks of rows, which are computed here, in any thread, or `apart`.

    `partition` is how the rows are cut, `columns` are what they fill, `rows` the cells of each.
    """

    def __init__(self, study: Study, partition: Partition, apart: SolveCells | None = None) -> None:
        self.study, self.partition, self._apart = study, partition, apart
        self.columns, self.rows, self._here = part_columns(study), row_blocks(study), threading.local()

    @property
    def row_bytes(self) -> int:
        """Bytes of one row over all columns."""
        return sum(column.cell_bytes for column in self.columns)

    def cells(self, block: int) -> tuple[int, int]:
        """The cells of a block."""
        return self.rows.bounds(*self.partition.bounds(block))

    def label(self, block: int) -> str:
        """How a block is called in messages."""
        return "cells {} to {}".format(*self.cells(block))

    def empty(self, rows: int) -> dict[str, Any]:
        """Columns of so many rows."""
        return {column.name: column.empty(rows) for column in self.columns}

    def compute(
        self, block: int, put: Callable[[int, Any], Found], wanted: Any = None, room: Mapping[str, Any] | None = None
    ) -> Done:
        """Computes a block; of its cells only those wanted, by default all. Raises SweepError.

        `put` takes its columns, and gives what is still to be put. They are in `room`, or in this thread's own.
        """
        here, (start, stop) = self._here, self.partition.bounds(block)
        with faults_reported(f"{self.label(block)} cannot be computed or kept"):
            if not hasattr(here, "guard"):
                here.bad, here.columns = [], {}
                here.guard = Guard(self._apart or Solver(self.study), here.bad.append)
                here.reducer = None if self.study.summary is None else Reducer(self.study, here.guard)
            here.bad.clear()
            begun = time.perf_counter()
            if room is None:  # new columns cost more than a cheap kernel
                here.columns = here.columns or self.empty(min(self.partition.cells, self.partition.size))
                room = {name: column[: stop - start] for name, column in here.columns.items()}
            if here.reducer is None:
                here.guard.solve(start, cells_of(room), wanted)
            else:
                here.reducer.solve(start, stop, room)
            found = put(block, room)
            return Done(block, time.perf_counter() - begun, [*here.bad], found)


def told(fault: BaseException) -> str:
    """What a fault says, in one line."""
    if isinstance(fault, Unsolved):
        return str(fault)
    try:
        text = str(fault)
    except Exception:  # a kernel's own exception may fail in its __str__
        text = ""
    return " ".join(f"{type(fault).__name__}: {text}".split()).removesuffix(":")
