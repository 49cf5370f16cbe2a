"""Wear along the radius against integration over time and arcs, closed forms, its own laws, and at its limits."""

import math

import numpy as np
import pytest
import wear_oracles as oracles
from columns import checked, solve
from paper_machine import PAPER

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.wear.ring import POLISHER_WEAR


def wear(radius, rtol=1e-9, **changed):
    """Wear, its error and the status of one machine, the paper's with changes, at radii."""
    cell = {name: [value] for name, value in (PAPER | changed).items()}
    outputs, status = solve(
        POLISHER_WEAR, "contour", along=[np.atleast_1d(np.asarray(radius, float))], rtol=rtol, **cell
    )
    return outputs["wear"][0], outputs["wear_error"][0], status[0]


def truth(radius, oracle_rtol=1e-12, **changed):
    """The same by the oracle."""
    return oracles.ring_wear(oracles.Machine(**PAPER | changed), radius, oracle_rtol) / (4 * math.pi**2)


AWKWARD = {
    "round tool": (6.0, {}),
    "rhombus": (6.0, {"tool_n": 1.0, "tool_m": 1.0, "tool_b": 8.0}),
    "square, over the centre": (
        2.0, {"w_x": 3.0, "w_y": 2.0, "L": 4.0, "tool_n": 100.0, "tool_m": 100.0}
    ),
    "astroid": (1.7, {"e": 15.0, "tool_n": 0.5, "tool_m": 0.5, "tool_a": 6.0, "tool_b": 7.0, "Omega": -0.4}),
    "resting workpiece": (6.0, {"tool_n": 0.5, "tool_m": 3.3, "L": 10.0, "w_x": 4.0, "Omega": 0.0}),
    "type B, crank backward": (6.0, {"type": 1.0, "omega": -1.0, "e": 15.0, "b_angle": 0.7, "beta": 0.1}),
    "arm that turns": (9.0, {"b": 10.0, "e": 15.0, "L": 5.0, "w_x": -8.0, "beta": 1.0}),
    "slow crank": (0.5, {"Omega": 50.0}),
    "tool that touches the ring's radius": (5.0, {"w_y": 0.0, "b_angle": 0.0, "w_x": 38.0, "L": 38.0, "beta": -0.6}),
}  # fmt: skip
CHEAP = ("round tool", "resting workpiece")


@pytest.mark.parametrize("name", list(AWKWARD) if COMPILED else CHEAP)
def test_wear_is_that_of_time_and_arcs_within_its_stated_error(name):
    """The oracle takes one to five seconds for each."""
    radius, changed = AWKWARD[name]
    rtol = 1e-9 if COMPILED else 1e-6
    value, error, status = wear(radius, rtol, **changed)
    assert status in (Status.OK, Status.DOUBLE_CRANK)
    exact = truth(radius, **changed)
    assert abs(value[0] - exact) <= error[0] + 2e-11 * exact
    assert error[0] <= rtol * exact


LOAD = {"pressure": 0.0, "load": 3.0}
areas = pytest.mark.skipif(not COMPILED, reason="thousands of areas")


def under_a_load(radius, rim, w_x):
    """Wear by that load on the paper's round tool, by 20 000 instants: arcs and areas in closed form."""
    machine = oracles.Machine(**PAPER | {"w_x": w_x})
    theta = (np.arange(20_000) + 0.5) / 20_000 * 2 * math.pi
    far = 50.0 * np.exp(1j * machine.arm(theta)[0]) - machine.centre
    half = np.arccos(np.clip((radius**2 + abs(far) ** 2 - 25.0) / (2 * radius * abs(far)), -1, 1))
    theta, far, half = theta[half > 0], far[half > 0], half[half > 0]
    y, weight = np.polynomial.legendre.leggauss(40)
    speed = machine.speed(theta[:, None], radius, np.angle(far)[:, None] + half[:, None] * y)
    polish = half * (speed * weight).sum(axis=1) / oracles.lens(5.0, rim, abs(far))
    return LOAD["load"] * polish.sum() / 20_000 / (2 * math.pi)


@areas
@pytest.mark.parametrize(("radius", "rim", "w_x"), [(6.0, 8.0, 52.0), (2.0, 8.0, 52.0), (3.0, 6.0, 50.0)])
def test_under_a_load_wear_is_that_of_time_and_arcs_over_the_area_of_contact(radius, rim, w_x):
    """Over the rim, and leaving the workpiece for part of the turn."""
    for rtol in (1e-3, 1e-9):
        value, error, status = wear([radius, 9.0], rtol, **LOAD, w_x=w_x, workpiece_radius=rim)
        assert status == Status.OK
        assert value[0] == pytest.approx(under_a_load(radius, rim, w_x), rel=2e-5 + rtol)
        assert error[0] <= rtol * value[0]
        assert value[1] == 0.0


@areas
def test_a_ring_that_the_loaded_tool_just_touches_is_as_sure_as_under_a_pressure():
    changed = {"w_x": 56.0, "w_y": 0.0, "tool_a": 4.0, "tool_b": 4.0}
    loaded, error, status = wear([2.0, 4.0], 1e-6, **changed, **LOAD, workpiece_radius=10.0)
    pressed, _, _ = wear([2.0, 4.0], **changed)
    assert status == Status.OK
    assert error[0] < 1e-9 * loaded[1]
    assert loaded[0] == pressed[0] == 0.0


@areas
def test_of_a_tool_within_the_rim_load_over_its_area_is_the_pressure():
    for changed, area in (({}, 25 * math.pi), ({"tool_n": 1.0, "tool_m": 1.0, "tool_b": 8.0}, 80.0)):
        pressed, _, _ = wear([2.0, 6.0], pressure=3.0 / area, **changed)
        value, error, status = wear([2.0, 6.0], workpiece_radius=40.0, **LOAD, **changed)
        assert status == Status.OK
        assert value == pytest.approx(pressed, rel=2e-12, abs=0.0)
        assert (error <= 1e-9 * value).all()


@pytest.mark.parametrize(
    "changed",
    [
        {"load": 1.0, "workpiece_radius": 5.0}, {"pressure": 0.0}, {"pressure": 0.0, "load": 1.0},
        {"pressure": 0.0, "load": -1.0, "workpiece_radius": 5.0}, {"workpiece_radius": -1.0},
    ],
)  # fmt: skip
def test_just_one_of_pressure_and_load_is_given_and_with_it_the_rim(changed):
    cells = {name: [float(value)] for name, value in (PAPER | changed).items()}
    assert checked(POLISHER_WEAR, **cells)[0] == Status.BAD_INPUT


def test_under_a_resting_arm_wear_is_the_share_of_the_ring_under_the_tool():
    radius, offset, a, spin = 4.0, 6.0, 5.0, 0.7
    changed = {"d": 40.5, "f": 40.5, "b": 62.01, "e": 0.0, "b_angle": 0.0, "Omega": spin, "tool_a": a, "tool_b": a}
    eta = math.acos(62.01 / 81.0)
    changed |= {"L": 50.0, "w_x": (50.0 - offset) * math.cos(eta), "w_y": (50.0 - offset) * math.sin(eta)}
    half = math.acos((radius**2 + offset**2 - a**2) / (2 * radius * offset))
    value, error, status = wear(radius, **changed)
    assert status == Status.OK
    assert value[0] == pytest.approx(spin * radius * half / math.pi, rel=1e-13, abs=0.0)
    assert abs(value[0] - spin * radius * half / math.pi) <= error[0] + 1e-13


def test_the_centre_of_the_workpiece_wears_by_the_arm_alone_and_beside_it_hardly_otherwise():
    b, d, c = 62.01, 38.0, np.array([50.5, 30.5])
    swing = -0.5 * np.diff(np.arccos((b * b + d * d - c * c) / (2 * b * d)))[0]
    value, error, status = wear(0.0, tool_a=30.0, tool_b=30.0)
    assert status == Status.OK
    assert value[0] == pytest.approx(4 * swing * math.hypot(50.0, 1.0) / (2 * math.pi), rel=1e-13, abs=0.0)
    assert error[0] < 1e-12
    near, _, _ = wear([0.0, 1e-7, 1e-4])
    assert abs(near[1:] / near[0] - 1) == pytest.approx([0.0, 0.0], abs=1e-4)
    assert abs(near[1] / near[0] - 1) < 1e-7


@pytest.mark.skipif(not COMPILED, reason="many machines")
@pytest.mark.parametrize(("load", "cells"), [({}, 30), (LOAD, 12)])
def test_the_stated_error_holds_whatever_is_wanted(load, cells):
    random = np.random.default_rng(4)
    radius = np.sort(random.uniform(0, 12, 6))
    inside = []
    for _ in range(cells):
        changed = {
            "e": random.uniform(0.5, 16.4), "L": random.uniform(42, 56), "w_y": random.uniform(-4, 4),
            "Omega": random.choice([0.0, 0.3, -2.0, 20.0]), "type": float(random.integers(2)),
            "tool_a": random.uniform(1, 8), "tool_b": random.uniform(1, 8),
            "tool_n": random.choice([0.5, 1, 1.5, 2, 4, 100]), "tool_m": random.choice([0.5, 1, 1.5, 2, 4, 100]),
        } | load  # fmt: skip
        changed["b_angle"] = 0.66 if changed["type"] else -0.66
        changed["workpiece_radius"] = random.uniform(12, 20) if load else 0.0
        rough, error, _ = wear(radius, 1e-3, **changed)
        fine, rest, status = wear(radius, 1e-6 if load else 1e-9, **changed)
        assert status in (Status.OK, Status.INACCURATE)
        assert (abs(rough - fine) <= error + rest).all()
        inside.append(status == Status.OK)
    assert np.mean(inside) > 0.7


@pytest.mark.parametrize(
    ("changed", "status"),
    [
        ({"b": 62.0, "d": 60.0, "f": 5.0, "e": 10.0}, Status.LOCK_UP),
        ({"e": 20.0}, Status.LOCK_UP),
        ({"b": 200.0}, Status.NO_ASSEMBLY),
        ({"b": 10.0, "e": 15.0}, Status.DOUBLE_CRANK),
        ({"b": 62.0, "d": 38.0, "f": 40.0, "e": 16.0}, Status.CHANGE_POINT),
        ({"preston": 1e-300, "pressure": 1e-300}, Status.OUT_OF_RANGE),
        ({"tool_a": 1e-200}, Status.OUT_OF_RANGE),
        ({"e": 1e-300}, Status.OUT_OF_RANGE),
    ],
)
def test_what_is_no_ordinary_machine_is_said_by_name(changed, status):
    value, error, said = wear([1.0, 6.0], 1e-6, **changed)
    assert said == status
    if status in (Status.DOUBLE_CRANK, Status.CHANGE_POINT):
        assert (error <= 1e-6 * value).all()
    elif status == Status.LOCK_UP:
        assert np.isnan([value, error]).all()


def test_wear_too_faint_for_a_float64_at_one_radius_is_left_out_there_alone():
    radius = np.array([1.0, 6.0])
    here, _, _ = wear(radius, 1e-6)
    scale = 2.0 ** np.round(np.log2(2.3e-308 / here.min()) - 0.5)
    faint = here * scale < 2.3e-308
    assert faint.sum() == 1
    value, error, status = wear(radius, 1e-6, preston=PAPER["preston"] * 2.0**-500, pressure=2.0**500 * scale)
    assert status == Status.PARTLY_OUT_OF_RANGE
    assert np.isnan(value).tolist() == np.isnan(error).tolist() == faint.tolist()
    assert value[~faint] == pytest.approx(here[~faint] * scale, rel=1e-12, abs=0.0)


def test_more_than_the_digits_allow_is_inaccurate():
    value, error, status = wear([2.0, 6.0], 1e-15)
    assert status == Status.INACCURATE
    assert (error > 1e-15 * value).any()


def test_radii_that_are_never_touched_do_not_wear():
    value, error, status = wear([20.0, 1e3, 1e300])
    assert status == Status.OK
    assert not np.any([value, error])


@pytest.mark.parametrize("shape", [0.5, 1.0, 2.0])
def test_a_ring_that_just_touches_the_tool_does_not_wear(shape):
    """Vertex and ring meet at (54, 0) from the pivot, once a stroke: rounding is not to count as contact."""
    changed = {"L": 0.5, "tool_a": 0.04, "tool_b": 0.04, "tool_n": shape, "tool_m": shape, "w_x": 0.59, "w_y": 0.0}
    value, error, _ = wear([0.05, 0.06], 1e-6, **changed)
    assert abs(value[0]) <= 1e-9 * value[1] + error[0]
    assert error[0] <= 1e-6 * value[1]
