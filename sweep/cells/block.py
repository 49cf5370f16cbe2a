"""Division of a study into blocks of rows, and computation of a block.

A cell that makes a kernel raise, crash or run for ever is found by bisection of the block, and is FAILED.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kernels.interface import Status
from sweep.cells.grid import SolveCells
from sweep.cells.partition import Partition, row_blocks
from sweep.cells.reduce import Reducer, part_columns
from sweep.cells.schema import METHOD_USED, STATUS, Columns, empty, part
from sweep.cells.solve import NONE, Solver
from sweep.errors import SweepError
from sweep.study.model import Study
from sweep.words import printable

MOST_LETTERS = 500
"""Letters of an error message that are reported; the rest may be a whole array."""


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

    def __init__(self, solver: SolveCells, report: Callable[[BadCell], None] = lambda cell: None) -> None:
        self._solver, self._report, self.grid = solver, report, solver.grid

    def solve(self, start: int, cells: Columns, wanted: Any = None) -> None:
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
        if (number := len(cells[STATUS])) > 1:
            for rows in (slice(0, number // 2), slice(number // 2, number)):
                self.solve(start + rows.start, part(cells, rows), None if wanted is None else wanted[rows])
            return
        for column in cells.values():
            if column.dtype.kind == "f":
                column.fill(np.nan)
        cells[STATUS].fill(Status.FAILED)
        cells[METHOD_USED].fill(NONE)
        self._report(BadCell(start, self.grid.cell(start), reason))


Found = bytes | Columns | None
"""A computed block that is not stored yet: digests of what a worker has written, or its numbers."""


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

    def compute(
        self, block: int, put: Callable[[int, Any], Found], wanted: Any = None, room: Columns | None = None
    ) -> Done:
        """Computes a block; of its cells only those wanted, by default all. Raises SweepError.

        `put` takes its columns, and gives what is still to be put. They are in `room`, or in this thread's own.
        """
        here, (start, stop) = self._here, self.partition.bounds(block)
        with faults_reported(f"{self.label(block)} cannot be computed or kept"):
            if not hasattr(here, "solver"):
                here.bad, here.columns = [], {}
                guard = Guard(self._apart or Solver(self.study), here.bad.append)
                here.solver = guard if self.study.summary is None else Reducer(self.study, guard)
            here.bad.clear()
            begun = time.perf_counter()
            if room is None:  # new columns cost more than a cheap kernel
                here.columns = here.columns or empty(self.columns, min(self.partition.cells, self.partition.size))
                room = part(here.columns, slice(stop - start))
            here.solver.solve(start, room, wanted)
            found = put(block, room)
            return Done(block, time.perf_counter() - begun, [*here.bad], found)


def told(fault: BaseException) -> str:
    """What a fault says, in one line that any terminal can show, without what is beyond MOST_LETTERS."""
    if isinstance(fault, Unsolved):
        return str(fault)
    try:
        text = str(fault)
    except Exception:  # a kernel's own exception may fail in its __str__
        text = ""
    text = printable(" ".join(f"{type(fault).__name__}: {text}".split()).removesuffix(":"))
    return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]} ..."
