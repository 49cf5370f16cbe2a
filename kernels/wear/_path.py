"""The way of one point of a turning workpiece under the tool of a polishing machine, and the polishing on it.

In the frame of the tool it is at Q(t) = R(-phi) x(t) - (L, 0), x = w + r0 (cos, sin)(theta0 + Omega t), and moves there
with the speed v of polishing: abs(dQ/dt) = v. The second derivative is bounded,
    abs(Q'') <= (abs(Omega) r0)^2/r0 + 2 abs(phi' Omega) r0 + (abs(phi'') + phi'^2) (w + r0) = bend       (1)
so that over a time h the way lies within bend h^2/8 of its chord. By bounds on abs(X/a)^n + abs(Y/b)^m and on its rate
over such a box, each stretch of time is inside, outside, or crossed once; else it is halved. So no touch is overlooked.

Time goes in steps of a share of the crank's turn; whole turns are taken off without rounding. Derived here.
"""

import math
from collections import namedtuple
from typing import NamedTuple

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import fma, magnitude, nearest, sqrt
from kernels.maths.pairs import two_product
from kernels.polisher import linkage
from kernels.wear._dwell import Arm
from kernels.wear._pressure import Areas
from kernels.wear._scene import Ride
from kernels.wear._tool import Tool, excess, power, range_of, sincos

STEPS = 24
"""Steps of a turn of the crank or the work, whichever is faster."""
STEP_LIMIT = 20_000_000
HALVINGS = 44

_EPS = 2.0**-52
_TURN = 2.0 * math.pi
_SAMPLES = 256
_MARGIN = 1.5
_BISECTIONS = 80


class Course(NamedTuple):
    """Of a point about the tool: the arm and its side, the ride, centre of the work, radius, and the tool."""

    arm: Arm
    side: float
    b_angle: float
    ride: Ride
    x: float
    y: float
    beta: float
    r: float
    tool: Tool


class Step(NamedTuple):
    """Of time, after the crank had turned by `cranked` and the point was at `turned`; and the areas of contact."""

    course: Course
    cranked: float
    turned: float
    areas: Areas


Place = namedtuple("Place", "x y vx vy c s")
"""X, Y and their rates, and cosine and sine of the direction of the tool's centre from the pivot."""


@jit_apart
def position(step, s):
    """The `Place` of the point at a time s of a step."""
    course, ride = step.course, step.course.ride
    crank = linkage.crank_at(step.cranked + ride.speed * s, course.b_angle)
    alpha, rate, _ = linkage.motion(course.arm.lengths, course.arm.margin, course.side, crank)
    rate, r, spin = ride.speed * rate, course.r, ride.spin
    sine, cosine = sincos(step.turned + spin * s)
    sine, cosine = r * sine, r * cosine
    sine_arm, cosine_arm = sincos(alpha + (course.b_angle + course.beta))
    px, py = course.x + cosine, course.y + sine
    vx, vy = rate * py - spin * sine, spin * cosine - rate * px
    return Place(
        px * cosine_arm + py * sine_arm - ride.reach,
        py * cosine_arm - px * sine_arm,
        vx * cosine_arm + vy * sine_arm,
        vy * cosine_arm - vx * sine_arm,
        cosine_arm,
        sine_arm,
    )


@jit_apart
def bend(course):
    """(1), from samples of the arm's motion that are dense about the dead points, half as much again."""
    arm, speed, spin, r = course.arm, course.ride.speed, course.ride.spin, course.r
    rate, acceleration = 0.0, 0.0
    for k in range(_SAMPLES + 160):
        theta = _TURN * k / _SAMPLES
        if k >= _SAMPLES:
            j = k - _SAMPLES
            theta = (math.pi if j % 2 else 0.0) + (1.0 if j % 4 < 2 else -1.0) * 2.0 ** (-(j // 4))
        _, first, second = linkage.motion(arm.lengths, arm.margin, course.side, linkage.crank_at(theta, 0.0))
        rate, acceleration = max(rate, magnitude(first)), max(acceleration, magnitude(second))
    rate, acceleration = magnitude(speed) * rate, speed * speed * acceleration
    far = sqrt(course.x * course.x + course.y * course.y) + r
    return _MARGIN * (spin * spin * r + 2.0 * rate * magnitude(spin) * r + (acceleration + rate * rate) * far)


@jit_apart
def _rate_bounds(size, k, x1, x2, spread, v, turn):
    """Bounds on the rate of abs(x/size)^k over a box of x and rates within `turn` of v."""
    least, most = range_of(x1, x2, spread)
    if least == 0.0 and k < 1.0:
        return -math.inf, math.inf
    g1, g2 = k / size * power(min(least / size, 8.0), k - 1.0), k / size * power(min(most / size, 8.0), k - 1.0)
    low, high = min(g1, g2), max(g1, g2)
    if least == 0.0:  # the coordinate's sign changes
        reach = high * (magnitude(v) + turn)
        return -reach, reach
    v = v if x1 > 0.0 else -v
    slow, fast = v - turn, v + turn
    return slow * (low if slow > 0.0 else high), fast * (high if fast > 0.0 else low)


INSIDE, OUTSIDE, ONCE, UNKNOWN = range(4)


@jit_apart
def judged(tool, one, two, h, curve):
    """Whether a stretch of time h between two positions is INSIDE, OUTSIDE, crossed ONCE at most, or UNKNOWN."""
    spread = 0.125 * curve * h * h
    x_low, x_high = range_of(one.x, two.x, spread)
    y_low, y_high = range_of(one.y, two.y, spread)
    if excess(tool, x_high, y_high) < 0.0:
        return INSIDE
    if excess(tool, x_low, y_low) > 0.0:
        return OUTSIDE
    x_least, x_most = _rate_bounds(tool.a, tool.n, one.x, two.x, spread, one.vx, curve * h)
    y_least, y_most = _rate_bounds(tool.b, tool.m, one.y, two.y, spread, one.vy, curve * h)
    return ONCE if x_least + y_least > 0.0 or x_most + y_most < 0.0 else UNKNOWN


@jit_apart
def crossing(step, low, high):
    """The time between low and high at which the outline is crossed, and what rounding may come to in it."""
    tool, first = step.course.tool, low
    there = position(step, high)
    rising = excess(tool, there.x, there.y) > 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        there = position(step, middle)
        if (excess(tool, there.x, there.y) > 0.0) == rising:
            high = middle
        else:
            low = middle
        if high - low <= _EPS * (high - first):
            break
    s = 0.5 * (low + high)
    there = position(step, s)
    gx, gy = _slope(tool.a, tool.n, there.x), _slope(tool.b, tool.m, there.y)
    far = step.course.ride.reach + magnitude(there.x) + magnitude(there.y)
    pace = magnitude(gx * there.vx + gy * there.vy)
    return s, 8.0 * _EPS * far * (magnitude(gx) + magnitude(gy)) / pace if pace > 0.0 else math.inf


@jit
def _slope(size, k, x):
    u = min(magnitude(x) / size, 8.0)
    slope = k / size * power(u, k - 1.0) if u > 0.0 else 0.0
    return slope if x > 0.0 else -slope


@jit
def phase(j, ratio, ratio_low):
    """j (ratio + ratio_low) turns, without the whole ones, as an angle."""
    product, lost = two_product(float(j), ratio)
    return _TURN * ((product - nearest(product)) + fma(float(j), ratio_low, lost))
