"""OUT.h5.unfinished: a result that is written in place, block by block, and renamed when it is complete.

    OUT.h5.unfinished       the result; its structure is whole before the first number is written, and stays as it is
    .OUT.h5.unfinished.tmp  for a moment, while that structure is written
    OUT.h5.lock             held while a sweep runs; the system frees it when the process ends

A block is acknowledged when its digests are in the file. They are written after its numbers are on the disk, for many
blocks at a time: numbers, fdatasync, digests. The next sync brings the digests to the disk as well.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from sweep.cells.schema import Schema
from sweep.errors import Incomplete, SweepError
from sweep.file import disk
from sweep.file.frame import PAGE, Cut, create
from sweep.file.reading import BYTES, UNFINISHED, Damaged, StoredFile, Table, read_bytes

SYNC_SECONDS = 0.2
"""How often blocks are brought to the disk, and it is looked whether the file is still in its place."""


def unfinished_of(output: Path) -> Path:
    """Where a result is while its sweep runs."""
    return output.with_name(output.name + UNFINISHED)


def lock_of(output: Path) -> Path:
    """What is locked while a sweep runs; a killed one leaves it behind."""
    return output.with_name(output.name + ".lock")


@contextlib.contextmanager
def opened(output: Path) -> Iterator[Store]:
    """The store of an output, held by this process alone. Raises SweepError."""
    with disk.refusing(output), disk.locked(lock_of(output)) as ours:
        if not ours:
            raise SweepError(f"{output}: another run is at work on this output; wait for it, or choose another with -o")
        store = Store(output)
        disk.discard(disk.part_of(store.path))  # of a run that was killed
        try:
            yield store
        finally:
            store.close()


class Store:
    """The result of one sweep while it is written, locked for this process. Made by `opened`.

    It is at `path`, and will be at `output`, where it is when `finished`; `file` is None until `begin` or `resume`.
    """

    def __init__(self, output: Path) -> None:
        self.output, self.path, self.finished = output, unfinished_of(output), False
        self.file: StoredFile | None = None
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._mark: tuple[int, ...] = ()  # of the file: it is still the one, and as long
        self._synced, self._elsewhere = time.monotonic(), False
        self._syncing, self._last = ThreadPoolExecutor(1), Future[None]()  # beside those that compute
        self._last.set_result(None)

    @property
    def table(self) -> Table:
        """What is computed."""
        assert self.file is not None, "the sweep has not begun"
        return self.file.tables[self.file.work]

    def found(self, give_up: bool = False) -> StoredFile | None:
        """What an earlier run left; None where there is nothing, or to `give_up` what is damaged. Raises SweepError."""
        if not self.path.exists():
            return None
        with contextlib.suppress(SweepError if give_up else Damaged):
            file = StoredFile(self.path, os.O_RDWR)
            if file.is_as_made():
                return file
        if give_up:
            return None
        raise SweepError(f"{self.path}: damaged beside its numbers; remove it, or give it up with --force")

    def begin(self, schema: Schema, cuts: Mapping[str, Cut], shared: bool = False) -> None:
        """Makes the file, with room on the disk for all of it. Raises SweepError."""
        with disk.refusing(self.path), disk.made(self.path) as part:
            create(part, schema, cuts, shared)
        self.resume(StoredFile(self.path, os.O_RDWR), ())

    def reopen(self, damaged: Sequence[int]) -> None:
        """Takes a finished result up again, some blocks of which are to be computed again. Raises SweepError."""
        with disk.refusing(self.output):
            disk.rename(self.output, self.path)
            disk.sync_folder(self.output.parent)
        self.resume(StoredFile(self.path, os.O_RDWR), damaged)

    def resume(self, file: StoredFile, damaged: Iterable[int] | None = None) -> list[int]:
        """Takes up what an earlier run left; its damaged blocks count as missing, and are returned.

        `damaged` names them where that is known; None: all blocks that are done are read and compared with their
        digests. Raises SweepError.
        """
        self.file, status, table = file, os.fstat(file.fd), file.tables[file.work]
        self._mark = status.st_ino, status.st_size
        if damaged is None:
            damaged = set[int]().union(*table.damaged(np.flatnonzero(table.done)).values())
        with disk.refusing(self.path):
            table.write_digests(dict.fromkeys(damaged, bytes(table.row_bytes)))
        return sorted(damaged)

    def missing(self) -> list[int]:
        """Numbers of the blocks that are not done, ascending."""
        return np.flatnonzero(~self.table.done).tolist()

    def put(self, index: int, found: bytes | Mapping[str, Any]) -> None:
        """Writes a block, or takes the digests of one that another process has written and synced. Raises SweepError.

        It is acknowledged by `tick`, with others.
        """
        with disk.refusing(self.path):
            self._elsewhere |= isinstance(found, bytes)
            self._waiting.append((index, found if isinstance(found, bytes) else self.table.write(index, found)))

    def tick(self) -> None:
        """Has what is written acknowledged, if it is time to. Raises SweepError where that failed the last time."""
        if self._last.done() and time.monotonic() - self._synced >= SYNC_SECONDS:
            self._last.result()
            self._last = self._syncing.submit(self._commit)

    def commit(self) -> None:
        """Acknowledges all that is written. Raises SweepError."""
        self._last.result()
        self._commit()

    def _commit(self) -> None:
        """By one thread at a time: numbers, then digests.

        Raises SweepError; Incomplete where the file is not what it was, or not where it was: no block counts there.
        """
        file, self._synced = self.table.file, time.monotonic()
        with disk.refusing(self.path):
            if disk.mark(self.path)[:2] != self._mark or read_bytes(file.fd, file.key_at, BYTES) != file.key:
                raise Incomplete(
                    f"{self.path}: was moved, removed, cut or overwritten while the run wrote to it; if it was moved, "
                    "move it back, and the same command continues; else remove what is left, and begin anew"
                )
            if waiting := dict(self._waiting.popleft() for _ in range(len(self._waiting))):
                disk.sync_numbers(file.fd)
                self.table.write_digests(waiting)

    def finish(self, texts: Mapping[str, str]) -> None:
        """Puts the result in its place, with what is known at the end; of a summary, its rows are gathered first.

        Raises SweepError where it cannot, and the result stays where it is.
        """
        self.commit()
        file, cells, ending = self.table.file, *(self.table.file.tables[name] for name in ("cells", "ending"))
        with disk.refusing(self.output):
            if self._elsewhere:
                disk.forget(file.fd)
            made = {ending: {0: ending.write(0, {"ending": np.array([json.dumps(dict(texts))], "S240")})}}
            if cells is not self.table:
                made[cells] = {b: cells.write(b, file.gathered(b)) for b in range(cells.blocks.count)}
            disk.sync_numbers(file.fd)
            for table, digests in made.items():
                table.write_digests(digests)
            disk.fsync(file.fd)
            last = cells.blocks.count - 1
            if any(cells.damaged({0, last // 2, last}).values()):
                raise SweepError(
                    f"{self.output}: differs when read back from what was written; the disk may be failing"
                )
            disk.rename(self.path, self.output)
            self.finished = True
            disk.sync_folder(self.output.parent)

    def shared(self) -> tuple[Path, bytes] | None:
        """By what another process opens the file to write blocks; None where blocks of two would share a page."""
        paged = not any((column.at % PAGE).any() for column in self.table.columns)
        return (self.path, self.table.file.key) if paged else None

    def close(self) -> None:
        """Acknowledges what is written, brings that to the disk if that can be, and gives the file back."""
        if self.file is not None:
            with contextlib.suppress(SweepError), disk.refusing(self.path):
                self.commit()
                disk.sync_numbers(self.file.fd)
            self.file.close()
        self._syncing.shutdown()
