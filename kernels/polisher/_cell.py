"""What every method of `polisher` shares: lengths without units, the verdict on the linkage, and which values exist."""

import math
from typing import NamedTuple

from kernels.lanes.codes import CHANGE_POINT, DOUBLE_CRANK, LOCK_UP, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit
from kernels.lanes.ranges import or_none
from kernels.lanes.vectors import any_lane, choose, magnitude, pow2, where
from kernels.polisher import extremes
from kernels.polisher.extremes import Angles, Locks, Slopes
from kernels.polisher.linkage import Lengths, Margins, in_units, margins, side_of

ROUNDING = 3e-15
"""What closed forms are right to."""
UNIT_LIMIT = 720.0
"""Power of two of the longest length, beyond which derivatives would leave float64."""


class Cell(NamedTuple):
    """Lengths without units, their unit and margins, and the verdict on the linkage."""

    lengths: Lengths
    unit: float
    margin: Margins
    code: float


class Swing(NamedTuple):
    """Outputs of a closed form."""

    angles: Angles
    locks: Locks
    transmission_angle: float
    slopes: Slopes


class Rates(NamedTuple):
    """Outputs of the motion over a turn."""

    thd: float
    rate_max: float
    rate_min: float


@jit
def said(code, status):
    """Whether the code of a cell is that status."""
    return magnitude(code - status) < 0.5


@jit
def judged(p):
    """The `Cell` of a record with b, d, f, e."""
    lengths, unit, fine = in_units(p)
    margin = margins(lengths)
    code = extremes.verdict(lengths, margin)
    return Cell(lengths, unit, margin, where(fine & (magnitude(unit) <= UNIT_LIMIT), code, OUT_OF_RANGE))


@jit
def rocks(cell):
    """Whether the arm has extremes: it swings, or would but for a change point."""
    return said(cell.code, OK) | (said(cell.code, CHANGE_POINT) & (cell.lengths.e <= cell.lengths.b))


@jit
def turns(cell):
    """Whether the crank turns fully, so that the motion has rates."""
    return said(cell.code, OK) | said(cell.code, DOUBLE_CRANK)


@jit
def moves(cell):
    """Whether the crank turns fully, be it past a change point."""
    return turns(cell) | said(cell.code, CHANGE_POINT)


@jit
def _none(cell):
    return 0.0 * cell.code + math.nan


@jit
def locks(cell):
    """Crank angles at which a linkage locks; computed only where one does."""
    none = _none(cell)
    found, locked = Locks(none, none), said(cell.code, LOCK_UP)
    if any_lane(locked):
        return choose(locked, extremes.locks(cell.lengths, cell.margin), found)
    return found


@jit
def mirrored(angles, sign):
    """Angles of a linkage of type A as those of the type with that sign; NaN for the sign NaN."""
    return Angles(
        sign * angles.A0,
        or_none(angles.A1, sign > -math.inf),
        sign * angles.eta_plus,
        sign * angles.eta_minus,
        sign * angles.theta_plus,
        sign * angles.theta_minus,
    )


@jit
def _per_metre(slopes, per_metre, side):
    """Derivatives without units, of type A, by lengths in metres."""
    of_mean = side * per_metre
    return Slopes(
        of_mean * slopes.A0_b,
        of_mean * slopes.A0_d,
        of_mean * slopes.A0_f,
        of_mean * slopes.A0_e,
        per_metre * slopes.A1_b,
        per_metre * slopes.A1_d,
        per_metre * slopes.A1_f,
        per_metre * slopes.A1_e,
    )


@jit
def swing(type, cell, angles, transmission, slopes):
    """What exists of the values that the linkage would have as type A; the others are as `Swing` has them."""
    side, unit = side_of(type), where(magnitude(cell.unit) <= UNIT_LIMIT, cell.unit, 0.0)
    pressed = where(moves(cell), transmission, or_none(0.0, said(cell.code, LOCK_UP)))
    per_metre = or_none(pow2(-unit), said(cell.code, OK))
    there = mirrored(angles, or_none(side, rocks(cell)))
    return Swing(there, locks(cell), pressed, _per_metre(slopes, per_metre, side))
