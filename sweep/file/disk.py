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
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from sweep.errors import SweepError, reason
from sweep.words import flag


def open_file(path: Path | str, flags: int) -> int:
    """A file descriptor; a pipe that is to be read is not waited for. Raises OSError."""
    return os.open(path, flags | (os.O_NONBLOCK if flags == os.O_RDONLY else 0), 0o666)


write, rename, fsync = os.pwritev, os.replace, os.fsync
"""`write(fd, pieces, offset)` says how many bytes were written, one piece behind the other; maybe not all. `rename(old,
new)` takes the place of `new` in one step. `fsync(fd)` returns when the file is on the disk. They raise OSError."""
sync_numbers = getattr(os, "fdatasync", os.fsync)
"""Returns when the bytes of a file whose length stays are on the disk."""


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
            if fault.errno not in (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS):
                raise
    os.ftruncate(fd, size)


def remove(path: Path) -> None:
    """Removes a file or a folder; one that is gone already is no fault. Raises OSError."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def write_all(fd: int, pieces: Sequence[Any], offset: int) -> None:
    """Writes bytes or C-contiguous arrays at `offset`, one behind the other. Raises OSError."""
    _through(write, fd, pieces, offset)


def read_all(fd: int, buffers: Sequence[Any], offset: int) -> None:
    """Fills arrays with the bytes from `offset` on. Raises EOFError where the file ends early, OSError."""
    _through(os.preadv, fd, buffers, offset)


def _through(call: Callable[..., int], fd: int, pieces: Sequence[Any], offset: int) -> None:
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


@contextlib.contextmanager
def replacing(target: Path, held: bool = False) -> Iterator[Path]:
    """A file beside `target` to write to, or to put a folder at; synced, it takes the place of `target` at the end.

    Raises SweepError where the system refuses, or another process writes it; what was there before then stays. With
    `held` the caller has a lock of its own, and none is taken here.
    """
    part, old = part_of(target), target.with_name(f".{target.name}.old")
    lock = contextlib.nullcontext(True) if held else locked(target.with_name(f".{target.name}.lock"))
    with refusing(target), lock as ours, contextlib.ExitStack() as stack:
        if not ours:
            raise SweepError(f"{target}: is being written by another process")
        remove(part)  # what one has left that was killed
        stack.callback(remove, part)
        part.touch()  # says in plain words that there is no such folder, or no permission
        yield part
        if target.is_dir() and not part.is_dir():
            raise SweepError(f"{target} is a folder; name a file in it")
        for inner in (*part.rglob("*"), part):
            sync_folder(inner)
        if target.is_dir() or (part.is_dir() and target.exists()):
            # a folder cannot be replaced in one step, and stands aside meanwhile
            remove(old)
            stack.callback(lambda: remove(old) if target.exists() else rename(old, target))
            rename(target, old)
        rename(part, target)
        sync_folder(target.parent)


def part_of(target: Path) -> Path:
    """Where it is written before it takes its place."""
    return target.with_name(f".{target.name}.tmp")


@contextlib.contextmanager
def locked(path: Path) -> Iterator[bool]:
    """Whether this process holds the lock of a name; the system frees it when the process ends, however it ends.

    The file of that name is removed at the end. Raises OSError.
    """
    # closed also at Ctrl-C, or this process would hold the lock for ever
    with os.fdopen(open_file(path, os.O_CREAT | os.O_RDWR)) as file:
        ours = False
        # who held it may have removed the file meanwhile
        with contextlib.suppress(BlockingIOError, FileNotFoundError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            ours = path.stat().st_ino == os.fstat(file.fileno()).st_ino
        try:
            yield ours
        finally:
            with contextlib.suppress(OSError):
                if ours:
                    remove(path)


def mark(path: Path) -> tuple[int, ...]:
    """What another file of this name has not, nor this one once it is changed; () where there is none, or cannot be."""
    try:
        found = path.stat()
    except OSError:
        return ()
    return found.st_ino, found.st_size, found.st_mtime_ns


def check_target(target: Path, *, force: bool = False, read: Sequence[Path] = ()) -> None:
    """Raise SweepError where something is at `target`, unless by `force`, or where it is what is `read`.

    Of folders, which hold what nobody meant to overwrite, only those of zarr are given up.
    """
    force, there = flag("force", force), bool(mark(target))
    with refusing(target):
        if target.is_dir() and not (target / "zarr.json").is_file():
            raise SweepError(f"{target} is a folder; name a file in it")
        if there and any(one.exists() and target.samefile(one) for one in read):
            raise SweepError(f"{target} is the file being read; name another")
    if there and not force:
        raise SweepError(
            f"{target} exists already; name another file, or overwrite it with --force (Python: force=True)"
        )


@contextlib.contextmanager
def refusing(path: Path) -> Iterator[None]:
    """What the system refuses is a SweepError of one line."""
    try:
        yield
    except OSError as fault:
        full = fault.errno in (errno.ENOSPC, errno.EDQUOT)
        cure = "; free some space, then run the same command again" if full else ""
        raise SweepError(f"{path}: cannot be written ({reason(fault)}){cure}") from fault
