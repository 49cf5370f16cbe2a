"""HDF5's table of the chunks of a dataset that does not grow (its "fixed array"), filled in without HDF5.

HDF5 makes the table when the first chunk is written, with room for all, but takes microseconds for each one that it
adds, and writes zeros over it. HDF5 File Format Specification 3.0, section VII.C, all numbers little-endian:

    header    "FAHD", 0, 1 (chunks with a filter), bytes of an entry, log2 of the entries of a page, entries int64,
              address of the block int64
    block     "FADB", 0, 1, address of the header int64; then the entries, where there is no more than a page of them,
              else a bit for each page that is filled
    page      entries
    entry     address of the chunk int64, its bytes, mask of the filters left out int32

Behind each of them, but for entries, stands a checksum. So it does behind the superblock, which tells the file's end.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

HEADER, BLOCK = struct.Struct("<6sBBqq"), struct.Struct("<4sBBq")
SIGNATURE = b"FAHD\0\1"
CHECKSUM_BYTES = 4
SUPERBLOCK = (0, 44)
FILE_END = slice(28, 36)
MIX, FINAL = (4, 6, 8, 16, 19, 4), (14, 11, 25, 16, 4, 14, 24)

Span = tuple[int, int]


@dataclass(frozen=True)
class ChunkIndex:
    """The table of one dataset.

    Attributes
    ----------
    block : int
        Where its block is.
    entry, page, count : int
        Bytes of an entry, most entries of a page, all entries.
    """

    block: int
    entry: int
    page: int
    count: int

    @property
    def pages(self) -> int:
        """How many there are; 0 where the entries stand in the block itself."""
        return -(-self.count // self.page) if self.count > self.page else 0

    @property
    def entries(self) -> int:
        """Where the first entry is."""
        return self.block + BLOCK.size + (-(-self.pages // 8) + CHECKSUM_BYTES if self.pages else 0)

    def first(self, image: bytearray) -> int:
        """Address of the first chunk."""
        return int.from_bytes(image[self.entries : self.entries + 8], "little")

    def fill(self, image: bytearray, at: int, step: int, size: int) -> Iterator[Span]:
        """Enters chunks of `size` bytes each, one every `step` bytes from `at` on; gives what needs a checksum then."""
        entries = np.zeros((self.count, self.entry), np.uint8)
        entries[:, :8] = (at + step * np.arange(self.count, dtype="<i8")).view(np.uint8).reshape(-1, 8)
        entries[:, 8:-4] = np.frombuffer(size.to_bytes(self.entry - 12, "little"), np.uint8)
        bits = np.packbits(np.ones(self.pages, bool)).tobytes()
        image[self.block + BLOCK.size : self.block + BLOCK.size + len(bits)] = bits
        place = self.entries
        if self.pages:
            yield self.block, place - CHECKSUM_BYTES
        for first in range(0, self.count, self.page):
            page = entries[first : first + self.page].tobytes()
            image[place : place + len(page)] = page
            yield place if self.pages else self.block, place + len(page)
            place += len(page) + CHECKSUM_BYTES


def chunk_indexes(image: bytearray) -> Iterator[ChunkIndex]:
    """All tables of a file that is in memory."""
    at = image.find(SIGNATURE)
    while at >= 0:
        end = at + HEADER.size
        if (
            bytes(image[end : end + CHECKSUM_BYTES])
            == checksums(np.frombuffer(image[at:end], np.uint8)[None]).tobytes()
        ):
            _, entry, bits, count, block = HEADER.unpack_from(image, at)
            yield ChunkIndex(block, entry, 1 << bits, count)
        at = image.find(SIGNATURE, at + 1)


def set_end(image: bytearray, end: int) -> Iterator[Span]:
    """Says where the file ends; gives what needs a checksum then."""
    image[FILE_END] = end.to_bytes(8, "little")
    yield SUPERBLOCK


def seal(image: bytearray, spans: Iterable[Span]) -> None:
    """Writes the checksum behind each of the spans."""
    alike: dict[int, list[int]] = {}
    for begin, end in spans:
        alike.setdefault(end - begin, []).append(begin)
    for length, begins in alike.items():
        rows = np.stack([np.frombuffer(image, np.uint8, length, begin) for begin in begins])
        for begin, found in zip(begins, checksums(rows), strict=True):
            image[begin + length : begin + length + CHECKSUM_BYTES] = found.tobytes()


def checksums(rows: Any) -> Any:
    """HDF5's checksum of each of some equally long rows of bytes, shape (n, 4).

    Bob Jenkins' lookup3, its hashlittle beginning with 0: http://burtleburtle.net/bob/c/lookup3.c
    """
    count, length = rows.shape
    words = np.zeros((count, -(-length // 12) * 12), np.uint8)
    words[:, :length] = rows
    steps = np.ascontiguousarray(words.view("<u4").reshape(count, -1, 3).transpose(1, 2, 0))
    a, b, c = (np.full(count, (0xDEADBEEF + length) % 2**32, np.uint32) for _ in range(3))
    for number, (x, y, z) in enumerate(steps, 1):
        a, b, c = a + x, b + y, c + z
        if number < len(steps):
            for turn in MIX:
                a, b, c = b, c + b, (a - c) ^ _turned(c, turn)
    for turn in FINAL:
        a, b, c = b, (c ^ b) - _turned(b, turn), a
    return b.astype("<u4").view(np.uint8).reshape(count, 4)


def _turned(word: Any, bits: int) -> Any:
    """Bits rotated to the left."""
    return word << np.uint32(bits) | word >> np.uint32(32 - bits)
