"""Every call that changes the disk, in one place, so that a test can make any of them fail.

Callers use the functions as attributes of this module (`disk.fsync`). For Linux and macOS, which has neither
`posix_fallocate`, so that a file only gets its length there, nor `fdatasync`.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import glob
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from sweep.errors import SweepError

NO_SUCH_CALL = (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS)
"""What a file system says that cannot reserve space."""
MOST_BUFFERS = 1000
"""Pieces that one call may write or read; systems allow 1024."""


def open_file(path: Path | str, flags: int) -> int:
    """A file descriptor; a pipe that is to be read is not waited for. Raises OSError."""
    return os.open(path, flags | (os.O_NONBLOCK if flags == os.O_RDONLY else 0), 0o666)


def write(fd: int, pieces: Sequence[memoryview], offset: int) -> int:
    """Bytes of the pieces that were written at `offset`, one piece behind the other; maybe not all. Raises OSError."""
    return os.pwritev(fd, pieces, offset)


def read(fd: int, pieces: Sequence[memoryview], offset: int) -> int:
    """Bytes that were read from `offset` on into the pieces, maybe not all of them. Raises OSError."""
    return os.preadv(fd, pieces, offset)


def fsync(fd: int) -> None:
    """Returns when the file is on the disk. Raises OSError."""
    os.fsync(fd)


def sync_numbers(fd: int) -> None:
    """Returns when the bytes of a file whose length stays are on the disk. Raises OSError."""
    getattr(os, "fdatasync", os.fsync)(fd)


def reserve(fd: int, size: int) -> None:
    """Gives a file its length, and room on the disk for all of it where the system can. Raises OSError."""
    if hasattr(os, "posix_fallocate"):
        try:
            os.posix_fallocate(fd, 0, size)
        except OSError as fault:
            if fault.errno not in NO_SUCH_CALL:
                raise
    os.ftruncate(fd, size)


def rename(old: Path, new: Path) -> None:
    """Takes the place of `new` in one step. Raises OSError."""
    old.replace(new)


def remove(path: Path) -> None:
    """Removes a file; one that is gone already is no fault. Raises OSError."""
    path.unlink(missing_ok=True)


def write_all(fd: int, pieces: Sequence[Any], offset: int) -> None:
    """Writes bytes or C-contiguous arrays at `offset`, one behind the other. Raises OSError."""
    _through(write, fd, pieces, offset)


def read_all(fd: int, buffers: Sequence[Any], offset: int) -> None:
    """Fills arrays with the bytes from `offset` on. Raises EOFError where the file ends early, OSError."""
    _through(read, fd, buffers, offset)


def _through(call: Any, fd: int, pieces: Sequence[Any], offset: int) -> None:
    left = [view for piece in pieces if (view := as_bytes(piece))]
    while left:
        count = call(fd, left[:MOST_BUFFERS], offset)
        if not count:
            raise EOFError("the file ends early")
        offset += count
        while left and count >= len(left[0]):
            count -= len(left.pop(0))
        if count:
            left[0] = left[0][count:]


def place_of(fd: int) -> str:
    """Where the file of a descriptor is now, as far as the system tells; else nothing."""
    try:
        return str(Path(f"/proc/self/fd/{fd}").readlink())
    except OSError:
        return ""


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


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A file beside `target` to write to, or to put a folder at; synced, it takes the place of `target` at the end.

    Raises SweepError where the system refuses; what was there before then stays.
    """
    mark = f".{target.name}.{os.uname().nodename}."
    part = target.with_name(f"{mark}{os.getpid()}.tmp")
    try:
        _discard_left(target, mark)
        part.touch()  # says in plain words that there is no such folder, or no permission
        yield part
        sync_tree(part)
        _take_place(part, target)
        sync_folder(target.parent)
    except OSError as fault:
        raise SweepError(f"{target} cannot be written: {fault.strerror or fault}") from None
    finally:
        _discard(part)


def _discard_left(target: Path, mark: str) -> None:
    """Removes what processes of this machine left that were killed while they wrote to the same name."""
    for path in target.parent.glob(f"{glob.escape(mark)}*"):
        number, _, suffix = path.name.removeprefix(mark).partition(".")
        if number.isdecimal() and (suffix == "tmp" or (suffix == "old" and target.exists())):
            try:
                os.kill(int(number), 0)
            except ProcessLookupError:
                _discard(path)
            except (OSError, OverflowError):
                continue  # it lives, and is somebody else's; or no process has that number


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


@contextlib.contextmanager
def locked(path: Path) -> Iterator[bool]:
    """Whether this process holds the lock of a name; the system frees it when the process ends, however it ends.

    The file of that name is removed at the end. Raises OSError.
    """
    fd = _try_lock(path)
    try:
        yield fd is not None
    finally:
        if fd is not None:
            with contextlib.suppress(OSError):
                remove(path)
            os.close(fd)


def _try_lock(path: Path) -> int | None:
    while True:
        fd = open_file(path, os.O_CREAT | os.O_RDWR)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # who held the lock may have removed the file meanwhile
            with contextlib.suppress(FileNotFoundError):
                if path.stat().st_ino == os.fstat(fd).st_ino:
                    return fd
        except BlockingIOError:
            os.close(fd)
            return None
        except BaseException:
            os.close(fd)
            raise
        os.close(fd)


def free(path: Path) -> int:
    """Bytes that are free in a folder. Raises OSError."""
    return shutil.disk_usage(path).free


def refusal(fault: OSError | RuntimeError, path: Path) -> SweepError:
    """One line for a call that the system refused; HDF5 tells of some as RuntimeError."""
    number = getattr(fault, "errno", None)
    if number in (errno.ENOSPC, errno.EDQUOT):
        return SweepError(f"{path}: the disk is full; free some space, then run the same command again to continue")
    reason = os.strerror(number) if number else str(fault).splitlines()[0]
    return SweepError(f"{path}: cannot be written ({reason})")


@contextlib.contextmanager
def refusing(path: Path) -> Iterator[None]:
    """What the system refuses is a SweepError of one line."""
    try:
        yield
    except OSError as fault:
        raise refusal(fault, path) from fault


def as_bytes(piece: Any) -> memoryview:
    """The bytes of bytes or of a C-contiguous array."""
    view = memoryview(piece)
    return view.cast("B") if view.nbytes else memoryview(b"")
