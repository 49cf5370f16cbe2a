"""The loop of a run: submits block numbers to an executor, that is threads here or the workers of a cluster.

A block is computed on a `Bench`, which stores it in the arrays of a run in memory, or in the file. The loop stores the
blocks of workers that do not see the file.
"""

from __future__ import annotations

import contextlib
import os
import platform
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from datetime import datetime, timedelta
from datetime import time as day_time
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from sweep.cells.block import Bench, Done, Found
from sweep.cells.fingerprint import fingerprint
from sweep.cells.partition import Partition
from sweep.cells.reduce import output_schema
from sweep.cells.schema import Schema
from sweep.cells.timing import GOLDEN, Sample, cut, sampled_study, work_clock
from sweep.errors import SweepError, missing, signals_held
from sweep.file import disk
from sweep.runs.extend import Reused
from sweep.runs.isolate import Processes
from sweep.runs.progress import Progress, log
from sweep.study.model import Study
from sweep.words import as_path, flag, function, kind, seconds_of, whole_number

if TYPE_CHECKING:
    from sweep.runs.cluster import Cluster

TICK = 0.2
"""Seconds after which progress is reported even if nothing has finished."""
SILENT_SECONDS = 1.0
"""Compilations shorter than this are not reported."""
MOST_TOLD = 1000
"""FAILED cells that are reported individually."""


class TimeUp(Exception):
    """A run is to end before it is complete; the text says why."""


endless = threading.Event()
"""Set when a thread with an endless kernel was abandoned: Python would wait for it at exit."""


@dataclass
class Task:
    """What a run was asked for, as `run` was, and what is meant by it. Raises SweepError where it cannot be meant.

    A run to a file writes to `output`, all links followed; `cores`, `end` and `limit` are what `workers`, `until` and
    `cell_timeout` mean; the `fingerprint` is that of the study and of this program. `note` says something at once, by
    default where the progress is told.
    """

    study: Study
    path: str | os.PathLike[str] | None = None
    workers: int | None = None
    force: bool = False
    progress: bool | TextIO | None = None
    block_cells: int | None = None
    extend: bool = False
    until: str | datetime | None = None
    cluster: Any = None
    repair: bool = False
    isolate: bool = False
    cell_timeout: float | str | None = None
    retry_failed: bool = False
    note: Any = None

    def __post_init__(self) -> None:
        for name in ("force", "extend", "repair", "isolate", "retry_failed"):
            flag(name, getattr(self, name))
        self.fingerprint = fingerprint(self.study)
        self.output = Path(os.path.realpath(as_path("." if self.path is None else self.path)))
        with disk.refusing(self.output):
            if not self.output.parent.is_dir():
                raise SweepError(f"{self.path}: there is no folder {self.output.parent}")
            if self.path is not None and self.output.is_dir():
                raise SweepError(f"{self.path} is a folder; name a file in it")
        if not (self.progress is None or isinstance(self.progress, bool) or hasattr(self.progress, "write")):
            raise SweepError(f"progress: expected True, False or a stream to print to, found {kind(self.progress)}")
        self.cores = cores() if self.workers is None else whole_number("workers", self.workers)
        if self.block_cells is not None:
            whole_number("block_cells", self.block_cells)
        self.end = deadline(self.until)
        self.limit = None if self.cell_timeout is None else seconds_of("cell_timeout", self.cell_timeout)
        self.isolate = self.isolate or self.limit is not None
        if self.cluster is not None and self.workers is not None:
            raise SweepError("workers, cluster: a cluster brings its own workers; give one of the two")
        if self.path is None and self.until is not None:
            raise SweepError("until: give a path as well, or what is computed by then would be lost")
        if self.extend and self.retry_failed:
            raise SweepError("extend, retry_failed: give one of the two; each continues another result")
        self.note = Progress(1, self.progress, self.name).note if self.note is None else function("note", self.note)

    @property
    def name(self) -> str:
        """What the run is called in its messages."""
        return self.study.title or "sweep" if self.path is None else self.output.name

    @cached_property
    def schema(self) -> Schema:
        """What its result holds."""
        return output_schema(self.study, self.fingerprint)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def deadline(text: str | datetime | None, now: datetime | None = None) -> datetime | None:
    """The time that is meant, with a time zone: "07:00" is the next time it is seven, here. Raises SweepError."""
    if text is None:
        return None
    here = (now or datetime.now()).astimezone()
    try:
        clock = day_time.fromisoformat(str(text).strip())
    except ValueError:
        try:
            return datetime.fromisoformat(str(text).strip()).astimezone()
        except ValueError:
            raise SweepError(f'until: expected a time like "07:00" or "2027-01-31 07:00", found {text!r}') from None
    if clock.tzinfo is not None:
        here = here.astimezone(clock.tzinfo)
    days = (here.date(), here.date() + timedelta(days=1))  # by their dates, for days of 23 and 25 hours
    today, tomorrow = (datetime.combine(day, clock).astimezone() for day in days)
    return today if today > here else tomorrow


def passed(until: datetime | None) -> bool:
    """Whether it is time to stop."""
    return until is not None and datetime.now().astimezone() >= until


def from_everywhere(jobs: Iterable[int]) -> list[int]:
    """Numbers of blocks in an order in which those of any beginning come from all over the grid."""
    found = np.array(list(jobs), int)
    return list(map(int, found[np.argsort(np.arange(found.size) * GOLDEN % 1.0)]))


class Loop:
    """Times a sample of the grid, and cuts it into blocks; then computes them.

    The workers of the task's cluster do so, or threads here. How the rows are cut may be settled already (`partition`),
    and some cells may be known (`reused`). Until `stack` ends, Ctrl-C and SIGTERM are held back, if they are to be
    (`hold`): a plan keeps nothing, and need not.
    """

    def __init__(
        self,
        task: Task,
        stack: contextlib.ExitStack,
        partition: Partition | None = None,
        reused: Reused | None = None,
        hold: bool = True,
    ) -> None:
        self.task, self._reused, study = task, reused, task.study
        self._failed, self.progress = 0, Progress(1, False)
        self._check_signals = stack.enter_context(signals_held()) if hold else lambda: None
        self._cluster: Cluster | None = None
        if task.cluster is not None:
            try:
                from sweep.runs.cluster import Cluster
            except ImportError:
                raise missing("a cluster needs distributed", "cluster") from None
            self._cluster = stack.enter_context(Cluster(task.cluster, task.note))
        stack.callback(lambda: self.progress.stop())
        self.processes = Processes(study, task.limit) if task.isolate else None
        if self.processes is not None:
            stack.callback(self.processes.end)
        self._threads = ThreadPoolExecutor(task.cores)
        stack.callback(self._threads.shutdown, wait=False)
        self.sample = self._sample()
        # a block of a cluster takes so long that the scheduler's millisecond is nothing
        least = 0.0 if self._cluster is None else 0.5
        cells = partition or cut(study, self._crew, self.sample, task.block_cells, least)
        self.bench = Bench(study, cells, self.processes)
        self._weights = self.sample.weights(self.bench.partition, self.bench.rows.first)
        ends = self.bench.rows.first(cells.first(np.arange(cells.count + 1)))
        self._cells = np.diff(ends).tolist()

    def _sample(self) -> Sample:
        """The sample, taken in a thread, so that Ctrl-C and the time to stop are seen while a kernel is compiled.

        That is said. The sample gives blocks a size by which the run is continued, so it has a second in any case.
        """
        study, apart, said = self.task.study, self.processes, False
        sample = self._threads.submit(lambda: sampled_study(study) if apart is None else apart.sampled())
        try:
            wait([sample], SILENT_SECONDS)
            while not sample.done():
                self._check()
                if not said and (work_clock.flag.value if apart is None else apart.compiles()):
                    self.task.note(f"compiling {study.kernel_name} ...")
                    said = True
                wait([sample], TICK)
            return sample.result()
        except BaseException:
            self._stop([sample])
            raise

    @property
    def _crew(self) -> int:
        """How many blocks are computed at a time."""
        return self.task.cores if self._cluster is None else max(1, self._cluster.threads)

    def compute(
        self,
        jobs: Sequence[int],
        put: Callable[[int, Any], Found],
        room: Callable[[int], Mapping[str, Any] | None] = lambda job: None,
        shared: tuple[Path, bytes] | None = None,
        tick: Callable[[], None] = lambda: None,
    ) -> None:
        """Computes blocks, and tells of the progress.

        `put` and `room` are as of `Bench.compute`; workers that see the file `shared` write there; `tick` is called
        often.
        After a fault, Ctrl-C or SIGTERM no block is begun, and those at work are kept if they end.
        Raises SweepError, TimeUp, KeyboardInterrupt, Terminated.
        """
        task, cluster, known, bench = self.task, self._cluster, self._reused, self.bench
        total, machine, versions = bench.rows.size, platform.uname(), task.schema.attrs["versions"]
        done = total - sum(self._cells[job] for job in jobs)
        self.progress = Progress(total, task.progress, task.name, done, float(self._weights[list(jobs)].sum()))
        log(
            f"begins: {task.name}, kernel {bench.study.kernel_name}, {done:,} of {total:,} cells done before, "
            f"{bench.partition.count:,} blocks, {task.cores} cores, process {os.getpid()} on {machine.node} "
            f"({machine.system} {machine.machine}), {versions}",
            "begin", kernel=bench.study.kernel_name, cells=done, of=total, cores=task.cores, process=os.getpid(),
            machine=machine.node, versions=versions,
        )  # fmt: skip

        def keep(job: int, found: Any) -> Found:
            return put(job, found if known is None else known.filled(*bench.partition.bounds(job), found))

        if cluster is not None:
            isolated = None if self.processes is None else (self.processes.limit, self.processes.cost)
            words = bench.study.to_json(), dict(task.fingerprint), bench.partition
            cluster.begin(*words, shared if known is None else None, isolated)
        queue, under_way = deque(from_everywhere(jobs)), set[Future[Done]]()
        try:
            while queue or under_way:
                self._check()
                while queue and len(under_way) < 2 + 3 * self._crew:
                    job = queue.popleft()
                    wanted = None if known is None else known.wanted(*bench.partition.bounds(job))
                    # a block of which all cells are known is put together here
                    if cluster is None or (wanted is not None and not wanted.any()):
                        under_way.add(self._threads.submit(bench.compute, job, keep, wanted, room(job)))
                    else:
                        under_way.add(cluster.submit(job, wanted, bench.label(job)))
                for future in wait(under_way, TICK, FIRST_COMPLETED).done:
                    under_way.remove(future)
                    self._take(future.result(), keep)
                if cluster is not None:
                    cluster.look()
                self.progress.crew = self._crew
                self.progress.tick()
                tick()
        except BaseException:
            self._stop(under_way)
            for future in under_way:
                with contextlib.suppress(Exception, CancelledError):
                    self._take(future.result(0.0), keep)
            raise

    def _take(self, done: Done, keep: Callable[[int, Any], Found]) -> None:
        """Keeps what a worker sent, and tells of cells that FAILED; of too many only how many."""
        if done.found is not None:
            keep(done.block, done.found)
        for cell in done.bad:
            self._failed += 1
            if self._failed <= MOST_TOLD:
                fields = {"cell": cell.cell, "values": dict(cell.values), "reason": cell.reason}
                self.progress.note(str(cell), "failed", **fields)
            elif self._failed == MOST_TOLD + 1:
                self.progress.note("more cells FAILED; further ones are only counted")
        self.progress.add(self._cells[done.block], self._weights[done.block], done.seconds)

    def _stop(self, futures: Iterable[Future[Any]]) -> None:
        """Lets what is computed here end within a second or so; then its process is killed, or its thread given up."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        computing = [future for future in futures if not future.cancel()]
        if wait(computing, 1.3).not_done and self.processes is not None:
            self.processes.end()
        if wait(computing, 0.3).not_done:
            endless.set()

    def _check(self) -> None:
        """Raises KeyboardInterrupt, Terminated or TimeUp where the run is to end."""
        self._check_signals()
        if passed(self.task.end):
            raise TimeUp(f"it is {datetime.now():%H:%M}")
