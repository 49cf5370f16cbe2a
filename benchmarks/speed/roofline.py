"""How near is every kernel to what this machine can do: arithmetic, memory, and what keeps it from more?

    python benchmarks/speed/roofline.py [KERNEL ...] [--cells 16] [--methods]

A row for each kernel's starter study, and the method that takes most of its cells by `auto` (`--methods`: for each
that can solve it). Times are processor time of one core, best of several; others on the machine still take clock and
cache. Kernels as `stepping` and `scene` make them of a scene of one's own are not in the catalogue.

- operations: of a cell, as `counted.py` counts them in the kernel's source run as plain Python, which has to give the
  same bits ("counted other bits" where it does not); a compiler may share what the source does twice;
- bytes: inputs and outputs of a cell as columns;
- peak, memory: ns a cell if every operation took as long as one of a vector's multiply-adds, or if bytes were copied;
- ratio: ns a cell over the larger of both. It is below 1 where additions and comparisons run beside multiplications;
- reason, of a ratio beyond 2, in ns a cell by speeds measured here: `single` all operations one number at a time, where
  a kernel goes cell by cell; `slow` its divisions and roots; `chain` the longest chain of operations that wait for one
  another, all lanes at once; `uneven` how many times longer cells take beside their neighbours than each beside its
  equals, since lanes wait for the last; `rest` where none of these does: loads, stores, spilled registers, masks;
- left: ns a cell over the largest of these, times `uneven`: what is loads, stores, masks, integers, branches.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import machine as machines
import numpy as np
from machine import Machine, seconds
from numpy.typing import NDArray

import sweep
from kernels import catalogue
from kernels.interface import FIRST_REFUSAL, Method
from sweep.cells.grid import Grid
from sweep.cells.schema import empty_cells
from sweep.cells.solve import Solver, usable_methods
from sweep.show.kernels import starter
from sweep.study.model import Study

LANES = 16
PASS = 0.2
"""Seconds of a timed pass, about: so many cells that what a call costs once is shared by thousands, as in a sweep."""
PASS_BYTES = 1 << 27
"""Bytes of the columns of a pass at most: more than a cache holds."""
PATIENCE = 5.0
"""Seconds after which no further cell of a row is counted; those that were are timed."""
FAR = 2.0
"""A ratio beyond which a row has a reason."""

Columns = list[NDArray[Any]]


class Counts(NamedTuple):
    """Operations of a cell by kind and its longest chain, means over the cells counted; a digest of their results."""

    operations: dict[str, float]
    chain: float
    cells: list[int]
    digest: str


class Timed(NamedTuple):
    """ns a cell; the same over that of cells beside their equals; whether many cells go at once."""

    cell: float
    uneven: float
    in_lanes: bool


def starter_study(name: str, cells: int) -> Study:
    """What `sweep kernels NAME --study` begins with, over so many values of a number."""
    keys = tomllib.loads(starter(name))
    for axis in keys["axes"].values():
        axis |= {"num": cells} if "num" in axis else {}
    return sweep.study(keys)


class Scene:
    """Cells of a study as a kernel's method takes them."""

    def __init__(self, study: Study, method: Method) -> None:
        self.study, self.method, grid = study, method, Grid(study)
        self.parameters = [np.empty((grid.size, *study.shape(field))) for field in study.kernel.parameters]
        for k, value in grid.constants().items():
            self.parameters[k][:] = value
        grid.columns(0, grid.size, self.parameters)

    def sound(self) -> list[int]:
        """Cells that the kernel's check lets pass."""
        status = np.empty(len(self.parameters[0]), np.int8)
        self.study.kernel.check(*self.parameters, status)
        return [int(cell) for cell in np.flatnonzero(status < FIRST_REFUSAL)]

    def columns(self, cells: Sequence[int] | NDArray[np.intp]) -> tuple[Columns, Columns]:
        """Inputs and outputs of cells, in any order and number."""
        study, n = self.study, len(cells)
        along = [np.array(study.along[field.name]) for field in study.kernel.along]
        asked = [np.array([field.name in study.outputs for field in study.kernel.outputs], np.uint8)]
        inputs = [*(column[cells] for column in self.parameters), np.full(n, study.rtol), *along]
        outputs: Columns = [np.empty((n, *study.shape(field))) for field in study.kernel.outputs]
        estimates = self.method.estimates
        error = [np.empty(n)] if estimates else []
        return inputs + asked * estimates, [*outputs, *error, np.empty(n, np.int8)]

    def bytes(self) -> float:
        """Of the columns of a cell; coordinates that all cells share are left out."""
        inputs, outputs = self.columns([0])
        own = [*inputs[: len(self.parameters) + 1], *outputs]
        return float(sum(column.nbytes for column in own))


def chosen(study: Study) -> tuple[str, list[int]]:
    """The method to which `auto` gives most cells, and which they are."""
    cells = empty_cells(study, Grid(study).size)
    Solver(study).solve(0, cells)
    used = cells["method_used"]
    number = int(np.bincount(used[used >= 0]).argmax())
    return study.kernel.methods[number].name, [int(cell) for cell in np.flatnonzero(used == number)]


def digest(outputs: Columns) -> str:
    """Of all bits that came out; one NaN is as good as another."""
    bits = hashlib.blake2b()
    for column in outputs:
        bits.update(np.where(column != column, np.nan, column).tobytes())
    return bits.hexdigest()


def count(name: str, size: int, method: str, cells: Sequence[int]) -> Counts:
    """Counts cells, spread over the study, as long as there is patience; in plain Python."""
    import counted

    counted.install()
    study = starter_study(name, size)
    scene = Scene(study, study.kernel.method(method))
    total: Counter[str] = Counter()
    done, found, begun = [], [], time.process_time()
    for cell in np.random.default_rng(1).permutation(cells):
        inputs, outputs = scene.columns([cell])
        counted.DONE.clear()
        with counted.counting_arrays():
            scene.method.solve(*(counted.counted(column) for column in (*inputs, *outputs)))
        total.update(counted.DONE)
        done.append(int(cell))
        found.append((int(cell), outputs))
        if time.process_time() - begun > PATIENCE:
            break
    results = [column for _, outputs in sorted(found, key=lambda pair: pair[0]) for column in outputs]
    mean = {kind: number / len(done) for kind, number in total.items()}
    return Counts(mean, mean.pop("chain", 0.0), sorted(done), digest(results))


def counted_apart(name: str, size: int, method: str, cells: Sequence[int]) -> Counts:
    """The same in a process of its own, without a compiler. Raises CalledProcessError."""
    words = [sys.executable, __file__, name, "--cells", str(size), "--count", method]
    plain = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(words, env=plain, input=json.dumps(cells), check=True, stdout=subprocess.PIPE, text=True)
    return Counts(*json.loads(done.stdout))


def timed(scene: Scene, cells: Sequence[int]) -> Timed:
    """Times a pass over the cells again and again, mixed and sorted; and of one cell alone against LANES of it."""

    def of(rows: NDArray[np.intp]) -> float:
        columns = [column for group in scene.columns(rows) for column in group]
        return seconds(lambda: scene.method.solve(*columns)) * 1e9

    some = np.array(cells)
    first = max(of(np.resize(some, LANES)) / LANES, 1e-3)
    times = int(min(PASS * 1e9 / first, PASS_BYTES / scene.bytes()) // len(some)) // LANES * LANES or LANES
    mixed, sorted_ = of(np.tile(some, times)), of(np.repeat(some, times))
    alone, together = of(some[:1]), of(np.repeat(some[:1], LANES))
    return Timed(mixed / times / len(some), mixed / sorted_, alone > 0.3 * together)


def same_bits(scene: Scene, counts: Counts) -> bool:
    """Whether the compiled method gives what the counted one did."""
    results: Columns = []
    inputs, outputs = scene.columns(counts.cells)
    scene.method.solve(*inputs, *outputs)
    for row in range(len(counts.cells)):
        results += [column[row : row + 1] for column in outputs]
    return digest(results) == counts.digest


def reasons(machine: Machine, counts: Counts, took: Timed, bound: float) -> tuple[str, float]:
    """What keeps a row from its bound, and how many times longer it takes than that explains."""
    speed = machine.vector if took.in_lanes else machine.single
    found = {
        "single": 0.0 if took.in_lanes else sum(counts.operations.values()) * speed["plain"],
        "slow": sum(counts.operations.get(kind, 0.0) * speed[kind] for kind in ("division", "root")),
        "chain": counts.chain * machine.link / (LANES if took.in_lanes else 1),
    }
    told = [f"{name} {value:.4g}" for name, value in found.items() if value > bound]
    told += [f"uneven x{took.uneven:.2f}"] if took.uneven > 1.1 else []
    explained = max(bound, *found.values()) * max(took.uneven, 1.0)
    return ", ".join(told) or "rest", took.cell / explained


def row(machine: Machine, name: str, size: int, method: str | None) -> str:
    """One line of the table."""
    study = starter_study(name, size)
    picked, cells = chosen(study) if method is None else (method, [])
    scene = Scene(study, study.kernel.method(picked))
    counts = counted_apart(name, size, picked, cells or scene.sound())
    took = timed(scene, counts.cells)
    operations = sum(counts.operations.values())
    peak, memory = operations * machine.vector["plain"], scene.bytes() * machine.byte
    bound = max(peak, memory)
    why, left = reasons(machine, counts, took, bound)
    ratio = took.cell / bound
    end = f" {left:6.2f}  {why}" if ratio > FAR else ""
    other = "" if same_bits(scene, counts) else "  (counted other bits)"
    figures = f"{operations:11.0f} {scene.bytes():8.0f} {took.cell:11.1f} {peak:10.1f} {memory:8.1f} {ratio:7.1f}"
    return f"{name:19} {picked:10} {figures}{end}{other}"


def table(names: Sequence[str], size: int, every: bool) -> None:
    """Prints the machine and the rows."""
    machine = machines.measured()
    for title, speed in (("vectors", machine.vector), ("single numbers", machine.single)):
        rates = ", ".join(f"{1 / speed[kind]:.3g} {kind}" for kind in machines.STEPS)
        print(f"{title}: {rates} (10^9 numbers a second)")
    print(f"a link of a chain {machine.link:.2f} ns; memory {1 / machine.byte:.1f} GB/s read and written")
    heads = f"{'operations':>11} {'bytes':>8} {'ns a cell':>11} {'peak':>10} {'memory':>8} {'ratio':>7} {'left':>6}"
    print(f"{'kernel':19} {'method':10} {heads}  reason, ns a cell")
    for name in names:
        study = starter_study(name, size)
        usable = [study.kernel.methods[number].name for number in usable_methods(study)]
        for method in usable if every else [None]:
            print(row(machine, name, size, method), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("kernels", nargs="*", metavar="KERNEL", help="of the catalogue; default: all")
    parser.add_argument("--cells", type=int, default=LANES, help="values of the starter study's first axis")
    parser.add_argument("--methods", action="store_true", help="a row for each method")
    parser.add_argument("--count", metavar="METHOD", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.count:
        print(json.dumps(count(options.kernels[0], options.cells, options.count, json.load(sys.stdin))))
    else:
        table(options.kernels or list(catalogue.KERNELS), options.cells, options.methods)


if __name__ == "__main__":
    main()
