"""Results as xarray Datasets: of a finished sweep, or of one that still runs."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.errors import SweepError
from sweep.image import Images
from sweep.layout import STATUS, Column, Layout, layout
from sweep.parts import PART_NAME, read_part
from sweep.statuses import StatusCount, count_methods, count_statuses, failures
from sweep.store import Spec, folder_of, read_spec
from sweep.study import Study

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "StatusCount",
    "count_methods",
    "count_statuses",
    "failures",
    "in_memory",
    "memory",
    "open_result",
    "stored_fingerprint",
]

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
    """
    output = Path(path)
    for _ in range(3):
        if output.exists():
            return _open_finished(output)
        spec = read_spec(folder_of(output))
        if spec is None:
            raise SweepError(f"{output}: no such file, and no sweep that writes it")
        try:
            return _open_parts(output, spec, strict)
        except FileNotFoundError:
            continue  # the sweep has ended meanwhile
    raise SweepError(f"{output}: its parts are vanishing while they are read; try again")


def in_memory(plan: Layout, arrays: Mapping[str, Any]) -> xr.Dataset:
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
        with h5py.File(output, "r") as file:
            text = file.attrs["fingerprint"]
            file.attrs["study_json"], file[STATUS]
        return dict(json.loads(text))
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as fault:
        raise _unreadable(output, fault) from None


def memory() -> int:
    """Bytes of memory of this machine."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _open_finished(output: Path) -> xr.Dataset:
    import xarray as xr

    stored_fingerprint(output)
    large = output.stat().st_size > MEMORY_SHARE * memory()
    try:
        dataset = xr.open_dataset(
            output, engine="h5netcdf", chunks="auto" if large else None, decode_times=False, decode_timedelta=False
        )
        return _with_plain_text(dataset)
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as fault:
        raise _unreadable(output, fault) from None


def _unreadable(output: Path, fault: Exception) -> SweepError:
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


def _open_parts(output: Path, spec: Spec, strict: bool) -> xr.Dataset:
    folder = folder_of(output)
    matches = (PART_NAME.fullmatch(path.name) for path in folder.iterdir())
    parts = {int(m[1]) // spec.blocks.cells: folder / m[0] for m in matches if m}
    if strict and len(parts) == spec.blocks.count:
        raise SweepError(f"{output}: all is computed but not put together yet; run its sweep again to finish")
    if strict:
        left = spec.blocks.count - len(parts)
        raise SweepError(
            f"{output}: unfinished, {left} of {spec.blocks.count} blocks are missing; run its sweep again to continue"
        )
    plan = layout(Study.from_json(spec.study, declared=True), spec.fingerprint)
    large = plan.grid.size * plan.cell_bytes > MEMORY_SHARE * memory()
    arrays = _in_pieces(plan, spec, parts) if large else _at_once(plan, spec, parts)
    return in_memory(replace(plan, attrs={**plan.attrs, "start": spec.begun}), arrays)


def _at_once(plan: Layout, spec: Spec, parts: Mapping[int, Path]) -> dict[str, Any]:
    images = Images(plan.columns)
    arrays = {c.name: c.empty(plan.grid.size) for c in plan.columns}
    for index in range(spec.blocks.count):
        start, stop = spec.blocks.bounds(index)
        block = _block(images, parts.get(index), start, stop)
        for name, values in block.items():
            arrays[name][start:stop] = values
    return arrays


def _block(images: Images, part: Path | None, start: int, stop: int) -> dict[str, Any]:
    """A block's numbers; of a missing or damaged one NaN and PENDING."""
    found = None if part is None else read_part(part, images, start, stop)
    return found or {c.name: np.full((stop - start, *c.shape), c.missing, c.dtype) for c in images.columns}


def _in_pieces(plan: Layout, spec: Spec, parts: Mapping[int, Path]) -> dict[str, Any]:
    """The same as dask arrays, a block a piece."""
    import dask.array as da
    from dask.delayed import delayed

    read = delayed(partial(_block, Images(plan.columns)), pure=False)
    from_delayed: Any = da.from_delayed
    concatenate: Any = da.concatenate
    bounds = [spec.blocks.bounds(i) for i in range(spec.blocks.count)]
    blocks = [read(parts.get(i), *b) for i, b in enumerate(bounds)]

    def pieces(column: Column) -> list[Any]:
        shapes = [(stop - start, *column.shape) for start, stop in bounds]
        named = zip(blocks, shapes, strict=True)
        return [from_delayed(block[column.name], shape, column.dtype) for block, shape in named]

    return {c.name: concatenate(pieces(c)) for c in plan.columns}
