"""Cells joined to simplices; how far straight lines between them are off, and which edge to cut for it.

Simplices (intervals, triangles, tetrahedra) are those of Delaunay's triangulation. Over one with barycentric
coordinates l_i a parabola is off its straight interpolation by

    E(l) = sum_{i<j} c_ij l_i l_j                                 (1)

so a quarter of c_ij is the error in the middle of the edge from i to j. The c_ij are fitted to how far the cells around
are off the simplex continued to them; what such a parabola leaves of these distances tells kinks, peaks and whatever
else is no parabola, and counts too.

The box is stretched before cells are joined, so that they are joined along what outputs do not depend on. Over an edge
e straight lines are off by e |H| e / 8 at most, H the matrix of second derivatives. Multiplied by the square root of
the mean of |H|, a box bends alike in all directions; an axis that matters nothing, or a direction along which a
dimensionless group stays as it is, shrinks. Source: A. Loseille, F. Alauzet, SIAM J. Numer. Anal. 49 (2011) 38.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay, cKDTree
from threadpoolctl import threadpool_limits

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SHEAR = 0.013
"""By which axes are tilted: corners of a box lie on a sphere, so there are many ways to join them; tilted there is one,
and it is alike in all boxes."""
FLAT = 1e-9
"""Volume, in products of its edges, below which a simplex is none."""
SAFETY, MISFIT = 1.6, 2.5
"""Times the parabola's error, and times what the parabola leaves."""
LEAST_BASIS, RIDGE, BATCH = 0.3, 1e-12, 2_000
"""Of the fit: a cell's weight is the inverse of (1) with all c_ij = 1, or of the first; simplices at a time."""
ROUNDS, MOST = 3, 3000
"""Of a stretch: the first joins the cells of the box as it is, where simplices reach across more of the bends; and
simplices whose mean it takes."""
FLATTEST, STRAIGHT = 1e-5, 1e-9
"""Least share of the mean bend that a direction has: by 300 a box is stretched at most; what is taken for rounding."""


class Mesh:
    """Points (n, axes) of heights (n, outputs) joined to simplices.

    Parameters
    ----------
    kind : ndarray of int, shape (n,)
        Of which kind points are, -1 of none: a simplex is judged by points of its own kind alone.
    matrix : ndarray, optional
        By which points are multiplied before they are joined; default: `stretch` tells it.

    Attributes
    ----------
    corners : ndarray of int, shape (m, axes + 1)
        Points at the corners of each simplex.
    """

    def __init__(self, points: Array, heights: Array, kind: Indices, matrix: Array | None = None) -> None:
        self.matrix = stretch(points, heights, kind) if matrix is None else matrix
        self.places, self.heights, self.kind = points @ self.matrix, heights, kind
        if points.shape[1] == 1:
            order = np.argsort(self.places[:, 0], kind="stable")
            self.corners = np.column_stack([order[:-1], order[1:]])
            return
        self._joined = Delaunay(self.places)
        corners = np.sort(self._joined.simplices.astype(np.intp), axis=1)
        sides = self.places[corners[:, 1:]] - self.places[corners[:, :1]]
        solid = abs(np.linalg.det(sides)) > FLAT * np.linalg.norm(sides, axis=2).prod(axis=1)
        self.corners, self._numbers = corners[solid], np.where(solid, np.cumsum(solid) - 1, -1)

    @property
    def edges(self) -> Indices:
        """Ends (m, pairs, 2) of the edges of each simplex."""
        return self.corners[:, _pairs(self.places.shape[1])]

    def errors(self) -> tuple[Array, Array, Indices]:
        """How far straight lines are off in each simplex, as the points around tell, and which edge to cut for it.

        Returns
        -------
        tuple of ndarray
            Errors (m, outputs); what a parabola does not explain of them; and of each simplex the number of the edge
            that needs a cut most. Where its corners are of several kinds, or those of its kind too few, the error is
            infinite and the edge the longest one.
        """
        axes, ends = self.places.shape[1], self.places[self.edges]
        size, rough = np.full((2, len(self.corners), self.heights.shape[1]), np.inf)
        cut = np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2).argmax(axis=1)
        for number in np.unique(self.kind[self.kind >= 0]):
            members, here = self.kind == number, np.flatnonzero((self.kind[self.corners] == number).all(axis=1))
            if members.sum() >= (axes + 1) * (axes + 2) // 2 and len(here):
                bend, misfit = _parabolas(self.places, self.heights, members, self.corners[here])
                middle, inside = abs(bend) / 4, abs(bend.sum(axis=1)) / (axes + 1) ** 2
                rough[here] = MISFIT * misfit
                size[here] = SAFETY * np.maximum(middle.max(axis=1), inside) + rough[here]
                cut[here] = middle[np.arange(len(here)), :, size[here].argmax(axis=1)].argmax(axis=1)
        return size, rough, cut

    def between(self, at: Array, heights: Array) -> tuple[Array, Indices]:
        """Heights (n, ...) on straight lines at places, NaN outside; and the simplex of each, -1 outside."""
        places = at @ self.matrix
        with threadpool_limits(1, "blas"):  # on busy cores its threads wait some milliseconds for each other, each time
            where = self._joined.find_simplex(places)
            found: Array = LinearNDInterpolator(self._joined, heights)(places)
        return found, np.where(where < 0, -1, self._numbers[where])


def _pairs(axes: int) -> Indices:
    """Corners at the ends of each edge of a simplex."""
    return np.array(list(itertools.combinations(range(axes + 1), 2)), dtype=np.intp)


def _parabolas(points: Array, heights: Array, members: NDArray[np.bool_], corners: Indices) -> tuple[Array, Array]:
    """The c_ij (m, pairs, outputs) of (1) over simplices, and what they leave (m, outputs), a mean square's root.

    They are fitted by least squares to how far those of the points around that are members are off.
    """
    points, heights, corners = points[members], heights[members], np.searchsorted(np.flatnonzero(members), corners)
    tree, pairs = cKDTree(points), _pairs(points.shape[1])
    number = min(len(points), corners.shape[1] + 4 * len(pairs))
    bends = np.empty((len(corners), len(pairs), heights.shape[1]))
    misfits = np.empty((len(corners), heights.shape[1]))
    for start in range(0, len(corners), BATCH):
        rows = slice(start, start + BATCH)
        place = points[corners[rows]]
        near = tree.query(place.mean(axis=1), number)[1]
        rest = (points[near] - place[:, :1]) @ np.linalg.inv(place[:, 1:] - place[:, :1])
        shares = np.concatenate([1 - rest.sum(axis=2, keepdims=True), rest], axis=2)  # barycentric coordinates
        off = heights[near] - shares @ heights[corners[rows]]
        basis = shares[:, :, pairs[:, 0]] * shares[:, :, pairs[:, 1]]
        weight = 1 / np.maximum(abs(basis).sum(axis=2, keepdims=True), LEAST_BASIS)
        weight[(near[:, :, None] == corners[rows][:, None, :]).any(axis=2)] = 0.0
        left, right = basis * weight, off * weight
        turned = left.transpose(0, 2, 1)
        square = turned @ left
        ridge = RIDGE * np.trace(square, axis1=1, axis2=2)[:, None, None] / len(pairs) + 1e-300
        bends[rows] = np.linalg.solve(square + ridge * np.eye(len(pairs)), turned @ right)
        unexplained = ((right - left @ bends[rows]) ** 2).sum(axis=1)
        misfits[rows] = np.sqrt(unexplained / np.maximum((weight > 0).sum(axis=1), 1))
    return bends, misfits


def stretch(points: Array, heights: Array, kind: Indices) -> Array:
    """The matrix (axes, axes) by which points are multiplied before those of these heights are joined."""
    axes, valued = points.shape[1], kind >= 0
    tilt = np.eye(axes) + SHEAR * np.tril(1.0 + 0.3 * np.arange(axes), -1)
    found, inside = np.eye(axes), valued.sum() >= (axes + 1) * (axes + 2) // 2 and axes > 1
    for _ in range(ROUNDS if inside else 0):
        mesh = Mesh(points, heights, kind, found @ tilt)
        corners = mesh.corners[valued[mesh.corners].all(axis=1)]
        if not len(corners):
            return tilt
        some = corners[:: len(corners) // MOST + 1]
        bend = _parabolas(mesh.places, heights, valued, some)[0]
        # second derivatives by places from 0 to 1: of (1), with the gradients of its l_i
        sides = points[some[:, 1:]] - points[some[:, :1]]
        rest = np.linalg.inv(sides)
        gradients = np.concatenate([-rest.sum(axis=2, keepdims=True), rest], axis=2)
        first, second = _pairs(axes).T
        products = np.einsum("map,mbp,mpo->moab", gradients[:, :, first], gradients[:, :, second], bend)
        sizes, directions = np.linalg.eigh(products + products.swapaxes(-1, -2))
        bends = ((directions * abs(sizes)[..., None, :]) @ directions.swapaxes(-1, -2)).sum(axis=1)
        # the square root of the mean, over its largest eigenvalue
        sizes, directions = np.linalg.eigh(np.average(bends, axis=0, weights=abs(np.linalg.det(sides))))
        if sizes.max() <= STRAIGHT:
            return tilt
        found = (directions * np.sqrt(np.maximum(sizes / sizes.max(), FLATTEST))) @ directions.T
        # to six digits of the largest: the last ones of what LAPACK gives are not alike on every machine, and cells
        # differ ever more once one edge was cut or joined otherwise
        unit = 10.0 ** math.floor(math.log10(float(abs(found).max())) - 6)
        found = np.round(found / unit) * unit
    return found @ tilt
