"""Powers of a state, which have no series where it turns: against integrals in 24 digits, and of the energy, a Beta."""

import numpy as np
import pytest
import scene_oracles as oracles
from columns import fields, relative_error, solve
from mpmath import mp, mpf
from rich_scene import RICH

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import power, scene_kernel, sign

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of steps")


GENERAL = scene_kernel(
    name="general", doc="foliot with drag of any power", states=fields("angle", "speed"),
    parameters=fields("mu", "phi0", "a", "c", "n", "speed0"),
    rates=lambda speed, side, mu, a, c, n: (speed, side * mu - a * speed - c * power(abs(speed), n) * sign(speed)),
    surface=lambda angle, side, phi0: phi0 - side * angle, start=lambda speed0: (0.0, speed0),
)  # fmt: skip


@pytest.mark.parametrize("rtol", [1e-5, 1e-9])
def test_any_power_is_right_to_the_tolerance(rtol):
    """The power 0 is dry friction, and 2 is quadratic drag."""
    mu, phi0, a = [2.0, 0.7, 4.5, 3.0, 3.0], [1.0, 2.0, 0.4, 2.0, 2.0], [0.3, 0.05, 0.0, 0.0, 0.3]
    cells = mu, phi0, a, [0.4, 0.2, 0.1, 1.0, 0.4], [1.5, 0.5, 2.7, 0.0, 2.0]
    outputs, status = solve(GENERAL, "taylor", *cells, 0.0, flips=2.0, rtol=rtol)
    assert (status == Status.OK).all()
    truths = [oracles.power_foliot(*cell, 2) for cell in zip(*cells, strict=True)]
    assert relative_error(outputs["time"], [t for t, _ in truths]).max() < rtol
    assert relative_error(abs(outputs["speed"]), [v for _, v in truths]).max() < rtol


@pytest.mark.parametrize("rtol", [1e-6, 1e-13])
@pytest.mark.parametrize("a", [0.0, 1.0])
def test_what_a_power_below_1_brings_to_rest_sticks(rtol, a):
    n = np.array([0.5, 0.3, 0.05, 0.8])
    _, status = solve(GENERAL, "taylor", 0.0, 5.0, a, 1.0, n, 1.0, flips=1.0, rtol=rtol)
    assert (status == Status.STICKS).all()


@pytest.fixture(scope="module")
def swing():
    return scene_kernel(
        name="swing", doc="x'' = -abs(x)^n sign x, switched where x passes 0, at its kink", states=fields("x", "v"),
        parameters=fields("n", "x0", "v0"), rates=lambda x, v, n: (v, -power(abs(x), n) * sign(x)),
        surface=lambda x, side: side * x, start=lambda x0, v0: (x0, v0),
    )  # fmt: skip


def quarter(n, x0, v0):
    """A quarter of the period of x'' = -abs(x)^n sign x: v^2/2 + x^(n + 1)/(n + 1) is kept."""
    p = mpf(n) + 1
    far = (p * mpf(v0) ** 2 / 2 + mpf(x0) ** p) ** (1 / p)
    return far ** (1 - p / 2) * mp.sqrt(p / 2) * mp.beta(1 / p, mpf(1) / 2) / p


@pytest.mark.parametrize("rtol", [1e-10, 1e-12])
@pytest.mark.parametrize(("x0", "v0"), [(1.0, 0.0), (0.0, 1.0)])
def test_an_oscillator_switched_at_its_own_kink_keeps_its_period(swing, rtol, x0, v0):
    n, flips = np.meshgrid([-0.3, 0.1, 0.5, 1.5, 2.2], [1.0, 2.0, 21.0, 60.0])
    n, flips = n.ravel(), flips.ravel()
    outputs, status = solve(swing, "taylor", n, np.full(len(n), x0), np.full(len(n), v0), flips, rtol=rtol)
    quarters = 2 * flips - (1 if x0 else 0)
    times = [mpf(count) * quarter(float(power), x0, v0) for count, power in zip(quarters, n, strict=True)]
    right = status == Status.OK
    assert right.all() if rtol > 1e-12 else right.mean() > 0.9
    assert (relative_error(outputs["time"], times)[right] < rtol).all()
    assert (outputs["x"] == 0.0).all()


def test_what_a_tighter_tolerance_can_do_a_wider_one_does_not_refuse():
    """v' = (1 - v)/eps: v comes to 1 in the last digit alone, where the steps are free of eps."""
    for rtol in (1e-6, 1e-10, 1e-13):
        outputs, status = solve(RICH, "dop853", [1e5], 1.0, a=1e5, flips=1.0, rtol=rtol)
        assert status[0] == Status.OK
        assert relative_error(outputs["time"], [1 + mpf(10) ** -5])[0] < max(rtol, 1e-13)


def test_on_its_way_to_rest_a_speed_is_right_up_to_the_end():
    """v' = -abs(v)^n sign v rests after v0^(1 - n)/(1 - n)."""
    kernel = scene_kernel(
        name="halting", doc="what drag alone brings to rest", states=fields("v"), parameters=fields("n", "end"),
        rates=lambda v, n: -power(abs(v), n) * sign(v), surface=lambda t, end: end - t, start=lambda: 2.0,
    )  # fmt: skip
    n, rtol, left = map(np.ravel, np.meshgrid([0.3, 0.5, 0.7], [1e-5, 1e-6, 1e-7], 10.0 ** -np.linspace(1.0, 8.0, 30)))
    end = 2.0 ** (1.0 - n) / (1.0 - n) * (1.0 - left)
    outputs, status = solve(kernel, "taylor", n, end, flips=1.0, rtol=rtol)
    power_left = [mpf(2) ** (1 - mpf(m)) - (1 - mpf(m)) * mpf(t) for m, t in zip(n, end, strict=True)]
    truth = np.array([p ** (1 / (1 - mpf(m))) for p, m in zip(power_left, n, strict=True)], float)
    good = status == Status.OK
    assert good.mean() > 0.9
    assert (abs(outputs["v"] - truth) / 2.0 < rtol)[good].all()


def test_at_wide_tolerances_errors_near_the_kinks_of_a_power_do_not_add_up_unseen(swing):
    random = np.random.default_rng(5)
    n, flips = random.uniform(0.5, 2.0, 1500), np.floor(random.uniform(5.0, 9.0, 1500))
    rtol = 10.0 ** random.uniform(-4.6, -3.0, 1500)
    outputs, status = solve(swing, "taylor", n, 1.0, 0.0, flips, rtol=rtol)
    assert (status == Status.OK).mean() > 0.99
    speed = np.sqrt(2.0 / (n + 1.0))
    assert (abs(abs(outputs["v"]) / speed - 1.0) < rtol)[status == Status.OK].all()
