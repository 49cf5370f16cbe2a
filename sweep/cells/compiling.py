"""Compiling a kernel's functions takes seconds: it is told while it lasts, and measured.

A function of columns is compiled when it is called first. How long numba compiles meanwhile, numba itself tells.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

SILENT_SECONDS = 1.0
"""What is compiled in less time is not told."""


class WorkClock:
    """Seconds of this process in which numba neither compiled, nor loaded what it has compiled before, in any thread.

    Attributes
    ----------
    flag : number with a `value`
        How many compilations, one for another, are going on; others may look at it.
    compiled : float
        Seconds that were spent on those.
    """

    def __init__(self) -> None:
        self.flag: Any = SimpleNamespace(value=0)
        self.compiled, self._begun, self._watched = 0.0, 0.0, False
        self._lock = threading.Lock()

    def __call__(self) -> float:
        self.watch()
        with self._lock:
            now = self._begun if self.flag.value else time.perf_counter()
            return now - self.compiled

    def watch(self) -> None:
        """From now on, if numba is loaded."""
        event: Any = sys.modules.get("numba.core.event")
        if event is not None and not self._watched:
            actions = {"on_start": self._start, "on_end": self._end}
            listener = type("Listener", (event.Listener,), {name: staticmethod(f) for name, f in actions.items()})
            event.register("numba:compiler_lock", listener())
            self._watched = True

    def _start(self, event: Any) -> None:
        with self._lock:
            self._begun = self._begun if self.flag.value else time.perf_counter()
            self.flag.value += 1

    def _end(self, event: Any) -> None:
        with self._lock:
            if not self.flag.value:
                return  # it began before it was watched
            self.flag.value -= 1
            if not self.flag.value:
                self.compiled += time.perf_counter() - self._begun


work_clock = WorkClock()
"""That of this process."""


@contextlib.contextmanager
def compiling_told(name: str, note: Callable[[str], None]) -> Iterator[None]:
    """Notes that a kernel is compiled, once, where that takes long."""
    work_clock.watch()
    done = threading.Event()

    def tell() -> None:
        while not done.wait(SILENT_SECONDS):
            if work_clock.flag.value:
                note(f"compiling {name} ...")
                return

    threading.Thread(target=tell, daemon=True).start()
    try:
        yield
    finally:
        done.set()
