"""A block as the bytes of an HDF5 file.

HDF5 lays out one empty file per block length, once; a part is then the same bytes with its numbers in their places and
its range patched in. So a part costs no HDF5 call (those run one at a time) and no copy of its columns.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sweep.layout import Column

START, STOP = 0x5EED0F0115EA5E01, 0x5EED0F0115EA5E02
"""Marks that HDF5 writes for the attributes start and stop; every part has its own numbers there."""


class Images:
    """Parts of one study as bytes, for any block length.

    Parameters
    ----------
    columns : the columns of a part, in the order of its datasets
    """

    def __init__(self, columns: Sequence[Column]) -> None:
        self._columns = tuple(columns)
        self._frames: dict[int, list[bytes | str]] = {}
        self._lock = threading.Lock()

    def pieces(self, start: int, stop: int, arrays: Mapping[str, Any]) -> list[Any]:
        """What to write one after the other: bytes, and the C-contiguous arrays themselves."""
        with self._lock:
            if stop - start not in self._frames:
                self._frames[stop - start] = _frame(self._columns, stop - start)
        marks = {_mark(START): _mark(start), _mark(STOP): _mark(stop)}
        return [
            arrays[piece] if isinstance(piece, str) else _patched(piece, marks) for piece in self._frames[stop - start]
        ]


def _frame(columns: Sequence[Column], cells: int) -> list[bytes | str]:
    """Bytes between the columns, and in place of each column its name, in the order of the file."""
    image, offsets = _empty_file(columns, cells)
    frame: list[bytes | str] = []
    at = 0
    for column in sorted(columns, key=lambda c: offsets[c.name]):
        frame += [bytes(image[at : offsets[column.name]]), column.name]
        at = offsets[column.name] + cells * column.cell_bytes
    return [*frame, bytes(image[at:])]


def _empty_file(columns: Sequence[Column], cells: int) -> tuple[memoryview, dict[str, int]]:
    import h5py

    # "earliest" writes attributes without checksums, so that they can be patched
    with h5py.File("part", "w", driver="core", backing_store=False, libver="earliest") as file:
        file.attrs["start"], file.attrs["stop"] = np.int64(START), np.int64(STOP)
        for column in columns:
            dataset = file.create_dataset(column.name, (cells, *column.shape), column.dtype, dcpl=unfilled())
            for key in ("units", "long_name", "flag_values", "flag_meanings"):
                if key in column.attrs:
                    dataset.attrs[key] = column.attrs[key]
        offsets = {column.name: file[column.name].id.get_offset() for column in columns}
        file.flush()
        return memoryview(file.id.get_file_image()), offsets


def unfilled() -> Any:
    """Creation properties of a dataset that has its place in the file at once and is not filled by HDF5."""
    from h5py import h5d, h5p

    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5d.FILL_TIME_NEVER)
    return properties


def _mark(number: int) -> bytes:
    return np.int64(number).tobytes()


def _patched(piece: bytes, marks: Mapping[bytes, bytes]) -> bytes:
    for mark, value in marks.items():
        piece = piece.replace(mark, value)
    return piece
