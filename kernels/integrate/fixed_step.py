"""A scene followed at a fixed step, from switch to switch; generic in one cell or lanes.

Where an event is located, the step ends on it, and the next whole one begins there. An event that is passed twice
within a step does not show at its ends: where it falls at the start and rises at the end, the step is cut where the
cubic between is lowest. What starts on an event and is back on it at the end had two roots within the step, which is
halved; what cannot leave it sticks.
"""

import math

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
from kernels.integrate.steps import ONE, rate
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.tuples import after, boxes, joined, marks, reached, times, turned
from kernels.lanes.vectors import choose, isnt, magnitude, some, where

STEP_LIMIT = 20_000
"""Steps between two switches after which a cell is given up."""
CUTS = 60
"""Times that a step may be cut one after the other."""
TOGETHER = 32
"""Steps that lanes take before those that have finished are given new cells."""
HIDDEN = 1e-13
"""Of a state's size, what the rates may hide in a step (`hidden_source`) unremarked."""
LOW = 0.25
"""Of the smaller end: an event that the cubic takes below this share of it is looked at where it is lowest."""

_REFUSAL, _GRAZING = float(FIRST_REFUSAL), float(Status.GRAZING)
_STICKS, _STEP_LIMIT, _OUT_OF_RANGE = float(Status.STICKS), float(Status.STEP_LIMIT), float(Status.OUT_OF_RANGE)
_NOT_CONVERGED, _INACCURATE = float(Status.NOT_CONVERGED), float(Status.INACCURATE)


@jit
def first_event(start, end, end_rate, on, natural):
    """The event passed first in a step, by the line between the ends; -1 where none is.

    Without location only the switch counts, and not while it still rises from below.
    """
    which, earliest = 0.0 * start[0] - 1.0, 0.0 * start[0] + math.inf
    for j in range(1 if natural else len(start)):
        part = where(start[j] > 0.0, start[j] / (start[j] - end[j]), 0.0)
        passed = (end[j] <= 0.0) & (part < earliest)
        if natural:
            passed = passed & isnt((on[j] > 0.5) & (end_rate[j] > 0.0))
        which, earliest = where(passed, float(j), which), where(passed, part, earliest)
    return which, earliest


@jit
def dip(start, end, start_rate, end_rate, h):
    """Where in the step an event that ends above 0 may have been below it; 0 where none was."""
    at = 0.0 * h
    for j in range(len(start)):
        turns = (start[j] > 0.0) & (end[j] > 0.0) & (start_rate[j] < 0.0) & (end_rate[j] > 0.0)
        s, low = lowest(start[j], end[j], h * start_rate[j], h * end_rate[j])
        smaller = where(start[j] < end[j], start[j], end[j])
        deep = turns & (low < LOW * smaller) & (s > 1e-3) & (s < 0.999)
        at = where(deep & isnt((at > 0.0) & (at < s)), s, at)
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
        other = other | ((values[j] < 0.0) & isnt(own | (on[j] > 0.5)))
    return other


@jit
def finite(state):
    """Whether every entry is a number."""
    total = magnitude(state[0])
    for j in range(1, len(state)):
        total = total + magnitude(state[j])
    return total < math.inf


@jit_call
def located(m, how, state, new, scene, h, which, ends, seeking):
    """The part of the step at which the event fires, the state there, calls of the rates, and whether it is lost."""
    method, location, parts = how
    e0, e1, d0, d1 = ends
    part = where(e0 > 0.0, e0 / (e0 - e1), 0.0)
    calls, lost = 0.0 * h, seeking & isnt(seeking)
    curved = seeking & (e0 > 0.0)
    if location in (HERMITE, ROOT):
        part = where(curved, cubic_root(e0, e1, h * d0, h * d1, curved), part)
    if location == HENON:
        part, new, there = swapped(m, method, parts, new, scene, h, which, e1)
        lost = curved & isnt(there)
        calls = calls + where(method > 3.5, 12.0, 4.0) * parts
        part, new = where(curved, part, 0.0), choose(curved, new, state)
    elif location == ROOT:
        part, new, trials, lost = shortened(m, method, parts, state, scene, h, which, part, (e0, e1), curved)
        part, new = where(curved, part, 0.0), choose(curved, new, state)
        calls = trials * (CALLS[method] * parts)
    else:
        new = choose(curved, leap(m, method, parts, state, scene, part * h), state)
        calls = calls + CALLS[method] * parts
    return part, new, where(curved, calls, 0.0), lost


@jit
def margin_behind(which, start, slopes, part, h, wide):
    """How far behind the switch the motion would turn round, over the surface's largest value so far; infinite if not.

    From the rates at the ends of the step: what bends the surface's value back is their difference.
    """
    first, last = slopes
    rate = (last[0] - first[0]) * part + first[0]
    back = (which > -0.5) & (which < 0.5) & (last[0] > first[0]) & (start[0] > 0.0)
    bend = where(back, (last[0] - first[0]) / h, 1.0)
    return where(back, rate * rate / (2.0 * bend * where(wide > 0.0, wide, 1.0)), math.inf)


@jit_call
def hides_something(m, state, new, scene, h):
    """Whether a step may hide more of a state than its stages tell; NaN does."""
    side, signs, parameters, _ = scene
    change = times(h, after(rate(m, new, scene), -1.0, ONE, (rate(m, state, scene),)))
    of_rates, _ = m.hidden(state, boxes(state, new, change), side, signs, parameters)
    seen = h <= math.inf
    for i in range(len(state)):
        seen = seen & (h * of_rates[i] <= HIDDEN * (magnitude(state[i]) + magnitude(new[i])))
    return isnt(seen)


@jit_call
def attempt(m, how, parameters, step, graze, wide, motion, active):
    """Try one step.

    Parameters
    ----------
    how : method, location, parts of a step
    wide : largest value of the surface since the last switch
    motion : state, side, signs, on (1 for the event that the motion starts on), cut (the step's length; 0: whole), cuts
    active : lanes that move

    Returns
    -------
    motion, which : after the step; the event that it ends on, -1 for none, -2 where it must be tried again
    taken, calls, verdict : length of the step, calls of the rates, what went wrong (0: nothing)
    wide, behind : with this step's start; see `margin_behind`
    """
    method, location, parts = how
    state, side, signs, on, cut, cuts = motion
    natural = location == NONE
    scene = side, signs, parameters, natural
    h = where(cut > 0.0, cut, step)
    start, start_rate = m.events(state, side, signs, parameters)
    new = leap(m, method, parts, state, scene, h)
    end, end_rate = m.events(new, side, signs, parameters)
    calls = 0.0 * h + CALLS[method] * parts
    which, _ = first_event(start, end, end_rate, on, natural)
    wide = where(active & (start[0] > wide), start[0], wide)
    part = where(start[0] > end[0], start[0] / (start[0] - end[0]), 0.0)
    behind = margin_behind(which, start, (start_rate, end_rate), part, h, wide)
    broken = active & isnt(finite(new) & finite(end))
    met = active & (which > -0.5) & isnt(broken)
    verdict, taken, again = where(broken, _OUT_OF_RANGE, 0.0), h, active & isnt(active)
    if method == MOREAU:
        rests = (magnitude(state[-1]) <= 0.0) & (magnitude(new[-1]) <= 0.0) & isnt(met)
        verdict = where(active & rests, _STICKS, verdict)
    if not natural:
        pressed = met & (of_event(on, which) > 0.5)
        away = of_event(start_rate, which) > 0.0
        verdict = where(pressed & isnt(away), _STICKS, verdict)
        low = where(active & isnt(met | broken | (cuts > 0.5)), dip(start, end, start_rate, end_rate, h), 0.0)
        again = (pressed & away) | (low > 0.0)
        shorter = where(low > 0.0, low * h, 0.5 * h)
        turning = (
            active & (cuts > 0.5) & isnt(met) & near_an_event(end, on, times(graze, reached(times(0.0, on), start)))
        )
        verdict = where(turning & (verdict < _GRAZING), _GRAZING, verdict)
        seeking = met & isnt(pressed)
        if some(seeking):
            ends = of_event(start, which), of_event(end, which), of_event(start_rate, which), of_event(end_rate, which)
            part, found, more, lost = located(m, how, state, new, scene, h, which, ends, seeking)
            new, calls = choose(seeking, found, new), where(seeking, calls + more, calls)
            verdict = where(seeking & lost, _NOT_CONVERGED, verdict)
            taken = where(seeking, part * h, taken)
            other = seeking & (part < 0.999999) & (part > 0.0) & isnt(lost)
            other = other & passed_another(m.events(found, side, signs, parameters)[0], which, on)
            again, shorter = again | other, where(other, part * h, shorter)
        verdict = where(again & (cuts > CUTS), _STEP_LIMIT, verdict)
        cut, cuts = where(again, shorter, 0.0), where(again, cuts + 1.0, 0.0)
        which = where(again, -2.0, which)
    moved = active & isnt(again) & (verdict < _REFUSAL)
    if m.hides:
        hidden = moved & hides_something(m, state, new, scene, taken)
        verdict = where(hidden & (verdict < _INACCURATE), _INACCURATE, verdict)
    below = moved & natural & (which < -0.5) & (end[0] <= 0.0)  # not yet above where it began
    on = choose(moved & isnt(below), marks(which, on), on)
    signs = choose(moved, turned(signs, on), signs)
    motion = choose(moved, new, state), side, signs, on, cut, cuts
    return motion, which, where(moved, taken, 0.0), calls, verdict, wide, behind


@jit_call
def switch(m, parameters, motion, left, switches):
    """The motion behind the switch, of the lanes that are on it; `left` is the surface's value there."""
    state, side, signs, on, cut, cuts = motion
    jumped = m.switched(state, side, signs, parameters)
    state, side = choose(switches, jumped, state), where(switches, -side, side)
    new_signs, kinks_on = m.settled(state, side, parameters, 0.0 * side + 1.0, times(0.0, signs))
    signs = choose(switches, new_signs, signs)
    behind = m.events(state, side, signs, parameters)[0][0]
    still = magnitude(behind) <= 2.0 * magnitude(left)
    on = choose(switches, joined(where(still, 1.0, 0.0), kinks_on), on)
    return state, side, signs, on, cut, cuts


@jit_call
def follow(m, how, parameters, limits, motion, tally, active):
    """A few steps of the active lanes.

    Parameters
    ----------
    limits : flips, step, margin of grazing over an event's value at the start of the step
    tally : time, since, interval, count, steps, calls, trials since the last switch,
        reach (largest of each state since the last switch), states at the last switch, their reach before it,
        largest value of the surface since the last switch, least margin behind a switch, verdict

    Returns
    -------
    motion, tally, done
    """
    flips, step, graze = limits
    done = active & isnt(active)
    for _ in range(TOGETHER):
        time, since, interval, count, steps, calls, trials, reach, at, reach_at, wide, slim, verdict = tally
        side = motion[1]
        motion, which, taken, more, found, wide, behind = attempt(m, how, parameters, step, graze, wide, motion, active)
        verdict = where(active & (found > verdict), found, verdict)
        trials, calls = where(active, trials + 1.0, trials), where(active, calls + more, calls)
        steps = where(active & (which > -1.5), steps + 1.0, steps)
        time, since = where(active, time + taken, time), where(active, since + taken, since)
        reach = choose(active, reached(reach, motion[0]), reach)
        switches = active & (which > -0.5) & (which < 0.5) & (verdict < _REFUSAL)
        if some(switches):
            at, reach_at = choose(switches, motion[0], at), choose(switches, reach, reach_at)
            left = m.events(motion[0], side, motion[2], parameters)[0][0]
            faint = m.underflows(motion[0], side, motion[2], parameters, step)
            verdict = where(switches & faint, _OUT_OF_RANGE, verdict)
            motion = switch(m, parameters, motion, left, switches)
            reach = choose(switches, reached(times(0.0, reach), motion[0]), reach)
            interval, since = where(switches, since, interval), where(switches, 0.0, since)
            count = where(switches, count + 1.0, count)
            trials = where(switches, 0.0, trials)
            slim = where(switches & (behind < slim), behind, slim)
            wide = where(switches, 0.0, wide)
        verdict = where(active & (trials > STEP_LIMIT) & (verdict < _REFUSAL), _STEP_LIMIT, verdict)
        ended = active & ((verdict >= _REFUSAL) | (count >= flips))
        tally = time, since, interval, count, steps, calls, trials, reach, at, reach_at, wide, slim, verdict
        done, active = done | ended, active & isnt(ended)
        if some(done):
            break
    return motion, tally, done
