# Is any value of an integrator wrong without a word, over a million foliots made to be difficult?
"""Prints, by region and method, what became of the cells, and how many are off by more than ten tolerances yet OK:

nice python benchmarks/honesty/integrators.py [--cells 1000000] [--seed 1] [--regions NAME ...]

A cell is a foliot let go at rest and followed through one to eight switches, at its own rtol from 1e-11 to 1e-3, by one
of the adaptive integrators of scenes. Some go to a fixed-step one too, with a random step and location: its tolerance
is the `error` it states; and the limit cycle of some to the Dormand-Prince method of the kernel foliot. Judged are
time, the last interval, and the speed before the last switch over the larger of itself and its mean over the last
interval, since methods promise a state relative to its size since the last switch; of cycles all outputs.

Truth is the exact flow (`foliot_start`, `foliot` by segments) of linear scenes, which `auto_honesty.py` holds against
50 digits; with quadratic drag it is the Taylor method at 1e-13, held against 40 digits here in some cells, or for
cycles `quadrature`. Where it says that no such switch or cycle comes, any value is wrong. Of these cells, which run
into the limit of steps, and of those in which the truth itself is not sure, one in fifty is tried, as the table's
"cells" tell. "over" counts OK cells off by more than one tolerance, "wrong" by more than ten.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

from kernels.foliot.cycle import FOLIOT
from kernels.foliot.start import FOLIOT_START
from kernels.foliot.steps import FOLIOT_STEPS
from kernels.interface import FIRST_REFUSAL, Status

sys.path += [str(Path(__file__).parents[2] / "tests" / name) for name in ("oracles", "helpers")]
import scene_oracles
from columns import checked, relative_error, solve
from rich_scene import RICH

BLOCK = 10_000
MOST = 8
"""Switches."""
CYCLE = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
MOTION = ("time", "interval", "speed")
FOLIOTS = ("mu", "phi0", "a", "R", "c", "k", "e")
SURE = (Status.OK, Status.NOT_SELF_STARTING)
LEAST = 2.0**-1022
"""Below the normal numbers any value as small is right."""
TRIED = {"fixed step": 1 / 16, "cycle dopri5": 1 / 4}
"""Share of the cells that are given to a method; the scenes' methods share all cells."""
IDLE = 0.02
"""Share of the cells tried that come to no such switch, or of which the truth is not sure."""
ORACLE_CELLS = 3
"""Of a block with drag, that are followed in 40 digits."""


def decades(random, low, high, n):
    return 10.0 ** random.uniform(low, high, n)


def often(random, share, values):
    """The values, or 0 in all but a share of the cells."""
    return np.where(random.random(len(values)) < share, values, 0.0)


# regions: the groups d = a T, rho = R/mu, gamma = c phi0, kappa = k T^2, T^2 = phi0/mu, and start/phi0


def weak_drive(random, n):
    """Friction rules; in one cell of a hundred so much that no explicit step can follow."""
    d = np.where(random.random(n) < 0.01, decades(random, 1.5, 4, n), decades(random, -0.5, 1.5, n))
    return {"d": d, "rho": often(random, 0.3, random.random(n))}


def near_sticking(random, n):
    """Dry friction up to 1e-9 of the drive below it."""
    rho = 1 - decades(random, -9, -0.05, n)
    return {"d": often(random, 0.5, decades(random, -4, 1, n)), "rho": rho}


def strong_drag(random, n):
    """Quadratic drag that brings the foliot to its top speed at once, and some of every other loss."""
    rho = often(random, 0.5, 1 - decades(random, -6, -0.05, n))
    return {"gamma": decades(random, -0.5, 2.5, n), "rho": rho, "d": often(random, 0.5, decades(random, -3, 1, n))}


def resonance(random, n):
    """A stiff hairspring, little friction, let go far out: it swings through the switches as it rings down."""
    kappa, d = decades(random, -0.5, 3, n), decades(random, -4, 0, n)
    rho = often(random, 0.5, decades(random, -4, 0, n) * 0.99)
    return {"kappa": kappa, "d": d, "rho": rho, "start": -decades(random, 0, 1.5, n)}


def grazing(random, n):
    """The spring lets the first swing pass the switch by 1e-11 to 0.5; one cell of twenty misses it by as much."""
    d = often(random, 0.7, decades(random, -5, -0.3, n))
    past = decades(random, -11, -0.3, n) * np.where(random.random(n) < 0.05, -1.0, 1.0)
    kappa = np.full(n, 2.0)
    for _ in range(60):
        decay = np.exp(-np.pi * d / 2 / np.sqrt(kappa - d * d / 4))
        kappa = (1 + decay) / (1 + past)
    return {"kappa": kappa, "d": d}


def mixed(random, n):
    """Everything at once, spring and drag too."""
    return {
        "d": often(random, 0.5, decades(random, -3, 1, n)),
        "gamma": often(random, 0.7, decades(random, -3, 1.5, n)),
        "rho": often(random, 0.6, 1 - decades(random, -6, -0.02, n)),
        "kappa": often(random, 0.6, decades(random, -3, 0.5, n)),
        "start": random.uniform(-5, 0.999, n),
    }


REGIONS = (weak_drive, near_sticking, strong_drag, resonance, grazing, mixed)


def cells_of(region, random, n):
    """Columns of a scene by name, the tolerance, and step and location of a fixed-step method."""
    groups = {name: np.zeros(n) for name in ("d", "rho", "gamma", "kappa", "start")} | region(random, n)
    mu, phi0 = decades(random, -3, 3, n), decades(random, -3, 3, n)
    rate = np.sqrt(mu / phi0)
    one = {
        "mu": mu, "phi0": phi0, "a": groups["d"] * rate, "R": np.minimum(groups["rho"] * mu, np.nextafter(mu, 0)),
        "c": groups["gamma"] / phi0, "k": groups["kappa"] * rate * rate,
        "e": random.choice([1.0, 1.0, 0.9, 0.3, 0.0, -0.5], n),
    }  # fmt: skip
    slow = np.sqrt(np.maximum(1 - groups["rho"], 1e-12))
    swing = 1 / np.sqrt(slow**2 + groups["kappa"] + groups["gamma"] + groups["d"] ** 2) / rate
    how = {"step": swing * decades(random, -2, 0.5, n), "location": random.integers(0, 5, n).astype(float)}
    motion = {"angle0": groups["start"] * phi0, "flips": random.integers(1, MOST + 1, n).astype(float)}
    return one, motion, decades(random, -11, -3, n), how


# truth: values by name; whether they are known, and whether it is known that there are none


def true_motion(one, motion):
    """Of the motion through its switches."""
    n, flips = len(one["mu"]), motion["flips"]
    values = {name: np.full(n, np.nan) for name in MOTION}
    known, void = np.zeros(n, bool), np.zeros(n, bool)
    for cells, follow in ((one["c"] == 0, _exact), (one["c"] > 0, _by_taylor)):
        if cells.any():
            some = ({name: column[cells] for name, column in part.items()} for part in (one, motion))
            found, known[cells], void[cells] = follow(*some)
            for name in MOTION:
                values[name][cells] = found[name]
    return values, known & (flips > 0), void


def _exact(one, motion):
    linear = {name: one[name] for name in FOLIOTS if name != "c"} | {"phi_start": motion["angle0"]}
    flip = np.arange(1.0, MOST + 1)
    found, status = solve(FOLIOT_START, "segments", **linear, rtol=1e-12, along=(flip,))
    last = motion["flips"].astype(int)[:, None] - 1
    times, speeds = (np.take_along_axis(found[name], last, 1)[:, 0] for name in ("flip_time", "flip_speed"))
    before = np.where(last > 0, np.take_along_axis(found["flip_time"], np.maximum(last - 1, 0), 1), 0.0)[:, 0]
    interval = times - before
    sure = (status == Status.OK) | (status == Status.COMES_TO_REST)
    sure &= (interval > 1e-2 * times) | np.isnan(times)  # else its digits are lost
    void = (sure & np.isnan(times)) | (status == Status.STICKS) | (status == Status.NEVER_STARTS)
    return dict(zip(MOTION, (times, interval, abs(speeds)), strict=True)), sure & ~np.isnan(times), void


def _by_taylor(one, motion):
    found, status = solve(RICH, "taylor", **one, **motion, rtol=1e-13)
    values = {"time": found["time"], "interval": found["interval"], "speed": abs(found["speed"])}
    return values, status == Status.OK, status == Status.STICKS


def true_cycle(one):
    """Of the limit cycle."""
    free = (one["c"] > 0) & (one["k"] > 0)
    quadratic = {**one, "n": 2.0}
    n = len(one["mu"])
    values, status = {name: np.full(n, np.nan) for name in CYCLE}, np.full(n, Status.NO_METHOD, np.int8)
    for cells, method in ((one["c"] == 0, "segments"), ((one["c"] > 0) & ~free, "quadrature")):
        if cells.any():
            some = {name: np.broadcast_to(column, n)[cells].copy() for name, column in quadratic.items()}
            found, status[cells] = solve(FOLIOT, method, **some, rtol=1e-12)
            for name in CYCLE:
                values[name][cells] = found[name]
    void = (status == Status.STICKS) | (status == Status.NEVER_STARTS)
    return values, np.isin(status, SURE), void


# contestants: values by name, status, and the tolerance that they promise


def by_scene(method):
    def solved(one, motion, rtol, how, random):
        found, status = solve(RICH, method, **one, **motion, rtol=rtol)
        return {"time": found["time"], "interval": found["interval"], "speed": abs(found["speed"])}, status, rtol

    return solved


def at_fixed_step(one, motion, rtol, how, random):
    """Each cell by one of the methods; from rest at the centre only."""
    n = len(rtol)
    chosen = random.integers(0, len(FOLIOT_STEPS.methods), n)
    values, status = {name: np.full(n, np.nan) for name in MOTION}, np.full(n, Status.NO_METHOD, np.int8)
    how["method"], stated = chosen, np.full(n, np.nan)
    for number, method in enumerate(FOLIOT_STEPS.methods):
        cells = (chosen == number) & (motion["angle0"] == 0)
        if cells.any():
            some = {name: column[cells] for name, column in {**one, **how, "flips": motion["flips"]}.items()}
            del some["method"]
            found, status[cells] = solve(FOLIOT_STEPS, method.name, **some, rtol=1e-3)
            values["time"][cells], values["interval"][cells] = found["time"], found["period"] / 2
            values["speed"][cells], stated[cells] = found["crossing_speed"], found["error"]
    status[(status == Status.OK) & ~(stated < 0.1)] = Status.INACCURATE  # it says itself that it knows nothing
    return values, status, stated


def dopri5_cycle(one, motion, rtol, how, random):
    found, status = solve(FOLIOT, "dopri5", **one, n=2.0, rtol=rtol)
    return found, status, rtol


SCENES = {f"scene {name}": by_scene(name) for name in ("taylor", "dop853", "dopri5")}


class Tally:
    """What became of the cells of a region by one method."""

    def __init__(self):
        self.counts, self.worst, self.seconds, self.wrong, self.statuses = Counter(), (0.0, ""), 0.0, [], Counter()

    def add(self, cells, found, truth, sizes):
        """Judge a block of cells; errors are over the sizes."""
        (values, status, tolerance), (true, known, void) = found, truth
        ok, refused = np.isin(status, SURE), status >= FIRST_REFUSAL
        with np.errstate(all="ignore"):
            off = np.array([abs((values[name] - true[name]) / sizes[name]) for name in true])
            both = abs(np.array([[values[name], true[name]] for name in true]))
            off[(both < LEAST).all(axis=1)] = 0.0
            ratio = off / np.maximum(tolerance, 1e-12)
        ratio = np.where(np.isnan(ratio), np.inf, ratio)
        largest = np.where(ok & known, ratio.max(axis=0), 0.0)
        largest[ok & void] = np.inf
        self.counts.update(
            cells=len(status), ok=int(ok.sum()), remarked=int((~ok & ~refused).sum()), refused=int(refused.sum()),
            judged=int((ok & (known | void)).sum()), over=int((largest > 1).sum()), wrong=int((largest > 10).sum()),
        )  # fmt: skip
        self.statuses.update(status[refused].tolist())
        names = list(true)
        for i in np.unique([int(largest.argmax()), *np.flatnonzero(largest > 10)[:3]]):
            text = f"{names[int(ratio[:, i].argmax())]} at tolerance {np.broadcast_to(tolerance, len(status))[i]:.1e}: "
            text += " ".join(f"{name}={float(column[i])!r}" for name, column in cells.items())
            self.worst = max(self.worst, (float(largest[i]), text), key=lambda pair: pair[0])
            self.wrong += [(float(largest[i]), text)] if largest[i] > 10 else []

    def row(self, region, name):
        c = self.counts
        counts = " ".join(f"{c[key]:>8}" for key in ("cells", "ok", "judged", "remarked", "refused"))
        taken = 1e6 * self.seconds / max(c["cells"], 1)
        return f"{region:<14} {name:<13} {counts} {c['over']:>6} {c['wrong']:>6} {self.worst[0]:>9.3g} {taken:>8.1f}"


def oracle_error(one, motion, truth):
    """The largest error of the Taylor method's truth in some cells with drag alone, against 40 digits."""
    values, known, _ = truth
    plain = known & (one["R"] == 0) & (one["k"] == 0) & (one["e"] == 1) & (motion["angle0"] == 0) & (one["c"] > 0)
    worst = 0.0
    for i in np.flatnonzero(plain & (one["a"] > 0))[:ORACLE_CELLS]:
        cell = [float(one[name][i]) for name in ("mu", "phi0", "a", "c")]
        true = scene_oracles.quadratic_foliot(*cell, int(motion["flips"][i]))
        worst = max(worst, *relative_error([values["time"][i], values["speed"][i]], true))
    return worst


def block_of(region, n, seed, tallies):
    """Shares a block of cells out to the methods; how far the truth is from 40 digits where that is asked."""
    random = np.random.default_rng([seed, REGIONS.index(region)])
    one, motion, rtol, how = cells_of(region, random, n)
    sound = checked(FOLIOT, **{name: one[name] for name in FOLIOTS}, n=2.0) == Status.OK
    one, motion, how = ({k: v[sound] for k, v in part.items()} for part in (one, motion, how))
    rtol = rtol[sound]
    truth = true_motion(one, motion)
    turn = random.random(len(rtol))
    for place, name in enumerate(SCENES):
        chosen = (turn * len(SCENES)).astype(int) == place
        tried(name, SCENES[name], chosen, region, (one, motion, rtol, how), truth, random, tallies)
    chosen = random.random(len(rtol)) < TRIED["fixed step"]
    chosen &= motion["angle0"] == 0
    tried("fixed step", at_fixed_step, chosen, region, (one, motion, rtol, how), truth, random, tallies)
    chosen = random.random(len(rtol)) < TRIED["cycle dopri5"]
    tried("cycle dopri5", dopri5_cycle, chosen, region, (one, motion, rtol, how), None, random, tallies)
    return oracle_error(one, motion, truth)


def tried(name, solved, chosen, region, given, truth, random, tallies):
    """Gives some cells to a method and tells what became of them."""
    if truth is not None:
        chosen = chosen & (truth[1] | (random.random(len(chosen)) < IDLE))
    if not chosen.any():
        return
    one, motion, rtol, how = (_some(part, chosen) for part in given)
    truth = true_cycle(one) if truth is None else tuple(_some(part, chosen) for part in truth)
    tally = tallies.setdefault((region.__name__, name), Tally())
    begin = time.thread_time()
    found = solved(one, motion, rtol, how, random)
    tally.seconds += time.thread_time() - begin
    cells = {**one, **motion, **(how if name == "fixed step" else {})}
    tally.add(cells, found, truth, _sizes(cells, truth[0]))


def _sizes(cells, true):
    """What errors are over: of the speed of a motion it is at least the mean one of the last interval."""
    if "speed" not in true:
        return true
    way = np.where(cells["flips"] > 1, 2 * cells["phi0"], cells["phi0"] - cells["angle0"])
    with np.errstate(all="ignore"):
        return {**true, "speed": np.fmax(abs(true["speed"]), way / true["interval"])}


def _some(part, chosen):
    """Of a column, or of columns by name, the cells chosen."""
    if isinstance(part, dict):
        return {name: np.ascontiguousarray(column[chosen]) for name, column in part.items()}
    return np.ascontiguousarray(part[chosen])


def main(arguments):
    """1 where a value is off by more than ten tolerances and called OK."""
    parser = argparse.ArgumentParser(description="Is any value of an integrator wrong without a word?")
    parser.add_argument("--cells", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--block", type=int, default=BLOCK)
    parser.add_argument("--regions", nargs="*", default=[region.__name__ for region in REGIONS])
    given = parser.parse_args(arguments)
    regions = [region for region in REGIONS if region.__name__ in given.regions]
    tallies, done, number, apart = {}, 0, 0, 0.0
    try:
        while done < given.cells:
            for region in regions:
                off = block_of(region, min(given.block, given.cells), 1000 * given.seed + number, tallies)
                apart, done = (
                    max(apart, off),
                    sum(t.counts["cells"] for (_, name), t in tallies.items() if name in SCENES),
                )
                print(f"{done} cells", file=sys.stderr, flush=True)
            number += 1
    except KeyboardInterrupt:
        print("ended before its time")
    print(f"{done} cells; the truth with drag is off by {apart:.1e} from 40 digits where that was asked")
    head = f"{'region':<14} {'method':<13} {'cells':>8} {'OK':>8} {'judged':>8} {'remarked':>8} {'refused':>8}"
    print(f"{head} {'over':>6} {'wrong':>6} {'worst':>9} {'us/cell':>8}")
    for (region, name), tally in tallies.items():
        print(tally.row(region, name))
    for (region, name), tally in tallies.items():
        refused = ", ".join(f"{n} {Status(code).name}" for code, n in tally.statuses.most_common())
        print(
            f"{region}, {name}: worst {tally.worst[0]:.3g} tolerances, {tally.worst[1]}; refused: {refused or 'none'}"
        )
        for ratio, text in tally.wrong[:3]:
            print(f"  WRONG by {ratio:.3g} tolerances: {text}")
    return int(any(tally.counts["wrong"] for tally in tallies.values()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
