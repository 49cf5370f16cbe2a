"""A scene followed at a fixed step, from switch to switch; generic in one cell or lanes.

Where an event is located, the step ends on it, and the next whole one begins there. An event that is passed twice
within a step does not show at its ends: where it falls at the start and rises at the end, the step is cut where the
cubic between is lowest. What starts on an event and is back on it at the end had two roots within the step, which is
halved; what cannot leave it sticks.
"""

import math
from typing import NamedTuple

from kernels.integrate import events as E
from kernels.integrate.driver import BACK, begun, settled
from kernels.integrate.events import cubic_root, leap, lowest, of_event, shortened
from kernels.integrate.records import Mode, Step
from kernels.integrate.steps import ONE, events, rate
from kernels.lanes import codes
from kernels.lanes.codes import BAD_INPUT, GRAZING, INACCURATE, NOT_CONVERGED, OUT_OF_RANGE, REFUSED, STICKS
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import fold, symbolic
from kernels.lanes.tuples import after, any_of, boxes, marks, reached, read, times, write
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
BLUR = 1e-14
"""Of the surface's value at the start, what rounding may take from it unremarked."""


class Scheme(NamedTuple):
    """A method at a fixed step, how it locates events (both numbers of `events`), and the substeps of a step."""

    method: int
    location: int
    substeps: int


class Cell(NamedTuple):
    """All that a lane knows of its cell; the first entry is the lane's stage, inputs and results follow.

    flips, step, graze : switches to follow; the step; margin of grazing over an event's value at the start of a step
    time, interval, at, reach_at : of the last switch; states there, and their reach before it
    slim : least margin behind a switch
    on : 1 for the event that the motion starts on
    cut, cuts : length of the step that is tried next (0: a whole one), and how often that has been cut
    since, trials, reach, wide : since the last switch: time, trials, largest of each state, of the surface's value
    """

    stage: float
    parameters: tuple
    flips: float
    step: float
    graze: float
    method: float
    location: float
    substeps: float
    time: float
    interval: float
    at: tuple
    reach_at: tuple
    slim: float
    steps: float
    calls: float
    verdict: float
    state: tuple
    side: float
    signs: tuple
    on: tuple
    cut: float
    cuts: float
    since: float
    count: float
    trials: float
    wide: float
    reach: tuple


def cell_of(cell):
    """A cell of zeros, as large as one of `records.Cell`."""
    u = cell.state
    motion = u, 0.0, cell.signs, cell.on
    return Cell(0.0, cell.parameters, *[0.0] * 8, u, u, *[0.0] * 4, *motion, *[0.0] * 6, u)


@symbolic
def first_event(step, on, natural):
    """The event passed first in a step, by the line between the ends; -1 where none is.

    With `natural`, 1, only the switch counts, and not while it still rises from below.
    """
    which, earliest = 0.0 * step.start[0] - 1.0, 0.0 * step.start[0] + math.inf
    for j, (start, end) in enumerate(zip(step.start, step.end, strict=True)):
        part = where(start > 0.0, start / (start - end), 0.0)
        passed = (end <= 0.0) & (part < earliest)
        rising = (on[j] > 0.5) & (step.end_rates[j] > 0.0)
        passed = passed & ((natural < 0.5) | (not_(rising) if j == 0 else natural < 0.5))
        which, earliest = where(passed, float(j), which), where(passed, part, earliest)
    return which


@symbolic
def dip(step):
    """Where in the step an event that ends above 0 may have been below it; 0 where none was."""
    at = 0.0 * step.h
    for start, end, first, last in zip(step.start, step.end, step.start_rates, step.end_rates, strict=True):
        turns = (start > 0.0) & (end > 0.0) & (first < 0.0) & (last > 0.0)
        s, low = lowest(start, end, step.h * first, step.h * last)
        deep = turns & (low < LOW * where(start < end, start, end)) & (s > 1e-3) & (s < 0.999)
        at = where(deep & not_((at > 0.0) & (at < s)), s, at)
    return at


@symbolic
def passed_another(values, which, on):
    """Whether another event than this one is behind."""
    other = which < -math.inf
    for j, value in enumerate(values):
        own = (which > j - 0.5) & (which < j + 0.5)
        other = other | ((value < 0.0) & not_(own | (on[j] > 0.5)))
    return other


@symbolic
def plus_size(total, x):
    """The sum of magnitudes."""
    return total + magnitude(x)


@symbolic
def finite(state):
    """Whether every entry is a number."""
    return fold(plus_size, magnitude(state[0]), (), state[1:]) < math.inf


@jit_call
def located(m, scheme, mode, step, which, seeking):
    """The part of the step at which the event fires, the state there, calls of the rates, and whether it is lost."""
    e0, e1, h = of_event(step.start, which), of_event(step.end, which), step.h
    part, curved = where(e0 > 0.0, e0 / (e0 - e1), 0.0), seeking & (e0 > 0.0)
    if scheme.location in (E.HERMITE, E.ROOT):
        d0, d1 = of_event(step.start_rates, which), of_event(step.end_rates, which)
        part = where(curved, cubic_root(e0, e1, h * d0, h * d1, curved), part)
    if scheme.location == E.ROOT:
        part, new, trials, lost = shortened(m, scheme, mode, step, which, part, curved)
        part = where(curved, part, 0.0)
    else:
        new, trials, lost = leap(m, scheme, step.state, mode, part * h), 1.0 + 0.0 * h, seeking & not_(seeking)
    calls = trials * (E.CALLS[scheme.method] * scheme.substeps)
    return part, choose(curved, new, step.state), where(curved, calls, 0.0), lost


@symbolic
def margin_behind(which, step, wide):
    """How far behind the switch the motion would turn round, over the surface's largest value so far; infinite if not.

    From the rates at the ends of the step: what bends the surface's value back is their difference.
    """
    start, end, first, last = step.start[0], step.end[0], step.start_rates[0], step.end_rates[0]
    part = where(start > end, start / (start - end), 0.0)
    at_switch = (last - first) * part + first
    back = (which > -0.5) & (which < 0.5) & (last > first) & (start > 0.0)
    bend = where(back, (last - first) / step.h, 1.0)
    return where(back, at_switch * at_switch / (2.0 * bend * where(wide > 0.0, wide, 1.0)), math.inf)


@symbolic
def shows_all(m, state, new, mode, h):
    """Whether a step hides no more of a state than its stages tell; NaN does."""
    change = times(h, after(rate(m, new, mode), -1.0, ONE, (rate(m, state, mode),)))
    seen = h <= math.inf
    for hidden, u, w in zip(m.hidden(state, boxes(state, new, change), mode)[0], state, new, strict=True):
        seen = seen & (h * hidden <= HIDDEN * (magnitude(u) + magnitude(w)))
    return seen


@symbolic
def uncertain(step, motion, missed):
    """Of a step that is not ended by an event: whether it turns close to one; where it may have been below one."""
    was_cut, margins = motion.cuts > 0.5, times(motion.graze, reached(times(0.0, motion.on), step.start))
    parts = zip(step.end, margins, motion.on, strict=True)
    close = any_of(tuple((magnitude(value) < margin) & (on < 0.5) for value, margin, on in parts))
    return missed & was_cut & close, where(missed & not_(was_cut), dip(step), 0.0)


@symbolic
def moved_on(motion, step, new, taken, calls, verdict, which, again, shorter, below, active):
    """The motion with one more step of the active lanes; that which must be taken again is shorter."""
    moved = active & not_(again) & (verdict < REFUSED)
    on = choose(moved & not_(below), marks(which, motion.on), motion.on)
    turned = tuple(where(o > 0.5, -sign, sign) for sign, o in zip(motion.signs[:-1], on[1:], strict=True))
    signs = (*turned, where(on[0] > 0.5, 1.0, motion.signs[-1]))
    state, taken = choose(moved, new, motion.state), where(moved, taken, 0.0)
    return motion._replace(
        state=state,
        signs=choose(moved, signs, motion.signs),
        on=on,
        cut=where(again, shorter, 0.0),
        cuts=where(again, motion.cuts + 1.0, 0.0),
        time=where(active, motion.time + taken, motion.time),
        since=where(active, motion.since + taken, motion.since),
        steps=where(active & not_(again), motion.steps + 1.0, motion.steps),
        calls=where(active, motion.calls + calls, motion.calls),
        trials=where(active, motion.trials + 1.0, motion.trials),
        reach=choose(active, reached(motion.reach, state), motion.reach),
        wide=where(active & (step.start[0] > motion.wide), step.start[0], motion.wide),
        verdict=where(active & (verdict > motion.verdict), verdict, motion.verdict),
    )


@jit_call
def attempt(m, scheme, motion, active):
    """One step of the active lanes.

    Returns
    -------
    motion : Cell
        After the step.
    which : the event that it ends on, -1 for none, -2 where it must be tried again
    behind : `margin_behind`
    """
    natural, on = scheme.location == E.NONE, motion.on
    mode = Mode(motion.side, motion.signs, motion.parameters, natural)
    h = where(motion.cut > 0.0, motion.cut, motion.step)
    start, start_rates = events(m, motion.state, mode)
    new = leap(m, scheme, motion.state, mode, h)
    end, end_rates = events(m, new, mode)
    step = Step(motion.state, new, h, start, start_rates, end, end_rates)
    which = first_event(step, on, 1.0 if natural else 0.0)
    behind = margin_behind(which, step, where(active & (start[0] > motion.wide), start[0], motion.wide))
    broken = active & not_(finite(new) & finite(end))
    met = active & (which > -0.5) & not_(broken)
    verdict, taken, shorter, again = where(broken, OUT_OF_RANGE, 0.0), h, h, active & not_(active)
    calls = 0.0 * h + E.CALLS[scheme.method] * scheme.substeps
    if scheme.method == E.MOREAU:
        rests = (magnitude(motion.state[-1]) <= 0.0) & (magnitude(new[-1]) <= 0.0) & not_(met)
        verdict = where(active & rests, STICKS, verdict)
    if not natural:  # ended on the event that it met, or to be cut, for it may hide a root of an event
        pressed = met & (of_event(on, which) > 0.5)
        away = of_event(start_rates, which) > 0.0
        verdict = where(pressed & not_(away), STICKS, verdict)
        turning, low = uncertain(step, motion, active & not_(met | broken))
        again = (pressed & away) | (low > 0.0)
        shorter = where(low > 0.0, low * h, 0.5 * h)
        verdict = where(turning & (verdict < GRAZING), GRAZING, verdict)
        seeking = met & not_(pressed)
        if any_lane(seeking):
            part, found, more, lost = located(m, scheme, mode, step, which, seeking)
            other = seeking & (part < 0.999999) & (part > 0.0) & not_(lost)
            other = other & passed_another(events(m, found, mode)[0], which, on)
            new, taken = choose(seeking, found, new), where(seeking, part * h, taken)
            calls = where(seeking, calls + more, calls)
            verdict = where(seeking & lost, NOT_CONVERGED, verdict)
            again, shorter = again | other, where(other, part * h, shorter)
    verdict = where(again & (motion.cuts > CUTS), codes.STEP_LIMIT, verdict)
    moved = active & not_(again) & (verdict < REFUSED)
    if any_of(m_hides(m)):
        seen = shows_all(m, motion.state, new, mode, taken)
        verdict = where(moved & not_(seen) & (verdict < INACCURATE), INACCURATE, verdict)
    below = moved & natural & (which < -0.5) & (end[0] <= 0.0)  # not yet above where it began
    motion = moved_on(motion, step, new, taken, calls, verdict, which, again, shorter, below, active)
    return motion, where(again, -2.0, which), behind


@symbolic
def m_hides(m):
    """Which rates of the scene can hide something."""
    return tuple(hides > 0.5 for hides in m.hiding[0])


@symbolic
def switched(m, motion, behind, switches):
    """The motion behind the switch, of the lanes that are on it."""
    mode = Mode(motion.side, motion.signs, motion.parameters, False)
    before, falls = events(m, motion.state, mode)
    faint = m.underflows(motion.state, mode, motion.step)
    side = where(switches, -motion.side, motion.side)
    state = choose(switches, m.switched(motion.state, mode), motion.state)
    signs, kinks_on = settled(m, state, side, motion.parameters, 0.0 * side + 1.0, times(0.0, motion.signs[:-1]))
    values, rates = events(m, state, Mode(side, signs, motion.parameters, False))
    still = magnitude(values[0]) <= 2.0 * magnitude(before[0])
    through = m.passable[0] * rates[0] < -BACK * magnitude(falls[0])
    below = (still & through) | (not_(still) & (values[0] < 0.0))
    new = motion._replace(
        state=state, side=side, signs=(*signs[:-1], where(below, -1.0, signs[-1])),
        on=(where(still, 1.0, 0.0), *kinks_on), since=0.0, interval=motion.since, count=motion.count + 1.0, trials=0.0,
        reach=reached(times(0.0, motion.reach), state), at=motion.state, reach_at=motion.reach, wide=0.0,
        slim=where(behind < motion.slim, behind, motion.slim), verdict=where(faint, OUT_OF_RANGE, motion.verdict),
    )  # fmt: skip
    chosen = (
        choose(switches, x, y) if isinstance(x, tuple) else where(switches, x, y)
        for x, y in zip(new, motion, strict=True)
    )
    return type(motion)(*chosen)


@symbolic
def refused(motion, lanes, verdict):
    """The motion with that verdict in the lanes."""
    return motion._replace(verdict=where(lanes, verdict, motion.verdict))


@symbolic
def started(motion, start, fresh):
    """The motion of the fresh lanes at its start."""
    endless = not_((motion.flips >= 1.0) & (motion.flips < math.inf))
    unsure = where(start.blur <= BLUR, 0.0, INACCURATE)
    state = choose(fresh, start.state, motion.state)
    return motion._replace(
        state=state,
        side=where(fresh, start.side, motion.side),
        signs=choose(fresh, start.signs, motion.signs),
        on=choose(fresh, start.on, motion.on),
        slim=where(fresh, math.inf, motion.slim),
        reach=choose(fresh, tuple(magnitude(u) for u in state), motion.reach),
        verdict=where(fresh, where(start.beyond | endless, BAD_INPUT, unsure), motion.verdict),
    )


@symbolic
def put_down(motion, stage):
    """The motion with the lanes' stages."""
    return motion._replace(stage=stage)


@jit
def advance(m, memory, i):
    """Every lane on by some steps; whether one has finished."""
    motion = read(memory, i, m.cell)
    stage = motion.stage
    fresh = (stage > 0.5) & (stage < 1.5)
    active = fresh | ((stage > 1.5) & (stage < 2.5))
    if any_lane(fresh):
        motion = started(motion, begun(m, motion.flips, motion.parameters), fresh)
    row = 4 + len(motion.parameters)  # behind the stage and three limits
    scheme = Scheme(int(memory[row][0]), int(memory[row + 1][0]), int(memory[row + 2][0]))
    moving = active & (motion.verdict < REFUSED)
    done = active & (motion.verdict >= REFUSED)
    for _ in range(TOGETHER):
        rises = motion.signs[-1] < 0.0
        motion, which, behind = attempt(m, scheme, motion, moving)
        switches = moving & (which > -0.5) & (which < 0.5) & not_(rises) & (motion.verdict < REFUSED)
        if any_lane(switches):
            motion = switched(m, motion, behind, switches)
        late = moving & (motion.trials > STEP_LIMIT) & (motion.verdict < REFUSED)
        motion = refused(motion, late, codes.STEP_LIMIT)
        ended = moving & ((motion.verdict >= REFUSED) | (motion.count >= motion.flips))
        done, moving = done | ended, moving & not_(ended)
        if any_lane(ended):
            break
    write(memory, i, put_down(motion, where(done, 3.0, where(active, 2.0, stage))))
    return any_lane(done)
