"""What the figures of the studies share: the page and its panels, curves, maps and their bars, labels, ticks."""

import itertools
import sys
from collections.abc import Callable, Sequence
from functools import partial, wraps
from typing import Any, NamedTuple

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
from matplotlib.transforms import Bbox

HOLLOW = {"linestyle": "", "markerfacecolor": "white", "markersize": 3.6}
"""Marks of what is computed, beside lines of theory."""
Ticks = Sequence[float] | dict[float, str] | None


class Axis(NamedTuple):
    """Label with the unit, ends (None: as what is drawn needs), ticks (see `ticks`), and whether it is logarithmic."""

    label: str = ""
    ends: Any = None
    ticks: Ticks = None
    scale: str = "linear"

    def to(self, low: float, high: float) -> "Axis":
        """The same between these ends."""
        return self._replace(ends=(low, high))


Log = partial(Axis, scale="log")
"""A logarithmic axis."""
DRIVE, ALPHA = Log(r"drive, $\alpha = \mu/(a^2\varphi_0)$ [1]"), Log(r"drive, $\alpha$ [1]")
TORQUE, KAPPA = Log(r"torque, $\mu/(a^2\varphi_0)$ [1]"), Log(r"wheel over foliot, $\kappa$ [1]")
S, SLOPE = Axis("exponent, $s$ [1]"), Axis(r"exponent, $\mathrm{d}\ln P/\mathrm{d}\ln\mu$ [1]")
LAWS = {-1: "$-1$", -1 / 2: r"$-\frac{1}{2}$", -1 / 3: r"$-\frac{1}{3}$", 0: "0"}
"""Ticks of it at the exponents of laws."""
COST, ERROR = Log("CPU time per cell [s]"), Log("relative error, worst cell [1]")
"""Axes that several studies have."""


def panel(x: Axis, y: Axis, legend: str = "", key: dict[str, Any] | None = None, **how: Any) -> Callable[..., Any]:
    """Declares a panel of a page: its axes, the place of its legend and its options.

    A legend "outside ..." is on the page; "beside", names stand at their lines' marks. `key` has entries of the legend
    beside the lines that have names: format, or options, of a black line or mark.
    """

    def declared(figure: Any) -> Any:
        figure.panels.insert(0, (x, y, {"loc": legend, **how} if legend else {}, key or {}))
        return figure

    return declared


def page(height: float, width: float = 110.0, columns: int = 1, **how: Any) -> Callable[..., Any]:
    """Makes a figure for print, of so many mm, of a function that draws into the panels declared above it.

    Panels of 110 mm one above the other can be read at the width of a phone too.
    The function takes axes, lettered in the end if there are several, and what is drawn; `how` is of `subplots`.
    """

    def decorated(draw: Callable[..., None]) -> Callable[..., Any]:
        @wraps(draw)
        def figure(*made: Any) -> Any:
            with charts.style():
                whole = charts.new_figure(width, height)
                panels = np.ravel(whole.subplots(-(-len(figure.panels) // columns), columns, **how))
                for axes, (x, y, *_) in zip(panels, figure.panels, strict=True):
                    axes.set(xscale=x.scale, yscale=y.scale)
                draw(*panels, *made)
                for axes, declared, text in zip(panels, figure.panels, "abcdefghi", strict=False):
                    _finish(axes, *declared)
                    if panels.size > 1:
                        charts.letter(axes, text)
            return whole

        figure.panels = []
        return figure

    return decorated


def _finish(axes: Any, x: Axis, y: Axis, legend: dict[str, Any], key: dict[str, Any]) -> None:
    for name, axis, one in (("x", axes.xaxis, x), ("y", axes.yaxis, y)):
        ticks(axis, one.ticks)
        said = {f"{name}label": one.label, f"{name}lim": one.ends}
        axes.set(**{what: value for what, value in said.items() if value})
    for label, look in key.items():
        form, how = ((), look) if isinstance(look, dict) else ((look,), {})
        axes.plot([], [], *form, **{"color": "black", "label": label, **how})
    if legend.get("loc") == "beside":
        name_lines(axes)
    elif legend:
        named = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
        (axes.figure if "outside" in legend["loc"] else axes).legend(named.values(), named, **legend)


def ticks(axis: Any, values: Ticks) -> None:
    """Ticks of an axis at these values, written out, or with the texts that are given, and no others."""
    if values is not None:
        texts = values if isinstance(values, dict) else {x: f"{x:g}" for x in values}
        axis.set_ticks(list(texts), labels=list(texts.values()))
        axis.set_ticks([], minor=True)


def points(axes: Any, x: Any, y: Any, k: int, label: str | None = None, **how: Any) -> None:
    """Hollow marks of the k-th of several: what is computed."""
    axes.plot(x, y, **{"marker": MARKS[k], "color": COLOURS[k], "label": label, **HOLLOW, **how})


def colour_map(axes: Any, x: Any, y: Any, values: Any, label: str, bar: Any = None, **how: Any) -> Any:
    """A map of values, of shape (y, x), to the edges of its grid; gives its bar, whose options are `bar`.

    In "cividis_r" are values that are the better the less they are: the good end is bright, and on top of the bar. Its
    `ticks` may be texts by value.
    """
    how, bar = {"cmap": "cividis", "shading": "nearest", "rasterized": True, **how}, dict(bar or {})
    mesh, texts = axes.pcolormesh(x, y, values, **how), bar.pop("ticks", None)
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    made = axes.figure.colorbar(mesh, ax=axes, label=label, pad=0.02, **bar)
    if how["cmap"] == "cividis_r":
        made.ax.invert_yaxis()
    if texts:
        made.set_ticks(list(texts), labels=list(texts.values()))
        if "norm" in how:
            made.minorticks_off()
    return made


def contours(axes: Any, x: Any, y: Any, values: Any, levels: Any, colour: str = "white", **text: Any) -> Any:
    """Lines of equal values on a map, and their labels, with the options of `clabel`."""
    width = text.pop("linewidths", 0.7)
    lines = axes.contour(x, y, values, levels=levels, colors=colour, linewidths=width)
    return axes.clabel(lines, **{"fmt": "%g", "fontsize": 7, **text})


def kinds_map(axes: Any, x: Any, y: Any, kind: Any, colours: dict[str, str]) -> list[Any]:
    """A map of kinds, of shape (y, x), each the place of its name among the colours; patches of those that occur."""
    look = {"cmap": ListedColormap(list(colours.values())), "vmin": -0.5, "vmax": len(colours) - 0.5}
    axes.pcolormesh(x, y, kind, shading="nearest", rasterized=True, **look)
    return [Patch(color=c, label=name) for i, (name, c) in enumerate(colours.items()) if bool((kind == i).any())]


def exponent_map(axes: Any, ds: xr.Dataset, out: Any, text: str) -> None:
    """A verge's exponent `s` over alpha and kappa; cells that are `out`, of shape (kappa, alpha), hatched and named."""
    alpha, kappa = ds.alpha.values, ds.kappa.values
    ends = {1 / 3: "1/3", 0.5: "1/2", 0.75: "3/4", 1.0: "1"}
    colour_map(axes, alpha, kappa, ds.s.values, "exponent, $s$ [1]", {"ticks": ends}, vmin=1 / 3, vmax=1)
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


def name_lines(axes: Any) -> None:
    """Writes each line's name beside one of its marks, where it covers fewest marks, lines and texts, and nearest."""
    axes.figure.draw_without_rendering()
    point, room = axes.figure.dpi / 72.0, axes.get_window_extent()
    known = {line: line.get_xydata() for line in axes.lines if line.get_label()[0] != "_"}
    known = {line: shown for line, xy in known.items() if len(shown := xy[np.isfinite(xy).all(axis=1)])}
    marks = [axes.transData.transform(xy) for xy in known.values()]
    along = (np.linspace(at[:-1], at[1:], 100).reshape(-1, 2) for at in marks)
    covered = np.concatenate([np.empty((0, 2)), *marks, *along])
    boxes = [shown.get_window_extent() for shown in axes.texts]
    ways = list(itertools.product((5.0, 8.0, 12.0, 18.0), ((0, 1), (1, 0), (-1, 0), (0, -1), (0.6, 1), (-0.6, 1))))
    for (line, xy), at in zip(known.items(), marks, strict=True):
        look = {"color": line.get_color(), "fontsize": 8, "ha": "center", "va": "center"}
        name = axes.annotate(line.get_label(), xy[0], (0, 0), textcoords="offset points", **look)
        half, found = 0.5 * np.array(name.get_window_extent().size), []
        for i, (far, way) in itertools.product(range(len(at)), ways):
            middle = at[i] + way * (half + far * point)
            box = Bbox([middle - half, middle + half])
            outside = not (room.contains(*box.min) and room.contains(*box.max))
            hidden = box.padded(3.0 * point).count_contains(covered) + 100 * (box.count_overlaps(boxes) + outside)
            found.append((hidden, far, i, *(middle - at[i]) / point, box))
        _, _, i, *shift, box = min(found, key=lambda place: place[:3])
        name.xy, name.xyann = xy[i], shift
        boxes.append(box)


def draw_costs(axes: Any, found: dict[str, xr.Dataset], names: Sequence[str]) -> None:
    """`worst` error over `seconds` a cell of those of the methods `names` that there are, each in its colour."""
    for name in filter(found.__contains__, names):
        drawn = found[name].where(found[name].worst < 1.0).dropna("rtol")
        axes.plot(drawn.seconds, drawn.worst.clip(1e-16), markersize=4, linewidth=0.9, label=name, **method_look(name))
