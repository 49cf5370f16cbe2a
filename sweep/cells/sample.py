"""Some cells of a study as a study of their own, to try things on."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sweep.cells.grid import Cells, Grid, empty_cells
from sweep.errors import SweepError
from sweep.study.condition import names_in
from sweep.study.model import Axis, Study, differs, frozen

MOST_TRIED = 1 << 16
"""Cells that are looked at to find some that are asked for."""
MOST_ASKED = 1 << 23
"""Cells that are looked at, before a run, for one that is asked for; it takes half a second."""
TRIES = 32
"""Cells that are drawn for each that is wanted, where a condition leaves some out."""
ONE: Mapping[str, float] = {}


def sampled(study: Study, cells: int, factors: Mapping[str, float] = ONE) -> Study:
    """At most so many cells, spread evenly over the grid, as a zip of the study's axes; methods and rtol are dropped.

    Cells that the study does not ask for are left out, unless it asks for none.

    Parameters
    ----------
    factors : mapping of parameter or coordinate to number
        What its values are multiplied by.
    """
    grid = Grid(study)
    chosen = _chosen(grid, cells)
    known = {p.name for p in study.kernel.parameters}
    swept = [name for name in study.axes if name in known]
    axes = {name: _axis(name, grid.values(name, chosen), factors) for name in swept}
    fixed = {name: _times(value, factors.get(name, 1.0)) for name, value in study.fixed.items()}
    if not axes:  # only methods or rtol were swept
        name = next(p.name for p in study.kernel.parameters if p.default is None)
        axes = {name: _axis(name, np.array([study.fixed[name]]), factors)}
        del fixed[name]
    along = {name: frozen(values * factors.get(name, 1.0)) for name, values in study.along.items()}
    method = "auto" if "method" in study.axes else study.method
    layout: dict[str, Any] = {"design": "zip", "blocks": (), "axes": axes, "where": "", "summary": None}
    return dataclasses.replace(study, **layout, fixed=fixed, along=along, method=method)


def _chosen(grid: Grid, cells: int) -> Any:
    """Numbers of at most so many cells that are asked for."""
    chosen = np.unique(np.linspace(0, grid.size - 1, min(cells, grid.size)).astype(np.int64))
    if not grid.study.where:
        return chosen
    many = np.unique(np.linspace(0, grid.size - 1, min(MOST_TRIED, grid.size)).astype(np.int64))
    asked = many[grid.asked(many)]
    return (
        asked[np.unique(np.linspace(0, len(asked) - 1, min(cells, len(asked))).astype(np.int64))]
        if len(asked)
        else chosen
    )


def require_asked(study: Study) -> None:
    """Raises SweepError where the study's condition holds for none of its cells, if they are not too many to tell."""
    if not study.where:
        return
    grid = Grid(_conditioned(study))
    stride = math.ceil(grid.size / MOST_TRIED)
    looks = min(stride, MOST_ASKED // MOST_TRIED)
    # each look is at cells from all over the grid
    if any(grid.asked(np.arange(first, grid.size, stride)).any() for first in range(looks)):
        return
    if looks == stride:
        size = Grid(study).size
        raise SweepError(f'where = "{study.where}": holds for none of the {size} cells; nothing is left to run')


def _conditioned(study: Study) -> Study:
    """The study without those axes of a product that its condition does not name."""
    if study.design != "product":
        return study
    named = {study.follows.get(name, name) for name in names_in(study.where)}
    return dataclasses.replace(study, axes={name: axis for name, axis in study.axes.items() if name in named})


def _axis(name: str, values: Any, factors: Mapping[str, float]) -> Axis:
    return Axis(name, frozen(values * factors.get(name, 1.0)), "values")


def _times(value: Any, factor: float) -> Any:
    return frozen(value * factor) if np.ndim(value) else value * factor


def solved(study: Study) -> Cells:
    """All cells of a study, in memory; those at which the kernel raises FAILED."""
    from sweep.cells.guard import Guard
    from sweep.cells.solve import Solver

    cells = empty_cells(study, Grid(study).size)
    Guard(Solver(study), lambda cell: None).solve(0, cells)
    return cells


def with_method(study: Study, method: str, rtol: float) -> Study:
    """The study by one method, at one rtol."""
    return dataclasses.replace(study, method=method, rtol=rtol)


def drawn(study: Study, cells: int, rng: np.random.Generator) -> Study:
    """Cells drawn at random from the study's grid, of those that it asks for as far as there are any, as a zip."""
    some, grid = sampled(study, 1), Grid(study)
    row = rng.integers(0, grid.size, cells if not study.where else TRIES * cells)
    asked = row[grid.asked(row)]
    row = np.resize(asked if len(asked) else row, cells)
    axes = {
        name: _axis(name, grid.values(name, row) if name in study.axes else np.resize(axis.values, cells), ONE)
        for name, axis in some.axes.items()
    }
    return dataclasses.replace(some, axes=axes)


def multiplied(study: Study, factors: Mapping[str, Any]) -> Study:
    """The study, a zip, with its numbers times a factor each; factors of an axis may be one a cell."""
    shared = {**factors} | {name: factors[other] for name, other in _followers(study).items() if other in factors}
    axes = {
        name: Axis(name, frozen(_by_cell(axis.values, factors.get(name, 1.0))), "values")
        for name, axis in study.axes.items()
    }
    fixed = {name: _times(value, shared.get(name, 1.0)) for name, value in study.fixed.items()}
    along = {name: frozen(values * factors.get(name, 1.0)) for name, values in study.along.items()}
    return dataclasses.replace(study, axes=axes, fixed=fixed, along=along)


def _by_cell(values: Any, factor: Any) -> Any:
    """Values (cells, ...) times one factor, or one a cell."""
    return (values.T * factor).T


def _followers(study: Study) -> dict[str, str]:
    """Fixed parameters that equal another one because they are not given, and which."""
    found: dict[str, str] = {}
    for p in study.kernel.parameters:
        if isinstance(p.default, str) and p.name in study.fixed and not differs(p, study.fixed):
            found[p.name] = found.get(p.default, p.default)
    return found
