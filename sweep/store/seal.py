"""A digest behind the end of a result, by which damage to its structure is found before HDF5 reads it.

HDF5 may loop for ever, or crash, in a damaged file. So after its last byte, where HDF5 does not look, there stand

    begin, end of each region of the outputs' numbers    int64, little-endian
    xxh3 (128 bits) of all bytes outside the regions, and of these places themselves
    number of regions    uint32
    MAGIC

A result that carries no such seal, or was changed since, is first read by another process, which may hang or crash.
A seal can be forged, so the command line has each result read so that this process has not written itself.
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import xxhash

from sweep.store.digests import BYTES, Region, frame_digest
from sweep.store.parts import DAMAGE

MAGIC = b"foliot seal\n"
TAIL = BYTES + 4 + len(MAGIC)
MOST_REGIONS = 100_000
MOST_AT_ONCE = 256 << 20
"""Bytes beside the outputs' numbers up to which they are checked when a result is opened."""
BESIDE = "damaged beside the outputs' numbers: in attributes, coordinates, statuses or its structure"
PROBE_SECONDS, PROBE_SPEED = 20.0, 2e8
"""Limit for another process that reads a result; and bytes of the file for each further second."""
PROBE = """
import sys, h5py
def look(name, thing):
    dict(thing.attrs)
    if isinstance(thing, h5py.Dataset):
        if thing.external or thing.is_virtual:
            sys.exit(1)
        thing.id.get_offset(), thing.nbytes
        if thing.chunks:
            for piece in thing.iter_chunks():
                thing[piece]
        else:
            thing[()] if thing.nbytes < 1 << 20 else thing[(slice(0, 1),) * thing.ndim]
with h5py.File(sys.argv[1], "r") as file:
    look("/", file)
    file.visititems(look)
"""
"""Reads what a reader would read, but for numbers that lie in the file as they are."""

_written: set[tuple[int, ...]] = set()
"""Files that this process has written, or has had read, and nobody changed since."""


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


def sealed(path: Path) -> bool:
    """Whether a file is there, can be read, and is sealed and unbroken."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return bool(unbroken(file.fileno(), MOST_AT_ONCE))
    except OSError:
        return False


def readable(path: Path, fd: int) -> bool:
    """Whether HDF5 can be let loose on a result. Raises OSError."""
    # it may have no seal, or have been changed on purpose, or by the disk
    return bool(unbroken(fd, MOST_AT_ONCE)) or probing(path)()


def probing(path: Path) -> Callable[[], bool]:
    """Has another process read a result; what comes back waits for it, and says whether it could. Raises OSError."""
    mark = _mark(path)
    if mark in _written:
        return lambda: True
    words = [sys.executable, "-I", "-c", PROBE, str(path)]
    process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def read() -> bool:
        try:
            found = process.wait(PROBE_SECONDS + path.stat().st_size / PROBE_SPEED) == 0
        except subprocess.TimeoutExpired:
            found = False
        finally:
            process.kill()
            process.wait()
        if found:
            _written.add(mark)
        return found

    return read


def written(path: Path) -> None:
    """Notes that this process has written a file. Raises OSError."""
    _written.add(_mark(path))


def _mark(path: Path) -> tuple[int, ...]:
    found = path.stat()
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


def check_own(group: Any, inner: bool = False) -> None:
    """Raises ValueError where what a group of HDF5 holds lies elsewhere: links and storage in other files are followed.

    A result has none of these, and no groups in groups, which may hold themselves.
    """
    import h5py

    for name in group:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise ValueError(f"{name} is a link")
        thing = group[name]
        if isinstance(thing, h5py.Group) and not inner:
            check_own(thing, inner=True)
        elif not isinstance(thing, h5py.Dataset) or thing.external or thing.is_virtual:
            raise ValueError(f"{name} is not in the file itself")
