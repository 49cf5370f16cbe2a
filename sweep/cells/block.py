"""A study cut into blocks of rows, how one of them is computed, and what a timed sample says of all."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sweep.cells.compiling import Compiling, work_clock
from sweep.cells.grid import Grid, empty_cells
from sweep.cells.guard import told
from sweep.cells.output_schema import part_columns
from sweep.cells.partition import Partition, row_blocks
from sweep.cells.reduce import Reducer, seconds_a_cell
from sweep.cells.schema import cells_of, columns
from sweep.cells.timing import Sample, take_sample, tolerated
from sweep.errors import SweepError

if TYPE_CHECKING:
    from sweep.cells.guard import SolveCells
    from sweep.study.model import Study

SolveBlock = Callable[[int, int, Mapping[str, Any], Any], None]


class Blocks:
    """The rows of a study, cut into blocks: their `partition`, the `columns` they fill, the cells of each of `rows`."""

    def __init__(self, study: Study, partition: Partition) -> None:
        self.partition, self.columns, self.rows = partition, part_columns(study), row_blocks(study)

    @property
    def count(self) -> int:
        """Number of blocks."""
        return self.partition.count

    @property
    def row_bytes(self) -> int:
        """Bytes of one row over all columns."""
        return sum(column.cell_bytes for column in self.columns)

    def bounds(self, block: int) -> tuple[int, int]:
        """The rows of a block."""
        return self.partition.bounds(block)

    def cells(self, block: int) -> tuple[int, int]:
        """The cells of a block."""
        return self.rows.bounds(*self.bounds(block))

    def label(self, block: int) -> str:
        """How a block is called in messages."""
        return "cells {} to {}".format(*self.cells(block))

    def empty(self, rows: int | None = None) -> dict[str, Any]:
        """Columns of so many rows, by default of those of the largest block."""
        count = min(self.partition.cells, self.partition.size) if rows is None else rows
        return {column.name: column.empty(count) for column in self.columns}


def row_shape(study: Study) -> tuple[int, ...]:
    """The shape in which the rows of a study stand: that of its grid, or of a summary one line."""
    return Grid(study).shape if study.summary is None else (row_blocks(study).count,)


def block_solver(study: Study, solver: SolveCells | None = None) -> SolveBlock:
    """Computes rows into the columns of a block; of cells, only those wanted (None: all). For one thread at a time."""
    from sweep.cells.solve import Solver

    solver = solver or Solver(study)
    if study.summary is not None:
        reducer = Reducer(study, solver)
        return lambda start, stop, arrays, wanted: reducer.solve(start, stop, arrays)
    return lambda start, stop, arrays, wanted: solver.solve(start, cells_of(arrays), wanted)


def sampled_study(study: Study, compiling: Compiling | None = None) -> Sample:
    """Compiles the kernel and times a sample of the grid. Raises SweepError where the kernel always fails."""
    from sweep.cells.solve import Solver

    compiling = compiling or Compiling(study.kernel, study.kernel_name)
    sample = sampled_by(Solver(replace(study, kernel=compiling.kernel)), study, work_clock)
    compiling.remember()
    return sample


def sampled_by(solver: SolveCells, study: Study, clock: Callable[[], float]) -> Sample:
    """A timed sample of the grid, by the seconds of a clock. Raises SweepError where the kernel always fails."""
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
        with tolerated():
            solver.solve(index, empty_cells(study, 1))


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
