"""The structure of a result, as HDF5 writes it, in memory: names, attributes, coordinates, and columns without numbers.

Of a column in several chunks HDF5 is shown one byte, for which it makes the table of its chunks; those have no place
yet. What is one chunk, or no array, has its place.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sweep.cells.partition import Partition, box_shape
from sweep.cells.schema import Column, Coordinate, Schema
from sweep.file.chunk_index import FILE_END
from sweep.file.fletcher import CHECKSUM_BYTES
from sweep.file.layout import BYTES

VERSION = ("v110", "v110")
"""HDF5's format that has a table of chunks of its own for datasets that do not grow."""
GROUP, ROWS = "integrity", "rows"
ENDING = f"{GROUP}/ending"


@dataclass(frozen=True)
class Cut:
    """Columns, the grid in which their cells stand, and how it is cut."""

    columns: tuple[Column, ...]
    grid: tuple[int, ...]
    blocks: Partition

    @property
    def chunk(self) -> tuple[int, ...]:
        """Lengths of a chunk."""
        return box_shape(self.grid, self.blocks.cells)

    def chunk_bytes(self, column: Column) -> int:
        """Bytes of the chunks of a column; 0 where it is a single number."""
        return math.prod(self.chunk) * column.cell_bytes if self.grid or column.shape else 0


def laid_out(schema: Schema, cuts: Mapping[str, Cut]) -> tuple[bytearray, dict[str, int]]:
    """The file as far as its structure goes, and where each dataset of numbers or digests, or its byte, is in it."""
    import h5py

    image = io.BytesIO()
    _write_structure(image, schema, cuts)
    _fill_up(image)
    names = [ENDING, *map(digests_of, cuts), *(column_of(name, c) for name, cut in cuts.items() for c in cut.columns)]
    with h5py.File(image, "r+", libver=VERSION) as file:
        places = {name: _placed(file[name]) for name in names}
    _fill_up(image)
    return bytearray(image.getbuffer()), places


def digests_of(table: str) -> str:
    """Name in HDF5 of the digests of a table."""
    return f"{GROUP}/{table}_digests"


def column_of(table: str, column: Column) -> str:
    """Name in HDF5 of a column."""
    return column.name if table != ROWS else f"{ROWS}/{column.name}"


def _fill_up(image: io.BytesIO) -> None:
    """Gives the file the length that its superblock tells."""
    image.write(bytes(int.from_bytes(image.getbuffer()[FILE_END], "little") - image.seek(0, io.SEEK_END)))


def _placed(dataset: Any) -> int:
    if dataset.chunks is None:
        return int(dataset.id.get_offset())
    whole = dataset.chunks == dataset.shape
    size = dataset.size * dataset.dtype.itemsize + CHECKSUM_BYTES if whole else 1
    dataset.id.write_direct_chunk((0,) * dataset.ndim, bytes(size))
    return int(dataset.id.get_chunk_info(0).byte_offset)


def _write_structure(image: io.BytesIO, schema: Schema, cuts: Mapping[str, Cut]) -> None:
    import h5netcdf

    with h5netcdf.File(image, "w", libver=VERSION) as file:
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
        dims = (f"{name}_block", f"{name}_column", "byte")
        digests = group.create_variable(f"{name}_digests", dims, "u1", dcpl=_properties())
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
        return group.create_variable(column.name, (), column.dtype, data=np.array(0, column.dtype))
    return group.create_variable(column.name, dims, column.dtype, dcpl=_properties((*cut.chunk, *column.shape)))


def _properties(chunks: tuple[int, ...] | None = None) -> Any:
    """Creation properties of a dataset that is not filled by HDF5; it has its place at once, or is in chunks."""
    from h5py import h5d, h5p

    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_fill_time(h5d.FILL_TIME_NEVER)
    if chunks is None:
        properties.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    else:
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
