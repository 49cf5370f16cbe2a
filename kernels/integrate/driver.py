"""Takes a lane from one event to the next: start, switch, change of signs, count, end; generic in the scene.

A motion may slide along a kink towards which the field points from both sides (`codegen.sliding`): then the kink's sign
is 0, and its event is that the field of one side no longer points towards it. For a single kink, whether the motion
slides follows from the rates on both sides. If two kinks are met at once, the signs are left unchanged, and the next
leg sticks or goes on.
"""

import math

from kernels.integrate import carried
from kernels.integrate.records import Mode
from kernels.lanes.codes import BAD_INPUT, GRAZING, INACCURATE, OUT_OF_RANGE, REFUSED, STEP_LIMIT, STICKS
from kernels.lanes.columns import DONE, MOVING, PAUSED
from kernels.lanes.jit import jit
from kernels.lanes.symbols import left_a_call, symbolic, taking_symbols
from kernels.lanes.tuples import any_of, joined, reached, read, total, write
from kernels.lanes.vectors import any_lane, choose, exponent, fma, magnitude, not_, pow2, sqrt, where

ERRORS = taking_symbols(carried)
KINK_LIMIT = 1000
"""Kinks between two switches after which a cell is given up."""
EVENTS = 1_000_000
"""Of lanes none of which finishes, before what they keep is put down."""
BLUR = 16.0
"""Tolerances of the surface's value at the start that rounding may take from it: rtol/2 in the finer run."""
BACK = 1e-9
"""Of an event's rate before a switch, that of one which rounding may be all of behind it."""
STILL = 1e-12
"""Of what a surface's value is made of, that within which a motion is on it."""
MET = 1e-2
"""The same behind an event, of what has been met by moving there and not by a jump."""
ONE_ULP = 2.0**-52
CLOCK_OFF = 8.0
"""Roundings that a clock is off by from one event to the next in a shaken run: what is near an event in time hangs on
the time that has gone by since then, of which what is left of a clock's rounding is much more than of the clock. So it
is with a pulse at a place, and the state that passes it (`Written.states_off`)."""
REMEMBERED = 4.0
"""The way to an event, which roundings lengthen, counts for at most so many times the shortest time in which a state
changes by all of its size: what is fast has forgotten the rest of the way."""
GOLDEN = 0.6180339887498949
"""What the share of the roundings that an event is missed by goes on by from one event to the next, so that no two of
some events one behind the other are missed alike: what is between them would not show it."""


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


@left_a_call
def settled(m, state, side, parameters, unit, near):
    """The sign of each kink's u in the next moment, the way over the surface, 1, behind; and 1 for those it is on.

    `near` : 1 where the state is nearly on a kink
    """
    signs, turned, marks = m.natural_signs(state, Mode(side, (), parameters, False)), [], []
    if m.speeds is not None:  # what is met next may hang on whether the motion slides
        mode, nothing = Mode(side, signs, parameters, False), tuple(0.0 * x for x in near)
        signs, *_ = pressed(m, state, mode, (0.0 * side, *near), nothing, 0.0, side < math.inf)
    events = m.jet(state, Mode(side, signs, parameters, False), unit)
    for sign, close, (_, factor, u) in zip(signs[:-1], near, events[1:], strict=True):
        on = ((u[0] <= 0.0) & (u[0] >= 0.0)) | (close > 0.5)
        back = (factor * u[1] < 0.0) | ((factor * u[1] <= 0.0) & (factor * u[2] < 0.0))
        turned.append(where(on & back, -sign, sign))
        marks.append(where(on, 1.0, 0.0))
    return (*turned, signs[-1]), tuple(marks)


@symbolic
def missed_by(m, shake):
    """Roundings that an event is missed by; `shake` is 0 for none, else a sign, and 1 and the part of all of it.

    Where a method is biased all are to one side in a run.
    """
    by = m.roundings * (2.0 * magnitude(shake) - 3.0 + m.biased)
    return where(magnitude(shake) > 0.5, where(shake < 0.0, -by, by), 0.0)


@symbolic
def shaken_on(shake):
    """What `missed_by` takes for the next event."""
    part = magnitude(shake) + GOLDEN
    part = where(part < 2.0, part, part - 1.0)
    return where(magnitude(shake) > 0.5, where(shake < 0.0, -part, part), 0.0)


@left_a_call
def pressed(m, state, mode, on, left, margin, lanes):
    """The signs, 0 for kinks pressed from both sides, and marks of the lanes; and where that is too close to tell.

    `left` : 1 for the kink that the state has just slid along to its end
    """
    kinks = on[1:]
    if m.surfaces is not None:  # what is on a surface may slide along a kink all the same
        kinks = tuple(where(s > 0.5, 0.0, o) for s, o in zip(m.surfaces, kinks, strict=True))
    among, unsure, signs, marks = total(kinks), lanes & not_(lanes), [], []
    for sign, o, at, gone, speeds in zip(mode.signs[:-1], on[1:], kinks, left, m.speeds(state, mode), strict=True):
        ahead, behind = speeds
        asked = (at > 0.5) & (gone < 0.5) & ((among < 1.5) | (magnitude(sign) < 0.5))
        new = where((ahead < 0.0) & (behind > 0.0), 0.0, sign)
        new = where((ahead > 0.0) & (behind > 0.0), 1.0, where((ahead < 0.0) & (behind < 0.0), -1.0, new))
        at_end = where(magnitude(ahead) < magnitude(behind), 1.0, -1.0)
        faint = where(at_end > 0.0, magnitude(ahead), magnitude(behind))
        unsure = unsure | (asked & (faint <= margin * (magnitude(ahead) + magnitude(behind))))
        signs.append(where(lanes, where(gone > 0.5, at_end, where(asked, new, sign)), sign))
        marks.append(where(lanes & (magnitude(signs[-1]) < 0.5), 0.0, o))
    return (*signs, mode.signs[-1]), (on[0], *marks), lanes & unsure


@left_a_call
def rates_of_events(m, state, mode, unit):
    """Of each event's value, per unit of time."""
    return tuple(factor * u[1] for offset, factor, u in m.jet(state, mode, unit))


@symbolic
def mode_of(cell):
    """The smooth piece of the motion that the cell is on."""
    return Mode(cell.side, cell.signs, cell.parameters, False)


@symbolic
def first_of(sign, on):
    """Whether a surface is met where its event fires: where its sign is -1 the motion comes up from behind it."""
    return (on > 0.5) & (sign > 0.0)


@symbolic
def raised(verdict, lanes, least):
    """The verdict, at least that one in the lanes."""
    return where(lanes & (verdict < least), least, verdict)


@symbolic
def too_close(cell, value, size):
    """Whether a value is so close to 0, but not on it, that its sign is not sure; `size` : what it is made of."""
    return (magnitude(value) > 0.0) & (magnitude(value) <= BLUR * cell.tolerance * size)


@symbolic
def started(m, cell):
    """The cell at its start; a further surface that it starts on and falls through is met at once.

    So is the first one, but where the start is just behind a switch there, whose jump takes the motion on through it.
    """
    side = 0.0 * cell.flips + 1.0
    one, parameters, off = 0.0 * side + 1.0, cell.parameters, -m.roundings * cell.shake
    state = tuple(u + 0.0 * side for u in m.started(parameters, side))
    signs, on = settled(m, state, side, parameters, one, tuple(0.0 * side for sign in cell.signs[:-1]))
    mode = Mode(side, signs, parameters, False)
    offset, factor, u = m.jet(state, mode, one)[0]
    e, d, dd = fma(factor, u[0], offset), factor * u[1], factor * u[2]
    away = (d > 0.0) | ((d >= 0.0) & (dd > 0.0))
    lost = m.lost(state, mode)
    through = (lost < 0.0) & (magnitude(e) <= STILL * m.made(state, mode)[0][0]) & (m.passable[0] * d < 0.0)
    at = where(((e <= 0.0) & (e >= 0.0) & away) | through, 1.0, 0.0)
    blur = where(lost > 0.0, lost / magnitude(e), 0.0)  # nothing of nothing is nothing
    gap = where(through, 0.0, e)  # what it is there is rounding, which says nothing of times
    wrong = not_(magnitude(e) >= 0.0) | not_((cell.flips >= 1.0) & (cell.flips < math.inf))
    cell = cell._replace(
        state=m.shaken(state, tuple(fma(ONE_ULP * (-1.0) ** j * off, u, u) for j, u in enumerate(state))),
        side=side, signs=joined(signs[:-1], (where((e < 0.0) | through, -1.0, signs[-1]),)), on=joined((at,), on),
        unit=time_unit(gap, d, dd), own=ERRORS.started(m, cell.own, state),
        verdict=where(wrong, BAD_INPUT, where(blur <= BLUR * cell.tolerance, 0.0, INACCURATE)),
    )  # fmt: skip
    if m.speeds is not None:
        cell = onto_kinks(m, cell, tuple(0.0 * cell.side for sign in cell.signs[:-1]), cell.side < math.inf)
    if m.surfaces is None:
        return cell
    signs, on = cell.signs, cell.on
    falls = tuple(
        (o > 0.5) & (s > 0.5) & (sign < 0.0) for o, s, sign in zip(on[1:], m.surfaces, signs[:-1], strict=True)
    )
    return cell._replace(
        signs=joined(tuple(where(x, 1.0, sign) for x, sign in zip(falls, signs[:-1], strict=True)), signs[-1:]),
        on=joined(on[:1], tuple(where(x, 0.0, o) for x, o in zip(falls, on[1:], strict=True))),
    )


@symbolic
def onto_kinks(m, cell, left, lanes):
    """The cell, which slides where it is pressed onto a kink; `left` : 1 for the kink slid along to its end."""
    signs, on, faint = pressed(m, cell.state, mode_of(cell), cell.on, left, BLUR * cell.tolerance, lanes)
    return cell._replace(signs=signs, on=on, verdict=raised(cell.verdict, faint, GRAZING))


@symbolic
def arrived(m, cell, found, own, active):
    """The cell at the end of a leg; which lanes are on an event.

    `own` : what the method carries along, there
    """
    verdict = raised(raised(cell.verdict, found.hangs | found.grazing, GRAZING), found.vague, INACCURATE)
    refused = where(found.stuck, STICKS, where(found.broken, OUT_OF_RANGE, verdict))
    verdict = where(found.lost, STEP_LIMIT, refused)
    if m.speeds is not None:  # lanes whose slide has no end rest, as far as can be told
        sliding = total(tuple(magnitude(sign) for sign in cell.signs[:-1])) < len(cell.signs) - 1.5
        verdict = where(active & sliding & (found.lost | found.broken), STICKS, verdict)
    moving = active & (cell.verdict < REFUSED) & (verdict < REFUSED) & not_(found.grazing)
    state = choose(moving, found.state, cell.state)
    return cell._replace(
        verdict=verdict, h=found.h, on=found.on, size=reached(cell.size, found.reach), state=state,
        time=where(moving, fma(found.t, cell.unit, cell.time), cell.time),
        since=where(moving, fma(found.t, cell.unit, cell.since), cell.since),
        steps=where(active, found.tried, cell.steps), before=where(active, cell.steps, cell.before),
        own=own,
    ), moving  # fmt: skip


@symbolic
def shaken(m, cell, found, rates, moving):
    """The cell off its event as rounding may miss it: in a shaken run, and at the end of a slide.

    `rates` : those on the event
    """
    # for how long rounding may keep open what fires, or by how much it lengthens the way to it
    longest, state, mode = found.t * cell.unit, cell.state, mode_of(cell)
    for extent, rate in zip(cell.size, rates, strict=True):
        memory = REMEMBERED * extent / magnitude(rate)
        longest = where((memory > 0.0) & (memory < longest), memory, longest)
    longest = m.biased * ONE_ULP * longest
    for o, (extent, rate) in zip(found.on, m.made(state, mode), strict=True):
        blur = where(o > 0.5, ONE_ULP * extent / magnitude(rate), 0.0)
        longest = where(blur > longest, blur, longest)
    shakes, shake = moving & (magnitude(cell.shake) > 0.0), shaken_on(cell.shake)
    by = missed_by(m, shake)
    off, way = by * longest, shake * (magnitude(shake) - 1.5)  # states go to either side
    aside = where(way < 0.0, -CLOCK_OFF * ONE_ULP, CLOCK_OFF * ONE_ULP)
    shaken = shakes
    if m.speeds is not None:  # a slide ends late: before its end the motion is still pressed onto it, and would stick
        slides = zip(cell.signs[:-1], found.on[1:], strict=True)
        ends = moving & any_of(tuple((magnitude(sign) < 0.5) & (on > 0.5) for sign, on in slides))
        shaken, off = shaken | ends, where(ends & (longest < math.inf), magnitude(off) + longest, off)
    missed = tuple(where(shaken, fma(off, rate, u), u) for rate, u in zip(rates, state, strict=True))
    return cell._replace(shake=shake, state=choose(shakes, m.states_off(missed, aside), missed))


@symbolic
def turned(m, cell, moving):
    """The cell with the signs behind what it has met; 1 for the kink that it has slid along to its end.

    And the lanes that switch; whose switch counts; those at the first surface, at each further one (() for none).
    """
    on, signs, left, met = cell.on, cell.signs, (), ()
    if m.jumped is not None:
        *jumped, faint = m.jumped(cell.state, mode_of(cell), on, BLUR * cell.tolerance)
        on, signs = choose(moving, tuple(jumped), (on, signs))
        cell = cell._replace(verdict=raised(cell.verdict, moving & faint, GRAZING))
    switches = counts = first = moving & first_of(signs[-1], on[0])
    if m.surfaces is not None:
        parts = zip(on[1:], m.surfaces, signs[:-1], strict=True)
        met = tuple(moving & (s > 0.5) & first_of(sign, o) for o, s, sign in parts)
        counts = first | any_of(tuple(x & (s < 1.5) for x, s in zip(met, m.surfaces, strict=True)))
        switches = first | any_of(met)
    if m.speeds is not None:  # at the end of a slide the kink's sign is 0, and stays so
        held = tuple(moving & (magnitude(sign) < 0.5) for sign in signs[:-1])
        left = tuple(where(x & (o > 0.5) & not_(switches), 1.0, 0.0) for x, o in zip(held, on[1:], strict=True))
        on = (on[0], *(where(x, 1.0, o) for x, o in zip(held, on[1:], strict=True)))
    turned = tuple(where(moving & (o > 0.5), -sign, sign) for sign, o in zip(signs[:-1], on[1:], strict=True))
    kinks_met = where(counts, 0.0, where(moving, cell.kinks_met + 1.0, cell.kinks_met))
    signs = (*turned, where(moving & (on[0] > 0.5), 1.0, signs[-1]))
    return cell._replace(on=on, signs=signs, kinks_met=kinks_met), left, switches, counts, first, met


@symbolic
def switched(m, cell, rates, switches, counts, first, met):
    """The cell behind the switch that it is on, and what that makes of the rates before it.

    Its error, and whether it underflows, are told where it is the first or the last one.
    """
    count = where(counts, cell.count + 1.0, cell.count)
    watched = counts & ((count < 1.5) | (count >= cell.flips))
    own = ERRORS.at_switch(m, cell.own, rates, switches, watched, cell)
    cell = cell._replace(
        count=count, interval=where(counts, cell.since, cell.interval), at=choose(counts, cell.state, cell.at),
        verdict=where(watched & m.underflows(cell.state, mode_of(cell), cell.unit), OUT_OF_RANGE, cell.verdict),
        since=where(counts, 0.0, cell.since), own=own,
    )  # fmt: skip
    side, parameters, unit, old, signs = -cell.side, cell.parameters, cell.unit, cell.state, cell.signs
    which = signs  # where one of several surfaces is met, their signs say which: 1, or else -1
    if m.surfaces is not None:
        parts = zip(signs[:-1], m.surfaces, met, strict=True)
        which = (*(where(s > 0.5, where(x, 1.0, -1.0), sign) for sign, s, x in parts), where(first, 1.0, -1.0))
    old_mode = Mode(cell.side, which, parameters, False)
    own, rates = ERRORS.behind(m, own, old, old_mode, rates, switches)
    before, gaps, verdict = m.surface(old, old_mode), m.kinks(old, old_mode), cell.verdict
    if m.jumped is not None:  # what has jumped over 0 is not on it
        parts = zip((before, *gaps), m.made(old, old_mode), strict=True)
        before, *gaps = (where(magnitude(gap) <= MET * size, gap, 0.0) for gap, (size, _) in parts)
    if m.deciding is not None:  # a kink whose side decides what the switch does may be too close to tell its side
        parts = zip(m.deciding, gaps, m.made(old, old_mode)[1:], strict=True)
        close = tuple((decides > 0.5) & too_close(cell, gap, size) for decides, gap, (size, _) in parts)
        verdict = raised(verdict, switches & any_of(close), INACCURATE)
    state = m.switched(old, old_mode)
    if m.judged is not None:
        held = m.judged(state, Mode(side, signs, parameters, False))
        verdict = raised(verdict, switches & any_of(tuple(too_close(cell, *part) for part in held)), INACCURATE)
    gaps_behind = m.kinks(state, Mode(side, signs, parameters, False))
    near = tuple(
        where(magnitude(x) <= 2.0 * magnitude(y), o, 0.0)
        for x, y, o in zip(gaps_behind, gaps, cell.on[1:], strict=True)
    )
    signs, kinks_on = settled(m, state, side, parameters, unit, near)
    falls = rates_of_events(m, old, old_mode, unit)
    if m.surfaces is not None:  # one that the motion is on and does not leave holds it
        rates_behind = rates_of_events(m, state, Mode(side, signs, parameters, False), unit)
        parts = zip(m.surfaces, kinks_on, rates_behind[1:], falls[1:], m.passable[1:], signs[:-1], strict=True)
        held = tuple(
            where(
                (s > 0.5) & (o > 0.5) & ((magnitude(x) <= BACK * magnitude(fall)) | ((1.0 - passable) * x < 0.0)),
                1.0,
                sign,
            )
            for s, o, x, fall, passable, sign in parts
        )
        signs = (*held, signs[-1])
        parts = zip(m.surfaces, kinks_on, cell.signs[:-1], met, signs[:-1], strict=True)
        lands = tuple(  # one that the jump puts it onto from above, and that it falls through, is met at once
            (s > 0.5) & (o > 0.5) & (above > 0.0) & not_(x) & (sign < 0.0) for s, o, above, x, sign in parts
        )
        signs = (*(where(x, 1.0, sign) for x, sign in zip(lands, signs[:-1], strict=True)), signs[-1])
        kinks_on = tuple(where(x, 0.0, o) for x, o in zip(lands, kinks_on, strict=True))
    mode = Mode(side, signs, parameters, False)
    after, extent = m.surface(state, mode), m.made(state, mode)[0][0]
    still = magnitude(after) <= fma(STILL, extent, 2.0 * magnitude(before))
    rate = m.passable[0] * rates_of_events(m, state, mode, unit)[0]
    through = first & still & (rate < -BACK * magnitude(falls[0]))
    stays = still & first
    way = where(through | ((after < 0.0) & not_(stays)), -1.0, signs[-1])
    on = joined((where(stays, 1.0, 0.0),), kinks_on)
    new = cell._replace(state=state, side=side, signs=joined(signs[:-1], (way,)), on=on, verdict=verdict, own=own)
    return choose(switches, new, cell), rates


@symbolic
def gone_on(m, cell, rates, left, moving, grazing):
    """The cell on its way to the next event; `rates` : those before the last one, `left` as of `onto_kinks`.

    Where it is `grazing` the motion may have met an event or not, so there are no values.
    """
    if m.speeds is not None:
        cell = onto_kinks(m, cell, left, moving)
    own = ERRORS.misplaced(m, cell.own, rates, cell.state, mode_of(cell), moving)
    verdict = where(moving & (cell.kinks_met > m.most_kinks), STEP_LIMIT, cell.verdict)
    time, interval, *at = (where(grazing, math.nan, x) for x in (cell.time, cell.interval, *cell.at))
    return cell._replace(own=own, verdict=verdict, time=time, interval=interval, at=tuple(at))


@jit
def advance(m, leg, memory, i):
    """Every lane on from event to event, until one has finished; whether one has."""
    cell = read(memory, i, m.cell)
    stage = cell.stage
    fresh = (stage > 0.5) & (stage < 1.5)
    active = fresh | ((stage > 1.5) & (stage < 2.5))
    if any_lane(fresh):
        cell = choose(fresh, started(m, cell), cell)
    done = paused = active & not_(active)
    for _ in range(EVENTS):
        moving, before = active & (cell.verdict < REFUSED), cell
        found, own = leg(cell, mode_of(cell), moving)
        cell, moving = arrived(m, cell, found, own, active)
        rates = m.rates(cell.state, mode_of(cell))
        if m.speeds is not None or any_lane(moving & (magnitude(cell.shake) > 0.0)):
            cell = shaken(m, cell, found, rates, moving)
        cell, left, switches, counts, first, met = turned(m, cell, moving)
        if any_lane(switches):
            cell, rates = switched(m, cell, rates, switches, counts, first, met)
        cell = gone_on(m, cell, rates, left, moving, found.grazing)
        paused = found.paused
        if any_lane(paused):
            cell = choose(paused, before, cell)
        done = active & (paused | found.grazing | (cell.verdict >= REFUSED) | (cell.count >= cell.flips))
        if any_lane(done):
            break
    write(memory, i, cell)
    memory[0, i] = where(paused, PAUSED, where(done, DONE, where(active, MOVING, stage)))
    return any_lane(done)
