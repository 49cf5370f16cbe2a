"""Finished results of formats 1 and 2: outputs without checksums, flags compressed, digests in a group of HDF5.

Their last bytes are

    begin, end of each region of the outputs' numbers    int64, little-endian
    xxh3 (128 bits) of these places, and of the digest of all bytes outside the regions
    number of regions    uint32
    MAGIC
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import xxhash

from sweep.cells.partition import Partition
from sweep.store.layout import BYTES, Layout, Place, Region, Table, structure_digest
from sweep.system import disk

MAGIC = b"foliot seal\n"
TAIL = BYTES + 4 + len(MAGIC)
MOST_REGIONS = 100_000
GROUP, DIGESTS = "integrity", "digests"


def read_seal(fd: int, size: int) -> tuple[bytes, list[Region], int] | None:
    """The trailer: its digest and regions, and where it begins; None where there is none. Raises OSError, EOFError."""
    if size < TAIL:
        return None
    tail = bytearray(TAIL)
    disk.read_all(fd, (tail,), size - TAIL)
    if not tail.endswith(MAGIC):
        return None
    (count,) = struct.unpack_from("<I", tail, BYTES)
    begin = size - TAIL - 16 * count
    if count > MOST_REGIONS or begin < 0:
        return None
    places = bytearray(16 * count)
    disk.read_all(fd, (places,), begin)
    regions: list[Region] = list(struct.iter_unpack("<qq", places))
    return bytes(tail[:BYTES]), regions, begin


def unbroken(fd: int, size: int, most: float) -> bool | None:
    """Whether all but the outputs' numbers is as it was written; None where no trailer tells, or it is too much.

    Raises OSError.
    """
    try:
        found = read_seal(fd, size)
        if found is None:
            return None
        digest, regions, end = found
        if any(not 0 <= begin <= stop <= end for begin, stop in regions):
            return False
        if end - sum(stop - begin for begin, stop in regions) > most:
            return None
        places = b"".join(struct.pack("<qq", *region) for region in regions)
        return xxhash.xxh3_128(places + structure_digest(fd, regions, end)).digest() == digest
    except EOFError:
        return False


def read(path: Path, fd: int, size: int) -> tuple[Layout, Any]:
    """The layout of such a file as far as its outputs go, and their digests. Raises one of DAMAGE."""
    import h5py

    if read_seal(fd, size) is None:
        raise ValueError("it is no result, or was changed")
    with h5py.File(path, "r") as file:
        digests = file[GROUP][DIGESTS]
        names = str(digests.attrs["columns"]).split()
        cells, step = (int(np.ravel(digests.attrs[key])[0]) for key in ("size", "cells"))
        if min(cells, step) < 1 or digests.nbytes > size or digests.dtype != "u1":
            raise ValueError("its digests cannot be")
        blocks = Partition(cells, step)
        if digests.shape != (blocks.count, len(names), BYTES):
            raise ValueError("its digests do not fit its columns")
        plain = [number for number, name in enumerate(names) if not file[name].chunks]
        grids = {_grid(file[names[number]].shape, cells) for number in plain}
        places = tuple(_place(file[names[number]], names[number], len(min(grids)), step) for number in plain)
        table = Table(min(grids), blocks, places, 0, b"")
        return Layout("", {}, "", {"cells": table}, (), (), b"", size), digests[...][:, plain]


def _place(dataset: Any, name: str, grid: int, step: int) -> Place:
    shape = dataset.shape[grid:]
    cell_bytes = dataset.dtype.itemsize * int(np.prod(shape, dtype=np.int64))
    return Place(name, dataset.dtype.str, shape, 0, ((0, dataset.id.get_offset(), step * cell_bytes),))


def _grid(shape: tuple[int, ...], cells: int) -> tuple[int, ...]:
    """The lengths of the grid, which come first among a column's. Raises ValueError where so many cells do not fit."""
    for count in range(len(shape) + 1):
        if np.prod(shape[:count], dtype=np.int64) == cells:
            return shape[:count]
    raise ValueError("its digests are of another number of cells")
