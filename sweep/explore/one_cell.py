"""One cell of a result: what it says, why, and what every method of its kernel says of it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Status
from sweep.cells.sample import solved, with_method
from sweep.cells.schema import ERROR_BOUND, METHOD_USED, STATUS
from sweep.cells.solve import usable_methods
from sweep.errors import SweepError
from sweep.results.statuses import flag_words
from sweep.study.model import SETTINGS, Axis, Study, frozen, short
from sweep.words import Table, page, paragraph

if TYPE_CHECKING:
    import xarray as xr


def require_cells(name: str, dataset: xr.Dataset) -> None:
    """Raises SweepError where a Dataset keeps no cells."""
    if STATUS not in dataset:
        raise SweepError(f"sweep {name}: this is a summary, which keeps no cells; run its study without [summary]")


def study_of(cell: xr.Dataset, study: Study) -> Study:
    """The study of one cell of a result, a Dataset without a dimension of the grid, and of the study it came from.

    Raises
    ------
    SweepError
        A parameter's value is no longer there, or stands in another unit.
    """
    fixed = dict[str, Any]()
    for field in study.kernel.parameters:
        name = study.follows.get(field.name, field.name)
        if name not in cell.coords:
            raise SweepError(f"{name}: the dataset has lost this coordinate; take a cell of the result as it was read")
        value: Any = cell[name].values
        if field.choices and value.dtype.kind not in "fiu":
            value = field.choices[str(value)]
        elif cell[name].attrs.get("units", field.unit) != field.unit:
            raise SweepError(f"{name}: stands in another unit; take a cell of the result as it was read")
        fixed[field.name] = frozen(value) if field.dims else float(value)
    first = next(field.name for field in study.kernel.parameters if field.default is None)
    axes = {first: Axis(first, frozen(np.asarray(fixed.pop(first))[None]), "values")}
    plain: dict[str, Any] = {"design": "zip", "blocks": (), "where": "", "summary": None, "follows": {}}
    return dataclasses.replace(
        study, axes=axes, fixed=fixed, **plain, **{name: cell[name].item() for name in SETTINGS if name in study.axes}
    )


@dataclass(frozen=True)
class CellReport:
    """What a result says of one cell, and what each method of the kernel says when it is asked again.

    Attributes
    ----------
    values : dict of str to float
        Outputs that are numbers, in SI units.
    status : Status
    method : str
        That solved the cell, or "none".
    error_bound, rtol : float
        What the values are right to, and what was asked for.
    methods : dict of str to tuple
        Status, error bound and outputs by each method that can do the cell, at the same rtol.
    """

    place: dict[str, str]
    values: dict[str, float]
    units: dict[str, str]
    status: Status
    method: str
    error_bound: float
    rtol: float
    methods: dict[str, tuple[Status, float, dict[str, float]]]

    def __str__(self) -> str:
        outputs = ((name, f"{value:.10g}", self.units[name]) for name, value in self.values.items())
        asked = (
            (name, status.name, f"{error:.2g}", *(f"{values[output]:.10g}" for output in self.values))
            for name, (status, error, values) in self.methods.items()
        )
        headings = ("method", "status", "error", *self.values)
        return page(
            paragraph("cell: " + ", ".join(f"{name} = {value}" for name, value in self.place.items())),
            paragraph(
                f"{self.status.name} ({self.status.kind}): {self.status.doc}\n"
                f"solved by {self.method}; error bound {self.error_bound:.2g}, asked for rtol {self.rtol:g}"
            ),
            Table(outputs, ("output", "value", "unit")).text(),
            Table(asked, headings, "Each method of the kernel, asked now at the same rtol:").text(),
        )


def report_cell(dataset: xr.Dataset, study: Study) -> CellReport:
    """What there is to say of the one cell of a Dataset.

    Raises
    ------
    SweepError
        The Dataset has more cells than one, or none.
    """
    require_cells("cell", dataset)
    longer = {str(dim): n for dim, n in dataset[STATUS].sizes.items() if n != 1}
    if longer:
        axes = ", ".join(f"{dim} ({n} values)" for dim, n in longer.items())
        raise SweepError(f"sweep cell: name one cell; these axes have several values still: {axes}")
    dataset = dataset.squeeze(list(dataset[STATUS].dims)).compute()
    alone = study_of(dataset, study)
    numbers = [name for name in study.outputs if not dataset[name].dims]
    words, again = {int(status): status for status in Status}, {}
    for method in (study.kernel.methods[k].name for k in usable_methods(alone)):
        cells = solved(with_method(alone, method, alone.rtol))
        outputs = {name: float(cells.outputs[name][0]) for name in numbers}
        again[method] = words[int(cells.status[0])], float(cells.error[0]), outputs
    return CellReport(
        {name: _label(dataset[name]) for name in dataset.coords if name in alone.terms or name in study.axes},
        {name: dataset[name].item() for name in numbers},
        {name: dataset[name].attrs.get("units", "") for name in numbers},
        words[dataset[STATUS].item()],
        flag_words(dataset[METHOD_USED])[dataset[METHOD_USED].item()],
        float(dataset[ERROR_BOUND]) if ERROR_BOUND in dataset else np.nan,
        alone.rtol,
        again,
    )


def _label(value: xr.DataArray) -> str:
    """A parameter as people write it, with its unit."""
    if value.dtype.kind not in "fiu":
        return str(value.item())
    unit = value.attrs.get("units", "1")
    return short(value.values) + (f" {unit}" if unit != "1" else "")
