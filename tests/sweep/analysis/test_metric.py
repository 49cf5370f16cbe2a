"""Boxes stretched to where an output bends."""

import numpy as np
import pytest
from scipy.linalg import sqrtm

from sweep.analysis import metric
from sweep.analysis.mesh import simplices, with_beyond
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


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_second_derivatives_of_a_parabola_are_its_matrix_in_every_simplex(axes):
    points = places(axes) if axes > 1 else np.random.default_rng(1).random((20, 1))
    matrix = np.random.default_rng(axes).normal(size=(axes, axes))
    matrix = matrix + matrix.T
    height = np.einsum("ni,ij,nj->n", points, matrix, points) / 2 + points[:, 0]
    around = with_beyond(simplices(points))
    found = metric._second_derivatives(points, height, around)
    np.testing.assert_allclose(np.median(found, axis=0), matrix, atol=1e-6)
    assert (abs(found - matrix).max(axis=(1, 2)) < 1e-3).mean() > 0.95


def test_a_root_is_that_of_scipy_and_no_direction_shrinks_by_more_than_300():
    bend = np.array([[5.0, 1.0, 0.0], [1.0, 2.0, 0.3], [0.0, 0.3, 1.0]])
    largest = np.linalg.eigvalsh(bend)[-1]
    np.testing.assert_allclose(metric._root(bend), sqrtm(bend / largest).real, atol=1e-12)
    for least, left in ((1.1e-5, 1.1e-5), (0.9e-5, 1e-5), (-1.0, 1e-5)):
        np.testing.assert_allclose(metric._root(np.diag([4.0, 4 * least])), np.diag([1, np.sqrt(left)]), rtol=1e-12)


@pytest.mark.parametrize(("size", "straight"), [(1e-9, True), (1.01e-9, False)])
def test_what_rounding_bends_is_straight(size, straight):
    found = metric._root(np.diag([size, size / 4]))
    np.testing.assert_allclose(found, np.eye(2) if straight else np.diag([1.0, 0.5]), rtol=1e-12)


def test_bends_are_averaged_by_the_volumes_of_their_simplices(monkeypatch):
    """Four triangles, one of them as large as the other three."""
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1 / 3], [1.0, 2 / 3], [1.0, 1.0]])
    corners = np.array([[0, 1, 2], [1, 2, 3], [2, 3, 4], [2, 4, 5]])
    bends = np.array([np.diag(one) for one in [(6.0, 0.0), (0.0, -6.0), (-2.0, 0.5), (0.0, 0.0)]])
    monkeypatch.setattr(metric, "_second_derivatives", lambda *_: bends)
    given = np.array([[1.0, 0.0], [0.0, 0.5]])
    monkeypatch.setattr(metric, "with_beyond", lambda corners: corners)
    found = metric.stretched_by(points, np.zeros(6), corners, given)
    first, second = (3 * 6 + 2) / 6, (6 + 0.5) / 6 * 0.25
    np.testing.assert_allclose(found, np.diag([1.0, np.sqrt(second / first)]), rtol=1e-12)


@pytest.mark.parametrize(("most", "taken"), [(11, 10), (10, 5), (4, 4), (3, 3)])
def test_of_many_simplices_every_second_or_third_is_taken(monkeypatch, most, taken):
    asked = []
    points = np.random.default_rng(0).random((30, 2))

    def counted(points, heights, around):
        asked.append(len(around))
        return np.broadcast_to(np.eye(2), (len(around), 2, 2))

    monkeypatch.setattr(metric, "_second_derivatives", counted)
    monkeypatch.setattr(metric, "MOST", most)
    metric.stretched_by(points, points[:, 0], simplices(points)[:10], np.eye(2))
    assert asked == [taken]


def test_a_box_is_stretched_in_three_rounds_each_from_the_last(monkeypatch):
    points, asked = places(2), []

    def one(points, heights, corners, stretched):
        np.testing.assert_array_equal(corners, simplices(points @ stretched))
        asked.append(stretched[1, 1])
        return stretched @ np.diag([1.0, 0.5])

    monkeypatch.setattr(metric, "stretched_by", one)
    np.testing.assert_array_equal(stretch(points, points[:, 0]), np.diag([1.0, 0.125]))
    assert asked == [1.0, 0.5, 0.25]


def test_one_axis_or_five_cells_of_two_are_not_stretched():
    points = places(2)
    heights = points[:, 0] ** 2
    np.testing.assert_array_equal(stretch(points[:5], heights[:5]), np.eye(2))
    np.testing.assert_array_equal(stretch(points[:, :1], heights), np.eye(1))
    few = np.where(np.arange(len(points)) < 5, heights, np.nan)
    np.testing.assert_array_equal(metric.stretched_by(points, few, simplices(points), 3 * np.eye(2)), np.eye(2))
