"""A result before its first number: HDF5 makes all of it; but for numbers, digests and the ending it stays as it is.

HDF5 checks every byte of names, attributes and coordinates that it reads: texts have a fixed length and stand in object
headers, coordinates are one chunk with a checksum each, single numbers stand in headers too. The zeros that it writes
over the chunks of outputs are kept from the disk: instead, each chunk of statuses says PENDING, and behind each other
chunk stands a checksum that is wrong, so that nobody takes what is not computed yet for numbers.
"""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Status
from sweep.cells.partition import Partition, box_shape, boxes, row_blocks
from sweep.cells.reduce import part_columns
from sweep.cells.schema import STATUS, Column, Schema
from sweep.file import disk
from sweep.file.fletcher import checksum
from sweep.file.reading import BYTES, ENDING_BYTES, FORMAT, Numbers, StoredFile, digest_before
from sweep.study.model import ARRAY

if TYPE_CHECKING:
    from sweep.study.model import Study

PAGE = 4096
WORTH_A_PAGE = 10 * PAGE
"""Chunks of so many bytes begin on a page of their own, at a cost of a tenth at most;"""
SHARED_WORTH_A_PAGE = PAGE
"""so do shorter ones, where several machines write."""
GATHERED_BYTES = 8 << 20
"""Bytes of the rows that are reduced to groups at a time."""
COMPACT = 1 << 15
"""Attributes up to which HDF5 keeps them in an object header."""
LONG = 1 << 12
"""Bytes of a coordinate to which the study in the file refers, so that its text fits into an object header."""
PIECE = 1 << 20
"""Bytes of short chunks that are written at a time."""
WRONG = b"\xff" * 4
"""A checksum that zeros have not."""


@dataclass(frozen=True)
class Cut:
    """Columns, the grid in which their cells stand, and how it is cut."""

    columns: tuple[Column, ...]
    grid: tuple[int, ...]
    blocks: Partition

    def chunk(self, column: Column) -> tuple[int, ...]:
        """Lengths of a chunk of a column; () of a single number."""
        return (*box_shape(self.grid, self.blocks.cells), *column.shape)


def cuts_of(study: Study, schema: Schema, blocks: Partition) -> dict[str, Cut]:
    """The tables of a study's result, whose output has a schema, and in which blocks are computed."""
    if study.summary is None:
        return {"cells": Cut(schema.columns, schema.grid.shape, blocks)}
    rows, columns = row_blocks(study), part_columns(study)
    row_bytes = sum(column.cell_bytes for column in columns)
    groups = boxes(schema.grid.shape, GATHERED_BYTES // (row_bytes * rows.per_row))
    return {"rows": Cut(columns, (rows.count,), blocks), "cells": Cut(schema.columns, schema.grid.shape, groups)}


def expected_size(schema: Schema, cuts: Mapping[str, Cut]) -> int:
    """Bytes that a result will take, but for some thousands: its names, what HDF5 says of each chunk, the chunks."""
    size = (14 << 10) + sum(len(str(text)) for text in _attrs(schema).values())
    size += sum(np.asarray(coordinate.values).nbytes for coordinate in schema.coordinates)
    for cut in cuts.values():
        for column in cut.columns:
            chunk = math.prod(cut.chunk(column)) * np.dtype(column.dtype).itemsize + len(WRONG)
            paged = -(-chunk // PAGE) * PAGE if chunk >= WORTH_A_PAGE else chunk
            size += cut.blocks.count * (paged + BYTES + 16)
    return size


def _attrs(schema: Schema) -> dict[str, Any]:
    """Attributes of the file, whose study refers to long coordinates."""
    study = schema.attrs["study_json"]
    for c in schema.coordinates:
        if np.asarray(c.values).nbytes >= LONG:
            study = study.replace(ARRAY % c.values.tobytes().hex(), ARRAY % f"@{c.name}")
    return {**schema.attrs, "study_json": study}


def create(path: Path, schema: Schema, cuts: Mapping[str, Cut], shared: bool = False) -> StoredFile:
    """Makes a result of which nothing is computed yet, with room on the disk for all of it. Raises OSError.

    Of the output's `schema`, with tables as `cuts_of` gives them; `shared`, where several machines may write.
    """
    image = _Image()
    _lay_out(image, schema, cuts, SHARED_WORTH_A_PAGE if shared else WORTH_A_PAGE)
    fd = disk.open_file(path, os.O_CREAT | os.O_TRUNC | os.O_RDWR)
    try:
        disk.reserve(fd, image.size)
        for at, page in image.pages.items():
            disk.write_all(fd, (page[: image.size - at],), at)
    finally:
        os.close(fd)
    file = StoredFile(path, os.O_RDWR)
    try:
        for column in (column for table in file.tables.values() for column in table.columns if column.check):
            _write_pending(file.fd, column)
        file.key = digest_before(file.fd, file.key_at)
        disk.write_all(file.fd, (file.key,), file.key_at)
        disk.fsync(file.fd)
    except OSError:
        file.close()
        raise
    return file


def _write_pending(fd: int, column: Numbers) -> None:
    """Says of each chunk of a column that it is not computed yet; of short ones behind each other at once."""
    size, pending = column.size + column.check, WRONG
    if column.name == STATUS:
        pending = bytes([Status.PENDING]) * column.size
        pending += checksum(pending, column.size)
    elif size < PAGE:
        pending = bytes(column.size) + WRONG
    some = max(1, PIECE // size) if len(pending) == size else 1
    for run in np.split(column.at, np.flatnonzero(np.diff(column.at) != size) + 1):
        for first in range(0, len(run), some):
            chunks = run[first : first + some]
            disk.write_all(fd, (pending * len(chunks),), int(chunks[0]) + size - len(pending))


class _Image(io.RawIOBase):
    """The file as HDF5 writes it, in `pages` by where they begin, but for zeros of the length of a `chunk`."""

    def __init__(self) -> None:
        self.pages: dict[int, bytearray] = {}
        self.at = self.size = self.chunk = 0

    def seek(self, offset: int, whence: int = 0) -> int:
        self.at = offset + (0, self.at, self.size)[whence]
        return self.at

    def truncate(self, size: int | None = None) -> int:
        self.size = self.at if size is None else size
        return self.size

    def readinto(self, buffer: Any) -> int:
        for page, here, there in self._pieces(len(buffer)):
            buffer[there] = page[here]
        return len(buffer)

    def write(self, piece: Any) -> int:
        # HDF5 writes nothing else of a chunk's length that begins with zeros: its tables begin with addresses
        if len(piece) == self.chunk and bytes(piece[:BYTES]) == bytes(BYTES):
            self.at += len(piece)
        else:
            for page, here, there in self._pieces(len(piece)):
                page[here] = piece[there]
        self.size = max(self.size, self.at)
        return len(piece)

    def _pieces(self, count: int) -> Iterator[tuple[bytearray, slice, slice]]:
        """So many bytes from here on: a page, where they are in it, and which of them they are."""
        begin, end = self.at, self.at + count
        while self.at < end:
            start, page = self.at, self.at // PAGE * PAGE
            self.at = min(end, page + PAGE)
            here, there = slice(start - page, self.at - page), slice(start - begin, self.at - begin)
            yield self.pages.setdefault(page, bytearray(PAGE)), here, there


def _lay_out(image: _Image, schema: Schema, cuts: Mapping[str, Cut], aligned: int) -> None:
    """Has HDF5 write all that is no number, and then find a place for each; objects of so many bytes are aligned."""
    import h5py
    from h5py import h5f, h5fd, h5p

    access, made = h5p.create(h5p.FILE_ACCESS), h5p.create(h5p.FILE_CREATE)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
    access.set_alignment(aligned, PAGE)
    access.set_fileobj_driver(h5fd.fileobj_driver, image)
    # each thing behind the last one
    made.set_file_space_strategy(h5f.FSPACE_STRATEGY_NONE, False, 1)
    made.set_attr_phase_change(COMPACT, 0)
    made.set_attr_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    made.set_link_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    with h5py.File(h5f.create(b"result", h5f.ACC_TRUNC, made, access)) as file:
        dims = _write_variables(file, schema, cuts["cells"])
        tables: dict[str, dict[str, Any]] = {}
        for name, cut in cuts.items():
            paths = [column.name if name == "cells" else f"{name}/{column.name}" for column in cut.columns]
            blocks = (cut.blocks.size, cut.blocks.cells, cut.blocks.row)
            tables[name] = {"grid": cut.grid, "blocks": blocks, "paths": paths}
            for column in cut.columns if name == "rows" else ():
                shape = (*cut.grid, *column.shape)
                _make(file.require_group(name), column.name, shape, column.dtype, cut.chunk(column))
        integrity = file.create_group("integrity")
        _say(integrity, {"format": FORMAT, "contents": json.dumps({"tables": tables, "dims": dims})})
        shapes: dict[str, tuple[int, ...]] = {"key": (BYTES,), "ending": (ENDING_BYTES,)}
        shapes |= {f"{name}_digests": (cut.blocks.count, len(cut.columns), BYTES) for name, cut in cuts.items()}
        pieces = [integrity.create_dataset(name, shape, "u1") for name, shape in shapes.items()]
        # from here on nothing is made, and places alone are found, that of the key first
        file.flush()
        for data in pieces:
            data[...] = np.zeros(data.shape, "u1")
        for path in (path for table in tables.values() for path in table["paths"]):
            data = file[path]
            if data.chunks is None:
                data[()] = np.nan if data.dtype.kind == "f" else -1
            else:
                image.chunk = data.dtype.itemsize * math.prod(data.chunks) + len(WRONG)
                data.id.write_direct_chunk((0,) * data.ndim, bytes(image.chunk))


def _write_variables(file: Any, schema: Schema, cut: Cut) -> dict[str, tuple[str, ...]]:
    """Dimensions, coordinates and columns as netCDF4 and xarray know them; gives the dimensions of each variable."""
    coordinates, sizes = [], dict(schema.sizes)
    for c in schema.coordinates:
        values, over, attrs = np.asarray(c.values), c.dims, dict(c.attrs)
        if values.dtype.kind == "U":  # as characters
            texts = np.array([word.encode() for word in values.ravel()])
            values = texts.view("S1").reshape(*values.shape, texts.dtype.itemsize)
            over, attrs = (*over, f"string{texts.dtype.itemsize}"), {**attrs, "_Encoding": "utf-8"}
            sizes[over[-1]] = texts.dtype.itemsize
        coordinates.append((c.name, over, values, attrs))
    numbers = {dim: np.int32(number) for number, dim in enumerate(sizes)}

    def described(data: Any, over: tuple[str, ...], attrs: Mapping[str, Any], title: str) -> None:
        """Says over which dimensions a variable is, or that it is the first of them."""
        _say(data, attrs)
        if over[:1] == (data.name[1:],):
            data.make_scale(title)
            data.attrs["_Netcdf4Dimid"] = numbers[over[0]]
            if len(over) > 1:
                data.attrs["_Netcdf4Coordinates"] = np.array([numbers[dim] for dim in over])
        else:
            for place, dim in enumerate(over):
                data.dims[place].attach_scale(file[dim])

    # xarray's way to mark what belongs to the coordinates of all variables, and of one
    away = [c.name for c in schema.coordinates if c.dims and not set(c.dims) & {c.name, *schema.grid.dims}]
    _say(file, {**_attrs(schema), **({"coordinates": " ".join(away)} if away else {})})
    own = {name for name, over, *_ in coordinates if over[:1] == (name,)}
    for dim, size in sizes.items():
        if dim not in own:
            title = f"This is a netCDF dimension but not a netCDF variable.{size:10}"
            described(_make(file, dim, (size,), ">f4", ()), (dim,), {}, title)
    for name, over, values, attrs in sorted(coordinates, key=lambda found: found[0] not in own):
        data = _make(file, name, values.shape, values.dtype, values.shape, header=not over)
        data[...] = values
        described(data, over, attrs, name)
    dims = {c.name: c.dims for c in schema.coordinates}
    for column in schema.columns:
        dims[column.name] = over = (*schema.grid.dims, *column.dims)
        beside = [c.name for c in schema.coordinates if c.dims != (c.name,) and set(c.dims) <= set(over)]
        data = _make(file, column.name, schema.shape(column), column.dtype, cut.chunk(column))
        described(data, over, {**column.attrs, **({"coordinates": " ".join(beside)} if beside else {})}, column.name)
    return dims


def _make(
    group: Any, name: str, shape: tuple[int, ...], dtype: Any, chunk: tuple[int, ...], header: bool = False
) -> Any:
    """A dataset, in chunks with a checksum each; (): in one piece, which may be in its object `header`."""
    import h5py
    from h5py import h5d, h5p

    how = h5p.create(h5p.DATASET_CREATE)
    how.set_attr_phase_change(COMPACT, 0)
    if chunk:
        how.set_chunk(chunk)
        how.set_fletcher32()
        how.set_fill_time(h5d.FILL_TIME_NEVER)
        how.set_alloc_time(h5d.ALLOC_TIME_LATE)
    elif header:
        how.set_layout(h5d.COMPACT)
    space = h5py.h5s.create_simple(shape) if shape else h5py.h5s.create(h5py.h5s.SCALAR)
    kind = h5py.h5t.py_create(np.dtype(dtype), logical=True)
    return h5py.Dataset(h5d.create(group.id, name.encode(), kind, space, how))


def _say(thing: Any, attrs: Mapping[str, Any]) -> None:
    """Attributes of a variable or a group; texts of a fixed length, which netCDF4 and MATLAB know, too."""
    import h5py

    for name, value in attrs.items():
        if isinstance(value, str):
            text = value.encode()
            value = np.array(text, h5py.string_dtype("utf-8", max(2, len(text))))
        thing.attrs[name] = value
