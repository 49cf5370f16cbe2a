"""Every call that changes the disk, in one place, so that a test can make any of them fail.

Callers use the functions as attributes of this module (`disk.fsync`). For Linux and macOS, which has neither
`posix_fallocate`, so that a file only gets its length there, nor `fdatasync`.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from sweep.errors import SweepError

NO_SUCH_CALL = (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS)
"""What a file system says that cannot reserve space."""


def open_file(path: Path | str, flags: int) -> int:
    """A file descriptor; a pipe that is to be read is not waited for. Raises OSError."""
    return os.open(path, flags | (os.O_NONBLOCK if flags == os.O_RDONLY else 0), 0o666)


def write(fd: int, pieces: Sequence[memoryview], offset: int) -> int:
    """Bytes of the pieces that were written at `offset`, one piece behind the other; maybe not all. Raises OSError."""
    return os.pwritev(fd, pieces, offset)


def fsync(fd: int) -> None:
    """Returns when the file is on the disk. Raises OSError."""
    os.fsync(fd)


def sync_numbers(fd: int) -> None:
    """Returns when the bytes of a file whose length stays are on the disk. Raises OSError."""
    getattr(os, "fdatasync", os.fsync)(fd)


def forget(fd: int) -> None:
    """What another machine has written is read from the disk, not from what this one remembers of the file (NFS)."""
    if hasattr(os, "posix_fadvise"):
        os.posix_fadvise(fd, 0, 0, os.POSIX_FADV_DONTNEED)


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
    _through(os.preadv, fd, buffers, offset)


def _through(call: Any, fd: int, pieces: Sequence[Any], offset: int) -> None:
    left = [view for piece in pieces if (view := as_bytes(piece))]
    while left:
        count = call(fd, [*left], offset)
        if not count:
            raise EOFError("the file ends early")
        offset += count
        while left and count >= len(left[0]):
            count -= len(left.pop(0))
        if count:
            left[0] = left[0][count:]


def as_bytes(piece: Any) -> memoryview:
    """The bytes of bytes or of a C-contiguous array."""
    view = memoryview(piece)
    return view.cast("B") if view.nbytes else memoryview(b"")


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

    Raises SweepError where the system refuses, or another process writes it; what was there before then stays.
    """
    part, lock = (target.with_name(f".{target.name}.{end}") for end in ("tmp", "lock"))
    try:
        with locked(lock) as ours, contextlib.ExitStack() as stack:
            if not ours:
                raise SweepError(f"{target}: is being written by another process")
            _discard(part)  # what one has left that was killed
            stack.callback(_discard, part)
            part.touch()  # says in plain words that there is no such folder, or no permission
            yield part
            sync_tree(part)
            _renamed(part, target)
            sync_folder(target.parent)
    except OSError as fault:
        raise SweepError(f"{target} cannot be written: {fault.strerror or fault}") from None


def _renamed(part: Path, target: Path) -> None:
    """Puts `part` at the place of `target`; a folder, which cannot be replaced in one step, stands aside meanwhile."""
    old = target.with_name(f".{target.name}.old")
    aside = target.exists() and (target.is_dir() or part.is_dir())
    if aside:
        _discard(old)
        rename(target, old)
    try:
        rename(part, target)
    except OSError:
        if aside:
            rename(old, target)
        raise
    _discard(old)


def _discard(path: Path) -> None:
    """Removes a file or a folder, if it is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


@contextlib.contextmanager
def locked(path: Path) -> Iterator[bool]:
    """Whether this process holds the lock of a name; the system frees it when the process ends, however it ends.

    The file of that name is removed at the end. Raises OSError.
    """
    fd, ours = open_file(path, os.O_CREAT | os.O_RDWR), False
    try:
        # who held it may have removed the file meanwhile
        with contextlib.suppress(BlockingIOError, FileNotFoundError):
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            ours = path.stat().st_ino == os.fstat(fd).st_ino
        yield ours
    finally:
        try:
            if ours:
                with contextlib.suppress(OSError):
                    remove(path)
        finally:  # also at Ctrl-C, or this process would hold the lock for ever
            os.close(fd)


def mark(path: Path) -> tuple[int, ...]:
    """What another file of this name has not, nor this one once it is changed; () where there is none, or cannot be."""
    try:
        found = path.stat()
    except OSError:
        return ()
    return found.st_ino, found.st_size, found.st_mtime_ns


def check_target(target: Path, *, force: bool = False, read: Sequence[Path] = ()) -> None:
    """Raise SweepError where something is at `target`, unless by `force`, or where it is what is `read`."""
    there = bool(mark(target))
    if there and any(one.exists() and target.samefile(one) for one in read):
        raise SweepError(f"{target} is what is read; name another file")
    if there and not force:
        raise SweepError(
            f"{target} is there already; name another file, or overwrite it with --force (Python: force=True)"
        )


def free(path: Path) -> int:
    """Bytes that are free in a folder. Raises OSError."""
    return shutil.disk_usage(path).free


@contextlib.contextmanager
def refusing(path: Path) -> Iterator[None]:
    """What the system refuses is a SweepError of one line."""
    try:
        yield
    except OSError as fault:
        if fault.errno in (errno.ENOSPC, errno.EDQUOT):
            what = "the disk is full; free some space, then run the same command again to continue"
        else:
            what = f"cannot be written ({fault.strerror or str(fault).splitlines()[0]})"
        raise SweepError(f"{path}: {what}") from fault
