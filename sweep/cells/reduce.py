"""Cells to rows and rows to one: counts, extremes, sums and histograms that have the same bits however they are cut.

All but the sum are the same in any order; of equal extremes the one with the smallest cell number counts. A sum is
taken as an unevaluated pair sum + rest: over a strip in a binary tree of error-free additions, each addition's rounding
error kept in `rest` (Ogita, Rump & Oishi 2005, Sum2: as exact as in twice the digits); strips and rows then follow in
their order. NaN is no value and counts nowhere; infinities are values.
"""

from __future__ import annotations

import math
import timeit
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kernels.interface import Status
from sweep.cells.grid import Cells, empty_cells
from sweep.cells.partition import row_blocks
from sweep.cells.schema import Column

if TYPE_CHECKING:
    from sweep.cells.guard import SolveCells
    from sweep.study.model import Study

STRIP = 65536
"""Cells reduced at a time, where outputs are numbers."""
STRIP_BYTES = 16 << 20
"""Bytes that the outputs of a strip may take, where they are traces."""
STATUSES = (*(s.name for s in Status), "OTHER")
"""Names under which cells are counted, the last one those of a status that is not known."""
BY_STATUS, BY_METHOD = "cells_by_status", "cells_by_method"
NO_CELL = -1

Floats = NDArray[np.float64]
Rows = dict[str, Any]
"""What is known of each row: counts of statuses and methods; of every output "period count", "period min at", ..."""

_OF_STATUS = np.full(256, len(Status))
_OF_STATUS[[int(s) for s in Status]] = np.arange(len(Status))
_OF_METHOD = np.roll(np.arange(256), -1)
"""Where each int8 code, taken as an uint8, is counted: among `STATUSES`; among the methods, none before them."""


def row_columns(study: Study) -> tuple[Column, ...]:
    """The columns of a part of a study with a summary, which are those of one cell, reduced."""
    found = reduced(study, 0, 1, _zeros(study, 1))
    return tuple(Column(name, c.dtype.str[1:], (), c.shape[1:], {}) for name, c in found.items())


def nothing(study: Study, rows: int) -> Rows:
    """Rows of no cell at all."""
    found = {column.name: column.empty(rows) for column in row_columns(study)}
    _clear(found)
    return found


def pending(study: Study, start: int, stop: int) -> Rows:
    """The rows `start` to `stop`, not computed yet."""
    rows = nothing(study, stop - start)
    first = row_blocks(study).first(np.arange(start, stop + 1, dtype=np.int64))
    rows[BY_STATUS][:, STATUSES.index(Status.PENDING.name)] = np.diff(first)
    return rows


def merge(into: Rows, other: Mapping[str, Any]) -> None:
    """Take the cells of `other`, which come behind those of `into`, in as well."""
    for name, column in into.items():
        output, _, kind = name.rpartition(" ")
        if kind in ("min", "max"):
            # an equal one that comes later is not taken; the first cell with a value always is, be it infinite
            better = other[name] < column if kind == "min" else other[name] > column
            better |= (into[f"{name} at"] == NO_CELL) & (other[f"{name} at"] != NO_CELL)
            for part in (name, f"{name} at", f"{name} status"):
                into[part][better] = other[part][better]
        elif kind == "sum":
            rest = into[f"{output} rest"]
            with np.errstate(invalid="ignore", over="ignore"):
                column[...], rounding = _two_sum(column, other[name])
                rest += other[f"{output} rest"]
                rest += rounding
            rest[~np.isfinite(column)] = 0.0
        elif kind in (BY_STATUS, BY_METHOD, "count", "histogram"):
            column += other[name]


class Reducer:
    """Solves row blocks of a study with a summary and reduces each to a row, for one thread at a time."""

    def __init__(self, study: Study, solver: SolveCells) -> None:
        self.study, self.row_blocks, self.solver = study, row_blocks(study), solver
        self.strip = _strip_cells(study)
        self._cells = empty_cells(study, min(self.strip, self.row_blocks.size))

    def solve(self, start: int, stop: int, rows: Mapping[str, Any]) -> None:
        """Fill `rows` with the rows `start` to `stop`."""
        _clear(rows)
        for strip in self.row_blocks.strips(start, stop, self.strip):
            cells = self._cells.rows(slice(strip.rows * strip.cells))
            self.solver.solve(strip.cell, cells)
            place = slice(strip.row - start, strip.row - start + strip.rows)
            found = reduced(self.study, strip.cell, strip.rows, cells)
            merge({name: column[place] for name, column in rows.items()}, found)


def reduced(study: Study, cell: int, rows: int, cells: Cells) -> Rows:
    """Rows of equally many cells, which lie one behind the other from cell number `cell` on."""
    assert study.summary is not None
    found: Rows = {
        BY_STATUS: _counted(cells.status, rows, _OF_STATUS, len(STATUSES)),
        BY_METHOD: _counted(cells.used, rows, _OF_METHOD, len(study.kernel.methods) + 1),
    }
    for name, reductions in study.summary.outputs.items():
        values = cells.outputs[name].reshape(rows, -1, *cells.outputs[name].shape[1:])
        missing = np.isnan(values)
        gaps = missing.any()
        count = np.full((rows, *values.shape[2:]), values.shape[1])
        own: Rows = {"count": count - missing.sum(axis=1) if gaps else count}
        offset = (np.arange(rows) * values.shape[1]).reshape(-1, *[1] * (values.ndim - 2))
        for end, worst in (("min", math.inf), ("max", -math.inf)):
            if end in reductions or f"arg{end}" in reductions:
                filled = np.where(missing, worst, values) if gaps else values
                place = (filled.argmin if end == "min" else filled.argmax)(axis=1)
                own[end] = np.take_along_axis(filled, place[:, None], axis=1)[:, 0]
                if gaps:
                    # where none is better than one that is missing, the first value that there is, if any, is as good
                    void = np.take_along_axis(missing, place[:, None], axis=1)[:, 0]
                    place = np.where(void, missing.argmin(axis=1), place)
                none = own["count"] == 0
                own[f"{end} at"] = np.where(none, NO_CELL, place + offset + cell)
                own[f"{end} status"] = np.where(none, 0, cells.status[place + offset])
        if "mean" in reductions:
            own["sum"], own["rest"] = tree_sum(np.where(missing, 0.0, values) if gaps else values)
        if "histogram" in reductions:
            own["histogram"] = _histogram(values, missing, study.summary.edges[name])
        found |= {f"{name} {part}": column for part, column in own.items()}
    return found


def seconds_a_cell(study: Study) -> float:
    """What reducing a cell takes, tried on as many whole row blocks as a strip holds, or on as much of one."""
    blocks = row_blocks(study)
    length = min(blocks.cells, _strip_cells(study))
    rows = min(_strip_cells(study), blocks.size) // length
    cells = _zeros(study, rows * length)
    return min(timeit.repeat(lambda: reduced(study, 0, rows, cells), number=1, repeat=3)) / cells.number


def strip_bytes(study: Study) -> int:
    """Bytes of the cells that a thread holds while it reduces them."""
    return 0 if study.summary is None else _strip_cells(study) * (_cell_bytes(study) + 2)


def tree_sum(values: Floats) -> tuple[Floats, Floats]:
    """Sum along axis 1 as sum + rest, halves added to halves; the tree depends on the length of the axis alone."""
    total, rest = values, np.zeros_like(values[:, :0])
    with np.errstate(invalid="ignore", over="ignore"):
        while total.shape[1] > 1:
            half = (total.shape[1] + 1) // 2
            if total.shape[1] < 2 * half:
                total, rest = (np.concatenate([part, np.zeros_like(part[:, :1])], axis=1) for part in (total, rest))
            total, rounding = _two_sum(total[:, :half], total[:, half:])
            if rest.shape[1]:
                rounding += rest[:, :half]
                rounding += rest[:, half:]
            rest = rounding
    total = total[:, 0].copy()
    return total, np.where(np.isfinite(total), rest[:, 0], 0.0) if rest.shape[1] else np.zeros_like(total)


def _two_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """The rounded sum and its error, exactly; where the sum is infinite the error means nothing."""
    total = a + b
    part = total - a
    rest = total - part
    # in place: new arrays of this size cost more than the arithmetic
    np.subtract(a, rest, out=rest)
    np.subtract(b, part, out=part)
    rest += part
    return total, rest


def _histogram(values: Floats, missing: Any, edges: Floats) -> Any:
    """Counts in each bin, those below the first before and those above the last behind; the last edge is inside."""
    bins = len(edges) + 1
    place = np.searchsorted(edges, values, side="right")
    place[values == edges[-1]] = bins - 2
    place[missing] = bins  # counted there, and left out
    series = np.arange(values.size // values.shape[1]).reshape(values.shape[0], 1, *values.shape[2:])
    counts = np.bincount((place + series * (bins + 1)).ravel(), minlength=series.size * (bins + 1))
    return counts.reshape(values.shape[0], *values.shape[2:], bins + 1)[..., :-1]


def _counted(codes: Any, rows: int, places: Any, kinds: int) -> Any:
    """How often each of so many kinds stands in each row, shape (rows, kinds); `places` are those of all codes."""
    codes = codes.view(np.uint8)
    if (codes == codes[0]).all():
        counts = np.zeros((rows, kinds), np.int64)
        counts[:, places[codes[0]]] = len(codes) // rows
        return counts
    keys = places[codes].reshape(rows, -1) + np.arange(rows)[:, None] * kinds
    return np.bincount(keys.ravel(), minlength=rows * kinds).reshape(rows, kinds)


def _clear(rows: Mapping[str, Any]) -> None:
    """Make the rows those of no cell at all."""
    empty = {"min": math.inf, "max": -math.inf, "at": NO_CELL}
    for name, column in rows.items():
        column.fill(empty.get(name.rpartition(" ")[2], 0))


def _strip_cells(study: Study) -> int:
    """Cells of a strip, of the study alone, for the bits of sums depend on it."""
    return min(STRIP, 1 << max(0, (STRIP_BYTES // _cell_bytes(study)).bit_length() - 1))


def _cell_bytes(study: Study) -> int:
    return sum(8 * math.prod(shape) for shape in study.shapes.values())


def _zeros(study: Study, cells: int) -> Cells:
    found = empty_cells(study, cells)
    for column in (*found.outputs.values(), found.status, found.used):
        column.fill(0)
    return found
