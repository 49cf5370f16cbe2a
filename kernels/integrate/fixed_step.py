"""Legs from event to event at a fixed step; generic in one cell or lanes.

A step ends on a located event, and the next full step begins there. An event that is passed twice within a step does
not show at its ends: if it decreases at the start and increases at the end, the step is cut at the minimum of the cubic
in between. A motion that starts on an event and is back on it at the end had two roots within the step, which is then
halved; one that cannot leave it sticks.
"""

import math
from typing import NamedTuple

from kernels.integrate import events as E
from kernels.integrate.driver import BLUR
from kernels.integrate.events import (
    cubic_root,
    dip,
    finite,
    first_event,
    leap,
    leapt,
    met_at,
    of_event,
    passed_another,
)
from kernels.integrate.records import Leg, Mode, Step
from kernels.integrate.steps import ONE, events, rate
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import symbolic
from kernels.lanes.tuples import after, any_of, boxes, marks, reached, times
from kernels.lanes.vectors import any_lane, choose, magnitude, not_, where

STEP_LIMIT = 20_000
"""Steps between two switches after which a cell is given up."""
CUTS = 60
"""Times that a step may be cut one after the other."""
SETTLED = 1e-14
"""Relative change of the part of a step after which the event is where the next trial ends."""
HIDDEN = 1e-13
"""Of a state's size, what the rates may hide in a step (`expression.hidden`) unremarked."""
GRAZING = 1e-9
"""Of an event's value at the start of a step: how close to 0 it may turn round in it unremarked."""
TOLERANCE = 1e-14 / BLUR
"""As of a motion to a tolerance, so that rounding may take 1e-14 of the surface's value at the start unremarked."""


class Scheme(NamedTuple):
    """A method at a fixed step, how it locates events (both numbers of `events`), and the substeps of a step."""

    method: float
    location: float
    substeps: float


class Fixed(NamedTuple):
    """What a lane knows of steps of a fixed length, beside what it does of any motion.

    reach : largest size of each state since the last switch
    slim : least margin behind a switch
    wide : largest of the surface's value since the last switch
    scheme : the same in all lanes
    """

    reach: tuple
    slim: float
    steps: float
    calls: float
    wide: float
    scheme: Scheme


@jit
def number(x):
    """A number of `events`, the same in all lanes, as an integer."""
    found = 0
    for k in range(len(E.METHODS)):
        if any_lane(x > k + 0.5):
            found = k + 1
    return found


@jit_call
def located(m, scheme, mode, step, which, seeking):
    """The part of the step at which the event fires, the state there, and calls of the rates."""
    e0, e1, h = of_event(step.start, which), of_event(step.end, which), step.h
    part, curved = where(e0 > 0.0, e0 / (e0 - e1), 0.0), seeking & (e0 > 0.0)
    if scheme.location in (E.HERMITE, E.ROOT):
        d0, d1 = of_event(step.start_rates, which), of_event(step.end_rates, which)
        part = where(curved, cubic_root(e0, e1, h * d0, h * d1, curved), part)
    if scheme.location == E.ROOT:
        part, new, _, trials = met_at(m, leapt, mode, step, scheme, which, part, SETTLED, curved)
        part = where(curved, part, 0.0)
    else:
        new, trials = leap(m, scheme, step.state, mode, part * h), 1.0 + 0.0 * h
    calls = trials * (E.CALLS[scheme.method] * scheme.substeps)
    return part, choose(curved, new, step.state), where(curved, calls, 0.0)


@symbolic
def shows_all(m, state, new, mode, h):
    """Whether a step hides no more of a state than its stages tell; NaN does."""
    seen = h <= math.inf
    if m.hiding is None:
        return seen
    change = times(h, after(rate(m, new, mode), -1.0, ONE, (rate(m, state, mode),)))
    for hidden, u, w in zip(m.hidden(state, boxes(state, new, change), mode)[0], state, new, strict=True):
        seen = seen & (h * hidden <= HIDDEN * (magnitude(u) + magnitude(w)))
    return seen


@symbolic
def turns_close(step, on):
    """Whether an event that the motion does not start on ends next to 0."""
    parts = zip(step.start, step.end, on, strict=True)
    return any_of(tuple((magnitude(end) < GRAZING * magnitude(start)) & (o < 0.5) for start, end, o in parts))


@jit
def to_event(m, cell, mode, active):
    """Follow the active lanes until a step ends on an event; see `taylor_leg`. Also what they know of their steps."""
    state, on, own = cell.state, cell.on, cell.own
    scheme = Scheme(number(own.scheme.method), number(own.scheme.location), number(own.scheme.substeps))
    natural = scheme.location == E.NONE
    mode = Mode(mode.side, mode.signs, mode.parameters, natural)
    moving, nothing, fired = active, active & not_(active), times(0.0, on)
    stuck, lost, broken, hangs, vague = nothing, nothing, nothing, nothing, nothing
    t, cut, cuts = 0.0 * cell.h, 0.0 * cell.h, 0.0 * cell.h
    begins = cell.since <= 0.0  # behind a switch
    reach = choose(begins, reached(times(0.0, state), state), own.reach)
    trials, wide = where(begins, 0.0, cell.steps), where(begins, 0.0, own.wide)
    slim, steps, calls = own.slim, own.steps, own.calls
    start, start_rates = events(m, state, mode)
    for _ in range(STEP_LIMIT + 1):
        h = where(cut > 0.0, cut, cell.h)
        new = leap(m, scheme, state, mode, h)
        end, end_rates = events(m, new, mode)
        step = Step(state, new, h, start, start_rates, end, end_rates)
        which = first_event(step, on, 1.0 if natural else 0.0)
        wide = where(moving & (start[0] > wide), start[0], wide)
        blown = moving & not_(finite(new) & finite(end))
        met = moving & (which > -0.5) & not_(blown)
        taken, shorter, again, more = h, 0.5 * h, nothing, 0.0 * h
        if scheme.method == E.MOREAU:
            rests = (magnitude(state[-1]) <= 0.0) & (magnitude(new[-1]) <= 0.0)
            stuck = stuck | (moving & rests & not_(met | blown))
        if not natural:  # ended on the event that it met, or to be cut, for it may hide a root of an event
            pressed = met & (of_event(on, which) > 0.5)
            away = of_event(start_rates, which) > 0.0
            stuck, missed = stuck | (pressed & not_(away)), moving & not_(met | blown)
            hangs = hangs | (missed & (cuts > 0.5) & turns_close(step, on))
            low = where(missed & not_(cuts > 0.5), dip(step), 0.0)
            again, shorter = (pressed & away) | (low > 0.0), where(low > 0.0, low * h, shorter)
            seeking = met & not_(pressed)
            if any_lane(seeking):
                part, found, more = located(m, scheme, mode, step, which, seeking)
                other = seeking & (part < 0.999999) & (part > 0.0)
                other = other & passed_another(events(m, found, mode)[0], which, on)
                new, taken, more = choose(seeking, (found, part * h, more), (new, taken, 0.0))
                again, shorter = again | other, where(other, part * h, shorter)
        lost, broken = lost | (again & (cuts > CUTS)), broken | blown
        given_up = stuck | lost | broken
        moved = moving & not_(again | given_up)
        vague = vague | (moved & not_(shows_all(m, state, new, mode, taken)))
        below = (which < -0.5) & (end[0] <= 0.0) & natural  # not yet above where it began
        done = moved & (which > -0.5)
        # how far behind the switch it would turn round, over the surface's largest value: by the rates at both ends
        first, last, above = start_rates[0], end_rates[0], start[0]
        back = done & (which < 0.5) & (mode.signs[-1] > 0.0) & (last > first) & (above > 0.0)
        at_switch = (last - first) * where(above > end[0], above / (above - end[0]), 0.0) + first
        bend = where(back, (last - first) / h, 1.0)
        behind = at_switch * at_switch / (2.0 * bend * where(wide > 0.0, wide, 1.0))
        slim = where(back & (behind < slim), behind, slim)
        state, start, start_rates = choose(moved, (new, end, end_rates), (state, start, start_rates))
        t, fired = where(moved, t + taken, t), choose(done, marks(which, on), fired)
        on, reach = choose(moved & not_(below), times(0.0, on), on), choose(moving, reached(reach, state), reach)
        cut, cuts = where(again, shorter, 0.0), where(again, cuts + 1.0, 0.0)
        steps, trials = where(moving & not_(again), steps + 1.0, steps), where(moving, trials + 1.0, trials)
        calls = where(moving, calls + (E.CALLS[scheme.method] * scheme.substeps + more), calls)
        moving = moving & not_(done | given_up)
        lost = lost | (moving & (trials > STEP_LIMIT))
        moving = moving & not_(lost)
        if not any_lane(moving):
            break
    leg = Leg(state, t / cell.unit, cell.h, fired, stuck, lost, broken, nothing, hangs, vague, nothing, trials, reach)
    return leg, Fixed(reach, slim, steps, calls, wide, own.scheme)
