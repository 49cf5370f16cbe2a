"""From axes to cells: flat cell numbers and the columns a kernel takes.

Cells are numbered in C order: the last axis runs fastest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sweep.cells.schema import Columns
from sweep.study.condition import cells_where
from sweep.study.model import AUTO, SETTINGS, Study

Floats = NDArray[np.float64]


class Grid:
    """The cells of a study: lengths of the dimensions, and the number of cells.

    `varying` names the axis of every column that varies, by the column's number.
    """

    def __init__(self, study: Study) -> None:
        self.study, self.shape = study, tuple(study.grid_shape.values())
        self.size = math.prod(self.shape)
        self._runs = {name: study.run(name) for name in study.axes}
        sources = enumerate(study.follows.get(field.name, field.name) for field in study.kernel.parameters)
        self.varying = {place: name for place, name in sources if name in study.axes}

    def constants(self) -> dict[int, float | Floats]:
        """Column number and value of every parameter that is the same in all cells."""
        fixed = self.study.fixed
        return {k: fixed[field.name] for k, field in enumerate(self.study.kernel.parameters) if field.name in fixed}

    def columns(self, start: int, stop: int, out: Sequence[Floats]) -> None:
        """Write the varying parameters of the cells `start` to `stop` into columns, one per parameter of the kernel."""
        for place, name in self.varying.items():
            out[place][: stop - start] = self.column(name, start, stop)

    def column(self, name: str, start: int, stop: int) -> Floats:
        """An axis' values in the cells `start` to `stop`: each in a run of cells, and behind the last one the first."""
        values, run = self.study.axes[name].values, self._runs[name]
        first, last = start // run, max(stop - 1, start) // run
        begin, count = first % len(values), last + 1 - first
        found: Floats = values[begin : begin + count]
        if (more := count - len(found)) > 0:
            turns = (-(-more // len(values)), *[1] * (values.ndim - 1))
            found = np.concatenate([found, np.tile(values, turns)[:more]])
        if run == 1:
            return found
        lengths = np.full(count, run)
        lengths[-1] = stop - last * run
        lengths[0] -= start - first * run
        return np.repeat(found, lengths, axis=0)

    def values(self, name: str, cells: NDArray[np.int64]) -> Floats:
        """An axis' values of some flat cells."""
        axis = self.study.axes[name]
        found: Floats = axis.values[cells // self._runs[name] % len(axis)]
        return found

    def asked(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of some flat cells the study's condition holds for."""
        study, settings = self.study, [name for name in SETTINGS if name in self.study.axes]
        if not study.where:
            return np.ones(len(cells), bool)

        def numbers(name: str) -> Floats:
            source = study.follows.get(name, name)
            return self.values(source, cells) if source in study.axes else np.full(len(cells), study.fixed[name])

        holds: NDArray[np.bool_] = cells_where(study.where, study.kernel, settings, numbers)
        return holds

    def settings(self, start: int, stop: int) -> tuple[int | NDArray[np.int8], float | Floats]:
        """Method number (-1: auto) and rtol of the cells: one for all, or where it is an axis one per cell."""
        names = ["auto", *(method.name for method in self.study.kernel.methods)]
        method: int | NDArray[np.int8] = AUTO + names.index(self.study.method)
        if "method" in self.study.axes:
            method = self.column("method", start, stop).astype(np.int8)
        return method, self.column("rtol", start, stop) if "rtol" in self.study.axes else self.study.rtol

    def cell(self, index: int) -> dict[str, str]:
        """The axes' values of one cell, as people write them: {"mu": "0.9", "method": "closed"}."""
        return {name: axis.label(index // self._runs[name] % len(axis)) for name, axis in self.study.axes.items()}


class SolveCells(Protocol):
    """What `Solver` does, here or in a process of its own."""

    grid: Grid

    def solve(self, start: int, cells: Columns, wanted: Any = None) -> None:
        """Fills the columns of the cells from number `start` on. Raises what the kernel does."""
