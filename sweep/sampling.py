"""Some cells of a study as a study of their own, to try things on."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from sweep.grid import Grid
from sweep.study import Axis, Study, frozen

ONE: Mapping[str, float] = {}


def sampled(study: Study, cells: int, factors: Mapping[str, float] = ONE) -> Study:
    """At most so many cells, spread evenly over the grid, as a zip over every parameter; methods and rtol are dropped.

    Parameters
    ----------
    factors : mapping of parameter or coordinate to number
        What its values are multiplied by.
    """
    grid, lengths, fields = Grid(study), study.lengths, study.kernel.parameters
    columns = [np.empty((1, *(lengths[d] for d in f.dims))) for f in fields]
    for k, value in grid.constants().items():
        columns[k][:] = value
    chosen = np.unique(np.linspace(0, grid.size - 1, min(cells, grid.size)).astype(np.int64))
    rows: list[list[Any]] = []
    for cell in chosen:
        grid.columns(int(cell), int(cell) + 1, columns)
        rows.append([column[0].copy() for column in columns])
    axes = {
        f.name: Axis(f.name, frozen(np.array([row[k] for row in rows]) * factors.get(f.name, 1.0)), "values")
        for k, f in enumerate(fields)
    }
    along = {name: frozen(values * factors.get(name, 1.0)) for name, values in study.along.items()}
    method = "auto" if "method" in study.axes else study.method
    return dataclasses.replace(
        study, design="zip", axes=axes, fixed={}, follows={}, along=along, method=method, summary=None
    )


def solved(study: Study) -> tuple[dict[str, Any], Any, Any]:
    """Outputs by name, statuses, and numbers of the methods used, of all cells of a study, in memory."""
    from sweep.solve import Solver

    size, lengths = Grid(study).size, study.lengths
    outputs = {f.name: np.empty((size, *(lengths[d] for d in f.dims))) for f in study.asked}
    status, used = np.empty(size, np.int8), np.empty(size, np.int8)
    Solver(study).solve(0, size, outputs, status, used)
    return outputs, status, used


def with_method(study: Study, method: str, rtol: float) -> Study:
    """The study by one method, at one rtol."""
    return dataclasses.replace(study, method=method, rtol=rtol)
