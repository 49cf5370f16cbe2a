"""Balance with viscous and solid friction, released from rest: how it comes to rest.

    I th'' + c th' + k th +- R = 0,  + for th' > 0;  zeta = c/(2 sqrt(I k)),  r = R/k                (1)
It rests at the first turning point where abs(theta) <= r_s; theta is measured from the spring's zero, and r_s = R_s/k
is the stiction, as an angle. Leaves out: an escapement (`balance_driven`), friction that varies with the position.
Source: "Theory of Horology", section 2-3; the count of half swings is derived in `_ringdown`.

If there is no such point, the status says so and outputs that exist are given: OVERDAMPED for zeta >= 1 (the balance
never turns and creeps to r on the side of release, which is `stop_angle`), NEVER_ENDS without solid friction (the
motion decays to 0 and never ends). GRAZING: the count depends on the last digits of the input. PARTLY_OUT_OF_RANGE: an
output, such as the angle of rest near critical damping without solid friction, is outside the range of float64.
"""

import math
from collections import namedtuple

from kernels.balance import _ringdown
from kernels.interface import Field
from kernels.lanes.codes import (
    BAD_INPUT,
    GRAZING,
    INACCURATE,
    NEVER_ENDS,
    NO_LIMIT_CYCLE,
    NOT_CONVERGED,
    OK,
    OUT_OF_RANGE,
    OVERDAMPED,
)
from kernels.lanes.jit import jit
from kernels.lanes.ranges import or_none, partly
from kernels.lanes.vectors import magnitude, nearest, not_, where
from kernels.lanes.wiring import kernel, method
from kernels.maths.elementary import NORMAL_HIGH, NORMAL_LOW, is_normal, scale

ROUNDING = 2e-15
"""What `closed` is right to; where the differences of (3) in `_ringdown` lose more, the status says so."""


@jit
def side(theta0, swings):
    """+1 or -1: the sign of theta after so many half swings, for swings < 2^50."""
    half = 0.5 * swings
    odd = magnitude(nearest(half) - half) > 0.25
    return where(odd, -1.0, 1.0) * where(theta0 < 0.0, -1.0, 1.0)


@jit
def closed(p, rtol):
    """The count by formula, confirmed by the turning points on both sides of it in 32 digits, in SI units.

    Overdamped and endless motions get what exists of them.
    """
    scene, e, fine = _ringdown.in_units(p)
    rest = _ringdown.closed(scene)
    creeps, moves = p.zeta >= 1.0, scene.start > scene.r_s
    endless = moves & not_(creeps) & not_((scene.r > 0.0) | (scene.r_s > 0.0))
    lasts = not_((creeps & moves) | endless)  # the motion has an end, be it the release

    # where it rests; without friction of motion it fades to a positive angle, which may be too faint for a float64
    swings = where((rest.count < _ringdown.COUNT_LIMIT) & not_(creeps), rest.count, 0.0)
    angle = where(creeps & moves, scene.r, where(endless, 0.0, rest.last))
    angle = where(moves, scale(side(p.theta0, swings) * angle, e), p.theta0)
    fades = not_(scene.r > 0.0) & lasts
    faint = moves & (magnitude(angle) < NORMAL_LOW) & (fades | (magnitude(angle) > 0.0))

    # a half swing takes pi/(w sqrt(1 - zeta^2)), untouched by solid friction
    half = math.pi / (p.omega_n * _ringdown.decrement(where(creeps, 0.0, p.zeta))[1][0])
    time = where(moves, rest.count * half, 0.0)
    timed = is_normal(half) & is_normal(2.0 * half)
    ends = timed & not_(time > NORMAL_HIGH)

    away = or_none(magnitude(scene.start - scene.r_s) / _ringdown.unit(scene.r_s), scene.r_s > 0.0)
    margin = where(creeps, away, where(scene.r_s > 0.0, rest.margin, 0.0))
    outputs = RingDown(
        where(creeps, 0.0, or_none(rest.count, not_(endless) & not_(rest.count > NORMAL_HIGH))),
        or_none(angle, not_(faint)),
        or_none(time, lasts & (ends | not_(time > 0.0))),
        or_none(margin, not_(endless)),
        or_none(2.0 * half, timed & not_(creeps)),
    )

    # an angle of rest too faint for a float64 is not asked for its error
    loose = not_(faint | (rest.doubt <= rtol * magnitude(rest.last)))
    loose = loose | not_(rest.doubt <= rtol * rest.margin * scene.r_s)
    verdict = where(rest.unsure, NOT_CONVERGED, where(rest.grazes, GRAZING, where(loose, INACCURATE, OK)))
    verdict = where(scene.start > 0.0, verdict, OK)
    verdict = where(creeps, OVERDAMPED, where(endless, NEVER_ENDS, verdict))
    whole = not_(faint) & (creeps | (timed & (ends | not_(lasts))))
    return outputs, where(fine, partly(whole, verdict), OUT_OF_RANGE)


@jit
def check(p):
    """What no method is asked.

    BAD_INPUT: stiction below the friction of motion. NO_LIMIT_CYCLE: nothing that takes energy from a balance that
    swings.
    """
    lossless = not_((p.zeta > 0.0) | (p.r > 0.0)) & (magnitude(p.theta0) > p.r_s)
    return where(p.r_s >= p.r, where(lossless, NO_LIMIT_CYCLE, OK), BAD_INPUT)


PARAMETERS = (
    Field("zeta", "1", "viscous damping ratio c/(2 sqrt(I k))", lower=0.0),
    Field("omega_n", "rad/s", "angular frequency without friction, sqrt(k/I)", lower=0.0, open_lower=True),
    Field("r", "rad", "solid friction torque over spring stiffness, R/k", lower=0.0),
    Field("r_s", "rad", "stiction over spring stiffness, at least r", default="r", lower=0.0, open_lower=True),
    Field("theta0", "rad", "angle of release, from rest"),
)

Balance = namedtuple("Balance", [field.name for field in PARAMETERS])

OUTPUTS = (
    Field("half_swings", "1", "half swings until rest", integer=True),
    Field("stop_angle", "rad", "angle of rest, from the spring's zero"),
    Field("stop_time", "s", "time from release to rest"),
    Field("margin", "1", "smallest abs(abs(theta)/r_s - 1) at a turning point"),
    Field("period", "s", "time of two half swings, constant during the ring-down"),
)

RingDown = namedtuple("RingDown", [field.name for field in OUTPUTS])

EXAMPLE = {"zeta": 0.002, "omega_n": 5 * math.pi, "r": 0.01, "theta0": 4.5}

BALANCE = kernel(
    "balance",
    doc="ring-down of a balance with viscous and solid friction",
    source='"Theory of Horology", section 2-3, equations (3) and (10); the count is derived here',
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    record=Balance,
    check=check,
    methods=(method("closed", "formula for the number of half swings, verified in 32 digits", closed, ROUNDING),),
    example=EXAMPLE,
)
