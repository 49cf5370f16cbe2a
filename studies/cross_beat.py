"""What does Bürgi's cross-beat, two geared foliots instead of one, do to the period and its exponents?

    python studies/cross_beat.py cross_beat.h5

Hoyng & Nieuwenhuizen ("the paper") call it a detail. Theory, derived here: rigid gears leave one angle, and (1) + (2)
of `cross_beat_scene` is a single foliot with

    I = I_l + I_r,  c = c_l + c_r,  R = R_l + R_r,  the torque of one,                                   (1)

so P is that of `foliot` with a = c/I, mu = tau/I, and every exponent is the same function of alpha = tau/(I a^2 phi0).
Gears of finite stiffness k wind up by tau/(2 k), for half the torque is passed on; so the teeth leave when the mean of
both is tau/(4 k) short of phi0, and P depends on phi0 as phi0^s:

    dP/P = -s tau/(4 k phi0).                                                                            (2)

A case that turns with the acceleration w pushes the two against each other: -(I_l - I_r) w is left of the -I w that
shakes one foliot, nothing if they are equal.                                                            (3)

Here s = -dlnP/dlntau, of which (2) explains 0.002; a gear of 1 N m/rad winds up by 7e-4, and that of equal foliots
gives way a little.
"""

import math
from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, compared, count, differing, most, power, said, script, solved
from _figures import ALPHA, COLOURS, Log, page, panel, points

SMALL = 1e-3
"""Wind-up tau/(4 k phi0) up to which (2) is checked."""
HIS = 30.0
"""alpha of Bürgi's drive."""
SCENE = {"marker": "o", "markerfacecolor": "white", "linestyle": ""}
SWAY, NU = 0.1, 1.3
"""Acceleration of the case [rad/s^2] and its angular frequency [rad/s]."""
SHARES = (0.0, 0.2, 0.5, 0.9)
"""(I_l - I_r)/(I_l + I_r) of the clocks that are shaken."""


def single(tau, inertia: float, c: float, phi0: float, R: float = 0.0) -> xr.Dataset:
    """`foliot` with this moment of inertia and frictions c and R."""
    tau = np.atleast_1d(tau)
    fixed = {"a": c / inertia, "phi0": phi0, "R": R / inertia}
    found = solved("foliot", mu=tau / inertia, **fixed, rtol=1e-12, outputs=["period", "sensitivity"])
    return found.rename(mu="tau").assign_coords(tau=tau)


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with alpha, the periods of one foliot of the `sums` and of the left one `alone`, and the wind-up.

    `s` is that of the sums, `s_alone` the other's, and `off` the deviation of the pair from one of the sums.
    """
    inertia, c, phi0 = float(ds.I_l + ds.I_r), float(ds.c_l + ds.c_r), float(ds.phi0)
    one, left = single(ds.tau, inertia, c, phi0), single(ds.tau, float(ds.I_l), float(ds.c_l), phi0)
    ds = ds.assign_coords(alpha=ds.tau * inertia / (c**2 * ds.phi0)).assign(period=2 * ds.interval)
    ds = ds.assign(sums=one.period, alone=left.period, s=one.sensitivity, s_alone=left.sensitivity)
    return ds.assign(off=ds.period / ds.sums - 1, wound=ds.tau / (4 * ds.stiffness * ds.phi0))


def pair(ds: xr.Dataset, **changed) -> xr.Dataset:
    """Bürgi's clock with the stiffest gear and what is changed of it; lists are axes of a zip design."""
    known: dict[str, Any] = {name: ds[name] for name in ("I_l", "I_r", "c_l", "c_r", "phi0", "damper", "flips")}
    known |= {"stiffness": ds.stiffness[-1], "tau": HIS * (ds.c_l + ds.c_r) ** 2 * ds.phi0 / (ds.I_l + ds.I_r)}
    study = {"design": "zip", "rtol": 1e-8, "outputs": ["interval"]}
    return solved("cross_beat_scene:KERNEL", **(known | changed), **study)


def claims(ds) -> Claims:
    yield "Two as one"
    # A second foliot like the first halves alpha at the same torque, so P grows by 2^s, s between both.
    first = (ds.off / (-ds.s * ds.wound)).where(ds.wound < SMALL)
    stiff = ds.isel(stiffness=-1)
    turned = np.gradient(stiff.off, np.log(ds.tau.values))
    usual = ds.off.isel(tau=int(abs(ds.alpha - HIS).argmin("tau")))
    grown = np.log2(stiff.period / ds.alone)
    yield most(f"(2), wind-up < {SMALL:g}: {count(first)}", "1", first - 1, 0.01)
    yield differing("  power of the stiffness in it", "-1", power(usual), -1, 0.01)
    yield most("exponents, gear of 1 N m/rad, alpha .3 to 300, against (1)", "a detail (paper)", turned, 5e-3)
    inside = ((grown > ds.s_alone - 5e-3) & (grown < ds.s + 5e-3)).all()
    yield said("a second foliot like the first: P grows by", inside, f"2^{grown[0]:.3f} to 2^{grown[-1]:.3f}", "2^s")

    yield "Only the sums count (alpha = 30)"
    inertia, c, phi0 = float(ds.I_l + ds.I_r), float(ds.c_l + ds.c_r), float(ds.phi0)
    tau = HIS * c**2 * phi0 / inertia
    R = 0.2 * tau
    made = pair(ds, c_l=[c, c / 2, c / 2], c_r=[0.0, c / 2, c / 2], R_l=[0.0, R, R / 2], R_r=[0.0, 0.0, R / 2])
    smooth, rough = (single(tau, inertia, c, phi0, x).isel(tau=0) for x in (0.0, R))
    names = "viscous friction of one alone: P [s]", "dry friction of one, a fifth of the torque", "  half of it of each"
    for what, P, one in zip(names, 2 * made.interval, (smooth, rough, rough), strict=True):
        yield compared(what, f"{one.period:.5f}", P, float(one.period), 1e-3)
    h, kept = 0.01, (1 - float(smooth.sensitivity)) / 2
    moved = pair(ds, I_l=[inertia / 2 * math.exp(x) for x in (-h, h)])
    rise = np.log(moved.interval[1] / moved.interval[0]) / (2 * h)
    yield differing("weights moved on one: dlnP/dlnI_l", f"(1 - s)/2 = {kept:.4f}", rise, kept, 1e-3)

    yield f"A case that sways by {SWAY:g} rad/s^2"
    half, swings = 0.5 * inertia, list(range(61, 101))
    clocks = [pair(ds, flips=swings, I_l=half * (1 + x), I_r=half * (1 - x), sway=SWAY, nu=NU) for x in SHARES]
    scatter = np.array([float(clock.interval.std()) for clock in clocks])
    unit = scatter[1:] / SHARES[1:]
    what = "scatter of half swings over (I_l - I_r)/(I_l + I_r) [s]"
    yield most(what, "one number, (3)", unit / unit.mean() - 1, 0.01, f"{unit.mean():.3e}")
    yield most("  of equal foliots, over that", "0", scatter[0] / unit.mean(), 1e-3, f"{scatter[0]:.1e} s")


GAIN, KEY = Log(r"gain, $-\Delta P/P$ [1]"), {"(2)": "-", "scene": SCENE}


@panel(Log(), Log("period, $P$ [s]", (0.5, 60)), "upper right")
@panel(ALPHA, GAIN, "upper left", KEY, title="gear [N m/rad]", ncols=2)
@page(132.0, sharex=True)
def figure(period, wound, ds):
    """Period, and what the gear's wind-up does to it."""
    period.plot(ds.alpha, ds.sums, color=COLOURS[0], label="one foliot, (1)")
    period.plot(ds.alpha, ds.alone, "--", color=COLOURS[1], label="one of the two alone")
    period.plot(ds.alpha, ds.period.isel(stiffness=-1), color="black", label="cross-beat", **SCENE)
    for k, stiffness in enumerate(ds.stiffness.values):
        line = ds.sel(stiffness=stiffness)
        wound.plot(ds.alpha, line.s * line.wound, color=COLOURS[k], label=f"{stiffness:g}")
        points(wound, ds.alpha, -line.off, k, markersize=4)


main = script(__name__, "cross_beat.h5", claims, figure, prepared)
