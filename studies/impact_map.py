"""When does a crown wheel that collides with a foliot keep a steady beat, and how far does it recoil?

    sweep run studies/impact_map.toml
    sweep run studies/impact_map_lever.toml
    python studies/impact_map.py impact_map.h5 impact_map_lever.h5

draws impact_map.png and prints theory beside what comes out. Two bodies of masses M and m at the pallet, kappa = M/m,
under the force F = m g kappa, with one impact per half period T:
    T^2 = p(1 + e)/(g(1 - e)(1 + kappa)),  swing Y = kappa g T^2/4,  recoil if kappa < 2e/(1 - e),
where no tooth is met in between; stable for kappa > 1. The models of Lepschy and Roup are of this kind; what
Denny's loses is not known here. Only their abstracts were at hand, and no number here is theirs.
"""

from __future__ import annotations

import math
import sys
import textwrap
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, direct_label, hatch, page_of, read_result, report

import sweep
from kernels.interface import Status

NOTES = """\
theory: kappa = M/m, the mass of the wheel over that of the foliot, both at the pallet; deviation: relative, in the
worst cell; allowed 1e-9 of what is followed contact by contact, 1e-8 of what is followed in SI units at rtol 1e-10"""

EXISTS = (Status.OK, Status.UNSTABLE, Status.GRAZING)

KINDS = ("one impact", "several impacts", "bounces end in contact", "off centre", "period 2", "never settles", "open")
KIND_COLOURS = ("#0072B2", "#56B4E9", "#009E73", "#E69F00", "#CC79A7", "#D55E00", "0.85")

LEVER_E = 0.6


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with kappa, the pitch p and the swing and recoil over it."""
    pitch = 2 * math.pi * ds.r_c / ds.teeth
    kappa = (ds.I_c / ds.r_c**2) / (ds.I_v / ds.r_v**2)
    return ds.assign_coords(kappa=kappa).assign(pitch=pitch, Y=ds.swing / pitch)


def count(condition: xr.DataArray) -> int:
    return int(condition.sum())


def cycle(closed: xr.Dataset) -> list[Statement]:
    """The symmetric cycle where it exists; e = 0 is another one, with the tooth resting on the pallet."""
    free = closed.where(closed.status.isin(EXISTS) & (closed.e > 0))
    here = free.period.notnull() & (free.status != Status.GRAZING) & (abs(free.kappa - 1) > 1e-12)
    loose = count(here & ((free.multiplier < 1) != (free.kappa > 1)))
    thrown = count(here & ((free.recoil > 0) != (free.kappa < 2 * free.e / (1 - free.e))))
    return [
        Statement("stable for kappa > 1 and no other", "no exception", f"{loose} exceptions", None, not loose),
        Statement("recoil for kappa < 2e/(1 - e)", "no exception", f"{thrown} exceptions", None, not thrown),
    ]


def plastic(closed: xr.Dataset) -> list[Statement]:
    """e = 0, the tooth on the pallet until it escapes: the kernel beside the scene `verge_scene` in SI units."""
    stuck = closed.isel(e=0).isel(I_c=slice(None, None, max(1, closed.sizes["I_c"] // 8)))
    n = float(stuck.r_v / stuck.r_c)
    phi0 = float(stuck.h / stuck.r_v)
    fixed = {"tau": float(stuck.torque), "I_v": float(stuck.I_v), "n": n, "phi0": phi0}
    fixed["drop"] = math.pi / float(stuck.teeth) - 2 * n * phi0
    periods = []
    for flips in (3000, 3002):  # an even number: the last event is a landing
        scene = {"kernel": "verge_scene:KERNEL", "axes": {"I_c": stuck.I_c.values}, "fixed": fixed | {"flips": flips}}
        periods.append(2 * sweep.run(rtol=1e-10, allow_import=True, **scene).clock.values)
    off = float(abs(stuck.period.values / periods[0] - 1).max())
    cells = f"{stuck.I_c.size} cells"
    wander = float(abs(periods[1] / periods[0] - 1).max())
    return [
        Statement("e = 0: period of the kernel and in SI units", "the same", cells, off, off < 1e-8),
        Statement("e = 0: from rest to a steady beat at every kappa", "yes", "last change", wander, wander < 1e-10),
    ]


def words(closed: xr.Dataset) -> str:
    """The conclusion, with the numbers of this grid."""
    loose = closed.where(closed.status.isin(EXISTS) & (closed.e > 0))
    steady = loose.where(loose.status == Status.OK)
    kept = steady.e.where(steady.period.notnull())
    first = kept.isel(I_c=kept.notnull().any("e").values.nonzero()[0][[0, -1]])
    low, high = first.min("e").values, first.max("e").values
    near, far = first.kappa.values
    windows = f"{low[0]:.2f} to {high[0]:.2f} at kappa = {near:.3g}, from {low[1]:.2f} to {high[1]:.2f} at {far:.3g}"
    text = f"""In words: with a flat lever only a wheel heavier than the foliot keeps the beat of one impact, and only
        if the impacts are neither too soft (the tooth catches up with the pallet) nor too hard (the pallet comes to
        another tooth): e from {windows}.
        Its swing is {float(steady.Y.min()):.2f} to {float(steady.Y.max()):.2f} of the tooth pitch, whatever the torque;
        its wheel is thrown back by {_thrown(steady):.3f} of the pitch at most. Heavier foliots throw the wheel back by
        up to {_thrown(loose):.2f} of it and lose that beat: they bounce until they rest against the tooth, or wander,
        unless their lever yields as it is pushed."""
    return textwrap.fill(" ".join(text.split()), 120)


def _thrown(ds: xr.Dataset) -> float:
    """Largest recoil over the tooth pitch."""
    return float(ds.recoil.max() * ds.teeth / (2 * math.pi))


def kinds(motion: xr.Dataset) -> xr.DataArray:
    """What the motion is, as position in `KINDS`."""
    told = motion.status.isin((Status.OK, Status.GRAZING, Status.INACCURATE))
    centred = abs(motion.offset) < 1e-6 * motion.pitch
    kind = xr.full_like(motion.status, KINDS.index("open"), dtype=int)
    rules = (
        (told & centred & (motion.impacts == 1), "one impact"),
        (told & centred & (motion.impacts > 1), "several impacts"),
        (told & centred & np.isinf(motion.impacts), "bounces end in contact"),
        (told & ~centred, "off centre"),
        (motion.status == Status.PERIOD_2, "period 2"),
        (motion.status == Status.NOT_PERIODIC, "never settles"),
    )
    for where, name in rules:
        kind = kind.where(~where, KINDS.index(name))
    return kind


def motions(closed: xr.Dataset, motion: xr.Dataset) -> list[Statement]:
    """What the clock does, followed contact by contact."""
    both = (closed.status == Status.OK) & (motion.status == Status.OK) & (motion.impacts == 1)
    same = motion.where(both & (closed.e > 0))
    lost = (closed.status == Status.OK) & (motion.status != Status.OK)
    force = closed.torque * closed.r_c / closed.I_c
    twice = 2 * np.sqrt(closed.pitch * (1 + closed.e) / (force * (1 - closed.e) * (1 + closed.kappa)))
    way = same.kappa * (1 + same.e) / (4 * (1 - same.e) * (1 + same.kappa))
    slow, wide = (float(abs(here / theory - 1).max()) for here, theory in ((same.period, twice), (same.Y, way)))
    return [
        Statement("period by events = 2T", "1e-9", f"{count(both)} cells", slow, slow < 1e-9),
        Statement("swing by events = Y, whatever the torque", "1e-9", f"{count(both)} cells", wide, wide < 1e-9),
        Statement("stable cycles that events does not settle on", "1 %", f"{count(lost)} cells", None,
                  count(lost) < 0.01 * lost.size),
    ]  # fmt: skip


def census(motion: xr.Dataset) -> str:
    """How many cells move in what way."""
    kind = kinds(motion)
    told = ", ".join(f"{name} {count(kind == i)}" for i, name in enumerate(KINDS))
    return textwrap.fill(f"The clock's motion, in cells: {told}.", 120)


def flip_border(kappa: Any, e: float) -> Any:
    """nu at which a multiplier is -1, for any kappa; so it is at kappa = 1 for any nu."""
    return -4 * (1 + e) ** 2 / ((1 - e) ** 2 * kappa + 2 * (1 + e * e))


def lever(bent: xr.Dataset) -> list[Statement]:
    """A curved lever can steady a heavy foliot."""
    exists = bent.status.isin((Status.OK, Status.UNSTABLE))
    k, flip = bent.kappa, flip_border(bent.kappa, LEVER_E)
    # of light foliots p(1) > 0 and p(-1) < 0, p the characteristic polynomial of the half map
    light = (bent.nu < 4 * (1 + k) / (k * (k - 1))) & (bent.nu > flip)
    steady = xr.where(k < 1, (bent.nu > -4 * (1 + k) / (k * (1 - k))) & (bent.nu < flip), light)
    wrong = count(exists & (steady != (bent.multiplier < 1)))
    heavy = exists & (bent.kappa < 1)
    held = count(heavy & (bent.multiplier < 1))
    some = f"{held} of {count(heavy)} cells"
    flat = count(heavy & (abs(bent.nu) < 1e-9) & (bent.multiplier < 1))
    return [
        Statement("stability between the two borders in nu", "no exception", f"{wrong} exceptions", None, not wrong),
        Statement("heavy foliots steadied by a lever that yields", "some", some, None, held > 0),
        Statement("heavy foliots steady with a flat lever", "none", f"{flat} cells", None, not flat),
    ]


def figure(closed: xr.Dataset, motion: xr.Dataset, bent: xr.Dataset) -> Any:
    """Cycle, recoil, motion and lever; for two columns of print."""
    with page_of(150.0, 2, 2) as (page, axes):
        draw_swing(page, axes[0, 0], closed)
        draw_recoil(page, axes[0, 1], closed)
        keys = draw_kinds(axes[1, 0], motion)
        page.legend(handles=keys, title="(c) the clock's motion", loc="outside lower left", ncols=3)
        page.legend(handles=draw_lever(page, axes[1, 1], bent), title="Borders", loc="outside lower right")
    return page


def _frame(axes: Any, ds: xr.Dataset) -> tuple[Any, Any]:
    kappa, e = ds.kappa.values, ds.e.values
    axes.set(xscale="log", xlim=(kappa[0], kappa[-1]), ylim=(e[0], e[-1]))
    axes.set(xlabel=r"wheel over foliot, $\kappa$ [1]", ylabel="restitution, $e$ [1]")
    return kappa, e


def _missing(axes: Any, ds: xr.Dataset, values: Any) -> None:
    kappa, e = _frame(axes, ds)
    hatch(axes, kappa, e, np.isnan(values), "////")


def draw_swing(page: Any, axes: Any, ds: xr.Dataset) -> None:
    """Swing of the symmetric cycle; left of the line it is unstable."""
    values = ds.Y.transpose("e", "I_c").values
    kappa, e = _frame(axes, ds)
    mesh = axes.pcolormesh(kappa, e, values, vmin=0, vmax=0.8, cmap="cividis", shading="nearest", rasterized=True)
    page.colorbar(mesh, ax=axes, label="swing over tooth pitch, $Y/p$ [1]", pad=0.02)
    _missing(axes, ds, values)
    _border(axes, np.ones_like(e), e)
    direct_label(axes, 0.1, 0.85, "no cycle with one impact")
    direct_label(axes, 10.0, 0.3, "stable")
    direct_label(axes, 0.36, 0.5, "unstable", fontsize=7)


def draw_recoil(page: Any, axes: Any, ds: xr.Dataset) -> None:
    """How far the wheel is thrown back, and the border of recoil."""
    values = np.degrees(ds.recoil.transpose("e", "I_c").values)
    pitch = math.degrees(float(2 * math.pi / ds.teeth))
    kappa, e = _frame(axes, ds)
    shown = np.ma.masked_invalid(values / pitch)
    mesh = axes.pcolormesh(kappa, e, shown, cmap="cividis", vmin=0, vmax=0.4, shading="nearest", rasterized=True)
    page.colorbar(mesh, ax=axes, label="recoil over tooth pitch [1]", pad=0.02)
    _missing(axes, ds, values)
    _border(axes, kappa, kappa / (2 + kappa))
    direct_label(axes, 12, 0.3, "no recoil")


def _border(axes: Any, x: Any, y: Any) -> None:
    """A border by theory, to be seen on any ground."""
    axes.plot(x, y, color="white", linewidth=1.4)
    axes.plot(x, y, color="black", linewidth=0.8, linestyle=(0, (4, 2)))


def draw_kinds(axes: Any, motion: xr.Dataset) -> list[Any]:
    """What the clock does, contact by contact; the keys of its colours."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    kappa, e = _frame(axes, motion)
    kind = kinds(motion).transpose("e", "I_c").values
    palette = ListedColormap(list(KIND_COLOURS))
    axes.pcolormesh(kappa, e, kind, cmap=palette, vmin=-0.5, vmax=len(KINDS) - 0.5, shading="nearest", rasterized=True)
    there = [i for i in range(len(KINDS)) if (kind == i).any()]
    return [Patch(color=KIND_COLOURS[i], label=KINDS[i]) for i in there]


def draw_lever(page: Any, axes: Any, bent: xr.Dataset) -> list[Any]:
    """Multiplier over kappa and the lever's curvature; the keys of all borders by theory."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    kappa, nu = bent.kappa.values, bent.nu.values
    values = bent.multiplier.transpose("nu", "I_c").values
    mesh = axes.pcolormesh(kappa, nu, values, vmin=0.5, vmax=1.5, cmap="RdBu_r", shading="nearest", rasterized=True)
    page.colorbar(mesh, ax=axes, label="multiplier [1]", pad=0.02, extend="max")
    hatch(axes, kappa, nu, np.isnan(values), "////")
    inside = kappa[~np.isnan(values).all(axis=0)]
    axes.plot(inside, flip_border(inside, LEVER_E), color="black", linewidth=0.9)
    axes.axvline(1.0, color="black", linewidth=0.9)
    axes.set(xscale="log", xlim=(kappa[0], kappa[-1]), ylim=(nu[0], nu[-1]))
    axes.set(xlabel=r"wheel over foliot, $\kappa$ [1]", ylabel=r"curvature of the lever, $\nu$ [1]")
    direct_label(axes, 0.3, -7, "stable")
    direct_label(axes, 0.22, 3, "unstable")
    dashed = {"color": "black", "linewidth": 0.8, "linestyle": (0, (4, 2))}
    return [
        Line2D([], [], **dashed, label=r"(a) $\kappa=1$, (b) $\kappa=2e/(1-e)$"),
        Line2D([], [], color="black", linewidth=0.9, label="(d) multiplier 1 by theory"),
        Patch(facecolor="white", edgecolor="0.45", hatch="////", linewidth=0.5, label="no cycle with one impact"),
    ]


def conclude(path: str, lever_path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = prepared(read_result(path, "impact", ["method", "I_c", "e"], "impact_map.toml"))
    bent = prepared(read_result(lever_path, "impact", ["I_c", "nu"], "impact_map_lever.toml"))
    closed, motion = (ds.sel({"method": name}) for name in ("closed", "events"))
    groups = {
        "The symmetric cycle": [*cycle(closed), *plastic(closed)],
        "What the clock does": motions(closed, motion),
        "A curved lever": lever(bent),
    }
    return groups, [NOTES, "", words(closed), census(motion)], lambda: figure(closed, motion, bent)


main = partial(report, __file__, ["impact_map.h5", "impact_map_lever.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
