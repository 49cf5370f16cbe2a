"""Wear at one radius, by panels of the integrals of `_contour`, and what needs no integral.

The integrands are smooth but for ends of contact at rho = abs(w +- r), where the arm turns and where v is 0
(`_dwell`): crossings of circles with the outline, where panels are split. Derived here.
"""

import math
from typing import NamedTuple

import numpy as np

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths import quadrature
from kernels.maths.quadrature import ROOM, Nodes, adapt, open_panel
from kernels.maths.small_dense import sort
from kernels.wear import _dwell, _pressure, _tool
from kernels.wear._contour import (
    FAR_SIDE,
    SPARE,
    SPIN,
    about_pivot,
    along_outline,
    far_side_alone,
    from_frame,
    integrand,
    phi_of,
    pressed,
    vertex_margins,
)
from kernels.wear._tool import CROSSING_LIMIT, PIECES, Circle, arctan2, outline, sincos

_EPS = 2.0**-52
_AT_TURN = 1e-11  # a gap over its largest, or a step: beyond that a split is none where the arm turns
_TURN = 2.0 * math.pi


class Room(NamedTuple):
    """Space for panels, their nodes, splits, angles, the stack of intervals, the stops of the arm; a scene's spare."""

    pool: np.ndarray
    nodes: Nodes
    found: np.ndarray
    angles: np.ndarray
    stack: np.ndarray
    still: np.ndarray
    spare: np.ndarray


@jit_apart
def room():
    """A `Room`."""
    found, angles = np.empty(_tool.ARC_LIMIT), np.empty(_tool.ARC_LIMIT)
    stack, still = np.empty(_tool.STACK), np.empty(_dwell.STOP_LIMIT)
    return Room(np.empty(quadrature.POOL), quadrature.nodes(), found, angles, stack, still, np.empty(SPARE))


@jit
def work_centre(scene, c, s):
    """The centre of the work in the tool's frame, with the arm at (c, s) from the frame."""
    ride = scene.ride
    x = ride.w * (c * ride.turn_c + s * ride.turn_s) - ride.reach
    return x, ride.w * (c * ride.turn_s - s * ride.turn_c)


@jit_apart
def _settled(x, scene, piece):
    """A split at x moved by one step of Newton's rule onto a zero of the arm's gap, if it is next to one; else x.

    The integrand goes like 1/sqrt(g) at such a zero. Where the point of the outline is near the line of centres, a
    split that was found from a circle about the work's centre is off it by much more than g rounds. By (3) of
    `_dwell` and (3) of `_contour` the gaps are functions of x, for each side and each half of psi, +-1:
        top = unit cos^2(eta/2) - high,  bottom = unit sin^2(eta/2) - low,  eta = turn + half (chi - side gamma),  (1)
        dtop/dx = -dbottom/dx = -unit sin(eta)/2 half (chi' - side gamma').                          (2)
    `turn` is the angle of w from the frame. Of those with sin(eta) > 0 the least gap counts, where both g/unit and the
    step g/(dg/dx) are below _AT_TURN.
    """
    unit = scene.arm.unit
    sight = about_pivot(scene, piece, outline(piece, x, scene.tool))
    if not sight.blur < math.inf:
        return x
    least, step = _AT_TURN * unit, 0.0
    for side in (1.0, -1.0):
        c, s = phi_of(sight, side)
        for half in (-1.0, 1.0):
            cosine, sine = from_frame(scene.ride, c, half * s)
            top, bottom, _ = _dwell.gaps(scene.arm, cosine, sine)
            gap, growth = (top, -1.0) if magnitude(top) < magnitude(bottom) else (bottom, 1.0)
            slope = growth * 0.5 * unit * sine * half * (sight.chi_slope - side * sight.gamma_slope)
            if sine > 0.0 and magnitude(gap) < least and magnitude(gap) < _AT_TURN * magnitude(slope):
                least, step = magnitude(gap), gap / slope
    return x - step if 0.0 < x - step < 1.0 else x


@jit_apart
def open_outline(count, scene, stops, room):
    """Opens the panels of the contour that have wear amid them; how many panels there are then.

    Pieces are split where contact ends or v is 0: where circles cross them, two about the pivot, then those of radius r
    about the work's centre with the arm at each stop, on either side of it. A circle that coincides with the outline
    splits none.
    """
    tool, ride, r, found, nodes = scene.tool, scene.ride, scene.r, room.found, room.nodes
    for k in range(PIECES):
        piece, splits = float(k), np.int64(1)
        near, wide = vertex_margins(piece, scene)
        found[0] = 0.0
        for j in range(2 + 2 * stops):
            if j < 2:
                radius, start = (ride.w + r, wide) if j else (magnitude(ride.w - r), near)
                circle = Circle(-ride.reach, 0.0, radius)
            else:
                s, c = sincos(room.still[j // 2 - 1])
                x, y = work_centre(scene, c, s)
                circle = Circle(x, -y if j % 2 else y, r)
                start = _tool.vertex_excess(piece, tool, circle)
            if splits + CROSSING_LIMIT < found.size:
                number = _tool.crossings(piece, tool, circle, start, found, splits, room.stack)
                for i in range(splits, number if 1 < j < 6 and not scene.arm.whirls else splits):
                    found[i] = _settled(found[i], scene, piece)
                splits = max(number, splits)
        found[splits] = 1.0
        sort(found, splits + 1)

        # no panel where there is nothing amid it
        for first in range(0, splits, ROOM):
            here = min(ROOM, splits - first)
            for j in range(ROOM):
                start = found[first + min(j, here - 1)]
                nodes.x[j] = start + 0.5 * (found[first + min(j, here - 1) + 1] - start)
            along_outline(piece, nodes, here, scene)
            for j in range(here):
                start, length = found[first + j], found[first + j + 1] - found[first + j]
                if length > 0.0 and nodes.doubt[j] > 0.0:
                    open_panel(room.pool, count, piece, start, length)
                    count += 1
    return count


@jit_apart
def _phase(arm, eta):
    """u of `pose_at`."""
    if arm.whirls:
        return eta
    ahead, behind = arm.most - eta, eta - arm.least
    return 2.0 * arctan2(sqrt(max(behind, 0.0)), sqrt(max(ahead, 0.0))) - 0.5 * math.pi


@jit_apart
def open_split(room, count, kind, low, high, scene, stops):
    """Opens panels of that kind from arm's angle low to high, split at the stops; how many panels there are then.

    None is longer than a quarter of a turn, or half of what the arm rocks: 21 nodes may miss a dwell in all of it.
    """
    arm = scene.arm
    longest = 0.25 * _TURN if arm.whirls else 0.5 * (arm.most - arm.least)
    start = low
    while start < high:
        end = min(high, start + longest)
        for k in range(stops):
            turns = math.floor((room.still[k] - start) / _TURN) if arm.whirls else 0.0
            stop = room.still[k] - turns * _TURN
            end = stop if start < stop < end else end
        first = _phase(arm, start)
        open_panel(room.pool, count, kind, first, _phase(arm, end) - first)
        count += 1
        start = end
    return count


@jit_apart
def open_far_side(room, scene, number, stops):
    """Opens the panels of the second integral of (2), from the arcs about the pivot; how many there are."""
    arm, ride, angles = scene.arm, scene.ride, room.angles
    turn = arctan2(ride.turn_s, ride.turn_c) + (math.pi if scene.r > ride.w else 0.0)
    count = np.int64(0)
    for j in range(0, number, 2):
        low, high = turn - angles[j + 1], turn - angles[j]
        if arm.whirls:
            count = open_split(room, count, FAR_SIDE, low, high, scene, stops)
        else:
            for k in range(-2, 3):
                first, last = max(low + k * _TURN, arm.least), min(high + k * _TURN, arm.most)
                count = open_split(room, count, FAR_SIDE, first, last, scene, stops)
    return count


@jit_apart
def _weight_about(scene, angle):
    """Weight of the pressure where the point at psi = pi is at this angle from the arm; its largest for NaN."""
    areas, (s, c) = scene.areas, sincos(angle)
    if angle == angle:
        return _pressure.weight(areas, -c if scene.r > scene.ride.w else c, s)[0]
    return 1.0 / max(areas.lowest, _pressure.FAINT * areas.largest) if areas.panels > 0 else 1.0


@jit_apart
def profile(scene, rtol, room):
    """I(r) of (1) of `_contour`, and its error: inf if it could not be had.

    The circle that counts is that of radius r where the arm stands still (its crank has no throw, or none that float64
    could tell), else about the pivot.
    """
    arm, tool, ride, r, angles = scene.arm, scene.tool, scene.ride, scene.r, room.angles
    s, c = sincos(arm.least)
    stands, near, far = not arm.whirls and not arm.most > arm.least, math.nan, math.nan
    if stands:
        x, y = work_centre(scene, c, s)
        circle = Circle(x, y, r)
    else:
        circle = Circle(-ride.reach, 0.0, magnitude(ride.w - r))
        near, far = vertex_margins(0.0, scene)[0], vertex_margins(2.0, scene)[0]
    number, unsure, about = _tool.arcs(tool, circle, near, far, angles, room.found, room.stack)
    if number < 0:
        return math.nan, math.inf
    length = 0.0
    for j in range(0, number, 2):
        length += angles[j + 1] - angles[j]
    weight, doubt = pressed(scene, c, s)
    unit = _TURN * magnitude(ride.speed) * ride.w
    if stands:
        total = weight * _TURN * magnitude(ride.spin) * r * length
        return total, (64.0 * _EPS + doubt) * total
    if ride.w > 0.0 and r == 0.0 and scene.areas.panels == 0:  # the way of the centre, whatever the arm's rate
        turn, passed = arctan2(ride.turn_s, ride.turn_c), 0.0  # the arm's angle within the arcs
        for j in range(0, number, 2):
            low, high = turn - angles[j + 1], turn - angles[j]
            if arm.whirls:
                passed += high - low
            else:  # both strokes
                for shift in (-_TURN, 0.0, _TURN):
                    passed += 2.0 * max(min(high + shift, arm.most) - max(low + shift, arm.least), 0.0)
        return unit * passed, 64.0 * _EPS * unit * (passed + (1.0 if passed > 0.0 else 0.0))
    stops = _dwell.find_stops(scene, room.still)
    if ride.w == 0.0:  # about the pivot v is the same all along an arc
        first, last = _dwell.span(arm) if arm.whirls else (arm.least, arm.most)
        count = open_split(room, np.int64(0), SPIN, first, last, scene, stops)
    else:  # by parts, (2)
        count = open_far_side(room, scene, number, stops)
        if r > 0.0:
            count = open_outline(count, scene, stops, room)
    value, error = adapt(integrand, scene, room.pool, room.nodes, count, rtol)
    if unsure > 0.0:  # so much of the circle, about that angle, may be in contact or not
        way = 1.0 if arm.whirls else arm.most - arm.least
        error += 8.0 * unsure * far_side_alone(scene, _dwell.pose_at(arm, 0.0)) / way * _weight_about(scene, about)
    if ride.w == 0.0:
        return weight * value * length, weight * (error * length + (64.0 * _EPS + doubt * length) * value)
    if r == 0.0:
        most = 0.0
        for j in range(number):
            most = max(most, _weight_about(scene, angles[j]))
        error += 64.0 * _EPS * (value + unit * most)
    return value, error
