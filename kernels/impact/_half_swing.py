"""One half swing of the impact clock, contact by contact: from one pallet's release of the wheel to the other's.

It begins where y falls through -eta, so that the upper pallet alone holds the wheel, and ends where y rises through
eta; the next one is the same in the reflected frame, y -> -y, x -> x - 1/2. In between no tooth can pass the pallet
that holds. The tooth that a pallet releases is at most at U(eta), and the other pallet holds it, or one before it, as
long as U(eta) - U(-eta) <= 1/2, which every flat lever keeps: so the wheel goes on by at most one tooth a swing to and
fro and never runs free. Where a bent lever does not keep it, both pallets can wedge the wheel: bounces without end.
The pallet across meets teeth while y > -eta. Bounces that are bound to end in lasting contact are summed as soon as
nothing can come between them. Contact lasts until the pallet's tip: it holds with the force wheel pallet > 0, and both
pallets are in contact only at y = 1/4, beyond the tips.
Under a bent lever bounces have no such sum; what comes to that is not followed.
"""

import math
from typing import NamedTuple

from kernels.impact._contacts import (
    OF_T,
    OF_V,
    OF_W,
    OF_X,
    Motion,
    carry_flight,
    carry_impact,
    carry_line,
    carry_slide,
    carry_train,
    centre,
    impact,
    meets_either,
    slide,
    train,
)
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import magnitude

CONTACT_LIMIT = 20_000
"""Events of one half swing."""
FAINT_BOUNCE = 1e-10
"""Speed of closing under a bent lever below which bounces are taken to end in lasting contact."""

DONE, TOO_MANY, BENT_CONTACT = 0, 1, 2
"""What became of a half swing."""
(
    TIME, WAY, DIP, DIPS, LEAN, LOWEST, ACROSS, IMPACTS, LOSS, RIM, PALLET, DEPTH, RECOIL, MARGIN, EVENTS, BEATS, HELD,
    TRAINS, STRUCK,
) = range(19)  # fmt: skip
"""Entries of a tally: time, way of the rim, lowest y of this half swing, sum of -y over their lowest, the same with
signs in turn, lowest y of all half swings on this pallet and lowest -y of those on the other, impacts (of a train only
the first), energy lost, speeds just after the holding pallet's first impact (sums over half swings), way that the rim
is behind its foremost and the most of that, least distance of a tooth from a tip that passes it, events, half swings
that have an impact, time in contact, trains of bounces that end in it, whether this half swing has had an impact."""
TALLIES = 19


class Start(NamedTuple):
    """Where a half swing begins: the gap in (-1, 0], speed of the rim, speed of the pallet."""

    gap: float
    V: float
    w: float


@jit
def clear(tally):
    """A tally of nothing."""
    for i in range(TALLIES):
        tally[i] = 0.0
    tally[MARGIN] = math.inf


@jit
def reduced(gap):
    """The same gap to the tooth before the pallet, in (-1, 0]; what rounding leaves beyond 0 is 0."""
    gap = gap - math.ceil(gap - 4e-16)
    return gap if gap < 0.0 else 0.0


@jit
def _lever(scene, y):
    """Slope of the holding pallet's lever at y; that of the pallet across is -lever(-y)."""
    return 1.0 + scene.c * (y - scene.y_i)


@jit
def _count_joint(tally, scene, away, W, side, t, after):
    """Way, time and recoil in contact, where the rim goes with `away` and the torque's share `wheel`."""
    wheel = scene.wheel
    if W < 0.0:
        turn = min(-W, wheel * t)
        tally[RECOIL] = max(tally[RECOIL], tally[DEPTH] - (W + 0.5 * turn) * turn / wheel)
        tally[DIP] = min(tally[DIP], side * (away + (W + 0.5 * turn) * turn / wheel))
    way = after - away
    tally[DEPTH] = max(tally[DEPTH] - way, 0.0)
    tally[WAY] += way
    tally[TIME] += t
    tally[EVENTS] += 1.0


@jit
def _count_margin(tally, gap):
    tally[MARGIN] = min(tally[MARGIN], min(magnitude(gap), magnitude(1.0 + gap)))


@jit
def _flight(scene, gap, far, motion, near, tally, slopes, follows):
    """Free flight until a tooth meets the holding pallet, or the one across while that is `near`, or y passes a tip.

    Returns
    -------
    t, contact, across, behind : its time, and whether it is a contact, with the pallet across, with the tooth behind
    gap, far, motion : at its end
    """
    y, V, w = motion
    bend = 1.0 - scene.c * w * w
    rate, rate_across = V - _lever(scene, y) * w, V + _lever(scene, -y) * w
    t, behind = meets_either(gap, rate, bend)
    across = False
    if near:
        other, other_behind = meets_either(far, rate_across, bend)
        if other < t:
            t, behind, across = other, other_behind, True
    line = math.inf  # the time to the next tip that y passes
    if w > 0.0 or (near and w < 0.0):
        line = max(((scene.eta if near and w > 0.0 else -scene.eta) - y) / w, 0.0)
    contact, t = t < line, min(t, line)
    if t < math.inf:
        way = (V + 0.5 * t) * t
        if V < 0.0:  # the rim is thrown back first
            back = 0.5 * V * V if t + V > 0.0 else -way
            tally[RECOIL] = max(tally[RECOIL], tally[DEPTH] + back)
        tally[DEPTH] = max(tally[DEPTH] - way, 0.0)
        tally[WAY] += way
        tally[TIME] += t
        tally[EVENTS] += 1.0
        if follows:
            carry_flight(slopes, t)
    gap, far = gap + (rate + 0.5 * bend * t) * t, far + (rate_across + 0.5 * bend * t) * t
    return t, contact, across, behind, gap, far, Motion(y + w * t, V + t, w)


@jit_call
def _held(scene, motion, side, tally, slopes, follows):
    """Bounces that end in contact, and that until a tip: whether they do, the motion then, whether all ends there."""
    t, after, widest, alone = train(scene, motion, side)
    if not alone:
        return False, motion, False
    if follows:
        carry_train(scene, slopes, motion, side, t)
    away, W = centre(scene, motion, side)
    _count_joint(tally, scene, away, W, side, t, side * after.y)
    tally[LOSS] += scene.pallet * widest
    tally[TRAINS] += 1.0

    t, goal, speed, ends = slide(scene, after, side)
    if follows:
        carry_slide(scene, slopes, after, side, speed)
    _count_joint(tally, scene, side * after.y, side * after.w, side, t, goal)
    tally[HELD] += t
    return True, Motion(side * goal, speed, side * speed), ends


@jit_call
def half_swing(scene, start, tally, slopes, follows):
    """The start of the next half swing, in its frame, and what became of this one.

    Adds to `tally`; where `follows`, `slopes` become the changes at the end by those at the start, without reflection.
    """
    eta = scene.eta
    tally[DIP], tally[STRUCK] = -eta, 0.0
    if follows:
        for j in range(3):
            for row in range(OF_T + 1):
                slopes[row, j] = 0.0
        slopes[OF_X, 0], slopes[OF_V, 1], slopes[OF_W, 2] = 1.0, 1.0, 1.0
    gap, far, motion, near = start.gap, 0.0, Motion(-eta, start.V, start.w), False
    for _ in range(CONTACT_LIMIT):
        t, contact, across, behind, gap, far, motion = _flight(scene, gap, far, motion, near, tally, slopes, follows)
        if not (t < math.inf):
            return start, TOO_MANY
        if not contact:
            if follows:
                carry_line(slopes, motion)
            if near and motion.w > 0.0:  # y has risen through eta
                _count_margin(tally, gap)
                return _reflected(tally, reduced(far), motion.V, motion.w), DONE
            # y passes -eta: the pallet across begins, or ceases, to be in the way of teeth
            far = reduced(gap + 2.0 * -eta * (1.0 - scene.c * scene.y_i) - 0.5)
            _count_margin(tally, far)
            motion, near = Motion(-eta, motion.V, motion.w), motion.w > 0.0
            continue

        lever = -_lever(scene, -motion.y) if across else _lever(scene, motion.y)
        if follows:
            carry_impact(scene, slopes, motion, lever)
        motion, closing, loss = impact(scene, motion, lever)
        tally[LOSS] += loss
        tally[IMPACTS] += 1.0
        tally[DIP] = min(tally[DIP], motion.y)
        touching = -1.0 if behind else 0.0
        gap, far = (gap, touching) if across else (touching, far)
        if behind:
            continue
        if not across and tally[STRUCK] == 0.0:
            tally[STRUCK] = 1.0
            tally[RIM] += motion.V
            tally[PALLET] += motion.w
            tally[BEATS] += 1.0
        if scene.c != 0.0:
            if magnitude(closing) * scene.e <= FAINT_BOUNCE:
                return start, BENT_CONTACT
            continue

        stays, motion, ends = _held(scene, motion, -1.0 if across else 1.0, tally, slopes, follows)
        if stays:
            other = reduced(2.0 * eta - 0.5)
            if ends:
                return _reflected(tally, 0.0 if across else other, motion.V, motion.w), DONE
            gap, far, near = other, 0.0, False
    return start, TOO_MANY


@jit
def _reflected(tally, far, V, w):
    """The start of the next half swing; this one is counted."""
    tally[DIPS] -= tally[DIP]
    tally[LEAN] = -(tally[LEAN] + tally[DIP])
    tally[LOWEST], tally[ACROSS] = tally[ACROSS], min(tally[LOWEST], tally[DIP])
    return Start(far, V, -w)
