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
BATCH = 20_000


class Errors(NamedTuple):
    """Of each simplex: how far it may be off in its worst output (infinite where too few cells tell), and the edge
    that needs a cut most, by the numbers of its corners in the simplex."""

    size: Array
    first: Indices
    second: Indices


def simplices(points: Array) -> Indices:
    """Numbers (m, axes + 1) of the points at the corners of each simplex; those without a volume are left out."""
    if points.shape[1] == 1:
        order = np.argsort(points[:, 0], kind="stable")
        return np.column_stack([order[:-1], order[1:]])
    found = Delaunay(tilted(points)).simplices.astype(np.intp)
    sides = points[found[:, 1:]] - points[found[:, :1]]
    products = np.linalg.norm(sides, axis=2).prod(axis=1)
    kept: Indices = found[abs(np.linalg.det(sides)) > FLAT * products]
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


def interpolation_errors(points: Array, heights: Array, corners: Indices) -> Errors:
    """Errors of straight lines between points, (n, axes) with heights (n, outputs), over simplices (m, axes + 1)."""
    pairs = edges(points.shape[1])
    if are_too_few(points):
        return _cut_longest(points, corners, pairs)
    bend, misfit = parabolas(points, heights, corners)
    middle = abs(bend) / 4
    inside = abs(bend.sum(axis=1)) / corners.shape[1] ** 2
    size = (SAFETY * np.maximum(middle.max(axis=1, initial=0.0), inside) + MISFIT * misfit).max(axis=1)
    worst = _shortest(middle.max(axis=2), lengths(points, corners, pairs))
    return Errors(size, pairs[worst, 0], pairs[worst, 1])


def are_too_few(points: Array) -> bool:
    """Whether there are fewer points than tell a parabola over a simplex."""
    number, axes = points.shape
    return bool(number < axes + 1 + len(edges(axes)))


def parabolas(points: Array, heights: Array, corners: Indices) -> tuple[Array, Array]:
    """The c_ij (m, pairs, outputs) of (1) over each simplex, and what they leave, a mean square's root (m, outputs)."""
    pairs, outputs = edges(points.shape[1]), heights.shape[1]
    tree, beyond = cKDTree(points), _beyond(corners)
    bend, misfit = np.empty((len(corners), len(pairs), outputs)), np.empty((len(corners), outputs))
    for start in range(0, len(corners), BATCH):
        some = slice(start, start + BATCH)
        bend[some], misfit[some] = _of_batch(points, heights, corners[some], beyond[some], tree, pairs)
    return bend, misfit


def _beyond(corners: Indices) -> Indices:
    """Corners that lie beyond the faces of each simplex, and beyond those of its neighbours there; where there are
    none, its first one. However thin simplices are, some lie to every side."""
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
    return np.concatenate([opposite, opposite[neighbour].reshape(count, -1)], axis=1)


def _cut_longest(points: Array, corners: Indices, pairs: Indices) -> Errors:
    longest = lengths(points, corners, pairs).argmax(axis=1)
    return Errors(np.full(len(corners), np.inf), pairs[longest, 0], pairs[longest, 1])


def lengths(points: Array, corners: Indices, pairs: Indices) -> Array:
    """Of all edges (m, pairs)."""
    apart = points[corners[:, pairs[:, 0]]] - points[corners[:, pairs[:, 1]]]
    found: Array = np.sqrt((apart**2).sum(axis=2))
    return found


def _of_batch(
    points: Array, heights: Array, corners: Indices, beyond: Indices, tree: cKDTree, pairs: Indices
) -> tuple[Array, Array]:
    axes = points.shape[1]
    place = points[corners]
    centre = place.mean(axis=1)
    number = min(len(points), axes + 1 + AROUND.get(axes, 2 * len(pairs)))
    near = np.concatenate([tree.query(centre, number)[1], beyond], axis=1)
    shares = _shares(place, points[near])
    off = heights[near] - np.einsum("sni,sio->sno", shares, heights[corners])
    basis = shares[:, :, pairs[:, 0]] * shares[:, :, pairs[:, 1]]
    weight = 1 / np.maximum(abs(basis).sum(axis=2), LEAST_BASIS)
    weight[(near[:, :, None] == corners[:, None, :]).any(axis=2)] = 0.0
    return _parabola(basis, off, weight)


def _shortest(bends: Array, length: Array) -> Indices:
    """Of the edges that bend nearly as much as any, the shortest: a diagonal bends as its sides do, which lie along
    the axes that need a cut."""
    nearly = bends >= NEARLY * bends.max(axis=1, keepdims=True)
    found: Indices = np.where(nearly, length, np.inf).argmin(axis=1)
    return found


def _shares(place: Array, near: Array) -> Array:
    """Barycentric coordinates (m, n, axes + 1) of points in simplices."""
    inverse = np.linalg.inv((place[:, 1:] - place[:, :1]).transpose(0, 2, 1))
    rest = np.einsum("sij,snj->sni", inverse, near - place[:, :1])
    return np.concatenate([1 - rest.sum(axis=2, keepdims=True), rest], axis=2)


def _parabola(basis: Array, off: Array, weight: Array) -> tuple[Array, Array]:
    """The c_ij (m, pairs, outputs) of (1) by weighted least squares, and what they leave, a mean square's root."""
    left, right = basis * weight[:, :, None], off * weight[:, :, None]
    square = np.einsum("snp,snq->spq", left, left)
    ridge = RIDGE * np.trace(square, axis1=1, axis2=2)[:, None, None] / square.shape[1] + 1e-300
    bend = np.linalg.solve(square + ridge * np.eye(square.shape[1]), np.einsum("snp,sno->spo", left, right))
    rest = right - np.einsum("snp,spo->sno", left, bend)
    misfit: Array = np.sqrt((rest**2).sum(axis=1) / np.maximum((weight > 0).sum(axis=1), 1)[:, None])
    return bend, misfit
