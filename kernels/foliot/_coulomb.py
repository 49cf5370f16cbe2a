"""Limit cycle of the foliot with viscous and Coulomb friction: one transcendental equation.

With u = a v/mu just before the switch, rho = R/mu, k = a^2 phi0/mu = d^2 and z = -ln(1 - u/(1 - rho)), x = u/(1 + rho),
    2 k = (1 - rho)(z - 1 + e^-z) - (1 + rho)(x - ln(1 + x))                                         (1)
    a P/2 = tau = z + ln(1 + x),  A = 1 + (1 + rho)(x - ln(1 + x))/k                                 (2)
    multiplier = e^-tau (1 - rho)/(1 + rho)                                                          (3)
(1) cancels at strong drive. With M3 = z - y - y^2/2, y = 1 - e^-z, and L3 = ln(1 + x) - x + x^2/2 it is a sum,
    2 k = rho u^2/(1 - rho^2) + (1 - rho) M3 + (1 + rho) L3,                                         (4)
and so is the sensitivity, from the derivatives of (1) and (2) by mu at fixed a, R, phi0:
    s = (2 rho^3 u^2/(1 - rho^2)^2 + M3 + L3)/((rho + u) u tau).                                     (5)
Derived here from the general law of friction; units and records as in `_units`.
"""

from kernels.foliot._single_loss import dry as dry_cycle
from kernels.foliot._units import Cycle, errors
from kernels.lanes.codes import NOT_CONVERGED, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, sqrt, where
from kernels.maths.elementary import cbrt, exp, expm1, log1p, log_remainder, log_remainder3

HALLEY_LIMIT = 40
ROUNDING = 4e-15
"""What period, amplitude, speed and sensitivity are right to."""
_EXPONENT_ROUNDING = 6.7e-16
"""Of the multiplier exp(-tau), for each 1 + tau: 3 units of the last place; found up to 2.1."""
_DEEPEST = 710.0
"""tau beyond which exp(-tau) is 0, no normal number being so small."""
_FAINT, _FAINT_COULOMB = 1e-100, 1e-55
"""Viscous friction d below which it changes no digit, provided Coulomb friction is not faint too."""


@jit
def _parts(z, rho, slack):
    """u, x, M3 and L3 of (4)."""
    y = -expm1(-z)
    u = slack * y
    x = u / (1.0 + rho)
    small = y < 0.5
    m3 = where(small, -log_remainder3(where(small, -y, 0.0)), z - fma(0.5 * y, y, y))
    return u, x, m3, log_remainder3(x)


@jit
def _viscous_and_coulomb(d, rho, slack):
    """The cycle by Halley's steps on (4), and where they have not settled.

    They start within a factor of 2: (4) is A z^2 + B z^3 for small z, slack (z - 3/2) + ... for large z.
    """
    double_k = 2.0 * d * d
    square, share = slack * rho / (1.0 + rho), slack / (1.0 + rho)
    cube = slack * fma(share, share, 1.0) * (1.0 / 3.0)
    by_cube = cbrt(double_k / cube)
    by_square = sqrt(double_k / where(square > 1e-200, square, 1e-200))
    strong = where(by_square < by_cube, by_square, by_cube)
    z = where(strong < 1.5, strong, double_k / slack + 1.0)
    active = z > 0.0
    for _ in range(HALLEY_LIMIT):
        if not any_lane(active):
            break
        u, _, m3, l3 = _parts(z, rho, slack)
        miss = rho * u * u / (slack * (1.0 + rho)) + slack * m3 + (1.0 + rho) * l3 - double_k
        below = 1.0 / (1.0 + rho + u)
        slope = 2.0 * (rho + u) * u * below
        bend = (2.0 * (rho + 2.0 * u) - slope) * below * (slack - u)
        step = 2.0 * miss * slope / (2.0 * slope * slope - miss * bend)
        step = where(step < 0.9 * z, step, 0.9 * z)
        z = where(active, z - step, z)
        active = active & (magnitude(step) > 1e-8 * z)  # cubic: the step just made was the last

    u, x, m3, l3 = _parts(z, rho, slack)
    tau = z + log1p(x)
    top = 1.0 + 2.0 * (1.0 + rho) * log_remainder(x) / double_k
    share = rho / (slack * (1.0 + rho))
    s = (2.0 * rho * (share * u) * (share * u) + m3 + l3) / ((rho + u) * u * tau)
    return Cycle(tau / d, top, u / d, s, exp(-tau) * slack / (1.0 + rho)), active


@jit_call
def coulomb(scene, rtol):
    """The cycle, and its verdict; without viscous friction that of dry friction alone."""
    d, rho, slack = scene.d, scene.rho, scene.slack
    dry = d < _FAINT
    cycle, unsettled = _viscous_and_coulomb(where(dry, 1.0, d), rho, slack)
    alone = dry_cycle(where(rho > _FAINT_COULOMB, rho, 0.5), slack)
    verdict = where(unsettled, NOT_CONVERGED, OK)
    verdict = where(dry, where(rho > _FAINT_COULOMB, OK, OUT_OF_RANGE), verdict)
    return choose(dry, alone, cycle), verdict


@jit
def bound(scene):
    """Rounding; the multiplier exp(-tau) repeats that of tau, here from an upper limit of tau.

    In (1) (1 + rho)(x - ln(1 + x)) <= (1 - rho)/2 as x <= (1 - rho)/(1 + rho), so z <= 2 k/(1 - rho) + 3/2; and
    ln(1 + x) <= ln 2.
    """
    tau = 2.0 * scene.d * scene.d / scene.slack + 2.2
    return errors(ROUNDING, ROUNDING, _EXPONENT_ROUNDING * (1.0 + where(tau < _DEEPEST, tau, _DEEPEST)))
