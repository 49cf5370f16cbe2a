"""Where blocks of a run are computed: in this process, by as many threads as there are; on a cluster, one a worker."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sweep.cells.block import Blocks, block_solver, faults_reported
from sweep.cells.guard import BadCell, Guard
from sweep.cells.solve import Solver
from sweep.runs.isolate import Processes
from sweep.study.model import Study

Found = bytes | Mapping[str, Any]
"""What became of a block: the digests of what is written already, or its numbers."""


POISONED = (
    "every worker that took them died; the logs of the workers may tell why, too little memory is most common; what is "
    "finished is kept; isolated, a cell of which its process dies is found and FAILED"
)


@dataclass(frozen=True)
class Done:
    """A block that is computed, and its cells that FAILED."""

    block: int
    found: Found
    bad: Sequence[BadCell] = ()


class Buffers:
    """Columns of blocks that are used again: fresh ones cost a third of a cheap kernel's time."""

    def __init__(self, blocks: Blocks) -> None:
        self._blocks = blocks
        self._free: deque[Mapping[str, Any]] = deque()
        self._lent: dict[int, Mapping[str, Any]] = {}

    def room(self, job: int) -> Mapping[str, Any]:
        """Columns for a block."""
        start, stop = self._blocks.bounds(job)
        try:
            self._lent[job] = self._free.pop()
        except IndexError:
            self._lent[job] = self._blocks.empty()
        return {name: column[: stop - start] for name, column in self._lent[job].items()}

    def back(self, job: int) -> None:
        """Those of a block are not needed any more, if it had any."""
        if job in self._lent:
            self._free.append(self._lent.pop(job))


class Bench:
    """Computes blocks in any thread, each with a solver of its own.

    Parameters
    ----------
    study : Study
    blocks : Blocks
    room : callable
        Columns to fill for a block.
    kept : callable
        Told the number and the columns of a block that is computed; what it gives goes back.
    processes : Processes, optional
        Which solve cells; None: they are solved in this process.
    """

    def __init__(
        self,
        study: Study,
        blocks: Blocks,
        room: Callable[[int], Mapping[str, Any]],
        kept: Callable[[int, Mapping[str, Any]], Found] = lambda job, arrays: arrays,
        processes: Processes | None = None,
    ) -> None:
        self._study, self._blocks, self._room, self._kept, self._processes = study, blocks, room, kept, processes
        self._here = threading.local()

    def block(self, job: int, wanted: Any = None) -> Done:
        """Computes a block; of its cells only those wanted, by default all. Raises SweepError."""
        with faults_reported(f"{self._blocks.label(job)}: the kernel failed"):
            if not hasattr(self._here, "solve"):
                bad: list[BadCell] = []
                self._here.bad = bad
                cells = Solver(self._study) if self._processes is None else self._processes.solver()
                self._here.solve = block_solver(self._study, Guard(cells, bad.append))
            arrays = self._room(job)
            self._here.solve(*self._blocks.bounds(job), arrays, wanted)
            done = Done(job, self._kept(job, arrays), [*self._here.bad])
            self._here.bad.clear()
            return done
