"""Balance with viscous and solid friction, driven once per half swing: the limit cycle.

    th'' + 2 zeta w_n th' + w_n^2 (th +- r) = drive,  + for th' > 0,  r = R/k                        (1)
The drive is either an impulse, the energy k w at each passage of th = 0, or a lift, the torque k m along the motion
for abs(th) < beta, which changes sign once the balance has left the lift. Leaves out: the effect of an escapement
outside the lift, and stiction, since a cycle turns beyond r. An impulse does not start a balance at rest at zero.
Source: "Theory of Horology", 2-3, for the motion; the cycle, its existence and its multiplier are derived in
`_driven_swing`. A drive too weak to sustain a swing is refused as STICKS, as is, for zeta >= 1, where a balance creeps
to r, an impulse or a lift with beta <= r.
"""

import math

from kernels.balance import _driven_swing
from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, NO_LIMIT_CYCLE, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit
from kernels.lanes.ranges import partly
from kernels.lanes.vectors import not_, where
from kernels.lanes.wiring import kernel, method
from kernels.maths.elementary import measured


@jit
def _put_back(units, cycle, verdict):
    """Amplitude, period and multiplier, and the status."""
    omega_n, e, fine = units
    amplitude, period = measured(cycle.amplitude, e), measured(2.0 * cycle.time / omega_n, 0.0)
    whole = (amplitude > 0.0) & (period > 0.0)
    return (amplitude, period, cycle.multiplier), where(fine, partly(whole, verdict), OUT_OF_RANGE)


UNITS = _driven_swing.in_units, _put_back


@jit
def check(p):
    """What no method is asked.

    BAD_INPUT: no drive, half of one (m without beta) or two. NO_LIMIT_CYCLE: nothing that takes energy.
    """
    kicks, lifts = p.w > 0.0, (p.m > 0.0) & (p.beta > 0.0)
    nothing_else = not_((p.m > 0.0) | (p.beta > 0.0))
    one = (kicks & nothing_else) | (lifts & not_(kicks))
    lossless = not_((p.zeta > 0.0) | (p.r > 0.0))
    return where(one, where(lossless, NO_LIMIT_CYCLE, OK), BAD_INPUT)


BALANCE_DRIVEN = kernel(
    "balance_driven",
    doc="limit cycle of a balance with viscous and solid friction, kept up by impulses or by a lift",
    source='"Theory of Horology", section 2-3, for the motion; the cycle is derived here',
    parameters=(
        Field("zeta", "1", "viscous damping ratio c/(2 sqrt(I k))", lower=0.0),
        Field("omega_n", "rad/s", "angular frequency without friction, sqrt(k/I)", lower=0.0, open_lower=True),
        Field("r", "rad", "solid friction torque over spring stiffness, R/k", lower=0.0),
        Field("w", "rad^2", "impulse: energy over spring stiffness, at each passage of 0; instead of m and beta",
              default=0.0, lower=0.0, open_lower=True),
        Field("m", "rad", "lift torque over spring stiffness", default=0.0, lower=0.0),
        Field("beta", "rad", "the lift acts over abs(theta) < beta", default=0.0, lower=0.0),
    ),
    outputs=(
        Field("amplitude", "rad", "largest angle on the limit cycle"),
        Field("period", "s", "period of the limit cycle"),
        Field("multiplier", "1",
              "multiplier of the half-swing map; underflows to 0 below 1e-308"),
    ),
    check=check,
    methods=(
        method("closed", "formulas: impulses without solid friction, or no viscous damping",
               _driven_swing.closed, _driven_swing.closed_bound, units=UNITS),
        method("newton", "exact damped legs, Newton on the map of a half swing", _driven_swing.newton, units=UNITS),
    ),
    example={"zeta": 0.002, "omega_n": 5 * math.pi, "r": 0.0, "w": 0.1},
)  # fmt: skip
