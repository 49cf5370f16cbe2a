"""A scene followed at a fixed step, from switch to switch; generic in one cell or lanes.

Where an event is located, the step ends on it, and the next whole one begins there. An event that is passed twice
within a step does not show at its ends: where it falls at the start and rises at the end, the step is cut where the
cubic between is lowest. What starts on an event and is back on it at the end had two roots within the step, which is
halved; what cannot leave it sticks.
"""

import math
from typing import NamedTuple

from kernels.integrate.events import (
    CALLS,
    HENON,
    HERMITE,
    MOREAU,
    NONE,
    ROOT,
    cubic_root,
    leap,
    lowest,
    of_event,
    shortened,
    swapped,
)
from kernels.integrate.records import Mode, Motion, Step, Tally
from kernels.integrate.steps import ONE, events, rate
from kernels.lanes import codes
from kernels.lanes.codes import GRAZING, INACCURATE, NOT_CONVERGED, OUT_OF_RANGE, REFUSED, STICKS
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.tuples import after, boxes, but_last, joined, marks, reached, times, turned, with_last
from kernels.lanes.vectors import any_lane, choose, magnitude, not_, where

STEP_LIMIT = 20_000
"""Steps between two switches after which a cell is given up."""
CUTS = 60
"""Times that a step may be cut one after the other."""
TOGETHER = 32
"""Steps that lanes take before those that have finished are given new cells."""
HIDDEN = 1e-13
"""Of a state's size, what the rates may hide in a step (`source_text.hidden`) unremarked."""
LOW = 0.25
"""Of the smaller end: an event that the cubic takes below this share of it is looked at where it is lowest."""


@jit
def first_event(step, on, natural):
    """The event passed first in a step, by the line between the ends; -1 where none is.

    Without location only the switch counts, and not while it still rises from below.
    """
    start, end = step.start, step.end
    which, earliest = 0.0 * start[0] - 1.0, 0.0 * start[0] + math.inf
    for j in range(1 if natural else len(start)):
        part = where(start[j] > 0.0, start[j] / (start[j] - end[j]), 0.0)
        passed = (end[j] <= 0.0) & (part < earliest)
        if natural:
            passed = passed & not_((on[j] > 0.5) & (step.end_rates[j] > 0.0))
        which, earliest = where(passed, float(j), which), where(passed, part, earliest)
    return which


@jit
def dip(step):
    """Where in the step an event that ends above 0 may have been below it; 0 where none was."""
    start, end, h, at = step.start, step.end, step.h, 0.0 * step.h
    for j in range(len(start)):
        turns = (start[j] > 0.0) & (end[j] > 0.0) & (step.start_rates[j] < 0.0) & (step.end_rates[j] > 0.0)
        s, low = lowest(start[j], end[j], h * step.start_rates[j], h * step.end_rates[j])
        smaller = where(start[j] < end[j], start[j], end[j])
        deep = turns & (low < LOW * smaller) & (s > 1e-3) & (s < 0.999)
        at = where(deep & not_((at > 0.0) & (at < s)), s, at)
    return at


@jit
def near_an_event(values, on, margins):
    """Whether an event that the motion did not start on is within its margin of 0."""
    close = values[0] < -math.inf
    for j in range(len(values)):
        close = close | ((magnitude(values[j]) < margins[j]) & (on[j] < 0.5))
    return close


@jit
def passed_another(values, which, on):
    """Whether another event than this one is behind."""
    other = values[0] < -math.inf
    for j in range(len(values)):
        own = (which > j - 0.5) & (which < j + 0.5)
        other = other | ((values[j] < 0.0) & not_(own | (on[j] > 0.5)))
    return other


@jit
def finite(state):
    """Whether every entry is a number."""
    total = magnitude(state[0])
    for j in range(1, len(state)):
        total = total + magnitude(state[j])
    return total < math.inf


class Trial(NamedTuple):
    """A step that is being judged.

    new, taken, calls : the state that it ends in, its length, calls of the rates
    verdict : what went wrong; 0: nothing
    again, shorter : whether it must be tried again, with which length
    """

    new: tuple
    taken: float
    calls: float
    verdict: float
    again: bool
    shorter: float


class Moved(NamedTuple):
    """What a step has come to.

    which : the event that it ends on, -1 for none, -2 where it must be tried again
    taken, calls, verdict : as of `Trial`
    wide, behind : the surface's largest value, with this step's start; see `margin_behind`
    """

    which: float
    taken: float
    calls: float
    verdict: float
    wide: float
    behind: float


@jit_call
def located(m, scheme, mode, step, which, seeking):
    """The part of the step at which the event fires, the state there, calls of the rates, and whether it is lost."""
    e0, e1, h = of_event(step.start, which), of_event(step.end, which), step.h
    part = where(e0 > 0.0, e0 / (e0 - e1), 0.0)
    new, calls, lost = step.new, 0.0 * h, seeking & not_(seeking)
    curved = seeking & (e0 > 0.0)
    if scheme.location in (HERMITE, ROOT):
        d0, d1 = of_event(step.start_rates, which), of_event(step.end_rates, which)
        part = where(curved, cubic_root(e0, e1, h * d0, h * d1, curved), part)
    if scheme.location == HENON:
        part, new, there = swapped(m, scheme, mode, step, which, e1)
        lost = curved & not_(there)
        calls = calls + where(scheme.method > 3.5, 12.0, 4.0) * scheme.substeps
        part, new = where(curved, part, 0.0), choose(curved, new, step.state)
    elif scheme.location == ROOT:
        part, new, trials, lost = shortened(m, scheme, mode, step, which, part, curved)
        part, new = where(curved, part, 0.0), choose(curved, new, step.state)
        calls = trials * (CALLS[scheme.method] * scheme.substeps)
    else:
        new = choose(curved, leap(m, scheme, step.state, mode, part * h), step.state)
        calls = calls + CALLS[scheme.method] * scheme.substeps
    return part, new, where(curved, calls, 0.0), lost


@jit
def margin_behind(which, step, wide):
    """How far behind the switch the motion would turn round, over the surface's largest value so far; infinite if not.

    From the rates at the ends of the step: what bends the surface's value back is their difference.
    """
    start, end, first, last = step.start[0], step.end[0], step.start_rates[0], step.end_rates[0]
    part = where(start > end, start / (start - end), 0.0)
    rate = (last - first) * part + first
    back = (which > -0.5) & (which < 0.5) & (last > first) & (start > 0.0)
    bend = where(back, (last - first) / step.h, 1.0)
    return where(back, rate * rate / (2.0 * bend * where(wide > 0.0, wide, 1.0)), math.inf)


@jit_call
def hides_something(m, state, new, mode, h):
    """Whether a step may hide more of a state than its stages tell; NaN does."""
    change = times(h, after(rate(m, new, mode), -1.0, ONE, (rate(m, state, mode),)))
    of_rates, _ = m.hidden(state, boxes(state, new, change), mode.side, mode.signs, mode.parameters)
    seen = h <= math.inf
    for i in range(len(state)):
        seen = seen & (h * of_rates[i] <= HIDDEN * (magnitude(state[i]) + magnitude(new[i])))
    return not_(seen)


@jit
def uncut(m, scheme, mode, motion, h):
    """The step as it is first tried."""
    start, start_rates = events(m, motion.state, mode)
    new = leap(m, scheme, motion.state, mode, h)
    end, end_rates = events(m, new, mode)
    return Step(motion.state, new, h, start, start_rates, end, end_rates)


@jit
def onto_event(m, scheme, mode, step, which, on, seeking, trial):
    """The trial, ended on its event; to be tried again with that length where another event is behind by then."""
    part, found, calls, lost = located(m, scheme, mode, step, which, seeking)
    other = seeking & (part < 0.999999) & (part > 0.0) & not_(lost)
    other = other & passed_another(events(m, found, mode)[0], which, on)
    return Trial(
        choose(seeking, found, trial.new),
        where(seeking, part * step.h, trial.taken),
        where(seeking, trial.calls + calls, trial.calls),
        where(seeking & lost, NOT_CONVERGED, trial.verdict),
        trial.again | other,
        where(other, part * step.h, trial.shorter),
    )


@jit
def searched(m, scheme, mode, step, which, motion, graze, met, missed, trial):
    """The trial, ended on the event that it met; or what it must be cut to, for it may hide a root of an event."""
    on, was_cut = motion.on, motion.cuts > 0.5
    pressed = met & (of_event(on, which) > 0.5)
    away = of_event(step.start_rates, which) > 0.0
    verdict = where(pressed & not_(away), STICKS, trial.verdict)
    low = where(missed & not_(was_cut), dip(step), 0.0)
    again = (pressed & away) | (low > 0.0)
    shorter = where(low > 0.0, low * step.h, 0.5 * step.h)
    turning = missed & was_cut & near_an_event(step.end, on, times(graze, reached(times(0.0, on), step.start)))
    verdict = where(turning & (verdict < GRAZING), GRAZING, verdict)
    trial = Trial(trial.new, trial.taken, trial.calls, verdict, again, shorter)
    seeking = met & not_(pressed)
    if any_lane(seeking):
        trial = onto_event(m, scheme, mode, step, which, on, seeking, trial)
    return trial


@jit
def tried(m, scheme, mode, step, which, motion, graze, active):
    """The step, judged."""
    broken = active & not_(finite(step.new) & finite(step.end))
    met = active & (which > -0.5) & not_(broken)
    verdict = where(broken, OUT_OF_RANGE, 0.0)
    if scheme.method == MOREAU:
        rests = (magnitude(step.state[-1]) <= 0.0) & (magnitude(step.new[-1]) <= 0.0) & not_(met)
        verdict = where(active & rests, STICKS, verdict)
    calls = 0.0 * step.h + CALLS[scheme.method] * scheme.substeps
    trial = Trial(step.new, step.h, calls, verdict, active & not_(active), step.h)
    if not mode.natural:
        missed = active & not_(met | broken)
        trial = searched(m, scheme, mode, step, which, motion, graze, met, missed, trial)
    return trial


@jit
def arrived(motion, trial, which, moved, on):
    """The motion behind the step, of the lanes that have moved; the others' next trial is shorter."""
    signs = with_last(turned(but_last(motion.signs), on), where(on[0] > 0.5, 1.0, motion.signs[-1]))
    return Motion(
        choose(moved, trial.new, motion.state),
        motion.side,
        choose(moved, signs, motion.signs),
        on,
        where(trial.again, trial.shorter, 0.0),
        where(trial.again, motion.cuts + 1.0, 0.0),
    )


@jit_call
def attempt(m, scheme, parameters, limits, wide, motion, active):
    """Try one step.

    Parameters
    ----------
    wide : largest value of the surface since the last switch
    active : lanes that move

    Returns
    -------
    motion : Motion
        After the step.
    moved : Moved
    """
    mode = Mode(motion.side, motion.signs, parameters, scheme.location == NONE)
    step = uncut(m, scheme, mode, motion, where(motion.cut > 0.0, motion.cut, limits.step))
    which = first_event(step, motion.on, mode.natural)
    wide = where(active & (step.start[0] > wide), step.start[0], wide)
    behind = margin_behind(which, step, wide)
    trial = tried(m, scheme, mode, step, which, motion, limits.graze, active)
    verdict = where(trial.again & (motion.cuts > CUTS), codes.STEP_LIMIT, trial.verdict)
    which = where(trial.again, -2.0, which)
    moved = active & not_(trial.again) & (verdict < REFUSED)
    if m.hides:
        hidden = moved & hides_something(m, motion.state, trial.new, mode, trial.taken)
        verdict = where(hidden & (verdict < INACCURATE), INACCURATE, verdict)
    below = moved & mode.natural & (which < -0.5) & (step.end[0] <= 0.0)  # not yet above where it began
    on = choose(moved & not_(below), marks(which, motion.on), motion.on)
    motion = arrived(motion, trial, which, moved, on)
    return motion, Moved(which, where(moved, trial.taken, 0.0), trial.calls, verdict, wide, behind)


@jit_call
def switch(m, parameters, motion, left, switches):
    """The motion behind the switch, of the lanes that are on it; `left` is the surface's value there."""
    jumped = m.switched(motion.state, motion.side, motion.signs, parameters)
    state, side = choose(switches, jumped, motion.state), where(switches, -motion.side, motion.side)
    signs, kinks_on = m.settled(state, side, parameters, 0.0 * side + 1.0, times(0.0, motion.signs))
    behind = m.events(state, side, signs, parameters)[0][0]
    still = magnitude(behind) <= 2.0 * magnitude(left)
    signs = with_last(but_last(signs), where((behind < 0.0) & not_(still), -1.0, signs[-1]))
    signs = choose(switches, signs, motion.signs)
    on = choose(switches, joined(where(still, 1.0, 0.0), kinks_on), motion.on)
    return Motion(state, side, signs, on, motion.cut, motion.cuts)


@jit
def counted(tally, state, moved, active):
    """The tally with one more step of the active lanes."""
    return Tally(
        where(active, tally.time + moved.taken, tally.time),
        where(active, tally.since + moved.taken, tally.since),
        tally.interval,
        tally.count,
        where(active & (moved.which > -1.5), tally.steps + 1.0, tally.steps),
        where(active, tally.calls + moved.calls, tally.calls),
        where(active, tally.trials + 1.0, tally.trials),
        choose(active, reached(tally.reach, state), tally.reach),
        tally.at,
        tally.reach_at,
        moved.wide,
        tally.slim,
    )


@jit
def behind_switch(tally, at, state, behind, switches):
    """The tally of the lanes that have passed a switch: before it in the state `at`, behind it in `state`."""
    return Tally(
        tally.time,
        where(switches, 0.0, tally.since),
        where(switches, tally.since, tally.interval),
        where(switches, tally.count + 1.0, tally.count),
        tally.steps,
        tally.calls,
        where(switches, 0.0, tally.trials),
        choose(switches, reached(times(0.0, tally.reach), state), tally.reach),
        choose(switches, at, tally.at),
        choose(switches, tally.reach, tally.reach_at),
        where(switches, 0.0, tally.wide),
        where(switches & (behind < tally.slim), behind, tally.slim),
    )


@jit_call
def follow(m, scheme, parameters, limits, motion, tally, verdict, active):
    """A few steps of the active lanes: the records `motion` and `tally`, the verdict, and which are done."""
    done = active & not_(active)
    for _ in range(TOGETHER):
        rises = motion.signs[-1] < 0.0
        motion, moved = attempt(m, scheme, parameters, limits, tally.wide, motion, active)
        verdict = where(active & (moved.verdict > verdict), moved.verdict, verdict)
        tally = counted(tally, motion.state, moved, active)
        switches = active & (moved.which > -0.5) & (moved.which < 0.5) & not_(rises) & (verdict < REFUSED)
        if any_lane(switches):
            at = motion.state
            left = m.events(at, motion.side, motion.signs, parameters)[0][0]
            faint = m.underflows(at, motion.side, motion.signs, parameters, limits.step)
            verdict = where(switches & faint, OUT_OF_RANGE, verdict)
            motion = switch(m, parameters, motion, left, switches)
            tally = behind_switch(tally, at, motion.state, moved.behind, switches)
        verdict = where(active & (tally.trials > STEP_LIMIT) & (verdict < REFUSED), codes.STEP_LIMIT, verdict)
        ended = active & ((verdict >= REFUSED) | (tally.count >= limits.flips))
        done, active = done | ended, active & not_(ended)
        if any_lane(done):
            break
    return motion, tally, verdict, done
