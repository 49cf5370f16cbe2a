"""Differences between two results: which cells, which statuses, and by how much."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from sweep.cells.schema import ANCILLARY, STATUS
from sweep.errors import SweepError
from sweep.results.statuses import cell_text, cell_values, flag_words, pieces, statuses_of
from sweep.words import Table, counted, listed, number, require_dataset


@dataclass
class Distance:
    """Difference of one output between two results.

    Attributes
    ----------
    cells : int
        Cells that differ by more than the tolerance, or have a value in only one result.
    largest : float
        Largest relative difference, abs(a - b) / max(abs(a), abs(b)); infinite where only one has a value.
    example : str
        The cell where it occurs.
    """

    cells: int = 0
    largest: float = 0.0
    example: str = ""


class Difference:
    """Result of `diff`; its `str` is what `sweep diff` prints.

    Attributes
    ----------
    cells : int
        Cells in both results.
    only_a, only_b : int
        Cells in only one of them.
    missing : tuple of str
        Outputs in only one of them.
    fixed : dict of str to (a, b)
        Fixed parameters whose values differ.
    outputs : dict of str to Distance
        For every output in both.
    statuses : dict of (str, str) to int
        Number of cells with one status in `a` and another in `b`.
    examples : dict of (str, str) to str
        A cell for each of these.
    """

    def __init__(self, a: xr.Dataset, b: xr.Dataset, rtol: float) -> None:
        first, second = xr.align(a, b, join="inner", copy=False)
        cells = first[STATUS].dims
        total = [math.prod(d[STATUS].shape) for d in (a, b, first)]
        self.cells, self.only_a, self.only_b = total[2], total[0] - total[2], total[1] - total[2]
        names = [{str(n) for n in d.data_vars} - set(ANCILLARY) for d in (a, b)]
        self.missing, self.rtol = tuple(sorted(names[0] ^ names[1])), rtol
        self.outputs = {str(name): Distance() for name in a.data_vars if str(name) in names[0] & names[1]}
        self.statuses, self.examples = dict[tuple[str, str], int](), dict[tuple[str, str], str]()
        single = {
            str(name): (_single(c), _single(b[name])) for name, c in a.coords.items() if name in b.coords and not c.dims
        }
        self.fixed = {name: (x, y) for name, (x, y) in single.items() if repr(x) != repr(y)}
        words, compared = [flag_words(d[STATUS]) for d in (first, second)], [*self.outputs, STATUS]
        for x, y in zip(*(pieces(d[compared], cells) for d in (first, second)), strict=True):
            for name, distance in self.outputs.items():
                one = x[name].transpose(*cells, ...)
                here, there = one.values, y[name].transpose(*one.dims).values
                # 0 of equal values and of two NaN, infinite where one alone is NaN
                with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
                    apart = np.asarray(np.abs(here - there) / np.maximum(np.abs(here), np.abs(there)))
                apart[(here == there) | (np.isnan(here) & np.isnan(there))] = 0.0
                apart[np.isnan(apart)] = np.inf
                apart = apart.max(axis=tuple(range(len(cells), one.ndim)), initial=0.0)
                distance.cells += int((apart > rtol).sum())
                if apart.size and apart.max() > distance.largest:
                    distance.largest, distance.example = float(apart.max()), _example(x, int(apart.argmax()))
            codes = np.stack([x[STATUS].values.ravel(), y[STATUS].transpose(*cells).values.ravel()])
            pairs, places, counts = np.unique(codes, axis=1, return_index=True, return_counts=True)
            for old, new, place, count in zip(*pairs.tolist(), places.tolist(), counts.tolist(), strict=True):
                if old != new:
                    pair = words[0].get(old, str(old)), words[1].get(new, str(new))
                    self.statuses[pair] = self.statuses.get(pair, 0) + count
                    self.examples.setdefault(pair, _example(x, place))

    @property
    def same(self) -> bool:
        """Whether nothing differs by more than the tolerance."""
        apart = any(distance.cells for distance in self.outputs.values())
        return not (self.only_a or self.only_b or self.missing or self.fixed or self.statuses or apart)

    def __repr__(self) -> str:
        lines = [
            f"cells in both: {self.cells:,}; only in the first: {self.only_a:,}; only in the second: {self.only_b:,}"
        ]
        if self.missing:
            lines.append(f"outputs in only one of them: {listed(self.missing, word='and')}")
        lines += [f"fixed: {name} is {x} in the first and {y} in the second" for name, (x, y) in self.fixed.items()]
        rows = [
            (name, f"differs in {counted(found.cells, 'cell')}", f"by up to {found.largest:.2g}", found.example)
            for name, found in self.outputs.items()
            if found.cells
        ]
        rows += [(f"{a} -> {b}", counted(n, "cell"), "", self.examples[a, b]) for (a, b), n in self.statuses.items()]
        if self.same:
            lines.append(f"equal within {self.rtol:g}" if self.rtol else "identical, bit for bit; NaN equals NaN")
        return "\n".join([*lines, Table(rows).text()] if rows else lines)


def diff(a: xr.Dataset, b: xr.Dataset, rtol: float = 0.0) -> Difference:
    """Compare two results of one kernel, cell by cell.

    Cells with equal parameters are compared; if both results are lists of cells, cells with the same number.

    Parameters
    ----------
    a, b : Dataset
        From `run` or `open_result`, not of a summary.
    rtol : float
        Relative differences up to this count as equal; NaN is equal to NaN.

    Raises
    ------
    SweepError
        A Dataset is not a result of cells, or the results have different kernels or axes.

    Examples
    --------
    >>> import sweep
    >>> keys = {"kernel": "foliot", "outputs": ["period"], "axes": {"mu": [0.5, 2.0]}, "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> closed, series = (sweep.run({**keys, "method": name, "rtol": 1e-2}) for name in ("closed", "asymptotic"))
    >>> found = sweep.diff(closed, series, rtol=1e-12)
    >>> found.same, found.outputs["period"].cells
    (False, 2)
    """
    require_dataset("diff", a)
    require_dataset("diff", b)
    if not (rtol := number("rtol", rtol)) >= 0.0:
        raise SweepError(f"rtol: expected 0 or more, found {rtol:g}")
    kernels = [str(d.attrs.get("kernel", "")) for d in (a, b)]
    if kernels[0] != kernels[1]:
        raise SweepError(f"the results are of different kernels, {kernels[0]} and {kernels[1]}")
    for name in sorted(map(str, a.variables.keys() & b.variables.keys())):
        one, other = (str(d[name].attrs.get("units", "no unit")) for d in (a, b))
        if one != other:
            raise SweepError(f"{name} is in {one} in one result and in {other} in the other; see sweep.in_units")
    if set(statuses_of(a).dims) != set(statuses_of(b).dims):
        dims = [listed(map(str, d[STATUS].dims), word="and") for d in (a, b)]
        raise SweepError(f"the cells run along {dims[0]} in one result and along {dims[1]} in the other")
    for dim in a[STATUS].dims:
        if dim in a.coords and dim in b.coords:
            a, b = (d if dim in d.indexes else d.set_xindex([dim]) for d in (a, b))
            if not (a.indexes[dim].is_unique and b.indexes[dim].is_unique):
                raise SweepError(f"{dim} has a value twice; take one of each, e.g. ds.drop_duplicates({str(dim)!r})")
            continue
        # cells without a value of their own are told apart by their number, so they must be the same ones
        along = [{name: c.variable for name, c in d.coords.items() if c.dims[:1] == (dim,)} for d in (a, b)]
        if a.sizes[dim] != b.sizes[dim] or not xr.Dataset(along[0]).equals(xr.Dataset(along[1])):
            raise SweepError(f"the points along {dim} are not the same in both; compare results of one design")
    return Difference(a, b, rtol)


def _single(parameter: xr.DataArray) -> Any:
    """A number or word that all cells share."""
    return flag_words(parameter).get(parameter.item(), parameter.item())


def _example(piece: xr.Dataset, place: int) -> str:
    return f"e.g. {cell_text(cell_values(piece, place))}"
