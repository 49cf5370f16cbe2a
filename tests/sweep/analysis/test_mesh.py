"""Errors of straight lines between cells, told from the cells around."""

import itertools

import numpy as np
import pytest

from sweep.analysis.mesh import SAFETY, interpolation_errors, simplices


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_of_a_parabola_the_error_is_told_exactly(axes):
    """In the middle of an edge e straight lines are off by e H e / 8, H the matrix of second derivatives."""
    rng = np.random.default_rng(axes)
    points = rng.random((40 * axes, axes))
    matrix = rng.normal(size=(axes, axes))
    matrix = matrix + matrix.T
    heights = np.einsum("ni,ij,nj->n", points, matrix, points) / 2 + points @ rng.normal(size=axes) + 1.0
    corners = simplices(points)
    found = interpolation_errors(points, heights[:, None], corners)
    first, second = np.array(list(itertools.combinations(range(axes + 1), 2))).T
    edge = points[corners[:, first]] - points[corners[:, second]]
    middle = abs(np.einsum("nki,ij,nkj->nk", edge, matrix, edge)).max(axis=1) / 8
    place = points[corners]
    inside = abs((heights[corners].mean(axis=1)) - _parabola(place.mean(axis=1), points, heights, matrix))
    usual = np.median(found.size)
    np.testing.assert_allclose(found.size, SAFETY * np.maximum(middle, inside), rtol=1e-3, atol=1e-3 * usual)


def _parabola(at, points, heights, matrix):
    square = np.einsum("ni,ij,nj->n", points, matrix, points) / 2
    plane = np.linalg.lstsq(np.column_stack([points, np.ones(len(points))]), heights - square, rcond=None)[0]
    return np.einsum("ni,ij,nj->n", at, matrix, at) / 2 + at @ plane[:-1] + plane[-1]


def test_the_edge_that_bends_most_is_cut():
    """A wave along the first axis alone."""
    first, second = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9)))
    points = np.stack([first, second], axis=1)
    corners = simplices(points)
    found = interpolation_errors(points, np.sin(3 * first)[:, None], corners)
    rows = np.arange(len(corners))
    apart = points[corners[rows, found.first]] - points[corners[rows, found.second]]
    assert (abs(apart[:, 0]) > 0.1).all()


def test_a_kink_is_not_taken_for_the_parabola_through_it():
    """Between -1/8 and 1/8, straight lines are off abs(x) by 1/8; the parabola says a quarter of that."""
    x = np.arange(-7, 8, 2) / 8
    corners = simplices(x[:, None])
    found = interpolation_errors(x[:, None], abs(x)[:, None], corners)
    middle = np.flatnonzero(x[corners].sum(axis=1) == 0)
    assert 0.7 / 8 < found.size[middle] < 1.5 / 8


def test_too_few_cells_tell_nothing():
    points = np.array([[0.0], [1.0], [3.0]])
    assert np.isfinite(interpolation_errors(points, points**2, simplices(points)).size).all()
    found = interpolation_errors(points[:2], points[:2] ** 2, simplices(points[:2]))
    assert np.isinf(found.size).all()


def test_the_worst_of_several_outputs_counts():
    x = np.linspace(0, 1, 9)[:, None]
    corners = simplices(x)
    both = interpolation_errors(x, np.hstack([x, x**2]), corners)
    one = interpolation_errors(x, x**2, corners)
    np.testing.assert_allclose(both.size, one.size, rtol=1e-12)
