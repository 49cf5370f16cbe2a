"""One finished block as a file: its name, its digest, and how it is read back.

<start>-<stop>.<digest>.h5
"""

from __future__ import annotations

import itertools
import os
import re
import stat
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import xxhash

from sweep.cells.partition import Partition
from sweep.cells.schema import METHOD_USED, STATUS, Column
from sweep.store.hdf5_bytes import PartBytes
from sweep.system import disk
from sweep.system.errors import SweepError

AT_ONCE = 64
"""Parts that one thread reads before it asks for more."""
READERS = 8
"""Parts read at a time: small files wait for the disk most of the time."""
FLAGS = (STATUS, METHOD_USED)
PART_NAME = re.compile(r"(\d+)-(\d+)\.([0-9a-f]{32})\.h5")


DAMAGE = (OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, RuntimeError)
"""What comes of reading a damaged file."""


def part_name(start: int, stop: int, digest: str) -> str:
    """File name of the cells `start` to `stop`."""
    return f"{start:012d}-{stop:012d}.{digest}.h5"


def digest(columns: Sequence[Column], arrays: Mapping[str, Any], mark: bytes = b"") -> str:
    """32 hex digits of the numbers of a block, and of the mark of the sweep they belong to."""
    state = xxhash.xxh3_128(mark)
    for column in columns:
        state.update(memoryview(arrays[column.name]).cast("B"))
    return state.hexdigest()


def read_part(
    path: Path,
    part_bytes: PartBytes,
    buffers: Mapping[str, Any] | None = None,
    keep: bool = False,
) -> dict[str, Any] | None:
    """The numbers of the block that a file is named by; None where it is damaged, or of another study.

    Parameters
    ----------
    buffers : arrays at least as long as the block, to be filled and returned in part
    keep : leave the file in the system's memory, as it may soon be read again

    Raises
    ------
    FileNotFoundError
    """
    match = PART_NAME.fullmatch(path.name)
    assert match is not None
    start, stop = int(match[1]), int(match[2])
    arrays = _read(path, part_bytes, start, stop, part_bytes.columns, buffers, keep)
    return arrays if arrays is not None and digest(part_bytes.columns, arrays, part_bytes.mark) == match[3] else None


def is_sound(path: Path, part_bytes: PartBytes) -> bool:
    """Whether a part is there and what was written."""
    try:
        return read_part(path, part_bytes) is not None
    except FileNotFoundError:
        return False


def _read(
    path: Path,
    part_bytes: PartBytes,
    start: int,
    stop: int,
    columns: Sequence[Column],
    buffers: Mapping[str, Any] | None = None,
    keep: bool = False,
) -> dict[str, Any] | None:
    """Some columns of a part, whatever its digest."""
    cells = stop - start
    arrays = {c.name: c.empty(cells) if buffers is None else buffers[c.name][:cells] for c in columns}
    try:
        fd = disk.open_file(path, os.O_RDONLY)
        try:
            places = _places(fd, part_bytes, start, stop) or _places_by_hdf5(path, part_bytes.columns, start, stop)
            for column in columns:
                disk.read_into(fd, arrays[column.name], places[column.name])
        finally:
            if not keep:
                disk.forget(fd)
            os.close(fd)
    except FileNotFoundError:
        raise
    except DAMAGE:
        return None
    return arrays


def _places(fd: int, part_bytes: PartBytes, start: int, stop: int) -> Mapping[str, int] | None:
    """Where each column begins, in a file as long as this program writes it; None in any other.

    Raises ValueError where a byte beside the columns differs, or it is no file.
    """
    template, found = part_bytes.template(stop - start), os.fstat(fd)
    if not stat.S_ISREG(found.st_mode):
        raise ValueError("is no regular file")
    if found.st_size != template.size:
        return None
    if any(os.pread(fd, len(piece), at) != piece for at, piece in part_bytes.between(start, stop)):
        raise ValueError("differs from what is written there")
    return template.places


def _places_by_hdf5(path: Path, columns: Sequence[Column], start: int, stop: int) -> dict[str, int]:
    """The same in a file that another version of HDF5 wrote. Raises one of DAMAGE where it is none of ours."""
    import h5py

    places = {}
    with h5py.File(path, "r") as file:
        if (int(file.attrs["start"]), int(file.attrs["stop"])) != (start, stop):
            raise ValueError("holds other cells than its name says")
        for column in columns:
            dataset = file[column.name]
            if dataset.shape != (stop - start, *column.shape) or dataset.dtype != column.dtype:
                raise ValueError(f"{column.name} has another shape or type")
            places[column.name] = dataset.id.get_offset()
    return places


def at_once(read: Callable[[list[Any]], None], items: Sequence[Any]) -> None:
    """Has several threads read, each some of the items at a time."""
    with ThreadPoolExecutor(READERS) as pool:
        list(pool.map(read, (list(items[i : i + AT_ONCE]) for i in range(0, len(items), AT_ONCE))))


class Parts:
    """The parts that are there. Before anything of a part is used its digest is checked, once."""

    def __init__(self, part_bytes: PartBytes, blocks: Partition, folder: Path, names: Mapping[int, str]) -> None:
        self.part_bytes, self.blocks, self.folder, self.names = part_bytes, blocks, folder, dict(names)
        self._sound: set[int] = set()

    def read(self, column: Column, cells: Any) -> Any:
        """A column of the cells of these numbers, in any order; what is missing or damaged is NaN or PENDING."""
        out = np.full((len(cells), *column.shape), column.missing, column.dtype)
        blocks = cells // self.blocks.cells
        cuts = [0, *(np.flatnonzero(np.diff(blocks)) + 1).tolist(), len(cells)]
        some = ((low, high) for low, high in itertools.pairwise(cuts) if low < high)
        pieces = [(low, high) for low, high in some if int(blocks[low]) in self.names]

        def fill(some: list[tuple[int, int]]) -> None:
            for low, high in some:
                index = int(blocks[low])
                found = self._column(index, column)
                if found is not None:
                    out[low:high] = found[cells[low:high] - self.blocks.bounds(index)[0]]

        at_once(fill, pieces)
        return out

    def run(self, column: Column, start: int, stop: int) -> Any:
        """The same of all cells from one number to another, with nothing noted for each of them."""
        out = np.full((stop - start, *column.shape), column.missing, column.dtype)
        blocks = [i for i in range(start // self.blocks.cells, -(-stop // self.blocks.cells)) if i in self.names]

        def fill(some: list[int]) -> None:
            for index in some:
                found, (first, last) = self._column(index, column), self.blocks.bounds(index)
                if found is not None:
                    low, high = max(first, start), min(last, stop)
                    out[low - start : high - start] = found[low - first : high - first]

        at_once(fill, blocks)
        return out

    def _column(self, index: int, column: Column) -> Any:
        start, stop = self.blocks.bounds(index)
        try:
            path = self.folder / self.names[index]
            if index in self._sound:
                found = _read(path, self.part_bytes, start, stop, [column], keep=True)
            else:
                found = read_part(path, self.part_bytes, keep=True)
        except FileNotFoundError:
            raise SweepError(f"{self.folder}: the sweep has ended meanwhile; open its result again") from None
        if found is None:
            self.names.pop(index, None)
            return None
        self._sound.add(index)
        return found[column.name]
