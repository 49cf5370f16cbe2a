"""What is the exponent of a foliot's period, P ~ torque^(-s), at any swing and any shares of its losses?

    python studies/law_any_swing.py law_any_swing.h5

By docs/theory/general_law.md, with the amplitude A over phi0, the law L of large swings and 1/M of small ones,

    s = (1 + L x)/(M + x),  x = k (A^2 - 1),                                                             (1)

exact for dry friction, friction of degree 2 or impacts alone, and in both limits. Exact for every clock is, with
p_n = dlnP/dlnc_n for each friction c_n v^n, s = 1/2 + 1/2 sum of (2 - n) p_n. (2)

The clocks are 1280, drawn over a, R, c and n, with e = 1, .99, .9, .5, 0.
"""

import itertools

import numpy as np
from _common import Claims, count, most, said, script, solved
from _figures import COLOURS, HOLLOW, Log, page, panel, points
from _losses import any_swing, shares

BANDS = ((1.0, 1.1, 0.25), (1.1, 2.0, 0.20), (2.0, 10.0, 0.09), (10.0, np.inf, 0.005))
"""Swings over phi0, and the most that (1) may be off there, as a share of s."""
LOSSES: dict[str, tuple[dict[str, float], float]] = {
    "dry": ({"R": 1.0}, 1e-8), "viscous": ({"a": 1.0}, 0.05), "degree 3": ({"c": 1.0, "n": 3.0}, 0.05),
    "degree 2": ({"c": 1e-2, "n": 2.0}, 1e-8), "impacts": ({"e": 0.7}, 1e-8),
}  # fmt: skip
"""Clocks of one loss, and the most that (1) may be off."""


def prepared(ds):
    """The clocks, and one loss alone at many torques, with their laws."""
    single = {}
    for name, (loss, _) in LOSSES.items():
        mu = 1.0 + np.geomspace(1e-3, 1e3, 40) if "R" in loss else np.geomspace(1e-8, 1e8, 50)
        clock = {"a": 0.0, "c": 0.0, "phi0": 1.0, "outputs": ["amplitude", "crossing_speed", "sensitivity"], **loss}
        single[name] = any_swing(shares(solved("foliot", mu=mu, **clock, rtol=1e-10)))
    return any_swing(shares(ds)), single


def claims(ds, single) -> Claims:
    yield "Any losses, any swing"
    off = abs(ds.law / ds.sensitivity - 1.0)
    for share, allowed in ((0.5, 0.004), (0.95, 0.1)):
        yield most(f"{share:.0%} of all clocks", f"(1) to {allowed:.1%}", off.quantile(share), allowed)
    for low, high, allowed in BANDS:
        part = off.where((ds.swing >= low) & (ds.swing < high))
        text = f"{count(part, 'clocks')} within {part.max():.2%}"
        what = f"swings from {low:g} phi0" + (f" to {high:g}" if np.isfinite(high) else "")
        yield most(what, f"(1) to {allowed:.1%}", part, allowed, text)
    near = [float((abs(ds[name] / ds.sensitivity - 1.0) < 0.1).mean()) for name in ("law", "large", "small")]
    text, better = ", ".join(f"{share:.0%}" for share in near), near[0] > 0.9 > 0.75 > max(near[1:])
    yield said("within 10 %: by (1), by large swings, by small", better, text)

    yield "One loss alone"
    for name, line in single.items():
        allowed = LOSSES[name][1]
        text = f"s from {line.sensitivity.max():.4g} to {line.sensitivity.min():.4g}"
        yield most(f"{name} alone", f"(1) to {allowed:g}", line.law / line.sensitivity - 1, allowed, text)

    yield "By the period at other friction"
    few = ds.isel(point=slice(0, 32), e=slice(0, 4)).stack(clock=("point", "e"))
    clock, step = {name: few[name].values for name in ("a", "R", "c", "n", "e")}, 1e-3
    keys = {"design": "zip", "mu": 1.0, "phi0": 1.0, "rtol": 1e-12, "outputs": ["period"]}

    def slope(name: str) -> np.ndarray:
        up, down = (solved("foliot", **keys, **clock | {name: clock[name] * np.exp(d)}) for d in (step, -step))
        return np.log(up.period / down.period).values / (2 * step)

    s = 0.5 + 0.5 * (slope("a") + 2.0 * slope("R") + (2.0 - clock["n"]) * slope("c"))
    text = "s by the kernel's tangent, p_n by its periods"
    yield most(f"(2), {s.size} clocks", "1e-4", s / few.sensitivity - 1, 1e-4, text)


@panel(Log("", (1e-3, 1e2)), Log("exponent, $s$ [1]", (0.02, 30)), "upper right", {"kernel": {"marker": "o", **HOLLOW}})
@panel(Log(r"swing beyond the switch, $A-1$ [1]"), Log("deviation of (1) [% of $s$]", (1e-3, 100)), "lower left")
@page(132.0, sharex=True)
def figure(one, off, ds, single):
    """One loss alone over the swing, and how far (1) is off for every clock."""
    for k, (name, line) in enumerate(list(single.items())[:3]):
        one.plot(line.swing - 1, line.law, color=COLOURS[k], label=name)
        points(one, line.swing - 1, line.sensitivity, k, marker="o", markersize=2.5)
    swing, far = ds.swing.values.ravel() - 1, 100 * abs(ds.law / ds.sensitivity - 1).values.ravel()
    off.plot(swing, far, ".", color="0.75", markersize=1, rasterized=True)
    edges = np.geomspace(1e-3, 20, 10)
    bins = [far[(swing >= low) & (swing < high)] for low, high in itertools.pairwise(edges)]
    for share, dashes in ((95, "-"), (50, "--")):
        kept, look = [np.percentile(b, share) for b in bins], {"color": COLOURS[0], "label": f"{share} % of them"}
        off.plot(np.sqrt(edges[1:] * edges[:-1]), kept, dashes, **look)


main = script(__name__, "law_any_swing.h5", claims, figure, prepared)
