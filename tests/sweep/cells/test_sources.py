"""Every module that the numbers of a kernel come from is in its fingerprint, however it is reached."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import sweep
from kernels.catalogue import KERNELS
from kernels.interface import load
from sweep.cells.fingerprint import SOURCE, fingerprint

ROOT = Path(__file__).parents[3]
FOLDERS = [ROOT, *(ROOT / name for name in ("studies", "tests/oracles", "tests/helpers"))]
OWN = ("own_scene:KERNEL", "rich_scene:RICH")
SHORTER = {
    "polisher_wear_point": {"tau": 1.0}, "foliot_noise": {"half_swings": 40.0, "averaging_time": 20.0},
    "foliot_steps": {"step": 0.2}, "own_scene:KERNEL": {"flips": 2.0}, "rich_scene:RICH": {"flips": 2.0},
}  # fmt: skip
"""Of examples, that take minutes in plain Python."""

SOLVE = """
import json, multiprocessing, sys, traceback
import numba
import numpy as np
import sweep
from sweep.cells.grid import Cells
from sweep.cells.solve import Solver

def solve(keys):
    study = sweep.study(**keys, allow_import=True)
    outputs = {f.name: np.empty((1, *(study.lengths[d] for d in f.dims))) for f in study.asked}
    status = np.empty(1, np.int8)
    Solver(study).solve(0, Cells(outputs, status, np.empty(1, np.int8)))
    assert status[0] < 64, (keys, status)

def executed(studies):
    try:
        for keys in studies:
            solve(keys)
    except Exception:
        return traceback.format_exc()
    return {name: getattr(module, "__file__", None) or "" for name, module in sys.modules.items()}

# each kernel in a process of its own, forked before any of them is imported
with multiprocessing.get_context("fork").Pool(1, maxtasksperchild=1) as pool:
    print(json.dumps(pool.map(executed, json.load(sys.stdin), chunksize=1)))
"""


def studies(name):
    """The kernel's example, a cell of it by every method that can do it."""
    kernel = load(KERNELS.get(name, name))
    fixed = {**kernel.example, **SHORTER.get(name, {})}
    fixed = {n: np.array(value).tolist() for n, value in fixed.items() if not kernel.parameter(n).choices}
    keys = {"kernel": name, "axes": {"rtol": [1e-6]}, "fixed": fixed}
    keys |= {"along": {f.name: [1.0, 2.0] if f.integer else [0.0, 0.5] for f in kernel.along}}
    for method in kernel.methods:
        if not {n for n in method.excludes if n in kernel.example and kernel.example[n] != kernel.parameter(n).default}:
            yield {
                **keys,
                "method": method.name,
                "outputs": [o.name for o in kernel.outputs if o.name not in method.lacks],
            }


@pytest.fixture(scope="module")
def executed():
    """By kernel the modules in this checkout, but the engine's, that a process has when it has solved its cells."""
    names = [*KERNELS, *OWN]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, FOLDERS)), "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", SOLVE],
        input=json.dumps([list(studies(name)) for name in names]),
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found = dict(zip(names, json.loads(done.stdout), strict=True))
    ours = tuple(str(ROOT / folder) + os.sep for folder in ("kernels", "studies", "tests"))

    def of(name):
        modules = found[name]
        assert isinstance(modules, dict), modules
        return {module for module, file in modules.items() if file.startswith(ours)}

    return of


@pytest.mark.parametrize("name", [*sorted(KERNELS), *OWN])
def test_what_solves_a_cell_is_in_the_fingerprint(name, executed):
    found = executed(name) - {"kernels.catalogue"}
    assert {"kernels.interface", KERNELS.get(name, name).partition(":")[0]} <= found
    study = sweep.study(**next(studies(name)), allow_import=True)
    assert found <= {n.removeprefix(SOURCE) for n in fingerprint(study) if n.startswith(SOURCE)}


def test_of_a_scene_all_that_its_written_modules_use_is_in_the_fingerprint(executed):
    found = executed("rich_scene:RICH") | executed("foliot_steps")
    integrators = ("taylor", "fixed_step", "adaptive", "steps", "events", "records")
    assert {*(f"kernels.integrate.{name}" for name in integrators), "kernels.lanes.codes"} <= found
