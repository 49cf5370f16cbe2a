"""What one core of this machine can do, measured by loops that do nothing else."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from kernels.lanes.jit import jit, jit_entry
from kernels.lanes.vectors import FEW, few_at, fma, sqrt

REPEATS = 7
ROUNDS = 1 << 19
LARGE = 1 << 23
"""Numbers of an array that no cache holds."""


class Machine(NamedTuple):
    """ns a number of each kind of operation, in vectors and one number at a time; of a chain's link; of a byte."""

    vector: dict[str, float]
    single: dict[str, float]
    link: float
    byte: float


STEPS = {
    "plain": jit(lambda x, y: fma(x, y, y)),
    "division": jit(lambda x, y: y / x),
    "root": jit(lambda x, y: sqrt(x + y)),
}
"""Multiply-add, division, square root (with an addition, or all would be 1)."""


def _vectors(step: Any) -> Any:
    """Four independent chains of FEW cells: enough to hide the latency, and in registers all the time."""

    @jit_entry
    def run(x: Any) -> None:
        i, j, k, m = few_at(0), few_at(FEW), few_at(2 * FEW), few_at(3 * FEW)
        a, b, c, d, y = x[i], x[j], x[k], x[m], x[0]
        for _ in range(ROUNDS):
            a, b, c, d = step(a, y), step(b, y), step(c, y), step(d, y)
        x[i], x[j], x[k], x[m] = a, b, c, d

    return run


def _numbers(step: Any) -> Any:
    """Eight independent chains of one number each."""

    @jit_entry
    def run(x: Any) -> None:
        a, b, c, d, e, f, g, h, y = x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[0]
        for _ in range(ROUNDS):
            a, b, c, d = step(a, y), step(b, y), step(c, y), step(d, y)
            e, f, g, h = step(e, y), step(f, y), step(g, y), step(h, y)
        x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8] = a, b, c, d, e, f, g, h

    return run


@jit_entry
def _chain(x: Any) -> None:
    """Multiply-adds each of which waits for the one before it."""
    a, y = x[1], x[0]
    for _ in range(ROUNDS):
        a = fma(a, y, y)
    x[1] = a


def seconds(action: Callable[[], object], repeats: int = REPEATS) -> float:
    """Processor time, best of several, after a first call that may compile."""
    action()
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        action()
        best = min(best, time.process_time() - start)
    return float(best)


def _nanoseconds(run: Any, operations: int) -> float:
    x = np.linspace(0.9, 0.999, 4 * FEW)
    return seconds(lambda: run(x)) / ROUNDS / operations * 1e9


def measured() -> Machine:
    """The machine as it is now."""
    given, taken = np.ones(LARGE), np.ones(LARGE)
    return Machine(
        vector={kind: _nanoseconds(_vectors(step), 4 * FEW) for kind, step in STEPS.items()},
        single={kind: _nanoseconds(_numbers(step), 8) for kind, step in STEPS.items()},
        link=_nanoseconds(_chain, 1),
        byte=seconds(lambda: np.copyto(taken, given)) / (16 * LARGE) * 1e9,
    )
