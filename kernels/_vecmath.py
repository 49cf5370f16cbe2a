"""Elementary functions as branch-free polynomials, generic in one cell or lanes: the same bits in both.

numba's wheels give lanes no vector math library, and a library's last digits differ from CPU to CPU.
"""

import math

from kernels._jit import jit
from kernels._lanes import exponent, fma, horner, nearest, pow2, where
from kernels._viscous_fit import LOG_TAIL

LN2 = math.log(2.0)
_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 0.6931471805599453, 2.3190468138462996e-17
_INVERSE_FACTORIALS = tuple(1.0 / math.factorial(n) for n in range(2, 14))
_TAIL_FACTORIALS = tuple((-1.0) ** n / math.factorial(n + 2) for n in range(17))
# r with r^-3 within 2.6e-4 of m on [1, 2), and the cube roots of 1, 1/2, 1/4
_CBRT_START = (1.541886, -0.80995816, 0.31775564, -0.04993657)
_CBRT_HALF, _CBRT_QUARTER = 0.7937005259840998, 0.6299605249474366


@jit
def scale(x, n):
    """x 2^n for an integer-valued n and x between 1e-300 and 1e300; overflows to inf and underflows to 0."""
    n = where(n > -2040.0, n, -2040.0)
    n = where(n < 2040.0, n, 2040.0)
    half = nearest(0.5 * n)
    return x * pow2(half) * pow2(n - half)


@jit
def mantissa_exponent(x):
    """m in [1, 2) and e with x = m 2^e, exact for every positive finite x, subnormal ones included."""
    small = x < 1e-290
    normal = where(small, x * 2.0**128, x)
    e = exponent(normal)
    return scale(normal, -e), where(small, e - 128.0, e)


@jit
def exp(x):
    """e^x within 1 ulp; 0 below -745, inf above 710."""
    x = where(x > -760.0, x, -760.0)
    x = where(x < 720.0, x, 720.0)
    n = nearest(x * _LOG2_E)
    r = fma(-n, _LN2_LOW, fma(-n, _LN2_HIGH, x))  # abs(r) <= 0.347
    return scale(1.0 + fma(r * r, horner(r, _INVERSE_FACTORIALS), r), n)


@jit
def cbrt(x):
    """Cube root of a positive normal x, within 0.6 ulp."""
    e = exponent(x)
    third = nearest((e - 1.0) * (1.0 / 3.0))
    j = e - 3.0 * third  # 0, 1, 2
    r = horner(x * pow2(-e), _CBRT_START) * where(j > 0.5, where(j > 1.5, _CBRT_QUARTER, _CBRT_HALF), 1.0)
    f = x * pow2(-3.0 * third)  # [1, 8)
    error = fma(-(f * r), r * r, 1.0)
    r = fma(r * error, fma(error, fma(error, 14.0 / 81.0, 2.0 / 9.0), 1.0 / 3.0), r)
    y = f * (r * r)
    y = fma(fma(-(y * y), y, f) * (1.0 / 3.0), r * r, y)
    return y * pow2(third)


@jit
def exp_remainder(z):
    """z - 1 + exp(-z) for z >= 0, to a few ulp: z^2/2 - z^3/6 + ... where the plain form would cancel."""
    near = where(z < 1.0, z, 1.0)
    return where(z < 1.0, (near * near) * horner(near, _TAIL_FACTORIALS), (z - 1.0) + exp(-z))


@jit
def log_remainder(u):
    """u - ln(1 + u) for 0 <= u <= 1, to a few ulp: with s = u/(2 + u) it is s (u - 2 s^2 (1/3 + s^2/5 + ...))."""
    s = u / (2.0 + u)
    v = s * s
    return s * fma(-2.0 * v, horner(v, LOG_TAIL), u)
