"""A scene as compiled code, made once for each method.

Entry functions are cached with the machine code of the kernels (`cache`), under a digest of the scene's graph.
"""

import contextlib
import functools
from types import FunctionType
from typing import Any, NamedTuple

from numba.core.errors import NumbaError

from kernels.codegen.functions import Functions, cell_of
from kernels.codegen.record import record
from kernels.expression.graph import FUNCTIONS, SceneError
from kernels.integrate import adaptive, fixed_step, taylor_leg
from kernels.integrate.driver import advance
from kernels.integrate.pairs import DOP853, DOPRI5, kept_on_kink
from kernels.integrate.records import Written
from kernels.integrate.rosenbrock import RODAS5P_PAIR
from kernels.lanes.columns import each_refilled
from kernels.lanes.jit import COMPILED, cached, jit_call

PAIRS = {"dopri5": DOPRI5, "dop853": DOP853, "rodas5p": RODAS5P_PAIR}
ORDERS = (12, 18)
_RUNS = {}
"""What runs cells of the scenes seen so far, by its name."""


class Runner(NamedTuple):
    """What runs cells of a scene by one method.

    m : what is written of the scene; its `cell` is all that a lane knows of one
    low, high : the compiled loops over cells (`lanes.columns`), of wide tolerances and of tight ones
    order : of an embedded pair; None where the first step does not hang on the tolerance
    """

    scene: Any
    m: Written
    low: Any
    high: Any
    order: float | None = None

    @property
    def outputs(self):
        """How many outputs there are: time, interval, and the states but for a clock."""
        return 2 + len(self.scene.states) - (self.scene.start_time is not None)


@functools.cache
def written_of(scene):
    """The scene's functions, and what is written of it for every method."""
    functions = Functions(scene, record(scene))
    return functions, functions.written()


@functools.cache
def runner(scene, method):
    """What runs the scene by a method.

    Parameters
    ----------
    method : "taylor"; "told", the same with its error carried along; one of `PAIRS`; "fixed": steps of a fixed length
    """
    functions, m = written_of(scene)
    if method != "taylor":
        functions = Functions(scene, record(scene))  # derivatives come into its graph in an order of their own
    if method in ("taylor", "told"):
        m = m._replace(cell=cell_of(*functions.size, method == "told"))
        changes, runs = functions.changes() if method == "told" else None, []
        for order in ORDERS:
            series = functions.of_series(m, order, changes)
            kind = f"taylor_{order}" if changes is None else f"taylor_{order}_told"
            runs.append(_driven(functions, m._replace(error=series.error), taylor_leg.to_event, series, kind))
        return Runner(scene, m, *runs)
    if method == "fixed":
        own = fixed_step.Fixed(m.cell.state, *[0.0] * 4, fixed_step.Scheme(*[0.0] * 3))
        m = m._replace(cell=m.cell._replace(own=own))
        run = _driven(functions, m, fixed_step.to_event, m, method)
        return Runner(scene, m, run, run)
    pair = kept_on_kink(PAIRS[method]) if scene.slides else PAIRS[method]
    factored, solved = functions.linear()
    m = m._replace(factored=factored, solved=solved, roundings=pair.roundings, biased=1.0)
    run = _driven(functions, m, adaptive.to_event, pair._replace(scene=m), method)
    return Runner(scene, m, run, run, pair.order)


def _driven(functions, m, to_event, method, kind):
    """What runs cells, leg by leg: `to_event` of the method, a record of what it takes of the scene."""

    @jit_call
    def leg(cell, mode, active):
        return to_event(method, cell, mode, active)

    @jit_call
    def of_lanes(memory, i):
        return advance(m, leg, memory, i)

    return running(functions, of_lanes, kind)


def running(functions, of_lanes, kind):
    """What runs cells, of which `of_lanes` takes every lane on until one has finished; its machine code is kept."""
    name = f"{kind}_{functions.scene.name}_{functions.digest}"
    run = FunctionType(_all_cells.__code__, {"each_refilled": each_refilled, "ADVANCE": of_lanes}, name)
    run.__qualname__, run.__module__ = name, __name__
    return _RUNS.setdefault(name, cached(run) if COMPILED else run)


def _all_cells(cells, memory, held):
    """Each cell, a row of what a lane knows, until its last switch; ADVANCE is of the scene (`running`)."""
    each_refilled(ADVANCE, cells, memory, held)  # noqa: F821  a name of `running`


@contextlib.contextmanager
def compiling(scene, method):
    """Where numba fails inside, a SceneError of two lines in place of its hundred."""
    try:
        yield
    except NumbaError as error:
        why = next((line.strip() for line in str(error).splitlines() if line.strip() and "Failed in" not in line), "")
        raise SceneError(
            f"the scene {scene} cannot be compiled for the method {method}: {why[:200]}\n"
            f"Use another method, or simpler expressions: {FUNCTIONS}"
        ) from None
