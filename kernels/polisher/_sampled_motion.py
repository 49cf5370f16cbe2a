"""A linkage's arm by dense sampling of a turn: the slow way, which knows no formula but that of the motion.

The turn is sampled at SAMPLES equal steps of the crank; extremes of alpha are where alpha' changes its sign, those of
alpha' where alpha'' does, each by bisection between the samples; harmonics are sums over the samples. One cell at a
time: every search goes its own way.
"""

import math
from typing import NamedTuple

import numpy as np

from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths.elementary import larger, sincos, smaller
from kernels.polisher._cell import Rates
from kernels.polisher.extremes import Angles, Locks, angle
from kernels.polisher.linkage import crank_at, dead_gaps, motion, squares

SAMPLES = 2048
HALVINGS = 60
WIDEST = 32.0
"""Steps of the crank on which a dead point must have its effect to be seen."""
ROUNDING = 1e-15
"""Error of alpha, of rates over the fastest, and of crank angles where alpha'' is as large as alpha'."""


class Samples(NamedTuple):
    """alpha and alpha' over a turn."""

    alphas: np.ndarray
    rates: np.ndarray


@jit
def buffers():
    """Space for `Samples`."""
    return (Samples(np.empty(SAMPLES), np.empty(SAMPLES)),)


@jit_call
def at(cell, theta):
    """alpha, alpha', alpha'' of type A; NaN where it is locked."""
    return motion(cell.lengths, cell.margin, 1.0, crank_at(theta, 0.0))


@jit
def step(j):
    """The crank angle of a sample, from -pi on."""
    return math.pi * (2 * j - SAMPLES) / SAMPLES


@jit_inline
def sample(cell, samples):
    """Fills the samples; returns inf where a dead point is passed between two of them, else 0."""
    for j in range(SAMPLES):
        samples.alphas[j], samples.rates[j], _ = at(cell, step(j))
    b, d, f, e = cell.lengths
    m1, m2, m3 = cell.margin
    narrow = 4.0 * b * e * (WIDEST * math.pi / SAMPLES) ** 2
    wide = m1 * (b + d + f + e) > narrow and m2 * m3 > narrow and (b - e) ** 2 > narrow
    return 0.0 if wide else math.inf


@jit
def largest(column, sign):
    """The sample at which sign times a column is largest."""
    best = 0
    for j in range(SAMPLES):
        if sign * column[j] > sign * column[best]:
            best = j
    return best


@jit_call
def derivative(cell, theta, order):
    """alpha' for the order 1, alpha'' for 2."""
    _, rate, acceleration = at(cell, theta)
    return rate if order == 1 else acceleration


@jit_call
def turning(cell, order, sign, j):
    """Where sign times the derivative of that order falls through 0, next to sample j; NaN where it does not."""
    low, high = step(j - 1), step(j + 1)
    if not (sign * derivative(cell, low, order) > 0.0 and sign * derivative(cell, high, order) < 0.0):
        return math.nan
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if sign * derivative(cell, middle, order) > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@jit_inline
def extremes(cell, alphas):
    """`Angles`, and their largest relative error."""
    at_plus, at_minus = turning(cell, 1, 1.0, largest(alphas, 1.0)), turning(cell, 1, -1.0, largest(alphas, -1.0))
    at_plus = at_plus if at_plus > 0.0 else at_plus + math.tau
    at_minus = at_minus if at_minus < 0.0 else at_minus - math.tau
    plus, _, plus_bend = at(cell, at_plus)
    minus, _, minus_bend = at(cell, at_minus)
    swing = 0.5 * (plus - minus)
    lost = ROUNDING * (1.0 + plus) / larger(0.0, smaller(minus, swing))
    plus_lost = (1.0 + swing / magnitude(plus_bend)) / at_plus
    minus_lost = (1.0 + swing / magnitude(minus_bend)) / -at_minus
    lost = larger(lost, ROUNDING * larger(plus_lost, minus_lost))
    return Angles(0.5 * (plus + minus), swing, plus, minus, at_plus, at_minus), lost


@jit_call
def fastest(cell, sign, rates):
    """The largest alpha' (sign +1) or the least; every sample that may be next to it is followed up."""
    top, best = sign * rates[largest(rates, sign)], -math.inf
    for j in range(SAMPLES):
        here = sign * rates[j]
        close = here >= top - 0.1 * magnitude(top)
        if close and here >= sign * rates[j - 1] and here >= sign * rates[(j + 1) % SAMPLES]:
            theta = turning(cell, 2, sign, j)
            here = larger(here, sign * derivative(cell, theta, 1)) if theta == theta else here
            best = larger(best, here)
    return sign * best


@jit_call
def distortion(alphas, stride):
    """thd of every `stride`-th sample, and the amplitude of the first harmonic."""
    n = SAMPLES // stride
    mean, even, odd, rest = 0.0, 0.0, 0.0, 0.0
    for j in range(0, SAMPLES, stride):
        mean += alphas[j] / n
        sine, cosine = sincos(step(j))
        even += 2.0 * alphas[j] * cosine / n
        odd += 2.0 * alphas[j] * sine / n
    for j in range(0, SAMPLES, stride):
        sine, cosine = sincos(step(j))
        left = alphas[j] - mean - even * cosine - odd * sine
        rest += 2.0 * left * left / n
    first = math.sqrt(even * even + odd * odd)
    return math.sqrt(rest) / first, first


@jit_inline
def rates(cell, samples):
    """`Rates`, and the largest of their relative errors."""
    most, least = fastest(cell, 1.0, samples.rates), fastest(cell, -1.0, samples.rates)
    span = larger(magnitude(most), magnitude(least))
    lost = 4.0 * ROUNDING * span / smaller(magnitude(most), magnitude(least))
    if cell.lengths.e > cell.lengths.b:
        return Rates(math.nan, most, least), lost
    thd, first = distortion(samples.alphas, 1)
    coarse, _ = distortion(samples.alphas, 2)
    return Rates(thd, most, least), larger(lost, (magnitude(thd - coarse) + 4.0 * ROUNDING / first) / thd)


@jit_inline
def transmission(cell):
    """The least angle between coupler and arm, or their extensions, of all samples."""
    least = math.pi
    for j in range(SAMPLES):
        _, s, c = crank_at(step(j), 0.0)
        outer, inner = dead_gaps(cell.lengths, cell.margin, s, c)
        least = smaller(least, angle(sqrt(outer * inner), magnitude(squares(cell.lengths, c).k)))
    return least


@jit_call
def is_free(cell, theta):
    """Whether the crank can stand there."""
    alpha, _, _ = at(cell, theta)
    return alpha == alpha


@jit_call
def lock(cell, goal):
    """Where the crank locks on its way to the goal, 0 or pi; NaN where it does not; and its relative error."""
    if is_free(cell, goal):
        return math.nan, 0.0
    start = math.nan
    for j in range(SAMPLES // 2 + 1):
        theta = goal + (1.0 if goal < 1.0 else -1.0) * math.pi * j / (SAMPLES // 2)
        if start != start and is_free(cell, theta):
            start = theta
    stuck = goal
    for _ in range(HALVINGS):
        middle = 0.5 * (start + stuck)
        if is_free(cell, middle):
            start = middle
        else:
            stuck = middle
    return start, 4.0 * ROUNDING * (1.0 + 1.0 / (start * start)) if start == start else math.inf


@jit_inline
def locks(cell):
    """`Locks`, and their largest relative error."""
    inner, inner_lost = lock(cell, 0.0)
    outer, outer_lost = lock(cell, math.pi)
    nearest, outer = (inner, outer) if inner == inner else (outer, inner)
    return Locks(nearest, outer), larger(inner_lost, outer_lost)
