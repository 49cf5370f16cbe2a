"""A run into a file: what stands at its place is looked at and continued; blocks go to a store that survives a kill."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from sweep.cells.block import Blocks
from sweep.cells.fingerprint import difference
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.frame import cuts_of
from sweep.file.open import verdict
from sweep.file.reading import StoredFile
from sweep.file.store import Store, alone, begun, earlier, lock_of, reopened, unfinished_of
from sweep.runs.extend import Reused, has_failed, obstacle
from sweep.runs.loop import Loop, Task
from sweep.runs.pool import Terminated, TimeUp, signals_held

Ending = Literal["done before", "complete", "unfinished", "not begun"]
"""What became of an output: the last two where the time was up before the end, or before the first block."""


def run_to_file(task: Task) -> Ending:
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
            damaged = stack.enter_context(store).resume()
        elif standing == "damaged":
            store = stack.enter_context(reopened(task.output))
            store.resume(damaged)
        if store is not None and not store.missing():  # its end alone is missing, or the columns made there are damaged
            with signals_held():
                store.finish(0.0)
            return "complete"
        try:
            with contextlib.ExitStack() as running:
                known = None
                if standing == "reused":
                    reused = Reused(task.output, task.study, task.retry_failed)
                    known = running.enter_context(contextlib.closing(reused))
                # signals are held back from here on, wherever they would leave half a file behind
                loop = Loop(task, running, None if store is None else store.work.blocks, known)
                if store is None:
                    cuts = cuts_of(task.study, task.schema, loop.blocks.partition)
                    store = stack.enter_context(begun(task.output, task.schema, cuts, task.cluster is not None))
                for block in damaged:
                    task.note(f"{loop.blocks.label(block)} were damaged on the disk and are computed again")
                shared = None if task.cluster is None else store.shared()
                loop.compute(store.missing(), _Stored(store, loop.blocks, known), shared, store.tick)
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
            checked.require_whole()
            return "complete" if ours and not (task.retry_failed and has_failed(file)) else "reused", ()
    what = f"cannot be extended, for {hindrance}" if task.extend else "holds the result of another study or version"
    extendable = "; where its axes have only got more values, --extend computes the new cells alone"
    cure = f"choose another name, or overwrite it with --force{'' if hindrance else extendable}"
    changes = "".join(f"\n  {line}" for line in difference(file.fingerprint, task.fingerprint))
    raise SweepError(f"{task.output}: {what}; {cure}{changes}")


class _Stored:
    """Where blocks of a run to a file go, with the cells that are known."""

    def __init__(self, store: Store, blocks: Blocks, known: Reused | None) -> None:
        self._store, self._blocks, self._known, self.room = store, blocks, known, blocks.own

    def put(self, job: int, found: bytes | Mapping[str, Any]) -> None:
        if self._known is not None and not isinstance(found, bytes):
            # what came from elsewhere may be read only
            found = {name: c if c.flags.writeable else c.copy() for name, c in found.items()}
            self._known.fill(*self._blocks.bounds(job), found)
        self._store.put(job, found)
