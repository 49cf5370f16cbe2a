"""A general power of the speed, which has no Taylor series where the foliot turns: against integrals in 24 digits."""

import numpy as np
import pytest
import scene_oracles as oracles
from columns import relative_error
from columns import solve as solve_columns
from mpmath import mp, mpf

from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, power, scene_kernel, sign


def rates(angle, speed, side, mu, a, c, n):
    return speed, side * mu - a * speed - c * power(abs(speed), n) * sign(speed)


def surface(angle, side, phi0):
    return phi0 - side * angle


GENERAL = scene_kernel(
    name="general",
    doc="foliot with drag of any power",
    states=(Field("angle", "rad", "angle at the switch"), Field("speed", "rad/s", "speed at the switch")),
    parameters=(
        Field("mu", "rad/s^2", "drive"),
        Field("phi0", "rad", "switching angle"),
        Field("a", "1/s", "viscous friction", lower=0.0),
        Field("c", "1", "drag", lower=0.0),
        Field("n", "1", "its power"),
    ),
    rates=rates,
    surface=surface,
    start=lambda: (0.0, 0.0),
)


def solve(*columns, flips, rtol=1e-7, method="taylor"):
    columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(c, float)) for c in (*columns, flips)))
    return solve_columns(GENERAL, method, *columns, rtol=rtol)


def check(outputs, cells, flips, rtol):
    truths = [oracles.power_foliot(*cell, flips) for cell in zip(*cells, strict=True)]
    assert relative_error(outputs["time"], [t for t, _ in truths]).max() < rtol
    assert relative_error(abs(outputs["speed"]), [v for _, v in truths]).max() < rtol


@pytest.mark.parametrize("rtol", [1e-5, 1e-9])
def test_any_power_is_right_to_the_tolerance(rtol):
    cells = [2.0, 0.7, 4.5], [1.0, 2.0, 0.4], [0.3, 0.05, 0.0], [0.4, 0.2, 0.1], [1.5, 0.5, 2.7]
    if not COMPILED:
        cells = [c[:1] for c in cells]
    outputs, status = solve(*cells, flips=2.0, rtol=rtol)
    assert (status == Status.OK).all()
    check(outputs, cells, 2, rtol)


def test_the_power_0_is_dry_friction_and_the_power_2_is_quadratic_drag():
    mu, R = mpf(3), mpf(1)
    outputs, status = solve(3.0, 2.0, [0.0, 0.3], [1.0, 0.4], [0.0, 2.0], flips=2.0, rtol=1e-9)
    assert (status == Status.OK).all()
    v = mp.sqrt(2 * (mu - R) * 2)
    top = v * v / (2 * (mu + R))
    dry = v / (mu - R) + v / (mu + R) + mp.sqrt(2 * (top + 4) / (mu - R))
    drag, _ = oracles.quadratic_foliot(3.0, 2.0, 0.3, 0.4, 2)
    assert relative_error(outputs["time"], [dry, drag]).max() < 1e-9


@pytest.mark.parametrize(
    ("cell", "status"),
    [
        ((0.0, 1.0, 0.1, 0.1, 1.5), Status.STICKS),
        ((1.0, 1.0, 0.1, 2.0, 0.0), Status.STICKS),
        ((1.0, 1.0, 0.1, 0.1, -2.0), Status.OUT_OF_RANGE),
        ((1e-140, 1e-140, 0.5, 0.0, 1.5), Status.OK),
    ],
)
def test_what_a_cell_comes_to_is_named(cell, status):
    outputs, verdict = solve(*cell, flips=2.0)
    assert verdict[0] == status
    assert status >= FIRST_REFUSAL or np.isfinite(outputs["time"][0])


def test_over_decades_what_is_not_remarked_is_right():
    if not COMPILED:
        pytest.skip("thousands of steps")
    random = np.random.default_rng(6)
    size = 200
    cells = [10.0 ** random.uniform(-4, 4, size) for _ in range(4)] + [random.uniform(-0.9, 6.0, size)]
    outputs, status = solve(*cells, flips=1.0, rtol=1e-6)
    finer, again = solve(*cells, flips=1.0, rtol=1e-8)
    fine = (status == Status.OK) & (again == Status.OK)
    assert fine.mean() > 0.5
    np.testing.assert_allclose(outputs["time"][fine], finer["time"][fine], rtol=1e-6)
    np.testing.assert_allclose(outputs["speed"][fine], finer["speed"][fine], rtol=1e-6)


@pytest.mark.skipif(not COMPILED, reason="a thousand steps")
def test_a_first_step_from_the_kink_that_was_too_long_is_tried_again_in_the_core():
    """Of what friction brings to an end in a hundredth of the first guess: two steps are refused."""
    mu, phi0, a, c, n = cell = 1.0, 1.0, 100.0, 1e-7, 0.5
    outputs, status = solve(*cell, flips=1.0, rtol=1e-9)
    speed = mu / a
    for _ in range(5):
        speed = (mu - c * speed**n) / a
    assert status[0] == Status.OK
    assert outputs["time"][0] == pytest.approx(phi0 / speed + 1.0 / a, rel=1e-9)  # c leaves 1e-12 of the last
