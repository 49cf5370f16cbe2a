"""Where in a step an event fires, and the state there: four ways, generic in one cell or lanes.

An event is known at both ends of the step [0, h] by its value (e0 > 0 >= e1) and its rate (d0, d1). `linear` and
`hermite` find the part of the step by a line or by the cubic through all four, and take a step of just that length.
`root` is exact to the method: each trial is a step of its own from the same start, which is the method's continuous
extension. `none` takes the event to fire at the end of the step: the fault to be shown.
"""

from kernels.integrate.steps import dop853, dopri5, euler, events, moreau, rk4, semi_implicit, verlet
from kernels.lanes.jit import jit_call
from kernels.lanes.symbols import symbolic
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, sqrt, where

METHODS = ("euler", "semi_implicit", "verlet", "rk4", "dopri5", "dop853", "moreau")
EULER, SEMI_IMPLICIT, VERLET, RK4, DOPRI5, DOP853, MOREAU = range(7)
ORDER = (1, 1, 2, 4, 5, 8, 1)
CALLS = (1.0, 1.0, 2.0, 4.0, 6.0, 12.0, 2.0)
"""Calls of the rates in a step."""
NONE, LINEAR, HERMITE, ROOT = range(4)
LOCATIONS = {"none": NONE, "linear": LINEAR, "hermite": HERMITE, "root": ROOT}

ROOT_LIMIT = 60
SETTLED = 1e-11
"""Change of the part of a step after which the event is where the next trial ends."""


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
def shortened(m, scheme, mode, step, which, first, seeking):
    """The step that ends on the event: part of h, state, trials, and whether it is not found.

    Regula falsi with halving (Illinois): the event's rate is not the slope of its value over the step's length.
    """
    h = step.h
    low, high, part, trials = 0.0 * h, 0.0 * h + 1.0, first, 0.0 * h
    above, below = of_event(step.start, which), of_event(step.end, which)
    new = leap(m, scheme, step.state, mode, part * h)
    settled, last = seeking & not_(seeking), 0.0 * h
    for _ in range(ROOT_LIMIT):
        trials = where(seeking, trials + 1.0, trials)
        seeking = seeking & not_(settled)
        if not any_lane(seeking):
            break
        value = of_event(events(m, new, mode)[0], which)
        before = value > 0.0
        above = where(before, value, where(last < 0.0, 0.5 * above, above))
        below = where(before, where(last > 0.0, 0.5 * below, below), value)
        low, high = where(before, part, low), where(before, high, part)
        last = where(before, 1.0, -1.0)
        guess = fma(high - low, above / (above - below), low)
        settled = (magnitude(guess - part) <= SETTLED) | (magnitude(value) <= 0.0)
        part = where(seeking, guess, part)
        new = choose(seeking, leap(m, scheme, step.state, mode, part * h), new)
    return part, new, trials, seeking
