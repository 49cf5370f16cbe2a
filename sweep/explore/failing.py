"""Cells at which a kernel raises, crashes or never ends, found in processes of their own and left out."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from kernels.interface import Status
from sweep.cells.grid import Grid
from sweep.cells.sample import with_method
from sweep.cells.schema import STATUS
from sweep.cells.turns import usable_methods
from sweep.errors import SweepError
from sweep.study.model import Study, frozen

EXTREMES = (1e-3, 1e-14)
"""Values of rtol at which cells are tried."""


def without_failing(study: Study, cell_timeout: float | str | None, note: Callable[[str], None]) -> Study:
    """The cells of a study at which no method fails. Raises SweepError where there is none.

    Parameters
    ----------
    study : of cells one by one, as `sampled` gives them
    cell_timeout : as of `run`
    note : callable
        Told how many are left out, and the first one.
    """
    from sweep.runs.run import run

    good = np.ones(Grid(study).size, bool)
    able = [study.kernel.methods[number].name for number in usable_methods(study)]
    for method in ("auto", *able):  # auto also tries, on cells, methods that cannot do the whole study
        for rtol in EXTREMES:
            trial = with_method(study, method, rtol)
            found = run(trial, progress=False, isolate=True, cell_timeout=cell_timeout)
            good &= found[STATUS].values.ravel() != Status.FAILED
    if good.all():
        return study
    first = " ".join(f"{name}={value}" for name, value in Grid(study).cell(int(good.argmin())).items())
    text = f"the kernel fails at {(~good).sum()} of {good.size} cells, e.g. {first}"
    if not good.any():
        raise SweepError(text)
    note(f"{text}; they are left out")
    axes = {name: dataclasses.replace(a, values=frozen(a.values[good])) for name, a in study.axes.items()}
    return dataclasses.replace(study, axes=axes)
