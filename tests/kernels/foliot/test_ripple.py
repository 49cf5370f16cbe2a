"""The foliot with torque that varies over the swing, against energy; with drag, see `test_taylor_swing`."""

import numpy as np
import pytest
import ripple_oracles
from columns import estimated, relative_error, solve

from kernels.foliot.ripple import FOLIOT_RIPPLE
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

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


def compare(cells, truths, rtol):
    outputs, status = solve(FOLIOT_RIPPLE, "dopri5", rtol=rtol, **as_columns(cells))
    assert (status == Status.OK).all(), status
    for j, name in enumerate(NAMES):
        error = relative_error(outputs[name], [t[j] for t in truths])
        assert error.max() <= 0.5 * rtol, (name, cells[error.argmax()], error.max() / rtol)


def test_ripple_is_right_to_half_of_rtol_where_energy_gives_the_speed():
    cells = BY_ENERGY if COMPILED else BY_ENERGY[:1]
    truths = [ripple_oracles.by_energy(**({"mu": 1.0, "phi0": 1.0} | cell)) for cell in cells]
    for rtol in (1e-3, 1e-6, 1e-9) if COMPILED else (1e-3,):
        compare(cells, truths, rtol)


def test_under_dry_friction_alone_the_amplitude_knows_nothing_of_the_ripple():
    depth = np.array([0.0, 0.3, 0.6] if COMPILED else [0.6])
    rtol = 1e-6 if COMPILED else 1e-3
    for harmonic in (1.0, 2.0, 5.0) if COMPILED else (2.0,):
        outputs, status = solve(FOLIOT_RIPPLE, "dopri5", 1.0, 1.0, R=0.25, depth=depth, harmonic=harmonic, rtol=rtol)
        assert (status == Status.OK).all()
        assert np.allclose(outputs["amplitude"], 4.0, rtol=rtol)


@pytest.mark.skipif(not COMPILED, reason="the oracle alone takes two seconds")
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


@pytest.mark.skipif(not COMPILED, reason="hundreds of cycles of a hundred waves each")
@pytest.mark.parametrize("cell", MANY_WAVES)
def test_errors_that_add_up_over_waves_or_hide_each_other_are_told(cell):
    truth = ripple_oracles.by_energy(**cell)
    rtol, cells = np.geomspace(1e-5, 1e-2, 64), as_columns([cell] * 64)
    for name, true in zip(NAMES, truth, strict=True):
        outputs, status, error = estimated(FOLIOT_RIPPLE, "taylor", rtol=rtol, asked=[name], **cells)
        off = relative_error(outputs[name], [true] * len(rtol))
        assert (off <= error)[status == Status.OK].all(), (name, (off / error).max())
        assert (status == Status.OK).mean() > 0.98
