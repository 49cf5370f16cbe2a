"""The four-bar linkage of a polishing machine: lengths b (frame), e (crank), f (coupler), d (arm).

The crank e turns about the end of b, the arm d about its beginning; p = b + e = d + f. With theta the crank's angle
from b, alpha the arm's, P = abs(p), side = +1 for type A (the arm is counterclockwise of p) and -1 for type B:
    alpha = arg p + side psi,  tan(psi/2) = rz/(2 d P + g),  g = P^2 + d^2 - f^2                     (1)
    rz^2 = ((d+f)^2 - P^2)(P^2 - (d-f)^2) = (S (d+f-b-e) + 4 b e sin^2(theta/2))
                                            ((b+f-e-d)(b+d-e-f) + 4 b e cos^2(theta/2)),  S = b+d+f+e    (2)
    alpha' = (e (e + b cos theta) + side b e sin theta Q/rz)/P^2,  Q = P^2 + f^2 - d^2                (3)
Source: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (9)-(13), where a radical sign is lost in (10), (11)
and (13), and (15), (16) are misprinted; (2) is Heron's form of (13), which keeps its digits where d and f are in line.

Derivatives are by theta: rates per unit rate of the crank. Lengths are in units of a power of two near the longest,
from `in_units`, and differences of them are sums without error, so that nothing but the last operations rounds.
"""

import math
from typing import NamedTuple

from kernels.interface import Field
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import fma, nearest, not_, pow2, sqrt, where
from kernels.maths.elementary import arctan, larger, mantissa_exponent, sincos
from kernels.maths.pairs import two_sum

SPAN_LIMIT = 2.0**-120
"""Shortest length over the longest, beyond which products would leave float64."""

PARAMETERS = (
    Field("b", "m", "distance of the motor's shaft from the arm's pivot", lower=0.0, open_lower=True),
    Field("d", "m", "arm, from its pivot to the coupler", lower=0.0, open_lower=True),
    Field("f", "m", "coupler, from the arm to the crank", lower=0.0, open_lower=True),
    Field("e", "m", "crank, the eccentricity of the motor's pin", lower=0.0),
    Field(
        "type",
        "1",
        "straight upper link (A) or one bent by 90 degrees (B): the side of the arm",
        default=0.0,
        lower=0.0,
        upper=1.0,
        choices={"A": 0, "B": 1},
    ),
)
"""Of a linkage."""

EXAMPLE = {"b": 0.6201, "d": 0.38, "f": 0.405, "e": 0.15, "type": 0.0}


class Lengths(NamedTuple):
    """Frame, arm, coupler and crank, over their unit."""

    b: float
    d: float
    f: float
    e: float


class Margins(NamedTuple):
    """d+f-b-e, b+f-e-d and b+d-e-f: all positive where the crank turns fully and is the shortest link."""

    stretched: float
    back: float
    front: float


class Crank(NamedTuple):
    """The crank's angle from b, and sine and cosine of its half."""

    theta: float
    s: float
    c: float


class Squares(NamedTuple):
    """P^2, Q = P^2 + f^2 - d^2, g = P^2 + d^2 - f^2 and K = d^2 + f^2 - P^2."""

    p2: float
    q: float
    g: float
    k: float


@jit
def sum4(w, x, y, z):
    """w + x + y + z within 3 ulp of the sum itself, however much cancels; 0 only where the sum is 0.

    (w + x) + (y + z) is either exact or far above what the two sums have lost.
    """
    first, first_lost = two_sum(w, x)
    second, second_lost = two_sum(y, z)
    lost, least = two_sum(first_lost, second_lost)
    total, rest = two_sum(first + second, lost)
    return total + (rest + least)


@jit
def sum3(x, y, z):
    """x + y + z within 2 ulp of the sum itself, for x + y that is large against what it has lost."""
    total, lost = two_sum(x, y)
    return (total + z) + lost


@jit
def in_units(p):
    """The lengths b, d, f, e of a record in units of 2^unit, unit, and whether they are not too unequal; e may be 0."""
    _, unit = mantissa_exponent(larger(larger(p.b, p.d), larger(p.f, p.e)))
    half = nearest(0.5 * unit)
    one, other = pow2(-half), pow2(half - unit)
    lengths = Lengths(p.b * one * other, p.d * one * other, p.f * one * other, p.e * one * other)
    fine = (lengths.b > SPAN_LIMIT) & (lengths.d > SPAN_LIMIT) & (lengths.f > SPAN_LIMIT)
    return lengths, unit, fine & ((lengths.e > SPAN_LIMIT) | not_(p.e > 0.0))


@jit
def margins(lengths):
    """`Margins` within 2 ulp of themselves and 2^-106 of the lengths: the third sum adds what the first two lose."""
    b, d, f, e = lengths
    arm, arm_lost = two_sum(d, -b)
    coupler, coupler_lost = two_sum(f, -e)
    front, front_lost = two_sum(b, -f)
    back, back_lost = two_sum(d, -e)
    return Margins(
        (coupler + arm) + (coupler_lost + arm_lost),
        (coupler - arm) + (coupler_lost - arm_lost),
        (front + back) + (front_lost + back_lost),
    )


@jit
def side_of(kind):
    """+1 for type A (0), -1 for type B (1)."""
    return where(kind > 0.5, -1.0, 1.0)


@jit
def crank_at(crank_angle, b_angle):
    """theta = crank_angle - b_angle, and sine and cosine of its half to an ulp of themselves, for abs(theta) < 1e6."""
    theta, lost = two_sum(crank_angle, -b_angle)
    s, c = sincos(0.5 * theta)
    return Crank(theta, fma(0.5 * lost, c, s), fma(-0.5 * lost, s, c))


@jit
def dead_gaps(lengths, margin, s, c):
    """The factors of rz^2 in (2): (d+f)^2 - P^2 and P^2 - (d-f)^2; s, c: sine and cosine of theta/2."""
    b, d, f, e = lengths
    stretched, back, front = margin
    bow = 4.0 * b * e
    return fma(stretched, (d + f) + (b + e), bow * (s * s)), fma(back, front, bow * (c * c))


@jit
def squares(lengths, c):
    """`Squares`, each without two large terms; c: cosine of theta/2."""
    b, d, f, e = lengths
    way = 4.0 * b * e * (c * c)
    near = b - e
    p2 = fma(near, near, way)
    over_d = fma(sum3(b, -e, -d), near + d, way)  # P^2 - d^2
    over_f = fma(sum3(b, -e, -f), near + f, way)  # P^2 - f^2
    difference = (f - d) * (f + d)
    q = where(f * f < p2, fma(f, f, over_d), p2 + difference)
    g = where(d * d < p2, fma(d, d, over_f), p2 - difference)
    return Squares(p2, q, g, where(d < f, fma(d, d, -over_f), fma(f, f, -over_d)))


@jit
def direction(lengths, crank):
    """arg p from b, continuous in theta: between -pi/2 and pi/2 for e <= b, and turning with the crank for e > b."""
    b, e = lengths.b, lengths.e
    theta, s, c = crank
    turning = e > b
    small, large = where(turning, b, e), where(turning, e, b)
    swing = arctan(2.0 * small * (s * c) / fma(2.0 * small * c, c, large - small))
    return where(turning, theta - swing, swing)


@jit
def opening(lengths, squared, rz):
    """psi of (1) between 0 and pi: the angle between p and the arm."""
    double, g = 2.0 * lengths.d * sqrt(squared.p2), squared.g
    obtuse = g < 0.0
    top, bottom = where(obtuse, double - g, rz), where(obtuse, rz, double + g)
    return 2.0 * arctan(top / bottom)


@jit
def acceleration(lengths, margin, squared, rz, side, s, c):
    """alpha'' at a constant rate of the crank, (3) once more by theta.

    With i = P^2 - (d-f)^2 and o = (d+f)^2 - P^2, at theta = 0 and pi where c and s are 0: i0 and o0 of the margins,
    (sin theta/rz)' = (c^2 i o0 - s^2 o i0)/rz^3
    alpha'' = (b e/P^2) [sin theta (e^2 - b^2)/P^2 + side (Q (sin theta/rz)' - 2 b e sin^2 theta (d^2 - f^2)/(P^2 rz))]
    """
    b, d, f, e = lengths
    p2, q = squared.p2, squared.q
    stretched, back, front = margin
    outer, inner = dead_gaps(lengths, margin, s, c)
    sine = 2.0 * s * c
    past = (c * c) * inner * (stretched * ((d + f) + (b + e)))
    steeper = fma(-(s * s) * outer, back * front, past) / (outer * inner)
    drift = 2.0 * b * e * (sine * sine) * ((d - f) * (d + f) / p2)
    bent = fma(q, steeper, -drift) * (side / rz)
    return b * e / p2 * fma(sine, (e - b) * (e + b) / p2, bent)


@jit_call
def motion(lengths, margin, side, crank):
    """alpha from b, alpha' and alpha''; NaN where the linkage is locked.

    Parameters
    ----------
    lengths : of `in_units`
    margin : of `margins`
    side : of `side_of`
    crank : of `crank_at`
    """
    s, c = crank.s, crank.c
    outer, inner = dead_gaps(lengths, margin, s, c)
    free = (outer >= 0.0) & (inner >= 0.0)
    rz = sqrt(where(free, outer * inner, math.nan))
    squared = squares(lengths, c)
    alpha = direction(lengths, crank) + side * opening(lengths, squared, rz)
    b, e = lengths.b, lengths.e
    turn = e * fma(2.0 * b * c, c, e - b)  # e (e + b cos theta)
    rate = fma(side * (2.0 * b * e), (s * c) * squared.q / rz, turn) / squared.p2
    return alpha, rate, acceleration(lengths, margin, squared, rz, side, s, c)
