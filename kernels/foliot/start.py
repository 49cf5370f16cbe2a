"""Verge and foliot: the first flips from rest.

The foliot is released from rest at phi_start. Below +phi0 the drive pushes it up and the first flip is at +phi0; from
+phi0 on the torque has switched already and the first flip is at -phi0. In the units of `_units`, mirrored so
that the drive pushes to smaller x, it starts at x with abs(x) = abs(phi_start)/phi0, x > -1, and moves if
    1 + kappa x > rho_s,                                                                             (1)
the first flip is at x = -1, and each later one is a half swing of `_linear_swing` away. A swing that does not reach
the switch directly never will: with the same torque, every turning point is closer to rest than the one before.
These are transients: at strong drive the flips approach the limit cycle only after thousands.
Derived here from Hoyng & Nieuwenhuizen, arXiv:1604.06681, section 2, and from `foliot`.
"""

import math
from collections import namedtuple

from kernels.foliot import _linear_swing, _units
from kernels.foliot._linear_swing import ROUNDING
from kernels.foliot._units import LinearFoliot
from kernels.foliot.cycle import FOLIOT
from kernels.integrate import linear_flow
from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, COMES_TO_REST, GRAZING, INACCURATE, NEVER_STARTS, OK, OUT_OF_RANGE, STICKS
from kernels.lanes.columns import cells_at, one_row, write_row
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.ranges import partly
from kernels.lanes.records import read
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, where
from kernels.lanes.wiring import kernel, tracing
from kernels.maths.elementary import is_normal, larger
from kernels.maths.wide import over, size

FLIP_LIMIT = 1e6
"""The last flip that can be asked for."""
UNSURE = 0.5
"""Error of a speed, as a share of it, from which on it is open whether the switch was reached at all."""

Flip = namedtuple("Flip", "time low speed wrong late")
"""Time and its low part, speed, share by which the speed may be wrong, error of the time."""


@jit
def _held(scene, x):
    """Whether stiction holds at rest at x, and whether the last digits decide it."""
    rho_s, kappa = scene.rho_s, scene.kappa
    pull = fma(kappa, x, 1.0)
    unsure = (kappa > 0.0) & (magnitude(pull - rho_s) <= ROUNDING * (magnitude(kappa * x) + rho_s))
    return not_(pull > rho_s), unsure


@jit_call
def _near_miss(scene, energy, push, speed, way):
    """Whether a motion that turned before the switch lacked less than its energy is unsure by.

    It starts with `speed` and the force `push`; it lacked at most the force against it at the switch, times the way
    left.
    """
    against = fma(scene.kappa, way, -push)
    left = way - linear_flow.reach(0.5 * scene.d, scene.kappa, speed, push)
    rounding = 8.0 * ROUNDING * way * (magnitude(against) + 1.0 + scene.kappa * (1.0 + way))
    return left * against <= 2.0 * energy + rounding


@jit_call
def _release(scene, x, way):
    """The first flip, whether it comes, and whether the last digits decide that."""
    kappa, beta = scene.kappa, 0.5 * scene.d
    held, unsure = _held(scene, x)
    push = fma(kappa, x, scene.slack)
    time = linear_flow.first_crossing(beta, kappa, 0.0 * way, push, way)
    through = time < 1e300
    time = where(through, time, 0.0)
    s, _, slope = linear_flow.response(beta, kappa, time)
    speed = push * s
    rounded = ROUNDING * (1.0 + magnitude(kappa * x) / push)  # of the push
    wrong = rounded + ROUNDING * way * magnitude(push * slope) / (speed * speed)
    late = rounded * way / speed + ROUNDING * time
    near = (push > 0.0) & _near_miss(scene, 0.0 * way, push, 0.0 * way, way)
    unsure = unsure | (through & (wrong > UNSURE)) | (near & not_(through | held))
    return Flip(time, 0.0 * time, speed, wrong, late), through & not_(held), unsure


@jit_call
def _next(scene, flip):
    """The flip after `flip`, whether it comes, and whether the last digits decide that."""
    start = scene.e * flip.speed
    legs = _linear_swing.half_swing(0.0, scene, start)
    held, unsure = _held(scene, legs.top)
    turns = not_(start < 0.0)
    kept, longer, _, energy_noise, time_noise = _linear_swing.passed_on(scene, start, legs.speed, legs)
    wrong = fma(kept * start * start, flip.wrong, energy_noise) / (legs.speed * legs.speed)
    late = flip.late + magnitude(longer * start) * flip.wrong + time_noise
    energy = start * start * (flip.wrong + ROUNDING)
    near = _near_miss(scene, energy, legs.g2, legs.down, 1.0 + legs.top)
    unsure = (turns & unsure) | (legs.comes & (wrong > UNSURE)) | (near & not_(legs.comes))
    later = flip.time + legs.time
    low = flip.low + (legs.time - (later - flip.time))
    return Flip(later, low, legs.speed, wrong, late), legs.comes & not_(turns & held), unsure


@jit
def segments(first, columns, row):
    """Exact pieces from flip to flip; INACCURATE where their rounding may have added up beyond rtol.

    Flips asked for in falling order are followed from the release again.
    """
    i, flip = cells_at(first), columns.flip
    for number in flip:  # whole numbers from 1 on; NaN fails
        if not (1.0 <= number <= FLIP_LIMIT and number == math.floor(number)):
            columns.status[i] = BAD_INPUT
            return
    scene, units = _units.without_dimensions(read(LinearFoliot, columns, i))
    phi0, phi_start = columns.phi0[i], columns.phi_start[i]
    before = phi_start < phi0
    way = where(before, phi0 - phi_start, phi_start + phi0) / phi0  # 1 + x, with its digits for a start just before
    x = where(before, -phi_start, phi_start) / phi0
    fine = units.fine & is_normal(way)
    released, starts, doubt = _release(scene, x, where(fine, way, 1.0))
    now, going, unsure, here = released, starts, doubt, 1.0
    whole, accurate, given = fine, fine, not_(going)
    for j in range(flip.size):
        if flip[j] < here:
            now, going, here = released, starts, 1.0
        for _ in range(int(flip[j] - here)):
            if any_lane(going):
                new, comes, grazes = _next(scene, now)
                unsure = unsure | (going & grazes)
                going = going & comes
                now = choose(going, new, now)
        here = flip[j]
        time, speed = size(now.time + now.low, units.time), size(now.speed, over(units.angle, units.time))
        whole, given = whole & ((time > 0.0) & (speed > 0.0) | not_(going)), given | (time > 0.0) | (speed > 0.0)
        accurate = accurate & ((larger(now.late / now.time, now.wrong) <= columns.rtol[i]) | not_(going))
        write_row(first, j, where(going, time, math.nan), row, columns.flip_time)
        write_row(first, j, where(going, speed, math.nan), row, columns.flip_speed)
    verdict = where(accurate, where(going, OK, COMES_TO_REST), INACCURATE)
    held = not_(magnitude(fma(scene.kappa, x, 1.0)) > scene.rho_s)
    verdict = where(starts, verdict, where(held, NEVER_STARTS, STICKS))
    verdict = partly(whole, where(unsure, GRAZING, verdict))
    columns.status[i] = where(fine & given, verdict, OUT_OF_RANGE)


@jit
def check(p):
    """BAD_INPUT for stiction below the friction of motion; a clock that loses nothing may start."""
    return where(p.R_s >= p.R, OK, BAD_INPUT)


FOLIOT_START = kernel(
    "foliot_start",
    doc="the first flips of a verge and foliot from rest",
    source="Hoyng & Nieuwenhuizen, arXiv:1604.06681; terms beyond viscous friction derived here",
    parameters=(*FOLIOT.parameters, Field("phi_start", "rad", "angle of release from rest", default=0.0)),
    outputs=(
        Field("flip_time", "s", "time of the flip after the release; NaN if it never comes", dims=("flip",)),
        Field("flip_speed", "rad/s", "angular speed along the drive just before the switch",
              dims=("flip",)),
    ),
    along=(Field("flip", "1", "number of the flip, starting at 1", lower=1.0, upper=FLIP_LIMIT, integer=True),),
    check=check,
    methods=(
        tracing("segments", "exact pieces of linear terms, from switch to switch",
                segments, excludes=("c",), buffers=one_row),
    ),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0},
)  # fmt: skip
