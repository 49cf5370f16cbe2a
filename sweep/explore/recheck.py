"""Cells of a result solved again: one of them, by every method; a sample of the OK ones, is each right to its rtol?"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells.sample import relative_error, solved, with_method
from sweep.cells.schema import ERROR_BOUND, METHOD_USED, STATUS
from sweep.cells.solve import GIVEN_UP, among, usable_methods
from sweep.errors import SweepError
from sweep.results.statuses import cell_values, flag_words
from sweep.study.model import SETTINGS, SMALLEST_RTOL, Axis, Study, frozen, short
from sweep.words import Table, page, paragraph

CLOSER = 100.0
"""A second opinion is asked for at rtol over this, or at the smallest rtol."""
GOOD = 10.0
"""Its own error is to be below rtol over this, or where none is, below rtol."""
CONFIDENCE = 0.95
NOTHING = 1e-12
"""A state of a scene that is nowhere larger at its switches, in SI, lies on the surface and is 0 to rounding."""


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
    first = min(study.kernel.parameters, key=lambda field: field.default is not None).name  # a required one, if any
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
        Error of the values, and the accuracy that the study asks for.
    methods : dict of str to tuple
        Status, error bound and outputs by each method that can do the cell, at the same rtol.
    of_method : tuple of str
        Outputs that say how a cell was solved, such as a number of steps, in which methods differ anyway.
    nothing : float
        What is not larger by two methods is the same: of a scene of one's own, what is 0 to rounding.
    """

    place: dict[str, str]
    values: dict[str, float]
    units: dict[str, str]
    status: Status
    method: str
    error_bound: float
    rtol: float
    methods: dict[str, tuple[Status, float, dict[str, float]]]
    of_method: tuple[str, ...] = ()
    nothing: float = 0.0

    def __str__(self) -> str:
        outputs = ((name, f"{value:.10g}", self.units[name]) for name, value in self.values.items())
        width = 4 if self.values.keys() - set(self.of_method) else 3  # traces are not compared
        asked = (
            (name, status.name, f"{error:.2g}", f"{self._apart(values):.2g}")[:width]
            for name, (status, error, values) in self.methods.items()
        )
        headings = ("method", "status", "error", "differs by")[:width]
        return page(
            paragraph("cell: " + ", ".join(f"{name} = {value}" for name, value in self.place.items())),
            paragraph(
                f"{self.status.name}{'' if self.status is Status.OK else f' ({self.status.kind})'}: {self.status.doc}\n"
                f"solved by {self.method}; error bound {self.error_bound:.2g}, requested rtol {self.rtol:g}"
            ),
            Table(outputs, ("output", "value", "unit")).text(),
            Table(asked, headings, "Each method of the kernel at the same rtol, computed now:").text(),
        )

    def _apart(self, values: dict[str, float]) -> float:
        """The largest relative difference of a method's outputs from those above; NaN where only one is NaN."""
        off = [0.0]
        for name in self.values.keys() - set(self.of_method):
            pair = np.array([values[name], self.values[name]])
            pair[abs(pair) <= self.nothing] = 0.0
            off.append(np.nan if np.isnan(pair).sum() == 1 else float(relative_error(pair[:1], pair[1:])[0]))
        return float(np.max(off))


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
    required = [field.name for field in study.kernel.parameters if field.default is None]
    for method in (study.kernel.methods[k].name for k in usable_methods(alone)):
        cells = solved(with_method(alone, method, alone.rtol))
        outputs = {name: float(cells.outputs[name][0]) for name in numbers}
        again[method] = words[int(cells.status[0])], float(cells.error[0]), outputs
    return CellReport(
        {name: _label(dataset[name]) for name in dataset.coords if name in {*alone.terms, *required, *study.axes}},
        {name: dataset[name].item() for name in numbers},
        {name: dataset[name].attrs.get("units", "") for name in numbers},
        words[dataset[STATUS].item()],
        flag_words(dataset[METHOD_USED])[dataset[METHOD_USED].item()],
        float(dataset[ERROR_BOUND]) if ERROR_BOUND in dataset else np.nan,
        alone.rtol,
        again,
        tuple(field.name for field in study.asked if field.of_method),
        NOTHING if ":" in study.kernel_name else 0.0,
    )


def _label(value: xr.DataArray) -> str:
    """A parameter as people write it, with its unit."""
    if value.dtype.kind not in "fiu":
        return str(value.item())
    unit = value.attrs.get("units", "1")
    return short(value.values) + (f" {unit}" if unit != "1" else "")


@dataclass(frozen=True)
class Checked:
    """What came of solving a sample of OK cells again.

    Attributes
    ----------
    cells, sample, judged : int
        OK cells of the result, those drawn, and those for which there was a second opinion.
    by_another : int
        Judged cells whose second opinion came from another method.
    beyond : int
        Judged cells in which an output differs by more than rtol and the error of the second opinion, or of which the
        second opinion is that there is no such answer.
    limit : float
        Share of all OK cells that may be beyond rtol, at 95 % confidence.
    worst : dict
        The cell that differs most: its place, output, both values and methods, and the difference in units of rtol.
    """

    cells: int
    sample: int
    judged: int
    by_another: int
    beyond: int
    limit: float
    worst: dict[str, Any]

    def __str__(self) -> str:
        same = self.judged - self.by_another
        lines = [
            f"{self.sample:,} of {self.cells:,} OK cells solved again, to a tolerance down to rtol/{CLOSER:g}: "
            f"{self.by_another:,} by another method, {same:,} by the same"
            + (" (which cannot find an error that both have in common)" if same else "")
        ]
        if self.judged < self.sample:
            lines.append(f"not judged: {self.sample - self.judged:,}, which no method solves to rtol again")
        if self.judged:
            found = f"{self.beyond:,} of {self.judged:,}" if self.beyond else "none"
            share = f"; of all OK cells at most {100 * self.limit:.2g} %, with {100 * CONFIDENCE:g} % confidence"
            lines.append(f"beyond rtol: {found}{share if self.judged < self.cells else ''}")
        if self.worst:
            place = ", ".join(f"{name} = {value}" for name, value in self.worst["cell"].items())
            (name, value), (other, again) = self.worst["values"]
            lines.append(
                f"largest deviation: {self.worst['output']} by {self.worst['off']:.2g} rtol at {place}: "
                f"{value:.12g} by {name}, {again:.12g} by {other}"
            )
        return "\n".join(lines)


def check(dataset: xr.Dataset, study: Study, sample: int = 200, seed: int = 0) -> Checked:
    """Solve some OK cells of a result again, and compare.

    The second opinion is another method's wherever one gets to a tenth of rtol; else the same method's, far more
    closely. Outputs are compared as `OK` promises: relative to themselves, traces to their amplitude, and the states of
    a scene of one's own to their largest value in the sample, since a result does not keep their size on the way; a
    state that the surface holds at 0 is left out.

    Parameters
    ----------
    dataset : Dataset
        Of cells, as they were read or any part of them.
    study : Study
        What it came from.
    sample, seed : int
        How many cells, and which.

    Raises
    ------
    SweepError
        The result is a summary or has no OK cell; `sample` is below 1.
    """
    from scipy.stats import beta

    require_cells("check", dataset)
    if sample < 1:
        raise SweepError(f"sample: expected 1 or more, found {sample}")
    ok = np.flatnonzero(dataset[STATUS].values.ravel() == Status.OK)
    if not len(ok):
        raise SweepError("no cell is OK, so there is nothing to check")
    drawn = np.sort(np.random.default_rng(seed).choice(ok, min(sample, len(ok)), replace=False))
    places = zip(dataset[STATUS].dims, np.unravel_index(drawn, dataset[STATUS].shape), strict=True)
    cells = dataset.isel({dim: xr.DataArray(place, dims="cell") for dim, place in places}).compute()
    cells = cells.transpose("cell", ...)
    used, methods = cells[METHOD_USED].values, [method.name for method in study.kernel.methods]
    rtol = cells["rtol"].values if "rtol" in study.axes else np.full(len(drawn), study.rtol)
    by, error = np.full(len(drawn), -1), np.full(len(drawn), np.nan)
    values = {field.name: np.full(cells[field.name].shape, np.nan) for field in study.asked}
    for i in range(len(drawn)):
        by[i], error[i], outputs = _second_opinion(study_of(cells.isel(cell=i), study), used[i])
        for name, value in outputs.items():
            values[name][i] = value

    judged, own = by >= 0, ":" in study.kernel_name
    sizes = {field.name: float(abs(cells[field.name]).max()) if own else 0.0 for field in study.asked}
    compared = [f.name for f in study.asked if not f.of_method and (not own or sizes[f.name] > NOTHING)]
    off = np.stack([relative_error(cells[name].values, values[name], sizes[name]) for name in compared])
    beyond, number = int((judged & (off.max(axis=0) > rtol + error)).sum()), int(judged.sum())
    worst = dict[str, Any]()
    if number:
        i = int(np.where(judged, off.max(axis=0) / rtol, -1.0).argmax())
        output = compared[off[:, i].argmax()]
        value, again = cells[output].values[i], values[output][i]
        place = np.unravel_index(np.argmax(abs(value - again)), again.shape)
        worst = {
            "cell": cell_values(dataset, int(drawn[i])),
            "output": output,
            "values": ((methods[used[i]], value[place].item()), (methods[by[i]], again[place].item())),
            "off": float(off[:, i].max() / rtol[i]),
        }
    by_another = int((judged & (by != used)).sum())
    # the largest share of which so few would be found in so many, by Clopper and Pearson; of all cells, their own
    share = float(beta.ppf(CONFIDENCE, beyond + 1, number - beyond)) if beyond < number else 1.0
    limit = beyond / number if number == len(ok) else share
    return Checked(len(ok), len(drawn), number, by_another, beyond, limit, worst)


def _second_opinion(cell: Study, own: int) -> tuple[int, float, dict[str, Any]]:
    """The number of a method that solves a cell closely, what it is right to, and its outputs; -1 where none does.

    `own` is the method that solved it. Outputs are NaN, and differ from any value, where a method finds that the scene
    has no such answer.
    """
    methods, tried = cell.kernel.methods, dict[int, Any]()
    # the cell's own method comes last, and those that say what they are right to before the others
    vague = [method.bound is None and not method.estimates for method in methods]
    order = sorted(usable_methods(cell), key=lambda k: (k == own, vague[k]))
    for good, k in itertools.product((GOOD, 1.0), order):
        if k not in tried:
            tried[k] = solved(with_method(cell, methods[k].name, max(cell.rtol / CLOSER, SMALLEST_RTOL)))
        again, status = tried[k], int(tried[k].status[0])
        none = status >= FIRST_REFUSAL and not among(again.status, GIVEN_UP)[0]
        error = 0.0 if none else float(again.error[0])
        if none or (status in (Status.OK, Status.INACCURATE) and error <= cell.rtol / good):
            return k, error, {name: column[0] for name, column in again.outputs.items()}
    return -1, np.nan, {}
