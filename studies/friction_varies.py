"""What does friction that varies over the swing, by season or from swing to swing do to a foliot's rate?

    python studies/friction_varies.py friction_varies.h5 friction_varies_noise.h5

The paper supposes that only the averages of torque and friction over a period count. Theory, of which more stands in
docs/theory/averages.md, with s = -dlnP/dlnmu and dlnP/dlna = 2s - 1:

weak drive: the way takes its mean over the angle, the turn the friction at the switch,
    P/2 = (2/alpha + 2 a/a(phi0))/a;                                                      (1)
strong drive: the energy decides, so the mean weighed with the speed, <a v>/<v>, counts;  (2)
slow changes: the year has the mean of the rate 1/P(a). With x = ln(a/a0) it follows from s at a0 and its slopes by
ln mu, since alpha = mu/(a^2 phi0) and so ds/dx = -2 s':
    ln(P(a0)/P(a)) = (1 - 2s) x + 2 s' x^2 - (4/3) s'' x^3 + (2/3) s''' x^4 + ...         (3)
A power mean of a, of exponent 1 - 2s, is the first term alone, and wrong, since s changes with the season;
noise from swing to swing: sigma of the torque scatters the rate as s sigma, of the friction as abs(2s - 1) sigma,
both by sqrt(T/tau), and the two at once, of one noise, as (1 - s) sigma (`shared` = 0: as two of their own). (4)

Rates are in s/day. The foliot of (2) swings only 5 phi0; (3) is taken to its fourth term; of (4) three standard errors
of 64 seeds are allowed, and 2 %. The oil is three times as thick at 0 degree C as at 20, which is chosen here. The
temperature of the room swings by 8 K over the year and 2 K over the day, about 15 degree C.
"""

import math

import numpy as np
import xarray as xr
from _common import DAY, Claims, compared, differing, held, most, said, script, solved
from _figures import ALPHA, COLOURS, MARKS, Axis, page, panel

SMALL = 0.125
"""Depth of the differences that stand for first order."""
HALF = 1.4629905875801047
"""alpha where s = 1/2, and friction does not count."""
SEASONS = {0.1: "0.1", HALF: "1.46", 30.0: "30"}
"""Drives of the clocks that are followed over a year."""
NOISES = {
    "torque": ({"sigma": 0.05, "sigma_a": 0.0}, lambda s: s),
    "friction": ({"sigma": 0.0, "sigma_a": 0.05}, lambda s: abs(2 * s - 1)),
    "both": ({"sigma": 0.05, "sigma_a": 0.05}, lambda s: 1 - s),
}
"""Cells of noise of 5 %, and what of it (4) has in the rate."""


def viscosity(temperature):
    """Viscosity over that at 20 degree C, exp(B/(T + C)) through 1 there (Vogel)."""
    thick, thin = np.log([3.0, 0.42])  # at 0 and at 40 degree C; chosen here, as a clock oil's
    C = -40 * thin / (thick + thin)
    return np.exp(thick * C * (20 - temperature) / (20 * (temperature + C)))


def cycles(mu) -> xr.Dataset:
    """The foliot with even friction."""
    return solved("foliot", mu=np.atleast_1d(mu), a=1, phi0=1, rtol=1e-12)


def averages(ds: xr.Dataset) -> xr.Dataset:
    """dlnP/ddepth, `effect`, and what means of the friction over angle, time or energy would make of it."""
    up, down, even = (ds.interval.sel(depth=depth, method="nearest") for depth in (SMALL, -SMALL, 0))
    motion = solved("foliot_motion", mu=ds.mu, a=1, phi0=1, along={"phase": np.linspace(0.0, 0.5, 4001)})
    wave, speed = np.cos(ds.harmonic * math.pi * motion.angle), abs(motion.speed)
    s = cycles(ds.mu).sensitivity
    means = {"angle": speed, "time": 0 * speed + 1, "energy": speed**2}
    found = {name: (2 * s - 1) * (wave * w).mean("phase") / w.mean("phase") for name, w in means.items()}
    return xr.Dataset({"effect": ((up - down) / (2 * SMALL * even)).reset_coords(drop=True), **found})


def seasons(mu: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean rates [s/day] of the days of a year, and viscosities at every two hours of it, over that at 15 degree C."""
    hour = np.arange(0, 365 * 12)
    temperature = 15 - 8 * np.cos(2 * np.pi * hour / hour.size) - 2 * np.cos(2 * np.pi * hour / 12)
    oil = viscosity(temperature) / viscosity(15.0)
    period = solved("foliot", design="zip", a=oil, mu=mu, phi0=1, rtol=1e-12, outputs=["period"]).period.values
    rate = DAY * (float(cycles(mu).period[0]) / period - 1)
    return rate.reshape(365, 12).mean(axis=1), oil


def prepared(ds, noisy):
    """What means of friction are worth, their sweep, and by noise the scatter of the rate over its unit, s and P/2."""
    clock = cycles(noisy.mu)
    found = xr.Dataset({"s": clock.sensitivity, "T": clock.period / 2})
    for name, (cell, _) in NOISES.items():
        rate = np.sqrt((noisy.rate_scatter_s_per_day.sel(cell) ** 2).mean("seed")).reset_coords(drop=True)
        found[name] = rate / (DAY * 0.05 * np.sqrt(found["T"] / noisy.averaging_time))
    return averages(ds), ds, found


def claims(means, ds, scatter) -> Claims:
    yield "Friction over the swing"
    weak, strong = ds.sel(mu=0.04, harmonic=1), means.sel(mu=100.0, harmonic=1)
    off = (weak.interval / (2 / 0.04 + 2 / (1 - weak.depth)) - 1).where(abs(weak.depth) < 0.6)
    energy, worst = float(strong.energy), DAY * SMALL * abs(means.effect).max()
    paper = f"the paper: only the mean over a period counts; at depth {SMALL:g} [s/day]"
    yield most("weak drive: the mean and the turn, (1), alpha = .04", "0", off, 1e-2)
    yield compared("strong drive: effect of depth, (2)", f"{energy:.5f}", strong.effect, energy, 0.05)
    yield held(paper, worst, "< 1", "up to {:.0f}", "0", refuted=True)

    yield "Friction by season"
    span, steps = {}, 0.05 * np.arange(-2, 3)
    for mu in SEASONS:
        # s and its slopes by ln mu, from five points
        quartic = np.polyfit(steps, cycles(mu * np.exp(steps)).sensitivity.values, 4)[::-1]
        (s, first, second, third, _), (rate, oil) = quartic * [1, 1, 2, 6, 24], seasons(mu)
        x, power = np.log(oil), DAY * float(np.mean(oil ** (1 - 2 * s)) - 1)
        gain = (1 - 2 * s) * x + 2 * first * x**2 - 4 / 3 * second * x**3 + 2 / 3 * third * x**4
        theory, year, span[mu] = DAY * float(np.mean(np.exp(gain)) - 1), float(rate.mean()), np.ptp(rate)
        slopes, mean = (
            f"alpha = {mu:.3g}: mean rate of the year, (3)",
            f"  by a power mean of a, exponent {1 - 2 * s:+.2f}",
        )
        yield compared(slopes, f"{theory:.1f}", year, theory, 0.01)
        yield differing(mean, f"{power:.1f}", year, power, 0.1 * abs(year), refuted=True)
    least, here = min(span, key=lambda mu: span[mu]) == HALF, ", ".join(f"{x:.4g}" for x in span.values())
    yield said("daily rates differ over the year, least where s = 1/2, by", least, here)

    yield "Noise of friction and torque"
    for clock in (scatter.sel(mu=mu) for mu in scatter.mu):
        hours = 20000 * float(clock["T"]) / 3600
        allowed = 3 / math.sqrt(2 * 0.6 * 64 * max(hours - 1, 1)) + 0.02
        for name, (_, law) in NOISES.items():
            share, what = float(law(clock.s)), f"alpha = {clock.mu:.3g}: scatter by 5 % noise of {name}, over unit"
            if share < 1e-3:
                yield held(what, clock[name], "< 0.1", "{:.4f}", "0 to first order")
            else:
                yield compared(what, f"(4) {share:.4f}", clock[name], share, allowed)


@panel(ALPHA, Axis(r"$\mathrm{d}\ln P/\mathrm{d}d$ [1]"), "best")
@panel(Axis("day of the year, from the coldest [day]", (0, 364)), Axis("rate [min/day]"), "best")
@page(130.0)
def figure(mean, year, means, *_):
    """What averages of friction over the swing are worth, and the rate over a year."""
    first = means.sel(harmonic=1)
    mean.plot(first.mu, first.effect, "o", color="black", label="true")
    for k, name in enumerate(("angle", "time", "energy")):
        look = {"linestyle": "", "color": COLOURS[k], "markerfacecolor": "none"}
        mean.plot(first.mu, first[name], MARKS[k + 1], label=f"mean over {name}", **look)
    mean.axhline(0, color="0.7", linewidth=0.6)
    for colour, (mu, name) in zip(COLOURS, SEASONS.items(), strict=False):
        year.plot(seasons(mu)[0] / 60, color=colour, label=rf"$\alpha={name}$")


main = script(__name__, "friction_varies.h5 friction_varies_noise.h5", claims, figure, prepared)
