"""Columns for xarray, read when they are used: from the parts of a sweep that still runs, or from a finished result.

The numbers of a block of a result are compared with its digest before any of them is handed out.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import xxhash
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from sweep.cells.grid import Box
from sweep.cells.partition import Partition
from sweep.cells.schema import Column
from sweep.store.digests import DIGESTS, GROUP, PIECE, read_table
from sweep.store.parts import DAMAGE, Parts
from sweep.system.errors import SweepError


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


class Result(BackendEntrypoint):
    """A result as xarray opens it, whose numbers cannot be had damaged; one without digests is opened as it is."""

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: Any = None) -> xr.Dataset:
        """Raises SweepError when damaged numbers are read; OSError, ValueError and their like at once."""
        import h5py

        path = Path(filename_or_obj)
        dataset = xr.open_dataset(
            path, engine="h5netcdf", cache=False, decode_times=False, decode_timedelta=False,
            drop_variables=drop_variables,
        )  # fmt: skip
        with h5py.File(path, "r") as file:
            if GROUP not in file:
                return dataset
            names, blocks = read_table(file, path.stat().st_size)
            digests = file[GROUP][DIGESTS][...]
        columns = {
            name: _checked(path, dataset.variables[name], name, blocks, digests[:, number])
            for number, name in enumerate(names)
            if name in dataset.data_vars
        }
        found = dataset.assign(columns)
        found.set_close(dataset.close)
        return found


def _checked(path: Path, variable: xr.Variable, name: str, blocks: Partition, digests: Any) -> xr.Variable:
    data = indexing.LazilyIndexedArray(CheckedArray(path, variable, name, blocks, digests))
    return xr.Variable(variable.dims, data, variable.attrs, variable.encoding)


class CheckedArray(BackendArray):
    """A column of a result; `digests` has a row of bytes for each of the blocks of its cells."""

    def __init__(self, path: Path, variable: xr.Variable, name: str, blocks: Partition, digests: Any) -> None:
        self.path, self.variable, self.name, self.blocks, self.digests = path, variable, name, blocks, digests
        self.shape, self.dtype = variable.shape, variable.dtype
        self.grid = _grid(variable.shape, blocks.size)
        self._sound = np.zeros(blocks.count, bool)

    def __getitem__(self, key: Any) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._read)

    def _read(self, key: tuple[Any, ...]) -> Any:
        for first, last in self._unchecked(key[: len(self.grid)]):
            self._check(first, last)
        return self.variable[key].values

    def _unchecked(self, key: tuple[Any, ...]) -> Iterator[tuple[int, int]]:
        """Runs of the blocks that cells are wanted of and that are not known to be sound; a few million bytes each."""
        run = run_of(key, self.grid)
        if run is not None:
            wanted = np.arange(run[0] // self.blocks.cells, -(-run[1] // self.blocks.cells))
        else:
            wanted = np.unique(cells_of(key, self.grid) // self.blocks.cells)
        left = wanted[~self._sound[wanted]]
        most = max(1, PIECE // (self.blocks.cells * self._cell_bytes))
        cuts = np.flatnonzero(np.diff(left) > 1) + 1
        for part in np.split(left, cuts):
            for start in range(0, len(part), most):
                yield int(part[start]), int(part[start : start + most][-1]) + 1

    @property
    def _cell_bytes(self) -> int:
        return int(self.dtype.itemsize) * math.prod(self.shape[len(self.grid) :])

    def _check(self, first: int, last: int) -> None:
        """Compares some blocks with their digests. Raises SweepError."""
        edges = [self.blocks.bounds(index)[0] for index in range(first, last)] + [self.blocks.bounds(last - 1)[1]]
        try:
            found = self._bytes(edges[0], edges[-1])
        except DAMAGE:
            raise self._damaged(edges[0], edges[-1]) from None
        for index, (start, stop) in enumerate(itertools.pairwise(edges), first):
            piece = found[(start - edges[0]) * self._cell_bytes : (stop - edges[0]) * self._cell_bytes]
            if xxhash.xxh3_128(piece).digest() != bytes(self.digests[index]):
                raise self._damaged(start, stop)
            self._sound[index] = True

    def _bytes(self, start: int, stop: int) -> memoryview:
        """The numbers of the cells from one to another, as they lie in the file."""
        pieces = Box((), self.grid).pieces(start, stop)
        return memoryview(b"".join(np.ascontiguousarray(self.variable[s].values).tobytes() for s, _, _ in pieces))

    def _damaged(self, start: int, stop: int) -> SweepError:
        return SweepError(
            f"{self.path}: {self.name} is damaged between its cells {start:,} and {stop:,}; sweep verify tells of all "
            "damage, and sweep run --force computes the result anew"
        )


def _grid(shape: tuple[int, ...], cells: int) -> tuple[int, ...]:
    """The lengths of the grid, which come first among a column's. Raises ValueError where so many cells do not fit."""
    for count in range(len(shape) + 1):
        if math.prod(shape[:count]) == cells:
            return shape[:count]
    raise ValueError("its digests are of another number of cells")


def open_checked(output: Path, chunks: str | None) -> xr.Dataset:
    """The Dataset of a finished result; with chunks "auto" in pieces. Raises OSError, ValueError and their like."""
    return xr.open_dataset(os.fspath(output), engine=Result, chunks=chunks)
