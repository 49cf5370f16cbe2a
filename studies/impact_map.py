"""When does a crown wheel that collides with a foliot keep a steady beat, and how far does it recoil?

    python studies/impact_map.py impact_map.h5 impact_map_lever.h5

Two bodies of masses M and m at the pallet, kappa = M/m, under the force F = m g kappa, with one impact per half period
T:
    T^2 = p(1 + e)/(g(1 - e)(1 + kappa)),  swing Y = kappa g T^2/4,  recoil if kappa < 2e/(1 - e),
where no tooth is met in between; stable for kappa > 1. The models of Lepschy and Roup are of this kind.

In the theory kappa = M/m, the mass of the wheel over that of the foliot, both at the pallet
(docs/theory/two_bodies.md).
"""

import math

import numpy as np
import xarray as xr
from _common import Claims, Statement, count, held, most, never, script
from _figures import KAPPA, Axis, colour_map, direct_label, hatch, kinds_map, page, panel

from kernels.interface import Status

KINDS = {
    "one impact": "#0072B2", "several impacts": "#56B4E9", "bounces end in contact": "#009E73",
    "off centre": "#E69F00", "period 2": "#CC79A7", "never settles": "#D55E00", "undecided": "0.85",
}  # fmt: skip
"""Motions of the clock, and their colours."""
LEVER_E = 0.6


def scaled(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with kappa, the pitch p and the swing over it."""
    pitch = 2 * math.pi * ds.r_c / ds.teeth
    kappa = (ds.I_c / ds.r_c**2) / (ds.I_v / ds.r_v**2)
    return ds.assign_coords(kappa=kappa).assign(pitch=pitch, Y=ds.swing / pitch)


def kinds(motion: xr.Dataset) -> xr.DataArray:
    """What the motion is, as position in `KINDS`."""
    told = motion.status.isin((Status.OK, Status.GRAZING, Status.INACCURATE))
    centred, impacts = told & (abs(motion.offset) < 1e-6 * motion.pitch), motion.impacts
    rules = (
        centred & (impacts == 1), centred & (impacts > 1) & np.isfinite(impacts), centred & np.isinf(impacts),
        told & ~centred, motion.status == Status.PERIOD_2, motion.status == Status.NOT_PERIODIC,
    )  # fmt: skip
    return motion.status.copy(data=np.select(rules, range(len(rules)), len(rules)))


def flip_border(kappa, e: float):
    """nu at which a multiplier is -1, for any kappa; so it is at kappa = 1 for any nu."""
    return -4 * (1 + e) ** 2 / ((1 - e) ** 2 * kappa + 2 * (1 + e * e))


def claims(motion, bent, closed) -> Claims:
    yield "The symmetric cycle"
    free = closed.where(closed.status.isin((Status.OK, Status.UNSTABLE, Status.GRAZING)) & (closed.e > 0))
    here = free.period.notnull() & (free.status != Status.GRAZING) & (abs(free.kappa - 1) > 1e-12)
    back = free.kappa < 2 * free.e / (1 - free.e)
    yield never("stable for kappa > 1 and no other: exceptions", here & ((free.multiplier < 1) != (free.kappa > 1)))
    yield never("recoil for kappa < 2e/(1 - e): exceptions", here & ((free.recoil > 0) != back))

    yield "What the clock does"
    both = (closed.status == Status.OK) & (motion.status == Status.OK) & (motion.impacts == 1)
    same = motion.where(both & (closed.e > 0))
    lost = (closed.status == Status.OK) & (motion.status != Status.OK)
    force = closed.torque * closed.r_c / closed.I_c
    twice = 2 * np.sqrt(closed.pitch * (1 + closed.e) / (force * (1 - closed.e) * (1 + closed.kappa)))
    way = same.kappa * (1 + same.e) / (4 * (1 - same.e) * (1 + same.kappa))
    kind = kinds(motion)
    yield most("period by events = 2T", "0", same.period / twice - 1, 1e-9, count(both))
    yield most("swing by events = Y, whatever the torque", "0", same.Y / way - 1, 1e-9, count(both))
    yield held("stable cycles that events does not settle on", lost.mean(), "< 1 %", "{:.2%}")
    yield from (Statement(f"  {name}", "", count(kind == i)) for i, name in enumerate(KINDS) if name != "undecided")
    yield held("  none of these", (kind == len(KINDS) - 1).mean(), "< 2 %", "{:.2%}")

    yield "A curved lever"
    exists = bent.status.isin((Status.OK, Status.UNSTABLE))
    k, flip, kept = bent.kappa, flip_border(bent.kappa, LEVER_E), bent.multiplier < 1
    # of light foliots p(1) > 0 and p(-1) < 0, p the characteristic polynomial of the half map
    light = (bent.nu < 4 * (1 + k) / (k * (k - 1))) & (bent.nu > flip)
    steady = xr.where(k < 1, (bent.nu > -4 * (1 + k) / (k * (1 - k))) & (bent.nu < flip), light)
    heavy = exists & (k < 1)
    yield never("stability between the two borders in nu: exceptions", exists & (steady != kept))
    yield held(f"heavy foliots, {count(heavy)}: steadied by a lever that yields", (heavy & kept).sum(), "> 0", "{:.0f}")
    yield never("heavy foliots steady with a flat lever", heavy & (abs(bent.nu) < 1e-9) & kept)


@panel(KAPPA, Axis("restitution, $e$ [1]"))
@panel(KAPPA, Axis(r"curvature of the lever, $\nu$ [1]"))
@page(158.0)
def figure(clock, lever, motion, bent, *_):
    """What the clock does, with the borders of its symmetric cycle, and what a curved lever does."""
    kappa, e = motion.kappa.values, motion.e.values
    keys = kinds_map(clock, kappa, e, kinds(motion).transpose("e", "I_c").values, KINDS)
    clock.axvline(1.0, color="black", label=r"$\kappa=1$")
    clock.plot(2 * e[:-1] / (1 - e[:-1]), e[:-1], "--", color="black", label=r"$\kappa=2e/(1-e)$")
    clock.set(xlim=(kappa[0], kappa[-1]), ylim=(e[0], e[-1]))
    clock.figure.legend(handles=[*keys, *clock.lines], loc="outside upper center", ncols=2)

    kappa, values = bent.kappa.values, bent.multiplier.transpose("nu", "I_c").values
    look = {"vmin": 0.5, "vmax": 1.5, "cmap": "RdBu_r"}
    colour_map(lever, kappa, bent.nu.values, values, "multiplier [1]", {"extend": "max"}, **look)
    hatch(lever, kappa, bent.nu.values, np.isnan(values), "////")
    inside = kappa[~np.isnan(values).all(axis=0)]
    lever.plot(inside, flip_border(inside, LEVER_E), color="black", linewidth=0.9)
    lever.axvline(1.0, color="black", linewidth=0.9)
    direct_label(lever, 0.3, -7, "stable")
    direct_label(lever, 0.22, 3, "unstable")
    direct_label(lever, 2.5, 4, "no cycle")


def prepared(ds, lever):
    """What the clock does contact by contact, the curved lever, and the symmetric cycle."""
    return scaled(ds.sel({"method": "events"})), scaled(lever), scaled(ds.sel({"method": "closed"}))


main = script(__name__, "impact_map.h5 impact_map_lever.h5", claims, figure, prepared)
