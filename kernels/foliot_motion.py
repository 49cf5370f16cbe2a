"""Verge and foliot: angle and speed over one period of the limit cycle.

With t from the switch at +phi0, E = 1 - exp(-a t) and lambda = a v0/mu, over the half period 0 <= a t <= 2 q
    phi/phi0 = 1 + alpha (lambda E - (a t - E)),  v = (mu/a) (lambda - (1 + lambda) E)            (1)
and the other half is its negative. Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681, section 2.
"""

from kernels import _viscous
from kernels._columns import entry, one_by_one
from kernels._jit import jit
from kernels._lanes import fma, where
from kernels._vecmath import exp, exp_remainder, scale
from kernels.foliot import PARAMETERS, check
from kernels.interface import Field, Kernel, Method, Status

_OK, _OUT_OF_RANGE = float(Status.OK), float(Status.OUT_OF_RANGE)


@jit
def _shape(phase, k, q, lam):
    """phi/phi0 and a v/mu at a phase in [0, 1]. a t - E is one function, for it is small at strong drive."""
    first = phase < 0.5
    t = 4.0 * q * where(first, phase, phase - 0.5)
    late = exp_remainder(t)  # a t - E
    rise = where(t < 1.0, t - late, 1.0 - exp(-t))
    sign = where(first, 1.0, -1.0)
    return sign * (1.0 + fma(lam, rise, -late) / k), sign * (lam - (1.0 + lam) * rise)


@jit
def _closed(i, mu, phi0, a, phase, angle, speed, status):
    k, rest, scene = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    cycle = _viscous.closed(k, rest)
    _, _, _, normal = _viscous.dimensional(scene, cycle)
    unit_mu, unit_phi, unit_a, e_mu, e_phi, e_a, _, _ = scene
    for j in range(phase.size):
        x, u = _shape(phase[j], k, cycle[0], cycle[1])
        angle[i, j] = scale(unit_phi * x, e_phi)
        speed[i, j] = scale(unit_mu / unit_a * u, e_mu - e_a)
    status[i] = where(normal, _OK, _OUT_OF_RANGE)


@entry("phase")
def closed(mu, phi0, a, rtol, phase, angle, speed, status):
    """Equation (1) on the cycle from fitted polynomials: 4e-15 of amplitude and crossing speed at every drive."""
    one_by_one(_closed, (mu, phi0, a, phase, angle, speed, status))


@entry("phase", "asked")
def closed_bound(mu, phi0, a, rtol, phase, asked, out):
    """Rounding, relative to the amplitude and to the crossing speed."""
    out[:] = 4.0 * _viscous.ROUNDING


FOLIOT_MOTION = Kernel(
    name="foliot_motion",
    doc="angle and speed of a verge and foliot over one period",
    source="Hoyng & Nieuwenhuizen, arXiv:1604.06681",
    parameters=PARAMETERS,
    outputs=(
        Field("angle", "rad", "angle of the foliot", dims=("phase",)),
        Field("speed", "rad/s", "angular speed of the foliot", dims=("phase",)),
    ),
    along=(Field("phase", "1", "time over period, from the switch at +phi0 on", lower=0.0, upper=1.0),),
    check=check,
    methods=(Method("closed", "exponentials on the closed-form cycle", closed, closed_bound),),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0},
)
