"""What the scripts of the studies share: opening a result, the table of statements, and the look of their figures.

A script `<question>.py` stands beside its `<question>.toml`, reads the dataset that `sweep run` made of it, prints what
theory says beside what comes out, and draws `<question>.png` beside the dataset.
"""

from __future__ import annotations

import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import sweep
from sweep.file.overwriting import check_target

try:
    from sweep.show import charts
except sweep.SweepError as error:  # no matplotlib
    sys.exit(str(error))


@dataclass(frozen=True)
class Statement:
    """One line of the table.

    Parameters
    ----------
    what, paper, here : what is compared, what the source or theory says of it, and what comes out
    off : deviation
    holds : whether it is as said, by a check that can fail; None: a value, of which nothing is said
    refuted : it is known not to be as the source says, and would be a mistake here if it were
    """

    what: str
    paper: str
    here: str
    off: float | None = None
    holds: bool | None = None
    refuted: bool = False

    @property
    def failed(self) -> bool:
        """Whether it came out otherwise than it must."""
        return self.holds is not None and bool(self.holds) == self.refuted

    @property
    def verdict(self) -> str:
        """The last column."""
        if self.holds is None:
            return ""
        return "NO" if self.failed else "no, known" if self.refuted else "yes"


Groups = dict[str, list[Statement]]
"""Statements by heading."""


def compared(what: str, theory: str, here: float, value: float, allowed: float, digits: int = 8) -> Statement:
    """A number beside what theory says; it holds if the relative deviation is at most `allowed`."""
    off = here / value - 1
    return Statement(what, theory, f"{here:.{digits}g}", off, bool(abs(off) <= allowed))


def differing(what: str, theory: str, here: float, value: float, allowed: float, digits: int = 8) -> Statement:
    """As `compared`, of exponents and what else may be 0: the deviation is the difference."""
    off = here - value
    return Statement(what, theory, f"{here:.{digits}g}", off, bool(abs(off) <= allowed))


def cheapest(found: dict[str, xr.Dataset]) -> list[Statement]:
    """Time per cell for a worst cell right to 1e-4, 1e-7, 1e-9."""
    lines = []
    for name, row in found.items():
        enough = [row.seconds.where(row.worst <= wanted) for wanted in (1e-4, 1e-7, 1e-9)]
        texts = ["-" if bool(s.isnull().all()) else f"{1e6 * float(s.min()):.3g}" for s in enough]
        lines.append(Statement(f"{name}: us a cell, worst right to 1e-4, 1e-7, 1e-9", "", ", ".join(texts)))
    return lines


def measured(off: Callable[[float], Any], tolerances: Sequence[float]) -> xr.Dataset:
    """Over rtol: the `worst` of the errors of cells that `off` gives, infinite where one is NaN, and `seconds` a cell.

    `off` is called twice, and timed at the second call, when all is compiled.
    """
    rows = []
    for rtol in tolerances:
        off(rtol)
        begin = time.process_time()
        errors = off(rtol)
        rows.append((np.nan_to_num(errors, nan=np.inf).max(), (time.process_time() - begin) / len(errors)))
    worst, seconds = zip(*rows, strict=True)
    return xr.Dataset({"worst": ("rtol", list(worst)), "seconds": ("rtol", list(seconds))}, {"rtol": list(tolerances)})


def solved_by(kernel: Any, method: str, rtol: float, **given: Any) -> tuple[Any, Any]:
    """The first output of cells by the kernel's own function, without the engine, and their statuses."""
    shape = np.broadcast_shapes(*map(np.shape, given.values()))
    columns = [np.broadcast_to(given.get(p.name, p.default), shape).astype(float) for p in kernel.parameters]
    outputs, status = [np.empty(shape) for _ in kernel.outputs], np.empty(shape, np.int8)
    kernel.method(method).solve(*columns, np.full(shape, rtol), *outputs, status)
    return outputs[0], status


def table(groups: Groups, source: str = "paper") -> list[str]:
    """Lines of the table "`source` | here"."""
    rows: list[tuple[str, ...]] = [("", source, "here", "deviation", "holds")]
    for heading, lines in groups.items():
        rows += [("",), (heading.upper(),)]
        rows += [(s.what, s.paper, s.here, _number(s.off), s.verdict) for s in lines]
    return columns(rows, " | ")


def columns(rows: Sequence[Sequence[str]], between: str) -> list[str]:
    """Rows as lines of text with aligned columns; a row of one cell is a heading."""
    full = [row for row in rows if len(row) > 1]
    widths = [max(map(len, column)) for column in zip(*full, strict=True)]
    padded = [[cell.ljust(width) for cell, width in zip(row, widths, strict=False)] for row in rows]
    return [row[0] if len(row) == 1 else between.join(cells).rstrip() for row, cells in zip(rows, padded, strict=True)]


def _number(off: float | None) -> str:
    return "" if off is None else f"{off:+.1e}"


def read_result(path: str, kernel: str, dims: Sequence[str], toml: str) -> xr.Dataset:
    """The finished sweep of a kernel over these axes, in memory. Raises SweepError where it is none."""
    ds = sweep.open_result(path, strict=True)
    if ds.attrs.get("kernel") != kernel or ds.status.dims != tuple(dims):
        over = " and ".join(dims) + (" alone" if len(dims) == 1 else "")
        raise sweep.SweepError(f"{path} is no sweep of the {kernel} over {over}; make it from {toml}")
    return ds.load()


def report(
    script: str,
    inputs: Sequence[str],
    arguments: Sequence[str],
    conclude: Callable[..., tuple[Groups, Sequence[str], Callable[[], Any]]],
    source: str = "theory",
) -> int:
    """Prints what a study concludes from the results named, and saves its figure beside the first of them.

    A figure that is there is replaced with `--force` alone.

    Parameters
    ----------
    script : path of the script, for the line on its use
    inputs : what its arguments are called there
    conclude : gives the statements, further lines of text, and a function that draws the figure, from the paths
    source : heading of what the numbers are compared with

    Returns
    -------
    int
        Exit status: 1 if a statement does not hold, 2 if the results are not there or not of this study.
    """
    force, arguments = "--force" in arguments, [argument for argument in arguments if argument != "--force"]
    if len(arguments) != len(inputs):
        print(f"use: python {Path(script).name} {' '.join(inputs)} [--force]", file=sys.stderr)
        return 2
    try:
        target = Path(arguments[0]).with_suffix(".png")
        check_target(target, force=force)
        groups, notes, draw = conclude(*arguments)
        page = draw()
        print("\n".join([*table(groups, source), "", *notes, ""]))
        print(f"figure: {charts.save(page, target)}")
    except sweep.SweepError as error:
        print(error, file=sys.stderr)
        return 2
    return int(any(s.failed for lines in groups.values() for s in lines))


@contextmanager
def page_of(height: float, *shape: int, width: float = charts.PAGE, **how: Any) -> Iterator[tuple[Any, Any]]:
    """A figure for print of so many mm, and its panels as `subplots` gives them, lettered in the end if several."""
    with charts.style():
        page = charts.new_figure(width, height)
        panels = page.subplots(*shape, **how)
        yield page, panels
        for axes, text in zip(np.ravel(panels), "abcdefghi", strict=False) if np.size(panels) > 1 else ():
            charts.letter(axes, text)


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


def paragraph(text: str) -> list[str]:
    """Running text as lines of 118 characters."""
    return textwrap.wrap(" ".join(text.split()), 118)
