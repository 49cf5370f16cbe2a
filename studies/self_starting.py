"""From which torque on does a foliot start itself, by friction, stiction, hairspring and where it rests?

    sweep run studies/self_starting.toml
    python studies/self_starting.py self_starting.h5

draws self_starting.png and prints theory beside what comes out. Released at phi_s < phi0 the foliot moves if the torque
beats stiction and spring, mu > R_s + k phi_s, and without viscous friction comes to the switch if the energy is enough,

    mu > max(R_s + k phi_s, R + k (phi0 + phi_s)/2);                                                     (1)

viscous friction takes more, at most so much that the foliot must be able to rest at the switch, mu > R + k phi0.
"""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, page_of, read_result, report

import sweep
from sweep.show.charts import COLOURS

NOTES = """\
theory is sharp, and no cell is on its border: exceptions are counted; the share of cells is right to one step of mu
"""


def started(ds: xr.Dataset) -> xr.DataArray:
    """Whether it came to the first switch."""
    return ds.flip_time.isel(flip=0).notnull()


def least(ds: xr.Dataset) -> xr.DataArray:
    """(1), the least torque without viscous friction."""
    moves = ds.R_s + ds.k * ds.phi_start
    return np.maximum(moves, ds.R + ds.k * (ds.phi0 + ds.phi_start) / 2)


def statements(ds: xr.Dataset) -> Groups:
    """Every line of the table, by heading."""
    smooth, rough = started(ds).sel(a=0), started(ds).sel(a=1)
    theory = (ds.mu > least(ds)).transpose(*smooth.dims)
    wrong = int((smooth != theory).sum())
    lost = smooth & ~rough
    gained = int((rough & ~smooth).sum())
    within = lost.where(ds.mu > np.maximum(ds.R + ds.k * ds.phi0, ds.R_s + ds.k * ds.phi_start), False)
    bare = sweep.run(
        sweep.study(
            kernel="foliot_start", axes={"mu": np.geomspace(1e-6, 1e2, 9), "phi_start": [-0.9, 0.0, 0.9]},
            fixed={"phi0": 1.0, "a": 1.0}, along={"flip": [1, 2]}, rtol=1e-9,
        )
    )  # fmt: skip
    share = float(1 - smooth.sel(k=0, R_s=0.6).mean())
    return {
        "Viscous friction alone": [
            Statement("starts itself at any torque, from anywhere", "yes (paper)", "27 cells", None,
                      bool(bare.flip_time.notnull().all())),
        ],
        "Coulomb friction, stiction and hairspring": [
            Statement("a = 0: starts where (1) says", "all cells", f"{wrong} of {smooth.size} not", None, wrong == 0),
            Statement("a = 1/s: starts where a = 0 does not", "never", f"{gained} cells", None, gained == 0),
            Statement("a = 1/s: does not start although mu > R + k phi0", "never", f"{int(within.sum())} cells", None,
                      not bool(within.any())),
            Statement("viscous friction with a spring costs cells", "some", f"{int(lost.sum())}, all with k > 0", None,
                      bool(lost.any()) and not bool(lost.sel(k=0).any())),
            Statement("no spring: does not start by stiction, R_s = 0.6", "mu <= R_s: 23/100", f"{share:.3f}", None,
                      abs(share - 0.23) < 0.015),
        ],
    }  # fmt: skip


def figure(ds: xr.Dataset) -> Any:
    """Where it starts, by hairspring; lines are (1)."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    palette = ("0.85", COLOURS[5], COLOURS[0])
    with page_of(78.0, 1, 3, sharey=True) as (page, panels):
        for axes, k in zip(panels, ds.k.values, strict=True):
            part = ds.sel(k=k, R_s=0.6)
            kind = started(part).sel(a=0).astype(int) + started(part).sel(a=1)
            axes.pcolormesh(ds.phi_start, ds.mu, kind.transpose("mu", "phi_start"), cmap=ListedColormap(list(palette)),
                            vmin=-0.5, vmax=2.5, shading="nearest", rasterized=True)  # fmt: skip
            axes.plot(ds.phi_start, least(part), color="black", linewidth=0.9, label="theory")
            enough = axes.axhline(float(ds.R + k * ds.phi0), color="black", linewidth=0.8, linestyle=(0, (4, 2)))
            enough.set_label(r"$\mu=R+k\varphi_0$")
            axes.set(
                xlabel=r"released at $\varphi_\mathrm{s}/\varphi_0$ [1]", ylim=(0, 2.5), title=f"$k={k:g}$ s$^{{-2}}$"
            )
        panels[0].set_ylabel(r"torque, $\mu/\varphi_0$ [s$^{-2}$]")
        keys = [
            Patch(color=c, label=t) for c, t in zip(palette, ("rests", "starts if $a=0$ only", "starts"), strict=True)
        ]
        page.legend(handles=[*keys, *panels[0].lines], loc="outside lower center", ncols=5)
    return page


def conclude(path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = read_result(path, "foliot_start", ["a", "k", "R_s", "phi_start", "mu"], "self_starting.toml")
    return statements(ds), [NOTES], lambda: figure(ds)


main = partial(report, __file__, ["self_starting.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
