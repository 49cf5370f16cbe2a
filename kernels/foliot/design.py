"""Verge and foliot, the other way round: friction and torque that give a wanted period and amplitude.

With A = amplitude/phi0 > 1 and q - tanh q = k,
    ln(cosh q)/k = A,  a = 4 q/P,  mu = a^2 phi0/k.                                                  (1)
The left side falls from infinity to 1 as k grows, so the answer is unique. Derived from Hoyng & Nieuwenhuizen,
arXiv:1604.06681, appendix A.
"""

import math

from kernels.foliot import _viscous
from kernels.interface import Field, Kernel, Method, Status
from kernels.lanes.columns import each_cell, entry
from kernels.lanes.jit import jit
from kernels.lanes.vectors import magnitude, some, where
from kernels.maths.elementary import is_normal, mantissa_exponent, scale

_OK, _BAD_INPUT = float(Status.OK), float(Status.BAD_INPUT)
_OUT_OF_RANGE, _NOT_CONVERGED = float(Status.OUT_OF_RANGE), float(Status.NOT_CONVERGED)
_NEWTON_LIMIT = 20


@jit
def _inverse_alpha(overshoot):
    """k at which A - 1 = overshoot, and where Newton has not settled.

    Newton in ln k on ln(A - 1), nearly a straight line: slope (1/lambda - A)/(A - 1), from -1 (weak) to -1/3 (strong).
    """
    k = 1.125 / (overshoot * (overshoot * overshoot + 3.0 * overshoot + 3.666))
    active = k > 0.0
    for _ in range(_NEWTON_LIMIT):
        if not some(active):
            break
        gap = _viscous.gap(k)
        now = _viscous.overshoot(k)
        step = (now - overshoot) / (now - gap / (1.0 - gap))  # A - 1/lambda without its two ones
        step = where(step > -0.5, step, -0.5)
        k = where(active, k + k * step, k)
        active = active & (magnitude(step) > 1e-9)  # quadratic: the step just made was the last
    return k, active


@jit
def _solve(i, period, amplitude, phi0, a, mu, status):
    (p, e_p), (f, e_f) = mantissa_exponent(period[i]), mantissa_exponent(phi0[i])
    k, unsettled = _inverse_alpha((amplitude[i] - phi0[i]) / phi0[i])
    q, _, _, _, _ = _viscous.closed(k, 0.0 * k)
    unit_a = 4.0 * q / p
    unit_k, e_k = mantissa_exponent(k)
    a[i] = scale(unit_a, -e_p)
    mu[i] = scale(unit_a * unit_a * f / unit_k, e_f - 2.0 * e_p - e_k)
    normal = is_normal(a[i]) & is_normal(mu[i]) & is_normal(k)
    status[i] = where(normal, where(unsettled, _NOT_CONVERGED, _OK), _OUT_OF_RANGE)


@entry()
def newton(period, amplitude, phi0, rtol, a, mu, status):
    """Newton on (1) from a start within 15 %."""
    each_cell(_solve, (period, amplitude, phi0, a, mu, status))


@entry("asked")
def newton_bound(period, amplitude, phi0, rtol, asked, out):
    """Rounding: amplitude and phi0 are taken as exact."""
    out[:] = 2.0 * _viscous.ROUNDING


@jit
def _check(i, period, amplitude, phi0, status):
    finite = (period[i] < math.inf) & (amplitude[i] < math.inf)
    allowed = (period[i] > 0.0) & (phi0[i] > 0.0) & (amplitude[i] > phi0[i])  # NaN fails
    status[i] = where(finite & allowed, _OK, _BAD_INPUT)


@entry()
def check(period, amplitude, phi0, status):
    """BAD_INPUT for what is NaN, infinite or not positive, and for an amplitude that does not exceed phi0."""
    each_cell(_check, (period, amplitude, phi0, status))


FOLIOT_DESIGN = Kernel(
    name="foliot_design",
    doc="friction and torque that give a verge and foliot a wanted period and amplitude",
    source="derived from Hoyng & Nieuwenhuizen, arXiv:1604.06681, appendix A",
    parameters=(
        Field("period", "s", "wanted period", lower=0.0, open_lower=True),
        Field("amplitude", "rad", "wanted largest angle; must exceed phi0", lower=0.0, open_lower=True),
        Field("phi0", "rad", "switching angle", lower=0.0, open_lower=True),
    ),
    outputs=(
        Field("a", "1/s", "viscous friction per moment of inertia"),
        Field("mu", "rad/s^2", "drive torque per moment of inertia"),
    ),
    check=check,
    methods=(Method("newton", "Newton's method on the closed-form cycle", newton, newton_bound),),
    example={"period": 4.0, "amplitude": 0.8, "phi0": 0.5},
)
