"""One finished block as a file: its name, its digest, and how it is read back.

<start>-<stop>.<digest>.h5
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import xxhash

from sweep import disk
from sweep.image import Images
from sweep.layout import Column

PART_NAME = re.compile(r"(\d+)-(\d+)\.([0-9a-f]{32})\.h5")


DAMAGE = (OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, RuntimeError)
"""What comes of reading a damaged file."""


def part_name(start: int, stop: int, digest: str) -> str:
    """File name of the cells `start` to `stop`."""
    return f"{start:012d}-{stop:012d}.{digest}.h5"


def digest(columns: Sequence[Column], arrays: Mapping[str, Any]) -> str:
    """32 hex digits of the numbers of a block."""
    state = xxhash.xxh3_128()
    for column in columns:
        state.update(memoryview(arrays[column.name]).cast("B"))
    return state.hexdigest()


def read_part(
    path: Path, images: Images, start: int, stop: int, buffers: Mapping[str, Any] | None = None
) -> dict[str, Any] | None:
    """The numbers of one block, each of shape `(stop - start, ...)`; None where the file is damaged.

    Parameters
    ----------
    buffers : arrays at least as long as the block, to be filled and returned in part

    Raises
    ------
    FileNotFoundError
    """
    match = PART_NAME.fullmatch(path.name)
    assert match is not None
    columns, cells = images.columns, stop - start
    arrays = {c.name: c.empty(cells) if buffers is None else buffers[c.name][:cells] for c in columns}
    try:
        fd = disk.open_file(path, os.O_RDONLY)
        try:
            places = _places(fd, images, start, stop) or _places_by_hdf5(path, columns, start, stop)
            for column in columns:
                disk.read_into(fd, arrays[column.name], places[column.name])
        finally:
            disk.forget(fd)
            os.close(fd)
    except FileNotFoundError:
        raise
    except DAMAGE:
        return None
    return arrays if digest(columns, arrays) == match[3] else None


def _places(fd: int, images: Images, start: int, stop: int) -> Mapping[str, int] | None:
    """Where each column begins, in a file that begins as this program writes it; None in any other."""
    frame, head = images.frame(stop - start), images.head(start, stop)
    same = os.fstat(fd).st_size == frame.size and os.pread(fd, len(head), 0) == head
    return frame.places if same else None


def _places_by_hdf5(path: Path, columns: Sequence[Column], start: int, stop: int) -> dict[str, int]:
    """The same in a file that another version of HDF5 wrote. Raises one of DAMAGE where it is none of ours."""
    import h5py

    places = {}
    with h5py.File(path, "r") as file:
        if (int(file.attrs["start"]), int(file.attrs["stop"])) != (start, stop):
            raise ValueError("holds other cells than its name says")
        for column in columns:
            dataset = file[column.name]
            if dataset.shape != (stop - start, *column.shape) or dataset.dtype != column.dtype:
                raise ValueError(f"{column.name} has another shape or type")
            places[column.name] = dataset.id.get_offset()
    return places
