"""Speed against accuracy: every method of a kernel on the same cells, in one run.

Errors are against a reference: the method with the smallest error bound, or the last one at the smallest rtol. What it
is right to itself is the floor below which no error here means anything. Times are of one core, the least of a few
repetitions; they are noisy, errors and counts are not.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import FIRST_REFUSAL, Status
from sweep.checks import did_you_mean
from sweep.errors import SweepError
from sweep.grid import Grid
from sweep.planning import small_duration
from sweep.sampling import sampled, solved, with_method
from sweep.study import Study
from sweep.table import columns, page

if TYPE_CHECKING:
    import xarray as xr

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
CELLS = 1024
REPETITIONS = 3
LEAST_SECONDS = 0.02
TIMES_TOLERANCE = 10.0
"""An error beyond so many times rtol, and no status that says so, is a silent fault."""
REFERENCE_RTOL = 1e-14

COUNTS = ("ok", "remarked", "inaccurate", "failed", "silent")
LONG_NAMES = {
    "error_median": "median relative error of a cell, over its outputs",
    "error_worst": "largest relative error of a cell that the method calls right",
    "seconds": "time per cell on one core",
    "ok": "share of cells that the method calls right",
    "remarked": "share of cells with another remark",
    "inaccurate": "share of cells that it says are not right to rtol",
    "failed": "share of cells that it refuses and the reference does not",
    "silent": f"share of cells wrong by more than {TIMES_TOLERANCE:g} rtol without a status that says so",
}


def work_precision(
    study: Study,
    *,
    methods: Sequence[str] | None = None,
    tolerances: Sequence[float] = TOLERANCES,
    cells: int = CELLS,
    reference: str | None = None,
) -> xr.Dataset:
    """Error and time per cell of methods at several tolerances, on cells spread over a study's grid.

    Parameters
    ----------
    study : Study
        Its method and rtol, and axes of these, are left aside.
    methods : sequence of str, optional
        Default: "auto" and all that can do the study's terms and outputs.
    tolerances : sequence of float
        Values of rtol.
    cells : int
        At most so many.
    reference : str, optional
        The method whose results are taken for the truth, at rtol 1e-14.

    Returns
    -------
    Dataset
        Over `method` and `rtol`: `error_median`, `error_worst`, `seconds` and shares of cells: `ok`, `remarked`,
        `inaccurate`, `failed`, `silent`; `worst_cell` says where the largest error is. Attributes `reference`,
        `reference_error` (its own bound; NaN where it states none) and `omissions`.

    Raises
    ------
    SweepError
        There is no such method, or none that can do the study, or the reference solves no cell.
    """
    import xarray as xr

    part = sampled(study, cells)
    able = [study.kernel.methods[i].name for i in _usable(part)]
    names = _chosen(methods, able)
    source, floor = _reference(part, reference, able)
    truth, status, _ = solved(with_method(part, source, REFERENCE_RTOL))
    sound = status < FIRST_REFUSAL
    if not sound.any():
        raise SweepError(f"{source} solves none of the cells, so there is nothing to measure against")
    rows = [[_measured(part, name, rtol, truth, sound) for rtol in tolerances] for name in names]
    keys = rows[0][0]
    found = xr.Dataset(
        {key: (("method", "rtol"), np.array([[cell[key] for cell in row] for row in rows])) for key in keys},
        {"method": list(names), "rtol": list(tolerances)},
    )
    for key, text in LONG_NAMES.items():
        found[key].attrs = {"units": "s" if key == "seconds" else "1", "long_name": text}
    found.attrs = {"title": study.title, "kernel": study.kernel_name, "cells": int(sound.sum()), "reference": source}
    found.attrs |= {"reference_error": floor, "omissions": omissions(found)}
    return found


def precision_text(found: xr.Dataset) -> str:
    """The table that `sweep chart` prints."""
    rows = [("method", "rtol", "median", "worst", "time", "ok", "inaccurate", "refused", "silent", "worst cell")]
    for name in found["method"].values:
        for rtol in found["rtol"].values:
            cell = found.sel({"method": name, "rtol": rtol})
            errors = (f"{float(cell[key]):.1e}" for key in ("error_median", "error_worst"))
            shares = (f"{100 * float(cell[key]):.3g} %" for key in ("ok", "inaccurate", "failed", "silent"))
            rows.append(
                (
                    name,
                    f"{rtol:.0e}",
                    *errors,
                    small_duration(float(cell.seconds)),
                    *shares,
                    str(cell.worst_cell.item()),
                )
            )
    truth = f"errors against {found.attrs['reference']}, in {found.attrs['cells']} cells"
    floor = found.attrs["reference_error"]
    truth += f", itself right to {floor:.1e}" if math.isfinite(floor) else ""
    left_out = found.attrs["omissions"]
    return page(columns(rows), truth, f"Omissions: {left_out}" if left_out else "")


def omissions(found: xr.Dataset) -> str:
    """What fails where, in words; "" where nothing does."""
    lines = []
    for name in found["method"].values:
        row = found.sel({"method": name})
        for key, verb in (("failed", "refuses"), ("silent", "is silently wrong in")):
            share = row[key]
            if float(share.max()) > 0:
                at = ", ".join(
                    f"{100 * float(s):.3g} % at {float(r):.0e}" for s, r in zip(share, row.rtol, strict=True) if s
                )
                lines.append(f"{name} {verb} {at}")
    return "; ".join(lines)


def _usable(study: Study) -> tuple[int, ...]:
    from sweep.solve import usable_methods

    return usable_methods(study)


def _chosen(methods: Sequence[str] | None, able: Sequence[str]) -> list[str]:
    names = ["auto", *able] if methods is None else list(methods)
    for name in names:
        if name not in ("auto", *able):
            hint = did_you_mean(name, able) or f"; there are auto, {', '.join(able)}"
            raise SweepError(f"no method {name} that can do this study{hint}")
    if not able:
        raise SweepError("no method of the kernel can do this study")
    return names


def _reference(study: Study, asked: str | None, able: Sequence[str]) -> tuple[str, float]:
    """The method taken for the truth, and what it is right to."""
    bounds = {name: _bound(study, name) for name in able}
    stated = {name: bound for name, bound in bounds.items() if math.isfinite(bound)}
    name = asked or (min(stated, key=lambda n: stated[n]) if stated else able[-1])
    if name not in able:
        raise SweepError(f"no method {name} that can do this study; there are {', '.join(able)}")
    return name, bounds[name]


def _bound(study: Study, name: str) -> float:
    """Largest error bound that a method states; inf where there is none for some cell, NaN where it states none."""
    method = study.kernel.method(name)
    if method.bound is None:
        return math.nan
    grid, lengths = Grid(study), study.lengths
    given = [np.empty((grid.size, *(lengths[d] for d in p.dims))) for p in study.kernel.parameters]
    for k, value in grid.constants().items():
        given[k][:] = value
    grid.columns(0, grid.size, given)
    out = np.empty(grid.size)
    asked = np.array([f.name in study.outputs for f in study.kernel.outputs], np.uint8)
    fine = np.empty(len(out), np.int8)
    study.kernel.check(*given, fine)
    good = np.flatnonzero(fine < FIRST_REFUSAL)
    if not len(good):
        return math.nan
    part = [column[good] for column in given]
    method.bound(
        *part, np.full(len(good), REFERENCE_RTOL), *map(np.array, study.along.values()), asked, out[: len(good)]
    )
    return float(out[: len(good)].max())


def _measured(study: Study, name: str, rtol: float, truth: Any, sound: Any) -> dict[str, Any]:
    part = with_method(study, name, rtol)
    outputs, status, _ = solved(part)
    error = _errors(outputs, truth)
    valued = sound & (status < FIRST_REFUSAL)
    told = status == Status.INACCURATE
    sure = valued & ~told
    wrong = sure & ~(error <= TIMES_TOLERANCE * rtol)
    worst = int(np.where(sure, error, -1.0).argmax())
    total = int(sound.sum())
    return {
        "error_median": float(np.median(error[valued])) if valued.any() else math.nan,
        "error_worst": float(error[worst]) if sure.any() else math.nan,
        "seconds": _seconds(part),
        "ok": float((sound & (status == Status.OK)).sum() / total),
        "remarked": float((sure & (status != Status.OK)).sum() / total),
        "inaccurate": float((valued & told).sum() / total),
        "failed": float((sound & ~valued).sum() / total),
        "silent": float(wrong.sum() / total),
        "worst_cell": _cell(study, worst) if sure.any() else "",
    }


def _errors(outputs: Any, truth: Any) -> Any:
    """Largest relative error of each cell over its outputs, of traces relative to their largest value."""
    worst = np.zeros(len(next(iter(outputs.values()))))
    for name, values in outputs.items():
        true = truth[name]
        rest = tuple(range(1, true.ndim))
        size = np.abs(true) if not rest else np.nanmax(np.abs(true), axis=rest, keepdims=True, initial=0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            off = np.abs(values - true) / size
        off = np.where((values == true) | (np.isnan(values) & np.isnan(true)), 0.0, off)
        off = np.where(np.isnan(off), np.inf, off)
        worst = np.maximum(worst, off.max(axis=rest) if rest else off)
    return worst


def _seconds(study: Study) -> float:
    """Least time per cell of a few repetitions."""
    from sweep.solve import Solver

    size, lengths, solver = Grid(study).size, study.lengths, Solver(study)
    outputs = {f.name: np.empty((size, *(lengths[d] for d in f.dims))) for f in study.asked}
    status, used = np.empty(size, np.int8), np.empty(size, np.int8)
    best = math.inf
    for _ in range(REPETITIONS):
        count, begin = 0, time.perf_counter()
        while (spent := time.perf_counter() - begin) < LEAST_SECONDS or not count:
            solver.solve(0, size, outputs, status, used)
            count += 1
        best = min(best, spent / max(count, 1) / size)
    return best


def _cell(study: Study, index: int) -> str:
    return " ".join(f"{name}={axis.label(index)}" for name, axis in study.axes.items())
