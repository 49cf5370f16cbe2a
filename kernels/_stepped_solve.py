"""Columns of cells followed at a fixed step, and how far the result can be believed.

A cell is followed twice. The second run takes half the step and makes each of its steps, those that end on an event
too, of two halves; without location a quarter of the step. What the runs differ by is 3/4 of the first one's error at
least, whatever the order. A switch that is not located is known to one step at best.
"""

import numpy as np

from kernels._locate import METHODS, MOREAU, NONE
from kernels._vecmath import NORMAL_HIGH, NORMAL_LOW
from kernels.interface import FIRST_REFUSAL, Status

SAFETY = 1.5
ROUNDING = 2.3e-16
GRAZING = 1e-9
"""Of an event's value at the start of a step: how close to 0 it may turn round in it unremarked."""


def followed(module, method, columns, step, location, parts=1.0):
    """A column per cell of: time, interval, states, their reach, steps, calls of the rates, status.

    Parameters
    ----------
    columns : the parameters and the number of switches
    step, location : columns
    parts : of a step
    """
    results = np.full((5 + 2 * len(module.STATES), len(step)), np.nan)
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
    results : as `followed` gives, but the last row
    error, status
    """
    blind = (location == NONE) | (METHODS.index(method) == MOREAU)
    results = followed(module, method, columns, step, location)
    finer = np.empty_like(results)
    for cells, shorter, parts in ((~blind, 0.5, 2.0), (blind, 0.25, 1.0)):
        if cells.any():
            some = [np.broadcast_to(c, step.shape)[cells] for c in columns]
            finer[:, cells] = followed(module, method, some, shorter * step[cells], location[cells], parts)
    with np.errstate(all="ignore"):
        error = _apart(results, finer, len(module.STATES)) + ROUNDING * np.sqrt(results[-3])
        error = np.where(blind, np.maximum(error, step / results[1]), error)
        error = np.where(finer[-1] < FIRST_REFUSAL, error, np.inf)
    status = _status(results, finer)
    return results[:-1], np.where(status < FIRST_REFUSAL, np.where(error < np.inf, error, np.inf), np.nan), status


def _apart(results, finer, states):
    """The largest relative difference of time, interval, and of each state over its reach."""
    scale = np.concatenate([abs(finer[:2]), finer[2 + states : 2 + 2 * states]])
    apart = abs(results[: len(scale)] - finer[: len(scale)])
    reach = abs(results - finer)[2 + states : 2 + 2 * states]
    return SAFETY * np.maximum((apart / scale).max(axis=0), (reach / scale[2:]).max(axis=0))


def _status(results, finer):
    status = results[-1].astype(np.int8)
    remark = finer[-1] * (finer[-1] < FIRST_REFUSAL)
    status = np.where(status == Status.OK, remark, status)
    sizes = abs(results[:-3])
    normal = ((sizes == 0) | ((sizes >= NORMAL_LOW) & (sizes <= NORMAL_HIGH))).all(axis=0)
    return np.where((status < FIRST_REFUSAL) & ~normal, Status.OUT_OF_RANGE, status)
