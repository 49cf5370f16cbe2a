"""What the scripts of the studies share: results, statements and their table; `_figures` has what figures share.

A script `<question>.py` stands beside its `<question>.toml`. Its head has the question and the theory; `claims` yields
headings and statements about the result that `sweep run` made, and `figure` draws `<question>.png` beside it. `script`
makes a program of these.
"""

import math
import operator
import re
import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
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
    allowed : the bound that is checked: the largest deviation, "of it" where that is relative, or what the value is in
    """

    what: str
    paper: str
    here: str
    off: float | None = None
    holds: bool | None = None
    refuted: bool = False
    allowed: str = ""

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

    @property
    def deviation(self) -> str:
        """The deviation as text."""
        return "" if self.off is None else f"{self.off:+.1e}"


Claims = Iterator[Statement | str]
"""What a script says: headings, and the statements below each."""
Groups = dict[str, list[Statement]]
"""Statements by heading."""
OPTIONS = ("--all", "--force")
"""Of every script."""
NUMBER = re.compile(r"-?[\d.]+(?:e[-+]?\d+)?(?:/\d+)?")
ORDER = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
STUDIES = Path(__file__).parent
DAY = 86400.0  # seconds


def digits(allowed: float) -> int:
    """How many a number is shown with that may deviate by so much."""
    return min(max(2 - math.floor(math.log10(allowed)), 4), 14)


def compared(what: str, theory: str, here: Any, value: float, allowed: float) -> Statement:
    """A number beside what theory says; it holds if the relative deviation is at most `allowed`."""
    off, shown = float(here) / value - 1, f"{float(here):.{digits(allowed)}g}"
    return Statement(what, theory, shown, off, abs(off) <= allowed, allowed=f"{allowed:.2g} of it")


def differing(what: str, theory: str, here: Any, value: float, allowed: float, refuted: bool = False) -> Statement:
    """As `compared`, of exponents and what else may be 0: the deviation is the difference."""
    off, shown = float(here) - value, f"{float(here):.{digits(allowed)}g}"
    return Statement(what, theory, shown, off, abs(off) <= allowed, refuted, f"{allowed:.2g}")


def most(what: str, theory: str, off: Any, allowed: float, here: str = "largest deviation") -> Statement:
    """A deviation, or the largest of many, missing cells left out; it holds if that is at most `allowed`."""
    worst = float(off) if np.ndim(off) == 0 else float(abs(off).max())
    return Statement(what, theory, here, worst, abs(worst) <= allowed, allowed=f"{allowed:.2g}")


def said(what: str, holds: Any, here: str = "", theory: str = "", refuted: bool = False) -> Statement:
    """What holds or does not, without a number that it deviates by."""
    return Statement(what, theory, here, None, bool(holds), refuted)


def held(what: str, here: Any, bound: str, form: str = "{:.3g}", theory: str = "", refuted: bool = False) -> Statement:
    """A number within what the text says, which is what is checked: "< 1 %", ">= 1/2", "3 to 5", or "0" itself."""
    sign, unit, value = bound.split()[0], 0.01 if "%" in bound else 1.0, float(here)
    ends = [unit * float(Fraction(number)) for number in NUMBER.findall(bound)]
    holds = ORDER[sign](value, ends[0]) if sign in ORDER else ends[0] <= value <= ends[-1]
    return Statement(what, theory, form.format(value), None, holds, refuted, bound)


def never(what: str, there: Any, theory: str = "none") -> Statement:
    """That something is so in none of many cells."""
    return held(what, np.sum(there), "0", f"{{:.0f}} of {np.size(there)}", theory)


def all_ok(ds: xr.Dataset) -> Statement:
    """Whether every cell is OK."""
    return held("cells that are OK", (ds.status == Status.OK).mean(), "100 %", "{:.0%}", "all")


def nearest(values: xr.DataArray, value: float) -> Any:
    """Where values come nearest to one; for `isel`."""
    return abs(values - value).argmin(...)


def by_method(ds: xr.Dataset) -> dict[str, xr.Dataset]:
    """The part of each method."""
    return {str(name): ds.sel({"method": name}) for name in ds["method"].values}


def count(there: Any, what: str = "cells") -> str:
    """How many are true, or have a value: "12 cells"."""
    return f"{int((there if there.dtype == bool else there.notnull()).sum())} {what}"


KEYS = ("method", "rtol", "outputs", "design", "along")


def solved(kernel: str, **given: Any) -> xr.Dataset:
    """A sweep in memory, by keys of a study and parameters: sequences are axes, numbers and words are fixed."""
    keys = {name: given.pop(name) for name in KEYS if name in given}
    axes = {name: np.asarray(values) for name, values in given.items() if np.ndim(values)}
    fixed = {name: x if isinstance(x, str) else float(x) for name, x in given.items() if not np.ndim(x)}
    return sweep.run(sweep.study(kernel=kernel, axes=axes, fixed=fixed, allow_import=":" in kernel, **keys))


def last_passage(x: Any, y: Any, value: float, way: float = 0.0) -> float:
    """Where y passes a value last, upwards (`way` 1) or downwards (-1) if so said; NaN where it does not."""
    log_x, y = np.log(np.asarray(x)), np.asarray(y)
    rise = np.diff(y)
    there = np.flatnonzero(((y[:-1] - value) * (y[1:] - value) <= 0) & (rise != 0) & (way * rise >= 0))
    if not there.size:
        return math.nan
    i = there[-1]
    return float(np.exp(log_x[i] + (value - y[i]) / rise[i] * (log_x[i + 1] - log_x[i])))


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
    worst, seconds = np.transpose(rows)
    return xr.Dataset({"worst": ("rtol", worst), "seconds": ("rtol", seconds)}, {"rtol": list(tolerances)})


def solved_by(kernel: Any, method: str, rtol: float, **given: Any) -> tuple[Any, Any]:
    """The first output of cells by the kernel's own function, without the engine, and their statuses."""
    shape = np.broadcast_shapes(*map(np.shape, given.values()))
    columns = [np.broadcast_to(given.get(p.name, p.default), shape).astype(float) for p in kernel.parameters]
    by, outputs, status = kernel.method(method), [np.empty(shape) for _ in kernel.outputs], np.empty(shape, np.int8)
    asked, error = ([np.ones(len(outputs), np.uint8)], [np.empty(shape)]) if by.estimates else ([], [])
    by.solve(*columns, np.full(shape, rtol), *asked, *outputs, *error, status)
    return outputs[0], status


def columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows as lines of text with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def table(groups: Groups, source: str) -> list[str]:
    """Every statement with its numbers, "`source`  here", and what is allowed."""
    rows = [("", source, "here", "deviation", "allowed", "holds")]
    for heading, lines in groups.items():
        rows += [("",) * 6, (heading.upper(), *[""] * 5)]
        rows += [(s.what, s.paper, s.here, s.deviation, s.allowed, s.verdict) for s in lines]
    return columns(rows)


def summary(groups: Groups, source: str) -> list[str]:
    """How many claims hold, part by part, and those that do not hold, in 79 columns."""
    rows, others, subject = [(f"claims, compared with {source}", "hold")], [""], ""
    for heading, lines in groups.items():
        checked = [s for s in lines if s.holds is not None]
        if checked:
            rows.append((heading, f"{sum(s.verdict == 'yes' for s in checked)} of {len(checked)}"))
        subject = ""
        for s in lines:
            subject = subject if s.what.startswith(" ") else s.what
            if s.verdict in ("NO", "no, known"):
                what = ", ".join(filter(None, dict.fromkeys((subject, s.what.strip()))))
                which = "does not hold" if s.failed else "known not to hold"
                numbers = (s.here, s.deviation and f"deviation {s.deviation}", s.allowed and f"allowed {s.allowed}")
                words = f"{which}: {what}; {source}: {s.paper or '-'}; here: {', '.join(filter(None, numbers))}"
                others += textwrap.wrap(words, 79, subsequent_indent="    ")
    return [*columns(rows), *others]


def study_of(name: str) -> Any:
    """The study whose result, as it is or refined, has this name."""
    return sweep.study(STUDIES / f"{Path(name).stem.removesuffix('_fine')}.toml", allow_import=True)


def run_of(name: str) -> str:
    """The command that makes the result of this name."""
    options = " --allow-import" * (":" in study_of(name).kernel_name)
    return f"sweep run studies/{Path(name).stem.removesuffix('_fine')}.toml{options}"


def read_result(path: str, name: str) -> xr.Dataset:
    """The finished result of this name, in memory. Raises SweepError where it is of another kernel or other axes."""
    study, ds = study_of(name), sweep.open_result(path, strict=True)
    dims = tuple(study.grid_shape)[: -len(study.summary.over) if study.summary else None]
    there = next(iter(ds.data_vars.values())).dims if study.summary else ds.status.dims
    if ds.attrs.get("kernel") != study.kernel_name or (there != dims and "_fine" not in name):
        over = " and ".join(dims) + (" alone" if len(dims) == 1 else "")
        raise sweep.SweepError(f"{path} is not a sweep of {study.kernel_name} over {over}; make it by {run_of(name)}")
    return ds.load()


def grouped(claims: Claims) -> Groups:
    """Statements by the heading before them."""
    found: Groups = {}
    for one in claims:
        if isinstance(one, str):
            lines = found.setdefault(one, [])
        else:
            lines.append(one)
    return found


@dataclass(frozen=True)
class Script:
    """A program that prints what a study concludes from its results, and saves its figure beside the first of them.

    How many claims hold, and which do not, is printed by default; with `--all` each with its numbers, below the head
    of the script. A figure that is there is replaced with `--force` alone.

    Parameters
    ----------
    file, head : path of the script, and its docstring
    inputs : names of the results that it takes, each of the study file of that name; or of what else it takes
    claims, figure : statements, and a figure, of what `prepared` makes of the results
    prepared : by default, the results as they are
    notes : further results as lines of text, of the same
    source : heading of what the numbers are compared with
    """

    file: str
    head: str
    inputs: tuple[str, ...]
    claims: Callable[..., Claims]
    figure: Callable[..., Any]
    prepared: Callable[..., Any] = lambda *results: results
    notes: Callable[..., list[str]] = lambda *_: []
    source: str = "theory"

    def conclude(self, *paths: str, **options: Any) -> tuple[Groups, list[str], Callable[[], Any]]:
        """Statements, notes and what draws the figure, from the results at these paths."""
        asked = zip(paths, self.inputs, strict=True)
        given = [read_result(path, name) if name.endswith(".h5") else path for path, name in asked]
        found = self.prepared(*given, **options)
        made = found if isinstance(found, tuple) else (found,)
        return grouped(self.claims(*made)), self.notes(*made), lambda: self.figure(*made)

    def __call__(self, arguments: Sequence[str]) -> int:
        """Exit status: 1 if a statement does not hold, 2 if the results are not there or not of this study."""
        paths, helped = [argument for argument in arguments if argument not in OPTIONS], "--help" in arguments
        if helped or len(paths) != len(self.inputs):
            use = f"use: python {Path(self.file).name} {' '.join(self.inputs)} [{'] ['.join(OPTIONS)}]"
            lines = [use, *(run_of(name) for name in self.inputs if name.endswith(".h5"))]
            print(*[self.head] * helped, *lines, sep="\n", file=sys.stdout if helped else sys.stderr)
            return 0 if helped else 2
        return self.report(arguments, lambda: self.conclude(*paths))

    def report(self, arguments: Sequence[str], conclude: Callable[[], Any]) -> int:
        """Prints what is concluded and saves the figure beside the first of the results."""
        target = next(Path(one) for one in arguments if one not in OPTIONS).with_suffix(".png")
        complete = "--all" in arguments
        try:
            check_target(target, force="--force" in arguments)
            groups, notes, draw = conclude()
            page = draw()
            said = table(groups, self.source) if complete else summary(groups, self.source)
            parts = [[self.head] * complete, said, notes, what_came_out(Path(self.file).stem)]
            print("\n\n".join(filter(None, ("\n".join(lines).strip("\n") for lines in parts))), end="\n\n")
            print(f"figure: {charts.save(page, target)}" + "; every claim with its numbers: --all" * (not complete))
        except sweep.SweepError as error:
            print(error, file=sys.stderr)
            return 2
        return int(any(s.failed for lines in groups.values() for s in lines))


def what_came_out(name: str) -> list[str]:
    """The closing paragraph of a study as it is shipped: its row of the page "What came out", if that is there."""
    page = STUDIES.parent / "docs" / "what_came_out.md"
    for row in page.read_text(encoding="utf-8").splitlines() if page.exists() else ():
        if row.startswith(f"| `{name}` |"):
            _, _, question, answer, checked, _ = row.split("|")
            text = f"Recorded answer, default study. {question} {answer} How it was checked, and its limits: {checked}"
            return textwrap.wrap(" ".join(re.sub(r"\[(.+?)\]\(.+?\)", r"\1", text).split()), 79)
    return []


def script(name: str, inputs: str, *parts: Callable[..., Any], **more: Any) -> Script:
    """`main` of the script of this name, of `parts` as `Script` has them; it runs if the name is "__main__"."""
    module = sys.modules[name]
    main = Script(str(module.__file__), str(module.__doc__), tuple(inputs.split()), *parts, **more)
    if name == "__main__":
        sys.exit(main(sys.argv[1:]))
    return main
