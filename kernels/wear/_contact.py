"""Area of a tool's footprint within the disc of a workpiece.

By Green's theorem, about the tool's centre: outline within the disc, and arcs of the disc's edge within the tool,
    A = sum_outline (X dY - Y dX)/2 + sum_arcs [P x Q/2 + R^2 (t - sin t)/2]                         (1)
with P and Q the ends of an arc and t its angle. On a piece of `_tool`, with z = small^k and q = 1/j,
    int large dsmall = small sum_i (-q)_i/i! z^i/(1 + k i),  z <= 1/2,                               (2)
is an incomplete beta function, whose terms fall faster than 2^-i. Every arc is judged by itself, and what rounding may
misjudge counts as noise. Source: derived here; (2) is DLMF 8.17.7.
"""

import math

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import magnitude, sqrt
from kernels.wear import _tool
from kernels.wear._tool import PIECES, arctan2, outline, power, sincos

POINTS = (2 * (_tool.ARC_LIMIT + 2 * PIECES), 3)

_EPS = 2.0**-52
_TERMS = 80
_ASIDE = 0.38
_SLACK = 1e-9
_TURN = 2.0 * math.pi


@jit_call
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


@jit_call
def sector(piece, x, tool):
    """Area between the tool's centre and its outline from 0 to x of a piece, and X and Y there."""
    a, b, n, m, _, _ = tool
    px, py, _, _, missing = outline(piece, x, tool)
    if _tool.on_x_axis(piece):
        return a * b * (py / b * (_beta(x, m, n) - 0.5 * (1.0 - missing / a))), px, py
    return a * b * (magnitude(px) / a * (_beta(x, n, m) - 0.5 * (1.0 - missing / b))), px, py


@jit_call
def whole_area(tool):
    """Area of the tool."""
    return 4.0 * (sector(0.0, 1.0, tool)[0] + sector(1.0, 1.0, tool)[0])


@jit_call
def _outline_within(piece, mirror, tool, disc, count, room):
    """Adds the points of half a piece on the disc's edge; its share of (1), what it may be wrong by, and the count."""
    cx, cy, radius = disc
    found, points, stack = room
    first = int(1.0)
    start = _tool.vertex_excess(piece, tool, cx, mirror * cy, radius)
    found[0] = 0.0
    number = _tool.crossings(piece, tool, cx, mirror * cy, radius, start, found, first, stack)
    splits = max(number, 1)
    found[splits] = 1.0
    _tool.sort(found, splits + 1)
    total, noise = 0.0, 0.0
    behind, px, py = sector(piece, 0.0, tool)
    for j in range(splits + 1):
        ahead, x, y = sector(piece, found[j], tool)
        if 0 < j < splits or _on_edge(x, mirror * y, disc):
            points[count, 0], points[count, 1], points[count, 2] = arctan2(mirror * y - cy, x - cx), x, mirror * y
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
    u, v = x - disc[0], y - disc[1]
    return u * u + v * v - disc[2] * disc[2]


@jit
def _on_edge(x, y, disc):
    """Whether rounding decides on which side of the disc's edge a point is."""
    far = magnitude(x) + magnitude(y) + magnitude(disc[0]) + magnitude(disc[1]) + disc[2]
    return magnitude(_beyond(x, y, disc)) <= 4.0 * _EPS * far * far


@jit
def _bulge(t):
    """t - sin t, for t >= 0."""
    if t > 0.5:
        return t - sincos(t)[0]
    y = t * t
    return t * y / 6.0 * (1.0 - y / 20.0 * (1.0 - y / 42.0 * (1.0 - y / 72.0 * (1.0 - y / 110.0 * (1.0 - y / 156.0)))))


@jit_call
def _arc_within(tool, disc, one, two, turn):
    """Share of (1) of the arc of the disc's edge between two points, by about `turn`, and what it may be wrong by."""
    cx, cy, radius = disc
    u, v, dx, dy = one[1] - cx, one[2] - cy, two[1] - one[1], two[2] - one[2]
    if turn < 3.0:
        turn = magnitude(arctan2(u * dy - v * dx, u * (u + dx) + v * (v + dy)))
    s, c = sincos(one[0] + _ASIDE * turn)
    beyond = _tool.excess(tool, cx + radius * c, cy + radius * s)
    share = 0.5 * (one[1] * dy - one[2] * dx) + 0.5 * radius * radius * _bulge(turn)
    far = radius + magnitude(cx) + magnitude(cy) + tool[0] + tool[1]
    sides = magnitude(one[1] * dy) + magnitude(one[2] * dx)
    noise = 4.0 * _EPS * (sides + magnitude(share) + far * (magnitude(dx) + magnitude(dy)))
    least = 64.0 * _EPS * (tool[2] + tool[3]) * (1.0 + far / min(tool[0], tool[1]))
    unsure = magnitude(share) if magnitude(beyond) <= least else 0.0
    return (share, noise + unsure) if beyond < 0.0 else (0.0, unsure)


@jit
def _sort_points(points, count):
    for i in range(1, count):
        angle, x, y = points[i, 0], points[i, 1], points[i, 2]
        j = i
        while j > 0 and points[j - 1, 0] > angle:
            for k in range(3):
                points[j, k] = points[j - 1, k]
            j -= 1
        points[j, 0], points[j, 1], points[j, 2] = angle, x, y


@jit_call
def _edge_within(tool, disc, points, count):
    """Share of (1) of all arcs of the disc's edge within the tool, and what it may be wrong by."""
    if count == 0:
        inside = _tool.excess(tool, disc[0] + disc[2], disc[1]) < 0.0
        area = math.pi * disc[2] * disc[2] if inside else 0.0
        return area, 4.0 * _EPS * area
    _sort_points(points, count)
    total, noise = 0.0, 0.0
    for j in range(count):
        k = j + 1 if j + 1 < count else 0
        turn = points[k, 0] - points[j, 0] + (_TURN if k == 0 else 0.0)
        one, two = (points[j, 0], points[j, 1], points[j, 2]), (points[k, 0], points[k, 1], points[k, 2])
        share, doubt = _arc_within(tool, disc, one, two, turn)
        total, noise = total + share, noise + doubt
    return total, noise


@jit_call
def contact_area(tool, whole, disc, room):
    """Area of the tool within the disc (centre in the tool's frame, radius), and what it may be wrong by.

    whole : `whole_area`; room : found, points (`POINTS`), stack of intervals
    """
    x, y, radius = magnitude(disc[0]), magnitude(disc[1]), disc[2]
    if sqrt((x + tool[0]) * (x + tool[0]) + (y + tool[1]) * (y + tool[1])) <= radius:
        return whole, 4.0 * _EPS * whole
    left, below = max(x - tool[0], 0.0), max(y - tool[1], 0.0)
    if sqrt(left * left + below * below) >= radius:
        return 0.0, 0.0
    total, noise, count = 0.0, 0.0, int(0.0)
    for k in range(2 * PIECES):
        share, doubt, count = _outline_within(float(k // 2), -1.0 if k % 2 else 1.0, tool, disc, count, room)
        total, noise = total + share, noise + doubt
    share, doubt = _edge_within(tool, disc, room[1], count)
    most = min(whole, math.pi * radius * radius)
    total, noise = total + share, noise + doubt
    if not (total >= -_SLACK * most - noise and total <= (1.0 + _SLACK) * most + noise):
        return min(max(total, 0.0), most), most
    return min(max(total, 0.0), most), noise
