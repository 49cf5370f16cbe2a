"""Cells solved in processes of their own, which may die of them or be killed: for kernels that crash or never end.

Each solver has one process, so that it is known which cells it died of. What a kernel does there comes back as an
exception here, and `Guard` finds the cell.
"""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing import forkserver
from multiprocessing.connection import wait
from pathlib import Path
from types import ModuleType
from typing import Any

from sweep.cells.block import Unsolved, sampled_by, told
from sweep.cells.grid import Cells, Grid
from sweep.cells.schema import cells_of, columns
from sweep.cells.solve import Solver
from sweep.cells.timing import Sample, compiling_told, work_clock
from sweep.errors import SweepError
from sweep.study.model import Study

CELL_SECONDS, DEARER = 60.0, 100.0
"""What a cell may take where nobody says otherwise; or so many times what the dearest so far has taken."""
SEVERAL_SECONDS, SLACK = 1.0, 10.0
"""Several cells may take this and so many times what they should; then they are halved."""
LOAD_SECONDS = 180.0
"""What loading and compiling a kernel may take."""
TRIALS = 3
"""Times that a cell is tried alone of which a process dies."""
LOOK_SECONDS = 0.2
"""How often it is looked whether time goes by, or the machine slept."""


class Died(Unsolved):
    """The process died, or has no memory left; another one may not."""


class Processes:
    """The processes of a run on this machine.

    A cell may take `limit` seconds; None: `CELL_SECONDS`, or longer where cells do. `cost` is what the dearest cell
    has taken; 0: none has ended yet.
    """

    def __init__(self, study: Study, limit: float | None, cost: float = 0.0) -> None:
        self.study, self.limit, self.cost, self.grid = study, limit, cost, Grid(study)
        self.text = study.to_json()
        self.over, self.alone, self._sampling = False, threading.Lock(), False
        self._idle: list[Isolated] = []
        self._solvers: list[Isolated] = []

    def sampled(self, note: Callable[[str], None]) -> Sample:
        """A timed sample, as `sampled_study` takes it."""
        solver, self._sampling = self.solver(), True
        with compiling_told(self.study.kernel_name, note, solver.compiles):
            found = sampled_by(solver, self.study, lambda: solver.seconds)
        self._sampling = False
        self._idle.append(solver)
        return found

    def seconds(self, cells: int) -> float:
        """What some cells may take. One of a sample is not waited for to its end: it is left out, but never FAILED."""
        one = self.limit or max(CELL_SECONDS, DEARER * self.cost)
        if cells <= 1 and not (self._sampling and self.cost):
            return one
        return min(one, SEVERAL_SECONDS) + SLACK * self.cost * cells

    def solver(self) -> Isolated:
        """A solver with a process of its own, for one thread at a time; one that is idle, if there is any."""
        with contextlib.suppress(IndexError):  # another thread may take the last one
            return self._idle.pop()
        self._solvers.append(Isolated(self))
        return self._solvers[-1]

    def end(self) -> None:
        """Kills all; solvers raise SweepError from now on."""
        self.over = True
        for solver in list(self._solvers):
            solver.end()


class Isolated:
    """Does what `Solver` does in a process of its own, which is begun anew whenever it is needed."""

    def __init__(self, processes: Processes) -> None:
        self._all, self.grid, self._lock = processes, processes.grid, threading.Lock()
        self._process: Any = None
        self.seconds = 0.0  # that its process has spent on cells

    def solve(self, start: int, cells: Cells, wanted: Any = None) -> None:
        """As `Solver.solve`. Raises Unsolved where the kernel raises, dies or takes too long; SweepError at the end.

        One cell alone is tried again, for a process may die of what it did before, or with others; and then no other
        cell is tried so meanwhile, lest each be blamed for the other.
        """
        crew = self._all
        for trial in range(1, TRIALS + 1):
            try:
                with crew.alone if trial > 1 else contextlib.nullcontext():
                    columns, seconds = self._solved(start, cells.number, wanted)
                break
            except Died:
                if crew.over:  # it was killed with the run, so the cell is not to blame, and stays PENDING
                    raise SweepError("the run is being stopped") from None
                if cells.number > 1 or trial == TRIALS:
                    raise
        self.seconds += seconds
        crew.cost = max(crew.cost, seconds / cells.number)
        for column, values in zip(cells.columns, columns, strict=False):  # errors come last, and may not be wanted
            column[...] = values

    def _solved(self, start: int, count: int, wanted: Any) -> tuple[list[Any], float]:
        """Columns of cells, and the seconds that they took. Raises Unsolved, Died, SweepError."""
        process, limit, late = self._process or self._begin(), self._all.seconds(count), False
        try:
            found, reason = _answer(process, limit, start, count, wanted)
        except (OSError, EOFError, AttributeError) as fault:
            late = isinstance(fault, TimeoutError)
            code = self.end(1.0, process)
            # one that died by itself, as late as that, is not late
            if late and code in (None, -signal.SIGKILL):
                raise Unsolved(f"took longer than {limit:.3g} s") from None
            if code is not None and code < 0:
                raise Died(f"its process died of {signal.Signals(-code).name}") from None
            raise Died("its process died" if code is None else f"its process ended with {code}") from None
        if reason.startswith(MemoryError.__name__):
            self.end()
            raise Died(reason)
        if reason:
            raise Unsolved(reason)
        return found  # type: ignore[no-any-return]

    def _begin(self) -> Any:
        """A process that has loaded the kernel. Raises SweepError."""
        for _ in range(10):
            try:
                with self._lock:
                    if self._all.over:
                        raise SweepError("the run is being stopped")
                    process = self._process = _started(self._all.text)
                reason = _answer(process, LOAD_SECONDS, 0, 0, None)[1]
                if not reason:
                    return process
            except SweepError:
                raise
            except Exception as fault:
                reason = told(fault)
            self.end()
            time.sleep(0.5)
        raise SweepError(
            f"{self._all.study.kernel_name}: no process of its own can be started and load it ({reason}); what is "
            "finished is kept. The name of the folder TMPDIR must be short, and ulimit -n and -u large enough"
        )

    def compiles(self) -> bool:
        """Whether its process compiles now."""
        process = self._process
        return process is not None and bool(process.compiling.value)

    def end(self, seconds: float = 0.0, process: Any = None) -> int | None:
        """Kills the process; its exit status, if that is known in so many seconds."""
        with self._lock:
            process, self._process = self._process or process, None
        if process is None:
            return None
        process.kill()
        process.join(seconds)
        return process.exitcode  # type: ignore[no-any-return]


def _answer(process: Any, limit: float, *words: Any) -> Any:
    """What a process answers: columns and seconds, or why there are none. Raises TimeoutError, EOFError, OSError.

    No seconds count while the machine sleeps or the process compiles; compiling has a limit of its own.
    """
    process.pipe.send(words)
    left = {False: limit, True: LOAD_SECONDS}
    while min(left.values()) > 0.0:
        begun = time.monotonic()
        if wait([process.pipe], min(LOOK_SECONDS, left[False])):
            return process.pipe.recv()
        left[bool(process.compiling.value)] -= min(time.monotonic() - begun, 2 * LOOK_SECONDS)
    raise TimeoutError


_starting = threading.Lock()


def _started(text: str) -> Any:
    """A process that solves cells of a study, with its `pipe` and whether it is `compiling`.

    It is made by a clean process, for one with threads cannot be copied. It does not run the program again that asks
    for it: kernels are looked up by name, so nothing of `__main__` is needed there. Workers of dask are daemons, which
    multiprocessing lets have no processes; ours end when their parent does.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["sweep.runs.isolate", *({"numba"} & sys.modules.keys())])
    flags: Any = multiprocessing.current_process()._config  # type: ignore[attr-defined]
    with _starting:
        main, daemon = sys.modules["__main__"], flags.get("daemon")
        ours, theirs = context.Pipe()
        try:
            sys.modules["__main__"], flags["daemon"] = ModuleType("__main__"), False
            process: Any = context.Process(
                target=_serve, args=(theirs, flag := context.RawValue("i"), text), daemon=True
            )
            process.start()
        finally:
            sys.modules["__main__"], flags["daemon"] = main, daemon
            theirs.close()
    process.pipe, process.compiling = ours, flag
    return process


def _serve(pipe: Any, flag: Any, text: str) -> None:
    """In the process: loads the kernel, and solves cells, until nobody asks any more.

    It ends with the run, and before the run where the memory is short. Linux kills it with its fork server, also in a
    kernel that never lets Python run; that one ends with who asks it, if nobody else holds the pipe that tells.
    """
    work_clock.flag = flag
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # to write all memory to the disk for every cell that crashes takes long; 0 would let programs have it
    hard = resource.getrlimit(resource.RLIMIT_CORE)[1]
    resource.setrlimit(resource.RLIMIT_CORE, (min(1, hard) if hard >= 0 else 1, hard))
    server: Any = vars(forkserver)["_forkserver"]
    if server._forkserver_alive_fd is not None:
        os.close(server._forkserver_alive_fd)
        server._forkserver_alive_fd = None
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text("1000")
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
    run: Any = multiprocessing.parent_process()
    threading.Thread(target=lambda: (run.join(), os._exit(0)), daemon=True).start()
    solver = None
    with contextlib.suppress(EOFError, OSError):
        while True:
            start, count, wanted = pipe.recv()
            try:
                solver = solver or Solver(Study.from_json(text, allow_import=True))
                cells = cells_of({column.name: column.empty(count) for column in columns(solver.study)})
                begun = work_clock()
                solver.solve(start, cells, wanted)
                found, reason = (cells.columns, work_clock() - begun), ""
            except BaseException as fault:
                found, reason = None, told(fault)
            pipe.send((found, reason))
