"""Some cells of a study: which ones, and what of the study they keep."""

import numpy as np
import pytest
from toy_studies import build, build_rich

from sweep.cells import sample
from sweep.cells.sample import drawn, multiplied, sampled, with_method
from sweep.system.errors import SweepError

HEIGHTS, SPEEDS = np.arange(1.0, 6.0), np.array([0.0, 1.0, 2.0, 3.0])


def stones(**keys):
    return build(**{"axes": {"height": HEIGHTS, "v0": SPEEDS}, **keys})


def cells_of(study):
    return list(zip(*(axis.values.tolist() for axis in study.axes.values()), strict=True))


@pytest.mark.parametrize(
    ("cells", "numbers"), [(1, [0]), (2, [0, 19]), (3, [0, 9, 19]), (20, list(range(20))), (99, list(range(20)))]
)
def test_cells_are_spread_evenly_from_the_first_to_the_last(cells, numbers):
    found = sampled(stones(), cells)
    assert cells_of(found) == [(HEIGHTS[k // 4], SPEEDS[k % 4]) for k in numbers]
    assert found.design == "zip"


def test_of_a_condition_cells_are_spread_over_those_that_are_asked_for(monkeypatch):
    study = stones(where="v0 > 1.5")
    assert cells_of(sampled(study, 3)) == [(1.0, 2.0), (3.0, 2.0), (5.0, 3.0)]
    assert len(cells_of(sampled(study, 99))) == 10
    assert cells_of(sampled(stones(where="v0 > 9"), 2)) == [(1.0, 0.0), (5.0, 3.0)]  # none is asked for
    assert sampled(study, 3).where == ""
    monkeypatch.setattr(sample, "MOST_TRIED", 2)
    assert cells_of(sampled(study, 99)) == [(5.0, 3.0)]


def test_where_only_methods_are_swept_one_cell_is_left():
    study = build(axes={"method": ["exact", "rough"]}, fixed={"height": 4.0})
    found = sampled(study, 9, {"height": 2.0, "g": 3.0})
    assert (found.axes["height"].values.tolist(), found.method) == ([8.0], "auto")
    assert found.fixed == {"v0": 0.0, "g": pytest.approx(3 * 9.80665)}
    assert sampled(stones(method="rough"), 1).method == "rough"


def test_factors_multiply_axes_fixed_parameters_and_coordinates():
    study = stones(outputs=["drop"], along={"phase": [0.25, 0.5]})
    found = sampled(study, 2, {"height": 10.0, "g": 2.0, "phase": 2.0})
    assert cells_of(found) == [(10.0, 0.0), (50.0, 3.0)]
    assert found.fixed["g"] == pytest.approx(2 * 9.80665)
    assert found.along["phase"].tolist() == [0.5, 1.0]
    twice = multiplied(sampled(study, 2), {"height": np.array([2.0, 3.0]), "g": 0.5, "phase": 2.0})
    assert cells_of(twice) == [(2.0, 0.0), (15.0, 3.0)]
    assert twice.fixed["g"] == pytest.approx(9.80665 / 2)
    assert twice.along["phase"].tolist() == [0.5, 1.0]


def test_arrays_of_cells_are_multiplied_cell_by_cell():
    assert sample._by_cell(np.ones((2, 3)), np.array([2.0, 5.0])).tolist() == [[2.0] * 3, [5.0] * 3]
    assert sample._by_cell(np.ones((2, 3)), 4.0).tolist() == [[4.0] * 3] * 2


def test_cells_drawn_at_random_are_cells_of_the_grid_that_are_asked_for():
    rng = np.random.default_rng(3)
    numbers = np.random.default_rng(3).integers(0, 20, 50)
    assert cells_of(drawn(stones(), 50, rng)) == [(HEIGHTS[k // 4], SPEEDS[k % 4]) for k in numbers]
    some = cells_of(drawn(stones(where="v0 > 2.5"), 50, rng))
    assert len(some) == 50
    assert {speed for _, speed in some} == {3.0}
    assert len(set(some)) == 5
    assert len(cells_of(drawn(stones(where="v0 > 9"), 50, rng))) == 50
    only = drawn(build(axes={"method": ["exact", "rough"]}, fixed={"height": 4.0}), 3, rng)
    assert cells_of(only) == [(4.0,)] * 3


def test_a_study_by_one_method_at_one_rtol():
    found = with_method(stones(), "rough", 0.125)
    assert (found.method, found.rtol) == ("rough", 0.125)


@pytest.mark.parametrize(
    ("where", "most_asked", "refused"),
    [
        ("", 20, False),
        ("height > 4.5 and v0 > 2.5", 20, False),  # the last cell alone
        ("height > 4.5 and v0 > 2.5", 16, False),  # which is not looked at
        ("height > 9 and v0 > 2.5", 16, False),  # too many to tell
        ("height > 9 and v0 > 2.5", 20, True),
        ("height > 9 and v0 > 2.5", 400, True),
        ("v0 > 9", 4, True),  # of four speeds, whatever the height
        ("v0 > 2.5", 4, False),
    ],
)
def test_a_condition_that_holds_for_no_cell_is_refused_where_all_can_be_looked_at(
    monkeypatch, where, most_asked, refused
):
    monkeypatch.setattr(sample, "MOST_TRIED", 4)
    monkeypatch.setattr(sample, "MOST_ASKED", most_asked)
    study = stones(where=where)
    if not refused:
        sample.require_asked(study)
        return
    with pytest.raises(SweepError) as caught:
        sample.require_asked(study)
    assert str(caught.value) == f'where = "{where}": holds for none of the 20 cells; nothing is left to run'


def test_cells_of_a_zip_are_looked_at_together():
    study = build(axes={"height": [1.0, 2.0], "v0": [0.0, 1.0]}, design="zip", where="height > 1.5 and v0 < 0.5")
    with pytest.raises(SweepError, match="holds for none of the 2 cells"):
        sample.require_asked(study)


def test_what_has_no_factor_is_left_as_it_is():
    study = sampled(stones(outputs=["drop"], along={"phase": [0.25, 0.5]}), 3)
    same = multiplied(study, {})
    assert cells_of(same) == cells_of(study)
    assert (dict(same.fixed), same.along["phase"].tolist()) == (dict(study.fixed), [0.25, 0.5])


@pytest.mark.parametrize(
    ("given", "found"),
    [
        ({}, {"load": 6.0, "grip": 6.0, "hold": 6.0}),
        ({"hold": 5.0}, {"load": 6.0, "grip": 6.0, "hold": 5.0}),
        ({"grip": 5.0}, {"load": 6.0, "grip": 5.0, "hold": 5.0}),
    ],
)
def test_a_parameter_that_is_not_given_goes_with_the_one_it_equals(given, found):
    study = build_rich(axes={"shape": ["round", "square"]}, fixed={"load": 2.0, **given})
    fixed = multiplied(sampled(study, 2), {"load": 3.0}).fixed
    assert {name: fixed[name] for name in found} == found
