"""OUT.h5.unfinished: a result that is written in place, block by block, and renamed when it is complete.

    OUT.h5.unfinished      the result; its structure is whole before the first number is written, and stays as it is
    OUT.h5.unfinished.tmp  for a moment, while that structure is written
    OUT.h5.lock            held while a sweep runs; the system frees it when the process ends

A block is acknowledged when its digests are in the file. They are written after its numbers are on the disk, for many
blocks at a time: numbers, fdatasync, digests. The next sync brings the digests to the disk as well.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sweep.store.frame import ENDINGS, PAGE, UNKNOWN, Frame
from sweep.store.layout import BYTES, DAMAGE, Layout, Table, read_layout
from sweep.store.probe import written
from sweep.store.reading import StoredFile, damaged, unbroken
from sweep.system import disk
from sweep.system.errors import SweepError

SYNC_BYTES = 64 << 20
"""Bytes after which blocks are brought to the disk,"""
SYNC_SECONDS = 0.2
"""or time, where that comes first."""

Gather = Callable[[StoredFile, int], Mapping[str, Any]]
"""Makes a block of the output of a summary from its rows."""


def unfinished_of(output: Path) -> Path:
    """Where a result is while its sweep runs."""
    return output.with_name(output.name + ".unfinished")


def lock_of(output: Path) -> Path:
    """What is locked while a sweep runs; a killed one leaves it behind."""
    return output.with_name(output.name + ".lock")


@dataclass(frozen=True)
class Shared:
    """A file that other processes write blocks to.

    Attributes
    ----------
    path : str
        Where the process that has the lock sees it.
    key : str
        Of this file; another process that finds it in a file of this path sees the same file.
    table : Table
    """

    path: str
    key: str
    table: Table

    def opened(self) -> int | None:
        """A file descriptor; None where this process does not see the file, or may not write to it."""
        try:
            fd = disk.open_file(self.path, os.O_RDWR)
        except OSError:
            return None
        try:
            layout = read_layout(fd, os.fstat(fd).st_size)
        except (OSError, EOFError):
            layout = None
        if layout is not None and layout.key == self.key:
            return fd
        os.close(fd)
        return None


class Store:
    """The result of one sweep while it is written, locked for this process. Made by `opened`.

    Attributes
    ----------
    output, path : Path
        Where the result will be, and where it is.
    layout : Layout or None
        None until `begin` or `resume`.
    """

    def __init__(self, output: Path) -> None:
        self.output, self.path = output, unfinished_of(output)
        self.layout: Layout | None = None
        self._fd = -1
        self._done = np.zeros(0, bool)
        self._waiting: dict[int, bytes] = {}
        self._unsynced, self._synced = 0, time.monotonic()
        self._turn, self._committing = threading.Lock(), threading.Lock()
        self._checker: _Checker | None = None

    @property
    def table(self) -> Table:
        """What is computed."""
        assert self.layout is not None, "the sweep has not begun"
        return self.layout.work

    def found(self) -> Layout | None:
        """What an earlier run left; None where there is nothing. Raises SweepError where it is damaged."""
        try:
            fd = disk.open_file(self.path, os.O_RDONLY)
        except FileNotFoundError:
            return None
        except OSError as fault:
            raise disk.refusal(fault, self.path) from fault
        try:
            layout = read_layout(fd, os.fstat(fd).st_size)
            if layout is not None and unbroken(fd):
                return layout
        except (OSError, EOFError):
            pass
        finally:
            os.close(fd)
        raise SweepError(
            f"{self.path}: damaged beside its numbers, or not of this version; remove it, or give it up with --force"
        )

    def begin(self, frame: Frame) -> None:
        """Makes the file, with room on the disk for all of it. Raises SweepError."""
        temporary = self.temporary
        try:
            fd = disk.open_file(temporary, os.O_CREAT | os.O_TRUNC | os.O_RDWR)
            try:
                frame.write(fd)
                disk.fsync(fd)
            finally:
                os.close(fd)
            disk.rename(temporary, self.path)
            disk.sync_folder(self.path.parent)
        except OSError as fault:
            with contextlib.suppress(OSError):
                disk.remove(temporary)
            raise disk.refusal(fault, self.path) from fault
        self._open(frame.layout)

    def resume(self, layout: Layout) -> None:
        """Takes up what an earlier run left, which is compared with its digests meanwhile. Raises SweepError."""
        self._open(layout)
        try:
            digests = self.table.read_digests(self._fd)
        except (OSError, EOFError) as fault:
            raise SweepError(f"{self.path}: cannot be read ({fault})") from fault
        self._done = digests.any(axis=2).all(axis=1)
        self._checker = _Checker(self.path, layout, np.flatnonzero(self._done))

    def _open(self, layout: Layout) -> None:
        try:
            self._fd = disk.open_file(self.path, os.O_RDWR)
        except OSError as fault:
            raise disk.refusal(fault, self.path) from fault
        self.layout, self._done = layout, np.zeros(layout.work.blocks.count, bool)

    @property
    def temporary(self) -> Path:
        """Where the result is while its structure is written."""
        return self.path.with_name(self.path.name + ".tmp")

    @property
    def count(self) -> int:
        """Blocks that are acknowledged."""
        return int(self._done.sum())

    def missing(self) -> list[int]:
        """Numbers of the blocks that are not done, ascending."""
        return np.flatnonzero(~self._done).tolist()

    def put(self, index: int, arrays: Mapping[str, Any]) -> None:
        """Writes a block; it is acknowledged later, with others. Raises SweepError."""
        try:
            digests = self.table.write(self._fd, index, arrays)
        except OSError as fault:
            raise disk.refusal(fault, self.path) from fault
        with self._turn:
            self._waiting[index] = digests
            self._unsynced += sum(array.nbytes for array in arrays.values())
        self.tick()

    def take(self, index: int, digests: bytes) -> None:
        """Acknowledges a block that another process has written and synced. Raises SweepError."""
        if len(digests) != self.table.row_bytes:
            raise SweepError(f"{self.path}: a worker has written something else than it was asked for")
        with self._turn:
            self._waiting[index] = digests
        self.tick()

    def tick(self) -> None:
        """Acknowledges what is written, if it is time to. Raises SweepError."""
        with self._turn:
            due = self._unsynced >= SYNC_BYTES or time.monotonic() - self._synced >= SYNC_SECONDS
        if due and self._waiting and self._committing.acquire(blocking=False):
            try:
                self._commit()
            finally:
                self._committing.release()

    def commit(self) -> None:
        """Acknowledges all that is written, and brings that to the disk too. Raises SweepError."""
        with self._committing:
            self._commit()
            try:
                disk.sync_numbers(self._fd)
            except OSError as fault:
                raise disk.refusal(fault, self.path) from fault

    def _commit(self) -> None:
        with self._turn:
            waiting, self._waiting, self._unsynced = self._waiting, {}, 0
            self._synced = time.monotonic()
        try:
            if waiting:
                disk.sync_numbers(self._fd)
                write_digests(self._fd, self.table, waiting)
        except OSError as fault:
            raise disk.refusal(fault, self.path) from fault
        self._done[list(waiting)] = True

    def damaged(self) -> list[int]:
        """Blocks of earlier runs that turned out to be damaged; they are not done any more. Raises SweepError."""
        checker, self._checker = self._checker, None
        found = checker.result() if checker is not None else []
        self.undo(found)
        return found

    def undo(self, blocks: Iterable[int]) -> None:
        """Takes blocks out of those that are done. Raises SweepError."""
        nothing = bytes(self.table.row_bytes)
        try:
            write_digests(self._fd, self.table, dict.fromkeys(blocks, nothing))
        except OSError as fault:
            raise disk.refusal(fault, self.path) from fault
        self._done[list(blocks)] = False

    def finish(self, texts: Mapping[str, str], gather: Gather | None) -> list[int]:
        """Puts the result in its place, if it is what was written.

        Parameters
        ----------
        texts : of `ENDINGS`
        gather : of a summary

        Returns
        -------
        list of int
            Blocks that turned out to be damaged, which have to be computed again first.
        """
        assert self.layout is not None
        try:
            self.commit()
            found = self.damaged()
            if not found and gather is not None:
                found = _gathered(self.path, self._fd, self.layout, gather)
                self.undo(found)
            if found:
                return found
            _end(
                self._fd, self.layout, [texts[name].encode().ljust(length)[:length] for name, length in ENDINGS.items()]
            )
            disk.fsync(self._fd)
            self._read_back()
            disk.rename(self.path, self.output)
            disk.sync_folder(self.output.parent)
            written(self.output)
        except OSError as fault:
            raise disk.refusal(fault, self.output) from fault
        return []

    def _read_back(self) -> None:
        """Reads some blocks as any reader would. Raises SweepError where they differ."""
        try:
            with StoredFile(self.path) as file:
                same = file.finished and all(_reads_back(file, block) for block in _some(file))
        except (*DAMAGE, SweepError) as fault:
            if getattr(fault, "errno", None):
                raise
            same = False
        if not same:
            raise SweepError(f"{self.output}: differs when read back from what was written; the disk may be failing")

    def reopen(self, damaged: Iterable[int]) -> None:
        """Takes a finished result up again, some blocks of which are to be computed again. Raises SweepError."""
        try:
            disk.rename(self.output, self.path)
            disk.sync_folder(self.output.parent)
            layout = self.found()
            assert layout is not None
            self._open(layout)
            _unend(self._fd, layout)
        except OSError as fault:
            raise disk.refusal(fault, self.output) from fault
        self.undo(damaged)
        os.close(self._fd)
        self.resume(layout)

    def shared(self) -> Shared | None:
        """What another process needs to write blocks to the file; None where blocks of two would share a page."""
        assert self.layout is not None
        if any((place.all_at(self.table.blocks.count) % PAGE).any() for place in self.table.places):
            return None
        return Shared(str(self.path), self.layout.key, self.table)

    def discard(self) -> None:
        """Removes what is there. Raises SweepError."""
        try:
            disk.remove(self.path)
        except OSError as fault:
            raise disk.refusal(fault, self.path) from fault

    def close(self) -> None:
        """Acknowledges what is written, if that can be, and gives the file back."""
        if self._checker is not None:
            self._checker.stop()
        if self._fd >= 0:
            with contextlib.suppress(SweepError):
                if self._waiting:
                    self.commit()
            os.close(self._fd)
            self._fd = -1


class _Checker:
    """Compares blocks with their digests while something else goes on."""

    def __init__(self, path: Path, layout: Layout, blocks: Any) -> None:
        self._name = layout.work_name
        self._stopped, self._found = threading.Event(), set[int]()
        self._thread = threading.Thread(target=self._check, args=(path, blocks.tolist()), daemon=True)
        self._thread.start()

    def _check(self, path: Path, blocks: list[int]) -> None:
        try:
            with StoredFile(path) as file:
                left = itertools.takewhile(lambda block: not self._stopped.is_set(), blocks)
                self._found.update(block for block, _ in damaged(file, self._name, left))
        except DAMAGE:
            self._found.update(blocks)

    def result(self) -> list[int]:
        """Blocks that are damaged."""
        self._thread.join()
        return sorted(self._found)

    def stop(self) -> None:
        """Returns when it has ended."""
        self._stopped.set()
        self._thread.join()


def write_digests(fd: int, table: Table, digests: Mapping[int, bytes]) -> None:
    """Writes those of some blocks, neighbouring ones at once. Raises OSError."""
    for _, some in itertools.groupby(enumerate(sorted(digests)), lambda pair: pair[1] - pair[0]):
        blocks = [block for _, block in some]
        rows = b"".join(digests[block] for block in blocks)
        disk.write_all(fd, (rows,), table.digests + blocks[0] * table.row_bytes)


def _gathered(path: Path, fd: int, layout: Layout, gather: Gather) -> list[int]:
    """Writes the columns of a summary; gives the blocks of rows that turned out to be damaged, where some did."""
    table, digests = layout.tables["cells"], {}
    with StoredFile(path) as file:
        found = sorted({block for block, _ in damaged(file, "rows", range(layout.work.blocks.count))})
        if found:
            return found
        for block in range(table.blocks.count):
            digests[block] = table.write(fd, block, gather(file, block))
    disk.sync_numbers(fd)
    write_digests(fd, table, digests)
    return []


def _end(fd: int, layout: Layout, texts: list[bytes]) -> None:
    """Writes what is known at the end. Raises OSError."""
    for piece, (begin, _) in zip([*texts, layout.ending_digest(texts)], layout.endings, strict=True):
        disk.write_all(fd, (piece,), begin)


def _unend(fd: int, layout: Layout) -> None:
    """Takes back that the run has ended. Raises OSError."""
    nothing = [*(UNKNOWN[name] for name in ENDINGS), bytes(BYTES)]
    for piece, (begin, _) in zip(reversed(nothing), reversed(layout.endings), strict=True):
        disk.write_all(fd, (piece,), begin)


def _some(file: StoredFile) -> set[int]:
    last = file.layout.tables["cells"].blocks.count - 1
    return {0, last // 2, last}


def _reads_back(file: StoredFile, block: int) -> bool:
    """Whether HDF5 finds the same numbers in a block as its digests tell of."""
    import h5py

    table = file.layout.tables["cells"]
    start, stop = table.blocks.bounds(block)
    with h5py.File(file.path, "r") as other:
        for name, column in file.columns().items():
            cells = column.run(start, stop)
            dataset = other[name]
            first = np.unravel_index(start, table.grid) if table.grid else ()
            last = np.unravel_index(stop - 1, table.grid) if table.grid else ()
            found = dataset[tuple(slice(a, b + 1) for a, b in zip(first, last, strict=True))]
            if np.asarray(found).tobytes() != cells.tobytes():
                return False
    return True


@contextlib.contextmanager
def opened(output: Path) -> Iterator[Store]:
    """The store of an output, held by this process alone. Raises SweepError."""
    lock = lock_of(output)
    store = Store(output)
    try:
        with disk.locked(lock) as ours:
            if not ours:
                raise SweepError(
                    f"{output}: another run is at work on this output; wait for it, or choose another with -o"
                )
            disk.remove(store.temporary)
            try:
                yield store
            finally:
                store.close()
    except OSError as fault:
        raise disk.refusal(fault, lock) from fault
