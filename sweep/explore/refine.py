"""Cells where they are needed: a finished sweep refined until straight lines between cells are accurate to a tolerance.

What is there is judged first: the cells around tell how far straight lines between neighbours are off. Where that is
too much, and across a border between statuses, cells are put between them (`refiner`). Errors are those of logarithms
where values are positive, as a scaling law wants it; elsewhere they are relative to the largest value.

Cells of one axis are a sweep over its values like any other. Cells of more axes lie anywhere, as those of a zip design.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Status
from sweep.cells.schema import ANCILLARY, STATUS, cell_schema
from sweep.errors import SweepError
from sweep.explore.mesh import Array
from sweep.explore.refiner import SAME, Refiner
from sweep.explore.scattered import MOST_AXES, REFINED_TO, axes_of
from sweep.file import disk
from sweep.file.open import in_memory
from sweep.file.overwriting import check_target
from sweep.runs.run import run, store_cells
from sweep.study.model import Axis, Study, frozen
from sweep.study.read import study as as_study
from sweep.words import as_path, require_dataset

if TYPE_CHECKING:
    import xarray as xr

MOST_CELLS = 1_000_000


@dataclass(frozen=True)
class Refinement:
    """What came of it.

    Attributes
    ----------
    dataset : Dataset
        All cells, the first ones and those added, in rising order: along the axis, or of several along `cell`.
    added : int
        Cells beyond the first ones.
    uniform : int
        Cells of an even grid as fine as the finest step.
    error : float
        Largest error left of straight lines between cells, relative, as the cells around tell it; not across borders
        of statuses, nor in `jumps` and `singular`.
    tolerance : float
    complete : bool
        Whether the tolerance is met; not so where `most_cells` ran out, an output jumps, goes to infinity or is noisy.
    jumps : int
        Places where the tolerance is not met although edges are cut as often as is allowed, or cuts lessen nothing.
    singular : int
        Likewise, as near borders of statuses as these are known, where values go to infinity or bend without end.
    unseen : dict of str to str
        How far apart cells are along each axis, at most: nothing tells of a peak narrower than that.
    noise : float
        How far values scatter, relative, where more cells do not lessen that, so that none were added; 0 where they do.
    """

    dataset: xr.Dataset
    added: int
    uniform: int
    error: float
    tolerance: float
    complete: bool
    jumps: int
    singular: int
    unseen: dict[str, str]
    noise: float = 0.0

    def __str__(self) -> str:
        text = f"{self.dataset[STATUS].size:,} cells, {self.added:,} of them added"
        if len(self.unseen) == 1:
            text += f"; an even grid as fine has {self.uniform:,}"
        text += f"\ninterpolation error left: {self.error:.2g}, as the cells around tell"
        if self.noise:
            text += f"; values scatter by {self.noise:.1g} of their size from cell to cell, or bend within less than "
            text += "the distance of cells, and more cells do not lessen that"
        elif self.error > self.tolerance:
            text += "; the tolerance is not met everywhere, allow more cells"
        if self.jumps:
            text += f"; not in {self.jumps:,} place{'s' * (self.jumps > 1)} where it jumps or diverges"
        if self.singular:
            text += f"; not in the {self.singular:,} nearest a border of statuses, where values diverge"
        apart = ", ".join(f"{width} in {name}" for name, width in self.unseen.items())
        return f"{text}\ncells are up to {apart} apart; a peak narrower than that is not seen"


def refine(
    dataset: xr.Dataset,
    y: str | Sequence[str],
    tolerance: float,
    *,
    path: str | os.PathLike[str] | None = None,
    study: Study | None = None,
    most_cells: int = MOST_CELLS,
    workers: int | None = None,
    force: bool = False,
    isolate: bool = False,
    cell_timeout: float | str | None = None,
) -> Refinement:
    """Add cells to a finished sweep until outputs can be interpolated to a tolerance.

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`, of a product of at most five number axes; or refined before.
    y : str or sequence of str
        Outputs, one value a cell.
    tolerance : float
        Relative error of the interpolation.
    path : path, optional
        Where all cells are written at the end, an HDF5 file as of `run`; the rounds on the way are kept beside it until
        then, and the same call continues after the last of them. None: in memory.
    study : Study, optional
        That of the dataset; default: the one in its attributes.
    most_cells : int
        Largest number of cells altogether.
    workers, isolate, cell_timeout
        As of `run`.
    force : bool
        Overwrite what is at `path`, and give up the rounds of an earlier call.

    Raises
    ------
    SweepError
        The dataset is not a finished product of number axes, and was not refined before; an output does not exist or
        has a coordinate of its own; `path` is there already, or cannot be written.

    Examples
    --------
    >>> import sweep
    >>> keys = {"outputs": ["period"], "axes": {"mu": [0.1, 0.3, 1.0, 3.0, 10.0]}, "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(kernel="foliot", **keys)
    >>> sweep.refine(ds, "period", 1e-3).complete
    True
    """
    require_dataset("refine", dataset)
    study = study or as_study(dataset)
    names = [y] if isinstance(y, str) else list(y)
    _require(dataset, study, names, tolerance)
    rounds, numbers = _folder_of_rounds(path, dataset, force), itertools.count(1)
    options: dict[str, Any] = {"workers": workers, "isolate": isolate, "cell_timeout": cell_timeout}

    def solve(values: Mapping[str, Array]) -> xr.Dataset:
        """A round of cells; of one that an earlier call has computed, the file is there."""
        file = None if rounds is None else rounds / f"{next(numbers)}.h5"
        with run(_study_of(study, values, "zip"), file, progress=file is not None, **options) as found:
            return found.load()

    cells = Refiner(dataset, study, names, tolerance, most_cells, solve)
    cells.refine()
    attrs = {REFINED_TO: json.dumps(dict.fromkeys(names, tolerance))}
    found = report(cells, _gathered(cells, study, path, force, attrs))
    if rounds is not None:
        shutil.rmtree(rounds, ignore_errors=True)
    return found


def _study_of(study: Study, values: Mapping[str, Array], design: str) -> Study:
    """Cells at some values of the axes."""
    axes = {name: Axis(name, frozen(column), "values") for name, column in values.items()}
    return dataclasses.replace(study, design=design, blocks=(), axes=axes, title=f"{study.title}, refined")


def _gathered(
    cells: Refiner, study: Study, path: str | os.PathLike[str] | None, force: bool, attrs: Mapping[str, str]
) -> xr.Dataset:
    """All cells in rising order, in a file or in memory."""
    values = {name: cells.column(name) for name in cells.axes}
    order = np.lexsort(list(values.values())[::-1])
    values = {name: column[order] for name, column in values.items()}
    whole = _study_of(study, values, "product" if len(values) == 1 else "zip")
    arrays = {name: cells.column(name)[order] for name in (*study.outputs, *ANCILLARY)}
    if path is None:
        return in_memory(cell_schema(whole, {}), arrays).assign_attrs(attrs)
    return store_cells(whole, path, arrays, force, attrs=attrs)


def _require(dataset: xr.Dataset, study: Study, names: Sequence[str], tolerance: float) -> None:
    """Raises SweepError for what cannot be refined."""
    axes = study.axes.values()
    if not 0 < tolerance < 1:
        raise SweepError(f"tolerance: expected a number between 0 and 1, found {tolerance}")
    if STATUS not in dataset:
        raise SweepError("a summary keeps no cells; refine a result that has them")
    if any(axis.words is not None or axis.values.ndim > 1 for axis in axes):
        raise SweepError("only number axes can be refined")
    if study.design != "product" and not axes_of(dataset):
        raise SweepError("only a product of axes can be refined, or what was refined before")
    if len(axes) > MOST_AXES:
        raise SweepError(f"at most {MOST_AXES} axes can be refined, found {len(axes)}; fix the others")
    if study.design == "product" and any(len(axis) < 2 or (np.diff(axis.values) <= 0).any() for axis in axes):
        raise SweepError("an axis to be refined needs at least two values, in rising order")
    for name in names:
        if name not in dataset or dataset[name].dims != dataset[STATUS].dims:
            raise SweepError(f"{name}: is no output of one value a cell")
    if bool((dataset[STATUS] == Status.PENDING).any()):
        raise SweepError("the sweep is not finished; run it to its end first")


def _folder_of_rounds(path: str | os.PathLike[str] | None, dataset: xr.Dataset, force: bool) -> Path | None:
    """Where the rounds on the way to a result are kept. Raises SweepError where it is not to be written."""
    if path is None:
        return None
    target, source = as_path(path), dataset.encoding.get("source")
    rounds = target.with_name(f"{target.name}.rounds")
    with disk.refusing(target):
        # rounds that are newer than what is there lead to another result
        latest = max((file.stat().st_mtime for file in rounds.glob("*.h5")), default=0.0)
        if force or (target.exists() and latest <= target.stat().st_mtime):
            shutil.rmtree(rounds, ignore_errors=True)
        check_target(target, force=force, read=[Path(source)] if source else [])
        rounds.mkdir(exist_ok=True)
    return rounds


def report(cells: Refiner, dataset: xr.Dataset) -> Refinement:
    """What came of it, with the dataset of all cells."""
    found, box = cells.found, cells.box
    left = found.valued & found.finest & found.wanted
    steps = [np.diff(np.unique(column)) for column in cells.points.T]
    widths = np.ptp(cells.points[found.corners[found.valued]], axis=1).max(axis=0, initial=0.0)
    unseen = {}
    for name, width, low, high, logarithmic in zip(cells.axes, widths, box.low, box.high, box.logarithmic, strict=True):
        unseen[name] = f"a factor {(high / low) ** width:.3g}" if logarithmic else f"{width * (high - low):.3g}"
    return Refinement(
        dataset=dataset,
        added=len(cells.points) - cells.first,
        uniform=int(math.prod(round(1 / step[step > SAME].min()) + 1 for step in steps)),
        error=float(found.size[found.valued & ~left].max(initial=0.0)),
        tolerance=cells.tolerance,
        complete=not (found.size > cells.tolerance).any(),
        jumps=int((left & ~found.beside).sum()),
        singular=int((left & found.beside).sum()),
        unseen=unseen,
        noise=max(cells.noise.values()),
    )
