"""Is the scheduler what one waits for at 1e5 blocks, and what do workers that are killed cost?

    python benchmarks/soak/cluster.py [--blocks 100000] [--stored 5000] [--kills 20] [--seed 1]

A real dask scheduler with two worker processes on this machine. First blocks of one cell that costs next to nothing
(nothing but overhead), in memory; then blocks that are stored, by the workers and, for comparison, by two threads
here; then a run of slow blocks whose workers are killed (SIGKILL) at random moments, which must end with the same bits.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import signal
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2] / "tests" / "helpers")]

import numpy as np  # noqa: E402
import slow  # noqa: E402
import toy_studies  # noqa: E402
from clusters import served  # noqa: E402
from distributed import Client  # noqa: E402

from sweep.runs.run import run  # noqa: E402


def falls(count: int, kernel: str = "toy:KERNEL"):
    return toy_studies.build(kernel=kernel, axes={"height": np.arange(1.0, count + 1)})


def timed(study, path=None, **keys) -> float:
    begun = time.monotonic()
    run(study, path, progress=False, block_cells=1, **keys).close()
    return time.monotonic() - begun


def killing(client: Client, kills: int, rng: random.Random, ended: threading.Event, done: list[int]) -> None:
    """Kills a worker now and then, whenever there are two."""
    while len(done) < kills and not ended.is_set():
        ended.wait(rng.uniform(0.2, 3.0))
        with contextlib.suppress(Exception):
            found = list(client.run(os.getpid).values())
            if len(found) > 1:
                os.kill(rng.choice(found), signal.SIGKILL)
                done.append(1)


def tormented(path: Path, kills: int, rng: random.Random) -> tuple[int, bool]:
    """A run of slow blocks whose workers are killed: how many were, and whether it ended with the same bits.

    Each has a cluster of its own: a worker that is killed while it starts is not replaced.
    """
    with served(workers=2, failures=10) as (address, _), Client(address, set_as_default=False) as client:
        return _tormented(client, path, kills, rng)


def _tormented(client: Client, path: Path, kills: int, rng: random.Random) -> tuple[int, bool]:
    ended, done = threading.Event(), []
    killer = threading.Thread(target=killing, args=(client, kills, rng, ended, done))
    killer.start()
    study, seconds = falls(10_000, "slow:SLOW"), slow.CELL_SECONDS
    try:
        found = run(study, path, cluster=client, block_cells=20, progress=False)
    finally:
        ended.set()
        killer.join()
    slow.CELL_SECONDS = 0.0
    whole = run(study, progress=False)
    slow.CELL_SECONDS = seconds
    same = all(found[n].values.tobytes() == whole[n].values.tobytes() for n in whole.data_vars)
    found.close()
    path.unlink()
    return len(done), same


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--blocks", type=int, default=100_000)
    arguments.add_argument("--stored", type=int, default=5000)
    arguments.add_argument("--kills", type=int, default=20)
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    with (
        served(workers=2, failures=10) as (address, _),
        Client(address, set_as_default=False) as client,
        tempfile.TemporaryDirectory() as name,
    ):
        folder = Path(name)
        timed(falls(10), cluster=client)
        seconds = timed(falls(given.blocks), cluster=client)
        each = 1e6 * seconds / given.blocks
        here = timed(falls(given.blocks), workers=2)
        print(f"{given.blocks} blocks in memory: {seconds:.1f} s, {each:.0f} us a block")
        print(f"  by two threads here: {here:.1f} s; ratio {seconds / here:.2f}")
        elsewhere = timed(falls(given.stored), folder / "cluster.h5", cluster=client)
        print(f"{given.stored} blocks stored by two workers: {elsewhere:.1f} s")
        here = timed(falls(given.stored), folder / "here.h5", workers=2)
        print(f"{given.stored} blocks stored by two threads here: {here:.1f} s; ratio {elsewhere / here:.2f}")
    with tempfile.TemporaryDirectory() as name:
        runs, killed, different, begun = 0, 0, 0, time.monotonic()
        rng = random.Random(given.seed)
        while killed < given.kills:
            more, same = tormented(Path(name) / "out.h5", given.kills - killed, rng)
            runs, killed, different = runs + 1, killed + more, different + (not same)
    print(f"{killed} workers killed in {runs} runs, {time.monotonic() - begun:.0f} s; with other bits: {different}")
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main())
