"""Half a period of crown wheel and foliot as two bodies: flight, impacts, contact, escape; without dimensions.

The foliot is at y phi0, counted along the push of the pallet that meets a tooth, that tooth at (y - gap) phi0. With
the time unit sqrt(I_v phi0/(n tau)), kappa = n^2 I_c/I_v, d = c_v sqrt(phi0/(I_v n tau)), r = R_v/(n tau):
    flight    y'' = -d y' - r sign(y'),  wheel'' = 1/kappa                                               (1)
    impact    y' - wheel' times -e, with y' + kappa wheel' kept                                          (2)
    contact   (1 + kappa) y'' = 1 - d y' - r sign(y')                                                    (3)
The tooth escapes as y rises through 1; the other pallet then stands `drop` ahead of its tooth. Contact pushes both
bodies, so it ends where the wheel alone would slow down less than the foliot: kappa (d abs(y') + r) > 1, y' < 0.
"""

import math
from collections import namedtuple

from kernels.integrate import linear_flow
from kernels.lanes.jit import jit_call
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths.elementary import log

DONE, OUT_OF_MESH, FALLS_BACK, TOO_MANY, LANDED = 0.0, 1.0, 2.0, 3.0, 4.0
"""How half a period ends: by the escape; the wheel is half a pitch back; without end (TOO_MANY). A flight also: the
pallet left before is back in front of its tooth (FALLS_BACK); the gap has closed (LANDED)."""
STEPS = 500
"""Steps to one landing; about five are usual."""
EVENTS = 3000
"""Landings and escapes of half a period: with e = 0.95 the closing speed is 1e-12 of the first after 540 landings."""
DIES_OUT = 1e-12
"""Share of the first closing speed at which the bodies go on together: they would part by 1e-24 of the way."""

Scene = namedtuple("Scene", "kappa d r drop e")
"""kappa, d, r, and drop as above, and the restitution."""

Half = namedtuple("Half", "v w gap time swing way back lost closing impacts end")
"""Speed of the foliot and of the wheel, and the gap, at escape, and what happened in the half period.

`swing` is the largest abs(y), `way` that of the foliot to and fro, `back` the wheel's way backwards since its
first landing, `lost` the energy of impacts, and `closing` the first closing speed.
"""


@jit_call
def _safe_step(scene, gap, v, w, force):
    """A time in which the gap does not close but at its end, and nearly does.

    gap'' is at least -1/kappa where the foliot speeds up towards the tooth or rests, and else what it is now: friction
    falls with the speed.
    """
    pull, closing = 1.0 / scene.kappa, w - v
    if force > pull and not closing > 0.0:  # the wheel lags until the foliot slows down by 1/kappa, or rests
        if scene.r * scene.kappa < 1.0 and scene.d > 0.0:
            return log(force * scene.kappa) / scene.d
        return linear_flow.first_reversal(0.5 * scene.d, 0.0, -v, -scene.r)
    strength = pull - min(force, 0.0)
    root = sqrt(closing * closing + 2.0 * strength * gap)
    return 2.0 * gap / (root + closing) if closing > 0.0 else (root - closing) / strength


@jit_call
def _flight(scene, y, v, w, gap, watched):
    """(1) until the gap closes or the tooth escapes: y, v, w, gap, time, the foliot's way, the wheel's, the least of
    that on the way, and how it ends. After a landing the other pallet is `watched`: back at y = -1 it must find the
    tooth that it let go ahead."""
    beta, time, way, rim, least = 0.5 * scene.d, 0.0, 0.0, 0.0, 0.0
    for _ in range(STEPS):
        rub = -scene.r if v > 0.0 else scene.r if v < 0.0 else 0.0
        force, speed = rub - scene.d * v, magnitude(v)
        step = _safe_step(scene, gap, v, w, force)
        stop = linear_flow.first_reversal(beta, 0.0, speed, -scene.r) if speed > 0.0 else math.inf
        stops, escapes, falls = stop <= step, False, False
        step = min(step, stop)
        if watched and v > 0.0 and y < -1.0:
            back = linear_flow.first_crossing(beta, 0.0, v, rub, -1.0 - y)
            falls = back <= step and gap - 1.0 - y - (w + 0.5 * back / scene.kappa) * back > scene.drop
            step, stops = (back, False) if falls else (step, stops)
        if watched and v > 0.0 and not falls:
            out = linear_flow.first_crossing(beta, 0.0, v, rub, 1.0 - y)
            escapes = out <= step
            step, stops = (out, False) if escapes else (step, stops)
        s, c, _ = linear_flow.response(beta, 0.0, step)
        moved, rolled = v * step + force * c, (w + 0.5 * step / scene.kappa) * step
        if w < 0.0:
            least = min(least, rim - 0.5 * w * w * scene.kappa if -w * scene.kappa < step else rim + rolled)
        time, way, rim, y = time + step, way + magnitude(moved), rim + rolled, y + moved
        gap = max(gap + (v - w) * step + force * c - 0.5 * step * step / scene.kappa, 0.0)
        v, w = (0.0 if stops else v + force * s), w + step / scene.kappa
        if escapes:
            return 1.0, v, w, gap, time, way, rim, least, DONE
        if falls:
            return -1.0, v, w, gap, time, way, rim, least, FALLS_BACK
        if not (gap > 0.0) or (step <= 1e-15 * time and not stops):
            return y, v, w, 0.0, time, way, rim, least, LANDED
    return y, v, w, gap, time, way, rim, least, TOO_MANY


@jit_call
def _contact(scene, y, v):
    """(3) from y with speed v to the escape: speed there, time, and the way back before the push wins."""
    both = 1.0 + scene.kappa
    beta, against, push = 0.5 * scene.d / both, (1.0 + scene.r) / both, (1.0 - scene.r) / both
    back, turn = 0.0, 0.0
    if v < 0.0:
        turn = linear_flow.first_reversal(beta, 0.0, -v, -against)
        back, _ = linear_flow.motion(beta, 0.0, -v, -against, turn)
        v = 0.0
    time = linear_flow.first_crossing(beta, 0.0, v, push, 1.0 - y + back)
    _, out = linear_flow.motion(beta, 0.0, v, push, time)
    return out, turn + time, back


@jit_call
def half_period(scene, v, w, gap):
    """From an escape with these speeds and this gap to the next one, seen from the pallet that is met.

    Where a bounce throws the wheel so far back that the pallet left before comes back in front of its tooth, that tooth
    is met again, and all is seen from that pallet until the tooth escapes once more: one `fallen` back, or several.
    """
    kappa, mesh = scene.kappa, 2.0 + scene.drop
    y, v, gap = -1.0, -v, gap + scene.drop
    time, way, rim, least, swing = 0.0, 0.0, 0.0, 0.0, 1.0
    lost, first, scale, last = 0.0, 0.0, 0.0, 0.0
    impacts, fallen, end = 0, 0, LANDED
    for _ in range(EVENTS):
        y, v, w, gap, t, moved, rolled, low, end = _flight(scene, y, v, w, gap, impacts > 0)
        if impacts > 0:
            least, rim = min(least, rim + low), rim + rolled
        time, way, swing = time + t, way + moved, max(swing, magnitude(y))
        if -least > mesh:
            return Half(v, w, gap, time, swing, way, -least, lost, first, 1.0 * impacts, OUT_OF_MESH)
        if end == LANDED:
            impacts, last = impacts + 1, w - v
            first = last if impacts == 1 else first
            scale = last if scale == 0.0 else scale
            together, dies = (v + kappa * w) / (1.0 + kappa), not (scene.e * last > DIES_OUT * scale)
            e = 0.0 if dies else scene.e
            lost = lost + 0.5 * kappa / (1.0 + kappa) * (1.0 - e) * (1.0 + e) * last * last
            v, w = together + kappa * e * last / (1.0 + kappa), together - e * last / (1.0 + kappa)
            if not dies or (together < 0.0 and kappa * (scene.r - scene.d * together) > 1.0):
                continue
            out, t, back = _contact(scene, y, together)
            least, swing = min(least, rim - back), max(swing, back - y)
            way, time, rim = way + 2.0 * back + 1.0 - y, time + t, rim + 1.0 - y
            v, w, gap, end = out, out, 0.0, OUT_OF_MESH if -least > mesh else DONE
        if end == FALLS_BACK:
            fallen, y, v, gap, scale = fallen + 1, 1.0, -v, gap - scene.drop, 0.0
        elif end == DONE and fallen > 0:
            fallen, y, v, gap, scale = fallen - 1, -1.0, -v, gap + scene.drop, 0.0
        else:
            return Half(v, w, gap, time, swing, way, -least, lost, first, 1.0 * impacts, end)
    return Half(v, w, gap, time, swing, way, -least, lost, first, 1.0 * impacts, TOO_MANY)
