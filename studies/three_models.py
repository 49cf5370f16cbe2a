"""How does the period fall with the torque in the three models of a verge and foliot?

    python studies/three_models.py three_models.h5 three_models_denny.h5 three_models_viscous.h5

Writes the three models as one dataset, three_models_all.nc. Where every loss is a share of the motion (restitution,
inertias) and nothing but the drive exerts a torque, time has no other unit than the one the torque gives, so P ~
torque^(-1/2) and the amplitude does not depend on it; viscous friction brings in a time 1/a, and with it P ~
torque^(-1) at weak and torque^(-1/3) at strong drive. The kernels solve the impacts in units of the torque, so what
they say of -1/2 cannot be otherwise: the exponents printed are those of the scenes `verge_scene` and `foliot_scene`,
followed from rest in SI units.

By theory P ~ torque^(-s). Without the drop two plastic bodies are one that keeps the share (m - M)/(m + M).
"""

import math
from pathlib import Path

import numpy as np
import xarray as xr
from _common import Claims, compared, differing, most, script, solved
from _figures import COLOURS, DASHES, Axis, Log, direct_label, page, panel

import sweep

MODELS = ("two bodies", "kept share", "viscous")
IN_SI = (1e-5, 1e-3, 0.1, 10.0)
"""Torques [N m] at which the models with impacts are followed in SI units."""


def prepared(impact, denny, viscous):
    """The models in one dataset, those with impacts followed in SI units, and the two bodies alone.

    Of these the swing is an angle, phi0 the way to the switch, kappa the mass of the wheel over that of the foliot,
    both at the pallet, and the drive what a torque of 1 N m on the wheel does to both [rad/s^2 of the foliot].
    """
    kappa = (impact.I_c / impact.r_c**2) / (impact.I_v / impact.r_v**2)
    drive = impact.r_v / impact.r_c / (impact.I_v * (1 + kappa))
    amplitude = (impact.swing / impact.r_v).assign_attrs(units="rad")
    pitch = 2 * math.pi * impact.r_c / impact.teeth
    impact = impact.assign(amplitude=amplitude, kappa=kappa, drive=drive, phi0=impact.h / impact.r_v, pitch=pitch)
    return together(impact, denny, viscous), in_si(impact, denny), impact


def together(impact: xr.Dataset, denny: xr.Dataset, viscous: xr.Dataset) -> xr.Dataset:
    """The three models over torque [N m]: `period`, `amplitude` [rad], `multiplier` and the local `exponent`."""
    drive, parts = float(impact.drive), []
    for one in (impact, denny, viscous):
        torque = impact.torque if one is impact else one.mu / drive
        if not np.allclose(torque, impact.torque, rtol=1e-12):
            raise sweep.SweepError("the three grids are not of the same torques; make them from the studies' files")
        part = one[["period", "amplitude", "multiplier"]].reset_coords(drop=True)
        part = part if one is impact else part.rename(mu="torque")
        parts.append(part.assign_coords(torque=impact.torque))
    ds = xr.concat(parts, xr.DataArray(list(MODELS), dims="model", name="model"), combine_attrs="drop_conflicts")
    ds = ds.assign(exponent=sweep.local_exponent(ds.period, "torque"))
    ds.attrs = {"title": "Period against torque in three models of a verge and foliot"}
    unit = float(viscous.a**2 * viscous.phi0) / drive
    return ds.assign(viscous_unit=xr.DataArray(unit, attrs={"units": "N m", "long_name": "torque of alpha = 1"}))


def in_si(impact: xr.Dataset, denny: xr.Dataset) -> dict[str, xr.Dataset]:
    """`period` [s] and `speed` at the switch [rad/s] of both models with impacts, followed from rest in SI units."""
    n = float(impact.r_v / impact.r_c)
    verge = {"I_v": impact.I_v, "I_c": impact.I_c, "n": n, "phi0": impact.phi0, "flips": 402}
    verge["drop"] = math.pi / impact.teeth - 2 * n * impact.phi0
    mu = float(impact.drive) * np.array(IN_SI)
    two = solved("verge_scene:KERNEL", tau=IN_SI, **verge, rtol=1e-10)
    one = solved("foliot_scene:KERNEL", mu=mu, phi0=denny.phi0, e=denny.e, flips=200, rtol=1e-10)
    return {
        MODELS[0]: two.assign(period=2 * two.clock).rename(tau="torque"),
        MODELS[1]: one.assign(period=2 * one.interval).rename(mu="torque").assign_coords(torque=list(IN_SI)),
    }


def export(ds, _, impact):
    """Writes the three models as one dataset beside the result of the first."""
    target = Path(impact.encoding["source"]).with_name("three_models_all.nc")
    return [f"all three models: {sweep.export(ds, target, force=True)}"]


def claims(ds, followed, impact) -> Claims:
    yield "Period against torque"
    for name, one in followed.items():
        fit = sweep.fit_exponent(one.period, "torque")
        kernel = np.exp(np.interp(np.log(IN_SI), np.log(ds.torque), np.log(ds.period.sel(model=name))))
        yield differing(f"exponent, {name}, in SI units", "-1/2", fit.exponent, -0.5, 1e-8)
        yield most("  period of the kernel beside it", "the same", one.period / kernel - 1, 1e-8, "largest")
    viscous = ds.sel(model="viscous")
    yield differing("exponent, viscous, weakest drive", "-1", viscous.exponent[0], -1.0, 0.01)
    yield differing("exponent, viscous, strongest drive", "-1/3", viscous.exponent[-1], -1 / 3, 0.01)

    yield "Swing against torque"
    for name, one in followed.items():
        reach = one.speed**2 / one.torque  # the swing past the switch goes with it
        yield most(f"spread of the swing, {name}, in SI units", "0", reach.max() / reach.min() - 1, 1e-8, "")
    viscous = ds.amplitude.sel(model="viscous")
    growth = 3 ** (2 / 3) / 2 * float(ds.torque[-1] / ds.viscous_unit) ** (1 / 3)  # A at strong drive, A = 1 at weak
    text, grown = f"3^(2/3)/2 alpha^(1/3) = {growth:.4g}", viscous[-1] / viscous[0]
    yield compared("growth of the swing, viscous", text, grown, growth, 0.01)

    yield "Two bodies as one that keeps a share"
    e = float((1 - impact.kappa) / (1 + impact.kappa))
    drop = 0.5 - 2 * float(impact.h / impact.pitch)
    two, one = (ds.sel(model=name).isel(torque=0) for name in MODELS[:2])
    ratio, bodies = f"period, two bodies over one, drop {drop:.4f} pitch", f"e = (m - M)/(m + M) = {e:.4g}"
    yield compared(ratio, "1 without drop", two.period / one.period, 1.0, 2 * drop)
    yield differing(f"multiplier, two bodies, {bodies}", "e^2", two.multiplier, e * e, 1e-12)
    yield differing("multiplier, one body", "e^2", one.multiplier, e * e, 1e-12)


FALL = Axis(r"exponent, $-\mathrm{d}\ln P/\mathrm{d}\ln\tau$ [1]", (0.28, 1.05), {1 / 3: "1/3", 0.5: "1/2", 1: "1"})


@panel(Log(), FALL, "upper right", handlelength=3)
@panel(Log(r"drive torque, $\tau$ [N m]"), Log("swing [rad]", None, (0.25, 0.5, 1, 2)))
@page(132.0, sharex=True)
def figure(exponent, swing, ds, *_):
    """Exponent and swing over torque."""
    for k, name in enumerate(MODELS):
        one, look = ds.sel(model=name), {"color": COLOURS[k], "linestyle": DASHES[k]}
        if k == 1:  # lies on the first: rings at every so many-th torque
            one = one.isel(torque=slice(4, None, max(1, ds.torque.size // 9)))
            look = {"color": COLOURS[k], "marker": "o", "linestyle": "", "markerfacecolor": "white"}
        exponent.plot(one.torque, -one.exponent, label=name, **look)
        swing.plot(one.torque, one.amplitude, **look)
    direct_label(exponent, 3e-4, 0.55, "impacts alone")
    swing.set(xlim=(ds.torque[0], ds.torque[-1]))


INPUTS = "three_models.h5 three_models_denny.h5 three_models_viscous.h5"
main = script(__name__, INPUTS, claims, figure, prepared, export)
