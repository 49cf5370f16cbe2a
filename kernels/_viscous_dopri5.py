"""The viscous foliot's limit cycle by integration, as for any friction that has no formula.

In units of phi0 and sqrt(phi0/mu), with d = a sqrt(phi0/mu) = sqrt(k), one half swing runs from x = 1, speed v0,
    x'' = -1 - d x'                                                                                  (1)
over the turning point to x = -1, reached at speed -v1 after a time T. The cycle is the fixed point v1(v0) = v0, found
by Newton's method from rest. Two tangents of (1) go along: by v0, and by ln d. With E = exp(-d T), what the flow
makes of an area, the multiplier is dv1/dv0 = E v0/v1 (on the cycle E), and
    s = -dlnP/dlnmu = (1 + dlnT/dln d)/2,  for P = 2 T sqrt(phi0/mu).                                  (2)
"""

from kernels._jit import jit, jit_call
from kernels._lanes import isnt, magnitude, some, sqrt, where
from kernels._steppers import integrate_until
from kernels._vecmath import exp

NEWTON_LIMIT = 60
_STIFFEST = 1e4
"""Larger k = d^2 would take a stable explicit method more steps than the limit: about 2k/3."""
_SHARE = 0.1
"""Of rtol that a single step may take; the rest is left to their sum."""
_FINEST = 3e-15
"""Tolerance of a step that rounding leaves possible."""


@jit
def accelerations(state, scene):
    """Right-hand side (1) and its two tangents."""
    _, v, _, v_start, _, v_drag = state
    torque, drag = scene
    return torque - drag * v, -drag * v_start, -drag * (v_drag + v)


@jit
def _scales(state, scene):
    x, v, x_start, v_start, x_drag, v_drag = state
    unit = 1.0 / (1.0 + scene[1])  # a speed the scene has in any case
    return (
        1.0 + magnitude(x),
        unit + magnitude(v),
        1.0 + magnitude(x_start),
        1.0 + magnitude(v_start),
        1.0 + magnitude(x_drag),
        unit + magnitude(v_drag),
    )


@jit
def _turning(state, acceleration):
    """Speed, which falls to 0 at the turning point; and its rate."""
    return state[1], acceleration


@jit
def _switching(state, acceleration):
    """Way left to the switch at x = -1; and its rate."""
    return state[0] + 1.0, state[1]


@jit_call
def _half_swing(start, drag, tolerance, active):
    """Turning point, speed v1, time T, dT/dv0, dv1/dlnd and dT/dlnd of (1), and cells that met the step limit."""
    zero = 0.0 * start
    scene = (-1.0, drag)
    state = (zero + 1.0, start, zero, zero + 1.0, zero, zero)
    first = 0.1 / (1.0 + drag)
    rising = active & (start > 0.0)
    state, rise, h, lost = integrate_until(_turning, accelerations, _scales, state, scene, first, tolerance, rising)
    top = state[0]
    state, fall, _, late = integrate_until(_switching, accelerations, _scales, state, scene, h, tolerance, active)
    _, v, x_start, _, x_drag, v_drag = state
    time_by_drag = -x_drag / v
    speed_by_drag = -(v_drag + accelerations(state, scene)[0] * time_by_drag)
    return top, -v, rise + fall, -x_start / v, speed_by_drag, time_by_drag, lost | late


@jit
def _enough(k, rtol, v, multiplier, time):
    """Tolerance of a step: an error of the map counts 1/(1 - multiplier)-fold in v, d T-fold in exp(-d T)."""
    exponent = sqrt(k) * time
    exponent = where(exponent < 750.0, exponent, 0.0)  # beyond, the multiplier is 0 for good
    return _SHARE * rtol * (1.0 - multiplier) / (1.0 + exponent)


@jit
def dopri5(k, rtol):
    """The cycle; cells that met the step limit; cells that did not settle; cells whose rounding exceeds rtol."""
    drag = sqrt(k)
    stiff = isnt(k < _STIFFEST)
    active = isnt(stiff) & (k > 0.0)
    unfinished = stiff
    v = 0.0 * k
    tolerance = 0.01 * rtol
    top, period, sensitivity = v, v, v
    for _ in range(NEWTON_LIMIT):
        if not some(active):
            break
        step_tolerance = where(tolerance > _FINEST, tolerance, _FINEST)
        swing = _half_swing(v, drag, step_tolerance, active)
        turning, end, time, time_by_start, end_by_drag, time_by_drag, lost = swing
        slope = exp(-drag * time) * v / end
        step = (end - v) / (1.0 - slope)
        change = time_by_drag + time_by_start * end_by_drag / (1.0 - slope)
        top = where(active, turning, top)
        period = where(active, time + time_by_start * step, period)
        sensitivity = where(active, 0.5 + 0.5 * change / time, sensitivity)
        wanted = _enough(k, rtol, v, slope, time)
        settled = (magnitude(step) <= 0.1 * rtol * v) & (tolerance <= 2.0 * wanted)
        v = where(active, v + step, v)
        tolerance = where(active, wanted, tolerance)
        unfinished = unfinished | (active & lost)
        active = active & isnt(settled | lost)
    q = 0.5 * drag * period
    decay = exp(-2.0 * q)
    return (q, drag * v, top, sensitivity, decay), unfinished, active, tolerance < _FINEST
