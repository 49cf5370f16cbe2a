"""The leg of a motion by Taylor series, from event to event; generic in the scene, in one cell or lanes.

Each step takes the length that the series allow, is halved where no event is proved to fall all along or to stay
clear (`taylor`), and ends the leg where one has fallen through 0. A leg may begin where symmetry makes the last terms
of a series 0, though it goes on. So its first step, and one that last terms tell nothing of, is taken only where the
rates at the series' states are the series' derivatives, and events their own series (`agree`); but for rates and
events that are linear in the states, of which the last terms tell all.
`m` is what is written of the scene for one order (`Series`).
"""

import math
from typing import NamedTuple

from kernels.integrate import carried
from kernels.integrate.powers import FAR, outside
from kernels.integrate.records import Leg
from kernels.integrate.taylor import (
    COME_UP,
    HALVINGS,
    LONGEST,
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
    stays_apart,
    vanishes,
    worse,
)
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import fold, over_tuples, symbolic
from kernels.lanes.tuples import all_of, any_of, joined, reached, total
from kernels.lanes.vectors import any_lane, choose, fma, horner, magnitude, not_, where
from kernels.maths.intervals import most

WITHIN, REFUSALS = 0.6, 20.0
"""Part of a first step at which rates and events are asked, besides its end, whether the series are theirs; and how
often in a leg a step may be refused for that: what is so much shorter than the first guess is not, or rounding would
stop it."""
BEYOND = 1e6
"""Times the step before, that one is at most where the series leave nothing out: of a motion that is a polynomial it
would grow so far that halving it no more comes back to what an event next to 0 asks for."""


class Series(NamedTuple):
    """What is written of a scene for the series of one order.

    scene : `Written`
    order : of the series
    pieces : (state, mode, unit, cores) -> `Pieces`
    cores : (state, mode, unit, tolerance, on, t, margins) -> of powers: `powers.core`, a tuple of each part
    on_kink : (state, fires) -> the state, 0 where a kink of a power fires
    ways, watched : how each state, and what each event watches, is evaluated (`taylor.Way`)
    summed, unseen : 1 for each state that is the sum of another one, for each event of more than one state
    bent, bent_events : 1 for each state whose rate, for each event that, is not linear in the states
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
    bent: tuple
    bent_events: tuple
    error: object


@symbolic
def facts_of(offset, factor, u):
    """Coefficients 0 to 3 of an event."""
    return fma(factor, u[0], offset), factor * u[1], factor * u[2], factor * u[3]


@symbolic
def judged(m, pieces, facts, margins, now, trial):
    """Which events are proved to stay clear on a step, and which to fall all along."""
    rests = tuple(
        magnitude(event[1]) * way.tail(trial, curve)
        for way, event, curve in zip(m.watched, pieces.events, pieces.of_events, strict=True)
    )
    clears = tuple(
        clear(e, d, dd, ddd, rest, trial, margin)
        for (e, d, dd, ddd), rest, margin in zip(facts, rests, margins, strict=True)
    )
    fallings = tuple(
        falls(d, dd, ddd, rest, trial) | begun for (e, d, dd, ddd), rest, begun in zip(facts, rests, now, strict=True)
    )
    return clears, fallings


@jit_call
@over_tuples
def doubted(m, pieces, state, unit, facts, margins, now, trial, unsure, fallings):
    """Steps of the unsure lanes halved until each event is proved to fall or to stay clear; which fall."""
    stays_apart(trial)
    for _ in range(HALVINGS):
        clears, down = judged(m, pieces, facts, margins, now, trial)
        proved = all_of(tuple(x | y for x, y in zip(clears, down, strict=True)))
        fallings = tuple((unsure & x) | (y & not_(unsure)) for x, y in zip(down, fallings, strict=True))
        unsure = unsure & not_(proved)
        if not any_lane(unsure):
            break
        trial = where(unsure, m.scene.on_clock(state, unit, 0.5 * trial), trial)
    return trial, unsure, fallings


@symbolic
def by_kink(facts, now, clears, fallings, at_kink):
    """The surface's proof where its rate is a kink's u: `at_kink` takes the kink's entry from a tuple."""
    _, d, dd, _ = facts[0]
    clear_kink, falls_kink = at_kink(clears), at_kink(fallings)
    lead = where(at_kink(facts)[0] > 0.0, d, 0.0)
    clear_0 = rises(lead, dd) & (clear_kink | falls_kink)
    falls_0 = (rises(-lead, -dd) & clear_kink) | now[0]
    return joined((clear_0,), clears[1:]), joined((falls_0,), fallings[1:])


@symbolic
def shows_all(m, pieces, state, mode, unit, trial, tolerance):
    """Whether a step hides no more than the tolerance.

    Of an event that can hide something the series is asked for its last term too, for the states' do not tell of it.
    """
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
def tells_nothing(m, pieces, h):
    """Whether the last terms of a series tell nothing of it."""
    every = joined(pieces.states, tuple(u for _, _, u in pieces.events))
    bent = joined(m.bent, m.bent_events)
    return any_of(tuple((is_bent > 0.5) & vanishes(h, u) for is_bent, u in zip(bent, every, strict=True)))


@jit_call
@over_tuples
def agree(m, pieces, mode, unit, x, tolerance, apart):
    """Whether, a time x on, rates and events at the series' states are those of the series, to the tolerance; events
    besides to their rounding."""
    state = tuple(way.value(x, curve) for way, curve in zip(m.ways, pieces.of_states, strict=True))
    allowed = (m.order + 1.0) * (tolerance + ROUNDING)
    same = all_of(
        tuple(
            (bent < 0.5) | (x * magnitude(unit * rate - slope(x, u)) <= allowed * size(x, u))
            for bent, rate, u in zip(m.bent, m.scene.rates(state, mode), pieces.states, strict=True)
        )
    )
    if apart is not None:
        kinks = tuple(sign * u for sign, u in zip(mode.signs[:-1], m.scene.kinks(state, mode), strict=True))
        values = joined((mode.signs[-1] * m.scene.surface(state, mode),), kinks)
        same = same & all_of(
            tuple(
                (bent < 0.5)
                | (
                    magnitude(value - fma(factor, horner(x, u), offset))
                    <= fma(ROUNDING, extent, SLACK * tolerance * (magnitude(offset) + magnitude(factor) * size(x, u)))
                )
                for bent, value, (extent, _), (offset, factor, u) in zip(
                    m.bent_events, values, m.scene.made(state, mode), pieces.events, strict=True
                )
            )
        )
    return same


@jit
def first_root(found, number, way, curve, event, facts, passed, met, span, tolerance):
    """`found` is where the leg ends, by which event, whether only just; with this event, where it fires before."""
    end, which, hangs = found
    offset, factor, u = event
    first = met & passed
    if any_lane(first):
        first = first & ((which < 0.0) | (fma(factor, way.value(end, curve), offset) <= 0.0))
        at, only_just = crossing(way.rates, curve, (offset, factor, u[0]), facts, span, tolerance, first)
        end, which, hangs = where(first, at, end), where(first, number, which), (hangs & not_(first)) | only_just
    return end, which, hangs


@symbolic
def ended(m, pieces, facts, passed, met, span, tolerance, state):
    """The end of a leg in its last step, by which event, whether only just; what fires, and others too; the states."""
    numbers = tuple(map(float, range(len(passed))))
    end, which, hangs = fold(
        first_root, (span, -1.0 - 0.0 * span, met & not_(met)), (met, span, tolerance),
        numbers, m.watched, pieces.of_events, pieces.events, facts, passed,
    )  # fmt: skip
    own = tuple(met & (which > j - 0.5) & (which < j + 0.5) for j in numbers)
    near = fma(SAME, tolerance, ROUNDING)
    beside = tuple(
        met
        & before
        & (
            magnitude(fma(factor, way.value(end, curve), offset))
            <= near * (magnitude(offset) + magnitude(factor * u[0]))
        )
        for before, way, curve, (offset, factor, u) in zip(
            passed, m.watched, pieces.of_events, pieces.events, strict=True
        )
    )
    fires = tuple(x | y for x, y in zip(beside, own, strict=True))
    others = any_of(tuple(x & not_(y) for x, y in zip(beside, own, strict=True)))
    at_root = tuple(way.value(end, curve) for way, curve in zip(m.ways, pieces.of_states, strict=True))
    return end, which, hangs, fires, others, m.on_kink(choose(met, at_root, state), fires)


@symbolic
def shorter(h, limit):
    """The step, no longer than a limit; NaN of that stays."""
    return where(h < limit, h, limit)


@jit
@over_tuples
def to_event(m, cell, mode, active, hides, asks, apart, at_kink):
    """Follow the motion of the active lanes until an event falls through 0, and stop there.

    Parameters
    ----------
    cell : `Cell` at the start of the leg; its h is the first guess of a step
    hides : None where neither rates nor events can hide anything
    asks : None where all rates and events are linear in the states: the last terms of all their series tell the rest
    apart : None where all events are
    at_kink : None, or the entry of a tuple of the kink whose u is the rate of the surface

    Returns
    -------
    leg : Leg
    errors : `Errors` at the event, or ()
    """
    state, unit, h, on, tolerance, errors = cell.state, cell.unit, cell.h, cell.on, cell.tolerance, cell.own
    moving, t, span, tried = active, 0.0 * h, h, 0.0 * h
    nothing = active & not_(active)
    passed = tuple(nothing for _ in on)
    now, margins = passed, tuple(0.0 * h for _ in on)
    stuck, lost, broken, grazing = nothing, nothing, nothing, nothing
    power_h, allowed = natural_power(h, m.order - 1), SLACK * tolerance
    refused, longest, furthest = 0.0 * h, 0.0 * h + FAR, 0.0 * h + FAR
    reach = tuple(magnitude(u) for u in state)
    error = carried.begun(m, state, errors, h)
    for step in range(STEP_LIMIT):
        cores, limits, coarse, full = m.cores(state, mode, unit, tolerance, on, t, margins)
        pieces = m.pieces(state, mode, unit, cores)
        error = carried.since(m, error, full, state, mode, unit, pieces)
        facts = tuple(facts_of(offset, factor, u) for offset, factor, u in pieces.events)
        left = tuple((last_term(h, u), size(h, u)) for u in pieces.controlled)
        left_out, over = fold(worse, left[0], (), left[1:])
        ratio = where(left_out <= 0.0, 0.0, left_out * power_h / (tolerance * over))
        h = where(moving, next_step(h, ratio, m.order), h)
        h = where((ratio > 0.0) | (h < furthest), h, furthest)
        h = fold(shorter, h, (), limits)
        h = where(h > longest, longest, h)
        h = m.scene.on_clock(state, unit, h)
        power_h = natural_power(h, m.order - 1)
        fine = all_of(tuple(keeps(h, power_h, u, allowed) for u in pieces.controlled))
        trial = h
        if step == 0:
            undefined = not_(total(tuple(magnitude(u) for u in state)) < math.inf)
            broken = active & (undefined | not_(total(tuple(magnitude(u[-1]) for u in pieces.states)) < math.inf))
            now = tuple((o < 0.5) & (fact[0] <= 0.0) for o, fact in zip(on, facts, strict=True))
            pressed = tuple((o > 0.5) & not_(rises(fact[1], fact[2])) for o, fact in zip(on, facts, strict=True))
            stuck = active & any_of(pressed) & not_(undefined)
            trial = where(any_of(now), 0.0, h)
            margins = tuple(
                SLACK * tolerance * (magnitude(offset) + magnitude(factor * u[0]))
                for offset, factor, u in pieces.events
            )
            margins = carried.wider(m, margins, state, mode, errors)
            moving = moving & not_(broken | stuck)
        tried = where(moving, tried + 1.0, tried)
        seen = trial >= 0.0
        if hides is not None:
            seen = shows_all(m, pieces, state, mode, unit, trial, tolerance)
        steps = moving & seen
        clears, fallings = judged(m, pieces, facts, margins, now, trial)
        if at_kink is not None:
            clears, fallings = by_kink(facts, now, clears, fallings, at_kink)
        unsure = steps & not_(all_of(tuple(x | y for x, y in zip(clears, fallings, strict=True))))
        if any_lane(unsure):
            trial, unsure, fallings = doubted(m, pieces, state, unit, facts, margins, now, trial, unsure, fallings)
        furthest = where(trial > 0.0, BEYOND * trial, furthest)
        broken = broken | (unsure & not_(power_h < FAR))  # it goes off to where no event is
        grazing = grazing | (unsure & not_(broken))
        moving = moving & not_(unsure)
        steps = steps & fine & not_(unsure)
        ends = tuple(way.value(trial, curve) for way, curve in zip(m.ways, pieces.of_states, strict=True))
        if asks is not None:
            untold = not_(t > 0.0) | tells_nothing(m, pieces, trial)
            untold = outside(cores, steps & (refused < REFUSALS) & untold)
            if any_lane(untold):
                same = agree(m, pieces, mode, unit, trial, tolerance, apart)
                if any_lane(untold & not_(t > 0.0)):
                    same = same & agree(m, pieces, mode, unit, WITHIN * trial, tolerance, apart)
                untold = untold & not_(same)
                steps, seen = steps & not_(untold), seen & not_(untold)
                refused = where(untold, refused + 1.0, refused)
        longest = where(seen, longest / COME_UP, COME_UP * trial)
        passed = tuple(
            before | (steps & falling & (fma(factor, way.value(trial, curve), offset) <= 0.0))
            for before, falling, way, curve, (offset, factor, u) in zip(
                passed, fallings, m.watched, pieces.of_events, pieces.events, strict=True
            )
        )
        meets = steps & any_of(passed)
        span = where(meets, trial, span)
        steps = steps & not_(meets)
        changes = carried.changes(m, error, state, mode, unit, pieces, cores)
        error = carried.still(m, error, h)
        if any_lane(steps):
            error = carried.stepped(m, error, changes, state, mode, unit, trial, steps, pieces, cores, coarse)
        state = choose(steps, ends, state)
        reach = reached(reach, state)
        t = where(steps, t + trial, t)
        now = tuple(x & meets for x in now)
        moving = moving & not_(meets)
        if not any_lane(moving):
            break
    lost = moving
    met = active & not_(lost | stuck | broken | grazing)
    end, which, hangs, fires, others, ends = ended(m, pieces, facts, passed, met, span, tolerance, state)
    t = where(met, t + end, t)
    h = where(met & (t > 0.0) & (h > LONGEST * t), LONGEST * t, h)
    late = carried.at_event(
        m, error, changes, full, state, mode, unit, ends, end, t, which, others, pieces, cores, coarse
    )
    reach = choose(met, reached(reach, ends), reach)
    fired = tuple(where(x, 1.0, 0.0) for x in fires)
    return Leg(ends, t, h, fired, stuck, lost, broken, grazing, hangs, nothing, tried, reach), late
