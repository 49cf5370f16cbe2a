"""The style of all figures, fit for print: colours, empty figures, saving, and the look of each method.

The only module that imports matplotlib; `figures` takes what it draws with from here.
Nothing here uses pyplot or its global state, and equal figures are saved as equal bytes.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from sweep.errors import SweepError, missing
from sweep.file import disk

try:
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection as PolyCollection
    from matplotlib.colors import LogNorm as LogNorm
    from matplotlib.colors import Normalize as Normalize
    from matplotlib.figure import Figure as Figure
    from matplotlib.lines import Line2D as Line2D
    from matplotlib.patches import Patch as Patch
except ImportError:
    raise missing("pictures need matplotlib", "plot") from None

MILLIMETRE = 1 / 25.4
"""One millimetre in the inches of matplotlib."""
PAGE = 178.0
"""Width in mm of two columns of a physics journal."""
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
"""Okabe and Ito's colours, which colour-blind readers can distinguish, without yellow, which is too light."""
DASHES = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
"""Line styles, so that lines differ in black and white too."""
TICKS = {
    "labelsize": 8,
    "direction": "in",
    "minor.visible": True,
    "major.width": 0.6,
    "minor.width": 0.4,
}
STYLE = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.linewidth": 0.6,
    "axes.formatter.use_mathtext": True,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "lines.linewidth": 1.2,
    "lines.markersize": 4,
    **{f"{axis}tick.{key}": value for axis in "xy" for key, value in TICKS.items()},
    "xtick.top": True,
    "ytick.right": True,
    "figure.dpi": 150,
    "savefig.dpi": 300,
    "svg.hashsalt": "foliot",
    "pdf.fonttype": 42,
    "hatch.linewidth": 0.4,
}
MARKS = "osD^vPX*"
"""Markers of points that are not joined by lines."""
KINDS = (".png", ".svg", ".pdf")
"""Suffixes of figures."""
FLOOR, CEILING = 1e-16, 3.0
"""Limits of the errors that are drawn: for errors of 0, and for meaningless ones."""
FAMILIES = {
    COLOURS[6]: ("auto",),
    COLOURS[2]: ("closed", "coulomb", "pure", "asymptotic", "stable"),
    COLOURS[4]: ("quadrature", "segments", "events", "map", "waveform"),
    COLOURS[0]: ("taylor",),
    COLOURS[1]: ("dopri5",),
    COLOURS[3]: ("dop853",),
    COLOURS[5]: ("rodas5p", "sdirk4"),
    "0.6": ("euler",),
    "#8C510A": ("semi_implicit",),
    "#35978F": ("verlet",),
    "#4D4DBF": ("rk4",),
    "#A6761D": ("moreau",),
    "0.35": ("heyoka.py", "diffrax", "scipy"),
}
"""Colours of methods, the same in every figure: formulas, integrals, Taylor series, one for each integrator, textbook
steppers and other libraries; methods of one colour differ by their markers."""


def method_look(name: str, place: int = 0) -> dict[str, Any]:
    """Colour, marker and line style of a method; of one of a user's own by its place among others."""
    for colour, members in FAMILIES.items():
        if name.split()[0] in members:
            i = members.index(name.split()[0])
            marker = MARKS[(i + list(FAMILIES).index(colour)) % len(MARKS)]
            return {"color": colour, "marker": marker, "linestyle": "--" if members[-1] == "scipy" else "-"}
    return {**line_look(place), "marker": MARKS[place % len(MARKS)]}


def line_look(place: int) -> dict[str, Any]:
    """Colour and line style of a line by its place among others."""
    return {"color": COLOURS[place % len(COLOURS)], "linestyle": DASHES[place % len(DASHES)]}


def draw_precision(axes: Any, found: xr.Dataset, key: str) -> None:
    """A line for each method, with the look that `method_look` gives it.

    Filled marks where all cells are solved, open ones where some are unsolved or said to be inaccurate, crosses where
    some are silently wrong; the legend of `sweep.plot` says so. Errors below that of the reference mean nothing, and
    are drawn a little below it. A method that solves no cell is left out.
    """
    accurate = found.attrs.get("reference_error", np.nan)
    floor = max(FLOOR, accurate / 3) if np.isfinite(accurate) else FLOOR
    top = 3 * min(np.fmax.reduce(found.error_worst.values, axis=None, initial=10 * floor), CEILING)
    for i, name in enumerate(map(str, found["method"].values)):
        row, look = found.sel({"method": name}), {**method_look(name, i), "markersize": 4}
        if not np.isfinite(row.error_median).any():
            continue
        seconds, error = row.seconds.values, np.clip(row[key].values, floor, CEILING)
        whole, silent = (row.unsolved + row.inaccurate).values == 0, row.silent.values > 0
        axes.plot(seconds, error, linewidth=0.8, markevery=whole, label=name, **look)
        axes.plot(seconds[~whole], error[~whole], **{**look, "linestyle": "", "markerfacecolor": "white"})
        axes.plot(seconds[silent], error[silent], "x", color="black", markersize=7)
    if np.isfinite(accurate):
        axes.axhspan(floor / 3, max(accurate, floor), color="0.9", linewidth=0)
    axes.set(xscale="log", yscale="log", xlabel="time per cell on one core [s]", ylim=(floor / 3, top))


@contextlib.contextmanager
def style() -> Iterator[None]:
    """The look of all pictures, whatever the reader's own matplotlib settings are."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def new_figure(width: float, height: float) -> Figure:
    """Empty figure of so many millimetres; draw in it inside `style()`."""
    figure = Figure(figsize=(width * MILLIMETRE, height * MILLIMETRE), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Save as .png, .svg or .pdf; a file that is there is replaced once all is written.

    Raises
    ------
    SweepError
        If the suffix is another, or the file cannot be written.
    """
    target = Path(path)
    kind = target.suffix.lower()
    if kind not in KINDS:
        found = f'"{target.suffix}"' if target.suffix else "no suffix"
        raise SweepError(f"{target}: found {found}; a picture is one of {', '.join(KINDS)}")
    with disk.replacing(target) as part, style():
        # without a date: the same picture has the same bytes
        metadata = {".png": {"Software": "foliot"}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
        figure.savefig(part, format=kind[1:], metadata=metadata[kind])
    return target


def png(figure: Figure, dpi: int = 300) -> bytes:
    """The figure as a picture for a page."""
    store = io.BytesIO()
    with style():
        figure.savefig(store, format="png", dpi=dpi, metadata={"Software": None})
    return store.getvalue()


def letter(axes: Any, text: str) -> None:
    """Letter of a panel, in its upper left corner outside the frame."""
    axes.set_title(f"({text})", loc="left")
