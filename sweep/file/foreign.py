"""A result that another program has changed: HDF5 alone checks it, and is let loose on it where that is safe."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from sweep.cells.reduce import BY_STATUS
from sweep.cells.schema import STATUS
from sweep.file.layout import ENDING
from sweep.file.reading import ending_of

MOST_COMPRESSED = 1100
"""Bytes that gzip makes of one, at most."""
TEXTS = (
    *("title", "question", "kernel", "design", "where", "method", "study", "study_json", "fingerprint", "versions"),
    *("start", "created", "end", "over", "units", "long_name", "flag_meanings"),
)
"""Attributes that are text wherever they stand."""


def changed_attrs(output: Path) -> dict[str, Any]:
    """Attributes of a result that another program has changed, and what is known at the end of its run.

    Raises
    ------
    OSError, ValueError and their like
        It is no result any more, or HDF5 would be led to other files, beyond the memory, or astray.
    """
    import h5py

    with h5py.File(output, "r") as file:
        _check_own(file, output.stat().st_size)
        found = [_attrs(file), *(_attrs(file[name]) for name in file)]
        attrs = found[0]
        attrs["study_json"], attrs["fingerprint"], file[STATUS if STATUS in file else BY_STATUS]
        if not all(isinstance(own[name], str) for own in found for name in TEXTS if name in own):
            raise TypeError("an attribute is no text")
        float(attrs.get("rtol", 0.0))
        return attrs | (ending_of(file[ENDING][()].tobytes()) if ENDING in file else {})


def _attrs(thing: Any) -> dict[str, Any]:
    """Attributes of what h5py has opened: texts as str, a single number as such."""
    found = {}
    for name, value in thing.attrs.items():
        single = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
        found[name] = single.decode() if isinstance(single, bytes) else single
    return found


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
