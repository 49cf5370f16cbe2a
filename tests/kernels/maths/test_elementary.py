"""Elementary functions against 50 digits, and lanes against one cell."""

import numpy as np
import pytest
from columns import relative_error
from hypothesis import given
from hypothesis import strategies as st
from loops import each_cell
from mpmath import atan, atanh, cbrt, cos, exp, expm1, log, log1p, mp, mpf, sin

from kernels.lanes.columns import entry
from kernels.lanes.jit import COMPILED, jit
from kernels.lanes.vectors import dot, exponent, fma, magnitude, nearest, pow2, where
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
def _compared(i, x, y, z, below, within, above, beyond, signed, chain):
    below[i], within[i] = where(x[i] < y[i], 1, 0), where(x[i] <= y[i], 1, 0)
    above[i], beyond[i] = where(x[i] > y[i], 1, 0), where(x[i] >= y[i], 1, 0)
    signed[i] = where(x[i] < y[i], 1.0 * z[i], -(1.0 * z[i]))
    chain[i] = dot((x[i], y[i], 0.1), (0.3, x[i], y[i]))


@entry()
def compared(x, y, z, below, within, above, beyond, signed, chain):
    each_cell(_compared, (x, y, z, below, within, above, beyond, signed, chain))


def test_comparisons_signs_and_chains_are_those_of_numpy():
    values = np.array([-np.inf, -1.5, -0.0, 0.0, 0.7, 1e100, np.inf, np.nan])
    x, y = (np.ascontiguousarray(v.ravel()) for v in np.meshgrid(values, values))
    z = np.random.default_rng(6).integers(-128, 128, 64).astype(np.int8)
    z[:8] = 0
    *verdicts, signed, chain = [np.full(64, 99, np.int8) for _ in range(4)] + [np.empty(64), np.empty(64)]
    compared(x, y, z, *verdicts, signed, chain)
    for verdict, expected in zip(verdicts, (x < y, x <= y, x > y, x >= y), strict=True):
        assert np.array_equal(verdict, expected)
    assert np.array_equal(signed.view(np.int64), np.where(x < y, 1.0 * z, -(1.0 * z)).view(np.int64))
    with np.errstate(all="ignore"):
        truth = [fma(0.1, b, fma(b, a, a * 0.3)) for a, b in zip(x, y, strict=True)]
    assert np.array_equal(chain, truth, equal_nan=True)


@jit
def _scaled(i, x, n, result):
    result[i] = elementary.scale(x[i], n[i])


@entry()
def scaled(x, n, result):
    each_cell(_scaled, (x, n, result))


def test_scaling_by_any_power_of_two_is_exact_or_ends_in_zero_and_infinity():
    n = np.array([-1e9, -5000.0, -2100.0, -1022.0, -1.0, 0.0, 7.0, 1023.0, 1024.0, 2100.0, 5000.0, 1e9])
    result = np.empty(12)
    scaled(np.full(12, 1.5), n, result)
    exact = [1.5 * 2.0**-1022, 0.75, 1.5, 192.0, 1.5 * 2.0**1023]
    assert result.tolist() == [0.0, 0.0, 0.0, *exact, np.inf, np.inf, np.inf, np.inf]


@jit
def _parts(i, x, e, m, r, product):
    e[i] = exponent(-x[i])
    m[i] = x[i] * pow2(-exponent(x[i]))
    r[i] = nearest(x[i])
    product[i] = fma(x[i], x[i], -x[i])


@entry()
def parts(x, e, m, r, product):
    each_cell(_parts, (x, e, m, r, product))


@given(st.floats(2.0**-500, 2.0**50))
def test_exponent_mantissa_rounding_and_multiply_add_are_exact(x):
    out = [np.empty(1) for _ in range(4)]
    parts(np.array([x]), *out)
    e, m, r, product = (column[0] for column in out)
    assert m * 2.0**e == x
    assert 1 <= m < 2
    assert r == round(x)
    assert product == float(mpf(x) * mpf(x) - mpf(x))


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


@jit
def _of_two(i, x, y, high, low):
    high[i], low[i] = elementary.larger(x[i], y[i]), elementary.smaller(x[i], y[i])


@entry()
def of_two(x, y, high, low):
    each_cell(_of_two, (x, y, high, low))


def test_of_two_numbers_the_larger_and_the_smaller_and_of_what_is_none_the_second():
    x = np.array([1.0, 2.0, -np.inf, np.inf, np.nan, 3.0, -0.0])
    y = np.array([2.0, 1.0, 0.0, 0.0, 4.0, np.nan, 0.0])
    high, low = np.empty(7), np.empty(7)
    of_two(x, y, high, low)
    np.testing.assert_array_equal(high, [2.0, 2.0, 0.0, np.inf, 4.0, np.nan, 0.0])
    np.testing.assert_array_equal(low, [1.0, 1.0, -np.inf, 0.0, 4.0, np.nan, 0.0])
    assert not np.signbit([high[-1], low[-1]]).any()
