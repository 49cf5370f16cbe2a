"""Simplices between cells judged: how far an output's straight lines are off in each, and which edge to cut for it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sweep.explore.mesh import Array, Indices, are_too_few, edges, interpolation_errors, largest, simplices, with_beyond
from sweep.explore.metric import stretch

LEVELS = {1: 20, 2: 10, 3: 6}
"""How often a step of the first grid may be cut in two, by number of axes; a jump cannot be interpolated."""
FEWEST_LEVELS = 4
BORDER_LEVELS = {1: 10, 2: 5, 3: 3}
"""How often, because a border between statuses passes through it; no value is right inside the last."""
BESIDE_LEVELS = {1: 20, 2: 5, 3: 3}
"""How often beside such a border: values may go to infinity there, which no number of cells follows."""
GROWTH = 1.5
"""Cells, as a multiple, after which a box is stretched anew."""
SETTLED = 1.02
"""Likewise, before a refinement ends: those who read the result stretch it by all of its cells."""
LATEST = 128
"""Cells that were added last, which tell noise:"""
LESSENING = 0.5
"""they are off straight lines by more than this share of what those were that they descend from, as many cuts ago as
there are axes, where of a smooth output it is a quarter; and what is to be cut fills more than this share of what it
did with 2^axes times fewer cells, which is not so around a jump or a pole."""
NOISE_SIZE = 8.0
"""Error of a simplex in noise, at most, as a multiple of how far such a cell is off the line between two others."""


class Judged(NamedTuple):
    """Simplices: their corners, errors, what errors may stay, the edges (m, 2) to cut, whether these are the finest
    allowed, whether all corners have values and one status, whether they lie beside a border of statuses."""

    corners: Indices
    size: Array
    limit: Array
    ends: Indices
    finest: NDArray[np.bool_]
    valued: NDArray[np.bool_]
    beside: NDArray[np.bool_]


class Judge:
    """Judges simplices of one output, again and again as cells are added, in the box stretched to where it bends.

    Parameters
    ----------
    steps : ndarray, shape (axes,)
        Of the first grid along each axis.
    tolerance : float

    Attributes
    ----------
    noise : float
        How far values scatter, which more cells do not lessen; 0 where they do.
    """

    def __init__(self, steps: Array, tolerance: float) -> None:
        self.steps, self.tolerance, self.noise = steps, tolerance, 0.0
        self.stretched, self.stretched_at = np.eye(len(steps)), 0
        self._volumes: list[tuple[int, float]] = []

    def looks_anew(self, cells: int) -> bool:
        """Whether it is to judge once more with the box stretched by all cells; not so where it has just done so."""
        late = cells > SETTLED * self.stretched_at
        self.stretched_at = 0 if late else self.stretched_at
        return late

    def judged(self, points: Array, heights: Array, kind: Indices, origins: Indices) -> Judged:
        """Errors of straight lines between points, and borders between statuses that are to be cut.

        Parameters
        ----------
        points : ndarray, shape (n, axes)
            In a box from 0 to 1; those of earlier calls are the first ones.
        heights : ndarray, shape (n,)
        kind : ndarray of int, shape (n,)
            Of status; -1 without a value.
        origins : ndarray of int, shape (n, 2)
            Between which two points each was added; of the first grid, itself.
        """
        axes = points.shape[1]
        if len(points) >= GROWTH * self.stretched_at:
            self.stretched, self.stretched_at = stretch(points, heights), len(points)
        places = points @ self.stretched
        corners = simplices(places)
        kinds = kind[corners]
        alike = (kinds == kinds[:, :1]).all(axis=1)

        def extent(ends: Indices) -> Array:
            """Of edges (..., 2), in steps of the first grid along the axis where they are longest."""
            found: Array = (abs(points[ends[..., 0]] - points[ends[..., 1]]) * self.steps).max(axis=-1)
            return found

        # inside of one status: as the cells of that status tell
        size, ends = np.zeros(len(corners)), corners[:, :2].copy()
        for number in np.unique(kind[kind >= 0]):
            members = np.flatnonzero(kind == number)
            here = np.flatnonzero(alike & (kinds[:, 0] == number))
            if are_too_few(points[members]):
                size[here], ends[here] = math.inf, largest(corners[here], extent(corners[here][:, edges(axes)]))
            elif len(here):
                around = with_beyond(np.searchsorted(members, corners[here]))
                size[here], own = interpolation_errors(places[members], heights[members], around)
                ends[here] = members[own]

        # across a border: infinite while edges are longer than they may stay
        finest_border = 2.0 ** -BORDER_LEVELS.get(axes, 2)
        mixed, pairs = np.flatnonzero(~alike & (kinds >= 0).any(axis=1)), edges(axes)
        across = kinds[mixed][:, pairs[:, 0]] != kinds[mixed][:, pairs[:, 1]]
        length = np.where(across, extent(corners[mixed][:, pairs]), -1.0)
        size[mixed] = np.where(length.max(axis=1, initial=-1.0) > finest_border, math.inf, 0.0)
        ends[mixed] = largest(corners[mixed], length)

        # beside one: as near as the simplices across it may stay wide
        border, beside = np.unique(corners[~alike]), np.zeros(len(corners), bool)
        if len(border):
            apart = cKDTree(points[border] * self.steps).query(points * self.steps, p=math.inf)[0]
            beside = alike & (apart <= finest_border)[corners].any(axis=1)
        levels = np.where(beside, BESIDE_LEVELS.get(axes, 2), LEVELS.get(axes, FEWEST_LEVELS))
        finest = extent(ends) <= 2.0**-levels
        valued = alike & (kinds[:, 0] >= 0)
        wide = corners[valued & (size > self.limit)]
        self._look_for_noise(
            heights, origins, float(abs(np.linalg.det(points[wide[:, 1:]] - points[wide[:, :1]])).sum())
        )
        return Judged(corners, size, np.full(len(size), self.limit), ends, finest, valued, beside)

    def _look_for_noise(self, heights: Array, origins: Indices, volume: float) -> None:
        """Raises the limit where more cells do not lessen errors; `volume` is that of all simplices to be cut."""
        axes, cells = len(self.steps), len(heights)
        self._volumes.append((cells, volume))
        earlier = [v for count, v in self._volumes if count * 2**axes <= cells]
        if not earlier or volume <= LESSENING * earlier[-1]:
            return
        latest = before = np.arange(max(0, cells - LATEST), cells)
        for _ in range(axes):
            before = origins[before].max(axis=1)
        with np.errstate(invalid="ignore"):
            off = abs(heights - heights[origins].mean(axis=1))
        known = np.isfinite(off[latest] + off[before]) & (origins[before, 0] != origins[before, 1])
        latest, before = latest[known], before[known]
        if len(latest) > 0.75 * LATEST and np.median(off[latest] - LESSENING * off[before]) > 0:
            self.noise = max(self.noise, float(np.median(off[latest])))

    @property
    def limit(self) -> float:
        """Error that may stay."""
        return max(self.tolerance, NOISE_SIZE * self.noise)
