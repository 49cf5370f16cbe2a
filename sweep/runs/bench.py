"""Where blocks of a run are computed: in this process, by as many threads as there are; on a cluster, one a worker."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sweep.cells.block import BadCell, Blocks, Guard, block_solver, faults_reported
from sweep.cells.solve import Solver
from sweep.runs.isolate import Processes
from sweep.study.model import Study

POISONED = (
    "every worker that took them died; the logs of the workers may tell why, too little memory is most common; what is "
    "finished is kept; isolated, a cell of which its process dies is found and FAILED"
)

Found = bytes | Mapping[str, Any] | None
"""A block that is not in the sink yet: the digests of what a worker has written to the file, or its numbers."""

Masks = dict[int, Any]
"""Blocks, and of each the cells that are to be computed; None: all."""


@dataclass(frozen=True)
class Done:
    """A block that is computed, the seconds it took, and its cells that FAILED."""

    block: int
    seconds: float
    bad: Sequence[BadCell] = ()
    found: Found = None


class Bench:
    """Computes blocks in any thread, each with a solver and columns of its own, which are used again.

    `kept` takes the number and the columns of a block that is computed; what it gives goes back. `room` gives the
    columns to fill, where these are not a thread's own. Cells are solved here, or in `processes` of their own.
    """

    def __init__(
        self,
        study: Study,
        blocks: Blocks,
        kept: Callable[[int, Mapping[str, Any]], Found],
        room: Callable[[int], Mapping[str, Any]] | None = None,
        processes: Processes | None = None,
    ) -> None:
        self._study, self._blocks, self._kept, self._room, self._processes = study, blocks, kept, room, processes
        self._here = threading.local()

    def block(self, job: int, wanted: Any = None) -> Done:
        """Computes a block; of its cells only those wanted, by default all. Raises SweepError."""
        here, (start, stop) = self._here, self._blocks.bounds(job)
        with faults_reported(f"{self._blocks.label(job)} cannot be computed or kept"):
            if not hasattr(here, "solve"):
                here.bad = []
                cells = Solver(self._study) if self._processes is None else self._processes.solver()
                here.solve = block_solver(self._study, Guard(cells, here.bad.append))
                here.columns = {} if self._room else self._blocks.empty()
            here.bad.clear()
            begun = time.perf_counter()
            own = {name: column[: stop - start] for name, column in here.columns.items()}
            arrays = self._room(job) if self._room else own
            here.solve(start, stop, arrays, wanted)
            found = self._kept(job, arrays)
            return Done(job, time.perf_counter() - begun, [*here.bad], found)

    def blocks(self, masks: Masks) -> list[Done]:
        """Computes some blocks."""
        return [self.block(job, wanted) for job, wanted in masks.items()]
