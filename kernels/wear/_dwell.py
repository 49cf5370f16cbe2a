"""How long the arm of a polishing machine dwells at each of its angles, and how fast it passes.

From the arm's angle eta (from the frame b) back to the crank: with q = d - b = e - f,
    e.q = (e^2 + q^2 - f^2)/2,  e x f = -+h,  4 h^2 = ((f+e)^2 - q^2) (q^2 - (f-e)^2)                (1)
    alpha' = (e x f)/(d x f),  d x f = (((e^2 - f^2 - q^2)/2) b d sin eta -+ h (d^2 - b d cos eta))/q^2     (2)
one sign for each stroke. In half angles, with eta_+ and eta_- where the arm turns,
    q^2 - (f-e)^2 = 4 b d (sin^2(eta/2) - sin^2(eta_-/2)),  4 b d sin^2(eta_-/2) = (d+f-b-e) (b+f-e-d)
    (f+e)^2 - q^2 = 4 b d (cos^2(eta/2) - cos^2(eta_+/2)),  4 b d cos^2(eta_+/2) = (b+d-e-f) (b+d+e+f)      (3)
All this is type A, 0 <= eta <= pi. Type B is its mirror image run backward, which wears alike: the work and the arm's
offset beta are mirrored at the frame. Source: derived here from Cordero-Davila et al., Opticheskii Zhurnal 78(3):55
(2011), (1)-(9), (21), (22).

Wear is no smooth function of eta where the arm turns, and where v is 0 somewhere on the ring: on that of radius r the
speeds at psi = 0 and pi (`_speed_integral`) are 0 where
    alpha' (r +- w) = Omega r                                                                        (4)
and near by the integral of v along an arc goes like x^2 log x of the distance x from there. What is not found here
(two roots closer than the samples, where the left side of (4) all but touches the right) costs panels, no digits.
"""

import math
from collections import namedtuple
from typing import NamedTuple

import numpy as np

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import magnitude, sqrt, where
from kernels.polisher.linkage import Lengths, Margins
from kernels.wear._tool import arctan2, sincos

STOP_LIMIT = 14
"""How many angles at which wear is not smooth are kept."""

_DOUBT = 4.0 * 2.0**-52
"""What rounding comes to in the angle of the arm: where it all but turns, its dwell knows it a million times worse."""
_ROUNDING = 4.0 * 2.0**-52
_SAMPLES = 32
_ROOT_LIMIT = 40
_NEAR = 1e-10


class Arm(NamedTuple):
    """Its lengths and margins, the constants of (3), its least and largest angle, and whether it turns fully."""

    lengths: Lengths
    margin: Margins
    unit: float
    low: float
    high: float
    least: float
    most: float
    whirls: bool


Pose = namedtuple("Pose", "eta c s top bottom noise growth")
"""The arm's angle eta and its cosine and sine, both gaps of (3) and their rounding, relative, and d eta/du."""


Strokes = namedtuple("Strokes", "back back_dwell forth forth_dwell")
"""alpha' of the stroke back, abs(dtheta/d alpha) there, both of the stroke forth; 0 for no such stroke."""


@jit_apart
def arm_of(lengths, margin):
    """The `Arm`. Where its two angles are rounded to one, as for a crank without throw, it stands still."""
    b, d, f, e = lengths
    unit = 4.0 * b * d
    low, high = margin.stretched * margin.back, margin.front * ((b + d) + (e + f))
    least = 2.0 * arctan2(sqrt(max(low, 0.0)), sqrt(max(unit - low, 0.0)))
    most = 2.0 * arctan2(sqrt(max(unit - high, 0.0)), sqrt(max(high, 0.0)))
    return Arm(lengths, margin, unit, low, high, least, most, e > b)


@jit_apart
def gaps(arm, c, s):
    """(3): (f+e)^2 - q^2 and q^2 - (f-e)^2 of the arm at (cos eta, sin eta) = (c, s), and their rounding, relative."""
    sine2 = where(c > 0.0, 0.5 * s * s / (1.0 + c), 0.5 * (1.0 - c))
    cosine2 = where(c > 0.0, 0.5 * (1.0 + c), 0.5 * s * s / (1.0 - c))
    top, bottom = arm.unit * cosine2 - arm.high, arm.unit * sine2 - arm.low
    return top, bottom, _DOUBT * arm.unit * ((magnitude(s) + cosine2) / top + (magnitude(s) + sine2) / bottom)


@jit_apart
def pose_at(arm, u):
    """The `Pose` a share (1 + sin u)/2 of the way from least to most, without rounding of the gaps.

    Of an arm that turns fully, u is eta.
    """
    if arm.whirls:
        s, c = sincos(u)
        top, bottom, noise = gaps(arm, c, s)
        return Pose(u, c, s, top, bottom, noise, 1.0)
    half = 0.5 * (arm.most - arm.least)
    up, far = sincos(0.5 * (0.5 * math.pi - u))  # sin^2 and cos^2 of it: the shares that lie ahead and behind
    ahead, behind = 2.0 * half * up * up, 2.0 * half * far * far
    eta = arm.least + behind if behind < ahead else arm.most - ahead
    top = arm.unit * sincos(0.5 * (arm.most + eta))[0] * sincos(0.5 * ahead)[0]
    bottom = arm.unit * sincos(0.5 * (arm.least + eta))[0] * sincos(0.5 * behind)[0]
    s, c = sincos(eta)
    return Pose(eta, c, s, top, bottom, _ROUNDING, 2.0 * half * up * far)


@jit_apart
def strokes(arm, c, s, top, bottom):
    """The `Strokes` at (cos eta, sin eta) = (c, s) and the gaps there; (2)."""
    b, d, f, e = arm.lengths
    h = 0.5 * sqrt(top * bottom)
    q2 = (f - e) * (f - e) + bottom
    lean = 0.5 * ((e - f) * (e + f) - q2) * b * d * s
    reach = h * (d * d - b * d * c)
    forth = (reach - lean) / q2
    if arm.whirls:
        return Strokes(0.0 * h, 0.0 * h, h / forth, magnitude(forth) / h)
    back = (reach + lean) / q2
    return Strokes(h / back, magnitude(back) / h, h / forth, forth / h)


@jit
def span(arm):
    """Ends of u of `pose_at` over all the arm's motion."""
    return (-math.pi, math.pi) if arm.whirls else (-0.5 * math.pi, 0.5 * math.pi)


@jit_apart
def rates_at(arm, u):
    """The arm's angle at u, and alpha' of the stroke back and forth over the crank's rate."""
    pose = pose_at(arm, u)
    found = strokes(arm, pose.c, pose.s, max(pose.top, 0.0), max(pose.bottom, 0.0))
    return pose.eta, found.back, found.forth


@jit_apart
def find_stops(scene, still):
    """Puts the angles at which wear is not smooth into `still`; how many. First those where the arm turns, if it does.

    Those of (4) are shut in between samples, then found by the Illinois rule.

    scene : of `_contour`
    """
    arm, speed, w, r, turned = scene.arm, scene.ride.speed, scene.ride.w, scene.r, scene.ride.spin * scene.r
    first, last = span(arm)
    count = np.int64(0)
    if not arm.whirls:
        still[0], still[1] = arm.least, arm.most
        count += 2
    before, rates = first, (0.0, 0.0)
    for k in range(_SAMPLES + 1):
        u = first + (last - first) * k / _SAMPLES
        _, back, forth = rates_at(arm, u)
        now = back, forth
        for j in range(4 if k > 0 else 0):
            far, stroke = r + w if j % 2 else r - w, j // 2
            one, two, f_one, f_two = before, u, speed * rates[stroke] * far - turned, speed * now[stroke] * far - turned
            if f_one * f_two < 0.0 and count < STOP_LIMIT:
                eta, seen = 0.0, math.inf
                for _ in range(_ROOT_LIMIT):
                    middle = (one * f_two - two * f_one) / (f_two - f_one)
                    eta, back, forth = rates_at(arm, middle)
                    value = speed * (forth if stroke else back) * far - turned
                    if magnitude(middle - seen) <= _NEAR or value == 0.0:
                        break
                    if (value > 0.0) == (f_two > 0.0):
                        f_one *= 0.5
                    else:
                        one, f_one = two, f_two
                    two, f_two, seen = middle, value, middle
                still[count] = eta
                count += 1
        before, rates = u, now
    return count
