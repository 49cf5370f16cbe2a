"""The page: controls, the picture they change, and the row of a cell that is clicked."""

from __future__ import annotations

import html
from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np
import panel as pn
import xarray as xr
from bokeh.events import RangesUpdate, Tap

from kernels.interface import Status
from sweep.cells.schema import STATUS
from sweep.errors import SweepError
from sweep.show.view import View, coordinate, evened, preferred, setting
from sweep.view import region
from sweep.view.picture import Picture, Scales, status_colour
from sweep.view.slices import Choice, Range, along, nearest, number_axes, other_axes, outputs, row, shown

ONE_LINE = "(one line)"
SCALES = ("auto", "linear", "log")
SCALED = {"x": "scale across", "y": "scale up", "values": "values"}
FRAME = """
{% extends base %}
{% block preamble %}<meta name="viewport" content="width=device-width, initial-scale=1">{% endblock %}
{% block contents %}{{ embed(roots.page) }}{% endblock %}
"""
STYLE = """
table.cell { border-collapse: collapse; font-size: 13px; }
table.cell td { padding: 2px 12px 2px 0; border-bottom: 1px solid #ddd; vertical-align: top; }
.chip { display: inline-block; width: 12px; height: 12px; margin-right: 6px; vertical-align: -1px; }
"""


class Page:
    """The view of one result in one browser window. `layout` is what panel serves."""

    def __init__(self, dataset: xr.Dataset, name: str) -> None:
        self.name, values, even = name, ["value", "local exponent"], evened(dataset)
        if even is not dataset:
            title = f"{dataset.attrs.get('title') or name}: straight lines between its {dataset[STATUS].size:,} cells"
            even, values = even.assign_attrs(title=title), ["value"]  # straight lines have no exponent
        self.dataset = dataset = even
        names = outputs(dataset)
        if not names:
            raise SweepError(f"{name}: there is nothing to look at: no output runs along an axis of numbers")
        wide = {"sizing_mode": "stretch_width"}
        self.output = pn.widgets.Select(label="output", options=names, value=preferred(names), **wide)
        self.shows = pn.widgets.RadioButtonGroup(options=values, **wide)
        self.x = pn.widgets.Select(label="across the page", options=number_axes(dataset, self.output.value), **wide)
        self.up = pn.widgets.Select(label="up the page", **wide)
        self.scales = {
            key: _scale(text) for key, text in (("x", "scale across"), ("y", "scale up"), ("values", "values"))
        }
        self.statuses = pn.widgets.Checkbox(label="mark cells that are not OK", value=True)
        self.sliders: dict[str, Any] = {}
        self.saves: dict[str, Any] = {}
        self.slider_box = pn.Column(**wide)
        self.pane, self.note, self.legend, self.table = pn.pane.Bokeh(**wide), *(_html() for _ in range(3))
        self.found: View | None = None
        self.picture: Picture | None = None
        self.key: tuple[Any, ...] = ()
        self.layout = self._layout()
        self._watch()
        self._choose_output()

    @property
    def choice(self) -> Choice:
        """What the controls say."""
        up = None if self.up.value == ONE_LINE else self.up.value
        held = {dim: int(slider.value) for dim, slider in self.sliders.items()}
        return Choice(self.output.value, self.x.value, up, held, self.shows.value != "value")

    def _layout(self) -> Any:
        scales = pn.Row(*self.scales.values(), sizing_mode="stretch_width")
        saves = pn.Row(*(self._save(*of) for of in FILES), sizing_mode="stretch_width")
        controls = pn.Column(
            self.output, self.shows, self.x, self.up, self.slider_box, scales, self.statuses, saves,
            styles={"flex": "1 1 280px", "min-width": "min(100%, 280px)"},
        )  # fmt: skip
        seen = pn.Column(
            self.note, self.pane, self.legend, self.table, styles={"flex": "3 1 340px", "min-width": "min(100%, 340px)"}
        )
        title = html.escape(str(self.dataset.attrs.get("title") or self.name))
        head = _html(f"<h2 style='margin:4px 0'>{title}</h2>{html.escape(self.name)}")
        box = pn.FlexBox(controls, seen, sizing_mode="stretch_width", styles={"max-width": "calc(100vw - 16px)"})
        frame = pn.Template(FRAME)
        frame.add_panel("page", pn.Column(head, box, sizing_mode="stretch_width", stylesheets=[STYLE]))
        return frame

    def _save(self, suffix: str, make: Any) -> Any:
        name = f"{self.name.rpartition('.')[0] or self.name}_shown.{suffix}"
        button = pn.widgets.FileDownload(
            callback=lambda: make(self.dataset, self.choice, *self._ranges()),
            filename=name, label=suffix.upper(), sizing_mode="stretch_width", min_width=70,
        )  # fmt: skip
        self.saves[suffix] = button
        return button

    def _watch(self) -> None:
        self.output.param.watch(lambda _: self._choose_output(), "value")
        self.x.param.watch(lambda _: self._choose_x(), "value")
        self.up.param.watch(lambda _: self._make_sliders(), "value")
        for control in (self.shows, self.statuses, *self.scales.values()):
            control.param.watch(lambda _: self._redraw(), "value")

    def _choose_output(self) -> None:
        """Another output may have other axes; those that are chosen stay if it has them."""
        axes = number_axes(self.dataset, self.output.value)
        before, self.x.options = self.x.value, axes
        if before not in axes:
            self.x.value = axes[0]  # goes on by itself
            return
        self._choose_x()

    def _choose_x(self) -> None:
        others = other_axes(self.dataset, Choice(self.output.value, self.x.value))
        before, self.up.options = self.up.value, [*others, ONE_LINE]
        self.up.value = before if before in self.up.options else self.up.options[0]
        self._make_sliders()

    def _make_sliders(self) -> None:
        choice = self.choice
        held = [dim for dim in other_axes(self.dataset, choice) if dim != choice.across]
        places = {dim: int(self.sliders[dim].value) for dim in held if dim in self.sliders}
        self.sliders = {dim: self._slider(dim, places.get(dim, self.dataset.sizes[dim] // 2)) for dim in held}
        self.slider_box[:] = list(self.sliders.values())
        self._redraw()

    def _slider(self, dim: str, place: int) -> Any:
        values = coordinate(self.dataset[self.output.value], dim)
        if values.size == 1:
            return pn.widgets.Select(label=dim, options={_setting(values[0]): 0}, value=0)
        options = {f"{i + 1}: {_setting(value)}": i for i, value in enumerate(values)}
        slider = pn.widgets.DiscreteSlider(label=dim, options=options, value=place, sizing_mode="stretch_width")
        slider.param.watch(lambda _: self._redraw(), "value")
        return slider

    def _ranges(self) -> tuple[Range | None, Range | None]:
        return self.picture.ranges if self.picture else (None, None)

    def _redraw(self) -> None:
        """Reads the slice in view and draws it; makes a new figure where axes or scales have changed."""
        try:
            self._draw(self.choice)
            self.note.object = ""
        except SweepError as error:
            self.note.object = f"<b>{html.escape(str(error))}</b>"

    def _draw(self, choice: Choice) -> None:
        wanted = {name: widget.value for name, widget in self.scales.items()}
        key = (choice.output, choice.x, choice.across, choice.exponent, *wanted.values())
        if key == self.key:
            found = shown(self.dataset, choice, *self._ranges())
        else:
            found = shown(self.dataset, choice)
            self._new_picture(found, Scales.of(found, wanted))
            self.key = key
        assert self.picture is not None
        self.found = found
        self.picture.show(found, self.statuses.value)
        self.legend.object = _legend(found) if self.statuses.value else ""
        self._allow_saving(choice)

    def _new_picture(self, found: View, scales: Scales) -> None:
        self.picture = Picture(found, scales)
        self.picture.figure.on_event(RangesUpdate, lambda _: self._redraw())
        self.picture.figure.on_event(Tap, lambda event: self._click(event.x, event.y))
        self.pane.object = self.picture.figure

    def _allow_saving(self, choice: Choice) -> None:
        """Greys out what cannot be had of this slice."""
        self.saves["csv"].disabled = region.rows(self.dataset, choice, *self._ranges()) > region.MOST_ROWS
        try:
            region.study_text(self.dataset, choice, *self._ranges())
            self.saves["toml"].disabled = False
        except SweepError:
            self.saves["toml"].disabled = True

    def _click(self, x: float | None, y: float | None) -> None:
        """Shows the row of a cell that was clicked."""
        assert self.found is not None
        assert self.picture is not None
        scales, mapped = self.picture.scales, self.picture.mapped
        if x is None or y is None:
            return
        places = nearest(self.found, x, y, mapped, (scales.x, scales.y))
        if places is None:
            return
        self.picture.mark(*_middle(self.dataset, self.choice, places, mapped, y))
        self.table.object = _table(self.dataset, {**self.choice.held, **places})


def _middle(
    dataset: xr.Dataset, choice: Choice, places: Mapping[str, int], mapped: bool, y: float
) -> tuple[float | None, float | None]:
    """Where a cell is in the picture."""
    x = float(dataset[choice.x][places[along(dataset, choice.x)]])
    if mapped and choice.across:
        return x, float(coordinate(dataset[choice.output], choice.across)[places[choice.across]])
    value = float(dataset[choice.output].isel({**choice.held, **places})) if not choice.exponent else y
    return (x, value) if np.isfinite(value) else (None, None)


def _study_file(*region_of: Any) -> BytesIO:
    return BytesIO(region.study_text(*region_of).encode())


FILES = (("png", region.picture), ("csv", region.table), ("toml", _study_file))
"""What can be saved of what is shown."""


def _scale(name: str) -> Any:
    return pn.widgets.Select(label=name, options=list(SCALES), sizing_mode="stretch_width", min_width=70)


def _html(text: str = "") -> Any:
    return pn.pane.HTML(text, sizing_mode="stretch_width", stylesheets=[STYLE])


def _setting(value: xr.DataArray) -> str:
    """One value of an axis without its name, e.g. "0.5 1/s"; signs of formulas are for print."""
    return setting(value).partition(" = ")[2].replace("$", "").replace("^{", "^").replace("}", "")


def _legend(found: View) -> str:
    """What the colours of statuses mean, with how many cells in view have each."""
    lines = []
    for code in found.codes():
        name, count = found.meanings.get(code, str(code)), int((found.status == code).sum())
        doc = Status[name].doc if name in Status.__members__ else ""
        chip = f'<span class="chip" style="background:{status_colour(found, code)}"></span>'
        lines.append(f"<div>{chip}{html.escape(name)}, {count:,} shown: {html.escape(doc)}</div>")
    return "".join(lines)


def _table(dataset: xr.Dataset, places: Mapping[str, int]) -> str:
    texts = ((e.name, e.value, e.unit, e.meaning) for e in row(dataset, places))
    lines = ("".join(f"<td>{html.escape(text)}</td>" for text in entry) for entry in texts)
    return f'<table class="cell">{"".join(f"<tr>{line}</tr>" for line in lines)}</table>'
