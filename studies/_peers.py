"""The foliot with viscous and Coulomb friction followed by others (the extra `peers`), in units of mu = phi0 = 1.

Each follower is made for one tolerance, and settles clocks: period, amplitude and speed before the switch of each after
so many half swings. A half swing is two legs, out to the turning point and back to the other switch, whose ends are
terminal events. `FOLLOWERS` has those that are installed by their names.
"""

import math
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from typing import Any

import numpy as np

START = 1.1
"""Speed at the first switch over that of the cycle."""
FOREVER = 1e9


def installed(**by_module: dict[str, Any]) -> dict[str, Any]:
    """The followers by their names, of those modules that are installed."""
    return {name: one for module, some in by_module.items() if find_spec(module) for name, one in some.items()}


def diffrax_motion(
    solver: str, rates: Any, begin: Any, until: Any, args: Any, rtol: Any, event: Any = None, steps: int = 100_000
) -> Any:
    """What diffrax's solver gives from 0 until a time or an event, whose root is found a thousand times as sharply."""
    import diffrax
    import optimistix

    root = optimistix.Newton(rtol=1e-3 * rtol, atol=1e-3 * rtol)
    return diffrax.diffeqsolve(
        diffrax.ODETerm(rates), getattr(diffrax, solver)(), t0=0.0, t1=until, dt0=None, y0=begin, args=args,
        stepsize_controller=diffrax.PIDController(rtol=rtol, atol=1e-3 * rtol),
        event=None if event is None else diffrax.Event(event, root), max_steps=steps, throw=False,
    )  # fmt: skip


def side_by_side(motion: Callable[..., Any], *axes: int | None) -> Callable[..., Any]:
    """A function of cells as jax makes it, in double precision: all cells at once, along the axes given."""

    @cache
    def compiled() -> Any:
        import jax

        jax.config.update("jax_enable_x64", True)
        return jax.jit(jax.vmap(motion, in_axes=axes))

    return lambda *cells: np.asarray(compiled()(*(np.asarray(x) if np.ndim(x) else x for x in cells)))


def swings(rtol: float, multiplier: float) -> int:
    """Half swings until what is left of the start is a tenth of the tolerance, and two more."""
    return math.ceil(math.log(rtol / 10) / math.log(max(multiplier, 1e-12))) + 2


class OneByOne:
    """A follower of one clock at a time."""

    def __init__(self, rtol: float) -> None:
        self.rtol = rtol

    def settle(self, a: Any, R: Any, speed: Any, count: Any) -> Any:
        """Rows of period, amplitude and speed before the switch."""
        return np.array([self.settled(*cell) for cell in zip(a, R, speed, count, strict=True)])

    def settled(self, a: float, R: float, speed: float, count: int) -> tuple[float, float, float]:
        """Those of one clock."""
        raise NotImplementedError


class Scipy(OneByOne):
    """solve_ivp by DOP853."""

    def settled(self, a: float, R: float, speed: float, count: int) -> tuple[float, float, float]:
        """Half swing after half swing from the switch at +1."""
        time, top, speed = 0.0, 1.0, START * speed
        for _ in range(count):
            out, top, _ = self._leg((1.0, speed), a, R, 1)
            back, _, last = self._leg((top, 0.0), a, -R, 0)
            time, speed = out + back, -last
        return 2.0 * time, top, speed

    def _leg(self, begin: tuple[float, float], a: float, friction: float, which: int) -> tuple[float, float, float]:
        from scipy.integrate import solve_ivp

        def event(t: float, state: Any) -> float:
            return float(state[1] if which else state[0] + 1.0)

        event.terminal = True  # type: ignore[attr-defined]
        how = {"events": event, "rtol": self.rtol, "atol": 1e-3 * self.rtol}
        found = solve_ivp(lambda _, u: (u[1], -1.0 - a * u[1] - friction), (0.0, FOREVER), begin, "DOP853", **how)
        return found.t[-1], *found.y[:, -1]


class Heyoka(OneByOne):
    """Taylor series of heyoka.py, made into machine code."""

    def __init__(self, rtol: float) -> None:
        import heyoka as hy

        super().__init__(rtol)
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

    def settled(self, a: float, R: float, speed: float, count: int) -> tuple[float, float, float]:
        """By one run over all switches."""
        self.log.clear()
        self.wanted[0] = count
        self.run.time = 0.0
        self.run.state[:] = 1.0, START * speed
        self.run.pars[:] = -1.0, 1.0, a, R
        self.run.reset_cooldowns()
        self.run.propagate_until(FOREVER)
        return 2.0 * (self.log[-1][0] - self.log[-2][0]), self.top[0], self.log[-1][1]


class Diffrax:
    """diffrax's Dopri8, all clocks side by side by jax, each as often as the slowest."""

    def __init__(self, rtol: float) -> None:
        self.rtol = rtol

    def settle(self, a: Any, R: Any, speed: Any, count: Any) -> Any:
        """Rows of period, amplitude and speed before the switch."""
        return _all_settled(a, R, speed, count, self.rtol)


def _settled(a: Any, R: Any, speed: Any, count: Any, rtol: Any) -> Any:
    import jax

    def rates(t: Any, y: Any, args: Any) -> Any:
        return jax.numpy.stack([y[1], -1.0 - args[0] * y[1] - args[1]])

    def leg(begin: Any, friction: Any, event: Any) -> Any:
        found = diffrax_motion("Dopri8", rates, begin, FOREVER, (a, friction), rtol, event)
        return found.ts[-1], found.ys[-1]

    def half_swing(_: Any, found: Any) -> Any:
        out, top = leg(jax.numpy.stack([1.0, found[2]]), R, lambda t, y, args, **_: y[1])
        back, last = leg(jax.numpy.stack([top[0], 0.0]), -R, lambda t, y, args, **_: y[0] + 1.0)
        return out + back, top[0], -last[1]

    begin = (0.0 * speed, 0.0 * speed, START * speed)
    time, top, last = jax.lax.fori_loop(0, count, half_swing, begin)
    return jax.numpy.stack([2.0 * time, top, last])


_all_settled = side_by_side(_settled, 0, 0, 0, 0, None)
FOLLOWERS = installed(heyoka={"heyoka.py": Heyoka}, diffrax={"diffrax": Diffrax}, scipy={"scipy": Scipy})
