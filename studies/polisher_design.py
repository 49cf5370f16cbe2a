"""Which polishing machine of a wanted amplitude swings most nearly harmonically, and how far is it from locking?

    python studies/polisher_design.py polisher_design.h5

For each b, d, f the crank e that makes the amplitude A1 is found between two cranks of the sweep, for the figure as a
root. A machine of that amplitude exists where A1 passes it before the crank locks; at the border eta_minus = 0 or
eta_plus = 180 degree, so that sin^2 A1 = e f/(b d) with e = d+f-b, b+f-d or b+d-f.

The distortion is the root of the sum of squares of the harmonics from the second on, over the first. The paper's
machine holds if it runs well, and each of the others if it has less distortion than the one before. The transmission
angle is the least angle of coupler and arm over the turn; below 40 degree a linkage is held to run badly.
"""

import math

import numpy as np
import xarray as xr
from _common import Claims, Statement, compared, held, never, said, script, solved
from _figures import COLOURS, DASHES, Axis, Log, LogNorm, colour_map, contours, direct_label, hatch, page, panel

WANTED = math.radians(15.0)
ARM = 0.38
"""The arm whose machines are mapped [m]."""
PAPER = {"b": 0.6201, "f": 0.405}
"""The paper's machine with that arm [m]."""


def of_amplitude(ds: xr.Dataset) -> xr.Dataset:
    """Machines of the amplitude over d, b and f: every output, and the crank `e`, between two cranks of the sweep."""
    above = ds.A1 >= WANTED
    n = above.argmax("e")
    there = above.any("e") & (n > 0)
    n = n.where(there, 1)
    low, high = ds.A1.isel(e=n - 1), ds.A1.isel(e=n)
    share = (WANTED - low) / (high - low)
    full = ds[["thd", "transmission_angle"]].assign(crank=ds.e.broadcast_like(ds.A1))
    made = full.isel(e=n - 1) * (1 - share) + full.isel(e=n) * share
    return made.where(there).drop_vars("e").transpose("d", "b", "f")


def exists(b, d, f):
    """Whether the amplitude is passed before the longest crank that turns locks."""
    longest = np.minimum(np.minimum(d + f - b, b + f - d), b + d - f)
    return (longest * f > b * d * math.sin(WANTED) ** 2) & (longest > 0)


def exactly(ds: xr.Dataset, d: float) -> xr.Dataset:
    """The machines of one arm, as `of_amplitude`, in steps of 2 mm, with the root of their crank.

    cos(A0 +- A1) = (b^2 + d^2 - (f +- e)^2)/(2 b d): sum and difference give cos A0 and sin A0, and the sum of their
    squares an equation of second degree in e^2.
    """
    fine = {name: np.arange(float(ds[name][0]), float(ds[name][-1]) + 1e-9, 2e-3) for name in ("b", "f")}
    b, f = xr.broadcast(*(xr.DataArray(x, {name: x}) for name, x in fine.items()))
    q = (b * b + d * d - f * f).where(exists(b, d, f))
    half = q - 2 * (f / math.tan(WANTED)) ** 2
    rest = (2 * b * d * math.cos(WANTED)) ** 2 - q * q
    crank = np.sqrt(rest / (np.sqrt(half * half + rest) - half)).stack(cell=("b", "f")).dropna("cell")
    lengths = {"b": crank.b.values, "d": d, "f": crank.f.values, "e": crank.values}
    found = solved("polisher", design="zip", outputs=["thd"], rtol=1e-6, **lengths)
    return xr.Dataset({"crank": crank, "thd": crank.copy(data=found.thd.values)}).unstack("cell").reindex(fine)


def best(machines: xr.Dataset) -> xr.Dataset:
    """For each d and b the machine with the coupler of least distortion."""
    known = machines.thd.notnull().any("f")
    return machines.isel(f=machines.thd.fillna(math.inf).argmin("f")).where(known)


def claims(ds) -> Claims:
    machines = of_amplitude(ds)
    yield "Machines of 15 degree"
    within = exists(machines.b, machines.d, machines.f).transpose("d", "b", "f")
    found = machines.thd.notnull()
    yield never("machines beyond the border", found & ~within)
    yield held("of those within it, in the sweep's cranks", found.sum() / within.sum(), "> 1/2", "{:.1%}")

    yield "Distortion, transmission angle, crank (arm 380 mm)"
    arm = machines.sel(d=ARM, method="nearest")
    top, paper = best(arm), arm.interp(b=PAPER["b"], f=PAPER["f"])
    same, widest = top.interp(b=PAPER["b"]), top.isel(b=-1)
    reach = float(top.b[top.thd.notnull()][-1] / arm.d)
    falls = (top.thd.dropna("b").diff("b").tail(b=20) < 0).all()
    lengths = {"b": float(widest.b), "d": float(arm.d), "f": float(widest.f), "e": float(widest.crank)}
    exact = solved("polisher", outputs=["A1", "thd"], rtol=1e-10, **{**lengths, "e": [lengths["e"]]}).isel(e=0)

    def described(what: str, machine: xr.Dataset, holds) -> Statement:
        angle, crank = math.degrees(machine.transmission_angle), 1e3 * float(machine.crank)
        return said(what, holds, f"{float(machine.thd):.2%}, {angle:.0f} degree, e = {crank:.1f} mm")

    far = f"best of the sweep, b = {1e3 * float(widest.b):.0f}, f = {1e3 * float(widest.f):.0f} mm"
    to_edge, again = f"falls to the edge, b/d = {reach:.3g}: no best", f"{float(widest.thd):.5f}"
    yield described("the paper's machine", paper, np.degrees(paper.transmission_angle) > 40)
    yield described("best coupler for its motor's place", same, same.thd < paper.thd)
    yield said("the farther the motor, in arms, the less distortion", falls, to_edge, "-")
    yield described(far, widest, widest.thd < same.thd)
    yield compared("its amplitude, degree", "15", math.degrees(exact.A1), 15.0, 1e-4)
    yield compared("its distortion, once more", again, float(exact.thd), float(widest.thd), 1e-3)


MAP = "distortion [%]", {"extend": "both", "ticks": {2: "2", 5: "5", 10: "10", 20: "20", 40: "40"}}
MOTOR = Axis("motor from pivot, $b$ [mm]")


@panel(MOTOR, Axis("coupler, $f$ [mm]"), "upper left", frameon=True, framealpha=0.85)
@panel(MOTOR, Log("least distortion [%]", (1.5, 15), (2, 5, 10)), "upper right")
@page(156.0, height_ratios=(1.5, 1))
def figure(plane, best_of, ds):
    """Distortion over motor and coupler, with the border of lock-up and the crank; the best coupler."""
    arms = [exactly(ds, float(d)) for d in ds.d]
    for arm, d, colour, dashes in zip(arms, ds.d.values, COLOURS, DASHES, strict=False):
        look = {"label": f"$d={1e3 * d:.0f}$ mm", "color": colour, "linestyle": dashes}
        best_of.plot(1e3 * arm.b, 100 * best(arm).thd, **look)
    arm = arms[int(abs(ds.d.values - ARM).argmin())].transpose("f", "b")
    x, y, thd, top = 1e3 * arm.b.values, 1e3 * arm.f.values, 100 * arm.thd.values, best(arm)
    colour_map(plane, x, y, thd, *MAP, norm=LogNorm(2, 40), cmap="cividis_r")
    e, where = 1e3 * arm.crank.values, [(275, 330), (350, 330)]
    contours(plane, x, y, e, [70, 90], linewidths=0.6, fmt="$e$ = %g mm", fontsize=8, manual=where)
    hatch(plane, x, y, np.isnan(thd), "////")
    plane.plot(x, 1e3 * top.f.where(top.thd.notnull()), "k--", linewidth=0.9, label="least distortion")
    look = {"color": "white", "markeredgecolor": "black", "markersize": 5, "linestyle": ""}
    plane.plot(1e3 * PAPER["b"], 1e3 * PAPER["f"], "o", label="the paper's machine", **look)
    direct_label(plane, 700, 170, "motor locks")


main = script(__name__, "polisher_design.h5", claims, figure, source="expected")
