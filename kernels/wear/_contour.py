"""Wear of a turning work by a tool on a rocking arm, at one radius: the integrands along the outline of the tool.

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
No root is sought at any instant, and arcs that appear, merge or vanish leave no trace: they are where phi turns.
dtheta = dphi/abs(alpha') of both strokes is closed, too (`_dwell`). All nodes of a panel are taken at a time, in lanes.
Derived here.
"""

import math
from collections import namedtuple
from typing import NamedTuple

import numpy as np

from kernels.lanes.columns import GROUP, cells_at
from kernels.lanes.jit import jit, jit_apart, jit_call
from kernels.lanes.vectors import magnitude, sqrt, where
from kernels.maths.elementary import smaller
from kernels.polisher.linkage import sum4
from kernels.wear import _dwell, _pressure, _tool
from kernels.wear._dwell import Arm
from kernels.wear._pressure import Areas
from kernels.wear._scene import Ride
from kernels.wear._speed_integral import along_arc, extremes, half_circle
from kernels.wear._tool import Tool, outline

FAR_SIDE, SPIN = 4.0, 5.0
"""Kinds of panels beside the outline's pieces: the second integral of (2); all of a work on the pivot itself."""

_EPS = 2.0**-52
_NO_ANGLE = 2.0
"""In the place of a cosine."""


class Scene(NamedTuple):
    """The machine, a radius of the work, the areas of contact, and space for looking them up in lanes."""

    arm: Arm
    tool: Tool
    ride: Ride
    r: float
    areas: Areas
    spare: np.ndarray


Direction = namedtuple("Direction", "c s")
"""Cosine and sine of an angle."""


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


SPARE = (5, GROUP)
"""Shape of a scene's spare."""


@jit
def _passage(scene, c, s, top, bottom, polish, arc):
    """Sum over the strokes of E dtheta/dphi at one angle of the arm; `polish(p, q, arc)` is E."""
    ride, strokes = scene.ride, _dwell.strokes(scene.arm, c, s, top, bottom)
    p, q = extremes(ride.speed * strokes.forth, ride.spin, scene.r, ride.w)
    forth = strokes.forth_dwell * polish(p, q, arc)
    if scene.arm.whirls:
        return forth
    p, q = extremes(ride.speed * strokes.back, ride.spin, scene.r, ride.w)
    back = strokes.back_dwell * polish(p, q, arc)
    return where(strokes.back_dwell > 0.0, back, 0.0) + forth


@jit
def from_frame(ride, c, s):
    """Cosine and sine from the frame, of an angle (c, s) from the direction of w."""
    return ride.turn_c * c - ride.turn_s * s, ride.turn_s * c + ride.turn_c * s


@jit_call
def _at_angle(scene, c, s, arc, blur):
    """W E dtheta/dphi with the arm at phi = (c, s) from the direction of w, and its rounding; 0 where it does not come.

    blur: rounding of phi, over that of a number
    """
    cosine, sine = from_frame(scene.ride, c, s)
    top, bottom, noise = _dwell.gaps(scene.arm, cosine, sine)
    there = (top > 0.0) & (bottom > 0.0) & ((sine > 0.0) | scene.arm.whirls)
    areas, rows, i = scene.areas, scene.spare, cells_at(0)
    weight, doubt, slope = 1.0 + 0.0 * s, 0.0 * s, 0.0 * s
    if areas.panels > 0:  # tabulated areas are looked up one by one
        rows[0][i], rows[1][i] = where(there, c, _NO_ANGLE), s
        for lane in range(GROUP):
            if rows[0][lane] < _NO_ANGLE:
                rows[2][lane], rows[3][lane], rows[4][lane] = _pressure.weight(areas, rows[0][lane], rows[1][lane])
        weight, doubt, slope = rows[2][i], rows[3][i], rows[4][i]
    total = weight * _passage(scene, cosine, sine, top, bottom, along_arc, arc)
    noise = total * (noise * blur + (doubt + 4.0 * _EPS * slope * blur))
    return where(there, total, 0.0), where(there, noise, 0.0)


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


@jit_call
def about_pivot(scene, piece, spot):
    """The `Sight` of a spot of the outline; its rounding is infinite where that is not on the ring."""
    w, r, reach, tool = scene.ride.w, scene.r, scene.ride.reach, scene.tool
    x, y, missing, far = spot.x, spot.y, spot.missing, reach + spot.x
    rho2 = far * far + y * y
    # rho^2 - (w-r)^2, (w+r)^2 - rho^2 from the vertex on, as `crossings` has them: what rounds at the vertex rounds
    # alike where panels are split
    if _tool.on_x_axis(piece):
        side = _tool.side_of(piece)
        inward, aside, rough = missing * (missing - 2.0 * side * (reach + side * tool.a)), y * y, 2.0
    else:
        inward, aside, rough = missing * (missing - 2.0 * tool.b), x * (x + 2.0 * reach), 4.0
    noise = rough * _EPS * (magnitude(inward) + magnitude(aside))
    near_vertex, wide_vertex = vertex_margins(piece, scene)
    near, wide = near_vertex + (inward + aside), -(wide_vertex + (inward + aside))
    there = (near > 0.0) & (wide > 0.0) & (rho2 > 0.0)
    rho2, near, wide = where(there, rho2, 1.0), where(there, near, 1.0), where(there, wide, 1.0)
    rho, area = sqrt(rho2), sqrt(near) * sqrt(wide)
    chi = Direction(0.5 * ((w - r) * (w + r) + rho2) / (w * rho), 0.5 * area / (w * rho))
    outward = far * spot.dx + y * spot.dy
    chi_slope = -(rho2 - (w - r) * (w + r)) * outward / (rho2 * area)
    gamma_slope = (far * spot.dy - y * spot.dx) / rho2
    arc = Direction(sqrt(smaller(0.25 * near / (w * r), 1.0)), sqrt(smaller(0.25 * wide / (w * r), 1.0)))
    gamma = Direction(far / rho, y / rho)
    blur = where(there, 4.0 * _EPS + noise / near + noise / wide, math.inf)
    return Sight(chi, gamma, chi_slope, gamma_slope, arc, blur)


@jit
def phi_of(sight, side):
    """Cosine and sine of chi - side gamma, the arm's angle at which the outline's point is on the ring."""
    chi, gamma = sight.chi, sight.gamma
    return chi.c * gamma.c + side * chi.s * gamma.s, chi.s * gamma.c - side * chi.c * gamma.s


@jit_call
def _on_outline(piece, x, scene):
    """Integrand of the contour: both sides Y of the outline and both halves of psi; and its rounding."""
    sight = about_pivot(scene, piece, outline(piece, x, scene.tool))
    there = sight.blur < math.inf
    blur = where(there, sight.blur, 0.0)
    total, noise, turned = 0.0 * x, 0.0 * x, 1.0 + blur * sight.chi.s / _EPS
    sense = 1.0 if piece == 0.0 or piece == 3.0 else -1.0  # whether x runs counterclockwise about the tool
    for side in (1.0, -1.0):
        c, s = phi_of(sight, side)
        slope = sense * (side * sight.chi_slope - sight.gamma_slope)
        for half in (1.0, -1.0):
            value, doubt = _at_angle(scene, c, half * s, sight.arc, turned)
            total = total + slope * value
            noise = noise + magnitude(slope) * (blur * value + doubt)
    return where(there, total, 0.0), where(there, noise, 0.0)


@jit_apart
def along_outline(piece, nodes, count, scene):
    """The integrand of the contour and its rounding at so many nodes."""
    for j in range(0, count, GROUP):
        nodes.value[cells_at(j)], nodes.doubt[cells_at(j)] = _on_outline(piece, nodes.x[cells_at(j)], scene)


@jit
def pressed(scene, c, s):
    """Weight of the pressure with the arm at (c, s) from the frame, and what it may be wrong by, relative."""
    turn_c, turn_s = scene.ride.turn_c, scene.ride.turn_s
    weight, doubt, slope = _pressure.weight(scene.areas, c * turn_c + s * turn_s, s * turn_c - c * turn_s)
    return weight, doubt + 4.0 * _EPS * slope


@jit_apart
def far_side_alone(scene, pose):
    """2 E(theta, pi) dtheta/du."""
    if not (scene.arm.whirls or (pose.top > 0.0 and pose.bottom > 0.0)):
        return 0.0
    return 2.0 * pose.growth * _passage(scene, pose.c, pose.s, pose.top, pose.bottom, half_circle, 0.0)


@jit
def integrand(kind, nodes, count, scene):
    """The integrand of a panel of that kind and its rounding at its nodes: of (2), or of a work on the pivot."""
    if kind < FAR_SIDE:
        along_outline(kind, nodes, count, scene)
        return
    arm, ride = scene.arm, scene.ride
    for j in range(count):
        pose = _dwell.pose_at(arm, nodes.x[j])
        if kind == FAR_SIDE:
            weight, doubt = pressed(scene, pose.c, pose.s)
            nodes.value[j] = far_side_alone(scene, pose) * weight
            nodes.doubt[j] = nodes.value[j] * (pose.noise + doubt)
        else:  # int v dtheta over the strokes, where v does not hang on psi
            strokes = _dwell.strokes(arm, pose.c, pose.s, pose.top, pose.bottom)
            back, forth = ride.speed * strokes.back - ride.spin, ride.speed * strokes.forth - ride.spin
            total = strokes.back_dwell * magnitude(back) + strokes.forth_dwell * magnitude(forth)
            nodes.value[j] = pose.growth * scene.r * total
            nodes.doubt[j] = 4.0 * _EPS * pose.growth * scene.r * total
