"""Order and event location of the Runge-Kutta steps, on a motion with a formula."""

import math

import numpy as np
import pytest

from kernels.integrate.nystrom import dopri5_step, integrate_until
from kernels.lanes.jit import COMPILED, jit, jit_entry


@jit
def oscillation(state, scene):
    """x'' = -w^2 x and its tangents by x0 and by w."""
    x, _, x_start, _, x_pace, _ = state
    w = scene[0]
    return -w * w * x, -w * w * x_start, -w * w * x_pace - 2.0 * w * x


@jit
def unit_scales(state, scene):
    return 1.0, 1.0, 1.0, 1.0, 1.0, 1.0


@jit
def anything(state, acceleration, scene):
    """Of steps no longest."""
    return math.inf


@jit
def crossing(state, acceleration, scene):
    return state[0], state[1]


@jit_entry
def march(w, t, steps):
    state = (1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    for _ in range(steps):
        state, error, _ = dopri5_step(oscillation, state, (w,), t / steps, unit_scales(state, (w,)))
    return state, error


@jit_entry
def quarter(w, tolerance):
    start = (1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    return integrate_until(crossing, oscillation, unit_scales, anything, start, (w,), 0.1, tolerance, True)


def truth(w, t):
    """x, v and both tangents of cos(w t)."""
    c, s = math.cos(w * t), math.sin(w * t)
    return np.array([c, -w * s, c, -w * s, -t * s, -s - w * t * c])


ROWS = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
FOURTH = (5179 / 57600, 0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40)


def by_the_table(state, w, h):
    """Fifth-order result and its difference from the fourth, by Dormand and Prince's table for first-order systems."""

    def rates(y):
        x, v, x1, v1, x2, v2 = y
        return np.array([v, -w * w * x, v1, -w * w * x1, v2, -w * w * x2 - 2 * w * x])

    stages, point = [], np.array(state)
    for row in ROWS:
        point = np.array(state) + h * sum((a * k for a, k in zip(row, stages, strict=True)), np.zeros(6))
        stages.append(rates(point))
    fourth = np.array(state) + h * sum(b * k for b, k in zip(FOURTH, stages, strict=True))
    return point, np.abs(point - fourth)


@jit_entry
def one_step(state, w, h, scale):
    return dopri5_step(oscillation, state, (w,), h, scale)[:2]


def test_a_step_and_the_error_of_each_component_are_those_of_the_table():
    start = (1.0, 0.3, -0.7, 0.2, 0.5, -0.4)
    result, error = by_the_table(start, 1.3, 0.5)
    for i in range(6):
        scale = tuple(1.0 if i == j else 1e300 for j in range(6))
        state, found = one_step(start, 1.3, 0.5, scale)
        assert state == pytest.approx(result, rel=1e-14)
        assert found == pytest.approx(error[i], rel=1e-8), i


def test_error_falls_as_the_fifth_power_of_the_step():
    worst = [np.abs(np.array(march(1.3, 2.0, n)[0]) - truth(1.3, 2.0)) for n in (16, 32)]
    order = np.log2(worst[0] / worst[1])
    assert np.all(order > 4.7)


def test_the_error_estimate_falls_as_the_fifth_power_and_covers_the_step():
    estimates, errors = [], []
    for h in (0.2, 0.1):
        state, estimate = march(1.3, h, 1)
        estimates.append(estimate)
        errors.append(np.abs(np.array(state) - truth(1.3, h)).max())
    assert math.log2(estimates[0] / estimates[1]) == pytest.approx(5, abs=0.3)
    assert errors[0] < estimates[0]


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
def test_the_event_is_located_to_the_tolerance(tolerance):
    state, t, _, moving = quarter(1.3, tolerance)
    assert not moving
    assert t == pytest.approx(math.pi / 2.6, rel=20 * tolerance)
    assert abs(state[0]) < 1e-15
    assert state[1] == pytest.approx(-1.3, rel=20 * tolerance)
    assert state[4] == pytest.approx(-math.pi / 2.6, rel=50 * tolerance)


@pytest.mark.skipif(not COMPILED, reason="ten thousand steps in plain Python")
def test_a_motion_that_never_meets_the_event_is_given_up():
    @jit
    def never(state, acceleration, scene):
        return state[0] + 2.0, state[1]

    @jit_entry
    def wait():
        start = (1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        return integrate_until(never, oscillation, unit_scales, anything, start, (1.0,), 0.1, 1e-3, True)

    assert wait()[3]
