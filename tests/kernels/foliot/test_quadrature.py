"""Foliots without a spring and with any friction: integrals and closed forms against 30 digits and more, and laws."""

import foliot_oracles
import numpy as np
import pytest
from columns import bounds, relative_error, solve
from mpmath import atan, atanh, exp, expm1, log, log1p, mp, mpf, sqrt

from kernels.foliot.cycle import FOLIOT
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

NAMES = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
SOME = 80 if COMPILED else 6
TINY = 1e-290


def cycles(method="quadrature", **losses):
    """Outputs and status of foliots with mu = phi0 = 1."""
    return solve(FOLIOT, method, **{"mu": np.ones(1), "phi0": 1.0} | losses)


def bound_of(name, method="quadrature", **losses):
    return bounds(FOLIOT, method, asked=[name], **{"mu": np.ones(1), "phi0": 1.0} | losses)


def check(truths, **losses):
    """Every output is within its bound, as long as it is a normal number; the worst errors by name."""
    outputs, status = cycles(**losses)
    assert (status == Status.OK).all()
    worst = {}
    for position, name in enumerate(NAMES):
        there = np.array([abs(truth[position]) > TINY for truth in truths])
        assert (outputs[name][~there] <= TINY).all()
        exact = [truth[position] for truth in truths if abs(truth[position]) > TINY]
        error, limit = relative_error(outputs[name][there], exact), bound_of(name, **losses)[there]
        assert (error <= limit).all(), (name, (error / limit).argmax(), error.max())
        worst[name] = error.max(initial=0.0)
    return worst


@pytest.mark.parametrize("inward", [False, True])
def test_viscous_and_dry_friction_and_restitution_together(inward):
    """Friction down to 1e-9 and up to 1 - 1e-9, restitution close to 1, to -1 and between."""
    random = np.random.default_rng(2)
    a = 10 ** random.uniform(-6, 6, SOME) * (random.random(SOME) < 0.7)
    small, large = 10 ** random.uniform(-9, -0.05, SOME), 1.0 - 10 ** random.uniform(-9, -0.05, SOME)
    R = np.choose(random.integers(0, 3, SOME), [0.0 * a, small, large])
    e = np.choose(random.integers(0, 3, SOME), [1.0 + 0.0 * a, 1.0 - 10 ** random.uniform(-15, 0, SOME), small])
    e = -1.0 + 10 ** random.uniform(-7, 0, SOME) if inward else e
    a = np.where((a == 0.0) & (R == 0.0) & (e == 1.0), 1.0, a)
    truths = [foliot_oracles.cycle(1.0, 1.0, a=x, R=y, e=z) for x, y, z in zip(a, R, e, strict=True)]
    worst = check(truths, a=a, R=R, e=e)
    assert inward or max(worst[name] for name in NAMES[:4]) < 2e-14


HARD = [
    {"c": 1.0, "n": 1.5},
    {"c": 0.25, "n": 0.0, "R": 0.1, "a": 0.3},  # dry friction
    {"c": 0.5, "n": 1.0, "a": 2.0},  # viscous friction
    {"c": 1e-12, "n": 4.0},
    {"c": 0.034, "n": 4.0},  # v1/V near 2/3, V the speed that is never exceeded
    {"c": 0.8, "n": 1e-3},  # almost dry friction of 0.8, V = 1e97
    {"c": 1.0, "n": 1.2e-3, "a": 0.0628, "e": 0.881},
    {"c": 4e16, "n": 4.0, "R": 0.983},
    {"c": 3.4e-7, "n": 1.04e-3, "R": 5.7e-4},  # V = 1e6200 is no float64
    {"c": 1e-9, "n": 3.5, "R": 1e-5, "a": 1e-7},
    {"c": 2.0, "n": 0.5, "R": 0.999, "a": 3.0, "e": 0.7},
    {"c": 0.3, "n": 2.5, "R": 0.2, "a": 0.4, "e": -0.6},
    {"c": 50.0, "n": 3.3, "R": 0.1, "e": -0.99},
    {"c": 5.0, "n": 0.7, "e": 0.0},
    {"c": 0.05, "n": 2.5, "R": 0.1, "e": 0.8},
    {"c": 0.02, "n": 1.5, "a": 0.01, "e": -0.5},
    {"c": 1.0, "n": 0.00548, "R": 0.678, "a": 22.7, "e": 0.836},  # V = 1e-90
    {"c": 30.0, "n": 0.3},
    {"c": 0.3, "n": 8.0},
    {"c": 2.0, "n": 16.0},
]


@pytest.mark.parametrize("cell", HARD if COMPILED else HARD[14:16])
def test_mixtures_and_degrees_that_are_hard(cell):
    """The oracle takes up to a second and a half."""
    check([foliot_oracles.cycle(1.0, 1.0, **cell, digits=8)], **cell)


def dry(R):
    """Of Coulomb friction alone."""
    return 4 * sqrt(2 / R) / sqrt(1 - R * R), 1 / R, sqrt(2 * (1 - R * R) / R), R * R / (1 - R * R), (1 - R) / (1 + R)


def thrown(e):
    """Of restitution alone."""
    amplitude = (1 + e * e) / (1 - e * e) if e > 0 else mpf(1)
    return 4 * sqrt((1 + e) / (1 - e)), amplitude, 2 / sqrt(1 - e * e), mpf("0.5"), e * e


def dragged(c):
    """Of quadratic drag alone."""
    lam = sqrt(sqrt(-expm1(-4 * c))) if c < 200 else mpf(1)
    time = atanh(lam) + atan(lam) if c < 200 else 2 * c + 3 * log(mpf(2)) / 2 + atan(mpf(1))
    amplitude, m = 1 + log1p(lam**2) / (2 * c), exp(-4 * c) / (1 + lam**2) ** 2
    return 2 * time / sqrt(c), amplitude, lam / sqrt(c), mpf("0.5"), m


ALONE = {
    "R": (dry, np.concatenate([10 ** np.linspace(-300, -0.01, SOME), 1.0 - 10 ** np.linspace(-15, -0.3, SOME)])),
    "e": (thrown, np.concatenate([1.0 - 10 ** np.linspace(-15, 0, SOME), np.linspace(-0.999, 0.999, SOME)])),
    "c": (dragged, 10 ** np.linspace(-60, 12, 2 * SOME)),
}


@pytest.mark.parametrize("loss", ALONE)
def test_one_loss_alone_follows_its_closed_law(loss):
    law, values = ALONE[loss]
    outputs, status = cycles("pure", **{loss: values, "n": 2.0})
    assert (status == Status.OK).all()
    with mp.workdps(400):
        truths = [law(mpf(value)) for value in values]
    for position, name in enumerate(NAMES):
        there = np.array([abs(truth[position]) > TINY for truth in truths])
        error = relative_error(outputs[name][there], [t[position] for t in truths if abs(t[position]) > TINY])
        assert error.max() < (3e-15 if (loss, name) == ("c", "multiplier") else 1e-15), name


def test_what_cannot_be_solved_is_said_and_the_promise_ends_where_the_rule_does():
    c, n = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 1.0, 1e-3, 1e-3])
    status, limit = cycles(c=c, n=n)[1], bound_of("period", c=c, n=n)
    assert status[:2].tolist() == [Status.NOT_CONVERGED, Status.OK]  # nothing is lost in the first
    assert set(status[2:]) <= {Status.NOT_CONVERGED, Status.OUT_OF_RANGE}  # V = 2^-1000; V = 3^-1000 = 1e-477
    assert limit[1] < 2e-14
    assert not np.isfinite(limit[2:]).any()
    steep = bound_of("period", c=1.0, n=np.array([4.0, 8.0, 16.0, 17.0]))
    assert (np.diff(steep) > 0).all()
    assert steep[0] < 2e-14 < 1e-6 < np.inf == steep[3]
    assert (steep[1:3] < [2e-10, 1e-6]).all()
