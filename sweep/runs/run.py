"""Runs a study: what is asked for is checked, and computed into memory or into a file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from datetime import datetime
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from sweep.cells.block import Found
from sweep.cells.fingerprint import fingerprint
from sweep.cells.output_schema import gathered
from sweep.cells.partition import row_blocks
from sweep.cells.sample import require_asked
from sweep.errors import SweepError
from sweep.file.open import in_memory, memory, open_result, open_unfinished
from sweep.file.store import lock_of, unfinished_of
from sweep.runs import resume
from sweep.runs.extend import TAKEN_OVER, Precomputed
from sweep.runs.isolate import limits_of
from sweep.runs.pool import cores, whole_number
from sweep.runs.progress import TimeUp, deadline, stream_of
from sweep.runs.session import Session, Solve, joined
from sweep.runs.task import Task
from sweep.runs.to_file import run_to_file
from sweep.study.keys import KEYS
from sweep.study.read import Given
from sweep.study.read import study as as_study
from sweep.words import as_path, did_you_mean, listed

if TYPE_CHECKING:
    import xarray as xr

    from sweep.runs.cluster import Cluster
    from sweep.study.model import Study

STORED_AT_ONCE = 1 << 16
"""Cells of a block of those that are solved already."""


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
    """Computes every cell of a study. The same study gives the same bits, however it is cut and continued.

    Parameters
    ----------
    study : Study, path of a study file, mapping of its keys, or Dataset of an earlier run, optional
        None: these keys stand as keywords.
    path : path, optional
        The output, an HDF5 (netCDF4) file. A run that was stopped or killed is continued; an output that is complete
        for the same study is opened and left alone. None: in memory.
    workers : int, optional
        Cells are computed on so many cores at once; default: all this process may use.
    force : bool
        Overwrite the result of another study, give up one that is not finished, compute a complete one anew.
    progress : bool or text stream, optional
        Where to tell how far it is; None and True: stderr, False: nowhere. A run of less than a second is silent.
    block_cells : int, optional
        Cells a block, instead of a size taken from a timed sample. A run that is continued keeps its own.
    extend : bool
        Where the output is complete for a study of which this one has all values on every axis, and more, compute the
        new cells only; the output is replaced when all are there. One of an earlier version of foliot is taken over
        if a sample of its cells, computed again, has the same bits.
    until : str or datetime, optional
        Stop within a block's time of "07:00" or "2027-01-31 07:00"; what there is by then is returned.
    cluster : str or distributed.Client, optional
        Compute on the workers of this dask scheduler ("tcp://10.0.0.1:8786", or a scheduler file) instead of here.
        Workers that see the folder of the output write there; others send their numbers. Where there are none, or all
        are lost, new ones are waited for; those of batch systems may be a long time coming.
    repair : bool
        Where the output is complete for this study, but damaged on the disk, compute the damaged blocks again.
    isolate : bool
        Solve cells in processes of their own: a kernel that crashes or never ends costs only the cells it does so at.
        The command does so for every kernel "module:NAME".
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
        After Ctrl-C or SIGTERM, when the blocks at work have been stored.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", axes={"mu": [0.1, 1.0]}, fixed={"phi0": 1.0, "a": 1.0}, rtol=1e-12)
    >>> ds.period.values.round(6)
    array([44.      ,  7.844719])
    """
    _check_keywords(keys)
    task = _task(
        as_study(study, **keys), path, workers=workers, force=force, progress=progress, block_cells=block_cells,
        extend=extend, until=until, cluster=cluster, repair=repair, isolate=isolate, cell_timeout=cell_timeout,
        retry_failed=retry_failed,
    )  # fmt: skip
    if path is None:
        try:
            return _run_in_memory(task)
        except TimeUp as reason:
            raise SweepError(f"stopped, for {reason}; give a path to keep what is computed") from None
    if _complete(task):
        return open_result(task.output)
    if not is_begun(task.output):
        raise SweepError("until: the time was up before the first cell could be computed")
    return open_unfinished(task.output)


def _check_keywords(keys: Mapping[str, Any]) -> None:
    """Raises SweepError for one that neither `run` nor a study has."""
    options = [name for name in signature(run).parameters if name != "keys"]
    for key in keys:
        if key not in (*KEYS, "allow_import"):
            hint = did_you_mean(key, [*options, *KEYS]) or f"; a study has {listed(KEYS, word='and')}"
            raise SweepError(f"sweep.run: no such keyword {key}{hint}")


def complete(study: Study, path: str | os.PathLike[str], **options: Any) -> bool:
    """Runs as `run` does, and opens nothing; False where the time was up before the end."""
    return _complete(_task(study, path, **options))


def is_begun(output: Path) -> bool:
    """Whether there is a sweep that writes an output, and has not ended."""
    return unfinished_of(Path(os.path.realpath(output))).exists()


def store_cells(
    study: Study,
    path: str | os.PathLike[str],
    arrays: Mapping[str, Any],
    force: bool = False,
    mark: Mapping[str, str] | None = None,
    taken_over: str = "",
    attrs: Mapping[str, str] | None = None,
) -> xr.Dataset:
    """Writes the result of cells that are solved already, a file like that of `run`.

    Parameters
    ----------
    arrays : mapping of outputs and of `schema.ANCILLARY` to ndarray, shape (cells, ...)
    mark : mapping, optional
        Its fingerprint, where that is not the one of the study and of this program.
    taken_over : str
        Which program has computed the cells, where it was another.
    attrs : mapping, optional
        Further attributes of the file.

    Raises
    ------
    SweepError
        As `run`.
    """
    block = max(1, min(row_blocks(study).count, STORED_AT_ONCE))
    task = Task(study, dict(mark or fingerprint(study)), _checked(path), 1, force=force, block_cells=block)
    _complete(task, Precomputed(arrays, {**(attrs or {}), **({TAKEN_OVER: taken_over} if taken_over else {})}))
    return open_result(task.output)


def _task(
    study: Study,
    path: str | os.PathLike[str] | None,
    *,
    workers: int | None = None,
    progress: bool | TextIO | None = None,
    block_cells: int | None = None,
    until: str | datetime | None = None,
    isolate: bool = False,
    cell_timeout: float | str | None = None,
    **options: Any,
) -> Task:
    """What `run` was asked for; further options are kept as they are. Raises SweepError."""
    task = Task(
        study,
        fingerprint(study),
        None if path is None else _checked(path),
        cores() if workers is None else whole_number("workers", workers),
        stream_of(progress),
        block_cells=None if block_cells is None else whole_number("block_cells", block_cells),
        until=deadline(until),
        isolate=isolate or cell_timeout is not None,
        limits=limits_of(cell_timeout),
        **options,
    )
    if task.cluster is not None and workers is not None:
        raise SweepError("workers, cluster: a cluster brings its own workers; give one of the two")
    require_asked(study)
    if path is None and until is not None:
        raise SweepError("until: give a path as well, or what is computed by then would be lost")
    if task.extend and task.retry_failed:
        raise SweepError("extend, retry_failed: give one of the two; each continues another result")
    return task


def _checked(path: str | os.PathLike[str]) -> Path:
    output = Path(os.path.realpath(as_path(path)))
    if not output.parent.is_dir():
        raise SweepError(f"{path}: there is no folder {output.parent}")
    return output


def _complete(task: Task, precomputed: Precomputed | None = None) -> bool:
    """False where the time was up before the end."""
    left = unfinished_of(task.output).exists() or lock_of(task.output).exists()
    return (resume.is_complete(task) and not left) or run_to_file(task, precomputed)


def _run_in_memory(task: Task) -> xr.Dataset:
    with joined(task) as cluster:
        session = Session(task, cluster)
        arrays = _arrays(session)
        progress = session.begin(range(session.blocks.count))
        try:
            _fill(session, arrays, cluster)
            progress.end()
        finally:
            session.close()
    found = arrays if task.study.summary is None else gathered(task.study, arrays)
    return in_memory(session.dated(session.began), found)


def _fill(session: Session, arrays: Mapping[str, Any], cluster: Cluster | None) -> None:
    """Computes all rows into their places."""

    def place(job: int) -> dict[str, Any]:
        return {name: array[slice(*session.blocks.bounds(job))] for name, array in arrays.items()}

    def work(job: int, solve: Solve) -> None:
        solve(*session.blocks.bounds(job), place(job))

    def receive(job: int, found: Found) -> None:
        assert not isinstance(found, bytes)
        for name, column in place(job).items():
            column[...] = found[name]

    if cluster is None:
        session.compute(work)
    else:
        session.compute_elsewhere(cluster, None, receive)


def _arrays(session: Session) -> dict[str, Any]:
    """Columns of all rows. Raises SweepError where the memory is too small."""
    rows = session.blocks.rows.count
    needed = rows * session.blocks.row_bytes
    if needed > memory():
        raise SweepError(f"the result takes {needed / 1e9:.1f} GB, more than the memory; give a path to store it")
    return session.blocks.empty(rows)
