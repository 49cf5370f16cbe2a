"""Solves runs of cells: checks them, chooses their methods, and says what became of each.

A cell that the study's condition leaves out, or that `check` refuses, is never solved. With a method given, the cell
is solved by it and remarked INACCURATE, whatever else is special about it, where the method's bound or estimate
exceeds rtol. With `auto` it goes to the first method, cheapest first, that can do its terms and whose bound meets rtol,
and on to the next where that one gives up or says INACCURATE. Where none meets rtol, the values of the smallest bound
are given, INACCURATE. A later method replaces only what it betters. Where a kernel of somebody's own says OK without a
number, or a status that a kernel has not got, the cell FAILED.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels import catalogue
from kernels.interface import FIRST_REFUSAL, UNSOLVED, Method, Status
from sweep.cells.grid import Cells, Grid
from sweep.cells.turns import Absent, Turn, turns
from sweep.study.model import AUTO, Study

STRIP = 16384
"""Cells solved at a time: their columns, where outputs are numbers, stay in the processor's cache."""
STRIP_BYTES = 16 << 20
"""Bytes that the outputs of a strip may take, where they are traces."""
NONE = -1
"""In place of a method's number: no method solved the cell."""


def _these(*statuses: Status) -> bytes:
    """Statuses as `among` takes them: a table, since `choose` asks it of every cell."""
    return bytes(code in statuses for code in range(256))


GIVEN_UP = _these(
    *UNSOLVED,
    Status.NO_CYCLE,
    Status.INACCURATE,
    Status.UNSTABLE,
    Status.FAILED,
)
"""After these `auto` tries the next method."""
NO_STATUS = bytes(code not in map(int, Status) or code >= Status.NOT_ASKED for code in range(256))
"""What a kernel must not say."""
NO_METHOD, INACCURATE = np.int8(Status.NO_METHOD), np.int8(Status.INACCURATE)
"""Not as a `Status`, which numpy compares ten times as slowly."""
VAGUE = _these(Status.NO_METHOD, Status.NO_CYCLE)
"""Refusals that tell less than how another method gave up."""
UNKNOWN = _these(*UNSOLVED)
"""A method that ends so has not learnt what the scene does: another's NO_CYCLE, of its own kind alone, is no answer."""

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Codes = NDArray[np.int8]
Chosen = slice | NDArray[np.intp]


class Solver:
    """Solves cells of one study, for one thread at a time; its buffers are made once.

    Parameters
    ----------
    study : Study
    grid : Grid, optional
        Where its cells come from; default: the axes of the study.
    """

    def __init__(self, study: Study, grid: Grid | None = None) -> None:
        self.study, self.grid = study, grid or Grid(study)
        self._turns = turns(study, self.grid)
        kernel = study.kernel
        shapes = {field.name: study.shape(field) for field in (*kernel.parameters, *kernel.outputs)}
        cell_bytes = sum(8 * math.prod(shapes[field.name]) for field in kernel.outputs)
        cells = self._strip = max(1, min(STRIP, self.grid.size, STRIP_BYTES // cell_bytes))
        self._parameters = [np.empty((cells, *shapes[field.name])) for field in kernel.parameters]
        constants = self.grid.constants()
        for k, value in constants.items():
            self._parameters[k][:] = value
        self._varying = [k for k in range(len(kernel.parameters)) if k not in constants]
        self._varying += [len(kernel.parameters)] if "rtol" in study.axes else []
        self._along = [np.array(study.along[field.name]) for field in kernel.along]
        self._spare: list[NDArray[Any]] = [np.empty((cells, *shapes[field.name])) for field in kernel.outputs]
        self._spare.append(np.empty(cells, np.int8))
        self._asked = np.array([field.name in study.outputs for field in kernel.outputs], np.uint8)
        self._wanted = [int(k) for k in self._asked.nonzero()[0]]
        self._rtol, self._error = np.empty(cells), np.empty(cells)
        self._promised = None if study.kernel_name in catalogue.KERNELS else promised(study)

    def solve(self, start: int, cells: Cells, wanted: NDArray[np.bool_] | None = None) -> None:
        """Fill the columns of cells.

        Parameters
        ----------
        start : int
            Flat number of the first of them in the grid.
        cells : Cells
            Columns of every output asked for, of statuses, of method numbers, and maybe of errors.
        wanted : ndarray of bool, optional
            Cells to solve; what comes out for the others means nothing. Default: all.

        Raises
        ------
        Exception
            What the kernel raises; a RuntimeError where it ends Python.
        """
        try:
            for begin in range(0, cells.number, self._strip):
                rows = slice(begin, min(begin + self._strip, cells.number))
                if wanted is None or wanted[rows].any():
                    some = None if wanted is None or wanted[rows].all() else wanted[rows]
                    self._solve_strip(start + begin, cells.rows(rows), some)
        except (SystemExit, KeyboardInterrupt) as fault:
            # only in the main thread may it be Ctrl-C, or what a program does at a signal
            if threading.current_thread() is threading.main_thread():
                raise
            raise RuntimeError(f"it raised {type(fault).__name__}, which would have ended Python") from fault

    def _solve_strip(self, low: int, cells: Cells, wanted: NDArray[np.bool_] | None) -> None:
        high, status, used = low + cells.number, cells.status, cells.used
        fields = zip(self.study.kernel.outputs, self._spare, strict=False)
        outputs = [cells.outputs.get(field.name, spare[: cells.number]) for field, spare in fields]
        strip = _Strip(self, cells.number, outputs, status, used)
        self.grid.columns(low, high, strip.parameters)
        self.study.kernel.check(*strip.parameters, status)
        if self._promised is not None:
            fail(status, [])
        if self.study.where:
            status[~self.grid.asked(np.arange(low, high))] = Status.NOT_ASKED
        used.fill(NONE)
        method, strip.rtol[:] = self.grid.settings(low, high)
        sound = status < FIRST_REFUSAL
        allowed = _pick(slice(0, cells.number), sound if wanted is None else sound & wanted)
        codes = [method] if isinstance(method, int) else np.unique(method)
        for code in codes:
            chosen = allowed if isinstance(method, int) else _pick(allowed, method[allowed] == code)
            strip.choose(chosen) if code == AUTO else strip.take(int(code), chosen)
        refused = status >= FIRST_REFUSAL
        if refused.any():
            used[refused] = NONE
            for column in outputs:
                column[refused] = np.nan
        if cells.error is not None:
            _tell_errors(cells.error, strip.error, status)


class _Strip:
    """The columns of one strip of cells."""

    def __init__(self, solver: Solver, n: int, outputs: Sequence[Floats], status: Codes, used: Codes) -> None:
        self.kernel, self.along, self.asked = solver.study.kernel, solver._along, solver._asked
        self.parameters = [column[:n] for column in solver._parameters]
        self._varying, self._wanted, self._spare = solver._varying, solver._wanted, solver._spare
        self.rtol, self.error = solver._rtol[:n], solver._error[:n]
        self._gathered: tuple[Chosen | None, list[Floats]] = None, []
        self.outputs, self.status, self.used = outputs, status, used
        self._turns, self.promised = solver._turns, solver._promised
        self._able: dict[tuple[Absent, ...], NDArray[np.bool_]] = {}

    def take(self, number: int, cells: Chosen) -> None:
        """Solve the cells by one method; remark those for which it promises less than rtol."""
        method = self.kernel.methods[number]
        if _count(cells):
            self.run(number, cells, None if method.bound is None else self.bound(method, cells))

    def choose(self, cells: Chosen) -> None:
        """Solve each cell by the first method that can do it, whose bound meets rtol and which does not give up."""
        if not _count(cells):
            return
        self.status[cells] = NO_METHOD
        missed: list[tuple[int, Chosen, Floats]] = []
        untried = True
        for turn in self._turns:
            able = self._promising(turn, cells, missed)
            if not _count(able):
                continue
            status = self.run(turn.number, able) if untried else self._improve(turn.number, able)
            left = _pick(cells, among(status if able is cells else self.status[cells], GIVEN_UP))
            if not _count(left):
                return
            untried = untried and _count(left) + _count(able) == _count(cells)
            cells = left
        if missed:
            self._settle(cells, missed)

    def _promising(self, turn: Turn, cells: Chosen, missed: list[tuple[int, Chosen, Floats]]) -> Chosen:
        """Cells whose turn it is and for which the method's bound, if it has one, meets rtol; others go to `missed`."""
        method, cells = self.kernel.methods[turn.number], self._fitting(turn, cells)
        if method.bound is None or not _count(cells):
            return cells
        bound = self.bound(method, cells)
        able = _pick(cells, bound <= self._inputs(cells)[-1])
        if able is not cells:
            missed.append((turn.number, cells, bound))
        return able

    def _fitting(self, turn: Turn, cells: Chosen) -> Chosen:
        """Cells whose terms the method can do, and whose turn it is."""
        if turn.absent:
            if turn.absent not in self._able:
                self._able[turn.absent] = reduce(np.logical_and, (term.holds(self.parameters) for term in turn.absent))
            cells = _pick(cells, self._able[turn.absent][cells])
        if turn.sooner is None or not _count(cells):
            return cells
        return _pick(cells, turn.sooner(*self._inputs(cells)) == turn.early)

    def _settle(self, cells: Chosen, missed: Sequence[tuple[int, Chosen, Floats]]) -> None:
        """Give cells for which nothing meets rtol the values of the smallest bound.

        `missed`: numbers of methods, the cells for which their bounds exceed rtol, and these bounds.
        """
        bounds = np.full((len(missed), len(self.status)), np.inf)
        for row, (_, some, bound) in zip(bounds, missed, strict=True):
            row[some] = np.where((bound <= self.rtol[some]) | np.isnan(bound), np.inf, bound)
        for _ in missed:
            best, least = bounds[:, cells].argmin(axis=0), bounds[:, cells].min(axis=0)
            better = least < self._known(cells)
            for place in np.unique(best[better]):
                tried = _pick(cells, better & (best == place))
                self._improve(missed[place][0], tried, bounds[place, tried])
                bounds[place, tried] = np.inf

    def _known(self, cells: Chosen) -> Floats:
        """What the values of cells are right to at least; infinite where there are none, 0 where rtol is met."""
        status = self.status[cells]
        error = np.where(status == INACCURATE, self.error[cells], 0.0)
        return np.where(status < FIRST_REFUSAL, error, np.inf)

    def _improve(self, number: int, cells: Chosen, bound: Floats | None = None) -> Codes:
        """Run a method, but keep what an earlier one gave to cells where this one is not better.

        Where an earlier one did not know what the scene does, and this one knows no cycle of its kind, that is open.
        """
        tried = self.used[cells] != NONE
        if not tried.any():
            return self.run(number, cells, bound)
        before = np.where(tried, self.status[cells], np.int8(Status.OK))
        columns: list[NDArray[Any]] = [*self.outputs, self.used, self.status, self.error]
        held = _pick(cells, self.status[cells] != Status.NO_METHOD)
        kept = [column[held].copy() for column in columns] if _count(held) else []
        self.run(number, cells, bound)
        if kept:
            worse = _worse(self.status[held], self.error[held], *kept[-2:])
            back = _pick(held, worse)
            for column, values in zip(columns, kept, strict=True):
                column[back] = values[worse]
        open_ = among(before, UNKNOWN) & (self.status[cells] == Status.NO_CYCLE)
        self.status[_pick(cells, open_)] = before[open_]
        return self.status[cells]

    def bound(self, method: Method, cells: Chosen) -> Floats:
        """The method's error bound for the cells, over the outputs asked for."""
        assert method.bound is not None
        out = np.empty(_count(cells))
        method.bound(*self._inputs(cells), *self.along, self.asked, out)
        return out

    def _inputs(self, cells: Chosen) -> list[Floats]:
        """Parameters and rtol of the cells; those asked for last are kept: the columns of a bound serve its run."""
        if self._gathered[0] is not cells:
            columns = (*self.parameters, self.rtol)
            found = _rows(columns, cells)
            if not isinstance(cells, slice):
                for k in self._varying:
                    found[k] = columns[k].take(cells, axis=0)
            self._gathered = cells, found
        return self._gathered[1]

    def run(self, number: int, cells: Chosen, bound: Floats | None = None) -> Codes:
        """Solve the cells by one method: in place where they lie side by side, else gathered and put back.

        `bound` is the method's where it may exceed rtol. Returns what became of the cells.
        """
        method, columns = self.kernel.methods[number], self._inputs(cells)
        targets: list[NDArray[Any]] = [*self.outputs, self.status]
        results = _rows(targets if isinstance(cells, slice) else self._spare, cells)
        *outputs, status = results
        asked, error = ([self.asked], [np.empty(len(status))]) if method.estimates else ([], [])
        method.solve(*columns, *self.along, *asked, *outputs, *error, status)
        if self.promised is not None:
            fail(status, [outputs[k] for k in self.promised])
        self._judge(cells, status, error[0] if error else None, bound)
        if not isinstance(cells, slice):
            for k in (*self._wanted, -1):
                targets[k][cells] = results[k]
        self.used[cells] = number
        return status

    def _judge(self, cells: Chosen, status: Codes, error: Floats | None, bound: Floats | None) -> None:
        """Remark values of which less is known than rtol, and note what they are right to; NaN tells nothing."""
        if bound is None and error is None and not np.count_nonzero(status):
            return
        known = np.where(status == INACCURATE, np.inf, 0.0) if error is None else error
        known = known if bound is None else np.maximum(known, bound)
        self.error[cells] = np.where(np.isnan(known), np.inf, known)
        status[~(known <= self._inputs(cells)[-1]) & (status < FIRST_REFUSAL)] = INACCURATE


def _worse(status: Codes, error: Floats, earlier: Codes, earlier_error: Floats) -> NDArray[np.bool_]:
    """Where what a method gave is not better than what an earlier one did."""
    refused, valued = status >= FIRST_REFUSAL, earlier < FIRST_REFUSAL
    lost = refused & (valued | (among(status, VAGUE) & ~among(earlier, VAGUE)))
    doubtful = earlier == INACCURATE
    loose = doubtful & (status == INACCURATE) & ~(error < earlier_error)
    worse: NDArray[np.bool_] = lost | loose | (doubtful & (status == Status.UNSTABLE))
    return worse


def _tell_errors(column: Singles, error: Floats, status: Codes) -> None:
    """What INACCURATE values are right to, rounded up; NaN elsewhere."""
    column.fill(np.nan)
    hits = status == INACCURATE
    with np.errstate(over="ignore"):
        column[hits] = error[hits] * (1 + 2.0**-23)


def promised(study: Study) -> tuple[int, ...]:
    """Positions of the outputs asked for that are finite in every cell that is OK."""
    fields = enumerate(study.kernel.outputs)
    return tuple(k for k, field in fields if field.name in study.outputs and not field.gaps)


def fail(status: Codes, columns: Sequence[Floats]) -> None:
    """Turn OK into FAILED where a number is missing, and what is no status of a kernel's too.

    It takes 0.2 ns a number, which is much for the cheapest of our own kernels alone: tests see to those.
    """
    for column in columns:
        finite = np.isfinite(column)
        if not finite.all():
            whole = finite.reshape(len(status), -1).all(axis=1)
            status[~whole & (status == Status.OK)] = Status.FAILED
    if status.any():
        status[among(status, NO_STATUS)] = Status.FAILED


def _pick(cells: Chosen, condition: NDArray[np.bool_]) -> Chosen:
    """Those of the cells for which the condition holds; a slice where they lie side by side."""
    number = np.count_nonzero(condition)
    if number == condition.size:
        return cells
    if number == 0:
        return slice(0, 0)
    hits = condition.nonzero()[0]
    if not isinstance(cells, slice):
        chosen: NDArray[np.intp] = cells[hits]
        return chosen
    if hits[-1] - hits[0] + 1 == number:
        return slice(cells.start + int(hits[0]), cells.start + int(hits[-1]) + 1)
    shifted: NDArray[np.intp] = hits + int(cells.start)
    return shifted


def among(status: Codes, some: bytes) -> NDArray[np.bool_]:
    """Where a status is one of some, which are those with 1 at their number."""
    return np.frombuffer(status.tobytes().translate(some), bool)


def _rows(columns: Sequence[NDArray[Any]], cells: Chosen) -> list[NDArray[Any]]:
    """Views of the cells where these lie side by side; else of as many rows."""
    rows = cells if isinstance(cells, slice) else slice(cells.size)
    return [column[rows] for column in columns]


def _count(cells: Chosen) -> int:
    return cells.stop - cells.start if isinstance(cells, slice) else cells.size
