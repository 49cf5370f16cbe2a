"""Kernels that stand in for others: what a method gives, promises and says, as a test wants it."""

from dataclasses import replace

import numpy as np
from toy import KERNEL

import sweep
from kernels.interface import Kernel
from sweep.cells.grid import Cells
from sweep.cells.solve import Solver


def toy_study(**keys):
    keys = {"outputs": ["impact_speed"], "fixed": {"v0": 0.0}, **keys}
    return sweep.study(kernel="toy:KERNEL", allow_import=True, **keys)


def solved(study, start=0, stop=None):
    solver = Solver(study)
    stop = solver.grid.size if stop is None else stop
    lengths = {"drop": (len(study.along.get("phase", ())),)}
    outputs = {name: np.full((stop - start, *lengths.get(name, ())), -1.0) for name in study.outputs}
    status, used = np.full(stop - start, 99, np.int8), np.full(stop - start, 99, np.int8)
    solver.solve(start, Cells(outputs, status, used))
    return outputs, status, used


def stand_in(**methods):
    """The toy kernel with other functions for some of its methods: name -> (solve, bound)."""
    changed = tuple(
        replace(m, solve=methods[m.name][0], bound=methods[m.name][1]) if m.name in methods else m
        for m in KERNEL.methods
    )
    return replace(KERNEL, methods=changed)


def with_kernel(study, kernel: Kernel):
    return replace(study, kernel=kernel)
