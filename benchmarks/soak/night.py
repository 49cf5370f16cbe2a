"""Nights with a bad kernel: does each bad cell cost that cell, whatever is killed meanwhile?

    python benchmarks/soak/night.py [--minutes 120] [--cells 4000] [--kill-every 20] [--seed 1]

A kernel of one's own that raises, crashes, exits, hangs (also without ever letting Python run), leaks memory, writes
NaN or refuses, at cells scattered over the grid. The command computes it; it and the processes in which it solves cells
are killed (SIGKILL) at random moments, it is told to stop (SIGTERM, Ctrl-C) at others, and is continued until it is
complete. Then each cell must be ok, refused or FAILED as its kernel meant, and the good ones must have the bits of a
run without bad ones. Prints the account; exit status 1 where anything is wrong.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

HELPERS = Path(__file__).parents[2] / "tests" / "helpers"
sys.path[:0] = [str(HELPERS)]

import night_kernel  # noqa: E402
import numpy as np  # noqa: E402
import psutil  # noqa: E402
import toy_studies  # noqa: E402

import sweep  # noqa: E402
from kernels.interface import Status  # noqa: E402
from sweep.results.statuses import account  # noqa: E402
from sweep.runs.progress import log_path  # noqa: E402

STUDY = """
kernel = "night_kernel:NIGHT"
outputs = ["fall_time"]
[axes.height]
spacing = "linear"
start = {first}
stop = {last}
num = {cells}
"""
EXPECTED = {"": Status.OK, "leaks": Status.OK, "is refused": Status.STICKS}
STOPPED = {3, 130, 143, -signal.SIGKILL, -signal.SIGTERM, -signal.SIGINT}
"""How a run may end that is to be continued; by the signal itself where that came before anything listened to it."""
BLOWS = {"the run": signal.SIGKILL, "SIGTERM": signal.SIGTERM, "Ctrl-C": signal.SIGINT, "a process": None}


class Night:
    """One sweep, from its beginning to its end, however often it is killed."""

    def __init__(self, folder: Path, first: int, given: argparse.Namespace, rng: random.Random, end: float) -> None:
        self.output, self.given, self.rng, self.end = folder / "night.h5", given, rng, end
        self.heights = np.arange(float(first), first + given.cells)
        (folder / "night.toml").write_text(STUDY.format(first=first, last=first + given.cells - 1, cells=given.cells))
        words = ["run", "night.toml", "--allow-import", "--cell-timeout", f"{given.cell_timeout}s"]
        self.words, self.folder = [sys.executable, "-m", "sweep", *words], folder
        self.done: Counter[str] = Counter()
        self.late = 0.0

    def run(self) -> None:
        """Until it is complete."""
        while (code := self._once()) not in (0, 4):
            if code not in STOPPED:
                log = log_path(self.output)
                print(*(log.read_text().splitlines()[-3:] if log.exists() else ["no log"]), sep="\n", flush=True)
                self.done[f"wrong: ended with {code}"] += 1
                return

    def _once(self) -> int:
        paths = [
            str(Path(__file__).parents[2]),
            str(HELPERS),
            str(Path(__file__).parent),
            os.environ.get("PYTHONPATH", ""),
        ]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        with subprocess.Popen(self.words, cwd=self.folder, env=environment, stdout=-3, stderr=-3) as process:
            while process.poll() is None:
                try:
                    process.wait(self.rng.expovariate(1 / self.given.kill_every))
                except subprocess.TimeoutExpired:
                    if time.monotonic() < self.end:
                        self._strike(process)
            self.done["starts"] += 1
            return process.returncode

    def _strike(self, process: Any) -> None:
        """Kills the run or one of the processes in which cells are solved, or tells it to stop."""
        kind = self.rng.choice(list(BLOWS))
        self.done[f"blows: {kind}"] += 1
        blow, at = BLOWS[kind], time.monotonic()
        if blow is not None:
            process.send_signal(blow)
            process.wait()
            self.late = max(self.late, time.monotonic() - at)
            return
        # forkserver and resource tracker are its children, those who solve cells its children's
        below = [p for p in psutil.Process(process.pid).children(recursive=True) if p.ppid() != process.pid]
        if below:
            self.rng.choice(below).kill()

    def judged(self) -> Counter[str]:
        """What became of the cells, and what is wrong."""
        study = toy_studies.build(method="exact", axes={"height": self.heights}, outputs=["fall_time"])
        truth = sweep.run(study, progress=False).fall_time.values
        verdict = sweep.verify(self.output)
        with sweep.open_result(self.output) as found:
            told, status, times = account(found).by_kind, found.status.values, found.fall_time.values
        kinds = [night_kernel.deed(height) for height in self.heights]
        expected = np.array([EXPECTED.get(kind, Status.FAILED) for kind in kinds])
        good = expected == Status.OK
        self.done.update({"cells": sum(told.values()), **{kind: told[kind] for kind in ("ok", "refused", "FAILED")}})
        self.done.update(f"FAILED, for it {kind}" for kind in kinds if kind in night_kernel.FAILING)
        self.done["wrong: status"] += int((status != expected).sum())
        self.done["wrong: bits"] += int((times[good].view(np.int64) != truth[good].view(np.int64)).sum())
        self.done["wrong: numbers where there are none"] += int((~np.isnan(times[~good])).sum())
        self.done["wrong: file"] += not verdict.whole
        return self.done


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--cells", type=int, default=4000)
    parser.add_argument("--kill-every", type=float, default=20.0, help="seconds, on average")
    parser.add_argument("--cell-timeout", type=float, default=2.0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng, end = random.Random(given.seed), time.monotonic() + 60 * given.minutes
    total: Counter[str] = Counter()
    first, late = 1, 0.0
    while not total or time.monotonic() < end:
        with tempfile.TemporaryDirectory() as folder:
            night = Night(Path(folder), first, given, rng, end)
            night.run()
            total += night.judged()
            total["nights"] += 1
            first, late = first + given.cells, max(late, night.late)
    for name, count in sorted(total.items()):
        print(f"{name:32} {count:10,}")
    print(f"{'longest time to stop':32} {late:10.2f} s")
    wrong = sum(count for name, count in total.items() if name.startswith("wrong"))
    print("wrong" if wrong else "nothing is wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
