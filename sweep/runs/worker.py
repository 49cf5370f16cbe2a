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

from sweep.cells.fingerprint import difference, fingerprint
from sweep.cells.output_schema import part_columns
from sweep.cells.partition import Partition, row_blocks
from sweep.runs.session import block_solver, faults_reported
from sweep.store.parts import digest
from sweep.store.store import Store
from sweep.study.model import Study
from sweep.system.errors import SweepError


@dataclass(frozen=True)
class Assignment:
    """All that a worker needs to know of a run; it gets it once.

    Attributes
    ----------
    run : its name
    study : JSON
    fingerprint : fingerprint of the study where the run was started; a worker with another one refuses
    blocks : how the rows are cut
    door : folder through which parts are to be written, or "" where they are to be sent
    key : what stands in the file `KEY` of that folder, if it is the same folder as there
    paths : where to look for the module of a kernel of the user's own; his study was allowed to run it
    """

    run: str
    study: str
    fingerprint: Mapping[str, str]
    blocks: Partition
    door: str
    key: str
    paths: tuple[str, ...]


KEY = "key"


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


_assignments: dict[str, Assignment] = {}
_benches: dict[str, _Bench] = {}
_lock = threading.Lock()


def assign(assignment: Assignment) -> None:
    """Tells this process of a run."""
    _assignments[assignment.run] = assignment


def dismiss(run: str) -> None:
    """Forgets a run."""
    _assignments.pop(run, None)
    _benches.pop(run, None)


def compute(run: str, jobs: Sequence[int], masks: Mapping[int, bytes]) -> Answer:
    """Computes some blocks; of those with a mask, only the cells whose bit is set.

    Raises
    ------
    SweepError
        The run is over, this process has another version of the kernel, the kernel fails, or the disk does.
    """
    bench = _bench(run)
    begun = time.perf_counter()
    found = {job: bench.block(job, masks.get(job)) for job in jobs}
    return Answer(time.perf_counter() - begun, found)


def _bench(run: str) -> _Bench:
    with _lock:
        if run not in _assignments:
            raise SweepError("the run is over")
        if run not in _benches:
            _benches[run] = _Bench(_assignments[run])
        return _benches[run]


class _Bench:
    """Solvers and buffers of a run, one of each for every thread; compiles the kernel."""

    def __init__(self, assignment: Assignment) -> None:
        self._study = _study(assignment)
        self._blocks, self._row_blocks = assignment.blocks, row_blocks(self._study)
        self._columns = part_columns(self._study)
        self._store = _store(assignment, self._columns)
        self._own = _Own()
        from sweep.cells.solve import Solver

        with faults_reported(f"{self._study.kernel_name}: the kernel failed"):
            # what all threads need is compiled once
            Solver(self._study).warm()

    def block(self, job: int, mask: bytes | None) -> str | Sent:
        """The name of the part that is written, or the numbers."""
        start, stop = self._blocks.bounds(job)
        first, last = self._row_blocks.cells(start, stop)
        wanted = None if mask is None else np.unpackbits(np.frombuffer(mask, np.uint8), count=stop - start).view(bool)
        with faults_reported(f"cells {first} to {last}: the kernel failed"):
            solve, buffers = self._own.solver(self._study), self._own.buffers
            if self._store is None or mask is not None:
                arrays = {c.name: c.empty(stop - start) for c in self._columns}
                solve(start, stop, arrays, wanted)
                return Sent(digest(self._columns, arrays), arrays)
            cells = min(self._blocks.cells, self._blocks.size)
            arrays = {c.name: buffers.setdefault(c.name, c.empty(cells))[: stop - start] for c in self._columns}
            solve(start, stop, arrays, None)
            self._store.put(job, arrays)
            return self._store.names.pop(job)


@dataclass
class _Own(threading.local):
    """What a thread needs for itself."""

    solve: Any = None
    buffers: dict[str, Any] = field(default_factory=dict)

    def solver(self, study: Study) -> Any:
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
    door = Path(assignment.door)
    try:
        same = bool(assignment.door) and (door / KEY).read_text("ascii") == assignment.key
    except (OSError, ValueError):
        return None
    if not same or not os.access(door, os.W_OK) or not os.access(door.parent, os.W_OK):
        return None
    return Store.sharing(door, columns, assignment.fingerprint, assignment.blocks)
