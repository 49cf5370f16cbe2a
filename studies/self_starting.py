"""From which torque on does a foliot start itself, by friction, stiction, hairspring and where it rests?

    python studies/self_starting.py self_starting.h5

Released at phi_s < phi0 the foliot moves if the torque beats stiction and spring, mu > R_s + k phi_s, and without
viscous friction comes to the switch if the energy is enough,

    mu > max(R_s + k phi_s, R + k (phi0 + phi_s)/2);                                                     (1)

viscous friction takes more, at most so much that the foliot must be able to rest at the switch, mu > R + k phi0. No
cell is on these borders, so that exceptions are counted.
"""

import numpy as np
import xarray as xr
from _common import Claims, never, said, script, solved
from _figures import COLOURS, Axis, kinds_map, page, panel


def started(ds: xr.Dataset) -> xr.DataArray:
    """Whether it came to the first switch."""
    return ds.flip_time.isel(flip=0).notnull()


def least(ds: xr.Dataset) -> xr.DataArray:
    """(1), the least torque without viscous friction."""
    return np.maximum(ds.R_s + ds.k * ds.phi_start, ds.R + ds.k * (ds.phi0 + ds.phi_start) / 2)


def claims(ds) -> Claims:
    yield "Viscous friction alone"
    places = {"mu": np.geomspace(1e-6, 1e2, 9), "phi_start": [-0.9, 0.0, 0.9]}
    bare = solved("foliot_start", **places, phi0=1.0, a=1.0, along={"flip": [1, 2]}, rtol=1e-9).flip_time
    yield said("starts itself at any torque, from anywhere", bare.notnull().all(), "27 cells", "yes (paper)")

    yield "Coulomb friction, stiction and hairspring"
    smooth, rough = started(ds).sel(a=0), started(ds).sel(a=1)
    lost, share = smooth & ~rough, float(1 - smooth.sel(k=0, R_s=0.6).mean())
    enough = ds.mu > np.maximum(ds.R + ds.k * ds.phi0, ds.R_s + ds.k * ds.phi_start)
    costs = lost.any() and not lost.sel(k=0).any()
    yield never("a = 0: starts otherwise than (1) says", smooth != (ds.mu > least(ds)).transpose(*smooth.dims))
    yield never("a = 1/s: starts where a = 0 does not", rough & ~smooth)
    yield never("a = 1/s: does not start although mu > R + k phi0", lost & enough)
    yield said("viscous friction with a spring costs cells", costs, f"{int(lost.sum())}, all with k > 0", "some")
    what = "no spring: does not start by stiction, R_s = 0.6"
    yield said(what, abs(share - 0.23) < 0.015, f"{share:.3f}", "mu <= R_s: 23/100")


KINDS = {"rests": "0.85", "starts if $a=0$ only": COLOURS[5], "starts": COLOURS[0]}
RELEASED = Axis(r"released at $\varphi_\mathrm{s}/\varphi_0$ [1]")


@panel(RELEASED, Axis(r"torque, $\mu/\varphi_0$ [s$^{-2}$]", (0, 2.5)))
@panel(RELEASED, Axis("", (0, 2.5)))
@page(86.0, columns=2, sharey=True)
def figure(left, right, ds):
    """Where it starts, by hairspring; lines are (1)."""
    for axes, k in zip((left, right), ds.k.values[[0, -1]], strict=True):
        part = ds.sel(k=k, R_s=0.6)
        kind = started(part).sel(a=0).astype(int) + started(part).sel(a=1)
        keys = kinds_map(axes, ds.phi_start, ds.mu, kind.transpose("mu", "phi_start"), KINDS)
        axes.plot(ds.phi_start, least(part), color="black", linewidth=0.9, label="theory")
        enough = axes.axhline(float(ds.R + k * ds.phi0), color="black", linewidth=0.8, linestyle=(0, (4, 2)))
        enough.set_label(r"$\mu=R+k\varphi_0$")
        axes.set_title(f"$k={k:g}$ s$^{{-2}}$")
    left.figure.legend(handles=[*keys, *left.lines], loc="outside lower center", ncols=3)


main = script(__name__, "self_starting.h5", claims, figure)
