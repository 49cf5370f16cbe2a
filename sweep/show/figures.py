"""Figures: one output of a result as lines, points or a map; work-precision charts; comparisons of laws."""

from __future__ import annotations

import os
from itertools import cycle
from typing import Any

import numpy as np
import xarray as xr

from sweep.errors import SweepError
from sweep.file.disk import check_target
from sweep.laws.loglog import is_logarithmic, spans_decades
from sweep.show.charts import (
    MARKS,
    PAGE,
    Figure,
    Line2D,
    LogNorm,
    Normalize,
    Patch,
    PolyCollection,
    draw_precision,
    line_look,
    new_figure,
    save,
    style,
)
from sweep.show.view import View, edges, label, setting
from sweep.words import as_path, counted, require_dataset

HATCHES = ("////", "\\\\\\\\", "....", "xxxx", "----")
"""Patterns of cells without a value, which differ without colour."""
MOST_LAWS = 6
"""Number of laws that are drawn."""
LEAST_SPAN = 30.0
"""Least ratio of the longest to the shortest time on a chart, so that similar methods look similar."""


def plot(
    dataset: xr.Dataset,
    path: str | os.PathLike[str] | None = None,
    *,
    y: str | None = None,
    x: str | None = None,
    force: bool = False,
) -> Figure:
    """Plot a result, a work-precision chart from `work_precision`, or the laws from `compare_laws`.

    For a result it shows one output: a line, a family of lines, or a map where there are two long axes. An axis is
    logarithmic if its grid is, or if the values span decades. Cells whose status is not OK are marked: on the line
    where they have a value, at the bottom of the figure where they have none. Further axes are held at their middle
    value, which the title states. Without `path`, save the figure by its `savefig`; pyplot does not know it.

    Parameters
    ----------
    dataset : Dataset
        From `run`, `open_result`, `work_precision` or `compare_laws`.
    path : path, optional
        File to save it in; .png, .svg or .pdf.
    y : str, optional
        Output of a result; default: the first, for a scene of your own its `interval`.
    x : str, optional
        Axis of a result, or coordinate along the cells of a zip design. Default: the coordinate of a trace, else the
        longest axis.
    force : bool
        Overwrite an existing file.

    Raises
    ------
    SweepError
        If there is no such output or axis, or the file exists already or cannot be written.

    Examples
    --------
    >>> import sweep
    >>> study = sweep.study(kernel="foliot", axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> figure = sweep.plot(sweep.run(study), "period.png")
    >>> chart = sweep.plot(sweep.work_precision(study, methods=["closed", "asymptotic"], tolerances=[1e-6]))
    """
    require_dataset("plot", dataset)
    if path is not None:
        check_target(as_path(path), force=force)
    drawn = precision_figure if "reference" in dataset.attrs else laws_figure if "chosen" in dataset.attrs else None
    if drawn and (y or x):
        raise SweepError("y and x select what is shown of a result; this Dataset has only one figure, without them")
    figure = drawn(dataset) if drawn else view_figure(View(dataset, y, x), dataset.attrs.get("title", ""))
    if path is not None:
        save(figure, path)
    return figure


def view_figure(shown: View, title: Any = "") -> Figure:
    """One output of a result: a line, a family of lines, or a map where there are two long axes."""
    with style():
        figure = new_figure(120.0, 82.0)
        axes = figure.subplots()
        axes.set(xlabel=label(shown.axis(shown.x), 80), ylabel=label(shown.y))
        values = shown.values(shown.x)
        axes.set_xscale("log" if (logarithmic := is_logarithmic(values)) else "linear")
        if not logarithmic and (values == np.round(values)).all():  # there is no mode 1.25
            axes.locator_params("x", integer=True)
        (_draw_passages if shown.passed else _draw_map if shown.mapped else _draw_lines)(axes, shown)
        if shown.passed or shown.mapped or not shown.joined:  # what is drawn lies everywhere
            handles, names = axes.get_legend_handles_labels()
            figure.legend(handles, names, loc="outside lower center", ncols=3) if names else None
        elif shown.across or shown.codes():
            axes.legend()
        axes.set_title("\n".join(part for part in (_plain(title), shown.held) if part), wrap=True)
    return figure


def _plain(text: Any) -> str:
    """Text that is no formula: a lone dollar would begin one."""
    return str(text).replace("$", r"\$")


def _draw_lines(axes: Any, shown: View) -> None:
    """A line for each value across; cells of one status: on the line where they have a value, else at its foot."""
    axes.set_yscale("log" if spans_decades(shown.y) else "linear")
    x, lines, status = shown.values(shown.x), np.atleast_2d(shown.y.values), np.atleast_2d(shown.status)
    for i, y in enumerate(lines):
        look = line_look(i)
        gap = np.pad(~np.isfinite(y), 1, constant_values=True)
        lone = np.flatnonzero(~gap[1:-1] & gap[:-2] & gap[2:])  # no line would show them
        if not shown.joined:
            look |= {"linestyle": "", "marker": MARKS[i % len(MARKS)], "markersize": 2.5}
        elif lone.size:
            look |= {"marker": ".", "markevery": lone.tolist()}
        axes.plot(x, y, label=setting(shown.axis(shown.across)[i]) if shown.across else None, **look)
    for code, mark in zip(shown.codes(), cycle(MARKS), strict=False):
        colour = shown.colour(code)
        look = {"linestyle": "", "marker": mark, "color": colour, "markerfacecolor": "none", "clip_on": False}
        for y, here in zip(lines, status == code, strict=True):
            valued, empty = here & np.isfinite(y), here & ~np.isfinite(y)
            axes.plot(x[valued], y[valued], **look)
            axes.plot(x[empty], np.zeros(empty.sum()), transform=axes.get_xaxis_transform(), **look)
        axes.plot([], [], mark, color=colour, markerfacecolor="none", label=shown.name(code))


def _draw_passages(axes: Any, shown: View) -> None:
    """A point for each passage at each value of a parameter: a diagram of bifurcations."""
    x, y = np.broadcast_to(shown.values(shown.x), shown.y.shape), shown.y.values
    for code in (0, *shown.codes()):
        here, colour = (shown.status == code) & np.isfinite(y), shown.colour(code) if code else "black"
        axes.plot(x[here], y[here], ".", markersize=1.5, markeredgewidth=0.0, color=colour)
        if here.any() and shown.codes():
            axes.plot([], [], ".", color=colour, label=shown.name(code))


def _draw_map(axes: Any, shown: View) -> None:
    """A colour for each cell; those of one status hatched where they have no value, outlined where they have one."""
    across = str(shown.across)
    grids = shown.values(shown.x), shown.values(across)
    axes.set_ylabel(label(shown.axis(across)))
    axes.set_yscale("log" if is_logarithmic(grids[1]) else "linear")
    x, y = (edges(grid.astype(np.float64)) for grid in grids)
    norm = LogNorm() if spans_decades(shown.y) else Normalize()
    mesh = axes.pcolormesh(x, y, np.ma.masked_invalid(shown.y.values), norm=norm, cmap="viridis", rasterized=True)
    axes.figure.colorbar(mesh, ax=axes, label=label(shown.y))
    for code, hatch in zip(shown.codes(), cycle(HATCHES), strict=False):
        here, name, colour = shown.status == code, shown.name(code), shown.colour(code)
        empty = here & ~np.isfinite(shown.y.values)
        valued = here & ~empty
        if valued.any():
            around = (np.concatenate([ends[:1], grid, ends[-1:]]) for grid, ends in zip(grids, (x, y), strict=True))
            axes.contour(*around, np.pad(valued, 1), levels=[0.5], colors=[colour])
            axes.plot([], [], color=colour, label=name)
        if empty.any():
            # a rectangle for each run of cells side by side
            runs = [
                [(x[left], y[row]), (x[right], y[row]), (x[right], y[row + 1]), (x[left], y[row + 1])]
                for row, cells in enumerate(empty)
                for left, right in np.flatnonzero(np.diff(np.pad(cells.astype(int), 1))).reshape(-1, 2)
            ]
            look: dict[str, Any] = {"facecolor": "0.94", "edgecolor": "0.45", "linewidth": 0.0, "hatch": hatch}
            axes.add_collection(PolyCollection(runs, label=name + ", no value" * bool(valued.any()), **look))


def precision_figure(found: xr.Dataset) -> Figure:
    """Error against time per cell, median and worst cell, a line for each method through its tolerances.

    The legend names every method, also one that solves no cell and one that is silently wrong in some.
    """
    attrs, names = found.attrs, [str(name) for name in found["method"].values]
    with style():
        figure = new_figure(PAGE, 92.0 + 4.0 * -(-(len(names) + 4) // 4))
        panels = figure.subplots(1, 2, sharex=True, sharey=True)
        for axes, key in zip(panels, ("median", "worst"), strict=True):
            draw_precision(axes, found, f"error_{key}")
            axes.set_title(f"{key} of {counted(attrs['cells'], 'cell')}")
        low, high = panels[0].get_xlim()
        wide = np.sqrt(max(LEAST_SPAN * low / high, 1.0))
        panels[0].set(ylabel=f"relative error against {attrs['reference']} [1]", xlim=(low / wide, high * wide))
        lines = {line.get_label(): line for line in panels[0].get_lines()}
        handles: dict[str, Any] = {}
        for name in names:
            silent = bool((found.silent.sel({"method": name}) > 0).any())
            text = name + " (solves no cell)" * (name not in lines) + " (silently wrong)" * silent
            handles[text] = lines.get(name, Line2D([], [], linestyle=""))
        look: dict[str, Any] = {"linestyle": "", "marker": "o", "color": "0.3", "markersize": 4}
        handles["all cells solved"] = Line2D([], [], **look)
        if (found.unsolved + found.inaccurate > 0).any():
            handles["some unsolved or inaccurate"] = Line2D([], [], **{**look, "markerfacecolor": "white"})
        if (found.silent > 0).any():
            handles["some silently wrong"] = Line2D([], [], linestyle="", marker="x", color="black", markersize=7)
        if np.isfinite(accurate := attrs.get("reference_error", np.nan)):
            handles[f"below the reference's own error, {accurate:.1g}"] = Patch(color="0.9", linewidth=0)
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, fontsize=7)
        figure.suptitle(_plain(attrs["title"]), fontsize=9)
    return figure


def laws_figure(found: xr.Dataset) -> Figure:
    """The best six laws that `compare_laws` found: curves through the points above, what they leave below."""
    chosen = str(found.attrs["chosen"])
    shown = list(dict.fromkeys([chosen, *map(str, found.law.values)]))[:MOST_LAWS]
    x, y = found.x.values, found.y.values
    with style():
        figure = new_figure(140.0, 130.0)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        above.plot(x, y, "o", color="black", markersize=2.5, label="points")
        for i, law in enumerate(shown):
            one, look = found.sel(law=law), line_look(i)
            curve, size, worse = one.fitted.values, 2 * one.scatter.item(), one.worse.item()
            name = f"{law}, AICc {'best' if worse == 0 else f'+{worse:.3g}'}{', chosen' if law == chosen else ''}"
            above.plot(x, curve, label=name, linewidth=1.4 if law == chosen else 0.8, **look)
            below.plot(x, y / curve - 1, linewidth=0.8, marker=".", markersize=2, **look)
            if law == chosen:
                band = {"color": look["color"], "linewidth": 0, "label": f"twice the scatter about {law}"}
                above.fill_between(x, curve * np.exp(-size), curve * np.exp(size), alpha=0.2, **band)
                below.axhspan(-np.expm1(size), np.expm1(size), alpha=0.15, **band)
        above.set(xscale="log", yscale="log", ylabel=label(found.y.rename(found.attrs["y"])))
        below.set(xlabel=label(found.x.rename(found.attrs["x"])), ylabel="point / law - 1")
        worst = 4 * max(float(found.residual.sel(law=chosen)), 1e-15)
        below.set_ylim(-worst, worst)
        below.axhline(0.0, color="0.6", linewidth=0.5)
        figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=2)
        above.set_title(found.attrs["verdict"], wrap=True, fontsize=8)
    return figure
