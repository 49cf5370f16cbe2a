"""Where blocks of a run are computed: in this process, by as many threads as there are; on a cluster, one a worker."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from sweep.cells.block import BadCell, Blocks, Guard, block_solver, faults_reported
from sweep.cells.solve import Solver
from sweep.runs.isolate import Processes
from sweep.study.model import Study

Found = bytes | Mapping[str, Any] | None
"""A block that is not in the sink of the run yet: digests of what a worker has written to the file, or its numbers."""


class Sink(Protocol):
    """Where blocks go: `room` gives the columns to fill, `put` takes a block and gives what is still to be put."""

    def room(self, job: int) -> Mapping[str, Any]: ...
    def put(self, job: int, arrays: Any) -> Found: ...


@dataclass(frozen=True)
class Done:
    """A block that is computed, the seconds it took, its cells that FAILED, and what is still to be put."""

    block: int
    seconds: float
    bad: Sequence[BadCell] = ()
    found: Found = None


class Bench:
    """Computes blocks into a sink, in any thread; each has a solver of its own, or a process of `processes`."""

    def __init__(self, study: Study, blocks: Blocks, sink: Sink, processes: Processes | None = None) -> None:
        self._study, self._blocks, self._sink, self._processes = study, blocks, sink, processes
        self._here = threading.local()

    def block(self, job: int, wanted: Any = None) -> Done:
        """Computes a block; of its cells only those wanted, by default all. Raises SweepError."""
        here, (start, stop) = self._here, self._blocks.bounds(job)
        with faults_reported(f"{self._blocks.label(job)} cannot be computed or kept"):
            if not hasattr(here, "solve"):
                here.bad = []
                cells = Solver(self._study) if self._processes is None else self._processes.solver()
                here.solve = block_solver(self._study, Guard(cells, here.bad.append))
            here.bad.clear()
            begun = time.perf_counter()
            arrays = self._sink.room(job)
            here.solve(start, stop, arrays, wanted)
            found = self._sink.put(job, arrays)
            return Done(job, time.perf_counter() - begun, [*here.bad], found)
