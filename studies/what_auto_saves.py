"""What does choosing a method for each cell save over always using the best single one?

    python studies/what_auto_saves.py studies/what_auto_saves.toml

Measures `auto` and every method on the same cells, at rtol from 1e-3 to 1e-13, on one core. The best single method at
an rtol is the fastest of those that give the most cells; "gives" is the share of cells that have a value and are not
INACCURATE. What is saved is its time over that of auto. Below 1 auto is the slower one: it asks for the bounds of every
cell, and pays for cells that the single method leaves unsolved. Timings are noisy and for information only. Errors are
against the best reference among the methods; benchmarks/honesty/auto_honesty.py has 50 digits.
"""

from pathlib import Path

import numpy as np
import xarray as xr
from _common import Claims, Statement, held, said, script
from _figures import Axis, Log, direct_label, method_look, page, panel
from work_precision import tables

import sweep
from sweep.explore.work_precision import TOLERANCES, work_precision

PARTS = ("", "_viscous", "_drag", "_terms", "_balance", "_impact", "_polisher")
"""Ends of the names of the study files."""
AS_MANY = 1e-12
"""Shares of cells that differ by less are the same."""
MARK = {"color": "0.3", "marker": "o", "linestyle": "", "markersize": 4}
OPEN = {"markerfacecolor": "white"}
RING = {**MARK, "markerfacecolor": "none", "markersize": 10, "markeredgewidth": 0.7}


def given(found: xr.Dataset):
    """Share of cells that a method gives and vouches for."""
    return found.ok + found.remarked - found.silent


def best_single(found: xr.Dataset, rtol: float) -> str:
    """The fastest of the methods that give the most cells."""
    row = found.sel({"rtol": rtol}).drop_sel({"method": "auto"})
    most = given(row) >= float(given(row).max()) - AS_MANY
    return str(row["method"].values[int(np.where(most, row.seconds, np.inf).argmin())])


def prepared(path, cells=1024, tolerances=TOLERANCES):
    """The charts of all studies."""
    files = [Path(path).with_name(f"{Path(path).stem}{part}.toml") for part in PARTS]
    return ([work_precision(sweep.study(file), cells=cells, tolerances=tolerances) for file in files],)


def claims(parts) -> Claims:
    """What is checked of each study; and for each rtol what auto saves over the best single method."""
    for found in parts:
        yield found.attrs["title"]
        auto, cells, saved, fewer = found.sel({"method": "auto"}), found.attrs["cells"], [], []
        for rtol in found.rtol.values:
            name = best_single(found, rtol)
            one, single = auto.sel({"rtol": rtol}), found.sel({"method": name, "rtol": rtol})
            gives, there = 100 * float(given(single)), 100 * float(given(one))
            text = f"{single.seconds / one.seconds:.2f} of {name}, which gives {gives:.4g} %"
            saved += [Statement(f"saved at {rtol:.0e}", "", f"{text}; auto by {one.methods_used.item()}")]
            fewer += [f"{there:.4g} % beside {gives:.4g} %"] if there < gives - 100 * AS_MANY else []
        silent, over = float(auto.silent.max()), auto.error_worst / (auto.rtol + found.attrs["reference_error"])
        yield said("auto is silently wrong", silent == 0, f"{100 * silent:g} % of {cells} cells", "nowhere")
        yield held("auto, worst error over rtol", over.max(), "<= 1", "{:.2g}")
        yield said("auto gives the cells that the best single method does", not fewer, ", ".join(fewer), "all, or more")
        yield from saved


TIME = Log("time over that of auto, at rtol = $10^{-7}$ [1]")
KEY = {"gives every cell that auto gives": MARK, "gives fewer": {**MARK, **OPEN}, "best single method": RING}


@panel(TIME, Axis("", (0.45 - len(PARTS), 0.7)), "outside lower center", KEY, ncols=3, fontsize=7)
@page(132.0)
def figure(axes, parts):
    """Time of every method over that of auto at one tolerance, a row for each study; the best single one is ringed."""
    for place, found in zip(range(0, -len(parts), -1), parts, strict=True):
        row = found.sel({"rtol": 1e-7}, method="nearest")
        auto, best = row.sel({"method": "auto"}), best_single(found, float(row.rtol))
        axes.axhline(place, color="0.9", linewidth=0.6, zorder=0)
        title = {"ha": "left", "transform": axes.get_yaxis_transform()}
        direct_label(axes, 0.02, place + 0.32, found.attrs["title"], **title)
        for name in [str(m) for m in found["method"].values if m != "auto"]:
            one, look = row.sel({"method": name}), {**method_look(name), "linestyle": "", "markersize": 5}
            ratio, whole = float(one.seconds / auto.seconds), float(given(one)) >= float(given(auto)) - AS_MANY
            axes.plot([], [], label=name, **look)
            axes.plot(ratio, place, **look, **({} if whole else OPEN))
            if name == best:
                axes.plot(ratio, place, **RING)
    axes.axvline(1.0, color="black", linewidth=0.8)
    axes.set_yticks([])


main = script(__name__, "what_auto_saves.toml", claims, figure, prepared, lambda parts: tables(*parts))
