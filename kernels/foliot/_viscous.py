"""The viscous foliot's limit cycle without dimensions.

    phi'' + a phi' = +-mu,  k = 1/alpha = a^2 phi0/mu                                             (1)
    q - tanh q = k,  a P = 4 q,  lambda = a v0/mu = tanh q,  A = phi_max/phi0 = ln(cosh q)/k      (2)
    s = -dlnP/dlnmu = k/(q lambda^2),  multiplier of the half-cycle map m = exp(-2 q)             (3)

Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681, appendix A; q = a P/4 turns its two conditions into (2), and (3)
follows by differentiating (2). Everything depends on k alone; `dimensional` puts the units back.
"""

import math
from typing import NamedTuple

from kernels.foliot._units import Outputs, errors
from kernels.foliot._viscous_fit import AMPLITUDE_STRONG, GAP_WEAK, OVERSHOOT_WEAK, Q_STRONG, SENSITIVITY_STRONG, SPLIT
from kernels.lanes.jit import jit
from kernels.lanes.ranges import judged, or_none
from kernels.lanes.vectors import any_lane, choose, fma, horner, magnitude, not_, sqrt, where
from kernels.maths.elementary import cbrt, exp, exp_remainder, is_normal, log_remainder, mantissa_exponent, scale

ROUNDING = 1e-15
"""What a closed form is right to: about 4 ulp."""

_TAME_LOW, _TAME_HIGH = 2.0**-240, 2.0**240  # a^2 phi0/mu and its rounding error stay normal inside
_OVERSHOOT = 1.0 - math.log(2.0)
_EXP_MINUS_2 = 0.1353352832366127
MAP_LIMIT = 10_000
"""Half swings after which `event_map` gives up: at rtol 1e-9 enough up to alpha of about 1e9."""

_Q_SERIES = (2 / 15, 3 / 175, 2 / 1575)
_AMPLITUDE_SERIES = (1 / 10, 4 / 525, -1 / 31500)
_SENSITIVITY_SERIES = (4 / 45, 52 / 4725, -32 / 70875)


class ViscousCycle(NamedTuple):
    """The limit cycle as in (2) and (3)."""

    q: float
    lam: float
    amplitude: float
    sensitivity: float
    multiplier: float


class Scaled(NamedTuple):
    """mu = m_mu 2^e_mu and so on, whether powers of two were taken out of any, and whether k is a normal number."""

    m_mu: float
    m_phi: float
    m_a: float
    e_mu: float
    e_phi: float
    e_a: float
    wild: bool
    representable: bool


@jit
def without_dimensions(p):
    """k as an unevaluated sum (k, rest), and units with powers of two taken out where a product could overflow.

    Scaling by powers of two is exact, so the bits do not depend on whether a neighbouring cell needed it.
    """
    mu, phi0, a = p.mu, p.phi0, p.a
    wild = not_(_tame(mu) & _tame(phi0) & _tame(a))
    e_mu, e_phi, e_a = 0.0, 0.0, 0.0
    if any_lane(wild):
        mu, e_mu = mantissa_exponent(mu)
        phi0, e_phi = mantissa_exponent(phi0)
        a, e_a = mantissa_exponent(a)
    square = a * a
    top = square * phi0
    top_rest = fma(square, phi0, -top) + fma(a, a, -square) * phi0
    k = top / mu
    rest = (fma(-k, mu, top) + top_rest) / mu
    if any_lane(wild):
        n = 2.0 * e_a + e_phi - e_mu
        k, rest = scale(k, n), scale(rest, n)
    return k, rest, Scaled(mu, phi0, a, e_mu, e_phi, e_a, wild, is_normal(k))


@jit
def _tame(x):
    return (x >= _TAME_LOW) & (x <= _TAME_HIGH)


@jit
def dimensional(units, cycle):
    """The outputs of a cycle, each NaN where it is no normal number.

    Also whether k is one, and whether all of the others are.
    """
    q, a = cycle.q, units.m_a
    period, swing, speed = q / (0.25 * a), cycle.amplitude * units.m_phi, cycle.lam * units.m_mu / a
    if any_lane(units.wild):
        period = scale(0.0625 * q / a, 6.0 - units.e_a)  # 4 q may be too large where 4 q/a is not
        swing, speed = scale(swing, units.e_phi), scale(speed, units.e_mu - units.e_a)
    timed, wide, fast = is_normal(period), is_normal(swing), is_normal(speed)
    period, swing, speed = or_none(period, timed), or_none(swing, wide), or_none(speed, fast)
    outputs = Outputs(period, swing, speed, cycle.sensitivity, cycle.multiplier)
    return outputs, units.representable, timed & wide & fast


@jit
def given(units, cycle, verdict):
    """What a method gives of a cycle: its outputs and its status."""
    outputs, sound, whole = dimensional(units, cycle)
    return outputs, judged(sound, whole, verdict)


@jit
def closed(k, rest):
    """The cycle from fitted polynomials: in cbrt(3k)^2 at strong drive, in exp(-2(k + 1)) at weak drive.

    A group of cells that lies on one side pays for that side only.
    """
    strong = k < SPLIT
    none = 0.0 * k
    q, lam, amplitude, sensitivity = none, none, none, none
    if any_lane(strong):
        q, lam, amplitude, sensitivity = _closed_strong(k)
    decay = exp(-2.0 * where(strong, q, k))
    cycle = ViscousCycle(q, lam, amplitude, sensitivity, decay)
    if any_lane(not_(strong)):
        return choose(strong, cycle, _closed_weak(k, rest, decay))
    return cycle


@jit
def _closed_strong(k):
    """q, lambda, A and s."""
    y = cbrt(3.0 * k)
    w = y * y
    tail = horner(w, Q_STRONG)
    q = fma(y * w, tail, y)
    lam = fma(y * w, tail - 1.0 / 3.0, y)  # q - k
    amplitude = fma(w, horner(w, AMPLITUDE_STRONG), 1.0) * (1.5 / y)
    return q, lam, amplitude, fma(w, horner(w, SENSITIVITY_STRONG), 1.0 / 3.0)


@jit
def _closed_weak(k, rest, decay):
    """`decay` is exp(-2k); `rest` corrects it, for an error of k counts 2k-fold in the multiplier."""
    x = decay * (_EXP_MINUS_2 * (1.0 - 2.0 * rest)) + 0.0  # no -0 where nothing is left
    gap = x * horner(x, GAP_WEAK)  # 1 - lambda = 2/(exp(2q) + 1)
    lam = 1.0 - gap
    q = k + (lam + rest)
    amplitude = 1.0 + fma(x, horner(x, OVERSHOOT_WEAK), _OVERSHOOT) / k
    return ViscousCycle(q, lam, amplitude, k / (q * (lam * lam)), gap / (2.0 - gap))


@jit
def gap(k):
    """1 - lambda = 2/(exp(2q) + 1), which at weak drive would be lost in lambda."""
    strong = k < SPLIT
    x = exp(-2.0 * k) * _EXP_MINUS_2
    return where(strong, 1.0 - _closed_strong(where(strong, k, 0.5))[1], x * horner(x, GAP_WEAK))


@jit
def overshoot(k):
    """A - 1, which at weak drive is (1 - ln 2)/k + ... and would be lost in A."""
    strong = k < SPLIT
    x = exp(-2.0 * k) * _EXP_MINUS_2
    weak = fma(x, horner(x, OVERSHOOT_WEAK), _OVERSHOOT) / k
    return where(strong, _closed_strong(where(strong, k, 0.5))[2] - 1.0, weak)


@jit
def asymptotic(k):
    """The cycle from two series: b = cbrt(3k) small (strong drive), x = exp(-2(k + 1)) small (weak drive).

    Strong: q = b (1 + 2 b^2/15 + 3 b^4/175 + 2 b^6/1575), A = 1.5/b (1 + b^2/10 + 4 b^4/525 - b^6/31500),
    s = 1/3 + 4 b^2/45 + 52 b^4/4725 - 32 b^6/70875. Weak: lambda = 1 - 2x, A = 1 + alpha (1 - ln 2 - x).
    """
    strong, none = k < SPLIT, 0.0 * k
    cycle = ViscousCycle(none, none, none, none, none)
    if any_lane(strong):
        cycle = _asymptotic_strong(k)
    if any_lane(not_(strong)):
        return choose(strong, cycle, _asymptotic_weak(k))
    return cycle


@jit
def _asymptotic_strong(k):
    b = cbrt(3.0 * k)
    w = b * b
    tail = horner(w, _Q_SERIES)
    lam = fma(b * w, tail - 1.0 / 3.0, b)
    amplitude = fma(w, horner(w, _AMPLITUDE_SERIES), 1.0) * (1.5 / b)
    s = fma(w, horner(w, _SENSITIVITY_SERIES), 1.0 / 3.0)
    return ViscousCycle(fma(b * w, tail, b), lam, amplitude, s, (1.0 - lam) / (1.0 + lam))


@jit
def _asymptotic_weak(k):
    x = exp(-2.0 * k) * _EXP_MINUS_2
    lam = 1.0 - 2.0 * x
    q = k + lam
    return ViscousCycle(q, lam, 1.0 + (_OVERSHOOT - x) / k, k / (q * (lam * lam)), x)


@jit
def asymptotic_bound(k):
    """Relative errors of `asymptotic`.

    Strong: the first terms left out are below 2.2e-4 b^8, in s 2e-3 b^8, and up to the split b^8 = (3k)^(8/3) is at
    most 1.15 (3k)^2 sqrt(3k). Weak: (1 - lambda)/x - 2 = 6x + ... <= 7.3x gives 8 x^2, and 20 x^2 in s, which has
    lambda^2; m = x (1 + 4x + ...), where the rounding of k counts 2k-fold. No exp is needed: exp(-y) is at most
    1/(1 + y + y^2/2), y = k/16, to the 32nd power.
    """
    strong = k < SPLIT
    y = k * 0.0625
    x = 1.0 / fma(fma(0.5, y, 1.0), y, 1.0)
    x = x * x
    x = x * x
    x = x * x
    x = x * x
    x = _EXP_MINUS_2 * (x * x)
    b3 = 3.0 * k
    b8 = 1.15 * (b3 * b3) * sqrt(b3)
    cycle = where(strong, 2.2e-4 * b8, 8.0 * (x * x)) + ROUNDING
    sensitivity = where(strong, 2e-3 * b8, 20.0 * (x * x)) + ROUNDING
    rounding = where(k < 400.0, 1e-15 * k, 0.0)  # below exp(-800) the multiplier is 0 for good
    return errors(cycle, sensitivity, where(strong, 4e-3 * b8, 5.0 * x + rounding) + 2.0 * ROUNDING)


@jit
def next_speed(y):
    """u and -ln(1 - u) of the flight that ends at speed u: -ln(1 - u) - u = y, for y > 0.

    Solved for z = -ln(1 - u) by three Halley steps from a start within 2 %; u = z - y cancels for large z,
    1 - exp(-z) for small z.
    """
    t = sqrt(2.0 * y)
    z = where(y < 0.8, t + t * t * (1.0 / 6.0 + t * (1.0 / 36.0)), y + 1.0 - exp(-1.0 - y))
    for _ in range(3):
        decay = exp(-z)
        slope = where(z < 0.01, z - 0.5 * z * z, 1.0 - decay)
        miss = exp_remainder(z) - y
        z = z - miss * slope / (slope * slope - 0.5 * miss * decay)
    return where(z < 1.0, z - y, 1.0 - exp(-z)), z


@jit
def event_map(k, rtol):
    """The cycle from the exact map of the switching speed, iterated from rest at phi = 0; and where it has not settled.

    Half swing: -ln(1 - u') - u' = 2k + u - ln(1 + u). The speed rises monotonically to lambda and no later step
    shrinks the distance by a factor above r = (1 - u')/(1 + u), so the distance left is at most (u' - u) r/(1 - r).
    A cell has settled when that is below rtol/4 of u', and, for the multiplier, below rtol/4 of 1 - u'.
    """
    u, z = next_speed(k)
    active = u > -1.0
    for _ in range(MAP_LIMIT):
        if not any_lane(active):
            break
        new, new_z = next_speed(fma(2.0, k, log_remainder(u)))
        room = where(new < 1.0 - new, new / (1.0 - new), 1.0)
        unsettled = not_(magnitude(new - u) <= 0.25 * rtol * (u + new) * room)
        u, z = where(active, new, u), where(active, new_z, z)
        active = active & unsettled
    q = u + k
    decay = exp(-z)  # 1 - u
    return ViscousCycle(q, u, 1.0 + log_remainder(u) / k, k / (q * (u * u)), decay / (2.0 - decay)), active


@jit
def event_map_bound(k):
    """Four times the rounding error of `event_map`: its map forgets only a share 2b of an error, b = cbrt(3k) small."""
    strong = k < SPLIT
    b = 0.0 * k + 1.0
    if any_lane(strong):
        b = where(strong, cbrt(3.0 * where(strong, k, 1.0)), b)
    cycle = 8e-15 + 2e-15 / b
    return errors(cycle, cycle, cycle + where(k < 400.0, 4e-15 * k, 0.0))
