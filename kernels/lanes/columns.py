"""Loops over columns of cells, alone, in groups or refilled, and the entry functions that the engine calls.

A *group* is a set of cells that share buffers, for traces and noise, which have many values per cell. A body of
`in_groups` gets the number of its first cell; `cells_at(first)` is the index of the group's cells in a column, and
`cells_at(j * GROUP)` that of the j-th row of a buffer. A compiled group has WIDTH lanes; in plain Python it is one
cell.

Cells of very different duration are *refilled*: a lane that has finished its cell continues with the next one. There
are FEW lanes. A *memory* has a row for each number that a lane stores between two events, and a column for each lane.
The first row is the lane's stage, followed by its cell's inputs. `advance(memory, i)` advances all lanes until one has
finished, or for a limited number of events or steps, and returns whether one has; i is the index of all lanes. A lane
that delays the others may be *paused*: its cell continues later from the previous event, with others of that kind.
"""

import numpy as np

from kernels.lanes import vectors
from kernels.lanes.inlining import LINE
from kernels.lanes.jit import COMPILED, cached, jit, jit_entry

GROUP = vectors.WIDTH if COMPILED else 1
"""Cells of a group."""
FEW = vectors.FEW if COMPILED else 1
"""Lanes that are refilled, and cells side by side of what else steps or recurs for long."""
IDLE, FRESH, MOVING, DONE, PAUSED = 0.0, 1.0, 2.0, 3.0, 4.0
"""Stages of a lane that is refilled; `advance` begins a fresh one and says when it is done, or paused."""

cells_at, few_at = vectors.lanes_at, vectors.few_at

_ROWS = np.minimum.outer(np.arange(GROUP), np.arange(GROUP))
"""Of so many cells and one more, the cell in each lane."""


def entry_of(function, per_cell, kept, read=0):
    """Makes a function of columns one that the engine can call; `kept`: its machine code, on the disk.

    `per_cell` says which columns hold one cell a row (None: few cells need no filling up); the first `read` are only
    read. Fewer cells than lanes are filled up with copies of the last one, so that no second version for one cell is
    compiled.
    """
    if not COMPILED:
        return function
    compiled = cached(function) if kept else jit_entry(function)

    def call(*columns):
        n = len(columns[0])
        if per_cell is None:
            compiled(*(c if c.flags.writeable else c.copy() for c in columns))
        elif n >= GROUP:
            compiled(*columns)
        elif n:
            full = [c[_ROWS[n - 1]] if cells else c for c, cells in zip(columns, per_cell, strict=True)]
            compiled(*full)
            for column, result in zip(columns[read:], full[read:], strict=True):
                if column is not result and column.flags.writeable:
                    column[...] = result[:n]

    call.compiled = compiled
    return call


def _looped(index, width):
    """A loop that calls a body with the index of so many cells at a time; the last ones once more beside others."""

    @jit
    def loop(body, columns, buffers):
        n = columns[0].shape[0]
        for i in range(0, n, width):
            body(index(min(i, n - width)), columns, *buffers)

    return loop


def _plain(body, columns, buffers):
    with np.errstate(all="ignore"):
        for i in range(columns[0].shape[0]):
            body(i, columns, *buffers)


in_lanes = _looped(cells_at, GROUP) if COMPILED else _plain
in_few_lanes = _looped(few_at, FEW) if COMPILED else _plain
cell_by_cell = _looped(np.int64, 1) if COMPILED else _plain
in_groups = _looped(np.int64, GROUP) if COMPILED else _plain


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


def to_eight_bits(column):
    """A column to eight bits: the last digits of a library's powers and functions are those of one processor."""
    mantissa, exponent = np.frexp(column)
    return np.ldexp(np.rint(256.0 * mantissa), exponent - 8)


def fresh(numbers, inputs):
    """Cells before anything runs: of so many numbers each, of which the first behind the stage are the inputs."""
    cells = np.zeros((len(inputs[0]), numbers))
    cells[:, 0] = FRESH
    cells[:, 1 : 1 + len(inputs)] = np.transpose(inputs)
    return cells


def to_the_end(run, cells):
    """Runs every cell, (n_cells, numbers that a lane knows), by a compiled `each_refilled`."""
    memory, held = np.zeros((cells.shape[1], FEW)), np.zeros(FEW, np.int64)
    with np.errstate(all="ignore"):  # of plain Python
        run(cells, memory, held)
        while len(paused := np.flatnonzero(cells[:, 0] < DONE)):
            some = cells[paused]
            run(some, memory, held)
            cells[paused] = some


@jit
def each_refilled(advance, cells, memory, held):
    """Every cell to its end, but for those that have been paused, which are as they were at their last event.

    Parameters
    ----------
    cells : (n_cells, numbers that a lane knows), fresh or moving; in the end done or moving
    memory, held : room for the memory, and for the lanes' cells; numba takes long to compile what makes arrays
    """
    n = cells.shape[0]
    for lane in range(FEW):
        held[lane] = lane if lane < n else n - 1
        _give(memory, lane, cells, held[lane])
        memory[0, lane] = memory[0, lane] if lane < n else IDLE
    handed, left = FEW, n
    while left > 0:  # every lane ends: cells have a limit of events and each event one of steps
        if not advance(memory, few_at(0)):
            continue
        for lane in range(FEW):
            if memory[0, lane] >= DONE:
                for row in range(cells.shape[1]):
                    cells[held[lane], row] = memory[row, lane]
                cells[held[lane], 0] = DONE if memory[0, lane] == DONE else MOVING
                left -= 1
                held[lane] = handed
                _give(memory, lane, cells, handed)
                handed += 1


@jit
def _give(memory, lane, cells, cell):
    """Puts a cell into a lane; with none left the lane keeps its last one, idle."""
    if cell < cells.shape[0]:
        for row in range(cells.shape[1]):
            memory[row, lane] = cells[cell, row]
    else:
        memory[0, lane] = IDLE
