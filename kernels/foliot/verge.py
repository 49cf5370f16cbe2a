"""Verge and foliot as two bodies with friction and impacts with restitution; also verges that unmesh.

    contact   (I_v + n^2 I_c) angle'' = n tau - c_v angle' - R_v sign(angle')                            (1)
    flight    I_v angle'' = -c_v angle' - R_v sign(angle'),  I_c wheel'' = tau                           (2)
    impact    the closing speed times -e, with I_v angle' + n I_c wheel' kept                            (3)

A tooth pushes its pallet, wheel' = n angle', until it escapes at phi0; the wheel then moves freely by `drop` to the
other pallet. With e > 0 it bounces there; the bounces either die out in contact or last until the next escape. An
impact while the foliot still swings outwards drives the wheel back: *recoil*. The tooth in contact and the next to act,
on the other pallet, are half a pitch, 2 n phi0 + drop, apart. If the recoil exceeds that, the pallet leaves its tooth,
and since only the tooth turns the foliot back, the foliot coasts outwards while the wheel runs free. UNMESHES: the
clock, started from rest with its wheel at the drop, does so within its first swings or as they grow, and has no cycle.

A bounce may throw a heavy wheel so far back that the pallet which it left comes in front of its tooth again: that tooth
pushes it once more until it escapes, possibly repeatedly, within one half period. `escape_speed` is that of the first
escape.

OK: the cycle that the clock reaches from this start, one tooth per period, within the stated error. Its halves are
equal, or the clock limps: with a heavy wheel that bounces, or close to the dry friction that stops it, one half may
last longer and have more impacts than the other. Amplitude and recoil are then the larger ones, speed and shares the
means. NOT_CONVERGED: no such cycle in 600 half periods; some clocks reach a cycle of several teeth, or none.
STEP_LIMIT: half a period has more than 3000 impacts and escapes, or a clock without drop comes to rest between a tooth
and the one before. NO_METHOD: dimensionless groups beyond 2^+-40 or kappa above 2^13. Without friction and
with e = 0 this is `impact`, without inertia of the wheel `foliot`. Leaves out: friction of the wheel, the shape of the
pallets. Derived here.

Without dimensions the foliot is at y phi0, counted along the push of the pallet that meets a tooth, that tooth at
(y - gap) phi0; with the time unit sqrt(I_v phi0/(n tau)), kappa = n^2 I_c/I_v, d = c_v sqrt(phi0/(I_v n tau)) and
r = R_v/(n tau), (1) is (1 + kappa) y'' = 1 - d y' - r sign(y'), and in (2) wheel'' = 1/kappa. The tooth escapes as y
rises through 1; the other pallet then stands `drop` ahead of its tooth. Contact pushes both bodies, so it ends where
the wheel alone would slow down less than the foliot: kappa (d abs(y') + r) > 1, y' < 0.
"""

import math
from collections import namedtuple

from kernels.integrate import linear_flow
from kernels.interface import Field
from kernels.lanes.codes import NEVER_STARTS, NO_METHOD, NOT_CONVERGED, OK, STEP_LIMIT, UNMESHES
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.ranges import judged
from kernels.lanes.vectors import choose, magnitude, sqrt, where
from kernels.lanes.wiring import kernel, method
from kernels.maths.elementary import log
from kernels.maths.pairs import two_product
from kernels.maths.wide import number, over, root, size, times, wide

HALF_PERIODS = 600
"""Half periods that are followed until one repeats the one before; secants between them."""
ROUNDING = 1e-14
"""Relative error of half a period: its landings and its escape, by 20 digits."""

DONE, OUT_OF_MESH, FALLS_BACK, TOO_MANY, LANDED = 0.0, 1.0, 2.0, 3.0, 4.0
"""How half a period ends: by the escape; the wheel is half a pitch back; without end (TOO_MANY). A flight also: the
pallet left before is back in front of its tooth (FALLS_BACK); the gap has closed (LANDED)."""
STEPS, EVENTS = 500, 3000
"""Steps to one landing, five of which are usual; landings and escapes of half a period: with e = 0.95 the closing speed
is 1e-12 of the first after 540 landings."""
DIES_OUT = 1e-12
"""Share of the first closing speed at which the bodies go on together: they would part by 1e-24 of the way."""
FADES = 1e-5
"""Share of the first closing speed at which a clock without drop comes to rest between two teeth: further returns to
the tooth it left, ever shorter, would follow."""

Scene = namedtuple("Scene", "kappa d r slack drop e")
"""kappa, d, r, and drop as above, slack = 1 - r without the rounding of r, and the restitution."""

Half = namedtuple("Half", "v w gap time swing way back lost closing end")
"""Speed of the foliot and of the wheel, and the gap, at escape, and what happened in the half period: `swing` is the
largest abs(y), `way` that of the foliot to and fro, `back` the wheel's way backwards since its first landing, `lost`
the energy of impacts, and `closing` the first closing speed."""


@jit
def without_dimensions(p):
    """The scene; the units of time, of the foliot's and of the wheel's angle; whether the groups are in range."""
    tau, I_v, I_c, n, phi0, c_v, R_v, drop = wide((p.tau, p.I_v, p.I_c, p.n, p.phi0, p.c_v, p.R_v, p.drop))
    push, wheel = times(n, tau), times(n, phi0)
    time = root(over(times(I_v, phi0), push))
    kappa, d, drop = over(times(times(n, n), I_c), I_v), over(times(c_v, time), I_v), over(drop, wheel)
    fine = (kappa[1] <= 12.0) & (kappa[1] >= -40.0)
    fine = fine & ((magnitude(d[1]) <= 40.0) | (p.c_v <= 0.0)) & ((magnitude(drop[1]) <= 40.0) | (p.drop <= 0.0))
    kappa, d, drop = choose(fine, (kappa, d, drop), ((1.0, 0.0), (1.0, 0.0), (1.0, 0.0)))
    dry, (drive, rest) = over(R_v, (1.0, push[1])), two_product(n[0], tau[0])
    slack = ((drive - number(dry)) + rest) / drive
    scene = Scene(number(kappa), number(d), number(over(R_v, push)), slack, number(drop), p.e)
    return scene, (time, phi0, wheel, fine)


@jit
def given(units, answer, verdict):
    """The outputs, NaN where they are no normal numbers, and the status."""
    (time, angle, wheel, fine), (half, share, rubbed) = units, answer
    period, amplitude, speed = size(2.0 * half.time, time), size(half.swing, angle), size(half.v, over(angle, time))
    recoil = 0.0 if half.back == 0.0 else size(half.back, wheel)
    sound = period > 0.0 and amplitude > 0.0
    verdict = judged(sound, sound and speed > 0.0 and recoil >= 0.0, verdict if fine else NO_METHOD)
    return (period, amplitude, speed, recoil, share, rubbed), verdict


@jit
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


@jit
def _flight(scene, edge, off, v, w, gap, watched):
    """(2) from y = edge + off until the gap closes or the tooth escapes: edge, off, v, w, gap, time, the foliot's way,
    the wheel's, the least of that on the way, and how it ends. After a landing the other pallet is `watched`: back at
    y = -1 it must find the tooth that it let go ahead. A tooth that was let go may be met within 1e-14 of an edge."""
    beta, time, way, rim, least = 0.5 * scene.d, 0.0, 0.0, 0.0, 0.0
    for _ in range(STEPS):
        rub = -scene.r if v > 0.0 else scene.r if v < 0.0 else 0.0
        force, speed = rub - scene.d * v, magnitude(v)
        step = _safe_step(scene, gap, v, w, force)
        stop = linear_flow.first_reversal(beta, 0.0, speed, -scene.r) if speed > 0.0 else math.inf
        stops, escapes, falls = stop <= step, False, False
        step = min(step, stop)
        if watched and v > 0.0 and off < -1.0 - edge:
            back = linear_flow.first_crossing(beta, 0.0, v, rub, -1.0 - edge - off)
            falls = back <= step and gap + (-1.0 - edge - off) - (w + 0.5 * back / scene.kappa) * back > scene.drop
            step, stops = (back, False) if falls else (step, stops)
        if watched and v > 0.0 and not falls:
            out = linear_flow.first_crossing(beta, 0.0, v, rub, 1.0 - edge - off)
            escapes = out <= step
            step, stops = (out, False) if escapes else (step, stops)
        s, c, _ = linear_flow.response(beta, 0.0, step)
        moved, rolled = v * step + force * c, (w + 0.5 * step / scene.kappa) * step
        if w < 0.0:
            least = min(least, rim - 0.5 * w * w * scene.kappa if -w * scene.kappa < step else rim + rolled)
        time, way, rim, off = time + step, way + magnitude(moved), rim + rolled, off + moved
        gap = max(gap + (v - w) * step + force * c - 0.5 * step * step / scene.kappa, 0.0)
        v, w = (0.0 if stops else v + force * s), w + step / scene.kappa
        if escapes:
            return 1.0, 0.0, v, w, gap, time, way, rim, least, DONE
        if falls:
            return -1.0, 0.0, v, w, gap, time, way, rim, least, FALLS_BACK
        if not (gap > 0.0) or (step <= 1e-15 * time and not stops):
            return edge, off, v, w, 0.0, time, way, rim, least, LANDED
    return edge, off, v, w, gap, time, way, rim, least, TOO_MANY


@jit
def _contact(scene, ahead, v):
    """(1) with speed v to the escape, so far ahead: speed there, time, and the way back before the push wins."""
    both = 1.0 + scene.kappa
    beta, against, push = 0.5 * scene.d / both, (1.0 + scene.r) / both, scene.slack / both
    back, turn = 0.0, 0.0
    if v < 0.0:
        turn = linear_flow.first_reversal(beta, 0.0, -v, -against)
        back, _ = linear_flow.motion(beta, 0.0, -v, -against, turn)
        v = 0.0
    time = linear_flow.first_crossing(beta, 0.0, v, push, ahead + back)
    _, out = linear_flow.motion(beta, 0.0, v, push, time)
    return out, turn + time, back


@jit_apart
def half_period(scene, v, w, gap):
    """From an escape with these speeds and this gap to the next one, seen from the pallet that is met.

    Where a bounce throws the wheel so far back that the pallet left before comes back in front of its tooth, that tooth
    is met again, and all is seen from that pallet until the tooth escapes once more: one `fallen` back, or several.
    """
    kappa, mesh = scene.kappa, 2.0 + scene.drop
    edge, off, v, gap = -1.0, 0.0, -v, gap + scene.drop
    time, way, rim, least, swing = 0.0, 0.0, 0.0, 0.0, 1.0
    lost, first, scale, last = 0.0, 0.0, 0.0, 0.0
    impacts, fallen, how = 0, 0, TOO_MANY
    for _ in range(EVENTS):
        edge, off, v, w, gap, t, moved, rolled, low, end = _flight(scene, edge, off, v, w, gap, impacts > 0)
        if impacts > 0:
            least, rim = min(least, rim + low), rim + rolled
        time, way, swing = time + t, way + moved, max(swing, magnitude(edge + off))
        if -least > mesh:
            how = OUT_OF_MESH
            break
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
            ahead = 1.0 - edge - off
            out, t, back = _contact(scene, ahead, together)
            least, swing = min(least, rim - back), max(swing, back + ahead - 1.0)
            way, time, rim = way + 2.0 * back + ahead, time + t, rim + ahead
            v, w, gap, end = out, out, 0.0, OUT_OF_MESH if -least > mesh else DONE
        if end == FALLS_BACK:
            if scene.drop == 0.0 and v <= FADES * first:
                break
            fallen, edge, off, v, gap, scale = fallen + 1, 1.0, 0.0, -v, gap - scene.drop, 0.0
        elif end == DONE and fallen > 0:
            fallen, edge, off, v, gap, scale = fallen - 1, -1.0, 0.0, -v, gap + scene.drop, 0.0
        else:
            how = end
            break
    return Half(v, w, gap, time, swing, way, -least, lost, first, how)


@jit
def distance(half, v, w, gap):
    """Between the end of half a period and another state at an escape, over the speeds."""
    apart = (magnitude(half.v - v) + magnitude(half.w - w)) / (half.v + magnitude(half.w))
    return apart + magnitude(half.gap - gap) / (1.0 + half.gap)


@jit
def return_map(scene, rtol):
    """The half period that repeats, the clock started from rest, with the shares of the losses in the drive's work; the
    relative errors; the status.

    Where it repeats only after the one between, the clock limps, and the answer is of both. Where bounces die out
    before the escape the next half period depends on one speed alone, and secants lead to the speed that repeats. A
    speed tried by a secant may unmesh where the clock itself does not come to it: then it is a ceiling, and halfway to
    it is tried next. A speed that repeats, but that the clock leaves again, is forgotten: it is followed from rest
    anew, without secants.
    """
    v, w, gap, tried, floor, ceiling, secants = 0.0, 0.0, 0.0, False, 0.0, math.inf, True
    old_v, old_image, slope, before = -1.0, 0.0, 0.0, math.inf
    half, error, status = half_period(scene, v, w, gap), math.nan, NOT_CONVERGED
    one, first_v, first_w, first_gap = half, -1.0, 0.0, 0.0
    limped, earlier, pace = math.inf, math.inf, 0.0
    for _ in range(HALF_PERIODS):
        if half.end != DONE:
            if not tried:
                status = UNMESHES if half.end == OUT_OF_MESH else STEP_LIMIT
                break
            v, w, gap, tried, ceiling = floor, floor, 0.0, False, v
            half = half_period(scene, v, w, gap)
            continue
        alone = secants and max(gap, half.gap) == 0.0 and w == v and half.w == half.v
        change, twice = distance(half, v, w, gap), math.inf
        if alone and old_v >= 0.0 and magnitude(v - old_v) > 1e-10 * v:
            slope = (half.v - old_image) / (v - old_v)
        elif not alone and change > 1e-9:
            slope = change / before
        if slope < 1.0 and change <= 1e-13 and (change <= 2e-16 or change >= 0.5 * before):
            if slope <= -1.0:
                v, tried, secants, slope, before, earlier = 0.0, False, False, 0.0, math.inf, math.inf
                half = half_period(scene, v, v, gap)
                continue
            error, status = (change + ROUNDING) / (1.0 - max(slope, 0.0)), OK
            break
        if not alone and first_v >= 0.0:
            twice = distance(half, first_v, first_w, first_gap)
            if twice > 1e-9:
                pace = twice / earlier
            if pace < 1.0 and change > 1e-10 and twice <= 1e-13 and (twice <= 2e-16 or twice >= 0.5 * earlier):
                error, status = (twice + ROUNDING) / (1.0 - pace), OK
                half = Half(  # both as one: the larger of what is largest, the means of all else
                    0.5 * (one.v + half.v), 0.5 * (one.w + half.w), one.gap, 0.5 * (one.time + half.time),
                    max(one.swing, half.swing), 0.5 * (one.way + half.way), max(one.back, half.back),
                    0.5 * (one.lost + half.lost), min(one.closing, half.closing), one.end,
                )  # fmt: skip
                break
        limped, earlier, one, first_v, first_w, first_gap = twice, limped, half, -1.0 if alone else v, w, gap
        before, floor, image = change, half.v, half.v
        if alone and slope < 1.0:
            image = min(v + (half.v - v) / (1.0 - slope), 4.0 * half.v)
            if not (image > 0.25 * half.v) or old_v < 0.0:
                image = half.v
            if image >= ceiling > half.v:
                image = 0.5 * (half.v + ceiling)
        tried, old_v, old_image = image != half.v, v, half.v
        v, w, gap = (image, image, 0.0) if alone else (half.v, half.w, half.gap)
        half = half_period(scene, v, w, gap)
    work, fast = 2.0 + scene.drop, half.v + magnitude(half.w)
    blunt = fast * sqrt(2.0 * (1.0 + scene.kappa) / half.back) if half.back > 0.0 else 0.0
    hit = max(1.0, fast / half.closing)
    errors = error, error, error, error * (1.0 + blunt), 4.0 * hit * error, 2.0 * error
    return (half, half.lost / work, scene.r * half.way / work), errors, status


@jit
def check(p):
    """NEVER_STARTS for dry friction that holds the drive."""
    scene, _ = without_dimensions(p)
    return where(scene.slack > 0.0, OK, NEVER_STARTS)


VERGE = kernel(
    "verge",
    doc="limit cycle of crown wheel and foliot as two bodies with friction and restitution",
    source="two bodies, friction, contact and restitution; derived here",
    parameters=(
        Field("tau", "N m", "torque on the crown wheel", lower=0.0, open_lower=True),
        Field("I_v", "kg m^2", "moment of inertia of foliot and verge", lower=0.0, open_lower=True),
        Field("I_c", "kg m^2", "moment of inertia of crown wheel and train", lower=0.0, open_lower=True),
        Field("n", "1", "gear ratio: wheel angle over foliot angle, in contact", lower=0.0, open_lower=True),
        Field("phi0", "rad", "angle at which the tooth leaves the pallet", lower=0.0, open_lower=True),
        Field("drop", "rad", "free travel of the wheel from pallet to pallet", lower=0.0),
        Field("e", "1", "restitution: share of the closing speed kept in an impact", default=0.0, lower=0.0,
              upper=0.95),
        Field("c_v", "N m s/rad", "viscous friction of the foliot", default=0.0, lower=0.0),
        Field("R_v", "N m", "dry friction of the foliot", default=0.0, lower=0.0),
    ),
    outputs=(
        Field("period", "s", "period of the cycle, in which one tooth passes"),
        Field("amplitude", "rad", "largest angle of the foliot"),
        Field("escape_speed", "rad/s", "speed of the foliot as the tooth escapes"),
        Field("recoil", "rad", "largest angle by which a landing throws the wheel back"),
        Field("impact_share", "1", "share of the drive's work lost in impacts"),
        Field("dry_share", "1", "share of the drive's work lost to dry friction; the rest is viscous"),
    ),
    check=check,
    methods=(
        method("return_map", "closed pieces from event to event, secant method on the return map", return_map,
               units=(without_dimensions, given), loop=cell_by_cell, estimates=True),
    ),
    example={"tau": 1e-3, "I_v": 1e-4, "I_c": 2.5e-5, "n": 0.2, "phi0": 0.35, "drop": 0.0035, "e": 0.3, "c_v": 1e-4},
)  # fmt: skip
