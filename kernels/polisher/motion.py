"""Polishing machine: angle, rate and acceleration of its arm, and the way of the tool, along the crank's angle.

    b + e - d = f,  alpha = b_angle + arg p + side psi                                               (1)
    x = L cos(alpha + beta), y = L sin(alpha + beta)                                                 (2)
with (1) as in `linkage`, at a constant rate omega of the crank. alpha is continuous in the crank's angle: for e < b
it stays within half a turn of b, above it for type A and below for type B; for e > b it turns with the crank, from
its value at crank_angle = b_angle within half a turn of b. The tool is fixed to the arm, at a distance L from the pivot
and an angle beta ahead of the arm; without L it is where the arm meets the coupler.
Source: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (2)-(19), corrected as `linkage` says; the printed
"tool centre" of (12) and (15) is the arm's end.

LOCK_UP: NaN where the crank cannot come to; CHANGE_POINT: the branch goes on smoothly beside p, and where the linkage
lies flat rate and acceleration are NaN; DOUBLE_CRANK: the arm turns. Close to a lock the digits of the crank's angle
count more than once: INACCURATE.
"""

import math
from typing import NamedTuple

import numpy as np

from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, CHANGE_POINT, INACCURATE, LOCK_UP, OK
from kernels.lanes.groups import GROUP, cells_at, write_row
from kernels.lanes.jit import jit
from kernels.lanes.ranges import or_none, partly
from kernels.lanes.records import read
from kernels.lanes.vectors import isnt, magnitude, where
from kernels.lanes.wiring import kernel, tracing
from kernels.maths.elementary import arctan, sincos
from kernels.polisher._cell import judged, said
from kernels.polisher.arm import EXAMPLE as MACHINE
from kernels.polisher.arm import PARAMETERS as LENGTHS
from kernels.polisher.arm import allowed
from kernels.polisher.extremes import smaller
from kernels.polisher.linkage import crank, larger, lock_doubt, motion, side_of

ROUNDING = 3e-15
"""Error over the largest value of the trace; of x and y over L."""
FARTHEST = 1e6
"""Crank angle, beyond which a radian has lost its digits."""
RATE_LIMIT = 1e140
"""omega, beyond which, or below the inverse of which, its square leaves float64."""


class Machine(NamedTuple):
    """Parameters: the linkage, and how it turns and carries the tool."""

    b: float
    d: float
    f: float
    e: float
    type: float
    omega: float
    b_angle: float
    L: float
    beta: float


@jit
def _within(crank_angle):
    """Whether every angle asked for is a number that has its digits."""
    fine = True
    for angle in crank_angle:
        fine = fine and abs(angle) <= FARTHEST
    return fine


@jit
def _branch(lengths, margin, code):
    """The margins; those of a change point without what rounding has taken them past 0 by."""
    m1, m2, m3 = margin
    flat, long_crank = said(code, CHANGE_POINT), lengths[3] > lengths[0]
    back = where(long_crank, smaller(m2, 0.0), larger(m2, 0.0))
    front = where(long_crank, smaller(m3, 0.0), larger(m3, 0.0))
    return where(flat, larger(m1, 0.0), m1), where(flat, back, m2), where(flat, front, m3)


@jit
def _angles(lengths, margin, side, crank_angle, b_angle):
    """alpha from b within a turn, what turns add to it, alpha', alpha'', and the doubt close to a lock."""
    theta, s, c = crank(crank_angle, b_angle)
    within = 2.0 * arctan(s / c)  # theta in [-pi, pi]
    alpha, rate, acceleration = motion(lengths, margin, side, within, s, c)
    turns = where(lengths[3] > lengths[0], theta - within, 0.0)
    doubt = where(rate - rate >= 0.0, 2.0 * lock_doubt(lengths, margin, s, c), 0.0)
    return (alpha, turns, rate, acceleration), doubt


@jit
def _follow(first, columns, row):
    """Closed forms of sums without error."""
    i = cells_at(first)
    p = read(Machine, columns, i)
    lengths, _, margin, code = judged(p.b, p.d, p.f, p.e)
    margin, side, w = _branch(lengths, margin, code), side_of(p.type), p.omega
    fast = magnitude(w)
    rests = isnt(fast > 0.0)
    rated = ((fast <= RATE_LIMIT * RATE_LIMIT) & (fast >= 1.0 / RATE_LIMIT / RATE_LIMIT)) | rests
    held = ((fast <= RATE_LIMIT) & (fast >= 1.0 / RATE_LIMIT)) | rests
    worst = 0.0 * code
    for j in range(columns.crank_angle.size):
        angles, doubt = _angles(lengths, margin, side, 0.0 * code + columns.crank_angle[j], p.b_angle)
        worst = larger(worst, doubt)
        write_row(first, j, p.b_angle + (angles[0] + angles[1]), row, columns.alpha)
        write_row(first, j, or_none(w * angles[2], rated), row, columns.alpha_rate)
        write_row(first, j, or_none(w * w * angles[3], held), row, columns.alpha_acceleration)
        sine, cosine = sincos(p.b_angle + (angles[0] + p.beta))
        write_row(first, j, p.L * cosine, row, columns.x)
        write_row(first, j, p.L * sine, row, columns.y)
    code = where(said(code, LOCK_UP) & isnt(worst <= columns.rtol[i]), INACCURATE, code)
    columns.status[i] = where(_within(columns.crank_angle), partly(held, code), BAD_INPUT)


@jit
def _row():
    return (np.empty(GROUP),)


@jit
def check(p):
    """BAD_INPUT as for `polisher`, and angles beyond a turn."""
    fine = allowed(p.b, p.d, p.f, p.e, p.type) & (magnitude(p.omega) < math.inf)
    fine = fine & (magnitude(p.b_angle) <= math.tau) & (magnitude(p.beta) <= math.tau)
    return where(fine & (p.L >= 0.0) & (math.inf > p.L), OK, BAD_INPUT)


POLISHER_MOTION = kernel(
    "polisher_motion",
    doc="motion of a polishing machine's arm and tool along the crank's angle",
    source="Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (2)-(19), corrected",
    parameters=(
        *LENGTHS,
        Field("omega", "rad/s", "angular rate of the crank, either way"),
        Field(
            "b_angle",
            "rad",
            "direction of b, from the pivot to the motor",
            default=0.0,
            lower=-math.tau,
            upper=math.tau,
        ),
        Field("L", "m", "distance of the tool's centre from the pivot", default="d", lower=0.0),
        Field(
            "beta", "rad", "angle of the tool's centre ahead of the arm", default=0.0, lower=-math.tau, upper=math.tau
        ),
    ),
    outputs=(
        Field("alpha", "rad", "angle of the arm", dims=("crank_angle",)),
        Field("alpha_rate", "rad/s", "angular rate of the arm", dims=("crank_angle",)),
        Field("alpha_acceleration", "rad/s^2", "angular acceleration of the arm", dims=("crank_angle",)),
        Field(
            "x", "m", "tool's centre from the pivot, in the direction from which angles count", dims=("crank_angle",)
        ),
        Field("y", "m", "tool's centre from the pivot, across that", dims=("crank_angle",)),
    ),
    along=(
        Field("crank_angle", "rad", "angle of the crank, from where b_angle counts", lower=-FARTHEST, upper=FARTHEST),
    ),
    record=Machine,
    check=check,
    # close to a lock the status says more
    methods=(tracing("closed", "closed forms of sums without error", _follow, ROUNDING, buffers=_row),),
    example=dict(MACHINE) | {"omega": 6.0},
)
