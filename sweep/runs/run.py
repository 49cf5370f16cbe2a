"""Runs a study: what is asked for is checked, and computed into memory or into a file."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from datetime import datetime
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from sweep.cells.block import Blocks
from sweep.cells.reduce import gathered
from sweep.cells.schema import ending, now
from sweep.errors import SweepError
from sweep.file.open import in_memory, memory, open_result
from sweep.file.store import unfinished_of
from sweep.runs.loop import Loop, Task
from sweep.runs.to_file import Ending, run_to_file
from sweep.study.keys import KEYS
from sweep.study.model import Study
from sweep.study.read import Given
from sweep.study.read import study as as_study
from sweep.words import did_you_mean, listed

if TYPE_CHECKING:
    import xarray as xr


def run(
    study: Given | None = None,
    path: str | os.PathLike[str] | None = None,
    *,
    workers: int | None = None,
    force: bool = False,
    progress: bool | TextIO | None = None,
    block_cells: int | None = None,
    extend: bool = False,
    until: str | datetime | None = None,
    cluster: Any = None,
    repair: bool = False,
    isolate: bool = False,
    cell_timeout: float | str | None = None,
    retry_failed: bool = False,
    **keys: Any,
) -> xr.Dataset:
    """Compute every cell of a study. The result is the same to the last bit, however often the run is interrupted.

    Parameters
    ----------
    study : Study, path of a study file, mapping of its keys, or Dataset of an earlier run, optional
        None: the study is given as keywords.
    path : path, optional
        The output, an HDF5 (netCDF4) file. A run that was stopped or killed is continued; an output that is complete
        for the same study is opened and left alone. None: in memory.
    workers : int, optional
        Cells are computed on so many cores at once; default: all this process may use.
    force : bool
        Overwrite the result of another study, give up one that is not finished, compute a complete one anew.
    progress : bool or text stream, optional
        Where progress is printed; None and True: stderr, False: nowhere. A run of less than a second prints nothing.
    block_cells : int, optional
        Cells a block, instead of a size taken from a timed sample. A run that is continued keeps its own.
    extend : bool
        Where the output is complete for a study of which this one has all values on every axis, and more, compute the
        new cells only; the output is replaced when all are there. One that another version of foliot has computed
        cannot be extended.
    until : str or datetime, optional
        Stop at "07:00" or "2027-01-31 07:00", at most the time of a block later; the unfinished result is returned.
    cluster : str or distributed.Client, optional
        Compute on the workers of this dask scheduler ("tcp://10.0.0.1:8786", or a scheduler file) instead of here.
        Workers that can write to the folder of the output write there; others send their numbers. If there are no
        workers, or all are lost, the run waits for new ones.
    repair : bool
        Where the output is complete for this study, but damaged on the disk, compute the damaged blocks again.
    isolate : bool
        Solve cells in separate processes, so that a crash or an endless loop loses only the cells where it happens.
        `sweep run` does so for every kernel "module:NAME".
    cell_timeout : float or str, optional
        Seconds, or "90 s", "5 min", "1 h", that a cell may take; with it cells are isolated. Default: a minute, or a
        hundred times the dearest cell of the timed sample, where that is more.
    retry_failed : bool
        Where the output is complete, compute the cells that FAILED again.
    **keys
        Of `sweep.study`.

    Raises
    ------
    SweepError
        The output cannot be written, belongs to another study or another run, the disk is full, or a kernel failed.
        What is finished is kept.
    KeyboardInterrupt, SystemExit
        After Ctrl-C or SIGTERM, when the blocks in progress have been stored.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", axes={"mu": [0.1, 1.0]}, fixed={"phi0": 1.0, "a": 1.0}, rtol=1e-12)
    >>> ds.period.values.round(6)
    array([44.      ,  7.844719])
    """
    options = {name: value for name, value in locals().items() if name not in ("study", "path", "keys")}
    for key in keys:
        if key not in (*KEYS, "allow_import"):
            hint = did_you_mean(key, [*options, *KEYS]) or f"; a study has {listed(KEYS, word='and')}"
            raise SweepError(f"sweep.run: no such keyword {key}{hint}")
    task = Task(as_study(study, **keys), path, **options)
    if path is not None:
        outcome = run_to_file(task)
        if outcome == "not begun":
            raise SweepError("until: the time was up before the first cell could be computed")
        return open_result(unfinished_of(task.output) if outcome == "unfinished" else task.output)
    start = now()
    with contextlib.ExitStack() as stack:
        loop = Loop(task, stack)
        sink = _Memory(loop.blocks)
        loop.compute(range(loop.blocks.count), sink)
        loop.progress.end()
    found = sink.arrays if task.study.summary is None else gathered(task.study, sink.arrays)
    return in_memory(task.schema, found).assign_attrs(start=start, **ending(loop.progress.rate))


def complete(study: Study, path: str | os.PathLike[str], **options: Any) -> Ending:
    """Runs as `run` does, and opens nothing."""
    return run_to_file(Task(study, path, **options))


class _Memory:
    """Where blocks of a run in memory go: all columns. Raises SweepError where the memory is too small."""

    def __init__(self, blocks: Blocks) -> None:
        self._blocks, rows = blocks, blocks.rows.count
        if rows * blocks.row_bytes > memory():
            needed = f"{rows * blocks.row_bytes / 1e9:.1f} GB"
            raise SweepError(f"the result takes {needed}, more than the memory; give a path to store it")
        self.arrays = blocks.empty(rows)

    def room(self, job: int) -> Mapping[str, Any]:
        """Where a block lies."""
        return {name: array[slice(*self._blocks.bounds(job))] for name, array in self.arrays.items()}

    def put(self, job: int, arrays: Mapping[str, Any]) -> None:
        """Takes a block, which lies there already if it was computed here."""
        for name, place in self.room(job).items():
            if not np.may_share_memory(place, arrays[name]):
                place[...] = arrays[name]
