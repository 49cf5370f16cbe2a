"""What a lane does from one event to the next: start, switch, turn signs round, count, end; generic in the scene.

A motion may slide along a kink onto which both sides press it (`codegen.sliding`): then the kink's sign is 0, and its
event is that a side stops pressing. Of one kink alone that the state is on, or that it has slid along until another was
met, that is told by its speeds ahead and behind. Where two are met at once, the signs stay as they are, for the next
leg to stick or to go on.
"""

import math
from typing import NamedTuple

from kernels.integrate import carried
from kernels.integrate.records import Cell, Mode
from kernels.lanes.codes import BAD_INPUT, GRAZING, INACCURATE, OUT_OF_RANGE, REFUSED, STEP_LIMIT, STICKS
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import fold, over_tuples, symbolic
from kernels.lanes.tuples import any_of, joined, reached, read, write
from kernels.lanes.vectors import any_lane, choose, exponent, fma, magnitude, not_, pow2, sqrt, where

KINK_LIMIT = 1000
"""Kinks between two switches after which a cell is given up."""
EVENTS = 1_000_000
"""Of lanes none of which finishes, before what they keep is put down."""
BLUR = 16.0
"""Tolerances of the surface's value at the start that rounding may take from it: rtol/2 in the finer run."""
BACK = 1e-9
"""Of an event's rate before a switch, that of one which rounding may be all of behind it."""
ONE_ULP = 2.0**-52
SHAKEN, GOLDEN = 3.0, 0.6180339887498949
"""Roundings that an event is missed by at most; and what the share of it goes on by from one event to the next, so that
no two of some events one behind the other are missed alike: what is between them would not show it."""


class Start(NamedTuple):
    """Of a motion: `beyond` the surface or not, and what rounding may take (`blur`) from its value, relative to it."""

    state: tuple
    side: float
    signs: tuple
    unit: float
    on: tuple
    beyond: bool
    blur: float


class Slides(NamedTuple):
    """What is written of a scene that slides; functions of (state, mode).

    speeds : of each kink's u ahead of it and behind it, the other signs as they are
    onto : the state put back onto the kink that it slides along
    """

    speeds: object
    onto: object


@jit
def time_unit(e, d, dd):
    """A power of two near the time in which an event comes up: from e, e' and e''/2."""
    e, d, dd = magnitude(e), magnitude(d), magnitude(dd)
    by_rate, by_bend = e / d, sqrt(e / dd)
    shorter = where(by_bend < by_rate, by_bend, by_rate)
    t = where((shorter > 0.0) & (shorter < 1e300), shorter, where(by_rate < 1e300, by_rate, by_bend))
    again = d / dd
    t = where((t > 1e-300) & (t < 1e300), t, again)
    t = where((t > 1e-300) & (t < 1e300), t, 1.0)
    return pow2(exponent(t))


@symbolic
def settled_sign(sign, near, event):
    """The sign of a kink's u in the next moment, and 1 where the state is on it; `near`: 1 where it is nearly."""
    _, factor, u = event
    on = ((u[0] <= 0.0) & (u[0] >= 0.0)) | (near > 0.5)
    back = (factor * u[1] < 0.0) | ((factor * u[1] <= 0.0) & (factor * u[2] < 0.0))
    return where(on & back, -sign, sign), where(on, 1.0, 0.0)


@jit_call
@over_tuples
def settled(m, state, side, parameters, unit, near):
    """The sign of each kink's u, the way over the surface, 1, behind; and 1 for the kinks that the state is on."""
    signs = m.natural_signs(state, Mode(side, (), parameters, False))
    pieces = m.jet(state, Mode(side, signs, parameters, False), unit, ())
    found = tuple(
        settled_sign(sign, close, event) for sign, close, event in zip(signs[:-1], near, pieces.events[1:], strict=True)
    )
    return joined(tuple(sign for sign, on in found), signs[-1:]), tuple(on for sign, on in found)


@symbolic
def begun(m, flips, parameters):
    """The start of a motion. Of what rounding takes from the surface's value, nothing of nothing is nothing."""
    side = 0.0 * flips + 1.0
    one = 0.0 * side + 1.0
    state = tuple(u + 0.0 * side for u in m.started(parameters, side))
    signs, on = settled(m, state, side, parameters, one, tuple(0.0 * side for j in m.numbers[1:]))
    mode = Mode(side, signs, parameters, False)
    offset, factor, u = m.jet(state, mode, one, ()).events[0]
    e, d, dd = fma(factor, u[0], offset), factor * u[1], factor * u[2]
    way = where(e < 0.0, -1.0, signs[-1])
    away = (d > 0.0) | ((d >= 0.0) & (dd > 0.0))
    at = where((e <= 0.0) & (e >= 0.0) & away, 1.0, 0.0)
    lost = m.lost(state, mode)
    blur = where(lost > 0.0, lost / magnitude(e), 0.0)
    return Start(
        state, side, joined(signs[:-1], (way,)), time_unit(e, d, dd), joined((at,), on), not_(magnitude(e) >= 0.0), blur
    )


@symbolic
def open_for(m, state, mode, on):
    """For how long, in seconds, rounding may keep the events open that fire."""
    blurs = tuple(
        where(o > 0.5, ONE_ULP * size / magnitude(rate), 0.0)
        for o, (size, rate) in zip(on, m.made(state, mode), strict=True)
    )
    return fold(longer, 0.0 * mode.side, (), blurs)


@symbolic
def missed_by(shake):
    """Roundings that an event is missed by; `shake` is 0 for none, else a sign, and 1 and the part of all of it."""
    by = SHAKEN * (2.0 * magnitude(shake) - 3.0)
    return where(magnitude(shake) > 0.5, where(shake < 0.0, -by, by), 0.0)


@symbolic
def shaken_on(shake):
    """What `missed_by` takes for the next event."""
    part = magnitude(shake) + GOLDEN
    part = where(part < 2.0, part, part - 1.0)
    return where(magnitude(shake) > 0.5, where(shake < 0.0, -part, part), 0.0)


@symbolic
def longer(x, y):
    """The longer of two times."""
    return where(y > x, y, x)


@symbolic
def plus(x, y):
    """The sum."""
    return x + y


@symbolic
def judged_side(sign, on, left, speeds, among, margin):
    """A kink's sign, 0 where it is pressed from both sides; and whether a side is too close to pressing to tell."""
    ahead, behind = speeds
    asked = (on > 0.5) & (left < 0.5) & ((among < 1.5) | (magnitude(sign) < 0.5))
    new = where((ahead < 0.0) & (behind > 0.0), 0.0, sign)
    new = where((ahead > 0.0) & (behind > 0.0), 1.0, where((ahead < 0.0) & (behind < 0.0), -1.0, new))
    at_end = where(magnitude(ahead) < magnitude(behind), 1.0, -1.0)
    faint = where(at_end > 0.0, magnitude(ahead), magnitude(behind))
    unsure = asked & (faint <= margin * (magnitude(ahead) + magnitude(behind)))
    return where(left > 0.5, at_end, where(asked, new, sign)), unsure


@jit_call
@over_tuples
def pressed(m, state, mode, on, left, margin, lanes):
    """The signs and marks of the lanes, which slide where they are pressed; and where that is too close to tell.

    `left` : 1 for the kink that the state has just slid along to its end
    """
    among = fold(plus, 0.0, (), on[1:])
    judged = tuple(
        judged_side(sign, o, gone, speeds, among, margin)
        for sign, o, gone, speeds in zip(mode.signs[:-1], on[1:], left, m.slides.speeds(state, mode), strict=True)
    )
    signs = tuple(where(lanes, new, sign) for (new, unsure), sign in zip(judged, mode.signs[:-1], strict=True))
    marks = tuple(where(lanes & (magnitude(sign) < 0.5), 0.0, o) for sign, o in zip(signs, on[1:], strict=True))
    unsure = fold(either_unsure, margin < 0.0, (), judged)
    return joined(signs, mode.signs[-1:]), joined(on[:1], marks), lanes & unsure


@symbolic
def either_unsure(unsure, judged):
    """Whether one of them is."""
    return unsure | judged[1]


@symbolic
def undecided(m, state, mode, gaps, margin, switches, verdict):
    """The verdict: INACCURATE where a kink whose side decides what the switch does is too close to tell its side."""
    if m.deciding is None:
        return verdict
    close = tuple(
        (decides > 0.5) & (magnitude(gap) > 0.0) & (magnitude(gap) <= margin * size)
        for decides, gap, (size, _) in zip(m.deciding, gaps, m.made(state, mode)[1:], strict=True)
    )
    return where(switches & any_of(close) & (verdict < INACCURATE), INACCURATE, verdict)


@symbolic
def which_met(signs, surfaces, first, met):
    """The signs, of surfaces 1 where they are met and else -1."""
    further = tuple(
        where(s > 0.5, where(x, 1.0, -1.0), sign) for sign, s, x in zip(signs[:-1], surfaces, met, strict=True)
    )
    return joined(further, (where(first, 1.0, -1.0),))


@symbolic
def held_by(m, state, side, signs, parameters, unit, surfaces, on, falls):
    """The signs behind a switch: 1 for a surface that the motion is on and does not leave, which holds it.

    `falls` : the rates of the events before the switch
    """
    rates = rates_of_events(m, state, Mode(side, signs, parameters, False), unit)
    held = tuple(
        (s > 0.5) & (o > 0.5) & ((magnitude(rate) <= BACK * magnitude(fall)) | ((1.0 - passable) * rate < 0.0))
        for s, o, rate, fall, passable in zip(surfaces, on, rates[1:], falls[1:], m.passable[1:], strict=True)
    )
    return joined(tuple(where(x, 1.0, sign) for x, sign in zip(held, signs[:-1], strict=True)), signs[-1:])


@jit_call
@over_tuples
def rates_of_events(m, state, mode, unit):
    """Of each event's value, per unit of time."""
    return tuple(factor * u[1] for offset, factor, u in m.jet(state, mode, unit, ()).events)


@jit
@over_tuples
def advance(m, leg, memory, i, tells, slides, surfaces):
    """Every lane on from event to event, until one has finished; whether one has.

    `tells` : `carried.Changes` where the error is carried along, else None; `slides` : None where no motion slides;
    `surfaces` : 1 for each kink that is a further surface, at which the motion switches too, 2 where such switches do
    not count; None where there is none
    """
    cell = read(memory, i, m.cell)
    parameters, flips, tolerance, shake = cell.parameters, cell.flips, cell.tolerance, cell.shake
    state, side, signs, unit, h, on = cell.state, cell.side, cell.signs, cell.unit, cell.h, cell.on
    time, interval, at, size, verdict = cell.time, cell.interval, cell.at, cell.size, cell.verdict
    count, since, kinks_met, steps, before = cell.count, cell.since, cell.kinks_met, cell.steps, cell.before
    errors = cell.errors
    fresh = (cell.stage > 0.5) & (cell.stage < 1.5)
    active = fresh | ((cell.stage > 1.5) & (cell.stage < 2.5))
    if any_lane(fresh):
        start = begun(m, flips, parameters)
        state, signs, on = (
            choose(fresh, start.state, state),
            choose(fresh, start.signs, signs),
            choose(fresh, start.on, on),
        )
        side, unit = where(fresh, start.side, side), where(fresh, start.unit, unit)
        endless = not_((flips >= 1.0) & (flips < math.inf))
        unsure = where(start.blur <= BLUR * tolerance, 0.0, INACCURATE)
        verdict = where(fresh, where(start.beyond | endless, BAD_INPUT, unsure), verdict)
        errors = carried.started(errors, state, fresh)
    state = tuple(
        where(fresh, fma(ONE_ULP * odd * missed_by(shake), u, u), u)
        for odd, u in zip(m.alternating, state, strict=True)
    )
    if slides is not None:
        left = tuple(0.0 * side for sign in signs[:-1])
        mode = Mode(side, signs, parameters, False)
        if any_lane(fresh):
            signs, on, faint = pressed(m, state, mode, on, left, BLUR * tolerance, fresh)
            verdict = where(faint & (verdict < GRAZING), GRAZING, verdict)
    if surfaces is not None:  # what starts on a surface and falls switches at once
        falls = tuple(
            fresh & (o > 0.5) & (s > 0.5) & (sign < 0.0)
            for o, s, sign in zip(on[1:], surfaces, signs[:-1], strict=True)
        )
        signs = joined(tuple(where(x, 1.0, sign) for x, sign in zip(falls, signs[:-1], strict=True)), signs[-1:])
        on = joined(on[:1], tuple(where(x, 0.0, o) for x, o in zip(falls, on[1:], strict=True)))
    done = active & not_(active)
    for _ in range(EVENTS):
        moving = active & (verdict < REFUSED)
        found, late = leg(state, Mode(side, signs, parameters, False), unit, h, on, tolerance, moving, errors)
        errors = carried.later(errors, late, unit)
        verdict = where((found.hangs | found.grazing) & (verdict < GRAZING), GRAZING, verdict)
        refused = where(found.stuck, STICKS, where(found.broken, OUT_OF_RANGE, verdict))
        verdict = where(found.lost, STEP_LIMIT, refused)
        if slides is not None:  # lanes whose slide has no end rest, as far as can be told
            sliding = fold(plus, 0.0, (), tuple(magnitude(sign) for sign in signs[:-1])) < len(signs) - 1.5
            verdict = where(active & sliding & (found.lost | found.broken), STICKS, verdict)
        moving = moving & (verdict < REFUSED) & not_(found.grazing)
        state, size, h, on = choose(moving, found.state, state), reached(size, found.reach), found.h, found.on
        mode = Mode(side, signs, parameters, False)
        place = open_for(m, state, mode, on)
        shaken, shake = moving & (magnitude(shake) > 0.0), shaken_on(shake)
        rates, off = m.rates(state, mode), missed_by(shake) * place
        state = tuple(where(shaken, fma(off, rate, u), u) for rate, u in zip(rates, state, strict=True))
        time = where(moving, fma(found.t, unit, time), time)
        since = where(moving, fma(found.t, unit, since), since)
        first = counts = switches = moving & (on[0] > 0.5) & (signs[-1] > 0.0)
        if surfaces is not None:
            met = tuple(
                moving & (o > 0.5) & (s > 0.5) & (sign > 0.0)
                for o, s, sign in zip(on[1:], surfaces, signs[:-1], strict=True)
            )
            counts = first | any_of(tuple(x & (s < 1.5) for x, s in zip(met, surfaces, strict=True)))
            switches = switches | any_of(met)
        kinks_met = where(counts, 0.0, where(moving, kinks_met + 1.0, kinks_met))
        if slides is not None:  # at the end of a slide the kink's sign is 0, and stays so
            held = tuple(moving & (magnitude(sign) < 0.5) for sign in signs[:-1])
            left = tuple(where(x & (o > 0.5), 1.0, 0.0) for x, o in zip(held, on[1:], strict=True))
            on = joined(on[:1], tuple(where(x, 1.0, o) for x, o in zip(held, on[1:], strict=True)))
        turned = tuple(where(moving & (o > 0.5), -sign, sign) for sign, o in zip(signs[:-1], on[1:], strict=True))
        signs = joined(turned, (where(moving & (on[0] > 0.5), 1.0, signs[-1]),))
        if any_lane(switches):
            mode = Mode(side, signs, parameters, False)
            count = where(counts, count + 1.0, count)
            errors = carried.at_switch(errors, rates, switches)
            watched = counts & ((count < 1.5) | (count >= flips))
            if any_lane(watched):
                verdict = where(watched & m.underflows(state, mode, unit), OUT_OF_RANGE, verdict)
                interval, at = where(watched, since, interval), choose(watched, state, at)
                errors = carried.stated(errors, watched, time, since, size)
            since = where(counts, 0.0, since)
            if surfaces is not None:
                mode = Mode(side, which_met(signs, surfaces, first, met), parameters, False)
            errors, rates = carried.behind(tells, errors, state, mode, rates, switches)
            before_it, old, old_mode = m.surface(state, mode), state, mode
            gaps = m.kinks(state, mode)
            verdict = undecided(m, state, mode, gaps, BLUR * tolerance, switches, verdict)
            jumped = m.switched(state, mode)
            mode, side = Mode(side, signs, parameters, False), where(switches, -side, side)
            gaps_behind = m.kinks(jumped, Mode(side, signs, parameters, False))
            near = tuple(
                where(magnitude(x) <= 2.0 * magnitude(y), o, 0.0)
                for x, y, o in zip(gaps_behind, gaps, on[1:], strict=True)
            )
            new_signs, kinks_on = settled(m, jumped, side, parameters, unit, near)
            if surfaces is not None:
                falls = rates_of_events(m, old, old_mode, unit)
                new_signs = held_by(m, jumped, side, new_signs, parameters, unit, surfaces, kinks_on, falls)
            state, signs = choose(switches, jumped, state), choose(switches, new_signs, signs)
            mode = Mode(side, signs, parameters, False)
            after, extent = m.surface(state, mode), m.made(state, mode)[0][0]
            still = magnitude(after) <= fma(1e-12, extent, 2.0 * magnitude(before_it))
            if m.passable[0] > 0.5:
                fall, rate = rates_of_events(m, old, old_mode, unit)[0], rates_of_events(m, state, mode, unit)[0]
                through = first & still & (rate < -BACK * magnitude(fall))
                signs = joined(signs[:-1], (where(through, -1.0, signs[-1]),))
            if surfaces is not None:
                still = still & first
            on = choose(switches, joined((where(still, 1.0, 0.0),), kinks_on), on)
            way = where(switches & (after < 0.0) & not_(still), -1.0, signs[-1])
            signs = joined(signs[:-1], (way,))
        if slides is not None:
            left = tuple(where(switches, 0.0, x) for x in left)
            mode = Mode(side, signs, parameters, False)
            signs, on, faint = pressed(m, state, mode, on, left, BLUR * tolerance, moving)
            verdict = where(faint & (verdict < GRAZING), GRAZING, verdict)
        errors = carried.misplaced(m, errors, rates, state, Mode(side, signs, parameters, False), moving)
        steps, before = where(active, found.tried, steps), where(active, steps, before)
        verdict = where(moving & (kinks_met > m.most_kinks), STEP_LIMIT, verdict)
        done = active & (found.grazing | (verdict >= REFUSED) | (count >= flips))
        if any_lane(found.grazing):
            time, interval = where(found.grazing, math.nan, time), where(found.grazing, math.nan, interval)
            at = tuple(where(found.grazing, math.nan, u) for u in at)
        if any_lane(done):
            break
    stage = where(done, 3.0, where(active, 2.0, cell.stage))
    write(
        memory, i,
        Cell(
            stage, parameters, flips, tolerance, shake, time, interval, at, size, verdict,
            state, side, signs, unit, h, on, count, since, kinks_met, steps, before, errors,
        ),
    )  # fmt: skip
    return any_lane(done)
