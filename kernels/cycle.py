"""The limit cycle of a scene of one's own: solved for, not waited for.

A cycle begins and ends just before a switch. Its states there are a fixed point of the return map, found by Newton's
method (`codegen.limit_cycle`); so cycles are found to which a motion comes slowly or never. A cell is OK where period,
states and sizes are within rtol of the truth (states relative to the largest size that they have in the cycle), and
multiplier and sensitivities within rtol of 1, or of themselves where they are larger; only outputs asked for count.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kernels.codegen.limit_cycle import FOUND, Columns, Search, described
from kernels.codegen.module import compiling
from kernels.codegen.return_map import TIGHT, ReturnMap, has_sides, watched
from kernels.interface import FIRST_REFUSAL, Field, Kernel, Method, OnColumns, Status
from kernels.lanes.wiring import signed
from kernels.scene import Function, Scene, SceneError, bare, limits_check, scene_of

__all__ = ["cycle_kernel"]

METHODS = {
    "taylor": "Taylor series",
    "rodas5p": "Rosenbrock's method Rodas5P, for what is stiff",
    "dop853": "Dormand-Prince 8(5,3)",
}
SHARE = 3e-6
"""Of rtol, the tolerance of the runs: their differences are divided by thousandths."""
ONE = 1e-8
"""What is known of a multiplier, where it cannot be told from 1, for its cycle to be none that others come to."""
MOST_FLIPS, MOST_CYCLES = 1000.0, 1000.0
SEARCH = (
    Field("flips", "1", "switches a cycle", default=2.0, lower=1.0, upper=MOST_FLIPS, integer=True),
    Field("settle", "1", "cycles followed before Newton's method; 0: the start is a guess", default=4.0, lower=0.0,
          upper=MOST_CYCLES, integer=True),
)  # fmt: skip
"""The last parameters of every cycle."""


def cycle_kernel(
    *,
    name: str,
    doc: str,
    states: Sequence[Field],
    parameters: Sequence[Field],
    rates: Function,
    surface: Function,
    start: Function,
    switch: Function | None = None,
    turns: Mapping[str, float] | None = None,
    source: str = "a study's own",
    example: Mapping[str, float] | None = None,
) -> Kernel:
    """A kernel that solves for the limit cycle of a scene.

    Parameters
    ----------
    turns : states that need not come back to themselves but go on by a whole number of these, as {"phase": 2 * pi}
    The others as in `kernels.scene.scene_kernel`; `start` is where the search begins.

    Returns
    -------
    Kernel
        With two further parameters: `flips`, the switches a cycle, an even number where the scene hangs on its side,
        and `settle`, the cycles that are followed before Newton's method begins. Its outputs: `period`; each state just
        before the switch that ends a cycle; `NAME_size`, the largest size of each state in the cycle; `NAME_turns` of
        what turns; `multiplier`, that of largest modulus, by which small disturbances are multiplied each cycle;
        `period_by_NAME`, d ln(period)/d ln(parameter), of each parameter that is no whole number.

    Raises
    ------
    SceneError
        As `scene_kernel`; where the surface watches more than one state, or one that turns; and where a motion passes
        through it: neither it nor the rates depend on `side`, and there is no switch.
    """
    scene = bare(scene_of(name, doc, states, parameters, rates, surface, start, switch))
    turning = {scene.states.index(state): float(turn) for state, turn in (turns or {}).items()}
    if watched(scene) in turning:
        raise SceneError(f"{name}: the state that the surface watches cannot turn; let the switch put it back")
    if scene.switch is None and not has_sides(scene):
        raise SceneError(f"{name}: the motion passes through the surface; let it depend on `side`, as side * x does")
    fields = (*parameters, *SEARCH)
    swept = [k for k, field in enumerate(parameters) if not field.integer]
    outputs = (
        Field("period", "s", "period of the limit cycle", gaps=True),
        *(Field(f.name, f.unit, f"{f.doc}, just before the switch that ends a cycle", gaps=True) for f in states),
        *(Field(f"{f.name}_size", f.unit, f"largest size in the cycle of: {f.doc}", gaps=True) for f in states),
        *(Field(f"{states[j].name}_turns", "1", "whole turns a cycle", integer=True, gaps=True) for j in turning),
        Field("multiplier", "1", "of small disturbances, a cycle; the largest, or its modulus", gaps=True),
        *(
            Field(f"period_by_{parameters[k].name}", "1", f"d ln(period)/d ln({parameters[k].name})", gaps=True)
            for k in swept
        ),
    )
    return Kernel(
        name=name,
        doc=doc,
        source=source,
        parameters=fields,
        outputs=outputs,
        check=_check(fields, has_sides(scene)),
        methods=tuple(_method(scene, m, turning, swept, fields, outputs) for m in METHODS),
        example=dict(example or {}),
    )


def _check(fields: Sequence[Field], sides: bool) -> OnColumns:
    """As of every scene; besides, an odd number of switches is no cycle of a scene that hangs on its side."""
    within = limits_check(fields)

    def check(*columns: Any) -> None:
        within(*columns)
        if sides:
            columns[-1][columns[-3] % 2.0 != 0.0] = Status.BAD_INPUT

    return signed(check, [*(f.name for f in fields), "status"])


def _method(
    scene: Scene,
    name: str,
    turns: dict[int, float],
    swept: list[int],
    fields: Sequence[Field],
    outputs: Sequence[Field],
) -> Method:
    """The method that follows the scene by the one of that name."""
    count = len(fields)

    def solve(*columns: Any) -> None:
        *parameters, flips, settle, rtol, wanted = columns[: count + 2]
        *found, error, status = columns[count + 2 :]
        if not len(status):
            return
        with compiling(scene.name, name):
            the_map = ReturnMap(scene, name)
            cells = Columns(parameters, flips.copy(), np.clip(SHARE * rtol, the_map.fine, the_map.rough))
            values, errors = _solved(the_map, turns, swept, cells, settle, wanted, status)
        for column, row in zip(found, values, strict=True):
            column[:] = np.where(status < FIRST_REFUSAL, row, np.nan)
        error[:] = 0.0
        for row, is_wanted in zip(errors, wanted, strict=True):
            if is_wanted:
                error[:] = np.maximum(error, row)

    names = [f.name for f in outputs]
    whole = signed(solve, [*(f.name for f in fields), "rtol", "asked", *names, "error", "status"])
    return Method(name, f"Newton's method on the return map, followed by {METHODS[name]}", whole, estimates=True)


def _solved(
    the_map: ReturnMap, turns: dict[int, float], swept: list[int], cells: Columns, settle: Any, wanted: Any, status: Any
) -> tuple[Any, Any]:
    """Rows of outputs and of their errors."""
    search = Search(the_map, turns, cells, settle)
    status[:] = search.status
    n, count = len(search.z), len(status)
    values, errors = np.full((len(wanted), count), np.nan), np.zeros((len(wanted), count))
    values[1 : 1 + n] = search.z
    there = np.flatnonzero(np.isin(status, FOUND))
    if not len(there):
        return values, errors
    some, z, scale = cells.taken(there), search.z[:, there], search.scale[:, there]
    sensitive = [k for k, asked in zip(swept, wanted[2 + 2 * n + len(turns) :], strict=True) if asked]
    found = described(the_map, some, z, scale, search.shift[:, there], sensitive)
    with np.errstate(all="ignore"):
        rows = {0: (found["values"][0], found["errors"][0])}
        for j in range(n):
            rows[1 + j] = found["states"][j], found["spread"][j] / scale[j]
        if wanted[1 + n : 1 + 2 * n].any():
            sizes, off = _sizes(the_map, some, found["states"], found["spread"], scale)
            rows |= {1 + n + j: (sizes[j], off[j] / sizes[j]) for j in range(n)}
        for i, (j, turn) in enumerate(turns.items()):
            rows[1 + 2 * n + i] = np.round(search.shift[j, there] / turn), np.zeros(len(there))
        for row, k in enumerate([None, *swept], start=1 + 2 * n + len(turns)):
            if k is None or k in sensitive:
                i = 1 if k is None else 2 + sensitive.index(k)
                rows[row] = found["values"][i], found["errors"][i]
    for row, (value, off) in rows.items():
        values[row, there] = value
        errors[row, there] = np.where(off >= 0.0, off, math.inf)
    m = 1 + 2 * n + len(turns)
    apart = abs(values[m, there] - 1.0) > errors[m, there]
    status[there[~apart & (errors[m, there] < ONE)]] = Status.NO_CYCLE
    return values, errors


def _sizes(the_map: ReturnMap, cells: Columns, z: Any, spread: Any, scale: Any) -> tuple[Any, Any]:
    """The largest size of each state in the cycle, and by how much it may be off."""
    parameters = list(cells.parameters)
    sizes, apart = the_map.turned(parameters, z, cells.flips)
    off = apart + TIGHT * the_map.fine * scale
    for j in the_map.directions:
        by = np.maximum(spread[j], 1e-7 * scale[j])
        moved = z.copy()
        moved[j] = moved[j] + by
        other, _ = the_map.turned(parameters, moved, cells.flips)
        off = off + 2.0 * abs(other - sizes) * (spread[j] / by)
    return sizes, off
