"""What fires in a step of the Taylor method in which several events pass 0: the first one."""

import numpy as np
import pytest
from columns import columns_of, solve

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, scene_kernel, sign

STEPS = scene_kernel(
    name="two_steps",
    doc="driven over two edges where the drive falls: parabolas, whose series hold however long the step",
    states=(Field("angle", "rad", "angle"), Field("speed", "rad/s", "speed")),
    parameters=(
        Field("first", "rad", "first edge"),
        Field("second", "rad", "second edge"),
        Field("drop", "rad/s^2", "by which the drive of 1 falls at each edge"),
    ),
    rates=lambda angle, speed, first, second, drop: (
        speed,
        1.0 - 0.5 * drop * (2.0 + sign(angle - first) + sign(angle - second)),
    ),
    surface=lambda angle, side: 1.0 - side * angle,
    start=lambda: (0.0, 0.0),
)


def truth(edges, drop):
    """Time and speed at the angle 1."""
    time, speed, angle, drive = 0.0, 0.0, 0.0, 1.0
    for edge in (*sorted(e for e in edges if e < 1.0), 1.0):
        end = np.sqrt(speed**2 + 2.0 * drive * (edge - angle))
        time, speed, angle, drive = time + 2.0 * (edge - angle) / (speed + end), end, edge, drive - drop
    return time, speed


@pytest.mark.skipif(COMPILED, reason="one more compilation; run with NUMBA_DISABLE_JIT=1")
@pytest.mark.parametrize(
    "edges", [(0.9, 0.95), (0.95, 0.9), (0.999, 1.001), (1.001, 0.999), (1.001, 1.002), (0.2, 1.1)]
)
def test_of_events_that_pass_in_one_step_the_first_one_fires(edges):
    columns = [np.atleast_1d(c) for c in columns_of(STEPS, (*edges, 0.3), {"flips": 1.0})]
    outputs, status = solve(STEPS, "taylor_once", *columns, rtol=1e-8)
    assert status[0] == Status.OK
    assert (outputs["time"][0], outputs["speed"][0]) == pytest.approx(truth(edges, 0.3), rel=1e-13)
