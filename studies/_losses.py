"""What each loss of a foliot takes of the energy of half a swing, and the exponent of the period by these shares."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import xarray as xr

NODES = 200


legendre = functools.cache(np.polynomial.legendre.leggauss)


def shares(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with the shares `viscous`, `dry`, `drag` and `impacts` of the energy of half a swing, and its `deficit`."""
    x, w = legendre(NODES)
    t, w = (xr.DataArray(v, dims="node") for v in (0.5 * (x + 1), 0.5 * w))
    rise = t * t * (3 - 2 * t)  # fewer digits lost where the speed nears the final one
    lost: dict[str, Any] = {"viscous": 0.0, "dry": 0.0, "drag": 0.0}
    for top, sign in ((ds.e * ds.crossing_speed, 1.0), (ds.crossing_speed, -1.0)):
        v, dv = top * rise, top * 6 * t * (1 - t) * w
        parts = {"viscous": ds.a * v, "dry": ds.R + 0 * v, "drag": ds.c * v**ds.n}
        left = ds.mu + sign * sum(parts.values())
        for name, f in parts.items():
            lost[name] = lost[name] + (f * v / left * dv).sum("node")
    work = 2 * ds.mu * ds.phi0
    known = {name: value / work for name, value in lost.items()}
    known["impacts"] = 0.5 * (1 - ds.e**2) * ds.crossing_speed**2 / work
    there = ds.sensitivity.notnull()
    whole = sum(known.values())
    return ds.assign(
        {name: (value / whole).where(there) for name, value in known.items()} | {"deficit": abs(whole - 1).where(there)}
    )


def width(n: Any) -> Any:
    """k_n of (1) in `law_any_swing.py`."""
    return 2.0 * (2.0 * n + 1.0) * (3.0 * n + 2.0) / (n + 2.0) ** 2


def any_swing(ds: xr.Dataset) -> xr.Dataset:
    """`ds`, with the shares of the losses, and the swing A, the laws of large and small swings, and (1), `law`."""
    A, N, struck = ds.amplitude / ds.phi0, ds.viscous + ds.n * ds.drag, ds.impacts
    L, M = (N + struck) / (N + 2.0), N + 2.0 * struck
    x = (A**2 - 1.0) / (ds.dry + ds.viscous / width(1.0) + ds.drag / width(ds.n) + struck / width(2.0))
    return ds.assign(swing=A, large=L, small=1.0 / M, law=(1.0 + L * x) / (M + x))
