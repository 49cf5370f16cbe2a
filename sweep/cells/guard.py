"""A bad cell costs one cell: what makes a kernel raise, die or run for ever is found by halving, and FAILED."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from kernels.interface import Status
from sweep.cells.solve import NONE
from sweep.system.errors import SweepError

if TYPE_CHECKING:
    from sweep.cells.grid import Grid


class SolveCells(Protocol):
    """What `Solver` does, here or in a process of its own."""

    grid: Grid

    def solve(
        self,
        start: int,
        stop: int,
        outputs: Mapping[str, Any],
        status: Any,
        method_used: Any,
        wanted: Any = None,
        error_bound: Any = None,
    ) -> None:
        """Fills the rows of the cells `start` to `stop`. Raises what the kernel does."""


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

    def solve(
        self,
        start: int,
        stop: int,
        outputs: Mapping[str, Any],
        status: Any,
        method_used: Any,
        wanted: Any = None,
        error_bound: Any = None,
    ) -> None:
        """As `Solver.solve`; of cells with which it raises, each half is tried. Raises SweepError, MemoryError."""
        if wanted is not None and not wanted.any():
            return
        try:
            self._solver.solve(start, stop, outputs, status, method_used, wanted, error_bound)
            return
        except (SweepError, MemoryError):
            raise
        except Exception as fault:
            reason = told(fault)
        if stop - start > 1:
            middle = (stop - start) // 2
            for rows in (slice(0, middle), slice(middle, stop - start)):
                some = {name: column[rows] for name, column in outputs.items()}
                others = [None if column is None else column[rows] for column in (wanted, error_bound)]
                self.solve(start + rows.start, start + rows.stop, some, status[rows], method_used[rows], *others)
            return
        for column in [*outputs.values(), *([] if error_bound is None else [error_bound])]:
            column.fill(np.nan)
        status.fill(Status.FAILED)
        method_used.fill(NONE)
        self._report(BadCell(start, self.grid.cell(start), reason))


def told(fault: BaseException) -> str:
    """What a fault says, in one line."""
    if isinstance(fault, Unsolved):
        return str(fault)
    return " ".join(f"{type(fault).__name__}: {fault}".split()).removesuffix(":")
