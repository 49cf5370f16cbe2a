"""Which polishing machine of a wanted amplitude swings most nearly harmonically, and how far is it from locking?

    sweep run studies/polisher_design.toml
    python studies/polisher_design.py polisher_design.h5

draws polisher_design.png and prints what is concluded. For each b, d, f the crank e that makes the amplitude A1 is
found between two cranks of the sweep. A machine of that amplitude exists where A1 passes it before the crank locks; at
the border eta_minus = 0 or eta_plus = 180 degree, so that sin^2 A1 = e f/(b d) with e = d+f-b, b+f-d or b+d-f. For the
figure the crank is the root of an equation of second degree in e^2, so that no grid of cranks is seen in it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, differing, direct_label, hatch, quality_bar, read_result, report

import sweep
from sweep.show import charts
from sweep.show.charts import COLOURS, DASHES

WANTED = math.radians(15.0)
ARM = 0.38
"""The arm whose machines are mapped [m]."""
PAPER = {"b": 0.6201, "f": 0.405}
"""The paper's machine with that arm [m]."""
FINE = 2e-3
"""Steps of the figure along motor and coupler [m]."""

NOTES = """\
distortion: root of the sum of squares of the harmonics from the second on, over the first; best: least over f
allowed: 1e-12 between similar machines, 1e-3 of a distortion interpolated between cranks; the shares are of the grid;
the paper's machine holds if it runs well, each of the others if it has less distortion than the one before
transmission angle: least angle of coupler and arm over the turn; below 40 degree a linkage is held to run badly
"""


def of_amplitude(ds: xr.Dataset, wanted: float = WANTED) -> xr.Dataset:
    """Machines of one amplitude over d, b and f: every output, and the crank `e`, between two cranks of the sweep."""
    swing = ds.A1
    above = swing >= wanted
    n = above.argmax("e")
    there = above.any("e") & (n > 0)
    n = n.where(there, 1)
    share = (wanted - swing.isel(e=n - 1)) / (swing.isel(e=n) - swing.isel(e=n - 1))
    names = ("thd", "transmission_angle", "rate_max", "rate_min")
    full = ds[list(names)].assign(crank=ds.e.broadcast_like(swing))
    made = full.isel(e=n - 1) * (1 - share) + full.isel(e=n) * share
    return made.where(there).drop_vars("e").transpose("d", "b", "f")


def crank_at_border(b: Any, d: Any, f: Any) -> Any:
    """The longest crank that turns."""
    return np.minimum(np.minimum(d + f - b, b + f - d), b + d - f)


def reaches(b: Any, d: Any, f: Any, wanted: float = WANTED) -> Any:
    """Whether the amplitude is passed before the crank locks."""
    return crank_at_border(b, d, f) * f > b * d * math.sin(wanted) ** 2


def crank_of(b: Any, d: Any, f: Any, wanted: float = WANTED) -> Any:
    """The crank of one amplitude, where one reaches it.

    cos(A0 +- A1) = (b^2 + d^2 - (f +- e)^2)/(2 b d): sum and difference give cos A0 and sin A0, and the sum of their
    squares an equation of second degree in e^2.
    """
    q = b * b + d * d - f * f
    half = q - 2 * (f / math.tan(wanted)) ** 2
    rest = (2 * b * d * math.cos(wanted)) ** 2 - q * q
    return np.sqrt(rest / (np.sqrt(half * half + rest) - half))


def machines_on(b: Any, d: float, f: Any) -> xr.Dataset:
    """The machines of the wanted amplitude over b and f, as `of_amplitude`, with the crank of `crank_of`."""
    names = ["thd", "transmission_angle"]
    motor, coupler = np.meshgrid(b, f, indexing="ij")
    there = reaches(motor, d, coupler) & (crank_at_border(motor, d, coupler) > 0)
    axes = {"b": motor[there], "f": coupler[there], "e": crank_of(motor[there], d, coupler[there])}
    found = sweep.run(sweep.study(kernel="polisher", design="zip", axes=axes, fixed={"d": d}, outputs=names, rtol=1e-6))
    made = xr.Dataset(coords={"b": b, "f": f, "d": d})
    for name, values in {"crank": axes["e"], **{name: found[name].values for name in names}}.items():
        whole = np.full(there.shape, math.nan)
        whole[there] = values
        made[name] = (("b", "f"), whole)
    return made


def best(machines: xr.Dataset) -> xr.Dataset:
    """For each d and b the machine with the coupler of least distortion."""
    known = machines.thd.notnull().any("f")
    found = machines.isel(f=machines.thd.fillna(math.inf).argmin("f"))
    return found.where(known)


def existence(ds: xr.Dataset, machines: xr.Dataset) -> list[Statement]:
    """Which machines of the amplitude there are."""
    b, d, f = machines.b, machines.d, machines.f
    within = reaches(b, d, f) & (crank_at_border(b, d, f) > 0)
    within = within.transpose("d", "b", "f")
    found = machines.thd.notnull()
    strangers = int((found & ~within).sum())
    share = float(found.sum() / within.sum())
    spare = crank_at_border(b, d, f) / machines.crank - 1
    return [
        Statement("machines beyond the border", "none", f"{strangers} of {int(found.sum())}", None, strangers == 0),
        Statement("of those within it, in the sweep's cranks", "most", f"{share:.1%}", None, share > 0.5),
        Statement(
            "crank to spare before it locks, least", "> 0", f"{float(spare.min()):.2%}", None, float(spare.min()) > 0
        ),
    ]


def quality(machines: xr.Dataset) -> list[Statement]:
    """How harmonic, and at what price."""
    arm = machines.sel(d=ARM, method="nearest")
    top = best(arm)
    paper, same = arm.interp(b=PAPER["b"], f=PAPER["f"]), top.interp(b=PAPER["b"])
    reach = top.b[top.thd.notnull()]
    falls = bool((top.thd.dropna("b").diff("b").tail(b=20) < 0).all())
    widest = top.isel(b=-1)
    exact = exactly(widest, float(arm.d))
    return [
        _described("the paper's machine", paper, bool(np.degrees(paper.transmission_angle) > 40)),
        _described("best coupler for its motor's place", same, bool(same.thd < paper.thd)),
        similar(widest, float(arm.d)),
        Statement(
            "the farther the motor, in arms, the less distortion", "-",
            f"falls to the edge, b/d = {float(reach[-1] / arm.d):.3g}: no best", None, falls,
        ),
        _described(f"best of the sweep, b = {1e3 * float(widest.b):.0f}, f = {1e3 * float(widest.f):.0f} mm", widest,
                   bool(widest.thd < same.thd)),
        compared("its amplitude, degree", "15", math.degrees(exact.A1), 15.0, 1e-4, 6),
        compared("its distortion, once more", f"{float(widest.thd):.5f}", float(exact.thd), float(widest.thd), 1e-3, 5),
    ]  # fmt: skip


def exactly(machine: xr.Dataset, d: float) -> xr.Dataset:
    """The machine solved itself, not interpolated between cranks."""
    study = sweep.study(
        kernel="polisher", axes={"e": [float(machine.crank)]}, outputs=["A1", "thd"], rtol=1e-10,
        fixed={"b": float(machine.b), "d": d, "f": float(machine.f)},
    )  # fmt: skip
    return sweep.run(study).isel(e=0)


def similar(machine: xr.Dataset, d: float) -> Statement:
    """Only ratios of lengths count: a shorter arm is better as a farther motor is, and by no more."""
    lengths = {"b": float(machine.b), "d": d, "f": float(machine.f), "e": float(machine.crank)}
    axes = {name: [value, 0.789 * value] for name, value in lengths.items()}
    one, other = sweep.run(sweep.study(kernel="polisher", design="zip", axes=axes, rtol=1e-12)).thd.values
    return differing("distortion of a machine 0.789 times as large", f"{one:.6f}", float(other), float(one), 1e-12, 6)


def _described(what: str, machine: xr.Dataset, holds: bool) -> Statement:
    """Distortion, transmission angle and crank of a machine; `holds`: what is said of it in the notes."""
    angle = math.degrees(machine.transmission_angle)
    here = f"{float(machine.thd):.2%}, {angle:.0f} degree, e = {1e3 * float(machine.crank):.1f} mm"
    return Statement(what, "", here, None, holds)


def statements(ds: xr.Dataset) -> Groups:
    """Every line of the table, by heading."""
    machines = of_amplitude(ds)
    return {
        "Machines of 15 degree": existence(ds, machines),
        "Distortion, transmission angle, crank (arm 380 mm)": quality(machines),
    }


def figure(ds: xr.Dataset) -> Any:
    """Distortion over motor and coupler, with the border of lock-up; the best coupler; a cut; for a page of print."""
    b, f = (np.arange(float(x[0]), float(x[-1]) + 1e-9, FINE) for x in (ds.b, ds.f))
    arms = [machines_on(b, float(d), f) for d in ds.d]
    usual = next(arm for arm in arms if abs(arm.d - ARM) < 1e-9)
    with charts.style():
        page = charts.new_figure(charts.PAGE, 96.0)
        left, right = page.subfigures(1, 2, width_ratios=(1.2, 1))
        whole = left.subplots()
        upper, lower = right.subplots(2, 1)
        draw_map(left, whole, usual)
        draw_best(upper, arms)
        draw_cut(lower, machines_on(np.array([PAPER["b"]]), ARM, f).isel(b=0))
        for axes, text in ((whole, "a"), (upper, "b"), (lower, "c")):
            charts.letter(axes, text)
    return page


def draw_map(page: Any, axes: Any, arm: xr.Dataset) -> None:
    """Distortion over b and f for one arm, the crank it takes, and where the motor locks instead."""
    from matplotlib.colors import LogNorm
    from matplotlib.lines import Line2D

    b, f = 1e3 * arm.b.values, 1e3 * arm.f.values
    thd = 100 * arm.thd.transpose("f", "b").values
    mesh = axes.pcolormesh(b, f, thd, norm=LogNorm(2, 40), cmap="cividis_r", shading="nearest", rasterized=True)
    bar = quality_bar(page, mesh, axes, "distortion [%]", pad=0.02, extend="both")
    bar.set_ticks([2, 5, 10, 20, 40], labels=["2", "5", "10", "20", "40"])
    bar.minorticks_off()
    lines = axes.contour(b, f, 1e3 * arm.crank.transpose("f", "b").values, [50, 70, 90], colors="white", linewidths=0.6)
    axes.clabel(lines, fmt="%g", fontsize=7, manual=[(470, 740), (560, 740), (690, 740)])
    hatch(axes, b, f, np.isnan(thd), "////")
    top = best(arm)
    axes.plot(b, 1e3 * top.f.where(top.thd.notnull()), "k--", linewidth=0.9, label="coupler of least distortion")
    axes.plot(1e3 * PAPER["b"], 1e3 * PAPER["f"], "o", color="white", markeredgecolor="black", markersize=5,
              label="the paper's machine")  # fmt: skip
    keys = [*axes.lines, Line2D([], [], color="0.6", linewidth=0.8, label="crank [mm] (white)")]
    page.legend(handles=keys, loc="outside lower center", ncols=2, fontsize=7)
    direct_label(axes, 700, 170, "motor locks")
    axes.set(xlabel="motor from pivot, $b$ [mm]", ylabel="coupler, $f$ [mm]", xlim=(b[0], b[-1]), ylim=(f[0], f[-1]))


def draw_best(axes: Any, arms: Sequence[xr.Dataset]) -> None:
    """The least distortion over all couplers, for each arm."""
    for k, arm in enumerate(arms):
        top = best(arm)
        look = {"color": COLOURS[k], "linestyle": DASHES[k]}
        axes.plot(1e3 * top.b, 100 * top.thd, label=f"$d={1e3 * float(arm.d):.0f}$ mm", **look)
    axes.set(xlabel="motor from pivot, $b$ [mm]", ylabel="least distortion [%]", yscale="log")
    axes.set_yticks([2, 5, 10, 20, 40], labels=["2", "5", "10", "20", "40"])
    axes.minorticks_off()
    axes.legend(loc="upper right")


def draw_cut(axes: Any, cut: xr.Dataset) -> None:
    """Distortion and transmission angle over the coupler, with motor and arm of the paper's machine."""
    f = 1e3 * cut.f
    axes.plot(f, 100 * cut.thd, color=COLOURS[0], label="distortion [%]")
    axes.plot(f, np.degrees(cut.transmission_angle), "--", color=COLOURS[1], label="transmission angle [degree]")
    axes.axvline(1e3 * PAPER["f"], color="0.5", linewidth=0.8, linestyle=":", label="the paper's coupler")
    axes.set(xlabel="coupler, $f$ [mm]", ylabel="[%], [degree]", ylim=(0, 75), xlim=(300, 800))
    axes.legend(loc="center right", bbox_to_anchor=(1.0, 0.36), fontsize=7)


def conclude(path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = read_result(path, "polisher", ["d", "b", "f", "e"], "polisher_design.toml")
    return statements(ds), [NOTES], lambda: figure(ds)


main = partial(report, __file__, ["polisher_design.h5"], conclude=conclude, source="expected")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
