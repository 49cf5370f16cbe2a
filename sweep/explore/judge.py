"""Simplices between cells judged: how far an output's straight lines are off in each, and which edge to cut for it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sweep.explore.mesh import (
    Array,
    Indices,
    Parabolas,
    are_too_few,
    edges,
    interpolation_errors,
    largest,
    lengths,
    renewed,
    simplices,
)
from sweep.explore.metric import stretch, stretched_by

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


class Judged(NamedTuple):
    """Simplices: their corners, errors, the edges (m, 2) to cut, whether these are the finest allowed, whether all
    corners have values and one status, whether they lie beside a border of statuses."""

    corners: Indices
    size: Array
    ends: Indices
    finest: NDArray[np.bool_]
    valued: NDArray[np.bool_]
    beside: NDArray[np.bool_]


class Judge:
    """Judges simplices of one output, in the box stretched to where it bends; again only where cells around are new.

    `steps`: of the first grid along each axis.
    """

    def __init__(self, steps: Array) -> None:
        self.steps = steps
        self.stretched_at = 0
        self.stretched = np.eye(len(steps))
        self.heights = np.empty(0)
        self.corners = np.empty((0, len(steps) + 1), dtype=np.intp)
        self.known: dict[int, Parabolas] = {}

    def judged(self, points: Array, heights: Array, kind: Indices) -> Judged:
        """Errors at points (n, axes) with these heights and kinds of status, -1 without a value.

        Points that were judged before are the first ones.
        """
        self._prepare(points, heights)
        places = points @ self.stretched
        self.corners = corners = simplices(places)
        kinds = kind[corners]
        alike = (kinds == kinds[:, :1]).all(axis=1)
        size, ends = np.zeros(len(corners)), corners[:, :2].copy()
        for number in np.unique(kind[kind >= 0]).tolist():
            here = np.flatnonzero(alike & (kinds[:, 0] == number))
            size[here], ends[here] = self._errors(places, corners[here], kind == number, number)
        mixed = np.flatnonzero(~alike & (kinds >= 0).any(axis=1))
        size[mixed], ends[mixed] = self._borders(points, corners[mixed], kinds[mixed])
        axes = points.shape[1]
        beside = alike & self._near(points, corners[~alike])[corners].any(axis=1)
        levels = np.where(beside, BESIDE_LEVELS.get(axes, 2), LEVELS.get(axes, FEWEST_LEVELS))
        finest = self._extent(points, ends) <= 2.0**-levels
        return Judged(corners, size, ends, finest, alike & (kinds[:, 0] >= 0), beside)

    def looks_anew(self, points: Array) -> bool:
        """Whether it is to judge once more with all of the box stretched anew; not so where it has just done so."""
        if len(points) <= SETTLED * self.stretched_at:
            return False
        self.stretched_at = 0
        return True

    def _prepare(self, points: Array, heights: Array) -> None:
        """Stretches the box where it is time to; forgets what is not so any more."""
        late = len(points) >= GROWTH * self.stretched_at
        if late or not np.array_equal(heights[: len(self.heights)], self.heights, equal_nan=True):
            self.known = {}
        if late:
            before = points[: len(self.heights)], self.heights, self.corners, self.stretched
            self.stretched = stretched_by(*before) if self.stretched_at else stretch(points, heights)
            self.stretched_at = len(points)
        self.heights = heights

    def _errors(self, places: Array, corners: Indices, which: NDArray[np.bool_], number: int) -> tuple[Array, Indices]:
        """Over simplices whose corners are all of one kind, and the edges to cut."""
        members = np.flatnonzero(which)
        places, heights, own = places[members], self.heights[members], np.searchsorted(members, corners)
        if are_too_few(places):
            return np.full(len(corners), math.inf), largest(corners, lengths(places, own))
        self.known[number] = renewed(self.known.get(number), places, heights, own)
        size, ends = interpolation_errors(places, own, self.known[number])
        return size, members[ends]

    def _borders(self, points: Array, corners: Indices, kinds: Indices) -> tuple[Array, Indices]:
        """Infinite where a border between statuses has longer edges than are left there; and these edges."""
        axes = points.shape[1]
        pairs = edges(axes)
        extents = self._extent(points, corners[:, pairs])
        length = np.where(kinds[:, pairs[:, 0]] != kinds[:, pairs[:, 1]], extents, -1.0)
        wide = length.max(axis=1) > 2.0 ** -BORDER_LEVELS.get(axes, 2)
        return np.where(wide, math.inf, 0.0), largest(corners, length)

    def _near(self, points: Array, border: Indices) -> NDArray[np.bool_]:
        """Whether points are corners of simplices across a border, or as near to one as these may stay wide."""
        if not len(border):
            return np.zeros(len(points), dtype=bool)
        places = points * self.steps
        apart = cKDTree(places[np.unique(border)]).query(places, p=math.inf)[0]
        found: NDArray[np.bool_] = apart <= 2.0 ** -BORDER_LEVELS.get(points.shape[1], 2)
        return found

    def _extent(self, points: Array, ends: Indices) -> Array:
        """Of edges (..., 2), in steps of the first grid along the axis where they are longest."""
        found: Array = (abs(points[ends[..., 0]] - points[ends[..., 1]]) * self.steps).max(axis=-1)
        return found
