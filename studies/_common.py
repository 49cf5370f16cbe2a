"""What the scripts of the studies share: opening a result, and the table of statements; `_figures` has their figures.

A script `<question>.py` stands beside its `<question>.toml`, reads the dataset that `sweep run` made of it, prints what
theory says beside what comes out, and draws `<question>.png` beside the dataset.
"""

from __future__ import annotations

import re
import sys
import textwrap
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from _figures import charts

import sweep
from kernels.interface import Status
from sweep.file.disk import check_target


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
Conclusion = tuple[Groups, list[str], Callable[[], Any]]
"""What a script concludes: statements, further lines of text, and what draws the figure."""


def compared(what: str, theory: str, here: Any, value: float, allowed: float, digits: int = 8) -> Statement:
    """A number beside what theory says; it holds if the relative deviation is at most `allowed`."""
    off = float(here) / value - 1
    return Statement(what, theory, f"{float(here):.{digits}g}", off, bool(abs(off) <= allowed))


def differing(what: str, theory: str, here: Any, value: float, allowed: float, digits: int = 8) -> Statement:
    """As `compared`, of exponents and what else may be 0: the deviation is the difference."""
    off = float(here) - value
    return Statement(what, theory, f"{float(here):.{digits}g}", off, bool(abs(off) <= allowed))


def said(what: str, holds: Any, here: str = "", theory: str = "", refuted: bool = False) -> Statement:
    """What holds or does not, without a number that it deviates by."""
    return Statement(what, theory, here, None, bool(holds), refuted)


def all_ok(ds: xr.Dataset) -> Statement:
    """Whether every cell is OK."""
    share = float((ds.status == Status.OK).mean())
    return said("cells that are OK", share == 1.0, f"{share:.0%}", "all")


def most(what: str, theory: str, off: Any, allowed: float, here: str = "largest deviation") -> Statement:
    """A deviation, or the largest of many, missing cells left out; it holds if that is at most `allowed`."""
    worst = float(off) if np.ndim(off) == 0 else float(abs(off).max())
    return Statement(what, theory, here, worst, abs(worst) <= allowed)


def count(there: Any, what: str = "cells") -> str:
    """How many are true, or have a value: "12 cells"."""
    return f"{int((there if there.dtype == bool else there.notnull()).sum())} {what}"


KEYS = ("method", "rtol", "outputs", "design", "along")


def solved(kernel: str, **given: Any) -> xr.Dataset:
    """A sweep in memory, by keys of a study and parameters: those that are sequences are axes, numbers are fixed."""
    keys = {name: given.pop(name) for name in KEYS if name in given}
    axes = {name: np.asarray(values) for name, values in given.items() if np.ndim(values)}
    fixed = {name: float(value) for name, value in given.items() if not np.ndim(value)}
    return sweep.run(sweep.study(kernel=kernel, axes=axes, fixed=fixed, allow_import=":" in kernel, **keys))


def last_passage(x: Any, y: Any, value: float, way: float = 0.0) -> float:
    """Where y passes a value last, upwards (`way` 1) or downwards (-1) if so said; NaN where it does not."""
    log_x, y = np.log(np.asarray(x)), np.asarray(y)
    cross = (y[:-1] - value) * (y[1:] - value) <= 0
    there = np.flatnonzero(cross & (y[1:] != y[:-1]) & (way * (y[1:] - y[:-1]) >= 0))
    if not there.size:
        return float("nan")
    i = there[-1]
    return float(np.exp(log_x[i] + (value - y[i]) / (y[i + 1] - y[i]) * (log_x[i + 1] - log_x[i])))


def power(y: xr.DataArray) -> float:
    """The exponent of a line over its one dimension, by least squares."""
    return float(np.polyfit(np.log(y[y.dims[0]]), np.log(abs(y)), 1)[0])


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
    conclude: Callable[..., Conclusion],
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

    def concluded() -> Conclusion:
        groups, notes, draw = conclude(*arguments)
        return groups, [*notes, "", *what_came_out(Path(script).stem)], draw

    return shown(Path(arguments[0]).with_suffix(".png"), concluded, force, source)


def what_came_out(name: str) -> list[str]:
    """The closing paragraph of a study as it is shipped: its row of the page "What came out", if that is there."""
    page = Path(__file__).parents[1] / "docs" / "what_came_out.md"
    for row in page.read_text(encoding="utf-8").splitlines() if page.exists() else ():
        if row.startswith(f"| `{name}` |"):
            _, _, question, answer, checked, _ = row.split("|")
            text = f"As shipped: {question} {answer} How it was checked, and its limits: {checked}"
            return paragraph(re.sub(r"\[(.+?)\]\(.+?\)", r"\1", text))
    return []


def script(name: str, inputs: str, conclude: Callable[..., Conclusion], source: str = "theory") -> Callable[..., int]:
    """`main` of the script that concludes so, with its inputs as `report` has them; it runs if `name` is "__main__"."""
    main = partial(report, conclude.__code__.co_filename, inputs.split(), conclude=conclude, source=source)
    if name == "__main__":
        sys.exit(main(sys.argv[1:]))
    return main


def shown(target: Path, conclude: Callable[[], Conclusion], force: bool, source: str = "theory") -> int:
    """Prints what is concluded and saves its figure; the exit status of `report`."""
    try:
        check_target(target, force=force)
        groups, notes, draw = conclude()
        page = draw()
        print("\n".join([*table(groups, source), "", *notes, ""]))
        print(f"figure: {charts.save(page, target)}")
    except sweep.SweepError as error:
        print(error, file=sys.stderr)
        return 2
    return int(any(s.failed for lines in groups.values() for s in lines))


def paragraph(text: str) -> list[str]:
    """Running text as lines of 118 characters."""
    return textwrap.wrap(" ".join(text.split()), 118)
