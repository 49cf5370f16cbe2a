"""Where a motion of the impact clock repeats: Newton on k half swings, its multipliers, and what rounding leaves of it.

With z = (gap, V, w) at the start and P(z) after k half swings, the derivative D of P is the product of those of half
swings, each carried along its contacts. Newton's step is (1 - D)^-1 (P - z), and so is the error of z that rounding of
P leaves. The multipliers are the roots of x^3 - trace x^2 + minors x - determinant.
"""

import math
from typing import NamedTuple

import numpy as np

from kernels.impact._contacts import OF_T, OF_V, OF_W, OF_X
from kernels.impact._half_swing import DONE, Start, half_swing, reduced
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths.cubic import largest_modulus

NEWTON_LIMIT = 12

_CONVERGED = 3e-15
_LEAST_TRACE = 0.25
"""Terms of about 1 cancel in the changes of a motion whose disturbances fade at once."""


class Work(NamedTuple):
    """Arrays to work with; rows of `chained` are changes of gap, V, w and time."""

    tally: np.ndarray
    slopes: np.ndarray
    chained: np.ndarray
    inverse: np.ndarray


@jit
def distance(start, other):
    """How far two beginnings are from each other, relative to what they are."""
    speed = magnitude(other.V) + magnitude(other.w)
    parts = max(magnitude(start.V - other.V) / speed, magnitude(start.w - other.w) / magnitude(other.w))
    return max(magnitude(start.gap - other.gap), parts)


@jit
def difference(image, start):
    """P(z) - z."""
    return Start(image.gap - start.gap, image.V - start.V, image.w - start.w)


@jit
def _times(matrix, row, z):
    """A row of a matrix times what a start, or a change of one, is made of."""
    return matrix[row, 0] * z.gap + matrix[row, 1] * z.V + matrix[row, 2] * z.w


@jit_call
def chain(scene, start, k, work):
    """The start after k half swings; `work.chained` becomes its changes and that of the time by `start`."""
    slopes, chained = work.slopes, work.chained
    for j in range(3):
        for row in range(4):
            chained[row, j] = 1.0 if row == j else 0.0
    for _ in range(k):
        start, verdict = half_swing(scene, start, work.tally, slopes, True)
        if verdict != DONE:
            return start, verdict
        for j in range(3):
            change = Start(chained[0, j], chained[1, j], chained[2, j])
            chained[0, j] = _times(slopes, OF_X, change)
            chained[1, j] = _times(slopes, OF_V, change)
            chained[2, j] = -_times(slopes, OF_W, change)  # the frame of the next half swing is reflected
            chained[3, j] += _times(slopes, OF_T, change)
    return start, DONE


@jit_call
def invert(chained, inverse):
    """(1 - D)^-1 by cofactors, into `inverse`."""
    a, b, c = 1.0 - chained[0, 0], -chained[0, 1], -chained[0, 2]
    d, e, f = -chained[1, 0], 1.0 - chained[1, 1], -chained[1, 2]
    g, h, i = -chained[2, 0], -chained[2, 1], 1.0 - chained[2, 2]
    inverse[0, 0], inverse[0, 1], inverse[0, 2] = e * i - f * h, c * h - b * i, b * f - c * e
    inverse[1, 0], inverse[1, 1], inverse[1, 2] = f * g - d * i, a * i - c * g, c * d - a * f
    inverse[2, 0], inverse[2, 1], inverse[2, 2] = d * h - e * g, b * g - a * h, a * e - b * d
    determinant = a * inverse[0, 0] + b * inverse[1, 0] + c * inverse[2, 0]
    for row in range(3):
        for column in range(3):
            inverse[row, column] /= determinant


@jit_call
def newton(scene, start, k, work):
    """The start that repeats after k half swings, near the one given, and whether it is found."""
    last = math.inf
    for _ in range(NEWTON_LIMIT):
        image, verdict = chain(scene, start, k, work)
        if verdict != DONE:
            return start, False
        invert(work.chained, work.inverse)
        rest = difference(image, start)
        gap, V = start.gap + _times(work.inverse, 0, rest), start.V + _times(work.inverse, 1, rest)
        new = Start(reduced(gap), V, start.w + _times(work.inverse, 2, rest))
        step = distance(start, new)
        if not (new.w < 0.0 and step < 0.5):
            return start, False
        start = new
        if step < _CONVERGED or (last < 1e-10 and step > 0.25 * last):
            return start, True
        last = step
    return start, last < 1e-10


@jit
def multiplier(chained):
    """Largest modulus of the multipliers, and what rounding of one part in 1 of the changes would be worth in it."""
    a, b, c = chained[0, 0], chained[0, 1], chained[0, 2]
    d, e, f = chained[1, 0], chained[1, 1], chained[1, 2]
    g, h, i = chained[2, 0], chained[2, 1], chained[2, 2]
    minors = a * e - b * d + (a * i - c * g) + (e * i - f * h)
    third = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    modulus, _ = largest_modulus((-(a + e + i), 0.0), (minors, 0.0), (-third, 0.0))
    first = max(magnitude(a) + magnitude(e) + magnitude(i), _LEAST_TRACE)
    second = (
        magnitude(a * e) + magnitude(b * d) + magnitude(a * i) + magnitude(c * g) + magnitude(e * i) + magnitude(f * h)
    )
    last = magnitude(a) * (magnitude(e * i) + magnitude(f * h)) + magnitude(b) * (magnitude(d * i) + magnitude(f * g))
    last += magnitude(c) * (magnitude(d * h) + magnitude(e * g))
    blur = (first * modulus + second) * modulus + last
    return modulus, blur / max(_steepness(a + e + i, minors, third, modulus), 1e-300)


@jit
def _steepness(trace, minors, third, modulus):
    """abs(p') at the root of that modulus: the product of its distances from the other two."""
    size = (modulus + magnitude(trace)) * modulus * modulus + magnitude(minors) * modulus + magnitude(third)
    steepest = 0.0
    for sign in (1.0, -1.0):
        x = sign * modulus
        if magnitude(((x - trace) * x + minors) * x - third) <= 1e-8 * size:
            steepest = max(steepest, magnitude((3.0 * x - 2.0 * trace) * x + minors))
    if steepest > 0.0:
        return steepest
    alone = third / (modulus * modulus)
    half = 0.5 * (trace - alone)
    upright = sqrt(max(modulus * modulus - half * half, 0.0))
    return 2.0 * upright * sqrt((half - alone) * (half - alone) + upright * upright)


@jit
def errors(start, rest, work, rounding, time):
    """Relative errors of gap, V and w where the motion repeats, and of the time."""
    inverse, chained = work.inverse, work.chained
    fast, swings = magnitude(start.V), magnitude(start.w)
    blur = magnitude(rest.gap) + rounding, magnitude(rest.V) + rounding * fast, magnitude(rest.w) + rounding * swings
    gap, V, w = 0.0, 0.0, 0.0
    for j in range(3):
        gap += magnitude(inverse[0, j]) * blur[j]
        V += magnitude(inverse[1, j]) * blur[j]
        w += magnitude(inverse[2, j]) * blur[j]
    longer = magnitude(chained[3, 0]) * gap + magnitude(chained[3, 1]) * V + magnitude(chained[3, 2]) * w
    return gap, V, w, longer / time + rounding
