"""The end of a result: the columns of a summary are made, the times of the run written, and some of it read back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sweep.cells.partition import box_slices
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.frame import ENDINGS, UNKNOWN
from sweep.file.layout import BYTES, DAMAGE, Layout, write_digests
from sweep.file.reading import StoredFile, damaged

Gather = Callable[[StoredFile, int], Mapping[str, Any]]
"""Makes a block of the output of a summary from its rows."""


def gathered(path: Path, fd: int, layout: Layout, gather: Gather) -> list[int]:
    """Writes the columns of a summary; gives the blocks of rows that turned out to be damaged, where some did."""
    table, digests = layout.tables["cells"], {}
    with StoredFile(path) as file:
        found = sorted({block for block, _ in damaged(file, "rows", range(layout.work.blocks.count))})
        if found:
            return found
        for block in range(table.blocks.count):
            digests[block] = table.write(fd, block, gather(file, block))
    disk.sync_numbers(fd)
    write_digests(fd, table, digests)
    return []


def end(fd: int, layout: Layout, texts: Mapping[str, str] | None) -> None:
    """Writes what is known at the end; None: takes back that the run has ended. Raises OSError."""
    if texts is None:
        pieces = [*(UNKNOWN[name] for name in ENDINGS), bytes(BYTES)]
    else:
        pieces = [texts[name].encode().ljust(length)[:length] for name, length in ENDINGS.items()]
        pieces.append(layout.ending_digest(pieces))
    for piece, (begin, _) in zip(pieces, layout.endings, strict=True):
        disk.write_all(fd, (piece,), begin)


def reads_back(path: Path) -> bool:
    """Whether a result has ended, and HDF5 finds the numbers in some blocks that their digests tell of.

    Raises OSError where the system refuses to read.
    """
    try:
        with StoredFile(path) as file:
            last = file.layout.tables["cells"].blocks.count - 1
            return file.finished and all(_is_same(file, block) for block in {0, last // 2, last})
    except (*DAMAGE, SweepError) as fault:
        if getattr(fault, "errno", None):
            raise
        return False


def _is_same(file: StoredFile, block: int) -> bool:
    import h5py

    table = file.layout.tables["cells"]
    start, stop = table.blocks.bounds(block)
    box = box_slices(table.grid, start, stop)
    with h5py.File(file.path, "r") as other:
        columns = file.columns().items()
        return all(np.asarray(other[name][box]).tobytes() == c.run(start, stop).tobytes() for name, c in columns)
