"""What an output holds: every cell, or of a study with a summary its reductions; and what a part of it holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Field, Status
from sweep.cells import schema as cells
from sweep.cells.grid import Box
from sweep.cells.partition import row_blocks
from sweep.cells.reduce import BY_METHOD, BY_STATUS, NO_CELL, STATUSES, Rows, merge, row_columns
from sweep.cells.schema import Column, Coordinate, Schema

if TYPE_CHECKING:
    from sweep.study.model import Axis, Study

CELL_METHODS = {"min": "minimum", "max": "maximum", "mean": "mean"}


def part_columns(study: Study) -> tuple[Column, ...]:
    """The columns of a part."""
    return cells.columns(study) if study.summary is None else row_columns(study)


def output_schema(study: Study, fingerprint: Mapping[str, str]) -> Schema:
    """The schema of the output."""
    if study.summary is None:
        return cells.cell_schema(study, fingerprint)
    attributes = {**cells.attributes(study, fingerprint), "over": " ".join(study.summary.over)}
    return Schema(_kept(study), tuple(_columns(study)), tuple(_coordinates(study)), attributes)


def gathered(study: Study, rows: Rows) -> dict[str, Any]:
    """The output's columns of the groups that `rows`, whole groups of them, are of."""
    assert study.summary is not None
    per_group = row_blocks(study).per_group
    groups = len(rows[BY_STATUS]) // per_group
    split = {name: column.reshape(groups, per_group, *column.shape[1:]) for name, column in rows.items()}
    merged = {name: column[:, 0].copy() for name, column in split.items()}
    for place in range(1, per_group):
        merge(merged, {name: column[:, place] for name, column in split.items()})
    found = {BY_STATUS: merged[BY_STATUS], BY_METHOD: merged[BY_METHOD]}
    for field in study.asked:
        own = {name.partition(" ")[2]: column for name, column in merged.items() if name.startswith(f"{field.name} ")}
        found |= {f"{field.name}_{name}": column for name, column in _values(study, field, own)}
    return found


def _values(study: Study, field: Field, own: Rows) -> Iterator[tuple[str, Any]]:
    """Name and numbers of every reduction of an output."""
    assert study.summary is not None
    yield "count", own["count"]
    none = own["count"] == 0
    for reduction in study.summary.outputs[field.name]:
        if reduction in ("min", "max"):
            yield reduction, np.where(none, np.nan, own[reduction])
        elif reduction == "mean":
            with np.errstate(invalid="ignore", over="ignore"):
                yield reduction, np.where(none, np.nan, (own["sum"] + own["rest"]) / np.maximum(own["count"], 1))
        elif reduction == "histogram":
            yield "below", own["histogram"][..., 0].copy()
            yield reduction, own["histogram"][..., 1:-1].copy()
            yield "above", own["histogram"][..., -1].copy()
        else:
            yield from _places(study, reduction, own)


def _places(study: Study, reduction: str, own: Rows) -> Iterator[tuple[str, Any]]:
    """Axis values and status of the cell of an extreme."""
    assert study.summary is not None
    at, status = own[f"{reduction[3:]} at"], own[f"{reduction[3:]} status"]
    for name in study.summary.over:
        axis = study.axes[name]
        number = np.maximum(at, 0) // study.run(name) % len(axis)
        if axis.words is None:
            value = axis.values[number]
            value[at == NO_CELL] = np.nan
            yield f"{reduction}_{name}", value
        else:
            yield f"{reduction}_{name}", np.where(at == NO_CELL, -1, number)
    yield f"{reduction}_status", np.where(at == NO_CELL, np.int8(Status.PENDING), status).astype("i1")


def _kept(study: Study) -> Box:
    """The axes that are not reduced."""
    assert study.summary is not None
    over = study.summary.over
    lengths = {dim: study.grid_shape[dim] for dim, names in study.dims.items() if names[0] not in over}
    return Box(tuple(lengths), tuple(lengths.values()))


def _coordinates(study: Study) -> Iterator[Coordinate]:
    assert study.summary is not None
    yield from cells.coordinates(study)
    yield Coordinate("status_name", ("status_name",), np.array(STATUSES), {"long_name": "what became of a cell"})
    methods = np.array(["none", *(m.name for m in study.kernel.methods)])
    yield Coordinate("method_name", ("method_name",), methods, {"long_name": "method that solved a cell"})
    units = {field.name: field.unit for field in study.asked}
    for name, edges in study.summary.edges.items():
        for end, values in (("lower", edges[:-1]), ("upper", edges[1:])):
            attrs = {"units": units[name], "long_name": f"{end} edge of a bin"}
            yield Coordinate(f"{name}_bin_{end}", (f"{name}_bin",), values, attrs)


def _columns(study: Study) -> Iterator[Column]:
    """In the order of the kernel's outputs, then the counts of cells."""
    for field in study.asked:
        yield from _output(study, field)
    attrs = {"units": "1", "long_name": "cells of each status"}
    yield Column(BY_STATUS, "i8", ("status_name",), (len(STATUSES),), attrs)
    attrs = {"units": "1", "long_name": "cells that each method solved"}
    yield Column(BY_METHOD, "i8", ("method_name",), (len(study.kernel.methods) + 1,), attrs)


def _output(study: Study, field: Field) -> Iterator[Column]:
    assert study.summary is not None
    shape = study.shape(field)
    over = ": ".join(study.summary.over)
    counts = {"units": "1", "long_name": f"cells with a value: {field.doc}"}
    yield Column(f"{field.name}_count", "i8", field.dims, shape, counts)
    for reduction in study.summary.outputs[field.name]:
        about = f"{reduction.removeprefix('arg')} of {field.doc}"
        if reduction in CELL_METHODS:
            attrs = {"units": field.unit, "long_name": about, "cell_methods": f"{over}: {CELL_METHODS[reduction]}"}
            yield Column(f"{field.name}_{reduction}", "f8", field.dims, shape, attrs)
        elif reduction == "histogram":
            yield from _histogram(study, field, shape)
        else:
            for name in study.summary.over:
                yield _place(study, f"{field.name}_{reduction}", study.axes[name], field, shape, about)
            status = next(c for c in cells.columns(study) if c.name == cells.STATUS)
            attrs = {**status.attrs, "long_name": f"status of the cell at the {about}"}
            yield Column(f"{field.name}_{reduction}_status", "i1", field.dims, shape, attrs)


def _histogram(study: Study, field: Field, shape: tuple[int, ...]) -> Iterator[Column]:
    assert study.summary is not None
    bins = len(study.summary.edges[field.name]) - 1
    for part, text in (("below", "below the first bin"), ("above", "above the last bin")):
        attrs = {"units": "1", "long_name": f"cells {text}: {field.doc}"}
        yield Column(f"{field.name}_{part}", "i8", field.dims, shape, attrs)
    attrs = {"units": "1", "long_name": f"cells in each bin: {field.doc}"}
    yield Column(f"{field.name}_histogram", "i8", (*field.dims, f"{field.name}_bin"), (*shape, bins), attrs)


def _place(study: Study, name: str, axis: Axis, field: Field, shape: tuple[int, ...], about: str) -> Column:
    """The value of an axis at an extreme; of an axis of words, the number of the word."""
    source = {p.name: p for p in study.kernel.parameters}.get(axis.name)
    attrs: dict[str, Any] = {"long_name": f"{axis.name} at the {about}"}
    if axis.words is not None:
        attrs["flag_values"] = np.arange(-1, len(axis.words))
        attrs["flag_meanings"] = " ".join(["none", *axis.words])
        return Column(f"{name}_{axis.name}", "i8", field.dims, shape, attrs)
    dims = source.dims if source is not None else ()
    attrs["units"] = source.unit if source is not None else "1"
    return Column(f"{name}_{axis.name}", "f8", (*field.dims, *dims), (*shape, *axis.values.shape[1:]), attrs)
