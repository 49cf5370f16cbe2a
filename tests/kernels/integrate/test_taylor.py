"""The Taylor method, and DOP853, Dormand-Prince 5(4) and Rodas5P to a tolerance, of any scene.

Against closed forms in 40 digits, and where they must refuse.
"""

from functools import cache

import numpy as np
import pytest
import scene_oracles as oracles
from columns import columns_of, relative_error
from columns import solve as solve_columns
from mpmath import mp, mpf
from rich_scene import RICH

from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of steps")
STEPS = ["dop853", "dopri5", "rodas5p"]
METHODS = ["taylor", *STEPS]
SOME, FLIPS = 24, 40.0


def solve(method, *parameters, rtol=1e-9, **named):
    """Of one cell, too."""
    columns = [np.atleast_1d(c) for c in columns_of(RICH, parameters, named)]
    return solve_columns(RICH, method, *columns, rtol=rtol)


def drags(n=SOME, decades=1.0):
    """mu, phi0, a, c of foliots with viscous and quadratic drag."""
    random = np.random.default_rng(7)
    return tuple(10.0 ** random.uniform(-decades, decades, n) for _ in range(4))


@cache
def truths(flips):
    """Times and speeds of these."""
    return list(zip(*(oracles.quadratic_foliot(*cell, int(flips)) for cell in zip(*drags(), strict=True)), strict=True))


def errors(outputs, flips=FLIPS):
    times, speeds = truths(flips)
    return np.maximum(relative_error(outputs["time"], times), relative_error(abs(outputs["speed"]), speeds))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-11])
def test_a_foliot_with_quadratic_drag_is_right_to_the_tolerance(method, rtol):
    """Or says that it is not, of a method of steps."""
    flips = FLIPS if method == "taylor" else FLIPS / 4
    outputs, status = solve(method, *drags(), flips=flips, rtol=rtol)
    assert (status <= Status.INACCURATE).all()
    assert (status == Status.OK).mean() > (0.99 if method == "taylor" else 0.8)
    assert (errors(outputs, flips)[status == Status.OK] < rtol).all()
    if method == "taylor":
        np.testing.assert_allclose(abs(outputs["angle"]), drags()[1], rtol=1e-14 + 1e-3 * rtol)


def test_followed_once_it_is_right_to_some_tolerances_and_follows_the_tolerance():
    worst = []
    for rtol in (1e-5, 1e-7, 1e-9):
        outputs, status = solve("taylor_once", *drags(), flips=FLIPS, rtol=rtol)
        assert (status == Status.OK).all()
        worst.append(errors(outputs).max())
        assert worst[-1] < 20 * rtol
    assert worst[2] < 1e-3 * worst[0]


NAMED = [
    ({"R": 1.5}, Status.STICKS), ({"mu": 0.0}, Status.STICKS),
    ({"angle0": 2.0}, Status.OUT_OF_RANGE),  # behind the switch, and goes away from it
    ({"angle0": 1.0, "speed0": -1.0}, Status.OK), ({"mu": 1e140, "phi0": 1e140, "a": 1e-3}, Status.OK),
    ({"mu": 1e300, "phi0": 1e300, "a": 1e-3}, Status.OUT_OF_RANGE),  # the drag, though c = 0
    ({"mu": 1e-300, "phi0": 1e-300, "a": 0.5}, Status.OUT_OF_RANGE),
]  # fmt: skip
OF_SERIES = [
    ({"R": 1.0}, Status.STICKS), ({"e": 0.0, "angle0": 0.5}, Status.OK),
    ({"k": 4.0, "a": 0.1, "c": 0.1}, Status.STEP_LIMIT),  # swings below the switch for good
    ({"angle0": 2.0, "k": 4.0}, Status.OK),  # comes up first
    ({"mu": 1e-140, "phi0": 1e-140, "a": 0.5}, Status.OK), ({"phi0": 1e-80}, Status.OK),
    ({"mu": 1e200, "phi0": 1e200, "c": 1e-200}, Status.OUT_OF_RANGE),
    ({"mu": 1e-200, "phi0": 1e-200, "c": 1e200}, Status.OUT_OF_RANGE), ({"a": 1e9}, Status.STEP_LIMIT),
]  # fmt: skip


@pytest.mark.parametrize(
    ("method", "cell", "status"),
    [*((method, *case) for method in METHODS for case in NAMED), *(("taylor", *case) for case in OF_SERIES)],
)
def test_what_a_cell_comes_to_is_named(method, cell, status):
    outputs, found = solve(method, **{"mu": 1.0, "phi0": 1.0, "flips": 3.0} | cell)
    assert found[0] == status, Status(found[0])
    if status < FIRST_REFUSAL:
        assert np.isfinite([outputs[name][0] for name in outputs]).all()


def test_a_start_on_the_switch_moves_away_or_switches_at_once():
    mu, phi0 = [1.0, 1.0], [1.0, 1.0]
    outputs, status = solve("taylor", mu, phi0, angle0=1.0, speed0=[-1.0, 1.0], flips=[1.0, 2.0])
    assert (status == Status.OK).all()
    assert outputs["time"][0] == pytest.approx(2.0, rel=1e-12)  # thrown back against the drive, and home again
    # switched at 0, it then turns at 1 + 1/2 and falls 2.5
    assert outputs["time"][1] == pytest.approx(1.0 + np.sqrt(5.0), rel=1e-12)


@pytest.mark.parametrize("method", ["taylor_once", "dop853"])
def test_a_number_of_switches_that_is_none_is_refused_and_ends(method):
    _, status = solve(method, 1.0, 1.0, 0.3, 0.2, R=0.1, flips=[np.nan, np.inf, 0.0, -3.0, 2.0])
    assert status.tolist() == [Status.BAD_INPUT] * 4 + [Status.OK]


def test_kinks_are_limited_between_two_switches_and_not_in_all():
    outputs, status = solve("taylor_once", 1.0, 1.0, a=0.3, flips=1200.0)
    assert status[0] == Status.OK
    assert outputs["time"][0] == pytest.approx(1200.0 * outputs["interval"][0], rel=3e-3)


@pytest.mark.parametrize("flips", [1.0, 2.0, 12.0])
def test_a_switch_is_found_to_the_last_digits_however_long_the_steps(flips):
    outputs, status = solve("taylor_once", [7.5e-4, 1.0, 3.0], [1e30, 1.0, 1e-6], flips=flips, rtol=1e-8)
    assert (status == Status.OK).all()
    np.testing.assert_allclose(abs(outputs["angle"]), [1e30, 1.0, 1e-6], rtol=1e-11)


def test_over_decades_of_cells_what_is_not_remarked_is_right():
    mu, phi0, a, c = drags(400, decades=5.0)
    outputs, status = solve("taylor", mu, phi0, a, c, flips=5.0, rtol=1e-8)
    fine = np.flatnonzero(status == Status.OK)
    assert len(fine) > 0.3 * len(status)
    for i in fine[::10]:
        time, speed = oracles.quadratic_foliot(mu[i], phi0[i], a[i], c[i], 5, digits=70)
        assert relative_error(outputs["time"][[i]], [time])[0] < 1e-8
        assert relative_error(abs(outputs["speed"][[i]]), [speed])[0] < 1e-8


def test_what_rounding_leaves_less_than_wanted_is_said_to_be_inaccurate():
    _, status = solve("taylor", *drags(), flips=FLIPS, rtol=1e-17)
    assert (status == Status.INACCURATE).all()


@pytest.mark.parametrize("method", METHODS)
def test_dry_friction_alone_gives_parabolas(method):
    mu, R, phi0 = mpf(3), mpf(1), mpf(2)
    outputs, status = solve(method, 3.0, 2.0, R=1.0, flips=2.0)
    v = mp.sqrt(2 * (mu - R) * phi0)
    down = mp.sqrt(2 * (v * v / (2 * (mu + R)) + 2 * phi0) / (mu - R))
    assert status[0] == Status.OK
    assert relative_error(outputs["time"], [v / (mu - R) + v / (mu + R) + down])[0] < 1e-13


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("excess", [1e-2, 1e-4])
def test_two_roots_close_together_in_a_step_are_both_seen(method, excess):
    k = 2.0 / (1.0 + excess)  # passes the switch by so little that it is back soon
    outputs, status = solve(method, 1.0, 1.0, k=k, flips=1.0)
    true = mp.acos(1 - mpf(k)) / mp.sqrt(mpf(k))
    assert status[0] in (Status.OK, Status.INACCURATE)
    if status[0] == Status.OK:
        assert relative_error(outputs["time"], [true])[0] < 1e-9


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("excess", [0.0, 1e-15, -1e-15, 1e-13, -1e-13])
def test_a_turning_point_on_the_switch_is_no_quiet_number(method, excess):
    _, status = solve(method, 1.0, 1.0, k=2.0 / (1.0 + excess), flips=1.0)
    assert status[0] in (Status.GRAZING, Status.STEP_LIMIT, Status.INACCURATE)


def braked(mu, phi0, a):
    """Time and speed at the first switch of a foliot with viscous friction."""
    mu, phi0, a = mpf(mu), mpf(phi0), mpf(a)
    time = mp.findroot(lambda t: mu / a * (t + mp.expm1(-a * t) / a) - phi0, phi0 * a / mu)
    return time, -mu / a * mp.expm1(-a * time)


@pytest.mark.parametrize("method", STEPS)
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
