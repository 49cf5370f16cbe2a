"""Layout of a result before it exists: columns, coordinates and attributes, named after the CF conventions."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from kernels.interface import Field, Status
from sweep.cells.fingerprint import version
from sweep.study.model import Study, setting

CONVENTIONS = "CF-1.11"
STATUS, METHOD_USED, ERROR_BOUND = "status", "method_used", "error_bound"
ANCILLARY = (STATUS, METHOD_USED, ERROR_BOUND)
"""What a result says of every cell besides its outputs."""
Columns = Mapping[str, Any]
"""Some cells, filled or to be filled: arrays of shape (cells, ...) by name. Of outputs; `STATUS`, int8; `METHOD_USED`,
int8, the position in `kernel.methods`, or -1 where the cell is refused; and, where that is wanted, `ERROR_BOUND`,
float32, what values are right to, infinite where nobody knows, NaN where there are none."""


@dataclass(frozen=True)
class Column:
    """One variable of the result: an output, or one of `ANCILLARY`.

    `dims` and `shape` are its own, behind those of the grid ("phase",), (200,).
    """

    name: str
    dtype: str
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    attrs: Mapping[str, Any]

    @property
    def cell_bytes(self) -> int:
        """Bytes of one cell."""
        return np.dtype(self.dtype).itemsize * math.prod(self.shape)


@dataclass(frozen=True)
class Coordinate:
    """A coordinate of the result: an axis, a fixed parameter, or one that all cells share (phase, number of a mass)."""

    name: str
    dims: tuple[str, ...]
    values: Any
    attrs: Mapping[str, Any]


@dataclass(frozen=True)
class Schema:
    """Everything of a result except its numbers; the grid by the lengths of its dimensions."""

    grid: Mapping[str, int]
    columns: tuple[Column, ...]
    coordinates: tuple[Coordinate, ...]
    attrs: Mapping[str, Any]

    @property
    def sizes(self) -> dict[str, int]:
        """Length of every dimension, those of the grid first."""
        own = {d: n for column in self.columns for d, n in zip(column.dims, column.shape, strict=True)}
        own |= {d: n for c in self.coordinates for d, n in zip(c.dims, np.shape(c.values), strict=True)}
        return {**self.grid, **own}

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid."""
        return tuple(self.grid.values())


def cell_schema(study: Study, fingerprint: Mapping[str, str]) -> Schema:
    """The schema of a result of cells."""
    return Schema(study.grid_shape, columns(study), coordinates(study), attributes(study, fingerprint))


def columns(study: Study) -> tuple[Column, ...]:
    """The asked outputs in kernel order, then what is said of them."""
    # each output taken by itself says what it is right to
    said = {"ancillary_variables": " ".join(ANCILLARY)} | ({} if "rtol" in study.axes else {"rtol": study.rtol})
    shapes = study.shapes
    outputs = [Column(f.name, "f8", f.dims, shapes[f.name], {**_attrs(f), **said}) for f in study.asked]
    error = {
        "units": "1",
        "long_name": "largest relative error of the outputs: as the method bounds or estimates it, else rtol; "
        "inf where unknown",
        "relative_to": "the output itself; of a trace, its amplitude; of a state of a scene of one's own, its size",
    }
    status = {
        "long_name": "what became of the cell",
        "flag_values": np.array([int(s) for s in Status], "i1"),
        "flag_meanings": " ".join(s.name for s in Status),
    }
    used = {
        "long_name": "method that solved the cell",
        "flag_values": np.arange(-1, len(study.kernel.methods), dtype="i1"),
        "flag_meanings": " ".join(["none", *(m.name for m in study.kernel.methods)]),
    }
    kinds = ((ERROR_BOUND, "f4", error), (STATUS, "i1", status), (METHOD_USED, "i1", used))
    return (*outputs, *(Column(name, dtype, (), (), attrs) for name, dtype, attrs in kinds))


def empty(columns: Iterable[Column], cells: int) -> dict[str, Any]:
    """Uninitialised columns of so many cells."""
    return {column.name: np.empty((cells, *column.shape), column.dtype) for column in columns}


def empty_cells(study: Study, cells: int) -> dict[str, Any]:
    """Uninitialised columns of so many cells, without errors."""
    outputs = {name: np.empty((cells, *shape)) for name, shape in study.shapes.items()}
    return {**outputs, STATUS: np.empty(cells, np.int8), METHOD_USED: np.empty(cells, np.int8)}


def part(cells: Columns, rows: slice) -> dict[str, Any]:
    """Views of some of the cells."""
    return {name: column[rows] for name, column in cells.items()}


def coordinates(study: Study) -> tuple[Coordinate, ...]:
    """Axes, fixed parameters and shared coordinates."""
    fields = {f.name: f for f in (*study.kernel.parameters, *study.kernel.along)}
    found = []
    for dim, names in study.dims.items():
        for name in names:
            axis, field = study.axes[name], fields.get(name) or setting(name, study.kernel)
            values = axis.values if axis.words is None else np.array(axis.words)
            found.append(Coordinate(name, (dim, *field.dims), values, _attrs(field)))
    for name, value in study.fixed.items():
        field, attrs = fields[name], _attrs(fields[name])
        if field.choices:  # the number of a word
            attrs |= {
                "flag_values": np.array([*field.choices.values()], "f8"),
                "flag_meanings": " ".join(field.choices),
            }
        found.append(Coordinate(name, field.dims, np.float64(value), attrs))
    used = {d for f in (*study.kernel.parameters, *study.asked) for d in f.dims}
    found += [Coordinate(k, (k,), v, _attrs(fields[k])) for k, v in study.along.items() if k in used]
    for dim, length in study.lengths.items():
        if dim in used and dim not in study.along:
            attrs = {"units": "1", "long_name": f"number of the {dim}"}
            found.append(Coordinate(dim, (dim,), np.arange(1, length + 1), attrs))
    return tuple(found)


def now() -> str:
    """The time as ISO 8601 in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def ending(rate: float) -> dict[str, str]:
    """Attributes that are known when all cells are computed, so many a second."""
    end = now()
    return {"created": end, "end": end, "cells_per_second": f"{rate:.6e}"}


def attributes(study: Study, fingerprint: Mapping[str, str]) -> dict[str, Any]:
    """Global attributes; with them the file alone suffices to run the study again."""
    libraries = ("foliot", "numba", "llvmlite", "numpy", "xarray", "h5py", "h5netcdf")
    versions = [f"{name} {version(name)}" for name in libraries]
    return {
        "Conventions": CONVENTIONS,
        "title": study.title,
        "question": study.question,
        "kernel": study.kernel_name,
        "source": study.kernel.source,
        "design": study.design,
        **({"where": study.where} if study.where else {}),
        **{k: v for k, v in (("method", study.method), ("rtol", study.rtol)) if k not in study.axes},
        "study": study.text,
        "study_json": study.to_json(),
        "fingerprint": json.dumps(dict(fingerprint), sort_keys=True),
        "versions": ", ".join([*versions, f"python {platform.python_version()}", platform.machine()]),
    }


def _attrs(field: Field) -> dict[str, Any]:
    return {"units": field.unit, "long_name": field.doc}
