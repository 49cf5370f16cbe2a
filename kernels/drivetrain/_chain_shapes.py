"""Mode shapes of a chain, right to the rounding over the relative gap between frequencies; small entries keep digits.

At a natural frequency the chain is followed from either end, x the angle and g what torque it takes on its inner side:
    g_j = g_(j-1) - w^2 J_j x_j,  x_(j+1) = x_j + g_j/k_j,  from x_1 = 1, g_0 = 0;                       (1)
the same from the right, from x_n = 1 and the torque k_n of the last spring. Each step is exact for an inertia and a
spring a few roundings off. Both are joined at the inertia r where J_r x_r(left) x_r(right) is largest: there the torque
that is missing for a rounding in w^2 is least felt.
Source: Holzer's method; the joint is that of Parlett & Dhillon, Linear Algebra Appl. 267:247 (1997), section 3.
"""

from kernels.drivetrain._chain import same, units
from kernels.lanes.codes import OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import exponent, fma, magnitude, sqrt
from kernels.maths.elementary import is_normal, scale

_TWO_PI = 6.283185307179586


@jit
def _renormed(x, g, e):
    """x and g over a power of two that brings the larger near 1, and the exponent with that added."""
    size = max(magnitude(x), magnitude(g))
    if 1e-100 < size < 1e100:
        return x, g, e
    own = exponent(size)
    return scale(x, -own), scale(g, -own), e + own


@jit_apart
def _follow(n, J, k, e_J, e_k, square, step, ways):
    """x, g before the inertia, and the exponent of both, of each inertia, into three rows of n; step is 1 or -1."""
    x, g, e = 1.0, 0.0 if step > 0 else scale(k[n - 1], -e_k), 0.0
    j, offset = (0, 0) if step > 0 else (n - 1, 3 * n)
    for left in range(n, 0, -1):
        ways[offset + j], ways[offset + n + j], ways[offset + 2 * n + j] = x, g, e
        if left > 1:
            g = fma(-square * scale(J[j], -e_J), x, g)
            x = x + g / scale(k[j if step > 0 else j - 1], -e_k)
            x, g, e = _renormed(x, g, e)
            j += step


@jit_apart
def _joint(n, J, e_J, ways):
    """The inertia r at which J x(left) x(right) is largest."""
    best, top, power = 0, 0.0, 0.0
    for j in range(n):
        size = magnitude(ways[j] * ways[3 * n + j]) * scale(J[j], -e_J)
        e = ways[2 * n + j] + ways[5 * n + j]
        if size > 0.0 and (not top > 0.0 or size > scale(top, power - e)):
            best, top, power = j, size, e
    return best


@jit_apart
def _join(n, J, e_J, ways):
    """The shape into the first n of `ways`, 1 at the joint in size; its sum J x^2."""
    r = _joint(n, J, e_J, ways)
    side = 1.0 if ways[r] > 0.0 else -1.0
    left, right, total = ways[r], ways[3 * n + r], 0.0
    for j in range(n):
        x = ways[j] / left if j <= r else ways[3 * n + j] / right
        offset = 2 * n if j <= r else 5 * n
        x = scale(x * side, ways[offset + j] - ways[offset + r])
        ways[j] = x
        total = fma(scale(J[j], -e_J) * x, x, total)
    return total


@jit
def follow_mode(n, J, k, e_J, e_k, frequency, work):
    """Puts the shape at a natural frequency, 1 at some inertia in size, into `work`; its sum J x^2, without units."""
    root = scale(frequency * _TWO_PI, -0.5 * (e_k - e_J)) if frequency > 0.0 else 0.0
    _follow(n, J, k, e_J, e_k, root * root, 1, work)
    _follow(n, J, k, e_J, e_k, root * root, -1, work)
    return _join(n, J, e_J, work)


@jit_apart
def mode_shapes(n, J, k, frequency, shape, work):
    """shape[i, j] of mass i in mode j [1/sqrt(kg m^2)], with sum_i J_i shape[i, j]^2 = 1 and shape[0, j] >= 0.

    frequency [Hz] is that of `natural_frequencies`; work has room for 6 n.
    """
    e_J, e_k, sound = units(n, same, J, k)
    for j in range(n):
        total = follow_mode(n, J, k, e_J, e_k, frequency[j], work)
        sound = sound & is_normal(total)
        for i in range(n):
            shape[i, j] = scale(work[i] / sqrt(total), -0.5 * e_J)
    return OK if sound else OUT_OF_RANGE
