"""Results in the units people use: degree for rad, mm for m, mm/hour for m/s."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from typing import TYPE_CHECKING

from sweep.errors import SweepError
from sweep.study.mistakes import Mistakes
from sweep.units import UnitMistake, scale
from sweep.words import did_you_mean, kind, require_dataset

if TYPE_CHECKING:
    import xarray as xr


def in_units(dataset: xr.Dataset, units: Mapping[str, str]) -> xr.Dataset:
    """Convert some outputs, parameters or coordinates to other units, which become their `units` attribute.

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`.
    units : mapping of name to unit
        {"A0": "degree", "e": "mm", "wear": "mm/hour"}

    Raises
    ------
    StudyError
        A name is unknown, or a unit measures something else; all mistakes are listed.

    Examples
    --------
    >>> import sweep
    >>> study = sweep.study(kernel="foliot", axes={"mu": [0.1]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> sweep.in_units(sweep.run(study), {"amplitude": "degree"}).amplitude.attrs["units"]
    'degree'
    """
    require_dataset("in_units", dataset)
    if not isinstance(units, Mapping):
        raise SweepError(f'units: expected a mapping of names to units, e.g. {{"A0": "degree"}}; found {kind(units)}')
    mistakes, found = Mistakes(), {}
    for name, unit in units.items():
        if name not in dataset.variables:
            mistakes.add(str(name), f"the result has no such variable{did_you_mean(name, map(str, dataset.variables))}")
        elif "units" not in dataset[name].attrs or dataset[name].dtype.kind != "f":
            mistakes.add(name, "has words or counts, which have no unit")
        elif not isinstance(unit, str):
            mistakes.add(name, f'expected a unit, e.g. "mm", found {kind(unit)}')
        else:
            try:
                old = dataset[name]
                factor = float(1 / (scale(unit, old.attrs["units"], name) or Decimal(1)))
                found[name] = (old.dims, (old * factor).data, {**old.attrs, "units": unit})
            except UnitMistake as error:
                mistakes.add(name, str(error))
    mistakes.raise_if_any("units")
    return dataset.assign(found)
