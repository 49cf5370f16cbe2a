"""What does a digit of a foliot's period cost, by which method, and by other libraries?

    python studies/work_precision.py studies/work_precision.toml

Sweeps ten thousand foliots with viscous and Coulomb friction by every method at every tolerance, on one core, and
follows some of them by heyoka.py, diffrax and scipy (the extra `peers`). The time is that of the whole `sweep.run`,
over its cells. The error is the largest relative one of period, amplitude and speed at the switch among 400 of the
cells, against 20 digits where mpmath is installed, else against the best method. A table for drag is printed beside it.
Timings are noisy and for information only.

The other libraries know how many half swings it takes until nothing is left of a start 10 % from the cycle; diffrax
follows all clocks side by side, each for as many half swings as the slowest.
"""

import sys
from dataclasses import replace
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, Statement, by_method, cheapest, held, measured, said, script
from _figures import COST, Log, draw_costs, draw_precision, page, panel
from _peers import CLOCKS, swings

import sweep
from sweep.cells.grid import Grid
from sweep.explore.work_precision import TOLERANCES, precision_cells, precision_text, work_precision

PEER_CELLS = {"heyoka.py": 1, "diffrax": 2, "scipy": 10}
"""Other libraries follow every so many-th of the cells."""


def cycles(study, cells: int) -> dict[str, Any]:
    """True values by mpmath, to 20 digits; none where that is not installed or the oracle is not at hand."""
    sys.path.append(str(Path(__file__).parents[1] / "tests" / "oracles"))
    try:
        truth = import_module("foliot_oracles")
    except ImportError:
        return {}
    cell, names = {**study.fixed, **precision_cells(study, cells)}, ("mu", "phi0", "a", "R", "c", "n")
    exact = np.vectorize(lambda *values: tuple(map(float, truth.cycle(*values, digits=20))), otypes="ddddd")
    found = exact(*(cell.get(name, 0.0) for name in names))
    return dict(zip(("period", "amplitude", "crossing_speed", "sensitivity", "multiplier"), found, strict=True))


def swept(study, found: xr.Dataset) -> xr.Dataset:
    """`found` with the CPU seconds of `sweep.run` over the grid, per cell; above 10 s the sample's time stands."""
    seconds = found.seconds.copy()

    def statuses(rtol: float, method: str):
        wanted = replace(study, method=method, rtol=float(rtol))
        return sweep.run(wanted, progress=False, workers=1).status.values.ravel()

    for name, row in by_method(found).items():
        quick = row.rtol.values[row.seconds.values * Grid(study).size < 10.0]
        if quick.size:
            seconds.loc[{"method": name, "rtol": quick}] = measured(partial(statuses, method=name), quick).seconds
    return found.assign(seconds=seconds)


def peers(study, true: dict[str, Any], cells: int, tolerances: Any) -> dict[str, xr.Dataset]:
    """Other libraries on some of the cells, by name; none where the truth is not at hand."""
    given, found = precision_cells(study, cells), {}
    for name, follower in CLOCKS.items() if true else ():
        columns = (given["a"], given["R"], true["multiplier"], *(true[name] for name in study.outputs))
        (a, R, left, *truth), made = (x[:: PEER_CELLS[name]] for x in columns), cache(follower)  # once a tolerance

        def off(rtol: float, a=a, R=R, left=left, truth=truth, made=made):
            followed = made(rtol)(a, R, truth[2], [swings(rtol, x) for x in left])
            return abs(followed / np.transpose(truth) - 1).max(axis=1)

        found[name] = measured(off, tolerances)
    return found


def honesty(title: str, found: xr.Dataset) -> Claims:
    """What is checked of a chart: no method is silently wrong, and `auto` is right wherever it says so."""
    auto = found.sel({"method": "auto"})
    over, silent = auto.error_worst / (auto.rtol + found.attrs["reference_error"]), float(found.silent.max())
    cells = f"{found.attrs['cells']} cells, {len(found.rtol)} tolerances"
    yield said(f"{title}: silently wrong", silent == 0, f"{100 * silent:g} % of {cells}", "none")
    yield held(f"{title}: auto, worst error over rtol", over.max(), "<= 1", "{:.2g}")
    yield held(f"{title}: auto leaves unsolved", auto.unsolved.max(), "<= 0 %", "{:.2%}")


def solving(found: xr.Dataset) -> dict[str, xr.Dataset]:
    """The rows of a chart with the `worst` error where all cells are solved."""
    return by_method(found.assign(worst=found.error_worst.where(found.unsolved + found.silent == 0)))


def prepared(path, cells=400, tolerances=TOLERANCES):
    """The two charts, and others beside the first."""

    def chart(study, true: dict[str, Any]) -> xr.Dataset:
        known = {name: true[name] for name in study.outputs} if true else None
        return work_precision(study, truth=known, cells=cells, tolerances=tolerances)

    study, drag = (sweep.study(Path(path).with_name(f"work_precision{end}.toml")) for end in ("", "_drag"))
    true = cycles(study, cells)
    coulomb, dragged = swept(study, chart(study, true)), chart(drag, cycles(drag, cells))
    return coulomb, peers(study, true, cells, tolerances), dragged


def tables(*charts):
    """The charts as tables."""
    return [f"{one.attrs['title']}\n{precision_text(one, complete=True)}\n" for one in charts]


def claims(coulomb, others, dragged) -> Claims:
    yield "Honesty"
    yield from honesty("viscous and Coulomb", coulomb)
    yield from honesty("drag", dragged)

    yield "Cost, viscous and Coulomb"
    yield from cheapest(solving(coulomb) | others)
    yield from (Statement(name, "", "not installed") for name in PEER_CELLS if name not in others)

    yield "Cost, drag"
    yield from cheapest(solving(dragged))


@panel(COST.to(3e-7, 0.5), Log("largest relative error of a cell [1]", (3e-17, 3)), "beside")
@page(100.0, 150.0)
def figure(axes, found, others, _):
    """The largest error over the time of a cell: a line for each method and library, through its tolerances."""
    for row in by_method(found).values():
        same = row.error_worst.max() < 2 * row.error_worst.min()  # what a tolerance does not change is one mark
        shown = row.isel(rtol=[int(row.seconds.argmin("rtol"))]) if same else row
        draw_precision(axes, shown.expand_dims("method"), "error_worst")
    draw_costs(axes, others, list(others))
    text = "each mark a tolerance,\nfrom $10^{-3}$ (top) to $10^{-13}$"
    axes.text(0.02, 0.97, text, va="top", fontsize=7, color="0.35", transform=axes.transAxes)


main = script(__name__, "work_precision.toml", claims, figure, prepared, lambda *made: tables(made[0], made[2]))
