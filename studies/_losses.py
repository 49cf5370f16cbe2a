"""What each loss of a foliot takes of the energy of half a swing, and the exponent of the period by these shares."""

import math
from typing import Any

import numpy as np
import xarray as xr
from scipy.optimize import brentq

NODES, WEIGHTS = np.polynomial.legendre.leggauss(200)


def of_quarter(q: float) -> tuple[float, float, float]:
    """alpha, s and A of the foliot with viscous friction alone, by q = a P/4: q - tanh q = 1/alpha."""
    t = math.tanh(q)
    alpha = 1 / (q - t)
    return alpha, (1 - t / q) / t**2, alpha * (q + math.log1p(math.exp(-2 * q)) - math.log(2))


def quarter(value: float, which: int = 0) -> float:
    """The q at which one of the three of `of_quarter` has a value; by default alpha."""
    return float(brentq(lambda q: math.log(of_quarter(q)[which] / value), 1e-4, 1e6, xtol=1e-15))


def taken(mu: Any, phi0: Any, R: Any, a: Any, c: Any, n: Any, e: Any, speed: Any) -> tuple[Any, Any]:
    """Shares, (4, ...), of dry and viscous friction, drag and impacts in the energy 2 mu phi0 of half a swing, and
    what the quadrature over the speed has missed of it. Where the foliot goes at its final speed the integrals end at a
    pole, but what is missed is all lost at that speed, to each friction by its force there."""
    mu, R, a, c, n, e, top = (np.asarray(x)[..., None] for x in (mu, R, a, c, n, e, speed))
    t = 0.5 * (NODES + 1.0)
    rise, w = t * t * (3.0 - 2.0 * t), 3.0 * t * (1.0 - t) * WEIGHTS  # fewer digits lost near the final speed

    def friction(v: Any) -> Any:
        return np.array(np.broadcast_arrays(R + 0.0 * v, a * v, c * v**n))

    lost = 0.0
    for end, sign in ((e * top, 1.0), (top, -1.0)):
        f = friction(end * rise)
        lost = lost + np.sum(f * end**2 * rise * w / (mu + sign * f.sum(0)), -1)
    work, f = 2.0 * mu[..., 0] * phi0, friction(top)[..., 0]
    whole = np.array([*lost, (0.5 * (1.0 - e**2) * top**2)[..., 0]]) / work
    missed, force = 1.0 - whole.sum(0), f.sum(0)
    whole[:3] += missed * np.divide(f, force, out=np.zeros_like(f), where=force > 0.0)
    return whole, missed


def shares(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with the shares `dry`, `viscous`, `drag` and `impacts` of the energy of half a swing, and its `deficit`."""
    names = ("mu", "phi0", "R", "a", "c", "n", "e", "crossing_speed")
    speed, *_ = given = xr.broadcast(ds.crossing_speed, *(ds[name] for name in names[:-1]))
    whole, missed = taken(*(x.values for x in given[1:]), speed.values)
    made = dict(zip(("dry", "viscous", "drag", "impacts", "deficit"), [*whole, abs(missed)], strict=True))
    return ds.assign({name: (speed.dims, values) for name, values in made.items()})


def verge(ds: xr.Dataset, period: xr.DataArray, runs: xr.DataArray) -> xr.Dataset:
    """A verge's sweep over `tau` and `I_c` with kappa, alpha, `period`, the exponent `s` and the recoil in `pitches`.

    `s` is -dlnP/dlntau by differences, between cells that run.
    """
    a = (ds.c_v + (ds.n**2 * ds.c_c if "c_c" in ds.coords else 0.0)) / ds.I_v
    rise = np.log(period).assign_coords(tau=np.log(ds.tau)).differentiate("tau").assign_coords(tau=ds.tau)
    both = runs & runs.shift(tau=1, fill_value=False) & runs.shift(tau=-1, fill_value=False)
    pitches = ds.recoil / (2 * (2 * ds.n * ds.phi0 + ds["drop"]))
    alpha = (ds.n * ds.tau / (ds.I_v * a**2 * ds.phi0)).drop_vars("alpha", errors="ignore")
    ds = ds.assign_coords(kappa=ds.n**2 * ds.I_c / ds.I_v, alpha=alpha)
    return ds.assign(period=period, s=-rise.where(both), pitches=pitches)


def width(n: Any) -> Any:
    """k_n of (1) in `law_any_swing.py`."""
    return 2.0 * (2.0 * n + 1.0) * (3.0 * n + 2.0) / (n + 2.0) ** 2


def any_swing(ds: xr.Dataset) -> xr.Dataset:
    """`ds`, with the shares of the losses, and the swing A, the laws of large and small swings, and (1), `law`."""
    A, N, struck = ds.amplitude / ds.phi0, ds.viscous + ds.n * ds.drag, ds.impacts
    L, M = (N + struck) / (N + 2.0), N + 2.0 * struck
    x = (A**2 - 1.0) / (ds.dry + ds.viscous / width(1.0) + ds.drag / width(ds.n) + struck / width(2.0))
    return ds.assign(swing=A, large=L, small=1.0 / M, law=(1.0 + L * x) / (M + x))
