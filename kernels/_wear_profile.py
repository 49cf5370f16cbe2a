"""Wear of a turning work by a tool on a rocking arm, at one radius, averaged over the phase of the work.

With theta the crank's angle, psi that about the work's centre from the direction of w, and v of `_wear_speed`,
    I(r) = int_0^2pi dtheta int_contact v dpsi                                                       (1)
By parts in psi this is an integral along the outline of the tool, for each half psi > 0 and psi < 0
    I = sum_halves [ contour E(theta, abs(psi)) dtheta + int E(theta, pi) [psi = pi in contact] dtheta ],
    E(theta, psi) = int_0^psi v dpsi,                                                                (2)
where the outline's point at a distance rho from the pivot is at radius r just when the arm is at phi = +-chi -+ gamma
from the direction of w (chi, gamma: angles at the pivot from w, and from the arm, to the point):
    cos chi = (w^2 + rho^2 - r^2)/(2 w rho),  S = 4 w r abs(sin psi)/2 = sqrt((rho^2 - (w-r)^2)((w+r)^2 - rho^2))
    cos^2(psi/2) = (rho^2 - (w-r)^2)/(4 w r)                                                         (3)
No root is sought at any instant, and arcs that appear, merge or vanish leave no trace: they are where phi turns. What
is left are ends of contact at rho = abs(w +- r) and where the arm turns: crossings of circles with the outline, where
panels are split. dtheta = dphi/abs(alpha') of both strokes is closed, too (`_wear_arm`). Derived here.
"""

import math

from kernels import _wear_arm, _wear_tool
from kernels._jit import jit
from kernels._lanes import magnitude, sqrt
from kernels._linkage import sum4
from kernels._wear_call import call
from kernels._wear_quadrature import adapt, open_panel
from kernels._wear_speed import along_arc, extremes, half_circle
from kernels._wear_tool import PIECES, arctan2, outline, sincos

FAR_SIDE, SPIN = 4.0, 5.0
"""Kinds of panels beside the outline's pieces: the second integral of (2); all of a work on the pivot itself."""

_EPS = 2.0**-52
_TURN = 2.0 * math.pi


@call
def _passage(scene, c, s, top, bottom, arc):
    """Sum over the strokes of E dtheta/dphi at one angle of the arm; `arc`: of what arc, sine and cosine of psi/2."""
    arm, _, (speed, spin, _, w, _, _), r = scene
    rate_back, dwell_back, rate_forth, dwell_forth = _wear_arm.strokes(arm, c, s, top, bottom)
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


@call
def _at_angle(scene, c, s, arc):
    """`_passage` with the arm at phi = (c, s) from the direction of w, and its rounding; 0 where it does not come."""
    arm, _, (_, _, _, _, turn_c, turn_s), _ = scene
    cosine, sine = turn_c * c - turn_s * s, turn_s * c + turn_c * s
    top, bottom, noise = _wear_arm.gaps(arm, cosine, sine)
    if not (top > 0.0 and bottom > 0.0 and (sine > 0.0 or arm[3])):
        return 0.0, 0.0
    total = _passage(scene, cosine, sine, top, bottom, arc)
    return total, total * noise


@call
def vertex_margins(piece, tool, reach, w, r):
    """rho^2 - (w-r)^2 and rho^2 - (w+r)^2 of the tool's vertex on the X axis, without loss.

    A vertex that is on the ring but for the rounding of its inputs is on it: the two terms of (2) differ by the square
    root of what is left, and wear by that itself.
    """
    a = _wear_tool.side_of(piece) * tool[0]
    near = sum4(reach, a, r, -w) * sum4(reach, a, -r, w)
    wide = sum4(reach, a, -r, -w) * sum4(reach, a, r, w)
    least = 4.0 * _EPS * (reach + tool[0] + w + r) * (reach + tool[0] + w + r)
    return near if magnitude(near) > least else 0.0, wide if magnitude(wide) > least else 0.0


@call
def _margins(piece, point, tool, reach, w, r):
    """rho^2, rho^2 - (w-r)^2, (w+r)^2 - rho^2 of an outline's point, and their rounding, absolute."""
    x, y, _, _, missing = point
    far = reach + x
    rho2 = far * far + y * y
    if not _wear_tool.on_x_axis(piece):
        return rho2, rho2 - (w - r) * (w - r), (w + r) * (w + r) - rho2, 2.0 * _EPS * (rho2 + (w + r) * (w + r))
    side = _wear_tool.side_of(piece)
    near, wide = vertex_margins(piece, tool, reach, w, r)
    inward = missing * (missing - 2.0 * side * (reach + side * tool[0]))
    noise = 2.0 * _EPS * (magnitude(inward) + y * y)
    return rho2, near + (inward + y * y), -(wide + (inward + y * y)), noise


@jit
def _about_pivot(scene, piece, point):
    """Of an outline's point: chi and gamma as cosine and sine, their slopes, sine and cosine of psi/2, and rounding.

    The rounding is relative, of sin chi and the slopes.
    """
    _, tool, (_, _, reach, w, _, _), r = scene
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


@call
def _outline(piece, x, scene):
    """Integrand of the contour: both sides Y of the outline and both halves of psi; and its rounding."""
    chi, gamma, slopes, arc, blur = _about_pivot(scene, piece, outline(piece, x, scene[1]))
    if not blur < math.inf:
        return 0.0, 0.0
    total, noise = 0.0, 0.0
    for side in (1.0, -1.0):
        c, s = chi[0] * gamma[0] + side * chi[1] * gamma[1], chi[1] * gamma[0] - side * chi[0] * gamma[1]
        slope = _wear_tool.sense(piece) * (side * slopes[0] - slopes[1])
        for half in (1.0, -1.0):
            value, doubt = _at_angle(scene, c, half * s, arc)
            total += slope * value
            noise += magnitude(slope) * (blur * value + (1.0 + blur * chi[1] / _EPS) * doubt)
    return total, noise


@call
def _far_side(u, scene):
    """Integrand of the second integral of (2), both halves: 2 E(theta, pi) dtheta/du."""
    arm = scene[0]
    if arm[3]:
        s, c = sincos(u)
        top, bottom, noise = _wear_arm.gaps(arm, c, s)
        total = 2.0 * _passage(scene, c, s, top, bottom, (1.0, 0.0))
        return total, total * noise
    eta, top, bottom, growth = _wear_arm.gaps_at(arm, u)
    s, c = sincos(eta)
    if not (top > 0.0 and bottom > 0.0):
        return 0.0, 0.0
    total = 2.0 * growth * _passage(scene, c, s, top, bottom, (1.0, 0.0))
    return total, 4.0 * _EPS * total


@call
def _on_pivot(u, scene):
    """Integrand of int v dtheta over the strokes for a work on the pivot, where v does not hang on psi."""
    arm, _, (speed, spin, _, _, _, _), r = scene
    if arm[3]:
        s, c = sincos(u)
        top, bottom, _ = _wear_arm.gaps(arm, c, s)
        growth = 1.0
    else:
        eta, top, bottom, growth = _wear_arm.gaps_at(arm, u)
        s, c = sincos(eta)
    rate_back, dwell_back, rate_forth, dwell_forth = _wear_arm.strokes(arm, c, s, top, bottom)
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
def _split_circle(k, scene, piece):
    """Centre, radius and vertex excess of the circles at which contact ends: two about the pivot, four of radius r."""
    arm, tool, (_, _, reach, w, turn_c, turn_s), r = scene
    if k < 2:
        radius = w + r if k else magnitude(w - r)
        margins = vertex_margins(piece, tool, reach, w, r)
        start = margins[1] if k else margins[0]
        if not _wear_tool.on_x_axis(piece):
            start = _wear_tool.vertex_excess(piece, tool, -reach, 0.0, radius)
        return -reach, 0.0, radius, start
    s, c = sincos(arm[2][0] if k < 4 else arm[2][1])
    x, y = w * (c * turn_c + s * turn_s) - reach, w * (c * turn_s - s * turn_c)
    y = -y if k % 2 else y
    return x, y, r, _wear_tool.vertex_excess(piece, tool, x, y, r)


@call
def _open_outline(pool, count, scene, found, stack):
    """Opens the panels of the contour, split where contact ends; how many panels there are then."""
    for k in range(PIECES):
        piece, splits = float(k), int(1.0)
        found[0] = 0.0
        for j in range(2 if scene[0][3] else 6):
            x, y, radius, start = _split_circle(j, scene, piece)
            number = _wear_tool.crossings(piece, scene[1], x, y, radius, start, found, splits, stack)
            splits = number if number >= 0 else splits  # where circle and outline coincide there is nothing to split
        found[splits] = 1.0
        _wear_tool.sort(found, splits + 1)
        for j in range(splits):
            start, length = found[j], found[j + 1] - found[j]
            if length > 0.0 and _outline(piece, start + 0.5 * length, scene)[1] > 0.0:
                open_panel(pool, count, piece, start, length)
                count += 1
    return count


@call
def _phase(arm, eta):
    """u of `gaps_at`."""
    least, most = arm[2]
    ahead, behind = most - eta, eta - least
    return 2.0 * arctan2(sqrt(max(behind, 0.0)), sqrt(max(ahead, 0.0))) - 0.5 * math.pi


@call
def _open_far_side(pool, scene, angles, number):
    """Opens the panels of the second integral of (2), from the arcs about the pivot; how many there are."""
    arm, _, (_, _, _, w, turn_c, turn_s), r = scene
    turn = arctan2(turn_s, turn_c) + (math.pi if r > w else 0.0)
    count = 0
    for j in range(0, number, 2):
        low, high = turn - angles[j + 1], turn - angles[j]
        if arm[3]:
            open_panel(pool, count, FAR_SIDE, low, high - low)
            count += 1
        else:
            for k in range(-2, 3):
                first, last = max(low + k * _TURN, arm[2][0]), min(high + k * _TURN, arm[2][1])
                if last > first:
                    u = _phase(arm, first)
                    open_panel(pool, count, FAR_SIDE, u, _phase(arm, last) - u)
                    count += 1
    return count


@jit
def _arm_time(arm):
    """Ends of u over all the arm's motion, and how often each angle is passed."""
    return (-math.pi, math.pi, 1.0) if arm[3] else (-0.5 * math.pi, 0.5 * math.pi, 2.0)


@call
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
    return total * _arm_time(arm)[2]


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
    arm, tool, (_, _, reach, w, turn_c, turn_s), r = scene
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
    _, _, (_, spin, _, _, _, _), r = scene
    total = _TURN * magnitude(spin) * r * _length_of(angles, number)
    return total, 64.0 * _EPS * total


@jit
def _centre(scene, angles, number):
    """I(0): the way of the centre through the tool, whatever the arm's rate."""
    arm, _, (speed, _, _, w, turn_c, turn_s), _ = scene
    passed = _angle_in_arcs(arm, arctan2(turn_s, turn_c), angles, number)
    unit = _TURN * magnitude(speed) * w
    return unit * passed, 64.0 * _EPS * unit * (passed + (1.0 if passed > 0.0 else 0.0))


@call
def profile(scene, rtol, work):
    """I(r) of (1), its error, and whether it could be had.

    Parameters
    ----------
    scene : (arm of `_wear_arm`, tool of `_wear_tool`, (rate of the crank, of the work, L, w, cosine and sine of the
        direction of w from b + beta), r)
    work : room for panels, splits, angles, and the stack of intervals
    """
    arm, tool, ride, r = scene
    pool, found, angles, stack = work
    x, y, radius, near, far = _circle(scene)
    number, unsure = _wear_tool.arcs(tool, x, y, radius, near, far, angles, found, stack)
    if number < 0:
        return math.nan, math.inf, False
    if stands_still(arm):
        value, error = _standing(scene, angles, number)
        return value, error, True
    on_pivot = ride[3] == 0.0
    if r == 0.0 and not on_pivot:
        value, error = _centre(scene, angles, number)
        return value, error, True
    count = int(0.0)
    if on_pivot:
        first, last, _ = _arm_time(arm)
        open_panel(pool, count, SPIN, first, last - first)
        count += 1
    else:
        count = _open_far_side(pool, scene, angles, number)
        count = _open_outline(pool, count, scene, found, stack)
    value, error = adapt(integrand, scene, pool, count, rtol)
    if unsure > 0.0:
        error += 8.0 * unsure * _far_side(0.0, scene)[0] / (1.0 if arm[3] else arm[2][1] - arm[2][0])
    if on_pivot:
        length = _length_of(angles, number)
        value, error = value * length, error * length + 64.0 * _EPS * value
    return value, error, True
