"""By what law does the period of a foliot fall with its drive torque when friction is c |v|^n, or a v + R?

    sweep run studies/friction_laws.toml
    sweep run studies/friction_laws_map.toml
    python studies/friction_laws.py friction_laws.h5 friction_laws_map.h5

draws friction_laws.png and prints theory beside what comes out, s = -dlnP/dlnmu. Friction c |v|^n alone leaves one
group, alpha_n = mu^(2/n-1) c^(-2/n)/phi0, so that dlnP/dlnc = (2s - 1)/(2 - n), and
    slow swings, which friction holds at its terminal speed:  s = 1/n,      at small mu for n < 2, at large for n > 2;
    free swings, which friction hardly slows:                 s = n/(n+2),  the other way round.             (1)
With a v + R at strong drive, x = v0/mu obeys R x^2 + (2/3) a mu x^3 = 2 phi0, P = 4 x. For R >> a^2 phi0, R/mu << 1:
    s = (1/3) y/(1 + y) + (R/mu)^2,  y = (2 phi0/R)^(1/2) a mu/R, least at mu/R = (18 R/(a^2 phi0))^(1/6),   (2)
there s = (3 a^2 phi0/(2 R))^(1/3). As mu grows without end, s - 1/3 goes as 4/45 - R/(9 a^2 phi0).  Derived here.
"""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, differing, direct_label, hatch, page_of, read_result, report

import sweep
from kernels.interface import Status
from sweep.show.charts import COLOURS

KNOWN = {10.0: (8.719, 0.27318), 100.0: (6.098, 0.17768)}
"""mu/R and s in the valley at R/(a^2 phi0), in 50-digit arithmetic."""

NOTES = """\
s = -dlnP/dlnmu; mu, R in units of a^2 phi0; deviations of exponents are differences, others relative; a limit holds if
the next term of its series accounts for the deviation
paper: Hoyng & Nieuwenhuizen, arXiv:1604.06681, has n = 1 and says that strong drive is best: there s = 1/3\
"""


def limits(n: float) -> tuple[float, float]:
    """s at the smallest and at the largest mu, by (1)."""
    slow, free = (1 / n, n / (n + 2))
    return (slow, free) if n <= 2 else (free, slow)


def ends(laws: xr.Dataset) -> list[Statement]:
    """Exponents of the period over the outermost three decades."""
    found = []
    for n in laws.n.values[laws.n.values > 0]:
        law = laws.sel(n=n)
        for name, value, window, edge in zip(
            "sl", limits(n), ((None, 1e-21), (1e21, None)), (1e-21, 1e21), strict=True
        ):
            fit = sweep.fit_exponent(law.period, "mu", window)
            what = f"n = {n:g}: exponent of P, {'small' if name == 's' else 'large'} mu"
            found.append(differing(what, f"-{_fraction(n, value)}", fit.exponent.item(), -value, next_term(n, edge), 9))
    return found


def _fraction(n: float, value: float) -> str:
    return f"1/{n:g}" if value == 1 / n else f"{n:g}/{n + 2:g}"


def next_term(n: float, mu: float) -> float:
    """Distance of s from its limit at the inner end of a window: alpha_n, or 2n/(n+2) powers of (n+2)/alpha_n."""
    alpha = mu ** (2 / n - 1)
    return 1e-9 + (alpha if alpha < 1 else ((n + 2) / alpha) ** (2 * n / (n + 2)) if alpha > 1 else 0.0)


def exact(laws: xr.Dataset) -> list[Statement]:
    """What holds at every drive."""
    dry, air = laws.sel(n=0), laws.sel(n=2)
    rho2 = (1 / dry.mu) ** 2
    coulomb = float(abs(dry.sensitivity / (rho2 / (1 - rho2)) - 1).max())
    held = int((dry.mu <= 1).sum())
    half, silent = float(abs(air.sensitivity - 0.5).max()), int((dry.status == Status.NEVER_STARTS).sum())

    return [
        Statement("n = 0: s at every mu > R", "rho^2/(1 - rho^2)", "largest deviation", coulomb, coulomb < 1e-10),
        Statement("n = 0: no cycle for mu <= R", f"{held} cells", f"{silent} cells", None, silent == held),
        Statement("n = 2: s at every mu", "1/2", "largest deviation", half, half < 1e-10),
        viscous(laws.sel(n=1)),
        differences(laws),
        *by_friction(),
    ]


def viscous(law: xr.Dataset) -> Statement:
    """n = 1 by the integrals of any n, against the closed form of viscous friction."""
    fixed = {"a": float(law.c), "phi0": float(law.phi0)}
    closed = sweep.run(sweep.study(kernel="foliot", method="closed", axes={"mu": law.mu.values}, fixed=fixed))
    off = max(float(abs(law[y] / closed[y] - 1).max()) for y in ("period", "amplitude", "sensitivity"))
    return Statement(
        "n = 1: P, amplitude, s against the viscous closed form", "0", "largest deviation", off, off < 1e-11
    )


def differences(laws: xr.Dataset) -> Statement:
    """The exact s against differences of ln P, for n >= 1; steps in ln alpha_n are 2/n - 1 times those in ln mu."""
    some = laws.sel(n=laws.n[laws.n >= 1])
    off = float(abs(sweep.local_exponent(some.period, "mu") + some.sensitivity).max())
    rough = float(np.diff(np.log(laws.mu)).max()) ** 4 / 4
    return Statement("differences of ln P against the exact s", "0", "largest distance", off, off < rough)


def by_friction() -> list[Statement]:
    """dlnP/dlnc, by differences over a sweep of the friction alone."""
    axes = {"n": [0.5, 1.0, 3.0], "c": np.geomspace(0.9, 1.1, 9)}
    study = sweep.study(kernel="foliot", rtol=1e-11, axes=axes, fixed={"mu": 1.5, "phi0": 1.0})
    ds = sweep.run(study)
    slope = sweep.local_exponent(ds.period, "c").isel(c=4)
    theory = ((2 * ds.sensitivity - 1) / (2 - ds.n)).isel(c=4)
    found = []
    for n in ds.n.values:
        what, value = f"n = {n:g}: dlnP/dlnc at s = {ds.sensitivity.sel(n=n)[4]:.4f}", theory.sel(n=n).item()
        found.append(differing(what, f"(2s-1)/(2-n) = {value:.6f}", slope.sel(n=n).item(), value, 1e-6))
    return found


def foliot(mu: Any, R: Any, design: str = "product") -> xr.Dataset:
    """Viscous and Coulomb friction at other mu and R."""
    axes = {"mu": np.atleast_1d(mu), "R": np.atleast_1d(R)}
    fixed = {"a": 1.0, "phi0": 1.0}
    return sweep.run(sweep.study(kernel="foliot", design=design, axes=axes, fixed=fixed))


def valley(grid: xr.Dataset) -> xr.Dataset:
    """The best torque at every R of the map above the threshold: `mu`, `R`, `sensitivity` along `cell`."""
    place = sweep.where_exponent(grid.sensitivity.where(grid.R > 1, drop=True), "mu", 0.0).abscissa
    place = place.where(place.notnull(), drop=True)
    return foliot(place.values, place.R.values, "zip")


def threshold() -> float:
    """R at which s leaves 1/3 upwards and downwards alike as mu grows without end."""
    s = foliot(1e8, np.linspace(0.7, 0.9, 9)).isel(mu=0).sensitivity
    return sweep.where_exponent(s, "R", 1 / 3, values=True).abscissa.item()


def best(grid: xr.Dataset, line: xr.Dataset) -> list[Statement]:
    """Where strong drive is best, and where it is not."""
    third, first = 1 / 3, float(grid.R[grid.R > 0.8].min())
    below = float(grid.R.where((grid.sensitivity < third - 1e-9).any("mu")).min())
    weak = float(grid.sensitivity.where(grid.R < 0.79).min())
    least = f"R < 0.79: least s - 1/3 of {int((grid.R < 0.79).sum())} x {grid.mu.size} cells"
    found = [
        Statement(least, "> 0", f"{weak - third:.2g}", None, weak > third),
        Statement("smallest R of the map with s < 1/3", f"{first:.4f}", f"{below:.4f}", None, below == first),
        compared("R at which s - 1/3 changes sign, mu = 1e8", "0.8", threshold(), 0.8, 3 * (3 / 1e8) ** (2 / 3)),
    ]
    for R, (drive, s) in KNOWN.items():
        cell = line.isel(cell=int(abs(line.R / R - 1).argmin("cell")))
        found += [
            compared(f"R = {R:g}: best torque mu/R", f"{drive}", float(cell.mu / cell.R), drive, 2e-4, 4),
            compared("  s there", f"{s}", float(cell.sensitivity), s, 2e-5, 5),
        ]
    return found + far(line)


def far(line: xr.Dataset) -> list[Statement]:
    """Power laws of the valley at large R."""
    R = line.R.values
    drive = xr.DataArray(line.mu.values / R, {"R": R}, ("R",), "mu/R")
    s = xr.DataArray(line.sensitivity.values, {"R": R}, ("R",), "s")
    found = []
    for name, y, text, power, prefactor in (
        ("s", s, "-1/3, (3/2)^(1/3) = 1.1447", -1 / 3, 1.5 ** (1 / 3)),
        ("mu/R", drive, "1/6, 18^(1/6) = 1.6189", 1 / 6, 18 ** (1 / 6)),
    ):
        fit = sweep.fit_exponent(y, "R", (1e7, None))
        off, last = fit.exponent.item() - power, float(y[-1] / R[-1] ** power)
        here = f"{fit.exponent.item():.4f}, {last:.4f}"
        fits = abs(off) < 0.01 and abs(last / prefactor - 1) < 0.01
        found.append(Statement(f"valley: {name} ~ R^x, R > 1e7; prefactor at R = {R[-1]:.0e}", text, here, off, fits))
    return found


def figure(laws: xr.Dataset, grid: xr.Dataset, line: xr.Dataset) -> Any:
    """Exponents against torque, their limits against n, and the map with its valley."""
    with page_of(70.0, 1, 3, width_ratios=(1.1, 0.85, 1.25)) as (page, (left, middle, right)):
        draw_exponents(left, laws)
        draw_limits(middle, laws)
        draw_map(right, grid, line)
    return page


def draw_exponents(axes: Any, laws: xr.Dataset) -> None:
    """-s against mu for every n."""
    for i, n in enumerate((0.0, 1.0, 2.0, 3.0, 4.0)):
        law = laws.sel(n=n)
        axes.semilogx(law.mu, -law.sensitivity, color=COLOURS[i])
        heights = {0.0: -0.06, 1.0: -0.94, 2.0: -0.45, 3.0: -0.55, 4.0: -0.72}
        direct_label(axes, 3e-7 if n else 2e6, heights[n], f"$n={n:g}$", COLOURS[i])
    axes.set(xlim=(1e-9, 1e9), ylim=(-1.05, 0.05), xlabel=r"torque, $\mu$ [rad/s$^2$]")
    axes.set_ylabel(r"exponent, $\mathrm{d}\ln P/\mathrm{d}\ln\mu$ [1]")


def draw_limits(axes: Any, laws: xr.Dataset) -> None:
    """The exponents at both ends of the torque against n."""
    n = np.linspace(0.2, 4.3, 200)
    axes.plot(n, -1 / n, color="black", linewidth=0.8)
    axes.plot(n, -n / (n + 2), color="black", linewidth=0.8, linestyle=(0, (5, 1.5)))
    some = laws.sel(n=laws.n[laws.n > 0])
    axes.plot(
        some.n, -some.sensitivity.isel(mu=0), "o", color=COLOURS[0], markerfacecolor="white", label=r"small $\mu$"
    )
    axes.plot(some.n, -some.sensitivity.isel(mu=-1), "s", color=COLOURS[1], markersize=3, label=r"large $\mu$")
    axes.plot(0, -laws.sensitivity.sel(n=0)[-1], "s", color=COLOURS[1], markersize=3, clip_on=False)
    direct_label(axes, 1.45, -1.15, "$-1/n$")
    direct_label(axes, 0.9, -0.1, "$-n/(n+2)$", ha="left")
    axes.set(xlim=(0, 4.3), ylim=(-2.1, 0.05), xlabel="degree of friction, $n$ [1]", ylabel="exponent [1]")
    axes.legend(loc="lower right")


def draw_map(axes: Any, grid: xr.Dataset, line: xr.Dataset) -> None:
    """s over torque and Coulomb friction at fixed viscous friction, and the best torque."""
    part = grid.sel(R=slice(1e-2, 1e5), mu=slice(1e-2, 1e7))
    mu, R, s = part.mu.values, part.R.values, part.sensitivity.values
    axes.set(xscale="log", yscale="log", xlabel=r"torque, $\mu/(a^2\varphi_0)$ [1]", xlim=(mu[0], mu[-1]))
    axes.set_title(r"$s = -\mathrm{d}\ln P/\mathrm{d}\ln\mu$", loc="right")
    axes.set(ylabel=r"Coulomb friction, $R/(a^2\varphi_0)$ [1]", ylim=(R[0], R[-1]))
    shown = np.ma.masked_invalid(np.minimum(s, 1.0))
    axes.pcolormesh(mu, R, shown, cmap="viridis", vmin=0, vmax=1, alpha=0.75, rasterized=True)
    levels = (0.1, 0.2, 0.3, 1 / 3, 0.4, 0.5, 0.7, 1)
    lines = axes.contour(mu, R, s, levels=levels, colors="black", linewidths=0.6)
    places = [(3.0, 0.05), (1.1, 0.05), (0.5, 0.05), (0.1, 0.02), (1e6, 600), (1e6, 3500), (1e6, 1.5e4)]
    axes.clabel(lines, fmt=lambda x: f"{x:g}", fontsize=7, manual=places)
    hatch(axes, mu, R, (part.status == Status.NEVER_STARTS).values, "////")
    axes.plot(line.mu, line.R, color="white", linestyle=(0, (5, 1.5)))
    direct_label(axes, 0.6, 2e3, r"never starts, $\mu \leq R$")
    direct_label(axes, 2e4, 0.35, r"$s = 1/3$: $R = 0.8\,a^2\varphi_0$")
    how = {"fontsize": 8, "bbox": {"facecolor": "white", "edgecolor": "none", "pad": 1}, "ha": "center"}
    at = line.isel(cell=int(abs(np.log(line.R / 60)).argmin("cell")))
    axes.annotate("best torque", (float(at.mu), 60), (2e5, 8), arrowprops={"arrowstyle": "->", "linewidth": 0.6}, **how)


def read(laws: str, grid: str) -> tuple[xr.Dataset, xr.Dataset]:
    """Both sweeps. Raises SweepError where they are none of this study."""
    first = read_result(laws, "foliot", ["n", "mu"], "friction_laws.toml")
    return first, read_result(grid, "foliot", ["R", "mu"], "friction_laws_map.toml")


def conclude(laws_path: str, map_path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    laws, grid = read(laws_path, map_path)
    line = valley(grid)
    groups = {"Far out": ends(laws), "At every drive": exact(laws), "Viscous and Coulomb friction": best(grid, line)}
    return groups, [NOTES], lambda: figure(laws, grid, line)


main = partial(report, __file__, ["friction_laws.h5", "friction_laws_map.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
