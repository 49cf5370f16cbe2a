"""A scene followed at a fixed step, from switch to switch; generic in one cell or lanes.

Where an event is located, the step ends on it, and the next whole one begins there. An event that is passed twice
within a step does not show at its ends: where it falls at the start and rises at the end, the step is cut where the
cubic between is lowest. What starts on an event and is back on it at the end had two roots within the step, which is
halved; what cannot leave it sticks.
"""

import math
from typing import NamedTuple

from kernels.integrate import events as E
from kernels.integrate.driver import BLUR, at_switch, behind_switch, staged, started
from kernels.integrate.events import cubic_root, leap, lowest, of_event, shortened
from kernels.integrate.records import Mode, Step
from kernels.integrate.steps import ONE, events, rate
from kernels.lanes import codes
from kernels.lanes.codes import GRAZING, INACCURATE, NOT_CONVERGED, OUT_OF_RANGE, REFUSED, STICKS
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import symbolic
from kernels.lanes.tuples import after, any_of, boxes, marks, reached, read, times, total, write
from kernels.lanes.vectors import any_lane, choose, magnitude, not_, where

STEP_LIMIT = 20_000
"""Steps between two switches after which a cell is given up."""
CUTS = 60
"""Times that a step may be cut one after the other."""
TOGETHER = 32
"""Steps that lanes take before those that have finished are given new cells."""
HIDDEN = 1e-13
"""Of a state's size, what the rates may hide in a step (`expression.hidden`) unremarked."""
LOW = 0.25
"""Of the smaller end: an event that the cubic takes below this share of it is looked at where it is lowest."""
TOLERANCE = 1e-14 / BLUR
"""As of a motion to a tolerance, so that rounding may take 1e-14 of the surface's value at the start unremarked."""


class Scheme(NamedTuple):
    """A method at a fixed step, how it locates events (both numbers of `events`), and the substeps of a step."""

    method: int
    location: int
    substeps: int


class Fixed(NamedTuple):
    """What a lane knows of steps of a fixed length, beside what it does of any motion.

    reach_at, reach : largest size of each state between the last two switches, and since the last one
    slim : least margin behind a switch
    cut, cuts : length of the step that is tried next (0: a whole one), and how often that has been cut
    trials, wide : since the last switch: trials, largest of the surface's value
    graze : margin of grazing over an event's value at the start of a step
    method, location, substeps : the `Scheme`
    """

    reach_at: tuple
    slim: float
    steps: float
    calls: float
    reach: tuple
    cut: float
    cuts: float
    trials: float
    wide: float
    graze: float
    method: float
    location: float
    substeps: float


def nothing_yet(state):
    """As zeros, for so many states."""
    return Fixed(state, 0.0, 0.0, 0.0, state, *[0.0] * 8)


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
def finite(state):
    """Whether every entry is a number."""
    return total(tuple(magnitude(u) for u in state)) < math.inf


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
def uncertain(step, cell, missed):
    """Of a step that is not ended by an event: whether it turns close to one; where it may have been below one."""
    was_cut, margins = cell.own.cuts > 0.5, times(cell.own.graze, reached(times(0.0, cell.on), step.start))
    parts = zip(step.end, margins, cell.on, strict=True)
    close = any_of(tuple((magnitude(value) < margin) & (on < 0.5) for value, margin, on in parts))
    return missed & was_cut & close, where(missed & not_(was_cut), dip(step), 0.0)


@symbolic
def moved_on(cell, step, new, taken, calls, verdict, which, again, shorter, below, active):
    """The cell with one more step of the active lanes; that which must be taken again is shorter."""
    own, moved = cell.own, active & not_(again) & (verdict < REFUSED)
    on = choose(moved & not_(below), marks(which, cell.on), cell.on)
    turned = tuple(where(o > 0.5, -sign, sign) for sign, o in zip(cell.signs[:-1], on[1:], strict=True))
    signs = (*turned, where(on[0] > 0.5, 1.0, cell.signs[-1]))
    state, taken = choose(moved, new, cell.state), where(moved, taken, 0.0)
    own = own._replace(
        cut=where(again, shorter, 0.0),
        cuts=where(again, own.cuts + 1.0, 0.0),
        steps=where(active & not_(again), own.steps + 1.0, own.steps),
        calls=where(active, own.calls + calls, own.calls),
        trials=where(active, own.trials + 1.0, own.trials),
        reach=choose(active, reached(own.reach, state), own.reach),
        wide=where(active & (step.start[0] > own.wide), step.start[0], own.wide),
    )
    return cell._replace(
        state=state, on=on, own=own, signs=choose(moved, signs, cell.signs),
        time=where(active, cell.time + taken, cell.time), since=where(active, cell.since + taken, cell.since),
        verdict=where(active & (verdict > cell.verdict), verdict, cell.verdict),
    )  # fmt: skip


@jit_call
def attempt(m, scheme, cell, active):
    """One step of the active lanes.

    Returns
    -------
    cell : Cell
        After the step.
    which : the event that it ends on, -1 for none, -2 where it must be tried again
    behind : `margin_behind`
    """
    natural, on, own = scheme.location == E.NONE, cell.on, cell.own
    mode = Mode(cell.side, cell.signs, cell.parameters, natural)
    h = where(own.cut > 0.0, own.cut, cell.h)
    start, start_rates = events(m, cell.state, mode)
    new = leap(m, scheme, cell.state, mode, h)
    end, end_rates = events(m, new, mode)
    step = Step(cell.state, new, h, start, start_rates, end, end_rates)
    which = first_event(step, on, 1.0 if natural else 0.0)
    behind = margin_behind(which, step, where(active & (start[0] > own.wide), start[0], own.wide))
    broken = active & not_(finite(new) & finite(end))
    met = active & (which > -0.5) & not_(broken)
    verdict, taken, shorter, again = where(broken, OUT_OF_RANGE, 0.0), h, h, active & not_(active)
    calls = 0.0 * h + E.CALLS[scheme.method] * scheme.substeps
    if scheme.method == E.MOREAU:
        rests = (magnitude(cell.state[-1]) <= 0.0) & (magnitude(new[-1]) <= 0.0) & not_(met)
        verdict = where(active & rests, STICKS, verdict)
    if not natural:  # ended on the event that it met, or to be cut, for it may hide a root of an event
        pressed = met & (of_event(on, which) > 0.5)
        away = of_event(start_rates, which) > 0.0
        verdict = where(pressed & not_(away), STICKS, verdict)
        turning, low = uncertain(step, cell, active & not_(met | broken))
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
    verdict = where(again & (own.cuts > CUTS), codes.STEP_LIMIT, verdict)
    moved = active & not_(again) & (verdict < REFUSED)
    if any_of(m_hides(m)):
        seen = shows_all(m, cell.state, new, mode, taken)
        verdict = where(moved & not_(seen) & (verdict < INACCURATE), INACCURATE, verdict)
    below = moved & natural & (which < -0.5) & (end[0] <= 0.0)  # not yet above where it began
    cell = moved_on(cell, step, new, taken, calls, verdict, which, again, shorter, below, active)
    return cell, where(again, -2.0, which), behind


@symbolic
def m_hides(m):
    """Which rates of the scene can hide something."""
    return tuple(hides > 0.5 for hides in m.hiding[0])


@symbolic
def fresh_start(m, cell):
    """The cell at its start."""
    cell = started(m, cell, None)
    return cell._replace(
        unit=cell.h, own=cell.own._replace(slim=math.inf, reach=tuple(magnitude(u) for u in cell.state))
    )


@symbolic
def switched(m, cell, behind, switches):
    """The cell behind the switch that it is on."""
    own = cell.own
    own = own._replace(reach_at=own.reach, slim=where(behind < own.slim, behind, own.slim), trials=0.0, wide=0.0)
    cell, _ = behind_switch(m, at_switch(m, cell, (), switches, switches, None), (), switches, switches, (), None)
    return cell._replace(own=own._replace(reach=tuple(magnitude(u) for u in cell.state)))


@symbolic
def refused(cell, lanes, verdict):
    """The cell with that verdict in the lanes."""
    return cell._replace(verdict=where(lanes, verdict, cell.verdict))


@jit
def advance(m, memory, i):
    """Every lane on by some steps; whether one has finished."""
    cell = read(memory, i, m.cell)
    stage = cell.stage
    fresh = (stage > 0.5) & (stage < 1.5)
    active = fresh | ((stage > 1.5) & (stage < 2.5))
    if any_lane(fresh):
        cell = choose(fresh, fresh_start(m, cell), cell)
    scheme = Scheme(int(memory[-3][0]), int(memory[-2][0]), int(memory[-1][0]))
    moving = active & (cell.verdict < REFUSED)
    done = active & (cell.verdict >= REFUSED)
    for _ in range(TOGETHER):
        rises = cell.signs[-1] < 0.0
        cell, which, behind = attempt(m, scheme, cell, moving)
        switches = moving & (which > -0.5) & (which < 0.5) & not_(rises) & (cell.verdict < REFUSED)
        if any_lane(switches):
            cell = choose(switches, switched(m, cell, behind, switches), cell)
        late = moving & (cell.own.trials > STEP_LIMIT) & (cell.verdict < REFUSED)
        cell = refused(cell, late, codes.STEP_LIMIT)
        ended = moving & ((cell.verdict >= REFUSED) | (cell.count >= cell.flips))
        done, moving = done | ended, moving & not_(ended)
        if any_lane(ended):
            break
    write(memory, i, staged(cell, where(done, 3.0, where(active, 2.0, stage))))
    return any_lane(done)
