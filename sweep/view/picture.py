"""The shown slice as bokeh draws it: a map of cells, or lines; the cells' statuses over it."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColorBar, ColumnDataSource, LinearColorMapper, LogColorMapper, Range1d
from bokeh.palettes import Viridis256
from bokeh.plotting import figure
from numpy.typing import NDArray

from sweep.laws.loglog import is_logarithmic, spans_decades
from sweep.show.charts import COLOURS
from sweep.show.view import View, coordinate, edges, meaning
from sweep.view.region import Range, cell_numbers

WIDTH, HEIGHT = 900, 560
"""Pixels of the raster of a map."""
OWN = {"INACCURATE": "#D55E00", "NOT_CONVERGED": "#B2182B", "FAILED": "#000000", "PENDING": "#999999"}
"""Colours of statuses that any kernel may give, none of them a map's own."""
OTHERS = ("#CC79A7", "#E69F00", "#8C510A", "#FF9DA7", "#444444", "#FF7F50")
"""Colours of the other statuses; one keeps its colour in all slices of a result."""
CLEAR = "#00000000"
TOOLS = "pan,box_zoom,wheel_zoom,reset,tap"


def status_colour(found: View, code: int) -> str:
    """The colour of a status."""
    rest = sorted(number for number, name in found.meanings.items() if name not in OWN)
    name = found.meanings.get(code, "")
    return OWN[name] if name in OWN else OTHERS[(rest.index(code) if code in rest else code) % len(OTHERS)]


def plain_label(found: View, name: str) -> str:
    """Text for an axis, without formulas."""
    column = found.y if name == found.y.name else coordinate(found.y, name)
    words, unit = meaning(column), str(column.attrs.get("units", ""))
    text = f"{words}, {name}" if words and words != name else name
    return text + (f" [{unit}]" if unit not in ("", "1") else "")


class Picture:
    """A figure of a slice. It is made once for two axes and their scales; `show` puts other numbers into it.

    Parameters
    ----------
    wanted : dict
        Scales of "x", "y" and "values": "linear", "log", or "auto": as the grid, and "log" of values that span decades.
    """

    def __init__(self, found: View, wanted: dict[str, str]) -> None:
        self.mapped, values = found.mapped, found.y.values
        self.log_values = _is_log(wanted["values"], values, spans_decades(values))
        axes = {"x": found.x, **({"y": str(found.across)} if found.mapped else {})}
        grids = {key: found.values(name) for key, name in axes.items()}
        log = {key: _is_log(wanted[key], grid, is_logarithmic(grid)) for key, grid in grids.items()}
        self.log = log["x"], log.get("y", self.log_values)
        kinds = {f"{key}_axis_type": "log" if yes else "linear" for key, yes in zip("xy", self.log, strict=True)}
        ranges = {f"{key}_range": _range(grid, log[key]) for key, grid in grids.items()}
        self.figure = figure(
            height=HEIGHT, sizing_mode="stretch_width", tools=TOOLS, active_drag="box_zoom", active_scroll=None,
            toolbar_location="above", output_backend="canvas", **kinds, **ranges,
        )  # fmt: skip
        self.figure.toolbar.logo = None
        self.figure.xaxis.axis_label = plain_label(found, found.x)
        self.figure.yaxis.axis_label = plain_label(found, axes.get("y", str(found.y.name)))
        self.figure.grid.grid_line_alpha = 0.3
        self.chosen = ColumnDataSource({"x": [], "y": []})
        if found.mapped:
            self._prepare_map(found)
        else:
            self._prepare_lines(found)
        self.figure.scatter("x", "y", source=self.chosen, marker="cross", size=18, color="#D00000", line_width=2)

    def show(self, found: View, statuses: bool) -> None:
        """Draw these numbers, and the statuses over them if wanted."""
        (self._map if self.mapped else self._lines)(found, statuses)

    def mark(self, x: float, y: float) -> None:
        """A cross on a cell; none where it has no value."""
        self.chosen.data = {"x": [x], "y": [y]} if np.isfinite(y) else {"x": [], "y": []}

    @property
    def ranges(self) -> tuple[Range, Range | None]:
        """What part of both axes is in view; None where the vertical axis is that of the values."""
        x, y = self.figure.x_range, self.figure.y_range
        return (float(x.start), float(x.end)), ((float(y.start), float(y.end)) if self.mapped else None)

    def _prepare_map(self, found: View) -> None:
        self.cells, self.flags = (ColumnDataSource({"image": [], "x": [], "y": [], "dw": [], "dh": []}) for _ in "ab")
        self.mapper = (LogColorMapper if self.log_values else LinearColorMapper)(palette=Viridis256, nan_color=CLEAR)
        codes = sorted(found.meanings)
        palette = [CLEAR if code <= 0 else status_colour(found, code) for code in codes] or [CLEAR]
        flags = LinearColorMapper(palette=palette, low=-0.5, high=len(palette) - 0.5, nan_color=CLEAR)
        place = {name: name for name in ("x", "y", "dw", "dh")}
        self.figure.image("image", source=self.cells, color_mapper=self.mapper, **place)
        self.figure.image("image", source=self.flags, color_mapper=flags, alpha=0.5, **place)
        self.figure.add_layout(ColorBar(color_mapper=self.mapper, title=plain_label(found, str(found.y.name))), "above")

    def _map(self, found: View, statuses: bool) -> None:
        """Every pixel has the value of the cell that it lies in."""
        ends, places = self.ranges, []
        for name, (low, high), count, log in zip((found.x, found.across), ends, (WIDTH, HEIGHT), self.log, strict=True):  # type: ignore[misc]
            share = (np.arange(count) + 0.5) / count
            middles = low * (high / low) ** share if log else low + share * (high - low)
            places.append(cell_numbers(found.values(str(name)), middles))
        columns, rows = places
        (left, right), (low, high) = ends  # type: ignore[misc]
        at = {"x": [left], "y": [low], "dw": [right - left], "dh": [high - low]}

        def raster(values: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.where((rows < 0)[:, None] | (columns < 0)[None, :], np.nan, values[np.ix_(rows, columns)])

        values = found.y.values.astype(np.float64)
        values = np.where(np.isfinite(values) & ((values > 0) | (not self.log_values)), values, np.nan)
        self.cells.data = {"image": [raster(values)], **at}
        numbers = np.searchsorted(sorted(found.meanings) or [0], found.status).astype(np.float64)
        flags = raster(np.where(found.status != 0, numbers, np.nan))
        self.flags.data = {"image": [flags], **at} if statuses else {name: [] for name in self.flags.data}
        if np.isfinite(values).any():
            least = float(np.nanmin(values))
            self.mapper.update(low=least, high=_above(least, np.nanmax(values)))

    def _prepare_lines(self, found: View) -> None:
        self.lines = ColumnDataSource({"xs": [], "ys": [], "colour": [], "name": []})
        self.points = ColumnDataSource({"x": [], "y": [], "colour": []})
        self.marks = ColumnDataSource({"x": [], "y": [], "colour": []})
        if found.joined:
            legend = {"legend_field": "name"} if found.across else {}
            self.figure.multi_line("xs", "ys", line_color="colour", line_width=2, source=self.lines, **legend)
        else:
            self.figure.scatter("x", "y", color="colour", size=4, source=self.points)
        look = {"marker": "circle", "fill_alpha": 0, "line_width": 2, "size": 9}
        self.figure.scatter("x", "y", color="colour", source=self.marks, **look)

    def _lines(self, found: View, statuses: bool) -> None:
        x, ys = found.values(found.x).astype(np.float64), np.atleast_2d(found.y.values).astype(np.float64)
        ys = np.where(ys > 0, ys, np.nan) if self.log_values else ys
        colours = [COLOURS[i % len(COLOURS)] for i in range(len(ys))]
        names = [f"{found.across} = {v}" for v in coordinate(found.y, found.across).values] if found.across else [""]
        self.lines.data = {"xs": [x] * len(ys), "ys": list(ys), "colour": colours, "name": names}
        self.points.data = {"x": np.tile(x, len(ys)), "y": ys.ravel(), "colour": np.repeat(colours, x.size)}
        status = np.atleast_2d(found.status) * statuses
        rows, columns = np.nonzero(status)
        foot = float(np.nanmin(ys)) if np.isfinite(ys).any() else 1.0
        heights = np.where(np.isfinite(ys[rows, columns]), ys[rows, columns], foot)
        colour = [status_colour(found, int(code)) for code in status[rows, columns]]
        self.marks.data = {"x": x[columns], "y": heights, "colour": colour}


def _is_log(wanted: str, values: NDArray[Any], automatic: bool) -> bool:
    if values.dtype.kind not in "fiu":
        return False
    return automatic if wanted == "auto" else wanted == "log" and bool((values > 0).any())


def _range(grid: NDArray[Any], logarithmic: bool) -> Range1d:
    """From the first cell's edge to the last one's, as far as a logarithm reaches."""
    ends = edges(np.sort(grid.astype(np.float64)))
    low = float(ends[0] if ends[0] > 0 or not logarithmic else grid[grid > 0].min())
    high = _above(low, ends[-1])
    return Range1d(low, high, reset_start=low, reset_end=high)


def _above(low: float, high: Any) -> float:
    """The upper end of a range that is not empty."""
    return float(high) if high > low else low + (abs(low) or 1.0) * 1e-6
