"""A scene of one's own along its way: its states at each switch, or at given times.

A section is the states just before each switch that is asked for, in one run: a diagram of bifurcations is one study.
A motion is the states at given times after the start. Each is right to rtol of the largest size that the state had on
the way, and each time to rtol of itself; the worst one counts for the cell.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from kernels.codegen.at_times import at_times
from kernels.codegen.compiled import compiling
from kernels.codegen.to_tolerance import at_switches
from kernels.interface import FIRST_REFUSAL, UNSOLVED, Field, Kernel, Method, Status
from kernels.lanes.wiring import signed
from kernels.scene import Function, Scene, SceneParts, limits_check, scene_of

__all__ = ["motion_kernel", "section_kernel"]

METHODS = {
    "taylor": "Taylor series, the error propagated",
    "rodas5p": "Rosenbrock's method Rodas5P, for stiff equations; three runs compared",
    "dop853": "Dormand-Prince 8(5,3); three runs compared",
}
MOST = 1_000_000.0


def section_kernel(
    *,
    source: str = "a study's own",
    example: Mapping[str, float] | None = None,
    **parts: Unpack[SceneParts],
) -> Kernel:
    """A kernel of a scene's states at many of its switches; the arguments are those of `kernels.scene.scene_kernel`.

    Returns
    -------
    Kernel
        Along `passage`, the numbers of the switches that a study asks for, rising: `time` and each state just before.
    """
    scene, states = scene_of(**parts), parts["states"]
    along = Field("passage", "1", "number of the switch, from the start", lower=1.0, upper=MOST, integer=True)
    outputs = tuple(
        replace(f, dims=("passage",), gaps=True) for f in (Field("time", "s", "time of the switch"), *states)
    )

    def solved(method: str, columns: list[Any], rtol: Any, stops: Any) -> Any:
        rows, error, status = at_switches(scene, method, columns, rtol, stops)
        return np.delete(rows, 1, axis=0)[: 1 + len(states)], error, status

    return _kernel(scene, source, parts["parameters"], outputs, along, solved, example)


def motion_kernel(
    *,
    source: str = "a study's own",
    example: Mapping[str, float] | None = None,
    **parts: Unpack[SceneParts],
) -> Kernel:
    """A kernel of a scene's states at given times; the arguments are those of `kernels.scene.scene_kernel`.

    Returns
    -------
    Kernel
        Along `at`, rising times after the start: each state then. TOO_SHORT where the motion does not come to all of
        them, as where its switches accumulate: then later states are NaN.
    """
    scene, states = scene_of(**parts), parts["states"]
    along = Field("at", "s", "time after the start", lower=0.0, open_lower=True)
    outputs = tuple(replace(f, dims=("at",), gaps=True) for f in states)

    def solved(method: str, columns: list[Any], rtol: Any, times: Any) -> Any:
        count, many = len(rtol), len(times)
        cells = [np.tile(c, many) for c in columns]
        found, status = at_times(scene, method, cells, np.repeat(times, count), np.tile(rtol, many))
        status = status.reshape(many, count)
        rows = found.reshape(len(states), many, count)
        missing = (status >= FIRST_REFUSAL) | np.isnan(rows).any(axis=0)
        short = missing & ~missing.all(axis=0)
        worst, rows = np.where(short, Status.TOO_SHORT, status).max(axis=0), np.where(missing, np.nan, rows)
        # what this method gives up, as the last times of a stiff motion, another one may solve
        given_up = np.isin(status, UNSOLVED).any(axis=0) & short.any(axis=0)
        worst[given_up] = Status.INACCURATE
        inaccurate = given_up | (status == Status.INACCURATE).any(axis=0)
        return rows, np.where(inaccurate, math.inf, rtol), worst.astype(np.int8)

    return _kernel(scene, source, parts["parameters"], outputs, along, solved, example)


def _kernel(
    scene: Scene,
    source: str,
    parameters: Sequence[Field],
    outputs: Sequence[Field],
    along: Field,
    solved: Function,
    example: Mapping[str, float] | None,
) -> Kernel:
    """The declaration; `solved(method, columns, rtol, points)`: rows (n_outputs, n_points, n_cells), error, status."""
    count = len(parameters)

    def method(name: str) -> Method:
        def solve(*columns: Any) -> None:
            given, (rtol, points, _), (*found, error, status) = (
                list(columns[:count]),
                columns[count : count + 3],
                columns[count + 3 :],
            )
            if not len(status):
                return
            if not (len(points) and (np.diff(points) > 0.0).all()):
                status[:], error[:] = Status.BAD_INPUT, math.nan
                return
            with compiling(scene.name, name):
                rows, error[:], status[:] = solved(name, given, rtol, points)
            for column, row in zip(found, rows, strict=True):
                column[:] = np.where(status >= FIRST_REFUSAL, np.nan, row).T

        names = [f.name for f in outputs]
        columns = [*(f.name for f in parameters), "rtol", along.name, "asked", *names, "error", "status"]
        return Method(name, METHODS[name], signed(solve, columns), estimates=True)

    return Kernel(
        name=scene.name,
        doc=scene.doc,
        source=source,
        parameters=tuple(parameters),
        outputs=tuple(outputs),
        check=limits_check(parameters),
        methods=tuple(map(method, METHODS)),
        along=(along,),
        example=dict(example or {}),
    )
