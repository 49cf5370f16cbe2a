"""Where the numbers of a result stand, and the seal behind the last byte of HDF5 that says so.

The numbers of a column stand in chunks, one a block, each with HDF5's checksum behind it. HDF5 places the chunks of a
column at equal distances, but for the first one. Digests of all chunks are in a dataset of the file, a row of them for
each block; a row of zeros is a block that is not done. The seal is

    contents   JSON: tables of columns with the places of their chunks, and the random key of this file
    digest     xxh3 (128 bits) of all bytes that are in no chunk, no digest and not the ending, and of the contents
    length     int64: bytes of the contents
    MAGIC

A program that changes the file by HDF5 cuts the seal off. HDF5 is let loose on nothing but what is sealed, or ends
where HDF5 left it: in a damaged structure HDF5 may loop for ever.
"""

from __future__ import annotations

import itertools
import json
import os
import re
import struct
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xxhash

from sweep.cells.partition import Partition, box_shape
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.fletcher import checksum

FORMAT = 4
MAGIC = b"foliot format %d\n" % FORMAT
SEAL = struct.Struct(f"<16sq{len(MAGIC)}s")
SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""How files of HDF5 begin,"""
FILE_END = slice(28, 36)
"""and where they say how long they are, in the versions from 2 on of their first bytes."""
BYTES = 16
"""Of a digest."""
PIECE = 8 << 20
"""Bytes read at a time."""
GROUP, ENDING, ENDING_BYTES = "integrity", "integrity/ending", 256
"""The group of digests, and in it what is written when all is done: JSON, and its digest."""
DAMAGE = (OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, RuntimeError)
"""What comes of reading a damaged file."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where the chunks of a column are.

    Attributes
    ----------
    name, dtype : str
    shape : tuple of int
        Of a cell.
    size, check : int
        Bytes of a chunk, and of the checksum behind it; a single number has none.
    count : int
        Chunks.
    first, second, step : int
        Where the first one and the second one begin, and how far each other one is from the one before.
    """

    name: str
    dtype: str
    shape: tuple[int, ...]
    size: int
    check: int
    count: int
    first: int
    second: int
    step: int

    @cached_property
    def at(self) -> Any:
        """Where each chunk begins: ndarray of int64, shape (count,)."""
        return np.append(self.first, self.second + self.step * np.arange(self.count - 1, dtype=np.int64))

    def room(self, block: int) -> int:
        """Bytes of a chunk with its checksum, and up to the next chunk where that follows."""
        return self.step if 0 < block < self.count - 1 else self.size + self.check

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
    grid : tuple of int
        The shape in which the cells stand.
    blocks : Partition
        How the cells are cut into blocks.
    places : tuple of Place
    digests : int
        Where the digests begin, shape (blocks, columns, 16).
    key : str
        Of the file.
    """

    name: str
    grid: tuple[int, ...]
    blocks: Partition
    places: tuple[Place, ...]
    digests: int
    key: str

    @property
    def box(self) -> tuple[int, ...]:
        """The shape of a block."""
        return box_shape(self.grid, self.blocks.cells)

    @property
    def row_bytes(self) -> int:
        """Bytes of the digests of a block."""
        return BYTES * len(self.places)

    def digest(self, number: int, block: int, *pieces: Any) -> bytes:
        """Digest of a chunk of a column: of all its bytes, and of whose and which it is."""
        state = xxhash.xxh3_128(f"{self.key} {self.name}".encode() + struct.pack("<qi", block, number))
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
            row += self.digest(number, block, array, behind, bytes(place.room(block) - place.size - place.check))
        return row

    def read(self, fd: int, number: int, block: int, digest: bytes, out: Any = None) -> Any:
        """The cells of a block of a column, into `out` where that is given; None where they are not what was written.

        Parameters
        ----------
        out : ndarray, C-contiguous, of the cells of the block
        """
        place, (start, stop) = self.places[number], self.blocks.bounds(block)
        found = place.empty(stop - start) if out is None else out
        behind = bytearray(place.room(block) - found.nbytes)
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


class Seal(NamedTuple):
    """What the seal of a file tells: its tables by name, where the ending is, and all its bytes."""

    tables: dict[str, Table]
    ending: int
    text: bytes


def contents(tables: Mapping[str, Table], ending: int) -> bytes:
    """What is told of a file in its seal: of so many bytes, whatever stands in the file."""
    return json.dumps({"tables": [asdict(table) for table in tables.values()], "ending": ending}).encode()


def sealed(fd: int, tables: Mapping[str, Table], ending: int, end: int) -> bytes:
    """The seal of a file that HDF5 has written up to `end`. Raises OSError, EOFError."""
    text = contents(tables, ending)
    return text + SEAL.pack(_digest(fd, tables, ending, end, text), len(text), MAGIC)


def read_seal(fd: int, path: Path) -> Seal | None:
    """The seal of a file whose structure is as it was written; None where another program has changed the file.

    Raises
    ------
    OSError, EOFError
    ValueError, KeyError and their like
        It is no file of HDF5, was cut, or its structure is damaged.
    SweepError
        It is of another format.
    """
    size = os.fstat(fd).st_size
    begin = read_bytes(fd, 0, min(size, FILE_END.stop))
    tail = read_bytes(fd, size - SEAL.size, size) if size > SEAL.size else b""
    if not begin.startswith(SIGNATURE):
        raise ValueError("it is no file of HDF5")
    if tail.endswith(MAGIC):
        digest, length, _ = SEAL.unpack(tail)
        if 0 < length <= size - SEAL.size:
            end = size - SEAL.size - length
            text = read_bytes(fd, end, end + length)
            keys, tables = json.loads(text), {}
            for table in keys["tables"]:
                places = tuple(Place(**{**place, "shape": tuple(place["shape"])}) for place in table.pop("places"))
                grid, blocks = tuple(table.pop("grid")), Partition(**table.pop("blocks"))
                tables[table["name"]] = Table(grid=grid, blocks=blocks, places=places, **table)
            if _digest(fd, tables, keys["ending"], end, text) == digest:
                return Seal(tables, keys["ending"], text + tail)
    elif re.search(rb"foliot format \d\n$", tail):
        raise SweepError(
            f"{path}: a result of another format; this version of foliot reads format {FORMAT} alone; open it with the "
            "version that wrote it, or compute it again under another name"
        )
    elif begin[8:9] < b"\2" or int.from_bytes(begin[FILE_END], "little") == size:
        return None
    raise ValueError("its structure is damaged, or its end is missing, as in a copy that was interrupted")


def _digest(fd: int, tables: Mapping[str, Table], ending: int, end: int, text: bytes) -> bytes:
    """Digest of all before `end` that is no chunk, no digest and not the ending, and of a text. Raises OSError."""
    spans = [(ending, ending + ENDING_BYTES), (end, end)]
    for table in tables.values():
        spans.append((table.digests, table.digests + table.blocks.count * table.row_bytes))
        for place in table.places:
            last = place.second + (place.count - 2) * place.step
            more = [(place.second, last + place.size + place.check)] if place.count > 1 else []
            spans += [(place.first, place.first + place.size + place.check), *more]
    state, begin = xxhash.xxh3_128(), 0
    for start, stop in sorted(spans):
        for at in range(begin, start, PIECE):
            state.update(read_bytes(fd, at, min(at + PIECE, start)))
        begin = max(begin, stop)
    state.update(text)
    return state.digest()


def read_bytes(fd: int, begin: int, end: int) -> bytes:
    """The bytes of a region. Raises OSError, EOFError."""
    found = bytearray(end - begin)
    disk.read_all(fd, (found,), begin)
    return bytes(found)
