"""Every call that changes the disk, in one place, so that a test can make any of them fail.

A file is either there whole or not there at all: written under a temporary name, fsynced, renamed, and the folder
fsynced. Callers use the functions as attributes of this module (`disk.fsync`).
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from sweep.system.errors import SweepError

NEW = os.O_CREAT | os.O_EXCL | os.O_WRONLY


def open_file(path: Path | str, flags: int) -> int:
    """A file descriptor; a pipe that is to be read is not waited for. Raises OSError."""
    waiting = os.O_NONBLOCK if flags == os.O_RDONLY else 0
    return os.open(path, flags | waiting | getattr(os, "O_CLOEXEC", 0), 0o666)


def write(fd: int, piece: Any) -> int:
    """Bytes written, which may be fewer than asked. Raises OSError."""
    return os.write(fd, piece)


def pwrite(fd: int, piece: Any, offset: int) -> int:
    """Bytes written at `offset`, which may be fewer than asked. Raises OSError."""
    return os.pwrite(fd, piece, offset)


def fsync(fd: int) -> None:
    """Returns when the file is on the disk. Raises OSError."""
    os.fsync(fd)


def rename(old: Path, new: Path) -> None:
    """Takes the place of `new` in one step. Raises OSError."""
    old.replace(new)


def remove(path: Path) -> None:
    """Removes a file; one that is gone already is no fault. Raises OSError."""
    path.unlink(missing_ok=True)


def make_folder(path: Path) -> None:
    """Makes a folder; one that is there already is no fault. Raises OSError."""
    path.mkdir(exist_ok=True)


def write_all(fd: int, pieces: Iterable[Any]) -> None:
    """Writes bytes or C-contiguous arrays one after the other. Raises OSError."""
    for piece in pieces:
        view = as_bytes(piece)
        while view:
            view = view[write(fd, view) :]


def pwrite_all(fd: int, piece: Any, offset: int) -> None:
    """Writes bytes or a C-contiguous array at `offset`. Raises OSError."""
    view = as_bytes(piece)
    while view:
        count = pwrite(fd, view, offset)
        view, offset = view[count:], offset + count


def read_into(fd: int, buffer: Any, offset: int) -> None:
    """Fills an array from the bytes at `offset`. Raises EOFError where the file ends early, OSError."""
    view = as_bytes(buffer)
    while view:
        count = os.preadv(fd, [view], offset)
        if not count:
            raise EOFError(f"the file ends {len(view)} bytes early")
        view, offset = view[count:], offset + count


def forget(fd: int) -> None:
    """Gives the memory that holds the file's bytes back: what is written next takes it, where new memory is dearer."""
    if hasattr(os, "posix_fadvise"):
        os.posix_fadvise(fd, 0, 0, os.POSIX_FADV_DONTNEED)


def sync_folder(path: Path) -> None:
    """Returns when the names in a folder, or the bytes of a file, are on the disk. Raises OSError."""
    fd = open_file(path, os.O_RDONLY)
    try:
        fsync(fd)
    finally:
        os.close(fd)


def sync_tree(path: Path) -> None:
    """Returns when a file, or a folder and all that is in it, is on the disk. Raises OSError."""
    for inner in path.iterdir() if path.is_dir() else ():
        sync_tree(inner)
    sync_folder(path)


def publish(pieces: Iterable[Any], temporary: Path, final: Path) -> None:
    """Writes a file that appears under its final name only when it is whole and on the disk. Raises OSError."""
    try:
        fd = open_file(temporary, NEW)
        try:
            write_all(fd, pieces)
            fsync(fd)
        finally:
            os.close(fd)
        rename(temporary, final)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
    sync_folder(final.parent)


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A file beside `target` to write to, or to put a folder at; synced, it takes the place of `target` at the end.

    Raises SweepError where the system refuses; what was there before then stays.
    """
    part = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        part.touch()  # says in plain words that there is no such folder, or no permission
        yield part
        sync_tree(part)
        _take_place(part, target)
        sync_folder(target.parent)
    except OSError as fault:
        raise SweepError(f"{target} cannot be written: {fault.strerror or fault}") from None
    finally:
        _discard(part)


def _discard(path: Path) -> None:
    """Removes a file or a folder, if it is there."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _take_place(part: Path, target: Path) -> None:
    """Renames `part`. A folder cannot be replaced in one step: the old one is kept until the new one has its place."""
    if not target.exists() or not (target.is_dir() or part.is_dir()):
        rename(part, target)
        return
    old = part.with_suffix(".old")
    rename(target, old)
    try:
        rename(part, target)
    except BaseException:
        old.rename(target)
        raise
    _discard(old)


def try_lock(fd: int) -> bool:
    """Whether this process now holds the lock; the system frees it when the process ends, however it ends."""
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def refusal(fault: OSError | RuntimeError, path: Path) -> SweepError:
    """One line for a call that the system refused; HDF5 tells of some as RuntimeError."""
    number = getattr(fault, "errno", None)
    if number in (errno.ENOSPC, errno.EDQUOT):
        return SweepError(f"{path}: the disk is full; free some space, then run the same command again to continue")
    reason = os.strerror(number) if number else str(fault).splitlines()[0]
    return SweepError(f"{path}: cannot be written ({reason})")


def as_bytes(piece: Any) -> memoryview:
    """The bytes of bytes or of a C-contiguous array."""
    view = memoryview(piece)
    return view.cast("B") if view.nbytes else memoryview(b"")
