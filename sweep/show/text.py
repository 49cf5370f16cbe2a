"""Output of `sweep show`: contents and statuses of a result as tables, which the HTML page also uses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Status
from sweep.cells.reduce import BY_METHOD, BY_STATUS
from sweep.cells.schema import ANCILLARY, METHOD_USED, STATUS
from sweep.results.statuses import (
    account,
    boxes,
    cell_text,
    cell_values,
    count_methods,
    flag_words,
    flat_pieces,
    is_summary,
    kind_of,
)
from sweep.runs.progress import log_path, read_lines
from sweep.study.model import short
from sweep.words import Table, counted, page, paragraph, percent

if TYPE_CHECKING:
    import xarray as xr

LARGEST_SCAN = 1 << 28
"""Bytes of an output up to which its smallest and largest value are looked up."""
MOST_FAILED = 20
"""Cells that FAILED which are reported one by one."""
NOT_LOGGED = "not in the log: the kernel gave no number or status, or the log is not complete"
_FAILED, _REASON = " FAILED (", "): "


def result_text(path: Path, dataset: xr.Dataset) -> str:
    """All about a result; of the first cells that FAILED also what their kernel did, as the log of the run has it."""
    known, summed = reasons(Path(path)), is_summary(dataset)
    numbers, done = list(known) if summed else [], 0
    for piece in () if summed else flat_pieces(dataset[STATUS]):
        numbers += (done + np.flatnonzero(piece == Status.FAILED)[:MOST_FAILED]).tolist()
        done += len(piece)
        if len(numbers) >= MOST_FAILED:
            break
    failed = []
    for number in numbers[:MOST_FAILED]:
        place = "" if summed else cell_text(cell_values(dataset, number))
        failed.append((f"cell {number}", place, known.get(number, NOT_LOGGED)))
    return page(
        paragraph("\n".join(head(path, dataset))),
        settings(dataset).text(),
        *(table.text() for table in sections(dataset)),
        Table(failed, title="FAILED, and why").text(),
    )


def head(path: Path, dataset: xr.Dataset) -> list[str]:
    """Name and completeness, title, question, and what became of the cells."""
    found = account(dataset)
    total, waiting, done = found.total, found.by_kind["pending"], "complete"
    if waiting:
        done = f"unfinished: {total - waiting:,} of {counted(total, 'cell')} ({percent(found.done)})"
    texts = [f"{path}: {done}", dataset.attrs.get("title", ""), dataset.attrs.get("question", ""), str(found)]
    return list(dict.fromkeys(str(text) for text in texts if text))


def settings(dataset: xr.Dataset) -> Table:
    """Kernel, method, tolerance; when the result was computed, by which versions."""
    attrs = {name: str(value) for name, value in dataset.attrs.items()}
    if "rtol" in attrs:
        attrs["rtol"] = f"{dataset.attrs['rtol']:g}"
    if "end" in attrs:
        attrs["end"] += f", {float(attrs.get('cells_per_second', math.nan)):,.0f} cells/s"
    words = {"start": "started", "end": "ended"}
    names = ("kernel", "design", "where", "method", "rtol", "start", "end", "versions")
    return Table((words.get(name, name), attrs[name]) for name in names if name in attrs)


def sections(dataset: xr.Dataset) -> list[Table]:
    """Axes, fixed parameters, outputs, statuses and methods of a result, as far as there are any."""
    columns, over, gone = dataset.coords, [], set()
    if is_summary(dataset):
        cells, over = set(map(str, dataset[BY_STATUS].dims[:-1])), str(dataset.attrs["over"]).split()
        gone = {str(dim) for name in over for dim in dataset[name].dims} | {"cell", "status_name", "method_name"}
        outputs = [str(name) for name in dataset.data_vars if name not in (BY_STATUS, BY_METHOD)]
        kind, scanned = "reduction", True
    else:
        for name in (STATUS, METHOD_USED):
            if dataset[name].nbytes <= LARGEST_SCAN:
                dataset[name].load()  # once, for they are looked at several times
        cells, outputs, kind = set(map(str, dataset[STATUS].dims)), outputs_of(dataset), "output"
        scanned = dataset.nbytes <= LARGEST_SCAN or "end" in dataset.attrs
    axes = [str(name) for name, c in columns.items() if set(map(str, c.dims)) & cells]
    along = [str(n) for n, c in columns.items() if c.dims == (n,) and n not in cells | gone]
    fixed = [str(n) for n, c in columns.items() if not c.dims or (set(c.dims) <= set(along) and n not in along)]

    def table(names: Sequence[str], shown: Callable[[xr.DataArray], Any], word: str, title: str, *head: str) -> Table:
        """Name, unit, what is shown of each variable, and what it means."""
        rows = []
        for one in (dataset[name] for name in names):
            unit = f"[{one.attrs['units']}]" if "units" in one.attrs else ""
            rows.append((str(one.name), unit, *shown(one), str(one.attrs.get("long_name", ""))))
        return Table(rows, (word, "unit", *head, "meaning"), title)

    total = account(dataset).total
    methods = [(name, f"{n:,}", f"{100 * n / total:.1f} %") for name, n in count_methods(dataset).items()]
    tables = [
        table(axes, _grid, "axis", "axes", "values", "from, to"),
        table(over, _grid, "axis", "reduced over", "values", "from, to"),
        table(fixed, lambda one: [_value(one)], "parameter", "fixed", "value"),
        table(along, _grid, "coordinate", "along", "values", "from, to"),
        table(outputs, lambda one: [_extent(one) if scanned else ""], kind, f"{kind}s", "from, to"),
        status_table(dataset, "status"),
        Table(methods, ("method", "cells", "share"), "methods used"),
    ]
    return [table for table in tables if table.rows]


def outputs_of(dataset: xr.Dataset) -> list[str]:
    """The outputs of a result, without what is said of them."""
    return [str(name) for name in dataset.data_vars if name not in ANCILLARY]


def _grid(coordinate: xr.DataArray) -> tuple[str, str]:
    """How many values, and which."""
    values = coordinate.values
    if values.ndim > 1:
        shown = f"{short(values[0])} to {short(values[-1])}"
    elif values.dtype.kind not in "fiu":
        shown = ", ".join(dict.fromkeys(map(str, values[:20])))
    elif len(values) <= 6:
        shown = ", ".join(f"{v:.6g}" for v in values)
    else:
        shown = _span(values)
    return f"{len(values):,} value{'s' * (len(values) > 1)}", shown


def _value(variable: xr.DataArray) -> str:
    """One value, or an array that all cells share."""
    if variable.dims and variable.size > 1:
        return short(variable.values)
    value = variable.item()
    return flag_words(variable).get(value) or (f"{value:,}" if isinstance(value, int) else f"{value:.10g}")


def _extent(output: xr.DataArray) -> str:
    """Smallest to largest value; nothing of an output too large to read for it."""
    if output.size == 1 and not output.dims:
        return _value(output)
    if str(output.dims[-1]).endswith("_bin"):
        return f"{output.sizes[output.dims[-1]]} bins"
    if output.nbytes > LARGEST_SCAN:
        return ""
    values, words = output.values[np.isfinite(output.values)], flag_words(output)
    return _span(np.array([words[code] for code in np.unique(values).tolist()]) if words else values) or "no values"


def status_table(dataset: xr.Dataset, title: str = "") -> Table:
    """Every status that occurs: cells, kind, meaning; but for OK also where on the axes it occurs, and an example."""
    rows, found = list[tuple[str, ...]](), account(dataset)
    places = {} if is_summary(dataset) else _places(dataset)
    for name, cells in found.statuses.items():
        texts = [Status[name].doc if name in Status.__members__ else "", places.get(name, "")]
        texts += [f"e.g. {cell_text(found.examples[name])}"] if found.examples.get(name) else []
        rows.append((f"{cells:,}", name, kind_of(name), "; ".join(filter(None, texts))))
    return Table(rows, ("cells", "status", "kind", "meaning, and where"), title)


def _places(dataset: xr.Dataset) -> dict[str, str]:
    """Where on the axes each refusal or remark occurs: 'mu 0.1 to 0.9, R 1'. Reads a few million cells at a time."""
    column = dataset[STATUS]
    hits: dict[int, list[Any]] = {}
    for box in boxes(column.shape):
        piece = column[box].values
        for code in set(np.unique(piece).tolist()) - {int(Status.OK), int(Status.PENDING)}:
            found = hits.setdefault(code, [np.zeros(n, bool) for n in column.shape])
            for here, part, places in zip(found, box, np.nonzero(piece == code), strict=True):
                here[part.start + places] = True
    axes = [c for c in dataset.coords.values() if set(c.dims) & set(column.dims)]
    texts = {}
    for status in (status for status in Status if status in hits):
        along = dict(zip(column.dims, hits[status], strict=True))
        parts = [f"{c.name} {_span(c.values[along[c.dims[0]]])}" for c in axes if not along[c.dims[0]].all()]
        texts[status.name] = ", ".join(parts) or "at every value of every axis"
    return texts


def _span(values: Any) -> str:
    """The words, or '0.1 to 0.9', and whether NaN is among them."""
    if values.dtype.kind not in "fiu":
        return " and ".join(dict.fromkeys(map(str, values)))
    numbers = values[~np.isnan(values)]
    ends = dict.fromkeys(f"{v:.6g}" for v in (numbers.min(), numbers.max())) if len(numbers) else {}
    return " and ".join(filter(None, [" to ".join(ends), "nan" if len(numbers) < len(values) else ""]))


def reasons(output: Path) -> dict[int, str]:
    """Why cells FAILED, by their numbers; as far as the log says."""
    path = log_path(output)
    found = {}
    for line in read_lines(path.read_text("utf-8", errors="replace")) if path.is_file() else ():
        cell, failed, rest = line.get("text", "").partition(_FAILED)
        number = cell.removeprefix("cell ")
        if failed and number.isdecimal():
            found[int(number)] = rest.partition(_REASON)[2]
    return found
