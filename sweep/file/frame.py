"""A result before its first number: HDF5 makes all of it, and says of each chunk where it is.

First come names, attributes and coordinates, the head of the file, in which HDF5 checks every byte that it reads: texts
have a fixed length and stand in object headers, coordinates are one chunk with a checksum each, single numbers stand in
headers too. Then HDF5 is told to find a place for each chunk of the outputs. The zeros that it writes there are kept
from the disk: instead, each chunk of statuses says PENDING, and behind each other chunk stands a checksum that is
wrong, so that nobody takes what is not computed yet for numbers.
"""

from __future__ import annotations

import io
import json
import math
import os
import secrets
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Status
from sweep.cells.output_schema import part_columns
from sweep.cells.partition import Partition, box_shape, boxes, row_blocks
from sweep.cells.schema import STATUS, Column, Coordinate, Schema
from sweep.file import disk
from sweep.file.fletcher import checksum
from sweep.file.layout import BYTES, ENDING, ENDING_BYTES, GROUP, PIECE, SEAL, Place, Seal, digest_of, gaps, tables_of

if TYPE_CHECKING:
    from sweep.study.model import Study

PAGE = 4096
WORTH_A_PAGE = 10 * PAGE
"""Chunks of so many bytes begin on a page of their own, at a cost of a tenth at most;"""
SHARED_WORTH_A_PAGE = PAGE
"""so do shorter ones, where several machines write."""
GATHERED_BYTES = 8 << 20
"""Bytes of the rows that are reduced to groups at a time."""
LONGEST = 60_000
"""Bytes of an attribute that HDF5 keeps in an object header; a longer text it keeps where it has no checksum."""
COMPACT = 1 << 15
"""Attributes up to which they are all kept there."""
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
    """The tables of a study's result.

    Parameters
    ----------
    schema : of the output
    blocks : of what is computed
    """
    if study.summary is None:
        return {"cells": Cut(schema.columns, schema.grid.shape, blocks)}
    rows, columns = row_blocks(study), part_columns(study)
    row_bytes = sum(column.cell_bytes for column in columns)
    groups = boxes(schema.grid.shape, GATHERED_BYTES // (row_bytes * rows.per_row))
    return {"rows": Cut(columns, (rows.count,), blocks), "cells": Cut(schema.columns, schema.grid.shape, groups)}


def expected_size(schema: Schema, cuts: Mapping[str, Cut]) -> int:
    """Bytes that a result will take, but for some thousands: its names, what HDF5 says of each chunk, the chunks."""
    size = (14 << 10) + sum(len(str(text)) for text in schema.attrs.values())
    size += sum(np.asarray(coordinate.values).nbytes for coordinate in schema.coordinates)
    for cut in cuts.values():
        for column in cut.columns:
            chunk = math.prod(cut.chunk(column)) * np.dtype(column.dtype).itemsize + len(WRONG)
            paged = -(-chunk // PAGE) * PAGE if chunk >= WORTH_A_PAGE else chunk
            size += cut.blocks.count * (paged + BYTES + 16)
    return size


def create(path: Path, schema: Schema, cuts: Mapping[str, Cut], shared: bool = False) -> None:
    """Makes a result of which nothing is computed yet, with room on the disk for all of it.

    Parameters
    ----------
    schema : Schema
        Of the output.
    cuts : mapping of str to Cut
        "cells": the output's columns; of a summary also "rows".
    shared : bool
        Whether several machines may write.

    Raises
    ------
    OSError
    """
    image, key = _Image(), secrets.token_bytes(BYTES)
    _describe(image, schema, cuts)
    head = image.size
    with _opened(image, SHARED_WORTH_A_PAGE if shared else WORTH_A_PAGE) as file:
        _allocate(file, image, cuts)
        tables, ending = tables_of(file, key), int(file[ENDING].id.get_chunk_info(0).byte_offset)
    fd = disk.open_file(path, os.O_CREAT | os.O_TRUNC | os.O_RDWR)
    try:
        disk.reserve(fd, image.size + SEAL.size)
        for at, page in image.pages.items():
            disk.write_all(fd, (page[: image.size - at],), at)
        for place in (place for table in tables.values() for place in table.places if place.check):
            _write_pending(fd, place)
        disk.write_all(fd, (WRONG,), ending + ENDING_BYTES)
        rest = digest_of(fd, gaps(tables.values(), ending, head, image.size))
        disk.write_all(fd, (SEAL.pack(*Seal(head, digest_of(fd, [(0, head)]), rest, key)),), image.size)
        disk.fsync(fd)
    finally:
        os.close(fd)


def _write_pending(fd: int, place: Place) -> None:
    """Says of each chunk of a column that it is not computed yet; of short ones behind each other at once."""
    size, piece = place.size + place.check, WRONG
    if place.name == STATUS:
        words = np.full(place.size, Status.PENDING, "i1")
        piece = words.tobytes() + checksum(words, place.size)
    elif size < PAGE:
        piece = bytes(place.size) + WRONG
    starts = place.at + (size - len(piece))
    for run in np.split(starts, np.flatnonzero(np.diff(starts) != len(piece)) + 1):
        some = max(1, PIECE // len(piece))
        for k in range(0, len(run), some):
            disk.write_all(fd, (piece * len(run[k : k + some]),), int(run[k]))


class _Image(io.RawIOBase):
    """The file as HDF5 writes it, in memory, but for chunks of zeros.

    Attributes
    ----------
    pages : dict of int to bytearray
        What was written, by where it begins.
    size : int
    chunk : int
        Bytes of the chunks that are left out.
    """

    def __init__(self) -> None:
        self.pages: dict[int, bytearray] = {}
        self.size, self.chunk, self._at = 0, -1, 0

    def seek(self, offset: int, whence: int = 0) -> int:
        self._at = offset + (self.size if whence == os.SEEK_END else 0)
        return self._at

    def tell(self) -> int:
        return self._at

    def truncate(self, size: int | None = None) -> int:
        self.size = self._at if size is None else size
        return self.size

    def readinto(self, buffer: Any) -> int:
        for page, here, there in self._pieces(len(buffer)):
            buffer[there] = page[here]
        return len(buffer)

    def write(self, piece: Any) -> int:
        # HDF5 writes nothing else of a chunk's length that begins with zeros: its tables begin with addresses
        if len(piece) == self.chunk and bytes(piece[:BYTES]) == bytes(BYTES):
            self._at += len(piece)
        else:
            for page, here, there in self._pieces(len(piece)):
                page[here] = piece[there]
        self.size = max(self.size, self._at)
        return len(piece)

    def _pieces(self, count: int) -> Iterator[tuple[bytearray, slice, slice]]:
        """So many bytes from here on: a page, where they are in it, and which of them they are."""
        begin, end = self._at, self._at + count
        while self._at < end:
            page = self._at // PAGE * PAGE
            stop = min(end, page + PAGE)
            yield (
                self.pages.setdefault(page, bytearray(PAGE)),
                slice(self._at - page, stop - page),
                slice(self._at - begin, stop - begin),
            )
            self._at = stop


def _opened(image: _Image, aligned: int = 0) -> Any:
    """The file for h5py, made anew where nothing is to be aligned; objects of so many bytes begin on a page."""
    import h5py
    from h5py import h5f, h5fd, h5p

    access, made = h5p.create(h5p.FILE_ACCESS), h5p.create(h5p.FILE_CREATE)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
    access.set_fileobj_driver(h5fd.fileobj_driver, image)
    if aligned:
        access.set_alignment(aligned, PAGE)
        return h5py.File(h5f.open(b"result", h5f.ACC_RDWR, access))
    made.set_attr_phase_change(COMPACT, 0)
    made.set_attr_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    made.set_link_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    return h5py.File(h5f.create(b"result", h5f.ACC_TRUNC, made, access))


def _describe(image: _Image, schema: Schema, cuts: Mapping[str, Cut]) -> None:
    """Writes the head of the file: names, attributes, coordinates, and columns that have no place yet."""
    import h5netcdf

    with _opened(image) as plain, h5netcdf.File(plain, "r+") as file:
        # xarray's way to mark what belongs to the coordinates of all variables
        away = [c.name for c in schema.coordinates if c.dims and not set(c.dims) & {c.name, *schema.grid.dims}]
        _say(file, {**schema.attrs, **({"coordinates": " ".join(away)} if away else {})})
        file.dimensions = schema.sizes
        for coordinate in schema.coordinates:
            _write_coordinate(file, plain, coordinate)
        group = file.create_group(GROUP)
        group.dimensions.update({"byte": BYTES, "character": ENDING_BYTES})
        for name, cut in cuts.items():
            lengths = {f"{name}_block": cut.blocks.count, f"{name}_column": len(cut.columns)}
            group.dimensions.update(lengths)
            digests = group.create_variable(f"{name}_digests", (*lengths, "byte"), "u1", dcpl=_properties())
            columns = json.dumps([[column.name for column in cut.columns], len(cut.grid)])
            about = "xxh3_128 of each chunk of each column, zeros where it is not computed yet"
            _say(digests, {"long_name": about, "columns": columns})
        ending = group.create_variable("ending", ("character",), "S1", dcpl=_properties((ENDING_BYTES,)))
        _say(ending, {"long_name": "when the run ended, and how fast it was, as JSON"})
        for column in schema.columns:
            dims = (*schema.grid.dims, *column.dims)
            properties = _properties(cuts["cells"].chunk(column))
            variable = file.create_variable(column.name, dims, column.dtype, dcpl=properties)
            away = [c.name for c in schema.coordinates if c.dims != (c.name,) and set(c.dims) <= set(dims)]
            _say(variable, {**column.attrs, **({"coordinates": " ".join(away)} if away else {})})
        if "rows" in cuts:
            rows, cut = file.create_group("rows"), cuts["rows"]
            rows.dimensions = {"row": cut.blocks.size} | {
                f"{c.name} {k}": n for c in cut.columns for k, n in enumerate(c.shape)
            }
            for column in cut.columns:
                own = (f"{column.name} {k}" for k in range(len(column.shape)))
                rows.create_variable(column.name, ("row", *own), column.dtype, dcpl=_properties(cut.chunk(column)))


def _write_coordinate(file: Any, plain: Any, coordinate: Coordinate) -> None:
    """In one chunk with a checksum; words as characters, as netCDF has them; a single number in its object header."""
    import h5py

    values, dims, attrs = np.asarray(coordinate.values), coordinate.dims, dict(coordinate.attrs)
    if values.dtype.kind == "U":
        words = np.array([word.encode() for word in values.ravel()])
        values = words.view("S1").reshape(*values.shape, words.dtype.itemsize)
        dims, attrs = (*dims, f"string{words.dtype.itemsize}"), {**attrs, "_Encoding": "utf-8"}
        if dims[-1] not in file.dimensions:
            file.dimensions[dims[-1]] = words.dtype.itemsize
    if dims:
        properties = _properties(values.shape)
        _say(file.create_variable(coordinate.name, dims, values.dtype, data=values, dcpl=properties), attrs)
        return
    space, kind = h5py.h5s.create(h5py.h5s.SCALAR), h5py.h5t.py_create(values.dtype)
    made = h5py.Dataset(h5py.h5d.create(plain.id, coordinate.name.encode(), kind, space, _properties(())))
    made[()] = values
    _say(made, attrs)


def _properties(chunk: tuple[int, ...] | None = None) -> Any:
    """How HDF5 makes a dataset: in chunks with a checksum; (): in its object header; None: in one piece, without.

    An output that is a single number is in one piece in any case: h5py gives it no properties.
    """
    from h5py import h5d, h5p

    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_attr_phase_change(COMPACT, 0)
    properties.set_fill_time(h5d.FILL_TIME_NEVER)
    if chunk == ():
        properties.set_layout(h5d.COMPACT)
    elif chunk:
        properties.set_chunk(chunk)
        properties.set_fletcher32()
    if chunk != ():
        properties.set_alloc_time(h5d.ALLOC_TIME_LATE)
    return properties


def _say(thing: Any, attrs: Mapping[str, Any]) -> None:
    """Attributes of a variable or a group; texts of a fixed length, which netCDF4 and MATLAB know, too."""
    import h5py

    for name, value in attrs.items():
        text = value.encode() if isinstance(value, str) else b""
        if isinstance(value, str) and len(text) <= LONGEST:
            value = np.array(text, h5py.string_dtype("utf-8", max(2, len(text))))
        thing.attrs[name] = value


def _allocate(file: Any, image: _Image, cuts: Mapping[str, Cut]) -> None:
    """Has HDF5 find a place for each number and digest."""
    for name, cut in cuts.items():
        file[f"{GROUP}/{name}_digests"][0, 0, 0] = 0
        for column in cut.columns:
            dataset = file[column.name if name == "cells" else f"rows/{column.name}"]
            if dataset.chunks:
                image.chunk = math.prod(dataset.chunks) * dataset.dtype.itemsize + len(WRONG)
                dataset.id.write_direct_chunk((0,) * dataset.ndim, bytes(image.chunk))
            else:
                dataset[()] = np.nan if dataset.dtype.kind == "f" else -1
    image.chunk = ENDING_BYTES + len(WRONG)
    file[ENDING].id.write_direct_chunk((0,), bytes(image.chunk))
