"""Three motions followed by others (the extra `peers`): a foliot, a mass on a belt, and a foliot with a lagging drive.

CLOCKS follow the foliot with viscous and Coulomb friction in units of mu = phi0 = 1. Each is made for one tolerance and
gives rows of period, amplitude and speed before the switch of clocks after so many half swings. A half swing is two
legs, out to the turning point and back to the other switch, whose ends are terminal events.
SLIDING give the places of a mass on a belt at given times, at one tolerance; they know nothing of its kink, and NaN
stands where one asks for the rates MOST times. "modes by hand" is scipy's DOP853 as an expert would use it: stick and
slip apart, each up to an event.
STIFF give the times of the first switch of the foliot with a lagging drive, from rest.
All have those that are installed, by their names.
"""

import math
from collections.abc import Callable
from functools import cache, partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

START = 1.1
"""Speed at the first switch over that of the cycle."""
FOREVER, LATEST = 1e9, 1e3
"""When a clock that does not swing, or start, is given up."""
MOST = 5_000
FRICTION = 0.5
"""a = b [1/s] of the foliot with a lagging drive."""


class TooManyCalls(Exception):
    """More calls of the rates than a follower is given."""


def installed(**by_module: dict[str, Any]) -> dict[str, Any]:
    """The followers by their names, of those modules that are installed."""
    return {name: one for module, some in by_module.items() if find_spec(module) for name, one in some.items()}


def ended(rates: Any, begin: Any, span: Any, rtol: float, event: Any, way: int = 0, method: str = "DOP853", **how: Any):
    """Time and state at the end of what scipy's solve_ivp follows up to an event, or the end of the span."""
    event.terminal, event.direction = True, way
    found = solve_ivp(rates, span, begin, method, events=event, rtol=rtol, atol=1e-3 * rtol, **how)
    return float(found.t[-1]), found.y[:, -1]


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


def one_by_one(settled: Callable[..., Any]) -> Callable[..., Any]:
    """A follower of clocks from that of one, with a, R, speed at the switch and half swings."""
    return lambda *clocks: np.array([settled(*cell) for cell in zip(*clocks, strict=True)])


def scipy_clock(rtol: float) -> Callable[..., Any]:
    """solve_ivp by DOP853."""

    def leg(begin: Any, a: float, friction: float, event: Any) -> Any:
        return ended(lambda _, u: (u[1], -1.0 - a * u[1] - friction), begin, (0.0, FOREVER), rtol, event)

    def settled(a: float, R: float, speed: float, count: int) -> tuple[float, float, float]:
        time, top, speed = 0.0, 1.0, START * speed
        for _ in range(count):
            out, (top, _) = leg((1.0, speed), a, R, lambda _, u: u[1])
            back, (_, last) = leg((top, 0.0), a, -R, lambda _, u: u[0] + 1.0)
            time, speed = out + back, -last
        return 2.0 * time, top, speed

    return one_by_one(settled)


def heyoka_clock(rtol: float) -> Callable[..., Any]:
    """Taylor series of heyoka.py, made into machine code: one run over all switches."""
    import heyoka as hy

    log: list[Any] = []
    wanted, top = [0], [0.0]  # heyoka copies callbacks with what they are bound to, so these are plain functions

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
    run = hy.taylor_adaptive(motion, [0.0, 1.0], t_events=events, tol=rtol, pars=[0.0] * 4)

    def settled(a: float, R: float, speed: float, count: int) -> tuple[float, float, float]:
        log.clear()
        wanted[0] = count
        run.time = 0.0
        run.state[:] = 1.0, START * speed
        run.pars[:] = -1.0, 1.0, a, R
        run.reset_cooldowns()
        run.propagate_until(FOREVER)
        return 2.0 * (log[-1][0] - log[-2][0]), top[0], log[-1][1]

    return one_by_one(settled)


def _settled(a: Any, R: Any, speed: Any, count: Any, rtol: Any) -> Any:
    """By diffrax's Dopri8, all clocks side by side by jax, each as often as the slowest."""
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
CLOCKS = installed(
    heyoka={"heyoka.py": heyoka_clock},
    diffrax={"diffrax": lambda rtol: lambda *clocks: _all_settled(*clocks, rtol)},
    scipy={"scipy": scipy_clock},
)


def scipy_places(method: str, belt: Any, fall: Any, until: Any, rtol: float) -> Any:
    """By solve_ivp, the sign as it is."""

    def place(belt: float, fall: float, until: float) -> float:
        calls = 0

        def rates(t: float, u: Any) -> tuple[float, float]:
            nonlocal calls
            calls += 1
            if calls > MOST:
                raise TooManyCalls
            return u[1], fall * u[1] - u[0] - np.sign(u[1] - belt)

        try:
            return float(solve_ivp(rates, (0.0, until), (0.0, belt), method, rtol=rtol, atol=1e-3 * rtol).y[0, -1])
        except TooManyCalls:
            return np.nan

    return np.vectorize(place, otypes=[float])(belt, fall, until)


def modes(belt: Any, fall: Any, until: Any, rtol: float) -> Any:
    """By solve_ivp's DOP853, stick and slip apart."""

    def place(belt: float, fall: float, until: float) -> float:
        def slips(_: float, u: Any) -> tuple[float, float]:
            return u[1], fall * u[1] - u[0] + 1.0

        t, place, last = 0.0, 0.0, 1.0 + fall * belt
        while t + (last - place) / belt < until:
            t += (last - place) / belt
            t, (place, _) = ended(slips, (last, belt), (t, until), rtol, lambda _, u: belt - float(u[1]), -1)
        return place + belt * (until - t)

    return np.vectorize(place, otypes=[float])(belt, fall, until)


def _belt_by_kvaerno5(belt: Any, fall: Any, until: Any, rtol: Any) -> Any:
    import diffrax
    import jax

    def rates(t: Any, u: Any, args: Any) -> Any:
        return jax.numpy.stack([u[1], fall * u[1] - u[0] - jax.numpy.sign(u[1] - belt)])

    begin = jax.numpy.stack([0.0 * belt, belt])
    end = diffrax_motion("Kvaerno5", rates, begin, until, None, rtol, steps=MOST)
    return jax.numpy.where(end.result == diffrax.RESULTS.successful, end.ys[-1, 0], jax.numpy.nan)


SLIDING = installed(
    scipy={f"scipy {method}": partial(scipy_places, method) for method in ("Radau", "BDF", "LSODA")},
    diffrax={"diffrax Kvaerno5": side_by_side(_belt_by_kvaerno5, 0, 0, 0, None)},
) | {"scipy DOP853, modes by hand": modes}


def scipy_times(method: str, mu: Any, eps: float, rtol: float) -> Any:
    """By solve_ivp, with the exact Jacobian and a terminal event."""
    jacobian = np.array([[0.0, 1.0, 0.0], [0.0, -FRICTION, 1.0], [0.0, -FRICTION / eps, -1.0 / eps]])

    def time(drive: float) -> float:
        def rates(t: float, u: Any) -> tuple[float, float, float]:
            return u[1], u[2] - FRICTION * u[1], (drive - FRICTION * u[1] - u[2]) / eps

        how = {"method": method, "jac": jacobian}
        return ended(rates, np.zeros(3), (0.0, LATEST), rtol, lambda _, u: 1.0 - float(u[0]), **how)[0]

    return np.vectorize(time, otypes=[float])(mu)


def _lag_by_kvaerno5(drive: Any, eps: Any, rtol: Any) -> Any:
    import jax

    def rates(t: Any, u: Any, args: Any) -> Any:
        return jax.numpy.stack([u[1], u[2] - FRICTION * u[1], (drive - FRICTION * u[1] - u[2]) / eps])

    begin, event = jax.numpy.zeros(3), lambda t, y, args, **_: y[0] - 1.0
    return diffrax_motion("Kvaerno5", rates, begin, LATEST, None, rtol, event).ts[-1]


STIFF = installed(
    scipy={"scipy Radau": partial(scipy_times, "Radau"), "scipy BDF": partial(scipy_times, "BDF")},
    diffrax={"diffrax Kvaerno5": side_by_side(_lag_by_kvaerno5, 0, None, None)},
)
