"""Solves runs of cells: checks them, chooses their methods, and says what became of each.

A cell that `check` refuses is never solved. With a method given, the cell is solved by it and remarked INACCURATE,
whatever else is special about it, where the method's bound exceeds rtol. With `auto` it goes to the first method,
cheapest first, whose bound meets rtol, and on to the next where that one gives up or says INACCURATE.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels.interface import FIRST_REFUSAL, Method, Status
from sweep.cells.grid import Grid
from sweep.study.model import AUTO, Study

STRIP = 16384
"""Cells solved at a time: their columns, where outputs are numbers, stay in the processor's cache."""
STRIP_BYTES = 16 << 20
"""Bytes that the outputs of a strip may take, where they are traces."""
NONE = -1
"""In place of a method's number: no method solved the cell."""
GIVEN_UP = (
    Status.NO_METHOD,
    Status.NO_CYCLE,
    Status.NOT_CONVERGED,
    Status.STEP_LIMIT,
    Status.INACCURATE,
    Status.UNSTABLE,
)
"""After these `auto` tries the next method."""
WARM_UP_CELLS = 3

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]
Cells = slice | NDArray[np.intp]


class Solver:
    """Solves cells of one study, for one thread at a time; its buffers are made once.

    Parameters
    ----------
    study : Study
    """

    def __init__(self, study: Study) -> None:
        self.study, self.grid = study, Grid(study)
        self.usable = usable_methods(study)
        kernel = study.kernel
        lengths = study.lengths
        shapes = {field.name: tuple(lengths[d] for d in field.dims) for field in (*kernel.parameters, *kernel.outputs)}
        cell_bytes = sum(8 * math.prod(shapes[field.name]) for field in kernel.outputs)
        room = self._strip = max(1, min(STRIP, self.grid.size, STRIP_BYTES // cell_bytes))
        self._parameters = [np.empty((room, *shapes[field.name])) for field in kernel.parameters]
        for k, value in self.grid.constants().items():
            self._parameters[k][:] = value
        self._along = [np.array(study.along[field.name]) for field in kernel.along]
        self._unasked = {
            field.name: np.empty((room, *shapes[field.name]))
            for field in kernel.outputs
            if field.name not in study.outputs
        }
        self._asked = np.array([field.name in study.outputs for field in kernel.outputs], np.uint8)
        self._rtol, self._bound = np.empty(room), np.empty(room)

    def solve(
        self,
        start: int,
        stop: int,
        outputs: Mapping[str, Floats],
        status: Codes,
        method_used: Codes,
        wanted: NDArray[np.bool_] | None = None,
    ) -> None:
        """Fill the rows of every output asked for, and status and method number, of the cells `start` to `stop`.

        Parameters
        ----------
        start, stop : int
            Flat cell numbers of the grid.
        outputs : mapping of output name to ndarray, shape (stop - start, ...)
        status, method_used : ndarray of int8, shape (stop - start,)
            A `Status`; the position in `kernel.methods`, or -1 where the cell is refused.
        wanted : ndarray of bool, optional
            Cells to solve; what comes out for the others means nothing. Default: all.
        """
        for low in range(start, stop, self._strip):
            high = min(low + self._strip, stop)
            rows = slice(low - start, high - start)
            if wanted is not None and not wanted[rows].any():
                continue
            columns = [
                outputs[f.name][rows] if f.name in outputs else self._unasked[f.name][: high - low]
                for f in self.study.kernel.outputs
            ]
            some = None if wanted is None or wanted[rows].all() else wanted[rows]
            self._solve_strip(low, high, columns, status[rows], method_used[rows], some)

    def warm(self) -> None:
        """Solve a few cells spread over the grid: what they need is compiled before threads start."""
        outputs = {name: np.empty((1, *shape)) for name, shape in self._shapes().items()}
        status, used = np.empty(1, np.int8), np.empty(1, np.int8)
        for index in np.unique(np.linspace(0, self.grid.size - 1, WARM_UP_CELLS).astype(np.int64)):
            self.solve(int(index), int(index) + 1, outputs, status, used)

    def _shapes(self) -> dict[str, tuple[int, ...]]:
        return {f.name: tuple(self.study.lengths[d] for d in f.dims) for f in self.study.asked}

    def _solve_strip(
        self,
        low: int,
        high: int,
        outputs: Sequence[Floats],
        status: Codes,
        used: Codes,
        wanted: NDArray[np.bool_] | None,
    ) -> None:
        strip = _Strip(self, high - low, outputs, status, used)
        self.grid.columns(low, high, strip.parameters)
        self.study.kernel.check(*strip.parameters, status)
        used.fill(NONE)
        method, strip.rtol[:] = self.grid.settings(low, high)
        sound = status < FIRST_REFUSAL
        allowed = _pick(slice(0, high - low), sound if wanted is None else sound & wanted)
        codes = [method] if isinstance(method, int) else np.unique(method)
        for code in codes:
            cells = allowed if isinstance(method, int) else _pick(allowed, method[allowed] == code)
            strip.choose(cells) if code == AUTO else strip.take(int(code), cells)
        refused = status >= FIRST_REFUSAL
        if refused.any():
            used[refused] = NONE
            for column in outputs:
                column[refused] = np.nan


class _Strip:
    """The columns of one strip of cells."""

    def __init__(self, solver: Solver, n: int, outputs: Sequence[Floats], status: Codes, used: Codes) -> None:
        self.kernel, self.along, self.asked = solver.study.kernel, solver._along, solver._asked
        self.parameters = [column[:n] for column in solver._parameters]
        self.rtol, self._bound = solver._rtol[:n], solver._bound[:n]
        self.outputs, self.status, self.used = outputs, status, used
        self.usable = solver.usable

    def take(self, number: int, cells: Cells) -> None:
        """Solve the cells by one method; remark those for which it promises less than rtol."""
        method = self.kernel.methods[number]
        self.run(number, cells)
        if method.bound is not None and _count(cells):
            loose = ~(self.bound(method, cells) <= self.rtol[cells])  # NaN is loose
            self.status[_pick(cells, loose & (self.status[cells] < FIRST_REFUSAL))] = Status.INACCURATE

    def choose(self, cells: Cells) -> None:
        """Solve each cell by the first method whose bound meets rtol and which does not give up."""
        self.status[cells] = Status.NO_METHOD
        for number in self.usable:
            if not _count(cells):
                return
            method = self.kernel.methods[number]
            meets = None if method.bound is None else self.bound(method, cells) <= self.rtol[cells]
            self._improve(number, cells if meets is None else _pick(cells, meets))
            cells = _pick(cells, np.isin(self.status[cells], GIVEN_UP))

    def _improve(self, number: int, cells: Cells) -> None:
        """Run a method, but keep values of an earlier one in cells where this one is not better."""
        columns: list[NDArray[Any]] = [*self.outputs, self.status, self.used]
        usable = _pick(cells, self.status[cells] < FIRST_REFUSAL)
        kept = [column[usable].copy() for column in columns] if _count(usable) else []
        before = self.status[usable].copy()
        self.run(number, cells)
        if kept:
            now = self.status[usable]
            worse = (now >= FIRST_REFUSAL) | ((now == before) & (now == Status.INACCURATE))
            back = _pick(usable, worse)
            for column, values in zip(columns, kept, strict=True):
                column[back] = values[worse]

    def bound(self, method: Method, cells: Cells) -> Floats:
        """The method's error bound for the cells, over the outputs asked for."""
        assert method.bound is not None
        out = self._bound[: _count(cells)]
        columns = [column[cells] for column in (*self.parameters, self.rtol)]
        method.bound(*columns, *self.along, self.asked, out)
        return out

    def run(self, number: int, cells: Cells) -> None:
        """Solve the cells by one method: in place where they lie side by side, else gathered and put back."""
        if not _count(cells):
            return
        columns = [column[cells] for column in (*self.parameters, self.rtol)]
        targets: list[NDArray[Any]] = [*self.outputs, self.status]
        results = [column[cells] for column in targets]
        self.kernel.methods[number].solve(*columns, *self.along, *results)
        if not isinstance(cells, slice):
            for column, result in zip(targets, results, strict=True):
                column[cells] = result
        self.used[cells] = number


def usable_methods(study: Study) -> tuple[int, ...]:
    """Numbers of the methods that can do every term the study sets and give every output it asks for."""
    methods = enumerate(study.kernel.methods)
    return tuple(
        number
        for number, method in methods
        if study.terms.isdisjoint(method.excludes) and set(study.outputs).isdisjoint(method.lacks)
    )


def _pick(cells: Cells, condition: NDArray[np.bool_]) -> Cells:
    """Those of the cells for which the condition holds; a slice where they lie side by side."""
    hits = np.flatnonzero(condition)
    if hits.size == condition.size:
        return cells
    if not isinstance(cells, slice):
        chosen: NDArray[np.intp] = cells[hits]
        return chosen
    if hits.size and hits[-1] - hits[0] + 1 == hits.size:
        return slice(cells.start + int(hits[0]), cells.start + int(hits[-1]) + 1)
    shifted: NDArray[np.intp] = hits + int(cells.start)
    return shifted


def _count(cells: Cells) -> int:
    return cells.stop - cells.start if isinstance(cells, slice) else cells.size
