"""Motion along a kink onto which both sides press it: when it begins and ends, against closed forms to 50 digits."""

import belt_scene
import numpy as np
import pytest
from columns import relative_error, solve
from mpmath import mp, mpf
from sliding_scene import SLIDING

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, maximum, scene_kernel, sign, where
from kernels.trajectory import section_kernel

METHODS = ["taylor", "dop853", "rodas5p"]
"""What keeps a step on the kink is the same for dopri5 as for dop853."""
MANY = 24
pytestmark = pytest.mark.skipif(not COMPILED, reason="many steps")


def belt_cycle(mu, belt, c):
    """Period of x'' = -x - c x' - mu sign(x' - belt), c < 0: it slips from where the belt can no longer hold it."""
    rest = mp.sqrt(1 - c * c / 4)

    def over_belt(t):
        return mp.exp(-c * t / 2) * (mp.cos(rest * t) + c / (2 * rest) * mp.sin(rest * t)) - 1

    t = mp.findroot(over_belt, (mpf("3.5"), 2 * mp.pi), solver="anderson")
    away = mp.exp(-c * t / 2) * (-c * mp.cos(rest * t) + (1 - c * c / 2) / rest * mp.sin(rest * t))
    return t + (-c - away)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rtol", [1e-5, 1e-9, 1e-12])
def test_stick_and_slip_on_a_belt_keep_their_period_for_many_cycles(method, rtol):
    random = np.random.default_rng(1)
    mu, share = 10.0 ** random.uniform(-1, 1, MANY), random.uniform(0.05, 0.4, MANY)
    belt, c = share * mu, -random.uniform(0.02, 0.4, MANY)
    cycles = 12
    cells = {"press": mu, "belt": belt, "drag": c, "speed0": belt, "stiffness": 1.0, "mid": mu, "wall": -1e9}
    outputs, status = solve(SLIDING, method, **cells, flips=2.0 * cycles + 1, rtol=rtol)
    with mp.workdps(50):
        truths = [mpf(m) / b + cycles * belt_cycle(m, b, mpf(d)) for m, b, d in zip(mu, belt, c, strict=True)]
    assert np.isin(status, (Status.OK, Status.INACCURATE)).all()
    assert (status == Status.OK).mean() > (0.9 if rtol > 1e-12 else 0.5)
    right = status == Status.OK
    assert (relative_error(outputs["time"], truths)[right] < rtol).all()
    assert (abs(outputs["speed"] - belt)[right] <= rtol * belt[right]).all()  # it slides where it is switched


@pytest.mark.parametrize("method", METHODS)
def test_a_section_goes_on_behind_what_the_belt_carries(method):
    belt, switches = np.array([0.05, 0.2, 0.4]), np.array([1.0, 3.0, 11.0])
    found, status = solve(section_kernel(**belt_scene.SCENE), method, belt=belt, along=[switches])
    with mp.workdps(50):
        truths = [[1 / mpf(b) + (k - 1) / 2 * belt_cycle(1, mpf(b), mpf(-0.1)) for k in switches] for b in belt]
    assert (status == Status.OK).all()
    assert abs(found["time"] / np.array(truths, float) - 1.0).max() < 1e-9
    assert abs(found["speed"] / belt[:, None] - 1.0).max() < 1e-9


def relay_time(m, mid):
    """Of w' = sin(t) - m sign(w), x' = 1 + w, from rest: when x is `mid`, on its second way with w below 0."""
    t1 = mp.asin(m)

    def extra(t):
        return mp.cos(t1) * (t - t1) - (mp.sin(t) - mp.sin(t1)) - m * (t - t1) ** 2 / 2

    t2 = mp.findroot(lambda t: mp.cos(t1) - mp.cos(t) - m * (t - t1), (mp.pi / 2 + 0.5, mp.pi), solver="anderson")
    assert abs(mp.sin(t2)) < m, "it slides again"
    t = mp.findroot(lambda t: t + extra(t2) - extra(t - mp.pi) - mid, mid - extra(t2) / 2)
    assert mp.pi + t1 < t < mp.pi + t2
    return t


def swaying(mu, belt, sway, wave):
    """A mass on a belt of the speed belt + sway sin(wave t): when it slips off, and when it is at mu + 0.25 then."""

    def rides(t):
        return belt * t + sway * (1 - mp.cos(wave * t)) / wave

    def force(t):
        return mu - rides(t) - sway * wave * mp.cos(wave * t)

    t = mp.findroot(force, (mpf("0.2") * mu / belt, mu / belt), solver="anderson")
    x, v = rides(t) - mu, belt + sway * mp.sin(wave * t)
    assert x < 0.25, "it slips before it is met"
    return t + mp.findroot(lambda s: x * mp.cos(s) + v * mp.sin(s) - mpf(0.25), (0, mp.pi / 2), solver="anderson")


def decayed(press, slope):
    """When a place drawn to 0 from -1 along its kink, which it meets first, has come to -0.01."""
    met = (mp.sqrt(1 + 2 * slope**2 / press) - 1) / slope
    return met + mp.log((1 - press * met**2 / 2) / mpf(0.01)) / slope


SLOW, SHORT = np.geomspace(1e-4, 0.02, 24), np.linspace(0.3, 0.5, 40)
MU, BELT, SWAY, WAVE = np.array([[2.0, 1.0, 0.3, 0.7], [1.0, 0.5, 0.1, 1.3], [3.0, 1.5, 0.5, 0.4]]).T
CASES = {
    "a slow belt lets go of a mass that short steps follow": (
        {"press": 1.0, "belt": SLOW, "drag": -0.1, "speed0": SLOW, "stiffness": 1.0, "mid": 1.0, "flips": 17.0},
        ["belt"], lambda belt: 1 / belt + 8 * belt_cycle(1, belt, mpf(-0.1)), [1e-9],
    ),
    "a relay is held until its drive is stronger": (
        {"press": np.array([0.9, 0.85, 0.8]), "drive": 1.0, "belt": 1.0, "speed0": 1.0, "mid": 5.0},
        ["press"], lambda press: relay_time(press, mpf(5)), [1e-4, 1e-10],
    ),
    "a belt whose speed varies takes the mass along": (
        {"press": MU, "belt": BELT, "sway": SWAY, "wave": WAVE, "stiffness": 1.0, "speed0": BELT, "mid": MU,
         "level": 0.25}, ["press", "belt", "sway", "wave"], swaying, [1e-4, 1e-7, 1e-11],
    ),
    "a sliding mode decays by its surface": (
        {"press": np.array([1.0, 3.0, 0.7]), "slope": np.array([0.5, 1.2, 0.4]), "place0": -1.0, "mid": -0.01},
        ["press", "slope"], decayed, [1e-4, 1e-8, 1e-12],
    ),
    "a slide goes on across another kink": (
        {"press": 2.0, "belt": 1.0, "speed0": 1.0, "hold": [0.25], "wall": 0.5, "mid": 1.0, "stiffness": 1.0},
        ["hold"], lambda hold: 1 / (2 * (1 + hold)) + 1 / (2 * (1 - hold)), [1e-12],
    ),
    "a slide shorter than a first step behind the kink is seen": (
        {"press": 1.0, "belt": SHORT, "stiffness": 1.0, "place0": 0.99, "speed0": SHORT, "mid": 1.1},
        ["belt"], lambda belt: (1 - mpf(0.99)) / belt + mp.asin(mpf(1.1 - 1.0) / belt), [1e-4],
    ),
}  # fmt: skip
"""Cells, the parameters that their truth is a function of, that time, and tolerances."""


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("name", "rtol"), [(name, rtol) for name, case in CASES.items() for rtol in case[3]])
def test_what_slides_comes_where_the_closed_form_says(name, rtol, method):
    cells, names, time, _ = CASES[name]
    outputs, status = solve(SLIDING, method, **{"wall": -1e9, "flips": 1.0} | cells, rtol=rtol)
    with mp.workdps(50):
        truths = [time(*map(mpf, map(float, cell))) for cell in zip(*(cells[n] for n in names), strict=True)]
    assert (status == Status.OK).all()
    assert (relative_error(outputs["time"], truths) < rtol).all()
    if "slope" in cells:
        assert (relative_error(outputs["speed"], 0.01 * cells["slope"]) < rtol + 1e-15).all()


@pytest.mark.parametrize("method", METHODS)
def test_what_slides_stays_on_its_kink_to_rounding_at_a_wide_tolerance(method):
    """A mass on a belt of varying speed has the belt's speed, which is not linear in the states."""
    cells = {"press": 9.0, "belt": 1.0, "sway": 0.5, "wave": 3.0, "stiffness": 1.0, "speed0": 1.0, "mid": [3.0, 6.0]}
    outputs, status = solve(SLIDING, method, **cells, wall=-1e9, flips=1.0, rtol=1e-4)
    with mp.workdps(50):
        truths = [mp.findroot(lambda t, x=x: t + (1 - mp.cos(3 * t)) / 6 - x, x) for x in (3, 6)]
    assert (status == Status.OK).all()
    assert (relative_error(outputs["time"], truths) < 1e-4).all()
    assert (abs(outputs["speed"] - 1.0 - 0.5 * np.sin(3.0 * outputs["clock"])) < 1e-14).all()


@pytest.mark.parametrize("method", METHODS)
def test_what_rests_for_ever_or_is_held_by_two_kinks_sticks(method):
    rests = {"press": 1.0, "stiffness": 1.0, "place0": 0.5, "mid": 2.0}
    decays = {"press": 1.0, "slope": 1.0, "place0": -0.5, "mid": 1.0}
    two = {"press": 2.0, "hold": 2.0, "belt": 1.0, "speed0": 1.0, "wall": [0.5], "mid": 1.0, "stiffness": 1.0}
    for cell in (rests, decays, two):
        _, status = solve(SLIDING, method, **({"wall": [-1e9]} | cell), flips=1.0)
        assert status[0] == Status.STICKS, cell


def test_taylor_hands_what_slides_to_dop853_and_what_that_cannot_end_to_rodas5p():
    """The same bits as by the method that does it: a relay, and a place drawn in a microsecond to where its kink is."""
    slope, wave = 1e6, 1.0
    relay = {"press": 0.9, "drive": 1.0, "belt": 1.0, "speed0": 1.0, "mid": 5.0}
    stiff = {"press": 1e7, "slope": slope, "sway": slope, "wave": wave, "mid": 0.5}
    for cell, method, other in ((relay, "dop853", "rodas5p"), (stiff, "rodas5p", "dop853")):
        found, away, handed = (
            solve(SLIDING, m, **({"wall": [-1e9]} | cell), flips=1.0, rtol=1e-6) for m in (method, other, "taylor")
        )
        assert handed[1][0] == found[1][0] == Status.OK
        assert all(handed[0][name][0] == found[0][name][0] for name in found[0])
        assert away[1][0] == Status.STICKS or away[0]["time"][0] != found[0]["time"][0]
    with mp.workdps(50):
        t = mp.findroot(lambda t: slope * (slope * mp.sin(t) - mp.cos(t)) / (mpf(slope) ** 2 + 1) - 0.5, mp.pi / 6)
    assert relative_error(found[0]["time"], [t])[0] < 1e-6


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_stick_and_slip_that_never_comes_to_its_surface_meets_the_limit(method):
    cell = {"press": 1.0, "belt": 0.2, "speed0": 0.2, "drag": -0.1, "stiffness": 1.0, "mid": 9.0, "wall": [-1e9]}
    assert solve(SLIDING, method, **cell, flips=1.0)[1][0] == Status.STEP_LIMIT


def test_a_body_that_dry_friction_holds_rests_there_whatever_other_kinks_its_rates_have():
    """From x = 1 it swings about 0.75 to 0.5, which the spring cannot move; a stop beyond x = 9 is never met."""
    kernel = scene_kernel(
        name="held",
        doc="a body on a spring, held by dry friction",
        states=(Field("clock", "s", "time"), Field("x", "m", "place"), Field("v", "m/s", "speed")),
        parameters=(Field("f", "1", "friction"),),
        rates=lambda x, v, f: (1.0, v, -x - maximum(x - 9.0, 0.0) - f * sign(v)),
        surface=lambda clock: 5.0 - clock,
        start=lambda: (0.0, 1.0, 0.0),
    )
    outputs, status = solve(kernel, "dop853", f=np.array([0.75]), flips=1.0, rtol=1e-9)
    assert status[0] == Status.OK
    np.testing.assert_allclose([outputs["x"][0], outputs["v"][0]], [0.5, 0.0], atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_slide_goes_on_through_a_further_surface_that_it_passes(method):
    """A relay that follows x = 1 - t, past a gate that counts, to the end. Its kink is written twice."""
    kernel = scene_kernel(
        name="gate",
        doc="a relay that follows its set point past a gate",
        states=(Field("x", "m", "place"), Field("n", "1", "gates that it has passed")),
        parameters=(Field("gate", "m", "where it is"),),
        rates=lambda x, t: (-2.0 * sign(x - (1.0 - t)) - where(x >= 1.0 - t, 1.0, -1.0), 0.0),
        surface={"end": lambda x: x, "gate": lambda x, gate: x - gate},
        switch={"gate": lambda x, n: (x, n + 1.0)},
        start=lambda: (1.0, 0.0),
    )
    outputs, status = solve(kernel, method, gate=np.array([0.25, 0.7]), flips=2.0)
    assert (status == Status.OK).all()
    np.testing.assert_allclose([outputs["time"], outputs["n"]], 1.0, rtol=1e-9)
