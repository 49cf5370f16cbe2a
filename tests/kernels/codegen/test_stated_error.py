"""The accuracy that OK promises of a scene of one's own: against closed forms, other integrators and far finer runs."""

import numpy as np
import pytest
from columns import relative_error, solve
from mpmath import mp, mpf
from rich_scene import RICH
from scipy.integrate import solve_ivp

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, scene_kernel, sin

many = pytest.mark.skipif(not COMPILED, reason="many cells")


def scene(rates, states, parameters):
    """Driven back and forth between -phi0 and phi0, from rest."""
    return scene_kernel(
        name=rates.__name__, doc="waits", states=[Field(name, "1", name) for name in states],
        parameters=[Field(name, "1", name) for name in parameters], rates=rates, surface=surface,
        start=lambda: (0.0,) * len(states),
    )  # fmt: skip


def surface(x, side, phi0):
    return phi0 - side * x


def pendulum(x, v, t, side, mu, a, k, depth, omega):
    return v, side * mu - a * v - k * sin(x) + depth * sin(omega * t), 1.0


PENDULUM = scene(pendulum, "xvt", ("mu", "phi0", "a", "k", "depth", "omega"))


def relay(x, v, side, mu, eps):
    return v, eps * (1.0 - x * x) * v - x + side * mu


CANCEL = [
    (pendulum, 1.227828076851401e-09, 11, (0.4455631474004735, 0.9560298988515715, 0.01832808347224001,
     0.42694587399953216, 0.5502164268744045, 1.7521393673311403)),
    (pendulum, 1.4403361938954974e-05, 29, (0.7032387079896295, 0.25222528542474204, 0.013552182848106149,
     0.45628282635710926, 0.09266309859840524, 2.1110756238320407)),
    (relay, 9.676549867998949e-05, 19, (2.6453053426614175, 0.4157807057180794, 3.6094744684626345)),
]  # fmt: skip
"""Rates, rtol, flips and values of parameters where errors of steps cancel, and what is left of them grows."""


def by_scipy(motion, phi0, flips):
    """Time and speed at the last switch, each found by a step of Newton from the end of an integration of its own."""
    y, begun = [0.0, 0.0], 0.0
    for flip in range(flips):
        side = (-1.0) ** flip

        def gap(t, y, side):
            return phi0 - side * y[0]

        gap.terminal, gap.direction = True, -1.0
        how = {"method": "DOP853", "rtol": 3e-14, "atol": 1e-15, "args": (side,)}
        about = solve_ivp(motion, (begun, begun + 200.0), y, events=gap, **how).t_events[0][0]
        end = solve_ivp(motion, (begun, about), y, **how).y[:, -1]
        late = gap(about, end, side) / (side * end[1])
        y, begun = end + late * np.array(motion(about, end, side)), about + late
    return begun, y[1]


@many
@pytest.mark.parametrize(("rates", "rtol", "flips", "values"), CANCEL)
def test_a_cell_whose_errors_cancel_and_grow_again_is_right_or_not_called_ok(rates, rtol, flips, values):
    timed = rates is pendulum
    kernel = PENDULUM if timed else scene(relay, "xv", ("mu", "phi0", "eps"))
    others = (values[0], *values[2:])
    time, speed = by_scipy(lambda t, y, side: rates(*y, *((t,) if timed else ()), side, *others)[:2], values[1], flips)
    for wanted in (rtol, 0.1 * rtol):
        outputs, status = solve(kernel, "taylor", *values, flips=[float(flips)], rtol=wanted)
        off = max(abs(outputs["time"][0] / time - 1), abs(outputs["v"][0] / speed - 1))
        assert status[0] != Status.OK or off <= wanted + 1e-12


@many
@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
def test_where_states_feed_back_what_is_ok_is_right(rtol):
    """Against the same motion at a thousandth of the tolerance."""
    n, random = 400, np.random.default_rng(6)
    decades = (-0.5, 0.5), (-1, 0), (-2, -0.3), (-1, 0.3), (-2, 0.3), (-1, 1)
    columns = [10.0 ** random.uniform(*each, n) for each in decades]
    found, status = solve(PENDULUM, "taylor", *columns, flips=4.0, rtol=rtol)
    finer, sure = solve(PENDULUM, "taylor", *columns, flips=4.0, rtol=1e-3 * rtol)
    right = (status == Status.OK) & (sure == Status.OK)
    assert right.mean() > 0.5
    for name in ("time", "interval", "v"):
        np.testing.assert_allclose(found[name][right], finer[name][right], rtol=1.01 * rtol)


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
