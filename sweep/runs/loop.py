"""The loop of a run: numbers of blocks go to an executor of concurrent.futures, threads here or dask's, and come back.

A thread computes a block on a `Bench` and puts it into a sink: the arrays of a run in memory, or the file. Only a
worker that does not see the file sends numbers, which the loop puts there.
"""

from __future__ import annotations

import contextlib
import os
import platform
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from datetime import datetime
from typing import TYPE_CHECKING, Any, Protocol

from sweep.cells.block import Blocks, cut, sampled_by, sampled_study
from sweep.cells.compiling import Compiling
from sweep.cells.partition import Partition
from sweep.cells.timing import UNSAMPLED, Sample
from sweep.errors import SweepError
from sweep.file.store import Shared
from sweep.runs.bench import POISONED, Bench, Found, Masks
from sweep.runs.extend import Precomputed, Reused
from sweep.runs.isolate import Processes, kernel_paths
from sweep.runs.log import log
from sweep.runs.pool import CtrlC, TimeUp, endless, passed
from sweep.runs.progress import Progress, from_everywhere
from sweep.runs.task import Task, now

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
"""Times that a block is tried again whose answer got lost."""
MOST_TOLD = 1000
"""Cells that FAILED which are told one by one."""


class Sink(Protocol):
    """Where blocks go: `room` gives the columns to fill, if it has any; `put` takes a block, in any thread."""

    @property
    def room(self) -> Callable[[int], Mapping[str, Any]] | None: ...
    def put(self, job: int, found: Found) -> None: ...
    def tick(self) -> None: ...


class Loop:
    """Times a sample of the grid, where it is to be `sampled`, and cuts it into blocks; then computes them.

    The workers of a `cluster` do so, or threads here. How the rows are cut may be settled already (`partition`), and
    some cells may be known (`reused`). `ctrl_c` is asked now and then.
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
        self.task, self._ctrl_c, self._cluster, self._reused, study = task, ctrl_c, cluster, reused, task.study
        self.began, self._failed = now(), 0
        self._processes = Processes(study, task.limit, task.cores) if task.isolate else None
        self._threads = ThreadPoolExecutor(task.cores)
        sample = self._sample() if sampled else UNSAMPLED
        self.blocks = Blocks(study, partition) if partition else cut(study, self._cores, sample, task.block_cells)
        self._weights = sample.weights(self.blocks.partition, self.blocks.rows.first)
        self.progress = self.begin([])

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

    @property
    def _cores(self) -> int:
        """How many blocks are computed at a time."""
        return self.task.cores if self._cluster is None else max(1, self._cluster.threads)

    def begin(self, jobs: Sequence[int]) -> Progress:
        """Where the run stands when the blocks `jobs` are still to do."""
        left, work = sum(map(self._cells, jobs)), float(self._weights[list(jobs)].sum())
        size = self.blocks.rows.size
        self.progress = Progress(size, self.task.progress, self.task.name, size - left, work)
        return self.progress

    def _cells(self, job: int) -> int:
        """How many cells a block has."""
        start, stop = self.blocks.cells(job)
        return stop - start

    def again(self, job: int) -> None:
        """A block is damaged on the disk, and has to be computed once more."""
        self.progress.again(self._cells(job), self._weights[job])
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
        cluster, processes = self._cluster, self._processes
        bench = Bench(self.task.study, self.blocks, sink.put, sink.room, processes)
        if cluster is not None:
            study, seen = self.task.study, shared if self._reused is None else None
            isolated = None if processes is None else (processes.limit, processes.cost)
            words = study.to_json(), dict(self.task.fingerprint), self.blocks.partition, seen
            cluster.begin(*words, kernel_paths(study), isolated)
        queue, lost = deque(from_everywhere(jobs)), Counter[int]()
        most = max(1, TASK_BYTES // max(1, self.blocks.partition.cells * self.blocks.row_bytes))
        under_way: dict[Future[Any], Masks] = {}

        def begin(jobs: Iterable[int]) -> None:
            """Submits blocks; those of which all cells are known are put together here."""
            known = self._reused
            masks = {job: None if known is None else known.missing(*self.blocks.bounds(job)) for job in jobs}
            if cluster is None or all(mask is not None and not mask.any() for mask in masks.values()):
                under_way[self._threads.submit(bench.blocks, masks)] = masks
            else:
                under_way[cluster.submit(masks)] = masks

        try:
            while queue or under_way:
                self._ctrl_c.check()
                self.check_time()
                while queue and len(under_way) < 2 + 3 * self._cores:
                    # short blocks go to a worker elsewhere several at a time, and one by one in the end
                    known = 0.0 if cluster is None else self.progress.block_seconds
                    count = min(TASK_SECONDS / known, most, len(queue) / (2 * self._cores)) if known else 1
                    begin([queue.popleft() for _ in range(max(1, int(count)))])
                for future in wait(under_way, TICK, FIRST_COMPLETED).done:
                    masks = under_way.pop(future)
                    if not self._take(future, masks, sink):
                        for job in masks:
                            lost[job] += 1
                            if lost[job] > MOST_LOST:
                                raise SweepError(f"{self.blocks.label(job)}: {POISONED}")
                            begin([job])
                if cluster is not None:
                    cluster.look()
                self.progress.crew = self._cores
                self.progress.tick()
                sink.tick()
        except BaseException:
            self._stop(under_way)
            for future, masks in under_way.items():
                with contextlib.suppress(Exception, CancelledError):
                    if future.done():
                        self._take(future, masks, sink)
            raise

    def _take(self, future: Future[Any], jobs: Iterable[int], sink: Sink) -> bool:
        """Has what a worker sent put into the sink, and tells of cells that FAILED; of too many only how many they are.

        False where the answer got lost. Raises what went wrong.
        """
        labels = ", ".join(map(self.blocks.label, jobs))
        found = future.result() if self._cluster is None else self._cluster.outcome(future, labels)
        for done in found or ():
            if done.found is not None:
                sink.put(done.block, done.found)
            for cell in done.bad:
                self._failed += 1
                if self._failed <= MOST_TOLD:
                    log(str(cell), "failed", cell=cell.cell, values=dict(cell.values), reason=cell.reason)
                    self.progress.tell(str(cell))
                elif self._failed == MOST_TOLD + 1:
                    self.progress.note("more cells FAILED; from here on they are counted only")
            self.progress.add(self._cells(done.block), self._weights[done.block], done.seconds)
        return found is not None

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

    def log_begin(self) -> None:
        """The first line of a run in its log: what is computed, where, by which versions."""
        task, done, total, machine = self.task, self.progress.done, self.progress.total, platform.uname()
        versions = task.schema().attrs.get("versions", "")
        log(
            f"begins: {task.name}, kernel {task.study.kernel_name}, {done:,} of {total:,} cells done before, "
            f"{self.blocks.count:,} blocks, {task.cores} cores, process {os.getpid()} on {machine.node} "
            f"({machine.system} {machine.machine}), {versions}",
            "begin", kernel=task.study.kernel_name, cells=done, of=total, cores=task.cores, process=os.getpid(),
            machine=machine.node, versions=versions,
        )  # fmt: skip
