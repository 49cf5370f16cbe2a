"""The mass on a belt followed by others: scipy's Radau, BDF and LSODA, and diffrax, which know nothing of its kink.

Each follower gives the places of cells at given times, at one tolerance; NaN where it asks for the rates MOST times.
`modes` is scipy's DOP853 as an expert would use it: stick and slip apart, each up to an event.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from _peers import diffrax_motion, installed, side_by_side
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

    def place(belt: float, fall: float, until: float) -> float:
        def catches(t: float, u: Any) -> float:
            return belt - float(u[1])

        catches.terminal, catches.direction = True, -1  # type: ignore[attr-defined]
        how = {"method": "DOP853", "events": catches, "rtol": rtol, "atol": 1e-3 * rtol}
        t, place, last = 0.0, 0.0, MU + fall * belt
        while t + (last - place) / belt < until:
            t += (last - place) / belt
            slip = solve_ivp(lambda _, u: (u[1], fall * u[1] - u[0] + MU), (t, until), (last, belt), **how)
            t, place = float(slip.t[-1]), float(slip.y[0, -1])
        return place + belt * (until - t)

    return np.array([place(*map(float, cell)) for cell in zip(belt, fall, until, strict=True)])


def _kvaerno5(belt: Any, fall: Any, until: Any, rtol: Any) -> Any:
    import diffrax
    import jax

    def rates(t: Any, u: Any, args: Any) -> Any:
        return jax.numpy.stack([u[1], fall * u[1] - u[0] - MU * jax.numpy.sign(u[1] - belt)])

    begin = jax.numpy.stack([0.0 * belt, belt])
    end = diffrax_motion("Kvaerno5", rates, begin, until, None, rtol, steps=MOST)
    return jax.numpy.where(end.result == diffrax.RESULTS.successful, end.ys[-1, 0], jax.numpy.nan)


FOLLOWERS: dict[str, Callable[[Any, Any, Any, float], Any]] = installed(
    scipy={f"scipy {method}": partial(scipy_places, method) for method in ("Radau", "BDF", "LSODA")},
    diffrax={"diffrax Kvaerno5": side_by_side(_kvaerno5, 0, 0, 0, None)},
) | {"scipy DOP853, modes by hand": modes}
