"""Some cells of a study: which ones, and what of the study they keep."""

import numpy as np
import pytest
from toy_studies import build

from sweep.cells.sample import drawn, multiplied, sampled

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
