"""Cells a second of limit cycles: `cycle_kernel` through `sweep.run` beside scipy's solve_bvp, the same cycles to 1e-9.

    python benchmarks/speed/cycles.py [CELLS]

Van der Pol's oscillator, mu from 0.1 to 3, period alone. solve_bvp gets what it is good at: the cycle on the unit
interval with the period as a parameter, a phase condition, the exact Jacobian left to it, and the cycle of the cell
before as its guess; its tolerance is the widest power of ten by which the periods are right to 1e-9. CPU seconds.
"""

import sys
import time
from pathlib import Path

import numpy as np
from scipy.integrate import solve_bvp

import sweep

sys.path.insert(0, str(Path(__file__).parents[2] / "studies"))
RIVALS = 12
"""Cells of solve_bvp."""


def ours(mu):
    """Periods, and CPU seconds per cell; compiled before."""
    for _ in range(2):
        begin = time.process_time()
        ds = sweep.run(
            sweep.study(
                kernel="relaxation_scene:KERNEL", axes={"mu": list(mu)}, rtol=1e-9, outputs=["period"],
                allow_import=True,
            ),
            isolate=False, workers=1, progress=False,
        )  # fmt: skip
        seconds = time.process_time() - begin
    return ds.period.values, seconds / len(mu)


def by_bvp(mu, tolerance):
    """Periods, and CPU seconds per cell."""
    t = np.linspace(0.0, 1.0, 41)
    y, period = np.array([2.0 * np.cos(2.0 * np.pi * t), -2.0 * np.sin(2.0 * np.pi * t)]), [2.0 * np.pi]
    found, begin = [], time.process_time()
    for value in mu:
        cell = solve_bvp(
            lambda t, y, p, value=value: p[0] * np.array([y[1], value * (1.0 - y[0] ** 2) * y[1] - y[0]]),
            lambda a, b, p: np.array([a[0] - b[0], a[1] - b[1], a[1]]),
            t, y, p=period, tol=tolerance, max_nodes=100_000,
        )  # fmt: skip
        t, y, period = t, cell.sol(t), cell.p
        found.append(cell.p[0])
    return np.array(found), (time.process_time() - begin) / len(mu)


def main(cells):
    """Prints both rates and their ratio."""
    mu = np.geomspace(0.1, 3.0, cells)
    periods, seconds = ours(mu)
    some = np.linspace(0, cells - 1, RIVALS).astype(int)
    for tolerance in 10.0 ** -np.arange(6.0, 12.0):
        others, slower = by_bvp(mu[some], tolerance)
        off = abs(others / periods[some] - 1.0).max()
        if off <= 1e-9:
            break
    print(f"cycle_kernel: {1.0 / seconds:.0f} cells/s; solve_bvp, tol {tolerance:.0e}: {1.0 / slower:.1f} cells/s")
    print(f"ratio {slower / seconds:.0f}, periods differ by {off:.1e} at most")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1024)
