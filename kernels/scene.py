"""A scene of one's own: a motion given by its rates, with a switch where a surface is passed.

    u' = rates(u, side, parameters),  a switch where surface(u, side, parameters) falls through 0         (1)

A scene may have several surfaces, each with its own jump; what is 0 at one of them is located as a kink is (`record`).
The functions are plain Python of named scalars; each asks by name for the states, parameters and `side` that it needs,
and for the time `t`, which is 0 at the start, or `start_time`, unless a state or a parameter is called t.
They are called with objects that record what is done to them (`expression.graph`); of that compiled functions
are made, for one cell and for lanes (`functions`). In them are allowed + - * / ** abs, and sqrt, exp, log, sin, cos,
tan, arcsin, arccos, arctan, sinh, cosh, tanh, hypot, power, sign, floor, mod, maximum, minimum and where of this
module; numpy's of these names are the same, and so are math's in the module that the function is written in.
power(abs(u), n), u a state and n > -1 any number, has no Taylor series at u = 0; there it is followed as
`integrate.powers` says, right to the same tolerance. Of what is not a state, power and sqrt want something above 0
(else OUT_OF_RANGE).

A cell is OK where each state is within rtol of the truth, relative to the largest size that the state had on the way,
and each time within rtol of itself. The surface and the kinks are located, or proved absent, over every step. A motion
that starts behind the surface, or that a switch puts there, meets no switch before it has come up and falls again; one
that starts on the surface and falls switches at once, and so does one that a switch puts onto another surface. What
rounding alone may make of a motion counts: INACCURATE.
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
"""Of named scalars, as its author writes it."""
Functions = Function | Mapping[str, Function]
"""One, or one for each of several surfaces by their names."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What a scene is made of; it is recorded and compiled once, whatever its functions would say later.

    Parameters
    ----------
    name, doc : what it is called, and a line about it
    states : names of the states
    parameters : names of the parameters
    rates : (states, side, parameters) -> the time derivative of each state
    surface : (states, side, parameters) -> what falls through 0 at the switch; or {name: such a function}
    start : (parameters) -> the states at time 0, where side is 1
    switch : (states, side, parameters) -> the states just behind the switch; None: they do not jump; or for some of the
        surfaces {name: such a function}
    most_kinks : between two switches, after which a cell is given up; None: a thousand
    slides : whether motion goes on along a kink onto which both sides press it (`sliding`), or sticks there
    begins : None, or the parameter that is 0 where the motion begins just behind a switch at the first surface, else 1;
        what rounding takes from the surface's value at the start does not count then
    start_time : a number, or (parameters) -> one: then the last state is the time `t`, of which the functions know
        nothing but that they may ask for it
    only_first : whether switches at the first surface alone count; others may lie between, as many as kinks
    until : whether the last parameter is the time after the start at which the first surface is met
    peaks : "all": a kink is wherever a state turns round, so that steps end where its size is largest; "some": of
        states alone whose rate is another one, for a rate may come close to 0 and stay there

    At a switch `side` turns from 1 to -1 or back. Where abs(u) or sign(u) occurs, u = 0 is a *kink*: the motion is
    followed up to it and begun anew behind it.
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
                raise SceneError(f"{name!r} cannot be a name in a scene")
        if len(set(names)) < len(names):
            raise SceneError("a scene's states and parameters need names of their own")
        if not self.states:
            raise SceneError("a scene needs a state")
        if isinstance(self.surface, Mapping) and not self.surface:
            raise SceneError("a scene needs a surface")


class SceneParts(TypedDict, total=False):
    """What the kernels of a scene are declared by, as `scene_kernel` says; a cycle that is driven needs no surface."""

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
    """A kernel that follows a scene from its start to its last switch.

    Parameters
    ----------
    name, doc : what the kernel is called, and a line about it
    states, parameters : what they are called, their units; a state's Field is also that of the output
    rates, surface, start, switch : as in `Scene`
    start_time : what `t` is at the start, where one of the functions asks for it: a number, or (parameters) -> one
    source : where the scene comes from
    example : parameters at which the scene runs well

    Returns
    -------
    Kernel
        With a further parameter `flips`, the number of switches to follow, and as outputs `time` of the last switch,
        `interval` since the one before, and each state just before the last switch.

    Raises
    ------
    SceneError
        Where the functions ask for what is not there, or do what cannot be recorded.
    """
    scene, fields = scene_of(parts), (*parts["parameters"], flips_field(40.0, MOST_FLIPS))
    outputs = (*TIMES, *states_of(parts))
    docs = {
        "taylor": f"{SERIES}; the error propagated, or three runs compared",
        "taylor_once": "the same in one run, each step accurate to rtol; total error unknown (bound inf)",
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
    """A scene's states as outputs."""
    return [replace(field, sized=True) for field in parts["states"]]


def scene_of(parts: SceneParts) -> Scene:
    """The scene of states and parameters that are given as fields; the time is its last state if it is asked for.

    Raises TypeError where one of `parts` is missing or no field, or there is none of that name.
    """
    if wrong := (parts.keys() - SceneParts.__annotations__.keys()) | (SceneParts.__required_keys__ - parts.keys()):
        raise TypeError(f"a scene wants {', '.join(SceneParts.__annotations__)}; wrong or missing: {min(wrong)!r}")
    for field in (*parts["states"], *parts["parameters"]):
        if not isinstance(field, Field):
            raise TypeError(f'states and parameters are Fields, e.g. Field("x", "m", "where it is"); found {field!r}')
    states, parameters = (tuple(field.name for field in parts[key]) for key in ("states", "parameters"))
    surface, switch, start_time = parts.get("surface"), parts.get("switch"), parts.get("start_time")
    scene = Scene(parts["name"], parts["doc"], states, parameters, parts["rates"], surface, parts["start"], switch)
    functions = (scene.rates, *named_functions(surface).values(), *named_functions(switch).values())
    if asks_for_time(functions, (*states, *parameters)):
        return replace(scene, states=(*states, "t"), start_time=0.0 if start_time is None else start_time)
    if start_time is not None:
        raise SceneError(f"start_time of the scene {scene.name}: none of its functions asks for the time t")
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
    """A kernel of a scene by methods that know afterwards what their values are right to.

    Parameters
    ----------
    along : one coordinate, whose values have to rise, or none
    docs : {method: a line about it}
    solved : (method, columns of parameters, rtol, values along, names of outputs that are asked for) -> values of each
        output, (n_cells,) or (n_values, n_cells), or None where there are none; error; status
    check : as in `declared`
    blind : methods whose values may be off by any amount
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
