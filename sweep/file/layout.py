"""Where the numbers of a result stand, and the seal behind its last byte.

The numbers of a column stand in chunks, one a block, each with HDF5's checksum behind it. Digests of all chunks are in
a table in the file, a row of them for each block; a row of zeros is a block that is not done. The seal is

    head          int64: bytes from the beginning of the file to the first chunk, in which HDF5 keeps its structure
    head digest   xxh3 (128 bits) of these
    rest digest   of all other bytes that are in no chunk
    key           random: of this file alone
    MAGIC

A program that changes the file by HDF5 cuts the seal off. HDF5 is let loose on nothing but what has one, or ends where
HDF5 left it: in a damaged structure HDF5 may loop for ever.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import re
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xxhash

from sweep.cells.partition import Partition
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.fletcher import checksum

FORMAT = 4
MAGIC = b"foliot format %d\n" % FORMAT
SEAL = struct.Struct(f"<q16s16s16s{len(MAGIC)}s")
SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""How files of HDF5 begin,"""
FILE_END = slice(28, 36)
"""and where they say how long they are, in the versions from 2 on of their first bytes."""
BYTES = 16
"""Of a digest."""
PIECE = 8 << 20
"""Bytes read at a time."""
ENDING_BYTES = 128
"""Of the text that is written when all is done."""
TABLES, GROUP, ENDING = ("cells", "rows"), "integrity", "integrity/ending"
DAMAGE = (OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, RuntimeError)
"""What comes of reading a damaged file."""


class Seal(NamedTuple):
    """What stands behind the last byte of HDF5."""

    head: int
    head_digest: bytes
    rest_digest: bytes
    key: bytes
    magic: bytes = MAGIC


def read_seal(fd: int, path: Path) -> Seal | None:
    """The seal of a file whose head is as it was written; None where another program has changed the file.

    Raises
    ------
    OSError, EOFError
    ValueError
        It is no file of HDF5, was cut, or its head is damaged.
    SweepError
        It is of another format.
    """
    size = os.fstat(fd).st_size
    begin = read_bytes(fd, 0, min(size, FILE_END.stop))
    tail = read_bytes(fd, size - SEAL.size, size) if size > SEAL.size else b""
    if not begin.startswith(SIGNATURE):
        raise ValueError("it is no file of HDF5")
    whole = begin[8:9] < b"\2" or int.from_bytes(begin[FILE_END], "little") == size
    if tail.endswith(MAGIC):
        seal = Seal(*SEAL.unpack(tail))
        if 0 < seal.head <= size and digest_of(fd, [(0, seal.head)]) == seal.head_digest:
            return seal
    elif re.search(rb"foliot format \d\n$", tail):
        raise SweepError(
            f"{path}: a result of another format; this version of foliot reads format {FORMAT} alone; open it with the "
            "version that wrote it, or compute it again under another name"
        )
    elif whole:
        return None
    raise ValueError("its structure is damaged, or its end is missing, as in a copy that was interrupted")


@dataclass(frozen=True, eq=False)
class Place:
    """Where a column is.

    Attributes
    ----------
    name, dtype : str
    shape : tuple of int
        Of a cell.
    size, check : int
        Bytes of a chunk, and of the checksum behind it; a single number has none.
    at : ndarray of int64, shape (blocks,)
        Where each chunk begins.
    """

    name: str
    dtype: str
    shape: tuple[int, ...]
    size: int
    check: int
    at: Any

    def empty(self, cells: int) -> Any:
        """An uninitialised array of so many cells."""
        return np.empty((cells, *self.shape), self.dtype)


@dataclass(frozen=True, eq=False)
class Table:
    """Columns that are cut alike, and the digests of their chunks.

    Attributes
    ----------
    name : str
        "cells": the output's columns; of a summary also "rows", which they are made of.
    grid, box : tuple of int
        The shape in which the cells stand, and that of a block.
    places : tuple of Place
    digests : int
        Where the digests begin, shape (blocks, columns, 16).
    key : bytes
        Of the file.
    """

    name: str
    grid: tuple[int, ...]
    box: tuple[int, ...]
    places: tuple[Place, ...]
    digests: int
    key: bytes

    @cached_property
    def blocks(self) -> Partition:
        """How the cells are cut into blocks."""
        inner = 1
        for length, some in zip(reversed(self.grid), reversed(self.box), strict=True):
            if some < length:
                return Partition(math.prod(self.grid), inner * some, inner * length)
            inner *= length
        return Partition(inner, inner)

    @property
    def row_bytes(self) -> int:
        """Bytes of the digests of a block."""
        return BYTES * len(self.places)

    def spans(self) -> Any:
        """Begin and end of every chunk and of the digests, shape (n, 2)."""
        own = np.array([[self.digests, self.digests + self.blocks.count * self.row_bytes]], np.int64)
        return np.concatenate([own, *(np.stack([p.at, p.at + p.size + p.check], axis=1) for p in self.places)])

    def digest(self, number: int, block: int, *pieces: Any) -> bytes:
        """Digest of a chunk of a column: of all its bytes, and of whose and which it is."""
        state = xxhash.xxh3_128(self.key + self.name.encode() + struct.pack("<qi", block, number))
        for piece in pieces:
            state.update(disk.as_bytes(piece))
        return state.digest()

    def write(self, fd: int, block: int, arrays: Mapping[str, Any]) -> bytes:
        """Writes the chunks of a block, and gives their digests. Raises OSError."""
        row = b""
        for number, place in enumerate(self.places):
            array, behind = np.ascontiguousarray(arrays[place.name], place.dtype), b""
            if place.check:
                behind = bytes(place.size - array.nbytes) + checksum(array, place.size)
            disk.write_all(fd, (array, behind), int(place.at[block]))
            row += self.digest(number, block, array, behind)
        return row

    def read(self, fd: int, number: int, block: int, digest: bytes, out: Any = None) -> Any:
        """The cells of a block of a column, into `out` where that is given; None where they are not what was written.

        Parameters
        ----------
        out : ndarray, C-contiguous, of the cells of the block
        """
        place, (start, stop) = self.places[number], self.blocks.bounds(block)
        found = place.empty(stop - start) if out is None else out
        behind = bytearray(place.size + place.check - found.nbytes)
        try:
            disk.read_all(fd, (found, behind), int(place.at[block]))
        except (OSError, EOFError):
            return None
        return found if self.digest(number, block, found, behind) == digest else None

    def read_digests(self, fd: int) -> Any:
        """Digests of all chunks, shape (blocks, columns, 16). Raises OSError, EOFError."""
        found = np.empty((self.blocks.count, len(self.places), BYTES), "u1")
        disk.read_all(fd, (found,), self.digests)
        return found

    def write_digests(self, fd: int, digests: Mapping[int, bytes]) -> None:
        """Writes those of some blocks, neighbouring ones at once. Raises OSError."""
        for _, some in itertools.groupby(enumerate(sorted(digests)), lambda pair: pair[1] - pair[0]):
            blocks = [block for _, block in some]
            rows = b"".join(digests[block] for block in blocks)
            disk.write_all(fd, (rows,), self.digests + blocks[0] * self.row_bytes)


def tables_of(file: Any, key: bytes) -> dict[str, Table]:
    """The tables of a result that h5py has opened: HDF5 knows the place of every chunk."""
    found = {}
    for name in TABLES:
        if f"{GROUP}/{name}_digests" not in file:
            continue
        digests, group = file[f"{GROUP}/{name}_digests"], file if name == "cells" else file[name]
        names, depth = json.loads(digests.attrs["columns"])
        places: list[Place] = []
        columns = [group[name] for name in names]
        for column in columns:
            size = column.dtype.itemsize * math.prod(column.chunks or ())
            starts = [c.byte_offset for c in chunks_of(column)] if column.chunks else [column.id.get_offset()]
            shape, check, at = column.shape[depth:], 4 if column.chunks else 0, np.array(starts, np.int64)
            places.append(Place(column.name.split("/")[-1], column.dtype.str, shape, size, check, at))
        grid, box = columns[0].shape[:depth], (columns[0].chunks or ())[:depth]
        found[name] = Table(name, grid, box, tuple(places), int(digests.id.get_offset()), key)
    return found


def chunks_of(dataset: Any) -> list[Any]:
    """Place and size of every chunk of a dataset, as h5py tells them."""
    found: list[Any] = []
    dataset.id.chunk_iter(found.append)
    return found


def gaps(tables: Iterable[Table], ending: int, begin: int, end: int) -> Iterator[tuple[int, int]]:
    """What lies between two places of the file and is no chunk, no digest and no ending."""
    spans = np.concatenate([*(table.spans() for table in tables), [[ending, ending + ENDING_BYTES + 4], [end, end]]])
    spans = spans[np.argsort(spans[:, 0], kind="stable")]
    starts = np.append(begin, spans[:-1, 1])
    apart = starts < spans[:, 0]
    return zip(starts[apart].tolist(), spans[apart, 0].tolist(), strict=True)


def digest_of(fd: int, regions: Iterable[tuple[int, int]]) -> bytes:
    """Digest of the bytes of some regions. Raises OSError, EOFError."""
    state = xxhash.xxh3_128()
    for begin, end in regions:
        for at in range(begin, end, PIECE):
            state.update(read_bytes(fd, at, min(at + PIECE, end)))
    return state.digest()


def read_bytes(fd: int, begin: int, end: int) -> bytes:
    """The bytes of a region. Raises OSError, EOFError."""
    found = bytearray(end - begin)
    disk.read_all(fd, (found,), begin)
    return bytes(found)
