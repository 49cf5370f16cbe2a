"""What a Dataset of a sweep can do by itself: `ds.sweep`, and results for `xarray.open_dataset`.

xarray imports this module when it first looks for engines to open a file with, so that `ds.sweep` is there also where
`sweep` was never imported.
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
    """Look at a result, in one line each.

    Works on a Dataset of `sweep.run` and `sweep.open_result`, on one that `xarray.open_dataset` read from such a file,
    and on parts of these. `allow_import` allows a kernel named "module:NAME", whose module is imported.

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
        """The figure of one output: as `sweep.plot`, logarithmic along axes whose grid is."""
        return sweep.plot(self._dataset, path, **keys)

    def in_units(self, units: Mapping[str, str] | None = None, **more: str) -> xr.Dataset:
        """The Dataset with some variables in other units: as `sweep.in_units`, e.g. `A0="degree"`."""
        return sweep.in_units(self._dataset, {**(units or {}), **more})

    def where(self, condition: str) -> xr.Dataset:
        """The cells for which a condition holds: as `sweep.where`."""
        return sweep.where(self._dataset, condition)

    def fit(self, y: str, x: str, **options: Any) -> xr.Dataset:
        """The exponent of an output along an axis, of cells that have values: as `sweep.fit_exponent`."""
        from sweep.show.laws import output_of

        return sweep.fit_exponent(self._dataset[output_of(self._dataset, y)], x, **options)

    def statuses(self) -> Table:
        """How many cells have each status, what it says, and where: as `sweep show`."""
        from sweep.show.text import status_table

        return status_table(self._dataset)

    def cell(self, *, allow_import: bool = False, **values: float | str) -> CellReport:
        """What there is to say of one cell, named by the values of its axes: as the command `sweep cell`."""
        from sweep.explore.recheck import CellReport
        from sweep.show.laws import pick

        return CellReport(pick(self._dataset, [f"{name}={value}" for name, value in values.items()]), allow_import)

    def check(self, sample: int = 200, seed: int = 0, *, allow_import: bool = False) -> Checked:
        """Solve some OK cells, so many at most, again by another method and compare: as the command `sweep check`."""
        from sweep.explore.recheck import Checked

        return Checked(self._dataset, sample, seed, allow_import)


class SweepEngine(BackendEntrypoint):
    """`xarray.open_dataset("foliot.h5", engine="sweep")`: as `sweep.open_result`, with its checks and dask chunks."""

    description = "Results of foliot, finished or not"

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: Any = ()) -> xr.Dataset:
        """The result, without the variables that are to be dropped."""
        return sweep.open_result(filename_or_obj).drop_vars(drop_variables or ())
