"""Cells of a result chosen by a condition such as `status == 'OK' and R < 0.1`."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import xarray as xr

from sweep.cells.schema import STATUS
from sweep.errors import SweepError
from sweep.results.statuses import flag_words
from sweep.study.condition import Condition
from sweep.words import did_you_mean, listed, require_dataset


def where(dataset: xr.Dataset, condition: str) -> xr.Dataset:
    """The cells for which a condition holds, along one dimension `cell`, with their parameters as coordinates.

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`.
    condition : str
        Of names in the result, numbers and words: "status == 'OK' and R < 0.1*mu". Words are those of `status`,
        `method_used` and of axes of words. Outputs along a coordinate of their own cannot be used.

    Raises
    ------
    SweepError
        The condition cannot be read, or names what is not there.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> sweep.where(ds, "status == 'OK' and mu > 0.7").mu.values
    array([1., 2.])
    """
    require_dataset("where", dataset)
    if STATUS not in dataset:
        raise _refusal(condition, "a summary keeps no cells to choose from")
    truth = _condition(dataset, condition).truth()
    dims = [str(dim) for dim in dataset[STATUS].dims]
    if set(truth.dims) - set(dims):
        raise _refusal(condition, f"runs along {listed(sorted(map(str, set(truth.dims) - set(dims))))}, not the cells")
    flat = dataset if dims == ["cell"] else dataset.stack(cell=dims, create_index=False)
    flat = flat.transpose("cell", ...)
    mask = truth.broadcast_like(dataset[STATUS]).transpose(*dims).values.ravel()
    return flat.isel(cell=np.flatnonzero(mask))


def _condition(dataset: xr.Dataset, text: str) -> Condition:
    """On the variables of a dataset, flags as words."""

    def variable(name: str) -> xr.DataArray:
        if name not in dataset.variables:
            hint = did_you_mean(name, map(str, dataset.variables))
            raise _refusal(text, f"the result has no {name}{hint}")
        found = dataset[name].compute()
        words = flag_words(found)
        if not words:
            return found
        codes, inverse = np.unique(found.values, return_inverse=True)
        texts = np.array([words.get(int(code), str(code)) for code in codes])
        return found.copy(data=texts[inverse].reshape(found.shape))

    def words(name: str) -> Iterable[str]:
        return flag_words(dataset[name]).values() or sorted(set(map(str, np.unique(dataset[name].values))))

    return Condition(text, variable, words, "--where ")


def _refusal(condition: str, what: str) -> SweepError:
    return SweepError(f"--where {condition}: {what}")
