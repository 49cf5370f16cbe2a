"""Solves cells of a result again: one cell by every method; a sample of the OK cells to check their accuracy."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import betaincinv

from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells.sample import relative_error, solved, zipped
from sweep.cells.schema import ERROR_BOUND, METHOD_USED, STATUS
from sweep.cells.solve import GIVEN_UP, among, usable_methods
from sweep.errors import SweepError
from sweep.results.filter import cells_at
from sweep.results.statuses import STATUS_NAMES, cell_text, cell_values, flag_words, require_as_read, statuses_of
from sweep.study.model import SMALLEST_RTOL, Study, short
from sweep.study.read import study as study_of
from sweep.words import Table, page, whole_number

CLOSER = 100.0
"""The second solution has rtol divided by this, or the smallest rtol."""
CONFIDENCE = 0.95
APART, TINY = 0.1, 1e-9
"""Relative deviation, and size relative to the largest state, of a state that is taken as 0 up to rounding."""


class CellReport:
    """One cell of a result, and what each method of the kernel computes for it now.

    Raises SweepError if the Dataset does not have exactly one cell.

    Attributes
    ----------
    place, values, units : dict of str
        Parameters with their units; outputs that are numbers, and their units.
    status, method, error_bound, rtol : Status, str, float, float
        Status of the cell; the method that solved it, or "none"; the error of the values, and the requested one.
    methods, differs : dict of str
        For each method that can solve the cell, at the same rtol: status, error bound and outputs; the largest of
        `deviations`, NaN if all outputs describe how the cell was solved.
    """

    def __init__(self, dataset: xr.Dataset, allow_import: bool) -> None:
        if longer := [f"{dim} ({n} values)" for dim, n in statuses_of(dataset).sizes.items() if n != 1]:
            raise SweepError(f"sweep cell: name one cell; these axes still have several values: {', '.join(longer)}")
        study, cells, columns = again(dataset, [0], allow_import)
        cell, fixed = cells.isel(cell=0), {name: column[0] for name, column in columns.items()}
        self.rtol = float(fixed.pop("rtol"))
        required = (field.name for field in study.kernel.parameters if field.default is None)
        shown, self.place = {*study.terms, *study.axes, *required}, dict[str, str]()
        for name, value in ((str(name), cell[name]) for name in cell.coords if name in shown):
            words, number = flag_words(value), value.dtype.kind in "fiu"
            text = words[value.item()] if words else short(value.values) if number else str(value.item())
            self.place[name] = f"{text} {value.attrs.get('units', '1')}".removesuffix(" 1")
        self.values = {name: cell[name].item() for name in study.outputs if name in cell and not cell[name].dims}
        self.units = {name: cell[name].attrs.get("units", "") for name in self.values}
        name, self.method = (flag_words(cell[words])[cell[words].item()] for words in (STATUS, METHOD_USED))
        self.status = Status[name]
        self.error_bound = cell[ERROR_BOUND].item() if ERROR_BOUND in cell else np.nan
        self.methods, columns = dict[str, tuple[Status, float, dict[str, float]]](), dict[str, Any]()
        part = zipped(study, {"rtol": [self.rtol]}, fixed=fixed, follows={})
        for method in (study.kernel.methods[k].name for k in usable_methods(part)):
            columns[method] = found = solved(replace(part, method=method))
            outputs = {name: float(found[name][0]) for name in self.values}
            self.methods[method] = Status[STATUS_NAMES[int(found[STATUS][0])]], float(found[ERROR_BOUND][0]), outputs
        # of all methods together, which tell whether a state is 0 but for rounding
        by_method = {name: np.concatenate([found[name] for found in columns.values()]) for name in study.outputs}
        off = deviations(study, by_method, cells.isel(cell=[0] * len(columns))).values()
        self.differs = {m: max((float(one[k]) for one in off), default=np.nan) for k, m in enumerate(columns)}

    def __repr__(self) -> str:
        special = "" if self.status is Status.OK else f" ({self.status.kind})"
        rows = [
            ("cell", ", ".join(f"{name} = {value}" for name, value in self.place.items())),
            ("status", f"{self.status.name}{special}: {self.status.doc}"),
            ("solved by", f"{self.method}; error bound {self.error_bound:.2g}, requested rtol {self.rtol:g}"),
        ]
        rows += [(name, f"{value:.10g} {self.units[name]}".removesuffix(" 1")) for name, value in self.values.items()]
        asked = [(k, v[0].name, f"{v[1]:.2g}", f"{self.differs[k]:.2g}") for k, v in self.methods.items()]
        title = "Each method of the kernel at the same rtol, computed now:"
        return page(Table(rows).text(), Table(asked, ("method", "status", "error", "differs by"), title).text())


class Checked:
    """Comparison of some OK cells of a result with a second solution. Raises SweepError if nothing can be compared.

    The second solution is by another method if one reaches rtol, otherwise by the same method.

    Attributes
    ----------
    cells, sample, judged, by_another : int
        Number of OK cells, of sampled cells, of those with a second solution, and of those with one by another method.
    beyond : int
        Judged cells in which an output differs by more than rtol plus the error of the second solution, or for which
        the second method finds no answer.
    left_out : list of str
        States that are 0 up to rounding in every cell.
    limit : float
        Share of all OK cells that may be beyond rtol, at 95 % confidence.
    worst : dict
        The cell that differs most: its parameters, output, both values and their origin (a method, or a status without
        a value), and the difference in units of rtol.
    """

    def __init__(self, dataset: xr.Dataset, sample: int, seed: int, allow_import: bool) -> None:
        whole_number("sample", sample)
        whole_number("seed", seed, least=0)
        ok = np.flatnonzero(statuses_of(dataset).values == Status.OK)
        if not len(ok):
            raise SweepError("no cell is OK, so there is nothing to check")
        drawn = np.sort(np.random.default_rng(seed).choice(ok, min(sample, len(ok)), replace=False))
        study, cells, columns = again(dataset, drawn, allow_import)
        rtol, used, methods = columns["rtol"], cells[METHOD_USED].values, study.kernel.methods
        closer = columns | {"rtol": np.maximum(rtol / CLOSER, SMALLEST_RTOL)}
        # methods that say what they are right to come before others, and a cell's own after all
        order = sorted(methods, key=lambda method: method.bound is None and not method.estimates)
        source, error, values = np.array([""] * len(used), object), np.full(len(used), np.inf), dict[str, Any]()
        another = np.zeros(len(used), bool)
        for others, k in itertools.product((True, False), np.unique(used)):
            some = np.flatnonzero((used == k) & (error > rtol))
            part = zipped(study, {name: column[some] for name, column in closer.items()}, fixed={}, follows={})
            asked = tuple(method for method in order if (method is not methods[k]) == others)
            found = solved(replace(part, kernel=replace(study.kernel, methods=asked), method="auto"))
            # that there is no such answer is an answer, which differs from any value
            status = found[STATUS]
            none = (status >= FIRST_REFUSAL) & ~among(status, GIVEN_UP)
            if others:  # its own numbers may overflow where those of the cell do not
                none &= status != Status.OUT_OF_RANGE
            right = np.where(status <= Status.INACCURATE, found[ERROR_BOUND], np.inf)
            error[some], another[some] = np.where(none, 0.0, right), others
            source[some] = [asked[n].name if n >= 0 else STATUS_NAMES[s] for n, s in np.c_[found[METHOD_USED], status]]
            for name, shape in study.shapes.items():
                values.setdefault(name, np.full((len(used), *shape), np.nan))[some] = found[name]
        off, judged = deviations(study, cells, values), error <= rtol
        if not off:
            raise SweepError("no output can be compared: all describe how a cell was solved, or are 0 up to rounding")
        self.left_out = [f.name for f in study.asked if f.name in cells and f.name not in off and not f.of_method]
        largest = np.max([*off.values()], axis=0)
        self.cells, self.sample, self.judged = len(ok), len(drawn), int(judged.sum())
        self.by_another, self.beyond = (int((judged & some).sum()) for some in (another, largest > rtol + error))
        # the largest share of which so few would be found in so many, by Clopper and Pearson; of all cells, their own
        share = betaincinv(self.beyond + 1, self.judged - self.beyond, CONFIDENCE) if self.beyond < self.judged else 1.0
        self.limit = self.beyond / self.judged if self.judged == self.cells else float(share)
        self.worst = dict[str, Any]()
        if self.judged:
            i = np.where(judged, largest / rtol, -1.0).argmax()
            output = max(off, key=lambda name: off[name][i])
            pair = [np.ravel(some[output][i]) for some in (cells, values)]
            same = (pair[0] == pair[1]) | np.isnan(pair).all(axis=0)  # NaN fills up lists of frequencies
            place = np.argmax(np.where(same, 0.0, abs(pair[0] - pair[1])))
            said = [(methods[used[i]].name, float(pair[0][place])), (source[i], float(pair[1][place]))]
            self.worst = {"cell": cell_values(dataset, int(drawn[i])), "output": output, "values": said}
            self.worst["off"] = float(largest[i] / rtol[i])

    def __repr__(self) -> str:
        rows = [
            ("solved again", f"{self.sample:,} of {self.cells:,} OK cells, to a tolerance down to rtol/{CLOSER:g}"),
            ("by another method", f"{self.by_another:,}"),
            ("by the same", f"{self.judged - self.by_another:,}; an error common to both is not found"),
            ("by none", f"{self.sample - self.judged:,}, which no method solves to rtol again"),
            ("beyond rtol", f"{self.beyond or 'none'} of {self.judged:,}"),
            ("of all OK cells", f"at most {100 * self.limit:.2g} % beyond, with {100 * CONFIDENCE:g} % confidence"),
        ]
        rows += [("left out", f"{', '.join(self.left_out)}: 0 up to rounding")] if self.left_out else []
        if self.worst:
            said = " against ".join(f"{value!r} ({who})" for who, value in self.worst["values"])
            by, cell = f"{self.worst['output']} by {self.worst['off']:.2g} rtol", cell_text(self.worst["cell"])
            rows += [("largest deviation", f"{by}{' at ' if cell else ''}{cell}: {said}")]
        return Table(rows).text()


def again(dataset: xr.Dataset, numbers: Any, allow_import: bool) -> tuple[Study, xr.Dataset, dict[str, Any]]:
    """A result's study, some cells along "cell", and their parameters and rtol as the kernel has them."""
    study, cells = study_of(dataset, allow_import=allow_import), cells_at(dataset, numbers).compute()
    require_as_read(dataset, study, [METHOD_USED])
    columns = {"rtol": np.full(len(numbers), cells.get("rtol", study.rtol))}
    for field in study.kernel.parameters:
        name = study.follows.get(field.name, field.name)
        column = cells[name]
        values = np.vectorize(lambda value, field=field: field.choices.get(value, value), otypes=[float])(column)
        columns[field.name] = values if "cell" in column.dims else np.repeat(values[None], len(numbers), axis=0)
    # beside other states it is seen that a state is 0 but for rounding
    more = (field.name for field in study.kernel.outputs if field.sized and field.name not in study.outputs)
    return replace(study, outputs=(*study.outputs, *more)), cells, columns


def deviations(study: Study, outputs: Any, true: Any) -> dict[str, Any]:
    """Deviation of outputs from others of the same cells, for each cell; infinite where only one is NaN.

    As `OK` defines it: relative to the output itself, to the amplitude of a trace, and for states of a scene to their
    largest value in these cells, since a result does not store their largest size. A state far smaller than another,
    without a common digit in most cells, is 0 up to rounding, and left out; so are outputs that describe how a cell was
    solved, such as a number of steps.
    """
    found, both, sized = dict[str, Any](), (outputs, true), [field.name for field in study.asked if field.sized]
    sizes = {name: [np.nanmax(abs(np.asarray(x[name])), initial=0.0) for x in both if name in x] for name in sized}
    tiny = TINY * max(itertools.chain(*sizes.values()), default=0.0)
    for name in (f.name for f in study.asked if f.name in outputs and f.name in true and not f.of_method):
        values, right = np.asarray(outputs[name]), np.asarray(true[name])
        rounding = name in sizes and max(sizes[name]) <= tiny and np.median(relative_error(values, right)) > APART
        if not rounding:
            found[name] = relative_error(values, right, min(sizes.get(name, [0.0])))
    return found
