"""Balance with viscous and solid friction, released from rest: the angles at which it turns.

    theta_k = (-1)^k sgn(theta0) a_k,  a_k as in `_ringdown`, equation (3)                           (1)
up to the one at which it rests, which is the last; half swing 0 is the release. Source: as for `balance`.
Beyond the last turning point the trace is NaN: an overdamped balance (OVERDAMPED) has the release only, and the trace
of a balance without solid friction never ends.
"""

import math

from kernels.balance import _ringdown
from kernels.balance.release import EXAMPLE, PARAMETERS, Balance, side
from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, GRAZING, NOT_CONVERGED, OK, OUT_OF_RANGE, OVERDAMPED
from kernels.lanes.columns import cells_at, one_row, write_row
from kernels.lanes.jit import jit
from kernels.lanes.records import read
from kernels.lanes.vectors import where
from kernels.lanes.wiring import kernel, tracing
from kernels.maths.elementary import scale

ROUNDING = 1e-15
"""Error of a turning point over the angle of release."""


@jit
def _follow(first, columns, row):
    """One group of cells; each turning point by formula, so the order in which they are asked for does not matter."""
    i = cells_at(first)
    p = read(Balance, columns, i)
    scene, e, fine = _ringdown.in_units(p)
    creeps, rest = p.zeta >= 1.0, _ringdown.closed(scene)
    last = where(creeps, 0.0, rest.count)  # NaN where there is none
    decay = _ringdown.decay_of(scene.zeta)
    farthest, counts = 0.0, True  # of the half swings asked for, and whether they are whole numbers
    for j in range(columns.half_swing.size):
        number = columns.half_swing[j]
        farthest = max(farthest, number)
        counts = counts and 0.0 <= number < _ringdown.COUNT_LIMIT and number == math.floor(number)
        k = 0.0 * scene.start + number
        a, _ = _ringdown.turning_point(scene, decay, k)
        angle = where(k > 0.0, scale(side(p.theta0, k) * a[0], e), p.theta0)
        write_row(first, j, where(k > last, math.nan, angle), row, columns.turning_point)
    verdict = where(rest.unsure, NOT_CONVERGED, where(rest.grazes & (last <= farthest), GRAZING, OK))
    verdict = where(fine, where(creeps, OVERDAMPED, verdict), OUT_OF_RANGE)
    columns.status[i] = where(counts, verdict, BAD_INPUT)


@jit
def check(p):
    """BAD_INPUT: stiction below the friction of motion; a balance that swings for ever has turning points too."""
    return where(p.r_s >= p.r, OK, BAD_INPUT)


BALANCE_TRACE = kernel(
    "balance_trace",
    doc="turning points of a balance with viscous and solid friction",
    source='"Theory of Horology", section 2-3, equation (10), restarted at every turning point',
    parameters=PARAMETERS,
    outputs=(Field("turning_point", "rad", "angle at the end of a half swing", dims=("half_swing",), gaps=True),),
    along=(
        Field(
            "half_swing", "1", "number of the half swing, 0 for the release",
            lower=0.0, upper=_ringdown.COUNT_LIMIT - 1.0, integer=True,
        ),
    ),
    record=Balance,
    check=check,
    methods=(tracing("closed", "formula of each turning point in 32 digits", _follow, ROUNDING, buffers=one_row),),
    example=EXAMPLE,
)  # fmt: skip
