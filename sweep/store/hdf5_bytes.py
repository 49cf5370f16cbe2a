"""A block as the bytes of an HDF5 file.

HDF5 lays out one empty file per block length, once; a part is then the same bytes with its numbers in their places and
its range patched in. So a part costs no HDF5 call (those run one at a time) and no copy of its columns.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sweep.cells.schema import Column
from sweep.store.canvas import Canvas

START, STOP = 0x5EED0F0115EA5E01, 0x5EED0F0115EA5E02
"""Marks that HDF5 writes for the attributes start and stop; every part has its own numbers there."""


@dataclass(frozen=True)
class Frame:
    """An HDF5 file without the numbers of its columns.

    Attributes
    ----------
    pieces : the bytes between the columns, and in place of each column its name, in the order of the file
    places : where each column begins
    size : bytes of the file
    """

    pieces: tuple[bytes | str, ...]
    places: Mapping[str, int]
    size: int


class Images:
    """Parts of one study as bytes, for any block length.

    Parameters
    ----------
    columns : the columns of a part, in the order of its datasets
    mark : what the digests of the parts begin with
    """

    def __init__(self, columns: Sequence[Column], mark: bytes = b"") -> None:
        self.columns, self.mark = tuple(columns), mark
        self._frames: dict[int, Frame] = {}
        self._lock = threading.Lock()

    def frame(self, cells: int) -> Frame:
        """The frame of blocks of that length."""
        with self._lock:
            if cells not in self._frames:
                self._frames[cells] = _frame(self.columns, cells)
            return self._frames[cells]

    def pieces(self, start: int, stop: int, arrays: Mapping[str, Any]) -> list[Any]:
        """What to write one after the other: bytes, and the C-contiguous arrays themselves."""
        frame = self.frame(stop - start)
        return [arrays[p] if isinstance(p, str) else _patched(p, start, stop) for p in frame.pieces]

    def between(self, start: int, stop: int) -> Iterator[tuple[int, bytes]]:
        """All bytes of a part that are no column's: where they begin, and what they are."""
        frame, at = self.frame(stop - start), 0
        widths = {column.name: column.cell_bytes for column in self.columns}
        for piece in frame.pieces:
            if isinstance(piece, bytes):
                yield at, _patched(piece, start, stop)
            at += (stop - start) * widths[piece] if isinstance(piece, str) else len(piece)


def _frame(columns: Sequence[Column], cells: int) -> Frame:
    canvas, places = _empty_file(columns, cells)
    pieces: list[bytes | str] = []
    at = 0
    for column in sorted(columns, key=lambda c: places[c.name]):
        pieces += [canvas.piece(at, places[column.name]), column.name]
        at = places[column.name] + cells * column.cell_bytes
    return Frame((*pieces, canvas.piece(at, canvas.size)), places, canvas.size)


def _empty_file(columns: Sequence[Column], cells: int) -> tuple[Canvas, dict[str, int]]:
    import h5py

    canvas = Canvas()
    # "earliest" writes attributes without checksums, so that they can be patched
    with h5py.File(canvas, "w", libver="earliest") as file:
        file.attrs["start"], file.attrs["stop"] = np.int64(START), np.int64(STOP)
        for column in columns:
            dataset = file.create_dataset(column.name, (cells, *column.shape), column.dtype, dcpl=unfilled())
            for key in ("units", "long_name", "flag_values", "flag_meanings"):
                if key in column.attrs:
                    dataset.attrs[key] = column.attrs[key]
        return canvas, {column.name: file[column.name].id.get_offset() for column in columns}


def unfilled() -> Any:
    """Creation properties of a dataset that has its place in the file at once and is not filled by HDF5."""
    from h5py import h5d, h5p

    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5d.FILL_TIME_NEVER)
    return properties


def _patched(piece: bytes, start: int, stop: int) -> bytes:
    return piece.replace(_mark(START), _mark(start)).replace(_mark(STOP), _mark(stop))


def _mark(number: int) -> bytes:
    return np.int64(number).tobytes()
