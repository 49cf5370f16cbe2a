"""From parts to one file that netCDF4 and HDF5 readers open.

HDF5 writes the frame: dimensions, coordinates, attributes, statuses, and the places of the outputs. These are
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

from sweep import disk
from sweep.canvas import Canvas
from sweep.errors import SweepError
from sweep.image import unfilled
from sweep.layout import METHOD_USED, STATUS, Column, Coordinate, Layout
from sweep.parts import DAMAGE, digest
from sweep.pool import CtrlC, Spares, each
from sweep.store import Store

CHUNK_CELLS = 1 << 18
"""Cells of one compressed piece of status and method_used; HDF5 keeps at least four of them in memory."""
SYNC_BYTES = 128 << 20
"""Bytes after which the disk is set to work, long before the end."""
FLAGS = (STATUS, METHOD_USED)

Tell = Callable[[int, int], None]


def assemble(store: Store, layout: Layout, output: Path, threads: int, tell: Tell) -> list[int]:
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
        damaged = _build(store, layout, temporary, threads, tell)
        if not damaged:
            _check(store, layout, temporary, output)
            disk.rename(temporary, output)
            disk.sync_folder(output.parent)
        return damaged
    except (OSError, RuntimeError) as fault:
        raise disk.refusal(fault, output) from fault
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _build(store: Store, layout: Layout, path: Path, threads: int, tell: Tell) -> list[int]:
    fd = disk.open_file(path, os.O_CREAT | os.O_EXCL | os.O_RDWR)
    try:
        canvas = Canvas(fd)
        damaged = _fill(store, layout, canvas, fd, threads, tell)
        canvas.finish()
        if not damaged:
            disk.fsync(fd)
        return damaged
    finally:
        os.close(fd)


def _fill(store: Store, layout: Layout, canvas: Canvas, fd: int, threads: int, tell: Tell) -> list[int]:
    """Writes the frame, then copies all parts on a pool of threads; returns those that are damaged."""
    import h5py

    with CtrlC():
        write_frame(canvas, layout)
    canvas.check()
    with h5py.File(canvas, "r+") as file:
        places = {c.name: file[c.name].id.get_offset() for c in layout.columns if c.name not in FLAGS}
        copier = _Copier(store, fd, places, _Flags(store, layout, file, canvas), threads)
        each(range(store.blocks.count), copier.copy, threads, lambda job: tell(copier.copied, store.blocks.count))
    return sorted(copier.damaged)


def write_frame(path: Any, layout: Layout) -> None:
    """Writes everything but the columns' numbers to a file, or what HDF5 takes for one."""
    import h5netcdf

    with h5netcdf.File(path, "w") as file:
        shared = [c.name for c in layout.coordinates if c.dims and not set(c.dims) & {c.name, *layout.grid.dims}]
        # xarray's way to mark what belongs to the coordinates of all variables
        file.attrs.update({**layout.attrs, **({"coordinates": " ".join(shared)} if shared else {})})
        file.dimensions = layout.sizes
        for coordinate in layout.coordinates:
            _write_coordinate(file, coordinate)
        for column in layout.columns:
            away = " ".join(_auxiliary(layout, column))
            variable = _declare(file, layout, column)
            variable.attrs.update({**column.attrs, **({"coordinates": away} if away else {})})


def _auxiliary(layout: Layout, column: Column) -> Iterator[str]:
    """Coordinates of a variable that are not among its dimensions."""
    dims = {*layout.grid.dims, *column.dims}
    return (c.name for c in layout.coordinates if c.dims != (c.name,) and set(c.dims) <= dims)


def _write_coordinate(file: Any, coordinate: Coordinate) -> None:
    import h5py

    values = np.asarray(coordinate.values)
    text = values.dtype.kind == "U"
    dtype = h5py.string_dtype() if text else values.dtype
    data = values.astype(object) if text else values
    file.create_variable(coordinate.name, coordinate.dims, dtype, data=data).attrs.update(coordinate.attrs)


def _declare(file: Any, layout: Layout, column: Column) -> Any:
    dims = (*layout.grid.dims, *column.dims)
    if column.name not in FLAGS:
        return file.create_variable(column.name, dims, column.dtype, dcpl=unfilled())
    chunks = chunk_shape(layout.grid.shape)
    return file.create_variable(column.name, dims, column.dtype, chunks=chunks, compression="gzip", compression_opts=1)


def chunk_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Chunks that follow the cells' order: whole trailing dimensions, part of one, single ones before."""
    chunks: list[int] = []
    room = CHUNK_CELLS
    for length in reversed(shape):
        chunks.append(max(1, min(length, room)))
        room //= chunks[-1] if chunks[-1] == length else room
    return tuple(reversed(chunks))


class _Copier:
    """Copies verified parts to their places; after the first damaged one it only looks for others."""

    def __init__(self, store: Store, fd: int, places: Mapping[str, int], flags: _Flags, threads: int) -> None:
        self.damaged: list[int] = []
        self.copied = 0
        self._store, self._fd, self._places, self._flags = store, fd, places, flags
        self._unsynced = 0
        self._lock = threading.Lock()
        cells = min(store.blocks.cells, store.blocks.size)
        self._buffers = Spares(lambda: {column.name: column.empty(cells) for column in store.columns}, threads)

    def copy(self, index: int) -> None:
        with self._buffers.lent() as buffers:
            arrays = self._store.get(index, buffers)
            if arrays is None:
                self.damaged.append(index)
            elif not self.damaged:
                self._flags.put(index, arrays)
                self._write(self._store.blocks.bounds(index)[0], arrays)

    def _write(self, start: int, arrays: Mapping[str, Any]) -> None:
        # the system lets one thread at a time write to a file; those that wait for it there burn time
        with self._lock:
            for column in self._store.columns:
                if column.name in self._places:
                    at = self._places[column.name] + start * column.cell_bytes
                    disk.pwrite_all(self._fd, arrays[column.name], at)
                    self._unsynced += arrays[column.name].nbytes
            self.copied += 1
            due = self._unsynced > SYNC_BYTES
            self._unsynced = 0 if due else self._unsynced
        if due:
            disk.fsync(self._fd)


class _Flags:
    """Writes statuses and methods in the order of cells, so that HDF5 compresses each chunk once.

    Blocks that come early wait in memory, two bytes a cell.
    """

    def __init__(self, store: Store, layout: Layout, file: Any, canvas: Canvas) -> None:
        self._store, self._layout, self._canvas = store, layout, canvas
        self._datasets = {name: file[name] for name in FLAGS}
        self._early: dict[int, dict[str, Any]] = {}
        self._next = 0
        self._lock = threading.Lock()

    def put(self, index: int, arrays: Mapping[str, Any]) -> None:
        """Raises OSError where the disk fails."""
        with self._lock:
            self._early[index] = {name: arrays[name].copy() for name in FLAGS}
            while self._next in self._early:
                for name, column in self._early.pop(self._next).items():
                    _write_cells(self._datasets[name], self._layout, self._store.blocks.bounds(self._next), column)
                self._next += 1
        self._canvas.check()


def _write_cells(dataset: Any, layout: Layout, bounds: tuple[int, int], column: Any) -> None:
    for slices, begin, end in layout.grid.pieces(*bounds):
        dataset[slices] = column[begin:end].reshape([s.stop - s.start for s in slices])


def _check(store: Store, layout: Layout, path: Path, output: Path) -> None:
    """Reads some blocks back as any reader would. Raises SweepError where they differ."""
    import h5py

    last = store.blocks.count - 1
    try:
        with h5py.File(path, "r") as file:
            same = all(_reads_back(store, layout, file, index) for index in {0, last // 2, last})
    except DAMAGE:
        same = False
    if not same:
        raise SweepError(f"{output}: differs when read back from what was written; the disk may be failing")


def _reads_back(store: Store, layout: Layout, file: Any, index: int) -> bool:
    bounds = store.blocks.bounds(index)
    arrays = {c.name: _read_cells(file[c.name], layout, bounds, c) for c in layout.columns}
    return digest(layout.columns, arrays) in store.names[index]


def _read_cells(dataset: Any, layout: Layout, bounds: tuple[int, int], column: Column) -> Any:
    arrays = column.empty(bounds[1] - bounds[0])
    for slices, begin, end in layout.grid.pieces(*bounds):
        arrays[begin:end] = dataset[slices].reshape(end - begin, *column.shape)
    return arrays
