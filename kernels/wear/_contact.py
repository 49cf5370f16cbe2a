"""Area of a tool's footprint within the disc of a workpiece.

By Green's theorem, about the tool's centre: outline within the disc, and arcs of the disc's edge within the tool,
    A = sum_outline (X dY - Y dX)/2 + sum_arcs [P x Q/2 + R^2 (t - sin t)/2]                         (1)
with P and Q the ends of an arc and t its angle. On a piece of `_tool`, with z = small^k and q = 1/j,
    int large dsmall = small sum_i (-q)_i/i! z^i/(1 + k i),  z <= 1/2,                               (2)
is an incomplete beta function, whose terms fall faster than 2^-i. Every arc is judged by itself, and what rounding may
misjudge counts as noise. Source: derived here; (2) is DLMF 8.17.7.
"""

import math

import numpy as np

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths.small_dense import sort
from kernels.wear import _tool
from kernels.wear._tool import PIECES, Circle, arctan2, outline, power, sincos

POINTS = (2 * (_tool.ARC_LIMIT + 2 * PIECES), 3)
"""Shape of a list of points on the edge of a disc: its direction from the centre, X and Y."""

_EPS = 2.0**-52
_TERMS = 80
_ASIDE = 0.38
_SLACK = 1e-9
_TURN = 2.0 * math.pi


@jit_apart
def _beta(x, k, j):
    """(2) over `small`."""
    z = 0.5 * power(x, max(1.0, k))
    q, factor, total = 1.0 / j, 1.0, 1.0
    for i in range(_TERMS):
        factor *= (i - q) / (i + 1.0) * z
        total += factor / (1.0 + k * (i + 1.0))
        if magnitude(factor) <= 1e-18:
            break
    return total


@jit_apart
def sector(piece, x, tool):
    """Area between the tool's centre and its outline from 0 to x of a piece, and X and Y there."""
    a, b = tool.a, tool.b
    spot = outline(piece, x, tool)
    if _tool.on_x_axis(piece):
        share = spot.y / b * (_beta(x, tool.m, tool.n) - 0.5 * (1.0 - spot.missing / a))
    else:
        share = magnitude(spot.x) / a * (_beta(x, tool.n, tool.m) - 0.5 * (1.0 - spot.missing / b))
    return a * b * share, spot.x, spot.y


@jit_apart
def _outline_within(piece, mirror, tool, disc, count, room):
    """Adds the points of half a piece on the disc's edge; its share of (1), what it may be wrong by, and the count."""
    seen, found, first = Circle(disc.x, mirror * disc.y, disc.radius), room.found, np.int64(1)
    start = _tool.vertex_excess(piece, tool, seen)
    found[0] = 0.0
    number = _tool.crossings(piece, tool, seen, start, found, first, room.stack)
    splits = max(number, 1)
    found[splits] = 1.0
    sort(found, splits + 1)
    total, noise = 0.0, 0.0
    behind, px, py = sector(piece, 0.0, tool)
    for j in range(splits + 1):
        ahead, x, y = sector(piece, found[j], tool)
        if 0 < j < splits or _on_edge(x, mirror * y, disc):
            row = room.points[count]
            row[0], row[1], row[2] = arctan2(mirror * y - disc.y, x - disc.x), x, mirror * y
            count += 1
        if j > 0:
            _, px, py = sector(piece, found[j - 1] + _ASIDE * (found[j] - found[j - 1]), tool)
            if _beyond(px, mirror * py, disc) < 0.0:
                total += ahead - behind
                noise += 4.0 * _EPS * (ahead + behind)
            if number < 0 or _on_edge(px, mirror * py, disc):
                noise += magnitude(ahead - behind)
        behind = ahead
    return total, noise, count


@jit
def _beyond(x, y, disc):
    """Squared distance from the disc's centre less that of its edge."""
    u, v = x - disc.x, y - disc.y
    return u * u + v * v - disc.radius * disc.radius


@jit
def _on_edge(x, y, disc):
    """Whether rounding decides on which side of the disc's edge a point is."""
    far = magnitude(x) + magnitude(y) + magnitude(disc.x) + magnitude(disc.y) + disc.radius
    return magnitude(_beyond(x, y, disc)) <= 4.0 * _EPS * far * far


@jit_apart
def _arc_within(tool, disc, one, two, turn):
    """Share of (1) of the arc of the disc's edge between two points, by about `turn`, and what it may be wrong by."""
    cx, cy, radius = disc
    x, y = one[1], one[2]
    u, v, dx, dy = x - cx, y - cy, two[1] - x, two[2] - y
    if turn < 3.0:
        turn = magnitude(arctan2(u * dy - v * dx, u * (u + dx) + v * (v + dy)))
    s, c = sincos(one[0] + _ASIDE * turn)
    beyond = _tool.excess(tool, cx + radius * c, cy + radius * s)
    y2, bulge = turn * turn, turn - sincos(turn)[0]  # t - sin t
    if not turn > 0.5:
        bulge = 1.0 - y2 / 42.0 * (1.0 - y2 / 72.0 * (1.0 - y2 / 110.0 * (1.0 - y2 / 156.0)))
        bulge = turn * y2 / 6.0 * (1.0 - y2 / 20.0 * bulge)
    share = 0.5 * (x * dy - y * dx) + 0.5 * radius * radius * bulge
    far = radius + magnitude(cx) + magnitude(cy) + tool.a + tool.b
    sides = magnitude(x * dy) + magnitude(y * dx)
    noise = 4.0 * _EPS * (sides + magnitude(share) + far * (magnitude(dx) + magnitude(dy)))
    least = 64.0 * _EPS * (tool.n + tool.m) * (1.0 + far / min(tool.a, tool.b))
    unsure = magnitude(share) if magnitude(beyond) <= least else 0.0
    return (share, noise + unsure) if beyond < 0.0 else (0.0, unsure)


@jit_apart
def contact_area(tool, whole, disc, room):
    """Area of the tool within the disc (a `Circle`), and what it may be wrong by.

    whole : area of the tool
    room : a `_pressure.Memory`, for crossings of a piece, points of `POINTS`, and the stack of intervals
    """
    x, y, radius = magnitude(disc.x), magnitude(disc.y), disc.radius
    if sqrt((x + tool.a) * (x + tool.a) + (y + tool.b) * (y + tool.b)) <= radius:
        return whole, 4.0 * _EPS * whole
    left, below = max(x - tool.a, 0.0), max(y - tool.b, 0.0)
    if sqrt(left * left + below * below) >= radius:
        return 0.0, 0.0
    # along the outline
    total, noise, count, points = 0.0, 0.0, np.int64(0), room.points
    for k in range(2 * PIECES):
        share, doubt, count = _outline_within(float(k // 2), -1.0 if k % 2 else 1.0, tool, disc, count, room)
        total, noise = total + share, noise + doubt

    # arcs of the disc's edge between the points on it, by their direction
    arcs, doubts = 0.0, 0.0
    if count == 0 and _tool.excess(tool, disc.x + radius, disc.y) < 0.0:
        arcs, doubts = math.pi * radius * radius, 4.0 * _EPS * (math.pi * radius * radius)
    for i in range(1, count):
        j = i
        while j > 0 and points[j - 1, 0] > points[j, 0]:
            for c in range(3):
                points[j - 1, c], points[j, c] = points[j, c], points[j - 1, c]
            j -= 1
    for j in range(count):
        k = j + 1 if j + 1 < count else 0
        turn = points[k, 0] - points[j, 0] + (_TURN if k == 0 else 0.0)
        share, doubt = _arc_within(tool, disc, points[j], points[k], turn)
        arcs, doubts = arcs + share, doubts + doubt

    most = min(whole, math.pi * radius * radius)
    total, noise = total + arcs, noise + doubts
    if not (total >= -_SLACK * most - noise and total <= (1.0 + _SLACK) * most + noise):
        return min(max(total, 0.0), most), most
    return min(max(total, 0.0), most), noise
