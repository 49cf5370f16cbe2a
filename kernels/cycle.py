"""The limit cycle of a scene of one's own: solved for, not waited for.

A cycle begins and ends just before a switch. Its states there are a fixed point of the return map, found by Newton's
method (`codegen.limit_cycle`); so cycles are found to which a motion comes slowly or never. A cell is OK where period,
states and sizes are within rtol of the truth (states relative to the largest size that they have in the cycle), and
multiplier and sensitivities within rtol of 1, or of themselves where they are larger; only outputs asked for count.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from kernels.codegen.columns_algebra import most
from kernels.codegen.compiled import compiling
from kernels.codegen.limit_cycle import CLOSED, FOUND, RESTS, SURE, Columns, Search, closed, described
from kernels.codegen.return_map import TIGHT, ReturnMap, has_sides
from kernels.interface import FIRST_REFUSAL, Field, Kernel, Method, OnColumns, Status
from kernels.lanes.wiring import signed
from kernels.scene import Function, Scene, SceneError, SceneParts, limits_check, scene_of

__all__ = ["cycle_kernel"]

METHODS = {
    "taylor": "Taylor series",
    "rodas5p": "Rosenbrock's method Rodas5P, for stiff equations",
    "dop853": "Dormand-Prince 8(5,3)",
}
SHARES, WIDEST = (1e-4, 3e-6), 0.01
"""Of rtol, the tolerance of the runs, whose differences are divided by thousandths; and where that is not enough. The
widest one, of that of what is wanted roughly: a small cycle is told from rest by how well it closes."""
SHORTER, ROUGHER = 0.1, 20.0
"""Of the steps of differences, those that are tried where errors are more than so many of the runs' over a step."""
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
    drive: Function | None = None,
    turns: Mapping[str, float] | None = None,
    branch: str | None = None,
    source: str = "a study's own",
    example: Mapping[str, float] | None = None,
    **parts: Unpack[SceneParts],
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
    scene, states, parameters = scene_of(**parts), parts["states"], tuple(parts["parameters"])
    if drive is None and scene.start_time is not None:
        raise SceneError(
            f"{scene.name}: a cycle of a scene that depends on the time `t` needs the period of its `drive`"
        )
    if drive is None and scene.surface is None:
        raise SceneError(f"{scene.name}: a cycle needs a surface, or a drive")
    maps = {method: ReturnMap(scene, method, drive) for method in METHODS}
    turning, sides = _turning(scene, turns or {}), _sides(scene, maps["taylor"])
    if any(held in turning for held in maps["taylor"].held):
        raise SceneError(f"{scene.name}: the state that the surface watches cannot turn; let the switch put it back")
    fields, many = (*parameters, *_begun(scene, parameters, branch), *SEARCH), len(maps["taylor"].directions)
    modes = [Field("floquet_mode", "1", "number of the multiplier, the largest first", float(many), 1.0, many,
                   integer=True)] if many > 1 else []  # fmt: skip
    outputs = _outputs(states, parameters, [scene.states[j] for j in turning], modes)
    columns = [*(f.name for f in fields), "rtol", *(f.name for f in modes), "asked", *(f.name for f in outputs)]

    def method(way: str) -> Method:
        def solve(*columns: Any) -> None:
            *own, flips, settle, rtol = columns[: len(fields) + 1]
            (*along, wanted), (*filled, error, status) = (
                columns[len(fields) + 1 : -len(outputs) - 2], columns[-len(outputs) - 2 :]
            )  # fmt: skip
            origin = (scene.parameters.index(branch), own.pop()) if branch else None
            asked = {f.name for f, one in zip(outputs, wanted, strict=True) if one}
            if not len(status):
                return
            with compiling(scene.name, way):
                r, tight = (np.clip(share * rtol, maps[way].fine, WIDEST * maps[way].rough) for share in SHARES)
                search = Search(maps[way], turning, Columns(own, flips.copy(), r), settle, origin)
                there = np.isin(search.status, FOUND)
                answers = Answers(search, parameters, along[0].astype(int) - 1 if along else [], asked)
                answers.solve(rtol, tight)
            status[:], error[:] = search.status, np.where(there, answers.error(), 0.0)
            error[status == Status.COMES_TO_REST] = RESTS
            for field, column in zip(outputs, filled, strict=True):
                value, _ = answers.found.get(field.name, (math.nan, math.nan))
                column[:] = np.where(status < FIRST_REFUSAL, value, np.nan).T

        doc = f"Newton's method on the return map, followed by {METHODS[way]}"
        return Method(way, doc, signed(solve, [*columns, "error", "status"]), estimates=True)

    return Kernel(
        name=scene.name,
        doc=scene.doc,
        source=source,
        parameters=fields,
        outputs=outputs,
        check=_check(fields, sides),
        methods=tuple(map(method, METHODS)),
        along=tuple(modes),
        example=dict(example or {}),
    )


def _sides(scene: Scene, the_map: ReturnMap) -> bool:
    """Whether the scene hangs on its side; refused where a cycle of it cannot be counted."""
    sides, driven = has_sides(the_map.scene), the_map.driven
    if sides and (driven or isinstance(scene.surface, Mapping)):
        raise SceneError(
            f"{scene.name}: here a cycle cannot depend on `side`; take a state of rate 0 that switches set"
        )
    if not (sides or driven or the_map.jumps):
        raise SceneError(
            f"{scene.name}: the motion passes through the surface; let it depend on `side`, as side * x does"
        )
    return sides


def _turning(scene: Scene, turns: Mapping[str, float]) -> dict[int, float]:
    """{number of a state: what it goes on by in a turn}."""
    there = f"turns of the scene {scene.name}:"
    for state, turn in turns.items():
        if state not in scene.states:
            raise SceneError(f"{there} there is no state {state!r}; there are {', '.join(scene.states)}")
        if not 0.0 < turn < math.inf:
            raise SceneError(f"{there} a turn of {state} must be above 0 and finite, found {turn}")
    return {scene.states.index(state): float(turn) for state, turn in turns.items()}


def _begun(scene: Scene, parameters: Sequence[Field], branch: str | None) -> list[Field]:
    """The parameter that says where the search begins, of a cycle that is continued."""
    if branch is None:
        return []
    if branch not in scene.parameters:
        raise SceneError(
            f"branch of the scene {scene.name}: there is no parameter {branch!r}; "
            f"there are {', '.join(scene.parameters)}"
        )
    field = parameters[scene.parameters.index(branch)]
    return [replace(field, name=f"{branch}_from", doc=f"{branch} where the search begins", default=branch)]


def _outputs(
    states: Sequence[Field], parameters: Sequence[Field], turning: Sequence[str], modes: Sequence[Field]
) -> tuple[Field, ...]:
    """All that is said of a cycle."""
    parts = ("multipliers_real", "real part"), ("multipliers_imaginary", "size of the imaginary part")
    along = tuple(f.name for f in modes)
    return (
        Field("period", "s", "period of the limit cycle", gaps=True),
        *(Field(f.name, f.unit, f"{f.doc}, just before the switch that ends a cycle", gaps=True) for f in states),
        *(Field(f"{f.name}_size", f.unit, f"largest size in the cycle of: {f.doc}", gaps=True) for f in states),
        *(Field(f"{name}_turns", "1", "whole turns a cycle", integer=True, gaps=True) for name in turning),
        Field("multiplier", "1", "of small disturbances, a cycle; the largest, or its modulus", gaps=True),
        *(Field(f"period_by_{f.name}", "1", f"d ln(period)/d ln({f.name})", gaps=True)
          for f in parameters if not f.integer),
        *(Field(key, "1", f"{part} of each multiplier", dims=along, gaps=True) for key, part in parts if along),
    )  # fmt: skip


def _check(fields: Sequence[Field], sides: bool) -> OnColumns:
    """As of every scene; besides, an odd number of switches is no cycle of a scene that hangs on its side."""
    within = limits_check(fields)

    def check(*columns: Any) -> None:
        within(*columns)
        if sides:
            columns[-1][columns[-3] % 2.0 != 0.0] = Status.BAD_INPUT

    return signed(check, [*(f.name for f in fields), "status"])


class Answers:
    """What is said of the cycles of a search, as far as it is asked for.

    `found` : {output: values, NaN where there is none, and errors}, (n_cells,), of multipliers (n_modes, n_cells)
    """

    def __init__(self, search: Search, parameters: Sequence[Field], modes: Any, asked: set[str]) -> None:
        self.search, self.map, self.modes, self.asked = search, search.map, modes, asked
        self.names = search.map.own.states[: len(search.cycle.z)]
        self.swept = {k: f"period_by_{f.name}" for k, f in enumerate(parameters) if f"period_by_{f.name}" in asked}
        unknown, self.unclear = np.full(len(search.status), math.inf), np.zeros(len(search.status), bool)
        self.found = {name: (row.copy(), unknown.copy()) for name, row in zip(self.names, search.cycle.z, strict=True)}

    def error(self) -> Any:
        """The largest of what is asked for, a column."""
        off = np.zeros(len(self.search.status))
        for name in self.asked:
            off = np.maximum(off, most(np.atleast_2d(self.found[name][1])) if name in self.found else math.inf)
        return off

    def solve(self, rtol: Any, tight: Any) -> None:
        """Finds what is asked for: by Newton's last run alone where that tells enough, else by differences.

        What is not right to rtol then, or not clear of a modulus of 1, is solved again by tight runs.
        """
        search, r = self.search, self.search.cells.r
        there, sure = np.isin(search.status, FOUND), abs(search.cycle.multiplier) < 1.0 - SURE
        some = np.flatnonzero(there & sure & (search.cycle.off <= CLOSED * r))
        cycle = search.taken(some)
        with np.errstate(all="ignore"):
            self._keep(some, closed(self.map, search.cells.taken(some), cycle, cycle.slopes)[0])
        self._by_differences(there & ~(self.error() <= rtol), rtol)
        left = there & (self.unclear | ~(self.error() <= rtol)) & (r > tight)
        search.refined(np.flatnonzero(left), tight[left])
        self._by_differences(left, rtol)

    def _by_differences(self, left: Any, rtol: Any) -> None:
        """Finds what is asked for of the cells that are left, by differences; by shorter ones where these are rough."""
        for h in (self.map.step, SHORTER * self.map.step):
            some = np.flatnonzero(left)
            if len(some):
                cells, cycle = self.search.cells.taken(some), self.search.taken(some)
                parts = described(self.map, cells, cycle, list(self.swept), h)
                self._judged(some, parts)
                self._keep(some, parts)
            left = left & ~(self.error() <= np.maximum(rtol, ROUGHER / self.map.step * self.search.cells.r))

    def _judged(self, cells: Any, parts: Mapping[str, Any]) -> None:
        """Says of what no disturbance tells apart, or grows, that it is no cycle by itself, or not stable."""
        (real, unsure), (imaginary, _), (multiplier, error) = (
            parts[name] for name in ("multipliers_real", "multipliers_imaginary", "multiplier")
        )
        one, grows = (abs(real - 1.0) <= unsure) & (imaginary <= unsure), abs(multiplier) - 1.0
        self.unclear[cells] = (one & (unsure >= ONE)).any(axis=0) | ((abs(grows) <= error) & (error >= ONE))
        status = self.search.status[cells]
        status = np.where(status == Status.PERIOD_2, status, np.where(grows > error, Status.UNSTABLE, Status.OK))
        status = np.where(self.unclear[cells], self.search.status[cells], status)
        self.search.status[cells] = np.where((one & (unsure < ONE)).any(axis=0), Status.NO_CYCLE, status)

    def _keep(self, cells: Any, parts: dict[str, Any]) -> None:
        """Keeps what is better than what is known of these cells."""
        states, off = parts.pop("states")
        parts |= {name: (states[j], off[j]) for j, name in enumerate(self.names)}
        scale = self.search.cycle.scale[:, cells]
        with np.errstate(all="ignore"):
            if any(f"{name}_size" in self.asked for name in self.names):
                sizes, unsure = self._sizes(cells, states, off * scale, scale)
                parts |= {f"{name}_size": (sizes[j], unsure[j] / sizes[j]) for j, name in enumerate(self.names)}
            for j, turn in self.search.turns.items():
                turns = np.round(self.search.cycle.shift[j, cells] / turn)
                parts[f"{self.names[j]}_turns"] = turns, np.zeros(len(cells))
        for key, (value, off) in parts.items():
            value, off = (value[self.modes], off[self.modes]) if value.ndim > 1 else (value, off)
            shape = *value.shape[:-1], len(self.search.status)
            values, errors = self.found.setdefault(
                self.swept.get(key, key), (np.full(shape, np.nan), np.full(shape, math.inf))
            )
            better = ~(off >= errors[..., cells]) | np.isinf(errors[..., cells])
            values[..., cells] = np.where(better, value, values[..., cells])
            errors[..., cells] = np.where(better, np.where(off >= 0.0, off, math.inf), errors[..., cells])

    def _sizes(self, cells: Any, z: Any, spread: Any, scale: Any) -> tuple[Any, Any]:
        """The largest size of each state in the cycle, and by how much it may be off."""
        some = self.search.cells.taken(cells)
        sizes, apart = self.map.turned(some.parameters, z, some.flips)
        off = apart + TIGHT * self.map.fine * scale
        for j in self.map.directions:
            by = np.maximum(spread[j], 1e-7 * scale[j])
            moved = z.copy()
            moved[j] = moved[j] + by
            other, _ = self.map.turned(some.parameters, moved, some.flips)
            off = off + 2.0 * abs(other - sizes) * (spread[j] / by)
        return sizes, off
