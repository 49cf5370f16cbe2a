"""The foliot with a lagging drive, from rest to its first switch, followed by others: scipy's Radau and BDF, diffrax.

Each follower gives the times of the first switch of cells mu, at one tolerance, a = b = 0.5/s and phi0 = 1 rad.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from _peers import diffrax_motion, installed, side_by_side
from scipy.integrate import solve_ivp

FRICTION = 0.5
FOREVER = 1e3


def scipy_times(method: str, mu: Any, eps: float, rtol: float) -> Any:
    """By solve_ivp, with the exact Jacobian and a terminal event."""

    def switch(t: float, u: Any, *_: Any) -> float:
        return 1.0 - float(u[0])

    switch.terminal = True  # type: ignore[attr-defined]
    jacobian = np.array([[0.0, 1.0, 0.0], [0.0, -FRICTION, 1.0], [0.0, -FRICTION / eps, -1.0 / eps]])

    def time(drive: float) -> float:
        def rates(t: float, u: Any) -> tuple[float, float, float]:
            return u[1], u[2] - FRICTION * u[1], (drive - FRICTION * u[1] - u[2]) / eps

        how = {"events": switch, "jac": jacobian, "rtol": rtol, "atol": 1e-3 * rtol}
        return float(solve_ivp(rates, (0.0, FOREVER), np.zeros(3), method, **how).t[-1])

    return np.array([time(float(drive)) for drive in mu])


def _kvaerno5(drive: Any, eps: Any, rtol: Any) -> Any:
    import jax

    def rates(t: Any, u: Any, args: Any) -> Any:
        return jax.numpy.stack([u[1], u[2] - FRICTION * u[1], (drive - FRICTION * u[1] - u[2]) / eps])

    begin, event = jax.numpy.zeros(3), lambda t, y, args, **_: y[0] - 1.0
    return diffrax_motion("Kvaerno5", rates, begin, FOREVER, None, rtol, event).ts[-1]


FOLLOWERS: dict[str, Callable[[Any, float, float], Any]] = installed(
    scipy={"scipy Radau": partial(scipy_times, "Radau"), "scipy BDF": partial(scipy_times, "BDF")},
    diffrax={"diffrax Kvaerno5": side_by_side(_kvaerno5, 0, None, None)},
)
