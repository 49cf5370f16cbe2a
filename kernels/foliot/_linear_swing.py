"""The half swing of a foliot with linear terms only, and its limit cycle: exact pieces of `linear_flow`.

    x'' = -torque - d x' - rho sgn x' - kappa x,  beta = d/2                                         (1)
From the switch at x = +1 with speed u the mass first rises (leg 1, only for u > 0) to the turning point A, then falls
(leg 2) to x = -1, where it arrives with speed v:
    A = 1 + u S1 - g1 C1,  g1 = torque + rho + kappa;  A + 1 = g2 C2,  v = g2 S2,  g2 = torque - rho + kappa A.   (2)
With E = v^2/2 the half swing maps E_0 to E_1. The phase area gives its slope, the work its increase,
    dE_1/dE_0 = exp(-d T) g2/(torque + rho + kappa A),                                               (3)
    E_1 - E_0 = 2 torque - 2 rho A - d (J1 + J2),  J = integral of v^2 over a leg.                    (4)
The loss on the right of (4) grows strictly with the swing, so there is one limit cycle where a start from rest at the
switch comes through, and none elsewhere.
A speed wrong by the share r is an energy wrong by v^2 r. A half swing passes on (3) of it, and adds what rounding
moves in forces (over the way they act) and in speeds:
    v_1^2 r_1 = (dE_1/dE_0) v_0^2 r_0 + noise,  dT = abs(dT/dv_0) v_0 r_0 + ROUNDING (T + way/v_1).  (5)
Units and records: see `_units`. Derived here.
"""

import math
from collections import namedtuple

from kernels.foliot._units import Cycle, errors
from kernels.integrate import linear_flow
from kernels.lanes.codes import NO_METHOD, NOT_CONVERGED, NOT_SELF_STARTING, OK, STICKS
from kernels.lanes.jit import jit, jit_apart, jit_call
from kernels.lanes.vectors import fma, magnitude, sqrt, where
from kernels.maths.elementary import exp, expm1, larger
from kernels.maths.roots import in_bracket

NEWTON_LIMIT = 100
"""Newton steps or bisections on the map of E; about eight are usual."""
_ULPS = 4.5e-16
"""Relative error of the terms that s is summed of in the end: found up to 2.4e-16 of their own terms."""
_STIFFEST = 1e60
"""Viscous friction d beyond which its powers leave float64."""
ROUNDING = 2e-15
"""Relative error of one half swing: of time, amplitude, speed and of the terms of (4)."""

Legs = namedtuple("Legs", "time top speed comes t1 s1 c1 slope1 g1 t2 s2 c2 g2 down back end")
"""A half swing: until the switch, largest x, speed there, whether it comes; and each leg.

Leg 1 rises, for the time t1, against the force g1, which is `back` in the end; leg 2 falls under g2, beginning with the
speed `down`, with the acceleration `end` in the end. s, c and slope are the responses of `linear_flow` over a leg.
"""


@jit_call
def half_swing(more, scene, start):
    """From x = 1 with speed `start`, outward if positive, else inward, to x = -1, by a torque of 1 + more."""
    kappa, beta = scene.kappa, 0.5 * scene.d
    up = where(start > 0.0, start, 0.0)
    g1 = (1.0 + more) + scene.rho + kappa
    t1 = linear_flow.first_reversal(beta, kappa, where(up > 0.0, up, 1.0), -g1)
    t1 = where(up > 0.0, t1, 0.0)
    s1, c1, slope1 = linear_flow.response(beta, kappa, t1)
    rise = fma(up, s1, -g1 * c1)
    top = 1.0 + rise
    down = where(start < 0.0, -start, 0.0)
    g2 = more + scene.slack + kappa * top
    t2 = linear_flow.first_crossing(beta, kappa, down, g2, 2.0 + rise)
    comes = t2 < 1e300
    t2 = where(comes, t2, 0.0)
    s2, c2, slope2 = linear_flow.response(beta, kappa, t2)
    speed = fma(down, slope2, g2 * s2)
    back, end = 1.0 + scene.rho + kappa * top, fma(g2, slope2, -down * fma(scene.d, slope2, kappa * s2))
    return Legs(t1 + t2, top, speed, comes, t1, s1, c1, slope1, g1, t2, s2, c2, g2, down, back, end)


@jit_apart
def passed_on(scene, start, speed, legs):
    """dE_1/dE_0 of a half swing from the speed `start` to `speed`; dT by abs(start), the size of its terms; the noise.

    By (3), and for e > 0 by (2), with d for a change by that of the speed:
        dA = S1,  dt1 = S1'/back,  dg2 = kappa dA,  dt2 = (dA - C2 dg2)/v.
    The noise is what rounding adds to E_1 and to the time.
    """
    rises, back, push = scene.e > 0.0, legs.back, scene.kappa * legs.s1
    kept = exp(-scene.d * legs.time) * where(rises, legs.g2 / back, 1.0)
    longer = where(rises, legs.slope1 / back + (legs.s1 - legs.c2 * push) / speed, -legs.s2 / speed)
    of_push = scene.kappa * magnitude(legs.s1)
    rising = magnitude(legs.slope1) / back + (magnitude(legs.s1) + magnitude(legs.c2) * of_push) / speed
    way = 1.0 + legs.top
    energy = 0.5 * (speed * speed + start * start) + way * magnitude(legs.end)
    late = ROUNDING * (legs.time + way / speed)
    return kept, longer, where(rises, rising, magnitude(legs.s2) / speed), ROUNDING * energy, late


@jit
def _lost(scene, legs):
    """1 minus e^2 times dE_1/dE_0, with its digits where that is small."""
    e = scene.e
    shrink = where(e > 0.0, 2.0 * scene.rho / legs.back, 0.0)  # 1 - g2/back
    kept = -expm1(-scene.d * legs.time)
    return (1.0 - e) * (1.0 + e) + e * e * (kept + (1.0 - kept) * shrink)


@jit_apart
def _turn(scene, energy):
    """E_1 - E of a half swing from the energy E before the switch, its noise, if by (4), and the half swing.

    A difference of speeds where the swing forgets its start (weak drive), and the balance (4) where it hardly changes
    (strong drive), with leg 1 taken backwards from its turning point.
    """
    d, e, kappa = scene.d, scene.e, scene.kappa
    legs = half_swing(0.0, scene, e * sqrt(2.0 * energy))
    back, g2 = legs.back, legs.g2
    after = 0.5 * legs.speed * legs.speed
    balanced = (after > 2.0) & (e > 0.0)
    risen, fallen = linear_flow.loss(-0.5 * d, kappa, legs.t1), linear_flow.loss(0.5 * d, kappa, legs.t2)
    losses = d * (back * back * risen + g2 * g2 * fallen)
    work = 2.0 - 2.0 * scene.rho * legs.top - losses - (1.0 - e) * (1.0 + e) * energy
    noise = ROUNDING * where(balanced, 4.0, after + energy + (1.0 + legs.top) * magnitude(legs.end))
    return where(balanced, work, after - energy), noise, balanced, legs


@jit
def _gain(energy, scene):
    """Whether a half swing gains energy, Newton's step to where it repeats, and the one that is the last.

    Where it sticks the search ends.
    """
    gain, noise, _, legs = _turn(scene, energy)
    lost = _lost(scene, legs)
    near = larger(1e-10 * energy, noise / lost)
    return gain > 0.0, gain / lost, where(legs.comes, near, -1.0)


@jit_apart
def segments(scene, rtol):
    """The cycle, the relative errors of its outputs whatever rtol, the half swing on it, and the verdict.

    s = -dlnP/dlnmu is of the fixed point E_1(E, mu) = E. With d for a change by that of mu alone, at the same start,
    and g for the push behind the turning point, (2) gives
        dA = -C1,  dt1 = -S1/back,  dg = kappa dA + 1,  dt2 = (dA - C2 dg)/v,  dv = S2 dg + v' dt2,  (6)
    where dA = dt1 = 0 for e < 0; with E_1 = v^2/2 or by (4),
        dE_1 = v dv,  or  2 - 2 rho dA - d (dJ1 + dJ2),                                             (7)
        dJ1 = 2 back (J1/back^2) dg + u^2 dt1,  dJ2 = 2 g2 (J2/g2^2) dg + v^2 dt2.
    E itself changes by dE = dE_1/(1 - e^2 dE_1/dE_0), and the start by e dE/sqrt(2 E), hence
        s = -(dt1 + dt2 + dT/dv_0 e dE/sqrt(2 E))/T.                                                (8)
    What is called of_... is the sum of the magnitudes of a change's terms, by which it rounds.
    """
    d, rho, kappa, rises = scene.d, scene.rho, scene.kappa, scene.e > 0.0
    # the energy before the switch, by Newton from rest: a half swing's gain falls with E, which makes a bracket
    zero = 0.0 * d
    energy, active = in_bracket(_gain, zero, zero, zero + 1e308, zero < 1.0, scene, NEWTON_LIMIT, -1.0)
    _, noise, balanced, legs = _turn(scene, energy)
    lost, end, time = _lost(scene, legs), legs.end, legs.time
    speed = sqrt(2.0 * energy)  # that of the half swing has lost digits where most of the energy is the hairspring's
    start = magnitude(scene.e) * speed

    # (6) and (7): what the torque changes of both legs and of their losses, and so of E_1
    dtop, dt1 = where(rises, -legs.c1, 0.0), where(rises, -legs.s1 / legs.back, 0.0)
    of_top, of_t1 = magnitude(dtop), magnitude(dt1)
    dg, of_g = fma(kappa, dtop, 1.0), fma(kappa, of_top, 1.0)
    dt2, of_t2 = (dtop - legs.c2 * dg) / speed, (of_top + magnitude(legs.c2) * of_g) / speed
    dspeed, of_speed = fma(legs.s2, dg, end * dt2), magnitude(legs.s2) * of_g + magnitude(end) * of_t2
    by_g1 = 2.0 * legs.back * linear_flow.loss(-0.5 * d, kappa, legs.t1)
    by_g2 = 2.0 * legs.g2 * linear_flow.loss(0.5 * d, kappa, legs.t2)
    losses = by_g1 * dg + start * start * dt1 + (by_g2 * dg + speed * speed * dt2)
    of_losses = magnitude(by_g1 + by_g2) * of_g + start * start * of_t1 + speed * speed * of_t2
    work, of_work = 2.0 - 2.0 * rho * dtop - d * losses, 2.0 + 2.0 * rho * of_top + d * of_losses
    gain, of_gain = where(balanced, work, speed * dspeed), where(balanced, of_work, speed * of_speed)

    # (8); and dlnT/dlnE
    area, by_start, of_start, _, _ = passed_on(scene, start, speed, legs)
    by_gain = magnitude(scene.e) / speed / lost
    chain, longer = by_start * (by_gain * gain), dt1 + dt2
    of_chain = magnitude(by_start) * (by_gain * of_gain) + of_start * (by_gain * magnitude(gain))
    s, terms = -(longer + chain) / time, (magnitude(longer) + magnitude(chain)) / time
    of_terms, by_energy = (of_t1 + of_t2 + of_chain) / time, 0.5 * start * magnitude(by_start) / time

    # what the noise of the energy and the rounding of pieces leave of each output
    of_energy, of_pieces = noise / (lost * energy), 1.0 + (1.0 + legs.top) / (speed * time)
    loose = fma(ROUNDING, of_pieces, of_energy)
    loose_cycle = fma(ROUNDING, of_pieces, of_energy * where(by_energy > 1.0, by_energy, 1.0))
    loose_s = fma(2.0 * loose, terms, _ULPS * of_terms) / magnitude(s)
    loose_s = where(loose_s < 1.0, loose_s / (1.0 - loose_s), math.inf)  # of the true s
    of_time = fma(of_energy, by_energy, 0.3 * ROUNDING * of_pieces)
    loose_m = loose_cycle + where(area > 0.0, of_time * d * time, 0.0)

    # whether the half swing comes through, and what else keeps the foliot from it; from rest at x = 0, too
    starts = linear_flow.reach(0.5 * d, kappa, zero, scene.slack) > 1.0
    verdict = where((scene.rho_s < 1.0) & starts, OK, NOT_SELF_STARTING)
    verdict = where(active, NOT_CONVERGED, verdict)
    passes = (scene.e < 0.0) | (1.0 + kappa * legs.top > scene.rho_s)  # nothing rests where e < 0
    verdict = where(legs.comes & (energy > 0.0) & passes, verdict, STICKS)
    verdict = where(d < _STIFFEST, verdict, NO_METHOD)
    cycle = Cycle(time, legs.top, speed, s, scene.e * scene.e * area)
    return cycle, errors(loose_cycle, loose_s, loose_m), legs, verdict
