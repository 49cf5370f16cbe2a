"""A digest behind the end of a result, by which damage to its structure is found before HDF5 reads it.

HDF5 may loop for ever, or crash, in a damaged file. So after its last byte, where HDF5 does not look, there stand

    begin, end of each region of the outputs' numbers    int64, little-endian
    xxh3 (128 bits) of all bytes outside the regions, and of these places themselves
    number of regions    uint32
    MAGIC

A result that carries no such seal, or was changed since, is first read by another process, which may hang or crash.
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import xxhash

from sweep.store.digests import BYTES, Region, frame_digest
from sweep.store.parts import DAMAGE

MAGIC = b"foliot seal\n"
TAIL = BYTES + 4 + len(MAGIC)
MOST_REGIONS = 100_000
MOST_AT_ONCE = 256 << 20
"""Bytes beside the outputs' numbers up to which they are checked when a result is opened."""
PROBE_SECONDS = 20.0
PROBE = """
import sys, h5py
def look(name, thing):
    dict(thing.attrs)
    if isinstance(thing, h5py.Dataset):
        thing.id.get_offset(), thing.chunks, thing.nbytes
        thing[()] if thing.nbytes < 1 << 20 else thing[(slice(0, 1),) * thing.ndim]
with h5py.File(sys.argv[1], "r") as file:
    look("/", file)
    file.visititems(look)
"""
"""Reads what a reader would read."""


def seal(regions: Sequence[Region], fd: int) -> bytes:
    """The bytes to write behind the end of a result. Raises OSError."""
    places = b"".join(struct.pack("<qq", *region) for region in regions)
    found = xxhash.xxh3_128(places + frame_digest(fd, regions)).digest()
    return places + found + struct.pack("<I", len(regions)) + MAGIC


def length(fd: int) -> int:
    """Bytes of the seal of a file; 0 where it has none, or one that cannot be. Raises OSError."""
    size = os.fstat(fd).st_size
    tail = os.pread(fd, TAIL, max(0, size - TAIL))
    if len(tail) < TAIL or not tail.endswith(MAGIC):
        return 0
    (count,) = struct.unpack_from("<I", tail, BYTES)
    found = 16 * int(count) + TAIL
    return found if count <= MOST_REGIONS and found <= size else 0


def unbroken(fd: int, most: int | None = None) -> bool | None:
    """Whether all but the outputs' numbers is as it was written; None where no seal tells, or it is more than `most`.

    Raises OSError.
    """
    behind = length(fd)
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
        found = frame_digest(fd, [*regions, (size - behind, size)])
    except DAMAGE:
        return False
    return xxhash.xxh3_128(places + found).digest() == digest


def readable(path: Path, fd: int) -> bool:
    """Whether HDF5 can be let loose on a result. Raises OSError."""
    if unbroken(fd, MOST_AT_ONCE):
        return True
    try:
        # it has no seal, or was changed on purpose, or by the disk
        words = [sys.executable, "-I", "-c", PROBE, str(path)]
        return subprocess.run(words, capture_output=True, timeout=PROBE_SECONDS).returncode == 0
    except subprocess.TimeoutExpired:
        return False
