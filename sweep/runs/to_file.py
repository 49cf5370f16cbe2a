"""A run into a file: blocks go to a store that survives a kill, and damaged ones are computed again."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sweep.cells.block import Found
from sweep.cells.output_schema import gathered
from sweep.cells.partition import row_blocks
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.frame import cuts_of, expected_size
from sweep.file.open import stored_fingerprint
from sweep.file.reading import StoredFile
from sweep.file.store import Gather, Store, opened
from sweep.file.verify import check_whole
from sweep.runs import resume
from sweep.runs.extend import Precomputed, Retried, Reused, is_of_another_version
from sweep.runs.pool import BufferPool, CtrlC, Terminated
from sweep.runs.progress import TimeUp
from sweep.runs.session import Session, Solve, joined
from sweep.runs.task import Task
from sweep.study.model import Study
from sweep.words import quantity

if TYPE_CHECKING:
    from sweep.runs.cluster import Cluster

MOST_ATTEMPTS = 3
"""Times that damaged blocks are computed again before the disk is given up."""


def run_to_file(task: Task, precomputed: Precomputed | None = None) -> bool:
    """False where the time was up before the end."""
    with opened(task.output) as store, contextlib.ExitStack() as stack:
        # looked at again, for another run may have ended before this one had the lock
        if resume.is_complete(task):
            resume.tidy(store, task)
            return True
        resume.take_up(store, task)
        if store.file is not None and not store.missing():
            return _run_session(Session(task, None, store.table.blocks, sampled=False), store, None)
        reused = precomputed or _reused(task, stack)
        blocks = None if store.file is None else store.table.blocks
        try:
            cluster = stack.enter_context(joined(task))
            session = Session(task, cluster, blocks, sampled=precomputed is None, reused=reused)
        except TimeUp as reason:
            task.note(f"stopped before the first block, for {reason}")
            return False
        return _run_session(session, store, cluster)


def _reused(task: Task, stack: contextlib.ExitStack) -> Reused | None:
    """The cells of the result that is extended. Raises SweepError where that is not possible."""
    if not (task.extend or task.retry_failed) or task.force or not task.output.exists():
        return None
    check_whole(task.output)
    if task.retry_failed:
        return stack.enter_context(Retried(task.output, task.study))
    reused = stack.enter_context(Reused(task.output, task.study))
    if is_of_another_version(stored_fingerprint(task.output), task.fingerprint):
        task.note("another version has computed it; a sample of its cells is computed again")
        reused.check_sample()
    return reused


def _run_session(session: Session, store: Store, cluster: Cluster | None) -> bool:
    """Computes what is missing and ends the result; False where the time was up before."""
    progress = session.begin(range(session.blocks.count) if store.file is None else store.missing())
    session.tick = store.tick
    session.log_begin()
    # held back wherever they would leave half a file behind
    with CtrlC():
        if store.file is None:
            _begin(session, store, shared=cluster is not None)
        try:
            _finish(session, store, cluster)
        except (KeyboardInterrupt, Terminated):
            progress.note(f"stopped; {_kept(store)}")
            raise
        except TimeUp as reason:
            progress.note(f"stopped, for {reason}; {_kept(store)}")
            return False
        finally:
            session.close()
    return True


def _begin(session: Session, store: Store, shared: bool) -> None:
    """Makes the file. Raises SweepError where it has no room on the disk."""
    task = session.task
    schema = replace(session.schema, attrs={**session.schema.attrs, "start": session.began})
    cuts = cuts_of(task.study, schema, session.blocks.partition)
    needed, free = expected_size(schema, cuts), disk.free(task.output.parent)
    if needed > free:
        raise SweepError(
            f"{task.output}: needs {quantity(needed)}, only {quantity(free)} are free here; free some space, choose "
            "another folder with -o, fewer outputs, or keep a [summary] instead of every cell"
        )
    store.begin(schema, cuts, shared)


def _kept(store: Store) -> str:
    store.commit()
    kept = f"{store.count} of {store.table.blocks.count} blocks are kept"
    return f"{kept}, run the same command again to continue"


def _finish(session: Session, store: Store, cluster: Cluster | None) -> None:
    """Computes what is missing and ends the result, again where a block turns out to be damaged."""
    gather = None if session.study.summary is None else _gather(session.study)
    for _ in range(MOST_ATTEMPTS):
        if store.missing():
            _store_blocks(session, store, cluster)
        damaged = store.finish(session.endings(), gather)
        if not damaged:
            session.progress.end()
            return
        for index in damaged:
            session.again(index)
            session.progress.note(f"{session.blocks.label(index)} were damaged on the disk and are computed again")
    raise SweepError(f"{store.path}: what is written there comes back damaged again and again; the disk is failing")


def _gather(study: Study) -> Gather:
    """Makes blocks of a summary's output from its rows."""
    per_group = row_blocks(study).per_group

    def gather(file: StoredFile, block: int) -> dict[str, Any]:
        first, last = file.tables["cells"].blocks.bounds(block)
        rows = {name: c[first * per_group : last * per_group] for name, c in file.columns("rows").items()}
        return gathered(study, rows)

    return gather


def _store_blocks(session: Session, store: Store, cluster: Cluster | None) -> None:
    """Blocks that threads here compute, or workers of a cluster, which write them themselves where they can."""
    buffers = BufferPool(session.blocks.empty)

    def work(job: int, solve: Solve) -> None:
        start, stop = session.blocks.bounds(job)
        with buffers.borrow() as columns:
            arrays = {name: column[: stop - start] for name, column in columns.items()}
            if solve(start, stop, arrays):
                store.put(job, arrays)

    def receive(job: int, found: Found) -> None:
        if isinstance(found, bytes):
            store.take(job, found)
        else:
            store.put(job, found)

    if cluster is None:
        session.compute(work)
    else:
        session.compute_elsewhere(cluster, store.shared(), receive)
