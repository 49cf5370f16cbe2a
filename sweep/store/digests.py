"""Digests in a result, by which damage to it is found: every byte of the file is under one of them.

In the group `integrity` of the file:

    digests (chunk, column, byte)   xxh3 (128 bits) of the numbers of each column, `cells` of the `size` cells at a time
    frame (byte,)                   the same of all else: every byte outside the outputs' numbers and outside itself

The outputs' numbers lie in the file as they are, so they are read without HDF5.

HDF5 may loop for ever, or crash, in a file whose structure is damaged. So after the last byte, where HDF5 does not
look, stands a trailer by which that is found before:

    begin, end of each region of the outputs' numbers    int64, little-endian
    xxh3 (128 bits) of all bytes outside the regions, and of these places themselves
    number of regions    uint32
    MAGIC
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xxhash

from sweep.cells.partition import Partition
from sweep.cells.schema import Column
from sweep.store.hdf5_bytes import unfilled
from sweep.store.parts import DAMAGE
from sweep.system.disk import as_bytes

GROUP, DIGESTS, STRUCTURE = "integrity", "digests", "frame"
BYTES = 16
PIECE = 8 << 20
MAGIC = b"foliot seal\n"
TAIL = BYTES + 4 + len(MAGIC)
MOST_REGIONS = 100_000
BESIDE = "damaged beside the outputs' numbers: in attributes, coordinates, statuses or its structure"

Region = tuple[int, int]


class Digests:
    """The digests of an output's columns while it is written.

    Parameters
    ----------
    columns : the output's columns
    chunks : how its cells are cut
    """

    def __init__(self, columns: Sequence[Column], chunks: Partition) -> None:
        self.columns, self.chunks = tuple(columns), chunks
        self.table = np.zeros((chunks.count, len(self.columns), BYTES), "u1")

    def declare(self, file: Any) -> None:
        """Makes the group in a file of h5netcdf."""
        group = file.create_group(GROUP)
        group.dimensions = {"chunk": self.chunks.count, "column": len(self.columns), "byte": BYTES}
        digests = group.create_variable(DIGESTS, ("chunk", "column", "byte"), "u1", dcpl=unfilled())
        names = " ".join(c.name for c in self.columns)
        digests.attrs.update({"long_name": "xxh3_128 of cells", "columns": names})
        digests.attrs.update({"size": self.chunks.size, "cells": self.chunks.cells})
        structure = group.create_variable(STRUCTURE, ("byte",), "u1", dcpl=unfilled())
        structure.attrs["long_name"] = "xxh3_128 of every byte outside the contiguous columns and outside this"

    def take(self, chunk: int, arrays: Mapping[str, Any]) -> None:
        """Notes the digests of a chunk."""
        self.table[chunk] = column_digests(self.columns, arrays)

    def write(self, file: Any) -> None:
        """Writes the digests to a file of h5py."""
        file[GROUP][DIGESTS][...] = self.table


def column_digests(columns: Sequence[Column], arrays: Mapping[str, Any]) -> Any:
    """Digests of some cells, shape (columns, 16)."""
    found = [xxhash.xxh3_128(as_bytes(np.ascontiguousarray(arrays[c.name]))) for c in columns]
    return np.array([list(state.digest()) for state in found], "u1")


def read_table(file: Any, size: int) -> tuple[list[str], Partition]:
    """What columns a file of so many bytes has digests of, and its chunks. Raises ValueError where they cannot be."""
    digests = file[GROUP][DIGESTS]
    names = str(digests.attrs["columns"]).split()
    cells, step = (int(np.ravel(digests.attrs[key])[0]) for key in ("size", "cells"))
    if min(cells, step) < 1 or digests.nbytes > size or digests.dtype != "u1":
        raise ValueError("its digests cannot be")
    chunks = Partition(cells, step)
    if digests.shape != (chunks.count, len(names), BYTES):
        raise ValueError("its digests do not fit its columns")
    return names, chunks


def structure_place(file: Any) -> int:
    """Where in the file the structure's digest lies."""
    place: int = file[GROUP][STRUCTURE].id.get_offset()
    return place


def structure_digest(fd: int, apart: Iterable[Region]) -> bytes:
    """Digest of all bytes of a file that are in none of the regions (begin, end)."""
    state = xxhash.xxh3_128()
    for begin, end in _gaps(apart, os.fstat(fd).st_size):
        for piece in pieces(fd, begin, end):
            state.update(piece)
    return state.digest()


def trailer(regions: Sequence[Region], fd: int) -> bytes:
    """What to write behind the end of a result. Raises OSError."""
    places = b"".join(struct.pack("<qq", *region) for region in regions)
    found = xxhash.xxh3_128(places + structure_digest(fd, regions)).digest()
    return places + found + struct.pack("<I", len(regions)) + MAGIC


def trailer_bytes(fd: int) -> int:
    """How long the trailer of a file is; 0 where it has none, or one that cannot be. Raises OSError."""
    size = os.fstat(fd).st_size
    tail = os.pread(fd, TAIL, max(0, size - TAIL))
    if len(tail) < TAIL or not tail.endswith(MAGIC):
        return 0
    (count,) = struct.unpack_from("<I", tail, BYTES)
    found = 16 * int(count) + TAIL
    return found if count <= MOST_REGIONS and found <= size else 0


def unbroken(fd: int, most: int | None = None) -> bool | None:
    """Whether all but the outputs' numbers is as it was written; None where no trailer tells, or it is too much.

    Reads no more than `most` bytes. Raises OSError.
    """
    behind = trailer_bytes(fd)
    if not behind:
        return None
    size = os.fstat(fd).st_size
    words = os.pread(fd, behind, size - behind)
    places, digest = words[:-TAIL], words[-TAIL : -TAIL + BYTES]
    regions: list[Region] = list(struct.iter_unpack("<qq", places))
    if any(not 0 <= begin <= end <= size for begin, end in regions):
        return False
    if most is not None and size - sum(end - begin for begin, end in regions) > most:
        return None
    try:
        found = structure_digest(fd, [*regions, (size - behind, size)])
    except DAMAGE:
        return False
    return xxhash.xxh3_128(places + found).digest() == digest


def pieces(fd: int, begin: int, end: int) -> Iterator[bytes]:
    """The bytes from one place to another, some at a time. Raises EOFError where the file ends before."""
    for place in range(begin, end, PIECE):
        piece = os.pread(fd, min(PIECE, end - place), place)
        if len(piece) != min(PIECE, end - place):
            raise EOFError("the file ends early")
        yield piece


def _gaps(apart: Iterable[Region], size: int) -> Iterator[Region]:
    at = 0
    for begin, end in sorted(apart):
        if begin > at:
            yield at, min(begin, size)
        at = max(at, end)
    if at < size:
        yield at, size
