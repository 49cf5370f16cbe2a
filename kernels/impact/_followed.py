"""Where the impact clock ends up, whatever it does on the way: contact by contact, then Newton on what repeats.

From the symmetric cycle of one impact, a little disturbed (or from what its formula gives where there is none), half
swings are followed in blocks. When the motion all but repeats after k of them, Newton finds where it does (k = 1: a
symmetric cycle; even k: k/2 swings to and fro; other k: k of them). It is taken if it is stable, else left behind.
A cycle lasts until the next tooth, or, should more than one pass in it, one swing to and fro.
"""

import math

import numpy as np

from kernels.impact import _half_swing as swing
from kernels.impact._contacts import PlainScene
from kernels.impact._half_swing import Start, half_swing
from kernels.impact._periodic import Work, chain, difference, distance, errors, invert, multiplier, newton
from kernels.impact._units import Cycle
from kernels.lanes.codes import (
    GRAZING,
    INACCURATE,
    NO_METHOD,
    NOT_CONVERGED,
    NOT_PERIODIC,
    OK,
    PERIOD_2,
    STEP_LIMIT,
    TOOTH_JUMPED,
    UNSTABLE,
)
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import magnitude, nearest, sqrt
from kernels.maths.elementary import power

HALF_SWINGS = 2048
"""Half swings after which a motion that does not repeat is called so; means are over the second half of them."""
EVENT_LIMIT = 1_000_000
"""Events of the second half, or of the first."""
KAPPA_LIMIT = 1e12
"""Largest ratio of the two masses, either way: beyond it the lighter one's impacts are lost in rounding."""
BLOCK = 16
"""Half swings between two looks at whether the motion repeats, and the most after which it is seen to."""
DISTURBANCE = 1e-6

_CLOSE = 1e-3
"""Relative distance of two half swings' beginnings at which Newton is tried."""
_NEAR = 1.0
"""How far from there a cycle may be found: a motion that settles slowly is close to repeating long before."""
_SAME = 1e-9
"""The distance of two beginnings that are one."""
_KICK, _KICKS = 0.01, 8
"""How far an unstable cycle is left behind, and how often that is tried."""
_ROUNDING = 2.3e-16
_CHAINED = 5.0
"""Errors of the changes after many contacts over those of one: 3.5 at most in 1055 clocks."""


@jit
def beginning(scene, disturbance):
    """Start of a half swing on the symmetric cycle of one impact, by its formula, with its speeds so much changed.

    w = kappa T/2 and V = T (kappa (1 - e) - 2 e)/(2 (1 + e)) after the impact at y = -Y; it is followed back to the
    release at y = -eta. Where it is not one, y = -eta is where it begins all the same.
    """
    wheel, pallet, eta, e, c, y_i = scene
    kappa = wheel / pallet
    if not (e > 0.0):
        c_0 = 0.5 * sqrt(kappa + 4.0 * eta)
        return Start(swing.reduced(2.0 * eta - 0.5), c_0 * (1.0 + 0.5 * disturbance), -c_0 * (1.0 + disturbance))
    half = sqrt((1.0 + e) / (1.0 - e) * pallet)
    w = 0.5 * kappa * half
    V = half * (kappa * (1.0 - e) - 2.0 * e) / (2.0 * (1.0 + e)) + half
    away = max(-eta - y_i, 0.0)
    t = away / w
    V, w = (V - t) * (1.0 + 0.5 * disturbance), w * (1.0 + disturbance)
    gap = -(V + 0.5 * t) * t - away * (1.0 + 0.5 * c * away)
    return Start(swing.reduced(gap), V, -w)


@jit_call
def follow(scene, start, n, history, tally, slopes):
    """The start after n half swings, and what became of them; `history` gets n + 1 starts."""
    history[0, 0], history[0, 1], history[0, 2] = start
    for i in range(n):
        start, verdict = half_swing(scene, start, tally, slopes, False)
        if verdict != swing.DONE:
            return start, verdict
        history[i + 1, 0], history[i + 1, 1], history[i + 1, 2] = start
    return start, swing.DONE


@jit
def _past(history, i):
    return Start(history[i, 0], history[i, 1], history[i, 2])


@jit
def _cycle(tally, half_way, middle, halves, pace, e):
    """The cycle as in `_units`, from the tally of half swings that are so many half periods; the swing's half way and
    middle may be means."""
    beats = tally[swing.BEATS]
    rim, pallet = (tally[swing.RIM] / beats, tally[swing.PALLET] / beats) if beats > 0.0 else (math.nan, math.nan)
    endless = e > 0.0 and tally[swing.TRAINS] > 0.0
    impacts = math.inf if endless else tally[swing.IMPACTS] / halves
    half_period, held = tally[swing.TIME] / halves, tally[swing.HELD] / tally[swing.TIME]
    return Cycle(half_period, half_way, rim, pallet, pace, tally[swing.RECOIL], held, impacts, middle)


@jit
def _none():
    """No cycle."""
    nan = math.nan
    return Cycle(nan, nan, nan, nan, nan, nan, nan, nan, nan)


@jit_call
def _judged(scene, start, k, work, rtol):
    """The cycle of a motion that repeats after k half swings, and its status; UNSTABLE where it leaves that."""
    tally = work.tally
    swing.clear(tally)
    image, _ = chain(scene, start, k, work)
    deep = tally[swing.DEPTH]
    if deep > 0.0:  # the rim is still behind its foremost where the motion begins anew
        swing.clear(tally)
        tally[swing.DEPTH] = deep
        image, _ = chain(scene, start, k, work)
    invert(work.chained, work.inverse)
    modulus, blur = multiplier(work.chained)
    per_half_swing = modulus if k == 1 else power(modulus, 1.0 / k)

    # half swings of the whole motion, teeth that pass in it, the cycles that this is; the ends of y, and their middle
    teeth = nearest(2.0 * tally[swing.WAY])
    low, high = -tally[swing.LOWEST], -tally[swing.ACROSS]
    if k % 2 == 0:
        half_swings, teeth, cycles = 1.0 * k, 0.5 * teeth, min(0.5 * teeth, 0.5 * k)
        half_way, middle = 0.5 * (low + high), 0.5 * magnitude(low - high)
    else:
        half_swings, cycles = 2.0 * k, min(teeth, 1.0 * k)
        half_way, middle = max(low, high), 0.0
    cycle = _cycle(tally, half_way, middle, 2.0 * cycles * k / half_swings, per_half_swing, scene.e)

    # the largest relative error of an output, by those of the start; thrown back is V^2/2, V perhaps that of both
    share, back = cycle.held, cycle.back
    rounding = _ROUNDING * (2.0 + tally[swing.EVENTS] / k) * (1.0 + cycle.travel)
    gap, V, w, late = errors(start, difference(image, start), work, rounding, tally[swing.TIME])
    worst = max(max(late, gap / cycle.travel), max(V / magnitude(cycle.rim), w / magnitude(cycle.pallet)))
    worst = max(worst, late + late / share if share > 0.0 else 0.0)
    worst = max(worst, 6.0 * (V + w) / sqrt(2.0 * back) if back > 0.0 else 0.0)
    noise = _CHAINED * blur * (rounding * k + gap)
    worst = max(worst, noise / (k * modulus) if modulus > 0.0 else 0.0)

    fading = (1.0 - modulus) / max(noise, _ROUNDING)  # in units of its error
    if fading < -1.0:
        return cycle, UNSTABLE
    if not (worst <= rtol):
        return cycle, INACCURATE
    if fading < 1.0 or tally[swing.MARGIN] <= 4.0 * gap + rounding:
        return cycle, GRAZING
    if not (modulus > 0.0):  # it is small, but how small, rounding hides
        return cycle, INACCURATE
    if teeth > cycles:
        return cycle, TOOTH_JUMPED
    return cycle, OK if teeth == 1.0 else PERIOD_2


@jit_call
def events(scene, rtol, total, work, history):
    """The cycle of a scene of `_units`, contact by contact, and the status.

    No two clocks have the same contacts to be followed in lanes.
    """
    if not (1.0 / KAPPA_LIMIT <= scene.kappa[0] <= KAPPA_LIMIT):
        return _none(), NO_METHOD
    wheel, pallet, loss = scene.wheel[0], scene.pallet[0], (1.0 - scene.e) / (1.0 + scene.e)
    c, y_i = scene.nu * loss / pallet, -0.25 * wheel / loss  # (5); c is 0 where nu is
    clock = PlainScene(wheel, pallet, min(scene.eta[0], 0.25), scene.e, c, y_i)
    start, kicks = beginning(clock, DISTURBANCE), 0
    swing.clear(total)
    k = 0
    blocks = HALF_SWINGS // BLOCK
    for block in range(blocks):
        if 2 * block == blocks:
            swing.clear(total)
        start, verdict = follow(clock, start, BLOCK, history, total, work.slopes)
        if verdict != swing.DONE or total[swing.EVENTS] > EVENT_LIMIT:
            return _none(), NO_METHOD if verdict == swing.BENT_CONTACT else STEP_LIMIT
        k = 0
        for back in range(BLOCK, 0, -1):  # the least number of half swings after which it all but repeats
            if distance(_past(history, BLOCK - back), start) < _CLOSE:
                k = back
        if k == 0:
            continue
        again, found = newton(clock, start, k, work)
        if not (found and distance(start, again) < _NEAR):
            continue
        follow(clock, again, k, history, work.tally, work.slopes)
        whole = k
        for shorter in range(whole - 1, 0, -1):
            if whole % shorter == 0 and distance(_past(history, shorter), again) < _SAME:
                k = shorter
        cycle, status = _judged(clock, again, k, work, rtol)
        if status != UNSTABLE:
            return cycle, status
        if 2 * block < blocks and kicks < _KICKS:  # go on further from the unstable cycle, the way the motion leaves it
            kicks += 1
            away, way = distance(start, again), difference(start, again)
            more = _KICK / max(away, 1e-12) if away < _KICK else 1.0
            w = again.w + more * way.w
            if w < 0.0:
                start = Start(swing.reduced(again.gap + more * way.gap), again.V + more * way.V, w)
    half_swings = HALF_SWINGS // 2
    cycles = max(min(total[swing.WAY], 0.5 * half_swings), 1.0)
    status = NOT_CONVERGED if k > 0 else NOT_PERIODIC
    half_way, middle = total[swing.DIPS] / half_swings, magnitude(total[swing.LEAN]) / half_swings
    return _cycle(total, half_way, middle, 2.0 * cycles, math.nan, scene.e), status


@jit
def workspace():
    """Arrays that `events` uses for one clock after the other."""
    work = Work(np.empty(swing.TALLIES), np.empty((5, 3)), np.empty((4, 3)), np.empty((3, 3)))
    return np.empty(swing.TALLIES), work, np.empty((BLOCK + 1, 3))
