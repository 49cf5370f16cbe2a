"""A turning point, where friction may not be smooth.

Drag of a degree that is no whole number has a slope f' that is not smooth at rest, and of a step that begins or ends
there the estimated error is up to 70 times too low, and up to 8 times. So a step is at most a share of the time to
rest, or since, and rest itself is passed without one: below a slow speed w drag is held at what it is there. As in
that short time Y = ln(1 + f(w)/(tau + kappa A + rho)) outwards, and likewise inwards, J of (3) in `_half_swing` with
f(0) + f(w) for f(0) is what J exp(-Y) is with the slope followed to rest.
"""

import math
from typing import NamedTuple

from kernels.foliot._swing_law import Law, Leg, Power, Swing, Terms, accelerations, held_at, pull
from kernels.lanes.jit import jit
from kernels.lanes.records import named
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, where
from kernels.maths.elementary import larger, power, smaller

_NEARER, _FARTHER = 0.8, 3.0
"""Of the time to rest, and of that since rest, which a step may be long: its error is then at most 3 and 8 times the
estimate, in quadrature of a power of the time with exponents from -0.9 to 3."""
_SLOW = 0.01
"""Of the tolerance, what is left out below the slow speed."""


class Turned(NamedTuple):
    """A turning point passed: the state behind it, J, the way and its tangent by v0 there, and the time taken."""

    state: tuple
    jump: float
    top: float
    top_by_start: float
    time: float


@jit
def longest(state, acceleration, law):
    """The longest step, where friction is not smooth at rest: by the time to rest, or since."""
    v, slow = named(Swing, state).v, law.leg.slow
    most = 0.0 * v + math.inf
    if any_lane(slow > 0.0):
        speed, leaving = magnitude(v), v * acceleration > 0.0
        change = where(leaving, _FARTHER * speed, larger(_NEARER * speed, slow))
        most = where(slow > 0.0, change / magnitude(acceleration), most)
    return most


@jit
def slow_speed(tolerance, problem):
    """The speed below which power-law friction may be taken as constant.

    What that leaves out is of the order of speed^(n + 1) and, as accelerations are, of speed^2.
    """
    slow = 0.0 * tolerance
    if any_lane(problem.rough):
        degree = smaller(problem.terms.power.n, 1.0 + slow)
        slow = where(problem.rough, power(_SLOW * tolerance, 1.0 / (1.0 + degree)) / (1.0 + problem.pace), slow)
    return slow


@jit
def _moved(state, sign, steady, time, problem):
    """The state after a time over which accelerations are constant, under the constant force `steady`."""
    x, v, x_mu, v_mu, x_start, v_start, decay = state
    terms = problem.terms
    bare = Terms(terms.drag, Power(0.0 * x, terms.power.n, 0.0 * x), terms.kappa, terms.ripple, terms.scales)
    leg = Leg(sign, steady, 0.0 * x, 0.0 * x, 0.0 * x, 0.0 * x)
    force, by_mu, by_start, slope = accelerations(state, Law(leg, bare))
    half = 0.5 * time
    return (
        fma(time, fma(half, force, v), x),
        fma(time, force, v),
        fma(time, fma(half, by_mu, v_mu), x_mu),
        fma(time, by_mu, v_mu),
        fma(time, fma(half, by_start, v_start), x_start),
        fma(time, by_start, v_start),
        fma(time, slope, decay),
    )


@jit
def turned(state, turns, slow, problem):
    """The state behind the turning point, where tangents' speeds jump by J.

    Power-law friction that is not smooth at rest is constant from the speed of the state to rest, and from there to
    the speed `slow`: J takes both, and with the integral Y outside is what it is without a step through rest.
    """
    zero, v, dry, friction = 0.0 * slow, named(Swing, state).v, problem.dry, problem.terms.power
    still = turns | not_(v < 0.0)
    speed = where(slow > 0.0, larger(v, zero), zero)
    held = held_at(friction, speed)
    braking = dry.outwards + held + pull(named(Swing, state).x, problem.terms) + problem.terms.drag * speed
    before = speed / braking
    top = _moved(state, zero + 1.0, dry.outwards + held, before, problem)
    x, _, x_mu, v_mu, x_start, v_start, decay = top
    force = pull(x, problem.terms)
    free = dry.inwards + force
    speed = where(still & (free > 0.0), slow * smaller(free / dry.inwards, zero + 1.0), zero)
    held_in = held_at(friction, speed)
    goes = free > held_in
    jump = where(turns, (dry.inwards - held_in + force) / (dry.outwards + held + force), 1.0)
    after = where(goes, speed / (free - held_in), 0.0)
    rest = (x, 0.0 * x, x_mu, jump * v_mu, x_start, jump * v_start, decay)
    behind = _moved(rest, zero - 1.0, dry.inwards - held_in, after, problem)
    return Turned(choose(still, behind, state), jump, x, x_start, before + after)
