"""What the process does that cells are solved in: for `isolate`, whose other end this is."""

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
from dataclasses import dataclass
from multiprocessing import forkserver
from pathlib import Path
from typing import Any

from sweep.cells.guard import told
from sweep.cells.schema import cells_of, columns
from sweep.cells.solve import Solver
from sweep.study.model import Study

PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class Answer:
    """What came of cells: their arrays, or why there are none; seconds, and most bytes that the process ever had."""

    arrays: Mapping[str, Any]
    reason: str
    seconds: float
    memory: float


class Compiler:
    """Watches numba in this process compile, or load what it has compiled before.

    Attributes
    ----------
    flag : shared number
        Whether it does now.
    seconds : float
        How long it has so far.
    """

    def __init__(self, flag: Any) -> None:
        self.flag, self.seconds, self._begun, self._watched = flag, 0.0, 0.0, False

    def watch(self) -> None:
        """From now on, if numba is loaded."""
        event: Any = sys.modules.get("numba.core.event")
        if event is not None and not self._watched:
            actions = {"on_start": self._start, "on_end": self._end}
            listener = type("Listener", (event.Listener,), {name: staticmethod(f) for name, f in actions.items()})
            event.register("numba:compiler_lock", listener())
            self._watched = True

    def _start(self, event: Any) -> None:
        """One compilation may need others."""
        self._begun = self._begun if self.flag.value else time.perf_counter()
        self.flag.value += 1

    def _end(self, event: Any) -> None:
        self.flag.value -= 1
        if not self.flag.value:
            self.seconds += time.perf_counter() - self._begun


def enter(flag: Any) -> None:
    """First in the process: it dies with the one that asks it, and before that one where the memory is short.

    The system kills it with its fork server, also in a kernel that never lets Python run; that one ends with who asks
    it, if nobody else holds the pipe that tells.
    """
    _here["compiler"] = Compiler(flag)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _leave_no_core()
    server: Any = vars(forkserver)["_forkserver"]
    pipe, server._forkserver_alive_fd = server._forkserver_alive_fd, None
    if pipe is not None:
        os.close(pipe)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        with contextlib.suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text("1000")
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _leave_no_core() -> None:
    """To write all memory to the disk, once for every cell that crashes, takes long. 0 would let programs have it."""
    hard = resource.getrlimit(resource.RLIMIT_CORE)[1]
    resource.setrlimit(resource.RLIMIT_CORE, (min(1, hard) if hard >= 0 else 1, hard))


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(0)


_here: dict[str, Any] = {}


def load(text: str, paths: tuple[str, ...], good: int | None) -> None:
    sys.path.extend(path for path in paths if path not in sys.path)
    study = Study.from_json(text, allow_import=True)
    _here["study"], _here["solver"] = study, Solver(study)
    _here["compiler"].watch()
    if good is not None:
        solve(good, 1, None)


def solve(start: int, count: int, wanted: Any) -> Answer:
    study, solver, compiler = (_here[name] for name in ("study", "solver", "compiler"))
    arrays = {column.name: column.empty(count) for column in columns(study)}
    begun = time.perf_counter() - compiler.seconds
    reason = ""
    try:
        solver.solve(start, cells_of(arrays), wanted)
    except BaseException as fault:
        arrays, reason = {}, told(fault)
    seconds = time.perf_counter() - compiler.seconds - begun
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    return Answer(arrays, reason, seconds, 1024 * kilobytes)
