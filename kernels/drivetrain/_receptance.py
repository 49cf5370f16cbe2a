"""Receptance of a chain: the angle at one inertia for a torque at another, without loss beyond what the scene has.

With K_j = k_j + i w h_j the chain is followed from either end as in `_holzer`, g before an inertia:
    g'_j = g_j - w^2 J_j x_j,  x_(j+1) = x_j + g'_j/K_j,  g_(j+1) = g'_j;  from the right x_n = 1, g_n = K_n.   (1)
For p <= q both are known at q, and a torque at p turns q (or one at q turns p) by
    H = x_p(left) x_q(right)/W,  W = g_q(left) x_q(right) + g_q(right) x_q(left) - w^2 J_q x_q(left) x_q(right).  (2)
Steps (1) are exact for an inertia and a spring a few roundings off, so what is lost is what they are worth: by
    dH/d(w^2 J_j) = H_pj H_jq,  dH/dK_j = -(H_pj - H_pj+1)(H_jq - H_j+1q)                               (3)
the bound on abs(dH)/abs(H) is the sum of w^2 J_j abs(H_pj H_jq)/abs(H) and of the same of the springs, times rounding:
it is large near a resonance with little damping and near an antiresonance, and infinite at a resonance without any.
Source: (2) is the Green's function of a three-term recurrence; bound derived here.
"""

import math
from typing import NamedTuple

from kernels.drivetrain._chain import extremes
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import any_lane, choose, exponent, fma, where
from kernels.maths import complex
from kernels.maths.elementary import scale

ROUNDING = 2.0**-50
"""Of an inertia and a spring in (1): 8 half ulps."""
REACH = 2.0**300
"""Largest w and w h without units."""
SLOWEST = 2.0**-400
"""Least w without units of a chain without ground: below it w^2 J loses digits."""
_FAR = 2.0**100


class Way(NamedTuple):
    """A chain followed from one end: x and g over 2^e, and the sum of (3) so far, without W."""

    x: tuple
    g: tuple
    e: float
    work: float


@jit
def _turned(x, g, inertia):
    """g of (1) beyond an inertia w^2 J."""
    return fma(-inertia, x[0], g[0]), fma(-inertia, x[1], g[1])


@jit_apart
def _on(way, inertia, spring):
    """The way across an inertia and a spring; over a power of two where it leaves the middle of the range."""
    x, g, e, work = way
    work = fma(inertia, complex.square(x), work)
    g = _turned(x, g, inertia)
    wound = complex.over(g, spring)
    work = fma(complex.size(g), complex.size(wound), work)
    x = x[0] + wound[0], x[1] + wound[1]
    size = complex.size(x) + complex.size(g)
    off = (size > _FAR) | (size < 1.0 / _FAR)
    if any_lane(off):
        own = where(off, exponent(where(size > 0.0, size, 1.0)), 0.0)
        x, g = complex.scaled(x, -own), complex.scaled(g, -own)
        e, work = e + own, scale(work, -2.0 * own)
    return Way(x, g, e, work)


@jit_apart
def receptance(chain, w, drive, read, at, rows):
    """(re, im, e, error): angle over 2^e at `read` per torque at `drive`, of one number w or lanes.

    `chain` and w are without units; inertias are counted from 1. `error` bounds what rounding does, as a share of the
    modulus; it is infinite where the receptance is. `rows` has room for 3 n entries, one after the other as `at` says.
    """
    J, k, h, _, _ = chain
    n, p, q, zero, square = J.size, min(drive, read) - 1, max(drive, read) - 1, 0.0 * w, w * w
    # from the left to p and on to q: abs x and g' and their exponents between are kept in `rows`
    left = near = Way((zero + 1.0, zero), (zero, zero), zero, zero)
    for j in range(q + 1):
        if j == p:
            near = left
        if j >= p:
            rows[at(j)], rows[at(2 * n + j)] = complex.size(left.x), left.e
            rows[at(n + j)] = complex.size(_turned(left.x, left.g, square * J[j]))
        if j < q:
            left = _on(left, square * J[j], (k[j] + zero, w * h[j]))
    # from the right to q
    spring = k[n - 1] + zero, w * h[n - 1]
    right = Way((zero + 1.0, zero), spring, zero, complex.size(spring))
    for j in range(n - 1, q, -1):
        right = _on(right, square * J[j], (k[j - 1] + zero, w * h[j - 1]))
    # W of (2), and H
    one, other = complex.product(left.g, right.x), complex.product(right.g, left.x)
    third, inertia = complex.product(left.x, right.x), square * J[q]
    net = fma(-inertia, third[0], one[0] + other[0]), fma(-inertia, third[1], one[1] + other[1])
    own = exponent(where(complex.size(net) > 0.0, complex.size(net), 1.0))
    ratio = complex.over(complex.product(near.x, right.x), complex.scaled(net, -own))
    # the sum of (3) from q to p, on the way from the right, and beyond both
    e_W, total, far = left.e + right.e, zero, right
    for j in range(q, p - 1, -1):
        inertia = square * J[j]
        total = total + scale(inertia * rows[at(j)] * complex.size(far.x), rows[at(2 * n + j)] + far.e - e_W)
        if j > p:
            spring = k[j - 1] + zero, w * h[j - 1]
            wound = complex.size(complex.over(_turned(far.x, far.g, inertia), spring))
            total = total + scale(rows[at(n + j - 1)] * wound, rows[at(2 * n + j - 1)] + far.e - e_W)
            far = _on(far, inertia, spring)
    total = total + scale(near.work * (complex.size(far.x) / complex.size(near.x)), near.e + far.e - e_W)
    total = total + right.work * (complex.size(left.x) / complex.size(right.x))
    error = ROUNDING * (1.0 + total / complex.size(net))
    sound = (w < REACH) & (w * extremes(n, h)[1] < REACH) & (w + k[n - 1] > SLOWEST)
    re, im = choose(sound, ratio, (math.nan * w, math.nan * w))
    return re, im, near.e - left.e - own, where(sound & (error < math.inf), error, math.inf)
