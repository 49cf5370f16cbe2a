"""Which average of torque and friction sets the yearly rate of a foliot, and how does noise from swing to swing add up?

    python studies/which_average.py which_average.h5

m = ln(mu/mu0) and x = ln(a/a0) change over the season or from swing to swing; P = F(alpha)/a, alpha = mu/(a^2 phi0),
s = -dlnP/dlnmu, s' = ds/dln alpha. By docs/theory/averages.md

    ln<P0/P> = s <m> + (1 - 2s) <x> + s' var(m - 2x)/2 + var(s m + (1 - 2s) x)/2 + ...                    (1)

over the year, so of the friction the power mean of exponent p = 1 - 2s + 4s'/(1 - 2s) counts, of the torque that of
p = s + s'/s (2), here measured with a season of 2 %. Of a change of the torque in one half swing the clock gains
R_k = r + (s - r)(1 - K^k) in k more of them, K the multiplier; of the friction (1 - 2s) and r_a likewise. Over n of
them the rate scatters by 1/n times the root of

    sum over k < n of (sigma R_k)^2 + (sigma_a R_ka)^2 + 2 shared sigma sigma_a R_k R_ka,                     (3)

of which 5 % are three standard errors of 2000 seeds. With lambda = a v/mu at the switch, h = lambda^2/(1 + lambda)
and all times 1/(2/alpha + 2 lambda):
    r = 2/alpha + lambda + (1/lambda - 1)(2/alpha + h),
    r_a = 2/alpha + 2 lambda - (4/alpha + lambda + (1/lambda - 1)(4/alpha + h)).                               (4)
"""

import math

import numpy as np
from _common import Claims, compared, differing, most, script, solved
from _figures import ALPHA, COLOURS, Axis, Log, direct_label, page, panel, points
from _losses import quarter

DAY, SIGMA, HALF = 86400.0, 1e-3, 1.46299058758010465706
PHASE = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
NOISES = ((SIGMA, 0, 0), (0, SIGMA, 0), (SIGMA, SIGMA, -1), (SIGMA, SIGMA, 0), (SIGMA, SIGMA, 1))
"""sigma, sigma_a and shared: noise of the torque, of the friction, of both."""


def theory(alpha: float) -> tuple[float, float, float]:
    """s, s' and lambda, by q - tanh q = 1/alpha."""
    q = quarter(alpha)
    t, d = math.tanh(q), 1 - math.tanh(q) ** 2
    slope = -2 * d / t**3 + 1 / (q * q * t) + d / (q * t * t)  # ds/dq
    return (1 - t / q) / t**2, -slope * (q - t) / t**2, t


def mean_rate(alpha: float, m, x) -> float:
    """ln<P0/P> by the kernel."""
    mu, a = np.append(alpha * np.exp(m), alpha), np.append(np.exp(x), 1.0)
    P = solved("foliot", design="zip", mu=mu, a=a, phi0=1, rtol=1e-12, outputs=["period"]).period.values
    return math.log(np.mean(P[-1] / P[:-1]))


def exponents(alpha: float):
    """(2), of friction and torque."""
    s, slope, _ = theory(alpha)
    return np.array([1 - 2 * s + 4 * slope / (1 - 2 * s), s + slope / s])


def measured(alpha: float):
    """The same by the kernel, from a season of one of both."""
    s, season = theory(alpha)[0], 0.02 * np.cos(PHASE)
    friction, torque = mean_rate(alpha, 0 * season, season), mean_rate(alpha, season, 0 * season)
    return 2 * np.array([friction / (1 - 2 * s), torque / s]) / np.var(season)


def scatter(alpha: float, n: int, sigma: float, sigma_a: float, shared: float) -> float:
    """(3) times sqrt(n) over `SIGMA`."""
    s, _, u = theory(alpha)
    two, h, lost = 2 / alpha, u * u / (1 + u), 1 - np.exp(-(2 / alpha + 2 * u) * np.arange(n))
    r = (two + u + (1 / u - 1) * (two + h)) / (two + 2 * u)
    r_a = 1 - (2 * two + u + (1 / u - 1) * (2 * two + h)) / (two + 2 * u)
    R, R_a = sigma / SIGMA * (r + (s - r) * lost), sigma_a / SIGMA * (r_a + (1 - 2 * s - r_a) * lost)
    return math.sqrt(np.mean(R**2 + R_a**2 + 2 * shared * R * R_a))


def prepared(ds):
    """The scatter of the rate over seeds, in units of sigma, by the noise."""
    over = (ds.rate_error_s_per_day.std("seed") / (DAY * SIGMA) * np.sqrt(ds.half_swings)).reset_coords(drop=True)
    return {(a, b, c): over.sel(sigma=a, sigma_a=b, shared=c, method="nearest") for a, b, c in NOISES}


def claims(spread) -> Claims:
    yield "Which mean counts over the year"
    x = 0.1 * np.cos(PHASE)
    for alpha in (1e-3, 0.1, 1.0, 30.0, 1e6):
        for name, p, found in zip(("friction", "torque"), exponents(alpha), measured(alpha), strict=True):
            what = f"alpha = {alpha:g}: p of the mean of the {name}"
            yield differing(what, f"(2) {p:.4f}", found, p, 0.01)
    for alpha, size, name in ((0.1, 0.05, "both"), (HALF, 0.05, "both"), (30.0, 0.05, "both"), (HALF, 0.0, "friction")):
        m, (s, slope, _) = size * np.cos(PHASE - 1), theory(alpha)
        year = 0.5 * DAY * (slope * np.var(m - 2 * x) + np.var(s * m + (1 - 2 * s) * x))
        what = f"alpha = {alpha:.3g}: mean rate with a season of {name} [s/day]"
        yield compared(what, f"(1) {year:.2f}", DAY * mean_rate(alpha, m, x), year, 0.05)
    kept = mean_rate(30.0, 2 * x, x) - math.log(np.mean(np.exp(x)))
    yield most("torque as the square of the friction: its arithmetic mean", "exact", kept, 1e-10)

    yield "Noise from swing to swing"
    for kind, here in spread.items():
        expected = [[scatter(mu, int(n), *kind) for n in here.half_swings.values] for mu in here.mu.values]
        what = "sigma = {:g}, sigma_a = {:g}, shared = {:g}: scatter".format(*kind)
        text = "after 100: " + ", ".join(f"{x:.3f}" for x in here.isel(half_swings=-1).values)
        yield most(what, "(3)", (here - expected) / np.max(expected), 0.05, text)
    first, last = (spread[NOISES[0]].sel(mu=1000.0, half_swings=n) for n in (1, 100))
    short = scatter(1000, 1, *NOISES[0]) / scatter(1000, 100, *NOISES[0])
    what = "torque, alpha = 1000: of one half swing over that of 100"
    yield compared(what, f"{short:.3f}", first / last, short, 0.05)


@panel(ALPHA, Axis("exponent of the mean, $p$ [1]", (-5, 5)), "lower left", title="mean of")
@panel(Log("half swings, $n$ [1]"), Axis(r"scatter of the rate, $\sqrt{n}/\sigma$ [1]", (0, 1)), "lower left")
@page(132.0)
def figure(means, memory, spread):
    """Exponents of the means, and memory."""
    fine, marks = np.geomspace(1e-3, 1e5, 401), np.array([1e-3, 1e-2, 0.1, 0.5, 4, 30, 300, 1e4, 1e5])
    lines, computed = (np.transpose([f(a) for a in x]) for f, x in ((exponents, fine), (measured, marks)))
    lines[0][abs(np.log(fine / HALF)) < 0.03] = np.nan
    for k, name in enumerate(("friction", "torque")):
        means.plot(fine, lines[k], color=COLOURS[k])
        points(means, marks, computed[k], k, name, markersize=4)
    means.axvline(HALF, color="0.6", linewidth=0.7, linestyle=":")
    direct_label(means, 5.0, 4.2, "$s = 1/2$", "0.4", ha="left")
    n, torque = np.unique(np.geomspace(1, 100, 40).astype(int)), spread[NOISES[0]]
    for k, alpha in enumerate(torque.mu.values):
        memory.plot(n, [scatter(alpha, i, *NOISES[0]) for i in n], color=COLOURS[k])
        points(memory, torque.half_swings, torque.sel(mu=alpha), k, rf"$\alpha={alpha:g}$", markersize=4)


main = script(__name__, "which_average.h5", claims, figure, prepared)
