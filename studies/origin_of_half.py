"""Which losses give P ~ mu^(-1/2) at every drive torque, the law that Roup and Denny find?

    python studies/origin_of_half.py origin_of_half.h5

docs/theory/origin_of_half.md has the theory of impacts. For any losses: where
    (i)   every torque of the model is proportional to the drive,
    (ii)  every reset of speeds is of degree 1 in them (restitution, ratios of inertias), and
    (iii) every other force that depends on speed is of degree 2 in it (or there is none),
the change t -> t/g, v -> g v, mu -> g^2 mu makes of every motion another, so P = C mu^(-1/2) exactly and the amplitude
does not depend on the torque. The kernel solves such a foliot in units of its torque, so it can say nothing else: these
exponents and prefactors are measured on `foliot_scene`, followed from rest in SI units.

The exponent of proportional Coulomb friction is that of differences of ln P, since s = -dlnP/dlnmu is at fixed R. Roup
et al., Int. J. Control 76, 1685 (2003), and Denny, Eur. J. Phys. 23, 449 (2002), as Hoyng & Nieuwenhuizen,
arXiv:1604.06681, report them, have mu^(-1/2).
"""

import itertools
import math

import numpy as np
import xarray as xr
from _common import Claims, compared, differing, most, said, script, solved
from _figures import COLOURS, DASHES, LAWS, SLOPE, TORQUE, page, panel

import sweep

E, RHO, FIXED = 0.8, 0.5, 0.5
"""Restitution of impacts; R/mu of Coulomb friction in proportion to the drive; R [rad/s^2] of fixed one."""
TORQUES = (1e-4, 1.0, 1e4)
"""Torques [rad/s^2] at which mixtures are followed in SI units."""
MIXTURES = [
    " + ".join(some)
    for number in range(1, 5)
    for some in itertools.combinations(("impact", "v^2", "viscous", "Coulomb ~ drive", "Coulomb"), number)
    if some[-2:] != ("Coulomb ~ drive", "Coulomb")
]
HALF = [m for m in MIXTURES if "viscous" not in m and not m.endswith("Coulomb")]
"""Those for which (i) to (iii) hold."""
SHOWN = {
    "viscous": r"viscous, $a\dot\varphi$",
    "Coulomb": r"Coulomb, $R = \frac{1}{2} a^2 \varphi_0$",
    "impact": r"impacts, $e = 0.8$",
    "v^2": r"drag, $\dot\varphi^2$",
    "Coulomb ~ drive": r"Coulomb, $R = \frac{1}{2}\mu$",
    "impact + viscous": "viscous and impacts",
}


def without_coulomb(mixture: str) -> dict[str, float]:
    """The parameters of its other losses."""
    return {"e": E if "impact" in mixture else 1.0, "c": float("v^2" in mixture), "a": float("viscous" in mixture)}


def part(ds: xr.Dataset, mixture: str) -> xr.Dataset:
    """The cells of a mixture along mu, those without a cycle left out; `slope` is its local exponent."""
    line = ds.sel(without_coulomb(mixture))
    if "Coulomb ~ drive" in mixture:
        along = xr.DataArray(line.R.values[1:], dims="mu")
        line = line.sel(R=along, mu=along / RHO, method="nearest")
        return line.assign(slope=sweep.local_exponent(line.period, "mu"))
    line = line.sel(R=FIXED if "Coulomb" in mixture else 0.0)
    line = line.isel(mu=line.sensitivity.notnull().values)
    return line.assign(slope=-line.sensitivity)


def claims(ds) -> Claims:
    yield "Exponent -1/2 at every torque"
    cells = [(without_coulomb(m), RHO * x if "Coulomb" in m else 0.0, x) for m in HALF for x in TORQUES]
    losses, dry, mu = zip(*cells, strict=True)
    axes = {"mu": mu, "R": dry} | {name: [cell[name] for cell in losses] for name in ("e", "c")}
    rest = solved("foliot_scene:KERNEL", design="zip", **axes, phi0=1, flips=120, rtol=1e-10)
    both = {"period": 2 * rest.interval, "speed": abs(rest.speed)}
    grid = {name: (("mixture", "mu"), x.values.reshape(len(HALF), -1)) for name, x in both.items()}
    found = xr.Dataset(grid, {"mixture": HALF, "mu": list(TORQUES)})
    for mixture in HALF:
        line = found.sel(mixture=mixture)
        energy = line.speed**2 / line.mu
        yield most(mixture, "-1/2", sweep.local_exponent(line.period, "mu") + 0.5, 1e-8)
        yield most("  its amplitude at every torque", "the same", energy.max() / energy.min() - 1, 1e-8)

    yield "Prefactors"
    flat = (1 - math.exp(-4)) ** 0.25  # c phi0 = 1
    drag = 2 * (math.atanh(flat) + math.atan(flat))
    impact, dry = 4 * math.sqrt((1 + E) / (1 - E)), 8 / math.sqrt(0.75)
    for mixture, text, value in (
        ("impact", "4 (1+e)^(1/2)/(1-e)^(1/2)", impact),
        ("v^2", "2 (artanh l + arctan l), l^4 = 1 - e^-4", drag),
        ("Coulomb ~ drive", "4 (2/rho)^(1/2)/(1-rho^2)^(1/2)", dry),
    ):
        line = found.sel(mixture=mixture).isel(mu=0)
        period = line.period * np.sqrt(line.mu)
        yield compared(f"{mixture}: P (mu/phi0)^(1/2)", f"{text} = {value:.8g}", period, value, 1e-8)

    yield "Other exponents"
    others = {m: part(ds, m) for m in MIXTURES if m not in HALF}
    least, nearest = min((float(abs(line.slope + 0.5).max()), name) for name, line in others.items())
    last = {name: float(line.slope[-1]) for name, line in others.items()}
    of_two = [name for name in others if any(loss in name for loss in ("impact", "v^2", "~ drive"))]
    farthest = max(of_two, key=lambda name: abs(last[name] + 0.5))
    exact = [part(ds, m) for m in MIXTURES if "Coulomb" not in m]
    off = max(float(abs(sweep.local_exponent(line.period, "mu") - line.slope).max()) for line in exact)
    rough = float(np.diff(np.log(ds.mu)).max() ** 4) / 4
    every = f"all {len(of_two)} with a loss of degree two: largest mu, farthest {farthest}"
    yield said(f"least of the greatest distances from -1/2: {nearest}", least > 0.1, f"{least:.3f}", "> 0")
    yield differing("viscous + Coulomb: largest mu", "-1/3", last["viscous + Coulomb"], -1 / 3, 0.01)
    yield differing(every, "-1/2", last[farthest], -0.5, 0.02)
    yield most("differences of ln P against the exact s", "0", off, rough, "largest distance")
    # the drive at which slight impacts take the viscous foliot from -1/3 on to -1/2, by their loss 1 - e^2
    e = 1 - np.array([0.01, 0.003, 0.001])
    s = solved("foliot", e=e, mu=np.geomspace(1e2, 1e14, 241), a=1, phi0=1, rtol=1e-9).sensitivity
    place = sweep.where_exponent(s, "mu", 5 / 12, values=True).abscissa
    fit = sweep.fit_exponent(place.assign_coords(loss=("e", 1 - e**2)), "loss")
    what = f"viscous + impact: s = 5/12 at alpha = {place[0]:.3g} (e = 0.99), {place[-1]:.3g} (0.999)"
    yield differing(f"{what}: ~ (1 - e^2)^x", "-3", fit.exponent, -3, 0.02)


@panel(TORQUE, SLOPE._replace(ends=(-1.06, 0.06), ticks=LAWS), "lower right")
@page(88.0)
def figure(axes, ds):
    """Local exponents over the torque; lines, and points."""
    for i, (mixture, name) in enumerate(SHOWN.items()):
        line, look = part(ds, mixture), {"linestyle": DASHES[i % 4]}
        if "~ drive" in mixture:
            look = {"marker": "o", "linestyle": "", "markerfacecolor": "white"}
        axes.plot(line.mu, line.slope, color=COLOURS[i], label=name, **look)
    axes.set(xlim=(ds.mu.min(), ds.mu.max()))


main = script(__name__, "origin_of_half.h5", claims, figure)
