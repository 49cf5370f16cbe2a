"""Elementary functions against 50 digits, and lanes against one cell."""

import numpy as np
import pytest
from columns import relative_error
from loops import each_cell
from mpmath import atan, atanh, cbrt, cos, exp, expm1, log, log1p, mp, mpf, sin

from kernels.lanes.columns import entry
from kernels.lanes.jit import COMPILED, jit
from kernels.lanes.vectors import magnitude
from kernels.maths import elementary

mp.dps = 50


@jit
def _functions(i, x, u, power, root, late, lost):
    power[i] = elementary.exp(x[i])
    root[i] = elementary.cbrt(u[i])
    late[i] = elementary.exp_remainder(u[i])
    lost[i] = elementary.log_remainder(u[i])


@entry()
def functions(x, u, power, root, late, lost):
    each_cell(_functions, (x, u, power, root, late, lost))


def evaluate(x, u):
    outputs = [np.empty(len(x)) for _ in range(4)]
    functions(np.ascontiguousarray(x, float), np.ascontiguousarray(u, float), *outputs)
    return outputs


def test_exp_is_right_to_an_ulp_from_underflow_to_overflow():
    x = np.concatenate([np.random.default_rng(1).uniform(-700, 700, 300), np.linspace(-1, 1, 101)])
    power = evaluate(x, np.ones_like(x))[0]
    assert relative_error(power, [exp(mpf(v)) for v in x]).max() < 2.3e-16
    assert evaluate([-1e300, -800.0, 0.0, 800.0, 1e300], np.ones(5))[0].tolist() == [0.0, 0.0, 1.0, np.inf, np.inf]


def test_cube_root_is_right_to_an_ulp_over_all_exponents():
    u = np.exp2(np.concatenate([np.random.default_rng(2).uniform(-1000, 1000, 400), np.arange(-4, 5)]))
    assert relative_error(evaluate(np.zeros_like(u), u)[1], [cbrt(mpf(v)) for v in u]).max() < 1.5e-16


@pytest.mark.parametrize("top", [1e-12, 1e-3, 0.9999, 1.0, 1e15])
def test_remainders_keep_their_digits_where_the_plain_forms_cancel(top):
    """u - log(1 + u) lost, exp(-u) - 1 + u late; beyond 1 only the latter."""
    u = np.append(np.geomspace(1, top, 200) if top > 1 else top * np.random.default_rng(3).uniform(0.01, 1, 200), top)
    _, _, late, lost = evaluate(np.zeros_like(u), u)
    assert relative_error(late, [mpf(v) + expm1(-mpf(v)) for v in u]).max() < 6e-16
    assert top > 1 or relative_error(lost, [mpf(v) - log1p(mpf(v)) for v in u]).max() < 6e-16


@jit
def _more(i, x, u, y, logs, logs1, powers_less, sines, cosines, angles, powers, artanhs, thirds):
    logs[i] = elementary.log(magnitude(x[i]))
    logs1[i] = elementary.log1p(u[i])
    powers_less[i] = elementary.expm1(x[i])
    sines[i], cosines[i] = elementary.sincos(x[i])
    angles[i] = elementary.arctan(x[i])
    powers[i] = elementary.power(magnitude(x[i]), y[i])
    ratio = u[i] / (1.0 + magnitude(u[i]))
    artanhs[i] = elementary.artanh(ratio)
    thirds[i] = elementary.log_remainder3(0.5 * ratio)


@entry()
def more(x, u, y, logs, logs1, powers_less, sines, cosines, angles, powers, artanhs, thirds):
    each_cell(_more, (x, u, y, logs, logs1, powers_less, sines, cosines, angles, powers, artanhs, thirds))


def evaluate_more(x, u, y):
    outputs = [np.empty(len(x)) for _ in range(9)]
    more(*(np.ascontiguousarray(c, float) for c in (x, u, y)), *outputs)
    return outputs


@pytest.mark.parametrize("top", [1e-8, 0.1, 1.0, 3.0, 30.0, 300.0])
def test_elementary_functions_are_right_to_a_few_ulp(top):
    random = np.random.default_rng(7)
    n = 400 if COMPILED else 40
    x, y = random.uniform(-top, top, n), random.uniform(0, 4, n)
    u = np.where(x < 0, np.expm1(np.maximum(x, -30)), x)
    logs, logs1, powers_less, sines, cosines, angles, powers, artanhs, thirds = evaluate_more(x, u, y)
    exact = [mpf(float(v)) for v in x]
    ratios = [mpf(float(v)) for v in u / (1.0 + np.abs(u))]
    assert relative_error(logs, [log(abs(v)) for v in exact]).max() < 2e-16
    assert relative_error(logs1, [log1p(mpf(float(v))) for v in u]).max() < 2e-16
    assert relative_error(powers_less, [expm1(v) for v in exact]).max() < 3e-16
    assert relative_error(sines, [sin(v) for v in exact]).max() < 2.5e-16
    assert max(abs(float(mpf(float(c)) - cos(v))) for c, v in zip(cosines, exact, strict=True)) < 1.6e-16
    assert relative_error(angles, [atan(v) for v in exact]).max() < 3.5e-16
    assert relative_error(powers, [abs(v) ** mpf(float(w)) for v, w in zip(exact, y, strict=True)]).max() < 8e-16
    assert relative_error(artanhs, [atanh(r) for r in ratios]).max() < 4e-16
    assert relative_error(thirds, [log1p(r / 2) - r / 2 + r * r / 8 for r in ratios]).max() < 7e-16


def test_logarithms_and_powers_hold_over_all_exponents():
    x = 10.0 ** np.random.default_rng(8).uniform(-300, 300, 300 if COMPILED else 30)
    logs, logs1, _, _, _, angles, powers, _, _ = evaluate_more(x, x, np.full_like(x, 0.37))
    exact = [mpf(float(v)) for v in x]
    assert relative_error(logs, [log(v) for v in exact]).max() < 2e-16
    assert relative_error(logs1, [log1p(v) for v in exact]).max() < 2e-16
    assert relative_error(angles, [atan(v) for v in exact]).max() < 3e-16
    assert relative_error(powers, [v ** mpf(0.37) for v in exact]).max() < 6e-16


def test_elementary_functions_at_the_ends_of_their_ranges():
    outputs = evaluate_more([0.0, 1e-310, np.inf, -np.inf, np.nan], [-1.0, 0.0, np.inf, -2.0, np.nan], [0, 1, 0, 0, 0])
    logs, logs1, powers_less, sines, _, angles, powers, _, _ = outputs
    np.testing.assert_array_equal(logs[[0, 2, 3, 4]], [-np.inf, np.inf, np.inf, np.nan])
    np.testing.assert_array_equal(logs1, [-np.inf, 0.0, np.inf, np.nan, np.nan])
    assert powers_less[:4].tolist() == [0.0, 1e-310, np.inf, -1.0]
    assert sines[0] == 0.0
    assert angles[2:4].tolist() == [np.pi / 2, -np.pi / 2]
    assert powers[:2].tolist() == [1.0, 1e-310]  # 0^0 = 1
