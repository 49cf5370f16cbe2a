# How much faster are three scenes, written as a user would write them, than heyoka.py, and on all cores than on one?
"""A forced, damped pendulum, a van der Pol relay and a stick-slip oscillator; prints ratios of this run:

python benchmarks/speed/own_scenes.py          (needs the extra `peers`)

Ours is `taylor_once` of each scene, its kernel alone and through `sweep.run` with all that an engine does (checks,
blocks, statuses, a Dataset in the end). heyoka.py is in its best form, as in `taylor.py`: its scalar integrator with
fast_math and one terminal event; where the oscillator sticks and where it slips its callback sets by hand. Truth is
heyoka.py in 80 bits. Errors are the worst of the last switch's time and of a state there. Times are CPU seconds of the
thread, the best of a few runs in turn. The last lines: whole runs on an uneven grid by `sweep.run`, on all cores
against one, in seconds of the clock (to be believed on an idle machine only).
"""

from __future__ import annotations

import time

import numpy as np
from engine import speedup

import sweep
from kernels.codegen.compiled import runner
from kernels.codegen.to_tolerance import once
from kernels.scene import Field, cos, scene_kernel, scene_of, sin

CELLS, THEIR_CELLS, JUDGED, FLIPS, ROUNDS = 32_000, 200, 20, 20, 3
SPEED, PLACE = 1, 0


def pendulum(x, v, phase, damping, force, omega):
    """Counted where it hangs."""
    return v, force * cos(phase) - damping * v - sin(x), omega


def relay(x, v, side, eps, drive):
    """Driven to the other side wherever x comes to 1 on this one."""
    return v, eps * (1.0 - x * x) * v - x + side * drive


def stick_slip(x, v, side, fall, kinetic):
    """Side 1: carried along by the belt; side -1: slips, under a friction that falls with the speed."""
    slips = 0.5 * (1.0 - side)
    return v, slips * (kinetic + fall * v - x)


def let_go_or_caught(x, v, side, belt, static):
    sticks, slips = 0.5 * (1.0 + side), 0.5 * (1.0 - side)
    return sticks * (static - x) + slips * (belt - v)


def _scene(name, rates, surface, start, states, parameters):
    fields = [tuple(Field(part, "1", part) for part in parts) for parts in (states, parameters)]
    return {"name": name, "doc": name, "states": fields[0], "parameters": fields[1], "rates": rates,
            "surface": surface, "start": start}  # fmt: skip


PENDULUM = _scene(
    "forced_pendulum", pendulum, lambda x, side: side * x, lambda: (1.5, 0.0, 0.0),
    ("x", "v", "phase"), ("damping", "force", "omega"),
)  # fmt: skip
RELAY = _scene(
    "van_der_pol_relay", relay, lambda x, side: 1.0 - side * x, lambda: (0.0, 0.0), ("x", "v"), ("eps", "drive")
)
STICK_SLIP = _scene(
    "stick_slip_modes", stick_slip, let_go_or_caught, lambda belt: (0.0, belt),
    ("x", "v"), ("belt", "fall", "kinetic", "static"),
)  # fmt: skip
KERNELS = {
    scene["name"]: scene_kernel(**scene, example=dict.fromkeys((f.name for f in scene["parameters"]), 0.5))
    for scene in (PENDULUM, RELAY, STICK_SLIP)
}
FORCED_PENDULUM, VAN_DER_POL_RELAY, STICK_SLIP_MODES = KERNELS.values()

RANGES = {
    "forced_pendulum": {"damping": (0.02, 0.1), "force": (0.05, 0.2), "omega": (0.6, 1.2)},
    "van_der_pol_relay": {"eps": (0.1, 1.0), "drive": (0.2, 1.0)},
    "stick_slip_modes": {"belt": (0.1, 0.4), "fall": (0.01, 0.1), "kinetic": (0.5, 0.8), "static": (1.0, 1.2)},
}
WIDTHS = {"forced_pendulum": 14_000, "van_der_pol_relay": 14_000, "stick_slip_modes": 50_000}
"""Cells along an axis of the runs on one core and on all: some seconds, beside which a run's start is short."""


def cells(scene, n):
    """Parameters, even within their ranges."""
    random = np.random.default_rng(1)
    return [random.uniform(*ends, n) for ends in RANGES[scene["name"]].values()]


class Heyoka:
    """heyoka.py following cells of a scene to their last switch."""

    def __init__(self, scene, tolerance, kind=float):
        import heyoka as hy

        names = [field.name for field in scene["states"]]
        u = dict(zip(names, hy.make_vars(*names), strict=True))
        pars = {"side": hy.par[0]} | {f.name: hy.par[1 + j] for j, f in enumerate(scene["parameters"])}

        def rates():
            x, v = u["x"], u["v"]
            if scene is PENDULUM:
                push = pars["force"] * hy.cos(u["phase"]) - pars["damping"] * v - hy.sin(x)
                return [(x, v), (v, push), (u["phase"], pars["omega"] + 0.0 * x)]
            if scene is RELAY:
                return [(x, v), (v, relay(x, v, **{k: pars[k] for k in ("side", "eps", "drive")})[1])]
            return [(x, v), (v, stick_slip(x, v, pars["side"], pars["fall"], pars["kinetic"])[1])]

        def surface():
            if scene is PENDULUM:
                return pars["side"] * u["x"]
            if scene is RELAY:
                return 1.0 - pars["side"] * u["x"]
            return let_go_or_caught(u["x"], u["v"], pars["side"], pars["belt"], pars["static"])

        self.count, self.kind, self.scene = [0], kind, scene
        falls = hy.t_event(surface(), callback=self._stop(), direction=hy.event_direction.negative, fp_type=kind)
        start = np.zeros(len(names), kind)
        how = {"tol": kind(tolerance), "pars": np.zeros(len(pars), kind), "fast_math": kind is float, "fp_type": kind}
        self.motion = hy.taylor_adaptive(rates(), start, t_events=[falls], **how)

    def _stop(self):
        count = self.count

        def stop(motion, _):
            count[0] += 1
            motion.pars[0] = -motion.pars[0]
            return count[0] < FLIPS

        return stop

    def follow(self, cell, judged):
        named = dict(zip((f.name for f in self.scene["parameters"]), cell, strict=True))
        start = self.scene["start"](**({"belt": named["belt"]} if "belt" in named else {}))
        self.count[0], self.motion.time = 0, self.kind(0.0)
        self.motion.state[:], self.motion.pars[:] = start, (1.0, *cell)
        self.motion.reset_cooldowns()
        self.motion.propagate_until(self.kind(1e6))
        return self.motion.time, self.motion.state[judged]


def theirs(follower, columns, judged, n=THEIR_CELLS):
    """Cells per second, and times and states."""
    chosen = list(zip(*(column[:n] for column in columns), strict=True))
    begin = time.thread_time()
    found = np.array([follower.follow(cell, judged) for cell in chosen])
    return n / (time.thread_time() - begin), found


def ours(one, columns, tolerance, judged):
    begin = time.thread_time()
    outputs, status = once(one, [*columns, np.full(CELLS, float(FLIPS))], np.full(CELLS, tolerance))
    rate = CELLS / (time.thread_time() - begin)
    assert not status[:JUDGED].any()
    assert (status == 0).mean() > 0.99  # the pendulum may come to rest where it is counted
    return rate, np.stack([outputs[0], outputs[2 + judged]], axis=1)


def by_engine(scene, columns, tolerance, judged):
    """The same by `sweep.run`, on one core; times are of all threads of the process."""
    names = [f.name for f in scene["parameters"]]
    study = _study(
        scene["name"], tolerance, design="zip", axes=dict(zip(names, columns, strict=True)), fixed={"flips": FLIPS}
    )
    begin = time.process_time()
    found = sweep.run(study, workers=1, progress=False)
    rate = CELLS / (time.process_time() - begin)
    return rate, np.stack([found["time"].values, found[scene["states"][judged].name].values], axis=1)


def _study(name, tolerance, **keys):
    kernel = f"own_scenes:{name.upper()}"
    return sweep.study(kernel=kernel, allow_import=True, method="taylor_once", rtol=tolerance, **keys)


def worst(found, truth):
    return float(max(abs(found[: len(truth)] / truth - 1.0).ravel()))


def compare(scene, judged, tolerances):
    """Prints cells per second, ratios and errors."""
    one, columns = runner(scene_of(scene), "taylor"), cells(scene, CELLS)
    truth = theirs(Heyoka(scene, 1e-19, np.longdouble), columns, judged, JUDGED)[1]
    for their, our in tolerances:
        follower = Heyoka(scene, their)
        runs = [
            lambda f=follower: theirs(f, columns, judged),
            lambda t=our: ours(one, columns, t, judged),
            lambda t=our: by_engine(scene, columns, t, judged),
        ]
        for run in runs[1:]:
            run()
        rounds = [[run() for run in runs] for _ in range(ROUNDS)]
        best = [max((each[k] for each in rounds), key=lambda found: found[0]) for k in range(len(runs))]
        errors = ", ".join(f"{worst(found, truth):.1e}" for _, found in best)
        (base, _), *others = best
        rates = "".join(f"{rate:12,.0f} ({rate / base:4.1f})" for rate, _ in others)
        print(f"{scene['name']:18}{base:8,.0f}{rates}   {errors}", flush=True)


def cores(name):
    """Seconds of a whole run on one core over those on all, where a cell has 4 to 400 switches; the median of a few."""
    (first, low), *rest = RANGES[name].items()
    study = _study(
        name, 1e-8,
        axes={"flips": np.unique(np.floor(np.geomspace(4, 400, 60))), first: np.linspace(*low, WIDTHS[name])},
        fixed={other: 0.5 * sum(ends) for other, ends in rest},
    )  # fmt: skip
    return speedup(study, ROUNDS)


def main():
    print("cells/s of heyoka.py, of the kernel alone and of sweep.run (times heyoka.py's); errors of the three")
    compare(PENDULUM, SPEED, ((1e-9, 1e-10), (1e-13, 3e-13)))
    compare(RELAY, SPEED, ((1e-6, 1e-8), (1e-11, 2e-12)))
    compare(STICK_SLIP, PLACE, ((1e-7, 2e-9), (3e-12, 1e-13)))
    for name in KERNELS:
        print("{}: {} cores against one: {:.2f} times".format(name, *cores(name)), flush=True)


if __name__ == "__main__":
    main()
