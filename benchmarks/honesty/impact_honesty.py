# Is an impact clock that was followed contact by contact right to the rtol it is called OK at?
"""Prints, for each output, the largest error over the least rtol at which the cell is called OK (1 is the limit):

nice python benchmarks/honesty/impact_honesty.py [CELLS] [SEED]

Random clocks, many with equal masses, small escape heights, faint bounces or none, against the event simulation in 50
digits of tests/oracles/impact_event_oracles.py, a sixth of a second each. Where simulation and kernel come to different
motions of the same clock, the cell is counted apart.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from impact_verdicts import solved
from mpmath import mpf

from kernels.interface import FIRST_REFUSAL, Status

sys.path.append(str(Path(__file__).parents[2] / "tests" / "oracles"))
import impact_event_oracles as oracles

TOLD = (Status.OK, Status.PERIOD_2)
TOLERANCES = 10.0 ** np.arange(-5, -15.05, -0.1)
OTHER = 1e-6
"""Relative difference of the period beyond which it is another motion."""


def clocks(random, n):
    """Columns of clocks with kappa 0.01 to 100, e up to 0.85 and h up to p/4."""
    kind = random.integers(5, size=n)
    kappa, eta, e = 10 ** random.uniform(-2, 2, n), random.uniform(0, 0.25, n), random.uniform(0, 0.85, n)
    e = np.where(kind == 0, 0.0, np.where(kind == 1, 10 ** random.uniform(-9, -1, n), e))
    kappa = np.where(kind == 2, 1 + random.normal(size=n) * 10 ** random.uniform(-4, -1, n), kappa)
    eta = np.where(kind == 3, 10 ** random.uniform(-6, -1, n), eta)
    r_c, ones = 3 / (2 * np.pi), np.ones(n)
    return [r_c**3 * ones, r_c**4 * ones, r_c**4 / kappa, r_c * ones, r_c * ones, 3 * ones, eta, e, 0 * ones]


def least_tolerances(columns):
    """The least rtol at which each clock is called OK or PERIOD_2, inf where it is at none; outputs and statuses."""
    least = np.full(len(columns[0]), np.inf)
    for rtol in TOLERANCES:
        _, status = solved("events", columns, rtol)
        least[np.isin(status, TOLD)] = rtol
    return least, *solved("events", columns, TOLERANCES[0])


def errors(cell, found):
    """Relative errors by name, None where the simulation does not settle."""
    try:
        truth = oracles.outputs(*cell[:8])
    except ArithmeticError:
        return None
    return {name: float(abs(mpf(float(found[name])) - true) / (abs(true) or 1)) for name, true in truth.items()}


def main(cells=200, seed=1):
    """Count and print."""
    columns = clocks(np.random.default_rng(int(seed)), int(cells))
    least, outputs, status = least_tolerances(columns)
    worst, compared, other, unsaid = {}, 0, 0, 0
    for i, cell in enumerate(zip(*columns, strict=True)):
        if not np.isfinite(least[i]):
            continue
        off = errors(cell, {name: column[i] for name, column in outputs.items()})
        unsaid += off is None
        if off is None:
            continue
        other += off["period"] > OTHER
        if off["period"] > OTHER:
            continue
        compared += 1
        for name, error in off.items():
            worst[name] = max(worst.get(name, (0.0,)), (error / least[i], error, cell[2], cell[6], cell[7]))
    for name, (share, error, I_v, h, e) in worst.items():
        print(f"{name:13} {share:6.2f} of the least rtol, {error:.1e} at I_v={I_v:.17g} h={h:.17g} e={e:.17g}")
    print(f"{compared} compared, {other} another motion, {unsaid} the simulation does not settle")
    print(
        f"{np.mean(least <= 1.001e-13):.0%} of {len(least)} are OK at 1e-13, {np.mean(least <= 1.001e-12):.0%} at 1e-12"
    )
    print(f"{np.sum(status >= FIRST_REFUSAL)} refused")


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
