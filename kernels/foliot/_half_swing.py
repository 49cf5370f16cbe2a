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
rest, or since, and rest itself is passed without one: below a slow speed w drag is held at what it is there. As in
that short time Y = ln(1 + f(w)/(tau + kappa A + rho)) outwards, and likewise inwards, (3) with f(0) + f(w) for f(0) is
what J exp(-Y) is with the slope followed to rest.
"""

import math
from collections import namedtuple

from kernels.integrate.tableaux import DOPRI5, DOPRI5_ERROR
from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.symbols import symbolic
from kernels.lanes.tuples import after, joined, times
from kernels.lanes.vectors import any_lane, choose, exponent, fma, magnitude, nearest, not_, pow2, sqrt, where
from kernels.maths.elementary import LN2, exp, larger, power, sincos, smaller
from kernels.maths.roots import bisected

SDIRK4 = (
    (1 / 2,),
    (17 / 50, -1 / 25),
    (371 / 1360, -137 / 2720, 15 / 544),
    (25 / 24, -49 / 48, 125 / 16, -85 / 12),
)
"""Stages 1 to 4 from all before, beside 1/4 of their own."""
SDIRK4_ERROR = (-3 / 16, -27 / 32, 25 / 32, 1 / 4)
"""Of stages 0, 1, 2 and 4."""
HELP_LIMIT, STEP_LIMIT = 1000, 10_000
"""Places of rest on one half swing, and steps of a leg, after which a cell is given up."""
_ROOT_LIMIT, _SETTLED = 60, 1e-9
"""Trials for the end of a leg; Newton's step, over the whole one, after which the next is the last."""
_STAGE_LIMIT = 12
"""Newton's steps for a stage of an implicit method."""
_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 5.0
_SHARE, _ROUGH_SHARE, _SHARP_SHARE = 0.3, 0.1, 0.03
"""Of rtol that a single step may take; the same for friction whose slope is not smooth at rest, where estimates of the
error are too low; and where its degree is below 2 or torque varies: errors of v count more there."""
_SMOOTHER = 4.0
"""Degree of drag from which a step that begins or ends at rest has an error below its estimate."""
_FLOOR = 1e-4
"""Of rtol and the clock's speed: the speed below which drag of a degree below 1 is constant."""
_FORGOTTEN = 40.0
"""Y after which a motion that no force varies along the way is uniform, to exp(-40)."""
_SCAN, _BISECTIONS = 32, 40
_ARRIVED, _ROUNDED = 1e-12, 4e-15
"""How far x may be from the switch for having reached it: so much, and so much of the largest x."""
_CLEARLY = 0.01
"""Of the hairspring, what is missing at the switch so that no rounding and no tolerance brings the motion there."""
_NEARER, _FARTHER = 0.8, 3.0
"""Of the time to rest, and of that since, which a step may be long: its error is then at most 3 and 8 times the
estimate, in quadrature of a power of the time with exponents from -0.9 to 3."""
_SLOW = 0.01
"""Of the tolerance, what is left out below the slow speed."""

Problem = namedtuple(
    "Problem", "e rho_s outwards inwards d gamma n kappa depth wave rtol floor share rough stiffness pace"
)
"""A cell by the terms of (1) and (2).

outwards, inwards : 1 + rho, with which dry friction helps, and 1 - rho; wave = harmonic pi/2
floor : speed below which power-law friction is constant
share : of rtol that a single step may take; rough: whether friction's slope is not smooth at rest
stiffness, pace : f'(V) and 1/V for the speed V at which friction balances the drive, within a factor of 2
"""

Law = namedtuple("Law", "side steady floor problem")
"""The right-hand side of (1) from a reversal to the next: sign of the speed, constant force, terms, and the speed below
which power-law friction is constant."""

Leg = namedtuple("Leg", "stop forgotten slow scales")
"""What ends a leg and bounds its steps: speed along it and Y at its end, and the speed above which power-law friction
is not smooth, 0 if it is; what errors are relative to, at least: of speed, of its tangent by ln mu, of those by v0."""

Half = namedtuple("Half", "end state rate top top_by_start time shrink helped lost")
"""A half swing: the speed F at the switch, 0 where it is not reached, and (x, v, x_mu, v_mu, x_start, v_start, Y)
there, with tangents by ln mu and by v0; x'' there; the turning point and its tangent by v0; the time; J exp(-Y), 0
where helped; and whether it came to rest on its way in, or met the step limit."""


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
        e, rho_s, 1.0 + rho, slack, d, gamma, n, kappa, depth, harmonic * (0.5 * math.pi), rtol,
        floor=where(n < 1.0, _FLOOR * rtol / (1.0 + pace), 0.0),
        share=where((depth > 0.0) | ((gamma > 0.0) & (n < 2.0)), _SHARP_SHARE, where(rough, _ROUGH_SHARE, _SHARE)),
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
def _force(x, v, law):
    """Force towards the switch with that of friction; tau - 1; the slopes of the force by x and by v."""
    problem, (extra, by_x, lost, by_v) = law.problem, (0.0 * x, 0.0 * x, 0.0 * x, 0.0 * x)
    if any_lane(problem.depth > 0.0):
        extra, by_x = _ripple(x, problem.depth, problem.wave)
    if any_lane(problem.gamma > 0.0):
        within, speed = magnitude(v) > law.floor, larger(magnitude(v), law.floor)
        slope = problem.gamma * power(speed, problem.n - 1.0)
        lost, by_v = slope * speed, where(within, problem.n * slope, 0.0)
    force = fma(problem.kappa, x, law.steady + extra) + fma(problem.d, v, law.side * lost)
    return force, extra, problem.kappa + by_x, problem.d + by_v


@jit
def rates(state, law):
    """(1), its tangents, and f'."""
    x, v, x_mu, v_mu, x_start, v_start, _ = state
    force, extra, stiffness, slope = _force(x, v, law)
    by_mu = fma(stiffness, x_mu, fma(slope, v_mu, 1.0 + extra))
    return v, -force, v_mu, -by_mu, v_start, -fma(stiffness, x_start, slope * v_start), slope


@jit
def inwards(problem, floor):
    """The law of the leg behind the turning point."""
    return Law(0.0 * floor - 1.0, problem.inwards, floor, problem)


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
def dopri5_step(state, first, law, h, scales):
    """One step of Dormand-Prince 5(4) from the rates `first`: state and rates after it, largest error over scale."""
    k1 = rates(after(state, h, DOPRI5[0], (first,)), law)
    k2 = rates(after(state, h, DOPRI5[1], (first, k1)), law)
    k3 = rates(after(state, h, DOPRI5[2], (first, k1, k2)), law)
    k4 = rates(after(state, h, DOPRI5[3], (first, k1, k2, k3)), law)
    k5 = rates(after(state, h, DOPRI5[4], (first, k1, k2, k3, k4)), law)
    new = after(state, h, DOPRI5[5], (first, k2, k3, k4, k5))
    last = rates(new, law)
    errors = after(times(0.0, state), h, DOPRI5_ERROR, (first, k2, k3, k4, k5, last))
    return new, last, _worst(state, errors, scales)


@jit_call
def _stage(base, v, law, g):
    """The rates k at base + g k, by Newton's method from the speed v; and how far its last step went.

    As x' = v, the speed alone is unknown: v + g force(x_b + g v, v) = v_b. The tangents are linear in theirs.
    """
    x_b, v_b, x_mu, v_mu, x_start, v_start, _ = base
    change, searching = 0.0 * v, g > 0.0
    for _ in range(_STAGE_LIMIT):
        if not any_lane(searching):
            break
        force, _, stiffness, slope = _force(fma(g, v, x_b), v, law)
        new = (v - v_b + g * force) / (1.0 + g * fma(g, stiffness, slope))
        change, v = where(searching, new, change), where(searching, v - new, v)
        searching = searching & (magnitude(change) > 1e-14 * magnitude(v))
    _, extra, stiffness, slope = _force(fma(g, v, x_b), v, law)
    damped, stiff = 1.0 / (1.0 + g * fma(g, stiffness, slope)), g * stiffness
    of_mu = (v_mu - fma(stiff, x_mu, g * (1.0 + extra))) * damped
    of_start = (v_start - stiff * x_start) * damped
    rise = 1.0 / g
    return (v, (v - v_b) * rise, of_mu, (of_mu - v_mu) * rise, of_start, (of_start - v_start) * rise, slope), change


@jit_call
def sdirk4_step(state, first, law, h, scales):
    """One step of the L-stable SDIRK of order 4(3) of Hairer & Wanner, Solving ODEs II, table IV.6.5; as `dopri5_step`.

    What relaxes within much less than h is damped away. Its last stage is the result.
    """
    g = 0.25 * h
    k0, c0 = _stage(state, state[1], law, g)
    k1, c1 = _stage(after(state, h, SDIRK4[0], (k0,)), k0[0], law, g)
    k2, c2 = _stage(after(state, h, SDIRK4[1], (k0, k1)), k1[0], law, g)
    k3, c3 = _stage(after(state, h, SDIRK4[2], (k0, k1, k2)), k2[0], law, g)
    base = after(state, h, SDIRK4[3], (k0, k1, k2, k3))
    k4, c4 = _stage(base, k3[0], law, g)
    new = after(base, g, (1.0,), (k4,))
    left = larger(larger(magnitude(c0), magnitude(c1)), larger(larger(magnitude(c2), magnitude(c3)), magnitude(c4)))
    errors = after(times(0.0, state), h, SDIRK4_ERROR, (k0, k1, k2, k4))
    errors = joined((errors[0], magnitude(errors[1]) + left), errors[2:])
    return new, k4, _worst(state, errors, scales)


@jit
def _left(state, acceleration, law, leg):
    """Falls to 0 where a leg ends, and its rate: the least of speed along the leg, way left to the switch, and memory.

    Outwards the way left is above 2, so that the speed decides: at the turning point. Inwards it is the switch, unless
    the motion comes to rest before, or friction has made it uniform.
    """
    x, v, decay = state[0], state[1], state[6]
    value, rate = law.side * v - leg.stop, law.side * acceleration
    way = x + 1.0
    value, rate = where(value < way, value, way), where(value < way, rate, v)
    memory = leg.forgotten - decay
    return where(value < memory, value, memory), where(value < memory, rate, -law.problem.stiffness)


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
def _to_end(step, state, law, leg, h, tolerance, active):
    """The active cells at the end of their leg, the time taken, the last whole step, and where it is not reached.

    The step across the end is shortened until it ends there: Newton, bisection where that leaves the bracket. Each
    trial is a whole Runge-Kutta step from the same state, so the root has the order of the method.
    """
    moving, t, first = active, 0.0 * h, rates(state, law)
    h = smaller(h, _longest(state[1], first[1], leg))
    for _ in range(STEP_LIMIT):
        if not any_lane(moving):
            break
        new, last, error = step(state, first, law, h, leg.scales)
        ratio = error / tolerance
        accepted = moving & (ratio <= 1.0)

        # at the end, or where a hairspring takes more than torque and dry friction have to give on the way to the
        # switch, (x + 1)(1 - rho + kappa (x - 1)/2) without a ripple, so that what creeps need not be followed
        x, v, kappa = new[0], new[1], law.problem.kappa
        energy = fma(0.5 * v, v, (x + 1.0) * fma(0.5 * kappa, x - 1.0, law.steady))
        held_back = (law.side < 0.0) & not_(law.problem.depth > 0.0) & (energy < -_CLEARLY * kappa)
        passed = accepted & ((_left(new, 0.0, law, leg)[0] <= 0.0) | held_back)
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
    new, last, _ = step(state, first, law, shorter, leg.scales)
    searching = active
    for _ in range(_ROOT_LIMIT):
        if not any_lane(searching):
            break
        value, rate = _left(new, last[1], law, leg)
        low, high = where(value > 0.0, shorter, low), where(value > 0.0, high, shorter)
        guess = shorter - value / rate
        settled = magnitude(guess - shorter) <= _SETTLED * h
        guess = where(settled | ((guess > low) & (guess < high)), guess, 0.5 * (low + high))
        shorter = where(searching, guess, shorter)
        trial, rates_there, _ = step(state, first, law, shorter, leg.scales)
        new, last = choose(searching, (trial, rates_there), (new, last))
        searching = searching & not_(settled)
    return choose(active, new, state), t + where(active, shorter, 0.0), h, moving


@symbolic
def _moved(state, law, steady, time):
    """The state after a time over which accelerations are constant, under the constant force `steady`, without drag."""
    bare = law.problem._replace(gamma=0.0 * law.problem.gamma)
    rate, half = rates(state, law._replace(steady=steady, problem=bare)), 0.5 * time
    ways = (fma(time, fma(half, rate[j + 1], state[j + 1]), state[j]) for j in (0, 2, 4))
    speeds = (fma(time, rate[j], state[j]) for j in (1, 3, 5))
    (x, x_mu, x_start), (v, v_mu, v_start) = ways, speeds
    return x, v, x_mu, v_mu, x_start, v_start, fma(time, rate[6], state[6])


@jit
def _turned(state, law, slow):
    """The state behind the turning point; J; way and its tangent by v0 there; and the time taken.

    Power-law friction that is not smooth at rest is constant from the speed of the state to rest, and from there to
    the speed `slow`: J takes both, and with the integral Y outside is what it is without a step through rest.
    """
    zero, v, problem, turns = 0.0 * slow, state[1], law.problem, law.problem.e > 0.0
    still = turns | not_(v < 0.0)
    speed = where(slow > 0.0, larger(v, zero), zero)
    held = _held_at(problem, speed)
    braking = problem.outwards + held + pull(state[0], problem) + problem.d * speed
    before = speed / braking
    x, _, x_mu, v_mu, x_start, v_start, decay = _moved(state, law, problem.outwards + held, before)
    force = pull(x, problem)
    free = problem.inwards + force
    speed = where(still & (free > 0.0), slow * smaller(free / problem.inwards, zero + 1.0), zero)
    held_in = _held_at(problem, speed)
    goes = free > held_in
    jump = where(turns, (problem.inwards - held_in + force) / (problem.outwards + held + force), 1.0)
    after_rest = where(goes, speed / (free - held_in), 0.0)
    rest = (x, 0.0 * x, x_mu, jump * v_mu, x_start, jump * v_start, decay)
    behind = _moved(rest, law, problem.inwards - held_in, after_rest)
    return choose(still, behind, state), jump, x, x_start, before + after_rest


@jit
def _wins(x, scene):
    """Whether the drive wins over dry friction at x."""
    slack, problem = scene
    return slack + pull(x, problem) > 0.0


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
        found = searching & _wins(there, (slack, problem))
        held = where(searching & not_(found), there, held)
        free = where(found & (there > -1.0), there, free)
        searching = searching & not_(found)
    return bisected(_wins, held, free, (slack, problem), _BISECTIONS)


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
    top, top_by_start, jump, forgotten = one, zero, one, zero + math.inf
    varied = (problem.kappa > 0.0) | (problem.depth > 0.0)
    falling = inwards(problem, floor)
    for _ in range(HELP_LIMIT):
        if not any_lane(moving):
            break
        behind, jumped, there, there_by_start, spent = _turned(state, falling, slow)
        forgotten = where(turning & not_(varied), state[6] + _FORGOTTEN, forgotten)
        turned, old = (behind, jumped, there, there_by_start, time + spent), (state, jump, top, top_by_start, time)
        state, jump, top, top_by_start, time = choose(turning, turned, old)

        side, steady = where(rising, 1.0, falling.side), where(rising, problem.outwards, problem.inwards)
        law = Law(side, steady, floor, problem)
        stop = where(rising, smaller(slow, 0.5 * start), zero)
        leg = Leg(stop, forgotten, slow, scales)
        state, spent, h, late = _to_end(step, state, law, leg, h, tolerance, moving)
        time, lost, moving = time + spent, lost | late, moving & not_(late)
        turning, inward = moving & rising, moving & not_(rising)
        rising = rising & not_(turning)

        uniform = inward & (state[6] > forgotten - 1e-3)
        if any_lane(uniform):  # at speeds that friction wants: those of the integration waver about them
            x, v, x_mu, v_mu, x_start, v_start, decay = state
            _, force, _, force_mu, _, force_start, slope = rates(state, falling)
            v, v_mu, v_start = v + force / slope, v_mu + force_mu / slope, v_start + force_start / slope
            coast = -(x + 1.0) / v
            moved = (fma(coast, v_mu, x_mu), v_mu, fma(coast, v_start, x_start), v_start, fma(coast, slope, decay))
            at_switch = (zero - 1.0, v, *moved)
            state, time = choose(uniform, (at_switch, time + coast), (state, time))
        stopped = inward & (state[0] + 1.0 > _ARRIVED + _ROUNDED * top)
        if any_lane(stopped):
            free = _released(state[0], problem.inwards - _held_at(problem, floor), problem)
            state = choose(stopped, (free, zero, zero, zero, zero, zero, zero), state)
            forgotten, helped = where(stopped, math.inf, forgotten), helped | stopped
        moving = turning | (stopped & (state[0] > -1.0))
    v, rate = state[1], rates(state, inwards(problem, problem.floor))[1]
    end = where(moving | (helped & not_(v < 0.0)), zero, -v)
    shrink = where(helped, 0.0, jump * exp(-state[6]))
    return Half(end, state, rate, top, top_by_start, time, shrink, helped, lost)
