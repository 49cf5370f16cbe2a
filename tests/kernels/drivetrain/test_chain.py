"""Frequencies, shapes and poles of chains of inertias against 50 digits and more, and against their own laws."""

import chain_oracles as oracles
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from many_chains import natural_frequencies_of_all
from mpmath import mp, mpc, mpf

from kernels.drivetrain._chain import Scaled, refusal
from kernels.drivetrain._chain_frequencies import natural_frequencies
from kernels.drivetrain._chain_poles import _apart, _refined, damped_poles, modal_damping
from kernels.drivetrain._chain_shapes import mode_shapes
from kernels.drivetrain._dqds import _rotate, _shift, _split, _unknown
from kernels.drivetrain.receptance import MILLING_MACHINE
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

MANY = 128 if COMPILED else 3
FEW = 8 if COMPILED else 2
NAN, INF = np.nan, np.inf


@pytest.fixture(autouse=True)
def as_in_a_kernel():
    """Compiled code says nothing of infinities on its way."""
    with np.errstate(all="ignore"):
        yield


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


def frequencies(J, k):
    """Frequencies and statuses, all chains at a time."""
    found, status = np.full(J.shape, NAN), np.full(len(J), 99, np.int8)
    natural_frequencies_of_all(J, k, found, status)
    return found, status


def one_chain(J, k):
    """Frequencies and status of one chain by itself."""
    found = np.full(len(J), NAN)
    status = natural_frequencies(len(J), J, k, found, np.empty(3 * len(J) + 2))
    return found, status


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


KINDS = ("plain", "12 decades", "80 decades", "rising", "falling", "steps", "twins", "units")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [1, 2, 8])
def test_every_frequency_is_right_to_2e_15_whatever_the_spread(kind, n):
    if n == 1 and kind == "twins":
        return
    for J, k in (chains(kind, n, MANY), free(*chains(kind, n, MANY, 2))):
        found, status = frequencies(J, k)
        assert (status == Status.OK).all()
        assert not any(off(J[i], k[i], found[i], 2e-15) for i in range(0, MANY, MANY // 3))


@pytest.mark.skipif(not COMPILED, reason="long in plain Python")
@pytest.mark.parametrize("kind", KINDS)
def test_every_frequency_of_64_inertias_is_right_to_1e_14(kind):
    for J, k in (chains(kind, 64, 256), free(*chains(kind, 64, 256, 2))):
        found, status = frequencies(J, k)
        assert (status == Status.OK).all()
        assert not off(J[7], k[7], found[7], 1e-14)


@pytest.mark.parametrize("seed", [73, 1279])
def test_a_smallest_eigenvalue_that_is_shut_in_amid_the_chain_is_brought_to_its_end(seed):
    """Chains whose parts fall apart above it: steps alone never find it there."""
    J, k = (values[0] for values in chains("80 decades", 20, 1, seed))
    found, status = one_chain(J, k)
    assert status == Status.OK
    assert not off(J, k, found, 4e-15)


def test_the_count_that_tells_a_wrong_frequency_does_tell_it():
    J, k = (values[0] for values in chains("12 decades", 5, 1))
    found, _ = one_chain(J, k)
    for j in range(5):
        for sign in (-1, 1):
            wrong = found.copy()
            wrong[j] *= 1 + sign * 1e-12
            assert off(J, k, wrong, 5e-13)


def test_frequencies_are_those_of_the_dense_problem():
    for J, k in zip(*chains("12 decades", 6, 2), strict=True):
        true, _ = oracles.modes(J, k)
        with mp.workdps(50):
            assert max(abs(mpf(f) / t - 1) for f, t in zip(one_chain(J, k)[0], true, strict=True)) < 1e-15


@pytest.mark.parametrize("n", [2, 8, 24])
def test_one_chain_by_itself_has_the_bits_that_it_has_among_others(n):
    """Those beside it lose their rows sooner or later, are turned about, or are free."""
    parts = [pair for kind in KINDS for pair in (chains(kind, n, MANY // 8 + 1), free(*chains(kind, n, 2)))]
    J, k = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    order = np.random.default_rng(1).permutation(len(J))
    J, k = J[order], k[order]
    among, _ = frequencies(J, k)
    alone = np.array([one_chain(*chain)[0] for chain in zip(J, k, strict=True)])
    assert (among == alone).all()
    assert (frequencies(J[::-1].copy(), k[::-1].copy())[0][::-1] == among).all()
    assert (frequencies(J[:1], k[:1])[0] == among[:1]).all()


@settings(deadline=None, max_examples=30 if COMPILED else 4)
@given(st.integers(-150, 150), st.integers(-150, 150), st.integers(1, 7))
def test_other_units_by_powers_of_four_change_no_digit(inertia, stiffness, n):
    J, k = (values[0] for values in chains("plain", n, 1))
    scaled, _ = one_chain(J * 4.0**inertia, k * 4.0**stiffness)
    assert (scaled == one_chain(J, k)[0] * 2.0 ** (stiffness - inertia)).all()


def test_the_sum_of_inverse_squares_is_dunkerleys():
    """sum 1/w^2 = sum of J_i times its flexibility to ground."""
    J, k = chains("12 decades", 8, MANY)
    flexibility = np.cumsum(1 / k[:, ::-1], axis=1)[:, ::-1]
    found, _ = frequencies(J, k)
    np.testing.assert_allclose((1 / (2 * np.pi * found) ** 2).sum(1), (J * flexibility).sum(1), rtol=1e-14)


def test_the_milling_machine_has_the_frequencies_that_were_found_for_it():
    """Table 1 of the source in its own units."""
    J = np.array([25.7, 1.25, 0.284, 0.769, 1.45, 6.50, 96.00, 99.44])
    k = np.array([7.53, 3.79, 0.839, 1.372, 4.01, 2.80, 5.25, 1.192]) * 1e6
    expected = [10.591, 19.785, 53.104, 102.530, 226.916, 346.664, 388.156, 714.607]
    np.testing.assert_allclose(one_chain(J, k)[0], expected, atol=6e-4)


def test_beyond_2_to_the_300_between_inertias_or_springs_a_chain_is_out_of_range():
    ones = np.ones(2)
    for wide in ([1.0, 2.1e90], [1.0, 1e-310]):
        wide = np.array(wide)
        assert refusal(2, wide, ones, ones) == Status.OUT_OF_RANGE
        assert refusal(2, ones, wide, ones) == Status.OUT_OF_RANGE
        assert one_chain(wide, ones)[1] == Status.OUT_OF_RANGE
        assert one_chain(ones, wide)[1] == Status.OUT_OF_RANGE
    assert refusal(2, np.array([1.0, 2.0e90]), ones, ones) == Status.OK
    assert one_chain(np.array([1e-300]), np.array([1e300]))[0][0] == pytest.approx(1e300 / 2 / np.pi, rel=1e-15)


@pytest.mark.parametrize("bad", [0.0, -1.0, NAN, INF])
def test_what_is_no_chain_is_refused(bad):
    ones = np.ones(3)
    for j in range(3):
        wrong = ones.copy()
        wrong[j] = bad
        assert refusal(3, wrong, ones, ones) == Status.BAD_INPUT
        assert refusal(3, ones, wrong, ones) == (Status.OK if bad == 0.0 and j == 2 else Status.BAD_INPUT)
        assert refusal(3, ones, ones, wrong) == (Status.OK if bad == 0.0 else Status.BAD_INPUT)
    assert refusal(65, np.ones(65), np.ones(65), np.ones(65)) == Status.BAD_INPUT
    assert refusal(0, ones, ones, ones) == Status.BAD_INPUT


def shapes(J, k):
    """Frequencies and mode shapes of one chain."""
    n = len(J)
    found, shape = one_chain(J, k)[0], np.full((n, n), NAN)
    assert mode_shapes(n, J, k, found, shape, np.empty(6 * n)) == Status.OK
    return found, shape


@pytest.mark.parametrize("kind", ["plain", "12 decades", "rising", "falling"])
def test_shapes_are_right_to_rounding_over_the_gap_even_where_they_have_faded(kind):
    """Entries of a faded tail keep their digits; only next to a node are they relative to their neighbours."""
    for J, k in (*zip(*chains(kind, 6, FEW), strict=True), *zip(*free(*chains(kind, 6, FEW, 4)), strict=True)):
        found, shape = shapes(J, k)
        _, true = oracles.modes(J, k)
        for j in range(6):
            gap = min(1.0, min(abs(found[i] - found[j]) / max(found[j], found[i]) for i in range(6) if i != j))
            for i in range(6):
                near = [abs(true[m, j]) for m in (i - 1, i, i + 1) if 0 <= m < 6]
                nodal = abs(true[i, j]) < 0.01 * min(near)
                size = min(near) if nodal else abs(true[i, j])
                assert abs(shape[i, j] - true[i, j]) < 4e-15 / gap * (100 if nodal else 10) * size


def test_shapes_of_the_milling_machine_are_orthonormal_to_1e_15():
    J, k = (np.array(MILLING_MACHINE[name]) for name in "Jk")
    found, shape = shapes(J, k)
    np.testing.assert_allclose(shape.T @ (J[:, None] * shape), np.eye(8), atol=1e-15)
    wound = shape - np.vstack([shape[1:], np.zeros(8)])
    np.testing.assert_allclose(wound.T @ (k[:, None] * wound) / (2 * np.pi * found) ** 2, np.eye(8), atol=1e-13)


def poles(J, k, h):
    """Poles as complex numbers, the bound on their errors, and the status."""
    n = len(J)
    re, im = np.full(2 * n, NAN), np.full(2 * n, NAN)
    error, status = damped_poles(n, J, k, h, one_chain(J, k)[0], re, im, np.empty(16 * n))
    return re, im, error, status


def pole_errors(re, im, true):
    """Relative errors of poles, each of which takes the nearest of the true ones that is left."""
    errors, left = [], list(true)
    for pole in map(mpc, re, im):
        nearest = min(left, key=lambda t: abs(t - pole))
        left.remove(nearest)
        errors.append(float(abs(pole - nearest) / (abs(nearest) or 1)))
    return np.array(errors)


@pytest.mark.parametrize("damping", [1e-14, 1e-3, 0.1, 10.0])
@pytest.mark.parametrize(("kind", "n"), [("plain", 1), ("plain", 4), ("12 decades", 4)])
def test_all_poles_are_found_within_their_bound(damping, kind, n):
    random = np.random.default_rng(7)
    J, k = chains(kind, n, 2 * FEW)
    k[::3, -1] = 0.0
    h = damping * np.sqrt(J.mean() * k.mean()) * 10 ** random.uniform(-1, 1, J.shape)
    h[::4, -1] = 0.0
    sure = 0
    for cell in zip(J, k, h, strict=True):
        re, im, error, status = poles(*cell)
        sure += status == Status.OK
        if status == Status.OK:
            assert error < 1e-12
            assert pole_errors(re, im, oracles.poles(*cell)).max() <= error
    assert sure >= len(J) * (0.9 if damping * len(kind) >= 100 else 1.0)  # held nowhere: poles over 19 decades


def test_light_damping_keeps_its_digits():
    """The real part of a pole whose damping ratio is 1e-12 is right to 1e-14 of itself."""
    J, k = (values[0] for values in chains("plain", 4, 1, 3))
    h = 1e-12 * np.array([1.0, 3.0, 2.0, 0.5])
    re, _, _, _ = poles(J, k, h)
    true = sorted({mp.nstr(t.real, 30) for t in oracles.poles(J, k, h) if t.imag > 0}, key=mpf)
    for found, exact in zip(np.sort(re[::2]), true, strict=True):
        assert abs(mpf(found) / mpf(exact) - 1) < 1e-14
    assert not poles(J, k, 0.0 * h)[0].any()


def test_the_milling_machine_has_the_damping_that_was_found_for_it():
    J, k, h = (np.array(MILLING_MACHINE[name]) for name in "Jkh")
    re, im, error, _ = poles(J, k, h)
    frequency, damping = np.empty(8), np.empty(8)
    modal_damping(8, re, im, frequency, damping)
    assert error < 1e-13
    np.testing.assert_allclose(frequency[:5], [11.145, 19.201, 52.005, 102.524, 226.914], rtol=2e-4)
    np.testing.assert_allclose(damping[:5], [0.317, 0.076, 0.126, 0.020, 0.018], atol=5e-4)


@pytest.mark.parametrize("n", [1, 3, 8])
def test_the_sum_of_all_poles_is_the_trace_of_the_damping(n):
    J, k = chains("plain", n, FEW, 5)
    h = np.random.default_rng(2).uniform(0, 3, J.shape) * np.sqrt(J * k)
    for cell in zip(J, k, h, strict=True):
        re, im, _, status = poles(*cell)
        assert status == Status.OK
        left = np.concatenate([[0.0], cell[2][:-1]])
        assert re.sum() == pytest.approx(-((cell[2] + left) / cell[0]).sum(), rel=1e-13)
        assert (np.diff(np.hypot(re, im)) >= -1e-15 * np.hypot(re, im)[1:]).all()
        first = np.flatnonzero(im > 0)
        assert (im[first + 1] == -im[first]).all()
        assert (re[first + 1] == re[first]).all()


def test_one_overdamped_inertia_has_the_two_poles_of_the_quadratic():
    re, im, error, status = poles(np.array([2.0]), np.array([3.0]), np.array([50.0]))
    with mp.workdps(40):
        root = mp.sqrt(mpf(50) ** 2 - 24)
        true = [6 / (-50 - root), (-50 - root) / 4]
        assert status == Status.OK
        assert not im.any()
        assert max(abs(mpf(s) / t - 1) for s, t in zip(re, true, strict=True)) <= error < 1e-13
    frequency, damping = np.empty(1), np.empty(1)
    modal_damping(1, re, im, frequency, damping)
    assert frequency[0] == pytest.approx(np.sqrt(1.5) / (2 * np.pi), rel=1e-14)
    assert damping[0] == pytest.approx(50 / (2 * np.sqrt(6)), rel=1e-14)


def test_without_anything_to_ground_a_chain_has_two_poles_0_and_with_a_damper_one():
    J, k = np.array([1.0, 2.0]), np.array([3.0, 0.0])
    for damper, zeros in ((0.0, 2), (0.5, 1)):
        re, im, _, status = poles(J, k, np.array([0.1, damper]))
        assert status == Status.OK
        assert np.count_nonzero((re == 0) & (im == 0)) == zeros
        frequency, damping = np.empty(2), np.empty(2)
        modal_damping(2, re, im, frequency, damping)
        assert frequency[0] == 0
        assert damping[0] == (0 if zeros == 2 else INF)


@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize("share", [0.0, 1e-14, -1e-14, 1e-9, -1e-9, 1e-6, -1e-6])
def test_near_critical_damping_poles_are_within_their_bound_and_the_mode_keeps_its_digits(n, share):
    """An ulp of h moves a pole by 1e-8 there, but not the product and the sum of both."""
    J, k = (values[0] for values in chains("plain", n, 1, 4))
    frequency = one_chain(J, k)[0][0]
    h = k * (1 + share) / (np.pi * frequency)  # proportional: the lowest mode has the damping 1 + share
    re, im, error, status = poles(J, k, h)
    assert status == Status.OK
    assert pole_errors(re, im, oracles.poles(J, k, h)).max() <= error
    assert error > 1e-16 / max(np.sqrt(abs(share)), 1e-8)
    modes, damping = np.empty(n), np.empty(n)
    modal_damping(n, re, im, modes, damping)
    if n == 1:
        assert modes[0] == pytest.approx(frequency, rel=1e-14)
        assert damping[0] == pytest.approx(1 + share, rel=1e-14)


def unit_chain(n, seed=6):
    """A chain in its own units, as the solvers of poles have it: J, k, h and two exponents."""
    random = np.random.default_rng(seed)
    J, k, h = (random.uniform(0.5, 1.0, n) for _ in range(3))
    return Scaled(J, k, 0.2 * h, 0.0, 0.0)


def test_a_root_of_five_digits_is_refined_to_its_last():
    J, k, h, *_ = chain = unit_chain(4)
    for true in oracles.poles(J, k, h):
        rough = complex(true) * (1 + 1e-5)
        found, error = _refined(4, chain, (rough.real, rough.imag), np.empty(64))
        assert abs(mpc(*map(float, found)) / true - 1) <= error < 1e-13


def test_two_roots_that_may_be_one_are_not_told_apart_unless_they_are_twins():
    re, im = np.array([-1.0, -1.0, -2.0, -2.0]), np.array([1.0, -1.0, 1e-9, -1e-9])

    def apart(*errors):
        return _apart(2, 0, re, im, np.array(errors))

    assert apart(1e-12, 1e-12, 1e-12, 1e-12)
    assert not apart(1e-12, 1e-12, 1e-9, 1e-12)
    assert not apart(1e-12, 1e-12, 1e-12, 1e-9)
    assert apart(1e-12, 1e-12, -1e-9, -1e-9)
    assert not apart(1e-12, 1e-12, -1e-9, -2e-9)


def entries(q, e, traces):
    """Rows of `_dqds` for two rows of a chain: q, e, and T_1 up to each."""
    return np.array([*q, *e, 0.0, *traces])


def test_a_chain_is_not_split_where_what_is_dropped_would_be_felt_beyond_the_last_digit():
    """Without e, next to q, others move by sqrt(q e), which may be no more than 2^-53 of what is found."""
    far = 2.0**20
    for e, end in ((2.0**-110, 2), (2.0**-127, 1)):
        assert _split(0, 2, entries([2.0**-40, far], [e], [2.0**40, 2.0**40]), 1.0) == end
    assert _split(0, 2, entries([far, 2.0**-40], [2.0**-127], [1 / far, 2.0**40]), 1.0) == 2
    near = 2.0**-30
    assert _split(0, 2, entries([2.0**-40, near], [2.0**-100], [2.0**40, 2.0**40 + 1 / near]), 1.0) == 2


def test_the_part_with_the_smallest_eigenvalue_is_brought_to_the_end():
    rows = entries([2.0**-40, 2.0**20], [2.0**-190], [2.0**40, 2.0**40])
    _rotate(0, 2, rows, 1.0)
    assert list(rows[:2]) == [2.0**20, 2.0**-40]
    assert not rows[2]


def test_no_shift_is_taken_from_sums_of_another_order():
    assert _shift(2, *_unknown(1.0)[:2], 1.0) == 0.0
