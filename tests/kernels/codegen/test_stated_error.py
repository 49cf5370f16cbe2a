"""The accuracy that OK promises of a scene of one's own: against closed forms, other integrators and far finer runs."""

import numpy as np
import pytest
from columns import fields, relative_error, solve
from mpmath import mp, mpf
from rich_scene import RICH

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import scene_kernel

many = pytest.mark.skipif(not COMPILED, reason="many cells")


@many
def test_jumps_dry_friction_and_a_spring_are_right_where_a_cell_is_ok():
    random, n = np.random.default_rng(4), 300
    mu, a, c = (10.0 ** random.uniform(*each, n) for each in ((-1, 1), (-1, 0), (-1, 0)))
    cells = {"mu": mu, "phi0": 1.0, "a": a, "c": c, "R": 0.4 * mu, "e": 0.3, "k": 0.05 * mu, "flips": 12.0}
    found, status = solve(RICH, "taylor", **cells, rtol=1e-6)
    finer, sure = solve(RICH, "taylor", **cells, rtol=1e-10)
    right = (status == Status.OK) & (sure == Status.OK)
    assert right.mean() > 0.8
    for name in ("time", "interval", "speed"):
        np.testing.assert_allclose(found[name][right], finer[name][right], rtol=1e-6)


def test_where_rounding_is_magnified_ten_thousandfold_ok_is_right_or_not_said():
    """So little of the drive is left by friction that both runs share what it rounds to."""
    for share in (1e-4, 1e-7, 1e-10):
        R = 1.0 - share
        outputs, status = solve(RICH, "taylor", [1.0], 1.0, R=R, flips=1.0, rtol=1e-9)
        with mp.workdps(40):
            true = mp.sqrt(2 / (1 - mpf(R)))
        assert status[0] != Status.OK or relative_error(outputs["time"], [true])[0] < 1e-9
    _, status = solve(RICH, "taylor", [1.0], 1.0, a=1e-3, R=1.0 - 1e-9, flips=1.0, rtol=1e-12)
    assert status[0] == Status.INACCURATE


def test_next_to_a_turning_point_a_switch_is_not_called_ok():
    """A first swing that passes the switch by 1e-13 of itself: when it does hangs on the root of so little."""
    _, status = solve(RICH, "taylor", [1.0], 1.0, k=2.0 * (1 - 1e-13), flips=1.0, rtol=1e-9)
    assert status[0] != Status.OK


def test_what_an_impact_leaves_at_rest_sticks_however_large_its_error_was_before():
    """A ball whose third impact returns nothing; beside it what errors leave of two numbers that are equal."""
    kernel = scene_kernel(
        name="thud", doc="three impacts", states=fields(*"xvew"),
        parameters=fields("g"), rates=lambda x, v, g: (v, -g * (1 + x * x), 0.0, 0.0), surface=lambda x: x,
        start=lambda: (1.0, 0.0, 1.0, 0.0),
        switch=lambda v, e, w, g: (0.0, -e * v, e - 0.5, w + 2 * e * (e - 0.5) * (v * v - g * 8 / 3)),
    )  # fmt: skip
    _, status = solve(kernel, "taylor", [9.81, 1.62], flips=5.0, rtol=1e-6)
    assert (status == Status.STICKS).all()
