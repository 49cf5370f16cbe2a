"""Verge and foliot: the first flips from rest.

The foliot is released from rest at phi_start. Below +phi0 the drive pushes it up and the first flip is at +phi0; from
+phi0 on the torque has switched already and the first flip is at -phi0. In the units of `_units`, mirrored so
that the drive pushes to smaller x, it starts at x with abs(x) = abs(phi_start)/phi0, x > -1, and moves if
    1 + kappa x > rho_s,                                                                             (1)
the first flip is at x = -1, and each later one is a half swing of `_linear_swing` away. A swing that does not come
to the switch at once never will: with the same torque, every turning point is nearer to rest than the one before.
Nothing is averaged and nothing has settled: at strong drive the flips come to the limit cycle only after thousands.
Derived here from Hoyng & Nieuwenhuizen, arXiv:1604.06681, section 2, and from `foliot`.
"""

import math

import numpy as np

from kernels.foliot import _error_propagation, _linear_swing, _units
from kernels.foliot.cycle import PARAMETERS as FOLIOT_PARAMETERS
from kernels.foliot.cycle import refusal
from kernels.integrate import linear_flow
from kernels.interface import Field, Kernel, Method, Status
from kernels.lanes.codes import BAD_INPUT, COMES_TO_REST, GRAZING, INACCURATE, NEVER_STARTS, OK, OUT_OF_RANGE, STICKS
from kernels.lanes.columns import each_cell, entry
from kernels.lanes.groups import GROUP, cells_at, each_group, write_row
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.ranges import or_none, partly
from kernels.lanes.vectors import choose, fma, isnt, magnitude, some, where
from kernels.maths.elementary import is_normal, scale

FLIP_LIMIT = 1e6
"""The last flip that can be asked for."""
UNSURE = 0.5
"""Error of a speed, as a share of it, from which on it is open whether the switch was reached at all."""

_REFUSED = int(Status.BAD_INPUT)


@jit
def _place(phi0, phi_start):
    """x of (1) and the way 1 + x to the switch, which keeps its digits for a start just before it."""
    before = phi_start < phi0
    way = where(before, phi0 - phi_start, phi_start + phi0) / phi0
    return where(before, -phi_start, phi_start) / phi0, way


@jit
def _held(scene, x):
    """Whether stiction holds at rest at x, and whether the last digits decide it."""
    rho_s, kappa = scene[2], scene[5]
    pull = fma(kappa, x, 1.0)
    unsure = (kappa > 0.0) & (magnitude(pull - rho_s) <= _linear_swing.ROUNDING * (magnitude(kappa * x) + rho_s))
    return isnt(pull > rho_s), unsure


@jit_call
def _near_miss(scene, energy, push, speed, way):
    """Whether a motion that turned before the switch lacked less than its energy is unsure by.

    It starts with `speed` and the force `push`; what it lacked is at most the force against it at the switch, times
    the way left.
    """
    d, kappa = scene[0], scene[5]
    against = fma(kappa, way, -push)
    left = way - linear_flow.reach(0.5 * d, kappa, speed, push)
    rounding = 8.0 * _linear_swing.ROUNDING * way * (magnitude(against) + 1.0 + kappa * (1.0 + way))
    return left * against <= 2.0 * energy + rounding


@jit_call
def _release(scene, x, way):
    """The first flip, whether it comes, and whether the last digits decide that.

    A *flip* is (time, its low part, speed, share by which the speed may be wrong, error of the time).
    """
    d, _, _, _, _, kappa, _, slack = scene
    held, unsure = _held(scene, x)
    push = fma(kappa, x, slack)
    time = linear_flow.first_crossing(0.5 * d, kappa, 0.0 * way, push, way)
    through = time < 1e300
    time = where(through, time, 0.0)
    s, _, slope = linear_flow.response(0.5 * d, kappa, time)
    speed = push * s
    rounded = _linear_swing.ROUNDING * (1.0 + magnitude(kappa * x) / push)  # of the push
    wrong = rounded + _linear_swing.ROUNDING * way * magnitude(push * slope) / (speed * speed)
    late = rounded * way / speed + _linear_swing.ROUNDING * time
    near = (push > 0.0) & _near_miss(scene, 0.0 * way, push, 0.0 * way, way)
    unsure = unsure | _either(through, wrong > UNSURE, near & isnt(held))
    return (time, 0.0 * time, speed, wrong, late), through & isnt(held), unsure


@jit
def _either(condition, yes, no):
    """`where` for conditions."""
    return (condition & yes) | (isnt(condition) & no)


@jit_call
def _next(scene, flip):
    """The flip after `flip`, whether it comes, and whether the last digits decide that."""
    total, low, before, wrong, late = flip
    start = scene[6] * before
    time, top, speed, through, legs = _linear_swing.half_swing(1.0, scene, start)
    held, unsure = _held(scene, top)
    turns = isnt(start < 0.0)
    swing = (time, top, speed, 1.0, legs)
    kept, longer = _error_propagation.slopes(scene, start, swing)
    energy_noise, time_noise = _error_propagation.own_noise(scene, start, swing)
    now_wrong = fma(kept * start * start, wrong, energy_noise) / (speed * speed)
    now_late = late + magnitude(longer * start) * wrong + time_noise
    energy = start * start * (wrong + _linear_swing.ROUNDING)
    near = _near_miss(scene, energy, legs[9], legs[10], 1.0 + top)
    unsure = (turns & unsure) | _either(through, now_wrong > UNSURE, near)
    later = total + time
    low = low + (time - (later - total))
    return (later, low, speed, now_wrong, now_late), through & isnt(turns & held), unsure


@jit
def _countable(flip):
    """Whether the coordinate counts: whole numbers from 1 on; NaN fails."""
    counts = True
    for j in range(flip.size):
        counts = counts and 1.0 <= flip[j] <= FLIP_LIMIT and flip[j] == math.floor(flip[j])
    return counts


@jit
def _in_units(units, flip):
    """Time [s] and speed [rad/s], NaN where no normal numbers, and whether one of them and whether both are normal."""
    t, e_t, m_phi, e_phi, _ = units
    time, speed = scale(t * (flip[0] + flip[1]), e_t), scale(m_phi / t * flip[2], e_phi - e_t)
    timed, moves = is_normal(time), is_normal(speed)
    return or_none(time, timed), or_none(speed, moves), timed | moves, timed & moves


@jit
def _error(flip):
    """The larger of the relative errors of time and speed."""
    of_time = flip[4] / flip[0]
    return where(of_time > flip[3], of_time, flip[3])


@jit
def _follow(first, mu, phi0, a, R, R_s, c, n, k, e, phi_start, rtol, flip, row, flip_time, flip_speed, status):
    """One group of cells from flip to flip; flips asked for in falling order are followed from the release again."""
    i = cells_at(first)
    scene, units = _units.without_dimensions(mu[i], phi0[i], a[i], R[i], R_s[i], 0.0 * c[i], 1.0, k[i], e[i])
    x, way = _place(phi0[i], phi_start[i])
    fine = units[4] & is_normal(way)
    released, starts, doubt = _release(scene, x, where(fine, way, 1.0))
    now, going, unsure = released, starts, doubt
    whole, here = fine, 1.0
    accurate, given = fine, isnt(going)
    for j in range(flip.size):
        if flip[j] < here:
            now, going, here = released, starts, 1.0
        while here < flip[j]:
            here += 1.0
            if some(going):
                new, comes, grazes = _next(scene, now)
                unsure = unsure | (going & grazes)
                going = going & comes
                now = choose(going, new, now)
        time, speed, some_normal, normal = _in_units(units, now)
        whole, given = whole & (normal | isnt(going)), given | some_normal
        accurate = accurate & ((_error(now) <= rtol[i]) | isnt(going))
        write_row(first, j, where(going, time, math.nan), row, flip_time)
        write_row(first, j, where(going, speed, math.nan), row, flip_speed)
    verdict = where(going, OK, COMES_TO_REST)
    verdict = where(accurate, verdict, INACCURATE)
    held = isnt(magnitude(fma(scene[5], x, 1.0)) > scene[2])
    verdict = where(starts, verdict, where(held, NEVER_STARTS, STICKS))
    verdict = where(unsure, GRAZING, verdict)
    status[i] = where(fine & given, partly(whole, verdict), OUT_OF_RANGE)


@entry("flip")
def segments(mu, phi0, a, R, R_s, c, n, k, e, phi_start, rtol, flip, flip_time, flip_speed, status):
    """Exact pieces from switch to switch, and how far their rounding may have added up: INACCURATE beyond rtol."""
    row = np.empty(GROUP)
    if _countable(flip):
        each_group(
            _follow,
            (mu, phi0, a, R, R_s, c, n, k, e, phi_start, rtol, flip, row, flip_time, flip_speed, status),
        )
    else:
        status[:] = _REFUSED


@jit
def _check(i, mu, phi0, a, R, R_s, c, n, k, e, phi_start, status):
    verdict = refusal(mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    bad = isnt(magnitude(verdict - BAD_INPUT) > 0.0) | isnt(magnitude(phi_start[i]) < math.inf)
    status[i] = where(bad, BAD_INPUT, where(mu[i] > 0.0, OK, NEVER_STARTS))


@entry()
def check(mu, phi0, a, R, R_s, c, n, k, e, phi_start, status):
    """BAD_INPUT as for `foliot`, and NEVER_STARTS without torque; a clock that loses nothing may start."""
    each_cell(_check, (mu, phi0, a, R, R_s, c, n, k, e, phi_start, status))


FOLIOT_START = Kernel(
    name="foliot_start",
    doc="the first flips of a verge and foliot from rest",
    source="Hoyng & Nieuwenhuizen, arXiv:1604.06681; terms beyond viscous friction derived here",
    parameters=(*FOLIOT_PARAMETERS, Field("phi_start", "rad", "angle of release from rest", default=0.0)),
    outputs=(
        Field("flip_time", "s", "time of the flip after the release; NaN where none comes", dims=("flip",)),
        Field(
            "flip_speed", "rad/s", "angular speed along the drive just before the switch; NaN as well", dims=("flip",)
        ),
    ),
    along=(Field("flip", "1", "number of the flip, from 1 on", lower=1.0, upper=FLIP_LIMIT, integer=True),),
    check=check,
    methods=(Method("segments", "exact pieces of linear terms, from switch to switch", segments, excludes=("c",)),),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0},
)
