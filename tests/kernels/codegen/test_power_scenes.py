"""Powers of a state that bring it to rest or hold its place: against the energy integral, a Beta function."""

import numpy as np
import pytest
from columns import relative_error, solve
from mpmath import mp, mpf

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, power, scene_kernel, sign

TOLERANCES = [1e-10, 1e-12] if COMPILED else [1e-10]
"""By one series; `slide` is followed by both."""


def fields(*names):
    return tuple(Field(name, "1", name) for name in names)


@pytest.fixture(scope="module")
def slide():
    return scene_kernel(
        name="slide", doc="v' = -a v - abs(v)^n sign v, to the switch at x = 5", states=fields("x", "v"),
        parameters=fields("n", "a"), rates=lambda x, v, n, a: (v, -a * v - power(abs(v), n) * sign(v)),
        surface=lambda x: 5.0 - x, start=lambda: (0.0, 1.0),
    )  # fmt: skip


@pytest.fixture(scope="module")
def swing():
    return scene_kernel(
        name="swing", doc="x'' = -abs(x)^n sign x, switched where x passes 0, at its kink", states=fields("x", "v"),
        parameters=fields("n", "x0", "v0"), rates=lambda x, v, n: (v, -power(abs(x), n) * sign(x)),
        surface=lambda x, side: side * x, start=lambda x0, v0: (x0, v0),
    )  # fmt: skip


@pytest.mark.parametrize("rtol", [1e-6, 1e-13] if COMPILED else [1e-10])
@pytest.mark.parametrize("a", [0.0, 1.0])
def test_what_a_power_below_1_brings_to_rest_sticks(slide, rtol, a):
    n = np.array([0.5, 0.3, 0.05, 0.8] if COMPILED else [0.5, 0.3])
    _, status = solve(slide, "taylor", n, np.full(len(n), a), np.ones(len(n)), rtol=rtol)
    assert (status == Status.STICKS).all()


def quarter(n, x0, v0):
    """A quarter of the period of x'' = -abs(x)^n sign x: v^2/2 + x^(n + 1)/(n + 1) is kept."""
    p = mpf(n) + 1
    far = (p * mpf(v0) ** 2 / 2 + mpf(x0) ** p) ** (1 / p)
    return far ** (1 - p / 2) * mp.sqrt(p / 2) * mp.beta(1 / p, mpf(1) / 2) / p


@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize(("x0", "v0"), [(1.0, 0.0), (0.0, 1.0)])
def test_an_oscillator_switched_at_its_own_kink_keeps_its_period(swing, rtol, x0, v0):
    n, flips = np.meshgrid(*(([-0.3, 0.1, 0.5, 1.5, 2.2], [1.0, 2.0, 21.0, 60.0]) if COMPILED else ([0.5], [2.0])))
    n, flips = n.ravel(), flips.ravel()
    outputs, status = solve(swing, "taylor", n, np.full(len(n), x0), np.full(len(n), v0), flips, rtol=rtol)
    quarters = 2 * flips - (1 if x0 else 0)
    times = [mpf(count) * quarter(float(power), x0, v0) for count, power in zip(quarters, n, strict=True)]
    right = status == Status.OK
    assert right.all() if rtol > 1e-12 else right.mean() > 0.9
    assert (relative_error(outputs["time"], times)[right] < rtol).all()
    assert (outputs["x"] == 0.0).all()


@pytest.mark.skipif(not COMPILED, reason="thousands of steps")
def test_what_a_tighter_tolerance_can_do_a_wider_one_does_not_refuse():
    """v' = (1 - v)/eps: v comes to 1 in the last digit alone, where the steps are free of eps."""
    lag = scene_kernel(
        name="lag", doc="x' = v, v' = (1 - v)/eps", states=fields("x", "v"), parameters=fields("eps"),
        rates=lambda v, eps: (v, (1.0 - v) / eps), surface=lambda x: 1.0 - x, start=lambda: (0.0, 0.0),
    )  # fmt: skip
    for rtol in (1e-6, 1e-10, 1e-13):
        outputs, status = solve(lag, "dop853", np.array([1e-5]), np.ones(1), rtol=rtol)
        assert status[0] == Status.OK
        assert relative_error(outputs["time"], [1 + mpf(10) ** -5])[0] < max(rtol, 1e-13)
