"""Layout of a result by HDF5 before the first number; later only numbers, digests and the ending change.

HDF5 checks every byte of names, attributes and coordinates that it reads: texts have a fixed length and stand in object
headers, coordinates are one chunk with a checksum each, single numbers stand in headers too. Each chunk of statuses
says PENDING. Zeros that HDF5 would write over other chunks do not reach the disk; those chunks have a wrong
checksum instead, so that nobody takes cells that are not computed yet for numbers.
"""

from __future__ import annotations

import errno
import io
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kernels.interface import Status
from sweep.cells.partition import Partition, box_shape, boxes, row_blocks
from sweep.cells.reduce import part_columns
from sweep.cells.schema import STATUS, Column, Schema
from sweep.file import disk
from sweep.file.reading import BYTES, FORMAT, checksum, key_of
from sweep.study.model import ARRAY, Study

PAGE = 4096
WORTH_A_PAGE = 10 * PAGE
"""Chunks of so many bytes begin on a page of their own, at a cost of a tenth at most; where several machines write to
the file, those of a page."""
GATHERED_BYTES = 8 << 20
"""Bytes of the rows that are reduced to groups at a time."""
COMPACT = 1 << 15
"""Attributes up to which HDF5 keeps them in an object header."""
LONG = 1 << 12
"""Bytes of a coordinate to which the study in the file refers, so that its text fits into an object header."""
TEXT_BYTES = 30 << 10
"""Approximate size of the structure of a result."""
WRONG = b"\xff" * 4
"""A checksum that zeros do not have."""


class Cut(NamedTuple):
    """Columns, the grid in which their cells stand, and how it is cut."""

    columns: tuple[Column, ...]
    grid: tuple[int, ...]
    blocks: Partition


def cuts_of(study: Study, schema: Schema, blocks: Partition) -> dict[str, Cut]:
    """The tables of a study's result, whose output has a schema, and in which blocks are computed."""
    ending = Cut((Column("ending", "S240", (), (), {}),), (1,), Partition(1, 1))
    if study.summary is None:
        return {"cells": Cut(schema.columns, schema.shape, blocks), "ending": ending}
    rows, columns = row_blocks(study), part_columns(study)
    row_bytes = sum(column.cell_bytes for column in columns)
    groups = boxes(schema.shape, GATHERED_BYTES // (row_bytes * rows.per_row))
    cells = Cut(schema.columns, schema.shape, groups)
    return {"rows": Cut(columns, (rows.count,), blocks), "cells": cells, "ending": ending}


def expected_size(schema: Schema, cuts: Mapping[str, Cut]) -> int:
    """Bytes that a result will take, about, unless blocks have but a few cells: texts, coordinates, numbers."""
    coordinates = sum(np.asarray(coordinate.values).nbytes for coordinate in schema.coordinates)
    numbers = sum(math.prod(cut.grid) * column.cell_bytes for cut in cuts.values() for column in cut.columns)
    return TEXT_BYTES + coordinates + numbers


def create(path: Path, schema: Schema, cuts: Mapping[str, Cut], shared: bool = False) -> None:
    """Writes a result of which nothing is computed yet, with room for all of it. Raises OSError.

    Of the output's `schema`, with tables as `cuts_of` gives them; `shared`, where several machines may write.
    """
    with _Skeleton(disk.open_file(path, os.O_CREAT | os.O_TRUNC | os.O_RDWR), "r+") as skeleton:
        key_at, fd = 0, skeleton.fileno()
        try:
            key_at = _lay_out(skeleton, schema, cuts, PAGE if shared else WORTH_A_PAGE)
        except Exception:
            if not skeleton.refused:
                raise
        if skeleton.refused:
            raise OSError(skeleton.refused, os.strerror(skeleton.refused))
        disk.reserve(fd, skeleton.seek(0, os.SEEK_END))
        disk.write_all(fd, (key_of(fd, key_at),), key_at)


class _Skeleton(io.FileIO):
    """The file as HDF5 writes it, but for the zeros of each chunk, which has `chunk` bytes, behind which is WRONG.

    HDF5 cannot go on where the system refuses to write, nor end: it is left to believe that all is well, and the error
    number is kept as `refused`: an exception would keep what HDF5 has open beyond the end of Python.
    """

    chunk = refused = 0

    def write(self, piece: Any) -> int:
        at, size = self.tell(), len(piece)
        write: Any = disk.write_all
        # HDF5 writes nothing else of a chunk's length that begins with zeros: its tables begin with addresses
        if size == self.chunk and bytes(piece[:BYTES]) == bytes(min(BYTES, size)):
            at, piece, write = at + size - len(WRONG), WRONG, disk.write  # there may be millions of them
        try:
            if not self.refused:
                write(self.fileno(), (bytes(piece),), at)
        except OSError as fault:
            self.refused = fault.errno or errno.EIO
        self.seek(at + len(piece))
        return size


def _lay_out(skeleton: _Skeleton, schema: Schema, cuts: Mapping[str, Cut], aligned: int) -> int:
    """Has HDF5 write all that is no number, and then find a place for each, that of the key first, which is returned.

    Objects of so many bytes are aligned.
    """
    import h5py
    from h5py import h5f, h5fd, h5p

    access, made = h5p.create(h5p.FILE_ACCESS), h5p.create(h5p.FILE_CREATE)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
    access.set_alignment(aligned, PAGE)
    access.set_fileobj_driver(h5fd.fileobj_driver, skeleton)
    # each thing behind the last one
    made.set_file_space_strategy(h5f.FSPACE_STRATEGY_NONE, False, 1)
    made.set_attr_phase_change(COMPACT, 0)
    made.set_attr_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    made.set_link_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    with h5py.File(h5f.create(b"result", h5f.ACC_TRUNC, made, access)) as file:
        sizes, dims, tables = dict(schema.sizes), dict[str, tuple[str, ...]](), dict[str, dict[str, Any]]()
        _write_coordinates(file, schema, sizes, dims)
        for name, cut in cuts.items():
            paths = [column.name if name == "cells" else f"{name}/{column.name}" for column in cut.columns]
            blocks = (cut.blocks.size, cut.blocks.cells, cut.blocks.row)
            tables[name] = {"grid": cut.grid, "blocks": blocks, "paths": paths}
            for path, column in zip(paths, cut.columns, strict=True):
                chunk = (*box_shape(cut.grid, cut.blocks.cells), *column.shape)
                data = _make(file, path, (*cut.grid, *column.shape), column.dtype, chunk, column)
                if name == "cells":
                    over = dims[path] = (*schema.grid, *column.dims)
                    # xarray's way to mark what belongs to the coordinates of a variable, and of all
                    beside = [c.name for c in schema.coordinates if c.dims != (c.name,) and set(c.dims) <= {*over}]
                    _say(data, column.attrs, beside)
        _relate(file, sizes, dims)
        integrity = file.create_group("integrity")
        _say(integrity, {"format": FORMAT, "contents": json.dumps({"tables": tables, "dims": dims})})
        pieces = [integrity.create_dataset("key", BYTES, "u1")]
        for name, cut in cuts.items():
            pieces.append(integrity.create_dataset(name, (cut.blocks.count, len(cut.columns), BYTES), "u1"))
        # from here on nothing is made, and places alone are found
        file.flush()
        for data in pieces:
            data[...] = np.zeros(data.shape, "u1")
        for data in (file[path] for table in tables.values() for path in table["paths"]):
            if data.chunks is None:
                data[()] = np.nan if data.dtype.kind == "f" else -1
                continue
            # the first chunk that is written has HDF5 find a place for all, and fill them
            first = np.full(data.chunks, data.fillvalue, data.dtype).tobytes()
            skeleton.chunk = len(first) + len(WRONG)
            data.id.write_direct_chunk((0,) * data.ndim, first + checksum(first, len(first)))
        return int(pieces[0].id.get_offset())


def _write_coordinates(file: Any, schema: Schema, sizes: dict[str, int], dims: dict[str, tuple[str, ...]]) -> None:
    """Coordinates and attributes of the file; notes their dimensions, and what these are long."""
    study = schema.attrs["study_json"]
    for c in schema.coordinates:
        values, dims[c.name], attrs = np.asarray(c.values), c.dims, c.attrs
        if values.nbytes >= LONG:  # the study refers to it
            study = study.replace(ARRAY % c.values.tobytes().hex(), ARRAY % f"@{c.name}")
        if values.dtype.kind == "U":  # as characters
            texts = np.array([word.encode() for word in values.ravel()])
            values = texts.view("S1").reshape(*values.shape, texts.dtype.itemsize)
            dims[c.name], attrs = (*c.dims, f"string{texts.dtype.itemsize}"), {**attrs, "_Encoding": "utf-8"}
            sizes[dims[c.name][-1]] = texts.dtype.itemsize
        data = _make(file, c.name, values.shape, values.dtype, values.shape)
        data[...] = values
        _say(data, attrs)
    away = [c.name for c in schema.coordinates if c.dims and not {*c.dims} & {c.name, *schema.grid}]
    _say(file, {**schema.attrs, "study_json": study}, away)


def _relate(file: Any, sizes: Mapping[str, int], dims: Mapping[str, tuple[str, ...]]) -> None:
    """Dimensions as netCDF4 knows them: each has a variable, if one without numbers, to which others refer."""
    for number, (dim, size) in enumerate(sizes.items()):
        own = dims.get(dim, ())
        data = file[dim] if own else file.create_dataset(dim, size, ">f4")
        data.make_scale(dim if own else f"This is a netCDF dimension but not a netCDF variable.{size:10}")
        data.attrs["_Netcdf4Dimid"] = np.int32(number)
        if len(own) > 1:
            data.attrs["_Netcdf4Coordinates"] = np.array([[*sizes].index(dim) for dim in own], np.int32)
    for name, over in dims.items():
        for place, dim in enumerate(over if over[:1] != (name,) else ()):
            file[name].dims[place].attach_scale(file[dim])


def _make(
    file: Any, path: str, shape: tuple[int, ...], dtype: Any, chunk: tuple[int, ...], column: Column | None = None
) -> Any:
    """A dataset, in chunks with a checksum each; a single number stands in its object header.

    One of a column, which is written later, stands by itself; the chunks of a column have no places yet.
    """
    import h5py
    from h5py import h5d, h5p, h5s, h5t

    how = h5p.create(h5p.DATASET_CREATE)
    how.set_attr_phase_change(COMPACT, 0)
    if chunk:
        how.set_chunk(chunk)
        how.set_fletcher32()
    elif column is None:
        how.set_layout(h5d.COMPACT)
    if column is not None:
        how.set_alloc_time(h5d.ALLOC_TIME_LATE)
        how.set_fill_time(h5d.FILL_TIME_ALLOC if column.name == STATUS else h5d.FILL_TIME_NEVER)
        if column.name == STATUS:
            how.set_fill_value(np.array(Status.PENDING, column.dtype))
    group, _, name = path.rpartition("/")
    # h5py forgets how a single number is to be kept
    space = h5s.create_simple(shape) if shape else h5s.create(h5s.SCALAR)
    kind = h5t.py_create(np.dtype(dtype), logical=True)
    return h5py.Dataset(h5d.create(file.require_group(group or "/").id, name.encode(), kind, space, how))


def _say(thing: Any, attrs: Mapping[str, Any], beside: Sequence[str] = ()) -> None:
    """Attributes of a variable or a group; texts of a fixed length, which netCDF4 and MATLAB know, too."""
    import h5py

    for name, value in {**attrs, **({"coordinates": " ".join(beside)} if beside else {})}.items():
        if isinstance(value, str):
            text = value.encode()
            value = np.array(text, h5py.string_dtype("utf-8", max(2, len(text))))
        thing.attrs[name] = value
