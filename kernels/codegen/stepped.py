"""A scene's Runge-Kutta methods, at a fixed step and to a tolerance: then a cell is followed three times."""

import functools
from types import SimpleNamespace

from kernels.codegen import followed_twice
from kernels.codegen.functions import Functions
from kernels.codegen.module import build, driven, running
from kernels.codegen.record import record
from kernels.integrate import fixed_step
from kernels.integrate.adaptive import to_event
from kernels.integrate.events import METHODS
from kernels.integrate.pairs import DOP853, DOPRI5, kept_on_kink
from kernels.integrate.rosenbrock import RODAS5P_PAIR
from kernels.lanes.jit import jit_call
from kernels.source_text.expression import INPUT

PAIRS = {"dopri5": DOPRI5, "dop853": DOP853, "rodas5p": RODAS5P_PAIR}
FINEST = 1e-13
"""The tightest tolerance that is tried where a wider one fails: below it rounding stops the steps."""


def _is_speed(recorded, scene, place, expression):
    return expression.kind == INPUT and expression.args[0] == scene.states[place + 1]


def methods_of(scene):
    """The names of the methods that can do the scene: pairs (x, v) with x' = v; for Moreau's one, kinks at v = 0."""
    recorded = record(scene)
    timed = scene.start_time is not None
    n = len(scene.states) - timed
    paired = n % 2 == 0 and all(_is_speed(recorded, scene, j, recorded.rates[j]) for j in range(0, n, 2))
    dry = paired and n == 2 and not timed and all(_is_speed(recorded, scene, 0, u) for u in recorded.graph.kinks)
    lacks = {"semi_implicit": paired, "verlet": paired, "moreau": dry}
    return tuple(name for name in METHODS if lacks.get(name, True))


def twice_by(method, scene):
    """The function of columns (`followed_twice.twice`) that follows the scene by a method of `PAIRS`."""

    def twice(module, columns, rtol, outputs, status):
        followed_twice.twice(runs(scene, method), columns, rtol, outputs, status, FINEST)

    return twice


@functools.cache
def runs(scene, method):
    """What `followed_twice` takes of a module, by a method of `PAIRS`.

    `first` is the first step by its tolerance, in units: two runs that began alike would share the steps that grow or
    shrink by the most allowed, and their errors, of which their difference then says nothing.
    """
    run, order = getattr(stepped(scene), f"run_{method}"), PAIRS[method].order

    def first(tolerance):
        return tolerance ** (1.0 / order)

    return SimpleNamespace(STATES=scene.states, M=build(scene).M, run_12=run, run_18=run, first=first)


@functools.cache
def stepped(scene):
    """What runs the scene's steps, made once: `run` at a fixed step, `run_{method}` for each of `PAIRS`."""
    functions, m = Functions(scene, record(scene)), build(scene).M
    fixed = m._replace(cell=fixed_step.cell_of(m.cell))
    stiff = m._replace(**dict(zip(("factored", "solved"), functions.linear(), strict=True)))

    @jit_call
    def of_lanes(memory, i):
        return fixed_step.advance(fixed, memory, i)

    by_pair = {
        f"run_{method}": driven(functions, stiff, _leg(stiff, kept_on_kink(pair) if scene.slides else pair), method)
        for method, pair in PAIRS.items()
    }
    return SimpleNamespace(
        STATES=scene.states, M_FIXED=fixed, M_STIFF=stiff, run=running(functions, of_lanes, "fixed"), **by_pair
    )


def _leg(m, pair):
    """The motion to its next event by a pair."""

    @jit_call
    def leg(state, mode, unit, h, on, tolerance, active, errors):
        return to_event(m, pair, state, mode, unit, h, on, tolerance, active)

    return leg
