"""OUT.h5.unfinished: a result written in place, block by block, and renamed when it is complete.

    OUT.h5.unfinished       the result; its structure is complete before the first number and never changes
    .OUT.h5.unfinished.tmp  for a moment, while that structure is written
    OUT.h5.lock             held while a sweep runs; the system frees it when the process ends

A block is acknowledged when its digests are in the file. They are written after its numbers are on the disk, for many
blocks at a time: numbers, fdatasync, digests. The next sync brings the digests to the disk as well.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sweep.cells.fingerprint import difference
from sweep.cells.schema import Schema, ending, now
from sweep.errors import Incomplete, SweepError
from sweep.file import disk
from sweep.file.frame import PAGE, Cut, create, expected_size
from sweep.file.reading import BYTES, UNFINISHED, Damaged, StoredFile
from sweep.words import quantity

OTHERS = (".csv", ".parquet", ".zarr", ".toml", ".png", ".svg", ".pdf", ".html")
"""Suffixes of other kinds of file, which a result cannot have."""
SYNC_SECONDS = 0.2
"""Interval at which blocks are written to the disk, and the file is checked to be in its place."""


def unfinished_of(output: Path) -> Path:
    """Where a result is while its sweep runs."""
    return Path(f"{output}{UNFINISHED}")  # of "." and "/", which have no name, too


def lock_of(output: Path) -> Path:
    """What is locked while a sweep runs; a killed one leaves it behind."""
    return output.with_name(output.name + ".lock")


@contextlib.contextmanager
def alone(output: Path) -> Iterator[None]:
    """No other run writes this output meanwhile. Raises SweepError."""
    if output.suffix in OTHERS:
        raise SweepError(f"{output}: name a result *.h5; `sweep export` converts it to other formats")
    if output.suffix == UNFINISHED:
        raise SweepError(f"{output}: a result that is not finished is called *{UNFINISHED}; choose another name")
    with disk.refusing(output), disk.locked(lock_of(output)) as ours:
        if not ours:
            raise SweepError(f"{output}: another run is writing this output; wait for it, or choose another with -o")
        disk.remove(disk.part_of(unfinished_of(output)))  # of a run that was killed
        yield


def earlier(output: Path, mark: Mapping[str, str], give_up: bool = False) -> Store | None:
    """What an earlier run with this fingerprint left; None where there is nothing, or to `give_up` what is not that.

    Raises SweepError.
    """
    path = unfinished_of(output)
    if not path.exists():
        return None
    with contextlib.suppress(SweepError) if give_up else contextlib.nullcontext():
        store = Store(output)
        if not (changes := difference(store.fingerprint, mark)):
            return store
        store.close()
        raise SweepError(
            f"{path}: the unfinished result of another study or version; finish that one first, choose another name, "
            "or discard it with --force (Python: force=True)" + "".join(f"\n  {line}" for line in changes)
        )
    return None


def begun(output: Path, schema: Schema, cuts: Mapping[str, Cut], shared: bool = False) -> Store:
    """A result of which nothing is computed yet, with room on the disk for all of it. Raises SweepError.

    What an earlier run left is removed first.
    """
    with disk.refusing(output):
        disk.remove(unfinished_of(output))
    needed, free = expected_size(schema, cuts), shutil.disk_usage(output.parent).free
    if needed > free:
        raise SweepError(
            f"{output}: needs {quantity(needed)}, only {quantity(free)} are free here; free some space, choose another "
            "folder, fewer outputs, or keep a [summary] instead of every cell"
        )
    with disk.replacing(unfinished_of(output), held=True) as part:
        create(part, replace(schema, attrs={**schema.attrs, "start": now()}), cuts, shared)
    return Store(output)


def reopened(output: Path) -> Store:
    """A finished result that is taken up again. Raises SweepError."""
    with disk.refusing(output):
        disk.rename(output, unfinished_of(output))
        disk.sync_folder(output.parent)
    return Store(output)


class Store(StoredFile):
    """The result of one sweep while it is written, held by this process alone. To be used with `with`.

    It is at `path`, and will be at `output`, where it is when `finished`. Raises Damaged where its structure is not as
    it was made.
    """

    def __init__(self, output: Path) -> None:
        try:
            super().__init__(unfinished_of(output), os.O_RDWR)
            if not self.is_as_made():
                raise Damaged
        except Damaged:
            self.close()
            cure = "remove it, or discard it with --force (Python: force=True)"
            raise Damaged(f"{self.path}: damaged beside its numbers; {cure}") from None
        status = os.fstat(self.fd)
        self.output, self._mark = output, (status.st_ino, status.st_size)  # of the file: still the one, and as long
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._synced, self._elsewhere = time.monotonic(), False
        self._syncing, self._last = ThreadPoolExecutor(1), Future[None]()  # beside those that compute
        self._last.set_result(None)

    def __exit__(self, *fault: object) -> None:
        """Acknowledges what is written, brings that to the disk if that can be, and gives the file back."""
        with contextlib.suppress(SweepError), disk.refusing(self.path):
            self.commit()
            disk.sync_numbers(self.fd)
        self.close()
        self._syncing.shutdown()

    def resume(self, damaged: Iterable[int]) -> None:
        """Takes up what an earlier run left; blocks that are damaged count as missing. Raises SweepError."""
        with disk.refusing(self.path):
            self.work.write_digests(dict.fromkeys(damaged, bytes(self.work.row_bytes)))

    def put(self, index: int, found: bytes | Mapping[str, Any]) -> None:
        """Writes a block, or takes the digests of one that another process has written and synced. Raises SweepError.

        It is acknowledged by `tick`, with others.
        """
        with disk.refusing(self.path):
            self._elsewhere |= isinstance(found, bytes)
            self._waiting.append((index, found if isinstance(found, bytes) else self.work.write(index, found)))

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
        self._synced = time.monotonic()
        with disk.refusing(self.path):
            if disk.mark(self.path)[:2] != self._mark or os.pread(self.fd, BYTES, self.key_at) != self.key:
                raise Incomplete(
                    f"{self.path}: was moved, removed, cut or overwritten while the run wrote to it; if it was moved, "
                    "move it back, and the same command continues; else remove the rest, and start again"
                )
            if waiting := dict(self._waiting.popleft() for _ in range(len(self._waiting))):
                disk.sync_numbers(self.fd)
                self.work.write_digests(waiting)

    def finish(self, rate: float) -> None:
        """Puts the result, of so many cells a second, in its place; of a summary, its rows are gathered first.

        Raises SweepError where it cannot, and the result stays where it is.
        """
        self.commit()
        cells, end, text = self.tables["cells"], self.tables["ending"], json.dumps(ending(rate))
        with disk.refusing(self.output):
            if self._elsewhere:
                disk.forget(self.fd)
            last = {end: {0: end.write(0, {"ending": np.array([text], "S240")})}}
            if cells is not self.work:
                last[cells] = {b: cells.write(b, self.gathered(b)) for b in range(cells.blocks.count)}
            disk.sync_numbers(self.fd)
            for table, digests in last.items():
                table.write_digests(digests)
            disk.fsync(self.fd)
            count = cells.blocks.count
            if any(cells.damaged({0, (count - 1) // 2, count - 1}).values()):
                raise SweepError(
                    f"{self.output}: differs when read back from what was written; the disk may be failing"
                )
            disk.rename(self.path, self.output)
            self.finished = True
            disk.sync_folder(self.output.parent)

    def shared(self) -> tuple[Path, bytes] | None:
        """By what another process opens the file to write blocks; None where blocks of two would share a page."""
        paged = not any((column.at % PAGE).any() for column in self.work.columns.values())
        return (self.path, self.key) if paged else None
