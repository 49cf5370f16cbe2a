"""Columns of cells followed once by the Taylor method of a scene's module, with the error carried along.

The error that a cell states (`integrate.carried`) is signed and of first order; STATED times that is to be believed. A
cell of which that does not show that it is right is followed again with a tolerance as much smaller; what then is
left, and all that is remarked or refused, is followed three times (`followed_twice`), which asks for no derivatives.
But where the error grows as large as the motion, several runs may agree by chance, so that is INACCURATE.
"""

import functools
from types import SimpleNamespace

import numpy as np

from kernels.codegen import followed_twice
from kernels.codegen.followed_twice import ROUNDING
from kernels.codegen.functions import Functions, cell_of
from kernels.codegen.module import build, by_series
from kernels.codegen.record import record
from kernels.integrate.carried import SMALL
from kernels.interface import FIRST_REFUSAL, Status

STATED = 1.5
"""Stated error over the one carried along."""
OF_A_STEP = 0.25
"""Tolerance of a step over the one of the whole motion: errors of some steps may add up."""
SMALLER, SMALLEST = 4.0, 1e-5
"""By how much less than what would do a second tolerance is, and the least share of the first one that is tried."""


def by_one(scene):
    """The function of columns that follows the scene with its error carried along."""

    def solved_by_one(module, columns, rtol, outputs, status):
        solved(telling(scene), columns, rtol, outputs, status)

    return solved_by_one


@functools.cache
def telling(scene):
    """What runs the scene's motion with its error, made once."""
    functions = Functions(scene, record(scene))
    recorded, m = functions.recorded, build(scene).M._replace(cell=cell_of(*functions.size, True))
    values = [recorded.graph.multiply(factor, u) for _, factor, u in recorded.events]
    made = functions.sizes(recorded.rates), functions.sizes(values)
    changed = map(functions.changed, (recorded.rates, values, recorded.switched))
    return SimpleNamespace(STATES=scene.states, M=m, **by_series(functions, m, (*changed, *made)))


def solved(module, columns, rtol, outputs, status):
    """Fills outputs and status by one run where that states an error below `rtol`, else by three."""
    results, error = followed_twice.told(module, columns, rtol, rtol * OF_A_STEP)
    found = judged(results, error, rtol, len(outputs))
    again = np.flatnonzero((found != Status.OK) & (results[-1] == Status.OK) & (error < np.inf) & (rtol >= ROUNDING))
    if len(again):
        share = OF_A_STEP * np.maximum(rtol[again] / (SMALLER * STATED * error[again]), SMALLEST)
        share[error[again] > SMALL] = OF_A_STEP * SMALLEST  # first order does not say how much of it is steps'
        some, wanted, least = [c[again] for c in columns], rtol[again], error[again] * share / OF_A_STEP
        results[:, again], error[again] = followed_twice.told(module, some, wanted, share * wanted)
        found[again] = judged(results[:, again], np.maximum(error[again], least), wanted, len(outputs))
    followed_twice.write(results, found, outputs, status)
    by_chance = (error > SMALL) & (error < np.inf) & (results[-1] < FIRST_REFUSAL)
    left = np.flatnonzero((found != Status.OK) & ~by_chance)
    if len(left):
        _by_three(module, columns, rtol, outputs, status, left)


def judged(results, error, rtol, outputs):
    """OK where the stated error is at most rtol, else INACCURATE or what the motion came to."""
    status = followed_twice.status_of(results, outputs)
    status[~(STATED * error <= rtol) | (rtol < ROUNDING)] = Status.INACCURATE
    return status


def _by_three(module, columns, rtol, outputs, status, cells):
    """Fills these cells by three runs."""
    found, verdict = [np.empty(len(cells)) for _ in outputs], np.empty(len(cells), np.int8)
    followed_twice.twice(module, [c[cells] for c in columns], rtol[cells], found, verdict)
    for column, values in zip((*outputs, status), (*found, verdict), strict=True):
        column[cells] = values
