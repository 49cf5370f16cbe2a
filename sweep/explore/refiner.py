"""Rounds of cuts of edges between cells, until straight lines between them are accurate to a tolerance.

In every round cells are joined to simplices, intervals along one axis, in a box stretched to where an output bends.
Each is judged: inside of one status by the cells around it (`mesh`), across a border between statuses by the length of
its edges. Where that is not good enough an edge is cut in the middle, down to a fixed share of the first grid's step.
Beside a pole, where cuts lessen nothing, edges are left alone; where errors stay as they are all over a region, values
are noisy, and no more cells are added.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sweep.cells.schema import STATUS
from sweep.explore.mesh import Array, Indices, edges, errors_inside, largest, simplices, stretch
from sweep.explore.scattered import Box, heights, kinds
from sweep.study.model import Study

if TYPE_CHECKING:
    import xarray as xr

LEVELS = {1: (20, 10, 20), 2: (10, 5, 5), 3: (6, 3, 3)}
FURTHER_LEVELS = (4, 2, 2)
"""How often a step of the first grid may be halved, by number of axes: inside of a status, for a jump has no straight
line; across a border between statuses; and beside one, where values may go to infinity."""
GROWTH, SETTLED = 1.5, 1.02
"""Factors of the number of cells after which boxes are stretched anew: on the way, and at the end, since those who
read the result stretch it by all of its cells."""
LESSENING = 0.5
"""A cut along each axis leaves a quarter of the distance from a straight line, where an output is smooth; of noise, and
of the volume that is to be cut in it, more than this share."""
CUTS, STAYS, JUMP = 6, 0.9, 0.2
"""At a pole the change from cell to cell stays above a share of what it was so many cuts before, and lies on both sides
of a new cell: at a jump one of them has less than a share of the other."""
LATEST, NOISE_SIZE = 128, 8.0
"""Cells added last, which tell noise; the error of a simplex in it, as a multiple of how far they are off, at most."""
SAME = 2.0**-40
"""Distance of places along an axis, from 0 to 1, that are the same."""


class Judged(NamedTuple):
    """Simplices, and what is to become of them."""

    corners: Indices
    size: Array  # the error of straight lines in each
    ends: Indices  # of the edge to cut, (m, 2)
    wanted: NDArray[np.bool_]  # the error is too large
    finest: NDArray[np.bool_]  # but the edge is not to be cut
    valued: NDArray[np.bool_]  # inside of one status
    beside: NDArray[np.bool_]  # beside a border of statuses


class Refiner:
    """Cells joined to simplices, whose edges are cut until outputs can be interpolated.

    It begins with a dataset; `solve` makes further ones, of cells with given values of the axes.
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
        self.tolerance, self.most, self._solve, self.axes = tolerance, most_cells, solve, list(study.axes)
        even = study.design != "product"
        cells = dataset.load()
        if cells[STATUS].ndim > 1:
            # all along one dimension, which is the first one of traces too
            cells = cells.stack(cell=list(cells[STATUS].dims), create_index=False).transpose("cell", ...)
        self.parts, self.box = [cells], Box.of(cells, self.axes)
        self.points = self.box.points(cells)  # from 0 to 1, shape (cells, axes)
        self.first = len(self.points)
        # the two cells that each was put between; of the first ones, itself
        self.origins = np.stack([np.arange(self.first)] * 2, axis=1)
        lengths = (len(axis) - 1 for axis in study.axes.values())
        self._steps = np.array([self.first ** (1 / len(self.axes)) if even else length for length in lengths])
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
                stretches = {name: stretch(self.points, heights(self.column(name))) for name in self.noise}
                stretched_at = len(self.points)
            parts = [self._judged(name, stretches[name]) for name in self.noise]
            self.found = found = Judged(*(np.concatenate(column) for column in zip(*parts, strict=True)))
            # worst first, as many as are allowed; none shares an end with one before: a cut changes what is known there
            used, cuts = np.zeros(len(self.points), dtype=bool), []
            todo = np.flatnonzero(found.wanted & ~found.finest)
            for ends in found.ends[todo[np.argsort(np.round(-np.log(found.size[todo]), 6), kind="stable")]]:
                if not used[ends].any():
                    used[ends] = True
                    cuts.append(ends)
            if cuts := cuts[: max(0, self.most - len(self.points))]:
                self._add(self.points[np.array(cuts)].mean(axis=1), np.array(cuts))
            elif len(self.points) > SETTLED * stretched_at:
                stretched_at = 0
            else:
                return

    def column(self, name: str) -> Any:
        """An axis, an output, or what is said of it, of all cells."""
        return np.concatenate([part[name].values for part in self.parts])

    def _add(self, points: Array, ends: Indices | None = None) -> None:
        """Solves further cells, maybe in the middles between two others.

        Of places along an axis that rounding alone tells apart, all get the value of the first.
        """
        values = {}
        for k, name in enumerate(self.axes):
            places = np.round(np.concatenate([self.points[:, k], points[:, k]]) / SAME)
            first, same = np.unique(places, return_index=True, return_inverse=True)[1:]
            known = np.concatenate([self.column(name), self.box.values(k, points[:, k])])
            values[name] = known[first[same[len(self.points) :]]]
        self.parts.append(self._solve(values))
        itself = len(self.points) + np.arange(len(points))
        self.points = np.concatenate([self.points, points])
        self.origins = np.concatenate([self.origins, np.stack([itself] * 2, axis=1) if ends is None else ends])

    def _judged(self, name: str, stretched: Array) -> Judged:
        """Errors of an output's straight lines between cells, and borders between statuses that are to be cut."""
        points, axes, height = self.points, len(self.axes), heights(self.column(name))
        finite = np.isfinite(np.stack([self.column(each) for each in self.noise])).all(axis=0)
        places, kind = points @ stretched, kinds(self.column(STATUS), finite)
        corners = simplices(places)
        of_corners, pairs = kind[corners], edges(axes)
        alike = (of_corners == of_corners[:, :1]).all(axis=1)
        inside, border, beside_border = (2.0**-level for level in LEVELS.get(axes, FURTHER_LEVELS))

        def extent(ends: Indices) -> Array:
            """Of edges (..., 2), in steps of the first grid along the axis where they are longest."""
            found: Array = (abs(points[ends[..., 0]] - points[ends[..., 1]]) * self._steps).max(axis=-1)
            return found

        # inside of one status: as the cells of that status tell
        size, ends = errors_inside(places, height, kind, corners)
        size[~alike | (of_corners[:, 0] < 0)] = 0.0

        # across a border: infinite while edges are longer than they may stay
        mixed = np.flatnonzero(~alike & (of_corners >= 0).any(axis=1))
        across = of_corners[mixed][:, pairs[:, 0]] != of_corners[mixed][:, pairs[:, 1]]
        length = np.where(across, extent(corners[mixed][:, pairs]), -1.0)
        size[mixed] = np.where(length.max(axis=1, initial=-1.0) > border, math.inf, 0.0)
        ends[mixed] = largest(corners[mixed], length)

        # beside one: as near as the simplices across it may stay wide
        beside = np.zeros(len(corners), bool)
        if not alike.all():
            tree = cKDTree(points[np.unique(corners[~alike])] * self._steps)
            apart = tree.query(points * self._steps, p=math.inf)[0]
            beside = alike & (apart <= border)[corners].any(axis=1)
        valued = alike & (of_corners[:, 0] >= 0)
        finest = extent(ends) <= np.where(beside, beside_border, inside)
        finest |= valued & np.isfinite(size) & self._is_at_pole(height)[ends.max(axis=1)]
        wide = corners[valued & (size > max(self.tolerance, NOISE_SIZE * self.noise[name]))]
        volume = float(abs(np.linalg.det(points[wide[:, 1:]] - points[wide[:, :1]])).sum())
        self._to_cut[name].append((len(points), volume))
        self.noise[name] = max(self.noise[name], self._noise(height, self._to_cut[name]))
        wanted = size > max(self.tolerance, NOISE_SIZE * self.noise[name])
        return Judged(corners, size, ends, wanted, finest, valued, beside)

    def _ancestors(self, cells: Indices) -> Indices:
        """The younger ends of the edges that were cut for cells, as many cuts ago as there are axes."""
        for _ in self.axes:
            cells = self.origins[cells].max(axis=1)
        return cells

    def _is_at_pole(self, height: Array) -> NDArray[np.bool_]:
        """Whether cuts have lessened nothing on the way to a cell, although there is no jump.

        The first cells, which were put between none, count as jumps: nothing is known yet.
        """
        cells, found = np.arange(len(height)), []
        with np.errstate(invalid="ignore"):
            halves = np.sort(abs(height[:, None] - height[self.origins]), axis=1)
            for _ in range(CUTS):
                found.append(halves[cells])
                cells = self._ancestors(cells)
            small, large = np.moveaxis(np.array(found), 2, 0)
            before, after = (np.median(part, axis=0) for part in (large[CUTS // 2 :], large[: CUTS // 2]))
            stays: NDArray[np.bool_] = (after > STAYS * before) & ((small <= JUMP * large).sum(axis=0) <= 1)
        return stays

    def _noise(self, height: Array, to_cut: Sequence[tuple[int, float]]) -> float:
        """How far the latest cells are off the line between the two that each was put between, where more cells do not
        lessen that; `to_cut` has the number of cells, and the volume of what is too far off, of all rounds."""
        cells, volume = to_cut[-1]
        earlier = [v for count, v in to_cut if count * 2 ** len(self.axes) <= cells]
        if not earlier or volume <= LESSENING * earlier[-1]:
            return 0.0
        with np.errstate(invalid="ignore"):
            off = abs(height - height[self.origins].mean(axis=1))
        off[self.origins[:, 0] == self.origins[:, 1]] = np.nan
        latest = np.arange(max(0, cells - LATEST), cells)
        before = off[self._ancestors(latest)]
        known = np.isfinite(off[latest] + before)
        if known.sum() <= 0.75 * LATEST or np.median((off[latest] - LESSENING * before)[known]) <= 0:
            return 0.0
        return float(np.median(off[latest][known]))
