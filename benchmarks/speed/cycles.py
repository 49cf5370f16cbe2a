"""Cells a second of limit cycles: `cycle_kernel` through `sweep.run` beside two rivals, the same cycles to 1e-9.

    python benchmarks/speed/cycles.py [CELLS]

Van der Pol's oscillator, mu from 0.1 to 3. The rivals get what they are good at. solve_bvp of scipy: the cycle on the
unit interval with the period as a parameter, a phase condition, and the cycle of the cell before as its guess.
heyoka.py (extra `peers`): Newton's method by hand on x(T) - x(0) = 0, v(T) = 0 with its variational equations, as many
cells at a time as the processor has lanes, each begun at the cycle of the cell before. Their tolerance is the widest
power of ten by which the periods are right to 1e-9. Ours begins from the same start in every cell; it is timed with
the period alone, and with all that it says: sizes, multiplier, sensitivity, errors. CPU seconds, compiled before.
A study takes some 30 ms of them, as much as a thousand cells.
"""

import sys
import time
from pathlib import Path

import heyoka as hy
import numpy as np
from scipy.integrate import solve_bvp

import sweep

sys.path.insert(0, str(Path(__file__).parents[2] / "studies"))
WANTED = 1e-9
RIVALS = 12
"""Cells of solve_bvp."""


def ours(mu, **outputs):
    """Periods, and CPU seconds per cell, the least of five; compiled before."""
    seconds = []
    for _ in range(5):
        begin = time.process_time()
        study = sweep.study(
            kernel="relaxation_scene:KERNEL", axes={"mu": list(mu)}, rtol=WANTED, allow_import=True, **outputs
        )
        ds = sweep.run(study, isolate=False, workers=1, progress=False)
        seconds.append(time.process_time() - begin)
    return ds.period.values, min(seconds) / len(mu)


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


def by_heyoka(mu, tolerance):
    """Periods, and CPU seconds per cell; each lane goes through neighbouring cells."""
    x, v = hy.make_vars("x", "v")
    motion, lanes = [(x, v), (v, hy.par[0] * (1.0 - x * x) * v - x)], hy.recommended_simd_size()
    ta = hy.taylor_adaptive_batch(
        hy.var_ode_sys(motion, [x]), np.zeros((4, lanes)), tol=tolerance, pars=np.ones((1, lanes))
    )
    begin, found = time.process_time(), []
    rows = mu.reshape(lanes, -1).T
    size, period = np.full(lanes, 2.0), 2.0 * np.pi * (1.0 + rows[0] ** 2 / 16.0)
    for row in rows:
        ta.pars[0] = row
        for _ in range(20):
            ta.set_time(0.0)
            ta.state[:] = [size, 0.0 * size, 1.0 + 0.0 * size, 0.0 * size]
            ta.propagate_until(period)
            end, speed, end_by, speed_by = ta.state.copy()
            rise = row * (1.0 - end**2) * speed - end
            off, a = end - size, end_by - 1.0
            whole = a * rise - speed * speed_by
            steps = (off * rise - speed * speed) / whole, (a * speed - speed_by * off) / whole
            size, period = size - steps[0], period - steps[1]
            if max(abs(steps[0]).max(), abs(steps[1]).max()) < 1e-7:  # the next one would be 1e-14
                break
        found.append(period)
    return np.array(found).T.ravel(), (time.process_time() - begin) / len(mu)


def main(cells):
    """Prints all rates and their ratios."""
    mu = np.geomspace(0.1, 3.0, cells)
    periods, seconds = ours(mu, outputs=["period"])
    _, complete = ours(mu)
    print(f"cycle_kernel: {1.0 / seconds:.0f} cells/s, period alone; {1.0 / complete:.0f} cells/s, all outputs")
    for name, rival, some in (
        ("solve_bvp", by_bvp, np.linspace(0, cells - 1, RIVALS).astype(int)),
        ("heyoka.py", by_heyoka, np.arange(cells)),
    ):
        for tolerance in 10.0 ** -np.arange(6.0, 15.0):
            others, slower = rival(mu[some], tolerance)
            off = abs(others / periods[some] - 1.0).max()
            if off <= WANTED:
                break
        print(f"{name}, tol {tolerance:.0e}: {1.0 / slower:.1f} cells/s, periods differ by {off:.1e} at most;"
              f" ours is {slower / seconds:.2f} times as fast")  # fmt: skip


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 8192)
