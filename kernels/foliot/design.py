"""Verge and foliot, the inverse problem: friction and torque for a wanted period and amplitude.

With A = amplitude/phi0 > 1 and q - tanh q = k,
    ln(cosh q)/k = A,  a = 4 q/P,  mu = a^2 phi0/k.                                                  (1)
The left side decreases from infinity to 1 as k grows, so the solution is unique. Derived from Hoyng & Nieuwenhuizen,
arXiv:1604.06681, appendix A.
"""

from kernels.foliot import _viscous
from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, NOT_CONVERGED, OK
from kernels.lanes.jit import jit
from kernels.lanes.ranges import judged
from kernels.lanes.vectors import magnitude, where
from kernels.lanes.wiring import kernel, method
from kernels.maths.elementary import is_normal
from kernels.maths.roots import by_steps
from kernels.maths.wide import over, size, times, wide

_NEWTON_LIMIT = 20


@jit
def _step(k, overshoot):
    """Newton's step of k from that of ln k, and whether it is the last: its error is the square."""
    gap, now = _viscous.gap_and_overshoot(k)
    step = (overshoot - now) / (now - gap / (1.0 - gap))  # A - 1/lambda without its two ones
    step = where(step < 0.5, step, 0.5)
    return k * step, magnitude(step) <= 1e-9


@jit
def newton(p, rtol):
    """Newton on (1) in ln k and ln(A - 1), from a start within 15 %.

    That is nearly a straight line: slope (1/lambda - A)/(A - 1), from -1 (weak drive) to -1/3 (strong).
    """
    overshoot = (p.amplitude - p.phi0) / p.phi0
    k = 1.125 / (overshoot * (overshoot * overshoot + 3.0 * overshoot + 3.666))
    k, active = by_steps(_step, k, k > 0.0, overshoot, _NEWTON_LIMIT)
    period, phi0, group = wide((p.period, p.phi0, k))
    cycle, _ = _viscous.closed((k, 0.0 * k), rtol)
    friction = over((4.0 * cycle.q, 0.0), period)
    a, mu = size(1.0, friction), size(1.0, over(times(times(friction, friction), phi0), group))
    rubs, drives = a > 0.0, mu > 0.0
    return (a, mu), judged(is_normal(k) & (rubs | drives), rubs & drives, where(active, NOT_CONVERGED, OK))


@jit
def check(p):
    """BAD_INPUT for an amplitude that does not exceed phi0."""
    return where(p.amplitude > p.phi0, OK, BAD_INPUT)


FOLIOT_DESIGN = kernel(
    "foliot_design",
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
    # amplitude and phi0 are taken as exact
    methods=(method("newton", "Newton's method on the closed-form cycle", newton, 2.0 * _viscous.ROUNDING),),
    example={"period": 4.0, "amplitude": 0.8, "phi0": 0.5},
)
