"""Numbers of a result, finished or not, that are compared with their digests before they are handed out.

No call of HDF5 is needed for them (those run one at a time): chunks are read from where they stand, by any thread.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from kernels.interface import Status
from sweep.cells.schema import METHOD_USED, STATUS
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.chunk_index import FILE_END
from sweep.file.layout import Layout, Table, read_layout, structure_digest

SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""How files of HDF5 begin."""
READERS = 4
"""Threads that read a long run of cells."""
LONG_RUN = 32 << 20
"""Bytes from which they do."""
SHORT_RUN = 64
"""Cells; of a selection of shorter runs each cell is looked up."""


class StoredFile:
    """A result of this program, open for reading.

    Attributes
    ----------
    path : Path
    layout : Layout
    finished : bool
        Whether all is there; else what is missing or damaged is handed out as NaN and PENDING.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError
        It is none of ours.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.fd = disk.open_file(path, os.O_RDONLY)
        try:
            size = os.fstat(self.fd).st_size
            layout = read_layout(self.fd, size, path)
            if layout is None:
                raise ValueError("it is no result, or was changed")
            self._digests = {name: table.read_digests(self.fd) for name, table in layout.tables.items()}
            self.finished = has_ended(self.fd, layout)
            self.layout: Layout = layout
        except BaseException:
            self.close()
            raise
        self._sound = {name: np.zeros(table.blocks.count, bool) for name, table in layout.tables.items()}

    def __enter__(self) -> StoredFile:
        return self

    def __exit__(self, *fault: object) -> None:
        self.close()

    def __reduce__(self) -> Any:
        return StoredFile, (self.path,)

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Gives the file back; nothing can be read from then on."""
        fd, self.fd = getattr(self, "fd", -1), -1
        if fd >= 0:
            os.close(fd)

    def done(self, name: str) -> Any:
        """Which blocks of a table have digests."""
        return self._digests[name].any(axis=2).all(axis=1)

    def digest(self, name: str, block: int, number: int) -> bytes:
        """Of a block of a column, as it stands in the file."""
        return bytes(self._digests[name][block, number])

    def is_sound(self, name: str, block: int) -> bool:
        """Whether all columns of a block are there and as they were written; looked at once."""
        if not self._sound[name][block] and self._digests[name][block].any(axis=1).all():
            table = self.layout.tables[name]
            self._sound[name][block] = all(
                table.read(self.fd, number, block, self.digest(name, block, number)) is not None
                for number in range(len(table.places))
            )
        return bool(self._sound[name][block])

    def columns(self, name: str = "cells") -> dict[str, Numbers]:
        """The columns of a table."""
        return {p.name: Numbers(self, name, k) for k, p in enumerate(self.layout.tables[name].places)}


class Numbers:
    """A column over its grid: numbers by indices and slices, checked.

    Attributes
    ----------
    shape : tuple of int
    dtype : dtype
    """

    def __init__(self, file: StoredFile, name: str, number: int) -> None:
        self.file, self.name, self.number = file, name, number
        self.table: Table = file.layout.tables[name]
        self.place = self.table.places[number]
        self.shape, self.dtype = (*self.table.grid, *self.place.shape), np.dtype(self.place.dtype)
        self._last: tuple[int, Any] = -1, None

    def __reduce__(self) -> Any:
        return Numbers, (self.file, self.name, self.number)

    def __getitem__(self, key: Any) -> Any:
        """By an index or a slice for each dimension, or for the first ones. Raises SweepError where damaged."""
        key = key if isinstance(key, tuple) else (key,)
        key = (*(k for k in key if k is not Ellipsis), *[slice(None)] * len(self.shape))[: len(self.shape)]
        count = len(self.table.grid)
        starts, length = runs(key[:count], self.table.grid)
        if len(starts) == 1 or length >= SHORT_RUN:
            found = [self.run(int(start), int(start) + length) for start in starts]
            cells = found[0] if len(found) == 1 else np.concatenate([self.place.empty(0), *found])
        else:
            cells = self.cells((starts[:, None] + np.arange(length)).ravel())
        kept = [len(range(n)[k]) for n, k in zip(self.table.grid, key, strict=False) if isinstance(k, slice)]
        return cells.reshape((*kept, *self.place.shape))[(*[slice(None)] * len(kept), *key[count:])]

    def run(self, start: int, stop: int) -> Any:
        """The cells from one number to another."""
        out = self.place.empty(max(0, stop - start))
        blocks = range(self.table.blocks.index(start), self.table.blocks.index(stop - 1) + 1) if stop > start else ()

        def fill(block: int) -> None:
            first, last = self.table.blocks.bounds(block)
            low, high = max(first, start), min(last, stop)
            if (low, high) == (first, last):
                self._read(block, out[low - start : high - start])
            else:
                out[low - start : high - start] = self._block(block)[low - first : high - first]

        if out.nbytes >= LONG_RUN and len(blocks) > 1:
            with ThreadPoolExecutor(READERS) as pool:
                list(pool.map(fill, blocks))
        else:
            for block in blocks:
                fill(block)
        return out

    def cells(self, numbers: Any) -> Any:
        """The cells of these numbers, in any order."""
        out, blocks = self.place.empty(len(numbers)), self.table.blocks.index(numbers)
        order = np.argsort(blocks, kind="stable")
        for some in np.split(order, np.flatnonzero(np.diff(blocks[order])) + 1):
            if len(some):
                block = int(blocks[some[0]])
                out[some] = self._block(block)[numbers[some] - self.table.blocks.bounds(block)[0]]
        return out

    def _block(self, block: int) -> Any:
        last, cells = self._last
        if last != block:
            start, stop = self.table.blocks.bounds(block)
            cells = self.place.empty(stop - start)
            self._read(block, cells)
            self._last = block, cells
        return cells

    def _read(self, block: int, out: Any) -> None:
        """Fills in the cells of a block. Raises SweepError where it is damaged, or the file is closed."""
        if self.file.fd < 0:
            raise SweepError(f"{self.file.path}: is closed; open it again to read {self.place.name}")
        digest = self.file.digest(self.name, block, self.number)
        wanted = self.file.finished or self.file.is_sound(self.name, block)
        if wanted and self.table.read(self.file.fd, self.number, block, digest, out) is not None:
            return
        if self.file.finished:
            start, stop = self.table.blocks.bounds(block)
            raise SweepError(
                f"{self.file.path}: {self.place.name} is damaged between its cells {start:,} and {stop:,}; sweep "
                "verify tells of all damage, and sweep run --repair computes the damaged cells again"
            )
        out[...] = missing(self.place.name)


def missing(name: str) -> float | int:
    """What stands for a cell of a column that is not computed yet."""
    return {STATUS: int(Status.PENDING), METHOD_USED: -1}.get(name, math.nan)


def runs(key: Sequence[Any], grid: tuple[int, ...]) -> tuple[Any, int]:
    """The flat cells of a key of indices and slices, as runs: where each starts, and their length."""
    length, step, left = 1, 1, len(grid)
    while left and isinstance(key[left - 1], slice) and range(grid[left - 1])[key[left - 1]] == range(grid[left - 1]):
        left -= 1
        length, step = length * grid[left], step * grid[left]
    offset = 0
    if left and isinstance(key[left - 1], slice) and (some := range(grid[left - 1])[key[left - 1]]).step == 1:
        left -= 1
        offset, length, step = some.start * step, length * len(some), step * grid[left]
    starts = np.full(1, offset, np.int64)
    for k, n in zip(reversed(key[:left]), reversed(grid[:left]), strict=True):
        starts = (np.atleast_1d(np.arange(n, dtype=np.int64)[k])[:, None] * step + starts).ravel()
        step *= n
    return starts, length


def has_ended(fd: int, layout: Layout) -> bool:
    """Whether the texts that are written at the end of a run are there. Raises OSError, EOFError."""
    *texts, digest = (_bytes(fd, begin, end) for begin, end in layout.endings)
    return layout.ending_digest(texts) == digest


def unbroken(fd: int, most: float = math.inf, path: Path | None = None) -> bool | None:
    """Whether all but the numbers is as it was written; None where no trailer tells, or where it is too much.

    Reads no more than `most` bytes. Raises OSError, also where neither a trailer nor HDF5 tells of the last bytes; and
    SweepError where the file of this name is of another format.
    """
    size = os.fstat(fd).st_size
    try:
        layout = read_layout(fd, size, path)
        if layout is None:
            _require_whole(fd, size)
            return None
        if layout.end - sum(stop - begin for begin, stop in layout.regions) > most:
            return None
        # the texts of the end may be half written when a run is killed
        return structure_digest(fd, [*layout.regions, *layout.endings], layout.end) == layout.structure
    except EOFError:
        return False


def _require_whole(fd: int, size: int) -> None:
    """Raises OSError where a file without a trailer does not end where HDF5 left it: it is not another program's work.

    The bytes that a copy was still to write may all be the same, as in a chunk of zeros with a checksum of zeros,
    which HDF5 takes for sound. What is not of HDF5's newer kinds, one of which ours are, is left to HDF5.
    """
    start = _bytes(fd, 0, min(size, FILE_END.stop))
    if start[:8] == SIGNATURE and start[8:9] >= b"\2" and int.from_bytes(start[FILE_END], "little") != size:
        raise OSError("its end is not what was written, as in a copy that was interrupted")


def damaged(file: StoredFile, name: str, blocks: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Block and column number of every chunk that is not what was written, of these blocks of a table."""
    table = file.layout.tables[name]
    for block in blocks:
        for number in range(len(table.places)):
            if table.read(file.fd, number, block, file.digest(name, block, number)) is None:
                yield block, number


def padding_is_zero(file: StoredFile) -> bool:
    """Whether there are zeros alone between the chunks and behind the last one. Raises OSError, EOFError."""
    known = [table.spans() for table in file.layout.tables.values()]
    end = file.layout.end
    spans = np.concatenate([*known, np.array([*file.layout.endings, (end, end)], np.int64)])
    spans = spans[np.argsort(spans[:, 0], kind="stable")]
    between = np.stack([spans[:-1, 1], spans[1:, 0]], axis=1)
    begins, ends = np.array(file.layout.regions, np.int64).T
    region = np.searchsorted(begins, between[:, 0], "right") - 1
    inside = (region >= 0) & (between[:, 0] < ends[region])
    between = between[inside & (between[:, 0] < between[:, 1])]
    return not any(any(_bytes(file.fd, begin, end)) for begin, end in between.tolist())


def _bytes(fd: int, begin: int, end: int) -> bytearray:
    found = bytearray(end - begin)
    disk.read_all(fd, (found,), begin)
    return found
