"""Numbers of a result, finished or not, that are compared with their digests before they are handed out.

HDF5 says what is in the file and where, and checks that: names, texts, coordinates and places have its checksums. The
lists of dimensions in its global heap have none, and are not read: in a damaged heap HDF5 2.0 loops for ever. Numbers
stand in chunks, one a block of each column, each followed by HDF5's checksum; they are read from their places by any
thread. A table in the file has a digest of each chunk, a row of them for each block; zeros: the block is not done.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import stat
import struct
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xxhash

from kernels.interface import Status
from sweep.cells.partition import Partition, box_shape
from sweep.cells.schema import METHOD_USED, STATUS, Coordinate
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.fletcher import checksum
from sweep.study.model import study_together

FORMAT = 5
BYTES, ENDING_BYTES = 16, 256
"""Of a digest; of what is written when all is done: JSON, and its digest."""
READERS = 4
"""Threads that read a large piece,"""
LARGE = 32 << 20
"""of so many bytes."""
SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""How files of HDF5 begin."""
FILE_END = 28, 8
"""Where, and in how many bytes, they say how long they are."""
OF_NETCDF = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_Netcdf4Coordinates", "_Netcdf4Dimid", "coordinates"}
"""Attributes that say nothing to a user."""
DAMAGE = (OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, RuntimeError)
"""What comes of reading a damaged file."""


class StoredFile:
    """A result of this program, open for reading. To be used with `with`.

    Of a column or a coordinate `file[name]` gives `dims`, `attrs`, and its numbers as `values` or by indices. `tables`
    are "cells", the output's columns, and of a summary "rows", which they are made of; `work` names the one that is
    computed. `ending` is what is known at the end, empty before: then what is missing or damaged is handed out as NaN
    and PENDING. `key`, the digest of all that stands before it, tells this file from any other.

    Raises
    ------
    OSError, ValueError and others of DAMAGE
        It cannot be read, is none of ours, or is damaged beside the numbers.
    SweepError
        It is of another format.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.fd = path, disk.open_file(path, os.O_RDONLY)
        try:
            with self.hdf5() as file:
                attrs = _own(file, "integrity").attrs
                if (number := attrs.get("format")) != FORMAT:
                    raise SweepError(
                        f"{path}: a result of another format ({number}); this version of foliot reads format {FORMAT} "
                        "alone; open it with the version that wrote it, or compute it again under another name"
                    )
                contents = json.loads(attrs["contents"])
                self._dims = {name: tuple(dims) for name, dims in contents["dims"].items()}
                self.key_at, self.ending_at = (_own(file, f"integrity/{k}").id.get_offset() for k in ("key", "ending"))
                self.key, ending = (
                    read_bytes(self.fd, self.key_at, BYTES),
                    read_bytes(self.fd, self.ending_at, ENDING_BYTES),
                )
                self.tables = {name: Table(self, file, name, **keys) for name, keys in contents["tables"].items()}
            self.ending = ending_of(ending)
        except BaseException:
            self.close()
            raise
        self.work = "rows" if "rows" in self.tables else "cells"

    @contextlib.contextmanager
    def hdf5(self) -> Iterator[Any]:
        """The file as HDF5 sees it, whatever has its name by now. Raises one of DAMAGE."""
        import h5py

        if not stat.S_ISREG(os.fstat(self.fd).st_mode) or read_bytes(self.fd, 0, len(SIGNATURE)) != SIGNATURE:
            raise ValueError("it is no file of HDF5")
        with os.fdopen(os.dup(self.fd), "rb", 0) as raw, h5py.File(raw, "r") as file:
            yield file

    def __enter__(self) -> StoredFile:
        return self

    def __exit__(self, *fault: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def __reduce__(self) -> Any:
        return _again, (self.path, self.key)

    def close(self) -> None:
        """Gives the file back; nothing can be read from then on."""
        fd, self.fd = getattr(self, "fd", -1), -1
        if fd >= 0:
            os.close(fd)

    def is_as_made(self) -> bool:
        """Whether all but numbers is as it was made, and as long; HDF5 does not check all of it. Raises OSError."""
        size = int.from_bytes(read_bytes(self.fd, *FILE_END), "little")
        return os.fstat(self.fd).st_size == size and digest_before(self.fd, self.key_at) == self.key

    @cached_property
    def _described(self) -> tuple[dict[str, Any], dict[str, dict[str, Any]], dict[str, Coordinate]]:
        """Attributes of the file; attributes of each variable; coordinates. Raises one of DAMAGE."""
        about, coords = {}, {}
        with self.hdf5() as file:
            for name, dims in self._dims.items():
                data = _own(file, name)
                about[name] = attrs = _attrs(data)
                if name not in self.columns():
                    values = data[()]
                    if attrs.pop("_Encoding", None):
                        values = np.char.decode(values.view(f"S{values.shape[-1]}")[..., 0], "utf-8")
                    coords[name] = Coordinate(name, dims, values, attrs)
            attrs = _attrs(file)
        return {**attrs, "study_json": study_together(attrs["study_json"], coords), **self.ending}, about, coords

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
        return {column.name: column for column in self.tables[name].columns}

    def __contains__(self, name: str) -> bool:
        return name in self._dims

    def __getitem__(self, name: str) -> Any:
        return self.coords[name] if name in self.coords else self.columns()[name]


class Table:
    """Columns that are cut alike, and the digests of their chunks.

    The cells of a `grid` are cut into `blocks`; the `digests`, shape (blocks, columns, 16), stand at `digests_at`: as
    they were when the file was opened, and as they are written by this table.
    """

    def __init__(self, file: StoredFile, h5: Any, name: str, grid: list[int], blocks: list[int], paths: list[str]):
        self.file, self.name, self.grid, self.blocks = file, name, tuple(grid), Partition(*blocks)
        self.box = box_shape(self.grid, self.blocks.cells)
        self.columns = tuple(Numbers(self, number, _own(h5, path)) for number, path in enumerate(paths))
        self.digests_at = _own(h5, f"integrity/{name}_digests").id.get_offset()
        self.row_bytes, shape = BYTES * len(paths), (self.blocks.count, len(paths), BYTES)
        self.digests = np.empty(shape, "u1")
        disk.read_all(file.fd, (self.digests,), self.digests_at)
        self._sound = np.zeros(self.blocks.count, bool)

    @property
    def done(self) -> Any:
        """Which blocks have digests: ndarray of bool."""
        return np.any(self.digests, axis=2).all(axis=1)

    def is_sound(self, block: int) -> bool:
        """Whether all columns of a block are there and as they were written; looked at once."""
        if not self._sound[block] and self.digests[block].any():
            self._sound[block] = not self.damaged([block])
        return bool(self._sound[block])

    def damaged(self, blocks: Iterable[int]) -> list[int]:
        """Which of some blocks are not what was written."""
        return [block for block in blocks if any(column.read(block) is None for column in self.columns)]

    def write(self, fd: int, block: int, arrays: Mapping[str, Any]) -> bytes:
        """Writes the chunks of a block, and gives their digests. Raises OSError."""
        row = b""
        for column in self.columns:
            array, behind = np.ascontiguousarray(arrays[column.name], column.dtype), b""
            if column.check:
                behind = bytes(column.size - array.nbytes) + checksum(array, column.size)
            disk.write_all(fd, (array, behind), int(column.at[block]))
            row += column.digest(block, array, behind)
        return row

    def write_digests(self, fd: int, digests: Mapping[int, bytes]) -> None:
        """Writes those of some blocks, neighbouring ones at once. Raises OSError."""
        for _, some in itertools.groupby(enumerate(sorted(digests)), lambda pair: pair[1] - pair[0]):
            blocks = [block for _, block in some]
            rows = np.frombuffer(b"".join(digests[block] for block in blocks), "u1")
            disk.write_all(fd, (rows,), self.digests_at + blocks[0] * self.row_bytes)
            self.digests[blocks] = rows.reshape(len(blocks), -1, BYTES)


class Numbers:
    """A column over its grid: numbers by indices and slices with positive steps for each dimension, checked.

    Each cell has the shape `own`, each chunk `size` bytes and a checksum of `check` bytes behind it, a single number
    none. Raises ValueError where it has another shape than it was made with.
    """

    def __init__(self, table: Table, number: int, data: Any) -> None:
        self.table, self.number, self.path = table, number, data.name
        self.name, self.shape, self.dtype, grid = data.name.split("/")[-1], data.shape, data.dtype, table.grid
        self.own, self.check = data.shape[len(grid) :], 4 * data.fletcher32
        self.dims = table.file._dims.get(self.name, ())
        self.size = self.dtype.itemsize * math.prod((*table.box, *self.own))
        if data.shape[: len(grid)] != grid or (data.chunks or ()) != (*table.box, *self.own):
            raise ValueError(f"{self.path} has another shape than it was made with")

    def __reduce__(self) -> Any:
        return _column, (self.table.file, self.table.name, self.number)

    @cached_property
    def at(self) -> Any:
        """Where each chunk begins: ndarray of int64. Raises ValueError where HDF5 has others, and OSError."""
        with self.table.file.hdf5() as file:
            data = _own(file, self.path)
            if not self.check:
                return np.array([data.id.get_offset()])
            chunks: list[Any] = []
            data.id.chunk_iter(chunks.append)
        if len(chunks) != self.table.blocks.count or {(0, self.size + 4)} != {(c.filter_mask, c.size) for c in chunks}:
            raise ValueError(f"{self.path} has other chunks than it was made with")
        return np.array([chunk.byte_offset for chunk in chunks])

    @property
    def attrs(self) -> Mapping[str, Any]:
        """Its attributes, of a column of the output."""
        return self.table.file._described[1][self.name]

    @property
    def values(self) -> Any:
        """All its numbers."""
        return self[()]

    def empty(self, cells: int) -> Any:
        """An uninitialised array of so many cells."""
        return np.empty((cells, *self.own), self.dtype)

    def digest(self, block: int, *pieces: Any) -> bytes:
        """Digest of a chunk: of all its bytes, and of whose and which it is."""
        state = xxhash.xxh3_128(self.table.file.key + self.table.name.encode() + struct.pack("<qi", block, self.number))
        for piece in pieces:
            state.update(disk.as_bytes(piece))
        return state.digest()

    def read(self, block: int, out: Any = None) -> Any:
        """The cells of a block, into `out` where that is given; None where they are not what was written."""
        start, stop = self.table.blocks.bounds(block)
        found = self.empty(stop - start) if out is None else out
        behind = bytearray(self.size + self.check - found.nbytes)
        try:
            disk.read_all(self.table.file.fd, (found, behind), int(self.at[block]))
        except DAMAGE:
            return None
        digest = self.table.digests[block, self.number].tobytes()
        return found if self.digest(block, found, behind) == digest else None

    def __getitem__(self, key: Any) -> Any:
        """By what is given for each dimension, or for the first ones. Raises SweepError where damaged."""
        key = key if isinstance(key, tuple) else (key,)
        key = key if Ellipsis in key else (*key, Ellipsis)
        place, left = key.index(Ellipsis), len(self.shape) - len(key) + 1
        key = (*key[:place], *[slice(None)] * left, *key[place + 1 :])
        grid, box = self.table.grid, self.table.box
        counts = [-(-n // m) for n, m in zip(grid, box, strict=True)]
        slices = [k if isinstance(k, slice) else slice(k, k + 1 or None) for k in key[: len(grid)]]
        runs = [range(n)[k] for n, k in zip(grid, slices, strict=True)]
        starts, stops = [run[0] if run else 0 for run in runs], [run[-1] + 1 if run else 0 for run in runs]
        out = np.empty((*np.subtract(stops, starts), *self.own), self.dtype)

        def fill(corner: tuple[int, ...]) -> None:
            """Reads what is wanted of one block, straight to its place where it can."""
            spans = [(at * m, min((at + 1) * m, n)) for at, m, n in zip(corner, box, grid, strict=True)]
            there: Any = [slice(max(a - start, 0), b - start) for (a, b), start in zip(spans, starts, strict=True)]
            view = out[(*there, ...)]
            whole = (*(b - a for a, b in spans), *self.own)
            cells = view if view.shape == whole and view.flags.c_contiguous else np.empty(whole, self.dtype)
            self._checked(int(np.ravel_multi_index(corner, counts)) if grid else 0, cells)
            if cells is not view:
                parts = zip(spans, starts, stops, strict=True)
                view[...] = cells[tuple(slice(max(start - a, 0), stop - a) for (a, _), start, stop in parts)]

        corners = itertools.product(*(range(a // m, -(-b // m)) for a, b, m in zip(starts, stops, box, strict=True)))
        if out.nbytes < LARGE:
            for corner in corners:
                fill(corner)
        else:
            with ThreadPoolExecutor(READERS) as pool:
                list(pool.map(fill, corners))
        steps = (slice(None, None, run.step) if isinstance(k, slice) else 0 for k, run in zip(key, runs, strict=False))
        return out[(*steps, *key[len(grid) :])]

    def _checked(self, block: int, out: Any) -> None:
        """Fills in the cells of a block. Raises SweepError where it is damaged, or the file is closed."""
        file = self.table.file
        if file.fd < 0:
            raise SweepError(f"{file.path}: is closed; open it again to read {self.name}")
        if (file.ending or self.table.is_sound(block)) and self.read(block, out) is not None:
            return
        if file.ending or self.table.name == "rows":  # what is missing of these is not asked for
            start, stop = self.table.blocks.bounds(block)
            raise SweepError(
                f"{file.path}: {self.name} is damaged between its cells {start:,} and {stop:,}, or was changed by "
                "another program; sweep verify tells of all damage, and sweep run --repair computes the damaged cells "
                "again"
            )
        out[...] = {STATUS: int(Status.PENDING), METHOD_USED: -1}.get(self.name, math.nan)


def _again(path: Path, key: bytes) -> StoredFile:
    """A file once more, in another process or from a pickle. Raises SweepError where another has its name by now."""
    file = StoredFile(path)
    if file.key != key:
        raise SweepError(f"{path}: was replaced since it was opened; open it again")
    return file


def _column(file: StoredFile, table: str, number: int) -> Numbers:
    return file.tables[table].columns[number]


def _own(file: Any, path: str) -> Any:
    """What has a path. Raises ValueError where it lies elsewhere, or the file has no room for it: that is not read."""
    import h5py

    for end in (k for k in range(1, len(path) + 1) if path[k : k + 1] in ("/", "")):
        if not isinstance(file.get(path[:end], getlink=True), h5py.HardLink):
            raise ValueError(f"{path} is not in the file itself")
    found = file[path]
    if isinstance(found, h5py.Dataset) and (
        found.external or found.is_virtual or found.compression or found.nbytes > file.id.get_filesize()
    ):
        raise ValueError(f"{path} is not in the file itself, or has not the size that it says")
    return found


def _attrs(thing: Any) -> dict[str, Any]:
    """What HDF5 says of a file or a variable; texts as str, single numbers as that. TypeError where a text is none."""
    found = {}
    for name in thing.attrs:
        if name not in OF_NETCDF:
            value = thing.attrs[name]
            value = value.decode() if isinstance(value, bytes) else value
            found[name] = value[0] if getattr(value, "shape", ()) == (1,) else value
    for name in ("units", "long_name", "study_json", "fingerprint", "start"):
        if not isinstance(found.get(name, ""), str):
            raise TypeError(f"{name} is no text")
    return found


def read_bytes(fd: int, begin: int, count: int) -> bytes:
    """So many bytes. Raises OSError, EOFError."""
    found = bytearray(count)
    disk.read_all(fd, (found,), begin)
    return bytes(found)


def digest_before(fd: int, end: int) -> bytes:
    """Digest of all bytes before a place. Raises OSError, EOFError."""
    return xxhash.xxh3_128_digest(read_bytes(fd, 0, end))


def ending_of(text: bytes) -> dict[str, str]:
    """What was written at the end of a run; empty where that has not come, or is damaged."""
    said = text[:-BYTES]
    return dict(json.loads(said)) if xxhash.xxh3_128_digest(said) == text[-BYTES:] else {}


def ending_text(texts: Mapping[str, str]) -> bytes:
    """What `ending_of` reads; zeros of nothing."""
    said = json.dumps(dict(texts)).encode().ljust(ENDING_BYTES - BYTES)
    return said + xxhash.xxh3_128_digest(said) if texts else bytes(ENDING_BYTES)
