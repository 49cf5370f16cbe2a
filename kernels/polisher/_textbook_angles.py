"""Extreme angles of a linkage's arm as the paper has them, and what that form loses.

    eta_+- = arccos x,  x = (b^2 + d^2 - c^2)/(2 b d),  c = f +- e                                   (1)
    eta_c = c/(b d sin eta),  eta_b = -(b^2 - d^2 + c^2)/(2 b^2 d sin eta),  b and d swap for eta_d  (2)
Source: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (37)-(40), with the 1/2 that (40) lacks.

x is known to D = 2^-50 (b^2 + d^2 + c^2)/(2 b d), and an arccos makes D/sin eta of it, or sqrt(D) next to 0 and pi:
half of the digits. Results are differences of such angles. `angle_errors` and `slope_errors` add that up.
"""

import math

from kernels.lanes.jit import jit
from kernels.lanes.vectors import magnitude, sqrt, where
from kernels.maths.elementary import larger, smaller
from kernels.polisher._cell import ROUNDING
from kernels.polisher.extremes import Angles, Slopes, angle

_ROUNDINGS = 2.0**-50
_ULP = 2.0**-51


@jit
def cosine(x, y, z):
    """Cosine of the angle between sides x and y of a triangle, opposite to z; within [-1, 1]."""
    value = (x * x + y * y - z * z) / (2.0 * x * y)
    return larger(smaller(value, 1.0), -1.0)


@jit
def arccos(x):
    """Inverse cosine within 3 ulp of itself, of an x that is taken as exact."""
    return 2.0 * angle(sqrt(1.0 - x), sqrt(1.0 + x))


@jit
def angle_error(x, y, z):
    """What rounding of `cosine` comes to in its arccos, and in the sine's relative error; inf where that has none."""
    value = cosine(x, y, z)
    rounding = _ROUNDINGS * (x * x + y * y + z * z) / (2.0 * x * y)
    room = 1.0 - magnitude(value)
    smooth = 4.0 * rounding < room
    sine2 = where(smooth, room * (1.0 + magnitude(value)), 1.0)
    angle_lost = where(smooth, 1.5 * rounding / sqrt(sine2), 1.6 * sqrt(rounding)) + _ULP * arccos(value)
    return angle_lost, where(smooth, 1.5 * rounding / sine2 + 4.0 * _ULP, math.inf)


@jit
def extremes(lengths):
    """`Angles` for type A."""
    b, d, f, e = lengths
    plus, minus = arccos(cosine(b, d, f + e)), arccos(cosine(b, d, f - e))
    crank_plus, crank_minus = math.pi - arccos(cosine(b, f + e, d)), -arccos(cosine(b, f - e, d))
    return Angles(0.5 * (plus + minus), 0.5 * (plus - minus), plus, minus, crank_plus, crank_minus)


@jit
def transmission(lengths):
    """The least angle between coupler and arm, or their extensions, of a crank that turns."""
    b, d, f, e = lengths
    return smaller(arccos(cosine(d, f, b - e)), math.pi - arccos(cosine(d, f, b + e)))


@jit
def _slopes(b, d, c):
    """Derivatives of eta by b, d and c, (2)."""
    x = cosine(b, d, c)
    area = b * d * sqrt(1.0 - x * x)
    return -(b * b - d * d + c * c) / (2.0 * b * area), -(d * d - b * b + c * c) / (2.0 * d * area), c / area


@jit
def tolerances(lengths):
    """`Slopes` for type A."""
    b, d, f, e = lengths
    pb, pd, pc = _slopes(b, d, f + e)
    mb, md, mc = _slopes(b, d, f - e)
    coupler, crank = 0.5 * (pc - mc), 0.5 * (pc + mc)
    mean_b, mean_d, swing_b, swing_d = 0.5 * (pb + mb), 0.5 * (pd + md), 0.5 * (pb - mb), 0.5 * (pd - md)
    return Slopes(mean_b, mean_d, crank, coupler, swing_b, swing_d, coupler, crank)


@jit
def relative(error, value):
    """An error over its value, but no less than ROUNDING; NaN stays."""
    share = error / magnitude(value)
    return where(share <= ROUNDING, ROUNDING, share)


@jit
def angle_errors(lengths):
    """Relative errors of `extremes`."""
    b, d, f, e = lengths
    of = extremes(lengths)
    plus, minus = angle_error(b, d, f + e)[0], angle_error(b, d, f - e)[0]
    both = 0.5 * (plus + minus)
    crank_plus, crank_minus = angle_error(b, f + e, d)[0] + _ULP * math.pi, angle_error(b, f - e, d)[0]
    return Angles(
        relative(both, of.A0),
        relative(both, of.A1),
        relative(plus, of.eta_plus),
        relative(minus, of.eta_minus),
        relative(crank_plus, of.theta_plus),
        relative(crank_minus, of.theta_minus),
    )


@jit
def transmission_error(lengths):
    """Relative error of the transmission angle."""
    b, d, f, e = lengths
    lost = larger(angle_error(d, f, b - e)[0], angle_error(d, f, b + e)[0] + _ULP * math.pi)
    return relative(lost, transmission(lengths))


@jit
def _slope_errors(b, d, c):
    """Absolute errors of `_slopes`."""
    x = cosine(b, d, c)
    lost = angle_error(b, d, c)[1]
    area = b * d * sqrt(1.0 - x * x)
    own = _ROUNDINGS * (b * b + d * d + c * c) / (2.0 * area)
    by_b, by_d, by_c = _slopes(b, d, c)
    return own / b + magnitude(by_b) * lost, own / d + magnitude(by_d) * lost, by_c * lost


@jit
def slope_errors(lengths):
    """Relative errors of `tolerances`."""
    b, d, f, e = lengths
    pb, pd, pc = _slope_errors(b, d, f + e)
    mb, md, mc = _slope_errors(b, d, f - e)
    of = tolerances(lengths)
    frame, arm, third = 0.5 * (pb + mb), 0.5 * (pd + md), 0.5 * (pc + mc)
    coupler, crank = relative(third, of.A1_f), relative(third, of.A1_e)
    return Slopes(
        relative(frame, of.A0_b),
        relative(arm, of.A0_d),
        crank,
        coupler,
        relative(frame, of.A1_b),
        relative(arm, of.A1_d),
        coupler,
        crank,
    )
