"""The page: controls, the picture they change, the row of a cell that is clicked; served to this machine alone."""

from __future__ import annotations

import html
import os
import re
import socket
from collections.abc import Callable, Mapping
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kernels.interface import Status
from sweep.errors import SweepError, missing
from sweep.file.open import open_result
from sweep.show.view import coordinate, evened, preferred, setting
from sweep.view import region
from sweep.view.region import Choice, along, nearest, number_axes, other_axes, outputs, row, shown
from sweep.words import Table

try:
    import panel as pn
    from bokeh.events import RangesUpdate, Tap
    from tornado.web import ErrorHandler

    from sweep.view.picture import Picture, status_colour
except ImportError:
    raise missing("the viewer needs panel", "view") from None

if TYPE_CHECKING:
    import xarray as xr

    from sweep.show.view import View

ADDRESS = "127.0.0.1"
"""Nobody on another machine can reach it."""
OTHER_HOSTS = rf"(?!({re.escape(ADDRESS)}|localhost|\[::1\])$).*"
"""Names of this server that no browser of its user knows: a page from elsewhere asks for it by one of its own."""
ONE_LINE = "(one line)"
SCALED = {"x": "scale across", "y": "scale up", "values": "values"}
WIDE = {"sizing_mode": "stretch_width"}
FRAME = """
{% extends base %}
{% block preamble %}<meta name="viewport" content="width=device-width, initial-scale=1">{% endblock %}
{% block contents %}{{ embed(roots.page) }}{% endblock %}
"""
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
    print(f"http://{ADDRESS}:{server.port}/ shows {result}; Ctrl-C ends it", flush=True)
    server.run_until_shutdown()


class Page:
    """The view of one result in one browser window. `layout` is what panel serves.

    `location`, where there is one, is the address of the window: it says where the controls stand, so that a link to
    it restores the view.
    """

    def __init__(self, dataset: xr.Dataset, name: str, location: Any = None) -> None:
        self.name, self.location, values, even = name, location, ["value", "local exponent"], evened(dataset)
        if even is not dataset:
            title = f"{dataset.attrs.get('title') or name}: straight lines between its {dataset['status'].size:,} cells"
            even, values = even.assign_attrs(title=title), ["value"]  # straight lines have no exponent
        self.dataset = dataset = even
        names = outputs(dataset)
        if not names:
            raise SweepError(f"{name}: there is nothing to look at: no output runs along an axis of numbers")
        select = pn.widgets.Select
        self.output = select(label="output", options=names, value=preferred(names), **WIDE)
        self.shows = pn.widgets.RadioButtonGroup(options=values, **WIDE)
        self.x = select(label="across the page", options=number_axes(dataset, self.output.value), **WIDE)
        self.up = select(label="up the page", **WIDE)
        self.scales = {
            key: select(label=text, options=["auto", "linear", "log"], min_width=70, **WIDE)
            for key, text in SCALED.items()
        }
        self.statuses = pn.widgets.Checkbox(label="mark cells that are not OK", value=True)
        self.sliders: dict[str, Any] = {}
        self.saves = {suffix: self._save(suffix, make) for suffix, make in FILES.items()}
        self.slider_box = pn.Column(**WIDE)
        self.pane, self.note, self.legend, self.table = pn.pane.Bokeh(**WIDE), _html(), _html(), _html()
        self.found: View | None = None
        self.picture: Picture | None = None
        self.key: tuple[Any, ...] = ()
        self._choose_output()
        self.output.param.watch(lambda _: self._choose_output(), "value")
        self.x.param.watch(lambda _: self._choose_x(), "value")
        self.up.param.watch(lambda _: self._make_sliders(), "value")
        for control in (self.shows, self.statuses, *self.scales.values()):
            control.param.watch(lambda _: self._redraw(), "value")
        self._link({"output": self.output, "x": self.x, "up": self.up, "shows": self.shows, "marks": self.statuses})
        self._link({f"scale_{key}": widget for key, widget in self.scales.items()})
        self.layout = self._layout()

    def _layout(self) -> Any:
        scales, saves = (pn.Row(*widgets.values(), **WIDE) for widgets in (self.scales, self.saves))
        controls = pn.Column(
            self.output, self.shows, self.x, self.up, self.slider_box, scales, self.statuses, saves,
            styles={"flex": "1 1 280px", "min-width": "min(100%, 280px)"},
        )  # fmt: skip
        styles = {"flex": "3 1 340px", "min-width": "min(100%, 340px)"}
        seen = pn.Column(self.note, self.pane, self.legend, self.table, styles=styles)
        title = html.escape(str(self.dataset.attrs.get("title") or self.name))
        head = _html(f"<h2 style='margin:4px 0'>{title}</h2>{html.escape(self.name)}")
        box = pn.FlexBox(controls, seen, styles={"max-width": "calc(100vw - 16px)"}, **WIDE)
        frame = pn.Template(FRAME)
        frame.add_panel("page", pn.Column(head, box, stylesheets=[STYLE], **WIDE))
        return frame

    def _save(self, suffix: str, make: Any) -> Any:
        return pn.widgets.FileDownload(
            callback=lambda: make(self.dataset, self.choice), label=suffix.upper(), min_width=70,
            filename=f"{self.name.rpartition('.')[0] or self.name}_shown.{suffix}", **WIDE,
        )  # fmt: skip

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

    def _choose_output(self) -> None:
        """Another output may have other axes; those that are chosen stay if it has them."""
        axes = number_axes(self.dataset, self.output.value)
        before, self.x.options = self.x.value, axes
        if before not in axes:
            self.x.value = axes[0]
        self._choose_x()

    def _choose_x(self) -> None:
        others = other_axes(self.dataset, Choice(self.output.value, self.x.value))
        before, self.up.options = self.up.value, [*others, ONE_LINE]
        self.up.value = before if before in self.up.options else self.up.options[0]
        self._make_sliders()

    def _make_sliders(self) -> None:
        choice, before = self.choice, self.sliders
        self.sliders = {}
        for dim in (dim for dim in other_axes(self.dataset, choice) if dim != choice.across):
            column, size = coordinate(self.dataset[choice.output], dim), self.dataset.sizes[dim]
            # one value without its name; signs of formulas are for print
            texts = [setting(value).partition(" = ")[2] for value in column]
            texts = [text.replace("$", "").replace("^{", "^").replace("}", "") for text in texts]
            options = {f"{i + 1}: {text}" if size > 1 else text: i for i, text in enumerate(texts)}
            place = int(before[dim].value) if dim in before else size // 2
            kind = pn.widgets.DiscreteSlider if size > 1 else pn.widgets.Select
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
        self.saves["csv"].disabled = region.rows(self.dataset, self.choice) > region.MOST_ROWS
        try:
            region.study_text(self.dataset, self.choice)
            self.saves["toml"].disabled = False
        except SweepError:
            self.saves["toml"].disabled = True

    def _click(self, x: float | None, y: float | None) -> None:
        """Shows the row of a cell that was clicked, and a cross on it."""
        choice, found, picture = self.choice, self.found, self.picture
        places = None if x is None or y is None or not found or not picture else nearest(found, x, y, picture.log)
        if places is None or y is None or picture is None:
            return
        dataset, at = self.dataset, {**choice.held, **places}
        if picture.mapped:
            up = coordinate(dataset[choice.output], str(choice.across))[places[str(choice.across)]]
        else:
            up = dataset[choice.output].isel(at)
        height = y if choice.exponent and not picture.mapped else float(up)
        picture.mark(float(dataset[choice.x][places[along(dataset, choice.x)]]), height)
        self.table.object = Table(row(dataset, at)).html()


FILES: dict[str, Callable[[xr.Dataset, Choice], BytesIO]] = {
    "png": region.picture,
    "csv": region.table,
    "toml": lambda dataset, choice: BytesIO(region.study_text(dataset, choice).encode()),
}
"""What can be saved of what is shown."""


def _html(text: str = "") -> Any:
    return pn.pane.HTML(text, stylesheets=[STYLE], **WIDE)


def _legend(found: View) -> str:
    """What the colours of statuses mean, with how many cells in view have each."""
    lines = []
    for code in found.codes():
        name, count = found.meanings.get(code, str(code)), int((found.status == code).sum())
        doc = Status[name].doc if name in Status.__members__ else ""
        chip = f'<span class="chip" style="background:{status_colour(found, code)}"></span>'
        lines.append(f"<div>{chip}{html.escape(name)}, {count:,} shown: {html.escape(doc)}</div>")
    return "".join(lines)
