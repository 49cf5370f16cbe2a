"""Columns of a result for xarray, read when they are used, and compared with their digests."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Any

import xarray as xr
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from sweep.cells.partition import box_shape
from sweep.file.layout import DAMAGE
from sweep.file.reading import Numbers, StoredFile


class Column(BackendArray):
    """A column over the whole grid."""

    def __init__(self, numbers: Numbers) -> None:
        self.numbers, self.shape, self.dtype = numbers, numbers.shape, numbers.dtype

    def __getitem__(self, key: Any) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.BASIC, self.numbers.__getitem__
        )


class Result(BackendEntrypoint):
    """A result as xarray opens it; one that another program has changed is opened as it is."""

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: Any = None) -> xr.Dataset:
        """Raises SweepError when damaged numbers are read; OSError, ValueError and their like at once."""
        path = Path(filename_or_obj)
        plain = xr.open_dataset(
            path, engine="h5netcdf", cache=False, decode_times=False, decode_timedelta=False,
            drop_variables=drop_variables, phony_dims="access",
        )  # fmt: skip
        if any(str(dim).startswith("phony_dim") for dim in plain.sizes):
            plain.close()
            # h5netcdf then takes the first axis to be over that dimension, too
            raise ValueError("something in it is over no dimension of its own")
        try:
            file = StoredFile(path)
        except DAMAGE:
            return plain
        columns = {
            name: _variable(plain.variables[name], numbers)
            for name, numbers in file.columns().items()
            if name in plain.data_vars
        }
        found = plain.assign(columns).assign_coords({name: c.load() for name, c in plain.coords.items()})
        if set(columns) == set(plain.data_vars):
            plain.close()
        found.encoding = dict(plain.encoding)
        found.set_close(lambda: _close(plain, file))
        return found


def _variable(plain: xr.Variable, numbers: Numbers) -> xr.Variable:
    table = numbers.table
    if plain.shape != numbers.shape:
        raise ValueError("its layout is of another file")
    chunks = (*box_shape(table.grid, table.blocks.cells), *numbers.place.shape)
    encoding = {"preferred_chunks": dict(zip(map(str, plain.dims), chunks, strict=True))}
    return xr.Variable(plain.dims, indexing.LazilyIndexedArray(Column(numbers)), plain.attrs, encoding)


def _close(plain: xr.Dataset, file: StoredFile) -> None:
    with contextlib.suppress(OSError):
        plain.close()
    file.close()


def open_checked(output: Path, chunks: str | None) -> xr.Dataset:
    """The Dataset of a result; with chunks "auto" in pieces. Raises OSError, ValueError and their like."""
    return xr.open_dataset(os.fspath(output), engine=Result, chunks=chunks)
