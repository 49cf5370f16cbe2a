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
"""

import math

from kernels.lanes.jit import jit_call
from kernels.lanes.vectors import magnitude, sqrt
from kernels.wear._tool import arctan2, sincos

_DOUBT = 4.0 * 2.0**-52
"""What rounding comes to in the angle of the arm: where it all but turns, its dwell knows it a million times worse."""


@jit_call
def arm_of(lengths, margin):
    """The arm: its lengths, the two constants of (3), its least and largest angle, and whether it turns fully.

    Where the two angles are rounded to one, as for a crank without throw, it stands still.
    """
    b, d, f, e = lengths
    stretched, back, front = margin
    unit = 4.0 * b * d
    low, high = stretched * back, front * ((b + d) + (e + f))
    least = 2.0 * arctan2(sqrt(max(low, 0.0)), sqrt(max(unit - low, 0.0)))
    most = 2.0 * arctan2(sqrt(max(unit - high, 0.0)), sqrt(max(high, 0.0)))
    return lengths, (unit, low, high), (least, most), e > b


@jit_call
def gaps(arm, c, s):
    """(3): (f+e)^2 - q^2 and q^2 - (f-e)^2 of the arm at (cos eta, sin eta) = (c, s), and their rounding, relative."""
    unit, low, high = arm[1]
    sine2 = 0.5 * s * s / (1.0 + c) if c > 0.0 else 0.5 * (1.0 - c)
    cosine2 = 0.5 * (1.0 + c) if c > 0.0 else 0.5 * s * s / (1.0 - c)
    top, bottom = unit * cosine2 - high, unit * sine2 - low
    return top, bottom, _DOUBT * unit * ((magnitude(s) + cosine2) / top + (magnitude(s) + sine2) / bottom)


@jit_call
def gaps_at(arm, u):
    """As `gaps` where eta lies a share (1 + sin u)/2 of the way from least to most, without rounding; d eta/du."""
    least, most = arm[2]
    half = 0.5 * (most - least)
    up, far = sincos(0.5 * (0.5 * math.pi - u))  # sin^2 and cos^2 of it: the shares that lie ahead and behind
    ahead, behind = 2.0 * half * up * up, 2.0 * half * far * far
    eta = least + behind if behind < ahead else most - ahead
    unit = arm[1][0]
    top = unit * sincos(0.5 * (most + eta))[0] * sincos(0.5 * ahead)[0]
    bottom = unit * sincos(0.5 * (least + eta))[0] * sincos(0.5 * behind)[0]
    return eta, top, bottom, 2.0 * half * up * far


@jit_call
def strokes(arm, c, s, top, bottom):
    """alpha' of the stroke back, abs(dtheta/d alpha) there, both of the stroke forth; (2). 0: no such stroke."""
    b, d, f, e = arm[0]
    h = 0.5 * sqrt(top * bottom)
    q2 = (f - e) * (f - e) + bottom
    lean = 0.5 * ((e - f) * (e + f) - q2) * b * d * s
    reach = h * (d * d - b * d * c)
    forth = (reach - lean) / q2
    if arm[3]:
        return 0.0, 0.0, h / forth, magnitude(forth) / h
    back = (reach + lean) / q2
    return h / back, magnitude(back) / h, h / forth, forth / h
