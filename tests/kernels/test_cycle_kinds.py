"""Cycles of scenes that are driven, that have several surfaces, or that are continued, against closed forms."""

import numpy as np
import pytest
from columns import checked, estimated, solve
from forced_scene import FORCED, MOVING, POPULATION, PUSHED, RESTING, STOPPED, TABLE, THROWN, WALLS
from kicked_scene import BRANCHED, KICKED
from mpmath import mp, mpc, mpf
from scene_oracles import one_impact_a_period

from kernels.cycle import cycle_kernel
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, SceneError, exp

pytestmark = pytest.mark.skipif(not COMPILED, reason="a cycle takes minutes as plain Python")
RANKS = [np.array([1.0, 2.0])]
NO_SIZES = "period", "x", "v", "u", "mode", "multiplier", "multipliers_real", "multipliers_imaginary"
"""Outputs for which nothing more is compiled."""


def test_a_driven_oscillator_has_the_cycle_and_both_multipliers_of_the_closed_form():
    cells = {"zeta": np.array([0.05, 0.3, 1.0e-3, 2.0]), "omega": np.array([1.0, 3.0, 1.0, 1.0]), "w": 1.3, "a": 0.7}
    ranks = [np.array([1.0, 2.0, 3.0])]
    found, status, error = estimated(FORCED, "taylor", along=ranks, flips=1.0, **cells)
    assert (status[:3] == Status.OK).all()
    for cell, (zeta, omega) in enumerate(zip(cells["zeta"], cells["omega"], strict=True)):
        with mp.workdps(40):
            zeta, omega, w = mpf(zeta), mpf(omega), mpf(1.3)
            swing = mpf(0.7) / mpc(omega**2 - w**2, 2 * zeta * omega * w)
            root = mp.sqrt(mpc(zeta**2 - 1))
            powers = [mp.exp(omega * (-zeta + s * root) * 2 * mp.pi / w) for s in (1, -1)]
            powers.sort(key=lambda one: -abs(one))
            true = {"period": 2 * mp.pi / w, "x": swing.real, "v": -w * swing.imag, "x_size": abs(swing)}
            true |= {"v_size": w * abs(swing), "period_by_w": -1, "period_by_omega": 0}
            parts = [[float(p.real) for p in powers] + [0.0], [float(abs(p.imag)) for p in powers] + [0.0]]
        for name, value in true.items():
            assert found[name][cell] == pytest.approx(float(value), rel=1e-9, abs=1e-9), name
        for name, part in zip(("multipliers_real", "multipliers_imaginary"), parts, strict=True):
            assert abs(found[name][cell] - part).max() <= max(1e-9, error[cell]), name
    second, _ = solve(FORCED, "taylor", along=[RANKS[0][1:]], flips=1.0, **cells)
    assert (second["multipliers_real"][:, 0] == found["multipliers_real"][:, 1]).all()


@pytest.mark.parametrize("method", ["taylor", "rodas5p"])
def test_a_cycle_far_smaller_than_the_motion_that_it_is_searched_from_is_known_by_its_own_size(method):
    """Up to 1e11 times smaller; where it was taken by the size of that motion, it was OK and 2 rtol off."""
    x0, zeta, w = 10.0 ** np.arange(12), 1e-3, 1.3
    cells = {"zeta": zeta, "w": w, "e": 0.5, "stop": 1e13, "x0": x0, "v0": 0.0, "flips": 1.0, "rtol": 1e-9}
    found, status, error = estimated(STOPPED, method, **cells, along=[RANKS[0][:0]], asked=("period", "x", "v"))
    swing = 1.0 / (1.0 - w * w + 2j * zeta * w)
    off = np.maximum(abs(found["x"] - swing.real), abs(found["v"] + w * swing.imag) / w) / abs(swing)
    assert (status == Status.OK).all()
    assert (off <= error).all()


def test_states_are_said_to_be_given_where_the_cycle_ends():
    ends = [next(f.doc for f in kernel.outputs if f.name == "x") for kernel in (FORCED, WALLS)]
    assert [doc.split(", ", 1)[1] for doc in ends] == [
        "at the end of a period of the drive",
        "just before the switch that ends a cycle",
    ]


def test_cells_of_several_multipliers_where_none_has_a_cycle_or_none_is_asked_for():
    """At resonance without losses; and a study of the period alone, which gives no numbers of multipliers."""
    resonant = {"zeta": 0.0, "omega": [1.3, 1.3, 1.3], "w": 1.3}
    found, status = solve(FORCED, "taylor", along=RANKS, **resonant)
    assert (status == Status.NOT_CONVERGED).all()
    assert np.isnan(found["multipliers_real"]).all()
    assert found["multipliers_real"].shape == (3, 2)
    found, status = solve(FORCED, "taylor", along=[np.empty(0)], zeta=[0.05, 0.3, 2.0], asked=("period",))
    assert (status == Status.OK).all()
    assert abs(found["period"] * 1.3 / (2.0 * np.pi) - 1.0).max() < 1e-12
    assert solve(FORCED, "taylor", along=[np.empty(0)], zeta=[0.05])[1][0] == Status.BAD_INPUT


def test_a_cycle_without_losses_is_one_though_its_multipliers_have_modulus_1():
    omega, w = np.array([1.0, 3.0]), 1.3
    found, status = solve(
        FORCED, "taylor", along=RANKS, zeta=0.0, omega=omega, w=w, a=0.7, flips=1.0, settle=0.0, rtol=1e-7
    )
    assert (status == Status.OK).all()
    assert abs(found["x"] - 0.7 / (omega**2 - w**2)).max() < 1e-8
    assert abs(found["multiplier"] - 1.0).max() < 1e-8
    assert abs(found["multipliers_real"][:, 0] - np.cos(2.0 * np.pi * omega / w)).max() < 1e-8


def test_a_ball_on_a_table_is_in_step_with_it():
    """It lands once a period where A w cos(phase) (1 + e) = (1 - e) g P/2; its two multipliers have the product e^2."""
    e, w, A, g = np.array([0.5, 0.8, 0.5]), 10.0, np.array([0.11, 0.036, 0.16]), 9.81
    half = 0.5 * g * 2.0 * np.pi / w
    phase = np.arccos((1.0 - e) / (1.0 + e) * half / (A * w))
    left = (2.0 * np.pi - phase) / w  # of a flight that begins at the phase, until the table's period is over
    true = A * np.sin(phase) + half * left - 0.5 * g * left**2, half - g * left
    found, status = solve(
        TABLE, "taylor", along=RANKS, A=A, w=w, e=e, x0=true[0], v0=true[1], flips=1.0, settle=0.0, asked=NO_SIZES
    )
    assert list(status) == [Status.OK, Status.OK, Status.UNSTABLE]
    assert abs(found["x"] - true[0]).max() < 1e-9
    assert abs(found["v"] - true[1]).max() < 1e-9
    trace = (1.0 + e) ** 2 * (1.0 - A * w**2 * np.sin(phase) / g) - 2.0 * e
    real, imaginary = found["multipliers_real"], found["multipliers_imaginary"]
    assert abs(real.sum(axis=1) - trace).max() < 1e-8
    product = np.where(imaginary[:, 0] > 1e-6, (real**2 + imaginary**2)[:, 0], real.prod(axis=1))
    assert abs(product - e**2).max() < 1e-8


def test_multipliers_of_an_oscillator_that_just_touches_a_stop():
    """The map has a corner as near as the square of the speed; what it multiplies has mostly died out meanwhile."""
    w, speed = (np.ravel(x) for x in np.meshgrid([0.36, 0.44, 0.6], 10.0 ** -np.arange(2.0, 6.0, 0.5)))
    true = np.array([one_impact_a_period(0.957, one, 0.594, u) for one, u in zip(w, speed, strict=True)], float).T
    cells = {"zeta": 0.957, "w": w, "e": 0.594, "stop": true[0], "x0": true[1], "v0": true[2], "settle": 0.0}
    found, status, error = estimated(
        STOPPED, "taylor", **cells, flips=1.0, along=RANKS, rtol=4e-6, asked=("x", "v", "multiplier")
    )
    off = abs(found["multiplier"] - true[5]) / np.maximum(1.0, abs(true[5]))
    for k, name in enumerate(("x", "v"), 1):
        off = np.maximum(off, abs(found[name] - true[k]) / true[k + 2])
    assert (status[:3] == Status.OK).all()
    assert (off <= error)[status <= Status.INACCURATE].all()


def test_a_cycle_of_two_periods_is_found_where_one_of_a_single_period_is_not():
    """The oscillator meets its stop in every second period; no cycle that meets it in each is near."""
    w, speed = (np.ravel(x) for x in np.meshgrid([3.5, 4.3], [0.35, 0.4]))
    zeta, e = np.where(w < 4.0, 0.3, 0.2), np.where(w < 4.0, 0.4, 0.316)
    true = np.array([one_impact_a_period(*cell, 2) for cell in zip(zeta, w, e, speed, strict=True)], float).T
    cells = {"zeta": zeta, "w": w, "e": e, "stop": true[0], "x0": -0.2, "v0": 0.0}
    asked = "period", "x", "v", "multiplier"
    found, status = solve(STOPPED, "taylor", **cells, along=RANKS, rtol=1e-8, flips=1.0, asked=asked)
    both, verdict = solve(STOPPED, "taylor", **cells, along=RANKS, rtol=1e-8, flips=2.0, asked=asked)
    assert list(zip(status, verdict, strict=True)) == [(Status.PERIOD_2, Status.OK)] * 4
    for one in (found, both):
        assert abs(one["period"] * w / (4.0 * np.pi) - 1.0).max() < 1e-12
        assert abs(one["multiplier"] - true[5]).max() < 1e-8
    assert abs(found["x"] - both["x"]).max() < 1e-8


def test_a_swing_that_a_cycle_has_not_got_is_not_known_from_it_to_its_own_digits():
    """Of a slowly driven oscillator, runs take steps too long for its own motion, of which the cycle has nothing."""
    zeta, omega = (np.ravel(x) for x in np.meshgrid([0.02, 0.05, 0.1], np.linspace(3.0, 9.0, 30)))
    found, status, error = estimated(
        FORCED, "taylor", zeta=zeta, omega=omega, a=0.7, flips=1.0, along=RANKS, rtol=3e-11, asked=("multiplier",)
    )
    assert (status <= Status.INACCURATE).all()
    assert (abs(found["multiplier"] - np.exp(-2.0 * np.pi / 1.3 * zeta * omega)) <= error).all()


def test_what_meets_no_switch_any_more_rests_where_it_stays():
    """Creeping to 0; and by dry friction at (1 - 8 mu), when its half swings, each shorter by 2 mu, have come to mu."""
    found, status = solve(RESTING, "taylor", zeta=[1.5, 0.0, 0.05], mu=[0.0, 0.13, 0.0])
    assert (status == Status.COMES_TO_REST).all()
    assert abs(found["x"] - [0.0, 1.0 - 8.0 * 0.13, 0.0]).max() < 1e-11
    assert abs(found["v"]).max() < 1e-11
    assert np.isnan(found["period"]).all()


def test_what_winds_round_an_equilibrium_rests_there():
    """Where exp(-x) = b x + 1 - b: at Omega, of Omega exp(Omega) = 1, or at 0. A cycle is counted where it turns.

    A state that no rate changes stays as it is.
    """
    winding = cycle_kernel(
        name="winding",
        doc="oscillator about a place that is not 0, or is",
        states=(*MOVING, Field("m", "1", "mode")),
        parameters=(Field("zeta", "1", "damping"), Field("b", "1", "stiffness of a spring")),
        rates=lambda x, v, m, zeta, b: (v, exp(-x) - (b * x + (1.0 - b)) - 2.0 * zeta * v, 0.0),
        surface=lambda v, side: side * v,
        switch=lambda x, v, m: (x, v, m),
        start=lambda: (2.0, 0.0, 1.0),
    )
    b = np.array([1.0, 1.0, 1.0, 0.0, 0.0])
    found, status = solve(winding, "taylor", along=RANKS, zeta=[0.3, 0.04, 0.003, 0.3, 0.01], b=b)
    assert (status == Status.COMES_TO_REST).all()
    assert abs(found["x"] - 0.5671432904097838 * b).max() < 1e-11
    assert abs(found["v"]).max() < 1e-11


ROUND = cycle_kernel(
    name="round",
    doc="r' = r (size - r^2) at the speed 1 + r^2",
    states=(Field("x", "1", "x"), Field("y", "1", "y")),
    parameters=(
        Field("size", "1", "its square"),
        Field("x0", "1", "at the start", 1.5),
        Field("lift", "1", "of y", 0.0),
        Field("level", "1", "at which a cycle ends", 0.0),
    ),
    rates=lambda x, y, size: (
        x * (size - x * x - y * y) - y * (1.0 + x * x + y * y),
        y * (size - x * x - y * y) + x * (1.0 + x * x + y * y),
    ),
    surface=lambda y, lift, level: y + lift - level,
    start=lambda x0: (x0, 0.0),
)


def test_a_round_cycle_begins_where_the_surface_is_met_without_curvature():
    """A run begins where the second derivative of y is rounding alone."""
    size = np.array([0.3, 0.7, 1.3, 1.9])
    found, status = solve(ROUND, "taylor", size)
    assert (status == Status.OK).all()
    true = {"period": 2.0 * np.pi / (1.0 + size), "x": -np.sqrt(size), "x_size": np.sqrt(size), "y_size": np.sqrt(size)}
    true |= {"multiplier": np.exp(-2.0 * size * true["period"]), "period_by_size": -size / (1.0 + size)}
    for name, value in true.items():
        assert abs(found[name] - value).max() < 1e-9, name


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_run_begins_on_a_level_that_rounding_puts_it_beside(method):
    y = np.array([-0.95, -0.7, -0.3, 0.1, 0.37, 0.6, 0.9])
    found, status = solve(ROUND, method, 1.0, lift=1.0, level=1.0 + y, rtol=1e-8, asked=("period", "x"))
    assert (status == Status.OK).all()
    assert abs(found["period"] / np.pi - 1.0).max() < 1e-8
    assert abs(found["x"] + np.sqrt(1.0 - y * y)).max() < 1e-8


def test_a_point_of_rest_to_which_newtons_steps_lead_is_no_cycle():
    """From within a small cycle, which motions come to in some 1/size turns."""
    size, share = np.array([1e-6, 2e-7, 1.2e-7, 8.6e-7]), np.array([0.39, 0.35, 0.32, 0.5])
    cells = {"size": size, "x0": share * np.sqrt(size), "rtol": 1e-8, "asked": ("period", "x")}
    found, status, error = estimated(ROUND, "taylor", **cells)
    off = abs(found["x"] / np.sqrt(size) + 1.0)
    assert ((status >= FIRST_REFUSAL) | (off <= error)).all()


def test_a_mode_of_three_values_and_three_surfaces():
    kick, e, length, left = np.array([1.0, 2.0]), np.array([0.5, 0.8]), 2.0, np.array([0.0, -0.7])
    cells = {"kick": kick, "e": e, "length": length, "left": left, "flips": 1.0}
    found, status = solve(WALLS, "taylor", along=RANKS, **cells, asked=(*NO_SIZES, "period_by_kick"))
    assert (status == Status.OK).all()
    assert abs(found["x"] - left).max() < 1e-12
    slow = e * kick / (1.0 - e * e)
    assert abs(found["period"] / (length / (kick + e * slow) + length / slow * (1 / 4 + 1 / 6)) - 1.0).max() < 1e-9
    assert abs(found["v"] + slow).max() < 1e-9
    assert list(found["mode"]) == [3.0, 3.0]
    assert abs(found["multipliers_real"] - np.transpose([e * e, 0.0 * e])).max() < 1e-9
    assert abs(found["period_by_kick"] + 1.0).max() < 1e-9


def test_an_unstable_cycle_is_continued_from_where_it_is_stable():
    gain = np.array([2.8, 3.2, 3.8, 2.0])
    found, status = solve(BRANCHED["gain"], "taylor", gain=gain, bend=1.0, gain_from=2.8, rtol=1e-8)
    assert list(status) == [Status.OK, Status.UNSTABLE, Status.UNSTABLE, Status.OK]
    assert abs(abs(found["v"]) - (1.0 - 1.0 / gain)).max() < 1e-9
    assert abs(found["multiplier"] - (2.0 - gain) ** 2).max() < 1e-8
    alone, _ = solve(BRANCHED["gain"], "taylor", gain=gain[2:3], bend=1.0, gain_from=2.8, rtol=1e-8)
    for name, column in alone.items():
        assert column[0] == found[name][2], name


def test_a_branch_ends_where_two_cycles_meet():
    """u = kick + 2 u (1 - u) has a root down to kick = -1/8."""
    kick = np.array([-0.12, -0.1249, -0.13])
    cells = {"kick": kick, "kick_from": 0.0, "gain": 2.0, "bend": 1.0}
    found, status = solve(BRANCHED["kick"], "taylor", **cells, asked=("v", "period", "multiplier"), rtol=1e-8)
    assert list(status) == [Status.OK, Status.OK, Status.NO_CYCLE]
    u = 0.25 + np.sqrt(1.0 / 16.0 + kick[:2] / 2.0)
    assert abs(abs(found["v"][:2]) - u).max() < 1e-9
    assert abs(found["multiplier"][:2] - (2.0 - 4.0 * u) ** 2).max() < 1e-6


def test_a_doubled_cycle_is_not_followed_onto_the_one_that_it_ends_on():
    """Of u -> gain u (1 - u), the orbit of two ends at gain = 3."""
    gain = np.array([3.3, 3.01, 2.99, 2.9])
    found, status = solve(POPULATION, "taylor", gain=gain, gain_from=3.3, flips=1.0, asked=NO_SIZES, rtol=1e-8)
    assert list(status) == [Status.PERIOD_2, Status.PERIOD_2, Status.NO_CYCLE, Status.NO_CYCLE]
    apart = np.sqrt((gain[:2] + 1.0) * (gain[:2] - 3.0)) / (2.0 * gain[:2])
    assert abs(abs(found["u"][:2] - (gain[:2] + 1.0) / (2.0 * gain[:2])) - apart).max() < 1e-8
    assert abs(found["multiplier"][:2] - (4.0 + 2.0 * gain[:2] - gain[:2] ** 2)).max() < 1e-7


def test_a_cycle_that_is_about_to_double_is_not_called_two():
    """The map's multiplier at 1 - 1/gain is 2 - gain; motions come to it hardly at all."""
    gain = 3.0 - np.array([4e-6, 4e-7, 1e-8])
    found, status = solve(POPULATION, "taylor", gain=gain, flips=1.0, asked=("period", "u", "multiplier"))
    assert (status == Status.OK).all()
    assert abs(found["period"] - 1.0).max() < 1e-12
    assert abs(found["multiplier"] - (2.0 - gain)).max() < 1e-9


def test_a_jump_that_is_not_defined_at_speed_0_begins_like_any_other():
    """A ball that loses 0.5 J/kg as it lands, and is thrown up again by 2 m/s: v = 2 + e sqrt(v^2 - 1)."""
    e = np.array([0.5, 0.3])
    found, status = solve(THROWN, "taylor", e=e, flips=1.0, asked=("period", "v"))
    assert (status == Status.OK).all()
    up = (2.0 + e * np.sqrt(4.0 + e * e - 1.0)) / (1.0 - e * e)
    assert abs(found["v"] + up).max() < 1e-9
    assert abs(found["period"] - 2.0 * up / 9.81).max() < 1e-9


@pytest.mark.parametrize(("first", "before"), [("middle", 0.0), ("section", 0.25)])
def test_a_cycle_ends_where_the_motion_passes_through_a_surface_with_a_jump_and_without(first, before):
    """From each way of a length the speed loses a tenth of that; with less of a push the body stops at 1/16.

    How large it is, and where it rests, for which more is compiled, is looked at from the section alone.
    """
    push, e, asked = np.array([2.0, 3.0, 0.5]), 0.5, ("period", "v", "x_size", "multiplier")
    if first == "middle":
        push, asked = push[:2], ("period", "v", "multiplier")
    found, status = solve(PUSHED[first], "taylor", push=push, e=e, asked=asked)
    assert list(status) == [Status.OK, Status.OK, Status.COMES_TO_REST][: push.size]
    arrives = (e * e * (push[:2] - 0.1) - 0.2 * e - 0.1) / (1.0 - e * e)
    speed, period = arrives + push[:2], 0.0
    for length in (1.0, 2.0, 1.0):
        period = period + 10.0 * np.log(speed / (speed - 0.1 * length))
        speed = e * (speed - 0.1 * length)
    assert abs(found["period"][:2] / period - 1.0).max() < 1e-9
    assert abs(found["v"][:2] + arrives + 0.1 * before).max() < 1e-9
    assert abs(found["multiplier"][:2] - e * e).max() < 1e-9
    if first == "section":
        assert abs(found["x_size"][:2] - 1.0).max() < 1e-9
        assert abs(found["x"][2] - 0.0625) < 1e-11


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"rates": lambda x, v, t: (v, -x * t)}, "drive"),
        ({"rates": lambda x, v, t, side: (v, side - x * t), "surface": None, "drive": 1.0}, "side"),
        ({"surface": None}, "surface"), ({"surface": lambda x, v, side: side * (x + v)}, "surface"),
        ({"branch": "gain"}, "gain"), ({"turns": {"x": 1.0}}, "turn"),
        ({"turns": {"y": 1.0}}, "turns .* 'y'; there are x, v"), ({"turns": {"v": 0.0}}, "above 0"),
    ],
)  # fmt: skip
def test_what_cannot_be_a_cycle_is_refused(changed, said):
    scene = {
        "name": "wrong", "doc": "", "states": MOVING, "parameters": (), "start": lambda: (1.0, 0.0),
        "rates": lambda x, v: (v, -x), "surface": lambda x, side: side * x,
    }  # fmt: skip
    with pytest.raises(SceneError, match=said):
        cycle_kernel(**scene | changed)
    assert checked(KICKED, zeta=[0.1], flips=[3.0])[0] == Status.BAD_INPUT  # half of the sides


def test_a_branch_ends_where_it_meets_another_one_and_is_followed_where_others_fork_off():
    """u -> gain u - u^3: two cycles +-sqrt(gain - 1) fork off from u = 0 at gain = 1, and double at gain = 2."""
    gain, begin = np.array([1.2, 1.001, 0.999, 0.8, 1.4, 0.9]), np.array([1.5, 1.5, 1.5, 1.5, 0.5, 0.5])
    cells = {"gain": gain, "gain_from": begin, "u0": np.where(begin > 1.0, 0.7, 0.0), "bend": 0.0, "cube": 1.0}
    found, status = solve(POPULATION, "taylor", **cells, flips=1.0, asked=("period", "multiplier"), rtol=1e-7)
    assert list(status) == [Status.OK, Status.OK, Status.NO_CYCLE, Status.NO_CYCLE, Status.UNSTABLE, Status.OK]
    assert abs(found["u"][[0, 1, 4, 5]] - [np.sqrt(0.2), np.sqrt(0.001), 0.0, 0.0]).max() < 1e-7
    assert abs(found["multiplier"][[0, 1, 4, 5]] - [0.6, 0.998, 1.4, 0.9]).max() < 1e-7
