"""The mass on a belt followed by others: scipy's Radau, BDF and LSODA, and diffrax, which know nothing of its kink.

Each follower gives the places of cells at given times, at one tolerance; NaN where it asks for the rates MOST times.
`modes` is scipy's DOP853 as an expert would use it: stick and slip apart, each up to an event.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

MU = 1.0
MOST = 5_000


class TooManyCalls(Exception):
    """More calls of the rates than a follower is given."""


def scipy_places(method: str, belt: Any, fall: Any, until: Any, rtol: float) -> Any:
    """By solve_ivp, the sign as it is."""

    def place(belt: float, fall: float, until: float) -> float:
        calls = 0

        def rates(t: float, u: Any) -> tuple[float, float]:
            nonlocal calls
            calls += 1
            if calls > MOST:
                raise TooManyCalls
            return u[1], fall * u[1] - u[0] - MU * np.sign(u[1] - belt)

        try:
            return float(solve_ivp(rates, (0.0, until), (0.0, belt), method, rtol=rtol, atol=1e-3 * rtol).y[0, -1])
        except TooManyCalls:
            return np.nan

    return np.array([place(*map(float, cell)) for cell in zip(belt, fall, until, strict=True)])


def modes(belt: Any, fall: Any, until: Any, rtol: float) -> Any:
    """By solve_ivp's DOP853, stick and slip apart."""
    return np.array([motion(*map(float, cell), rtol)[0, -1] for cell in zip(belt, fall, until, strict=True)])


def motion(belt: float, fall: float, until: float, rtol: float, longest: float = np.inf) -> Any:
    """Places and speeds of one cell, which starts on the belt and is on it at the time `until`; steps to `longest`."""

    def catches(t: float, u: Any) -> float:
        return belt - float(u[1])

    catches.terminal, catches.direction = True, -1  # type: ignore[attr-defined]
    t, found, last = 0.0, [np.array([[0.0], [belt]])], MU + fall * belt
    while t + (last - found[-1][0, -1]) / belt < until:
        t += (last - found[-1][0, -1]) / belt
        how = {"events": catches, "rtol": rtol, "atol": 1e-3 * rtol, "max_step": longest}
        slip = solve_ivp(lambda _, u: (u[1], fall * u[1] - u[0] + MU), (t, until), (last, belt), "DOP853", **how)
        t = float(slip.t[-1])
        found.append(slip.y)
    return np.concatenate([*found, [[found[-1][0, -1] + belt * (until - t)], [belt]]], axis=1)


@cache
def _kvaerno5() -> Any:
    import diffrax
    import jax

    jax.config.update("jax_enable_x64", True)

    def rates(t: Any, u: Any, cell: Any) -> Any:
        belt, fall = cell
        return jax.numpy.stack([u[1], fall * u[1] - u[0] - MU * jax.numpy.sign(u[1] - belt)])

    def place(belt: Any, fall: Any, until: Any, rtol: Any) -> Any:
        end = diffrax.diffeqsolve(
            diffrax.ODETerm(rates),
            diffrax.Kvaerno5(),
            t0=0.0,
            t1=until,
            dt0=None,
            y0=jax.numpy.stack([0.0 * belt, belt]),
            args=(belt, fall),
            stepsize_controller=diffrax.PIDController(rtol=rtol, atol=1e-3 * rtol),
            max_steps=MOST,
            throw=False,
        )
        right = end.result == diffrax.RESULTS.successful
        return jax.numpy.where(right, end.ys[-1, 0], jax.numpy.nan)

    return jax.jit(jax.vmap(place, in_axes=(0, 0, 0, None)))


def diffrax_places(belt: Any, fall: Any, until: Any, rtol: float) -> Any:
    """By Kvaerno5, all cells side by side by jax."""
    return np.asarray(_kvaerno5()(np.asarray(belt), np.asarray(fall), np.asarray(until), rtol))


FOLLOWERS: dict[str, Callable[[Any, Any, Any, float], Any]] = {
    name: follower
    for name, module, follower in (
        ("scipy Radau", "scipy", partial(scipy_places, "Radau")),
        ("scipy BDF", "scipy", partial(scipy_places, "BDF")),
        ("scipy LSODA", "scipy", partial(scipy_places, "LSODA")),
        ("diffrax Kvaerno5", "diffrax", diffrax_places),
        ("scipy DOP853, modes by hand", "scipy", modes),
    )
    if find_spec(module)
}
