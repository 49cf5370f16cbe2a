"""A scene of your own: a motion given by its rates, with a switch at each passage of a surface.

    u' = rates(u, side, parameters),  a switch where surface(u, side, parameters) falls through 0         (1)

A scene may have several surfaces, each with its own jump; their zeros are located like kinks (`record`).
The functions are plain Python of scalars. The names of their arguments are the states, parameters and `side` that they
need, and the time `t`, which is 0 or `start_time` at the start, unless a state or a parameter is called t.
They are called with objects that record the operations (`expression.graph`), from which functions are compiled, for one
cell and for lanes (`functions`). The operations allowed are + - * / ** abs, and sqrt, exp, log, sin, cos, tan, arcsin,
arccos, arctan, sinh, cosh, tanh, hypot, power, sign, floor, mod, maximum, minimum and where of this module; numpy's
functions of these names are equivalent, and so are math's in the module where the function is defined.
power(abs(u), n), with u a state and any n > -1, has no Taylor series at u = 0; it is solved there as described in
`integrate.powers`, to the same tolerance. For other arguments, power and sqrt need a value above 0 (otherwise
OUT_OF_RANGE).

A cell is OK if each state is within rtol of the truth, relative to the largest size that the state had up to then, and
each time is within rtol of itself. The surface and the kinks are located, or proved absent, over every step. A motion
that starts below the surface, or that a switch puts there, has no switch before it has risen above the surface and
falls again; one that starts on the surface and falls switches at once, as does one that a switch puts onto another
surface. A motion that rounding alone can change beyond rtol is INACCURATE.
"""

import functools
import keyword
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Required, TypedDict, Unpack

import numpy as np

from kernels.codegen.compiled import compiling, runner
from kernels.codegen.record import RESERVED, asks_for_time, named_functions
from kernels.codegen.to_tolerance import once, solver
from kernels.expression.graph import (
    SceneError,
    arccos,
    arcsin,
    arctan,
    cos,
    cosh,
    exp,
    floor,
    hypot,
    log,
    maximum,
    minimum,
    mod,
    pi,
    power,
    sign,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
    where,
)
from kernels.interface import FIRST_REFUSAL, Field, Kernel, Method, OnColumns, Status
from kernels.lanes.wiring import signed, within

__all__ = [
    "Field", "Scene", "SceneError", "arccos", "arcsin", "arctan", "cos", "cosh", "exp", "floor", "hypot", "log",
    "maximum", "minimum", "mod", "pi", "power", "scene_kernel", "sign", "sin", "sinh", "sqrt", "tan", "tanh", "where",
]  # fmt: skip

MOST_FLIPS = 1_000_000
SERIES = "Taylor series of order 12 or 18, every switch located or excluded"
LOCATED = "with switches located on its dense output; three runs compared"
Function = Callable[..., Any]
"""A function of scalars, as its author writes it."""
Functions = Function | Mapping[str, Function]
"""One function, or one for each of several named surfaces."""


@dataclass(frozen=True, eq=False)
class Scene:
    """The parts of a scene. They are recorded and compiled once; later changes of its functions have no effect.

    Parameters
    ----------
    name, doc : its name, and a one-line description
    states : names of the states
    parameters : names of the parameters
    rates : (states, side, parameters) -> the time derivative of each state
    surface : (states, side, parameters) -> a value that falls through 0 at the switch; or {name: such a function}
    start : (parameters) -> the states at time 0, where side is 1
    switch : (states, side, parameters) -> the states just after the switch; None: no jump; or {name: such a function}
        for some of the surfaces
    most_kinks : largest number of kinks between two switches, then STEP_LIMIT; None: a thousand
    slides : whether the motion can slide along a kink towards which the field points from both sides (`sliding`)
    begins : None, or the parameter that is 0 if the motion begins just after a switch at the first surface, else 1;
        rounding of the surface's value at the start is then ignored
    start_time : a number, or (parameters) -> a number, if the last state is the time `t`, which the functions may use
    only_first : whether only switches at the first surface are counted; as many others as kinks may occur in between
    until : whether the last parameter is the time after the start at which the first surface is met
    peaks : "all": extremes of all states are kinks, so that steps end where their size is largest; "some": only of
        states whose rate is another state, since other rates may stay close to 0

    At a switch `side` changes its sign. Where abs(u) or sign(u) occurs, u = 0 is a *kink*: integration stops there and
    restarts behind it.
    """

    name: str
    doc: str
    states: tuple[str, ...]
    parameters: tuple[str, ...]
    rates: Function
    surface: Functions | None
    start: Function
    switch: Functions | None = None
    most_kinks: int | None = None
    slides: bool = False
    begins: str | None = None
    start_time: Function | float | None = None
    only_first: bool = False
    until: bool = False
    peaks: str | None = None

    def __post_init__(self) -> None:
        names = [*self.states, *self.parameters]
        for name in [self.name, *names]:
            if not name.isidentifier() or keyword.iskeyword(name) or name in RESERVED:
                raise SceneError(f"{name!r} cannot be a name in a scene, as it is no identifier or reserved")
        if len(set(names)) < len(names):
            raise SceneError("two states or parameters of the scene have the same name")
        if not self.states:
            raise SceneError("a scene needs a state")
        if isinstance(self.surface, Mapping) and not self.surface:
            raise SceneError("a scene needs a surface")


class SceneParts(TypedDict, total=False):
    """Arguments of the functions that make kernels of a scene, see `scene_kernel`; a driven cycle needs no surface."""

    name: Required[str]
    doc: Required[str]
    states: Required[Sequence[Field]]
    parameters: Required[Sequence[Field]]
    rates: Required[Function]
    start: Required[Function]
    surface: Functions | None
    switch: Functions | None
    start_time: Function | float | None
    source: str
    example: Mapping[str, float] | None


def scene_kernel(**parts: Unpack[SceneParts]) -> Kernel:
    """Make a kernel that follows a scene from its start to its last switch.

    Parameters
    ----------
    name, doc : name of the kernel, and a one-line description
    states, parameters : sequences of Field, with names and units; a state's Field is also that of the output
    rates, surface, start, switch : as in `Scene`
    start_time : value of the time `t` at the start, if a function uses it: a number, or (parameters) -> a number
    source : reference for the scene
    example : values of the parameters for an example study

    Returns
    -------
    Kernel
        It has an additional parameter `flips`, the number of switches to follow. Its outputs are `time` of the last
        switch, `interval` since the previous one, and each state just before the last switch.

    Raises
    ------
    SceneError
        A function has an unknown argument, or an operation that cannot be recorded.
    """
    scene, fields = scene_of(parts), (*parts["parameters"], flips_field(40.0, MOST_FLIPS))
    outputs = (*TIMES, *states_of(parts))
    docs = {
        "taylor": f"{SERIES}; the error propagated, or three runs compared",
        "taylor_once": "Taylor series in one run, each step accurate to rtol; total error unknown (bound inf)",
        "rodas5p": f"for stiff equations: Rosenbrock's method Rodas5P, L-stable, {LOCATED}",
        "dop853": f"Dormand-Prince 8(5,3) {LOCATED}",
        "dopri5": f"Dormand-Prince 5(4) {LOCATED}",
    }

    followed = {name: solver(scene, name) for name in docs}
    followed["taylor_once"] = functools.partial(once, runner(scene, "taylor"))

    def solved(method: str, columns: Any, rtol: Any, *_: Any) -> Any:
        results, status, *_ = followed[method](columns, rtol)
        doubted = np.isin(status, (Status.INACCURATE, Status.GRAZING))
        return results[: len(outputs)], np.where(doubted, math.inf, rtol), status

    return estimating_kernel(parts, fields, outputs, (), docs, solved, blind=("taylor_once",))


def declared(
    parts: SceneParts,
    parameters: Sequence[Field],
    outputs: Sequence[Field],
    methods: Iterable[Method],
    along: Sequence[Field] = (),
    check: OnColumns | None = None,
) -> Kernel:
    """The kernel of a scene; `check` refuses further cells, of those within their limits."""
    return Kernel(
        name=parts["name"],
        doc=parts["doc"],
        source=parts.get("source", "a model of your own"),
        parameters=tuple(parameters),
        outputs=tuple(outputs),
        check=limits_check(parameters, check),
        methods=tuple(methods),
        along=tuple(along),
        example=dict(parts.get("example") or {}),
    )


TIMES = (
    Field("time", "s", "time of the last switch"),
    Field("interval", "s", "time between the last two switches, or from the start to the only one"),
)
"""The first outputs of every scene."""


def states_of(parts: SceneParts) -> list[Field]:
    """The states of a scene, as outputs."""
    return [replace(field, sized=True) for field in parts["states"]]


def scene_of(parts: SceneParts) -> Scene:
    """The scene of states and parameters that are given as fields; the time is its last state if it is asked for.

    Raises TypeError where one of `parts` is missing or no field, or there is none of that name.
    """
    if wrong := (parts.keys() - SceneParts.__annotations__.keys()) | (SceneParts.__required_keys__ - parts.keys()):
        raise TypeError(f"a scene has {', '.join(SceneParts.__annotations__)}; unknown or missing: {min(wrong)!r}")
    for field in (*parts["states"], *parts["parameters"]):
        if not isinstance(field, Field):
            raise TypeError(f'states and parameters are Fields, e.g. Field("x", "m", "position"); found {field!r}')
    states, parameters = (tuple(field.name for field in parts[key]) for key in ("states", "parameters"))
    surface, switch, start_time = parts.get("surface"), parts.get("switch"), parts.get("start_time")
    scene = Scene(parts["name"], parts["doc"], states, parameters, parts["rates"], surface, parts["start"], switch)
    functions = (scene.rates, *named_functions(surface).values(), *named_functions(switch).values())
    if asks_for_time(functions, (*states, *parameters)):
        return replace(scene, states=(*states, "t"), start_time=0.0 if start_time is None else start_time)
    if start_time is not None:
        raise SceneError(f"start_time of the scene {scene.name}: none of its functions has the argument t, the time")
    return scene


def flips_field(default: float, most: float) -> Field:
    """The number of switches to follow, a parameter of every scene."""
    return Field("flips", "1", "switches to follow", default=default, lower=1.0, upper=float(most), integer=True)


def estimating_kernel(
    parts: SceneParts,
    parameters: Sequence[Field],
    outputs: Sequence[Field],
    along: Sequence[Field],
    docs: Mapping[str, str],
    solved: Function,
    check: OnColumns | None = None,
    blind: Sequence[str] = (),
) -> Kernel:
    """A kernel of a scene with methods that estimate their error in each cell.

    Parameters
    ----------
    along : one coordinate, whose values must ascend, or none
    docs : {method: a one-line description}
    solved : (method, columns of parameters, rtol, values along, names of requested outputs) -> values of each output,
        (n_cells,) or (n_values, n_cells), or None if there are none; error; status
    check : as in `declared`
    blind : methods without any error estimate
    """
    count, names = len(parameters), [f.name for f in outputs]

    def no_bound(*columns: Any) -> None:
        columns[-1][:] = math.inf

    def method(name: str) -> Method:
        def solve(*columns: Any) -> None:
            rtol, (*values, asked) = columns[count], columns[count + 1 : count + 2 + len(along)]
            *found, error, status = columns[count + 2 + len(along) :]
            if not len(status):
                return
            wanted = {output for output, one in zip(names, asked, strict=True) if one}
            used = {dim for field in outputs if field.name in wanted for dim in field.dims}
            for field, points in zip(along, values, strict=True):
                if (field.name in used and not len(points)) or not (np.diff(points) > 0.0).all():
                    status[:], error[:] = Status.BAD_INPUT, math.nan
                    return
            with compiling(parts["name"], name), np.errstate(all="ignore"):
                rows, error[:], status[:] = solved(name, columns[:count], rtol, *(values or [np.empty(0)]), wanted)
            for column, row in zip(found, rows, strict=True):
                column[:] = math.nan if row is None else np.where(status >= FIRST_REFUSAL, math.nan, row).T

        given = [*(f.name for f in parameters), "rtol", *(f.name for f in along), "asked"]
        bound = signed(no_bound, [*given, "out"]) if name in blind else None
        return Method(name, docs[name], signed(solve, [*given, *names, "error", "status"]), bound, estimates=True)

    return declared(parts, parameters, outputs, map(method, docs), along, check)


def limits_check(fields: Sequence[Field], further: OnColumns | None = None) -> OnColumns:
    """BAD_INPUT for what is NaN, infinite or outside its limits, and for a number of switches that is not whole.

    `further` writes into the status what else is refused.
    """
    names, allowed = [f.name for f in fields], within(fields, compiled=False)

    def check(*columns: Any) -> None:
        good = allowed(SimpleNamespace(**dict(zip(names, columns, strict=False))))
        columns[-1][...] = np.where(good, Status.OK, Status.BAD_INPUT)
        if further:
            further(*columns)

    return signed(check, [*names, "status"])
