"""Legs from event to event by Dormand-Prince 5(4) and DOP853 to a tolerance, with dense output; one cell or lanes.

A leg has the signature of the Taylor method's (`leg_source`) and drops into the same driver. Of each step the events
are known at both ends by value and rate. One that ends below 0 is located on the dense output by Newton's method in a
bracket; one that falls at the start and rises at the end is looked at where the cubic between is lowest, and a turning
point closer to 0 than the tolerance tells is called grazing. A step within which the rates may hide more than the
tolerance (`hidden_source`) is not taken: the points that an error is estimated from may miss it.
"""

from kernels.integrate.events import cubic_root, of_event
from kernels.integrate.fixed_step import dip, finite, first_event, near_an_event, passed_another
from kernels.integrate.nystrom import GROW, SHRINK
from kernels.integrate.steps import ONE, dop853_stages, dopri5_stages, rate
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
def hides_nothing(m, state, new, rates, scene, h, ends, tolerance):
    """Whether what a step may hide is within the tolerance of each state's size and of each event's value; NaN fails.

    `rates` and `ends` are what the rates and the events are where the step begins and where it ends.
    """
    side, signs, parameters, _ = scene
    (first, last), (start, end) = rates, ends
    box = boxes(state, new, times(h, after(last, -1.0, ONE, (first,))))
    of_rates, of_events = m.hidden(state, box, side, signs, parameters)
    seen = of_size(state, new, first, h, times(h, of_rates)) <= tolerance
    for j in range(len(start)):
        seen = seen & (of_events[j] <= tolerance * (magnitude(start[j]) + magnitude(end[j])))
    return seen


@jit_call
def dop853_tried(m, state, scene, h):
    """State after the step, its stages, the last rates, and the estimated error over the states' sizes."""
    new, stages = dop853_stages(m, state, scene, h)
    nothing = times(0.0, state)
    fifth, third = after(nothing, h, DOP853_ERROR_5, stages), after(nothing, h, DOP853_ERROR_3, stages)
    worst_5, worst_3 = of_size(state, new, stages[0], h, fifth), of_size(state, new, stages[0], h, third)
    total = fma(0.01 * worst_3, worst_3, worst_5 * worst_5)
    error = where(total <= 0.0, 0.0, worst_5 * worst_5 / sqrt(total))
    return new, stages, rate(m, new, scene), at_least(error, CHANCE_3 * worst_3 * worst_3)


@jit_call
def dop853_series(m, state, new, stages, last, scene, h):
    """What the dense output is made of: seven terms."""
    k0, k5, k6, k7, k8, k9, k10, k11 = stages
    k13 = rate(m, after(state, h, DOP853_MORE[0], (k0, k6, k7, k8, k9, k10, k11, last)), scene)
    k14 = rate(m, after(state, h, DOP853_MORE[1], (k0, k5, k6, k7, k10, k11, last, k13)), scene)
    k15 = rate(m, after(state, h, DOP853_MORE[2], (k0, k5, k6, k7, k8, last, k13, k14)), scene)
    nothing = times(0.0, state)
    change = after(new, -1.0, ONE, (state,))
    all_stages = (*stages, last, k13, k14, k15)
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
def dopri5_tried(m, state, scene, h):
    """State after the step, its stages, the last rates, and the estimated error over the states' sizes."""
    new, stages = dopri5_stages(m, state, scene, h)
    last = rate(m, new, scene)
    error = after(times(0.0, state), h, DOPRI5_ERROR, (*stages, last))
    bend = of_size(state, new, stages[0], h, times(h, after(last, -1.0, ONE, (stages[4],))))
    return new, stages, last, at_least(of_size(state, new, stages[0], h, error), CHANCE_5 * bend * bend / (1.0 + bend))


@jit
def dopri5_series(m, state, new, stages, last, scene, h):
    """What the dense output is made of."""
    return (*stages, last)


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


@jit_call
def on_dense(m, dense, terms, state, scene, h, which, first, seeking):
    """Where in the step the event fires, the state there and the event's rate, by the dense output."""
    side, signs, parameters, _ = scene
    low, high, part = 0.0 * h, 0.0 * h + 1.0, first
    slope = 0.0 * h
    for _ in range(ROOT_LIMIT):
        if not some(seeking):
            break
        values, slopes = m.events(dense(state, terms, h, part), side, signs, parameters)
        value, slope = of_event(values, which), where(seeking, of_event(slopes, which), slope)
        low, high = where(value > 0.0, part, low), where(value > 0.0, high, part)
        new = part - value / (slope * h)
        new = where((new >= low) & (new <= high), new, 0.5 * (low + high))
        change = magnitude(new - part)
        part = where(seeking, new, part)
        seeking = seeking & (change > 4e-16)
    return part, dense(state, terms, h, part), slope


@jit_call
def to_event(
    m, tried_step, series, dense, vague, order, state, side, signs, parameters, unit, h, on, tolerance, active
):
    """Follow the active lanes until an event falls through 0, and stop there; see `leg_source`."""
    scene = side, signs, parameters, False
    nothing = active & isnt(active)
    moving, t, count, cuts = active, 0.0 * h, 0.0 * h, 0.0 * h
    stuck, lost, broken, grazing, hangs = nothing, nothing, nothing, nothing, nothing
    fired, wide, blown = times(0.0, on), times(0.0, on), nothing
    start, start_rate = m.events(state, side, signs, parameters)
    for _ in range(STEP_LIMIT):
        length = h * unit
        new, stages, last, error = tried_step(m, state, scene, length)
        ratio = error / tolerance
        fine = (ratio <= 1.0) & finite(new)
        h_next = next_step(h, ratio / SAFETY, order)
        h_next = where(h_next < GROW * h, h_next, GROW * h)
        h_next = where(h_next > SHRINK * h, h_next, SHRINK * h)
        count = where(moving, count + 1.0, count)
        end, end_rate = m.events(new, side, signs, parameters)
        seen = hides_nothing(m, state, new, (stages[0], last), scene, length, (start, end), tolerance)
        fine, h_next = fine & seen, where(seen | isnt(fine), h_next, COME_UP * h)
        wide = reached(wide, start)
        margins = times(CLOSE * tolerance, wide)
        blown = blown | (moving & isnt(finite(new)))
        which, _ = first_event(start, end, end_rate, on, False)
        met = moving & fine & (which > -0.5)
        pressed = met & (of_event(on, which) > 0.5)
        away = of_event(start_rate, which) > 0.0
        stuck = stuck | (pressed & isnt(away))
        low = where(moving & fine & isnt(met) & (cuts < 0.5), dip(start, end, start_rate, end_rate, length), 0.0)
        again = moving & (isnt(fine) | (pressed & away) | (low > 0.0))
        shorter = where(isnt(fine), h_next, where(low > 0.0, low * h, 0.5 * h))
        grazing = grazing | (moving & fine & (cuts > 0.5) & isnt(met) & near_an_event(end, on, margins))
        seeking, loose = met & isnt(pressed), nothing
        taken = h
        if some(seeking):
            terms = series(m, state, new, stages, last, scene, length)
            e0, e1 = of_event(start, which), of_event(end, which)
            d0, d1 = length * of_event(start_rate, which), length * of_event(end_rate, which)
            curved = seeking & (e0 > 0.0)
            first = where(curved, cubic_root(e0, e1, d0, d1, curved), 0.0)
            part, found, slope = on_dense(m, dense, terms, state, scene, length, which, first, curved)
            part, found = where(curved, part, 0.0), choose(curved, found, state)
            other = curved & (part < 0.999999) & (part > 0.0)
            other = other & passed_another(m.events(found, side, signs, parameters)[0], which, on)
            again, shorter = again | other, where(other, part * h, shorter)
            loose = curved & isnt(other) & (of_size(state, new, stages[0], length, vague(terms, part)) > tolerance)
            again, shorter = again | loose, where(loose, h * where(part < 0.9, 1.05 * part, 0.5), shorter)
            new, taken = choose(seeking, found, new), where(seeking, part * h, taken)
            bend = magnitude(d1 - d0) / length
            hangs = hangs | (
                curved & isnt(other | loose) & (slope * slope * length <= 2.0 * of_event(margins, which) * bend)
            )
        cuts = where(again & fine & isnt(loose), cuts + 1.0, where(again, cuts, 0.0))
        broken = broken | (moving & isnt(h > 1e-280))
        lost = lost | (moving & (cuts > CUTS))
        moved = moving & isnt(again | stuck | grazing | broken | lost)
        state = choose(moved, new, state)
        start, start_rate = choose(moved, end, start), choose(moved, end_rate, start_rate)
        t = where(moved, t + taken, t)
        done = moved & (which > -0.5)
        fired = choose(done, marks(which, on), fired)
        on = choose(moved, marks(0.0 * h - 1.0, on), on)
        h = where(again, shorter, where(moved & isnt(done), h_next, h))
        moving = moving & isnt(done | stuck | grazing | broken | lost)
        if not some(moving):
            break
    lost = lost | moving
    return state, t, h, fired, stuck, lost & isnt(blown), broken | (lost & blown), grazing, hangs, count
