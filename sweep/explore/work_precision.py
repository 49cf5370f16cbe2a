"""Work-precision charts: error and time of every method of a kernel on the same cells, in one run.

Errors are relative to true values that the caller supplies, or to a reference method: the one that solves most cells,
methods with an error bound first. The error of the reference itself is the floor below which no error is meaningful;
it is also the error that is reported for cells which the reference itself has solved, by name or by `auto`. Times are
CPU times of one core, the least of a few rounds over all methods; they are noisy, whereas errors, shares of cells and
counts of work are reproducible.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells.grid import Grid
from sweep.cells.sample import relative_error, sampled, solved
from sweep.cells.schema import METHOD_USED, STATUS, empty_cells
from sweep.cells.solve import GIVEN_UP, Solver, among, usable_methods
from sweep.errors import SweepError
from sweep.results.statuses import STATUS_NAMES, cell_text
from sweep.runs.run import run
from sweep.study.model import Study, frozen
from sweep.study.read import Given
from sweep.study.read import study as as_study
from sweep.words import Table, a_name, did_you_mean, duration, function, number, page, paragraph, several, whole_number

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
CELLS = 1024
ROUNDS, LEAST_SECONDS = 5, 0.01
FINE = tuple(10.0**-k for k in range(14, 5, -1))
"""Values of rtol for the reference: in each cell the smallest at which its status is OK counts."""
GIVEN, ROUNDING = "the truth given", 2.0**-53
"""Name of the reference if the caller supplies the truth, and its error."""
UNSURE = (Status.INACCURATE, Status.GRAZING)
"""Statuses by which a method says that its values may be wrong."""
EXTREMES = (1e-3, 1e-14)
"""Values of rtol at which isolated cells are tried."""
WORK = ("rate_calls", "steps", "events")
"""Outputs that count a method's work; where a study asks for them, their means are shown beside the time."""
ESTIMATES = ("error", "wear_error")
"""Outputs that are error estimates."""


def precision_cells(study: Study, cells: int = CELLS) -> dict[str, Any]:
    """Values of the study's axes in the cells that `work_precision` uses, in the order in which it expects `truth`."""
    return {name: axis.values for name, axis in sampled(study, cells).axes.items()}


def work_precision(
    study: Given,
    *,
    methods: Sequence[str] | None = None,
    tolerances: Sequence[float] = TOLERANCES,
    cells: int = CELLS,
    reference: str | None = None,
    truth: Mapping[str, Any] | None = None,
    note: Callable[[str], None] = lambda text: None,
    isolate: bool = False,
    cell_timeout: float | str | None = None,
) -> xr.Dataset:
    """Measure error and time per cell of each method at several tolerances, on cells spread over a study's grid.

    Parameters
    ----------
    study : Study
        Its method and rtol, and axes of these, are ignored.
    methods : sequence of str, optional
        Default: "auto" and every method that covers the study's terms and outputs.
    tolerances : sequence of float
        Values of rtol.
    cells : int
        Largest number of cells.
    reference : str, optional
        Method whose results are taken as exact: in each cell at the smallest rtol at which its status is OK.
    truth : mapping of output to ndarray, optional
        True values in the cells that `precision_cells` lists; NaN in all outputs where there is no solution. Only these
        outputs are then compared.
    note : callable, optional
        Called with messages: the amount of work, and the number of cells that are left out.
    isolate, cell_timeout
        As in `run`: cells are first tried in separate processes, and left out where a method fails.

    Returns
    -------
    Dataset
        Over `method` and `rtol`: `error_median`, `error_worst`, `seconds`; shares of cells `ok`, `remarked`,
        `inaccurate`, `unsolved`, `silent`; texts `worst_cell`, `unsolved_as`, `silent_at`, `methods_used`; and means of
        the study's outputs that count work. Attributes `reference`, `reference_error` (the largest error of the
        reference), `cells` (where the truth is known), `open_cells` (where it is not), and `omissions` (methods that
        cannot do the study, and failures).

    Raises
    ------
    SweepError
        A method does not exist, or none can do the study; the reference solves no cell; `truth` has the wrong shape;
        a tolerance is not between 0 and 1; a method fails in every cell.

    Examples
    --------
    >>> import sweep
    >>> keys = {"kernel": "foliot", "outputs": ["period"], "axes": {"mu": [0.5, 1.0]}, "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> found = sweep.work_precision(keys, methods=["closed", "asymptotic"], tolerances=[1e-6])
    >>> found.method.values.tolist()
    ['closed', 'asymptotic']
    """
    tolerances = several("tolerances", tolerances)
    if not tolerances or not all(0 < number("rtol", rtol) < 1 for rtol in tolerances):
        raise SweepError(f"rtol: expected numbers above 0 and below 1, found {tolerances}")
    part = sampled(as_study(study), whole_number("cells", cells))
    able = [part.kernel.methods[number].name for number in usable_methods(part)]
    names = ["auto", *able] if methods is None else several("methods", methods)
    if not able:
        raise SweepError("no method of the kernel can do this study")
    if not names:
        raise SweepError(f"methods: expected at least one of auto, {', '.join(able)}; found none")
    reference = None if reference is None else a_name("reference", reference)
    for name in {*names, reference or able[0]} - {"auto", *able} | {reference} & {"auto"}:
        hint = did_you_mean(name, able) or f"; there are auto, {', '.join(able)}"
        raise SweepError(f"no method {name} that can do this study{hint}")
    function("note", note)(f"methods: {len(names)}, tolerances: {len(tolerances)}, cells: {Grid(part).size} ...")
    if isolate or cell_timeout is not None:
        part = _without_failing(part, ["auto", *able], cell_timeout, note)
    against = _given(part, truth) if truth is not None else _best(part, [reference] if reference else able)
    source, _, floor = against
    rows = [_measured(part, name, rtol, against) for name in names for rtol in tolerances]
    dims, columns = ("method", "rtol"), dict[str, Any]()
    for key, (_, text) in rows[0].items():
        values = np.array([row[key][0] for row in rows]).reshape(len(names), -1)
        columns[key] = dims, values, {"units": "1", "long_name": text}
    about = {"units": "s", "long_name": "time per cell on one core"}
    columns["seconds"] = dims, _seconds(part, names, tolerances), about
    open_cells = int(np.isinf(floor).sum())
    basis = {"reference": source, "reference_error": float(max(floor[np.isfinite(floor)], default=math.nan))}
    basis |= {"cells": len(floor) - open_cells, "open_cells": open_cells}
    about = {"title": part.title, "kernel": part.kernel_name}
    found = xr.Dataset(columns, {"method": names, "rtol": tolerances}, {**about, **basis})
    return found.assign_attrs(omissions="; ".join(_omissions(found, part, able if methods is None else None)))


def _without_failing(
    study: Study, methods: Sequence[str], cell_timeout: float | str | None, note: Callable[[str], None]
) -> Study:
    """The cells at which no method fails, found in processes of their own. Raises SweepError where there is none."""
    good = np.ones(Grid(study).size, bool)
    # auto also tries, on cells, methods that cannot do the whole study
    for method, rtol in itertools.product(methods, EXTREMES):
        found = run(replace(study, method=method, rtol=rtol), progress=False, isolate=True, cell_timeout=cell_timeout)
        good &= found[STATUS].values.ravel() != Status.FAILED
    if good.all():
        return study
    example = cell_text(Grid(study).cell(int(good.argmin())))
    text = f"the kernel fails at {(~good).sum()} of {good.size} cells, e.g. {example}"
    if not good.any():
        raise SweepError(text)
    note(f"{text}; they are left out")
    axes = {name: replace(a, values=frozen(a.values[good])) for name, a in study.axes.items()}
    return replace(study, axes=axes)


def precision_text(found: xr.Dataset, complete: bool = False) -> str:
    """The table that `sweep chart` prints: of more than three tolerances a line a method, at the middle one; or all.

    Without the further columns, cells that are neither OK nor unsolved carry a remark, INACCURATE among them.
    """
    every = complete or found.rtol.size <= 3
    shown = found if every else found.isel(rtol=[found.rtol.size // 2])
    shares = ("ok", "unsolved", "silent", *["inaccurate"] * complete)
    work, rows = [name for name in WORK if complete and name in found], []
    for cell in shown.to_dataframe().reset_index().to_dict("records"):
        # of the reference itself nothing can be said but that it is below its floor
        floor = found.attrs["reference_error"] if cell["method"] == found.attrs["reference"] else -1.0
        errors = (cell["error_median"], cell["error_worst"])
        row = [cell["method"], f"{cell['rtol']:.0e}", *("reference" if e <= floor else f"{e:.1e}" for e in errors)]
        row += [duration(cell["seconds"]), *(f"{cell[name]:.4g}" for name in work)]
        rows.append([*row, *(f"{100 * cell[name]:.3g} %" for name in shares), *[cell["worst_cell"]] * complete])
    headings = ["method", "rtol", "median", "worst", "time", *work, *shares, *["worst cell"] * complete]
    basis = f"errors against {found.attrs['reference']}, on {found.attrs['cells']} cells"
    basis += f"; its own error is at most {found.attrs['reference_error']:.1e}"
    if found.attrs["open_cells"]:
        basis += f"; left out where it is INACCURATE or has no value: {found.attrs['open_cells']} cells"
    left_out = f"Omissions: {found.attrs['omissions']}" if found.attrs["omissions"] else ""
    rest = "" if complete else "For every tolerance, the inaccurate cells and the worst cell: --all."
    table = Table(rows, [name.replace("_", " ") for name in headings]).text(wide=complete)
    return page(table, paragraph(basis), paragraph(left_out), rest)


def _omissions(found: xr.Dataset, study: Study, able: Sequence[str] | None) -> list[str]:
    """What fails most at which tolerance; and first, if those that are `able` were charted, why others cannot do it."""
    lines, faults = [], (("unsolved", "does not solve", "unsolved_as"), ("silent", "is silently wrong in", "silent_at"))
    for method in study.kernel.methods:
        if able is not None and method.name not in able:
            terms = [name for name in method.excludes if name in study.terms]
            lacks = [name for name in method.lacks if name in study.outputs]
            lines.append(f"{method.name} {'cannot do' if terms else 'does not give'} {', '.join(terms or lacks)}")
    for name, (key, verb, where) in itertools.product(found["method"].values, faults):
        row = found.sel({"method": name})
        worst = row.isel(rtol=row[key].values.argmax())
        if worst[key] > 0:
            share = f"{100 * worst[key].item():.3g} % at {worst.rtol.item():.0e}"
            lines.append(f"{name} {verb} {share}, first {worst[where].item()}")
    return lines


Reference = tuple[str, Mapping[str, Any], Any]
"""Its name, values by output, and their error in each cell: inf if it is unknown, NaN if the cell is known to have no
solution."""


def _given(study: Study, values: Mapping[str, Any]) -> Reference:
    """Values of some outputs in all cells of a study; NaN in all of them: there is nothing to give."""
    if not isinstance(values, Mapping):
        raise SweepError(
            f"truth: expected a mapping of outputs to arrays, found an object of type {type(values).__name__}"
        )
    size = Grid(study).size
    shapes = {name: (size, *shape) for name, shape in study.shapes.items()}
    taken = {name: np.asarray(column, np.float64) for name, column in values.items()}
    given = {name: column.shape for name, column in taken.items()}
    if not given or given.items() - shapes.items():
        raise SweepError(f"truth: expected arrays of outputs, of the shapes {shapes}; found {given or 'none'}")
    void = np.all([np.isnan(column).reshape(size, -1).all(axis=1) for column in taken.values()], axis=0)
    return GIVEN, taken, np.where(void, np.nan, ROUNDING)


def _best(study: Study, names: Sequence[str]) -> Reference:
    """Of the method that leaves the fewest cells open; then: states a bound, is right to less. Raises SweepError.

    In each cell its values are those at the least rtol at which it says that they are right.
    """
    # what a method tells of itself, its work and its error, is neither right nor wrong
    compared = tuple(name for name in study.outputs if name not in (*WORK, *ESTIMATES))
    study = replace(study, outputs=compared or study.outputs)
    found = dict[tuple[int, bool, float], Reference]()
    for name in sorted(names, key=lambda name: study.kernel.method(name).bound is None):
        vague = study.kernel.method(name).bound is None
        if vague and any(rank[0] == 0 for rank in found):
            break  # those that state a bound suffice
        values, floor = dict[str, Any](), np.full(Grid(study).size, np.inf)
        for rtol in FINE:
            cells = solved(replace(study, method=name, rtol=rtol))
            status = cells[STATUS]
            refused = status >= FIRST_REFUSAL
            now = np.isinf(floor) & ~refused & (status != Status.INACCURATE)
            for output in study.outputs:
                values.setdefault(output, cells[output])[now] = cells[output][now]
            floor[np.isinf(floor) & refused & ~among(status, GIVEN_UP)] = np.nan
            floor[now] = rtol
            if not np.isinf(floor).any():
                break
        sound = floor[np.isfinite(floor)]
        digits = float(np.log10(sound).mean()) if sound.size else 0.0
        found.setdefault((int(np.isinf(floor).sum()), vague, digits), (name, values, floor))
    best = found[min(found)]
    if not np.isfinite(best[2]).any():
        raise SweepError(f"{best[0]} solves none of the cells, so there is nothing to measure against")
    return best


def _measured(study: Study, name: str, rtol: float, against: Reference) -> dict[str, tuple[Any, str]]:
    """What is measured of a method at a tolerance, but for its time, and what each of it is."""
    source, truth, floor = against
    sound, void, judged = np.isfinite(floor), np.isnan(floor), (~np.isinf(floor)).sum()
    cells = solved(replace(study, method=name, rtol=rtol))
    status, used = cells[STATUS], cells[METHOD_USED]
    error = np.max([relative_error(cells[name], true) for name, true in truth.items()], axis=0)
    methods = [method.name for method in study.kernel.methods]
    # against itself the reference has no error; what can be said is what it is right to, also where auto took it
    itself = source in methods and used == methods.index(source)
    error = np.where(itself, np.fmax(error, floor), error)
    ok, inaccurate = status == Status.OK, status == Status.INACCURATE
    valued = sound & (status < FIRST_REFUSAL)
    sure, unsolved = valued & ~np.isin(status, UNSURE), sound & ~valued
    wrong, worst = sure & ~(error <= rtol + floor) | void & ok, error[sure].max(initial=0.0)
    shares = {
        "ok": (sound & ok, "that the method calls right"),
        "remarked": (valued & ~ok & ~inaccurate, "with another remark"),
        "inaccurate": (valued & inaccurate, "that it says are not accurate to rtol"),
        "unsolved": (unsolved, "that it gives no values for though there are some"),
        "silent": (wrong, "off by more than rtol and the error of the reference, without a status that says so"),
    }

    def first(some: Any) -> str:
        return cell_text(Grid(study).cell(int(some.argmax()))) if some.any() else ""

    counts = {method: int((used == i).sum()) for i, method in enumerate(methods)}
    taken = ", ".join(f"{m} {100 * n / max((used >= 0).sum(), 1):.3g} %" for m, n in counts.items() if n)
    median = np.median(error[valued]) if valued.any() else math.nan
    largest = worst if sure.any() else math.nan
    refusal = f"{STATUS_NAMES[int(status[unsolved][0])]} at {first(unsolved)}" if unsolved.any() else ""
    work = {key: cells[key][valued].mean() if valued.any() else math.nan for key in WORK if key in cells}
    return {
        "error_median": (median, "median relative error of a cell, over its outputs"),
        "error_worst": (largest, "largest relative error of a cell that the method calls right"),
        **{key: (some.sum() / judged, f"share of cells {text}") for key, (some, text) in shares.items()},
        **{key: (mean, f"{key.replace('_', ' ')} per cell, mean") for key, mean in work.items()},
        "worst_cell": (first(sure & (error == worst)), "where the largest error is"),
        "unsolved_as": (refusal, "the status of the first of these cells, and where it is"),
        "silent_at": (first(wrong), "the first cell that is silently wrong"),
        "methods_used": (taken, "which methods solved how many cells"),
    }


def _seconds(study: Study, names: Sequence[str], tolerances: Sequence[float]) -> Any:
    """Least time per cell of a few rounds over all methods: what slows the machine for a while slows them alike.

    Time is what this thread spends: what else runs on the machine matters less.
    """
    best = np.full((len(names), len(tolerances)), math.inf)
    for _, (i, name), (j, rtol) in itertools.product(range(ROUNDS), enumerate(names), enumerate(tolerances)):
        trial = replace(study, method=name, rtol=rtol)
        size, solver = Grid(trial).size, Solver(trial)
        cells = empty_cells(trial, size)
        count, begin = 0, time.thread_time()
        while (spent := time.thread_time() - begin) < LEAST_SECONDS or not count:
            solver.solve(0, cells)
            count += 1
        best[i, j] = min(best[i, j], spent / count / size)
    return best
