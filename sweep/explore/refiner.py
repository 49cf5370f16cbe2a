"""Rounds of cuts of edges between cells, until straight lines between them are right to a tolerance."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from sweep.cells.schema import ANCILLARY, STATUS
from sweep.explore.judge import Judge, Judged
from sweep.explore.mesh import Array, Indices
from sweep.explore.scattered import REFINED_TO, Box, heights, kinds
from sweep.study.model import Axis, Study, frozen

if TYPE_CHECKING:
    import xarray as xr

SAME = 2.0**-40
"""Distance of places along an axis, from 0 to 1, that are the same."""


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
        Whether the tolerance is met; not so where `most_cells` ran out or an output jumps.
    jumps : int
        Places where the tolerance is not met although edges are cut as often as is allowed.
    singular : int
        Likewise, as near borders of statuses as these are known, where values go to infinity or bend without end.
    unseen : dict of str to str
        How far apart cells are along each axis, at most: nothing tells of a peak narrower than that.
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

    def __str__(self) -> str:
        cells = self.dataset[STATUS].size
        text = f"{cells:,} cells, {self.added:,} of them added"
        if len(self.unseen) == 1:
            text += f"; an even grid as fine has {self.uniform:,}"
        text += f"\ninterpolation error left: {self.error:.2g}, as the cells around tell"
        if self.error > self.tolerance:
            text += "; the tolerance is not met everywhere, allow more cells"
        if self.jumps:
            text += f"; not in {self.jumps:,} place{'s' * (self.jumps > 1)} where it jumps or diverges"
        if self.singular:
            text += f"; not in the {self.singular:,} nearest a border of statuses, where values diverge"
        apart = ", ".join(f"{width} in {name}" for name, width in self.unseen.items())
        return f"{text}\ncells are up to {apart} apart; a peak narrower than that is not seen"


class Output(Protocol):
    """Solves further cells of a study, and writes all at the end."""

    @property
    def study(self) -> Study: ...

    def solved(self, axes: dict[str, Axis]) -> xr.Dataset:
        """Cells with these values."""

    def written(self, axes: dict[str, Axis], arrays: dict[str, Any], attrs: dict[str, str]) -> xr.Dataset:
        """All cells, with these values of the axes, outputs and statuses, and further attributes."""


class Refiner:
    """Cells joined to simplices, whose edges are cut until outputs can be interpolated."""

    def __init__(
        self, dataset: xr.Dataset, output: Output, names: Sequence[str], tolerance: float, most_cells: int
    ) -> None:
        self.output, self.names, self.tolerance, self.most = output, names, tolerance, most_cells
        self.parts = [_flat(dataset.load())]
        self.axes = list(output.study.axes)
        first = {name: self.parts[0][name].values for name in self.axes}
        self.box = Box.of(first)
        self.values = np.stack(list(first.values()), axis=1)
        self.points = self.box.points(first)
        self.known = [dict(zip(_keys(t), v, strict=True)) for t, v in zip(self.points.T, self.values.T, strict=True)]
        self.first = len(self.points)
        product = output.study.design == "product"
        steps = np.array([len(k) - 1 if product else self.first ** (1 / len(self.axes)) for k in self.known])
        self.judges = [Judge(steps) for _ in names]

    def refined(self) -> Refinement:
        """Rounds of cuts, each of edges that share no end, until nothing is to be cut however outputs are judged."""
        self._give_every_axis_a_middle()
        while True:
            found = self._judged()
            cuts = self._cuts(found)[: max(0, self.most - len(self.points))]
            if len(cuts):
                self._solve(*self._middles(cuts))
                continue
            again = [judge.looks_anew(self.points) for judge in self.judges]
            if not any(again):
                return self._joined(found, complete=not (found.size > self.tolerance).any())

    def _give_every_axis_a_middle(self) -> None:
        """Between two values nothing tells whether an output bends."""
        for k, known in enumerate(self.known):
            if len(known) == 2:
                points = self.points[self.points[:, k] == 0]
                values = self.values[self.points[:, k] == 0]
                points[:, k], values[:, k] = 0.5, self.box.values(k, np.array([0.5]))
                self._solve(points, values)

    def _judged(self) -> Judged:
        """Errors over the simplices of each output, and borders between statuses that are to be cut."""
        kind = self._kinds()
        found = [
            judge.judged(self.points, heights(self._column(name)), kind)
            for name, judge in zip(self.names, self.judges, strict=True)
        ]
        return Judged(*(np.concatenate(columns) for columns in zip(*found, strict=True)))

    def _kinds(self) -> Indices:
        finite = np.isfinite(np.stack([self._column(name) for name in self.names])).all(axis=0)
        return kinds(self._column(STATUS), finite)

    def _column(self, name: str) -> Any:
        return np.concatenate([part[name].values for part in self.parts])

    def _cuts(self, found: Judged) -> Indices:
        """Edges to cut, worst first; none shares an end with one before, for a cut changes what is known there."""
        wanted = np.flatnonzero((found.size > self.tolerance) & ~found.finest)
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

    def _solve(self, points: Array, values: Array) -> None:
        axes = {name: Axis(name, frozen(column), "values") for name, column in zip(self.axes, values.T, strict=True)}
        self.parts.append(_flat(self.output.solved(axes)))
        self.points, self.values = np.concatenate([self.points, points]), np.concatenate([self.values, values])

    def _joined(self, found: Judged, complete: bool) -> Refinement:
        order = np.lexsort(self.values.T[::-1])
        axes = {
            name: Axis(name, frozen(column[order]), "values")
            for name, column in zip(self.axes, self.values.T, strict=True)
        }
        arrays = {name: self._column(name)[order] for name in (*self.output.study.outputs, *ANCILLARY)}
        left = found.valued & found.finest & (found.size > self.tolerance)
        told = {REFINED_TO: json.dumps(dict.fromkeys(self.names, self.tolerance))}
        finest = [np.diff(np.unique(t)) for t in self.points.T]
        return Refinement(
            dataset=self.output.written(axes, arrays, told),
            added=len(self.points) - self.first,
            uniform=int(math.prod(round(1 / step[step > SAME].min()) + 1 for step in finest)),
            error=float(found.size[found.valued & ~left].max(initial=0.0)),
            tolerance=self.tolerance,
            complete=complete,
            jumps=int((left & ~found.beside).sum()),
            singular=int((left & found.beside).sum()),
            unseen=self._widest(found.corners[found.valued]),
        )

    def _widest(self, corners: Indices) -> dict[str, str]:
        """How far cells are apart, at most, along each axis; a factor where it is taken in logarithms."""
        width = np.ptp(self.points[corners], axis=1).max(axis=0, initial=0.0)
        ratio = (self.box.high / np.where(self.box.logarithmic, self.box.low, 1.0)) ** width
        span = self.box.high - self.box.low
        return {
            name: f"a factor {ratio[k]:.3g}" if self.box.logarithmic[k] else f"{width[k] * span[k]:.3g}"
            for k, name in enumerate(self.axes)
        }


def _keys(places: Array) -> list[float]:
    """Places along an axis, alike where rounding alone tells them apart."""
    found: list[float] = np.round(places / SAME).tolist()
    return found


def _flat(dataset: xr.Dataset) -> xr.Dataset:
    """With all its cells along one dimension, which is the first one of traces too."""
    if dataset[STATUS].ndim == 1:
        return dataset
    return dataset.stack(cell=list(dataset[STATUS].dims), create_index=False).transpose("cell", ...)
