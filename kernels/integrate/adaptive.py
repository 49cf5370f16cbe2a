"""Legs from event to event by an embedded pair of methods (`pairs`) to a tolerance; generic in one cell or lanes.

A leg has the same interface as that of the Taylor method (`taylor_leg`), for the same driver. At both ends of a step
the events are known by value and rate, and in between by intervals (`expression.hidden`): each event must be proved to
stay above 0, to decrease or to increase throughout, or the step is halved; an event so close to 0 that no short step
proves it is grazing. One that is below 0 at the end is located on the dense output by a bracketed Newton method. A step
is not taken if its rates may vary between the stages by more than the tolerance (`expression.hidden`), because the
error estimate could miss that.
"""

import math

from kernels.integrate.events import cubic_root, dip, finite, first_event, met_at, of_event, passed_another
from kernels.integrate.pairs import at_least, of_size
from kernels.integrate.records import Leg, Step
from kernels.integrate.steps import ONE, events
from kernels.integrate.taylor import COME_UP, PATIENCE, next_step
from kernels.lanes.jit import jit
from kernels.lanes.symbols import symbolic
from kernels.lanes.tuples import after, boxes, marks, reached, times
from kernels.lanes.vectors import any_lane, choose, fma, is_rare, magnitude, not_, where

STEP_LIMIT = 10_000
SAFETY = 0.25
"""Of the tolerance, for which the next step is chosen."""
FURTHEST = 1e301
"""Units of time, a step of which comes to no event any more: at an equilibrium every step is right."""
SHRINK, GROW = 0.2, 5.0
"""Least and most of the step before that the next one is."""
FORGOTTEN = 1e-4
"""The error of a step over the tolerance below which it says nothing of how errors grow: events have cut the step."""
CUTS = 60
CLOSE = 30.0
"""Tolerances within which a turning point of an event is too close to 0 to be told from a crossing."""
SUNK, ROUNDED = 0.01, 1e-11
"""How far below an event that it starts on a motion may fall within a step: of the tolerance, and by rounding."""
BENT, NARROWED = 0.5, 8.0
"""Cuts of a step after which a motion that starts on an event may leave it by its bend, and after which one that comes
close to an event may be called grazing."""
AT_ONCE = 1e-15
"""Of its largest value since the last event, a surface's value within which it is met at once with another one."""
LATELY, OFTEN = 0.9, 0.1
"""What a step came to counts so much less at the next one; and the share of steps lately tried that came to no number
above which a motion that does not reach its end is out of range. On a stiff scene some steps come to none, too."""
HALVED = 30.0
"""Halvings after which a motion that starts on an event with no rate has not risen from it."""


@symbolic
def shows_all(m, step, box, mode, first, tolerance):
    """Whether what a step hides is within the tolerance of each state's size and of each event's value; NaN fails."""
    of_rates, of_events = m.hidden(step.state, box, mode)
    seen = of_size(step.state, step.new, first, step.h, times(step.h, of_rates)) <= tolerance
    for hidden, start, end in zip(of_events, step.start, step.end, strict=True):
        seen = seen & (hidden <= tolerance * (magnitude(start) + magnitude(end)))
    return seen


@symbolic
def doubted(m, step, box, mode, on, cuts, margins, tolerance):
    """Where an event is not proved to stay above its margin, or to fall or rise all along; and where one is near 0.

    A motion that starts on an event with no rate and leaves it by its bend is believed to, on a step cut short enough.
    """
    low, rate_low, rate_high = m.bounds(step.state, box, mode)
    near = doubt = step.h < 0.0
    for j, margin in enumerate(margins):
        start, end, rise = step.start_rates[j], step.end[j], 0.5 * step.h * step.end_rates[j]
        bends = (on[j] > 0.5) & (cuts > BENT) & (end > 0.0) & (rise > 0.0) & (rise <= 2.0 * end)
        bends = bends & (step.h * start <= 0.5 * end) & (-step.h * start <= fma(SUNK, tolerance, ROUNDED) * end)
        unsure = not_((low[j] > margin) | (rate_high[j] < 0.0) | (rate_low[j] > 0.0) | bends)
        doubt = doubt | unsure
        near = near | (unsure & (on[j] < 0.5) & (magnitude(step.end[j]) <= margin))
    return doubt, near


@symbolic
def next_length(pair, h, last_h, error, before):
    """The next step, for an error over the tolerance: as if that grew on as it has since the step before.

    Without this a motion towards a pole has every second step refused, and those taken are as long at any tolerance.
    Source: Gustafsson, ACM Trans. Math. Softw. 20:496 (1994).
    """
    longer = next_step(h, error / SAFETY, pair.order)
    foreseen = next_step(h * h / last_h, (error / SAFETY) * (error / before), pair.order)
    longer = where((before > 0.0) & (error > FORGOTTEN) & (error <= 1.0) & (foreseen < longer), foreseen, longer)
    longer = where(longer < GROW * h, longer, GROW * h)
    return where(longer > SHRINK * h, longer, SHRINK * h)


@symbolic
def met_besides(values, start, wide, lanes):
    """1 for each event that is met at once with the one that these are the values at."""
    parts = zip(values, start, wide, strict=True)
    return tuple(where(lanes & (x > 0.0) & (magnitude(v) <= AT_ONCE * w), 1.0, 0.0) for v, x, w in parts)


@jit
def to_event(pair, cell, mode, active):
    """Follow the active lanes until an event falls through 0, and stop there; see `taylor_leg`."""
    m = pair.scene
    state, unit, on, tolerance = cell.state, cell.unit, cell.on, cell.tolerance
    h = pair.first(m, state, mode, unit, cell.h)
    moving, nothing, fired = active, active & not_(active), times(0.0, on)
    stuck, lost, broken, grazing, hangs = nothing, nothing, nothing, nothing, nothing
    t, cuts, tried, blown, last_h, last_error = 0.0 * h, 0.0 * h, 0.0 * h, 0.0 * h, h, 0.0 * h
    start, start_rates = events(m, state, mode)
    wide, reach, waited, paused = reached(fired, start), reached(times(0.0, state), state), 0, nothing
    for tries in range(STEP_LIMIT):
        h = m.on_clock(state, unit, h)
        length = h * unit
        trial = pair.tried(m, state, mode, length)
        new, first = trial.new, trial.stages[0]
        end, end_rates = events(m, new, mode)
        step = Step(state, new, length, start, start_rates, end, end_rates)
        # by its error, and by what it may hide
        sound = finite(new)
        error = where(sound, trial.error / tolerance, math.inf)  # over an infinite size an error would be 0
        fine = error <= 1.0
        box = boxes(state, new, times(length, after(trial.last, -1.0, ONE, (first,))))
        seen = shows_all(m, step, box, mode, first, tolerance)
        longer = where(seen | not_(fine), next_length(pair, h, last_h, error, last_error), COME_UP * h)
        rough = moving & not_(fine & seen)
        # by its events: proved to stay away, met, or to be cut, for it may hide a root
        which, margins = first_event(step, on, 0.0), times(CLOSE * tolerance, wide)
        met = moving & not_(rough) & (which > -0.5)
        pressed = met & (of_event(on, which) > 0.5)
        above, below = of_event(start, which), of_event(end, which)
        rate, last_rate = of_event(start_rates, which), of_event(end_rates, which)
        flat = (below < 0.0) & (-length * rate <= -fma(SUNK, tolerance, ROUNDED) * below)
        away = (rate > 0.0) | (flat & (cuts < HALVED))  # leaves the event that it starts on and has met again
        doubt, near = doubted(m, step, box, mode, on, cuts, margins, tolerance)
        at_once = met & not_(above > 0.0) & (below < 0.0) & (cell.time <= 0.0)  # starts there at rest, and falls
        doubt = doubt & moving & not_(rough | pressed | at_once)
        low = where(doubt & not_(met | not_(cuts < 0.5)), dip(step), 0.0)
        close = doubt & near & (cuts > NARROWED)
        again = rough | (pressed & away) | (doubt & not_(close))
        shorter = where(rough, longer, where(low > 0.0, low * h, 0.5 * h))
        # onto the event; again where another one is behind by then, or the dense output is vague
        taken, loose, seeking, also = h, nothing, met & not_(pressed | again), times(0.0, on)
        if any_lane(seeking):
            curved = seeking & (above > 0.0)
            terms = pair.series(m, state, trial, mode, length)
            part = where(curved, cubic_root(above, below, length * rate, length * last_rate, curved), 0.0)
            part, found, slope, _ = met_at(m, pair.dense, mode, step, terms, which, part, 4e-16, curved)
            part, found = where(curved, part, 0.0), choose(curved, found, state)
            vague = of_size(state, new, first, length, pair.vague(m, state, terms, mode, length, part))
            other = curved & (part < 0.999999) & (part > 0.0)
            values = events(m, found, mode)[0]
            other = other & passed_another(values, which, on)
            if m.surfaces is not None:
                also = met_besides(values, start, wide, curved)
            loose = curved & not_(other) & (vague > tolerance)
            shorter = where(other, part * h, shorter)
            shorter = where(loose, h * where(part < 0.9, 1.05 * part, 0.5), shorter)
            bend = magnitude(length * last_rate - length * rate) / length
            turns = not_(magnitude(slope) * length > 2.0 * of_event(margins, which) * (bend / magnitude(slope)))
            hangs = hangs | (curved & not_(other | loose) & turns)
            new, taken = choose(seeking, found, new), where(seeking, part * h, taken)
            again = again | other | loose
        once_more = where(again, cuts, 0.0)
        cuts = where(again & not_(rough | loose), cuts + 1.0, once_more)
        # moved on, unless it comes to nothing
        stuck, grazing = stuck | (pressed & not_(away)), grazing | close
        blown = where(moving, where(sound, LATELY * blown, LATELY * blown + 1.0 - LATELY), blown)
        lost, broken = lost | (moving & not_((cuts <= CUTS) & (h < FURTHEST))), broken | (moving & not_(h > 1e-280))
        given_up = stuck | grazing | broken | lost
        moved = moving & not_(again | given_up)
        done = moved & (which > -0.5)
        t, tried = where(moved, t + taken, t), where(moving, tried + 1.0, tried)
        last_h, last_error = where(moved, h, last_h), where(moved, at_least(error, FORGOTTEN), last_error)
        h = where(again, shorter, where(moved & not_(done), longer, h))
        state, start, start_rates = choose(moved, (new, end, end_rates), (state, start, start_rates))
        on, fired = choose(moved, times(0.0, on), on), choose(done, reached(also, marks(which, on)), fired)
        wide, reach = reached(wide, start), reached(reach, state)
        moving = moving & not_(done | given_up)
        if not any_lane(moving):
            break
        if tries > PATIENCE and is_rare(moving, active):
            waited += 1
            if 2 * waited > tries:
                paused, moving = moving, nothing
                break
    lost, blown = lost | moving, blown > OFTEN
    return Leg(
        state, t, h, fired, stuck, lost & not_(blown), broken | (lost & blown), grazing, hangs, nothing, paused, tried,
        reach,
    ), ()  # fmt: skip
