"""Scenes of your own solved by textbook integrators with a fixed step.

The parameters `step` and `location` (`events`) may be axes of a study. A cell is solved three times (`three_steps`);
the differences between these runs give `error`, which is also the bound of the method. If they grow as the step
shrinks, the cell is INACCURATE. Semi-implicit Euler and Verlet need states in pairs (position, velocity); Moreau's
method needs one pair, with dry friction at velocity 0.
"""

import math
from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np

from kernels.codegen import three_steps
from kernels.codegen.compiled import compiling, runner
from kernels.codegen.record import record
from kernels.expression.graph import INPUT
from kernels.integrate.events import LOCATIONS, METHODS
from kernels.interface import Field, Kernel, Method, Status
from kernels.lanes.wiring import signed
from kernels.scene import TIMES, Function, Scene, SceneError, SceneParts, declared, flips_field, scene_of

__all__ = ["METHODS", "stepped_kernel", "stepping_fields", "stepping_methods"]

MOST_FLIPS = 10_000
DOCS = {
    "euler": "explicit Euler, order 1",
    "semi_implicit": "semi-implicit Euler, order 1",
    "verlet": "velocity Verlet, order 2",
    "rk4": "classical Runge-Kutta, order 4",
    "dopri5": "Dormand-Prince at a fixed step, order 5",
    "dop853": "Dormand-Prince at a fixed step, order 8",
    "moreau": "Moreau's time-stepping, order 1: dry friction without location",
}
COST = (
    Field("error", "1", "estimated largest relative error", of_method=True),
    Field("steps", "1", "steps taken", integer=True, of_method=True),
    Field("rate_calls", "1", "evaluations of the right-hand side", integer=True, of_method=True),
)


def stepping_fields(flips: float = 20.0) -> tuple[Field, Field, Field]:
    """Parameters of every scene with a fixed step: switches to follow, step, location."""
    words: dict[str, Any] = {"lower": 0.0, "upper": 3.0, "choices": LOCATIONS, "integer": True}
    return (
        flips_field(flips, MOST_FLIPS),
        Field("step", "s", "time step", lower=0.0, open_lower=True),
        Field("location", "1", "how a switch is located within its step", default=3.0, **words),
    )


def stepping_methods(
    scene: Scene, parameters: Sequence[Field], outputs: Sequence[Field], fill: Function
) -> tuple[Method, ...]:
    """The methods that can do the scene.

    Parameters
    ----------
    parameters, outputs : fields; the last parameters are those of `stepping_fields`, the last outputs `COST`
    fill : (time, interval, states, their reach, outputs but the last three) writes these
    """
    count, names = len(parameters), [f.name for f in parameters]
    n = len(scene.states)

    def solved(name: str, columns: Sequence[Any]) -> Any:
        with compiling(scene.name, name):
            return three_steps.solved(runner(scene, "fixed"), name, columns[: count - 2], *columns[count - 2 : count])

    def method(name: str) -> Method:
        def solve(*columns: Any) -> None:
            *wanted, error, steps, rate_calls, status = columns[count + 1 :]
            if len(status):
                found, error[:], status[:] = solved(name, columns)
                fill(found[0], found[1], found[2 : 2 + n], found[2 + n : 2 + 2 * n], wanted)
                steps[:], rate_calls[:] = found[-2:]

        def bound(*columns: Any) -> None:
            if len(columns[0]):
                _, error, status = solved(name, columns)
                columns[-1][:] = np.where(np.isnan(error) | (status == Status.INACCURATE), math.inf, error)

        whole = signed(solve, [*names, "rtol", *(f.name for f in outputs), "status"])
        return Method(name, DOCS[name], whole, signed(bound, [*names, "rtol", "asked", "out"]))

    return tuple(method(name) for name in _able(scene))


def _able(scene: Scene) -> list[str]:
    """The methods that can do the scene: pairs (x, v) with x' = v; for Moreau's one, kinks at v = 0."""
    recorded, timed = record(scene), scene.start_time is not None
    n = len(scene.states) - timed

    def is_speed(place: int, u: Any) -> bool:
        return bool(u.kind == INPUT and u.args[0] == scene.states[place + 1])

    paired = n % 2 == 0 and all(is_speed(j, recorded.rates[j]) for j in range(0, n, 2))
    dry = paired and n == 2 and not timed and all(is_speed(0, u) for u in recorded.graph.kinks)
    wants = {"semi_implicit": paired, "verlet": paired, "moreau": dry}
    return [name for name in METHODS if wants.get(name, True)]


def _fill_plainly(time: Any, interval: Any, states: Any, reach: Any, columns: Any) -> None:
    for column, row in zip(columns, (time, interval, *states), strict=False):  # the time may be a further state
        column[:] = row


def stepped_kernel(**parts: Unpack[SceneParts]) -> Kernel:
    """Make a kernel that follows a scene with a fixed step; arguments as in `kernels.scene.scene_kernel`.

    Returns
    -------
    Kernel
        Its parameters are those of the scene, `flips`, `step` and `location`; its outputs are `time` of the last
        switch, `interval` since the previous one, each state just before it, and `error`, `steps`, `rate_calls`.
    """
    scene = scene_of(parts)
    if not callable(scene.surface):
        raise SceneError(f"the scene {scene.name}: with a fixed step only one surface is possible")
    fields, outputs = (*parts["parameters"], *stepping_fields()), (*TIMES, *parts["states"], *COST)
    return declared(parts, fields, outputs, stepping_methods(scene, fields, outputs, _fill_plainly))
