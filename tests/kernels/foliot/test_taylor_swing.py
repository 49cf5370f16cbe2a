"""Half swings by Taylor series against integrals, exact pieces, energy and a foreign Taylor series."""

import numpy as np
import pytest
import ripple_oracles
from columns import bounds, estimated, relative_error, solve

from kernels.foliot.cycle import FOLIOT
from kernels.foliot.ripple import FOLIOT_RIPPLE
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="a swing takes a second in plain Python")
NAMES = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
EXACT = 1e-12
"""What the exact methods are right to in the cells here, at least."""


def off_by(outputs, truths):
    """The largest relative error of each cell."""
    return np.max([np.abs(outputs[name] / truths[name] - 1.0) for name in NAMES], axis=0)


def compare(kernel, exact, cells, rtol, least):
    """What is called right is; so much of it there must be. No error is larger than is told."""
    truths, _ = solve(kernel, exact, rtol=1e-12, **cells)
    outputs, status, told = estimated(kernel, "taylor", rtol=rtol, **cells)
    good, off = status == Status.OK, off_by(outputs, truths)
    assert good.mean() >= least
    assert (off[good] <= rtol + EXACT).all()
    assert (off[good] <= 10.0 * told[good] + EXACT).all()


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
def test_drag_of_any_degree_from_1_on_is_right_to_rtol(rtol):
    random = np.random.default_rng(5)
    cells = {
        "mu": 10.0 ** random.uniform(-1, 1, 200), "phi0": 10.0 ** random.uniform(-1, 0.5, 200),
        "R": 0.0, "a": 10.0 ** random.uniform(-3, 0, 200), "c": 10.0 ** random.uniform(-2, 0, 200),
        "n": random.uniform(1.0, 4.0, 200), "e": random.uniform(-0.8, 1.0, 200),
    }  # fmt: skip
    compare(FOLIOT, "quadrature", cells, rtol, 0.7)


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
def test_dry_friction_a_hairspring_and_restitution_are_right_to_rtol(rtol):
    random = np.random.default_rng(6)
    cells = {
        "mu": 1.0, "phi0": 1.0, "R": random.uniform(0.0, 0.4, 200), "a": 10.0 ** random.uniform(-2, 0, 200),
        "k": 10.0 ** random.uniform(-2, 0, 200), "e": random.uniform(0.5, 1.0, 200),
    }  # fmt: skip
    compare(FOLIOT, "segments", cells, rtol, 0.9)


def test_drag_with_a_hairspring_and_a_torque_that_varies_is_right_to_rtol():
    """By steps to half of it; the oracle takes three seconds."""
    cell = {"mu": 2.0, "phi0": 0.7, "a": 0.3, "R": 0.2, "c": 0.8, "k": 1.0, "e": 0.9, "depth": 0.7, "harmonic": 3}
    truth = ripple_oracles.by_taylor(**cell)
    for rtol in (1e-5, 1e-8, 1e-11):
        outputs, status, _ = estimated(FOLIOT_RIPPLE, "taylor", rtol=rtol, **cell | {"mu": [2.0], "n": 2.0})
        assert status[0] == Status.OK
        for name, true in zip(NAMES, truth, strict=True):
            assert relative_error(outputs[name], [true])[0] <= rtol
    for rtol in (1e-3, 1e-6, 1e-9):
        outputs, status = solve(FOLIOT_RIPPLE, "dopri5", rtol=rtol, **cell | {"mu": [2.0], "n": 2.0})
        assert status[0] == Status.OK
        for name, true in zip(NAMES, truth, strict=True):
            assert relative_error(outputs[name], [true])[0] <= 0.5 * rtol


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
def test_a_torque_that_varies_without_drag_is_right_to_rtol(rtol):
    random = np.random.default_rng(7)
    cells = {
        "mu": 10.0 ** random.uniform(0, 1, 400), "phi0": 1.0, "a": 10.0 ** random.uniform(-1, 0, 400),
        "R": random.uniform(0.0, 0.1, 400), "k": 10.0 ** random.uniform(-3, -1, 400),
        "e": random.uniform(0.3, 1.0, 400), "depth": random.uniform(0.0, 0.5, 400),
        "harmonic": random.integers(1, 9, 400),
    }  # fmt: skip
    compare(FOLIOT_RIPPLE, "dopri5", cells, rtol, 0.95)


def test_what_is_stiff_steep_at_rest_or_creeps_is_not_promised_and_not_begun():
    cells = {"mu": 1.0, "phi0": 1.0, "a": [0.1, 20.0, 0.1, 3.0], "c": 0.2, "n": [2.0, 2.0, 0.7, 2.0]}
    cells["k"] = [0.5, 0.5, 0.5, 1.2]
    assert (bounds(FOLIOT, "taylor", **cells) == [0.0, np.inf, np.inf, np.inf]).all()
    _, status = solve(FOLIOT, "taylor", **cells)
    assert status.tolist() == [Status.OK, *[Status.NO_METHOD] * 3]


def test_stiction_holds_a_turning_point():
    _, status = solve(FOLIOT, "taylor", 1.0, 1.0, R=0.1, R_s=[0.1, 5.0], c=0.1, n=2.0, k=0.2)
    assert status.tolist() == [Status.OK, Status.STICKS]
