"""Opens results as Datasets, also while the sweep is running, and verifies their checksums."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.cells.fingerprint import fingerprint
from sweep.cells.partition import boxes
from sweep.cells.schema import Schema, cell_schema
from sweep.cells.timing import BLOCK_BYTES
from sweep.errors import SweepError, reason
from sweep.file import disk
from sweep.file.frame import cuts_of
from sweep.file.reading import Damaged, StoredFile, Table
from sweep.file.store import alone, begun, earlier, unfinished_of
from sweep.study.model import Study
from sweep.words import as_path, flag

if TYPE_CHECKING:
    import xarray as xr

MEMORY_SHARE = 0.25
"""Results larger than this share of the memory are opened in pieces (dask)."""
MOST_TOLD = 8
"""Findings of one kind that are reported individually."""


def open_result(path: str | os.PathLike[str], strict: bool = False, *, chunks: Any = None) -> xr.Dataset:
    """Open the result of a sweep, finished or not.

    Cells that are not computed yet are NaN, with status PENDING. Values are read and compared with their checksums when
    they are used; arrays larger than a quarter of the memory are dask arrays.

    Parameters
    ----------
    path : path
        The output of a sweep, finished or not.
    strict : bool
        Raise SweepError if the sweep is not finished.
    chunks : as of `xarray.open_dataset`, optional
        Dask arrays of any size: {} has the chunks of the file, "auto" those that dask chooses.

    Raises
    ------
    SweepError
        There is no result at `path`, or it cannot be read, or it is unfinished and `strict`.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> with sweep.run(sweep.study(ds), "opened.h5") as written, sweep.open_result("opened.h5") as found:
    ...     print(found.period.equals(ds.period), found.period.units)
    True s
    """
    import xarray as xr

    from sweep.file.columns import Result

    strict = flag("strict", strict)
    file: Any = stored(as_path(path))
    if strict and not file.finished:
        left = f"{len(file.missing())} of {file.work.blocks.count} blocks are missing"
        file.close()
        raise SweepError(f"{file.path}: unfinished, {left}; run its sweep again to continue")
    if chunks is None and os.fstat(file.fd).st_size > MEMORY_SHARE * memory():
        chunks = "auto"
    try:
        return xr.open_dataset(file, engine=Result, chunks=chunks)
    except (TypeError, ValueError) as fault:
        file.close()
        raise SweepError(f"{file.path}: cannot be opened with chunks={chunks!r}: {reason(fault)}") from fault


def stored(output: Path) -> StoredFile:
    """The file of a result, finished or not. Raises SweepError."""
    # a sweep that ends meanwhile puts its file in another place
    for place in (output, unfinished_of(output), output):
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            return StoredFile(place)
    raise SweepError(f"{output}: no such file, and no run is writing it")


def in_memory(plan: Schema, arrays: Mapping[str, Any]) -> xr.Dataset:
    """A Dataset of columns of shape `(size, ...)`."""
    import xarray as xr

    variables = {
        c.name: ((*plan.grid, *c.dims), arrays[c.name].reshape((*plan.shape, *c.shape)), dict(c.attrs))
        for c in plan.columns
    }
    coordinates = {c.name: (c.dims, c.values, dict(c.attrs)) for c in plan.coordinates}
    return xr.Dataset(variables, coordinates, dict(plan.attrs))


def store_cells(
    study: Study,
    path: str | os.PathLike[str] | None,
    arrays: Mapping[str, Any],
    force: bool = False,
    mark: Mapping[str, str] | None = None,
    attrs: Mapping[str, str] | None = None,
) -> xr.Dataset:
    """The result of cells that are solved already, in memory or in a file like that of a run. Raises SweepError.

    Their columns are `arrays`, of shape (cells, ...), of outputs and of `schema.ANCILLARY`. `mark` is their
    fingerprint, where that is not the one of the study and of this program; `attrs` are further attributes.
    """
    if path is None:
        return in_memory(cell_schema(study, mark or {}), arrays).assign_attrs(attrs or {})
    output, mark = Path(os.path.realpath(as_path(path))), mark or fingerprint(study)
    schema = cell_schema(study, mark)
    schema = replace(schema, attrs={**schema.attrs, **(attrs or {})})
    blocks = boxes(schema.shape, max(1, BLOCK_BYTES // sum(column.cell_bytes for column in schema.columns)))
    begin = time.monotonic()
    with alone(output), contextlib.ExitStack() as stack:
        disk.check_target(output, force=force)
        if (store := earlier(output, mark, force)) is not None:
            store.close()
        store = stack.enter_context(begun(output, schema, cuts_of(study, schema, blocks)))
        for block in range(blocks.count):
            rows = slice(*blocks.bounds(block))
            store.put(block, {name: column[rows] for name, column in arrays.items()})
        store.finish(math.prod(schema.shape) / max(time.monotonic() - begin, 1e-9))
    return open_result(output)


def memory() -> int:
    """Bytes of memory of this machine."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Verdict:
    """Result of `verify`; its `str` is what `sweep verify` prints.

    Attributes
    ----------
    findings : tuple of str
        Damaged or missing parts, one per line; none if it is intact.
    blocks : tuple of int or None
        Damaged blocks that can be computed again; None if nothing is damaged, or computing would not repair it.
    state : str
        "undamaged", "damaged", or "not complete" if it is unfinished without damage.
    """

    path: Path
    state: str
    checked: str
    findings: tuple[str, ...]
    blocks: tuple[int, ...] | None = None

    @property
    def whole(self) -> bool:
        """Whether it is finished and undamaged."""
        return not self.findings

    def __str__(self) -> str:
        return "\n  ".join([f"{self.path}: {self.state}; {self.checked}", *self.findings])


def verify(path: str | os.PathLike[str]) -> Verdict:
    """Verify all checksums of a result, finished or not.

    All numbers and all metadata are read and compared with their checksums, except for unused bytes of the file.

    Raises
    ------
    SweepError
        There is no result at `path`, or it cannot be read.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> sweep.run(sweep.study(ds), "verified.h5").close()
    >>> sweep.verify("verified.h5").whole
    True
    """
    output = as_path(path)
    try:
        with stored(output) as file:
            return verdict(output, file)
    except Damaged as fault:
        checked = "its structure is damaged, or it is not the result of a sweep"
        return Verdict(output, "damaged", checked, (str(fault),))


def verdict(output: Path, file: StoredFile) -> Verdict:
    """What comparing all digests of an open file says of an output."""
    mendable, work, lost, findings = file.is_as_made(), file.work, set[int](), list[str]()
    if not mendable:
        findings.append("its structure is not as it was made: damaged, or changed by another program")
    # the columns of a summary are made at its end
    for table in dict.fromkeys((work, file.tables["cells"] if file.finished else work)):
        there = range(table.blocks.count) if file.finished else np.flatnonzero(table.done).tolist()
        for name, bad in table.damaged(there).items():
            lost.update(bad if table is work else ())
            findings += _lines(f"{name}: damaged between its cells {{:,}} and {{:,}}", table, bad)
    state = "damaged" if findings else "undamaged" if file.finished else "not complete"
    blocks = tuple(sorted(lost)) if findings and mendable else None
    if file.finished:
        return Verdict(output, state, f"{file.path.stat().st_size:,} bytes checked", tuple(findings), blocks)
    missing = file.missing()
    checked = f"unfinished, {work.blocks.count - len(missing):,} of {work.blocks.count:,} blocks there and checked"
    findings += _lines(f"missing: {work.name} {{:,}} to {{:,}}", work, missing)
    findings = findings or ["all blocks are there, but it has not ended; run the sweep again to finish"]
    return Verdict(output, state, checked, tuple(findings), blocks)


def _lines(text: str, table: Table, blocks: list[int]) -> Iterator[str]:
    """A line for each run of blocks, with its first cell and the last but one; of many, how many there are more."""
    runs = np.split(np.array(blocks, np.int64), np.flatnonzero(np.diff(blocks) > 1) + 1) if blocks else []
    for run in runs[:MOST_TOLD]:
        yield text.format(*table.blocks.bounds(int(run[0]), int(run[-1]) + 1))
    if len(runs) > MOST_TOLD:
        yield f"{text.partition(':')[0]}: {len(runs) - MOST_TOLD:,} more places"
