# How fast are the foliot's methods, against numpy and against one cell at a time, and how right?
"""Prints ratios measured in this run, on one core, and errors against 50 digits (needs mpmath):

python benchmarks/speed/methods.py
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from kernels.foliot._units import Foliot
from kernels.foliot._viscous import UNITS, event_map
from kernels.foliot.cycle import FOLIOT, check
from kernels.interface import Status
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.wiring import kernel, method

sys.path.append(str(Path(__file__).parents[2] / "tests" / "oracles"))
import oracles
from mpmath import mpf

BLOCK = 8192
REPEATS = 7
# q - tanh q = q^3 (1/3 - 2 q^2/15 + ...), to 1e-16 for q < 0.2
SERIES = (
    1 / 3, -2 / 15, 17 / 315, -62 / 2835, 1382 / 155925, -21844 / 6081075, 929569 / 638512875,
    -6404582 / 10854718875, 443861162 / 1856156927625,
)  # fmt: skip
OUTPUTS = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")


ONE_BY_ONE = kernel(
    "foliot_one_by_one",
    doc="the iterated map one cell at a time: the same function, without lanes",
    source=FOLIOT.source,
    parameters=FOLIOT.parameters,
    outputs=FOLIOT.outputs,
    record=Foliot,
    check=check,
    methods=(method("map", "one cell at a time", event_map, loop=cell_by_cell, units=UNITS),),
)


def solver(name):
    """A method of the foliot by its inputs, its outputs and the status alone."""
    chosen = FOLIOT.method(name)

    def estimating(*columns):
        inputs, outputs, status = columns[:10], columns[10:-1], columns[-1]
        chosen.solve(*inputs, np.ones(len(outputs), np.uint8), *outputs, np.empty(len(status)), status)

    return estimating if chosen.estimates else chosen.solve


def numpy_newton(
    mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status
):
    """q - tanh q = k by three Newton steps on whole arrays, series where the differences cancel."""
    k = a * a * phi0 / mu
    y = np.cbrt(3 * k)
    w = y * y
    q = np.where(k < 1, y * (1 + w * (2 / 15 + w * (3 / 175 + w * (2 / 1575)))), k + 1)
    for _ in range(3):
        t, v = np.tanh(q), q * q
        series = np.full_like(v, SERIES[-1])
        for coefficient in SERIES[-2::-1]:
            series = series * v + coefficient
        q -= (np.where(q < 0.2, q * v * series, q - t) - k) / (t * t)
    t = np.tanh(q)
    period[:] = 4 * q / a
    half = np.sinh(np.minimum(q, 20) / 2)
    amplitude[:] = phi0 * np.where(q < 20, np.log1p(2 * half * half), q - np.log(2)) / k
    crossing_speed[:] = mu * t / a
    sensitivity[:] = k / (q * t * t)
    multiplier[:] = np.exp(-2 * q)
    status[:] = 0


def no_more(n):
    """R, R_s, c, n, k and e of a foliot with viscous friction alone."""
    zero, one = np.zeros(n), np.ones(n)
    return [zero, zero, zero, one, zero, one]


def columns(n):
    """mu, phi0, a and rtol of foliots with alpha over 24 decades, in order; outputs and status."""
    alpha = np.geomspace(1e-12, 1e12, n)
    return [alpha * 0.09 * 0.7, np.full(n, 0.7), np.full(n, 0.3), *no_more(n), np.full(n, 1e-9)], [
        *(np.empty(n) for _ in OUTPUTS),
        np.empty(n, np.int8),
    ]


def seconds(solve, inputs, outputs):
    """Best time of a pass over all blocks."""
    n, best = len(inputs[0]), np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        for low in range(0, n, BLOCK):
            rows = slice(low, low + BLOCK)
            solve(*(c[rows] for c in inputs), *(c[rows] for c in outputs))
        best = min(best, time.perf_counter() - start)
    return best


def paired(one, other, inputs):
    """Times of both in turn: median of the ratio other/one, and the best time of each."""
    outputs = columns(len(inputs[0]))[1]
    one(*(c[:64] for c in inputs), *(c[:64] for c in outputs))
    other(*(c[:64] for c in inputs), *(c[:64] for c in outputs))
    times = [(seconds(one, inputs, outputs), seconds(other, inputs, outputs)) for _ in range(5)]
    return float(np.median([b / a for a, b in times])), min(a for a, _ in times), min(b for _, b in times)


def report(title, ratio, ours, theirs, cells):
    """One line: million cells a second of both, and the ratio."""
    print(f"{title:58} {cells / ours / 1e6:8.2f} {cells / theirs / 1e6:8.2f} {ratio:7.2f}")


def speed():
    """Both sides of each pair in turn, in this run."""
    print(f"{'one core, million cells/s':58} {'ours':>8} {'rival':>8} {'ratio':>7}")
    inputs, _ = columns(64 * BLOCK)
    report(
        "closed, in order; numpy Newton in blocks of 8192",
        *paired(solver("closed"), numpy_newton, inputs),
        64 * BLOCK,
    )
    shuffled = [np.random.default_rng(0).permutation(inputs[0]), *inputs[1:]]
    report("closed, shuffled; the same", *paired(solver("closed"), numpy_newton, shuffled), 64 * BLOCK)
    some, _ = columns(1024)
    some[0] = np.geomspace(1e-3, 1e6, 1024) * 0.09 * 0.7
    report(
        "map in lanes; one cell at a time, alpha 1e-3 to 1e6",
        *paired(solver("map"), ONE_BY_ONE.method("map").solve, some),
        1024,
    )
    report("dopri5 in lanes; map in lanes, the same cells", *paired(solver("dopri5"), solver("map"), some), 1024)
    some[3] = some[4] = 0.5 * some[0]
    title = "with Coulomb friction R = mu/2: "
    report(f"{title}coulomb; segments", *paired(solver("coulomb"), solver("segments"), some), 1024)
    report(f"{title}segments; quadrature", *paired(solver("segments"), solver("quadrature"), some), 1024)
    report(f"{title}quadrature; dopri5", *paired(solver("quadrature"), solver("dopri5"), some), 1024)


def errors(name, solve, low, high, rtol=1e-9, cells=2000):
    """The largest relative error of each output over random cells that came out OK, and where it is."""
    random = np.random.default_rng(1)
    alpha = 10 ** random.uniform(low, high, cells)
    a, phi0 = 10 ** random.uniform(-3, 3, cells), 10 ** random.uniform(-2, 2, cells)
    inputs = [alpha * a * a * phi0, phi0, a, *no_more(cells), np.full(cells, rtol)]
    outputs = columns(cells)[1]
    solve(*inputs, *outputs)
    good = outputs[-1] == Status.OK
    truths = [oracles.foliot(*cell) for cell in zip(*(c[good] for c in inputs[:3]), strict=True)]
    print(f"{name}, alpha 1e{low} to 1e{high}, rtol {rtol:g}: {good.sum()} of {cells} cells OK, largest errors")
    for j, output in enumerate(OUTPUTS):
        found = [
            float(abs(mpf(float(v)) / t[j] - 1)) if t[j] > 1e-300 else 0.0
            for v, t in zip(outputs[j][good], truths, strict=True)
        ]
        worst = int(np.argmax(found))
        print(f"  {output:15} {found[worst]:8.1e} at alpha = {alpha[good][worst]:.4g}")


def main():
    """Measure and print."""
    speed()
    errors("closed", solver("closed"), -12, 12)
    errors("asymptotic", solver("asymptotic"), -12, 12)
    errors("map", solver("map"), -12, 9)
    errors("dopri5", solver("dopri5"), -4, 9)
    errors("numpy Newton", numpy_newton, -12, 12)


if __name__ == "__main__":
    main()
