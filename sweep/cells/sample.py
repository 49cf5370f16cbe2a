"""Samples of a study's cells, as studies of their own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from sweep.cells.block import Guard
from sweep.cells.grid import Grid
from sweep.cells.schema import columns, empty
from sweep.cells.solve import Solver
from sweep.errors import SweepError
from sweep.study.condition import names_in
from sweep.study.model import SETTINGS, Axis, Study, differs, frozen

MOST_TRIED = 1 << 16
"""Cells that are examined to find some that meet the study's condition."""
MOST_ASKED = 1 << 23
"""Cells that are examined before a run for one that meets the condition; this takes half a second."""
TRIES = 32
"""Cells drawn per wanted cell, if a condition excludes some."""


def sampled(study: Study, cells: int) -> Study:
    """At most so many cells, spread evenly over the grid, as a zip of the study's axes; methods and rtol are dropped.

    Cells that the study does not ask for are left out, unless it asks for none.
    """
    grid = Grid(study)
    chosen = spread(grid.size, cells)
    if study.where:
        many = spread(grid.size, MOST_TRIED)
        if len(asked := many[grid.asked(many)]):
            chosen = asked[spread(len(asked), cells)]
    return _picked(grid, chosen if set(study.axes).difference(SETTINGS) else chosen[:1])


def drawn(study: Study, cells: int, rng: np.random.Generator) -> Study:
    """Cells drawn at random from the study's grid, of those that it asks for as far as there are any, as a zip."""
    grid = Grid(study)
    row = rng.integers(0, grid.size, TRIES * cells if study.where else cells)
    asked = row[grid.asked(row)]
    return _picked(grid, np.resize(asked if len(asked) else row, cells))


def spread(size: int, count: int) -> Any:
    """At most so many places of so many, spread evenly."""
    return np.unique(np.linspace(0, size - 1, min(count, size)).astype(np.int64))


def _picked(grid: Grid, cells: Any) -> Study:
    """Some cells as a zip of the parameters that are swept; where none is, of one that is fixed."""
    study, fixed = grid.study, dict(grid.study.fixed)
    axes = {name: grid.values(name, cells) for name in study.axes if name not in SETTINGS}
    if not axes:
        name = min(study.kernel.parameters, key=lambda p: p.default is not None).name
        axes = {name: np.resize(fixed.pop(name), len(cells))}
    method = "auto" if "method" in study.axes else study.method
    return zipped(study, axes, fixed=fixed, method=method)


def zipped(study: Study, columns: Mapping[str, Any], **keys: Any) -> Study:
    """The study with these columns as its axes, value by value, and other `keys`; all its cells are asked and kept."""
    axes = {name: Axis(name, frozen(values), "values") for name, values in columns.items()}
    layout: dict[str, Any] = {"design": "zip", "blocks": (), "where": "", "summary": None}
    return replace(study, **layout, axes=axes, **keys)


def require_asked(study: Study) -> None:
    """Raises SweepError where the study's condition holds for none of its cells, if they are not too many to tell."""
    if not study.where:
        return
    size, conditioned = Grid(study).size, study
    if study.design == "product":  # the other axes matter for none
        named = {study.follows.get(name, name) for name in names_in(study.where)}
        conditioned = replace(study, axes={name: axis for name, axis in study.axes.items() if name in named})
    grid = Grid(conditioned)
    stride = math.ceil(grid.size / MOST_TRIED)
    looks = min(stride, MOST_ASKED // MOST_TRIED)
    # each look is at cells from all over the grid
    if any(grid.asked(np.arange(first, grid.size, stride)).any() for first in range(looks)):
        return
    if looks == stride:
        raise SweepError(f'where = "{study.where}": holds for none of the {size:,} cells; nothing is left to run')


def solved(study: Study) -> dict[str, Any]:
    """All cells of a study with their errors, in memory; those at which the kernel raises FAILED."""
    cells = empty(columns(study), Grid(study).size)
    Guard(Solver(study)).solve(0, cells)
    return cells


def multiplied(study: Study, factors: Mapping[str, Any]) -> Study:
    """The study, a zip, with its numbers times a factor each; factors of an axis may be one a cell.

    A fixed parameter that equals another one because it is not given is multiplied as that one is.
    """
    by = dict(factors)
    for p in study.kernel.parameters:
        if isinstance(p.default, str) and p.name in study.fixed and not differs(p, study.fixed) and p.default in by:
            by[p.name] = by[p.default]
    axes = {name: (axis.values.T * by.get(name, 1.0)).T for name, axis in study.axes.items()}
    fixed = {name: value * by.get(name, 1.0) for name, value in study.fixed.items()}
    fixed = {name: frozen(value) if np.ndim(value) else value for name, value in fixed.items()}
    along = {name: frozen(values * by.get(name, 1.0)) for name, values in study.along.items()}
    return zipped(study, axes, fixed=fixed, along=along)


def relative_error(values: Any, true: Any, size: float = 0.0) -> Any:
    """Largest relative error of an output in each cell; of traces to their largest value, and to `size` if larger.

    A number below the normal ones of float64 has few digits: its error is relative to the least of these.
    """
    rest, size = tuple(range(1, true.ndim)), max(size, float(np.finfo(float).tiny))
    scale = np.nanmax(np.abs(true), axis=rest, keepdims=True, initial=0.0) if rest else np.abs(true)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        off = np.abs(values - true) / np.maximum(scale, size)
    off = np.where((values == true) | (np.isnan(values) & np.isnan(true)), 0.0, off)
    return np.where(np.isnan(off), np.inf, off).max(axis=rest, initial=0.0)
