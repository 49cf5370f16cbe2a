"""Solves columns of cells to a tolerance, in as many runs as an error estimate needs.

Each step meets a tolerance; the accumulated error depends on the scene. With Taylor series the error is propagated
(`integrate.carried`), signed and of first order; STATED times it is taken as a bound. If that exceeds rtol, the cell is
solved again with a smaller tolerance, up to TRIALS times; cells that remain, and all cells by other methods, are solved
three times. If the error grows as large as the motion, several runs may agree by chance: INACCURATE. If the factor is
known by which switches multiply the truncation error of each leg, which is equal in all runs if a leg is one step, only
runs with a far smaller tolerance reveal rounding errors.

Of the three runs, the coarsest and the finest have tolerances that differ by the factor FINER, or for an embedded pair
by that which halves its steps: their difference is the error of the coarsest, and that of the finest, whose results are
returned, is smaller by about this factor. The parameters of the coarsest run are perturbed by some roundings
(`off_by_roundings`), as are its start and the times of its events (`shake`); the third run has the opposite roundings,
and a tolerance in between. It shows how the scene amplifies rounding, which two runs might share. If rounding
dominates, these two runs lie on both sides of the truth, and the finest may be as far from it as the third and agree
with that: its error is then half of its difference from the coarsest. So that half may not exceed rtol plus a tolerance
for the steps.

A cell may have several stops, numbers of switches. Each is judged separately, and the cell is solved again if one is
not accurate. Cells that come to rest or stick are continued by `accumulated` and `sliding`.
"""

import contextlib
import functools
from dataclasses import replace

import numpy as np

from kernels.codegen.accumulated import to_rest
from kernels.codegen.compiled import runner, written_of
from kernels.codegen.followed import followed, off_by_roundings, put, status_of
from kernels.codegen.record import record
from kernels.expression.graph import SceneError
from kernels.integrate.carried import SMALL
from kernels.interface import FIRST_REFUSAL, Status

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
TRIED_AGAIN = Status.INACCURATE, Status.GRAZING, Status.STEP_LIMIT
STATED = 1.5
"""Stated error over the one carried along."""
OF_A_STEP = 0.25
"""Tolerance of a step over the one of the whole motion: errors of some steps may add up."""
SMALLER, SMALLEST, TRIALS = 4.0, 1e-5, 3
"""By how much less than what would do the next tolerance is, its least share of the first one, and how many are tried.
"""
NEAR_POWERS = 0.125
"""The tolerance of three runs by series, over rtol, where there are powers: on the way to the kink of one, and from it,
steps are many, and err to one side."""
SLIDERS = {"taylor": ("dop853", "rodas5p")}
"""Methods by which a method follows what slides along a kink, where that is not itself."""


def solver(scene, method, again=True, sure=True):
    """The function of columns, rtol and, maybe, stops that solves cells by a method: results, statuses and errors.

    Results are rows as those of `followed`; an error is what the results of a cell, at a stop, are right to, infinite
    or NaN where that is not known.
    `again` : whether what three runs leave unsure is followed with tighter tolerances
    `sure` : whether errors are wanted; else cells are followed once
    """

    def how(columns, rtol, stops=None):
        if not sure:
            results, status = once(runner(scene, "told" if method == "taylor" else method), columns, rtol, stops)
            return results, status, np.full_like(results[-1], np.nan)
        if method == "taylor":
            return by_error(runner(scene, "told"), columns, rtol, 0.0 if again else np.inf, stops)
        return by_runs(runner(scene, method), columns, rtol, TIGHTEST if again else np.inf, stops)

    def solve(columns, rtol, stops=None):
        found = results, status, _ = how(columns, rtol, stops)
        if stops is None:
            to_rest(how, columns, rtol, results, status)
        for slider in sliders(scene, method):  # the next where one finds no end of a cell's slide
            sticks = status == Status.STICKS
            cells = np.flatnonzero(some_stop(sticks))
            if len(cells):
                along, some = runner(sliding(scene), slider), [c[cells] for c in columns]
                further = by_runs(along, some, rtol[cells], TIGHTEST, stops)
                put(found, cells, further, some_stop(sticks[..., cells] & (further[1] != Status.STICKS)))
        return found

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


def some_stop(condition):
    """For each cell, whether the condition (n_stops, n_cells) or (n_cells,) holds at any of its stops."""
    return np.atleast_2d(condition).any(axis=0)


def once(one, columns, rtol, stops=None):
    """Results and status by one run, each step right to `rtol`."""
    results = followed(one, columns, rtol, stops=stops)
    return results, status_of(results, one.outputs)


def by_runs(one, columns, rtol, tightest=0.0, stops=None, begin=None):
    """Results, statuses and errors by three runs; INACCURATE where the finest one may be off by more than rtol.

    Where it may, or a run breaks off, the cell is followed by three again, with a tolerance tighter than that of the
    first three, `begin` (None: rtol), of at least `tightest`; where that breaks off too, as of what is stiff, with one
    between. Runs that were LOST, and then differ by much less than their tolerances say, may have met again only where
    motions of all sorts end: INACCURATE.
    """
    by_series_of_powers = one.order is None and written_of(one.scene)[0].graph.powers
    begin = rtol if begin is None else begin
    steps = NEAR_POWERS * begin if by_series_of_powers else begin
    found = _, status, error = three_runs(one, columns, steps, rtol, stops)
    left, last = np.flatnonzero(some_stop(np.isin(status, TRIED_AGAIN) & (rtol >= ROUNDING))), 0.0 * rtol
    for tighter in (np.minimum(TIGHT, TIGHTER * rtol), BETWEEN * rtol):
        steps = np.maximum(tighter, tightest)
        left = left[((steps < begin) & (steps > last))[left]]
        if len(left):
            fine, better, doubt = three_runs(one, [c[left] for c in columns], steps[left], rtol[left], stops)
            before, doubted = status[..., left], error[..., left]
            met_again = (doubted > LOST) & (doubt < MET_AGAIN * (steps / rtol)[left] * doubted)
            better[met_again & (better == Status.OK)] = Status.INACCURATE
            worse = (better > Status.INACCURATE) & ((better != before) | np.isin(before, TRIED_AGAIN))
            right = ~some_stop(worse)
            put(found, left, (fine, better, doubt), right)
            left, last = left[~right], steps
    return found


def three_runs(one, columns, rtol, wanted, stops):
    """Results of the finest of three runs to the tolerance `rtol`, statuses where `wanted` is to be met, and doubts.

    Where the finest one reaches its limit of steps, the results of the third, and never OK.
    Where the rough one comes to no end, nor to any stop, the others, which take more steps, are not run; but along a
    kink they may tell that the motion sticks.
    """
    rough = followed(one, off_by_roundings(columns, MANY), rtol, rtol / ROUGH, 1.0, stops=stops)
    cells = np.flatnonzero(some_stop(rough[-1] != Status.STEP_LIMIT) | one.scene.slides)
    factor = FINER if one.order is None else 2.0**one.order
    other, fine = rough.copy(), rough.copy()
    some, of_some = [c[cells] for c in columns], rtol[cells]
    for found, given, finer, shake in (
        (other, off_by_roundings(some, -MANY), ROUGH * MIDDLE, -1.0),
        (fine, some, ROUGH * factor, 0.0),
    ):
        found[..., cells] = followed(one, given, of_some, of_some / finer, shake, stops=stops)
    unfinished = (fine[-1] == Status.STEP_LIMIT) & (other[-1] <= Status.INACCURATE)
    fine[:, unfinished] = other[:, unfinished]
    states, first = len(one.scene.states), 2 * one.scene.until  # times are given there, and not found
    scale = np.concatenate([abs(fine[first:2]), fine[2 + states : -1]])
    with np.errstate(all="ignore"):
        apart = (abs(fine - run)[first : 2 + states] for run in (rough, other))
        far, close = (np.where(x == 0.0, 0.0, x / scale) for x in apart)
        close = np.where(unfinished, far, close)
        share = np.where(CONVERGED * close <= far, BY_STEPS, ROUNDED)
        doubt = np.maximum(far - rtol, close / share).max(axis=0)
    status = status_of(fine, one.outputs)
    status[((wanted < ROUNDING) | unfinished | ~(doubt <= wanted)) & (status == Status.OK)] = Status.INACCURATE
    worse = (rough[-1] > 0) & (status <= Status.INACCURATE)
    status[worse] = np.where(rough[-1][worse] < FIRST_REFUSAL, rough[-1][worse], Status.INACCURATE)
    return fine, status, doubt


def by_error(one, columns, rtol, tightest=0.0, stops=None):
    """Results, statuses and errors by a run that states an error below `rtol`, else by three."""
    found = results, status, error = told(one, columns, rtol, rtol * OF_A_STEP, stops=stops)
    least, share = 0.0 * rtol, np.ones_like(rtol)
    for _ in range(TRIALS):
        known = (status != Status.OK) & (results[-1] == Status.OK) & (error < np.inf) & (rtol >= ROUNDING)
        again = np.flatnonzero(some_stop(known) & (share > SMALLEST))
        if not len(again):
            break
        wanted, most = rtol[again], np.atleast_2d(np.where(known, error, 0.0)).max(axis=0)[again]
        # first order does not say how much of what is large is steps'
        smaller = np.where(most > SMALL, SMALLEST, np.maximum(wanted / (SMALLER * STATED * most), SMALLEST))
        share[again], most = np.maximum(smaller * share[again], SMALLEST), most * smaller
        new = told(one, [c[again] for c in columns], wanted, OF_A_STEP * share[again] * wanted, most, stops)
        right = ~some_stop((new[1] >= FIRST_REFUSAL) & (status[..., again] < FIRST_REFUSAL))
        least[again[right]] = most[right]
        put(found, again, new, right)
    by_chance = (error > SMALL) & (error < np.inf) & (results[-1] < FIRST_REFUSAL)
    left = np.flatnonzero(some_stop(status != Status.OK) & ~some_stop(by_chance))
    known = (results[-1] == Status.OK) & (error < np.inf)
    begin = np.where(some_stop(known) & (tightest < np.inf), SMALLEST, 1.0) * rtol
    error[:] = STATED * np.maximum(error, least)
    if len(left):
        new = by_runs(one, [c[left] for c in columns], rtol[left], tightest, stops, begin[left])
        put(found, left, new, ~some_stop(known[..., left] & (new[1] == Status.INACCURATE)))
    return found


def told(one, columns, rtol, of_a_step, least=0.0, stops=None):
    """Results, status and carried error; OK where the stated one is at most rtol, of which `least` is believed."""
    found = followed(one, columns, rtol, of_a_step, told=True, stops=stops)
    results, error = found[:-1], found[-1]
    status = status_of(results, one.outputs)
    unsure = ~(STATED * np.maximum(error, least) <= rtol) | (rtol < ROUNDING)
    status[unsure & (results[-1] < FIRST_REFUSAL)] = Status.INACCURATE
    return results, status, error
