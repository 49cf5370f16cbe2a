"""Verge and foliot: the limit cycle.

    phi'' + a phi' + (R + c abs(phi')^n) sgn phi' + k phi = +-mu                                       (1)

The torque changes sign as phi passes +-phi0 on its way out, and the speed is then multiplied by e. Leaves out: recoil
of the crown wheel, the geometry of the pallets, the fine structure of the torque (`foliot_ripple`, `foliot_noise`).
Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681, for friction a phi' alone; the other terms are derived in the modules
that solve them. The loss of a swing grows strictly with the swing, so a limit cycle is unique and stable if it exists.
With a spring the foliot may not reach it from rest at phi = 0; `segments` then sets NOT_SELF_STARTING (`taylor` and
`dopri5`, for terms that `segments` lacks, solve only for the cycle and do not detect this).
"""

from kernels.foliot import _coulomb, _friction_quadrature, _viscous
from kernels.foliot._integrated_swing import BY_DOPRI5, BY_SDIRK4
from kernels.foliot._limit_cycle import method_by
from kernels.foliot._linear_swing import segments
from kernels.foliot._taylor_swing import BY_TAYLOR
from kernels.foliot._units import UNITS, Foliot, drag_of, errors, spare_torque
from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, NEVER_STARTS, NO_LIMIT_CYCLE, OK
from kernels.lanes.jit import jit
from kernels.lanes.vectors import not_, where
from kernels.lanes.wiring import kernel, method


@jit
def check(p):
    """What no method is asked; of a record that may have more parameters, or no drag.

    BAD_INPUT: stiction below the friction of motion. NEVER_STARTS: torque that cannot overcome solid friction.
    NO_LIMIT_CYCLE: nothing that takes energy.
    """
    friction = where(p.k > 0.0, p.R, p.R_s)  # a spring helps stiction be overcome
    c, n = drag_of(p)
    spare = spare_torque(p.mu, friction, where(n > 0.0, 0.0, c))
    lossless = not_((p.a > 0.0) | (p.R > 0.0) | (c > 0.0) | (p.e < 1.0))
    verdict = where(spare > 0.0, where(lossless, NO_LIMIT_CYCLE, OK), NEVER_STARTS)
    return where(p.R_s >= p.R, verdict, BAD_INPUT)


PARAMETERS = (
    Field("mu", "rad/s^2", "drive torque per moment of inertia", lower=0.0, open_lower=True),
    Field("phi0", "rad", "switching angle", lower=0.0, open_lower=True),
    Field("a", "1/s", "viscous friction per moment of inertia", default=0.0, lower=0.0),
    Field("R", "rad/s^2", "Coulomb friction per moment of inertia", default=0.0, lower=0.0),
    Field("R_s", "rad/s^2", "stiction per moment of inertia, at least R", default="R", lower=0.0),
    Field("c", "1", "drag c abs(v)^n per moment of inertia, in rad/s^2 for v in rad/s", default=0.0, lower=0.0),
    Field("n", "1", "exponent of the drag", default=1.0, lower=0.0),
    Field("k", "1/s^2", "hairspring stiffness per moment of inertia", default=0.0, lower=0.0),
    Field("e", "1", "restitution: share of the speed kept at a switch", 1.0, lower=-1.0, upper=1.0, open_lower=True),
)

OUTPUTS = (
    Field("period", "s", "period of the limit cycle"),
    Field("amplitude", "rad", "largest angle"),
    Field("crossing_speed", "rad/s", "angular speed just before the switch"),
    Field("sensitivity", "1", "sensitivity of the period to torque, -dlnP/dlnmu"),
    Field("multiplier", "1", "multiplier of the half-cycle map; underflows to 0 below 1e-308"),
)

_VISCOUS = {"units": _viscous.UNITS, "excludes": ("R", "c", "k", "e")}

FOLIOT = kernel(
    "foliot",
    doc="limit cycle of a verge and foliot",
    source="Hoyng & Nieuwenhuizen, arXiv:1604.06681; terms beyond viscous friction derived here",
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    record=Foliot,
    check=check,
    methods=(
        method("closed", "root of q - tanh q = 1/alpha by fitted polynomials",
               _viscous.closed, errors(_viscous.ROUNDING, _viscous.ROUNDING, 2.0 * _viscous.ROUNDING), **_VISCOUS),
        method("asymptotic", "weak and strong series with a bound each",
               _viscous.asymptotic, _viscous.asymptotic_bound, **_VISCOUS),
        method("pure", "closed forms for a single kind of loss",
               _coulomb.pure, _coulomb.pure_bound, units=UNITS, excludes=("a", "k")),
        method("coulomb", "viscous and Coulomb friction: one equation by Halley's steps",
               _coulomb.coulomb, _coulomb.coulomb_bound, units=UNITS, excludes=("c", "k", "e")),
        method("segments", "exact pieces of linear terms, Newton on the half-swing map",
               segments, units=UNITS, excludes=("c",), estimates=True),
        method("quadrature", "integrals over the speed, for any friction",
               _friction_quadrature.quadrature, _friction_quadrature.bound, units=UNITS, excludes=("k",)),
        method("map", "exact map from switch to switch, iterated from rest",
               _viscous.event_map, _viscous.event_map_bound, **_VISCOUS),
        method_by(BY_TAYLOR, Foliot._fields),
        # sooner where `taylor` takes 1.1 to 3.6 times as long with drag and spring, in columns of 256 to 4,096 cells
        method_by(BY_DOPRI5, Foliot._fields, lambda p, rtol: rtol >= 1e-6),
        method_by(BY_SDIRK4, Foliot._fields),
    ),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0},
)  # fmt: skip
