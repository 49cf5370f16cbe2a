"""Kernels that stand in for others: what a method gives, promises and says, as a test wants it."""

import numpy as np

import sweep
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
