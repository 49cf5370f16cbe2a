# Is a cell that `auto` calls OK right to the rtol that was wanted?
"""Random cells of every kernel that has an oracle, each at a random rtol from 1e-13 to 1e-2, against 50 digits:

nice python benchmarks/honesty/auto_honesty.py [--cells 100000] [--seed 1] [--workers 2] [KERNEL ...]

Each cell is asked for all outputs at once, and for each output alone, since `auto` takes another method then. Wrong is
a cell with status OK of which an output is off by more than rtol (of traces: relative to the largest value, or to what
their kernel says), or that has none by the oracle. Dear oracles get about 12000 of the 100000 cells, and the dearest
are stood in for by a second path in 80 bits (`honest_paths`), which they are held against in some cells first, and
which calls no cell wrong before they are asked, too. "up to" is what the share may be, 95 % sure. Needs mpmath.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from honest_cells import CASES, NO_CYCLE, UNKNOWN, WITHOUT, decades
from mpmath import mpf

import sweep
from kernels.catalogue import KERNELS, get
from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells.sample import solved

LEAST = mpf(2) ** -1022
"""Below the normal numbers of float64 any value as small is right."""
ALLOWED = 1e-4
SPOTS = 24
"""Cells of a second path that are given to the oracle too."""
APART = 1e-14
"""How far the second path may be from it."""
UNSURE = (Status.INACCURATE, Status.GRAZING)
"""What says of itself that digits may be wrong."""


def error_of(value, true, over=None):
    """Relative error of a number; of a trace relative to its largest value, or to `over` at the same place."""
    if over is not None:
        return max(_error(float(v), t, abs(size)) for v, t, size in zip(value, true, over, strict=True))
    if not isinstance(true, list):
        return _error(float(value), true, abs(true))
    if any((t is None) != bool(np.isnan(v)) for v, t in zip(value, true, strict=True)):
        return math.inf
    there = [(float(v), t) for v, t in zip(value, true, strict=True) if t is not None]
    size = max((abs(t) for _, t in there), default=mpf(0))
    return max((_error(v, t, size) for v, t in there), default=0.0)


def _error(value, true, size):
    if not math.isfinite(value):
        return math.inf
    if size < LEAST:
        return 0.0 if abs(value) <= LEAST else math.inf
    return float(abs(mpf(value) - true) / size)


def truth_of(job):
    """What is true of one cell, UNKNOWN where the oracle gives up; run in a process of its own."""
    case, cell = job
    try:
        return case.truth(**cell)
    except (ArithmeticError, AssertionError, TypeError, ValueError):
        return UNKNOWN


def cells_of(case, n, seed):
    """Columns by name, and rtol."""
    random = np.random.default_rng([seed, CASES.index(case)])
    return case.cells(random, n), decades(random, -13, -2, n)


def solve(case, columns, rtol, outputs):
    """Outputs and statuses of `auto`."""
    along = {name: {"values": list(values)} for name, values in case.along.items()}
    axes = {**{name: column.tolist() for name, column in columns.items()}, "rtol": rtol}
    study = sweep.study(
        kernel=case.kernel, design="zip", method="auto", axes=axes, fixed=dict(case.fixed), along=along, outputs=outputs
    )
    cells = solved(study)
    names = [study.kernel.methods[i].name if i >= 0 else "" for i in cells["method_used"]]
    return {name: cells[name] for name in study.outputs}, cells["status"], names


class Tally:
    """What became of the cells of a case, asked in one way."""

    def __init__(self):
        self.statuses, self.judged, self.wrong, self.worst = Counter(), 0, [], (-1.0, None)
        self.unknown = 0
        self.remarked, self.wrongly_remarked = 0, []

    def add(self, cell, rtol, values, status, method, truth, case):
        """Judge one cell, and say whether it is wrong; `values` by the names of the outputs."""
        self.statuses[Status(status).name] += 1
        self.unknown += truth == UNKNOWN
        if truth == UNKNOWN or status >= FIRST_REFUSAL or status in UNSURE:
            return False
        if truth == NO_CYCLE:
            errors = dict.fromkeys(values, math.inf)
        else:
            errors = {
                name: error_of(v, truth[name], truth.get(case.over.get(name))) - case.blur for name, v in values.items()
            }
        name = max(errors, key=errors.get)
        found = errors[name] / rtol, f"{name} off by {errors[name]:.2g} at rtol {rtol:.2g} by {method}: {cell}"
        if status != Status.OK:
            self.remarked += 1
            self.wrongly_remarked += [found] if found[0] > 1 else []
            return found[0] > 1
        self.judged += 1
        self.worst = max(self.worst, found, key=lambda f: f[0])
        self.wrong += [found] if found[0] > 1 else []
        return found[0] > 1

    def text(self):
        """One line on shares, one on statuses, and the worst cells."""
        share, sure = len(self.wrong) / max(self.judged, 1), 3 / max(self.judged, 1)
        verdict = "honest" if share <= ALLOWED else "NOT HONEST"
        counts = ", ".join(f"{n} {name}" for name, n in self.statuses.most_common())
        bound = f"up to {sure:.1e}" if not self.wrong else ""
        lines = [f"  {verdict}: {len(self.wrong)} of {self.judged} OK cells wrong {bound}; {counts}"]
        lines += [f"  remarked otherwise: {len(self.wrongly_remarked)} of {self.remarked} beyond rtol"] * (
            self.remarked > 0
        )
        lines += [f"  of {self.unknown} the oracle does not say"] * (self.unknown > 0)
        shown = sorted(self.wrong, key=lambda f: -f[0])[:3] or [self.worst]
        shown += sorted(self.wrongly_remarked, key=lambda f: -f[0])[:2]
        return "\n".join([*lines, *(f"    {ratio:.2g} rtol: {text}" for ratio, text in shown)])


def judge(case, n, seed, pool):
    """Tallies of a case: all outputs at once, and each alone."""
    columns, rtol = cells_of(case, n, seed)
    cells = [{name: column[i].tolist() for name, column in columns.items()} for i in range(n)]
    truths, apart = (true_by_path if case.path else true_by_oracle)(case, columns, cells, pool)
    single = len(get(case.kernel).methods) > 1 and len(case.outputs) > 1
    asked = [list(case.outputs), *([name] for name in case.outputs if single)]
    tallies = {"all outputs": Tally(), "one output alone": Tally()}
    for outputs in asked:
        values, status, used = solve(case, columns, rtol, outputs)
        tally = tallies["all outputs" if outputs == asked[0] else "one output alone"]
        for i, cell in enumerate(cells):
            given = cell, rtol[i], {name: values[name][i] for name in outputs}, status[i], used[i]
            if case.path and Tally().add(*given, truths[i], case):
                truths[i] = truth_of((case, cell))
            tally.add(*given, truths[i], case)
    return {title: tally for title, tally in tallies.items() if tally.statuses}, apart


def true_by_oracle(case, columns, cells, pool):
    """Truths of all cells by the oracle."""
    return list(pool.map(truth_of, [(case, cell) for cell in cells], chunksize=max(1, len(cells) // 200))), None


def true_by_path(case, columns, cells, pool):
    """Truths by the second path, and how far those are from the oracle's in some cells."""
    parts = np.array_split(np.arange(len(cells)), max(1, len(cells) // 100))
    jobs = [(case, {name: column[part] for name, column in columns.items()}) for part in parts]
    truths = [truth for found in pool.map(path_of, jobs) for truth in found]
    some = range(0, len(cells), max(1, len(cells) // SPOTS))
    oracles = pool.map(truth_of, [(case, cells[i]) for i in some])
    apart = max((_apart(truths[i], true) for i, true in zip(some, oracles, strict=True)), default=0.0)
    return truths, apart


def path_of(job):
    """Truths of some cells by the second path, in 80 bits."""
    case, columns = job
    found = case.path(**columns)
    return [NO_CYCLE if t is None else UNKNOWN if t is NotImplemented else _exact(t) for t in found]


def _exact(truth):
    return {name: mpf(value) for name, value in truth.items()}


def _apart(found, true):
    if UNKNOWN in (found, true):
        return 0.0
    if NO_CYCLE in (found, true):
        return 0.0 if found == true else math.inf
    return max(error_of(float(found[name]), true[name]) for name in found)


def main(arguments):
    """Judge the kernels named, or all; 1 where `auto` is wrong more often than is allowed."""
    parser = argparse.ArgumentParser(description="Is a cell that `auto` calls OK right to the rtol that was wanted?")
    parser.add_argument("kernels", nargs="*", metavar="KERNEL")
    parser.add_argument("--cells", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=None)
    given = parser.parse_args(arguments)
    bad = False
    with ProcessPoolExecutor(given.workers) as pool:
        for case in CASES:
            if given.kernels and case.kernel not in given.kernels:
                continue
            start, n = time.perf_counter(), max(1, round(given.cells * case.share))
            tallies, apart = judge(case, n, given.seed, pool)
            print(f"{case.kernel} {case.region}: {n} cells, {time.perf_counter() - start:.0f} s")
            if apart is not None:
                print(
                    f" truth by a second path in 80 bits, off by {apart:.1e} from the oracle in {min(n, SPOTS)} cells"
                )
                bad |= not apart <= APART
            for title, tally in tallies.items():
                print(f" {title}\n{tally.text()}", flush=True)
                bad |= len(tally.wrong) > ALLOWED * tally.judged
    for name in [] if given.kernels else KERNELS:
        if name not in {case.kernel for case in CASES}:
            print(f"{name}: not judged here; {WITHOUT.get(name, 'no oracle')}")
    return int(bad)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
