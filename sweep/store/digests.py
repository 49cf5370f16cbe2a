"""Digests in a result, by which damage to it is found: every byte of the file is under one of them.

In the group `integrity` of the file:

    digests (chunk, column, byte)   xxh3 (128 bits) of the numbers of each column, `cells` of the `size` cells at a time
    frame (byte,)                   the same of all else: every byte outside the outputs' numbers and outside itself

The outputs' numbers lie in the file as they are, so they are read without HDF5.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xxhash

from sweep.cells.partition import Partition
from sweep.cells.schema import Column
from sweep.store.hdf5_bytes import unfilled
from sweep.system.disk import as_bytes

GROUP, DIGESTS, FRAME = "integrity", "digests", "frame"
BYTES = 16
PIECE = 8 << 20

Region = tuple[int, int]


class Seals:
    """The digests of an output's columns while it is written.

    Parameters
    ----------
    columns : the output's columns
    chunks : how its cells are cut
    """

    def __init__(self, columns: Sequence[Column], chunks: Partition) -> None:
        self.columns, self.chunks = tuple(columns), chunks
        self.digests = np.zeros((chunks.count, len(self.columns), BYTES), "u1")

    def declare(self, file: Any) -> None:
        """Makes the group in a file of h5netcdf."""
        group = file.create_group(GROUP)
        group.dimensions = {"chunk": self.chunks.count, "column": len(self.columns), "byte": BYTES}
        digests = group.create_variable(DIGESTS, ("chunk", "column", "byte"), "u1", dcpl=unfilled())
        names = " ".join(c.name for c in self.columns)
        digests.attrs.update({"long_name": "xxh3_128 of cells", "columns": names})
        digests.attrs.update({"size": self.chunks.size, "cells": self.chunks.cells})
        frame = group.create_variable(FRAME, ("byte",), "u1", dcpl=unfilled())
        frame.attrs["long_name"] = "xxh3_128 of every byte outside the contiguous columns and outside this"

    def take(self, chunk: int, arrays: Mapping[str, Any]) -> None:
        """Notes the digests of a chunk."""
        self.digests[chunk] = column_digests(self.columns, arrays)

    def write(self, file: Any) -> None:
        """Writes the digests to a file of h5py."""
        file[GROUP][DIGESTS][...] = self.digests


def column_digests(columns: Sequence[Column], arrays: Mapping[str, Any]) -> Any:
    """Digests of some cells, shape (columns, 16)."""
    found = [xxhash.xxh3_128(as_bytes(np.ascontiguousarray(arrays[c.name]))) for c in columns]
    return np.array([list(state.digest()) for state in found], "u1")


def table(file: Any, size: int) -> tuple[list[str], Partition]:
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


def frame_place(file: Any) -> int:
    """Where in the file the frame's digest lies."""
    place: int = file[GROUP][FRAME].id.get_offset()
    return place


def frame_digest(fd: int, apart: Iterable[Region]) -> bytes:
    """Digest of all bytes of a file that are in none of the regions (begin, end)."""
    state = xxhash.xxh3_128()
    for begin, end in _gaps(apart, os.fstat(fd).st_size):
        for piece in pieces(fd, begin, end):
            state.update(piece)
    return state.digest()


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
