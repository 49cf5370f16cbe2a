"""Verge and foliot as two bodies with friction, whose impacts keep a share of the closing speed; a verge that unmeshes.

    contact   (I_v + n^2 I_c) angle'' = n tau - c_v angle' - R_v sign(angle')                            (1)
    flight    I_v angle'' = -c_v angle' - R_v sign(angle'),  I_c wheel'' = tau                           (2)
    impact    the closing speed times -e, with I_v angle' + n I_c wheel' kept                            (3)

A tooth pushes its pallet, wheel' = n angle', until it escapes at phi0; the wheel flies on by `drop` to the other
pallet. With e > 0 it bounces there; bounces either die out in contact or last until the next escape. A landing while
the foliot still swings out throws the wheel back: *recoil*. A tooth stands half a pitch, 2 n phi0 + drop, from the
next to come. Where the recoil exceeds that, contact ends: the pallet leaves its tooth, and as nothing but the tooth
ever turned the foliot back, it coasts outwards while the wheel runs free. UNMESHES says that the clock, started from
rest with its wheel at the drop, comes to that within its first swings or as they grow; there is no cycle then.

A bounce of a heavy wheel may throw it so far back that the pallet which it left comes back in front of its tooth: it is
pushed by that tooth once more, until this escapes again, and so on, within one half period.

OK: the cycle that the clock comes to from there, one tooth a period, within the error that is stated. Its halves are
alike, or the clock limps: with e > 0 and a heavy wheel one half may last longer, and have more landings, than the
other. Then amplitude and recoil are the larger ones, speed and shares the means. NOT_CONVERGED: it did not come to such
a cycle in 600 half periods; some clocks come to a cycle of several teeth, or to none. STEP_LIMIT: half a period has
more than 3000 landings and escapes. NO_METHOD: groups beyond 2^+-40 or kappa above 2^13. Without friction and with
e = 0 this is `impact`, without inertia of the wheel `foliot`. Leaves out: friction of the wheel, the shape of the
pallets. Derived here.
"""

import math
from collections import namedtuple

from kernels.foliot import _two_bodies
from kernels.foliot._two_bodies import Half, Scene, half_period
from kernels.interface import Field
from kernels.lanes.codes import NEVER_STARTS, NO_METHOD, NOT_CONVERGED, OK, STEP_LIMIT, UNMESHES
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.ranges import judged
from kernels.lanes.vectors import magnitude, sqrt, where
from kernels.lanes.wiring import kernel, method
from kernels.maths.elementary import mantissa_exponent, measured, scale, scaled_root

HALF_PERIODS = 600
"""Half periods that are followed until one repeats the one before; secants between them."""
ROUNDING = 1e-14
"""Relative error of half a period: its landings and its escape, by 20 digits."""

Cycle = namedtuple("Cycle", "period amplitude escape_speed recoil impact_share dry_share")
"""The outputs, or their relative errors."""

Units = namedtuple("Units", "time e_time angle e_angle wheel e_wheel fine")
"""The time unit, and the foliot's and the wheel's angles, each a mantissa and an exponent; whether in range."""


@jit
def without_dimensions(p):
    """The scene of `_two_bodies` and its units."""
    (tau, e_tau), (I_v, e_v), (I_c, e_c) = mantissa_exponent(p.tau), mantissa_exponent(p.I_v), mantissa_exponent(p.I_c)
    (n, e_n), (phi0, e_phi) = mantissa_exponent(p.n), mantissa_exponent(p.phi0)
    time, e_time = scaled_root(I_v * phi0 / (n * tau), e_v + e_phi - e_n - e_tau)
    e_kappa = 2.0 * e_n + e_c - e_v
    c, e_c_v = mantissa_exponent(where(p.c_v > 0.0, p.c_v, p.I_v))
    e_d = e_c_v + e_time - e_v
    drop, e_drop = mantissa_exponent(where(p.drop > 0.0, p.drop, p.phi0))
    e_drop = e_drop - e_n - e_phi
    R, e_R = mantissa_exponent(where(p.R_v > 0.0, p.R_v, p.tau))
    e_R = e_R - e_n - e_tau
    damped, drops = p.c_v > 0.0, p.drop > 0.0
    fine = (
        (e_kappa <= 12.0) & (e_kappa >= -40.0) & ((magnitude(e_d) <= 40.0) | (p.c_v <= 0.0))
        & ((magnitude(e_drop) <= 40.0) | (p.drop <= 0.0))
    )  # fmt: skip
    r = where(p.R_v > 0.0, scale(R / (n * tau), where(e_R < 40.0, e_R, 40.0)), 0.0)
    scene = Scene(
        scale(n * n * I_c / I_v, where(fine, e_kappa, 0.0)),
        where(damped, scale(c * time / I_v, where(fine, e_d, 0.0)), 0.0),
        r,
        where(drops, scale(drop / (n * phi0), where(fine, e_drop, 0.0)), 0.0),
        p.e,
    )
    return scene, Units(time, e_time, phi0, e_phi, n * phi0, e_n + e_phi, fine)


@jit
def given(units, answer, verdict):
    """The outputs, NaN where they are no normal numbers, and the status."""
    half, share, rubbed = answer
    period = measured(2.0 * units.time * half.time, units.e_time)
    amplitude = measured(units.angle * half.swing, units.e_angle)
    speed = measured(units.angle / units.time * half.v, units.e_angle - units.e_time)
    recoil = 0.0 if half.back == 0.0 else measured(units.wheel * half.back, units.e_wheel)
    sound = period > 0.0 and amplitude > 0.0
    verdict = verdict if units.fine else NO_METHOD
    cycle = Cycle(period, amplitude, speed, recoil, share, rubbed)
    return cycle, judged(sound, sound and speed > 0.0 and recoil >= 0.0, verdict)


@jit
def distance(half, v, w, gap):
    """Between the end of half a period and another state at an escape, over the speeds."""
    apart = (magnitude(half.v - v) + magnitude(half.w - w)) / (half.v + magnitude(half.w))
    return apart + magnitude(half.gap - gap) / (1.0 + half.gap)


@jit
def of_both(one, other):
    """Two unlike halves as one: the larger of what is largest, the means of all else."""
    return Half(
        0.5 * (one.v + other.v), 0.5 * (one.w + other.w), one.gap, 0.5 * (one.time + other.time),
        max(one.swing, other.swing), 0.5 * (one.way + other.way), max(one.back, other.back),
        0.5 * (one.lost + other.lost), min(one.closing, other.closing), one.impacts + other.impacts, one.end,
    )  # fmt: skip


@jit_call
def repeated(scene):
    """The half period that repeats, the clock started from rest; its relative error; the status.

    Where it repeats only after the one between, the clock limps, and the answer is of both.

    Where bounces die out before the escape the next half period depends on one speed alone, and secants lead to the
    speed that repeats. A speed tried by a secant may unmesh where the clock itself does not come to it: then it is a
    ceiling, and halfway to it is tried next.
    """
    v, w, gap, tried, floor, ceiling = 0.0, 0.0, 0.0, False, 0.0, math.inf
    old_v, old_image, slope, before = -1.0, 0.0, 0.0, math.inf
    half = half_period(scene, v, w, gap)
    one, first_v, first_w, first_gap = half, -1.0, 0.0, 0.0
    limped, earlier, pace = math.inf, math.inf, 0.0
    for _ in range(HALF_PERIODS):
        if half.end != _two_bodies.DONE:
            if not tried:
                return half, math.nan, UNMESHES if half.end == _two_bodies.OUT_OF_MESH else STEP_LIMIT
            v, w, gap, tried, ceiling = floor, floor, 0.0, False, v
            half = half_period(scene, v, w, gap)
            continue
        alone = max(gap, half.gap) == 0.0 and w == v and half.w == half.v
        change, twice = distance(half, v, w, gap), math.inf
        if alone and old_v >= 0.0 and magnitude(v - old_v) > 1e-7 * v:
            slope = (half.v - old_image) / (v - old_v)
        elif not alone and change > 1e-9:
            slope = change / before
        if slope < 1.0 and change <= 1e-13 and (change <= 2e-16 or change >= 0.5 * before):
            return half, (change + ROUNDING) / (1.0 - max(slope, 0.0)), OK
        if not alone and first_v >= 0.0:
            twice = distance(half, first_v, first_w, first_gap)
            if twice > 1e-9:
                pace = twice / earlier
            if pace < 1.0 and change > 1e-6 and twice <= 1e-13 and (twice <= 2e-16 or twice >= 0.5 * earlier):
                return of_both(one, half), (twice + ROUNDING) / (1.0 - pace), OK
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
    return half, math.nan, NOT_CONVERGED


@jit
def return_map(scene, rtol):
    """`repeated`, with the shares of the losses in the work of the drive, and the error of each output."""
    half, error, status = repeated(scene)
    work, fast = 2.0 + scene.drop, half.v + magnitude(half.w)
    blunt = fast * sqrt(2.0 * (1.0 + scene.kappa) / half.back) if half.back > 0.0 else 0.0
    hit = max(1.0, fast / half.closing)
    errors = Cycle(error, error, error, error * (1.0 + blunt), 4.0 * hit * error, 2.0 * error)
    return (half, half.lost / work, scene.r * half.way / work), errors, status


@jit
def check(p):
    """NEVER_STARTS for dry friction that holds the drive."""
    scene, _ = without_dimensions(p)
    return where(scene.r < 1.0, OK, NEVER_STARTS)


VERGE = kernel(
    "verge",
    doc="limit cycle of crown wheel and foliot as two bodies with friction and restitution, or that they unmesh",
    source="two bodies, friction, contact and restitution; derived here",
    parameters=(
        Field("tau", "N m", "torque on the crown wheel", lower=0.0, open_lower=True),
        Field("I_v", "kg m^2", "moment of inertia of foliot and verge", lower=0.0, open_lower=True),
        Field("I_c", "kg m^2", "moment of inertia of crown wheel and train", lower=0.0, open_lower=True),
        Field("n", "1", "angle of the wheel over that of the foliot, in contact", lower=0.0, open_lower=True),
        Field("phi0", "rad", "angle at which the tooth leaves the pallet", lower=0.0, open_lower=True),
        Field("drop", "rad", "way of the wheel from pallet to pallet", lower=0.0),
        Field("e", "1", "restitution: share of the closing speed kept by an impact", default=0.0, lower=0.0,
              upper=0.95),
        Field("c_v", "N m s/rad", "viscous friction of the foliot", default=0.0, lower=0.0),
        Field("R_v", "N m", "dry friction of the foliot", default=0.0, lower=0.0),
    ),
    outputs=(
        Field("period", "s", "period of the cycle, in which one tooth passes"),
        Field("amplitude", "rad", "largest angle of the foliot"),
        Field("escape_speed", "rad/s", "speed of the foliot as the tooth escapes"),
        Field("recoil", "rad", "largest angle by which a landing throws the wheel back"),
        Field("impact_share", "1", "share of the drive's work that impacts take"),
        Field("dry_share", "1", "share of the drive's work that dry friction takes; the rest is viscous"),
    ),
    check=check,
    methods=(
        method("return_map", "closed pieces from event to event, secant method on the return map", return_map,
               units=(without_dimensions, given), loop=cell_by_cell, estimates=True),
    ),
    example={"tau": 1e-3, "I_v": 1e-4, "I_c": 2.5e-5, "n": 0.2, "phi0": 0.35, "drop": 0.0035, "e": 0.3, "c_v": 1e-4},
)  # fmt: skip
