"""By what law does the period of a foliot fall with its drive torque when friction is c |v|^n, or a v + R?

    python studies/friction_laws.py friction_laws.h5 friction_laws_map.h5

s = -dlnP/dlnmu. Friction c |v|^n alone leaves one group, alpha_n = mu^(2/n-1) c^(-2/n)/phi0, so that
dlnP/dlnc = (2s - 1)/(2 - n), and
    slow swings, which friction holds at its terminal speed:  s = 1/n,      at small mu for n < 2, at large for n > 2;
    free swings, which friction hardly slows:                 s = n/(n+2),  the other way round.             (1)
With a v + R at strong drive, x = v0/mu obeys R x^2 + (2/3) a mu x^3 = 2 phi0, P = 4 x. For R >> a^2 phi0, R/mu << 1:
    s = (1/3) y/(1 + y) + (R/mu)^2,  y = (2 phi0/R)^(1/2) a mu/R, least at mu/R = (18 R/(a^2 phi0))^(1/6),   (2)
there s = (3 a^2 phi0/(2 R))^(1/3). As mu grows without end, s - 1/3 goes as 4/45 - R/(9 a^2 phi0).  Derived here.

mu and R are in units of a^2 phi0. A limit holds if the next term of its series accounts for the deviation. The paper,
Hoyng & Nieuwenhuizen, arXiv:1604.06681, has n = 1 and says that strong drive is best: there s = 1/3.
"""

from fractions import Fraction

import numpy as np
import xarray as xr
from _common import Claims, compared, differing, most, never, said, script, solved
from _figures import COLOURS, SLOPE, TORQUE, Log, colour_map, contours, direct_label, hatch, page, panel

import sweep
from kernels.interface import Status

KNOWN = {10.0: (8.719, 0.27318), 100.0: (6.098, 0.17768)}
"""mu/R and s in the valley at R/(a^2 phi0), in 50-digit arithmetic."""
HEIGHTS = {0.0: -0.06, 1.0: -0.94, 2.0: -0.45, 3.0: -0.55, 4.0: -0.72}
"""By degree, where the name of a line stands."""


def valley(grid: xr.Dataset) -> xr.Dataset:
    """The best torque at every R of the map above the threshold: `mu`, `R`, `sensitivity` along `cell`."""
    place = sweep.where_exponent(grid.sensitivity.where(grid.R > 1, drop=True), "mu", 0.0).abscissa
    place = place.where(place.notnull(), drop=True)
    return solved("foliot", design="zip", mu=place, R=place.R, a=1, phi0=1)


def claims(laws, grid, line) -> Claims:
    yield "Far out"
    # over three decades at each end; allowed: how far s is from its limit at their inner end, alpha_n, or
    # 2n/(n+2) powers of (n+2)/alpha_n
    for n in laws.n.values[laws.n.values > 0]:
        limits = (1 / n, n / (n + 2))[:: 1 if n <= 2 else -1]
        for drive, edge, limit in zip(("small", "large"), (1e-21, 1e21), limits, strict=True):
            alpha = edge ** (2 / n - 1)
            next_term = alpha if alpha < 1 else ((n + 2) / alpha) ** (2 * n / (n + 2)) if alpha > 1 else 0.0
            window, text = (None, edge) if edge < 1 else (edge, None), f"-{Fraction(limit).limit_denominator(99)}"
            exponent = sweep.fit_exponent(laws.period.sel(n=n), "mu", window).exponent
            yield differing(f"n = {n:g}: exponent of P, {drive} mu", text, exponent, -limit, 1e-9 + next_term)

    yield "At every drive"
    # Steps in ln alpha_n are 2/n - 1 times those in ln mu, so differences of ln P are of n >= 1.
    dry, air, some = laws.sel(n=0), laws.sel(n=2), laws.sel(n=laws.n[laws.n >= 1])
    rho2, silent = (1 / dry.mu) ** 2, dry.status == Status.NEVER_STARTS
    rough = float(np.diff(np.log(laws.mu)).max()) ** 4 / 4
    apart, coulomb = sweep.local_exponent(some.period, "mu") + some.sensitivity, rho2 / (1 - rho2)
    grown = laws.amplitude.sel(n=1) * laws.mu ** (-1 / 3)
    yield most("n = 0: s at every mu > R", "rho^2/(1 - rho^2)", dry.sensitivity / coulomb - 1, 1e-10)
    yield never("n = 0: a cycle for mu <= R, or none above", silent != (dry.mu <= 1))
    yield most("n = 2: s at every mu", "1/2", air.sensitivity - 0.5, 1e-10)
    yield compared("n = 1: amplitude/mu^(1/3), largest mu", "3^(2/3)/2 = 1.0400", grown[-1], 3 ** (2 / 3) / 2, 1e-9)
    yield most("differences of ln P against the exact s", "0", apart, rough, "largest distance")
    ds = solved("foliot", n=[0.5, 1.0, 3.0], c=np.geomspace(0.9, 1.1, 9), mu=1.5, phi0=1, rtol=1e-11)
    ds = ds.assign(slope=sweep.local_exponent(ds.period, "c"), theory=(2 * ds.sensitivity - 1) / (2 - ds.n))
    for n in ds.n.values:
        here = ds.sel(n=n).isel(c=4)
        what, theory = f"n = {n:g}: dlnP/dlnc at s = {here.sensitivity:.4f}", float(here.theory)
        yield differing(what, f"(2s-1)/(2-n) = {theory:.6f}", here.slope, theory, 1e-6)

    yield "Viscous and Coulomb friction"
    # R at which s leaves 1/3 upwards and downwards alike, and the power laws of the valley at large R
    first, below = grid.R[grid.R > 0.8].min(), grid.R.where((grid.sensitivity < 1 / 3 - 1e-9).any("mu")).min()
    s = solved("foliot", mu=1e8, R=np.linspace(0.7, 0.9, 9), a=1, phi0=1).sensitivity
    threshold = sweep.where_exponent(s, "R", 1 / 3, values=True).abscissa
    yield said("smallest R of the map with s < 1/3", below == first, f"{below:.4f}", f"{first:.4f}")
    yield compared("R at which s - 1/3 changes sign, mu = 1e8", "0.8", threshold, 0.8, 3 * (3 / 1e8) ** (2 / 3))
    for R, (drive, s) in KNOWN.items():
        cell = line.isel(cell=int(abs(line.R / R - 1).argmin("cell")))
        yield compared(f"R = {R:g}: best torque mu/R", f"{drive}", cell.mu / cell.R, drive, 2e-4)
        yield compared("  s there", f"{s}", cell.sensitivity, s, 2e-5)
    R = float(line.R[-1])
    for name, y, power, prefactor, text in (
        ("s", line.sensitivity, -1 / 3, 1.5 ** (1 / 3), ("-1/3", "(3/2)^(1/3) = 1.1447")),
        ("mu/R", (line.mu / line.R).rename("mu/R"), 1 / 6, 18 ** (1 / 6), ("1/6", "18^(1/6) = 1.6189")),
    ):
        exponent = sweep.fit_exponent(y, "R", (1e7, None)).exponent
        yield differing(f"valley: {name} ~ R^x, R > 1e7", text[0], exponent, power, 0.01)
        yield compared(f"  {name}/R^x at R = {R:.0e}", text[1], y[-1] / R**power, prefactor, 0.01)


@panel(Log(r"torque, $\mu$ [rad/s$^2$]", (1e-9, 1e9)), SLOPE.to(-1.05, 0.05))
@panel(TORQUE, Log(r"Coulomb friction, $R/(a^2\varphi_0)$ [1]"))
@page(142.0, height_ratios=(1, 1.15))
def figure(exponents, valley, laws, grid, line):
    """Exponents against torque, and the map with its valley."""
    for i, (n, height) in enumerate(HEIGHTS.items()):
        exponents.plot(laws.mu, -laws.sensitivity.sel(n=n), color=COLOURS[i])
        direct_label(exponents, 3e-7 if n else 2e6, height, f"$n={n:g}$", COLOURS[i])
    part = grid.sel(R=slice(1e-2, 1e5), mu=slice(1e-2, 1e7))
    mu, R, s = part.mu.values, part.R.values, part.sensitivity.values
    colour_map(valley, mu, R, np.minimum(s, 1.0), "exponent, $s$ [1]", vmin=0, vmax=1, cmap="cividis_r")
    places = [(3.0, 0.05), (1.1, 0.05), (0.5, 0.05), (0.1, 0.02), (1e6, 600), (1e6, 3500), (1e6, 1.5e4)]
    levels = (0.1, 0.2, 0.3, 1 / 3, 0.4, 0.5, 0.7, 1)
    contours(valley, mu, R, s, levels, "black", fmt=lambda x: f"{x:g}", manual=places)
    hatch(valley, mu, R, (part.status == Status.NEVER_STARTS).values, "////")
    valley.plot(line.mu, line.R, "k--", linewidth=1.4)
    direct_label(valley, 0.6, 2e3, r"never starts, $\mu \leq R$")
    direct_label(valley, 2e4, 0.35, r"$s = 1/3$: $R = 0.8\,a^2\varphi_0$")
    direct_label(valley, 2e5, 8, "best torque (dashed)")


INPUTS = "friction_laws.h5 friction_laws_map.h5"
main = script(__name__, INPUTS, claims, figure, lambda laws, grid: (laws, grid, valley(grid)))
