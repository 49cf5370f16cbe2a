"""Polishing machine: angle, rate and acceleration of its arm, and the path of the tool, along the crank's angle.

    b + e - d = f,  alpha = b_angle + arg p + side psi                                               (1)
    x = L cos(alpha + beta), y = L sin(alpha + beta)                                                 (2)
with (1) as in `linkage`, at a constant rate omega of the crank. alpha is continuous in the crank's angle: for e < b
it stays within half a turn of b, above it for type A and below for type B; for e > b it turns with the crank, from
its value at crank_angle = b_angle within half a turn of b. The tool is fixed to the arm, at a distance L from the pivot
and an angle beta ahead of the arm; without L it is where the arm meets the coupler.
Source: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (2)-(19), corrected as `linkage` says; the printed
"tool centre" of (12) and (15) is the arm's end.

LOCK_UP: NaN at angles that the crank cannot reach; CHANGE_POINT: the branch continues smoothly across p, and where the
linkage is flat, rate and acceleration are NaN; DOUBLE_CRANK: the arm turns. Close to a lock, rounding of the crank's
angle is amplified: INACCURATE.
"""

import math
from collections import namedtuple

from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, CHANGE_POINT, INACCURATE, LOCK_UP
from kernels.lanes.columns import cells_at, one_row, write_row
from kernels.lanes.jit import jit
from kernels.lanes.ranges import or_none, partly
from kernels.lanes.records import read
from kernels.lanes.vectors import choose, magnitude, not_, where
from kernels.lanes.wiring import kernel, tracing
from kernels.maths.elementary import arctan, larger, sincos
from kernels.polisher import linkage
from kernels.polisher.extremes import ROUNDING, flattened, judged, said
from kernels.polisher.linkage import EXAMPLE, Crank, crank_at, dead_gaps, motion, side_of

FARTHEST = 1e6
"""Crank angle, beyond which a radian has lost its digits."""
RATE_LIMIT = 1e140
"""omega, beyond which, or below the inverse of which, its square leaves float64."""


PARAMETERS = (
    *linkage.PARAMETERS,
    Field("omega", "rad/s", "angular rate of the crank, of either sign"),
    Field(
        "b_angle", "rad", "direction of b, from the pivot to the motor", default=0.0, lower=-math.tau, upper=math.tau
    ),
    Field("L", "m", "distance of the tool's centre from the pivot", default="d", lower=0.0),
    Field("beta", "rad", "angle of the tool's centre ahead of the arm", default=0.0, lower=-math.tau, upper=math.tau),
)
"""Parameters: the linkage, and how it turns and carries the tool."""

Machine = namedtuple("Machine", [field.name for field in PARAMETERS])


@jit
def _held(fast, limit):
    """Whether a rate is 0, or within what its power may be."""
    return ((fast <= limit) & (fast >= 1.0 / limit)) | not_(fast > 0.0)


@jit
def _follow(first, columns, row):
    """Closed forms of sums without error."""
    i = cells_at(first)
    p = read(Machine, columns, i)
    cell, side, w = judged(p), side_of(p.type), p.omega
    lengths, bow = cell.lengths, 4.0 * cell.lengths.b * cell.lengths.e
    # a change point goes on smoothly
    margin = choose(said(cell.code, CHANGE_POINT), flattened(lengths, cell.margin), cell.margin)

    worst, within = 0.0 * cell.code, True
    rated, held = _held(magnitude(w), RATE_LIMIT * RATE_LIMIT), _held(magnitude(w), RATE_LIMIT)
    for j in range(columns.crank_angle.size):
        within = within and abs(columns.crank_angle[j]) <= FARTHEST
        crank = crank_at(0.0 * cell.code + columns.crank_angle[j], p.b_angle)
        theta = 2.0 * arctan(crank.s / crank.c)  # in [-pi, pi]
        alpha, rate, acceleration = motion(lengths, margin, side, Crank(theta, crank.s, crank.c))
        turns = where(lengths.e > lengths.b, crank.theta - theta, 0.0)
        # of rz^2, relatively: large only close to where a linkage that locks does so
        outer, inner = dead_gaps(lengths, margin, crank.s, crank.c)
        doubt = larger(bow * (crank.s * crank.s) / magnitude(outer), bow * (crank.c * crank.c) / magnitude(inner))
        worst = larger(worst, where(rate - rate >= 0.0, 2e-15 * doubt, 0.0))
        write_row(first, j, p.b_angle + (alpha + turns), row, columns.alpha)
        write_row(first, j, or_none(w * rate, rated), row, columns.alpha_rate)
        write_row(first, j, or_none(w * w * acceleration, held), row, columns.alpha_acceleration)
        sine, cosine = sincos(p.b_angle + (alpha + p.beta))
        write_row(first, j, p.L * cosine, row, columns.x)
        write_row(first, j, p.L * sine, row, columns.y)
    code = where(said(cell.code, LOCK_UP) & not_(worst <= columns.rtol[i]), INACCURATE, cell.code)
    columns.status[i] = where(within, partly(held, code), BAD_INPUT)


POLISHER_MOTION = kernel(
    "polisher_motion",
    doc="motion of a polishing machine's arm and tool along the crank's angle",
    source="Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (2)-(19), corrected",
    parameters=PARAMETERS,
    outputs=(
        Field("alpha", "rad", "angle of the arm", dims=("crank_angle",)),
        Field("alpha_rate", "rad/s", "angular rate of the arm", dims=("crank_angle",)),
        Field("alpha_acceleration", "rad/s^2", "angular acceleration of the arm", dims=("crank_angle",)),
        Field("x", "m", "tool's centre from the pivot, along the zero direction of angles", dims=("crank_angle",)),
        Field("y", "m", "tool's centre from the pivot, across x", dims=("crank_angle",)),
    ),
    along=(Field("crank_angle", "rad", "angle of the crank, counted as b_angle is", lower=-FARTHEST, upper=FARTHEST),),
    record=Machine,
    # over the largest value of the trace, of x and y over L; close to a lock the status says more
    methods=(tracing("closed", "closed forms of error-free sums", _follow, ROUNDING, buffers=one_row),),
    example=EXAMPLE | {"omega": 6.0},
)
