"""Simplices judged: limits of cuts from both sides, borders between statuses, when a box is stretched anew."""

import math

import numpy as np
import pytest

from sweep.analysis.metric import stretch
from sweep.explore import judge
from sweep.explore.judge import Judge


def line(*places):
    return np.array(places, float)[:, None]


def judged(points, heights, kind=None, steps=4.0):
    """A judge of one axis, and what it finds."""
    one = Judge(np.full(points.shape[1], steps))
    kind = np.zeros(len(points), np.intp) if kind is None else np.array(kind)
    return one, one.judged(points, np.asarray(heights, float), kind)


def test_the_numbers_that_say_where_cutting_ends():
    assert judge.LEVELS == {1: 20, 2: 10, 3: 6}
    assert judge.BORDER_LEVELS == {1: 10, 2: 5, 3: 3}
    assert judge.BESIDE_LEVELS == {1: 20, 2: 5, 3: 3}
    assert (judge.FEWEST_LEVELS, judge.GROWTH, judge.SETTLED) == (4, 1.5, 1.02)


@pytest.mark.parametrize(("wide", "finest"), [(1.0, True), (1.001, False)])
def test_an_edge_is_the_finest_when_a_step_was_cut_twenty_times(wide, finest):
    step = wide * 2.0**-20 / 4
    _, found = judged(line(0, 0.25, 0.5, 0.5 + step, 0.75, 1), np.zeros(6))
    assert found.finest.tolist() == [False, False, finest, False, False]
    assert found.corners.tolist() == [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]]
    assert found.valued.all()
    assert not found.beside.any()


@pytest.mark.parametrize("axes", [2, 3, 4])
@pytest.mark.parametrize(("wide", "finest"), [(1.0, True), (1.01, False)])
def test_with_more_axes_a_step_is_cut_less_often(axes, wide, finest):
    levels = {2: 10, 3: 6, 4: 4}[axes]
    points = wide * 2.0**-levels * np.concatenate([np.zeros((1, axes)), np.eye(axes)])
    _, found = judged(points, np.zeros(axes + 1), steps=1.0)
    assert np.isinf(found.size).all()  # too few for a parabola
    assert found.finest.tolist() == [finest]


@pytest.mark.parametrize(("wide", "size"), [(1.0, 0.0), (1.001, math.inf)])
def test_a_border_is_cut_until_a_step_was_cut_ten_times(wide, size):
    step = wide * 2.0**-10 / 4
    _, found = judged(line(0, 0.25, 0.5, 0.5 + step, 0.75, 1), np.zeros(6), [0, 0, 0, 64, 64, 64])
    assert found.size[2] == size
    assert found.ends[2].tolist() == [2, 3]
    assert found.valued.tolist() == [True, True, False, True, True]


@pytest.mark.parametrize("axes", [2, 3, 4])
@pytest.mark.parametrize(("wide", "size"), [(1.0, 0.0), (1.01, math.inf)])
def test_with_more_axes_a_border_is_cut_less_often_and_where_it_is_longest(axes, wide, size):
    levels = {2: 5, 3: 3, 4: 2}[axes]
    points = wide * 2.0**-levels * np.concatenate([np.zeros((1, axes)), np.eye(axes)])
    points[1] *= 0.5  # the edges between the other corners are as long, but cross no border
    kind = np.zeros(axes + 1, np.intp)
    kind[0] = 64
    _, found = judged(points, np.zeros(axes + 1), kind, steps=1.0)
    assert found.size.tolist() == [size]
    assert 0 in found.ends[0]
    assert 1 not in found.ends[0]
    assert not found.valued.any()


def test_the_edge_that_is_cut_crosses_the_border_though_another_is_longer():
    points = np.array([[0.0, 0.0], [-1.0, 0.1], [1.0, 0.2]])
    for kind in ([64, 0, 0], [3, 7, 7]):
        _, found = judged(points, np.zeros(3), kind, steps=1.0)
        assert found.ends.tolist() == [[0, 1]]
        assert np.isinf(found.size).all()


def test_what_has_no_value_anywhere_is_not_cut():
    _, found = judged(line(0, 0.25, 0.5, 0.75, 1), np.full(5, np.nan), [0, 0, -1, -1, -1])
    assert found.size.tolist() == [math.inf, math.inf, 0, 0]  # two cells are too few, a border is to be cut
    assert found.valued.tolist() == [True, False, False, False]


def test_cells_near_a_border_may_be_cut_less_often_in_two_axes():
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    small = 2.0**-6 * np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    points = np.concatenate([corner, small])
    for kind, beside in (([0] * 7, False), ([0, 0, 0, 0, 0, 0, 64], True)):
        _, found = judged(points, np.zeros(7), kind, steps=1.0)
        (here,) = np.flatnonzero((found.corners == [0, 4, 5]).all(axis=1))
        assert (bool(found.beside[here]), bool(found.finest[here])) == (beside, beside)


@pytest.mark.parametrize(("apart", "near"), [(2.0**-10, True), (1.01 * 2.0**-10, False)])
def test_as_near_to_a_border_as_it_may_stay_wide_is_beside_it(apart, near):
    one = Judge(np.array([1.0]))
    found = one._near(line(0, 0.5, 0.5 + 2.0**-12, 0.5 + 2.0**-12 + apart, 1), np.array([[1, 2]]))
    assert found.tolist() == [False, True, True, near, False]
    assert not one._near(line(0, 1), np.empty((0, 2), np.intp)).any()


def test_lengths_are_in_steps_of_the_axis_where_they_are_most():
    one = Judge(np.array([4.0, 10.0]))
    points = np.array([[0.0, 0.0], [0.5, 0.1], [0.25, 0.3]])
    assert one._extent(points, np.array([[0, 1], [0, 2], [2, 0]])).tolist() == pytest.approx([2, 3, 3])


def test_a_parabola_and_its_error_are_those_of_a_kind_alone():
    """Heights x^2 on one side, 7 on the other, in no order: neither tells anything of the other."""
    x = np.linspace(0, 1, 21)
    kind = np.where(x < 0.5, 0, 3)
    height = np.where(x < 0.5, x**2, 7.0)
    mixed = np.random.default_rng(2).permutation(21)
    one, found = judged(x[mixed][:, None], height[mixed], kind[mixed], steps=20.0)
    left, right = x[mixed][found.corners].max(axis=1) < 0.5, x[mixed][found.corners].min(axis=1) >= 0.5
    np.testing.assert_allclose(found.size[left], 1.6 * 0.05**2 / 4, rtol=1e-6)
    np.testing.assert_allclose(found.size[right], 0, atol=1e-9)
    np.testing.assert_allclose(abs(np.diff(x[mixed][found.ends], axis=1)), 0.05)
    assert np.isinf(found.size[~left & ~right]).all()
    assert sorted(one.known) == [0, 3]


@pytest.mark.parametrize(("number", "anew"), [(14, False), (15, True)])
def test_a_box_is_stretched_anew_when_half_as_many_cells_came(number, anew):
    one, _ = judged(line(*np.linspace(0, 1, 10)), np.linspace(0, 1, 10) ** 2)
    np.testing.assert_array_equal(one.stretched, stretch(line(*np.linspace(0, 1, 10)), np.linspace(0, 1, 10) ** 2))
    more = np.concatenate([np.linspace(0, 1, 10), np.linspace(0.02, 0.9, number - 10)])
    one.judged(more[:, None], more**2, np.zeros(number, np.intp))
    assert one.stretched_at == (number if anew else 10)


@pytest.mark.parametrize(("number", "anew"), [(102, False), (103, True)])
def test_it_looks_anew_before_the_end_where_a_fiftieth_of_the_cells_came_since(number, anew):
    one = Judge(np.array([1.0]))
    one.stretched_at = 100
    assert one.looks_anew(np.zeros((number, 1))) is anew
    assert one.stretched_at == (0 if anew else 100)


def test_what_is_known_is_forgotten_where_heights_changed():
    x = np.linspace(0, 1, 20)
    one, first = judged(x[:, None], x**2)
    one.judged(x[:, None], 3 * x**2, np.zeros(20, np.intp))
    _, fresh = judged(x[:, None], 3 * x**2)
    again = one.judged(x[:, None], 3 * x**2, np.zeros(20, np.intp))
    np.testing.assert_allclose(again.size, fresh.size)
    np.testing.assert_allclose(again.size, 3 * first.size, rtol=1e-6)


def test_what_is_known_is_kept_where_a_height_without_a_value_stays(monkeypatch):
    x = np.linspace(0, 1, 20)
    heights, kind = np.where(x == 0, np.nan, x**2), np.where(x == 0, -1, 0)
    before = []
    renewed = judge.renewed
    monkeypatch.setattr(judge, "renewed", lambda known, *rest: (before.append(known), renewed(known, *rest))[1])
    one, _ = judged(x[:, None], heights, kind)
    one.judged(x[:, None], heights, kind)
    assert before[0] is None
    assert before[1] is not None
