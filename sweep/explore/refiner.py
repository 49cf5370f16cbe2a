"""Rounds of cuts of edges between cells, until straight lines between them are right to a tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.cells.schema import STATUS
from sweep.explore.judge import Judge, Judged
from sweep.explore.mesh import Array, Indices
from sweep.explore.scattered import Box, heights, kinds
from sweep.study.model import Study

if TYPE_CHECKING:
    import xarray as xr

SAME = 2.0**-40
"""Distance of places along an axis, from 0 to 1, that are the same."""
Solve = Callable[[Mapping[str, Array]], "xr.Dataset"]


@dataclass(frozen=True)
class Refinement:
    """What came of it.

    Attributes
    ----------
    dataset : Dataset
        All cells, the first ones and those added, in rising order: along the axis, or of several along `cell`.
    added : int
        Cells beyond the first ones.
    uniform : int
        Cells of an even grid as fine as the finest step.
    error : float
        Largest error left of straight lines between cells, relative, as the cells around tell it; not across borders
        of statuses, nor in `jumps` and `singular`.
    tolerance : float
    complete : bool
        Whether the tolerance is met; not so where `most_cells` ran out, an output jumps, or is noisy.
    jumps : int
        Places where the tolerance is not met although edges are cut as often as is allowed.
    singular : int
        Likewise, as near borders of statuses as these are known, where values go to infinity or bend without end.
    unseen : dict of str to str
        How far apart cells are along each axis, at most: nothing tells of a peak narrower than that.
    noise : float
        How far values scatter, relative, where more cells do not lessen that, so that none were added; 0 where they do.
    """

    dataset: xr.Dataset
    added: int
    uniform: int
    error: float
    tolerance: float
    complete: bool
    jumps: int
    singular: int
    unseen: dict[str, str]
    noise: float = 0.0

    def __str__(self) -> str:
        cells = self.dataset[STATUS].size
        text = f"{cells:,} cells, {self.added:,} of them added"
        if len(self.unseen) == 1:
            text += f"; an even grid as fine has {self.uniform:,}"
        text += f"\ninterpolation error left: {self.error:.2g}, as the cells around tell"
        if self.noise:
            text += f"; values scatter by {self.noise:.1g} of their size from cell to cell, or bend within less than "
            text += "the distance of cells, and more cells do not lessen that"
        elif self.error > self.tolerance:
            text += "; the tolerance is not met everywhere, allow more cells"
        if self.jumps:
            text += f"; not in {self.jumps:,} place{'s' * (self.jumps > 1)} where it jumps or diverges"
        if self.singular:
            text += f"; not in the {self.singular:,} nearest a border of statuses, where values diverge"
        apart = ", ".join(f"{width} in {name}" for name, width in self.unseen.items())
        return f"{text}\ncells are up to {apart} apart; a peak narrower than that is not seen"


class Refiner:
    """Cells joined to simplices, whose edges are cut until outputs can be interpolated.

    Parameters
    ----------
    dataset : Dataset
        The first cells.
    names : sequence of str
        Outputs.
    solve : callable
        Given values of the axes, as a zip of them: a Dataset of these cells.

    Attributes
    ----------
    points, values : ndarray, shape (cells, axes)
        Where the cells lie in a box from 0 to 1, and on the axes.
    first : int
        How many cells there were.
    """

    def __init__(
        self, dataset: xr.Dataset, study: Study, names: Sequence[str], tolerance: float, most_cells: int, solve: Solve
    ) -> None:
        self.names, self.tolerance, self.most, self._solve = names, tolerance, most_cells, solve
        self.parts = [_flat(dataset.load())]
        self.axes = list(study.axes)
        first = {name: self.parts[0][name].values for name in self.axes}
        self.box = Box.of(first)
        self.values = np.stack(list(first.values()), axis=1)
        self.points = self.box.points(first)
        self.known = [dict(zip(_keys(t), v, strict=True)) for t, v in zip(self.points.T, self.values.T, strict=True)]
        self.first = len(self.points)
        product = study.design == "product"
        steps = np.array([len(k) - 1 if product else self.first ** (1 / len(self.axes)) for k in self.known])
        self.judges = [Judge(steps, tolerance) for _ in names]
        self.origins = np.stack([np.arange(self.first)] * 2, axis=1)

    def refine(self) -> None:
        """Rounds of cuts, each of edges that share no end, until nothing is to be cut however outputs are judged."""
        # between two values nothing tells whether an output bends
        for k, known in enumerate(self.known):
            if len(known) == 2:
                first = self.points[:, k] == 0
                points, values = self.points[first], self.values[first]
                points[:, k], values[:, k] = 0.5, self.box.values(k, np.array([0.5]))
                self._add(points, values)
        while True:
            finite = np.isfinite(np.stack([self.column(name) for name in self.names])).all(axis=0)
            kind = kinds(self.column(STATUS), finite)
            parts = [
                judge.judged(self.points, heights(self.column(name)), kind, self.origins)
                for name, judge in zip(self.names, self.judges, strict=True)
            ]
            self.found = Judged(*(np.concatenate(column) for column in zip(*parts, strict=True)))
            cuts = self._cuts(self.found)[: max(0, self.most - len(self.points))]
            if len(cuts):
                self._add(*self._middles(cuts), cuts)
                continue
            again = [judge.looks_anew(len(self.points)) for judge in self.judges]
            if not any(again):
                return

    def column(self, name: str) -> Any:
        """An output, or what is said of it, of all cells."""
        return np.concatenate([part[name].values for part in self.parts])

    def _cuts(self, found: Judged) -> Indices:
        """Edges to cut, worst first; none shares an end with one before, for a cut changes what is known there."""
        wanted = np.flatnonzero((found.size > found.limit) & ~found.finest)
        used = np.zeros(len(self.points), dtype=bool)
        cuts = []
        for first, second in found.ends[wanted[np.argsort(-found.size[wanted], kind="stable")]].tolist():
            if not (used[first] or used[second]):
                used[first] = used[second] = True
                cuts.append((first, second))
        return np.array(cuts, dtype=np.intp).reshape(-1, 2)

    def _middles(self, cuts: Indices) -> tuple[Array, Array]:
        """Places and axis values in the middles of edges; a value that an axis has already is taken again."""
        points = self.points[cuts].mean(axis=1)
        values = np.empty(points.shape)
        for k, known in enumerate(self.known):
            between = self.box.values(k, points[:, k])
            values[:, k] = [known.setdefault(t, v) for t, v in zip(_keys(points[:, k]), between, strict=True)]
        return points, values

    def _add(self, points: Array, values: Array, ends: Indices | None = None) -> None:
        """Solves further cells, maybe in the middles between two others."""
        itself = len(self.points) + np.arange(len(points))
        self.parts.append(_flat(self._solve(dict(zip(self.axes, values.T, strict=True)))))
        self.points, self.values = np.concatenate([self.points, points]), np.concatenate([self.values, values])
        self.origins = np.concatenate([self.origins, np.stack([itself] * 2, axis=1) if ends is None else ends])

    def report(self, dataset: xr.Dataset) -> Refinement:
        """What came of it, with the dataset of all cells."""
        found, axes = self.found, range(len(self.axes))
        left = found.valued & found.finest & (found.size > found.limit)
        finest = [np.diff(np.unique(t)) for t in self.points.T]
        width = np.ptp(self.points[found.corners[found.valued]], axis=1).max(axis=0, initial=0.0)
        low, high = self.box.low, self.box.high
        apart = [
            f"a factor {(high[k] / low[k]) ** width[k]:.3g}"
            if self.box.logarithmic[k]
            else f"{width[k] * (high[k] - low[k]):.3g}"
            for k in axes
        ]
        return Refinement(
            dataset=dataset,
            added=len(self.points) - self.first,
            uniform=int(math.prod(round(1 / step[step > SAME].min()) + 1 for step in finest)),
            error=float(found.size[found.valued & ~left].max(initial=0.0)),
            tolerance=self.tolerance,
            complete=not (found.size > self.tolerance).any(),
            jumps=int((left & ~found.beside).sum()),
            singular=int((left & found.beside).sum()),
            unseen=dict(zip(self.axes, apart, strict=True)),
            noise=max(judge.noise for judge in self.judges),
        )


def _keys(places: Array) -> list[float]:
    """Places along an axis, alike where rounding alone tells them apart."""
    found: list[float] = np.round(places / SAME).tolist()
    return found


def _flat(dataset: xr.Dataset) -> xr.Dataset:
    """With all its cells along one dimension, which is the first one of traces too."""
    if dataset[STATUS].ndim == 1:
        return dataset
    return dataset.stack(cell=list(dataset[STATUS].dims), create_index=False).transpose("cell", ...)
