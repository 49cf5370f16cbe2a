"""Three motions followed by others (the extra `peers`): a foliot, a mass on a belt, and a foliot with a lagging drive.

CLOCKS follow the foliot with viscous and Coulomb friction in units of mu = phi0 = 1. Each is made for one tolerance and
gives rows of period, amplitude and speed before the switch of clocks after so many half swings. A half swing is two
legs, out to the turning point and back to the other switch, whose ends are terminal events.
SLIDING give the places of a mass on a belt at given times, at one tolerance; they know nothing of its kink, and NaN
stands where one asks for the rates MOST times, Jacobians apart. "modes by hand" is scipy's DOP853 as an expert would
use it: stick and slip apart, each up to an event.
STIFF give the times of the first switch of the foliot with a lagging drive, from rest.
All have those that are installed, by their names.
"""

import math
from collections.abc import Callable
from functools import cache, partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy import integrate

START = 1.1
"""Speed at the first switch over that of the cycle."""
FOREVER, LATEST = 1e9, 1e3
"""When a clock that does not swing, or start, is given up."""
MOST = 5_000
FRICTION = 0.5
"""a = b [1/s] of the foliot with a lagging drive."""


def leg(a: Any, friction: Any) -> Callable[..., Any]:
    """Rates of the foliot's angle and speed while it is driven back."""
    return lambda t, u: (u[1], -1.0 - a * u[1] - friction)


def belt_rates(belt: Any, fall: Any) -> Callable[..., Any]:
    """Rates of place and speed of the mass on the belt, the sign of the sliding as it is."""
    return lambda t, u: (u[1], fall * u[1] - u[0] - 1.0 * (u[1] > belt) + 1.0 * (u[1] < belt))


def lag_rates(drive: Any, eps: Any) -> Callable[..., Any]:
    """Rates of angle, speed and force of the foliot with a lagging drive."""
    return lambda t, u: (u[1], u[2] - FRICTION * u[1], (drive - FRICTION * u[1] - u[2]) / eps)


def installed(**by_module: dict[str, Any]) -> dict[str, Any]:
    """The followers by their names, of those modules that are installed."""
    return {name: one for module, some in by_module.items() if find_spec(module) for name, one in some.items()}


cellwise = partial(np.vectorize, otypes=[float])
rows = partial(cellwise, signature="(),(),(),()->(row)")
"""Functions of many cells from those of one, which give a number, or a row of numbers of a clock."""


def ended(rates: Any, begin: Any, span: Any, rtol: float, event: Any, way: int = 0, method: str = "DOP853", **how: Any):
    """Time and state at the end of what scipy's solve_ivp follows up to an event, or the end of the span."""
    event.terminal, event.direction = True, way
    found = integrate.solve_ivp(rates, span, begin, method, events=event, rtol=rtol, atol=1e-3 * rtol, **how)
    return float(found.t[-1]), found.y[:, -1]


def diffrax_motion(
    solver: str, rates: Any, begin: Any, until: Any, rtol: Any, event: Any = None, steps: int = 100_000
) -> Any:
    """What diffrax's solver gives from 0 until a time or an event, whose root is found a thousand times as sharply."""
    import diffrax
    import jax
    import optimistix

    root = optimistix.Newton(rtol=1e-3 * rtol, atol=1e-3 * rtol)
    stop = None if event is None else diffrax.Event(lambda t, y, args, **_: event(t, y), root)
    return diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: jax.numpy.stack(rates(t, y))), getattr(diffrax, solver)(),
        t0=0.0, t1=until, dt0=None, y0=jax.numpy.stack(begin), event=stop, max_steps=steps, throw=False,
        stepsize_controller=diffrax.PIDController(rtol=rtol, atol=1e-3 * rtol),
    )  # fmt: skip


def side_by_side(motion: Callable[..., Any]) -> Callable[..., Any]:
    """A function of cells as jax makes it, in double precision: all cells at once; numbers are the same of all."""

    @cache
    def compiled(axes: tuple[int | None, ...]) -> Any:
        import jax

        jax.config.update("jax_enable_x64", True)
        return jax.jit(jax.vmap(motion, in_axes=axes))

    def follow(*cells: Any) -> Any:
        axes = tuple(0 if np.ndim(x) else None for x in cells)
        return np.asarray(compiled(axes)(*map(np.asarray, cells)))

    return follow


def swings(rtol: float, multiplier: float) -> int:
    """Half swings until what is left of the start is a tenth of the tolerance, and two more."""
    return math.ceil(math.log(rtol / 10) / math.log(max(multiplier, 1e-12))) + 2


def half_swing(follow: Callable[..., Any], a: Any, R: Any, speed: Any) -> tuple[Any, Any, Any]:
    """Time, amplitude and speed at the next switch of a clock, by a follower of rates up to an event."""
    out, (top, _) = follow(leg(a, R), (1.0, speed), lambda _, u: u[1])
    back, (_, last) = follow(leg(a, -R), (top, 0.0), lambda _, u: u[0] + 1.0)
    return out + back, top, -last


def settled(rtol: float, a: float, R: float, speed: float, count: int) -> Any:
    """A clock by solve_ivp's DOP853."""

    def follow(rates: Any, begin: Any, event: Any) -> Any:
        return ended(rates, begin, (0.0, FOREVER), rtol, event)

    time, top, speed = 0.0, 1.0, START * speed
    for _ in range(count):
        time, top, speed = half_swing(follow, a, R, speed)
    return np.array([2.0 * time, top, speed])


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

    def settled(a: float, R: float, speed: float, count: int) -> Any:
        log.clear()
        wanted[0] = count
        run.time = 0.0
        run.state[:] = 1.0, START * speed
        run.pars[:] = -1.0, 1.0, a, R
        run.reset_cooldowns()
        run.propagate_until(FOREVER)
        return np.array([2.0 * (log[-1][0] - log[-2][0]), top[0], log[-1][1]])

    return rows(settled)


@side_by_side
def diffrax_clocks(a: Any, R: Any, speed: Any, count: Any, rtol: Any) -> Any:
    """diffrax's Dopri8, all clocks side by side by jax, each as often as the slowest."""
    import jax

    def follow(rates: Any, begin: Any, event: Any) -> Any:
        found = diffrax_motion("Dopri8", rates, begin, FOREVER, rtol, event)
        return found.ts[-1], found.ys[-1]

    begin = (0.0 * speed, 0.0 * speed, START * speed)
    time, top, last = jax.lax.fori_loop(0, count, lambda _, found: half_swing(follow, a, R, found[2]), begin)
    return jax.numpy.stack([2.0 * time, top, last])


CLOCKS = installed(
    heyoka={"heyoka.py": heyoka_clock},
    diffrax={"diffrax": lambda rtol: lambda *clocks: diffrax_clocks(*clocks, rtol)},
    scipy={"scipy": lambda rtol: rows(partial(settled, rtol))},
)


@cellwise
def scipy_place(method: str, belt: float, fall: float, until: float, rtol: float) -> float:
    """By scipy's solver of that name, the sign as it is."""
    how = {"rtol": rtol, "atol": 1e-3 * rtol}
    run = getattr(integrate, method)(belt_rates(belt, fall), 0.0, (0.0, belt), until, **how)
    while run.status == "running" and run.nfev < MOST:
        run.step()
    return float(run.y[0]) if run.status == "finished" else math.nan


@cellwise
def modes(belt: float, fall: float, until: float, rtol: float) -> float:
    """By solve_ivp's DOP853, stick and slip apart."""

    def slips(_: float, u: Any) -> tuple[float, float]:
        return u[1], fall * u[1] - u[0] + 1.0

    t, place, last = 0.0, 0.0, 1.0 + fall * belt
    while t < until and t + (last - place) / belt < until:  # the last slip may be cut short, beyond `last`
        t += (last - place) / belt
        t, (place, _) = ended(slips, (last, belt), (t, until), rtol, lambda _, u: belt - float(u[1]), -1)
    return place + belt * (until - t)


@side_by_side
def belt_by_kvaerno5(belt: Any, fall: Any, until: Any, rtol: Any) -> Any:
    """By diffrax's Kvaerno5, the sign as it is."""
    import diffrax
    import jax

    end = diffrax_motion("Kvaerno5", belt_rates(belt, fall), (0.0 * belt, belt), until, rtol, steps=MOST)
    return jax.numpy.where(end.result == diffrax.RESULTS.successful, end.ys[-1, 0], jax.numpy.nan)


SLIDING = installed(
    scipy={f"scipy {method}": partial(scipy_place, method) for method in ("Radau", "BDF", "LSODA")},
    diffrax={"diffrax Kvaerno5": belt_by_kvaerno5},
) | {"scipy DOP853, modes by hand": modes}


@cellwise
def scipy_time(method: str, drive: float, eps: float, rtol: float) -> float:
    """By solve_ivp, with the exact Jacobian and a terminal event."""
    jacobian = np.array([[0.0, 1.0, 0.0], [0.0, -FRICTION, 1.0], [0.0, -FRICTION / eps, -1.0 / eps]])
    how = {"method": method, "jac": jacobian}
    return ended(lag_rates(drive, eps), np.zeros(3), (0.0, LATEST), rtol, lambda _, u: 1.0 - float(u[0]), **how)[0]


@side_by_side
def lag_by_kvaerno5(drive: Any, eps: Any, rtol: Any) -> Any:
    """By diffrax's Kvaerno5."""
    return diffrax_motion("Kvaerno5", lag_rates(drive, eps), (0.0,) * 3, LATEST, rtol, lambda _, u: u[0] - 1.0).ts[-1]


STIFF = installed(
    scipy={f"scipy {method}": partial(scipy_time, method) for method in ("Radau", "BDF")},
    diffrax={"diffrax Kvaerno5": lag_by_kvaerno5},
)
