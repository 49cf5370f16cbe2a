"""The driven balance against 40 digits of two motions that meet, against its formulas, and where it sticks."""

import balance_oracles as oracles
import numpy as np
import pytest
from columns import bounds, checked, relative_error, solve
from mpmath import mpf

from kernels.balance.driven import BALANCE_DRIVEN
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED

NAMES = ("amplitude", "period", "multiplier")
METHODS = tuple(m.name for m in BALANCE_DRIVEN.methods)
SOME = 14 if COMPILED else 3
POINTS = 29 if COMPILED else 8


def scenes(drive, zeta, friction, n=SOME, seed=1, torque=(-1.0, 1.0)):
    """Columns of random balances: log10 of zeta, and of r over beta or the root of w, between the limits given."""
    random = np.random.default_rng(seed)
    none = np.zeros(n)
    zeta = 10 ** random.uniform(*zeta, n) if zeta else none
    unit = 10 ** random.uniform(-30, 30, n)
    r = unit * 10 ** random.uniform(*friction, n) if friction else none
    omega_n = 10 ** random.uniform(-30, 30, n)
    if drive == "impulse":
        return zeta, omega_n, r, unit * unit * random.uniform(0.5, 2.0, n), none, none
    return zeta, omega_n, r, none, unit * 10 ** random.uniform(*torque, n), unit * random.uniform(0.5, 2.0, n)


def compare(outputs, status, columns, limit):
    """Every cell that came out has the amplitude, period and multiplier of the oracle, and no other has a cycle."""
    for i, cell in enumerate(zip(*columns, strict=True)):
        true = oracles.driven(*cell)
        assert (status[i] >= FIRST_REFUSAL) == (true is None), cell
        if true is None:
            assert status[i] == Status.STICKS, cell
        elif status[i] == Status.OK:
            for name, t in zip(NAMES, true, strict=True):
                if t > mpf(10) ** -12:  # what differences of the oracle can tell
                    assert relative_error([outputs[name][i]], [t])[0] < limit, (name, cell)


@pytest.mark.parametrize(
    ("drive", "zeta", "friction"),
    [
        ("impulse", (-6, -0.05), None), ("impulse", None, (-6, 0)), ("lift", None, (-6, 0.3)),
    ],
)  # fmt: skip
def test_formulas_are_right_to_4e_15(drive, zeta, friction):
    columns = scenes(drive, zeta, friction)
    outputs, status = solve(BALANCE_DRIVEN, "closed", *columns)
    assert np.isin(status, (Status.OK, Status.STICKS)).all()
    assert (bounds(BALANCE_DRIVEN, "closed", *columns) == 4e-15).all()
    compare(outputs, status, columns, 4e-15)


@pytest.mark.parametrize(
    ("drive", "zeta", "friction", "torque"),
    [
        ("impulse", (-6, -0.05), (-6, 0), None), ("lift", (-6, -0.05), (-6, 0.3), (-2.0, 1.0)),
        ("lift", (-0.3, 1), (-6, 0.3), (-0.5, 2.0)), ("lift", (-1, 0.0), (-0.5, 0.5), (0.0, 1.5)),
    ],
)  # fmt: skip
def test_newton_finds_the_cycle_to_1e_13_in_all_regimes_and_none_where_there_is_none(drive, zeta, friction, torque):
    """The oracle takes up to two seconds."""
    columns = scenes(drive, zeta, friction, torque=torque)
    outputs, status = solve(BALANCE_DRIVEN, "newton", *columns, rtol=1e-13)
    assert set(status) <= {Status.OK, Status.INACCURATE, Status.STICKS}
    assert (status == Status.OK).any()
    compare(outputs, status, columns, 1e-13)


def close_to_sticking():
    """Impulses just above w = 4 r^2, and lifts just above m = r and just above a + beta = 2 r."""
    near = 10.0 ** np.linspace(-14, -1, POINTS)
    none, one = np.zeros(POINTS), np.ones(POINTS)
    return [
        (none, one, 0.3 * one, 4 * 0.3 * 0.3 * (1 + near), none, none),
        (none, one, 0.1 * one, none, 0.1 * (1 + near), 0.5 * one),
        (none, one, one, none, 2 * one, 2 / 3 * (1 + near)),
    ]


@pytest.mark.parametrize("which", range(3))
def test_close_to_sticking_formulas_and_newton_keep_their_digits(which):
    columns = close_to_sticking()[which]
    outputs, status = solve(BALANCE_DRIVEN, "closed", *columns)
    assert (status == Status.OK).all()
    compare({k: v[::7] for k, v in outputs.items()}, status[::7], [c[::7] for c in columns], 4e-15)
    found, verdict = solve(BALANCE_DRIVEN, "newton", *columns, rtol=1e-14)
    assert (verdict == Status.OK).all()
    for name in NAMES:
        np.testing.assert_allclose(found[name], outputs[name], rtol=1e-14)


def just_kept_up(n, seed, zeta=(-6.0, -0.3)):
    """Balances with both frictions, driven by a share of 1e-11 to 1 more than the least that keeps them up."""
    random = np.random.default_rng(seed)
    lifts, none = random.random(n) < 0.5, np.zeros(n)
    damping, r = 10 ** random.uniform(*zeta, n), 10 ** random.uniform(-6, 0, n)
    lifts |= damping >= 1.0
    beta = np.where(lifts, 10 ** random.uniform(-2, 0.5, n), 0.0)

    def columns(drive):
        return damping, none + 1.0, r, np.where(lifts, 0.0, drive), np.where(lifts, drive, 0.0), beta

    low, high = np.full(n, -30.0), np.full(n, 30.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        sticks = solve(BALANCE_DRIVEN, "newton", *columns(np.exp(middle)), rtol=1e-2)[1] == Status.STICKS
        low, high = np.where(sticks, middle, low), np.where(sticks, high, middle)
    kept_up = high < 3.0  # overdamped ones with r > beta are not
    return [c[kept_up] for c in columns(np.exp(high) * (1 + 10 ** random.uniform(-11, 0, n)))]


@pytest.mark.skipif(not COMPILED, reason="sixty bisections of many cells")
@pytest.mark.parametrize("zeta", [(-6.0, -0.3), (-0.3, 0.2)])
def test_just_above_the_least_drive_every_cycle_is_right_to_14_digits(zeta):
    columns = just_kept_up(200, 4, zeta)
    assert len(columns[0]) > 100
    outputs, status = solve(BALANCE_DRIVEN, "newton", *columns, rtol=1e-14)
    usual, verdict = solve(BALANCE_DRIVEN, "newton", *columns, rtol=1e-12)
    assert (status == Status.OK).mean() > 0.98
    assert (verdict == Status.OK).mean() > 0.98
    for i in np.flatnonzero(status == Status.OK)[::10]:
        cell = [column[i] for column in columns]
        for name, true in zip(NAMES, oracles.driven(*cell, digits=60), strict=True):
            if name == "multiplier" and true < mpf(10) ** -20:
                continue  # what differences of the oracle cannot tell
            assert relative_error(outputs[name][i : i + 1], [true])[0] < 1e-14, (name, cell)
            assert relative_error(usual[name][i : i + 1], [true])[0] < 1e-12 or verdict[i], (name, cell)


def test_just_below_the_least_drive_the_balance_sticks():
    below = 1 - 1e-12
    columns = [0.0, 0.0, 0.0], [1.0], [1.0, 0.1, 1.0], [4 * below, 0, 0], [0, 0.1 * below, 2], [0, 0.5, 2 / 3 * below]
    for method in METHODS:
        _, status = solve(BALANCE_DRIVEN, method, *columns)
        assert (status == Status.STICKS).all(), method
    _, status = solve(BALANCE_DRIVEN, "closed", [0.0, 0.0], [1.0], [1.0, 0.1], [4.0, 0.0], [0.0, 0.1], [0.0, 0.5])
    assert (status == Status.STICKS).all()


def test_an_overdamped_balance_that_creeps_to_the_edge_of_its_lift_sticks():
    _, status = solve(BALANCE_DRIVEN, "newton", [1.0, 1.5, 30.0], 1.0, 0.75, 0.0, 5.0, 0.75)
    assert (status == Status.STICKS).all()


def test_with_hardly_any_friction_it_sticks_just_below_the_torque_that_it_takes():
    """m - r > beta tanh(delta/2) passes the lift from rest at its begin; both sides are far below beta."""
    random = np.random.default_rng(3)
    n = 400 if COMPILED else 4
    zeta, r = 10 ** random.uniform(-14, -3, n), np.where(random.random(n) < 0.5, 10 ** random.uniform(-14, -9, n), 0.0)
    above = random.choice([-1, 1], n) * 10 ** random.uniform(-4, -1, n)
    least = np.tanh(0.5 * np.pi * zeta / np.sqrt(1 - zeta**2))
    keeps = least > 1e-4 * r  # the last digit of m decides elsewhere
    columns = [c[keeps] for c in (zeta, np.ones(n), r, np.zeros(n), r + least * (1 + above), np.ones(n))]
    outputs, status = solve(BALANCE_DRIVEN, "newton", *columns, rtol=1e-10)
    assert ((status == Status.OK) == (above > 0)[keeps]).all()
    assert (status[above[keeps] < 0] == Status.STICKS).all()
    for i in np.flatnonzero(status == Status.OK)[::20]:
        for name, true in zip(NAMES, oracles.driven(*(column[i] for column in columns)), strict=True):
            assert relative_error(outputs[name][i : i + 1], [true])[0] < 1e-10, name


@pytest.mark.parametrize("zeta", [1.0, 1 + 1e-12, 10.0])
def test_an_overdamped_balance_needs_a_lift(zeta):
    for method, r in (("closed", 0.0), ("newton", 0.0), ("newton", 0.1)):
        _, status = solve(BALANCE_DRIVEN, method, [zeta], [1.0], [r], [100.0])
        assert status[0] == Status.STICKS
    outputs, status = solve(BALANCE_DRIVEN, "newton", [zeta], [1.0], [0.1], [0.0], [3.0], [1.0], rtol=1e-11)
    assert status[0] == Status.OK
    compare(outputs, status, ([zeta], [1.0], [0.1], [0.0], [3.0], [1.0]), 1e-12)


def test_where_there_is_no_formula_none_is_taken():
    columns = [0.1, 0.1], [1.0], [0.1, 0.0], [0.1, 0.0], [0.0, 0.1], [0.0, 0.1]
    _, status = solve(BALANCE_DRIVEN, "closed", *columns)
    assert (status == Status.NO_METHOD).all()
    assert (bounds(BALANCE_DRIVEN, "closed", *columns) == np.inf).all()


@pytest.mark.parametrize(
    ("cell", "status"),
    [
        ((0.1, 1, 0.1, 0.1, 0, 0), Status.OK),
        ((0.1, 1, 0.1, 0, 0.1, 0.1), Status.OK),
        ((0.1, 1, 0.1, 0, 0, 0), Status.BAD_INPUT),
        ((0.1, 1, 0.1, 0.1, 0.1, 0.1), Status.BAD_INPUT),
        ((0.1, 1, 0.1, 0, 0.1, 0), Status.BAD_INPUT),
        ((0.1, 1, 0.1, 0.1, 0, 0.1), Status.BAD_INPUT),
        ((0.0, 1, 0.0, 0.1, 0, 0), Status.NO_LIMIT_CYCLE),
        ((0.0, 1, 0.0, 0, 0.1, 0.1), Status.NO_LIMIT_CYCLE),
    ],
)
def test_a_drive_is_either_an_impulse_or_a_lift(cell, status):
    assert checked(BALANCE_DRIVEN, *([float(c)] for c in cell))[0] == status
