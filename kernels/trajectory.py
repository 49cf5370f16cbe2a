"""Trajectories of a scene of your own: its states at each switch, or at given times.

A section has the states just before each requested switch, so that a bifurcation diagram is one study. A motion has the
states at given times after the start. Each state is accurate to rtol times the largest size that it had up to then, and
each time to rtol times itself; the least accurate one decides the status of the cell.
"""

import math
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from kernels.codegen.return_map import clocked
from kernels.codegen.to_tolerance import solver
from kernels.interface import FIRST_REFUSAL, UNSOLVED, Field, Kernel, Status
from kernels.scene import Scene, SceneParts, estimating_kernel, scene_of, states_of

__all__ = ["motion_kernel", "section_kernel"]

METHODS = {
    "taylor": "Taylor series, the error propagated",
    "rodas5p": "Rosenbrock's method Rodas5P, for stiff equations; three runs compared",
    "dop853": "Dormand-Prince 8(5,3); three runs compared",
}
MOST = 1_000_000.0


def section_kernel(**parts: Unpack[SceneParts]) -> Kernel:
    """Make a kernel for the states of a scene at its switches; arguments as in `kernels.scene.scene_kernel`.

    Returns
    -------
    Kernel
        Its outputs are `time` and each state just before the switch, along `passage`, the ascending numbers of the
        switches that a study names.
    """
    along = Field("passage", "1", "number of the switch, from the start", lower=1.0, upper=MOST, integer=True)
    return _at_stops(parts, scene_of(parts), along, [Field("time", "s", "time of the switch")])


def motion_kernel(**parts: Unpack[SceneParts]) -> Kernel:
    """Make a kernel for the states of a scene at given times; arguments as in `kernels.scene.scene_kernel`.

    Returns
    -------
    Kernel
        Its outputs are the states along `at`, ascending times after the start. TOO_SHORT if the motion ends before the
        last of them, for example because switches accumulate; later states are then NaN.
    """
    along = Field("at", "s", "time after the start", lower=0.0, open_lower=True)
    return _at_stops(parts, clocked(scene_of(parts)), along, [])


def _at_stops(parts: SceneParts, scene: Scene, along: Field, times: list[Field]) -> Kernel:
    """A kernel for the states of a scene at stops along its trajectory, which is followed once.

    States and times at stops that the motion does not reach are NaN. The status is OK, a remark, or the reason why
    stops are missing. If a method fails at later stops, which another one may solve, it is INACCURATE, with an infinite
    error.
    """
    outputs = [replace(f, dims=(along.name,), gaps=True) for f in (*times, *states_of(parts))]
    shown = [*range(len(times)), *range(2, 2 + len(parts["states"]))]

    def solved(method: str, columns: Any, rtol: Any, stops: Any, _: Any) -> Any:
        ends = (stops[-1], len(stops)) if scene.until else stops[-1:]
        columns = [*columns, *(np.full(len(rtol), float(end)) for end in ends)]
        results, status, error = solver(scene, method)(columns, rtol, stops)
        rows = results[shown]
        hangs = (status == Status.GRAZING) & ~(error <= rtol)  # on what is not known: there may be no switch
        error = np.where(hangs | np.isnan(error), math.inf, error)
        refused, given_up = status >= FIRST_REFUSAL, np.isin(status, UNSOLVED).any(axis=0)
        ended = refused | np.isnan(rows).any(axis=0)
        unasked = ended if scene.until else refused  # a time is there, whether or not the motion comes to it
        why, worst = np.maximum.reduce(status), np.maximum.reduce(np.where(ended, 0, status))
        short = np.where(why == Status.STICKS, Status.COMES_TO_REST, Status.TOO_SHORT)
        short = np.where(given_up, Status.INACCURATE, short)
        error = np.where(given_up, math.inf, np.maximum.reduce(np.where(unasked, 0.0, error)))
        status = np.where(ended.all(axis=0), why, np.where(ended.any(axis=0), short, worst)).astype(np.int8)
        return np.where(ended, math.nan, rows), error, status

    return estimating_kernel(parts, parts["parameters"], outputs, [along], METHODS, solved)
