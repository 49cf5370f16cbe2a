# How fast are the natural frequencies and receptances of drivetrains against numpy, and how right?
"""Prints ratios measured in this run and errors against 50 digits (needs mpmath and scipy):

python benchmarks/speed/drivetrain.py

Times are processor time of one thread, of both sides, pass after pass in turn. Rivals of the frequencies are numpy's
eigvalsh of all matrices in one call, and of all in scipy that find eigenvalues of one tridiagonal matrix (stebz, stemr,
stev, sterf, pteqr) the fastest, LAPACK's dsterf called without checks; building the matrices is not counted.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from pathlib import Path

import numpy as np
from scipy.linalg import lapack

from kernels.drivetrain._frequencies import frequencies as frequencies_of_group
from kernels.drivetrain._frequencies import row_at
from kernels.drivetrain.receptance import DRIVETRAIN_FRF
from kernels.lanes.columns import FEW, few_at, room
from kernels.lanes.jit import jit

sys.path += [str(Path(__file__).parents[2] / "tests" / folder) for folder in ("oracles", "helpers")]
import chain_oracles as oracles
from loops import entry
from mpmath import mp, mpc, mpf

CELLS = {2: 65536, 4: 32768, 8: 16384, 16: 8192, 64: 512}
"""Chains by the number of their inertias."""
REPEATS = 7
CHECKED = 6
"""Chains whose error is measured."""


@jit
def _group(first, columns, rows):
    J, k, frequency, status = columns
    n = J.shape[1]
    part = FEW * n
    inertias, springs, found, entries = rows, rows[part:], rows[2 * part :], rows[3 * part :]
    for cell in range(FEW):
        for j in range(n):
            inertias[j * FEW + cell] = J[first + cell, j]
            springs[j * FEW + cell] = k[first + cell, j]
    status[few_at(first)] = frequencies_of_group(n, row_at, FEW, inertias, springs, found, entries)
    for cell in range(FEW):
        for j in range(n):
            frequency[first + cell, j] = found[j * FEW + cell]


@entry
def natural_frequencies_of_all(J, k, frequency, status):
    """Natural frequencies of every row of J and k, of shape (n_cells, n), a group of them at a time; and statuses."""
    rows = room(6 * J.shape[1] + 2)
    for first in range(0, len(J), FEW):  # the numbers of chains are whole groups
        _group(first, (J, k, frequency, status), rows)


def chains(n, decades, cells, seed=1):
    """J and k over so many decades."""
    random = np.random.default_rng(seed)
    return tuple(10 ** random.uniform(-decades / 2, decades / 2, (cells, n)) for _ in range(2))


def dense(J, k):
    """The symmetric matrices J^-1/2 K J^-1/2, as numpy's eigenvalue routine wants them."""
    n = J.shape[1]
    matrices, i = np.zeros((*J.shape, n)), np.arange(n)
    matrices[:, i, i] = k / J
    matrices[:, i[1:], i[1:]] += k[:, :-1] / J[:, 1:]
    beside = -k[:, :-1] / np.sqrt(J[:, :-1] * J[:, 1:])
    matrices[:, i[1:], i[:-1]] = matrices[:, i[:-1], i[1:]] = beside
    return matrices


def seconds(function, *arguments):
    """Time of one pass, and what it gave."""
    start = time.thread_time()
    result = function(*arguments)
    return time.thread_time() - start, result


def worst(found, J, k):
    """The largest relative error of a frequency over the first chains; below 0 in the square counts as 0 Hz."""
    largest = 0.0
    for i in range(CHECKED if J.shape[1] < 64 else 1):
        true = oracles.frequencies(J[i], k[i], 100)
        with mp.workdps(50):
            largest = max(largest, *(float(abs(mpf(float(f)) / t - 1)) for f, t in zip(found[i], true, strict=True)))
    return largest


def tridiagonal(matrices):
    """Squares of frequencies by dsterf, chain by chain."""
    diagonals = np.ascontiguousarray(matrices.diagonal(0, 1, 2)), np.ascontiguousarray(matrices.diagonal(1, 1, 2))

    def solve():
        return np.array([lapack.dsterf(*entries)[0] for entries in zip(*diagonals, strict=True)])

    return solve


def frequencies():
    """Ours and the rivals in turn, in this run: medians of the ratios."""
    print(f"{'natural frequencies':34} {'ns/chain':>9} {'eigvalsh':>14} {'dsterf':>14} {'errors':>8}")
    for decades in (1, 12):
        for n, cells in CELLS.items():
            J, k = chains(n, decades, cells)
            matrices, found, status = dense(J, k), np.empty_like(J), np.empty(cells, np.int8)
            by_sterf = tridiagonal(matrices)
            natural_frequencies_of_all(J, k, found, status)
            times = []
            for _ in range(REPEATS):
                ours = seconds(natural_frequencies_of_all, J, k, found, status)[0]
                full, squares = seconds(np.linalg.eigvalsh, matrices)
                sparse, others = seconds(by_sterf)
                times.append((ours, full, sparse))
            assert not status.any()
            ours, full, sparse = np.median(times, axis=0) / cells * 1e9
            ratios = np.median([(b / a, c / a) for a, b, c in times], axis=0)
            rivals = (np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi) for values in (squares, others))
            errors = " ".join(f"{worst(values, J, k):8.1e}" for values in (found, *rivals))
            title = f"{n} inertias, J and k over {decades} decades"
            print(f"{title:34} {ours:9.0f} {full:7.0f} {ratios[0]:6.1f} {sparse:7.0f} {ratios[1]:6.1f} {errors}")


def numpy_receptances(J, k, h, frequency):
    """The receptance at mass 1 by numpy's dense solver, all frequencies of a chain at a time."""
    n, i = J.shape[1], np.arange(J.shape[1])
    found = np.empty((len(J), len(frequency)), complex)
    torque = np.zeros((len(frequency), n, 1))
    torque[:, 0] = 1.0
    w = 2 * np.pi * frequency[:, None]
    for cell in range(len(J)):
        matrices = np.zeros((len(frequency), n, n), complex)
        K = k[cell] + 1j * w * h[cell]
        matrices[:, i, i] = K - w * w * J[cell]
        matrices[:, i[1:], i[1:]] += K[:, :-1]
        matrices[:, i[1:], i[:-1]] = matrices[:, i[:-1], i[1:]] = -K[:, :-1]
        found[cell] = np.linalg.solve(matrices, torque)[:, 0, 0]
    return found


def receptances():
    """The kernel with its error bound, amplitude, phase and decibel against numpy's solver alone."""
    print(
        f"{'receptance at 256 frequencies':34} {'ns each':>9} {'solve':>9} {'ratio':>6} {'error':>8} {'its error':>9}"
    )
    frequency = np.geomspace(1e-3, 1.0, 256)
    for n, cells in ((8, 256), (64, 16)):
        J, k = chains(n, 1, cells)
        h = 0.02 * np.sqrt(J * k)
        outputs, status = [np.empty((cells, 256)) for _ in range(5)], np.empty(cells, np.int8)
        columns = J, k, h, np.ones(cells), np.ones(cells), np.full(cells, 1e-9), frequency, *outputs, status
        solve = DRIVETRAIN_FRF.method("continued").solve
        solve(*columns)
        times = []
        for _ in range(REPEATS):
            ours = seconds(solve, *columns)[0]
            theirs, rival = seconds(numpy_receptances, J, k, h, frequency)
            times.append((ours, theirs))
        ratio = np.median([b / a for a, b in times])
        ours, theirs = (np.median(t) / cells / 256 * 1e9 for t in zip(*times, strict=True))
        errors = []
        for values in (outputs[0] + 1j * outputs[1], rival):
            found = []
            for j in range(0, 256, 32):
                true = oracles.receptance(J[0], k[0], h[0], frequency[j], 1, 1)
                with mp.workdps(50):
                    found.append(float(abs(mpc(complex(values[0, j])) - true) / abs(true)))
            errors.append(max(found))
        print(f"{f'{n} inertias':34} {ours:9.0f} {theirs:9.0f} {ratio:6.1f} {errors[0]:8.1e} {errors[1]:9.1e}")


if __name__ == "__main__":
    frequencies()
    receptances()
