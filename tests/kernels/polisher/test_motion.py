"""Motion of the polisher's arm and tool against 50 digits: by the turn, next to dead points, at a lock."""

import math

import numpy as np
import polisher_oracles as oracles
import pytest
from columns import solve
from mpmath import cos, mp, mpf, sin

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.polisher.motion import POLISHER_MOTION

ANGLES = np.concatenate([np.linspace(-3, 3, 5), [0, np.pi], np.pi - 10.0 ** np.arange(-12, -1, 4), [1e-9, 1e-5, 0.01]])
"""Crank angles over the turn and close to both dead points."""
MACHINES = {
    "usual": (0.6201, 0.38, 0.405, 0.1),
    "small crank": (0.6201, 0.38, 0.405, 1e-11),
    "nearly stretched": (0.6201, 0.38, 0.405, 0.1649 * (1 - 1e-11)),
    "nearly folded": (0.9, 0.5, 1.2, 0.2 * (1 - 1e-10)),
    "short arm": (1.0, 1e-4, 1.00003, 4e-5),
    "short coupler": (1.0, 1.00003, 1e-4, 4e-5),
    "long crank": (1.0, 3.0, 3.5, 2.0),
}
NAN = math.nan


def motion(*lengths, angles=ANGLES, rtol=1e-12, **terms):
    """Traces of one machine, and its status."""
    columns = {"type": 0.0, "omega": 1.0, **terms}
    outputs, status = solve(
        POLISHER_MOTION, "closed", *([float(x)] for x in lengths), rtol=rtol, along=[np.array(angles)], **columns
    )
    return {name: trace[0] for name, trace in outputs.items()}, status[0]


@pytest.mark.parametrize("kind", [0.0, 1.0])
@pytest.mark.parametrize("name", MACHINES)
def test_angle_rate_and_acceleration_have_their_digits_next_to_dead_points_too(name, kind):
    lengths = MACHINES[name]
    traces, status = motion(*lengths, type=kind)
    assert status == (Status.DOUBLE_CRANK if name == "long crank" else Status.OK)
    truth = [oracles.motion(*lengths, -1 if kind else 1, angle) for angle in ANGLES]
    for k, output in enumerate(("alpha", "alpha_rate", "alpha_acceleration")):
        largest = max(abs(t[k]) for t in truth)
        with mp.workdps(50):
            off = [mpf(float(v)) - t[k] for v, t in zip(traces[output], truth, strict=True)]
            if k == 0:
                off = [oracles.middle_turn(x, mpf(0)) for x in off]
        assert max(float(abs(x) / largest) for x in off) < 2e-15, output


@pytest.mark.parametrize("distance", [1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize(("name", "dead"), [("nearly stretched", 0.0), ("nearly folded", np.pi)])
def test_the_acceleration_beside_a_dead_point_has_its_digits_for_itself(name, dead, distance):
    """Not only beside its largest value, which is at the dead point and far larger."""
    traces, _ = motion(*MACHINES[name], angles=[dead - distance])
    truth = oracles.motion(*MACHINES[name], 1, dead - distance)
    assert float(abs(mpf(float(traces["alpha_acceleration"][0])) / truth[2] - 1)) < 1e-14


def test_the_tool_goes_with_the_arm_at_its_distance_and_angle():
    terms = {"omega": -3.0, "b_angle": -0.66, "L": 0.9, "beta": 1.5}
    traces, status = motion(*MACHINES["usual"], type=1.0, **terms)
    assert status == Status.OK
    with mp.workdps(50):
        for j, angle in enumerate(ANGLES):
            turned = mpf(float(angle)) - mpf(terms["b_angle"])
            alpha, rate, acceleration = oracles.motion(*MACHINES["usual"], -1, turned)
            alpha += mpf(terms["b_angle"])
            assert abs(traces["alpha"][j] - alpha) < 1e-15
            assert abs(traces["alpha_rate"][j] + 3 * rate) < 2e-15
            assert abs(traces["alpha_acceleration"][j] - 9 * acceleration) < 2e-14
            assert abs(traces["x"][j] - mpf(0.9) * cos(alpha + mpf(1.5))) < 1e-15
            assert abs(traces["y"][j] - mpf(0.9) * sin(alpha + mpf(1.5))) < 1e-15


def test_without_a_distance_the_tool_is_at_the_end_of_the_arm():
    traces, _ = motion(*MACHINES["usual"], b_angle=0.3)
    b, d, f, e = MACHINES["usual"]
    px, py = b * np.cos(0.3) + e * np.cos(ANGLES), b * np.sin(0.3) + e * np.sin(ANGLES)
    np.testing.assert_allclose(np.hypot(traces["x"], traces["y"]), d, rtol=1e-15)
    np.testing.assert_allclose(np.hypot(px - traces["x"], py - traces["y"]), f, rtol=1e-15)


@pytest.mark.parametrize("kind", [0.0, 1.0])
def test_the_angle_is_continuous_over_many_turns(kind):
    angles = np.linspace(-30, 30, 2001 if COMPILED else 401)
    swinging, _ = motion(*MACHINES["usual"], type=kind, angles=angles)
    turning, status = motion(*MACHINES["long crank"], type=kind, angles=angles)
    for traces in (swinging, turning):
        steps = np.diff(traces["alpha"])
        middle = (traces["alpha_rate"][1:] + traces["alpha_rate"][:-1]) / 2 * np.diff(angles)
        np.testing.assert_allclose(steps, middle, atol=1e-3 if COMPILED else 0.02)
    assert status == Status.DOUBLE_CRANK
    assert turning["alpha"][-1] - turning["alpha"][0] == pytest.approx(60, abs=3)
    assert (swinging["alpha"] * (1 - 2 * kind) > 0).all()
    assert (swinging["alpha"] * (1 - 2 * kind) < np.pi).all()


def test_where_the_crank_cannot_come_there_is_nothing():
    inner, outer = (float(x) for x in oracles.locks(62, 60, 5, 10))
    angles = [0.0, inner - 1e-3, inner + 1e-3, -inner - 1e-3, outer - 1e-3, outer + 1e-3, -np.pi]
    traces, status = motion(62, 60, 5, 10, angles=angles, rtol=1e-11)
    assert status == Status.LOCK_UP
    for trace in traces.values():
        assert np.isfinite(trace).tolist() == [False, False, True, True, True, False, False]
    truth = oracles.motion(62, 60, 5, 10, 1, angles[2])
    assert traces["alpha"][2] == pytest.approx(float(truth[0]), rel=1e-14, abs=0.0)
    assert traces["alpha_rate"][2] == pytest.approx(float(truth[1]), rel=1e-12, abs=0.0)


def test_close_to_a_lock_the_rate_is_inaccurate_and_says_so():
    inner = float(oracles.locks(62, 60, 5, 10)[0])
    for distance in 10.0 ** np.arange(-13, -1):
        angle = inner + distance
        traces, status = motion(62, 60, 5, 10, angles=[angle], rtol=1e-10)
        truth = oracles.motion(62, 60, 5, 10, 1, angle)
        error = float(abs(mpf(float(traces["alpha_acceleration"][0])) / truth[2] - 1))
        assert status == (Status.INACCURATE if distance < 2e-5 else Status.LOCK_UP)
        assert status == Status.INACCURATE or error < 1e-10


@pytest.mark.parametrize(
    ("lengths", "terms", "status"),
    [
        ((1.0, 0.3, 0.3, 0.1), {}, Status.NO_ASSEMBLY), ((1e300, 1e300, 1e300, 1e299), {}, Status.OUT_OF_RANGE),
        (MACHINES["usual"], {"omega": 0.0}, Status.OK),
        (MACHINES["usual"], {"angles": [0.0, 1e300]}, Status.BAD_INPUT),
        (MACHINES["usual"], {"angles": [NAN]}, Status.BAD_INPUT),
    ],
)  # fmt: skip
def test_what_has_no_motion_is_refused_by_name(lengths, terms, status):
    assert motion(*lengths, **terms)[1] == status


@pytest.mark.parametrize(("omega", "missing"), [(1e200, 1), (1e-200, 1), (1e290, 2), (1e-290, 2)])
def test_a_rate_or_an_acceleration_that_no_float64_can_hold_is_left_out_alone(omega, missing):
    names = ("x", "y", "alpha", "alpha_rate", "alpha_acceleration")
    usual, _ = motion(*MACHINES["usual"], omega=1.0)
    found, status = motion(*MACHINES["usual"], omega=omega)
    assert status == Status.PARTLY_OUT_OF_RANGE
    for name in names[:3]:
        assert np.array_equal(found[name], usual[name])
    for name in names[5 - missing :]:
        assert np.isnan(found[name]).all()
    if missing == 1:
        np.testing.assert_allclose(found["alpha_rate"] / omega, usual["alpha_rate"], rtol=1e-15)
