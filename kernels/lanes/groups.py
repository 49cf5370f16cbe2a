"""Loops over groups of cells that share buffers: for traces and noise, which no column of one value a cell can hold.

A body gets the number of its first cell; `cells_at(first)` is the index of the group's cells in a column, and
`cells_at(j * GROUP)` of the j-th row of a buffer. Compiled, a group is WIDTH lanes; in plain Python it is one cell.
"""

import operator

import numpy as np

from kernels.lanes.inlining import LINE
from kernels.lanes.jit import COMPILED, jit
from kernels.lanes.vectors import WIDTH, lanes_at

GROUP = WIDTH if COMPILED else 1
"""Cells of a group."""

cells_at = lanes_at if COMPILED else operator.index


@jit
def room(rows):
    """Space for that many rows of a group, from the border of a cache line on: no register straddles two of them."""
    spare = LINE // 8
    space = np.empty(rows * GROUP + spare)
    first = (spare - np.int64(space.ctypes.data) // 8 % spare) % spare
    return space[first : first + rows * GROUP]


@jit
def one_row():
    """The buffer of one row."""
    return (np.empty(GROUP),)


@jit
def write_row(first, j, values, row, trace):
    """trace[first + cell, j] = values[cell] for the cells of a group, through `row`, a buffer of one row."""
    row[cells_at(0)] = values
    for cell in range(GROUP):
        trace[first + cell, j] = row[cell]
