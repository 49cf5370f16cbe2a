"""Which law does a foliot's period follow, P ~ torque^(-s), by the shares of its losses?

    python studies/law_map.py law_map.h5

By docs/theory/general_law.md, large swings have s = (N + lambda_e)/(N + 2), (1) small ones s = 1/(N + 2 lambda_e), (2)
which is exact from rest after each impact, e = 0, with dry friction alone. The ratio of the shares of two frictions
goes as v^(n - n'), that of impacts to a friction as mu/v^n, and dlnv = (1 - s) dlnmu: with (1) this says how many
decades of torque an exponent takes to turn into another. (3)

Here s = -dlnP/dlnmu. The shares are quadratures of the losses over the speed.
"""

import math

import numpy as np
import xarray as xr
from _common import Claims, compared, count, last_passage, most, script, solved
from _figures import COLOURS, Axis, S, page, panel
from _losses import any_swing, of_quarter, quarter, shares
from scipy.integrate import cumulative_trapezoid

LARGE, SMALL = 100.0, 1.0003
"""Amplitudes over phi0 from which, and up to which, losses are called light and heavy."""
SPEEDS = ["amplitude", "crossing_speed", "sensitivity"]
"""Outputs that shares of the losses are made of."""


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with shares and what `any_swing` makes of them: (1) is `large`, (2) `small`."""
    parts = [shares(ds.isel(mu=[i])) for i in range(ds.sizes["mu"])]  # some MB at a time
    whole = xr.concat(parts, "mu", data_vars="minimal", coords="minimal", compat="override", join="outer")
    return any_swing(whole).transpose(*ds.sensitivity.dims)


def by_shares(n: float, other: float | None) -> float:
    """(3) from a friction of degree n to one of degree `other`, None: to impacts."""
    r = np.geomspace(1e-6, 1e6, 200001)  # ratio of the shares
    share = r / (1 + r)
    N = n * (1 - share) + (other or 0.0) * share
    s = (N + (share if other is None else 0.0)) / (N + 2)
    rate = 1 - n * (1 - s) if other is None else (other - n) * (1 - s)
    log_mu = cumulative_trapezoid(1 / rate, np.log10(r), initial=0.0)
    low, high = (s[0] + part * (s[-1] - s[0]) for part in (0.25, 0.75))
    return float(np.interp(high, s, log_mu) - np.interp(low, s, log_mu))


def all_over() -> xr.Dataset:
    """Clocks all over the triangle of viscous, dry and impact losses, at swings of about 200 phi0, with their shares.

    Of energy 2 mu phi0 and speed v at the switch, viscous friction takes 2 a v^3/(3 mu), dry R v^2/mu and impacts
    (1 - e^2) v^2/2; with v^2 = 400 mu phi0 that says a, R and e for wanted shares, to the order of phi0 over the swing.
    """
    wanted = [(i / 6, j / 6) for i in range(7) for j in range(7 - i) if 6 not in (i, j) and i + j]
    viscous, struck = np.array(wanted).T
    mu, speed = 1e4, math.sqrt(400e4)
    a, e = 3.0 * viscous * mu**2 / speed**3, np.sqrt(1.0 - struck * 4.0 * mu / speed**2)
    R = np.maximum(1.0 - viscous - struck, 0.0) * 2.0 * mu**2 / speed**2
    return shares(solved("foliot", design="zip", a=a, R=R, e=e, mu=mu, c=0, phi0=1, rtol=1e-9, outputs=SPEEDS))


def claims(ds) -> Claims:
    yield "The general law"
    large, small = ds.where(ds.swing > LARGE), ds.where(ds.swing < SMALL)
    light, heavy = large.sensitivity - large.large, small.sensitivity / small.small - 1
    whole = abs(ds.law / ds.sensitivity - 1)
    usual = whole.quantile(0.95)
    yield most("the shares are the work, swings over 2 phi0", "1", ds.deficit.where(ds.swing > 2), 1e-6)
    yield most(f"(1), swings over {LARGE:g} phi0", "s", light, 1e-3, count(light))
    yield most(f"(2), swings under {SMALL:g} phi0", "s to 1.1 %", heavy, 0.011, count(heavy))
    rest = shares(solved("foliot", mu=1 + np.geomspace(1e-2, 1e2, 9), R=1, e=0, phi0=1, rtol=1e-10, outputs=SPEEDS))
    struck = f"impacts take {float(rest.impacts.min()):.0%} to {float(rest.impacts.max()):.0%}"
    exact = 2 * rest.impacts * rest.sensitivity - 1
    yield most("  from rest (e = 0), dry friction", "1/(2 lambda_e)", exact, 1e-8, struck)
    yield most("any swing, (1) of law_any_swing.py: 95 % of all cells", "s to 5 %", usual, 0.05, f"within {usual:.2%}")
    yield most(f"  all {count(whole)} that cycle", "s to 25 %", whole, 0.25, f"within {whole.max():.1%}")

    yield "Width of the crossovers (25 to 75 %)"
    smooth, alone = ds.sensitivity.sel(n=3, a=1, R=0), [of_quarter(quarter(s, 1))[0] for s in (5 / 6, 1 / 2)]
    for what, s, start, end, theory in (
        ("1 to 1/3, viscous, small to large swings", smooth.sel(c=0, e=1), 1, 1 / 3, math.log10(alone[1] / alone[0])),
        ("1/3 to 1/2, viscous to impacts (e = .99)", smooth.sel(c=0, e=0.99), 1 / 3, 1 / 2, by_shares(1, None)),
        ("1/3 to 3/5, viscous to drag of degree 3", smooth.sel(c=1e-6, e=1), 1 / 3, 3 / 5, by_shares(1, 3)),
    ):
        places = [last_passage(s.mu, s, start + part * (end - start)) for part in (0.25, 0.75)]
        width = abs(np.log10(places[1] / places[0]))
        yield compared(f"{what}: decades", f"{theory:.3f}", width, theory, 0.03)


LAW = {"theory (1)": {"linewidth": 0.8}}


@panel(Axis(), Axis(), "lower center", fontsize=7, borderaxespad=0)
@panel(Axis(r"$(N+\lambda_e)/(N+2)$ [1]", (0, 0.62)), S.to(0, 1.0), "upper left", LAW, markerscale=5, ncols=2)
@page(150.0, height_ratios=(1.05, 1))
def figure(triangle, check, ds):
    """The law over shares, and against every cell."""
    viscous, struck = np.array([(i / 60, j / 60) for i in range(61) for j in range(61 - i)]).T
    s = (viscous + struck) / (viscous + 2)
    look = {"vmin": 0, "vmax": 0.5, "cmap": "cividis"}
    x, y = struck + 0.5 * viscous, viscous * math.sqrt(3) / 2
    filled = triangle.tripcolor(x, y, s, shading="gouraud", rasterized=True, **look)
    lines = triangle.tricontour(x, y, s, levels=[0.1, 0.2, 0.3, 0.4], colors="white", linewidths=0.7)
    triangle.clabel(lines, fmt="%.1f", fontsize=7, manual=[(0.17, 0.1), (0.36, 0.1), (0.56, 0.1), (0.76, 0.1)])
    clocks = all_over()
    place = clocks.impacts + 0.5 * clocks.viscous, clocks.viscous * math.sqrt(3) / 2
    ring = {"edgecolors": "black", "linewidths": 0.5, "s": 12, "label": "clocks of the kernel"}
    triangle.scatter(*place, c=clocks.sensitivity, **look, **ring)
    triangle.figure.colorbar(filled, ax=triangle, label="exponent, $s$ [1]", pad=0.02, shrink=0.85)
    for where, text in (((0, -0.02), "dry, 0"), ((1, -0.02), "impacts, 1/2"), ((0.5, 0.89), "viscous, 1/3")):
        triangle.text(*where, text, ha="center", va="bottom" if where[1] > 0 else "top", fontsize=8)
    triangle.set(xlim=(-0.08, 1.08), ylim=(-0.12, 1.0), aspect="equal")
    triangle.axis("off")
    bands = ((1.5, 3, "0.8"), (3, 10, COLOURS[5]), (10, 100, COLOURS[1]), (100, math.inf, COLOURS[0]))
    for low, high, colour in bands:
        part = ds.where((ds.swing > low) & (ds.swing <= high))
        name = f"swing {low:g} to {high:g}" if math.isfinite(high) else f"swing over {low:g}"
        look = {"color": colour, "markersize": 1.6, "rasterized": True, "label": name + r" $\varphi_0$"}
        check.plot(part.large.values.ravel(), part.sensitivity.values.ravel(), ".", **look)
    check.plot([0, 0.6], [0, 0.6], color="black", linewidth=0.8)


main = script(__name__, "law_map.h5", claims, figure, prepared)
