"""Extreme angles of a linkage's arm, whether its crank turns fully, and what a length more does to them.

At an extreme the crank and the coupler are in line, and b, d and c = f + e (eta_plus) or f - e (eta_minus) a triangle:
    tan(eta/2) = sqrt((c-b+d)(c+b-d)/((b+d+c)(b+d-c)))                                               (1)
With S = b+d+f+e and the margins m1 = d+f-b-e, m2 = b+f-e-d, m3 = b+d-e-f (sums without error), the roots
    k = sqrt((m1+2e)(m2+2e)), l = sqrt(m1 m2), m = sqrt(S m3), n = sqrt((m1+2b)(m3+2e))
give tan(eta_plus/2) = k/m, tan(eta_minus/2) = l/n, k^2 + m^2 = l^2 + n^2 = 4 b d, and from those
    A0 = (eta_plus + eta_minus)/2, A1 = (eta_plus - eta_minus)/2 = atan(16 b d e f/((k n + l m)(m n + k l)))   (2)
Derivatives of A0 and A1 by the lengths, where Z1 = d^2+f^2-b^2-e^2 and Z2 = b^2+f^2-d^2-e^2:
    A1_f = A0_e = 4 e f Z1 Z2/(((f+e) l n + (f-e) k m) k l m n),  A1_e = A0_f = (f+e)/(k m) + (f-e)/(l n)
    A1_b = 4 e f W/((k n + l m) k l m n),  A0_d = (k n + l m) W/(4 b d k l m n),                     (3)
    W = (b-d) m n - (b+d) k l = -4 b d Z1 Z2/((b-d) m n + (b+d) k l);  b, d, Z1, Z2 swap with d, b, Z2, Z1: A1_d, A0_b
Every difference in them is one of the margins or of Z1 and Z2, so each value has its digits next to a dead point too.

Source: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (27)-(40); (40) lacks its 1/2, (36) a sign. (1)-(3)
are the same quantities without the paper's arccos, which loses half its digits next to a dead point.
The motor turns fully where abs(d-f) <= abs(b-e) and b+e <= d+f; numbers under a root do not tell (b = 62, d = 60,
f = 5, e = 10 has two angles by the arccos, and locks).
"""

import math
from typing import NamedTuple

from kernels.lanes.codes import CHANGE_POINT, DOUBLE_CRANK, LOCK_UP, NO_ASSEMBLY, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import any_lane, choose, fma, horner, magnitude, not_, sqrt, where
from kernels.maths.elementary import larger, smaller
from kernels.maths.pairs import two_product, two_sum
from kernels.polisher.linkage import Lengths, Margins, in_units, margins, sum4

ROUNDING = 3e-15
"""What closed forms are right to."""
UNIT_LIMIT = 720.0
"""Power of two of the longest length, beyond which derivatives would leave float64."""
HAIR = 2.0**-53
"""Share of b+d+f+e that rounding the four lengths may add to a margin: closer to 0 it is a change point."""
NARROW = 2.0**-40
"""Share of b^2+d^2+f^2+e^2 down to which 32 digits of a sum of squares suffice."""

_TAN_PI_8 = 0.41421356237309503
_QUARTER, _QUARTER_LOW = 0.7853981633974483, 3.061616997868383e-17
# of (arctan(c)/c - 1)/c^2 in c^2, interpolated at 12 Chebyshev points of abs(c) < tan(pi/8): 3e-18 of the arctangent
_ARCTAN = (
    -0.3333333333333333, 0.19999999999999804, -0.14285714285659828, 0.11111111105155437, -0.09090908753500393,
    0.07692296375018166, -0.06666424885487231, 0.05878928994948492, -0.052304542493924897, 0.04551593123658399,
    -0.03457055948759698, 0.01628575409147857,
)  # fmt: skip


class Cell(NamedTuple):
    """Lengths without units, their unit and margins, and the verdict on the linkage."""

    lengths: Lengths
    unit: float
    margin: Margins
    code: float


@jit
def said(code, status):
    """Whether the code of a cell is that status."""
    return magnitude(code - status) < 0.5


@jit
def verdict(lengths, margin):
    """OK for a crank that turns and an arm that swings, else LOCK_UP, CHANGE_POINT, DOUBLE_CRANK or NO_ASSEMBLY."""
    b, d, f, e = lengths
    m1, m2, m3 = margin
    hair = HAIR * ((b + d) + (f + e))
    sense = where(e > b, -1.0, 1.0)  # a crank longer than the frame: abs(b-e) = e-b
    least = smaller(m1, smaller(sense * m2, sense * m3))
    turning = where(least > hair, where(e < b, OK, DOUBLE_CRANK), CHANGE_POINT)
    locked = least < -hair
    if any_lane(locked):  # where the longest link is longer than the other three, they cannot be joined
        crank_or_frame = smaller(sum4(d, f, e, -b), sum4(b, d, f, -e))
        spare = smaller(crank_or_frame, smaller(sum4(b, e, f, -d), sum4(b, d, e, -f)))
        return where(locked, where(spare < 0.0, NO_ASSEMBLY, LOCK_UP), turning)
    return turning


@jit
def judged(p):
    """The `Cell` of a record with b, d, f, e."""
    lengths, unit, fine = in_units(p)
    margin = margins(lengths)
    code = verdict(lengths, margin)
    return Cell(lengths, unit, margin, where(fine & (magnitude(unit) <= UNIT_LIMIT), code, OUT_OF_RANGE))


@jit
def flattened(lengths, margin):
    """The margins of a linkage that turns, without what rounding has taken them past 0 by."""
    m1, m2, m3 = margin
    turns = lengths.e > lengths.b
    back = where(turns, smaller(m2, 0.0), larger(m2, 0.0))
    return Margins(larger(m1, 0.0), back, where(turns, smaller(m3, 0.0), larger(m3, 0.0)))


@jit_call
def angle(y, x):
    """Direction of (x, y) for x, y >= 0, within 2 ulp; 0 for (0, 0)."""
    low, high = smaller(x, y), larger(x, y)
    middle = low > _TAN_PI_8 * high
    top, bottom = where(middle, low - high, low), where(middle, low + high, high)
    tangent = top / where(bottom > 0.0, bottom, 1.0)
    v = tangent * tangent
    value = fma(tangent * v, horner(v, _ARCTAN), tangent)
    value = where(middle, _QUARTER + (value + _QUARTER_LOW), value)
    return where(y > x, 2.0 * _QUARTER - (value - 2.0 * _QUARTER_LOW), value)


@jit
def transmission(lengths, margin):
    """The least angle between coupler and arm, or their extensions, of a crank that turns: at theta = 0 or pi."""
    b, d, f, e = lengths
    m1, m2, m3 = margin
    short, sense = smaller(b, e), where(e > b, -1.0, 1.0)
    m2, m3 = sense * m2, sense * m3
    inner, inner_rest = larger(m2, 0.0) * larger(m3, 0.0), fma(2.0, e, m1) * fma(2.0, b, m1)
    outer, outer_rest = m1 * ((b + d) + (f + e)), fma(2.0, short, m2) * fma(2.0, short, m3)
    folded = inner * outer_rest < outer * inner_rest
    square, rest = where(folded, inner, outer), where(folded, inner_rest, outer_rest)
    return 2.0 * angle(sqrt(square * rest), rest)


@jit
def locks(lengths, margin):
    """Crank angles from b, to either side, where it locks, the nearest to 0 first; NaN for what there is not.

    d and f stretched stop it towards 0 where b + e > d + f, d and f folded stop it towards pi where
    abs(b-e) < abs(d-f).
    """
    b, d, f, e = lengths
    m1, m2, m3 = margin
    over_d, over_f = sum4(b, e, f, -d), sum4(b, d, e, -f)
    # the squared tangent of a half angle is a share of two such products
    open_, rest = larger(-m1, 0.0) * ((b + d) + (f + e)), sum4(d, f, e, -b) * sum4(b, d, f, -e)
    stretched = 2.0 * angle(sqrt(open_), sqrt(rest))
    opposite = (m2 < 0.0) & (m3 > 0.0) | (m2 > 0.0) & (m3 < 0.0)
    folded = 2.0 * angle(sqrt(over_d * over_f), sqrt(where(opposite, -m2 * m3, 0.0)))
    inner, outer = where(m1 < 0.0, stretched, math.nan), where(opposite, folded, math.nan)
    return where(m1 < 0.0, inner, outer), where(m1 < 0.0, outer, math.nan)


@jit
def _difference_of_squares(x, y):
    """x^2 - y^2 as a sum of three numbers, the second of what the first has no room for, the third of the second."""
    x2, x_lost = two_product(x, x)
    y2, y_lost = two_product(y, y)
    high, low = two_sum(x2, -y2)
    lost, least = two_sum(x_lost, -y_lost)
    low, rest = two_sum(low, lost)
    return high, low, rest + least


@jit_call
def _narrow_square_sum(x, y):
    """The sum of two such sums, with the digits that are left when the two higher numbers of both cancel."""
    high, low = two_sum(x[0], y[0])
    middle, least = two_sum(x[1], y[1])
    low, rest = two_sum(low, middle)
    high, low = two_sum(high, low)
    return high + (low + (rest + (least + (x[2] + y[2]))))


@jit
def square_sums(lengths):
    """Z1 = d^2+f^2-b^2-e^2 and Z2 = b^2+f^2-d^2-e^2, with their digits wherever squares cancel.

    In 32 digits, unless less than NARROW of the squares is left.
    """
    b, d, f, e = lengths
    (b2, b_lost), (d2, d_lost) = two_product(b, b), two_product(d, d)
    (f2, f_lost), (e2, e_lost) = two_product(f, f), two_product(e, e)
    arm, arm_lost = two_sum(d2, -b2)
    coupler, coupler_lost = two_sum(f2, -e2)
    arm_lost, coupler_lost = arm_lost + (d_lost - b_lost), coupler_lost + (f_lost - e_lost)
    z1, z1_lost = two_sum(coupler, arm)
    z2, z2_lost = two_sum(coupler, -arm)
    z1, z2 = z1 + (z1_lost + (coupler_lost + arm_lost)), z2 + (z2_lost + (coupler_lost - arm_lost))
    hair = NARROW * ((b2 + d2) + (f2 + e2))
    narrow = not_((magnitude(z1) > hair) & (magnitude(z2) > hair))
    if any_lane(narrow):
        of_arm, (high, low, least) = _difference_of_squares(f, e), _difference_of_squares(d, b)
        exact = _narrow_square_sum(of_arm, (high, low, least)), _narrow_square_sum(of_arm, (-high, -low, -least))
        return choose(narrow, exact, (z1, z2))
    return z1, z2


@jit
def extremes(lengths, margin):
    """For type A: A0, A1, eta_plus, eta_minus, theta_plus, theta_minus; (3) of A0 by b, d, f, e; and of A1.

    Angles of the arm are (1) and (2), sums of positive angles; those of the crank are in the same triangles.
    Derivatives are in units of one over the unit of lengths. W cancels for the longer of b and d only: there it is
    taken from Z1 Z2, and the other one is -`apart`.
    """
    b, d, f, e = lengths
    m1, m2, m3 = margin
    k, low = sqrt(fma(2.0, e, m1) * fma(2.0, e, m2)), sqrt(m1 * m2)
    m, n = sqrt(((b + d) + (f + e)) * m3), sqrt(fma(2.0, b, m1) * fma(2.0, e, m3))
    width = fma(k, n, low * m)

    across = width * fma(m, n, k * low)
    swing = angle(16.0 * (e * f) * (b * d), where(e > 0.0, across, 1.0))
    minus = 2.0 * angle(low, n)
    crank_plus = angle(((b + d) + (f + e)) * fma(2.0, e, m2), k * m)
    crank_minus = angle(m1 * fma(2.0, e, m3), low * n)
    angles = minus + swing, swing, fma(2.0, swing, minus), minus, 2.0 * crank_plus, -2.0 * crank_minus

    z1, z2 = square_sums(lengths)
    plus, minus = k * m, low * n
    per_area = 1.0 / (plus * minus)
    apart = fma(magnitude(b - d), m * n, (b + d) * (k * low))
    leaning, opposed = -4.0 * (b * d) * (z1 * z2) / apart * per_area, -apart * per_area
    frame, arm = where(b > d, leaning, opposed), where(b > d, opposed, leaning)
    of_mean, of_swing = width / (4.0 * b * d), 4.0 * (e * f) / width
    leverage = fma(f + e, minus, (f - e) * plus)
    coupler, crank = 4.0 * (e * f) * (z1 * z2) / leverage * per_area, leverage * per_area
    return angles, (of_mean * arm, of_mean * frame, crank, coupler), (of_swing * frame, of_swing * arm, coupler, crank)
