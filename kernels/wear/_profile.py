"""Wear of a turning work by a tool on a rocking arm, at one radius, averaged over the phase of the work.

With theta the crank's angle, psi that about the work's centre from the direction of w, and v of `_speed_integral`,
    I(r) = int_0^2pi dtheta W int_contact v dpsi                                                     (1)
with W = 1 for a constant pressure, and W = 1/A(phi) for a constant load on an area A of contact (`_pressure`).
By parts in psi this is an integral along the outline of the tool, for each half psi > 0 and psi < 0
    I = sum_halves [ contour W E(theta, abs(psi)) dtheta + int W E(theta, pi) [psi = pi in contact] dtheta ],
    E(theta, psi) = int_0^psi v dpsi,                                                                (2)
where the outline's point at a distance rho from the pivot is at radius r just when the arm is at phi = +-chi -+ gamma
from the direction of w (chi, gamma: angles at the pivot from w, and from the arm, to the point):
    cos chi = (w^2 + rho^2 - r^2)/(2 w rho),  S = 4 w r abs(sin psi)/2 = sqrt((rho^2 - (w-r)^2)((w+r)^2 - rho^2))
    cos^2(psi/2) = (rho^2 - (w-r)^2)/(4 w r)                                                         (3)
No root is sought at any instant, and arcs that appear, merge or vanish leave no trace: they are where phi turns. What
is left are ends of contact at rho = abs(w +- r) and where the arm turns: crossings of circles with the outline, where
panels are split. dtheta = dphi/abs(alpha') of both strokes is closed, too (`_dwell`). Derived here.
"""

import math

import numpy as np

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths import quadrature
from kernels.maths.quadrature import adapt, open_panel
from kernels.polisher.linkage import sum4
from kernels.wear import _dwell, _dwell_still, _pressure, _tool
from kernels.wear._speed_integral import along_arc, extremes, half_circle
from kernels.wear._tool import CROSSING_LIMIT, PIECES, arctan2, outline, sincos

FAR_SIDE, SPIN = 4.0, 5.0
"""Kinds of panels beside the outline's pieces: the second integral of (2); all of a work on the pivot itself."""

_EPS = 2.0**-52
_AT_TURN = 1e-11  # a gap over its largest, or a step: beyond that a split is none where the arm turns
_TURN = 2.0 * math.pi


@jit_call
def _passage(scene, c, s, top, bottom, arc):
    """Sum over the strokes of E dtheta/dphi at one angle of the arm; `arc`: of what arc, sine and cosine of psi/2."""
    arm, _, (speed, spin, _, w, _, _), r, _ = scene
    rate_back, dwell_back, rate_forth, dwell_forth = _dwell.strokes(arm, c, s, top, bottom)
    total = 0.0
    if dwell_back > 0.0:
        total += dwell_back * _polish(speed * rate_back, spin, r, w, arc)
    return total + dwell_forth * _polish(speed * rate_forth, spin, r, w, arc)


@jit
def _polish(rate, spin, r, w, arc):
    p, q = extremes(rate, spin, r, w)
    if arc[1] > 0.0:
        return along_arc(p, q, arc[0], arc[1])
    return half_circle(p, q)


@jit_call
def _at_angle(scene, c, s, arc, blur):
    """`_passage` with the arm at phi = (c, s) from the direction of w, and its rounding; 0 where it does not come.

    blur: rounding of phi, over that of a number
    """
    arm, _, (_, _, _, _, turn_c, turn_s), _, loaded = scene
    cosine, sine = turn_c * c - turn_s * s, turn_s * c + turn_c * s
    top, bottom, noise = _dwell.gaps(arm, cosine, sine)
    if not (top > 0.0 and bottom > 0.0 and (sine > 0.0 or arm[3])):
        return 0.0, 0.0
    weight, doubt, slope = _pressure.weight(loaded, c, s)
    total = weight * _passage(scene, cosine, sine, top, bottom, arc)
    return total, total * (noise * blur + (doubt + 4.0 * _EPS * slope * blur))


@jit_call
def vertex_margins(piece, tool, reach, w, r):
    """rho^2 - (w-r)^2 and rho^2 - (w+r)^2 of the vertex where a piece begins, without loss.

    A vertex that is on the ring but for the rounding of its inputs is on it: the two terms of (2) differ by the square
    root of what is left, and wear by that itself.
    """
    a, b = (_tool.side_of(piece) * tool[0], 0.0) if _tool.on_x_axis(piece) else (0.0, tool[1])
    near = sum4(reach, a, r, -w) * sum4(reach, a, -r, w) + b * b
    wide = sum4(reach, a, -r, -w) * sum4(reach, a, r, w) + b * b
    far = reach + magnitude(a) + b + w + r
    least = 4.0 * _EPS * far * far
    return near if magnitude(near) > least else 0.0, wide if magnitude(wide) > least else 0.0


@jit_call
def _margins(piece, point, tool, reach, w, r):
    """rho^2, rho^2 - (w-r)^2, (w+r)^2 - rho^2 of an outline's point, and their rounding, absolute.

    From the vertex on, as `crossings` has it: what rounds at the vertex rounds alike where panels are split.
    """
    x, y, _, _, missing = point
    far = reach + x
    rho2 = far * far + y * y
    near, wide = vertex_margins(piece, tool, reach, w, r)
    if not _tool.on_x_axis(piece):
        inward, aside = missing * (missing - 2.0 * tool[1]), x * (x + 2.0 * reach)
        noise = 4.0 * _EPS * (magnitude(inward) + magnitude(aside))
        return rho2, near + (inward + aside), -(wide + (inward + aside)), noise
    side = _tool.side_of(piece)
    inward = missing * (missing - 2.0 * side * (reach + side * tool[0]))
    noise = 2.0 * _EPS * (magnitude(inward) + y * y)
    return rho2, near + (inward + y * y), -(wide + (inward + y * y)), noise


@jit
def _about_pivot(scene, piece, point):
    """Of an outline's point: chi and gamma as cosine and sine, their slopes, sine and cosine of psi/2, and rounding.

    The rounding is relative, of sin chi and the slopes.
    """
    _, tool, (_, _, reach, w, _, _), r, _ = scene
    x, y, dx, dy, _ = point
    rho2, near, wide, noise = _margins(piece, point, tool, reach, w, r)
    if not (near > 0.0 and wide > 0.0 and rho2 > 0.0):
        return (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), math.inf
    far, rho, area = reach + x, sqrt(rho2), sqrt(near) * sqrt(wide)
    chi = 0.5 * ((w - r) * (w + r) + rho2) / (w * rho), 0.5 * area / (w * rho)
    outward = far * dx + y * dy
    slopes = -(rho2 - (w - r) * (w + r)) * outward / (rho2 * area), (far * dy - y * dx) / rho2
    arc = sqrt(min(1.0, 0.25 * wide / (w * r))), sqrt(min(1.0, 0.25 * near / (w * r)))
    return chi, (far / rho, y / rho), slopes, arc, 4.0 * _EPS + noise / near + noise / wide


@jit_call
def _outline(piece, x, scene):
    """Integrand of the contour: both sides Y of the outline and both halves of psi; and its rounding."""
    chi, gamma, slopes, arc, blur = _about_pivot(scene, piece, outline(piece, x, scene[1]))
    if not blur < math.inf:
        return 0.0, 0.0
    total, noise, turned = 0.0, 0.0, 1.0 + blur * chi[1] / _EPS
    for side in (1.0, -1.0):
        c, s = chi[0] * gamma[0] + side * chi[1] * gamma[1], chi[1] * gamma[0] - side * chi[0] * gamma[1]
        slope = _tool.sense(piece) * (side * slopes[0] - slopes[1])
        for half in (1.0, -1.0):
            value, doubt = _at_angle(scene, c, half * s, arc, turned)
            total += slope * value
            noise += magnitude(slope) * (blur * value + doubt)
    return total, noise


@jit
def _pressed(scene, c, s):
    """Weight of the pressure with the arm at (c, s) from the frame, and what it may be wrong by, relative."""
    turn_c, turn_s = scene[2][4], scene[2][5]
    weight, doubt, slope = _pressure.weight(scene[4], c * turn_c + s * turn_s, s * turn_c - c * turn_s)
    return weight, doubt + 4.0 * _EPS * slope


@jit_call
def _far_side_alone(u, scene):
    """2 E(theta, pi) dtheta/du, its rounding, and the arm's cosine and sine."""
    arm = scene[0]
    if arm[3]:
        s, c = sincos(u)
        top, bottom, noise = _dwell.gaps(arm, c, s)
        return 2.0 * _passage(scene, c, s, top, bottom, (1.0, 0.0)), noise, c, s
    eta, top, bottom, growth = _dwell.gaps_at(arm, u)
    s, c = sincos(eta)
    if not (top > 0.0 and bottom > 0.0):
        return 0.0, 0.0, c, s
    return 2.0 * growth * _passage(scene, c, s, top, bottom, (1.0, 0.0)), 4.0 * _EPS, c, s


@jit_call
def _far_side(u, scene):
    """Integrand of the second integral of (2), both halves."""
    total, noise, c, s = _far_side_alone(u, scene)
    weight, doubt = _pressed(scene, c, s)
    total *= weight
    return total, total * (noise + doubt)


@jit_call
def _on_pivot(u, scene):
    """Integrand of int v dtheta over the strokes for a work on the pivot, where v does not hang on psi."""
    arm, _, (speed, spin, _, _, _, _), r, _ = scene
    if arm[3]:
        s, c = sincos(u)
        top, bottom, _ = _dwell.gaps(arm, c, s)
        growth = 1.0
    else:
        eta, top, bottom, growth = _dwell.gaps_at(arm, u)
        s, c = sincos(eta)
    rate_back, dwell_back, rate_forth, dwell_forth = _dwell.strokes(arm, c, s, top, bottom)
    total = dwell_back * magnitude(speed * rate_back - spin) + dwell_forth * magnitude(speed * rate_forth - spin)
    return growth * r * total, 4.0 * _EPS * growth * r * total


@jit
def integrand(kind, x, scene):
    """The integrand of a panel of that kind, and its rounding."""
    if kind == FAR_SIDE:
        return _far_side(x, scene)
    if kind == SPIN:
        return _on_pivot(x, scene)
    return _outline(kind, x, scene)


@jit
def _split_circle(k, scene, piece, still):
    """Centre, radius and vertex excess of the circles at which panels are split: two about the pivot, then of radius r.

    These are at the angles in `still`, each on either side of the arm.
    """
    _, tool, (_, _, reach, w, turn_c, turn_s), r, _ = scene
    if k < 2:
        radius = w + r if k else magnitude(w - r)
        margins = vertex_margins(piece, tool, reach, w, r)
        return -reach, 0.0, radius, margins[1] if k else margins[0]
    s, c = sincos(still[k // 2 - 1])
    x, y = w * (c * turn_c + s * turn_s) - reach, w * (c * turn_s - s * turn_c)
    y = -y if k % 2 else y
    return x, y, r, _tool.vertex_excess(piece, tool, x, y, r)


@jit_call
def _settled(x, scene, piece):
    """The same split, if it is where the arm turns, of all of its ways to get there that which is nearest its end.

    By Newton's rule on the arm's gap as the integrand has it, which goes there like a square root: where the point is
    near the line of centres, a split that was found otherwise is off by much more than rounding of the gap.
    """
    arm, tool, (_, _, _, _, turn_c, turn_s), _, _ = scene
    chi, gamma, slopes, _, blur = _about_pivot(scene, piece, outline(piece, x, tool))
    least, step = _AT_TURN * arm[1][0], 0.0
    if blur < math.inf:
        for k in range(4):
            side, half = 1.0 if k < 2 else -1.0, 1.0 if k % 2 else -1.0
            c, s = chi[0] * gamma[0] + side * chi[1] * gamma[1], half * (chi[1] * gamma[0] - side * chi[0] * gamma[1])
            cosine, sine = turn_c * c - turn_s * s, turn_s * c + turn_c * s
            top, bottom, _ = _dwell.gaps(arm, cosine, sine)
            gap, growth = (top, -1.0) if magnitude(top) < magnitude(bottom) else (bottom, 1.0)
            slope = growth * 0.5 * arm[1][0] * sine * half * (slopes[0] - side * slopes[1])
            if sine > 0.0 and magnitude(gap) < least and magnitude(gap) < _AT_TURN * magnitude(slope):
                least, step = magnitude(gap), gap / slope
    return x - step if 0.0 < x - step < 1.0 else x


@jit_call
def _open_outline(pool, count, scene, found, stack, stops):
    """Opens the panels of the contour, split where contact ends or v is 0; how many panels there are then."""
    for k in range(PIECES):
        piece, splits = float(k), int(1.0)
        found[0] = 0.0
        for j in range(2 + 2 * stops[1]):
            x, y, radius, start = _split_circle(j, scene, piece, stops[0])
            if splits + CROSSING_LIMIT < found.size:
                number = _tool.crossings(piece, scene[1], x, y, radius, start, found, splits, stack)
                for i in range(splits, number if 1 < j < 6 and not scene[0][3] else splits):
                    found[i] = _settled(found[i], scene, piece)
                splits = number if number >= 0 else splits  # where circle and outline coincide there is none to split
        found[splits] = 1.0
        _tool.sort(found, splits + 1)
        for j in range(splits):
            start, length = found[j], found[j + 1] - found[j]
            if length > 0.0 and _outline(piece, start + 0.5 * length, scene)[1] > 0.0:
                open_panel(pool, count, piece, start, length)
                count += 1
    return count


@jit_call
def _phase(arm, eta):
    """u of `gaps_at`."""
    least, most = arm[2]
    ahead, behind = most - eta, eta - least
    return 2.0 * arctan2(sqrt(max(behind, 0.0)), sqrt(max(ahead, 0.0))) - 0.5 * math.pi


@jit_call
def _open_split(pool, count, kind, low, high, scene, stops):
    """Opens panels of that kind from arm's angle low to high, split at the stops; how many panels there are then.

    None is longer than a quarter of a turn, or half of what the arm rocks: 21 nodes may miss a dwell in all of it.
    """
    arm, still = scene[0], stops[0]
    longest = 0.25 * _TURN if arm[3] else 0.5 * (arm[2][1] - arm[2][0])
    start = low
    while start < high:
        end = min(high, start + longest)
        for k in range(stops[1]):
            turns = math.floor((still[k] - start) / _TURN) if arm[3] else 0.0
            stop = still[k] - turns * _TURN
            end = stop if start < stop < end else end
        first, last = (start, end) if arm[3] else (_phase(arm, start), _phase(arm, end))
        open_panel(pool, count, kind, first, last - first)
        count += 1
        start = end
    return count


@jit_call
def _open_far_side(pool, scene, angles, number, stops):
    """Opens the panels of the second integral of (2), from the arcs about the pivot; how many there are."""
    arm, _, (_, _, _, w, turn_c, turn_s), r, _ = scene
    turn = arctan2(turn_s, turn_c) + (math.pi if r > w else 0.0)
    count = int(0.0)
    for j in range(0, number, 2):
        low, high = turn - angles[j + 1], turn - angles[j]
        if arm[3]:
            count = _open_split(pool, count, FAR_SIDE, low, high, scene, stops)
        else:
            for k in range(-2, 3):
                first, last = max(low + k * _TURN, arm[2][0]), min(high + k * _TURN, arm[2][1])
                count = _open_split(pool, count, FAR_SIDE, first, last, scene, stops)
    return count


@jit_call
def _angle_in_arcs(arm, turn, angles, number):
    """How much of the arm's angle, all strokes, lies within arcs about the pivot."""
    total = 0.0
    for j in range(0, number, 2):
        low, high = turn - angles[j + 1], turn - angles[j]
        if arm[3]:
            total += high - low
        else:
            for shift in (-_TURN, 0.0, _TURN):
                total += max(min(high + shift, arm[2][1]) - max(low + shift, arm[2][0]), 0.0)
    return total if arm[3] else 2.0 * total


@jit
def _length_of(angles, number):
    total = 0.0
    for j in range(0, number, 2):
        total += angles[j + 1] - angles[j]
    return total


@jit
def _circle(scene):
    """The circle whose arcs within the tool count: that of radius r, where the arm stands still, else about the pivot.

    Its centre in the tool's frame, its radius, and `starts` of `arcs`.
    """
    arm, tool, (_, _, reach, w, turn_c, turn_s), r, _ = scene
    if stands_still(arm):
        s, c = sincos(arm[2][0])
        x, y = w * (c * turn_c + s * turn_s) - reach, w * (c * turn_s - s * turn_c)
        return x, y, r, math.nan, math.nan
    near, far = vertex_margins(0.0, tool, reach, w, r)[0], vertex_margins(2.0, tool, reach, w, r)[0]
    return -reach, 0.0, magnitude(w - r), near, far


@jit
def stands_still(arm):
    """Whether the crank has no throw, or none that float64 could tell."""
    return not arm[3] and not arm[2][1] > arm[2][0]


@jit
def _standing(scene, angles, number):
    """I(r) under an arm that stands still."""
    _, _, (_, spin, _, _, _, _), r, _ = scene
    weight, doubt = _at_rest(scene)
    total = weight * _TURN * magnitude(spin) * r * _length_of(angles, number)
    return total, (64.0 * _EPS + doubt) * total


@jit
def _at_rest(scene):
    """Weight of the pressure where it is the same at all of the arm's angles, and what it may be wrong by, relative."""
    s, c = sincos(scene[0][2][0])
    return _pressed(scene, c, s)


@jit
def _centre(scene, angles, number):
    """I(0): the way of the centre through the tool, whatever the arm's rate."""
    arm, _, (speed, _, _, w, turn_c, turn_s), _, _ = scene
    passed = _angle_in_arcs(arm, arctan2(turn_s, turn_c), angles, number)
    unit = _TURN * magnitude(speed) * w
    return unit * passed, 64.0 * _EPS * unit * (passed + (1.0 if passed > 0.0 else 0.0))


@jit
def _weight_about(scene, angle):
    """Weight of the pressure where the point at psi = pi is at this angle from the arm; its largest for NaN."""
    _, _, (_, _, _, w, _, _), r, loaded = scene
    s, c = sincos(angle)
    if angle == angle:
        return _pressure.weight(loaded, -c if r > w else c, s)[0]
    _, count, lowest, largest = loaded
    return 1.0 / max(lowest, _pressure.FAINT * largest) if count > 0 else 1.0


@jit
def _weight_at_ends(scene, angles, number):
    """The largest weight of the pressure at the ends of arcs."""
    most = 0.0
    for j in range(number):
        most = max(most, _weight_about(scene, angles[j]))
    return most


@jit_call
def room():
    """Memory for panels, splits, angles, the stack of intervals, and the stops of the arm."""
    return (
        np.empty(quadrature.POOL), np.empty(_tool.ARC_LIMIT), np.empty(_tool.ARC_LIMIT),
        np.empty(_tool.STACK), np.empty(_dwell_still.STOP_LIMIT),
    )  # fmt: skip


@jit_call
def profile(scene, rtol, work):
    """I(r) of (1), its error, and whether it could be had.

    Parameters
    ----------
    scene : (arm of `_dwell`, tool of `_tool`, (rate of the crank, of the work, L, w, cosine and sine of the
        direction of w from b + beta), r, areas of contact of `_pressure`)
    work : `room`
    """
    arm, tool, ride, r, loaded = scene
    pool, found, angles, stack, still = work
    x, y, radius, near, far = _circle(scene)
    number, unsure, about = _tool.arcs(tool, x, y, radius, near, far, angles, found, stack)
    if number < 0:
        return math.nan, math.inf, False
    if stands_still(arm):
        value, error = _standing(scene, angles, number)
        return value, error, True
    on_pivot = ride[3] == 0.0
    if r == 0.0 and not on_pivot and loaded[1] == 0:
        value, error = _centre(scene, angles, number)
        return value, error, True
    stops = still, _dwell_still.stops_of(scene, still)
    if on_pivot:
        first, last = _dwell_still.span(arm) if arm[3] else arm[2]
        count = _open_split(pool, int(0.0), SPIN, first, last, scene, stops)
    else:
        count = _open_far_side(pool, scene, angles, number, stops)
        if r > 0.0:
            count = _open_outline(pool, count, scene, found, stack, stops)
    value, error = adapt(integrand, scene, pool, count, rtol)
    if unsure > 0.0:
        way = 1.0 if arm[3] else arm[2][1] - arm[2][0]
        error += 8.0 * unsure * _far_side_alone(0.0, scene)[0] / way * _weight_about(scene, about)
    if r == 0.0 and not on_pivot:
        ends = _TURN * magnitude(ride[0]) * ride[3] * _weight_at_ends(scene, angles, number)
        error += 64.0 * _EPS * (value + ends)
    if on_pivot:
        length = _length_of(angles, number)
        weight, doubt = _at_rest(scene)
        value, error = weight * value * length, weight * (error * length + (64.0 * _EPS + doubt * length) * value)
    return value, error, True
