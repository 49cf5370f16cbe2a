"""Half swings by steps and by Taylor series, also of torque that varies: integrals, energy, a foreign Taylor series."""

import numpy as np
import pytest
import ripple_oracles
from columns import bounds, estimated, relative_error, solve

from kernels.foliot.cycle import FOLIOT
from kernels.foliot.ripple import FOLIOT_RIPPLE
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

compiled = pytest.mark.skipif(not COMPILED, reason="a swing takes a second in plain Python")
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


def as_columns(cells):
    names = ("mu", "phi0", "a", "R", "c", "n", "k", "e", "depth", "harmonic")
    plain = {"mu": 1.0, "phi0": 1.0, "a": 0.0, "R": 0.0, "c": 0.0, "n": 2.0, "k": 0.0, "e": 1.0}
    return {name: np.array([(plain | cell)[name] for cell in cells], float) for name in names}


def compare(cells, truths, rtol, method="dopri5", share=0.5):
    """Cells are OK, and right to a share of rtol."""
    outputs, status = solve(FOLIOT_RIPPLE, method, rtol=rtol, **as_columns(cells))
    assert (status == Status.OK).all(), status
    for j, name in enumerate(NAMES):
        error = relative_error(outputs[name], [t[j] for t in truths])
        assert error.max() <= share * rtol, (name, cells[error.argmax()], error.max() / rtol)


def test_ripple_is_right_to_half_of_rtol_where_energy_gives_the_speed():
    cells = BY_ENERGY if COMPILED else BY_ENERGY[:1]
    truths = [ripple_oracles.by_energy(**({"mu": 1.0, "phi0": 1.0} | cell)) for cell in cells]
    for rtol in (1e-3, 1e-6, 1e-9) if COMPILED else (1e-3,):
        compare(cells, truths, rtol)


@compiled
def test_sticking_agrees_with_energy_over_a_grid():
    grid = [(R, depth, h) for R in (0.7, 0.95) for depth in (0.3, 0.8) for h in (2, 3)]
    cells = [{"R": R, "depth": depth, "harmonic": h} for R, depth, h in grid]
    exists = []
    for cell in cells:
        try:
            ripple_oracles.by_energy(1.0, 1.0, **cell)
            exists.append(True)
        except ripple_oracles.NoCycle:
            exists.append(False)
    _, status = solve(FOLIOT_RIPPLE, "dopri5", rtol=1e-4, **as_columns(cells))
    found = [s in (Status.OK, Status.INACCURATE) for s in status]
    assert found == exists, [c for c, f, x in zip(cells, found, exists, strict=True) if f != x]
    assert 0 < sum(exists) < len(exists)


@compiled
@pytest.mark.parametrize("cell", MANY_WAVES)
def test_errors_that_add_up_over_waves_or_hide_each_other_are_told(cell):
    truth = ripple_oracles.by_energy(**cell)
    rtol, cells = np.geomspace(1e-5, 1e-2, 64), as_columns([cell] * 64)
    for name, true in zip(NAMES, truth, strict=True):
        outputs, status, error = estimated(FOLIOT_RIPPLE, "taylor", rtol=rtol, asked=[name], **cells)
        off = relative_error(outputs[name], [true] * len(rtol))
        assert (off <= error)[status == Status.OK].all(), (name, (off / error).max())
        assert (status == Status.OK).mean() > 0.98


EXACT = 1e-12
"""What the exact methods are right to in the cells here, at least."""


def off_by(outputs, truths):
    """The largest relative error of each cell."""
    return np.max([np.abs(outputs[name] / truths[name] - 1.0) for name in NAMES], axis=0)


def compare_exact(kernel, exact, cells, rtol, least):
    """What is called right is; so much of it there must be. No error is larger than is told."""
    truths, _ = solve(kernel, exact, rtol=1e-12, **cells)
    outputs, status, told = estimated(kernel, "taylor", rtol=rtol, **cells)
    good, off = status == Status.OK, off_by(outputs, truths)
    assert good.mean() >= least
    assert (off[good] <= rtol + EXACT).all()
    assert (off[good] <= 10.0 * told[good] + EXACT).all()


@compiled
@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
def test_drag_of_any_degree_from_1_on_is_right_to_rtol(rtol):
    random = np.random.default_rng(5)
    cells = {
        "mu": 10.0 ** random.uniform(-1, 1, 200), "phi0": 10.0 ** random.uniform(-1, 0.5, 200),
        "R": 0.0, "a": 10.0 ** random.uniform(-3, 0, 200), "c": 10.0 ** random.uniform(-2, 0, 200),
        "n": random.uniform(1.0, 4.0, 200), "e": random.uniform(-0.8, 1.0, 200),
    }  # fmt: skip
    compare_exact(FOLIOT, "quadrature", cells, rtol, 0.7)


@compiled
@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
def test_dry_friction_a_hairspring_and_restitution_are_right_to_rtol(rtol):
    random = np.random.default_rng(6)
    cells = {
        "mu": 1.0, "phi0": 1.0, "R": random.uniform(0.0, 0.4, 200), "a": 10.0 ** random.uniform(-2, 0, 200),
        "k": 10.0 ** random.uniform(-2, 0, 200), "e": random.uniform(0.5, 1.0, 200),
    }  # fmt: skip
    compare_exact(FOLIOT, "segments", cells, rtol, 0.9)


@compiled
def test_drag_with_a_hairspring_and_a_torque_that_varies_is_right_to_rtol():
    """By steps to half of it; the oracle takes three seconds."""
    cell = {"mu": 2.0, "phi0": 0.7, "a": 0.3, "R": 0.2, "c": 0.8, "k": 1.0, "e": 0.9, "depth": 0.7, "harmonic": 3}
    truth = ripple_oracles.by_taylor(**cell)
    for rtol in (1e-5, 1e-8, 1e-11):
        compare([cell], [truth], rtol, "taylor", 1.0)
    for rtol in (1e-3, 1e-6, 1e-9):
        compare([cell], [truth], rtol)


@compiled
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
def test_a_torque_that_varies_without_drag_is_right_to_rtol(rtol):
    random = np.random.default_rng(7)
    cells = {
        "mu": 10.0 ** random.uniform(0, 1, 400), "phi0": 1.0, "a": 10.0 ** random.uniform(-1, 0, 400),
        "R": random.uniform(0.0, 0.1, 400), "k": 10.0 ** random.uniform(-3, -1, 400),
        "e": random.uniform(0.3, 1.0, 400), "depth": random.uniform(0.0, 0.5, 400),
        "harmonic": random.integers(1, 9, 400),
    }  # fmt: skip
    compare_exact(FOLIOT_RIPPLE, "dopri5", cells, rtol, 0.95)


@compiled
def test_what_is_stiff_steep_at_rest_or_creeps_is_not_promised_and_not_begun():
    cells = {"mu": 1.0, "phi0": 1.0, "a": [0.1, 20.0, 0.1, 3.0], "c": 0.2, "n": [2.0, 2.0, 0.7, 2.0]}
    cells["k"] = [0.5, 0.5, 0.5, 1.2]
    assert (bounds(FOLIOT, "taylor", **cells) == [0.0, np.inf, np.inf, np.inf]).all()
    _, status = solve(FOLIOT, "taylor", **cells)
    assert status.tolist() == [Status.OK, *[Status.NO_METHOD] * 3]


@compiled
def test_stiction_holds_a_turning_point():
    _, status = solve(FOLIOT, "taylor", 1.0, 1.0, R=0.1, R_s=[0.1, 5.0], c=0.1, n=2.0, k=0.2)
    assert status.tolist() == [Status.OK, Status.STICKS]
