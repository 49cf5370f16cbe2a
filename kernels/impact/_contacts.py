"""Contacts of the impact clock: when the next one comes, what it does, and how it carries small changes along.

All in the units of `_units`, in the frame of the pallet that holds the wheel (the upper one; for the lower one
y -> -y, x -> x - 1/2). With the lever's slope l (1 where it is flat, -1 at the pallet across) a gap x - l y - ... obeys
    gap'' = 1 - c w^2                                                                                  (1)
in flight, so every time of meeting is a root of a parabola. An impact with the speed of closing s = V - l w gives
    V -> V - (1 + e) s pallet/(pallet + wheel l^2),  w -> w + l (1 + e) s wheel/(pallet + wheel l^2)    (2)
(momentum V + w/(kappa l) is kept, the speed of closing becomes -e s) and takes (1 - e^2) s^2 pallet/2 from the energy
of bodies of mass 1 and 1/kappa, at l^2 = 1. Under a flat lever bounces with closing speeds s1, e s1, ... end after
    t = 2 s1/(1 - e)                                                                                   (3)
in lasting contact: in that time the common centre, of speed W = wheel V + pallet w, falls freely with `wheel`, the
share of the torque in both bodies, and the gap is never wider than s1^2/2. In contact both go on with that.
*Slopes* are an array whose rows, OF_X to OF_T, are the changes of x, y, V, w and the time, by gap, V and w at the
beginning of the half swing, which are its columns.
"""

import math
from typing import NamedTuple

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import magnitude, sqrt

OF_X, OF_Y, OF_V, OF_W, OF_T = range(5)
"""Rows of slopes."""


class PlainScene(NamedTuple):
    """The clock in float64, where `_units.Scene` has pairs.

    Shares of mass, height of escape, restitution, and the lever's bend c about y_i.
    """

    wheel: float
    pallet: float
    eta: float
    e: float
    c: float
    y_i: float


class Motion(NamedTuple):
    """Place of the pallet, speed of the rim, speed of the pallet."""

    y: float
    V: float
    w: float


@jit
def meets(gap, closing, pull):
    """First t >= 0 with gap = closing t + pull t^2/2, for gap >= 0; inf if there is none."""
    square = closing * closing + 2.0 * pull * gap
    if not (square >= 0.0):
        return math.inf
    if closing > 0.0:
        return 2.0 * gap / (closing + sqrt(square))
    return (sqrt(square) - closing) / pull if pull > 0.0 else math.inf


@jit
def meets_either(gap, rate, bend):
    """First meeting of a gap in [-1, 0]: the tooth reaches the pallet, or falls back on it by a pitch; and which."""
    gap = max(min(gap, 0.0), -1.0)
    ahead = meets(-gap, rate, bend)
    if rate < 0.0 or bend < 0.0:
        behind = meets(1.0 + gap, -rate, -bend)
        if behind < ahead:
            return behind, True
    return ahead, False


@jit
def impact(scene, motion, lever):
    """The motion after an impact, by (2), the speed of closing before it, and the energy lost for a wheel of mass 1."""
    closing, inertia = motion.V - lever * motion.w, scene.pallet + scene.wheel * lever * lever
    push = (1.0 + scene.e) * closing / inertia
    loss = 0.5 * (1.0 - scene.e) * (1.0 + scene.e) * closing * closing * scene.pallet / inertia
    return Motion(motion.y, motion.V - scene.pallet * push, motion.w + lever * scene.wheel * push), closing, loss


@jit
def centre(scene, motion, side):
    """Way and speed of the common centre along `side` (1: the holding pallet pushes y up, -1: the other one, down)."""
    return side * motion.y, scene.wheel * motion.V + scene.pallet * side * motion.w


@jit
def lowest(wheel, away, W, t):
    """Lowest way of the common centre within t."""
    turn = -W / wheel
    if not (turn > 0.0):
        return away
    turn = turn if turn < t else t
    return away + (W + 0.5 * wheel * turn) * turn


@jit
def train(scene, motion, side):
    """Bounces that follow an impact: their duration (3), the motion after them, the widest gap on the way, and `ends`.

    `ends`: whether nothing comes between them. No tip of a pallet is reached, and no tooth meets the other pallet: on
    the holding side it is met where y is in [-1/4, -1/4 + gap/2] and above -eta, on the other mirrored. Nor may y or
    the rim's way have an extreme between them: that of the centre is another.
    """
    eta = scene.eta
    away, W = centre(scene, motion, side)
    bounce = side * motion.w - motion.V
    bounce = bounce if bounce > 0.0 else 0.0
    t, gap = 2.0 * bounce / (1.0 - scene.e), 0.5 * bounce * bounce
    speed = W + scene.wheel * t
    after = Motion(side * (away + 0.5 * (W + speed) * t), speed, side * speed)
    low, high = lowest(scene.wheel, away, W, t), side * after.y
    high = (high if high > away else away) + scene.wheel * gap
    clear = gap <= 0.5 - 2.0 * eta or low > -0.25 + 0.5 * gap or high < -eta
    ends = high < eta and clear and (side > 0.0 or low > -eta)
    if W >= 0.0:
        return t, after, gap, ends and motion.V >= 0.0
    return t, after, gap, ends and after.V <= 0.0 and 2.0 * scene.wheel * scene.pallet * gap <= after.V * after.V


@jit
def slide(scene, motion, side):
    """Time in contact until the tooth leaves the pallet at its tip, or, across, until y reaches eta before that.

    Returns
    -------
    t, goal, speed : time, and the way and the speed along `side` at its end
    ends : whether the half swing ends with it
    """
    wheel, eta = scene.wheel, scene.eta
    away, W = side * motion.y, side * motion.w
    if side < 0.0 and lowest(wheel, away, W, math.inf) <= -eta:
        speed = -sqrt(max(W * W - 2.0 * wheel * (away + eta), 0.0))
        return (speed - W) / wheel, -eta, speed, True
    return meets(eta - away, W, wheel), eta, sqrt(W * W + 2.0 * wheel * (eta - away)), side > 0.0


@jit_call
def carry_flight(slopes, t):
    """Changes after a flight of fixed duration."""
    for j in range(3):
        slopes[OF_X, j] += t * slopes[OF_V, j]
        slopes[OF_Y, j] += t * slopes[OF_W, j]


@jit
def _later(slopes, j, motion, by):
    """Column j of the changes, `by` later in free flight."""
    slopes[OF_X, j] += motion.V * by
    slopes[OF_Y, j] += motion.w * by
    slopes[OF_V, j] += by
    slopes[OF_T, j] += by


@jit_call
def carry_line(slopes, motion):
    """Changes where y crosses a line."""
    for j in range(3):
        _later(slopes, j, motion, -slopes[OF_Y, j] / motion.w)
        slopes[OF_Y, j] = 0.0


@jit_call
def carry_impact(scene, slopes, motion, lever):
    """Changes through an impact, (2) by its derivative; `motion` is before it. A pallet at rest on the tooth is met
    by none of them."""
    wheel, pallet = scene.wheel, scene.pallet
    closing = motion.V - lever * motion.w
    inertia = pallet + wheel * lever * lever
    r = (1.0 + scene.e) / inertia
    for j in range(3):
        by = -(slopes[OF_X, j] - lever * slopes[OF_Y, j]) / closing if magnitude(closing) > 0.0 else 0.0
        _later(slopes, j, motion, by)
        turned = scene.c * slopes[OF_Y, j]
        faster = slopes[OF_V, j] - lever * slopes[OF_W, j] - motion.w * turned
        softer = -2.0 * r * wheel * lever * turned / inertia
        push = r * faster + closing * softer
        slopes[OF_V, j] -= pallet * push
        slopes[OF_W, j] += wheel * (lever * push + closing * r * turned)


@jit_call
def carry_train(scene, slopes, motion, side, t):
    """Changes through the bounces (3) into contact; `motion` is after the first impact, of which t comes."""
    wheel, pallet = scene.wheel, scene.pallet
    _, W = centre(scene, motion, side)
    for j in range(3):
        longer = 2.0 * (side * slopes[OF_W, j] - slopes[OF_V, j]) / (1.0 - scene.e)
        faster = wheel * slopes[OF_V, j] + pallet * side * slopes[OF_W, j]
        slopes[OF_Y, j] += side * (faster * t + (W + wheel * t) * longer)
        slopes[OF_X, j] = side * slopes[OF_Y, j]
        slopes[OF_V, j] = faster + wheel * longer
        slopes[OF_W, j] = side * slopes[OF_V, j]
        slopes[OF_T, j] += longer


@jit_call
def carry_slide(scene, slopes, motion, side, speed):
    """Changes through contact until a line, where both have the signed `speed` along `side`."""
    wheel = scene.wheel
    for j in range(3):
        away, fast = side * slopes[OF_Y, j], side * slopes[OF_W, j]
        there = (side * motion.w * fast - wheel * away) / speed
        slopes[OF_T, j] += (there - fast) / wheel
        slopes[OF_X, j], slopes[OF_Y, j] = 0.0, 0.0
        slopes[OF_V, j], slopes[OF_W, j] = there, side * there
