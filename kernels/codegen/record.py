"""Records the functions of a scene as graphs: rates, surface, switch and start."""

import contextlib
import copy
import functools
import inspect
import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from kernels.codegen.sliding import slid
from kernels.expression.graph import (
    ADD,
    FUNCTIONS,
    INPUT,
    NAMED,
    NUMBER,
    SCALED,
    Expression,
    Graph,
    SceneError,
    holds,
    power,
)

RESERVED = ("side", "flips", "time", "interval", "rtol", "status")
"""Names that a scene's states and parameters cannot have."""
_OF_MATH = NAMED | {f"a{name}": NAMED[f"arc{name}"] for name in ("sin", "cos", "tan")} | {"fabs": abs, "pow": power}
_RECORDING = threading.RLock()
"""One thread at a time changes the names of a module."""


@dataclass(frozen=True)
class Recorded:
    """The expressions of a scene, in one graph.

    `events` are (offset, factor, u): each fires where offset + factor u falls through 0; the first is the switch, the
    others are the kinks, of which one may be `nested`: its u is, but for a constant factor, the rate of the surface's.
    The switch's has the factor ".way": -1 while the motion is behind the surface, where its event is that it comes up.
    `timed` are the rates per unit of time, an input ".unit" in seconds. `surfaces` are the numbers of the kinks that
    are further surfaces: of these ".sign_j", and of the first ".way", are 1 in `switched` where they are met, else -1.
    `shared`: whether one of them is a kink of the rates too. `onto` and `speeds` are those of `sliding.slid`.
    """

    graph: Graph
    rates: tuple[Expression, ...]
    timed: tuple[Expression, ...]
    surface: Expression
    switched: tuple[Expression, ...]
    started: tuple[Expression, ...]
    events: tuple[tuple[Expression, Expression, Expression], ...]
    nested: int
    surfaces: tuple[int, ...] = ()
    shared: bool = False
    onto: tuple[Expression, ...] = ()
    speeds: tuple[tuple[Expression, Expression], ...] = ()


def record(scene):
    """What the scene's functions do, in a graph of the caller's own, which may go on with it. Raises SceneError.

    They are called once: what they would say later, as a global that has got another value, does not count.
    """
    return copy.deepcopy(_once(scene))


@functools.cache
def _once(scene):
    """What the scene's functions do; they are called again where one asks for a sign of states that are held alone."""
    recorded = _recorded(scene, frozenset())
    held = {name for name, x in zip(scene.states, recorded.rates, strict=True) if x.kind == NUMBER and not x.args[0]}
    if any(holds(u, held) for j, u in enumerate(recorded.graph.kinks) if j not in recorded.surfaces):
        recorded = _recorded(scene, frozenset(held))
    return slid(recorded, scene.states) if scene.slides else recorded


def _recorded(scene, held):
    """Calls each function of the scene once with recording objects."""
    graph = Graph(held)
    states = {name: graph.series(name) for name in scene.states}
    constants = {name: graph.constant(name) for name in (*scene.parameters, "side")}
    has_clock = scene.start_time is not None
    declared, clock = len(states) - has_clock, (graph.of(1.0),) * has_clock
    rates = _called(graph, scene, "rates", scene.rates, states | constants, declared) + clock
    for _, u in map(graph.parts, rates):
        if u.varies and (scene.peaks == "all" or (scene.peaks and u.kind == INPUT)):
            graph.kink(u)
    if scene.surface is None:
        raise SceneError(f"the scene {scene.name} needs a surface, which defines its switches")
    surfaces, found = named_functions(scene.surface), []
    for name, function in surfaces.items():
        found += _called(graph, scene, f"surface {name}".rstrip(), function, states | constants, 1)
        if not found[-1].varies:
            raise SceneError(f"surface of the scene {scene.name}: it does not depend on a state, so no motion meets it")
    surface, known = found[0], {graph.parts(u)[1] for u in graph.kinks}
    shared = any(graph.parts(u)[1] in known for u in found[1:])
    for u in found[1:]:
        graph.kink(u)
    graph.surfaces = numbers = tuple(graph.kinks[u] for u in found[1:])
    met = dict(zip(surfaces, (".way", *(f".sign_{j}" for j in numbers)), strict=True))
    switched = _switched(graph, scene, states, constants, met, declared)
    unit = graph.constant(".unit")
    timed = tuple(graph.timed(rate, unit) for rate in rates)
    started = _called(graph, scene, "start", scene.start, constants, declared)
    if has_clock:
        started += _called(graph, scene, "start_time", scene.start_time, constants, 1)
    kinks = [(graph.of(0.0), graph.constant(f".sign_{j}"), u) for j, u in enumerate(graph.kinks)]
    way = graph.constant(".way")
    offset, factor, u = _affine(graph, surface)
    wayward = offset if offset.kind == NUMBER and not offset.args[0] else way * offset
    events = ((wayward, way * factor, u), *kinks)
    rate = dict(zip(states.values(), rates, strict=True)).get(u)
    nested = 0 if rate is None else 1 + graph.kinks.get(graph.parts(rate)[1], -1)
    return Recorded(graph, rates, timed, surface, switched, started, events, nested, numbers, shared)


def asks_for_time(functions, names):
    """Whether one of them asks for `t`, where no state and no parameter is called so."""
    asked = set()
    for function in filter(callable, functions):  # where Python does not know what it asks for, its recording says so
        with contextlib.suppress(TypeError, ValueError):
            asked.update(inspect.signature(function).parameters)
    return "t" in asked.difference(names)


def named_functions(functions):
    """{name: function} of what may be one function without a name, or none."""
    return dict(functions) if isinstance(functions, Mapping) else {"": functions}


def _switched(graph, scene, states, constants, met, declared):
    """The states behind a switch; where several surfaces are met at once, by the switch of one after the other."""
    switches, behind = named_functions(scene.switch), tuple(states.values())
    if switches.keys() - met.keys() - {""}:
        raise SceneError(f"switch of the scene {scene.name}: there is no surface {min(switches.keys() - met.keys())!r}")
    for name, function in switches.items():
        if function is not None:
            role, named = f"switch {name}".rstrip(), dict(zip(states, behind, strict=True)) | constants
            length = len(states) if name.startswith(".") else declared  # that of a drive puts back the time
            jumped = _called(graph, scene, role, function, named, length) + behind[length:]
            if name:  # what another jump comes to, where it need not be defined, does not count
                met_here = graph.constant(met[name])
                jumped = tuple(graph.chosen(met_here, *pair) for pair in zip(jumped, behind, strict=True))
            behind = jumped
    return behind


def _called(graph, scene, role, function, named, length):
    """What a function of some of the named scalars returns, as expressions."""
    try:
        unknown = [name for name in wanted(function, named) if name not in named]
        if unknown:
            raise SceneError(f"unknown argument {unknown[0]!r}; known: {', '.join(named)}")
        found = returned(function, named)
        if len(found) != length:
            raise SceneError(f"it returns {len(found)} values instead of {length}")
        return tuple(graph.of(value) for value in found)
    except SceneError as error:
        raise SceneError(f"{role} of the scene {scene.name}: {error}") from None
    except Exception as error:
        said = f"{type(error).__name__}: {error}".splitlines()[0][:200]
        raise SceneError(f"{role} of the scene {scene.name} cannot be recorded: {said}; {FUNCTIONS}") from error


def wanted(function, values):
    """The names that a scene's function asks for; all of the values for **keywords, none for a constant."""
    asked = inspect.signature(function).parameters if callable(function) else {}
    return values if any(one.kind == one.VAR_KEYWORD for one in asked.values()) else asked


def returned(function, values):
    """What it returns for those of the values that it asks for, as a tuple; a constant for itself."""
    if not callable(function):
        return (function,)
    with math_recorded(function):
        found = function(**{name: values[name] for name in wanted(function, values)})
    return tuple(found) if isinstance(found, tuple | list | np.ndarray) else (found,)


@contextlib.contextmanager
def math_recorded(function):
    """Within it, names of `math` in the module of a function stand for what is recorded, and does numbers as well."""
    scope = getattr(function, "__globals__", {})
    ours = {id(getattr(math, name)): of for name, of in _OF_MATH.items() if hasattr(math, name)}
    ours[id(math)] = SimpleNamespace(**vars(math) | {n: of for n, of in _OF_MATH.items() if hasattr(math, n)})
    with _RECORDING:
        before = {name: x for name, x in scope.items() if id(x) in ours}
        scope.update({name: ours[id(x)] for name, x in before.items()})
        try:
            yield
        finally:
            scope.update(before)


def _affine(graph, surface):
    """offset, factor, u of a surface offset + factor u; a sum of series is its own u."""
    offset, rest = graph.of(0.0), surface
    if surface.kind == ADD and not all(term.varies for term in surface.args):
        offset, rest = sorted(surface.args, key=lambda term: term.varies)
    factor, u = rest.args if rest.kind == SCALED else (graph.of(1.0), rest)
    return offset, factor, u
