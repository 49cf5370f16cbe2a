"""How much polishing there is along an arc of the work: the integral of the speed between tool and work.

Seen from the centre of the work at a distance w from the arm's pivot, the arm at the rate alpha' and the work at Omega,
    v^2 = ((alpha' - Omega) r)^2 + (alpha' w)^2 + 2 (alpha' - Omega) alpha' r w cos psi              (1)
with psi from the direction of w. With P and Q the speeds at psi = 0 and pi, v^2 = P^2 cos^2(psi/2) + Q^2 sin^2(psi/2),
    int_0^psi v dpsi = 2 P^2 [s R_F + (Q^2 - P^2) s^3 R_D/3](P^2 c^2, v^2, P^2),  s, c of psi/2      (2)
Source: B. C. Carlson, DLMF 19.25.9 and 19.36(i).
"""

from kernels.lanes.jit import jit, jit_apart, jit_call
from kernels.lanes.vectors import any_lane, choose, magnitude, sqrt, where
from kernels.maths.elementary import larger, smaller

_FLAT = 1e-9  # of a speed beside the other, which changes (2) by less than its square
_CLOSE = 0.01  # the series' first neglected term is below 1e-16 of it
_LIMIT = 60


@jit
def extremes(rate, spin, r, w):
    """P and Q of (1)."""
    turn, sweep = (rate - spin) * r, rate * w
    return magnitude(turn + sweep), magnitude(turn - sweep)


@jit
def _first_series(x, y):
    """R_F sqrt(A) from the relative deviations of its first two arguments from their mean A."""
    z = -(x + y)
    e2, e3 = x * y - z * z, x * y * z
    square = e2 * e2
    tail = e2 * (-3.0 * e3 / 44.0 - 5.0 * square / 208.0) + 3.0 * e3 * e3 / 104.0 + square * e3 / 16.0
    return 1.0 - e2 / 10.0 + e3 / 14.0 + square / 24.0 + tail


@jit
def _second_series(x, y):
    """R_D A^(3/2) from the relative deviations of its first two arguments from their weighted mean A."""
    z = -(x + y) / 3.0
    xy, zz = x * y, z * z
    e2, e3, e4, e5 = xy - 6.0 * zz, (3.0 * xy - 8.0 * zz) * z, 3.0 * (xy - zz) * zz, xy * zz * z
    low = 1.0 - 3.0 * e2 / 14.0 + e3 / 6.0 + 9.0 * e2 * e2 / 88.0 - 3.0 * e4 / 22.0 - 9.0 * e2 * e3 / 52.0
    middle = 3.0 * e5 / 26.0 - e2 * e2 * e2 / 16.0 + 3.0 * e3 * e3 / 40.0 + 3.0 * e2 * e4 / 20.0
    return low + middle + 45.0 * e2 * e2 * e3 / 272.0 - 9.0 * (e3 * e4 + e2 * e5) / 68.0


@jit_call
def along_arc(p, q, arc):
    """(2), within some ulp; `arc`: cosine and sine of psi/2, from 0 to 1."""
    c, s = arc
    largest = larger(p, q)
    unit = where(largest > 0.0, largest, 1.0)
    p, q = larger(p / unit, _FLAT), larger(q / unit, _FLAT)
    z = p * p
    x, difference = z * (c * c), (q - p) * (q + p)
    y = x + q * q * (s * s)
    share, summed = 1.0 + 0.0 * z, 0.0 * z
    for _ in range(_LIMIT):
        first, second = (x + y + z) / 3.0, 0.2 * (x + y + 3.0 * z)
        apart = larger(magnitude(first - x), larger(magnitude(first - y), magnitude(second - z)))
        going = apart > _CLOSE * smaller(first, second)
        if not any_lane(going):
            break
        root_x, root_y, root_z = sqrt(x), sqrt(y), sqrt(z)
        joint = root_x * (root_y + root_z) + root_y * root_z
        summed = where(going, summed + share / (root_z * (z + joint)), summed)
        nearer = 0.25 * (x + joint), 0.25 * (y + joint), 0.25 * (z + joint), 0.25 * share
        x, y, z, share = choose(going, nearer, (x, y, z, share))
    first, second = (x + y + z) / 3.0, 0.2 * (x + y + 3.0 * z)
    r_f = _first_series((first - x) / first, (first - y) / first) / sqrt(first)
    r_d = share * _second_series((second - x) / second, (second - y) / second) / (second * sqrt(second)) + 3.0 * summed
    return where(largest > 0.0, 2.0 * largest * (p * p) * s * (r_f + difference * (s * s) * r_d / 3.0), 0.0)


@jit_apart
def half_circle(p, q, arc):
    """(2) up to psi = pi: a quarter of an ellipse's circumference, twice, by the arithmetic-geometric mean.

    `arc` stands where `along_arc` has it.
    """
    largest = max(p, q)
    if not largest > 0.0:
        return 0.0
    a, b = 1.0, max(min(p, q) / largest, 1e-30)
    total, weight = 1.0 - 0.5 * (1.0 - b) * (1.0 + b), 1.0
    for _ in range(_LIMIT):
        c = 0.5 * (a - b)
        if c <= 1e-9 * a:
            break
        a, b = 0.5 * (a + b), sqrt(a * b)
        total -= weight * c * c
        weight += weight
    return largest * 3.141592653589793 * total / (0.5 * (a + b))
