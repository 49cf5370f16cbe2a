"""The loop of a run: blocks go to an executor of concurrent.futures, threads here or dask's, and into a sink.

A sink says where the columns of a block lie (`room`) and takes those that are computed (`put`), numbers or digests.
"""

from __future__ import annotations

import contextlib
import math
import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from sweep.cells.block import Blocks, faults_reported, row_shape, sampled_by, sampled_study
from sweep.cells.compiling import Compiling
from sweep.cells.output_schema import output_schema, part_columns
from sweep.cells.partition import Partition, boxes, row_blocks
from sweep.cells.schema import Schema
from sweep.cells.timing import UNSAMPLED, Sample, row_partition
from sweep.errors import SweepError
from sweep.file.store import Shared
from sweep.runs.bench import POISONED, Bench, Done, Found
from sweep.runs.extend import Precomputed, Reused
from sweep.runs.isolate import Processes, kernel_paths
from sweep.runs.log import log
from sweep.runs.pool import CtrlC, TimeUp, endless, passed
from sweep.runs.progress import Forecast, Progress, from_everywhere
from sweep.runs.task import Task

if TYPE_CHECKING:
    from sweep.runs.cluster import Cluster

TICK = 0.2
"""Seconds after which progress is told even if nothing has finished."""
GRACE_SECONDS, KILL_SECONDS = 1.3, 0.3
"""What blocks at work have to end in when a run stops; and then, when the processes are killed that solve cells."""
SAMPLE_SECONDS = 1.0
"""What the timed sample may take although the time is up: it gives blocks a size by which the run is continued."""
TASK_SECONDS, TASK_BYTES = 0.5, 32 << 20
"""Blocks of a cluster that are shorter, and together no larger, go to a worker several at a time."""
MOST_LOST = 3
"""Times that blocks are tried again whose answer got lost."""
MOST_TOLD = 1000
"""Cells that FAILED which are told one by one."""

Batch = tuple[int, ...]


class Sink(Protocol):
    """Where blocks go; called in any thread, `tick` now and then."""

    def room(self, job: int) -> Mapping[str, Any]: ...
    def put(self, job: int, found: Found) -> None: ...
    def tick(self) -> None: ...


class Loop:
    """Times a sample of the grid and cuts it into blocks; then computes them.

    Parameters
    ----------
    task : Task
        What is asked for.
    ctrl_c : CtrlC
        Asked now and then.
    cluster : Cluster, optional
        Whose workers are to compute; None: threads here.
    partition : Partition, optional
        How the rows are cut, where that is settled already.
    sampled : bool
        False where nothing is left to compute.
    reused : Reused, optional
        Cells that need not be computed.
    """

    def __init__(
        self,
        task: Task,
        ctrl_c: CtrlC,
        cluster: Cluster | None = None,
        partition: Partition | None = None,
        sampled: bool = True,
        reused: Reused | Precomputed | None = None,
    ) -> None:
        study = task.study
        self.task, self._ctrl_c, self._cluster, self._reused = task, ctrl_c, cluster, reused
        self.began, schema = now(), output_schema(study, task.fingerprint)
        self.schema: Schema = replace(schema, attrs={**schema.attrs, **(reused.attrs if reused else {})})
        self._processes = Processes(study, task.limit, task.cores) if task.isolate else None
        self._threads = ThreadPoolExecutor(task.cores)
        sample = self._sample() if sampled else UNSAMPLED
        self.blocks = Blocks(study, partition or self._cut(sample))
        self._weights = sample.weights(self.blocks.partition, self.blocks.rows.first)
        self._failed = 0
        self.begin([])

    def _sample(self) -> Sample:
        """The sample, taken in a thread, so that Ctrl-C and the time to stop are seen while a kernel is compiled."""
        study, processes = self.task.study, self._processes

        def take() -> Sample:
            if processes is None:
                return sampled_study(study, Compiling(study.kernel, study.kernel_name, self.task.note))
            solver = processes.solver()
            found = sampled_by(solver, study, solver.clock)
            processes.idle.append(solver)
            processes.cost = float(found.costs.max())
            return found

        begun, sample = time.monotonic(), self._threads.submit(take)
        try:
            while not wait([sample], TICK).done:
                self._ctrl_c.check()
                if time.monotonic() - begun > SAMPLE_SECONDS:
                    self.check_time()
            return sample.result()
        except BaseException:
            self._stop([sample])
            raise

    def _cut(self, sample: Sample) -> Partition:
        study, cells = self.task.study, self.task.block_cells
        if cells is None:
            rows, columns = row_blocks(study), part_columns(study)
            row_bytes = sum(column.cell_bytes for column in columns)
            return row_partition(sample, rows, row_shape(study), row_bytes, self._cores)
        return boxes(row_shape(study), math.ceil(cells / row_blocks(study).mean))

    @property
    def _cores(self) -> int:
        """How many blocks are computed at a time."""
        return self.task.cores if self._cluster is None else max(1, self._cluster.threads)

    def begin(self, jobs: Sequence[int]) -> Progress:
        """Where the run stands when the blocks `jobs` are still to do."""
        rows = self.blocks.rows.size
        left = sum(stop - start for start, stop in map(self.blocks.cells, jobs))
        self._forecast = Forecast(self._weights, jobs, self._cores)
        self.progress = Progress(rows, self.task.stream, self.task.name, rows - left, self._forecast)
        return self.progress

    def again(self, job: int) -> None:
        """A block is damaged on the disk, and has to be computed once more."""
        start, stop = self.blocks.cells(job)
        self._forecast.again(job)
        self.progress.add(start - stop)
        self.progress.note(f"{self.blocks.label(job)} were damaged on the disk and are computed again")

    def endings(self) -> dict[str, str]:
        """What a result says of its run that is known at the end."""
        end = now()
        return {"created": end, "end": end, "cells_per_second": f"{self.progress.rate:.6e}"}

    def compute(self, jobs: Sequence[int], sink: Sink, shared: Shared | None = None) -> None:
        """Computes blocks into a sink; workers that see the file `shared` write them there.

        After a fault, Ctrl-C or SIGTERM no block is begun, and those at work are put into the sink if they end.
        Raises SweepError, TimeUp, KeyboardInterrupt, Terminated.
        """
        self._sink, self._answers = sink, 0
        self._computing: dict[Future[Any], Batch] = {}
        self._keeping: dict[Future[None], int] = {}
        self._lost: dict[Batch, int] = {}
        self._submit = self._submitting(shared)
        self._keepers = ThreadPoolExecutor(max(2, self.task.cores))
        try:
            self.check_time()
            for batch in self._batches(from_everywhere(jobs)):
                self._begin_task(batch)
                # many blocks are under way at a time, for some wait for the disk
                while len(self._computing) + len(self._keeping) >= 2 + 3 * self._cores:
                    self._settle()
            while self._computing or self._keeping:
                self._settle()
        except BaseException:
            self._stop(self._computing)
            for future, batch in self._computing.items():
                with contextlib.suppress(Exception, CancelledError):
                    for done in (future.done() and self._found(future, batch)) or ():
                        self._keep(done)
            raise
        finally:
            self._keepers.shutdown()

    def _submitting(self, shared: Shared | None) -> Callable[[Batch, Mapping[int, Any]], Future[Any]]:
        """Has blocks computed, of those with a mask only some cells: by an executor of threads here, or dask's."""
        study, processes = self.task.study, self._processes
        if self._cluster is None:
            bench = Bench(study, self.blocks, self._sink.room, processes=processes)
            return lambda batch, masks: self._threads.submit(lambda: [bench.block(j, masks.get(j)) for j in batch])
        isolated = None if processes is None else (processes.limit, processes.cost)
        seen, partition = shared if self._reused is None else None, self.blocks.partition
        words = study.to_json(), dict(self.task.fingerprint), partition, seen, kernel_paths(study), isolated
        return partial(self._cluster.submit, self._cluster.remote(*words))

    def _batches(self, jobs: Sequence[int]) -> Iterator[Batch]:
        """One block each here; on a cluster as many as take half a second, fewer at the beginning and at the end."""
        most, at = max(1, TASK_BYTES // max(1, self.blocks.partition.cells * self.blocks.row_bytes)), 0
        while at < len(jobs):
            longest = 1
            if self._cluster is not None:
                share = (len(jobs) - at) // (2 * max(1, self._cluster.threads))
                longest = max(1, min(1 + self._answers, share, most))
            seconds = np.cumsum(self._weights[jobs[at : at + longest]])
            count = 1 + int(np.searchsorted(seconds[:-1], TASK_SECONDS))
            yield tuple(jobs[at : at + count])
            at += count

    def _begin_task(self, batch: Batch) -> None:
        """Submits blocks; one of which all cells are known goes into the sink at once."""
        masks: dict[int, Any] = {}
        if self._reused is not None:
            masks = {job: self._reused.missing(*self.blocks.bounds(job)) for job in batch}
            for job in [job for job in batch if not masks[job].any()]:
                self._keep(Done(job, self._sink.room(job)))
            batch = tuple(job for job in batch if masks[job].any())
        if batch:
            self._computing[self._submit(batch, masks)] = batch

    def _settle(self) -> None:
        """Waits for something to end, or a moment; puts what is computed into the sink. Raises what went wrong."""
        cluster = self._cluster
        for batch in islice(self._computing.values(), self._cores):
            self._forecast.begin(batch)
        for future in wait([*self._computing, *self._keeping], TICK, FIRST_COMPLETED).done:
            if future in self._keeping:
                start, stop = self.blocks.cells(job := self._keeping.pop(future))
                future.result()
                self._forecast.end(job)
                self.progress.add(stop - start)
                continue
            batch = self._computing.pop(future)
            found = self._found(future, batch)
            if found is None:
                self._lost[batch] = self._lost.get(batch, 0) + 1
                if self._lost[batch] > MOST_LOST:
                    raise SweepError(f"{self._labels(batch)}: {POISONED}")
                self._begin_task(batch)
                continue
            self._answers += 1
            for done in found:
                self._keep(done)
        if cluster is not None:
            cluster.look()
        self._sink.tick()
        self.progress.tick()
        self._ctrl_c.check()
        self.check_time()

    def _found(self, future: Future[Any], batch: Batch) -> list[Done] | None:
        """What a task gave; None where its answer got lost. Raises what went wrong."""
        if self._cluster is not None:
            return self._cluster.outcome(future, self._labels(batch))
        found: list[Done] = future.result()
        return found

    def _keep(self, done: Done) -> None:
        """Has a block put into the sink, and tells of its cells that FAILED; of too many only how many they are."""
        for cell in done.bad:
            self._failed += 1
            if self._failed <= MOST_TOLD:
                log(str(cell), "failed", cell=cell.cell, values=dict(cell.values), reason=cell.reason)
                self.progress.tell(str(cell))
            elif self._failed == MOST_TOLD + 1:
                self.progress.note("more cells FAILED; from here on they are counted only")
        self._keeping[self._keepers.submit(self._put, done)] = done.block

    def _put(self, done: Done) -> None:
        """Puts a block into the sink, with the cells that are known. Raises SweepError."""
        found = done.found
        with faults_reported(self.blocks.label(done.block)):
            if self._reused is not None and not isinstance(found, bytes):
                # what came from elsewhere may be read only
                found = {name: column if column.flags.writeable else column.copy() for name, column in found.items()}
                self._reused.fill(*self.blocks.bounds(done.block), found)
            self._sink.put(done.block, found)

    def _stop(self, computing: Iterable[Future[Any]]) -> None:
        """Lets what is computed here end; what takes too long is killed, or given up."""
        if self._cluster is not None:
            self._cluster.cancel()
        self._threads.shutdown(wait=False, cancel_futures=True)
        if wait(computing, GRACE_SECONDS if self._cluster is None else 0.0).not_done and self._processes is not None:
            self._processes.end()
        left = wait(computing, KILL_SECONDS).not_done
        if left and self._cluster is None:
            endless.set()

    def close(self) -> None:
        """Ends the progress line, all threads that can be ended, and all processes."""
        self._threads.shutdown(wait=False)
        if self._processes is not None:
            self._processes.end()
        self.progress.stop()

    def check_time(self) -> None:
        """Raises TimeUp when it is time to stop."""
        if passed(self.task.end):
            raise TimeUp(f"it is {datetime.now():%H:%M}")

    def _labels(self, batch: Batch) -> str:
        """How blocks are called in messages."""
        return ", ".join(map(self.blocks.label, batch))

    def log_begin(self) -> None:
        """The first line of a run in its log: what is computed, where, by which versions."""
        progress, machine, versions = self.progress, platform.uname(), self.schema.attrs.get("versions", "")
        log(
            f"begins: {self.task.name}, kernel {self.task.study.kernel_name}, {progress.done:,} of {progress.total:,} "
            f"cells done before, {self.blocks.count:,} blocks, {self.task.cores} cores, process {os.getpid()} on "
            f"{machine.node} ({machine.system} {machine.machine}), {versions}",
            "begin", kernel=self.task.study.kernel_name, cells=progress.done, of=progress.total,
            cores=self.task.cores, process=os.getpid(), machine=machine.node, versions=versions,
        )  # fmt: skip


def now() -> str:
    """The time as ISO 8601 in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")
