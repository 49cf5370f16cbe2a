"""Wear at one radius, by the integrals of `_contour` over the panels of `_panels`, and what needs no integral."""

import math

import numpy as np

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import magnitude
from kernels.maths.quadrature import adapt
from kernels.wear import _dwell, _pressure, _tool
from kernels.wear._contour import SPIN, far_side_alone, integrand, pressed, vertex_margins
from kernels.wear._panels import Stops, open_far_side, open_outline, open_split, work_centre
from kernels.wear._tool import Circle, arctan2, sincos

_EPS = 2.0**-52
_TURN = 2.0 * math.pi


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
        x, y = work_centre(scene, c, s)
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
    return pressed(scene, c, s)


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
    return 8.0 * unsure * far_side_alone(scene, _dwell.pose_at(arm, 0.0)) / way * _weight_about(scene, about)


@jit_apart
def _about_the_pivot(scene, number, unsure, about, rtol, room):
    """I(r) of a work whose centre is the pivot: v is the same all along an arc."""
    arm, stops = scene.arm, Stops(room.still, _dwell.find_stops(scene, room.still))
    first, last = _dwell.span(arm) if arm.whirls else (arm.least, arm.most)
    count = open_split(room.pool, np.int64(0), SPIN, first, last, scene, stops)
    value, error = adapt(integrand, scene, room.pool, room.nodes, count, rtol)
    if unsure > 0.0:
        error += _unsure_error(scene, unsure, about)
    length, (weight, doubt) = _length_of(room.angles, number), _at_rest(scene)
    return weight * value * length, weight * (error * length + (64.0 * _EPS + doubt * length) * value)


@jit_apart
def _by_parts(scene, number, unsure, about, rtol, room):
    """I(r) by (2)."""
    ride, stops = scene.ride, Stops(room.still, _dwell.find_stops(scene, room.still))
    count = open_far_side(room.pool, scene, room.angles, number, stops)
    if scene.r > 0.0:
        count = open_outline(count, scene, stops, room)
    value, error = adapt(integrand, scene, room.pool, room.nodes, count, rtol)
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
