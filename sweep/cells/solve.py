"""Solves runs of cells: checks them, chooses their methods, and sets their statuses.

A cell that the study's condition excludes, or that `check` refuses, is not solved. If the study names a method, that
method solves the cell; where its bound or estimate exceeds rtol, the status is INACCURATE instead of any other remark
but GRAZING. With `auto` the cell goes to the cheapest method that covers its terms and whose bound meets rtol, and on
to the next where that one gives up, returns INACCURATE, GRAZING with an error above rtol, or OUT_OF_RANGE from a method
that only estimates its error. Where none meets rtol, the values with the smallest bound are kept, INACCURATE. A later
method replaces only values that it improves. If a kernel of a user returns OK without a number, or an unknown status,
the cell is FAILED.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kernels import catalogue
from kernels.interface import FIRST_REFUSAL, UNSOLVED, Status
from sweep.cells.grid import Grid
from sweep.cells.schema import ERROR_BOUND, METHOD_USED, STATUS, Columns, part
from sweep.study.model import AUTO, Study

STRIP = 16384
"""Cells solved at a time: their columns, where outputs are numbers, stay in the processor's cache."""
STRIP_BYTES = 16 << 20
"""Bytes that the outputs of a strip may take, where they are traces."""
NONE = -1
"""In place of a method's number: no method solved the cell."""
ROUNDED_UP = 1 + 2.0**-23
"""A number times this is at least itself when it is rounded to a float32."""


def _these(*statuses: Status) -> bytes:
    """Statuses as `among` takes them: a table, since `auto` asks it of every cell."""
    return bytes(code in statuses for code in range(256))


GIVEN_UP = _these(*UNSOLVED, Status.NO_CYCLE, Status.INACCURATE, Status.UNSTABLE, Status.FAILED)
"""Statuses after which `auto` tries the next method."""
UNSURE = _these(*(code for code in Status if GIVEN_UP[code]), Status.OUT_OF_RANGE)
"""Further ones after a method that estimates its error: derivatives may be out of range that another does not need."""
DOUBTED = _these(Status.INACCURATE, Status.GRAZING)
"""Statuses that another method may improve where the error exceeds rtol."""
NO_STATUS = bytes(code not in map(int, Status) or code >= Status.NOT_ASKED for code in range(256))
"""Statuses that a kernel must not set."""
NO_METHOD, INACCURATE, GRAZING = map(np.int8, (Status.NO_METHOD, Status.INACCURATE, Status.GRAZING))
"""Not as a `Status`, which numpy compares ten times as slowly."""
VAGUE = _these(Status.NO_METHOD, Status.NO_CYCLE)
"""Refusals that say less than the failure of another method."""
UNKNOWN = _these(*UNSOLVED)
"""Statuses that leave open what the model does: another method's NO_CYCLE, for its own kind of cycle, is no answer."""

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]
Places = NDArray[np.intp]
"""Cells of a strip by their numbers in it, ascending."""


class Absent(NamedTuple):
    """That a term is absent: the parameter at position `place` has its default, a number or that at position `like`."""

    place: int
    default: float
    like: int | None

    def holds(self, columns: Sequence[Any] | Mapping[int, Any]) -> NDArray[np.bool_]:
        """In which cells."""
        same = columns[self.place] == (self.default if self.like is None else columns[self.like])
        return np.asarray(same if same.ndim == 1 else same.all(axis=1))


class Turn(NamedTuple):
    """A method's turn: its position, and what must hold in a cell for it, but for what no axis changes.

    Where it has two turns, by `Method.sooner`, also whether this is the first of the two.
    """

    number: int
    absent: tuple[Absent, ...] = ()
    sooner: Callable[..., Any] | None = None
    early: bool = False


def turns(study: Study, grid: Grid) -> tuple[Turn, ...]:
    """Turns of the methods that give every output asked for, and that no fixed parameter keeps out."""
    places = {field.name: place for place, field in enumerate(study.kernel.parameters)}
    constants = {place: np.asarray(value)[None] for place, value in grid.constants().items()}
    found = dict[float, Turn]()
    for number, method in enumerate(study.kernel.methods):
        terms: dict[bool, list[Absent]] = {True: [], False: []}  # those that an axis changes, and others
        for name in (name for name in method.excludes if name not in study.follows):
            default = study.kernel.parameter(name).default
            like = places[default] if isinstance(default, str) else None
            term = Absent(places[name], np.nan if like is not None or default is None else float(default), like)
            terms[not grid.varying.keys().isdisjoint((term.place, like))].append(term)
        if set(study.outputs).isdisjoint(method.lacks) and all(term.holds(constants) for term in terms[False]):
            found[number] = Turn(number, tuple(terms[True]), method.sooner)
            if method.sooner is not None:
                found[number - 1.5] = found[number]._replace(early=True)
    return tuple(found[place] for place in sorted(found))


def usable_methods(study: Study) -> tuple[int, ...]:
    """Numbers of the methods that can do all cells of the study and give every output it asks for."""
    return tuple(turn.number for turn in turns(study, Grid(study)) if not (turn.absent or turn.early))


class Solver:
    """Solves cells of one study, for one thread at a time; its buffers are made once.

    Parameters
    ----------
    study : Study
    grid : Grid, optional
        Where its cells come from; default: the axes of the study.

    Examples
    --------
    A foliot that is driven forwards or backwards, without and with dry friction R, at two tolerances: eight cells.

    >>> import sweep
    >>> from sweep.cells.schema import empty_cells
    >>> axes = {"mu": [1.0, -1.0], "R": [0.0, 0.1], "rtol": [1e-6, 1e-15]}
    >>> study = sweep.study(kernel="foliot", outputs=["period"], axes=axes, fixed={"phi0": 1.0, "a": 0.5})
    >>> cells = empty_cells(study, 8)
    >>> Solver(study).solve(0, cells)

    `check` refuses the last four, whose mu is negative: no method sees them. Of the others the turn is `closed`'s, the
    first of the kernel's methods. It cannot do dry friction, so it gets cells 0 and 1; its bound meets both rtol.
    `coulomb` is the next that can do cells 2 and 3. Its bound, 4e-15, meets the rtol of cell 2, which it solves. Cell 3
    goes on to `segments` and others, all of which estimate more, so that it gets the values of the smallest bound.

    >>> [Status(status).name for status in cells["status"][:5]]
    ['OK', 'OK', 'OK', 'INACCURATE', 'BAD_INPUT']
    >>> [study.kernel.methods[number].name for number in cells["method_used"][:4]]
    ['closed', 'closed', 'coulomb', 'coulomb']
    """

    def __init__(self, study: Study, grid: Grid | None = None) -> None:
        self.study, self.grid, kernel = study, grid or Grid(study), study.kernel
        self._turns = turns(study, self.grid)
        shapes = {field.name: study.shape(field) for field in (*kernel.parameters, *kernel.outputs)}
        cell_bytes = sum(8 * math.prod(shapes[field.name]) for field in kernel.outputs)
        strip = self._strip = max(1, min(STRIP, self.grid.size, STRIP_BYTES // cell_bytes))
        self._places = np.arange(strip)
        # parameters, then rtol, of a strip
        self._buffers = [*(np.empty((strip, *shapes[field.name])) for field in kernel.parameters), np.empty(strip)]
        constants = self.grid.constants()
        for k, value in constants.items():
            self._buffers[k][:] = value
        self._varying = [k for k in range(len(kernel.parameters)) if k not in constants]
        self._varying += [len(kernel.parameters)] if "rtol" in study.axes else []
        self._along = [np.array(study.along[field.name]) for field in kernel.along]
        self._asked = np.array([field.name in study.outputs for field in kernel.outputs], np.uint8)
        # outputs and status, where a method solves cells that do not lie side by side, and outputs not asked for
        self._spare: list[NDArray[Any]] = [np.empty((strip, *shapes[field.name])) for field in kernel.outputs]
        self._spare.append(np.empty(strip, np.int8))
        self._wanted = [*map(int, self._asked.nonzero()[0]), len(kernel.outputs)]
        self._error = np.empty(strip)
        # of a kernel of somebody's own: outputs that are finite in every cell that is OK
        own = study.kernel_name not in catalogue.KERNELS
        self._promised = [k for k, f in enumerate(kernel.outputs) if self._asked[k] and not f.gaps] if own else None

    def solve(self, start: int, cells: Columns, wanted: NDArray[np.bool_] | None = None) -> None:
        """Fill the columns of cells.

        Parameters
        ----------
        start : int
            Flat number of the first of them in the grid.
        cells : Columns
            Of every output asked for, of statuses, of method numbers, and maybe of errors.
        wanted : ndarray of bool, optional
            Cells to solve; what comes out for the others means nothing. Default: all.

        Raises
        ------
        Exception
            What the kernel raises; a RuntimeError where it ends Python.
        """
        try:
            for begin in range(0, len(cells[STATUS]), self._strip):
                rows = slice(begin, begin + self._strip)
                if wanted is None or wanted[rows].any():
                    self._solve_strip(start + begin, part(cells, rows), None if wanted is None else wanted[rows])
        except BaseException as fault:
            # only in the main thread may it be Ctrl-C, or what a program does at a signal
            if isinstance(fault, Exception) or threading.current_thread() is threading.main_thread():
                raise
            raise RuntimeError(f"it raised {type(fault).__name__}, which would have ended Python") from fault

    def _solve_strip(self, start: int, cells: Columns, wanted: NDArray[np.bool_] | None) -> None:
        """Check the cells, give each to its method, and take back what stands in those that are refused."""
        n = len(cells[STATUS])
        *parameters, rtol = self.inputs = [column[:n] for column in self._buffers]
        self._cached: tuple[Places | None, list[Floats]] = None, []
        self.status, self.used = cells[STATUS], cells[METHOD_USED]
        spare = zip(self.study.kernel.outputs, self._spare, strict=False)
        self.targets = [*(cells.get(field.name, column) for field, column in spare), self.status]
        self.grid.columns(start, start + n, parameters)
        self.study.kernel.check(*parameters, self.status)
        if self._promised is not None:
            self._fail(self.status, [])
        if self.study.where:
            self.status[~self.grid.asked(np.arange(start, start + n))] = Status.NOT_ASKED
        self.used.fill(NONE)
        method, wanted_rtol = self.grid.settings(start, start + n)
        rtol[:] = wanted_rtol
        allowed = self.status < FIRST_REFUSAL
        places = _where(self._places[:n], allowed if wanted is None else allowed & wanted)
        for code in [method] if isinstance(method, int) else np.unique(method):
            chosen = places if isinstance(method, int) else _where(places, method[places] == code)
            if code == AUTO:
                self._choose(chosen)
            elif len(chosen):
                self._run(int(code), chosen, self._bound(int(code), chosen))
        refused = self.status >= FIRST_REFUSAL
        if np.count_nonzero(refused):
            self.used[refused] = NONE
            for column in self.targets[:-1]:
                column[:n][refused] = np.nan
        if (error := cells.get(ERROR_BOUND)) is not None:
            with np.errstate(over="ignore", invalid="ignore"):
                np.multiply(self._error[:n], ROUNDED_UP, out=error, casting="unsafe")
            # what meets rtol meets it in single precision, too
            doubted = among(self.status, DOUBTED)
            meets = ~doubted | (self._error[:n] <= wanted_rtol) if doubted.any() else True
            np.minimum(error, np.float32(wanted_rtol), out=error, where=meets)
            if np.count_nonzero(refused):
                error[refused] = np.nan

    def _choose(self, cells: Places) -> None:
        """Solve each cell by the first method that can do it, whose bound meets rtol and which does not give up.

        Those for which nothing does are given, in the order of bounds that exceed rtol, to methods that promise less.
        """
        self.status[_rows(cells)] = NO_METHOD
        missed: list[tuple[int, Places, Floats]] = []
        for turn in self._turns:
            able = cells  # that the method can do, and to which the turn comes
            for term in turn.absent:
                if len(able):
                    able = _where(able, term.holds(self.inputs)[able])
            if turn.sooner is not None and len(able):
                able = _where(able, turn.sooner(*self._inputs_of(able)) == turn.early)
            bound = self._bound(turn.number, able) if len(able) else None
            if bound is not None:
                meets = bound <= self._inputs_of(able)[-1]
                if np.count_nonzero(meets) < len(able):
                    missed.append((turn.number, able, bound))
                    able, bound = able[meets], bound[meets]
            if len(able):
                self._better(turn.number, able, bound)
                rows = _rows(cells)
                method, grazing = self.study.kernel.methods[turn.number], self.status[rows] == GRAZING
                on = among(self.status[rows], UNSURE if method.estimates else GIVEN_UP)
                if grazing.any():
                    on = on | (grazing & (self._error[rows] > self.inputs[-1][rows]))
                cells = _where(cells, on)
        if not (missed and len(cells)):
            return
        bounds = np.full((len(missed), len(self.status)), np.inf)
        for row, (_, some, bound) in zip(bounds, missed, strict=True):
            row[some] = np.where(bound > self.inputs[-1][some], bound, np.inf)
        bounds = bounds[:, cells]
        for turns_of_cells in bounds.argsort(axis=0, kind="stable"):
            for k in np.unique(turns_of_cells):
                status = self.status[cells]
                known = np.where(status < FIRST_REFUSAL, 0.0, np.inf)
                doubted = among(status, DOUBTED)
                known[doubted] = self._error[cells[doubted]]
                hits = (turns_of_cells == k) & (bounds[k] < known)
                if hits.any():
                    self._better(missed[k][0], cells[hits], bounds[k, hits])

    def _better(self, number: int, cells: Places, bound: Floats | None) -> None:
        """Run a method, but keep what an earlier one gave to cells where this one is not better.

        Where an earlier one did not learn what the scene does, and this one knows no cycle of its kind, that is open.
        """
        rows = _rows(cells)
        tried = self.used[rows] != NONE
        if not np.count_nonzero(tried):
            self._run(number, cells, bound)
            return
        columns = [*self.targets[:-1], self.used, self._error, self.status]
        kept = [np.array(column[rows]) for column in columns]
        self._run(number, cells, bound)
        status, error, (*_, old_error, old) = self.status[rows], self._error[rows], kept
        vaguer = (among(status, VAGUE) & ~among(old, VAGUE)) | (among(status, UNKNOWN) & (old == Status.OUT_OF_RANGE))
        lost = (status >= FIRST_REFUSAL) & ((old < FIRST_REFUSAL) | vaguer)
        looser = (status == Status.UNSTABLE) | (among(status, DOUBTED) & ~(error < old_error))
        worse = lost | (among(old, DOUBTED) & looser)
        for column, values in zip(columns, kept, strict=True):
            column[cells[worse]] = values[worse]
        open_ = tried & among(old, UNKNOWN) & (self.status[rows] == Status.NO_CYCLE)
        self.status[cells[open_]] = old[open_]

    def _bound(self, number: int, cells: Places) -> Floats | None:
        """A method's error bound for the cells, over the outputs asked for; None where it states none."""
        method = self.study.kernel.methods[number]
        if method.bound is None:
            return None
        out = np.empty(len(cells))
        method.bound(*self._inputs_of(cells), *self._along, self._asked, out)
        return out

    def _inputs_of(self, cells: Places) -> list[Floats]:
        """Parameters and rtol of the cells; those asked for last are kept: the columns of a bound serve its run."""
        if self._cached[0] is not cells:
            rows = _rows(cells)
            found = [column[rows if isinstance(rows, slice) else slice(len(cells))] for column in self.inputs]
            if not isinstance(rows, slice):
                for k in self._varying:
                    found[k] = self.inputs[k].take(cells, axis=0)
            self._cached = cells, found
        return self._cached[1]

    def _run(self, number: int, cells: Places, bound: Floats | None) -> None:
        """Solve the cells by one method, in place where they lie side by side, else gathered and put back.

        What values are right to is the method's estimate or `bound`, where it has one, else rtol; where that exceeds
        rtol they are remarked.
        """
        method, rows, inputs = self.study.kernel.methods[number], _rows(cells), self._inputs_of(cells)
        aside = not isinstance(rows, slice)
        results = [column[: len(cells)] for column in self._spare] if aside else [c[rows] for c in self.targets]
        *outputs, status = results
        asked, error = ([self._asked], [np.empty(len(cells))]) if method.estimates else ([], [])
        method.solve(*inputs, *self._along, *asked, *outputs, *error, status)
        if self._promised is not None:
            self._fail(status, [outputs[k] for k in self._promised])
        known = error[0] if error else inputs[-1] if bound is None else bound
        if error and bound is not None:
            known = np.maximum(known, bound)
        if not error and np.count_nonzero(status):
            known = np.where(status == INACCURATE, np.inf, known)
        self._error[rows] = known
        if known is not inputs[-1] and np.count_nonzero(meets := known <= inputs[-1]) < len(cells):
            self._error[rows] = np.where(np.isnan(known), np.inf, known)
            status[~meets & (status < FIRST_REFUSAL) & (status != GRAZING)] = INACCURATE
        if aside:
            for k in self._wanted:
                self.targets[k][cells] = results[k]
        self.used[rows] = number

    @staticmethod
    def _fail(status: Codes, columns: list[Floats]) -> None:
        """Turn OK into FAILED where a number is missing, and what is no status of a kernel's too.

        It takes 0.2 ns a number, which is much for the cheapest of our own kernels alone: tests see to those.
        """
        for column in columns:
            finite = np.isfinite(column)
            if not finite.all():
                status[~finite.reshape(len(status), -1).all(axis=1) & (status == Status.OK)] = Status.FAILED
        if np.count_nonzero(status):
            status[among(status, NO_STATUS)] = Status.FAILED


def among(status: Codes, some: bytes) -> NDArray[np.bool_]:
    """Where a status is one of some, which are those with 1 at their number."""
    return np.frombuffer(status.tobytes().translate(some), bool)


def _where(cells: Places, condition: NDArray[np.bool_]) -> Places:
    """Those of the cells for which the condition holds; the same array where that is all of them."""
    return cells if np.count_nonzero(condition) == len(cells) else cells[condition]


def _rows(cells: Places) -> Places | slice:
    """The cells as a slice where they lie side by side, for columns are then seen and not copied."""
    if len(cells) and (last := cells.item(-1)) - (first := cells.item(0)) < len(cells):
        return slice(first, last + 1)
    return cells
