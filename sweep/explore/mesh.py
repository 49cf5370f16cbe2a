"""Cells joined to simplices; how far straight lines between them are off, and which edge to cut for it.

Simplices (intervals, triangles, tetrahedra) are those of Delaunay's triangulation.

Over a simplex with barycentric coordinates l_i a parabola is off its straight interpolation by

    E(l) = sum_{i<j} c_ij l_i l_j                                 (1)

so a quarter of c_ij is the error in the middle of the edge from i to j. The c_ij are fitted to how far the cells around
are off the simplex continued to them; what such a parabola leaves of these distances tells kinks, peaks and whatever
else is no parabola, and counts too.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SHEAR = 0.013
"""By which axes are tilted before cells are joined: corners of a box lie on a sphere, so there are many ways to join
them; tilted there is one, and it is alike in all boxes."""
FLAT = 1e-9
"""Volume, in products of its edges, below which a simplex is none."""
AROUND = {1: 4, 2: 12, 3: 20}
"""Cells around a simplex that are taken, beside its corners; with more axes twice the unknowns."""
SAFETY = 1.6
"""Times the parabola's error."""
MISFIT = 2.5
"""Times what the parabola leaves: a kink right in the middle between cells of one axis is told a quarter short."""
LEAST_BASIS = 0.3
"""Of (1) with all c_ij = 1 in a cell around; its inverse is the weight of that cell."""
NEARLY = 0.9
"""Share of the largest bend of an edge."""
RIDGE = 1e-12
BATCH = 2_000
MIX = np.random.default_rng(1).integers(1 << 62, size=256)
"""Numbers of cells times these, in the ring of 64 bits, are a number of each simplex."""


class Parabolas(NamedTuple):
    """Over each simplex: its corners and those beyond (m, more), how far off its centre cells around it are, the c_ij
    (m, pairs) of (1), what these leave, a mean square's root; and how many cells there were."""

    around: Indices
    reach: Array
    bend: Array
    misfit: Array
    cells: int


def simplices(points: Array) -> Indices:
    """Numbers (m, axes + 1) of the points at the corners of each simplex; those without a volume are left out."""
    if points.shape[1] == 1:
        order = np.argsort(points[:, 0], kind="stable")
        return np.column_stack([order[:-1], order[1:]])
    found = Delaunay(tilted(points)).simplices.astype(np.intp)
    sides = points[found[:, 1:]] - points[found[:, :1]]
    products = np.linalg.norm(sides, axis=2).prod(axis=1)
    kept: Indices = np.sort(found[abs(np.linalg.det(sides)) > FLAT * products], axis=1)
    return kept


def tilted(points: Array) -> Array:
    """Points as they are joined."""
    axes = points.shape[1]
    tilt = np.eye(axes) + SHEAR * np.tril(1.0 + 0.3 * np.arange(axes), -1)
    found: Array = points @ tilt
    return found


def edges(axes: int) -> Indices:
    """Pairs of corners of a simplex."""
    return np.array(list(itertools.combinations(range(axes + 1), 2)), dtype=np.intp)


def interpolation_errors(points: Array, corners: Indices, found: Parabolas) -> tuple[Array, Indices]:
    """How far straight lines between points (n, axes) may be off over simplices (m, axes + 1) with these parabolas, and
    the edges (m, 2) that need a cut most."""
    middle = abs(found.bend) / 4
    inside = abs(found.bend.sum(axis=1)) / corners.shape[1] ** 2
    size = SAFETY * np.maximum(middle.max(axis=1, initial=0.0), inside) + MISFIT * found.misfit
    # a diagonal bends as its sides do, which lie along the axes that need a cut, and are shorter
    nearly = middle >= NEARLY * middle.max(axis=1, keepdims=True)
    return size, largest(corners, np.where(nearly, -lengths(points, corners), -np.inf))


def are_too_few(points: Array) -> bool:
    """Whether there are fewer points than tell a parabola over a simplex."""
    number, axes = points.shape
    return bool(number < axes + 1 + len(edges(axes)))


def renewed(before: Parabolas | None, points: Array, heights: Array, corners: Indices) -> Parabolas:
    """Parabolas over simplices (m, axes + 1) of points (n, axes), fitted anew where cells around are not as before.

    Points and heights (n,) that were there before are the first ones, and the same.
    """
    around = with_beyond(corners)
    if before is None:
        return parabolas(points, heights, around)
    here, there = _unchanged(before, points, around)
    fresh = np.setdiff1d(np.arange(len(around)), here)
    found = parabolas(points, heights, around[fresh])
    place = np.argsort(np.concatenate([here, fresh]))
    reach, bend, misfit = (
        np.concatenate([old[there], new])[place] for old, new in zip(before[1:4], found[1:4], strict=True)
    )
    return Parabolas(around, reach, bend, misfit, len(points))


def _unchanged(before: Parabolas, points: Array, around: Indices) -> tuple[Indices, Indices]:
    """Numbers now, and before, of simplices with the same corners and corners beyond, and no new cell nearer."""
    mix = MIX[: around.shape[1]]
    _, here, there = np.intersect1d(around @ mix, before.around @ mix, return_indices=True)
    same = (around[here] == before.around[there]).all(axis=1)
    here, there = here[same], there[same]
    if before.cells < len(points):
        centres = _centres(points, around[here])
        far = cKDTree(points[before.cells :]).query(centres)[0] > before.reach[there]
        here, there = here[far], there[far]
    return here, there


def parabolas(points: Array, heights: Array, around: Indices) -> Parabolas:
    """Parabolas over simplices with these corners, and those beyond."""
    tree, pairs = cKDTree(points), edges(points.shape[1])
    batches = np.split(around, range(BATCH, len(around), BATCH))
    found = [_of_batch(points, heights, batch, tree, pairs) for batch in batches]
    reach, bend, misfit = (np.concatenate(column) for column in zip(*found, strict=True))
    return Parabolas(around, reach, bend, misfit, len(points))


def with_beyond(corners: Indices) -> Indices:
    """Corners of each simplex, those beyond its faces, and those beyond its neighbours' there; where there are none,
    its first one. However thin simplices are, some lie to every side."""
    count, size = corners.shape
    faces = np.stack([np.delete(corners, k, axis=1) for k in range(size)], axis=1).reshape(-1, size - 1)
    faces.sort(axis=1)
    order = np.lexsort(faces.T)
    same = np.flatnonzero((faces[order[1:]] == faces[order[:-1]]).all(axis=1))
    other = np.full(count * size, -1)
    other[order[same]], other[order[same + 1]] = order[same + 1], order[same]
    other = other.reshape(count, size)
    opposite = np.where(other < 0, corners[:, :1], corners.ravel()[other])
    neighbour = np.where(other < 0, np.arange(count)[:, None], other // size)
    return np.concatenate([corners, opposite, opposite[neighbour].reshape(count, -1)], axis=1)


def lengths(points: Array, corners: Indices) -> Array:
    """Of all edges (m, pairs)."""
    ends = points[corners[:, edges(points.shape[1])]]
    found: Array = np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2)
    return found


def largest(corners: Indices, of_edges: Array) -> Indices:
    """The edges (m, 2) where something (m, pairs) is largest."""
    pair = edges(corners.shape[1] - 1)[of_edges.argmax(axis=1)]
    return np.take_along_axis(corners, pair, 1)


def _of_batch(
    points: Array, heights: Array, around: Indices, tree: cKDTree, pairs: Indices
) -> tuple[Array, Array, Array]:
    axes = points.shape[1]
    corners = around[:, : axes + 1]
    number = min(len(points), axes + 1 + AROUND.get(axes, 2 * len(pairs)))
    distance, nearest = tree.query(_centres(points, around), number)
    near = np.concatenate([nearest, around[:, axes + 1 :]], axis=1)
    place = points[corners]
    rest = (points[near] - place[:, :1]) @ np.linalg.inv(place[:, 1:] - place[:, :1])
    shares = np.concatenate([1 - rest.sum(axis=2, keepdims=True), rest], axis=2)  # barycentric coordinates
    off = heights[near] - (shares @ heights[corners][:, :, None])[:, :, 0]
    basis = shares[:, :, pairs[:, 0]] * shares[:, :, pairs[:, 1]]
    weight = 1 / np.maximum(abs(basis).sum(axis=2), LEAST_BASIS)
    weight[(near[:, :, None] == corners[:, None, :]).any(axis=2)] = 0.0
    reach = distance[:, -1] if number < len(points) else np.full(len(around), np.inf)
    return reach, *_parabola(basis, off, weight)


def _centres(points: Array, around: Indices) -> Array:
    found: Array = points[around[:, : points.shape[1] + 1]].mean(axis=1)
    return found


def _parabola(basis: Array, off: Array, weight: Array) -> tuple[Array, Array]:
    """The c_ij (m, pairs) of (1) by weighted least squares, and what they leave, a mean square's root."""
    left, right = basis * weight[:, :, None], (off * weight)[:, :, None]
    turned = left.transpose(0, 2, 1)
    square = turned @ left
    ridge = RIDGE * np.trace(square, axis1=1, axis2=2)[:, None, None] / square.shape[1] + 1e-300
    bend = np.linalg.solve(square + ridge * np.eye(square.shape[1]), turned @ right)
    rest = (right - left @ bend)[:, :, 0]
    misfit: Array = np.sqrt((rest**2).sum(axis=1) / np.maximum((weight > 0).sum(axis=1), 1))
    return bend[:, :, 0], misfit
