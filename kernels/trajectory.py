"""A scene of one's own along its way: its states at each switch, or at given times.

A section is the states just before each switch that is asked for, in one run: a diagram of bifurcations is one study.
A motion is the states at given times after the start. Each is right to rtol of the largest size that the state had on
the way, and each time to rtol of itself; the worst one counts for the cell.
"""

import math
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from kernels.codegen.return_map import at_times
from kernels.codegen.to_tolerance import solver
from kernels.interface import FIRST_REFUSAL, UNSOLVED, Field, Kernel, Status
from kernels.scene import SceneParts, estimating_kernel, scene_of, states_of

__all__ = ["motion_kernel", "section_kernel"]

METHODS = {
    "taylor": "Taylor series, the error propagated",
    "rodas5p": "Rosenbrock's method Rodas5P, for stiff equations; three runs compared",
    "dop853": "Dormand-Prince 8(5,3); three runs compared",
}
MOST = 1_000_000.0


def section_kernel(**parts: Unpack[SceneParts]) -> Kernel:
    """A kernel of a scene's states at many of its switches; the arguments are those of `kernels.scene.scene_kernel`.

    Returns
    -------
    Kernel
        Along `passage`, the numbers of the switches that a study asks for, rising: `time` and each state just before.
    """
    scene, states = scene_of(parts), states_of(parts)
    along = Field("passage", "1", "number of the switch, from the start", lower=1.0, upper=MOST, integer=True)
    outputs = [replace(f, dims=("passage",), gaps=True) for f in (Field("time", "s", "time of the switch"), *states)]

    def solved(method: str, columns: Any, rtol: Any, stops: Any, _: Any) -> Any:
        columns = [*columns, np.full(len(rtol), stops[-1])]
        results, status, error = solver(scene, method)(columns, rtol, stops)
        hangs = (status == Status.GRAZING) & ~(error <= rtol)  # on what is not known: there may be no switch
        rows = results[[0, *range(2, 1 + len(outputs))]]
        return on_the_way(rows, status, np.where(hangs | np.isnan(error), math.inf, error))

    return estimating_kernel(parts, parts["parameters"], outputs, [along], METHODS, solved)


def motion_kernel(**parts: Unpack[SceneParts]) -> Kernel:
    """A kernel of a scene's states at given times; the arguments are those of `kernels.scene.scene_kernel`.

    Returns
    -------
    Kernel
        Along `at`, rising times after the start: each state then. TOO_SHORT where the motion does not come to all of
        them, as where its switches accumulate: then later states are NaN.
    """
    scene, states = scene_of(parts), states_of(parts)
    along = Field("at", "s", "time after the start", lower=0.0, open_lower=True)
    outputs = [replace(f, dims=("at",), gaps=True) for f in states]

    def solved(method: str, columns: Any, rtol: Any, times: Any, _: Any) -> Any:
        count, many = len(rtol), len(times)
        cells = [np.tile(c, many) for c in columns]
        found, status = at_times(scene, method, cells, np.repeat(times, count), np.tile(rtol, many))
        rows, status = found[: len(states)].reshape(len(states), many, count), status.reshape(many, count)
        return on_the_way(rows, status, np.where(status == Status.INACCURATE, math.inf, rtol))

    return estimating_kernel(parts, parts["parameters"], outputs, [along], METHODS, solved)


def on_the_way(rows: Any, status: Any, error: Any) -> tuple[Any, Any, Any]:
    """Rows (n_rows, n_stops, n_cells), NaN where a motion does not come to; the error of each cell, and its status.

    That is OK, or what was remarked, or why there is nothing at all, or not all. Where the method gives later stops up,
    which another one may solve, it is INACCURATE, and the error infinite. `status`, `error` : of each stop and cell
    """
    refused, given_up = status >= FIRST_REFUSAL, np.isin(status, UNSOLVED).any(axis=0)
    ended = refused | np.isnan(rows).any(axis=0)
    why, worst = np.maximum.reduce(status), np.maximum.reduce(np.where(ended, 0, status))
    short = np.where(why == Status.STICKS, Status.COMES_TO_REST, Status.TOO_SHORT)
    short = np.where(given_up, Status.INACCURATE, short)
    error = np.where(given_up, math.inf, np.maximum.reduce(np.where(refused, 0.0, error)))
    status = np.where(ended.all(axis=0), why, np.where(ended.any(axis=0), short, worst)).astype(np.int8)
    return np.where(ended, math.nan, rows), error, status
