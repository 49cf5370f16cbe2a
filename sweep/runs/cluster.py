"""The workers of a dask scheduler: `--cluster tcp://...`, or a `Client` passed to `run`. Imports distributed.

A worker receives the description of the run, makes its own bench, and computes blocks on it as a thread here would. If
it sees the file of the result, it writes the blocks there and returns their digests; otherwise it returns the numbers.
dask unpickles what its processes send each other: whoever can reach a scheduler can run code on its workers, so
restrict access to it, or use its TLS. Nothing is unpickled from files.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import math
import os
import socket
import sys
import threading
import time
import weakref
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Future
from pathlib import Path
from typing import Any

import distributed

from sweep.cells.block import Bench, Done, Found, faults_reported
from sweep.cells.fingerprint import difference, fingerprint
from sweep.errors import Incomplete, SweepError, reason
from sweep.file import disk
from sweep.file.reading import StoredFile
from sweep.runs.isolate import Processes
from sweep.runs.progress import log
from sweep.study.model import Study

CONNECT_SECONDS = 10


class Cluster:
    """The workers of a dask scheduler. To be used in a `with` statement. Raises SweepError where none answers.

    Its address is "tcp://10.0.0.1:8786", the path of a scheduler file, `*.json`, a cluster of dask's, or a Client,
    which is not closed. `note` is told where there are no workers, which are waited for: batch systems may take hours.
    """

    def __init__(self, address: Any, note: Callable[[str], None]) -> None:
        self._own, self._note = not isinstance(address, distributed.Client), note
        self._client = _connected(address) if self._own else address
        if self._client.asynchronous:
            raise SweepError("cluster: the client is asynchronous; pass one that is not")
        self.threads, self._looked = -1, -math.inf
        self._suspects = asyncio.Lock()

    def __enter__(self) -> Cluster:
        self.look()
        return self

    def __exit__(self, *fault: object) -> None:
        if self._own:
            with contextlib.suppress(Exception):
                self._client.close(timeout=CONNECT_SECONDS if self._client.status == "running" else 0.1)

    def look(self) -> None:
        """Counts the threads of all workers, now and then. Raises SweepError."""
        if time.monotonic() - self._looked < 2.0:
            return
        try:
            threads = sum(self._client.nthreads().values())
        except Exception as fault:
            raise _lost(fault) from fault
        if threads != self.threads:
            log(f"the cluster has {threads} threads", "workers", threads=threads)
            if not threads:
                self._note("the cluster has no workers; waiting for the first")
        self.threads, self._looked = threads, time.monotonic()

    def begin(self, *words: Any) -> None:
        """Tells the workers what is to be computed, as `Remote` takes it, which dask makes where it is needed."""
        paths = [str(Path(path).resolve()) for path in sys.path]
        self._remote = self._client.submit(Remote, *words, paths, pure=False)

    def submit(self, job: int, wanted: Any, label: str) -> Future[Done]:
        """A future of a block that a worker computes, whose result may raise SweepError; cancelled, it is given up.

        That of `client.get_executor()` trips over a task that fails with its worker and is answered at that moment.
        dask blames a worker's death on every block that waited there, so those given up are tried again one by one.
        """

        def ask() -> Any:
            return self._client.submit(Remote.compute, self._remote, job, wanted, pure=False)

        async def settled(asked: Any) -> Done:
            try:
                try:
                    return await answer(asked)
                except distributed.KilledWorker:
                    async with self._suspects:
                        return await answer(ask())
            except SweepError:
                raise
            except (CancelledError, OSError) as fault:
                raise _lost(fault) from fault
            except Exception as fault:
                what = f"{label} cannot be computed ({type(fault).__name__}: {fault}); what is finished is kept"
                raise SweepError(f"cluster: {what}; isolated, a cell of which its process dies is FAILED") from fault

        try:
            return asyncio.run_coroutine_threadsafe(settled(ask()), self._client.loop.asyncio_loop)
        except Exception as fault:
            raise _lost(fault) from fault


async def answer(asked: Any) -> Done:
    """The result of dask's future, which is let go of where this is cancelled.

    dask fetches many results at once. Cancelled while it waits for those, it would answer nobody any more.
    """
    waiting = asyncio.ensure_future(asked)
    try:
        return await asyncio.shield(waiting)
    except asyncio.CancelledError:
        waiting.add_done_callback(lambda done: done.cancelled() or done.exception())  # else it is told on stderr
        asked.release()
        raise


def _lost(fault: BaseException) -> Incomplete:
    """What is reported where the scheduler does not answer any more."""
    return Incomplete(
        f"cluster: the scheduler is lost ({reason(fault)}); what is finished is kept, run the same command again to "
        "continue"
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
        why = reason(fault)
    # the half-made client ends here and now: if it did while another one begins, each would wait for the other
    gc.collect()
    raise SweepError(f"cluster: no dask scheduler answers at {address} ({why})")


class Remote:
    """A run as a worker knows it, and where its blocks go; where dask moves it to, it is made anew.

    Of the study as JSON; its fingerprint where the run was started (a worker with another one refuses); how the rows
    are cut; the file that blocks are to be written to (None: their numbers are sent); limit and cost of `Processes`
    (None: no isolation); where to look for the module of a kernel of the user's own, which the study was allowed to
    run.
    """

    def __init__(self, *words: Any) -> None:
        self._words, self._turn = words, threading.Lock()
        self._bench: Bench | None = None
        self._file: StoredFile | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return Remote, self._words

    def compute(self, job: int, wanted: Any) -> Done:
        """Computes a block. Raises SweepError."""
        where = f"worker on {socket.gethostname()}"
        with self._turn, faults_reported(where):
            self._bench = self._bench or self._begun(where)
        return self._bench.compute(job, self._put, wanted)

    def _begun(self, where: str) -> Bench:
        """Loads the kernel. Raises SweepError where what computes here is not what was asked for."""
        text, mark, partition, shared, isolated, paths = self._words
        if ":" in mark["kernel"]:
            sys.path.extend(path for path in paths if path not in sys.path and Path(path).is_dir())
        try:
            study = Study.from_json(text, allow_import=True)
            changed = difference(mark, fingerprint(study))
        except SweepError as fault:
            raise SweepError(f"{where}: {fault}") from None
        if changed:
            raise SweepError(
                f"{where}: its kernel or its libraries are not those here; install the same versions on every "
                "machine" + "".join(f"\n  {line}" for line in changed)
            )
        processes = None if isolated is None else Processes(study, *isolated)
        if processes is not None:
            weakref.finalize(self, processes.end)
        if shared is not None:
            path, key = shared
            with contextlib.suppress(OSError, SweepError):  # it is not seen here, or may not be written
                self._file = StoredFile(path, os.O_RDWR, key)
        return Bench(study, partition, processes)

    def _put(self, job: int, arrays: Mapping[str, Any]) -> Found:
        """The digests of what is written, and on the disk; or the numbers, which lie where nothing else will."""
        file = self._file
        if file is None:
            return {name: column.copy() for name, column in arrays.items()}
        with disk.refusing(file.path):
            digests = file.work.write(job, arrays)
            disk.fsync(file.fd)
        return digests
