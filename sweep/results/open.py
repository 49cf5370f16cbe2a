"""Results as xarray Datasets: of a finished sweep, or of one that still runs."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.cells.output_schema import gathered, output_schema, part_columns
from sweep.cells.partition import row_blocks
from sweep.cells.reduce import BY_STATUS, pending
from sweep.cells.schema import STATUS, Schema
from sweep.store.digests import BESIDE, unbroken
from sweep.store.hdf5_bytes import PartBytes
from sweep.store.manifest import MANIFEST, Manifest, read_manifest
from sweep.store.parts import PART_NAME, Parts, at_once, read_part
from sweep.store.probe import MOST_AT_ONCE, check_own, readable
from sweep.store.store import folder_of
from sweep.study.model import Study
from sweep.system.errors import SweepError

if TYPE_CHECKING:
    import xarray as xr

LARGEST_AT_ONCE = 1 << 28
"""Bytes of an unfinished result that are read at once; of larger ones, parts are read when they are used."""
MOST_COMPRESSED = 1100
"""Bytes that gzip makes of one, at most."""
MEMORY_SHARE = 0.25
"""Results larger than this share of the memory are opened in pieces (dask)."""


def open_result(path: str | os.PathLike[str], strict: bool = False) -> xr.Dataset:
    """The result of a sweep, finished or not.

    Cells that are not computed yet are NaN, with status PENDING. Values are read when they are used; what is larger
    than a quarter of the memory comes as dask arrays.

    Parameters
    ----------
    path : path
        The output of a sweep, also while only its folder of parts is there.
    strict : bool
        Refuse a sweep that is not finished.

    Raises
    ------
    SweepError
        There is no result, or it cannot be read, or it is unfinished and `strict`.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> with sweep.run(sweep.study_of(ds), "opened.h5") as written, sweep.open_result("opened.h5") as found:
    ...     print(found.period.equals(ds.period), found.period.units)
    True s
    """
    output = Path(path)
    for _ in range(3):
        if output.exists():
            return _open_finished(output)
        manifest = read_manifest(folder_of(output))
        if manifest is None:
            raise SweepError(f"{output}: no such file, and no sweep that writes it")
        try:
            return _open_parts(output, manifest, strict)
        except FileNotFoundError:
            continue  # the sweep has ended meanwhile
    raise SweepError(f"{output}: its parts are vanishing while they are read; try again")


def open_unfinished(path: str | os.PathLike[str]) -> xr.Dataset:
    """What there is of an unfinished sweep, also where its output holds an earlier result. Raises SweepError."""
    output = Path(path)
    manifest = read_manifest(folder_of(output))
    if manifest is None:
        raise SweepError(f"{output}: there is no sweep that writes it")
    return _open_parts(output, manifest, False)


def in_memory(plan: Schema, arrays: Mapping[str, Any]) -> xr.Dataset:
    """A Dataset of columns of shape `(size, ...)`."""
    import xarray as xr

    variables = {
        c.name: ((*plan.grid.dims, *c.dims), arrays[c.name].reshape(plan.shape(c)), dict(c.attrs)) for c in plan.columns
    }
    coordinates = {c.name: (c.dims, c.values, dict(c.attrs)) for c in plan.coordinates}
    return xr.Dataset(variables, coordinates, dict(plan.attrs))


def stored_fingerprint(output: Path) -> dict[str, str]:
    """Fingerprint of a finished result.

    Raises
    ------
    SweepError
        The file cannot be read, or is none of ours.
    """
    import h5py

    try:
        if not output.is_file():
            raise ValueError("it is no regular file")
        with output.open("rb") as raw:
            if not readable(output, raw.fileno()):
                raise ValueError("HDF5 cannot read it")
        with h5py.File(output, "r") as file:
            check_own(file)
            text = file.attrs["fingerprint"]
            file.attrs["study_json"], file[STATUS if STATUS in file else BY_STATUS]
            if any(not _can_be(file, name, output.stat().st_size) for name in file):
                raise ValueError("more numbers than the file has room for")
        return dict(json.loads(text))
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as fault:
        raise unreadable(output, fault) from None


def _can_be(file: Any, name: str, size: int) -> bool:
    """Whether the file has room for a dataset."""
    numbers = getattr(file[name], "nbytes", 0)
    return bool(numbers <= size * (MOST_COMPRESSED if file[name].chunks else 1)) if numbers else True


def memory() -> int:
    """Bytes of memory of this machine."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _open_finished(output: Path) -> xr.Dataset:
    from sweep.results.lazy import open_checked

    _check_frame(output)
    stored_fingerprint(output)
    large = output.stat().st_size > MEMORY_SHARE * memory()
    try:
        return _with_plain_text(open_checked(output, "auto" if large else None))
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as fault:
        raise unreadable(output, fault) from None


def _check_frame(output: Path) -> None:
    """Raises SweepError where all but the outputs' numbers is damaged.

    A program that changes a file by HDF5 cuts the trailer off; what it changed on purpose is opened.
    """
    if not output.is_file():
        return
    try:
        with output.open("rb") as raw:
            sound = unbroken(raw.fileno(), MOST_AT_ONCE)
    except OSError as fault:
        raise unreadable(output, fault) from None
    if sound is False:
        raise SweepError(f"{output}: {BESIDE}; sweep verify tells of all damage")


def unreadable(output: Path, fault: Exception) -> SweepError:
    """What a user is told of a file that is no result."""
    if output.is_dir():
        return SweepError(f"{output}: is a folder, not the result of a sweep")
    if isinstance(fault, PermissionError):
        return SweepError(f"{output}: cannot be read ({fault.strerror})")
    return SweepError(f"{output}: not the result of a sweep, or damaged; move it away or choose another name")


def _with_plain_text(dataset: xr.Dataset) -> xr.Dataset:
    """Words as fixed-width text, as in a Dataset that was never in a file."""
    words = {name: c for name, c in dataset.coords.items() if c.dtype.kind not in "fi"}
    plain = dataset.assign_coords({name: (c.dims, c.values.astype(str), c.attrs) for name, c in words.items()})
    plain.set_close(dataset.close)
    return plain


def _open_parts(output: Path, manifest: Manifest, strict: bool) -> xr.Dataset:
    folder = folder_of(output)
    study = checked_study(folder, manifest)
    part_bytes = PartBytes(part_columns(study), manifest.mark)
    parts = Parts(part_bytes, manifest.blocks, folder, _part_names(folder, manifest, part_bytes))
    if strict and len(parts.names) == manifest.blocks.count:
        raise SweepError(f"{output}: all is computed but not put together yet; run its sweep again to finish")
    if strict:
        left = manifest.blocks.count - len(parts.names)
        raise SweepError(
            f"{output}: unfinished, {left} of {manifest.blocks.count} blocks are missing; run its sweep again to "
            "continue"
        )
    plan = output_schema(study, manifest.fingerprint)
    plan = replace(plan, attrs={**plan.attrs, "start": manifest.begun})
    if study.summary is not None:
        return in_memory(plan, gathered(study, _read_all(parts, pending(study, 0, manifest.blocks.size))))
    if plan.grid.size * plan.cell_bytes > min(LARGEST_AT_ONCE, MEMORY_SHARE * memory()):
        return _lazily(plan, parts)
    empty = {c.name: np.full((plan.grid.size, *c.shape), c.missing, c.dtype) for c in plan.columns}
    return in_memory(plan, _read_all(parts, empty))


def checked_study(folder: Path, manifest: Manifest) -> Study:
    """The study of an unfinished sweep. Raises SweepError where its grid is not the one that was cut."""
    study = Study.from_json(manifest.study, declared=True)
    try:
        rows = row_blocks(study).count
        output_schema(study, manifest.fingerprint)
    except (LookupError, ValueError, TypeError, AttributeError, ArithmeticError) as fault:
        raise SweepError(f"{folder / MANIFEST}: damaged (its study cannot be: {fault})") from None
    if manifest.blocks.size != rows or not 1 <= manifest.blocks.cells <= rows:
        raise SweepError(f"{folder / MANIFEST}: damaged (its blocks do not fit its study)")
    return study


def _part_names(folder: Path, manifest: Manifest, part_bytes: PartBytes) -> dict[int, str]:
    """The part of every block that is there; of two of one block, a sound one."""
    names: dict[int, str] = {}
    for entry in os.scandir(folder):
        match = PART_NAME.fullmatch(entry.name)
        if match is None or not manifest.blocks.holds(int(match[1]), int(match[2])):
            continue
        index = int(match[1]) // manifest.blocks.cells
        if index not in names or read_part(folder / names[index], part_bytes) is None:
            names[index] = entry.name
    return names


def _read_all(parts: Parts, rows: dict[str, Any]) -> dict[str, Any]:
    """The rows, with those of all sound parts filled in."""

    def fill(indices: list[int]) -> None:
        for index in indices:
            start, stop = parts.blocks.bounds(index)
            path = parts.folder / parts.names[index]
            for name, values in (read_part(path, parts.part_bytes, keep=True) or {}).items():
                rows[name][start:stop] = values

    at_once(fill, sorted(parts.names))
    return rows


def _lazily(plan: Schema, parts: Parts) -> xr.Dataset:
    """A Dataset that reads parts when their numbers are used."""
    import xarray as xr

    from sweep.results.lazy import lazy

    variables = {
        c.name: ((*plan.grid.dims, *c.dims), lazy(parts, c, plan.grid.shape), dict(c.attrs)) for c in plan.columns
    }
    coordinates = {c.name: (c.dims, c.values, dict(c.attrs)) for c in plan.coordinates}
    dataset = xr.Dataset(variables, coordinates, dict(plan.attrs))
    return dataset.chunk("auto") if dataset.nbytes > MEMORY_SHARE * memory() else dataset
