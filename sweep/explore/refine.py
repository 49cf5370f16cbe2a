"""Cells where they are needed: a finished sweep refined until straight lines between cells are right to a tolerance.

Cells are joined to simplices, intervals along one axis, in a box stretched to where an output bends (see `metric`).
What is there is judged first: the cells around a simplex tell how far straight lines are off in it (`mesh`). Where that
is more than the tolerance, the edge that bends most is cut in the middle, and the cells around are judged again. So is
the edge across a border between statuses, down to a fixed share of the first grid's step. Where values scatter, so that
further cells are off as much as those before, none are added. What is judged is logarithmic where values are positive,
as a scaling law wants it; elsewhere errors are relative to the largest value.

Cells of one axis are a sweep over its values like any other. Cells of more axes lie anywhere, as those of a zip design.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Status
from sweep.cells.fingerprint import fingerprint
from sweep.cells.schema import ANCILLARY, STATUS, cell_schema
from sweep.errors import SweepError
from sweep.explore.mesh import Array
from sweep.explore.refiner import Refinement, Refiner
from sweep.explore.scattered import MOST_AXES, REFINED_TO, axes_of
from sweep.file import disk
from sweep.file.open import in_memory, open_result
from sweep.file.overwriting import check_target
from sweep.runs.run import run, store_cells
from sweep.study.model import Axis, Study, frozen
from sweep.study.read import study as as_study
from sweep.words import as_path, require_dataset

if TYPE_CHECKING:
    import xarray as xr

MOST_CELLS = 1_000_000


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
        then, so that what was computed is not lost. None: in memory.
    study : Study, optional
        That of the dataset; default: the one in its attributes.
    most_cells : int
        Largest number of cells altogether.
    workers, isolate, cell_timeout
        As of `run`.
    force : bool
        Overwrite the result of another study.

    Raises
    ------
    SweepError
        The dataset is no finished product of one to five number axes, nor refined before; an output is not there or
        runs along something; `path` is not to be written.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(0.1, 10.0, 5)})
    >>> sweep.refine(ds, "period", 1e-3).complete
    True
    """
    require_dataset("refine", dataset)
    study = study or as_study(dataset)
    names = [y] if isinstance(y, str) else list(y)
    _require(dataset, study, names, tolerance)
    title = f"{study.title}, refined"
    target = None if path is None else as_path(path)
    rounds = None if target is None else target.with_name(f"{target.name}.rounds")
    if target is not None and rounds is not None:
        source = dataset.encoding.get("source")
        check_target(target, force=True, read=[Path(source)] if source else [])
        if target.exists() and not force:
            with open_result(target) as there:
                if there.attrs["title"] != title:
                    raise SweepError(f"{target}: holds another result; name another file, or overwrite it with --force")
        with disk.refusing(target):
            rounds.mkdir(exist_ok=True)

    options: dict[str, Any] = {"workers": workers, "isolate": isolate, "cell_timeout": cell_timeout}

    def of(values: Mapping[str, Array], design: str = "zip") -> Study:
        axes = {name: Axis(name, frozen(column), "values") for name, column in values.items()}
        return dataclasses.replace(study, design=design, blocks=(), axes=axes, title=title)

    def solve(values: Mapping[str, Array]) -> xr.Dataset:
        """A round of cells; of one that an earlier call has computed, the file is there."""
        further = of(values)
        if rounds is None:
            return run(further, progress=False, **options)
        name = hashlib.sha256(repr(sorted(fingerprint(further).items())).encode()).hexdigest()[:16]
        with run(further, rounds / f"{name}.h5", **options) as found:
            return found.load()

    cells = Refiner(dataset, study, names, tolerance, most_cells, solve)
    cells.refine()
    order = np.lexsort(cells.values.T[::-1])
    whole = of(dict(zip(cells.axes, cells.values[order].T, strict=True)), "product" if len(cells.axes) == 1 else "zip")
    arrays = {name: cells.column(name)[order] for name in (*study.outputs, *ANCILLARY)}
    attrs = {REFINED_TO: json.dumps(dict.fromkeys(names, tolerance))}
    if target is None or rounds is None:
        return cells.report(in_memory(cell_schema(whole, {}), arrays).assign_attrs(attrs))
    found = cells.report(store_cells(whole, target, arrays, force, attrs=attrs))
    shutil.rmtree(rounds, ignore_errors=True)
    return found


def _require(dataset: xr.Dataset, study: Study, names: Sequence[str], tolerance: float) -> None:
    if not 0 < tolerance < 1:
        raise SweepError(f"tolerance: expected a number between 0 and 1, found {tolerance}")
    if STATUS not in dataset:
        raise SweepError("a summary keeps no cells; refine a result that has them")
    if any(axis.words is not None or axis.values.ndim > 1 for axis in study.axes.values()):
        raise SweepError("only number axes can be refined")
    if study.design != "product" and not axes_of(dataset):
        raise SweepError("only a product of axes can be refined, or what was refined before")
    if len(study.axes) > MOST_AXES:
        raise SweepError(f"at most {MOST_AXES} axes can be refined, found {len(study.axes)}; fix the others")
    if study.design == "product" and any(
        len(axis) < 2 or (np.diff(axis.values) <= 0).any() for axis in study.axes.values()
    ):
        raise SweepError("an axis to be refined needs at least two values, in rising order")
    for name in names:
        if name not in dataset or dataset[name].dims != dataset[STATUS].dims:
            raise SweepError(f"{name}: is no output of one value a cell")
    if bool((dataset[STATUS] == Status.PENDING).any()):
        raise SweepError("the sweep is not finished; run it to its end first")
