"""Verge and foliot whose torque varies over the swing: the limit cycle.

    phi'' + a phi' + (R + c abs(phi')^n) sgn phi' + k phi = -+mu tau(s)                                (1)
    tau(s) = 1 + depth cos(harmonic pi s),  s = (1 -+ phi/phi0)/2                                     (2)

s is the way along the drive since the switch, over that of the whole swing, so that 1 - s is left to the next one; s is
negative beyond the switch, on the recoil. The upper signs hold after the switch at +phi0. With a whole harmonic the
mean of tau over the swing is 1: the drive's work stays 2 mu phi0 a half swing, and what changes is where it is done.
Where torque falls to dry friction or below the foliot may stick; whether it does is found by following the motion.
Leaves out: the geometry of the pallets that makes the ripple. Source: as `foliot`; (2) is chosen here.
"""

import math

from kernels.foliot import _integrated_swing, _units
from kernels.foliot.cycle import FOLIOT, OUTPUTS, PARAMETERS, refusal, write
from kernels.interface import Field, Kernel, Method
from kernels.lanes.codes import BAD_INPUT
from kernels.lanes.columns import each_cell, entry
from kernels.lanes.jit import jit
from kernels.lanes.vectors import nearest, where

HIGHEST = 1000.0
"""Of harmonics: more waves than steps that the integrator may take follow from more."""


@jit
def _dopri5_cell(i, mu, phi0, a, R, R_s, c, n, k, e, depth, harmonic, rtol, *outputs):
    terms = (mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    scene, units = _units.without_dimensions(*terms)
    cycle, verdict = _integrated_swing.dopri5(scene, (depth[i], harmonic[i]), rtol[i])
    write(i, units, cycle, verdict, *outputs)


@entry()
def dopri5(
    mu, phi0, a, R, R_s, c, n, k, e, depth, harmonic, rtol,
    period, amplitude, crossing_speed, sensitivity, multiplier, status,
):  # fmt: skip
    """Dormand-Prince 5(4) over half swings, each switch located and restarted at, and Newton on their map."""
    scene = (mu, phi0, a, R, R_s, c, n, k, e, depth, harmonic, rtol)
    each_cell(_dopri5_cell, (*scene, period, amplitude, crossing_speed, sensitivity, multiplier, status))


@jit
def _check(i, mu, phi0, a, R, R_s, c, n, k, e, depth, harmonic, status):
    whole = (harmonic[i] >= 1.0) & (harmonic[i] <= HIGHEST) & (nearest(harmonic[i]) >= harmonic[i])
    whole = whole & (nearest(harmonic[i]) <= harmonic[i])
    allowed = (depth[i] >= 0.0) & (depth[i] < 1.0) & whole  # NaN fails
    verdict = refusal(mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    status[i] = where(allowed, verdict, BAD_INPUT)


@entry()
def check(mu, phi0, a, R, R_s, c, n, k, e, depth, harmonic, status):
    """As of `foliot`, and BAD_INPUT for a depth outside [0, 1) or a harmonic that is no whole number from 1 on."""
    each_cell(_check, (mu, phi0, a, R, R_s, c, n, k, e, depth, harmonic, status))


FOLIOT_RIPPLE = Kernel(
    name="foliot_ripple",
    doc="limit cycle of a verge and foliot whose torque varies over the swing",
    source=FOLIOT.source,
    parameters=(
        *PARAMETERS,
        Field(
            "depth",
            "1",
            "amplitude of the torque's ripple over its mean",
            default=0.0,
            lower=0.0,
            upper=math.nextafter(1.0, 0.0),
        ),
        Field(
            "harmonic",
            "1",
            "half waves of the ripple on the way from switch to switch",
            default=1.0,
            lower=1.0,
            upper=HIGHEST,
            integer=True,
        ),
    ),
    outputs=OUTPUTS,
    check=check,
    methods=(Method("dopri5", "adaptive Runge-Kutta of order 5, Newton on the half-swing map", dopri5),),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0, "depth": 0.3, "harmonic": 2.0},
)
