"""The viscous foliot's limit cycle without dimensions.

    phi'' + a phi' = +-mu,  k = 1/alpha = a^2 phi0/mu                                             (1)
    q - tanh q = k,  a P = 4 q,  lambda = a v0/mu = tanh q,  A = phi_max/phi0 = ln(cosh q)/k      (2)
    s = -dlnP/dlnmu = k/(q lambda^2),  multiplier of the half-cycle map m = exp(-2 q)             (3)

Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681, appendix A; q = a P/4 turns its two conditions into (2), and (3)
follows by differentiating (2). Everything depends on k alone; `dimensional` puts the units back.
A *cycle* below is the tuple (q, lambda, A, s, m).
"""

import math

from kernels._jit import jit
from kernels._lanes import fma, isnt, some, where
from kernels._vecmath import cbrt, exp, horner, mantissa_exponent, scale
from kernels._viscous_fit import AMPLITUDE_STRONG, GAP_WEAK, OVERSHOOT_WEAK, Q_STRONG, SENSITIVITY_STRONG, SPLIT

ROUNDING = 1e-15
"""What a closed form is right to: about 4 ulp."""

_TAME_LOW, _TAME_HIGH = 2.0**-240, 2.0**240  # a^2 phi0/mu and its rounding error stay normal inside
_NORMAL_LOW, _NORMAL_HIGH = 2.3e-308, 1.79e308
_OVERSHOOT = 1.0 - math.log(2.0)
_EXP_MINUS_2 = math.exp(-2.0)


@jit
def without_dimensions(mu, phi0, a):
    """k as an unevaluated sum (k, rest), and the scene with powers of two taken out where a product could overflow.

    Scaling by powers of two is exact, so the bits do not depend on whether a neighbouring cell needed it.
    """
    wild = isnt(_tame(mu) & _tame(phi0) & _tame(a))
    e_mu, e_phi, e_a = 0.0, 0.0, 0.0
    if some(wild):
        mu, e_mu = mantissa_exponent(mu)
        phi0, e_phi = mantissa_exponent(phi0)
        a, e_a = mantissa_exponent(a)
    square = a * a
    top = square * phi0
    top_rest = fma(square, phi0, -top) + fma(a, a, -square) * phi0
    k = top / mu
    rest = (fma(-k, mu, top) + top_rest) / mu
    if some(wild):
        n = 2.0 * e_a + e_phi - e_mu
        k, rest = scale(k, n), scale(rest, n)
    return k, rest, (mu, phi0, a, e_mu, e_phi, e_a, wild)


@jit
def _tame(x):
    return (x >= _TAME_LOW) & (x <= _TAME_HIGH)


@jit
def dimensional(scene, cycle):
    """Period [s], amplitude [rad], crossing speed [rad/s], and whether all three are normal numbers."""
    mu, phi0, a, e_mu, e_phi, e_a, wild = scene
    q, lam, amplitude, _, _ = cycle
    period, swing, speed = 4.0 * q / a, amplitude * phi0, lam * mu / a
    if some(wild):
        period, swing, speed = scale(period, -e_a), scale(swing, e_phi), scale(speed, e_mu - e_a)
    return period, swing, speed, _normal(period) & _normal(swing) & _normal(speed)


@jit
def _normal(x):
    return (x >= _NORMAL_LOW) & (x <= _NORMAL_HIGH)


@jit
def closed(k, rest):
    """The cycle from fitted polynomials: in cbrt(3k)^2 at strong drive, in exp(-2(k + 1)) at weak drive.

    A group of cells that lies on one side pays for that side only.
    """
    strong = k < SPLIT
    q, lam, amplitude, s = 0.0 * k, 0.0 * k, 0.0 * k, 0.0 * k
    if some(strong):
        q, lam, amplitude, s = _closed_strong(k)
    decay = exp(-2.0 * where(strong, q, k))
    if some(isnt(strong)):
        weak = _closed_weak(k, rest, decay)
        q, lam = where(strong, q, weak[0]), where(strong, lam, weak[1])
        amplitude, s, decay = where(strong, amplitude, weak[2]), where(strong, s, weak[3]), where(strong, decay, weak[4])
    return q, lam, amplitude, s, decay


@jit
def _closed_strong(k):
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
    x = decay * (_EXP_MINUS_2 * (1.0 - 2.0 * rest))
    gap = x * horner(x, GAP_WEAK)  # 1 - lambda = 2/(exp(2q) + 1)
    lam = 1.0 - gap
    q = k + (lam + rest)
    amplitude = 1.0 + fma(x, horner(x, OVERSHOOT_WEAK), _OVERSHOOT) / k
    return q, lam, amplitude, k / (q * (lam * lam)), gap / (2.0 - gap)
