"""How does the period fall with the torque in the three models of a verge and foliot?

    sweep run studies/three_models.toml
    sweep run studies/three_models_denny.toml
    sweep run studies/three_models_viscous.toml
    python studies/three_models.py three_models.h5 three_models_denny.h5 three_models_viscous.h5

draws three_models.png, prints theory beside what comes out, and writes the three models as one dataset,
three_models_all.nc. Where every loss is a share of the motion (restitution, inertias) and nothing but the drive exerts
a torque, time has no other unit than the one the torque gives, so P ~ torque^(-1/2) and the amplitude does not depend
on it; viscous friction brings in a time 1/a, and with it P ~ torque^(-1) at weak and torque^(-1/3) at strong drive. The
kernels solve the impacts in units of the torque, so what they say of -1/2 cannot be otherwise: the exponents printed
are those of the scenes `verge_scene` and `foliot_scene`, followed from rest in SI units. Of Lepschy, Roup and Denny
only the abstracts were at hand: the models are of their kind, no number is theirs.
"""

from __future__ import annotations

import math
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, differing, direct_label, page_of, read_result, report

import sweep
from sweep.show.charts import COLOURS, DASHES

MODELS = ("two bodies", "kept share", "viscous")

NOTES = """\
theory: P ~ torque^(-s); deviation: relative, of exponents and spreads the difference. Allowed: 1e-8 for what was
followed in SI at rtol 1e-10, 1e-12 for formulas, 0.01 for the ends of the viscous grid, the drop for what it leaves
out. In words: impacts alone give the exponent 1/2 and leave the swing alone. The converse does not hold for the swing:
a hairspring beside the impacts makes it grow with the torque without any friction, as the last lines show. At 1/2 a
torque that is 1 % low makes the clock 0.5 % slow, 7.2 minutes a day. Without drop two plastic bodies are one that keeps
the share (m - M)/(m + M); a wheel heavier than the foliot makes it negative: the same period formula, but the foliot
turns round at the switch, and its swing is the way to the switch alone"""

IN_SI = (1e-5, 1e-3, 0.1, 10.0)
"""Torques [N m] at which the models with impacts are followed in SI units."""
SPRING, KEPT = 0.5, 0.8
"""Hairspring [1/s^2] and restitution of a foliot without friction whose swing grows with the torque."""


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
    ds = ds.assign(exponent=sweep.local_exponent(ds.period, "torque"))
    ds.attrs = {"title": "Period against torque in three models of a verge and foliot"}
    unit = float(viscous.a**2 * viscous.phi0) / _drive(impact)
    return ds.assign(viscous_unit=xr.DataArray(unit, attrs={"units": "N m", "long_name": "torque of alpha = 1"}))


def _drive(impact: xr.Dataset) -> float:
    """What a torque of 1 N m on the wheel does to foliot and wheel together [rad/s^2 of the foliot]."""
    return float(impact.r_v / impact.r_c / (impact.I_v * (1 + _kappa(impact))))


def _kappa(impact: xr.Dataset) -> float:
    """Mass of the wheel over that of the foliot, both at the pallet."""
    return float((impact.I_c / impact.r_c**2) / (impact.I_v / impact.r_v**2))


def in_si(impact: xr.Dataset, denny: xr.Dataset) -> dict[str, xr.Dataset]:
    """`period` [s] and `speed` at the switch [rad/s] of both models with impacts, followed from rest in SI units."""
    torque = list(IN_SI)
    n = float(impact.r_v / impact.r_c)
    phi0 = float(impact.h / impact.r_v)
    verge = {"I_v": float(impact.I_v), "I_c": float(impact.I_c), "n": n, "phi0": phi0}
    verge |= {"drop": math.pi / float(impact.teeth) - 2 * n * phi0, "flips": 402}
    foliot = {"phi0": float(denny.phi0), "e": float(denny.e), "flips": 200}
    two = _followed("verge_scene", {"tau": torque}, verge)
    one = _followed("foliot_scene", {"mu": [_drive(impact) * x for x in torque]}, foliot)
    return {
        MODELS[0]: two.assign(period=2 * two.clock).rename(tau="torque"),
        MODELS[1]: one.assign(period=2 * one.interval).rename(mu="torque").assign_coords(torque=torque),
    }


def _followed(scene: str, axes: dict[str, list[float]], fixed: dict[str, float]) -> xr.Dataset:
    study = sweep.study(kernel=f"{scene}:KERNEL", rtol=1e-10, axes=axes, fixed=fixed, allow_import=True)
    return sweep.run(study)


def laws(ds: xr.Dataset, followed: dict[str, xr.Dataset]) -> list[Statement]:
    """Exponents of the three models; the kernels beside what was followed."""
    found = []
    for name, one in followed.items():
        fit = sweep.fit_exponent(one.period, "torque")
        found.append(differing(f"exponent, {name}, in SI units", "-1/2", float(fit.exponent), -0.5, 1e-8))
        kernel = np.exp(np.interp(np.log(IN_SI), np.log(ds.torque), np.log(ds.period.sel(model=name))))
        off = float(abs(one.period / kernel - 1).max())
        found.append(Statement("  period of the kernel beside it", "the same", "largest", off, off < 1e-8))
    weak, strong = (ds.exponent.sel(model="viscous").isel(torque=i) for i in (0, -1))
    found += [
        differing("exponent, viscous, weakest drive", "-1", float(weak), -1.0, 0.01, 5),
        differing("exponent, viscous, strongest drive", "-1/3", float(strong), -1 / 3, 0.01, 5),
    ]
    half = sweep.where_exponent(ds.period.sel(model="viscous"), "torque", -0.5)
    alpha = 1.46299058758  # q - tanh q = 1/alpha where s = 1/2
    return [*found, compared("torque of exponent -1/2, viscous [N m]", *_half_torque(ds, half, alpha), 1e-3, 5)]


def _half_torque(ds: xr.Dataset, half: xr.Dataset, alpha: float) -> tuple[str, float, float]:
    theory = alpha * float(ds.viscous_unit)
    return f"alpha = {alpha:.5f}: {theory:.5g}", float(half.abscissa), theory


def swings(ds: xr.Dataset, followed: dict[str, xr.Dataset]) -> list[Statement]:
    """Whether the swing depends on the torque."""
    found = []
    for name, one in followed.items():
        reach = abs(one.speed) / np.sqrt(one.torque)  # the swing past the switch goes as speed^2/torque
        off = float((reach.max() / reach.min()) ** 2 - 1)
        found.append(Statement(f"spread of the swing, {name}, in SI units", "0", "", off, off < 1e-8))
    viscous = ds.amplitude.sel(model="viscous")
    grown = float(viscous[-1] / viscous[0])
    alpha = float(ds.torque[-1] / ds.viscous_unit)
    theory = 3 ** (2 / 3) / 2 * alpha ** (1 / 3)  # A at strong drive over A = 1 at weak drive
    line = compared("growth of the swing, viscous", f"3^(2/3)/2 alpha^(1/3) = {theory:.4g}", grown, theory, 0.01, 4)
    return [*found, line, *with_spring()]


def with_spring() -> list[Statement]:
    """Restitution and a hairspring, no friction: the swing by energy, and by the kernel."""
    mu = np.array([0.6, 6.0, 60.0])
    study = sweep.study(kernel="foliot", rtol=1e-10, axes={"mu": mu}, fixed={"phi0": 1, "e": KEPT, "k": SPRING})
    kernel = sweep.run(study).amplitude
    kept = KEPT**2 * 4 * mu / (1 - KEPT**2)  # square of the speed behind the switch
    theory = (-mu + np.sqrt(mu**2 + 2 * SPRING * (mu + SPRING / 2 + kept / 2))) / SPRING
    off = float(abs(kernel / theory - 1).max())
    grows = f"{float(kernel[0]):.4g} to {float(kernel[-1]):.4g} phi0"
    what = f"no friction but a hairspring, k = {SPRING:g}/s^2: swing for mu = 0.6 to 60 rad/s^2"
    return [Statement(what, "grows too, by energy", grows, off, off < 1e-9 and bool(kernel[-1] > 1.5 * kernel[0]))]


def identity(ds: xr.Dataset, impact: xr.Dataset) -> list[Statement]:
    """How near the two-body clock is to one body that keeps (m - M)/(m + M) of its speed."""
    e = (1 - _kappa(impact)) / (1 + _kappa(impact))
    pitch = float(2 * math.pi * impact.r_c / impact.teeth)
    drop = 0.5 - 2 * float(impact.h) / pitch
    two, one = (ds.sel(model=name).isel(torque=0) for name in MODELS[:2])
    mu, phi0 = _drive(impact) * float(impact.torque[0]), float(impact.h / impact.r_v)
    period = 4 * math.sqrt(phi0 / mu * (1 + e) / (1 - e))
    return [
        compared("period of one body, formula", "4 sqrt(phi0 (1 + e)/(mu (1 - e)))", float(one.period), period, 1e-12),
        compared(
            f"period, two bodies over one, drop {drop:.4f} pitch",
            "1 without drop",
            float(two.period / one.period),
            1.0,
            2 * drop,
            6,
        ),
        differing(f"multiplier, two bodies, e = (m - M)/(m + M) = {e:.4g}", "e^2", float(two.multiplier), e * e, 1e-12),
        differing("multiplier, one body", "e^2", float(one.multiplier), e * e, 1e-12),
    ]


def figure(ds: xr.Dataset) -> Any:
    """Period, exponent and swing over torque; for two columns of print."""
    with page_of(66.0, 1, 3) as (page, axes):
        for k, name in enumerate(MODELS):
            look = {"color": COLOURS[k], "linestyle": DASHES[k]}
            if k == 1:  # lies on the first: rings at every so many-th torque
                look = {"color": COLOURS[k], "marker": "o", "linestyle": "", "markerfacecolor": "white"}
            one = ds.sel(model=name).isel(torque=slice(4, None, max(1, ds.torque.size // 9)) if k == 1 else slice(None))
            axes[0].loglog(one.torque, one.period, label=name, **look)
            axes[1].semilogx(one.torque, -one.exponent, **look)
            axes[2].loglog(one.torque, one.amplitude, **look)
        _letter_axes(axes, ds)
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
    followed = in_si(impact, denny)
    target = sweep.export(ds, Path(path).with_name("three_models_all.nc"), force=True)
    groups = {
        "Period against torque": laws(ds, followed),
        "Swing against torque": swings(ds, followed),
        "Two bodies as one that keeps a share": identity(ds, impact),
    }
    return groups, [NOTES, "", f"all three models: {target}"], lambda: figure(ds)


INPUTS = ["three_models.h5", "three_models_denny.h5", "three_models_viscous.h5"]
main = partial(report, __file__, INPUTS, conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
