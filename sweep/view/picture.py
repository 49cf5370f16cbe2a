"""Draws the selected slice with bokeh: a map of cells, or lines, with statuses on top."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColorBar, ColumnDataSource, LinearColorMapper, LogColorMapper, Range1d
from bokeh.palettes import Viridis256
from bokeh.plotting import figure
from numpy.typing import NDArray

from sweep.laws.loglog import is_logarithmic, spans_decades
from sweep.show.charts import COLOURS
from sweep.show.view import View, edges, meaning
from sweep.view.region import Range

WIDTH, HEIGHT = 900, 560
"""Pixels of the raster of a map."""
CLEAR = "#00000000"
TOOLS = "pan,box_zoom,wheel_zoom,reset,tap"


def plain_label(found: View, name: str) -> str:
    """Text for an axis, without formulas."""
    column = found.y if name == found.y.name else found.axis(name)
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
        if found.mapped:
            self._prepare_map(found)
        else:
            self._prepare_lines(found)
        self.chosen = _source("x", "y")
        self.figure.scatter("x", "y", source=self.chosen, marker="cross", size=18, color="#D00000", line_width=2)

    def _prepare_map(self, found: View) -> None:
        self.cells, self.flags = (_source("image", "x", "y", "dw", "dh") for _ in range(2))
        self.mapper = (LogColorMapper if self.log_values else LinearColorMapper)(palette=Viridis256, nan_color=CLEAR)
        palette = [CLEAR if code <= 0 else found.colour(code) for code in sorted(found.meanings)] or [CLEAR]
        flags = LinearColorMapper(palette=palette, low=-0.5, high=len(palette) - 0.5, nan_color=CLEAR)
        place = {name: name for name in ("x", "y", "dw", "dh")}
        self.figure.image("image", source=self.cells, color_mapper=self.mapper, **place)
        self.figure.image("image", source=self.flags, color_mapper=flags, alpha=0.5, **place)
        self.figure.add_layout(ColorBar(color_mapper=self.mapper, title=plain_label(found, str(found.y.name))), "above")

    def _prepare_lines(self, found: View) -> None:
        self.lines = _source("xs", "ys", "colour", "name")
        self.points, self.marks = (_source("x", "y", "colour") for _ in range(2))
        if found.joined:
            legend = {"legend_field": "name"} if found.across else {}
            self.figure.multi_line("xs", "ys", line_color="colour", line_width=2, source=self.lines, **legend)
        else:
            self.figure.scatter("x", "y", color="colour", size=4, source=self.points)
        look = {"marker": "circle", "fill_alpha": 0, "line_width": 2, "size": 9}
        self.figure.scatter("x", "y", color="colour", source=self.marks, **look)

    def show(self, found: View, statuses: bool) -> None:
        """Draw these numbers, and the statuses over them if wanted."""
        self.x = found.values(found.x).astype(np.float64)
        (self._map if self.mapped else self._lines)(found, statuses)

    def _map(self, found: View, statuses: bool) -> None:
        """Every pixel has the value of the cell that it lies in."""
        self.up = found.values(str(found.across)).astype(np.float64)
        (left, right), (low, high) = ends = self.ranges[0], self.ranges[1] or (0.0, 1.0)
        places = []
        for grid, (first, last), count, log in zip((self.x, self.up), ends, (WIDTH, HEIGHT), self.log, strict=True):
            share = (np.arange(count) + 0.5) / count
            places.append(
                cell_numbers(grid, first * (last / first) ** share if log else first + share * (last - first))
            )
        columns, rows = places
        outside = (rows < 0)[:, None] | (columns < 0)
        values, pixels = found.y.values.astype(np.float64), np.ix_(rows, columns)
        values[~np.isfinite(values) | (self.log_values & (values <= 0))] = np.nan
        numbers = np.where(found.status, np.searchsorted(sorted(found.meanings) or [0], found.status), np.nan)
        at = {"x": [left], "y": [low], "dw": [right - left], "dh": [high - low]}
        self.cells.data = {"image": [np.where(outside, np.nan, values[pixels])], **at}
        flags = {"image": [np.where(outside, np.nan, numbers[pixels])], **at}
        self.flags.data = flags if statuses else {name: [] for name in flags}
        if np.isfinite(values).any():
            least = float(np.nanmin(values))
            self.mapper.update(low=least, high=_above(least, np.nanmax(values)))

    def _lines(self, found: View, statuses: bool) -> None:
        """A cell without a value is marked at the foot of the picture."""
        x, ys = self.x, np.atleast_2d(found.y.values).astype(np.float64)
        ys = np.where(ys > 0, ys, np.nan) if self.log_values else ys
        self.heights = np.where(np.isfinite(ys), ys, np.nanmin(ys) if np.isfinite(ys).any() else 1.0)
        colours = [COLOURS[i % len(COLOURS)] for i in range(len(ys))]
        names = [f"{found.across} = {v}" for v in found.values(found.across)] if found.across else [""]
        self.lines.data = {"xs": [x] * len(ys), "ys": list(ys), "colour": colours, "name": names}
        self.points.data = {"x": np.tile(x, len(ys)), "y": ys.ravel(), "colour": np.repeat(colours, x.size)}
        status = np.atleast_2d(found.status) * statuses
        rows, columns = np.nonzero(status)
        colour = [found.colour(int(code)) for code in status[rows, columns]]
        self.marks.data = {"x": x[columns], "y": self.heights[rows, columns], "colour": colour}

    @property
    def ranges(self) -> tuple[Range, Range | None]:
        """What part of both axes is in view; None where the vertical axis is that of the values."""
        x, y = self.figure.x_range, self.figure.y_range
        return (float(x.start), float(x.end)), ((float(y.start), float(y.end)) if self.mapped else None)

    def choose(self, x: float, y: float) -> tuple[int, int] | None:
        """Row and column of the cell at a point, or of the line's point next to it, with a cross on it.

        None beside a map.
        """
        if self.mapped:
            row, column = (int(cell_numbers(grid, np.array([at]))[0]) for grid, at in ((self.up, y), (self.x, x)))
            if min(row, column) < 0:
                return None
            height = self.up[row]
        else:
            away = np.hypot(_distance(self.x, x, self.log[0]), _distance(self.heights, y, self.log[1]))
            row, column = divmod(int(np.nanargmin(away)), self.x.size)
            height = self.heights[row, column]
        self.chosen.data = {"x": [float(self.x[column])], "y": [float(height)]}
        return row, column


def cell_numbers(grid: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.intp]:
    """Which cell of a rising axis each of some points is in; -1 beside all of them."""
    borders = edges(grid)
    found = np.searchsorted(borders, at, side="right") - 1
    return np.where((at < borders[0]) | (at > borders[-1]), -1, np.minimum(found, grid.size - 1))


def _distance(values: NDArray[np.float64], at: float, logarithmic: bool) -> NDArray[np.float64]:
    """Distances as the eye sees them: shares of the picture's side."""
    if logarithmic:
        values, at = np.log(np.where(values > 0, values, np.nan)), np.log(at)
    away: NDArray[np.float64] = abs(values - at) / ((np.nanmax(values) - np.nanmin(values)) or 1.0)
    return away


def _source(*names: str) -> ColumnDataSource:
    return ColumnDataSource({name: [] for name in names})


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
