"""Which sequence of settings polishes evenly, and how does a machine keep its middle when its throw changes?

    python studies/polisher_sequence.py polisher_sequence.h5

Wear adds up, so the time t_i >= 0 spent at setting i of the sweep wears the sum of t_i h_i(r); the most even sum of
given mean is a least-squares problem over the area with t >= 0. The unevenness is the standard deviation over the area,
over the mean.
"""

import math

import numpy as np
from _common import Claims, Statement, compared, most, said, script, solved
from _figures import COLOURS, Axis, colour_map, page, panel
from _polishing import KEPT, area, best_settings, least, machine, profiles, unevenness
from scipy.optimize import brentq

TOOLS = np.array([
    (2, 2, 1, 1), (2, 2, 1, 2), (1, 1, 1, 2), (0.5, 0.5, 1, 2), (100, 100, 1, 2),
    (2, 1, 1, 2), (2, 0.5, 1, 2), (2, 8, 1, 2),
])  # fmt: skip
"""n, m, a, b of the paper's figure 5, abs(X/a)^n + abs(Y/b)^m <= 1: five known tools, three unknown ones."""


def middle(d: float, e: float, b: float, f: float) -> float:
    """A0 [rad] by (39)."""
    return 0.5 * sum(math.acos((b * b + d * d - (f + s * e) ** 2) / (2 * b * d)) for s in (1, -1))


def claims(ds, p, shares) -> Claims:
    yield "Sequences of settings"
    mixed, best, single = shares @ p.rows, p.nominal(range(len(p.rows)), shares), best_settings(ds)[0].uneven
    holds = best < single / 35 and least(mixed, p.weight, p.radius) > KEPT
    here = f"{best:.1%} for {single:.1%}, centre {mixed[0]:.2f}, {np.sum(shares > 1e-9)} settings"
    yield said("best sequence, for the best of one setting", holds, here, "1/35")
    yield most("  conditions of an optimum", "0", p.breach(shares, 0.0), 1e-6, "largest breach")
    for i in np.argsort(-shares)[: np.sum(shares > 0.01)]:
        e, offset = (100 * x for x in p.places[i])
        yield Statement(f"  {shares[i]:.0%} of the wear at", "", f"e = {e:g} cm, offset {offset:.0f} cm")

    yield "The eight tools at e = 10 cm, offset 3 cm"
    n, m, a, b = TOOLS.T
    sizes = {"tool_n": n, "tool_m": m, "tool_a": 0.04 * a, "tool_b": 0.04 * b}
    given, along = machine(ds) | sizes | {"e": 0.1, "w_x": float(ds.w_x[3])}, {"radius": ds.radius.values}
    worn = solved("polisher_wear", design="zip", along=along, rtol=1e-5, **given).wear.values
    found = unevenness(worn, area(ds.radius))
    for row, uneven in zip(TOOLS, found, strict=True):
        yield Statement("n, m = {:g}, {:g}, a, b = {:g}, {:g}: uneven by".format(*row), "", f"{uneven:.0%}")
    yield said("the disc is the most even of them", found.argmin() == 0, f"{found[0]:.0%}")

    yield "Another throw about the same middle"
    b, d, f = (float(ds[name]) for name in "bdf")
    kept = middle(d, 0.10, b, f)
    exact, small = (brentq(lambda x, e=e: middle(x, e, b, f) - kept, 0.37, 0.45, xtol=1e-15) for e in (0.15, 0.101))
    # the kernel's own angles there, and its slopes for small steps
    cells = solved("polisher", design="zip", d=[d, exact, d], e=[0.10, 0.15, 0.15], b=b, f=f)
    slope = -float(cells.A0_e[0] / cells.A0_d[0]) * 1e-3
    kept_by, shift = float(cells.A0[1] - cells.A0[0]), math.degrees(float(cells.A0[2] - cells.A0[0]))
    yield said("throw 10 to 15 cm, same arm: the middle moves by [degree]", shift < -1, f"{shift:.3f}", "-")
    yield most("  O_DH moved to keep it: arm [cm]", "-", kept_by, 1e-9, f"{100 * d:g} to {100 * exact:.3f}")
    step = 1e6 * (small - d)
    yield compared("  for 1 mm of throw, by A0_e/A0_d [um]", f"{step:.2f}", 1e6 * slope, step, 0.02)


@panel(Axis("radius [mm]", (0, 100)), Axis("wear over its mean [1]", (0, 2)), "upper right")
@panel(Axis("offset [mm]", (-5, 105)), Axis("eccentricity, $e$ [mm]", (10, 170)))
@page(128.0)
def figure(profile, share, ds, p, shares):
    """The best profiles of one setting, and of the sequence, whose shares are mapped."""
    bored, best = best_settings(ds)
    shown = {"one setting": bored.profile, "one, without a hole": best.profile, "sequence": shares @ p.rows}
    for colour, (name, row) in zip(COLOURS, shown.items(), strict=False):
        radius = np.linspace(0.0, p.radius[-1], row.size)
        weight = area(radius)
        text = f"{name}, {100 * float(unevenness(row, weight)):.1f} %"
        profile.plot(1e3 * radius, row / (row * weight).sum(), color=colour, label=text)
    grid, offset, e = 100 * shares.reshape(ds.status.shape), 1e3 * (ds.w_x - ds.L).values, 1e3 * ds.e.values
    colour_map(share, offset, e, np.where(grid > 1e-7, grid, np.nan), "share of the wear [%]")
    share.set(facecolor="0.92")


def prepared(ds):
    """The sweep, its profiles, and the shares of the most even sequence."""
    return ds, (p := profiles(ds)), p.times(range(len(p.rows)), 0.0)


main = script(__name__, "polisher_sequence.h5", claims, figure, prepared)
