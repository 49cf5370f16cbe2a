"""Columns of cells followed by the Taylor method of a scene's module, and how far the result can be believed.

Each step is right to a tolerance; what many steps come to depends on the scene. So a cell is followed twice, the second
time with a tolerance FINER times smaller: the first run's error is what they differ by, the second's is about FINER
times less, and is what is given. The first run's parameters are some roundings off (`off_by_roundings`): so what a
scene makes of rounding, which both runs would share, is seen too.
"""

import numpy as np

from kernels._refill import LANES
from kernels._vecmath import NORMAL_HIGH, NORMAL_LOW
from kernels.interface import FIRST_REFUSAL, Status

LOW_ORDER, HIGH_ORDER = 14, 20
HIGH_BELOW = 1e-10
"""Tolerance of a step from which on the higher order is the faster."""
FINEST = 1e-25
ROUNDING = 1e-14
"""The least rtol that is promised, whatever the two runs agree to."""
FEW = 3
"""Switches after which a cell's steps between two of them are known well enough."""
ROUGH, FINER = 2.0, 16.0
ROUNDINGS, GOLDEN = 8.0, 0.6180339887498949
"""By how many roundings a parameter is changed at most, and what makes that differ from one to the next."""
APART = 8.0
"""How many rtol the two runs may differ by: the finer one is then right to rtol/2."""


def followed(module, columns, rtol, finer=1.0, together=False):
    """The results of a cell a column: time, interval, states, their sizes, and as the last row the status.

    Parameters
    ----------
    columns : the parameters and the number of switches
    rtol : tolerance of each step, a column; it chooses the order
    finer : by how much the steps are to be better than that
    together : lanes in lockstep, in the order of the cells
    """
    inputs = np.array([*columns, np.maximum(rtol / finer, FINEST)])
    results = np.full((5 + 2 * len(module.STATES), inputs.shape[1]), np.nan)
    high = rtol < HIGH_BELOW
    for run, cells in ((module.run_14, ~high), (module.run_20, high)):
        if cells.any():
            chosen = np.ascontiguousarray(inputs[:, cells])
            found = np.full((len(results), chosen.shape[1]), np.nan)
            run(chosen, found, True) if together else _dealt(run, chosen, found)
            results[:, cells] = found
    return np.delete(results, (-3, -2), axis=0)


def _dealt(run, inputs, results):
    """Cells that take as many steps side by side: lanes wait less for each other. A few switches tell how many."""
    n = inputs.shape[1]
    if n <= 4 * LANES or not inputs[-2].max() > 8 * FEW:
        run(inputs, results, False)
        return
    few = inputs.copy()
    few[-2] = np.minimum(few[-2], FEW)
    run(few, results, False)
    order = np.lexsort((results[-3], results[-2]))
    found = np.empty_like(results)
    run(np.ascontiguousarray(inputs[:, order]), found, False)
    results[:, order] = found


def once(module, columns, rtol, outputs, status):
    """Fills outputs and status by one run, each step right to `rtol`."""
    results = followed(module, columns, rtol)
    _write(results, outputs, status)


def twice(module, columns, rtol, outputs, status, most=APART):
    """Fills outputs and status by two runs; INACCURATE where they differ by more than the finer one could mend."""
    rough = followed(module, off_by_roundings(columns), rtol, ROUGH)
    fine = followed(module, columns, rtol, ROUGH * FINER)
    _write(fine, outputs, status)
    states = len(module.STATES)
    scale = np.concatenate([abs(fine[:2]), np.maximum(abs(fine[2 : 2 + states]), fine[2 + states : -1])])
    with np.errstate(all="ignore"):
        apart = (rtol < ROUNDING) | ~(abs(fine[: len(scale)] - rough[: len(scale)]) <= most * rtol * scale).all(axis=0)
    status[apart & (status == Status.OK)] = Status.INACCURATE
    worse = (rough[-1] > 0) & (status <= Status.INACCURATE)
    status[worse] = np.where(rough[-1][worse] < FIRST_REFUSAL, rough[-1][worse], Status.INACCURATE)


def off_by_roundings(columns):
    """The parameters, each changed by a few roundings of its own; the number of switches, the last, as it is.

    Numbers of eight bits, which cannot cancel so far that it matters, and those that another one repeats are kept: a
    start on the surface stays there.
    """
    *values, flips = columns
    changed = []
    for j, value in enumerate(values):
        ulps = ROUNDINGS * (2.0 * ((j + 1) * GOLDEN % 1.0) - 1.0)
        short = np.ascontiguousarray(value).view(np.int64) & (2**44 - 1) == 0
        kept = short | np.any([abs(value) == abs(other) for k, other in enumerate(values) if k != j], axis=0)
        changed.append(np.where(kept, value, value * (1.0 + ulps * 2.0**-52)))
    return [*changed, flips]


def _write(results, outputs, status):
    for column, row in zip(outputs, results, strict=False):
        column[...] = row
    status[...] = results[-1]
    sizes = abs(results[: len(outputs)])
    normal = (sizes == 0) | ((sizes >= NORMAL_LOW) & (sizes <= NORMAL_HIGH))
    status[~normal.all(axis=0) & (results[-1] == Status.OK)] = Status.OUT_OF_RANGE
