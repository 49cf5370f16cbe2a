"""Columns of a sweep that still runs, read from its parts when they are used."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from xarray.backends import BackendArray
from xarray.core import indexing

from sweep.cells.schema import Column
from sweep.store.parts import Parts


class PartsArray(BackendArray):
    """A column over the whole grid, for xarray."""

    def __init__(self, parts: Parts, column: Column, grid: tuple[int, ...]) -> None:
        self.parts, self.column, self.grid = parts, column, grid
        self.shape, self.dtype = (*grid, *column.shape), np.dtype(column.dtype)

    def __getitem__(self, key: Any) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._read)

    def _read(self, key: tuple[Any, ...]) -> Any:
        run = run_of(key[: len(self.grid)], self.grid)
        if run is not None:
            kept = [range(n)[k] for n, k in zip(self.grid, key, strict=False) if isinstance(k, slice)]
            found = self.parts.run(self.column, *run).reshape((*map(len, kept), *self.column.shape))
            return found[(*[slice(None)] * len(kept), *key[len(self.grid) :])]
        found = self.parts.read(self.column, cells_of(key[: len(self.grid)], self.grid))
        shape = [len(range(n)[k]) for n, k in zip(self.grid, key, strict=False) if isinstance(k, slice)]
        return found.reshape(*shape, *self.column.shape)[(*[slice(None)] * len(shape), *key[len(self.grid) :])]


def cells_of(key: tuple[Any, ...], grid: tuple[int, ...]) -> Any:
    """The numbers of the flat cells of a key of numbers and slices, in its order."""
    axes = [np.arange(n)[k] for n, k in zip(grid, key, strict=True)]
    strides = [math.prod(grid[i + 1 :]) for i in range(len(grid))]
    cells = sum(np.asarray(a * s, np.int64) for a, s in zip(np.ix_(*map(np.atleast_1d, axes)), strides, strict=True))
    return np.asarray(cells).reshape(-1)


def run_of(key: tuple[Any, ...], grid: tuple[int, ...]) -> tuple[int, int] | None:
    """From which flat cell to which one a key reaches; None where it leaves some out between."""
    start, step = 0, math.prod(grid)
    for place, (part, length) in enumerate(zip(key, grid, strict=True)):
        step //= length
        chosen = range(length)[part]
        if isinstance(chosen, int):
            start += chosen * step
            continue
        rest = zip(key[place + 1 :], grid[place + 1 :], strict=True)
        whole = all(isinstance(k, slice) and range(n)[k] == range(n) for k, n in rest)
        if chosen.step != 1 or not whole:
            return None
        return start + chosen.start * step, start + max(chosen.start, chosen.stop) * step
    return start, start + 1


def lazy(parts: Parts, column: Column, grid: tuple[int, ...]) -> Any:
    """The column as data of an xarray variable."""
    return indexing.LazilyIndexedArray(PartsArray(parts, column, grid))
