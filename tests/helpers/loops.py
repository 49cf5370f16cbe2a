"""Loops of a function of one cell over columns, each given by itself: `entry` makes such a loop one for Python."""

from kernels.lanes.columns import cell_by_cell, in_groups, in_lanes
from kernels.lanes.jit import jit


@jit
def _taken_apart(i, columns, body):
    body(i, *columns)


@jit
def each_cell(body, columns):
    """body(i, *columns) for all cells, in lanes."""
    in_lanes(_taken_apart, columns, (body,))


@jit
def one_by_one(body, columns):
    """The same one cell at a time."""
    cell_by_cell(_taken_apart, columns, (body,))


@jit
def each_group(body, columns):
    """The same of groups that share buffers, by the number of their first cell."""
    in_groups(_taken_apart, columns, (body,))
