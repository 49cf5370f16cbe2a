"""Simplices of cells, the error of linear interpolation in them, and the edge to halve next.

Simplices (intervals, triangles, tetrahedra) are those of Delaunay's triangulation.

Over a simplex with barycentric coordinates l_i, a quadratic function differs from its linear interpolation by

    E(l) = sum_{i<j} c_ij l_i l_j                                 (1)

so a quarter of c_ij is the error in the middle of the edge from i to j. The c_ij are fitted to the deviations of the
neighbouring cells from the linear extrapolation of the simplex; the residual of this fit, which shows kinks and peaks,
is added.

The box is stretched where an output is curved, so that simplices are long in directions on which it does not depend. On
an edge e linear interpolation is off by at most e |H| e / 8, H the matrix of second derivatives. Coordinates multiplied
by the square root of the mean of |H| make the curvature equal in all directions; an axis without influence, or a
direction of constant dimensionless groups, shrinks. Source: A. Loseille, F. Alauzet, SIAM J. Numer. Anal. 49 (2011) 38.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree
from threadpoolctl import threadpool_limits

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SHEAR = 0.013
"""Shear of the axes before triangulation: the corners of a box lie on a sphere and have many triangulations; sheared,
they have one, which is the same in all boxes."""
FLAT, OUTSIDE = 1e-9, 1e-9
"""Volume, in products of its edges, below which a simplex is none; how far out of one a point may be by rounding."""
AROUND = {1: 6, 2: 12, 3: 20}
"""Cells around a simplex that are taken, of one axis with its two; with more axes twice the unknowns."""
SAFETY, MISFIT = 1.6, {1: 5.0}
"""Times the parabola's error; and times what the parabola leaves, 2.5 with more axes: a kink in the middle between
cells of one axis is told at half its size from either side."""
LEAST_BASIS, RIDGE, BATCH = 0.3, 1e-12, 2_000
"""Of the fit: a cell's weight is the inverse of (1) with all c_ij = 1, or of the first; simplices at a time."""
ROUNDS, MOST = 3, 3000
"""Of a stretch: the first joins the cells of the box as it is, where simplices reach across more of the bends; and
simplices whose mean it takes."""
LESSENING = 0.5
"""A cut along each axis leaves a quarter of the distance from a straight line, where an output is smooth; of noise, and
of the volume that is to be cut in it, more than this share."""
CUTS, STAYS, JUMP = 6, 0.9, 0.2
"""At a pole the change from cell to cell stays above a share of what it was so many cuts before, and lies on both sides
of a new cell: at a jump one of them has less than a share of the other."""
LATEST = 128
"""Number of latest cells, by which noise is recognised."""
FLATTEST, STRAIGHT = 1e-5, 1e-9
"""Least share of the mean bend that a direction has: by 300 a box is stretched at most; what is taken for rounding."""


class Mesh:
    """Cells joined to simplices as an output wants it, which has some `heights` (n,) at `points` (n, axes) of a box.

    A simplex is judged by cells of its own `kind` alone, -1 of those that are of none; default: all with a value are of
    one. The `matrix` multiplies points before they are joined; default: what `stretch` tells. Then cells lie at
    `places`. The cells at the `corners` (m, axes + 1) of simplices, and at the ends of their `edges` (m, pairs, 2), are
    numbers; a simplex without a volume is left out.
    """

    def __init__(self, points: Array, heights: Array, kind: Indices | None = None, matrix: Array | None = None) -> None:
        self.axes, self.heights = points.shape[1], heights
        self.kind = np.isfinite(heights).astype(np.intp) - 1 if kind is None else kind
        self._matrix = stretch(points, heights) if matrix is None else matrix
        self._tilt = np.eye(self.axes) + SHEAR * np.tril(1.0 + 0.3 * np.arange(self.axes), -1)
        self.places = points @ self._matrix
        if self.axes == 1:
            order = np.argsort(self.places[:, 0], kind="stable")
            self.corners = np.column_stack([order[:-1], order[1:]])
        else:
            self._joined = Delaunay(self.places @ self._tilt)
            corners = np.sort(self._joined.simplices.astype(np.intp), axis=1)
            sides = self.places[corners[:, 1:]] - self.places[corners[:, :1]]
            self._solid = abs(np.linalg.det(sides)) > FLAT * np.linalg.norm(sides, axis=2).prod(axis=1)
            self.corners = corners[self._solid]
        self.edges: Indices = self.corners[:, _pairs(self.axes)]

    def errors(self) -> tuple[Array, Indices]:
        """How far straight lines are off in each simplex, as the cells around tell, and which of its edges to cut.

        Where its corners are of several kinds, or those of its kind too few, the error is infinite and the edge the
        longest one.
        """
        ends = self.places[self.edges]
        size, cut = np.full(len(ends), np.inf), np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2).argmax(axis=1)
        for number in np.unique(self.kind[self.kind >= 0]):
            members, here = self.kind == number, np.flatnonzero((self.kind[self.corners] == number).all(axis=1))
            if not len(here) or members.sum() < len(_pairs(self.axes)) + self.axes + 1:
                continue
            sizes = []
            for side in (-1, 1) if self.axes == 1 else (0,):
                bend, misfit = self.parabolas(members, self.corners[here], side)
                middle, inside = abs(bend) / 4, abs(bend.sum(axis=1)) / (self.axes + 1) ** 2
                largest = np.maximum(middle.max(axis=1, initial=0.0), inside)
                sizes.append(SAFETY * largest + MISFIT.get(self.axes, 2.5) * misfit)
            # the mean of logarithms: from one side of an interval alone a jump is seen that lies beyond it, not in it
            with np.errstate(divide="ignore"):
                size[here] = np.exp(np.nanmean(np.log(sizes), axis=0))
            cut[here] = middle.argmax(axis=1)
        return size, cut

    def parabolas(self, members: NDArray[np.bool_], corners: Indices, side: int = 0) -> tuple[Array, Array]:
        """The c_ij (k, pairs) of (1) over some simplices, and what they leave (k,), a mean square's root.

        They are fitted by least squares to how far those of the cells around that are members are off the straight
        continuation of a simplex; of one axis, maybe to those on one side alone, -1 or 1, and NaN where there are none.
        """
        points, heights, axes = self.places[members], self.heights[members], self.axes
        corners, pairs = np.searchsorted(np.flatnonzero(members), corners), _pairs(axes)
        tree, order = cKDTree(points), np.argsort(points[:, 0], kind="stable")
        ranks = np.argsort(order)
        number = min(len(points), axes + 1 + AROUND.get(axes, 2 * len(pairs)))
        bends, misfits = np.empty((len(corners), len(pairs))), np.empty(len(corners))
        for start in range(0, len(corners), BATCH):
            rows = slice(start, start + BATCH)
            place = points[corners[rows]]
            if axes == 1:  # as many on both sides
                aside = np.arange(1 - AROUND[1] // 2, AROUND[1] // 2 + 1)
                near = order[np.clip(ranks[corners[rows, :1]] + aside, 0, len(points) - 1)]
            else:
                near = tree.query(place.mean(axis=1), number)[1]
            rest = (points[near] - place[:, :1]) @ np.linalg.inv(place[:, 1:] - place[:, :1])
            shares = np.concatenate([1 - rest.sum(axis=2, keepdims=True), rest], axis=2)  # barycentric coordinates
            off = heights[near] - (shares @ heights[corners[rows]][:, :, None])[:, :, 0]
            basis = shares[:, :, pairs[:, 0]] * shares[:, :, pairs[:, 1]]
            weight = 1 / np.maximum(abs(basis).sum(axis=2), LEAST_BASIS)
            weight[(near[:, :, None] == corners[rows][:, None, :]).any(axis=2)] = 0.0
            if side:
                weight[side * (shares[:, :, 0] - 0.5) > 0] = 0.0
            left, right = basis * weight[:, :, None], (off * weight)[:, :, None]
            turned = left.transpose(0, 2, 1)
            square = turned @ left
            ridge = RIDGE * np.trace(square, axis1=1, axis2=2)[:, None, None] / len(pairs) + 1e-300
            bend = np.linalg.solve(square + ridge * np.eye(len(pairs)), turned @ right)
            bends[rows] = bend[:, :, 0]
            unexplained, count = ((right - left @ bend)[:, :, 0] ** 2).sum(axis=1), (weight > 0).sum(axis=1)
            misfits[rows] = np.sqrt(unexplained / np.where(count > 0, count, np.nan))
        return bends, misfits

    def between(self, points: Array) -> tuple[Array, Array]:
        """Heights on straight lines between cells, NaN outside of all simplices; and how far they may be off.

        That is infinite outside, and across kinds. For two axes and more.
        """
        places = points @ self._matrix @ self._tilt
        with threadpool_limits(1, "blas"):  # on busy cores its threads wait some milliseconds for each other, each time
            where = self._joined.find_simplex(places, tol=OUTSIDE).astype(np.intp)
        inverse = self._joined.transform[where]
        shares = np.einsum("nij,nj->ni", inverse[:, :-1], places - inverse[:, -1])
        shares = np.column_stack([shares, 1 - shares.sum(axis=1)])
        shares = np.where(abs(shares) < OUTSIDE, 0.0, shares)
        shares[where < 0] = np.nan
        # a corner that takes no part need have no value
        found = np.where(shares == 0, 0.0, shares * self.heights[self._joined.simplices[where]]).sum(axis=1)
        size = np.full(len(self._solid), np.inf)
        size[self._solid] = self.errors()[0]
        off = np.where(shares.max(axis=1) == 1, 0.0, np.where(where < 0, np.inf, size[where]))
        return found, off


def stretch(points: Array, heights: Array) -> Array:
    """The matrix (axes, axes) by which points are multiplied before those of these heights are joined."""
    axes, valued = points.shape[1], np.isfinite(heights)
    (row, column), pairs, found = np.triu_indices(axes), _pairs(axes), np.eye(axes)
    for _ in range(ROUNDS if axes > 1 and valued.sum() > len(pairs) + axes else 0):
        mesh = Mesh(points, heights, matrix=found)
        corners = mesh.corners[valued[mesh.corners].all(axis=1)]
        if not len(corners):
            return np.eye(axes)
        some = corners[:: len(corners) // MOST + 1]
        # second derivatives over each simplex, from c_ij = -e_ij H e_ij / 2 of its edges
        edge = mesh.places[some[:, pairs[:, 0]]] - mesh.places[some[:, pairs[:, 1]]]
        products = -edge[:, :, row] * edge[:, :, column] * np.where(row == column, 0.5, 1.0)
        scale = abs(products).max(axis=(1, 2))[:, None]
        bend = mesh.parabolas(valued, some)[0] / scale
        second = np.empty((len(some), axes, axes))
        second[:, row, column] = np.linalg.solve(products / scale[:, :, None], bend[:, :, None])[:, :, 0]
        second[:, column, row] = second[:, row, column]
        sizes, directions = np.linalg.eigh(second)
        bends = (directions * abs(sizes)[:, None]) @ directions.transpose(0, 2, 1)
        volumes = abs(np.linalg.det(points[some[:, 1:]] - points[some[:, :1]]))
        # the square root of the mean, over its largest eigenvalue
        sizes, directions = np.linalg.eigh(found @ np.average(bends, axis=0, weights=volumes) @ found.T)
        if sizes.max() <= STRAIGHT:
            return np.eye(axes)
        found = (directions * np.sqrt(np.maximum(sizes / sizes.max(), FLATTEST))) @ directions.T
        # to six digits of the largest: the last ones of what LAPACK gives are not alike on every machine, and cells
        # differ ever more once one edge was cut or joined otherwise
        unit = 10.0 ** math.floor(math.log10(float(abs(found).max())) - 6)
        found = np.round(found / unit) * unit
    return found


def _pairs(axes: int) -> Indices:
    """Corners of a simplex at the ends of its edges."""
    return np.array(list(itertools.combinations(range(axes + 1), 2)), dtype=np.intp)


def _ancestors(origins: Indices, axes: int, cells: Indices) -> Indices:
    """The younger ends of the edges that were cut for cells, as many cuts ago as there are axes."""
    for _ in range(axes):
        cells = origins[cells].max(axis=1)
    return cells


def at_pole(heights: Array, origins: Indices, axes: int) -> NDArray[np.bool_]:
    """Whether cuts have lessened nothing on the way to a cell, although there is no jump.

    The first cells, which were put between none, count as jumps: nothing is known yet. `origins` (n, 2) are the two
    cells that each was put between; of the first ones, itself.
    """
    cells, found = np.arange(len(heights)), []
    with np.errstate(invalid="ignore"):
        halves = np.sort(abs(heights[:, None] - heights[origins]), axis=1)
        for _ in range(CUTS):
            found.append(halves[cells])
            cells = _ancestors(origins, axes, cells)
        small, large = np.moveaxis(np.array(found), 2, 0)
        before, after = (np.median(part, axis=0) for part in (large[CUTS // 2 :], large[: CUTS // 2]))
        stays: NDArray[np.bool_] = (after > STAYS * before) & ((small <= JUMP * large).sum(axis=0) <= 1)
    return stays


def scatter(heights: Array, origins: Indices, axes: int, to_cut: Sequence[tuple[int, float]]) -> float:
    """How far the latest cells are off the line between the two that each was put between, where more cells do not
    lessen that; `to_cut` has the number of cells, and the volume of what is too far off, of all rounds."""
    cells, volume = to_cut[-1]
    earlier = [v for count, v in to_cut if count * 2**axes <= cells]
    if not earlier or volume <= LESSENING * earlier[-1]:
        return 0.0
    with np.errstate(invalid="ignore"):
        off = abs(heights - heights[origins].mean(axis=1))
    off[origins[:, 0] == origins[:, 1]] = np.nan
    latest = np.arange(max(0, cells - LATEST), cells)
    before = off[_ancestors(origins, axes, latest)]
    known = np.isfinite(off[latest] + before)
    if known.sum() <= 0.75 * LATEST or np.median((off[latest] - LESSENING * before)[known]) <= 0:
        return 0.0
    return float(np.median(off[latest][known]))
