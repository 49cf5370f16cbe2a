"""One run of a study: its schema, how it is cut into blocks, and the threads that compute them."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from sweep.cells.compiling import Compiling
from sweep.cells.output_schema import output_schema, part_columns
from sweep.cells.partition import Partition, row_blocks
from sweep.cells.reduce import Reducer
from sweep.cells.schema import ANCILLARY, ERROR_BOUND, METHOD_USED, STATUS, Schema, columns
from sweep.cells.timing import UNSAMPLED, Sample, row_partition, take_sample
from sweep.system.errors import SweepError
from sweep.system.forecast import Forecast
from sweep.system.pool import BufferPool, Stopper, each
from sweep.system.progress import Progress, TimeUp, passed

if TYPE_CHECKING:
    from sweep.runs.cluster import Cluster
    from sweep.runs.extend import Precomputed, Reused
    from sweep.study.model import Study

Solve = Callable[[int, int, Mapping[str, Any]], bool]
"""Computes the rows start .. stop into columns of that length; False where the run is being stopped."""

Receive = Callable[[int, "str | Mapping[str, Any]"], None]
"""Takes a block that was computed elsewhere: the name of its part, or its numbers."""


class Session:
    """Compiles the kernel, times a sample of the grid, and cuts it.

    Parameters
    ----------
    study : Study
    fingerprint : fingerprint of the study
    workers : cores to compute on
    blocks : how the grid is cut, where that is settled already
    block_cells : cells a block, instead of a size taken from the sample
    sampled : False where nothing is left to compute
    reused : cells that need not be computed
    until : when to stop
    cluster : workers elsewhere, which compute instead of this process
    note : tells what is compiled
    """

    def __init__(
        self,
        study: Study,
        fingerprint: Mapping[str, str],
        workers: int,
        blocks: Partition | None = None,
        block_cells: int | None = None,
        sampled: bool = True,
        reused: Reused | Precomputed | None = None,
        until: datetime | None = None,
        cluster: Cluster | None = None,
        note: Callable[[str], None] | None = None,
    ) -> None:
        self.study, self.fingerprint, self.workers, self.reused, self.until = study, fingerprint, workers, reused, until
        self.cluster = cluster
        self.began = now()
        self.schema: Schema = output_schema(study, fingerprint)
        self.columns = part_columns(study)
        self.row_blocks = rows = row_blocks(study)
        compiling = Compiling(study.kernel, study.kernel_name, note)
        self.sample: Sample = sampled_study(study, compiling) if sampled else UNSAMPLED
        if blocks is None and block_cells is not None:
            blocks = Partition(rows.count, min(math.ceil(block_cells / rows.mean), rows.count))
        crew = cluster.threads if cluster is not None else 0
        self.blocks = blocks or row_partition(self.sample, rows, self.row_bytes, crew or workers)
        self.forecast = Forecast([], [])

    @property
    def row_bytes(self) -> int:
        """Bytes of one row over all columns of a part."""
        return sum(column.cell_bytes for column in self.columns)

    def cells(self, job: int) -> tuple[int, int]:
        """The cells of a block."""
        return self.row_blocks.cells(*self.blocks.bounds(job))

    def progress(
        self, stream: TextIO | None, name: str, jobs: Sequence[int], ending: Callable[[], float] = float
    ) -> Progress:
        """Where the run stands when `jobs` are still to do; they are what `compute` computes.

        Parameters
        ----------
        ending : tells the seconds needed when all cells are computed
        """
        self.forecast = Forecast(self.sample.weights(self.blocks, self.row_blocks.first), jobs)
        left = sum(stop - start for start, stop in map(self.cells, jobs))
        return Progress(self.row_blocks.size, stream, name, self.row_blocks.size - left, self.forecast, ending=ending)

    def again(self, job: int, progress: Progress) -> None:
        """A block has to be computed once more."""
        start, stop = self.cells(job)
        self.forecast.again(job)
        progress.again(stop - start)

    def dated(self, progress: Progress, began: str) -> Schema:
        """The schema with the times of the run, which now is at its end."""
        end = now()
        times = {"created": end, "start": began, "end": end, "cells_per_second": progress.rate}
        return replace(self.schema, attrs={**self.schema.attrs, **times})

    def compute(self, threads: int, work: Callable[[int, Solve], None], progress: Progress) -> None:
        """Calls `work(job, solve)` for every block that is left, on a pool of threads.

        No more than `workers` threads are inside `solve` at a time. Raises SweepError where `work` fails, TimeUp.
        """
        self.check_time()
        stopper = Stopper(self.workers)
        solvers = BufferPool(lambda: self._solver(stopper), threads)

        def guarded(job: int) -> None:
            start, stop = self.cells(job)
            with faults_reported(f"cells {start} to {stop}: the kernel failed"), solvers.borrow() as solve:
                work(job, solve)
            self.forecast.end(job)

        each(self.forecast.order(), guarded, threads, lambda job: self._tell(progress, job), stopper)

    def compute_elsewhere(
        self,
        receive: Receive,
        progress: Progress,
        door: Path | None,
    ) -> None:
        """The same on the workers of a cluster: calls `receive` with every block and its part's name, or its numbers.

        Parameters
        ----------
        door : the way to the folder of the parts; None: all numbers are wanted here
        """
        self.check_time()

        def finished(job: int | None, seconds: float = 0.0) -> None:
            if job is not None:
                self.forecast.end(job, seconds)
            self._tell(progress, job)

        assert self.cluster is not None
        self.cluster.compute(self, self.forecast.order(), receive, finished, progress.note, door)

    def _tell(self, progress: Progress, job: int | None) -> None:
        """Counts a block that is done. Raises TimeUp."""
        if job is None:
            progress.tick()
        else:
            start, stop = self.cells(job)
            progress.add(stop - start)
        self.check_time()

    def check_time(self) -> None:
        """Raises TimeUp when it is time to stop."""
        if passed(self.until):
            raise TimeUp

    def _solver(self, stopper: Stopper) -> Solve:
        compute, reused = block_solver(self.study), self.reused

        def solve(start: int, stop: int, arrays: Mapping[str, Any]) -> None:
            self.forecast.begin(start // self.blocks.cells)
            compute(start, stop, arrays, None if reused is None else reused.missing(start, stop))
            if reused is not None:
                reused.fill(start, stop, arrays)

        return lambda start, stop, arrays: stopper.compute(lambda: solve(start, stop, arrays))


def block_solver(study: Study) -> Callable[[int, int, Mapping[str, Any], Any], None]:
    """Computes rows into the columns of a part; of cells, only those wanted (None: all). For one thread at a time."""
    if study.summary is not None:
        reducer = Reducer(study)
        return lambda start, stop, arrays, wanted: reducer.solve(start, stop, arrays)
    from sweep.cells.solve import Solver

    solver = Solver(study)

    def solve(start: int, stop: int, arrays: Mapping[str, Any], wanted: Any) -> None:
        outputs = {name: array for name, array in arrays.items() if name not in ANCILLARY}
        solver.solve(start, stop, outputs, arrays[STATUS], arrays[METHOD_USED], wanted, arrays[ERROR_BOUND])

    return solve


def sampled_study(study: Study, compiling: Compiling | None = None) -> Sample:
    """Compiles the kernel and times a sample of the grid. Raises SweepError where the kernel fails."""
    from sweep.cells.solve import Solver

    compiling = compiling or Compiling(study.kernel, study.kernel_name)
    with faults_reported(f"{study.kernel_name}: the kernel failed"):
        solver = Solver(replace(study, kernel=compiling.kernel))
        solver.warm()
        sample = take_sample(solver, columns(study), row_blocks(study).size)
        if study.summary is not None:
            sample = replace(sample, costs=sample.costs + Reducer(study).seconds())
        compiling.remember()
        return sample


@contextlib.contextmanager
def faults_reported(what: str) -> Iterator[None]:
    """Every fault as a SweepError of one line."""
    try:
        yield
    except SweepError:
        raise
    except MemoryError as fault:
        raise SweepError("out of memory; fewer workers need less; what is finished is kept") from fault
    except Exception as fault:
        raise SweepError(f"{what} ({type(fault).__name__}: {fault}); what is finished is kept") from fault


def now() -> str:
    """The time as ISO 8601 in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")
