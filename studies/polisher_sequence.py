"""Which sequence of settings polishes evenly, and how does a machine keep its middle when its throw changes?

    sweep run studies/polisher_sequence.toml
    python studies/polisher_sequence.py polisher_sequence.h5

draws polisher_sequence.png and prints what comes out. Wear adds up, so the time t_i >= 0 spent at setting i of the
sweep wears the sum of t_i h_i(r); the most even sum of given mean is a least-squares problem over the area with t >=
0.
"""

import math
from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, Conclusion, Statement, compared, most, read_result, said, script, solved
from _figures import colour_map, page_of
from _polishing import KEPT, Profiles, area, best_settings, least, machine, profiles, swings, tool_wear, unevenness
from scipy.optimize import brentq

from sweep.show.charts import COLOURS

TOOLS = (
    (2, 2, 1, 1), (2, 2, 1, 2), (1, 1, 1, 2), (0.5, 0.5, 1, 2), (100, 100, 1, 2),
    (2, 1, 1, 2), (2, 0.5, 1, 2), (2, 8, 1, 2),
)  # fmt: skip
"""n, m, a, b of the paper's figure 5, abs(X/a)^n + abs(Y/b)^m <= 1: five known tools, three unknown ones."""

NOTES = """\
unevenness: standard deviation over the area, over the mean; allowed: 1e-6 of the conditions of an optimum, 1e-9 m of a
length found by roots, 2 % of A0's slopes over 1 mm of throw, 5e-4 of the wear in all, by 24 by 24 points of a quarter
"""


def optimum(ds: xr.Dataset, p: Profiles, shares: Any) -> Claims:
    """What a sequence gains over one setting, and whether it is the best."""
    mixed, best, single = shares @ p.rows, p.nominal(range(len(p.rows)), shares), best_settings(ds)[0].uneven
    holds = best < single / 35 and least(mixed, p.weight, p.radius) > KEPT
    here = f"{best:.1%} for {single:.1%}, centre {mixed[0]:.2f}, {np.sum(shares > 1e-9)} settings"
    yield said("best sequence, for the best of one setting", holds, here, "1/35")
    yield most("  conditions of an optimum", "0", p.breach(shares, 0.0), 1e-6, "largest breach")
    for i in np.argsort(-shares)[: np.sum(shares > 0.01)]:
        e, offset = (100 * x for x in p.places[i])
        yield Statement(f"  {shares[i]:.0%} of the wear at", "", f"e = {e:g} cm, offset {offset:.0f} cm")


def eight_tools(ds: xr.Dataset) -> Claims:
    """Wear by each tool of the paper's figure 5, its half widths 4 cm times a and b, and the same in all by its points.

    What the work loses, 2 pi times the integral of the wear over r dr, follows from the mean speed of its points.
    """
    fixed = machine(ds) | {"e": 0.1, "w_x": float(ds.w_x[3])}
    n, m, a, b = np.array(TOOLS).T
    radius = np.linspace(0.0, 0.4, 401)
    sizes = {"tool_n": n, "tool_m": m, "tool_a": 0.04 * a, "tool_b": 0.04 * b}
    wear = solved("polisher_wear", design="zip", along={"radius": radius}, rtol=1e-5, **fixed | sizes).wear.values
    motion, work = swings(ds, [0.1]), ds.isel(w_x=3, e=[0])
    u, weight = np.polynomial.legendre.leggauss(24)
    u, weight = 0.5 * (u + 1), 0.5 * weight
    for k, row in enumerate(wear):
        # a quarter of the outline, X = a x, x = u^2 (3 - 2 u), towards whose ends Gauss's points crowd
        x, dx = u * u * (3 - 2 * u), 6 * u * (1 - u) * weight
        top = (1 - x ** n[k]) ** (1 / m[k])
        X, Y = (sizes["tool_a"][k] * x)[:, None], sizes["tool_b"][k] * top[:, None] * u
        area_of = sizes["tool_a"][k] * sizes["tool_b"][k] * (dx * top)[:, None] * weight
        corners = [(s * X + 0 * Y, t * Y) for s in (1, -1) for t in (1, -1)]
        theory = sum(float((tool_wear(work, motion, *at)[0] * area_of).sum()) for at in corners)
        here, inner = 2 * np.pi * np.trapezoid(row * radius, radius), radius <= float(ds.radius[-1]) + 1e-9
        uneven = float(unevenness(row[inner], area(radius[inner])))
        what = f"n, m = {n[k]:g}, {m[k]:g}, b = {b[k]:g} a: uneven by {uneven:.0%}, wear in all [m^3/s]"
        yield compared(what, f"{theory:.4g}", here, theory, 5e-4, 4)


def middle(d: float, e: float, b: float, f: float) -> float:
    """A0 [rad] by (39)."""
    return 0.5 * sum(math.acos((b * b + d * d - (f + s * e) ** 2) / (2 * b * d)) for s in (1, -1))


def correction(ds: xr.Dataset) -> Claims:
    """How far O_DH moves on the arm so that the middle stays when the throw goes from 10 to 15 cm."""
    b, d, f = (float(ds[name]) for name in "bdf")
    kept = middle(d, 0.10, b, f)
    exact, small = (brentq(lambda x, e=e: middle(x, e, b, f) - kept, 0.37, 0.45, xtol=1e-15) for e in (0.15, 0.101))
    # the kernel's own angles there, and its slopes for small steps
    cells = solved("polisher", design="zip", d=[d, exact, d], e=[0.10, 0.15, 0.15], b=b, f=f)
    slope = -float(cells.A0_e[0] / cells.A0_d[0]) * 1e-3
    kept_by, shift = float(cells.A0[1] - cells.A0[0]), math.degrees(float(cells.A0[2] - cells.A0[0]))
    yield said("throw 10 to 15 cm, same arm: the middle moves by [degree]", shift < -1, f"{shift:.3f}", "-")
    yield most("  O_DH moved to keep it: arm [cm]", "-", kept_by, 1e-9, f"{100 * d:g} to {100 * exact:.3f}")
    yield compared(
        "  for 1 mm of throw, by A0_e/A0_d [um]", f"{1e6 * (small - d):.2f}", 1e6 * slope, 1e6 * (small - d), 0.02, 5
    )


def turning(ds: xr.Dataset) -> Claims:
    """What it matters which way the work turns, on type A; type B is type A in a mirror, which is no finding."""
    fixed = machine(ds) | {"tool_b": float(ds.tool_b), "e": 0.1, "w_x": 0.53}
    spin = {"Omega": [fixed["Omega"], -fixed["Omega"]]}
    both = solved("polisher_wear", along={"radius": ds.radius.values[::10]}, **fixed | spin)
    off = float(abs(both.wear[1] / both.wear[0] - 1).max())
    # the way out takes the crank from one dead point to the other, the way back the rest of its turn
    b, d, f, e = fixed["b"], fixed["d"], fixed["f"], fixed["e"]
    dead = [math.acos((b * b + (f + s * e) ** 2 - d * d) / (2 * b * (f + s * e))) for s in (1, -1)]
    out = 0.5 + (dead[1] - dead[0]) / (2 * math.pi)
    changes = "  so the wear changes where the work turns the other way"
    yield said("share of the crank's turn in which the arm goes out", abs(out - 0.5) > 1e-3, f"{out:.3f}")
    yield said(changes, 1e-3 < off < 0.05, f"{off:.2%}", "> 0.1 %")


def figure(ds: xr.Dataset, p: Profiles, shares: Any) -> Any:
    """The best profiles of one setting, and of the sequence, whose shares are mapped; for a column of print."""
    bored, best = best_settings(ds)
    shown = {"one setting": bored.profile, "one, without a hole": best.profile, "sequence": shares @ p.rows}
    with page_of(128.0, 2, width=110.0) as (page, (profile, share)):
        for colour, (name, row) in zip(COLOURS, shown.items(), strict=False):
            radius = np.linspace(0.0, p.radius[-1], row.size)
            weight = area(radius)
            text = f"{name}, {100 * float(unevenness(row, weight)):.1f} %"
            profile.plot(1e3 * radius, row / (row * weight).sum(), color=colour, label=text)
        profile.set(xlabel="radius [mm]", ylabel="wear over its mean [1]", xlim=(0, 100), ylim=(0, 2))
        profile.legend(loc="upper right")
        grid, offset, e = 100 * shares.reshape(ds.status.shape), 1e3 * (ds.w_x - ds.L).values, 1e3 * ds.e.values
        colour_map(share, offset, e, np.where(grid > 1e-7, grid, np.nan), "share of the wear [%]")
        share.set(xlabel="offset [mm]", ylabel="eccentricity, $e$ [mm]", facecolor="0.92")
        share.set(xlim=(-5, 105), ylim=(10, 170))
    return page


def conclude(path: str) -> Conclusion:
    """Statements and the figure."""
    ds = read_result(path, "polisher_wear", ["e", "w_x"], "polisher_sequence.toml")
    p = profiles(ds)
    shares = p.times(range(len(p.rows)), 0.0)
    groups = {
        "Sequences of settings": optimum(ds, p, shares),
        "The eight tools at e = 10 cm, offset 3 cm": eight_tools(ds),
        "Another throw about the same middle": correction(ds),
        "The way the work turns": turning(ds),
    }
    return groups, [NOTES], lambda: figure(ds, p, shares)


main = script(__name__, "polisher_sequence.h5", conclude)
