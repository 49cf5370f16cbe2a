"""Columns of cells followed by what runs a scene (`compiled.Runner`), each step right to a tolerance.

Results are a row each: time of the last switch, interval, states, the states' sizes on the way, the status; and where
it is told, the error that is carried along, relative to the worst of the results.
"""

import math

import numpy as np

from kernels.integrate.driver import GOLDEN
from kernels.integrate.taylor import TINY
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.columns import MOVING, fresh, to_the_end
from kernels.lanes.tuples import first_rows, flat
from kernels.maths.elementary import NORMAL_HIGH, NORMAL_LOW

HIGH_BELOW = 5e-10
"""Tolerance of a step below which the higher order is the faster."""
FINEST = 1e-25
AT_ONCE = 8192
"""Cells whose lanes' memory stays in a core's cache."""
STOPS = 2.0, 4.0, math.inf
"""Switches behind which cells are put in the order of the steps of their last two legs, from event to event."""
ROUNDINGS = 8.0
"""By how many roundings a parameter is changed at most."""
FAINT = 16.0 * TINY
"""The largest size on the way of a state below which steps do not hold its relative error."""


def followed(runner, columns, rtol, of_a_step=None, shake=0.0, told=False):
    """The results of a cell a column.

    Parameters
    ----------
    columns : the parameters and the number of switches
    rtol : a column, which chooses the order
    of_a_step : tolerance of each step, a column; None: rtol
    shake : 1 or -1 where each event is missed by some roundings, and each state at the start (`driver.missed_by`)
    told : whether the error is
    """
    steps = rtol if of_a_step is None else of_a_step
    results, high = np.empty((3 + 2 * len(runner.scene.states) + told, len(rtol))), rtol < HIGH_BELOW
    for run, chosen in ((runner.low, ~high), (runner.high, high)):
        cells = np.flatnonzero(chosen)
        those = [column[cells] for column in columns]
        for _, places, found in _at_stops(runner, run, those, steps[cells], STOPS, shake, told):
            results[:, cells[places]] = found
    return results


def passages(runner, columns, of_a_step, stops, shake=0.0, told=False):
    """The results of each cell at each of those switches, (n_rows, n_stops, n_cells); NaN where it gets there not.

    All are by the method of the higher order.
    """
    results = np.full((3 + 2 * len(runner.scene.states) + told, len(stops), len(of_a_step)), np.nan)
    inputs = [*columns, np.full(len(of_a_step), stops[-1])]
    for k, places, found in _at_stops(runner, runner.high, inputs, of_a_step, stops, shake, told):
        results[:, k, places] = found
    return results


def _at_stops(runner, run, columns, of_a_step, stops, shake, told):
    """Number of a stop, a number of switches, places and results of cells that go on from there, or are at their last.

    Those that take as many steps are side by side, for so lanes wait less for each other.
    """
    cell, flips = runner.m.cell, columns[-1]
    row, rows = first_rows(cell), len(flat(cell))
    shown = [*range(row["time"], row["verdict"] + 1), *([row["own"] + 1] if told else [])]
    tolerance = np.maximum(of_a_step, FINEST)
    inputs = [*columns, tolerance, np.full(len(flips), shake)]
    for begin in range(0, len(flips), AT_ONCE):
        part = slice(begin, begin + AT_ONCE)
        cells = fresh(rows, [column[part] for column in inputs])
        places = begin + np.arange(len(cells))
        whole = np.where(flips[part] < math.inf, flips[part], math.nan)  # NaN is refused, without end not followed
        cells[:, row["interval"] : row["size"]] = np.nan
        # two runs by a pair that began alike would share the steps that grow by the most allowed, and their errors
        cells[:, row["h"]] = 1.0 if runner.order is None else tolerance[part] ** (1.0 / runner.order)
        if cell.own:
            cells[:, row["own"]] = float(told)
        for k, stop in enumerate(stops):
            cells[:, row["flips"]] = np.minimum(whole, stop)
            to_the_end(run, cells)
            yield k, places, cells[:, shown].T
            count, verdict, steps, before = (cells[:, row[name]] for name in ("count", "verdict", "steps", "before"))
            going = np.flatnonzero((count >= stop) & (count < whole) & (verdict < FIRST_REFUSAL))
            going = going[np.lexsort([key[going].astype(np.int16) for key in (steps, before)])]
            if not len(going):
                break
            cells, places, whole = cells[going], places[going], whole[going]
            cells[:, 0] = MOVING


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


def status_of(results, verdict, outputs):
    """The verdict; OUT_OF_RANGE where one of so many outputs is no normal number, or a state is never above FAINT."""
    values, sizes, status = abs(results[:outputs]), results[outputs:-1], verdict.astype(np.int8)
    normal = (values == 0) | ((values >= NORMAL_LOW) & (values <= NORMAL_HIGH))
    in_range = normal.all(axis=0) & ((sizes == 0) | (sizes >= FAINT)).all(axis=0)
    status[~in_range & (status == Status.OK)] = Status.OUT_OF_RANGE
    return status
