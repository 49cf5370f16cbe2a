"""The workers of a dask scheduler: `--cluster tcp://...`, or a `Client` passed to `run`. Imports distributed.

dask unpickles what its processes send each other. Whoever reaches a scheduler runs code on its workers, so let none
but friends reach it, or use its TLS. Of files, nothing is ever unpickled.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import math
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from datetime import datetime
from pathlib import Path
from typing import Any

import distributed

from sweep.errors import Incomplete, SweepError
from sweep.runs import worker
from sweep.runs.pool import TICK, CtrlC
from sweep.runs.progress import passed
from sweep.runs.worker import Answer, Assignment, Plugin

CONNECT_SECONDS = 10
ASK_SECONDS = 2.0
"""How often the scheduler is asked for its workers."""

TRIALS = 5
"""Times that workers are told of a run, where some leave meanwhile."""


class Cluster:
    """The workers of a dask scheduler. To be used in a `with` statement.

    Parameters
    ----------
    address : str or distributed.Client or a cluster of dask's
        An address such as "tcp://10.0.0.1:8786", or the path of a scheduler file, `*.json`; a client is not closed.

    Raises
    ------
    SweepError
        No scheduler answers.
    """

    def __init__(self, address: Any) -> None:
        self._own = not isinstance(address, distributed.Client)
        self._client = _connected(address) if self._own else address
        if self._client.asynchronous:
            raise SweepError("cluster: the client is asynchronous; pass one that is not")
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

    def wait(self, note: Callable[[str], None], until: datetime | None) -> None:
        """Returns as soon as there is a worker, or it is time to stop; those of batch systems may take hours."""
        if self.threads:
            return
        note("the cluster has no workers yet; waiting for the first")
        # a cluster that adapts to what there is to do makes workers only for that
        call = self._client.submit(os.getpid, pure=False)
        with CtrlC() as ctrl_c:
            while not self.threads and not passed(until):
                time.sleep(TICK)
                ctrl_c.check()
        call.release()

    @contextlib.contextmanager
    def introduced(self, assignment: Assignment) -> Iterator[None]:
        """The workers, also those that come later, know of a run as long as this lasts. Raises SweepError."""
        try:
            self._introduce(assignment)
            yield
        finally:
            if not self._gone:
                with contextlib.suppress(Exception):
                    self._client.unregister_worker_plugin(assignment.run)

    def _introduce(self, assignment: Assignment) -> None:
        try:
            for trial in range(1, TRIALS + 1):
                try:
                    self._client.register_plugin(Plugin(assignment), name=assignment.run)
                    return
                except OSError:
                    # a worker may have left at that moment
                    if trial == TRIALS:
                        raise
                    self._client.nthreads()
        except OSError as fault:
            raise self.lost(fault) from fault
        except Exception as fault:
            raise SweepError(
                f"cluster: a worker cannot take part ({type(fault).__name__}: {fault}); every machine of the cluster "
                "needs the same version of foliot"
            ) from fault

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

    def lost(self, fault: BaseException) -> Incomplete:
        """What is reported where the scheduler does not answer any more; it is not asked again."""
        self._gone = True
        return Incomplete(
            f"cluster: the scheduler is lost ({_reason(fault)}); what is finished is kept, run the same command again "
            "to continue"
        )


def _connected(address: Any) -> Any:
    """A client of its own for an address, a scheduler file or a cluster. Raises SweepError."""
    if isinstance(address, str) and not address.strip():
        raise SweepError("cluster: expected an address such as tcp://10.0.0.1:8786, found nothing")
    keys: dict[str, Any] = {"address": address}
    if isinstance(address, str | Path) and str(address).endswith(".json"):
        if not Path(address).is_file():
            raise SweepError(f"cluster: there is no scheduler file {address}")
        keys = {"scheduler_file": str(address)}
    if isinstance(address, str):
        # one clear message is ours to give
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        return distributed.Client(**keys, timeout=CONNECT_SECONDS, set_as_default=False)
    except Exception as fault:
        reason = _reason(fault)
    # the half-made client ends here and now: if it did while another one begins, each would wait for the other
    gc.collect()
    raise SweepError(f"cluster: no dask scheduler answers at {address} ({reason})")


def _reason(fault: BaseException) -> str:
    """The first line of what a fault says; its kind where that is empty."""
    return str(fault).partition("\n")[0] or type(fault).__name__
