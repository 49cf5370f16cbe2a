"""Verge and foliot whose torque varies over the swing: the limit cycle.

    phi'' + a phi' + (R + c abs(phi')^n) sgn phi' + k phi = -+mu tau(s)                                (1)
    tau(s) = 1 + depth cos(harmonic pi s),  s = (1 -+ phi/phi0)/2                                     (2)

s is the displacement along the drive since the switch, as a fraction of that between two switches; it is negative
beyond the switch, on the recoil. The upper signs hold after the switch at +phi0. For an integer harmonic the mean of
tau over the swing is 1: the drive's work remains 2 mu phi0 per half swing, and only its distribution changes.
If the torque falls to the dry friction or below, the foliot may stick; integration of the motion decides.
Leaves out: the geometry of the pallets that causes the ripple. Source: as `foliot`; (2) is chosen here.
"""

import math

from kernels.foliot._integrated_swing import BY_DOPRI5, BY_SDIRK4
from kernels.foliot._limit_cycle import Cell, method_by
from kernels.foliot._taylor_swing import BY_TAYLOR
from kernels.foliot.cycle import FOLIOT, check
from kernels.interface import Field
from kernels.lanes.wiring import kernel

HIGHEST = 1000.0
"""Of harmonics: more waves than steps that the integrator may take follow from more."""

FOLIOT_RIPPLE = kernel(
    "foliot_ripple",
    doc="limit cycle of a verge and foliot whose torque varies over the swing",
    source=FOLIOT.source,
    parameters=(
        *FOLIOT.parameters,
        Field("depth", "1", "amplitude of the torque's ripple over its mean",
              default=0.0, lower=0.0, upper=math.nextafter(1.0, 0.0)),
        Field("harmonic", "1", "half waves of the ripple between two switches",
              default=1.0, lower=1.0, upper=HIGHEST, integer=True),
    ),
    outputs=FOLIOT.outputs,
    check=check,
    methods=tuple(method_by(manner, Cell._fields) for manner in (BY_TAYLOR, BY_DOPRI5, BY_SDIRK4)),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0, "depth": 0.3, "harmonic": 2.0},
)  # fmt: skip
