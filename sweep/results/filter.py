"""Selects cells of a result by a condition such as `status == 'OK' and R < 0.1`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr

from sweep.cells.schema import STATUS
from sweep.results.statuses import flag_words, statuses_of
from sweep.study.condition import Condition
from sweep.words import did_you_mean, listed, require_dataset


def where(dataset: xr.Dataset, condition: str) -> xr.Dataset:
    """Select the cells that satisfy a condition, along one dimension `cell`, with their parameters as coordinates.

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`.
    condition : str
        Made of names in the result, numbers and words: "status == 'OK' and R < 0.1*mu". Words are compared with
        `status`, `method_used` and axes of words. A number compared with a name may have a unit: "amplitude > '60
        degree'". Outputs along a coordinate of their own cannot be used.

    Raises
    ------
    SweepError
        The condition cannot be read, or contains an unknown name.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> sweep.where(ds, "status == 'OK' and mu > 0.7").mu.values
    array([1., 2.])
    """
    require_dataset("where", dataset)

    def variable(name: str) -> xr.DataArray:
        """A variable with flags as words."""
        if name not in dataset.variables:
            raise chosen.refusal(f"the result has no {name}{did_you_mean(name, map(str, dataset.variables))}")
        found = dataset[name].compute()
        words = flag_words(found)
        if not words:
            return found
        codes, inverse = np.unique(found.values, return_inverse=True)
        texts = np.array([words.get(int(code), str(code)) for code in codes])
        return found.copy(data=texts[inverse].reshape(found.shape))

    def words(name: str) -> Iterable[str]:
        return flag_words(dataset[name]).values() or sorted(set(map(str, np.unique(dataset[name].values))))

    units = {str(name): str(v.attrs["units"]) for name, v in dataset.variables.items() if "units" in v.attrs}
    chosen = Condition(condition, variable, words, "where ", units)
    dataset = dataset if statuses_of(dataset).dims else dataset.expand_dims("cell")
    status, truth = dataset[STATUS], chosen.truth()
    dims = [str(dim) for dim in status.dims]
    if others := sorted({str(dim) for dim in truth.dims} - set(dims)):
        raise chosen.refusal(f"runs along {listed(others)}, not the cells")
    # of many cells this is read in a twentieth of the time that `cells_at` takes
    flat = dataset if dims == ["cell"] else dataset.stack(cell=dims, create_index=False)
    return flat.transpose("cell", ...).isel(cell=np.flatnonzero(truth.broadcast_like(status).transpose(*dims)))


def cells_at(dataset: xr.Dataset, numbers: Any) -> xr.Dataset:
    """A few cells by their numbers in C order, along one dimension `cell`, with their parameters as coordinates."""
    dataset = dataset if dataset[STATUS].dims else dataset.expand_dims("cell")
    places = zip(dataset[STATUS].dims, np.unravel_index(numbers, dataset[STATUS].shape), strict=True)
    return dataset.isel({dim: xr.DataArray(place, dims="cell") for dim, place in places}).transpose("cell", ...)
