"""Wear of one point of the workpiece against its way in small steps, against the ring's wear, and at its limits."""

import itertools
import math

import numpy as np
import pytest
import wear_oracles as oracles
from columns import solve
from paper_machine import PAPER

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.wear.point import POLISHER_WEAR_POINT

POINT = PAPER | {"r0": 6.0, "theta0": 0.3, "tau": 20.0}
NEAREST = 1e-9 if COMPILED else 1e-4


def wear(rtol=NEAREST, **changed):
    """Wear, its error and status; values of `changed` may be columns."""
    outputs, status = solve(POLISHER_WEAR_POINT, "path", rtol=rtol, **(
        {name: np.atleast_1d(value) for name, value in (POINT | changed).items()}
    ))  # fmt: skip
    return outputs["wear"], outputs["wear_error"], status


def truth(**changed):
    """The same: entries and exits by sampling and bisection, then Gauss between them, in 40 pieces each."""
    p = POINT | changed
    machine = oracles.Machine(**p)

    def place(t):
        return machine.ring(p["r0"], p["theta0"] + p["Omega"] * t)

    def excess(t):
        return machine.excess(p["omega"] * t - p["b_angle"], place(t))

    times = np.linspace(0, p["tau"], 20_001)
    value = excess(times)
    j = np.nonzero((value[1:] > 0) != (value[:-1] > 0))[0]
    cuts = np.concatenate([[0.0], oracles.bisected(excess, times[j], times[j + 1]), [p["tau"]]])
    y, weight = np.polynomial.legendre.leggauss(20)
    total = 0.0
    for low, high in itertools.pairwise(cuts):
        if excess(np.array([0.5 * (low + high)]))[0] < 0:
            edges = np.linspace(low, high, 41)
            t = edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (y + 1)
            rate = machine.arm(p["omega"] * t - p["b_angle"])[1]
            speed = abs(1j * rate * place(t) - 1j * p["Omega"] * (place(t) - machine.centre))
            total += float((speed * weight).sum() * 0.5 * (edges[1] - edges[0]))
    return total


AWKWARD = {
    "round tool": {},
    "type B, rhombus": {"type": 1.0, "b_angle": 0.6, "tool_n": 1.0, "tool_m": 1.0},
    "square, fast workpiece": {"tool_n": 100.0, "tool_m": 100.0, "Omega": 7.0, "tau": 9.0},
    "square, under its corner": {
        "tool_n": 100.0, "tool_m": 100.0, "Omega": 7.0, "tau": 9.0, "r0": 8.783, "theta0": 4.287,
    },
    "astroid": {"tool_n": 0.5, "tool_m": 0.5, "tool_a": 8.0, "tool_b": 8.0, "r0": 4.0},
    "resting workpiece": {"Omega": 0.0, "r0": 2.0},
    "crank backward": {"omega": -1.0},
    "arm that turns": {"b": 10.0, "e": 15.0, "L": 5.0, "w_x": -8.0, "beta": 1.0},
}  # fmt: skip


@pytest.mark.parametrize("name", list(AWKWARD) if COMPILED else ["round tool"])
def test_wear_is_that_of_the_way_within_its_stated_error(name):
    changed = AWKWARD[name] if COMPILED else AWKWARD[name] | {"tau": 1.5, "theta0": -1.0}
    value, error, status = wear(**changed)
    exact = truth(**changed)
    assert status[0] in (Status.OK, Status.DOUBLE_CRANK)
    assert value[0] > 0
    assert abs(value[0] - exact) <= error[0] + 2e-12 * exact
    assert error[0] <= NEAREST * exact


def test_where_workpiece_and_tool_all_but_turn_together_the_stated_error_holds():
    """An arm that turns with its crank but for b/e of it: v = r0 b omega abs(cos(theta)/e + psi' sin(theta))."""
    f, b, count = 1.2, 1e-6, 40 if COMPILED else 1
    e, d = np.linspace(0.8, 1.2, count), np.linspace(0.9, 1.1, count)
    cosine = (e * e + d * d - f * f) / (2 * d * e)
    bent = (1 - (d * d - f * f) / (e * e)) / (2 * d) / np.sqrt(1 - cosine * cosine)
    value, error, _ = wear(
        b=b, d=d, f=f, e=e, omega=1.0, Omega=1.0, w_x=0.0, w_y=0.0, L=2.0, r0=2.0, tool_a=5.0, tau=2 * np.pi,
        theta0=np.zeros(count),
    )  # fmt: skip
    exact = 8.0 * b * np.sqrt(1 / (e * e) + bent * bent)
    assert (abs(value - exact) <= error).all()


@pytest.mark.skipif(not COMPILED, reason="thousands of areas")
def test_under_a_load_a_point_wears_by_the_speed_over_the_area_of_contact():
    """In time steps of 1e-5 of it, as far as they tell; within the rim as under a pressure."""
    changed = {"w_x": 52.0, "w_y": 0.0, "pressure": 0.0, "load": 3.0, "r0": 4.0, "tau": 3.0}
    machine = oracles.Machine(**POINT | changed)
    h = changed["tau"] / 100_000
    t = (np.arange(100_000) + 0.5) * h
    place, theta = machine.ring(4.0, 0.3 + 0.4 * t), t + 0.66
    alpha, rate = machine.arm(theta)
    speed = abs(1j * rate * place - 0.4j * (place - machine.centre))
    area = oracles.lens(5.0, 7.0, abs(50.0 * np.exp(1j * alpha) - machine.centre))
    inside = machine.excess(theta, place) < 0
    expected = 3.0 * np.sum(speed[inside] / area[inside]) * h
    value, error, status = wear(workpiece_radius=7.0, **changed)
    assert status[0] == Status.OK
    assert value[0] == pytest.approx(expected, rel=1e-4)
    assert error[0] <= 1e-9 * value[0]
    inside, _, _ = wear(workpiece_radius=40.0, **changed)
    pressed, _, _ = wear(**(changed | {"load": 0.0, "pressure": 3.0 / (25 * math.pi)}))
    assert inside[0] == pytest.approx(pressed[0], rel=1e-11)
    assert wear(workpiece_radius=3.9, **changed)[0][0] == 0.0


def test_no_time_and_no_touch_wear_nothing():
    value, error, status = wear(tau=[0.0, 20.0, 20.0], r0=[6.0, 40.0, 1e300])
    assert (status == Status.OK).all()
    assert not np.any([value, error])


@pytest.mark.parametrize(
    ("changed", "status"),
    [
        ({"e": 20.0}, Status.LOCK_UP), ({"b": 200.0}, Status.NO_ASSEMBLY), ({"tool_a": 1e-200}, Status.OUT_OF_RANGE),
        ({"tau": 1e12}, Status.STEP_LIMIT),
    ],
)  # fmt: skip
def test_what_has_no_motion_or_takes_too_long_is_refused(changed, status):
    value, _, said = wear(**changed)
    assert said[0] == status
    assert np.isnan(value[0])
