"""The page of the viewer: controls, figure, and the values of a clicked cell; served to this machine only."""

from __future__ import annotations

import html
import os
import re
import socket
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kernels.interface import Status
from sweep.errors import SweepError, missing
from sweep.file.open import open_result
from sweep.show.view import coordinate, evened, lines_of, outputs, preferred
from sweep.view import region
from sweep.view.region import Choice, number_axes, other_axes, row, shown
from sweep.words import Table, paragraph

try:
    import panel as pn
    from bokeh.events import RangesUpdate, Tap
    from tornado.web import ErrorHandler

    from sweep.view.picture import Picture
except ImportError:
    raise missing("the viewer needs panel", "view") from None

if TYPE_CHECKING:
    import xarray as xr

    from sweep.show.view import View

ADDRESS = "127.0.0.1"
"""An address that other machines cannot reach."""
OTHER_HOSTS = rf"(?!({re.escape(ADDRESS)}|localhost|\[::1\])$).*"
"""Names of this server that no browser of its user knows: a page from elsewhere asks for it by one of its own."""
ONE_LINE = "(one line)"
MOST_ROWS = 1_000_000
"""Cells that are sent to a browser as a table."""
SCALED = {"x": "scale across", "y": "scale up", "values": "values"}
WIDE = {"sizing_mode": "stretch_width"}
STYLE = """
table { border-collapse: collapse; font-size: 13px; }
td { padding: 2px 12px 2px 0; border-bottom: 1px solid #ddd; vertical-align: top; }
.chip { display: inline-block; width: 12px; height: 12px; margin-right: 6px; vertical-align: -1px; }
"""


def serve(path: str | os.PathLike[str], port: int = 0, show: bool = True) -> None:
    """Serve the page of a result until Ctrl-C; each window of a browser opens the result anew.

    Parameters
    ----------
    path : path
        The output of a sweep, finished or not.
    port : int
        Of this machine; 0: a free one.
    show : bool
        Open the page in the browser.

    Raises
    ------
    SweepError
        There is no result, it has nothing to look at, or the port is taken.
    """
    result = Path(path)
    try:
        with socket.create_server((ADDRESS, port)):
            pass
    except (OSError, OverflowError) as error:
        raise SweepError(f"port {port} of this machine: {error}; choose another by --port, or none") from None
    with open_result(result) as dataset:
        Page(dataset, result.name)  # what cannot be shown is said here, not in the browser

    def session() -> Any:
        dataset = open_result(result)
        pn.state.on_session_destroyed(lambda _: dataset.close())
        return Page(dataset, result.name, pn.state.location).layout

    server = pn.serve(session, port=port, address=ADDRESS, show=show, start=False, title=result.name, verbose=False)
    # pages and websockets alike, for tornado accepts any name in which Host and Origin agree
    server._tornado.add_handlers(OTHER_HOSTS, [(".*", ErrorHandler, {"status_code": 403})])
    print(paragraph(f"http://{ADDRESS}:{server.port}/ shows {result}; Ctrl-C ends it"), flush=True)
    server.run_until_shutdown()


class Page:
    """The view of one result in one browser window. `layout` is what panel serves.

    `location`, where there is one, is the address of the window: it says where the controls stand, so that a link to
    it restores the view.
    """

    def __init__(self, dataset: xr.Dataset, name: str, location: Any = None) -> None:
        self.location, values, even = location, ["value", "local exponent"], evened(dataset)
        if even is not dataset:
            title = f"{dataset.attrs.get('title') or name}: straight lines between its {dataset['status'].size:,} cells"
            even, values = even.assign_attrs(title=title), ["value"]  # straight lines have no exponent
        names, select = [name for name in outputs(even) if lines_of(even[name])], pn.widgets.Select
        self.dataset = even
        if not names:
            raise SweepError(f"{name}: there is nothing to show: no output varies along an axis of numbers")
        self.output = select(label="output", options=names, value=preferred(even, names), **WIDE)
        self.shows = pn.widgets.RadioButtonGroup(options=values, **WIDE)
        self.x = select(label="across the page", options=number_axes(even, self.output.value), **WIDE)
        self.up = select(label="up the page", **WIDE)
        scales = ["auto", "linear", "log"]
        self.scales = {key: select(label=text, options=scales, min_width=70, **WIDE) for key, text in SCALED.items()}
        self.statuses = pn.widgets.Checkbox(label="mark cells that are not OK", value=True)
        self.sliders: dict[str, Any] = {}
        self.slider_box = pn.Column(**WIDE)
        self.pane, self.note, self.legend, self.table = pn.pane.Bokeh(**WIDE), _html(), _html(), _html()
        stem = name.rpartition(".")[0] or name
        self.saves = {
            suffix: pn.widgets.FileDownload(
                callback=partial(lambda make: make(self.dataset, self.choice), make),
                filename=f"{stem}_shown.{suffix}", label=suffix.upper(), min_width=70, **WIDE,
            ) for suffix, make in FILES.items()
        }  # fmt: skip
        self.found: View | None = None
        self.picture: Picture | None = None
        self.key: tuple[Any, ...] = ()
        self._offer()
        for control in (self.output, self.x, self.up):
            control.param.watch(lambda _: self._offer(), "value")
        for control in (self.shows, self.statuses, *self.scales.values()):
            control.param.watch(lambda _: self._redraw(), "value")
        self._link({"output": self.output, "x": self.x, "up": self.up, "shows": self.shows, "marks": self.statuses})
        self._link({f"scale_{key}": widget for key, widget in self.scales.items()})
        scales_row, saves = (pn.Row(*widgets.values(), **WIDE) for widgets in (self.scales, self.saves))
        controls = (self.output, self.shows, self.x, self.up, self.slider_box, scales_row, self.statuses, saves)
        left = pn.Column(*controls, styles={"flex": "1 1 280px", "min-width": "min(100%, 280px)"})
        seen = (self.note, self.pane, self.legend, self.table)
        right = pn.Column(*seen, styles={"flex": "3 1 340px", "min-width": "min(100%, 340px)"})
        title = html.escape(str(even.attrs.get("title") or name))
        head = _html(f"<h2 style='margin:4px 0'>{title}</h2>{html.escape(name)}")
        box = pn.FlexBox(left, right, styles={"max-width": "calc(100vw - 16px)"}, **WIDE)
        self.layout = pn.Column(head, box, stylesheets=[STYLE], **WIDE)

    def _link(self, widgets: Mapping[str, Any]) -> None:
        """Controls that the address of the window keeps; what it says that they cannot show is left aside."""
        for name, widget in widgets.items() if self.location is not None else ():
            wanted = self.location.query_params.get(name, widget.value)
            options = getattr(widget, "values", None) or [*getattr(widget, "options", (True, False))]
            if wanted not in options:
                self.location.update_query(**{name: widget.value})
            self.location.sync(widget, {"value": name})

    @property
    def choice(self) -> Choice:
        """What the controls say."""
        up = None if self.up.value == ONE_LINE else self.up.value
        held = {dim: int(slider.value) for dim, slider in self.sliders.items()}
        ranges = self.picture.ranges if self.picture else (None, None)
        return Choice(self.output.value, self.x.value, up, held, self.shows.value != "value", *ranges)

    def _offer(self) -> None:
        """The axes of the output, and sliders for those that are not in the picture; what is chosen stays if it can."""
        axes = number_axes(self.dataset, self.output.value)
        self.x.param.update(options=axes, value=self.x.value if self.x.value in axes else axes[0])
        axes = [*other_axes(self.dataset, self.choice), ONE_LINE]
        self.up.param.update(options=axes, value=self.up.value if self.up.value in axes else axes[0])
        choice, before = self.choice, self.sliders
        self.sliders = {}
        for dim in (dim for dim in other_axes(self.dataset, choice) if dim != choice.across):
            column = coordinate(self.dataset[choice.output], dim)
            unit = str(column.attrs.get("units", ""))
            texts = [f"{value:.4g}" if column.dtype.kind in "fiu" else str(value) for value in column.values]
            texts = [text if unit in ("", "1") else f"{text} {unit}" for text in texts]
            options = {f"{i}: {text}" if column.size > 1 else text: i - 1 for i, text in enumerate(texts, 1)}
            place = int(before[dim].value) if dim in before else column.size // 2
            kind = pn.widgets.DiscreteSlider if column.size > 1 else pn.widgets.Select
            self.sliders[dim] = slider = kind(label=dim, options=options, value=place, **WIDE)
            slider.param.watch(lambda _: self._redraw(), "value")
        if self.location is not None:
            for slider in before.values():
                self.location.unsync(slider)
        self._link({f"at_{dim}": slider for dim, slider in self.sliders.items()})
        self.slider_box[:] = list(self.sliders.values())
        self._redraw()

    def _redraw(self) -> None:
        """Reads the slice in view and draws it; makes a new figure where axes or scales have changed."""
        choice, scales = self.choice, {name: widget.value for name, widget in self.scales.items()}
        key = (choice.output, choice.x, choice.across, choice.exponent, *scales.values())
        try:
            found = shown(self.dataset, choice if key == self.key else replace(choice, x_range=None, y_range=None))
        except SweepError as error:
            self.note.object = f"<b>{html.escape(str(error))}</b>"
            return
        if key != self.key or self.picture is None:
            self.picture, self.key = Picture(found, scales), key
            self.picture.figure.on_event(RangesUpdate, lambda _: self._redraw())
            self.picture.figure.on_event(Tap, lambda event: self._click(event.x, event.y))
            self.pane.object = self.picture.figure
        self.found, self.note.object = found, ""
        self.picture.show(found, self.statuses.value)
        self.legend.object = _legend(found) if self.statuses.value else ""
        # what cannot be saved of this slice is grey
        choice = self.choice
        self.saves["csv"].disabled = region.part(self.dataset, choice)[choice.output].size > MOST_ROWS
        try:
            region.study_text(self.dataset, choice)
            self.saves["toml"].disabled = False
        except SweepError:
            self.saves["toml"].disabled = True

    def _click(self, x: float | None, y: float | None) -> None:
        """Shows the row of a cell that was clicked, and a cross on it."""
        cell = None if x is None or y is None or self.picture is None else self.picture.choose(x, y)
        if cell and (found := self.found):
            column = found.y.coords
            dims = zip((found.across, found.along), cell, strict=True)
            places = {dim: int(column[region.PLACE + dim][i]) for dim, i in dims if dim is not None}
            self.table.object = Table(row(self.dataset, {**self.choice.held, **places})).html()


FILES: dict[str, Callable[[xr.Dataset, Choice], BytesIO]] = {
    "png": region.picture,
    "csv": region.table,
    "toml": lambda dataset, choice: BytesIO(region.study_text(dataset, choice).encode()),
}
"""Kinds of file that the page can save."""


def _html(text: str = "") -> Any:
    return pn.pane.HTML(text, stylesheets=[STYLE], **WIDE)


def _legend(found: View) -> str:
    """What the colours of statuses mean, with how many cells in view have each."""
    lines = []
    for code in found.codes():
        name, count = found.name(code), int((found.status == code).sum())
        doc = Status[name].doc if name in Status.__members__ else ""
        chip = f'<span class="chip" style="background:{found.colour(code)}"></span>'
        lines.append(f"<div>{chip}{html.escape(name)}, {count:,} shown: {html.escape(doc)}</div>")
    return "".join(lines)
