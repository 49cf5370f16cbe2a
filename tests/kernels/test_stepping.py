"""Scenes of one's own at a fixed step: which methods can do which, and a scene of one state."""

import math

import numpy as np
import pytest
from columns import solve

from kernels.interface import Field, Status
from kernels.lanes.jit import COMPILED
from kernels.scene import sign
from kernels.stepping import METHODS, stepped_kernel


def surface(level, side):
    return 1.0 - side * level


def kernel(name, states, rates, start):
    return stepped_kernel(
        name=name,
        doc="a scene for tests",
        states=[Field(state, "1", "a state") for state in states],
        parameters=[Field("r", "1/s", "a rate", default=1.0)],
        rates=rates,
        surface=surface,
        start=start,
    )


def names(found):
    return {m.name for m in found.methods}


def filling(level, side, r):
    return r * (2.0 * side - level)


def start():
    return 0.0


FILLING = kernel("filling", ["level"], filling, start)


def test_methods_of_pairs_are_kept_from_scenes_that_are_none():
    assert names(FILLING) == {"euler", "rk4", "dopri5", "dop853"}

    def swing(level, speed, side, r):
        return speed, side - r * sign(speed)

    def bent(level, speed, side, r):
        return speed, side - r * abs(level)

    def two():
        return 0.0, 0.0

    assert names(kernel("swing", ["level", "speed"], swing, two)) == set(METHODS)
    assert names(kernel("bent", ["level", "speed"], bent, two)) == set(METHODS) - {"moreau"}


@pytest.mark.skipif(COMPILED, reason="one more compilation; run with NUMBA_DISABLE_JIT=1")
def test_a_scene_of_one_state():
    outputs, status = solve(FILLING, "dop853", [2.0], flips=3.0, step=0.1)
    assert status[0] == Status.OK
    assert outputs["time"][0] == pytest.approx((math.log(2) + 2 * math.log(3)) / 2, rel=1e-11)
    assert outputs["interval"][0] == pytest.approx(math.log(3) / 2, rel=1e-11)
    assert outputs["level"][0] == pytest.approx(1.0, rel=1e-12)
    assert np.isfinite(outputs["error"][0])
