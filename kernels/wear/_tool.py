"""Outline of a polishing tool, abs(X/a)^n + abs(Y/b)^m = 1, and where a circle crosses it.

The half with Y >= 0 is four *pieces*, two on each side of X = 0, that meet where both terms are 1/2; the half with
Y <= 0 is their mirror image. On a piece the smaller coordinate grows with x from 0 to 1 and the larger one falls:
    small = 2^(-1/k) x^max(1, 1/k),  large = (1 - small^k)^(1/j)                                     (1)
(over b and a, with k = m and j = n on pieces 0 and 2 that begin on the X axis; the other way round on 1 and 3).
Source of the shape: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (20), with the absolute values.

Crossings are isolated by intervals, so that none is overlooked: along a piece both coordinates and both factors of the
slope are monotone, hence so are bounds on the distance from a point and on its derivative.
"""

import math
from collections import namedtuple

import numpy as np

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.tuples import read, write
from kernels.lanes.vectors import magnitude, where
from kernels.maths import elementary
from kernels.maths.elementary import expm1, log1p
from kernels.maths.small_dense import sort

power, sincos, arctan2 = (
    jit_apart(getattr(f, "py_func", f)) for f in (elementary.power, elementary.sincos, elementary.arctan2)
)
"""As calls: inlined wherever they are used they would take long to compile."""
PIECES = 4
CROSSING_LIMIT = 32
"""Crossings that a circle may have with one piece; more are one where circle and outline coincide."""
ARC_LIMIT = 8 * CROSSING_LIMIT + 2

_INTERVAL_LIMIT = 2000
_NEWTON_LIMIT = 60
_DEPTH = 64
_NARROW = 1e-13
_ROUNDING = 1e-15
_NEAR = 1e-3
"""Between angles at which the rest of the scene is much the same."""
_ASIDE = 0.38
"""Where on an arc it is tried for contact: not amid it, where a circle about the pivot may touch a vertex."""
STACK = (6, _DEPTH)
"""Shape of a stack of `End`s."""


Tool = namedtuple("Tool", "a b n m half_x half_y")
"""Half widths, exponents, and 2^(-1/n), 2^(-1/m)."""


Circle = namedtuple("Circle", "x y radius")
"""Its centre in the frame of the tool, and its radius."""


Along = namedtuple("Along", "small missing growth steep bent")
"""(1) and what makes its slope: small, 1 - large, d small/dx, and two monotone factors of -d large/d small."""


Spot = namedtuple("Spot", "x y dx dy missing")
"""X, Y, dX/dx and dY/dx of an outline, and how far the larger of X and Y is below its vertex."""


End = namedtuple("End", "x u v steep bent excess")
"""Of an interval: x, X and Y from a circle's centre, two factors of the slope, squared distance less radius^2."""


@jit_apart
def _along(x, k, j, middle):
    """`Along` of exponents k and j, `middle` being the largest `small`."""
    if k >= 1.0:
        raised = power(x, k - 1.0)
        share, steep = 0.5 * raised * x, 0.5 * k * raised / middle
        small, growth = middle * x, middle
    else:
        stretched = power(x, 1.0 / k - 1.0)
        share, small = 0.5 * x, middle * stretched * x
        growth = middle / k * stretched
        steep = where(growth > 0.0, 0.5 / growth, math.inf)
    missing = -expm1(log1p(-share) / j)
    return Along(small, missing, growth, steep, (1.0 - missing) / (j * (1.0 - share)))


@jit_apart
def outline(piece, x, tool):
    """The `Spot` at x of a piece."""
    a, b, n, m, half_x, half_y = tool
    side = side_of(piece)
    if on_x_axis(piece):
        small, missing, growth, steep, bent = _along(x, m, n, half_y)
        return Spot(side * (a - a * missing), b * small, -side * a * growth * steep * bent, b * growth, a * missing)
    small, missing, growth, steep, bent = _along(x, n, m, half_x)
    return Spot(side * a * small, b - b * missing, side * a * growth, -b * growth * steep * bent, b * missing)


@jit
def on_x_axis(piece):
    """Whether the piece begins at the vertex on the X axis."""
    return piece == 0.0 or piece == 2.0


@jit
def side_of(piece):
    """+1 where X > 0."""
    return 1.0 if piece < 1.5 else -1.0


@jit_apart
def vertex_excess(piece, tool, circle):
    """Squared distance of the vertex where a piece begins from the circle's centre, less radius^2."""
    u, v = -circle.x, -circle.y
    if on_x_axis(piece):
        u += side_of(piece) * tool.a
    else:
        v += tool.b
    return (magnitude(u) - circle.radius) * (magnitude(u) + circle.radius) + v * v


@jit_apart
def _end(piece, x, tool, circle, start):
    """The `End` at x of a piece; start: `vertex_excess`."""
    a, b, n, m, half_x, half_y = tool
    cx, cy, side = circle.x, circle.y, side_of(piece)
    if on_x_axis(piece):
        small, missing, _, steep, bent = _along(x, m, n, half_y)
        u, v = side * a - cx, b * small
        excess = start + a * missing * (a * missing - 2.0 * side * u) + v * (v - 2.0 * cy)
        return End(x, u - side * a * missing, v - cy, steep, bent, excess)
    small, missing, _, steep, bent = _along(x, n, m, half_x)
    u, v = side * a * small, b - cy
    excess = start + b * missing * (b * missing - 2.0 * v) + u * (u - 2.0 * cx)
    return End(x, u - cx, v - b * missing, steep, bent, excess)


@jit
def range_of(x, y, spread):
    """Least and largest abs of what lies between x and y, or within `spread` of that."""
    low, high = min(x, y) - spread, max(x, y) + spread
    return (0.0 if low * high <= 0.0 else min(magnitude(low), magnitude(high))), max(magnitude(low), magnitude(high))


@jit_apart
def _slope_bounds(piece, tool, one, two):
    """Bounds on half the derivative of the squared distance by `small`, over the unit of `small`.

    It is p - s q with the slope s between products of its factors, where p belongs to the small coordinate, and q to
    the large one.
    """
    a, b = side_of(piece) * tool.a, tool.b
    if on_x_axis(piece):
        p1, p2, q1, q2 = b * one.v, b * two.v, a * one.u, a * two.u
    else:
        p1, p2, q1, q2 = a * one.u, a * two.u, b * one.v, b * two.v
    low = min(one.steep, two.steep) * min(one.bent, two.bent)
    high = max(one.steep, two.steep) * max(one.bent, two.bent)
    if not high < math.inf:
        return -math.inf, math.inf
    q_low, q_high = min(q1, q2), max(q1, q2)
    most = q_high * (high if q_high > 0.0 else low)
    least = q_low * (low if q_low > 0.0 else high)
    return min(p1, p2) - most, max(p1, p2) - least


@jit_apart
def _root(piece, low, high, tool, circle, start):
    """The crossing between low and high, where there is just one: Newton within the bracket."""
    rising = _end(piece, high, tool, circle, start).excess > 0.0
    x = 0.5 * (low + high)
    for _ in range(_NEWTON_LIMIT):
        end, spot = _end(piece, x, tool, circle, start), outline(piece, x, tool)
        value, slope = end.excess, 2.0 * (end.u * spot.dx + end.v * spot.dy)
        if (value > 0.0) == rising:
            high = x
        else:
            low = x
        step = value / slope if slope != 0.0 else math.inf
        new = x - step
        if not (new > low and new < high):
            new = 0.5 * (low + high)
        done = magnitude(new - x) <= 2e-16 * new
        x = new
        if done or not high - low > 0.0:
            break
    return x


@jit_apart
def crossings(piece, tool, circle, start, found, count, stack):
    """Puts into `found`, from `count` on, all x of a piece that are on a circle; the new count.

    `start` is `vertex_excess`. Where the circle touches or all but touches, an x close by is put. -1: too many, as
    where the two coincide.
    """
    first, top, square = count, np.int64(1), circle.radius * circle.radius
    left = _end(piece, 0.0, tool, circle, start)
    write(stack, top - 1, _end(piece, 1.0, tool, circle, start))
    for _ in range(_INTERVAL_LIMIT):
        if top == 0:
            return count
        right, x = read(stack, top - 1, left), math.nan
        (near_u, far_u), (near_v, far_v) = range_of(left.u, right.u, 0.0), range_of(left.v, right.v, 0.0)
        least, most = near_u * near_u + near_v * near_v, far_u * far_u + far_v * far_v
        slack = _ROUNDING * (square + most)
        if least <= square + slack and most >= square - slack:  # the circle meets the rectangle of both ends
            low, high = _slope_bounds(piece, tool, left, right)
            if low > 0.0 or high < 0.0:
                if (left.excess > 0.0) != (right.excess > 0.0):
                    x = _root(piece, left.x, right.x, tool, circle, start)
            elif right.x - left.x > _NARROW and top < _DEPTH:
                write(stack, top, _end(piece, 0.5 * (left.x + right.x), tool, circle, start))
                top += 1
                continue
            else:
                x = 0.5 * (left.x + right.x)
        if x >= 0.0:
            if count - first >= CROSSING_LIMIT:
                return -1
            found[count] = x
            count += 1
        left = right
        top -= 1
    return -1


@jit_apart
def excess(tool, x, y):
    """abs(X/a)^n + abs(Y/b)^m - 1 of a point of the tool's frame, limited; negative where it is in contact."""
    u, v = min(magnitude(x) / tool.a, 8.0), min(magnitude(y) / tool.b, 8.0)
    return power(u, tool.n) + power(v, tool.m) - 1.0


@jit_apart
def arcs(tool, circle, near, far, angles, found, stack):
    """Arcs of a circle within the tool: their ends in pairs in `angles`, in [-pi, pi]; how many numbers, -1: too many.

    And how much of the circle lies on the outline but for rounding, so that it may be in or out; and the angle, on
    either side, that this is about, NaN if it is about several.

    `near`, `far`: `vertex_excess` of the vertices at X = a and -a where that is known better than so, else NaN.
    """
    count, first = np.int64(1), np.int64(0)  # literals would have what they are passed to compiled anew
    angles[0] = -math.pi
    for k in range(2 * PIECES):
        piece, mirror = float(k // 2), 1.0 if k % 2 else -1.0
        start, seen = near if k < 2 else far, Circle(circle.x, mirror * circle.y, circle.radius)
        if not on_x_axis(piece) or start != start:
            start = vertex_excess(piece, tool, seen)
        number = crossings(piece, tool, seen, start, found, first, stack)
        if number < 0:
            return -1, 0.0, math.nan
        for j in range(number):
            spot = outline(piece, found[j], tool)
            angles[count] = arctan2(mirror * spot.y - circle.y, spot.x - circle.x)
            count += 1
    angles[count] = math.pi
    sort(angles, count + 1)
    # those of neighbouring arcs that are within the tool
    kept, unsure, about = 0, 0.0, -1.0
    for j in range(count):
        low, high = angles[j], angles[j + 1]
        if high > low:
            s, c = sincos(low + _ASIDE * (high - low))
            beyond = excess(tool, circle.x + circle.radius * c, circle.y + circle.radius * s)
            if magnitude(beyond) < _ROUNDING * (tool.n + tool.m) * 16.0:
                unsure += high - low
                angle = magnitude(0.5 * (low + high))
                alone = about < 0.0 or magnitude(about - angle) < _NEAR
                about = angle if alone and high - low < _NEAR else math.nan
            if beyond < 0.0:
                if kept > 0 and not angles[kept - 1] < low:
                    angles[kept - 1] = high
                else:
                    angles[kept], angles[kept + 1] = low, high  # kept <= j: what is read later is not overwritten
                    kept += 2
    return kept, unsure, about
