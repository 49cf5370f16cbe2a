"""Which parameters decide an output: Sobol' indices and Morris' elementary effects, by SALib on a study's design."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import xarray as xr

from sweep.errors import SweepError
from sweep.laws.loglog import is_logarithmic
from sweep.study import samples
from sweep.study.model import Study

SEED = 1
"""Of the resampling that tells the errors; SALib takes 0 for none."""
SOBOL = {
    "S1": ("first_order", "share of the variance by the parameter alone"),
    "S1_conf": ("first_order_error", "half of the interval of the share, 95 %"),
    "ST": ("total", "share of the variance by the parameter and all that it acts together with"),
    "ST_conf": ("total_error", "half of the interval of the total, 95 %"),
}
MORRIS = {
    "mu_star": ("effect", "mean size of the change over the whole range of the parameter"),
    "mu_star_conf": ("effect_error", "half of the interval of the effect, 95 %"),
    "mu": ("mean", "mean change; smaller than the effect where it has both signs"),
    "sigma": ("spread", "standard deviation of the change: curvature, or other parameters"),
}


def sensitivity(dataset: xr.Dataset, y: str | xr.DataArray) -> xr.Dataset:
    """Indices of every axis of a design "saltelli" (Sobol') or "morris".

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result` of a study of such a design.
    y : str or DataArray
        An output of one value a cell, or what is made of outputs: np.log(ds.period).

    Returns
    -------
    Dataset
        Along `parameter`: `first_order`, `total` and their errors (Saltelli 2010); or `effect`, its error, `mean` and
        `spread`, in the unit of y (Campolongo 2007).

    Raises
    ------
    SweepError
        The design is another, a cell has no value, or SALib is missing.

    Examples
    --------
    >>> import sweep
    >>> axes = {name: {"spacing": "log", "start": 0.9, "stop": 1.1} for name in ("mu", "a", "phi0")}
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], design={"kind": "saltelli", "n": 64}, axes=axes)
    >>> found = sweep.sensitivity(ds, "period")
    >>> found.total.to_series().idxmin()  # near alpha = 1 friction decides least
    'a'
    """
    text = dataset.attrs.get("study_json")
    study = None if text is None else Study.from_json(str(text), declared=True)
    kind = "" if study is None else study.design
    if study is None or kind not in ("saltelli", "morris"):
        raise SweepError('the design of the result is neither "saltelli" nor "morris"; sensitivity needs one of these')
    values = _values(dataset[y] if isinstance(y, str) and y in dataset else y, dataset)
    problem = samples.problem(tuple(study.axes))
    words = SOBOL if kind == "saltelli" else MORRIS
    found = _sobol(problem, values) if kind == "saltelli" else _morris(problem, _shares(dataset, problem), values)
    told = xr.Dataset(coords={"parameter": problem["names"]}, attrs={"design": kind})
    for key, (name, text) in words.items():
        told[name] = ("parameter", np.asarray(found[key], float), {"long_name": text})
    return told


def _values(y: Any, dataset: xr.Dataset) -> Any:
    if not isinstance(y, xr.DataArray):
        raise SweepError(f"there is no output {y!r}; there are {', '.join(map(str, dataset.data_vars))}")
    if y.dims != dataset["status"].dims:
        raise SweepError("y: expected one value a cell; choose a place along its other dimensions")
    values = np.asarray(y.values, float)
    lost = int((~np.isfinite(values)).sum())
    if lost:
        raise SweepError(f"{lost} of {values.size} cells have no value; make the ranges of the axes narrower")
    return values


def _shares(dataset: xr.Dataset, problem: dict[str, Any]) -> Any:
    """Where the cells lie along each axis, from 0 to 1; only the order of neighbours counts."""
    columns = [dataset[name].values for name in problem["names"]]
    columns = [np.log(column) if is_logarithmic(np.unique(column)) else column for column in columns]
    return np.stack([(c - c.min()) / (np.ptp(c) or 1.0) for c in columns], axis=1)


def _sobol(problem: dict[str, Any], values: Any) -> Any:
    samples.require_salib()
    from SALib.analyze import sobol

    return sobol.analyze(problem, values, calc_second_order=False, seed=SEED)


def _morris(problem: dict[str, Any], shares: Any, values: Any) -> Any:
    samples.require_salib()
    from SALib.analyze import morris

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return morris.analyze(problem, shares, values, num_levels=samples.LEVELS, seed=SEED)
