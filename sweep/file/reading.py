"""Reads the numbers of a result, finished or not, and compares them with their digests.

The contents of the file are looked up by HDF5, whose checksums cover names, texts, coordinates and addresses. The lists
of dimensions in its global heap have none, and are not read: in a damaged heap HDF5 2.0 loops for ever. The chunks of
numbers, one for each block and column, each followed by HDF5's checksum, are read from their addresses by any thread. A
table in the file has a row of digests for each block, one for each chunk; zeros mean that the block is not done.
"""

from __future__ import annotations

import errno
import functools
import json
import math
import operator
import os
import struct
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
import xxhash

from kernels.interface import Status
from sweep.cells.partition import Partition, box_shape, box_slices, row_blocks
from sweep.cells.reduce import gathered, pending
from sweep.cells.schema import METHOD_USED, STATUS, Coordinate
from sweep.errors import SweepError, reason
from sweep.file import disk
from sweep.study.model import Study, study_together

FORMAT = 7
UNFINISHED = ".unfinished"
"""Suffix of a result while its sweep runs."""
BYTES = 16
"""Bytes of a digest."""
OF_NETCDF = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_Netcdf4Coordinates", "_Netcdf4Dimid", "coordinates"}
"""Attributes of netCDF4, which users need not see."""
DAMAGE = (OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, RuntimeError)
"""Exceptions from reading a damaged file."""
OF_DAMAGE = (errno.EINVAL, errno.EOVERFLOW)
"""Error numbers of the system for impossible addresses in a damaged file."""
NOTHING = {STATUS: int(Status.PENDING), METHOD_USED: -1}
"""Values of cells that are not computed yet, where they are not NaN."""
MODULUS, ROW = 65535, 4096
NUMBERS = np.arange(ROW, dtype=np.uint64)
"""Numbers of the words in a row, and of the rows that are summed at a time: at most ROW, so that 32 bits hold a sum."""


class Damaged(SweepError):
    """What is read is no result of this program, or is damaged beside its numbers."""


class StoredFile:
    """A result of this program, open for reading, or for writing by other `flags`. To be used with `with`.

    Where its name does not say that it is `finished`, what is missing is handed out as NaN and PENDING. Of a column or
    a coordinate `file[name]` gives `dims`, `attrs`, and its numbers as `values` or by indices. `tables` are "cells",
    the output's columns, of a summary "rows", which they are made of, and "ending", what is known at the end; `work` is
    the one that is computed. `attrs` are those of the file and of its end, texts as str. `key`, a digest of all that
    stands before it, tells this file from any other. Raises Damaged where it is none of ours, or damaged beside the
    numbers; FileNotFoundError or NotADirectoryError where there is none; SweepError where it cannot be read, is of
    another format, or has not the `key` that is asked for.
    """

    def __init__(self, path: Path, flags: int = os.O_RDONLY, key: bytes | None = None) -> None:
        import h5py

        self.path, self.fd = Path(path), -1
        self.finished = self.path.suffix != UNFINISHED
        try:
            self.fd = disk.open_file(path, flags)
            os.lseek(self.fd, 0, os.SEEK_SET)  # in a pipe one cannot
            # whatever has the file's name by now
            with os.fdopen(os.dup(self.fd), "rb", 0) as raw, h5py.File(raw, "r") as h5:
                self._read(h5, key)
        except DAMAGE as fault:
            if self.fd < 0 and isinstance(fault, FileNotFoundError | NotADirectoryError):
                raise
            self.close()
            if isinstance(fault, OSError) and fault.errno and fault.errno not in OF_DAMAGE:
                raise SweepError(f"{path}: cannot be read ({reason(fault)})") from fault
            raise Damaged(
                f"{path}: not the result of a sweep (open exports with xarray or other programs), or damaged "
                f"({reason(fault)}); name another file"
            ) from fault

    def _read(self, h5: Any, key: bytes | None) -> None:
        """All but numbers. Raises one of DAMAGE."""
        integrity = _own(h5, "integrity").attrs
        if (number := integrity.get("format")) != FORMAT:
            raise SweepError(
                f"{self.path}: a result of another format ({number}); this version of foliot reads only format "
                f"{FORMAT}; open it with the version that wrote it, or compute it again under another name"
            )
        contents, self.coords = json.loads(integrity["contents"]), dict[str, Coordinate]()
        self.dims = {name: tuple(dims) for name, dims in contents["dims"].items()}
        self.key_at = _own(h5, "integrity/key").id.get_offset()
        self.key = os.pread(self.fd, BYTES, self.key_at)
        if key not in (None, self.key):
            raise SweepError(f"{self.path}: was replaced since it was opened; open it again")
        self.tables = {name: Table(self, h5, name, **keys) for name, keys in contents["tables"].items()}
        self.work = self.tables.get("rows", self.tables["cells"])
        for name in (name for name in self.dims if name not in self.tables["cells"].columns):
            data = _own(h5, name)
            attrs, values = _attrs(data), data[()]
            if attrs.pop("_Encoding", None):
                values = np.char.decode(values.view(f"S{values.shape[-1]}")[..., 0], "utf-8")
            self.coords[name] = Coordinate(name, self.dims[name][: values.ndim], values, attrs)
        self.attrs = _attrs(h5)
        self.attrs["study_json"] = study_together(self.attrs["study_json"], self.coords)
        self.fingerprint = dict(json.loads(self.attrs["fingerprint"]))
        if self.finished:
            if (ending := self.tables["ending"].columns["ending"].read(0)) is None:
                raise ValueError("what was written at its end is damaged")
            self.attrs |= json.loads(ending[0])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *fault: object) -> None:
        self.close()

    def __reduce__(self) -> Any:
        return StoredFile, (self.path, os.O_RDONLY, self.key)

    def __dask_tokenize__(self) -> Any:
        return self.key, self.finished, self.work.digests

    def close(self) -> None:
        """Gives the file back; nothing can be read from then on."""
        fd, self.fd = self.fd, -1
        if fd >= 0:
            os.close(fd)

    __del__ = close

    def is_as_made(self) -> bool:
        """Whether all but numbers can be read, is as it was made, and as long; HDF5 does not check all of it."""
        try:
            return key_of(self.fd, self.key_at) == self.key
        except (OSError, EOFError):
            return False

    def missing(self) -> list[int]:
        """Numbers of the blocks that are not done, ascending."""
        return np.flatnonzero(~self.work.done).tolist()

    def __contains__(self, name: str) -> bool:
        return name in self.dims

    def __getitem__(self, name: str) -> Any:
        return self.coords[name] if name in self.coords else self.tables["cells"].columns[name]

    def gathered(self, block: int) -> Mapping[str, Any]:
        """A block of the output of a summary, from its rows, of which some may be missing.

        Raises SweepError where they are damaged.
        """
        study, rows = self.study, self.tables["rows"]
        per_row = row_blocks(study).per_row
        first, stop = (per_row * place for place in self.tables["cells"].blocks.bounds(block))
        begins = rows.blocks.first(np.arange(rows.blocks.count))
        there = rows.done[np.searchsorted(begins, np.arange(first, stop), side="right") - 1]
        found = pending(study, first, stop)
        for name, column in rows.columns.items():
            found[name][there] = column[first:stop][there]
        return gathered(study, found)

    @functools.cached_property
    def study(self) -> Study:
        """That of its cells; what a kernel declares is as the file says, and no kernel is loaded."""
        return Study.from_json(self.attrs["study_json"], declared=True)


class Table:
    """Columns that are cut alike, and the digests of their chunks.

    The cells of a `grid` are cut into `blocks`; the `digests`, shape (blocks, columns, 16), stand at `digests_at`: as
    they were when the file was opened, and as they are written by this table.
    """

    def __init__(self, file: StoredFile, h5: Any, name: str, grid: list[int], blocks: list[int], paths: list[str]):
        self.file, self.name, self.grid, self.blocks = file, name, tuple(grid), Partition(*blocks)
        self.box = box_shape(self.grid, self.blocks.cells)
        columns = [Numbers(self, number, _own(h5, path)) for number, path in enumerate(paths)]
        self.columns = {column.name: column for column in columns}
        self.digests_at = _own(h5, f"integrity/{name}").id.get_offset()
        self.row_bytes, shape = BYTES * len(paths), (self.blocks.count, len(paths), BYTES)
        self.digests = np.empty(shape, "u1")
        disk.read_all(file.fd, (self.digests,), self.digests_at)

    @property
    def done(self) -> Any:
        """Which blocks have digests: ndarray of bool."""
        return np.any(self.digests, axis=2).all(axis=1)

    def damaged(self, blocks: Iterable[int]) -> dict[str, list[int]]:
        """Which of some blocks are not what was written, by the names of columns; all are read."""
        blocks = [*blocks]
        return {name: [b for b in blocks if column.read(b) is None] for name, column in self.columns.items()}

    def write(self, block: int, arrays: Mapping[str, Any]) -> bytes:
        """Writes the chunks of a block, and gives their digests. Raises OSError."""
        row = b""
        for name, column in self.columns.items():
            array, behind = np.ascontiguousarray(arrays[name], column.dtype), b""
            if column.check:
                behind = bytes(column.size - array.nbytes) + checksum(array, column.size)
            disk.write_all(self.file.fd, (array, behind), int(column.at[block]))
            row += column.digest(block, array, behind)
        return row

    def write_digests(self, digests: Mapping[int, bytes]) -> None:
        """Writes those of some blocks. Raises OSError."""
        for block, row in digests.items():
            disk.write_all(self.file.fd, (row,), self.digests_at + block * self.row_bytes)
            self.digests[block] = np.frombuffer(row, "u1").reshape(-1, BYTES)


class Numbers:
    """A column over its grid: numbers by integers and slices with positive steps, checked.

    Each cell has the shape `own`, each chunk, which begins at one of `at`, `size` bytes and a checksum of `check` bytes
    behind it, a single number none.
    """

    def __init__(self, table: Table, number: int, data: Any) -> None:
        self.table, self.number, self.name = table, number, data.name.rpartition("/")[2]
        self.shape, self.dtype, self.attrs = data.shape, data.dtype, _attrs(data)
        self.own, self.dims = data.shape[len(table.grid) :], table.file.dims.get(self.name, ())
        self.size, self.check = self.dtype.itemsize * math.prod((*table.box, *self.own)), 4 * data.fletcher32
        chunks: list[Any] = []  # as HDF5 has them, in the order of blocks
        if self.check:
            data.id.chunk_iter(chunks.append)
        self.at = np.array([chunk.byte_offset for chunk in chunks] if self.check else [data.id.get_offset()])
        if data.shape[: len(table.grid)] != table.grid or len(self.at) != table.blocks.count:
            raise ValueError(f"{data.name} has another shape, or other chunks, than it was made with")

    def __reduce__(self) -> Any:
        return operator.getitem, (self.table.file, self.name)

    @property
    def values(self) -> Any:
        """All its numbers."""
        return self[()]

    def digest(self, block: int, *pieces: Any) -> bytes:
        """Digest of a chunk: of all its bytes, and of whose and which it is."""
        state = xxhash.xxh3_128(self.table.file.key + self.table.name.encode() + struct.pack("<qi", block, self.number))
        for piece in pieces:
            state.update(disk.as_bytes(piece))
        return state.digest()

    def read(self, block: int, out: Any = None) -> Any:
        """The cells of a block, into `out` where that is given; None where they are not what was written."""
        start, stop = self.table.blocks.bounds(block)
        found = np.empty((stop - start, *self.own), self.dtype) if out is None else out
        behind = bytearray(self.size + self.check - found.nbytes)
        try:
            disk.read_all(self.table.file.fd, (found, behind), int(self.at[block]))
        except (OSError, EOFError):
            return None
        digest = self.table.digests[block, self.number].tobytes()
        return found if self.digest(block, found, behind) == digest else None

    def __getitem__(self, key: Any) -> Any:
        """By what is given for the first dimensions. Raises SweepError where damaged."""
        table, key = self.table, key if isinstance(key, tuple) else (key,)
        key += (slice(None),) * (len(table.grid) - len(key))
        runs = [
            range(n)[k if isinstance(k, slice) else slice(k, k + 1 or None)]
            for n, k in zip(table.grid, key, strict=False)
        ]
        # all places from the first to the last one wanted, of which those wanted are a view
        wanted = [slice(run[0], run[-1] + 1) if run else slice(0, 0) for run in runs]
        out = np.empty((*(w.stop - w.start for w in wanted), *self.own), self.dtype)
        near = tuple(slice(w.start // m, -(-w.stop // m)) for w, m in zip(wanted, table.box, strict=True))
        counts = [-(-n // m) for n, m in zip(table.grid, table.box, strict=True)]
        for block in np.ravel(np.arange(table.blocks.count).reshape(counts)[near]).tolist():
            box = box_slices(table.grid, *table.blocks.bounds(block))
            both = [slice(max(w.start, b.start), min(w.stop, b.stop)) for w, b in zip(wanted, box, strict=True)]
            view = out[_within(both, wanted)]
            shape = (*(b.stop - b.start for b in box), *self.own)
            # straight to its place where all of a block is wanted and lies in one piece
            cells = view if view.shape == shape and view.flags.c_contiguous else np.empty(shape, self.dtype)
            self._fill(block, cells)
            if cells is not view:
                view[...] = cells[_within(both, box)]
        steps = (slice(None, None, k.step) if isinstance(k, slice) else 0 for k in key[: len(table.grid)])
        return out[(*steps, *key[len(table.grid) :])]

    def _fill(self, block: int, out: Any) -> None:
        """Fills in the cells of a block. Raises SweepError where it is damaged, or the file is closed."""
        file, table = self.table.file, self.table
        if file.fd < 0:
            raise SweepError(f"{file.path}: is closed; open it again to read {self.name}")
        if not file.finished and table is not file.work:
            out[...] = file.gathered(block)[self.name].reshape(out.shape)
        elif not file.finished and not table.digests[block].any(axis=-1).all():
            out[...] = NOTHING.get(self.name, math.nan if self.dtype.kind == "f" else 0)
        elif self.read(block, out) is None:
            start, stop = table.blocks.bounds(block)
            raise SweepError(
                f"{file.path}: {self.name} is damaged between its cells {start:,} and {stop:,}, or was changed by "
                "another program; sweep verify lists all damage, and "
                f"{'sweep run --repair' if file.finished else 'the same run'} computes the damaged cells again"
            )


def _within(inner: Iterable[slice], outer: Iterable[slice]) -> Any:
    """The place of a box in one that holds it, as an index."""
    return (*(slice(a.start - b.start, a.stop - b.start) for a, b in zip(inner, outer, strict=True)), ...)


def _own(h5: Any, path: str) -> Any:
    """What has a path. Raises ValueError where it lies elsewhere, or the file has no room for it: that is not read."""
    import h5py

    group, _, name = path.rpartition("/")
    parent = _own(h5, group) if group else h5
    found = parent[name] if isinstance(parent.get(name, getlink=True), h5py.HardLink) else None
    if found is None or (
        isinstance(found, h5py.Dataset)
        and (found.external or found.is_virtual or found.compression or found.nbytes > h5.id.get_filesize())
    ):
        raise ValueError(f"{path} is not in the file itself, or has not the size that it says")
    return found


def _attrs(thing: Any) -> dict[str, Any]:
    """What HDF5 says of a file or a variable; texts as str, single numbers as that."""
    found = {}
    for name in (name for name in thing.attrs if name not in OF_NETCDF):  # those may stand in the heap
        value = thing.attrs[name]
        value = value.decode() if isinstance(value, bytes) else value
        found[name] = value[0] if getattr(value, "shape", ()) == (1,) else value
    return found


def key_of(fd: int, end: int) -> bytes:
    """Digest of all bytes of a file before a place, and of its length. Raises OSError, EOFError."""
    found = bytearray(end)
    disk.read_all(fd, (found,), 0)
    return xxhash.xxh3_128_digest(found + struct.pack("<q", os.fstat(fd).st_size))


def checksum(piece: Any, length: int) -> bytes:
    """HDF5's checksum of a chunk of so many bytes (its filter fletcher32), which are those of `piece`, then zeros.

    Of big-endian words w[0] .. w[n-1] of 16 bits it is (sum of w[i], sum of (n - i) w[i]) modulo 65535. As 2^16 is 1
    there, a word with its bytes swapped is 256 times the word. And with the words in rows of K, sum of i w[i] is K
    times the sum of row numbers by sums of rows, and the sum of column numbers by sums of columns.
    """
    raw = np.frombuffer(disk.as_bytes(piece), np.uint8)
    whole, low, high = raw.size - raw.size % (2 * ROW), 0, 0
    rows = raw[:whole].view("<u2").reshape(-1, ROW)
    last = np.frombuffer(raw[whole:].tobytes() + bytes(raw.size % 2), "<u2")[None]
    for part in (*(rows[at : at + ROW] for at in range(0, len(rows), ROW)), last):
        by_row = part.sum(axis=1, dtype=np.uint32).astype(np.uint64)
        by_column = part.sum(axis=0, dtype=np.uint32).astype(np.uint64)
        more = int(by_row.sum())
        numbered = ROW * int(by_row @ NUMBERS[: len(by_row)]) + int(by_column @ NUMBERS[: len(by_column)])
        high += part.size * (low + more) - numbered
        low += more
    high += (-(-length // 2) - rows.size - last.size) * low  # words are counted from the end of the chunk
    # 256 times a sum modulo 65535, as HDF5 has it: 0 stands for a sum that is zero itself
    first, second = (256 * total % MODULUS or (MODULUS if total else 0) for total in (low, high))
    return (second << 16 | first).to_bytes(4, "little")
