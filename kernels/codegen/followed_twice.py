"""Columns of cells followed more than once by a scene's module, and how far the result can be believed.

Each step is right to a tolerance; what many steps come to depends on the scene. So a cell is followed three times. The
rough and the finest run have tolerances FINER apart: what they differ by is the rough one's error, of which the finest,
whose results are given, has about 1/FINER. The rough run's parameters are some roundings off (`off_by_roundings`), and
so are its start and the times of its events (`shake`); the third run has the opposite roundings, and a tolerance
between those two. It shows what a scene makes of rounding, which two runs may share, and where two runs have the same
error by chance.
"""

import math

import numpy as np

from kernels.integrate.driver import GOLDEN
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.refill import MOVING, fresh, to_the_end
from kernels.lanes.tuples import first_rows, flat
from kernels.maths.elementary import NORMAL_HIGH, NORMAL_LOW

HIGH_BELOW = 5e-10
"""Tolerance of a step below which the higher order is the faster."""
FINEST = 1e-25
ROUNDING = 1e-14
"""The least rtol that is promised, whatever the runs agree to."""
AT_ONCE = 8192
"""Cells whose lanes' memory stays in a core's cache."""
STOPS = 2.0, 4.0, math.inf
"""Switches behind which cells are put in the order of the steps of their last two legs, from event to event."""
ROUGH, BETWEEN, FINER = 2.0, 4.0, 16.0
ROUNDINGS = 8.0
"""By how many roundings a parameter is changed at most."""
MANY = 8.0
"""Times as many are the parameters of scenes changed by: beside them those of the steps of a run are few."""
TIGHTER, TIGHT = 1e-4, 1e-14
"""The second tolerance, over the first one, and at most: what is stiff may come to rest only in the last digits."""
TRIED_AGAIN = Status.INACCURATE, Status.GRAZING, Status.STEP_LIMIT, Status.OUT_OF_RANGE
APART = 4.0
"""How many rtol the first run may be from the finest, which is then right to rtol/4 as far as steps go."""
CONVERGED, BY_STEPS, ROUNDED = 3.0, 0.4, 0.2
"""How many times nearer to the finest run the one between is where both are off by their steps: it may then differ by
BY_STEPS of rtol; else rounding is what tells them apart, of which the finest run has no less, and by ROUNDED of it."""


def followed(module, columns, rtol, finer=1.0, together=False, shake=0.0):
    """The results of a cell a column: time, interval, states, their sizes, and as the last row the status.

    Parameters
    ----------
    columns : the parameters and the number of switches
    rtol : tolerance of each step, a column; it chooses the order
    finer : by how much the steps are to be better than that
    together : lanes in lockstep, in the order of the cells
    shake : 1 or -1 where each event is missed by some roundings, and each state at the start (`driver.missed_by`)
    """
    return _followed(module, columns, rtol, rtol / finer, together, shake=shake)


def told(module, columns, rtol, of_a_step):
    """As `followed`, and besides the error that is carried along, relative to the worst of the results."""
    found = _followed(module, columns, rtol, of_a_step, tells=True)
    return found[:-1], found[-1]


def _followed(module, columns, rtol, of_a_step, together=False, tells=False, shake=0.0):
    """The results; if the error is to be told, as a last row."""
    inputs = [*columns, np.maximum(of_a_step, FINEST), np.full(len(rtol), shake)]
    results = np.empty((3 + 2 * len(module.STATES) + tells, len(rtol)))
    high = rtol < HIGH_BELOW
    for run, of_order in ((module.run_12, ~high), (module.run_18, high)):
        cells = np.flatnonzero(of_order)
        for begin in range(0, len(cells), AT_ONCE):
            those = cells[begin : begin + AT_ONCE]
            results[:, those] = _run(module, run, [column[those] for column in inputs], together, tells)
    return results


def _run(module, run, inputs, together, tells):
    """The results of cells."""
    results = np.empty((3 + 2 * len(module.STATES) + tells, len(inputs[0])))
    for places, found in _at_stops(module, run, inputs, (math.inf,) if together else STOPS, together, tells):
        results[:, places] = found
    return results


def passages(module, columns, rtol, stops, finer=1.0, tells=False, shake=0.0):
    """The results of each cell at each of those switches, (n_rows, n_stops, n_cells); NaN where it gets there not.

    As `followed` gives them, or if it `tells` as `told`: once, by the method of the higher order.
    """
    one = np.ones(len(rtol))
    inputs = [*columns, stops[-1] * one, np.maximum(rtol / finer, FINEST), shake * one]
    results = np.full((3 + 2 * len(module.STATES) + tells, len(stops), len(rtol)), np.nan)
    for begin in range(0, len(rtol), AT_ONCE):
        part = [column[begin : begin + AT_ONCE] for column in inputs]
        for k, (places, found) in enumerate(_at_stops(module, module.run_18, part, stops, False, tells)):
            results[:, k, begin + places] = found
    return results


def _at_stops(module, run, inputs, stops, together, tells):
    """Places and results of cells at each stop, a number of switches, that go on from the one before, or at their last.

    Those that take as many steps are side by side, for so lanes wait less for each other.
    """
    cell = module.M.cell
    row, rows = first_rows(cell), len(flat(cell))
    found = [*range(row["time"], row["verdict"] + 1), *([row["errors"] + 1] if tells else [])]
    cells, places = fresh(rows, inputs), np.arange(len(inputs[0]))
    whole = np.where(inputs[-3] < math.inf, inputs[-3], math.nan)  # NaN is refused, without end not followed
    cells[:, row["interval"] : row["size"]] = np.nan
    cells[:, row["h"]] = module.first(inputs[-2]) if hasattr(module, "first") else 1.0
    if cell.errors:
        cells[:, row["errors"]] = float(tells)
    for stop in stops:
        cells[:, row["flips"]] = np.minimum(whole, stop)
        to_the_end(run, cells, together)
        yield places, cells[:, found].T
        count, verdict, steps, before = (cells[:, row[name]] for name in ("count", "verdict", "steps", "before"))
        going = np.flatnonzero((count >= stop) & (count < whole) & (verdict < FIRST_REFUSAL))
        going = going[np.lexsort([key[going].astype(np.int16) for key in (steps, before)])]
        if not len(going):
            break
        cells, places, whole = cells[going], places[going], whole[going]
        cells[:, 0] = MOVING


def once(module, columns, rtol, outputs, status):
    """Fills outputs and status by one run, each step right to `rtol`."""
    results = followed(module, columns, rtol)
    write(results, status_of(results, len(outputs)), outputs, status)


def twice(module, columns, rtol, outputs, status, finest=0.0):
    """Fills outputs and status by three runs; INACCURATE where they differ by more than the finest one could mend.

    Where they do, or a run breaks off, the cell is followed by three again, with a tighter tolerance, of at least
    `finest`.
    """
    results, found = _compared(module, columns, rtol, rtol)
    tighter = np.maximum(np.minimum(TIGHT, TIGHTER * rtol), finest)
    again = np.flatnonzero(np.isin(found, TRIED_AGAIN) & (tighter < rtol) & (rtol >= ROUNDING))
    if len(again):
        better, verdict = _compared(module, [c[again] for c in columns], tighter[again], rtol[again])
        right = verdict <= Status.INACCURATE
        results[:, again[right]], found[again[right]] = better[:, right], verdict[right]
    write(results, found, outputs, status)


def _compared(module, columns, rtol, wanted):
    """The results of the finest of three runs to the tolerance `rtol`, and the status where `wanted` is to be met."""
    rough = followed(module, off_by_roundings(columns, MANY), rtol, ROUGH, shake=1.0)
    other = followed(module, off_by_roundings(columns, -MANY), rtol, ROUGH * BETWEEN, shake=-1.0)
    fine = followed(module, columns, rtol, ROUGH * FINER)
    states = len(module.STATES)
    status = status_of(fine, 2 + states)
    scale = np.concatenate([abs(fine[:2]), fine[2 + states : -1]])
    near = _near(fine, rough, other, wanted * scale)
    status[((wanted < ROUNDING) | ~near) & (status == Status.OK)] = Status.INACCURATE
    worse = (rough[-1] > 0) & (status <= Status.INACCURATE)
    status[worse] = np.where(rough[-1][worse] < FIRST_REFUSAL, rough[-1][worse], Status.INACCURATE)
    return fine, status


def _near(fine, rough, other, allowed):
    """Whether the finest run is believed, in times and states, a row for each, to be right to that."""
    with np.errstate(all="ignore"):
        far, close = (abs(fine[: len(allowed)] - run[: len(allowed)]) for run in (rough, other))
        by_steps = (close <= BY_STEPS * allowed) & (CONVERGED * close <= far)
        return ((far <= APART * allowed) & (by_steps | (close <= ROUNDED * allowed))).all(axis=0)


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
    """What the motion came to; OUT_OF_RANGE where one of so many outputs is no normal number."""
    sizes, status = abs(results[:outputs]), results[-1].astype(np.int8)
    normal = (sizes == 0) | ((sizes >= NORMAL_LOW) & (sizes <= NORMAL_HIGH))
    status[~normal.all(axis=0) & (status == Status.OK)] = Status.OUT_OF_RANGE
    return status


def write(results, found, outputs, status):
    for column, row in zip(outputs, results, strict=False):
        column[...] = row
    status[...] = found
