"""Compiler options, once.

No fast-math: with explicit `fma` and no contraction the same source gives the same bits for one cell, for lanes and
on every CPU. `error_model="numpy"`: 1/0 is inf, nothing raises.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba import njit

from kernels.lanes.inlining import aligned, part

F = TypeVar("F", bound=Callable[..., Any])

COMPILED = not numba.config.DISABLE_JIT
"""False under NUMBA_DISABLE_JIT=1, where every function here is plain Python of one cell."""

OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "fastmath": False}


def jit(function: F) -> F:
    """Physics: compiled where it is called, for one cell or for lanes, and always inlined."""
    made: F = part(function, forceinline=True, **OPTIONS)
    return made


def jit_inline(function: F) -> F:
    """As `jit`, but pasted in before anything is compiled: for what is long and used once; saves compile seconds."""
    made: F = njit(inline="always", **OPTIONS)(function)
    return made


def jit_call(function: F) -> F:
    """As `jit`, but left a call: for what is long and used in several places."""
    made: F = part(function, **OPTIONS)
    return made


def jit_apart(function: F) -> F:
    """As `jit_call`, but left a call below inlined functions, too: numba hands their `forceinline` on to all they call.

    For rooms that go cell by cell, whose code would be pasted in everywhere: wear compiles in a third of the seconds.
    In lanes a call may cost more than it saves.
    """
    made: F = part(function, forceinline=False, **OPTIONS)
    return made


def jit_entry(function: Callable[..., Any]) -> Any:
    """As `jit_call`, called from Python."""
    return aligned(function, **OPTIONS)


def cached(function: Callable[..., Any]) -> Any:
    """As `jit_entry`; machine code of this package is kept on the disk."""
    from kernels.lanes.cache import enable

    return enable(jit_entry(function))
