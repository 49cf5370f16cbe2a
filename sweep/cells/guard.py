"""A bad cell costs one cell: what makes a kernel raise, die or run for ever is found by halving, and FAILED."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from kernels.interface import Status
from sweep.cells.solve import NONE
from sweep.errors import SweepError

if TYPE_CHECKING:
    from sweep.cells.grid import Cells, Grid


class SolveCells(Protocol):
    """What `Solver` does, here or in a process of its own."""

    grid: Grid

    def solve(self, start: int, cells: Cells, wanted: Any = None) -> None:
        """Fills the columns of the cells from number `start` on. Raises what the kernel does."""


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
        for column in [*cells.outputs.values(), *([] if cells.error is None else [cells.error])]:
            column.fill(np.nan)
        cells.status.fill(Status.FAILED)
        cells.used.fill(NONE)
        self._report(BadCell(start, self.grid.cell(start), reason))


def told(fault: BaseException) -> str:
    """What a fault says, in one line."""
    if isinstance(fault, Unsolved):
        return str(fault)
    try:
        text = str(fault)
    except Exception:  # a kernel's own exception may fail in its __str__
        text = ""
    return " ".join(f"{type(fault).__name__}: {text}".split()).removesuffix(":")
