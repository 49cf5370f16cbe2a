# How much faster are first flips, rippled torque and noisy torque than with the libraries that can follow them?
"""Prints ratios of this run and errors against 50 digits (needs mpmath and scipy; heyoka.py, of the extra `peers`):

python benchmarks/speed/foliot.py [start] [ripple] [noise]

Rivals (`foliot_rivals.py`) are heyoka.py, in its best form for this (as in `taylor.py`: scalar, fast_math), scipy's
solve_ivp with DOP853 and with LSODA, and diffrax's Dopri8 with all cells side by side; each is told to stop at every
switch and, with dry friction, at every turning point. To find the cycle of a rippled torque they are put into scipy's
secant rule for the speed at the switch; of ours the same two outputs are asked for, and in a line of its own all five,
with sensitivity and multiplier. Ours finds its own error, too. The noise of a cell is given to them as a list of
torques. Tolerances are chosen so that errors are alike; where a rival cannot come so far it is as near as it comes.
Times are processor time, the best of several in turn, compiled before; rivals follow fewer cells.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

from kernels.foliot.noise import FOLIOT_NOISE
from kernels.foliot.ripple import FOLIOT_RIPPLE
from kernels.foliot.start import FOLIOT_START
from kernels.interface import Status
from kernels.lanes.columns import GROUP, cells_at, entry_of, in_groups
from kernels.lanes.jit import jit
from kernels.maths import philox

sys.path += [str(Path(__file__).parents[2] / "tests" / name) for name in ("oracles", "helpers")]
import foliot_oracles
import ripple_oracles
from columns import solve
from mpmath import mp, mpf

try:
    from foliot_rivals import (
        FLIPS,
        HALF_SWINGS,
        HARMONIC,
        NAMES,
        Diffrax,
        Heyoka,
        Scipy,
        cycle,
        first_flips,
        noisy,
        together,
    )  # fmt: skip
except ImportError:
    sys.exit("heyoka.py or diffrax is not here; install the extra: pip install -e '.[peers]'")

CELLS, JUDGED, ROUNDS, SIGMA = 16384, 6, 3, 0.1
FOLLOWED = {"heyoka.py": 60, "diffrax": 60, "DOP853": 6, "LSODA": 6}
DAY = 86400.0


@jit
def _draw(first, columns, place, row, turns):
    seed, ones, twos = columns
    philox.fill(first, seed, place, 1, 0, row, turns)
    ones[cells_at(first)], twos[cells_at(first)] = philox.gaussians(row[cells_at(0)], turns[cells_at(0)])


@partial(entry_of, per_cell=(True, False, False, False, True, True), kept=True)
def draw(seed, place, row, turns, ones, twos):
    """A pair of the normal numbers of every seed."""
    in_groups(_draw, (seed, ones, twos), (int(place[0]), row, turns))


def numbers(cells):
    """The normal numbers of the kernel for seeds 0, 1, ...: (cells, HALF_SWINGS)."""
    found = np.empty((cells, HALF_SWINGS))
    for place in range(HALF_SWINGS // 2):
        ones, twos = np.empty(cells), np.empty(cells)
        draw(np.arange(float(cells)), np.array([float(place)]), np.empty(GROUP), np.empty(GROUP), ones, twos)
        found[:, 2 * place], found[:, 2 * place + 1] = ones, twos
    return found


def spread(low, high, seed):
    """A random number for each cell, even in its logarithm."""
    return 10.0 ** np.random.default_rng(seed).uniform(np.log10(low), np.log10(high), CELLS)


class Start:
    """The first flips with viscous and dry friction and a spring, from rest amid the way."""

    title, turns, asked, follow = f"first {FLIPS} flips", True, None, staticmethod(first_flips)
    tolerances = (1e-6, 1e-6, 1e-7, 1e-8, 1e-9), (1e-10, 1e-10, 1e-11, 1e-13, 1e-13)

    def __init__(self):
        self.own = {
            "mu": spread(0.1, 10, 1),
            "a": spread(0.1, 1, 2),
            "R": spread(1e-3, 1e-2, 3),
            "k": spread(0.01, 0.05, 4),
        }
        self.own["k"] *= self.own["mu"]
        self.cells = list(zip(*(self.own[name] for name in NAMES[:4]), np.zeros(CELLS), strict=True))

    def ours(self, rtol):
        along = (np.arange(1.0, FLIPS + 1),)
        found, status = solve(FOLIOT_START, "segments", phi0=1.0, phi_start=0.0, rtol=rtol, along=along, **self.own)
        assert not status.any()
        return np.stack([found["flip_time"], found["flip_speed"]], axis=2).reshape(CELLS, -1)

    def truth(self, i):
        mu, a, R, k, _ = self.cells[i]
        times, speeds = foliot_oracles.flips(mu, 1.0, 0.0, FLIPS, a=a, R=R, k=k, digits=50)
        return [value for pair in zip(times, speeds, strict=True) for value in pair]


class Ripple:
    """The limit cycle with a torque that goes up and down by as much as a half."""

    title, turns, follow = "cycle of a rippled torque", False, staticmethod(cycle)
    asked = "period", "crossing_speed"
    tolerances = (1e-8, 1e-7, 1e-8, 1e-8, 1e-9), (1e-12, 1e-13, 1e-12, 1e-13, 1e-13)

    def __init__(self):
        self.own = {"mu": spread(0.1, 10, 1), "a": spread(0.1, 1, 2), "depth": spread(0.05, 0.5, 3)}
        mu, a, depth = self.own.values()
        self.cells = list(zip(mu, a, np.zeros(CELLS), np.zeros(CELLS), depth, strict=True))

    def ours(self, rtol, asked=asked):
        found, status = solve(
            FOLIOT_RIPPLE, "taylor", phi0=1.0, harmonic=float(HARMONIC), rtol=rtol, asked=asked, **self.own
        )
        assert (status <= Status.INACCURATE).all()
        return np.stack([found["period"], found["crossing_speed"]], axis=1)

    def truth(self, i):
        mu, a, _, _, depth = self.cells[i]
        period, _, speed, *_ = ripple_oracles.by_taylor(mu, 1.0, a=a, depth=depth, harmonic=HARMONIC)
        return [period, speed]


class Noise:
    """A run with white noise of the torque and viscous friction."""

    title, turns, asked, follow = f"{HALF_SWINGS} half swings of a noisy torque", False, None, staticmethod(noisy)
    tolerances = (1e-8, 1e-8, 1e-9, 1e-10, 1e-10), (1e-12, 1e-13, 1e-12, 1e-13, 1e-13)

    def __init__(self):
        self.a, self.torques = spread(0.1, 1, 2), 1.0 + SIGMA * numbers(CELLS)
        self.cells = [self._cell(i) for i in range(max(FOLLOWED.values()))]

    def _cell(self, i):
        period, _, speed, *_ = foliot_oracles.cycle(1.0, 1.0, a=self.a[i])
        return 1.0, self.a[i], 0.0, 0.0, 0.0, (float(period) / 2, float(speed)), self.torques[i]

    def ours(self, rtol):
        seeds = {"seed": np.arange(float(CELLS)), "half_swings": float(HALF_SWINGS), "sigma": SIGMA}
        found, status = solve(
            FOLIOT_NOISE, "segments", mu=1.0, phi0=1.0, a=self.a, rtol=rtol, averaging_time=1.0, **seeds
        )
        assert not status.any()
        return 1.0 / (1.0 + found["rate_error_s_per_day"][:, None] / DAY)

    def truth(self, i):
        with mp.workdps(50):
            period, _, speed, *_ = foliot_oracles.cycle(1.0, 1.0, a=self.a[i])
            total = mpf(0)
            for torque in map(mpf, map(float, self.torques[i])):
                law = foliot_oracles.law_of(torque, 1, self.a[i], 0, 0, 0, 0, 1)
                swing = foliot_oracles.Flows.half_swing(law, speed / mp.sqrt(torque))
                speed, total = swing.speed * mp.sqrt(torque), total + swing.time / mp.sqrt(torque)
            return [total / (HALF_SWINGS * period / 2)]


def worst(found, truth):
    """The largest relative error."""
    pairs = ((f, t) for row, true in zip(found, truth, strict=False) for f, t in zip(row, true, strict=True))
    return max(abs(float(mpf(float(f)) / t - 1)) for f, t in pairs)


def seconds(function):
    """Processor time of one call, and what it gave."""
    begin = time.process_time()
    found = function()
    return time.process_time() - begin, found


def runs_of(scene, tolerances):
    """For each follower how many cells it does, and the function that does them."""
    ours, *theirs = tolerances
    makers = {
        "heyoka.py": Heyoka,
        "diffrax": Diffrax,
        "DOP853": lambda tolerance, turns: Scipy("DOP853", tolerance, turns),
        "LSODA": lambda tolerance, turns: Scipy("LSODA", tolerance, turns),
    }
    runs = {"ours": (CELLS, lambda: scene.ours(ours))}
    if scene.asked:
        runs["ours, all outputs"] = CELLS, lambda: scene.ours(ours, None)
    for (name, maker), tolerance in zip(makers.items(), theirs, strict=True):
        cells, follower = scene.cells[: FOLLOWED[name]], maker(tolerance, scene.turns)
        if name == "diffrax":
            runs[name] = len(cells), lambda rival=follower, cells=cells: scene.follow(rival, together(cells)).T
        else:
            runs[name] = len(cells), lambda rival=follower, cells=cells: [scene.follow(rival, cell) for cell in cells]
    return runs


def compare(scene):
    """Prints microseconds a cell, ratios and errors, at a loose and at a tight tolerance."""
    truth = [scene.truth(i) for i in range(JUDGED)]
    for tolerances in scene.tolerances:
        runs = runs_of(scene, tolerances)
        for name in list(runs)[:-2]:  # compiled before they are timed; scipy is not
            runs[name][1]()
        rounds = [{name: seconds(run) for name, (_, run) in runs.items()} for _ in range(ROUNDS)]
        own = min(each["ours"][0] for each in rounds) / CELLS
        print(f"{scene.title:34}{'us/cell':>12}{'ratio':>10}{'worst error':>14}")
        for name, (count, _) in runs.items():
            spent = min(each[name][0] for each in rounds) / count
            error = worst(rounds[0][name][1], truth)
            print(f"  {name:32}{spent * 1e6:12.2f}{spent / own:10.1f}{error:14.1e}", flush=True)


if __name__ == "__main__":
    for scene in (Start, Ripple, Noise):
        if scene.__name__.lower() in (sys.argv[1:] or ["start", "ripple", "noise"]):
            compare(scene())
