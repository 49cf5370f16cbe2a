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

from kernels.foliot._swing_law import Law, Leg, Power, Swing, Terms, accelerations, held_at, pull
from kernels.foliot._turning import longest, slow_speed, turned
from kernels.integrate.nystrom import integrate_until
from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.records import named
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, where
from kernels.maths.elementary import exp, smaller

HELP_LIMIT = 1000
"""Places of rest on one half swing; a motion with more is taken for one that does not arrive."""
_FORGOTTEN = 40.0
"""Y after which a motion that no force varies along the way is uniform, to exp(-40)."""
_SCAN, _BISECTIONS = 32, 40
_ARRIVED, _ROUNDED = 1e-12, 4e-15
"""How far x may be from the switch for having reached it: so much, and so much of the largest x."""


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
    value, rate = leg.sign * v - leg.stop, leg.sign * acceleration
    left = x + 1.0
    value, rate = where(value < left, value, left), where(value < left, rate, v)
    memory = leg.forgotten - decay
    return where(value < memory, value, memory), where(value < memory, rate, -leg.forgetting)


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
def _inwards(decay, slow, problem):
    """The leg behind the turning point: dry friction has changed sign."""
    terms = problem.terms
    varied = (terms.kappa > 0.0) | (terms.ripple.depth > 0.0)
    forgotten = where(varied, math.inf, decay + _FORGOTTEN)
    return Leg(0.0 * decay - 1.0, problem.dry.inwards, forgotten, problem.stiffness, 0.0 * decay, slow)


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
def _helped(state, leg, stopped, terms, problem):
    """The state and the leg where what has stopped is let go again."""
    if any_lane(stopped):
        zero = 0.0 * leg.sign
        slack = problem.dry.inwards - held_at(terms.power, terms.power.floor)
        free = _released(named(Swing, state).x, slack, problem.terms)
        state = choose(stopped, (free, zero, zero, zero, zero, zero, zero), state)
        again = Leg(zero - 1.0, problem.dry.inwards, zero + math.inf, problem.stiffness, zero, leg.slow)
        leg = choose(stopped, again, leg)
    return state, leg


@jit
def _lowered(terms, slow, start):
    """The terms, with a floor of power-law friction below the slow speed and that with which the half swing begins."""
    drag, friction, kappa, ripple, scales = terms
    speed = magnitude(start)
    least = 0.25 * where(speed > 0.0, smaller(slow, speed), slow)
    power = Power(friction.gamma, friction.n, smaller(friction.floor, least))
    return Terms(drag, power, kappa, ripple, scales)


@jit_inline
def half_swing(start, problem, tolerance, active):
    """One half swing from x = 1, speed `start`, to the switch."""
    zero, turns = 0.0 * start, problem.e > 0.0
    one = zero + 1.0
    state = (one, start, zero, zero, zero, one, zero)
    moving, rising = active, active & (start > 0.0)
    slow = slow_speed(tolerance, problem)
    terms = _lowered(problem.terms, slow, start)
    helped, lost = active & not_(active), active & not_(active)
    behind, jump, top, top_by_start, time = turned(state, turns, slow, problem)
    stop = smaller(slow, 0.5 * start)
    outwards = Leg(one, problem.dry.outwards, zero + math.inf, problem.stiffness, stop, slow)
    state, leg = choose(rising, state, behind), choose(rising, outwards, _inwards(zero, slow, problem))
    time, h, top, top_by_start = where(rising, 0.0, time), problem.first, one, zero
    for _ in range(HELP_LIMIT):
        if not any_lane(moving):
            break
        law = Law(leg, terms)
        state, spent, h, late = integrate_until(
            _ends, accelerations, _scales, longest, state, law, h, tolerance, moving
        )
        time, lost, moving = time + spent, lost | late, moving & not_(late)
        turning, swing = moving & rising, named(Swing, state)
        passed = turned(state, turns, slow, problem)
        top, top_by_start = where(turning, passed.top, top), where(turning, passed.top_by_start, top_by_start)
        state, jump = choose(turning, passed.state, state), where(turning, passed.jump, jump)
        time = where(turning, time + passed.time, time)
        leg = choose(turning, _inwards(swing.decay, slow, problem), leg)
        state, coast = _to_switch(state, Law(leg, terms), moving & not_(rising))
        time = time + coast
        stopped = moving & not_(rising) & (named(Swing, state).x + 1.0 > _ARRIVED + _ROUNDED * top)
        helped, rising = helped | stopped, rising & not_(turning)
        state, leg = _helped(state, leg, stopped, terms, problem)
        moving = turning | (stopped & (named(Swing, state).x > -1.0))
    swing = named(Swing, state)
    end = where(moving | (helped & not_(swing.v < 0.0)), zero, -swing.v)
    return Half(end, state, leg, top, top_by_start, time, where(helped, 0.0, jump * exp(-swing.decay)), helped, lost)
