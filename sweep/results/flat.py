"""A summary as a table: a row for each value of the axes that are kept, counts and histograms in columns."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr

from sweep.cells.reduce import BY_METHOD, BY_STATUS
from sweep.results.statuses import is_summary


def flat(dataset: xr.Dataset) -> xr.Dataset:
    """A summary with what runs along statuses, methods or bins as variables of their own; any other Dataset as it is.

    Statuses and methods that no cell has are left out.
    """
    if not is_summary(dataset):
        return dataset
    found = {name: column for name, variable in dataset.data_vars.items() for name, column in _columns(variable)}
    dims = {dim for column in found.values() for dim in column.dims}
    kept = {name: c for name, c in dataset.coords.items() if set(c.dims) <= dims}
    return xr.Dataset({name: column.drop_vars(column.coords) for name, column in found.items()}, kept, dataset.attrs)


def _columns(variable: xr.DataArray) -> Iterator[tuple[str, xr.DataArray]]:
    name, last = str(variable.name), str(variable.dims[-1]) if variable.dims else ""
    if name in (BY_STATUS, BY_METHOD):
        for word in variable[last].values:
            column = variable.sel({last: word})
            if column.any():
                yield f"cells_{word}", column.assign_attrs(long_name=f"cells: {word}")
    elif f"{last}_lower" in variable.coords:
        for place in range(variable.sizes[last]):
            column = variable.isel({last: place})
            ends = " to ".join(f"{column[f'{last}_{end}'].item():g}" for end in ("lower", "upper"))
            yield f"{name}_{place + 1}", column.assign_attrs(long_name=f"{ends}: {variable.attrs['long_name']}")
    else:
        yield name, variable
