"""One run of a study: its schema, how it is cut into blocks, and the threads here that compute them, or an executor."""

from __future__ import annotations

import contextlib
import math
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.cells.block import (
    Blocks,
    Computed,
    Found,
    block_solver,
    faults_reported,
    row_shape,
    sampled_by,
    sampled_study,
)
from sweep.cells.compiling import Compiling
from sweep.cells.guard import BadCell, Guard
from sweep.cells.output_schema import output_schema, part_columns
from sweep.cells.partition import Partition, boxes, row_blocks
from sweep.cells.schema import Schema
from sweep.cells.solve import Solver
from sweep.cells.timing import UNSAMPLED, Sample, row_partition
from sweep.errors import missing
from sweep.file.store import Shared
from sweep.runs.extend import Precomputed, Reused
from sweep.runs.forecast import Forecast
from sweep.runs.isolate import Processes
from sweep.runs.log import log
from sweep.runs.pool import BufferPool, Stopper, cores, each
from sweep.runs.progress import Progress, TimeUp, passed
from sweep.runs.task import Task

if TYPE_CHECKING:
    from sweep.runs.cluster import Cluster

MOST_TOLD = 1000
"""Cells that FAILED which are told one by one."""

READING = 0.05
"""What a cell that is known takes, of what computing it takes; only a guess, until blocks are measured."""
SAMPLE_SECONDS = 1.0
"""What the timed sample may take although the time is up."""

Solve = Callable[[int, int, Mapping[str, Any]], bool]
"""Computes the rows start .. stop into columns of that length; False where the run is being stopped."""


class Session:
    """Compiles the kernel, times a sample of the grid, and cuts it.

    Parameters
    ----------
    task : what is asked for
    cluster : whose workers are to compute; None: threads here
    partition : how the rows are cut, where that is settled already
    sampled : False where nothing is left to compute
    reused : cells that need not be computed

    Attributes
    ----------
    tick : callable
        Called now and then, in the thread of `compute`.
    """

    def __init__(
        self,
        task: Task,
        cluster: Cluster | None = None,
        partition: Partition | None = None,
        sampled: bool = True,
        reused: Reused | Precomputed | None = None,
    ) -> None:
        study = task.study
        self.task, self.study, self.reused = task, study, reused
        self.began = now()
        schema = output_schema(study, task.fingerprint)
        self.schema: Schema = replace(schema, attrs={**schema.attrs, **(reused.attrs if reused else {})})
        self.tick: Callable[[], None] = lambda: None
        self.bad: list[BadCell] = []
        self._told = 0
        self.processes = Processes(study, task.limits, task.workers) if task.isolate else None
        self.sample: Sample = self._sampled() if sampled else UNSAMPLED
        if self.processes is not None:
            self.processes.limits = replace(task.limits, cost=float(self.sample.costs.max()))
        threads = task.workers if cluster is None else cluster.threads or task.workers
        self.blocks = Blocks(study, partition or self._partition(threads))
        self.begin([])

    def _sampled(self) -> Sample:
        """The sample, taken in a thread, so that Ctrl-C and the time to stop are seen while a kernel is compiled."""
        found: list[Sample] = []

        def work(job: int) -> None:
            if self.processes is None:
                compiling = Compiling(self.study.kernel, self.study.kernel_name, self.task.note)
                found.append(sampled_study(self.study, compiling))
            else:
                solver = self.processes.solver()
                found.append(sampled_by(solver, self.study, solver.clock))

        begun = time.monotonic()

        def tick(job: int | None) -> None:
            # most samples take less, and give blocks a size by which the run is continued
            if time.monotonic() - begun > SAMPLE_SECONDS:
                self.check_time()

        try:
            each([0], work, 1, tick, self._stopper())
        except BaseException:
            self.close()
            raise
        return found[0]

    def close(self) -> None:
        """Ends the progress line, and all processes."""
        if self.processes is not None:
            self.processes.end()
        if hasattr(self, "progress"):
            self.progress.stop()

    def _stopper(self) -> Stopper:
        return Stopper(self.task.workers, (lambda: None) if self.processes is None else self.processes.end)

    def _partition(self, threads: int) -> Partition:
        rows, cells = row_blocks(self.study), self.task.block_cells
        if cells is not None:
            return boxes(row_shape(self.study), math.ceil(cells / rows.mean))
        row_bytes = sum(column.cell_bytes for column in part_columns(self.study))
        return row_partition(self.sample, rows, row_shape(self.study), row_bytes, threads)

    def begin(self, jobs: Sequence[int]) -> Progress:
        """Where the run stands when the blocks `jobs` are still to do; they are what is computed."""
        rows = self.blocks.rows
        left = sum(stop - start for start, stop in map(self.blocks.cells, jobs))
        self.forecast = Forecast(self._weights(), jobs)
        self.progress = Progress(rows.size, self.task.stream, self.task.name, rows.size - left, self.forecast)
        return self.progress

    def _weights(self) -> Any:
        """Seconds that every block may take; known cells are little but read."""
        partition, rows = self.blocks.partition, self.blocks.rows
        weights = self.sample.weights(partition, rows.first)
        if self.reused is None:
            return weights
        edges = rows.first(partition.edges)
        known = np.diff(self.reused.known_before(edges)) / np.diff(edges)
        return weights * (1 - (1 - READING) * known)

    def again(self, job: int) -> None:
        """A block has to be computed once more."""
        start, stop = self.blocks.cells(job)
        self.forecast.again(job)
        self.progress.again(stop - start)

    def dated(self, began: str) -> Schema:
        """The schema with the times of the run, which now is at its end."""
        return replace(self.schema, attrs={**self.schema.attrs, "start": began, **self.endings()})

    def endings(self) -> dict[str, str]:
        """What a result says of its run that is known at the end."""
        end = now()
        return {"created": end, "end": end, "cells_per_second": f"{self.progress.rate:.6e}"}

    def compute(self, work: Callable[[int, Solve], None]) -> None:
        """Calls `work(job, solve)` for every block that is left, on a pool of threads.

        No more than `workers` threads are inside `solve` at a time; as many wait for the disk, or for their turn.
        Raises SweepError where `work` fails, TimeUp.
        """
        workers = self.task.workers
        threads = 2 * max(workers, cores())
        self.check_time()
        stopper = self._stopper()
        solvers = BufferPool(self._solver)

        def compute(start: int, stop: int, arrays: Mapping[str, Any]) -> bool:
            def inside() -> None:
                with solvers.borrow() as solve:
                    solve(start, stop, arrays)

            return stopper.compute(inside)

        def guarded(job: int) -> None:
            with faults_reported(f"{self.blocks.label(job)}: the kernel failed"):
                work(job, compute)
            self.forecast.end(job)

        each(self.forecast.order(), guarded, threads, self._count, stopper, 2 * workers)

    def compute_elsewhere(self, cluster: Cluster, shared: Shared | None, receive: Callable[[int, Found], None]) -> None:
        """The same by the workers of a cluster, which write to the file `shared` where they see it.

        Calls `receive` with every block and its digests, where it is written already, or its numbers.
        """
        from sweep.runs.dispatch import Dispatch

        self.check_time()
        limits = None if self.processes is None else self.processes.limits
        dispatch = Dispatch(cluster, self.task, self.blocks, self.forecast, self.reused, shared, limits)

        def take(done: Computed | None) -> None:
            if done is not None:
                receive(done.block, done.found)
                self.bad.extend(done.bad)
                self.forecast.end(done.block, done.seconds, done.ago)
            self._count(None if done is None else done.block)

        dispatch.compute(self.forecast.order(), take)

    def _count(self, job: int | None) -> None:
        """Counts a block that is done. Raises TimeUp."""
        self._tell_failed()
        if job is None:
            self.tick()
            self.progress.tick()
        else:
            start, stop = self.blocks.cells(job)
            self.progress.add(stop - start)
        self.check_time()

    def check_time(self) -> None:
        """Raises TimeUp when it is time to stop."""
        if passed(self.task.until):
            raise TimeUp(f"it is {datetime.now():%H:%M}")

    def _solver(self) -> Callable[[int, int, Mapping[str, Any]], None]:
        """Computes the rows start .. stop, for one thread at a time."""
        cells = Solver(self.study) if self.processes is None else self.processes.solver()
        compute, reused = block_solver(self.study, Guard(cells, self.bad.append)), self.reused

        def solve(start: int, stop: int, arrays: Mapping[str, Any]) -> None:
            self.forecast.begin(self.blocks.partition.index(start))
            compute(start, stop, arrays, None if reused is None else reused.missing(start, stop))
            if reused is not None:
                reused.fill(start, stop, arrays)

        return solve

    def _tell_failed(self) -> None:
        """Tells of the cells that FAILED since it was called last; of too many only how many they are."""
        while self._told < len(self.bad):
            cell, self._told = self.bad[self._told], self._told + 1
            if self._told <= MOST_TOLD:
                log(str(cell), "failed", cell=cell.cell, values=dict(cell.values), reason=cell.reason)
                self.progress.tell(str(cell))
            elif self._told == MOST_TOLD + 1:
                self.progress.note("more cells FAILED; from here on they are counted only")

    def log_begin(self) -> None:
        """The first line of a run in its log: what is computed, where, by which versions."""
        progress, machine, versions = self.progress, platform.uname(), self.schema.attrs.get("versions", "")
        log(
            f"begins: {self.task.name}, kernel {self.study.kernel_name}, {progress.done:,} of {progress.total:,} cells "
            f"done before, {self.blocks.count:,} blocks, {self.task.workers} cores, process {os.getpid()} on "
            f"{machine.node} ({machine.system} {machine.machine}), {versions}",
            "begin", kernel=self.study.kernel_name, cells=progress.done, of=progress.total, cores=self.task.workers,
            process=os.getpid(), machine=machine.node, versions=versions,
        )  # fmt: skip


@contextlib.contextmanager
def joined(task: Task) -> Iterator[Cluster | None]:
    """The cluster of a task, once it has a worker; None where none is asked for. Raises SweepError."""
    if task.cluster is None:
        yield None
        return
    try:
        from sweep.runs.cluster import Cluster
    except ImportError:
        raise missing("a cluster needs distributed", "cluster") from None
    with Cluster(task.cluster) as cluster:
        cluster.wait(task.note, task.until)
        yield cluster


def now() -> str:
    """The time as ISO 8601 in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")
