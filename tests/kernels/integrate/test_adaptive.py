"""Dormand-Prince 5(4) and DOP853 of any scene, to a tolerance: against closed forms, and where they must refuse."""

import numpy as np
import pytest
import scene_oracles as oracles
from columns import columns_of, relative_error
from columns import solve as solve_columns
from mpmath import mp, mpf
from rich_scene import RICH

from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED

METHODS = ["dop853", "dopri5", "rodas5p"] if COMPILED else ["dop853"]
SOME = 24 if COMPILED else 1
FLIPS = 10.0 if COMPILED else 2.0


def solve(method, *parameters, rtol=1e-9, **named):
    columns = [np.atleast_1d(c) for c in columns_of(RICH, parameters, named)]
    return solve_columns(RICH, method, *columns, rtol=rtol)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-11] if COMPILED else [1e-6])
def test_a_foliot_with_quadratic_drag_is_right_to_the_tolerance_or_says_that_it_is_not(method, rtol):
    random = np.random.default_rng(7)
    mu, phi0, a, c = cells = tuple(10.0 ** random.uniform(-1, 1, SOME) for _ in range(4))
    outputs, status = solve(method, mu, phi0, a, c, flips=FLIPS, rtol=rtol)
    truths = [oracles.quadratic_foliot(*cell, int(FLIPS)) for cell in zip(*cells, strict=True)]
    error = relative_error(outputs["time"], [t for t, _ in truths])
    error = np.maximum(error, relative_error(abs(outputs["speed"]), [v for _, v in truths]))
    assert (status <= Status.INACCURATE).all()
    assert (status == Status.OK).mean() > 0.8
    assert (error[status == Status.OK] < rtol).all()


@pytest.mark.parametrize("method", [*METHODS, "taylor"])
def test_dry_friction_alone_gives_parabolas(method):
    mu, R, phi0 = mpf(3), mpf(1), mpf(2)
    outputs, status = solve(method, 3.0, 2.0, R=1.0, flips=2.0)
    v = mp.sqrt(2 * (mu - R) * phi0)
    down = mp.sqrt(2 * (v * v / (2 * (mu + R)) + 2 * phi0) / (mu - R))
    assert status[0] == Status.OK
    assert relative_error(outputs["time"], [v / (mu - R) + v / (mu + R) + down])[0] < 1e-13


@pytest.mark.parametrize("method", [*METHODS, "taylor"])
@pytest.mark.parametrize("excess", [1e-2, 1e-4])
def test_two_roots_close_together_in_a_step_are_both_seen(method, excess):
    k = 2.0 / (1.0 + excess)  # passes the switch by so little that it is back soon
    outputs, status = solve(method, 1.0, 1.0, k=k, flips=1.0)
    true = mp.acos(1 - mpf(k)) / mp.sqrt(mpf(k))
    assert status[0] in (Status.OK, Status.INACCURATE)
    if status[0] == Status.OK:
        assert relative_error(outputs["time"], [true])[0] < 1e-9


@pytest.mark.skipif(not COMPILED, reason="many steps")
@pytest.mark.parametrize("method", [*METHODS, "taylor"])
@pytest.mark.parametrize("excess", [0.0, 1e-15, -1e-15, 1e-13, -1e-13])
def test_a_turning_point_on_the_switch_is_no_quiet_number(method, excess):
    _, status = solve(method, 1.0, 1.0, k=2.0 / (1.0 + excess), flips=1.0)
    assert status[0] in (Status.GRAZING, Status.STEP_LIMIT, Status.INACCURATE)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("cell", "status"),
    [
        ({"R": 1.5}, Status.STICKS),
        ({"mu": 0.0}, Status.STICKS),
        ({"angle0": 2.0}, Status.OUT_OF_RANGE),
        ({"mu": 1e140, "phi0": 1e140, "a": 1e-3}, Status.OK),
        ({"mu": 1e-300, "phi0": 1e-300, "a": 0.5}, Status.OUT_OF_RANGE),
        ({"mu": 1e300, "phi0": 1e300, "a": 1e-3}, Status.OUT_OF_RANGE),
        ({"angle0": 1.0, "speed0": -1.0}, Status.OK),
    ],
)
def test_what_a_cell_comes_to_is_named(method, cell, status):
    if not COMPILED and cell.get("mu", 1.0) == 1e300:
        pytest.skip("many steps")
    outputs, found = solve(method, **{"mu": 1.0, "phi0": 1.0, "flips": 1.0, **cell})
    assert found[0] == status, Status(found[0])
    if status < FIRST_REFUSAL:
        assert np.isfinite([outputs[name][0] for name in outputs]).all()


def braked(mu, phi0, a):
    """Time and speed at the first switch of a foliot with viscous friction."""
    mu, phi0, a = mpf(mu), mpf(phi0), mpf(a)
    time = mp.findroot(lambda t: mu / a * (t + mp.expm1(-a * t) / a) - phi0, phi0 * a / mu)
    return time, -mu / a * mp.expm1(-a * time)


@pytest.mark.skipif(not COMPILED, reason="many steps")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("cell", "truth"),
    [
        ({"mu": 7.976388341733172, "phi0": 42.544689721278594, "a": 2.6615561142988726}, braked),
        ({"mu": 1.425165612376569, "phi0": 695.6938993935804, "a": 0.0044199843571, "c": 0.0021731995910895}, None),
    ],
)
def test_where_friction_limits_the_steps_every_tolerance_is_met(method, cell, truth):
    flips = 1 if truth else 3  # the dense output is poor, or a step too long looks good by chance
    time, speed = truth(**cell) if truth else oracles.quadratic_foliot(*cell.values(), flips)
    rtol = np.geomspace(1e-6, 1e-3, 600)
    cells = {name: np.full(len(rtol), value) for name, value in cell.items()}
    outputs, status = solve(method, **cells, flips=float(flips), rtol=rtol)
    assert not status.any()
    assert (relative_error(outputs["time"], [time] * len(rtol)) < rtol).all()
    assert (relative_error(abs(outputs["speed"]), [speed] * len(rtol)) < rtol).all()
