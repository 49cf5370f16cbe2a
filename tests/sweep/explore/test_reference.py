"""What methods are measured against: relative errors by hand, and which method's word is taken in which cell."""

from dataclasses import replace

import numpy as np
import pytest
from toy import KERNEL, exact, rough
from toy_studies import build

from kernels.interface import FIRST_REFUSAL, Method, Status
from sweep.explore.reference import FINE, ROUNDING, best_reference, errors, given_reference, reference_by

HEIGHTS = np.array([1.0, 2.0, 5.0, 10.0])


def with_methods(*methods, **keys):
    study = build(axes={"height": HEIGHTS}, outputs=["impact_speed"], **keys)
    return replace(study, kernel=replace(KERNEL, methods=methods))


def saying(status, off=0.0):
    """As `exact`, off by a share; of height 10 the status is as `status` tells of rtol."""

    def solve(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said):
        exact(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said)
        impact_speed *= 1 + off * rtol
        said[height == 10.0] = status(rtol[0])

    return solve


def test_errors_are_relative_and_the_largest_over_outputs():
    true = {"a": np.array([1.0, -2.0, 4.0]), "b": np.array([1.0, 1.0, 1.0])}
    found = {"a": np.array([1.5, -2.5, 4.0]), "b": np.array([1.0, 0.5, 1.125])}
    assert errors(found, true).tolist() == [0.5, 0.5, 0.125]
    assert errors({"a": np.array([-1.0])}, {"a": np.array([1.0])}).tolist() == [2.0]


def test_errors_of_what_is_zero_missing_or_infinite():
    true = {"a": np.array([0.0, 0.0, np.nan, np.nan, 1.0, np.inf, np.inf])}
    found = {"a": np.array([0.0, 1e-300, np.nan, 1.0, np.nan, np.inf, 1.0])}
    assert errors(found, true).tolist() == [0.0, np.inf, 0.0, np.inf, np.inf, 0.0, np.inf]


def test_errors_of_traces_are_relative_to_their_largest_value():
    true = {"a": np.array([[[1.0, -4.0], [np.nan, 2.0]], [[0.0, 0.0], [0.0, 0.0]]])}
    found = {"a": np.array([[[2.0, -4.0], [np.nan, 2.5]], [[0.0, 0.0], [0.0, 0.0]]])}
    assert errors(found, true).tolist() == [0.25, 0.0]
    found["a"][1, 1, 1] = 1e-9
    assert errors(found, true).tolist() == [0.25, np.inf]
    empty = np.empty((2, 0))
    assert errors({"a": empty}, {"a": empty}).tolist() == [0.0, 0.0]


def test_a_truth_is_right_to_half_a_digit_and_void_where_nothing_has_a_value():
    study = build(axes={"height": HEIGHTS}, outputs=["impact_speed", "fall_time"])
    values = {"impact_speed": [1.0, np.nan, np.nan, 2.0], "fall_time": [1.0, 1.0, np.nan, np.nan]}
    found = given_reference(study, values)
    assert found.floor.tolist() == [2.0**-53] * 4 == [ROUNDING] * 4
    assert found.sound.tolist() == [True, True, False, True]
    assert found.void.tolist() == [False, False, True, False]
    assert (found.judged, found.source) == (4, "the truth given")


def test_each_cell_has_the_value_of_the_least_rtol_at_which_it_is_said_to_be_right():
    """Of height 10 from 1e-9 on, which is 2e-9 off; of the others from 1e-14 on."""
    coarse = saying(lambda rtol: Status.INACCURATE if rtol < 0.9e-9 else Status.OK, off=2.0)
    found = reference_by(with_methods(Method("coarse", "", coarse)), "coarse")
    np.testing.assert_allclose(found.floor, [1e-14, 1e-14, 1e-14, 1e-9], rtol=1e-12)
    speed = np.sqrt(2 * 9.80665 * HEIGHTS)
    np.testing.assert_allclose(found.values["impact_speed"] / speed - 1, [0, 0, 0, 2e-9], atol=1e-13)
    assert found.sound.all()
    assert not found.void.any()
    assert list(FINE) == pytest.approx([1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6], rel=1e-12)


def test_a_cell_never_right_is_open_and_one_refused_for_good_is_void():
    never = reference_by(with_methods(Method("never", "", saying(lambda rtol: Status.INACCURATE))), "never")
    assert never.floor.tolist() == [1e-14] * 3 + [np.inf]
    assert (never.sound.tolist(), never.void.any(), never.judged) == ([True] * 3 + [False], False, 3)
    given_up = reference_by(with_methods(Method("lazy", "", saying(lambda rtol: Status.STEP_LIMIT))), "lazy")
    assert (given_up.sound.sum(), given_up.void.sum(), given_up.judged) == (3, 0, 3)
    first = reference_by(with_methods(Method("first", "", saying(lambda rtol: FIRST_REFUSAL))), "first")
    assert first.sound.tolist() == [True] * 3 + [False]
    void = reference_by(with_methods(Method("sure", "", saying(lambda rtol: Status.NEVER_STARTS))), "sure")
    assert (void.sound.sum(), void.void.tolist(), void.judged) == (3, [False] * 3 + [True], 4)


def test_a_grazing_cell_is_taken_for_right():
    found = reference_by(with_methods(Method("grazing", "", saying(lambda rtol: Status.GRAZING))), "grazing")
    assert found.sound.all()


def test_no_further_tolerance_is_tried_once_nothing_is_open():
    asked = []

    def told(rtol):
        asked.append(rtol)
        return Status.INACCURATE if rtol < 0.9e-12 else Status.OK

    reference_by(with_methods(Method("told", "", saying(told))), "told")
    assert asked == pytest.approx([1e-14, 1e-13, 1e-12], rel=1e-12)


def test_of_methods_the_fewest_open_cells_count_before_a_bound_and_a_bound_before_digits():
    def bound(height, v0, g, rtol, phase, asked, out):
        out[...] = 1e-15

    open_, fine = saying(lambda rtol: Status.STEP_LIMIT), saying(lambda rtol: Status.OK)
    coarse = saying(lambda rtol: Status.INACCURATE if rtol < 0.9e-9 else Status.OK)

    def best(*methods):
        return best_reference(with_methods(*methods), [m.name for m in methods], None).source

    bounded = Method("open", "", open_, bound)
    assert best(bounded, Method("plain", "", fine)) == "plain"
    assert best(Method("plain", "", open_), bounded) == "open"
    assert best(Method("coarse", "", coarse), Method("fine", "", fine)) == "coarse"  # leaves no cell open, and is first
    assert best(Method("coarse", "", coarse, bound), Method("fine", "", rough, bound)) == "fine"
