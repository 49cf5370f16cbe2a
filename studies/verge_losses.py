"""Where does the exponent -1/2 of impacts turn into the -1 and -1/3 of friction?

    python studies/verge_losses.py verge_losses.h5 verge_losses_wheel.h5

P ~ torque^(-s). kappa = n^2 I_c/I_v is the wheel's inertia over the foliot's, alpha = n tau/(I_v a^2 phi0) the drive
over viscous friction. At large swings (docs/theory/general_law.md), with the shares of viscous friction and impacts,

    s = (lambda_viscous + lambda_impact)/(2 + lambda_viscous).                                           (1)

At weak drive s = 1/(1 + alpha). The exponent s is a difference of ln P over ln torque, with 8 points a decade.
"""

import math

import numpy as np
import xarray as xr
from _common import Claims, count, differing, held, last_passage, most, nearest, power, said, script
from _figures import ALPHA, COLOURS, KAPPA, Axis, contours, exponent_map, page, panel
from _losses import verge

MESH = 0.5
"""Recoil of the wheel, in tooth pitches, beyond which the pallet is no longer between its two teeth."""
LOSSES = ("viscous", "dry", "impact")


def scaled(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with its groups, and the shares of the losses."""
    period, work = 2 * ds.clock, ds.tau * (2 * ds.n * ds.phi0 + ds["drop"])
    together = (ds.n * ds.I_c * ds.wheel - ds.I_v * ds.speed) / (ds.I_v + ds.n**2 * ds.I_c)
    knocked = 0.5 * (ds.I_v * ds.speed**2 + ds.I_c * ds.wheel**2 - (ds.I_v + ds.n**2 * ds.I_c) * together**2)
    ds = verge(ds, period, np.isfinite(period))
    return ds.assign(viscous=ds.drag / work, dry=ds.rubbing / work, impact=knocked / work)


def passage(smooth: xr.Dataset, value: float) -> xr.DataArray:
    """For each kappa the alpha at which s falls through a value, or rises through one below 1/2 on its way to that."""
    way = -1.0 if value > 0.5 else 1.0
    found = [last_passage(smooth.alpha, line, value, way) for line in smooth.s.transpose("I_c", "tau").values]
    return xr.DataArray(found, {"kappa": smooth.kappa.values}, ("kappa",))


def claims(ds, wheel) -> Claims:
    yield "Energy"
    whole = ds.viscous + ds.dry + ds.impact
    yield most("viscous, dry and impact losses are the work", "1", whole - 1, 1e-8)

    yield "Ends"
    smooth = ds.isel(R_v=0)
    light, heavy = smooth.isel(I_c=0), smooth.sel(I_c=2.5e-3, method="nearest")
    first, weak = light.s.isel(tau=1), 1 / (1 + float(light.alpha[1]))
    yield differing("kappa = .001, weakest drive", f"1/(1 + alpha) = {weak:.4f}", first, weak, 0.01)
    yield differing("kappa = .001: least s", "1/3", light.s.min(), 1 / 3, 0.01)
    yield differing("kappa = 1: strongest drive", "1/2", heavy.s.isel(tau=-2), 0.5, 0.01)

    yield "Where exponents turn"
    upper, lower = (passage(smooth, value) for value in (3 / 4, 5 / 12))
    there, deep = upper.dropna("kappa"), lower.where((lower.kappa > 0.008) & (lower.kappa < 0.05), drop=True)
    text = ", ".join(f"{float(x):.2g} at kappa = {float(x.kappa):.3g}" for x in deep)
    ranged = f"{float(there[0]):.2f} to {float(there[-1]):.2f}, kappa = .001 to {float(there.kappa[-1]):.0f}"
    weak = abs(there[0] - 1 / 3) < 0.02 and there[-1] < 1.0
    by_loss = power(deep.assign_coords(kappa=4 * deep.kappa.values / (1 + deep.kappa.values) ** 2))  # 1 - e^2
    near, logs = smooth.isel(nearest(smooth.kappa, 0.01)), np.log(smooth.alpha.values)
    share = float(np.interp(math.log(float(deep[0])), logs, near.viscous.values))
    yield said("s = 3/4, halfway from -1 to -1/2, at alpha", weak, ranged, "1/3 without wheel")
    yield said("s = 5/12, halfway from -1/3 to -1/2, at alpha", deep.size >= 2, text, "-")
    yield differing("  alpha ~ (1 - e^2)^x, e = (1 - kappa)/(1 + kappa)", "-3", by_loss, -3, 0.2)
    yield differing("  share of viscous losses there, kappa = .01", "2/5 by (1)", share, 0.4, 0.02)

    yield f"In mesh: recoil of at most {MESH:g} pitch"
    s = smooth.s.where(smooth.pitches <= MESH)
    least, where = s.min("tau"), s.fillna(np.inf).argmin("tau")
    back = float(s.where(s.tau >= s.tau.isel(tau=where)).max("tau").where(least < 0.38).max())
    rising = lower.where(lower.kappa < 0.05).values
    recoil = [np.interp(math.log(a), logs, smooth.pitches[k]) for k, a in enumerate(rising) if a > 0] or [0.0]
    line = near.isel(tau=slice(1, int(near.pitches.argmax("tau"))))
    border = float(np.interp(MESH, line.pitches.values, line.s.values))
    first = int(np.isfinite(s.isel(tau=-2)).argmax("I_c"))
    dips, end = float(least[first]), float(s[first, -2])
    heavy = f"kappa = {smooth.kappa[first]:.2g} stays in mesh at any drive: least s, strongest"
    text, what = f"{min(recoil):.2g} to {max(recoil):.2g}", "least s in mesh of kappa = .01, at half a pitch"
    yield said("recoil where s rises through 5/12, kappa < .05 [pitches]", min(recoil) > MESH, text, "out of mesh")
    yield differing(what, "0.3615 by `verge`, 1500 torques", border, 0.3615, 0.005)
    yield said(heavy, dips > 0.43 and abs(end - 0.5) < 0.01, f"{dips:.3f}, {end:.3f}", ", 1/2")
    yield held("in mesh, of clocks that have s < .38: s at a stronger drive", back, "< .38", "at most {:.3f}")

    yield "A clock with a light wheel"
    # its dry friction is I_v a^2 phi0, its recoil a quarter of a pitch
    line = ds.isel(R_v=1).sel(I_c=2.5e-5, method="nearest")
    clock = line.isel(tau=int(abs(line.pitches - 0.25).argmin("tau")))
    text = ", ".join(f"{name} {clock[name]:.0%}" for name in LOSSES)
    what = f"kappa = .01, alpha = {clock.alpha:.3g}, recoil of {clock.pitches:.2g} pitch"
    viscous = clock.viscous > clock.dry > clock.impact
    yield said(f"{what}: losses", viscous, text, "viscous most, impact least")
    yield held("  its exponent", clock.s, "1/3 to 1/2", "{:.3f}")

    yield "By the shares of the losses"
    off = ds.s - (ds.viscous + ds.impact) / (2 + ds.viscous)
    # allowed is what the drop and a swing that is not endless leave
    strong, near = off.where(ds.alpha > 1e4), off.isel(R_v=0).where(ds.alpha > 100)
    yield most("s by the shares, (1), alpha > 1e+04", "0.015", strong, 0.015, count(strong))
    yield most("  the same, alpha > 100 without dry friction", "0.05", near, 0.05, count(near))

    yield "Friction on the wheel"
    for R_c, name in ((0.0, "viscous"), (float(wheel.R_c[-1]), "and dry")):
        moved = wheel.s.sel(R_c=R_c).values
        stayed = ds.s.sel(R_v=R_c * float(wheel.n), I_c=wheel.I_c, method="nearest").values
        both = (moved < 0.5) & (stayed < 0.5)
        what, here = f"friction on the wheel, {name}: exponents", f"largest difference of {both.sum()} cells"
        yield most(what, "as on the foliot", (moved - stayed)[both], 0.02, here)


@panel(ALPHA, KAPPA)
@panel(ALPHA, Axis("share of the energy [1]", (0, 1)), "lower left", framealpha=0.9, frameon=True)
@page(128.0, height_ratios=(1.3, 1))
def figure(plane, shares, ds, _):
    """The exponent over drive and wheel, and the shares of the losses of a clock with a light wheel."""
    smooth = ds.isel(R_v=0)
    exponent_map(plane, smooth, (smooth.pitches > MESH).values, "recoil over 1/2 pitch")
    names = {0.36: "0.36", 5 / 12: "5/12", 0.75: "3/4"}
    contours(plane, ds.alpha, ds.kappa, smooth.s, list(names), linewidths=0.8, fmt=names, inline_spacing=2)
    clock = ds.isel(R_v=1).sel(I_c=2.5e-5, method="nearest")
    clock = clock.isel(tau=np.isfinite(clock.viscous.values))
    parts = [clock[name].values for name in LOSSES]
    shares.stackplot(clock.alpha.values, parts, colors=COLOURS[:3], labels=LOSSES, alpha=0.85)
    shares.set(xlim=(clock.alpha[0], clock.alpha[-1]))


main = script(__name__, "verge_losses.h5 verge_losses_wheel.h5", claims, figure, lambda *both: tuple(map(scaled, both)))
