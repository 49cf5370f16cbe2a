"""The general foliot's limit cycle by integration of half swings (`_half_swing`, whose equations are meant here).

A half swing that starts with v0 = e v1 after the switch ends with the speed -F(v1). The limit cycle is F(v1) = v1,
found by Newton's method. An area shrinks along the flow by exp(-Y), and by J of (3) at the turning point, hence
    dF/dv1 = e^2 v1/F exp(-Y) J,  s = -dlnP/dlnmu = -(dT/dlnmu + e dT/dv0 dv1/dlnmu)/T.              (4)
The multiplier is dF/dv1 on the cycle. (J = 1 for e <= 0, where nothing turns.)

Existence: a swing that starts faster stays faster at every x and loses more, so v1^2 - F^2 = (1 - e^2) v1^2 - 4 + 2 L
rises with v1 and has one root. Where the motion comes to rest on its way in, F is continued by helping it, without
speed, to the next place where the drive wins over dry friction (F = 0 if there is none). That keeps F continuous and
v1^2 - F^2 rising; so the one root is found, and if help was needed on the cycle there is none: the scene STICKS.
"""

import math

from kernels.foliot._half_swing import force_on, half_swing, problem_of, pull, rates
from kernels.foliot._units import given, without_dimensions
from kernels.integrate.tableaux import DOPRI5, DOPRI5_ERROR, SDIRK4, SDIRK4_ERROR
from kernels.lanes.codes import INACCURATE, NOT_CONVERGED, OK, STEP_LIMIT, STICKS
from kernels.lanes.columns import in_few_lanes
from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.symbols import symbolic
from kernels.lanes.tuples import after, joined, times
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, sqrt, where
from kernels.lanes.wiring import method
from kernels.maths.elementary import larger, smaller

NEWTON_LIMIT, _STAGE_LIMIT = 60, 12
"""Newton's steps on the map of a half swing, and for a stage of the implicit method."""
EXPLICIT, IMPLICIT = (1e4, 1e6), (math.inf, math.inf)
"""Larger f'(V)/V (viscous friction: d^2) takes a stable explicit method more steps than the limit: about 2/3 of it; and
the same where the motion becomes uniform and need not be followed so far."""
_CHECK = 4.0
"""The last swing but one has a tolerance so much wider than the last: how far the two differ is the error's measure."""
_COARSE, _ORDERLY, _FINEST = 1e-3, 3e-5, 3e-15
"""Tolerances to begin with, below which an error falls as the tolerance does, and which rounding leaves possible."""
_NOISE = 100.0
"""Tolerances within which the sign of F - v may be wrong."""
_V_ROUNDING = 1e-14
"""Of the speed after a half swing."""
_CANCELS, _STEEP = 0.3, 0.2
"""Of how many times the terms of s are larger than s where friction is not smooth, and of how steeply s hangs on v1, by
which tolerances are finer: two of them may differ by less than either is off."""
_STEEP_FROM, _STEEP_TO = 1e-8, 0.03
"""Changes of v1 between two swings, near the cycle, whose effect on s is their own, not that of the tolerances."""


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
def _relative(new, old):
    return magnitude(new - old) / (magnitude(new) + 1e-300)


@jit
def _enough(problem, slope, decay):
    """Tolerance of a step: an error of the map counts 1/(1 - slope)-fold in v, Y-fold in exp(-Y)."""
    decay = where(decay < 750.0, decay, 0.0)  # beyond, the multiplier is 0 for good
    return smaller(problem.share * problem.rtol * (1.0 - slope) / (1.0 + decay), _ORDERLY)


@jit
def first_speed(pace):
    """Where Newton's method begins, and whether friction soon balances the drive: v1 = V."""
    slow = pace > 3.0
    return where(slow, 1.0 / pace, 2.0 / sqrt(1.0 + 4.0 * pace * pace)), slow


@jit
def newton(e, v, half):
    """dF/dv1, and Newton's step of v1."""
    slope = where(half.end > 0.0, e * e * v / half.end * half.shrink, 0.0)
    return slope, (half.end - v) / (1.0 - slope)


@jit
def cycle_by(e, half, new, change, slope):
    """The cycle by (4) from a half swing close to it: time and amplitude follow v1 by its last `change`, to `new`.

    Also how many times larger than s the terms are that it is the sum of.
    """
    _, _, x_mu, v_mu, x_start, _, _ = half.state
    time_by_mu, time_by_start = x_mu / half.end, e * x_start / half.end
    end_by_mu = -fma(half.rate, time_by_mu, v_mu)
    by_start = time_by_start * (end_by_mu / (1.0 - slope))
    s = -(by_start + time_by_mu) / half.time
    cancels = (magnitude(by_start) + magnitude(time_by_mu)) / magnitude(s * half.time)
    amplitude = where(e > 0.0, fma(half.top_by_start, e * change, half.top), 1.0)
    return (fma(time_by_start, change, half.time), amplitude, new, s, e * e * half.shrink), cancels


@jit
def held(problem, force):
    """Whether stiction holds the turning point, where `pull` is that force."""
    return (problem.e >= 0.0) & not_(1.0 + force > problem.rho_s)


@jit_inline
def limit_cycle(step, stiffest, rippled, rtol):
    """The limit cycle.

    Newton's method on v1 within a bracket, first with a coarse tolerance, then with one that follows the square of
    its step, and at last with the wanted one. The last swing but one has `_CHECK` times that; what the last two give
    must agree to 0.3 rtol, or the tolerance is lowered further. A ripple makes s hang on v1 steeply, a thousandfold at
    times: how steeply the steps themselves tell, and what is left of v1's error is counted so.

    `step` is `dopri5_step` or `sdirk4_step`, `stiffest` EXPLICIT or IMPLICIT, and `rippled` a `_units.Scene` with
    (depth, harmonic) of (2). It returns a `_units.Cycle` as a plain tuple, and the verdict.
    """
    problem = problem_of(*rippled, rtol)
    zero, one, stiff = 0.0 * problem.e, 0.0 * problem.e + 1.0, problem.stiffness * problem.pace
    v, slow = first_speed(problem.pace)
    tolerance = where(slow, _CHECK * _enough(problem, zero, 2.0 * stiff), _COARSE)  # steps are short whatever it is
    varied = (problem.kappa > 0.0) | (problem.depth > 0.0)
    stiff = not_(stiff <= where(varied, stiffest[0], stiffest[1]))
    low, high, tighter, before, steep = zero - 1.0, zero + math.inf, one, one, zero
    possible = problem.inwards > 0.0
    cycle = (zero, zero, zero, zero, zero)
    verdict = where(possible, where(stiff, STEP_LIMIT, NOT_CONVERGED), STICKS)
    active = possible & not_(stiff)
    for _ in range(NEWTON_LIMIT):
        if not any_lane(active):
            break
        used = larger(tolerance, _FINEST + zero)
        half = half_swing(step, problem.e * v, problem, used, active)

        # Newton's speed, or where that leaves the bracket, told by the sign of F - v, one that narrows it
        noise = _NOISE * used * (v + half.end)
        low = where(active & (half.end - v > noise), v, low)
        high = where(active & (v - half.end > noise), v, high)
        slope, change = newton(problem.e, v, half)
        new, furthest = larger(v + change, zero), 8.0 * v + 8.0
        own = (new > low) & (new < high) & (new < furthest)
        new = where(own, new, where(high < math.inf, 0.5 * (larger(low, zero) + high), furthest))
        relative = _relative(new, v)
        found, cancels = cycle_by(problem.e, half, new, new - v, slope)

        # how far this swing and the one before are apart, and how steeply the cycle hangs on v1 by all that tell
        apart = _relative(found[0], cycle[0])
        for j in range(1, 5):
            apart = larger(apart, _relative(found[j], cycle[j]))
        apart = larger(apart, relative)
        cycle = choose(active, found, cycle)
        telling = (problem.depth > 0.0) & (before > _STEEP_FROM) & (before < _STEEP_TO)
        steep = where(telling, larger(steep, apart / before), steep)

        # the tolerance that is wanted, and whether it was that of this swing and the one before
        free = not_(half.helped)
        finer = where(problem.rough & free & (half.end > 0.0), larger(_CANCELS * cancels, 1.0 + 0.0 * cancels), 1.0)
        finer = larger(finer, _STEEP * steep)
        wanted = tighter * _enough(problem, slope, half.state[6]) / finer
        last_but_one, last = tolerance <= 1.5 * _CHECK * wanted, tolerance <= 1.5 * wanted

        # what is done: both agree, it is at rest or sticks, rounding leaves no more, or the swing took too many steps
        at_rest = (half.end <= 0.0) & (v <= 0.0)
        stuck = last_but_one & ((half.helped & (relative <= 0.2 * rtol)) | at_rest)
        agree = (relative <= 0.2 * rtol) & (apart <= 0.3 * rtol) & (steep * relative <= 0.3 * rtol)
        settled = last & free & agree
        at_floor = (wanted < _FINEST) & (tolerance < _FINEST) & free & (relative <= larger(rtol, _V_ROUNDING + zero))
        blur = larger(steep, cancels) * _V_ROUNDING
        right = settled & (wanted >= _FINEST) & (blur <= 0.3 * rtol * (1.0 - slope))
        sticks = stuck | held(problem, pull(half.top, problem))
        status = where(half.lost, STEP_LIMIT, where(sticks, STICKS, where(right, OK, INACCURATE)))
        done = active & (settled | stuck | at_floor | half.lost)
        verdict, active = where(done, status, verdict), active & not_(done)

        # the next swing: its tolerance follows the square of the step, but not below what is wanted of the last but one
        loose = last & free & (before < 0.5 * rtol) & not_(apart <= 0.3 * rtol)
        factor = larger(smaller(0.2 * rtol / apart, 0.25 + zero), zero + 1e-3)
        aim = where(loose, 0.25 * wanted, wanted)
        square = smaller(0.1 * relative * relative, 0.03 * (1.0 - slope))
        following = larger(_CHECK * aim, where(own, smaller(tolerance, square), tolerance))
        following = where((last_but_one & (relative < 0.5 * rtol)) | at_rest, aim, following)
        v, tolerance = where(active, new, v), where(active, following, tolerance)
        tighter, before = where(active & loose, tighter * factor, tighter), where(active, relative, before)
    return cycle, verdict


@jit
def dopri5(rippled, rtol):
    """Dormand-Prince 5(4) over half swings, each switch located and restarted at, and Newton on their map."""
    return limit_cycle(dopri5_step, EXPLICIT, rippled, rtol)


@jit
def sdirk4(rippled, rtol):
    """The same by an L-stable implicit method of order 4, for what is stiff."""
    return limit_cycle(sdirk4_step, IMPLICIT, rippled, rtol)


@symbolic
def _taken(p):
    """The scene and its ripple (depth, harmonic), 0 of a record without, and its units."""
    scene, units = without_dimensions(p)
    return (scene, (p.depth, p.harmonic) if hasattr(p, "depth") else (0.0, 0.0)), units


def by_steps(sooner=None):
    """Both as methods of a kernel, `sooner` of the first."""
    explicit = "adaptive Runge-Kutta of order 5, Newton on the half-swing map"
    implicit = "implicit Runge-Kutta of order 4, L-stable, for stiff cells"
    return (
        method("dopri5", explicit, dopri5, units=(_taken, given), loop=in_few_lanes, sooner=sooner),
        method("sdirk4", implicit, sdirk4, units=(_taken, given), loop=in_few_lanes),
    )
