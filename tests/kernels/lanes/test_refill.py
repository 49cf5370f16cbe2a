"""Lanes that are refilled give each cell the bits that it has alone."""

import numpy as np
import pytest
from columns import solve
from rich_scene import RICH

from kernels.interface import Status
from kernels.lanes.jit import COMPILED

NAMES = ("time", "interval", "angle", "speed")
CELLS = 131 if COMPILED else 3


def uneven(n=CELLS):
    """Cells of 1 to 400 switches, some of which stick, start behind the switch or swing for good."""
    random = np.random.default_rng(5)
    mu, a, c = (10.0 ** random.uniform(-1, 1, n) for _ in range(3))
    R = np.where(np.arange(n) % 7 == 3, 2 * mu, 0.1 * mu)
    angle0 = np.where(np.arange(n) % 11 == 5, 3.0, 0.0)
    flips = np.floor(10.0 ** random.uniform(0, 2.6 if COMPILED else 0.5, n))
    return {"mu": mu, "phi0": 1.0 + 0.0 * mu, "a": a, "c": c, "R": R, "angle0": angle0, "flips": flips}


def test_a_cell_has_the_same_bits_alone_and_in_any_company():
    columns = uneven()
    together, status = solve(RICH, "taylor", rtol=1e-9, **columns)
    order = np.random.default_rng(2).permutation(CELLS)
    shuffled, verdicts = solve(RICH, "taylor", rtol=1e-9, **{name: c[order] for name, c in columns.items()})
    assert np.array_equal(verdicts, status[order])
    for name in NAMES:
        assert np.array_equal(shuffled[name], together[name][order], equal_nan=True)
    for i in range(0, CELLS, 9):
        alone, verdict = solve(RICH, "taylor", rtol=1e-9, **{name: c[i : i + 1] for name, c in columns.items()})
        assert verdict[0] == status[i]
        for name in NAMES:
            assert np.array_equal(alone[name], together[name][i : i + 1], equal_nan=True), (name, i)


def test_every_cell_is_solved_and_the_tolerance_of_one_does_not_touch_another():
    columns = uneven()
    rtol = np.where(np.arange(CELLS) % 2, 1e-7, 1e-9)
    mixed, status = solve(RICH, "taylor_once", rtol=rtol, **columns)
    assert (status < 99).all()
    for each in (1e-7, 1e-9):
        alone, _ = solve(RICH, "taylor_once", rtol=each, **columns)
        for name in NAMES:
            assert np.array_equal(alone[name][rtol == each], mixed[name][rtol == each], equal_nan=True)


@pytest.mark.parametrize("method", ["taylor_once", "dop853"])
def test_a_number_of_switches_that_is_none_is_refused_and_ends(method):
    flips = np.array([np.nan, np.inf, 0.0, -3.0, 2.0])
    _, status = solve(RICH, method, 1.0, 1.0, 0.3, 0.2, R=0.1, flips=flips)
    assert status.tolist() == [Status.BAD_INPUT] * 4 + [Status.OK]
