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
