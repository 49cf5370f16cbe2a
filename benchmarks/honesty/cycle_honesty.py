# Is a limit cycle that `dopri5`, `sdirk4` or `taylor` calls OK right to the rtol that was wanted?
"""Random foliots of every term with drag of any degree, each at its own rtol, by the integration of half swings:

nice python benchmarks/honesty/cycle_honesty.py [--cells 100000] [--seed 1] [--degrees 1 6] [--rtol 1e-10 1e-3]
    [--ripple] [--method taylor|sdirk4]

Truth is `quadrature` without a hairspring and ripple, and else `taylor` at 1e-12, where the error that it states is
below a twentieth of rtol; `auto_honesty.py` holds both against 50 digits. With `--ripple` half of the cells have a
ripple, of up to 64 half waves and down to 1e-6 below a torque that stops. Half of them have no drag but the viscous. A
cell is wrong where one of its outputs is off by more than rtol; exit status 1 where any is.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from honest_cells import CYCLE, decades, some

from kernels.foliot.cycle import FOLIOT
from kernels.foliot.ripple import FOLIOT_RIPPLE
from kernels.interface import FIRST_REFUSAL, Status

sys.path.append(str(Path(__file__).parents[2] / "tests" / "helpers"))
from columns import estimated, solve

TRUTH, SURE = 1e-12, 0.05
"""rtol of `taylor`, and the share of rtol that its stated error may be."""
LEAST = 1e-300
"""Multipliers below it are not judged."""


def drawn(random, n, degrees, rippled):
    """Columns of cells by name."""
    mu, phi0, degree = decades(random, -1, 1, n), decades(random, -1, 1, n), random.uniform(*degrees, n)
    depth = some(
        random, 0.5, np.where(random.random(n) < 0.7, random.uniform(0.0, 0.9, n), 1.0 - decades(random, -6, -1, n))
    )
    cells = {
        "mu": mu, "phi0": phi0, "n": degree, "c": decades(random, -4, 3, n) * mu * (mu * phi0) ** (-degree / 2),
        "R": some(random, 0.5, random.uniform(0.0, 0.9, n) * mu) * (1.0 - depth),
        "a": some(random, 0.4, decades(random, -4, 1, n) * np.sqrt(mu / phi0)),
        "k": some(random, 0.5, decades(random, -3, 0.7, n) * mu / phi0),
        "e": np.where(random.random(n) < 0.5, 1.0, random.uniform(-0.9, 1.0, n)),
        "depth": depth, "harmonic": random.integers(1, 65, n).astype(float),
    }  # fmt: skip
    if rippled:
        cells["c"] = some(random, 0.5, cells["c"])
        return cells
    return {name: cells[name] for name in list(cells)[:-2]}


def truths(kernel, cells, rtol):
    """Outputs, and which cells they are sure in."""
    found, status, error = estimated(kernel, "taylor", rtol=np.full(len(rtol), TRUTH), **cells)
    sure = (status < FIRST_REFUSAL) & (error <= SURE * rtol)
    if kernel is FOLIOT:
        exact, status = solve(kernel, "quadrature", rtol=TRUTH, **cells)
        direct = (cells["k"] <= 0.0) & (status == Status.OK)
        found, sure = {name: np.where(direct, exact[name], found[name]) for name in CYCLE}, sure | direct
    return found, sure


def judged(kernel, method, cells, rtol):
    """Errors over rtol by output, statuses, and which cells are judged."""
    begin = time.process_time()
    outputs, status = solve(kernel, method, rtol=rtol, **cells)
    print(f"{len(rtol)} cells by {method}: {time.process_time() - begin:.1f} s of CPU time")
    true, sure = truths(kernel, cells, rtol)
    with np.errstate(all="ignore"):
        errors = np.array([np.abs(outputs[name] / true[name] - 1.0) / rtol for name in CYCLE])
    errors[-1, np.abs(true["multiplier"]) < LEAST] = 0.0
    return errors, status, sure & (status == Status.OK)


def main(arguments):
    """1 where a cell that is called OK is off by more than its rtol."""
    parser = argparse.ArgumentParser(description="Is a limit cycle that is called OK right?")
    parser.add_argument("--method", choices=["dopri5", "sdirk4", "taylor"], default="dopri5")
    parser.add_argument("--cells", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--degrees", type=float, nargs=2, default=(1.0, 6.0), metavar=("LOW", "HIGH"))
    parser.add_argument("--rtol", type=float, nargs=2, default=(1e-10, 1e-3), metavar=("LOW", "HIGH"))
    parser.add_argument("--ripple", action="store_true")
    given = parser.parse_args(arguments)
    random, kernel = np.random.default_rng(given.seed), FOLIOT_RIPPLE if given.ripple else FOLIOT
    cells = drawn(random, given.cells, given.degrees, given.ripple)
    rtol = decades(random, *np.log10(given.rtol), given.cells)
    errors, status, known = judged(kernel, given.method, cells, rtol)
    worst = np.where(known, errors.max(axis=0), 0.0)
    counts = Counter(Status(s).name for s in status.tolist())
    print(", ".join(f"{number} {name}" for name, number in counts.most_common()))
    print(f"{(worst > 1).sum()} of {known.sum()} OK cells off by more than rtol; worst {worst.max():.2f} rtol")
    for i in np.argsort(-worst)[:3]:
        cell = {name: column[i].item() for name, column in cells.items()}
        print(f"  {worst[i]:.2f} rtol of {rtol[i]:.2g}: {CYCLE[errors[:, i].argmax()]} of {cell}")
    return int((worst > 1).any())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
