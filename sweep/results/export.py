"""Results for other programs: csv and parquet for tables, nc (netCDF4) and zarr for whatever reads CF."""

from __future__ import annotations

import contextlib
import csv
import math
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import xarray as xr
from xarray.indexes import PandasMultiIndex

from sweep.cells.reduce import BY_METHOD, BY_STATUS
from sweep.errors import SweepError, missing
from sweep.file import disk
from sweep.file.disk import check_target
from sweep.results.statuses import flag_words, is_summary, pieces
from sweep.words import as_path, cell, flag, listed, require_dataset

EXPORTED = "exported by foliot"
"""Entry in the attribute history of an export."""
ROWS = 65536
"""Rows of csv in memory at a time."""

COMPRESSION = 5
"""Level of compression."""
LARGE = 256 * 2**20
"""Bytes from which a Dataset is written to netCDF4 piece by piece."""


def export(
    dataset: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    force: bool = False,
    compress: bool = False,
) -> Path:
    """Write a Dataset to `path`, as its suffix says: .csv, .parquet, .nc or .zarr.

    An existing file is replaced only with `force`, once the new one is complete; that of the Dataset itself never is.

    csv: one row per cell (per cell and phase, for outputs along a phase), one column per coordinate and output,
    `status` and `method_used` as words, numbers with all their digits. Lines that start with "#" name the unit of
    each column; `pandas.read_csv(path, comment="#")` reads it, and so does the `file` of an axis of a study.
    Memory does not grow with the number of cells.

    parquet: the same table with types; units and meanings are in the metadata of each field, the Dataset's attributes
    in that of the schema.

    nc, zarr: netCDF4, or a folder of zarr, with units, flags and all attributes; `compress` makes them smaller
    without loss.

    Raises
    ------
    SweepError
        If there is nothing to write, the suffix is unknown, a library is not installed, or the file exists already or
        cannot be written.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> print(sweep.export(ds, "period.csv", force=True).read_text().splitlines()[-1])
    2.0,1.0,1.0,0.0,0.0,0.0,1.0,0.0,1.0,5.524901443102082,1.0000001e-15,OK,closed
    """
    require_dataset("export", dataset)
    if not any(column.size for column in (dataset.data_vars or dataset.coords).values()):
        raise SweepError(f"{path}: there is nothing to export; no cell meets the condition, or the Dataset is empty")
    stacked = [dim for dim in dataset.dims if isinstance(dataset.xindexes.get(dim), PandasMultiIndex)]
    dataset = dataset.reset_index(stacked)  # as columns, which every kind of file can hold
    target = as_path(path)
    kind = target.suffix.lower()
    if kind not in WRITERS:
        found = f'"{target.suffix}"' if target.suffix else "no suffix"
        raise SweepError(f"{target}: found {found}; export writes {listed(WRITERS, word='and')}, chosen by the suffix")
    if flag("compress", compress) and kind not in PACKED:
        raise SweepError(f"{target}: compress is for {listed(PACKED, word='and')}")
    source = dataset.encoding.get("source")
    check_target(target, force=force, read=[Path(source)] if source else [])
    try:
        with disk.replacing(target) as part:
            history = [text for text in str(dataset.attrs.get("history", "")).splitlines() if text != EXPORTED]
            whole = dataset if kind in PACKED else flat(dataset)
            whole = whole.assign_attrs(history="\n".join([*history, EXPORTED]))
            WRITERS[kind](whole, part, **({"compress": True} if compress else {}))
    except ImportError as error:
        raise missing(f"{target}: needs {error.name}", "export") from None
    except RuntimeError as error:  # from HDF5
        raise SweepError(f"{target} cannot be written: {error}") from None
    return target


def _write_csv(dataset: xr.Dataset, path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {EXPORTED}\n")
        for name, variable in (*dataset.coords.items(), *dataset.data_vars.items()):
            unit = f" [{variable.attrs['units']}]" if "units" in variable.attrs else ""
            # a quotation mark could open a quoted field that swallows the lines below
            about = " ".join(str(variable.attrs.get("long_name", "")).replace('"', "'").split())
            file.write(f"# {' '.join(f'{name}{unit}'.split())}{': ' + about if about else ''}\n")
        writer = csv.writer(file, lineterminator="\n")  # faster than that of pandas
        writer.writerow(map(cell, (*dataset.coords, *dataset.data_vars)))
        for table in _tables(dataset):
            writer.writerows(zip(*(_texts(column) for _, column in table.items()), strict=True))


def _texts(column: Any) -> Iterable[Any]:
    """A column of a table, for csv."""
    if column.dtype == "float32":  # as a float it would have the digits of another number
        return map(str, column.to_numpy())
    found = column.tolist()  # an iterator of pandas takes ten times as long over words
    return found if column.dtype.kind in "fiu" else map(cell, found)


def _write_parquet(dataset: xr.Dataset, path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    def text(attrs: Mapping[Any, Any]) -> dict[str, str]:
        """As parquet wants attributes; flags are words in a table."""
        return {str(name): str(value) for name, value in attrs.items() if name not in ("flag_values", "flag_meanings")}

    schema = None
    with contextlib.ExitStack() as stack:
        for table in _tables(dataset):
            arrays = {str(name): pa.array(column.to_numpy()) for name, column in table.items()}
            if schema is None:
                fields = [pa.field(name, a.type, metadata=text(dataset[name].attrs)) for name, a in arrays.items()]
                schema = pa.schema(fields, metadata=text(dataset.attrs))
                writer = stack.enter_context(pq.ParquetWriter(path, schema))
            writer.write_table(pa.table(list(arrays.values()), schema=schema))


def _tables(dataset: xr.Dataset) -> Iterator[Any]:
    """pandas tables of at most about `ROWS` rows: one for each cell, and place of a trace; flags as words."""
    dims = list(dict.fromkeys((*(dataset["status"].dims if "status" in dataset else ()), *dataset.sizes)))
    for block in pieces(dataset, dims, ROWS * len(dataset.variables)):
        # a dataset of no dimension has one row
        frame = block.to_dataframe(dim_order=dims) if dims else block.expand_dims("cell").to_dataframe()
        table = frame.reset_index()[[*dataset.coords, *dataset.data_vars]]
        for name in table:
            if words := flag_words(dataset[name]):
                table[name] = [words.get(code, str(code)) for code in table[name].tolist()]
        yield table


def _write_zarr(dataset: xr.Dataset, path: Path, compress: bool = False) -> None:
    import zarr

    path.unlink()
    blosc = zarr.codecs.BloscCodec(cname="zstd", clevel=COMPRESSION, shuffle="shuffle")
    encoding = {str(name): {"compressors": (blosc,)} for name, v in dataset.data_vars.items() if v.shape and compress}
    whole = _in_pieces(dataset)
    words = {str(name): whole[name].astype(object) for name in whole.variables if whole[name].dtype.kind == "U"}
    with warnings.catch_warnings():  # of version 3 it is no part yet; xarray looks for it, and warns where it is not
        warnings.filterwarnings("ignore", "Consolidated metadata")
        whole.assign(words).drop_encoding().to_zarr(path, mode="w", consolidated=True, encoding=encoding)


def _in_pieces(dataset: xr.Dataset) -> xr.Dataset:
    """The same, in pieces where it is large."""
    return dataset.chunk("auto") if dataset.nbytes > LARGE and not dataset.chunks else dataset


def flat(dataset: xr.Dataset) -> xr.Dataset:
    """A summary with what runs along statuses, methods or bins as variables of their own; any other Dataset as it is.

    Statuses and methods that no cell has are left out.
    """
    if not is_summary(dataset):
        return dataset
    found = dict[str, xr.DataArray]()
    for name, variable in dataset.data_vars.items():
        last = str(variable.dims[-1]) if variable.dims else ""
        if name in (BY_STATUS, BY_METHOD):
            for word in variable[last].values:
                if (column := variable.sel({last: word})).any():
                    found[f"cells_{word}"] = column.assign_attrs(long_name=f"cells: {word}")
        elif f"{last}_lower" in variable.coords:
            for place in range(variable.sizes[last]):
                column = variable.isel({last: place})
                ends = " to ".join(f"{column[f'{last}_{end}'].item():g}" for end in ("lower", "upper"))
                text = f"{ends}: {variable.attrs['long_name']}"
                found[f"{name}_{place + 1}"] = column.assign_attrs(long_name=text)
        else:
            found[str(name)] = variable
    dims = {dim for column in found.values() for dim in column.dims}
    kept = {name: c for name, c in dataset.coords.items() if set(c.dims) <= dims}
    return xr.Dataset({name: column.drop_vars(column.coords) for name, column in found.items()}, kept, dataset.attrs)


def _write_netcdf(dataset: xr.Dataset, path: Path, compress: bool = False) -> None:
    whole = _in_pieces(dataset)
    encoding: dict[str, dict[str, Any]] = {str(name): {"_FillValue": None} for name in whole.variables}
    for name, variable in whole.data_vars.items():
        if compress and variable.shape:
            encoding[str(name)] |= {"zlib": True, "shuffle": True, "complevel": COMPRESSION}
        elif variable.dtype.kind in "iu" and math.prod(variable.shape) > 1:
            encoding[str(name)] |= {"zlib": True, "complevel": 1}
    whole.to_netcdf(path, engine="h5netcdf", encoding=encoding)


WRITERS: dict[str, Callable[..., None]] = {
    ".csv": _write_csv,
    ".parquet": _write_parquet,
    ".nc": _write_netcdf,
    ".zarr": _write_zarr,
}
"""Kinds of file, by suffix."""
PACKED = (".nc", ".zarr")
"""Those that can be compressed."""
