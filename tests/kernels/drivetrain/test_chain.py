"""Frequencies and damping of whole chains against 50 digits and more, over any spread, and against their own laws."""

import chain_oracles as oracles
import numpy as np
import pytest
import reduction_oracles
from columns import checked, relative_error, solve
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

from kernels.drivetrain.receptance import MILLING_MACHINE
from kernels.drivetrain.reduced import DRIVETRAIN
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

FEW = 12 if COMPILED else 2


def solved(J, k, h=0.0, rtol=1e-9):
    """Frequencies, damping and status of chains, a row each."""
    J, k, h = np.broadcast_arrays(*(np.atleast_2d(np.asarray(values, float)) for values in (J, k, h)))
    outputs, status = solve(DRIVETRAIN, "direct", J, k, h, reduction=0.0, rtol=rtol)
    return outputs["frequency"], outputs["damping"], status


def chains(kind, n, cells, seed=1):
    """J and k of random chains, (cells, n)."""
    random = np.random.default_rng(seed)

    def spread(decades):
        return 10 ** random.uniform(-decades / 2, decades / 2, (cells, n))

    def graded(decades):
        return np.sort(spread(decades), axis=1)

    def twice():  # two equal chains, joined by next to nothing
        J, k = (np.tile(10 ** random.uniform(-1, 1, (cells, n // 2)), 2) for _ in range(2))
        k[:, n // 2 - 1] *= 10 ** random.uniform(-40, -6, cells)
        return J, k

    return {
        "plain": lambda: (spread(2), spread(2)),
        "12 decades": lambda: (spread(12), spread(12)),
        "80 decades": lambda: (spread(80), spread(80)),
        "rising": lambda: (graded(12), graded(12)),
        "falling": lambda: (graded(12)[:, ::-1].copy(), spread(0)),
        "steps": lambda: (np.ones((cells, n)), 10.0 ** random.choice([-6, 0, 6], (cells, n))),
        "twins": twice,
        "units": lambda: (10 ** random.uniform(-200, 200) * spread(3), 10 ** random.uniform(-200, 200) * spread(3)),
    }[kind]()


def free(J, k):
    """The same chains without a spring to ground."""
    k = k.copy()
    k[:, -1] = 0.0
    return J, k


def off(J, k, found, step):
    """Whether one of the frequencies of a chain is off by a share of `step` or more: counts of those below tell."""
    with mp.workdps(30):
        for j, f in enumerate(found):
            if j == 0 and k[-1] == 0.0:
                assert f == 0.0
                continue
            low, high = mpf(f) * (1 - mpf(step)), mpf(f) * (1 + mpf(step))
            if not oracles.count_below(J, k, low) <= j < oracles.count_below(J, k, high):
                return True
    return False


@pytest.mark.parametrize("kind", ["plain", "12 decades", "80 decades", "rising", "falling", "steps", "twins", "units"])
@pytest.mark.parametrize(("n", "step"), [(2, 2e-15), (8, 2e-15), (64, 1e-14)] if COMPILED else [(2, 2e-15)])
def test_every_frequency_has_its_digits_whatever_the_spread(kind, n, step):
    for J, k in (chains(kind, n, FEW), free(*chains(kind, n, FEW, 2))):
        found, _, status = solved(J, k)
        assert (status < Status.BAD_INPUT).all()
        assert np.isfinite(found).all()
        some = range(0, FEW, 4) if n < 64 else [FEW - 1]
        assert not any(off(J[i], k[i], found[i], step) for i in some)


@pytest.mark.parametrize("seed", [73, 1279])
def test_a_smallest_frequency_that_is_shut_in_amid_the_chain_is_found(seed):
    """Chains whose parts fall apart above it: steps alone never find it there."""
    J, k = chains("80 decades", 20, 1, seed)
    assert not off(J[0], k[0], solved(J, k)[0][0], 4e-15)


def test_frequencies_are_those_of_the_dense_problem_and_the_count_tells_wrong_ones():
    for J, k in zip(*chains("12 decades", 6, 2), strict=True):
        found = solved(J, k)[0][0]
        assert relative_error(found, oracles.modes(J, k)[0]).max() < 1e-15
        assert off(J, k, found * (1 + 1e-12), 5e-13)
        assert off(J, k, found * (1 - 1e-12), 5e-13)


@settings(deadline=None, max_examples=30 if COMPILED else 4)
@given(st.integers(-150, 150), st.integers(-150, 150), st.integers(1, 7))
def test_other_units_by_powers_of_four_change_no_digit(inertia, stiffness, n):
    J, k = chains("plain", n, 1)
    assert (solved(J * 4.0**inertia, k * 4.0**stiffness)[0] == solved(J, k)[0] * 2.0 ** (stiffness - inertia)).all()


def test_the_sum_of_inverse_squares_is_dunkerleys():
    """sum 1/w^2 = sum of J_i times its flexibility to ground."""
    J, k = chains("12 decades", 8, 500 if COMPILED else 3)
    flexibility = np.cumsum(1 / k[:, ::-1], axis=1)[:, ::-1]
    found, *_ = solved(J, k)
    np.testing.assert_allclose((1 / (2 * np.pi * found) ** 2).sum(1), (J * flexibility).sum(1), rtol=1e-14)


def test_the_milling_machine_has_the_frequencies_and_the_damping_that_were_found_for_it():
    """Table 1 of the source in its own units, which makes the same machine without dampers."""
    J = np.array([25.7, 1.25, 0.284, 0.769, 1.45, 6.50, 96.00, 99.44])
    k = np.array([7.53, 3.79, 0.839, 1.372, 4.01, 2.80, 5.25, 1.192]) * 1e6
    expected = [10.591, 19.785, 53.104, 102.530, 226.916, 346.664, 388.156, 714.607]
    np.testing.assert_allclose(solved(J, k)[0][0], expected, atol=6e-4)
    _, damping, status = solved(*(MILLING_MACHINE[name] for name in "Jkh"))
    assert status[0] == Status.OK
    np.testing.assert_allclose(damping[0, :5], [0.317, 0.076, 0.126, 0.020, 0.018], atol=5e-4)


@pytest.mark.parametrize("values", [[1.0, 2.1e90], [1.0, 1e-310]])
def test_beyond_2_to_the_300_between_inertias_or_springs_a_chain_is_out_of_range(values):
    assert checked(DRIVETRAIN, [values], [[1.0, 1.0]])[0] == Status.OUT_OF_RANGE
    assert checked(DRIVETRAIN, [[1.0, 1.0]], [values])[0] == Status.OUT_OF_RANGE
    assert checked(DRIVETRAIN, [[1.0, 2.0e90]], [[1.0, 1.0]])[0] == Status.OK


@pytest.mark.parametrize("damping", [1e-14, 1e-3, 0.1, 10.0])
@pytest.mark.parametrize(("kind", "n"), [("plain", 1), ("plain", 4), ("12 decades", 4)])
def test_damping_is_that_of_the_poles_to_rtol_or_the_cell_says_that_it_is_not(kind, n, damping):
    J, k = chains(kind, n, 2 * FEW)
    h = damping * np.sqrt(J.mean() * k.mean()) * 10 ** np.random.default_rng(7).uniform(-1, 1, J.shape)
    h[::4, -1] *= n == 1
    truths = [
        sorted(reduction_oracles.dampings(sorted(oracles.poles(*cell), key=abs))) for cell in zip(J, k, h, strict=True)
    ]
    for rtol in (1e-9, 1e-13):
        _, found, status = solved(J, k, h, rtol)
        right = status == Status.OK
        assert rtol < 1e-9 or right.mean() >= (0.6 if damping > 1 else 0.9)  # poles may lie over 19 decades
        for row, truth in zip(found[right], np.array(truths)[right], strict=True):
            assert relative_error(np.sort(row), truth).max() <= rtol


def test_light_damping_keeps_its_digits():
    J, k = (values[0] for values in chains("plain", 4, 1, 3))
    h = 1e-12 * np.array([1.0, 3.0, 2.0, 0.5])
    _, damping, _ = solved(J, k, h)
    true = reduction_oracles.dampings(oracles.poles(J, k, h))
    assert relative_error(np.sort(damping[0]), sorted(true)).max() < 1e-14
    assert not solved(J, k, 0.0)[1].any()


@pytest.mark.parametrize("damping", [3e-3, 0.9, 3.0, 1e8])
def test_one_damped_inertia_has_the_damping_of_the_quadratic(damping):
    frequency, found, status = solved([2.0], [3.0], [damping * 2 * np.sqrt(6.0)])
    assert status[0] == Status.OK
    assert frequency[0, 0] == pytest.approx(np.sqrt(1.5) / (2 * np.pi), rel=1e-15)
    assert found[0, 0] == pytest.approx(damping, rel=1e-14)


@pytest.mark.parametrize("share", [0.0, 1e-14, -1e-14, 1e-9, -1e-9, 1e-6, -1e-6])
def test_near_critical_damping_a_mode_keeps_its_digits(share):
    """An ulp of h moves a pole by 1e-8 there, but not the product and the sum of both."""
    J, k = chains("plain", 3, 1, 4)
    frequency = solved(J, k)[0][0, 0]
    h = k * (1 + share) / (np.pi * frequency)  # proportional: the lowest mode has the damping 1 + share
    _, damping, status = solved(J, k, h)
    assert damping.min() == pytest.approx(1 + share, rel=1e-12) or status[0] == Status.INACCURATE
    assert solved([1.0], [1.0], [2.0 * (1 + share)])[1][0, 0] == pytest.approx(1 + share, rel=1e-14)


@pytest.mark.parametrize(("damper", "first"), [(0.0, 0.0), (0.5, np.inf)])
def test_without_a_spring_to_ground_the_free_motion_is_undamped_or_damped_without_swinging(damper, first):
    frequency, damping, status = solved([1.0, 2.0], [3.0, 0.0], [0.1, damper])
    assert status[0] == Status.OK
    assert frequency[0, 0] == 0
    assert damping[0, 0] == first
