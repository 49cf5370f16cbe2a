"""Where does the exponent -1/2 of impacts turn into the -1 and -1/3 of friction?

    sweep run studies/verge_losses.toml --allow-import
    sweep run studies/verge_losses_wheel.toml --allow-import
    python studies/verge_losses.py verge_losses.h5 verge_losses_wheel.h5

draws verge_losses.png and prints theory beside what comes out, P ~ torque^(-s). kappa = n^2 I_c/I_v is the wheel's
inertia over the foliot's, alpha = n tau/(I_v a^2 phi0) the drive over viscous friction, lambda the share of a loss in
the energy of half a period: viscous, dry, and impact. Theory, derived here: where the swing is large the speed at the
switch follows from the balance of energy, friction of degree n taking abs(v)^(n + 2)/torque and impacts v^2, so that

    s = (sum n lambda_n + lambda_impact)/(2 + sum n lambda_n),                                           (1)

n = 1 for viscous and 0 for dry friction: 1/3, 1/2 and 0 where one of them takes all. At weak drive s = 1/(1 + alpha).

Answer: with a light wheel the turn from 1/3 to 1/2 lies where the wheel would be thrown back by more than half a
pitch, out of mesh; there the equations go on and no clock does. In mesh a light wheel comes near 1/3 and never back to
1/2, and a wheel heavy enough to stay in mesh at any drive, from about a sixth of the foliot's inertia on, never comes
below .43: no clock of the grid shows both. A clock with a light wheel loses most to viscous and least to impacts.
"""

from __future__ import annotations

import math
import sys
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, differing, direct_label, hatch, page_of, read_result, report

import sweep
from sweep.show.charts import COLOURS, DASHES, MARKS

STRONG = 1e4
"""alpha from which (1) is held to 0.015, what is left of the drop and of a swing that is not endless."""
MESH = 0.5
"""Recoil of the wheel, in tooth pitches, beyond which the pallet is no longer between its two teeth."""
HALFWAY = {"-1 and -1/2": 0.75, "-1/3 and -1/2": 5 / 12}

NOTES = """\
s: differences of ln P over ln torque, 8 points a decade; deviation: of exponents and shares the difference
allowed: 1e-8 of the energy; 0.01 of an exponent at the ends of the grid, 0.015 of (1); 0.2 of the exponent -3; 0.02
where friction moves to the wheel and s < 1/2; near the torque that just drives the clock the drop decides
"""


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with kappa, alpha, `period`, `s`, the shares of the losses, and the recoil over the wheel's tooth pitch."""
    a = (ds.c_v + ds.n**2 * ds.c_c) / ds.I_v
    ds = ds.assign_coords(kappa=ds.n**2 * ds.I_c / ds.I_v, alpha=ds.n * ds.tau / (ds.I_v * a**2 * ds.phi0))
    way = 2 * ds.n * ds.phi0 + ds["drop"]
    work = ds.tau * way
    together = (ds.n * ds.I_c * ds.wheel - ds.I_v * ds.speed) / (ds.I_v + ds.n**2 * ds.I_c)
    kept = (ds.I_v + ds.n**2 * ds.I_c) * together**2
    knocked = 0.5 * (ds.I_v * ds.speed**2 + ds.I_c * ds.wheel**2 - kept)
    shares = {"viscous": ds.drag / work, "dry": ds.rubbing / work, "impact": knocked / work}
    period = 2 * ds.clock
    return ds.assign(period=period, s=slope(period), pitches=ds.recoil / (2 * way), **shares)


def slope(period: xr.DataArray) -> xr.DataArray:
    """-dlnP/dlntau by differences of second order; NaN beside a torque that does not drive it."""
    at_logs = np.log(period).assign_coords(tau=np.log(period.tau))
    rise = at_logs.differentiate("tau").assign_coords(tau=period.tau)
    return -rise.where(np.isfinite(period.shift(tau=1)) & np.isfinite(period.shift(tau=-1)))


def law(ds: xr.Dataset) -> xr.DataArray:
    """(1)."""
    return (ds.viscous + ds.impact) / (2 + ds.viscous)


def balance(ds: xr.Dataset) -> list[Statement]:
    """The energy of half a period, and the wheel's place in it."""
    off = float(abs(ds.viscous + ds.dry + ds.impact - 1).max())
    return [Statement("viscous, dry and impact losses are the work", "1", "largest deviation", off, off < 1e-8)]


def ends(ds: xr.Dataset) -> list[Statement]:
    """The exponents at the ends of the grid, without dry friction."""
    smooth = ds.isel(R_v=0)
    light, heavy = smooth.isel(I_c=0), smooth.sel(I_c=2.5e-3, method="nearest")
    weak = light.isel(tau=1)
    least = float(light.s.min())
    return [
        differing("kappa = .001, weakest drive", f"1/(1 + alpha) = {1 / (1 + float(weak.alpha)):.4f}",
                  float(weak.s), 1 / (1 + float(weak.alpha)), 0.01, 4),
        differing("kappa = .001: least s", "1/3", least, 1 / 3, 0.01, 4),
        differing("kappa = 1: strongest drive", "1/2", float(heavy.s.isel(tau=-2)), 0.5, 0.01, 4),
        *one_body(smooth),
    ]  # fmt: skip


def one_body(ds: xr.Dataset) -> list[Statement]:
    """The kernel `foliot` that keeps (1 - kappa)/(1 + kappa) of its speed, for wheels lighter than the foliot."""
    off = 0.0
    for k in np.flatnonzero(ds.kappa.values < 0.99):
        line = ds.isel(I_c=int(k))
        kappa = float(line.kappa)
        a = float(line.c_v / line.I_v) / (1 + kappa)
        fixed = {"a": a, "phi0": float(line.phi0), "e": (1 - kappa) / (1 + kappa)}
        mu = (line.n * line.tau / (line.I_v * (1 + line.kappa))).values
        one = sweep.run(sweep.study(kernel="foliot", axes={"mu": mu}, fixed=fixed, outputs=["period"]))
        off = max(off, float(abs(line.period.values / one.period.values - 1).max()))
    share = float(ds["drop"] / (2 * ds.n * ds.phi0))
    what = "one body that keeps (1 - kappa)/(1 + kappa): period"
    return [Statement(what, f"to the drop, {share:.1%}", "largest deviation", off, off < 1.2 * share)]


def passages(ds: xr.Dataset, value: float) -> xr.DataArray:
    """For each kappa the alpha at which s falls through 3/4, or rises to 1/2 through 5/12; NaN where it does not."""
    way = -1.0 if value > 0.5 else 1.0
    found = []
    for k in range(ds.sizes["I_c"]):
        s, x = ds.s.isel(I_c=k).values, np.log(ds.alpha.values)
        cross = np.flatnonzero((way * (s[:-1] - value) < 0) & (way * (s[1:] - value) >= 0))
        if not len(cross):
            found.append(math.nan)
            continue
        i = cross[-1]
        found.append(math.exp(x[i] + (value - s[i]) / (s[i + 1] - s[i]) * (x[i + 1] - x[i])))
    return xr.DataArray(found, {"kappa": ds.kappa.values}, ("kappa",))


def turns(ds: xr.Dataset) -> list[Statement]:
    """Where one exponent turns into the other, without dry friction."""
    smooth = ds.isel(R_v=0)
    upper, lower = (passages(smooth, value) for value in HALFWAY.values())
    deep = lower.where((lower.kappa > 0.008) & (lower.kappa < 0.05), drop=True)
    lost = 4 * deep.kappa / (1 + deep.kappa) ** 2  # 1 - e^2
    power = np.polyfit(np.log(lost.values), np.log(deep.values), 1)[0].item()
    text = ", ".join(f"{float(x):.2g} at kappa = {float(x.kappa):.3g}" for x in deep)
    near = smooth.viscous.sel(I_c=smooth.I_c[int(np.argmin(abs(smooth.kappa.values - 0.01)))])
    share = float(np.interp(math.log(float(deep[0])), np.log(smooth.alpha.values), near.values))
    there = upper.where(np.isfinite(upper), drop=True)
    ranged = f"{float(there[0]):.2f} to {float(there[-1]):.2f}, kappa = .001 to {float(there.kappa[-1]):.0f}"
    near_weak = bool(abs(float(there[0]) - 1 / 3) < 0.02 and float(there[-1]) < 1.0)
    return [
        Statement("s = 3/4, halfway from -1 to -1/2, at alpha", "1/3 without wheel", ranged, None, near_weak),
        Statement("s = 5/12, halfway from -1/3 to -1/2, at alpha", "-", text, None, deep.size >= 2),
        differing("  alpha ~ (1 - e^2)^x, e = (1 - kappa)/(1 + kappa)", "-3", power, -3, 0.2, 4),
        differing("  share of viscous losses there, kappa = .01", "2/5 by (1)", share, 0.4, 0.02, 4),
    ]  # fmt: skip


def in_mesh(ds: xr.Dataset) -> list[Statement]:
    """How far the exponent goes, without dry friction, where the recoil leaves the wheel in mesh, kappa by kappa."""
    smooth = ds.isel(R_v=0)
    s = smooth.s.where(smooth.pitches <= MESH)
    least, where = s.min("tau"), s.fillna(np.inf).argmin("tau")
    behind = s.where(s.tau >= s.tau.isel(tau=where)).max("tau")
    light = int(np.argmin(abs(smooth.kappa.values - 0.01)))
    stays = np.flatnonzero(np.isfinite(s.isel(tau=-2).values))
    first = int(stays[0]) if stays.size else -1
    back = float(behind.where(least < 0.38).max())
    turn = passages(smooth, HALFWAY["-1/3 and -1/2"]).values
    recoil = [
        float(np.interp(np.log(a), np.log(smooth.alpha), smooth.pitches.isel(I_c=k)))
        for k, a in enumerate(turn) if np.isfinite(a) and smooth.kappa[k] < 0.05
    ] or [0.0]  # fmt: skip
    at = [f"{float(x):.3f} at alpha = {float(a):.3g}" for x, a in zip(least, smooth.alpha.isel(tau=where), strict=True)]
    end, text = float(s[first, -2]), f"{min(recoil):.2g} to {max(recoil):.2g}"
    heavy = f"kappa = {float(smooth.kappa[first]):.2g}"
    dips = bool(least[first] > 0.43 and abs(end - 0.5) < 0.01)
    return [
        Statement("recoil where s rises through 5/12, kappa < .05 [pitches]", "", text, None, min(recoil) > MESH),
        Statement("  so in mesh s of kappa = .01 is at least", "> 1/3", at[light], None, bool(least[light] > 0.35)),
        Statement(
            f"{heavy} stays in mesh at any drive: least s, strongest", ", 1/2", f"{at[first]}, {end:.3f}", None, dips
        ),
        Statement(
            "in mesh, of clocks that have s < .38: s at a stronger drive",
            "< .38",
            f"at most {back:.3f}",
            None,
            back < 0.38,
        ),
    ]


def answer(ds: xr.Dataset) -> list[Statement]:
    """What part of such a clock's losses is which, and the exponent it has."""
    clock = clock_like(ds)
    shares = {name: float(clock[name]) for name in ("viscous", "dry", "impact")}
    text = ", ".join(f"{name} {share:.0%}" for name, share in shares.items())
    what = f"kappa = .01, alpha = {float(clock.alpha):.3g}, recoil of {float(clock.pitches):.2g} pitch"
    viscous = shares["viscous"] > shares["dry"] > shares["impact"]
    return [
        Statement(f"{what}: losses", "viscous most, impact least", text, None, viscous),
        Statement("  its exponent, between those of friction alone", "1/3 to 1", f"{float(clock.s):.3f}", None,
                  bool(1 / 3 < clock.s < 0.5)),
    ]  # fmt: skip


def by_shares(ds: xr.Dataset) -> list[Statement]:
    """Theory (1) at strong drive, and how far it is off at weaker."""
    off = abs(ds.s - law(ds))
    strong, all_ = off.where(ds.alpha > STRONG), off.isel(R_v=0).where(ds.alpha > 100)
    return [
        Statement(f"s by the shares, (1), alpha > {STRONG:.0e}", "0.015", f"{int(strong.notnull().sum())} cells",
                  float(strong.max()), bool(strong.max() < 0.015)),
        Statement("  the same, alpha > 100 without dry friction", "0.05", f"{int(all_.notnull().sum())} cells",
                  float(all_.max()), bool(all_.max() < 0.05)),
    ]  # fmt: skip


def on_the_wheel(ds: xr.Dataset, wheel: xr.Dataset) -> list[Statement]:
    """The same friction on the wheel instead."""
    lines = []
    for R_c, R_v in ((0.0, 0.0), (float(wheel.R_c[-1]), float(wheel.R_c[-1] * wheel.n))):
        moved = wheel.s.sel(R_c=R_c)
        stayed = ds.s.sel(R_v=R_v, method="nearest").sel(I_c=wheel.I_c, method="nearest")
        both = (moved.values < 0.5) & (stayed.values < 0.5)
        off = float(abs(moved.values - stayed.values)[both].max())
        what = f"friction on the wheel, {'viscous' if not R_c else 'and dry'}: exponents"
        lines.append(Statement(what, "as on the foliot", f"largest difference of {both.sum()} cells", off, off < 0.02))
    return lines


def clock_like(ds: xr.Dataset) -> xr.Dataset:
    """A clock with a light wheel (kappa = .01), dry friction of I_v a^2 phi0 and recoil of a quarter of a pitch."""
    line = ds.isel(R_v=1).sel(I_c=2.5e-5, method="nearest")
    return line.isel(tau=int(abs(line.pitches - 0.25).argmin("tau")))


def figure(ds: xr.Dataset) -> Any:
    """Maps of the exponent, shares of the losses, and (1); for two columns of print."""
    with page_of(130.0, 2, 2) as (page, ((plane, rubbed), (shares, scatter))):
        draw_plane(page, plane, ds.isel(R_v=0))
        draw_dry(rubbed, ds.sel(I_c=2.5e-5, method="nearest"))
        draw_shares(shares, ds.isel(R_v=1).sel(I_c=2.5e-5, method="nearest"))
        draw_law(scatter, ds)
    return page


def draw_plane(page: Any, axes: Any, ds: xr.Dataset) -> None:
    """s over alpha and kappa; hatched where the wheel would be thrown back by more than half a pitch."""
    axes.set(xscale="log", yscale="log")
    alpha, kappa, s = ds.alpha.values, ds.kappa.values, ds.s.values
    mesh = axes.pcolormesh(alpha, kappa, s, vmin=1 / 3, vmax=1, cmap="cividis", shading="gouraud", rasterized=True)
    page.colorbar(mesh, ax=axes, label="exponent, $s$ [1]", pad=0.02, ticks=[1 / 3, 0.5, 0.75, 1]).ax.set_yticklabels(
        ["1/3", "1/2", "3/4", "1"]
    )
    lines = axes.contour(alpha, kappa, s, levels=[0.36, 5 / 12, 0.75], colors="white", linewidths=0.8)
    axes.clabel(lines, fmt={0.36: "0.36", 5 / 12: "5/12", 0.75: "3/4"}, fontsize=7, inline_spacing=2)
    hatch(axes, alpha, kappa, (ds.pitches > MESH).values, "////", "0.85")
    axes.set(xlim=(alpha[1], alpha[-2]), ylim=(kappa[0], kappa[-1]))
    axes.set(xlabel=r"drive, $\alpha$ [1]", ylabel=r"wheel over foliot, $\kappa$ [1]")
    direct_label(axes, 2e4, 3e-3, "recoil over 1/2 pitch", fontsize=7)


def draw_dry(axes: Any, ds: xr.Dataset) -> None:
    """s over alpha by dry friction."""
    unit = float(ds.I_v * (ds.c_v / ds.I_v) ** 2 * ds.phi0)
    for k in range(ds.sizes["R_v"]):
        line = ds.isel(R_v=k)
        name = f"{float(line.R_v) / unit:.3g}"
        axes.semilogx(ds.alpha, line.s, color=COLOURS[k], linestyle=DASHES[k], label=name)
    for value, text in ((1 / 3, "1/3"), (0.5, "1/2")):
        axes.axhline(value, color="0.7", linewidth=0.6)
        axes.text(1.2e6, value, text, fontsize=7, va="center")
    axes.set(xlabel=r"drive, $\alpha$ [1]", ylabel="exponent, $s$ [1]", ylim=(0.1, 1.0), xlim=(0.1, 1e6))
    axes.legend(title=r"dry friction, $R/(I_\mathrm{v}a^2\varphi_0)$", title_fontsize=7, loc="upper right")


def draw_shares(axes: Any, ds: xr.Dataset) -> None:
    """Shares of the losses over alpha, stacked."""
    there = np.isfinite(ds.viscous.values)
    parts = [ds[name].values[there] for name in ("viscous", "dry", "impact")]
    axes.stackplot(ds.alpha.values[there], parts, colors=COLOURS[:3], labels=["viscous", "dry", "impact"], alpha=0.85)
    axes.set(xscale="log", xlabel=r"drive, $\alpha$ [1]", ylabel="share of the energy [1]", ylim=(0, 1))
    axes.set(xlim=(ds.alpha.values[there][0], ds.alpha.values[-1]))
    axes.legend(loc="lower left", framealpha=0.9, frameon=True)


def draw_law(axes: Any, ds: xr.Dataset) -> None:
    """s against (1), by drive."""
    for k, (low, high) in enumerate(((1e-1, 1e2), (1e2, 1e4), (1e4, 1e7))):
        part = (ds.alpha > low) & (ds.alpha <= high)
        x, y = (v.where(part & ds.s.notnull()).values.ravel() for v in (law(ds), ds.s))
        name = rf"$10^{{{round(math.log10(low))}}}$ to $10^{{{min(round(math.log10(high)), 6)}}}$"
        axes.plot(
            x,
            y,
            MARKS[k],
            color=("0.75", COLOURS[1], COLOURS[0])[k],
            markersize=2.2,
            linestyle="",
            label=name,
            rasterized=True,
        )
    axes.plot([0, 0.6], [0, 0.6], color="black", linewidth=0.8, label="law of the shares")
    axes.set(xlabel=r"$(\sum n\lambda_n+\lambda_\mathrm{impact})/(2+\sum n\lambda_n)$ [1]", ylabel="exponent, $s$ [1]")
    axes.set(xlim=(0.05, 0.52), ylim=(0.05, 1.4))
    axes.legend(title=r"$\alpha$", loc="upper right", markerscale=2, fontsize=7)


def conclude(path: str, wheel_path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = prepared(read_result(path, "verge_scene:KERNEL", ["R_v", "I_c", "tau"], "verge_losses.toml"))
    wheel = prepared(read_result(wheel_path, "verge_scene:KERNEL", ["R_c", "I_c", "tau"], "verge_losses_wheel.toml"))
    groups = {
        "Energy": balance(ds),
        "Ends": ends(ds),
        "Where exponents turn": turns(ds),
        f"In mesh: recoil of at most {MESH:g} pitch": in_mesh(ds),
        "A clock with a light wheel": answer(ds),
        "By the shares of the losses": by_shares(ds),
        "Friction on the wheel": on_the_wheel(ds, wheel),
    }
    return groups, [NOTES], lambda: figure(ds)


main = partial(report, __file__, ["verge_losses.h5", "verge_losses_wheel.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
