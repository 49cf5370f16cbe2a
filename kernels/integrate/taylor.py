"""Steps of a Taylor series, and the proof of what happens within one; generic in one cell or lanes.

A *series* is the tuple (u_0 ... u_p) of u(t) = sum u_k t^k on a step [0, h]. An *event* is e(t) = offset + factor u(t),
which fires where it falls through 0. With A = sum_{k>3} k abs(e_k) h^(k-2) and 0 < t <= h
    e'(t) <= e_1 + t (2 e_2 + A) + 3 t^2 e_3,  e(t) >= e_0 + t e_1 + t^2 (e_2 + h min(e_3, 0) - A/4),     (1)
so if the first parabola stays below 0, e decreases throughout, and its sign at the end shows whether it fires; if the
second one stays above 0, nothing fires. If neither is proved, the step is halved.
The proof is for the series; its truncation error is below the tolerance of the step, and an event that this error could
change is grazing.
"""

from typing import NamedTuple

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.symbols import symbolic, written
from kernels.lanes.vectors import any_lane, exponent, fma, horner, magnitude, nearest, not_, pow2, sqrt, where

STEP_LIMIT = 10_000
"""Steps between two events after which a cell is given up."""
PATIENCE = 16
"""Steps of a leg from which on it is counted how many wait for a last quarter of the lanes, or for one: where these are
more than half of all its steps, those lanes are paused. Else one cell of a thousand that never meets its event, beside
others, takes half of the time."""
HALVINGS = 40
ROOT_LIMIT = 60
SLACK = 4.0
"""By how much the estimated error of a step may exceed its tolerance."""
LARGEST = 5.0
"""log2 of the factor by which a step may change."""
LONGEST = 8.0
"""First guess of a step, at most, over the time of the last motion between events."""
TINY = 1e-280
"""Size of a state of which products of its terms would underflow: what is less is not told from 0."""
COME_UP = 0.25
"""Of a step within which something is hidden (`expression.hidden`): the next trial. The longest grows back as fast."""
VANISHING = 4e4
"""How far the last two terms of a series may be below the two before: of e^t they are 3e3 below on a step of 0.3."""
WIDER = 5.0 / 4.0
GRAZING = 16.0
SAME, ROUNDING = 0.04, 1e-15
"""Tolerances, and besides of its size, within which an event is 0 where another one fires: they fire together."""


@symbolic
def _sizes(h, terms):
    total = magnitude(terms[-1])
    for term in terms[-2::-1]:
        total = fma(total, h, magnitude(term))
    return total


@symbolic
def slope(x, series):
    """u'(x) by Horner's scheme, whose values on the way are those of `horner` and cost nothing beside it."""
    value = rate = series[-1]
    for term in series[-2:0:-1]:
        value = fma(value, x, term)
        rate = fma(rate, x, value)
    return rate


@symbolic
def curvature(x, series):
    """u''(x) by Horner's scheme."""
    value = rate = bend = series[-1]
    for term in series[-2:1:-1]:
        value = fma(value, x, term)
        rate = fma(rate, x, value)
        bend = fma(bend, x, rate)
    return 2.0 * bend


@symbolic
def mean(x, series):
    """The mean of u between 0 and x, but for its last term: sum of u_k x^k/(k + 1).

    Ratios of the factors go to x and not into the terms, or those would be kept from one evaluation for the next, and
    stored.
    """
    value = series[-2]
    for k in range(len(series) - 2, 0, -1):
        value = fma(value, x * (k / (k + 1)), series[k - 1])
    return value


@jit
def natural_power(x, n):
    """x^n for a natural number n > 0 known when compiled."""
    product, square = x if n % 2 else 0.0 * x + 1.0, x * x
    for _ in range(5):
        n //= 2
        product = product * square if n % 2 else product
        square = square * square
    return product


@symbolic
def last_term(h, series):
    """The last term of a series on a step, over h^(p-1).

    Of terms that fall by about 1/4 each the rest is a third of the last; the last but one counts in case the last
    vanishes by chance.
    """
    last, before = magnitude(series[-1]) * h, 0.25 * magnitude(series[-2])
    return where(last < before, before, last)


@symbolic
def size(h, series):
    """Of a state on a step: its first terms."""
    return fma(fma(magnitude(series[2]), h, magnitude(series[1])), h, magnitude(series[0]) + TINY)


@symbolic
def vanishes(h, series):
    """Whether the last two terms are far less than the two before, as of cos(t^3) at t = 0, or no less than these, as
    of t + t^42 about another place: then they tell nothing of the rest."""
    last, third, fourth = last_term(h, series) * (h * h), magnitude(series[-3]) * h, magnitude(series[-4])
    before = where(third < fourth, fourth, third)
    return not_((last < before) & (before < VANISHING * last))


@jit
def next_step(h, ratio, order):
    """The step on which 1 is left out instead of `ratio`, within 1 %."""
    ratio = where(ratio < 1e250, ratio, 1e250)  # NaN too: a power of the step overflowed
    ratio = where(ratio > 1e-250, ratio, 1e-250)
    e = exponent(ratio)
    m = ratio * pow2(-e) - 1.0
    log2_factor = (e + m * fma(m, -1.0 / 3.0, 4.0 / 3.0)) * (-1.0 / order)  # within 0.01/order
    log2_factor = where(log2_factor > -LARGEST, log2_factor, -LARGEST)
    log2_factor = where(log2_factor < LARGEST, log2_factor, LARGEST)
    whole = nearest(log2_factor)
    part = log2_factor - whole  # [-0.5, 0.5]
    return h * fma(part, fma(part, fma(part, 0.0555, 0.2402), 0.6931), 1.0) * pow2(whole)


@symbolic
def keeps(h, power_h, series, allowed):
    """Whether a step leaves out no more than that, over the state's size; NaN fails. `power_h` is h^(p-1).

    To be asked after `next_step`, for on a shorter step the size is smaller.
    """
    return last_term(h, series) * power_h <= allowed * size(h, series)


@symbolic
def box(h, series):
    """An interval that u does not leave on [0, h]."""
    along, aside = h * series[1], _sizes(h, series[2:]) * (h * h)
    return series[0] + where(along < 0.0, along, 0.0) - aside, series[0] + where(along > 0.0, along, 0.0) + aside


@symbolic
def rises(d, dd):
    """Whether what has these first derivatives rises in the next moment."""
    return (d > 0.0) | ((d >= 0.0) & (dd > 0.0))


@symbolic
def falls(d, dd, ddd, rest, h):
    """Whether an event falls all along a step, by (1): from its coefficients 1 to 3, `rest` is A."""
    b, q = fma(2.0, dd, rest), 3.0 * ddd
    turns = (q < 0.0) & (b > 0.0) & (fma(2.0 * h, q, b) < 0.0) & not_(4.0 * (q * d) > b * b)
    return (d <= 0.0) & (fma(h, fma(h, q, b), d) < 0.0) & not_(turns)


@symbolic
def clear(e, d, dd, ddd, rest, h, margin):
    """Whether an event does not fire in (0, h], by (1): from its coefficients 0 to 3.

    What comes down to less than `margin` is not clear. What starts at 0, or below it by rounding, must rise.
    """
    curve = fma(h, where(ddd < 0.0, ddd, 0.0), fma(-0.25, rest, dd))
    down = where(curve < 0.0, curve, 0.0)
    above = fma(h, fma(h, down, d), e) > where(d < 0.0, margin, 0.0)
    turns = (curve > 0.0) & ((d >= 0.0) | (4.0 * curve * (e - margin) > d * d))
    return above | turns | ((h <= 0.0) & (d > 0.0))


@jit
def of_series(t, curve):
    """u, u' and about u''/2 at t, of u = sum u_k t^k; curve is (series,)."""
    (u,) = curve
    return horner(t, u), slope(t, u), fma(t, fma(t, 6.0 * u[4], 3.0 * u[3]), u[2])


@jit
def of_sum(t, curve):
    """u, u' and about u''/2 at t, of u = start + unit int w; curve is (start, unit, series of w)."""
    start, unit, w = curve
    bend = fma(t, fma(t, 1.5 * w[3], w[2]), 0.5 * w[1])
    return fma(unit * t, mean(t, w), start), unit * horner(t, w), unit * bend


@written
def tail_of_series(h, curve):
    """A bound on A of (1): sum over k > 3 of k abs(u_k) h^(k-2), with 4 (5/4)^(k-4) >= k for k."""
    (series,) = curve
    total, wide = magnitude(series[-1]), WIDER * h
    for term in series[-2:3:-1]:
        total = fma(total, wide, magnitude(term))
    return 4.0 * (total * (h * h))


@written
def tail_of_sum(h, curve):
    """A of (1), from the series of w: the sum over k > 2 of abs(w_k) h^(k-1), as in `mean`."""
    _, unit, w = curve
    return unit * (_sizes(h, w[3:-1]) * (h * h))


class Way(NamedTuple):
    """How what has a curve is evaluated at t: u, u' and about u''/2; a bound on A of (1)."""

    at: object
    tail: object


BY_SERIES, BY_SUM = Way(of_series, tail_of_series), Way(of_sum, tail_of_sum)


@symbolic
def foreseen(e, d, dd, ddd, h):
    """About where an event falls through 0 in (0, h], by its coefficients 0 to 3; the middle where they do not tell."""
    bend = fma(d, d, -4.0 * (dd * e))
    t = 2.0 * e / (sqrt(where(bend > 0.0, bend, 0.0)) - d)
    t = t - fma(t, fma(t, fma(t, ddd, dd), d), e) / fma(t, fma(3.0 * t, ddd, 2.0 * dd), d)
    return where((t > 0.0) & (t < h), t, 0.5 * h)


@jit_apart
def crossing(at, curve, event, facts, extent, h, tolerance, searching):
    """Where an event falls through 0 in (0, h], given that it falls all along, and whether it only just does.

    Halley's steps within a bracket, with the bend by the first terms. What is left after a step is taken for that of
    Newton's, change^3/before^2, which is more; the search ends where that is far below what the series leave out.

    Parameters
    ----------
    at, curve : u, u' and u''/2 at t are `at(t, curve)`
    event : offset and factor of the event offset + factor u
    facts : coefficients 0 to 3 of the event
    extent : what its value is made of, in size, which near 0 is more than the value: the series are right to a share
    """
    whole = fma(h, fma(h, magnitude(facts[2]), magnitude(facts[1])), extent)
    scale = pow2(-exponent(where((whole > TINY) & (whole < 1.0 / TINY), whole, 1.0)))  # or its squares would underflow
    offset, factor, extent = event[0] * scale, event[1] * scale, extent * scale
    before, enough = 0.0 * h, 0.01 * tolerance + 1e-17
    low, high, t, left = 0.0 * h, h, foreseen(*facts, h), searching
    rate, bend = 0.0 * h, 0.0 * h
    for _ in range(ROOT_LIMIT):
        u, du, ddu = at(t, curve)
        value, rate, bend = fma(factor, u, offset), where(left, factor * du, rate), where(left, factor * ddu, bend)
        low, high = where(value > 0.0, t, low), where(value > 0.0, high, t)
        new = t - value * rate / fma(rate, rate, -value * bend)
        new = where((new >= low) & (new <= high), new, 0.5 * (low + high))
        change = magnitude(new - t)
        t = where(left, new, t)
        left = left & not_((change * change) * change <= enough * t * (before * before))
        if not any_lane(left):
            break
        before = change
    blur = GRAZING * tolerance * extent
    at_once = (h <= 0.0) & (rate <= 0.0) & (bend < 0.0)  # starts there at rest, and falls
    return t, searching & not_(at_once | (magnitude(rate) > blur / magnitude(rate) * (2.0 * magnitude(bend))))
