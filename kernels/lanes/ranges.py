"""Cells with some outputs outside the range of float64: these outputs are NaN, and the others keep their values."""

import math

from kernels.interface import FIRST_REFUSAL
from kernels.lanes.codes import OUT_OF_RANGE, PARTLY_OUT_OF_RANGE
from kernels.lanes.jit import jit
from kernels.lanes.vectors import where


@jit
def or_none(x, exists):
    """A number where it exists, else NaN."""
    return where(exists, x, math.nan)


@jit
def partly(whole, verdict):
    """The verdict, or that not all outputs could be held: another remark says more than that, and stays."""
    return where(whole | (verdict > 0.0), verdict, PARTLY_OUT_OF_RANGE)


@jit
def judged(sound, whole, verdict):
    """The verdict on a cell by whether its outputs mean anything, and whether all of them could be held."""
    verdict = partly(whole, verdict)
    return where(sound | (verdict >= FIRST_REFUSAL), verdict, OUT_OF_RANGE)
