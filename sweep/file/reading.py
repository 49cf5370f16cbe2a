"""Numbers of a result, finished or not, that are compared with their digests before they are handed out.

HDF5 is asked where they are, once; then chunks are read from their places by any thread.
"""

from __future__ import annotations

import itertools
import json
import math
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kernels.interface import Status
from sweep.cells.schema import METHOD_USED, STATUS
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.fletcher import checksum
from sweep.file.layout import ENDING, ENDING_BYTES, SEAL, Seal, digest_of, gaps, read_bytes, read_seal, tables_of

READERS = 4
"""Threads that read a large piece,"""
LARGE = 32 << 20
"""of so many bytes."""


class Changed(ValueError):
    """Another program has changed a result."""


class StoredFile:
    """A result of this program, open for reading. To be used with `with`.

    Attributes
    ----------
    path : Path
    attrs : dict
        Of the file; texts as str.
    tables : dict of str to Table
    work : str
        Name of the table that is computed: "rows" of a summary, else "cells".
    done : dict of str to ndarray of bool
        Which blocks of a table have digests.
    ending : dict of str to str
        What is known at the end, empty before; what is missing or damaged is then handed out as NaN and PENDING.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError
        It is none of ours, or damaged beside the numbers; `Changed` where another program has changed it.
    SweepError
        It is of another format.
    """

    def __init__(self, path: Path) -> None:
        import h5py

        self.path, self.fd = path, disk.open_file(path, os.O_RDONLY)
        try:
            seal = read_seal(self.fd, path)
            if seal is None:
                raise Changed(f"{path}: was changed by another program")
            self.seal: Seal = seal
            with h5py.File(path, "r") as file:
                self.attrs = attrs_of(file)
                self.tables = tables_of(file, seal.key)
                self.ending_at = int(file[ENDING].id.get_chunk_info(0).byte_offset)
            self.work = "rows" if "rows" in self.tables else "cells"
            self._digests = {name: table.read_digests(self.fd) for name, table in self.tables.items()}
            text = read_bytes(self.fd, self.ending_at, self.ending_at + ENDING_BYTES + 4)
            whole = checksum(text[:ENDING_BYTES], ENDING_BYTES) == text[ENDING_BYTES:] and any(text)
            self.ending: dict[str, str] = json.loads(text[:ENDING_BYTES]) if whole else {}
        except BaseException:
            self.close()
            raise
        self._sound = {name: np.zeros(table.blocks.count, bool) for name, table in self.tables.items()}
        self.done = {name: digests.any(axis=2).all(axis=1) for name, digests in self._digests.items()}

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

    @property
    def fingerprint(self) -> dict[str, str]:
        """Of the study."""
        return dict(json.loads(self.attrs["fingerprint"]))

    def read(self, name: str, number: int, block: int, out: Any = None) -> Any:
        """The cells of a block of a column, into `out` where it is given; None where they are not what was written."""
        digest = bytes(self._digests[name][block, number])
        return self.tables[name].read(self.fd, number, block, digest, out)

    def is_sound(self, name: str, block: int) -> bool:
        """Whether all columns of a block are there and as they were written; looked at once."""
        if not self._sound[name][block] and self.done[name][block]:
            self._sound[name][block] = not any(True for _ in self.damaged(name, [block]))
        return bool(self._sound[name][block])

    def damaged(self, name: str, blocks: Iterable[int]) -> Iterator[tuple[int, int]]:
        """Block and column number of every chunk that is not what was written, of these blocks of a table."""
        for block, number in itertools.product(blocks, range(len(self.tables[name].places))):
            if self.read(name, number, block) is None:
                yield block, number

    def rest_is_sound(self) -> bool:
        """Whether all that is no number, no digest and not the head is as it was written. Raises OSError, EOFError."""
        end = os.fstat(self.fd).st_size - SEAL.size
        rest = gaps(self.tables.values(), self.ending_at, self.seal.head, end)
        return digest_of(self.fd, rest) == self.seal.rest_digest

    def columns(self, name: str = "cells") -> dict[str, Numbers]:
        """The columns of a table."""
        return {p.name: Numbers(self, name, k) for k, p in enumerate(self.tables[name].places)}


class Numbers:
    """A column over its grid: numbers by indices, slices and lists of indices for each dimension, checked.

    Attributes
    ----------
    shape : tuple of int
    dtype : dtype
    """

    def __init__(self, file: StoredFile, name: str, number: int) -> None:
        self.file, self.name, self.number = file, name, number
        self.table = file.tables[name]
        self.place = self.table.places[number]
        self.shape, self.dtype = (*self.table.grid, *self.place.shape), np.dtype(self.place.dtype)
        self._last: tuple[int, Any] = -1, None

    def __reduce__(self) -> Any:
        return Numbers, (self.file, self.name, self.number)

    def __getitem__(self, key: Any) -> Any:
        """By what is given for each dimension, or for the first ones. Raises SweepError where damaged."""
        key = key if isinstance(key, tuple) else (key,)
        key = (*(k for k in key if k is not Ellipsis), *[slice(None)] * len(self.shape))[: len(self.shape)]
        grid, box = self.table.grid, self.table.box
        wanted = [np.arange(n)[k] for n, k in zip(grid, key, strict=False)]
        out = np.empty((*(places.size for places in wanted), *self.place.shape), self.dtype)
        parts = list(itertools.product(*(_parts(*axis) for axis in zip(wanted, grid, box, strict=True))))
        counts = [-(-n // length) for n, length in zip(grid, box, strict=True)]

        def fill(part: tuple[_Part, ...]) -> None:
            number = 0
            for axis, count in zip(part, counts, strict=True):
                number = number * count + axis.box
            here: Any = (*(axis.here for axis in part), ...)
            view = out[here]
            lengths = [axis.length for axis in part]
            if view.flags.c_contiguous and all(axis.whole for axis in part):
                self._read(number, view.reshape(math.prod(lengths), *self.place.shape))
                return
            cells = self._block(number).reshape(*lengths, *self.place.shape)
            for k, axis in enumerate(part):
                cells = cells[(*[slice(None)] * k, axis.there)]
            view[...] = cells

        if out.nbytes >= LARGE and len(parts) > 1:
            with ThreadPoolExecutor(READERS) as pool:
                list(pool.map(fill, parts))
        else:
            for part in parts:
                fill(part)
        kept = [places.size for places in wanted if places.ndim]
        found = out.reshape((*kept, *self.place.shape))
        for k in reversed(range(len(grid), len(key))):
            found = found[(*[slice(None)] * (len(kept) + k - len(grid)), key[k])]
        return found

    def _block(self, block: int) -> Any:
        """The cells of a block; those of the last one are kept."""
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
        finished = bool(self.file.ending)
        wanted = finished or self.file.is_sound(self.name, block)
        if wanted and self.file.read(self.name, self.number, block, out) is not None:
            return
        if finished:
            start, stop = self.table.blocks.bounds(block)
            raise SweepError(
                f"{self.file.path}: {self.place.name} is damaged between its cells {start:,} and {stop:,}; sweep "
                "verify tells of all damage, and sweep run --repair computes the damaged cells again"
            )
        out[...] = {STATUS: int(Status.PENDING), METHOD_USED: -1}.get(self.place.name, math.nan)


class _Part(NamedTuple):
    """What is wanted of one box along an axis: its number and length, places in it, and their places in the answer."""

    box: int
    length: int
    there: Any
    here: slice
    whole: bool


def _parts(wanted: Any, size: int, length: int) -> list[_Part]:
    """The parts of some places along an axis of a size that is cut into boxes of a length."""
    wanted = np.atleast_1d(wanted)
    ends = [*(np.flatnonzero(np.diff(wanted // length)) + 1).tolist(), wanted.size]
    found, start = [], 0
    for stop in ends if wanted.size else ():
        box = int(wanted[start]) // length
        there, own = wanted[start:stop] - box * length, min(length, size - box * length)
        straight = bool((np.diff(there) == 1).all())
        inside = slice(int(there[0]), int(there[-1]) + 1) if straight else there
        found.append(_Part(box, own, inside, slice(start, stop), straight and stop - start == own))
        start = stop
    return found


def attrs_of(thing: Any) -> dict[str, Any]:
    """Attributes of what h5py has opened: texts as str, a single number as such."""
    found = {}
    for name, value in thing.attrs.items():
        single = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
        found[name] = single.decode() if isinstance(single, bytes) else single
    return found
