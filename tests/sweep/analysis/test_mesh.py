"""Errors of straight lines between cells, told from the cells around."""

import itertools

import numpy as np
import pytest

from sweep.analysis import mesh
from sweep.analysis.mesh import (
    SAFETY,
    are_too_few,
    interpolation_errors,
    parabolas,
    simplices,
    with_beyond,
)


def judged(points, heights):
    """Simplices, how far straight lines are off in them, and the edges to cut."""
    corners = simplices(points)
    return corners, *interpolation_errors(points, corners, parabolas(points, heights, with_beyond(corners)))


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_of_a_parabola_the_error_is_told_exactly(axes):
    """In the middle of an edge e straight lines are off by e H e / 8, H the matrix of second derivatives."""
    rng = np.random.default_rng(axes)
    points = rng.random((40 * axes, axes))
    matrix = rng.normal(size=(axes, axes))
    matrix = matrix + matrix.T
    heights = np.einsum("ni,ij,nj->n", points, matrix, points) / 2 + points @ rng.normal(size=axes) + 1.0
    corners, size, _ = judged(points, heights)
    first, second = np.array(list(itertools.combinations(range(axes + 1), 2))).T
    edge = points[corners[:, first]] - points[corners[:, second]]
    middle = abs(np.einsum("nki,ij,nkj->nk", edge, matrix, edge)).max(axis=1) / 8
    place = points[corners]
    inside = abs((heights[corners].mean(axis=1)) - _parabola(place.mean(axis=1), points, heights, matrix))
    usual = np.median(size)
    np.testing.assert_allclose(size, SAFETY * np.maximum(middle, inside), rtol=1e-3, atol=1e-3 * usual)


def _parabola(at, points, heights, matrix):
    square = np.einsum("ni,ij,nj->n", points, matrix, points) / 2
    plane = np.linalg.lstsq(np.column_stack([points, np.ones(len(points))]), heights - square, rcond=None)[0]
    return np.einsum("ni,ij,nj->n", at, matrix, at) / 2 + at @ plane[:-1] + plane[-1]


def test_the_edge_that_bends_most_is_cut():
    """A wave along the first axis alone."""
    first, second = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9)))
    points = np.stack([first, second], axis=1)
    _, _, ends = judged(points, np.sin(3 * first))
    apart = points[ends[:, 0]] - points[ends[:, 1]]
    assert (abs(apart[:, 0]) > 0.1).all()


def test_a_kink_is_not_taken_for_the_parabola_through_it():
    """Between -1/8 and 1/8, straight lines are off abs(x) by 1/8; the parabola says a quarter of that."""
    x = np.arange(-7, 8, 2) / 8
    corners, size, _ = judged(x[:, None], abs(x))
    middle = np.flatnonzero(x[corners].sum(axis=1) == 0)
    assert 0.7 / 8 < size[middle] < 1.5 / 8


def test_too_few_cells_tell_nothing():
    assert are_too_few(np.zeros((2, 1)))
    assert not are_too_few(np.zeros((3, 1)))
    assert are_too_few(np.zeros((9, 3)))


# the pieces, each against its formula written another way


def test_axes_are_tilted_by_little_and_each_by_another_angle():
    found = mesh.tilted(np.eye(3))
    np.testing.assert_allclose(found, [[1, 0, 0], [0.013, 1, 0], [0.013, 0.013 * 1.3, 1]], rtol=1e-12)


def test_cells_of_one_axis_are_joined_in_order():
    assert simplices(np.array([[3.0], [1.0], [2.0]])).tolist() == [[1, 2], [2, 0]]


@pytest.mark.parametrize(("axes", "least"), [(1, 3), (2, 6), (3, 10)])
def test_a_parabola_over_a_simplex_needs_as_many_points_as_it_has_numbers(axes, least):
    assert are_too_few(np.zeros((least - 1, axes)))
    assert not are_too_few(np.zeros((least, axes)))


def found_of(bend, misfit):
    none = np.empty((len(bend), 0))
    return mesh.Parabolas(none.astype(np.intp), none, np.array(bend, dtype=float), np.array(misfit, dtype=float), 3)


@pytest.mark.parametrize(
    ("bend", "misfit", "size", "edge"),
    [
        ([4.0, -8.0, 0.4], 0.0, 1.6 * 2.0, [0, 2]),
        ([3.0, 3.0, 3.0], 0.0, 1.6 * 1.0, [0, 1]),  # in the middle 9/9, on edges 3/4; of alike edges the shortest
        ([0.0, 7.21, 8.0], 0.1, 1.6 * 2.0 + 0.25, [0, 2]),
        ([0.0, 7.19, 8.0], 0.1, 1.6 * 2.0 + 0.25, [1, 2]),
    ],
)
def test_errors_and_cuts_are_those_of_the_largest_bend(bend, misfit, size, edge):
    """A triangle of sides 1 (corners 0, 1), 1.5 (0, 2) and more (1, 2)."""
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.5]])
    found, cut = interpolation_errors(points, np.array([[0, 1, 2]]), found_of([bend], [misfit]))
    assert found[0] == pytest.approx(size, rel=1e-12)
    assert cut.tolist() == [edge]


@pytest.mark.parametrize(("axes", "around"), [(1, 4), (2, 12), (3, 20), (4, 20)])
def test_cells_around_a_simplex_are_the_nearest_to_its_centre(axes, around):
    rng = np.random.default_rng(axes)
    points, height = rng.random((60, axes)), rng.random(60)
    corners = simplices(points)[:5]
    found = parabolas(points, height, corners)
    for one, reach, bend, misfit in zip(corners, found.reach, found.bend, found.misfit, strict=True):
        centre = points[one].mean(axis=0)
        apart = np.linalg.norm(points - centre, axis=1)
        near = np.argsort(apart)[: around + axes + 1]
        assert reach == pytest.approx(apart[near[-1]], rel=1e-12)
        shares = np.linalg.solve(
            np.vstack([points[one].T, np.ones(axes + 1)]), np.vstack([points[near].T, np.ones(near.size)])
        ).T
        products = np.stack(
            [shares[:, i] * shares[:, j] for i, j in itertools.combinations(range(axes + 1), 2)], axis=1
        )
        weight = np.where(np.isin(near, one), 0.0, 1 / np.maximum(abs(products).sum(axis=1), 0.3))
        off = (height[near] - shares @ height[one]) * weight
        best = np.linalg.lstsq(products * weight[:, None], off, rcond=None)[0]
        np.testing.assert_allclose(bend, best, rtol=2e-3)
        rest = off - products * weight[:, None] @ best
        assert misfit == pytest.approx(np.sqrt((rest**2).sum() / (weight > 0).sum()), rel=1e-4)


def test_of_few_cells_all_are_around_and_any_new_one_is_nearer():
    points = np.random.default_rng(1).random((15, 2))
    few = parabolas(points, points[:, 0] ** 2, simplices(points))
    assert np.isinf(few.reach).all()
    points = np.random.default_rng(1).random((16, 2))
    assert np.isfinite(parabolas(points, points[:, 0] ** 2, simplices(points)).reach).all()


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_corners_beyond_are_those_of_neighbours_and_of_theirs(axes):
    corners = simplices(np.random.default_rng(axes).random((12, axes)))

    def beyond(one, face):
        """The corner opposite of a face, and its simplex; the simplex itself where there is none."""
        for number, other in enumerate(corners):
            if number != one and face <= set(other):
                return number, (set(other) - face).pop()
        return one, None

    found = with_beyond(corners)
    for one, row in enumerate(corners):
        opposite, further = [], []
        for corner in row:
            neighbour, point = beyond(one, set(row) - {corner})
            opposite.append(row[0] if point is None else point)
            there = corners[neighbour]
            across = [(beyond(neighbour, set(there) - {c})[1]) for c in there]
            further += [there[0] if point is None else point for point in across]
        np.testing.assert_array_equal(found[one], [*row, *opposite, *further])


def test_the_edge_of_the_largest_value_is_picked():
    corners = np.array([[5, 7, 9], [1, 2, 4]])
    picked = mesh.largest(corners, np.array([[0.0, 2.0, 1.0], [3.0, 2.0, 9.0]]))
    assert picked.tolist() == [[5, 9], [2, 4]]
