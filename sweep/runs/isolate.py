"""Solves cells in separate processes, which may crash or be killed: for kernels that crash or never end.

Each call has its own process, so that the cells which crash it are known. The crash becomes an exception here, and
`Guard` finds the cell.
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
from collections.abc import Mapping
from multiprocessing import forkserver
from multiprocessing.connection import wait
from pathlib import Path
from types import ModuleType
from typing import Any

from sweep.cells.block import Unsolved, told
from sweep.cells.fingerprint import difference, own_sources
from sweep.cells.grid import Grid
from sweep.cells.schema import STATUS, Columns, columns, empty
from sweep.cells.solve import Solver
from sweep.cells.timing import Sample, sampled_study, work_clock
from sweep.errors import SweepError
from sweep.study.model import Study

CELL_SECONDS, DEARER = 60.0, 100.0
"""Default time limit of a cell; or this multiple of the slowest cell so far."""
SEVERAL_SECONDS, SLACK = 1.0, 10.0
"""Time limit of several cells, and the multiple of their expected time; beyond it they are bisected."""
LOAD_SECONDS = 180.0
"""Time limit for loading and compiling a kernel."""
TRIALS = 3
"""Trials of a single cell that crashes its process."""
LOOK_SECONDS = 0.2
"""Interval of checks whether the machine slept."""


class Processes:
    """Does what `Solver` does, for any number of threads, in processes that are begun as they are needed.

    A cell may take `limit` seconds; None: `CELL_SECONDS`, or longer where cells do. `cost` is what the dearest cell
    has taken; 0: none has ended yet. So many `seconds` were spent on cells.
    """

    def __init__(self, study: Study, limit: float | None, cost: float = 0.0) -> None:
        self.study, self.grid, self.limit, self.cost, self.seconds = study, Grid(study), limit, cost, 0.0
        self._over, self._sampling, self._alone = False, False, threading.Lock()
        self._words = study.to_json(), own_sources(study.kernel_name)
        self._all, self._idle = set[Any](), list[Any]()

    def sampled(self) -> Sample:
        """A timed sample, as `sampled_study` takes it."""
        self._sampling = True
        found = sampled_study(self.study, self, lambda: self.seconds)
        self._sampling = False
        return found

    def compiles(self) -> bool:
        """Whether one of them compiles now."""
        return any(process.compiling.value for process in list(self._all))

    def solve(self, start: int, cells: Columns, wanted: Any = None) -> None:
        """As `Solver.solve`. Raises Unsolved where the kernel raises, dies or takes too long; SweepError at the end.

        One cell alone is tried again where its process dies, or has no memory left, for that may come of what it did
        before, or of others; and then no other cell is tried so meanwhile, lest each be blamed for the other.
        """
        number, limit = len(cells[STATUS]), self.limit or max(CELL_SECONDS, DEARER * self.cost)
        if number > 1 or (self._sampling and self.cost):  # one of a sample is left out where it is late, but not FAILED
            limit = min(limit, SEVERAL_SECONDS) + SLACK * self.cost * number
        for trial in range(1, TRIALS + 1):
            with self._alone if trial > 1 else contextlib.nullcontext():
                process = self._lent()
                try:
                    found, reason = _answer(process, limit, start, number, wanted)
                    died = reason.startswith(MemoryError.__name__)
                except (OSError, EOFError) as fault:
                    late, code, died = isinstance(fault, TimeoutError), self._killed(process), True
                    # one that died by itself, as late as that, is not late
                    if late and code in (None, -signal.SIGKILL):
                        raise Unsolved(f"took longer than {limit:.3g} s") from None
                    reason = "its process died" if code is None else f"its process ended with {code}"
                    if code is not None and code < 0:
                        reason = f"its process died of {signal.Signals(-code).name}"
            if not died:
                self._idle.append(process)
                break
            self._killed(process)
            if self._over:  # it was killed with the run, so the cell is not to blame, and stays PENDING
                raise SweepError("the run is being stopped")
            if number > 1:
                break
        if reason:
            raise Unsolved(reason)
        arrays, seconds = found
        self.seconds += seconds
        self.cost = max(self.cost, seconds / number)
        for name, column in cells.items():
            column[...] = arrays[name]

    def end(self) -> None:
        """Kills all; what they are at raises SweepError."""
        with _starting:
            self._over = True
        for process in list(self._all):
            process.kill()

    def _lent(self) -> Any:
        """A process that has loaded the kernel: one that is idle, or a new one. Raises SweepError."""
        with contextlib.suppress(IndexError):
            return self._idle.pop()
        for _ in range(10):
            process = None
            try:
                with _starting:
                    if self._over:
                        raise SweepError("the run is being stopped")
                    self._all.add(process := _started(*self._words))
                reason = _answer(process, LOAD_SECONDS, 0, 0, None)[1]
                if not reason:
                    return process
            except SweepError:
                raise
            except Exception as fault:
                reason = f"{told(fault)}; the name of the folder TMPDIR must be short, ulimit -n and -u large enough"
            if process is not None:
                self._killed(process)
            if reason.startswith(SweepError.__name__):  # it would be no other the next time
                break
            time.sleep(0.5)
        raise SweepError(
            f"{self.study.kernel_name}: no process of its own can be started and load it; what is finished is kept "
            f"({reason})"
        )

    def _killed(self, process: Any) -> int | None:
        """The exit status of a process that is killed if it has not ended, where that is known in a second."""
        process.kill()
        process.join(1.0)
        self._all.discard(process)
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


_starting = threading.Lock()  # what is done for that is seen by all threads


def _started(text: str, sources: Mapping[str, str]) -> Any:
    """A process that solves cells of a study from the same sources, with its `pipe` and whether it is `compiling`.

    It is made by a clean process, for one with threads cannot be copied. It does not run the program again that asks
    for it: kernels are looked up by name, so nothing of `__main__` is needed there. Workers of dask are daemons, which
    multiprocessing lets have no processes; ours end when their parent does.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["sweep.runs.isolate", *({"numba"} & sys.modules.keys())])
    flags: Any = multiprocessing.current_process()._config  # type: ignore[attr-defined]
    main, daemon = sys.modules["__main__"], flags.get("daemon")
    (ours, theirs), flag = context.Pipe(), context.RawValue("i")
    try:
        sys.modules["__main__"], flags["daemon"] = ModuleType("__main__"), False
        process: Any = context.Process(target=_serve, args=(theirs, flag, text, sources), daemon=True)
        process.start()
    finally:
        sys.modules["__main__"], flags["daemon"] = main, daemon
        theirs.close()
    process.pipe, process.compiling = ours, flag
    return process


def _serve(pipe: Any, flag: Any, text: str, sources: Mapping[str, str]) -> None:
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
                if solver is None:
                    study = Study.from_json(text, allow_import=True)
                    if changed := difference(sources, own_sources(study.kernel_name)):
                        raise SweepError(f"{changed[0]} since the run began; undo that, or run it anew")
                    solver = Solver(study)
                cells = empty(columns(solver.study), count)
                begun = work_clock()
                solver.solve(start, cells, wanted)
                found, reason = (cells, work_clock() - begun), ""
            except BaseException as fault:
                found, reason = None, told(fault)
            pipe.send((found, reason))
