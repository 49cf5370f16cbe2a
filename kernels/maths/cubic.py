"""The largest modulus of the three roots of x^3 + a2 x^2 + a1 x + a0: the decay of disturbances of an impact clock.

Coefficients are pairs of `pairs`: where two multipliers meet, the root has half their digits. The root on its own side
of the point of inflection is taken first, by Newton from outside, where it comes down monotonically; the other two
follow from the quadratic that is left.
Source: W. Kahan, "To solve a real cubic equation", Berkeley PAM-352 (1986).
"""

from kernels.lanes.jit import jit_call
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, sqrt, where
from kernels.maths import complex, pairs
from kernels.maths.elementary import cbrt, exponent, larger, scale

_START = 1.324718
"""The root of x^3 = x + 1: as far outside as a root can be."""
_FLOAT_STEPS = 60
_PAIR_STEPS = 4
_PAIR_ERROR = 1e-30
_NOTHING = 1e-290


@jit_call
def largest_modulus(a2, a1, a0):
    """The largest modulus of the three roots, and the relative error that the 32 digits of the coefficients leave."""
    # coefficients of the cubic in x/2^e, 2^e near the largest root
    third = magnitude(a0[0])
    size = (
        magnitude(a2[0])
        + sqrt(magnitude(a1[0]))
        + where(third > _NOTHING, cbrt(where(third > _NOTHING, third, 1.0)), 0.0)
    )
    e = where(size > _NOTHING, exponent(where(size > _NOTHING, size, 1.0)), 0.0)
    a2, a1, a0 = complex.scaled(a2, -e), complex.scaled(a1, -2.0 * e), complex.scaled(a0, -3.0 * e)
    b2, b1, b0 = a2[0], a1[0], a0[0]

    # a place outside the root that lies alone on its side of the point of inflection
    middle = b2 * (-1.0 / 3.0)
    value = fma(fma(middle + b2, middle, b1), middle, b0)
    slope = fma(fma(3.0, middle, 2.0 * b2), middle, b1)
    side, height = where(value > 0.0, 1.0, -1.0), magnitude(value)
    reach = where(height > _NOTHING, cbrt(where(height > _NOTHING, height, 1.0)), 0.0)
    bend = where(slope < 0.0, sqrt(where(slope < 0.0, -slope, 0.0)), 0.0)
    reach = where(slope < 0.0, _START * larger(reach, bend), reach)
    x = middle - side * reach

    # that root to float64 digits: Newton until a step would turn back
    active = not_(magnitude(x) < 0.0)
    for _ in range(_FLOAT_STEPS):
        value = fma(fma(x + b2, x, b1), x, b0)
        slope = fma(fma(3.0, x, 2.0 * b2), x, b1)
        new = x - value / where(slope > 0.0, slope, 1.0)
        active = active & (slope > 0.0) & (side * new > side * x)
        if not any_lane(active):
            break
        x = where(active, new, x)

    # as a pair, and what its last digits are worth
    root, step, slope = (x, 0.0 * x), 0.0 * x, 0.0 * x
    for _ in range(_PAIR_STEPS):
        slope = larger(fma(fma(3.0, root[0], 2.0 * b2), root[0], b1), _PAIR_ERROR)
        rest = pairs.add(pairs.times(pairs.add(root, a2), root), a1)
        step = -pairs.add(pairs.times(rest, root), a0)[0] / slope
        root = pairs.shifted(root, step)
    alone, size = magnitude(root[0]), magnitude(x)
    terms = fma(fma(size + magnitude(b2), size, magnitude(b1)), size, magnitude(b0))
    error = fma(_PAIR_ERROR, terms / slope, magnitude(step))

    # the factor x^2 + b x + c that is left, from that end of the cubic where nothing cancels
    far = magnitude(root[0] * root[0] * root[0]) > magnitude(b0)
    divisor = choose(far, root, (1.0, 0.0))
    c_far = pairs.over(pairs.negative(a0), divisor)
    b_far = pairs.over(pairs.add(c_far, pairs.negative(a1)), divisor)
    b_near = pairs.add(a2, root)
    c_near = pairs.add(a1, pairs.times(root, b_near))
    b, c = choose(far, (b_far, c_far), (b_near, c_near))

    # the larger modulus of its roots, and what the error of the first leaves of it
    half = (0.5 * b[0], 0.5 * b[1])
    inside = pairs.add(pairs.times(half, half), pairs.negative(c))
    real = inside[0] > 0.0
    width = sqrt(where(real, inside[0] + inside[1], 0.0))
    modulus = where(real, magnitude(half[0]) + width, sqrt(where(c[0] > 0.0, c[0], 0.0)))
    spread = fma(error, 2.0 * magnitude(half[0]) + modulus, _PAIR_ERROR * fma(half[0], half[0], magnitude(c[0])))
    apart, closest = where(inside[0] > -spread, width, modulus), sqrt(spread)
    blur = error + spread / where(apart > closest, apart, where(closest > 0.0, closest, 1.0))

    doubt = where(alone > modulus, error, blur)
    modulus = larger(alone, modulus)
    return scale(modulus, e), where(modulus > 0.0, doubt / where(modulus > 0.0, modulus, 1.0), 0.0)
