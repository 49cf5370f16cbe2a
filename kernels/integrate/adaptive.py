"""Legs from event to event by Dormand-Prince 5(4) and DOP853 to a tolerance, with dense output; one cell or lanes.

A leg has the signature of the Taylor method's (`leg_source`) and drops into the same driver. Of each step the events
are known at both ends by value and rate. One that ends below 0 is located on the dense output by Newton's method in a
bracket; one that falls at the start and rises at the end is looked at where the cubic between is lowest, and a turning
point closer to 0 than the tolerance tells is called grazing. A step within which the rates may hide more than the
tolerance (`hidden_source`) is not taken: the points that an error is estimated from may miss it.
"""

from typing import NamedTuple

from kernels.integrate.events import cubic_root, of_event
from kernels.integrate.fixed_step import dip, finite, first_event, near_an_event, passed_another
from kernels.integrate.nystrom import GROW, SHRINK
from kernels.integrate.records import Leg, Step
from kernels.integrate.steps import ONE, dop853_stages, dopri5_stages, events, rate
from kernels.integrate.tableaux import (
    DOP853_DENSE,
    DOP853_ERROR_3,
    DOP853_ERROR_5,
    DOP853_MORE,
    DOPRI5_DENSE,
    DOPRI5_ERROR,
)
from kernels.integrate.taylor import COME_UP, next_step
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.tuples import after, boxes, marks, reached, times
from kernels.lanes.vectors import choose, fma, isnt, magnitude, some, sqrt, where

STEP_LIMIT = 10_000
SAFETY = 0.25
"""Of the tolerance, for which the next step is chosen."""
CUTS = 60
ROOT_LIMIT = 60
CHANCE_3, CHANCE_5 = 0.02, 0.01
"""An estimate of high order may be 0 by chance on a step far too long, the first behind a switch for one; a rough one
of low order tells. The square of DOP853's third-order estimate, times 0.02, is of the order of its estimate, and below
it on any step worth taking; so is for Dormand-Prince 5(4) 0.01 of that of what the last two rates differ by."""
VAGUE = 0.6
"""Of the last term of DOP853's dense output, which is off by 0.13 to 0.17 of it: little beside the step's own error
where the tolerance limits the step, up to 130 times as much where friction does. Where this is over the tolerance, a
step that ends nearer to the event is taken."""
CLOSE = 30.0
"""Tolerances within which a turning point of an event is too close to 0 to be told from a crossing."""


class Trial(NamedTuple):
    """A step that is tried: the state after it, its stages, the last rates, the error over the states' sizes."""

    new: tuple
    stages: tuple
    last: tuple
    error: float


class Course(NamedTuple):
    """A leg on its way.

    h : the next step, in units
    on, fired : 1 for each event that the motion starts on, that it has met
    start, start_rates, wide : value and rate of each event; the largest value so far
    cuts, tried : how often the step has been cut, how many have been tried
    """

    state: tuple
    t: float
    h: float
    on: tuple
    fired: tuple
    start: tuple
    start_rates: tuple
    wide: tuple
    cuts: float
    tried: float
    moving: bool


class Troubles(NamedTuple):
    """As of `Leg`; `blown` where a step has left the numbers."""

    stuck: bool
    lost: bool
    blown: bool
    broken: bool
    grazing: bool
    hangs: bool


class Found(NamedTuple):
    """An event on the dense output: part of the step, state, the event's rate; how far the output may be off."""

    part: float
    state: tuple
    rate: float
    vague: float


class Ending(NamedTuple):
    """How a step is to end.

    new, taken : in this state, after that time
    again, shorter : it must be tried again, with this length
    loose : again for the dense output's sake
    stuck, grazing, hangs : as of `Leg`
    """

    new: tuple
    taken: float
    again: bool
    shorter: float
    loose: bool
    stuck: bool
    grazing: bool
    hangs: bool


@jit
def of_size(state, new, first, h, error):
    """The largest error of a state over its own size on the step."""
    worst = 0.0 * h
    for i in range(len(state)):
        start, end = magnitude(state[i]), magnitude(new[i])
        size = fma(magnitude(h), magnitude(first[i]), where(start > end, start, end))
        part = magnitude(error[i]) / where(size > 0.0, size, 1.0)
        worst = where(part <= worst, worst, part)  # NaN stays
    return worst


@jit
def at_least(error, least):
    """The larger one; NaN stays."""
    return where(error < least, least, error)


@jit_call
def hides_nothing(m, step, first, last, mode, tolerance):
    """Whether what a step may hide is within the tolerance of each state's size and of each event's value; NaN fails.

    `first` and `last` are the rates where the step begins and where it ends.
    """
    box = boxes(step.state, step.new, times(step.h, after(last, -1.0, ONE, (first,))))
    of_rates, of_events = m.hidden(step.state, box, mode.side, mode.signs, mode.parameters)
    seen = of_size(step.state, step.new, first, step.h, times(step.h, of_rates)) <= tolerance
    for j in range(len(step.start)):
        seen = seen & (of_events[j] <= tolerance * (magnitude(step.start[j]) + magnitude(step.end[j])))
    return seen


@jit_call
def dop853_tried(m, state, mode, h):
    """A step with its estimated error."""
    new, stages = dop853_stages(m, state, mode, h)
    nothing = times(0.0, state)
    fifth, third = after(nothing, h, DOP853_ERROR_5, stages), after(nothing, h, DOP853_ERROR_3, stages)
    worst_5, worst_3 = of_size(state, new, stages[0], h, fifth), of_size(state, new, stages[0], h, third)
    total = fma(0.01 * worst_3, worst_3, worst_5 * worst_5)
    error = where(total <= 0.0, 0.0, worst_5 * worst_5 / sqrt(total))
    return Trial(new, stages, rate(m, new, mode), at_least(error, CHANCE_3 * worst_3 * worst_3))


@jit_call
def dop853_series(m, state, trial, mode, h):
    """What the dense output is made of: seven terms."""
    k0, k5, k6, k7, k8, k9, k10, k11 = trial.stages
    new, last = trial.new, trial.last
    k13 = rate(m, after(state, h, DOP853_MORE[0], (k0, k6, k7, k8, k9, k10, k11, last)), mode)
    k14 = rate(m, after(state, h, DOP853_MORE[1], (k0, k5, k6, k7, k10, k11, last, k13)), mode)
    k15 = rate(m, after(state, h, DOP853_MORE[2], (k0, k5, k6, k7, k8, last, k13, k14)), mode)
    nothing = times(0.0, state)
    change = after(new, -1.0, ONE, (state,))
    all_stages = (*trial.stages, last, k13, k14, k15)
    return (
        change,
        after(times(-1.0, change), h, ONE, (k0,)),
        after(times(2.0, change), -h, (1.0, 1.0), (last, k0)),
        after(nothing, h, DOP853_DENSE[0], all_stages),
        after(nothing, h, DOP853_DENSE[1], all_stages),
        after(nothing, h, DOP853_DENSE[2], all_stages),
        after(nothing, h, DOP853_DENSE[3], all_stages),
    )


@jit
def dop853_dense(state, terms, h, part):
    """The state at that part of the step."""
    f0, f1, f2, f3, f4, f5, f6 = terms
    rest = 1.0 - part
    y = after(f5, part, ONE, (f6,))
    y = after(f4, rest, ONE, (y,))
    y = after(f3, part, ONE, (y,))
    y = after(f2, rest, ONE, (y,))
    y = after(f1, part, ONE, (y,))
    y = after(f0, rest, ONE, (y,))
    return after(state, part, ONE, (y,))


@jit
def dop853_vague(terms, part):
    """How far the dense output may be off at that part of the step, four times over."""
    rest = 1.0 - part
    square = part * part
    return times(VAGUE * square * square * rest * rest * rest, terms[6])


@jit_call
def dopri5_tried(m, state, mode, h):
    """A step with its estimated error."""
    new, stages = dopri5_stages(m, state, mode, h)
    last = rate(m, new, mode)
    error = after(times(0.0, state), h, DOPRI5_ERROR, (*stages, last))
    bend = of_size(state, new, stages[0], h, times(h, after(last, -1.0, ONE, (stages[4],))))
    worst = of_size(state, new, stages[0], h, error)
    return Trial(new, stages, last, at_least(worst, CHANCE_5 * bend * bend / (1.0 + bend)))


@jit
def dopri5_series(m, state, trial, mode, h):
    """What the dense output is made of."""
    return (*trial.stages, trial.last)


@jit
def dopri5_vague(terms, part):
    """The dense output is off by no more than 1.3 times what the step is."""
    return times(0.0 * part, terms[0])


@jit
def dopri5_dense(state, terms, h, part):
    """The state at that part of the step."""
    k0, k2, k3, k4, k5, k6 = terms
    weights = (
        _weight(part, DOPRI5_DENSE[0]),
        _weight(part, DOPRI5_DENSE[1]),
        _weight(part, DOPRI5_DENSE[2]),
        _weight(part, DOPRI5_DENSE[3]),
        _weight(part, DOPRI5_DENSE[4]),
        _weight(part, DOPRI5_DENSE[5]),
    )
    return after(state, h, weights, (k0, k2, k3, k4, k5, k6))


@jit
def _weight(part, powers):
    a, b, c, d = powers
    return part * fma(part, fma(part, fma(part, d, c), b), a)


class Pair(NamedTuple):
    """An embedded pair of methods, as functions: a step with its error, its dense output, how far that may be off."""

    tried: object
    series: object
    dense: object
    vague: object
    order: float


DOPRI5 = Pair(dopri5_tried, dopri5_series, dopri5_dense, dopri5_vague, 5.0)
DOP853 = Pair(dop853_tried, dop853_series, dop853_dense, dop853_vague, 8.0)


@jit_call
def on_dense(m, pair, mode, step, terms, which, first, seeking):
    """Where in the step the event fires, the state there and the event's rate, by the dense output."""
    h = step.h
    low, high, part = 0.0 * h, 0.0 * h + 1.0, first
    slope = 0.0 * h
    for _ in range(ROOT_LIMIT):
        if not some(seeking):
            break
        values, slopes = events(m, pair.dense(step.state, terms, h, part), mode)
        value, slope = of_event(values, which), where(seeking, of_event(slopes, which), slope)
        low, high = where(value > 0.0, part, low), where(value > 0.0, high, part)
        new = part - value / (slope * h)
        new = where((new >= low) & (new <= high), new, 0.5 * (low + high))
        change = magnitude(new - part)
        part = where(seeking, new, part)
        seeking = seeking & (change > 4e-16)
    return part, pair.dense(step.state, terms, h, part), slope


@jit
def located(m, pair, mode, step, trial, which, curved):
    """The event of the lanes in which it is above 0 at the start; of the others the start itself."""
    terms = pair.series(m, step.state, trial, mode, step.h)
    e0, e1 = of_event(step.start, which), of_event(step.end, which)
    d0, d1 = step.h * of_event(step.start_rates, which), step.h * of_event(step.end_rates, which)
    first = where(curved, cubic_root(e0, e1, d0, d1, curved), 0.0)
    part, state, slope = on_dense(m, pair, mode, step, terms, which, first, curved)
    part = where(curved, part, 0.0)
    vague = of_size(step.state, step.new, trial.stages[0], step.h, pair.vague(terms, part))
    return Found(part, choose(curved, state, step.state), slope, vague)


@jit
def only_just(step, which, slope, margin):
    """Whether an event that has this rate where it fires would turn round within the margin behind it."""
    d0, d1 = step.h * of_event(step.start_rates, which), step.h * of_event(step.end_rates, which)
    bend = magnitude(d1 - d0) / step.h
    return slope * slope * step.h <= 2.0 * margin * bend


@jit
def onto_event(m, pair, mode, step, trial, course, which, tolerance, seeking, ending):
    """The ending of the lanes that seek an event: on it, or again where another is behind by then, or it is vague."""
    curved = seeking & (of_event(step.start, which) > 0.0)
    found = located(m, pair, mode, step, trial, which, curved)
    part = found.part
    other = curved & (part < 0.999999) & (part > 0.0)
    other = other & passed_another(events(m, found.state, mode)[0], which, course.on)
    shorter = where(other, part * course.h, ending.shorter)
    loose = curved & isnt(other) & (found.vague > tolerance)
    shorter = where(loose, course.h * where(part < 0.9, 1.05 * part, 0.5), shorter)
    margin = of_event(margins(course, tolerance), which)
    hangs = curved & isnt(other | loose) & only_just(step, which, found.rate, margin)
    new, taken = choose(seeking, found.state, ending.new), where(seeking, part * course.h, ending.taken)
    again = ending.again | other | loose
    return Ending(new, taken, again, shorter, loose, ending.stuck, ending.grazing, hangs)


@jit
def margins(course, tolerance):
    """Within which a turning point of each event is too close to 0."""
    return times(CLOSE * tolerance, course.wide)


@jit
def next_length(pair, h, error):
    """The next step, for an error over the tolerance."""
    longer = next_step(h, error / SAFETY, pair.order)
    longer = where(longer < GROW * h, longer, GROW * h)
    return where(longer > SHRINK * h, longer, SHRINK * h)


@jit
def allowed(m, pair, mode, step, trial, course, tolerance):
    """The next length by the step's error, and the ending of a step that meets no event."""
    error = trial.error / tolerance
    fine = (error <= 1.0) & finite(trial.new)
    longer = next_length(pair, course.h, error)
    seen = hides_nothing(m, step, trial.stages[0], trial.last, mode, tolerance)
    longer = where(seen | isnt(fine), longer, COME_UP * course.h)
    again, nothing = course.moving & isnt(fine & seen), course.moving & isnt(course.moving)
    return longer, Ending(trial.new, course.h, again, longer, nothing, nothing, nothing, nothing)


@jit
def searched(m, pair, mode, step, trial, course, which, tolerance, ending):
    """The ending, on the event that the step meets; or again, for it may hide a root of an event."""
    fine, was_cut = course.moving & isnt(ending.again), isnt(course.cuts < 0.5)
    met = fine & (which > -0.5)
    pressed = met & (of_event(course.on, which) > 0.5)
    away = of_event(step.start_rates, which) > 0.0
    low = where(fine & isnt(met | was_cut), dip(step), 0.0)
    again = ending.again | (pressed & away) | (low > 0.0)
    shorter = where(ending.again, ending.shorter, where(low > 0.0, low * course.h, 0.5 * course.h))
    close = was_cut & fine & isnt(met) & near_an_event(step.end, course.on, margins(course, tolerance))
    stuck, nothing = pressed & isnt(away), ending.loose
    ending = Ending(ending.new, ending.taken, again, shorter, nothing, stuck, close, nothing)
    seeking = met & isnt(pressed)
    if some(seeking):
        ending = onto_event(m, pair, mode, step, trial, course, which, tolerance, seeking, ending)
    return ending


@jit
def watched(course):
    """The course of which one more step is tried; the largest value of each event with this step's start."""
    return Course(
        course.state,
        course.t,
        course.h,
        course.on,
        course.fired,
        course.start,
        course.start_rates,
        reached(course.wide, course.start),
        course.cuts,
        where(course.moving, course.tried + 1.0, course.tried),
        course.moving,
    )


@jit
def troubled(troubles, course, step, ending, cuts):
    """The troubles with those of a step."""
    moving = course.moving
    return Troubles(
        troubles.stuck | ending.stuck,
        troubles.lost | (moving & (cuts > CUTS)),
        troubles.blown | (moving & isnt(finite(step.new))),
        troubles.broken | (moving & isnt(course.h > 1e-280)),
        troubles.grazing | ending.grazing,
        troubles.hangs | ending.hangs,
    )


@jit
def moved_on(course, step, ending, which, longer, cuts, given_up):
    """The course behind a step."""
    moved = course.moving & isnt(ending.again | given_up)
    done = moved & (which > -0.5)
    return Course(
        choose(moved, ending.new, course.state),
        where(moved, course.t + ending.taken, course.t),
        where(ending.again, ending.shorter, where(moved & isnt(done), longer, course.h)),
        choose(moved, marks(0.0 * course.h - 1.0, course.on), course.on),
        choose(done, marks(which, course.on), course.fired),
        choose(moved, step.end, course.start),
        choose(moved, step.end_rates, course.start_rates),
        course.wide,
        cuts,
        course.tried,
        course.moving & isnt(done | given_up),
    )


@jit
def one_step(m, pair, mode, unit, tolerance, course, troubles):
    """The course and its troubles after one more step."""
    length = course.h * unit
    trial = pair.tried(m, course.state, mode, length)
    end, end_rates = events(m, trial.new, mode)
    step = Step(course.state, trial.new, length, course.start, course.start_rates, end, end_rates)
    course = watched(course)
    which = first_event(step, course.on, False)
    longer, plain = allowed(m, pair, mode, step, trial, course, tolerance)
    ending = searched(m, pair, mode, step, trial, course, which, tolerance, plain)
    once_more = where(ending.again, course.cuts, 0.0)
    cuts = where(ending.again & isnt(plain.again | ending.loose), course.cuts + 1.0, once_more)
    troubles = troubled(troubles, course, step, ending, cuts)
    given_up = troubles.stuck | troubles.grazing | troubles.broken | troubles.lost
    return moved_on(course, step, ending, which, longer, cuts, given_up), troubles


@jit_call
def to_event(m, pair, state, mode, unit, h, on, tolerance, active):
    """Follow the active lanes until an event falls through 0, and stop there; see `leg_source`."""
    none, zero, unmarked = active & isnt(active), 0.0 * h, times(0.0, on)
    start, start_rates = events(m, state, mode)
    course = Course(state, zero, h, on, unmarked, start, start_rates, unmarked, zero, zero, active)
    troubles = Troubles(none, none, none, none, none, none)
    for _ in range(STEP_LIMIT):
        course, troubles = one_step(m, pair, mode, unit, tolerance, course, troubles)
        if not some(course.moving):
            break
    lost = troubles.lost | course.moving
    return Leg(
        course.state,
        course.t,
        course.h,
        course.fired,
        troubles.stuck,
        lost & isnt(troubles.blown),
        troubles.broken | (lost & troubles.blown),
        troubles.grazing,
        troubles.hangs,
        course.tried,
    )
