"""A dask scheduler with worker processes on this machine, in a process of its own that can be killed."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent

SERVE = """
import sys
import dask
from distributed import LocalCluster

if __name__ == "__main__":
    workers, threads, failures = map(int, sys.argv[1:])
    dask.config.set({
        "distributed.scheduler.allowed-failures": failures,
        "distributed.worker.profile.enabled": False,
        "distributed.nanny.pre-spawn-environ.PYTHONPATH": __import__("os").environ["PYTHONPATH"],
    })
    cluster = LocalCluster(n_workers=workers, threads_per_worker=threads, processes=True, host="127.0.0.1",
                           dashboard_address=None, silence_logs=50)
    print(cluster.scheduler_address, flush=True)
    sys.stdin.read()
    cluster.close()
"""


@contextlib.contextmanager
def served(workers=2, threads=1, failures=1):
    """Address of the scheduler, and the process that it, and through it the workers, live in."""
    paths = [str(HERE.parents[1]), str(HERE), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p)}
    process = subprocess.Popen(
        [sys.executable, "-c", SERVE, *map(str, (workers, threads, failures))],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment, text=True,
        start_new_session=True,
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        yield process.stdout.readline().strip(), process
    finally:
        # left to itself it tidies up after its workers
        with contextlib.suppress(OSError):
            process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(20)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()
