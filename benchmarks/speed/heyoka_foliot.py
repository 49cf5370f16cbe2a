# How much faster is the foliot's cycle solved than integrated by heyoka.py, to the same accuracy?
"""Viscous and Coulomb friction together; prints a ratio measured in this run, on one core (needs the extra `peers`):

python benchmarks/speed/heyoka_foliot.py

heyoka.py integrates from one switch to the next, switches and turning points located as terminal events, until what is
left of the start is below the wanted error: it is told how many half swings that takes, and starts close. foliot's
method `coulomb` solves for the cycle, in lanes. Both errors are against 50 digits.
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

import heyoka as hy
import numpy as np

from kernels.foliot.cycle import FOLIOT

sys.path.append(str(Path(__file__).parents[2] / "tests" / "oracles"))
import foliot_oracles

WANTED = 1e-10
CELLS = 60
MANY = 200_000


def cells(n):
    """mu, phi0, a, R of foliots with alpha from 0.1 to 1000 and R/mu from 0.01 to 0.9."""
    random = np.random.default_rng(1)
    mu = 10.0 ** random.uniform(-1, 3, n)
    return mu, np.ones(n), np.ones(n), mu * 10.0 ** random.uniform(-2, math.log10(0.9), n)


def integrator():
    """x'' = par0 mu - a v - par1 R; par0 the drive's direction, par1 that of the motion; par2.. mu, a, R, phi0."""
    x, v = hy.make_vars("x", "v")
    drive, way, mu, a, friction, phi0 = (hy.par[i] for i in range(6))
    log, wanted = [], [0]

    def switch(ta, _):
        log.append((ta.time, abs(ta.state[1])))
        ta.pars[0] = -ta.pars[0]
        return len(log) < wanted[0]

    def turn(ta, _):
        ta.pars[1] = -ta.pars[1]
        return True

    events = [
        hy.t_event(drive * x - phi0, callback=switch, direction=hy.event_direction.positive),
        hy.t_event(v, callback=turn),
    ]
    motion = [(x, v), (v, drive * mu - a * v - way * friction)]
    return hy.taylor_adaptive(motion, [0.0, 1.0], t_events=events, tol=WANTED, pars=[0.0] * 6), log, wanted


def integrate(peer, cell, start, swings):
    """Period and speed before the switch after that many half swings, from a switch at +phi0."""
    ta, log, wanted = peer
    mu, phi0, a, friction = cell
    log.clear()
    wanted[0] = swings
    ta.time = 0.0
    ta.state[:] = phi0, start
    ta.pars[:] = -1.0, 1.0, mu, a, friction, phi0
    ta.reset_cooldowns()
    ta.propagate_until(1e9)
    return 2.0 * (log[-1][0] - log[-2][0]), log[-1][1]


def ours(n):
    """Cells per second and the period for each exact method, and speed and multiplier of the cycles."""
    mu, phi0, a, friction = cells(n)
    zero = np.zeros(n)
    inputs = [mu, phi0, a, friction, friction, zero, zero + 1.0, zero, zero + 1.0, np.full(n, WANTED)]
    outputs, status = [np.empty(n) for _ in range(5)], np.empty(n, np.int8)
    asked, error = np.ones(5, np.uint8), np.empty(n)
    calls = {
        "segments": lambda: FOLIOT.method("segments").solve(*inputs, asked, *outputs, error, status),
        "coulomb": lambda: FOLIOT.method("coulomb").solve(*inputs, *outputs, status),
    }
    found = {}
    for name, solve in calls.items():
        solve()  # compiled before it is timed
        found[name] = n / min(_timed(solve) for _ in range(3)), outputs[0].copy()
    return found, outputs[2], outputs[4]


def theirs(speed, multiplier):
    """Cells per second, periods and half swings per cell of heyoka.py."""
    swings = np.ceil(np.log(WANTED / 10) / np.log(np.maximum(multiplier[:CELLS], 1e-12))).astype(int) + 2
    peer = integrator()
    chosen = list(zip(*(c[:CELLS] for c in cells(MANY)), strict=True))
    integrate(peer, chosen[0], speed[0] * 1.1, 3)
    start = time.perf_counter()
    found = [integrate(peer, cell, 1.1 * v, int(k)) for cell, v, k in zip(chosen, speed, swings, strict=False)]
    return CELLS / (time.perf_counter() - start), [period for period, _ in found], swings.mean()


def main():
    found, speed, multiplier = ours(MANY)
    rate, periods, swings = theirs(speed, multiplier)
    found["heyoka.py"] = rate, periods
    truth = [
        foliot_oracles.cycle(m, p, a=v, R=r)[0] for m, p, v, r in zip(*(c[:CELLS] for c in cells(MANY)), strict=True)
    ]
    print(f"{'':12}{'cells/s':>12}{'ratio':>8}{'worst error of the period':>28}")
    for name, (speed, periods) in found.items():
        error = max(abs(float(p / t - 1)) for p, t in zip(periods, truth, strict=False))
        print(f"{name:12}{speed:12,.0f}{speed / rate:8,.0f}{error:28.1e}")
    print(f"heyoka.py: {swings:.0f} half swings a cell")


def _timed(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
