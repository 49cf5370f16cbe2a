"""Runs a study: checks the arguments, then computes all cells in memory or into a file.

An existing output is examined and continued; blocks go to a store that survives a kill.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any, Literal, TextIO

import numpy as np

from sweep.cells.fingerprint import difference
from sweep.cells.reduce import gathered
from sweep.cells.sample import require_asked
from sweep.cells.schema import empty, ending, now, part
from sweep.errors import SweepError, Terminated, signals_held
from sweep.file import disk
from sweep.file.frame import cuts_of
from sweep.file.open import in_memory, memory, open_result, verdict
from sweep.file.reading import StoredFile
from sweep.file.store import alone, begun, earlier, lock_of, reopened, unfinished_of
from sweep.runs.extend import Reused, has_failed, obstacle
from sweep.runs.loop import Loop, Task, TimeUp
from sweep.study.keys import KEYS
from sweep.study.model import Study
from sweep.study.read import Given
from sweep.study.read import study as as_study
from sweep.words import did_you_mean, listed

if TYPE_CHECKING:
    import xarray as xr

Ending = Literal["done before", "complete", "unfinished", "not begun"]
"""Outcome of a run: the last two if the time was up before the end, or before the first block."""


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
    """Compute every cell of a study. Interruptions do not change a bit of the result.

    Parameters
    ----------
    study : Study, path of a study file, mapping of its keys, or Dataset of an earlier run, optional
        None: the study's keys are keyword arguments.
    path : path, optional
        The output, an HDF5 (netCDF4) file. A run that was stopped or killed is continued; an output that is complete
        for the same study is opened and left alone. None: in memory.
    workers : int, optional
        Number of cores; default: all that this process may use.
    force : bool
        Overwrite the result of another study, discard an unfinished one, or compute a complete one anew.
    progress : bool or text stream, optional
        Where progress is printed; None and True: stderr, False: nowhere. A run of less than a second prints nothing.
    block_cells : int, optional
        Cells per block; default: chosen from a timed sample. A continued run keeps its blocks.
    extend : bool
        If the output is complete for a study whose axis values are a subset of this one's, compute only the new cells;
        the output is replaced when all are done. A result of another version of foliot cannot be extended.
    until : str or datetime, optional
        Stop at "07:00" or "2027-01-31 07:00", at most the time of a block later; the unfinished result is returned.
    cluster : str or distributed.Client, optional
        Compute on the workers of this dask scheduler ("tcp://10.0.0.1:8786", or a scheduler file) instead of here.
        Workers that can write to the folder of the output write there; others send their numbers. If there are no
        workers, or all are lost, the run waits for new ones.
    repair : bool
        If the output is complete for this study, but damaged on disk, compute the damaged blocks again.
    isolate : bool
        Solve cells in separate processes, so that a crash or an endless loop loses only the cells where it happens.
        `sweep run` does so for every kernel "module:NAME".
    cell_timeout : float or str, optional
        Time limit per cell, in seconds or as "90 s", "5 min", "1 h"; implies `isolate`. Default: a minute, or a hundred
        times the slowest cell of the timed sample if that is longer.
    retry_failed : bool
        If the output is complete, compute its FAILED cells again.
    **keys
        Keys of the study, as in `sweep.study`.

    Raises
    ------
    SweepError
        The output cannot be written, belongs to another study or another run, the disk is full, or a kernel failed.
        Finished blocks are kept.
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
    require_asked(task.study)
    return computed(task)


def computed(task: Task) -> xr.Dataset:
    """What `run` gives; its study may ask for none of its cells, as one round of a refinement does."""
    if task.path is None:
        return _in_memory(task)
    outcome = _to_file(task)
    if outcome == "not begun":
        raise SweepError("until: the time was up before the first cell could be computed")
    return open_result(unfinished_of(task.output) if outcome == "unfinished" else task.output)


def complete(study: Study, path: str | os.PathLike[str], **options: Any) -> Ending:
    """Runs as `run` does, and opens nothing."""
    task = Task(study, path, **options)
    require_asked(study)
    return _to_file(task)


def _in_memory(task: Task) -> xr.Dataset:
    """Raises SweepError also where the memory is too small."""
    start = now()
    with contextlib.ExitStack() as stack:
        loop = Loop(task, stack)
        bench, rows = loop.bench, loop.bench.rows.count
        if rows * bench.row_bytes > memory():
            needed = f"{rows * bench.row_bytes / 1e9:.1f} GB"
            raise SweepError(f"the result takes {needed}, more than the memory; give a path to store it")
        arrays = empty(bench.columns, rows)

        def room(job: int) -> dict[str, Any]:
            return part(arrays, slice(*bench.partition.bounds(job)))

        def put(job: int, found: Mapping[str, Any]) -> None:
            for name, place in room(job).items():
                if not np.may_share_memory(place, found[name]):  # what was computed here lies there already
                    place[...] = found[name]

        loop.compute(range(bench.partition.count), put, room)
        loop.progress.end()
    found = arrays if task.study.summary is None else gathered(task.study, arrays)
    return in_memory(task.schema, found).assign_attrs(start=start, **ending(loop.progress.rate))


def _to_file(task: Task) -> Ending:
    """Continues, begins or leaves alone what is there. Raises SweepError, KeyboardInterrupt, Terminated."""
    traces = any(map(disk.mark, (unfinished_of(task.output), lock_of(task.output))))
    seen, (standing, damaged) = disk.mark(task.output), ("nothing", ()) if traces else _standing(task)
    if standing == "complete":
        return "done before"
    with alone(task.output), contextlib.ExitStack() as stack:
        if traces or seen != disk.mark(task.output):  # another run may have ended before this one had the lock
            standing, damaged = _standing(task)
        store = earlier(task.output, task.fingerprint, task.force or standing == "complete")
        if standing == "complete":
            if store is not None:
                store.close()
                disk.remove(store.path)
            return "done before"
        if store is not None:
            damaged = verdict(task.output, stack.enter_context(store)).blocks or ()
        elif standing == "damaged":
            store = stack.enter_context(reopened(task.output))
        if store is not None:
            store.resume(damaged)
        if store is not None and not store.missing():  # its end alone is missing, or the columns made there are damaged
            with signals_held():
                store.finish(0.0)
            return "complete"
        try:
            with contextlib.ExitStack() as running:
                known = None
                if standing == "reused":
                    known = running.enter_context(Reused(task.output, task.study, task.retry_failed))
                # signals are held back from here on, wherever they would leave half a file behind
                loop = Loop(task, running, None if store is None else store.work.blocks, known)
                if store is None:
                    cuts = cuts_of(task.study, task.schema, loop.bench.partition)
                    store = stack.enter_context(begun(task.output, task.schema, cuts, task.cluster is not None))
                for block in damaged:
                    task.note(f"{loop.bench.label(block)} were damaged on the disk and are computed again")
                shared = None if task.cluster is None else store.shared()
                loop.compute(store.missing(), store.put, shared=shared, tick=store.tick)
                store.finish(loop.progress.rate)
                loop.progress.end()
            return "complete"
        except (KeyboardInterrupt, Terminated, TimeUp) as reason:
            if store is not None and store.finished:  # the signal came while the result was put in its place
                raise
            kept = "before the first block"
            if store is not None:
                store.commit()
                kept = f"{int(store.work.done.sum())} of {store.work.blocks.count} blocks are kept"
            why = f", for {reason}" if isinstance(reason, TimeUp) else ""
            task.note(f"stopped{why}; {kept}, run the same command again to continue")
            if isinstance(reason, TimeUp):
                return "not begun" if store is None else "unfinished"
            raise


def _standing(task: Task) -> tuple[Literal["nothing", "complete", "damaged", "reused"], Sequence[int]]:
    """What the output is to this study, whose cells may be "reused"; blocks that are damaged and can be repaired.

    All of it is read. Raises SweepError where it is something else.
    """
    if not disk.mark(task.output):
        return "nothing", ()
    with StoredFile(task.output) as file:
        if task.force:
            return "nothing", ()
        hindrance, ours = obstacle(file.fingerprint, task.fingerprint), file.fingerprint == dict(task.fingerprint)
        if ours or (task.extend and not hindrance):
            checked = verdict(task.output, file)
            if ours and task.repair and checked.blocks is not None:
                return "damaged", checked.blocks
            if not checked.whole:
                cure = "\n  sweep run --repair computes damaged cells again, and nothing else"
                raise SweepError(f"{checked}{'' if checked.blocks is None else cure}")
            return "complete" if ours and not (task.retry_failed and has_failed(file)) else "reused", ()
    what = f"cannot be extended, for {hindrance}" if task.extend else "holds the result of another study or version"
    extendable = "; where its axes have only got more values, --extend computes the new cells alone"
    cure = f"choose another name, or overwrite it with --force{'' if hindrance else extendable}"
    changes = "".join(f"\n  {line}" for line in difference(file.fingerprint, task.fingerprint))
    raise SweepError(f"{task.output}: {what}; {cure}{changes}")
