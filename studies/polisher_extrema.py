"""How do middle and amplitude of a polishing arm go with the motor's eccentricity, and up to which does the motor turn?

    python studies/polisher_extrema.py polisher_extrema.h5

The paper is Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), figures 4, 6 and 7; where "-" stands it says
nothing, and the formula is named in the line. b = (49, -38) cm has the length and makes the range of angles of its
figure 4, which does not give it. "No, known" marks a statement of the source that its own equations refute: with those
for type A (upper signs) the minimum of alpha moves. Its figure 4 shows the same arm with alpha counted clockwise.
"""

import math
from math import degrees

import numpy as np
import xarray as xr
from _common import Claims, compared, differing, most, said, script, solved
from _figures import COLOURS, Axis, direct_label, page, panel

from kernels.interface import Status

LAST = 0.15
"""Where the paper's figures end, in m."""
B_ANGLE = math.atan2(-38.0, 49.0)


def aligned(ds: xr.Dataset):
    """e x f over e f at both extremes: crank and coupler lie on one line there, the paper's theorem."""
    found = []
    for turn, eta in ((ds.theta_plus, ds.eta_plus), (ds.theta_minus, ds.eta_minus)):
        crank = ds.e * np.exp(1j * turn)
        coupler = ds.d * np.exp(1j * eta) - ds.b - crank
        found.append(((np.conj(crank) * coupler).imag / (ds.e * ds.f)).where(ds.e > 0))
    return xr.concat(found, "extreme")


def claims(ds) -> Claims:
    yield "Size of the swing"
    last, start = ds.sel(e=LAST, method="nearest"), ds.isel(e=0)
    slope = float(ds.f / (ds.b * ds.d * np.sin(start.A0)))
    fall, grown = degrees(start.A0 - last.A0), float(last.A1) / (LAST * slope) - 1
    full, rise = ds.where(ds.status == Status.OK, drop=True), f"A1/e at e -> 0 by f/(b d sin A0) = {slope:.4f} rad/m"
    yield compared(rise, "-", start.A1_e, slope, 1e-12)
    yield said("A1 is proportional to e", 0.05 < grown < 0.2, f"{grown:+.1%} at 15 cm", "only nearly")
    yield said("A0 is constant", fall > 1, f"falls {fall:.2f} degree to 15 cm", "only nearly")
    yield most("alignment: the extremes have e x f = 0, over e f", "0", aligned(full), 1e-9, "largest of both")

    yield "Times of the extremes (figure 4)"
    paper = ds.sel(e=slice(0, LAST + 1e-6))
    plus = degrees(paper.theta_plus.max() - paper.theta_plus.min())
    minus, later = degrees(last.theta_minus - start.theta_minus), (paper.theta_minus.diff("e") > 0).all()
    maxima = degrees(last.theta_plus - start.theta_plus)
    clockwise = "with alpha counted clockwise: maxima, the minima here"
    yield said("figure 4: maxima move to the right as e grows", maxima > 10, f"by {maxima:.1f} degree", "yes", True)
    yield said("figure 4: minima do not move", minus < 1.5, f"by {minus:.1f} degree", "yes", True)
    yield said(clockwise, later and minus > 10, f"{minus:.1f} degree", "yes")
    yield said("  minima, the maxima here, do not move", plus < 1.5, f"within {plus:.2f} degree", "yes")

    yield "The border"
    flat, locked = (ds.where(ds.status == status, drop=True) for status in (Status.CHANGE_POINT, Status.LOCK_UP))
    limit, there, near, angle = float(ds.d + ds.f - ds.b), flat.isel(e=0), full.isel(e=-1), last.transmission_angle
    sharp = (full.e < limit).all() and (locked.e > limit).all() and flat.e.size == 1
    text = f"{degrees(angle):.1f} at 15 cm, {degrees(near.transmission_angle):.2f} degree "
    text += f"{1e3 * (limit - float(near.e)):.1f} mm before"
    what = "angle of coupler and arm falls to 0 at the border"
    yield compared("largest e of a motor that turns, cm", "-", 100 * float(flat.e[0]), 100 * limit, 1e-12)
    yield said("all smaller turn, all larger lock", sharp, f"locks from {100 * float(locked.e[0]):.2f} cm on", "-")
    yield differing("A0 = A1 there, degree", "-", degrees(there.A1), degrees(there.A0), 1e-5)
    yield said(what, near.transmission_angle < 0.3 * angle, text, "-")
    yield said("harmonic motion", last.thd < 0.01, f"distortion {last.thd:.1%} at 15 cm", "assumed elsewhere", True)


TURN = Axis("crank angle from $b$ [degree]", (-180, 180))


@panel(TURN, Axis(r"angle of the arm, $\alpha$ [degree]"), "lower right", title="eccentricity, $e$")
@panel(Axis("eccentricity, $e$ [cm]", (0, 18)), Axis("over its first order in $e$ [1]"), "upper left")
@page(136.0)
def figure(motion, size, ds):
    """alpha over a turn with the path of its extremes; A0 and A1 over their first order."""
    machine, turn = {name: ds[name] for name in "bdf"} | {"omega": 1.0, "b_angle": B_ANGLE}, np.linspace(-180, 180, 721)
    along = {"crank_angle": B_ANGLE + np.radians(turn)}
    cells = solved("polisher_motion", e=(0.01, 0.05, 0.1, 0.15), along=along, outputs=["alpha"], **machine)
    for alpha, colour in zip(cells.alpha.transpose("e", ...), COLOURS, strict=False):
        motion.plot(turn, np.degrees(alpha), color=colour, label=f"{100 * alpha.e:g} cm")
    paper, dashed = ds.sel(e=slice(0, LAST + 1e-6)), {"color": "black", "linewidth": 0.9, "linestyle": (0, (4, 2))}
    for end, label in (("plus", "extremes"), ("minus", None)):
        motion.plot(np.degrees(paper[f"theta_{end}"]), np.degrees(paper[f"eta_{end}"] + B_ANGLE), label=label, **dashed)
    motion.set_xticks(range(-180, 181, 90))
    limit, full = 100 * float(ds.d + ds.f - ds.b), ds.where(ds.A0.notnull() & (ds.e > 0), drop=True)
    size.plot(100 * full.e, full.A1 / (full.e * ds.A1_e[0]), color=COLOURS[0], label="amplitude, $A_1$")
    size.plot(100 * full.e, full.A0 / ds.A0[0], "--", color=COLOURS[1], label="middle, $A_0$")
    size.axhline(1.0, color="0.5", linewidth=0.8)
    size.axvline(100 * LAST, color="0.5", linewidth=0.8, linestyle=":", label="the paper ends")
    size.axvspan(limit, 18, facecolor="none", edgecolor="0.6", hatch="////", linewidth=0)
    direct_label(size, (limit + 18) / 2, 1.0, "motor locks", rotation=90)


main = script(__name__, "polisher_extrema.h5", claims, figure, source="paper")
