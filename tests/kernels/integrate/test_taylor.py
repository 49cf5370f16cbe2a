"""The Taylor method against closed forms in 40 digits, and where it must refuse."""

import numpy as np
import pytest
import scene_oracles as oracles
from columns import columns_of, relative_error
from columns import solve as solve_columns
from rich_scene import RICH

from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED

SOME = 24 if COMPILED else 2
FLIPS = 40.0 if COMPILED else 4.0


def solve(kernel, method, *parameters, rtol=1e-9, **named):
    """Of one cell, too."""
    columns = [np.atleast_1d(c) for c in columns_of(kernel, parameters, named)]
    return solve_columns(kernel, method, *columns, rtol=rtol)


def drags(n=SOME, decades=1.0):
    """mu, phi0, a, c of foliots with viscous and quadratic drag."""
    random = np.random.default_rng(7)
    return tuple(10.0 ** random.uniform(-decades, decades, n) for _ in range(4))


def worst(outputs, columns, flips=FLIPS):
    truths = [oracles.quadratic_foliot(*cell, int(flips)) for cell in zip(*columns, strict=True)]
    return max(
        relative_error(outputs["time"], [t for t, _ in truths]).max(),
        relative_error(abs(outputs["speed"]), [v for _, v in truths]).max(),
    )


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12] if COMPILED else [1e-9, 1e-12])
def test_a_foliot_with_quadratic_drag_is_right_to_the_tolerance(rtol):
    mu, phi0, a, c = columns = drags()
    outputs, status = solve(RICH, "taylor", mu, phi0, a, c, flips=FLIPS, rtol=rtol)
    assert (status == Status.OK).all()
    assert worst(outputs, columns) < rtol
    np.testing.assert_allclose(abs(outputs["angle"]), phi0, rtol=1e-14 + 1e-3 * rtol)


def test_followed_once_it_is_right_to_some_tolerances_and_follows_the_tolerance():
    mu, phi0, a, c = columns = drags()
    errors = []
    for rtol in (1e-5, 1e-7, 1e-9):
        outputs, status = solve(RICH, "taylor_once", mu, phi0, a, c, flips=FLIPS, rtol=rtol)
        assert (status == Status.OK).all()
        errors.append(worst(outputs, columns))
        assert errors[-1] < 20 * rtol
    if COMPILED:
        assert errors[2] < 1e-3 * errors[0]


@pytest.mark.parametrize(
    ("cell", "status"),
    [
        ({"mu": 1.0, "phi0": 1.0, "R": 1.5}, Status.STICKS),
        ({"mu": 1.0, "phi0": 1.0, "R": 1.0}, Status.STICKS),
        ({"mu": 1.0, "phi0": 1.0, "e": 0.0, "angle0": 0.5}, Status.OK),
        ({"mu": 0.0, "phi0": 1.0}, Status.STICKS),
        ({"mu": 1.0, "phi0": 1.0, "k": 4.0, "a": 0.1, "c": 0.1}, Status.STEP_LIMIT),  # swings below the switch for good
        ({"mu": 1.0, "phi0": 1.0, "angle0": 2.0}, Status.OUT_OF_RANGE),  # behind the switch, and goes away from it
        ({"mu": 1.0, "phi0": 1.0, "angle0": 2.0, "k": 4.0}, Status.OK),  # comes up first
        ({"mu": 1e140, "phi0": 1e140, "a": 1e-3}, Status.OK),
        ({"mu": 1e-140, "phi0": 1e-140, "a": 0.5}, Status.OK),
        ({"mu": 1.0, "phi0": 1e-80}, Status.OK),
        ({"mu": 1e300, "phi0": 1e300, "a": 1e-3}, Status.OUT_OF_RANGE),  # the drag, though c = 0
        ({"mu": 1e-300, "phi0": 1e-300, "a": 0.5}, Status.OUT_OF_RANGE),
        ({"mu": 1e200, "phi0": 1e200, "c": 1e-200}, Status.OUT_OF_RANGE),
        ({"mu": 1e-200, "phi0": 1e-200, "c": 1e200}, Status.OUT_OF_RANGE),
        ({"mu": 1.0, "phi0": 1.0, "a": 1e9}, Status.STEP_LIMIT),
    ],
)
def test_what_a_cell_comes_to_is_named(cell, status):
    if not COMPILED and status in (Status.STEP_LIMIT, Status.GRAZING):
        pytest.skip("thousands of steps")
    outputs, verdict = solve(RICH, "taylor", flips=3.0, rtol=1e-9, **cell)
    assert verdict[0] == status
    if status >= FIRST_REFUSAL:
        return
    assert np.isfinite([outputs[name][0] for name in outputs]).all()


def test_a_start_on_the_switch_moves_away_or_switches_at_once():
    mu, phi0 = [1.0, 1.0], [1.0, 1.0]
    outputs, status = solve(RICH, "taylor", mu, phi0, angle0=1.0, speed0=[-1.0, 1.0], flips=[1.0, 2.0])
    assert (status == Status.OK).all()
    assert outputs["time"][0] == pytest.approx(2.0, rel=1e-12)  # thrown back against the drive, and home again
    # switched at 0, it then turns at 1 + 1/2 and falls 2.5
    assert outputs["time"][1] == pytest.approx(1.0 + np.sqrt(5.0), rel=1e-12)


@pytest.mark.skipif(not COMPILED, reason="thousands of steps")
def test_kinks_are_limited_between_two_switches_and_not_in_all():
    outputs, status = solve(RICH, "taylor_once", 1.0, 1.0, a=0.3, flips=1200.0)
    assert status[0] == Status.OK
    assert outputs["time"][0] == pytest.approx(1200.0 * outputs["interval"][0], rel=3e-3)


@pytest.mark.parametrize("flips", [1.0, 2.0, 12.0])
def test_a_switch_is_found_to_the_last_digits_however_long_the_steps(flips):
    if not COMPILED:
        flips = min(flips, 2.0)
    outputs, status = solve(RICH, "taylor_once", [7.5e-4, 1.0, 3.0], [1e30, 1.0, 1e-6], flips=flips, rtol=1e-8)
    assert (status == Status.OK).all()
    np.testing.assert_allclose(abs(outputs["angle"]), [1e30, 1.0, 1e-6], rtol=1e-11)


def test_over_decades_of_cells_what_is_not_remarked_is_right():
    mu, phi0, a, c = drags(400, decades=5.0) if COMPILED else drags(2)
    outputs, status = solve(RICH, "taylor", mu, phi0, a, c, flips=5.0, rtol=1e-8)
    fine = np.flatnonzero(status == Status.OK)
    assert len(fine) > 0.3 * len(status)
    for i in fine[:: 10 if COMPILED else 1]:
        time, speed = oracles.quadratic_foliot(mu[i], phi0[i], a[i], c[i], 5, digits=70)
        assert relative_error(outputs["time"][[i]], [time])[0] < 1e-8
        assert relative_error(abs(outputs["speed"][[i]]), [speed])[0] < 1e-8


def test_what_rounding_leaves_less_than_wanted_is_said_to_be_inaccurate():
    mu, phi0, a, c = drags()
    _, status = solve(RICH, "taylor", mu, phi0, a, c, flips=FLIPS, rtol=1e-17)
    assert (status == Status.INACCURATE).all()
