"""How evenly does a polishing machine wear a turning workpiece, and what do eccentricity and offset do for it?

    sweep run studies/polisher_wear.toml
    sweep run studies/polisher_wear_load.toml
    python studies/polisher_wear.py polisher_wear.h5 polisher_wear_load.h5

draws polisher_wear.png and prints conclusions. The unevenness of a profile is the standard deviation of the wear over
the area of the workpiece, over its mean; 0 is even. It weighs by area, so it hardly sees a middle that the tool never
reaches: the least wear of the inner half of the radius over the mean is told beside it, and below a half of the mean
the workpiece is said to have a hole.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, hatch, page_of, quality_bar, read_result, report
from _polishing import KEPT, area, least, one_setting, unevenness

from sweep.show.charts import COLOURS

UM_PER_HOUR = 3.6e9
"""1 m/s."""
CM, MM = 100.0, 1000.0
PROFILES = (0.50, 0.54, 0.56, 0.58)
"""Workpiece centres [m] whose profiles are drawn."""
USUAL = 0.10
"""Eccentricity [m] of the profiles."""

NOTES = """\
unevenness: standard deviation of the wear over the workpiece's area, over its mean; least: the least wear of the inner
half of the radius over that mean; with a hole: below a half. Optimised: over throw and offset, not on the grid.
Allowed: 1 % of the way of the arm over the centre, 1e-4 of a profile; the ways of the conclusions are told in them,
and they fail if a machine on the grid says otherwise
offset: how much farther from the pivot the workpiece's centre lies than the tool's; place of tool and workpiece, rates,
pressure and Preston's coefficient are chosen here, for the paper gives none of them"""


def scaled(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with the mean over the area, the unevenness and the least wear of the inner half over the mean."""
    weight, wear = area(ds.radius), ds.wear.transpose(..., "radius")
    cells = ds.status.dims
    return ds.assign(
        average=(ds.wear * xr.DataArray(weight, dims="radius")).sum("radius"),
        uneven=(cells, unevenness(wear.values, weight)),
        least=(cells, least(wear.values, weight, ds.radius.values)),
    )


def swing(ds: xr.Dataset) -> xr.DataArray:
    """Half amplitude A1 of the arm, by the paper's (37) and (40), corrected."""
    b, d, f = float(ds.b), float(ds.d), float(ds.f)
    far, near = (np.arccos((b * b + d * d - c * c) / (2 * b * d)) for c in (f + ds.e, abs(f - ds.e)))
    return 0.5 * (far - near)


def centre(ds: xr.Dataset) -> Statement:
    """What the middle of the workpiece loses under a tool that never leaves it: the way of the arm over it."""
    small = ds.sel(tool_n=2, w_x=0.50).isel(tool_b=-1, radius=0)
    small = small.where(swing(small) * float(ds.L) < 0.04, drop=True).isel(e=0)
    way = 4 * float(swing(small)) * float(small.w_x) * float(ds.omega) / (2 * np.pi)
    theory = float(ds.preston) * float(ds.pressure) * way * UM_PER_HOUR
    return compared(
        f"wear of the centre, e = {CM * float(small.e):g} cm [um/h]", f"{theory:.5g}",
        float(small.wear) * UM_PER_HOUR, theory, 1e-2, 5,
    )  # fmt: skip


def edge(ds: xr.Dataset, load: xr.Dataset) -> list[Statement]:
    """What a constant load does where the tool hangs over the edge, 2 mm inside it.

    The load is that of the constant pressure on the whole tool: where the tool lies on the work wholly the two are one,
    where it hangs over the edge the pressure rises by its area over that in contact, 3 to 5 times on this grid.
    """
    pressed = ds.wear.sel(tool_n=2).isel(tool_b=0).sel(e=USUAL, method="nearest")
    ratio = load.wear.isel(radius=-1) / pressed.interp(radius=load.radius[-1]).sel(w_x=load.w_x, method="nearest")
    middle = load.wear.isel(radius=0) / pressed.isel(radius=0).sel(w_x=load.w_x, method="nearest")
    texts = [f"{float(r):.3g} at {MM * float(r.w_x - ds.L):.0f} mm" for r in ratio]
    off = float(middle.isel(w_x=0) - 1)
    return [
        Statement(
            "disc: wear by load over that by pressure, 2 mm from the edge", "3 to 5", ", ".join(texts), None,
            bool(((ratio > 3) & (ratio < 5)).all()),
        ),
        Statement("disc, no offset: the same at the centre", "1", f"{1 + off:.6f}", off, abs(off) < 1e-4),
    ]  # fmt: skip


def worst_error(ds: xr.Dataset) -> Statement:
    """How far the numbers may be off."""
    worst = float((ds.wear_error / ds.wear.max("radius")).max())
    return Statement("error of every profile, over its largest wear", "", "at most", worst, worst <= 1e-4)


def offsets(ds: xr.Dataset) -> list[Statement]:
    """What moving the workpiece does, tool by tool: the least uneven profile has a hole, so holes are left out."""
    lines = []
    for name, n, b in SHAPES:
        tool = ds.sel(tool_n=n).sel(tool_b=b, method="nearest").sel(e=USUAL, method="nearest")
        aligned = tool.sel(w_x=float(tool.L), method="nearest")
        bored, best = least_uneven(tool, ("w_x",)), least_uneven(without_hole(tool), ("w_x",))
        lines.append(
            Statement(
                f"{name}, e = 10 cm: the least uneven has a hole", "", told(bored), None, bool(bored.least < KEPT)
            )
        )
        text = f"{told(best)}; no offset {100 * float(aligned.uneven):.0f} %"
        gain = float(best.uneven / aligned.uneven)
        lines.append(Statement("  without a hole an offset evens by a third at least", "", text, None, gain < 2 / 3))
    return lines


def without_hole(ds: xr.Dataset) -> xr.Dataset:
    """The profiles without a hole; others NaN."""
    return ds.where(ds.least >= KEPT)


def least_uneven(ds: xr.Dataset, over: Sequence[str]) -> xr.Dataset:
    """The cell of least unevenness."""
    return ds.isel({name: int(k) for name, k in ds.uneven.argmin(list(over)).items()})


def told(cell: xr.Dataset) -> str:
    """Unevenness, place and hole of a cell."""
    place = f"{100 * float(cell.uneven):.1f} % at e = {CM * float(cell.e):g} cm, "
    return f"{place}offset {CM * float(cell.w_x - cell.L):.3g} cm, least {float(cell.least):.2f}"


def eccentricities(ds: xr.Dataset) -> list[Statement]:
    """What the eccentricity does."""
    tool = ds.sel(tool_n=2).isel(tool_b=0)
    aligned = tool.uneven.isel(w_x=0)
    evenest = aligned.isel(e=int(aligned.argmin("e")))
    text = (
        f"{100 * float(aligned[0]):.0f} % at 2 cm, least {100 * float(evenest):.0f} % at {CM * float(evenest.e):g} cm"
    )
    lost = tool.average.isel(w_x=0)
    return [
        Statement("disc, no offset: throw halves the unevenness", "", text, None, bool(evenest < 0.5 * aligned[0])),
        *one_setting(tool),
        Statement(
            "disc, no offset: mean wear more than doubles with throw [um/h]", "",
            f"{UM_PER_HOUR * float(lost[0]):.3g} at 2 cm, at most {UM_PER_HOUR * float(lost.max()):.3g}", None,
            bool(lost.max() > 2 * lost[0]),
        ),
    ]  # fmt: skip


SHAPES = (
    ("disc", 2, 0.04),
    ("ellipse", 2, 0.08),
    ("rhombus 1:2", 1, 0.08),
    ("rhombus 1:1", 1, 0.04),
)


def figure(ds: xr.Dataset, load: xr.Dataset) -> Any:
    """Profiles of three tools, and how uneven they are over offset and eccentricity; for two columns of print."""
    from matplotlib.patches import Patch

    with page_of(116.0, 2, 3) as (page, (upper, lower)):
        for k, (name, n, b) in enumerate(SHAPES[:3]):
            tool = ds.sel(tool_n=n).sel(tool_b=b, method="nearest")
            draw_profiles(upper[k], tool, name, k, load if k == 0 else None)
            mesh = draw_map(lower[k], tool, k)
        quality_bar(page, mesh, list(lower), "unevenness of the wear [1]", pad=0.01)
        hole = Patch(facecolor="0.4", edgecolor="white", hatch="////", linewidth=0, label="(d-f) a hole in the middle")
        star = lower[0].get_legend_handles_labels()[0]
        page.legend(handles=[*upper[2].lines, upper[0].lines[-1], hole, *star], loc="outside lower center", ncols=4)
    return page


def draw_profiles(axes: Any, tool: xr.Dataset, name: str, k: int, load: xr.Dataset | None) -> None:
    """Wear along the radius at some offsets; dashed under a constant load."""
    for j, place in enumerate(PROFILES):
        line = tool.wear.sel(e=USUAL, method="nearest").sel(w_x=place, method="nearest")
        offset = MM * float(line.w_x - tool.L)
        axes.plot(MM * line.radius, UM_PER_HOUR * line, color=COLOURS[j], label=f"(a-c) offset {offset:.0f} mm")
        if load is not None:
            dashed = load.wear.sel(w_x=place, method="nearest")
            axes.plot(MM * dashed.radius, UM_PER_HOUR * dashed, "--", color=COLOURS[j], linewidth=0.9)
    axes.set(xlabel="radius [mm]", title=f"{name}, $e=100$ mm", xlim=(0, 100), ylim=(0, None))
    if load is not None:
        axes.set_ylabel("wear [µm/h]")
        axes.plot([], [], "k--", linewidth=0.9, label="(a) constant load")


def draw_map(axes: Any, tool: xr.Dataset, k: int) -> Any:
    """Unevenness over offset and eccentricity."""
    uneven = tool.uneven.transpose("e", "w_x")
    x, y = MM * (tool.w_x - tool.L).values, MM * tool.e.values
    mesh = axes.pcolormesh(x, y, uneven, vmin=0, vmax=1.2, cmap="cividis_r", shading="gouraud", rasterized=True)
    hatch(axes, x, y, (tool.least < KEPT).transpose("e", "w_x").values, "////", "white")
    lines = axes.contour(x, y, uneven, levels=[0.3, 0.5], colors="white", linewidths=0.7)
    for text in axes.clabel(lines, fmt="%g", fontsize=7):
        text.set_bbox({"facecolor": "0.35", "edgecolor": "none", "pad": 0.5})
    best = least_uneven(without_hole(tool), ("e", "w_x"))
    axes.plot(MM * float(best.w_x - tool.L), MM * float(best.e), "*", color="white", markeredgecolor="black",
              markersize=8, label="(d-f) most even without a hole, on the grid")  # fmt: skip
    axes.set(xlabel="offset [mm]")
    if k == 0:
        axes.set_ylabel("eccentricity, $e$ [mm]")
    return mesh


def conclude(path: str, loaded: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = scaled(read_result(path, "polisher_wear", ["tool_n", "tool_b", "e", "w_x"], "polisher_wear.toml"))
    load = read_result(loaded, "polisher_wear", ["w_x"], "polisher_wear_load.toml")
    groups = {
        "Numbers": [centre(ds), worst_error(ds)],
        "Offset": offsets(ds),
        "Eccentricity": eccentricities(ds),
        "Constant load": edge(ds, load),
    }
    return groups, [NOTES], lambda: figure(ds, load)


main = partial(report, __file__, ["polisher_wear.h5", "polisher_wear_load.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
