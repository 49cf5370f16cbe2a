"""The limit cycle of a scene of one's own: solved for, not waited for.

A cycle begins and ends just before a switch. Its states there are a fixed point of the return map, found by Newton's
method (`codegen.limit_cycle`); so cycles are found to which a motion comes slowly or never. A cell is OK where period,
states and sizes are within rtol of the truth (states relative to the largest size that they have in the cycle), and
multiplier and sensitivities within rtol of 1, or of themselves where they are larger; only outputs asked for count.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kernels.codegen.columns_algebra import most
from kernels.codegen.compiled import compiling
from kernels.codegen.limit_cycle import FOUND, RESTS, Columns, Search, described
from kernels.codegen.return_map import TIGHT, ReturnMap, has_sides
from kernels.interface import FIRST_REFUSAL, Field, Kernel, Method, OnColumns, Status
from kernels.lanes.wiring import signed
from kernels.scene import Function, Functions, SceneError, limits_check, scene_of

__all__ = ["cycle_kernel"]

METHODS = {
    "taylor": "Taylor series",
    "rodas5p": "Rosenbrock's method Rodas5P, for stiff equations",
    "dop853": "Dormand-Prince 8(5,3)",
}
SHARE = 3e-6
"""Of rtol, the tolerance of the runs: their differences are divided by thousandths."""
WIDE = 1e-3
"""The same where no output is such a difference; what is not right to rtol then is solved again."""
SLOPES = "multiplier", "multipliers_real", "multipliers_imaginary"
"""Outputs that are, beside the sensitivities."""
ONE = 1e-8
"""To what a multiplier must be known where it cannot be told from 1: what is 1 leaves no cycle by itself; what is 1 in
modulus alone lets disturbances neither grow nor fade."""
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
    start: Function,
    surface: Functions | None = None,
    switch: Functions | None = None,
    start_time: Function | float | None = None,
    drive: Function | None = None,
    turns: Mapping[str, float] | None = None,
    branch: str | None = None,
    source: str = "a study's own",
    example: Mapping[str, float] | None = None,
) -> Kernel:
    """A kernel that solves for the limit cycle of a scene.

    Parameters
    ----------
    drive : (parameters) -> the period with which the rates depend on the time `t`. Then `flips` are periods of the
        drive, a cycle's states are those at its end, and the scene need have no surface
    turns : states that need not come back to themselves but go on by a whole number of these, as {"phase": 2 * pi}
    branch : a parameter in which the cycle is continued: it is searched where this has the value of a further
        parameter, NAME_from, and followed from there, also where it is not stable
    The others as in `kernels.scene.scene_kernel`; `start` is where the search begins. Of several surfaces a cycle ends
    at the first, and `flips` counts it alone.

    Returns
    -------
    Kernel
        With two further parameters: `flips`, the switches a cycle, an even number where the scene hangs on its side,
        and `settle`, the cycles that are followed before Newton's method begins. Its outputs: `period`; each state just
        before the switch that ends a cycle; `NAME_size`, the largest size of each state in the cycle; `NAME_turns` of
        what turns; `multiplier`, that of largest modulus, by which small disturbances are multiplied each cycle; where
        there are several, `multipliers_real` and `multipliers_imaginary` along `floquet_mode`, the largest first, of
        a complex pair both with the size of their imaginary part; `period_by_NAME`, d ln(period)/d ln(parameter), of
        each parameter that is no whole number.

    Raises
    ------
    SceneError
        As `scene_kernel`; where the first surface watches more than one state, or one that turns; where a motion passes
        through it: neither it nor the rates depend on `side`, and there is no switch; where something depends on `side`
        though there is a drive or several surfaces; and where the time is asked for and there is no drive.
    """
    scene = scene_of(name, doc, states, parameters, rates, surface, start, switch, start_time)
    if drive is None and scene.start_time is not None:
        raise SceneError(f"{name}: a cycle of a scene that depends on the time `t` needs the period of its `drive`")
    if drive is None and surface is None:
        raise SceneError(f"{name}: a cycle needs a surface, or a drive")
    names, numbers = [f.name for f in states], {f.name: k for k, f in enumerate(parameters)}
    turning = _turning(name, names, turns or {})
    maps = {method: ReturnMap(scene, method, drive) for method in METHODS}
    the_map = maps["taylor"]
    if any(held in turning for held in the_map.held):
        raise SceneError(f"{name}: the state that the surface watches cannot turn; let the switch put it back")
    sides = has_sides(the_map.scene)
    if sides and (drive or isinstance(surface, Mapping)):
        raise SceneError(f"{name}: here a cycle cannot depend on `side`; take a state of rate 0 that switches set")
    if not (sides or drive or the_map.jumps):
        raise SceneError(f"{name}: the motion passes through the surface; let it depend on `side`, as side * x does")
    if branch is not None and branch not in numbers:
        raise SceneError(
            f"branch of the scene {name}: there is no parameter {branch!r}; there are {', '.join(numbers)}"
        )
    begins = [replace(parameters[numbers[branch]], name=f"{branch}_from", doc=f"{branch} where the search begins",
                      default=branch)] if branch else []  # fmt: skip
    fields, many = (*parameters, *begins, *SEARCH), len(the_map.directions)
    rank = Field(
        "floquet_mode", "1", "number of the multiplier, the largest first", float(many), 1.0, many, integer=True
    )
    swept = {f"period_by_{f.name}": k for k, f in enumerate(parameters) if not f.integer}
    outputs = [
        Field("period", "s", "period of the limit cycle", gaps=True),
        *(Field(f.name, f.unit, f"{f.doc}, just before the switch that ends a cycle", gaps=True) for f in states),
        *(Field(f"{f.name}_size", f.unit, f"largest size in the cycle of: {f.doc}", gaps=True) for f in states),
        *(Field(f"{names[j]}_turns", "1", "whole turns a cycle", integer=True, gaps=True) for j in turning),
        Field("multiplier", "1", "of small disturbances, a cycle; the largest, or its modulus", gaps=True),
        *(Field(key, "1", f"d ln(period)/d ln({parameters[k].name})", gaps=True) for key, k in swept.items()),
    ]
    if many > 1:
        parts = ("multipliers_real", "real part"), ("multipliers_imaginary", "size of the imaginary part")
        outputs += [Field(key, "1", f"{part} of each multiplier", dims=(rank.name,), gaps=True) for key, part in parts]

    def method(way: str) -> Method:
        def solve(*columns: Any) -> None:
            given, (*along, wanted), (*filled, error, status) = (
                columns[: len(fields) + 1], columns[len(fields) + 1 : -len(outputs) - 2], columns[-len(outputs) - 2 :]
            )  # fmt: skip
            asked = {f.name for f, one in zip(outputs, wanted, strict=True) if one}
            if not len(status):
                return
            *own, flips, settle, rtol = given
            origin = (numbers[branch], own.pop()) if branch else None
            the_map = maps[way]
            with compiling(name, way):
                slopes = any(name in SLOPES or name in swept for name in asked)
                loose, tight = (np.clip(share * rtol, the_map.fine, the_map.rough) for share in (WIDE, SHARE))
                cells = Columns(own, flips.copy(), tight if slopes else loose)
                search = Search(the_map, turning, cells, settle, origin)
                there, found = np.flatnonzero(np.isin(search.status, FOUND)), {}
                _described(search, there, names, swept, asked, found)
                worst = most(np.array([most(np.atleast_2d(found[name][1])) for name in asked & found.keys()]))
                left = there[~(worst <= rtol)[there] & (search.cells.r > tight)[there]]
                search.refined(left, tight[left])
                _described(search, left, names, swept, asked, found)
            status[:], error[:] = search.status, np.where(search.status == Status.COMES_TO_REST, RESTS, 0.0)
            for field, column in zip(outputs, filled, strict=True):
                column[:] = np.nan
                if field.name not in found:
                    continue
                value, off = found[field.name]
                if field.dims:
                    ranks = along[0].astype(int) - 1
                    value, off = value[ranks], most(off[ranks])
                column[:] = np.where(status < FIRST_REFUSAL, value, np.nan).T
                if field.name in asked:
                    error[there] = np.maximum(error, off)[there]

        columns = [*(f.name for f in fields), "rtol", *([rank.name] if many > 1 else []), "asked"]
        whole = signed(solve, [*columns, *(f.name for f in outputs), "error", "status"])
        return Method(way, f"Newton's method on the return map, followed by {METHODS[way]}", whole, estimates=True)

    return Kernel(
        name=name,
        doc=doc,
        source=source,
        parameters=fields,
        outputs=tuple(outputs),
        check=_check(fields, sides),
        methods=tuple(map(method, METHODS)),
        along=(rank,) if many > 1 else (),
        example=dict(example or {}),
    )


def _turning(scene: str, states: list[str], turns: Mapping[str, float]) -> dict[int, float]:
    """{number of a state: what it goes on by in a turn}."""
    for state, turn in turns.items():
        if state not in states:
            raise SceneError(f"turns of the scene {scene}: there is no state {state!r}; there are {', '.join(states)}")
        if not 0.0 < turn < math.inf:
            raise SceneError(f"turns of the scene {scene}: a turn of {state} must be above 0 and finite, found {turn}")
    return {states.index(state): float(turn) for state, turn in turns.items()}


def _check(fields: Sequence[Field], sides: bool) -> OnColumns:
    """As of every scene; besides, an odd number of switches is no cycle of a scene that hangs on its side."""
    within = limits_check(fields)

    def check(*columns: Any) -> None:
        within(*columns)
        if sides:
            columns[-1][columns[-3] % 2.0 != 0.0] = Status.BAD_INPUT

    return signed(check, [*(f.name for f in fields), "status"])


def _described(
    search: Search, there: Any, names: list[str], swept: Mapping[str, int], asked: set[str], found: dict[str, Any]
) -> None:
    """Fills {output: values and errors, (n_cells,) or (n_ranks, n_cells)} of cells that have a cycle; else NaN."""
    count = len(search.status)
    for name, row in zip(names, search.z, strict=True):
        found.setdefault(name, (row, np.full(count, math.inf)))
    if not len(there):
        return
    the_map, cells, z, scale = search.map, search.cells.taken(there), search.z[:, there], search.scale[:, there]
    sensitive = {k: key for key, k in swept.items() if key in asked}
    parts = described(the_map, cells, z, scale, search.shift[:, there], list(sensitive))
    states, off = parts.pop("states")
    with np.errstate(all="ignore"):
        parts = {sensitive.get(key, key): part for key, part in parts.items()}
        parts |= {name: (states[j], off[j]) for j, name in enumerate(names)}
        if any(f"{name}_size" in asked for name in names):
            sizes, unsure = _sizes(the_map, cells, states, off * scale, scale)
            parts |= {f"{name}_size": (sizes[j], unsure[j] / sizes[j]) for j, name in enumerate(names)}
        for j, turn in search.turns.items():
            parts[f"{names[j]}_turns"] = np.round(search.shift[j, there] / turn), np.zeros(len(there))
    real, unsure = parts["multipliers_real"]
    one = (abs(real - 1.0) <= unsure) & (parts["multipliers_imaginary"][0] <= unsure) & (unsure < ONE)
    multiplier, error = parts["multiplier"]
    neither = (abs(abs(multiplier) - 1.0) <= error) & (error < ONE) & (search.status[there] == Status.UNSTABLE)
    search.status[there[neither]] = Status.OK
    search.status[there[one.any(axis=0)]] = Status.NO_CYCLE
    for name, (value, off) in parts.items():
        shape = *value.shape[:-1], count
        values, errors = found.setdefault(name, (np.full(shape, np.nan), np.full(shape, math.inf)))
        better = ~(off >= errors[..., there]) | np.isinf(errors[..., there])
        values[..., there] = np.where(better, value, values[..., there])
        errors[..., there] = np.where(better, np.where(off >= 0.0, off, math.inf), errors[..., there])


def _sizes(the_map: ReturnMap, cells: Columns, z: Any, spread: Any, scale: Any) -> tuple[Any, Any]:
    """The largest size of each state in the cycle, and by how much it may be off."""
    sizes, apart = the_map.turned(cells.parameters, z, cells.flips)
    off = apart + TIGHT * the_map.fine * scale
    for j in the_map.directions:
        by = np.maximum(spread[j], 1e-7 * scale[j])
        moved = z.copy()
        moved[j] = moved[j] + by
        other, _ = the_map.turned(cells.parameters, moved, cells.flips)
        off = off + 2.0 * abs(other - sizes) * (spread[j] / by)
    return sizes, off
