"""Pictures of results, fit for print; the only module that imports matplotlib.

Nothing here touches pyplot or its global state, and the same Dataset gives the same bytes.
"""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from sweep.errors import SweepError, missing
from sweep.file import disk
from sweep.file.overwriting import check_target
from sweep.laws.loglog import is_logarithmic, spans_decades
from sweep.show.view import View, coordinate, edges, label, setting, view
from sweep.words import require_dataset

try:
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
except ImportError:
    raise missing("pictures need matplotlib", "plot") from None

MILLIMETRE = 1 / 25.4
"""One millimetre in the inches of matplotlib."""

COLUMN, PAGE = 86.0, 178.0
"""Widths in mm of one and of two columns of a physics journal."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
"""Okabe and Ito's colours, told apart by colour-blind readers; their yellow is lost on white paper."""

DASHES = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
"""Line styles, so that a line is known in black and white too."""

STYLE = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 9,
    "axes.labelsize": 9,
    "axes.titlesize": 9,
    "axes.linewidth": 0.6,
    "axes.formatter.use_mathtext": True,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "lines.linewidth": 1.2,
    "lines.markersize": 4,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.minor.visible": True,
    "ytick.minor.visible": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "figure.dpi": 150,
    "savefig.dpi": 300,
    "svg.hashsalt": "foliot",
    "pdf.fonttype": 42,
    "hatch.linewidth": 0.4,
}

MARKS = "osD^vPX*"
"""Marks of points that no line joins."""

FLAGGED = ("#D55E00", "#000000", "#CC79A7", "#666666")
"""Colours of cells that are not OK."""

HATCHES = ("////", "\\\\\\\\", "....", "xxxx", "----")
"""Patterns of cells without a value, told apart without colour."""

KINDS = (".png", ".svg", ".pdf")
"""Suffixes of pictures."""

MOST_LAWS = 6
"""That are drawn beside each other."""


def plot(
    dataset: xr.Dataset,
    path: str | os.PathLike[str] | None = None,
    *,
    y: str | None = None,
    x: str | None = None,
    force: bool = False,
) -> Figure:
    """Picture of a result, of the chart that `work_precision` made, or of the laws that `compare_laws` tried.

    Of a result it shows one output: a line, a family of lines, or a map where there are two long axes. An axis is
    logarithmic where its grid is, or where the values span decades. Cells whose status is not OK are marked: on the
    line where they have a value, at the foot of the picture where they have none. Further axes are held at their
    middle value, which the title says.

    Parameters
    ----------
    dataset : Dataset
        From `run`, `open_result`, `work_precision` or `compare_laws`.
    path : path, optional
        Where to save it; .png, .svg or .pdf.
    y : str, optional
        Output of a result; by default the first, of a scene of one's own its `interval`.
    x : str, optional
        Axis of a result, or coordinate along the cells of a zip design. Default: what a trace runs along, else the
        longest.
    force : bool
        Overwrite a file that is there.

    Raises
    ------
    SweepError
        If there is no such output or axis, or the file is there already or cannot be written.

    Examples
    --------
    >>> import sweep
    >>> study = sweep.study(kernel="foliot", axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> figure = sweep.plot(sweep.run(study), "period.png")
    >>> chart = sweep.plot(sweep.work_precision(study, methods=["closed", "asymptotic"], tolerances=[1e-6]))
    """
    require_dataset("plot", dataset)
    if path is not None:
        check_target(Path(path), force=force)
    drawn = precision_figure if "reference" in dataset.attrs else laws_figure if "chosen" in dataset.attrs else None
    if drawn and (y or x):
        raise SweepError("y and x choose what is shown of a result; this Dataset has one picture, without them")
    figure = drawn(dataset) if drawn else result_figure(dataset, y, x)
    if path is not None:
        save(figure, path)
    return figure


def result_figure(dataset: xr.Dataset, y: str | None = None, x: str | None = None) -> Figure:
    """One output of a result: a line, a family of lines, or a map where there are two long axes."""
    shown = view(dataset, y, x)
    with style():
        figure = new_figure(120.0, 82.0)
        axes = figure.subplots()
        (_draw_passages if shown.passed else _draw_map if shown.mapped else _draw_lines)(axes, shown)
        if shown.passed or shown.mapped or not shown.joined:  # what is drawn lies everywhere
            handles, names = axes.get_legend_handles_labels()
            figure.legend(handles, names, loc="outside lower center", ncols=3) if names else None
        elif shown.across or shown.codes():
            axes.legend()
        title = "\n".join(part for part in (_plain(dataset.attrs.get("title", "")), shown.held) if part)
        axes.set_title(title, wrap=True)
    return figure


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
            axes.set_title(f"{key} of {attrs['cells']} cells")
        low, high = panels[0].get_xlim()
        wide = np.sqrt(max(LEAST_SPAN * low / high, 1.0))
        panels[0].set(ylabel=f"relative error against {attrs['reference']} [1]", xlim=(low / wide, high * wide))
        lines = {line.get_label(): line for line in panels[0].get_lines()}
        handles = {}
        for name in names:
            silent = bool((found.silent.sel({"method": name}) > 0).any())
            text = name + " (solves no cell)" * (name not in lines) + " (silently wrong)" * silent
            handles[text] = lines.get(name, Line2D([], [], linestyle=""))
        handles |= precision_marks(found)
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, fontsize=7)
        figure.suptitle(_plain(attrs["title"]), fontsize=9)
    return figure


def _plain(text: Any) -> str:
    """Text that is no formula: a lone dollar would begin one."""
    return str(text).replace("$", r"\$")


def precision_marks(found: xr.Dataset) -> dict[str, Any]:
    """What the marks of `draw_precision` that occur mean."""
    look: dict[str, Any] = {"linestyle": "", "marker": "o", "color": "0.3", "markersize": 4}
    marks: dict[str, Any] = {"all cells solved": Line2D([], [], **look)}
    if (found.unsolved + found.inaccurate > 0).any():
        marks["some unsolved or inaccurate"] = Line2D([], [], **{**look, "markerfacecolor": "white"})
    if (found.silent > 0).any():
        marks["some silently wrong"] = Line2D([], [], linestyle="", marker="x", color="black", markersize=7)
    accurate = found.attrs.get("reference_error", np.nan)
    if np.isfinite(accurate):
        marks[f"below the reference's own error, {accurate:.1g}"] = Patch(color="0.9", linewidth=0)
    return marks


LEAST_SPAN = 30.0
"""Of the times in a chart, so that methods alike look alike."""
FLOOR, CEILING = 1e-16, 3.0
"""Where errors of 0, and errors beyond all sense, are drawn at the least and at the most."""


def draw_precision(axes: Any, found: xr.Dataset, key: str) -> None:
    """A line for each method, with the look that `method_look` gives it.

    Filled marks where all cells are solved, open ones where some are unsolved or said to be inaccurate, crosses where
    some are silently wrong; `precision_marks` says so in a legend. Errors below that of the reference mean nothing, and
    are drawn a little below it. A method that solves no cell is left out.
    """
    accurate = found.attrs.get("reference_error", np.nan)
    floor = max(FLOOR, accurate / 3) if np.isfinite(accurate) else FLOOR
    for i, name in enumerate(map(str, found["method"].values)):
        row, look = found.sel({"method": name}), {**method_look(name, i), "markersize": 4}
        if not np.isfinite(row.error_median).any():
            continue
        seconds, error = row.seconds.values, np.clip(row[key].values, floor, CEILING)
        whole, silent = (row.unsolved + row.inaccurate).values == 0, row.silent.values > 0
        axes.plot(seconds, error, linewidth=0.8, markevery=whole, label=name, **look)
        axes.plot(seconds[~whole], error[~whole], **{**look, "linestyle": "", "markerfacecolor": "white"})
        axes.plot(seconds[silent], error[silent], "x", color="black", markersize=7)
    if np.isfinite(accurate):
        axes.axhspan(floor / 3, max(accurate, floor), color="0.9", linewidth=0)
    axes.set(xscale="log", yscale="log", xlabel="time per cell on one core [s]", ylim=(floor / 3, 10))


FAMILIES = {
    COLOURS[6]: ("auto",),
    COLOURS[2]: ("closed", "coulomb", "pure", "asymptotic", "stable"),
    COLOURS[4]: ("quadrature", "segments", "events", "map", "waveform"),
    COLOURS[0]: ("taylor",),
    COLOURS[1]: ("dopri5",),
    COLOURS[3]: ("dop853",),
    COLOURS[5]: ("rodas5p", "sdirk4"),
    "0.6": ("euler",),
    "#8C510A": ("semi_implicit",),
    "#35978F": ("verlet",),
    "#4D4DBF": ("rk4",),
    "#A6761D": ("moreau",),
    "0.35": ("heyoka.py", "diffrax", "scipy"),
}
"""Colours of methods, the same in every picture: formulas, integrals, Taylor series, the integrators by themselves,
textbook steppers and other libraries; within a colour they differ by their marks."""


def method_look(name: str, place: int = 0) -> dict[str, Any]:
    """Colour, marker and line style of a method; of one of a user's own by its place among others."""
    for colour, members in FAMILIES.items():
        if name.split()[0] in members:
            i = members.index(name.split()[0])
            marker = MARKS[(i + list(FAMILIES).index(colour)) % len(MARKS)]
            return {"color": colour, "marker": marker, "linestyle": "--" if members[-1] == "scipy" else "-"}
    return {
        "color": COLOURS[place % len(COLOURS)],
        "marker": MARKS[place % len(MARKS)],
        "linestyle": DASHES[place % len(DASHES)],
    }


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
            one, look = found.sel(law=law), {"color": COLOURS[i % len(COLOURS)], "linestyle": DASHES[i % len(DASHES)]}
            curve, size, worse = one.fitted.values, 2 * one.scatter.item(), one.worse.item()
            name = f"{law}, AICc {'best' if worse == 0 else f'+{worse:.3g}'}{', chosen' if law == chosen else ''}"
            above.plot(x, curve, label=name, linewidth=1.4 if law == chosen else 0.8, **look)
            below.plot(x, y / curve - 1, linewidth=0.8, marker=".", markersize=2, **look)
            if law == chosen:
                band = {"color": look["color"], "linewidth": 0}
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


@contextlib.contextmanager
def style() -> Iterator[None]:
    """The look of all pictures, whatever the reader's own matplotlib settings are."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def new_figure(width: float, height: float) -> Figure:
    """Empty figure of so many millimetres; draw in it inside `style()`."""
    figure = Figure(figsize=(width * MILLIMETRE, height * MILLIMETRE), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Save as .png, .svg or .pdf; a file that is there is replaced once all is written.

    Raises
    ------
    SweepError
        If the suffix is another, or the file cannot be written.
    """
    target = Path(path)
    kind = target.suffix.lower()
    if kind not in KINDS:
        found = f'"{target.suffix}"' if target.suffix else "no suffix"
        raise SweepError(f"{target}: found {found}; a picture is one of {', '.join(KINDS)}")
    if target.is_dir():
        raise SweepError(f"{target} is a folder; name a file in it")
    with disk.replacing(target) as part, style():
        # without a date: the same picture has the same bytes
        metadata = {".png": {"Software": "foliot"}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
        figure.savefig(part, format=kind[1:], metadata=metadata[kind])
    return target


def letter(axes: Any, text: str) -> None:
    """Letter of a panel, in its upper left corner outside the frame."""
    axes.set_title(f"({text})", loc="left")


def _draw_lines(axes: Any, shown: View) -> None:
    """A line for each value across; cells of one status: on the line where they have a value, else at its foot."""
    axes.set(xlabel=label(coordinate(shown.y, shown.x), 80), ylabel=label(shown.y))
    axes.set_xscale("log" if is_logarithmic(shown.values(shown.x)) else "linear")
    axes.set_yscale("log" if spans_decades(shown.y) else "linear")
    x, lines = shown.values(shown.x), np.atleast_2d(shown.y.values)
    for i, y in enumerate(lines):
        name = setting(coordinate(shown.y, shown.across)[i]) if shown.across else None
        points = {"linestyle": "", "marker": MARKS[i % len(MARKS)], "markersize": 2.5}
        look = {"linestyle": DASHES[i % len(DASHES)]} if shown.joined else points
        axes.plot(x, y, color=COLOURS[i % len(COLOURS)], label=name, **look)
    drawn = (lambda y: y > 0) if axes.get_yscale() == "log" else np.isfinite
    for code, mark, colour in zip(shown.codes(), itertools.cycle(MARKS), itertools.cycle(FLAGGED), strict=False):
        look = {"linestyle": "", "marker": mark, "color": colour, "markerfacecolor": "none", "clip_on": False}
        for y, here in zip(lines, np.atleast_2d(shown.status) == code, strict=True):
            valued, empty = here & drawn(y), here & ~drawn(y)
            axes.plot(x[valued], y[valued], **look)
            axes.plot(x[empty], np.zeros(empty.sum()), transform=axes.get_xaxis_transform(), **look)
        axes.plot([], [], mark, color=colour, markerfacecolor="none", label=shown.meanings.get(code, str(code)))


def _draw_passages(axes: Any, shown: View) -> None:
    """A point for each passage at each value of a parameter: a diagram of bifurcations."""
    axes.set(xlabel=label(coordinate(shown.y, shown.x), 80), ylabel=label(shown.y))
    axes.set_xscale("log" if is_logarithmic(shown.values(shown.x)) else "linear")
    x = np.broadcast_to(shown.values(shown.x), shown.y.shape)
    names = dict.fromkeys(shown.codes(), "") | shown.meanings | {0: "OK"}
    for code, colour in zip([0, *shown.codes()], itertools.chain(["black"], itertools.cycle(FLAGGED)), strict=False):
        here = (shown.status == code) & np.isfinite(shown.y.values)
        axes.plot(x[here], shown.y.values[here], ".", markersize=1.5, markeredgewidth=0.0, color=colour)
        if here.any() and shown.codes():
            axes.plot([], [], ".", color=colour, label=names[code])


def _draw_map(axes: Any, shown: View) -> None:
    """A colour for each cell; those of one status hatched where they have no value, outlined where they have one."""
    grids = shown.values(shown.x), shown.values(str(shown.across))
    axes.set(xlabel=label(coordinate(shown.y, shown.x), 80), ylabel=label(coordinate(shown.y, str(shown.across))))
    axes.set(**{f"{k}scale": "log" if is_logarithmic(grid) else "linear" for k, grid in zip("xy", grids, strict=True)})
    x, y = (edges(grid.astype(np.float64)) for grid in grids)
    norm = LogNorm() if spans_decades(shown.y) else Normalize()
    mesh = axes.pcolormesh(x, y, np.ma.masked_invalid(shown.y.values), norm=norm, cmap="viridis", rasterized=True)
    axes.figure.colorbar(mesh, ax=axes, label=label(shown.y))
    for code, hatch, colour in zip(shown.codes(), itertools.cycle(HATCHES), itertools.cycle(FLAGGED), strict=False):
        here, name = shown.status == code, shown.meanings.get(code, str(code))
        empty = here & ~np.isfinite(shown.y.values)
        if (here & ~empty).any():
            around = (np.concatenate([ends[:1], grid, ends[-1:]]) for grid, ends in zip(grids, (x, y), strict=True))
            axes.contour(*around, np.pad(here, 1), levels=[0.5], colors=[colour])
        if empty.any():
            # a rectangle for each run of cells side by side
            runs = [
                [(x[left], y[row]), (x[right], y[row]), (x[right], y[row + 1]), (x[left], y[row + 1])]
                for row, cells in enumerate(empty)
                for left, right in np.flatnonzero(np.diff(np.pad(cells.astype(int), 1))).reshape(-1, 2)
            ]
            look: dict[str, Any] = {"facecolor": "0.94", "edgecolor": "0.45", "linewidth": 0.0, "hatch": hatch}
            axes.add_collection(PolyCollection(runs, label=name, **look))
        else:
            axes.plot([], [], color=colour, label=name)
