"""What the kernels of linkages share: lengths without units, and the verdict on the linkage."""

from typing import NamedTuple

from kernels.lanes.codes import OUT_OF_RANGE
from kernels.lanes.jit import jit
from kernels.lanes.vectors import magnitude, where
from kernels.polisher import extremes
from kernels.polisher.linkage import Lengths, Margins, in_units, margins

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
