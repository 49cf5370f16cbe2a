"""Verge and foliot: angle and speed over one period of the limit cycle.

With t from the switch at +phi0, E = 1 - exp(-a t) and lambda = a v0/mu, over the half period 0 <= a t <= 2 q
    phi/phi0 = 1 + alpha (lambda E - (a t - E)),  v = (mu/a) (lambda - (1 + lambda) E)            (1)
and the other half is its negative. Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681, section 2. With Coulomb friction,
hairspring or restitution the two pieces of the half swing follow `linear_flow`; power-law drag is left out.
"""

from kernels.foliot import _linear_swing, _units, _viscous
from kernels.foliot.cycle import PARAMETERS as ALL_TERMS
from kernels.foliot.cycle import refusal
from kernels.integrate import linear_flow
from kernels.interface import Field, Kernel, Method
from kernels.lanes.codes import OK
from kernels.lanes.columns import entry, one_by_one
from kernels.lanes.jit import jit
from kernels.lanes.ranges import judged, or_none
from kernels.lanes.vectors import fma, where
from kernels.maths.elementary import exp, exp_remainder, scale

PARAMETERS = tuple(p for p in ALL_TERMS if p.name not in ("c", "n"))


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
    _, top, fast, sound, _ = _viscous.dimensional(scene, cycle)
    wide, moves = top > 0.0, fast > 0.0
    unit_mu, unit_phi, unit_a, e_mu, e_phi, e_a, _, _ = scene
    for j in range(phase.size):
        x, u = _shape(phase[j], k, cycle[0], cycle[1])
        angle[i, j] = or_none(scale(unit_phi * x, e_phi), wide)
        speed[i, j] = or_none(scale(unit_mu / unit_a * u, e_mu - e_a), moves)
    status[i] = judged(sound & (wide | moves), wide & moves, OK)


@entry("phase")
def closed(mu, phi0, a, R, R_s, k, e, rtol, phase, angle, speed, status):
    """Equation (1) on the cycle from fitted polynomials: 4e-15 of amplitude and crossing speed at every drive."""
    one_by_one(_closed, (mu, phi0, a, phase, angle, speed, status))


@entry("phase", "asked")
def closed_bound(mu, phi0, a, R, R_s, k, e, rtol, phase, asked, out):
    """Rounding, relative to the amplitude and to the crossing speed."""
    out[:] = 4.0 * _viscous.ROUNDING


@jit
def _state(scene, start, top, legs, t):
    """x and its rate at a time t after the switch at x = 1."""
    beta, kappa = 0.5 * scene[0], scene[5]
    t1, g1, g2, down = legs[0], legs[4], legs[9], legs[10]
    rising = t < t1
    up = where(start > 0.0, start, 0.0)
    y, v = linear_flow.motion(beta, kappa, where(rising, up, down), where(rising, -g1, g2), where(rising, t, t - t1))
    return where(rising, 1.0 + y, top - y), where(rising, v, -v)


@jit
def _segments(i, mu, phi0, a, R, R_s, k, e, phase, angle, speed, error, status):
    terms = (mu[i], phi0[i], a[i], R[i], R_s[i], 0.0 * a[i], 1.0, k[i], e[i])
    scene, units = _units.without_dimensions(*terms)
    cycle, (of_cycle, _, of_decay), verdict = _linear_swing.limit_cycle(scene)
    error[i] = of_cycle if of_cycle > of_decay else of_decay
    start = e[i] * cycle[2]
    half, top, _, _, legs = _linear_swing.half_swing(1.0, scene, start)
    t0, e_t, m_phi, e_phi, _ = units
    _, reach, fast, sound, _ = _units.dimensional(units, cycle)
    wide, moves = reach > 0.0, fast > 0.0
    for j in range(phase.size):
        sign = where(phase[j] < 0.5, 1.0, -1.0)
        x, v = _state(scene, start, top, legs, 2.0 * half * where(phase[j] < 0.5, phase[j], phase[j] - 0.5))
        angle[i, j] = or_none(sign * scale(m_phi * x, e_phi), wide)
        speed[i, j] = or_none(sign * scale(m_phi / t0 * v, e_phi - e_t), moves)
    status[i] = judged(sound & (wide | moves), wide & moves, verdict)


@entry("phase", "asked")
def segments(mu, phi0, a, R, R_s, k, e, rtol, phase, asked, angle, speed, error, status):
    """The exact pieces of the swing on the cycle that `foliot` finds with them."""
    one_by_one(_segments, (mu, phi0, a, R, R_s, k, e, phase, angle, speed, error, status))


@jit
def _check(i, mu, phi0, a, R, R_s, k, e, status):
    status[i] = refusal(mu[i], phi0[i], a[i], R[i], R_s[i], 0.0, 1.0, k[i], e[i])


@entry()
def check(mu, phi0, a, R, R_s, k, e, status):
    """As for `foliot`."""
    one_by_one(_check, (mu, phi0, a, R, R_s, k, e, status))


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
    methods=(
        Method(
            "closed", "viscous friction: exponentials on the closed-form cycle", closed, closed_bound, ("R", "k", "e")
        ),
        Method("segments", "exact pieces of linear terms", segments, estimates=True),
    ),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0},
)
