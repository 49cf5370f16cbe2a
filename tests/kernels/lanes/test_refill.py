"""Lanes that are refilled give each cell the bits that it has alone."""

import numpy as np
import pytest
from columns import solve
from rich_scene import RICH

from kernels.codegen import followed_twice
from kernels.codegen.followed_twice import followed
from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.lanes.refill import DONE, FRESH, MOVING

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


class _Counted:
    """A module that only counts switches, one at a time, and remembers in what state cells come to it."""

    STATES = ("x",)
    ROWS = ("stage", "flips", "tolerance", "time", "interval", "at_x", "size_x", "verdict", "count", "steps", "before")

    def __init__(self):
        self.runs = []

    def run(self, cells, together):
        stage, flips, tolerance, time, *_, verdict, count, steps, before = cells.T
        self.runs.append((len(cells), set(stage), together, steps.tolist()))
        fresh = stage == FRESH
        count[fresh] = time[fresh] = verdict[fresh] = 0.0
        refused = (tolerance == 3e-7) & (flips > 1)  # behind the second switch
        end = np.where(refused, 2.0, flips)
        time += (end - count) * tolerance * 2.0**20
        verdict[refused], count[:], before[:], stage[:] = Status.OUT_OF_RANGE, end, steps, DONE
        steps[:] = tolerance * 1e7

    run_12 = run_18 = run


def test_cells_are_stopped_behind_two_switches_and_four_put_in_order_and_go_on_where_they_were():
    module, flips = _Counted(), np.array([1.0, 9.0, 2.0, 7.0, 4.0, 3.0, 5.0, 6.0])
    rtol = np.array([1e-7, 9e-7, 2e-7, 7e-7, 4e-7, 3e-7, 5e-7, 1e-7])
    results = followed(module, [flips], rtol)
    assert [(n, stages) for n, stages, _, _ in module.runs] == [(8, {FRESH}), (5, {MOVING}), (4, {MOVING})]
    assert module.runs[1][3] == sorted(module.runs[1][3])
    refused = rtol == 3e-7
    np.testing.assert_allclose(results[0][~refused], (flips * rtol * 2.0**20)[~refused], rtol=1e-14)
    assert np.array_equal(results[-1], np.where(refused, Status.OUT_OF_RANGE, Status.OK))
    followed(module, [flips], rtol, together=True)
    assert [(n, together) for n, _, together, _ in module.runs[3:]] == [(8, True)]


def test_what_is_followed_piece_by_piece_comes_back_in_its_place(monkeypatch):
    flips, rtol = np.arange(1.0, 12.0), np.geomspace(1e-8, 1e-11, 11)
    together = followed(_Counted(), [flips], rtol)
    monkeypatch.setattr(followed_twice, "AT_ONCE", 3)
    module = _Counted()
    assert np.array_equal(followed(module, [flips], rtol), together, equal_nan=True)
    assert max(n for n, *_ in module.runs) == 3
    np.testing.assert_allclose(together[0], flips * rtol * 2.0**20, rtol=1e-14)
