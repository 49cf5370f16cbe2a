"""A scene as compiled code, made once.

What Python calls lies as a file in the folder of the kernels' own machine code (`cache`), named by the scene and a
digest of its graph; all else is made of its functions (`functions`) in memory.
"""

import contextlib
import functools
import os
import sys
import tempfile
import threading
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
from numba.core.errors import NumbaError

from kernels.codegen.functions import Functions, entry
from kernels.codegen.record import record
from kernels.integrate.driver import advance
from kernels.integrate.taylor_leg import to_event
from kernels.lanes import cache
from kernels.lanes.jit import COMPILED, cached, jit_call
from kernels.source_text.expression import FUNCTIONS, SceneError

ORDERS = (12, 18)
_BUILDING = threading.RLock()
"""No thread may be given a module that another one is still making."""

RUN = '''
"""Cells of the scene {name}: written by kernels; do not change it here."""

from kernels.codegen.module import kept
from kernels.lanes.refill import each_refilled


@kept
def run(cells, memory, held, together):
    """Each cell, a row of what a lane knows, until its last switch."""
    each_refilled(advance, cells, memory, held, together)
'''


def kept(function):
    """A function called from Python, whose machine code is kept: its file is named by all it was made from."""
    return cached(function) if COMPILED else _quiet(function)


@contextlib.contextmanager
def compiling(scene, method):
    """Where numba fails inside, a SceneError of two lines in place of its hundred."""
    try:
        yield
    except NumbaError as error:
        why = next((line.strip() for line in str(error).splitlines() if line.strip() and "Failed in" not in line), "")
        raise SceneError(
            f"the scene {scene} cannot be compiled for the method {method}: {why[:200]}\n"
            f"Take another method, or say the scene in simpler terms: {FUNCTIONS}"
        ) from None


def _quiet(function):
    """Plain Python without numpy's warnings: 1/0 is inf here as in compiled code."""

    @functools.wraps(function)
    def call(*arguments):
        with np.errstate(all="ignore"):
            return function(*arguments)

    return call


@functools.cache
def build(scene):
    """What is made of a scene, once: `M`, its `Written`, and what runs cells by series of both orders."""
    functions = Functions(scene, record(scene))
    m = functions.written()
    # a scene that slides is not followed by the Taylor method
    runs = {} if scene.slides else by_series(functions, m)
    return SimpleNamespace(STATES=scene.states, M=m, **runs)


def by_series(functions, m, changes=None):
    """`run_12` and `run_18`; with an error that is carried along by these changes (`Functions.of_series`)."""
    nested = functions.recorded.nested
    at_kink, hides = entry(nested) if nested else None, any(map(any, m.hiding)) or None

    def run(order):
        series = functions.of_series(m, order, changes)

        @jit_call
        def leg(state, mode, unit, h, on, tolerance, active, errors):
            return to_event(series, state, mode, unit, h, on, tolerance, active, errors, hides, at_kink)

        return driven(functions, m, leg, f"taylor_{order}", series.error)

    return {f"run_{order}": run(order) for order in ORDERS}


def driven(functions, m, leg, kind, tells=None):
    """What runs cells, leg by leg; `tells` : `carried.Changes` where the error is carried along."""
    further, slides, kinks = functions.recorded.surfaces, m.slides, len(functions.kinks)
    mark = 2.0 if functions.scene.only_first else 1.0
    surfaces = tuple(mark * (j in further) for j in range(kinks)) if further else None

    @jit_call
    def of_lanes(memory, i):
        return advance(m, leg, memory, i, tells, slides, surfaces)

    return running(functions, of_lanes, kind if tells is None else f"{kind}_told")


def running(functions, of_lanes, kind):
    """What runs cells, of which `of_lanes` takes every lane on until one has finished."""
    name = functions.scene.name
    return loaded(f"{kind}_{name}_{functions.digest}", RUN.lstrip().format(name=name), advance=of_lanes).run


def loaded(name, text, **scope):
    """The module of that text, in which these names are known."""
    with _BUILDING:
        if name not in sys.modules:
            module = ModuleType(name)
            module.__file__ = str(_written(name, text))
            vars(module).update(scope)
            sys.modules[name] = module
            try:
                # not what the file says, nor Python's compiled copy of it: others may have been there
                exec(compile(text, module.__file__, "exec"), module.__dict__)
            except BaseException:
                del sys.modules[name]
                raise
        return sys.modules[name]


def _written(name, text):
    """The file of that text: among the kernels' machine code, or where that cannot be, a temporary one."""
    folder = cache.FOLDER or Path(tempfile.mkdtemp(prefix="foliot_scene_"))
    path = folder / f"{name}.py"
    if not path.is_file() or path.read_text() != text:
        handle, draft = tempfile.mkstemp(dir=folder, suffix=".draft")
        with os.fdopen(handle, "w") as file:
            file.write(text)
        Path(draft).replace(path)
    return path
