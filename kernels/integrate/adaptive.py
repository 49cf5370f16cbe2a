"""Legs from event to event by an embedded pair of methods (`pairs`) to a tolerance; generic in one cell or lanes.

A leg has the form of the Taylor method's (`taylor_leg`) and drops into the same driver. Of each step the
events are known at both ends by value and rate, and between them by intervals (`source_text.hidden`): each must be
proved to stay above 0, to fall or to rise all along, or the step is halved; an event that comes so close to 0 that no
short step proves it is called grazing. One that ends below 0 is located on the dense output by Newton's method in a
bracket. A step within which the rates may hide more
than the tolerance (`source_text.hidden`) is not taken: the points that an error is estimated from may miss it.
"""

from typing import NamedTuple

from kernels.integrate.events import cubic_root, of_event
from kernels.integrate.fixed_step import dip, finite, first_event, passed_another
from kernels.integrate.pairs import at_least, of_size
from kernels.integrate.records import Leg, Step
from kernels.integrate.steps import ONE, events
from kernels.integrate.taylor import COME_UP, next_step
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import symbolic
from kernels.lanes.tuples import after, boxes, marks, reached, times
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, where

STEP_LIMIT = 10_000
SAFETY = 0.25
"""Of the tolerance, for which the next step is chosen."""
SHRINK, GROW = 0.2, 5.0
"""Least and most of the step before that the next one is."""
FORGOTTEN = 1e-4
"""The error of a step over the tolerance below which it says nothing of how errors grow: events have cut the step."""
CUTS = 60
ROOT_LIMIT = 60
CLOSE = 30.0
"""Tolerances within which a turning point of an event is too close to 0 to be told from a crossing."""


SUNK, ROUNDED = 0.01, 1e-11
"""How far below an event that it starts on a motion may fall within a step: of the tolerance, and by rounding."""
BENT, NARROWED = 0.5, 8.0
"""Cuts of a step after which a motion that starts on an event may leave it by its bend, and after which one that comes
close to an event may be called grazing."""
HALVED = 30.0
"""Halvings after which a motion that starts on an event with no rate has not risen from it."""


class Course(NamedTuple):
    """A leg on its way.

    h : the next step, in units
    last_h, last_error : length of the last step that was taken, in units; its error over the tolerance, 0 before it
    reach : the largest magnitude of each state so far
    on, fired : 1 for each event that the motion starts on, that it has met
    start, start_rates, wide : value and rate of each event; the largest value so far
    cuts, tried : how often the step has been cut, how many have been tried
    stuck, lost, broken, grazing, hangs : as of `Leg`
    blown : a step has left the numbers
    """

    state: tuple
    t: float
    h: float
    last_h: float
    last_error: float
    on: tuple
    fired: tuple
    start: tuple
    start_rates: tuple
    wide: tuple
    cuts: float
    tried: float
    reach: tuple
    moving: bool
    stuck: bool
    lost: bool
    blown: bool
    broken: bool
    grazing: bool
    hangs: bool


class Ending(NamedTuple):
    """How a step is to end.

    new, taken : in this state, after that time
    again, shorter : it must be tried again, with this length
    loose : again for the dense output's sake
    hangs : as of `Leg`
    """

    new: tuple
    taken: float
    again: bool
    shorter: float
    loose: bool
    hangs: bool


@symbolic
def passed_box(step, first, last):
    """The box of states that a step passes; `first` and `last` are the rates at its ends."""
    return boxes(step.state, step.new, times(step.h, after(last, -1.0, ONE, (first,))))


@symbolic
def shows_all(step, of_rates, of_events, first, tolerance):
    """Whether what a step hides is within the tolerance of each state's size and of each event's value; NaN fails."""
    seen = of_size(step.state, step.new, first, step.h, times(step.h, of_rates)) <= tolerance
    for hidden, start, end in zip(of_events, step.start, step.end, strict=True):
        seen = seen & (hidden <= tolerance * (magnitude(start) + magnitude(end)))
    return seen


@symbolic
def doubted(step, bounds, course, tolerance):
    """Where an event is not proved to stay above its margin, or to fall or rise all along; and where one is near 0.

    A motion that starts on an event with no rate and leaves it by its bend is believed to, on a step cut short enough.
    """
    low, rate_low, rate_high = bounds
    margin, doubt = margins(course, tolerance), step.h < 0.0
    near = doubt
    for j in range(len(low)):
        start, end, rise = step.start_rates[j], step.end[j], 0.5 * step.h * step.end_rates[j]
        bends = (course.on[j] > 0.5) & (course.cuts > BENT) & (end > 0.0) & (rise > 0.0) & (rise <= 2.0 * end)
        bends = bends & (step.h * start <= 0.5 * end) & (-step.h * start <= fma(SUNK, tolerance, ROUNDED) * end)
        unsure = not_((low[j] > margin[j]) | (rate_high[j] < 0.0) | (rate_low[j] > 0.0) | bends)
        doubt = doubt | unsure
        near = near | (unsure & (course.on[j] < 0.5) & (magnitude(step.end[j]) <= margin[j]))
    return doubt, near


@jit_call
def on_dense(m, pair, mode, step, terms, which, part, seeking):
    """Where in the step the event fires, the state there and the event's rate, by the dense output."""
    h = step.h
    low, high, slope = 0.0 * h, 0.0 * h + 1.0, 0.0 * h
    for _ in range(ROOT_LIMIT):
        if not any_lane(seeking):
            break
        values, slopes = events(m, pair.dense(m, step.state, terms, mode, h, part), mode)
        value, slope = of_event(values, which), where(seeking, of_event(slopes, which), slope)
        low, high = where(value > 0.0, part, low), where(value > 0.0, high, part)
        new = part - value / (slope * h)
        new = where((new >= low) & (new <= high), new, 0.5 * (low + high))
        change = magnitude(new - part)
        part = where(seeking, new, part)
        seeking = seeking & (change > 4e-16 * part)
    return part, pair.dense(m, step.state, terms, mode, h, part), slope


@symbolic
def only_just(step, which, slope, margin):
    """Whether an event that has this rate where it fires would turn round within the margin behind it."""
    d0, d1 = step.h * of_event(step.start_rates, which), step.h * of_event(step.end_rates, which)
    bend = magnitude(d1 - d0) / step.h
    return slope * slope * step.h <= 2.0 * margin * bend


@jit
def onto_event(m, pair, mode, step, trial, course, which, tolerance, seeking, ending):
    """The ending of the lanes that seek an event: on it, or again where another is behind by then, or it is vague."""
    curved = seeking & (of_event(step.start, which) > 0.0)
    terms = pair.series(m, step.state, trial, mode, step.h)
    e0, e1 = of_event(step.start, which), of_event(step.end, which)
    d0, d1 = step.h * of_event(step.start_rates, which), step.h * of_event(step.end_rates, which)
    first = where(curved, cubic_root(e0, e1, d0, d1, curved), 0.0)
    part, found, slope = on_dense(m, pair, mode, step, terms, which, first, curved)
    part, state = where(curved, part, 0.0), choose(curved, found, step.state)
    vague = pair.vague(m, step.state, terms, mode, step.h, part)
    vague = of_size(step.state, step.new, trial.stages[0], step.h, vague)
    other = curved & (part < 0.999999) & (part > 0.0)
    other = other & passed_another(events(m, state, mode)[0], which, course.on)
    loose = curved & not_(other) & (vague > tolerance)
    shorter = where(other, part * course.h, ending.shorter)
    shorter = where(loose, course.h * where(part < 0.9, 1.05 * part, 0.5), shorter)
    margin = of_event(margins(course, tolerance), which)
    hangs = curved & not_(other | loose) & only_just(step, which, slope, margin)
    new, taken = choose(seeking, state, ending.new), where(seeking, part * course.h, ending.taken)
    return Ending(new, taken, ending.again | other | loose, shorter, loose, hangs)


@symbolic
def margins(course, tolerance):
    """Within which a turning point of each event is too close to 0."""
    return times(CLOSE * tolerance, course.wide)


@symbolic
def next_length(pair, course, error):
    """The next step, for an error over the tolerance: as if that grew on as it has since the step before.

    Without this a motion towards a pole has every second step refused, and those taken are as long at any tolerance.
    Source: Gustafsson, ACM Trans. Math. Softw. 20:496 (1994).
    """
    h, before = course.h, course.last_error
    longer = next_step(h, error / SAFETY, pair.order)
    foreseen = next_step(h * h / course.last_h, (error / SAFETY) * (error / before), pair.order)
    longer = where((before > 0.0) & (error > FORGOTTEN) & (error <= 1.0) & (foreseen < longer), foreseen, longer)
    longer = where(longer < GROW * h, longer, GROW * h)
    return where(longer > SHRINK * h, longer, SHRINK * h)


@symbolic
def leaves(step, which, course, tolerance):
    """Whether a motion leaves the event that it starts on and has met again: also by its bend alone."""
    rate, end = of_event(step.start_rates, which), of_event(step.end, which)
    flat = (end < 0.0) & (-step.h * rate <= -fma(SUNK, tolerance, ROUNDED) * end)
    return (rate > 0.0) | (flat & (course.cuts < HALVED))


@symbolic
def moved_on(course, step, error, ending, which, longer, cuts, stuck, grazing):
    """The course behind a step, with its troubles."""
    moving = course.moving
    course = course._replace(
        stuck=course.stuck | stuck,
        lost=course.lost | (moving & (cuts > CUTS)),
        blown=course.blown | (moving & not_(finite(step.new))),
        broken=course.broken | (moving & not_(course.h > 1e-280)),
        grazing=course.grazing | grazing,
        hangs=course.hangs | ending.hangs,
    )
    given_up = course.stuck | course.grazing | course.broken | course.lost
    moved = moving & not_(ending.again | given_up)
    done, start = moved & (which > -0.5), choose(moved, step.end, course.start)
    state = choose(moved, ending.new, course.state)
    return course._replace(
        state=state,
        t=where(moved, course.t + ending.taken, course.t),
        h=where(ending.again, ending.shorter, where(moved & not_(done), longer, course.h)),
        last_h=where(moved, course.h, course.last_h),
        last_error=where(moved, at_least(error, FORGOTTEN), course.last_error),
        on=choose(moved, marks(0.0 * course.h - 1.0, course.on), course.on),
        fired=choose(done, marks(which, course.on), course.fired),
        start=start,
        start_rates=choose(moved, step.end_rates, course.start_rates),
        wide=reached(course.wide, start),
        cuts=cuts,
        tried=where(moving, course.tried + 1.0, course.tried),
        reach=reached(course.reach, state),
        moving=moving & not_(done | given_up),
    )


@jit
def one_step(m, pair, mode, unit, tolerance, course):
    """The course after one more step."""
    trial = pair.tried(m, course.state, mode, course.h * unit)
    end, end_rates = events(m, trial.new, mode)
    step = Step(course.state, trial.new, course.h * unit, course.start, course.start_rates, end, end_rates)
    which = first_event(step, course.on, 0.0)
    # By its error, and by what it may hide
    error = trial.error / tolerance
    fine = (error <= 1.0) & finite(trial.new)
    box = passed_box(step, trial.stages[0], trial.last)
    of_rates, of_events = m.hidden(step.state, box, mode)
    seen = shows_all(step, of_rates, of_events, trial.stages[0], tolerance)
    longer = where(seen | not_(fine), next_length(pair, course, error), COME_UP * course.h)
    rough = course.moving & not_(fine & seen)
    # By its events: proved to stay away, met, or to be cut, for it may hide a root
    met = course.moving & not_(rough) & (which > -0.5)
    pressed = met & (of_event(course.on, which) > 0.5)
    away = leaves(step, which, course, tolerance)
    doubt, near = doubted(step, m.bounds(step.state, box, mode), course, tolerance)
    doubt = doubt & course.moving & not_(rough | pressed)
    low = where(doubt & not_(met | not_(course.cuts < 0.5)), dip(step), 0.0)
    close = doubt & near & (course.cuts > NARROWED)
    again = rough | (pressed & away) | (doubt & not_(close))
    shorter = where(rough, longer, where(low > 0.0, low * course.h, 0.5 * course.h))
    nothing = course.moving & not_(course.moving)
    ending = Ending(trial.new, course.h, again, shorter, nothing, nothing)
    seeking = met & not_(pressed | again)
    if any_lane(seeking):
        ending = onto_event(m, pair, mode, step, trial, course, which, tolerance, seeking, ending)
    once_more = where(ending.again, course.cuts, 0.0)
    cuts = where(ending.again & not_(rough | ending.loose), course.cuts + 1.0, once_more)
    return moved_on(course, step, error, ending, which, longer, cuts, pressed & not_(away), close)


@jit
def to_event(m, pair, state, mode, unit, h, on, tolerance, active):
    """Follow the active lanes until an event falls through 0, and stop there; see `taylor_leg`."""
    h = pair.first(m, state, mode, unit, h)
    none, zero, unmarked = active & not_(active), 0.0 * h, times(0.0, on)
    start, start_rates = events(m, state, mode)
    wide, reach = reached(unmarked, start), reached(times(0.0, state), state)
    course = Course(
        state, zero, h, h, zero, on, unmarked, start, start_rates, wide, zero, zero, reach, active,
        none, none, none, none, none, none,
    )  # fmt: skip
    for _ in range(STEP_LIMIT):
        course = one_step(m, pair, mode, unit, tolerance, course)
        if not any_lane(course.moving):
            break
    lost = course.lost | course.moving
    broken = course.broken | (lost & course.blown)
    leg = Leg(
        course.state, course.t, course.h, course.fired, course.stuck, lost & not_(course.blown), broken,
        course.grazing, course.hangs, course.tried, course.reach,
    )  # fmt: skip
    return leg, ()
