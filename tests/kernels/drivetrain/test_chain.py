"""Frequencies and damping of whole chains against 50 digits and more, over any spread, and against their own laws."""

import chain_oracles as oracles
import numpy as np
import pytest
import reduction_oracles
from columns import checked, estimated, relative_error, solve
from mpmath import mp, mpf

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


def test_poles_next_to_each_other_by_damping_in_proportion_to_the_springs_are_told_apart():
    J, k = 10.0 ** np.random.default_rng(1).uniform(-3, 3, (2, 200, 4))
    _, found, status = solved(J, k, 50.0 * k)
    assert (status == Status.OK).all()
    for i in range(0, 200, 50):
        poles = sorted(oracles.poles(J[i], k[i], 50.0 * k[i]), key=abs)
        assert relative_error(np.sort(found[i]), sorted(reduction_oracles.dampings(poles))).max() <= 1e-9


def nearly_critical(share):
    """A chain with proportional damping, whose lowest mode has 1 + share of the critical one."""
    J, k = chains("plain", 3, 1, 4)
    return J, k, k * (1 + share) / (np.pi * solved(J, k)[0][0, 0])


@pytest.mark.parametrize("share", [0.0, 1e-14, -1e-14, 1e-9, -1e-9, 1e-6, -1e-6])
def test_near_critical_damping_a_mode_keeps_its_digits(share):
    """An ulp of h moves a pole by 1e-8 there, but not the product and the sum of both."""
    _, damping, status = solved(*nearly_critical(share))
    assert damping.min() == pytest.approx(1 + share, rel=1e-12, abs=0.0) or status[0] == Status.INACCURATE
    assert solved([1.0], [1.0], [2.0 * (1 + share)])[1][0, 0] == pytest.approx(1 + share, rel=1e-14, abs=0.0)


@pytest.mark.parametrize("share", [1e-4, -1e-5, 1e-6])
def test_near_critical_damping_the_error_told_is_what_four_roundings_of_every_number_are_worth(share):
    """By what poles move, over themselves, where each inertia, spring and damper is changed."""
    chain, step = nearly_critical(share), 2.0**-30
    poles, moved = oracles.poles(*(c[0] for c in chain)), 0.0
    for place in np.ndindex(3, 3):
        others = np.concatenate(chain)
        others[place] *= 1.0 + step
        others = oracles.poles(*others)
        moved += np.array([float(min(abs(s - other) for other in others) / abs(s)) for s in poles]) / step
    _, _, error = estimated(DRIVETRAIN, "direct", *chain, reduction=0.0, asked=["damping"])
    assert error[0] == pytest.approx(2.0**-50 * moved.max(), rel=0.02, abs=0.0)


@pytest.mark.parametrize(("damper", "first"), [(0.0, 0.0), (0.5, np.inf)])
def test_without_a_spring_to_ground_the_free_motion_is_undamped_or_damped_without_swinging(damper, first):
    frequency, damping, status = solved([1.0, 2.0], [3.0, 0.0], [0.1, damper])
    assert status[0] == Status.OK
    assert frequency[0, 0] == 0
    assert damping[0, 0] == first
