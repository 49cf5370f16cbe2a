"""What `sweep show` and the end of `sweep run` print: what is in a result, and what became of its cells."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Status
from sweep.cells.reduce import BY_METHOD, BY_STATUS
from sweep.cells.schema import ANCILLARY, METHOD_USED, STATUS
from sweep.results.statuses import (
    account,
    cell_values,
    count_methods,
    count_statuses,
    failed_cells,
    flag_words,
    is_summary,
    kind_of,
)
from sweep.show.follow import reasons
from sweep.study.model import short
from sweep.words import columns, page, paragraph, section

if TYPE_CHECKING:
    import xarray as xr

LARGEST_SCAN = 1 << 28
"""Bytes of an output up to which its smallest and largest value are looked up."""

CELLS_AT_ONCE = 1 << 22
FAILED = Status.FAILED.name
MOST_FAILED = 20
"""Cells that FAILED which are told one by one."""


Rows = list[tuple[str, ...]]


def result_text(path: Path, dataset: xr.Dataset) -> str:
    """All about a result."""
    found = {**sections(dataset), f"{FAILED}, and why": list(_failed(Path(path), dataset))}
    parts = [(title, rows) for title, rows in found.items() if rows]
    return page(
        paragraph("\n".join(head(path, dataset))),
        *(section(title, rows) if title else columns(rows) for title, rows in parts),
    )


def _failed(path: Path, dataset: xr.Dataset) -> Iterator[tuple[str, ...]]:
    """The first cells that FAILED, and what their kernel did, as the log of the run has it."""
    if is_summary(dataset):
        for number, reason in list(reasons(path).items())[:MOST_FAILED]:
            yield f"cell {number}", reason
        return
    known = reasons(path)
    for number in failed_cells(dataset, MOST_FAILED):
        values = " ".join(f"{name}={value}" for name, value in cell_values(dataset, number).items())
        yield f"cell {number}", values, known.get(number, "")


def sections(dataset: xr.Dataset) -> dict[str, Rows]:
    """What there is to tell of a result: titles, and rows of cells below them; the settings have no title."""
    found = _of_summary(dataset) if is_summary(dataset) else _of_cells(dataset)
    return {"": list(_settings(dataset))} | {title: rows for title, rows in found.items() if rows}


def _of_cells(dataset: xr.Dataset) -> dict[str, Rows]:
    for name in (STATUS, METHOD_USED):
        if dataset[name].nbytes <= LARGEST_SCAN:
            dataset[name].load()  # once, for they are looked at several times
    complete = dataset.nbytes <= LARGEST_SCAN or "end" in dataset.attrs
    return {
        "axes": [_coordinate(dataset[name]) for name in _axes(dataset)],
        "fixed": [_fixed(c) for c in _given(dataset)],
        "along": [_coordinate(dataset[name]) for name in _along(dataset)],
        "outputs": [_output(dataset[name], complete) for name in outputs_of(dataset)],
        "status": _status_rows(dataset),
        "methods used": _method_rows(dataset),
    }


def _of_summary(dataset: xr.Dataset) -> dict[str, Rows]:
    over = str(dataset.attrs["over"]).split()
    reduced = {name for name in over for dim in dataset[name].dims if dim in dataset.dims}
    kept = {str(d) for d in dataset[BY_STATUS].dims[:-1]}
    along = [n for n in _along_of(dataset, {*kept, *reduced, "cell"}) if n not in ("status_name", "method_name")]
    bins = {str(d) for name, c in dataset.coords.items() if str(name).endswith("_bin_lower") for d in c.dims}
    given = [c for c in dataset.coords.values() if not c.dims or set(map(str, c.dims)) & set(along) - {str(c.name)}]
    return {
        "axes": [_coordinate(c) for c in dataset.coords.values() if kept & set(map(str, c.dims))],
        "reduced over": [_coordinate(dataset[name]) for name in over],
        "fixed": [_fixed(c) for c in given],
        "along": [_coordinate(dataset[name]) for name in along],
        "reductions": [_reduction(dataset[name], bins) for name in _reductions(dataset)],
        "status": [(f"{c.cells:,}", c.name, kind_of(c.name), _status_doc(c.name)) for c in count_statuses(dataset)],
        "methods used": _method_rows(dataset),
    }


def _reductions(dataset: xr.Dataset) -> list[str]:
    return [str(name) for name in dataset.data_vars if name not in (BY_STATUS, BY_METHOD)]


def _reduction(variable: xr.DataArray, bins: set[str]) -> tuple[str, ...]:
    if set(map(str, variable.dims)) & bins:
        shown = f"{variable.sizes[variable.dims[-1]]} bins"
    elif variable.size == 1:
        value = variable.item()
        shown = f"{value:,}" if isinstance(value, int) else f"{value:.10g}"
        words = flag_words(variable)
        shown = words.get(value, shown) if words else shown
    else:
        shown = _extent(variable)
    return str(variable.name), _unit(variable), shown, _doc(variable)


def _status_doc(name: str) -> str:
    return Status[name].doc if name in Status.__members__ else ""


def head(path: Path, dataset: xr.Dataset) -> list[str]:
    """Name and completeness, title, question, and what became of the cells."""
    found = account(dataset)
    total, waiting = found.total, found.pending
    share = f"{math.floor(1000 * (total - waiting) / total) / 10:g} %"
    done = f"unfinished: {total - waiting:,} of {total:,} cells ({share})" if waiting else f"complete, {total:,} cells"
    texts = [f"{path}: {done}", dataset.attrs.get("title", ""), dataset.attrs.get("question", ""), str(found)]
    return list(dict.fromkeys(str(text) for text in texts if text))


def _settings(dataset: xr.Dataset) -> Iterator[tuple[str, ...]]:
    attrs = dataset.attrs
    for name in ("kernel", "design", "where", "method", "rtol"):
        if name in attrs:
            yield name, f"{attrs[name]:g}" if name == "rtol" else str(attrs[name])
    if "start" in attrs:
        yield "started", str(attrs["start"])
    if "end" in attrs:
        yield "ended", f"{attrs['end']}, {float(attrs.get('cells_per_second', math.nan)):,.0f} cells/s"
    if "versions" in attrs:
        yield "versions", str(attrs["versions"])


def _axes(dataset: xr.Dataset) -> list[str]:
    """Coordinates of the cells."""
    cells = set(dataset[STATUS].dims)
    return [str(name) for name, c in dataset.coords.items() if set(c.dims) & cells]


def _along(dataset: xr.Dataset) -> list[str]:
    """Coordinates that all cells share."""
    return _along_of(dataset, set(map(str, dataset[STATUS].dims)))


def _along_of(dataset: xr.Dataset, cells: set[str]) -> list[str]:
    return [str(name) for name, c in dataset.coords.items() if c.dims == (name,) and name not in cells]


def _given(dataset: xr.Dataset) -> list[xr.DataArray]:
    """Fixed parameters: numbers, and arrays that all cells share."""
    cells = set(dataset[STATUS].dims)
    return [c for name, c in dataset.coords.items() if not set(c.dims) & cells and c.dims != (name,)]


def outputs_of(dataset: xr.Dataset) -> list[str]:
    return [str(name) for name in dataset.data_vars if name not in ANCILLARY]


def _coordinate(coordinate: xr.DataArray) -> tuple[str, ...]:
    values = coordinate.values
    count = f"{len(values):,} value{'s' * (len(values) > 1)}"
    if values.ndim > 1:
        shown = f"{short(values[0])} to {short(values[-1])}"
    elif values.dtype.kind not in "fiu":
        shown = ", ".join(dict.fromkeys(map(str, values[:20])))
    elif len(values) <= 6:
        shown = ", ".join(f"{v:.6g}" for v in values)
    else:
        shown = f"{values[0]:.6g} to {values[-1]:.6g}"
    return str(coordinate.name), _unit(coordinate), count, shown, _doc(coordinate)


def _fixed(coordinate: xr.DataArray) -> tuple[str, ...]:
    shown = short(coordinate.values) if coordinate.dims else f"{coordinate.item():.10g}"
    return str(coordinate.name), _unit(coordinate), shown, _doc(coordinate)


def _output(output: xr.DataArray, complete: bool) -> tuple[str, ...]:
    return str(output.name), _unit(output), _extent(output) if complete else "", _doc(output)


def _extent(output: xr.DataArray) -> str:
    """Smallest to largest value; nothing of an output too large to read for it."""
    if output.nbytes > LARGEST_SCAN:
        return ""
    values = output.values[np.isfinite(output.values)]
    return f"{values.min():.6g} to {values.max():.6g}" if values.size else "no values"


def _status_rows(dataset: xr.Dataset) -> list[tuple[str, ...]]:
    """Every status that occurs: cells, kind, meaning; but for OK also an example, and where on the axes it occurs."""
    counts = count_statuses(dataset)
    where = _ranges(dataset)
    rows: list[tuple[str, ...]] = []
    for count in counts:
        text = _status_doc(count.name)
        if count.name != Status.OK.name:
            text += f"; {where[count.name]}" if where.get(count.name) else ""
            text += f"; e.g. {' '.join(f'{k}={v}' for k, v in count.example.items())}"
        rows.append((f"{count.cells:,}", count.name, kind_of(count.name), text))
    return rows


def _method_rows(dataset: xr.Dataset) -> list[tuple[str, ...]]:
    total = account(dataset).total
    return [(name, f"{cells:,}", f"{100 * cells / total:.1f} %") for name, cells in count_methods(dataset).items()]


def _ranges(dataset: xr.Dataset) -> dict[str, str]:
    """Where on the axes each refusal or remark occurs: 'mu 0.1 to 0.9, R 1'."""
    hits = _hits(dataset[STATUS])
    return {status.name: _where(dataset, hits[status]) for status in Status if status in hits}


def _hits(column: xr.DataArray) -> dict[int, dict[str, Any]]:
    """For each status but OK and PENDING: which positions along each dimension have it somewhere."""
    hits: dict[int, dict[str, Any]] = {}
    rows = max(1, CELLS_AT_ONCE // max(1, math.prod(column.shape[1:])))
    for start in range(0, column.shape[0], rows):
        piece = column[start : start + rows].values
        for code in set(np.unique(piece).tolist()) - {int(Status.OK), int(Status.PENDING)}:
            found = hits.setdefault(code, {str(d): np.zeros(n, bool) for d, n in column.sizes.items()})
            first, *others = np.nonzero(piece == code)
            for positions, array in zip((first + start, *others), found.values(), strict=True):
                array[positions] = True
    return hits


def _where(dataset: xr.Dataset, found: dict[str, Any]) -> str:
    """Axes along which it occurs in part only, with the smallest and largest value."""
    texts = []
    for name in _axes(dataset):
        coordinate = dataset[name]
        hit = found[str(coordinate.dims[0])]
        if hit.all():
            continue
        texts.append(f"{name} {_span(coordinate.values[hit])}")
    return ", ".join(texts) or "at every value of every axis"


def _span(values: Any) -> str:
    """The words, or '0.1 to 0.9', and whether NaN is among them."""
    if values.dtype.kind not in "fiu":
        return " and ".join(dict.fromkeys(map(str, values)))
    numbers = values[~np.isnan(values)]
    ends = dict.fromkeys(f"{v:.6g}" for v in (numbers.min(), numbers.max())) if len(numbers) else {}
    return " and ".join(filter(None, [" to ".join(ends), "nan" if len(numbers) < len(values) else ""]))


def _unit(variable: xr.DataArray) -> str:
    return f"[{variable.attrs['units']}]" if "units" in variable.attrs else ""


def _doc(variable: xr.DataArray) -> str:
    return str(variable.attrs.get("long_name", ""))
