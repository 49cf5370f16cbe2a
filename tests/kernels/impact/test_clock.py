"""The impact clock's own cycle against 50 digits, its borders, and its laws."""

import functools

import impact_oracles as oracles
import numpy as np
import pytest
from columns import bounds, checked, solve
from mpmath import mp, mpf

from kernels.impact.clock import IMPACT
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

NAMES = tuple(f.name for f in IMPACT.outputs)
WORST = 1.2e-15
"""Of any output; the recoil and the plastic swing come to 1.1e-15."""
SOME = 60 if COMPILED else 8


def pitch(r_c, teeth):
    return 2 * np.pi * r_c / teeth


def clocks(n=SOME, seed=1, kappa=(-6, 6), e=None, nu=0.0, units=10.0):
    """Columns of random clocks: kappa log-uniform, h up to p/4, SI units over `units` decades up and down."""
    random = np.random.default_rng(seed)
    kappa = 10 ** random.uniform(*kappa, n)
    if e is None:
        e = np.where(random.random(n) < 0.5, random.uniform(0, 0.9, n), 10 ** random.uniform(-6, 0, n))
    r_c, r_v, I_c = (10 ** random.uniform(-units, units, n) for _ in range(3))
    teeth = random.choice([3.0, 15.0, 31.0, 101.0], n)
    h = 0.25 * pitch(r_c, teeth) * random.choice([0, 1], n) * random.random(n)
    nu = nu * random.normal(size=n) * 10 ** random.uniform(-2, 1, n) * (1 + kappa) / kappa**2
    torque = 10 ** random.uniform(-units, units, n)
    return [torque, I_c, I_c * (r_v / r_c) ** 2 / kappa, r_c, r_v, teeth, h, np.broadcast_to(e, n) + 0.0, nu]


def cell_of(kappa, e, h=0.0, nu=0.0):
    """One clock with the pitch 1 m and T0 = 1 s, but for rounding; h in pitches."""
    teeth = 3.0
    r_c = teeth / (2 * np.pi)
    return [np.array([v], float) for v in (r_c * r_c * r_c, r_c**4, r_c**4 / kappa, r_c, r_c, teeth, h, e, nu)]


def joined(*cells):
    """Columns of several clocks."""
    return [np.concatenate(c) for c in zip(*cells, strict=True)]


def errors(outputs, truths):
    """Largest relative errors by name; 0 for an exact 0."""
    found = {}
    for name, true in zip(NAMES, zip(*truths, strict=True), strict=True):
        with mp.workdps(60):
            found[name] = max(
                float(abs(mpf(float(v)) - t) / (abs(t) or 1)) for v, t in zip(outputs[name], true, strict=True)
            )
    return found


@functools.cache
def truth(*cell, digits=oracles.DIGITS):
    """Values and existence of the impact cycle, or of the plastic one for e = 0."""
    if cell[7] > 0:
        return oracles.impact_cycle(*cell, digits=digits)
    return oracles.plastic_cycle(*cell, digits=digits), True


def assert_cycle(columns, rtol=1e-13):
    """The verdicts and values of the closed form against the oracle; returns the statuses."""
    outputs, status = solve(IMPACT, "closed", *columns, rtol=rtol)
    truths = [truth(*cell) for cell in zip(*columns, strict=True)]
    exist = np.array([t[1] for t in truths])
    grows = np.array([t[0][4] > 1 for t in truths])
    expected = np.where(exist, np.where(grows, Status.UNSTABLE, Status.OK), Status.NO_CYCLE)
    assert status.tolist() == expected.tolist()
    kept = {name: column[exist] for name, column in outputs.items()}
    worst = errors(kept, [t[0] for t in truths if t[1]])
    assert max(worst.values()) < WORST, worst
    return status


@pytest.mark.parametrize(("nu", "seed"), [(0.0, 1), (1.0, 2)])
def test_the_impact_cycle_its_existence_and_its_multiplier_are_those_of_50_digits(nu, seed):
    status = assert_cycle(clocks(seed=seed, nu=nu))
    assert not COMPILED or set(status) == {Status.OK, Status.UNSTABLE, Status.NO_CYCLE}


def test_the_plastic_cycle_is_that_of_50_digits_for_every_escape_height():
    assert (assert_cycle(clocks(seed=3, e=0.0)) == Status.OK).all()


EDGES = [(2.0, 0.3, 0.0), (30.0, 0.4, 0.0), (1.5, 0.55, 0.0), (0.05, 0.45, 0.0), (3.0, 0.2, 0.5), (0.5, 0.35, -2.8)]


def test_the_border_of_existence_is_exact_and_said_to_be_grazing():
    for kappa, e, nu in EDGES if COMPILED else EDGES[:3]:
        border = oracles.highest_escape(*(c[0] for c in cell_of(kappa, e, nu=nu)))
        shifts = (-1e-9, -1e-12, -1e-16, 1e-16, 1e-12, 1e-9)
        columns = joined(*(cell_of(kappa, e, float(border * (1 + mpf(s))), nu) for s in shifts))
        _, status = solve(IMPACT, "closed", *columns, rtol=1e-13)
        there = Status.UNSTABLE if status[0] == Status.UNSTABLE else Status.OK
        middle = Status.GRAZING if there == Status.OK else Status.UNSTABLE
        assert status.tolist() == [there] * 2 + [middle] * 2 + [Status.NO_CYCLE] * 2, (kappa, e, nu)


def test_the_border_where_the_tooth_turns_before_it_meets_the_pallet_again_is_exact():
    """There 1/(2 q) = 1 - e with q = (1 + e)/(1 + kappa), whatever the escape height: e^2 = (1 - kappa)/2."""
    border = mp.sqrt((1 - mpf(0.375)) / 2)
    columns = joined(*(cell_of(0.375, float(border * (1 + mpf(s))), 0.22) for s in (-1e-9, -1e-12, 1e-12, 1e-9)))
    assert assert_cycle(columns).tolist() == [Status.UNSTABLE] * 2 + [Status.NO_CYCLE] * 2


def test_a_flat_lever_is_stable_just_for_a_wheel_heavier_than_the_pallets():
    kappa = 1 + np.array([-1e-6, -1e-12, 0.0, 1e-12, 1e-6])
    columns = joined(*(cell_of(k, 0.4) for k in kappa))
    columns[1], columns[2], columns[3], columns[4] = kappa, np.ones(5), np.full(5, 1.5), np.full(5, 1.5)
    outputs, status = solve(IMPACT, "closed", *columns)
    expected = [Status.UNSTABLE] * 2 + [Status.GRAZING] + [Status.OK] * 2
    assert status.tolist() == expected
    assert outputs["multiplier"][2] == 1.0
    assert (np.sign(outputs["multiplier"] - 1) == [1, 1, 0, -1, -1]).all()


QUARTERS = [(0.03, 31), (0.1, 3), (1 / 3, 101), (0.0127, 15)]


def test_an_escape_height_of_a_quarter_pitch_is_the_clock_without_drop_however_it_was_rounded():
    for r_c, teeth in QUARTERS:
        h = 2 * np.pi * r_c / teeth / 4
        heights = np.array([np.nextafter(h, 0), h, np.nextafter(h, 1), h * (1 + 4e-15), h * (1 - 4e-15)])
        columns = [np.full(5, v) for v in (1e-3, 1e-5, 3e-5, r_c, 0.02, float(teeth))] + [heights]
        assert checked(IMPACT, *columns, e=0.0).tolist() == [0, 0, 0, Status.NEVER_MEETS, 0]
        assert checked(IMPACT, *columns, e=0.1).tolist() == [Status.NEVER_MEETS] * 4 + [0]
        outputs, status = solve(IMPACT, "closed", *columns, e=0.0)
        assert (status[:3] == Status.OK).all()
        assert (outputs["contact_share"][:3] == 1).all()
        kappa = 1e-5 * 0.02**2 / (3e-5 * r_c**2)
        half = 2 / kappa * np.sqrt(h * (1 + kappa) * 1e-5 / (1e-3 * r_c))  # g = torque r_c/I_c
        np.testing.assert_allclose(outputs["period"][:3], 2 * half, rtol=3e-15)


def test_no_impact_cycle_keeps_more_than_seven_eighths_of_the_speed():
    random, n = np.random.default_rng(9), 10_000 if COMPILED else 20
    bent = clocks(n, seed=9, kappa=(-3, 5), e=random.uniform(0.875, 1.0 - 2.0**-53, n), nu=1.0)
    assert (solve(IMPACT, "closed", *bent)[1] == Status.NO_CYCLE).all()


GOOD = (1.0, 1.0, 1.0, 1.0, 1.0, 3.0, 0.1, 0.2, 0.0)


@pytest.mark.parametrize(
    ("place", "value", "status"),
    [
        (0, 0.0, Status.NEVER_STARTS),
        (6, 0.53, Status.NEVER_MEETS),
        (6, 1e308, Status.NEVER_MEETS),
        (5, 4.0, Status.BAD_INPUT),
        (5, 30.0, Status.BAD_INPUT),
        (5, 13.0, Status.OK),
        (7, 0.9999999999999999, Status.OK),
    ],
)
def test_what_cannot_run_is_refused_by_name(place, value, status):
    assert checked(IMPACT, *([v] for v in (*GOOD[:place], value, *GOOD[place + 1 :])))[0] == status


def test_the_closed_form_promises_what_it_keeps_and_knows_no_bent_lever_with_plastic_impacts():
    assert (bounds(IMPACT, "closed", *clocks(40)) == 2e-15).all()
    assert WORST < 2e-15
    for rtol, verdict in ((2e-15, Status.OK), (1e-15, Status.INACCURATE)):
        assert solve(IMPACT, "closed", *cell_of(2.0, 0.2), rtol=rtol)[1][0] == verdict
    assert solve(IMPACT, "closed", *cell_of(2.0, 0.0, 0.1, 0.3))[1][0] == Status.NO_METHOD
