"""The written module of a scene's Runge-Kutta methods, at a fixed step and to a tolerance.

It lies beside the scene's own module (`module`), whose functions it takes. To a tolerance a cell is followed twice, as
by the Taylor method.
"""

import functools
from types import SimpleNamespace

from kernels.codegen import followed_twice
from kernels.codegen.module import Writer, build, loaded
from kernels.codegen.record import record
from kernels.integrate.events import METHODS
from kernels.source_text.expression import INPUT
from kernels.source_text.stiff import linear

PAIRS = {"dopri5": "DOPRI5", "dop853": "DOP853", "rodas5p": "RODAS5P_PAIR"}
FINEST = 1e-13
"""The tightest tolerance that is tried where a wider one fails: below it rounding stops the steps."""

TEXT = '''
"""Runge-Kutta methods of {name}: written by kernels; do not change it here."""

from {module} import *
from kernels.integrate import fixed_step
from kernels.integrate.adaptive import to_event
from kernels.integrate.pairs import DOP853, DOPRI5, kept_on_kink
from kernels.integrate.rosenbrock import RODAS5P_PAIR

M_FIXED = M._replace(cell=fixed_step.cell_of(M.cell))


@jit
def advance_fixed(memory, i):
    """Every lane on by some steps at a fixed step; whether one has finished."""
    return fixed_step.advance(M_FIXED, memory, i)


@kept
def run(cells, memory, held, together):
    """Each cell, a row of what a lane knows, until its last switch."""
    each_refilled(advance_fixed, cells, memory, held, together)
'''

LEG = '''
PAIR_{method} = {pair}


@jit_call
def leg_{method}(state, mode, unit, h, on, tolerance, active, errors):
    """The motion to its next event."""
    return to_event(M_STIFF, PAIR_{method}, state, mode, unit, h, on, tolerance, active)
'''


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
        run = getattr(stepped(scene), f"run_{method}")
        runs = SimpleNamespace(STATES=module.STATES, M=module.M, run_12=run, run_18=run)
        followed_twice.twice(runs, columns, rtol, outputs, status, FINEST)

    return twice


@functools.cache
def stepped(scene):
    """The module of the scene's steps, written once: `run` at a fixed step, `run_{method}` for each of `PAIRS`."""
    module, writer = build(scene), Writer(scene, record(scene))
    parts = [TEXT.format(name=scene.name, module=module.__name__).lstrip(), linear(writer)]
    parts.append("\nM_STIFF = M._replace(factored=factored, solved=solved)\n")
    for method, pair in PAIRS.items():
        parts.append(LEG.format(method=method, pair=f"kept_on_kink({pair})" if scene.slides else pair))
        parts.append(writer.driven(method))
    return loaded("steps", scene, "\n".join(parts))
