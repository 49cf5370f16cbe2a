"""Cells of very different length in lanes: a lane that has finished its cell is given the next one.

A *memory* has a row for each number that a lane knows between two events, and a column for each lane. The first row is
the lane's stage; then come its cell's inputs. `advance(memory, i)` takes every lane on until one has finished, or for a
limited number of events or steps, and returns whether one has; i is the index of all lanes, or 0 in plain Python,
where there is one.
"""

import numpy as np

from kernels.lanes.jit import COMPILED, jit
from kernels.lanes.vectors import WIDTH, lanes_at

LANES = WIDTH if COMPILED else 1
IDLE, FRESH, MOVING, DONE = 0.0, 1.0, 2.0, 3.0
"""Stages of a lane; `advance` begins a fresh one and says when it is done."""

_index_of_all = lanes_at if COMPILED else int


def fresh(numbers, inputs):
    """Cells before anything runs: of so many numbers each, of which the first behind the stage are the inputs."""
    cells = np.zeros((len(inputs[0]), numbers))
    cells[:, 0] = FRESH
    cells[:, 1 : 1 + len(inputs)] = np.transpose(inputs)
    return cells


@jit
def _give(memory, lane, cells, cell):
    """Puts a cell into a lane; with none left the lane keeps its last one, idle."""
    if cell < cells.shape[0]:
        for row in range(cells.shape[1]):
            memory[row, lane] = cells[cell, row]
    else:
        memory[0, lane] = IDLE


@jit
def _take(memory, lane, cells, cell):
    for row in range(cells.shape[1]):
        cells[cell, row] = memory[row, lane]


def to_the_end(run, cells):
    """Runs every cell, (n_cells, numbers that a lane knows), by a compiled `each_refilled`."""
    run(cells, np.zeros((cells.shape[1], LANES)), np.zeros(LANES, np.int64))


@jit
def each_refilled(advance, cells, memory, held):
    """Every cell to its end.

    Parameters
    ----------
    cells : (n_cells, numbers that a lane knows), fresh or moving; in the end all are done
    memory, held : zeros, a row for each number, and the lanes' cells; numba takes long to compile what makes arrays
    """
    n = cells.shape[0]
    for lane in range(LANES):
        held[lane] = lane if lane < n else n - 1
        _give(memory, lane, cells, held[lane])
        memory[0, lane] = memory[0, lane] if lane < n else IDLE
    handed, left = LANES, n
    while left > 0:  # every lane ends: cells have a limit of events and each event one of steps
        if not advance(memory, _index_of_all(0)):
            continue
        for lane in range(LANES):
            if memory[0, lane] == DONE:
                _take(memory, lane, cells, held[lane])
                left -= 1
                held[lane] = handed
                _give(memory, lane, cells, handed)
                handed += 1
