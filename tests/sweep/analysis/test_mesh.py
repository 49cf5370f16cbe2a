"""Errors of straight lines between cells, told from the cells around."""

import itertools

import numpy as np
import pytest

from sweep.analysis.mesh import (
    SAFETY,
    are_too_few,
    interpolation_errors,
    lengths,
    parabolas,
    renewed,
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


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_what_was_found_before_is_what_is_found_anew(axes, monkeypatch):
    """Cells are added in one corner of the box, and one far from them."""
    fitted = []

    def counted(points, heights, around):
        fitted.append(len(around))
        return parabolas(points, heights, around)

    monkeypatch.setattr("sweep.analysis.mesh.parabolas", counted)
    rng = np.random.default_rng(axes)
    points, before = rng.random((30 * 4**axes, axes)), None
    for more in (0.2 * rng.random((8, axes)), np.full((1, axes), 0.9), np.empty((0, axes))):
        points = np.concatenate([points, more])
        heights = np.sin(3 * points.sum(axis=1))
        corners = simplices(points)
        before = renewed(before, points, heights, corners)
        anew = parabolas(points, heights, with_beyond(corners))
        assert before.cells == len(points)
        for name in ("around", "reach", "bend", "misfit"):
            np.testing.assert_array_equal(getattr(before, name), getattr(anew, name), err_msg=name)
    whole, few, none = fitted
    assert 0 < few < whole / 2
    assert none == 0


def test_simplices_whose_numbers_are_alike_by_chance_are_told_apart(monkeypatch):
    monkeypatch.setattr("sweep.analysis.mesh.MIX", np.zeros(256, dtype=np.int64))
    points = np.random.default_rng(1).random((200, 2))
    corners = simplices(points)
    first = parabolas(points, points[:, 0] ** 2, with_beyond(corners))
    found = renewed(first, points, points[:, 0] ** 2, corners[::-1].copy())
    np.testing.assert_allclose(found.bend, first.bend[::-1], rtol=0, atol=1e-9)


def test_edges_have_lengths():
    points = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0]])
    np.testing.assert_array_equal(lengths(points, np.array([[0, 1, 2]])), [[3.0, 4.0, 5.0]])
