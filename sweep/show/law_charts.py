"""Picture of laws beside each other: curves with bands above, what they leave below, every law named."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.show.charts import COLOURS, DASHES, new_figure, style

if TYPE_CHECKING:
    import xarray as xr

MOST_LAWS = 6


def laws_figure(found: xr.Dataset) -> Any:
    """What `compare_laws` found: the best six laws."""
    order = [str(law) for law in found.law.values]
    shown = list(dict.fromkeys([found.attrs["chosen"], *order]))[:MOST_LAWS]
    with style():
        figure = new_figure(140.0, 130.0)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        x, y = found.x.values, found.y.values
        above.plot(x, y, "o", color="black", markersize=2.5, label="points")
        for i, law in enumerate(shown):
            _draw(above, below, found.sel(law=law), x, y, i, law == found.attrs["chosen"])
        above.set(xscale="log", yscale="log", ylabel=_label(found.attrs["y"], found.y))
        below.set(xlabel=_label(found.attrs["x"], found.x), ylabel="point / law - 1")
        worst = float(found.residual.sel(law=found.attrs["chosen"]))
        below.set_ylim(-4 * max(worst, 1e-15), 4 * max(worst, 1e-15))
        below.axhline(0.0, color="0.6", linewidth=0.5)
        figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=2)
        above.set_title(found.attrs["verdict"], wrap=True, fontsize=8)
    return figure


def _draw(above: Any, below: Any, one: xr.Dataset, x: Any, y: Any, i: int, chosen: bool) -> None:
    look = {"color": COLOURS[i % len(COLOURS)], "linestyle": DASHES[i % len(DASHES)]}
    worse = one.worse.item()
    name = f"{one.law.item()}, AICc {'best' if worse == 0 else f'+{worse:.3g}'}{', chosen' if chosen else ''}"
    curve, size = one.fitted.values, 2 * one.scatter.item()
    above.plot(x, curve, label=name, linewidth=1.4 if chosen else 0.8, **look)
    if chosen:
        above.fill_between(x, curve * np.exp(-size), curve * np.exp(size), color=look["color"], alpha=0.2, linewidth=0)
        below.axhspan(-np.expm1(size), np.expm1(size), color=look["color"], alpha=0.15, linewidth=0)
    below.plot(x, y / curve - 1, linewidth=0.8, marker=".", markersize=2, **look)


def _label(name: str, values: xr.DataArray) -> str:
    units = values.attrs.get("units", "1")
    return name if units in ("", "1") else f"{name} [{units}]"
