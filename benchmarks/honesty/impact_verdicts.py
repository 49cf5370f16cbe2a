# Do the closed form and the followed contacts of an impact clock agree on which clocks have the symmetric cycle?
"""Prints counts by what both say, with the first clocks of each kind, on 100 000 random clocks:

python benchmarks/honesty/impact_verdicts.py
"""

from __future__ import annotations

import sys
import time

import numpy as np

from kernels.impact.clock import IMPACT
from kernels.interface import FIRST_REFUSAL, Status

CELLS = 100_000
SAME = 1e-9
"""Relative difference of period and swing below which two cycles are one."""


def clocks(n, seed=1):
    """Columns of random clocks: kappa 0.01 to 100, e 0 to 0.99 (a twentieth of them 0), h/p 0 to 0.25."""
    random = np.random.default_rng(seed)
    kappa, eta = 10 ** random.uniform(-2, 2, n), random.uniform(0, 0.25, n)
    e = np.where(random.random(n) < 0.05, 0.0, random.uniform(0, 0.99, n))
    ones, r_c, teeth = np.ones(n), 0.03, 31.0
    return [
        ones * 1e-3, kappa * 1e-5, ones * 1e-5, ones * r_c, ones * r_c, ones * teeth, eta * (2 * np.pi * r_c / teeth),
        e, 0 * ones,
    ]  # fmt: skip


def solved(method, columns, rtol=1e-10):
    """Outputs by name, and status, of one method."""
    n = len(columns[0])
    outputs = {f.name: np.full(n, np.nan) for f in IMPACT.outputs}
    status = np.zeros(n, np.int8)
    IMPACT.method(method).solve(*columns, np.full(n, rtol), *outputs.values(), status)
    return outputs, status


def kinds(columns):
    """What the closed form says, what became of the clock, and whether that is the symmetric cycle, for each."""
    closed, says = solved("closed", columns)
    found, becomes = solved("events", columns)
    same = np.ones(len(says), bool)
    for name in ("period", "swing"):
        same &= np.abs(found[name] / closed[name] - 1) < SAME
    same &= becomes < FIRST_REFUSAL
    return closed, says, found, becomes, same


def is_agreement(says, becomes, same):
    """Whether a clock comes to the symmetric cycle exactly where the closed form finds it there and stable."""
    return same == (says == Status.OK) if says != Status.GRAZING else True


def main():
    """Count and print."""
    columns = clocks(CELLS)
    kinds([c[:40] for c in columns])
    start = time.perf_counter()
    closed, says, found, becomes, same = kinds(columns)
    print(f"{CELLS} clocks in {time.perf_counter() - start:.0f} s")
    groups = {}
    for i, key in enumerate(zip(says.tolist(), becomes.tolist(), same.tolist(), strict=True)):
        groups.setdefault(key, []).append(i)
    disagreements = 0
    for (a, b, one), cells in sorted(groups.items()):
        agrees = is_agreement(a, b, one)
        disagreements += 0 if agrees else len(cells)
        names = f"{Status(a).name:10} {Status(b).name:13} {'same cycle' if one else 'another':10}"
        examples = "; ".join(
            f"kappa={columns[1][i] * 1e5:.4g} e={columns[7][i]:.4g} h/p={columns[6][i] * 31 / (0.06 * np.pi):.4g}"
            for i in cells[:3]
        )
        print(f"{names} {len(cells):7d} {'' if agrees else 'DISAGREE'} {examples}")
    print(f"{disagreements} disagreements")
    good = same & (becomes == Status.OK) & (says == Status.OK)
    for name in ("period", "swing", "pallet_speed", "wheel_speed", "multiplier"):
        error = np.abs(found[name][good] / closed[name][good] - 1)
        i = np.flatnonzero(good)[np.nanargmax(error)]
        place = f"kappa={columns[1][i] * 1e5:.4g} e={columns[7][i]:.4g}"
        print(f"{name:13} differs by {np.nanmax(error):.1e} at most, {place}")


if __name__ == "__main__":
    sys.exit(main())
