"""Half swings by steps and by Taylor series, also of torque that varies: integrals, energy, a foreign Taylor series."""

import numpy as np
import pytest
import ripple_oracles
from columns import bounds, estimated, named, relative_error, solve

from kernels.foliot.cycle import FOLIOT
from kernels.foliot.ripple import FOLIOT_RIPPLE
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="a swing takes a second in plain Python")
NAMES = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")

BY_ENERGY = [
    {"R": 0.3, "depth": 0.5, "harmonic": 1},
    {"R": 0.3, "depth": 0.5, "harmonic": 3},
    {"R": 0.9, "depth": 0.6, "harmonic": 2},  # a swing that starts faster than the cycle's sticks at its turning point
    {"mu": 2.0, "phi0": 0.7, "R": 0.1, "k": 3.0, "e": 0.8, "depth": 0.9, "harmonic": 2},
    {"mu": 3.0, "phi0": 0.2, "k": 40.0, "e": 0.6, "depth": 0.99, "harmonic": 7},
    {"mu": 0.5, "phi0": 1.5, "R": 0.2, "e": -0.4, "depth": 0.3, "harmonic": 4},
    {"mu": 1.0, "R": 0.2, "e": 0.5, "depth": 0.0, "harmonic": 1},
]

MANY_WAVES = [
    {"mu": 1.9141755747392093, "phi0": 0.010432977027702297, "R": 0.03934459754130002, "depth": 0.429, "harmonic": 4},
    {"mu": 0.017680954108928747, "phi0": 7.972097180461389, "R": 0.004017033171566029, "depth": 0.545, "harmonic": 3},
]
"""A hundred waves a swing, on which errors of steps add up; a sensitivity that hangs on the speed 700-fold."""


def compare(cells, truths, rtol, method="dopri5", share=0.5):
    """Cells are OK, and right to a share of rtol."""
    outputs, status = solve(FOLIOT_RIPPLE, method, rtol=rtol, **named(FOLIOT_RIPPLE, cells))
    assert (status == Status.OK).all(), status
    for j, name in enumerate(NAMES):
        error = relative_error(outputs[name], [t[j] for t in truths])
        assert error.max() <= share * rtol, (name, cells[error.argmax()], error.max() / rtol)


def test_ripple_is_right_to_half_of_rtol_where_energy_gives_the_speed():
    cells = [{"mu": 1.0, "phi0": 1.0} | cell for cell in BY_ENERGY]
    truths = [ripple_oracles.by_energy(**cell) for cell in cells]
    for rtol in (1e-3, 1e-6, 1e-9):
        compare(cells, truths, rtol)


def test_sticking_agrees_with_energy_over_a_grid():
    grid = [(R, depth, h) for R in (0.7, 0.95) for depth in (0.3, 0.8) for h in (2, 3)]
    cells = [{"mu": 1.0, "phi0": 1.0, "R": R, "depth": depth, "harmonic": h} for R, depth, h in grid]
    cells += [{"mu": 1.0, "phi0": 1.0, "R": 1.0 - 2.0**-j, "k": 10.0, "e": 0.6} for j in (13, 20)]  # just reach it
    exists = []
    for cell in cells:
        try:
            ripple_oracles.by_energy(**cell)
            exists.append(True)
        except ripple_oracles.NoCycle:
            exists.append(False)
    _, status = solve(FOLIOT_RIPPLE, "dopri5", rtol=1e-4, **named(FOLIOT_RIPPLE, cells))
    found = [s in (Status.OK, Status.INACCURATE) for s in status]
    assert found == exists, [c for c, f, x in zip(cells, found, exists, strict=True) if f != x]
    assert 0 < sum(exists) < len(exists)


@pytest.mark.parametrize("cell", MANY_WAVES)
def test_errors_that_add_up_over_waves_or_hide_each_other_are_told(cell):
    """The oracle takes four seconds for the first."""
    truth = ripple_oracles.by_energy(**cell)
    rtol, cells = np.geomspace(1e-5, 1e-2, 64), named(FOLIOT_RIPPLE, [cell] * 64)
    for name, true in zip(NAMES, truth, strict=True):
        outputs, status, error = estimated(FOLIOT_RIPPLE, "taylor", rtol=rtol, asked=[name], **cells)
        off = relative_error(outputs[name], [true] * len(rtol))
        assert (off <= error)[status == Status.OK].all(), (name, (off / error).max())
        assert (status == Status.OK).mean() > 0.98


@pytest.mark.parametrize("method", ["taylor", "dopri5"])
def test_what_hangs_on_a_turning_point_among_many_waves_is_right_or_said_to_be_inaccurate(method):
    """Dry friction alone turns it at A = mu/R; the multiplier is J there: (tau(A) - rho)/(tau(A) + rho).

    Hundreds of waves a swing take seconds.
    """
    random, n = np.random.default_rng(1), 500
    depth, rtol = 1.0 - 10.0 ** random.uniform(-3, -1, n), 10.0 ** random.uniform(-3, -2, n)
    rho, harmonic = random.uniform(0.05, 0.8, n) * (1.0 - depth), random.integers(2, 33, n)
    torque = 1.0 + depth * np.cos(harmonic * np.pi * (1.0 - 1.0 / rho) / 2)
    truths = {"multiplier": (torque - rho) / (torque + rho), "amplitude": 1.0 / rho}
    cells = {"mu": 1.0, "phi0": 1.0, "R": rho, "k": 0.0, "depth": depth, "harmonic": harmonic}
    for name, truth in truths.items():
        outputs, status, told = estimated(FOLIOT_RIPPLE, method, rtol=rtol, asked=[name], **cells)
        good = status == Status.OK
        assert good.mean() > 0.15
        assert (np.abs(outputs[name] / truth - 1.0) <= np.minimum(told, rtol))[good].all(), name


EXACT = 1e-12
"""What the exact methods are right to in the cells here, at least."""


def spread(random, low, high, n=200):
    return 10.0 ** random.uniform(low, high, n)


def dragged(random):
    return {
        "mu": spread(random, -1, 1), "phi0": spread(random, -1, 0.5), "R": 0.0, "a": spread(random, -3, 0),
        "c": spread(random, -2, 0), "n": random.uniform(1.0, 4.0, 200), "e": random.uniform(-0.8, 1.0, 200),
    }  # fmt: skip


def sprung(random):
    return {
        "mu": 1.0, "phi0": 1.0, "R": random.uniform(0.0, 0.4, 200), "a": spread(random, -2, 0),
        "k": spread(random, -2, 0), "e": random.uniform(0.5, 1.0, 200),
    }  # fmt: skip


def varied(random):
    return {
        "mu": spread(random, 0, 1, 400), "phi0": 1.0, "a": spread(random, -1, 0, 400),
        "R": random.uniform(0.0, 0.1, 400), "k": spread(random, -3, -1, 400), "e": random.uniform(0.3, 1.0, 400),
        "depth": random.uniform(0.0, 0.5, 400), "harmonic": random.integers(1, 9, 400),
    }  # fmt: skip


@pytest.mark.parametrize("finer", [1.0, 1e-3, 1e-6])
@pytest.mark.parametrize(
    ("kernel", "exact", "cells", "seed", "least", "rtol"),
    [
        (FOLIOT, "quadrature", dragged, 5, 0.7, 1e-4), (FOLIOT, "segments", sprung, 6, 0.9, 1e-4),
        (FOLIOT_RIPPLE, "dopri5", varied, 7, 0.95, 1e-3),
    ],
)  # fmt: skip
def test_what_series_call_right_is_and_no_error_is_larger_than_is_told(kernel, exact, cells, seed, least, rtol, finer):
    """Drag of any degree from 1 on; dry friction, a hairspring and restitution; a torque that varies, without drag."""
    cells, rtol = cells(np.random.default_rng(seed)), rtol * finer
    truths, _ = solve(kernel, exact, rtol=1e-12, **cells)
    outputs, status, told = estimated(kernel, "taylor", rtol=rtol, **cells)
    good = status == Status.OK
    off = np.max([np.abs(outputs[name] / truths[name] - 1.0) for name in NAMES], axis=0)
    assert good.mean() >= least
    assert (off[good] <= rtol + EXACT).all()
    assert (off[good] <= 10.0 * told[good] + EXACT).all()


def test_drag_with_a_hairspring_and_a_torque_that_varies_is_right_to_rtol():
    """By steps to half of it; the oracle takes three seconds."""
    cell = {"mu": 2.0, "phi0": 0.7, "a": 0.3, "R": 0.2, "c": 0.8, "k": 1.0, "e": 0.9, "depth": 0.7, "harmonic": 3}
    truth = ripple_oracles.by_taylor(**cell)
    for rtol in (1e-5, 1e-8, 1e-11):
        compare([cell | {"n": 2.0}], [truth], rtol, "taylor", 1.0)
    for rtol in (1e-3, 1e-6, 1e-9):
        compare([cell | {"n": 2.0}], [truth], rtol)


def test_what_is_stiff_steep_at_rest_or_creeps_is_not_promised_and_not_begun():
    cells = {"mu": 1.0, "phi0": 1.0, "a": [0.1, 20.0, 0.1, 3.0], "c": 0.2, "n": [2.0, 2.0, 0.7, 2.0]}
    cells["k"] = [0.5, 0.5, 0.5, 1.2]
    assert (bounds(FOLIOT, "taylor", **cells) == [0.0, np.inf, np.inf, np.inf]).all()
    _, status = solve(FOLIOT, "taylor", **cells)
    assert status.tolist() == [Status.OK, *[Status.NO_METHOD] * 3]


def test_stiction_holds_a_turning_point():
    _, status = solve(FOLIOT, "taylor", 1.0, 1.0, R=0.1, R_s=[0.1, 5.0], c=0.1, n=2.0, k=0.2)
    assert status.tolist() == [Status.OK, Status.STICKS]
