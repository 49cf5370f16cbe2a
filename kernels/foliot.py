"""Verge and foliot: the limit cycle.

    phi'' + a phi' = +-mu                                                                          (1)

The torque changes sign as phi passes +-phi0 on its way out. Leaves out: recoil of the crown wheel, the geometry of
the pallets, the fine structure of the torque. Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681.
"""

import math

from kernels import _viscous, _viscous_dopri5
from kernels._columns import each_cell, entry
from kernels._jit import jit
from kernels._lanes import where
from kernels.interface import FIRST_REFUSAL, Field, Kernel, Method, Status

SENSITIVITY, MULTIPLIER = 3, 4
"""Positions of these outputs."""

_OK, _BAD_INPUT, _OUT_OF_RANGE = float(Status.OK), float(Status.BAD_INPUT), float(Status.OUT_OF_RANGE)
_NEVER_STARTS, _NO_LIMIT_CYCLE = float(Status.NEVER_STARTS), float(Status.NO_LIMIT_CYCLE)
_NOT_CONVERGED, _STEP_LIMIT = float(Status.NOT_CONVERGED), float(Status.STEP_LIMIT)
_INACCURATE = float(Status.INACCURATE)


@jit
def _write(i, scene, cycle, verdict, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    period[i], amplitude[i], crossing_speed[i], normal = _viscous.dimensional(scene, cycle)
    sensitivity[i], multiplier[i] = cycle[3], cycle[4]
    status[i] = where(normal | (verdict >= FIRST_REFUSAL), verdict, _OUT_OF_RANGE)


@jit
def _closed(i, mu, phi0, a, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    k, rest, scene = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    cycle = _viscous.closed(k, rest)
    _write(i, scene, cycle, _OK, period, amplitude, crossing_speed, sensitivity, multiplier, status)


@entry()
def closed(mu, phi0, a, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    """The root q of q - tanh q = 1/alpha from fitted polynomials: 1e-15 at every drive, no iteration."""
    each_cell(_closed, (mu, phi0, a, period, amplitude, crossing_speed, sensitivity, multiplier, status))


@jit
def _asymptotic(i, mu, phi0, a, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    k, _, scene = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    cycle = _viscous.asymptotic(k)
    _write(i, scene, cycle, _OK, period, amplitude, crossing_speed, sensitivity, multiplier, status)


@entry()
def asymptotic(mu, phi0, a, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    """Weak and strong series: the period within 0.5 %, the sensitivity within 2.2 % at every drive."""
    each_cell(_asymptotic, (mu, phi0, a, period, amplitude, crossing_speed, sensitivity, multiplier, status))


@jit
def _event_map(i, mu, phi0, a, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    k, _, scene = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    cycle, unsettled = _viscous.event_map(k, rtol[i])
    verdict = where(unsettled, _NOT_CONVERGED, _OK)
    _write(i, scene, cycle, verdict, period, amplitude, crossing_speed, sensitivity, multiplier, status)


@entry()
def event_map(mu, phi0, a, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    """The exact map from switch to switch, iterated from rest; slow at strong drive, where a swing forgets little."""
    each_cell(_event_map, (mu, phi0, a, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status))


@jit
def _dopri5(i, mu, phi0, a, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    k, _, scene = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    cycle, unfinished, unsettled, loose = _viscous_dopri5.dopri5(k, rtol[i])
    verdict = where(unfinished, _STEP_LIMIT, where(unsettled, _NOT_CONVERGED, where(loose, _INACCURATE, _OK)))
    _write(i, scene, cycle, verdict, period, amplitude, crossing_speed, sensitivity, multiplier, status)


@entry()
def dopri5(mu, phi0, a, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    """Dormand-Prince 5(4) over half swings, each switch located and restarted at, and Newton on their map."""
    each_cell(_dopri5, (mu, phi0, a, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status))


@jit
def _worst(asked, cycle, sensitivity, multiplier):
    """The largest bound of the outputs asked for: period, amplitude and speed share the first."""
    worst = where(asked[SENSITIVITY] == 1, sensitivity, cycle)
    return where((asked[MULTIPLIER] == 1) & (multiplier > worst), multiplier, worst)


@jit
def _asymptotic_bound(i, mu, phi0, a, out, asked):
    k, _, _ = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    out[i] = _worst(asked, *_viscous.asymptotic_bound(k))


@entry("asked")
def asymptotic_bound(mu, phi0, a, rtol, asked, out):
    """Bound on the error of `asymptotic`: the first terms left out."""
    each_cell(_asymptotic_bound, (mu, phi0, a, out, asked))


@jit
def _event_map_bound(i, mu, phi0, a, out, asked):
    k, _, _ = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    out[i] = _worst(asked, *_viscous.event_map_bound(k))


@entry("asked")
def event_map_bound(mu, phi0, a, rtol, asked, out):
    """What rounding leaves of the iterated map; that it settles to rtol, its status says."""
    each_cell(_event_map_bound, (mu, phi0, a, out, asked))


@entry("asked")
def closed_bound(mu, phi0, a, rtol, asked, out):
    """`closed` is right to rounding everywhere."""
    out[:] = _worst(asked, _viscous.ROUNDING, _viscous.ROUNDING, 2.0 * _viscous.ROUNDING)


@jit
def _check(i, mu, phi0, a, status):
    finite = (mu[i] < math.inf) & (phi0[i] < math.inf) & (a[i] < math.inf)
    allowed = finite & (mu[i] >= 0.0) & (phi0[i] > 0.0) & (a[i] >= 0.0)  # NaN fails
    cycle = where(a[i] > 0.0, _OK, _NO_LIMIT_CYCLE)
    status[i] = where(allowed, where(mu[i] > 0.0, cycle, _NEVER_STARTS), _BAD_INPUT)


@entry()
def check(mu, phi0, a, status):
    """BAD_INPUT for what is NaN, infinite or negative; NEVER_STARTS without torque; NO_LIMIT_CYCLE without friction."""
    each_cell(_check, (mu, phi0, a, status))


PARAMETERS = (
    Field("mu", "rad/s^2", "drive torque per moment of inertia", lower=0.0, open_lower=True),
    Field("phi0", "rad", "switching angle", lower=0.0, open_lower=True),
    Field("a", "1/s", "viscous friction per moment of inertia", default=0.0, lower=0.0),
)

FOLIOT = Kernel(
    name="foliot",
    doc="limit cycle of a verge and foliot with viscous friction",
    source="Hoyng & Nieuwenhuizen, arXiv:1604.06681",
    parameters=PARAMETERS,
    outputs=(
        Field("period", "s", "period of the limit cycle"),
        Field("amplitude", "rad", "largest angle"),
        Field("crossing_speed", "rad/s", "angular speed just before the switch"),
        Field("sensitivity", "1", "sensitivity of the period to torque, -dlnP/dlnmu"),
        Field("multiplier", "1", "multiplier of the half-cycle map (0 where below 1e-308)"),
    ),
    check=check,
    methods=(
        Method("asymptotic", "weak and strong series with a bound each", asymptotic, asymptotic_bound),
        Method("closed", "root of q - tanh q = 1/alpha by fitted polynomials", closed, closed_bound),
        Method("map", "exact map from switch to switch, iterated from rest", event_map, event_map_bound),
        Method("dopri5", "adaptive Runge-Kutta of order 5, Newton on the half-swing map", dopri5),
    ),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0},
)
