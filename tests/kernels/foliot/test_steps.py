"""Integrators at a fixed step: their order with each way to find a switch, closed forms, and what is refused."""

import numpy as np
import pytest
import scene_oracles as oracles
from columns import bounds, solve
from mpmath import mp, mpf

from kernels.catalogue import get
from kernels.integrate.events import LOCATIONS, METHODS
from kernels.interface import FIRST_REFUSAL, Field, Status
from kernels.lanes.jit import COMPILED
from kernels.scene import sign
from kernels.stepping import stepped_kernel

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of steps")
KERNEL = get("foliot_steps")
CELL = {"mu": 1.0, "phi0": 1.0, "a": 0.5, "c": 0.3}
MILD = {"mu": 1.0, "phi0": 1.0, "a": 1.0, "c": 1e-9}
"""Here order 8 shows before rounding does."""
FLIPS = 3
ORDER = dict(zip(METHODS, (1, 1, 2, 4, 5, 8, 1), strict=True))
FIRST_STEP = {
    "euler": 0.02,
    "semi_implicit": 0.02,
    "verlet": 0.02,
    "rk4": 0.16,
    "dopri5": 0.32,
    "dop853": 0.9,
    "moreau": 0.02,
}
SAMPLES = 24


def errors(method, location, halvings):
    """Mean relative error of the last switch's time, of steps about h, h/2 ..., with grids that lie differently."""
    shift = np.linspace(0.8, 1.2, SAMPLES)
    steps = (FIRST_STEP[method] * 0.5 ** np.arange(halvings)[:, None] * shift).ravel()
    cell = MILD if method == "dop853" else CELL
    cells = {**cell, "mu": np.full(len(steps), cell["mu"])}
    outputs, status = solve(KERNEL, method, flips=FLIPS, step=steps, location=float(LOCATIONS[location]), **cells)
    assert (status < FIRST_REFUSAL).all()
    truth, _ = oracles.quadratic_foliot(*cell.values(), FLIPS)
    error = abs(outputs["time"] / float(truth) - 1).reshape(halvings, SAMPLES)
    return np.exp(np.log(error).mean(axis=1)), outputs, error


@pytest.mark.parametrize("method", METHODS)
def test_a_located_switch_keeps_the_order_of_each_method(method):
    mean, *_ = errors(method, "root", 3)
    order = np.log2(mean[:-1] / mean[1:])
    wanted = ORDER[method]
    assert (order > wanted - 0.35).all()
    assert order[-1] < wanted + 0.9


@pytest.mark.parametrize(
    ("method", "location", "halvings", "low", "high"),
    [
        *((method, "none", 5, 0.6, 1.5) for method in METHODS),  # at the end of its step: of the first order
        *((method, "linear", 4, 1.5, 2.8) for method in ("rk4", "dop853")),  # else of the polynomial's
        *((method, "hermite", 4, 3.5, 4.8) for method in ("rk4", "dop853")),
    ],
)
def test_a_switch_that_is_not_located_has_the_order_of_how_it_is_found(method, location, halvings, low, high):
    mean, *_ = errors(method, location, halvings)
    assert low < np.log2(mean[0] / mean[-1]) / (halvings - 1) < high


@pytest.mark.parametrize("location", LOCATIONS)
@pytest.mark.parametrize("method", METHODS)
def test_the_estimated_error_is_no_smaller_than_the_true_one(method, location):
    _, outputs, error = errors(method, location, 3)
    assert (error.ravel() <= 1.3 * outputs["error"] + 1e-15).all()


BELIEVED = [
    # grazes, and halves of the step meet the same points again
    ("dopri5", {"mu": 31.253343950955195, "phi0": 0.09737491865214114, "k": 640.955635182617}, 0.012529584097168095,
     "linear", {Status.GRAZING}),
    # turns below the switch, which a step with more energy than there is passes
    ("semi_implicit", {"mu": 0.001266349113732273, "phi0": 1.402429638167423, "a": 0.000266272676099387,
                       "k": 0.0017970706542706216}, 53.94530913252986, "hermite", {Status.GRAZING}),
    # steps of a half and of a quarter are as wrong, by a fifth
    ("semi_implicit", {"mu": 0.3728952659438824, "R": 0.36853454347820896, "phi0": 167.44256859441495, "flips": 8.0},
     3.238507460064415, "none", set()),
    # the run at a finer step does not end
    ("moreau", {"mu": 1.0, "phi0": 1.0, "R": 0.9, "a": 0.2, "flips": 2.0}, 6e-4, "none", {Status.INACCURATE}),
]  # fmt: skip


@pytest.mark.parametrize(("method", "cell", "step", "location", "statuses"), BELIEVED)
def test_where_runs_agree_by_chance_a_status_or_a_large_error_says_so(method, cell, step, location, statuses):
    values = {"flips": 1.0, "step": step, "location": float(LOCATIONS[location]), **cell}
    outputs, status = solve(KERNEL, method, **{name: [value] for name, value in values.items()})
    assert status[0] in statuses or outputs["error"][0] > 0.2, Status(status[0])


def test_where_differences_grow_as_the_step_shrinks_nothing_is_promised():
    mu, phi0, a = cell = 55.9382192261618, 0.16322424255323054, 59.090741848524814  # each step takes 0.95 of the way
    how = {"phi0": phi0, "a": a, "flips": 1.0, "location": float(LOCATIONS["root"])}
    outputs, status = solve(KERNEL, "euler", [mu, mu], **how, step=np.array([0.016034811141985534, 0.001]))
    drive, way, drag = map(mpf, cell)
    time = mp.findroot(lambda t: drive / drag * (t + mp.expm1(-drag * t) / drag) - way, way * drag / drive)
    true = float(-drive / drag * mp.expm1(-drag * time))
    off = abs(outputs["crossing_speed"] / true - 1)
    assert status.tolist() == [Status.INACCURATE, Status.OK]
    assert off[0] > outputs["error"][0]
    assert off[1] < outputs["error"][1]
    assert bounds(KERNEL, "euler", [mu], **how, step=0.016034811141985534)[0] == np.inf


def parabolas(mu, R, phi0, flips):
    """Times between switches under dry friction alone, the speed at the last, the largest angle before it."""
    mu, R, phi0 = mpf(mu), mpf(R), mpf(phi0)
    v, top = mp.sqrt(2 * (mu - R) * phi0), None
    times = [v / (mu - R)]
    for _ in range(flips - 1):
        top = v * v / (2 * (mu + R))
        down = mp.sqrt(2 * (top + 2 * phi0) / (mu - R))
        times.append(v / (mu + R) + down)
        v = down * (mu - R)
    return times, v, top


@pytest.mark.parametrize("method", ["verlet", "rk4"])
def test_free_flight_with_dry_friction_is_exact_for_methods_of_order_two(method):
    mu, R, phi0 = 3.0, 1.0, 2.0
    outputs, status = solve(KERNEL, method, [mu], phi0=phi0, R=R, flips=3.0, step=0.7)
    times, v, top = parabolas(mu, R, phi0, 3)
    assert status[0] == Status.OK
    assert outputs["time"][0] == pytest.approx(float(sum(times)), rel=1e-13, abs=0.0)
    assert outputs["period"][0] == pytest.approx(float(2 * times[-1]), rel=1e-13, abs=0.0)
    assert outputs["crossing_speed"][0] == pytest.approx(float(v), rel=1e-13, abs=0.0)
    assert outputs["amplitude"][0] == pytest.approx(float(phi0 + top), rel=1e-13, abs=0.0)


@pytest.mark.parametrize(
    ("cell", "method", "location", "statuses"),
    [
        ({"k": 4.0}, "rk4", "root", {Status.STEP_LIMIT, Status.STICKS}),  # swings below the switch for good
        ({"R": 0.999}, "rk4", "root", {Status.OK}),
        ({"a": 1.0, "step": 1e3}, "euler", "none", {Status.GRAZING, Status.STEP_LIMIT, Status.OUT_OF_RANGE}),
        ({"mu": 1e300, "phi0": 1e300, "step": 1e-3}, "rk4", "root", {Status.OUT_OF_RANGE}),
        ({"mu": 1e-300, "phi0": 1e-300, "a": 0.5}, "rk4", "root", {Status.OUT_OF_RANGE}),
        ({"step": 1e-7}, "rk4", "root", {Status.STEP_LIMIT}),
        # the spring stops it before the switch
        ({"R": 0.9, "k": 0.5, "flips": 1.0, "step": 0.02}, "moreau", "none", {Status.STICKS}),
        ({"R": 0.9, "k": 0.5, "flips": 1.0, "step": 0.02}, "rk4", "root", {Status.STICKS}),
        ({"R": 0.9, "k": 0.5, "flips": 1.0, "step": 0.02}, "dop853", "root", {Status.STICKS}),
    ],
)
def test_what_a_cell_comes_to_is_named(cell, method, location, statuses):
    values = {"mu": 1.0, "phi0": 1.0, "step": 0.1, "flips": 4.0, **cell, "location": float(LOCATIONS[location])}
    outputs, status = solve(KERNEL, method, **{k: [v] for k, v in values.items()})
    assert status[0] in statuses, Status(status[0])
    if status[0] < FIRST_REFUSAL:
        assert np.isfinite([outputs[name][0] for name in ("time", "period", "amplitude")]).all()


@pytest.mark.parametrize("location", LOCATIONS)
@pytest.mark.parametrize("method", ["euler", "verlet", "rk4", "moreau"])
def test_a_switch_that_only_the_steps_error_reaches_is_no_quiet_number(method, location):
    missed = 10.0 ** -np.arange(1.0, 8.0)[:, None]
    step = np.array([0.003, 0.03, 0.3])
    k, step = (np.broadcast_to(v, (7, 3)).ravel() for v in (2.0 * (1.0 + missed), step))  # turns at 1 - missed
    cells = {"mu": [1.0] * 21, "k": k, "step": step, "location": float(LOCATIONS[location])}
    outputs, status = solve(KERNEL, method, phi0=1.0, flips=1.0, **cells)
    assert ((status != Status.OK) | np.isinf(outputs["error"])).all()


def test_methods_of_pairs_are_kept_from_scenes_that_are_none():
    def methods(rates, *states):
        kernel = stepped_kernel(
            name="scene", doc="", states=[Field(state, "1", "") for state in states],
            parameters=[Field("r", "1/s", "")],
            rates=rates, surface=lambda level, side: 1.0 - side * level, start=lambda: (0.0,) * len(states),
        )  # fmt: skip
        return {m.name for m in kernel.methods}

    assert methods(lambda level, side, r: r * (2.0 * side - level), "level") == {"euler", "rk4", "dopri5", "dop853"}
    assert methods(lambda speed, side, r: (speed, side - r * sign(speed)), "level", "speed") == set(METHODS)
    bent = methods(lambda level, speed, side, r: (speed, side - r * abs(level)), "level", "speed")
    assert bent == set(METHODS) - {"moreau"}
