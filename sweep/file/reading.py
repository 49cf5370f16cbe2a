"""Numbers of a result, finished or not, that are compared with their digests before they are handed out.

The seal tells where they are; then chunks are read from their places by any thread. HDF5 is asked for nothing but
names, attributes and coordinates, and not before they are wanted.
"""

from __future__ import annotations

import itertools
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xxhash

from kernels.interface import Status
from sweep.cells.schema import METHOD_USED, STATUS, Coordinate
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.layout import BYTES, ENDING_BYTES, read_bytes, read_seal
from sweep.study.model import study_together

READERS = 4
"""Threads that read a large piece,"""
LARGE = 32 << 20
"""of so many bytes."""
WHOLE = slice(None)


class Changed(ValueError):
    """Another program has changed a result."""


class StoredFile:
    """A result of this program, open for reading. To be used with `with`.

    Of a column or a coordinate `file[name]` gives `dims`, `attrs`, and its numbers as `values` or by indices.

    Attributes
    ----------
    path : Path
    tables : dict of str to Table
    work : str
        Name of the table that is computed: "rows" of a summary, else "cells".
    done : dict of str to ndarray of bool
        Which blocks of a table have digests.
    ending : dict of str to str
        What is known at the end, empty before; what is missing or damaged is then handed out as NaN and PENDING.
    seal : bytes
        Behind the last byte of HDF5.

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
        self.path, self.fd = path, disk.open_file(path, os.O_RDONLY)
        try:
            found = read_seal(self.fd, path)
            if found is None:
                raise Changed(f"{path}: was changed by another program")
            self.tables, self.ending_at, self.seal = found
            self.ending = ending_of(read_bytes(self.fd, self.ending_at, self.ending_at + ENDING_BYTES))
            self._digests = {name: table.read_digests(self.fd) for name, table in self.tables.items()}
        except BaseException:
            self.close()
            raise
        self.work = "rows" if "rows" in self.tables else "cells"
        self.done = {name: digests.any(axis=2).all(axis=1) for name, digests in self._digests.items()}
        self._sound = {name: np.zeros_like(done) for name, done in self.done.items()}

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

    def read(self, name: str, number: int, block: int, out: Any = None) -> Any:
        """The cells of a block of a column, into `out` where it is given; None where they are not what was written."""
        return self.tables[name].read(self.fd, number, block, bytes(self._digests[name][block, number]), out)

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

    @cached_property
    def _described(self) -> tuple[dict[str, Any], dict[str, tuple[tuple[str, ...], dict[str, Any]]], dict[str, Any]]:
        """Attributes of the file; dimensions and attributes of each variable; coordinates. Raises one of DAMAGE."""
        import h5netcdf

        about, coords = {}, {}
        with h5netcdf.File(self.path, "r") as file:
            for name, variable in file.variables.items():
                attrs, dims = dict(variable.attrs), tuple(variable.dimensions)
                attrs.pop("coordinates", None)
                if attrs.pop("_Encoding", None):
                    words, dims = variable[...], dims[:-1]
                    values = np.char.decode(words.view(f"S{words.shape[-1]}").reshape(words.shape[:-1]), "utf-8")
                    coords[name] = Coordinate(name, dims, values, attrs)
                elif name not in {place.name for place in self.tables["cells"].places}:
                    coords[name] = Coordinate(name, dims, np.asarray(variable[...]), attrs)
                about[name] = dims, attrs
            attrs = {name: value for name, value in file.attrs.items() if name != "coordinates"}
        study = study_together(attrs["study_json"], coords)
        return {**attrs, "study_json": study, **self.ending}, about, coords

    @property
    def attrs(self) -> dict[str, Any]:
        """Attributes of the file, and what is known at the end; texts as str."""
        return dict(self._described[0])

    @property
    def coords(self) -> dict[str, Coordinate]:
        """Its coordinates."""
        return dict(self._described[2])

    @property
    def fingerprint(self) -> dict[str, str]:
        """Of the study."""
        return dict(json.loads(self.attrs["fingerprint"]))

    def columns(self, name: str = "cells") -> dict[str, Numbers]:
        """The columns of a table."""
        return {p.name: Numbers(self, name, k) for k, p in enumerate(self.tables[name].places)}

    def __contains__(self, name: str) -> bool:
        return name in self._described[1]

    def __getitem__(self, name: str) -> Any:
        return self._described[2][name] if name in self._described[2] else self.columns()[name]


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

    @property
    def dims(self) -> tuple[str, ...]:
        """Its dimensions, of a column of the output."""
        return self.file._described[1][self.place.name][0]

    @property
    def attrs(self) -> Mapping[str, Any]:
        """Its attributes, of a column of the output."""
        return self.file._described[1][self.place.name][1]

    @property
    def values(self) -> Any:
        """All its numbers."""
        return self[()]

    def __getitem__(self, key: Any) -> Any:
        """By what is given for each dimension, or for the first ones. Raises SweepError where damaged."""
        key = key if isinstance(key, tuple) else (key,)
        key = (*(k for k in key if k is not Ellipsis), *[slice(None)] * len(self.shape))[: len(self.shape)]
        grid, box = self.table.grid, self.table.box
        wanted = [np.atleast_1d(np.arange(n)[k]) for n, k in zip(grid, key, strict=False)]
        out = np.empty((*map(len, wanted), *self.place.shape), self.dtype)
        counts = [-(-n // length) for n, length in zip(grid, box, strict=True)]

        def fill(part: tuple[tuple[int, int, Any, slice], ...]) -> None:
            """Reads what is wanted of one block."""
            block = 0
            for (at, _, _, _), count in zip(part, counts, strict=True):
                block = block * count + at
            shape = (*(length for _, length, _, _ in part), *self.place.shape)
            here: Any = (*(here for _, _, _, here in part), ...)
            view = out[here]
            if view.flags.c_contiguous and all(there is WHOLE for _, _, there, _ in part):
                self._read(block, view.reshape(-1, *self.place.shape))
                return
            cells = self._block(block).reshape(shape)
            for k, (_, _, there, _) in enumerate(part):
                cells = cells[(*[WHOLE] * k, there)]
            view[...] = cells

        parts = list(itertools.product(*map(_parts, wanted, grid, box)))
        if out.nbytes >= LARGE and len(parts) > 1:
            with ThreadPoolExecutor(READERS) as pool:
                list(pool.map(fill, parts))
        else:
            for part in parts:
                fill(part)
        found = out[tuple(0 if isinstance(k, int | np.integer) else WHOLE for k in key[: len(grid)])]
        kept = found.ndim - len(self.place.shape)
        for k in reversed(range(len(grid), len(key))):
            found = found[(*[WHOLE] * (kept + k - len(grid)), key[k])]
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


def _parts(wanted: Any, size: int, length: int) -> list[tuple[int, int, Any, slice]]:
    """What is wanted of each box of an axis of a size: the box and its length, places in it and in the answer."""
    ends = [*(np.flatnonzero(np.diff(wanted // length)) + 1).tolist(), len(wanted)]
    found, start = [], 0
    for stop in ends if len(wanted) else ():
        box = int(wanted[start]) // length
        there, own = wanted[start:stop] - box * length, min(length, size - box * length)
        if (np.diff(there) == 1).all():
            there = WHOLE if len(there) == own else slice(int(there[0]), int(there[-1]) + 1)
        found.append((box, own, there, slice(start, stop)))
        start = stop
    return found


def ending_of(text: bytes) -> dict[str, str]:
    """What was written at the end of a run; empty where that has not come, or is damaged."""
    said = text[: ENDING_BYTES - BYTES]
    return dict(json.loads(said)) if xxhash.xxh3_128_digest(said) == text[-BYTES:] else {}


def ending_text(texts: Mapping[str, str]) -> bytes:
    """What `ending_of` reads; zeros of nothing."""
    said = json.dumps(dict(texts)).encode().ljust(ENDING_BYTES - BYTES)
    return said + xxhash.xxh3_128_digest(said) if texts else bytes(ENDING_BYTES)
