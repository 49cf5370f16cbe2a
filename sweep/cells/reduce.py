"""Variables of an output: every cell, or reductions of cells to rows, and of rows to one.

Counts, extremes, sums and histograms have the same bits however the grid is divided.

All but the sum are independent of order; of equal extremes the one with the smallest cell number counts. A sum is an
unevaluated pair sum + rest: within a strip by a binary tree of error-free additions, whose rounding errors are added up
in `rest` (Ogita, Rump & Oishi 2005, Sum2: as accurate as in twice the digits), then over strips and rows in order. NaN
is not a value and is not counted; infinities are values.
"""

from __future__ import annotations

import math
import timeit
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels.interface import Field, Status
from sweep.cells import schema
from sweep.cells.grid import SolveCells
from sweep.cells.partition import row_blocks
from sweep.cells.schema import METHOD_USED, STATUS, Column, Columns, Coordinate, Schema, empty, empty_cells, part
from sweep.study.model import Study

STRIP = 65536
"""Cells reduced at a time, where outputs are numbers."""
STRIP_BYTES = 16 << 20
"""Bytes that the outputs of a strip may take, where they are traces."""
STATUSES = (*(s.name for s in Status), "OTHER")
"""Names under which cells are counted, the last one those of a status that is not known."""
BY_STATUS, BY_METHOD = "cells_by_status", "cells_by_method"
NO_CELL = -1
CELL_METHODS = {"min": "minimum", "max": "maximum", "mean": "mean"}
Variable = tuple[str, Any, tuple[str, ...], dict[str, Any]]
"""Its name; numbers, shape (groups, ...); dims behind those of the grid; attributes."""
Floats = NDArray[np.float64]
Rows = dict[str, Any]
"""What is known of each row: counts of statuses and methods; of every output "period count", "period min at", ..."""

_OF_STATUS = np.full(256, len(Status))
_OF_STATUS[[int(s) for s in Status]] = np.arange(len(Status))
_OF_METHOD = np.roll(np.arange(256), -1)
"""Where each int8 code, taken as an uint8, is counted: among `STATUSES`; among the methods, none before them."""


def part_columns(study: Study) -> tuple[Column, ...]:
    """The columns of a part; of a study with a summary they are those of one cell, reduced."""
    if study.summary is None:
        return schema.columns(study)
    found = reduced(study, 0, 1, _zeros(study, 1))
    return tuple(Column(name, c.dtype.str[1:], (), c.shape[1:], {}) for name, c in found.items())


def pending(study: Study, start: int, stop: int) -> Rows:
    """Some of the rows, not computed yet."""
    rows = empty(part_columns(study), stop - start)
    _clear(rows)
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
        self.study, self.row_blocks, self.solver, self.grid = study, row_blocks(study), solver, solver.grid
        self._cells = empty_cells(study, min(_strip_cells(study), self.row_blocks.size))

    def solve(self, start: int, cells: Columns, wanted: Any = None) -> None:
        """Fills rows, from number `start` on; all are wanted."""
        _clear(cells)
        stop, strip = start + len(cells[BY_STATUS]), _strip_cells(self.study)
        for row, count, cell, each in self.row_blocks.strips(start, stop, strip):
            solved = part(self._cells, slice(count * each))
            self.solver.solve(cell, solved)
            place = slice(row - start, row - start + count)
            merge(part(cells, place), reduced(self.study, cell, count, solved))


def reduced(study: Study, cell: int, rows: int, cells: Columns) -> Rows:
    """Rows of equally many cells, which lie one behind the other from cell number `cell` on."""
    assert study.summary is not None
    found: Rows = {
        BY_STATUS: _counted(cells[STATUS], rows, _OF_STATUS, len(STATUSES)),
        BY_METHOD: _counted(cells[METHOD_USED], rows, _OF_METHOD, len(study.kernel.methods) + 1),
    }
    for name, reductions in study.summary.outputs.items():
        values = cells[name].reshape(rows, -1, *cells[name].shape[1:])
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
                own[f"{end} status"] = np.where(none, 0, cells[STATUS][place + offset])
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
    return min(timeit.repeat(lambda: reduced(study, 0, rows, cells), number=1, repeat=3)) / (rows * length)


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


def _zeros(study: Study, cells: int) -> dict[str, Any]:
    return {name: np.zeros_like(column) for name, column in empty_cells(study, cells).items()}


def output_schema(study: Study, fingerprint: Mapping[str, str]) -> Schema:
    """The schema of the output; the columns of a summary are those of no group at all."""
    if study.summary is None:
        return schema.cell_schema(study, fingerprint)
    over = study.summary.over
    kept = {dim: study.grid_shape[dim] for dim, names in study.dims.items() if names[0] not in over}
    none = _variables(study, pending(study, 0, 0))
    columns = tuple(Column(name, v.dtype.str[1:], dims, v.shape[1:], attrs) for name, v, dims, attrs in none)
    words = {"status_name": STATUSES, "method_name": ("none", *(m.name for m in study.kernel.methods))}
    said = {"status_name": "what became of a cell", "method_name": "method that solved a cell"}
    found = [*schema.coordinates(study)]
    found += [Coordinate(name, (name,), np.array(words[name]), {"long_name": said[name]}) for name in words]
    units = {field.name: field.unit for field in study.asked}
    for name, edges in study.summary.edges.items():
        for end, values in (("lower", edges[:-1]), ("upper", edges[1:])):
            attrs = {"units": units[name], "long_name": f"{end} edge of a bin"}
            found.append(Coordinate(f"{name}_bin_{end}", (f"{name}_bin",), values, attrs))
    attributes = {**schema.attributes(study, fingerprint), "over": " ".join(over)}
    return Schema(kept, columns, tuple(found), attributes)


def gathered(study: Study, rows: Rows) -> dict[str, Any]:
    """The output's columns of the groups that `rows`, whole groups of them, are of."""
    per_row = row_blocks(study).per_row
    split = {name: column.reshape(-1, per_row, *column.shape[1:]) for name, column in rows.items()}
    merged = {name: column[:, 0].copy() for name, column in split.items()}
    for place in range(1, per_row):
        merge(merged, {name: column[:, place] for name, column in split.items()})
    return {name: np.ascontiguousarray(values) for name, values, _, _ in _variables(study, merged)}


def _variables(study: Study, rows: Rows) -> Iterator[Variable]:
    """The variables of a summary, of one row a group: in the order of the kernel's outputs, then counts of cells."""
    for field in study.asked:
        start = f"{field.name} "
        own = {name.removeprefix(start): column for name, column in rows.items() if name.startswith(start)}
        for name, values, dims, attrs in _reductions(study, field, own):
            yield f"{field.name}_{name}", values, (*field.dims, *dims), attrs
    yield BY_STATUS, rows[BY_STATUS], ("status_name",), {"units": "1", "long_name": "cells of each status"}
    yield BY_METHOD, rows[BY_METHOD], ("method_name",), {"units": "1", "long_name": "cells that each method solved"}


def _reductions(study: Study, field: Field, own: Rows) -> Iterator[Variable]:
    """Those of one output; names and dims without the output's own."""
    assert study.summary is not None
    over, none = study.summary.over, own["count"] == 0
    yield "count", own["count"], (), {"units": "1", "long_name": f"cells with a value: {field.doc}"}
    for reduction in study.summary.outputs[field.name]:
        about = f"{reduction.removeprefix('arg')} of {field.doc}"
        if reduction in CELL_METHODS:
            methods = f"{': '.join(over)}: {CELL_METHODS[reduction]}"
            with np.errstate(invalid="ignore", over="ignore"):
                mean = reduction == "mean"
                values = (own["sum"] + own["rest"]) / np.maximum(own["count"], 1) if mean else own[reduction]
            attrs = {"units": field.unit, "long_name": about, "cell_methods": methods}
            yield reduction, np.where(none, np.nan, values), (), attrs
        elif reduction == "histogram":
            counts = own["histogram"]
            for part, values, where in (
                ("below", counts[..., 0], "below the first bin"),
                ("above", counts[..., -1], "above the last bin"),
                ("histogram", counts[..., 1:-1], "in each bin"),
            ):
                dims = (f"{field.name}_bin",) if part == "histogram" else ()
                yield part, values, dims, {"units": "1", "long_name": f"cells {where}: {field.doc}"}
        else:
            at, status = own[f"{reduction[3:]} at"], own[f"{reduction[3:]} status"]
            for name in over:
                yield from _place(study, reduction, name, at, about)
            flags = dict(next(c.attrs for c in schema.columns(study) if c.name == schema.STATUS))
            flags["flag_values"] = np.append(np.int8(-1), flags["flag_values"])
            flags["flag_meanings"] = f"none {flags['flag_meanings']}"
            flags["long_name"] = f"status of the cell at the {about}; none where no cell has a value"
            yield f"{reduction}_status", np.where(none, np.int8(-1), status), (), flags


def _place(study: Study, reduction: str, name: str, at: Any, about: str) -> Iterator[Variable]:
    """The value of an axis at an extreme; of an axis of words, the number of the word."""
    axis, source = study.axes[name], {p.name: p for p in study.kernel.parameters}.get(name)
    number, none = np.maximum(at, 0) // study.run(name) % len(axis), at == NO_CELL
    attrs: dict[str, Any] = {"long_name": f"{name} at the {about}"}
    if axis.words is not None:
        attrs |= {"flag_values": np.arange(-1, len(axis.words)), "flag_meanings": " ".join(["none", *axis.words])}
        yield f"{reduction}_{name}", np.where(none, -1, number), (), attrs
        return
    values = axis.values[number]
    values[none] = np.nan
    attrs["units"] = "1" if source is None else source.unit
    yield f"{reduction}_{name}", values, () if source is None else source.dims, attrs
