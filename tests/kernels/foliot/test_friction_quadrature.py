"""Foliots without spring and with any friction against 30 digits and more, and the closed forms of one loss alone."""

import foliot_oracles
import numpy as np
import oracles
import pytest
from columns import relative_error
from hypothesis import given, settings
from hypothesis import strategies as st
from loops import each_cell
from mpmath import atan, atanh, exp, expm1, findroot, hyp2f1, log, log1p, mp, mpf, sqrt

from kernels.foliot import _friction_quadrature as quadrature
from kernels.foliot import _single_loss
from kernels.foliot._units import Scene
from kernels.interface import Status
from kernels.lanes.columns import entry
from kernels.lanes.jit import COMPILED, jit
from kernels.lanes.vectors import where

NAMES = ("half period", "amplitude", "speed", "sensitivity", "multiplier")
SOME = 80 if COMPILED else 6
TINY = 1e-290


@jit
def _solved(i, d, rho, slack, gamma, n, e, half, amplitude, speed, s, m, for_cycle, for_s, for_m, status):
    scene = Scene(d[i], rho[i], rho[i], gamma[i], n[i], 0.0, e[i], slack[i])
    cycle, verdict = quadrature.solve_quadrature(scene, 1e-9)
    half[i], amplitude[i], speed[i], s[i], m[i] = cycle
    for_cycle[i], _, _, for_s[i], for_m[i] = quadrature.quadrature_bound(scene)
    status[i] = verdict


@entry()
def solved(d, rho, slack, gamma, n, e, half, amplitude, speed, s, m, for_cycle, for_s, for_m, status):
    each_cell(_solved, (d, rho, slack, gamma, n, e, half, amplitude, speed, s, m, for_cycle, for_s, for_m, status))


@jit
def _pure(i, d, rho, slack, gamma, n, kappa, e, half, amplitude, speed, s, m, status):
    cycle, applies = _single_loss.pure(Scene(d[i], rho[i], rho[i], gamma[i], n[i], kappa[i], e[i], slack[i]))
    half[i], amplitude[i], speed[i], s[i], m[i] = cycle
    status[i] = where(applies, 1.0, 0.0)


@entry()
def pure(d, rho, slack, gamma, n, kappa, e, half, amplitude, speed, s, m, status):
    each_cell(_pure, (d, rho, slack, gamma, n, kappa, e, half, amplitude, speed, s, m, status))


def columns(*values):
    return [np.array(c, float) for c in np.broadcast_arrays(*values)]


def solve(d=0.0, rho=0.0, gamma=0.0, n=0.0, e=1.0, function=solved):
    """The cycle, its bounds, and the status, in columns."""
    inputs = columns(np.atleast_1d(d), rho, 1.0 - np.asarray(rho), gamma, n, e)
    outputs = [np.full(len(inputs[0]), np.nan) for _ in range(8)]
    status = np.full(len(inputs[0]), 99, np.int8)
    function(*inputs, *outputs, status)
    return outputs[:5], outputs[5:], status


def solve_pure(d=0.0, rho=0.0, gamma=0.0, n=0.0, kappa=0.0, e=1.0):
    inputs = columns(np.atleast_1d(d), rho, 1.0 - np.asarray(rho), gamma, n, kappa, e)
    outputs = [np.full(len(inputs[0]), np.nan) for _ in range(5)]
    applies = np.full(len(inputs[0]), 99, np.int8)
    pure(*inputs, *outputs, applies)
    return outputs, applies == 1


def in_units(cycle):
    """An oracle's cycle at mu = phi0 = 1, as half a period."""
    return (cycle[0] / 2, *cycle[1:])


def check(cells, truths):
    """Every output is within its bound, as long as it is a normal number; the worst errors by name."""
    outputs, (for_cycle, for_s, for_m), status = solve(*cells)
    assert (status == Status.OK).all()
    worst = {}
    limits = (for_cycle, for_cycle, for_cycle, for_s, for_m)
    for j, (name, output, limit) in enumerate(zip(NAMES, outputs, limits, strict=True)):
        shown = [k for k in range(len(output)) if abs(truths[k][j]) > TINY]
        error = relative_error(output[shown], [truths[k][j] for k in shown])
        assert (output[[k for k in range(len(output)) if k not in shown]] <= TINY).all()
        if len(error):
            k = (error / limit[shown]).argmax()
            assert error[k] <= limit[shown[k]], (name, error[k], [float(c[shown[k]]) for c in columns(*cells)])
            worst[name] = error.max()
    return worst


@pytest.mark.parametrize(("low", "high"), [(-12, -1), (-1, 1), (1, 12)])
def test_viscous_friction_over_24_decades(low, high):
    d = 10 ** (-0.5 * np.random.default_rng(1).uniform(low, high, SOME))
    worst = check((d, 0.0 * d, 0.0, 1.0, 1.0), [in_units(oracles.foliot(1.0, 1.0, float(x))) for x in d])
    assert max(worst[name] for name in NAMES[:4]) < 6e-15


def linear(seed, inward):
    """Viscous and dry friction down to 1e-9 and up to 1 - 1e-9, restitution close to 1, to -1 and between."""
    random = np.random.default_rng(seed)
    d = 10 ** random.uniform(-6, 6, SOME) * (random.random(SOME) < 0.7)
    small, large = 10 ** random.uniform(-9, -0.05, SOME), 1.0 - 10 ** random.uniform(-9, -0.05, SOME)
    rho = np.choose(random.integers(0, 3, SOME), [0.0 * d, small, large])
    e = np.choose(random.integers(0, 3, SOME), [1.0 + 0.0 * d, 1.0 - 10 ** random.uniform(-15, 0, SOME), small])
    e = -1.0 + 10 ** random.uniform(-7, 0, SOME) if inward else e
    d = np.where((d == 0.0) & (rho == 0.0) & (e == 1.0), 1.0, d)
    return d, rho, 0.0 * d, 0.0 * d, e


@pytest.mark.parametrize("inward", [False, True])
def test_viscous_and_dry_friction_and_restitution_together(inward):
    cells = linear(2, inward)
    truths = [in_units(foliot_oracles.cycle(1.0, 1.0, a=d, R=r, e=e)) for d, r, _, _, e in zip(*cells, strict=True)]
    worst = check(cells, truths)
    if not inward:
        assert max(worst[name] for name in NAMES[:4]) < 2e-14


WORST = [
    {"gamma": 1.0, "n": 1.5},
    {"gamma": 1e-12, "n": 4.0},  # alpha_n = 1e6
    {"gamma": 0.034, "n": 4.0},  # v1/V near 2/3, where the pole begins to be taken out
    {"gamma": 0.8, "n": 1e-3},  # almost dry friction of 0.8, V = 1e97
    {"gamma": 1.0, "n": 1.2e-3, "d": 0.0628, "e": 0.881},
    {"gamma": 4e16, "n": 4.0, "rho": 0.983},
    {"gamma": 3.4e-7, "n": 1.04e-3, "rho": 5.7e-4},  # V = 1e6200 is no float64
    {"gamma": 1e-9, "n": 3.5, "rho": 1e-5, "d": 1e-7},
    {"gamma": 2.0, "n": 0.5, "rho": 0.999, "d": 3.0, "e": 0.7},
    {"gamma": 0.3, "n": 2.5, "rho": 0.2, "d": 0.4, "e": -0.6},
    {"gamma": 50.0, "n": 3.3, "rho": 0.1, "e": -0.99},
    {"gamma": 5.0, "n": 0.7, "e": 0.0},
    {"gamma": 0.05, "n": 2.5, "rho": 0.1, "e": 0.8},
    {"gamma": 0.02, "n": 1.5, "d": 0.01, "e": -0.5},
    {"gamma": 1.0, "n": 0.00548, "rho": 0.678, "d": 22.7, "e": 0.836},  # V = 1e-90
]


@pytest.mark.parametrize("cell", WORST if COMPILED else WORST[12:14])
def test_mixtures_and_degrees_that_are_hard(cell):
    cell = {"d": 0.0, "rho": 0.0, "gamma": 0.0, "n": 0.0, "e": 1.0, **cell}
    names = {"a": "d", "R": "rho", "c": "gamma", "n": "n", "e": "e"}
    truth = foliot_oracles.cycle(1.0, 1.0, **{name: cell[key] for name, key in names.items()}, digits=8)
    check(cell.values(), [in_units(truth)])


def power_law(n, z):
    """gamma, and the half period, amplitude and speed of drag alone: hypergeometric functions of v1/V = 1 - exp(-z).

    1/alpha_n = lambda^(n+2)/(n+2) 2F1(1, b; b + 1; lambda^(2n)), b = (n + 2)/2n; period and amplitude alike.
    """
    with mp.workdps(40):
        n = mpf(n)
        b = (n + 2) / (2 * n)
        way = lambda lam: (n + 2) * log(lam) + log(hyp2f1(1, b, b + 1, lam ** (2 * n)) / (n + 2))  # noqa: E731
        lam = -expm1(-mpf(z))
        gamma = float(exp(way(lam) * n / 2))
        target = 2 * log(mpf(gamma)) / n
        log_z = findroot(lambda t: way(-expm1(-exp(t))) - target, (log(mpf(z)), log(mpf(z)) * (1 + mpf(10) ** -15)))
        lam, V = -expm1(-exp(log_z)), mpf(gamma) ** (-1 / n)
        half = 2 * V * lam * hyp2f1(1, 1 / (2 * n), 1 / (2 * n) + 1, lam ** (2 * n))
        return gamma, (half, 1 + (V * lam) ** 2 / 2 * hyp2f1(1, 2 / n, 2 / n + 1, -(lam**n)), V * lam)


@pytest.mark.parametrize("degrees", [(1e-3, 0.1), (0.1, 1.0), (1.0, 4.0), (4.0, 16.0)])
def test_drag_of_any_degree_gives_the_hypergeometric_functions(degrees):
    random = np.random.default_rng(4)
    n = np.append(np.exp(random.uniform(*np.log(degrees), SOME // 2)), degrees[1])
    z = 10 ** random.uniform(-3.5 if degrees[1] <= 4.0 else -1.0, 1.3, len(n))  # or gamma is no float64
    gamma, truths = zip(*(power_law(float(x), float(y)) for x, y in zip(n, z, strict=True)), strict=True)
    outputs, (limit, _, _), status = solve(0.0, 0.0, gamma, n)
    assert (status == Status.OK).all()
    for j, name in enumerate(NAMES[:3]):
        error = relative_error(outputs[j], [t[j] for t in truths])
        k = (error / limit).argmax()
        assert error[k] <= limit[k], (name, error[k], limit[k], n[k], z[k])
        if degrees[1] <= 4.0:
            assert error.max() < 4e-14


def test_degree_0_is_dry_friction_and_degree_1_is_viscous():
    rho, d, more = np.array([0.1, 0.5, 0.0]), np.array([0.3, 0.0, 2.0]), np.array([0.25, 0.125, 0.5])
    for n, same in ((0.0, (d, rho + more)), (1.0, (d + more, rho))):
        drag, plain = solve(d, rho, more, n)[0], solve(*same)[0]
        for name, x, y in zip(NAMES, drag, plain, strict=True):
            np.testing.assert_allclose(x, y, rtol=1e-14, err_msg=name)


@settings(max_examples=100 if COMPILED else 15)
@given(st.floats(-8, 3), st.floats(-0.99, 1.0))
def test_with_losses_of_degree_2_only_the_period_goes_as_torque_to_minus_one_half(log_gamma, e):
    (_, _, _, s, _), _, status = solve(0.0, 0.0, 10.0**log_gamma, 2.0, e)
    assert status[0] == Status.OK
    assert s[0] == pytest.approx(0.5, rel=1e-13)


@settings(max_examples=100 if COMPILED else 15)
@given(st.floats(0, 0.99), st.floats(-3, 3), st.floats(-3, 3), st.floats(0.0, 4.0), st.floats(0.1, 1.0))
def test_the_sensitivity_is_the_slope_of_the_period(rho, log_d, log_gamma, n, e):
    d, gamma, step = 10.0**log_d, 10.0**log_gamma * (1.0 - rho if n < 0.3 else 1.0), 1e-5
    gamma = gamma * 1e-3 if n < 0.3 else gamma
    change = np.exp(step * np.array([-1.0, 0.0, 1.0]))  # of mu
    gammas = gamma * change ** (0.5 * n - 1.0)
    (half, _, _, s, _), _, status = solve(d * change**-0.5, rho / change, gammas, n, e)
    if (status == Status.OK).all() and rho + gamma * (n == 0.0) < 0.99:
        slope = 0.5 - np.log(half[2] / half[0]) / (2 * step)
        assert slope == pytest.approx(s[1], rel=1e-6, abs=1e-8 * max(1.0, abs(s[1])) ** 3)


@pytest.mark.parametrize(
    "loss", [{"rho": 0.0, "gamma": 1e-7, "n": 2.0}, {"rho": 1e-6}, {"d": 1e-8}, {"e": 0.999}], ids=str
)
def test_a_sensitivity_that_is_small_keeps_its_digits_beside_other_losses(loss):
    cell = {"d": 1e-10, "rho": 1e-5, "gamma": 0.0, "n": 0.0, "e": 1.0, **loss}
    names = {"a": "d", "R": "rho", "c": "gamma", "n": "n", "e": "e"}
    truth = foliot_oracles.cycle(1.0, 1.0, **{name: cell[key] for name, key in names.items()}, digits=8)
    assert relative_error(solve(*cell.values())[0][3], [truth[3]])[0] < 1e-14


def test_dry_friction_alone_in_closed_form():
    rho = np.concatenate([10 ** np.linspace(-300, -0.01, SOME), 1.0 - 10 ** np.linspace(-15, -0.3, SOME)])
    outputs, applies = solve_pure(0.0, rho)
    assert applies.all()
    with mp.workdps(60):
        r = [mpf(x) for x in rho]
        laws = (
            [2 * sqrt(2 / x) / sqrt(1 - x * x) for x in r], [1 / x for x in r], [sqrt(2 * (1 - x * x) / x) for x in r],
            [x * x / (1 - x * x) for x in r], [(1 - x) / (1 + x) for x in r],
        )  # fmt: skip
    for name, output, law in zip(NAMES, outputs, laws, strict=True):
        shown = np.array([abs(x) > TINY for x in law])
        assert relative_error(output[shown], [x for x in law if abs(x) > TINY]).max() < 1e-15, name


def test_quadratic_drag_alone_in_closed_form():
    gamma = 10 ** np.linspace(-60, 12, 2 * SOME)
    outputs, applies = solve_pure(0.0, 0.0, gamma, 2.0)
    assert applies.all()
    truths = []
    for g in (mpf(x) for x in gamma):
        with mp.workdps(400 if g < 200 else 40):
            if g < 200:
                lam = sqrt(sqrt(-expm1(-4 * g)))
                time, square = atanh(lam) + atan(lam), lam**2
            else:
                time, lam, square = 2 * g + 3 * log(mpf(2)) / 2 + atan(mpf(1)), mpf(1), mpf(1)
            m = exp(-4 * g) / (1 + square) ** 2
            truths.append((time / sqrt(g), 1 + log1p(square) / (2 * g), lam / sqrt(g), mpf("0.5"), m))
    for j, name in enumerate(NAMES):
        shown = [k for k in range(len(gamma)) if truths[k][j] > TINY]
        error = relative_error(outputs[j][shown], [truths[k][j] for k in shown])
        assert error.max() < (1e-15 if name != "multiplier" else 3e-15), name


def test_restitution_alone_in_closed_form():
    e = np.concatenate([1.0 - 10 ** np.linspace(-15, 0, SOME), np.linspace(-0.999, 0.999, SOME)])
    outputs, applies = solve_pure(e=e)
    assert applies.all()
    with mp.workdps(60):
        r = [mpf(x) for x in e]
        laws = (
            [2 * sqrt((1 + x) / (1 - x)) for x in r], [(1 + x * x) / (1 - x * x) if x > 0 else mpf(1) for x in r],
            [2 / sqrt(1 - x * x) for x in r], [mpf("0.5") for x in r], [x * x for x in r],
        )  # fmt: skip
    for name, output, law in zip(NAMES, outputs, laws, strict=True):
        shown = np.array([abs(x) > TINY for x in law])
        assert relative_error(output[shown], [x for x in law if abs(x) > TINY]).max() < 1e-15, name


def test_the_closed_forms_are_where_one_loss_acts_alone_and_agree_with_the_integrals():
    random = np.random.default_rng(5)
    count = 400 if COMPILED else 80
    d, rho, gamma = (10 ** random.uniform(-6, -0.31, count) * (random.random(count) < p) for p in (0.1, 0.4, 0.4))
    n = random.choice([0.0, 1.0, 2.0, 2.5], count)
    e = np.where(random.random(count) < 0.5, 1.0, random.uniform(-0.9, 1, count))
    kappa = np.where(random.random(count) < 0.1, 1e-3, 0.0)
    outputs, applies = solve_pure(d, rho, gamma, n, kappa, e)
    dry = (rho > 0.0) | ((gamma > 0.0) & (n == 0.0))
    drag, odd = (gamma > 0.0) & (n == 2.0), (gamma > 0.0) & ((n == 1.0) | (n == 2.5))
    alone = (1 * dry + drag + (e < 1.0) == 1) & ~odd & (d == 0.0) & (kappa == 0.0)
    assert np.array_equal(applies, alone)
    assert (dry & alone).any()
    assert (drag & alone).any()
    assert ((e < 0.0) & alone).any()
    integrals, _, _ = solve(d[alone], rho[alone], gamma[alone], n[alone], e[alone])
    for name, closed, integral in zip(NAMES, outputs, integrals, strict=True):
        np.testing.assert_allclose(closed[alone], integral, rtol=2e-14, err_msg=name)


def test_what_cannot_be_solved_is_said():
    rho, gamma, n = np.zeros(4), np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 1.0, 1e-3, 1e-3])
    _, (limit, _, _), status = solve(0.0, rho, gamma, n)  # nothing lost; fine; V = 2^-1000; V = 3^-1000 = 1e-477
    assert status[0] == Status.NOT_CONVERGED
    assert status[1] == Status.OK
    assert set(status[2:]) <= {Status.NOT_CONVERGED, Status.OUT_OF_RANGE}
    assert limit[1] < 2e-14
    assert not np.isfinite(limit[2:]).any()


def test_the_promise_ends_where_the_rule_does():
    _, (limit, _, _), _ = solve(0.0, 0.0, 1.0, np.array([4.0, 8.0, 16.0, 17.0]))
    assert (np.diff(limit) > 0).all()
    assert limit[0] < 2e-14
    assert np.isinf(limit[3])


@pytest.mark.parametrize(("n", "most"), [(4.5, 1e-12), (6.0, 1e-11), (8.0, 2e-10), (16.0, 1e-6)])
def test_the_bound_of_steep_friction_is_no_larger_than_what_the_rule_misses(n, most):
    _, (for_cycle, _, _), _ = solve(0.1, 0.1, 1.0, n, 0.0)
    assert 4e-14 * (n / 4) ** 11 < for_cycle[0] < most
