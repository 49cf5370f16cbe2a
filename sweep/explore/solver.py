"""A study's kernel as a function of its swept parameters, for optimisers, fits and integrals."""

from __future__ import annotations

import timeit
import warnings
from collections import namedtuple
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from kernels import catalogue
from kernels.interface import Method, Status
from sweep.cells.grid import Cells, Grid, empty_cells
from sweep.cells.guard import BadCell, Guard
from sweep.cells.solve import Solver
from sweep.cells.timing import LANES
from sweep.cells.turns import Turn, turns
from sweep.errors import SweepError
from sweep.study.mistakes import did_you_mean, listed
from sweep.study.model import SETTINGS, Study
from sweep.study.read import Given
from sweep.study.read import study as as_study

TRIES = 5
DEAR = 1e-3
"""Seconds of a call beside which copying a cell costs nothing."""


class PointSolver:
    """Solves single cells, or arrays of them, of parameters given when it is called; for one thread at a time.

    Attributes
    ----------
    names : tuple of str
        Parameters it takes, in this order: the axes of the study.
    fields : tuple of str
        What it gives: the outputs asked for, and `status`.
    """

    def __init__(self, study: Study) -> None:
        _require(study)
        self.names, self.fields = tuple(study.axes), (*study.outputs, "status")
        self._study, self._grid = study, _Points(study)
        self._solver = Guard(Solver(study, self._grid), _warn)
        solved = namedtuple("solved", self.fields)  # type: ignore[misc]  # as many fields as the study asks for
        self._solved: Callable[..., Any] = solved
        self._one = empty_cells(study, 1)
        self._row = np.array([axis.values[:1] for axis in study.axes.values()])
        self._quick = _Quick(study, self._grid) if _is_simple(study) else None
        if self._quick is not None:
            self._quick.choose(self._row)

    def __call__(self, *values: Any, **named: Any) -> Any:
        """Outputs and status of cells.

        Parameters
        ----------
        *values, **named : float or ndarray
            In SI units, in the order of `names` or by name; arrays are broadcast.

        Returns
        -------
        namedtuple
            `fields`: a float and an int of one cell; else arrays of the shape of the parameters, traces behind.
            NaN in cells that are refused, unsolved or FAILED; at these last ones the kernel raises, and a
            RuntimeWarning says what.

        Raises
        ------
        SweepError
            A parameter is missing, unknown or given twice.
        """
        given = self._ordered(values, named) if named or len(values) != len(self.names) else values
        try:
            for row, value in zip(self._row, given, strict=True):
                row[0] = value
        except (TypeError, ValueError):
            return self._many(given)
        cells = None if self._quick is None else self._quick.solve(self._row)
        if cells is None:
            cells = self._one
            self._grid.given = self._row
            self._solver.solve(0, cells)
        outputs = [cells.outputs[name][0] for name in self._study.outputs]
        return self._solved(*(v.copy() if v.ndim else float(v) for v in outputs), int(cells.status[0]))

    def _many(self, given: Sequence[Any]) -> Any:
        try:
            arrays = np.broadcast_arrays(*(np.asarray(value, np.float64) for value in given))
        except (TypeError, ValueError) as error:
            raise SweepError(f"{listed(self.names, word='and')}: expected numbers or arrays, found {error}") from None
        shape = arrays[0].shape
        self._grid.given = np.stack([array.reshape(-1) for array in arrays])
        cells = empty_cells(self._study, self._grid.given.shape[1])
        self._solver.solve(0, cells)
        outputs = (cells.outputs[name].reshape(shape + cells.outputs[name].shape[1:]) for name in self._study.outputs)
        return self._solved(*outputs, cells.status.reshape(shape))

    def _ordered(self, values: Sequence[Any], named: dict[str, Any]) -> list[Any]:
        """One value for each name. Raises SweepError."""
        found = dict(zip(self.names, values, strict=False))
        for name in named:
            if name not in self.names:
                hint = did_you_mean(name, self.names) or f"; it takes {listed(self.names, word='and')}"
                raise SweepError(f"{name}: the study has no such axis{hint}")
            if name in found:
                raise SweepError(f"{name} is given twice")
        found |= named
        if len(found) < len(self.names) or len(values) > len(self.names):
            count = len(found) if len(values) <= len(self.names) else len(values)
            raise SweepError(f"expected {listed(self.names, word='and')}, found {count} of {len(self.names)} values")
        return [found[name] for name in self.names]


def _warn(cell: BadCell) -> None:
    values = ", ".join(f"{name}={value}" for name, value in cell.values.items())
    warnings.warn(f"FAILED at {values}: {cell.reason}", RuntimeWarning, stacklevel=2)


class _Quick:
    """One cell by the first method that the engine would try, without its care for cells that it does not suit.

    Where a kernel solves many cells at once it is given copies, which is quicker than having it make them.
    """

    def __init__(self, study: Study, grid: _Points) -> None:
        self._study, self._grid, self._check = study, grid, study.kernel.check
        self._turns = _turns(study, grid)
        self._along = [np.array(study.along[field.name]) for field in study.kernel.along]
        self._asked = np.array([field.name in study.outputs for field in study.kernel.outputs], np.uint8)
        self._use(1)

    def _use(self, rows: int) -> None:
        """Columns of so many rows."""
        study, kernel = self._study, self._study.kernel
        self._parameters = [np.empty((rows, *study.shape(field))) for field in kernel.parameters]
        for k, value in self._grid.constants().items():
            self._parameters[k][:] = value
        self._rtol, self._bound = np.full(rows, study.rtol), np.empty(rows)
        self._cells = empty_cells(study, rows)
        given = self._cells.outputs
        self._outputs = [given.get(f.name, np.empty((rows, *study.shape(f)))) for f in kernel.outputs]

    def choose(self, row: Any) -> None:
        """Take as many rows as are solved soonest."""
        seconds = {}
        for rows in (1, LANES):
            self._use(rows)
            self.solve(row)  # the first call may compile
            seconds[rows] = min(timeit.repeat(lambda: self.solve(row), number=1, repeat=TRIES))
            if seconds[rows] > DEAR:
                break
        self._use(min(seconds, key=lambda rows: seconds[rows]))

    def solve(self, row: Any) -> Cells | None:
        """The cell, first of some that are the same; None where the engine has more to say of it."""
        parameters, status = self._parameters, self._cells.status
        self._grid.fill(row, parameters)
        self._check(*parameters, status)
        if status[0] != Status.OK:
            return None
        method = self._method()
        if method is None or method.estimates:
            return None
        if method.bound is not None:
            method.bound(*parameters, self._rtol, *self._along, self._asked, self._bound)
            if not self._bound[0] <= self._rtol[0]:
                return None
        method.solve(*parameters, self._rtol, *self._along, *self._outputs, status)
        return self._cells if status[0] == Status.OK else None

    def _method(self) -> Method | None:
        """The method that is tried first."""
        inputs = (*self._parameters, self._rtol)
        return next((self._study.kernel.methods[turn.number] for turn in self._turns if turn.comes(inputs)), None)


def _turns(study: Study, grid: Grid) -> tuple[Turn, ...]:
    """Turns of the method that is named, or of those that `auto` tries."""
    names = [method.name for method in study.kernel.methods]
    return turns(study, grid) if study.method == "auto" else (Turn(names.index(study.method)),)


def _is_simple(study: Study) -> bool:
    """Whether what one method says of a cell can be all there is to say."""
    methods = [m for m in study.kernel.methods if study.method in ("auto", m.name)]
    return study.kernel_name in catalogue.KERNELS and not study.where and not all(m.estimates for m in methods)


class _Points(Grid):
    """Cells whose parameters are set before they are solved: `given`, shape (axes, cells)."""

    def __init__(self, study: Study) -> None:
        super().__init__(study)
        self.size = np.iinfo(np.int64).max
        self.given = np.empty((len(study.axes), 0))
        places = {name: place for place, name in enumerate(study.axes)}
        self._places = {f.name: places.get(study.follows.get(f.name, f.name)) for f in study.kernel.parameters}
        self._filled = [(k, p) for k, p in enumerate(self._places.values()) if p is not None]
        self._setting = super().settings(0, 1)

    def spread(self, place: int) -> Any:
        return None if place in dict(self._filled) else super().spread(place)

    def columns(self, start: int, stop: int, out: Sequence[Any]) -> None:
        for k, place in self._filled:
            out[k][: stop - start] = self.given[place, start:stop]

    def fill(self, row: Any, out: Sequence[Any]) -> None:
        """Writes one cell into all rows."""
        for k, place in self._filled:
            out[k].fill(row[place, 0])

    def settings(self, start: int, stop: int) -> Any:
        return self._setting

    def cell(self, index: int) -> dict[str, str]:
        return {name: repr(float(row[index])) for name, row in zip(self.study.axes, self.given, strict=True)}

    def _of(self, name: str, cells: Any) -> Any:
        place = self._places.get(name)
        return super()._of(name, cells) if place is None else self.given[place, cells]


def solver(study: Given) -> PointSolver:
    """The study's kernel as a function of its axes, whose values it does not use.

    Parameters
    ----------
    study : as of `sweep.study`
        Its axes are numbers of the kernel; everything else is fixed by it.

    Raises
    ------
    SweepError
        An axis is an array, a word, a method or a tolerance; the study keeps a summary.

    Examples
    --------
    >>> import sweep
    >>> from scipy.optimize import brentq
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "axes": {"mu": [1.0]}, "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> clock = sweep.solver(foliot)
    >>> round(clock(2.0).period, 6), clock([0.5, 2.0]).period.shape
    (5.524901, (2,))
    >>> round(brentq(lambda mu: clock(mu).period - 2.0, 1.0, 100.0), 4)  # the torque of a clock that beats seconds
    26.3972
    """
    return PointSolver(as_study(study))


def _require(study: Study) -> None:
    for name, axis in study.axes.items():
        if name in SETTINGS or axis.words is not None or axis.values.ndim > 1:
            raise SweepError(f"axes.{name}: a solver takes numbers of the kernel; fix it, and make one for each value")
    if study.summary is not None:
        raise SweepError("summary: a solver gives cells; leave it out")
