"""Runs a study: blocks of cells on a pool of threads, into memory or into a store that survives a kill."""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from sweep.cells.fingerprint import difference, fingerprint
from sweep.cells.output_schema import gathered, part_columns
from sweep.cells.partition import row_blocks
from sweep.results.open import checked_study, in_memory, memory, open_result, open_unfinished, stored_fingerprint
from sweep.runs.cluster import Cluster, joined
from sweep.runs.extend import Precomputed, Reused, obstacle
from sweep.runs.session import Session, Solve
from sweep.store.assemble import assemble
from sweep.store.manifest import Manifest, read_manifest, restored
from sweep.store.store import Store, folder_of, opened
from sweep.study.read import as_study
from sweep.system.errors import SweepError
from sweep.system.forecast import Ending
from sweep.system.pool import BufferPool, CtrlC, Terminated, cores, whole_number
from sweep.system.progress import Progress, TimeUp, deadline, quantity, stream_of

if TYPE_CHECKING:
    import xarray as xr

    from sweep.study.model import Study

MOST_ATTEMPTS = 3
"""Times that damaged parts are computed again before the disk is given up."""


def run(
    study: Study | Mapping[str, Any],
    path: str | os.PathLike[str] | None = None,
    *,
    workers: int | None = None,
    force: bool = False,
    progress: bool | TextIO | None = None,
    block_cells: int | None = None,
    extend: bool = False,
    until: str | datetime | None = None,
    cluster: Any = None,
) -> xr.Dataset:
    """Computes every cell of a study. The same study gives the same bits, however it is cut and continued.

    Parameters
    ----------
    study : Study, or mapping of the keys of `build_study`
    path : path, optional
        The output, an HDF5 (netCDF4) file. A run that was stopped or killed is continued; an output that is complete
        for the same study is opened and left alone. None: in memory.
    workers : int, optional
        Cells are computed on so many cores at once; default: all this process may use.
    force : bool
        Overwrite the result of another study, give up its unfinished parts, compute a complete one anew.
    progress : bool or text stream, optional
        Where to tell how far it is; None and True: stderr, False: nowhere. A run of less than a second is silent.
    block_cells : int, optional
        Cells a block, instead of a size taken from a timed sample. A run that is continued keeps its own.
    extend : bool
        Where the output is complete for a study of which this one has all values on every axis, and more, compute the
        new cells only; the output is replaced when all are there.
    until : str or datetime, optional
        Stop within a block's time of "07:00" or "2027-01-31 07:00"; what there is by then is returned.
    cluster : str or distributed.Client, optional
        Compute on the workers of this dask scheduler ("tcp://10.0.0.1:8786", or a scheduler file) instead of here.
        Workers that see the folder of the output write there; others send their numbers.

    Raises
    ------
    SweepError
        The output cannot be written, belongs to another study or another run, the disk is full, or a kernel failed.
        What is finished is kept.
    KeyboardInterrupt, SystemExit
        After Ctrl-C or SIGTERM, when the blocks at work have been stored.
    """
    study = as_study(study)
    task = _task(study, workers, force, progress, block_cells, extend, until, cluster)
    if path is None and until is not None:
        raise SweepError("until: give a path as well, or what is computed by then would be lost")
    if path is None:
        return _run_in_memory(task)
    output = _checked_output(path)
    return open_result(output) if _complete(task, output) else open_unfinished(output)


def complete(study: Study, path: str | os.PathLike[str], **options: Any) -> bool:
    """Runs as `run` does, and opens nothing; False where the time was up before the end."""
    return _complete(_task(study, **options), _checked_output(path))


def store_cells(
    study: Study, path: str | os.PathLike[str], arrays: Mapping[str, Any], force: bool = False
) -> xr.Dataset:
    """Writes the result of cells that are solved already, a file like that of `run`.

    Parameters
    ----------
    arrays : mapping of outputs and of `schema.ANCILLARY` to ndarray, shape (cells, ...)

    Raises
    ------
    SweepError
        As `run`.
    """
    task = _Task(study, fingerprint(study), 1, None, None, force, False, None, Precomputed(arrays))
    output = _checked_output(path)
    if not _done(task, output):
        _run_to_file(task, output)
    return open_result(output)


@dataclass(frozen=True)
class _Task:
    study: Study
    fingerprint: Mapping[str, str]
    workers: int
    stream: TextIO | None
    block_cells: int | None
    force: bool
    extend: bool
    until: datetime | None
    precomputed: Precomputed | None = None
    cluster: Any = None


def _task(
    study: Study,
    workers: int | None = None,
    force: bool = False,
    progress: bool | TextIO | None = None,
    block_cells: int | None = None,
    extend: bool = False,
    until: str | datetime | None = None,
    cluster: Any = None,
) -> _Task:
    """What `run` was asked for. Raises SweepError."""
    cells = None if block_cells is None else whole_number("block_cells", block_cells)
    crew = cores() if workers is None else whole_number("workers", workers)
    if cluster is not None and workers is not None:
        raise SweepError("workers, cluster: a cluster brings its own workers; give one of the two")
    stream = stream_of(progress)
    return _Task(study, fingerprint(study), crew, stream, cells, force, extend, deadline(until), cluster=cluster)


def _complete(task: _Task, output: Path) -> bool:
    """False where the time was up before the end."""
    return (_done(task, output) and not folder_of(output).exists()) or _run_to_file(task, output)


def _run_in_memory(task: _Task) -> xr.Dataset:
    with joined(task.cluster) as cluster:
        _wait(cluster, task, task.study.title or "sweep")
        return _compute_in_memory(task, cluster)


def _wait(cluster: Cluster | None, task: _Task, name: str) -> None:
    """Until the cluster has a worker."""
    if cluster is not None:
        cluster.wait(Progress(1, task.stream, name).note, task.until)


def _compute_in_memory(task: _Task, cluster: Cluster | None) -> xr.Dataset:
    note = Progress(1, task.stream, task.study.title or "sweep").note
    session = Session(
        task.study, task.fingerprint, task.workers, block_cells=task.block_cells, cluster=cluster, note=note
    )
    rows = session.row_blocks.count
    needed = rows * session.row_bytes
    if needed > memory():
        raise SweepError(f"the result takes {needed / 1e9:.1f} GB, more than the memory; give a path to store it")
    arrays = {c.name: c.empty(rows) for c in session.columns}

    def work(job: int, solve: Solve) -> None:
        start, stop = session.blocks.bounds(job)
        solve(start, stop, {name: array[start:stop] for name, array in arrays.items()})

    def receive(job: int, found: str | Mapping[str, Any]) -> None:
        assert not isinstance(found, str)
        start, stop = session.blocks.bounds(job)
        for name, array in arrays.items():
            array[start:stop] = found[name]

    jobs = range(session.blocks.count)
    progress = session.progress(task.stream, task.study.title or "sweep", jobs)
    try:
        if cluster is not None:
            session.compute_elsewhere(receive, progress, None)
        else:
            session.compute(min(task.workers, len(jobs)), work, progress)
        progress.end()
    finally:
        progress.stop()
    found = arrays if task.study.summary is None else gathered(task.study, arrays)
    return in_memory(session.dated(progress, session.began), found)


def _run_to_file(task: _Task, output: Path) -> bool:
    """False where the time was up before the end."""
    with opened(output, part_columns(task.study)) as store:
        manifest = _manifest(store, task)
        # looked at again, for another run may have ended before this one had the lock
        if _done(task, output):
            _tidy(store, manifest, task)
            return True
        _take_up(store, manifest, task)
        blocks = None if store.manifest is None else store.blocks
        all_there = store.manifest is not None and not store.missing()
        reused = None if all_there else _reused(task, output)
        with reused or contextlib.nullcontext(), joined(None if all_there else task.cluster) as cluster:
            _wait(cluster, task, output.name)
            session = Session(
                task.study,
                task.fingerprint,
                task.workers,
                blocks,
                task.block_cells,
                not all_there,
                reused,
                task.until,
                cluster,
                Progress(1, task.stream, output.name).note,
            )
            return _run_session(task, session, store, output)


def _run_session(task: _Task, session: Session, store: Store, output: Path) -> bool:
    """Computes and puts together what is missing; False where the time was up before the end."""
    jobs = range(session.blocks.count) if store.manifest is None else store.missing()
    ending = Ending(session.blocks.count, task.workers, session.row_blocks.count * session.row_bytes)
    progress = session.progress(task.stream, output.name, jobs, ending.seconds)
    _check_space(session, output, progress)
    # held back wherever they would leave half a file behind
    with CtrlC():
        if store.manifest is None:
            store.begin(task.study.to_json(), task.fingerprint, session.blocks)
        try:
            _finish(session, store, output, progress, ending)
        except (KeyboardInterrupt, Terminated):
            progress.note(f"stopped; {_kept(store)}")
            raise
        except TimeUp:
            progress.note(f"stopped, for it is {datetime.now():%H:%M}; {_kept(store)}")
            return False
        finally:
            progress.stop()
        store.clear()
    return True


def _kept(store: Store) -> str:
    kept = f"{len(store.names)} of {store.blocks.count} blocks are kept"
    return f"{kept}, run the same command again to continue"


def _reused(task: _Task, output: Path) -> Reused | Precomputed | None:
    """The cells of the result that is extended. Raises SweepError where that is not possible."""
    if task.precomputed is not None:
        return task.precomputed
    if not task.extend or task.force or not output.exists():
        return None
    _check_whole(output)
    return Reused(output, task.study)


def _check_whole(output: Path) -> None:
    """Raises SweepError where a result is damaged."""
    from sweep.results.verify import check_whole

    check_whole(output)


def _manifest(store: Store, task: _Task) -> Manifest | None:
    """What an earlier run left, if it can be read. Raises SweepError where it cannot, unless forced."""
    try:
        manifest = read_manifest(store.folder)
        if manifest is not None:
            checked_study(store.folder, manifest)
            return manifest
    except SweepError:
        if task.force:
            return None
        manifest = _restored(store, task)
        if manifest is None:
            raise
        return manifest
    return None if task.force else _restored(store, task)


def _restored(store: Store, task: _Task) -> Manifest | None:
    """The manifest that is lost or damaged, written anew where the parts are of this study. Raises SweepError."""
    study = task.study
    manifest = restored(store.folder, store.columns, study.to_json(), task.fingerprint, row_blocks(study).count)
    if manifest is not None:
        store.write(manifest)
        Progress(1, task.stream, store.folder.name).note("its spec.json was lost or damaged; it is written anew")
    return manifest


def _take_up(store: Store, manifest: Manifest | None, task: _Task) -> None:
    """Continues what an earlier run left. Raises SweepError where that was another study, unless forced."""
    if manifest is not None and dict(manifest.fingerprint) == dict(task.fingerprint):
        store.resume(manifest)
    elif manifest is None and store.orphans() and not task.force:
        raise SweepError(
            f"{store.folder}: {store.orphans()} finished blocks, but no spec.json that says of which study; "
            "put it back, or give the blocks up with --force"
        )
    elif manifest is None or task.force:
        store.clear()
    else:
        raise SweepError(
            f"{store.folder}: unfinished parts of another study or version; finish that one first, choose another "
            "name, or give its parts up with --force\n" + _listed(manifest.fingerprint, task.fingerprint)
        )


def _tidy(store: Store, manifest: Manifest | None, task: _Task) -> None:
    """Removes parts that were left over although their output is complete; not those of another study."""
    if manifest is None or dict(manifest.fingerprint) == dict(task.fingerprint):
        store.clear()


def _finish(session: Session, store: Store, output: Path, progress: Progress, ending: Ending) -> None:
    """Computes what is missing and puts the result together, again where a part turns out to be damaged."""
    for _ in range(MOST_ATTEMPTS):
        _store_blocks(session, store, progress, ending)
        assert store.manifest is not None
        schema = session.dated(progress, store.manifest.begun)

        def tell(done: int, total: int) -> None:
            progress.gather(done, total)
            session.check_time()

        damaged = assemble(store, session.study, schema, output, session.workers, tell)
        if not damaged:
            progress.end()
            return
        for index in damaged:
            path = store.set_aside(index)
            start, stop = session.cells(index)
            session.again(index, progress)
            progress.note(f"cells {start} to {stop} were damaged on the disk and are computed again; see {path}")
    raise SweepError(f"{store.folder}: what is written there comes back damaged again and again; the disk is failing")


def _store_blocks(session: Session, store: Store, progress: Progress, ending: Ending) -> None:
    jobs = store.missing()
    if not jobs:
        return
    if session.cluster is not None:
        _store_elsewhere(session, store, jobs, progress)
        return
    # twice as many threads as cores: some wait for the disk while the others compute
    threads = min(2 * session.workers, len(jobs))
    cells = min(store.blocks.cells, store.blocks.size)
    buffers = BufferPool(lambda: {c.name: c.empty(cells) for c in store.columns}, threads)

    def work(job: int, solve: Solve) -> None:
        start, stop = store.blocks.bounds(job)
        with buffers.borrow() as columns:
            arrays = {name: column[: stop - start] for name, column in columns.items()}
            if solve(start, stop, arrays):
                begun = time.monotonic()
                store.put(job, arrays)
                ending.wrote(time.monotonic() - begun)

    session.compute(threads, work, progress)


def _store_elsewhere(session: Session, store: Store, jobs: Sequence[int], progress: Progress) -> None:
    """Blocks that workers of a cluster compute, and write themselves where they can."""

    def receive(job: int, found: str | Mapping[str, Any]) -> None:
        if isinstance(found, str):
            store.take(job, found)
        else:
            store.put(job, found)

    session.compute_elsewhere(receive, progress, store.open_shared())
    store.close_shared()


def _check_space(session: Session, output: Path, progress: Progress) -> None:
    """Raises SweepError where the parts to come and the output have no room on the disk."""
    missing = session.row_bytes * (progress.total - progress.done) / session.row_blocks.mean
    schema = session.schema
    coordinates = sum(np.asarray(coordinate.values).nbytes for coordinate in schema.coordinates)
    # the study is in the parts' spec.json, too
    words = 2 * sum(len(str(text).encode()) for text in schema.attrs.values())
    needed = missing + schema.cell_bytes * schema.grid.size + coordinates + words
    free = shutil.disk_usage(output.parent).free
    if needed > free:
        raise SweepError(
            f"{output}: needs {quantity(needed)} more, only {quantity(free)} are free here; free some space, choose "
            "another folder with -o, fewer outputs, or keep a [summary] instead of every cell"
        )


def _done(task: _Task, output: Path) -> bool:
    """Whether the output is complete for this study. Raises SweepError where it is something else."""
    if not output.exists():
        return False
    stored = stored_fingerprint(output)
    if task.force:
        return False
    if stored == dict(task.fingerprint):
        _check_whole(output)
        return True
    hindrance = obstacle(stored, task.fingerprint)
    if task.extend and not hindrance:
        return False
    cure = "choose another name, or overwrite it with --force"
    if task.extend:
        raise SweepError(f"{output}: cannot be extended, for {hindrance}; {cure}\n" + _listed(stored, task.fingerprint))
    more = "" if hindrance else "; where its axes have only got more values, --extend computes the new cells alone"
    raise SweepError(
        f"{output}: holds the result of another study or version; {cure}{more}\n" + _listed(stored, task.fingerprint)
    )


def _listed(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    return "\n".join(f"  {line}" for line in difference(dict(old), dict(new)))


def _checked_output(path: str | os.PathLike[str]) -> Path:
    output = Path(os.path.realpath(path))
    if not output.parent.is_dir():
        raise SweepError(f"{path}: there is no folder {output.parent}")
    return output
