"""A result before its first number: where everything will stand, and what stands there until it is computed.

HDF5 writes the structure in memory (`structure`); chunks come behind it, column by column, and are entered in HDF5's
tables (`chunk_index`). On the disk each chunk of statuses says PENDING, and behind each other chunk stands a checksum
that is wrong, so that nobody takes what is not computed yet for numbers.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import xxhash

from kernels.interface import Status
from sweep.cells.output_schema import part_columns
from sweep.cells.partition import Partition, boxes, row_blocks
from sweep.cells.schema import STATUS, Column, Schema
from sweep.file import disk
from sweep.file.chunk_index import chunk_indexes, seal, set_end
from sweep.file.fletcher import CHECKSUM_BYTES, checksum
from sweep.file.layout import BYTES, Layout, Place, Region, Table, gaps, mark_of
from sweep.file.structure import ENDING, ROWS, Cut, column_of, digests_of, laid_out

if TYPE_CHECKING:
    from sweep.study.model import Study

PAGE = 4096
WORTH_A_PAGE = 10 * PAGE
"""Chunks of so many bytes begin on a page of their own, at a cost of a tenth at most;"""
SHARED_WORTH_A_PAGE = PAGE
"""so do shorter ones, where several machines write."""
GATHERED_BYTES = 8 << 20
"""Bytes of the rows that are reduced to groups at a time."""
CHUNK_ENTRY = 16
"""Bytes that tell where a chunk is;"""
NAMES = 32 << 10
"""and those of all names and dimensions, about."""
ENDINGS = {"created": 25, "end": 25, "cells_per_second": 12}
"""Attributes that are texts of this length, known at the end."""
UNKNOWN = {name: (b"nan" if name == "cells_per_second" else b"unfinished").ljust(n) for name, n in ENDINGS.items()}
"""What they say until then."""
WRONG = b"\xff" * CHECKSUM_BYTES
"""A checksum that zeros have not."""


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
    groups = boxes(schema.grid.shape, GATHERED_BYTES // (row_bytes * rows.per_group))
    return {ROWS: Cut(columns, (rows.count,), blocks), "cells": Cut(schema.columns, schema.grid.shape, groups)}


def expected_size(schema: Schema, cuts: Mapping[str, Cut]) -> int:
    """Bytes that a result will take, but for some thousands; a `Frame` knows them all."""
    texts = sum(len(str(text)) for text in schema.attrs.values())
    coordinates = sum(np.asarray(coordinate.values).nbytes for coordinate in schema.coordinates)
    return NAMES + texts + coordinates + sum(_expected(cut) for cut in cuts.values())


def _expected(cut: Cut) -> int:
    return cut.blocks.count * sum(_step(cut.chunk_bytes(c), WORTH_A_PAGE) + CHUNK_ENTRY + BYTES for c in cut.columns)


def _step(chunk_bytes: int, worth: int) -> int:
    """Bytes from a chunk to the next one, where those of so many bytes are `worth` a page."""
    stored = chunk_bytes + CHECKSUM_BYTES
    return _paged(stored) if stored >= worth else stored


def _paged(size: int) -> int:
    return -(-size // PAGE) * PAGE


class Frame:
    """A result of which nothing is computed yet.

    Parameters
    ----------
    schema : Schema
        Of the output.
    cuts : mapping of str to Cut
        "cells": the output's columns; of a summary also "rows".
    fingerprint : mapping of str to str
    begun : str
        The time.
    shared : bool
        Whether several machines may write.

    Attributes
    ----------
    layout : Layout
    """

    def __init__(
        self, schema: Schema, cuts: Mapping[str, Cut], fingerprint: Mapping[str, str], begun: str, shared: bool = False
    ) -> None:
        texts = {name: secrets.token_hex(length)[:length] for name, length in ENDINGS.items()}
        self._image, self._at = laid_out(replace(schema, attrs={**schema.attrs, "start": begun, **texts}), cuts)
        self._cuts, self._worth = cuts, SHARED_WORTH_A_PAGE if shared else WORTH_A_PAGE
        self._image += bytes(_paged(len(self._image)) - len(self._image))
        endings = [*(self._unknown(name, text) for name, text in texts.items()), self._span(ENDING)]
        tables = self._tables(fingerprint)
        regions = self._regions(tables.values())
        structure = xxhash.xxh3_128()
        for begin, stop in gaps([*regions, *endings], len(self._image)):
            structure.update(self._image[begin:stop])
        self.layout = Layout(
            secrets.token_hex(BYTES), dict(fingerprint), begun, tables, tuple(endings), regions, structure.digest(),
            self._end,
        )  # fmt: skip

    def write(self, fd: int) -> None:
        """Writes it all to an empty file, which has its place on the disk then. Raises OSError."""
        disk.reserve(fd, self.layout.size)
        disk.write_all(fd, (self._image,), 0)
        for name, table in self.layout.tables.items():
            for column, place in zip(self._cuts[name].columns, table.places, strict=True):
                for at, piece in _nothing_yet(column, place, table.blocks.count):
                    disk.write_all(fd, (piece,), at)
        disk.write_all(fd, (self.layout.trailer(),), self.layout.end)

    def _span(self, name: str) -> Region:
        return self._at[name], self._at[name] + BYTES

    def _unknown(self, name: str, text: str) -> Region:
        """Where a text is that is known at the end; until then it says so."""
        at = self._image.index(text.encode())
        self._image[at : at + len(text)] = UNKNOWN[name]
        return at, at + len(text)

    def _tables(self, fingerprint: Mapping[str, str]) -> dict[str, Table]:
        """Gives each chunk its place, of which HDF5 is told."""
        self._end, self._spans = len(self._image), list[Region]()
        self._indexes = {index.first(self._image): index for index in chunk_indexes(self._image)}
        found = {}
        for name, cut in self._cuts.items():
            places = tuple(self._place(cut, column, self._at[column_of(name, column)]) for column in cut.columns)
            digests = self._at[digests_of(name)]
            found[name] = Table(cut.grid, cut.blocks, places, digests, mark_of(fingerprint, name))
        seal(self._image, [*self._spans, *set_end(self._image, self._end)])
        return found

    def _place(self, cut: Cut, column: Column, at: int) -> Place:
        size, step = cut.chunk_bytes(column), 0
        if cut.blocks.count > 1:
            index, at, step = self._indexes[at], _paged(self._end), _step(size, self._worth)
            self._spans += index.fill(self._image, at, step, size + CHECKSUM_BYTES)
            self._end = at + step * (cut.blocks.count - 1) + size + CHECKSUM_BYTES
        return Place(column.name, column.dtype, column.shape, size, ((0, at, step),))

    def _regions(self, tables: Iterable[Table]) -> tuple[Region, ...]:
        """Chunks and digests within the structure, and what comes behind it."""
        spans = np.concatenate([table.spans() for table in tables])
        inside = sorted(spans[spans[:, 0] < len(self._image)].tolist())
        return *((begin, end) for begin, end in inside), (len(self._image), self._end)


def _nothing_yet(column: Column, place: Place, count: int) -> Iterator[tuple[int, bytes]]:
    """What stands in the chunks before they are computed, and where; short ones behind each other are one piece."""
    skip, piece = _pending(column, place)
    ((_, at, step),) = place.runs
    whole = bytes(skip) + piece
    if step == len(whole) < PAGE:
        batch = GATHERED_BYTES // step
        yield from ((at + k * step, whole * min(batch, count - k)) for k in range(0, count, batch))
    else:
        yield from ((at + k * step + skip, piece) for k in range(count))


def _pending(column: Column, place: Place) -> tuple[int, bytes]:
    """What stands in a chunk that is not computed yet, and how far behind its beginning."""
    if not place.chunk_bytes:
        return 0, np.array(np.nan if np.dtype(place.dtype).kind == "f" else -1, place.dtype).tobytes()
    if column.name != STATUS:
        return place.chunk_bytes, WRONG
    words = np.full(place.chunk_bytes, Status.PENDING, "i1")
    return 0, words.tobytes() + checksum(words, place.chunk_bytes)
