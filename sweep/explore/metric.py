"""A box stretched to where an output bends, so that cells are joined along what it does not depend on.

Over an edge e straight lines are off by e |H| e / 8 at most, H the matrix of second derivatives. Multiplied by the
square root of |H|, a box bends alike in all directions, and Delaunay's simplices are those of least error. An axis
that matters nothing, or a direction along which a dimensionless group stays as it is, shrinks. One matrix serves the
whole box: the mean of |H| over it, or over some of its simplices where they are many. Source: A. Loseille, F. Alauzet,
SIAM J. Numer. Anal. 49 (2011) 38.
"""

from __future__ import annotations

import numpy as np

from sweep.explore.mesh import Array, Indices, are_too_few, edges, parabolas, simplices, with_beyond

ROUNDS = 3
"""The first joins the cells of the box as it is, where simplices reach across more of the bends than later ones."""
MOST = 3000
"""Simplices whose mean is taken."""
FLATTEST = 1e-5
"""Least share of the mean bend that a direction has: by 300 a box is stretched at most."""
STRAIGHT = 1e-9
"""Mean second derivative that is taken for rounding."""


def stretch(points: Array, heights: Array) -> Array:
    """Matrix (axes, axes) that places (n, axes) in a box are multiplied by before cells of these heights are joined."""
    axes, valued = points.shape[1], np.isfinite(heights)
    found = np.eye(axes)
    if axes == 1 or are_too_few(points[valued]):
        return found
    for _ in range(ROUNDS):
        corners = simplices(points @ found)
        corners = np.searchsorted(np.flatnonzero(valued), corners[valued[corners].all(axis=1)])
        if not len(corners):
            return np.eye(axes)
        around = with_beyond(corners)[:: len(corners) // MOST + 1]
        inside = points[valued]
        sizes, directions = np.linalg.eigh(_second_derivatives(inside @ found, heights[valued], around))
        bends = (directions * abs(sizes)[:, None]) @ directions.transpose(0, 2, 1)
        volumes = abs(np.linalg.det(inside[around[:, 1 : axes + 1]] - inside[around[:, :1]]))
        # the square root of the mean, over its largest eigenvalue
        sizes, directions = np.linalg.eigh(found @ np.average(bends, axis=0, weights=volumes) @ found.T)
        if sizes.max() <= STRAIGHT:
            return np.eye(axes)
        found = (directions * np.sqrt(np.maximum(sizes / sizes.max(), FLATTEST))) @ directions.T
    return found


def _second_derivatives(points: Array, heights: Array, around: Indices) -> Array:
    """H (m, axes, axes) over each simplex: c_ij = -e_ij H e_ij / 2 of its edges."""
    axes = points.shape[1]
    pairs, (row, column) = edges(axes), np.triu_indices(axes)
    bend, _ = parabolas(points, heights, around)
    edge = points[around[:, pairs[:, 0]]] - points[around[:, pairs[:, 1]]]
    products = -edge[:, :, row] * edge[:, :, column] * np.where(row == column, 0.5, 1.0)
    scale = abs(products).max(axis=(1, 2))[:, None]
    entries = np.linalg.solve(products / scale[:, :, None], (bend / scale)[:, :, None])[:, :, 0]
    found = np.empty((len(around), axes, axes))
    found[:, row, column] = found[:, column, row] = entries
    return found
