"""A result that another program has changed: HDF5 alone checks it, and is let loose on it where that is safe."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sweep.file.layout import ENDING
from sweep.file.reading import ending_of
from sweep.study.model import study_together

if TYPE_CHECKING:
    import xarray as xr

MOST_COMPRESSED = 1100
"""Bytes that gzip makes of one, at most."""


def changed_result(path: Path) -> xr.Dataset:
    """A result as HDF5 finds it.

    Raises
    ------
    OSError, ValueError and their like
        It is no result any more, or HDF5 would be led to other files, beyond the memory, or astray.
    """
    import h5py
    import xarray as xr

    with h5py.File(path, "r") as file:
        _check_own(file, path.stat().st_size)
        ending = ending_of(file[ENDING][()].tobytes()) if ENDING in file else {}
    found = xr.open_dataset(
        path, engine="h5netcdf", cache=False, decode_times=False, decode_timedelta=False, phony_dims="access"
    )
    try:
        # h5netcdf takes the first axis, too, to be over a dimension that it makes up
        if any(str(dim).startswith("phony_dim") for dim in found.sizes):
            raise ValueError("something in it is over no dimension of its own")
        numbers = all(v.dims and v.dtype.kind in "fiu" for v in found.data_vars.values())
        texts = [found.attrs[name] for name in ("study_json", "fingerprint", "start")]
        texts += [v.attrs[name] for v in found.variables.values() for name in ("units", "long_name") if name in v.attrs]
        if not numbers or not all(isinstance(text, str) for text in texts):
            raise TypeError("something in it is no number of a cell, or no text")
        # words as fixed-width text, as in a Dataset that was never in a file
        words = {name: c for name, c in found.coords.items() if c.dtype.kind not in "fi"}
        plain = found.assign_coords({name: (c.dims, c.values.astype(str), c.attrs) for name, c in words.items()})
        plain.attrs.update(ending, study_json=study_together(found.attrs["study_json"], plain.coords))
    except BaseException:
        found.close()
        raise
    plain.encoding = dict(found.encoding)
    plain.set_close(found.close)
    return plain


def _check_own(group: Any, size: int, inner: bool = False) -> None:
    """Raises ValueError where what a group of HDF5 holds is not in the file itself, has no room in it, or is odd.

    Links and storage in other files would be followed; groups in groups may hold themselves.
    """
    import h5py

    for name in group:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise ValueError(f"{name} is a link")
        thing = group[name]
        if isinstance(thing, h5py.Group) and not inner:
            _check_own(thing, size, inner=True)
            continue
        if not isinstance(thing, h5py.Dataset) or thing.external or thing.is_virtual:
            raise ValueError(f"{name} is not in the file itself")
        if thing.nbytes > size * (MOST_COMPRESSED if thing.compression else 1):
            raise ValueError(f"{name} has more numbers than the file has room for")
        # HDF5 2.0 reads beyond the end of chunks that are smaller than they say, and crashes where axes are missing
        whole = thing.dtype.itemsize * math.prod(thing.chunks or ()) + 4 * thing.fletcher32
        chunks: list[Any] = []
        if thing.chunks and not thing.compression and thing.scaleoffset is None:
            thing.id.chunk_iter(chunks.append)
        if any(chunk.filter_mask or chunk.size != whole for chunk in chunks):
            raise ValueError(f"{name} has chunks that are too short")
        if "DIMENSION_LIST" in thing.attrs and thing.attrs.get_id("DIMENSION_LIST").shape != (thing.ndim,):
            raise ValueError(f"{name} has not the dimensions that it says")
