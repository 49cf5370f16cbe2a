"""A file for HDF5 to write to that never fails.

HDF5 may bring the whole process down where one of its own writes fails (a full disk). So this program writes for it,
and a fault waits until HDF5 is not in the middle of something.
"""

from __future__ import annotations

import io
import os
from typing import Any

from sweep.system import disk


class Canvas(io.RawIOBase):
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
