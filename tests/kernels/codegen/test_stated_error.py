"""The error that a motion by Taylor series carries along: against true errors, and what comes of what is not sure."""

import inspect

import mpmath
import numpy as np
import pytest
import rich_scene
import scene_oracles as oracles
from columns import solve
from mpmath import mp
from scipy.integrate import solve_ivp

from kernels.codegen import followed_twice, stated_error
from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Scene, sign, sin

FLIPS = 12
NAMES = [f.name for f in rich_scene.RICH.parameters if f.name != "flips"]
SCENE = Scene(
    "rich", "foliot with every term", ("angle", "speed"), tuple(NAMES),
    rich_scene.rates, rich_scene.surface, rich_scene.start, rich_scene.switch,
)  # fmt: skip


def told(cells, flips, rtol):
    """Results and error of one run; `cells` are columns by name."""
    n = len(next(iter(cells.values())))
    plain = {"e": 1.0}
    columns = [np.ascontiguousarray(np.broadcast_to(cells.get(name, plain.get(name, 0.0)), n), float) for name in NAMES]
    return followed_twice.told(
        stated_error.telling(SCENE), [*columns, np.full(n, float(flips))], *np.full((2, n), rtol)
    )


def drags(n=40 if COMPILED else 16):
    random = np.random.default_rng(4)
    mu, a, c = 10.0 ** random.uniform(-1, 1, n), 10.0 ** random.uniform(-1, 0, n), 10.0 ** random.uniform(-1, 0, n)
    return {"mu": mu, "phi0": np.ones(n), "a": a, "c": c}


@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-11])
def test_the_error_carried_along_is_the_true_one(rtol):
    cells = drags()
    results, error = told(cells, FLIPS, rtol)
    truths = [oracles.quadratic_foliot(*cell, FLIPS) for cell in zip(*cells.values(), strict=True)]
    found = abs(results[[0, 3]].T)
    true = np.array(
        [[float(r / t - 1) for r, t in zip(*pair, strict=True)] for pair in zip(found, truths, strict=True)]
    )
    true = abs(true).max(axis=1)
    matters = true > 0.1 * rtol  # what is smaller is a difference, by chance
    assert matters.any()
    ratio = error[matters] / true[matters]
    assert ratio.min() > 0.7  # STATED times that is above the true one
    assert np.median(ratio) < 1.4


def test_jumps_and_dry_friction_pass_the_error_on():
    """Against the same motion at a hundredth of the tolerance."""
    cells = drags() | {"R": 0.4 * drags()["mu"], "e": 0.3, "k": 0.05 * drags()["mu"]}
    coarse, error = told(cells, FLIPS, 1e-6)
    fine, _ = told(cells, FLIPS, 1e-9)
    assert (coarse[-1] == Status.OK).all()
    true = abs(coarse[[0, 1, 3]] / fine[[0, 1, 3]] - 1).max(axis=0)
    matters = true > 1e-7
    assert matters.any()
    ratio = error[matters] / true[matters]
    assert ratio.min() > 0.8
    assert np.median(ratio) < 1.2


def test_what_states_too_large_an_error_is_followed_again_and_then_right():
    mu, phi0 = np.array([1.0]), np.array([1.0])
    cells = {"mu": mu, "phi0": phi0, "R": mu * (1 - 1e-4), "a": np.array([1e-3])}
    outputs, status = solve(rich_scene.RICH, "taylor", **cells, flips=2.0, rtol=1e-9)
    _, error = told(cells, 2, 1e-15)
    assert error[0] > 3e-14  # what rounding takes is 1e4 times as much where so little of the drive is left
    assert status[0] == Status.OK
    with mp.workdps(40):
        slack, sum_of, a = mp.mpf(1) - mp.mpf(cells["R"][0]), mp.mpf(1) + mp.mpf(cells["R"][0]), mp.mpf(1e-3)

        def way(t):
            return slack * (t / a + mpmath.expm1(-a * t) / a**2)

        first = mpmath.findroot(lambda t: way(t) - 1, mpmath.sqrt(2 / slack))
        v = slack * -mpmath.expm1(-a * first) / a
        turn = mpmath.log1p(a * v / sum_of) / a
        beyond = (v + sum_of / a) * -mpmath.expm1(-a * turn) / a - sum_of / a * turn
        second = mpmath.findroot(lambda t: way(t) - 2 - beyond, mpmath.sqrt(4 / slack))
        assert abs(outputs["time"][0] / float(first + turn + second) - 1) < 1e-9


def test_next_to_a_turning_point_a_switch_states_that_its_error_is_not_known():
    """A first swing that passes the switch by 1e-7 of itself: when it does hangs on the root of so little."""
    _, error = told({"mu": np.ones(1), "phi0": np.ones(1), "k": np.array([2.0 * (1 - 1e-7)])}, 1, 1e-6)
    assert error[0] == np.inf


def surface(x, side, phi0):
    return phi0 - side * x


def damped(x, v, side, mu, a, R):
    return v, side * mu - a * v - R * sign(v)


@pytest.mark.skipif(not COMPILED, reason="asks for many cells")
def test_changes_of_linear_rates_die_out_as_they_do():
    """Their series is that of exp, whose terms first grow; against the same motion at a thousandth of the tolerance."""
    n = 300
    random = np.random.default_rng(5)
    mu, a, near = (10.0 ** random.uniform(*range_, n) for range_ in ((-1, 1), (0, 0.5), (-3, -0.1)))
    scene = Scene("damped", "linear", ("x", "v"), ("mu", "phi0", "a", "R"), damped, surface, lambda: (0.0, 0.0))
    columns = [mu, 10.0 ** random.uniform(-1, 1, n), a, mu * (1.0 - near), np.full(n, 8.0)]
    coarse, error = followed_twice.told(stated_error.telling(scene), columns, *np.full((2, n), 1e-8))
    fine, _ = followed_twice.told(stated_error.telling(scene), columns, *np.full((2, n), 1e-11))
    with np.errstate(invalid="ignore"):
        true = abs(coarse[[0, 1, 3]] / fine[[0, 1, 3]] - 1).max(axis=0)
    matters = (true > 1e-10) & (error < 1e-6)
    assert np.quantile(error[matters] / true[matters], 0.75) < 1.5


def pendulum(x, v, t, side, mu, a, k, depth, omega):
    return v, side * mu - a * v - k * sin(x) + depth * sin(omega * t), 1.0


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


@pytest.mark.skipif(not COMPILED, reason="asks for many steps")
@pytest.mark.parametrize(("rates", "rtol", "flips", "values"), CANCEL)
def test_errors_that_cancel_and_grow_again_are_told(rates, rtol, flips, values):
    timed = rates is pendulum
    states, names = ("x", "v", "t")[: 2 + timed], ("mu", "phi0", *inspect.signature(rates).parameters)
    names = tuple(dict.fromkeys(name for name in names if name not in (*states, "side")))
    scene = Scene(rates.__name__, "waits", states, names, rates, surface, lambda: (0.0,) * len(states))
    columns = [np.array([value]) for value in (*values, float(flips))]
    results, error = followed_twice.told(stated_error.telling(scene), columns, *np.array([[rtol], [0.25 * rtol]]))
    others = (values[0], *values[2:])
    truth = by_scipy(lambda t, y, side: rates(*y, *((t,) if timed else ()), side, *others)[:2], values[1], flips)
    true = abs(results[[0, 3], 0] / truth - 1).max()
    assert true > rtol
    assert stated_error.STATED * error[0] > true


@pytest.mark.skipif(not COMPILED, reason="asks for many cells")
@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
def test_where_states_feed_back_the_error_is_the_true_one_and_its_spread_covers_what_it_lacks(rtol):
    """Against the same motion at a thousandth of the tolerance."""
    n = 400
    random = np.random.default_rng(6)
    columns = [
        10.0 ** random.uniform(*decades, n) for decades in ((-0.5, 0.5), (-1, 0), (-2, -0.3), (-1, 0.3), (-2, 0.3))
    ]
    columns += [10.0 ** random.uniform(-1, 1, n), np.full(n, 4.0)]
    names = ("mu", "phi0", "a", "k", "depth", "omega")
    telling = stated_error.telling(Scene("p", "", ("x", "v", "t"), names, pendulum, surface, lambda: (0.0, 0.0, 0.0)))
    coarse, error = followed_twice.told(telling, columns, *np.full((2, n), rtol))
    fine, _ = followed_twice.told(telling, columns, *np.full((2, n), 1e-3 * rtol))
    with np.errstate(invalid="ignore"):
        true = abs(coarse[[0, 1, 3]] / fine[[0, 1, 3]] - 1).max(axis=0)
    matters = (true > 0.1 * rtol) & (error < 100 * rtol)
    ratio = error[matters] / true[matters]
    assert np.quantile(ratio, 0.05) > 1.0
    assert np.median(ratio) < 1.2
