"""A result before its first number: HDF5 makes all of it, and says of each chunk where it is.

HDF5 checks every byte of names, attributes and coordinates that it reads: texts have a fixed length and stand in object
headers, coordinates are one chunk with a checksum each, single numbers stand in headers too. The zeros that it writes
over the chunks of outputs are kept from the disk: instead, each chunk of statuses says PENDING, and behind each other
chunk stands a checksum that is wrong, so that nobody takes what is not computed yet for numbers.
"""

from __future__ import annotations

import io
import math
import os
import secrets
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
from sweep.file.layout import (
    BYTES,
    ENDING,
    ENDING_BYTES,
    GROUP,
    PIECE,
    SEAL,
    Place,
    Table,
    contents,
    sealed,
)
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
LONG = 1 << 14
"""Bytes of a coordinate to which the study in the file refers."""
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
    image = _Image()
    tables, ending = _laid_out(image, schema, cuts, SHARED_WORTH_A_PAGE if shared else WORTH_A_PAGE)
    fd = disk.open_file(path, os.O_CREAT | os.O_TRUNC | os.O_RDWR)
    try:
        disk.reserve(fd, image.size + len(contents(tables, ending)) + SEAL.size)
        for at, page in image.pages.items():
            disk.write_all(fd, (page[: image.size - at],), at)
        for place in (place for table in tables.values() for place in table.places if place.check):
            _write_pending(fd, place)
        disk.write_all(fd, (sealed(fd, tables, ending, image.size),), image.size)
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
    starts = (place.at + (size - len(piece))).tolist()
    some = max(1, PIECE // size) if place.step == len(piece) else 1
    for chunks in (starts[:1], *(starts[k : k + some] for k in range(1, len(starts), some))):
        disk.write_all(fd, (piece * len(chunks),), chunks[0])


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
        self.size = self.chunk = self._at = 0

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
            start, self._at = self._at, min(end, page + PAGE)
            here = slice(start - page, self._at - page)
            yield self.pages.setdefault(page, bytearray(PAGE)), here, slice(start - begin, self._at - begin)


def _laid_out(image: _Image, schema: Schema, cuts: Mapping[str, Cut], aligned: int) -> tuple[dict[str, Table], int]:
    """Has HDF5 write all that is no number, and find a place for each number; objects of so many bytes are aligned."""
    import h5netcdf
    import h5py
    from h5py import h5f, h5fd, h5p

    access, made = h5p.create(h5p.FILE_ACCESS), h5p.create(h5p.FILE_CREATE)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
    access.set_alignment(aligned, PAGE)
    access.set_fileobj_driver(h5fd.fileobj_driver, image)
    # each thing behind the last one, so that chunks are at equal distances
    made.set_file_space_strategy(h5f.FSPACE_STRATEGY_NONE, False, 1)
    made.set_attr_phase_change(COMPACT, 0)
    made.set_attr_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    made.set_link_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    with h5py.File(h5f.create(b"result", h5f.ACC_TRUNC, made, access)) as plain, h5netcdf.File(plain, "r+") as file:
        # xarray's way to mark what belongs to the coordinates of all variables, and of one
        shared = [c.name for c in schema.coordinates if c.dims and not set(c.dims) & {c.name, *schema.grid.dims}]
        _say(file, {**_attrs(schema), **({"coordinates": " ".join(shared)} if shared else {})})
        file.dimensions = schema.sizes
        for coordinate in schema.coordinates:
            values, dims, attrs = np.asarray(coordinate.values), coordinate.dims, dict(coordinate.attrs)
            if values.dtype.kind == "U":  # as characters, as netCDF has them
                words = np.array([word.encode() for word in values.ravel()])
                values = words.view("S1").reshape(*values.shape, words.dtype.itemsize)
                dims, attrs = (*dims, f"string{words.dtype.itemsize}"), {**attrs, "_Encoding": "utf-8"}
                if dims[-1] not in file.dimensions:
                    file.dimensions[dims[-1]] = words.dtype.itemsize
            if dims:
                _say(
                    file.create_variable(coordinate.name, dims, values.dtype, data=values, dcpl=_how(values.shape)),
                    attrs,
                )
                continue
            # h5py and h5netcdf would not keep a single number in its object header
            space, kind = h5py.h5s.create(h5py.h5s.SCALAR), h5py.h5t.py_create(values.dtype)
            single = h5py.Dataset(h5py.h5d.create(plain.id, coordinate.name.encode(), kind, space, _how(())))
            single[()] = values
            _say(single, attrs)
        group = file.create_group(GROUP)
        group.dimensions.update({"byte": BYTES, "character": ENDING_BYTES})
        about = "when the run ended, and how fast it was: JSON, and its xxh3_128 digest"
        _say(group.create_variable("ending", ("character",), "u1", dcpl=_how(None)), {"long_name": about})
        for name, cut in cuts.items():
            lengths = {f"{name}_block": cut.blocks.count, f"{name}_column": len(cut.columns)}
            group.dimensions.update(lengths)
            about = "xxh3_128 of each chunk of each column, zeros where it is not computed yet"
            digests = group.create_variable(f"{name}_digests", (*lengths, "byte"), "u1", dcpl=_how(None))
            _say(digests, {"long_name": about})
        for column in schema.columns:
            dims = (*schema.grid.dims, *column.dims)
            beside = [c.name for c in schema.coordinates if c.dims != (c.name,) and set(c.dims) <= set(dims)]
            variable = file.create_variable(column.name, dims, column.dtype, dcpl=_how(cuts["cells"].chunk(column)))
            _say(variable, {**column.attrs, **({"coordinates": " ".join(beside)} if beside else {})})
        if "rows" in cuts:
            rows, cut = file.create_group("rows"), cuts["rows"]
            rows.dimensions["row"] = cut.blocks.size
            for column in cut.columns:
                own = {f"{column.name} {k}": length for k, length in enumerate(column.shape)}
                rows.dimensions.update(own)
                rows.create_variable(column.name, ("row", *own), column.dtype, dcpl=_how(cut.chunk(column)))
        key, tables = secrets.token_hex(BYTES), {}
        for name, cut in cuts.items():
            places = tuple(_placed(plain if name == "cells" else plain[name], image, cut, c) for c in cut.columns)
            at = int(plain[f"{GROUP}/{name}_digests"].id.get_offset())
            tables[name] = Table(name, cut.grid, cut.blocks, places, at, key)
        return tables, int(plain[ENDING].id.get_offset())


def _how(chunk: tuple[int, ...] | None) -> Any:
    """How HDF5 makes a dataset: in chunks with a checksum; (): in its object header; None: in one piece, without.

    An output that is a single number is in one piece in any case: h5py gives it no properties.
    """
    from h5py import h5d, h5p

    how = h5p.create(h5p.DATASET_CREATE)
    how.set_attr_phase_change(COMPACT, 0)
    how.set_fill_time(h5d.FILL_TIME_NEVER)
    if chunk == ():
        how.set_layout(h5d.COMPACT)
        return how
    how.set_alloc_time(h5d.ALLOC_TIME_LATE if chunk else h5d.ALLOC_TIME_EARLY)
    if chunk:
        how.set_chunk(chunk)
        how.set_fletcher32()
    return how


def _say(thing: Any, attrs: Mapping[str, Any]) -> None:
    """Attributes of a variable or a group; texts of a fixed length, which netCDF4 and MATLAB know, too."""
    import h5py

    for name, value in attrs.items():
        if isinstance(value, str):
            text = value.encode()
            value = np.array(text, h5py.string_dtype("utf-8", max(2, len(text))))
        thing.attrs[name] = value


def _placed(group: Any, image: _Image, cut: Cut, column: Column) -> Place:
    """Has HDF5 find a place for each chunk of a column. Raises OSError where it places them in another way."""
    dataset, count = group[column.name], cut.blocks.count
    size = column.cell_bytes * math.prod(box_shape(cut.grid, cut.blocks.cells))
    if dataset.chunks is None:
        dataset[()] = np.nan if dataset.dtype.kind == "f" else -1
        first = int(dataset.id.get_offset())
        return Place(column.name, dataset.dtype.str, column.shape, size, 0, 1, first, first, 0)
    image.chunk = size + len(WRONG)
    group.file.flush()  # so that nothing comes between the chunks
    dataset.id.write_direct_chunk((0,) * dataset.ndim, bytes(image.chunk))
    counts = [-(-n // length) for n, length in zip(dataset.shape, dataset.chunks, strict=True)]
    corners = np.array(np.unravel_index(np.minimum((0, 1, 2, count - 1), count - 1), counts)).T * dataset.chunks
    infos = [dataset.id.get_chunk_info_by_coord(tuple(corner)) for corner in corners.tolist()]
    first, second, third, last = (int(info.byte_offset) for info in infos)
    step = third - second
    # each chunk takes no less than a step, so that they are at equal distances if they are so in sum
    if last != second + max(0, count - 2) * step or count != math.prod(counts):
        raise OSError(f"HDF5 has not placed the chunks of {column.name} one behind the other")
    return Place(column.name, dataset.dtype.str, column.shape, size, len(WRONG), count, first, second, step)
