"""Columns of cells followed at a fixed step, and how far the result can be believed.

A cell is followed twice. The second run takes half the step and makes each of its steps, those that end on an event
too, of two halves; without location a quarter of the step. What the runs differ by is 3/4 of the first one's error at
least, whatever the order. A switch that is not located is known to one step at best. The second run's parameters are
some roundings off (`off_by_roundings`), so that rounding that a scene makes worse shows too. Where the motion would
turn round behind a switch within the error, the switch may not be there at all: GRAZING.
"""

import numpy as np

from kernels._locate import METHODS, MOREAU, NONE
from kernels._taylor_solve import off_by_roundings
from kernels._vecmath import NORMAL_HIGH, NORMAL_LOW
from kernels.interface import FIRST_REFUSAL, Status

SAFETY = 1.5
ROUNDING = 2.3e-16
UNSURE, MOVED = 4.0, 1.3
"""Errors of its speed there that a motion must have left behind a switch, and how often the margin, which goes with
the speed's square, must be what the two runs differ by in it."""
GRAZING = 1e-9
"""Of an event's value at the start of a step: how close to 0 it may turn round in it unremarked."""


def followed(module, method, columns, step, location, parts=1.0):
    """A column per cell of: time, interval, states, their reach, margin behind a switch, steps, calls, status.

    Parameters
    ----------
    columns : the parameters and the number of switches
    step, location : columns
    parts : of a step
    """
    results = np.full((6 + 2 * len(module.STATES), len(step)), np.nan)
    for way in np.unique(location):
        cells = location == way
        extra = (step, GRAZING, METHODS.index(method), way, parts)
        rows = [np.broadcast_to(c, step.shape)[cells] for c in (*columns, *extra)]
        found = np.full((len(results), len(rows[0])), np.nan)
        module.run(np.ascontiguousarray(rows), found, False)
        results[:, cells] = found
    return results


def solved(module, method, columns, step, location):
    """The first run, a row for its estimated relative error, and the status.

    Returns
    -------
    results : as `followed` gives, but margin and status
    error, status
    """
    blind = (location == NONE) | (METHODS.index(method) == MOREAU)
    results = followed(module, method, columns, step, location)
    finer = np.empty_like(results)
    columns = off_by_roundings(columns)
    for cells, shorter, parts in ((~blind, 0.5, 2.0), (blind, 0.25, 1.0)):
        if cells.any():
            some = [np.broadcast_to(c, step.shape)[cells] for c in columns]
            finer[:, cells] = followed(module, method, some, shorter * step[cells], location[cells], parts)
    with np.errstate(all="ignore"):
        of_switch, of_reach = _apart(results, finer, len(module.STATES))
        unsure = finer[-4] <= np.maximum((UNSURE * of_switch) ** 2, MOVED * abs(results[-4] - finer[-4]))
        error = np.maximum(of_switch, of_reach) + ROUNDING * np.sqrt(results[-3])
        error = np.where(blind, np.maximum(error, step / results[1]), error)
        error = np.where(finer[-1] < FIRST_REFUSAL, error, np.inf)
    status = _status(results, finer)
    status = np.where((status < Status.GRAZING) & unsure & (finer[-1] < FIRST_REFUSAL), Status.GRAZING, status)
    error = np.where(status < FIRST_REFUSAL, np.where(error < np.inf, error, np.inf), np.nan)
    return np.delete(results, (-4, -1), axis=0), error, status


def _apart(results, finer, states):
    """The largest relative difference of time, interval and states at the switch, and of the states' reach."""
    scale = np.concatenate([abs(finer[:2]), finer[2 + states : 2 + 2 * states]])
    apart = abs(results[: len(scale)] - finer[: len(scale)])
    reach = abs(results - finer)[2 + states : 2 + 2 * states]
    return SAFETY * (apart / scale).max(axis=0), SAFETY * (reach / scale[2:]).max(axis=0)


def _status(results, finer):
    status = results[-1].astype(np.int8)
    remark = finer[-1] * (finer[-1] < FIRST_REFUSAL)
    status = np.where(status == Status.OK, remark, status)
    sizes = abs(results[:-4])
    normal = ((sizes == 0) | ((sizes >= NORMAL_LOW) & (sizes <= NORMAL_HIGH))).all(axis=0)
    return np.where((status < FIRST_REFUSAL) & ~normal, Status.OUT_OF_RANGE, status)
