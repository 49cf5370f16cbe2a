"""A file for HDF5 to write to that never fails.

HDF5 may bring the whole process down where one of its own writes fails (a full disk). So this program writes for it,
and a fault waits until HDF5 is not in the middle of something.
"""

from __future__ import annotations

import io
import os
from typing import Any

from sweep import disk


class Canvas(io.RawIOBase):
    """What HDF5 takes for a file.

    Parameters
    ----------
    fd : descriptor of a file that is open for reading and writing

    Attributes
    ----------
    fault : OSError or None
        The first fault. From then on nothing is written to the disk, and HDF5 reads what it believes to have written.
    """

    def __init__(self, fd: int) -> None:
        super().__init__()
        self.fault: OSError | None = None
        self._fd, self._at, self._size = fd, 0, 0
        self._unwritten: list[tuple[int, bytes]] = []

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Moves to a place, which may be past the end."""
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        return self._at

    def tell(self) -> int:
        """The place."""
        return self._at

    def truncate(self, size: int | None = None) -> int:
        """Sets the size, which the file gets in `finish`."""
        self._size = self._at if size is None else size
        return self._size

    def write(self, piece: Any) -> int:
        """Takes all of it, whatever the disk says."""
        view = memoryview(piece).cast("B")
        if self.fault is None:
            try:
                disk.pwrite_all(self._fd, view, self._at)
            except OSError as fault:
                self.fault = fault
        if self.fault is not None:
            self._unwritten.append((self._at, bytes(view)))
        self._at += len(view)
        self._size = max(self._size, self._at)
        return len(view)

    def readinto(self, buffer: Any) -> int:
        """Fills all of it; what was never written is zero."""
        view = memoryview(buffer).cast("B")
        found = os.pread(self._fd, len(view), self._at)
        view[:] = found.ljust(len(view), b"\0")
        for place, piece in self._unwritten:
            begin, end = max(place, self._at), min(place + len(piece), self._at + len(view))
            if begin < end:
                view[begin - self._at : end - self._at] = piece[begin - place : end - place]
        self._at += len(view)
        return len(view)

    def finish(self) -> None:
        """Gives the file its size. Raises OSError where anything went wrong before."""
        self.check()
        os.ftruncate(self._fd, self._size)

    def check(self) -> None:
        """Raises the OSError that came up, if one did."""
        if self.fault is not None:
            raise self.fault

    def readable(self) -> bool:
        """Yes."""
        return True

    def writable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True
