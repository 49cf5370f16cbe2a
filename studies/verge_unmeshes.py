"""Which verges stay in mesh, with which exponent, and does any real clock show -1/2?

    python studies/verge_unmeshes.py verge_unmeshes.h5

P ~ torque^(-s). kappa = n^2 I_c/I_v is the wheel's inertia over the foliot's, alpha = n tau/(I_v a^2 phi0) the drive
over viscous friction, a = c_v/I_v. A wheel that is thrown back by more than half a pitch, 2 n phi0 + drop, is out of
mesh. By docs/theory/two_bodies.md, for no drop and e = 0, the recoil at strong drive is (1 - kappa)^2/(2 kappa) in
units of n phi0, so that a wheel of kappa > 3 - 2 sqrt 2 = 0.1716 stays in mesh at any drive; one without inertia
follows the foliot, and is out of mesh where that swings beyond 3 phi0, at alpha = 22.16 and s = 0.3575. Bounces of a
light wheel last about e kappa/(1 - e) of a half period; where they die out in contact, e does not matter.

The exponent s is a difference of ln P over ln torque, with 8 points a decade; the drop is 5 % of n phi0.
"""

import math

import numpy as np
from _common import Claims, compared, count, differing, held, most, never, said, script, solved
from _figures import ALPHA, COLOURS, DASHES, KAPPA, S, direct_label, exponent_map, page, panel
from _losses import of_quarter, quarter, verge

from kernels.interface import Status

BORDER = 3 - 2 * math.sqrt(2)


def border(axis: str, values, **changed: float) -> float:
    """Between which of these values a clock without drop stays in mesh on one side alone: their middle, else NaN."""
    clock = {"tau": 1.0, "I_v": 1.0, "n": 1.0, "phi0": 0.3, "drop": 3e-10} | changed | {axis: values}
    turns = np.flatnonzero(np.diff(solved("verge", **clock, rtol=1e-6).status == 0))
    return 0.5 * float(values[turns[0]] + values[turns[0] + 1]) if turns.size == 1 else math.nan


def claims(smooth, ds) -> Claims:
    yield "In mesh"
    light, leaves, (alpha, least, _) = smooth.isel(I_c=0), smooth.out.any("tau"), of_quarter(quarter(3, 2))
    last, first = light.alpha.where(~light.out).max(), light.alpha.where(light.out).min()
    leaves_at = border("tau", 0.3 * np.arange(22.0, 22.4, 0.01), I_c=1e-9, c_v=1.0) / 0.3
    kappa = border("I_c", np.arange(0.165, 0.18, 1e-4))
    heavy = smooth.where(~leaves & (smooth.kappa < 0.7), drop=True).isel(tau=-1)
    off = heavy.pitches / ((1 - heavy.kappa) ** 2 / (8 * heavy.kappa)) - 1
    below, above, farthest = smooth.kappa.where(leaves).max(), smooth.kappa.where(~leaves).min(), ds.pitches.max()
    free, last_first = "kappa from which on no drive unmeshes it, no friction", f"{last:.3g}, {first:.3g}"
    bare, body = "alpha at which a wheel without inertia unmeshes, no drop", f"{alpha:.5g}, by one body"
    near, recoil = last < 1.1 * alpha < first, "  their recoil at alpha = 1e5 [pitches]"
    yield compared(free, "3 - 2 sqrt 2 = 0.17157", kappa, BORDER, 1e-3)
    yield said("  with viscous friction, between", below < BORDER < above, f"{below:.3f}, {above:.3f}", "the same")
    yield most(recoil, "(1 - kappa)^2/(8 kappa)", off, 0.1, f"{heavy.sizes['I_c']} wheels")
    yield compared(bare, body, leaves_at, alpha, 1e-3)
    yield said("  kappa = .001, with the drop, between", near, last_first, "the same and 10 %")
    yield held("largest recoil of a clock that runs [pitches]", farthest, "0.45 to 1/2", "{:.3f}")

    yield "Exponents"
    several = smooth.where(smooth.kappa < 0.7, drop=True).transpose("I_c", "tau")
    share = several.kappa.values[:, None] * np.ones(several.tau.size)
    mu = (several.n * several.tau / several.I_v).values / (1 + share)
    cells = {"mu": mu, "a": float(several.c_v / several.I_v) / (1 + share), "e": (1 - share) / (1 + share)}
    cells = {name: values.ravel() for name, values in cells.items()}
    one = solved("foliot", design="zip", **cells, phi0=smooth.phi0, outputs=["sensitivity"])
    off = several.s - one.sensitivity.values.reshape(share.shape)
    heavy = smooth.s.where(smooth.kappa > BORDER, drop=True).isel(tau=-2)
    body = "s, kappa < .7: one body keeping (1 - kappa)/(1 + kappa)"
    yield differing("least s in mesh, kappa = .001", f"{least:.4f} or more", light.s.min(), least, 0.01)
    yield most(body, "foliot", off, 0.01, "largest difference")
    yield most("strongest drive, kappa > .17: s", "1/2", heavy - 0.5, 0.01, f"{heavy.min():.4f} to {heavy.max():.4f}")

    yield "Where s is 1/2"
    decades = (abs(smooth.s - 0.5) < 0.02).sum("tau") / 8
    light, heavy = (decades.sel(I_c=kappa * 2.5e-3, method="nearest") for kappa in (0.01, 1.0))
    dry = ds.isel(R_v=1, e=0).s.sel(I_c=2.5e-5, method="nearest")
    near, friction = "within 0.02 of 1/2, kappa = .01", "kappa = .01, dry friction of I_v a^2 phi0: s in mesh"
    yield said(f"decades of torque with s {near}", 0.0 < light < 0.5, f"{light:.2g}", "< 1/2")
    yield held("  kappa = 1", heavy, "> 3", "{:.2g}")
    yield said(friction, dry.min() < 0.4, f"{dry.max():.3f} to {dry.min():.3f}", "below 1/2 at its end")

    yield "Restitution"
    bounce, plastic = ds.e * ds.kappa / (1 - ds.e), ds.isel(e=0)
    short, longer = ((ds.period / plastic.period - 1).where(bounce < x) for x in (0.005, 0.1))
    light = (bounce < 0.25) & (ds.kappa < BORDER)
    other, leave = int(((ds.out != plastic.out) & light).sum()), int((ds.out & light).sum())
    unknown = light & ~(np.isfinite(ds.period) | ds.out | (ds.status == Status.NEVER_STARTS))
    irregular = ds.status == Status.NOT_CONVERGED
    none = f"{int(irregular.sum())} of {ds.status.size}"
    heavy = ds.s.where((ds.e > 0.0) & (ds.kappa > BORDER) & (ds.alpha > 1e4))
    alike = "  < .25, kappa < .17: cells that unmesh otherwise than with e = 0"
    yield most("e kappa/(1 - e) < .005: period against e = 0", "no difference", short, 1e-4, "largest")
    yield most("  < .1", "small", longer, 0.05, "largest")
    yield said(alike, other == 0 < leave, f"{other} of {leave}", "0")
    yield never("  and that do not run, unmesh, or stick", unknown)
    yield said("no cycle of one tooth from rest", bounce.where(irregular).min() > 0.4, none, "e kappa/(1 - e) > .4")
    yield differing(f"e > 0, kappa > .17, alpha > 1e4: median s, {count(heavy)}", "1/2", heavy.median(), 0.5, 0.01)


@panel(ALPHA, KAPPA)
@panel(ALPHA.to(0.1, 1e5), S.to(0.3, 1.0), "upper right", title=r"$\kappa$")
@page(128.0, height_ratios=(1.2, 1))
def figure(plane, lines, smooth, *_):
    """A map of the exponent with plastic impacts, and the exponent over the drive."""
    exponent_map(plane, smooth, smooth.out.values, "unmeshes")
    plane.contour(smooth.alpha, smooth.kappa, smooth.s, levels=[0.5], colors="white", linewidths=0.8)
    plane.axhline(BORDER, color="C3", linewidth=0.8, linestyle="--")
    direct_label(plane, 2e3, 0.25, r"$3-2\sqrt{2}$", "C3")
    for i, kappa in enumerate((0.01, 0.1, 0.18, 1.0)):
        line, look = smooth.sel(I_c=kappa * 2.5e-3, method="nearest"), {"color": COLOURS[i]}
        lines.plot(line.alpha, line.s, linestyle=DASHES[i], label=f"{line.kappa:.2g}", **look)
        if line.out.any():
            there = np.flatnonzero(np.isfinite(line.s.values))[-1]
            lines.plot(line.alpha[there], line.s[there], "x", markersize=5, **look)
    lines.axhline(0.5, color="0.7", linewidth=0.6)


def prepared(ds):
    """Clocks without dry friction and restitution, and all of them, with their groups and which come out of mesh."""
    ds = verge(ds, ds.period, ds.status == 0).assign(out=ds.status == Status.UNMESHES)
    return ds.isel(R_v=0, e=0), ds


main = script(__name__, "verge_unmeshes.h5", claims, figure, prepared)
