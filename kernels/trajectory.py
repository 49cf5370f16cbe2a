"""A scene of one's own along its way: its states at each switch, or at given times.

A section is the states just before each switch that is asked for, in one run: a diagram of bifurcations is one study.
A motion is the states at given times after the start. Each is right to rtol of the largest size that the state had on
the way, and each time to rtol of itself; the worst one counts for the cell.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kernels.codegen.at_times import at_switches, at_times
from kernels.codegen.module import compiling
from kernels.interface import FIRST_REFUSAL, Field, Kernel, Method, Status
from kernels.lanes.wiring import signed
from kernels.scene import Function, Functions, Scene, bare, flips_field, limits_check, scene_of

__all__ = ["motion_kernel", "section_kernel"]

METHODS = {
    "taylor": "Taylor series, the error carried along",
    "rodas5p": "Rosenbrock's method Rodas5P, for what is stiff, followed three times",
    "dop853": "Dormand-Prince 8(5,3), followed three times",
}
MOST = 1_000_000.0


def section_kernel(
    *,
    name: str,
    doc: str,
    states: Sequence[Field],
    parameters: Sequence[Field],
    rates: Function,
    surface: Functions,
    start: Function,
    switch: Functions | None = None,
    start_time: Function | float | None = None,
    source: str = "a study's own",
    example: Mapping[str, float] | None = None,
) -> Kernel:
    """A kernel of a scene's states at many of its switches; the arguments are those of `kernels.scene.scene_kernel`.

    Returns
    -------
    Kernel
        Along `passage`, the numbers of the switches that a study asks for, rising: `time` and each state just before.
    """
    scene = scene_of(name, doc, states, parameters, rates, surface, start, switch, start_time)
    along = Field("passage", "1", "number of the switch, from the start", lower=1.0, upper=MOST, integer=True)
    outputs = tuple(
        replace(f, dims=("passage",), gaps=True) for f in (Field("time", "s", "time of the switch"), *states)
    )

    def solved(method: str, columns: list[Any], rtol: Any, stops: Any) -> Any:
        rows, error, status = at_switches(scene, method, columns, rtol, stops)
        return np.delete(rows, 1, axis=0)[: 1 + len(states)], error, status

    return _kernel(scene, source, parameters, outputs, along, solved, example)


def motion_kernel(
    *,
    name: str,
    doc: str,
    states: Sequence[Field],
    parameters: Sequence[Field],
    rates: Function,
    surface: Function,
    start: Function,
    switch: Function | None = None,
    source: str = "a study's own",
    example: Mapping[str, float] | None = None,
) -> Kernel:
    """A kernel of a scene's states at given times; the arguments are those of `kernels.scene.scene_kernel`.

    Returns
    -------
    Kernel
        Along `at`, rising times after the start: each state then. Its further parameter `flips` is the number of
        switches that are followed at most: TOO_SHORT where later times are asked for, which are NaN.
    """
    scene = bare(scene_of(name, doc, states, parameters, rates, surface, start, switch))
    along = Field("at", "s", "time after the start", lower=0.0, open_lower=True)
    outputs = tuple(replace(f, dims=("at",), gaps=True) for f in states)

    def solved(method: str, columns: list[Any], rtol: Any, times: Any) -> Any:
        *own, flips = columns
        count, n = len(rtol), len(states)
        stops = np.arange(1.0, flips.max() + 1.0)
        (passed, *_), _, _ = at_switches(scene, method, own, rtol, stops)
        passed = np.where(stops[:, None] <= flips, passed, np.nan)
        before = np.array([(passed <= t).sum(axis=0) for t in times])  # (n_times, n_cells)
        cells = [np.tile(c, len(times)) for c in own]
        found, status = at_times(
            scene, method, cells, np.repeat(times, count), before.ravel().astype(float), np.tile(rtol, len(times))
        )
        late = (before >= flips) & (passed[np.maximum(flips.astype(int) - 1, 0), np.arange(count)] < times[:, None])
        shape = len(times), count
        status = np.where(late, Status.TOO_SHORT, status.reshape(shape))
        rows = np.where(late | (status >= FIRST_REFUSAL), np.nan, found.reshape(n, *shape))
        inaccurate = (status == Status.INACCURATE).any(axis=0)
        return rows, np.where(inaccurate, math.inf, rtol), status.max(axis=0).astype(np.int8)

    return _kernel(scene, source, (*parameters, flips_field(100.0, 10_000.0)), outputs, along, solved, example)


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
