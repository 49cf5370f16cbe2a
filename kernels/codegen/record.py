"""What a scene's functions do, recorded: the graphs of its rates, surface, switch and start."""

import inspect
from dataclasses import dataclass

import numpy as np

from kernels.codegen.sliding import slid
from kernels.source_text.expression import ADD, FUNCTIONS, NUMBER, SCALED, Expression, Graph, SceneError

RESERVED = ("side", "flips", "time", "interval", "rtol", "status")
"""Names that a scene's states and parameters cannot have."""


@dataclass(frozen=True)
class Recorded:
    """The expressions of a scene, in one graph.

    `events` are (offset, factor, u): each fires where offset + factor u falls through 0; the first is the switch, the
    others are the kinks. The switch's has the factor ".way": -1 while the motion is behind the surface, where its event
    is that it comes up. `timed` are the rates per unit of time, an input ".unit" in seconds. `onto` and `speeds` are
    those of `sliding.slid`.
    """

    graph: Graph
    rates: tuple[Expression, ...]
    timed: tuple[Expression, ...]
    surface: Expression
    switched: tuple[Expression, ...]
    started: tuple[Expression, ...]
    events: tuple[tuple[Expression, Expression, Expression], ...]
    nested: int
    onto: tuple[Expression, ...] = ()
    speeds: tuple[tuple[Expression, Expression], ...] = ()


def record(scene):
    """Calls each function of the scene once with recording objects. Raises SceneError."""
    graph = Graph()
    states = {name: graph.series(name) for name in scene.states}
    constants = {name: graph.constant(name) for name in (*scene.parameters, "side")}
    rates = _called(graph, scene, "rates", states | constants, len(states))
    surface = _called(graph, scene, "surface", states | constants, 1)[0]
    if not surface.varies:
        raise SceneError(f"surface of the scene {scene.name}: it does not depend on a state, so no motion meets it")
    switched = tuple(states.values())
    if scene.switch is not None:
        switched = _called(graph, scene, "switch", states | constants, len(states))
    unit = graph.constant(".unit")
    timed = tuple(graph.timed(rate, unit) for rate in rates)
    started = _called(graph, scene, "start", constants, len(states))
    kinks = [(graph.of(0.0), graph.constant(f".sign_{j}"), u) for j, u in enumerate(graph.kinks)]
    way = graph.constant(".way")
    offset, factor, u = _affine(graph, surface)
    wayward = offset if offset.kind == NUMBER and not offset.args[0] else way * offset
    events = ((wayward, way * factor, u), *kinks)
    recorded = Recorded(
        graph,
        rates,
        timed,
        surface,
        switched,
        started,
        events,
        _nested(events, dict(zip(states.values(), rates, strict=True))),
    )
    return slid(recorded, scene.states) if scene.slides else recorded


def _called(graph, scene, role, named, length):
    """What a function of some of the named scalars returns, as expressions."""
    try:
        return _recorded(graph, getattr(scene, role), named, length)
    except SceneError as error:
        raise SceneError(f"{role} of the scene {scene.name}: {error}") from None
    except Exception as error:
        said = f"{type(error).__name__}: {error}".splitlines()[0][:200]
        raise SceneError(f"{role} of the scene {scene.name} cannot be recorded: {said}; {FUNCTIONS}") from error


def _recorded(graph, function, named, length):
    wanted = inspect.signature(function).parameters
    unknown = [name for name in wanted if name not in named]
    if unknown:
        raise SceneError(f"it asks for {unknown[0]!r}; there are {', '.join(named)}")
    found = function(**{name: named[name] for name in wanted})
    found = found if isinstance(found, tuple | list | np.ndarray) else (found,)
    if len(found) != length:
        raise SceneError(f"it returns {len(found)} values instead of {length}")
    return tuple(graph.of(value) for value in found)


def _affine(graph, surface):
    """offset, factor, u of a surface offset + factor u; a sum of series is its own u."""
    offset, rest = graph.of(0.0), surface
    if surface.kind == ADD and not all(term.varies for term in surface.args):
        offset, rest = sorted(surface.args, key=lambda term: term.varies)
    factor, u = rest.args if rest.kind == SCALED else (graph.of(1.0), rest)
    return offset, factor, u


def _nested(events, rates):
    """The number of the kink whose u is, but for a constant factor, the rate of the surface; 0 where there is none."""
    surface = events[0][2]
    if surface not in rates:
        return 0
    _, rate = surface.graph.parts(rates[surface])
    return 1 + surface.graph.kinks.get(rate, -1)
