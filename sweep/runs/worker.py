"""What a worker of a cluster does: it computes blocks as a thread here would.

Where it sees the folder of the parts it writes them there itself, and tells their names. Elsewhere it sends the numbers
back, with their digest.
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
from distributed import WorkerPlugin

from sweep.cells.block import Blocks, SolveBlock, block_solver, faults_reported
from sweep.cells.fingerprint import difference, fingerprint
from sweep.cells.partition import Partition
from sweep.store.parts import digest
from sweep.store.store import Store
from sweep.study.model import Study
from sweep.system.errors import SweepError

TOKEN = "token"


@dataclass(frozen=True)
class Assignment:
    """All that a worker needs to know of a run; it gets it once.

    Attributes
    ----------
    run : its name
    study : JSON
    fingerprint : fingerprint of the study where the run was started; a worker with another one refuses
    partition : how the rows are cut
    shared : folder in which parts are to be written, or "" where they are to be sent
    token : what stands in the file `TOKEN` of that folder, if it is the same folder as there
    paths : where to look for the module of a kernel of the user's own; his study was allowed to run it
    """

    run: str
    study: str
    fingerprint: Mapping[str, str]
    partition: Partition
    shared: str
    token: str
    paths: tuple[str, ...]


@dataclass(frozen=True)
class Sent:
    """The numbers of a block, and their digest."""

    digest: str
    arrays: Mapping[str, Any]


@dataclass(frozen=True)
class Answer:
    """What became of some blocks, in how many seconds: the name of each one's part, or its numbers."""

    seconds: float
    found: Mapping[int, str | Sent]


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
        _contexts.pop(self.assignment.run, None)


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
    begun = time.perf_counter()
    found = {job: context.block(job, masks.get(job)) for job in jobs}
    return Answer(time.perf_counter() - begun, found)


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
        self._store = _store(assignment, self._blocks.columns)
        self._thread = _ThreadState()
        from sweep.cells.solve import Solver

        with faults_reported(f"{self._study.kernel_name}: the kernel failed"):
            # what all threads need is compiled once
            Solver(self._study).warm()

    def block(self, job: int, mask: bytes | None) -> str | Sent:
        """The name of the part that is written, or the numbers."""
        with faults_reported(f"{self._blocks.label(job)}: the kernel failed"):
            if self._store is None or mask is not None:
                return self._sent(job, mask)
            start, stop = self._blocks.bounds(job)
            buffers = self._thread.buffers or self._blocks.empty()
            self._thread.buffers = buffers
            arrays = {name: buffer[: stop - start] for name, buffer in buffers.items()}
            self._thread.solver(self._study)(start, stop, arrays, None)
            self._store.put(job, arrays)
            return self._store.names.pop(job)

    def _sent(self, job: int, mask: bytes | None) -> Sent:
        start, stop = self._blocks.bounds(job)
        wanted = None if mask is None else np.unpackbits(np.frombuffer(mask, np.uint8), count=stop - start).view(bool)
        arrays = self._blocks.empty(stop - start)
        self._thread.solver(self._study)(start, stop, arrays, wanted)
        return Sent(digest(self._blocks.columns, arrays), arrays)


@dataclass
class _ThreadState(threading.local):
    """What a thread needs for itself."""

    solve: SolveBlock | None = None
    buffers: Mapping[str, Any] = field(default_factory=dict)

    def solver(self, study: Study) -> SolveBlock:
        if self.solve is None:
            self.solve = block_solver(study)
        return self.solve


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


def _store(assignment: Assignment, columns: Any) -> Store | None:
    """Where this process writes parts; None where it does not see the folder, or may not write there."""
    shared = Path(assignment.shared)
    try:
        same = bool(assignment.shared) and (shared / TOKEN).read_text("ascii") == assignment.token
    except (OSError, ValueError):
        return None
    if not same or not os.access(shared, os.W_OK) or not os.access(shared.parent, os.W_OK):
        return None
    return Store.sharing(shared, columns, assignment.fingerprint, assignment.partition)
