"""Calls every function of kernels, and prints as JSON what each of them had to compile for that.

python compiling.py NAME_OR_ENTRY ...
"""

import itertools
import json
import sys
from pathlib import Path

import numpy as np
from numba.core import event

sys.path += [str(Path(__file__).parent), str(Path(__file__).parents[2] / "studies")]

from columns import bounds, checked, solve

from kernels import catalogue
from kernels.interface import load

SHARED = np.array([1.0, 2.0])
"""Values of every coordinate that cells share."""


def cells_of(kernel):
    """The kernel's example, one cell for each word of a parameter that has some."""
    most = max((len(p.choices) for p in kernel.parameters), default=1)
    words = {p.name: p.choices.values() for p in kernel.parameters if p.choices}
    cells = {name: np.array([value] * max(most, 1)) for name, value in kernel.example.items()}
    return cells | {name: [float(c) for c, _ in zip(itertools.cycle(v), range(most))] for name, v in words.items()}


def use_all(kernel):
    """Calls the check, the methods and their bounds."""
    cells, along = cells_of(kernel), [SHARED] * len(kernel.along)
    assert 0 in checked(kernel, **cells)
    for method in kernel.methods:
        solve(kernel, method.name, along=along, **cells)
        if method.bound is not None:
            bounds(kernel, method.name, along=along, **cells)


def compiled_by(name):
    """What is compiled while a kernel is loaded and used."""
    with event.install_recorder("numba:compile") as recorder:
        use_all(load(name) if ":" in name else catalogue.get(name))
    starts = (one for _, one in recorder.buffer if one.is_start)
    return [one.data["dispatcher"].py_func.__qualname__ for one in starts]


if __name__ == "__main__":
    print(json.dumps({name: compiled_by(name) for name in sys.argv[1:]}))
