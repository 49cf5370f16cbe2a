# How much faster are first flips, rippled torque and noisy torque than with the libraries that can follow them?
"""Prints ratios of this run and errors against 50 digits (needs mpmath and scipy; heyoka.py, of the extra `peers`):

python benchmarks/speed/foliot.py

Rivals are heyoka.py, in its best form for this (as in `taylor.py`: scalar, fast_math), and scipy's solve_ivp with
DOP853; each is told to stop at every switch and, with dry friction, at every turning point. diffrax stops at one event
a call, a new one for every switch: it was left out. To find the cycle of a rippled torque both are put into scipy's
secant rule for the speed at the switch; ours finds sensitivity, multiplier and its own error, too. The noise of a cell
is given to them as a list of torques. Times are processor time of one thread, the best of several in turn; rivals
follow fewer cells.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import newton

from kernels.foliot.noise import FOLIOT_NOISE
from kernels.foliot.ripple import FOLIOT_RIPPLE
from kernels.foliot.start import FOLIOT_START
from kernels.interface import Status
from kernels.lanes.columns import entry
from kernels.lanes.groups import GROUP, cells_at
from kernels.lanes.jit import jit
from kernels.maths import philox

sys.path += [str(Path(__file__).parents[2] / "tests" / name) for name in ("oracles", "helpers")]
import foliot_oracles
import ripple_oracles
from columns import solve
from loops import each_group
from mpmath import mp, mpf

try:
    import heyoka as hy
except ImportError:
    sys.exit("heyoka.py is not here; install it with: pip install 'foliot[peers]'")

CELLS, FOLLOWED, JUDGED, ROUNDS = 4096, {"heyoka.py": 60, "DOP853": 4}, 3, 5
FLIPS, HALF_SWINGS, SIGMA, HARMONIC = 40, 200, 0.1, 2
DAY = 86400.0
NAMES = "mu", "a", "R", "k", "depth"
WAY, TURNING = len(NAMES) + 1, len(NAMES) + 2


def force(cosine, x, v, side, way, mu, a, R, k, depth):
    """The acceleration while torque drives to `side` and motion goes `way`; phi0 = 1."""
    torque = mu * (1.0 + depth * cosine(HARMONIC * np.pi * 0.5 * (1.0 + side * x)))
    return side * torque - a * v - way * R - k * x


class Heyoka:
    """Follows a cell from switch to switch; `turns`: stops where it turns, too."""

    def __init__(self, tolerance, turns):
        x, v = hy.make_vars("x", "v")
        side, way, turning = (hy.par[j] for j in (0, WAY, TURNING))
        switch = 1.0 - side * x
        acceleration = force(hy.cos, x, v, side, way, *(hy.par[1 + j] for j in range(len(NAMES))))
        event = turning * way * v + (1.0 - turning) * switch if turns else switch
        falls = hy.t_event(event, callback=self._stop(turns), direction=hy.event_direction.negative)
        self.motion = hy.taylor_adaptive(
            [(x, v), (v, acceleration)],
            [0.0, 0.0],
            t_events=[falls],
            tol=tolerance,
            pars=[0.0] * (TURNING + turns),
            fast_math=True,
        )

    def _stop(self, turns):
        met = self.met = [lambda *_: False]  # heyoka.py copies what is no plain function

        def stop(motion, _):
            pars = motion.pars
            if turns and pars[TURNING] > 0.5:
                pars[WAY], pars[TURNING] = -pars[WAY], 0.0
                return True
            pars[0] = -pars[0]
            pars[TURNING:] = 1.0
            return met[0](motion.time, abs(motion.state[1]))

        return stop

    def run(self, cell, x, v, side, met):
        motion, self.met[0] = self.motion, met
        motion.time, motion.state[:] = 0.0, (x, v)
        back = v * side < 0.0
        motion.pars[: WAY + 1] = side, *cell, -side if back else side
        motion.pars[TURNING:] = back
        motion.reset_cooldowns()
        motion.propagate_until(1e12)

    def torque(self, mu):
        self.motion.pars[1] = mu


class Scipy:
    """The same by solve_ivp, a call for each stretch."""

    def __init__(self, tolerance, turns):
        self.tolerance, self.turns, self.mu = tolerance, turns, 0.0

    def _stretch(self, cell, t, state, side, way, turning):
        def rates(_, y):
            return y[1], force(np.cos, y[0], y[1], side, way, self.mu, *cell[1:])

        def ends(_, y):
            return way * y[1] if turning else 1.0 - side * y[0]

        ends.terminal, ends.direction = True, -1
        tight = {"rtol": self.tolerance, "atol": self.tolerance, "method": "DOP853"}
        found = solve_ivp(rates, (t, t + 1e3), state, events=ends, **tight)
        return found.t_events[0][0], found.y_events[0][0]

    def run(self, cell, x, v, side, met):
        self.mu, t, way, going = cell[0], 0.0, side if v * side >= 0.0 else -side, True
        while going:
            if way != side and self.turns:
                t, (x, _) = self._stretch(cell, t, (x, v), side, way, True)
                v = 0.0
            t, (x, v) = self._stretch(cell, t, (x, v), side, side, False)
            way = side
            side = -side
            going = met(t, abs(v))

    def torque(self, mu):
        self.mu = mu


def first_flips(follower, cell):
    """Times and speeds of the first flips."""
    found = []

    def met(t, speed):
        found.append((t, speed))
        return len(found) < FLIPS

    follower.run(cell, 0.0, 0.0, 1.0, met)
    return np.ravel(found)


def cycle(follower, cell):
    """Period and crossing speed of the limit cycle."""
    last = [0.0, 0.0]

    def half_swing(start):
        def met(t, speed):
            last[:] = t, speed
            return False

        follower.run(cell, 1.0, start, -1.0, met)
        return last[1] - start

    speed = newton(half_swing, np.sqrt(cell[0]), tol=1e-15, rtol=1e-14, maxiter=50, disp=False)
    half_swing(speed)
    return np.array([2.0 * last[0], last[1]])


def noisy(follower, cell):
    """True time of all half swings over that without noise."""
    (mu, *rest), (half, speed), torques = cell[:5], cell[5], cell[6]
    count, end = [0], [0.0]

    def met(t, _):
        count[0] += 1
        end[0] = t
        if count[0] == HALF_SWINGS:
            return False
        follower.torque(mu * torques[count[0]])
        return True

    follower.run((mu * torques[0], *rest), 1.0, speed, -1.0, met)
    return np.array([end[0] / (HALF_SWINGS * half)])


@jit
def _draw(first, seed, place, row, turns, ones, twos):
    philox.fill(first, seed, place, 1, row, turns)
    ones[cells_at(first)], twos[cells_at(first)] = philox.gaussians(row[cells_at(0)], turns[cells_at(0)])


@entry("place", "row", "turns")
def draw(seed, place, row, turns, ones, twos):
    """A pair of the normal numbers of every seed."""
    each_group(_draw, (seed, int(place[0]), row, turns, ones, twos))


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

    title, turns, follow = f"first {FLIPS} flips", True, staticmethod(first_flips)
    tolerances = (1e-6, 1e-9), (1e-10, 1e-13)

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
    tolerances = (1e-7, 1e-7), (1e-13, 1e-13)

    def __init__(self):
        self.own = {"mu": spread(0.1, 10, 1), "a": spread(0.1, 1, 2), "depth": spread(0.05, 0.5, 3)}
        mu, a, depth = self.own.values()
        self.cells = list(zip(mu, a, np.zeros(CELLS), np.zeros(CELLS), depth, strict=True))

    def ours(self, rtol):
        found, status = solve(FOLIOT_RIPPLE, "taylor", phi0=1.0, harmonic=float(HARMONIC), rtol=rtol, **self.own)
        assert (status <= Status.INACCURATE).all()
        return np.stack([found["period"], found["crossing_speed"]], axis=1)

    def truth(self, i):
        mu, a, _, _, depth = self.cells[i]
        period, _, speed, *_ = ripple_oracles.by_taylor(mu, 1.0, a=a, depth=depth, harmonic=HARMONIC)
        return [period, speed]


class Noise:
    """A run with white noise of the torque and viscous friction."""

    title, turns, follow = f"{HALF_SWINGS} half swings of a noisy torque", False, staticmethod(noisy)
    tolerances = (1e-8, 1e-8), (1e-13, 1e-13)

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
    begin = time.thread_time()
    found = function()
    return time.thread_time() - begin, found


def compare(scene):
    """Prints microseconds a cell, ratios and errors, at a loose and at a tight tolerance of the rivals."""
    truth = [scene.truth(i) for i in range(JUDGED)]
    for heyoka, dop853 in scene.tolerances:
        rivals = {"heyoka.py": Heyoka(heyoka, scene.turns), "DOP853": Scipy(dop853, scene.turns)}
        runs = {"ours": (CELLS, lambda rtol=heyoka: scene.ours(max(rtol, 1e-12)))}
        for name, rival in rivals.items():
            cells = scene.cells[: FOLLOWED[name]]
            runs[name] = len(cells), lambda rival=rival, cells=cells: [scene.follow(rival, cell) for cell in cells]
        runs["ours"][1]()
        rounds = [{name: seconds(run) for name, (_, run) in runs.items()} for _ in range(ROUNDS)]
        own = min(each["ours"][0] for each in rounds) / CELLS
        print(f"{scene.title:34}{'us/cell':>12}{'ratio':>10}{'worst error':>14}")
        for name, (count, _) in runs.items():
            spent = min(each[name][0] for each in rounds) / count
            print(
                f"  {name:32}{spent * 1e6:12.2f}{spent / own:10.0f}{worst(rounds[0][name][1], truth):14.1e}", flush=True
            )


if __name__ == "__main__":
    for scene in (Start, Ripple, Noise):
        compare(scene())
