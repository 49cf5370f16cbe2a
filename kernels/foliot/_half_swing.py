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

Drag of a degree that is no whole number has a slope f' that is not smooth at rest, and of a step that begins or ends
there the estimated error is up to 70 times too low, and up to 8 times. So a step is at most a share of the time to
rest, or since, and rest itself is passed without one: below slow speeds, w outwards and w' inwards, drag is held at
what it is there, so that accelerations are constant,
    outwards w/t = tau + kappa x + rho + d w + gamma w^n,  inwards w'/t' = tau + kappa A - rho - gamma w'^n.      (4)
In that short time drag adds Y = ln(1 + gamma w^n/(tau + kappa A + rho)) outwards, and likewise inwards. The slope
followed to rest is then J exp(-Y), where drag is added to the dry friction of (3):
    J = (tau + kappa A - rho - gamma w'^n)/(tau + kappa A + rho + gamma w^n).                        (5)
"""

import math
from collections import namedtuple

from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.symbols import symbolic
from kernels.lanes.tuples import after
from kernels.lanes.vectors import any_lane, choose, exponent, fma, magnitude, nearest, not_, pow2, sqrt, where
from kernels.maths.elementary import LN2, exp, larger, power, sincos, smaller

HELP_LIMIT, STEP_LIMIT, _ROOT_LIMIT = 1000, 10_000, 60
"""Places of rest on one half swing, and steps of a leg, after which a cell is given up; trials for the end of a leg."""
_SETTLED = 1e-9
"""Newton's step for the end of a leg, over the whole one, after which the next is the last."""
_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 5.0
_SMOOTHER = 4.0
"""Degree of drag from which a step that begins or ends at rest has an error below its estimate."""
_FLOOR = 1e-4
"""Of rtol and the clock's speed: the speed below which drag of a degree below 1 is constant."""
_FORGOTTEN = 40.0
"""Y after which a motion that no force varies along the way is uniform, to exp(-40)."""
_SCAN, _BISECTIONS = 32, 40
_ARRIVED, _ROUNDED = 1e-12, 4e-15
"""How far x may be from the switch for having reached it: so much, so much of the largest x, and what is left open of
the time that the last step takes."""
_CLEARLY = 0.01
"""Of the hairspring, what is missing at the switch so that no rounding and no tolerance brings the motion there."""
_NEARER, _FARTHER = 0.8, 3.0
"""Of the time to rest, and of that since, which a step may be long: its error is then at most 3 and 8 times the
estimate, in quadrature of a power of the time with exponents from -0.9 to 3."""
_SLOW = 0.01
"""Of the tolerance, what is left out below the slow speed."""

Problem = namedtuple("Problem", "e rho_s outwards inwards d gamma n kappa depth wave floor rough stiffness pace")
"""A cell by the terms of (1) and (2).

outwards, inwards : 1 + rho, with which dry friction helps, and 1 - rho; wave = harmonic pi/2
floor : speed below which power-law friction is constant
rough : whether friction's slope is not smooth at rest
stiffness, pace : f'(V) and 1/V for the speed V at which friction balances the drive, within a factor of 2
"""

Leg = namedtuple("Leg", "side steady floor problem stop forgotten slow scales")
"""The motion from a reversal to the next.

side, steady, floor, problem : of the right-hand side of (1), the sign of the speed, the constant force, the speed below
    which power-law friction is constant, and the terms
stop, forgotten : what ends it: the speed along it, and Y
slow : the speed above which power-law friction is not smooth, 0 if it is
scales : what errors are relative to, at least: of speed, of its tangent by ln mu, of those by v0
"""

Half = namedtuple("Half", "end state rate top time shrink helped lost")
"""A half swing: the speed F at the switch, 0 where it is not reached, and (x, v, x_mu, v_mu, x_start, v_start, Y)
there, with tangents by ln mu and by v0; x'' there; the turning point; the time; J exp(-Y), 0 where helped; and whether
it came to rest on its way in, or met the step limit."""


@jit
def problem_of(scene, ripple, rtol):
    """The cell's terms. Friction of degree 1 is viscous; that of a degree below, whose slope at rest is infinite, is
    constant below the floor."""
    d, rho, rho_s, gamma, n, kappa, e, slack = scene
    depth, harmonic = ripple
    linear = not_(n < 1.0) & not_(n > 1.0)
    d, gamma = d + where(linear, gamma, 0.0), where(linear, 0.0, gamma)
    by_power = 0.0 * d
    if any_lane(gamma > 0.0):
        by_power = where(gamma > 0.0, power(gamma / slack, 1.0 / n), 0.0)
    pace = d / slack + by_power
    whole = not_(nearest(n) > n) & not_(nearest(n) < n)
    rough = (gamma > 0.0) & (n < _SMOOTHER) & not_(whole)
    return Problem(
        e, rho_s, 1.0 + rho, slack, d, gamma, n, kappa, depth, harmonic * (0.5 * math.pi),
        floor=where(n < 1.0, _FLOOR * rtol / (1.0 + pace), 0.0),
        rough=rough, stiffness=d + n * slack * by_power, pace=pace,
    )  # fmt: skip


@jit_call
def _ripple(x, depth, wave):
    """tau(x) - 1 of (2), and its slope."""
    sine, cosine = sincos(wave * (1.0 - x))
    return depth * cosine, depth * wave * sine


@jit
def pull(x, problem):
    """Force of torque and spring towards the switch, tau + kappa x, less 1."""
    extra = 0.0 * x
    if any_lane(problem.depth > 0.0):
        extra, _ = _ripple(x, problem.depth, problem.wave)
    return fma(problem.kappa, x, extra)


@jit
def _held_at(problem, speed):
    """Power-law friction at a speed, 0 at rest."""
    held = 0.0 * speed
    if any_lane((problem.gamma > 0.0) & (speed > 0.0)):
        held = where(speed > 0.0, problem.gamma * power(speed, problem.n), 0.0)
    return held


@jit
def force_on(x, v, leg):
    """Force towards the switch with that of friction; tau - 1; the slopes of the force by x and by v."""
    problem, (extra, by_x, lost, by_v) = leg.problem, (0.0 * x, 0.0 * x, 0.0 * x, 0.0 * x)
    if any_lane(problem.depth > 0.0):
        extra, by_x = _ripple(x, problem.depth, problem.wave)
    if any_lane(problem.gamma > 0.0):
        within, speed = magnitude(v) > leg.floor, larger(magnitude(v), leg.floor)
        slope = problem.gamma * power(speed, problem.n - 1.0)
        lost, by_v = slope * speed, where(within, problem.n * slope, 0.0)
    force = fma(problem.kappa, x, leg.steady + extra) + fma(problem.d, v, leg.side * lost)
    return force, extra, problem.kappa + by_x, problem.d + by_v


@jit
def rates(state, leg):
    """(1), its tangents, and f'."""
    x, v, x_mu, v_mu, x_start, v_start, _ = state
    force, extra, stiffness, slope = force_on(x, v, leg)
    by_mu = fma(stiffness, x_mu, fma(slope, v_mu, 1.0 + extra))
    return v, -force, v_mu, -by_mu, v_start, -fma(stiffness, x_start, slope * v_start), slope


@jit
def inwards(problem, floor):
    """The leg behind the turning point, but for what ends it."""
    none = 0.0 * floor
    return Leg(none - 1.0, problem.inwards, floor, problem, none, none, none, (none, none, none))


@jit
def _left(state, acceleration, leg):
    """Falls to 0 where a leg ends, and its rate: the least of speed along the leg, way left to the switch, and memory.

    Outwards the way left is above 2, so that the speed decides: at the turning point. Inwards it is the switch, unless
    the motion comes to rest before, or friction has made it uniform.
    """
    x, v, decay = state[0], state[1], state[6]
    value, rate = leg.side * v - leg.stop, leg.side * acceleration
    way = x + 1.0
    value, rate = where(value < way, value, way), where(value < way, rate, v)
    memory = leg.forgotten - decay
    return where(value < memory, value, memory), where(value < memory, rate, -leg.problem.stiffness)


@jit
def _longest(v, acceleration, leg):
    """The longest step, where friction is not smooth at rest: by the time to rest, or since."""
    most = 0.0 * v + math.inf
    if any_lane(leg.slow > 0.0):
        speed, leaving = magnitude(v), v * acceleration > 0.0
        change = where(leaving, _FARTHER * speed, larger(_NEARER * speed, leg.slow))
        most = where(leg.slow > 0.0, change / magnitude(acceleration), most)
    return most


@jit_inline
def _to_end(step, state, leg, h, tolerance, active):
    """The active cells at the end of their leg, the time taken, the last whole step, and where it is not reached.

    The step across the end is shortened until it ends there: Newton, bisection where that leaves the bracket. Each
    trial is a whole Runge-Kutta step from the same state, so the root has the order of the method.
    """
    moving, t, first = active, 0.0 * h, rates(state, leg)
    h = smaller(h, _longest(state[1], first[1], leg))
    for _ in range(STEP_LIMIT):
        if not any_lane(moving):
            break
        new, last, error = step(state, first, leg, h)
        ratio = error / tolerance
        accepted = moving & (ratio <= 1.0)

        # at the end, or where a hairspring takes more than torque and dry friction have to give on the way to the
        # switch, (x + 1)(1 - rho + kappa (x - 1)/2) without a ripple, so that what creeps need not be followed
        x, v, kappa = new[0], new[1], leg.problem.kappa
        energy = fma(0.5 * v, v, (x + 1.0) * fma(0.5 * kappa, x - 1.0, leg.steady))
        held_back = (leg.side < 0.0) & not_(leg.problem.depth > 0.0) & (energy < -_CLEARLY * kappa)
        passed = accepted & ((_left(new, 0.0, leg)[0] <= 0.0) | held_back)
        moving = moving & not_(passed)
        accepted = accepted & moving
        state, first, t = choose(accepted, (new, last, t + h), (state, first, t))
        most = where(accepted, _longest(new[1], last[1], leg), h)

        # the next step: 0.9 ratio^(-1/5) of this one, from 0.2 to 5
        ratio = where(ratio < 1e6, ratio, 1e6)  # NaN too: the step overflowed
        ratio = where(ratio > 1e-6, ratio, 1e-6)
        e = exponent(ratio)
        m = ratio * pow2(-e) - 1.0
        log2_ratio = e + m * (4.0 / 3.0 - m * (1.0 / 3.0))  # within 0.01
        factor = larger(_SAFETY * exp(-0.2 * LN2 * log2_ratio), _SHRINK + 0.0 * ratio)
        h = where(moving, smaller(h * smaller(factor, _GROW + 0.0 * ratio), most), h)

    low, high, shorter = 0.0 * h, h, 0.5 * h
    new, last, _ = step(state, first, leg, shorter)
    searching = active
    for _ in range(_ROOT_LIMIT):
        if not any_lane(searching):
            break
        value, rate = _left(new, last[1], leg)
        low, high = where(value > 0.0, shorter, low), where(value > 0.0, high, shorter)
        guess = shorter - value / rate
        settled = magnitude(guess - shorter) <= _SETTLED * h
        guess = where(settled | ((guess > low) & (guess < high)), guess, 0.5 * (low + high))
        shorter = where(searching, guess, shorter)
        trial, rates_there, _ = step(state, first, leg, shorter)
        new, last = choose(searching, (trial, rates_there), (new, last))
        searching = searching & not_(settled)
    return choose(active, new, state), t + where(active, shorter, 0.0), h, moving


@symbolic
def _moved(state, leg, steady, time):
    """The state after a time over which accelerations are constant, under the constant force `steady`, without drag."""
    bare = leg.problem._replace(gamma=0.0 * leg.problem.gamma)
    rate = rates(state, leg._replace(steady=steady, problem=bare))
    halfway = after(state, 0.5 * time, (1.0,), (rate,))
    (_, a, _, a_mu, _, a_start, slope), (_, v, _, v_mu, _, v_start, _) = rate, halfway
    return after(state, time, (1.0,), ((v, a, v_mu, a_mu, v_start, a_start, slope),))


@jit
def _turned(state, time, leg, slow):
    """The state behind the turning point by (4), J, the turning point, and the time.

    Power-law friction that is not smooth at rest is constant from the speed of the state to rest, and from there to
    the speed `slow`.
    """
    zero, v, problem, turns = 0.0 * slow, state[1], leg.problem, leg.problem.e > 0.0
    still = turns | not_(v < 0.0)
    speed = where(slow > 0.0, larger(v, zero), zero)
    held = _held_at(problem, speed)
    before = speed / (problem.outwards + held + pull(state[0], problem) + problem.d * speed)
    x, _, x_mu, v_mu, x_start, v_start, decay = _moved(state, leg, problem.outwards + held, before)

    force = pull(x, problem)
    free = problem.inwards + force
    speed = where(still & (free > 0.0), slow * smaller(free / problem.inwards, zero + 1.0), zero)
    held_in = _held_at(problem, speed)
    jump = where(turns, (problem.inwards - held_in + force) / (problem.outwards + held + force), 1.0)
    after_rest = where(free > held_in, speed / (free - held_in), 0.0)
    rest = (x, 0.0 * x, x_mu, jump * v_mu, x_start, jump * v_start, decay)
    behind = _moved(rest, leg, problem.inwards - held_in, after_rest)
    return choose(still, behind, state), jump, x, time + (before + after_rest)


@jit_call
def _released(x, slack, problem):
    """The next place inwards from x where the drive wins over dry friction; -1 where there is none."""
    step = 2.0 * math.pi / _SCAN / where(problem.depth > 0.0, problem.wave, math.inf)
    held, free = x, 0.0 * x - 1.0
    searching = problem.depth > 0.0
    for i in range(_SCAN):
        if not any_lane(searching):
            break
        there = x - (i + 1.0) * step
        found = searching & (slack + pull(there, problem) > 0.0)
        held = where(searching & not_(found), there, held)
        free = where(found & (there > -1.0), there, free)
        searching = searching & not_(found)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (held + free)
        wins = slack + pull(middle, problem) > 0.0
        held, free = where(wins, held, middle), where(wins, middle, free)
    return free


@jit_inline
def half_swing(step, start, problem, tolerance, active):
    """One half swing from x = 1, speed `start`, to the switch.

    In turn: past the turning point, along a leg, and where that ends short of the switch either uniformly on to it or,
    from rest, to where the drive wins again.
    """
    zero, one = 0.0 * start, 0.0 * start + 1.0
    root = sqrt(problem.kappa)
    scales = 1.0 / (1.0 + problem.pace), 1.0 / (1.0 + problem.kappa), 1.0 / (1.0 + problem.pace + root)

    # power-law friction may be constant below the slow speed: what that leaves out is of the order of speed^(n + 1)
    # and, as accelerations are, of speed^2; it has a floor below that and below the speed of the beginning
    slow = zero
    if any_lane(problem.rough):
        degree = smaller(problem.n, one)
        slow = where(problem.rough, power(_SLOW * tolerance, 1.0 / (1.0 + degree)) / (1.0 + problem.pace), slow)
    speed = magnitude(start)
    floor = smaller(problem.floor, 0.25 * where(speed > 0.0, smaller(slow, speed), slow))

    state, time, h = (one, start, zero, zero, zero, one, zero), zero, 0.1 / (1.0 + problem.stiffness + root)
    moving, rising = active, active & (start > 0.0)
    turning, helped, lost = active & not_(rising), active & not_(active), active & not_(active)
    top, jump, forgotten = one, one, zero + math.inf
    varied = (problem.kappa > 0.0) | (problem.depth > 0.0)
    falling = inwards(problem, floor)
    for _ in range(HELP_LIMIT):
        if not any_lane(moving):
            break
        # past the turning point
        forgotten = where(turning & not_(varied), state[6] + _FORGOTTEN, forgotten)
        turned, old = _turned(state, time, falling, slow), (state, jump, top, time)
        state, jump, top, time = choose(turning, turned, old)

        # along a leg, to where it ends
        side, steady = where(rising, 1.0, falling.side), where(rising, problem.outwards, problem.inwards)
        stop = where(rising, smaller(slow, 0.5 * start), zero)
        leg = Leg(side, steady, floor, problem, stop, forgotten, slow, scales)
        state, spent, h, late = _to_end(step, state, leg, h, tolerance, moving)
        time, lost, moving = time + spent, lost | late, moving & not_(late)
        turning, inward = moving & rising, moving & not_(rising)
        rising = rising & not_(turning)

        # uniformly to the switch, at speeds that friction wants: those of the integration waver about them
        uniform = inward & (state[6] > forgotten - 1e-3)
        if any_lane(uniform):
            x, v, x_mu, v_mu, x_start, v_start, decay = state
            _, force, _, force_mu, _, force_start, slope = rates(state, falling)
            v, v_mu, v_start = v + force / slope, v_mu + force_mu / slope, v_start + force_start / slope
            coast = -(x + 1.0) / v
            moved = (fma(coast, v_mu, x_mu), v_mu, fma(coast, v_start, x_start), v_start, fma(coast, slope, decay))
            at_switch = (zero - 1.0, v, *moved)
            state, time = choose(uniform, (at_switch, time + coast), (state, time))

        # or from rest, helped, to where the drive wins again
        near = fma(_ROUNDED, top, _ARRIVED) + _SETTLED * magnitude(h * state[1])
        stopped = inward & (state[0] + 1.0 > near)
        if any_lane(stopped):
            free = _released(state[0], problem.inwards - _held_at(problem, floor), problem)
            state = choose(stopped, (free, zero, zero, zero, zero, zero, zero), state)
            forgotten, helped = where(stopped, math.inf, forgotten), helped | stopped
        moving = turning | (stopped & (state[0] > -1.0))
    v, rate = state[1], rates(state, inwards(problem, problem.floor))[1]
    end = where(moving | (helped & not_(v < 0.0)), zero, -v)
    shrink = where(helped, 0.0, jump * exp(-state[6]))
    return Half(end, state, rate, top, time, shrink, helped, lost)
