"""Limit cycles of the foliot in closed form, and of one transcendental equation. Units and records as in `_units`.

One loss alone, T half the period:
Dry friction rho: A = 1/rho, T = 2 sqrt(2/(rho (1 - rho^2))), v^2 = 2 (1 - rho^2)/rho, s = rho^2/(1 - rho^2).        (1)
Drag gamma v^2, lambda = v/V: lambda^4 = 1 - exp(-4 gamma), T = (artanh lambda + arctan lambda)/sqrt(gamma), s = 1/2 (2)
Restitution e: A = (1 + e^2)/(1 - e^2), or 1 for e < 0, T = 2 sqrt((1 + e)/(1 - e)), s = 1/2.                        (3)

Viscous and Coulomb friction, with u = a v/mu just before the switch, rho = R/mu, k = a^2 phi0/mu = d^2 and
z = -ln(1 - u/(1 - rho)), x = u/(1 + rho):
    2 k = (1 - rho)(z - 1 + e^-z) - (1 + rho)(x - ln(1 + x))                                         (4)
    a P/2 = tau = z + ln(1 + x),  A = 1 + (1 + rho)(x - ln(1 + x))/k                                 (5)
    multiplier = e^-tau (1 - rho)/(1 + rho)                                                          (6)
(4) cancels at strong drive. With M3 = z - y - y^2/2, y = 1 - e^-z, and L3 = ln(1 + x) - x + x^2/2 it is a sum,
    2 k = rho u^2/(1 - rho^2) + (1 - rho) M3 + (1 + rho) L3,                                         (7)
and so is the sensitivity, from the derivatives of (4) and (5) by mu at fixed a, R, phi0:
    s = (2 rho^3 u^2/(1 - rho^2)^2 + M3 + L3)/((rho + u) u tau).                                     (8)
Derived here from the general law of friction.
"""

import math

from kernels.foliot._units import Cycle, errors
from kernels.lanes.codes import NO_METHOD, NOT_CONVERGED, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, sqrt, where
from kernels.maths.elementary import arctan, cbrt, exp, expm1, log1p, log_remainder, log_remainder3
from kernels.maths.roots import by_steps

HALLEY_LIMIT = 40
PURE_ROUNDING, ROUNDING = 2e-15, 4e-15
"""What the closed forms and the equation's period, amplitude, speed and sensitivity are right to."""
_EXPONENT_ROUNDING = 6.7e-16
"""Of the multiplier exp(-tau), for each 1 + tau: 3 units of the last place; found up to 2.1."""
_DEEPEST = 710.0
"""tau beyond which exp(-tau) is 0, no normal number being so small."""
_FAINT, _FAINT_COULOMB = 1e-100, 1e-55
"""Viscous friction d below which it changes no digit, provided Coulomb friction is not faint too."""


@jit
def _acting(scene):
    """Whether dry friction, quadratic drag or restitution acts alone: one of three, or none."""
    smooth, elastic = not_(scene.d > 0.0) & not_(scene.kappa > 0.0), scene.e >= 1.0
    solid, drag = scene.rho > 0.0, scene.gamma > 0.0
    square = drag & (scene.n >= 2.0) & (scene.n <= 2.0)
    return (
        smooth & elastic & solid & not_(drag),
        smooth & elastic & not_(solid) & square,
        smooth & not_(elastic) & not_(solid) & not_(drag),
    )


@jit
def pure(scene, rtol):
    """The cycle where one loss acts alone; else NO_METHOD."""
    rho, slack, gamma, e = scene.rho, scene.slack, scene.gamma, scene.e
    alone, drag, switch = _acting(scene)

    # (3) and (1)
    e = where(switch, e, 0.0)
    lost = (1.0 - e) * (1.0 + e)
    amplitude = where(e > 0.0, fma(e, e, 1.0) / lost, 1.0)
    elastic = Cycle(2.0 * sqrt((1.0 + e) / (1.0 - e)), amplitude, 2.0 / sqrt(lost), 0.5, e * e)
    cycle = choose(alone, _dry(where(alone, rho, 0.5), where(alone, slack, 0.5)), elastic)

    # (2); artanh lambda = 2 gamma + ln(1 + lambda) + ln(1 + lambda^2)/2 has all digits up to lambda = 1
    if any_lane(drag):
        gamma = where(drag, gamma, 1.0)
        square = sqrt(-expm1(-4.0 * gamma))
        lam, root, swell = sqrt(square), sqrt(gamma), log1p(square)
        half = (2.0 * gamma + log1p(lam) + 0.5 * swell + arctan(lam)) / root
        kept = exp(-2.0 * gamma) / (1.0 + square)
        cycle = choose(drag, Cycle(half, 1.0 + swell / (2.0 * gamma), lam / root, 0.5, kept * kept), cycle)
    return cycle, where(alone | drag | switch, OK, NO_METHOD)


@jit
def _dry(rho, slack):
    """The cycle (1)."""
    left = slack * (1.0 + rho)  # 1 - rho^2
    half = 2.0 * sqrt(2.0 / (rho * left))
    return Cycle(half, 1.0 / rho, sqrt(2.0 * left / rho), rho * rho / left, slack / (1.0 + rho))


@jit
def pure_bound(scene):
    """Relative errors of `pure`: rounding, and infinite where no loss acts alone."""
    alone, drag, switch = _acting(scene)
    rounding = where(alone | drag | switch, PURE_ROUNDING, math.inf)
    return errors(rounding, rounding, 2.0 * rounding)


@jit
def _parts(z, rho, slack):
    """u, x, M3 and L3 of (7)."""
    y = -expm1(-z)
    u = slack * y
    x = u / (1.0 + rho)
    small = y < 0.5
    m3 = where(small, -log_remainder3(where(small, -y, 0.0)), z - fma(0.5 * y, y, y))
    return u, x, m3, log_remainder3(x)


@jit
def _halley(z, scene):
    """Halley's step on (7), and whether it is the last: its error is the cube."""
    rho, slack, double_k = scene
    u, _, m3, l3 = _parts(z, rho, slack)
    miss = rho * u * u / (slack * (1.0 + rho)) + slack * m3 + (1.0 + rho) * l3 - double_k
    below = 1.0 / (1.0 + rho + u)
    slope = 2.0 * (rho + u) * u * below
    bend = (2.0 * (rho + 2.0 * u) - slope) * below * (slack - u)
    step = 2.0 * miss * slope / (2.0 * slope * slope - miss * bend)
    step = where(step < 0.9 * z, step, 0.9 * z)
    return step, not_(magnitude(step) > 1e-8 * (z - step))


@jit_call
def coulomb(scene, rtol):
    """The cycle by Halley's steps on (7), and its verdict; without viscous friction that of dry friction alone.

    They start within a factor of 2: (7) is A z^2 + B z^3 for small z, slack (z - 3/2) + ... for large z.
    """
    rho, slack, dry = scene.rho, scene.slack, scene.d < _FAINT
    d = where(dry, 1.0, scene.d)
    double_k = 2.0 * d * d
    square, share = slack * rho / (1.0 + rho), slack / (1.0 + rho)
    cube = slack * fma(share, share, 1.0) * (1.0 / 3.0)
    by_cube = cbrt(double_k / cube)
    by_square = sqrt(double_k / where(square > 1e-200, square, 1e-200))
    strong = where(by_square < by_cube, by_square, by_cube)
    z = where(strong < 1.5, strong, double_k / slack + 1.0)
    z, active = by_steps(_halley, z, z > 0.0, (rho, slack, double_k), HALLEY_LIMIT)

    u, x, m3, l3 = _parts(z, rho, slack)
    tau = z + log1p(x)
    top = 1.0 + 2.0 * (1.0 + rho) * log_remainder(x) / double_k
    share = rho / (slack * (1.0 + rho))
    s = (2.0 * rho * (share * u) * (share * u) + m3 + l3) / ((rho + u) * u * tau)
    cycle = Cycle(tau / d, top, u / d, s, exp(-tau) * slack / (1.0 + rho))
    alone = _dry(where(rho > _FAINT_COULOMB, rho, 0.5), slack)
    verdict = where(active, NOT_CONVERGED, OK)
    verdict = where(dry, where(rho > _FAINT_COULOMB, OK, OUT_OF_RANGE), verdict)
    return choose(dry, alone, cycle), verdict


@jit
def coulomb_bound(scene):
    """Rounding; the multiplier exp(-tau) repeats that of tau, here from an upper limit of tau.

    In (4) (1 + rho)(x - ln(1 + x)) <= (1 - rho)/2 as x <= (1 - rho)/(1 + rho), so z <= 2 k/(1 - rho) + 3/2; and
    ln(1 + x) <= ln 2.
    """
    tau = 2.0 * scene.d * scene.d / scene.slack + 2.2
    return errors(ROUNDING, ROUNDING, _EXPONENT_ROUNDING * (1.0 + where(tau < _DEEPEST, tau, _DEEPEST)))
