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

from kernels.drivetrain._chain import Scaled, extremes, same, units
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import any_lane, choose, exponent, fma, magnitude, where
from kernels.maths import complex
from kernels.maths.elementary import scale

ROUNDING = 2.0**-50
"""Of an inertia and a spring in (1): 8 half ulps."""
REACH = 2.0**300
"""Largest w and w h without units."""
_FAR = 2.0**100


class Way(NamedTuple):
    """A chain followed from one end: x and g over 2^e, and the sum of (3) so far, without W."""

    x: tuple
    g: tuple
    e: float
    work: float


@jit
def _renormed(way):
    """A way, its numbers over a power of two where they leave the middle of the range; exact."""
    x, g, e, work = way
    size = magnitude(x[0]) + magnitude(x[1]) + magnitude(g[0]) + magnitude(g[1])
    off = (size > _FAR) | (size < 1.0 / _FAR)
    if any_lane(off):
        own = where(off, exponent(where(size > 0.0, size, 1.0)), 0.0)
        x, g = complex.scaled(x, -own), complex.scaled(g, -own)
        e, work = e + own, scale(work, -2.0 * own)
    return Way(x, g, e, work)


@jit
def _turned(x, g, inertia):
    """g of (1) beyond an inertia w^2 J."""
    return fma(-inertia, x[0], g[0]), fma(-inertia, x[1], g[1])


@jit_apart
def _on(way, inertia, spring):
    """The way across an inertia and a spring."""
    x, g, e, work = way
    work = fma(inertia, complex.square(x), work)
    g = _turned(x, g, inertia)
    wound = complex.over(g, spring)
    work = fma(complex.size(g), complex.size(wound), work)
    return _renormed(Way((x[0] + wound[0], x[1] + wound[1]), g, e, work))


@jit
def _element(j, chain, w):
    """w^2 J_j and K_j, without units."""
    J, k, h, e_J, e_k = chain
    return w * w * scale(J[j], -e_J), (scale(k[j], -e_k) + 0.0 * w, w * scale(h[j], -0.5 * (e_J + e_k)))


@jit_apart
def _from_left(p, q, chain, w, n, at, rows):
    """The ways as they come to p and to q >= p; abs x and g' and their exponents between are kept in `rows`."""
    zero = 0.0 * w
    way = Way((zero + 1.0, zero), (zero, zero), zero, zero)
    first = way
    for j in range(q + 1):
        inertia, spring = _element(j, chain, w)
        if j == p:
            first = way
        if j >= p:
            rows[at(j)], rows[at(2 * n + j)] = complex.size(way.x), way.e
            rows[at(n + j)] = complex.size(_turned(way.x, way.g, inertia))
        if j < q:
            way = _on(way, inertia, spring)
    return first, way


@jit_apart
def _from_right(q, chain, w, n):
    """The way as it comes to q."""
    zero = 0.0 * w
    _, spring = _element(n - 1, chain, w)
    way = Way((zero + 1.0, zero), spring, zero, complex.size(spring))
    for j in range(n - 1, q, -1):
        way = _on(way, _element(j, chain, w)[0], _element(j - 1, chain, w)[1])
    return way


@jit_apart
def _between(p, q, way, e_W, chain, w, n, at, rows):
    """The sum of (3) from p to q, over 2^e_W; and the way as it comes to p from q."""
    total = 0.0 * w
    for j in range(q, p - 1, -1):
        inertia, _ = _element(j, chain, w)
        total = total + scale(inertia * rows[at(j)] * complex.size(way.x), rows[at(2 * n + j)] + way.e - e_W)
        if j > p:
            _, spring = _element(j - 1, chain, w)
            wound = complex.size(complex.over(_turned(way.x, way.g, inertia), spring))
            total = total + scale(rows[at(n + j - 1)] * wound, rows[at(2 * n + j - 1)] + way.e - e_W)
            way = _on(way, inertia, spring)
    return total, way


@jit
def _net(left, right, inertia):
    """W of (2)."""
    one, other = complex.product(left.g, right.x), complex.product(right.g, left.x)
    third = complex.product(left.x, right.x)
    return fma(-inertia, third[0], one[0] + other[0]), fma(-inertia, third[1], one[1] + other[1])


@jit_apart
def receptance(n, J, k, h, omega, drive, read, at, rows):
    """(re, im, error): angle at `read` per torque at `drive` [rad/(N m)] at omega [rad/s], of one number or lanes.

    Inertias are counted from 1. `error` bounds what rounding does, as a share of the modulus; it is infinite where the
    receptance is. `rows` has room for 3 n entries, one after the other as `at` says.
    """
    e_J, e_k, sound = units(n, same, J, k)
    chain = Scaled(J, k, h, e_J, e_k)
    p, q = min(drive, read) - 1, max(drive, read) - 1
    w = scale(omega, -0.5 * (e_k - e_J))
    near, left = _from_left(p, q, chain, w, n, at, rows)
    right = _from_right(q, chain, w, n)
    inertia, _ = _element(q, chain, w)
    net = _net(left, right, inertia)
    own = exponent(where(complex.size(net) > 0.0, complex.size(net), 1.0))
    ratio = complex.over(complex.product(near.x, right.x), complex.scaled(net, -own))
    e_W = left.e + right.e
    total, far = _between(p, q, right, e_W, chain, w, n, at, rows)
    outer = near.work * (complex.size(far.x) / complex.size(near.x))
    total = total + scale(outer, near.e + far.e - e_W)
    total = total + right.work * (complex.size(left.x) / complex.size(right.x))
    error = ROUNDING * (1.0 + total / complex.size(net))
    sound = sound & (w < REACH) & (w * scale(extremes(n, same, h)[1], -0.5 * (e_J + e_k)) < REACH)
    shift = near.e - left.e - e_k - own
    re, im = choose(sound, complex.scaled(ratio, shift), (math.nan * w, math.nan * w))
    return re, im, where(sound & (error < math.inf), error, math.inf)
