"""What an output holds: every cell, or of a study with a summary its reductions; and what a part of it holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Field, Status
from sweep.cells import schema as cells
from sweep.cells.grid import Box
from sweep.cells.partition import row_blocks
from sweep.cells.reduce import BY_METHOD, BY_STATUS, NO_CELL, STATUSES, Rows, merge, nothing, row_columns
from sweep.cells.schema import Column, Coordinate, Schema

if TYPE_CHECKING:
    from sweep.study.model import Study

CELL_METHODS = {"min": "minimum", "max": "maximum", "mean": "mean"}
Variable = tuple[str, Any, tuple[str, ...], dict[str, Any]]
"""Its name; numbers, shape (groups, ...); dims behind those of the grid; attributes."""


def part_columns(study: Study) -> tuple[Column, ...]:
    """The columns of a part."""
    return cells.columns(study) if study.summary is None else row_columns(study)


def output_schema(study: Study, fingerprint: Mapping[str, str]) -> Schema:
    """The schema of the output; the columns of a summary are those of no group at all."""
    if study.summary is None:
        return cells.cell_schema(study, fingerprint)
    over = study.summary.over
    kept = {dim: study.grid_shape[dim] for dim, names in study.dims.items() if names[0] not in over}
    none = _variables(study, nothing(study, 0))
    columns = tuple(Column(name, v.dtype.str[1:], dims, v.shape[1:], attrs) for name, v, dims, attrs in none)
    words = {"status_name": STATUSES, "method_name": ("none", *(m.name for m in study.kernel.methods))}
    said = {"status_name": "what became of a cell", "method_name": "method that solved a cell"}
    found = [*cells.coordinates(study)]
    found += [Coordinate(name, (name,), np.array(words[name]), {"long_name": said[name]}) for name in words]
    units = {field.name: field.unit for field in study.asked}
    for name, edges in study.summary.edges.items():
        for end, values in (("lower", edges[:-1]), ("upper", edges[1:])):
            attrs = {"units": units[name], "long_name": f"{end} edge of a bin"}
            found.append(Coordinate(f"{name}_bin_{end}", (f"{name}_bin",), values, attrs))
    attributes = {**cells.attributes(study, fingerprint), "over": " ".join(over)}
    return Schema(Box(tuple(kept), tuple(kept.values())), columns, tuple(found), attributes)


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
            attrs = {**next(c.attrs for c in cells.columns(study) if c.name == cells.STATUS)}
            attrs["long_name"] = f"status of the cell at the {about}"
            yield f"{reduction}_status", np.where(none, np.int8(Status.PENDING), status), (), attrs


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
