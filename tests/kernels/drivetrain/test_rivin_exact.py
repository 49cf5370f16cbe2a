"""Frequencies of the chain whose masses and springs depend on the frequency, against 50 digits."""

import numpy as np
import pytest
import reduction_oracles as oracles
from columns import relative_error, solve

from kernels.drivetrain._rivin_exact import count_below
from kernels.drivetrain._rivin_merging import TYPE_A, TYPE_B
from kernels.drivetrain.reduced import DRIVETRAIN, REDUCTIONS
from kernels.interface import Status
from kernels.lanes.jit import COMPILED


@pytest.fixture(autouse=True)
def as_in_a_kernel():
    """Compiled code says nothing of infinities on its way."""
    with np.errstate(all="ignore"):
        yield


def chain(seed, n, decades, free=False):
    """J and k over so many decades."""
    random = np.random.default_rng(seed)
    J, k = 10 ** random.uniform(0, decades, n), 10 ** random.uniform(0, decades, n)
    k[-1] *= 0.0 if free else 1.0
    return J, k


def exact(J, k, n_keep, rtol=1e-9):
    """Outputs of one cell, and its status."""
    outputs, status = solve(
        DRIVETRAIN, "direct", [J], [k], [0.0 * k], rtol=rtol, reduction=[REDUCTIONS["exact"]], n_keep=[n_keep]
    )
    return outputs, Status(status[0])


def counted(J, k, steps, frequency):
    """How many frequencies are below one [Hz], by the chain that those steps leave."""
    n, kinds, places = len(J), np.full(len(J), np.nan), np.full(len(J), np.nan)
    for i, (kind, place) in enumerate(steps):
        kinds[i], places[i] = {"a": TYPE_A, "b": TYPE_B}[kind], place
    w, rooms = 2 * np.pi * frequency, (np.full(2 * n, np.nan), np.full(2 * n, np.nan))
    return count_below(w, J, k, kinds, places, n - len(steps), *rooms)[0]


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("seed", [0, 1, 2, 3] if COMPILED else [0])
def test_the_masses_that_are_left_know_how_many_frequencies_are_below_any(seed, free):
    n = 6 if COMPILED else 4
    J, k = chain(seed, n, 2.0, free)
    around, counts = [], []
    for j, f in enumerate(oracles.chain_frequencies(J, k)):
        if j > 0 or not free:
            around += [float(f) * (1 - 1e-9), float(f) * (1 + 1e-9)]
            counts += [j, j + 1]
    for way in ("ab", "ba", "aaa", "bbb"):
        at = {"a": [1, 2, 1], "b": [0, 1, 0]}
        steps = [(kind, at[kind][i]) for i, kind in enumerate(way)]
        assert [counted(J, k, steps, f) for f in around] == counts
    steps = [("a", n - 1), ("b", n - 3)]  # at the ground
    assert [counted(J, k, steps, f) for f in around] == counts


@pytest.mark.parametrize(
    ("seed", "n", "decades"), [(1, 2, 3), (2, 7, 6), (3, 8, 12), (4, 12, 2)] if COMPILED else [(1, 3, 6)]
)
def test_all_frequencies_are_those_of_the_full_chain_to_a_few_ulp(seed, n, decades):
    for free in (False, True):
        J, k = chain(seed, n, decades, free)
        truth = oracles.chain_frequencies(J, k)
        for n_keep in {1, n // 2, n - 1}:
            outputs, status = exact(J, k, n_keep)
            found = outputs["frequency"][0]
            assert status == Status.OK
            assert found[0] == 0.0 if free else True
            assert relative_error(found[free:], truth[free:]).max() < 3e-15
            assert abs(outputs["frequency_error"][0]).max() < 5e-15


@pytest.mark.skipif(not COMPILED, reason="long in plain Python")
def test_sixty_four_masses_have_their_frequencies_from_one():
    J, k = chain(5, 64, 4.0)
    outputs, status = exact(J, k, 1, 1e-12)
    assert status == Status.OK
    assert 0 < abs(outputs["frequency_error"][0]).max() < 1e-14  # found in another way than those of the full chain


def test_where_a_partial_system_stands_still_in_a_mode_twelve_digits_are_left_or_the_cell_says_so():
    """Equal masses and springs, free: mass 4 rests in a mode of its own partial frequency."""
    n = 8
    J, k = np.ones(n), np.ones(n)
    k[-1] = 0.0
    truth = oracles.chain_frequencies(J, k)
    for n_keep in range(1, n) if COMPILED else (1,):
        outputs, status = exact(J, k, n_keep)
        assert status == Status.OK
        error = relative_error(outputs["frequency"][0, 1:], truth[1:]).max()
        assert error < 1e-11
        for rtol in (1e-11, 1e-12, 1e-13) if COMPILED else (1e-12,):
            assert error <= rtol or exact(J, k, n_keep, rtol)[1] == Status.INACCURATE
    assert exact(J, k, 1, 1e-16)[1] == Status.INACCURATE
