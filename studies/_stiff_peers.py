"""The foliot with a lagging drive, from rest to its first switch, followed by others: scipy's Radau and BDF, diffrax.

Each follower gives the times of the first switch of cells mu, at one tolerance, a = b = 0.5/s and phi0 = 1 rad.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from importlib.util import find_spec
from typing import Any

import numpy as np

FRICTION = 0.5
FOREVER = 1e3


def scipy_times(method: str, mu: Any, eps: float, rtol: float) -> Any:
    """By solve_ivp, with the exact Jacobian and a terminal event."""
    from scipy.integrate import solve_ivp

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


@cache
def _kvaerno5() -> Any:
    import diffrax
    import jax
    import optimistix

    jax.config.update("jax_enable_x64", True)

    def rates(t: Any, u: Any, args: Any) -> Any:
        drive, eps = args
        return jax.numpy.stack([u[1], u[2] - FRICTION * u[1], (drive - FRICTION * u[1] - u[2]) / eps])

    def time(drive: Any, eps: Any, rtol: Any) -> Any:
        root = optimistix.Newton(rtol=1e-3 * rtol, atol=1e-3 * rtol)
        return diffrax.diffeqsolve(
            diffrax.ODETerm(rates),
            diffrax.Kvaerno5(),
            t0=0.0,
            t1=FOREVER,
            dt0=None,
            y0=jax.numpy.zeros(3),
            args=(drive, eps),
            stepsize_controller=diffrax.PIDController(rtol=rtol, atol=1e-3 * rtol),
            event=diffrax.Event(lambda t, y, args, **_: y[0] - 1.0, root),
            max_steps=100_000,
            throw=False,
        ).ts[-1]

    return jax.jit(jax.vmap(time, in_axes=(0, None, None)))


def diffrax_times(mu: Any, eps: float, rtol: float) -> Any:
    """By Kvaerno5, all cells side by side by jax."""
    return np.asarray(_kvaerno5()(np.asarray(mu), eps, rtol))


FOLLOWERS: dict[str, Callable[[Any, float, float], Any]] = {
    name: follower
    for name, module, follower in (
        ("scipy Radau", "scipy", partial(scipy_times, "Radau")),
        ("scipy BDF", "scipy", partial(scipy_times, "BDF")),
        ("diffrax Kvaerno5", "diffrax", diffrax_times),
    )
    if find_spec(module)
}
