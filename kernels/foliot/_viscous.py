"""The viscous foliot's limit cycle without dimensions.

    phi'' + a phi' = +-mu,  k = 1/alpha = a^2 phi0/mu                                             (1)
    q - tanh q = k,  a P = 4 q,  lambda = a v0/mu = tanh q,  A = phi_max/phi0 = ln(cosh q)/k      (2)
    s = -dlnP/dlnmu = k/(q lambda^2),  multiplier of the half-cycle map m = exp(-2 q)             (3)

Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681, appendix A; q = a P/4 turns its two conditions into (2), and (3)
follows by differentiating (2). Everything depends on k alone; `given` puts the units back.
"""

import math
from collections import namedtuple

from kernels.foliot._units import Outputs, errors
from kernels.foliot._viscous_fit import AMPLITUDE_STRONG, GAP_WEAK, OVERSHOOT_WEAK, Q_STRONG, SENSITIVITY_STRONG, SPLIT
from kernels.lanes.codes import NOT_CONVERGED, OK
from kernels.lanes.jit import jit
from kernels.lanes.ranges import judged, or_none
from kernels.lanes.vectors import any_lane, choose, fma, horner, magnitude, not_, sqrt, where
from kernels.maths.elementary import cbrt, exp, exp_remainder, is_normal, log_remainder, mantissa_exponent, scale

ROUNDING = 1e-15
"""What `closed` is right to: about 4 ulp; its multiplier to twice that."""
MAP_LIMIT = 10_000
"""Half swings after which `event_map` gives up: at rtol 1e-9 enough up to alpha of about 1e9."""

_TAME_LOW, _TAME_HIGH = 2.0**-240, 2.0**240  # a^2 phi0/mu and its rounding error stay normal inside
_OVERSHOOT = 1.0 - math.log(2.0)
_EXP_MINUS_2 = 0.1353352832366127
_FIT = Q_STRONG, AMPLITUDE_STRONG, SENSITIVITY_STRONG
_SERIES = (2 / 15, 3 / 175, 2 / 1575), (1 / 10, 4 / 525, -1 / 31500), (4 / 45, 52 / 4725, -32 / 70875)

ViscousCycle = namedtuple("ViscousCycle", "q lam amplitude sensitivity multiplier")
"""The limit cycle as in (2) and (3)."""

Scaled = namedtuple("Scaled", "m_mu m_phi m_a e_mu e_phi e_a wild representable")
"""mu = m_mu 2^e_mu and so on, whether powers of two were taken out of any, and whether k is a normal number."""


@jit
def without_dimensions(p):
    """k as an unevaluated sum (k, rest), and units with powers of two taken out where a product could overflow.

    Scaling by powers of two is exact, so the bits do not depend on whether a neighbouring cell needed it.
    """
    mu, phi0, a = p.mu, p.phi0, p.a
    low = (mu < _TAME_LOW) | (phi0 < _TAME_LOW) | (a < _TAME_LOW)
    wild = low | (mu > _TAME_HIGH) | (phi0 > _TAME_HIGH) | (a > _TAME_HIGH)
    e_mu, e_phi, e_a = 0.0, 0.0, 0.0
    if any_lane(wild):
        (mu, e_mu), (phi0, e_phi), (a, e_a) = mantissa_exponent(mu), mantissa_exponent(phi0), mantissa_exponent(a)
    square = a * a
    top = square * phi0
    top_rest = fma(square, phi0, -top) + fma(a, a, -square) * phi0
    k = top / mu
    rest = (fma(-k, mu, top) + top_rest) / mu
    if any_lane(wild):
        n = 2.0 * e_a + e_phi - e_mu
        k, rest = scale(k, n), scale(rest, n)
    return (k, rest), Scaled(mu, phi0, a, e_mu, e_phi, e_a, wild, is_normal(k))


@jit
def given(units, cycle, verdict):
    """What a method gives of a cycle: its outputs, each NaN where it is no normal number, and its status."""
    q, a = cycle.q, units.m_a
    period, swing, speed = q / (0.25 * a), cycle.amplitude * units.m_phi, cycle.lam * units.m_mu / a
    if any_lane(units.wild):
        period = scale(0.0625 * q / a, 6.0 - units.e_a)  # 4 q may be too large where 4 q/a is not
        swing, speed = scale(swing, units.e_phi), scale(speed, units.e_mu - units.e_a)
    timed, wide, fast = is_normal(period), is_normal(swing), is_normal(speed)
    sizes = or_none(period, timed), or_none(swing, wide), or_none(speed, fast)
    outputs = Outputs(sizes[0], sizes[1], sizes[2], cycle.sensitivity, cycle.multiplier)
    return outputs, judged(units.representable, timed & wide & fast, verdict)


UNITS = without_dimensions, given
"""Of a method that solves (k, rest)."""


@jit
def closed(scene, rtol):
    """The cycle from fitted polynomials: in cbrt(3k)^2 at strong drive, in exp(-2(k + 1)) at weak drive.

    1e-15 at every drive, without iteration. A group of cells that lies on one side pays for that side only; `rest`
    corrects exp(-2k), for an error of k counts 2k-fold in the multiplier.
    """
    k, rest = scene
    strong = k < SPLIT
    none = 0.0 * k
    q, lam, amplitude, sensitivity = none, none, none, none
    if any_lane(strong):
        q, lam, amplitude, sensitivity = _strong(k, _FIT)
    decay = exp(-2.0 * where(strong, q, k))
    cycle = ViscousCycle(q, lam, amplitude, sensitivity, decay)
    if any_lane(not_(strong)):
        x = decay * (_EXP_MINUS_2 * (1.0 - 2.0 * rest)) + 0.0  # no -0 where nothing is left
        gap = x * horner(x, GAP_WEAK)  # 1 - lambda = 2/(exp(2q) + 1)
        lam = 1.0 - gap
        q = k + (lam + rest)
        amplitude = 1.0 + fma(x, horner(x, OVERSHOOT_WEAK), _OVERSHOOT) / k
        weak = ViscousCycle(q, lam, amplitude, k / (q * (lam * lam)), gap / (2.0 - gap))
        return choose(strong, cycle, weak), OK
    return cycle, OK


@jit
def _strong(k, coefficients):
    """q, lambda, A and s, by polynomials in cbrt(3k)^2."""
    of_q, of_amplitude, of_sensitivity = coefficients
    y = cbrt(3.0 * k)
    w = y * y
    tail = horner(w, of_q)
    lam = fma(y * w, tail - 1.0 / 3.0, y)  # q - k
    amplitude = fma(w, horner(w, of_amplitude), 1.0) * (1.5 / y)
    return fma(y * w, tail, y), lam, amplitude, fma(w, horner(w, of_sensitivity), 1.0 / 3.0)


@jit
def gap_and_overshoot(k):
    """1 - lambda = 2/(exp(2q) + 1) and A - 1 = (1 - ln 2)/k + ..., which weak drive would lose in lambda and A."""
    strong = k < SPLIT
    x = exp(-2.0 * k) * _EXP_MINUS_2
    _, lam, amplitude, _ = _strong(where(strong, k, 0.5), _FIT)
    weak = fma(x, horner(x, OVERSHOOT_WEAK), _OVERSHOOT) / k
    return where(strong, 1.0 - lam, x * horner(x, GAP_WEAK)), where(strong, amplitude - 1.0, weak)


@jit
def asymptotic(scene, rtol):
    """Weak and strong series: the period within 0.5 %, the sensitivity within 2.2 % at every drive.

    With b = cbrt(3k) small: q = b (1 + 2 b^2/15 + 3 b^4/175 + 2 b^6/1575), A = 1.5/b (1 + b^2/10 + 4 b^4/525 -
    b^6/31500), s = 1/3 + 4 b^2/45 + 52 b^4/4725 - 32 b^6/70875. With x = exp(-2(k + 1)) small: lambda = 1 - 2x,
    A = 1 + alpha (1 - ln 2 - x).
    """
    k, _ = scene
    strong, none = k < SPLIT, 0.0 * k
    cycle = ViscousCycle(none, none, none, none, none)
    if any_lane(strong):
        q, lam, amplitude, sensitivity = _strong(k, _SERIES)
        cycle = ViscousCycle(q, lam, amplitude, sensitivity, (1.0 - lam) / (1.0 + lam))
    if any_lane(not_(strong)):
        x = exp(-2.0 * k) * _EXP_MINUS_2
        lam = 1.0 - 2.0 * x
        q = k + lam
        weak = ViscousCycle(q, lam, 1.0 + (_OVERSHOOT - x) / k, k / (q * (lam * lam)), x)
        return choose(strong, cycle, weak), OK
    return cycle, OK


@jit
def asymptotic_bound(scene):
    """Bound on the error of `asymptotic`: the first terms left out.

    Strong: they are below 2.2e-4 b^8, in s 2e-3 b^8, and up to the split b^8 = (3k)^(8/3) is at most 1.15 (3k)^2
    sqrt(3k). Weak: (1 - lambda)/x - 2 = 6x + ... <= 7.3x gives 8 x^2, and 20 x^2 in s, which has lambda^2;
    m = x (1 + 4x + ...), where the rounding of k counts 2k-fold. No exp is needed: exp(-y) is at most
    1/(1 + y + y^2/2), y = k/16, to the 32nd power.
    """
    k, _ = scene
    strong = k < SPLIT
    y = k * 0.0625
    x = 1.0 / fma(fma(0.5, y, 1.0), y, 1.0)
    for _ in range(5):
        x = x * x
    x = _EXP_MINUS_2 * x
    b3 = 3.0 * k
    b8 = 1.15 * (b3 * b3) * sqrt(b3)
    cycle = where(strong, 2.2e-4 * b8, 8.0 * (x * x)) + ROUNDING
    sensitivity = where(strong, 2e-3 * b8, 20.0 * (x * x)) + ROUNDING
    rounding = where(k < 400.0, 1e-15 * k, 0.0)  # below exp(-800) the multiplier is 0 for good
    return errors(cycle, sensitivity, where(strong, 4e-3 * b8, 5.0 * x + rounding) + 2.0 * ROUNDING)


@jit
def _next_speed(y):
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
def event_map(scene, rtol):
    """The cycle from the exact map of the switching speed, iterated from rest; slow at strong drive.

    Half swing: -ln(1 - u') - u' = 2k + u - ln(1 + u). The speed rises monotonically to lambda and no later step
    shrinks the distance by a factor above r = (1 - u')/(1 + u), so the distance left is at most (u' - u) r/(1 - r).
    A cell has settled when that is below rtol/4 of u', and, for the multiplier, below rtol/4 of 1 - u'.
    """
    k, _ = scene
    u, z = _next_speed(k)
    active = u > -1.0
    for _ in range(MAP_LIMIT):
        if not any_lane(active):
            break
        new, new_z = _next_speed(fma(2.0, k, log_remainder(u)))
        room = where(new < 1.0 - new, new / (1.0 - new), 1.0)
        unsettled = not_(magnitude(new - u) <= 0.25 * rtol * (u + new) * room)
        u, z = where(active, new, u), where(active, new_z, z)
        active = active & unsettled
    q = u + k
    decay = exp(-z)  # 1 - u
    cycle = ViscousCycle(q, u, 1.0 + log_remainder(u) / k, k / (q * (u * u)), decay / (2.0 - decay))
    return cycle, where(active, NOT_CONVERGED, OK)


@jit
def event_map_bound(scene):
    """Four times what rounding leaves of the iterated map, which forgets only a share 2b of an error, b = cbrt(3k).

    That it settles to rtol, its status says.
    """
    k, _ = scene
    cycle = 8e-15 + 2e-15 / where(k < SPLIT, cbrt(3.0 * where(k < SPLIT, k, 1.0)), 1.0)
    return errors(cycle, cycle, cycle + where(k < 400.0, 4e-15 * k, 0.0))
