"""Cells to rows and rows to one: counts, extremes, sums and histograms that have the same bits however they are cut.

All but the sum are the same in any order; of equal extremes the one with the smallest cell number counts. A sum is
taken as an unevaluated pair sum + rest: over a strip in a binary tree of error-free additions, each addition's rounding
error kept in `rest` (Ogita, Rump & Oishi 2005, Sum2: as exact as in twice the digits); strips and rows then follow in
their order. NaN is no value and counts nowhere; infinities are values.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
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
OTHER = "OTHER"
"""Name under which cells of a status that is not known are counted."""
STATUSES = (*(s.name for s in Status), OTHER)
BY_STATUS, BY_METHOD = "cells_by_status", "cells_by_method"
NO_CELL = -1

Floats = NDArray[np.float64]
Rows = dict[str, Any]

_NUMBERS = np.full(256, len(Status))
_NUMBERS[[int(s) for s in Status]] = np.arange(len(Status))


def row_columns(study: Study) -> tuple[Column, ...]:
    """The columns of a part of a study with a summary: what is known of each row block."""
    assert study.summary is not None
    found = [_column(BY_STATUS, "i8", len(STATUSES)), _column(BY_METHOD, "i8", len(study.kernel.methods) + 1)]
    for field in study.asked:
        shape = study.shape(field)
        reductions = study.summary.outputs[field.name]
        found.append(_column(f"{field.name} count", "i8", *shape))
        for end in _ends(reductions):
            kinds = {"": "f8", " at": "i8", " status": "i1"}
            found += [_column(f"{field.name} {end}{kind}", dtype, *shape) for kind, dtype in kinds.items()]
        if "mean" in reductions:
            found += [_column(f"{field.name} {part}", "f8", *shape) for part in ("sum", "rest")]
        if "histogram" in reductions:
            bins = len(study.summary.edges[field.name]) + 1
            found.append(_column(f"{field.name} histogram", "i8", *shape, bins))
    return tuple(found)


def nothing(study: Study, rows: int) -> Rows:
    """Rows of no cell at all."""
    found: Rows = {c.name: c.empty(rows) for c in row_columns(study)}
    cleared(found)
    return found


def cleared(rows: Mapping[str, Any]) -> None:
    """Make the rows rows of no cell at all."""
    empty = {"min": math.inf, "max": -math.inf, "at": NO_CELL}
    for name, column in rows.items():
        column.fill(empty.get(name.rpartition(" ")[2], 0))


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
            _take_extreme(into, other, name, kind)
        elif kind == "sum":
            rest = into[f"{output} rest"]
            with np.errstate(invalid="ignore", over="ignore"):
                total, rounding = two_sum(column, other[name])
                rest += other[f"{output} rest"]
                rest += rounding
            column[...] = total
            rest[~np.isfinite(total)] = 0.0
        elif kind in (BY_STATUS, BY_METHOD, "count", "histogram"):
            column += other[name]


def _take_extreme(into: Rows, other: Mapping[str, Any], name: str, end: str) -> None:
    """An equal one that comes later is not taken; the first cell with a value always is, be it infinite."""
    better = other[name] < into[name] if end == "min" else other[name] > into[name]
    better |= (into[f"{name} at"] == NO_CELL) & (other[f"{name} at"] != NO_CELL)
    for column in (name, f"{name} at", f"{name} status"):
        into[column][better] = other[column][better]


class Reducer:
    """Solves row blocks and reduces each to a row, for one thread at a time.

    Parameters
    ----------
    study : Study
        With a summary.
    solver : SolveCells, optional
        What solves cells; default: `Solver`.
    """

    def __init__(self, study: Study, solver: SolveCells | None = None) -> None:
        from sweep.cells.solve import Solver

        assert study.summary is not None
        self.study, self.row_blocks, self.solver = study, row_blocks(study), solver or Solver(study)
        self.strip = _strip_cells(study)
        self._cells = empty_cells(study, min(self.strip, self.row_blocks.size))

    def solve(self, start: int, stop: int, rows: Mapping[str, Any]) -> None:
        """Fill `rows` with the rows `start` to `stop`."""
        cleared(rows)
        for strip in self.row_blocks.strips(start, stop, self.strip):
            cells = self._cells.rows(slice(strip.rows * strip.cells))
            self.solver.solve(strip.cell, cells)
            found = self.reduce(strip.cell, strip.rows, cells)
            place = slice(strip.row - start, strip.row - start + strip.rows)
            merge({name: column[place] for name, column in rows.items()}, found)

    def seconds(self) -> float:
        """What reducing a cell takes, tried on as many whole row blocks as a strip holds, or on as much of one."""
        length = min(self.row_blocks.length, self._cells.number)
        rows = self._cells.number // length
        cells = self._cells.rows(slice(rows * length))
        for column in (*cells.outputs.values(), cells.status, cells.used):
            column.fill(0)
        taken = []
        for _ in range(3):
            begun = time.perf_counter()
            self.reduce(0, rows, cells)
            taken.append(time.perf_counter() - begun)
        return min(taken) / cells.number

    def reduce(self, cell: int, rows: int, cells: Cells) -> Rows:
        """Rows of equally many cells, which lie one behind the other from cell number `cell` on."""
        found: Rows = {
            BY_STATUS: _counted(cells.status, rows, len(STATUSES), _status_number),
            BY_METHOD: _counted(cells.used, rows, len(self.study.kernel.methods) + 1, _method_number),
        }
        assert self.study.summary is not None
        for name, reductions in self.study.summary.outputs.items():
            values = cells.outputs[name].reshape(rows, -1, *cells.outputs[name].shape[1:])
            found |= {f"{name} {what}": column for what, column in self._reduced(values, name, reductions).items()}
            for end in _ends(reductions):
                place = found[f"{name} {end} at"]
                inside = np.arange(rows).reshape(-1, *[1] * (place.ndim - 1)) * values.shape[1] + place
                none = place == NO_CELL
                found[f"{name} {end} status"] = np.where(none, 0, cells.status[np.where(none, 0, inside)])
                found[f"{name} {end} at"] = np.where(none, NO_CELL, inside + cell)
        return found

    def _reduced(self, values: Floats, name: str, reductions: tuple[str, ...]) -> Rows:
        """Of values of shape (rows, cells, ...); places of extremes are counted within the row."""
        assert self.study.summary is not None
        missing = np.isnan(values)
        gaps = bool(missing.any())
        count = np.full((values.shape[0], *values.shape[2:]), values.shape[1])
        found: Rows = {"count": count - missing.sum(axis=1) if gaps else count}
        for end in _ends(reductions):
            found[end], found[f"{end} at"] = _extreme(values, missing if gaps else None, end)
        if "mean" in reductions:
            found["sum"], found["rest"] = tree_sum(np.where(missing, 0.0, values) if gaps else values)
        if "histogram" in reductions:
            found["histogram"] = _histogram(values, missing, self.study.summary.edges[name])
        return found


def strip_bytes(study: Study) -> int:
    """Bytes of the cells that a thread holds while it reduces them."""
    return 0 if study.summary is None else _strip_cells(study) * (_cell_bytes(study) + 2)


def _strip_cells(study: Study) -> int:
    """Cells of a strip, of the study alone, for sums hang on it."""
    return min(STRIP, 1 << max(0, (STRIP_BYTES // _cell_bytes(study)).bit_length() - 1))


def _cell_bytes(study: Study) -> int:
    return sum(8 * math.prod(shape) for shape in study.shapes.values())


def _column(name: str, dtype: str, *shape: int) -> Column:
    return Column(name, dtype, (), shape, {})


def _ends(reductions: tuple[str, ...]) -> list[str]:
    """Which extremes the reductions need."""
    return [end for end in ("min", "max") if end in reductions or f"arg{end}" in reductions]


def _counted(codes: Any, rows: int, kinds: int, number: Callable[[Any], Any]) -> Any:
    """How often each of so many kinds stands in each row, shape (rows, kinds); `number` tells the kinds of codes."""
    counts = np.zeros((rows, kinds), np.int64)
    if (codes == codes[0]).all():
        counts[:, int(number(codes[:1])[0])] = len(codes) // rows
        return counts
    keys = number(codes).reshape(rows, -1) + np.arange(rows)[:, None] * kinds
    return np.bincount(keys.reshape(-1), minlength=rows * kinds).reshape(rows, kinds)


def _status_number(status: Any) -> Any:
    """Positions in `STATUSES`."""
    return _NUMBERS[status.view(np.uint8)]


def _method_number(used: Any) -> Any:
    """Positions among the methods, none before them."""
    return used.astype(np.intp) + 1


def _extreme(values: Floats, missing: Any, end: str) -> tuple[Floats, Any]:
    """Smallest or largest value along axis 1 and its place, the first of equals; without a value +-inf and NO_CELL."""
    worst = math.inf if end == "min" else -math.inf
    filled = values if missing is None else np.where(missing, worst, values)
    place = filled.argmin(axis=1) if end == "min" else filled.argmax(axis=1)
    best = np.take_along_axis(filled, place[:, None], axis=1)[:, 0]
    if missing is not None and (best == worst).any():
        # a missing value stands in for an infinity: look for the first real one
        real = (filled == worst) & ~missing
        place = np.where(best == worst, np.where(real.any(axis=1), real.argmax(axis=1), NO_CELL), place)
    return best, place


def two_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """The rounded sum and its error, exactly; where the sum is infinite the error means nothing."""
    total = a + b
    part = total - a
    rest = total - part
    # in place: new arrays of this size cost more than the arithmetic
    np.subtract(a, rest, out=rest)
    np.subtract(b, part, out=part)
    rest += part
    return total, rest


def tree_sum(values: Floats) -> tuple[Floats, Floats]:
    """Sum along axis 1 as sum + rest, halves added to halves; the tree hangs on the length of the axis alone."""
    total, rest = values, np.zeros_like(values[:, :0])
    with np.errstate(invalid="ignore", over="ignore"):
        while (length := total.shape[1]) > 1:
            half = (length + 1) // 2
            left, right, odd = slice(length - half), slice(half, length), slice(length - half, half)
            upper, rounding = two_sum(total[:, left], total[:, right])
            if rest.shape[1]:
                rounding += rest[:, left]
                rounding += rest[:, right]
            if odd.start < odd.stop:
                alone = rest[:, odd] if rest.shape[1] else np.zeros_like(total[:, odd])
                rounding = np.concatenate([rounding, alone], axis=1)
                upper = np.concatenate([upper, total[:, odd]], axis=1)
            total, rest = upper, rounding
    total = total[:, 0].copy()
    return total, np.where(np.isfinite(total), rest[:, 0], 0.0) if rest.shape[1] else np.zeros_like(total)


def _histogram(values: Floats, missing: Any, edges: Floats) -> Any:
    """Counts in each bin, those below the first before and those above the last behind; the last edge is inside."""
    bins = len(edges) + 1
    place = np.searchsorted(edges, values, side="right")
    place[values == edges[-1]] = bins - 2
    rows, _, *shape = values.shape
    series = np.arange(rows)[:, None] * math.prod(shape) + np.arange(math.prod(shape))
    keys = place.reshape(rows, -1, math.prod(shape)) + series[:, None, :] * bins
    kept = keys.reshape(-1) if not missing.any() else keys.reshape(-1)[~missing.reshape(-1)]
    return np.bincount(kept, minlength=rows * math.prod(shape) * bins).reshape(rows, *shape, bins)
