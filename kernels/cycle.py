"""The limit cycle of a scene of your own, by Newton's method instead of simulation.

A cycle begins and ends just before a switch. Its states there are a fixed point of the return map, found by Newton's
method (`codegen.limit_cycle`), also if the cycle attracts slowly or not at all. A cell is OK if period, states and
sizes are within rtol of the truth (states relative to their largest size in the cycle), and multiplier and
sensitivities within rtol times the larger of 1 and their size; only requested outputs count.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from kernels.codegen.cycle_values import described
from kernels.codegen.limit_cycle import FOUND, RESTS, Search
from kernels.codegen.return_map import ReturnMap
from kernels.interface import Field, Kernel, Status
from kernels.scene import Function, Scene, SceneError, SceneParts, estimating_kernel, flips_field, scene_of

__all__ = ["cycle_kernel"]

METHODS = {
    "taylor": "Taylor series",
    "rodas5p": "Rosenbrock's method Rodas5P, for stiff equations",
    "dop853": "Dormand-Prince 8(5,3)",
}
SHARES, WIDEST = (1e-4, 3e-6), 0.01
"""Of rtol, the tolerance of the runs, whose differences are divided by thousandths; and where that is not enough. The
widest one, of that of what is wanted roughly: a small cycle is told from rest by how well it closes."""
MOST = 1000.0
SETTLE = Field(
    "settle", "1", "cycles followed before Newton's method; 0: the start is a guess", 4.0, 0.0, MOST, integer=True
)


def cycle_kernel(
    *,
    drive: Function | None = None,
    turns: Mapping[str, float] | None = None,
    branch: str | None = None,
    **parts: Unpack[SceneParts],
) -> Kernel:
    """Make a kernel that solves for the limit cycle of a scene.

    Parameters
    ----------
    drive : (parameters) -> period of the rates in the time `t`. Then `flips` counts periods of the drive, a cycle's
        states are those at its end, and the scene needs no surface
    turns : states that may advance by a whole number of these per cycle, as an angle does: {"phase": 2 * pi}
    branch : a parameter in which the cycle is continued: it is searched at the value of an additional parameter,
        NAME_from, and continued from there, also if it is unstable
    The others as in `kernels.scene.scene_kernel`; the search begins at `start`. With several surfaces a cycle ends at
    the first, and `flips` counts only its switches.

    Returns
    -------
    Kernel
        It has two additional parameters: `flips`, the switches or drive periods per cycle, by default 1, or 2 if the
        scene depends on `side` (then even), and `settle`, the cycles followed before Newton's method begins. Outputs:
        `period`; each state just before the switch that ends a cycle; `NAME_size`, the largest size of each state in
        the cycle; `NAME_turns` for the states in `turns`; `multiplier`, the Floquet multiplier of largest modulus;
        if there are several, `multipliers_real` and `multipliers_imaginary` along `floquet_mode`, the largest first (a
        complex pair has the size of its imaginary part twice); `period_by_NAME`, d ln(period)/d ln(parameter), for
        each parameter that is not a whole number.

    Raises
    ------
    SceneError
        As `scene_kernel`; if the first surface depends on several states, or on one in `turns`; if a function depends
        on `side` although there is a drive or several surfaces; or on the time without a drive.
    """
    scene, parameters = scene_of(parts), tuple(parts["parameters"])
    maps = {method: ReturnMap(scene, method, drive) for method in METHODS}
    turning = _turning(scene, turns or {}, maps["taylor"].held)
    doc = "switches, or periods of the drive, per cycle"
    flips = replace(flips_field(2.0 if maps["taylor"].sides else 1.0, MOST), doc=doc)
    begun = [parameters[_number(scene, "branch", "parameter", branch)]] if branch else []
    begun = [replace(f, name=f"{f.name}_from", doc=f"{f.name} where the search begins", default=f.name) for f in begun]
    fields = (*parameters, *begun, flips, SETTLE)
    end = "at the end of a period of the drive" if drive else "just before the switch that ends a cycle"
    outputs, modes = _outputs(parts, [scene.states[j] for j in turning], len(maps["taylor"].directions), end)

    def solved(method: str, columns: Any, rtol: Any, ranks: Any, asked: set[str]) -> Any:
        """Values of each output, and error and status of each cell."""
        the_map, (*own, flips, settle) = maps[method], columns
        origin = (scene.parameters.index(branch), own.pop()) if branch else None
        r, tight = (np.clip(share * rtol, the_map.fine, WIDEST * the_map.rough) for share in SHARES)
        own = np.array(own).reshape(len(own), len(rtol))
        search = Search(the_map, turning, own, flips.copy(), r, settle, origin)
        swept = {k: f"period_by_{f.name}" for k, f in enumerate(parameters) if f"period_by_{f.name}" in asked}
        status, there = search.cycles.status, np.isin(search.cycles.status, FOUND)
        found, error = described(search, swept, ranks.astype(int) - 1, asked, rtol, tight)
        error = np.where(status == Status.COMES_TO_REST, RESTS, np.where(there, error, math.inf))
        return [found.get(f.name) for f in outputs], error, status

    def check(*columns: Any) -> None:
        columns[-1][columns[-3] % 2.0 != 0.0] = Status.BAD_INPUT  # half a turn of the side is no cycle

    docs = {name: f"Newton's method on the return map, followed by {how}" for name, how in METHODS.items()}
    return estimating_kernel(parts, fields, outputs, modes, docs, solved, check if maps["taylor"].sides else None)


def _number(scene: Scene, role: str, kind: str, name: str) -> int:
    """The number of a state or a parameter that is named for this role."""
    names = scene.states if kind == "state" else scene.parameters
    if name not in names:
        raise SceneError(f"{role} of the scene {scene.name}: there is no {kind} {name!r}; there are {', '.join(names)}")
    return names.index(name)


def _turning(scene: Scene, turns: Mapping[str, float], held: list[int]) -> dict[int, float]:
    """{number of a state: what it goes on by in a turn}."""
    found = {_number(scene, "turns", "state", name): float(turn) for name, turn in turns.items()}
    for j, turn in found.items():
        if j in held or not 0.0 < turn < math.inf:
            watched = "the surface watches it, so it cannot turn; let the switch put it back"
            why = watched if j in held else f"a turn must be above 0 and finite, found {turn}"
            raise SceneError(f"turns of the scene {scene.name}: {scene.states[j]}: {why}")
    return found


def _outputs(parts: SceneParts, turning: list[str], many: int, end: str) -> tuple[list[Field], list[Field]]:
    """Outputs of a cycle with `many` multipliers, and their number as a coordinate if there are several.

    States are given at the `end` of the cycle.
    """
    states, swept = parts["states"], [f.name for f in parts["parameters"] if not f.integer]
    outputs = [
        Field("period", "s", "period of the limit cycle"),
        *(replace(f, doc=f"{f.doc}, {end}", sized=True) for f in states),
        *(Field(f"{f.name}_size", f.unit, f"largest size in the cycle of: {f.doc}") for f in states),
        *(Field(f"{name}_turns", "1", "whole turns per cycle", integer=True) for name in turning),
        Field("multiplier", "1", "growth of small disturbances per cycle; the largest, or its modulus"),
        *(Field(f"period_by_{name}", "1", f"d ln(period)/d ln({name})") for name in swept),
    ]
    modes = Field(
        "floquet_mode", "1", "number of the multiplier, the largest first", float(many), 1.0, many, integer=True
    )
    if many > 1:
        for key, part in (("real", "real part"), ("imaginary", "size of the imaginary part")):
            outputs.append(Field(f"multipliers_{key}", "1", f"{part} of each multiplier", dims=(modes.name,)))
    return [replace(f, gaps=True) for f in outputs], [modes] if many > 1 else []
