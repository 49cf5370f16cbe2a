"""The foliot with viscous and Coulomb friction followed by heyoka.py (the extra `peers`), in units of mu = phi0 = 1."""

from __future__ import annotations

import math
from typing import Any

import heyoka as hy

START = 1.1
"""Speed at the first switch over that of the cycle."""


class Foliots:
    """One integrator at one tolerance; switches and turning points are located as terminal events."""

    def __init__(self, rtol: float) -> None:
        self.rtol = rtol
        # heyoka copies callbacks with the objects they are bound to, so these are plain functions
        log, wanted, top = self.log, self.wanted, self.top = [], [0], [0.0]

        def switch(run: Any, _: int) -> bool:
            log.append((run.time, abs(run.state[1])))
            run.pars[0] = -run.pars[0]
            return len(log) < wanted[0]

        def turn(run: Any, _: int) -> bool:
            top[0] = abs(run.state[0])
            run.pars[1] = -run.pars[1]
            return True

        x, v = hy.make_vars("x", "v")
        drive, way, a, friction = (hy.par[i] for i in range(4))
        events = [
            hy.t_event(drive * x - 1.0, callback=switch, direction=hy.event_direction.positive),
            hy.t_event(v, callback=turn),
        ]
        motion = [(x, v), (v, drive - a * v - way * friction)]
        self.run = hy.taylor_adaptive(motion, [0.0, 1.0], t_events=events, tol=rtol, pars=[0.0] * 4)

    def swings(self, multiplier: float) -> int:
        """Half swings until what is left of the start is a tenth of the tolerance, and two more."""
        return math.ceil(math.log(self.rtol / 10) / math.log(max(multiplier, 1e-12))) + 2

    def settle(self, a: float, R: float, speed: float, swings: int) -> tuple[float, float, float]:
        """Period, amplitude and speed before the switch after so many half swings."""
        self.log.clear()
        self.wanted[0] = swings
        self.run.time = 0.0
        self.run.state[:] = 1.0, START * speed
        self.run.pars[:] = -1.0, 1.0, a, R
        self.run.reset_cooldowns()
        self.run.propagate_until(1e9)
        return 2.0 * (self.log[-1][0] - self.log[-2][0]), self.top[0], self.log[-1][1]
