"""Columns of cells solved to a tolerance: followed so often that the result can be believed.

Each step is right to a tolerance; what many steps come to depends on the scene. By Taylor series the error is carried
along (`integrate.carried`), signed and of first order; STATED times that is to be believed. A cell of which that does
not show that it is right is followed again with a tolerance as much smaller; what then is left, and every cell by
another method, is followed three times. But where the error grows as large as the motion, several runs may agree by
chance, so that is INACCURATE.

Of three runs, the rough and the finest one have tolerances FINER apart: what they differ by is the rough one's error,
of which the finest, whose results are given, has about 1/FINER. The rough run's parameters are some roundings off
(`off_by_roundings`), and so are its start and the times of its events (`shake`); the third run has the opposite
roundings, and a tolerance between those two. It shows what a scene makes of rounding, which two runs may share. Where
that is all that tells them apart, these two are on both sides of the truth, and the finest may be as far from it as the
third one, and agree with that: then it is off by half of what it differs from the rough one by. So that may be no more
than what is wanted, and a tolerance for the steps.

Cells that come to rest or stick are gone on with: `accumulated`, `sliding`.
"""

import contextlib
import functools
from dataclasses import replace

import numpy as np

from kernels.codegen.accumulated import to_rest
from kernels.codegen.compiled import runner
from kernels.codegen.followed import followed, off_by_roundings, passages, status_of
from kernels.codegen.record import record
from kernels.expression.graph import SceneError
from kernels.integrate.carried import SMALL
from kernels.interface import FIRST_REFUSAL, UNSOLVED, Status

ROUNDING = 1e-14
"""The least rtol that is promised, whatever the runs agree to."""
ROUGH, MIDDLE, FINER = 2.0, 4.0, 16.0
MANY = 8.0
"""By how many times as many roundings parameters are changed: beside them those of the steps of a run are few."""
CONVERGED, BY_STEPS, ROUNDED = 3.0, 0.4, 0.2
"""How many times nearer to the finest run the one between is where both are off by their steps: it may then differ by
BY_STEPS of rtol; else rounding is what tells them apart, of which the finest run has no less, and by ROUNDED of it."""
TIGHTER, TIGHT, BETWEEN = 1e-4, 1e-14, 1e-2
"""The second tolerance, over the first one, and at most: what is stiff may come to rest only in the last digits; and
the third one, over the first one."""
TIGHTEST = 1e-13
"""The tightest second tolerance of an embedded pair: below it rounding stops the steps."""
LOST, MET_AGAIN = 1e-2, 1e-2
"""The doubt, as a share of a state's size, from which on runs have lost each other; and the factor by which doubts may
shrink more than tolerances do. Behind a transient of chaos all runs may be on one cycle of several, and the truth not:
of Duffing's oscillator in one cell of 400, with a factor of 5e-4 where motions that were not lost had 5e-2 and more."""
TRIED_AGAIN = Status.INACCURATE, Status.GRAZING, Status.STEP_LIMIT, Status.OUT_OF_RANGE
STATED = 1.5
"""Stated error over the one carried along."""
OF_A_STEP = 0.25
"""Tolerance of a step over the one of the whole motion: errors of some steps may add up."""
SMALLER, SMALLEST = 4.0, 1e-5
"""By how much less than what would do a second tolerance is, and the least share of the first one that is tried."""
AT_SWITCHES = 1e-3
"""The second tolerance along the way, over the first one."""
SLIDERS = {"taylor": ("dop853", "rodas5p")}
"""Methods by which a method follows what slides along a kink, where that is not itself."""


def solver(scene, method):
    """The function of columns and rtol that solves cells by a method: rows of time, interval and states; the status."""
    if method == "taylor":
        how = to_rest(lambda columns, rtol: by_error(scene, columns, rtol), scene, "told")
    else:
        how = to_rest(lambda columns, rtol: by_runs(runner(scene, method), columns, rtol, TIGHTEST), scene, method)

    def solve(columns, rtol):
        rows, status = how(columns, rtol)
        for slider in sliders(scene, method):  # the next where one finds no end of a cell's slide
            cells = np.flatnonzero(status == Status.STICKS)
            if len(cells):
                some, along = [c[cells] for c in columns], runner(sliding(scene), slider)
                rows[:, cells], status[cells] = by_runs(along, some, rtol[cells], TIGHTEST)
        return rows, status

    return solve


@functools.cache
def sliders(scene, method):
    """The methods by which that method follows what slides along a kink; none where nothing can."""
    recorded = record(scene)
    # powers of abs(u) are followed to u = 0 by series alone (`integrate.powers`); a kink may be a surface too
    if recorded.graph.powers or recorded.shared or len(recorded.graph.kinks) == len(recorded.surfaces):
        return ()
    return SLIDERS.get(method, (method,))


@functools.cache
def sliding(scene):
    """The scene that slides, for all methods; recorded at once as the scene is, or refused where it is asked for."""
    scene = replace(scene, slides=True)
    with contextlib.suppress(SceneError):
        record(scene)
    return scene


def once(one, columns, rtol):
    """Rows and status by one run, each step right to `rtol`."""
    results = followed(one, columns, rtol)
    return results[: one.outputs], status_of(results, results[-1], one.outputs)


def by_runs(one, columns, rtol, tightest=0.0):
    """Rows and status by three runs; INACCURATE where they differ by more than the finest one could mend.

    Where they do, or a run breaks off, the cell is followed by three again, with a tighter tolerance, of at least
    `tightest`; where that breaks off too, as of what is stiff, with one between. Runs that were LOST, and then differ
    by much less than their tolerances say, may have met again only where motions of all sorts end: INACCURATE.
    """
    rows, status, doubt = _compared(one, columns, rtol, rtol)
    again, last = np.flatnonzero(np.isin(status, TRIED_AGAIN) & (rtol >= ROUNDING)), 0.0 * rtol
    for tighter in (np.minimum(TIGHT, TIGHTER * rtol), BETWEEN * rtol):
        steps = np.maximum(tighter, tightest)
        again = again[((steps < rtol) & (steps > last))[again]]
        if len(again):
            better, verdict, less = _compared(one, [c[again] for c in columns], steps[again], rtol[again])
            met_again = (doubt[again] > LOST) & (less < MET_AGAIN * (steps / rtol)[again] * doubt[again])
            verdict[met_again & (verdict == Status.OK)] = Status.INACCURATE
            right = verdict <= Status.INACCURATE
            rows[:, again[right]], status[again[right]] = better[:, right], verdict[right]
            again, last = again[~right], steps
    return rows, status


def _compared(one, columns, rtol, wanted):
    """Rows of the finest of three runs to the tolerance `rtol`, the status where `wanted` is to be met, the doubt."""
    fine, rough, doubt = three_runs(
        lambda columns, finer, shake: followed(one, columns, rtol, rtol / finer, shake=shake), columns, rtol
    )
    status = status_of(fine, fine[-1], one.outputs)
    worst = doubt.max(axis=0)
    right = worst <= wanted
    status[((wanted < ROUNDING) | ~right) & (status == Status.OK)] = Status.INACCURATE
    worse = (rough[-1] > 0) & (status <= Status.INACCURATE)
    status[worse] = np.where(rough[-1][worse] < FIRST_REFUSAL, rough[-1][worse], Status.INACCURATE)
    return fine[: one.outputs], status, worst


def three_runs(run, columns, rtol):
    """The results of the finest and of the rough run, and how far off the finest one may be, a row each; NaN may be.

    Parameters
    ----------
    run : (columns, finer, shake) -> results
    rtol : tolerance of the steps, but for `finer`
    """
    rough = run(off_by_roundings(columns, MANY), ROUGH, 1.0)
    other = run(off_by_roundings(columns, -MANY), ROUGH * MIDDLE, -1.0)
    fine = run(columns, ROUGH * FINER, 0.0)
    states = (len(fine) - 3) // 2
    scale = np.concatenate([abs(fine[:2]), fine[2 + states : -1]])
    with np.errstate(all="ignore"):
        apart = (abs(fine - one)[: 2 + states] for one in (rough, other))
        far, close = (np.where(x == 0.0, 0.0, x / scale) for x in apart)
        share = np.where(CONVERGED * close <= far, BY_STEPS, ROUNDED)
        return fine, rough, np.maximum(far - rtol, close / share)


def by_error(scene, columns, rtol):
    """Rows and status by one run where that states an error below `rtol`, else by three."""
    one = runner(scene, "told")
    results, status, error = told(one, columns, rtol, rtol * OF_A_STEP)
    again = np.flatnonzero((status != Status.OK) & (results[-1] == Status.OK) & (error < np.inf) & (rtol >= ROUNDING))
    if len(again):
        share = OF_A_STEP * np.maximum(rtol[again] / (SMALLER * STATED * error[again]), SMALLEST)
        share[error[again] > SMALL] = OF_A_STEP * SMALLEST  # first order does not say how much of it is steps'
        some, wanted, least = [c[again] for c in columns], rtol[again], error[again] * share / OF_A_STEP
        results[:, again], status[again], error[again] = told(one, some, wanted, share * wanted, least)
    by_chance = (error > SMALL) & (error < np.inf) & (results[-1] < FIRST_REFUSAL)
    left, rows = np.flatnonzero((status != Status.OK) & ~by_chance), results[: one.outputs]
    if len(left):
        rows[:, left], status[left] = by_runs(one, [c[left] for c in columns], rtol[left])
    return rows, status


def told(one, columns, rtol, of_a_step, least=0.0):
    """Results, status and carried error; OK where the stated one is at most rtol, of which `least` is believed."""
    found = followed(one, columns, rtol, of_a_step, told=True)
    results, error = found[:-1], found[-1]
    status = status_of(results, results[-1], one.outputs)
    status[~(STATED * np.maximum(error, least) <= rtol) | (rtol < ROUNDING)] = Status.INACCURATE
    return results, status, error


def at_switches(scene, method, columns, rtol, stops):
    """Time and states (n_rows, n_stops, n_cells) at those switches; of each cell the error and status (`on_the_way`).

    By "taylor" the error is carried along the way; by other methods, and where that comes to nothing, as behind what
    grazes a surface, three runs are compared.
    """
    one, tells = runner(scene, "told" if method == "taylor" else method), method == "taylor"
    found, error = _along(one, columns, rtol, stops, tells)
    grazes = ((found[-1] == Status.GRAZING) & np.isnan(found[0])).any(axis=0)
    again, known = ~(error <= rtol) | grazes, error < np.inf
    for cells, carried in ((again & known, tells), (again & ~known, False)):
        left = np.flatnonzero(cells)
        if len(left):
            better, less = _along(one, [c[left] for c in columns], AT_SWITCHES * rtol[left], stops, carried)
            mended = ~(less >= error[left]) | grazes[left]
            found[:, :, left[mended]], error[left[mended]] = better[:, :, mended], less[mended]
    hangs = (found[-1] == Status.GRAZING).any(axis=0) & ~(error <= rtol)  # on what is not known: there may be no switch
    error[hangs] = np.inf
    return on_the_way(found[[0, *range(2, 2 + len(scene.states))]], found[-1], error)


def on_the_way(rows, verdict, error):
    """Rows (n_rows, n_stops, n_cells), NaN where a motion does not come to; the error of each cell, and its status.

    That is OK, or what was remarked, or why there is nothing at all, or not all. Where the method gives later stops up,
    which another one may solve, it is INACCURATE, and the error infinite.

    Parameters
    ----------
    verdict : of each stop and cell; NaN where nothing is known
    error : of what is given
    """
    ended = ~(verdict < FIRST_REFUSAL) | np.isnan(rows).any(axis=0)
    why, worst = np.fmax.reduce(verdict, axis=0), np.fmax.reduce(np.where(ended, 0, verdict), axis=0)
    given_up = np.isin(verdict, UNSOLVED).any(axis=0) & ~ended.all(axis=0)
    short = np.where(why == Status.STICKS, Status.COMES_TO_REST, Status.TOO_SHORT)
    short = np.where(given_up, Status.INACCURATE, short)
    status = np.where(ended.all(axis=0), why, np.where(ended.any(axis=0), short, worst)).astype(np.int8)
    return np.where(ended, np.nan, rows), np.where(given_up, np.inf, error), status


def _along(one, columns, rtol, stops, carried):
    """Results of one tolerance; of each cell the largest error of a switch that it comes to, infinite where unknown.

    So it is where of three runs one comes to a switch, and another one does not. `carried` : by one run
    """
    if carried:
        found = passages(one, columns, OF_A_STEP * rtol, stops, told=True)
        found, doubt, comes = found[:-1], STATED * found[-1:], found[-2] < FIRST_REFUSAL
    else:
        found, rough, doubt = three_runs(
            lambda columns, finer, shake: passages(one, columns[:-1], rtol / finer, stops, shake=shake),
            [*columns, np.full(len(rtol), stops[-1])],
            rtol,
        )
        comes = (found[-1] < FIRST_REFUSAL) | (rough[-1] < FIRST_REFUSAL)
    doubt = np.where(comes, np.where(np.isnan(doubt), np.inf, doubt), 0.0)
    return found, doubt.reshape(-1, len(rtol)).max(axis=0)
