"""Many jobs through a pool of threads, or through workers elsewhere, a few of them submitted at a time."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from sweep.system.errors import SweepError

TICK = 0.2
"""Seconds after which progress is told even if nothing has finished."""

T = TypeVar("T")
J = TypeVar("J")
R = TypeVar("R")


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Stopper:
    """Tells the jobs that wait for their turn that they need not start."""

    def __init__(self, slots: int) -> None:
        self._event = threading.Event()
        self._slots = threading.Semaphore(slots)

    def set(self) -> None:
        """No job computes from now on, except those that do already."""
        self._event.set()

    def compute(self, work: Callable[[], None]) -> bool:
        """Does `work` as soon as a core is free; False where it is not wanted any more."""
        with self._slots:
            if self._event.is_set():
                return False
            work()
            return True


class BufferPool(Generic[T]):
    """Things that one thread at a time may use, made once and borrowed again and again."""

    def __init__(self, make: Callable[[], T], count: int) -> None:
        self._free: queue.SimpleQueue[T] = queue.SimpleQueue()
        for _ in range(count):
            self._free.put(make())

    @contextlib.contextmanager
    def borrow(self) -> Iterator[T]:
        """Waits for a free one."""
        one = self._free.get()
        try:
            yield one
        finally:
            self._free.put(one)


def each(
    jobs: Iterable[int],
    work: Callable[[int], None],
    threads: int,
    finished: Callable[[int | None], None],
    stopper: Stopper | None = None,
) -> None:
    """Calls `work` for every job on a pool of threads.

    After a fault, Ctrl-C or SIGTERM, the jobs at work are ended, no other is begun, and the fault is raised.

    Parameters
    ----------
    finished : called in this thread with each job that is done, and with None now and then
    """
    with CtrlC() as ctrl_c, ThreadPoolExecutor(threads) as pool:

        def stop() -> None:
            if stopper is not None:
                stopper.set()
            pool.shutdown(wait=True, cancel_futures=True)

        def settled(job: int | None, future: Future[None] | None) -> None:
            if future is not None:
                future.result()
            finished(job)

        through(jobs, lambda job: pool.submit(work, job), lambda: 2 * threads, settled, stop, ctrl_c)


def through(
    jobs: Iterable[J],
    submit: Callable[[J], Future[R]],
    capacity: Callable[[], int],
    settled: Callable[[J | None, Future[R] | None], None],
    stop: Callable[[], None],
    ctrl_c: CtrlC,
) -> None:
    """Submits every job, no more than `capacity()` at a time; the same for threads and for workers elsewhere.

    Parameters
    ----------
    settled : called in this thread with each job that has ended and its future, and with None now and then
    stop : called where it raises, and after Ctrl-C or SIGTERM, before the fault goes on
    """
    waiting: dict[Future[R], J] = {}
    try:
        for job in jobs:
            waiting[submit(job)] = job
            while len(waiting) >= capacity():
                _settle(waiting, settled)
                ctrl_c.check()
        while waiting:
            _settle(waiting, settled)
            ctrl_c.check()
    except BaseException:
        stop()
        raise


def _settle(waiting: dict[Future[R], J], settled: Callable[[J | None, Future[R] | None], None]) -> None:
    done, _ = wait(waiting, timeout=TICK, return_when=FIRST_COMPLETED)
    for future in done:
        settled(waiting.pop(future), future)
    settled(None, None)


class Terminated(SystemExit):
    """The system, or somebody, asked this process to end (SIGTERM); it does, with the usual exit status 143."""

    def __init__(self) -> None:
        super().__init__(128 + signal.SIGTERM)


class CtrlC:
    """Holds Ctrl-C and SIGTERM back until `check`, for Python's locks are left in disorder where they strike in them.

    The second one strikes at once. One within another asks that one. Other handlers than Python's own are left alone.
    """

    OWN: ClassVar[dict[signal.Signals, Any]] = {
        signal.SIGINT: signal.default_int_handler,
        signal.SIGTERM: signal.SIG_DFL,
    }
    _outermost: ClassVar[CtrlC | None] = None

    def __init__(self) -> None:
        self._pressed: int | None = None
        self._ours: list[signal.Signals] = []
        self._holder = self

    def __enter__(self) -> CtrlC:
        if threading.current_thread() is not threading.main_thread():
            return self
        if CtrlC._outermost is not None:
            self._holder = CtrlC._outermost
            return self
        CtrlC._outermost = self
        self._ours = [number for number, own in self.OWN.items() if signal.getsignal(number) is own]
        for number in self._ours:
            signal.signal(number, self._press)
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        if CtrlC._outermost is self:
            CtrlC._outermost = None
            self._give_back()
        if kind is None:
            self.check()

    def check(self) -> None:
        """Raises KeyboardInterrupt if Ctrl-C was pressed, Terminated after SIGTERM."""
        pressed = self._holder._pressed
        if pressed == signal.SIGTERM:
            raise Terminated
        if pressed is not None:
            raise KeyboardInterrupt

    def _press(self, number: int, frame: object) -> None:
        self._pressed = number
        self._give_back()

    def _give_back(self) -> None:
        for number in self._ours:
            signal.signal(number, self.OWN[number])


def whole_number(name: str, number: int) -> int:
    """The number, if it is a whole one from 1 on. Raises SweepError."""
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < 1:
        raise SweepError(f"{name}: expected a whole number from 1 on, found {number!r}")
    return int(number)
