"""From parts to one file that netCDF4 and HDF5 readers open.

HDF5 writes the structure: dimensions, coordinates, attributes, statuses, and the places of the outputs. These are
contiguous, so a block's cells are consecutive bytes there, and threads copy them in by plain writes at disk speed.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sweep.cells.grid import Box
from sweep.cells.output_schema import gathered, part_columns
from sweep.cells.partition import Partition, row_blocks
from sweep.cells.schema import Column, Coordinate, Schema
from sweep.store.digests import BYTES, Digests, column_digests, structure_digest, structure_place, trailer
from sweep.store.hdf5_bytes import Hdf5Bytes, unfilled
from sweep.store.parts import DAMAGE, FLAGS
from sweep.store.probe import written
from sweep.store.store import Store
from sweep.study.model import Study
from sweep.system import disk
from sweep.system.errors import SweepError
from sweep.system.pool import BufferPool, CtrlC, each

CHUNK_CELLS = 1 << 18
"""Cells of one compressed piece of status and method_used; HDF5 keeps at least four of them in memory."""
SYNC_BYTES = 128 << 20
"""Bytes after which the disk is set to work, long before the end."""
CHUNK_BYTES = 8 << 20
"""Bytes of the rows that are reduced to groups at a time."""

Tell = Callable[[int, int], None]


def assemble(store: Store, study: Study, schema: Schema, output: Path, threads: int, tell: Tell) -> list[int]:
    """Puts the parts together under the output's name; then the parts are not needed any more.

    Parameters
    ----------
    tell : called with the number of parts written, and of all parts

    Returns
    -------
    list of int
        Blocks whose part turned out to be damaged. Then there is no output; compute them again.

    Raises
    ------
    SweepError
        The disk is full or fails. All parts are kept.
    """
    temporary = store.temporary("result.h5")
    try:
        digests = Digests(schema.columns, chunks(study, store.blocks))
        damaged = _build(store, study, schema, digests, temporary, threads, tell)
        if not damaged:
            _check(schema, digests, temporary, output)
            disk.rename(temporary, output)
            disk.sync_folder(output.parent)
            written(output)
        return damaged
    except (OSError, RuntimeError) as fault:
        raise disk.refusal(fault, output) from fault
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def chunks(study: Study, blocks: Partition) -> Partition:
    """The output's cells that are written, and have a digest, together: those of a part, or some groups."""
    if study.summary is None:
        return blocks
    rows = row_blocks(study)
    row_bytes = sum(column.cell_bytes for column in part_columns(study))
    return Partition(rows.groups, min(rows.groups, max(1, CHUNK_BYTES // (row_bytes * rows.per_group))))


def _build(
    store: Store, study: Study, schema: Schema, digests: Digests, path: Path, threads: int, tell: Tell
) -> list[int]:
    fd = disk.open_file(path, os.O_CREAT | os.O_EXCL | os.O_RDWR)
    try:
        hdf5 = Hdf5Bytes(fd)
        with CtrlC():
            write_structure(hdf5, schema, digests)
        hdf5.check()
        writer = _fill(store, study, schema, digests, hdf5, fd, threads, tell)
        hdf5.finish()
        if not writer.damaged:
            _end(fd, writer)
            disk.fsync(fd)
        return sorted(writer.damaged)
    finally:
        os.close(fd)


def _fill(
    store: Store, study: Study, schema: Schema, digests: Digests, hdf5: Hdf5Bytes, fd: int, threads: int, tell: Tell
) -> _Writer:
    """Writes all columns on a pool of threads."""
    import h5py

    with h5py.File(hdf5, "r+") as file:
        writer = _Writer(schema, digests, file, hdf5, fd)
        work: Callable[[int], None]
        if study.summary is None:
            work = _Copier(store, writer, threads).copy
        else:
            work, threads = _Gatherer(store, study, writer).gather, 1
        each(range(digests.chunks.count), work, threads, lambda job: tell(writer.written, digests.chunks.count))
        if not writer.damaged:
            digests.write(file)
    return writer


def _end(fd: int, writer: _Writer) -> None:
    """Writes the digests of everything else, which must be in its place by now."""
    place = writer.structure_place
    found = structure_digest(fd, [*writer.regions, (place, place + BYTES)])
    disk.pwrite_all(fd, found, place)
    disk.pwrite_all(fd, trailer(writer.regions, fd), os.fstat(fd).st_size)


def write_structure(path: Any, schema: Schema, digests: Digests) -> None:
    """Writes everything but the columns' numbers and digests to a file, or what HDF5 takes for one."""
    import h5netcdf

    with h5netcdf.File(path, "w") as file:
        shared = [c.name for c in schema.coordinates if c.dims and not set(c.dims) & {c.name, *schema.grid.dims}]
        # xarray's way to mark what belongs to the coordinates of all variables
        file.attrs.update({**schema.attrs, **({"coordinates": " ".join(shared)} if shared else {})})
        file.dimensions = schema.sizes
        for coordinate in schema.coordinates:
            _write_coordinate(file, coordinate)
        for column in schema.columns:
            away = " ".join(_auxiliary(schema, column))
            variable = _declare(file, schema, column)
            variable.attrs.update({**column.attrs, **({"coordinates": away} if away else {})})
        digests.declare(file)


def _auxiliary(schema: Schema, column: Column) -> Iterator[str]:
    """Coordinates of a variable that are not among its dimensions."""
    dims = {*schema.grid.dims, *column.dims}
    return (c.name for c in schema.coordinates if c.dims != (c.name,) and set(c.dims) <= dims)


def _write_coordinate(file: Any, coordinate: Coordinate) -> None:
    import h5py

    values = np.asarray(coordinate.values)
    text = values.dtype.kind == "U"
    dtype = h5py.string_dtype() if text else values.dtype
    data = values.astype(object) if text else values
    file.create_variable(coordinate.name, coordinate.dims, dtype, data=data).attrs.update(coordinate.attrs)


def _declare(file: Any, schema: Schema, column: Column) -> Any:
    dims = (*schema.grid.dims, *column.dims)
    if not schema.shape(column):
        # h5py does not heed the properties of a single number; written, it has its place
        return file.create_variable(column.name, (), column.dtype, data=np.zeros((), column.dtype))
    if column.name not in FLAGS:
        return file.create_variable(column.name, dims, column.dtype, dcpl=unfilled())
    chunks = chunk_shape(schema.grid.shape)
    return file.create_variable(column.name, dims, column.dtype, chunks=chunks, compression="gzip", compression_opts=1)


def chunk_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Chunks that follow the cells' order: whole trailing dimensions, part of one, single ones before."""
    chunks: list[int] = []
    room = CHUNK_CELLS
    for length in reversed(shape):
        chunks.append(max(1, min(length, room)))
        room //= chunks[-1] if chunks[-1] == length else room
    return tuple(reversed(chunks))


class _Writer:
    """Writes chunks of cells to their places, in any order."""

    def __init__(self, schema: Schema, digests: Digests, file: Any, hdf5: Hdf5Bytes, fd: int) -> None:
        self.damaged: set[int] = set()
        self.written = 0
        self._columns, self._digests, self._fd = schema.columns, digests, fd
        # contiguous ones; those in chunks are left to HDF5
        datasets = {c.name: file[c.name] for c in schema.columns if c.name not in FLAGS}
        self._places = {name: dataset.id.get_offset() for name, dataset in datasets.items()}
        self.regions = [(at, at + datasets[name].nbytes) for name, at in self._places.items()]
        self.structure_place = structure_place(file)
        flags = [c.name for c in schema.columns if c.name in FLAGS]
        self._flags = _Flags({name: file[name] for name in flags}, schema, digests.chunks, hdf5)
        self._unsynced = 0
        self._lock = threading.Lock()

    def put(self, chunk: int, arrays: Mapping[str, Any]) -> None:
        """Raises OSError where the disk fails."""
        self._digests.take(chunk, arrays)
        self._flags.put(chunk, arrays)
        start = self._digests.chunks.bounds(chunk)[0]
        # the system lets one thread at a time write to a file; those that wait for it there burn time
        with self._lock:
            for column in self._columns:
                if column.name in self._places:
                    at = self._places[column.name] + start * column.cell_bytes
                    disk.pwrite_all(self._fd, arrays[column.name], at)
                    self._unsynced += arrays[column.name].nbytes
            self.written += 1
            due = self._unsynced > SYNC_BYTES
            self._unsynced = 0 if due else self._unsynced
        if due:
            disk.fsync(self._fd)


class _Copier:
    """Copies verified parts; after the first damaged one it only looks for others."""

    def __init__(self, store: Store, writer: _Writer, threads: int) -> None:
        self._store, self._writer = store, writer
        cells = min(store.blocks.cells, store.blocks.size)
        self._buffers = BufferPool(lambda: {column.name: column.empty(cells) for column in store.columns}, threads)

    def copy(self, index: int) -> None:
        with self._buffers.borrow() as buffers:
            arrays = self._store.get(index, buffers)
            if arrays is None:
                self._writer.damaged.add(index)
            elif not self._writer.damaged:
                self._writer.put(index, arrays)


class _Gatherer:
    """Reduces the rows of verified parts to groups, in their order."""

    def __init__(self, store: Store, study: Study, writer: _Writer) -> None:
        self._study, self._writer, self._chunks = study, writer, chunks(study, store.blocks)
        self._rows = row_blocks(study).per_group
        self._store = store
        self._last: tuple[int, dict[str, Any]] | None = None

    def gather(self, chunk: int) -> None:
        first, last = (self._rows * groups for groups in self._chunks.bounds(chunk))
        blocks = range(first // self._store.blocks.cells, -(-last // self._store.blocks.cells))
        found = [self._part(index) for index in blocks]
        if not self._writer.damaged:
            skip = first - self._store.blocks.bounds(blocks[0])[0]
            rows = {
                c.name: np.concatenate([part[c.name] for part in found])[skip : skip + last - first]
                for c in self._store.columns
            }
            self._writer.put(chunk, gathered(self._study, rows))

    def _part(self, index: int) -> dict[str, Any]:
        if self._last is None or self._last[0] != index:
            found = self._store.get(index)
            if found is None:
                self._writer.damaged.add(index)
                return {}
            self._last = index, found
        return self._last[1]


class _Flags:
    """Writes statuses and methods in the order of cells, so that HDF5 compresses each chunk once.

    Blocks that come early wait in memory, two bytes a cell.
    """

    def __init__(self, datasets: Mapping[str, Any], schema: Schema, blocks: Partition, hdf5: Hdf5Bytes) -> None:
        self._schema, self._blocks, self._hdf5, self._datasets = schema, blocks, hdf5, datasets
        self._early: dict[int, dict[str, Any]] = {}
        self._next = 0
        self._lock = threading.Lock()

    def put(self, index: int, arrays: Mapping[str, Any]) -> None:
        """Raises OSError where the disk fails."""
        with self._lock:
            self._early[index] = {name: arrays[name].copy() for name in self._datasets}
            while self._next in self._early:
                for name, column in self._early.pop(self._next).items():
                    _write_cells(self._datasets[name], self._schema, self._blocks.bounds(self._next), column)
                self._next += 1
        self._hdf5.check()


def _write_cells(dataset: Any, schema: Schema, bounds: tuple[int, int], column: Any) -> None:
    for slices, begin, end in schema.grid.pieces(*bounds):
        dataset[slices] = column[begin:end].reshape([s.stop - s.start for s in slices])


def _check(schema: Schema, digests: Digests, path: Path, output: Path) -> None:
    """Reads some chunks back as any reader would. Raises SweepError where they differ."""
    import h5py

    last = digests.chunks.count - 1
    try:
        with h5py.File(path, "r") as file:
            same = all(_reads_back(schema, digests, file, chunk) for chunk in {0, last // 2, last})
    except DAMAGE:
        same = False
    if not same:
        raise SweepError(f"{output}: differs when read back from what was written; the disk may be failing")


def _reads_back(schema: Schema, digests: Digests, file: Any, chunk: int) -> bool:
    bounds = digests.chunks.bounds(chunk)
    arrays = {c.name: read_cells(file[c.name], schema.grid, bounds, c) for c in schema.columns}
    return bool((column_digests(schema.columns, arrays) == digests.table[chunk]).all())


def read_cells(dataset: Any, box: Box, bounds: tuple[int, int], column: Column) -> Any:
    """The flat cells from one number to another."""
    arrays = column.empty(bounds[1] - bounds[0])
    for slices, begin, end in box.pieces(*bounds):
        arrays[begin:end] = dataset[slices].reshape(end - begin, *column.shape)
    return arrays
