"""Global sensitivity of an output: Sobol' indices and Morris' elementary effects, by SALib on a study's design."""

from __future__ import annotations

import warnings

import numpy as np
import xarray as xr

from sweep.errors import SweepError
from sweep.results.statuses import require_as_read
from sweep.study.designs import LEVELS, problem, require_salib
from sweep.study.model import Study
from sweep.words import require_dataset

SEED = 1
"""Seed of the resampling for the errors; SALib takes 0 as none."""
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
    """Sensitivity indices of every axis, from a design "saltelli" (Sobol') or "morris".

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`, of a study with such a design.
    y : str or DataArray
        An output with one value per cell, or a function of outputs: np.log(ds.period).

    Returns
    -------
    Dataset
        Along `parameter`: `first_order`, `total` and their errors (Saltelli 2010); or `effect`, its error, `mean` and
        `spread`, in the unit of y (Campolongo 2007).

    Raises
    ------
    SweepError
        The design is neither of the two, a cell has no value, or SALib is not installed.

    Examples
    --------
    >>> import sweep
    >>> axes = {name: {"spacing": "log", "start": 0.9, "stop": 1.1} for name in ("mu", "a", "phi0")}
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], design={"kind": "saltelli", "n": 64}, axes=axes)
    >>> found = sweep.sensitivity(ds, "period")
    >>> found.total.to_series().idxmin()  # near alpha = 1 friction decides least
    'a'
    """
    require_dataset("sensitivity", dataset)
    study = Study.of(dataset, declared=True)
    if study.design not in ("saltelli", "morris"):
        raise SweepError('the design of the result is neither "saltelli" nor "morris"; sensitivity needs one of these')
    require_as_read(dataset, study, ["status"], whole=True)  # cells follow each other as the design has them
    found = dataset[y] if isinstance(y, str) and y in dataset else y
    if not isinstance(found, xr.DataArray) or found.dims != dataset["status"].dims:
        known = ", ".join(str(name) for name, v in dataset.data_vars.items() if v.dims == dataset["status"].dims)
        raise SweepError(f"there is no output {y!r} with one value per cell; known: {known}")
    values = np.asarray(found.values, float)
    lost = int((~np.isfinite(values)).sum())
    if lost:
        raise SweepError(f"{lost} of {values.size} cells have no value; make the ranges of the axes narrower")

    require_salib()
    from SALib.analyze import morris, sobol

    given = problem(tuple(study.axes))
    if study.design == "saltelli":
        words, told = SOBOL, sobol.analyze(given, values, calc_second_order=False, seed=SEED)
    else:
        # of where cells lie only the order of neighbours counts
        places = np.stack([dataset[name].values for name in study.axes], axis=1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            words, told = MORRIS, morris.analyze(given, places, values, num_levels=LEVELS, seed=SEED)
    indices = {name: ("parameter", np.asarray(told[key], float), {"long_name": t}) for key, (name, t) in words.items()}
    return xr.Dataset(indices, {"parameter": given["names"]}, {"design": study.design})
