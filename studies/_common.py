"""What the scripts of the studies share: opening a result, and the table of statements; `_figures` has their figures.

A script `<question>.py` stands beside its `<question>.toml`, reads the dataset that `sweep run` made of it, compares
theory with what comes out, and draws `<question>.png` beside the dataset.
"""

import re
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
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


Claims = Iterator[Statement]
"""What a part of a script says, statement after statement: it works out numbers and yields what they are held to."""
Groups = dict[str, Iterable[Statement]]
"""Statements by heading."""
Conclusion = tuple[Groups, list[str], Callable[[], Any]]
"""What a script concludes: statements; how their table is to be read, and further results as lines of text; and what
draws the figure."""
OPTIONS = ("--all", "--force")
"""Of every script."""


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


def cheapest(found: dict[str, xr.Dataset]) -> Claims:
    """Time per cell for a worst cell right to 1e-4, 1e-7, 1e-9."""
    for name, row in found.items():
        enough = [row.seconds.where(row.worst <= wanted) for wanted in (1e-4, 1e-7, 1e-9)]
        texts = ["-" if bool(s.isnull().all()) else f"{1e6 * float(s.min()):.3g}" for s in enough]
        yield Statement(f"{name}: us a cell, worst right to 1e-4, 1e-7, 1e-9", "", ", ".join(texts))


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
    """Every statement with its numbers, "`source` | here"."""
    rows: list[tuple[str, ...]] = [("", source, "here", "deviation", "holds")]
    for heading, lines in groups.items():
        rows += [("",), (heading.upper(),)]
        rows += [(s.what, s.paper, s.here, _number(s.off), s.verdict) for s in lines]
    return columns(rows, " | ")


def summary(groups: Groups, source: str = "paper") -> list[str]:
    """How many claims hold, part by part, and those that do not hold, in 79 columns."""
    rows, others = [(f"claims held to {source}", "hold")], []
    for heading, lines in groups.items():
        subject = ""
        checked = [s for s in lines if s.holds is not None]
        rows += [(heading, f"{sum(s.verdict == 'yes' for s in checked)} of {len(checked)}")] if checked else []
        for s in lines:
            subject = s.what if s.what[:1] != " " else subject
            if s.verdict in ("NO", "no, known"):
                what = ", ".join(filter(None, dict.fromkeys((subject, s.what.strip()))))
                which = "does not hold" if s.failed else "known not to hold"
                words = f"{which}: {what}; {source}: {s.paper or '-'}; here: {s.here}"
                off = "" if s.off is None else f", deviation {_number(s.off)}"
                others += textwrap.wrap(words + off, 79, subsequent_indent="    ")
    return [*columns(rows, "  "), *([""] * bool(others)), *others]


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

    How many claims hold, and which do not, is printed by default; with `--all` each with its numbers. A figure that is
    there is replaced with `--force` alone.

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
    paths = [argument for argument in arguments if argument not in OPTIONS]
    if len(paths) != len(inputs):
        print(f"use: python {Path(script).name} {' '.join(inputs)} [{'] ['.join(OPTIONS)}]", file=sys.stderr)
        return 2
    target = Path(paths[0]).with_suffix(".png")
    return shown(Path(script).stem, target, lambda: conclude(*paths), arguments, source)


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


def shown(
    name: str, target: Path, conclude: Callable[[], Conclusion], arguments: Sequence[str], source: str = "theory"
) -> int:
    """Prints what the study of this name concludes and saves its figure; the exit status of `report`."""
    complete = "--all" in arguments
    try:
        check_target(target, force="--force" in arguments)
        found, notes, draw = conclude()
        groups = {heading: list(lines) for heading, lines in found.items()}
        page = draw()
        claims = table(groups, source) if complete else summary(groups, source)
        parts = ("\n".join(lines).strip("\n") for lines in (claims, notes[not complete :], what_came_out(name)))
        print("\n\n".join(filter(None, parts)), end="\n\n")
        print(f"figure: {charts.save(page, target)}" + "; every claim with its numbers: --all" * (not complete))
    except sweep.SweepError as error:
        print(error, file=sys.stderr)
        return 2
    return int(any(s.failed for lines in groups.values() for s in lines))


def paragraph(text: str) -> list[str]:
    """Running text as lines of 79 characters."""
    return textwrap.wrap(" ".join(text.split()), 79)
