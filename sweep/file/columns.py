"""Results as xarray opens them: columns are read when they are used, and compared with their digests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from sweep.file.foreign import changed_attrs
from sweep.file.layout import study_apart
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
        path = Path(filename_or_obj)
        try:
            file = StoredFile(path)
        except Changed:
            return _changed(path)
        columns = {}
        for name, numbers in file.columns().items():
            chunks = (*numbers.table.box, *numbers.place.shape)
            encoding = {"preferred_chunks": dict(zip(numbers.dims, chunks, strict=True))}
            lazy = indexing.LazilyIndexedArray(Column(numbers))
            columns[name] = xr.Variable(numbers.dims, lazy, dict(numbers.attrs), encoding)
        coords = {name: (c.dims, c.values, dict(c.attrs)) for name, c in file.coords.items()}
        found = xr.Dataset(columns, coords, file.attrs)
        found.encoding["source"] = str(path)
        found.set_close(file.close)
        return found


def _changed(path: Path) -> xr.Dataset:
    """As HDF5 finds it, which alone checks it."""
    attrs = changed_attrs(path)
    found = xr.open_dataset(
        path, engine="h5netcdf", cache=False, decode_times=False, decode_timedelta=False, phony_dims="access"
    )
    # h5netcdf takes the first axis, too, to be over a dimension that it makes up
    odd = any(str(dim).startswith("phony_dim") for dim in found.sizes)
    if odd or not {v.dtype.kind for v in found.data_vars.values()} <= set("fiu"):
        found.close()
        raise ValueError("something in it is no number, or over no dimension of its own")
    # words as fixed-width text, as in a Dataset that was never in a file
    words = {name: c for name, c in found.coords.items() if c.dtype.kind not in "fi"}
    plain = found.assign_coords({name: (c.dims, c.values.astype(str), c.attrs) for name, c in words.items()})
    plain.attrs.update({name: attrs[name] for name in ("created", "end", "cells_per_second") if name in attrs})
    values = {str(name): c.values for name, c in plain.coords.items()}
    plain.attrs["study_json"] = study_apart(plain.attrs["study_json"], values, together=True)
    plain.encoding = dict(found.encoding)
    plain.set_close(found.close)
    return plain
