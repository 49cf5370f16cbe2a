"""The driven balance's limit cycle in 32 digits, from one that is known to a few.

Close to the least drive that keeps a swing up, a leg begins or ends all but at rest: of its time only half of the
digits of the drive are left. So the cycle of `_driven_swing` is taken by Newton from its legs' times, its residuals as
pairs. With E, S and S' the way, speed and change of speed of a free swing from rest at 1, f = a - r, g = a + r,
    f E(t1) = beta - r,  v1 = f S(t1),                                                                (1)
    f2 E(t2) - v1 S(t2) = f2 - 2 beta,  v2 = v1 S'(t2) + f2 S(t2),  f2 = beta - r + m,                (2)
    g E(t3) = beta + r,  v3 = g S(t3), with -zeta: leg 3 backwards from the rest where it ends,       (3)
and v3 = v2, or v3^2 = v2^2 + 2 w where an impulse takes the place of leg 2. Derived here.
"""

from fractions import Fraction
from math import factorial
from typing import NamedTuple

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import any_lane, choose, magnitude, not_, where
from kernels.maths.pairs import (
    add,
    constant,
    exponential,
    negative,
    scaled,
    shifted,
    times,
    two_product,
    two_sum,
    whole,
)

LONGEST = 300.0
"""Most of zeta times the time of a half swing: cosh is summed for up to a 512th of that."""
STEPS = 12
_SETTLED = 1e-18
_HALF_TURN = 10.5
"""Just over pi^2: a leg whose phase squared is less and that ends with a speed forwards has not turned back in it."""
_DOUBLINGS = 9
_COSINES = tuple(constant(Fraction((-1) ** k, factorial(2 * k + 2))) for k in range(13, -1, -1))
_SINES = tuple(constant(Fraction((-1) ** k, factorial(2 * k + 1))) for k in range(13, -1, -1))


class Swing(NamedTuple):
    """E, S and S' of a free swing, as pairs, and its phase squared."""

    E: tuple
    S: tuple
    slope: tuple
    phase: float


class Legs(NamedTuple):
    """A cycle by its force at rest and the times of its legs, all pairs."""

    f: tuple
    t1: tuple
    t2: tuple
    t3: tuple


@jit
def _series(y, shares):
    total = shares[0][0] + 0.0 * y[0], shares[0][1] + 0.0 * y[0]
    for share in shares[1:]:
        total = add(share, times(y, total))
    return total


@jit_call
def _swing(zeta, t):
    """The swing until the time t, a pair.

    Of its phase x, 1 - cos x and sin x/x are series for x/512, and 1 - cos 2x = 2 (1 - cos x)(1 + cos x),
    sin 2x = 2 sin x cos x nine times; beyond critical damping x^2 is negative, and they are of cosh and sinh.
    """
    high, low = two_product(zeta, zeta)
    square = times(shifted((-high, -low), 1.0), times(t, t))
    y = scaled(square, 4.0**-_DOUBLINGS)
    gap, sine = times(y, _series(y, _COSINES)), _series(y, _SINES)
    for _ in range(_DOUBLINGS):
        sine = times(sine, shifted(negative(gap), 1.0))
        gap = scaled(times(gap, shifted(negative(gap), 2.0)), 2.0)
    sine, cosine = times(t, sine), shifted(negative(gap), 1.0)
    decay = whole(*exponential(scaled(t, -zeta)))
    lag = scaled(sine, zeta)
    ends = times(decay, add(cosine, negative(lag)))
    return Swing(times(decay, add(cosine, lag)), times(decay, sine), ends, square[0])


@jit_call
def _step(scene, legs):
    """The cycle after a step of Newton, and whether it was the last and there is such a cycle.

    What (1), (2) and (3) miss is mended by changes of t1, t2, t3 that follow a change of f; so the miss of the speeds
    at the end is a line in that change, known from two.
    """
    zeta, r, m, beta, w = scene
    f, t1, t2, t3 = legs
    lifts, unit = beta > 0.0, f[0]
    one, two, three = _swing(zeta, t1), _swing(zeta, t2), _swing(-zeta, t3)
    near, far = two_sum(beta, -r), two_sum(beta, r)
    f2, g = shifted(near, m), shifted(f, 2.0 * r)
    v1, v3 = times(f, one.S), times(g, three.S)
    v2 = add(times(v1, two.slope), times(f2, two.S))
    first = add(times(f, one.E), negative(near))[0]
    second = add(add(times(f2, two.E), negative(times(v1, two.S))), negative(shifted(f2, -2.0 * beta)))[0]
    third = add(times(g, three.E), negative(far))[0]
    energy = shifted(add(times(v3, v3), negative(times(v2, v2))), -2.0 * w)[0] / (2.0 * v3[0])
    last = where(lifts, add(v3, negative(v2))[0], energy)

    start, slope = (first, second, third, last, v1[0], v2[0], v3[0]), (one, two, three)
    a1, a2, a3, here = _along(scene, start, slope, 0.0 * zeta)
    b1, b2, b3, beyond = _along(scene, start, slope, unit)
    share = -here / (beyond - here)
    d1, d2, d3 = a1 + share * (b1 - a1), a2 + share * (b2 - a2), a3 + share * (b3 - a3)
    new = Legs(shifted(f, share * unit), shifted(t1, d1), shifted(t2, d2), shifted(t3, d3))
    least = _SETTLED * (t1[0] + t2[0] + t3[0])
    settled = (magnitude(share) <= _SETTLED) & (magnitude(d1) <= least) & (magnitude(d3) <= least)
    forwards = (v1[0] > 0.0) & (v2[0] > 0.0) & (v3[0] > 0.0) & (unit > 0.0)
    once = (one.phase < _HALF_TURN) & (two.phase < _HALF_TURN) & (three.phase < _HALF_TURN)
    return new, settled & (magnitude(d2) <= least), forwards & once


@jit
def _along(scene, misses, swings, df):
    """Changes of t1, t2, t3 that mend all but the last miss where f changes by df, and the last miss after that."""
    zeta, r, m, beta, _ = scene
    first, second, third, last, v1, v2, v3 = misses
    one, two, three = swings
    lifts = beta > 0.0
    d1, d3 = (first + one.E[0] * df) / v1, (third + three.E[0] * df) / v3
    dv1 = one.S[0] * df + ((beta - r) - 2.0 * zeta * v1) * d1
    dv3 = three.S[0] * df + ((beta + r) + 2.0 * zeta * v3) * d3
    d2 = where(lifts, (second - two.S[0] * dv1) / where(lifts, v2, 1.0), 0.0)
    dv2 = two.slope[0] * dv1 + (((m - r) - beta) - 2.0 * zeta * v2) * d2
    return d1, d2, d3, last + dv3 - where(lifts, 1.0, v2 / v3) * dv2


@jit_call
def refined(scene, p, guess, wanted):
    """(Amplitude, half period, multiplier) of the cycle next to a half swing from beta + p, and whether it is found.

    Looked for where `wanted`; `guess` are the times of its legs.
    """
    zeta, r, _, beta, _ = scene
    none = 0.0 * p
    legs = Legs(shifted(two_sum(beta, -r), p), (guess[0], none), (guess[1], none), (guess[2], none))
    active = wanted & (zeta * (guess[0] + guess[1] + guess[2]) < LONGEST)
    found = active & not_(active)
    for _ in range(STEPS):
        if not any_lane(active):
            break
        new, settled, there = _step(scene, legs)
        legs = choose(active, new, legs)
        found = found | (active & settled & there)
        active = active & not_(settled)
    time = add(add(legs.t1, legs.t2), legs.t3)
    kept = whole(*exponential(scaled(time, where(found, -2.0 * zeta, 0.0))))[0]
    return (shifted(legs.f, r)[0], time[0], kept * legs.f[0] / shifted(legs.f, 2.0 * r)[0]), found
