"""Impact clock: crown wheel and foliot as two bodies, free between inelastic impacts, driven by a constant torque.

    I_c th_c'' = torque,  I_v th_v'' = 0  between impacts; at an impact closing speeds are multiplied by -e        (1)

Teeth meet the upper and the lower pallet in turn and slip off when the pallet has moved by h past the middle; `nu` is
the curvature of the lever (geometry: `_units`). With e = 0 tooth and pallet stay together until the tooth escapes.
All torques are proportional to the drive, so the period is proportional to torque^(-1/2) and the swing does not depend
on the torque. Leaves out: friction, the width of teeth and pallets.
Source: derived here. Of the work on such clocks by Roup et al. (2003), Lepschy et al. and Denny (2002) only abstracts
were available; no number here is theirs.

`closed` solves for the symmetric cycle with one impact per half period (one push in contact for e = 0): NO_CYCLE if it
does not exist, UNSTABLE if disturbances of it grow, GRAZING if the last digits of the input decide on either (kappa = 1
with a flat lever: they neither grow nor decay).

`events` finds the motion that the clock reaches from a start displaced by a millionth from the symmetric cycle; other
motions may be stable too, and near a border of existence the clock may reach one of them. OK: one tooth per cycle, also
off the middle (`offset`), with several impacts, or with several swings to and fro. PERIOD_2: the motion repeats after
two or more teeth; period and speeds are means. NOT_PERIODIC: means over 1024 half swings, without a multiplier.
STEP_LIMIT: bounces without end, as for e near 1, or a lever so curved that both pallets wedge the wheel. NO_METHOD:
lasting contact with a curved lever, or a ratio of masses beyond 1e12. TOOTH_JUMPED would be detected, but a flat lever
cannot let a tooth pass (`_half_swing`), and no curved one was found that does.
"""

from kernels.impact import _closed_cycle, _followed, _units
from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, NEVER_MEETS, NEVER_STARTS, OK
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit
from kernels.lanes.vectors import magnitude, nearest, not_, where
from kernels.lanes.wiring import kernel, method


@jit
def check(p):
    """What no method is asked.

    BAD_INPUT: an even number of teeth. NEVER_STARTS: no torque. NEVER_MEETS: a
    tooth held until h >= p/4 is met by the other pallet before it escapes; with e = 0 h = p/4 itself is the clock
    without drop.
    """
    pairs = 0.5 * (p.teeth - 1.0)
    odd = not_(magnitude(nearest(pairs) - pairs) > 0.0)
    _, slack = _units.escape(p.r_c, p.teeth, p.h)
    meets = (slack[0] > 0.0) | (not_(slack[0] < 0.0) & not_(p.e > 0.0))
    verdict = where(p.torque > 0.0, where(meets, OK, NEVER_MEETS), NEVER_STARTS)
    return where(odd, verdict, BAD_INPUT)


PARAMETERS = (
    Field("torque", "N m", "drive torque on the crown wheel", lower=0.0),
    Field("I_c", "kg m^2", "moment of inertia of the crown wheel", lower=0.0, open_lower=True),
    Field("I_v", "kg m^2", "moment of inertia of verge and foliot", lower=0.0, open_lower=True),
    Field("r_c", "m", "radius of the crown wheel", lower=0.0, open_lower=True),
    Field("r_v", "m", "lever of the pallets", lower=0.0, open_lower=True),
    Field("teeth", "1", "teeth of the crown wheel, odd", lower=3.0, upper=_units.MOST_TEETH, integer=True),
    Field("h", "m", "displacement of a pallet from the middle where its tooth escapes", lower=0.0),
    Field("e", "1", "restitution: share of the closing speed kept in an impact", lower=0.0, upper=_units.MOST_E),
    Field("nu", "1", "curvature of the lever, (U''/U'^2) g T^2 of the symmetric cycle", default=0.0),
)

OUTPUTS = (
    Field("period", "s", "period of the cycle, in which one tooth passes; the mean if cycles differ"),
    Field("swing", "m", "half the peak-to-peak displacement of a pallet"),
    Field("wheel_speed", "rad/s",
          "speed of the crown wheel just after the first impact of a swing; the mean if swings differ"),
    Field("pallet_speed", "rad/s", "speed of the verge just after that impact, in the direction of the tooth"),
    Field("multiplier", "1", "largest factor by which disturbances grow in a half swing, from release to release"),
    Field("recoil", "rad", "largest angle by which the crown wheel is thrown back (0 where it is not)"),
    Field("contact_share", "1", "share of the time that a tooth and a pallet are in contact"),
    Field("impacts", "1", "impacts in half a period (inf where bounces die out in contact)", gaps=True),
    Field("offset", "m", "distance of the middle of the pallet's swing from the middle of its teeth"),
)  # fmt: skip

IMPACT = kernel(
    "impact",
    doc="limit cycle of a crown wheel and a foliot with inelastic impacts",
    source="two bodies, free flight and restitution; derived here",
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    check=check,
    methods=(
        # rounding; where two multipliers nearly meet and lose more, the status says so
        method("closed", "formula of the symmetric cycle, where it exists and is stable",
               _closed_cycle.closed, _closed_cycle.ROUNDING, units=_units.UNITS),
        method("events", "any motion, contact by contact, and Newton's method on a periodic one",
               _followed.events, units=_units.UNITS, buffers=_followed.workspace, loop=cell_by_cell),
    ),
    example={"torque": 1e-3, "I_c": 4e-5, "I_v": 1e-5, "r_c": 0.03, "r_v": 0.03, "teeth": 31, "h": 0.0, "e": 0.2},
)  # fmt: skip
