# How fast is an impact clock followed contact by contact, against the same loop in C and against a general integrator?
"""Prints ratios measured in this run, on one core, and the largest difference of what came out:

python benchmarks/speed/impact.py

The C rival (impact_events.c) needs gcc, the integrator needs scipy; what is missing is left out.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numba import njit

from kernels.impact import _contacts, _followed, _half_swing
from kernels.impact.clock import IMPACT

CELLS, HALF_SWINGS, REPEATS = 2000, 200, 7
NAMES = ("time", "way", "travel", "loss", "rim", "pallet", "recoil", "margin", "held", "impacts", "events")
ENTRIES = tuple(
    getattr(_half_swing, name)
    for name in ("TIME", "WAY", "DIPS", "LOSS", "RIM", "PALLET", "RECOIL", "MARGIN", "HELD", "IMPACTS", "EVENTS")
)


def clocks(n, seed=1):
    """Random scenes (wheel, pallet, eta, e): kappa 0.01 to 100, e up to 0.9, a twentieth of them plastic."""
    random = np.random.default_rng(seed)
    kappa, eta = 10 ** random.uniform(-2, 2, n), random.uniform(0, 0.25, n)
    e = np.where(random.random(n) < 0.05, 0.0, random.uniform(0, 0.9, n))
    return np.column_stack([kappa / (1 + kappa), 1 / (1 + kappa), eta, e])


@njit(error_model="numpy", nogil=True)
def ours(scenes, starts, half_swings, out):
    """The kernel's own loop, as `attractor` follows a clock between two looks at whether it repeats."""
    history, slopes, tally = np.empty((half_swings + 1, 3)), np.empty((5, 3)), np.empty(_half_swing.TALLIES)
    for i in range(scenes.shape[0]):
        scene = _contacts.PlainScene(scenes[i, 0], scenes[i, 1], scenes[i, 2], scenes[i, 3], 0.0, 0.0)
        _half_swing.clear(tally)
        start = _half_swing.Start(starts[i, 0], starts[i, 1], starts[i, 2])
        start, _ = _followed.follow(scene, start, half_swings, history, tally, slopes)
        starts[i, 0], starts[i, 1], starts[i, 2] = start
        for j in range(len(ENTRIES)):
            out[i, j] = tally[ENTRIES[j]]


@njit
def beginnings(scenes, starts):
    """Where `events` begins."""
    for i in range(scenes.shape[0]):
        wheel, pallet, e = scenes[i, 0], scenes[i, 1], scenes[i, 3]
        scene = _contacts.PlainScene(wheel, pallet, scenes[i, 2], e, 0.0, -0.25 * wheel * (1 + e) / (1 - e))
        starts[i, 0], starts[i, 1], starts[i, 2] = _followed.beginning(scene, 1e-6)


def in_c(folder):
    """The loop of impact_events.c, compiled here; None without gcc."""
    gcc = shutil.which("gcc")
    if not gcc:
        return None
    source, library = Path(__file__).with_name("impact_events.c"), Path(folder) / "impact_events.so"
    subprocess.run([gcc, "-O3", "-march=native", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    follow = ctypes.CDLL(str(library)).follow
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C")
    follow.argtypes = [ctypes.c_long, pointer, pointer, ctypes.c_long, pointer]

    def theirs(scenes, starts, half_swings, out):
        wide = np.empty((len(scenes), 12))
        follow(len(scenes), scenes, starts, half_swings, wide)
        out[:] = wide[:, :11]

    return theirs


def seconds(loop, scenes, begun, half_swings, out):
    """Time of one pass, and where it ends."""
    starts = begun.copy()
    start = time.perf_counter()
    loop(scenes, starts, half_swings, out)
    return time.perf_counter() - start, starts


def against_c(scenes, begun, rival):
    """Both in turn, in this run: the median ratio, events per second, and the largest difference."""
    mine, theirs = np.empty((len(scenes), len(NAMES))), np.empty((len(scenes), len(NAMES)))
    seconds(ours, scenes, begun, HALF_SWINGS, mine), seconds(rival, scenes, begun, HALF_SWINGS, theirs)
    pairs = [
        (seconds(ours, scenes, begun, HALF_SWINGS, mine)[0], seconds(rival, scenes, begun, HALF_SWINGS, theirs)[0])
        for _ in range(REPEATS)
    ]
    ratio = float(np.median([a / b for a, b in pairs]))
    a, b = (min(t) / mine[:, -1].sum() * 1e9 for t in zip(*pairs, strict=True))
    print(f"{'events of random clocks, ns each':48} {a:8.1f} here {b:8.1f} in C   time here / time in C {ratio:.2f}")
    orderly = (mine[:, -2:] == theirs[:, -2:]).all(axis=1) & np.isclose(mine[:, 0], theirs[:, 0], rtol=1e-9)
    rough = np.abs(mine[orderly, :3] / theirs[orderly, :3] - 1).max()
    print(
        f"{orderly.sum()} of {len(scenes)} clocks have the same events after {HALF_SWINGS} half swings; in those time, "
        f"way and travel differ by {rough:.1e} at most (the others wander, and double each rounding)"
    )


def integrated(kappa, e, until):
    """Teeth met by a symmetric one-impact clock until some time, by solve_ivp with events that end a step; eta = 0."""
    from scipy.integrate import solve_ivp

    half = np.sqrt((1 + e) / (1 - e) / (1 + kappa))
    w = kappa * half / 2
    state, t, teeth = [-w * half / 2, -w * half / 2, half * (kappa * (1 - e) - 2 * e) / (2 * (1 + e)), w], 0.0, 0
    while t < until:
        side = -1 if state[3] > 0 else 1
        tooth = 0.5 * (teeth + 1)

        def gap(_, s, side=side, tooth=tooth):
            return s[0] - side * s[1] - tooth

        gap.terminal, gap.direction = True, 1
        found = solve_ivp(lambda _, s: [s[2], s[3], 1.0, 0.0], (t, until), state, events=gap, rtol=1e-12, atol=1e-14)
        t, state = found.t[-1], list(found.y[:, -1])
        push = (1 + e) * (state[2] - side * state[3]) / (1 + kappa)
        state[2], state[3] = state[2] - push, state[3] + side * kappa * push
        teeth += 1
    return teeth


def against_scipy():
    """The same swings of the example by a general integrator."""
    try:
        import scipy  # noqa: F401
    except ImportError:
        print("solve_ivp: scipy is not here")
        return
    kappa, eta, e, half_swings = 4.0, 0.0, 0.2, 100
    scenes = np.array([[kappa / (1 + kappa), 1 / (1 + kappa), eta, e]])
    begun, out = np.empty((1, 3)), np.empty((1, len(NAMES)))
    beginnings(scenes, begun)
    seconds(ours, scenes, begun, half_swings, out)
    mine = min(seconds(ours, scenes, begun, half_swings, out)[0] for _ in range(REPEATS))
    start = time.perf_counter()
    teeth = integrated(kappa, e, out[0, 0])
    theirs = time.perf_counter() - start
    print(
        f"{'one clock, 100 half swings':48} {mine * 1e6:8.1f} us here {theirs * 1e3:8.1f} ms by solve_ivp "
        f"({teeth} impacts)   solve_ivp / here {theirs / mine:.0f}"
    )


def rates():
    """Cells per second of every method, on clocks of all kinds."""
    random = np.random.default_rng(2)
    for method in IMPACT.methods:
        n = 20_000 if method.name == "events" else 200_000
        kappa, eta = 10 ** random.uniform(-2, 2, n), random.uniform(0, 0.25, n)
        ones = np.ones(n)
        columns = [ones * 1e-3, kappa * 1e-5, ones * 1e-5, ones * 0.03, ones * 0.03, ones * 31.0]
        columns += [eta * (2 * np.pi * 0.03 / 31), random.uniform(0, 0.9, n), 0 * ones, ones * 1e-9]
        outputs = [*(np.empty(n) for _ in IMPACT.outputs), np.empty(n, np.int8)]
        method.solve(*(c[:32] for c in columns), *(c[:32] for c in outputs))
        best = np.inf
        for _ in range(3):
            start = time.perf_counter()
            method.solve(*columns, *outputs)
            best = min(best, time.perf_counter() - start)
        print(f"{method.name:8} {n / best:12.0f} cells/s")


def main():
    """Measure and print."""
    scenes = clocks(CELLS)
    begun = np.empty((CELLS, 3))
    beginnings(scenes, begun)
    with tempfile.TemporaryDirectory() as folder:
        rival = in_c(folder)
        if rival:
            against_c(scenes, begun, rival)
        else:
            print("C: gcc is not here")
    against_scipy()
    rates()


if __name__ == "__main__":
    sys.exit(main())
