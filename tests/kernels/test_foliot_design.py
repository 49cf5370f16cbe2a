"""Friction and torque from period and amplitude: the foliot they give has them."""

import numpy as np
import pytest
from columns import checked, solve

from kernels.foliot import FOLIOT
from kernels.foliot_design import FOLIOT_DESIGN
from kernels.interface import Status


def designs(n=300, seed=5):
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


def test_it_finds_the_foliot_that_was_there_to_what_the_overshoot_allows():
    alpha = np.geomspace(1e-6, 1e12, 200)
    made, _ = solve(FOLIOT, "closed", alpha, np.ones(200), np.ones(200))
    found, _ = solve(FOLIOT_DESIGN, "newton", made["period"], made["amplitude"], np.ones(200))
    allowed = 4e-15 * made["amplitude"] / (made["amplitude"] - 1)
    assert np.all(np.abs(found["mu"] / alpha - 1) < allowed)
    assert np.all(np.abs(found["a"] - 1) < allowed)


@pytest.mark.parametrize("amplitude", [1.0, 0.9, np.nan, np.inf, -1.0, 0.0])
def test_an_amplitude_that_does_not_exceed_the_switching_angle_is_refused(amplitude):
    assert checked(FOLIOT_DESIGN, [1.0], [amplitude], [1.0])[0] == Status.BAD_INPUT


def test_results_beyond_float64_are_out_of_range():
    _, status = solve(FOLIOT_DESIGN, "newton", [1e-300, 1.0], [2.0, 1e150], [1.0, 1.0])
    assert status.tolist() == [Status.OUT_OF_RANGE, Status.OUT_OF_RANGE]
