"""Elementary functions against 50 digits, and lanes against one cell."""

import sys

import numpy as np
import pytest
from columns import relative_error
from loops import each_cell, entry
from mpmath import acos, asin, atan, cbrt, cos, cosh, exp, expm1, hypot, log, log1p, mp, mpf, sin, sinh, tanh

from kernels.lanes.jit import COMPILED, jit
from kernels.lanes.vectors import magnitude
from kernels.maths import elementary

mp.dps = 50


@jit
def _functions(i, x, u, power, root, late, lost):
    power[i] = elementary.exp_or_nan(x[i])
    root[i] = elementary.cbrt(u[i])
    late[i] = elementary.exp_remainder(u[i])
    lost[i] = elementary.log_remainder(u[i])


@entry
def functions(x, u, power, root, late, lost):
    each_cell(_functions, (x, u, power, root, late, lost))


def evaluated(loop, outputs, *columns):
    """As many columns as the loop has outputs."""
    found = [np.empty(len(columns[0])) for _ in range(outputs)]
    loop(*(np.ascontiguousarray(column, float) for column in columns), *found)
    return found


def test_exp_is_right_to_an_ulp_from_underflow_to_overflow():
    x = np.concatenate([np.random.default_rng(1).uniform(-700, 700, 300), np.linspace(-1, 1, 101)])
    power = evaluated(functions, 4, x, np.ones_like(x))[0]
    assert relative_error(power, [exp(mpf(v)) for v in x]).max() < 2.3e-16
    ends = evaluated(functions, 4, [-1e300, -800.0, 0.0, 800.0, 1e300, np.nan], np.ones(6))[0]
    np.testing.assert_array_equal(ends, [0.0, 0.0, 1.0, np.inf, np.inf, np.nan])


def test_cube_root_is_right_to_an_ulp_over_all_exponents():
    u = np.exp2(np.concatenate([np.random.default_rng(2).uniform(-1000, 1000, 400), np.arange(-4, 5)]))
    assert relative_error(evaluated(functions, 4, np.zeros_like(u), u)[1], [cbrt(mpf(v)) for v in u]).max() < 1.5e-16


@pytest.mark.parametrize("top", [1e-12, 1e-3, 0.9999, 1.0, 1e15])
def test_remainders_keep_their_digits_where_the_plain_forms_cancel(top):
    """u - log(1 + u) lost, exp(-u) - 1 + u late; beyond 1 only the latter."""
    u = np.append(np.geomspace(1, top, 200) if top > 1 else top * np.random.default_rng(3).uniform(0.01, 1, 200), top)
    _, _, late, lost = evaluated(functions, 4, np.zeros_like(u), u)
    assert relative_error(late, [mpf(v) + expm1(-mpf(v)) for v in u]).max() < 6e-16
    assert top > 1 or relative_error(lost, [mpf(v) - log1p(mpf(v)) for v in u]).max() < 6e-16


@jit
def _more(i, x, u, y, logs, logs1, powers_less, sines, cosines, angles, powers, thirds):
    logs[i] = elementary.log(magnitude(x[i]))
    logs1[i] = elementary.log1p(u[i])
    powers_less[i] = elementary.expm1(x[i])
    sines[i], cosines[i] = elementary.sincos(x[i])
    angles[i] = elementary.arctan(x[i])
    powers[i] = elementary.power(magnitude(x[i]), y[i])
    ratio = u[i] / (1.0 + magnitude(u[i]))
    thirds[i] = elementary.log_remainder3(0.5 * ratio)


@entry
def more(x, u, y, logs, logs1, powers_less, sines, cosines, angles, powers, thirds):
    each_cell(_more, (x, u, y, logs, logs1, powers_less, sines, cosines, angles, powers, thirds))


@pytest.mark.parametrize("top", [1e-8, 0.1, 1.0, 3.0, 30.0, 300.0])
def test_elementary_functions_are_right_to_a_few_ulp(top):
    random = np.random.default_rng(7)
    n = 400 if COMPILED else 40
    x, y = random.uniform(-top, top, n), random.uniform(0, 4, n)
    u = np.where(x < 0, np.expm1(np.maximum(x, -30)), x)
    logs, logs1, powers_less, sines, cosines, angles, powers, thirds = evaluated(more, 8, x, u, y)
    exact = [mpf(float(v)) for v in x]
    ratios = [mpf(float(v)) for v in u / (1.0 + np.abs(u))]
    assert relative_error(logs, [log(abs(v)) for v in exact]).max() < 2e-16
    assert relative_error(logs1, [log1p(mpf(float(v))) for v in u]).max() < 2e-16
    assert relative_error(powers_less, [expm1(v) for v in exact]).max() < 3e-16
    assert relative_error(sines, [sin(v) for v in exact]).max() < 2.5e-16
    assert max(abs(float(mpf(float(c)) - cos(v))) for c, v in zip(cosines, exact, strict=True)) < 1.6e-16
    assert relative_error(angles, [atan(v) for v in exact]).max() < 3.5e-16
    assert relative_error(powers, [abs(v) ** mpf(float(w)) for v, w in zip(exact, y, strict=True)]).max() < 8e-16
    assert relative_error(thirds, [log1p(r / 2) - r / 2 + r * r / 8 for r in ratios]).max() < 7e-16


def test_elementary_functions_at_the_ends_of_their_ranges():
    """And over all exponents."""
    outputs = evaluated(
        more, 8, [0.0, 1e-310, np.inf, -np.inf, np.nan], [-1.0, 0.0, np.inf, -2.0, np.nan], [0, 1, 0, 0, 0]
    )
    logs, logs1, powers_less, sines, _, angles, powers, _ = outputs
    np.testing.assert_array_equal(logs[[0, 2, 3, 4]], [-np.inf, np.inf, np.inf, np.nan])
    np.testing.assert_array_equal(logs1, [-np.inf, 0.0, np.inf, np.nan, np.nan])
    assert powers_less[:4].tolist() == [0.0, 1e-310, np.inf, -1.0]
    assert sines[0] == 0.0
    assert angles[2:4].tolist() == [np.pi / 2, -np.pi / 2]
    assert powers[:2].tolist() == [1.0, 1e-310]  # 0^0 = 1
    top = [2.0**1022, np.nextafter(2.0**1023, 0.0), 2.0**1023, 1e308, sys.float_info.max]
    x = np.append(10.0 ** np.random.default_rng(8).uniform(-300, 300, 300 if COMPILED else 30), top)
    logs, logs1, _, _, _, angles, powers, _ = evaluated(more, 8, x, x, np.full_like(x, 0.37))
    exact = [mpf(float(v)) for v in x]
    assert relative_error(logs, [log(v) for v in exact]).max() < 2e-16
    assert relative_error(logs1, [log1p(v) for v in exact]).max() < 2e-16
    assert relative_error(angles, [atan(v) for v in exact]).max() < 3e-16
    assert relative_error(powers, [v ** mpf(0.37) for v in exact]).max() < 6e-16


@jit
def _hyperbolic(i, x, y, u, tanhs, sinhs, coshs, arcsins, arccosines, roots, floors, held):
    tanhs[i], sinhs[i], coshs[i] = elementary.tanh(x[i]), elementary.sinh(x[i]), elementary.cosh(x[i])
    arcsins[i], arccosines[i] = elementary.arcsin(u[i]), elementary.arccos(u[i])
    roots[i] = elementary.hypot(x[i], y[i])
    floors[i] = elementary.floor(x[i])
    held[i] = elementary.floor_between(x[i], y[i])


@entry
def hyperbolic(x, y, u, tanhs, sinhs, coshs, arcsins, arccosines, roots, floors, held):
    each_cell(_hyperbolic, (x, y, u, tanhs, sinhs, coshs, arcsins, arccosines, roots, floors, held))


def test_hyperbolic_and_inverse_functions_are_right_to_a_few_ulp_wherever_they_are_numbers():
    random = np.random.default_rng(9)
    n = 500 if COMPILED else 60
    sizes = np.concatenate([10.0 ** random.uniform(-300, 2.85, n), random.uniform(0, 30, n)])
    x, y = random.choice([-1, 1], 2 * n) * sizes, 10.0 ** random.uniform(-307, 307, 2 * n)
    edges = 1.0 - 10.0 ** random.uniform(-16, 0, n)
    u = random.choice([-1, 1], 2 * n) * np.concatenate([edges, 10.0 ** random.uniform(-300, 0, n)])
    found = evaluated(hyperbolic, 8, x, y, u)
    of_x, of_u = [mpf(float(v)) for v in x], [mpf(float(v)) for v in u]
    functions = (tanh, sinh, cosh, asin, acos)
    for values, function, exact in zip(found, functions, (of_x, of_x, of_x, of_u, of_u), strict=False):
        assert relative_error(values, [function(v) for v in exact]).max() < 5e-16, function
    x = np.append(x, [1.7e308, 0.0, 3e-320])
    y = np.append(np.where(y > 1.0, x[:-3] * random.uniform(0.1, 10, 2 * n), y), [-1e307, 0.0, 4e-320])
    roots = evaluated(hyperbolic, 8, x, y, np.zeros_like(x))[5]
    exact = [hypot(mpf(float(a)), mpf(float(b))) for a, b in zip(x[:-2], y[:-2], strict=True)]
    assert relative_error(roots[:-2], exact).max() < 3e-16
    assert roots[-2] == 0.0
    assert roots[-1] == pytest.approx(5e-320, rel=1e-3)


def test_hyperbolic_and_inverse_functions_at_the_ends_of_their_ranges():
    x, u = [np.inf, -np.inf, np.nan, 800.0, 0.0], [1.0, -1.0, np.nan, 1.0000001, 0.0]
    tanhs, sinhs, coshs, arcsins, arccosines, roots, *_ = evaluated(hyperbolic, 8, x, np.ones(5), u)
    np.testing.assert_array_equal(tanhs, [1.0, -1.0, np.nan, 1.0, 0.0])
    np.testing.assert_array_equal(sinhs, [np.inf, -np.inf, np.nan, np.inf, 0.0])
    np.testing.assert_array_equal(coshs, [np.inf, np.inf, np.nan, np.inf, 1.0])
    np.testing.assert_array_equal(arcsins, [np.pi / 2, -np.pi / 2, np.nan, np.nan, 0.0])
    np.testing.assert_array_equal(arccosines[:4], [0.0, np.pi, np.nan, np.nan])
    np.testing.assert_array_equal(roots, [np.inf, np.inf, np.nan, np.sqrt(640001.0), 1.0])


def test_a_floor_is_that_of_all_numbers_and_goes_on_as_it_is_half_a_unit_beyond():
    x = np.concatenate([np.random.default_rng(10).uniform(-1e6, 1e6, 200), np.arange(-6, 6) / 2, [1e15, 2.0**52]])
    even = np.where(np.floor(x) % 2 == 0, 1.0, -1.0)
    *_, floors, held = evaluated(hyperbolic, 8, x, even, np.zeros_like(x))
    np.testing.assert_array_equal(floors[:-1], np.floor(x[:-1]))
    np.testing.assert_array_equal(held[:-1], np.floor(x[:-1]))
    assert np.isnan(floors[-1])
    assert np.isnan(held[-1])
    x = np.array([0.9, 1.2, 1.49, -0.49, 6.3])  # of the integers 0, 0, 0, 0, 5
    *_, held = evaluated(hyperbolic, 8, x, np.array([1.0, 1.0, 1.0, 1.0, -1.0]), np.zeros(5))
    np.testing.assert_array_equal(held, [0.0, 0.0, 0.0, 0.0, 5.0])
