"""How steady must a torque be: a verge and foliot's for 15 min/day, Bürgi's for 1 min/day, a balance's for 1 s/day?

    python studies/timekeeping.py timekeeping.h5 timekeeping_buergi.h5 timekeeping_spring.h5

The second clock is Bürgi's foliot, the third has a balance spring. The torque of half swing i is mu (1 + sigma x_i), x
of variance 1, white or forgotten as r^i, r = exp(-1/tau_c). s = -dlnP/dlnmu, T = P/2, m = day/T half swings a day.

To first order sigma x_i shifts the clock by s T sigma x_i in all, now and in the swings that remember it. The Allan
deviation over a day is that of means of m successive x, S and S' being their sums:
    y = s sigma sqrt(var S - cov(S, S'))/m,                                                            (1)
    var S = m (1 + r)/(1 - r) - 2 r (1 - r^m)/(1 - r)^2,  cov(S, S') = r (1 - r^m)^2/(1 - r)^2.
The most is 0.62 s sigma, at tau_c T = 0.53 day. A lasting change of torque by x changes the rate by s x.
To second order in sigma the clock loses. With T(m, u) and U(m, u) the time and the last speed of a half swing of torque
m that begins with the speed u, and derivatives as indices, on the cycle,
    c = r U_m/(1 - r U_u),  V = (U_m^2 + 2 U_m U_u c)/(1 - U_u^2),
    loss/sigma^2 = (T_mm/2 + T_mu c + T_uu V/2 + T_u (U_mm/2 + U_mu c + U_uu V/2)/(1 - U_u))/T.        (2)

Derived here. After +- stands what a number may be off by: three standard errors of these seeds and days, of a loss
four.
"""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import xarray as xr
from _common import Claims, columns, compared, differing, power, script, solved
from _figures import COLOURS, Log, page, panel
from scipy.linalg import expm

DAY = 86400.0
CLOCKS = ("verge", "Bürgi", "spring")
GOALS = {"15 min/day": 900.0, "1 min/day": 60.0, "1 s/day": 1.0}
TIMES = ("white", "1 min", "1 h", "1 day")
"""Correlation of the torque, along `tau_c`."""


def scaled(ds):
    """One clock: its noisy runs with s, T, the scatter, and the scatter over sigma [s/day] at sigma = 0.01."""
    cycle = solved("foliot", mu=[float(ds.mu)], phi0=ds.phi0, a=ds.a, k=ds.k, rtol=1e-9).isel(mu=0)
    ds = ds.assign_coords(s=float(cycle.sensitivity), T=float(cycle.period) / 2, speed=float(cycle.crossing_speed))
    scatter = np.sqrt((ds.rate_scatter_s_per_day**2).mean("seed"))
    days = math.floor(float(ds.half_swings * ds["T"] / ds.averaging_time))
    blur = 1 / math.sqrt(2 * 0.6 * ds.sizes["seed"] * (days - 1))
    return ds.assign(scatter=scatter, per_sigma=scatter.sel(sigma=0.01) / 0.01, blur=blur)


def correlation(tau_c):
    """r, of white noise, `tau_c` = 0, too."""
    return np.exp(-1 / np.maximum(tau_c, 1e-3))


def law(ds: xr.Dataset, tau_c):
    """Scatter over sigma [s/day] by (1)."""
    r, m = correlation(tau_c), float(ds.averaging_time / ds["T"])
    gone = -np.expm1(-m / np.maximum(tau_c, 1e-3))  # 1 - r^m
    sums = m * (1 + r) / (1 - r) - r * (2 * gone + gone**2) / (1 - r) ** 2
    return DAY * float(ds.s) * np.sqrt(sums) / m


def half_swing(m: float, u: float, clock: tuple[float, float, float]):
    """(T, U) of a half swing from x = 1 at speed u under torque -m, in units of phi0 and sqrt(phi0/mu)."""
    a, k, t = clock
    rates = np.array([[0, 1, 0], [-k, -a, -m], [0, 0, 0]])
    for _ in range(10):
        x, v, _ = expm(rates * t) @ (1, u, 1)
        t -= (x + 1) / v
    return np.array([t, -v])


def expanded(ds: xr.Dataset, tau_c, step: float = 1e-3):
    """s, and by (2) the loss over sigma^2 [s/day] at each tau_c, from the half swing by central differences."""
    unit = math.sqrt(float(ds.phi0 / ds.mu))
    clock = (float(ds.a) * unit, float(ds.k) * unit**2, float(ds["T"]) / unit)
    u, r = float(ds.speed / ds.phi0) * unit, correlation(tau_c)
    f = {(i, j): half_swing(1 + i * step, u * (1 + j * step), clock) for i, j in product((-1, 0, 1), repeat=2)}
    (time, _), du = f[0, 0], u * step
    (T_m, U_m), (T_u, U_u) = (f[1, 0] - f[-1, 0]) / (2 * step), (f[0, 1] - f[0, -1]) / (2 * du)
    by_mm, by_uu = (f[1, 0] - 2 * f[0, 0] + f[-1, 0]) / step**2, (f[0, 1] - 2 * f[0, 0] + f[0, -1]) / du**2
    by_mu = (f[1, 1] - f[1, -1] - f[-1, 1] + f[-1, -1]) / (4 * step * du)
    c = r * U_m / (1 - r * U_u)
    V = (U_m**2 + 2 * U_m * U_u * c) / (1 - U_u**2)
    longer, faster = by_mm[:, None] / 2 + np.outer(by_mu, c) + np.outer(by_uu, V) / 2
    return -(T_m + T_u * U_m / (1 - U_u)) / time, DAY * (longer + T_u * faster / (1 - U_u)) / time


def claims(clocks) -> Claims:
    for name, ds in clocks.items():
        yield name
        (s, losses), known, sigma = expanded(ds, ds.tau_c.values), float(ds.s), float(ds.sigma[-1])
        yield compared(f"{name}: s from the half-swing map", f"{known:.6f} +- 1e-4", s, known, 1e-4)
        allowed = 3 * float(ds.blur)
        for j, time_name in enumerate(TIMES):
            theory, what = float(law(ds, ds.tau_c[j])), f"  scatter over sigma, {time_name} [s/day]"
            yield compared(what, f"(1) = {theory:.4g} +- {allowed:.0%}", ds.per_sigma[j], theory, allowed)
        # the same noise at every sigma, so no error of sampling
        by_sigma = power(ds.scatter.isel(tau_c=0).sel(sigma=slice(None, 0.03)))
        yield differing("  power of sigma in the scatter, white", "1 +- 0.01", by_sigma, 1, 0.01)
        for j in (0, 1):
            rate, theory = ds.rate_error_s_per_day.isel(tau_c=j, sigma=-1), sigma**2 * losses[j]
            error, what = float(rate.std(ddof=1)) / math.sqrt(rate.size), f"  loss at sigma = {sigma:g}, {TIMES[j]}"
            allowed = 4 * error / theory + 5 * sigma**2  # and the next order
            line = compared(what, f"(2) = {theory:.4g} s/day +- {allowed:.0%}", -rate.mean(), theory, allowed)
            yield line if error < 0.1 * theory else replace(line, here=f"{line.here} +- {error:.1g}", holds=None)


def table(clocks):
    """The torque noise that scatters a clock by each goal; the lasting change that shifts it."""
    rows = [("clock", "goal", *TIMES, "lasting change")]
    for name, ds in clocks.items():
        for goal, rate in GOALS.items():
            sigma = [*(rate / ds.per_sigma).values, rate / (DAY * float(ds.s))]
            # torque that varies by more than 30 % would vanish now and then: any that a clock can have
            rows.append((name, goal, *(f"{100 * x:.2g}" if x < 0.3 else "any" for x in sigma)))
    return ["Noise of the torque, by its correlation, and lasting change [%] for these rates:", *columns(rows)]


NOISE, SCATTER = Log(r"torque noise, $\sigma$ [1]"), Log("scatter of the rate from day to day [s/day]", (1e-4, 1e4))
LASTS, OVER = Log("correlation time of the torque [day]", (1e-6, 10)), Log(r"scatter over $s\sigma$ [1]", (1e-3, 1.2))
KEY = {"white": {"marker": "o", "markerfacecolor": "white"}, "of a day": {"marker": "o", "linestyle": (0, (5, 1.5))}}


@panel(NOISE.to(1e-3, 0.3), SCATTER, "lower right", KEY, title="torque noise", borderaxespad=0.2)
@panel(LASTS, OVER, "outside upper center", ncols=3)
@page(142.0)
def figure(scatter, over, clocks):
    """Scatter against noise, white and of a day, and against the correlation of the noise, with (1)."""

    def lasts(ds, tau_c):  # days of continuous noise that is alike over long times
        return float(ds["T"]) / DAY / 2 * (1 + correlation(tau_c)) / (1 - correlation(tau_c))

    wide = np.geomspace(1e-3, 0.3, 2)
    for (name, ds), colour, mark in zip(clocks.items(), COLOURS, "os^", strict=False):
        for j, dashes, fill in ((0, "-", "white"), (3, (0, (5, 1.5)), colour)):
            scatter.plot(wide, float(law(ds, ds.tau_c[j])) * wide, color=colour, linestyle=dashes)
            scatter.plot(ds.sigma, ds.scatter.isel(tau_c=j), mark, color=colour, markerfacecolor=fill)
        look = {"fmt": mark, "color": colour, "markerfacecolor": "white", "linewidth": 0.8}
        unit, theta = DAY * float(ds.s), np.geomspace(0.1, 10 * DAY / float(ds["T"]), 300)
        y = ds.per_sigma / unit
        over.errorbar(lasts(ds, ds.tau_c), y, float(ds.blur) * y, label=name, **look)
        over.plot(lasts(ds, theta), law(ds, theta) / unit, color=colour, linewidth=0.8)
    for goal, rate in GOALS.items():
        scatter.axhline(rate, color="0.6", linewidth=0.6)
        scatter.text(1.02, rate, goal, fontsize=8, va="center", transform=scatter.get_yaxis_transform())


INPUTS = "timekeeping.h5 timekeeping_buergi.h5 timekeeping_spring.h5"
main = script(__name__, INPUTS, claims, figure, lambda *runs: dict(zip(CLOCKS, map(scaled, runs), strict=True)), table)
