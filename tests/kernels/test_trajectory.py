"""A scene along its way: at its switches and at given times, against closed forms."""

import numpy as np
import pytest
from columns import estimated, solve
from kicked_scene import MOTION, SECTION

from kernels.interface import Status
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="an order of 18 takes long as plain Python")


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_section_is_the_map_of_kicks(method):
    gain, passages = np.array([2.8, 3.2, 3.5]), np.array([1.0, 2.0, 7.0, 40.0])
    found, status, error = estimated(SECTION, method, gain=gain, bend=1.0, along=[passages])
    assert (status == Status.OK).all()
    speed, true = np.full(3, 0.3), []
    for passage in range(1, 41):
        if passage in passages:
            true.append(-((-1.0) ** (passage - 1)) * speed)
        speed = gain * speed * (1.0 - speed)
    assert abs(found["v"] - np.transpose(true)).max() <= 1e-9 * 0.9
    assert abs(found["time"] / (np.pi * passages) - 1.0).max() < 1e-9
    assert (error <= 1e-9).all()


def test_chaos_is_given_and_not_called_right():
    found, status = solve(SECTION, "taylor", gain=[3.9], bend=1.0, along=[np.arange(1.0, 121.0)])
    assert status[0] == Status.INACCURATE
    assert (abs(found["v"][0]) < 1.0).all()


def test_a_motion_is_known_at_any_time():
    at, gain = np.array([0.4, 3.0, 3.3, 10.0, 31.0]), np.array([1.0, 0.5, 0.9])
    found, status = solve(MOTION, "taylor", gain=gain, along=[at])
    assert (status == Status.OK).all()
    true = 0.3 * gain[:, None] ** np.floor(at / np.pi) * np.sin(at)
    assert abs(found["x"] - true).max() <= 1e-9 * 0.3
    _, status = solve(MOTION, "taylor", gain=gain, along=[at], flips=3.0)
    assert (status == Status.TOO_SHORT).all()
