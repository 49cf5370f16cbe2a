"""Cells solved in processes of their own, which may die of them or be killed: for kernels that crash or never end.

Each solver has an executor of concurrent.futures with one process, so that it is known which cells it died of. What a
kernel does there comes back as an exception here, and `Guard` finds the cell.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from sweep.cells.grid import Cells, Grid
from sweep.cells.guard import Unsolved, told
from sweep.cells.schema import STATUS, cells_of
from sweep.errors import SweepError
from sweep.file.open import memory
from sweep.runs import isolated
from sweep.runs.isolated import Answer
from sweep.study.model import Study
from sweep.words import seconds_of

CELL_SECONDS = 60.0
"""What a cell may take, where nobody says otherwise;"""
DEARER = 100.0
"""or so many times what one of the timed sample takes, where that is more."""
SEVERAL_SECONDS = 1.0
"""Several cells may take this and `SLACK` times what they should; then they are halved."""
SLACK = 10.0
LOAD_SECONDS = 180.0
"""What loading and compiling a kernel may take."""
MEMORY_SHARE = 0.5
"""Share of the memory that all processes may have before they are replaced."""
TRIALS = 3
"""Times that a cell is tried alone of which a process dies."""
STARTS, START_SECONDS = 5, 0.5
"""Times that a process is started anew which dies before it has loaded the kernel, and the pause before that."""
LOOK_SECONDS = 0.2
"""How often it is looked whether time goes by, or the machine slept."""
BURY_SECONDS = 1.0
"""What the exit status of a process that is dead may be waited for."""

R = TypeVar("R")


class Died(Unsolved):
    """The process died, or has no memory left; another one may not."""


class Ended(SweepError):
    """The run is being stopped."""


@dataclass(frozen=True)
class Limits:
    """What cells may take.

    Attributes
    ----------
    cell : seconds that one cell may take; None: `CELL_SECONDS`, or longer where cells do
    cost : seconds that one takes, as far as is known
    """

    cell: float | None = None
    cost: float = 0.0

    def seconds(self, cells: int) -> float:
        """What some cells together may take."""
        one = max(CELL_SECONDS, DEARER * self.cost) if self.cell is None else self.cell
        return one if cells == 1 else min(one, SEVERAL_SECONDS) + SLACK * self.cost * cells


def limits_of(cell_timeout: float | str | None) -> Limits:
    """As they are asked for. Raises SweepError where that is no time."""
    return Limits(None if cell_timeout is None else seconds_of("cell_timeout", cell_timeout))


class Processes:
    """The processes of a run on this machine.

    Parameters
    ----------
    study : Study
    limits : Limits
    count : int
        How many there will be.
    """

    def __init__(self, study: Study, limits: Limits, count: int) -> None:
        self.study, self.limits = study, limits
        self.grid, self.text, self.paths = Grid(study), study.to_json(), kernel_paths(study)
        self.most_bytes = MEMORY_SHARE * memory() / count
        self.good: int | None = None
        self.dearest = 0.0
        self.over = False
        self._solvers: list[IsolatedSolver] = []

    def seconds(self, cells: int) -> float:
        """What some cells may take. One of a sample is not waited for to its end: it is left out, but never FAILED."""
        if self.limits.cost or self.good is None:
            return self.limits.seconds(cells)
        return min(self.limits.seconds(1), SEVERAL_SECONDS + SLACK * self.dearest * cells)

    def solver(self) -> IsolatedSolver:
        """A solver with a process of its own, for one thread at a time."""
        self._solvers.append(IsolatedSolver(self))
        return self._solvers[-1]

    def end(self) -> None:
        """Kills all; solvers raise `Ended` from now on."""
        self.over = True
        for solver in list(self._solvers):
            solver.end()


class IsolatedSolver:
    """Does what `Solver` does in a process of its own, which is begun anew whenever it is needed."""

    def __init__(self, processes: Processes) -> None:
        self._all, self.grid = processes, processes.grid
        self._pool: ProcessPoolExecutor | None = None
        self._process: Any = None
        self._compiling: Any = None
        self._lock = threading.Lock()
        self._fresh = True
        self.seconds = 0.0

    def clock(self) -> float:
        """Seconds that its process has spent on cells."""
        return self.seconds

    def solve(self, start: int, cells: Cells, wanted: Any = None) -> None:
        """As `Solver.solve`. Raises Unsolved where the kernel raises, dies or takes too long; Ended."""
        found = cells_of(self._asked(start, cells.number, wanted))
        for name, column in cells.outputs.items():
            column[...] = found.outputs[name]
        cells.status[...], cells.used[...] = found.status, found.used
        if cells.error is not None:
            cells.error[...] = found.error

    def _asked(self, start: int, count: int, wanted: Any) -> Mapping[str, Any]:
        """One cell alone is tried again, for a process may die of what it did before, or be killed by others."""
        for _ in range(TRIALS if count == 1 else 1):
            try:
                limit = self._all.seconds(count)
                return self._taken(self.call(limit, isolated.solve, start, count, wanted), start)
            except Died as fault:
                reason = str(fault)
        raise Unsolved(reason)

    def call(self, limit: float, function: Callable[..., R], *words: Any) -> R:
        """What a function gives in the process, within so many seconds. Raises Unsolved, Died, Ended."""
        pool = self._ready()
        try:
            return awaited(pool.submit(function, *words), limit, lambda: bool(self._compiling.value))
        except (RuntimeError, CancelledError, TimeoutError) as fault:
            late, code = isinstance(fault, TimeoutError), self._bury(BURY_SECONDS)
        if self._all.over:
            raise Ended("the run is being stopped")
        # one that died by itself, as late as that, is not late
        if late and code in (None, -signal.SIGKILL):
            raise Unsolved(f"took longer than {limit:.3g} s")
        raise Died(_death(code))

    def _taken(self, answer: Answer, start: int) -> Mapping[str, Any]:
        fresh, self._fresh = self._fresh, False
        if answer.memory > self._all.most_bytes:
            self.end()
        if answer.reason.startswith(MemoryError.__name__) and not fresh:
            self.end()
            raise Died(answer.reason)
        if answer.reason:
            raise Unsolved(answer.reason)
        self.seconds += answer.seconds
        self._all.dearest = max(self._all.dearest, answer.seconds / len(answer.arrays[STATUS]))
        self._all.good = start if self._all.good is None else self._all.good
        return answer.arrays

    def _ready(self) -> ProcessPoolExecutor:
        """The executor; a new one has loaded the kernel, and solved a cell that is known to end."""
        if self._pool is not None and not self._all.over:
            return self._pool
        for _ in range(STARTS):
            try:
                pool = self._begun()
                number = awaited(pool.submit(isolated.known), LOAD_SECONDS)
                self._process = next((p for p in multiprocessing.active_children() if p.pid == number), None)
                awaited(pool.submit(isolated.load, self._all.text, self._all.paths, self._all.good), LOAD_SECONDS)
                self._fresh = True
                return pool
            except SweepError:
                self.end()
                raise
            except Exception as fault:
                # a process that has not loaded the kernel is never asked for cells: they would be blamed for it
                reason = told(fault)
                self.end()
                time.sleep(START_SECONDS)
        raise SweepError(
            f"{self._all.study.kernel_name}: no process of its own can be started and load it ({reason}); what is "
            "finished is kept. The name of the folder TMPDIR must be short, and ulimit -n and -u large enough"
        )

    def _begun(self) -> ProcessPoolExecutor:
        """A new executor, whose process is being made. Raises Ended."""
        with self._lock:
            if self._all.over:
                raise Ended("the run is being stopped")
            context = _context()
            self._compiling, self._process = context.RawValue("i"), None
            self._pool = ProcessPoolExecutor(1, context, isolated.enter, (self._compiling,))
            with _apart():
                self._pool.submit(int)
            return self._pool

    def end(self) -> None:
        """Kills the process."""
        self._bury(0.0)

    def _bury(self, seconds: float) -> int | None:
        """Kills the process, if it lives; its exit status, if that is known in so many seconds."""
        with self._lock:
            pool, self._pool = self._pool, None
        if pool is None:
            return None
        if self._process is not None:
            self._process.kill()
        # the executor asks for the status as well, and who asks meanwhile may find none
        burial = threading.Thread(target=pool.shutdown, kwargs={"cancel_futures": True}, daemon=True)
        burial.start()
        burial.join(seconds)
        return None if burial.is_alive() or self._process is None else self._process.exitcode


def awaited(future: Future[R], seconds: float, compiling: Callable[[], bool] = lambda: False) -> R:
    """What it gives. Raises TimeoutError after so many seconds; none count while the machine sleeps or is compiling."""
    left = {False: seconds, True: LOAD_SECONDS}
    while min(left.values()) > 0.0:
        begun = time.monotonic()
        if wait([future], min(LOOK_SECONDS, left[False])).done:
            return future.result()
        left[compiling()] -= min(time.monotonic() - begun, 2 * LOOK_SECONDS)
    raise TimeoutError


def _death(code: int | None) -> str:
    """What a process died of, by its exit status."""
    if code is None:
        return "its process died"
    return f"its process died of {signal.Signals(-code).name}" if code < 0 else f"its process ended with {code}"


def kernel_paths(study: Study) -> tuple[str, ...]:
    """Folder of a kernel of the user's own, who has allowed it here by reading the study."""
    name = study.kernel_name.partition(":")[0]
    file = getattr(sys.modules.get(name), "__file__", None) if ":" in study.kernel_name else None
    if file is None:
        return ()
    path = Path(file).resolve()
    above = name.count(".") + (path.name == "__init__.py")
    return (str(path.parents[above]),)


def _context() -> Any:
    """A clean process, from which others are made quickly: one with threads cannot be copied."""
    context = multiprocessing.get_context("forkserver")
    compiler = ["numba"] if "numba" in sys.modules else []
    context.set_forkserver_preload(["sweep.runs.isolated", *compiler])
    return context


_starting = threading.Lock()


@contextlib.contextmanager
def _apart() -> Iterator[None]:
    """A process that is made meanwhile does not run the program again that asks for it, nor has it to be a daemon's.

    Kernels are looked up by name, so nothing of `__main__` is needed there. Workers of dask are daemons, which
    multiprocessing lets have no processes; ours end when their parent does.
    """
    flags = multiprocessing.current_process()._config  # type: ignore[attr-defined]
    with _starting:
        daemon, main = flags.pop("daemon", None), sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main
            if daemon is not None:
                flags["daemon"] = daemon
