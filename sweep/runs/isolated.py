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
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing import forkserver
from pathlib import Path
from typing import Any

from sweep.cells.compiling import work_clock
from sweep.cells.guard import told
from sweep.cells.schema import cells_of, columns
from sweep.cells.solve import Solver
from sweep.study.model import Study

PR_SET_PDEATHSIG = 1

_here: dict[str, Any] = {}


@dataclass(frozen=True)
class Answer:
    """What came of cells: their arrays, or why there are none; seconds, and most bytes that the process ever had."""

    arrays: Mapping[str, Any]
    reason: str
    seconds: float
    memory: float


def enter(flag: Any) -> None:
    """First in the process: it dies with the one that asks it, and before that one where the memory is short.

    Linux kills it with its fork server, also in a kernel that never lets Python run; that one ends with who asks it,
    if nobody else holds the pipe that tells.
    """
    work_clock.flag = flag
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _leave_no_core()
    server: Any = vars(forkserver)["_forkserver"]
    pipe, server._forkserver_alive_fd = server._forkserver_alive_fd, None
    if pipe is not None:
        os.close(pipe)
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text("1000")
        _begin_apart()
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _begin_apart() -> None:
    """Goes on in a child process, so that a kernel that kills its parent kills none of the other processes.

    The parent, which the executor knows, waits for its child and then ends in the same way.
    """
    _die_with_its_parent()
    _here["known"] = number = os.getpid()
    child = os.fork()
    if child:
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if code < 0:
            with contextlib.suppress(OSError):
                signal.signal(-code, signal.SIG_DFL)
            os.kill(number, -code)
        os._exit(code & 255)
    _die_with_its_parent()
    if os.getppid() != number:
        os._exit(1)


def _die_with_its_parent() -> None:
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def known() -> int:
    """Number of the process that the executor knows."""
    return int(_here.get("known", os.getpid()))


def _leave_no_core() -> None:
    """To write all memory to the disk, once for every cell that crashes, takes long. 0 would let programs have it."""
    hard = resource.getrlimit(resource.RLIMIT_CORE)[1]
    resource.setrlimit(resource.RLIMIT_CORE, (min(1, hard) if hard >= 0 else 1, hard))


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(0)


def load(text: str, paths: tuple[str, ...], good: int | None) -> None:
    sys.path.extend(path for path in paths if path not in sys.path)
    study = Study.from_json(text, allow_import=True)
    _here["study"], _here["solver"] = study, Solver(study)
    work_clock.watch()
    if good is not None:
        solve(good, 1, None)


def solve(start: int, count: int, wanted: Any) -> Answer:
    study, solver = _here["study"], _here["solver"]
    arrays = {column.name: column.empty(count) for column in columns(study)}
    begun = work_clock()
    reason = ""
    try:
        solver.solve(start, cells_of(arrays), wanted)
    except BaseException as fault:
        arrays, reason = {}, told(fault)
    seconds = work_clock() - begun
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    return Answer(arrays, reason, seconds, 1024 * kilobytes)
