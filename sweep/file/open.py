"""Results as xarray Datasets: of a finished sweep, or of one that still runs."""

from __future__ import annotations

import contextlib
import errno
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sweep.cells.output_schema import gathered, output_schema
from sweep.cells.partition import row_blocks
from sweep.cells.reduce import BY_STATUS, pending
from sweep.cells.schema import STATUS, Schema
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.frame import ENDINGS
from sweep.file.layout import DAMAGE
from sweep.file.probe import MOST_AT_ONCE, check_own, intact, readable
from sweep.file.reading import StoredFile, unbroken
from sweep.file.store import unfinished_of
from sweep.study.model import Study
from sweep.words import as_path

if TYPE_CHECKING:
    import xarray as xr

OF_DAMAGE = (errno.EINVAL, errno.EOVERFLOW)
"""What the system says where a damaged file sends one to a place that cannot be."""
MOST_COMPRESSED = 1100
"""Bytes that gzip makes of one, at most."""
MEMORY_SHARE = 0.25
"""Results larger than this share of the memory are opened in pieces (dask)."""
TEXTS = (
    *("title", "question", "kernel", "design", "where", "method", "study", "study_json", "fingerprint", "versions"),
    *("start", "created", "end", "over", "units", "long_name", "flag_meanings"),
)
"""Attributes that are text wherever they stand."""
BESIDE = "damaged beside the outputs' numbers: in attributes, coordinates or its structure"


def open_result(path: str | os.PathLike[str], strict: bool = False) -> xr.Dataset:
    """The result of a sweep, finished or not.

    Cells that are not computed yet are NaN, with status PENDING. Values are read when they are used, and compared with
    their digests; what is larger than a quarter of the memory comes as dask arrays.

    Parameters
    ----------
    path : path
        The output of a sweep, also while it is not finished.
    strict : bool
        Refuse a sweep that is not finished.

    Raises
    ------
    SweepError
        There is no result, or it cannot be read, or it is unfinished and `strict`; `path` is no path.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> with sweep.run(sweep.study(ds), "opened.h5") as written, sweep.open_result("opened.h5") as found:
    ...     print(found.period.equals(ds.period), found.period.units)
    True s
    """
    output = as_path(path)
    while True:
        place = output if output.exists() else unfinished_of(output)
        before = _identity(place)
        if before is None:
            raise SweepError(f"{output}: no such file, and no sweep that writes it")
        try:
            return _open(output) if place == output else open_unfinished(output, strict)
        except (SweepError, FileNotFoundError):
            # a sweep that ends, or begins anew, puts another file there meanwhile
            if _identity(place) == before:
                raise


def _identity(path: Path) -> tuple[int, int] | None:
    """Which file has a name at this moment; None: none has."""
    try:
        found = path.stat()
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return None
    return found.st_dev, found.st_ino


def open_unfinished(path: str | os.PathLike[str], strict: bool = False) -> xr.Dataset:
    """What there is of an unfinished sweep, also where its output holds an earlier result.

    Raises SweepError, FileNotFoundError.
    """
    output = unfinished_of(Path(path))
    check_structure(output)
    with _stored(output) as file:
        left, count = int((~file.done(file.layout.work_name)).sum()), file.layout.work.blocks.count
    if strict:
        missing = f"{left} of {count} blocks are missing" if left else "all is computed but not checked yet"
        raise SweepError(f"{path}: unfinished, {missing}; run its sweep again to continue")
    return _open(output)


def in_memory(plan: Schema, arrays: Mapping[str, Any]) -> xr.Dataset:
    """A Dataset of columns of shape `(size, ...)`."""
    import xarray as xr

    variables = {
        c.name: ((*plan.grid.dims, *c.dims), arrays[c.name].reshape(plan.shape(c)), dict(c.attrs)) for c in plan.columns
    }
    coordinates = {c.name: (c.dims, c.values, dict(c.attrs)) for c in plan.coordinates}
    return xr.Dataset(variables, coordinates, dict(plan.attrs))


def stored_attrs(output: Path) -> dict[str, Any]:
    """Attributes of a result; "fingerprint" as a mapping.

    Raises
    ------
    SweepError
        The file cannot be read, or is none of ours.
    """
    import h5py

    try:
        if not output.is_file():
            raise ValueError("it is no regular file")
        fd = disk.open_file(output, os.O_RDONLY)
        try:
            if not readable(output, fd):
                raise ValueError("HDF5 cannot read it")
        finally:
            os.close(fd)
        with h5py.File(output, "r") as file:
            check_own(file)
            attrs = dict(file.attrs)
            attrs["study_json"], file[STATUS if STATUS in file else BY_STATUS]
            if any(not _can_be(file, name, output.stat().st_size) for name in file):
                raise ValueError("more numbers than the file has room for")
        return attrs | {"fingerprint": dict(json.loads(attrs["fingerprint"]))}
    except DAMAGE as fault:
        raise unreadable(output, fault) from None


def stored_fingerprint(output: Path) -> dict[str, str]:
    """Fingerprint of a finished result. Raises SweepError."""
    found: dict[str, str] = stored_attrs(output)["fingerprint"]
    return found


def _can_be(file: Any, name: str, size: int) -> bool:
    """Whether the file has room for a dataset."""
    numbers = getattr(file[name], "nbytes", 0)
    return bool(numbers <= size * (MOST_COMPRESSED if file[name].compression else 1)) if numbers else True


def memory() -> int:
    """Bytes of memory of this machine."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 8 << 30


def _open(output: Path) -> xr.Dataset:
    """A file, whether it is finished or not. Raises SweepError, FileNotFoundError."""
    from sweep.file.columns import open_checked

    check_structure(output)
    attrs = stored_attrs(output)
    large = output.stat().st_size > MEMORY_SHARE * memory()
    try:
        found = open_checked(output, "auto" if large else None)
        _check_kinds(found)
        if found.attrs.get("end") == "unfinished".ljust(ENDINGS["end"]):
            return _of_unfinished(output, found, attrs)
        return _with_plain_text(found)
    except DAMAGE as fault:
        raise unreadable(output, fault) from None


def _check_kinds(dataset: xr.Dataset) -> None:
    """Raises one of DAMAGE where text or numbers are something else; what does not say its type was changed."""
    for attrs in (dataset.attrs, *(v.attrs for v in dataset.variables.values())):
        if not all(isinstance(attrs[name], str) for name in TEXTS if name in attrs):
            raise TypeError("an attribute is no text")
        for text in attrs.values():
            str(text).encode()  # bytes that are no UTF-8 cannot be printed
        float(attrs.get("rtol", 0.0)), float(attrs.get("cells_per_second", 0.0))
    if not {v.dtype.kind for v in dataset.data_vars.values()} <= set("fiu"):
        raise TypeError("an output is no number")


def _of_unfinished(output: Path, found: xr.Dataset, attrs: Mapping[str, Any]) -> xr.Dataset:
    """The Dataset without what is known at the end; of a summary, of the rows that are there."""
    kept = {name: value for name, value in found.attrs.items() if name not in ENDINGS}
    if "over" not in attrs:
        plain = _with_plain_text(found)
        plain.attrs = kept
        return plain
    study = Study.from_json(attrs["study_json"], declared=True)
    with _stored(output) as file:
        rows, blocks = pending(study, 0, row_blocks(study).count), file.layout.work.blocks
        for name, column in file.columns("rows").items():
            for block in range(blocks.count):
                if file.is_sound("rows", block):
                    start, stop = blocks.bounds(block)
                    rows[name][start:stop] = column.run(start, stop)
    plan = output_schema(study, attrs["fingerprint"])
    return in_memory(replace(plan, attrs=kept), gathered(study, rows))


def _stored(path: Path) -> StoredFile:
    """Raises SweepError, FileNotFoundError."""
    try:
        return StoredFile(path)
    except FileNotFoundError:
        raise
    except DAMAGE as fault:
        raise unreadable(path, fault) from None


def check_structure(output: Path) -> None:
    """Raises SweepError where anything but the outputs' numbers is known not to be as it was written.

    A program that changes a file by HDF5 cuts the trailer off; what it changed on purpose is opened.
    """
    if not output.is_file():
        return
    try:
        fd = disk.open_file(output, os.O_RDONLY)
        try:
            sound = unbroken(fd, MOST_AT_ONCE, output)
        finally:
            os.close(fd)
    except FileNotFoundError:
        raise
    except OSError as fault:
        raise unreadable(output, fault) from None
    if sound is False:
        raise SweepError(f"{output}: {BESIDE}; sweep verify tells of all damage")


@contextlib.contextmanager
def changed(output: Path) -> Iterator[None]:
    """Whatever goes wrong within with a result that is not as it was written, that is told. Raises SweepError."""
    try:
        yield
    except (*DAMAGE, ArithmeticError) as fault:
        opened = output if output.exists() else unfinished_of(output)
        if (isinstance(fault, OSError) and fault.errno) or intact(opened):
            raise
        what = f"{type(fault).__name__}: {fault}".splitlines()[0]
        raise SweepError(f"{output}: was changed by another program, and is no result any more ({what})") from None


def unreadable(output: Path, fault: Exception) -> SweepError:
    """What a user is told of a file that is no result."""
    if output.is_dir():
        return SweepError(f"{output}: is a folder, not the result of a sweep")
    if isinstance(fault, OSError) and fault.errno and fault.errno not in OF_DAMAGE:
        return SweepError(f"{output}: cannot be read ({os.strerror(fault.errno)})")
    return SweepError(f"{output}: not the result of a sweep, or damaged; move it away or choose another name")


def _with_plain_text(dataset: xr.Dataset) -> xr.Dataset:
    """Words as fixed-width text, as in a Dataset that was never in a file."""
    words = {name: c for name, c in dataset.coords.items() if c.dtype.kind not in "fi"}
    plain = dataset.assign_coords({name: (c.dims, c.values.astype(str), c.attrs) for name, c in words.items()})
    plain.set_close(dataset.close)
    return plain
