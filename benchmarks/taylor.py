# How much faster are a foliot's beats followed by Taylor series in lanes than by heyoka.py, at equal error?
"""A foliot with viscous and quadratic drag, 40 switches from rest; prints ratios measured in this run, on one core:

python benchmarks/taylor.py          (needs the extra `peers`)

heyoka.py is in its best form for this: its scalar integrator with fast_math and one terminal event that is told
whether the turning point or the switch comes next. Ours is `taylor_once` of a scene given as plain Python: every step
is proved to pass no switch over, and every cell's steps are its own; beside it `taylor`, which follows each cell twice
to say how far it can be believed. Errors are the worst of time and speed against closed forms in 40 digits. Times are
CPU seconds of the thread, the best of a few runs in turn. The last lines: cells of 4 to 400 switches, refilled and
dealt, against the same lanes in lockstep.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from kernels import _taylor_solve
from kernels._scene_module import build
from kernels.scene import Scene

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from scene_oracles import quadratic_foliot

try:
    import heyoka as hy
except ImportError:
    sys.exit("heyoka.py is not here; install it with: pip install 'foliot[peers]'")

FLIPS, CELLS, THEIR_CELLS, JUDGED, ROUNDS = 40, 64_000, 400, 60, 5


def rates(angle, speed, side, mu, a, c):
    return speed, side * mu - a * speed - c * speed * abs(speed)


def surface(angle, side, phi0):
    return phi0 - side * angle


def start():
    return 0.0, 0.0


SCENE = Scene("drag", "foliot with quadratic drag", ("angle", "speed"), ("mu", "phi0", "a", "c"), rates, surface, start)


def cells(n):
    """mu, phi0, a, c: drag from a tenth to all of what the drive does."""
    random = np.random.default_rng(1)
    mu, a, c = 10.0 ** random.uniform(-1, 1, n), 10.0 ** random.uniform(-1, 0, n), 10.0 ** random.uniform(-1, 0, n)
    return mu, np.ones(n), a, c


def peer(tolerance):
    """heyoka.py following one cell: x'' = side mu - a v - way c v^2, one event, at the turning point or the switch."""
    x, v = hy.make_vars("x", "v")
    side, way, mu, a, c, phi0, turning = (hy.par[i] for i in range(7))
    count = [0]

    def met(ta, _):
        pars = ta.pars
        if pars[6] > 0.5:
            pars[1], pars[6] = -pars[1], 0.0
            return True
        count[0] += 1
        pars[0], pars[6] = -pars[0], 1.0
        return count[0] < FLIPS

    event = turning * way * v + (1.0 - turning) * (phi0 - side * x)
    ta = hy.taylor_adaptive(
        [(x, v), (v, side * mu - a * v - c * way * v * v)],
        [0.0, 0.0],
        t_events=[hy.t_event(event, callback=met, direction=hy.event_direction.negative)],
        tol=tolerance,
        pars=[0.0] * 7,
        fast_math=True,
    )

    def follow(mu, phi0, a, c):
        count[0] = 0
        ta.time = 0.0
        ta.state[:] = 0.0
        ta.pars[:] = 1.0, 1.0, mu, a, c, phi0, 0.0
        ta.reset_cooldowns()
        ta.propagate_until(1e12)
        return ta.time, abs(ta.state[1])

    return follow


def theirs(tolerance):
    follow = peer(tolerance)
    chosen = list(zip(*(column[:THEIR_CELLS] for column in cells(CELLS)), strict=True))
    follow(*chosen[0])
    begin = time.thread_time()
    found = np.array([follow(*cell) for cell in chosen])
    return THEIR_CELLS / (time.thread_time() - begin), found


def ours(module, tolerance, twice=False):
    columns = (*cells(CELLS), np.full(CELLS, float(FLIPS)))
    outputs, status = [np.empty(CELLS) for _ in range(4)], np.empty(CELLS, np.int8)
    follow = _taylor_solve.twice if twice else _taylor_solve.once
    begin = time.thread_time()
    follow(module, columns, np.full(CELLS, tolerance), outputs, status)
    rate = CELLS / (time.thread_time() - begin)
    assert not status[:JUDGED].any()
    return rate, np.stack([outputs[0], abs(outputs[3])], axis=1)


def worst(found, truth):
    return max(
        abs(float(f / t - 1)) for row, true in zip(found, truth, strict=False) for f, t in zip(row, true, strict=True)
    )


def uneven(module, together):
    """Cells per second where cells have 4 to 400 switches."""
    random = np.random.default_rng(2)
    n = CELLS // 8
    flips = np.floor(10.0 ** random.uniform(np.log10(4), np.log10(400), n))
    columns = (*(column[:n] for column in cells(CELLS)), flips)
    begin = time.thread_time()
    _taylor_solve.followed(module, columns, np.full(n, 1e-8), together=together)
    return n / (time.thread_time() - begin)


def main():
    module = build(SCENE)
    truth = [quadratic_foliot(*cell, FLIPS) for cell in zip(*(c[:JUDGED] for c in cells(CELLS)), strict=True)]
    for near, their, our in (("1e-8", 1e-6, 3e-8), ("1e-12", 1e-10, 2e-12)):
        runs = [
            ("heyoka.py", lambda tol=their: theirs(tol)),
            ("taylor_once", lambda tol=our: ours(module, tol)),
            ("taylor", lambda tol=our: ours(module, tol, True)),
        ]
        runs[1][1]()  # compiled before it is timed
        best = {name: max((call() for _ in range(ROUNDS)), key=lambda found: found[0]) for name, call in runs}
        print(f"near {near:8}{'cells/s':>12}{'ratio':>8}{'worst error':>14}")
        for name, (rate, found) in best.items():
            print(f"{name:13}{rate:12,.0f}{rate / best['heyoka.py'][0]:8.1f}{worst(found, truth):14.1e}")
    dealt, lockstep = (max(uneven(module, together) for _ in range(3)) for together in (False, True))
    print(f"cells of 4 to 400 switches: {dealt:,.0f} cells/s refilled, {lockstep:,.0f} in lockstep;", end=" ")
    print(f"{dealt / lockstep:.1f} times")


if __name__ == "__main__":
    main()
