"""How many half swings does a balance make before friction holds it, and does friction change its period?

    sweep run studies/balance_ringdown.toml
    python studies/balance_ringdown.py balance_ringdown.h5

draws balance_ringdown.png and prints theory beside what comes out. For light damping theory is one function: with
x = pi zeta theta0/(2 r), what viscous friction takes from the first half swing over what solid friction takes,
N = ln(1 + x)/(pi zeta).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, differing, direct_label, hatch, read_result, report

from kernels.interface import Status
from sweep.analysis.exponents import fit_exponent

LIGHT = 0.01
"""Damping up to which delta = pi zeta to 5e-5."""

NOTES = """\
theory: the balance rests at the first turning point within r of the spring's zero; x = pi zeta theta0/(2 r)
deviation: relative; of counts and exponents the difference. Counts are whole, so they hold to one half swing, and to
the next term of theory, 0.5 zeta^2 and r/theta0 of themselves"""


def scaled(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with its groups: `x`, count `N`, `slow` = period over 2 pi/omega_n, minus 1, and where it swings."""
    ds = ds.assign(x=math.pi * ds.zeta * abs(ds.theta0) / (2 * ds.r), N=ds.half_swings)
    ds = ds.assign(slow=ds.period * ds.omega_n / (2 * math.pi) - 1, swings=ds.status != Status.OVERDAMPED)
    return ds.assign(law=np.log1p(ds.x) / (math.pi * ds.zeta))


def counts(ds: xr.Dataset) -> list[Statement]:
    """How many half swings, in the two limits and between."""
    light = ds.where((ds.zeta <= LIGHT) & (ds.N > 0))
    allowed = 1 + light.law * (0.5 * light.zeta**2 + light.r / abs(ds.theta0))
    worst = float((abs(light.N - light.law) / allowed).max())
    off = float(abs(light.N - light.law).max())
    solid, viscous = ds.isel(zeta=0), ds.isel(r=0)
    few = fit_exponent(solid.N.where(solid.x < 0.1, drop=True), "r")
    many = viscous.where((viscous.zeta < 0.1) & (viscous.x > 100), drop=True)
    steep = fit_exponent(many.N, "zeta")
    slope = float((1 / np.log1p(many.x) - 1).mean())  # dln(ln(1 + x)/zeta)/dlnzeta for x >> 1
    return [
        Statement(
            f"N = ln(1 + x)/(pi zeta), zeta <= {LIGHT:g}", "all cells", f"off by {off:.2f} at most", None, worst < 1
        ),
        differing("exponent of N in r, x < 0.1", "-1", float(few.exponent), -1.0, 0.1, 5),
        differing("exponent of N in zeta, x > 100", f"{slope:.3f}", float(steep.exponent), slope, 0.05, 5),
    ]


def rest(ds: xr.Dataset) -> list[Statement]:
    """Where and when it rests."""
    far = float((abs(ds.stop_angle) / ds.r).max())
    creeping = ds.where(~ds.swings, drop=True)
    creeps = bool((creeping.stop_angle == np.sign(creeping.theta0) * creeping.r).all())
    late = float(abs(ds.stop_time / (ds.N * ds.period / 2) - 1).where(ds.N > 0).max())
    near = int((ds.status == Status.GRAZING).sum())
    return [
        Statement("it rests within r of the spring's zero", "yes", f"largest abs(theta)/r {far:.6f}", None, far <= 1),
        Statement(
            "zeta >= 1: creeps to r, never to 0", "yes", f"{creeping.r.size * creeping.zeta.size} cells", None, creeps
        ),
        Statement("time to rest = N periods/2", "yes", "largest deviation", late, late < 1e-14),
        Statement("counts that the last digits decide", "", f"{near} of {ds.status.size} cells"),
    ]


def isochronism(ds: xr.Dataset) -> list[Statement]:
    """What friction does to the period."""
    swinging = ds.period.where(ds.swings, drop=True)
    spread = float((swinging.max("r") / swinging.min("r") - 1).max())
    zeta = swinging.zeta
    exact = 2 * math.pi / ds.omega_n / np.sqrt((1 - zeta) * (1 + zeta))
    off = float(abs(swinging / exact - 1).max())
    first = ds.isel(zeta=0, r=0)
    slowest = f"{86400 * float(ds.slow.sel(zeta=LIGHT, method='nearest')[0]):.2g} s/day at zeta = {LIGHT:g}"
    return [
        Statement("period at any solid friction", "the same", "largest spread", spread, spread == 0),
        Statement("period = 2 pi/(omega_n sqrt(1 - zeta^2))", "yes", "largest deviation", off, off < 1e-13),
        compared(
            f"period omega_n/(2 pi) - 1 at zeta = {float(first.zeta):g}", "zeta^2/2", float(first.slow),
            float(first.zeta) ** 2 / 2, 1e-6, 4,
        ),
        Statement("viscous damping loses", "", slowest),
    ]  # fmt: skip


def statements(ds: xr.Dataset) -> Groups:
    """Every line of the table, by heading."""
    return {"Half swings": counts(ds), "Rest": rest(ds), "Isochronism": isochronism(ds)}


def figure(ds: xr.Dataset) -> Any:
    """The count over both frictions, its collapse on one law, and the period; for two columns of print."""
    from sweep.show import charts

    with charts.style():
        page = charts.new_figure(charts.PAGE, 84.0)
        left, right = page.subfigures(1, 2, width_ratios=(1.12, 1))
        whole = left.subplots()
        upper, lower = right.subplots(2, 1)
        draw_map(left, whole, ds)
        draw_law(upper, ds)
        draw_period(lower, ds)
        for axes, text in ((whole, "a"), (upper, "b"), (lower, "c")):
            charts.letter(axes, text)
    return page


def draw_map(page: Any, axes: Any, ds: xr.Dataset) -> None:
    """N over zeta and r/theta0; below the broken line viscous friction takes more from the first swing."""
    from matplotlib.colors import LogNorm

    n = ds.N.where(ds.swings & (ds.N > 0)).transpose("r", "zeta")
    zeta, r = ds.zeta.values, ds.r.values / abs(float(ds.theta0))
    mesh = axes.pcolormesh(zeta, r, n, norm=LogNorm(1, 1e4), cmap="cividis", shading="nearest", rasterized=True)
    page.colorbar(mesh, ax=axes, label=r"half swings until rest, $N$", pad=0.02)
    axes.contour(zeta, r, n, levels=[10, 100, 1000], colors="white", linewidths=0.7)
    for count, place in ((10, 0.051), (100, 5.4e-3), (1000, 4.8e-4)):
        axes.text(1.2e-4, place, f"{count}", color="white", fontsize=8, va="bottom")
    hatch(axes, zeta, r, (~ds.swings).transpose("r", "zeta").values, "////")
    axes.plot(zeta, math.pi * zeta / 2, color="white", linestyle=(0, (4, 2)), linewidth=0.9)
    axes.text(3e-2, 6e-2, r"$x=1$", color="white", fontsize=8, ha="right")
    direct_label(axes, 1.41, 9e-3, "creeps", fontsize=7.5, rotation=90)
    axes.set(xscale="log", yscale="log", xlim=(zeta[0], zeta[-1]), ylim=(r[0], r[-1]))
    axes.set(xlabel=r"viscous damping, $\zeta$", ylabel=r"solid friction, $r/\theta_0$")


def draw_law(axes: Any, ds: xr.Dataset) -> None:
    """pi zeta N against x: one curve for all light damping."""
    from sweep.show.charts import COLOURS, MARKS

    x = np.geomspace(1e-4, 1e4, 200)
    axes.loglog(x, np.log1p(x), color="black", label=r"$\ln(1+x)$")
    for k, zeta in enumerate((1e-4, 1e-3, 1e-2, 0.3)):
        row = ds.sel(zeta=zeta, method="nearest")
        row = row.where(row.N > 0, drop=True).isel(r=slice(None, None, 8))
        style = {"markerfacecolor": "white", "markersize": 3.4, "linestyle": "", "markeredgewidth": 0.8}
        axes.plot(
            row.x, math.pi * row.zeta * row.N, MARKS[k], color=COLOURS[k], label=rf"$\zeta={_power(zeta)}$", **style
        )
    axes.set(xlabel=r"viscous over solid friction, $x=\pi\zeta\theta_0/(2r)$", ylabel=r"$\pi\zeta N$", xlim=(1e-4, 1e4))
    axes.legend(loc="lower right", ncols=1, borderaxespad=0.3, labelspacing=0.25)


def _power(x: float) -> str:
    """A number below 0.1 as its power of ten."""
    return f"{x:g}" if x > 0.1 else f"10^{{{round(math.log10(x))}}}"


def draw_period(axes: Any, ds: xr.Dataset) -> None:
    """How much viscous damping slows the balance, at three solid frictions: the marks lie on each other."""
    from sweep.show.charts import COLOURS, MARKS

    zeta = np.geomspace(1e-4, 0.9999, 300)
    axes.loglog(zeta, 1 / np.sqrt(1 - zeta**2) - 1, color="black", label=r"$(1-\zeta^2)^{-1/2}-1$")
    for k, (r, size) in enumerate(((1e-4, 6.5), (1e-2, 4.2), (0.5, 2.0))):
        row = ds.sel(r=r * abs(float(ds.theta0)), method="nearest").isel(zeta=slice(None, None, 10))
        look = {"markerfacecolor": "none", "markersize": size, "linestyle": "", "markeredgewidth": 0.8}
        axes.plot(row.zeta, row.slow, MARKS[0], color=COLOURS[k], label=rf"$r/\theta_0={_power(r)}$", **look)
    axes.set(xlabel=r"viscous damping, $\zeta$", ylabel=r"$\omega_nP/2\pi-1$", xlim=(8e-5, 1.4))
    axes.legend(loc="upper left", borderaxespad=0.3, labelspacing=0.25)


def read(path: str) -> xr.Dataset:
    """The sweep with its groups. Raises SweepError where it is none of this study."""
    return scaled(read_result(path, "balance", ["zeta", "r"], "balance_ringdown.toml"))


def conclude(path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = read(path)
    return statements(ds), [NOTES], figure(ds)


def main(arguments: Sequence[str]) -> int:
    """Table and figure of the result that is named; 1 if a statement does not hold."""
    return report(__file__, ["balance_ringdown.h5"], arguments, conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
