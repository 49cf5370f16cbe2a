"""What the figures of the studies share: the page, maps and their bars, labels, ticks."""

import sys
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import numpy as np
import xarray as xr

import sweep

try:
    from sweep.show import charts  # first: it says what to install where matplotlib is missing
    from sweep.show.charts import COLOURS as COLOURS
    from sweep.show.charts import DASHES as DASHES
    from sweep.show.charts import MARKS as MARKS
    from sweep.show.charts import LogNorm as LogNorm
    from sweep.show.charts import Patch as Patch
    from sweep.show.charts import draw_precision as draw_precision
    from sweep.show.charts import method_look as method_look
except sweep.SweepError as error:
    sys.exit(str(error))
from matplotlib.colors import ListedColormap as ListedColormap

NARROW = 110.0
"""Width in mm of panels one above the other, which can be read at the width of a phone too."""
HOLLOW = {"linestyle": "", "markerfacecolor": "white", "markersize": 3.6}
"""Marks of what is computed, beside lines of theory."""


def panels(height: float, *shape: int, width: float = NARROW, **how: Any) -> Callable[..., Callable[..., Any]]:
    """Makes a figure for print, of so many mm, of a function that draws into its panels.

    The function takes the panels of `subplots`, lettered in the end if there are several, and what is drawn.
    """

    def decorated(draw: Callable[..., None]) -> Callable[..., Any]:
        @wraps(draw)
        def figure(*made: Any) -> Any:
            with charts.style():
                page = charts.new_figure(width, height)
                axes = np.ravel(page.subplots(*shape, **how))
                draw(*axes, *made)
                for one, text in zip(axes, "abcdefghi", strict=False) if axes.size > 1 else ():
                    charts.letter(one, text)
            return page

        return figure

    return decorated


def colour_map(axes: Any, x: Any, y: Any, values: Any, label: str, bar: Any = None, **how: Any) -> Any:
    """A map of values, of shape (y, x), to the edges of its grid; gives its bar, whose options are `bar`."""
    how = {"cmap": "cividis", "shading": "nearest", "rasterized": True, **how}
    mesh = axes.pcolormesh(x, y, values, **how)
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    return axes.figure.colorbar(mesh, ax=axes, label=label, pad=0.02, **(bar or {}))


def exponent_map(axes: Any, ds: xr.Dataset, out: Any, text: str) -> None:
    """A verge's exponent `s` over alpha and kappa; cells that are `out`, of shape (kappa, alpha), hatched and named."""
    alpha, kappa = ds.alpha.values, ds.kappa.values
    axes.set(xscale="log", yscale="log", xlabel=r"drive, $\alpha$ [1]", ylabel=r"wheel over foliot, $\kappa$ [1]")
    ticks = {"ticks": [1 / 3, 0.5, 0.75, 1]}
    bar = colour_map(axes, alpha, kappa, ds.s.values, "exponent, $s$ [1]", ticks, vmin=1 / 3, vmax=1)
    bar.ax.set_yticklabels(["1/3", "1/2", "3/4", "1"])
    hatch(axes, alpha, kappa, out, "////", "0.65")
    axes.set(xlim=(alpha[1], alpha[-2]))
    direct_label(axes, 2e4, 3e-3, text)


def hatch(axes: Any, x: Any, y: Any, where: Any, pattern: str, colour: str = "0.45") -> None:
    """Hatches the cells of a map for which `where`, of shape (y, x), is true, and draws their edge."""
    shown = where.astype(float)
    with charts.matplotlib.rc_context({"hatch.color": colour, "hatch.linewidth": 0.4}):
        axes.contourf(x, y, shown, levels=[0.5, 1.5], colors="none", hatches=[pattern])
    axes.contour(x, y, shown, levels=[0.5], colors=[colour], linewidths=0.8)


def direct_label(axes: Any, x: float, y: float, text: str, colour: str = "black", **how: Any) -> None:
    """Text in the colour of the line it names, readable where it crosses others."""
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8}
    axes.text(x, y, text, color=colour, bbox=box, **{"fontsize": 8, "ha": "center", "va": "center", **how})


def draw_costs(axes: Any, found: dict[str, xr.Dataset], places: dict[str, tuple[float, float]]) -> None:
    """`worst` error over `seconds` a cell of each method, in its colour, with its name beside it.

    Parameters
    ----------
    places : by name, factors from the line's first point to where the name stands; those without are not drawn.
    """
    for name, row in found.items():
        look, drawn = charts.method_look(name), row.worst.where(row.worst < 1.0).dropna("rtol")
        if name in places and drawn.size:
            axes.plot(row.seconds.sel(rtol=drawn.rtol), drawn.clip(1e-16), markersize=4, linewidth=0.9, **look)
            right, up = places[name]
            x, y = float(row.seconds.sel(rtol=drawn.rtol[0])), float(drawn[0])
            direct_label(axes, right * x, up * y, name, look["color"], fontsize=7)
    axes.set(xscale="log", yscale="log", xlabel="CPU time per cell [s]", ylabel="relative error, worst cell [1]")


def quality_bar(page: Any, mesh: Any, axes: Any, label: str, **how: Any) -> Any:
    """The bar of a map in "cividis_r" of what is better the less it is: the good end is bright, and on top."""
    bar = page.colorbar(mesh, ax=axes, label=label, **how)
    bar.ax.invert_yaxis()
    return bar


def plain_ticks(axis: Any, values: Sequence[float]) -> None:
    """Ticks of a logarithmic axis at these values, written out, and no others."""
    axis.set_ticks(list(values), labels=[f"{x:g}" for x in values])
    axis.set_ticks([], minor=True)
