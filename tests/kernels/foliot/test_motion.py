"""Angle and speed over a period: against 50 digits, and against the energy and the equation of motion."""

import numpy as np
import oracles
import pytest
from columns import bounds, solve
from mpmath import mpf

from kernels.foliot.motion import FOLIOT_MOTION
from kernels.interface import Status


def test_angle_and_speed_are_right_to_4e_15_of_their_largest():
    random = np.random.default_rng(7)
    alpha, a, phi0 = 10 ** random.uniform(-12, 12, 40), 10 ** random.uniform(-2, 2, 40), np.full(40, 0.3)
    mu, phase = alpha * a * a * phi0, np.sort(random.uniform(0, 1, 12))
    outputs, status = solve(FOLIOT_MOTION, "closed", mu, phi0, a, along=[phase])
    limit = bounds(FOLIOT_MOTION, "closed", mu, phi0, a, along=[phase])
    assert (status == Status.OK).all()
    assert (limit == 4e-15).all()
    for i in range(40):
        _, amplitude, speed, _, _ = oracles.foliot(mu[i], phi0[i], a[i])
        for j in range(12):
            x, v = oracles.foliot_angle(mu[i], phi0[i], a[i], phase[j])
            assert abs(mpf(outputs["angle"][i, j]) - x) < limit[i] * amplitude
            assert abs(mpf(outputs["speed"][i, j]) - v) < limit[i] * speed


@pytest.mark.parametrize("method", ["closed", "segments"])
@pytest.mark.parametrize(
    ("cell", "missing", "kept"),
    [((1e-300, 1e-300, 1e10), "speed", "angle"), ((1.7e308, 1.7e308, 1.0), "angle", "speed")],
)
def test_of_angle_and_speed_the_one_that_a_float64_can_hold_is_given(method, cell, missing, kept):
    phase = np.array([0.0, 0.1, 0.7])
    outputs, status = solve(FOLIOT_MOTION, method, *([v] for v in cell), along=[phase])
    assert status[0] == Status.PARTLY_OUT_OF_RANGE
    assert np.isnan(outputs[missing]).all()
    small, _ = solve(FOLIOT_MOTION, method, *([v] for v in (cell[0] / cell[1], 1.0, cell[2])), along=[phase])
    np.testing.assert_allclose(outputs[kept] / cell[1], small[kept], rtol=1e-13)
