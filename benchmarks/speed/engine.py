"""What does the engine cost around the kernel? How close to the disk it writes, `storage.py` tells.

Prints ratios of times measured in one run, on the folder given (default: here):

    python benchmarks/speed/engine.py [FOLDER] [--million 8]
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import sweep
from sweep.cells.schema import columns, empty, part
from sweep.cells.solve import Solver
from sweep.cells.timing import sampled_study
from sweep.study.model import Study

PIECE = 32 << 20
ROUNDS = 5


def foliot(method: str, cells: int, **keys: object) -> Study:
    """A foliot with viscous friction, from weak to strong drive; the cost of a cell grows along the axis for `map`."""
    drives = np.geomspace(1e-4, 1e6, max(cells // 100, 2))
    return sweep.study(
        kernel="foliot",
        method=method,
        axes={"mu": drives, "a": np.geomspace(0.1, 10, 100)},
        fixed={"phi0": 1.0},
        **keys,
    )


def seconds(action: Callable[[], object]) -> float:
    begun = time.perf_counter()
    action()
    return time.perf_counter() - begun


def kernel_seconds(study: Study, workers: int, block: int = 1 << 16) -> float:
    """Time of the kernel alone on buffers that are used again, blocks pulled by threads."""
    size = int(np.prod([len(axis) for axis in study.axes.values()]))
    starts = iter(range(0, size, block))

    def pull() -> None:
        solver = Solver(study)
        arrays = empty(columns(study), block)
        for start in starts:
            solver.solve(start, part(arrays, slice(size - start)))

    with ThreadPoolExecutor(workers) as pool:
        return seconds(lambda: [future.result() for future in [pool.submit(pull) for _ in range(workers)]])


def run_seconds(study: Study, path: Path, workers: int | None, block: int | None = None) -> float:
    """Time of a whole run with an output, which is removed; of blocks of so many cells, or as a timed sample has it."""
    taken = seconds(lambda: sweep.run(study, path, workers=workers, block_cells=block, progress=False).close())
    path.unlink()
    return taken


def disk_seconds(folder: Path, size: int) -> float:
    """Time of writing so many bytes to one file, with fsync."""
    piece = np.random.default_rng(0).bytes(PIECE)
    path = folder / "plain"

    def write() -> None:
        with path.open("wb", buffering=0) as file:
            for start in range(0, size, PIECE):
                file.write(piece[: size - start])
            os.fsync(file.fileno())

    taken = seconds(write)
    path.unlink()
    return taken


def overhead(folder: Path, cells: int) -> None:
    """A kernel of more than a microsecond a cell: what the engine adds beyond 0.2 s, in memory and stored."""
    study = foliot("map", cells)
    sampled_study(study)
    workers = os.cpu_count() or 1
    path = folder / "overhead.h5"
    rows = [
        (
            kernel_seconds(study, workers, 4096),
            seconds(lambda: sweep.run(study, workers=workers, progress=False)),
            run_seconds(study, path, workers),
        )
        for _ in range(ROUNDS)
    ]
    kernel = np.median([row[0] for row in rows])
    print(f"overhead, {1e6 * kernel * workers / cells:.2f} us a cell, kernel {kernel:.2f} s, medians of {ROUNDS}:")
    for column, name in ((1, "in memory"), (2, "stored")):
        whole = np.median([row[column] for row in rows])
        ratio = np.median([(row[column] - 0.2) / row[0] for row in rows])
        print(f"  {name:9} {whole:.2f} s; (run - 0.2 s) / kernel = {ratio:.3f}")


def two_cores(cells: int) -> None:
    """One core against all on a grid whose cells cost unevenly, in memory."""
    workers, ratio = speedup(foliot("map", cells), ROUNDS)
    print(f"uneven grid: {workers} cores against one: {ratio:.2f} times")


def speedup(study: Study, rounds: int) -> tuple[int, float]:
    """The cores, and seconds of a whole run on one of them over those on all; the median of some rounds."""
    workers, ratios = os.cpu_count() or 1, []
    sweep.run(study, workers=workers, progress=False)  # compiled before it is timed
    for _ in range(rounds):
        one, all_ = (
            seconds(lambda number=number: sweep.run(study, workers=number, progress=False)) for number in (1, workers)
        )
        ratios.append(one / all_)
    return workers, float(np.median(ratios))


def small(folder: Path) -> None:
    """A study of a hundred cells: nearly all of it is the engine."""
    study = foliot("closed", 200)
    sampled_study(study)
    for turn in range(ROUNDS):
        path = folder / f"small{turn}.h5"
        memory = seconds(lambda: sweep.run(study, progress=False))
        whole = run_seconds(study, path, None)
        print(f"small study: in memory {1e3 * memory:.0f} ms, stored {1e3 * whole:.0f} ms")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path())
    parser.add_argument("--million", type=float, default=8.0, help="millions of cells stored (42 bytes each)")
    options = parser.parse_args()
    with TemporaryDirectory(dir=options.folder) as folder:
        small(Path(folder))
        overhead(Path(folder), int(options.million * 2e5))
        two_cores(int(options.million * 2e5))


if __name__ == "__main__":
    main()
