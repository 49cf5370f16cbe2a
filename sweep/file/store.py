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
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from sweep.cells.schema import Schema
from sweep.errors import Incomplete, SweepError
from sweep.file import disk
from sweep.file.frame import PAGE, Cut, create
from sweep.file.reading import BYTES, UNFINISHED, Damaged, StoredFile, Table, ending_text, read_bytes

SYNC_SECONDS = 0.2
"""How often blocks are brought to the disk, and it is looked whether the file is still in its place."""

Gather = Callable[[StoredFile, int], Mapping[str, Any]]
"""Makes a block of the output of a summary from its rows."""


def unfinished_of(output: Path) -> Path:
    """Where a result is while its sweep runs."""
    return output.with_name(output.name + UNFINISHED)


def lock_of(output: Path) -> Path:
    """What is locked while a sweep runs; a killed one leaves it behind."""
    return output.with_name(output.name + ".lock")


class Store:
    """The result of one sweep while it is written, locked for this process. Made by `opened`.

    It is at `path`, and will be at `output`, where it is when `finished`; `file` is None until `begin`, `resume` or
    `reopen`.
    """

    def __init__(self, output: Path) -> None:
        self.output, self.path = output, unfinished_of(output)
        self.temporary = self.path.with_name(self.path.name + ".tmp")
        self.file: StoredFile | None = None
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._synced, self._size, self._elsewhere = time.monotonic(), 0, False
        self._checked: Future[list[int]] | None = None
        self._closing = threading.Event()
        self.finished = False

    @property
    def table(self) -> Table:
        """What is computed."""
        assert self.file is not None, "the sweep has not begun"
        return self.file.tables[self.file.work]

    def found(self) -> StoredFile | None:
        """What an earlier run left; None where there is nothing. Raises SweepError where it is damaged."""
        if not self.path.exists():
            return None
        try:
            file = StoredFile(self.path, os.O_RDWR)
            if file.is_as_made():
                return file
        except Damaged:
            pass
        raise SweepError(f"{self.path}: damaged beside its numbers; remove it, or give it up with --force")

    def begin(self, schema: Schema, cuts: Mapping[str, Cut], shared: bool = False) -> None:
        """Makes the file, with room on the disk for all of it. Raises SweepError."""
        with disk.refusing(self.path):
            try:
                file = create(self.temporary, schema, cuts, shared)
                disk.rename(self.temporary, self.path)
                disk.sync_folder(self.path.parent)
            except OSError:
                with contextlib.suppress(OSError):
                    disk.remove(self.temporary)
                raise
            file.path = self.path
            self._take_up(file)

    def resume(self, file: StoredFile) -> None:
        """Takes up what an earlier run left, which is compared with its digests meanwhile. Raises SweepError."""
        self._take_up(file)
        done = np.flatnonzero(self.table.done).tolist()
        left = itertools.takewhile(lambda block: not self._closing.is_set(), done)
        self._checked = ThreadPoolExecutor(1).submit(self.table.damaged, left)

    def _take_up(self, file: StoredFile) -> None:
        if file.ending:  # it was killed just before it was renamed, or is taken up again
            file.ending = {}
            with disk.refusing(self.path):
                disk.write_all(file.fd, (ending_text({}),), file.ending_at)
        self.file, self._size = file, os.fstat(file.fd).st_size

    def _check(self) -> None:
        """Raises Incomplete where the file is not what it was, or not where it was: no block of ours counts there."""
        assert self.file is not None
        ours = os.fstat(self.file.fd)
        try:
            there = os.path.samestat(self.path.stat(), ours)
        except OSError as fault:
            there = not isinstance(fault, FileNotFoundError | NotADirectoryError)  # a network may be slow to answer
        if not there or ours.st_size < self._size or read_bytes(self.file.fd, self.file.key_at, BYTES) != self.file.key:
            raise Incomplete(
                f"{self.path}: was moved, removed, cut or overwritten while the run wrote to it; if it was moved, move "
                "it back, and the same command continues; else remove what is left, and begin anew"
            )

    @property
    def count(self) -> int:
        """Blocks that are acknowledged."""
        return int(self.table.done.sum())

    def missing(self) -> list[int]:
        """Numbers of the blocks that are not done, ascending."""
        return np.flatnonzero(~self.table.done).tolist()

    def put(self, index: int, arrays: Mapping[str, Any]) -> None:
        """Writes a block; it is acknowledged by `tick`, with others. Raises SweepError."""
        with disk.refusing(self.path):
            self._waiting.append((index, self.table.write(index, arrays)))

    def take(self, index: int, digests: bytes) -> None:
        """Acknowledges, by `tick`, a block that another process has written and synced."""
        self._elsewhere = True
        self._waiting.append((index, digests))

    def tick(self) -> None:
        """Acknowledges what is written, if it is time to. Raises SweepError."""
        if time.monotonic() - self._synced >= SYNC_SECONDS:
            self._commit()

    def commit(self) -> None:
        """Acknowledges all that is written, and brings that to the disk too. Raises SweepError."""
        self._commit()
        with disk.refusing(self.path):
            disk.sync_numbers(self.table.file.fd)

    def _commit(self) -> None:
        """By one thread at a time."""
        self._check()
        self._synced = time.monotonic()
        waiting = dict(self._waiting.popleft() for _ in range(len(self._waiting)))
        with disk.refusing(self.path):
            if waiting:
                disk.sync_numbers(self.table.file.fd)
                self.table.write_digests(waiting)

    def _undo(self, blocks: Iterable[int]) -> None:
        """Takes blocks out of those that are done. Raises SweepError."""
        with disk.refusing(self.path):
            self.table.write_digests(dict.fromkeys(blocks, bytes(self.table.row_bytes)))

    def finish(self, texts: Mapping[str, str], gather: Gather | None) -> list[int]:
        """Puts the result in its place, with what is known at the end; of a summary, its rows are gathered first.

        Returns the blocks that turned out to be damaged, or are not acknowledged: there are none, or the result stays
        where it is, and they have to be computed again. Raises SweepError.
        """
        file, cells = self.table.file, self.table.file.tables["cells"]
        with disk.refusing(self.output):
            self.commit()
            if self._elsewhere:
                disk.forget(file.fd)
            checked, self._checked = self._checked, None
            self._undo(checked.result() if checked is not None else [])
            found = self.missing()
            if not found and gather is not None:
                found = self.table.damaged(range(self.table.blocks.count))
                self._undo(found)
                if not found:
                    digests = {block: cells.write(block, gather(file, block)) for block in range(cells.blocks.count)}
                    disk.sync_numbers(file.fd)
                    cells.write_digests(digests)
            if found:
                return found
            disk.write_all(file.fd, (ending_text(texts),), file.ending_at)
            disk.fsync(file.fd)
            last = cells.blocks.count - 1
            if cells.damaged({0, last // 2, last}):
                raise SweepError(
                    f"{self.output}: differs when read back from what was written; the disk may be failing"
                )
            disk.rename(self.path, self.output)
            self.finished = True
            disk.sync_folder(self.output.parent)
        return []

    def reopen(self, damaged: Iterable[int]) -> None:
        """Takes a finished result up again, some blocks of which are to be computed again. Raises SweepError."""
        with disk.refusing(self.output):
            disk.rename(self.output, self.path)
            disk.sync_folder(self.output.parent)
            file = self.found()
            assert file is not None
            self._take_up(file)
            self._undo(damaged)

    def shared(self) -> tuple[Path, bytes] | None:
        """By what another process opens the file to write blocks; None where blocks of two would share a page."""
        paged = not any((column.at % PAGE).any() for column in self.table.columns)
        return (self.path, self.table.file.key) if paged else None

    def discard(self) -> None:
        """Removes what is there. Raises SweepError."""
        with disk.refusing(self.path):
            disk.remove(self.path)

    def close(self) -> None:
        """Acknowledges what is written, if that can be, and gives the file back."""
        self._closing.set()
        if self._checked is not None:
            self._checked.result()
        if self.file is not None:
            with contextlib.suppress(SweepError):
                if self._waiting:
                    self.commit()
            self.file.close()


@contextlib.contextmanager
def opened(output: Path) -> Iterator[Store]:
    """The store of an output, held by this process alone. Raises SweepError."""
    lock, store = lock_of(output), Store(output)
    with disk.refusing(output), disk.locked(lock) as ours:
        if not ours:
            raise SweepError(f"{output}: another run is at work on this output; wait for it, or choose another with -o")
        disk.remove(store.temporary)
        try:
            yield store
        finally:
            store.close()
