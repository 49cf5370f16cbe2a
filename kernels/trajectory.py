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
from kernels.codegen.to_tolerance import at_switches, on_the_way
from kernels.interface import Field, Kernel, Status
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
        rows, error, status = at_switches(scene, method, columns, rtol, stops)
        return rows[: len(outputs)], error, status

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
        rows, status = found.reshape(len(states), many, count), status.reshape(many, count)
        return on_the_way(rows, status, np.where((status == Status.INACCURATE).any(axis=0), math.inf, rtol))

    return estimating_kernel(parts, parts["parameters"], outputs, [along], METHODS, solved)
