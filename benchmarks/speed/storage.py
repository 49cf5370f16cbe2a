"""How close to the disk does a run write, and what does it cost to keep what is finished?

    python benchmarks/speed/storage.py [FOLDER] [--million 8] [--dear 60] [--only dear] [--rounds 5]

A cheap kernel, every output stored: the run is compared with the kernel alone and one plain write of the same bytes,
fsync included, taken in turn with it. Then peak disk; dear cells stored against the kernel alone; what is left of many
blocks; reading with digests compared, without, by h5py, and summing lazily, with the memory that takes. All on the
folder given (default: here). Disks differ from minute to minute: look at the spread, not at one figure.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np
from engine import disk_seconds, foliot, kernel_seconds, run_seconds, seconds

import sweep
from sweep.cells.fingerprint import fingerprint
from sweep.cells.partition import boxes
from sweep.cells.reduce import output_schema
from sweep.cells.schema import columns
from sweep.cells.timing import BLOCK_BYTES, sampled_study
from sweep.file import disk
from sweep.file.frame import cuts_of
from sweep.file.reading import StoredFile
from sweep.file.store import alone, earlier, unfinished_of
from sweep.file.store import begun as made
from sweep.study.model import Study

STEPS = ("kernel", "write once", "run")
DEAR = {"phi0": 1.0, "a": 1.0, "step": 1e-3}
"""A foliot that is followed in short steps,"""
DEAR_BLOCK = 256
"""and the cells of a block."""


def cheap(folder: Path, cells: int, rounds: int) -> None:
    """Run / (kernel + the bytes written once), by the clock and by the processors' seconds.

    In blocks of as many cells as a run has of so cheap a kernel on an idle machine, whatever else this one does.
    """
    study = foliot("closed", cells)
    sampled_study(study)
    each, path = sum(c.cell_bytes for c in columns(study)), folder / "cheap.h5"
    size, block = cells * each, BLOCK_BYTES // each
    for workers in (1, 2):
        ratios = []
        for _ in range(rounds):
            kernel = both(lambda workers=workers: kernel_seconds(study, workers))
            plain = both(lambda: disk_seconds(folder, size))
            whole = both(lambda workers=workers: run_seconds(study, path, workers, block))
            ratios.append(whole / (kernel + plain))
            told = [
                f"{name} {clock:.2f} s ({cpu:.2f})"
                for name, (clock, cpu) in zip(STEPS, (kernel, plain, whole), strict=True)
            ]
            print(f"  {workers} workers, {size / 1e6:.0f} MB: {', '.join(told)}")
        clock, cpu = np.median(ratios, axis=0)
        print(f"{cells:.0e} cells, {workers} workers: run / (kernel + write once), median {clock:.2f} ({cpu:.2f})")


def both(measure: Callable[[], float]) -> Any:
    """Seconds by the clock, as measured, and of the processors."""
    begun = time.process_time()
    return np.array([measure(), time.process_time() - begun])


def peak(folder: Path, cells: int) -> None:
    """Bytes that are on the disk at any time, over those of the result."""
    path, most, over = folder / "peak.h5", [0], threading.Event()

    def look() -> None:
        while not over.is_set():
            sizes = []
            for entry in folder.iterdir():
                with_blocks = entry.stat() if entry.exists() else None
                sizes.append(512 * with_blocks.st_blocks if with_blocks else 0)
            most[0] = max(most[0], sum(sizes))
            time.sleep(0.005)

    watcher = threading.Thread(target=look)
    watcher.start()
    sweep.run(foliot("closed", cells), path, workers=2, progress=False).close()
    over.set()
    watcher.join()
    print(f"peak disk / result: {most[0] / path.stat().st_size:.3f}")
    path.unlink()


def dear(folder: Path, whole: float, rounds: int) -> None:
    """Processor time of a stored run of dear cells (milliseconds) over that of the kernel alone, in turn.

    In blocks of the same length, for in longer ones fewer lanes wait. A run takes some 0.13 s beside its cells: a third
    to open the result as a Dataset, a quarter to make the frame, the rest for the fingerprint of all sources; and three
    calls of up to 16 cells for the timed sample. What is imported once, a second, is imported before.
    """

    def study(cells: int) -> Study:
        axes = {"mu": np.geomspace(1.0, 10.0, cells)}
        return sweep.study(kernel="foliot_steps", method="rk4", axes=axes, fixed=DEAR)

    trial = study(64)
    sweep.run(trial, folder / "dear.h5", progress=False).close()  # compiles and imports
    (folder / "dear.h5").unlink()
    kernel_seconds(trial, 1, 64)
    begun = time.process_time()
    kernel_seconds(trial, 1, 64)
    each = (time.process_time() - begun) / 64
    asked, ratios = study(max(64, int(whole / each))), []
    for _ in range(rounds):
        begun = time.process_time()
        kernel_seconds(asked, 1, DEAR_BLOCK)
        middle = time.process_time()
        sweep.run(asked, folder / "dear.h5", workers=1, block_cells=DEAR_BLOCK, progress=False).close()
        (folder / "dear.h5").unlink()
        ratios.append((time.process_time() - middle) / (middle - begun))
        print(f"  {middle - begun:.1f} s, {1e3 * each:.2f} ms a cell: {ratios[-1]:.4f}", flush=True)
    print(f"dear cells: stored run / kernel, processor time, median {np.median(ratios):.3f}")


def many(folder: Path, count: int) -> None:
    """What is left of many blocks, all but one of which are done."""
    study, path = foliot("closed", 100 * count), folder / "many.h5"
    mark = fingerprint(study)
    schema = output_schema(study, mark)
    cuts = cuts_of(study, schema, boxes(schema.shape, 100))
    begun = time.perf_counter()
    with alone(path), made(path, schema, cuts) as store:
        framed, table = time.perf_counter() - begun, store.work
        table.write_digests(dict.fromkeys(range(table.blocks.count - 1), b"x" * table.row_bytes))
    begun = time.perf_counter()
    with alone(path), earlier(path, mark) as store:
        store.resume(())
        left = store.missing()
        taken = time.perf_counter() - begun
    assert left == [table.blocks.count - 1]
    print(f"{table.blocks.count} blocks: frame made in {framed:.2f} s, what is left is known after {taken:.3f} s")
    unfinished_of(path).unlink()


def reading(folder: Path, cells: int, rounds: int) -> None:
    """Processor and wall time of reading a result: with its digests compared, without, in chunks by dask, by h5py."""
    study, path = foliot("closed", cells), folder / "read.h5"
    sweep.run(study, path, progress=False).close()
    with sweep.open_result(path) as found, StoredFile(path) as stored, h5py.File(path) as plain:
        ways = {
            "checked": found.compute,
            "unchecked": lambda: unchecked(stored),
            "by h5py": lambda: [plain[name][...] for name in found.data_vars],
            "lazily summed": found.chunk("auto").sum().compute,
        }
        for _ in range(rounds):
            told = []
            for name, way in ways.items():
                begun = time.process_time()
                wall = seconds(way)
                told.append(f"{name} {wall:.2f} s (processor {time.process_time() - begun:.2f})")
            print(f"reading {path.stat().st_size / 1e6:.0f} MB: {', '.join(told)}")
    peak = int(subprocess.run([sys.executable, "-c", PEAK, path], capture_output=True, check=True).stdout)
    print(f"summed lazily, of {path.stat().st_size / 1e6:.0f} MB: {peak / 1e6:.0f} MB more memory at most")
    path.unlink()


def unchecked(file: StoredFile) -> None:
    """The same chunks, read into arrays, and not looked at."""
    table = file.tables["cells"]
    bounds = [table.blocks.bounds(block) for block in range(table.blocks.count)]
    for column in table.columns.values():
        numbers = np.empty((table.blocks.size, *column.own), column.dtype)
        for block, cells in enumerate(bounds):
            disk.read_all(file.fd, (numbers[slice(*cells)],), int(column.at[block]))


PEAK = """
import sys
import dask
from sweep.file import open as opening

def most():
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))

opening.memory = lambda: 1
dask.config.set({"array.chunk-size": "16MiB"})
found = opening.open_result(sys.argv[1])
before = most()
found.sum().compute()
print(1024 * (most() - before))
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path())
    parser.add_argument("--million", type=float, default=8.0, help="millions of cells stored")
    parser.add_argument("--dear", type=float, default=16.0, help="seconds of dear cells")
    parser.add_argument("--only", choices=("cheap", "peak", "dear", "many", "reading"), help="one measurement alone")
    parser.add_argument("--blocks", type=int, default=100_000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    cells = int(options.million * 1e6)
    with TemporaryDirectory(dir=options.folder) as name:
        folder = Path(name)
        measurements = {
            "cheap": lambda: cheap(folder, cells, options.rounds),
            "peak": lambda: peak(folder, cells),
            "dear": lambda: dear(folder, options.dear, options.rounds),
            "many": lambda: many(folder, options.blocks),
            "reading": lambda: reading(folder, cells, 2),
        }
        for name, measure in measurements.items():
            if options.only in (None, name):
                measure()


if __name__ == "__main__":
    sys.exit(main())
