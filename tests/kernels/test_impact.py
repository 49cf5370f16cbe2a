"""The impact clock's own cycle against 50 digits, its borders, and its laws."""

from pathlib import Path

import impact_oracles as oracles
import numpy as np
import pytest
from columns import solve
from mpmath import mp, mpf

from kernels._jit import COMPILED
from kernels.impact import IMPACT
from kernels.interface import Status

ROOT = Path(__file__).parents[2]
NAMES = tuple(f.name for f in IMPACT.outputs)
METHODS = ("closed",)
WORST = {"closed": 1e-15}
SOME = 60 if COMPILED else 8
INF, NAN = np.inf, np.nan


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


def assert_cycle(method, columns, rtol=1e-13):
    """The verdicts and values of a method against the oracle; returns the statuses."""
    outputs, status = solve(IMPACT, method, *columns, rtol=rtol)
    truths = [oracles.impact_cycle(*cell) for cell in zip(*columns, strict=True)]
    exist = np.array([t[1] for t in truths])
    grows = np.array([t[0][4] > 1 for t in truths])
    expected = np.where(exist, np.where(grows, Status.UNSTABLE, Status.OK), Status.NO_CYCLE)
    assert status.tolist() == expected.tolist()
    kept = {name: column[exist] for name, column in outputs.items()}
    worst = errors(kept, [t[0] for t in truths if t[1]])
    assert max(worst.values()) < WORST[method], worst
    return status


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("nu", "seed"), [(0.0, 1), (1.0, 2)])
def test_the_impact_cycle_its_existence_and_its_multiplier_are_those_of_50_digits(method, nu, seed):
    status = assert_cycle(method, clocks(seed=seed, nu=nu))
    assert not COMPILED or set(status) == {Status.OK, Status.UNSTABLE, Status.NO_CYCLE}


@pytest.mark.parametrize("method", METHODS)
def test_the_plastic_cycle_is_that_of_50_digits_for_every_escape_height(method):
    columns = clocks(seed=3, e=0.0)
    outputs, status = solve(IMPACT, method, *columns, rtol=1e-13)
    assert (status == Status.OK).all()
    worst = errors(outputs, [oracles.plastic_cycle(*cell) for cell in zip(*columns, strict=True)])
    assert max(worst.values()) < WORST[method], worst
    assert 0 < (outputs["recoil"] > 0).mean() < 1


def edge(kappa, e, nu=0.0):
    """The largest escape height with a cycle, in 60 digits, by bisection of what passages there are."""
    low, high = mpf(0), mpf(1) / 4
    with mp.workdps(60):
        cell = [c[0] for c in cell_of(kappa, e, nu=nu)]
        p = 2 * mp.pi * mpf(float(cell[3])) / 3
        for _ in range(150):
            middle = (low + high) / 2
            cell[6] = middle * p
            low, high = (middle, high) if oracles.stays(*cell) else (low, middle)
        return low * p


EDGES = [(2.0, 0.3, 0.0), (30.0, 0.4, 0.0), (1.5, 0.55, 0.0), (0.05, 0.45, 0.0), (3.0, 0.2, 0.5), (0.5, 0.35, -2.8)]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("kappa", "e", "nu"), EDGES if COMPILED else EDGES[:2])
def test_the_border_of_existence_is_exact_and_said_to_be_grazing(method, kappa, e, nu):
    border = edge(kappa, e, nu)
    shifts = (-1e-9, -1e-12, -1e-16, 1e-16, 1e-12, 1e-9)
    columns = joined(*(cell_of(kappa, e, float(border * (1 + mpf(s))), nu) for s in shifts))
    _, status = solve(IMPACT, method, *columns, rtol=1e-13)
    there = Status.UNSTABLE if status[0] == Status.UNSTABLE else Status.OK
    middle = Status.GRAZING if there == Status.OK else Status.UNSTABLE
    assert status.tolist() == [there] * 2 + [middle] * 2 + [Status.NO_CYCLE] * 2
