"""Results as xarray opens them: columns are read when they are used, and compared with their digests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from sweep.file.foreign import changed_attrs
from sweep.file.reading import Changed, Numbers, StoredFile


class Column(BackendArray):
    """A column over the whole grid."""

    def __init__(self, numbers: Numbers) -> None:
        self.numbers, self.shape, self.dtype = numbers, numbers.shape, numbers.dtype

    def __getitem__(self, key: Any) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.OUTER, self.numbers.__getitem__
        )


class Result(BackendEntrypoint):
    """A result as xarray opens it; one that another program has changed is opened as it is."""

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: Any = None) -> xr.Dataset:
        """Raises SweepError when damaged numbers are read; OSError, ValueError and their like at once."""
        path, file = Path(filename_or_obj), None
        try:
            file = StoredFile(path)
            attrs = file.ending
        except Changed:
            attrs = changed_attrs(path)
        plain = xr.open_dataset(
            path, engine="h5netcdf", cache=False, decode_times=False, decode_timedelta=False,
            drop_variables=drop_variables, phony_dims="access",
        )  # fmt: skip
        plain.attrs.update({name: attrs[name] for name in ("created", "end", "cells_per_second") if name in attrs})
        if file is None:
            # h5netcdf takes the first axis, too, to be over a dimension that it makes up
            odd = any(str(dim).startswith("phony_dim") for dim in plain.sizes)
            if odd or not {v.dtype.kind for v in plain.data_vars.values()} <= set("fiu"):
                plain.close()
                raise ValueError("something in it is no number, or over no dimension of its own")
            return plain
        columns = {}
        for name, numbers in file.columns().items():
            like = plain.variables[name]
            chunks = (*numbers.table.box, *numbers.place.shape)
            encoding = {"preferred_chunks": dict(zip(map(str, like.dims), chunks, strict=True))}
            columns[name] = xr.Variable(like.dims, indexing.LazilyIndexedArray(Column(numbers)), like.attrs, encoding)
        found = plain.assign(columns).assign_coords({name: c.load() for name, c in plain.coords.items()})
        found.encoding = dict(plain.encoding)
        plain.close()
        found.set_close(file.close)
        return found
