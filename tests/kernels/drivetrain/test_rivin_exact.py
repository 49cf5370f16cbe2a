"""Frequencies of the chain whose masses and springs depend on the frequency, against 50 digits."""

import numpy as np
import pytest
import reduction_oracles as oracles
from columns import relative_error, solve

from kernels.drivetrain.reduced import DRIVETRAIN, REDUCTIONS
from kernels.interface import Status
from kernels.lanes.jit import COMPILED


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
