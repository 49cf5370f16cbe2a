"""Balance with viscous and solid friction, released from rest: how it comes to rest.

    I th'' + c th' + k th +- R = 0,  + for th' > 0;  zeta = c/(2 sqrt(I k)),  r = R/k                (1)
It rests at the first turning point where abs(theta) <= r_s; theta is measured from the spring's zero, and r_s = R_s/k
is the stiction, as an angle. Leaves out: an escapement (`balance_driven`), friction that varies with the position.
Source: "Theory of Horology", section 2-3; the count of half swings is derived in `_ringdown`.

Where there is no such end, the cell is remarked and what exists is given: OVERDAMPED for zeta >= 1 (never turns, creeps
to r on the side of release, where `stop_angle` is), NEVER_ENDS without any solid friction (a motion of any length is:
it fades to 0 and never ends). GRAZING: the count hangs on the last digits of the input. PARTLY_OUT_OF_RANGE: an output,
such as the angle of rest near critical damping without friction of motion, is too small or too large for a float64.
"""

import math

from kernels.balance import _ringdown
from kernels.balance._ringdown import RECURSION_LIMIT
from kernels.interface import Field, Kernel, Method
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
    STEP_LIMIT,
)
from kernels.lanes.columns import each_cell, entry
from kernels.lanes.jit import jit
from kernels.lanes.ranges import or_none, partly
from kernels.lanes.vectors import isnt, magnitude, nearest, where
from kernels.maths.elementary import NORMAL_HIGH, NORMAL_LOW, is_normal, scale

ROUNDING = 2e-15
"""What `closed` is right to."""


@jit
def side(theta0, swings):
    """+1 or -1: the sign of theta after so many half swings, for swings < 2^50."""
    half = 0.5 * swings
    odd = magnitude(nearest(half) - half) > 0.25
    return where(odd, -1.0, 1.0) * where(theta0 < 0.0, -1.0, 1.0)


@jit
def half_swing_time(zeta, omega_n):
    """pi/(w sqrt(1 - zeta^2)) [s], untouched by solid friction."""
    return math.pi / (omega_n * _ringdown.decrement(zeta)[1][0])


@jit
def _verdict(ring, scene, rtol, unsettled, faint):
    """The status of a swinging cell; an angle of rest too `faint` for a float64 is not asked for its error."""
    _, last, margin, grazes, doubt, unsure = ring
    loose = isnt(faint | (doubt <= rtol * magnitude(last))) | isnt(doubt <= rtol * margin * scene[2])
    verdict = where(grazes, GRAZING, where(loose, INACCURATE, OK))
    return where(unsure, unsettled, verdict)


@jit
def _write(
    i, scene, units, ring, rtol, unsettled, omega_n, theta0, half_swings, stop_angle, stop_time, margin, period, status
):
    """One cell, or the lanes', in SI units; overdamped and endless motions get what exists of them."""
    zeta, r, r_s, start = scene
    count, last, distance = ring[0], ring[1], ring[2]
    e, fine = units
    creeps, moves = zeta >= 1.0, start > r_s
    endless = moves & isnt(creeps) & isnt((r > 0.0) | (r_s > 0.0))
    half = half_swing_time(where(creeps, 0.0, zeta), omega_n)
    whole = where((count < _ringdown.COUNT_LIMIT) & isnt(creeps), count, 0.0)
    angle = side(theta0, whole) * where(creeps & moves, r, where(endless, 0.0, last))
    angle = where(moves, scale(angle, e), theta0)
    time = where(moves, count * half, 0.0)
    away = where(r_s > 0.0, magnitude(start - r_s) / _ringdown.unit(r_s), math.nan)
    distance = where(creeps, away, where(r_s > 0.0, distance, 0.0))
    lasting = isnt((creeps & moves) | endless)
    faded = isnt(r > 0.0) & lasting  # to a positive angle, however small
    faint = moves & (magnitude(angle) < NORMAL_LOW) & (faded | (magnitude(angle) > 0.0))
    timed = is_normal(half) & is_normal(2.0 * half)
    ends = timed & isnt(time > NORMAL_HIGH)
    half_swings[i] = where(creeps, 0.0, or_none(count, isnt(endless) & isnt(count > NORMAL_HIGH)))
    stop_angle[i], stop_time[i] = or_none(angle, isnt(faint)), or_none(time, lasting & (ends | isnt(time > 0.0)))
    margin[i], period[i] = or_none(distance, isnt(endless)), or_none(2.0 * half, timed & isnt(creeps))
    whole = isnt(faint) & (creeps | (timed & (ends | isnt(lasting))))
    verdict = where(start > 0.0, _verdict(ring, scene, rtol, unsettled, faint), OK)
    verdict = where(creeps, OVERDAMPED, where(endless, NEVER_ENDS, verdict))
    status[i] = where(fine, partly(whole, verdict), OUT_OF_RANGE)


@jit
def without_units(zeta, r, r_s, theta0):
    """The scene, the exponent of its unit, and whether it is in range."""
    r, r_s, start, e, fine = _ringdown.in_units(r, r_s, theta0)
    return (zeta, r, r_s, start), (e, fine)


@jit
def swinging(scene):
    """The scene with a tame damping where it is overdamped and nothing is counted."""
    zeta, r, r_s, start = scene
    return where(zeta < 1.0, zeta, 0.5), r, r_s, start


@jit
def _closed(i, zeta, omega_n, r, r_s, theta0, rtol, *outputs):
    scene, units = without_units(zeta[i], r[i], r_s[i], theta0[i])
    ring = _ringdown.closed(swinging(scene))
    _write(i, scene, units, ring, rtol[i], NOT_CONVERGED, omega_n[i], theta0[i], *outputs)


@entry()
def closed(zeta, omega_n, r, r_s, theta0, rtol, half_swings, stop_angle, stop_time, margin, period, status):
    """The count by formula, confirmed by the turning points on both sides of it in 32 digits."""
    each_cell(
        _closed,
        (zeta, omega_n, r, r_s, theta0, rtol, half_swings, stop_angle, stop_time, margin, period, status),
    )


@entry("asked")
def closed_bound(zeta, omega_n, r, r_s, theta0, rtol, asked, out):
    """Rounding; where the differences of (3) in `_ringdown` lose more, the status says so."""
    out[:] = ROUNDING


@jit
def _recursion(i, zeta, omega_n, r, r_s, theta0, rtol, *outputs):
    scene, units = without_units(zeta[i], r[i], r_s[i], theta0[i])
    ring = _ringdown.recursion(swinging(scene))
    _write(i, scene, units, ring, rtol[i], STEP_LIMIT, omega_n[i], theta0[i], *outputs)


@entry()
def recursion(zeta, omega_n, r, r_s, theta0, rtol, half_swings, stop_angle, stop_time, margin, period, status):
    """Half swing by half swing; what rounding may have come to is added up beside it."""
    each_cell(
        _recursion,
        (zeta, omega_n, r, r_s, theta0, rtol, half_swings, stop_angle, stop_time, margin, period, status),
    )


@jit
def allowed(zeta, omega_n, r, r_s, theta0):
    """Whether the parameters are numbers within their limits; NaN fails."""
    positive = (zeta >= 0.0) & (omega_n > 0.0) & (r >= 0.0) & (r_s >= r)
    finite = (zeta < math.inf) & (omega_n < math.inf) & (r_s < math.inf) & (magnitude(theta0) < math.inf)
    return positive & finite


@jit
def _check(i, zeta, omega_n, r, r_s, theta0, status):
    fine = allowed(zeta[i], omega_n[i], r[i], r_s[i], theta0[i])
    lossless = isnt((zeta[i] > 0.0) | (r[i] > 0.0)) & (magnitude(theta0[i]) > r_s[i])
    status[i] = where(fine, where(lossless, NO_LIMIT_CYCLE, OK), BAD_INPUT)


@entry()
def check(zeta, omega_n, r, r_s, theta0, status):
    """What no method is asked.

    BAD_INPUT: NaN, infinite, outside its limits, or stiction below the friction of motion. NO_LIMIT_CYCLE: nothing that
    takes energy from a balance that swings.
    """
    each_cell(_check, (zeta, omega_n, r, r_s, theta0, status))


PARAMETERS = (
    Field("zeta", "1", "viscous damping ratio c/(2 sqrt(I k))", lower=0.0),
    Field("omega_n", "rad/s", "angular frequency without friction, sqrt(k/I)", lower=0.0, open_lower=True),
    Field("r", "rad", "solid friction torque over spring stiffness, R/k", lower=0.0),
    Field("r_s", "rad", "stiction over spring stiffness, at least r", default="r", lower=0.0, open_lower=True),
    Field("theta0", "rad", "angle of release, from rest"),
)

EXAMPLE = {"zeta": 0.002, "omega_n": 5 * math.pi, "r": 0.01, "theta0": 4.5}

BALANCE = Kernel(
    name="balance",
    doc="ring-down of a balance with viscous and solid friction",
    source='"Theory of Horology", section 2-3, equations (3) and (10); the count is derived here',
    parameters=PARAMETERS,
    outputs=(
        Field("half_swings", "1", "half swings until rest", integer=True),
        Field("stop_angle", "rad", "angle of rest, from the spring's zero"),
        Field("stop_time", "s", "time from release to rest"),
        Field("margin", "1", "least distance of abs(theta) at a turning point from r_s, over r_s"),
        Field("period", "s", "time of two half swings, the same for each"),
    ),
    check=check,
    methods=(
        Method("closed", "formula of the count, confirmed in 32 digits", closed, closed_bound),
        Method("recursion", f"half swing by half swing, up to {RECURSION_LIMIT}", recursion),
    ),
    example=EXAMPLE,
)
