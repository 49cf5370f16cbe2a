"""Loops of a function of one cell over columns, each given by itself: `entry` makes such a loop one for Python."""

from kernels.lanes.columns import in_lanes
from kernels.lanes.jit import jit


@jit
def _taken_apart(i, columns, body):
    body(i, *columns)


@jit
def each_cell(body, columns):
    """body(i, *columns) for all cells, in lanes."""
    in_lanes(_taken_apart, columns, (body,))
