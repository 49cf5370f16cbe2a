"""How does the period fall with the torque in the three models of a verge and foliot?

    sweep run studies/three_models.toml
    sweep run studies/three_models_denny.toml
    sweep run studies/three_models_viscous.toml
    python studies/three_models.py three_models.h5 three_models_denny.h5 three_models_viscous.h5

draws three_models.png, prints theory beside what comes out, and writes the three models as one dataset,
three_models_all.nc. Where every loss is a share of the motion (restitution, inertias) time has no other unit than the
one the torque gives, so P ~ torque^(-1/2) and the amplitude does not depend on it; friction brings in a time 1/a, and
with it P ~ torque^(-1) at weak and torque^(-1/3) at strong drive. Of Lepschy, Roup and Denny only the abstracts were at
hand: the models are of their kind, no number is theirs.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, differing, direct_label, read_result, report

import sweep
from sweep.analysis.exponents import fit_exponent, local_exponent

MODELS = ("two bodies", "kept share", "viscous")

NOTES = """\
theory: P ~ torque^(-s); deviation: relative, of exponents the difference. In words: impacts alone cannot give any other
exponent than 1/2, whatever the inertias, the restitution or the pallets are, and they leave the swing alone; a period
that falls as 1/torque or as torque^(-1/3), or a swing that grows with the torque, shows friction. At 1/2 a torque that
is 1 % low makes the clock 0.5 % slow, 7.2 minutes a day. Without drop two plastic bodies are one that keeps the share
(m - M)/(m + M); a wheel heavier than the foliot makes it negative: the same period formula, but the foliot turns round
at the switch, and its swing is the way to the switch alone"""


def together(impact: xr.Dataset, denny: xr.Dataset, viscous: xr.Dataset) -> xr.Dataset:
    """The three models over torque [N m]: `period`, `amplitude` [rad], `multiplier` and the local `exponent`."""
    impact = impact.assign(amplitude=(impact.swing / impact.r_v).assign_attrs(units="rad"))
    parts = [impact[["period", "amplitude", "multiplier"]].reset_coords(drop=True)]
    for one in (denny, viscous):
        torque = (one.mu / _drive(impact)).rename(mu="torque").assign_coords(torque=impact.torque.values)
        if not np.allclose(torque, impact.torque, rtol=1e-12):
            raise sweep.SweepError("the three grids are not of the same torques; make them from the studies' files")
        part = one[["period", "amplitude", "multiplier"]].reset_coords(drop=True).rename(mu="torque")
        parts.append(part.assign_coords(torque=impact.torque))
    ds = xr.concat(parts, xr.DataArray(list(MODELS), dims="model", name="model"), combine_attrs="drop_conflicts")
    ds = ds.assign(exponent=local_exponent(ds.period, "torque"))
    ds.attrs = {"title": "Period against torque in three models of a verge and foliot"}
    return ds


def _drive(impact: xr.Dataset) -> float:
    """What a torque of 1 N m on the wheel does to foliot and wheel together [rad/s^2 of the foliot]."""
    return float(impact.r_v / impact.r_c / (impact.I_v * (1 + _kappa(impact))))


def _kappa(impact: xr.Dataset) -> float:
    """Mass of the wheel over that of the foliot, both at the pallet."""
    return float((impact.I_c / impact.r_c**2) / (impact.I_v / impact.r_v**2))


def laws(ds: xr.Dataset) -> list[Statement]:
    """Exponents of the three models."""
    found = []
    for name in MODELS[:2]:
        fit = fit_exponent(ds.period.sel(model=name), "torque")
        found.append(differing(f"exponent, {name}", "-1/2", float(fit.exponent), -0.5, 1e-12))
    weak, strong = (ds.exponent.sel(model="viscous").isel(torque=i) for i in (0, -1))
    found += [
        differing("exponent, viscous, weakest drive", "-1", float(weak), -1.0, 0.01, 5),
        differing("exponent, viscous, strongest drive", "-1/3", float(strong), -1 / 3, 0.01, 5),
    ]
    half = sweep.where_exponent(ds.period.sel(model="viscous"), "torque", -0.5)
    return [*found, Statement("torque at which viscous friction gives -1/2", "", f"{float(half.abscissa):.4g} N m")]


def swings(ds: xr.Dataset) -> list[Statement]:
    """Whether the swing depends on the torque."""
    spread = ds.amplitude.max("torque") / ds.amplitude.min("torque") - 1
    found = []
    for name in MODELS[:2]:
        off = float(spread.sel(model=name))
        found.append(Statement(f"spread of the swing, {name}", "0", "", off, off < 1e-12))
    wide = float(spread.sel(model="viscous"))
    return [*found, Statement("spread of the swing, viscous", "> 0", f"{1 + wide:.3g} times", None, wide > 1)]


def identity(ds: xr.Dataset, impact: xr.Dataset) -> list[Statement]:
    """How near the two-body clock is to one body that keeps (m - M)/(m + M) of its speed."""
    e = (1 - _kappa(impact)) / (1 + _kappa(impact))
    pitch = float(2 * math.pi * impact.r_c / impact.teeth)
    drop = 0.5 - 2 * float(impact.h) / pitch
    two, one = (ds.sel(model=name).isel(torque=0) for name in MODELS[:2])
    mu, phi0 = _drive(impact) * float(impact.torque[0]), float(impact.h / impact.r_v)
    period = 4 * math.sqrt(phi0 / mu * (1 + e) / (1 - e))
    return [
        Statement("share of the speed that inertias keep, (m - M)/(m + M)", "", f"{e:.6g}"),
        Statement("drop of the wheel between pallets", "", f"{drop:.4f} pitch"),
        compared("period of one body, formula", "4 sqrt(phi0 (1 + e)/(mu (1 - e)))", float(one.period), period, 1e-12),
        compared("period, two bodies over one", "1 without drop", float(two.period / one.period), 1.0, 2 * drop, 6),
        differing("multiplier, two bodies", "e^2", float(two.multiplier), e * e, 1e-12),
        differing("multiplier, one body", "e^2", float(one.multiplier), e * e, 1e-12),
    ]


def figure(ds: xr.Dataset) -> Any:
    """Period, exponent and swing over torque; for two columns of print."""
    from sweep.show import charts

    with charts.style():
        page = charts.new_figure(charts.PAGE, 66.0)
        axes = page.subplots(1, 3)
        for k, name in enumerate(MODELS):
            one, look = ds.sel(model=name), {"color": charts.COLOURS[k], "linestyle": charts.DASHES[k]}
            axes[0].loglog(ds.torque, one.period, label=name, **look)
            axes[1].semilogx(ds.torque, -one.exponent, **look)
            axes[2].loglog(ds.torque, one.amplitude, **look)
        _letter_axes(axes, ds)
        for panel, text in zip(axes, "abc", strict=True):
            charts.letter(panel, text)
    return page


def _letter_axes(axes: Any, ds: xr.Dataset) -> None:
    for panel, label in zip(
        axes, ("period, $P$ [s]", r"$-\mathrm{d}\ln P/\mathrm{d}\ln\tau$", "swing [rad]"), strict=True
    ):
        panel.set(xlabel=r"drive torque, $\tau$ [N m]", ylabel=label, xlim=(ds.torque[0], ds.torque[-1]))
    axes[0].legend(loc="upper right", handlelength=3)
    axes[1].set(ylim=(0.28, 1.05), yticks=(1 / 3, 0.5, 1), yticklabels=("1/3", "1/2", "1"))
    axes[2].set(yticks=(0.25, 0.5, 1, 2), yticklabels=("0.25", "0.5", "1", "2"))
    for panel in axes[1:]:
        panel.yaxis.set_minor_locator(_no_ticks())
    direct_label(axes[1], 3e-4, 0.55, "impacts alone", fontsize=7)


def _no_ticks() -> Any:
    from matplotlib.ticker import NullLocator

    return NullLocator()


def conclude(path: str, denny_path: str, viscous_path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure; writes the three in one dataset beside the first."""
    impact = read_result(path, "impact", ["torque"], "three_models.toml")
    denny, viscous = (
        read_result(p, "foliot", ["mu"], f"three_models_{name}.toml")
        for p, name in ((denny_path, "denny"), (viscous_path, "viscous"))
    )
    ds = together(impact, denny, viscous)
    target = sweep.export(ds, Path(path).with_name("three_models_all.nc"))
    groups = {
        "Period against torque": laws(ds),
        "Swing against torque": swings(ds),
        "Two bodies as one that keeps a share": identity(ds, impact),
    }
    return groups, [NOTES, "", f"all three models: {target}"], figure(ds)


def main(arguments: Sequence[str]) -> int:
    """Table, dataset and figure of the results that are named; 1 if a statement does not hold."""
    inputs = ["three_models.h5", "three_models_denny.h5", "three_models_viscous.h5"]
    return report(__file__, inputs, arguments, conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
