"""Where does the exponent -1/2 of impacts turn into the -1 and -1/3 of friction?

    sweep run studies/verge_losses.toml --allow-import
    sweep run studies/verge_losses_wheel.toml --allow-import
    python studies/verge_losses.py verge_losses.h5 verge_losses_wheel.h5

draws verge_losses.png and compares theory with what comes out, P ~ torque^(-s). kappa = n^2 I_c/I_v is the wheel's
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
from typing import Any

import numpy as np
import xarray as xr
from _common import (
    Conclusion,
    Statement,
    count,
    differing,
    last_passage,
    most,
    power,
    read_result,
    said,
    script,
    solved,
)
from _figures import colour_map, direct_label, hatch, page_of

from sweep.show.charts import COLOURS, DASHES, MARKS

STRONG = 1e4
"""alpha from which (1) is held to 0.015, what is left of the drop and of a swing that is not endless."""
MESH = 0.5
"""Recoil of the wheel, in tooth pitches, beyond which the pallet is no longer between its two teeth."""
AT_BORDER = 0.3615
"""The least s in mesh of kappa = .01, at the border, alpha = 26.6, by the kernel `verge` at 1500 torques."""
LOSSES = ("viscous", "dry", "impact")

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
    period = 2 * ds.clock
    rise = np.log(period).assign_coords(tau=np.log(ds.tau)).differentiate("tau").assign_coords(tau=ds.tau)
    driven = np.isfinite(period.shift(tau=1)) & np.isfinite(period.shift(tau=-1))
    ds = ds.assign(period=period, s=-rise.where(driven), pitches=ds.recoil / (2 * way))
    return ds.assign(viscous=ds.drag / work, dry=ds.rubbing / work, impact=knocked / work)


def law(ds: xr.Dataset) -> xr.DataArray:
    """(1)."""
    return (ds.viscous + ds.impact) / (2 + ds.viscous)


def ends(smooth: xr.Dataset) -> list[Statement]:
    """The exponents at the ends of the grid, without dry friction, and one body beside the two.

    That is the kernel `foliot` that keeps (1 - kappa)/(1 + kappa) of its speed, for wheels lighter than the foliot.
    """
    light, heavy = smooth.isel(I_c=0), smooth.sel(I_c=2.5e-3, method="nearest")
    first, weak = light.s.isel(tau=1), 1 / (1 + float(light.alpha[1]))
    off = []
    for k in np.flatnonzero(smooth.kappa.values < 0.99):
        line = smooth.isel(I_c=int(k))
        share, mu = float(line.kappa), line.n * line.tau / (line.I_v * (1 + line.kappa))
        foliot = {"a": line.c_v / line.I_v / (1 + share), "phi0": line.phi0, "e": (1 - share) / (1 + share)}
        off.append(line.period.values / solved("foliot", mu=mu, **foliot, outputs=["period"]).period.values - 1)
    drop = float(smooth["drop"] / (2 * smooth.n * smooth.phi0))
    one = "one body that keeps (1 - kappa)/(1 + kappa): period"
    return [
        differing("kappa = .001, weakest drive", f"1/(1 + alpha) = {weak:.4f}", first, weak, 0.01, 4),
        differing("kappa = .001: least s", "1/3", light.s.min(), 1 / 3, 0.01, 4),
        differing("kappa = 1: strongest drive", "1/2", heavy.s.isel(tau=-2), 0.5, 0.01, 4),
        most(one, f"to the drop, {drop:.1%}", xr.DataArray(off), 1.2 * drop),
    ]


def passage(smooth: xr.Dataset, value: float) -> xr.DataArray:
    """For each kappa the alpha at which s falls through a value, or rises through one below 1/2 on its way to that."""
    way = -1.0 if value > 0.5 else 1.0
    found = [last_passage(smooth.alpha, line, value, way) for line in smooth.s.transpose("I_c", "tau").values]
    return xr.DataArray(found, {"kappa": smooth.kappa.values}, ("kappa",))


def turns(smooth: xr.Dataset, upper: xr.DataArray, lower: xr.DataArray) -> list[Statement]:
    """Where one exponent turns into the other, without dry friction: at s = 3/4 and, farther on, at 5/12."""
    deep = lower.where((lower.kappa > 0.008) & (lower.kappa < 0.05), drop=True)
    lost = 4 * deep.kappa / (1 + deep.kappa) ** 2  # 1 - e^2
    by_loss = power(deep.assign_coords(kappa=lost.values))
    text = ", ".join(f"{float(x):.2g} at kappa = {float(x.kappa):.3g}" for x in deep)
    near = smooth.viscous.isel(I_c=int(abs(smooth.kappa - 0.01).argmin("I_c")))
    share = float(np.interp(math.log(float(deep[0])), np.log(smooth.alpha.values), near.values))
    there = upper.dropna("kappa")
    ranged = f"{float(there[0]):.2f} to {float(there[-1]):.2f}, kappa = .001 to {float(there.kappa[-1]):.0f}"
    weak = abs(there[0] - 1 / 3) < 0.02 and there[-1] < 1.0
    return [
        said("s = 3/4, halfway from -1 to -1/2, at alpha", weak, ranged, "1/3 without wheel"),
        said("s = 5/12, halfway from -1/3 to -1/2, at alpha", deep.size >= 2, text, "-"),
        differing("  alpha ~ (1 - e^2)^x, e = (1 - kappa)/(1 + kappa)", "-3", by_loss, -3, 0.2, 4),
        differing("  share of viscous losses there, kappa = .01", "2/5 by (1)", share, 0.4, 0.02, 4),
    ]


def in_mesh(smooth: xr.Dataset, turn: xr.DataArray) -> list[Statement]:
    """How far the exponent goes, without dry friction, where the recoil leaves the wheel in mesh, kappa by kappa."""
    s = smooth.s.where(smooth.pitches <= MESH)
    least, where = s.min("tau"), s.fillna(np.inf).argmin("tau")
    back = float(s.where(s.tau >= s.tau.isel(tau=where)).max("tau").where(least < 0.38).max())
    light, stays = int(abs(smooth.kappa - 0.01).argmin("I_c")), np.flatnonzero(np.isfinite(s.isel(tau=-2)))
    first = int(stays[0]) if stays.size else -1
    logs = np.log(smooth.alpha.values)
    recoil = [
        float(np.interp(math.log(alpha), logs, smooth.pitches.isel(I_c=k)))
        for k, alpha in enumerate(turn.values)
        if alpha > 0 and smooth.kappa[k] < 0.05
    ] or [0.0]
    at = [f"{float(x):.3f} at alpha = {float(a):.3g}" for x, a in zip(least, smooth.alpha.isel(tau=where), strict=True)]
    line = smooth.isel(I_c=light, tau=slice(1, int(smooth.pitches.isel(I_c=light).argmax("tau"))))
    border = float(np.interp(MESH, line.pitches.values, line.s.values))
    end, text = float(s[first, -2]), f"{min(recoil):.2g} to {max(recoil):.2g}"
    heavy = f"kappa = {float(smooth.kappa[first]):.2g} stays in mesh at any drive: least s, strongest"
    dips = least[first] > 0.43 and abs(end - 0.5) < 0.01
    again = "in mesh, of clocks that have s < .38: s at a stronger drive"
    return [
        said("recoil where s rises through 5/12, kappa < .05 [pitches]", min(recoil) > MESH, text),
        said("  so in mesh s of kappa = .01 is at least", least[light] > 0.35, at[light], "> 1/3"),
        differing("  at half a pitch itself, between cells", f"{AT_BORDER} by `verge`", border, AT_BORDER, 0.005, 4),
        said(heavy, dips, f"{at[first]}, {end:.3f}", ", 1/2"),
        said(again, back < 0.38, f"at most {back:.3f}", "< .38"),
    ]


def answer(ds: xr.Dataset) -> list[Statement]:
    """What part of a clock's losses is which, and its exponent.

    Its wheel is light (kappa = .01), its dry friction I_v a^2 phi0, its recoil a quarter of a pitch.
    """
    line = ds.isel(R_v=1).sel(I_c=2.5e-5, method="nearest")
    clock = line.isel(tau=int(abs(line.pitches - 0.25).argmin("tau")))
    text = ", ".join(f"{name} {clock[name]:.0%}" for name in LOSSES)
    what = f"kappa = .01, alpha = {clock.alpha:.3g}, recoil of {clock.pitches:.2g} pitch"
    viscous = clock.viscous > clock.dry > clock.impact
    between = "  its exponent, between those of friction alone"
    return [
        said(f"{what}: losses", viscous, text, "viscous most, impact least"),
        said(between, 1 / 3 < clock.s < 0.5, f"{clock.s:.3f}", "1/3 to 1"),
    ]


def by_shares(ds: xr.Dataset) -> list[Statement]:
    """Theory (1) at strong drive, and how far it is off at weaker."""
    off = ds.s - law(ds)
    strong, smooth = off.where(ds.alpha > STRONG), off.isel(R_v=0).where(ds.alpha > 100)
    return [
        most(f"s by the shares, (1), alpha > {STRONG:.0e}", "0.015", strong, 0.015, count(strong)),
        most("  the same, alpha > 100 without dry friction", "0.05", smooth, 0.05, count(smooth)),
    ]


def on_the_wheel(ds: xr.Dataset, wheel: xr.Dataset) -> list[Statement]:
    """The same friction on the wheel instead."""
    lines = []
    for R_c, name in ((0.0, "viscous"), (float(wheel.R_c[-1]), "and dry")):
        moved = wheel.s.sel(R_c=R_c).values
        stayed = ds.s.sel(R_v=R_c * float(wheel.n), I_c=wheel.I_c, method="nearest").values
        both = (moved < 0.5) & (stayed < 0.5)
        here = f"largest difference of {both.sum()} cells"
        lines.append(
            most(f"friction on the wheel, {name}: exponents", "as on the foliot", (moved - stayed)[both], 0.02, here)
        )
    return lines


def figure(ds: xr.Dataset) -> Any:
    """Maps of the exponent, shares of the losses, and (1); for two columns of print."""
    alpha, kappa, light = ds.alpha.values, ds.kappa.values, ds.sel(I_c=2.5e-5, method="nearest")
    with page_of(130.0, 2, 2) as (page, ((plane, rubbed), (shares, scatter))):
        draw_plane(plane, alpha, kappa, ds.isel(R_v=0))
        unit = float(ds.I_v * (ds.c_v / ds.I_v) ** 2 * ds.phi0)
        for k, R in enumerate(ds.R_v.values):
            rubbed.semilogx(alpha, light.s[k], color=COLOURS[k], linestyle=DASHES[k], label=f"{R / unit:.3g}")
        for value, text in ((1 / 3, "1/3"), (0.5, "1/2")):
            rubbed.axhline(value, color="0.7", linewidth=0.6)
            rubbed.text(1.2e6, value, text, fontsize=7, va="center")
        rubbed.set(xlabel=r"drive, $\alpha$ [1]", ylabel="exponent, $s$ [1]", ylim=(0.1, 1.0), xlim=(0.1, 1e6))
        rubbed.legend(title=r"dry friction, $R/(I_\mathrm{v}a^2\varphi_0)$", title_fontsize=7, loc="upper right")
        clock = light.isel(R_v=1)
        clock = clock.isel(tau=np.isfinite(clock.viscous.values))
        parts = [clock[name].values for name in LOSSES]
        shares.stackplot(clock.alpha.values, parts, colors=COLOURS[:3], labels=LOSSES, alpha=0.85)
        shares.set(xscale="log", xlabel=r"drive, $\alpha$ [1]", ylabel="share of the energy [1]", ylim=(0, 1))
        shares.set(xlim=(clock.alpha[0], alpha[-1]))
        shares.legend(loc="lower left", framealpha=0.9, frameon=True)
        for k, (low, high) in enumerate(((1e-1, 1e2), (1e2, 1e4), (1e4, 1e7))):
            part = ds.where((ds.alpha > low) & (ds.alpha <= high))
            look = {"color": ("0.75", COLOURS[1], COLOURS[0])[k], "markersize": 2.2, "rasterized": True}
            name = rf"$10^{{{round(math.log10(low))}}}$ to $10^{{{min(round(math.log10(high)), 6)}}}$"
            scatter.plot(law(part).values.ravel(), part.s.values.ravel(), MARKS[k], label=name, **look)
        scatter.plot([0, 0.6], [0, 0.6], color="black", linewidth=0.8, label="law of the shares")
        label = r"$(\sum n\lambda_n+\lambda_\mathrm{impact})/(2+\sum n\lambda_n)$ [1]"
        scatter.set(xlabel=label, ylabel="exponent, $s$ [1]", xlim=(0.05, 0.52), ylim=(0.05, 1.4))
        scatter.legend(title=r"$\alpha$", loc="upper right", markerscale=2, fontsize=7)
    return page


def draw_plane(axes: Any, alpha: Any, kappa: Any, ds: xr.Dataset) -> None:
    """s over alpha and kappa; hatched where the wheel would be thrown back by more than half a pitch."""
    axes.set(xscale="log", yscale="log", xlabel=r"drive, $\alpha$ [1]", ylabel=r"wheel over foliot, $\kappa$ [1]")
    ticks = {"ticks": [1 / 3, 0.5, 0.75, 1]}
    bar = colour_map(axes, alpha, kappa, ds.s.values, "exponent, $s$ [1]", ticks, vmin=1 / 3, vmax=1, shading="gouraud")
    bar.ax.set_yticklabels(["1/3", "1/2", "3/4", "1"])
    lines = axes.contour(alpha, kappa, ds.s, levels=[0.36, 5 / 12, 0.75], colors="white", linewidths=0.8)
    axes.clabel(lines, fmt={0.36: "0.36", 5 / 12: "5/12", 0.75: "3/4"}, fontsize=7, inline_spacing=2)
    hatch(axes, alpha, kappa, (ds.pitches > MESH).values, "////", "0.85")
    axes.set(xlim=(alpha[1], alpha[-2]))
    direct_label(axes, 2e4, 3e-3, "recoil over 1/2 pitch", fontsize=7)


def conclude(path: str, wheel_path: str) -> Conclusion:
    """Statements and the figure."""
    ds = prepared(read_result(path, "verge_scene:KERNEL", ["R_v", "I_c", "tau"], "verge_losses.toml"))
    wheel = prepared(read_result(wheel_path, "verge_scene:KERNEL", ["R_c", "I_c", "tau"], "verge_losses_wheel.toml"))
    smooth, whole = ds.isel(R_v=0), ds.viscous + ds.dry + ds.impact
    upper, lower = (passage(smooth, value) for value in (3 / 4, 5 / 12))
    groups = {
        "Energy": [most("viscous, dry and impact losses are the work", "1", whole - 1, 1e-8)],
        "Ends": ends(smooth),
        "Where exponents turn": turns(smooth, upper, lower),
        f"In mesh: recoil of at most {MESH:g} pitch": in_mesh(smooth, lower),
        "A clock with a light wheel": answer(ds),
        "By the shares of the losses": by_shares(ds),
        "Friction on the wheel": on_the_wheel(ds, wheel),
    }
    return groups, [NOTES], lambda: figure(ds)


main = script(__name__, "verge_losses.h5 verge_losses_wheel.h5", conclude)
