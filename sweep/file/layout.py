"""Where everything stands in a result: found out once, and kept behind the last byte that HDF5 knows of.

    the layout as JSON
    xxh3 (128 bits) of it
    its length    uint32
    MAGIC

HDF5 may loop for ever, or crash, in a file whose structure is damaged, so that is found out by a digest of all bytes
that are no numbers before HDF5 sees the file. The numbers of a column stand in chunks, one a block, each with HDF5's
checksum behind it; `Table.digest` is of all bytes of a chunk, and of whose and which it is.
"""

from __future__ import annotations

import itertools
import json
import struct
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xxhash

from sweep.cells.partition import Partition
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.fletcher import CHECKSUM_BYTES, checksum

MAGIC = b"foliot file\n"
OLD_MAGIC = b"foliot seal\n"
"""What results of formats 1 and 2 end with."""
FORMAT = 3
BYTES = 16
"""Of a digest."""
PIECE = 8 << 20
"""Bytes read at a time."""
TAIL = BYTES + 4 + len(MAGIC)

DAMAGE = (OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, RuntimeError)
"""What comes of reading a damaged file."""

Region = tuple[int, int]


@dataclass(frozen=True)
class Place:
    """Where the chunks of a column are.

    Attributes
    ----------
    name, dtype : str
    shape : tuple of int
        Of a cell.
    chunk_bytes : int
        Bytes of a chunk, a checksum behind them; 0 where cells follow each other and there is no checksum.
    runs : tuple of (first, at, step)
        From chunk number `first` on, each begins `step` bytes behind the one before, the first one `at`.
    """

    name: str
    dtype: str
    shape: tuple[int, ...]
    chunk_bytes: int
    runs: tuple[tuple[int, int, int], ...]

    @property
    def cell_bytes(self) -> int:
        """Bytes of a cell."""
        return int(np.dtype(self.dtype).itemsize * np.prod(self.shape, dtype=np.int64))

    def at(self, chunk: int) -> int:
        """Where a chunk begins."""
        first, at, step = self.runs[bisect_right(self.runs, chunk, key=lambda run: run[0]) - 1]
        return at + (chunk - first) * step

    def all_at(self, count: int) -> Any:
        """Where each of so many chunks begins."""
        firsts, places, steps = np.array(self.runs, np.int64).T
        chunks = np.arange(count, dtype=np.int64)
        run = np.searchsorted(firsts, chunks, "right") - 1
        return places[run] + (chunks - firsts[run]) * steps[run]

    def empty(self, cells: int) -> Any:
        """An uninitialised array of so many cells."""
        return np.empty((cells, *self.shape), self.dtype)


@dataclass(frozen=True)
class Table:
    """Columns that are cut alike, and the digests of their chunks.

    Attributes
    ----------
    grid : tuple of int
        The shape in which the cells stand.
    blocks : Partition
    places : tuple of Place
    digests : int
        Where the digests begin: of each block those of all columns, zeros where it is not done.
    mark : bytes
        Of the study; what every digest begins with.
    """

    grid: tuple[int, ...]
    blocks: Partition
    places: tuple[Place, ...]
    digests: int
    mark: bytes

    @property
    def row_bytes(self) -> int:
        """Bytes of the digests of a block."""
        return BYTES * len(self.places)

    def stored(self, place: Place, block: int) -> int:
        """Bytes that a chunk takes in the file."""
        start, stop = self.blocks.bounds(block)
        return place.chunk_bytes + CHECKSUM_BYTES if place.chunk_bytes else (stop - start) * place.cell_bytes

    def digest(self, number: int, block: int, *pieces: Any) -> bytes:
        """Digest of a chunk of a column, from all of its bytes."""
        state = xxhash.xxh3_128(self.mark and self.mark + struct.pack("<qi", block, number))
        for piece in pieces:
            state.update(disk.as_bytes(piece))
        return state.digest()

    def write(self, fd: int, block: int, arrays: Mapping[str, Any]) -> bytes:
        """Writes the chunks of a block, and gives their digests. Raises OSError."""
        return b"".join(self._write(fd, number, block, arrays) for number in range(len(self.places)))

    def _write(self, fd: int, number: int, block: int, arrays: Mapping[str, Any]) -> bytes:
        place = self.places[number]
        array, behind = np.ascontiguousarray(arrays[place.name], place.dtype), b""
        if place.chunk_bytes:
            behind = bytes(place.chunk_bytes - array.nbytes) + checksum(array, place.chunk_bytes)
        disk.write_all(fd, (array, behind), place.at(block))
        return self.digest(number, block, array, behind)

    def read(self, fd: int, number: int, block: int, digest: bytes, out: Any = None) -> Any:
        """The cells of a block of a column, into `out` where that is given; None where they are not what was written.

        Parameters
        ----------
        out : ndarray, C-contiguous, of the cells of the block
        """
        place = self.places[number]
        start, stop = self.blocks.bounds(block)
        found = place.empty(stop - start) if out is None else out
        behind = bytearray(self.stored(place, block) - found.nbytes)
        try:
            disk.read_all(fd, (found, behind), place.at(block))
        except (OSError, EOFError):
            return None
        return found if self.digest(number, block, found, behind) == digest else None

    def read_digests(self, fd: int) -> Any:
        """Digests of all chunks, shape (blocks, columns, 16). Raises OSError, EOFError."""
        found = np.empty((self.blocks.count, len(self.places), BYTES), "u1")
        disk.read_all(fd, (found,), self.digests)
        return found

    def spans(self) -> Any:
        """Begin and end of every chunk and of the digests, in their order in the file, shape (n, 2)."""
        found = [np.array([[self.digests, self.digests + self.blocks.count * self.row_bytes]], np.int64)]
        for place in self.places:
            at = place.all_at(self.blocks.count)
            ends = [self.stored(place, block) for block in (0, self.blocks.count - 1)]
            found.append(np.stack([at, at + ends[0]], axis=1))
            found[-1][-1, 1] = at[-1] + ends[1]
        whole = np.concatenate(found)
        return whole[np.argsort(whole[:, 0], kind="stable")]


@dataclass(frozen=True)
class Layout:
    """All that is to be known of a result before HDF5 opens it.

    Attributes
    ----------
    key : str
        Of this file alone, in hex digits.
    fingerprint : mapping of str to str
        Of the study.
    begun : str
        When.
    tables : mapping of str to Table
        "cells": the output's columns; of a summary also "rows", which they are made of.
    endings : tuple of Region
        Texts that are written when all is done, and behind them their digest.
    regions : tuple of Region
        Digests and chunks; between those of one region there are zeros alone.
    structure : bytes
        Digest of all other bytes.
    end : int
        Where HDF5's part of the file ends.
    """

    key: str
    fingerprint: Mapping[str, str]
    begun: str
    tables: Mapping[str, Table]
    endings: tuple[Region, ...]
    regions: tuple[Region, ...]
    structure: bytes
    end: int

    @property
    def work_name(self) -> str:
        """Name of the table that is computed."""
        return "rows" if "rows" in self.tables else "cells"

    @property
    def work(self) -> Table:
        """What is computed."""
        return self.tables[self.work_name]

    def trailer(self) -> bytes:
        """What stands behind the end of HDF5's part."""
        text = json.dumps({"format": FORMAT, **asdict(self)}, default=bytes.hex).encode()
        return text + xxhash.xxh3_128(text).digest() + struct.pack("<I", len(text)) + MAGIC

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self.end + len(self.trailer())

    def ending_digest(self, texts: Sequence[bytes | bytearray]) -> bytes:
        """Digest of the texts at the end."""
        return xxhash.xxh3_128(self.key.encode() + b"".join(texts)).digest()


def write_digests(fd: int, table: Table, digests: Mapping[int, bytes]) -> None:
    """Writes those of some blocks, neighbouring ones at once. Raises OSError."""
    for _, some in itertools.groupby(enumerate(sorted(digests)), lambda pair: pair[1] - pair[0]):
        blocks = [block for _, block in some]
        rows = b"".join(digests[block] for block in blocks)
        disk.write_all(fd, (rows,), table.digests + blocks[0] * table.row_bytes)


def gaps(apart: Iterable[Region], size: int) -> Iterator[Region]:
    """What is outside of the regions, up to a place."""
    at = 0
    for begin, end in sorted(apart):
        if begin > at:
            yield at, min(begin, size)
        at = max(at, end)
    if at < size:
        yield at, size


def mark_of(fingerprint: Mapping[str, str], table: str) -> bytes:
    """What the digests of a study's table begin with."""
    words = json.dumps([dict(fingerprint), table], sort_keys=True)
    return xxhash.xxh3_128(words.encode()).digest()


def structure_digest(fd: int, apart: Iterable[Region], end: int) -> bytes:
    """Digest of all bytes before `end` that are in none of the regions. Raises OSError, EOFError."""
    state = xxhash.xxh3_128()
    for begin, stop in gaps(apart, end):
        for at in range(begin, stop, PIECE):
            piece = bytearray(min(PIECE, stop - at))
            disk.read_all(fd, (piece,), at)
            state.update(piece)
    return state.digest()


def read_layout(fd: int, size: int, path: Path | None = None) -> Layout | None:
    """The layout at the end of a file; None where there is none that can be.

    Raises OSError, EOFError; and SweepError where the file of this name is of another format.
    """
    tail = bytearray(TAIL)
    if size < TAIL:
        return None
    disk.read_all(fd, (tail,), size - TAIL)
    if path is not None and tail.endswith(OLD_MAGIC):
        raise _of_another_format(path, "an earlier format")
    (length,) = struct.unpack_from("<I", tail, BYTES)
    if not tail.endswith(MAGIC) or length > size - TAIL:
        return None
    text = bytearray(length)
    disk.read_all(fd, (text,), size - TAIL - length)
    if xxhash.xxh3_128(text).digest() != tail[:BYTES]:
        return None
    try:
        words = json.loads(text)
        if words["format"] == FORMAT:
            return _layout(words, size - TAIL - length)
    except DAMAGE:
        return None
    if path is not None:
        raise _of_another_format(path, f"format {words['format']}")
    return None


def _of_another_format(path: Path, what: str) -> SweepError:
    return SweepError(
        f"{path}: a result of {what}; this version of foliot reads format {FORMAT} alone; open it with the version "
        "that wrote it, or compute it again under another name"
    )


def _layout(words: dict[str, Any], end: int) -> Layout:
    """Raises one of DAMAGE where it cannot be."""
    if words.pop("format") != FORMAT or words["end"] != end:
        raise ValueError("of another file")
    tables = {name: _table(table) for name, table in words.pop("tables").items()}
    found = Layout(
        **{
            **words,
            "tables": tables,
            "structure": bytes.fromhex(words["structure"]),
            "endings": tuple((int(a), int(b)) for a, b in words["endings"]),
            "regions": tuple((int(a), int(b)) for a, b in words["regions"]),
        }
    )
    digests = [(t.digests, t.digests + t.blocks.count * t.row_bytes) for t in tables.values()]
    if any(not 0 <= begin <= stop <= end for begin, stop in (*found.regions, *found.endings, *digests)):
        raise ValueError("places outside of the file")
    return found


def _table(words: dict[str, Any]) -> Table:
    places = tuple(
        Place(p["name"], p["dtype"], tuple(p["shape"]), p["chunk_bytes"], tuple(tuple(run) for run in p["runs"]))
        for p in words["places"]
    )
    blocks = Partition(**words["blocks"])
    if min(blocks.size, blocks.cells) < 1 or blocks.size != np.prod(words["grid"], dtype=np.int64):
        raise ValueError("blocks that cannot be")
    return Table(tuple(words["grid"]), blocks, places, words["digests"], bytes.fromhex(words["mark"]))
