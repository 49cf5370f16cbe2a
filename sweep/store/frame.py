"""A result before its first number: HDF5 lays all of it out, in memory, and where everything stands is read off.

HDF5 writes zeros over each chunk as it allots it. `Sparse`, which it takes for a file, keeps only what is not zero, so
that nothing but the structure takes memory and time. On the disk each chunk of statuses says PENDING, and behind each
other chunk stands a checksum that is wrong, so that nobody takes what is not computed yet for numbers.
"""

from __future__ import annotations

import io
import itertools
import math
import secrets
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xxhash

from sweep.cells.output_schema import part_columns
from sweep.cells.partition import Partition, box_shape, boxes, row_blocks
from sweep.cells.schema import STATUS, Column, Coordinate, Schema
from sweep.store.fletcher import CHECKSUM_BYTES, checksum
from sweep.store.layout import BYTES, Layout, Place, Region, Table, gaps, mark_of
from sweep.system import disk

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
AT_ONCE = 64 << 20
"""Bytes of a file that is written in one piece."""
VERSION = ("v110", "v110")
"""HDF5's format that has a table of chunks of its own for datasets that do not grow."""
GROUP, ROWS = "integrity", "rows"
ENDINGS = {"created": 25, "end": 25, "cells_per_second": 12}
"""Attributes that are texts of this length, known at the end."""
UNKNOWN = {name: (b"nan" if name == "cells_per_second" else b"unfinished").ljust(n) for name, n in ENDINGS.items()}
"""What they say until then."""
WRONG = b"\xff" * CHECKSUM_BYTES
"""A checksum that zeros have not."""


class Sparse(io.RawIOBase):
    """What HDF5 takes for a file: pages in memory of what is not zero."""

    PAGE = 1 << 16

    def __init__(self) -> None:
        super().__init__()
        self.size, self._at = 0, 0
        self._pages: dict[int, bytearray] = {}

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Moves to a place, which may be past the end."""
        if whence != io.SEEK_SET:
            offset += self._at if whence == io.SEEK_CUR else self.size
        self._at = offset
        return offset

    def tell(self) -> int:
        """The place."""
        return self._at

    def truncate(self, size: int | None = None) -> int:
        """Sets the size."""
        self.size = self._at if size is None else size
        return self.size

    def write(self, piece: Any) -> int:
        """Takes all of it."""
        length = len(piece)
        zeros = _is_zero(piece)
        # most of what comes is zeros on new pages
        if not zeros or not self._pages.keys().isdisjoint(self._numbers(self._at, length)):
            self._keep(memoryview(piece).cast("B"), zeros)
        self._at += length
        self.size = max(self.size, self._at)
        return length

    def _keep(self, view: memoryview, zeros: bool) -> None:
        for page, begin, end, at in self._cut(self._at, len(view)):
            if page in self._pages or not zeros:
                self._pages.setdefault(page, bytearray(self.PAGE))[begin:end] = view[at : at + end - begin]

    def _numbers(self, start: int, length: int) -> range:
        return range(start // self.PAGE, (start + length - 1) // self.PAGE + 1)

    def readinto(self, buffer: Any) -> int:
        """Fills all of it; what was never written is zero."""
        view = memoryview(buffer).cast("B")
        view[:] = self.piece(self._at, self._at + len(view))
        self._at += len(view)
        return len(view)

    def piece(self, start: int, stop: int) -> bytes:
        """The bytes from one place to another."""
        found = bytearray(stop - start)
        for page, begin, end, at in self._cut(start, stop - start):
            if page in self._pages:
                found[at : at + end - begin] = self._pages[page][begin:end]
        return bytes(found)

    def pages(self) -> Iterator[tuple[int, bytes]]:
        """All that is not zero: where it stands, and its bytes."""
        for page, content in sorted(self._pages.items()):
            at = page * self.PAGE
            yield at, bytes(content[: self.size - at])

    def is_zero(self, start: int, stop: int) -> bool:
        """Whether there are zeros alone from one place to another."""
        cut = self._cut(start, stop - start)
        return not any(page in self._pages and any(self._pages[page][begin:end]) for page, begin, end, _ in cut)

    def _cut(self, start: int, length: int) -> Iterator[tuple[int, int, int, int]]:
        """Number of each page, begin and end in it, and the place among the `length` bytes."""
        done = 0
        while done < length:
            page, begin = divmod(start + done, self.PAGE)
            end = min(self.PAGE, begin + length - done)
            yield page, begin, end, done
            done += end - begin

    def readable(self) -> bool:
        """Yes."""
        return True

    def writable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True


def _is_zero(piece: Any) -> bool:
    length = len(piece)
    return bytes(piece) == bytes(length) if length <= PAGE else not np.frombuffer(piece, np.uint8).any()


@dataclass(frozen=True)
class Cut:
    """Columns, the grid in which their cells stand, and how it is cut."""

    columns: tuple[Column, ...]
    grid: tuple[int, ...]
    blocks: Partition


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
    groups = boxes(schema.grid.shape, max(1, GATHERED_BYTES // (row_bytes * rows.per_group)))
    return {"rows": Cut(columns, (rows.count,), blocks), "cells": Cut(schema.columns, schema.grid.shape, groups)}


def expected_size(schema: Schema, cuts: Mapping[str, Cut]) -> int:
    """Bytes that a result will take, but for some thousands; a `Frame` knows them all."""
    texts = sum(len(str(text)) for text in schema.attrs.values())
    coordinates = sum(np.asarray(coordinate.values).nbytes for coordinate in schema.coordinates)
    return NAMES + texts + coordinates + sum(_expected(cut) for cut in cuts.values())


def _expected(cut: Cut) -> int:
    cells = math.prod(box_shape(cut.grid, cut.blocks.cells))
    chunks = np.array([cells * column.cell_bytes for column in cut.columns]) + CHECKSUM_BYTES
    chunks = np.where(chunks >= WORTH_A_PAGE, -(-chunks // PAGE) * PAGE, chunks)
    return cut.blocks.count * int((chunks + CHUNK_ENTRY + BYTES).sum())


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
        self._sparse, self._cuts = Sparse(), cuts
        texts = {name: secrets.token_hex(length)[:length] for name, length in ENDINGS.items()}
        attrs = {**schema.attrs, "start": begun, **texts}
        _write_structure(self._sparse, replace(schema, attrs=attrs), cuts, shared)
        self.layout = self._found(fingerprint, begun, texts)

    def write(self, fd: int) -> None:
        """Writes it all to an empty file, which has its place on the disk then. Raises OSError."""
        size = self.layout.size
        disk.reserve(fd, size)
        if size > AT_ONCE:
            for at, piece in self._pieces():
                disk.write_all(fd, (piece,), at)
            return
        whole = bytearray(size)
        for at, piece in self._pieces():
            whole[at : at + len(piece)] = piece
        disk.write_all(fd, (whole,), 0)

    def _pieces(self) -> Iterator[tuple[int, bytes]]:
        yield from self._sparse.pages()
        for name, table in self.layout.tables.items():
            for column, place in zip(self._cuts[name].columns, table.places, strict=True):
                yield from _nothing_yet(column, place, table.blocks.count)
        yield self.layout.end, self.layout.trailer()

    def _found(self, fingerprint: Mapping[str, str], begun: str, texts: Mapping[str, str]) -> Layout:
        import h5py

        with h5py.File(self._sparse, "r") as file:
            tables = {name: _table(file, name, cut, mark_of(fingerprint, name)) for name, cut in self._cuts.items()}
            ending = file[GROUP]["ending"].id.get_offset()
        image = b"".join(piece.ljust(Sparse.PAGE, b"\0") for _, piece in self._sparse.pages())
        where = [at for at, _ in self._sparse.pages()]
        endings = []
        for name, text in texts.items():
            page, skip = divmod(image.index(text.encode()), Sparse.PAGE)
            endings.append((where[page] + skip, where[page] + skip + len(text)))
            self._sparse.seek(endings[-1][0])
            self._sparse.write(UNKNOWN[name])
        endings.append((ending, ending + BYTES))
        regions = _regions(self._sparse, np.concatenate([table.spans() for table in tables.values()]))
        structure = xxhash.xxh3_128()
        for begin, end in gaps([*regions, *endings], self._sparse.size):
            structure.update(self._sparse.piece(begin, end))
        return Layout(
            secrets.token_hex(BYTES), dict(fingerprint), begun, tables, tuple(endings), regions, structure.digest(),
            self._sparse.size,
        )  # fmt: skip


def _regions(sparse: Sparse, spans: Any) -> tuple[Region, ...]:
    """Chunks and digests that have zeros alone between them, together."""
    spans = spans[np.argsort(spans[:, 0], kind="stable")]
    apart = np.flatnonzero(spans[1:, 0] != spans[:-1, 1]) + 1
    found: list[list[int]] = []
    for first, last in itertools.pairwise((0, *apart.tolist(), len(spans))):
        begin, end = int(spans[first, 0]), int(spans[last - 1, 1])
        if found and sparse.is_zero(found[-1][1], begin):
            found[-1][1] = end
        else:
            found.append([begin, end])
    return tuple((begin, end) for begin, end in found)


def _table(file: Any, name: str, cut: Cut, mark: bytes) -> Table:
    group = file if name == "cells" else file[name]
    places = tuple(_place(group[column.name], column) for column in cut.columns)
    return Table(cut.grid, cut.blocks, places, file[GROUP][f"{name}_digests"].id.get_offset(), mark)


def _place(dataset: Any, column: Column) -> Place:
    if dataset.chunks is None:
        return Place(column.name, column.dtype, column.shape, 0, ((0, dataset.id.get_offset(), 0),))
    found: list[tuple[int, ...]] = []
    dataset.id.chunk_iter(lambda chunk: found.append((*chunk.chunk_offset, chunk.byte_offset)))
    places = [at for *_, at in sorted(found)]
    chunk_bytes = int(np.prod(dataset.chunks, dtype=np.int64)) * dataset.dtype.itemsize
    return Place(column.name, column.dtype, column.shape, chunk_bytes, tuple(_runs(places)))


def _runs(places: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """The places as (number of the first, place, step) of those that follow each other evenly."""
    first, steps = 0, np.diff(np.array(places, np.int64))
    for change in (np.flatnonzero(np.diff(steps)) + 1).tolist():
        if change > first:
            yield first, places[first], int(steps[first])
            first = change + 1
    yield first, places[first], int(steps[first]) if first < len(steps) else 0


def _nothing_yet(column: Column, place: Place, count: int) -> Iterator[tuple[int, bytes]]:
    """What stands in the chunks before they are computed, and where; short ones behind each other are one piece."""
    skip, piece = _pending(column, place)
    whole = bytes(skip) + piece
    ends = [*(first for first, _, _ in place.runs[1:]), count]
    for (first, at, step), end in zip(place.runs, ends, strict=True):
        chunks = end - first
        if step == len(whole) < PAGE:
            batch = GATHERED_BYTES // step
            yield from ((at + k * step, whole * min(batch, chunks - k)) for k in range(0, chunks, batch))
        else:
            yield from ((at + k * step + skip, piece) for k in range(chunks))


def _pending(column: Column, place: Place) -> tuple[int, bytes]:
    """What stands in a chunk that is not computed yet, and how far behind its beginning."""
    if not place.chunk_bytes:
        return 0, np.full(place.shape, _nothing(column), place.dtype).tobytes()
    if column.name != STATUS:
        return place.chunk_bytes, WRONG
    words = np.full(place.chunk_bytes, column.missing, "i1")
    return 0, words.tobytes() + checksum(words, place.chunk_bytes)


def _nothing(column: Column) -> float | int:
    return np.nan if np.dtype(column.dtype).kind == "f" else -1


def _write_structure(sparse: Sparse, schema: Schema, cuts: Mapping[str, Cut], shared: bool) -> None:
    import h5netcdf

    worth = SHARED_WORTH_A_PAGE if shared else WORTH_A_PAGE
    keys = {"libver": VERSION, "alignment_threshold": worth, "alignment_interval": PAGE}
    with h5netcdf.File(sparse, "w", **keys) as file:
        coordinates = [c.name for c in schema.coordinates if c.dims and not set(c.dims) & {c.name, *schema.grid.dims}]
        # xarray's way to mark what belongs to the coordinates of all variables
        file.attrs.update({**schema.attrs, **({"coordinates": " ".join(coordinates)} if coordinates else {})})
        file.dimensions = schema.sizes
        for coordinate in schema.coordinates:
            _write_coordinate(file, coordinate)
        _write_digests(file, cuts)
        for column in schema.columns:
            away = " ".join(_auxiliary(schema, column))
            variable = _declare(file, (*schema.grid.dims, *column.dims), column, cuts["cells"])
            variable.attrs.update({**column.attrs, **({"coordinates": away} if away else {})})
        if ROWS in cuts:
            _write_rows(file.create_group(ROWS), cuts[ROWS])


def _write_digests(file: Any, cuts: Mapping[str, Cut]) -> None:
    group = file.create_group(GROUP)
    columns = {f"{name}_column": len(cut.columns) for name, cut in cuts.items()}
    group.dimensions = {**{f"{name}_block": cut.blocks.count for name, cut in cuts.items()}, **columns, "byte": BYTES}
    for name in cuts:
        digests = group.create_variable(
            f"{name}_digests", (f"{name}_block", f"{name}_column", "byte"), "u1", dcpl=_properties()
        )
        digests.attrs["long_name"] = "xxh3_128 of each chunk of each column, zeros where it is not computed yet"
    ending = group.create_variable("ending", ("byte",), "u1", dcpl=_properties())
    ending.attrs["long_name"] = "xxh3_128 of the times of the run, zeros until it has ended"


def _write_rows(group: Any, cut: Cut) -> None:
    """Of a summary, what its columns are made of."""
    lengths = {f"{c.name} {k}": n for c in cut.columns for k, n in enumerate(c.shape)}
    group.dimensions = {"row": cut.blocks.size, **lengths}
    for column in cut.columns:
        _declare(group, ("row", *(f"{column.name} {k}" for k in range(len(column.shape)))), column, cut)


def _declare(group: Any, dims: tuple[str, ...], column: Column, cut: Cut) -> Any:
    if not dims:
        # h5py does not heed the properties of a single number; written, it has its place
        return group.create_variable(column.name, (), column.dtype, data=np.array(_nothing(column), column.dtype))
    chunks = (*box_shape(cut.grid, cut.blocks.cells), *column.shape)
    return group.create_variable(column.name, dims, column.dtype, dcpl=_properties(chunks))


def _properties(chunks: tuple[int, ...] | None = None) -> Any:
    """Creation properties of a dataset that has its place in the file at once and is not filled by HDF5."""
    from h5py import h5d, h5p

    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5d.FILL_TIME_NEVER)
    if chunks is not None:
        properties.set_chunk(chunks)
        properties.set_fletcher32()
    return properties


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
