"""Bytes of HDF5 files: of one that HDF5 writes without ever failing, and of parts, which cost no call of HDF5.

HDF5 may bring the whole process down where one of its own writes fails (a full disk). So this program writes for it,
and a fault waits until HDF5 is not in the middle of something.

HDF5 lays out one empty part per block length, once; a part is then the same bytes with its numbers in their places and
its range patched in: no HDF5 call (those run one at a time) and no copy of its columns.
"""

from __future__ import annotations

import io
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sweep.cells.schema import Column
from sweep.system import disk

START, STOP = 0x5EED0F0115EA5E01, 0x5EED0F0115EA5E02
"""Marks that HDF5 writes for the attributes start and stop; every part has its own numbers there."""


class Hdf5Bytes(io.RawIOBase):
    """What HDF5 takes for a file.

    Parameters
    ----------
    fd : descriptor of a file that is open for reading and writing; None: all of it stays in memory

    Attributes
    ----------
    size : int
    fault : OSError or None
        The first fault. From then on nothing is written to the disk, and HDF5 reads what it believes to have written.
    """

    def __init__(self, fd: int | None = None) -> None:
        super().__init__()
        self.fault: OSError | None = None
        self.size = 0
        self._fd, self._at = fd, 0
        self._unwritten: list[tuple[int, bytes]] = []

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Moves to a place, which may be past the end."""
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self.size}[whence]
        return self._at

    def tell(self) -> int:
        """The place."""
        return self._at

    def truncate(self, size: int | None = None) -> int:
        """Sets the size, which the file gets in `finish`."""
        self.size = self._at if size is None else size
        return self.size

    def write(self, piece: Any) -> int:
        """Takes all of it, whatever the disk says."""
        view = memoryview(piece).cast("B")
        if not self._reaches_disk(view):
            self._unwritten.append((self._at, bytes(view)))
        self._at += len(view)
        self.size = max(self.size, self._at)
        return len(view)

    def readinto(self, buffer: Any) -> int:
        """Fills all of it; what was never written is zero."""
        view = memoryview(buffer).cast("B")
        found = b"" if self._fd is None else os.pread(self._fd, len(view), self._at)
        view[:] = found.ljust(len(view), b"\0")
        for place, piece in self._unwritten:
            begin, end = max(place, self._at), min(place + len(piece), self._at + len(view))
            if begin < end:
                view[begin - self._at : end - self._at] = piece[begin - place : end - place]
        self._at += len(view)
        return len(view)

    def piece(self, start: int, stop: int) -> bytes:
        """The bytes from one place to another."""
        found = bytearray(stop - start)
        self.seek(start)
        self.readinto(found)
        return bytes(found)

    def finish(self) -> None:
        """Gives the file its size. Raises OSError where anything went wrong before."""
        self.check()
        if self._fd is not None:
            os.ftruncate(self._fd, self.size)

    def check(self) -> None:
        """Raises the OSError that came up, if one did."""
        if self.fault is not None:
            raise self.fault

    def _reaches_disk(self, view: memoryview) -> bool:
        if self._fd is None or self.fault is not None:
            return False
        try:
            disk.pwrite_all(self._fd, view, self._at)
        except OSError as fault:
            self.fault = fault
        return self.fault is None

    def readable(self) -> bool:
        """Yes."""
        return True

    def writable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True


@dataclass(frozen=True)
class Template:
    """An HDF5 file without the numbers of its columns.

    Attributes
    ----------
    pieces : the bytes between the columns, and in place of each column its name, in the order of the file
    places : where each column begins
    size : bytes of the file
    """

    pieces: tuple[bytes | str, ...]
    places: Mapping[str, int]
    size: int


class PartBytes:
    """Parts of one study as bytes, for any block length.

    Parameters
    ----------
    columns : the columns of a part, in the order of its datasets
    mark : what the digests of the parts begin with
    """

    def __init__(self, columns: Sequence[Column], mark: bytes = b"") -> None:
        self.columns, self.mark = tuple(columns), mark
        self._templates: dict[int, Template] = {}
        self._lock = threading.Lock()

    def template(self, cells: int) -> Template:
        """The template of blocks of that length."""
        with self._lock:
            if cells not in self._templates:
                self._templates[cells] = _template(self.columns, cells)
            return self._templates[cells]

    def pieces(self, start: int, stop: int, arrays: Mapping[str, Any]) -> list[Any]:
        """What to write one after the other: bytes, and the C-contiguous arrays themselves."""
        template = self.template(stop - start)
        return [arrays[p] if isinstance(p, str) else _patched(p, start, stop) for p in template.pieces]

    def between(self, start: int, stop: int) -> Iterator[tuple[int, bytes]]:
        """All bytes of a part that are no column's: where they begin, and what they are."""
        template, at = self.template(stop - start), 0
        widths = {column.name: column.cell_bytes for column in self.columns}
        for piece in template.pieces:
            if isinstance(piece, bytes):
                yield at, _patched(piece, start, stop)
            at += (stop - start) * widths[piece] if isinstance(piece, str) else len(piece)


def _template(columns: Sequence[Column], cells: int) -> Template:
    hdf5, places = _empty_file(columns, cells)
    pieces: list[bytes | str] = []
    at = 0
    for column in sorted(columns, key=lambda c: places[c.name]):
        pieces += [hdf5.piece(at, places[column.name]), column.name]
        at = places[column.name] + cells * column.cell_bytes
    return Template((*pieces, hdf5.piece(at, hdf5.size)), places, hdf5.size)


def _empty_file(columns: Sequence[Column], cells: int) -> tuple[Hdf5Bytes, dict[str, int]]:
    import h5py

    hdf5 = Hdf5Bytes()
    # "earliest" writes attributes without checksums, so that they can be patched
    with h5py.File(hdf5, "w", libver="earliest") as file:
        file.attrs["start"], file.attrs["stop"] = np.int64(START), np.int64(STOP)
        for column in columns:
            dataset = file.create_dataset(column.name, (cells, *column.shape), column.dtype, dcpl=unfilled())
            for key in ("units", "long_name", "flag_values", "flag_meanings"):
                if key in column.attrs:
                    dataset.attrs[key] = column.attrs[key]
        return hdf5, {column.name: file[column.name].id.get_offset() for column in columns}


def unfilled() -> Any:
    """Creation properties of a dataset that has its place in the file at once and is not filled by HDF5."""
    from h5py import h5d, h5p

    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5d.FILL_TIME_NEVER)
    return properties


def _patched(piece: bytes, start: int, stop: int) -> bytes:
    return piece.replace(_mark(START), _mark(start)).replace(_mark(STOP), _mark(stop))


def _mark(number: int) -> bytes:
    return np.int64(number).tobytes()
