"""Results as xarray opens them: columns are read when they are used, and compared with their digests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from sweep.cells.reduce import gathered, pending
from sweep.errors import SweepError
from sweep.file.reading import Numbers, StoredFile
from sweep.study.model import Study


class Column(BackendArray):
    """A column over the whole grid."""

    def __init__(self, numbers: Numbers) -> None:
        self.numbers, self.shape, self.dtype = numbers, numbers.shape, numbers.dtype

    def __getitem__(self, key: Any) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.BASIC, self.numbers.__getitem__
        )


class Result(BackendEntrypoint):
    """A result as xarray opens it, finished or not, the latter unless it is to be `strict`."""

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: Any = None, strict: bool = False) -> xr.Dataset:
        """Raises as `StoredFile` does, and SweepError when damaged numbers are read."""
        path = Path(filename_or_obj)
        file, columns = StoredFile(path), {}
        if strict and not file.ending:
            done = file.tables[file.work].done
            left = f"{int((~done).sum())} of {done.size} blocks are missing"
            raise SweepError(f"{path}: unfinished, {left}; run its sweep again to continue")
        for name, numbers in file.columns().items() if file.ending or file.work == "cells" else ():
            chunks = dict(zip(numbers.dims, (*numbers.table.box, *numbers.own), strict=True))
            lazy = indexing.LazilyIndexedArray(Column(numbers))
            columns[name] = xr.Variable(numbers.dims, lazy, dict(numbers.attrs), {"preferred_chunks": chunks})
        columns = columns or _of_rows(file)
        found = xr.Dataset(columns, {name: (c.dims, c.values, c.attrs) for name, c in file.coords.items()}, file.attrs)
        found.encoding["source"] = str(path)
        found.set_close(file.close)
        return found


def _of_rows(file: StoredFile) -> dict[str, xr.Variable]:
    """The columns of an unfinished summary: of the rows that are there."""
    study = Study.from_json(file.attrs["study_json"], declared=True)
    rows, table = pending(study), file.tables["rows"]
    for block in np.flatnonzero(table.done).tolist():
        cells = slice(*table.blocks.bounds(block))
        for column in table.columns:
            rows[column.name][cells] = column[cells]
    arrays = gathered(study, rows)
    return {
        c.name: xr.Variable(c.dims, arrays[c.name].reshape(c.shape), dict(c.attrs)) for c in file.columns().values()
    }
