"""Solves columns of cells with a compiled scene (`compiled.Runner`), each step to a tolerance.

Each result is a row: time of the last switch, or of each stop, interval, states, the largest sizes of the states, the
status; and for methods that propagate their error, the largest error of these results.
"""

import math

import numpy as np

from kernels.integrate.driver import GOLDEN
from kernels.integrate.taylor import TINY
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.columns import MOVING, fresh, to_eight_bits, to_the_end
from kernels.lanes.tuples import first_rows, flat
from kernels.maths.elementary import NORMAL_HIGH, NORMAL_LOW

HIGH_BELOW = 5e-10
"""Tolerance of a step below which the higher order is the faster."""
FINEST = 1e-25
AT_ONCE = 8192
"""Cells whose lanes' memory stays in a core's cache."""
STOPS, FEW_CELLS = (2.0, 4.0, math.inf), 128
"""Switches behind which cells are put in the order of the steps of their last two legs, from event to event; so many
cells or fewer are run to their end at once, which takes less time."""
ROUNDINGS = 8.0
"""By how many roundings a parameter is changed at most."""
FAINT = 16.0 * TINY
"""The largest size on the way of a state below which steps do not hold its relative error."""


def followed(runner, columns, rtol, of_a_step=None, shake=0.0, told=False, stops=None):
    """The results of a cell a column, (n_rows, n_cells); at several stops (n_rows, n_stops, n_cells).

    Cells that take as many steps are side by side, for so lanes wait less for each other.

    Parameters
    ----------
    columns : the parameters and the number of switches
    rtol : a column, which chooses the order
    of_a_step : tolerance of each step, a column; None: rtol
    shake : 1 or -1 where each event is missed by some roundings, and each state at the start (`driver.missed_by`)
    told : whether the error is
    stops : None, or numbers of switches, of which the last ends the motion: all are by the higher order. Where a motion
        has ended before, there is what it ended with. Of a scene that ends at a time (`Scene.until`): the times
    """
    steps, high = rtol if of_a_step is None else of_a_step, (rtol < HIGH_BELOW) | (stops is not None)
    cell, tolerance = runner.m.cell, np.maximum(steps, FINEST)
    inputs = np.array([*columns, tolerance, np.full(len(rtol), shake)])
    row, rows = first_rows(cell), len(flat(cell))
    shown = [*range(row["time"], row["verdict"] + 1), *([row["own"] + 1] if told else [])]
    results = np.empty((len(shown), 1 if stops is None else len(stops), len(rtol)))
    for run, chosen in ((runner.low, np.flatnonzero(~high)), (runner.high, np.flatnonzero(high))):
        for begin in range(0, len(chosen), AT_ONCE):
            places = chosen[begin : begin + AT_ONCE]
            own_stops = STOPS if len(places) > FEW_CELLS else STOPS[-1:]
            cells, whole = fresh(rows, inputs[:, places]), inputs[-3, places]
            whole = np.where(whole < math.inf, whole, math.nan)  # NaN is refused, without end not followed
            cells[:, row["interval"] : row["size"]] = np.nan
            # two runs by a pair that began alike would share the steps that grow by the most allowed, and their errors
            begin = 1.0 if runner.order is None else to_eight_bits(tolerance[places] ** (1.0 / runner.order))
            cells[:, row["h"]] = begin
            if cell.own:
                cells[:, row["own"]] = float(told)
            for k, stop in enumerate(own_stops if stops is None else stops):
                if runner.scene.until:  # ahead of the surface again, in a unit of this time; intervals are from 0
                    unit = np.ldexp(1.0, np.frexp(stop)[1])
                    cells[:, row["h"]] *= cells[:, row["unit"]] / unit if k else 1.0
                    cells[:, row["flips"] - 1], cells[:, row["unit"] - 1], cells[:, row["unit"]] = stop, 1.0, unit
                    cells[:, row["on"]], cells[:, row["since"]], stop = 0.0, cells[:, row["time"]], k + 1.0
                cells[:, row["flips"]] = np.minimum(whole, stop)
                to_the_end(run, cells)
                results[:, 0 if stops is None else k :, places] = cells[:, shown].T[:, None]
                count, verdict, *keys = (cells[:, row[name]] for name in ("count", "verdict", "steps", "before"))
                going = np.flatnonzero((count >= stop) & (count < whole) & (verdict < FIRST_REFUSAL))
                going = going[np.lexsort([key[going].astype(np.int16) for key in keys])]
                if not len(going):
                    break
                cells, places, whole = cells[going], places[going], whole[going]
                cells[:, 0] = MOVING
    return results[:, 0] if stops is None else results


def off_by_roundings(columns, many=1.0):
    """The parameters, each changed by `many` times a few roundings of its own; the last, of switches, as it is.

    Numbers of eight bits, which cannot cancel so far that it matters, and those that another one repeats are kept: a
    start on the surface stays there.
    """
    *values, flips = columns
    changed = []
    for j, value in enumerate(values):
        ulps = many * ROUNDINGS * (2.0 * ((j + 1) * GOLDEN % 1.0) - 1.0)
        short = np.ascontiguousarray(value).view(np.int64) & (2**44 - 1) == 0
        kept = short | np.any([abs(value) == abs(other) for k, other in enumerate(values) if k != j], axis=0)
        changed.append(np.where(kept, value, value * (1.0 + ulps * 2.0**-52)))
    return [*changed, flips]


def status_of(results, outputs):
    """The verdict; OUT_OF_RANGE where one of so many outputs is no normal number, or a state is never above FAINT."""
    values, status, first = abs(results[:outputs]), results[-1].astype(np.int8), (len(results) + 1) // 2
    sizes = results[first : first + outputs - 2]
    normal = (values == 0) | ((values >= NORMAL_LOW) & (values <= NORMAL_HIGH))
    in_range = normal.all(axis=0) & ((sizes == 0) | (sizes >= FAINT)).all(axis=0)
    status[~in_range & (status == Status.OK)] = Status.OUT_OF_RANGE
    return status


def put(wholes, cells, parts, which=slice(None)):
    """Puts what has been found for these cells, or for some of them, into columns, whose last axis is of all cells."""
    for whole, part in zip(wholes, parts, strict=True):
        whole[..., cells[which]] = part[..., which]
