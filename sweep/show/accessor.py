"""The accessor `ds.sweep` of xarray Datasets, and the engine for `xarray.open_dataset`.

xarray imports this module when it first opens a file, so that `ds.sweep` exists even if `sweep` was never imported.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import xarray as xr
from xarray.backends import BackendEntrypoint

import sweep

if TYPE_CHECKING:
    from sweep.explore.recheck import CellReport, Checked
    from sweep.words import Table


@xr.register_dataset_accessor("sweep")  # type: ignore[no-untyped-call]
class SweepAccessor:
    """Examine a result, by one call each.

    Works on a Dataset from `sweep.run`, `sweep.open_result` or `xarray.open_dataset`, and on parts of it.
    `allow_import` allows a kernel named "module:NAME", whose module is imported.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> ds.sweep.where("mu > 0.7").sizes["cell"]
    2
    >>> figure = ds.sweep.plot(y="amplitude")
    >>> ds.sweep
      cells  status  kind  meaning, and where
      3      OK      ok    accurate to rtol
    <BLANKLINE>
    ds.sweep has: plot, in_units, where, fit, statuses, cell, check
    >>> ds.sweep.check().beyond
    0
    >>> ds.sweep.cell(mu=2.0).method
    'closed'
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def __repr__(self) -> str:
        """What `ds.sweep` prints: the table of statuses, if there are any, and what else can be asked."""
        names = ", ".join(name for name in vars(type(self)) if not name.startswith("_"))
        try:
            counted = f"{self.statuses()}\n\n"
        except sweep.SweepError:  # it has none that can be counted
            counted = ""
        return f"{counted}ds.sweep has: {names}"

    def plot(self, path: str | os.PathLike[str] | None = None, **keys: Any) -> Any:
        """Plot one output, see `sweep.plot`; returns a matplotlib figure, and saves it to `path`."""
        return sweep.plot(self._dataset, path, **keys)

    def in_units(self, units: Mapping[str, str] | None = None, **more: str) -> xr.Dataset:
        """Convert some variables to other units, e.g. `A0="degree"`; see `sweep.in_units`."""
        return sweep.in_units(self._dataset, {**(units or {}), **more})

    def where(self, condition: str) -> xr.Dataset:
        """Select the cells that satisfy a condition; see `sweep.where`."""
        return sweep.where(self._dataset, condition)

    def fit(self, y: str, x: str, **options: Any) -> xr.Dataset:
        """Fit the exponent of an output along an axis, over cells that have values; see `sweep.fit_exponent`."""
        from sweep.show.laws import output_of

        return sweep.fit_exponent(self._dataset[output_of(self._dataset, y)], x, **options)

    def statuses(self) -> Table:
        """Table of statuses: number of cells, meaning, and where they occur; as in `sweep show`."""
        from sweep.show.text import status_table

        return status_table(self._dataset)

    def cell(self, *, allow_import: bool = False, **values: float | str) -> CellReport:
        """Describe one cell, given by the values of its axes; as the command `sweep cell`."""
        from sweep.explore.recheck import CellReport
        from sweep.show.laws import pick

        return CellReport(pick(self._dataset, [f"{name}={value}" for name, value in values.items()]), allow_import)

    def check(self, sample: int = 200, seed: int = 0, *, allow_import: bool = False) -> Checked:
        """Solve a random sample of the OK cells again by another method and compare; as `sweep check`."""
        from sweep.explore.recheck import Checked

        return Checked(self._dataset, sample, seed, allow_import)


class SweepEngine(BackendEntrypoint):
    """`xarray.open_dataset("foliot.h5", engine="sweep")`: as `sweep.open_result`, with its checks and dask chunks."""

    description = "Results of foliot, finished or not"

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: Any = ()) -> xr.Dataset:
        """The result, without the variables to drop."""
        return sweep.open_result(filename_or_obj).drop_vars(drop_variables or ())
