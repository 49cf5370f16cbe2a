"""Which zone of the work does an operator choose by moving O_DH on its arc, and how does the tool wear meanwhile?

    sweep run studies/polisher_zone.toml
    python studies/polisher_zone.py polisher_zone.h5

draws polisher_zone.png and prints theory beside what comes out. O_DH on its arc turns the tool's centre by beta, to
L (cos(alpha + beta), sin(alpha + beta)); so the tool, of half width a, covers the work's centre, at distance L, in some
part of the swing if

    alpha_min - q <= -beta <= alpha_max + q,  sin(q/2) = a/(2 L),                                        (1)

and a throw that moves the middle A0 of the swing is put right by beta = -(change of A0). The tool wears by Preston's
law as the work does, A p times its speed against it. On the arm it does not spin, so each of its points keeps its own
mean speed, and all that the tool loses the work loses too,

    integral of the wear over the tool = 2 pi integral of the wear over r dr.                            (2)
"""

from __future__ import annotations

import math
import sys
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, differing, page_of, read_result, report

import sweep
from sweep.show.charts import COLOURS, DASHES, MARKS

TURN = 720
"""Crank angles of a turn."""
RINGS, SPOKES = 24, 48
"""Points of the tool: Gauss in the square of the radius, evenly around."""
A0 = {10.0: 38.4038, 15.0: 36.0997}
"""Middle of the swing from b [degree] by throw [cm], had to 50 digits by the paper's (39)."""
UM_PER_HOUR = 3.6e9

NOTES = """\
zone: mean radius of what is worn off, by volume; outer, inner: the tool's rim farthest from and nearest to the pivot
allowed: no exception to (1), beside which no cell lies; 2e-3 of (2), what trapezoids of 2.5 mm in the radius leave;
5e-5 degree of A0 as it is printed, 2e-3 degree of the middle, found on 720 crank angles\
"""


def swings(ds: xr.Dataset) -> xr.Dataset:
    """alpha [rad] and its rate [rad/s] over a turn of the crank, by throw."""
    fixed = {name: float(ds[name]) for name in ("b", "d", "f", "omega", "b_angle")}
    study = sweep.study(
        kernel="polisher_motion", axes={"e": ds.e.values.tolist()}, fixed=fixed, outputs=["alpha", "alpha_rate"],
        along={"crank_angle": np.linspace(0, 2 * np.pi, TURN, endpoint=False)}, rtol=1e-12,
    )  # fmt: skip
    return sweep.run(study)


def tool_wear(ds: xr.Dataset, motion: xr.Dataset, X: Any, Y: Any, beta: float) -> np.ndarray:
    """Wear [m/s] of points X along and Y across the tool, by throw: by their mean speed against the work."""
    turned = np.exp(1j * (motion.alpha.values + beta))[:, :, None]
    place = turned * (float(ds.L) + np.ravel(X) + 1j * np.ravel(Y))
    work = float(ds.w_x)
    speed = abs(motion.alpha_rate.values[:, :, None] * place - float(ds.Omega) * (place - work))
    mean = speed.mean(axis=1).reshape(ds.sizes["e"], *np.shape(X))
    return float(ds.preston) * float(ds.pressure) * mean


def tool_points(ds: xr.Dataset) -> tuple[Any, Any, Any]:
    """X, Y and shares of the area of points of the disc."""
    x, share = np.polynomial.legendre.leggauss(RINGS)
    r = float(ds.tool_a) * np.sqrt(0.5 * (x + 1))[:, None]
    around = np.linspace(0, 2 * np.pi, SPOKES, endpoint=False)
    return r * np.cos(around), r * np.sin(around), (0.5 * share[:, None] / SPOKES) * np.ones(SPOKES)


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with volumes worn off the work and off the tool per time [m^3/s], and the zone [m]."""
    volume = 2 * np.pi * (ds.wear * ds.radius).integrate("radius")
    zone = 2 * np.pi * (ds.wear * ds.radius**2).integrate("radius") / volume
    X, Y, share = tool_points(ds)
    motion = swings(ds)
    area = np.pi * float(ds.tool_a) ** 2
    lost = np.stack([(tool_wear(ds, motion, X, Y, beta) * share).sum(axis=(1, 2)) for beta in ds.beta.values], axis=1)
    return ds.assign(
        volume=volume, zone=zone, tool=(("e", "beta"), area * lost), low=motion.alpha.min("crank_angle"),
        high=motion.alpha.max("crank_angle"),
    )  # fmt: skip


def zones(ds: xr.Dataset) -> list[Statement]:
    """Where the work wears, by beta."""
    q = 2 * math.asin(float(ds.tool_a) / (2 * float(ds.L)))
    theory = (ds.low - q <= -ds.beta) & (-ds.beta <= ds.high + q)
    worn = ds.wear.isel(radius=0) > 0
    wrong = int((worn != theory.transpose(*worn.dims)).sum())
    small = ds.sel(e=0.04, method="nearest")
    low, high = float(small.zone.min()), float(small.zone.max())
    return [
        Statement("the centre wears where (1) says", "all cells", f"{wrong} of {worn.size} not", None, wrong == 0),
        Statement("e = 4 cm: zones by O_DH alone, 15 degree to each side", "-",
                  f"{100 * low:.1f} to {100 * high:.1f} cm", None, bool(high > 3 * low)),
        *corrected(ds),
    ]  # fmt: skip


def corrected(ds: xr.Dataset) -> list[Statement]:
    """O_DH turned so that the middle stays when the throw goes from 10 to 15 cm."""
    fixed = {name: float(ds[name]) for name in ("b", "d", "f")}
    study = sweep.study(kernel="polisher", axes={"e": [0.10, 0.15]}, fixed=fixed, outputs=["A0"], rtol=1e-12)
    first, second = np.degrees(sweep.run(study).A0.values)
    beta = first - second
    put = sweep.study(
        kernel="polisher_motion", axes={"e": [0.10, 0.15]}, outputs=["alpha"],
        fixed=fixed | {"omega": 1.0, "b_angle": float(ds.b_angle)},
        along={"crank_angle": np.linspace(0, 2 * np.pi, TURN, endpoint=False)},
    )  # fmt: skip
    alpha = np.degrees(sweep.run(put).alpha)
    middle = 0.5 * (alpha.max("crank_angle") + alpha.min("crank_angle")).values + np.array([0.0, beta])
    line = ds.zone.sel(e=0.15, method="nearest")
    shift = 100 * float(line.interp(beta=0.0) - line.interp(beta=math.radians(beta)))
    return [
        differing("middle A0, e = 10 cm [degree]", f"{A0[10.0]}", first, A0[10.0], 5e-5, 6),
        differing("middle A0, e = 15 cm", f"{A0[15.0]}", second, A0[15.0], 5e-5, 6),
        Statement("  O_DH turned by that keeps the middle [degree]", "0", f"beta = {beta:.3f}",
                  float(middle[1] - middle[0]), abs(float(middle[1] - middle[0])) < 2e-3),
        Statement("  zone with and without it, e = 15 cm", "moves", f"by {10 * shift:.1f} mm", None, abs(shift) > 0.1),
    ]  # fmt: skip


def tools(ds: xr.Dataset) -> list[Statement]:
    """What the tool loses."""
    off = float(abs(ds.tool / ds.volume - 1).max())
    rim = rims(ds)
    usual = ds.sel(e=0.10, method="nearest").sel(beta=0, method="nearest")
    total = UM_PER_HOUR * float(usual.tool) / (math.pi * float(ds.tool_a) ** 2)
    work = UM_PER_HOUR * float(usual.wear.isel(radius=0))
    uneven = {e: far / near for e, (far, near) in rim.items()}
    told = ", ".join(f"{x:.3f} at e = {100 * e:.0f} cm" for e, x in uneven.items())
    return [
        Statement("(2) over all cells", "1", "largest deviation", off, off < 2e-3),
        Statement("mean wear of the tool over the work's centre, e = 10 cm", "> 1", f"{total / work:.2f}", None,
                  total > work),
        Statement("outer rim over inner rim", "> 1 at every throw", told, None, all(x > 1 for x in uneven.values())),
    ]  # fmt: skip


def rims(ds: xr.Dataset) -> dict[float, tuple[float, float]]:
    """Wear of the rim's outermost and innermost point [m/s], by throw, at beta = 0."""
    a = float(ds.tool_a)
    ends = tool_wear(ds, swings(ds), np.array([a, -a]), np.zeros(2), 0.0)
    return {float(e): (float(far), float(near)) for e, (far, near) in zip(ds.e.values, ends, strict=True)}


def figure(ds: xr.Dataset) -> Any:
    """Profiles by beta, zones, and the tool's wear; for two columns of print."""
    with page_of(66.0, 1, 3) as (page, panels):
        draw_profiles(panels[0], ds)
        draw_zones(panels[1], ds)
        draw_tool(panels[2], ds)
    return page


def draw_profiles(axes: Any, ds: xr.Dataset) -> None:
    """Wear over the radius at the smallest throw, by beta."""
    for k, degrees in enumerate((0, 5, 10, 15)):
        line = ds.wear.isel(e=0).sel(beta=math.radians(degrees), method="nearest")
        axes.plot(100 * ds.radius, UM_PER_HOUR * line, color=COLOURS[k], linestyle=DASHES[k], label=f"{degrees}")
    axes.set(xlabel="radius [cm]", ylabel="wear [µm/h]", xlim=(0, 25), ylim=(0, None))
    axes.legend(title=r"$\beta$ [degree]", title_fontsize=7, fontsize=7)


def draw_zones(axes: Any, ds: xr.Dataset) -> None:
    """The zone over beta, by throw; filled where the centre wears."""
    for k, e in enumerate(ds.e.values):
        line = ds.sel(e=e)
        axes.plot(np.degrees(line.beta), 100 * line.zone, color=COLOURS[k], linewidth=0.8)
        worn = line.wear.isel(radius=0) > 0
        look = {"color": COLOURS[k], "linestyle": ""}
        axes.plot(np.degrees(line.beta), 100 * line.zone.where(worn), MARKS[k], label=f"{100 * e:.0f}", **look)
        axes.plot(np.degrees(line.beta), 100 * line.zone.where(~worn), MARKS[k], markerfacecolor="white", **look)
    axes.plot([], [], "o", color="black", markerfacecolor="white", label="centre not worn")
    axes.set(xlabel=r"O$_\mathrm{DH}$ turned by $\beta$ [degree]", ylabel="zone, mean radius [cm]", ylim=(0, 27))
    axes.legend(title="throw, $e$ [cm]", title_fontsize=7, fontsize=7, loc="upper center", ncols=2)


def draw_tool(axes: Any, ds: xr.Dataset) -> None:
    """Wear along the tool's diameter that lies on the arm, over its mean there, by throw."""
    x = np.linspace(-float(ds.tool_a), float(ds.tool_a), 61)
    wear = tool_wear(ds, swings(ds), x, np.zeros_like(x), 0.0)
    for k, e in enumerate(ds.e.values):
        line = wear[k] / wear[k].mean()
        axes.plot(100 * x, line, color=COLOURS[k], linestyle=DASHES[k], label=f"{100 * e:.0f}")
    axes.set(xlabel="place on the tool, outwards [cm]", ylabel="wear of the tool over its mean [1]", ylim=(0.88, 1.2))
    axes.legend(title="throw, $e$ [cm]", title_fontsize=7, fontsize=7, loc="upper left", ncols=3)


def conclude(path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = prepared(read_result(path, "polisher_wear", ["e", "beta"], "polisher_zone.toml"))
    groups = {"The zone by O_DH": zones(ds), "Wear of the tool": tools(ds)}
    return groups, [NOTES], lambda: figure(ds)


main = partial(report, __file__, ["polisher_zone.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
