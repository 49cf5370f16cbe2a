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

from sweep.errors import SweepError

TICK = 0.2
"""Seconds after which progress is told even if nothing has finished."""
GRACE_SECONDS = 1.3
"""What jobs at work have to end in, when they are told to stop;"""
KILL_SECONDS = 0.3
"""and then, when the processes are killed in which they compute."""

T = TypeVar("T")
J = TypeVar("J")
R = TypeVar("R")


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Stopper:
    """Tells the jobs that wait for their turn that they need not start, and gives up those that do not end.

    Parameters
    ----------
    cores : int
        How many jobs compute at once.
    kill : callable, optional
        Ends what jobs compute in processes of their own.
    """

    def __init__(self, cores: int, kill: Callable[[], None] = lambda: None) -> None:
        self._cores, self._kill = cores, kill
        self._change = threading.Condition()
        self._jobs = self._inside = 0
        self._stopped = self._given_up = False

    @contextlib.contextmanager
    def job(self) -> Iterator[None]:
        """A job is at work as long as this lasts."""
        with self._change:
            self._jobs += 1
        try:
            yield
        finally:
            with self._change:
                self._jobs -= 1
                self._change.notify_all()

    def set(self) -> None:
        """No job computes from now on, except those that do already."""
        with self._change:
            self._stopped = True
            self._change.notify_all()

    def compute(self, work: Callable[[], None]) -> bool:
        """Does `work` as soon as a core is free; False where it is not wanted any more."""
        with self._change:
            self._change.wait_for(lambda: self._stopped or self._inside < self._cores)
            if self._stopped:
                return False
            self._inside += 1
        try:
            work()
        finally:
            with self._change:
                self._inside -= 1
                wanted = not self._given_up
                self._change.notify_all()
        return wanted

    def end(self) -> None:
        """Lets the jobs at work end; those that compute for longer than `GRACE_SECONDS` are killed, or given up."""
        self.set()
        if self._ended(lambda: self._jobs == 0, GRACE_SECONDS):
            return
        self._kill()
        with self._change:
            self._given_up = not self._change.wait_for(lambda: self._jobs == 0, KILL_SECONDS)
            # what is not inside a kernel ends by itself
            self._change.wait_for(lambda: self._jobs <= self._inside)
        if self._given_up:
            _endless.set()

    def _ended(self, condition: Callable[[], bool], seconds: float) -> bool:
        with self._change:
            return self._change.wait_for(condition, seconds)


_endless = threading.Event()


def left_behind() -> bool:
    """Whether a thread was given up whose kernel does not end: Python would wait for it when the program ends."""
    return _endless.is_set()


class BufferPool(Generic[T]):
    """Things that one thread at a time may use, made when there are too few, and borrowed again and again."""

    def __init__(self, make: Callable[[], T], count: int = 0) -> None:
        self._make = make
        self._free: queue.SimpleQueue[T] = queue.SimpleQueue()
        for _ in range(count):
            self._free.put(make())

    @contextlib.contextmanager
    def borrow(self) -> Iterator[T]:
        """One that is free, or a new one."""
        try:
            one = self._free.get_nowait()
        except queue.Empty:
            one = self._make()
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
    capacity: int | None = None,
) -> None:
    """Calls `work` for every job on a pool of threads.

    After a fault, Ctrl-C or SIGTERM, the jobs at work are ended, no other is begun, and the fault is raised.

    Parameters
    ----------
    finished : called in this thread with each job that is done, and with None now and then
    capacity : how many jobs are given to the threads at a time; default: twice as many as there are
    """
    stopper = stopper or Stopper(threads)
    pool = ThreadPoolExecutor(threads)

    def guarded(job: int) -> None:
        with stopper.job():
            work(job)

    def stop() -> None:
        pool.shutdown(wait=False, cancel_futures=True)
        stopper.end()

    def settled(job: int | None, future: Future[None] | None) -> None:
        if future is not None:
            future.result()
        finished(job)

    with CtrlC() as ctrl_c:
        through(jobs, lambda job: pool.submit(guarded, job), lambda: capacity or 2 * threads, settled, stop, ctrl_c)
        pool.shutdown()


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
