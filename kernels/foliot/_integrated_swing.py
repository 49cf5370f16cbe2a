"""The general foliot's limit cycle by integration: any friction law, a hairspring, torque that varies over the swing.

In units of phi0 and T0 = sqrt(phi0/mu) the half swing after a switch runs from x = 1, speed v0 = e v1, to x = -1,
    x'' = -tau(x) - (rho sgn x' + d x' + gamma abs(x')^n sgn x') - kappa x                           (1)
    tau(x) = 1 + depth cos(harmonic pi s),  s = (1 - x)/2                                            (2)
where it has the speed -F(v1). For e > 0 it rises to a turning point first. The limit cycle is F(v1) = v1, found by
Newton's method. Two tangents of (1) go along, by ln mu (which scales tau alone, with units held fixed) and by v0,
and Y, the integral of the friction's slope f'. An area shrinks along the flow by exp(-Y), and by
    J = (tau + kappa A - f(0))/(tau + kappa A + f(0))                                                (3)
where dry friction changes sign, at the turning point A: there, too, a tangent's speed jumps by J. Hence
    dF/dv1 = e^2 v1/F exp(-Y) J,  s = -dlnP/dlnmu = -(dT/dlnmu + e dT/dv0 dv1/dlnmu)/T.              (4)
The multiplier is dF/dv1 on the cycle. (J = 1 for e <= 0, where nothing turns.)

Existence: a swing that starts faster stays faster at every x and loses more, so v1^2 - F^2 = (1 - e^2) v1^2 - 4 + 2 L
rises with v1 and has one root. Where the motion comes to rest on its way in, F is continued by helping it, without
speed, to the next place where the drive wins over dry friction (F = 0 if there is none). That keeps F continuous and
v1^2 - F^2 rising; so the one root is found, and if help was needed on the cycle there is none: the scene STICKS.
"""

import math

from kernels.integrate.nystrom import integrate_until
from kernels.lanes.codes import INACCURATE, NOT_CONVERGED, OK, STEP_LIMIT, STICKS
from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.vectors import choose, fma, isnt, magnitude, some, sqrt, where
from kernels.maths.elementary import exp, power, sincos

NEWTON_LIMIT = 60
HELP_LIMIT = 1000
"""Places of rest on one half swing; a motion with more is taken for one that does not arrive."""
SMOOTH = (0.0, 0.0)
"""The ripple (depth, harmonic) of a torque that does not vary."""

_STIFFEST = 1e4
"""Larger f'(V)/V (viscous friction: d^2) takes a stable explicit method more steps than the limit: about 2/3 of it."""
_STIFFEST_UNIFORM = 1e6
"""The same where the motion becomes uniform and need not be followed so far."""
_SHARE = 0.3
"""Of rtol that a single step may take; the rest is left to their sum."""
_ROUGH_SHARE = 0.03
"""The same for friction whose slope is not smooth at rest, and for torque that varies: errors of v count more there."""
_CHECK = 4.0
"""The last swing but one has a tolerance so much wider than the last: how far the two differ is the error's measure."""
_COARSE, _ORDERLY = 1e-3, 3e-5
"""Tolerances to begin with, and below which an error falls as the tolerance does."""
_NOISE = 100.0
"""Tolerances within which the sign of F - v may be wrong."""
_FINEST = 3e-15
"""Tolerance of a step that rounding leaves possible."""
_V_ROUNDING = 1e-14
"""Of the speed after a half swing."""
_STEEP_FROM, _STEEP_TO = 1e-8, 0.03
"""Changes of v1 between two swings, near the cycle, whose effect on s is their own, not that of the tolerances."""
_CAREFUL = 1e-5
"""Of a step, the first after a turning point where f' is not smooth: there the estimate of the error is too low."""
_FORGOTTEN = 40.0
"""Y after which a motion that no force varies along the way is uniform, to exp(-40)."""
_SCAN, _BISECTIONS = 32, 40
_ARRIVED, _ROUNDED = 1e-12, 4e-15
"""How far x may be from the switch for having reached it: so much, and so much of the largest x."""


@jit_call
def _ripple(x, depth, wave):
    """tau(x) - 1 of (2), and its slope; wave = harmonic pi/2."""
    sine, cosine = sincos(wave * (1.0 - x))
    return depth * cosine, depth * wave * sine


@jit_call
def _drag(speed, gamma, n, floor):
    """gamma speed^n and its slope, n > 0, taken as constant below the speed `floor`."""
    within = speed > floor
    speed = where(within, speed, floor)
    slope = gamma * power(speed, n - 1.0)
    return slope * speed, where(within, n * slope, 0.0)


@jit
def _forces(x, v, sign, steady, scene):
    """Force towards the switch with that of friction, tau - 1, and the slopes of the force by x and by v."""
    drag, (gamma, n, floor), kappa, (depth, wave), _ = scene
    extra, by_x = 0.0 * x, 0.0 * x
    if some(depth > 0.0):
        extra, by_x = _ripple(x, depth, wave)
    lost, by_v = 0.0 * x, 0.0 * x
    if some(gamma > 0.0):
        lost, by_v = _drag(magnitude(v), gamma, n, floor)
    force = fma(kappa, x, steady + extra) + fma(drag, v, sign * lost)
    return force, extra, kappa + by_x, drag + by_v


@jit
def accelerations(state, scene):
    """Right-hand side (1), its tangents by ln mu and by v0, and f'."""
    x, v, x_mu, v_mu, x_start, v_start, _, sign, steady, _, _ = state
    force, extra, by_x, by_v = _forces(x, v, sign, steady, scene)
    by_mu = fma(by_x, x_mu, fma(by_v, v_mu, 1.0 + extra))
    return -force, -by_mu, -fma(by_x, x_start, by_v * v_start), by_v


@jit
def _scales(state, scene):
    x, v, x_mu, v_mu, x_start, v_start, decay = state[:7]
    speed, weak, pace = scene[4]
    return (
        1.0 + magnitude(x),
        speed + magnitude(v),
        weak + magnitude(x_mu),
        pace + magnitude(v_mu),
        pace + magnitude(x_start),
        1.0 + magnitude(v_start),
        1.0 + 0.01 * decay,
    )


@jit
def _ends(state, acceleration):
    """Falls to 0 where a leg ends, and its rate: the least of speed along the leg, way left to the switch, and memory.

    Outwards the way left is above 2, so that the speed decides: at the turning point. Inwards it is the switch, unless
    the motion comes to rest before, or friction has made it uniform.
    """
    _, v, _, _, _, _, decay, sign, _, forgotten, forgetting = state
    value, rate = sign * v, sign * acceleration
    way = state[0] + 1.0
    value, rate = where(value < way, value, way), where(value < way, rate, v)
    memory = forgotten - decay
    return where(value < memory, value, memory), where(value < memory, rate, -forgetting)


@jit
def _pull(x, scene):
    """Force of torque and spring towards the switch, tau + kappa x, less 1."""
    extra = 0.0 * x
    if some(scene[3][0] > 0.0):
        extra, _ = _ripple(x, *scene[3])
    return fma(scene[2], x, extra)


@jit_call
def _released(x, slack, scene):
    """The next place inwards from x where the drive wins over dry friction; -1 where there is none."""
    depth, wave = scene[3]
    step = 2.0 * math.pi / _SCAN / where(depth > 0.0, wave, math.inf)
    held, free = x, 0.0 * x - 1.0
    searching = depth > 0.0
    for i in range(_SCAN):
        if not some(searching):
            break
        there = x - (i + 1.0) * step
        found = searching & (slack + _pull(there, scene) > 0.0)
        held = where(searching & isnt(found), there, held)
        free = where(found & (there > -1.0), there, free)
        searching = searching & isnt(found)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (held + free)
        wins = slack + _pull(middle, scene) > 0.0
        held, free = where(wins, held, middle), where(wins, middle, free)
    return free


@jit
def _turned(state, turns, dry, scene):
    """The state behind the turning point: dry friction has changed sign, and tangents' speeds jump by J, also given."""
    x, _, x_mu, v_mu, x_start, v_start, decay, _, _, _, forgetting = state
    outwards, inwards, held = dry
    pull = _pull(x, scene)
    jump = where(turns, (inwards - held + pull) / (outwards + held + pull), 1.0)
    zero = 0.0 * x
    varied = (scene[2] > 0.0) | (scene[3][0] > 0.0)
    forgotten = where(varied, math.inf, decay + _FORGOTTEN)
    return (
        x,
        zero,
        x_mu,
        jump * v_mu,
        x_start,
        jump * v_start,
        decay,
        zero - 1.0,
        inwards,
        forgotten,
        forgetting,
    ), jump


@jit
def _coasted(state, scene):
    """The state at the switch after uniform motion, and the time that takes; its speeds are those that friction wants.

    Those of the integration waver about them by its tolerance.
    """
    x, v, x_mu, v_mu, x_start, v_start, decay = state[:7]
    force, force_mu, force_start, slope = accelerations(state, scene)
    v, v_mu, v_start = v + force / slope, v_mu + force_mu / slope, v_start + force_start / slope
    time = -(x + 1.0) / v
    moved = (fma(time, v_mu, x_mu), v_mu, fma(time, v_start, x_start), v_start, fma(time, slope, decay))
    return (0.0 * x - 1.0, v, *moved, *state[7:]), time


@jit_inline
def _half_swing(start, turns, dry, scene, forgetting, first, tolerance, active):
    """One half swing from x = 1, speed `start`, to the switch.

    Returns
    -------
    end : speed F at the switch, 0 where it is not reached
    state : at the switch
    top, top_by_start : turning point and its tangent by v0
    time : taken
    shrink : J exp(-Y)
    helped, lost : came to rest on its way in; met the step limit
    """
    zero = 0.0 * start
    one = zero + 1.0
    outwards, inwards, held = dry
    state = (one, start, zero, zero, zero, one, zero, one, outwards, zero + math.inf, forgetting)
    moving, rising = active, active & (start > 0.0)
    rough = (scene[1][0] > 0.0) & (scene[1][1] < 2.0)
    helped, lost = active & isnt(active), active & isnt(active)
    behind, jump = _turned(state, turns, dry, scene)
    state = choose(rising, state, (one, start, *behind[2:]))
    time, h, top, top_by_start = zero, first, one, zero
    for _ in range(HELP_LIMIT):
        if not some(moving):
            break
        state, leg, h, late = integrate_until(_ends, accelerations, _scales, state, scene, h, tolerance, moving)
        time, lost = time + leg, lost | late
        moving = moving & isnt(late)
        turning = moving & rising
        top, top_by_start = where(turning, state[0], top), where(turning, state[4], top_by_start)
        behind, ratio = _turned(state, turns, dry, scene)
        state, jump = choose(turning, behind, state), where(turning, ratio, jump)
        h = where(turning & rough, _CAREFUL * h, h)
        uniform = moving & isnt(rising) & (state[6] > state[9] - 1e-3)
        if some(uniform):
            rest, coast = _coasted(state, scene)
            state, time = choose(uniform, rest, state), where(uniform, time + coast, time)
        stopped = moving & isnt(rising) & (state[0] + 1.0 > _ARRIVED + _ROUNDED * top)
        helped = helped | stopped
        rising = rising & isnt(turning)
        if some(stopped):
            free = _released(state[0], inwards - held, scene)
            state = choose(
                stopped, (free, zero, zero, zero, zero, zero, zero, -one, inwards, zero + math.inf, forgetting), state
            )
        moving = turning | (stopped & (state[0] > -1.0))
    end = where(moving | (helped & isnt(state[1] < 0.0)), zero, -state[1])
    return end, state, top, top_by_start, time, jump * exp(-state[6]), helped, lost


@jit
def _slack(scene):
    """1 - rho, where the scene brings it along without the rounding of rho."""
    if len(scene) > 7:
        return scene[7]
    return 1.0 - scene[1]


@jit
def _legs(scene, ripple, rtol):
    """What `accelerations` takes outwards, where dry friction helps the drive, and inwards, where it holds against it.

    Friction of degree 0 is dry, of degree 1 viscous. Of a degree between, the slope at rest is infinite: below a speed
    of 1e-4 rtol of the clock's it is held constant, in friction and in J alike, which leaves their product.
    Also the rate of decay f'(V) and V for the speed V at which friction balances the drive, within a factor of 2.
    """
    d, rho, gamma, n, kappa = scene[0], scene[1], scene[3], scene[4], scene[5]
    slack = _slack(scene)
    dry, viscous = where(n > 0.0, 0.0, gamma), where((n > 0.0) & isnt(n < 1.0) & isnt(n > 1.0), gamma, 0.0)
    rho, slack, d = rho + dry, slack - dry, d + viscous
    other = dry + viscous < gamma
    gamma, n = where(other, gamma, 0.0), where(other, n, 1.0)
    by_drag, by_power = d / slack, 0.0 * d
    if some(other):
        by_power = where(other, power(gamma / slack, 1.0 / n), 0.0)
    pace = by_drag + by_power  # 1/V
    stiffness = d + n * slack * by_power
    floor = where(n < 1.0, 1e-4 * rtol / (1.0 + pace), 0.0)
    w = sqrt(kappa)
    scales = (1.0 / (1.0 + pace), 1.0 / (1.0 + kappa), 1.0 / (1.0 + pace + w))
    terms = (d, (gamma, n, floor), kappa, (ripple[0], ripple[1] * (0.5 * math.pi)), scales)
    held = _held(gamma, n, floor)
    return (1.0 + rho, slack, held), terms, pace, stiffness


@jit
def _held(gamma, n, floor):
    """Power-law friction at rest: what `_drag` gives below `floor`."""
    held = 0.0 * gamma
    if some(floor > 0.0):
        held = where(floor > 0.0, gamma * power(floor, n), 0.0)
    return held


@jit
def _larger(x, y):
    return where(x > y, x, y)


@jit
def _smaller(x, y):
    return where(x < y, x, y)


@jit
def _relative(new, old):
    return magnitude(new - old) / (magnitude(new) + 1e-300)


@jit
def _difference(new, old):
    """The largest relative difference between two cycles."""
    worst = _relative(new[0], old[0])
    worst = _larger(worst, _relative(new[1], old[1]))
    worst = _larger(worst, _relative(new[2], old[2]))
    worst = _larger(worst, _relative(new[3], old[3]))
    return _larger(worst, _relative(new[4], old[4]))


@jit
def _enough(share, rtol, slope, decay):
    """Tolerance of a step: an error of the map counts 1/(1 - slope)-fold in v, Y-fold in exp(-Y)."""
    decay = where(decay < 750.0, decay, 0.0)  # beyond, the multiplier is 0 for good
    return _smaller(share * rtol * (1.0 - slope) / (1.0 + decay), _ORDERLY)


@jit
def _newton(v, end, slope, low, high):
    """The next speed: Newton's, or where that leaves the bracket, one that narrows it. Also whether it is Newton's."""
    newton = v + (end - v) / (1.0 - slope)
    newton = _larger(newton, 0.0 * v)
    furthest = 8.0 * v + 8.0
    inside = (newton > low) & (newton < high) & (newton < furthest)
    other = where(high < math.inf, 0.5 * (_larger(low, 0.0 * v) + high), furthest)
    return where(inside, newton, other), inside


@jit
def _cycle(state, end, top, top_by_start, time, shrink, turns, e, slope, new, step, terms):
    """The cycle by (4) from a half swing close to it: time and amplitude follow v1 by its last `step`.

    Also how many times larger than s the terms are that it is the sum of.
    """
    force = accelerations(state, terms)[0]
    time_by_mu, time_by_start = state[2] / end, e * state[4] / end
    end_by_mu = -fma(force, time_by_mu, state[3])
    by_start = time_by_start * (end_by_mu / (1.0 - slope))
    s = -(by_start + time_by_mu) / time
    cancels = (magnitude(by_start) + magnitude(time_by_mu)) / magnitude(s * time)
    amplitude = where(turns, fma(top_by_start, e * step, top), 1.0)
    return (fma(time_by_start, step, time), amplitude, new, s, e * e * shrink), cancels


@jit
def _next_tolerance(tolerance, wanted, relative, slope, steady):
    """Of a swing: following the square of Newton's relative step, but not below what is wanted of the last but one."""
    square = _smaller(0.1 * relative * relative, 0.03 * (1.0 - slope))
    return _larger(_CHECK * wanted, where(steady, _smaller(tolerance, square), tolerance))


@jit_inline
def dopri5(scene, ripple, rtol):
    """The limit cycle.

    Newton's method on v1 within a bracket, first with a coarse tolerance, then with one that follows the square of
    its step, and at last with the wanted one. The last swing but one has `_CHECK` times that; what the last two give
    must agree to 0.3 rtol, or the tolerance is lowered further. A ripple makes s hang on v1 steeply, a thousandfold at
    times: how steeply is told by the steps themselves, and what is left of v1's error is counted so.

    Parameters
    ----------
    scene : (d, rho, rho_s, gamma, n, kappa, e) and, if wanted, 1 - rho, as `_units` gives it
    ripple : (depth, harmonic) of (2), or SMOOTH

    Returns
    -------
    cycle : half period, amplitude, speed before the switch, s, multiplier
    verdict : OK, INACCURATE, STICKS, NOT_CONVERGED or STEP_LIMIT
    """
    rho_s, e = scene[2], scene[6]
    dry, terms, pace, stiffness = _legs(scene, ripple, rtol)
    zero, turns = 0.0 * e, e > 0.0
    possible = dry[1] - dry[2] > 0.0
    rippled = ripple[0] > 0.0
    varied = (terms[2] > 0.0) | rippled
    stiff = isnt(stiffness * pace < where(varied, _STIFFEST, _STIFFEST_UNIFORM))
    share = where(rippled | ((terms[1][0] > 0.0) & (terms[1][1] < 2.0)), _ROUGH_SHARE, _SHARE)
    first = 0.1 / (1.0 + stiffness + sqrt(scene[5]))

    slow = pace > 3.0  # friction soon balances the drive: v1 = V, and steps are short whatever the tolerance
    v = where(slow, 1.0 / pace, 2.0 / sqrt(1.0 + 4.0 * pace * pace))
    tolerance = where(slow, _CHECK * _enough(share, rtol, zero, 2.0 * stiffness * pace), _COARSE)
    low, high, tighter, before, steep = zero - 1.0, zero + math.inf, zero + 1.0, zero + 1.0, zero
    cycle = (zero, zero, zero, zero, zero)
    verdict = where(possible, where(stiff, STEP_LIMIT, NOT_CONVERGED), STICKS)
    active = possible & isnt(stiff)
    for _ in range(NEWTON_LIMIT):
        if not some(active):
            break
        of_step = _larger(tolerance, _FINEST + zero)
        swing = _half_swing(e * v, turns, dry, terms, stiffness, first, of_step, active)
        end, state, top, top_by_start, time, shrink, helped, lost = swing
        shrink = where(helped, 0.0, shrink)
        slope = where(end > 0.0, e * e * v / end * shrink, 0.0)
        noise = _NOISE * of_step * (v + end)
        low, high = where(active & (end - v > noise), v, low), where(active & (v - end > noise), v, high)
        new, newton = _newton(v, end, slope, low, high)
        relative = _relative(new, v)
        found, cancels = _cycle(state, end, top, top_by_start, time, shrink, turns, e, slope, new, new - v, terms)
        apart = _larger(_difference(found, cycle), relative)
        cycle = choose(active, found, cycle)

        wanted = tighter * _enough(share, rtol, slope, state[6])
        last_but_one, last = tolerance <= 1.5 * _CHECK * wanted, tolerance <= 1.5 * wanted
        at_rest = (end <= 0.0) & (v <= 0.0)
        held = (e >= 0.0) & isnt(1.0 + _pull(top, terms) > rho_s)
        stuck = last_but_one & ((helped & (relative <= 0.2 * rtol)) | at_rest)
        telling = rippled & (before > _STEEP_FROM) & (before < _STEEP_TO)
        steep = where(telling, _larger(steep, apart / before), steep)
        settled = last & isnt(helped) & (relative <= 0.2 * rtol) & (apart <= 0.3 * rtol)
        settled = settled & (steep * relative <= 0.3 * rtol)
        at_floor = (wanted < _FINEST) & (tolerance < _FINEST) & isnt(helped) & (relative <= rtol)
        done = active & (settled | stuck | at_floor | lost)
        right = settled & (wanted >= _FINEST) & (_larger(steep, cancels) * _V_ROUNDING <= 0.3 * rtol * (1.0 - slope))
        verdict = where(
            done, where(lost, STEP_LIMIT, where(stuck | held, STICKS, where(right, OK, INACCURATE))), verdict
        )
        active = active & isnt(done)

        loose = last & isnt(helped) & (before < 0.5 * rtol) & isnt(apart <= 0.3 * rtol)
        factor = _larger(_smaller(0.2 * rtol / apart, 0.25 + zero), zero + 1e-3)
        tighter = where(active & loose, tighter * factor, tighter)
        following = _next_tolerance(tolerance, where(loose, 0.25 * wanted, wanted), relative, slope, newton)
        following = where(
            (last_but_one & (relative < 0.5 * rtol)) | at_rest, where(loose, 0.25 * wanted, wanted), following
        )
        v, tolerance = where(active, new, v), where(active, following, tolerance)
        before = where(active, relative, before)
    return cycle, verdict
