"""A box stretched to where an output bends, so that cells are joined along what it does not depend on.

Over an edge e straight lines are off by e |H| e / 8 at most, H the matrix of second derivatives. Multiplied by the
square root of |H|, a box bends alike in all directions, and Delaunay's simplices are those of least error. An axis
that matters nothing, or a direction along which a dimensionless group stays as it is, shrinks. One matrix serves the
whole box: the mean of |H| over it. Source: A. Loseille, F. Alauzet, SIAM J. Numer. Anal. 49 (2011) 38.
"""

from __future__ import annotations

import numpy as np

from sweep.analysis.mesh import Array, Indices, are_too_few, edges, parabolas, simplices

ROUNDS = 3
"""The first joins the cells of the box as it is, where simplices reach across more of the bends than later ones."""
FLATTEST = 1e-5
"""Least share of the mean bend that a direction has: by 300 a box is stretched at most."""
STRAIGHT = 1e-9
"""Mean second derivative that is taken for rounding."""


def stretch(points: Array, heights: Array) -> Array:
    """Matrix (axes, axes) that places (n, axes) in a box are multiplied by before cells of these heights are joined."""
    axes = points.shape[1]
    found = np.eye(axes)
    valued = np.isfinite(heights)
    if axes == 1 or are_too_few(points[valued]):
        return found
    for _ in range(ROUNDS):
        found = _root(_mean_bend(points, heights, valued, found))
    return found


def _mean_bend(points: Array, heights: Array, valued: Array, stretched: Array) -> Array:
    """Mean of |H| over the simplices whose corners all have values."""
    corners = simplices(points @ stretched)
    corners = np.searchsorted(np.flatnonzero(valued), corners[valued[corners].all(axis=1)])
    points, heights = points[valued], heights[valued]
    if not len(corners):
        return np.zeros((points.shape[1],) * 2)
    second = _second_derivatives(points @ stretched, heights, corners)
    sizes, directions = np.linalg.eigh(second)
    bends = np.einsum("sik,sk,sjk->sij", directions, abs(sizes), directions)
    volumes = abs(np.linalg.det(points[corners[:, 1:]] - points[corners[:, :1]]))
    found: Array = stretched @ np.average(bends, axis=0, weights=volumes) @ stretched.T
    return found


def _second_derivatives(points: Array, heights: Array, corners: Indices) -> Array:
    """H (m, axes, axes) over each simplex: c_ij = -e_ij H e_ij / 2 of its edges."""
    axes = points.shape[1]
    pairs, (row, column) = edges(axes), np.triu_indices(axes)
    bend = parabolas(points, heights[:, None], corners)[0]
    edge = points[corners[:, pairs[:, 0]]] - points[corners[:, pairs[:, 1]]]
    products = -edge[:, :, row] * edge[:, :, column] * np.where(row == column, 0.5, 1.0)
    scale = abs(products).max(axis=(1, 2), keepdims=True)
    entries = np.linalg.solve(products / scale, bend / scale)[:, :, 0]
    found = np.empty((len(corners), axes, axes))
    found[:, row, column] = found[:, column, row] = entries
    return found


def _root(bend: Array) -> Array:
    """Square root of a matrix over its largest eigenvalue."""
    sizes, directions = np.linalg.eigh(bend)
    if sizes.max() <= STRAIGHT:
        return np.eye(len(bend))
    found: Array = (directions * np.sqrt(np.maximum(sizes / sizes.max(), FLATTEST))) @ directions.T
    return found
