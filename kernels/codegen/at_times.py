"""A scene as it is at given times, and at many of its switches in one run.

For times a scene of its own is made, with a clock as its last state: its first surface is that the clock comes to the
time wanted, or to the end of a drive's period, and it alone counts.
"""

import functools
import inspect
from dataclasses import replace

import numpy as np

from kernels.codegen import followed_twice, stated_error
from kernels.codegen.accumulated import to_rest
from kernels.codegen.module import build
from kernels.codegen.record import named_functions
from kernels.codegen.slid_along import slid_along
from kernels.codegen.stepped import runs, twice_by
from kernels.interface import FIRST_REFUSAL, Status
from kernels.source_text.expression import math_recorded

TIGHTER = 1e-3
"""The second tolerance, over the first one, of cells that the first does not show to be right."""
CLOCK, UNTIL = "clock_of_motion", "time_wanted"
MOST_SWITCHES = 100_000
"""Before the time wanted: a motion whose switches accumulate does not come to it."""


def to_the_end(scene, method):
    """The function of columns that follows the scene by the method: to where switches accumulate, and along kinks."""
    how = stated_error.by_one(scene) if method == "taylor" else twice_by(method, scene)
    return slid_along(to_rest(how), scene, method)


def named(function, names):
    """A function of keywords that asks for these names."""
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    function.__signature__ = inspect.Signature([inspect.Parameter(name, kind) for name in names])
    return function


def asked(function, values):
    """What a scene's function returns for those of the values that it asks for, as a tuple; a constant for itself."""
    if not callable(function):
        return (function,)
    with math_recorded(function):
        found = function(**{name: values[name] for name in inspect.signature(function).parameters})
    return tuple(found) if isinstance(found, tuple | list | np.ndarray) else (found,)


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


@functools.cache
def clocked(scene, drive=None):
    """The scene that ends where its clock has gone on by UNTIL; or which counts its drive's periods, and begins anew.

    `drive` : the period, a number or a function of parameters; then the clock is put back at its end
    """
    timed = scene if scene.start_time is not None else replace(scene, states=(*scene.states, CLOCK), start_time=0.0)
    clock, parameters = timed.states[-1], (*scene.parameters, *([UNTIL] if drive is None else []))

    def until(**given):
        (begin,), (long,) = asked(timed.start_time, given), asked(given.get(UNTIL, drive), given)
        return begin + long - given[clock]

    def again(**given):
        return (*(given[name] for name in timed.states[:-1]), *asked(timed.start_time, given))

    own, jumps = named_functions(scene.surface or {}), named_functions(scene.switch)
    everywhere = jumps.pop("", None)
    surfaces = {f"own {name}": function for name, function in own.items()}
    switches = dict.fromkeys(surfaces, everywhere) | {f"own {name}": function for name, function in jumps.items()}
    if drive is not None:
        switches[f".{CLOCK}"] = named(again, (*timed.states, *parameters))
    return replace(
        timed, name=f"{scene.name}_clocked", parameters=parameters, switch=switches, only_first=True,
        surface={f".{CLOCK}": named(until, (*parameters, clock))} | surfaces, most_kinks=MOST_SWITCHES,
    )  # fmt: skip


def at_times(scene, method, columns, times, rtol):
    """The states (n_states, n_cells) at a time after the start each; and the status."""
    ends, count = clocked(scene), len(rtol)
    n = len(ends.states) - 1
    found, status = np.full((2 + len(ends.states), count), np.nan), np.empty(count, np.int8)
    to_the_end(ends, method)(build(ends), [*columns, times, np.ones(count)], rtol, list(found), status)
    return found[2 : 2 + n], status
