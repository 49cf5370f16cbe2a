"""Results as xarray Datasets: of a finished sweep, of one that still runs, or exported to HDF5."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sweep.cells.schema import Schema
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.store import unfinished_of
from sweep.words import as_path

if TYPE_CHECKING:
    import xarray as xr

MEMORY_SHARE = 0.25
"""Results larger than this share of the memory are opened in pieces (dask)."""


def open_result(path: str | os.PathLike[str], strict: bool = False, *, chunks: Any = None) -> xr.Dataset:
    """The result of a sweep, finished or not.

    Cells that are not computed yet are NaN, with status PENDING. Values are read when they are used, and compared with
    their digests; what is larger than a quarter of the memory comes as dask arrays.

    Parameters
    ----------
    path : path
        The output of a sweep, also while it is not finished.
    strict : bool
        Refuse a sweep that is not finished.
    chunks : as of `xarray.open_dataset`, optional
        Dask arrays whatever the size: {} has the chunks of the file, "auto" those that dask likes.

    Raises
    ------
    SweepError
        There is no result, or it cannot be read, or it is unfinished and `strict`; `path` is no path.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> with sweep.run(sweep.study(ds), "opened.h5") as written, sweep.open_result("opened.h5") as found:
    ...     print(found.period.equals(ds.period), found.period.units)
    True s
    """
    output = as_path(path)
    # a sweep that ends meanwhile puts its file in another place
    for place in (output, unfinished_of(output), output):
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            return _open(place, strict, chunks)
    raise SweepError(f"{output}: no such file, nor a run that is writing it")


def open_unfinished(path: str | os.PathLike[str]) -> xr.Dataset:
    """What there is of an unfinished sweep, also where its output holds an earlier result. Raises SweepError."""
    return _open(unfinished_of(Path(path)))


def _open(place: Path, strict: bool = False, chunks: Any = None) -> xr.Dataset:
    """A file, whether it is finished or not. Raises SweepError, and FileNotFoundError and its like."""
    import xarray as xr

    from sweep.file.columns import Result

    _, size, _ = disk.mark(place) or (0, 0, 0)
    if chunks is None and size > MEMORY_SHARE * memory():
        chunks = "auto"
    return xr.open_dataset(os.fspath(place), engine=Result, chunks=chunks, strict=strict)


def in_memory(plan: Schema, arrays: Mapping[str, Any]) -> xr.Dataset:
    """A Dataset of columns of shape `(size, ...)`."""
    import xarray as xr

    variables = {
        c.name: ((*plan.grid.dims, *c.dims), arrays[c.name].reshape(plan.shape(c)), dict(c.attrs)) for c in plan.columns
    }
    coordinates = {c.name: (c.dims, c.values, dict(c.attrs)) for c in plan.coordinates}
    return xr.Dataset(variables, coordinates, dict(plan.attrs))


def memory() -> int:
    """Bytes of memory of this machine."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
