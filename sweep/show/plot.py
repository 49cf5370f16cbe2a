"""One picture of whatever is given: a result, a chart of error against time, or laws beside each other."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.errors import SweepError
from sweep.file.overwriting import check_target
from sweep.show.charts import COLOURS, DASHES, new_figure, precision_figure, result_figure, save, style
from sweep.show.view import label
from sweep.words import require_dataset

if TYPE_CHECKING:
    import xarray as xr

MOST_LAWS = 6


def plot(
    dataset: xr.Dataset,
    path: str | os.PathLike[str] | None = None,
    *,
    y: str | None = None,
    x: str | None = None,
    force: bool = False,
) -> Any:
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


def laws_figure(found: xr.Dataset) -> Any:
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
