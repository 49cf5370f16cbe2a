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
from _figures import page_of
from _polishing import KEPT, POINTS, area, best_settings, disc, least, one_setting, swings, tool_wear, unevenness
from scipy.optimize import brentq, nnls

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


def mixture(ds: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Profiles of mean 1, one a row; the shares of the wear by each; the mixed profile."""
    weight = area(ds.radius)
    rows = ds.wear.stack(setting=("e", "w_x")).transpose("setting", "radius").values
    rows = rows / (rows * weight).sum(axis=1, keepdims=True)
    root = np.sqrt(weight)
    shares, _ = nnls((rows * root).T, root)
    shares = shares / shares.sum()
    return rows, shares, shares @ rows


def optimum(ds: xr.Dataset) -> Claims:
    """What a sequence gains over one setting, and whether it is the best."""
    weight, (rows, shares, mixed) = area(ds.radius), mixture(ds)
    scale = float((mixed * weight).sum() / (mixed**2 * weight).sum())
    slope = rows @ ((scale * mixed - 1) * weight)  # of the sum of squares, 0 where a share is above 0
    used = shares > 1e-9
    worst = max(abs(slope[used]).max(), -slope[~used].min(initial=0.0))
    best, single = float(unevenness(mixed, weight)), best_settings(ds)[0].uneven
    holds = best < single / 35 and least(mixed, weight, ds.radius.values) > KEPT
    places = [(100 * e, 100 * (w - float(ds.L))) for e in ds.e.values for w in ds.w_x.values]
    order = [i for i in np.argsort(-shares) if shares[i] > 0.01]
    yield from one_setting(ds)
    yield said("best sequence", holds, f"{best:.1%}, centre {mixed[0]:.2f}, {used.sum()} settings", "-")
    yield most("  conditions of an optimum", "0", worst, 1e-6, "largest breach")
    yield from (
        Statement(f"  {shares[i]:.0%} of the wear at", "", "e = {:g} cm, offset {:.0f} cm".format(*places[i]))
        for i in order
    )


def eight_tools(ds: xr.Dataset) -> Claims:
    """Wear by each tool of the paper's figure 5, its half widths 4 cm times a and b, and the same in all by its points.

    What the work loses, 2 pi times the integral of the wear over r dr, follows from the mean speed of its points.
    """
    names = ("b", "d", "f", "L", "preston", "pressure", "omega", "b_angle", "Omega")
    fixed = {name: float(ds[name]) for name in names} | {"e": 0.1, "w_x": float(ds.w_x[3])}
    n, m, a, b = np.array(TOOLS).T
    radius = np.linspace(0.0, 0.4, 401)
    sizes = {"tool_n": n, "tool_m": m, "tool_a": 0.04 * a, "tool_b": 0.04 * b}
    wear = solved("polisher_wear", design="zip", along={"radius": radius}, rtol=1e-5, **sizes, **fixed).wear.values
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
    names = ("b", "d", "f", "L", "tool_a", "tool_b", "preston", "pressure", "omega", "b_angle")
    fixed, spin = {name: float(ds[name]) for name in names} | {"e": 0.1, "w_x": 0.53}, float(ds.Omega)
    both = solved("polisher_wear", Omega=[spin, -spin], along={"radius": ds.radius.values[::10]}, **fixed)
    off = float(abs(both.wear[1] / both.wear[0] - 1).max())
    # the way out takes the crank from one dead point to the other, the way back the rest of its turn
    b, d, f, e = fixed["b"], fixed["d"], fixed["f"], fixed["e"]
    dead = [math.acos((b * b + (f + s * e) ** 2 - d * d) / (2 * b * (f + s * e))) for s in (1, -1)]
    out = 0.5 + (dead[1] - dead[0]) / (2 * math.pi)
    changes = "  so the wear changes where the work turns the other way"
    yield said("share of the crank's turn in which the arm goes out", abs(out - 0.5) > 1e-3, f"{out:.3f}")
    yield said(changes, 1e-3 < off < 0.05, f"{off:.2%}", "> 0.1 %")


def figure(ds: xr.Dataset) -> Any:
    """Machines, tools, profiles and shares; for two columns of print."""
    with page_of(112.0, 2, 2) as (page, ((machines, tools), (profiles, shares))):
        draw_machines(machines, ds)
        draw_tools(tools)
        draw_profiles(profiles, ds)
        draw_shares(page, shares, ds)
    return page


def draw_machines(axes: Any, ds: xr.Dataset) -> None:
    """Pivot, motor, crank, coupler and arm of both types at e = 10 cm, the paper's figure 3."""
    b, d, e, turn = float(ds.b), float(ds.d), 0.1, 1.0
    ring, pin = np.linspace(0, 2 * np.pi, 100), (b + e * math.cos(turn), e * math.sin(turn))
    axes.plot(b + e * np.cos(ring), e * np.sin(ring), color="0.7", linewidth=0.8, label="circle of the crank")
    axes.plot([b, pin[0]], [0, pin[1]], color="black", label="crank, $e$")
    machine = {"b": b, "d": d, "f": float(ds.f), "e": e, "omega": 1.0}
    motion = solved("polisher_motion", type=["A", "B"], along={"crank_angle": [turn]}, outputs=["alpha"], **machine)
    for k, (kind, alpha) in enumerate(zip("AB", motion.alpha.values.ravel(), strict=True)):
        x, y = d * math.cos(alpha), d * math.sin(alpha)
        axes.plot([0, x], [0, y], color=COLOURS[k], label=f"arm, type {kind}")
        axes.plot([x, pin[0]], [y, pin[1]], "--", color=COLOURS[k], label=f"coupler, type {kind}")
    axes.plot([0, b], [0, 0], "o", color="black", markersize=4, label="pivot, motor")
    axes.set(xlabel="$x$ [m]", ylabel="$y$ [m]", xlim=(-0.25, 0.95), ylim=(-0.19, 0.53))
    axes.set_aspect("equal", "box")
    axes.legend(loc="upper center", fontsize=6.5, ncols=2)


def draw_tools(axes: Any) -> None:
    """Outlines of the paper's figure 5."""
    t = np.linspace(0, 1, 400)
    for k, (n, m, a, b) in enumerate(TOOLS):
        x = np.concatenate([t, t[::-1]]) ** (1 if n >= 1 else 2)
        y = (1 - np.minimum(x**n, 1)) ** (1 / m)
        y[400:] *= -1
        centre = np.array([4.4 * (k % 4), -5.4 * (k // 4)])
        for side in (1, -1):
            axes.plot(centre[0] + side * a * x, centre[1] + b * y, color=COLOURS[0 if k < 5 else 1], linewidth=1)
        axes.text(centre[0], centre[1] + 2.25, f"${n:g},{m:g}$", ha="center", fontsize=7)
    axes.plot([], [], color=COLOURS[0], label="known")
    axes.plot([], [], color=COLOURS[1], label="unknown")
    axes.set(xlim=(-5.6, 18.8), ylim=(-10.7, 3.6), xlabel="across [half widths]", ylabel="along [half widths]")
    axes.set_aspect("equal", "box")
    axes.legend(loc="lower center", ncols=2, fontsize=7, title="$n, m$ of the paper's tools", title_fontsize=7)


def draw_profiles(axes: Any, ds: xr.Dataset) -> None:
    """The best profiles of one setting, and of the sequence."""
    (bored, best), wear = best_settings(ds), disc(ds)
    fine, coarse = np.linspace(0.0, float(ds.radius[-1]), POINTS), ds.radius.values
    shown = {
        "one setting": (fine, np.asarray(wear(bored.e, float(ds.L) + bored.offset))),
        "one, without a hole": (fine, np.asarray(wear(best.e, float(ds.L) + best.offset))),
        "sequence": (coarse, mixture(ds)[2]),
    }
    for k, (name, (radius, row)) in enumerate(shown.items()):
        weight = area(radius)
        text = f"{name}, {100 * float(unevenness(row, weight)):.1f} %"
        axes.plot(1e3 * radius, row / (row * weight).sum(), color=COLOURS[k], label=text)
    axes.set(xlabel="radius [mm]", ylabel="wear over its mean [1]", xlim=(0, 100), ylim=(0, 2))
    axes.legend(loc="upper right", fontsize=7)


def draw_shares(page: Any, axes: Any, ds: xr.Dataset) -> None:
    """Share of the wear at each setting."""
    _, shares, _ = mixture(ds)
    grid = 100 * shares.reshape(ds.sizes["e"], ds.sizes["w_x"])
    offset = 1e3 * (ds.w_x.values - float(ds.L))
    mesh = axes.pcolormesh(offset, 1e3 * ds.e.values, grid, cmap="cividis", shading="nearest", rasterized=True)
    page.colorbar(mesh, ax=axes, label="share of the wear [%]", pad=0.02)
    unused = np.argwhere(grid < 1e-7).T
    axes.plot(offset[unused[1]], 1e3 * ds.e.values[unused[0]], ".", color="0.7", markersize=2, label="setting not used")
    axes.legend(loc="upper right", fontsize=7, frameon=True, framealpha=0.85)
    axes.set(xlabel="offset [mm]", ylabel="eccentricity, $e$ [mm]")


def conclude(path: str) -> Conclusion:
    """Statements and the figure."""
    ds = read_result(path, "polisher_wear", ["e", "w_x"], "polisher_sequence.toml")
    groups = {
        "Sequences of settings": optimum(ds),
        "The eight tools at e = 10 cm, offset 3 cm": eight_tools(ds),
        "Another throw about the same middle": correction(ds),
        "The way the work turns": turning(ds),
    }
    return groups, [NOTES], lambda: figure(ds)


main = script(__name__, "polisher_sequence.h5", conclude)
