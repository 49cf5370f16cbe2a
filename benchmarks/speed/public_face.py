# What does a user of `sweep.run` and `sweep.solver` pay beside the kernel?
"""Time of `sweep.run` as fixed + c times the kernel's own on the same columns; prints figures of this run:

python benchmarks/speed/public_face.py [FOLDER] [--seconds 1] [--rounds 5] [--methods NAME ...]

Two built-in kernels, and each method of a scene of one's own; the kernel is called once, with all columns, by one
thread, into new arrays, and the run is given one worker. `fixed` is what a run of `FEW` cells takes beyond the kernel;
c is (run - fixed)/kernel where the kernel takes as many seconds as are wanted; both in memory and to a file in FOLDER
(default: here). Times are seconds of the processor that this process uses in all its threads, the least of some rounds
in turn. The last lines: one cell by `sweep.solver`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import sweep
from sweep.cells.grid import Grid
from sweep.study.model import Study

FEW, TRIED = 400, 4096
CASES = {
    "foliot": ("segments", {"mu": (0.1, 10.0), "a": (0.1, 1.0)}, {"phi0": 1.0, "R": 0.01}),
    "impact": (
        "events", {"torque": (1e-4, 1e-2), "e": (0.1, 0.5)},
        {"I_c": 4e-5, "I_v": 1e-5, "r_c": 0.03, "r_v": 0.03, "teeth": 31.0, "h": 0.0},
    ),
    "own_scenes:VAN_DER_POL_RELAY": ("", {"eps": (0.1, 1.0), "drive": (0.2, 1.0)}, {"flips": 20.0}),
}  # fmt: skip
SCENE = "own_scenes:VAN_DER_POL_RELAY"


def study(kernel: str, method: str, cells: int) -> Study:
    """A square grid of about so many cells."""
    _, ranges, fixed = CASES[kernel]
    side = max(2, round(cells**0.5))
    axes = {name: np.geomspace(*ends, side) for name, ends in ranges.items()}
    return sweep.study(kernel=kernel, allow_import=True, method=method, rtol=1e-8, axes=axes, fixed=fixed)


def seconds(action: Callable[[], object]) -> float:
    """Of a processor."""
    begun = time.process_time()
    action()
    return time.process_time() - begun


def kernel_of(chosen: Study) -> Callable[[], object]:
    """One call of the method with all cells of a study."""
    grid, method = Grid(chosen), chosen.kernel.method(chosen.method)
    columns = [np.empty(grid.size) for _ in chosen.kernel.parameters]
    for place, value in grid.constants().items():
        columns[place][:] = value
    grid.columns(0, grid.size, columns)
    estimates = method.estimates

    def solve() -> None:
        outputs = [np.empty(grid.size) for _ in chosen.kernel.outputs]
        asked = [np.ones(len(outputs), np.uint8)] if estimates else []
        errors = [np.empty(grid.size)] if estimates else []
        status = np.empty(grid.size, np.int8)
        method.solve(*columns, np.full(grid.size, chosen.rtol), *asked, *outputs, *errors, status)

    return solve


def least(chosen: Study, path: Path, rounds: int) -> tuple[float, float, float]:
    """Of the kernel, of a run in memory, and of one to a file."""

    def stored() -> None:
        sweep.run(chosen, path, workers=1, progress=False).close()
        path.unlink()

    kernel = kernel_of(chosen)
    ways = (kernel, lambda: sweep.run(chosen, workers=1, progress=False), stored)
    times = np.array([[seconds(way) for way in ways] for _ in range(1 + rounds)])
    of_kernel, in_memory, to_file = times[1:].min(axis=0)
    return of_kernel, in_memory, to_file


def run_cost(kernel: str, method: str, path: Path, wanted: float, rounds: int) -> None:
    """Prints fixed and c of a method."""
    tried = study(kernel, method, TRIED)
    whole = kernel_of(tried)
    whole()  # compiled
    cells = Grid(tried).size * wanted / seconds(whole)
    small, *few = least(study(kernel, method, FEW), path, rounds)
    large, *many = least(study(kernel, method, int(cells)), path, rounds)
    fixed = [run - small for run in few]
    shares = [(run - more) / large for run, more in zip(many, fixed, strict=True)]
    memory, file = (f"{1e3 * more:6.1f} ms + {share:5.3f}" for more, share in zip(fixed, shares, strict=True))
    about = f"{label(kernel, method)}{1e6 * large / cells:9.2f} us a cell, {large:5.2f} s"
    print(f"{about}   in memory {memory}   file {file}", flush=True)


def label(kernel: str, method: str) -> str:
    """What a line is about."""
    return f"{kernel.partition(':')[2] or kernel:20}{method:14}"


def one_cell(kernel: str, method: str, rounds: int) -> None:
    """Prints what one cell by `sweep.solver` takes."""
    point = sweep.solver(study(kernel, method, 4))
    middle = [float(np.sqrt(low * high)) for low, high in CASES[kernel][1].values()]
    point(*middle)
    taken = min(seconds(lambda: [point(*middle) for _ in range(20)]) for _ in range(rounds)) / 20
    print(f"{label(kernel, method)} one cell by sweep.solver {1e3 * taken:8.3f} ms", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path())
    parser.add_argument("--seconds", type=float, default=1.0, help="of the kernel")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--methods", nargs="*", help="only these")
    options = parser.parse_args()
    scene = sweep.study(kernel=SCENE, allow_import=True, axes={"eps": [0.5]}, fixed={"drive": 0.5})
    methods = [(name, case[0]) for name, case in CASES.items() if case[0]]
    methods += [(SCENE, method.name) for method in scene.kernel.methods]
    chosen = [pair for pair in methods if not options.methods or pair[1] in options.methods]
    with TemporaryDirectory(dir=options.folder) as folder:
        for kernel, method in chosen:
            run_cost(kernel, method, Path(folder) / "out.h5", options.seconds, options.rounds)
    for kernel, method in chosen:
        one_cell(kernel, method, options.rounds)


if __name__ == "__main__":
    main()
