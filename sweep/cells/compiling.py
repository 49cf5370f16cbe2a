"""Compiling a kernel's functions takes seconds: it is told while it lasts, measured, and remembered for the next time.

A function of columns is compiled when it is called first. How long numba compiles meanwhile, numba itself tells.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from kernels.interface import Kernel, is_kept, machine_code_folder
from sweep.words import duration

SILENT_SECONDS = 1.0
"""What is compiled in less time is not told."""
TABLE = "compile_seconds.json"
"""File beside the folders of machine code."""


class WorkClock:
    """Seconds of this process in which numba neither compiled, nor loaded what it has compiled before, in any thread.

    Attributes
    ----------
    flag : number with a `value`
        How many compilations, one for another, are going on; others may look at it.
    """

    def __init__(self) -> None:
        self.flag: Any = SimpleNamespace(value=0)
        self._compiling, self._begun, self._watched = 0.0, 0.0, False
        self._lock = threading.Lock()

    def __call__(self) -> float:
        self.watch()
        with self._lock:
            now = self._begun if self.flag.value else time.perf_counter()
            return now - self._compiling

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
                self._compiling += time.perf_counter() - self._begun


work_clock = WorkClock()
"""That of this process."""


class Compiling:
    """Watches the first calls of a kernel's functions, and notes a line while one is compiled.

    `kernel` is the same, watched; `seconds` is what compiling took, by method, where it took longer than is told.
    """

    def __init__(self, kernel: Kernel, name: str, note: Callable[[str], None] | None = None) -> None:
        self._name, self._note = name, note
        self.seconds: dict[str, float] = {}
        methods = [
            replace(m, solve=self._watched(m.name, m.solve), bound=m.bound and self._watched(m.name, m.bound))
            for m in kernel.methods
        ]
        self.kernel = replace(kernel, check=self._watched("check", kernel.check), methods=tuple(methods))

    def remember(self) -> None:
        """For the next time that it is compiled, by another version or on another day."""
        table = _table()
        if self.seconds and table is not None:
            seconds = _read(table) | {f"{self._name}.{m}": round(s, 2) for m, s in self.seconds.items()}
            part = table.with_name(f"{table.name}.{os.getpid()}")
            with contextlib.suppress(OSError):
                part.write_text(json.dumps(seconds, indent=1, sort_keys=True), "ascii")
                part.replace(table)

    def _watched(self, method: str, function: Callable[..., None]) -> Callable[..., None]:
        called = is_kept(function)

        @functools.wraps(function)
        def call(*columns: Any) -> None:
            nonlocal called
            if called:
                function(*columns)
                return
            done = threading.Event()
            threading.Thread(target=self._tell, args=(method, done), daemon=True).start()
            begun, worked = time.perf_counter(), work_clock()
            try:
                function(*columns)
            finally:
                done.set()
                called = True
                taken = time.perf_counter() - begun - (work_clock() - worked)
                if taken > SILENT_SECONDS:
                    self.seconds[method] = self.seconds.get(method, 0.0) + taken

        return call

    def _tell(self, method: str, done: threading.Event) -> None:
        """Tells that a function is compiled, if it is before its first call is done."""
        while self._note is not None and not done.wait(SILENT_SECONDS):
            if work_clock.flag.value:
                what, table = f"{self._name}.{method}", _table()
                known = None if table is None else _read(table).get(what)
                self._note(f"compiling {what} ..." + (f" (about {duration(known)} when last done)" if known else ""))
                return


def _table() -> Path | None:
    folder = machine_code_folder()
    return None if folder is None else folder.parent / TABLE


def _read(table: Path) -> dict[str, float]:
    """Seconds by kernel and method; nothing where it cannot be read."""
    try:
        found = json.loads(table.read_text("ascii"))
        return {str(what): float(seconds) for what, seconds in found.items() if 0 < float(seconds) < 1e4}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}
