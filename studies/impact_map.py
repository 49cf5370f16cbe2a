"""When does a crown wheel that collides with a foliot keep a steady beat, and how far does it recoil?

    sweep run studies/impact_map.toml
    sweep run studies/impact_map_lever.toml
    python studies/impact_map.py impact_map.h5 impact_map_lever.h5

draws impact_map.png and compares theory with what comes out. Two bodies of masses M and m at the pallet, kappa = M/m,
under the force F = m g kappa, with one impact per half period T:
    T^2 = p(1 + e)/(g(1 - e)(1 + kappa)),  swing Y = kappa g T^2/4,  recoil if kappa < 2e/(1 - e),
where no tooth is met in between; stable for kappa > 1. The models of Lepschy and Roup are of this kind; what
Denny's loses is not known here. Only their abstracts were at hand, and no number here is theirs.
"""

import math
from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, Conclusion, Statement, count, most, paragraph, read_result, said, script, solved
from _figures import colour_map, direct_label, hatch, page_of
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from kernels.interface import Status

NOTES = """\
theory: kappa = M/m, the mass of the wheel over that of the foliot, both at the pallet; deviation: relative, in the
worst cell; allowed 1e-9 of what is followed contact by contact, 1e-8 of what is followed in SI units at rtol 1e-10"""

EXISTS = (Status.OK, Status.UNSTABLE, Status.GRAZING)

KINDS = {
    "one impact": "#0072B2", "several impacts": "#56B4E9", "bounces end in contact": "#009E73",
    "off centre": "#E69F00", "period 2": "#CC79A7", "never settles": "#D55E00", "open": "0.85",
}  # fmt: skip
"""Motions of the clock, and their colours."""

LEVER_E = 0.6
DASHED = {"color": "black", "linewidth": 0.8, "linestyle": (0, (4, 2))}


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with kappa, the pitch p and the swing and recoil over it."""
    pitch = 2 * math.pi * ds.r_c / ds.teeth
    kappa = (ds.I_c / ds.r_c**2) / (ds.I_v / ds.r_v**2)
    thrown = ds.recoil * ds.teeth / (2 * math.pi) if "recoil" in ds else None
    ds = ds.assign_coords(kappa=kappa).assign(pitch=pitch, Y=ds.swing / pitch)
    return ds if thrown is None else ds.assign(thrown=thrown)


def exceptions(what: str, wrong: xr.DataArray) -> Statement:
    """That something is so in every cell."""
    return said(what, not wrong.any(), count(wrong, "exceptions"), "no exception")


def cycle(closed: xr.Dataset) -> Claims:
    """The symmetric cycle where it exists; e = 0 is another one, with the tooth resting on the pallet."""
    free = closed.where(closed.status.isin(EXISTS) & (closed.e > 0))
    here = free.period.notnull() & (free.status != Status.GRAZING) & (abs(free.kappa - 1) > 1e-12)
    yield exceptions("stable for kappa > 1 and no other", here & ((free.multiplier < 1) != (free.kappa > 1)))
    yield exceptions(
        "recoil for kappa < 2e/(1 - e)", here & ((free.recoil > 0) != (free.kappa < 2 * free.e / (1 - free.e)))
    )
    yield from plastic(closed)


def plastic(closed: xr.Dataset) -> Claims:
    """e = 0, the tooth on the pallet until it escapes: the kernel beside the scene `verge_scene` in SI units."""
    stuck = closed.isel(e=0).isel(I_c=slice(None, None, max(1, closed.sizes["I_c"] // 8)))
    n, phi0 = float(stuck.r_v / stuck.r_c), float(stuck.h / stuck.r_v)
    clock = {"tau": stuck.torque, "I_v": stuck.I_v, "I_c": stuck.I_c, "n": n, "phi0": phi0}
    clock["drop"] = math.pi / float(stuck.teeth) - 2 * n * phi0
    flips = (3000, 3002)  # an even number: the last event is a landing
    first, later = (2 * solved("verge_scene:KERNEL", **clock, flips=k, rtol=1e-10).clock.values for k in flips)
    off = stuck.period / first - 1
    yield most("e = 0: period of the kernel and in SI units", "the same", off, 1e-8, count(stuck.period))
    yield most("e = 0: from rest to a steady beat at every kappa", "yes", later / first - 1, 1e-10, "last change")


def words(closed: xr.Dataset) -> list[str]:
    """The conclusion, with the numbers of this grid."""
    loose = closed.where(closed.status.isin(EXISTS) & (closed.e > 0))
    steady = loose.where(loose.status == Status.OK)
    kept = steady.e.where(steady.period.notnull())
    first = kept.isel(I_c=kept.notnull().any("e").values.nonzero()[0][[0, -1]])
    (low, low_far), (high, high_far), (near, far) = first.min("e").values, first.max("e").values, first.kappa.values
    return paragraph(f"""In words: with a flat lever only a wheel heavier than the foliot keeps the beat of one impact,
        and only if the impacts are neither too soft (the tooth catches up with the pallet) nor too hard (the pallet
        comes to another tooth): e from {low:.2f} to {high:.2f} at kappa = {near:.3g}, from {low_far:.2f} to
        {high_far:.2f} at {far:.3g}.
        Its swing is {steady.Y.min():.2f} to {steady.Y.max():.2f} of the tooth pitch, whatever the torque;
        its wheel is thrown back by {steady.thrown.max():.3f} of the pitch at most. Heavier foliots throw the wheel back
        by up to {loose.thrown.max():.2f} of it and lose that beat: they bounce until they rest against the tooth, or
        wander, unless their lever yields as it is pushed.""")


def kinds(motion: xr.Dataset) -> xr.DataArray:
    """What the motion is, as position in `KINDS`."""
    told = motion.status.isin((Status.OK, Status.GRAZING, Status.INACCURATE))
    centred = abs(motion.offset) < 1e-6 * motion.pitch
    rules = {
        "one impact": told & centred & (motion.impacts == 1),
        "several impacts": told & centred & (motion.impacts > 1),
        "bounces end in contact": told & centred & np.isinf(motion.impacts),
        "off centre": told & ~centred,
        "period 2": motion.status == Status.PERIOD_2,
        "never settles": motion.status == Status.NOT_PERIODIC,
    }
    kind = xr.full_like(motion.status, len(KINDS) - 1, dtype=int)
    for name, where in rules.items():
        kind = kind.where(~where, list(KINDS).index(name))
    return kind


def motions(closed: xr.Dataset, motion: xr.Dataset) -> Claims:
    """What the clock does, followed contact by contact."""
    both = (closed.status == Status.OK) & (motion.status == Status.OK) & (motion.impacts == 1)
    same = motion.where(both & (closed.e > 0))
    lost = (closed.status == Status.OK) & (motion.status != Status.OK)
    force = closed.torque * closed.r_c / closed.I_c
    twice = 2 * np.sqrt(closed.pitch * (1 + closed.e) / (force * (1 - closed.e) * (1 + closed.kappa)))
    way = same.kappa * (1 + same.e) / (4 * (1 - same.e) * (1 + same.kappa))
    kind = kinds(motion)
    census = {name: count(kind == i) for i, name in enumerate(KINDS)}
    few = (kind == list(KINDS).index("open")).mean() < 0.02
    yield most("period by events = 2T", "1e-9", same.period / twice - 1, 1e-9, count(both))
    yield most("swing by events = Y, whatever the torque", "1e-9", same.Y / way - 1, 1e-9, count(both))
    yield said("stable cycles that events does not settle on", lost.mean() < 0.01, count(lost), "1 %")
    yield from (Statement(f"  {name}", "", cells) for name, cells in census.items() if name != "open")
    yield said("  none of these", few, census["open"], "2 %")


def flip_border(kappa: Any, e: float) -> Any:
    """nu at which a multiplier is -1, for any kappa; so it is at kappa = 1 for any nu."""
    return -4 * (1 + e) ** 2 / ((1 - e) ** 2 * kappa + 2 * (1 + e * e))


def lever(bent: xr.Dataset) -> Claims:
    """A curved lever can steady a heavy foliot."""
    exists = bent.status.isin((Status.OK, Status.UNSTABLE))
    k, flip, held = bent.kappa, flip_border(bent.kappa, LEVER_E), bent.multiplier < 1
    # of light foliots p(1) > 0 and p(-1) < 0, p the characteristic polynomial of the half map
    light = (bent.nu < 4 * (1 + k) / (k * (k - 1))) & (bent.nu > flip)
    steady = xr.where(k < 1, (bent.nu > -4 * (1 + k) / (k * (1 - k))) & (bent.nu < flip), light)
    heavy = exists & (k < 1)
    steadied = f"{int((heavy & held).sum())} of {count(heavy)}"
    flat = heavy & (abs(bent.nu) < 1e-9) & held
    yield exceptions("stability between the two borders in nu", exists & (steady != held))
    yield said("heavy foliots steadied by a lever that yields", (heavy & held).any(), steadied, "some")
    yield said("heavy foliots steady with a flat lever", not flat.any(), count(flat), "none")


def figure(closed: xr.Dataset, motion: xr.Dataset, bent: xr.Dataset) -> Any:
    """Cycle, recoil, motion and lever; for two columns of print."""
    kappa, e = closed.kappa.values, closed.e.values
    with page_of(150.0, 2, 2) as (page, panels):
        swing, recoil, clock, lever = panels.flat
        for axes in panels.flat[:3]:
            axes.set(xscale="log", xlabel=r"wheel over foliot, $\kappa$ [1]", ylabel="restitution, $e$ [1]")
        for axes, shown, top, label, border in (
            (swing, closed.Y, 0.8, "swing over tooth pitch, $Y/p$ [1]", (np.ones_like(e), e)),
            (recoil, closed.thrown, 0.4, "recoil over tooth pitch [1]", (kappa, kappa / (2 + kappa))),
        ):
            values = shown.transpose("e", "I_c").values
            colour_map(axes, kappa, e, values, label, vmin=0, vmax=top)
            hatch(axes, kappa, e, np.isnan(values), "////")
            axes.plot(*border, color="white", linewidth=1.4)  # to be seen on any ground
            axes.plot(*border, **DASHED)
        direct_label(swing, 0.1, 0.85, "no cycle with one impact")
        direct_label(swing, 10.0, 0.3, "stable")
        direct_label(swing, 0.36, 0.5, "unstable", fontsize=7)
        direct_label(recoil, 12, 0.3, "no recoil")
        kind = kinds(motion).transpose("e", "I_c").values
        look = {"cmap": ListedColormap(list(KINDS.values())), "vmin": -0.5, "vmax": len(KINDS) - 0.5}
        clock.pcolormesh(kappa, e, kind, shading="nearest", rasterized=True, **look)
        clock.set(xlim=(kappa[0], kappa[-1]), ylim=(e[0], e[-1]))
        keys = [Patch(color=KINDS[name], label=name) for i, name in enumerate(KINDS) if (kind == i).any()]
        page.legend(handles=keys, title="(c) the clock's motion", loc="outside lower left", ncols=3)
        page.legend(handles=draw_lever(lever, bent), title="Borders", loc="outside lower right")
    return page


def draw_lever(axes: Any, bent: xr.Dataset) -> list[Any]:
    """Multiplier over kappa and the lever's curvature; the keys of all borders by theory."""
    kappa, nu, values = bent.kappa.values, bent.nu.values, bent.multiplier.transpose("nu", "I_c").values
    colour_map(axes, kappa, nu, values, "multiplier [1]", {"extend": "max"}, vmin=0.5, vmax=1.5, cmap="RdBu_r")
    hatch(axes, kappa, nu, np.isnan(values), "////")
    inside = kappa[~np.isnan(values).all(axis=0)]
    axes.plot(inside, flip_border(inside, LEVER_E), color="black", linewidth=0.9)
    axes.axvline(1.0, color="black", linewidth=0.9)
    axes.set(xscale="log", xlabel=r"wheel over foliot, $\kappa$ [1]", ylabel=r"curvature of the lever, $\nu$ [1]")
    direct_label(axes, 0.3, -7, "stable")
    direct_label(axes, 0.22, 3, "unstable")
    return [
        Line2D([], [], **DASHED, label=r"(a) $\kappa=1$, (b) $\kappa=2e/(1-e)$"),
        Line2D([], [], color="black", linewidth=0.9, label="(d) multiplier 1 by theory"),
        Patch(facecolor="white", edgecolor="0.45", hatch="////", linewidth=0.5, label="no cycle with one impact"),
    ]


def conclude(path: str, lever_path: str) -> Conclusion:
    """Statements and the figure."""
    ds = prepared(read_result(path, "impact", ["method", "I_c", "e"], "impact_map.toml"))
    bent = prepared(read_result(lever_path, "impact", ["I_c", "nu"], "impact_map_lever.toml"))
    closed, motion = (ds.sel({"method": name}) for name in ("closed", "events"))
    groups = {
        "The symmetric cycle": cycle(closed),
        "What the clock does": motions(closed, motion),
        "A curved lever": lever(bent),
    }
    return groups, [NOTES, "", *words(closed)], lambda: figure(closed, motion, bent)


main = script(__name__, "impact_map.h5 impact_map_lever.h5", conclude)
