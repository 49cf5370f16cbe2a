"""The shown slice as bokeh draws it: a map of cells, or lines; the cells' statuses over it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from bokeh.models import ColorBar, ColumnDataSource, LinearColorMapper, LogColorMapper, Range1d
from bokeh.palettes import Viridis256
from bokeh.plotting import figure
from numpy.typing import NDArray

from sweep.laws.loglog import is_logarithmic, spans_decades
from sweep.show.charts import COLOURS
from sweep.show.view import View, coordinate, edges
from sweep.view.slices import Range, cell_numbers

WIDTH, HEIGHT = 900, 560
"""Pixels of the raster of a map."""

STATUS_COLOURS = (
    *("#D55E00", "#444444", "#CC79A7", "#999999", "#E69F00", "#B2182B", "#8C510A", "#FF9DA7", "#000000", "#FF7F50"),
)
"""Colours of statuses that are not OK, none of them a map's own; one keeps its colour in all slices of a result."""

CLEAR = "#00000000"
TOOLS = "pan,box_zoom,wheel_zoom,reset,tap"


@dataclass(frozen=True)
class Scales:
    """Whether the horizontal axis, the vertical one, and the colours are logarithmic."""

    x: bool
    y: bool
    colour: bool = False

    @classmethod
    def of(cls, found: View, wanted: dict[str, str]) -> Scales:
        """As wanted, "linear" or "log"; "auto": as the grid, and of values whether they span decades."""
        values = _scale(wanted["values"], found.y.values, spans_decades(found.y.values))
        x, *up = (
            _axis_scale(found.values(n), wanted[k]) for n, k in zip((found.x, found.across), "xy", strict=True) if n
        )
        return cls(x, up[0], values) if found.mapped else cls(x, values)


def _scale(wanted: str, values: Any, automatic: bool) -> bool:
    return automatic if wanted == "auto" else wanted == "log" and bool((values > 0).any())


def _axis_scale(grid: NDArray[Any], wanted: str) -> bool:
    return grid.dtype.kind in "fiu" and _scale(wanted, grid, is_logarithmic(grid))


def status_colour(found: View, code: int) -> str:
    """The colour of a status."""
    return STATUS_COLOURS[sorted(found.meanings or [code]).index(code) % len(STATUS_COLOURS)]


def plain_label(found: View, name: str) -> str:
    """Text for an axis, without formulas."""
    column = found.y if name == found.y.name else coordinate(found.y, name)
    words, unit = str(column.attrs.get("long_name", "")), str(column.attrs.get("units", ""))
    text = f"{words}, {name}" if words and words != name else name
    return text + (f" [{unit}]" if unit not in ("", "1") else "")


class Picture:
    """A figure of a slice. It is made once for two axes and their scales; `show` puts other numbers into it."""

    def __init__(self, found: View, scales: Scales) -> None:
        self.scales, self.mapped = scales, found.mapped
        kinds = {"x_axis_type": _kind(scales.x), "y_axis_type": _kind(scales.y)}
        ranges = {"x_range": _range(found.values(found.x), scales.x)}
        if found.mapped:
            ranges["y_range"] = _range(found.values(str(found.across)), scales.y)
        self.figure = figure(
            height=HEIGHT, sizing_mode="stretch_width", tools=TOOLS, active_drag="box_zoom", active_scroll=None,
            toolbar_location="above", output_backend="canvas", **kinds, **ranges,
        )  # fmt: skip
        self.figure.toolbar.logo = None
        self.figure.xaxis.axis_label = plain_label(found, found.x)
        self.figure.grid.grid_line_alpha = 0.3
        self.chosen = ColumnDataSource({"x": [], "y": []})
        self._draw = self._map if found.mapped else self._lines
        self._prepare_map(found) if found.mapped else self._prepare_lines(found)
        self.figure.scatter("x", "y", source=self.chosen, marker="cross", size=18, color="#D00000", line_width=2)

    def show(self, found: View, statuses: bool) -> None:
        """Draw these numbers, and the statuses over them if wanted."""
        self._draw(found, statuses)

    def mark(self, x: float | None, y: float | None) -> None:
        """A cross on a cell; None: none."""
        self.chosen.data = {"x": [] if x is None else [x], "y": [] if y is None else [y]}

    @property
    def ranges(self) -> tuple[Range, Range | None]:
        """What part of both axes is in view; None where the vertical axis is that of the values."""
        x, y = self.figure.x_range, self.figure.y_range
        return (float(x.start), float(x.end)), ((float(y.start), float(y.end)) if self.mapped else None)

    def _prepare_map(self, found: View) -> None:
        self.figure.yaxis.axis_label = plain_label(found, str(found.across))
        self.cells, self.flags = (ColumnDataSource({"image": [], "x": [], "y": [], "dw": [], "dh": []}) for _ in "ab")
        mapper = LogColorMapper if self.scales.colour else LinearColorMapper
        self.mapper = mapper(palette=Viridis256, nan_color=CLEAR)
        codes = sorted(found.meanings)
        palette = [CLEAR if code <= 0 else status_colour(found, code) for code in codes] or [CLEAR]
        flag_mapper = LinearColorMapper(palette=palette, low=-0.5, high=len(palette) - 0.5, nan_color=CLEAR)
        place = {"x": "x", "y": "y", "dw": "dw", "dh": "dh"}
        self.figure.image("image", source=self.cells, color_mapper=self.mapper, **place)
        self.figure.image("image", source=self.flags, color_mapper=flag_mapper, alpha=0.5, **place)
        self.bar = ColorBar(color_mapper=self.mapper, title=plain_label(found, str(found.y.name)))
        self.figure.add_layout(self.bar, "above")

    def _map(self, found: View, statuses: bool) -> None:
        (left, right), low_high = self.ranges
        assert low_high is not None
        columns = cell_numbers(found.values(found.x), _pixels((left, right), WIDTH, self.scales.x))
        rows = cell_numbers(found.values(str(found.across)), _pixels(low_high, HEIGHT, self.scales.y))
        at = {"x": [left], "y": [low_high[0]], "dw": [right - left], "dh": [low_high[1] - low_high[0]]}
        values = found.y.values.astype(np.float64)
        values = np.where(np.isfinite(values) & ((values > 0) | (not self.scales.colour)), values, np.nan)
        self.cells.data = {"image": [_raster(values, rows, columns)], **at}
        codes = np.array(sorted(found.meanings) or [0])
        numbers = np.searchsorted(codes, found.status).astype(np.float64)
        flags = np.where(found.status != 0, numbers, np.nan)
        self.flags.data = {"image": [_raster(flags, rows, columns)], **at} if statuses else {**_empty(self.flags)}
        if np.isfinite(values).any():
            self.mapper.update(low=float(np.nanmin(values)), high=_above(float(np.nanmin(values)), np.nanmax(values)))

    def _prepare_lines(self, found: View) -> None:
        self.figure.yaxis.axis_label = plain_label(found, str(found.y.name))
        self.lines = ColumnDataSource({"xs": [], "ys": [], "colour": [], "name": []})
        self.points = ColumnDataSource({"x": [], "y": [], "colour": []})
        self.marks = ColumnDataSource({"x": [], "y": [], "colour": []})
        legend = {"legend_field": "name"} if found.across else {}
        if found.joined:
            self.figure.multi_line("xs", "ys", line_color="colour", line_width=2, source=self.lines, **legend)
        else:
            self.figure.scatter("x", "y", color="colour", size=4, source=self.points)
        self.figure.scatter(
            "x", "y", marker="circle", fill_alpha=0, line_width=2, color="colour", size=9, source=self.marks
        )

    def _lines(self, found: View, statuses: bool) -> None:
        x, ys = found.values(found.x).astype(np.float64), np.atleast_2d(found.y.values).astype(np.float64)
        ys = np.where(ys > 0, ys, np.nan) if self.scales.y else ys
        colours = [COLOURS[i % len(COLOURS)] for i in range(len(ys))]
        names = [f"{found.across} = {v}" for v in coordinate(found.y, found.across).values] if found.across else [""]
        self.lines.data = {"xs": [x] * len(ys), "ys": list(ys), "colour": colours, "name": names}
        self.points.data = {
            "x": np.tile(x, len(ys)), "y": ys.reshape(-1), "colour": np.repeat(colours, x.size),
        }  # fmt: skip
        rows, columns = np.nonzero(np.atleast_2d(found.status) != 0) if statuses else (np.array([], int),) * 2
        codes = np.atleast_2d(found.status)[rows, columns]
        finite = ys[np.isfinite(ys)]
        foot = float(finite.min()) if finite.size else 1.0
        heights = np.where(np.isfinite(ys[rows, columns]), ys[rows, columns], foot)
        colour = [status_colour(found, int(code)) for code in codes]
        self.marks.data = {"x": x[columns], "y": heights, "colour": colour}


def _kind(logarithmic: bool) -> str:
    return "log" if logarithmic else "linear"


def _range(grid: NDArray[Any], logarithmic: bool) -> Range1d:
    """From the first cell's edge to the last one's, as far as a logarithm reaches."""
    ends = edges(np.sort(grid.astype(np.float64)))
    low = float(ends[0] if ends[0] > 0 or not logarithmic else grid[grid > 0].min())
    high = _above(low, ends[-1])
    return Range1d(low, high, reset_start=low, reset_end=high)


def _above(low: float, high: Any) -> float:
    """The upper end of a range that is not empty."""
    return float(high) if high > low else low + (abs(low) or 1.0) * 1e-6


def _pixels(ends: Range, count: int, logarithmic: bool) -> NDArray[np.float64]:
    """Middles of the pixels of an axis, in its own numbers."""
    share = (np.arange(count) + 0.5) / count
    low, high = np.log(ends) if logarithmic else ends
    at: NDArray[np.float64] = low + share * (high - low)
    return np.exp(at) if logarithmic else at


def _raster(values: NDArray[np.float64], rows: Any, columns: Any) -> NDArray[np.float64]:
    """The value of the cell in every pixel, NaN beside the grid."""
    return np.where((rows < 0)[:, None] | (columns < 0)[None, :], np.nan, values[np.ix_(rows, columns)])


def _empty(source: ColumnDataSource) -> dict[str, list[Any]]:
    return {name: [] for name in source.data}
