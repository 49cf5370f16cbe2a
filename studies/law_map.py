"""Which law does a foliot's period follow, P ~ torque^(-s), by the shares of its losses?

    sweep run studies/law_map.toml
    python studies/law_map.py law_map.h5

draws law_map.png and compares theory with what comes out. The general law, derived here by dominant balance: let
friction of degree n take the share lambda_n of the energy 2 mu phi0 of half a swing, n = 0 dry, 1 viscous, n drag c
abs(v)^n, and impacts at the switch the share lambda_e; N = sum of n lambda_n. Large swings (light losses): the way is
v^2/mu, so friction takes c v^(n + 2)/mu, impacts (1 - e^2) v^2/2, and P ~ v/mu. The differential of the balance, sum
lambda_n ((n + 2) dlnv - dlnmu) + 2 lambda_e dlnv = dlnmu, gives s = (N + lambda_e)/(N + 2),
(1) which is n/(n + 2) for one friction, 1/2 for impacts alone. Small swings (heavy losses): the foliot goes at its
final speed, f(v) = mu, and P ~ phi0/v, so s = 1/(N + 2 lambda_e), 1/n for one friction; impacts take little there. From
rest after each impact, e = 0, with dry friction alone this is exact at any share of impacts, s = mu/(2 (mu - R)).
(2) The ratio of the shares of two frictions goes as v^(n - n'), that of impacts to a friction as mu/v^n, and
dlnv = (1 - s) dlnmu: with (1) this says how many decades of torque an exponent takes to turn into another.      (3)
"""

import math
from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, Conclusion, compared, count, differing, last_passage, most, read_result, script, solved
from _figures import colour_map, direct_label, hatch, page_of
from _losses import any_swing, shares
from scipy.optimize import brentq

import sweep
from sweep.show.charts import COLOURS

LARGE, SMALL = 100.0, 1.0003
"""Amplitudes over phi0 from which, and up to which, losses are called light and heavy."""
AT_ONCE = 4000
"""Cells whose losses are summed up together: 6 MB an array."""
DEGREES = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
"""Of one friction alone; some are not on the grid."""
BEST = {10.0: (0.27318, 8.719), 100.0: (0.17768, 6.098)}
"""Least s and its mu/R by R/(a^2 phi0) where viscous and dry friction act, once in 50 digits."""
PLANE = {"a": 1.0, "e": 0.9, "n": 3.0, "c": 4e-6, "phi0": 1.0}
"""The clock whose exponent is mapped over torque and dry friction."""
SPEEDS = ["amplitude", "crossing_speed", "sensitivity"]
"""Outputs that shares of the losses are made of."""
LOSSES = ["viscous", "dry", "drag", "impacts"]

NOTES = """\
s = -dlnP/dlnmu; deviation: the difference of exponents, others relative. Shares by quadrature of the losses over the
speed. Allowed: 1e-6 of the energy; 0.001 of (1) at swings over 100 phi0, 0.011 of (2) at swings under 1.0003 phi0, 1e-8
from rest; 1e-4 of the best torques, which were once computed to 50 digits
"""


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with shares and what `any_swing` makes of them: (1) is `large`, (2) `small`."""
    order = ds.sensitivity.dims
    width = max(1, AT_ONCE * ds.sizes["mu"] // ds.sensitivity.size)
    parts = [shares(ds.isel(mu=slice(i, i + width))) for i in range(0, ds.sizes["mu"], width)]
    ds = xr.concat(parts, "mu", data_vars="minimal", coords="minimal", compat="override", join="outer")
    return any_swing(ds).transpose(*order)


def laws(ds: xr.Dataset) -> Claims:
    """(1) and (2) against every cell of large and of small swings."""
    large, small = ds.where(ds.swing > LARGE), ds.where(ds.swing < SMALL)
    light, heavy = large.sensitivity - large.large, small.sensitivity / small.small - 1
    mixed = light.where(large[LOSSES].to_array().max("variable") < 0.7)
    whole = abs(ds.law / ds.sensitivity - 1)
    usual = whole.quantile(0.95)
    yield most("the shares are the work, swings over 2 phi0", "1", ds.deficit.where(ds.swing > 2), 1e-6)
    yield most(f"(1), swings over {LARGE:g} phi0", "s", light, 1e-3, count(light))
    yield most("  of these no loss takes over 70 %", "s", mixed, 1e-3, count(mixed))
    yield most(f"(2), swings under {SMALL:g} phi0", "s to 1.1 %", heavy, 0.011, count(heavy))
    rest = shares(solved("foliot", mu=1 + np.geomspace(1e-2, 1e2, 9), R=1, e=0, phi0=1, rtol=1e-10, outputs=SPEEDS))
    struck = f"impacts take {float(rest.impacts.min()):.0%} to {float(rest.impacts.max()):.0%}"
    yield most(
        "  from rest (e = 0), dry friction", "1/(2 lambda_e)", 2 * rest.impacts * rest.sensitivity - 1, 1e-8, struck
    )
    yield most("any swing, (1) of law_any_swing.py: 95 % of all cells", "s to 5 %", usual, 0.05, f"within {usual:.2%}")
    yield most(f"  all {count(whole)} that cycle", "s to 25 %", whole, 0.25, f"within {whole.max():.1%}")


def pure_laws(pure: xr.DataArray) -> Claims:
    """n/(n + 2) and 1/n of one friction alone."""
    for n in (0.25, 1.5, 2.0, 4.0):
        weak, strong = pure.sel(n=n).values[:: 1 if n < 2 else -1]
        off, theory = max(abs(weak - 1 / n), abs(strong - n / (n + 2))), f"{1 / n:.4f}, {n / (n + 2):.4f}"
        here = f"{weak:.4f}, {strong:.4f}"
        yield most(f"drag of degree {n:g} alone: 1/n, n/(n + 2)", theory, off, 1e-6, here)


def best_torques() -> Claims:
    """The torque of least s where viscous and dry friction act."""
    for R, (least, place) in BEST.items():
        s = solved("foliot", mu=R * np.geomspace(1.5, 60, 400), a=1, R=R, phi0=1, rtol=1e-12).sensitivity
        top = sweep.where_exponent(s, "mu", 0.0).abscissa / R
        yield differing(f"R = {R:g} a^2 phi0: least s", f"{least}", s.min(), least, 1e-4, 5)
        yield compared("  at mu/R", f"{place}", top, place, 1e-3, 4)


def widths(ds: xr.Dataset) -> Claims:
    """How many decades of torque the exponent takes for the middle half of its way from law to law, a = 1/s."""
    smooth = ds.sensitivity.sel(n=3, a=1, R=0)
    known = (
        ("1 to 1/3, viscous, small to large swings", smooth.sel(c=0, e=1), (1.0, 1 / 3), by_q()),
        ("1/3 to 1/2, viscous to impacts (e = .99)", smooth.sel(c=0, e=0.99), (1 / 3, 1 / 2), by_shares(1, None)),
        ("1/3 to 3/5, viscous to drag of degree 3", smooth.sel(c=1e-6, e=1), (1 / 3, 3 / 5), by_shares(1, 3)),
    )
    for what, s, (start, end), theory in known:
        places = [last_passage(s.mu, s, start + part * (end - start)) for part in (0.25, 0.75)]
        width = abs(np.log10(places[1] / places[0]))
        yield compared(f"{what}: decades", f"{theory:.3f}", width, theory, 0.03, 4)


def by_q() -> float:
    """Of one viscous loss, from s = 5/6 to 1/2, by s and alpha as functions of q = a P/4."""

    def place(s: float) -> float:
        q = brentq(lambda q: (1 - math.tanh(q) / q) / math.tanh(q) ** 2 - s, 0.1, 500.0)
        return -math.log10(q - math.tanh(q))

    return abs(place(5 / 6) - place(1 / 2))


def by_shares(n: float, other: float | None) -> float:
    """(3) from a friction of degree n to one of degree `other`, None: to impacts."""
    r = np.geomspace(1e-6, 1e6, 200001)  # ratio of the shares
    share = r / (1 + r)
    N = n * (1 - share) + (other or 0.0) * share
    s = (N + (share if other is None else 0.0)) / (N + 2)
    rate = 1 - n * (1 - s) if other is None else (other - n) * (1 - s)
    log_mu = np.concatenate([[0.0], np.cumsum(np.diff(np.log10(r)) / (0.5 * (rate[1:] + rate[:-1])))])
    low, high = (s[0] + part * (s[-1] - s[0]) for part in (0.25, 0.75))
    return float(np.interp(high, s, log_mu) - np.interp(low, s, log_mu))


def all_over() -> xr.Dataset:
    """Clocks all over the triangle of viscous, dry and impact losses, at swings of about 200 phi0, with their shares.

    Of energy 2 mu phi0 and speed v at the switch, viscous friction takes 2 a v^3/(3 mu), dry R v^2/mu and impacts
    (1 - e^2) v^2/2; with v^2 = 400 mu phi0 that says a, R and e for wanted shares, to the order of phi0 over the swing.
    """
    wanted = [(i / 6, j / 6) for i in range(7) for j in range(7 - i) if (i, j) not in ((0, 0), (6, 0), (0, 6))]
    viscous, struck = np.array(wanted).T
    mu, speed = 1e4, math.sqrt(400e4)
    losses = {
        "a": 3.0 * viscous * mu**2 / speed**3,
        "R": np.maximum(1.0 - viscous - struck, 0.0) * 2.0 * mu**2 / speed**2,
        "e": np.sqrt(1.0 - struck * 4.0 * mu / speed**2),
    }
    return shares(solved("foliot", design="zip", **losses, mu=mu, c=0, n=3, phi0=1, rtol=1e-9, outputs=SPEEDS))


def figure(ds: xr.Dataset, pure: xr.DataArray) -> Any:
    """The law over shares, over torque and friction, over the degree, and against every cell; for two columns."""
    with page_of(140.0, 2, 2) as (page, ((triangle, region), (degree, check))):
        draw_triangle(page, triangle)
        draw_region(region)
        n = np.linspace(0.02, 4, 200)
        degree.plot(n, n / (n + 2), color=COLOURS[0], label="large swings, $n/(n+2)$")
        degree.plot(n, 1 / n, color=COLOURS[1], linestyle="--", label="small swings, $1/n$")
        degree.axhline(0.5, color=COLOURS[2], linewidth=0.8, linestyle=":", label="impacts, 1/2")
        for k, label in enumerate(("kernel, $\\mu=10^{\\mp30}$", None)):
            degree.plot(pure.n, pure[:, k], "o", color="black", markerfacecolor="white", markersize=4, label=label)
        degree.set(xlabel="degree of the friction, $n$ [1]", ylabel="exponent, $s$ [1]", xlim=(0, 4.2), ylim=(0, 2.2))
        degree.legend(loc="upper right", fontsize=7)
        bands = ((1.5, 3, "0.8"), (3, 10, COLOURS[5]), (10, 100, COLOURS[1]), (100, math.inf, COLOURS[0]))
        for low, high, colour in bands:
            part = ds.where((ds.swing > low) & (ds.swing <= high))
            look = {"color": colour, "markersize": 1.6, "rasterized": True}
            look["label"] = f"{low:g} to {high:g}" if math.isfinite(high) else f"over {low:g}"
            check.plot(part.large.values.ravel(), part.sensitivity.values.ravel(), ".", **look)
        check.plot([0, 0.6], [0, 0.6], color="black", linewidth=0.8, label="theory (1)")
        check.set(xlabel=r"$(N+\lambda_e)/(N+2)$ [1]", ylabel="exponent, $s$ [1]", xlim=(0, 0.62), ylim=(0, 1.0))
        check.legend(title=r"swing, $A/\varphi_0$", loc="upper left", markerscale=5, fontsize=7)
    return page


def draw_triangle(page: Any, axes: Any) -> None:
    """(1) over the shares of viscous, dry and impact losses; rings are clocks, filled with their own s."""
    steps = 60
    corner = np.array([(i / steps, j / steps) for i in range(steps + 1) for j in range(steps + 1 - i)])
    viscous, struck = corner.T
    s = (viscous + struck) / (viscous + 2)
    look = {"vmin": 0, "vmax": 1, "cmap": "cividis"}
    x, y = struck + 0.5 * viscous, viscous * math.sqrt(3) / 2
    filled = axes.tripcolor(x, y, s, shading="gouraud", rasterized=True, **look)
    lines = axes.tricontour(x, y, s, levels=[0.1, 0.2, 0.3, 0.4], colors="white", linewidths=0.7)
    axes.clabel(lines, fmt="%.1f", fontsize=7, manual=[(0.17, 0.1), (0.36, 0.1), (0.56, 0.1), (0.76, 0.1)])
    clocks = all_over()
    place = clocks.impacts + 0.5 * clocks.viscous, clocks.viscous * math.sqrt(3) / 2
    ring = {"edgecolors": "black", "linewidths": 0.5, "s": 12, "label": "clocks of the kernel"}
    axes.scatter(*place, c=clocks.sensitivity, **look, **ring)
    page.colorbar(filled, ax=axes, label="exponent, $s$ [1]", pad=0.02, shrink=0.85, extend="max")
    for where, text in (((0, -0.02), "dry, 0"), ((1, -0.02), "impacts, 1/2"), ((0.5, 0.89), "viscous, 1/3")):
        axes.text(*where, text, ha="center", va="bottom" if where[1] > 0 else "top", fontsize=8)
    axes.set(xlim=(-0.08, 1.08), ylim=(-0.12, 1.0), aspect="equal")
    axes.axis("off")
    axes.legend(loc="lower center", fontsize=7, borderaxespad=0)


def draw_region(axes: Any) -> None:
    """s over torque and dry friction; lines where another loss comes to be the largest, dots where s is least."""
    R, mu = np.geomspace(1e-3, 1e4, 421), np.geomspace(1e-3, 1e8, 661)
    whole = prepared(solved("foliot", R=R, mu=mu, **PLANE, rtol=1e-7, outputs=SPEEDS)).transpose("R", "mu")
    s = whole.sensitivity.values
    colour_map(axes, mu, R, s, "exponent, $s$ [1]", {"extend": "max"}, vmin=0, vmax=1)
    parts = np.nan_to_num([whole[name].values for name in LOSSES])
    largest = np.where(np.isfinite(s), np.argmax(parts, axis=0), np.nan)
    for k in range(len(LOSSES)):
        axes.contour(mu, R, np.where(largest == k, 1.0, 0.0), levels=[0.5], colors="white", linewidths=0.7)
    hatch(axes, mu, R, np.isnan(s), "////")
    axes.plot(mu[np.nanargmin(s, axis=1)], R, color="#D55E00", label="least $s$")
    axes.plot([], [], color="0.6", linewidth=0.7, label="largest loss (white)")
    for x, y, text in (
        (3e-2, 2e-3, "viscous, 1"), (6e1, 8e-2, "viscous, 1/3"), (1e5, 8e-2, "impacts, 1/2"),
        (2e7, 8e-2, "drag, 3/5"), (1.3e4, 1.5e3, "dry, 0"), (3e-2, 1e2, "never starts"),
    ):  # fmt: skip
        direct_label(axes, x, y, text, fontsize=7)
    axes.set(xscale="log", yscale="log", xlabel=r"torque, $\mu/(a^2\varphi_0)$ [1]")
    axes.set(ylabel=r"dry friction, $R/(a^2\varphi_0)$ [1]")
    axes.legend(loc="lower right", fontsize=6.5, frameon=True, framealpha=0.85)


def conclude(path: str) -> Conclusion:
    """Statements and the figure."""
    ds = prepared(read_result(path, "foliot", ["n", "e", "a", "R", "c", "mu"], "law_map.toml"))
    pure = solved("foliot", n=DEGREES, mu=[1e-30, 1e30], c=1, phi0=1, outputs=["sensitivity"]).sensitivity
    law = "the law: s = (N + lambda_e)/(N + 2) at large swings,\n1/(N + 2 lambda_e) at small, N = sum of n lambda_n"
    groups = {
        "The general law": laws(ds),
        "One loss alone": pure_laws(pure),
        "Best torque, viscous and dry": best_torques(),
        "Width of the crossovers (25 to 75 %)": widths(ds),
    }
    return groups, [NOTES, law], lambda: figure(ds, pure)


main = script(__name__, "law_map.h5", conclude)
