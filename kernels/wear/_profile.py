"""Wear at one radius, by the integrals of `_contour` over the panels of `_panels`, and what needs no integral."""

import math

import numpy as np

from kernels.lanes.jit import jit_apart
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
        passed = _angle_in_arcs(arm, arctan2(ride.turn_s, ride.turn_c), angles, number)
        return unit * passed, 64.0 * _EPS * unit * (passed + (1.0 if passed > 0.0 else 0.0))
    stops = Stops(room.still, _dwell.find_stops(scene, room.still))
    if ride.w == 0.0:  # about the pivot v is the same all along an arc
        first, last = _dwell.span(arm) if arm.whirls else (arm.least, arm.most)
        count = open_split(room.pool, np.int64(0), SPIN, first, last, scene, stops)
    else:  # by parts, (2)
        count = open_far_side(room.pool, scene, angles, number, stops)
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
