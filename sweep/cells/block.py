"""A study cut into blocks of rows, how one of them is computed, and what a timed sample says of all."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from sweep.cells.compiling import Compiling
from sweep.cells.output_schema import part_columns
from sweep.cells.partition import Partition, row_blocks
from sweep.cells.reduce import Reducer
from sweep.cells.schema import ANCILLARY, ERROR_BOUND, METHOD_USED, STATUS, columns
from sweep.cells.timing import Sample, take_sample
from sweep.system.errors import SweepError

if TYPE_CHECKING:
    from sweep.study.model import Study

SolveBlock = Callable[[int, int, Mapping[str, Any], Any], None]
Found = str | Mapping[str, Any]
"""A block that was computed elsewhere: the name of its part, or its numbers."""


@dataclass(frozen=True)
class Computed:
    """A block that an executor has computed, and the seconds it took."""

    block: int
    found: Found
    seconds: float


class Blocks:
    """The rows of a study, cut into blocks.

    Attributes
    ----------
    partition : Partition
    columns : tuple of Column
        What a block fills.
    rows : RowBlocks
        The cells of each row.
    """

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
        return self.rows.cells(*self.bounds(block))

    def label(self, block: int) -> str:
        """How a block is called in messages."""
        return "cells {} to {}".format(*self.cells(block))

    def empty(self, rows: int | None = None) -> dict[str, Any]:
        """Columns of so many rows, by default of those of the largest block."""
        count = min(self.partition.cells, self.partition.size) if rows is None else rows
        return {column.name: column.empty(count) for column in self.columns}


def block_solver(study: Study) -> SolveBlock:
    """Computes rows into the columns of a part; of cells, only those wanted (None: all). For one thread at a time."""
    if study.summary is not None:
        reducer = Reducer(study)
        return lambda start, stop, arrays, wanted: reducer.solve(start, stop, arrays)
    from sweep.cells.solve import Solver

    solver = Solver(study)

    def solve(start: int, stop: int, arrays: Mapping[str, Any], wanted: Any) -> None:
        outputs = {name: array for name, array in arrays.items() if name not in ANCILLARY}
        solver.solve(start, stop, outputs, arrays[STATUS], arrays[METHOD_USED], wanted, arrays[ERROR_BOUND])

    return solve


def sampled_study(study: Study, compiling: Compiling | None = None) -> Sample:
    """Compiles the kernel and times a sample of the grid. Raises SweepError where the kernel fails."""
    from sweep.cells.solve import Solver

    compiling = compiling or Compiling(study.kernel, study.kernel_name)
    with faults_reported(f"{study.kernel_name}: the kernel failed"):
        solver = Solver(replace(study, kernel=compiling.kernel))
        solver.warm()
        sample = take_sample(solver, columns(study), row_blocks(study).size)
        if study.summary is not None:
            sample = replace(sample, costs=sample.costs + Reducer(study).seconds())
        compiling.remember()
        return sample


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
        raise SweepError(f"{what} ({type(fault).__name__}: {fault}); what is finished is kept") from fault
