"""Solves columns of cells with a fixed step, and estimates the error of the result.

A cell is solved three times: with its step; with less than half of it, each step consisting of two halves, also those
that end on an event; and with a step in between. The largest difference of two runs gives the error of the first; only
two might agree by chance. With integer fractions of the step the runs would sample the same points of the motion, and
could agree although all are wrong, so the fractions are not integer. If the intermediate run, which is closer to the
first, differs from it by almost nothing of what the finest does, differences grow as the step shrinks, and are no
estimate: INACCURATE. Without location, steps are not halved, and a switch is known to one step at best. The parameters
of the other runs are perturbed by some roundings (`off_by_roundings`), so that amplified rounding errors show as well.
If the motion turns round behind a switch within the error, the switch may not exist: GRAZING.
"""

import numpy as np

from kernels.codegen.followed import off_by_roundings
from kernels.integrate.events import METHODS, MOREAU, NONE
from kernels.integrate.fixed_step import TOLERANCE
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.columns import fresh, to_the_end
from kernels.lanes.tuples import first_rows, flat
from kernels.maths.elementary import NORMAL_HIGH, NORMAL_LOW

LOCATED, BLIND = ((1.0, 0.37, 0.77), (1.0, 2.0, 1.0)), ((1.0, 0.23, 0.61), (1.0, 1.0, 1.0))
"""Length of the steps of the three runs, the finest one second, and how many substeps a step has."""
SAFETY = 2.0
"""A switch found by a line or a polynomial is off by 1/(1 - 0.37) of what two runs differ by if only the order is 1."""
GROWS = 0.1
"""Least share of a difference in the nearer run: order 0, an error like log(step), would leave 0.15."""
ROUNDING = 2.3e-16
ROUNDINGS = 8.0
"""Of the result, up to which differences are in no order."""
UNSURE, FALLEN = 6.0, 1.3
"""Differences in its speed there that a motion must have left behind a switch, and how often the margin, which goes
with the speed's square, must be what it has fallen by to the finest run."""


def followed(runner, method, columns, step, location, substeps):
    """A column per cell of: time, interval, states, their reach, margin behind a switch, steps, calls, status.

    Parameters
    ----------
    columns : the parameters and the number of switches
    step, location, substeps : columns; of a step
    """
    cell, states = runner.m.cell, len(runner.scene.states)
    row = first_rows(cell)
    shown = [*range(row["time"], row["size"]), *range(row["own"], row["own"] + states + 3), row["verdict"]]
    results = np.full((6 + 2 * states, len(step)), np.nan)
    for one in np.unique([location, substeps], axis=1).T:
        cells = (location == one[0]) & (substeps == one[1])
        table = fresh(len(flat(cell)), [*(c[cells] for c in columns), np.full(cells.sum(), TOLERANCE)])
        table[:, row["h"]] = step[cells]
        table[:, row["own"] + states] = np.inf
        table[:, -3:] = METHODS.index(method), *one
        to_the_end(runner.low, table)
        results[:, cells] = table[:, shown].T
    return results


def solved(runner, method, columns, step, location):
    """The first run, a row for its estimated relative error, and the status.

    Returns
    -------
    results : as `followed` gives, but margin and status
    error, status
    """
    blind = (location == NONE) | (METHODS.index(method) == MOREAU)
    lengths, substeps = np.where(blind, np.array(BLIND)[..., None], np.array(LOCATED)[..., None])
    columns = [np.broadcast_to(c, step.shape) for c in columns]
    threefold = [np.concatenate([c, off, off]) for c, off in zip(columns, off_by_roundings(columns), strict=True)]
    runs = followed(runner, method, threefold, (lengths * step).ravel(), np.tile(location, 3), substeps.ravel())
    first, finest, between = np.split(runs, 3, axis=1)
    states = len(runner.scene.states)
    scale = np.concatenate([abs(finest[:2]), finest[2 + states : 2 + 2 * states]])
    with np.errstate(all="ignore"):
        # what each two runs differ by: time, interval and states at the switch, and the states' reach
        pairs = (first, finest), (first, between), (between, finest)
        apart = [abs(one - other)[: 2 + 2 * states] / np.concatenate([scale, scale[2:]]) for one, other in pairs]
        of_switch = np.max([x[: 2 + states].max(axis=0) for x in apart], axis=0)
        ends, near, far = (x.max(axis=0) for x in apart)
        of_all, rounding = np.max((ends, near, far), axis=0), ROUNDING * np.sqrt(first[-3])
        grows = (near < GROWS * ends) & (of_all > ROUNDINGS * rounding)
        error = SAFETY * of_all + rounding
        error = np.where(blind, np.maximum(error, step / first[1]), error)
        fallen = np.maximum(first[-4], between[-4]) - finest[-4]
        unsure = finest[-4] <= np.maximum((UNSURE * of_switch) ** 2, FALLEN * fallen)
    # what the finest run does not hide, the others' differences from it tell
    status, near = (np.where(run[-1] == Status.INACCURATE, 0.0, run[-1]).astype(np.int8) for run in (first, between))
    for other in (finest[-1], near):
        status = np.where(status == Status.OK, other * (other < FIRST_REFUSAL), status)
    sizes = abs(first[:-4])
    normal = ((sizes == 0) | ((sizes >= NORMAL_LOW) & (sizes <= NORMAL_HIGH))).all(axis=0)
    status = np.where((status < FIRST_REFUSAL) & ~normal, Status.OUT_OF_RANGE, status)
    reliable = (finest[-1] < FIRST_REFUSAL) & (between[-1] < FIRST_REFUSAL)
    status = np.where((status < Status.GRAZING) & unsure & reliable, Status.GRAZING, status)
    status = np.where((status == Status.OK) & grows & reliable, Status.INACCURATE, status)
    error = np.where(status < FIRST_REFUSAL, np.where(reliable & (error < np.inf), error, np.inf), np.nan)
    status = np.where((status == Status.OK) & np.isinf(error), Status.INACCURATE, status)
    return np.delete(first, (-4, -1), axis=0), error, status
