"""Blocks on the workers of a dask scheduler: `--cluster tcp://...`, or a `Client` passed to `run`.

Tasks hold several short blocks, so that the scheduler has some tasks a second to place, not thousands. A worker that
dies costs the blocks it had at hand, which go to others. Where workers died of a block again and again, the blocks of
its task are tried one by one, alone, to find it; it is reported when all others are done.

dask unpickles what its processes send each other. Whoever reaches a scheduler runs code on its workers, so let none
but friends reach it, or use its TLS. Of files, nothing is ever unpickled.
"""

from __future__ import annotations

import contextlib
import logging
import math
import secrets
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError, Future
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.runs import worker
from sweep.runs.worker import Answer, Assignment, Sent
from sweep.store.parts import digest
from sweep.system import disk
from sweep.system.errors import SweepError
from sweep.system.pool import TICK, CtrlC, through
from sweep.system.progress import passed

if TYPE_CHECKING:
    from sweep.runs.session import Receive, Session
    from sweep.study.model import Study

TASK_SECONDS = 0.5
"""Blocks shorter than this go to a worker several at a time;"""
TASK_BYTES = 32 << 20
"""but no more than this, where their numbers are sent back."""
MOST_ROUNDS = 3
"""Times that a block is tried alone where nothing could be made of its answer."""
CONNECT_SECONDS = 10
ASK_SECONDS = 2.0
"""How often the scheduler is asked for its workers."""

Finished = Callable[..., None]
"""Called with a block that has ended and the seconds it took, and with None now and then."""

Batch = tuple[int, ...]
Note = Callable[[str], None]


class Cluster:
    """The workers of a dask scheduler. To be used in a `with` statement.

    Parameters
    ----------
    given : str or distributed.Client or a cluster of dask's
        An address such as "tcp://10.0.0.1:8786", or the path of a scheduler file, `*.json`; a client is not closed.

    Raises
    ------
    SweepError
        distributed is not installed, or no scheduler answers.
    """

    def __init__(self, given: Any) -> None:
        distributed = _distributed()
        self._own = not isinstance(given, distributed.Client)
        self._client = _connected(distributed, given) if self._own else given
        if self._client.asynchronous:
            raise SweepError("cluster: the client is asynchronous; pass one that is not")
        self.killed: type[Exception] = distributed.KilledWorker
        self._asked, self._threads, self._gone = -math.inf, 0, False

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *fault: object) -> None:
        if self._own:
            with contextlib.suppress(Exception):
                self._client.close(timeout=0.1 if self._gone else CONNECT_SECONDS)

    @property
    def threads(self) -> int:
        """Threads of all workers, as of a moment ago. Raises SweepError."""
        if time.monotonic() - self._asked > ASK_SECONDS:
            try:
                self._threads = sum(self._client.nthreads().values())
            except Exception as fault:
                raise self.lost(fault) from fault
            self._asked = time.monotonic()
        return self._threads

    def wait(self, note: Note, until: datetime | None) -> int:
        """Threads of all workers, as soon as there is one; those of batch systems may take hours to start."""
        with CtrlC() as ctrl_c:
            if not self.threads:
                note("the cluster has no workers yet; waiting for the first")
            while not self.threads and not passed(until):
                time.sleep(TICK)
                ctrl_c.check()
        return self.threads

    def compute(
        self,
        session: Session,
        jobs: Iterator[int],
        receive: Receive,
        finished: Finished,
        note: Note,
        door: Path | None,
    ) -> None:
        """Computes every block; see `Session.compute_elsewhere`. Raises SweepError."""
        assignment = _assignment(session, door)
        try:
            self._introduce(assignment)
            _Errand(self, session, assignment, receive, finished, note).run(jobs)
        finally:
            self._forget(assignment.run)

    def executor(self) -> Any:
        """As of concurrent.futures."""
        return self._client.get_executor(pure=False)

    def submit(self, executor: Any, *words: Any) -> Future[Answer]:
        """Has `worker.compute` called with the words by a worker. Raises SweepError."""
        try:
            future: Future[Answer] = executor.submit(worker.compute, *words)
            return future
        except Exception as fault:
            raise self.lost(fault) from fault

    def cancel(self, executor: Any) -> None:
        """Takes back what no worker has begun."""
        if not self._gone:
            with contextlib.suppress(Exception):
                executor.shutdown(wait=False)

    def lost(self, fault: BaseException) -> SweepError:
        """What is told where the scheduler does not answer any more; it is not asked again."""
        self._gone = True
        reason = (str(fault).splitlines() or [""])[0] or type(fault).__name__
        return SweepError(
            f"cluster: the scheduler is lost ({reason}); what is finished is kept, run the same command again to "
            "continue"
        )

    def _introduce(self, assignment: Assignment) -> None:
        """Tells the workers, also those that come later, of a run. Raises SweepError."""
        try:
            self._client.register_plugin(_plugin(assignment), name=assignment.run)
        except OSError as fault:
            raise self.lost(fault) from fault
        except Exception as fault:
            raise SweepError(
                f"cluster: a worker cannot take part ({type(fault).__name__}: {fault}); every machine of the cluster "
                "needs the same version of foliot"
            ) from fault

    def _forget(self, run: str) -> None:
        if not self._gone:
            with contextlib.suppress(Exception):
                self._client.unregister_worker_plugin(run)


def joined(given: Any) -> contextlib.AbstractContextManager[Cluster | None]:
    """The cluster; None where none is given. Raises SweepError."""
    return contextlib.nullcontext() if given is None else Cluster(given)


class _Errand:
    """The blocks of one run on their way to workers and back."""

    def __init__(
        self,
        cluster: Cluster,
        session: Session,
        assignment: Assignment,
        receive: Receive,
        finished: Finished,
        note: Note,
    ) -> None:
        self._cluster, self._session, self._assignment = cluster, session, assignment
        self._receive, self._finished, self._note = receive, finished, note
        self._seconds = math.inf
        self._most = max(1, TASK_BYTES // max(1, session.blocks.cells * session.row_bytes))
        self._suspects: list[int] = []
        self._lethal: list[int] = []
        self._idle = False

    def run(self, jobs: Iterator[int]) -> None:
        """Raises SweepError."""
        with CtrlC() as ctrl_c:
            self._submit(self._batches(jobs), self._capacity, self._suspect, ctrl_c)
            for _ in range(MOST_ROUNDS):
                # nothing else is under way now, so what kills its worker is found out for certain
                suspects, self._suspects = [(job,) for job in self._suspects], []
                self._submit(iter(suspects), lambda: 1, self._lethal.extend, ctrl_c)
            self._lethal += self._suspects
        if self._lethal:
            raise SweepError(self._obituary())

    def _submit(
        self, batches: Iterator[Batch], capacity: Callable[[], int], killed: Callable[[Batch], None], ctrl_c: CtrlC
    ) -> None:
        executor = self._cluster.executor()

        def submit(batch: Batch) -> Future[Answer]:
            masks = {job: mask for job in batch if (mask := self._mask(job)) is not None}
            return self._cluster.submit(executor, self._assignment.run, batch, masks)

        def settled(batch: Batch | None, future: Future[Answer] | None) -> None:
            if batch is not None and future is not None:
                self._take(batch, future, killed)
            else:
                self._look_for_workers()
                self._finished(None)

        through(batches, submit, capacity, settled, lambda: self._cluster.cancel(executor), ctrl_c)

    def _batches(self, jobs: Iterator[int]) -> Iterator[Batch]:
        """As many blocks together as take about half a second; fewer towards the end."""
        left = self._session.forecast.blocks
        while left > 0:
            enough = int(TASK_SECONDS / max(self._seconds, TASK_SECONDS / 1000))
            share = left // (2 * max(1, self._cluster.threads))
            size = max(1, min(enough, share, self._most))
            batch = [job for job in islice(jobs, size) if not self._reused(job)]
            left -= size
            if batch:
                yield tuple(batch)

    def _capacity(self) -> int:
        return 2 + 2 * self._cluster.threads

    def _take(self, batch: Batch, future: Future[Answer], killed: Callable[[Batch], None]) -> None:
        try:
            answer = future.result()
        except CancelledError as fault:
            raise self._cluster.lost(fault) from fault
        except Exception as fault:
            if isinstance(fault, self._cluster.killed):
                killed(batch)
                return
            # distributed's executor trips over a task that fails with its worker and is answered at that moment
            if isinstance(fault, TypeError) and "Answer" in str(fault):
                self._suspect(batch)
                return
            raise _told(fault) from fault
        mean = answer.seconds / len(batch)
        self._seconds = mean if math.isinf(self._seconds) else 0.7 * self._seconds + 0.3 * mean
        for job, found in answer.found.items():
            self._receive(job, found if isinstance(found, str) else self._checked(job, found))
            self._finished(job, mean)

    def _suspect(self, batch: Batch) -> None:
        cells = ", ".join(_range(self._session.cells(job)) for job in batch[:4]) + ", ..." * (len(batch) > 4)
        self._note(f"workers died again and again while they had cells {cells}; these are tried again at the end")
        self._suspects += batch

    def _obituary(self) -> str:
        cells = ", ".join(_range(self._session.cells(job)) for job in self._lethal[:8])
        more = f" and {len(self._lethal) - 8} more blocks" if len(self._lethal) > 8 else ""
        return (
            f"cells {cells}{more}: every worker that took them died, alone with them, too; the logs of the workers may "
            "tell why, too little memory is most common; all other blocks are kept"
        )

    def _look_for_workers(self) -> None:
        idle = not self._cluster.threads
        if idle and not self._idle:
            self._note("the cluster has no workers left; waiting for new ones")
        self._idle = idle

    def _mask(self, job: int) -> bytes | None:
        """Of a block that is known in part: which of its cells are not, a bit each."""
        reused = self._session.reused
        return None if reused is None else np.packbits(reused.missing(*self._session.blocks.bounds(job))).tobytes()

    def _reused(self, job: int) -> bool:
        """Whether nothing of a block has to be computed; then it is received at once."""
        reused, bounds = self._session.reused, self._session.blocks.bounds(job)
        if reused is None or reused.missing(*bounds).any():
            return False
        arrays = {c.name: c.empty(bounds[1] - bounds[0]) for c in self._session.columns}
        reused.fill(*bounds, arrays)
        self._receive(job, arrays)
        self._finished(job)
        return True

    def _checked(self, job: int, sent: Sent) -> Mapping[str, Any]:
        """The numbers of a block, the known ones filled in. Raises SweepError where they are not what was sent."""
        start, stop = self._session.blocks.bounds(job)
        columns, arrays = self._session.columns, {**sent.arrays}
        fits = all(
            arrays[c.name].shape == (stop - start, *c.shape) and arrays[c.name].dtype == c.dtype for c in columns
        )
        if not fits or digest(columns, arrays) != sent.digest:
            raise SweepError(f"cells {_range(self._session.cells(job))}: damaged on their way from the worker")
        if self._session.reused is not None:
            arrays = {name: column if column.flags.writeable else column.copy() for name, column in arrays.items()}
            self._session.reused.fill(start, stop, arrays)
        return arrays


def write_token(door: Path, key: str) -> None:
    """Puts the key at the door: a worker that reads it there sees the same folder. Raises SweepError."""
    try:
        disk.publish([key.encode("ascii")], door / "key.tmp", door / worker.KEY)
    except OSError as fault:
        raise disk.refusal(fault, door) from fault


def _assignment(session: Session, door: Path | None) -> Assignment:
    key = secrets.token_hex(16)
    # what is known already is filled in here
    by_folder = door is not None and session.reused is None
    if door is not None and by_folder:
        write_token(door, key)
    fingerprint, study = session.fingerprint, session.study
    place = str(door) if by_folder else ""
    return Assignment(f"foliot-{key[:8]}", study.to_json(), fingerprint, session.blocks, place, key, _paths(study))


def _paths(study: Study) -> tuple[str, ...]:
    """Folder of a kernel of the user's own, who has allowed it here by reading the study."""
    name = study.kernel_name.partition(":")[0]
    file = getattr(sys.modules.get(name), "__file__", None) if ":" in study.kernel_name else None
    if file is None:
        return ()
    path = Path(file).resolve()
    above = name.count(".") + (path.name == "__init__.py")
    return (str(path.parents[above]),)


def _plugin(assignment: Assignment) -> Any:
    """What dask sets up on every worker, also on those that come later."""
    from sweep.runs.plugin import Desk

    return Desk(assignment)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise SweepError(
            'cluster: needs the package distributed; install it with: pip install "foliot[cluster]"'
        ) from None
    return distributed


def _connected(distributed: Any, given: Any) -> Any:
    """A client of its own for an address, a scheduler file or a cluster. Raises SweepError."""
    if isinstance(given, str) and not given.strip():
        raise SweepError("cluster: expected an address such as tcp://10.0.0.1:8786, found nothing")
    keys: dict[str, Any] = {"address": given}
    if isinstance(given, str | Path) and str(given).endswith(".json"):
        if not Path(given).is_file():
            raise SweepError(f"cluster: there is no scheduler file {given}")
        keys = {"scheduler_file": str(given)}
    if isinstance(given, str):
        # one clear message is ours to give
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        return distributed.Client(**keys, timeout=CONNECT_SECONDS, set_as_default=False)
    except Exception as fault:
        reason = (str(fault).splitlines() or [type(fault).__name__])[0]
        raise SweepError(f"cluster: no dask scheduler answers at {given} ({reason})") from fault


def _told(fault: Exception) -> SweepError:
    if isinstance(fault, SweepError):
        return fault
    return SweepError(f"cluster: a worker failed ({type(fault).__name__}: {fault}); what is finished is kept")


def _range(cells: tuple[int, int]) -> str:
    return f"{cells[0]} to {cells[1]}"
