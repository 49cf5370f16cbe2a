"""The error of a solution by Taylor series, propagated with it: the deviation of each state, signed and of first order.

The truncation error l of a step follows from the defect of its polynomial U(t) of order p at the end, f(U(h)) - U'(h).
The defect grows as t^p, so l is h/(p + 1) times that; f(U(h)) is the first coefficient of the next step. For a state
that is the integral of another one, w, l is w_p h^(p+1)/(p + 1). While it grows, l also changes the rates, and thereby
the states by h/(p + 2) Df l more. From step to step the error is propagated by the tangent of the motion, to low order.
At an event, located up to a residual e, the computed motion is late by
    -(e + De off)/(De f),                                                                                 (1)
so that states, each compared at its own event, deviate by f times that in addition; the jump then maps the error. All
this is of first order. Where an event is too curved for that, or follows the previous one too closely, `late` and the
error are infinite.

Errors of several steps may cancel except for their uncertainty, which the motion may amplify. So a *spread* is
propagated as well: rounding errors and the fraction VAGUE of each truncation error, added without cancellation; after
an event that rounding displaces by dt, also dt times the change of the rates there. Where states feed back on one
another, the truncation error is taken to its next order: with l' = f(U) - U' + Df l and l'' = f'(U) - U'' at the end,
l = h (2 l'/(p + 2) - h l''/((p + 1) (p + 2))).

A motion may contract an error that was so large in between that the true motion went elsewhere, which first order does
not show. So if the *peak* of an error exceeds SMALL of the state's largest size, the peak is stated.

Generic in one cell or lanes; `m` is a `taylor_leg.Series`, or at switches `Written`. If its `error` is None, no error
is propagated, and everything is ().
"""

import math
from collections import namedtuple
from typing import NamedTuple

from kernels.integrate.events import of_event
from kernels.integrate.powers import outside
from kernels.integrate.taylor import curvature, last_term, natural_power, slope
from kernels.lanes.symbols import fold, symbolic
from kernels.lanes.tuples import all_of
from kernels.lanes.vectors import choose, fma, magnitude, not_, where
from kernels.maths.intervals import most

ULP = 2.0**-50
"""What rounding may take, four times over: as errors are carried, roundings of two states may cancel by chance."""
DOUBT = 4.0
"""By how much an event's margin grows per unit of its error at the start of a step."""
ORDERLY = 8.0
"""How late, of the time since the event before, one may come: else which comes first is not sure."""
FADES = 0.8
"""Of an error at a switch, what counts at the next one at least: where it changes its sign it is small by chance."""
VAGUE = 0.05
"""Of what a step leaves out, what is not known of it."""
SMALL = 0.05
"""Of the largest size of a state, the error on the way up to which first order tells of it."""
TIMES = 1.0, 1.0
"""The rates of the time, and of the time since the last switch, whose errors go along as those of states do."""
STRAIGHT = 20.0
"""Of the rate of an event, what it may change by within the time by which it is late: else it is no straight line."""


Changes = namedtuple("Changes", "of_rates of_events behind rates_made events_made tangent rough fed_back until")
"""What is written of a scene for its error; functions of (state, mode, changes) unless said otherwise.

of_rates, of_events, behind : what they change of each rate, of each event's value, of the state behind a switch
rates_made, events_made : (state, mode) -> what rates, and events but for their offsets, are made of, in size
tangent, rough : (state, mode, unit, inner, changes, cores) -> what each change is evaluated from (`taylor.Way`)
fed_back : None where no state's change comes back to it by way of another one
until : None where the times of switches are results, which they are not where states are wanted at given times
"""


class Error(NamedTuple):
    """What each state is off by, its spread, the most of both so far; and of the last step: its polynomial's rates and
    their rates at its end, its length over the order + 1 (0 where there was none), and what it has left out of sums."""

    off: tuple
    spread: tuple
    peak: tuple
    due: tuple
    bent: tuple
    weight: float
    left: tuple


@symbolic
def further(x, by):
    """x, further from 0 by something that is not below 0."""
    return where(x < 0.0, x - by, x + by)


@symbolic
def begun(m, state, errors, h):
    """The error at the start of a leg."""
    if m.error is None:
        return ()
    nothing = tuple(0.0 * h for u in state)
    return Error(errors.off[:-2], errors.spread[:-2], errors.peak, nothing, nothing, 0.0 * h, nothing)


@symbolic
def wider(m, margins, state, mode, error, errors, reach):
    """The events' margins on a step, with their errors so far: the truth may meet what the series come close to.

    Where errors are not told, by as much as far as they are small against what the states have come to, `reach`.
    """
    if m.error is None:
        return margins
    changes, vague = (m.error.of_events(state, mode, x) for x in (error.off, error.spread))
    parts = zip(error.off, error.spread, reach, strict=True)
    small = all_of(tuple(magnitude(x) + magnitude(y) <= SMALL * size for x, y, size in parts))
    return tuple(
        where(small | (errors.told > 0.5), fma(DOUBT, magnitude(x) + magnitude(y), margin), margin)
        for x, y, margin in zip(changes, vague, margins, strict=True)
    )


@symbolic
def since(m, error, full, state, mode, unit, pieces):
    """The error with what the step that has led to this state has left out; `full` are true rates beside powers."""
    if m.error is None:
        return ()
    now = full or tuple(u[1] for u in pieces.states)
    defects = tuple(rate - due for rate, due in zip(now, error.due, strict=True))
    bends = tuple(2.0 * u[2] - bent for u, bent in zip(pieces.states, error.bent, strict=True))
    return left_out(m, error, full, state, mode, unit, defects, bends)


@symbolic
def left_out(m, error, full, state, mode, unit, defects, bends):
    """The error with what a step leaves out.

    `defects` and `bends` are f - U' and f' - U''; for a power's core there is no f'.
    """
    weight, n = error.weight, m.order + 1
    parts = zip(m.summed, error.left, defects, strict=True)
    left, off = tuple(where(summed > 0.5, x, weight * defect) for summed, x, defect in parts), error.off
    if m.error.fed_back is not None:
        share, twice = weight * (n / (n + 1.0)), 2.0 * n / (n + 1.0)
        more = m.error.of_rates(state, mode, left)
        if full is None:
            left = tuple(
                where(summed > 0.5, x, fma(share, unit * by - weight * bend, twice * x))
                for summed, x, by, bend in zip(m.summed, left, more, bends, strict=True)
            )
        off = tuple(fma(share, unit * by, x) for by, x in zip(more, off, strict=True))
    off = tuple(x + y for x, y in zip(off, left, strict=True))
    spread = tuple(further(x, VAGUE * magnitude(y)) for x, y in zip(error.spread, left, strict=True))
    return error._replace(off=off, spread=spread, left=left)


@symbolic
def changes(m, error, state, mode, unit, pieces, cores):
    """What the error, and its spread, are evaluated from on a step."""
    if m.error is None:
        return ()
    off = m.error.tangent(state, mode, unit, pieces.inner, error.off, cores)
    return off, m.error.rough(state, mode, unit, pieces.rough, error.spread, cores)


@symbolic
def moved(m, error, changes, state, mode, unit, x, lanes, pieces, cores, coarse):
    """The error after a time x; its spread, with what rounding and cores of powers take; and what sums leave out.

    With the weight of a step to x, in lanes that are in no core of a power.
    """
    n = m.order + 1
    power, share = natural_power(x, n), 1.0 / n
    lasts = tuple(curve[-1][-1] for curve in pieces.of_states)
    off, spread = (tuple(way.at(x, curve)[0] for way, curve in zip(m.ways, curves, strict=True)) for curves in changes)
    parts = zip(spread, m.error.rates_made(state, mode), state, strict=True)
    spread = tuple(further(y, ULP * fma(x * unit, noise, magnitude(u))) for y, noise, u in parts)
    for span, rates, left in coarse:
        parts = zip(spread, rates, left, strict=True)
        spread = tuple(further(y, fma(rate, magnitude(x - span), by)) for y, rate, by in parts)
    weight, parts = where(outside(cores, lanes), x, 0.0) * share, zip(m.summed, lasts, strict=True)
    left = tuple(where((summed > 0.5) & (weight > 0.0), unit * power * share * last, 0.0) for summed, last in parts)
    return error._replace(off=off, spread=spread, weight=weight, left=left)


@symbolic
def still(m, error, h):
    """The error where no lane takes a step."""
    if m.error is None:
        return ()
    return error._replace(weight=0.0 * h, left=tuple(0.0 * h for x in error.left))


@symbolic
def stepped(m, error, changes, state, mode, unit, trial, steps, pieces, cores, coarse):
    """The error behind a step of the lanes that take one."""
    if m.error is None:
        return ()
    new = moved(m, error, changes, state, mode, unit, trial, steps, pieces, cores, coarse)
    due = tuple(slope(trial, u) for u in pieces.states)
    bent = tuple(curvature(trial, u) for u in pieces.states)
    off, spread = choose(steps, new.off, error.off), choose(steps, new.spread, error.spread)
    parts = zip(error.peak, off, spread, strict=True)
    peak = tuple(most(largest, magnitude(x) + magnitude(y)) for largest, x, y in parts)
    return new._replace(off=off, spread=spread, peak=peak, due=due, bent=bent)


@symbolic
def at_event(m, error, errors, changes, full, state, mode, unit, ends, end, t, which, others, pieces, cores, coarse):
    """The errors at the event that ends a leg in the states `ends`, by (1).

    `end`, `t` : time in the last step, and since the start; `which`, `others` : the event, whether more fire with it
    """
    if m.error is None:
        return ()
    rates = m.scene.rates(ends, mode)
    error = moved(m, error, changes, state, mode, unit, end, end <= math.inf, pieces, cores, coarse)
    parts = zip(m.error.of_rates(ends, mode, rates), pieces.states, strict=True)
    bends = tuple(unit * unit * x - curvature(end, u) for x, u in parts)
    defects = tuple(unit * rate - slope(end, u) for rate, u in zip(rates, pieces.states, strict=True))
    error = left_out(m, error, full, ends, mode, unit, defects, bends)
    power = natural_power(end, m.order - 1)
    noises = tuple(
        fma(ULP, noise + magnitude(offset), where(unseen > 0.5, magnitude(factor) * last_term(end, u) * power, 0.0))
        for unseen, noise, (offset, factor, u) in zip(
            m.unseen, m.error.events_made(ends, mode), pieces.events, strict=True
        )
    )
    at_end = (way.at(end, curve) for way, curve in zip(m.watched, pieces.of_events, strict=True))
    parts = [(offset, factor, *at) for (offset, factor, _), at in zip(pieces.events, at_end, strict=True)]
    left = tuple(fma(factor, u, offset) for offset, factor, u, _, _ in parts)
    bends = tuple(factor * bend for _, factor, *_, bend in parts)
    noise, left, bend = (of_event(values, which) for values in (noises, left, bends))
    change, vague, per_unit = (
        of_event(m.error.of_events(ends, mode, changed), which) for changed in (error.off, error.spread, rates)
    )
    per_time = unit * per_unit
    by, spread_late, noise = -(change + left) / per_time, -vague / per_time, magnitude(noise / per_time)
    most_by = magnitude(by) + magnitude(spread_late) + noise
    doubtful = (magnitude(bend) * most_by * STRAIGHT > magnitude(per_time)) | (most_by * ORDERLY > t)
    late = where(doubtful | others, math.inf, by)
    # where it comes up from behind the surface the motion goes on as before
    late, spread_late = (
        where((which < 0.5) & (mode.signs[-1] < 0.0) & not_(others), 0.0, x) for x in (late, spread_late)
    )
    rates = (*rates, *TIMES)
    off = zip(rates, (*error.off, *errors.off[-2:]), strict=True)
    spread = zip(rates, (*error.spread, *errors.spread[-2:]), strict=True)
    return errors._replace(
        off=tuple(fma(unit * rate, late, x) for rate, x in off),
        spread=tuple(fma(unit * rate, spread_late, x) for rate, x in spread),
        noise=noise * unit,
        peak=error.peak,
    )


@symbolic
def started(m, errors, state):
    """The errors at the start, which is rounded."""
    if m.error is None:
        return errors
    return errors._replace(spread=(*(ULP * magnitude(u) for u in state), *errors.spread[-2:]))


@symbolic
def at_switch(m, errors, rates, switches, watched, cell):
    """The errors of the lanes that switch, with the largest one, relative, where that is watched.

    `rates` are those before
    """
    if m.error is None:
        return errors
    parts, once = zip(errors.once, errors.off, errors.spread, (*rates, *TIMES), strict=True), []
    for largest, off, spread, rate in parts:
        new = magnitude(off) + magnitude(spread) + magnitude(rate) * errors.noise
        once.append(where(switches, most(FADES * largest, new), largest))
    sizes = tuple(where(size > 0.0, size, 1.0) for size in cell.size)
    times = (cell.time, cell.since) if m.error.until is None else ()
    shares = tuple(x / size for x, size in zip(once, (*sizes, *times), strict=False))
    peaks = tuple(x / size for x, size in zip(errors.peak, sizes, strict=True))
    error, peak = fold(most, shares[0], (), shares[1:]), fold(most, peaks[0], (), peaks[1:])
    error = where(watched, where(peak <= SMALL, error, most(error, peak)), errors.error)
    return errors._replace(error=error, once=tuple(once))


@symbolic
def behind(m, errors, state, mode, rates, switches):
    """The errors behind a switch, and what it makes of the rates before it, as of changes of the states."""
    if m.error is None:
        return errors, rates
    off, spread = (
        choose(switches, (*m.error.behind(state, mode, x[:-2]), x[-2], since), x)
        for x, since in ((errors.off, 0.0), (errors.spread, errors.noise))
    )
    return errors._replace(off=off, spread=spread), choose(switches, m.error.behind(state, mode, rates), rates)


@symbolic
def misplaced(m, errors, rates, state, mode, lanes):
    """The errors behind an event that is misplaced by itself: for that time the rates were those before it."""
    if m.error is None:
        return errors
    parts = zip(errors.spread[:-2], rates, m.rates(state, mode), strict=True)
    spread = tuple(where(lanes, further(x, magnitude(f - g) * errors.noise), x) for x, f, g in parts)
    return errors._replace(spread=(*spread, *errors.spread[-2:]))
