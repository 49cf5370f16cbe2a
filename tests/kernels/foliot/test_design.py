"""Friction and torque from period and amplitude: the foliot they give has them."""

import numpy as np
import oracles
import pytest
from columns import bounds, checked, relative_error, solve
from mpmath import mp, mpf

from kernels.foliot.cycle import FOLIOT
from kernels.foliot.design import FOLIOT_DESIGN
from kernels.interface import Status
from kernels.lanes.jit import COMPILED


def designs(n=300 if COMPILED else 20, seed=5):
    random = np.random.default_rng(seed)
    phi0 = 10 ** random.uniform(-2, 1, n)
    return 10 ** random.uniform(-3, 3, n), phi0 * (1 + 10 ** random.uniform(-9, 9, n)), phi0


def test_the_designed_foliot_has_the_wanted_period_and_amplitude():
    period, amplitude, phi0 = designs()
    found, status = solve(FOLIOT_DESIGN, "newton", period, amplitude, phi0)
    assert (status == Status.OK).all()
    back, _ = solve(FOLIOT, "closed", found["mu"], phi0, found["a"])
    assert np.abs(back["period"] / period - 1).max() < 2e-15
    assert np.abs(back["amplitude"] / amplitude - 1).max() < 2e-15


@pytest.mark.parametrize("amplitude", [1.0, 0.9, 1.0 - 2.0**-53])
def test_an_amplitude_that_does_not_exceed_the_switching_angle_is_refused(amplitude):
    assert checked(FOLIOT_DESIGN, [1.0], [amplitude], [1.0])[0] == Status.BAD_INPUT


@pytest.mark.parametrize(("cell", "missing"), [((1e-300, 2.0, 1.0), "mu"), ((1.7e308, 1.5e308, 5e307), "a")])
def test_where_only_friction_or_only_torque_is_beyond_float64_the_other_is_given(cell, missing):
    outputs, status = solve(FOLIOT_DESIGN, "newton", *([v] for v in cell))
    shape = [cell[1] / cell[2]], [1.0]
    unit, _ = solve(FOLIOT_DESIGN, "newton", [1.0], *shape)
    assert status[0] == Status.PARTLY_OUT_OF_RANGE
    assert np.isnan(outputs[missing][0])
    with mp.workdps(30):
        true = unit["a"][0] / mpf(cell[0]) if missing == "mu" else unit["mu"][0] / mpf(cell[0]) ** 2 * mpf(cell[2])
    assert relative_error(outputs["a" if missing == "mu" else "mu"], [true])[0] < 3e-15


def test_friction_and_torque_are_right_to_1e_15_down_to_overshoots_of_a_few_ulp():
    overshoot = np.concatenate([2.0**-52 * np.array([1, 2, 3, 7, 50]), np.geomspace(1e-14, 1e6, 60 if COMPILED else 5)])
    phi0 = np.full(overshoot.size, 0.7)
    period = np.full(overshoot.size, 1.3)
    amplitude = phi0 + np.maximum(phi0 * overshoot, np.spacing(phi0))
    found, status = solve(FOLIOT_DESIGN, "newton", period, amplitude, phi0)
    assert (status == Status.OK).all()
    truths = [oracles.foliot_design(1.3, *cell) for cell in zip(amplitude, phi0, strict=True)]
    limit = bounds(FOLIOT_DESIGN, "newton", period, amplitude, phi0)
    assert np.all(relative_error(found["a"], [t[0] for t in truths]) <= limit)
    assert np.all(relative_error(found["mu"], [t[1] for t in truths]) <= limit)
