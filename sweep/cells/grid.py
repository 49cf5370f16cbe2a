"""From axes to cells: flat cell numbers and the columns a kernel takes.

Cells are numbered in C order: the last axis runs fastest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweep.study.condition import CellCondition
from sweep.study.model import AUTO, SETTINGS, Axis, Study

Floats = NDArray[np.float64]

SHORT_RUN = 16
"""Below this many equal cells in a row, filling every n-th cell is faster than filling runs."""


class Box:
    """Places in C order.

    Attributes
    ----------
    dims : tuple of str
    shape : tuple of int
    size : int
        Number of places.
    """

    def __init__(self, dims: tuple[str, ...], shape: tuple[int, ...]) -> None:
        self.dims, self.shape, self.size = dims, shape, math.prod(shape)


class Grid(Box):
    """The cells of a study; its dims are the axes of a product, ("cell",) of axes that run together."""

    def __init__(self, study: Study) -> None:
        super().__init__(tuple(study.grid_shape), tuple(study.grid_shape.values()))
        self.study = study
        self._runs = {name: study.run(name) for name in study.axes}
        self._varying = [
            (k, study.axes[source])
            for k, field in enumerate(study.kernel.parameters)
            if (source := study.follows.get(field.name, field.name)) in study.axes
        ]

    def constants(self) -> dict[int, float | Floats]:
        """Column number and value of every parameter that is the same in all cells."""
        fixed = self.study.fixed
        return {k: fixed[field.name] for k, field in enumerate(self.study.kernel.parameters) if field.name in fixed}

    def spread(self, place: int) -> Floats | None:
        """All values that the parameter at that position takes, shape (values, ...); None where that is not known."""
        axes = dict(self._varying)
        return axes[place].values if place in axes else np.asarray(self.constants()[place])[None]

    def columns(self, start: int, stop: int, out: Sequence[Floats]) -> None:
        """Write the varying parameters of the cells `start` to `stop`.

        Parameters
        ----------
        start, stop : int
            0 <= start <= stop <= size.
        out : sequence of ndarray, each of shape (>= stop - start, ...)
            One column per parameter of the kernel, in its order; constant ones are left alone.
        """
        for k, axis in self._varying:
            if axis.values.ndim > 1:  # an array in each cell
                out[k][: stop - start] = self.values(axis.name, np.arange(start, stop))
            else:
                self._fill(axis, start, out[k][: stop - start])

    def values(self, name: str, cells: NDArray[np.int64]) -> Floats:
        """An axis' values of some flat cells."""
        axis = self.study.axes[name]
        found: Floats = axis.values[cells // self._runs[name] % len(axis)]
        return found

    @cached_property
    def condition(self) -> CellCondition:
        """The study's, if it has one."""
        settings = [name for name in SETTINGS if name in self.study.axes]
        return CellCondition(self.study.where, self.study.kernel, settings)

    def asked(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of some flat cells the study's condition holds for."""
        if not self.study.where:
            return np.ones(len(cells), bool)
        holds: NDArray[np.bool_] = self.condition.holds({name: self._of(name, cells) for name in self.condition.names})
        return holds

    def _of(self, name: str, cells: NDArray[np.int64]) -> Floats:
        """A parameter's or setting's numbers in some flat cells."""
        source = self.study.follows.get(name, name)
        if source in self.study.axes:
            return self.values(source, cells)
        return np.full(len(cells), self.study.fixed[name])

    def settings(self, start: int, stop: int) -> tuple[int | NDArray[np.int8], float | Floats]:
        """Method number (-1: auto) and rtol of the cells: one for all where they agree, else one per cell."""
        method: int | NDArray[np.int8] = self._fixed_method()
        rtol: float | Floats = self.study.rtol
        if "method" in self.study.axes:
            codes = self.column("method", start, stop)
            method = int(codes[0]) if _all_equal(codes) else codes.astype(np.int8)
        if "rtol" in self.study.axes:
            column = self.column("rtol", start, stop)
            rtol = float(column[0]) if _all_equal(column) else column
        return method, rtol

    def cell(self, index: int) -> dict[str, str]:
        """The axes' values of one cell, as people write them: {"mu": "0.9", "method": "closed"}."""
        return {name: axis.label(index // self._runs[name] % len(axis)) for name, axis in self.study.axes.items()}

    def _fixed_method(self) -> int:
        names = [m.name for m in self.study.kernel.methods]
        return AUTO if self.study.method == "auto" else names.index(self.study.method)

    def column(self, name: str, start: int, stop: int) -> Floats:
        """An axis' numbers in the cells `start` to `stop`."""
        column = np.empty(stop - start)
        self._fill(self.study.axes[name], start, column)
        return column

    def _fill(self, axis: Axis, start: int, out: Floats) -> None:
        """Write the axis' values of the cells from `start` on, one period of them; then copy that period on."""
        run = self._runs[axis.name]
        filled = min(len(out), run * len(axis))
        if filled == 0:
            return
        first, last = start // run, (start + filled - 1) // run
        _repeat(_cyclic(axis.values, first % len(axis), last - first + 1), run, start % run, out[:filled])
        while filled < len(out):
            more = min(filled, len(out) - filled)
            out[filled : filled + more] = out[:more]
            filled += more


class Cells(NamedTuple):
    """The columns of some cells, to be filled or filled.

    Attributes
    ----------
    outputs : mapping of output name to ndarray, shape (cells, ...)
    status, used : ndarray of int8, shape (cells,)
        A `Status`; the position in `kernel.methods`, or -1 where the cell is refused.
    error : ndarray of float32, shape (cells,), optional
        What INACCURATE values are right to, infinite where nobody knows; NaN for other cells.
    """

    outputs: Mapping[str, Any]
    status: Any
    used: Any
    error: Any = None

    @property
    def number(self) -> int:
        """How many cells."""
        return len(self.status)

    def rows(self, some: slice) -> Cells:
        """Views of some of them."""
        outputs = {name: column[some] for name, column in self.outputs.items()}
        return Cells(outputs, self.status[some], self.used[some], None if self.error is None else self.error[some])


def empty_cells(study: Study, cells: int) -> Cells:
    """Uninitialised arrays for so many cells."""
    outputs = {name: np.empty((cells, *shape)) for name, shape in study.shapes.items()}
    return Cells(outputs, np.empty(cells, np.int8), np.empty(cells, np.int8))


def _cyclic(values: Floats, first: int, count: int) -> Floats:
    """`count` values from number `first` on, starting over at the end; at most one turn and one value."""
    if first + count <= len(values):
        return values[first : first + count]
    return np.concatenate([values[first:], values[: first + count - len(values)]])


def _repeat(values: Floats, run: int, skip: int, out: Floats) -> None:
    """Each of `values` `run` times, without the first `skip` cells, until `out` is full."""
    head = min(run - skip, len(out))
    whole = (len(out) - head) // run
    out[:head] = values[0]
    body = out[head : head + whole * run].reshape(whole, run)
    if run < SHORT_RUN:
        for offset in range(run):
            body[:, offset] = values[1 : 1 + whole]
    else:
        body[...] = values[1 : 1 + whole, None]
    out[head + whole * run :] = values[-1]


def _all_equal(column: NDArray[np.float64]) -> bool:
    return len(column) > 0 and bool((column == column[0]).all())
