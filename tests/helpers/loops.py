"""Loops of a function of one cell over columns, each given by itself: `entry` makes such a loop one for Python."""

import inspect

from kernels.lanes.columns import entry_of, in_lanes
from kernels.lanes.jit import jit


def entry(function):
    """A function of columns, each of one cell a row, as the engine would call it."""
    return entry_of(function, [True] * len(inspect.signature(function).parameters), kept=True)


@jit
def _taken_apart(i, columns, body):
    body(i, *columns)


@jit
def each_cell(body, columns):
    """body(i, *columns) for all cells, in lanes."""
    in_lanes(_taken_apart, columns, (body,))
