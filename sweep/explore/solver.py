"""A study's kernel as a function of its axes, for optimisers, fits and integrals."""

from __future__ import annotations

import functools
import inspect
import threading
import warnings
from collections import namedtuple
from dataclasses import replace
from typing import Any, cast

import numpy as np

from sweep.cells.block import BadCell, Guard
from sweep.cells.grid import Grid
from sweep.cells.schema import empty_cells
from sweep.cells.solve import Solver
from sweep.errors import SweepError
from sweep.study.model import SETTINGS, Axis, Study
from sweep.study.read import Given
from sweep.study.read import study as as_study
from sweep.units import in_unit
from sweep.words import listed


class PointSolver:
    """A function that solves single cells, or arrays of them; calls from several threads are serialised.

    Attributes
    ----------
    names : tuple of str
        Its arguments, in this order: the axes of the study.
    fields : tuple of str
        What it returns: the study's outputs, and `status`.
    """

    def __init__(self, study: Study) -> None:
        for name, axis in study.axes.items():
            if name in SETTINGS or axis.words is not None or axis.values.ndim > 1:
                raise SweepError(
                    f"axes.{name}: the arguments of a solver are numbers; fix this, and make a solver for each value"
                )
        if study.summary is not None:
            raise SweepError("summary: a solver returns cells; leave the summary out")
        self.names, self.fields = tuple(study.axes), (*study.outputs, "status")
        self._units = [(study.kernel.parameter(name).unit, name) for name in self.names]
        self._study = replace(study, design="zip", blocks=(), axes=dict(study.axes))  # the axes are those of each call
        grid = Grid(self._study)
        grid.size = np.iinfo(np.int64).max
        self._solver = Guard(Solver(self._study, grid), _warn)
        self._given = study
        self._turn = threading.Lock()  # what is solved is that of the last call
        one = inspect.Parameter.POSITIONAL_OR_KEYWORD
        self._signature = inspect.Signature([inspect.Parameter(name, one) for name in self.names])

    def __repr__(self) -> str:
        return f"<solver of {self._given.kernel_name}: {', '.join(self.names)} -> {', '.join(self.fields)}>"

    def __reduce__(self) -> Any:
        return PointSolver, (self._given,)

    def __call__(self, *values: Any, **named: Any) -> Any:
        """Outputs and status of cells.

        Parameters
        ----------
        *values, **named : float or ndarray
            In SI units, in the order of `names` or by name; arrays are broadcast, and NaN where they are masked.
            Quantities of pint, and DataArrays that have a unit, are converted.

        Returns
        -------
        namedtuple
            `fields`: a float and an int of one cell; else arrays of the shape of the parameters, traces behind.
            NaN in cells that are refused, unsolved or FAILED; at these last ones the kernel raises, and a
            RuntimeWarning says what.

        Raises
        ------
        SweepError
            A parameter is missing, unknown, given twice, or no number.
        """
        try:
            if named or len(values) != len(self.names):
                values = self._signature.bind(*values, **named).args
            given = [np.asarray(in_unit(value, *of)) for value, of in zip(values, self._units, strict=True)]
            for name, column in zip(self.names, given, strict=True):
                if column.dtype.kind not in "fiub":
                    raise TypeError(f"{name} is no number")
            points = np.array(np.broadcast_arrays(*given), np.float64)
        except (TypeError, ValueError) as error:
            expected = listed(self.names, word="and")
            raise SweepError(f"expected numbers, or arrays of them, for {expected}: {error}") from None
        shape, columns = points.shape[1:], points.reshape(len(self.names), -1)
        with self._turn:
            for name, column in zip(self.names, columns, strict=True):
                self._study.axes[name] = Axis(name, column, "values")
            cells = empty_cells(self._study, columns.shape[1])
            self._solver.solve(0, cells)
        found = (cells[name].reshape(shape + cells[name].shape[1:]) for name in self.fields)
        return _solved(self.fields, *(column if column.ndim else column.item() for column in found))


def _solved(fields: tuple[str, ...], *values: Any) -> Any:
    return _record(fields)(*values)


@functools.cache
def _record(fields: tuple[str, ...]) -> Any:
    """A namedtuple of as many as a study asks for, which other processes can send."""
    made: Any = cast(Any, namedtuple)("solved", fields)
    made.__reduce__ = lambda self: (_solved, (fields, *self))
    return made


def _warn(cell: BadCell) -> None:
    values = ", ".join(f"{name}={value}" for name, value in cell.values.items())
    warnings.warn(f"FAILED at {values}: {cell.reason}", RuntimeWarning, stacklevel=2)


def solver(study: Given) -> PointSolver:
    """Make a function of a study, whose arguments are its axes; the values of the axes in the study are not used.

    Parameters
    ----------
    study : as of `sweep.study`
        Its axes, parameters of the kernel that are numbers, become the arguments; it fixes everything else.

    Raises
    ------
    SweepError
        An axis is an array, a word, a method or a tolerance; the study has a [summary].

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
