"""Elementary functions as branch-free polynomials, generic in one cell or lanes: the same bits in both.

numba's wheels give lanes no vector math library, and a library's last digits differ from CPU to CPU.
"""

import math

from kernels.lanes.jit import jit
from kernels.lanes.vectors import exponent, fma, horner, magnitude, nearest, pow2, sqrt, where

LN2 = math.log(2.0)
NORMAL_LOW, NORMAL_HIGH = 2.3e-308, 1.79e308
_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 0.6931471805599453, 2.3190468138462996e-17
_INVERSE_FACTORIALS = tuple(1.0 / math.factorial(n) for n in range(2, 14))
_TAIL_FACTORIALS = tuple((-1.0) ** n / math.factorial(n + 2) for n in range(17))
# r with r^-3 within 2.6e-4 of m on [1, 2), and the cube roots of 1, 1/2, 1/4
_CBRT_START = (1.541886, -0.80995816, 0.31775564, -0.04993657)
_CBRT_HALF, _CBRT_QUARTER = 0.7937005259840998, 0.6299605249474366
_SQRT_HALF, _SQRT_2 = 0.7071067811865476, 1.4142135623730951
_LOG_SERIES = tuple(2.0 / (2 * j + 3) for j in range(11))  # of ln((1 + s)/(1 - s)) - 2s, for abs(s) < 0.172
_TWO_OVER_PI = 0.6366197723675814
_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)
_SINE = tuple((-1.0) ** j / math.factorial(2 * j + 3) for j in range(8))
_COSINE = tuple((-1.0) ** j / math.factorial(2 * j + 4) for j in range(8))
LOG_TAIL = (
    0.3333333333333333,
    0.2000000000000001,
    0.14285714285710677,
    0.11111111111710455,
    0.09090909039577066,
    0.076923102801411,
    0.06666584219469844,
    0.05884074478545722,
    0.05239339771041137,
    0.049770672966691326,
    0.03143025125292994,
    0.07656715655214262,
)
"""(atanh(s)/s - 1)/s^2 in s^2, 0 <= s <= 1/3."""
_TAN_PI_8 = 0.41421356237309503
_ARCTAN = tuple((-1.0) ** (j + 1) / (2 * j + 3) for j in range(20))


@jit
def is_normal(x):
    """Whether a positive result is a normal float64."""
    return (x >= NORMAL_LOW) & (x <= NORMAL_HIGH)


@jit
def larger(x, y):
    """The larger of two numbers; y where either is NaN."""
    return where(x > y, x, y)


@jit
def smaller(x, y):
    """The smaller of two numbers; y where either is NaN."""
    return where(x < y, x, y)


@jit
def scale(x, n):
    """x 2^n for an integer-valued n and x between 1e-300 and 1e300; overflows to inf and underflows to 0."""
    n = where(n > -2040.0, n, -2040.0)
    n = where(n < 2040.0, n, 2040.0)
    half = nearest(0.5 * n)
    return x * pow2(half) * pow2(n - half)


@jit
def measured(x, n):
    """x 2^n, a size in its unit; NaN where that is no normal float64."""
    size = scale(x, n)
    return where(is_normal(size), size, math.nan)


@jit
def mantissa_exponent(x):
    """m in [1, 2) and e with x = m 2^e, exact for every positive finite x, subnormal ones included."""
    small = x < 1e-290
    normal = where(small, x * 2.0**128, x)
    e = exponent(normal)
    return scale(normal, -e), where(small, e - 128.0, e)


@jit
def in_unit(x, e):
    """x over 2^e for x >= 0, without overflow on the way."""
    m, own = mantissa_exponent(where(x > 0.0, x, 1.0))
    return where(x > 0.0, scale(m, own - e), 0.0)


@jit
def scaled_root(m, e):
    """sqrt(m 2^e) for a positive m, as a number again and the exponent of its unit."""
    half = nearest(0.5 * e - 0.25)
    return sqrt(m * where(e - 2.0 * half > 0.5, 2.0, 1.0)), half


@jit
def exp(x):
    """e^x within 1 ulp; 0 below -745, inf above 710, and 0 of NaN."""
    x = where(x > -760.0, x, -760.0)
    x = where(x < 720.0, x, 720.0)
    n = nearest(x * _LOG2_E)
    r = fma(-n, _LN2_LOW, fma(-n, _LN2_HIGH, x))  # abs(r) <= 0.347
    return scale(1.0 + fma(r * r, horner(r, _INVERSE_FACTORIALS), r), n)


@jit
def cbrt(x):
    """Cube root of a positive normal x below 2^1023, within 0.6 ulp."""
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


@jit
def log_remainder3(x):
    """ln(1 + x) - x + x^2/2 for -1/2 <= x <= 1, to a few ulp: x^2 s/2 + 2 s^3 (1/3 + s^2/5 + ...), s = x/(2 + x)."""
    s = x / (2.0 + x)
    v = s * s
    return s * fma(2.0 * v, horner(v, LOG_TAIL), 0.5 * (x * x))


@jit
def _reduced(x):
    """f in [sqrt(1/2) - 1, sqrt(2) - 1] and e with x = (1 + f) 2^e, for finite x from 2^-1021 on."""
    e = exponent(x)
    m = (0.5 * x) * pow2(1.0 - e)  # from x = 2^1023 on 2^-e is no normal number
    high = m > _SQRT_2
    return where(high, 0.5 * m, m) - 1.0, where(high, e + 1.0, e)


@jit
def _log_sum(f, e, rest):
    """ln(1 + f) + e ln 2 + rest, for f as in `_reduced`."""
    s = f / (2.0 + f)
    v = s * s
    half = 0.5 * f * f
    tail = s * fma(v, horner(v, _LOG_SERIES), half) + fma(e, _LN2_LOW, rest)
    return fma(e, _LN2_HIGH, f - (half - tail))


@jit
def log(x):
    """Natural logarithm within 1 ulp; -inf at 0, inf at inf, NaN below 0."""
    small = x < 1e-290
    normal = where(small, x * 2.0**128, x)
    f, e = _reduced(where((normal > 0.0) & (normal < math.inf), normal, 1.0))
    value = _log_sum(f, where(small, e - 128.0, e), 0.0)
    value = where(x > 0.0, value, where(x < 0.0, math.nan, x - math.inf))  # NaN stays
    return where(x < math.inf, value, x)


@jit
def log1p(u):
    """ln(1 + u) within 1 ulp, u > -1; -inf at -1, inf at inf, NaN below -1."""
    near = (u > _SQRT_HALF - 1.0) & (u < _SQRT_2 - 1.0)
    y = 1.0 + u
    back = y - 1.0
    lost = (1.0 - (y - back)) + (u - back)  # y + lost = 1 + u exactly
    inside = (y > 0.0) & (y < math.inf)
    f, e = _reduced(where(inside, y, 1.0))
    far = _log_sum(f, e, where(inside, lost / y, 0.0))
    value = where(near, _log_sum(where(near, u, 0.0), 0.0, 0.0), far)
    value = where(y > 0.0, value, where(y < 0.0, math.nan, y - math.inf))
    return where(y < math.inf, value, y)


@jit
def exp_or_nan(x):
    """As `exp`; NaN of NaN."""
    return where(magnitude(x) >= 0.0, exp(x), x)


@jit
def expm1(x):
    """e^x - 1 within 1.5 ulp; -1 below -745, inf above 710, and -1 of NaN."""
    x = where(x > -760.0, x, -760.0)
    x = where(x < 720.0, x, 720.0)
    n = nearest(x * _LOG2_E)
    r = fma(-n, _LN2_LOW, fma(-n, _LN2_HIGH, x))
    part = fma(r * r, horner(r, _INVERSE_FACTORIALS), r)
    middle = where((n > -60.0) & (n < 60.0), n, 0.0)
    two = pow2(middle)
    return where(n < 60.0, where(n > -60.0, fma(two, part, two - 1.0), -1.0), scale(1.0 + part, n))


@jit
def sincos(x):
    """Sine and cosine, within 1 ulp of the larger for abs(x) < 1e7."""
    n = nearest(x * _TWO_OVER_PI)
    first = fma(-n, _HALF_PI[0], x)
    r = fma(-n, _HALF_PI[1], first)  # abs(r) <= pi/4
    v = r * r
    s = fma(r * v, -horner(v, _SINE), r)
    c = 1.0 - v * (0.5 - v * horner(v, _COSINE))
    q = n - 4.0 * nearest(0.25 * n)  # -2, -1, 0, 1, 2
    odd = (magnitude(q) > 0.5) & (magnitude(q) < 1.5)
    sine, cosine = where(odd, c, s), where(odd, s, c)
    return where((q < -0.5) | (q > 1.5), -sine, sine), where((q > 0.5) | (q < -1.5), -cosine, cosine)


@jit
def arctan(x):
    """Inverse tangent within 1.5 ulp, in (-pi/2, pi/2)."""
    a = magnitude(x)
    steep = a > 1.0
    b = where(steep, 1.0 / a, a)
    middle = b > _TAN_PI_8
    c = where(middle, (b - 1.0) / (b + 1.0), b)
    v = c * c
    value = fma(c * v, horner(v, _ARCTAN), c)
    value = where(middle, 0.5 * _HALF_PI[0] + value, value)
    value = where(steep, _HALF_PI[0] - (value - _HALF_PI[1]), value)
    return where(x < 0.0, -value, value)


@jit
def arctan2(y, x):
    """The angle of the point (x, y) within 2 ulp, in [-pi, pi]; 0 of (0, 0)."""
    steep = magnitude(y) > magnitude(x)
    low, high = where(steep, x, y), where(steep, y, x)
    angle = arctan(low / where(magnitude(high) > 0.0, high, 1.0))
    flat = where(x < 0.0, where(y >= 0.0, angle + math.pi, angle - math.pi), angle)
    return where(steep, where(y > 0.0, 0.5 * math.pi, -0.5 * math.pi) - angle, flat)


@jit
def tanh(x):
    """Hyperbolic tangent within 3 ulp: of t = e^(-2 abs(x)) - 1 it is -t/(2 + t)."""
    t = expm1(-2.0 * magnitude(x))
    value = -t / (2.0 + t)
    return where(x < 0.0, -value, where(x >= 0.0, value, x))


@jit
def cosh(x):
    """Hyperbolic cosine within 3 ulp; inf where it is no float64."""
    half = exp_or_nan(0.5 * magnitude(x))
    return (0.5 * half) * half + (0.5 / half) / half


@jit
def sinh(x):
    """Hyperbolic sine within 3 ulp: of t = e^abs(x) - 1 it is (t + t/(t + 1))/2; +-inf where it is no float64."""
    a = magnitude(x)
    near = a < 20.0
    t, half = expm1(where(near, a, 0.0)), exp(0.5 * a)
    value = where(near, 0.5 * (t + t / (t + 1.0)), (0.5 * half) * half)
    return where(x < 0.0, -value, where(x >= 0.0, value, x))


@jit
def arcsin(x):
    """Inverse sine within 4 ulp; NaN beyond [-1, 1]."""
    return arctan(x / sqrt((1.0 - x) * (1.0 + x)))


@jit
def arccos(x):
    """Inverse cosine within 4 ulp; NaN beyond [-1, 1]."""
    return 2.0 * arctan(sqrt((1.0 - x) / (1.0 + x)))


@jit
def hypot(x, y):
    """sqrt(x^2 + y^2) within 2 ulp, without overflow on the way."""
    a, b = magnitude(x), magnitude(y)
    most = larger(a, b)
    _, e = mantissa_exponent(where(most > 0.0, most, 1.0))
    a, b = scale(a, -e), scale(b, -e)
    value = scale(sqrt(fma(a, a, b * b)), e)
    return where((magnitude(x) < math.inf) & (magnitude(y) < math.inf), value, magnitude(x) + magnitude(y))


@jit
def floor(x):
    """The largest integer that is not above x, for abs(x) < 2^51; NaN beyond."""
    n = nearest(x)
    return where(magnitude(x) < 2.0**51, where(n > x, n - 1.0, n), math.nan)


@jit
def floor_between(x, sign):
    """The integer n below x that is even where the sign is 1, odd where it is -1; x may be 1/2 out of [n, n + 1].

    For abs(x) < 2^50; NaN beyond.
    """
    odd = where(sign < 0.0, 1.0, 0.0)
    n = 2.0 * nearest(0.5 * (x - 0.5 - odd)) + odd
    return where(magnitude(x) < 2.0**50, n, math.nan)


@jit
def power(x, y):
    """x^y for finite x >= 0 and finite y >= 0 or x > 0, within 2 + y ulp: 2^(y e) m^y for x = m 2^e; 0^0 = 1."""
    positive = x > 0.0
    m, e = mantissa_exponent(where(positive, x, 1.0))
    high = m > _SQRT_2
    f, e = where(high, 0.5 * m, m) - 1.0, where(high, e + 1.0, e)
    whole = y * e
    rest = fma(y, e, -whole)
    n = nearest(whole)
    t = y * _log_sum(f, 0.0, 0.0) + ((whole - n) + rest) * LN2
    value = scale(exp(t), n)
    return where(positive, value, where(y > 0.0, 0.0, 1.0))
