"""Values of axes and points of designs, against 50 digits and the generators themselves; csv files by their limits."""

from decimal import Decimal

import mpmath
import numpy as np
import pytest

from sweep.study import samples
from sweep.study.samples import unit_points
from sweep.study.spacing import spread

SHARES = [0.0, 0.125, 0.7, 1.0]


@pytest.mark.parametrize("factor", [None, Decimal("0.001")])
def test_shares_of_the_way_are_those_of_50_digits(factor):
    with mpmath.workdps(50):
        scale = mpmath.mpf(str(factor or 1))
        shares = [mpmath.mpf(share) for share in SHARES]
        even = [float((mpmath.mpf("0.3") + mpmath.mpf("1.7") * share) * scale) for share in shares]
        ratio = [float(mpmath.mpf("0.3") * (mpmath.mpf(2) / mpmath.mpf("0.3")) ** share * scale) for share in shares]
    assert spread("linear", 0.3, 2.0, np.array(SHARES), factor).tolist() == even
    assert spread("log", 0.3, 2.0, np.array(SHARES), factor).tolist() == ratio


# samples


def test_designs_have_the_points_that_they_say():
    for design, points in (("sobol", 8), ("latin", 8), ("random", 8), ("saltelli", 40), ("morris", 32)):
        assert samples.count(design, 3, 8) == points
        if design in ("saltelli", "morris"):
            pytest.importorskip("SALib")
        found = unit_points(design, 3, {"n": 8, "seed": 5})
        assert found.shape == (points, 3)
        assert ((found >= 0) & (found <= 1)).all()
        assert (found == unit_points(design, 3, {"n": 8, "seed": 5})).all()


def test_morris_moves_one_axis_at_a_time_on_four_levels():
    pytest.importorskip("SALib")
    points = unit_points("morris", 3, {"n": 5, "seed": 2}).reshape(5, 4, 3)
    assert set(np.round(np.unique(points) * 3, 12)) <= {0.0, 1.0, 2.0, 3.0}
    assert ((np.diff(points, axis=1) != 0).sum(axis=2) == 1).all()


def test_saltelli_changes_one_axis_of_a_point_for_that_of_another():
    pytest.importorskip("SALib")
    first, *changed, other = unit_points("saltelli", 3, {"n": 4, "seed": 2}).reshape(4, 5, 3).transpose(1, 0, 2)
    for k, points in enumerate(changed):
        np.testing.assert_array_equal(points[:, k], other[:, k])
        np.testing.assert_array_equal(np.delete(points, k, 1), np.delete(first, k, 1))
