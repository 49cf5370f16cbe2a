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

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import magnitude
from kernels.maths.elementary import arctan, expm1, log1p
from kernels.maths.elementary import power as inlined_power
from kernels.maths.elementary import sincos as inlined_sincos

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
STACK = (_DEPTH, 6)


@jit_call
def power(x, y):
    """x^y."""
    return inlined_power(x, y)


@jit_call
def sincos(x):
    """Sine and cosine."""
    return inlined_sincos(x)


@jit_call
def tool_of(a, b, n, m):
    """The tool: half widths, exponents, and 2^(-1/n), 2^(-1/m)."""
    return a, b, n, m, power(0.5, 1.0 / n), power(0.5, 1.0 / m)


@jit_call
def _along(x, k, j, middle):
    """(1) and what makes its slope: small, 1 - large, d small/dx, and two monotone factors of -d large/d small."""
    if k >= 1.0:
        raised = power(x, k - 1.0)
        share, steep = 0.5 * raised * x, 0.5 * k * raised / middle
        small, growth = middle * x, middle
    else:
        stretched = power(x, 1.0 / k - 1.0)
        share, small = 0.5 * x, middle * stretched * x
        growth = middle / k * stretched
        steep = 0.5 / growth if growth > 0.0 else math.inf
    missing = -expm1(log1p(-share) / j)
    return small, missing, growth, steep, (1.0 - missing) / (j * (1.0 - share))


@jit_call
def outline(piece, x, tool):
    """X, Y, dX/dx and dY/dx of a piece, and how far the larger of X and Y is below its vertex."""
    a, b, n, m, half_x, half_y = tool
    side = 1.0 if piece < 1.5 else -1.0
    if on_x_axis(piece):
        small, missing, growth, steep, bent = _along(x, m, n, half_y)
        return side * (a - a * missing), b * small, -side * a * growth * steep * bent, b * growth, a * missing
    small, missing, growth, steep, bent = _along(x, n, m, half_x)
    return side * a * small, b - b * missing, side * a * growth, -b * growth * steep * bent, b * missing


@jit
def on_x_axis(piece):
    """Whether the piece begins at the vertex on the X axis."""
    return piece == 0.0 or piece == 2.0


@jit
def side_of(piece):
    """+1 where X > 0."""
    return 1.0 if piece < 1.5 else -1.0


@jit
def sense(piece):
    """+1 where x runs counterclockwise about the tool, else -1."""
    return 1.0 if piece == 0.0 or piece == 3.0 else -1.0


@jit_call
def vertex_excess(piece, tool, cx, cy, radius):
    """Squared distance from (cx, cy) of the vertex where a piece begins, less radius^2."""
    u, v = -cx, -cy
    if on_x_axis(piece):
        u += side_of(piece) * tool[0]
    else:
        v += tool[1]
    return (magnitude(u) - radius) * (magnitude(u) + radius) + v * v


@jit_call
def _end(piece, x, tool, cx, cy, start):
    """x, X - cx, Y - cy, two factors of the slope, and the squared distance less that of the circle."""
    a, b, n, m, half_x, half_y = tool
    side = side_of(piece)
    if on_x_axis(piece):
        small, missing, _, steep, bent = _along(x, m, n, half_y)
        u, v = side * a - cx, b * small
        excess = start + a * missing * (a * missing - 2.0 * side * u) + v * (v - 2.0 * cy)
        return x, u - side * a * missing, v - cy, steep, bent, excess
    small, missing, _, steep, bent = _along(x, n, m, half_x)
    u, v = side * a * small, b - cy
    excess = start + b * missing * (b * missing - 2.0 * v) + u * (u - 2.0 * cx)
    return x, u - cx, v - b * missing, steep, bent, excess


@jit
def _least_square(x, y):
    """Least square of a number between x and y."""
    if x * y <= 0.0:
        return 0.0
    return min(x * x, y * y)


@jit_call
def _slope_bounds(piece, tool, one, two):
    """Bounds on half the derivative of the squared distance by `small`, over the unit of `small`.

    It is p - s q with the slope s between products of its factors, where p belongs to the small coordinate, and q to
    the large one.
    """
    a, b = side_of(piece) * tool[0], tool[1]
    if on_x_axis(piece):
        p1, p2, q1, q2 = b * one[2], b * two[2], a * one[1], a * two[1]
    else:
        p1, p2, q1, q2 = a * one[1], a * two[1], b * one[2], b * two[2]
    low = min(one[3], two[3]) * min(one[4], two[4])
    high = max(one[3], two[3]) * max(one[4], two[4])
    if not high < math.inf:
        return -math.inf, math.inf
    q_low, q_high = min(q1, q2), max(q1, q2)
    most = q_high * (high if q_high > 0.0 else low)
    least = q_low * (low if q_low > 0.0 else high)
    return min(p1, p2) - most, max(p1, p2) - least


@jit_call
def _excess(piece, x, tool, cx, cy, start):
    """Squared distance from the centre, less that of the circle, and its derivative."""
    _, u, v, _, _, excess = _end(piece, x, tool, cx, cy, start)
    _, _, dx, dy, _ = outline(piece, x, tool)
    return excess, 2.0 * (u * dx + v * dy)


@jit_call
def _root(piece, low, high, tool, cx, cy, start):
    """The crossing between low and high, where there is just one: Newton within the bracket."""
    rising = _excess(piece, high, tool, cx, cy, start)[0] > 0.0
    x = 0.5 * (low + high)
    for _ in range(_NEWTON_LIMIT):
        value, slope = _excess(piece, x, tool, cx, cy, start)
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


@jit_call
def crossings(piece, tool, cx, cy, radius, start, found, count, stack):
    """Puts into `found`, from `count` on, all x of a piece at a distance `radius` of (cx, cy); the new count.

    `start` is `vertex_excess`. Where the circle touches or all but touches, an x close by is put. -1: too many, as
    where the two coincide.
    """
    first, top, square = count, int(1.0), radius * radius
    left = _end(piece, 0.0, tool, cx, cy, start)
    _put(stack, top - 1, _end(piece, 1.0, tool, cx, cy, start))
    for _ in range(_INTERVAL_LIMIT):
        if top == 0:
            return count
        right = _top(stack, top - 1)
        x = math.nan
        if _may_cross(left, right, square):
            low, high = _slope_bounds(piece, tool, left, right)
            if low > 0.0 or high < 0.0:
                if (left[5] > 0.0) != (right[5] > 0.0):
                    x = _root(piece, left[0], right[0], tool, cx, cy, start)
            elif right[0] - left[0] > _NARROW and top < _DEPTH:
                _put(stack, top, _end(piece, 0.5 * (left[0] + right[0]), tool, cx, cy, start))
                top += 1
                continue
            else:
                x = 0.5 * (left[0] + right[0])
        if x >= 0.0:
            if count - first >= CROSSING_LIMIT:
                return -1
            found[count] = x
            count += 1
        left = right
        top -= 1
    return -1


@jit
def _may_cross(left, right, square):
    """Whether a circle of that squared radius has points in the rectangle of two ends."""
    least = _least_square(left[1], right[1]) + _least_square(left[2], right[2])
    most = max(left[1] * left[1], right[1] * right[1]) + max(left[2] * left[2], right[2] * right[2])
    slack = _ROUNDING * (square + most)
    return least <= square + slack and most >= square - slack


@jit
def _put(stack, k, end):
    for j in range(6):
        stack[k, j] = end[j]


@jit
def _top(stack, k):
    return stack[k, 0], stack[k, 1], stack[k, 2], stack[k, 3], stack[k, 4], stack[k, 5]


@jit_call
def excess(tool, x, y):
    """abs(X/a)^n + abs(Y/b)^m - 1 of a point of the tool's frame, limited; negative where it is in contact."""
    u, v = min(magnitude(x) / tool[0], 8.0), min(magnitude(y) / tool[1], 8.0)
    return power(u, tool[2]) + power(v, tool[3]) - 1.0


@jit_call
def arctan2(y, x):
    """The angle of the point (x, y), in [-pi, pi]."""
    if magnitude(y) <= magnitude(x):
        if x > 0.0:
            return arctan(y / x)
        if x < 0.0:
            return arctan(y / x) + (math.pi if y >= 0.0 else -math.pi)
        return 0.0
    return (0.5 * math.pi if y > 0.0 else -0.5 * math.pi) - arctan(x / y)


@jit_call
def sort(values, count):
    """Sorts the first `count` values, by insertion."""
    for i in range(1, count):
        value, j = values[i], i
        while j > 0 and values[j - 1] > value:
            values[j] = values[j - 1]
            j -= 1
        values[j] = value


@jit_call
def arcs(tool, cx, cy, radius, near, far, angles, found, stack):
    """Arcs of a circle within the tool: their ends in pairs in `angles`, in [-pi, pi]; how many numbers, -1: too many.

    And how much of the circle lies on the outline but for rounding, so that it may be in or out; and the angle, on
    either side, that this is about, NaN if it is about several.

    `near`, `far`: `vertex_excess` of the vertices at X = a and X = -a where it is known better than from cx, else NaN.
    """
    count, first = int(1.0), int(0.0)  # literals would have what they are passed to compiled anew
    angles[0] = -math.pi
    for k in range(2 * PIECES):
        piece, mirror = float(k // 2), 1.0 if k % 2 else -1.0
        start = near if k < 2 else far
        if not on_x_axis(piece) or start != start:
            start = vertex_excess(piece, tool, cx, mirror * cy, radius)
        number = crossings(piece, tool, cx, mirror * cy, radius, start, found, first, stack)
        if number < 0:
            return -1, 0.0, math.nan
        for j in range(number):
            x, y, _, _, _ = outline(piece, found[j], tool)
            angles[count] = arctan2(mirror * y - cy, x - cx)
            count += 1
    angles[count] = math.pi
    sort(angles, count + 1)
    return _kept(tool, cx, cy, radius, angles, count)


@jit
def _kept(tool, cx, cy, radius, angles, count):
    """Keeps those of `count` neighbouring arcs that are within the tool; how many numbers, what is unsure, where."""
    kept, unsure, about = 0, 0.0, -1.0
    for j in range(count):
        low, high = angles[j], angles[j + 1]
        if high > low:
            s, c = sincos(low + _ASIDE * (high - low))
            beyond = excess(tool, cx + radius * c, cy + radius * s)
            if magnitude(beyond) < _ROUNDING * (tool[2] + tool[3]) * 16.0:
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
