"""Numbers of 32 digits: a *pair* is the unevaluated sum of two float64, the second below half an ulp of the first.

Where a result is a small difference of large terms, its digits come from the digits that a float64 has no room for.
Generic in one cell or lanes. Errors are below 4e-32 of the largest operand; magnitudes between 1e-280 and 1e300.
Source: Dekker, Numer. Math. 18:224 (1971); Hida, Li & Bailey, ARITH-15 (2001).
"""

import math
from fractions import Fraction

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import fma, horner, nearest, sqrt
from kernels.maths.elementary import scale


def constant(exact):
    """The pair nearest to a Fraction."""
    high = float(exact)
    return high, float(exact - Fraction(high))


PI = (math.pi, 1.2246467991473532e-16)
_LOG2_E = 1.4426950408889634
_LN2 = (0.6931471805599453, 2.3190468138462996e-17, 5.707708438416212e-34)
_SHARES = tuple(constant(Fraction(1, math.factorial(n))) for n in range(9, 1, -1))
_TAIL = tuple(1.0 / math.factorial(n) for n in range(10, 17))


@jit
def two_sum(x, y):
    """x + y of two numbers, exactly."""
    total = x + y
    part = total - x
    return total, (x - (total - part)) + (y - part)


@jit
def _ordered_sum(x, y):
    """x + y of two numbers, exactly, for abs(x) >= abs(y)."""
    total = x + y
    return total, y - (total - x)


@jit
def two_product(x, y):
    """x y of two numbers, exactly."""
    product = x * y
    return product, fma(x, y, -product)


@jit
def negative(x):
    """-x."""
    return -x[0], -x[1]


@jit
def add(x, y):
    """x + y."""
    high, low = two_sum(x[0], y[0])
    more, least = two_sum(x[1], y[1])
    high, low = _ordered_sum(high, low + more)
    return _ordered_sum(high, low + least)


@jit
def shifted(x, number):
    """x + number."""
    high, low = two_sum(x[0], number)
    return _ordered_sum(high, low + x[1])


@jit
def times(x, y):
    """x y."""
    high, low = two_product(x[0], y[0])
    return _ordered_sum(high, fma(x[0], y[1], fma(x[1], y[0], low)))


@jit
def scaled(x, number):
    """x times a number."""
    high, low = two_product(x[0], number)
    return _ordered_sum(high, fma(x[1], number, low))


@jit_call
def over(x, y):
    """x/y."""
    first = x[0] / y[0]
    rest = add(x, negative(scaled(y, first)))
    second = rest[0] / y[0]
    rest = add(rest, negative(scaled(y, second)))
    return shifted(_ordered_sum(first, second), rest[0] / y[0])


@jit
def root(x):
    """Square root of x > 0."""
    first = sqrt(x[0])
    rest = add(x, negative(two_product(first, first)))
    return _ordered_sum(first, rest[0] / (2.0 * first))


@jit_call
def exponential(x):
    """A pair q and an integer n with e^x = (1 + q) 2^n, abs(q) < 0.42; q keeps its digits where x is small.

    e^y - 1 is summed for y = (x - n ln 2)/8, and (1 + q)^2 - 1 = q (q + 2) taken three times.
    """
    n = nearest(x[0] * _LOG2_E)
    y = add(x, negative(two_product(n, _LN2[0])))
    y = add(y, negative(two_product(n, _LN2[1])))
    y = 0.125 * y[0], 0.125 * fma(-n, _LN2[2], y[1])
    sum_ = _share_plus(_SHARES[0], two_product(y[0], horner(y[0], _TAIL)))
    for share in _SHARES[1:]:
        sum_ = _share_plus(share, times(y, sum_))
    q = times(y, _share_plus((1.0, 0.0), times(y, sum_)))
    for _ in range(3):
        q = times(q, shifted(q, 2.0))
    return q, n


@jit
def _share_plus(share, x):
    """share + x, for abs(x) below share."""
    high, low = _ordered_sum(share[0], x[0])
    return _ordered_sum(high, low + (share[1] + x[1]))


@jit
def whole(q, n):
    """(1 + q) 2^n, of `exponential`."""
    one = shifted(q, 1.0)
    return scale(one[0], n), scale(one[1], n)


@jit
def missing(q, n):
    """1 - (1 + q) 2^n for n <= 0, of `exponential`: with its digits where that is small."""
    unit = scale(0.0 * n + 1.0, n)
    return add(two_sum(0.0 * unit + 1.0, -unit), (-unit * q[0], -unit * q[1]))
