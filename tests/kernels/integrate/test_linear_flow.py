"""The exact flow of a linear piece against 50 digits, over all dampings and across their borders."""

import numpy as np
import pytest
from columns import relative_error
from loops import each_cell
from mpmath import cosh, exp, mp, mpf, sinh, sqrt

from kernels.integrate import linear_flow
from kernels.lanes.columns import entry
from kernels.lanes.jit import COMPILED, jit

SOME = 300 if COMPILED else 20


@jit
def _evaluate(i, beta, kappa, v, f, t, way, impulse, force, slope, lost, reversal, crossing):
    impulse[i], force[i], slope[i] = linear_flow.response(beta[i], kappa[i], t[i])
    lost[i] = linear_flow.loss(beta[i], kappa[i], t[i])
    reversal[i] = linear_flow.first_reversal(beta[i], kappa[i], v[i], f[i])
    crossing[i] = linear_flow.first_crossing(beta[i], kappa[i], v[i], f[i], way[i])


@entry()
def evaluate_columns(beta, kappa, v, f, t, way, impulse, force, slope, lost, reversal, crossing):
    each_cell(_evaluate, (beta, kappa, v, f, t, way, impulse, force, slope, lost, reversal, crossing))


def evaluate(beta, kappa, v=1.0, f=1.0, t=1.0, way=1.0):
    columns = np.broadcast_arrays(*(np.asarray(c, float) for c in (beta, kappa, v, f, t, way)))
    outputs = [np.full(columns[0].shape, np.nan) for _ in range(6)]
    evaluate_columns(*(np.ascontiguousarray(c) for c in columns), *outputs)
    return dict(zip(("S", "C", "slope", "K", "reversal", "crossing"), outputs, strict=True))


def exact(beta, kappa, t):
    """S, C, S' and K at time t: 120 digits, so that no form cancels."""
    with mp.workdps(120):
        beta, kappa, t = mpf(float(beta)), mpf(float(kappa)), mpf(float(t))
        if kappa == 0 and beta == 0:
            return t, t * t / 2, mpf(1), t**3 / 3
        root = sqrt(beta * beta - kappa)
        if root == 0:
            s, slope = t * exp(-beta * t), (1 - beta * t) * exp(-beta * t)
            k = (1 - exp(-2 * beta * t) * (1 + 2 * beta * t + 2 * (beta * t) ** 2)) / (4 * beta**3)
        else:
            s = exp(-beta * t) * sinh(root * t) / root
            slope = exp(-beta * t) * (cosh(root * t) - beta * sinh(root * t) / root)
            k = _square(beta, root, t)
        c = (1 - slope - 2 * beta * s) / kappa if kappa else (t - s) / (2 * beta)
        return s.real, c.real, slope.real, k.real


def _square(beta, root, t):
    """Integral of e^(-2 beta t) sinh(root t)^2/root^2, term by term."""

    def integral(rate):
        return t if rate == 0 else (exp(rate * t) - 1) / rate

    return (integral(2 * (root - beta)) - 2 * integral(-2 * beta) + integral(-2 * (root + beta))) / (4 * root * root)


def grid(n, seed, dampings):
    """beta, kappa, t with sqrt(kappa) t up to 3 and zeta spread over `dampings` (log10), kappa = 0 among them."""
    random = np.random.default_rng(seed)
    omega = 10 ** random.uniform(-6, 0.5, n)
    zeta = 10 ** random.uniform(*dampings, n)
    t = 10 ** random.uniform(-3, 3, n)
    return zeta * omega / t, np.where(random.random(n) < 0.1, 0.0, (omega / t) ** 2), t


@pytest.mark.parametrize("dampings", [(-12, -1), (-1, -0.05), (-0.05, 0.05), (0.05, 2.0)])
def test_responses_and_loss_keep_their_digits_in_every_regime(dampings):
    beta, kappa, t = grid(SOME, 1, dampings)
    got = evaluate(beta, kappa, t=t)
    truth = [exact(*cell) for cell in zip(beta, kappa, t, strict=True)]
    for name, column, allowed in (("S", 0, 2e-15), ("C", 1, 2e-15), ("K", 3, 6e-15)):
        error = relative_error(got[name], [row[column] for row in truth])
        worst = error.argmax()
        assert error[worst] < allowed, (name, beta[worst] * t[worst], kappa[worst] * t[worst] ** 2)
    slope = np.array([float(abs(mpf(float(g)) - row[2])) for g, row in zip(got["slope"], truth, strict=True)])
    assert slope.max() < 2e-15


@pytest.mark.parametrize("p", [0.3, 0.5, 0.99, 1.0, 1.01, 1.5, 3.0, 30.0, -0.3, -1.2])
def test_no_digit_is_lost_at_the_border_of_critical_damping(p):
    steps = np.array([0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 0.05, 0.3])
    w = p * p * np.concatenate([1 + steps, 1 - steps])
    got = evaluate(p, w)
    truth = [exact(p, x, 1.0) for x in w]
    for name, column in (("S", 0), ("C", 1), ("K", 3)):
        assert relative_error(got[name], [row[column] for row in truth]).max() < 6e-15, name


def test_motion_backwards_is_negative_damping():
    random = np.random.default_rng(3)
    p, w = -random.uniform(0, 1.5, SOME), random.uniform(0, 2.4, SOME)
    got = evaluate(p, w)
    truth = [exact(*cell, 1.0) for cell in zip(p, w, strict=True)]
    for name, column in (("S", 0), ("C", 1), ("K", 3)):
        assert relative_error(got[name], [row[column] for row in truth]).max() < 6e-15, name


def starts(n, seed):
    random = np.random.default_rng(seed)
    beta, kappa = 10 ** random.uniform(-8, 2, n), 10 ** random.uniform(-8, 2, n)
    beta = np.where(random.random(n) < 0.1, 0.0, beta)
    kappa = np.where(random.random(n) < 0.1, 0.0, kappa)
    return beta, kappa, 10 ** random.uniform(-3, 3, n), random.choice([-1, 1], n) * 10 ** random.uniform(-3, 3, n)


def velocity(cell, t):
    beta, kappa, v, f = (mpf(float(x)) for x in cell)
    s, _, slope, _ = exact(beta, kappa, t)
    return v * slope + f * s


def test_first_reversal_is_where_the_speed_vanishes_or_none_is_certified():
    columns = starts(SOME, 5)
    reversal = evaluate(*columns)["reversal"]
    for t, *cell in zip(reversal, *columns, strict=True):
        beta, kappa, _v, f = cell
        if np.isfinite(t):
            top = abs(velocity(cell, 0)) + abs(f) * t
            assert velocity(cell, t * (1 - 1e-13)) > -1e-13 * top
            assert velocity(cell, t * (1 + 1e-13)) < 1e-13 * top
            assert all(velocity(cell, t * x) > 0 for x in (0.1, 0.5, 0.9, 0.99))
        else:
            assert beta * beta >= kappa
            assert all(velocity(cell, t) >= 0 for t in np.geomspace(1e-3, 30, 9) / max(beta, 1e-3))


def way_at(cell, t):
    beta, kappa, v, f = (mpf(float(x)) for x in cell)
    s, c, _, _ = exact(beta, kappa, t)
    return v * s + f * c


def test_first_crossing_is_the_root_or_certified_out_of_reach():
    beta, kappa, v, f = starts(SOME, 6)
    v = np.where(np.random.default_rng(6).random(SOME) < 0.3, 0.0, v)
    f = np.where(v == 0.0, np.abs(f), f)
    way = 10 ** np.random.default_rng(7).uniform(-3, 3, SOME)
    got = evaluate(beta, kappa, v, f, way=way)
    found = np.isfinite(got["crossing"])
    assert 0.2 < found.mean() < 0.9
    for i in range(SOME):
        cell, t = (beta[i], kappa[i], v[i], f[i]), got["crossing"][i]
        until = got["reversal"][i]
        if found[i]:
            assert t <= until * (1 + 1e-15)
            with mp.workdps(50):
                miss = (way_at(cell, t) - mpf(way[i])) / (velocity(cell, t) * mpf(t))
            grazing = 1e-15 * way[i] / float(velocity(cell, t) * t)
            assert abs(miss) < 4e-15 + 4 * grazing, cell
        else:
            last = min(until, 1e4 * max(beta[i], 1.0) / max(kappa[i], beta[i] * 1e-3, 1e-9))
            assert way_at(cell, last) < way[i] * (1 + 1e-14), cell


def test_a_level_beyond_the_asymptote_of_a_creeping_motion_is_out_of_reach():
    got = evaluate(
        [2.0, 2.0, 2.0, 2.0], [1.0, 1.0, 0.0, 0.0], v=[0, 0, 1, 1], f=[1, 1, 0, 0], way=[0.999999, 1.0001, 0.249, 0.251]
    )
    assert np.isfinite(got["crossing"]).tolist() == [True, False, True, False]
