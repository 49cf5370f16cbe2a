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
from typing import NamedTuple

import numpy as np

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths import quadrature
from kernels.maths.quadrature import adapt, open_panel
from kernels.polisher.linkage import sum4
from kernels.wear import _dwell, _pressure, _tool
from kernels.wear._dwell import Arm
from kernels.wear._pressure import Areas
from kernels.wear._scene import Ride
from kernels.wear._speed_integral import along_arc, extremes, half_circle
from kernels.wear._tool import CROSSING_LIMIT, PIECES, Circle, Tool, arctan2, outline, sincos

FAR_SIDE, SPIN = 4.0, 5.0
"""Kinds of panels beside the outline's pieces: the second integral of (2); all of a work on the pivot itself."""

_EPS = 2.0**-52
_AT_TURN = 1e-11  # a gap over its largest, or a step: beyond that a split is none where the arm turns
_TURN = 2.0 * math.pi


class Scene(NamedTuple):
    """The machine, a radius of the work, and the areas of contact."""

    arm: Arm
    tool: Tool
    ride: Ride
    r: float
    areas: Areas


class Direction(NamedTuple):
    """Cosine and sine of an angle."""

    c: float
    s: float


class Sight(NamedTuple):
    """Of an outline's point from the pivot: chi, gamma, their slopes, psi/2, and the rounding.

    The rounding is relative, of sin chi and the slopes.
    """

    chi: Direction
    gamma: Direction
    chi_slope: float
    gamma_slope: float
    arc: Direction
    blur: float


class Margins(NamedTuple):
    """rho^2, rho^2 - (w-r)^2, (w+r)^2 - rho^2 of an outline's point, and their rounding, absolute."""

    rho2: float
    near: float
    wide: float
    noise: float


class Split(NamedTuple):
    """A circle about which panels are split, and its vertex excess."""

    circle: Circle
    start: float


class Stops(NamedTuple):
    """Angles of the arm at which wear is not smooth, and how many."""

    angles: np.ndarray
    count: int


class Room(NamedTuple):
    """Space for panels, splits, angles, the stack of intervals, and the stops of the arm."""

    pool: np.ndarray
    found: np.ndarray
    angles: np.ndarray
    stack: np.ndarray
    still: np.ndarray


@jit_apart
def room():
    """A `Room`."""
    found, angles = np.empty(_tool.ARC_LIMIT), np.empty(_tool.ARC_LIMIT)
    return Room(np.empty(quadrature.POOL), found, angles, np.empty(_tool.STACK), np.empty(_dwell.STOP_LIMIT))


@jit_apart
def _passage(scene, c, s, top, bottom, arc):
    """Sum over the strokes of E dtheta/dphi at one angle of the arm; `arc`: psi/2 of the arc."""
    strokes, speed = _dwell.strokes(scene.arm, c, s, top, bottom), scene.ride.speed
    total = 0.0
    if strokes.back_dwell > 0.0:
        total += strokes.back_dwell * _polish(scene, speed * strokes.back, arc)
    return total + strokes.forth_dwell * _polish(scene, speed * strokes.forth, arc)


@jit
def _polish(scene, rate, arc):
    p, q = extremes(rate, scene.ride.spin, scene.r, scene.ride.w)
    if arc.c > 0.0:
        return along_arc(p, q, arc.s, arc.c)
    return half_circle(p, q)


@jit
def _from_frame(ride, c, s):
    """Cosine and sine from the frame, of an angle (c, s) from the direction of w."""
    return ride.turn_c * c - ride.turn_s * s, ride.turn_s * c + ride.turn_c * s


@jit_apart
def _at_angle(scene, c, s, arc, blur):
    """`_passage` with the arm at phi = (c, s) from the direction of w, and its rounding; 0 where it does not come.

    blur: rounding of phi, over that of a number
    """
    cosine, sine = _from_frame(scene.ride, c, s)
    top, bottom, noise = _dwell.gaps(scene.arm, cosine, sine)
    if not (top > 0.0 and bottom > 0.0 and (sine > 0.0 or scene.arm.whirls)):
        return 0.0, 0.0
    weight, doubt, slope = _pressure.weight(scene.areas, c, s)
    total = weight * _passage(scene, cosine, sine, top, bottom, arc)
    return total, total * (noise * blur + (doubt + 4.0 * _EPS * slope * blur))


@jit_apart
def vertex_margins(piece, scene):
    """rho^2 - (w-r)^2 and rho^2 - (w+r)^2 of the vertex where a piece begins, without loss.

    A vertex that is on the ring but for the rounding of its inputs is on it: the two terms of (2) differ by the square
    root of what is left, and wear by that itself.
    """
    reach, w, r, tool = scene.ride.reach, scene.ride.w, scene.r, scene.tool
    a, b = (_tool.side_of(piece) * tool.a, 0.0) if _tool.on_x_axis(piece) else (0.0, tool.b)
    near = sum4(reach, a, r, -w) * sum4(reach, a, -r, w) + b * b
    wide = sum4(reach, a, -r, -w) * sum4(reach, a, r, w) + b * b
    far = reach + magnitude(a) + b + w + r
    least = 4.0 * _EPS * far * far
    return near if magnitude(near) > least else 0.0, wide if magnitude(wide) > least else 0.0


@jit_apart
def _margins(piece, spot, scene):
    """The `Margins` of a spot of the outline.

    From the vertex on, as `crossings` has it: what rounds at the vertex rounds alike where panels are split.
    """
    x, y, missing, reach, tool = spot.x, spot.y, spot.missing, scene.ride.reach, scene.tool
    far = reach + x
    rho2 = far * far + y * y
    near, wide = vertex_margins(piece, scene)
    if not _tool.on_x_axis(piece):
        inward, aside = missing * (missing - 2.0 * tool.b), x * (x + 2.0 * reach)
        noise = 4.0 * _EPS * (magnitude(inward) + magnitude(aside))
        return Margins(rho2, near + (inward + aside), -(wide + (inward + aside)), noise)
    side = _tool.side_of(piece)
    inward = missing * (missing - 2.0 * side * (reach + side * tool.a))
    noise = 2.0 * _EPS * (magnitude(inward) + y * y)
    return Margins(rho2, near + (inward + y * y), -(wide + (inward + y * y)), noise)


@jit
def _about_pivot(scene, piece, spot):
    """The `Sight` of a spot of the outline."""
    w, r, zero = scene.ride.w, scene.r, Direction(0.0, 0.0)
    rho2, near, wide, noise = _margins(piece, spot, scene)
    if not (near > 0.0 and wide > 0.0 and rho2 > 0.0):
        return Sight(zero, zero, 0.0, 0.0, zero, math.inf)
    far, rho, area = scene.ride.reach + spot.x, sqrt(rho2), sqrt(near) * sqrt(wide)
    chi = Direction(0.5 * ((w - r) * (w + r) + rho2) / (w * rho), 0.5 * area / (w * rho))
    outward = far * spot.dx + spot.y * spot.dy
    chi_slope = -(rho2 - (w - r) * (w + r)) * outward / (rho2 * area)
    gamma_slope = (far * spot.dy - spot.y * spot.dx) / rho2
    arc = Direction(sqrt(min(1.0, 0.25 * near / (w * r))), sqrt(min(1.0, 0.25 * wide / (w * r))))
    gamma = Direction(far / rho, spot.y / rho)
    return Sight(chi, gamma, chi_slope, gamma_slope, arc, 4.0 * _EPS + noise / near + noise / wide)


@jit
def _phi(sight, side):
    """Cosine and sine of chi - side gamma, the arm's angle at which the outline's point is on the ring."""
    chi, gamma = sight.chi, sight.gamma
    return chi.c * gamma.c + side * chi.s * gamma.s, chi.s * gamma.c - side * chi.c * gamma.s


@jit_apart
def _outline(piece, x, scene):
    """Integrand of the contour: both sides Y of the outline and both halves of psi; and its rounding."""
    sight = _about_pivot(scene, piece, outline(piece, x, scene.tool))
    blur = sight.blur
    if not blur < math.inf:
        return 0.0, 0.0
    total, noise, turned = 0.0, 0.0, 1.0 + blur * sight.chi.s / _EPS
    for side in (1.0, -1.0):
        c, s = _phi(sight, side)
        slope = _tool.sense(piece) * (side * sight.chi_slope - sight.gamma_slope)
        for half in (1.0, -1.0):
            value, doubt = _at_angle(scene, c, half * s, sight.arc, turned)
            total += slope * value
            noise += magnitude(slope) * (blur * value + doubt)
    return total, noise


@jit
def _pressed(scene, c, s):
    """Weight of the pressure with the arm at (c, s) from the frame, and what it may be wrong by, relative."""
    turn_c, turn_s = scene.ride.turn_c, scene.ride.turn_s
    weight, doubt, slope = _pressure.weight(scene.areas, c * turn_c + s * turn_s, s * turn_c - c * turn_s)
    return weight, doubt + 4.0 * _EPS * slope


@jit_apart
def _far_side_alone(scene, pose):
    """2 E(theta, pi) dtheta/du."""
    if not (scene.arm.whirls or (pose.top > 0.0 and pose.bottom > 0.0)):
        return 0.0
    return 2.0 * pose.growth * _passage(scene, pose.c, pose.s, pose.top, pose.bottom, Direction(0.0, 1.0))


@jit_apart
def _far_side(u, scene):
    """Integrand of the second integral of (2), both halves."""
    pose = _dwell.pose_at(scene.arm, u)
    weight, doubt = _pressed(scene, pose.c, pose.s)
    total = _far_side_alone(scene, pose) * weight
    return total, total * (pose.noise + doubt)


@jit_apart
def _on_pivot(u, scene):
    """Integrand of int v dtheta over the strokes for a work on the pivot, where v does not hang on psi."""
    arm, spin, pose = scene.arm, scene.ride.spin, _dwell.pose_at(scene.arm, u)
    strokes, speed = _dwell.strokes(arm, pose.c, pose.s, pose.top, pose.bottom), scene.ride.speed
    back, forth = magnitude(speed * strokes.back - spin), magnitude(speed * strokes.forth - spin)
    total = strokes.back_dwell * back + strokes.forth_dwell * forth
    return pose.growth * scene.r * total, 4.0 * _EPS * pose.growth * scene.r * total


@jit
def integrand(kind, x, scene):
    """The integrand of a panel of that kind, and its rounding."""
    if kind == FAR_SIDE:
        return _far_side(x, scene)
    if kind == SPIN:
        return _on_pivot(x, scene)
    return _outline(kind, x, scene)


@jit
def _work_centre(scene, c, s):
    """The centre of the work in the tool's frame, with the arm at (c, s) from the frame."""
    ride = scene.ride
    x = ride.w * (c * ride.turn_c + s * ride.turn_s) - ride.reach
    return x, ride.w * (c * ride.turn_s - s * ride.turn_c)


@jit
def _split(k, scene, piece, still):
    """The circles at which panels are split: two about the pivot, then of radius r.

    These are at the angles in `still`, each on either side of the arm.
    """
    ride, r = scene.ride, scene.r
    if k < 2:
        near, wide = vertex_margins(piece, scene)
        radius = ride.w + r if k else magnitude(ride.w - r)
        return Split(Circle(-ride.reach, 0.0, radius), wide if k else near)
    s, c = sincos(still[k // 2 - 1])
    x, y = _work_centre(scene, c, s)
    circle = Circle(x, -y if k % 2 else y, r)
    return Split(circle, _tool.vertex_excess(piece, scene.tool, circle))


@jit_apart
def _settled(x, scene, piece):
    """The same split, if it is where the arm turns, of all of its ways to get there that which is nearest its end.

    By Newton's rule on the arm's gap as the integrand has it, which goes there like a square root: where the point is
    near the line of centres, a split that was found otherwise is off by much more than rounding of the gap.
    """
    unit = scene.arm.unit
    sight = _about_pivot(scene, piece, outline(piece, x, scene.tool))
    least, step = _AT_TURN * unit, 0.0
    if sight.blur < math.inf:
        for k in range(4):
            side, half = 1.0 if k < 2 else -1.0, 1.0 if k % 2 else -1.0
            c, s = _phi(sight, side)
            cosine, sine = _from_frame(scene.ride, c, half * s)
            top, bottom, _ = _dwell.gaps(scene.arm, cosine, sine)
            gap, growth = (top, -1.0) if magnitude(top) < magnitude(bottom) else (bottom, 1.0)
            slope = growth * 0.5 * unit * sine * half * (sight.chi_slope - side * sight.gamma_slope)
            if sine > 0.0 and magnitude(gap) < least and magnitude(gap) < _AT_TURN * magnitude(slope):
                least, step = magnitude(gap), gap / slope
    return x - step if 0.0 < x - step < 1.0 else x


@jit_apart
def _splits_of(piece, scene, stops, room):
    """Puts the ends of a piece's panels into `room`, split where contact ends or v is 0; how many panels."""
    found, splits = room.found, np.int64(1)
    found[0] = 0.0
    for j in range(2 + 2 * stops.count):
        split = _split(j, scene, piece, stops.angles)
        if splits + CROSSING_LIMIT < found.size:
            number = _tool.crossings(piece, scene.tool, split.circle, split.start, found, splits, room.stack)
            for i in range(splits, number if 1 < j < 6 and not scene.arm.whirls else splits):
                found[i] = _settled(found[i], scene, piece)
            splits = number if number >= 0 else splits  # where circle and outline coincide there is none to split
    found[splits] = 1.0
    _tool.sort(found, splits + 1)
    return splits


@jit_apart
def _open_outline(count, scene, stops, room):
    """Opens the panels of the contour; how many panels there are then."""
    for k in range(PIECES):
        piece, found = float(k), room.found
        for j in range(_splits_of(piece, scene, stops, room)):
            start, length = found[j], found[j + 1] - found[j]
            if length > 0.0 and _outline(piece, start + 0.5 * length, scene)[1] > 0.0:
                open_panel(room.pool, count, piece, start, length)
                count += 1
    return count


@jit_apart
def _phase(arm, eta):
    """u of `pose_at`."""
    ahead, behind = arm.most - eta, eta - arm.least
    return 2.0 * arctan2(sqrt(max(behind, 0.0)), sqrt(max(ahead, 0.0))) - 0.5 * math.pi


@jit_apart
def _open_split(pool, count, kind, low, high, scene, stops):
    """Opens panels of that kind from arm's angle low to high, split at the stops; how many panels there are then.

    None is longer than a quarter of a turn, or half of what the arm rocks: 21 nodes may miss a dwell in all of it.
    """
    arm = scene.arm
    longest = 0.25 * _TURN if arm.whirls else 0.5 * (arm.most - arm.least)
    start = low
    while start < high:
        end = min(high, start + longest)
        for k in range(stops.count):
            turns = math.floor((stops.angles[k] - start) / _TURN) if arm.whirls else 0.0
            stop = stops.angles[k] - turns * _TURN
            end = stop if start < stop < end else end
        first, last = (start, end) if arm.whirls else (_phase(arm, start), _phase(arm, end))
        open_panel(pool, count, kind, first, last - first)
        count += 1
        start = end
    return count


@jit_apart
def _open_far_side(pool, scene, angles, number, stops):
    """Opens the panels of the second integral of (2), from the arcs about the pivot; how many there are."""
    arm, ride = scene.arm, scene.ride
    turn = arctan2(ride.turn_s, ride.turn_c) + (math.pi if scene.r > ride.w else 0.0)
    count = np.int64(0)
    for j in range(0, number, 2):
        low, high = turn - angles[j + 1], turn - angles[j]
        if arm.whirls:
            count = _open_split(pool, count, FAR_SIDE, low, high, scene, stops)
        else:
            for k in range(-2, 3):
                first, last = max(low + k * _TURN, arm.least), min(high + k * _TURN, arm.most)
                count = _open_split(pool, count, FAR_SIDE, first, last, scene, stops)
    return count


@jit_apart
def _angle_in_arcs(arm, turn, angles, number):
    """How much of the arm's angle, all strokes, lies within arcs about the pivot."""
    total = 0.0
    for j in range(0, number, 2):
        low, high = turn - angles[j + 1], turn - angles[j]
        if arm.whirls:
            total += high - low
        else:
            for shift in (-_TURN, 0.0, _TURN):
                total += max(min(high + shift, arm.most) - max(low + shift, arm.least), 0.0)
    return total if arm.whirls else 2.0 * total


@jit
def _length_of(angles, number):
    total = 0.0
    for j in range(0, number, 2):
        total += angles[j + 1] - angles[j]
    return total


@jit
def _arcs(scene, room):
    """`arcs` of the circle that counts: that of radius r, where the arm stands still, else about the pivot."""
    ride, tool = scene.ride, scene.tool
    if stands_still(scene.arm):
        s, c = sincos(scene.arm.least)
        x, y = _work_centre(scene, c, s)
        circle, near, far = Circle(x, y, scene.r), math.nan, math.nan
    else:
        circle = Circle(-ride.reach, 0.0, magnitude(ride.w - scene.r))
        near, far = vertex_margins(0.0, scene)[0], vertex_margins(2.0, scene)[0]
    return _tool.arcs(tool, circle, near, far, room.angles, room.found, room.stack)


@jit
def stands_still(arm):
    """Whether the crank has no throw, or none that float64 could tell."""
    return not arm.whirls and not arm.most > arm.least


@jit
def _standing(scene, angles, number):
    """I(r) under an arm that stands still."""
    weight, doubt = _at_rest(scene)
    total = weight * _TURN * magnitude(scene.ride.spin) * scene.r * _length_of(angles, number)
    return total, (64.0 * _EPS + doubt) * total


@jit
def _at_rest(scene):
    """Weight of the pressure where it is the same at all of the arm's angles, and what it may be wrong by, relative."""
    s, c = sincos(scene.arm.least)
    return _pressed(scene, c, s)


@jit
def _centre(scene, angles, number):
    """I(0): the way of the centre through the tool, whatever the arm's rate."""
    ride = scene.ride
    passed = _angle_in_arcs(scene.arm, arctan2(ride.turn_s, ride.turn_c), angles, number)
    unit = _TURN * magnitude(ride.speed) * ride.w
    return unit * passed, 64.0 * _EPS * unit * (passed + (1.0 if passed > 0.0 else 0.0))


@jit
def _weight_about(scene, angle):
    """Weight of the pressure where the point at psi = pi is at this angle from the arm; its largest for NaN."""
    areas, (s, c) = scene.areas, sincos(angle)
    if angle == angle:
        return _pressure.weight(areas, -c if scene.r > scene.ride.w else c, s)[0]
    return 1.0 / max(areas.lowest, _pressure.FAINT * areas.largest) if areas.panels > 0 else 1.0


@jit
def _weight_at_ends(scene, angles, number):
    """The largest weight of the pressure at the ends of arcs."""
    most = 0.0
    for j in range(number):
        most = max(most, _weight_about(scene, angles[j]))
    return most


@jit
def _unsure_error(scene, unsure, about):
    """What it comes to that so much of the circle, about that angle, may be in contact or not."""
    arm = scene.arm
    way = 1.0 if arm.whirls else arm.most - arm.least
    return 8.0 * unsure * _far_side_alone(scene, _dwell.pose_at(arm, 0.0)) / way * _weight_about(scene, about)


@jit_apart
def _about_the_pivot(scene, number, unsure, about, rtol, room):
    """I(r) of a work whose centre is the pivot: v is the same all along an arc."""
    arm, stops = scene.arm, Stops(room.still, _dwell.find_stops(scene, room.still))
    first, last = _dwell.span(arm) if arm.whirls else (arm.least, arm.most)
    count = _open_split(room.pool, np.int64(0), SPIN, first, last, scene, stops)
    value, error = adapt(integrand, scene, room.pool, count, rtol)
    if unsure > 0.0:
        error += _unsure_error(scene, unsure, about)
    length, (weight, doubt) = _length_of(room.angles, number), _at_rest(scene)
    return weight * value * length, weight * (error * length + (64.0 * _EPS + doubt * length) * value)


@jit_apart
def _by_parts(scene, number, unsure, about, rtol, room):
    """I(r) by (2)."""
    ride, stops = scene.ride, Stops(room.still, _dwell.find_stops(scene, room.still))
    count = _open_far_side(room.pool, scene, room.angles, number, stops)
    if scene.r > 0.0:
        count = _open_outline(count, scene, stops, room)
    value, error = adapt(integrand, scene, room.pool, count, rtol)
    if unsure > 0.0:
        error += _unsure_error(scene, unsure, about)
    if scene.r == 0.0:
        ends = _TURN * magnitude(ride.speed) * ride.w * _weight_at_ends(scene, room.angles, number)
        error += 64.0 * _EPS * (value + ends)
    return value, error


@jit_apart
def profile(scene, rtol, room):
    """I(r) of (1), and its error: inf if it could not be had."""
    number, unsure, about = _arcs(scene, room)
    if number < 0:
        return math.nan, math.inf
    if stands_still(scene.arm):
        return _standing(scene, room.angles, number)
    if scene.ride.w == 0.0:
        return _about_the_pivot(scene, number, unsure, about, rtol, room)
    if scene.r == 0.0 and scene.areas.panels == 0:
        return _centre(scene, room.angles, number)
    return _by_parts(scene, number, unsure, about, rtol, room)
