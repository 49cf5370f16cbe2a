# Is the error that a Taylor motion states, followed once, ever less than its true error, and how much more is it?
"""Prints, scene by scene, how many values called OK by one run are off by more than rtol, and stated over true errors:

nice python benchmarks/honesty/stated_error.py [--cells 100000] [--seed 1] [--scenes NAME ...]

Scenes made to be difficult, with random parameters, up to 30 switches and an rtol from 1e-11 to 1e-4 of its own for
each cell: drag of any power, a pulse that is narrow, a pendulum that is driven until small errors grow, a van der Pol
relay, rates that cancel to a few digits, and a plain foliot that nearly sticks. Truth is the same scene followed
three times at 1e-13, by other steps and from parameters that are some roundings off. "one run" counts the cells that
need no second one; "over" those of them that are off by more than rtol, "under" those whose error is less than half of
the true one and matters (above a tenth of rtol). Exit status 1 where any cell is over.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from kernels.codegen.compiled import runner
from kernels.codegen.to_tolerance import OF_A_STEP, STATED, by_runs, told
from kernels.interface import Status
from kernels.scene import Scene, exp, power, sign, sin

BLOCK, TRUTH, FLOOR = 20_000, 1e-13, 2e-12
"""Cells at a time; rtol of the truth; errors below what the truth is surely right to are not judged."""


def surface(x, side, phi0):
    return phi0 - side * x


def start():
    return 0.0, 0.0


def powered(x, v, side, mu, a, c, n):
    return v, side * mu - a * v - c * power(abs(v), n) * sign(v)


def pulsed(x, v, t, side, mu, a, at, wide, high):
    return v, side * mu - a * v + high * exp(-(((t - at) / wide) * ((t - at) / wide))), 1.0


def pendulum(x, v, t, side, mu, a, k, depth, omega):
    return v, side * mu - a * v - k * sin(x) + depth * sin(omega * t), 1.0


def relay(x, v, side, mu, eps):
    return v, eps * (1.0 - x * x) * v - x + side * mu


def cancelling(x, v, side, mu, a, big):
    return v, (side * mu + big) - a * v - big - big * v + big * v


def sticking(x, v, side, mu, a, R):
    return v, side * mu - a * v - R * sign(v)


def timed_start():
    return 0.0, 0.0, 0.0


def decades(random, low, high, n):
    return 10.0 ** random.uniform(low, high, n)


DRAWN = {
    "powered": (powered, start, lambda r, n: {"mu": decades(r, -1, 1, n), "phi0": decades(r, -1, 1, n),
        "a": decades(r, -3, 0, n), "c": decades(r, -2, 0.5, n), "n": r.uniform(0.2, 4.0, n)}),
    "pulsed": (pulsed, timed_start, lambda r, n: {"mu": decades(r, -1, 1, n), "phi0": decades(r, -1, 1, n),
        "a": decades(r, -2, 0, n), "at": r.uniform(0, 10, n), "wide": decades(r, -3, 0.5, n),
        "high": decades(r, -2, 1, n)}),
    "pendulum": (pendulum, timed_start, lambda r, n: {"mu": decades(r, -0.5, 0.5, n), "phi0": decades(r, -1, 0, n),
        "a": decades(r, -2, -0.3, n), "k": decades(r, -1, 0.3, n), "depth": decades(r, -2, 0.3, n),
        "omega": decades(r, -1, 1, n)}),
    "relay": (relay, start, lambda r, n: {"mu": decades(r, -0.3, 0.7, n), "phi0": decades(r, -1, -0.3, n),
        "eps": decades(r, -2, 1, n)}),
    "cancelling": (cancelling, start, lambda r, n: {"mu": decades(r, -1, 1, n), "phi0": decades(r, -1, 1, n),
        "a": decades(r, -2, 0, n), "big": decades(r, 0, 8, n)}),
    "sticking": (sticking, start, lambda r, n: (lambda mu: {"mu": mu, "phi0": decades(r, -1, 1, n),
        "a": decades(r, -3, 0.5, n), "R": mu * (1 - decades(r, -7, -0.1, n))})(decades(r, -1, 1, n))),
}  # fmt: skip


def scene_of(name):
    rates, begin, draw = DRAWN[name]
    states = ("x", "v", "t") if begin is timed_start else ("x", "v")
    return Scene(name, "", states, tuple(draw(np.random.default_rng(0), 1)), rates, surface, begin)


def block(name, scene, random, n):
    """Stated and true errors over rtol of the cells that one run calls OK, and how many there are in all."""
    columns = [*DRAWN[name][2](random, n).values(), random.integers(1, 31, n).astype(float)]
    rtol = decades(random, -11, -4, n)
    telling, states = runner(scene, "told"), len(scene.states)
    begin = time.thread_time()
    results, status, error = told(telling, columns, rtol, OF_A_STEP * rtol)
    spent = time.thread_time() - begin
    ok = status == Status.OK
    truth, status, _ = by_runs(runner(scene, "taylor"), columns, np.full(n, TRUTH))
    known = ok & (status == Status.OK)
    true = _error(results, truth[: 2 + states], states)
    judged = known & (rtol > FLOOR)
    stated = STATED * error
    return (stated / rtol)[judged], (true / rtol)[judged], np.array([n, ok.sum(), (ok & ~known).sum()]), spent


def _error(results, true, states):
    """The largest relative error of a cell; of a state relative to its largest size on the way."""
    with np.errstate(all="ignore"):
        scale = np.concatenate([abs(true[:2]), results[2 + states : -1]])
        return (abs(results[: 2 + states] - true) / np.where(scale > 0, scale, 1.0)).max(axis=0)


def main(arguments):
    """1 where a value called OK is off by more than its rtol."""
    parser = argparse.ArgumentParser(description="Is a stated error ever too small?")
    parser.add_argument("--cells", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", nargs="*", default=list(DRAWN), choices=list(DRAWN))
    given = parser.parse_args(arguments)
    print(f"{'scene':<12}{'cells':>8}{'one run':>9}{'unsure':>8}{'over':>6}{'under':>7}{'worst':>8}{'stated/true':>13}")
    worst = 0
    for name in given.scenes:
        scene, random, parts = scene_of(name), np.random.default_rng(given.seed), []
        left = given.cells // len(given.scenes)
        while left > 0:
            parts.append(block(name, scene, random, min(left, BLOCK)))
            left -= BLOCK
        stated, true = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
        cells, ok, unsure = sum(part[2] for part in parts)
        over, under = int((true > 1).sum()), int(((stated < 0.5 * true) & (true > 0.1)).sum())
        matters = true > 0.01
        with np.errstate(all="ignore"):
            ratio = np.median((stated / true)[matters]) if matters.any() else np.nan
        worst = max(worst, over)
        print(f"{name:<12}{cells:>8}{ok:>9}{unsure:>8}{over:>6}{under:>7}{true.max():>8.2f}{ratio:>13.2f}", flush=True)
    return int(worst > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
