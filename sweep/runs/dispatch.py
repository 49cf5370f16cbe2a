"""The blocks of a run on their way to the workers of a cluster and back.

Tasks hold several short blocks, so that the scheduler has some tasks a second to place, not thousands. A worker that
dies costs the blocks it had at hand, which go to others; where workers die of a task again and again, dask gives it up,
and the run ends.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError, Future
from itertools import islice
from typing import Any

import numpy as np
from distributed import KilledWorker

from sweep.cells.block import Blocks, Computed
from sweep.errors import SweepError
from sweep.file.store import Shared
from sweep.runs.cluster import Cluster
from sweep.runs.extend import Precomputed, Reused
from sweep.runs.forecast import Forecast
from sweep.runs.isolate import Limits, kernel_paths
from sweep.runs.log import log
from sweep.runs.pool import CtrlC, through
from sweep.runs.task import Task
from sweep.runs.worker import Answer, Assignment, Sent, digest

TASK_SECONDS = 0.5
"""Blocks shorter than this go to a worker several at a time;"""
TASK_BYTES = 32 << 20
"""but no more than this, where their numbers are sent back."""
MOST_ROUNDS = 3
"""Times that blocks are tried again whose answer got lost."""

Batch = tuple[int, ...]


class Dispatch:
    """Computes blocks on the workers of a cluster: the executor of a session, once.

    Parameters
    ----------
    cluster : Cluster
    task : Task
    blocks : how the rows are cut
    forecast : of the blocks that there are to compute
    reused : cells that need not be computed; they are filled in here
    shared : file to which workers that see it write; None: all numbers are wanted here
    limits : what cells may take that are solved in processes of their own; None: in those of the workers
    """

    def __init__(
        self,
        cluster: Cluster,
        task: Task,
        blocks: Blocks,
        forecast: Forecast,
        reused: Reused | Precomputed | None,
        shared: Shared | None,
        limits: Limits | None = None,
    ) -> None:
        self._cluster, self._blocks, self._forecast, self._reused = cluster, blocks, forecast, reused
        self._note = task.note
        name, seen = f"foliot-{secrets.token_hex(4)}", shared if reused is None else None
        words = name, task.study.to_json(), task.fingerprint, blocks.partition, seen, kernel_paths(task.study), limits
        self._assignment = Assignment(*words)
        self._answers = 0
        self._most = max(1, TASK_BYTES // max(1, self._blocks.partition.cells * self._blocks.row_bytes))
        self._lost: list[int] = []
        self._threads: int | None = None

    def compute(self, blocks: Iterator[int], receive: Callable[[Computed | None], None]) -> None:
        """Calls `receive` with every block that is done, and with None now and then. Raises SweepError."""
        self._receive = receive
        with self._cluster.introduced(self._assignment), CtrlC() as ctrl_c:
            self._submit(self._batches(blocks), ctrl_c)
            for _ in range(MOST_ROUNDS):
                again, self._lost = [(job,) for job in self._lost], []
                self._submit(iter(again), ctrl_c)
        if self._lost:
            raise self._died(tuple(self._lost))

    def _submit(self, batches: Iterator[Batch], ctrl_c: CtrlC) -> None:
        executor = self._cluster.executor()

        def submit(batch: Batch) -> Future[Answer]:
            masks = {job: mask for job in batch if (mask := self._mask(job)) is not None}
            return self._cluster.submit(executor, self._assignment.run, batch, masks)

        def settled(batch: Batch | None, future: Future[Answer] | None) -> None:
            if batch is not None and future is not None:
                self._take(batch, future)
            else:
                self._look_for_workers()
                self._receive(None)

        def capacity() -> int:
            return 2 + 2 * self._cluster.threads

        through(batches, submit, capacity, settled, lambda: self._cluster.cancel(executor), ctrl_c)

    def _batches(self, blocks: Iterator[int]) -> Iterator[Batch]:
        """As many blocks together as should take half a second; fewer at the beginning, and towards the end."""
        left = self._forecast.blocks
        while left > 0:
            batch, seconds = [], 0.0
            for job in islice(blocks, self._longest(left)):
                left -= 1
                if not self._is_reused(job):
                    batch.append(job)
                    seconds += self._forecast.seconds(job)
                if seconds >= TASK_SECONDS:
                    break
            if batch:
                yield tuple(batch)

    def _longest(self, left: int) -> int:
        """Blocks that may go to a worker together."""
        return max(1, min(1 + self._answers, left // (2 * max(1, self._cluster.threads)), self._most))

    def _take(self, batch: Batch, future: Future[Answer]) -> None:
        try:
            answer = future.result()
        except CancelledError as fault:
            raise self._cluster.lost(fault) from fault
        except KilledWorker as fault:
            raise self._died(batch) from fault
        except SweepError:
            raise
        except Exception as fault:
            # distributed's executor trips over a task that fails with its worker and is answered at that moment
            if isinstance(fault, TypeError) and "Answer" in str(fault):
                self._lost += batch
                return
            raise SweepError(
                f"cluster: a worker failed ({type(fault).__name__}: {fault}); what is finished is kept"
            ) from fault
        self._answers += 1
        bad, whole = answer.bad, sum(answer.seconds.values())
        for job, found in answer.found.items():
            numbers = found if isinstance(found, bytes) else self._checked(job, found)
            self._receive(Computed(job, numbers, answer.seconds[job], whole, bad))
            bad = ()

    def _died(self, batch: Batch) -> SweepError:
        """The fault that workers died again and again of some blocks."""
        cells = ", ".join("{} to {}".format(*self._blocks.cells(job)) for job in batch)
        return SweepError(
            f"cells {cells}: every worker that took them died; the logs of the workers may tell why, too little memory "
            "is most common; what is finished is kept; isolated, a cell of which its process dies is found and FAILED"
        )

    def _look_for_workers(self) -> None:
        threads, self._threads = self._threads, self._cluster.threads
        if threads not in (None, self._threads):
            log(f"the cluster has {self._threads} threads, {threads} before", "workers", threads=self._threads)
        if not self._threads and threads != 0:
            self._note("the cluster has no workers left; waiting for new ones")

    def _mask(self, job: int) -> bytes | None:
        """Of a block that is known in part: which of its cells are not, a bit each."""
        reused = self._reused
        return None if reused is None else np.packbits(reused.missing(*self._blocks.bounds(job))).tobytes()

    def _is_reused(self, job: int) -> bool:
        """Whether nothing of a block has to be computed; then it is received at once."""
        bounds = self._blocks.bounds(job)
        if self._reused is None or self._reused.missing(*bounds).any():
            return False
        arrays = self._blocks.empty(bounds[1] - bounds[0])
        self._reused.fill(*bounds, arrays)
        self._receive(Computed(job, arrays, 0.0))
        return True

    def _checked(self, job: int, sent: Sent) -> Mapping[str, Any]:
        """The numbers of a block, the reused ones filled in. Raises SweepError where they are not what was sent."""
        start, stop = self._blocks.bounds(job)
        columns, arrays = self._blocks.columns, {**sent.arrays}
        fits = all(
            arrays[c.name].shape == (stop - start, *c.shape) and arrays[c.name].dtype == c.dtype for c in columns
        )
        if not fits or digest(columns, arrays) != sent.digest:
            raise SweepError(f"{self._blocks.label(job)}: damaged on their way from the worker")
        if self._reused is not None:
            arrays = {name: column if column.flags.writeable else column.copy() for name, column in arrays.items()}
            self._reused.fill(start, stop, arrays)
        return arrays
