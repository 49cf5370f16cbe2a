"""Which losses give P ~ mu^(-1/2) at every drive torque, the law that Roup and Denny find?

    sweep run studies/origin_of_half.toml
    python studies/origin_of_half.py origin_of_half.h5

draws origin_of_half.png and prints theory beside what comes out. Theory: where
    (i)   every torque of the model is proportional to the drive,
    (ii)  every reset of speeds is of degree 1 in them (restitution, ratios of inertias), and
    (iii) every other force that depends on speed is of degree 2 in it (or there is none),
the change t -> t/g, v -> g v, mu -> g^2 mu makes of every motion another, so P = C mu^(-1/2) exactly and the amplitude
does not depend on the torque. Impacts are one way to meet this, not the only one. Friction of another degree moves the
exponent: viscous from -1 to -1/3, Coulomb of fixed strength to 0. Derived here; that the exponent -1/2 at every torque
needs (i) to (iii) is not claimed. The kernel solves such a foliot in units of its torque, so it can say nothing else:
the exponents and prefactors of these mixtures are measured on `foliot_scene`, followed from rest in SI units.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, differing, direct_label, page_of, read_result, report

import sweep
from sweep.show.charts import COLOURS, DASHES

E = 0.8
"""Restitution of impacts."""

RHO = 0.5
"""R/mu of Coulomb friction in proportion to the drive."""

FIXED = 0.5
"""R [rad/s^2] of Coulomb friction of fixed strength."""

TORQUES = (1e-4, 1.0, 1e4)
"""Torques [rad/s^2] at which mixtures are followed in SI units."""

NOTES = """\
s = -dlnP/dlnmu; deviations of exponents are differences, others relative. Allowed: 1e-8 of what was followed in SI
units at rtol 1e-10; 0.01 of an exponent at the ends of the grid, 0.02 where impacts or drag act beside friction
proportional Coulomb friction changes with the drive: its exponent is that of differences of ln P, s being at fixed R
Roup et al., Int. J. Control 76, 1685 (2003), and Denny, Eur. J. Phys. 23, 449 (2002), as Hoyng & Nieuwenhuizen,
arXiv:1604.06681, report them: both mu^(-1/2); Roup et al. have motion without friction between inelastic impacts,
which meets (i) to (iii). What Denny's model loses is not said there\
"""


@dataclass(frozen=True)
class Mixture:
    """Losses that act together; Coulomb friction "none", "fixed" or "proportional" to the drive."""

    restitution: bool = False
    drag: bool = False
    viscous: bool = False
    coulomb: str = "none"

    def __str__(self) -> str:
        dry = {"none": "", "fixed": "Coulomb", "proportional": "Coulomb ~ drive"}[self.coulomb]
        names = ("impact" * self.restitution, "v^2" * self.drag, "viscous" * self.viscous, dry)
        return " + ".join(name for name in names if name)

    @property
    def of_degree_two(self) -> bool:
        """Whether (i) to (iii) hold."""
        return not self.viscous and self.coulomb != "fixed"


MIXTURES = tuple(
    Mixture(*on, coulomb)
    for coulomb in ("none", "proportional", "fixed")
    for on in itertools.product((False, True), repeat=3)
    if any(on) or coulomb != "none"
)


def part(ds: xr.Dataset, mixture: Mixture) -> xr.Dataset:
    """The cells of a mixture along mu, those without a cycle left out; `slope` is its local exponent."""
    on = {"e": E if mixture.restitution else 1.0, "c": float(mixture.drag), "a": float(mixture.viscous)}
    line = ds.sel(on)
    if mixture.coulomb == "proportional":
        along = xr.DataArray(line.R.values[1:], dims="mu")
        line = line.sel(R=along, mu=along / RHO, method="nearest")
        return line.assign(slope=sweep.local_exponent(line.period, "mu"))
    line = line.sel(R=FIXED if mixture.coulomb == "fixed" else 0.0)
    line = line.isel(mu=line.sensitivity.notnull().values)
    return line.assign(slope=-line.sensitivity)


def followed(torques: Sequence[float] = TORQUES) -> dict[Mixture, xr.Dataset]:
    """`period` [s] and `speed` at the switch [rad/s] over mu of the mixtures that meet (i) to (iii), in SI units."""
    mixtures = [m for m in MIXTURES if m.of_degree_two]
    mu = np.tile(torques, len(mixtures))
    of = {
        "e": [E if m.restitution else 1.0 for m in mixtures],
        "c": [float(m.drag) for m in mixtures],
        "R": [RHO if m.coulomb == "proportional" else 0.0 for m in mixtures],
    }
    axes = {"mu": mu} | {name: np.repeat(values, len(torques)) for name, values in of.items()}
    axes["R"] = axes["R"] * mu
    study = sweep.study(
        kernel="foliot_scene:KERNEL", design="zip", axes=axes, fixed={"phi0": 1.0, "flips": 120}, rtol=1e-10,
        allow_import=True,
    )  # fmt: skip
    ds = sweep.run(study)
    period, speed = (2 * ds.interval).values, abs(ds.speed.values)
    one = {}
    for i, mixture in enumerate(mixtures):
        part = slice(i * len(torques), (i + 1) * len(torques))
        values = {"period": ("mu", period[part]), "speed": ("mu", speed[part])}
        one[mixture] = xr.Dataset(values, {"mu": list(torques)})
    return one


def always_half(found: dict[Mixture, xr.Dataset]) -> list[Statement]:
    """The mixtures that meet (i) to (iii): exponent and, by the speed at the switch, amplitude at all torques."""
    lines = []
    for mixture, line in found.items():
        slopes = np.diff(np.log(line.period)) / np.diff(np.log(line.mu))
        off = float(abs(slopes + 0.5).max())
        energy = line.speed**2 / line.mu
        spread = float(energy.max() / energy.min() - 1)
        here = f"-1/2 off by at most; A's spread {spread:.0e}"
        lines.append(Statement(f"{mixture}", "-1/2, A constant", here, off, off < 1e-8 and spread < 1e-8))
    return lines


def never_half(ds: xr.Dataset) -> list[Statement]:
    """All others: how far from -1/2 their exponent comes, and where it tends to."""
    others = {str(m): part(ds, m) for m in MIXTURES if not m.of_degree_two}
    nearest = min(others, key=lambda name: float(abs(others[name].slope + 0.5).max()))
    least = float(abs(others[nearest].slope + 0.5).max())
    found = [
        Statement(f"least of the greatest distances from -1/2: {nearest}", "> 0", f"{least:.3f}", None, least > 0.1),
        differing("viscous: smallest mu", "-1", float(others["viscous"].slope[0]), -1, 0.01, 6),
        differing("viscous: largest mu", "-1/3", float(others["viscous"].slope[-1]), -1 / 3, 0.01, 6),
        differing("Coulomb: largest mu", "0", float(others["Coulomb"].slope[-1]), 0, 0.01, 3),
        differing(
            "viscous + Coulomb: largest mu", "-1/3", float(others["viscous + Coulomb"].slope[-1]), -1 / 3, 0.01, 6
        ),
    ]
    with_two = {m: x for m, x in others.items() if set(m.split(" + ")) & {"impact", "v^2", "Coulomb ~ drive"}}
    last = {m: float(x.slope[-1]) for m, x in with_two.items()}
    farthest = max(last, key=lambda m: abs(last[m] + 0.5))
    what = f"all {len(last)} with a loss of degree two: largest mu, farthest {farthest}"
    return [*found, differing(what, "-1/2", last[farthest], -0.5, 0.02, 6), agreement(ds)]


def agreement(ds: xr.Dataset) -> Statement:
    """The exact s against differences of ln P."""
    lines = [part(ds, m) for m in MIXTURES if m.coulomb == "none"]
    off = max(float(abs(sweep.local_exponent(line.period, "mu") - line.slope).max()) for line in lines)
    rough = float(np.diff(np.log(ds.mu)).max() ** 4) / 4
    return Statement("differences of ln P against the exact s", "0", "largest distance", off, off < rough)


def prefactors(found: dict[Mixture, xr.Dataset]) -> list[Statement]:
    """C of P = C (phi0/mu)^(1/2) and the speed at the switch where one loss of degree two acts alone."""
    flat = (1 - math.exp(-4)) ** 0.25  # c phi0 = 1
    known = {
        Mixture(restitution=True): ("4 (1+e)^(1/2)/(1-e)^(1/2)", 4 * math.sqrt((1 + E) / (1 - E)), 4 / (1 - E**2)),
        Mixture(drag=True): (
            "2 (artanh l + arctan l), l^4 = 1 - e^-4", 2 * (math.atanh(flat) + math.atan(flat)), flat**2,
        ),
        Mixture(coulomb="proportional"): (
            "4 (2/rho)^(1/2)/(1-rho^2)^(1/2)", 8 / math.sqrt(0.75), 2 * (1 - RHO**2) / RHO,
        ),
    }  # fmt: skip
    lines = []
    for mixture, (text, value, square) in known.items():
        line = found[mixture].isel(mu=0)
        period, energy = float(line.period * np.sqrt(line.mu)), float(line.speed**2 / line.mu)
        lines.append(compared(f"{mixture}: P (mu/phi0)^(1/2)", f"{text} = {value:.8g}", period, value, 1e-8))
        lines.append(compared(f"{mixture}: v0^2/(mu phi0)", f"{square:.8g}", energy, square, 1e-8))
    return lines


def slight_impacts() -> Statement:
    """The drive at which slight impacts take the viscous foliot from -1/3 on to -1/2, by their loss 1 - e^2."""
    e, mu = 1 - np.array([0.01, 0.003, 0.001]), np.geomspace(1e2, 1e14, 241)
    study = sweep.study(kernel="foliot", rtol=1e-9, axes={"e": e, "mu": mu}, fixed={"a": 1.0, "phi0": 1.0})
    place = sweep.where_exponent(sweep.run(study).sensitivity, "mu", 5 / 12, values=True).abscissa
    place = xr.DataArray(place.values, {"loss": 1 - e**2}, ("loss",), "alpha")
    fit = sweep.fit_exponent(place, "loss")
    what = f"viscous + impact: s = 5/12 at alpha = {float(place[0]):.3g} (e = 0.99), {float(place[-1]):.3g} (0.999)"
    return differing(f"{what}: ~ (1 - e^2)^x", "-3", fit.exponent.item(), -3, 0.02, 5)


def figure(ds: xr.Dataset) -> Any:
    """Periods in units of (phi0/mu)^(1/2), and exponents."""
    with page_of(80.0, 1, 2) as (page, (left, right)):
        draw_periods(left, ds)
        draw_exponents(right, ds)
        for axes in (left, right):
            axes.set_xlabel(r"torque, $\mu/(a^2\varphi_0)$ [1]")
    return page


SHOWN = {
    r"viscous, $a\dot\varphi$": Mixture(viscous=True),
    r"Coulomb, $R = \frac{1}{2} a^2 \varphi_0$": Mixture(coulomb="fixed"),
    r"impacts, $e = 0.8$": Mixture(restitution=True),
    r"drag, $\dot\varphi^2$": Mixture(drag=True),
    r"Coulomb, $R = \frac{1}{2}\mu$": Mixture(coulomb="proportional"),
    "viscous and impacts": Mixture(restitution=True, viscous=True),
}


def draw(axes: Any, ds: xr.Dataset, value: Any) -> None:
    """`value` of the shown mixtures against mu: lines, and points for proportional friction."""
    for i, (name, mixture) in enumerate(SHOWN.items()):
        line = part(ds, mixture)
        look = {"linestyle": DASHES[i % 4]}
        if mixture.coulomb == "proportional":
            look = {"marker": "o", "linestyle": "", "markerfacecolor": "white"}
        axes.plot(line.mu, value(line), color=COLOURS[i], label=name, **look)
    axes.set(xscale="log", xlim=(ds.mu.min(), ds.mu.max()))


def draw_periods(axes: Any, ds: xr.Dataset) -> None:
    """P (mu/phi0)^(1/2): flat where P ~ mu^(-1/2)."""
    axes.set(yscale="log", ylim=(3, 2e4), ylabel=r"$P\,(\mu/\varphi_0)^{1/2}$ [1]")
    draw(axes, ds, lambda line: line.period * np.sqrt(line.mu / line.phi0))
    for x, y, text in (
        (2e-2, 2e3, r"slope $-\frac{1}{2}$: $P\propto\mu^{-1}$"),
        (3e2, 6e3, r"slope $\frac{1}{2}$: $P$ constant"),
        (2.5e4, 95, r"slope $\frac{1}{6}$: $P\propto\mu^{-1/3}$"),
        (3e-4, 4.7, r"flat: $P\propto\mu^{-1/2}$"),
    ):
        direct_label(axes, x, y, text, fontsize=7)


def draw_exponents(axes: Any, ds: xr.Dataset) -> None:
    """Local exponents of the period."""
    axes.set(ylim=(-1.06, 0.06), ylabel=r"exponent, $\mathrm{d}\ln P/\mathrm{d}\ln\mu$ [1]")
    draw(axes, ds, lambda line: line.slope)
    axes.set_yticks([-1, -1 / 2, -1 / 3, 0], labels=["$-1$", r"$-\frac{1}{2}$", r"$-\frac{1}{3}$", "0"])
    axes.set_yticks([], minor=True)
    axes.legend(loc="lower right")


def conclude(path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = read_result(path, "foliot", ["e", "c", "a", "R", "mu"], "origin_of_half.toml")
    found = followed()
    groups = {"Exponent -1/2 at every torque": always_half(found), "Prefactors": prefactors(found)}
    groups["Other exponents"] = [*never_half(ds), slight_impacts()]
    return groups, [NOTES], lambda: figure(ds)


main = partial(report, __file__, ["origin_of_half.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
