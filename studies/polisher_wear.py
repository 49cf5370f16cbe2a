"""How evenly does a polishing machine wear a turning workpiece, and what do eccentricity and offset do for it?

    python studies/polisher_wear.py polisher_wear.h5 polisher_wear_load.h5

The unevenness of a profile is the standard deviation of the wear over the area of the workpiece, over its mean; 0 is
even. It hardly sees a middle that the tool never reaches: where the least wear of the inner half of the radius is below
half of the mean, the workpiece is said to have a hole. The offset is how much farther from the pivot the workpiece's
centre lies than the tool's. The places of both, the rates, the pressure and Preston's coefficient are chosen here.
"""

import numpy as np
import xarray as xr
from _common import Claims, compared, held, said, script
from _figures import COLOURS, Axis, colour_map, contours, hatch, page, panel
from _polishing import KEPT, POINTS, area, best_settings, disc, least, unevenness

UM_PER_HOUR, CM, MM = 3.6e9, 100.0, 1000.0
"""1 m/s; 1 m."""
USUAL = 0.10
"""Eccentricity [m] of the profiles."""
SHAPES = {"disc": (2, 0.04), "ellipse": (2, 0.08), "rhombus 1:2": (1, 0.08), "rhombus 1:1": (1, 0.04)}
"""Exponent and half width [m] of the tools."""


def scaled(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with the mean over the area, the unevenness and the least wear of the inner half over the mean."""
    weight, wear, cells = area(ds.radius), ds.wear.transpose(..., "radius").values, ds.status.dims
    found = {"uneven": unevenness(wear, weight), "least": least(wear, weight, ds.radius.values)}
    found["average"] = (wear * weight).sum(-1)
    return ds.assign({name: (cells, values) for name, values in found.items()})


def tool(ds: xr.Dataset, name: str) -> xr.Dataset:
    """The wear by one of the tools."""
    n, b = SHAPES[name]
    return ds.sel(tool_n=n).sel(tool_b=b, method="nearest")


def least_uneven(ds: xr.Dataset, *over: str, hole: bool = False) -> xr.Dataset:
    """The cell of least unevenness, of all, or of those without a hole."""
    uneven = ds.uneven if hole else ds.uneven.where(ds.least >= KEPT)
    return ds.isel({name: int(k) for name, k in uneven.argmin(list(over)).items()})


def described(cell: xr.Dataset) -> str:
    """Unevenness, place and hole of a cell."""
    offset = CM * float(cell.w_x - cell.L)
    return f"{cell.uneven:.1%} at e = {CM * cell.e:g} cm, offset {offset:.3g} cm, least {cell.least:.2f}"


def claims(ds, load) -> Claims:
    yield "Offset"
    for name in SHAPES:
        usual = tool(ds, name).sel(e=USUAL, method="nearest")
        aligned = float(usual.uneven.sel(w_x=float(ds.L), method="nearest"))
        bored, best = least_uneven(usual, "w_x", hole=True), least_uneven(usual, "w_x")
        here = f"{described(best)}; no offset {100 * aligned:.0f} %"
        yield said(f"{name}, e = 10 cm: the least uneven has a hole", bored.least < KEPT, described(bored))
        yield said("  without a hole an offset evens by a third at least", best.uneven / aligned < 2 / 3, here)

    yield "Eccentricity"
    round_tool = ds.sel(tool_n=2).isel(tool_b=0)
    aligned, lost = (round_tool[name].isel(w_x=0) for name in ("uneven", "average"))
    even = aligned.isel(e=int(aligned.argmin("e")))
    here = f"{aligned[0]:.0%} at 2 cm, least {even:.0%} at {CM * even.e:g} cm"
    text = f"{UM_PER_HOUR * lost[0]:.3g} at 2 cm, at most {UM_PER_HOUR * lost.max():.3g}"
    yield said("disc, no offset: throw halves the unevenness", even < 0.5 * aligned[0], here)
    # one setting at best, and the most even of the grid solved again
    (bored, best), wear, fine = best_settings(round_tool), disc(ds), np.linspace(0.0, float(ds.radius[-1]), POINTS)
    w_x = float(ds.L) + best.offset + np.linspace(-4e-3, 1e-3, 21)
    rows = wear(*np.meshgrid(best.e + np.linspace(-0.01, 0.01, 11), w_x))
    uneven = unevenness(rows, area(fine))[least(rows, area(fine), fine) >= KEPT].min()
    found = least_uneven(round_tool, "e", "w_x", hole=True)
    profile = np.asarray(wear(float(found.e), float(found.w_x)))[:: (POINTS - 1) // (ds.radius.size - 1)]
    again, near = float(unevenness(profile, area(ds.radius))), bored.uneven < best.uneven < 1.1 * bored.uneven
    yield said("disc, one setting, optimised: the most even has a hole", bored.least < KEPT, str(bored))
    yield said("disc, one setting, optimised, without a hole", near, str(best))
    yield held("  best of 231 settings around it, over that", uneven / best.uneven, "1 to 1.01", "{:.4f}")
    yield compared("disc, most even setting of the grid, solved again", f"{again:.5f}", found.uneven, again, 1e-4)
    yield said("disc, no offset: mean wear more than doubles with throw [um/h]", lost.max() > 2 * lost[0], text)

    yield "Constant load"
    # that of the constant pressure on the whole tool, which rises where the tool hangs over the edge
    pressed = tool(ds, "disc").wear.sel(e=USUAL, method="nearest")
    ratio = load.wear.isel(radius=-1) / pressed.interp(radius=load.radius[-1]).sel(w_x=load.w_x, method="nearest")
    here = ", ".join(f"{float(r):.3g} at {MM * float(r.w_x - ds.L):.0f} mm" for r in ratio)
    within = ((ratio > 3) & (ratio < 5)).all()
    yield said("disc: wear by load over that by pressure, 2 mm from the edge", within, here, "3 to 5")


RADIUS, WEAR = Axis("radius [mm]", (0, 100)), Axis("wear [µm/h]", (0, 0.24))
KEY = {"constant load": {"linestyle": "--", "linewidth": 0.9}}


@panel(RADIUS, WEAR, "upper left", KEY, title="offset at $e=100$ mm", ncols=2)
@panel(Axis("offset [mm]"), Axis("eccentricity, $e$ [mm]"))
@page(136.0)
def figure(profile, plane, ds, load):
    """Profiles of the disc, and how uneven they are over offset and eccentricity."""
    disc = tool(ds, "disc")
    for place, colour in zip(load.w_x.values, COLOURS, strict=False):
        pressed = disc.wear.sel(e=USUAL, method="nearest").sel(w_x=place, method="nearest")
        dashed, text = load.wear.sel(w_x=place, method="nearest"), f"{MM * float(pressed.w_x - ds.L):.0f} mm"
        profile.plot(MM * pressed.radius, UM_PER_HOUR * pressed, color=colour, label=text)
        profile.plot(MM * dashed.radius, UM_PER_HOUR * dashed, "--", color=colour, linewidth=0.9)
    x, y, uneven = MM * (ds.w_x - ds.L).values, MM * ds.e.values, disc.uneven.transpose("e", "w_x")
    look = {"vmin": 0, "vmax": 1.2, "cmap": "cividis_r", "shading": "gouraud"}
    colour_map(plane, x, y, uneven, "unevenness of the wear [1]", **look)
    hatch(plane, x, y, (disc.least < KEPT).transpose("e", "w_x").values, "////", "white")
    for text in contours(plane, x, y, uneven, [0.3, 0.5], fontsize=8):
        text.set_bbox({"facecolor": "0.35", "edgecolor": "none", "pad": 0.5})
    best, star = least_uneven(disc, "e", "w_x"), {"color": "white", "markeredgecolor": "black", "markersize": 9}
    plane.plot(MM * float(best.w_x - ds.L), MM * float(best.e), "*", **star)


INPUTS = "polisher_wear.h5 polisher_wear_load.h5"
main = script(__name__, INPUTS, claims, figure, lambda ds, load: (scaled(ds), load))
