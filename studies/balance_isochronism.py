"""At which amplitude does the rate of a driven balance not depend on its drive?

    python studies/balance_isochronism.py balance_isochronism.h5 balance_isochronism_lift.h5 \\
        balance_isochronism_positions.h5

Theory, derived here: on its way to the right solid friction shifts the centre of the swing to -r, and about it the
motion is linear. An impulse there changes the speed and not the phase (Airy's condition), so the period is 2
pi/omega_d whatever drive, amplitude and friction. Elsewhere, the impulse being w = 2 r a + pi zeta a^2 and turning the
phase by -(at + r) w/(a^2 v), light losses lose

    dP/P = (r + at)(2 r/(pi a) + zeta)/a,  a the amplitude,                                              (1)

which falls with the amplitude for any other `at`. What is out of poise adds dP/P = -poise cos(hang) J1(a)/a, without
the sign of `at` or the drive in it, and vanishes where J1 does, at a = 3.832 rad, 220 degree.

The loss is how much slower than 2 pi/omega_d the balance goes, in s a day. (1) is held to at amplitudes over 20 r and
20 abs(at); grids of m can tell 2 % of the least drive.
"""

import math

import numpy as np
import xarray as xr
from _common import DAY, Claims, Statement, count, differing, held, most, never, script, solved
from _figures import COLOURS, DASHES, HOLLOW, Axis, Log, direct_label, page, panel, points
from scipy.special import j1, jn_zeros

import sweep


def reach(ds: xr.Dataset) -> xr.DataArray:
    """Amplitude [rad] behind the last impulse: the peak of a damped swing about -r."""
    root = np.sqrt(1 - ds.zeta**2)
    u = -ds.angle + ds.r if "at" not in ds.coords else ds["at"] + ds.r
    v = np.sqrt(ds.speed**2 + 2 * ds.w * ds.omega_n**2) / ds.omega_n
    swing, lead = np.hypot(u, (v + ds.zeta * u) / root), np.arctan2((v + ds.zeta * u) / root, u)
    late = lead - np.arctan(ds.zeta / root)
    return root * swing * np.exp(-ds.zeta / root * late) - ds.r


def lost(ds: xr.Dataset, period: xr.DataArray) -> xr.DataArray:
    """Loss against 2 pi/omega_d [s/day]."""
    free = 2 * math.pi / (ds.omega_n * np.sqrt(1 - ds.zeta**2))
    return (DAY * (period / free - 1)).assign_attrs(units="s/day")


def theory(ds: xr.Dataset) -> xr.DataArray:
    """(1) in s/day."""
    return DAY * (ds.r + ds["at"]) * (2 * ds.r / (math.pi * ds.a) + ds.zeta) / ds.a


def prepared(ds, lift, hung):
    """The three sweeps with the amplitude `a` behind an impulse and the loss."""
    ds, hung = (part.assign(a=reach(part), loss=lost(part, part.clock)) for part in (ds, hung))
    lift = lift.assign(loss=lost(lift, lift.period))
    hung = hung.assign_coords(a0=("w", hung.a.isel(hang=1).values))
    return ds, lift, hung


def slowest(lift: xr.Dataset, beta) -> tuple[xr.Dataset, xr.Dataset]:
    """The balance of most solid friction on this lift, and its torque of the greatest loss."""
    line = lift.sel(beta=beta).isel(r=-1)
    return line, line.isel(m=int(line.loss.fillna(-1.0).argmax("m")))


def claims(ds, lift, hung) -> Claims:
    yield "Impulses before, at and behind the centre"
    before = ds["at"] + ds.r
    still, away = ds.where(abs(before) < 1e-12), ds.where(abs(before) > 1e-3)
    span = still.a.where(still.loss.notnull())
    ratio = (away.loss / theory(away)).where(away.a > 20 * np.maximum(abs(away["at"]), away.r))
    middle = ds.sel(at=0, method="nearest")
    made = solved("balance_driven", r=ds.r.values, w=ds.w.values, zeta=ds.zeta, omega_n=ds.omega_n, rtol=1e-12)
    what = f"at = -r: loss at every drive, a = {float(span.min()):.2f} to {float(span.max()):.2f} rad [s/day]"
    yield most(what, "0", still.loss, 1e-3, "at most")  # the sweep is right to 1e-6 s/day
    yield most(f"elsewhere (1), a > 20 r, 20 abs(at): {count(ratio)}", "1", ratio - 1, 0.02)
    yield never("  amplitudes at which the loss is stationary", away.loss.diff("w") * np.sign(before) > 0)
    yield most("at = 0: period by `balance_driven`", "the same", middle.clock / made.period - 1, 1e-6)
    yield most("  amplitude", "the same", middle.a / made.amplitude - 1, 1e-6)

    yield "A lift"
    for beta in lift.beta.values:
        line, top = slowest(lift, beta)
        least = top.m / line.m[int(line.amplitude.notnull().argmax("m"))]
        what = f"lift +-{math.degrees(beta):.0f} degree: amplitude of the greatest loss, over the lift"
        here = (
            f"{{:.2f}}: {top.loss:.0f} s/day at {np.degrees(top.amplitude):.0f} degree, m {least:.2f} times the least"
        )
        yield held(what, top.amplitude / beta, "1.1 to 2", here)
    free = lift.sel(r=0).loss
    yield never("no solid friction: torques at which a lift loses", free >= 0)
    yield Statement("  what it gains at most [s/day]", "", f"{-float(free.min()):.2f}")

    yield "Positions, out of poise"
    spread, a, first = hung.loss.isel(hang=0) - hung.loss.isel(hang=2), hung.a.isel(hang=0), jn_zeros(1, 1)[0]
    zero = sweep.where_exponent(spread.swap_dims(w="a0"), "a0", 0.0, values=True).abscissa
    rate, largest = -2 * DAY * hung.poise * j1(a) / a, abs(spread).max()
    yield differing("positions agree at the amplitude [rad]", f"{first:.4f}", zero, first, 5e-3)
    yield most(
        "top heavy against bottom heavy, by J1(a)/a, of the largest", "the same", (spread - rate) / largest, 5e-3
    )
    yield most("heavy at the side: of that", "0", hung.loss.isel(hang=1) / largest, 5e-3)


ARC = Log("amplitude, $a$ [rad]", None, (0.2, 0.5, 1, 2, 5))
KEY = {"computed": {**HOLLOW, "marker": "o"}, "theory, light losses": {"linewidth": 0.9}}
LOSS, FREE = Log("loss [s/day]", (0.1, 1000)), {"rate independent of the torque": "o"}


@panel(ARC.to(0.2, 22), Axis("loss [s/day]", (-4e3, 1e4)), "upper right", KEY, fontsize=7)
@panel(ARC.to(0.15, 8), LOSS, "upper right", FREE, fontsize=7)
@page(138.0)
def figure(lines, lifted, ds, lift, *_):
    """Loss against amplitude, for impulses and for lifts."""
    lines.set_yscale("symlog", linthresh=1.0, linscale=0.6)
    lines.set_yticks([-1000, -100, -10, -1, 0, 1, 10, 100, 1000])
    lines.set_yticks([], minor=True)
    for k, at in enumerate((-0.05, -0.025, -0.0125, 0.0, 0.05)):
        line = ds.isel(r=1).sel(at=at, method="nearest").sortby("w")
        lines.plot(line.a, theory(line), color=COLOURS[k], linewidth=0.9)
        points(lines, line.a[::4], line.loss[::4], k)
        text = f"${1e3 * at:+.3g}$ mrad" if at else "centre"
        x, y = 1.15 * float(line.a.max()), float(theory(line)[int(line.a.argmax("w"))])
        place = {"ha": "left", "va": "top" if at == -0.0125 else "center"}
        direct_label(lines, x, y, text, COLOURS[k], fontsize=6.5, **place)
    for k, beta in enumerate(lift.beta.values):
        line, top = slowest(lift, beta)
        text = f"lift ±{math.degrees(beta):.0f} degree"
        lifted.plot(line.amplitude, line.loss, color=COLOURS[k], linestyle=DASHES[k], label=text)
        lifted.plot(top.amplitude, top.loss, "o", color=COLOURS[k])


INPUTS = "balance_isochronism.h5 balance_isochronism_lift.h5 balance_isochronism_positions.h5"
main = script(__name__, INPUTS, claims, figure, prepared)
