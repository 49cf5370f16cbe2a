"""Which event fires in a step, where, and the state there; generic in one cell or lanes.

An event is known at both ends of the step [0, h] by its value (e0 > 0 >= e1) and its rate (d0, d1). With a fixed step
`linear` and `hermite` find its place by a line or by the cubic through all four, and repeat the step with that length.
`root` is as accurate as the method: each trial is a step of its own from the same start, the method's continuous
extension. `none` puts the event at the end of the step, the error that studies of fixed steps show.
"""

import math

from kernels.integrate.steps import dop853, dopri5, euler, events, moreau, rk4, semi_implicit, verlet
from kernels.lanes.jit import jit_call
from kernels.lanes.symbols import symbolic
from kernels.lanes.tuples import total
from kernels.lanes.vectors import any_lane, fma, magnitude, not_, sqrt, where

METHODS = ("euler", "semi_implicit", "verlet", "rk4", "dopri5", "dop853", "moreau")
EULER, SEMI_IMPLICIT, VERLET, RK4, DOPRI5, DOP853, MOREAU = range(7)
CALLS = (1.0, 1.0, 2.0, 4.0, 6.0, 12.0, 2.0)
"""Calls of the rates in a step."""
NONE, LINEAR, HERMITE, ROOT = range(4)
LOCATIONS = {"none": NONE, "linear": LINEAR, "hermite": HERMITE, "root": ROOT}

ROOT_LIMIT = 60
LOW = 0.25
"""Of the smaller end: an event that the cubic takes below this share of it is looked at where it is lowest."""


@jit_call
def leap(m, scheme, state, mode, h):
    """The equal substeps that make up h."""
    substep = h / scheme.substeps
    for _ in range(scheme.substeps):
        if scheme.method == EULER:
            state = euler(m, state, mode, substep)[0]
        elif scheme.method == SEMI_IMPLICIT:
            state = semi_implicit(m, state, mode, substep)
        elif scheme.method == VERLET:
            state = verlet(m, state, mode, substep)
        elif scheme.method == RK4:
            state = rk4(m, state, mode, substep)[0]
        elif scheme.method == DOPRI5:
            state = dopri5(m, state, mode, substep)[0]
        elif scheme.method == DOP853:
            state = dop853(m, state, mode, substep)[0]
        else:
            state = moreau(m, state, mode, substep)
    return state


@jit_call
def leapt(m, state, scheme, mode, h, part):
    """The state after that part of a step, as a step of its own."""
    return leap(m, scheme, state, mode, part * h)


@symbolic
def cubic(s, e0, e1, m0, m1):
    """Value and slope at s in [0, 1] of the cubic with these values and slopes at the ends."""
    d = e1 - e0
    b, a = 3.0 * d - 2.0 * m0 - m1, m0 + m1 - 2.0 * d
    return fma(s, fma(s, fma(s, a, b), m0), e0), fma(s, fma(3.0 * a, s, 2.0 * b), m0)


@jit_call
def cubic_root(e0, e1, m0, m1, seeking):
    """Where in [0, 1] that cubic falls through 0, for e0 > 0 >= e1: Newton within a bracket."""
    low, high = 0.0 * e0, 0.0 * e0 + 1.0
    s = e0 / (e0 - e1)
    for _ in range(ROOT_LIMIT):
        if not any_lane(seeking):
            break
        value, slope = cubic(s, e0, e1, m0, m1)
        low, high = where(value > 0.0, s, low), where(value > 0.0, high, s)
        new = s - value / slope
        new = where((new >= low) & (new <= high), new, 0.5 * (low + high))
        change = magnitude(new - s)
        s = where(seeking, new, s)
        seeking = seeking & (change > 1e-15)
    return s


@symbolic
def lowest(e0, e1, m0, m1):
    """Where the cubic with m0 < 0 < m1 is lowest in (0, 1), and how low."""
    d = e1 - e0
    b, a = 3.0 * d - 2.0 * m0 - m1, 3.0 * (m0 + m1 - 2.0 * d)
    inside = b * b - a * m0
    s = -m0 / (b + sqrt(where(inside > 0.0, inside, 0.0)))
    return s, cubic(s, e0, e1, m0, m1)[0]


@symbolic
def of_event(values, which):
    """The entry of a tuple at the index `which` of each lane."""
    chosen = values[0]
    for j in range(1, len(values)):
        chosen = where((which > j - 0.5) & (which < j + 0.5), values[j], chosen)
    return chosen


@jit_call
def met_at(m, state_at, mode, step, terms, which, part, enough, seeking):
    """Where in the step the event fires, by Newton's method in a bracket; the state there, the event's rate, trials.

    `state_at` : (m, state, terms, mode, h, part) -> the state at that part of the step
    `enough` : the relative change of the part at which the search ends
    """
    h = step.h
    low, high, slope, trials = 0.0 * h, 0.0 * h + 1.0, 0.0 * h, 0.0 * h + 1.0
    for _ in range(ROOT_LIMIT):
        if not any_lane(seeking):
            break
        values, slopes = events(m, state_at(m, step.state, terms, mode, h, part), mode)
        value, slope = of_event(values, which), where(seeking, of_event(slopes, which), slope)
        low, high = where(value > 0.0, part, low), where(value > 0.0, high, part)
        new = part - value / (slope * h)
        new = where((new >= low) & (new <= high), new, 0.5 * (low + high))
        change = magnitude(new - part)
        part, trials = where(seeking, new, part), where(seeking, trials + 1.0, trials)
        seeking = seeking & (change > enough * part)
    return part, state_at(m, step.state, terms, mode, h, part), slope, trials


@symbolic
def first_event(step, on, natural):
    """The event passed first in a step, by the line between the ends; -1 where none is.

    With `natural`, 1, only the switch counts, and not while it still rises from below.
    """
    which, earliest = 0.0 * step.start[0] - 1.0, 0.0 * step.start[0] + math.inf
    for j, (start, end) in enumerate(zip(step.start, step.end, strict=True)):
        part = where(start > 0.0, start / (start - end), 0.0)
        passed = (end <= 0.0) & (part < earliest)
        rising = (on[j] > 0.5) & (step.end_rates[j] > 0.0)
        passed = passed & ((natural < 0.5) | (not_(rising) if j == 0 else natural < 0.5))
        which, earliest = where(passed, float(j), which), where(passed, part, earliest)
    return which


@symbolic
def dip(step):
    """Where in the step an event that ends above 0 may have been below it; 0 where none was."""
    at = 0.0 * step.h
    for start, end, first, last in zip(step.start, step.end, step.start_rates, step.end_rates, strict=True):
        turns = (start > 0.0) & (end > 0.0) & (first < 0.0) & (last > 0.0)
        s, low = lowest(start, end, step.h * first, step.h * last)
        deep = turns & (low < LOW * where(start < end, start, end)) & (s > 1e-3) & (s < 0.999)
        at = where(deep & not_((at > 0.0) & (at < s)), s, at)
    return at


@symbolic
def passed_another(values, which, on):
    """Whether another event than this one is behind."""
    other = which < -math.inf
    for j, value in enumerate(values):
        own = (which > j - 0.5) & (which < j + 0.5)
        other = other | ((value < 0.0) & not_(own | (on[j] > 0.5)))
    return other


@symbolic
def finite(state):
    """Whether every entry is a number."""
    return total(tuple(magnitude(u) for u in state)) < math.inf
