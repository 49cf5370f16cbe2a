"""Exact motion of a linear piece, x'' + 2 beta x' + kappa x = F, between two events.

From a place x where the velocity is v and the acceleration at rest would be f = F - kappa x, the displacement is
    y(t) = v S(t) + f C(t),  y'(t) = v S'(t) + f S(t)                                                (1)
S is the response to an impulse, C that to a constant force, S = C'. With p = beta t, w = kappa t^2, delta = p^2 - w
    S = t e^-p sinhc(sqrt delta),  S' = e^-p (cosh - p sinhc),  D = 1 - kappa C = e^-p (cosh + p sinhc)  (2)
and K(t), the integral of S^2, gives the work of damping. A *response* is the tuple (S, C, S'). The same form holds for
free (kappa = 0), under-, critically and overdamped motion: for C and K, which cancel in (2), a power series is used
where digits would be lost. beta may be negative: that is the same motion backwards in time.
Errors: S and C 2e-15, K 6e-15, S' 2e-15 of its largest value.
"""

import math

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import any_lane, fma, magnitude, not_, sqrt, where
from kernels.maths.elementary import arctan, exp, log1p, sincos

CROSSING_LIMIT = 200
"""Steps of the root search, Halley's or bisections; about six are usual."""

_RESPONSE_TERMS, _LOSS_TERMS = 26, 28
_CIRCLE = tuple(1.0 / math.factorial(j) for j in range(18))
_SLOW = tuple(1.0 / (2 * j + 1) for j in range(14))
_PI = math.pi


@jit
def _series(p, w):
    """S/t, C/t^2 and S' as power series: y'' + 2p y' + w y = 1 in units of t, for abs(p) <= 1, w <= 2."""
    two_p = 2.0 * p
    before, term = 0.0 * p, 0.0 * p + 0.5
    c, s, slope = term, 2.0 * term, 2.0 * term
    for j in range(1, _RESPONSE_TERMS):
        after = -fma(two_p * (j + 1.0), term, w * before) * (1.0 / ((j + 2.0) * (j + 1.0)))
        before, term = term, after
        c, s, slope = c + term, fma(j + 2.0, term, s), fma((j + 2.0) * (j + 1.0), term, slope)
    return s, c, slope


@jit
def _creeping(p, w, root):
    """S/t, D, S' and r1, r2 of the overdamped motion e^(-r1), e^(-r2); r2 = w/r1 keeps its digits for small w."""
    r1 = where(p < 0.0, p - root, p + root)
    r2 = w / r1
    e1, e2 = exp(-r1), exp(-r2)
    gap = 1.0 / (r1 - r2)
    return (e2 - e1) * gap, (r1 * e2 - r2 * e1) * gap, (r1 * e1 - r2 * e2) * gap, r1, r2


@jit
def _swinging(p, delta, root):
    """S/t, D and S' of the underdamped motion and of its border, where sinhc is a power series."""
    flat = magnitude(delta) < 0.09
    sine, cosine = sincos(where(delta < 0.0, root, 0.0))
    near_sine, near_cosine = 0.0 * delta, 0.0 * delta
    for j in range(8, -1, -1):
        near_sine = fma(near_sine, delta, _CIRCLE[2 * j + 1])
        near_cosine = fma(near_cosine, delta, _CIRCLE[2 * j])
    decay = exp(-p)
    sinhc = decay * where(flat, near_sine, sine / where(flat, 1.0, root))
    cosh = decay * where(flat, near_cosine, cosine)
    return sinhc, fma(p, sinhc, cosh), fma(-p, sinhc, cosh)


@jit
def _far(p, w):
    """S/t, C/t^2 and S' where `_series` does not reach.

    C = (1 - D)/kappa, or where the slow exponent r2 is small, (E(r2) - E(r1))/(r1 - r2) with E(r) = (1 - e^-r)/r.
    """
    delta = fma(p, p, -w)
    creeps = delta > 0.09
    root = sqrt(magnitude(delta))
    s, d, slope, r1, r2 = _creeping(where(creeps, p, 2.0), where(creeps, w, 0.0), where(creeps, root, 2.0))
    s_swing, d_swing, slope_swing = _swinging(
        where(creeps, 1.0, p), where(creeps, -1.0, delta), where(creeps, 1.0, root)
    )
    slowly = creeps & (magnitude(r2) < 0.5)
    r = where(slowly, r2, 0.0)
    parts = (_share(r) - (1.0 - exp(-r1)) / r1) / (r1 - r)
    c = (1.0 - where(creeps, d, d_swing)) / where(w > 0.0, w, 1.0)
    return where(creeps, s, s_swing), where(slowly, parts, c), where(creeps, slope, slope_swing)


@jit
def _share(r):
    """(1 - e^-r)/r for abs(r) <= 1."""
    value = 0.0 * r
    for j in range(18, -1, -1):
        value = fma(value * -r, 1.0 / (j + 2.0), 1.0)
    return value


@jit_call
def response(beta, kappa, t):
    """S, C and S' of (1) at time t."""
    p, w = beta * t, kappa * t * t
    near = (magnitude(p) <= 1.0) & (w <= 2.0)
    s, c, slope = _series(where(near, p, 0.0), where(near, w, 0.0))
    if any_lane(not_(near)):
        s_far, c_far, slope_far = _far(where(near, 2.0, p), where(near, 0.0, w))
        s, c, slope = where(near, s, s_far), where(near, c, c_far), where(near, slope, slope_far)
    return t * s, t * t * c, slope


@jit
def _loss_series(p, w):
    """K/t^3 as a power series: u = S^2 obeys u''' + 6p u'' + (8p^2 + 4w) u' + 8pw u = 0; abs(p) <= 0.5, w <= 1."""
    a, b, c = 6.0 * p, fma(8.0 * p, p, 4.0 * w), 8.0 * p * w
    u0, u1, u2 = 0.0 * p, 0.0 * p, 0.0 * p + 1.0
    total = u2 * (1.0 / 3.0)
    for j in range(_LOSS_TERMS):
        after = a * (j + 2.0) * (j + 1.0) * u2 + b * (j + 1.0) * u1 + c * u0
        u0, u1, u2 = u1, u2, after * (-1.0 / ((j + 3.0) * (j + 2.0) * (j + 1.0)))
        total = total + u2 * (1.0 / (j + 4.0))
    return total


@jit_call
def loss(beta, kappa, t):
    """K(t), the integral of S^2 from 0 to t, with the digits of S however small the damping.

    From the energy, (C (1 + D) - S^2)/(4 beta); where that cancels, from the integral of e^-2p sin^2, or its series.
    """
    p, w = beta * t, kappa * t * t
    damped, slow = magnitude(p) > 0.5, w <= 1.0
    value = _loss_series(where(damped | not_(slow), 0.0, p), where(damped | not_(slow), 0.0, w))
    if any_lane(damped | not_(slow)):
        s, c, _ = response(where(damped, p, 1.0), where(damped, w, 0.0), 0.0 * p + 1.0)
        by_energy = fma(c, 2.0 - where(damped, w, 0.0) * c, -s * s) / (4.0 * where(damped, p, 1.0))
        swings = not_(damped | slow)
        by_angle = _loss_by_angle(where(swings, p, 0.0), where(swings, w, 2.0))
        value = where(damped, by_energy, where(slow, value, by_angle))
    return t * t * t * value


@jit
def _loss_by_angle(p, w):
    """K/t^3 = (E(2p) - (p + e^-2p (q sin 2q - p cos 2q))/(2w))/(2 q^2), q^2 = w - p^2, E(x) = (1 - e^-x)/x."""
    q = sqrt(fma(-p, p, w))
    sine, cosine = sincos(2.0 * q)
    decay = exp(-2.0 * p)
    turned = (p + decay * (q * sine - p * cosine)) / (2.0 * w)
    return (_share(2.0 * p) - turned) / (2.0 * q * q)


@jit
def motion(beta, kappa, v, f, t):
    """Way and speed after time t, by (1)."""
    s, c, slope = response(beta, kappa, t)
    return fma(v, s, f * c), fma(v, slope, f * s)


@jit
def _artanh_ratio(x, gap):
    """artanh(z)/z with z^2 = x = 1 - gap, through 0 to arctan for x < 0; for x < 1."""
    flat = magnitude(x) < 0.1
    near = 0.0 * x
    for j in range(len(_SLOW) - 1, -1, -1):
        near = fma(near, x, _SLOW[j])
    z = sqrt(where(flat, 1.0, magnitude(x)))
    steep = (x > 0.0) & not_(flat)
    far = 0.5 * log1p(2.0 * z * (1.0 + z) / where(steep, gap, 1.0))
    return where(flat, near, where(steep, far, arctan(z)) / z)


@jit_call
def first_reversal(beta, kappa, v, f):
    """Time after which the speed first returns to 0, for v >= 0; inf where it never does.

    tanh(sqrt(Delta) t)/sqrt(Delta) = v/(beta v - f), Delta = beta^2 - kappa; for v = 0 half a free swing, where there
    is one. Exact: no search.
    """
    big = fma(beta, beta, -kappa)
    slowing = fma(beta, v, -f)
    ahead = (slowing > 0.0) & (v > 0.0)
    ratio = v / where(ahead, slowing, 1.0)
    x = big * ratio * ratio
    gap = fma(f, fma(-2.0 * beta, v, f), kappa * v * v) / where(ahead, slowing * slowing, 1.0)  # 1 - x
    turns = ahead & (gap > 0.0) & ((x < 1.0) | (f < 0.0))  # against a force it always turns
    soon = ratio * _artanh_ratio(where(turns, x, 0.0), where(turns, gap, 1.0))
    root = sqrt(where(big < 0.0, -big, 1.0))
    angle = _PI - arctan(v * root / where(slowing < 0.0, -slowing, 1.0))
    angle = where(v > 0.0, where(slowing < 0.0, angle, 0.5 * _PI), _PI)
    return where(ahead, where(turns, soon, math.inf), where(big < 0.0, angle / root, math.inf))


@jit
def reach(beta, kappa, v, f):
    """The way to the first reversal, or what a motion without one tends to."""
    until = first_reversal(beta, kappa, v, f)
    turns = until < math.inf
    turning, _ = motion(beta, kappa, v, f, where(turns, until, 0.0))
    rest = where(kappa > 0.0, f / where(kappa > 0.0, kappa, 1.0), math.inf)
    coasts = not_((kappa > 0.0) | (f > 0.0) | not_(beta > 0.0))
    return where(turns, turning, where(coasts, 0.5 * v / where(coasts, beta, 1.0), rest))


@jit_call
def first_crossing(beta, kappa, v, f, way):
    """Time after which the way has first become `way` > 0, for v >= 0; inf where the motion turns or ends before.

    Between the start and the first reversal the way grows, so the root is one; as no acceleration exceeds f, it is
    bracketed from below by free flight, from above by the reversal. Halley's steps, bisections where they leave the
    bracket. `beta` >= 0.
    """
    until = first_reversal(beta, kappa, v, f)
    meets = (way < reach(beta, kappa, v, f)) & ((v > 0.0) | (f > 0.0))
    fast = where(f > 0.0, f, 0.0)
    low = 2.0 * way / where(meets, v + sqrt(fma(v, v, 2.0 * fast * way)), 1.0)
    high, t, active = until, low, meets
    for _ in range(CROSSING_LIMIT):
        if not any_lane(active):
            break
        s, c, slope = response(beta, kappa, t)
        miss, speed = fma(v, s, f * c) - way, fma(v, slope, f * s)
        low, high = where(miss < 0.0, t, low), where(miss < 0.0, high, t)
        acceleration = fma(f, slope, -v * fma(2.0 * beta, slope, kappa * s))  # f less damping and spring would cancel
        guess = t - 2.0 * miss * speed / (2.0 * speed * speed - miss * acceleration)
        inside = (guess >= low) & (guess <= high)
        fallback = where(high < math.inf, 0.5 * (low + high), 2.0 * t)
        guess = where(inside, guess, fallback)
        settled = (magnitude(guess - t) <= 1e-11 * t) | (magnitude(miss) <= 4e-16 * way)
        t = where(active, guess, t)
        active = active & not_(settled)
    return where(meets, t, math.inf)
