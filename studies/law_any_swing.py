"""What is the exponent of a foliot's period, P ~ torque^(-s), at any swing and any shares of its losses?

    python studies/law_any_swing.py law_any_swing.h5

By docs/theory/general_law.md, with the share lambda_n of friction of degree n in the energy of half a swing, that of
impacts lambda_e, N = sum of n lambda_n, A the amplitude over phi0, L = (N + lambda_e)/(N + 2), the law of large swings,
and M = N + 2 lambda_e, where 1/M is that of small ones,
    s = (1 + L x)/(M + x),  x = k (A^2 - 1),  1/k = sum of lambda_n/k_n + lambda_e/5,                            (1)
k_n = 2 (2n + 1)(3n + 2)/(n + 2)^2, which is exact for dry friction alone, for friction of degree 2 or impacts alone,
and in both limits. Exact for every clock is, with p_n = dlnP/dlnc_n for each friction c_n v^n,
    s = 1/2 + 1/2 sum of (2 - n) p_n.                                                                            (2)

The clocks are 1280, drawn over a, R, c and n, with e = 1, .99, .9, .5, 0.
"""

import itertools

import numpy as np
import xarray as xr
from _common import Claims, Statement, count, most, said, script, solved
from _figures import COLOURS, Log, page, panel
from _losses import any_swing, shares

import sweep

BANDS = ((1.0, 1.1, 0.25), (1.1, 2.0, 0.20), (2.0, 10.0, 0.09), (10.0, np.inf, 0.005))
"""Swings over phi0, and the most that (1) may be off there, as a share of s."""
KERNEL = {"linestyle": "", "markersize": 2.5, "markerfacecolor": "white"}
"""Marks of the kernel."""
SAMPLE = 32
STEP = 1e-3
"""Of ln c_n, in the differences of (2); their error is the square of it."""
LOSSES: dict[str, tuple[dict[str, float], float]] = {
    "dry": ({"R": 1.0}, 1e-8), "viscous": ({"a": 1.0}, 0.05), "degree 3": ({"c": 1.0, "n": 3.0}, 0.05),
    "degree 2": ({"c": 1e-2, "n": 2.0}, 1e-8), "impacts": ({"e": 0.7}, 1e-8),
}  # fmt: skip
"""Clocks of one loss, and the most that (1) may be off."""


def alone(name: str) -> xr.Dataset:
    """One loss at many torques, with its laws."""
    clock = {"a": 0.0, "c": 0.0, "phi0": 1.0, **LOSSES[name][0]}
    mu = 1.0 + np.geomspace(1e-3, 1e3, 40) if "R" in clock else np.geomspace(1e-8, 1e8, 50)
    outputs = ["amplitude", "crossing_speed", "sensitivity"]
    return any_swing(shares(solved("foliot", mu=mu, **clock, outputs=outputs, rtol=1e-10)))


def claims(ds, single) -> Claims:
    yield "Any losses, any swing"
    off = abs(ds.law / ds.sensitivity - 1.0)
    half, nearly = off.quantile([0.5, 0.95]).values
    usual, text = bool(half < 0.004 and nearly < 0.1), f"{half:.2%}, {nearly:.1%}"
    yield Statement("all clocks: half of them, 95 % of them within", "", text, nearly, usual)
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
    few = ds.isel(point=slice(0, SAMPLE), e=slice(0, 4)).stack(clock=("point", "e"))
    clock = {name: few[name].values for name in ("a", "R", "c", "n", "e")}
    study = {"kernel": "foliot", "outputs": ["period"], "rtol": 1e-12, "axes": {name: [0.5] for name in clock}}
    period = sweep.solver({**study, "fixed": {"mu": 1.0, "phi0": 1.0}})

    def slope(name: str) -> np.ndarray:
        up, down = (period(**{**clock, name: clock[name] * np.exp(sign * STEP)}).period for sign in (1, -1))
        return np.log(up / down) / (2 * STEP)

    with np.errstate(divide="ignore", invalid="ignore"):
        s = 0.5 + 0.5 * (slope("a") + 2.0 * slope("R") + (2.0 - clock["n"]) * slope("c"))
    text = "s by the kernel's tangent, p_n by its periods"
    yield most(f"(2), {SAMPLE * 4} clocks", "1e-4", s / few.sensitivity - 1, 1e-4, text)


@panel(Log("", (1e-3, 1e2)), Log("exponent, $s$ [1]", (0.02, 30)), "upper right", {"kernel": {"marker": "o", **KERNEL}})
@panel(Log(r"swing beyond the switch, $A-1$ [1]"), Log("deviation of (1) [% of $s$]", (1e-3, 100)), "lower left")
@page(132.0, sharex=True)
def figure(one, off, ds, single):
    """One loss alone over the swing, and how far (1) is off for every clock."""
    for colour, (name, line) in zip(COLOURS, list(single.items())[:3], strict=False):
        one.plot(line.swing - 1, line.law, color=colour, label=name)
        one.plot(line.swing - 1, line.sensitivity, "o", color=colour, **KERNEL)
    swing, far = ds.swing.values.ravel() - 1, 100 * abs(ds.law.values.ravel() / ds.sensitivity.values.ravel() - 1)
    off.plot(swing, far, ".", color="0.75", markersize=1, rasterized=True)
    edges = np.geomspace(1e-3, 20, 10)
    bins = [far[(swing >= low) & (swing < high)] for low, high in itertools.pairwise(edges)]
    for share, dashes in ((95, "-"), (50, "--")):
        kept, look = [np.percentile(b, share) for b in bins], {"color": COLOURS[0], "label": f"{share} % of them"}
        off.plot(np.sqrt(edges[1:] * edges[:-1]), kept, dashes, **look)


main = script(
    __name__,
    "law_any_swing.h5",
    claims,
    figure,
    lambda ds: (any_swing(shares(ds)), {name: alone(name) for name in LOSSES}),
)
