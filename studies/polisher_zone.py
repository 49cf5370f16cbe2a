"""Which zone of the work does an operator choose by moving O_DH on its arc, and how does the tool wear meanwhile?

    python studies/polisher_zone.py polisher_zone.h5

O_DH on its arc turns the tool's centre by beta, so that the tool, of half width a, covers the work's centre, at the
distance L, in some part of the swing if
    alpha_min - q <= -beta <= alpha_max + q,  sin(q/2) = a/(2 L),                                        (1)
and a throw that moves the middle A0 of the swing is put right by beta = -(change of A0). The tool wears by Preston's
law as the work does. On the arm it does not spin, so each of its points keeps its own mean speed, and all that the tool
loses the work loses too,
    integral of the wear over the tool = 2 pi integral of the wear over r dr.                            (2)

The zone is at the mean radius of what is worn off, by volume. Trapezoids of 2.5 mm in the radius leave 2e-3 of (2).
"""

import math

import numpy as np
import xarray as xr
from _common import Claims, held, most, never, said, script, solved
from _figures import COLOURS, DASHES, HOLLOW, MARKS, Axis, page, panel, points
from _polishing import disc_points, swings, tool_wear


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with volumes worn off the work and off the tool per time [m^3/s], the zone [m], and what is worn along
    the tool's diameter that lies on the arm, over X [m]."""
    volume = 2 * np.pi * (ds.wear * ds.radius).integrate("radius")
    zone = 2 * np.pi * (ds.wear * ds.radius**2).integrate("radius") / volume
    a, motion = float(ds.tool_a), swings(ds, ds.e.values)
    places, share = disc_points(a)
    lost = [(tool_wear(ds, motion, places.real, places.imag, beta) * share).sum(axis=1) for beta in ds.beta.values]
    x = np.linspace(-a, a, 61)
    return ds.assign_coords(X=x).assign(
        volume=volume, zone=zone, tool=(("e", "beta"), np.pi * a**2 * np.stack(lost, axis=1)),
        low=motion.alpha.min("crank_angle"), high=motion.alpha.max("crank_angle"),
        across=(("e", "X"), tool_wear(ds, motion, x, 0.0 * x)),
    )  # fmt: skip


def claims(ds) -> Claims:
    yield "The zone by O_DH"
    q = 2 * math.asin(float(ds.tool_a) / (2 * float(ds.L)))
    theory = (ds.low - q <= -ds.beta) & (-ds.beta <= ds.high + q)
    worn, zone = ds.wear.isel(radius=0) > 0, 100 * ds.zone.sel(e=0.04, method="nearest")
    machine = {name: float(ds[name]) for name in ("b", "d", "f")}
    A0s = np.degrees(solved("polisher", e=[0.10, 0.15], outputs=["A0"], rtol=1e-12, **machine).A0.values)
    beta, alpha = A0s[0] - A0s[1], np.degrees(swings(ds, [0.10, 0.15]).alpha)
    middle = 0.5 * (alpha.max("crank_angle") + alpha.min("crank_angle")).values + np.array([0.0, beta])
    line = ds.zone.sel(e=0.15, method="nearest")
    shift = 100 * float(line.interp(beta=0.0) - line.interp(beta=math.radians(beta)))
    alone, text = "e = 4 cm: zones by O_DH alone, 15 degree to each side", f"{zone.min():.1f} to {zone.max():.1f} cm"
    kept = "  O_DH turned by that keeps the middle [degree]"
    yield never("the centre wears otherwise than (1) says", worn != theory.transpose(*worn.dims))
    yield said(alone, zone.max() > 3 * zone.min(), text, "-")
    yield most(kept, "0", middle[1] - middle[0], 2e-3, f"beta = {beta:.3f}")
    yield said("  zone with and without it, e = 15 cm", abs(shift) > 0.1, f"by {10 * shift:.1f} mm", "moves")

    yield "Wear of the tool"
    usual = ds.sel(e=0.10, method="nearest").sel(beta=0, method="nearest")
    ratio = float(usual.tool) / (math.pi * float(ds.tool_a) ** 2) / float(usual.wear.isel(radius=0))
    uneven = ds.across.isel(X=-1) / ds.across.isel(X=0)
    here = ", ".join(f"{float(x):.3f} at e = {100 * float(x.e):.0f} cm" for x in uneven)
    yield most("(2) over all cells", "1", abs(ds.tool / ds.volume - 1).max(), 2e-3)
    yield held("mean wear of the tool over the work's centre, e = 10 cm", ratio, "> 1", "{:.2f}")
    yield said("outer rim over inner rim", (uneven > 1).all(), here, "> 1 at every throw")


TURNED, ZONE = Axis(r"O$_\mathrm{DH}$ turned by $\beta$ [degree]"), Axis("zone, mean radius [cm]", (0, 27))
PLACE, WEAR = Axis("place on the tool, outwards [cm]"), Axis("wear of the tool over its mean [1]")
KEY, THROW = {"centre not worn": {"marker": "o", **HOLLOW, "markersize": 4}}, "throw, $e$ [cm]"


@panel(TURNED, ZONE, "upper center", KEY, title=THROW, ncols=4)
@panel(PLACE, WEAR, "upper left", title=THROW, ncols=3)
@page(128.0)
def figure(zone, tool, ds):
    """Zones by beta, filled where the centre wears, and the tool's wear."""
    for k, e in enumerate(ds.e.values):
        line, look = ds.sel(e=e), {"color": COLOURS[k], "label": f"{100 * e:.0f}"}
        beta, place, worn = np.degrees(line.beta), 100 * line.zone, line.wear.isel(radius=0) > 0
        points(zone, beta, place, k, linestyle="-", linewidth=0.8, markersize=4)
        zone.plot(beta, place.where(worn), MARKS[k], linestyle="", **look)
        tool.plot(100 * ds.X, line.across / line.across.mean(), linestyle=DASHES[k], **look)


main = script(__name__, "polisher_zone.h5", claims, figure, prepared)
