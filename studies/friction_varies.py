"""What does friction that varies over the swing, by season or from swing to swing do to a foliot's rate?

    sweep run studies/friction_varies.toml --allow-import
    sweep run studies/friction_varies_noise.toml
    python studies/friction_varies.py friction_varies.h5 friction_varies_noise.h5

draws friction_varies.png and prints theory beside what comes out. The paper supposes that only the averages of torque
and friction over a period count. Theory, derived here, with s = -dlnP/dlnmu and dlnP/dlna = 2s - 1:

weak drive: the way takes its mean over the angle, the turn the friction at the switch,
    P/2 = (2/alpha + 2 a/a(phi0))/a;                                                      (1)
strong drive: the energy decides, so the mean weighed with the speed, <a v>/<v>, counts;  (2)
slow changes: the year has the mean of the rate 1/P(a). With x = ln(a/a0) it follows from s at a0 and its slopes by
ln mu, since alpha = mu/(a^2 phi0) and so ds/dx = -2 s':
    ln(P(a0)/P(a)) = (1 - 2s) x + 2 s' x^2 - (4/3) s'' x^3 + (2/3) s''' x^4 + ...         (3)
A power mean of a, of exponent 1 - 2s, is the first term alone, and wrong, since s changes with the season;
noise from swing to swing: sigma of the torque scatters the rate as s sigma, of the friction as abs(2s - 1) sigma,
both by sqrt(T/tau), and the two at once, of one noise, as (1 - s) sigma (`shared` = 0: as two of their own). (4)
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, page_of, read_result, report

import sweep
from sweep.show.charts import COLOURS, MARKS

DAY = 86400.0
SMALL = 0.125
"""Depth of the differences that stand for first order."""
KNOWN = {0.04: (51.33, 52.00, 53.66), 1.4629905875801047: (3.168, 3.212, 3.291), 100.0: (0.6312, 0.6295, 0.6278)}
"""Half periods at depth -0.5, 0 and 0.5, harmonic 1, by another integration, to the digits given."""
OIL = ((0.0, 3.0), (20.0, 1.0), (40.0, 0.42))
"""Viscosity of an oil at temperatures [degree C], over that at 20; chosen here, as a clock oil's."""
YEAR, ROOM_DAY = 8.0, 2.0
"""Half the swing of the temperature over the year and over the day [K], about 15 degree C."""

NOTES = """\
rates in s/day; deviation: relative, of rates the difference
allowed: the digits of the other integration; 1e-2 of (1), 5 % of (2), whose foliot swings but 5 phi0; 1 % of (3) to
its fourth term; of (4) three standard errors of 64 seeds, and 2 %. The oil is three times as
thick at 0 degree C as at 20, chosen here; the room swings by 8 K over the year and 2 K over the day, about 15 degree C
"""


def andrade(temperature: Any) -> Any:
    """Viscosity over that at 20 degree C by exp(B/T), T absolute; B from the first two points of `OIL`."""
    (low, thick), (mid, _), _ = OIL
    B = math.log(thick) / (1 / (low + 273.15) - 1 / (mid + 273.15))
    return np.exp(B * (1 / (np.asarray(temperature) + 273.15) - 1 / (mid + 273.15)))


def vogel(temperature: Any) -> Any:
    """The same by exp(B/(T + C)) through the three points of `OIL`."""
    from scipy.optimize import brentq

    (low, thick), (mid, _), (high, thin) = OIL

    def misses(C: float) -> float:
        B = math.log(thick) / (1 / (low + C) - 1 / (mid + C))
        return B * (1 / (high + C) - 1 / (mid + C)) - math.log(thin)

    C = brentq(misses, 60.0, 1000.0)
    B = math.log(thick) / (1 / (low + C) - 1 / (mid + C))
    return np.exp(B * (1 / (np.asarray(temperature) + C) - 1 / (mid + C)))


def over_the_swing(ds: xr.Dataset) -> list[Statement]:
    """Half periods against known ones, and what average of a(phi) would give them."""
    lines = []
    for mu, known in KNOWN.items():
        here = ds.interval.sel(mu=mu, harmonic=1).sel(depth=[-0.5, 0.0, 0.5], method="nearest").values
        off = float(max(abs(here / known - 1)))
        text = ", ".join(f"{x:.4g}" for x in here)
        lines.append(Statement(f"half period at depth -.5, 0, .5, alpha = {mu:.3g}", f"{known}", text, off, off < 3e-4))
    weak = ds.sel(mu=0.04, harmonic=1)
    theory = 2 / 0.04 + 2 / (1 - weak.depth)
    off = float(abs(weak.interval / theory - 1).where(abs(weak.depth) < 0.6).max())
    lines.append(
        Statement("weak drive: the mean and the turn, (1), alpha = .04", "1e-2", "largest deviation", off, off < 1e-2)
    )
    strong = averages(ds).sel(mu=100.0, harmonic=1)
    lines.append(compared("strong drive: mean by the energy, (2): effect of depth", f"{float(strong.energy):.5f}",
                          float(strong.effect), float(strong.energy), 0.05, 4))  # fmt: skip
    worst = float(DAY * SMALL * abs(averages(ds).effect).max())
    lines.append(
        Statement("the paper: only the mean over a period counts", "0", f"up to {worst:.0f} s/day at depth {SMALL:g}",
                  None, worst < 1.0, True)
    )  # fmt: skip
    return lines


def averages(ds: xr.Dataset) -> xr.Dataset:
    """dlnP/ddepth, `effect`, and what means of the friction over angle, time or energy would make of it."""
    up, down = (ds.interval.sel(depth=sign * SMALL, method="nearest") for sign in (1, -1))
    effect = (up - down) / (2 * SMALL * ds.interval.sel(depth=0, method="nearest"))
    study = sweep.study(
        kernel="foliot_motion", axes={"mu": ds.mu.values}, fixed={"a": 1.0, "phi0": 1.0},
        along={"phase": np.linspace(0.0, 0.5, 4001)},
    )  # fmt: skip
    motion = sweep.run(study)
    wave = np.cos(ds.harmonic * math.pi * motion.angle)
    speed = abs(motion.speed)
    s = cycles(ds.mu.values).sensitivity
    means = {"angle": speed, "time": 0 * speed + 1, "energy": speed**2}
    found = {name: (2 * s - 1) * (wave * w).mean("phase") / w.mean("phase") for name, w in means.items()}
    return xr.Dataset({"effect": effect.reset_coords(drop=True), **found})


def cycles(mu: Any, a: float = 1.0) -> xr.Dataset:
    """The foliot with even friction."""
    return sweep.run(sweep.study(kernel="foliot", axes={"mu": list(mu)}, fixed={"a": a, "phi0": 1.0}, rtol=1e-12))


def gain(mu: float, viscosity: Any) -> np.ndarray:
    """Rate [s/day] against the clock at viscosity 1, by the friction of each."""
    a = np.atleast_1d(viscosity)
    study = sweep.study(kernel="foliot", axes={"a": a}, fixed={"mu": mu, "phi0": 1.0}, rtol=1e-12, outputs=["period"])
    periods = sweep.run(study).period.values
    return DAY * (float(cycles([mu]).period[0]) / periods - 1)


def seasons(mu: float, oil: Callable[[Any], Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Days of a year, rates of their means, and viscosities at every two hours of it."""
    hour = np.arange(0, 365 * 12)
    temperature = 15 - YEAR * np.cos(2 * np.pi * hour / hour.size) - ROOM_DAY * np.cos(2 * np.pi * hour / 12)
    viscosity = oil(temperature) / oil(15.0)
    fine = np.geomspace(viscosity.min(), viscosity.max(), 400)
    rate = np.interp(np.log(viscosity), np.log(fine), gain(mu, fine))
    return np.arange(365), rate.reshape(365, 12).mean(axis=1), viscosity


def year_by_slopes(mu: float, x: np.ndarray) -> float:
    """The mean rate [s/day] of a year by (3), from s at mu and at four more points, 0.05 apart in ln mu."""
    h = 0.05
    s = cycles(mu * np.exp(h * np.arange(-2, 3))).sensitivity.values
    first = (s[0] - 8 * s[1] + 8 * s[3] - s[4]) / (12 * h)
    second = (-s[0] + 16 * s[1] - 30 * s[2] + 16 * s[3] - s[4]) / (12 * h**2)
    third = (s[4] - 2 * s[3] + 2 * s[1] - s[0]) / (2 * h**3)
    rate = (1 - 2 * s[2]) * x + 2 * first * x**2 - 4 / 3 * second * x**3 + 2 / 3 * third * x**4
    return DAY * float(np.mean(np.exp(rate)) - 1)


def by_season(ds: xr.Dataset) -> list[Statement]:
    """Rates over a year, and their mean from the sensitivity and its slopes."""
    lines = []
    for mu in (0.1, 1.4629905875801047, 30.0):
        s = float(cycles([mu]).sensitivity[0])
        spans = []
        for oil in (andrade, vogel):
            _, rate, viscosity = seasons(mu, oil)
            spans.append(rate.max() - rate.min())
        ends = gain(mu, np.array([viscosity.min(), 1.0, viscosity.max()]))
        text = f"{spans[0]:.4g} by Andrade, {spans[1]:.4g} by Vogel"
        what = f"alpha = {mu:.3g}, s = {s:.3f}: daily rates differ over the year by [s/day]"
        most = float(np.ptp(ends))
        lines.append(Statement(what, f"0.5 to 1 times {most:.4g}", text, None, bool(0.5 * most < spans[1] < most)))
        year, theory = float(seasons(mu, vogel)[1].mean()), year_by_slopes(mu, np.log(viscosity))
        what = "  mean rate of the year by s and three slopes of it, (3)"
        lines.append(compared(what, f"{theory:.1f}", year, theory, 0.01, 5))
        power = DAY * float(np.mean(viscosity ** (1 - 2 * s)) - 1)
        near = abs(power - year) < 0.1 * abs(year)
        what = f"  the same by a power mean of a, exponent {1 - 2 * s:+.2f}"
        lines.append(Statement(what, f"{power:.1f}", f"{year:.1f}", None, near, True))
    return lines


def by_noise(noisy: xr.Dataset) -> list[Statement]:
    """(4), clock by clock."""
    lines = []
    for mu in noisy.mu.values:
        cycle = cycles([mu]).isel(mu=0)
        s, half = float(cycle.sensitivity), float(cycle.period) / 2
        unit = DAY * 0.05 * math.sqrt(half / float(noisy.averaging_time))
        scatter = np.sqrt((noisy.rate_scatter_s_per_day.sel(mu=mu) ** 2).mean("seed"))
        hours = 20000 * half / 3600
        allowed = 3 / math.sqrt(2 * 0.6 * 64 * max(hours - 1, 1))
        for name, cell, share in (
            ("torque", {"sigma": 0.05, "sigma_a": 0}, s), ("friction", {"sigma": 0, "sigma_a": 0.05}, abs(2 * s - 1)),
            ("both", {"sigma": 0.05, "sigma_a": 0.05}, 1 - s),
        ):  # fmt: skip
            here = float(scatter.sel(cell)) / unit
            what = f"alpha = {mu:.3g}: scatter by 5 % noise of {name}, over unit"
            if share < 1e-3:
                lines.append(Statement(what, "0 to first order", f"{here:.4f}", None, here < 0.1))
            else:
                lines.append(compared(what, f"(4) {share:.4f} +- {allowed + 0.02:.0%}", here, share, allowed + 0.02, 4))
    return lines


def figure(ds: xr.Dataset, noisy: xr.Dataset) -> Any:
    """Periods, averages, seasons, noise; for two columns of print."""
    with page_of(120.0, 2, 2) as (page, ((swing, mean), (year, noise))):
        draw_swing(swing, ds)
        draw_means(mean, ds)
        draw_year(year)
        draw_noise(noise, noisy)
    return page


def draw_swing(axes: Any, ds: xr.Dataset) -> None:
    """Half period over depth, over that of even friction."""
    for k, mu in enumerate(ds.mu.values):
        line = ds.interval.sel(mu=mu, harmonic=1)
        change = 100 * (line / line.sel(depth=0, method="nearest") - 1)
        axes.plot(ds.depth, change, MARKS[k % len(MARKS)] + "-", color=COLOURS[k], markersize=3, label=f"{mu:.3g}")
    axes.set(xlabel="depth, $d$ [1]", ylabel="change of the period [%]", ylim=(-5, 10))
    axes.legend(title=r"$\alpha$", loc="upper left")


def draw_means(axes: Any, ds: xr.Dataset) -> None:
    """First order in the depth beside three means."""
    found = averages(ds).sel(harmonic=1)
    axes.semilogx(found.mu, found.effect, "o", color="black", label="true")
    for k, name in enumerate(("angle", "time", "energy")):
        look = {"linestyle": "", "color": COLOURS[k], "markerfacecolor": "none"}
        axes.semilogx(found.mu, found[name], MARKS[k + 1], label=f"mean over {name}", **look)
    axes.axhline(0, color="0.7", linewidth=0.6)
    axes.set(xlabel=r"drive, $\alpha$ [1]", ylabel=r"$\mathrm{d}\ln P/\mathrm{d}d$ [1]")
    axes.legend(loc="best", fontsize=7)


def draw_year(axes: Any) -> None:
    """Rate over the year by both laws of viscosity."""
    for k, (mu, name) in enumerate(((0.1, "0.1"), (1.4629905875801047, "1.46"), (30.0, "30"))):
        for oil, dashes in ((vogel, "-"), (andrade, ":")):
            days, rate, _ = seasons(mu, oil)
            axes.plot(days, rate / 60, dashes, color=COLOURS[k], label=rf"$\alpha={name}$" if dashes == "-" else None)
    axes.plot([], [], "-", color="black", label="Vogel")
    axes.plot([], [], ":", color="black", label="Andrade")
    axes.set(xlabel="day of the year, from the coldest [day]", ylabel="rate [min/day]", xlim=(0, 364), ylim=(-550, 900))
    axes.legend(loc="upper right", fontsize=7, ncols=2)


def draw_noise(axes: Any, noisy: xr.Dataset) -> None:
    """Scatter over its unit against s, with (4)."""
    s = np.linspace(1 / 3, 1, 100)
    cells = ({"sigma": 0.05, "sigma_a": 0}, {"sigma": 0, "sigma_a": 0.05}, {"sigma": 0.05, "sigma_a": 0.05})
    laws = (s, abs(2 * s - 1), 1 - s)
    clock = cycles(noisy.mu.values)
    unit = DAY * 0.05 * np.sqrt(clock.period / 2 / float(noisy.averaging_time))
    for k, (cell, name, law) in enumerate(zip(cells, ("torque", "friction", "both, one noise"), laws, strict=True)):
        scatter = np.sqrt((noisy.rate_scatter_s_per_day.sel(cell) ** 2).mean("seed"))
        axes.plot(s, law, color=COLOURS[k])
        axes.plot(clock.sensitivity, scatter / unit, MARKS[k], color=COLOURS[k], markerfacecolor="white", label=name)
    axes.plot([], [], color="black", label="theory")
    axes.set(xlabel="sensitivity, $s$ [1]", ylabel=r"scatter over $\sigma\sqrt{T/\tau}$ [1]", ylim=(0, 1.7))
    axes.legend(title="noise of", loc="upper center", fontsize=7, ncols=2)


def conclude(path: str, noise_path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = read_result(path, "friction_scene:KERNEL", ["mu", "harmonic", "depth"], "friction_varies.toml")
    noisy = read_result(noise_path, "foliot_noise", ["mu", "sigma", "sigma_a", "seed"], "friction_varies_noise.toml")
    groups = {
        "Friction over the swing": over_the_swing(ds),
        "Friction by season": by_season(ds),
        "Noise of friction and torque": by_noise(noisy),
    }
    return groups, [NOTES], lambda: figure(ds, noisy)


main = partial(report, __file__, ["friction_varies.h5", "friction_varies_noise.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
