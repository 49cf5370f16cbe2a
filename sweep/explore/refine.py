"""Adaptive refinement: cells are added to a finished sweep until linear interpolation meets a tolerance.

In every round the cells are the corners of simplices (intervals along one axis), in coordinates stretched where
an output is curved. The error of a simplex is estimated from the surrounding cells (`mesh`); across a border between
statuses it is the length of its edges. Where it is too large, an edge is halved, down to a fixed fraction of the first
step, but not beside a pole, where halving does not help. Where errors do not decrease throughout a region, the values
are noisy, and no more cells are added. Errors are those of logarithms where values are positive, as a scaling law
needs; elsewhere they are relative to the largest value.

With one axis the result is an ordinary sweep over its values; with several, a list of cells as of a zip design.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from kernels.interface import Status
from sweep.cells.schema import ANCILLARY, STATUS
from sweep.errors import SweepError
from sweep.explore.mesh import Array, Indices, Mesh, at_pole, scatter, stretch
from sweep.explore.scattered import MOST_AXES, REFINED_TO, Box, axes_of, heights, kinds
from sweep.file import disk
from sweep.file.disk import check_target
from sweep.file.open import store_cells
from sweep.results.filter import cells_at
from sweep.results.statuses import require_as_read, statuses_of
from sweep.runs.loop import Task
from sweep.runs.run import computed
from sweep.study.model import Axis, Study, frozen
from sweep.study.read import study as as_study
from sweep.words import as_path, counted, number, require_dataset, several, whole_number

if TYPE_CHECKING:
    import xarray as xr

MOST_CELLS = 1_000_000
LEVELS, FURTHER_LEVELS = {1: 20, 2: 10, 3: 6}, 4
"""How often a step of the first grid may be halved, by number of axes, inside of a status, for a jump has no straight
line; across a border between statuses half as often, and so beside one with several axes, where values may go to
infinity."""
GROWTH = 1.5
"""Growth of the number of cells after which boxes are stretched anew."""
NOISE_SIZE = 8.0
"""Largest error of a simplex due to noise, as a multiple of the deviation of cells."""
SAME = 2.0**-40
"""Distance below which positions along an axis, from 0 to 1, are equal."""


class Refinement:
    """Result of `refine`.

    Attributes
    ----------
    dataset : Dataset
        All cells, original and added, in ascending order: along the axis, or for several axes along `cell`.
    added : int
        Number of added cells.
    uniform : int
        Number of cells of a uniform grid with the smallest step.
    error : float
        Largest remaining relative error of linear interpolation, estimated from neighbouring cells; without borders
        between statuses, and without `jumps`.
    tolerance : float
    complete : bool
        Whether the tolerance is met; not so where `most_cells` ran out, an output jumps, goes to infinity or is noisy.
    jumps : int
        Places where the tolerance is not met although edges are cut as often as is allowed, or cuts lessen nothing: at
        a jump, or where values go to infinity, as near borders of statuses.
    unseen : dict of str to str
        How far apart cells are along each axis, at most: nothing tells of a peak narrower than that.
    noise : float
        How far values scatter, relative, where more cells do not lessen that, so that none were added; 0 where they do.
    """

    def __init__(self, cells: Refiner, dataset: xr.Dataset) -> None:
        box, points, left = cells.box, cells.points, cells.valued & cells.left
        steps = [np.diff(np.unique(column)) for column in points.T]
        widths = np.ptp(points[cells.corners[cells.valued]], axis=1).max(axis=0, initial=0.0)
        self.dataset, self.added = dataset, len(points) - cells.first
        self.uniform = int(math.prod(round(1 / step[step > SAME].min()) + 1 for step in steps))
        self.error, self.tolerance = float(cells.size[cells.valued & ~left].max(initial=0.0)), cells.tolerance
        self.complete, self.jumps = not (cells.size > self.tolerance).any(), int(left.sum())
        apart = zip(cells.axes, widths, box.low, box.high, box.logarithmic, strict=True)
        self.unseen = {
            name: f"a factor {(high / low) ** width:.3g}" if logarithmic else f"{width * (high - low):.3g}"
            for name, width, low, high, logarithmic in apart
        }
        self.noise = max(cells.noise.values())

    def __repr__(self) -> str:
        text = f"{counted(self.dataset[STATUS].size, 'cell')}, {self.added:,} of them added"
        if len(self.unseen) == 1:
            text += f"; a uniform grid of the same resolution has {self.uniform:,}"
        text += f"\nlargest interpolation error: {self.error:.2g}, estimated from neighbouring cells"
        if self.noise:
            text += f"; values scatter by {self.noise:.1g} of their size from cell to cell, or bend within less than "
            text += "the distance between cells; more cells do not reduce this"
        elif self.error > self.tolerance:
            text += "; the tolerance is not met everywhere; allow more cells"
        if self.jumps:
            text += f"; except at {counted(self.jumps, 'place')} where it jumps or diverges"
        apart = ", ".join(f"{width} in {name}" for name, width in self.unseen.items())
        return f"{text}\ncells are up to {apart} apart; a peak narrower than that is not seen"


def refine(
    dataset: xr.Dataset,
    y: str | Sequence[str],
    tolerance: float,
    *,
    path: str | os.PathLike[str] | None = None,
    study: Study | None = None,
    most_cells: int = MOST_CELLS,
    workers: int | None = None,
    force: bool = False,
    isolate: bool = False,
    cell_timeout: float | str | None = None,
) -> Refinement:
    """Add cells to a finished sweep until outputs can be interpolated to a tolerance.

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`, a product of at most five axes of numbers; or an earlier result of `refine`.
    y : str or sequence of str
        Outputs with one value per cell.
    tolerance : float
        Relative error of the interpolation.
    path : path, optional
        HDF5 file for all cells, as of `run`. Until it is complete the rounds are kept beside it, and the same call
        continues after the last of them. None: in memory.
    study : Study, optional
        The study of the dataset; default: the one in its attributes.
    most_cells : int
        Largest total number of cells.
    workers, isolate, cell_timeout
        As of `run`.
    force : bool
        Overwrite an existing file at `path`, and discard the rounds of an earlier call.

    Raises
    ------
    SweepError
        The dataset is neither a finished product of axes of numbers nor a refined result; an output does not exist or
        has a coordinate of its own; `path` exists already, or cannot be written.

    Examples
    --------
    >>> import sweep
    >>> keys = {"outputs": ["period"], "axes": {"mu": [0.1, 0.3, 1.0, 3.0, 10.0]}, "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(kernel="foliot", **keys)
    >>> sweep.refine(ds, "period", 1e-3).complete
    True
    """
    require_dataset("refine", dataset)
    study, names = as_study(dataset if study is None else study), several("y", y)
    tolerance = number("tolerance", tolerance)
    _require(dataset, study, names, tolerance)
    whole_number("most_cells", most_cells)
    rounds, numbers, source = None, itertools.count(1), dataset.encoding.get("source")
    if path is not None:  # the rounds on the way to a file are kept beside it
        target = as_path(path)
        check_target(target, force=force, read=[Path(source)] if source else [])
        rounds = target.with_name(f"{target.name}.rounds")
        with disk.refusing(target):
            if force:
                shutil.rmtree(rounds, ignore_errors=True)
            rounds.mkdir(exist_ok=True)
    options: dict[str, Any] = {"workers": workers, "isolate": isolate, "cell_timeout": cell_timeout}

    def study_of(values: Mapping[str, Array], design: str = "zip") -> Study:
        axes = {name: Axis(name, frozen(column), "values") for name, column in values.items()}
        return dataclasses.replace(study, design=design, blocks=(), axes=axes, title=f"{study.title}, refined")

    def solve(values: Mapping[str, Array]) -> xr.Dataset:
        """A round of cells; of one that an earlier call has computed, the file is there."""
        file = None if rounds is None else rounds / f"{next(numbers)}.h5"
        with computed(Task(study_of(values), file, progress=file is not None, **options)) as found:
            return found.load()

    cells = Refiner(dataset, study, names, tolerance, most_cells, solve)
    cells.refine()
    # all cells in rising order, in a file or in memory
    order = np.lexsort([cells.cells[name] for name in reversed(cells.axes)])
    arrays = {name: column[order] for name, column in cells.cells.items()}
    values = {name: arrays.pop(name) for name in cells.axes}
    whole = study_of(values, "product" if len(values) == 1 else "zip")
    attrs = {REFINED_TO: json.dumps(dict.fromkeys(names, tolerance))}
    found = Refinement(cells, store_cells(whole, path, arrays, force, attrs=attrs))
    shutil.rmtree(rounds or "", ignore_errors=True)
    return found


def _require(dataset: xr.Dataset, study: Study, names: Sequence[str], tolerance: float) -> None:
    """Raises SweepError for what cannot be refined."""
    axes = study.axes.values()
    if not 0 < tolerance < 1:
        raise SweepError(f"tolerance: expected a number between 0 and 1, found {tolerance}")
    if bool((statuses_of(dataset) == Status.PENDING).any()):
        raise SweepError("the sweep is not finished; run it to its end first")
    require_as_read(dataset, study, [*study.outputs, *ANCILLARY])
    if not names:
        raise SweepError("y: name at least one output")
    if any(axis.words is not None or axis.values.ndim > 1 for axis in axes):
        raise SweepError("only axes of numbers can be refined")
    if study.design != "product" and not axes_of(dataset):
        raise SweepError("only a product of axes can be refined, or an earlier result of refine")
    if len(axes) > MOST_AXES:
        raise SweepError(f"at most {MOST_AXES} axes can be refined, found {len(axes)}; fix the others")
    if dataset[STATUS].dims == tuple(study.axes) and not all(dataset.indexes[axis.name].is_unique for axis in axes):
        raise SweepError("an axis has a value twice; take one of each, e.g. by ds.drop_duplicates(...)")
    if any(np.unique(dataset[axis.name]).size < 2 for axis in axes):
        raise SweepError("an axis to be refined needs at least two values")
    if not all(np.isfinite(axis.values).all() for axis in axes):
        raise SweepError("an axis to be refined needs finite values")
    for name in names:
        if name not in study.outputs or name not in dataset or dataset[name].dims != dataset[STATUS].dims:
            raise SweepError(f"{name}: is not an output with one value per cell")


class Refiner:
    """Cells joined to simplices, whose edges are cut until outputs can be interpolated.

    It begins with a dataset; `solve` makes further ones, of cells with given values of the axes. `cells` are the
    columns of all: axes, outputs, and what is said of them.
    """

    def __init__(
        self,
        dataset: xr.Dataset,
        study: Study,
        names: Sequence[str],
        tolerance: float,
        most_cells: int,
        solve: Callable[[Mapping[str, Array]], xr.Dataset],
    ) -> None:
        self.tolerance, self.most, self._solve = tolerance, most_cells, solve
        self.axes, self.first = list(study.axes), dataset[STATUS].size
        first = cells_at(dataset.load(), np.arange(self.first))
        self.cells: dict[str, Any] = {name: first[name].values for name in (*self.axes, *study.outputs, *ANCILLARY)}
        self.box = Box.of(first, self.axes)
        self.points = self.box.points(self.cells)  # from 0 to 1, shape (cells, axes)
        # the two cells that each was put between; of the first ones, itself
        self.origins = np.stack([np.arange(self.first)] * 2, axis=1)
        even = self.first ** (1 / len(self.axes)) if study.design != "product" else 0.0
        self._steps = np.array([even or len(axis) - 1 for axis in study.axes.values()])
        # how far values of an output scatter, which more cells do not lessen; 0 where they do
        self.noise = dict.fromkeys(names, 0.0)
        self._to_cut: dict[str, list[tuple[int, float]]] = {name: [] for name in names}

    def refine(self) -> None:
        """Rounds of cuts, each of edges that share no end, until nothing is to be cut however outputs are judged."""
        # between two values nothing tells whether an output bends
        for k in range(len(self.axes)):
            if np.isin(self.points[:, k], (0, 1)).all():
                middle = self.points[self.points[:, k] == 0]
                middle[:, k] = 0.5
                self._add(middle)
        stretched_at = 0
        while True:
            if len(self.points) >= GROWTH * stretched_at:
                stretches = {name: stretch(self.points, heights(self.cells[name])) for name in self.noise}
                stretched_at = len(self.points)
            parts = zip(*(self._judged(name, stretches[name]) for name in self.noise), strict=True)
            self.corners, self.size, self.valued, edges, wanted, self.left = map(np.concatenate, parts)
            # worst first, as many as are allowed; none shares an end with one before: a cut changes what is known there
            used, cuts = np.zeros(len(self.points), dtype=bool), []
            todo = np.flatnonzero(wanted & ~self.left)
            for ends in edges[todo[np.argsort(np.round(-np.log(self.size[todo]), 6), kind="stable")]]:
                if not used[ends].any():
                    used[ends] = True
                    cuts.append(ends)
            if not (cuts := cuts[: max(0, self.most - len(self.points))]):
                return
            self._add(self.points[np.array(cuts)].mean(axis=1), np.array(cuts))

    def _add(self, points: Array, ends: Indices | None = None) -> None:
        """Solves further cells, maybe in the middles between two others.

        Of places along an axis that rounding alone tells apart, all get the value of the first.
        """
        values, before = {}, len(self.points)
        self.points = np.concatenate([self.points, points])
        for k, name in enumerate(self.axes):
            known = np.concatenate([self.cells[name], self.box.values(k, points[:, k])])
            _, first, same = np.unique(np.round(self.points[:, k] / SAME), return_index=True, return_inverse=True)
            values[name] = known[first[same[before:]]]
        solved = self._solve(values)
        self.cells = {name: np.concatenate([column, solved[name].values]) for name, column in self.cells.items()}
        itself = before + np.arange(len(points))
        self.origins = np.concatenate([self.origins, np.stack([itself] * 2, axis=1) if ends is None else ends])

    def _judged(self, name: str, matrix: Array) -> tuple[Indices, Array, Any, Indices, Any, Any]:
        """Simplices, and for one output which edge of each is to be cut.

        Their corners; how far straight lines are off, infinite across a border between statuses that is to be cut;
        whether they are inside of one status; the ends of the edge to cut; whether the error is too large; and whether
        that is left as it is, since the edge is short or cuts lessen nothing.
        """
        points, axes, height = self.points, len(self.axes), heights(self.cells[name])
        finite = np.logical_and.reduce([np.isfinite(self.cells[each]) for each in self.noise])
        mesh = Mesh(points, height, kinds(self.cells[STATUS], finite), matrix)
        of_corners, of_ends, rows = mesh.kind[mesh.corners], mesh.kind[mesh.edges], np.arange(len(mesh.corners))
        alike = (of_corners == of_corners[:, :1]).all(axis=1)
        valued = alike & (of_corners[:, 0] >= 0)
        levels = LEVELS.get(axes, FURTHER_LEVELS)
        inside, border = 2.0**-levels, 2.0 ** -(levels // 2)
        # of edges, in steps of the first grid along the axis where they are longest
        extent = (abs(points[mesh.edges[:, :, 0]] - points[mesh.edges[:, :, 1]]) * self._steps).max(axis=2)

        # inside of one status as the cells of that status tell; across a border infinite while edges are longer than
        # they may stay
        size, cut = mesh.errors()
        across = np.where(of_ends[:, :, 0] != of_ends[:, :, 1], extent, -1.0)
        size[~valued] = np.where(across.max(axis=1) > border, math.inf, 0.0)[~valued]
        cut = np.where(alike, cut, across.argmax(axis=1))
        ends = mesh.edges[rows, cut]

        # beside one: as near as the simplices across it may stay wide
        least = np.full(len(rows), inside)
        if axes > 1 and not alike.all():
            tree = cKDTree(points[np.unique(mesh.corners[~alike])] * self._steps)
            apart = tree.query(points * self._steps, p=math.inf)[0]
            least[alike & (apart <= border)[mesh.corners].any(axis=1)] = border
        stuck = at_pole(height, self.origins, axes)[ends.max(axis=1)]
        finest = (extent[rows, cut] <= least) | (valued & np.isfinite(size) & stuck)

        # where values are noisy, errors are those of the noise
        wide = mesh.corners[valued & (size > max(self.tolerance, NOISE_SIZE * self.noise[name]))]
        volume = float(abs(np.linalg.det(points[wide[:, 1:]] - points[wide[:, :1]])).sum())
        self._to_cut[name].append((len(points), volume))
        self.noise[name] = max(self.noise[name], scatter(height, self.origins, axes, self._to_cut[name]))
        wanted = size > max(self.tolerance, NOISE_SIZE * self.noise[name])
        return mesh.corners, size, valued, ends, wanted, wanted & finest
