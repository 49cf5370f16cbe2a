"""Cells of very different length in lanes: a lane that has finished its cell is given the next one.

A *memory* has a row for each number that a lane knows between two events, and a column for each lane. The first row is
the lane's stage; then come its cell's inputs, then its results. `advance(memory, i)` takes every lane one event further
and returns whether one has finished; i is the index of all lanes, or 0 in plain Python, where there is one.
"""

import numpy as np

from kernels._jit import COMPILED, jit
from kernels._lanes import WIDTH, lanes_at

LANES = WIDTH if COMPILED else 1
IDLE, FRESH, MOVING, DONE = 0.0, 1.0, 2.0, 3.0
"""Stages of a lane; `advance` begins a fresh one and says when it is done."""

_index_of_all = lanes_at if COMPILED else int


@jit
def _give(memory, lane, inputs, cell):
    """Puts a cell into a lane; with none left the lane keeps its last one, idle."""
    if cell < inputs.shape[1]:
        for row in range(inputs.shape[0]):
            memory[1 + row, lane] = inputs[row, cell]
        memory[0, lane] = FRESH
    else:
        memory[0, lane] = IDLE


@jit
def _take(memory, lane, results, cell, first):
    for row in range(results.shape[0]):
        results[row, cell] = memory[first + row, lane]


@jit
def _busy(memory):
    busy = False
    for lane in range(LANES):
        busy = busy or memory[0, lane] == MOVING or memory[0, lane] == FRESH
    return busy


@jit
def each_refilled(advance, inputs, results, rows, together):
    """Every cell to its end.

    Parameters
    ----------
    inputs, results : arrays of a row per number and a column per cell
    rows : of the memory
    together : refill no lane before all have finished, as lanes in lockstep do; the rival that this is measured against
    """
    memory = np.zeros((rows, LANES))
    cells = np.zeros(LANES, np.int64)
    first = 1 + inputs.shape[0]
    n = inputs.shape[1]
    for lane in range(LANES):
        cells[lane] = min(lane, n - 1)
        _give(memory, lane, inputs, cells[lane])
        memory[0, lane] = FRESH if lane < n else IDLE
    handed, left = LANES, n
    while left > 0:  # every lane ends: `advance` limits its events
        finished = advance(memory, _index_of_all(0))
        if not finished or (together and _busy(memory)):
            continue
        for lane in range(LANES):
            if memory[0, lane] == DONE:
                _take(memory, lane, results, cells[lane], first)
                left -= 1
                cells[lane] = handed
                _give(memory, lane, inputs, handed)
                handed += 1
