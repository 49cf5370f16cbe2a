"""A half swing of the general foliot by integration: any friction law, a hairspring, torque that varies over the swing.

In units of phi0 and T0 = sqrt(phi0/mu) the half swing after a switch runs from x = 1, speed v0, to x = -1,
    x'' = -tau(x) - (rho sgn x' + d x' + gamma abs(x')^n sgn x') - kappa x                           (1)
    tau(x) = 1 + depth cos(harmonic pi s),  s = (1 - x)/2                                            (2)
For v0 > 0 it rises to a turning point first. Two tangents of (1) go along, by ln mu (which scales tau alone, with units
held fixed) and by v0, and Y, the integral of the friction's slope f'. Where dry friction changes sign, at the turning
point A, a tangent's speed jumps by
    J = (tau + kappa A - f(0))/(tau + kappa A + f(0)).                                               (3)
Where the motion comes to rest on its way in it is helped, without speed, to the next place where the drive wins over
dry friction.
"""

import math
from typing import NamedTuple

from kernels.integrate.nystrom import integrate_until
from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.records import named
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, sqrt, where
from kernels.maths.elementary import exp, power, sincos

HELP_LIMIT = 1000
"""Places of rest on one half swing; a motion with more is taken for one that does not arrive."""
_SHARE = 0.3
"""Of rtol that a single step may take; the rest is left to their sum."""
_ROUGH_SHARE = 0.03
"""The same for friction whose slope is not smooth at rest, and for torque that varies: errors of v count more there."""
_CAREFUL = 1e-5
"""Of a step, the first after a turning point where f' is not smooth: there the estimate of the error is too low."""
_FORGOTTEN = 40.0
"""Y after which a motion that no force varies along the way is uniform, to exp(-40)."""
_SCAN, _BISECTIONS = 32, 40
_ARRIVED, _ROUNDED = 1e-12, 4e-15
"""How far x may be from the switch for having reached it: so much, and so much of the largest x."""


class Swing(NamedTuple):
    """A state: way and speed, their tangents by ln mu and by v0, and Y."""

    x: float
    v: float
    x_mu: float
    v_mu: float
    x_start: float
    v_start: float
    decay: float


class Power(NamedTuple):
    """Friction gamma abs(x')^n, taken as constant below the speed `floor`."""

    gamma: float
    n: float
    floor: float


class Ripple(NamedTuple):
    """Of the torque, by (2); wave = harmonic pi/2."""

    depth: float
    wave: float


class Scales(NamedTuple):
    """What a step's errors are relative to, at least: of speed, of its tangent by ln mu, of those by v0."""

    speed: float
    weak: float
    pace: float


class Terms(NamedTuple):
    """Of (1), all but dry friction."""

    drag: float
    power: Power
    kappa: float
    ripple: Ripple
    scales: Scales


class Dry(NamedTuple):
    """1 + rho, with which dry friction helps outwards, 1 - rho inwards; power-law friction at rest."""

    outwards: float
    inwards: float
    held: float


class Leg(NamedTuple):
    """From a reversal to the next: sign of the speed, constant force; the Y after which it is uniform, and Y's rate."""

    sign: float
    steady: float
    forgotten: float
    forgetting: float


class Law(NamedTuple):
    """What a right-hand side hangs on beside the state."""

    leg: Leg
    terms: Terms


class Problem(NamedTuple):
    """A cell.

    share : of rtol that a single step may take
    stiffness, pace : f'(V) and 1/V for the speed V at which friction balances the drive, within a factor of 2
    first : step
    """

    e: float
    rho_s: float
    rtol: float
    share: float
    rippled: bool
    dry: Dry
    terms: Terms
    stiffness: float
    pace: float
    first: float


class Half(NamedTuple):
    """A half swing.

    end : speed F at the switch, 0 where it is not reached
    state, leg : at the switch
    top, top_by_start : turning point and its tangent by v0
    time : taken
    shrink : J exp(-Y), 0 where helped
    helped, lost : came to rest on its way in; met the step limit
    """

    end: float
    state: tuple
    leg: Leg
    top: float
    top_by_start: float
    time: float
    shrink: float
    helped: bool
    lost: bool


@jit_call
def _ripple(x, depth, wave):
    """tau(x) - 1 of (2), and its slope."""
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
def _forces(x, v, leg, terms):
    """Force towards the switch with that of friction, tau - 1, and the slopes of the force by x and by v."""
    extra, by_x = 0.0 * x, 0.0 * x
    if any_lane(terms.ripple.depth > 0.0):
        extra, by_x = _ripple(x, terms.ripple.depth, terms.ripple.wave)
    lost, by_v = 0.0 * x, 0.0 * x
    if any_lane(terms.power.gamma > 0.0):
        lost, by_v = _drag(magnitude(v), terms.power.gamma, terms.power.n, terms.power.floor)
    force = fma(terms.kappa, x, leg.steady + extra) + fma(terms.drag, v, leg.sign * lost)
    return force, extra, terms.kappa + by_x, terms.drag + by_v


@jit
def accelerations(state, law):
    """Right-hand side (1), its tangents by ln mu and by v0, and f'."""
    x, v, x_mu, v_mu, x_start, v_start, _ = state
    force, extra, by_x, by_v = _forces(x, v, law.leg, law.terms)
    by_mu = fma(by_x, x_mu, fma(by_v, v_mu, 1.0 + extra))
    return -force, -by_mu, -fma(by_x, x_start, by_v * v_start), by_v


@jit
def _scales(state, law):
    x, v, x_mu, v_mu, x_start, v_start, decay = state
    scales = law.terms.scales
    return (
        1.0 + magnitude(x),
        scales.speed + magnitude(v),
        scales.weak + magnitude(x_mu),
        scales.pace + magnitude(v_mu),
        scales.pace + magnitude(x_start),
        1.0 + magnitude(v_start),
        1.0 + 0.01 * decay,
    )


@jit
def _ends(state, acceleration, law):
    """Falls to 0 where a leg ends, and its rate: the least of speed along the leg, way left to the switch, and memory.

    Outwards the way left is above 2, so that the speed decides: at the turning point. Inwards it is the switch, unless
    the motion comes to rest before, or friction has made it uniform.
    """
    x, v, _, _, _, _, decay = state
    leg = law.leg
    value, rate = leg.sign * v, leg.sign * acceleration
    left = x + 1.0
    value, rate = where(value < left, value, left), where(value < left, rate, v)
    memory = leg.forgotten - decay
    return where(value < memory, value, memory), where(value < memory, rate, -leg.forgetting)


@jit
def pull(x, terms):
    """Force of torque and spring towards the switch, tau + kappa x, less 1."""
    extra = 0.0 * x
    if any_lane(terms.ripple.depth > 0.0):
        extra, _ = _ripple(x, terms.ripple.depth, terms.ripple.wave)
    return fma(terms.kappa, x, extra)


@jit_call
def _released(x, slack, terms):
    """The next place inwards from x where the drive wins over dry friction; -1 where there is none."""
    depth, wave = terms.ripple
    step = 2.0 * math.pi / _SCAN / where(depth > 0.0, wave, math.inf)
    held, free = x, 0.0 * x - 1.0
    searching = depth > 0.0
    for i in range(_SCAN):
        if not any_lane(searching):
            break
        there = x - (i + 1.0) * step
        found = searching & (slack + pull(there, terms) > 0.0)
        held = where(searching & not_(found), there, held)
        free = where(found & (there > -1.0), there, free)
        searching = searching & not_(found)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (held + free)
        wins = slack + pull(middle, terms) > 0.0
        held, free = where(wins, held, middle), where(wins, middle, free)
    return free


@jit
def _turned(state, turns, problem):
    """The state behind the turning point, where tangents' speeds jump by J; and J."""
    x, _, x_mu, v_mu, x_start, v_start, decay = state
    outwards, inwards, held = problem.dry
    force = pull(x, problem.terms)
    jump = where(turns, (inwards - held + force) / (outwards + held + force), 1.0)
    return (x, 0.0 * x, x_mu, jump * v_mu, x_start, jump * v_start, decay), jump


@jit
def _inwards(decay, problem):
    """The leg behind the turning point: dry friction has changed sign."""
    terms = problem.terms
    varied = (terms.kappa > 0.0) | (terms.ripple.depth > 0.0)
    forgotten = where(varied, math.inf, decay + _FORGOTTEN)
    return Leg(0.0 * decay - 1.0, problem.dry.inwards, forgotten, problem.stiffness)


@jit
def _coasted(state, law):
    """The state at the switch after uniform motion, and the time that takes; its speeds are those that friction wants.

    Those of the integration waver about them by its tolerance.
    """
    x, v, x_mu, v_mu, x_start, v_start, decay = state
    force, force_mu, force_start, slope = accelerations(state, law)
    v, v_mu, v_start = v + force / slope, v_mu + force_mu / slope, v_start + force_start / slope
    time = -(x + 1.0) / v
    moved = (fma(time, v_mu, x_mu), v_mu, fma(time, v_start, x_start), v_start, fma(time, slope, decay))
    return (0.0 * x - 1.0, v, *moved), time


@jit
def _to_switch(state, law, inwards):
    """The state of what goes on uniformly inwards, at the switch; and the time from here."""
    uniform = inwards & (named(Swing, state).decay > law.leg.forgotten - 1e-3)
    time = 0.0 * law.leg.sign
    if any_lane(uniform):
        rest, coast = _coasted(state, law)
        state, time = choose(uniform, rest, state), where(uniform, coast, 0.0)
    return state, time


@jit
def _helped(state, leg, stopped, problem, zero):
    """The state and the leg where what has stopped is let go again."""
    if any_lane(stopped):
        slack = problem.dry.inwards - problem.dry.held
        free = _released(named(Swing, state).x, slack, problem.terms)
        state = choose(stopped, (free, zero, zero, zero, zero, zero, zero), state)
        leg = choose(stopped, Leg(zero - 1.0, problem.dry.inwards, zero + math.inf, problem.stiffness), leg)
    return state, leg


@jit_inline
def half_swing(start, problem, tolerance, active):
    """One half swing from x = 1, speed `start`, to the switch."""
    zero, turns = 0.0 * start, problem.e > 0.0
    one = zero + 1.0
    state = (one, start, zero, zero, zero, one, zero)
    moving, rising = active, active & (start > 0.0)
    power = problem.terms.power
    rough = (power.gamma > 0.0) & (power.n < 2.0)
    helped, lost = active & not_(active), active & not_(active)
    behind, jump = _turned(state, turns, problem)
    outwards = Leg(one, problem.dry.outwards, zero + math.inf, problem.stiffness)
    state, leg = choose(rising, state, (one, start, *behind[2:])), choose(rising, outwards, _inwards(zero, problem))
    time, h, top, top_by_start = zero, problem.first, one, zero
    for _ in range(HELP_LIMIT):
        if not any_lane(moving):
            break
        law = Law(leg, problem.terms)
        state, spent, h, late = integrate_until(_ends, accelerations, _scales, state, law, h, tolerance, moving)
        time, lost, moving = time + spent, lost | late, moving & not_(late)
        turning, swing = moving & rising, named(Swing, state)
        top, top_by_start = where(turning, swing.x, top), where(turning, swing.x_start, top_by_start)
        behind, ratio = _turned(state, turns, problem)
        state, jump = choose(turning, behind, state), where(turning, ratio, jump)
        leg = choose(turning, _inwards(swing.decay, problem), leg)
        h = where(turning & rough, _CAREFUL * h, h)
        state, coast = _to_switch(state, Law(leg, problem.terms), moving & not_(rising))
        time = time + coast
        stopped = moving & not_(rising) & (named(Swing, state).x + 1.0 > _ARRIVED + _ROUNDED * top)
        helped, rising = helped | stopped, rising & not_(turning)
        state, leg = _helped(state, leg, stopped, problem, zero)
        moving = turning | (stopped & (named(Swing, state).x > -1.0))
    swing = named(Swing, state)
    end = where(moving | (helped & not_(swing.v < 0.0)), zero, -swing.v)
    return Half(end, state, leg, top, top_by_start, time, where(helped, 0.0, jump * exp(-swing.decay)), helped, lost)


@jit
def _slack(scene):
    """1 - rho, where the scene brings it along without the rounding of rho."""
    if len(scene) > 7:
        return scene[7]
    return 1.0 - scene[1]


@jit
def problem_of(scene, ripple, rtol):
    """The cell's terms.

    Friction of degree 0 is dry, of degree 1 viscous. Of a degree between, the slope at rest is infinite: below a speed
    of 1e-4 rtol of the clock's it is held constant, in friction and in J alike, which leaves their product.
    """
    d, rho, rho_s, gamma, n, kappa, e = scene[:7]
    depth, harmonic = ripple
    slack = _slack(scene)
    dry, viscous = where(n > 0.0, 0.0, gamma), where((n > 0.0) & not_(n < 1.0) & not_(n > 1.0), gamma, 0.0)
    rho, slack, d = rho + dry, slack - dry, d + viscous
    other = dry + viscous < gamma
    gamma, n = where(other, gamma, 0.0), where(other, n, 1.0)
    by_drag, by_power = d / slack, 0.0 * d
    if any_lane(other):
        by_power = where(other, power(gamma / slack, 1.0 / n), 0.0)
    pace = by_drag + by_power
    stiffness = d + n * slack * by_power
    floor = where(n < 1.0, 1e-4 * rtol / (1.0 + pace), 0.0)
    scales = Scales(1.0 / (1.0 + pace), 1.0 / (1.0 + kappa), 1.0 / (1.0 + pace + sqrt(kappa)))
    terms = Terms(d, Power(gamma, n, floor), kappa, Ripple(depth, harmonic * (0.5 * math.pi)), scales)
    rippled = depth > 0.0
    share = where(rippled | ((gamma > 0.0) & (n < 2.0)), _ROUGH_SHARE, _SHARE)
    first = 0.1 / (1.0 + stiffness + sqrt(kappa))
    dry_friction = Dry(1.0 + rho, slack, _held(gamma, n, floor))
    return Problem(e, rho_s, rtol, share, rippled, dry_friction, terms, stiffness, pace, first)


@jit
def _held(gamma, n, floor):
    """Power-law friction at rest: what `_drag` gives below `floor`."""
    held = 0.0 * gamma
    if any_lane(floor > 0.0):
        held = where(floor > 0.0, gamma * power(floor, n), 0.0)
    return held
