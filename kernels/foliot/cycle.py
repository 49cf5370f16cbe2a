"""Verge and foliot: the limit cycle.

    phi'' + a phi' + (R + c abs(phi')^n) sgn phi' + k phi = +-mu                                       (1)

The torque changes sign as phi passes +-phi0 on its way out, and the speed is then multiplied by e. Leaves out: recoil
of the crown wheel, the geometry of the pallets, the fine structure of the torque (`foliot_ripple`, `foliot_noise`).
Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681, for friction a phi' alone; the other terms are derived in the modules
that solve them. What a swing loses grows strictly with the swing, so where a limit cycle exists it is the only one and
stable; where the foliot does not come to it from rest at phi = 0, `segments` remarks the cell NOT_SELF_STARTING (a
spring; `dopri5`, which does what `segments` cannot, follows the cycle only and does not say so).
"""

import math

from kernels.foliot import (
    _coulomb,
    _friction_quadrature,
    _integrated_swing,
    _linear_swing,
    _single_loss,
    _units,
    _viscous_methods,
)
from kernels.foliot._viscous_methods import worst
from kernels.interface import Field, Kernel, Method
from kernels.lanes.codes import BAD_INPUT, NEVER_STARTS, NO_LIMIT_CYCLE, NO_METHOD, OK
from kernels.lanes.columns import each_cell, entry
from kernels.lanes.jit import jit
from kernels.lanes.ranges import judged
from kernels.lanes.vectors import isnt, where


@jit
def write(i, units, cycle, verdict, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    """One cell's cycle, or the lanes', in SI units."""
    period[i], amplitude[i], crossing_speed[i], sound, whole = _units.dimensional(units, cycle)
    sensitivity[i], multiplier[i] = cycle[3], cycle[4]
    status[i] = judged(sound, whole, verdict)


@jit
def _pure_cell(i, mu, phi0, a, R, R_s, c, n, k, e, rtol, *outputs):
    terms = (mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    scene, units = _units.without_dimensions(*terms)
    cycle, applies = _single_loss.pure(scene)
    write(i, units, cycle, where(applies, OK, NO_METHOD), *outputs)


@entry()
def pure(mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    """Closed forms where one loss acts alone: Coulomb friction, quadratic drag or restitution; else NO_METHOD."""
    each_cell(
        _pure_cell,
        (mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status),
    )


@jit
def _pure_bound(i, mu, phi0, a, R, R_s, c, n, k, e, out, asked):
    terms = (mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    scene, _ = _units.without_dimensions(*terms)
    _, applies = _single_loss.pure(scene)
    out[i] = where(
        applies, worst(asked, _single_loss.ROUNDING, _single_loss.ROUNDING, 2.0 * _single_loss.ROUNDING), math.inf
    )


@entry("asked")
def pure_bound(mu, phi0, a, R, R_s, c, n, k, e, rtol, asked, out):
    """Rounding where one loss acts alone, infinite elsewhere."""
    each_cell(_pure_bound, (mu, phi0, a, R, R_s, c, n, k, e, out, asked))


@jit
def _coulomb_cell(i, mu, phi0, a, R, R_s, c, n, k, e, rtol, *outputs):
    terms = (mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    scene, units = _units.without_dimensions(*terms)
    cycle, verdict = _coulomb.limit_cycle(scene)
    write(i, units, cycle, verdict, *outputs)


@entry()
def coulomb(mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    """One transcendental equation by Halley's steps: 4e-15 at every drive."""
    each_cell(
        _coulomb_cell,
        (mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status),
    )


@jit
def _coulomb_bound(i, mu, phi0, a, R, R_s, c, n, k, e, out, asked):
    terms = (mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    scene, _ = _units.without_dimensions(*terms)
    out[i] = worst(asked, _coulomb.ROUNDING, _coulomb.ROUNDING, _coulomb.multiplier_bound(scene))


@entry("asked")
def coulomb_bound(mu, phi0, a, R, R_s, c, n, k, e, rtol, asked, out):
    """Rounding; the multiplier exp(-tau) repeats that of tau."""
    each_cell(_coulomb_bound, (mu, phi0, a, R, R_s, c, n, k, e, out, asked))


@jit
def _segments_cell(i, mu, phi0, a, R, R_s, c, n, k, e, asked, error, *outputs):
    terms = (mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    scene, units = _units.without_dimensions(*terms)
    cycle, errors, verdict = _linear_swing.limit_cycle(scene)
    error[i] = worst(asked, *errors)
    write(i, units, cycle, verdict, *outputs)


@entry("asked")
def segments(
    mu,
    phi0,
    a,
    R,
    R_s,
    c,
    n,
    k,
    e,
    rtol,
    asked,
    period,
    amplitude,
    crossing_speed,
    sensitivity,
    multiplier,
    error,
    status,
):
    """Exact pieces of the swing and Newton on their map; with what conditioning leaves of the outputs asked for."""
    outputs = (period, amplitude, crossing_speed, sensitivity, multiplier, status)
    each_cell(_segments_cell, (mu, phi0, a, R, R_s, c, n, k, e, asked, error, *outputs))


@jit
def _quadrature_cell(i, mu, phi0, a, R, R_s, c, n, k, e, rtol, *outputs):
    terms = (mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    scene, units = _units.without_dimensions(*terms)
    cycle, verdict = _friction_quadrature.solve_quadrature(scene, rtol[i])
    write(i, units, cycle, verdict, *outputs)


@entry()
def quadrature(
    mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status
):
    """Integrals over the speed for any sum of friction laws, and Newton on their balance."""
    each_cell(
        _quadrature_cell,
        (mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status),
    )


@jit
def _quadrature_bound(i, mu, phi0, a, R, R_s, c, n, k, e, out, asked):
    terms = (mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    scene, _ = _units.without_dimensions(*terms)
    out[i] = worst(asked, *_friction_quadrature.quadrature_bound(scene))


@entry("asked")
def quadrature_bound(mu, phi0, a, R, R_s, c, n, k, e, rtol, asked, out):
    """The error of the rule and rounding: 1e-14 to 1e-13 for drag of degree 0.05 to 4."""
    each_cell(_quadrature_bound, (mu, phi0, a, R, R_s, c, n, k, e, out, asked))


@jit
def _dopri5_cell(i, mu, phi0, a, R, R_s, c, n, k, e, rtol, *outputs):
    terms = (mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    scene, units = _units.without_dimensions(*terms)
    cycle, verdict = _integrated_swing.dopri5(scene, _integrated_swing.SMOOTH, rtol[i])
    write(i, units, cycle, verdict, *outputs)


@entry()
def dopri5(mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    """Dormand-Prince 5(4) over half swings, each switch located and restarted at, and Newton on their map."""
    each_cell(
        _dopri5_cell,
        (mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status),
    )


@jit
def refusal(mu, phi0, a, R, R_s, c, n, k, e):
    """The status of `check` for one cell, or for lanes; OK where a method is to decide."""
    known = (mu >= 0.0) & (phi0 > 0.0) & (a >= 0.0) & (R >= 0.0) & (c >= 0.0) & (n >= 0.0) & (k >= 0.0)  # NaN fails
    small = (mu < math.inf) & (phi0 < math.inf) & (a < math.inf) & (R_s < math.inf) & (c < math.inf)
    allowed = known & small & (n < math.inf) & (k < math.inf) & (R_s >= R) & (e > -1.0) & (e <= 1.0)
    friction = where(k > 0.0, R, R_s)  # a spring helps stiction be overcome
    spare = _units.spare_torque(mu, friction, where(n > 0.0, 0.0, c))
    lossless = isnt((a > 0.0) | (R > 0.0) | (c > 0.0) | (e < 1.0))
    verdict = where(spare > 0.0, where(lossless, NO_LIMIT_CYCLE, OK), NEVER_STARTS)
    return where(allowed, verdict, BAD_INPUT)


@jit
def _check(i, mu, phi0, a, R, R_s, c, n, k, e, status):
    status[i] = refusal(mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])


@entry()
def check(mu, phi0, a, R, R_s, c, n, k, e, status):
    """What no method is asked.

    BAD_INPUT: NaN, infinite, outside its limits, or stiction below the friction of motion. NEVER_STARTS: torque that
    cannot overcome solid friction. NO_LIMIT_CYCLE: nothing that takes energy.
    """
    each_cell(_check, (mu, phi0, a, R, R_s, c, n, k, e, status))


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

FOLIOT = Kernel(
    name="foliot",
    doc="limit cycle of a verge and foliot",
    source="Hoyng & Nieuwenhuizen, arXiv:1604.06681; terms beyond viscous friction derived here",
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    check=check,
    methods=(
        Method(
            "closed",
            "root of q - tanh q = 1/alpha by fitted polynomials",
            _viscous_methods.closed,
            _viscous_methods.closed_bound,
            _VISCOUS_ONLY,
        ),
        Method(
            "asymptotic",
            "weak and strong series with a bound each",
            _viscous_methods.asymptotic,
            _viscous_methods.asymptotic_bound,
            _VISCOUS_ONLY,
        ),
        Method("pure", "closed forms where one loss acts alone", pure, pure_bound, ("a", "k")),
        Method(
            "coulomb",
            "viscous and Coulomb friction: one equation by Halley's steps",
            coulomb,
            coulomb_bound,
            ("c", "k", "e"),
        ),
        Method(
            "segments",
            "exact pieces of linear terms, Newton on the half-swing map",
            segments,
            excludes=("c",),
            estimates=True,
        ),
        Method("quadrature", "integrals over the speed, for any friction", quadrature, quadrature_bound, ("k",)),
        Method(
            "map",
            "exact map from switch to switch, iterated from rest",
            _viscous_methods.event_map,
            _viscous_methods.event_map_bound,
            _VISCOUS_ONLY,
        ),
        Method("dopri5", "adaptive Runge-Kutta of order 5, Newton on the half-swing map", dopri5),
    ),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0},
)
