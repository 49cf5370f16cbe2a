"""Balance with viscous and solid friction, released from rest: the angles at which it turns.

    theta_k = (-1)^k sgn(theta0) a_k,  a_k as in `_ringdown`, equation (3)                           (1)
up to the one at which it rests, which is the last; half swing 0 is the release. Source: as for `balance`.
Beyond the last turning point the trace is NaN: that of an overdamped balance (OVERDAMPED) has the release only, that of
a balance without solid friction never ends.
"""

import math

import numpy as np

from kernels.balance import _ringdown
from kernels.balance.release import EXAMPLE, PARAMETERS, allowed, side, swinging, without_units
from kernels.interface import Field, Kernel, Method, Status
from kernels.lanes.codes import BAD_INPUT, GRAZING, NOT_CONVERGED, OK, OUT_OF_RANGE, OVERDAMPED
from kernels.lanes.columns import each_cell, entry
from kernels.lanes.groups import GROUP, cells_at, each_group, write_row
from kernels.lanes.jit import jit
from kernels.lanes.vectors import where
from kernels.maths.elementary import scale

ROUNDING = 1e-15
"""Error of a turning point over the angle of release."""

_REFUSED = int(Status.BAD_INPUT)


@jit
def _farthest(half_swing):
    """The largest number asked for; NaN where the coordinate does not count whole half swings."""
    farthest = 0.0
    for k in half_swing:
        counts = k >= 0.0 and k < _ringdown.COUNT_LIMIT and k == math.floor(k)
        farthest = max(farthest, k) if counts else math.nan
        if not counts:
            break
    return farthest


@jit
def _follow(first, zeta, r, r_s, theta0, half_swing, row, farthest, turning_point, status):
    """One group of cells; each turning point by formula, so the order in which they are asked for does not matter."""
    i = cells_at(first)
    scene, (e, fine) = without_units(zeta[i], r[i], r_s[i], theta0[i])
    creeps = scene[0] >= 1.0
    scene = swinging(scene)
    count, _, _, grazes, _, unsure = _ringdown.closed(scene)
    last = where(creeps, 0.0, count)  # NaN where there is none
    delta, _ = _ringdown.decrement(scene[0])
    share = _ringdown.share_kept(delta)
    damping = _ringdown.tame(scene[0], delta)
    for j in range(half_swing.size):
        k = 0.0 * scene[3] + half_swing[j]
        a, _ = _ringdown.turning_point(*damping, share, scene[1], scene[3], k)
        angle = scale(side(theta0[i], k) * a[0], e)
        write_row(first, j, where(k > last, math.nan, where(k > 0.0, angle, theta0[i])), row, turning_point)
    verdict = where(unsure, NOT_CONVERGED, where(grazes & (last <= farthest), GRAZING, OK))
    status[i] = where(fine, where(creeps, OVERDAMPED, verdict), OUT_OF_RANGE)


@entry("half_swing")
def closed(zeta, omega_n, r, r_s, theta0, rtol, half_swing, turning_point, status):
    """Each turning point by formula in 32 digits, and the last one confirmed as for `balance`."""
    row = np.empty(GROUP)
    farthest = _farthest(half_swing)
    if farthest >= 0.0:
        each_group(_follow, (zeta, r, r_s, theta0, half_swing, row, farthest, turning_point, status))
    else:
        status[:] = _REFUSED


@entry("half_swing", "asked")
def closed_bound(zeta, omega_n, r, r_s, theta0, rtol, half_swing, asked, out):
    """Rounding, relative to the angle of release."""
    out[:] = ROUNDING


@jit
def _check(i, zeta, omega_n, r, r_s, theta0, status):
    status[i] = where(allowed(zeta[i], omega_n[i], r[i], r_s[i], theta0[i]), OK, BAD_INPUT)


@entry()
def check(zeta, omega_n, r, r_s, theta0, status):
    """BAD_INPUT as for `balance`; a balance that swings for ever has turning points too."""
    each_cell(_check, (zeta, omega_n, r, r_s, theta0, status))


BALANCE_TRACE = Kernel(
    name="balance_trace",
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
    check=check,
    methods=(Method("closed", "formula of each turning point in 32 digits", closed, closed_bound),),
    example=EXAMPLE,
)  # fmt: skip
