"""A scene as it is at given times, and at many of its switches in one run."""

import functools
from dataclasses import replace

import numpy as np

from kernels.codegen import followed_twice, stated_error
from kernels.codegen.module import build
from kernels.codegen.return_map import asked, named, to_the_end
from kernels.codegen.stepped import runs
from kernels.interface import FIRST_REFUSAL, Status
from kernels.source_text.expression import where

TIGHTER = 1e-3
"""The second tolerance, over the first one, of cells that the first does not show to be right."""
CLOCK, COUNT, MANY, UNTIL = "clock_of_motion", "count_of_switches", "switches_before", "time_wanted"


def at_switches(scene, method, columns, rtol, stops):
    """Time, interval, states (n_rows, n_stops, n_cells), the error of each cell, relative, and its status.

    Along the way the error is carried; by a method other than "taylor" three runs are compared. What a motion does not
    come to is NaN; a cell's status is OK, or what was remarked, or why there is nothing at all.
    """
    n = len(scene.states)
    found, error = _once(scene, method, columns, rtol, stops)
    again = np.flatnonzero(~(error <= rtol))
    if len(again):
        better, less = _once(scene, method, [c[again] for c in columns], TIGHTER * rtol[again], stops)
        mended = ~(less >= error[again])
        found[:, :, again[mended]], error[again[mended]] = better[:, :, mended], less[mended]
    verdict = found[-1]
    ended = (verdict >= FIRST_REFUSAL) | np.isnan(verdict)
    rows = np.where(ended, np.nan, found[: 2 + n])
    worst = np.fmax.reduce(np.where(ended, 0.0, verdict), axis=0)
    why = np.fmax.reduce(verdict, axis=0)
    short = np.where(why == Status.STICKS, Status.COMES_TO_REST, Status.TOO_SHORT)
    status = np.where(ended.all(axis=0), why, np.where(ended.any(axis=0), short, worst))
    return rows, error, status.astype(np.int8)


def _once(scene, method, columns, rtol, stops):
    """Results of one tolerance and their error."""
    if method == "taylor":
        module = stated_error.telling(scene)
        found = followed_twice.passages(module, columns, stated_error.OF_A_STEP * rtol, stops, tells=True)
        return found[:-1], stated_error.STATED * np.fmax.reduce(found[-1], axis=0)
    by_pair, n = runs(scene, method), len(scene.states)
    rough, finer, many = followed_twice.ROUGH, followed_twice.FINER, followed_twice.MANY
    ends = [*columns, np.full(len(rtol), stops[-1])]
    first, other = (
        followed_twice.passages(
            by_pair, followed_twice.off_by_roundings(ends, sign * many)[:-1], rtol, stops, rough * finer_by, shake=sign
        )
        for sign, finer_by in ((1.0, 1.0), (-1.0, followed_twice.BETWEEN))
    )
    fine = followed_twice.passages(by_pair, columns, rtol, stops, rough * finer)
    with np.errstate(all="ignore"):
        scale = np.concatenate([abs(fine[:2]), fine[2 + n : -1]])
        apart = np.fmax(abs(fine - first), abs(fine - other))[: 2 + n] / np.where(scale > 0.0, scale, 1.0)
    return fine, np.fmax.reduce(apart.reshape(-1, apart.shape[-1]), axis=0)


def at_times(scene, method, columns, times, before, rtol):
    """The states (n_states, n_cells) at a time each, behind so many switches before it; and the status."""
    n, ends, count = len(scene.states), timed(scene), len(rtol)
    found, status = np.full((4 + n, count), np.nan), np.empty(count, np.int8)
    to_the_end(ends, method)(build(ends), [*columns, before, times, before + 1.0], rtol, list(found), status)
    return found[2 : 2 + n], status


@functools.cache
def timed(scene):
    """The scene that ends at the time UNTIL, behind MANY switches: then its clock is what the surface watches."""
    graph_names = (*scene.states, CLOCK, COUNT)

    def rates(**given):
        return (*asked(scene.rates, given), 1.0, 0.0)

    def surface(**given):
        (own,) = asked(scene.surface, given)
        return where(given[MANY] - 0.5 > given[COUNT], own, given[UNTIL] - given[CLOCK])

    def switch(**given):
        own = tuple(given[name] for name in scene.states) if scene.switch is None else asked(scene.switch, given)
        return (*own, given[CLOCK], given[COUNT] + 1.0)

    def start(**given):
        return (*asked(scene.start, given), 0.0, 0.0)

    parameters = (*scene.parameters, MANY, UNTIL)
    everything = (*graph_names, *parameters, "side")
    return replace(
        scene, name=f"{scene.name}_timed", states=graph_names, parameters=parameters, rates=named(rates, everything),
        surface=named(surface, everything), switch=named(switch, everything), start=named(start, (*parameters, "side")),
    )  # fmt: skip
