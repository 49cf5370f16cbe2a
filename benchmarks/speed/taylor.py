# How much faster are a foliot's beats followed by Taylor series in lanes than by heyoka.py, at equal error?
"""A foliot with viscous and quadratic drag from rest, and one whose drag has any power; prints ratios of this run:

python benchmarks/speed/taylor.py          (needs the extra `peers`)

heyoka.py is in its best form for this: its scalar integrator with fast_math. For the quadratic drag it has one terminal
event that is told whether the turning point or the switch comes next. A power has no series at v = 0 and no other
integrator restarts there; heyoka.py is given v (v^2 + w^2)^((n - 1)/2) instead, with a w so small that its error is not
of it, and the switch as its event. Ours is `taylor_once` of a scene given as plain Python: every step is proved to pass
no switch over, and every cell's steps are its own; beside it `taylor`, which carries its error along to say how far it
can be believed, at steps as tight; and both through `sweep.run`, in memory. Errors are the worst of time and speed
against closed forms in 40 digits, or integrals in 24. Times are CPU seconds of the thread, the best of a few runs in
turn. The last lines: cells of 4 to 400 switches, refilled and dealt, against the same lanes in lockstep; and, through
`sweep.run`, all cores against one on an uneven log grid (seconds of the clock: to be believed on an idle machine only).
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from engine import speedup

import sweep
from kernels.codegen.compiled import runner
from kernels.codegen.followed import followed
from kernels.codegen.to_tolerance import OF_A_STEP, by_error, once
from kernels.scene import Field, Scene, power, scene_kernel, sign

sys.path += [str(Path(__file__).parents[2] / "tests" / name) for name in ("oracles", "helpers")]
from scene_oracles import power_foliot, quadratic_foliot

try:
    import heyoka as hy
except ImportError:
    sys.exit("heyoka.py is not here; install the extra: pip install -e '.[peers]'")

CELLS, THEIR_CELLS, ROUNDS = 200_000, 400, 5
FLIPS, JUDGED = 40, 60
POWER, POWER_FLIPS, POWER_JUDGED = 1.5, 8, 5


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


def general_rates(angle, speed, side, mu, a, c, n):
    return speed, side * mu - a * speed - c * power(abs(speed), n) * sign(speed)


GENERAL = Scene(
    "power", "foliot with any drag", ("angle", "speed"), ("mu", "phi0", "a", "c", "n"), general_rates, surface, start
)


def kernel_of(scene):
    """The scene as a study's kernel."""
    states, parameters = (tuple(Field(n, "1", n) for n in names) for names in (scene.states, scene.parameters))
    parts = {"rates": scene.rates, "surface": scene.surface, "start": scene.start}
    return scene_kernel(name=scene.name, doc=scene.doc, states=states, parameters=parameters, **parts)


DRAG, POWER_DRAG = kernel_of(SCENE), kernel_of(GENERAL)


def integrator(event, drag, met, tolerance, pars):
    """heyoka.py on x'' = side mu - a v - drag."""
    x, v = hy.make_vars("x", "v")
    side, mu, a = hy.par[0], hy.par[2], hy.par[3]
    return hy.taylor_adaptive(
        [(x, v), (v, side * mu - a * v - drag)],
        [0.0, 0.0],
        t_events=[hy.t_event(event, callback=met, direction=hy.event_direction.negative)],
        tol=tolerance,
        pars=[0.0] * pars,
        fast_math=True,
    )


def peer(tolerance):
    """heyoka.py following one cell with drag c v^2 against its way; its event is the turning point or the switch."""
    x, v = hy.make_vars("x", "v")
    side, way, c, phi0, turning = (hy.par[i] for i in (0, 1, 4, 5, 6))
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
    ta = integrator(event, c * way * v * v, met, tolerance, 7)
    return followed_by(ta, count, (0.0,))


def power_peer(tolerance, w):
    """heyoka.py following one cell with drag c v (v^2 + w^2)^((n - 1)/2)."""
    x, v = hy.make_vars("x", "v")
    side, c, phi0 = (hy.par[i] for i in (0, 4, 5))
    count = [0]

    def met(ta, _):
        count[0] += 1
        ta.pars[0] = -ta.pars[0]
        return count[0] < POWER_FLIPS

    drag = c * v * (v * v + w * w) ** ((POWER - 1.0) / 2.0)
    return followed_by(integrator(phi0 - side * x, drag, met, tolerance, 6), count, ())


def followed_by(ta, count, rest):
    """The function of a cell that is followed from rest to its last switch."""

    def follow(mu, phi0, a, c):
        count[0] = 0
        ta.time = 0.0
        ta.state[:] = 0.0
        ta.pars[:] = 1.0, 1.0, mu, a, c, phi0, *rest
        ta.reset_cooldowns()
        ta.propagate_until(1e12)
        return ta.time, abs(ta.state[1])

    return follow


def theirs(follow):
    chosen = list(zip(*(column[:THEIR_CELLS] for column in cells(CELLS)), strict=True))
    follow(*chosen[0])
    begin = time.thread_time()
    found = np.array([follow(*cell) for cell in chosen])
    return THEIR_CELLS / (time.thread_time() - begin), found


def ours(subject, columns, tolerance, follow):
    begin = time.thread_time()
    outputs, status, *_ = follow(subject, columns, np.full(CELLS, tolerance))
    rate = CELLS / (time.thread_time() - begin)
    assert not status[:JUDGED].any()
    return rate, np.stack([outputs[0], abs(outputs[3])], axis=1)


def by_run(scene, columns, tolerance, method):
    """The same cells through `sweep.run`, by one worker."""
    named = dict(zip((*scene.parameters, "flips"), columns, strict=True))
    axes = {name: column for name, column in named.items() if np.ptp(column)}
    fixed = {name: column[0] for name, column in named.items() if name not in axes}
    kernel = "taylor:DRAG" if scene is SCENE else "taylor:POWER_DRAG"
    keys = {"kernel": kernel, "allow_import": True, "design": "zip", "method": method, "rtol": tolerance}
    study = sweep.study(**keys, axes=axes, fixed=fixed)
    begin = time.process_time()
    found = sweep.run(study, workers=1, progress=False)
    rate = CELLS / (time.process_time() - begin)
    return rate, np.stack([found.time, abs(found.speed)], axis=1)


def worst(found, truth):
    return max(
        abs(float(f / t - 1)) for row, true in zip(found, truth, strict=False) for f, t in zip(row, true, strict=True)
    )


def uneven(one):
    """Cells per second where cells have 4 to 400 switches."""
    random = np.random.default_rng(2)
    n = CELLS // 8
    flips = np.floor(10.0 ** random.uniform(np.log10(4), np.log10(400), n))
    columns = (*(column[:n] for column in cells(CELLS)), flips)
    begin = time.thread_time()
    followed(one, columns, np.full(n, 1e-8))
    return n / (time.thread_time() - begin)


def compare(title, follow, scene, columns, tolerance, truth):
    """Prints cells per second, ratios and errors."""
    plain, rtol = runner(scene, "taylor"), tolerance / OF_A_STEP
    runs = {
        "heyoka.py": lambda: theirs(follow),
        "taylor_once": lambda: ours(plain, columns, tolerance, once),
        "taylor": lambda: ours(runner(scene, "told"), columns, rtol, by_error),
    }
    runs["taylor_once, run"] = lambda: by_run(scene, columns, tolerance, "taylor_once")
    runs["taylor, run"] = lambda: by_run(scene, columns, rtol, "taylor")
    for name in list(runs)[1:]:  # compiled before they are timed
        runs[name]()
    rounds = [{name: run() for name, run in runs.items()} for _ in range(ROUNDS)]
    best = {name: max((each[name] for each in rounds), key=lambda found: found[0]) for name in runs}
    print(f"{title:24}{'cells/s':>12}{'ratio':>8}{'worst error':>14}")
    for name, (rate, found) in best.items():
        print(f"  {name:22}{rate:12,.0f}{rate / best['heyoka.py'][0]:8.1f}{worst(found, truth):14.1e}", flush=True)


def cores():
    """Seconds of a whole run on one core over those on all, where a cell has 4 to 400 switches; the median of a few."""
    flips = np.unique(np.floor(np.geomspace(4, 400, 60)))
    study = sweep.study(
        kernel="rich_scene:RICH",
        allow_import=True,
        method="taylor_once",
        rtol=1e-8,
        axes={"flips": flips, "mu": np.geomspace(0.1, 10, 60), "c": np.geomspace(0.1, 1, 200)},
        fixed={"phi0": 1.0, "a": 0.3},
    )
    return speedup(study, ROUNDS)


def main():
    own = cells(CELLS)
    truth = [quadratic_foliot(*cell, FLIPS) for cell in zip(*(c[:JUDGED] for c in own), strict=True)]
    columns = (*own, np.full(CELLS, float(FLIPS)))
    for near, their, our in (("1e-8", 1e-6, 6e-8), ("1e-12", 1e-10, 3e-12)):
        compare(f"v abs(v), near {near}", peer(their), SCENE, columns, our, truth)
    truth = [power_foliot(*cell, POWER, POWER_FLIPS) for cell in zip(*(c[:POWER_JUDGED] for c in own), strict=True)]
    columns = (*own, np.full(CELLS, POWER), np.full(CELLS, float(POWER_FLIPS)))
    for near, their, w, our in (("1e-8", 1e-7, 8e-5, 2.5e-9), ("1e-12", 5e-12, 1e-6, 8e-13)):
        compare(f"abs(v)^{POWER}, near {near}", power_peer(their, w), GENERAL, columns, our, truth)
    rate = max(uneven(runner(SCENE, "taylor")) for _ in range(3))
    print(f"cells of 4 to 400 switches: {rate:,.0f} cells/s")
    print("uneven log grid, {} cores against one: {:.2f} times".format(*cores()))


if __name__ == "__main__":
    main()
