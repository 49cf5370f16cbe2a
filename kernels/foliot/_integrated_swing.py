"""The half swing of the general foliot by Runge-Kutta steps, explicit and implicit, for `_limit_cycle`."""

import math

import numpy as np

from kernels.foliot._half_swing import force_on, half_swing, problem_of, rates
from kernels.foliot._limit_cycle import Cell, Found, Manner, found_by, of_columns
from kernels.foliot._units import Outputs, without_dimensions
from kernels.integrate.tableaux import DOPRI5, DOPRI5_ERROR, SDIRK4, SDIRK4_ERROR
from kernels.interface import Status
from kernels.lanes.codes import STEP_LIMIT
from kernels.lanes.columns import in_few_lanes
from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.tuples import after, joined, times
from kernels.lanes.vectors import any_lane, fma, magnitude, not_, where
from kernels.maths.elementary import larger

_STAGE_LIMIT = 12
"""Newton's steps for a stage of the implicit method."""
EXPLICIT, IMPLICIT = (1e4, 1e6), (math.inf, math.inf)
"""Larger f'(V)/V (viscous friction: d^2) takes a stable explicit method more steps than the limit: about 2/3 of it; and
the same where the motion becomes uniform and need not be followed so far."""


@jit
def _worst(state, errors, scales):
    """The largest error over its scale.

    One division in all, for they are dear: the worst error and its scale are compared crosswise.
    """
    speed, weak, pace = scales
    worst, over = 0.0 * speed, 0.0 * speed + 1.0
    least = (over, speed, weak, pace, pace, over, over)
    for j in range(7):
        error, scale = magnitude(errors[j]), least[j] + where(j < 6, 1.0, 0.01) * magnitude(state[j])
        worse = (error * over > worst * scale) | not_(error < math.inf)
        worst, over = where(worse, error, worst), where(worse, scale, over)
    return worst / over


@jit_call
def dopri5_step(state, first, leg, h):
    """One step of Dormand-Prince 5(4) from the rates `first`: state and rates after it, largest error over scale."""
    k1 = rates(after(state, h, DOPRI5[0], (first,)), leg)
    k2 = rates(after(state, h, DOPRI5[1], (first, k1)), leg)
    k3 = rates(after(state, h, DOPRI5[2], (first, k1, k2)), leg)
    k4 = rates(after(state, h, DOPRI5[3], (first, k1, k2, k3)), leg)
    k5 = rates(after(state, h, DOPRI5[4], (first, k1, k2, k3, k4)), leg)
    new = after(state, h, DOPRI5[5], (first, k2, k3, k4, k5))
    last = rates(new, leg)
    errors = after(times(0.0, state), h, DOPRI5_ERROR, (first, k2, k3, k4, k5, last))
    return new, last, _worst(state, errors, leg.scales)


@jit_call
def _stage(base, v, leg, g):
    """The rates k at base + g k, by Newton's method from the speed v; and how far its last step went.

    As x' = v, the speed alone is unknown: v + g force(x_b + g v, v) = v_b. The tangents are linear in theirs.
    """
    x_b, v_b, x_mu, v_mu, x_start, v_start, _ = base
    change, searching = 0.0 * v, g > 0.0
    for _ in range(_STAGE_LIMIT):
        if not any_lane(searching):
            break
        force, _, stiffness, slope = force_on(fma(g, v, x_b), v, leg)
        new = (v - v_b + g * force) / (1.0 + g * fma(g, stiffness, slope))
        change, v = where(searching, new, change), where(searching, v - new, v)
        searching = searching & (magnitude(change) > 1e-14 * magnitude(v))
    _, extra, stiffness, slope = force_on(fma(g, v, x_b), v, leg)
    damped, stiff = 1.0 / (1.0 + g * fma(g, stiffness, slope)), g * stiffness
    of_mu = (v_mu - fma(stiff, x_mu, g * (1.0 + extra))) * damped
    of_start = (v_start - stiff * x_start) * damped
    rise = 1.0 / g
    return (v, (v - v_b) * rise, of_mu, (of_mu - v_mu) * rise, of_start, (of_start - v_start) * rise, slope), change


@jit_call
def sdirk4_step(state, first, leg, h):
    """One step of the L-stable SDIRK of order 4(3) of Hairer & Wanner, Solving ODEs II, table IV.6.5; as `dopri5_step`.

    What relaxes within much less than h is damped away. Its last stage is the result.
    """
    g = 0.25 * h
    k0, c0 = _stage(state, state[1], leg, g)
    k1, c1 = _stage(after(state, h, SDIRK4[0], (k0,)), k0[0], leg, g)
    k2, c2 = _stage(after(state, h, SDIRK4[1], (k0, k1)), k1[0], leg, g)
    k3, c3 = _stage(after(state, h, SDIRK4[2], (k0, k1, k2)), k2[0], leg, g)
    base = after(state, h, SDIRK4[3], (k0, k1, k2, k3))
    k4, c4 = _stage(base, k3[0], leg, g)
    new = after(base, g, (1.0,), (k4,))
    left = larger(larger(magnitude(c0), magnitude(c1)), larger(larger(magnitude(c2), magnitude(c3)), magnitude(c4)))
    errors = after(times(0.0, state), h, SDIRK4_ERROR, (k0, k1, k2, k4))
    errors = joined((errors[0], magnitude(errors[1]) + left), errors[2:])
    return new, k4, _worst(state, errors, leg.scales)


@jit
def dopri5(p, rtol):
    """What a half swing comes to by Dormand-Prince 5(4), each switch located and restarted at."""
    return _swung(dopri5_step, p, rtol)


@jit
def sdirk4(p, rtol):
    """The same by an L-stable implicit method of order 4, for what is stiff."""
    return _swung(sdirk4_step, p, rtol)


@jit_inline
def _swung(step, p, rtol):
    scene, units = without_dimensions(p)
    problem = problem_of(scene, (p.depth, p.harmonic), rtol)
    half = half_swing(step, problem.e * p.v1, problem, p.tolerance, p.v1 >= 0.0)
    found, status = found_by(units, problem, p.v1, half)
    return found, where(half.lost, STEP_LIMIT, status)


def _manner(name, doc, solve, stiffest, rounding):
    found = of_columns(solve, (*Cell._fields, "v1", "tolerance"), (*Found._fields[:-1], *Outputs._fields), in_few_lanes)

    def follow(search, bare):
        return found(*search[: len(Cell._fields)], search.v, search.tolerance, search.rtol)

    def begins(cells, terms):
        mild = terms.stiff <= np.where((terms.kappa > 0.0) | (cells.depth > 0.0), *stiffest)
        return np.where(terms.inwards > 0.0, np.where(mild, Status.OK, Status.STEP_LIMIT), Status.STICKS)

    return Manner(
        name, doc, follow, begins, bare=False, steps=True, coarse=1e-3, orderly=3e-5, least=3e-15, rounding=rounding,
        finer=4.0, shares=(0.3, 0.1, 0.06), told=(4.0, 4.0, 12.0), tighter=0.1,
    )  # fmt: skip


BY_DOPRI5 = _manner("dopri5", "adaptive Runge-Kutta of order 5, Newton on the half-swing map", dopri5, EXPLICIT, 2e-14)
BY_SDIRK4 = _manner("sdirk4", "implicit Runge-Kutta of order 4, L-stable, for stiff cells", sdirk4, IMPLICIT, 8e-14)
