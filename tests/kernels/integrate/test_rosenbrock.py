"""Rodas5P of stiff scenes: against closed forms to 50 digits, where explicit methods give up."""

from fractions import Fraction
from functools import cache

import numpy as np
import pytest
import stiff_oracles
from columns import relative_error, solve
from lag_scene import KERNEL as LAG
from mpmath import mp, mpf
from stiff_scene import DRAWN

import sweep
from kernels.codegen.compiled import runner
from kernels.integrate import rosenbrock
from kernels.integrate.records import Mode
from kernels.integrate.tableaux import RODAS5P, RODAS5P_COUPLED, RODAS5P_GAMMA
from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Scene, sin

many = pytest.mark.skipif(not COMPILED, reason="many steps")
SOME = 40 if COMPILED else 2


@cache
def lags():
    """Cells mu, a, eps, flips, and what is true of them."""
    random = np.random.default_rng(11)
    mu, a = 10.0 ** random.uniform(-1, 1, SOME), 10.0 ** random.uniform(-2, 1, SOME)
    cells = mu, a, 10.0 ** random.uniform(-9, 0, SOME), random.integers(1, 5 if COMPILED else 2, SOME).astype(float)
    with mp.workdps(50):
        truths = [
            stiff_oracles.lagging_foliot(*map(float, cell[:3]), int(cell[3])) for cell in zip(*cells, strict=True)
        ]
    return cells, truths


def off(outputs, truths, names=("time", "angle", "speed", "force")):
    """The largest relative error of each cell."""
    columns = zip(names, zip(*truths, strict=True), strict=True)
    return np.max([relative_error(outputs[name], found) for name, found in columns], axis=0)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-11] if COMPILED else [1e-6])
def test_a_lag_of_nine_decades_is_right_to_the_tolerance(rtol):
    (mu, a, eps, flips), truths = lags()
    outputs, status = solve(LAG, "rodas5p", mu=mu, a=a, b=0.0, eps=eps, flips=flips, rtol=rtol)
    assert not status.any()
    assert (off(outputs, truths) < rtol).all()


@many
def test_the_series_gives_up_where_stability_limits_its_steps_and_auto_goes_on():
    eps = [1e-1, 1e-6, 1e-9]
    _, status = solve(LAG, "taylor", mu=1.0, a=0.5, b=0.0, eps=eps, flips=1.0)
    assert status.tolist() == [Status.OK, Status.STEP_LIMIT, Status.STEP_LIMIT]
    assert solve(LAG, "rodas5p", [0.0], a=0.5, b=0.0, eps=1e-6, flips=1.0)[1] == Status.STEP_LIMIT  # at rest for ever
    fixed = {"mu": 1.0, "a": 0.5, "b": 0.0, "flips": 1}
    study = sweep.study(kernel="lag_scene:KERNEL", axes={"eps": eps}, fixed=fixed, allow_import=True)
    found = sweep.run(study, progress=False)
    names = [method.name for method in LAG.methods]
    assert [names[k] for k in found.method_used.values] == ["taylor", "rodas5p", "rodas5p"]
    assert not found.status.any()
    truths = [stiff_oracles.lagging_foliot(1.0, 0.5, one, 1)[0] for one in eps]
    assert (relative_error(found.time.values, truths) < study.rtol).all()


@many
@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
def test_a_stiff_law_that_is_not_linear_keeps_to_the_wave_that_it_follows(rtol):
    eps, level = 10.0 ** -np.linspace(0.0, 9.0, 19), 0.5
    outputs, status = solve(DRAWN, "rodas5p", eps, level, 0.0, flips=1.0, rtol=rtol)
    time = mp.asin(mpf(level))  # force = cos(clock), speed = sin(clock)
    assert not status.any()
    assert (off(outputs, [(time, time, mp.cos(time))] * len(eps), ("time", "clock", "force")) < rtol).all()
    for explicit in ("dop853", "dopri5"):  # no value is out of range, though some of the steps tried come to none
        assert solve(DRAWN, explicit, [1e-9], level, 0.0, flips=1.0, rtol=rtol)[1] == Status.STEP_LIMIT


@many
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-11])
@pytest.mark.parametrize("level", [0.5, -0.5])
def test_a_switch_while_a_state_relaxes_is_met_where_it_is(level, rtol):
    eps = 10.0 ** -np.arange(0.0, 16.0)
    outputs, status = solve(DRAWN, "rodas5p", eps, level, 1.0, flips=2.0, rtol=rtol)
    truths = [-mpf(one) * mp.log((1 + mpf(level)) / 2) for one in eps]
    assert not status.any()
    assert (relative_error(outputs["interval"], truths) < rtol).all()


PENDULUM = Scene(
    "swing", "pendulum", ("angle", "speed"), (), lambda angle, speed: (speed, -sin(angle)), lambda angle: angle - 9.0,
    lambda: (1.0, 0.0),
)  # fmt: skip


def one_step(scene, state, h, *parameters):
    m, mode = runner(scene, "rodas5p").m, Mode(1.0, (1.0,), parameters, False)
    return rosenbrock.tried(m, state, mode, h)


@pytest.mark.skipif(COMPILED, reason="a step as plain Python")
def test_the_error_of_a_step_is_of_order_six_and_the_estimate_of_order_five():
    with mp.workdps(30):
        true = mp.odefun(lambda t, y: [y[1], -mp.sin(y[0])], 0, [1, 0.25])
        steps = [0.4, 0.2, 0.1]
        found = [one_step(PENDULUM, (1.0, 0.25), h) for h in steps]
        errors = [float(abs(mpf(trial.new[0]) - true(mpf(h))[0])) for trial, h in zip(found, steps, strict=True)]
    slopes = np.diff(np.log2(errors)) / -1.0
    assert (abs(slopes - 6.0) < 0.5).all()
    estimates = np.diff(np.log2([trial.error for trial in found])) / -1.0
    assert (abs(estimates - 5.0) < 0.7).all()


def test_the_weights_as_rounded_make_a_step_as_long_as_it_is():
    """One step of x' = v, v' = 1 from 0 with h = 1, in exact numbers; by published digits v is 27 roundings off."""
    gamma, rounding = Fraction(RODAS5P_GAMMA), 2.0**-52
    increments, places = [], [(), *RODAS5P]
    for stage, coupled in enumerate([(), *RODAS5P_COUPLED]):
        if stage < len(places):
            speed = sum(Fraction(a) * w[1] for a, w in zip(places[stage], increments, strict=True))
        else:
            speed += increments[-1][1]
        x, v = (sum(Fraction(c) * w[j] for c, w in zip(coupled, increments, strict=True)) for j in (0, 1))
        v = gamma * (1 + v)
        increments.append((gamma * (speed + x + v), v))
    weights = [*RODAS5P[-1], 1, 1, 1]
    x, v = (sum(Fraction(a) * w[j] for a, w in zip(weights, increments, strict=True)) for j in (0, 1))
    assert abs(v - 1) < rounding
    assert abs(2 * x - 1) < rounding
