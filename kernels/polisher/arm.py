"""Polishing machine: extreme angles, rates and distortion of the arm that a crank swings.

    eta_+- = +-arccos((b^2 + d^2 - (f +- e)^2)/(2 b d)),  first sign + for type A, - for type B      (1)
    A0 = (eta_plus + eta_minus)/2,  A1 = abs(eta_plus - eta_minus)/2                                 (2)
b is the distance of the motor from the arm's pivot, e the crank (eccentricity), d the arm from its pivot to the coupler
f. Angles are from b: eta_plus, eta_minus those of the arm at its extremes, theta_plus, theta_minus those of the crank
there. Leaves out: play, bending, and the tool itself (`polisher_motion`).
Source: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (37)-(40), without the misprint in (40). The paper
does not ask whether the motor can turn; here the `status` says so, decided by error-free sums.

OK: the crank turns and the arm swings. Remarks, with the outputs that exist: LOCK_UP (`theta_lock`: where the crank
locks, to either side of b, nearest first), DOUBLE_CRANK (e > b, the arm turns fully: rates and transmission angle),
CHANGE_POINT (a deciding sum is 0 to within rounding of the lengths, 2^-53 of their sum: angles of the linkage, possibly
flat; no rates or derivatives). With e = 0 nothing swings, and crank angles are limits for e towards 0. Lengths with
ratios beyond 1e36 are OUT_OF_RANGE.
"""

import math
from collections import namedtuple

from kernels.interface import FIRST_REFUSAL, Field
from kernels.lanes.codes import CHANGE_POINT, DOUBLE_CRANK, INACCURATE, LOCK_UP, OK
from kernels.lanes.columns import cells_at
from kernels.lanes.jit import jit
from kernels.lanes.ranges import or_none
from kernels.lanes.records import named, read, write
from kernels.lanes.tuples import times
from kernels.lanes.vectors import any_lane, choose, magnitude, not_, pow2, where
from kernels.lanes.wiring import kernel, method, tracing
from kernels.polisher import _motor_waveform, extremes
from kernels.polisher.extremes import ROUNDING, UNIT_LIMIT, judged, said
from kernels.polisher.linkage import EXAMPLE, PARAMETERS, side_of

Linkage = namedtuple("Linkage", [field.name for field in PARAMETERS])

OUTPUTS = (
    Field("A0", "rad", "middle between the arm's extremes, from b; negative for type B"),
    Field("A1", "rad", "half amplitude of the arm"),
    Field("eta_plus", "rad", "angle of the arm where crank and coupler are stretched; negative for type B"),
    Field("eta_minus", "rad", "angle of the arm where crank and coupler are folded; negative for type B"),
    Field("theta_plus", "rad", "crank angle from b at eta_plus"),
    Field("theta_minus", "rad", "crank angle from b at eta_minus"),
    Field("theta_lock", "rad", "crank angle from b where it locks, to either side; the one nearest to 0", gaps=True),
    Field("theta_lock_outer", "rad", "the other one, if the crank locks at both ends of its range", gaps=True),
    Field("transmission_angle", "rad", "least angle between coupler and arm over the turn"),
    Field("thd", "1", "total harmonic distortion of the swing, relative to its first harmonic"),
    Field("rate_max", "1", "largest angular rate of the arm per rate of the crank"),
    Field("rate_min", "1", "smallest (most negative) angular rate of the arm per rate of the crank"),
    Field("A0_b", "rad/m", "derivative of A0 by b"),
    Field("A0_d", "rad/m", "derivative of A0 by d"),
    Field("A0_f", "rad/m", "derivative of A0 by f"),
    Field("A0_e", "rad/m", "derivative of A0 by e"),
    Field("A1_b", "rad/m", "derivative of A1 by b"),
    Field("A1_d", "rad/m", "derivative of A1 by d"),
    Field("A1_f", "rad/m", "derivative of A1 by f"),
    Field("A1_e", "rad/m", "derivative of A1 by e"),
)

RATES = ("thd", "rate_max", "rate_min")
"""Outputs of the motion over a turn."""

Swing = namedtuple("Swing", [field.name for field in OUTPUTS if field.name not in RATES])


@jit
def _swing(p, cell):
    """The closed forms of type A, mirrored for type B, where what they name exists."""
    lengths, unit, margin, code = cell
    swings, bent = said(code, OK), said(code, CHANGE_POINT)
    rocks, locked = swings | (bent & (lengths.e <= lengths.b)), said(code, LOCK_UP)
    angles, mean_by, swing_by = extremes.extremes(lengths, extremes.flattened(lengths, margin))
    sign = or_none(side_of(p.type), rocks)

    none = 0.0 * code + math.nan
    locks = none, none
    if any_lane(locked):
        locks = choose(locked, extremes.locks(lengths, margin), locks)
    moves = swings | said(code, DOUBLE_CRANK) | bent
    transmission = where(moves, extremes.transmission(lengths, margin), or_none(0.0, locked))

    per_unit = or_none(pow2(-where(magnitude(unit) <= UNIT_LIMIT, unit, 0.0)), swings)
    slopes = times(side_of(p.type) * per_unit, mean_by) + times(per_unit, swing_by)
    mirrored = times(sign, angles)
    outputs = mirrored[0], or_none(angles[1], rocks), *mirrored[2:], *locks, transmission, *slopes
    return named(Swing, outputs)


@jit
def stable(p, rtol):
    """Half-angle forms of sums without error."""
    cell = judged(p)
    return _swing(p, cell), cell.code


@jit
def _waveform(first, columns, turn):
    """As `stable`, and then the motion over a turn; `_motor_waveform` estimates the rounding of that."""
    i = cells_at(first)
    p, rtol = read(Linkage, columns, i), columns.rtol[i]
    cell = judged(p)
    write(columns, i, _swing(p, cell))
    thd, doubt = _motor_waveform.distortion(cell.lengths, cell.margin, turn)
    most, least, rate_doubt = _motor_waveform.rates(cell.lengths, cell.margin, turn)
    swings = said(cell.code, OK)
    turns = swings | said(cell.code, DOUBLE_CRANK)
    columns.thd[i] = or_none(thd, swings)
    columns.rate_max[i], columns.rate_min[i] = or_none(most, turns), or_none(least, turns)
    wide = (turns & not_(rate_doubt <= rtol)) | (swings & not_(doubt <= rtol)) | not_(rtol >= ROUNDING)
    columns.status[i] = where(wide & (cell.code < FIRST_REFUSAL), INACCURATE, cell.code)


POLISHER = kernel(
    "polisher",
    doc="swing of a polishing machine's arm: middle, amplitude, distortion, speeds",
    source="Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (37)-(40); stable forms derived here",
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    record=Linkage,
    methods=(
        method("stable", "half-angle forms of error-free sums", stable, ROUNDING, lacks=RATES),
        tracing(
            "waveform",
            "as stable, with integrals and extremes of the rate over a turn",
            _waveform,
            buffers=_motor_waveform.buffers,
        ),
    ),
    example=EXAMPLE,
)
