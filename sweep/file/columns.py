"""Lazy arrays for xarray: columns are read when they are used, and compared with their digests."""

from __future__ import annotations

from typing import Any

import xarray as xr
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

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
    """A result as xarray opens it, finished or not."""

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: Any = None) -> xr.Dataset:
        """Of a `StoredFile`. SweepError is raised when damaged numbers are read."""
        file: StoredFile = filename_or_obj
        columns = {}
        for name, numbers in file.tables["cells"].columns.items():
            chunks = dict(zip(numbers.dims, (*numbers.table.box, *numbers.own), strict=True))
            lazy = indexing.LazilyIndexedArray(Column(numbers))
            columns[name] = xr.Variable(numbers.dims, lazy, dict(numbers.attrs), {"preferred_chunks": chunks})
        found = xr.Dataset(columns, {name: (c.dims, c.values, c.attrs) for name, c in file.coords.items()}, file.attrs)
        found.encoding["source"] = str(file.path)
        found.set_close(file.close)
        return found
