"""How does the period fall with the torque in the three models of a verge and foliot?

    python studies/three_models.py three_models.h5 three_models_denny.h5 three_models_viscous.h5

Where every loss is a share of the motion (restitution, inertias) and nothing but the drive exerts a torque, time has no
other unit than the one the torque gives, so P ~ torque^(-1/2) and the amplitude does not depend on it; viscous friction
brings in a time 1/a, and with it P ~ torque^(-1) at weak and torque^(-1/3) at strong drive. The kernels solve the
impacts in units of the torque, so what they say of -1/2 cannot be otherwise: the exponents printed are those of the
scenes `verge_scene` and `foliot_scene`, followed from rest in SI units. Without the drop two plastic bodies are one
that keeps the share (m - M)/(m + M).
"""

import math

import numpy as np
import xarray as xr
from _common import Claims, compared, differing, most, script, solved
from _figures import COLOURS, DASHES, Axis, Log, direct_label, page, panel

import sweep

MODELS = ("two bodies", "kept share", "viscous")
IN_SI = (1e-5, 1e-3, 0.1, 10.0)
"""Torques [N m] at which the models with impacts are followed in SI units."""


def prepared(impact, denny, viscous):
    """The models over torque [N m]: `period`, `amplitude` [rad], `multiplier` and the local `exponent`.

    Those with impacts are also followed from rest in SI units: `period` and the `speed` at the switch. kappa is the
    mass of the wheel over that of the foliot, both at the pallet.
    """
    n, phi0 = float(impact.r_v / impact.r_c), float(impact.h / impact.r_v)
    kappa = n**2 * float(impact.I_c / impact.I_v)
    mu = n / float(impact.I_v * (1 + kappa))  # of the foliot [rad/s^2], by a torque of 1 N m on the wheel
    impact = impact.assign(amplitude=impact.swing / impact.r_v, kappa=kappa)
    parts = [impact, *(one.rename(mu="torque").assign_coords(torque=impact.torque) for one in (denny, viscous))]
    parts = [one[["period", "amplitude", "multiplier"]].reset_coords(drop=True) for one in parts]
    ds = xr.concat(parts, xr.DataArray(list(MODELS), dims="model", name="model"), combine_attrs="drop_conflicts")

    verge = {"I_v": impact.I_v, "I_c": impact.I_c, "n": n, "phi0": phi0, "drop": math.pi / impact.teeth - 2 * n * phi0}
    two = solved("verge_scene:KERNEL", tau=IN_SI, **verge, flips=402, rtol=1e-10)
    given = {"mu": mu * np.array(IN_SI), "phi0": denny.phi0, "e": denny.e}
    one = solved("foliot_scene:KERNEL", **given, flips=200, rtol=1e-10).assign_coords(mu=list(IN_SI))
    followed = (
        two.assign(period=2 * two.clock).rename(tau="torque"),
        one.assign(period=2 * one.interval).rename(mu="torque"),
    )
    return ds.assign(exponent=sweep.local_exponent(ds.period, "torque")), followed, impact, viscous


def claims(ds, followed, impact, friction) -> Claims:
    yield "Period against torque"
    for name, one in zip(MODELS, followed, strict=False):
        fit = sweep.fit_exponent(one.period, "torque")
        kernel = np.exp(np.interp(np.log(IN_SI), np.log(ds.torque), np.log(ds.period.sel(model=name))))
        yield differing(f"exponent, {name}, in SI units", "-1/2", fit.exponent, -0.5, 1e-8)
        yield most("  period of the kernel beside it", "the same", one.period / kernel - 1, 1e-8, "largest")
    viscous = ds.sel(model="viscous")
    yield differing("exponent, viscous, weakest drive", "-1", viscous.exponent[0], -1.0, 0.01)
    yield differing("exponent, viscous, strongest drive", "-1/3", viscous.exponent[-1], -1 / 3, 0.01)

    yield "Swing against torque"
    for name, one in zip(MODELS, followed, strict=False):
        reach = one.speed**2 / one.torque  # the swing past the switch goes with it
        yield most(f"spread of the swing, {name}, in SI units", "0", reach.max() / reach.min() - 1, 1e-8, "")
    alpha = float(friction.mu[-1] / (friction.a**2 * friction.phi0))
    growth = 3 ** (2 / 3) / 2 * alpha ** (1 / 3)  # A at strong drive, A = 1 at weak
    text, grown = f"3^(2/3)/2 alpha^(1/3) = {growth:.4g}", viscous.amplitude[-1] / viscous.amplitude[0]
    yield compared("growth of the swing, viscous", text, grown, growth, 0.01)

    yield "Two bodies as one that keeps a share"
    e = float((1 - impact.kappa) / (1 + impact.kappa))
    drop = 0.5 - float(impact.h * impact.teeth / (math.pi * impact.r_c))
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
main = script(__name__, INPUTS, claims, figure, prepared)
