"""Verge and foliot: the limit cycle.

    phi'' + a phi' + (R + c abs(phi')^n) sgn phi' + k phi = +-mu                                       (1)

The torque changes sign as phi passes +-phi0 on its way out, and the speed is then multiplied by e. Leaves out: recoil
of the crown wheel, the geometry of the pallets, the fine structure of the torque (`foliot_ripple`, `foliot_noise`).
Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681, for friction a phi' alone; the other terms are derived in the modules
that solve them. What a swing loses grows strictly with the swing, so where a limit cycle exists it is the only one and
stable; where the foliot does not come to it from rest at phi = 0, `segments` remarks the cell NOT_SELF_STARTING (a
spring; `taylor` and `dopri5`, which do what `segments` cannot, follow the cycle only and do not say so).
"""

from kernels.foliot import (
    _coulomb,
    _friction_quadrature,
    _integrated_swing,
    _linear_swing,
    _single_loss,
    _taylor_swing,
    _units,
    _viscous,
)
from kernels.foliot._units import Foliot
from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, NEVER_STARTS, NO_LIMIT_CYCLE, NO_METHOD, NOT_CONVERGED, OK
from kernels.lanes.jit import jit
from kernels.lanes.vectors import not_, where
from kernels.lanes.wiring import kernel, method


@jit
def closed(p, rtol):
    """The root q of q - tanh q = 1/alpha from fitted polynomials: 1e-15 at every drive, no iteration."""
    k, rest, units = _viscous.without_dimensions(p)
    return _viscous.given(units, _viscous.closed(k, rest), OK)


@jit
def closed_bound(p):
    """`closed` is right to rounding everywhere."""
    return _units.errors(_viscous.ROUNDING, _viscous.ROUNDING, 2.0 * _viscous.ROUNDING)


@jit
def asymptotic(p, rtol):
    """Weak and strong series: the period within 0.5 %, the sensitivity within 2.2 % at every drive."""
    k, _, units = _viscous.without_dimensions(p)
    return _viscous.given(units, _viscous.asymptotic(k), OK)


@jit
def asymptotic_bound(p):
    """Bound on the error of `asymptotic`: the first terms left out."""
    k, _, _ = _viscous.without_dimensions(p)
    return _viscous.asymptotic_bound(k)


@jit
def event_map(p, rtol):
    """The exact map from switch to switch, iterated from rest; slow at strong drive, where a swing forgets little."""
    k, _, units = _viscous.without_dimensions(p)
    cycle, unsettled = _viscous.event_map(k, rtol)
    return _viscous.given(units, cycle, where(unsettled, NOT_CONVERGED, OK))


@jit
def event_map_bound(p):
    """What rounding leaves of the iterated map; that it settles to rtol, its status says."""
    k, _, _ = _viscous.without_dimensions(p)
    return _viscous.event_map_bound(k)


@jit
def pure(p, rtol):
    """Closed forms where one loss acts alone: Coulomb friction, quadratic drag or restitution; else NO_METHOD."""
    scene, units = _units.without_dimensions(p)
    cycle, applies = _single_loss.pure(scene)
    return _units.given(units, cycle, where(applies, OK, NO_METHOD))


@jit
def pure_bound(p):
    """Rounding where one loss acts alone, infinite elsewhere."""
    return _single_loss.bound(p)


@jit
def coulomb(p, rtol):
    """One transcendental equation by Halley's steps: 4e-15 at every drive."""
    scene, units = _units.without_dimensions(p)
    cycle, verdict = _coulomb.limit_cycle(scene)
    return _units.given(units, cycle, verdict)


@jit
def coulomb_bound(p):
    """Rounding; the multiplier exp(-tau) repeats that of tau."""
    scene, _ = _units.without_dimensions(p)
    return _coulomb.bound(scene)


@jit
def segments(p, rtol):
    """Exact pieces of the swing and Newton on their map; with what conditioning leaves of each output."""
    scene, units = _units.without_dimensions(p)
    cycle, errors, verdict = _linear_swing.limit_cycle(scene)
    outputs, status = _units.given(units, cycle, verdict)
    return outputs, errors, status


@jit
def quadrature(p, rtol):
    """Integrals over the speed for any sum of friction laws, and Newton on their balance."""
    scene, units = _units.without_dimensions(p)
    cycle, verdict = _friction_quadrature.solve_quadrature(scene, rtol)
    return _units.given(units, cycle, verdict)


@jit
def quadrature_bound(p):
    """The error of the rule and rounding: 1e-14 to 1e-13 for drag of degree 0.05 to 4."""
    scene, _ = _units.without_dimensions(p)
    return _friction_quadrature.quadrature_bound(scene)


@jit
def dopri5(p, rtol):
    """Dormand-Prince 5(4) over half swings, each switch located and restarted at, and Newton on their map."""
    scene, units = _units.without_dimensions(p)
    cycle, verdict = _integrated_swing.dopri5(scene, _integrated_swing.SMOOTH, rtol)
    return _units.given(units, cycle, verdict)


def dopri5_is_cheaper(p, rtol):
    """Where `taylor` takes 1.04 to 5 times as long as `dopri5`, in columns of 10,000 cells."""
    return (rtol >= 1e-4) & (rtol <= 1e-2) & (p.n >= 1.0) & (p.n <= 6.0)


@jit
def check(p):
    """What no method is asked.

    BAD_INPUT: stiction below the friction of motion. NEVER_STARTS: torque that cannot overcome solid friction.
    NO_LIMIT_CYCLE: nothing that takes energy.
    """
    mu, _, a, R, R_s, c, n, k, e = p
    friction = where(k > 0.0, R, R_s)  # a spring helps stiction be overcome
    spare = _units.spare_torque(mu, friction, where(n > 0.0, 0.0, c))
    lossless = not_((a > 0.0) | (R > 0.0) | (c > 0.0) | (e < 1.0))
    verdict = where(spare > 0.0, where(lossless, NO_LIMIT_CYCLE, OK), NEVER_STARTS)
    return where(R_s >= R, verdict, BAD_INPUT)


PARAMETERS = (
    Field("mu", "rad/s^2", "drive torque per moment of inertia", lower=0.0, open_lower=True),
    Field("phi0", "rad", "switching angle", lower=0.0, open_lower=True),
    Field("a", "1/s", "viscous friction per moment of inertia", default=0.0, lower=0.0),
    Field("R", "rad/s^2", "Coulomb friction per moment of inertia", default=0.0, lower=0.0),
    Field("R_s", "rad/s^2", "stiction per moment of inertia, at least R", default="R", lower=0.0),
    Field("c", "1", "drag c abs(v)^n per moment of inertia, in rad/s^2 for v in rad/s", default=0.0, lower=0.0),
    Field("n", "1", "exponent of the drag", default=1.0, lower=0.0),
    Field("k", "1/s^2", "hairspring stiffness per moment of inertia", default=0.0, lower=0.0),
    Field(
        "e",
        "1",
        "restitution: share of the speed kept at a switch",
        default=1.0,
        lower=-1.0,
        upper=1.0,
        open_lower=True,
    ),
)

OUTPUTS = (
    Field("period", "s", "period of the limit cycle"),
    Field("amplitude", "rad", "largest angle"),
    Field("crossing_speed", "rad/s", "angular speed just before the switch"),
    Field("sensitivity", "1", "sensitivity of the period to torque, -dlnP/dlnmu"),
    Field("multiplier", "1", "multiplier of the half-cycle map (0 where below 1e-308)"),
)

_VISCOUS_ONLY = ("R", "c", "k", "e")

FOLIOT = kernel(
    "foliot",
    doc="limit cycle of a verge and foliot",
    source="Hoyng & Nieuwenhuizen, arXiv:1604.06681; terms beyond viscous friction derived here",
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    record=Foliot,
    check=check,
    methods=(
        method(
            "closed",
            "root of q - tanh q = 1/alpha by fitted polynomials",
            closed,
            closed_bound,
            excludes=_VISCOUS_ONLY,
        ),
        method(
            "asymptotic",
            "weak and strong series with a bound each",
            asymptotic,
            asymptotic_bound,
            excludes=_VISCOUS_ONLY,
        ),
        method("pure", "closed forms where one loss acts alone", pure, pure_bound, excludes=("a", "k")),
        method(
            "coulomb",
            "viscous and Coulomb friction: one equation by Halley's steps",
            coulomb,
            coulomb_bound,
            excludes=("c", "k", "e"),
        ),
        method(
            "segments",
            "exact pieces of linear terms, Newton on the half-swing map",
            segments,
            excludes=("c",),
            estimates=True,
        ),
        method(
            "quadrature", "integrals over the speed, for any friction", quadrature, quadrature_bound, excludes=("k",)
        ),
        method(
            "map",
            "exact map from switch to switch, iterated from rest",
            event_map,
            event_map_bound,
            excludes=_VISCOUS_ONLY,
        ),
        _taylor_swing.by_taylor(Foliot._fields, rippled=False),
        method(
            "dopri5",
            "adaptive Runge-Kutta of order 5, Newton on the half-swing map",
            dopri5,
            sooner=dopri5_is_cheaper,
        ),
    ),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0},
)
