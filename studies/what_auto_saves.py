"""What does choosing a method for each cell save over always using the best single one?

    python studies/what_auto_saves.py studies/what_auto_saves.toml

measures `auto` and every method on the same cells, at rtol from 1e-3 to 1e-13, in one run on one core, and draws
what_auto_saves.png. The best single method at an rtol is the fastest of those that give the most cells; errors are
against the best reference among the methods. Times are noisy and only told; what is right is checked.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, report

import sweep
from sweep.explore.work_precision import TOLERANCES, precision_text, work_precision

PARTS = ("", "_viscous", "_drag", "_terms", "_balance", "_impact", "_polisher")
"""Ends of the names of the study files."""
AS_MANY = 1e-12
"""Shares of cells that differ by less are the same."""
ROOM = 50.0
"""For the legends, above what is drawn."""

NOTES = """\
saved: time of the best single method over that of auto, on the same cells; "gives" is the share of cells that come out
and are not said to be inaccurate. Below 1 auto is the slower one: it asks the bounds of every cell, and pays for cells
that the single method leaves unsolved. Where auto takes the reference itself its error is 0 by that alone: what auto
calls right is judged against 50 digits by benchmarks/honesty/auto_honesty.py"""


def given(found: xr.Dataset) -> Any:
    """Share of cells that a method gives and vouches for."""
    return found.ok + found.remarked - found.silent


def best_single(found: xr.Dataset, rtol: float) -> str:
    """The fastest of the methods that give the most cells."""
    row = found.sel({"rtol": rtol}).drop_sel({"method": "auto"})
    most = given(row) >= float(given(row).max()) - AS_MANY
    return str(row["method"].values[int(np.where(most, row.seconds, np.inf).argmin())])


def savings(found: xr.Dataset) -> xr.Dataset:
    """For each rtol the best single method, what both give, and the ratio of their times."""
    rows = []
    for rtol in found.rtol.values:
        name = best_single(found, rtol)
        auto, single = (found.sel({"method": m, "rtol": rtol}) for m in ("auto", name))
        shares = float(given(auto)), float(given(single))
        ratio = float(single.seconds / auto.seconds)
        rows.append((name, *shares, ratio, float(auto.seconds), str(auto.methods_used.item())))
    keys = ("single", "auto_gives", "single_gives", "saved", "seconds", "used")
    columns = zip(*rows, strict=True)
    return xr.Dataset({k: ("rtol", list(v)) for k, v in zip(keys, columns, strict=True)}, {"rtol": found.rtol})


def statements(found: xr.Dataset) -> list[Statement]:
    """What is checked of one kernel, and what is told of its times."""
    made = savings(found)
    auto = found.sel({"method": "auto"})
    silent, cells = float(auto.silent.max()), found.attrs["cells"]
    over = float((auto.error_worst / (auto.rtol + found.attrs["reference_error"])).max())
    lines = [
        Statement("auto is silently wrong", "nowhere", f"{100 * silent:g} % of {cells} cells", None, silent == 0),
        Statement("auto, worst error over rtol", "<= 1", f"{over:.2g}", None, over <= 1),
        Statement(
            "auto gives the cells that the best single method does", "all, or more",
            f"{100 * float(made.auto_gives.min()):.4g} % beside {100 * float(made.single_gives.min()):.4g} %", None,
            bool((made.auto_gives >= made.single_gives - AS_MANY).all()),
        ),
    ]  # fmt: skip
    for rtol in made.rtol.values:
        row = made.sel({"rtol": rtol})
        text = f"{float(row.saved):.2f} of {row.single.item()}, which gives {100 * float(row.single_gives):.4g} %"
        lines.append(Statement(f"saved at {rtol:.0e}", "", f"{text}; auto by {row.used.item()}"))
    return lines


def figure(parts: Sequence[xr.Dataset]) -> Any:
    """Time of every method over that of auto, a panel for each kernel; the best single method is ringed."""
    from sweep.show import charts

    with charts.style():
        page = charts.new_figure(charts.PAGE, 210.0)
        *panels, rest = page.subplots(4, 2, sharex=True, sharey=True).ravel()
        for axes, found, text in zip(panels, parts, "abcdefg", strict=False):
            draw(axes, found)
            charts.letter(axes, text)
            axes.set_title(found.attrs["title"])
        for axes in panels[-2:]:
            axes.set_xlabel("relative tolerance, rtol [1]")
            axes.tick_params(labelbottom=True)
        rest.axis("off")
        rest.legend(handles=keys(), loc="center")
        for axes in panels[::2]:
            axes.set_ylabel("time over that of auto [1]")
        panels[0].set_ylim(top=ROOM * panels[0].get_ylim()[1])
    return page


def keys() -> list[Any]:
    """What the marks mean, whatever their colour."""
    from matplotlib.lines import Line2D

    mark = {"color": "0.3", "marker": "o", "linestyle": ""}
    return [
        Line2D([], [], color="black", linewidth=0.8, label="auto"),
        Line2D([], [], **mark, markersize=3.5, label="gives every cell that auto gives"),
        Line2D([], [], **mark, markersize=3.5, markerfacecolor="white", label="gives fewer"),
        Line2D([], [], **mark | {"color": "black"}, markersize=8, markerfacecolor="none", label="best single method"),
    ]


def draw(axes: Any, found: xr.Dataset) -> None:
    """Filled marks where a method gives every cell that auto gives, open ones where it gives fewer."""
    from sweep.show.charts import COLOURS, MARKS

    auto = found.sel({"method": "auto"})
    axes.axhline(1.0, color="black", linewidth=0.8)
    for i, name in enumerate([m for m in found["method"].values if m != "auto"]):
        row = found.sel({"method": name})
        ratio, whole = (row.seconds / auto.seconds).values, (given(row) >= given(auto) - AS_MANY).values
        look = {"color": COLOURS[i % len(COLOURS)], "marker": MARKS[i % len(MARKS)], "markersize": 3.5}
        axes.plot(found.rtol, ratio, linewidth=0.8, markerfacecolor="white", label=str(name), **look)
        axes.plot(found.rtol.values[whole], ratio[whole], linestyle="", **look)
    best = [best_single(found, rtol) for rtol in found.rtol.values]
    rings = [
        float(found.seconds.sel({"method": m, "rtol": r}) / auto.seconds.sel({"rtol": r}))
        for m, r in zip(best, found.rtol.values, strict=True)
    ]
    axes.plot(found.rtol, rings, "o", color="black", markerfacecolor="none", markersize=8, markeredgewidth=0.7)
    axes.set(xscale="log", yscale="log")
    axes.invert_xaxis()
    axes.legend(fontsize=6.5, loc="upper center", ncols=3, labelspacing=0.2, handlelength=1.4, columnspacing=0.8)


def charted(path: Path, cells: int, tolerances: Sequence[float]) -> list[xr.Dataset]:
    """Every method on the cells of each study file that stands beside the first."""
    files = [path.with_name(f"{path.stem}{part}.toml") for part in PARTS]
    return [work_precision(sweep.study(file), cells=cells, tolerances=tolerances) for file in files]


def conclude(path: str, cells: int = 4096, tolerances: Sequence[float] = TOLERANCES) -> tuple[Groups, list[str], Any]:
    """Statements, tables and the figure."""
    parts = charted(Path(path), cells, tolerances)
    groups = {found.attrs["title"]: statements(found) for found in parts}
    tables = [f"{found.attrs['title']}\n{precision_text(found, complete=True)}\n" for found in parts]
    return groups, [NOTES, "", *tables], lambda: figure(parts)


def main(arguments: Sequence[str]) -> int:
    """Table and figure of the study file that is named; 1 if a statement does not hold."""
    return report(__file__, ["what_auto_saves.toml"], arguments, conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
