# What do others need to follow a foliot from switch to switch? The rivals of `foliot.py`.
"""heyoka.py, solve_ivp of scipy and diffrax, each told to stop at every switch and, with dry friction, at every turn.

A follower has `run`, which follows a cell until `met(time, speed)` says that this was the last switch, and `torque`,
which sets the torque of the next half swing. diffrax follows many cells at once: there each number of a cell is an
array.
"""

from __future__ import annotations

import os

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

import diffrax
import heyoka as hy
import jax
import numpy as np
import optimistix
from scipy.integrate import solve_ivp
from scipy.optimize import newton

jax.config.update("jax_enable_x64", True)

FLIPS, HALF_SWINGS, HARMONIC = 40, 200, 2
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

    def __init__(self, method, tolerance, turns):
        self.tight, self.turns, self.mu = {"rtol": tolerance, "atol": tolerance, "method": method}, turns, 0.0

    def _stretch(self, cell, t, state, side, way, turning):
        def rates(_, y):
            return y[1], force(np.cos, y[0], y[1], side, way, self.mu, *cell[1:])

        def ends(_, y):
            return way * y[1] if turning else 1.0 - side * y[0]

        ends.terminal, ends.direction = True, -1
        found = solve_ivp(rates, (t, t + 1e3), state, events=ends, **self.tight)
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


class Diffrax:
    """The same by diffrax for many cells, all of which do a stretch side by side, in one compiled call."""

    def __init__(self, tolerance, turns):
        self.turns, self.stretch = turns, jax.jit(jax.vmap(self._stretch, in_axes=(0, 0, 0, None, None, None)))
        self.tight = {"rtol": tolerance, "atol": tolerance}

    def _stretch(self, cell, x, v, side, way, turning):
        def rates(t, y, args):
            return y[1], force(jax.numpy.cos, y[0], y[1], side, way, *cell)

        def ends(t, y, args, **rest):
            return jax.numpy.where(turning, way * y[1], 1.0 - side * y[0])

        event = diffrax.Event(ends, optimistix.Newton(1e-15, 1e-15), direction=False)
        steps = diffrax.PIDController(**self.tight)
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(rates), diffrax.Dopri8(), 0.0, 1e3, None, (x, v),
            stepsize_controller=steps, event=event, max_steps=100_000, throw=False,
        )  # fmt: skip
        return found.ts[-1], found.ys[0][-1], found.ys[1][-1]

    def run(self, cell, x, v, side, met):
        self.mu, (t, x, v) = cell[0], (np.zeros_like(cell[0]) + number for number in (0.0, x, v))
        way, going = side if np.all(v * side >= 0.0) else -side, True
        while going:
            for turning in (True, False) if way != side and self.turns else (False,):
                cells = np.stack([self.mu, *cell[1:5]], axis=1)
                spent, x, v = map(np.asarray, self.stretch(cells, x, v, side, way if turning else side, turning))
                t, v = t + spent, 0.0 * v if turning else v
            way, side = side, -side
            going = met(t, abs(v))

    def torque(self, mu):
        self.mu = mu


def together(cells):
    """Many cells as one, of arrays."""
    return tuple(np.array(column).T for column in zip(*cells, strict=True))


def first_flips(follower, cell):
    """Times and speeds of the first flips."""
    found = []

    def met(t, speed):
        found.append((t, speed))
        return len(found) < FLIPS

    follower.run(cell, 0.0, 0.0, 1.0, met)
    return np.reshape(found, (2 * FLIPS, *np.shape(found[0][0])))


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
