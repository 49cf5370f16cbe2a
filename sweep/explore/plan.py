"""Forecast of a run: cells, bytes, memory and time."""

from __future__ import annotations

import os
import shutil
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from kernels.interface import machine_code_folder
from sweep.cells.block import Guard, faults_reported
from sweep.cells.grid import Grid
from sweep.cells.reduce import strip_bytes
from sweep.cells.sample import require_asked
from sweep.cells.schema import METHOD_USED, STATUS, empty_cells, part
from sweep.cells.solve import Solver
from sweep.cells.timing import work_clock
from sweep.explore.scaling import scaling
from sweep.file.frame import cuts_of, expected_size
from sweep.file.open import memory
from sweep.results.statuses import STATUS_NAMES
from sweep.runs.loop import SILENT_SECONDS, Loop, Task
from sweep.study.model import Study
from sweep.study.read import Given
from sweep.study.read import study as as_study
from sweep.words import Table, counted, duration, paragraph, quantity

DRAWN = 64
"""Cells beside the ends of axes that are solved to see their methods and statuses,"""
LOOK_SECONDS, SHARE = 1.0, 0.25
"""or as many as can be in this time, or this share of the run. So long may looking for superfluous axes take, too."""
ADVICE_CELLS, ADVICE_SECONDS = 300, 0.1
"""Cells that are solved for it at least, about; and what it may always take."""
NO_ADVICE = "superfluous axes are not looked for, which may take as long or fail; sweep.scaling(study) does"
RUN_SECONDS = 0.15
"""Overhead of any run to a file: opening, a sample, the end."""


class Plan:
    """A forecast; `str` of it is what `sweep plan` prints.

    Attributes
    ----------
    cells, blocks, cells_per_block, workers : int
    shape : dict of str to int
        Length of every axis ("cell" of a zip).
    output_bytes : int
    memory_bytes : int
        During a run to a file; a run in memory needs `output_bytes` in addition.
    free_bytes : int
        On the disk of the output.
    cell_seconds, seconds : float
        Per cell on one core; and of the complete `run`, in a process that has called it before, compilation included.
    compile_seconds : float
        Time that compiling the methods took just now; 0 if their machine code was cached.
    methods, statuses : dict of str to float
        Share of the sampled cells that each method solves, and that has each status.
    sampled : int
        Number of sampled cells, which include the ends of all axes.
    scaling : str
        Axes that are superfluous, since they only rescale the outputs; "" if there are none.
    """

    def __init__(self, task: Task) -> None:
        study, before, begun = task.study, work_clock.compiled, time.monotonic()
        self.title, self.kernel, self.outputs = study.title, study.kernel_name, study.outputs
        self.shape, self.workers = study.grid_shape, task.cores
        with ExitStack() as stack:
            loop = Loop(task, stack, hold=False)
            sample, bench, apart = loop.sample, loop.bench, loop.processes
            starting = 0.0 if apart is None else time.monotonic() - begun - apart.seconds
            self.cells, self.cell_seconds = bench.rows.size, sample.cost
            self.seconds = RUN_SECONDS + sample.cost * self.cells / min(self.workers, bench.partition.count)
            solver = Guard(apart or Solver(study))
            looked_at = _looked_at(study, solver, min(LOOK_SECONDS, SHARE * self.seconds))
        self.methods, self.statuses, self.sampled = looked_at
        self.scaling, allowed = NO_ADVICE, max(SHARE * self.seconds, ADVICE_SECONDS)
        if not apart and ADVICE_CELLS * sample.cost < allowed:
            with faults_reported(f"{self.kernel}: the kernel failed"):
                self.scaling = scaling(study).advice
        # every run of a kernel that may crash, or never end, begins processes, and compiles it, anew
        compiling = starting if apart else work_clock.compiled - before
        self.compile_seconds = compiling if compiling > SILENT_SECONDS else 0.0
        self.seconds += starting if apart else 0.0 if self._is_kept else self.compile_seconds
        self.blocks, self.cells_per_block = bench.partition.count, bench.cells(0)[1]
        self.output_bytes = expected_size(task.schema, cuts_of(study, task.schema, bench.partition))
        self.memory_bytes = 2 * self.workers * (bench.partition.cells * bench.row_bytes + strip_bytes(study))
        self.folder = str(Path.cwd() if task.path is None else task.output.parent)
        self.free_bytes = shutil.disk_usage(self.folder).free

    @property
    def _is_kept(self) -> bool:
        """Whether the machine code of the kernel is there for the next run."""
        return machine_code_folder() is not None and ":" not in self.kernel

    @property
    def warnings(self) -> list[str]:
        """What should be seen to before the run."""
        disk = "disk", self.output_bytes, self.free_bytes, f"free in {self.folder}"
        return [
            f"the {what} is too small: {quantity(needed)} needed, {quantity(there)} {where}"
            for what, needed, there, where in (disk, ("memory", self.memory_bytes, memory(), "there"))
            if needed > there
        ]

    def __repr__(self) -> str:
        def shares(found: dict[str, float]) -> str:
            # cells that are refused have no method, and a status that says why
            texts = ", ".join(f"{name} {100 * share:.3g} %" for name, share in found.items() if name != "none")
            return f"{texts or 'none'} of a sample of {counted(self.sampled, 'cell')}"

        when = "just now; the machine code is kept" if self._is_kept else "of it, before the first cell"
        shape = " x ".join(f"{name} {n:,}" for name, n in self.shape.items())
        rows = {
            "kernel": self.kernel,
            "outputs": ", ".join(self.outputs),
            "cells": f"{self.cells:,} = {shape}" if len(self.shape) > 1 else f"{self.cells:,}",
            "blocks": f"{self.blocks:,} of {counted(self.cells_per_block, 'cell')}",
            "output": quantity(self.output_bytes),
            "disk": f"{quantity(self.free_bytes)} free in {self.folder}",
            "memory": quantity(self.memory_bytes),
            "time": f"{duration(self.seconds)} on {counted(self.workers, 'core')}, "
            f"{duration(self.cell_seconds)} per cell",
            "compile": f"about {duration(self.compile_seconds)} {when}" if self.compile_seconds else "",
            "methods": shares(self.methods),
            "statuses": shares(self.statuses),
            "scaling": self.scaling,
        }
        told = [(name, text) for name, text in rows.items() if text]
        table = Table([*told, *(("warning", text) for text in self.warnings)]).text()
        return f"{paragraph(self.title)}\n{table}" if self.title else table


def plan(
    study: Given,
    workers: int | None = None,
    path: str | os.PathLike[str] | None = None,
    note: Callable[[str], None] | None = None,
    isolate: bool = False,
    cell_timeout: float | str | None = None,
) -> Plan:
    """Forecast the cells, file size, memory and time of a run, from a sample of its cells.

    Parameters
    ----------
    workers : int, optional
        Cores; default: all this process may use.
    path : path, optional
        Path of the output; default: in the current folder.
    note : callable, optional
        Called with a message before a compilation that takes long.
    isolate, cell_timeout
        As in `run`: the sampled cells are solved in separate processes.

    Raises
    ------
    SweepError
        The folder of the output does not exist.

    Examples
    --------
    >>> import sweep
    >>> study = sweep.study(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> sweep.plan(study).cells
    2
    """
    keys: dict[str, Any] = {"isolate": isolate, "cell_timeout": cell_timeout, "note": note}
    task = Task(as_study(study), path, workers, progress=False, **keys)
    require_asked(task.study)
    return Plan(task)


def _looked_at(study: Study, solver: Guard, seconds: float) -> tuple[dict[str, float], dict[str, float], int]:
    """Shares of methods and statuses among cells at the ends of axes and, in some seconds, others; and their number.

    The ends are those of every axis, in the middle of the others, and of all axes at once: there a scene is most often
    another one, and so is the method. The others are one of each of equal shares of the grid.
    """
    grid, rng = Grid(study), np.random.default_rng(0)
    last, axis = np.array(grid.shape) - 1, np.eye(len(grid.shape), dtype=bool)
    places = np.concatenate([[0 * last], [last], np.where(axis, 0, last // 2), np.where(axis, last, last // 2)])
    ends = np.ravel_multi_index(tuple(places.T), grid.shape)
    drawn = rng.permutation(((np.arange(DRAWN) + rng.random(DRAWN)) * (grid.size / DRAWN)).astype(np.int64))
    numbers = list(dict.fromkeys([*ends.tolist(), *drawn.tolist()]))
    cells, until = empty_cells(study, len(numbers)), time.perf_counter() + seconds
    for taken, number in enumerate(numbers):
        if number not in ends and time.perf_counter() > until:
            numbers = numbers[:taken]
            break
        solver.solve(number, part(cells, slice(taken, taken + 1)))
    sampled = len(numbers)

    def shares(column: Any, names: dict[int, str]) -> dict[str, float]:
        counts = Counter(column[:sampled].tolist())
        return {names[code]: counts[code] / sampled for code in sorted(counts)}

    methods = {-1: "none", **dict(enumerate(method.name for method in study.kernel.methods))}
    return shares(cells[METHOD_USED], methods), shares(cells[STATUS], STATUS_NAMES), sampled
