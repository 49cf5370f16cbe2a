# How fast are the polisher's stable forms against the textbook's in numpy, and how right are both?
"""Prints ratios measured in this run, on one core, and errors against 50 digits (needs mpmath):

python benchmarks/speed/polisher.py
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from kernels.interface import Status
from kernels.polisher.arm import POLISHER

sys.path.append(str(Path(__file__).parents[2] / "tests" / "oracles"))
import polisher_oracles as oracles
from mpmath import mpf

STRIP = 16384
"""Machines in one call, as the engine solves them."""
CALLS = 30
REPEATS = 7
NAMES = [field.name for field in POLISHER.outputs]
CLOSED = list(oracles.closed(0.62, 0.38, 0.405, 0.1))
BOOK = (
    "eta_plus", "eta_minus", "theta_plus", "theta_minus", "transmission_angle",
    "A0", "A0_b", "A0_d", "A0_f", "A1", "A1_b", "A1_d", "A1_f",
)  # fmt: skip
"""What `whole_book` gives; A0_e and A1_e are A1_f and A0_f once more."""


def book(b, d, f, e):
    """The paper's A0 and A1 in numpy, without a word on domain or errors."""
    plus = np.arccos((b * b + d * d - (f + e) ** 2) / (2 * b * d))
    minus = np.arccos((b * b + d * d - (f - e) ** 2) / (2 * b * d))
    return (plus + minus) / 2, (plus - minus) / 2


def whole_book(b, d, f, e):
    """Everything that `stable` gives, as the textbook has it: angles, crank angles, transmission angle, derivatives."""

    def slopes(c):
        x = (b * b + d * d - c * c) / (2 * b * d)
        area = b * d * np.sqrt(1 - x * x)
        by_b, by_d = (b * b - d * d + c * c) / (-2 * b * area), (d * d - b * b + c * c) / (-2 * d * area)
        return np.arccos(x), by_b, by_d, c / area

    far, near = f + e, f - e
    p, m = slopes(far), slopes(near)
    theta_plus = np.pi - np.arccos((b * b + far * far - d * d) / (2 * b * far))
    theta_minus = -np.arccos((b * b + near * near - d * d) / (2 * b * near))
    folded = np.arccos((d * d + f * f - (b - e) ** 2) / (2 * d * f))
    stretched = np.pi - np.arccos((d * d + f * f - (b + e) ** 2) / (2 * d * f))
    means = [(x + y) / 2 for x, y in zip(p, m, strict=True)]
    halves = [(x - y) / 2 for x, y in zip(p, m, strict=True)]
    return p[0], m[0], theta_plus, theta_minus, np.minimum(folded, stretched), *means, *halves


def machines(n, gap=None):
    """Columns b, d, f, e of crank-rockers: e up to the border, or within `gap` of it, relatively."""
    random = np.random.default_rng(1)
    b, d, f = random.uniform(0.5, 0.7, n), random.uniform(0.3, 0.4, n), random.uniform(0.4, 0.5, n)
    border = np.minimum(np.minimum(d + f - b, b + f - d), b + d - f)
    return b, d, f, border * (random.uniform(0.05, 0.95, n) if gap is None else 1 - gap)


def per_second(work: Callable[[], object], calls: int) -> float:
    """Machines a second, of strips."""
    start = time.perf_counter()
    for _ in range(calls):
        work()
    return calls * STRIP / (time.perf_counter() - start)


def speed():
    """Every method against both numpy forms, in turn, in this run: medians."""
    columns = [*machines(STRIP), np.zeros(STRIP), np.full(STRIP, 1e-12)]
    outputs = [*(np.empty(STRIP) for _ in NAMES), np.empty(STRIP, np.int8)]
    rivals = {"A0 and A1 by numpy": book, "the same 17 by numpy": whole_book}
    print(f"{'one core, million machines/s':34} {'':>8}" + "".join(f" {'over ' + name:>26}" for name in rivals))
    for name, calls in (("stable", CALLS), ("waveform", 1)):
        ours_of = partial(POLISHER.method(name).solve, *columns, *outputs)
        ours_of()
        rounds = [
            [
                per_second(ours_of, calls),
                *(per_second(partial(rival, *columns[:4]), CALLS) for rival in rivals.values()),
            ]
            for _ in range(REPEATS)
        ]
        ours, *theirs = np.transpose(rounds)
        ratios = "".join(f" {np.median(ours / other):26.2f}" for other in theirs)
        print(f"{name:34} {np.median(ours) / 1e6:8.2f}{ratios}")
    assert (outputs[-1] == Status.OK).all()


def errors():
    """The largest relative error over the closed outputs, by the distance from the border."""
    n = 64
    print(f"\n{'largest error; distance from border':34} {'stable':>9} {'textbook':>9}   worst output")
    for gap in (None, 1e-3, 1e-6, 1e-9, 1e-11):
        columns = machines(n, gap)
        truths = [oracles.closed(*cell) for cell in zip(*columns, strict=True)]
        outputs = [*(np.empty(n) for _ in NAMES), np.empty(n, np.int8)]
        POLISHER.method("stable").solve(*columns, np.zeros(n), np.full(n, 1e-12), *outputs)
        found = []
        for named in (dict(zip(NAMES, outputs, strict=False)), dict(zip(BOOK, whole_book(*columns), strict=True))):
            worst = {
                name: max(float(abs(mpf(float(v)) / t[name] - 1)) for v, t in zip(named[name], truths, strict=True))
                for name in CLOSED
                if name in named
            }
            found.append(max((error, name) for name, error in worst.items()))
        (ours, ours_at), (theirs, theirs_at) = found
        print(f"{'anywhere' if gap is None else gap!s:34} {ours:9.1e} {theirs:9.1e}   {ours_at}, {theirs_at}")


def main():
    """Measure and print."""
    speed()
    errors()


if __name__ == "__main__":
    main()
