"""How a linkage's arm swings over a turn: its distance from simple harmonic motion, and its fastest rates.

    alpha = arg p + side psi;  arg p = sum a_k sin(k theta), a_k = -(-e/b)^k/k;  psi = sum psi_k cos(k theta)   (1)
    thd^2 = sum_{k>1} (a_k^2 + psi_k^2)/(a_1^2 + psi_1^2)                                            (2)
psi is a function of x = cos theta, singular only next to theta = 0 and pi, however close to dead points. So integrals
over theta are taken by the trapezoid in u, theta = pi/(1 + e^-u): it converges geometrically (like 2^(-50) at this
step) whatever the distances of the singularities from 0 and pi. Partial integration gives each harmonic its digits:
    psi_1 = -(2/pi) int psi' sin theta,  psi_k = (2/pi) int psi_xx kernel_k(theta),  kernel_2 = sin^4(theta)/3   (3)
Where more harmonics count than (3) is taken for, (2) is the mean square of what is left of (1) without the first.

Rates of both types are the same in reverse order of theta. Each extreme is the best of a scan over the nodes, and the
root of alpha'' between its neighbours.
"""

import math
from decimal import Decimal
from typing import NamedTuple

import numpy as np

from kernels.lanes.columns import GROUP, cells_at, room
from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, sqrt, where
from kernels.maths.decimals import PI, cosine, multiples, precise
from kernels.maths.elementary import exp, larger, sincos, smaller
from kernels.polisher.linkage import Crank, acceleration, dead_gaps, direction, opening, squares

STEP = 0.28
REACH = 133
"""Nodes to either side of theta = pi/2; beyond lies e^-37 of the turn."""
NODES = 2 * REACH + 1
HARMONICS = 12
"""Of (3), which leave 1e-16 of (2) where singularities are farther off than FAR."""
FAR = 1.744
"""A singularity at cos theta = 1 + FAR or -1 - FAR adds harmonics that fall like 5.3^-k."""
TRIES = 40
ROUNDING = 5e-15


class Turn(NamedTuple):
    """Buffers of a group, a row for each node: alpha' on either half of the turn (type A), psi_xx and psi."""

    forward: np.ndarray
    backward: np.ndarray
    bends: np.ndarray
    openings: np.ndarray


class Pace(NamedTuple):
    """(arg p)' and psi', of which alpha' is the sum (type A) or difference (B), then psi_xx, and psi."""

    turn: float
    opened: float
    bend: float
    psi: float


class Peak(NamedTuple):
    """A local maximum among the nodes: height, node, half of the turn, and height of the lower neighbour."""

    height: float
    node: float
    half: float
    beside: float


@jit
def buffers():
    """Space for a `Turn`."""
    space = room(4 * NODES).reshape((4, NODES * GROUP))
    return (Turn(space[0], space[1], space[2], space[3]),)


def _table():
    """Of each node: sine and cosine of theta/2, dtheta, and (2/pi) kernel_k dtheta for k from 2 on.

    kernel_k is what twice integrating cos(k theta) by x comes to; next to theta = 0 and pi it is a small difference.
    """
    rows = []
    with precise():
        for j in range(-REACH, REACH + 1):
            growth = (Decimal(str(STEP)) * j).exp()  # e^u
            weight = Decimal(str(STEP)) * PI * growth / (1 + growth) ** 2
            half = cosine(PI / 2 * growth / (1 + growth))
            cosines = multiples(2 * half * half - 1, HARMONICS + 3)
            bends = [
                ((cosines[k - 2] - cosines[k]) / (k - 1) - (cosines[k] - cosines[k + 2]) / (k + 1)) / (4 * k)
                for k in range(2, HARMONICS + 1)
            ]
            numbers = ((1 - half) * (1 + half)).sqrt(), half, weight, *(2 / PI * weight * bend for bend in bends)
            rows.append([float(number) for number in numbers])
    table = np.array(rows).T.copy()
    return table[0], table[1], table[2], table[3:]


SINE, COSINE, WEIGHT, KERNELS = _table()


@jit_call
def pace(lengths, margin, s, c):
    """The `Pace` at sine and cosine of theta/2."""
    b, d, f, e = lengths
    outer, inner = dead_gaps(lengths, margin, s, c)
    rz = sqrt(outer * inner)
    squared = squares(lengths, c)
    p2, q, k = squared.p2, squared.q, squared.k
    spread = b * e / p2
    turn = e * fma(2.0 * b * c, c, e - b) / p2
    opened = 2.0 * (s * c) * spread * (q / rz)
    drift = (d - f) * (d + f) / p2 - (q / rz) * (k / rz)
    bend = -2.0 * (b * e) * spread * (drift / rz)
    return Pace(turn, opened, bend, opening(lengths, squared, rz))


@jit_inline
def distortion(lengths, margin, turn):
    """Fills a `Turn`; thd of (2), and its relative error."""
    b, d, f, e = lengths
    m1, m2, m3 = margin
    zero, ratio, far = 0.0 * b, e / b, 2.0 * FAR * b * e

    # psi_1 by (3), the mean of psi, and the sum of the sizes of what makes psi_1
    first, mean, gross = zero, zero, zero
    for j in range(NODES):
        s, c = SINE[j] + zero, COSINE[j] + zero
        here, row = pace(lengths, margin, s, c), cells_at(j * GROUP)
        turn.forward[row], turn.backward[row] = here.turn + here.opened, here.turn - here.opened
        turn.bends[row], turn.openings[row] = here.bend, here.psi
        share = (2.0 / math.pi) * WEIGHT[j]
        part = 2.0 * share * (s * c) * here.opened
        first, mean = first - part, fma(0.5 * share, here.psi, mean)
        gross = gross + magnitude(part)

    # the sum of (2) over k > 1, by (3) where all that counts is in it, and the sizes of what makes psi_2
    few = (m1 * ((b + d) + (f + e)) > far) & (m2 * m3 > far) & (b > 5.3 * e)
    rest, lost = zero, zero
    if any_lane(few):
        total, terms, power = zero, zero, ratio
        for k in range(2, HARMONICS + 1):
            power = power * ratio
            psi = zero
            for j in range(NODES):
                part = KERNELS[k - 2, j] * turn.bends[cells_at(j * GROUP)]
                psi = psi + part
                terms = where(k < 3, terms + magnitude(part), terms)
            sine = power * (1.0 / k)
            total = fma(psi, psi, fma(sine, sine, total))
        rest, lost = where(few, sqrt(total), rest), where(few, terms, lost)
    if any_lane(not_(few)):  # else twice the mean square of what the first harmonic leaves
        total = zero
        for j in range(NODES):
            s, c = SINE[j] + zero, COSINE[j] + zero
            even = turn.openings[cells_at(j * GROUP)] - mean - first * ((c - s) * (c + s))
            odd = direction(lengths, Crank(2.0 * zero, s, c)) - ratio * (2.0 * s * c)
            total = fma((2.0 / math.pi) * WEIGHT[j], fma(even, even, odd * odd), total)
        rest, lost = where(few, rest, sqrt(total)), where(few, lost, 2.0 + mean)

    fundamental = sqrt(fma(first, first, ratio * ratio))
    doubt = ROUNDING * 0.1 * (lost / rest + gross / fundamental) + ROUNDING
    return where(e > 0.0, rest / fundamental, 0.0), where(e > 0.0, doubt, ROUNDING)


@jit_inline
def _two_peaks(sign, buffer, half, found):
    """The two highest peaks of sign alpha' among the two `found` and the nodes of one half of the turn."""
    best, second = found
    zero = 0.0 * best.node
    before, here = zero - math.inf, sign * buffer[cells_at(0)]
    for j in range(NODES):
        after = zero - math.inf
        if j + 1 < NODES:
            after = sign * buffer[cells_at((j + 1) * GROUP)]
        new = Peak(here, zero + j, zero + half, smaller(before, after))
        peak = (here >= before) & (here > after)
        first, other = peak & (here > best.height), peak & (here > second.height)
        second = choose(first, best, choose(other, new, second))
        best = choose(first, new, best)
        before, here = here, after
    return best, second


@jit
def at_node(place, half):
    """Sine and cosine of theta/2 at a place between nodes, on either half of the turn."""
    u = STEP * (place - REACH)
    s, c = sincos(0.5 * math.pi / (1.0 + exp(magnitude(u))))
    return half * where(u > 0.0, c, s), where(u > 0.0, s, c)


@jit_call
def _slope(lengths, margin, sign, place, half):
    """Whether sign alpha' rises with `place`: alpha'' there."""
    s, c = at_node(place, half)
    outer, inner = dead_gaps(lengths, margin, s, c)
    return sign * half * acceleration(lengths, margin, squares(lengths, c), sqrt(outer * inner), 1.0, s, c)


@jit_call
def _top(lengths, margin, sign, peak):
    """The height of one peak at the root of alpha'' beside its node, and what may be missing from it.

    Regula falsi with halved ends (Illinois) until the step is 1e-9 of a node: an extreme's height then has its digits.
    """
    height, node, half, beside = peak
    low, high = node - 1.0, node + 1.0
    at_low, at_high = _slope(lengths, margin, sign, low, half), _slope(lengths, margin, sign, high, half)
    settled = (at_low > 0.0) & (at_high < 0.0)
    active, place, side = settled, node, 0.0 * node
    for _ in range(TRIES):
        if not any_lane(active):
            break
        new = (low * at_high - high * at_low) / (at_high - at_low)
        here = _slope(lengths, margin, sign, new, half)
        up, down = active & (here > 0.0), active & not_(here > 0.0)
        at_low = where(up, here, where(down & (side < 0.0), 0.5 * at_low, at_low))
        at_high = where(down, here, where(up & (side > 0.0), 0.5 * at_high, at_high))
        low, high = where(up, new, low), where(down, new, high)
        side = where(up, 1.0, where(down, -1.0, side))
        place, done = where(active, new, place), magnitude(new - place) <= 1e-9
        active = active & not_(done)
    s, c = at_node(place, half)
    there = pace(lengths, margin, magnitude(s), c)
    top = sign * fma(half, there.opened, there.turn)
    better = settled & (top > height)
    missing = where(settled, 0.0, where(beside > -math.inf, height - beside, 0.0))
    return where(better, top, height), missing


@jit_call
def fastest(lengths, margin, sign, turn):
    """The largest sign alpha' over the turn, and what may be missing from it."""
    zero = 0.0 * lengths.b
    nowhere = Peak(zero - math.inf, zero, zero + 1.0, zero)
    found = _two_peaks(sign, turn.forward, 1.0, (nowhere, nowhere))
    best, second = _two_peaks(sign, turn.backward, -1.0, found)
    highest, missing = _top(lengths, margin, sign, best)
    other, more = _top(lengths, margin, sign, second)
    over = other > highest
    return where(over, other, highest), where(over, more, missing)


@jit_inline
def rates(lengths, margin, turn):
    """Largest and least alpha' of a crank that turns, and the larger of their relative errors."""
    moves = lengths.e > 0.0
    most, missing = fastest(lengths, margin, 1.0, turn)
    least, more = fastest(lengths, margin, -1.0, turn)
    span = larger(magnitude(most), magnitude(least))
    doubt = (missing + 0.2 * ROUNDING * span) / magnitude(most)
    doubt = larger(doubt, (more + 0.2 * ROUNDING * span) / magnitude(least))
    return where(moves, most, 0.0), where(moves, -least, 0.0), where(moves, doubt, 0.0)
