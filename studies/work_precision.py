"""What does a digit of a foliot's period cost, by which method?

    python studies/work_precision.py studies/work_precision.toml

measures every method on the same cells, in one run on one core, and draws work_precision.png: errors against 40
digits where mpmath is installed, else against the best method; heyoka.py, diffrax and scipy (the extra `peers`) where
they are, integrating from one switch to the next until nothing is left of the start. Times are noisy and only told;
errors and counts are checked.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, differing, report

import sweep
from sweep.explore.work_precision import TOLERANCES, precision_cells, precision_text, work_precision

DIGITS = 20
"""Of the truth."""
PEER_CELLS = 40
ORDERS = {"euler": (1, 1e-2), "semi_implicit": (1, 1e-2), "verlet": (2, 1e-2), "rk4": (4, 1e-2)}
"""Order, and by how much the exponent of the error in the step may be off, for steps from 0.01 to 0.1 s."""

NOTES = """\
error: the largest of period, amplitude and speed at the switch, relative; of fixed steps: of the third switch's time
open marks: some cells are refused, or said not to be right to rtol; black crosses: silently wrong; grey: below what the
truth is right to. Others (heyoka.py, diffrax, scipy) are told how many half swings it takes and start 10 % from the
cycle; diffrax does all clocks side by side, each as often as the slowest"""


def cycles(study: sweep.study.read.Study, cells: int) -> dict[str, Any] | None:
    """True values of the outputs, by mpmath; None where it is not installed or the oracle is not at hand."""
    oracle = _oracle("foliot_oracles")
    if oracle is None:
        return None
    columns = precision_cells(study, cells)
    fixed = {name: study.fixed[name] for name in ("mu", "phi0", "a", "R", "c", "n", "k", "e") if name in study.fixed}
    rows = []
    for values in zip(*columns.values(), strict=True):
        cell = {**fixed, **dict(zip(columns, map(float, values), strict=True))}
        rows.append([float(x) for x in oracle.cycle(**cell, digits=DIGITS)])
    names = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
    found = dict(zip(names, np.transpose(rows), strict=True))
    return {name: found[name] for name in study.outputs}


def _oracle(name: str) -> Any:
    from importlib import import_module

    folder = str(Path(__file__).parents[1] / "tests" / "oracles")
    sys.path += [] if folder in sys.path else [folder]
    try:
        return import_module(name)
    except ImportError:
        return None


def charted(path: Path, cells: int, tolerances: Sequence[float]) -> xr.Dataset:
    """Every method at every tolerance on the cells of a study file."""
    study = sweep.study(path)
    return work_precision(study, cells=cells, tolerances=tolerances, truth=cycles(study, cells))


def peers(path: Path, tolerances: Sequence[float]) -> dict[str, xr.Dataset]:
    """Others on some cells of the study with Coulomb friction, by name; none where truth is not at hand."""
    from _peers import FOLLOWERS

    study = sweep.study(path)
    cells, true = precision_cells(study, PEER_CELLS), cycles(study, PEER_CELLS)
    if true is None:
        return {}
    multiplier = _multiplier(study, PEER_CELLS)
    return {name: _measured(follower, cells, true, multiplier, tolerances) for name, follower in FOLLOWERS.items()}


def _measured(follower: Any, cells: Any, true: Any, multiplier: Any, tolerances: Sequence[float]) -> xr.Dataset:
    from _peers import swings

    rows = []
    for rtol in tolerances:
        columns = (cells["a"], cells["R"], true["crossing_speed"], [swings(rtol, m) for m in multiplier])
        one = follower(rtol)
        one.settle(*columns[:3], [2] * len(multiplier))  # compiled before it is timed
        begin = time.perf_counter()
        found = one.settle(*columns)
        seconds = (time.perf_counter() - begin) / len(found)
        off = np.max(abs(found / np.transpose(list(true.values())) - 1), axis=1)
        rows.append((np.median(off), off.max(), seconds))
    keys = ("error_median", "error_worst", "seconds")
    return xr.Dataset({k: ("rtol", list(v)) for k, v in zip(keys, zip(*rows, strict=True), strict=True)})


def _multiplier(study: sweep.study.read.Study, cells: int) -> Any:
    """Of the cycles' half swings: what is left of a start after each."""
    from dataclasses import replace

    from sweep.cells.sample import sampled, solved

    return solved(replace(sampled(study, cells), outputs=("multiplier",), method="auto", rtol=1e-6))[0]["multiplier"]


def stepped(path: Path) -> xr.Dataset | None:
    """Relative error of the third switch, median and worst clock, and calls of the rates, over method and step."""
    oracle = _oracle("scene_oracles")
    if oracle is None:
        return None
    ds = sweep.run(sweep.study(path))
    fixed = [float(ds[name]) for name in ("phi0", "a", "c")]
    true = [float(oracle.quadratic_foliot(float(mu), *fixed, int(ds.flips))[0]) for mu in ds.mu]
    error = abs(ds.time / xr.DataArray(true, dims="mu") - 1)
    medians = {"error_median": error.median("mu"), "error_worst": error.max("mu")}
    return xr.Dataset({**medians, "rate_calls": ds.rate_calls.mean("mu")})


def honesty(title: str, found: xr.Dataset) -> list[Statement]:
    """What is checked of a chart: no method is silently wrong, and `auto` is right wherever it says so."""
    auto = found.sel({"method": "auto"})
    over = float((auto.error_worst / (auto.rtol + found.attrs["reference_error"])).max())
    silent, unsolved = float(found.silent.max()), float(auto.unsolved.max())
    cells = f"{found.attrs['cells']} cells, {len(found.rtol)} tolerances"
    return [
        Statement(f"{title}: silently wrong", "none", f"{100 * silent:g} % of {cells}", None, silent == 0),
        Statement(f"{title}: auto, worst error over rtol", "<= 1", f"{over:.2g}", None, over <= 1),
        Statement(f"{title}: auto leaves unsolved", "none", f"{100 * unsolved:g} %", None, unsolved == 0),
    ]


def costs(found: xr.Dataset) -> list[Statement]:
    """Time per cell that each method takes for a worst cell right to 1e-3, 1e-7 and 1e-11."""
    lines = []
    for name in found["method"].values:
        row = found.sel({"method": name})
        texts = []
        for wanted in (1e-3, 1e-7, 1e-11):
            enough = row.seconds.where((row.error_worst <= wanted) & (row.unsolved + row.silent == 0))
            texts.append("-" if bool(enough.isnull().all()) else f"{1e6 * float(enough.min()):.3g}")
        lines.append(Statement(f"{name}: us a cell, worst right to 1e-3, 1e-7, 1e-11", "", ", ".join(texts)))
    return lines


def orders(found: xr.Dataset) -> list[Statement]:
    """The error's exponent in the step, and what order 1 and 4 cost."""
    lines = []
    for name, (order, allowed) in ORDERS.items():
        row = found.error_median.sel({"method": name}).where((found.step > 0.01) & (found.step < 0.1), drop=True)
        slope = float(np.polyfit(np.log(row.step), np.log(row), 1)[0])
        lines.append(
            differing(f"{name}: exponent of the error in the step", str(order), slope, order, allowed * order * 5)
        )
    for name in ("verlet", "rk4", "dopri5", "dop853"):
        row = found.sel({"method": name})
        calls = row.rate_calls.where(row.error_worst <= 1e-7)
        text = "-" if bool(calls.isnull().all()) else f"{float(calls.min()):.4g}"
        lines.append(Statement(f"{name}: calls of the rates for 1e-7", "", text))
    return lines


def figure(coulomb: xr.Dataset, drag: xr.Dataset, steps: xr.Dataset | None, others: dict[str, xr.Dataset]) -> Any:
    """Median cell above, worst cell below: two friction laws over time, and fixed steps over calls of the rates."""
    from sweep.show import charts

    with charts.style():
        page = charts.new_figure(charts.PAGE, 146.0)
        panels = page.subplots(2, 3, sharex="col", sharey=True)
        names = [*coulomb["method"].values.tolist(), *drag["method"].values.tolist()]
        for row, key, what in zip(panels, ("error_median", "error_worst"), ("median", "worst"), strict=True):
            for axes, found in zip(row, (coulomb, drag), strict=False):
                charts.draw_precision(axes, found, key, names)
                axes.set_xlabel("")
            row[0].set_ylabel(f"relative error, {what} cell [1]")
            for (name, other), mark in zip(others.items(), "*xP", strict=False):
                row[0].plot(other.seconds, other[key], "k--", marker=mark, linewidth=0.8, label=name)
            draw_steps(row[2], steps, key)
        for axes, text in zip(panels.flat, "abcdef", strict=True):
            charts.letter(axes, text)
        for axes, text in zip(panels[0], ("viscous and Coulomb", r"drag $|v|^{3/2}$", "fixed steps"), strict=True):
            axes.set_title(text)
        for axes in panels[1][:2]:
            axes.set_xlabel("time per cell on one core [s]")
        panels[1][2].set_xlabel("calls of the rates [1]")
        keys = {t: h for axes in panels[0][:2] for h, t in zip(*axes.get_legend_handles_labels(), strict=True)}
        keys |= {text: mark for found in (coulomb, drag) for text, mark in charts.precision_marks(found).items()}
        page.legend(keys.values(), keys.keys(), loc="outside lower left", ncols=3, title="(a), (b), (d), (e)")
        last = panels[0][2].get_legend_handles_labels()
        page.legend(*last, loc="outside lower right", ncols=2, title="(c), (f)")
    return page


def draw_steps(axes: Any, found: xr.Dataset | None, key: str) -> None:
    """Error over calls of the rates, a line for each integrator."""
    from sweep.show.charts import COLOURS, FLOOR, MARKS

    axes.set(xscale="log", yscale="log")
    for i, name in enumerate([] if found is None else found["method"].values):
        row = found.sel({"method": name})
        look = {"color": COLOURS[i % len(COLOURS)], "marker": MARKS[i % len(MARKS)], "markersize": 2.5}
        axes.plot(row.rate_calls, np.maximum(row[key], FLOOR), linewidth=0.8, label=str(name), **look)


def conclude(path: str, cells: int = 1000, tolerances: Sequence[float] = TOLERANCES) -> tuple[Groups, list[str], Any]:
    """Statements, tables and the figure."""
    first = Path(path)
    coulomb = charted(first, cells, tolerances)
    drag = charted(first.with_name("work_precision_drag.toml"), cells, tolerances)
    steps = stepped(first.with_name("work_precision_steps.toml"))
    others = peers(first, tolerances)
    groups = {
        "Honesty": [*honesty("viscous and Coulomb", coulomb), *honesty("drag", drag)],
        "Cost, viscous and Coulomb": [*costs(coulomb), *beside(others)],
        "Cost, drag": costs(drag),
    }
    groups |= {} if steps is None else {"Fixed steps": orders(steps)}
    tables = [f"{found.attrs['title']}\n{precision_text(found, complete=True)}\n" for found in (coulomb, drag)]
    return groups, [NOTES, "", *tables], lambda: figure(coulomb, drag, steps, others)


def beside(others: dict[str, xr.Dataset]) -> list[Statement]:
    """A line for each of the others, as those of our methods."""
    lines = []
    for name, other in others.items():
        texts = []
        for wanted in (1e-3, 1e-7, 1e-11):
            enough = other.seconds.where(other.error_worst <= wanted)
            texts.append("-" if bool(enough.isnull().all()) else f"{1e6 * float(enough.min()):.3g}")
        lines.append(Statement(f"{name}: us a cell, worst right to 1e-3, 1e-7, 1e-11", "", ", ".join(texts)))
    missing = {"heyoka.py", "diffrax"} - set(others)
    return [*lines, *(Statement(name, "", "not installed") for name in sorted(missing))]


def main(arguments: Sequence[str]) -> int:
    """Table and figure of the study file that is named; 1 if a statement does not hold."""
    return report(__file__, ["work_precision.toml"], arguments, conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
