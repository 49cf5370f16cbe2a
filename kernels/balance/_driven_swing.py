"""The half swing of a balance that is driven once in it, and its limit cycle: exact pieces of `linear_flow`.

    th'' + 2 zeta th' + th +- r = drive,  in units of 1/w_n                                          (1)
From rest at a = beta + p the balance falls to th = beta (leg 1, where its speed is v1). The lift torque m pushes it to
-beta (leg 2, v2), or the energy w kicks it at 0 (beta = 0, v3^2 = v2^2 + 2 w), and it comes to rest at -a' =
-(beta + p') (leg 3). The balance of energy and the phase area give its gain and its slope,
    a'^2 - a^2 = 2 (2 m beta + w - r (a + a') - 2 zeta J),  J = integral of v^2 over the legs,       (2)
    da'/da = exp(-2 zeta T) (a - r)/(a' + r),  T the time of the half swing.                         (3)
At the cycle (3) is the multiplier, of the amplitude as of the energy. The energy that leg 3 needs to rise to a grows
with a by exp(2 zeta t3) (a + r), what legs 1 and 2 provide by exp(-2 zeta (t1 + t2)) (a - r), which is less: there is
one cycle, stable, if the least swing that comes through the lift gains, and none otherwise.
Angles are in units of a power of two near beta, or near the square root of w.
Derived here.
"""

import math
from typing import NamedTuple

from kernels.balance import _driven_refined, _ringdown
from kernels.integrate import linear_flow
from kernels.lanes.codes import INACCURATE, NO_METHOD, NOT_CONVERGED, OK, OUT_OF_RANGE, STICKS
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, nearest, not_, sqrt, where
from kernels.maths import pairs
from kernels.maths.elementary import arctan, exp, expm1, in_unit, mantissa_exponent

NEWTON_LIMIT = 100
"""Newton steps or bisections on (3); about six are usual."""
ROUNDING = 4e-15
"""Relative error of one half swing: of times, speeds, rises, and of the terms of (2)."""
_LARGEST = 1e140
"""Swing, in units, whose square still is well inside float64."""


class Scene(NamedTuple):
    """A driven balance in units of angle."""

    zeta: float
    r: float
    m: float
    beta: float
    w: float


class Cycle(NamedTuple):
    """A limit cycle in units: its amplitude, the time of half of it, and its multiplier."""

    amplitude: float
    time: float
    multiplier: float


class Rise(NamedTuple):
    """Legs 2 and 3 to rest at -(beta + p), whether the lift is passed, and their share `loss` of J in (2)."""

    p: float
    v2: float
    v3: float
    t2: float
    t3: float
    comes: bool
    loss: float
    s2: float
    slope3: float


class HalfSwing(NamedTuple):
    """From rest at beta + p to rest at -(beta + p'), and whether it passes the lift, or the zero.

    `gain` is p' - p, a difference where the swing forgets its start and by (2) where it hardly changes; `noise` what
    rounding may be worth in it; `kept` da'/da by (3), `lost` 1 minus that; `late` a bound on dT/dp; `blunt` the error
    of the time, by the speeds at which its pieces end.
    """

    gain: float
    noise: float
    kept: float
    lost: float
    time: float
    comes: bool
    late: float
    blunt: float


@jit
def in_units(p):
    """The scene; and omega_n, the exponent of the unit, and whether friction and torque are normal numbers in it."""
    lifts = p.beta > 0.0
    m_w, e_w = mantissa_exponent(where(lifts, 1.0, p.w))
    _, e_beta = mantissa_exponent(where(lifts, p.beta, 1.0))
    half = nearest(0.5 * e_w - 0.25)
    e = where(lifts, e_beta, half)
    energy = where(lifts, 0.0, m_w * where(e_w - 2.0 * half > 0.5, 2.0, 1.0))
    friction, torque = in_unit(p.r, e), in_unit(p.m, e)
    fine = (not_(p.r > 0.0) | (friction > 1e-300)) & (friction < 1e300) & (not_(lifts) | (torque > 1e-300))
    return Scene(p.zeta, friction, torque, in_unit(p.beta, e), energy), (p.omega_n, e, fine & (torque < 1e300))


@jit
def _first_leg(scene, p):
    """Leg 1 from rest: the force there, the time, the response s and c to it, and whether it comes to th = beta."""
    f = (scene.beta - scene.r) + p
    t = linear_flow.first_crossing(scene.zeta, 1.0, 0.0 * p, f, p)
    comes = t < math.inf
    t = where(comes, t, 0.0)
    s, c, _ = linear_flow.response(scene.zeta, 1.0, t)
    return f, t, s, c, comes


@jit_call
def _rise(scene, v1):
    """Legs 2 and 3 from th = beta with speed v1."""
    zeta, r, m, beta, w = scene
    f2, f3 = (beta - r) + m, beta + r
    lifts = beta > 0.0
    t2, comes = 0.0 * v1, v1 >= 0.0
    if any_lane(lifts):
        force, way = where(lifts, f2, 1.0), where(lifts, 2.0 * beta, 1.0)
        t2 = linear_flow.first_crossing(zeta, 1.0, where(lifts, v1, 1.0), force, way)
        comes = not_(lifts) | (t2 < math.inf)
        t2 = where(lifts & comes, t2, 0.0)
    s2, _, slope2 = linear_flow.response(zeta, 1.0, t2)
    k2 = linear_flow.loss(zeta, 1.0, t2)
    v2 = fma(v1, slope2, f2 * s2)
    v3 = sqrt(fma(v2, v2, 2.0 * w))
    t3 = linear_flow.first_reversal(zeta, 1.0, where(comes, v3, 1.0), -f3)
    s3, c3, slope3 = linear_flow.response(zeta, 1.0, t3)
    p = fma(v3, s3, -f3 * c3)
    top = beta + p
    j2 = v1 * v1 * (s2 * fma(zeta, s2, slope2) + k2) + f2 * s2 * s2 * v1 + f2 * f2 * k2
    j3 = (top + r) * (top + r) * linear_flow.loss(-zeta, 1.0, t3)
    return Rise(p, v2, v3, t2, t3, comes, j2 + j3, s2, slope3)


@jit_call
def half_swing(scene, p):
    """The half swing from rest at beta + p, p > 0."""
    zeta, r, m, beta, w = scene
    f, t1, s1, c1, comes = _first_leg(scene, p)
    v1 = f * s1
    rise = _rise(scene, v1)
    a, top, time = beta + p, beta + rise.p, t1 + rise.t2 + rise.t3
    j = rise.loss + f * f * linear_flow.loss(zeta, 1.0, t1)
    fade = -expm1(-2.0 * zeta * time)
    kept = exp(-2.0 * zeta * time) * f / (top + r)
    balanced = kept > 0.5
    work = fma(2.0 * m, beta, w)
    by_energy = 2.0 * (work - r * (a + top) - 2.0 * zeta * j) / (a + top)
    gain = where(balanced, by_energy, rise.p - p)
    lost = (fade * f + gain + 2.0 * r) / (top + r)
    noise = ROUNDING * where(balanced, 4.0 * work / (a + top), rise.p)
    blunt = ROUNDING * (time + 2.0 * p / v1 + 4.0 * beta / rise.v2)
    early, later = exp(-2.0 * zeta * t1), exp(-2.0 * zeta * (t1 + rise.t2))
    late = magnitude(1.0 - c1) / v1 + rise.s2 / rise.v2 * early * f / v1
    late = late + magnitude(rise.slope3) / (top + r) * later * f / rise.v3
    return HalfSwing(gain, noise, kept, lost, time, comes & rise.comes, late, blunt)


@jit_call
def newton(scene, rtol):
    """The cycle and its verdict: by (3), or in 32 digits where conditioning leaves less than rtol."""
    zeta, r, m, beta, w = scene

    # the least p from which it comes to the lift, or to the zero, is 0, or (r - beta)(1 + 1/E) beyond r; it passes the
    # lift from rest at beta where (beta - r + m)(1 + E) > 2 beta, whose small terms must not be added to beta
    creeps, short = zeta >= 1.0, r > beta
    delta, _ = _ringdown.decrement(where(creeps, 0.5, zeta))
    share = where(creeps, 0.0, exp(-delta[0]))
    never = short & not_(share > 1e-300)
    least = where(short, (r - beta) * (1.0 + 1.0 / where(share > 1e-300, share, 1e-300)), 0.0)
    first = _rise(scene, 0.0 * least)
    passes = not_(beta > 0.0) | ((m - r) * (1.0 + share) > beta * where(creeps, 1.0, -expm1(-delta[0])))
    grows = passes & (not_(short) | (first.p > least))
    swings = grows & not_(never | (creeps & not_(beta > r)))
    low = where(swings, least, 0.0)

    # the start is the a of 2 r a + pi zeta a^2 = work, what light losses tend to
    work = fma(2.0 * m, beta, w)
    guess = 2.0 * work / (2.0 * r + sqrt(4.0 * r * r + 4.0 * math.pi * zeta * work))
    tame = guess < _LARGEST
    guess = guess - beta
    p = where(swings & tame, where(guess > first.p, guess, first.p), 1.0)

    # p where the half swing repeats: Newton's steps, bisections where they leave the bracket
    active, high = swings & tame, 0.0 * p + 1e300
    for _ in range(NEWTON_LIMIT):
        if not any_lane(active):
            break
        swing = half_swing(scene, p)
        up = not_(swing.comes) | (swing.gain > 0.0)
        low, high = where(up, p, low), where(up, high, p)
        new = p + swing.gain / swing.lost
        change = magnitude(new - p)
        inside = swing.comes & (new >= low) & (new <= high)
        new = where(inside, new, where(high < 1e300, 0.5 * (low + high), 2.0 * p))
        settled = inside & ((change <= 1e-9 * p) | (change * swing.lost <= swing.noise))
        p = where(active, new, p)
        active = active & not_(settled)
    swing = half_swing(scene, p)
    a, time, kept = beta + p, swing.time, swing.kept

    # whether amplitude, time and multiplier are accurate to rtol
    error = swing.noise / swing.lost + 2.3e-16 * a
    of_time = (error * swing.late + swing.blunt) / time
    of_kept = 2.0 * zeta * of_time * time + 2.0 * error / ((beta - r) + p)
    of_kept = where(kept > 1e-300, of_kept, 0.0)
    right = (error <= rtol * a) & (of_time <= rtol) & (of_kept <= rtol)

    lost = active | not_(swing.comes)
    verdict = where(lost, NOT_CONVERGED, where(right, OK, INACCURATE))
    poor = swings & tame & (lost | not_(right))
    if any_lane(poor):
        near = where(swing.comes, p, high)
        near = where(poor & (near < _LARGEST), near, 1.0)
        f, t1, s1, _, comes = _first_leg(scene, near)
        rise = _rise(scene, f * s1)
        wanted = poor & comes & rise.comes
        new, found = _driven_refined.refined(scene, near, (t1, rise.t2, rise.t3), wanted)
        a, time, kept = choose(found, new, (a, time, kept))
        verdict = where(found, where(rtol >= ROUNDING, OK, INACCURATE), verdict)
    return Cycle(a, time, kept), where(tame, where(swings, verdict, STICKS), OUT_OF_RANGE)


@jit_call
def closed(scene, rtol):
    """As `newton`, from formulas, where there is an impulse and r = 0, or zeta = 0; NO_METHOD elsewhere."""
    zeta, r, m, beta, w = scene
    lifts, free, smooth = beta > 0.0, not_(zeta > 0.0), not_(r > 0.0)
    r = where(smooth, 1.0, r)

    # an impulse, no viscous damping: a = w/(2 r) > 2 r, T = pi + asin(r/(a - r)) - asin(r/(a + r))
    kick = where(lifts, 1.0, w)
    a_kick, spare = kick / (2.0 * r), fma(-4.0 * r, r, kick) / (2.0 * r)  # a - 2 r
    runs_kick = spare > 0.0
    before = arctan(r / (sqrt(a_kick) * sqrt(where(runs_kick, spare, 1.0))))
    t_kick = math.pi + (before - arctan(r / (sqrt(a_kick) * sqrt(a_kick + 2.0 * r))))

    # a lift, no viscous damping: a = m beta/r, m > r and a + beta > 2 r, T by the half angles of three arcs: about r
    # tan^2 = (a - beta)/(a + beta -+ 2 r), about r - m tan = 2 beta/(v1 + v2)
    m, beta = where(lifts, m, 1.0), where(lifts, beta, 1.0)
    a_lift, p = m * beta / r, beta * ((m - r) / r)
    room = pairs.scaled(pairs.two_sum(m, r), beta)
    room = pairs.add(room, pairs.negative(pairs.scaled(pairs.two_product(r, r), 2.0)))[0] / r  # a + beta - 2 r
    runs_lift = (p > 0.0) & (room > 0.0)
    p, room, wide = where(runs_lift, p, 1.0), where(runs_lift, room, 1.0), a_lift + beta + 2.0 * r
    v1, v2 = sqrt(p) * sqrt(room), sqrt(p) * sqrt(wide)
    t_lift = 2.0 * (arctan(sqrt(p / room)) + arctan(2.0 * beta / (v1 + v2)) + arctan(sqrt(p / wide)))

    # an impulse, no solid friction: a^2 = 2 w exp(-2 zeta acos(zeta)/S)/(1 - E^2), T = pi/S, multiplier E^2,
    # S = sqrt(1 - zeta^2)
    damped = where(zeta < 1.0, zeta, 0.5)
    delta, root = _ringdown.decrement(damped)
    s, arccos = root[0], 2.0 * arctan(root[0] / (1.0 + damped))
    square = 2.0 * w * exp(-2.0 * damped * arccos / s) / -expm1(-2.0 * where(damped > 0.0, delta[0], 1.0))
    a_smooth, kept_smooth = sqrt(square), exp(-2.0 * delta[0]) * (1.0 - 2.0 * delta[1])

    a, time = where(lifts, a_lift, a_kick), where(lifts, t_lift, t_kick)
    kept, runs = where(free, (a - r) / (a + r), kept_smooth), (lifts & runs_lift) | (not_(lifts) & runs_kick)
    a, time = where(free, a, a_smooth), where(free, time, math.pi / s)
    runs = (free & runs) | (not_(free) & (zeta < 1.0))
    known = free | (smooth & not_(lifts))
    return Cycle(a, time, kept), where(known, where(runs, OK, STICKS), NO_METHOD)


@jit
def closed_bound(scene):
    """Rounding where there is a formula, infinite elsewhere."""
    known = not_(scene.zeta > 0.0) | (not_(scene.r > 0.0) & not_(scene.beta > 0.0))
    return where(known, ROUNDING, math.inf)
