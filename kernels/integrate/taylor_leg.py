"""The leg of a motion by Taylor series, from event to event; generic in the scene, in one cell or lanes.

The last terms of the series decide the length of a step, which is halved until each event is proved to decrease
throughout or to stay clear (`taylor`); a step in which an event falls through 0 ends the leg. Symmetry may make the
last terms of a series 0 at the start of a leg, although later terms are not. So the first step, and any whose last
terms are uninformative, is taken only if the rates at the states of the series equal its derivatives, and events their
own series (`agree`), unless rates and events are linear in the states. `m` has the compiled functions of the scene for
one order (`Series`).
"""

from typing import NamedTuple

from kernels.integrate import carried
from kernels.integrate.events import finite
from kernels.integrate.powers import FAR, outside
from kernels.integrate.records import Leg
from kernels.integrate.taylor import (
    COME_UP,
    HALVINGS,
    LONGEST,
    PATIENCE,
    ROUNDING,
    SAME,
    SLACK,
    STEP_LIMIT,
    box,
    clear,
    crossing,
    falls,
    keeps,
    last_term,
    natural_power,
    next_step,
    rises,
    size,
    slope,
    vanishes,
)
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.symbols import fold, left_a_call, symbolic
from kernels.lanes.tuples import all_of, any_of, reached, times, total
from kernels.lanes.vectors import any_lane, choose, fma, horner, is_rare, magnitude, not_, where
from kernels.maths.intervals import most

WITHIN, REFUSALS = 0.6, 20.0
"""Part of a first step at which rates and events are asked, besides its end, whether the series are theirs; and how
often in a leg a step may be refused for that: what is so much shorter than the first guess is not, or rounding would
stop it."""
AGAIN = 20
"""Steps of a leg, of which one that is not fine is tried again, shorter, where an event is neither met nor missed."""
BEYOND = 1e6
"""Times the step before, that one is at most where the series leave nothing out: of a motion that is a polynomial it
would grow so far that halving it no more comes back to what an event next to 0 asks for."""


class Series(NamedTuple):
    """What is written of a scene for the series of one order.

    scene : `Written`
    order : of the series
    pieces : (state, mode, unit, cores) -> `Pieces`
    cores : (state, mode, unit, tolerance, on, t, margins, furthest) -> of powers: `powers.core`, a tuple of each part
    on_kink : (state, fires) -> the state, 0 where a kink of a power fires
    ways, watched : how each state, and what each event watches, is evaluated (`taylor.Way`)
    summed, unseen : 1 for each state that is the sum of another one, for each event of more than one state
    bent : 1 for each state whose rate is not linear in the states; None where all rates and events are
    bent_events : 1 for each event that is not; None where all are
    at_kink : the entry of a tuple of the kink whose u is the rate of the surface, or None
    error : `carried.Changes`; None where no error is carried along
    """

    scene: object
    order: int
    pieces: object
    cores: object
    on_kink: object
    ways: tuple
    watched: tuple
    summed: tuple
    unseen: tuple
    bent: object
    bent_events: object
    at_kink: object
    error: object


@symbolic
def facts_of(events):
    """Coefficients 0 to 3 of each event."""
    return tuple(
        (fma(factor, u[0], offset), factor * u[1], factor * u[2], factor * u[3]) for offset, factor, u in events
    )


@symbolic
def judged(m, at_kink, pieces, facts, margins, now, trial, lanes, fallings):
    """Whether each event is proved to stay clear on a step or to fall all along; and which events fall.

    In `lanes` they are those that fall by this proof, elsewhere those of `fallings`.

    `at_kink` : that of m, by which the surface's proof is its rate's, or None
    """
    rests = tuple(
        magnitude(event[1]) * way.tail(trial, curve)
        for way, event, curve in zip(m.watched, pieces.events, pieces.of_events, strict=True)
    )
    parts = list(zip(facts, rests, margins, now, strict=True))
    clears = tuple(clear(e, d, dd, ddd, rest, trial, margin) for (e, d, dd, ddd), rest, margin, _ in parts)
    down = tuple(falls(d, dd, ddd, rest, trial) | begun for (_, d, dd, ddd), rest, _, begun in parts)
    if at_kink is not None:
        _, d, dd, _ = facts[0]
        clear_kink, falls_kink = at_kink(clears), at_kink(down)
        lead = where(at_kink(facts)[0] > 0.0, d, 0.0)
        clears = (rises(lead, dd) & (clear_kink | falls_kink), *clears[1:])
        down = ((rises(-lead, -dd) & clear_kink) | now[0], *down[1:])
    sure = all_of(tuple(x | y for x, y in zip(clears, down, strict=True)))
    return sure, tuple((lanes & x) | (y & not_(lanes)) for x, y in zip(down, fallings, strict=True))


@jit_apart
def doubted(m, pieces, state, unit, facts, margins, now, trial, unsure, fallings):
    """Steps of the unsure lanes halved until each event is proved to fall or to stay clear; which fall."""
    for _ in range(HALVINGS):
        sure, fallings = judged(m, None, pieces, facts, margins, now, trial, unsure, fallings)
        unsure = unsure & not_(sure)
        if not any_lane(unsure):
            break
        trial = where(unsure, m.scene.on_clock(state, unit, 0.5 * trial), trial)
    return trial, unsure, fallings


@symbolic
def shows_all(m, pieces, state, mode, unit, trial, tolerance):
    """Whether a step hides no more than the tolerance.

    Of an event that can hide something the series is asked for its last term too, for the states' do not tell of it.
    """
    if m.scene.hiding is None:
        return trial >= 0.0
    boxes = tuple(box(trial, s) for s in pieces.states)
    of_rates, of_events = m.scene.hidden(state, boxes, mode)
    power = natural_power(trial, m.order - 1)
    seen = tuple(
        (hides < 0.5) | (unit * trial * hidden <= tolerance * size(trial, s))
        for hides, hidden, s in zip(m.scene.hiding[0], of_rates, pieces.states, strict=True)
    )
    seen_events = tuple(
        (hides < 0.5)
        | (
            most(hidden, magnitude(factor) * last_term(trial, u) * power)
            <= tolerance * (magnitude(offset) + magnitude(factor) * size(trial, u))
        )
        for hides, hidden, (offset, factor, u) in zip(m.scene.hiding[1], of_events, pieces.events, strict=True)
    )
    return all_of(seen) & all_of(seen_events)


@symbolic
def unlike(m, pieces, cores, mode, unit, x, t, tolerance, lanes):
    """Of the lanes those of which rates or events at the end of a step are not the series'.

    Asked are first steps, and those of which last terms tell nothing.
    """
    if m.bent is None:
        return lanes & not_(lanes)
    begins = not_(t > 0.0)
    curves = (
        *zip(m.bent, pieces.states, strict=True),
        *zip(m.bent_events or (), (u for *_, u in pieces.events), strict=False),
    )
    tells_nothing = tuple((bent > 0.5) & vanishes(x, u) for bent, u in curves)
    asked = outside(cores, lanes & (begins | any_of(tells_nothing)))
    return disagree(m, pieces, mode, unit, x, tolerance, begins, asked)


@jit
def disagree(m, pieces, mode, unit, x, tolerance, begins, lanes):
    """Of the lanes those that do not `agree` at the end of a step; of a leg's first one, also within it."""
    if any_lane(lanes):
        same = agree(m, pieces, mode, unit, x, tolerance)
        if any_lane(lanes & begins):
            same = same & agree(m, pieces, mode, unit, WITHIN * x, tolerance)
        lanes = lanes & not_(same)
    return lanes


@left_a_call
def agree(m, pieces, mode, unit, x, tolerance):
    """Whether, a time x on, rates and events at the series' states are those of the series, to the tolerance; events
    besides to their rounding."""
    state = tuple(way.at(x, curve)[0] for way, curve in zip(m.ways, pieces.of_states, strict=True))
    allowed = (m.order + 1.0) * (tolerance + ROUNDING)
    same = tuple(
        (bent < 0.5) | (x * magnitude(unit * rate - slope(x, u)) <= allowed * size(x, u))
        for bent, rate, u in zip(m.bent, m.scene.rates(state, mode), pieces.states, strict=True)
    )
    if m.bent_events is None:
        return all_of(same)
    kinks = tuple(sign * u for sign, u in zip(mode.signs[:-1], m.scene.kinks(state, mode), strict=True))
    values = (mode.signs[-1] * m.scene.surface(state, mode), *kinks)
    parts = zip(m.bent_events, values, m.scene.made(state, mode), pieces.events, strict=True)
    same_events = tuple(
        (bent < 0.5)
        | (
            magnitude(value - fma(factor, horner(x, u), offset))
            <= fma(ROUNDING, extent, SLACK * tolerance * (magnitude(offset) + magnitude(factor) * size(x, u)))
        )
        for bent, value, (extent, _), (offset, factor, u) in parts
    )
    return all_of(same) & all_of(same_events)


@jit
def first_root(found, number, way, curve, event, facts, extent, passed, met, span, tolerance):
    """`found` is where the leg ends, by which event, whether only just; with this event, where it fires before."""
    end, which, hangs = found
    offset, factor, _ = event
    first = met & passed
    if any_lane(first):
        first = first & ((which < 0.0) | (fma(factor, way.at(end, curve)[0], offset) <= 0.0))
        at, only_just = crossing(way.at, curve, (offset, factor), facts, extent, span, tolerance, first)
        end, which, hangs = where(first, at, end), where(first, number, which), (hangs & not_(first)) | only_just
    return end, which, hangs


@symbolic
def ended(m, pieces, facts, passed, met, span, tolerance, state, mode):
    """The end of a leg in its last step, by which event, whether only just; what fires, and others too; the states.

    And whether which of two surfaces comes first, or whether they are met at once, is not sure.
    """
    numbers, extents = tuple(map(float, range(len(passed)))), tuple(extent for extent, _ in m.scene.made(state, mode))
    end, which, hangs = fold(
        first_root, (span, -1.0 - 0.0 * span, met & not_(met)), (met, span, tolerance),
        numbers, m.watched, pieces.of_events, pieces.events, facts, extents, passed,
    )  # fmt: skip
    own = tuple(met & (which > j - 0.5) & (which < j + 0.5) for j in numbers)
    near = fma(SAME, tolerance, ROUNDING)
    gaps = tuple(
        (magnitude(fma(factor, way.at(end, curve)[0], offset)), magnitude(offset) + magnitude(factor * u[0]))
        for way, curve, (offset, factor, u) in zip(m.watched, pieces.of_events, pieces.events, strict=True)
    )
    beside = tuple(met & before & (gap <= near * size) for before, (gap, size) in zip(passed, gaps, strict=True))
    fires = tuple(x | y for x, y in zip(beside, own, strict=True))
    others = any_of(tuple(x & not_(y) for x, y in zip(beside, own, strict=True)))
    at_root = tuple(way.at(end, curve)[0] for way, curve in zip(m.ways, pieces.of_states, strict=True))
    fired, ends = tuple(where(x, 1.0, 0.0) for x in fires), m.on_kink(choose(met, at_root, state), fires)
    unsure = met & not_(met)
    if m.scene.surfaces is not None:
        marks = tuple(where(x & (s > 0.5), 1.0, 0.0) for x, s in zip(fires, (1.0, *m.scene.surfaces), strict=True))
        parts = zip(marks, own, gaps, strict=True)
        unsure = any_of(tuple((x > 0.5) & not_(y) & (gap > ROUNDING * size) for x, y, (gap, size) in parts))
        unsure = unsure & (total(marks) > 1.5)
    return end, which, hangs, fired, others, ends, unsure


@symbolic
def length(m, pieces, state, unit, tolerance, h, power_h, moving, limits, longest, furthest):
    """The step that the series allow, from the one before; h^(p-1) of it.

    And whether what it leaves out is within the tolerance.
    """
    (left_out, over), *others = ((last_term(h, u), size(h, u)) for u in pieces.controlled)
    for last, whole in others:  # which is the worse one in its size; a state that stays 0 never is
        smaller = (last * over <= left_out * whole) & not_(left_out <= 0.0)
        left_out, over = where(smaller, left_out, last), where(smaller, over, whole)
    ratio = where(left_out <= 0.0, 0.0, left_out * power_h / (tolerance * over))
    h = where(moving, next_step(h, ratio, m.order), h)
    h = where((ratio > 0.0) | (h < furthest), h, furthest)
    for limit in limits:
        h = where(h < limit, h, limit)
    h = m.scene.on_clock(state, unit, where(h > longest, longest, h))
    power_h = natural_power(h, m.order - 1)
    return h, power_h, all_of(tuple(keeps(h, power_h, u, SLACK * tolerance) for u in pieces.controlled))


@symbolic
def in_none(xs):
    """A condition for each of a tuple, that no lane meets."""
    return tuple(x < x for x in xs)


@symbolic
def lasts_in_range(pieces):
    """Whether the last terms of all states are numbers."""
    return finite(tuple(u[-1] for u in pieces.states))


@symbolic
def begun(m, pieces, facts, state, mode, on, tolerance, active):
    """Of a leg's first step: the events behind already, the margins of all; broken, steep and stuck lanes.

    Steep is what changes so much faster than the leg is long that the last terms of a series are no numbers any more,
    or what never meets an event, for all its rates are 0; where the first ones are none, rates, their slopes or
    products are not defined.
    """
    sound, first, third = (finite(tuple(u[k] for u in pieces.states)) for k in (0, 1, 3))
    last = lasts_in_range(pieces)
    now = tuple((o < 0.5) & (fact[0] <= 0.0) for o, fact in zip(on, facts, strict=True))
    pressed = tuple((o > 0.5) & not_(rises(fact[1], fact[2])) for o, fact in zip(on, facts, strict=True))
    moves = (total(tuple(magnitude(u[1]) for u in pieces.states)) > 0.0) | any_of((*now, *pressed))
    steep = active & sound & first & third & not_(last & moves)
    broken = active & not_(sound & last | steep)
    margins = tuple(SLACK * tolerance * extent for extent, _ in m.scene.made(state, mode))
    return now, margins, broken, steep, active & any_of(pressed) & sound & not_(steep)


@symbolic
def passing(m, pieces, x, steps, fallings, passed):
    """Which events have fallen through 0 by the end of a step of these lanes; and the states there."""
    parts = zip(passed, fallings, m.watched, pieces.of_events, pieces.events, strict=True)
    passed = tuple(
        before | (steps & falling & (fma(factor, way.at(x, curve)[0], offset) <= 0.0))
        for before, falling, way, curve, (offset, factor, u) in parts
    )
    return passed, tuple(way.at(x, curve)[0] for way, curve in zip(m.ways, pieces.of_states, strict=True))


@jit
def to_event(m, cell, mode, active):
    """Follow the motion of the active lanes until an event falls through 0, and stop there.

    Parameters
    ----------
    m : Series
    cell : `Cell` at the start of the leg; its h is the first guess of a step

    Returns
    -------
    leg : Leg
    errors : `Errors` at the event, or ()
    """
    state, unit, h, on, tolerance, errors = cell.state, cell.unit, cell.h, cell.on, cell.tolerance, cell.own
    moving, t, span, tried = active, 0.0 * h, h, 0.0 * h
    nothing, never, margins = active & not_(active), in_none(on), times(0.0, on)
    stuck, steep, broken, grazing, now, passed = nothing, nothing, nothing, nothing, never, never
    refused, longest, furthest = 0.0 * h, 0.0 * h + FAR, 0.0 * h + FAR
    power_h, reach = natural_power(h, m.order - 1), reached(times(0.0, state), state)
    error, near, waited, paused = carried.begun(m, state, errors, h), margins, 0, nothing
    for step in range(STEP_LIMIT):
        # a step that the series allow
        cores, limits, coarse, full = m.cores(state, mode, unit, tolerance, on, t, near, longest)
        pieces = m.pieces(state, mode, unit, cores)
        error = carried.since(m, error, full, state, mode, unit, pieces)
        facts = facts_of(pieces.events)
        h, power_h, fine = length(m, pieces, state, unit, tolerance, h, power_h, moving, limits, longest, furthest)
        trial = h
        if step == 0:
            now, margins, broken, steep, stuck = begun(m, pieces, facts, state, mode, on, tolerance, active)
            trial, moving = where(any_of(now), 0.0, h), moving & not_(broken | steep | stuck)
        tried = where(moving, tried + 1.0, tried)
        # so long that each event is proved to fall all along or to stay clear
        near = carried.wider(m, margins, state, mode, error, errors, reached(reach, cell.size))
        seen = shows_all(m, pieces, state, mode, unit, trial, tolerance)
        steps = moving & seen
        sure, fallings = judged(m, m.at_kink, pieces, facts, near, now, trial, steps, never)
        unsure = steps & not_(sure)
        if any_lane(unsure):
            trial, unsure, fallings = doubted(m, pieces, state, unit, facts, near, now, trial, unsure, fallings)
            if step < AGAIN:
                unsure = unsure & (fine | not_(power_h < FAR))
        furthest = where(trial > 0.0, BEYOND * trial, furthest)
        broken = broken | (unsure & not_(power_h < FAR))  # it goes off to where no event is
        steep = steep | (unsure & not_(lasts_in_range(pieces)))
        grazing = grazing | (unsure & not_(broken | steep))
        moving, steps = moving & not_(unsure), steps & fine & not_(unsure)
        # of which the series are those of rates and events
        untold = unlike(m, pieces, cores, mode, unit, trial, t, tolerance, steps & (refused < REFUSALS))
        if any_lane(untold):
            refused = where(untold, refused + 1.0, refused)
            steps, seen = steps & not_(untold), seen & not_(untold)
        # to its end, or until an event that it passes
        passed, ends = passing(m, pieces, trial, steps, fallings, passed)
        meets = steps & any_of(passed)
        span, steps = where(meets, trial, span), steps & not_(meets)
        changes = carried.changes(m, error, state, mode, unit, pieces, cores)
        error = carried.still(m, error, h)
        if any_lane(steps):
            error = carried.stepped(m, error, changes, state, mode, unit, trial, steps, pieces, cores, coarse)
        state = choose(steps, ends, state)
        reach = reached(reach, state)
        t = where(steps, t + trial, t)
        now, moving = never, moving & not_(meets)
        longest = where(moving, where(seen, longest / COME_UP, COME_UP * trial), longest)  # what has met keeps its core
        if not any_lane(moving):
            break
        if step > PATIENCE and is_rare(moving, active):
            waited += 1
            if 2 * waited > step:
                paused, moving = moving, nothing
                break
    lost = moving | steep
    met = active & not_(lost | stuck | broken | grazing | paused)
    end, which, hangs, fired, others, ends, unsure = ended(m, pieces, facts, passed, met, span, tolerance, state, mode)
    t = where(met, t + end, t)
    h = where(met & (t > 0.0) & (h > LONGEST * t), LONGEST * t, h)
    late = carried.at_event(
        m, error, errors, changes, full, state, mode, unit, ends, end, t, which, others, pieces, cores, coarse
    )
    reach = choose(met, reached(reach, ends), reach)
    return Leg(ends, t, h, fired, stuck, lost, broken, grazing, hangs, unsure, paused, tried, reach), late
