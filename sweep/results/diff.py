"""In what two results differ: which cells, which statuses, and by how much."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from sweep.cells.schema import ANCILLARY, STATUS
from sweep.errors import SweepError
from sweep.results.statuses import boxes, cell_values, flag_words
from sweep.words import Table, listed


@dataclass
class Distance:
    """How far an output of two results is apart.

    Attributes
    ----------
    cells : int
        Cells that differ by more than the tolerance, or of which one alone has no value.
    largest : float
        Largest relative distance, abs(a - b) / max(abs(a), abs(b)); infinite where one alone has no value.
    example : str
        The cell of that.
    """

    cells: int = 0
    largest: float = 0.0
    example: str = ""


@dataclass
class Difference:
    """What two results differ in; `str` of it is what `sweep diff` prints.

    Attributes
    ----------
    cells : int
        Cells that both have.
    only_a, only_b : int
        Cells that one of them alone has.
    missing : tuple of str
        Outputs that one of them alone has.
    outputs : dict of str to Distance
        Of every output that both have.
    statuses : dict of (str, str) to int
        Cells of one status here and another there.
    examples : dict of (str, str) to str
        A cell of each of these.
    """

    cells: int
    only_a: int
    only_b: int
    missing: tuple[str, ...]
    rtol: float
    outputs: dict[str, Distance] = field(default_factory=dict)
    statuses: dict[tuple[str, str], int] = field(default_factory=dict)
    examples: dict[tuple[str, str], str] = field(default_factory=dict)

    @property
    def same(self) -> bool:
        """Whether nothing differs by more than the tolerance."""
        apart = any(distance.cells for distance in self.outputs.values())
        return not (self.only_a or self.only_b or self.missing or self.statuses or apart)

    def __str__(self) -> str:
        lines = [
            f"{self.cells:,} cells in both, {self.only_a:,} in the first alone, {self.only_b:,} in the second alone"
        ]
        if self.missing:
            lines.append(f"outputs of one alone: {listed(self.missing, word='and')}")
        rows = [
            (name, f"{found.cells:,} cells differ", f"by up to {found.largest:.2g}", found.example)
            for name, found in self.outputs.items()
            if found.cells
        ]
        rows += [(f"{a} -> {b}", f"{n:,} cells", "", self.examples[a, b]) for (a, b), n in self.statuses.items()]
        if self.same:
            within = f" to {self.rtol:g}" if self.rtol else ", bit for bit but for NaN"
            lines.append(f"the same{within}")
        return "\n".join([*lines, Table(rows).text()] if rows else lines)


def diff(a: xr.Dataset, b: xr.Dataset | None = None, rtol: float = 0.0) -> Difference:
    """In what two results of one kernel differ.

    Cells are those of equal parameters; where the cells of both run along `cell` or `point`, those of equal number.

    Parameters
    ----------
    a, b : Dataset
        From `run` or `open_result`, not of a summary.
    rtol : float
        Relative distance up to which outputs are the same; NaN is the same as NaN.

    Raises
    ------
    SweepError
        They are not two results, of different kernels or axes, or summaries.

    Examples
    --------
    >>> import sweep
    >>> keys = {"kernel": "foliot", "outputs": ["period"], "axes": {"mu": [0.5, 2.0]}, "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> closed, series = (sweep.run({**keys, "method": name, "rtol": 1e-2}) for name in ("closed", "asymptotic"))
    >>> found = sweep.diff(closed, series, rtol=1e-12)
    >>> found.same, found.outputs["period"].cells
    (False, 2)
    """
    a, b = two_results("diff", a, b)
    if any(STATUS not in d for d in (a, b)):
        raise SweepError("a summary keeps no cells to compare")
    kernels = [str(d.attrs.get("kernel", "")) for d in (a, b)]
    if kernels[0] != kernels[1]:
        raise SweepError(f"the results are of different kernels, {kernels[0]} and {kernels[1]}")
    if set(a[STATUS].dims) != set(b[STATUS].dims):
        dims = [listed(map(str, d[STATUS].dims), word="and") for d in (a, b)]
        raise SweepError(f"the cells run along {dims[0]} in one result and along {dims[1]} in the other")
    for dim in a[STATUS].dims:
        # cells without a value of their own are told apart by their number, so they must be the same ones
        along = [name for name, c in a.coords.items() if c.dims[:1] == (dim,) and dim not in a.coords]
        same = all(name in b.coords and a[name].equals(b[name]) for name in along)
        if dim not in a.coords and (a.sizes[dim] != b.sizes[dim] or not same):
            raise SweepError(f"the points along {dim} are not the same in both; compare results of one design")
    first, second = xr.align(a, b, join="inner", copy=False)

    cells = first[STATUS].dims
    total = [math.prod(d[STATUS].shape) for d in (a, b, first)]
    names = [{str(n) for n in d.data_vars} - set(ANCILLARY) for d in (a, b)]
    found = Difference(total[2], total[0] - total[2], total[1] - total[2], tuple(sorted(names[0] ^ names[1])), rtol)
    for name in (str(n) for n in a.data_vars if str(n) in names[0] & names[1]):
        distance = found.outputs[name] = Distance()
        order = (*cells, *(d for d in first[name].dims if d not in cells))
        for cell, x, y in _pieces(first[name].transpose(*order), second[name].transpose(*order)):
            apart = _relative(x, y).max(axis=tuple(range(len(cells), x.ndim)), initial=0.0)
            distance.cells += int((apart > rtol).sum())
            if apart.size and apart.max() > distance.largest:
                distance.largest = float(apart.max())
                distance.example = _example(first, cell, apart.shape, int(apart.argmax()))
    words = [flag_words(d[STATUS]) for d in (first, second)]
    for cell, x, y in _pieces(first[STATUS], second[STATUS].transpose(*cells)):
        codes = np.stack([x.ravel(), y.ravel()])
        pairs, places, counts = np.unique(codes, axis=1, return_index=True, return_counts=True)
        for one, other, place, count in zip(*pairs.tolist(), places.tolist(), counts.tolist(), strict=True):
            if one != other:
                pair = words[0].get(one, str(one)), words[1].get(other, str(other))
                found.statuses[pair] = found.statuses.get(pair, 0) + count
                found.examples.setdefault(pair, _example(first, cell, x.shape, place))
    return found


def two_results(name: str, a: Any, b: Any) -> tuple[xr.Dataset, xr.Dataset]:
    """What a function of two results, `sweep.name`, was given. Raises SweepError."""
    if isinstance(a, xr.Dataset) and isinstance(b, xr.Dataset):
        return a, b
    found = " and ".join(type(each).__name__ for each in (a, b) if each is not None)
    raise SweepError(
        f"sweep.{name}: expected two Datasets, found {found or 'none'}; "
        f'write sweep.{name}(first, second), and open a file first, e.g. first = sweep.open_result("first.h5")'
    )


def _relative(x: Any, y: Any) -> Any:
    """Relative distances; 0 of equal values and of two NaN, infinite where one alone is NaN."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        found = np.abs(x - y) / np.maximum(np.abs(x), np.abs(y))
    found[(x == y) | (np.isnan(x) & np.isnan(y))] = 0.0
    found[np.isnan(found)] = np.inf
    return found


def _pieces(a: xr.DataArray, b: xr.DataArray) -> Iterator[tuple[list[int], Any, Any]]:
    """Numbers of both, a few million at a time, and where they begin."""
    for box in boxes(a.shape):
        yield [part.start for part in box], a[box].values, b[box].values


def _example(dataset: xr.Dataset, first: list[int], shape: tuple[int, ...], place: int) -> str:
    """A cell, by its place in a piece of a shape that begins at some cell."""
    at = [start + int(step) for start, step in zip(first, np.unravel_index(place, shape), strict=False)]
    number = np.ravel_multi_index(at, dataset[STATUS].shape) if at else 0
    return "e.g. " + " ".join(f"{name}={value}" for name, value in cell_values(dataset, int(number)).items())
