"""On which steps of voltage does a driven Josephson junction lock, and how wide are they?

    python studies/shapiro.py shapiro.h5

On step n the phase turns n times in a period of the drive, so that the voltage is n w whatever the current. Of a fast
drive the phase follows the alternating current and turns slowly besides, by

    psi' = detuning - J_n(ac) sin(psi),                                                                  (1)

J_n being Bessel's function: it is locked where abs(detuning) < abs(J_n(ac)), and a disturbance decays in a period of
the drive by exp(-2 pi/w sqrt(J_n^2 - detuning^2)). Without the drive (ac = 0, n = 0) both are exact. The decay below is
(ln(multiplier) w/2 pi)^2.
"""

import numpy as np
import xarray as xr
from _common import Claims, Statement, differing, most, said, script
from _figures import COLOURS, Axis, ListedColormap, direct_label, page, panel, points
from scipy.special import jv

from kernels.interface import Status

BORDER = 0.5
"""Times 1/w, within which borders are not those of (1): a constant current sqrt(1 + (n w)^2) gives the voltage n w."""


def scaled(ds: xr.Dataset) -> xr.Dataset:
    """The sweep with Bessel's function, and the square of how fast disturbances decay."""
    bessel = xr.apply_ufunc(jv, ds.order, ds.ac)
    rate = -ds.w / (2.0 * np.pi) * np.log(ds.multiplier)
    return ds.assign(bessel=bessel, decay=rate**2, locked=ds.status == Status.OK)


def claims(ds) -> Claims:
    yield "Shapiro steps"
    inside, clear = abs(ds.bessel) - abs(ds.detuning), BORDER / ds.w
    own = ds.locked & (ds.phase_turns == ds.order)
    right = [bool((own == (inside > 0)).where(abs(inside) > clear, True).sel(w=w).all()) for w in ds.w]
    free = ds.sel(order=0, ac=0.0)
    middle = abs(ds.decay - ds.bessel**2).where(own).sel(detuning=0.0).max(("order", "ac"))
    falls = float(np.log(middle[1] / middle[0]) / np.log(ds.w[1] / ds.w[0]))
    yield most("period of the cycle", "2 pi/w", ds.period * ds.w / (2.0 * np.pi) - 1.0, 1e-6, "")
    yield most(
        "decay without a drive", "1 - detuning^2", (free.decay + free.detuning**2 - 1.0).where(free.locked), 1e-5
    )
    for w, here in zip(ds.w.values, right, strict=True):
        yield said(f"w = {w:g}: n turns a period by (1), but for {BORDER / w:.2f}", here, "", "all cells")
    yield Statement("decay in the middle beside (1)", "", ", ".join(f"{off:.4f}" for off in middle.values))
    yield differing("its deviation goes as w to the power", "-2", falls, -2.0, 0.2)


OVER = "alternating current over $w$ [1]"


@panel(Axis("constant current over the critical one [1]", (-1, 7)), Axis(OVER, (0, 6.5)))
@panel(Axis(OVER), Axis("rate of decay in the middle [1]", (0, 1.05)), "upper right")
@page(136.0)
def figure(plane, decay, ds):
    """The steps over both currents, their borders by (1), and the decay on one of them."""
    slow, fast = ds.sel(w=2.0), ds.sel(w=8.0)
    fine = np.linspace(0.0, 6.0, 200)
    for n in map(int, ds.order.values):
        colour, here = COLOURS[n], slow.sel(order=n).transpose("ac", "detuning")
        locked, look = np.where(here.locked, 1.0, np.nan), {"cmap": ListedColormap([colour]), "alpha": 0.45}
        plane.pcolormesh(2.0 * n + here.detuning, here.ac, locked, rasterized=True, **look)
        for sign in (1.0, -1.0):
            plane.plot(2.0 * n + sign * abs(jv(n, fine)), fine, color=colour, linewidth=0.8)
        direct_label(plane, 2.0 * n, 6.25, f"$n={n}$", colour)
        line = fast.sel(order=n, detuning=0.0)
        points(decay, line.ac, np.sqrt(line.decay), n, marker="os^D"[n], markersize=3)
        decay.plot(fine, abs(jv(n, fine)), color=colour, linewidth=0.8, label=f"$n={n}$")


main = script(__name__, "shapiro.h5", claims, figure, scaled)
