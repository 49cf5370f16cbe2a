"""What does Bürgi's cross-beat, two geared foliots instead of one, do to the period and its exponents?

    sweep run studies/cross_beat.toml --allow-import
    python studies/cross_beat.py cross_beat.h5

draws cross_beat.png and prints theory beside what comes out. Hoyng & Nieuwenhuizen ("the paper") call it a detail.
Theory, derived here: rigid gears leave one angle, and (1) + (2) of `cross_beat_scene` is a single foliot with

    I = I_l + I_r,  c = c_l + c_r,  R = R_l + R_r,  the torque of one,                                   (1)

so P is that of `foliot` with a = c/I, mu = tau/I, and every exponent is the same function of alpha = tau/(I a^2 phi0).
Gears of finite stiffness k wind up by tau/(2 k), for half the torque is passed on; so the teeth leave when the mean of
both is tau/(4 k) short of phi0, and P depends on phi0 as phi0^s:

    dP/P = -s tau/(4 k phi0).                                                                            (2)

A case that turns with the acceleration w pushes the two against each other: -(I_l - I_r) w is left of the -I w that
shakes one foliot, nothing if they are equal.                                                            (3)
"""

from __future__ import annotations

import math
import sys
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, differing, page_of, plain_ticks, read_result, report

import sweep
from sweep.show.charts import COLOURS, MARKS

SMALL = 1e-3
"""Wind-up tau/(4 k phi0) up to which (2) is held to `FIRST` of itself."""
FIRST = 0.01
ALPHA = 30.0
"""Bürgi's drive."""
SWAY, NU = 0.1, 1.3
"""Acceleration of the case [rad/s^2] and its angular frequency [rad/s]."""
SHARES = (0.0, 0.2, 0.5, 0.9)
"""(I_l - I_r)/(I_l + I_r) of the clocks that are shaken."""

NOTES = """\
s = -dlnP/dlntau; deviation: relative, of exponents the difference
allowed: 1 % of (2) where the wind-up is under 1e-3, and 0.01 of its power of k; 0.005 of s, of which (2) explains
0.002; 1e-3 of other periods and slopes, whose gear of 1 N m/rad winds up by 7e-4; 1 % of (3), and 1e-3 of one foliot's
scatter for equal ones, whose gear gives way a little\
"""


def single(tau: Any, inertia: float, c: float, phi0: float, R: float = 0.0) -> xr.Dataset:
    """`foliot` with this moment of inertia and frictions c and R."""
    study = sweep.study(
        kernel="foliot", axes={"mu": (np.atleast_1d(tau) / inertia).tolist()}, rtol=1e-12,
        fixed={"a": c / inertia, "phi0": phi0, "R": R / inertia}, outputs=["period", "sensitivity"],
    )  # fmt: skip
    return sweep.run(study).rename(mu="tau").assign_coords(tau=np.atleast_1d(tau))


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with alpha, the single foliot's `alone` and `s`, the deviation `off` from it, and the wind-up."""
    inertia, c = float(ds.I_l + ds.I_r), float(ds.c_l + ds.c_r)
    one = single(ds.tau.values, inertia, c, float(ds.phi0))
    return ds.assign_coords(alpha=ds.tau * inertia / (c**2 * ds.phi0)).assign(
        period=2 * ds.interval, alone=one.period, s=one.sensitivity, off=2 * ds.interval / one.period - 1,
        wound=ds.tau / (4 * ds.stiffness * ds.phi0),
    )  # fmt: skip


def pair(ds: xr.Dataset, **changed: Any) -> xr.Dataset:
    """Bürgi's clock with the stiffest gear and what is changed of it; lists are axes of a zip design."""
    names = ("I_l", "I_r", "c_l", "c_r", "phi0", "damper", "flips")
    known: dict[str, Any] = {name: float(ds[name]) for name in names} | {"stiffness": float(ds.stiffness[-1])}
    known["tau"] = ALPHA * float((ds.c_l + ds.c_r) ** 2 * ds.phi0 / (ds.I_l + ds.I_r))
    known |= changed
    axes = {name: value for name, value in known.items() if isinstance(value, list)}
    fixed = {name: value for name, value in known.items() if name not in axes}
    study = sweep.study(
        kernel="cross_beat_scene:KERNEL", design="zip", axes=axes, fixed=fixed, rtol=1e-8, outputs=["interval"],
        allow_import=True,
    )  # fmt: skip
    return sweep.run(study)


def usual(ds: xr.Dataset) -> xr.Dataset:
    """The torque of Bürgi's clock."""
    return ds.isel(tau=int(abs(ds.alpha - ALPHA).argmin("tau")))


def as_one(ds: xr.Dataset) -> list[Statement]:
    """The pair beside one foliot of the sums."""
    law = -ds.s * ds.wound
    first = (ds.off / law).where(ds.wound < SMALL)
    stiff = ds.isel(stiffness=-1)
    turned = float(np.abs(np.gradient(stiff.off, np.log(ds.tau.values))).max())
    middle = usual(ds).off
    power = np.polyfit(np.log(ds.stiffness.values), np.log(-middle.values), 1)[0].item()
    return [
        Statement(f"(2), wind-up < {SMALL:g}: {int(first.notnull().sum())} cells", "1", "largest deviation",
                  float(abs(first - 1).max()), bool(abs(first - 1).max() < FIRST)),
        differing("  power of the stiffness in it", "-1", power, -1, 0.01, 5),
        Statement("exponents, gear of 1 N m/rad, alpha .3 to 300", "a detail (paper)", "largest difference from (1)",
                  turned, turned < 5e-3),
        doubled(ds),
    ]  # fmt: skip


def doubled(ds: xr.Dataset) -> Statement:
    """What a second foliot like the first does at the same torque: alpha halves, so P grows by 2^s, s between both."""
    one = single(ds.tau.values, float(ds.I_l), float(ds.c_l), float(ds.phi0))
    grown = np.log2(ds.period.isel(stiffness=-1) / one.period)
    inside = (grown > one.sensitivity - 5e-3) & (grown < ds.s + 5e-3)
    text = f"2^{float(grown[0]):.3f} to 2^{float(grown[-1]):.3f}"
    return Statement("a second foliot like the first: P grows by", "2^s", text, None, bool(inside.all()))


def sums(ds: xr.Dataset) -> list[Statement]:
    """Only the sums count: friction of one or of both, weights moved on one."""
    inertia, c, phi0 = float(ds.I_l + ds.I_r), float(ds.c_l + ds.c_r), float(ds.phi0)
    tau = ALPHA * c**2 * phi0 / inertia
    R = 0.2 * tau
    made = pair(ds, c_l=[c, c / 2, c / 2], c_r=[0.0, c / 2, c / 2], R_l=[0.0, R, R / 2], R_r=[0.0, 0.0, R / 2])
    P = 2 * made.interval.values
    smooth, rough = (float(single(tau, inertia, c, phi0, x).period[0]) for x in (0.0, R))
    h = 0.01
    moved = pair(ds, I_l=[inertia / 2 * math.exp(x) for x in (-h, h)])
    rise = float(np.log(moved.interval[1] / moved.interval[0]) / (2 * h))
    s = float(single(tau, inertia, c, phi0).sensitivity[0])
    return [
        compared("viscous friction of one alone: P [s]", f"{smooth:.5f}", P[0], smooth, 1e-3, 6),
        compared("dry friction of one, a fifth of the torque", f"{rough:.5f}", P[1], rough, 1e-3, 6),
        compared("  half of it of each", f"{rough:.5f}", P[2], rough, 1e-3, 6),
        differing("weights moved on one: dlnP/dlnI_l", f"(1 - s)/2 = {(1 - s) / 2:.4f}", rise, (1 - s) / 2, 1e-3, 4),
    ]  # fmt: skip


def shaken(ds: xr.Dataset) -> xr.DataArray:
    """Forty half swings of clocks on a swaying case [s], over share and swing."""
    inertia, swings = float(ds.I_l + ds.I_r), list(range(61, 101))
    rows = [
        pair(
            ds, flips=swings, I_l=0.5 * inertia * (1 + x), I_r=0.5 * inertia * (1 - x), sway=SWAY, nu=NU
        ).interval.values
        for x in SHARES
    ]
    return xr.DataArray(np.array(rows), {"share": list(SHARES), "swing": swings}, ("share", "swing"))


def steadied(halves: xr.DataArray) -> list[Statement]:
    """(3): scatter of the half swings."""
    scatter = halves.std("swing")
    unit = scatter[1:] / scatter.share[1:]
    even = float(abs(unit / unit.mean() - 1).max())
    left = float(scatter[0] / unit.mean())
    return [
        Statement(
            "scatter of half swings over (I_l - I_r)/(I_l + I_r) [s]", "one number, (3)", f"{float(unit.mean()):.3e}",
            even, even < 0.01,
        ),
        Statement("  of equal foliots, over that", "0", f"{float(scatter[0]):.1e} s", left, left < 1e-3),
    ]  # fmt: skip


def figure(ds: xr.Dataset, halves: xr.DataArray) -> Any:
    """Period, what the gear's wind-up does to it, and half swings on a swaying case; for two columns of print."""
    with page_of(68.0, 1, 3) as (page, panels):
        draw_period(panels[0], ds)
        draw_wound(panels[1], ds)
        draw_shaken(panels[2], halves)
    return page


def draw_period(axes: Any, ds: xr.Dataset) -> None:
    """The pair's period, with one foliot of the sums and one of the two alone."""
    one = single(ds.tau.values, float(ds.I_l), float(ds.c_l), float(ds.phi0))
    axes.loglog(ds.alpha, ds.alone, color=COLOURS[0], label="one foliot, (1)")
    axes.loglog(ds.alpha, one.period, color=COLOURS[1], linestyle=(0, (5, 1.5)), label="one of the two alone")
    look = {"color": "black", "markerfacecolor": "white", "linestyle": "", "markersize": 4}
    axes.plot(ds.alpha, ds.period.isel(stiffness=-1), "o", label="cross-beat", **look)
    axes.set(xlabel=r"drive, $\alpha$ [1]", ylabel="period, $P$ [s]", ylim=(0.5, 60))
    axes.legend(loc="upper right", fontsize=7)


def draw_wound(axes: Any, ds: xr.Dataset) -> None:
    """How much sooner the teeth leave, with (2)."""
    for k, stiffness in enumerate(ds.stiffness.values):
        line = ds.sel(stiffness=stiffness)
        axes.loglog(ds.alpha, line.s * line.wound, color=COLOURS[k], label=f"{stiffness:g}")
        axes.plot(ds.alpha, -line.off, MARKS[k], color=COLOURS[k], markerfacecolor="white")
    axes.plot([], [], color="black", label="(2)")
    axes.plot([], [], "o", color="black", markerfacecolor="white", label="scene")
    axes.set(xlabel=r"drive, $\alpha$ [1]", ylabel=r"gain, $-\Delta P/P$ [1]")
    axes.legend(title="gear [N m/rad]", loc="upper left", fontsize=7, title_fontsize=7, ncols=2)


def draw_shaken(axes: Any, halves: xr.DataArray) -> None:
    """Half swings on a swaying case."""
    for k, share in enumerate(halves.share.values[::-1]):
        line = halves.sel(share=share)
        away = 1e3 * (line - line.mean())
        axes.plot(line.swing - 60, away, MARKS[k] + "-", color=COLOURS[k], markersize=2.5, linewidth=0.6,
                  label=f"{share:g}")  # fmt: skip
    axes.set(xlabel="half swing [1]", ylabel="half swing less its mean [ms]", xlim=(0, 41), ylim=(-14, 24))
    axes.legend(title=r"$(I_\mathrm{l}-I_\mathrm{r})/(I_\mathrm{l}+I_\mathrm{r})$", loc="upper center", fontsize=7,
                title_fontsize=7, ncols=4, columnspacing=0.8, handlelength=1.2)  # fmt: skip
    plain_ticks(axes.yaxis, (-10, 0, 10))


def conclude(path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = prepared(read_result(path, "cross_beat_scene:KERNEL", ["stiffness", "tau"], "cross_beat.toml"))
    halves = shaken(ds)
    groups = {
        "Two as one": as_one(ds),
        "Only the sums count (alpha = 30)": sums(ds),
        f"A case that sways by {SWAY:g} rad/s^2": steadied(halves),
    }
    return groups, [NOTES], lambda: figure(ds, halves)


main = partial(report, __file__, ["cross_beat.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
