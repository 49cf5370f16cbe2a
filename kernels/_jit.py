"""Compiler options, once, and the place of numba's disk cache.

No fast-math: with explicit `fma` and no contraction the same source gives the same bits for one cell, for lanes and
on every CPU. `error_model="numpy"`: 1/0 is inf, nothing raises.

numba's own cache is stale when a *called* module changes, so ours lives in a folder named by a digest of all kernel
sources, numba, llvmlite and the CPU. Only entry functions are cached: each is compiled for one signature, so two
processes that race write the same file.
"""

import hashlib
import os
from pathlib import Path

import llvmlite
import numba
from llvmlite import binding
from numba import njit

COMPILED = not numba.config.DISABLE_JIT
"""False under NUMBA_DISABLE_JIT=1, where every function here is plain Python of one cell."""

_OPTIONS = {"error_model": "numpy", "nogil": True, "fastmath": False}


def _cache_folder() -> Path:
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    cpu = f"{binding.get_host_cpu_name()} {binding.get_host_cpu_features().flatten()}"
    digest.update(f"{numba.__version__} {llvmlite.__version__} {cpu}".encode())
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return home / "foliot" / digest.hexdigest()[:20]


if COMPILED and not os.environ.get("NUMBA_CACHE_DIR"):
    numba.config.CACHE_DIR = str(_cache_folder())


def jit(function):
    """Physics: compiled where it is called, for one cell or for lanes, and always inlined."""
    return njit(forceinline=True, **_OPTIONS)(function)


def jit_call(function):
    """As `jit`, but left a call: for what is long and used in several places."""
    return njit(**_OPTIONS)(function)


def cached(function):
    """As `jit_call`, kept in the disk cache; called from Python with one signature only."""
    return njit(cache=True, **_OPTIONS)(function)
