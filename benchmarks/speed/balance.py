# How fast is the balance's count of half swings against following them one by one, and how right?
"""Prints ratios measured in this run, on one core, and errors against 120 digits (needs mpmath):

python benchmarks/speed/balance.py
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from numba import njit

from kernels.balance import release
from kernels.interface import Status

sys.path.append(str(Path(__file__).parents[2] / "tests" / "oracles"))
import balance_oracles as oracles
from mpmath import mpf

CELLS = 256
"""Cells along each axis."""
REPEATS = 5
OUTPUTS = ("half_swings", "stop_angle", "stop_time", "margin", "period")


@njit(error_model="numpy", nogil=True)
def plain(zeta, omega_n, r, r_s, theta0, rtol, half_swings, stop_angle, stop_time, margin, period, status):
    """The recursion as one would write it in C, cell by cell, without a word on its errors."""
    for i in range(zeta.size):
        root = np.sqrt(1.0 - zeta[i] * zeta[i])
        share = np.exp(-np.pi * zeta[i] / root)
        loss = r[i] * (1.0 + share)
        a, n, side = abs(theta0[i]), 0, 1.0 if theta0[i] >= 0.0 else -1.0
        before = np.inf
        while a > r_s[i]:
            before = a
            a = share * a - loss
            n += 1
            side = -side
        half = np.pi / (omega_n[i] * root)
        half_swings[i], stop_angle[i], stop_time[i] = n, side * a, n * half
        margin[i], period[i], status[i] = min(before - r_s[i], r_s[i] - a) / r_s[i], 2.0 * half, 0


def grid(n):
    """Columns of balances with zeta from 1e-4 to 0.5 and r/theta0 from 1e-4 to 0.3; outputs and status."""
    zeta, r = np.meshgrid(np.geomspace(1e-4, 0.5, n), np.geomspace(1e-4, 0.3, n), indexing="ij")
    inputs = [zeta.ravel(), np.full(n * n, 15.7), r.ravel(), r.ravel().copy(), np.ones(n * n), np.full(n * n, 1e-12)]
    return inputs, [*(np.empty(n * n) for _ in OUTPUTS), np.empty(n * n, np.int8)]


def seconds(solve, inputs, outputs):
    """Time of one pass."""
    start = time.perf_counter()
    solve(*inputs, *outputs)
    return time.perf_counter() - start


def speed():
    """Both in turn, in this run: median of the ratios, and the best time of each."""
    inputs, outputs = grid(CELLS)
    n = CELLS * CELLS
    print(f"{'one core':56} {'ns/cell':>8} {'plain':>8} {'ratio':>7}")
    for name, solve in (("closed", release.closed), ("recursion", release.recursion)):
        seconds(solve, inputs, outputs), seconds(plain, inputs, outputs)
        times = [(seconds(solve, inputs, outputs), seconds(plain, inputs, outputs)) for _ in range(REPEATS)]
        ratio = float(np.median([b / a for a, b in times]))
        ours, theirs = (min(t) / n * 1e9 for t in zip(*times, strict=True))
        print(f"{name + ' in lanes; plain recursion cell by cell':56} {ours:8.1f} {theirs:8.1f} {ratio:7.2f}")
    print(f"half swings: mean {outputs[0].mean():.0f}, largest {outputs[0].max():.0f}")


def errors(title, solve, zeta, r):
    """The largest error of each output over cells that came out OK, and where it is."""
    n = len(zeta)
    inputs = [zeta, np.full(n, 15.7), r, r.copy(), np.full(n, 0.9), np.full(n, 1e-9)]
    outputs = [*(np.empty(n) for _ in OUTPUTS), np.empty(n, np.int8)]
    solve(*inputs, *outputs)
    good = outputs[-1] == Status.OK
    truths = [oracles.balance(*cell) for cell in zip(*(c[good] for c in inputs[:5]), strict=True)]
    counts = np.array([float(t[0]) for t in truths])
    print(f"{title}: {good.sum()} of {n} cells OK at rtol 1e-9, largest errors")
    for j, name in enumerate(OUTPUTS):
        found = np.array([float(abs(mpf(float(v)) / t[j] - 1)) for v, t in zip(outputs[j][good], truths, strict=True)])
        k = int(found.argmax())
        print(f"  {name:12} {found[k]:8.1e} at zeta = {zeta[good][k]:.3g}, {counts[k]:.0f} half swings")


def main():
    """Measure and print."""
    speed()
    random = np.random.default_rng(1)
    n = 600
    damped, light = random.uniform(1e-4, 0.99, n), 10 ** random.uniform(-14, -2, n)
    coarse, fine = 10 ** random.uniform(-4, -0.5, n), 10 ** random.uniform(-12, -4, n)
    for name, solve in (("closed", release.closed), ("recursion", release.recursion), ("plain recursion", plain)):
        errors(f"{name}, zeta 1e-4 to 0.99, r/theta0 1e-4 to 0.3", solve, damped, coarse)
        errors(f"{name}, zeta 1e-14 to 1e-2, r/theta0 1e-4 to 0.3", solve, light, coarse)
    errors("closed, zeta 1e-14 to 1e-2, r/theta0 1e-12 to 1e-4", release.closed, light, fine)


if __name__ == "__main__":
    main()
