"""Drag whose slope is not smooth at rest: what `dopri5` calls OK is right, whatever the degree."""

import foliot_oracles
import numpy as np
import pytest
from columns import estimated, relative_error, solve

from kernels.foliot._swing_law import Law, Leg, Power, Ripple, Scales, Terms
from kernels.foliot._turning import longest
from kernels.foliot.cycle import FOLIOT
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

NAMES = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
CELLS = (
    (1.32e-4, {"mu": 0.334, "phi0": 0.111, "c": 0.000814, "n": 0.162, "R": 0.14}),
    (6e-4, {"mu": 3.892, "phi0": 0.3829, "c": 0.00961, "n": 0.1096, "R": 0.3929, "a": 0.009747}),
    (3.5e-4, {"mu": 7.461, "phi0": 1.643, "c": 0.008332, "n": 0.1329, "R": 1.23}),
    (1.52e-5, {"mu": 2.91, "phi0": 2.5, "c": 0.00295, "n": 0.344, "e": 0.0974}),
    (4.9e-4, {"mu": 6.342, "phi0": 0.2295, "c": 0.008921, "n": 1.099, "R": 0.5546}),
    (5.85e-5, {"mu": 0.247, "phi0": 9.13, "c": 0.000303, "n": 2.13, "R": 0.0332}),
    (6.99e-8, {"mu": 0.45, "phi0": 0.144, "c": 0.161, "n": 2.4, "R": 0.0871}),
    (1.31e-8, {"mu": 1.47, "phi0": 0.759, "c": 0.00175, "n": 2.51, "a": 0.072}),
    (5.89e-8, {"mu": 0.38, "phi0": 0.459, "c": 0.00803, "n": 3.28, "R": 0.113, "a": 0.00501}),
    (1e-4, {"mu": 1.0, "phi0": 1.0, "c": 0.5, "n": 0.1, "e": 1e-13}),
    (1e-4, {"mu": 1.0, "phi0": 1.0, "c": 0.5, "n": 0.1, "e": -1e-13}),
)
"""rtol and terms; before rest was passed without a step, errors were 1 to 1000 rtol."""
SPRUNG = (
    (8.84e-8, {"mu": 3.02, "phi0": 2.24, "c": 0.00125, "n": 1.07, "R": 1.24, "k": 0.00234, "e": 0.922}),
    (9.12e-7, {"mu": 0.118, "phi0": 0.167, "c": 0.00741, "n": 2.05, "R": 0.0206, "k": 0.0205}),
    (6.29e-9, {"mu": 0.736, "phi0": 0.385, "c": 0.00645, "n": 3.11, "R": 0.0993, "a": 0.0729, "k": 0.0135}),
)


@pytest.mark.parametrize(("rtol", "cell"), CELLS if COMPILED else CELLS[:1])
def test_a_cell_that_is_called_ok_is_right_to_rtol(rtol, cell):
    found, status = solve(FOLIOT, "dopri5", rtol=rtol, **{name: [value] for name, value in cell.items()})
    assert status[0] == Status.OK
    truth = foliot_oracles.cycle(**cell, digits=20)
    errors = relative_error([found[name][0] for name in NAMES], truth)
    assert errors.max() <= 0.5 * rtol, dict(zip(NAMES, errors / rtol, strict=True))


@pytest.mark.skipif(not COMPILED, reason="the finest tolerances in plain Python")
@pytest.mark.parametrize(("rtol", "cell"), SPRUNG)
def test_with_a_hairspring_it_is_what_taylor_gives(rtol, cell):
    columns = {name: [value] for name, value in cell.items()}
    true, _, error = estimated(FOLIOT, "taylor", rtol=1e-13, **columns)
    assert error[0] < 0.01 * rtol
    found, status = solve(FOLIOT, "dopri5", rtol=rtol, **columns)
    assert status[0] == Status.OK
    assert max(abs(found[name][0] / true[name][0] - 1.0) for name in NAMES) <= 0.5 * rtol


@pytest.mark.skipif(not COMPILED, reason="thousands of cells")
@pytest.mark.parametrize("degrees", [(0.1, 1.0), (1.0, 2.0), (2.0, 4.0)])
def test_no_cell_of_many_is_called_ok_and_off_by_more_than_rtol(degrees):
    random, n = np.random.default_rng(3), 4000
    cells = {
        "mu": 1.0, "phi0": 1.0, "c": 10.0 ** random.uniform(-3, 1, n), "n": random.uniform(*degrees, n),
        "R": random.uniform(0.0, 0.9, n) * (random.random(n) < 0.5), "e": np.where(random.random(n) < 0.5, 1.0, 0.5),
    }  # fmt: skip
    rtol = 10.0 ** random.uniform(-8, -3, n)
    true, sure = solve(FOLIOT, "quadrature", rtol=1e-13, **cells)
    found, status = solve(FOLIOT, "dopri5", rtol=rtol, **cells)
    judged = (status == Status.OK) & (sure == Status.OK)
    assert judged.mean() > 0.8
    for name in NAMES:
        there = judged & (true[name] > 1e-300)
        error = np.abs(found[name][there] / true[name][there] - 1.0) / rtol[there]
        assert error.max() <= 1.0, (name, error.max())


@pytest.mark.parametrize(("v", "acceleration", "most"), [(2.0, -4.0, 0.4), (-2.0, -4.0, 1.5), (1e-9, -4.0, 2.5e-4)])
def test_a_step_is_a_share_of_the_time_to_rest_or_since(v, acceleration, most):
    terms = Terms(0.0, Power(1.0, 1.5, 0.0), 0.0, Ripple(0.0, 0.0), Scales(1.0, 1.0, 1.0))
    state = (1.0, v, 0.0, 0.0, 0.0, 1.0, 0.0)
    for slow, expected in ((1e-3, most), (0.0, np.inf)):
        assert longest(state, acceleration, Law(Leg(1.0, 1.0, np.inf, 0.0, 0.0, slow), terms)) == pytest.approx(
            expected
        )
