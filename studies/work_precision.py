"""What does a digit of a foliot's period cost, by which method, and by other libraries?

    python studies/work_precision.py studies/work_precision.toml

Sweeps ten thousand foliots with viscous and Coulomb friction by every method at every tolerance, on one core, follows
some of the same foliots by heyoka.py, diffrax and scipy (the extra `peers`). The time is that of the whole
`sweep.run`, over its cells. Errors are the largest among 400 of the cells, against 20 digits where mpmath is
installed, else against the best method. A table for drag is printed beside it. Timings are noisy and for information
only; errors and counts are checked.

The error is the largest relative one of period, amplitude and speed at the switch. The other libraries are told how
many half swings it takes until nothing is left of a start 10 % from the cycle; diffrax follows all clocks side by side,
each for as many half swings as the slowest.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, Statement, cheapest, held, measured, said, script
from _figures import Log, direct_label, draw_precision, method_look, page, panel
from _peers import CLOCKS, swings

import sweep
from sweep.cells.grid import Grid
from sweep.cells.sample import sampled, solved
from sweep.explore.work_precision import TOLERANCES, precision_cells, precision_text, work_precision

DIGITS = 20
"""Of the truth."""
PEER_CELLS = {"heyoka.py": 1, "diffrax": 2, "scipy": 10}
"""Other libraries follow every so many-th of the cells; diffrax follows all of them side by side."""
LONGEST = 10.0
PLACES = {
    "auto": (0.6, 1.0), "coulomb": (0.85, 9.0), "quadrature": (1.7, 9.0), "segments": (1.9, 1.0), "sdirk4": (1.9, 2.0),
}  # fmt: skip
"""Where the names of methods stand whose marks are close: factors of time and error. Others stand above their marks."""


def cycles(study: sweep.study.read.Study, cells: int) -> dict[str, Any] | None:
    """True values of the outputs by mpmath; None where that is not installed or the oracle is not at hand."""
    folder = str(Path(__file__).parents[1] / "tests" / "oracles")
    sys.path += [] if folder in sys.path else [folder]
    try:
        truth = import_module("foliot_oracles")
    except ImportError:
        return None
    fixed = {name: study.fixed[name] for name in ("mu", "phi0", "a", "R", "c", "n", "k", "e") if name in study.fixed}
    columns, rows = precision_cells(study, cells), []
    for values in zip(*columns.values(), strict=True):
        cell = {**fixed, **dict(zip(columns, map(float, values), strict=True))}
        rows.append([float(x) for x in truth.cycle(**cell, digits=DIGITS)])
    names = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
    found = dict(zip(names, np.transpose(rows), strict=True))
    return {name: found[name] for name in study.outputs}


def swept(study: sweep.study.read.Study, found: xr.Dataset) -> xr.Dataset:
    """`found` with the CPU seconds of `sweep.run` over the whole grid, per cell, by every method and tolerance.

    The less of two runs counts, for the first may load machine code. What would take more than `LONGEST` seconds keeps
    the time of its sample, beside which the engine's share is small.
    """
    seconds = found.seconds.copy()
    for method in map(str, found["method"].values):
        for rtol in found.rtol.values:
            at, spent = {"method": method, "rtol": rtol}, []
            for _ in range(2 if float(seconds.sel(at)) * Grid(study).size < LONGEST else 0):
                begin = time.process_time()
                sweep.run(replace(study, method=method, rtol=float(rtol)), progress=False, workers=1)
                spent.append((time.process_time() - begin) / Grid(study).size)
            seconds.loc[at] = min(spent, default=float(seconds.sel(at)))
    return found.assign(seconds=seconds)


def peers(study: sweep.study.read.Study, true, cells: int, tolerances: Sequence[float]) -> dict[str, xr.Dataset]:
    """Other libraries on some of the cells, by name; none where the truth is not at hand."""
    if true is None:
        return {}
    given, found = precision_cells(study, cells), {}
    left = solved(replace(sampled(study, cells), outputs=("multiplier",), method="auto", rtol=1e-6))[0]["multiplier"]
    rows = np.transpose([given["a"], given["R"], left, *true.values()])
    for name, follower in CLOCKS.items():
        (a, R, left, *truth), made = rows[:: PEER_CELLS[name]].T, cache(follower)  # once a tolerance, and not timed

        def off(rtol: float, a=a, R=R, left=left, truth=truth, made=made):
            followed = made(rtol)(a, R, truth[2], [swings(rtol, x) for x in left])
            return abs(followed / np.transpose(truth) - 1).max(axis=1)

        found[name] = measured(off, tolerances)
    return found


def honesty(title: str, found: xr.Dataset) -> Claims:
    """What is checked of a chart: no method is silently wrong, and `auto` is right wherever it says so."""
    auto = found.sel({"method": "auto"})
    over = float((auto.error_worst / (auto.rtol + found.attrs["reference_error"])).max())
    silent = float(found.silent.max())
    cells = f"{found.attrs['cells']} cells, {len(found.rtol)} tolerances"
    yield said(f"{title}: silently wrong", silent == 0, f"{100 * silent:g} % of {cells}", "none")
    yield held(f"{title}: auto, worst error over rtol", over, "<= 1", "{:.2g}")
    yield held(f"{title}: auto leaves unsolved", auto.unsolved.max(), "<= 0 %", "{:.2%}")


def whole(found: xr.Dataset) -> dict[str, xr.Dataset]:
    """By method, the worst error and the time of each tolerance at which it solves all cells."""
    rows = {str(name): found.sel({"method": name}) for name in found["method"].values}
    return {name: row.assign(worst=row.error_worst.where(row.unsolved + row.silent == 0)) for name, row in rows.items()}


def prepared(path, cells=400, tolerances=TOLERANCES):
    """The two charts, and others beside the first."""
    study, drag = (sweep.study(Path(path).with_name(f"work_precision{end}.toml")) for end in ("", "_drag"))
    true, keys = cycles(study, cells), {"cells": cells, "tolerances": tolerances}
    coulomb = work_precision(study, truth=true, **keys)
    dragged = work_precision(drag, truth=cycles(drag, cells), **keys)
    coulomb, others = swept(study, coulomb), peers(study, true, cells, tolerances)
    return coulomb, others, dragged


def tables(*charts):
    """The charts as tables."""
    return [f"{one.attrs['title']}\n{precision_text(one, complete=True)}\n" for one in charts]


def claims(coulomb, others, dragged) -> Claims:
    yield "Honesty"
    yield from honesty("viscous and Coulomb", coulomb)
    yield from honesty("drag", dragged)

    yield "Cost, viscous and Coulomb"
    yield from cheapest(whole(coulomb) | others)
    yield from (Statement(name, "", "not installed") for name in PEER_CELLS if name not in others)

    yield "Cost, drag"
    yield from cheapest(whole(dragged))


COST, ERROR = Log("CPU time per cell [s]", (3e-7, 0.5)), Log("largest relative error of a cell [1]", (3e-17, 3))


@panel(COST, ERROR)
@page(100.0, 150.0)
def figure(axes, found, others, _):
    """The largest error over the time of a cell: a line for each method and library, through its tolerances."""
    rows = {str(name): found.sel({"method": name}) for name in found["method"].values}
    for name, row in rows.items():  # what a tolerance does not change is one mark
        if float(row.error_worst.max()) < 2 * float(row.error_worst.min()):
            rows[name] = row.isel(rtol=[int(row.seconds.argmin("rtol"))])
    for row in rows.values():
        draw_precision(axes, row.expand_dims("method"), "error_worst")
    for name, row in others.items():
        axes.plot(row.seconds, row.worst, linewidth=0.8, markersize=4, label=name, **method_look(name))
    for name, line in zip([*rows, *others], [x for x in axes.lines if x.get_label()[0] != "_"], strict=True):
        top = int(np.nanargmax(line.get_ydata()))
        right, up = PLACES.get(name, (1.0, 5.0))
        x, y = right * line.get_xdata()[top], up * line.get_ydata()[top]
        direct_label(axes, x, y, name, line.get_color())
    text = "each mark a tolerance,\nfrom $10^{-3}$ (top) to $10^{-13}$"
    axes.text(0.02, 0.97, text, va="top", fontsize=7, color="0.35", transform=axes.transAxes)


main = script(__name__, "work_precision.toml", claims, figure, prepared, lambda *made: tables(made[0], made[2]))
