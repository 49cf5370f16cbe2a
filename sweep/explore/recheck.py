"""A sample of a result's OK cells, solved again by another method or far more closely: is each right to its rtol?"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells.sample import relative_error, solved, with_method
from sweep.cells.schema import METHOD_USED, STATUS
from sweep.cells.solve import GIVEN_UP, among
from sweep.cells.turns import usable_methods
from sweep.errors import SweepError
from sweep.explore.one_cell import cell_study, require_cells, together
from sweep.results.statuses import cell_values
from sweep.study.model import SMALLEST_RTOL, Study

if TYPE_CHECKING:
    import xarray as xr

CLOSER = 100.0
"""A second opinion is asked for at rtol over this, or at the smallest rtol."""
GOOD = 10.0
"""Its own error is to be below rtol over this, or where none is, below rtol."""
CONFIDENCE = 0.95
NOTHING = 1e-12
"""A state of a scene that is nowhere larger at its switches, in SI, lies on the surface and is 0 to rounding."""


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
            f"{self.sample:,} of {self.cells:,} OK cells solved again, up to {CLOSER:g} times as closely: "
            f"{self.by_another:,} by another method, {same:,} by the same"
            + (" (which does not see a fault that both runs have)" if same else "")
        ]
        if self.judged < self.sample:
            lines.append(f"not judged: {self.sample - self.judged:,}, which no method solves to rtol once more")
        if self.judged:
            found = f"{self.beyond:,} of {self.judged:,}" if self.beyond else "none"
            share = f"; of all OK cells at most {100 * self.limit:.2g} %, with {100 * CONFIDENCE:g} % confidence"
            lines.append(f"beyond rtol: {found}{share if self.judged < self.cells else ''}")
        if self.worst:
            place = ", ".join(f"{name} = {value}" for name, value in self.worst["cell"].items())
            (name, value), (other, again) = self.worst["values"]
            lines.append(
                f"farthest off: {self.worst['output']} by {self.worst['off']:.2g} rtol at {place}: "
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
    require_cells("check", dataset)
    if sample < 1:
        raise SweepError(f"sample: expected 1 or more, found {sample}")
    ok = np.flatnonzero(dataset[STATUS].values.ravel() == Status.OK)
    if not len(ok):
        raise SweepError("no cell is OK, so there is nothing to check")
    drawn = np.sort(np.random.default_rng(seed).choice(ok, min(sample, len(ok)), replace=False))
    places = np.transpose(np.unravel_index(drawn, dataset[STATUS].shape))
    cells = [dataset.isel(dict(zip(dataset[STATUS].dims, place, strict=True))).compute() for place in places]
    alone = [cell_study(cell, study) for cell in cells]
    used = [study.kernel.methods[cell[METHOD_USED].item()].name for cell in cells]
    compared = [field.name for field in study.asked if not field.of_method]
    own = ":" in study.kernel_name
    sizes = {name: max(float(abs(cell[name]).max()) for cell in cells) if own else 0.0 for name in compared}
    compared = [name for name in compared if not own or sizes[name] > NOTHING]
    beyond, worst = 0, dict[str, Any]()
    opinions = _second_opinions(alone, used)
    for i, (other, error, values) in opinions.items():
        off = {
            name: float(relative_error(cells[i][name].values[None], values[name][None], sizes[name])[0])
            for name in compared
        }
        output = max(off, key=lambda name: off[name])
        beyond += off[output] > alone[i].rtol + error
        if not worst or off[output] / alone[i].rtol > worst["off"]:
            value, again = cells[i][output].values, values[output]
            place = np.unravel_index(np.argmax(abs(value - again)), again.shape)
            worst = {
                "cell": cell_values(dataset, int(drawn[i])),
                "output": output,
                "values": ((used[i], value[place].item()), (other, again[place].item())),
                "off": off[output] / alone[i].rtol,
            }
    by_another = sum(other != used[i] for i, (other, *_) in opinions.items())
    limit = _limit(beyond, len(opinions), len(ok))
    return Checked(len(ok), len(drawn), len(opinions), by_another, beyond, limit, worst)


def _second_opinions(alone: Sequence[Study], used: Sequence[str]) -> dict[int, tuple[str, float, dict[str, Any]]]:
    """By cell: a method, what it is right to, and its outputs; none of cells that no method solves closely enough.

    Where a method finds that the scene has no such answer, the outputs are NaN, and differ from any value.
    """
    able = [[study.kernel.methods[k].name for k in usable_methods(study)] for study in alone]
    # those that say what they are right to come first, and the method that solved a cell last
    methods = sorted(alone[0].kernel.methods, key=lambda m: m.bound is None and not m.estimates)
    turns = itertools.product((GOOD, 1.0), (False, True), (method.name for method in methods))
    found: dict[int, tuple[str, float, dict[str, Any]]] = {}
    for good, last, name in turns:
        for rtol in {study.rtol for study in alone}:
            todo = [
                i
                for i, study in enumerate(alone)
                if i not in found and study.rtol == rtol and name in able[i] and (name == used[i]) == last
            ]
            if not todo:
                continue
            closer = max(rtol / CLOSER, SMALLEST_RTOL)
            cells = solved(with_method(together([alone[i] for i in todo]), name, closer))
            none = (cells.status >= FIRST_REFUSAL) & ~among(cells.status, GIVEN_UP)
            for row, i in enumerate(todo):
                status, error = cells.status[row], 0.0 if none[row] else float(cells.error[row])
                if none[row] or (status in (Status.OK, Status.INACCURATE) and error <= rtol / good):
                    found[i] = name, error, {output: column[row] for output, column in cells.outputs.items()}
    return found


def _limit(beyond: int, judged: int, cells: int) -> float:
    """The largest share of which so few would be found in so many, by Clopper and Pearson; of all cells, their own."""
    from scipy.stats import beta

    if judged == cells:
        return beyond / cells
    return float(beta.ppf(CONFIDENCE, beyond + 1, judged - beyond)) if beyond < judged else 1.0
