"""What a worker of a cluster does: it computes blocks as a thread here would.

Where it sees the file of the result it writes them there itself, and tells their digests. Elsewhere it sends the
numbers back, with one digest of them.
"""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xxhash
from distributed import WorkerPlugin

from sweep.cells.block import Blocks, SolveBlock, block_solver, faults_reported, warm
from sweep.cells.fingerprint import difference, fingerprint
from sweep.cells.guard import BadCell, Guard
from sweep.cells.partition import Partition
from sweep.cells.schema import Column
from sweep.cells.solve import Solver
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.store import Shared
from sweep.runs.isolate import Limits, Processes
from sweep.study.model import Study


@dataclass(frozen=True)
class Assignment:
    """All that a worker needs to know of a run; it gets it once.

    Attributes
    ----------
    run : its name
    study : JSON
    fingerprint : fingerprint of the study where the run was started; a worker with another one refuses
    partition : how the rows are cut
    shared : the file that blocks are to be written to; None where their numbers are to be sent
    paths : where to look for the module of a kernel of the user's own; his study was allowed to run it
    limits : what cells may take that are solved in processes of their own; None: they are solved in the worker's
    """

    run: str
    study: str
    fingerprint: Mapping[str, str]
    partition: Partition
    shared: Shared | None
    paths: tuple[str, ...]
    limits: Limits | None = None


@dataclass(frozen=True)
class Sent:
    """The numbers of a block, and their digest."""

    digest: str
    arrays: Mapping[str, Any]


@dataclass(frozen=True)
class Answer:
    """What became of some blocks: each one's seconds, its digests, if it is written, or numbers; cells that FAILED."""

    seconds: Mapping[int, float]
    found: Mapping[int, bytes | Sent]
    bad: Sequence[BadCell]


class Plugin(WorkerPlugin):  # type: ignore[misc]
    """Tells every worker process of a run, also those that come later, and lets it forget the run at the end."""

    def __init__(self, assignment: Assignment) -> None:
        self.assignment = assignment

    def setup(self, worker: Any) -> None:
        """Called in the worker."""
        _assignments[self.assignment.run] = self.assignment

    def teardown(self, worker: Any) -> None:
        """Called in the worker."""
        _assignments.pop(self.assignment.run, None)
        if (context := _contexts.pop(self.assignment.run, None)) is not None:
            context.end()


_assignments: dict[str, Assignment] = {}
_contexts: dict[str, _Context] = {}
_lock = threading.Lock()


def compute(run: str, jobs: Sequence[int], masks: Mapping[int, bytes]) -> Answer:
    """Computes some blocks; of those with a mask, only the cells whose bit is set.

    Raises
    ------
    SweepError
        The run is over, this process has another version of the kernel, the kernel fails, or the disk does.
    """
    context = _context(run)
    found, ends = {}, [time.perf_counter()]
    for job in jobs:
        found[job] = context.block(job, masks.get(job))
        ends.append(time.perf_counter())
    context.sync()
    syncing = (time.perf_counter() - ends[-1]) / len(jobs)
    seconds = {job: end - begun + syncing for job, begun, end in zip(jobs, ends, ends[1:], strict=False)}
    return Answer(seconds, found, context.bad())


def _context(run: str) -> _Context:
    with _lock:
        if run not in _assignments:
            raise SweepError("the run is over")
        if run not in _contexts:
            _contexts[run] = _Context(_assignments[run])
        return _contexts[run]


class _Context:
    """Solvers and buffers of a run, one of each for every thread; compiles the kernel."""

    def __init__(self, assignment: Assignment) -> None:
        self._study = _study(assignment)
        self._blocks = Blocks(self._study, assignment.partition)
        self._shared = assignment.shared
        self._fd = None if self._shared is None else self._shared.opened()
        self._thread = _ThreadState()
        limits = assignment.limits
        self._processes = None if limits is None else Processes(self._study, limits, os.cpu_count() or 1)
        if self._processes is None:
            # what all threads need is compiled once
            warm(Solver(self._study), self._study)

    def end(self) -> None:
        """Kills what the run has begun here."""
        if self._processes is not None:
            self._processes.end()

    def bad(self) -> Sequence[BadCell]:
        """Cells that FAILED in this thread since it was asked last."""
        found, self._thread.bad = self._thread.bad, []
        return found

    def _solve(self) -> SolveBlock:
        """Solves blocks in this thread."""
        state = self._thread
        if state.solve is None:
            cells = Solver(self._study) if self._processes is None else self._processes.solver()
            state.solve = block_solver(self._study, Guard(cells, lambda cell: state.bad.append(cell)))
        return state.solve

    def __del__(self) -> None:
        fd = getattr(self, "_fd", None)
        if fd is not None:
            os.close(fd)

    def sync(self) -> None:
        """Returns when all that was written is on the disk. Raises SweepError."""
        if self._shared is not None and self._fd is not None:
            with disk.refusing(Path(self._shared.path)):
                disk.fsync(self._fd)

    def block(self, job: int, mask: bytes | None) -> bytes | Sent:
        """The digests of what is written, or the numbers."""
        with faults_reported(f"{self._blocks.label(job)}: the kernel failed"):
            if self._shared is None or self._fd is None or mask is not None:
                return self._sent(job, mask)
            start, stop = self._blocks.bounds(job)
            buffers = self._thread.buffers or self._blocks.empty()
            self._thread.buffers = buffers
            arrays = {name: buffer[: stop - start] for name, buffer in buffers.items()}
            self._solve()(start, stop, arrays, None)
            return self._shared.table.write(self._fd, job, arrays)

    def _sent(self, job: int, mask: bytes | None) -> Sent:
        start, stop = self._blocks.bounds(job)
        wanted = None if mask is None else np.unpackbits(np.frombuffer(mask, np.uint8), count=stop - start).view(bool)
        arrays = self._blocks.empty(stop - start)
        self._solve()(start, stop, arrays, wanted)
        return Sent(digest(self._blocks.columns, arrays), arrays)


@dataclass
class _ThreadState(threading.local):
    """What a thread needs for itself."""

    solve: SolveBlock | None = None
    buffers: Mapping[str, Any] = field(default_factory=dict)
    bad: list[BadCell] = field(default_factory=list)


def _study(assignment: Assignment) -> Study:
    """The study with its kernel. Raises SweepError where that is another one here."""
    sys.path.extend(path for path in assignment.paths if path not in sys.path and Path(path).is_dir())
    try:
        study = Study.from_json(assignment.study, allow_import=True)
        changed = difference(assignment.fingerprint, fingerprint(study))
    except SweepError as fault:
        raise SweepError(f"worker on {socket.gethostname()}: {fault}") from None
    if changed:
        lines = "\n".join(f"  {line}" for line in changed)
        raise SweepError(
            f"worker on {socket.gethostname()}: what computes there is not what was asked for here; install the same "
            f"versions on every machine\n{lines}"
        )
    return study


def digest(columns: Sequence[Column], arrays: Mapping[str, Any]) -> str:
    """32 hex digits of the numbers of a block."""
    state = xxhash.xxh3_128()
    for column in columns:
        state.update(disk.as_bytes(arrays[column.name]))
    return state.hexdigest()
