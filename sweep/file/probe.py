"""Whether HDF5 can be let loose on a result: it may loop for ever, or crash, in a damaged one.

A result that carries no trailer of digests, or was changed since, is first read by another process, which may hang or
crash.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

from sweep.file.reading import unbroken

MOST_AT_ONCE = 256 << 20
"""Bytes beside the outputs' numbers up to which they are checked when a result is opened."""
PROBE_SECONDS, PROBE_SPEED = 20.0, 2e8
"""Limit for another process that reads a result; and bytes of the file for each further second."""
PROBE = """
import math, sys, h5netcdf, h5py
def look(name, thing):
    dict(thing.attrs)
    if isinstance(thing, h5py.Group):
        if not all(isinstance(thing.get(name, getlink=True), h5py.HardLink) for name in thing):
            sys.exit(1)  # what follows a link may wait for ever, or read another file
    if isinstance(thing, h5py.Dataset):
        if thing.external or thing.is_virtual:
            sys.exit(1)
        thing.id.get_offset(), thing.nbytes
        if thing.compression or thing.scaleoffset is not None:
            for piece in thing.iter_chunks():
                thing[piece]
        elif thing.chunks:
            whole, odd = thing.dtype.itemsize * math.prod(thing.chunks) + 4 * thing.fletcher32, []
            thing.id.chunk_iter(lambda chunk: odd.append(chunk) if chunk.filter_mask or chunk.size != whole else None)
            if odd:  # HDF5 reads beyond the end of one that is smaller than it says
                sys.exit(1)
        else:
            thing[()] if thing.nbytes < 1 << 20 else thing[(slice(0, 1),) * thing.ndim]
with h5py.File(sys.argv[1], "r") as file:
    look("/", file)
    file.visititems(look)
with h5netcdf.File(sys.argv[1], "r", phony_dims="access") as file:
    for thing in (file, *file.variables.values()):
        dict(thing.attrs)
"""
"""Reads what a reader would read, and as it would, but for numbers that are not read by HDF5."""


def intact(path: Path) -> bool:
    """Whether a file is there, can be read, and is unbroken by what its trailer says."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return bool(unbroken(file.fileno(), MOST_AT_ONCE))
    except OSError:
        return False


def readable(path: Path, fd: int) -> bool:
    """Whether HDF5 can be let loose on a result. Raises OSError."""
    # without a trailer it was changed, on purpose or by the disk
    return bool(unbroken(fd, MOST_AT_ONCE, path)) or _read_elsewhere(path)


def _read_elsewhere(path: Path) -> bool:
    """Whether another process can read a result. Raises OSError."""
    words = [sys.executable, "-I", "-c", PROBE, str(path)]
    limit = PROBE_SECONDS + path.stat().st_size / PROBE_SPEED
    try:
        return subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, timeout=limit).returncode == 0
    except subprocess.TimeoutExpired:
        return False


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
