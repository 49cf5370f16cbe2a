"""Sweeps larger than memory: what a summary of many cells takes.

    python benchmarks/speed/summary.py [FOLDER] [--million 100]

Prints, all measured in this run and in processes of their own: the peak of resident memory over that of a sweep of a
million cells; the processor time against that of the kernel alone on buffers that are used again; the
forecast of `sweep plan` against what came.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from engine import kernel_seconds

import sweep
from sweep.cells.timing import sampled_study
from sweep.results.statuses import account
from sweep.study.model import Study

REDUCTIONS = {"plain": ["min", "max", "mean", "argmin"], "histogram": ["min", "max", "mean", "argmin", "histogram"]}


def foliot(cells: int, kind: str = "plain") -> Study:
    """A foliot with viscous friction; `kind` "cells" keeps every cell."""
    summary: dict[str, object] = {"outputs": {"period": REDUCTIONS.get(kind, [])}}
    if kind == "histogram":
        summary["edges"] = {"period": {"spacing": "log", "start": 1e-3, "stop": 1e6, "num": 91}}
    keys: dict[str, object] = {} if kind == "cells" else {"summary": summary}
    return sweep.study(
        kernel="foliot",
        method="closed",
        outputs=["period"],
        axes={"mu": np.geomspace(1e-4, 1e6, cells // 1000), "a": np.geomspace(0.1, 10, 1000)},
        fixed={"phi0": 1.0},
        **keys,
    )


def one(folder: Path, cells: int, kind: str) -> None:
    """A run in this process; prints its figures as JSON."""
    study, path = foliot(cells, kind), folder / "summary.h5"
    plan = sweep.plan(study, path=path)
    begun, cpu = time.perf_counter(), time.process_time()
    with sweep.run(study, path, progress=False) as dataset:
        assert account(dataset).total == cells
    found = {
        "seconds": time.perf_counter() - begun,
        "cpu": time.process_time() - cpu,
        "forecast": plan.seconds,
        "bytes": path.stat().st_size,
        "forecast_bytes": plan.output_bytes,
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    path.unlink()
    print(json.dumps(found))


def measured(folder: Path, cells: int, kind: str) -> dict[str, float]:
    """The same in a process of its own."""
    words = [sys.executable, __file__, str(folder), "--one", str(cells), "--kind", kind]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found


def size(folder: Path, cells: int, kind: str) -> None:
    small, large = measured(folder, 10**6, kind), measured(folder, cells, kind)
    sample = min(cells, 2 * 10**7)
    cells = foliot(sample, "cells")
    sampled_study(cells)
    begun = time.process_time()
    kernel_seconds(foliot(sample, "cells"), 1)
    kernel = (time.process_time() - begun) * cells / sample
    print(
        f"{kind}, {cells:.0e} cells: {large['seconds']:.1f} s; processor time {large['cpu']:.1f} s, "
        f"{large['cpu'] / kernel:.2f} times the bare kernel's {kernel:.1f} s; peak {large['megabytes']:.0f} MB, "
        f"{large['megabytes'] - small['megabytes']:.0f} MB over that of 1e6 cells; forecast {large['forecast']:.1f} s "
        f"({large['forecast'] / large['seconds'] - 1:+.0%}), bytes {large['forecast_bytes'] / large['bytes'] - 1:+.1%}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path())
    parser.add_argument("--million", type=float, default=100.0, help="millions of cells")
    parser.add_argument("--kind", default="plain")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        one(options.folder, options.one, options.kind)
        return
    with TemporaryDirectory(dir=options.folder) as folder:
        for kind in REDUCTIONS if options.million else ():
            size(Path(folder), int(options.million * 1e6), kind)


if __name__ == "__main__":
    main()
