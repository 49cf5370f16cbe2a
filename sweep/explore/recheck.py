"""Cells of a result solved again: one of them, by every method; a sample of the OK ones, is each right to its rtol?"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells.grid import Grid
from sweep.cells.sample import relative_error, solved
from sweep.cells.schema import ERROR_BOUND, METHOD_USED, STATUS
from sweep.cells.solve import GIVEN_UP, among, turns
from sweep.errors import SweepError
from sweep.results.statuses import cell_values, flag_words
from sweep.study.model import SMALLEST_RTOL, Axis, Study, frozen, short
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


def study_of(cells: xr.Dataset, study: Study) -> Study:
    """A zip of cells of a result, those along "cell", by all parameters and rtol, from the study that they came from.

    Raises
    ------
    SweepError
        A parameter's value is no longer there, or stands in another unit.
    """
    columns, size = dict[str, Any](), cells[STATUS].size
    for field in study.kernel.parameters:
        name = study.follows.get(field.name, field.name)
        if name not in cells.coords:
            raise SweepError(f"{name}: the dataset has lost this coordinate; take a cell of the result as it was read")
        values: Any = cells[name].values
        if field.choices and values.dtype.kind not in "fiu":
            values = np.vectorize(field.choices.get, otypes=[float])(values)
        elif cells[name].attrs.get("units", field.unit) != field.unit:
            raise SweepError(f"{name}: stands in another unit; take a cell of the result as it was read")
        columns[field.name] = values if "cell" in cells[name].dims else np.broadcast_to(values, (size, *values.shape))
    columns["rtol"] = np.full(size, cells["rtol"].values if "rtol" in study.axes else study.rtol)
    axes = {name: Axis(name, frozen(values), "values") for name, values in columns.items()}
    return replace(study, axes=axes, fixed={}, follows={}, design="zip", blocks=(), where="", summary=None)


def able(study: Study) -> dict[int, Any]:
    """The methods that can do some of a study's cells, of which all parameters are axes, and whether each can."""
    *columns, rtol = (axis.values for axis in study.axes.values())
    turned = (turn for turn in turns(study, Grid(study)) if not turn.early)
    return {t.number: np.all([rtol > 0, *(term.holds(columns) for term in t.absent)], axis=0) for t in turned}


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
    differs : dict of str to float
        The largest relative difference of each method's outputs from `values`, NaN where only one is NaN. Outputs that
        say how a cell was solved, such as a number of steps, are left out; {} where only these or traces are there.
    """

    place: dict[str, str]
    values: dict[str, float]
    units: dict[str, str]
    status: Status
    method: str
    error_bound: float
    rtol: float
    methods: dict[str, tuple[Status, float, dict[str, float]]]
    differs: dict[str, float]

    def __str__(self) -> str:
        special = "" if self.status is Status.OK else f" ({self.status.kind})"
        outputs = ((name, f"{value:.10g}", self.units[name]) for name, value in self.values.items())
        headings = ("method", "status", "error", *["differs by"] * bool(self.differs))
        off = {name: (f"{share:.2g}",) for name, share in self.differs.items()}
        asked = [(k, status.name, f"{error:.2g}", *off.get(k, ())) for k, (status, error, _) in self.methods.items()]
        return page(
            paragraph("cell: " + ", ".join(f"{name} = {value}" for name, value in self.place.items())),
            paragraph(
                f"{self.status.name}{special}: {self.status.doc}\n"
                f"solved by {self.method}; error bound {self.error_bound:.2g}, requested rtol {self.rtol:g}"
            ),
            Table(outputs, ("output", "value", "unit")).text(),
            Table(asked, headings, "Each method of the kernel at the same rtol, computed now:").text(),
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
    cell = dataset.squeeze(list(dataset[STATUS].dims)).compute()
    again = study_of(cell.expand_dims("cell"), study)
    values = {name: cell[name].item() for name in study.outputs if not cell[name].dims}
    compared = [field.name for field in study.asked if field.name in values and not field.of_method]
    words, methods, differs = {int(status): status for status in Status}, {}, dict[str, float]()
    for method in (study.kernel.methods[k].name for k, can in able(again).items() if can):
        found = solved(replace(again, method=method))
        outputs = {name: float(found.outputs[name][0]) for name in values}
        methods[method] = words[int(found.status[0])], float(found.error[0]), outputs
        if compared:
            pair = np.array([[some[name] for name in compared] for some in (outputs, values)])
            if ":" in study.kernel_name:
                pair[abs(pair) <= NOTHING] = 0.0
            off = np.where(np.isnan(pair).sum(axis=0) == 1, np.nan, relative_error(*pair))
            differs[method] = float(off.max())
    shown = {*study.terms, *study.axes, *(field.name for field in study.kernel.parameters if field.default is None)}
    place = dict[str, str]()
    for name, value in ((name, cell[name]) for name in cell.coords if name in shown):
        unit = value.attrs.get("units", "1")
        text = short(value.values) if value.dtype.kind in "fiu" else str(value.item())
        place[str(name)] = text if unit == "1" else f"{text} {unit}"
    return CellReport(
        place,
        values,
        {name: cell[name].attrs.get("units", "") for name in values},
        words[cell[STATUS].item()],
        flag_words(cell[METHOD_USED])[cell[METHOD_USED].item()],
        float(cell[ERROR_BOUND]) if ERROR_BOUND in cell else np.nan,
        float(again.axes["rtol"].values[0]),
        methods,
        differs,
    )


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
    again = study_of(cells, study)
    rtol, (by, error, values) = again.axes["rtol"].values, _second_opinions(again, used)

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


def _second_opinions(study: Study, used: Any) -> tuple[Any, Any, dict[str, Any]]:
    """Of cells that some methods solved: the numbers of methods that solve them closely, their errors, and outputs.

    The number is -1 where no method does. Outputs are NaN, and differ from any value, where a method finds that the
    scene has no such answer.
    """
    methods, size, rtol = study.kernel.methods, len(used), study.axes["rtol"].values
    closer = study.axes | {"rtol": Axis("rtol", np.maximum(rtol / CLOSER, SMALLEST_RTOL), "values")}
    by, error, settled = np.full(size, -1), np.full(size, np.nan), np.zeros(size, bool)
    values = {name: np.full((size, *shape), np.nan) for name, shape in study.shapes.items()}
    # methods that say what they are right to come before others, and a cell's own after all
    order = sorted(able(study).items(), key=lambda k: methods[k[0]].bound is None and not methods[k[0]].estimates)
    for own, (k, can) in itertools.product((False, True), order):
        some = np.flatnonzero(can & ~settled & ((used == k) == own))
        if not len(some):
            continue
        axes = {name: replace(axis, values=frozen(axis.values[some])) for name, axis in closer.items()}
        again = solved(replace(study, axes=axes, method=methods[k].name))
        void = (again.status >= FIRST_REFUSAL) & ~among(again.status, GIVEN_UP)
        known = np.where(void, 0.0, np.where(again.status <= Status.INACCURATE, again.error, np.inf))
        settled[some] = known <= rtol[some] / GOOD
        taken = settled[some] | ((known <= rtol[some]) & (by[some] < 0))
        by[some[taken]], error[some[taken]] = k, known[taken]
        for name, column in again.outputs.items():
            values[name][some[taken]] = column[taken]
    return by, error, values
