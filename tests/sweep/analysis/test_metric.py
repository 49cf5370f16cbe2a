"""Boxes stretched to where an output bends."""

import numpy as np
import pytest

from sweep.analysis import metric
from sweep.analysis.mesh import simplices
from sweep.analysis.metric import FLATTEST, stretch


def places(axes, number=5):
    """A grid, and as many cells anywhere."""
    grid = np.stack([g.ravel() for g in np.meshgrid(*[np.linspace(0, 1, number)] * axes)], axis=1)
    return np.concatenate([grid, np.random.default_rng(1).random(grid.shape)])


@pytest.mark.parametrize("axes", [2, 3])
def test_of_a_parabola_it_is_the_root_of_the_matrix_of_second_derivatives(axes):
    points = places(axes)
    matrix = np.random.default_rng(axes).normal(size=(axes, axes))
    matrix = matrix @ matrix.T + np.eye(axes)
    found = stretch(points, np.einsum("ni,ij,nj->n", points, matrix, points) / 2 + points[:, 0])
    np.testing.assert_allclose(found @ found, matrix / np.linalg.eigvalsh(matrix).max(), rtol=1e-6, atol=1e-9)


def test_where_it_bends_down_and_up_sizes_count():
    points = places(2)
    found = stretch(points, 4 * points[:, 0] ** 2 - points[:, 1] ** 2)
    np.testing.assert_allclose(found, np.diag([1.0, 0.5]), atol=1e-6)


def test_a_direction_that_matters_nothing_shrinks():
    points = places(2)
    found = stretch(points, (points[:, 0] + points[:, 1]) ** 2)
    np.testing.assert_allclose(found @ [1, 1], [1, 1], rtol=1e-6)
    np.testing.assert_allclose(found @ [1, -1], np.sqrt(FLATTEST) * np.array([1, -1]), rtol=1e-6)
    corners = points[simplices(points @ found)]
    along, level = np.ptp(corners.sum(axis=2), axis=1), np.ptp(corners[:, :, 0] - corners[:, :, 1], axis=1)
    assert along.mean() < 0.3 * level.mean()


@pytest.mark.parametrize("heights", [np.zeros(50), places(2) @ [1.0, 2.0], np.full(50, np.nan)])
def test_what_is_straight_or_missing_stretches_nothing(heights):
    np.testing.assert_array_equal(stretch(places(2), heights), np.eye(2))


def test_cells_without_a_value_count_nothing():
    points = places(2)
    heights = 4 * points[:, 0] ** 2 + points[:, 1] ** 2
    heights[np.hypot(*points.T) < 0.5] = np.nan
    np.testing.assert_allclose(stretch(points, heights), np.diag([1.0, 0.5]), atol=1e-6)


# the pieces, each against its formula written another way


def test_one_axis_or_five_cells_of_two_are_not_stretched():
    points = places(2)
    heights = points[:, 0] ** 2
    np.testing.assert_array_equal(stretch(points[:5], heights[:5]), np.eye(2))
    np.testing.assert_array_equal(stretch(points[:, :1], heights), np.eye(1))
    few = np.where(np.arange(len(points)) < 5, heights, np.nan)
    np.testing.assert_array_equal(metric.stretched_by(points, few, simplices(points), 3 * np.eye(2)), np.eye(2))
